"""Which actions of a scenario move the vehicle under test or the target; what cannot be carried out."""

from __future__ import annotations

from scenarios.errors import ScenarioError
from scenarios.openscenario.model import (
    Action,
    DeleteEntityAction,
    EntityDefinition,
    FollowTrajectoryAction,
    LongitudinalDistanceAction,
    ScenarioDefinition,
    SpeedAction,
    SpeedProfileAction,
    SynchronizeAction,
)


def ego_of(definition: ScenarioDefinition) -> EntityDefinition:
    """The entity under test: the one called Ego, or the first.

    Raises:
        ScenarioError: there is none.
    """
    if not definition.entities:
        raise ScenarioError(f"{definition.path}: no road user in <Entities>, thus no vehicle under test")
    return next((e for e in definition.entities if e.name == "Ego"), definition.entities[0])


def ego_actions(definition: ScenarioDefinition, ego: str) -> tuple[list[Action], list[Action]]:
    """What the scenario asks of the ego in its initial actions, and in its events."""
    initial = [action for name, action in definition.init if name == ego]
    later = [a.action for e in definition.events() for a in e.actions if ego in a.entities]
    return initial, later


def drives_backwards(definition: ScenarioDefinition, ego: str) -> bool:
    """Whether the ego drives in reverse.

    Raises:
        ScenarioError: the scenario asks of the ego what cannot be carried out in our hands.
    """
    initial, later = ego_actions(definition, ego)
    event_actions = [a.action for e in definition.events() for a in e.actions]
    if any(isinstance(a, DeleteEntityAction) and a.entity == ego for a in event_actions):
        raise ScenarioError(f"{definition.path}: DeleteEntityAction on '{ego}', the vehicle under test")
    speed_actions = [a for a in (*initial, *later) if isinstance(a, SpeedAction)]
    speeds = [a.target for a in speed_actions if isinstance(a.target, float)]
    if min(speeds, default=0.0) < 0.0 < max(speeds, default=0.0):
        raise ScenarioError(
            f"{definition.path}: SpeedAction of '{ego}' turns its direction; perception looks ahead or "
            "behind for a whole run, so make two scenarios of it"
        )
    return min(speeds, default=0.0) < 0.0


def is_motion(action: Action) -> bool:
    """Whether an action changes the speed of the entity that carries it out."""
    if isinstance(action, FollowTrajectoryAction):
        return action.timing is not None
    return isinstance(
        action, (SpeedAction, SpeedProfileAction, LongitudinalDistanceAction, SynchronizeAction)
    )


def is_to_set_off(definition: ScenarioDefinition, target: str | None) -> bool:
    """Whether the scenario moves the target: by an event, or by an initial action that takes time."""
    actions = [action for name, action in definition.init if name == target]
    actions += [a.action for e in definition.events() for a in e.actions if target in a.entities]
    return any(is_motion(a) and not (isinstance(a, SpeedAction) and a.target == 0.0) for a in actions)
