"""Actions of entities (private) and of the scenario (global)."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Literal, TypeAlias

from scenarios.openscenario.elements import Attribute, Child, Element, EntityName, Reference
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model.entities import Controller, Environment
from scenarios.openscenario.model.positions import Position, Route, System, Trajectory

SpeedShape: TypeAlias = Literal["step", "linear", "cubic", "sinusoidal"]
Dimension: TypeAlias = Literal["time", "rate", "distance"]


class RelativeSpeed(Element):
    """Speed relative to an entity's: difference in m/s, or factor; `continuous`: it stays so."""

    entity: EntityName
    value: float
    is_factor: bool
    continuous: bool = False


class SpeedAction(Element, group="LongitudinalAction", children="SpeedActionDynamics SpeedActionTarget"):
    """Change to a speed with given dynamics; a step that lasts goes on for the value's time or way."""

    shape: SpeedShape
    dimension: Dimension
    value: float
    target: float | RelativeSpeed
    lasts: bool = False


class DynamicConstraints(Element):
    """Limits of a change, as amounts; None: there is none."""

    max_acceleration_mps2: Annotated[float | None, Attribute("maxAcceleration", sign="not negative")] = None
    max_deceleration_mps2: Annotated[float | None, Attribute("maxDeceleration", sign="not negative")] = None
    max_speed_mps: Annotated[float | None, Attribute("maxSpeed", sign="not negative")] = None
    max_acceleration_rate_mps3: Annotated[
        float | None, Attribute("maxAccelerationRate", sign="not negative")
    ] = None
    max_deceleration_rate_mps3: Annotated[
        float | None, Attribute("maxDecelerationRate", sign="not negative")
    ] = None


class SpeedEntry(Element):
    """A speed of a profile, and how long after the one before it is reached; None: as soon as it can be."""

    speed_mps: float
    time_s: float | None


class SpeedProfileAction(
    Element,
    group="LongitudinalAction",
    attributes="entityRef followingMode",
    children="DynamicConstraints SpeedProfileEntry",
):
    """Drive speeds one after the other.

    Args:
        entity: whose speed at the start is added to all; None: they are absolute.
        smooth: within constraints, also of how quickly an acceleration may change; else by straight lines.
        constraints: limits.
        entries: speeds.
    """

    entity: str | None
    smooth: bool
    constraints: DynamicConstraints
    entries: tuple[SpeedEntry, ...]


class LongitudinalDistanceAction(
    Element,
    group="LongitudinalAction",
    attributes="entityRef distance timeGap freespace continuous displacement coordinateSystem",
    children="DynamicConstraints",
    first="ahead",
):
    """Be at a distance (or time gap) from an entity, at once or within constraints; if continuous, keep it.

    `ahead` tells on which side of the entity: in front of it, behind, or (None) on the side where it is now.
    """

    entity: EntityName
    distance_m: Annotated[float | None, Attribute("distance", sign="not negative")]
    time_gap_s: Annotated[float | None, Attribute("timeGap", sign="not negative")]
    freespace: Annotated[bool, Attribute("freespace")]
    continuous: Annotated[bool, Attribute("continuous")]
    ahead: Annotated[
        bool | None,
        Attribute(
            "displacement",
            "trailingReferencedEntity",
            {"any": None, "leadingReferencedEntity": True, "trailingReferencedEntity": False},
        ),
    ]
    system: Annotated[System, Attribute("coordinateSystem", "entity")] = "entity"
    constraints: Annotated[DynamicConstraints | None, Child("DynamicConstraints")] = None


class RelativeLane(Element):
    """A lane so many to the left of that of an entity, as the entity sees it."""

    entity: EntityName
    lanes: int


class LaneChangeAction(
    Element,
    group="LateralAction",
    attributes="targetLaneOffset",
    children="LaneChangeActionDynamics LaneChangeTarget",
):
    """Change to a lane, which is a lane id or counts from an entity, with given dynamics.

    `offset_m` is that in the target lane, along the t axis of its road.
    """

    shape: SpeedShape
    dimension: Dimension
    value: float
    target: int | RelativeLane
    offset_m: float


class RelativeOffset(Element):
    """A place so far to the left of an entity, as the entity sees it."""

    entity: EntityName
    offset_m: float


class LaneOffsetAction(
    Element,
    group="LateralAction",
    attributes="continuous",
    children="LaneOffsetActionDynamics LaneOffsetTarget",
):
    """Take an offset in the lane (along the t axis of its road) or beside an entity, and keep it.

    `max_lateral_mps2` None: at once. `continuous`: the action goes on until something stops it.
    """

    shape: SpeedShape
    max_lateral_mps2: float | None
    target: float | RelativeOffset
    continuous: bool


class LateralDistanceAction(
    Element,
    group="LateralAction",
    attributes="entityRef distance freespace continuous displacement coordinateSystem",
    children="DynamicConstraints",
):
    """Be at a distance beside an entity, and, if continuous, keep it.

    Args:
        entity: the other.
        distance_m: 0 where the file gives none.
        freespace: between outlines; else between reference points.
        continuous: the action goes on until something stops it.
        left: on which side of the entity; None: where it is.
        constraints: None: at once.
        system: across what the distance is measured.
    """

    entity: EntityName
    distance_m: Annotated[float, Attribute("distance", 0.0, sign="not negative")]
    freespace: Annotated[bool, Attribute("freespace")]
    continuous: Annotated[bool, Attribute("continuous")]
    left: Annotated[
        bool | None,
        Attribute(
            "displacement",
            "any",
            {"any": None, "leftToReferencedEntity": True, "rightToReferencedEntity": False},
        ),
    ]
    constraints: Annotated[DynamicConstraints | None, Child("DynamicConstraints")] = None
    system: Annotated[
        Literal["entity", "lane", "road", "trajectory"], Attribute("coordinateSystem", "entity")
    ] = "entity"


class SteadyState(Element):
    """Last part of a synchronised approach, at the final speed: a distance or a duration."""

    distance_m: float | None
    time_s: float | None


class SynchronizeAction(
    Element,
    attributes="masterEntityRef targetTolerance targetToleranceMaster",
    children="TargetPositionMaster TargetPosition FinalSpeed",
):
    """Be at a place when another entity (the master) is at its place.

    `final_speed` is None where the file asks for none. The action ends within `tolerance_m` of the place.
    """

    master: Annotated[str, Reference("masterEntityRef")]
    master_target: Position
    target: Position
    final_speed: float | RelativeSpeed | None
    steady: SteadyState | None
    tolerance_m: float = 0.0


class TimeReference(Element, tag="Timing"):
    """How times of a trajectory become times of the run."""

    relative: Annotated[
        bool, Attribute("domainAbsoluteRelative", values={"absolute": False, "relative": True})
    ]
    scale: Annotated[float, Attribute("scale", sign="positive")]
    offset_s: Annotated[float, Attribute("offset")]


class FollowTrajectoryAction(
    Element,
    group="RoutingAction",
    attributes="initialDistanceOffset",
    children="TimeReference TrajectoryFollowingMode TrajectoryRef Trajectory CatalogReference",
):
    """Follow a trajectory: at the entity's own speed, or (with `timing`) by the times of its vertices.

    `steers`: it drives to the trajectory from where it is; else it is on it at once.
    """

    trajectory: Trajectory
    initial_distance_m: float
    timing: TimeReference | None
    steers: bool = False

    @property
    def curve(self) -> Trajectory:
        """The trajectory; where it has times, one round of it."""
        once = self.timing is not None and self.trajectory.closed
        return replace(self.trajectory, closed=False) if once else self.trajectory


class AssignRouteAction(Element, group="RoutingAction"):
    """Follow a route."""

    route: Route


class AcquirePositionAction(Element, group="RoutingAction"):
    """Drive to a place along lanes."""

    position: Annotated[Position, Child("Position")]


class TeleportAction(Element):
    """Be at a place at once."""

    position: Annotated[Position, Child("Position")]


class VisibilityAction(Element):
    """Whether sensors see the entity."""

    graphics: Annotated[bool, Attribute("graphics")]
    sensors: Annotated[bool, Attribute("sensors")]
    traffic: Annotated[bool, Attribute("traffic")]


class LightStateAction(
    Element, group="AppearanceAction", attributes="transitionTime", children="LightType LightState"
):
    """Switch a light."""

    light: str
    mode: str


class AnimationAction(
    Element,
    group="AppearanceAction",
    attributes="loop animationDuration",
    children="AnimationType AnimationState",
):
    """Move a part of the entity, or let a pedestrian gesture: of this its duration alone is carried out."""

    loop: Annotated[bool, Attribute("loop", False)]
    duration_s: Annotated[float, Attribute("animationDuration", 0.0, sign="not negative")]


class ActivateControllerAction(Element):
    """Let a controller drive an entity, or no longer; None: as before.

    `controller` None: the one that was assigned last. `where` is its place in the file.
    """

    controller: str | None
    lateral: bool | None
    longitudinal: bool | None
    where: str = ""


class ControllerAction(Element):
    """What concerns the controllers of an entity.

    Args:
        assigned: a further controller; None: none.
        activated: which controller drives; None: as before.
        overridden: pedals and wheels whose values the scenario sets from now on.
        where: its place in the file.
    """

    assigned: Controller | None
    activated: ActivateControllerAction | None
    overridden: tuple[str, ...]
    where: str = ""


class ConnectTrailerAction(Element, group="TrailerAction"):
    """Couple a trailer to the hitch of the entity."""

    trailer: Annotated[str, Reference("trailerRef")]


class DisconnectTrailerAction(Element, group="TrailerAction"):
    """Let go of the trailer that is coupled to the entity."""


class EnvironmentAction(Element):
    """Change light and weather."""

    environment: Environment


class AddEntityAction(Element):
    """Put an entity into the scenario that is not in it: from the start, or since it was deleted."""

    entity: str
    position: Position


class DeleteEntityAction(Element):
    """Take an entity out of the scenario."""

    entity: str


class SetParameterAction(Element):
    """Give a parameter a value, which conditions see; what has been read with the old one keeps it."""

    parameter: str
    value: Value


class ModifyParameterAction(Element):
    """Add to a parameter or multiply it."""

    parameter: str
    operator: Literal["add", "multiply"]
    value: float


class SignalStateAction(Element):
    """Let a traffic signal show a state."""

    signal: str
    state: str


class SignalPhaseAction(Element):
    """Put a controller of traffic signals into a phase."""

    controller: str
    phase: str


class SetMonitorAction(Element):
    """Tell a value to whoever watches the run: nothing in the scenario can depend on it."""

    monitor: str


class SetVariableAction(Element):
    """Give a variable a value."""

    variable: str
    value: Value


class ModifyVariableAction(Element):
    """Add to a variable or multiply it."""

    variable: str
    operator: Literal["add", "multiply"]
    value: float


PrivateAction: TypeAlias = (
    SpeedAction
    | SpeedProfileAction
    | LongitudinalDistanceAction
    | LaneChangeAction
    | LaneOffsetAction
    | LateralDistanceAction
    | VisibilityAction
    | SynchronizeAction
    | TeleportAction
    | FollowTrajectoryAction
    | AssignRouteAction
    | AcquirePositionAction
    | LightStateAction
    | AnimationAction
    | ActivateControllerAction
    | ControllerAction
    | ConnectTrailerAction
    | DisconnectTrailerAction
)
GlobalAction: TypeAlias = (
    EnvironmentAction
    | AddEntityAction
    | DeleteEntityAction
    | SetVariableAction
    | ModifyVariableAction
    | SetMonitorAction
    | SetParameterAction
    | ModifyParameterAction
    | SignalStateAction
    | SignalPhaseAction
)
Action: TypeAlias = PrivateAction | GlobalAction
