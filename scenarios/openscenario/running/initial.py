"""The order in which initial actions are carried out, who gets a place later, and whom the ego is to meet.

They all take place at the same instant, whatever their order in the file (OpenSCENARIO XML 1.3, Init): an
action that refers to an entity waits until that entity has its initial place and speed.
"""

from __future__ import annotations

from collections.abc import Sequence

from scenarios.openscenario import model
from scenarios.openscenario.elements import referred
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.roads import Roads

InitialAction = tuple[str | None, model.Action]
"""Entity (None: a global action) and action."""

CHOOSING = (
    model.RelativeDistanceCondition,
    model.DistanceCondition,
    model.TimeToCollisionCondition,
    model.TimeHeadwayCondition,
)
"""Conditions that may say how the way of a distance is chosen."""

_PLACE, _SPEED = "place", "speed"


def in_order(init: Sequence[InitialAction]) -> list[InitialAction]:
    """Initial actions, each after those that it depends on; otherwise as the file has them.

    Actions that wait for one another in a circle stay in the order of the file.
    """
    waiting, ordered = list(init), list[InitialAction]()
    while waiting:
        ready = next((k for k in range(len(waiting)) if not _waits(k, waiting)), 0)
        ordered.append(waiting.pop(ready))
    return ordered


def _who(item: InitialAction) -> str | None:
    """Whom an action is about: the one that it adds, or the one that carries it out."""
    entity, action = item
    return action.entity if isinstance(action, model.AddEntityAction) else entity


def _sets(action: model.Action) -> frozenset[str]:
    """What an action gives its entity."""
    match action:
        case model.TeleportAction() | model.AddEntityAction():
            return frozenset({_PLACE})
        case model.SpeedAction() | model.SynchronizeAction():
            return frozenset({_SPEED})
        case model.SpeedProfileAction():
            return frozenset({_SPEED})
        case model.LongitudinalDistanceAction() | model.FollowTrajectoryAction():
            return frozenset({_PLACE, _SPEED})
    return frozenset()


def _asks(action: model.Action) -> frozenset[str]:
    """What an action has to know of the entities that it refers to."""
    match action:
        case (
            model.TeleportAction()
            | model.FollowTrajectoryAction()
            | model.AssignRouteAction()
            | model.AcquirePositionAction()
        ):
            return frozenset({_PLACE})
        case model.SpeedAction() | model.SpeedProfileAction():
            return frozenset({_SPEED})
    return frozenset({_PLACE, _SPEED})


def _waits(k: int, waiting: Sequence[InitialAction]) -> bool:
    """Whether an action depends on another one that waits too."""
    entity, action = _who(waiting[k]), waiting[k][1]
    names, asked, set_by_it = referred(action), _asks(action), _sets(action)
    needs_place = not isinstance(action, model.TeleportAction | model.AddEntityAction | model.SpeedAction)
    for number, item in enumerate(waiting):
        if number == k:
            continue
        other, before = _who(item), item[1]
        if other in names and other != entity and _sets(before) & asked:
            return True
        # of the entity's own the place comes first, and what sets the same stays in the order of the file
        if other == entity and number < k and _sets(before) & set_by_it:
            return True
        if (
            other == entity
            and needs_place
            and isinstance(before, model.TeleportAction | model.AddEntityAction | model.SpeedAction)
        ):
            return True
    return False


def brings(action: model.Action) -> bool:
    """Whether an action gives a place to an entity that has none."""
    return isinstance(action, model.TeleportAction | model.FollowTrajectoryAction)


def come_later(definition: model.ScenarioDefinition) -> dict[str, bool]:
    """Who is given a place by an event, and whether by an AddEntityAction."""
    later: dict[str, bool] = {}
    for event in definition.events():
        for named in event.actions:
            if isinstance(named.action, model.AddEntityAction):
                later[named.action.entity] = True
            elif brings(named.action):
                later |= {name: later.get(name, False) for name in named.entities}
    return later


def is_used(definition: model.ScenarioDefinition, name: str) -> bool:
    """Whether an action moves an entity, or anything refers to it."""
    if any(name == who or name in referred(action) for who, action in definition.init):
        return True
    for event in definition.events():
        for named in event.actions:
            if name in named.entities or name in referred(named.action):
                return True
    kinds = (condition.kind for condition in definition.conditions())
    return any(
        name in kind.entities or name in referred(kind.kind)
        for kind in kinds
        if isinstance(kind, model.EntityCondition)
    )


def refuse_choice(condition: model.Condition, roads: Roads) -> None:
    """Refuse a distance along roads whose way is to be chosen in a manner that is not carried out.

    It is measured along the lanes ahead or back, at forks along the straightest: where lanes never fork, all
    manners are that one.

    Raises:
        RunError: it asks for another, and lanes fork.
    """
    kind = condition.kind.kind if isinstance(condition.kind, model.EntityCondition) else None
    if not isinstance(kind, CHOOSING) or kind.routing in ("undefined", "shortest"):
        return
    if (kind.along_route or kind.system in ("road", "lane")) and roads.forks:
        raise RunError(
            f"condition '{condition.name}': routingAlgorithm='{kind.routing}' is not carried out where lanes "
            "fork; the distance along the straightest is routingAlgorithm='undefined'"
        )


def target_of(definition: model.ScenarioDefinition, ego: str) -> str | None:
    """Whom the ego is to meet.

    Named in a collision condition, synchronised with the ego, set in motion by an event, or the next.
    """
    names: list[str] = []
    moved: list[str] = []
    for event in definition.events():
        for condition in (c for group in event.start or () for c in group):
            kind = condition.kind
            if not isinstance(kind, model.EntityCondition) or ego not in kind.entities:
                continue
            if isinstance(kind.kind, model.CollisionCondition) and kind.kind.entity is not None:
                names.insert(0, kind.kind.entity)
        for action in event.actions:
            if isinstance(action.action, model.SynchronizeAction):
                names.extend(action.entities)
            elif isinstance(
                action.action, model.SpeedAction | model.FollowTrajectoryAction | model.LaneChangeAction
            ):
                moved.extend(action.entities)
    names.extend((*moved, *(entity.name for entity in definition.entities)))
    return next((name for name in names if name != ego), None)
