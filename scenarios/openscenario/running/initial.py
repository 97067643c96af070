"""The order of initial actions, who gets a place later, places off the road, and whom the ego is to meet.

They all take place at the same instant, whatever their order in the file (OpenSCENARIO XML 1.3, Init): an
action that refers to an entity waits until that entity has its initial place and speed.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence

from scenarios.openscenario import model
from scenarios.openscenario.elements import referred
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.positions import Locator
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.motion.trajectories import starts_at_entity

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
    before = _before(init)
    after: list[list[int]] = [[] for _ in init]
    for number, needed in enumerate(before):
        for other in needed:
            after[other].append(number)
    ready = [number for number, needed in enumerate(before) if not needed]
    waiting, first = set(range(len(init))), 0
    ordered: list[InitialAction] = []
    while waiting:
        while first not in waiting:
            first += 1
        number = heapq.heappop(ready) if ready else first
        if number not in waiting:  # one of a circle, which is ready once the others have gone
            continue
        waiting.remove(number)
        ordered.append(init[number])
        for other in after[number]:
            before[other].discard(number)
            if not before[other]:
                heapq.heappush(ready, other)
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


def _before(init: Sequence[InitialAction]) -> list[set[int]]:
    """Numbers of the actions that each one depends on."""
    of: dict[str | None, list[int]] = {}
    for number, item in enumerate(init):
        of.setdefault(_who(item), []).append(number)
    given = [_sets(action) for _, action in init]
    placing = model.TeleportAction | model.AddEntityAction | model.SpeedAction
    depends: list[set[int]] = []
    for k, item in enumerate(init):
        entity, action = _who(item), item[1]
        asked, needs_place = _asks(action), not isinstance(action, placing)
        others = (j for name in referred(action) if name != entity for j in of.get(name, ()))
        needed = {j for j in others if given[j] & asked}
        # of the entity's own the place comes first, and what sets the same stays in the order of the file
        needed |= {j for j in of[entity] if j < k and given[j] & given[k]}
        if needs_place:
            needed |= {j for j in of[entity] if j != k and isinstance(init[j][1], placing)}
        depends.append(needed)
    return depends


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
            f"condition '{condition.name}' ({condition.where}): routingAlgorithm='{kind.routing}' is not "
            "carried out where lanes fork; the distance along the straightest is routingAlgorithm='undefined'"
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


def check_places(definition: model.ScenarioDefinition, locator: Locator) -> None:
    """Find places off the road that an action or a condition names before the run.

    What is relative to an entity is known only when its action starts.

    Raises:
        RunError: there is one.
    """
    for event in definition.events():
        for action in (named.action for named in event.actions):
            match action:
                case model.SynchronizeAction():
                    for position in (action.target, action.master_target):
                        if not referred(position):
                            locator.pose(position)
                case model.TeleportAction() | model.AddEntityAction() if not referred(action.position):
                    locator.pose(action.position)
                case model.FollowTrajectoryAction(curve=curve):
                    if not starts_at_entity(curve) and not referred(curve):
                        locator.trajectory(curve, None)
                case model.AssignRouteAction() if not referred(action.route):
                    locator.legs(action.route)
    for condition in definition.conditions():
        refuse_choice(condition, locator.roads)
        match condition.kind:
            case model.EntityCondition(
                kind=model.ReachPositionCondition(position=position)
                | model.DistanceCondition(position=position)
            ):
                if not referred(position):
                    locator.pose(position)
