"""A scenario as read: records whose values are final (parameters resolved, references checked).

Metres, seconds, radians; names and enumeration values as in ASAM OpenSCENARIO XML 1.3.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, TypeAlias

from scenarios.openscenario.expressions import Value
from scenarios.openscenario.values import Immutable

# Positions


@dataclass(frozen=True, slots=True)
class Orientation(Immutable):
    """Heading; `relative` to the frame of the position, or absolute in the map frame."""

    heading_rad: float = 0.0
    relative: bool = True


@dataclass(frozen=True, slots=True)
class WorldPosition(Immutable):
    """A point of the map frame."""

    x_m: float
    y_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class LanePosition(Immutable):
    """A place in a lane, offset from its middle to the left (positive t)."""

    road_id: str
    lane_id: int
    s_m: float
    offset_m: float
    orientation: Orientation


@dataclass(frozen=True, slots=True)
class RoadPosition(Immutable):
    """A place in road coordinates."""

    road_id: str
    s_m: float
    t_m: float
    orientation: Orientation


@dataclass(frozen=True, slots=True)
class RelativeLanePosition(Immutable):
    """A place as many lanes and metres from an entity; `along_lane` measures along the lane, not the road."""

    entity: str
    d_lane: int
    ds_m: float
    offset_m: float
    along_lane: bool
    orientation: Orientation


@dataclass(frozen=True, slots=True)
class RelativeRoadPosition(Immutable):
    """Road coordinates of an entity plus differences."""

    entity: str
    ds_m: float
    dt_m: float
    orientation: Orientation


@dataclass(frozen=True, slots=True)
class RelativeObjectPosition(Immutable):
    """A point in an entity's own frame."""

    entity: str
    dx_m: float
    dy_m: float
    orientation: Orientation


@dataclass(frozen=True, slots=True)
class RelativeWorldPosition(Immutable):
    """An entity's point plus differences along the axes of the map frame."""

    entity: str
    dx_m: float
    dy_m: float
    orientation: Orientation


@dataclass(frozen=True, slots=True)
class RoutePosition(Immutable):
    """A place on a route; `lane_id` is None for road coordinates (then `offset_m` is t).

    Lane ids, offsets and heading are those of a road whose s runs along the route.
    """

    route: Route
    path_s_m: float
    lane_id: int | None
    offset_m: float
    orientation: Orientation


@dataclass(frozen=True, slots=True)
class TrajectoryPosition(Immutable):
    """A place beside a trajectory, in its own s and t."""

    trajectory: Trajectory
    s_m: float
    t_m: float
    orientation: Orientation


Position: TypeAlias = (
    WorldPosition
    | LanePosition
    | RoadPosition
    | RelativeLanePosition
    | RelativeRoadPosition
    | RelativeObjectPosition
    | RelativeWorldPosition
    | RoutePosition
    | TrajectoryPosition
)

# Routes and trajectories


@dataclass(frozen=True, slots=True)
class Route(Immutable):
    """Waypoints, joined by the shortest way along lanes."""

    name: str
    waypoints: tuple[Position, ...]


@dataclass(frozen=True, slots=True)
class Vertex(Immutable):
    """Corner of a polyline, with its time if the trajectory has times."""

    position: Position
    time_s: float | None


@dataclass(frozen=True, slots=True)
class Polyline(Immutable):
    """Straight pieces between vertices."""

    vertices: tuple[Vertex, ...]


@dataclass(frozen=True, slots=True)
class ClothoidSegment(Immutable):
    """Piece of a clothoid spline; curvature changes linearly along it.

    `start` moves the piece there; without it the piece starts where the one before ends.
    """

    length_m: float
    curvature_start_per_m: float
    curvature_end_per_m: float
    start: Position | None
    heading_offset_rad: float


@dataclass(frozen=True, slots=True)
class ClothoidSpline(Immutable):
    """Clothoid pieces one after the other; without a start the first begins at the entity."""

    segments: tuple[ClothoidSegment, ...]
    time_end_s: float | None


@dataclass(frozen=True, slots=True)
class Nurbs(Immutable):
    """Non-uniform rational B-spline; `order` is degree + 1."""

    order: int
    control_points: tuple[Position, ...]
    weights: tuple[float, ...]
    knots: tuple[float, ...]


Shape: TypeAlias = Polyline | ClothoidSpline | Nurbs


@dataclass(frozen=True, slots=True)
class Trajectory(Immutable):
    """A curve to follow."""

    name: str
    shape: Shape


# Entities


@dataclass(frozen=True, slots=True)
class Performance(Immutable):
    """Limits of a vehicle, none of them negative."""

    max_speed_mps: float
    max_acceleration_mps2: float
    max_deceleration_mps2: float


@dataclass(frozen=True, slots=True)
class EntityDefinition(Immutable):
    """A road user or obstacle. The reference point of a vehicle is the middle of its rear axle on the ground.

    Args:
        name: in the scenario.
        model: name of the vehicle, pedestrian or object.
        category: one of the detection categories.
        length_m, width_m, height_m: bounding box.
        center_x_m, center_y_m: centre of the box in front of and to the left of the reference point.
        performance: what a vehicle can do, if the file says so.
    """

    name: str
    model: str
    category: str
    length_m: float
    width_m: float
    height_m: float
    center_x_m: float
    center_y_m: float
    performance: Performance | None = None


@dataclass(frozen=True, slots=True)
class Environment(Immutable):
    """Light and weather as far as the file gives them.

    Args:
        name: of the environment.
        illuminance_lx: of the sun (in night environments: of the moon).
        sun_elevation_rad: over the horizon.
        precipitation: dry, rain or snow.
        precipitation_mm_h: intensity; None in version 1.0, which gives a number from 0 to 1 without unit,
            unless that is 0.
        visual_range_m: in fog.
        friction_scale: factor on the road's friction.
        wetness: of the road: dry, moist, wetWithPuddles, lowFlooded or highFlooded.
    """

    name: str
    illuminance_lx: float | None = None
    sun_elevation_rad: float | None = None
    precipitation: str | None = None
    precipitation_mm_h: float | None = None
    visual_range_m: float | None = None
    friction_scale: float | None = None
    wetness: str | None = None


# Actions

SpeedShape: TypeAlias = Literal["step", "linear", "cubic", "sinusoidal"]
Dimension: TypeAlias = Literal["time", "rate", "distance"]


@dataclass(frozen=True, slots=True)
class RelativeSpeed(Immutable):
    """Speed relative to an entity's: difference in m/s, or factor."""

    entity: str
    value: float
    is_factor: bool


@dataclass(frozen=True, slots=True)
class SpeedAction(Immutable):
    """Change to a speed with given dynamics."""

    shape: SpeedShape
    dimension: Dimension
    value: float
    target: float | RelativeSpeed


@dataclass(frozen=True, slots=True)
class LongitudinalDistanceAction(Immutable):
    """Be at a distance (or time gap) from an entity at once, and, if continuous, keep it.

    `ahead` tells on which side of the entity: in front of it, behind, or (None) on the side where it is now.
    """

    entity: str
    distance_m: float | None
    time_gap_s: float | None
    freespace: bool
    continuous: bool
    ahead: bool | None


@dataclass(frozen=True, slots=True)
class SteadyState(Immutable):
    """Last part of a synchronised approach, at the final speed: a distance or a duration."""

    distance_m: float | None
    time_s: float | None


@dataclass(frozen=True, slots=True)
class SynchronizeAction(Immutable):
    """Be at a place when another entity (the master) is at its place.

    `final_speed` is None where the file asks for none.
    """

    master: str
    master_target: Position
    target: Position
    final_speed: float | RelativeSpeed | None
    steady: SteadyState | None


@dataclass(frozen=True, slots=True)
class TimeReference(Immutable):
    """How times of a trajectory become times of the run."""

    relative: bool
    scale: float
    offset_s: float


@dataclass(frozen=True, slots=True)
class FollowTrajectoryAction(Immutable):
    """Follow a trajectory: at the entity's own speed, or (with `timing`) by the times of its vertices.

    `steers`: it drives to the trajectory from where it is; else it is on it at once.
    """

    trajectory: Trajectory
    initial_distance_m: float
    timing: TimeReference | None
    steers: bool = False


@dataclass(frozen=True, slots=True)
class AssignRouteAction(Immutable):
    """Follow a route."""

    route: Route


@dataclass(frozen=True, slots=True)
class TeleportAction(Immutable):
    """Be at a place at once."""

    position: Position


@dataclass(frozen=True, slots=True)
class VisibilityAction(Immutable):
    """Whether sensors see the entity."""

    graphics: bool
    sensors: bool
    traffic: bool


@dataclass(frozen=True, slots=True)
class LightStateAction(Immutable):
    """Switch a light."""

    light: str
    mode: str


@dataclass(frozen=True, slots=True)
class EnvironmentAction(Immutable):
    """Change light and weather."""

    environment: Environment


@dataclass(frozen=True, slots=True)
class DeleteEntityAction(Immutable):
    """Take an entity out of the scenario."""

    entity: str


@dataclass(frozen=True, slots=True)
class SetVariableAction(Immutable):
    """Give a variable a value."""

    variable: str
    value: Value


@dataclass(frozen=True, slots=True)
class ModifyVariableAction(Immutable):
    """Add to a variable or multiply it."""

    variable: str
    operator: Literal["add", "multiply"]
    value: float


PrivateAction: TypeAlias = (
    SpeedAction
    | LongitudinalDistanceAction
    | SynchronizeAction
    | FollowTrajectoryAction
    | AssignRouteAction
    | TeleportAction
    | VisibilityAction
    | LightStateAction
)
GlobalAction: TypeAlias = EnvironmentAction | DeleteEntityAction | SetVariableAction | ModifyVariableAction
Action: TypeAlias = PrivateAction | GlobalAction

# Conditions

Direction: TypeAlias = Literal["longitudinal", "lateral", "vertical"]
Distance: TypeAlias = Literal["longitudinal", "lateral", "euclidianDistance"]


@dataclass(frozen=True, slots=True)
class SimulationTimeCondition(Immutable):
    """Time of the run."""

    rule: str
    value: float


@dataclass(frozen=True, slots=True)
class ParameterCondition(Immutable):
    """A parameter's value, which is fixed."""

    actual: Value
    rule: str
    value: Value


@dataclass(frozen=True, slots=True)
class VariableCondition(Immutable):
    """A variable's value."""

    variable: str
    rule: str
    value: Value


@dataclass(frozen=True, slots=True)
class StoryboardElementStateCondition(Immutable):
    """State or transition of an element, named by its path from the storyboard's stories."""

    kind: str
    path: tuple[str, ...]
    state: str


@dataclass(frozen=True, slots=True)
class CollisionCondition(Immutable):
    """Overlap with an entity."""

    entity: str


@dataclass(frozen=True, slots=True)
class SpeedCondition(Immutable):
    """Speed in a direction of the entity; without direction its amount."""

    rule: str
    value: float
    direction: Direction | None


@dataclass(frozen=True, slots=True)
class RelativeSpeedCondition(Immutable):
    """Velocity less another entity's, in a direction of the first; without direction speed less speed."""

    entity: str
    rule: str
    value: float
    direction: Direction | None


@dataclass(frozen=True, slots=True)
class AccelerationCondition(Immutable):
    """Acceleration in a direction of the entity; without direction its amount."""

    rule: str
    value: float
    direction: Direction | None


@dataclass(frozen=True, slots=True)
class RelativeDistanceCondition(Immutable):
    """Distance to another entity: between reference points, or between outlines if `freespace`."""

    entity: str
    rule: str
    value: float
    kind: Distance
    freespace: bool


@dataclass(frozen=True, slots=True)
class TimeToCollisionCondition(Immutable):
    """Distance to another entity over the speed at which it shrinks; does not hold while it does not."""

    entity: str
    rule: str
    value: float
    kind: Distance
    freespace: bool


@dataclass(frozen=True, slots=True)
class TimeHeadwayCondition(Immutable):
    """Distance to another entity over the own speed."""

    entity: str
    rule: str
    value: float
    kind: Distance
    freespace: bool


@dataclass(frozen=True, slots=True)
class StandStillCondition(Immutable):
    """Speed zero for a time."""

    duration_s: float


@dataclass(frozen=True, slots=True)
class TraveledDistanceCondition(Immutable):
    """Distance gone since the start of the run."""

    value: float


@dataclass(frozen=True, slots=True)
class AngleCondition(Immutable):
    """Heading in the map frame, within a tolerance."""

    angle_rad: float
    tolerance_rad: float


@dataclass(frozen=True, slots=True)
class ReachPositionCondition(Immutable):
    """Reference point within a tolerance of a position."""

    position: Position
    tolerance_m: float


ValueConditionKind: TypeAlias = (
    SimulationTimeCondition | ParameterCondition | VariableCondition | StoryboardElementStateCondition
)
EntityConditionKind: TypeAlias = (
    CollisionCondition
    | SpeedCondition
    | RelativeSpeedCondition
    | AccelerationCondition
    | RelativeDistanceCondition
    | TimeToCollisionCondition
    | TimeHeadwayCondition
    | StandStillCondition
    | TraveledDistanceCondition
    | AngleCondition
    | ReachPositionCondition
)


@dataclass(frozen=True, slots=True)
class EntityCondition(Immutable):
    """A condition on triggering entities: any or all of them."""

    entities: tuple[str, ...]
    every: bool
    kind: EntityConditionKind


@dataclass(frozen=True, slots=True)
class Condition(Immutable):
    """A condition with edge and delay."""

    name: str
    delay_s: float
    edge: str
    kind: ValueConditionKind | EntityCondition


Trigger: TypeAlias = tuple[tuple[Condition, ...], ...]
"""Alternatives; the conditions of one alternative hold together."""

# Storyboard


@dataclass(frozen=True, slots=True)
class NamedAction(Immutable):
    """An action of an event; `entities` are those that carry it out, none for a global action."""

    name: str
    action: Action
    entities: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Event(Immutable):
    """Actions started together. `start` None: as soon as the event may."""

    name: str
    priority: str
    max_executions: int
    actions: tuple[NamedAction, ...]
    start: Trigger | None


@dataclass(frozen=True, slots=True)
class Maneuver(Immutable):
    """Events."""

    name: str
    events: tuple[Event, ...]


@dataclass(frozen=True, slots=True)
class ManeuverGroup(Immutable):
    """Maneuvers of the same actors."""

    name: str
    max_executions: int
    maneuvers: tuple[Maneuver, ...]


@dataclass(frozen=True, slots=True)
class Act(Immutable):
    """Maneuver groups, started and stopped together."""

    name: str
    groups: tuple[ManeuverGroup, ...]
    start: Trigger | None
    stop: Trigger | None


@dataclass(frozen=True, slots=True)
class Story(Immutable):
    """Acts."""

    name: str
    acts: tuple[Act, ...]


@dataclass(frozen=True, slots=True)
class ScenarioDefinition(Immutable):
    """A scenario that can be run.

    Args:
        path: the scenario file.
        description: from its header.
        parameters: final values by name.
        variables: start values by name.
        map_path: the OpenDRIVE file.
        entities: in the order of the file.
        init: actions before the start, with the entity that carries them out (None: global).
        stories: the storyboard.
        stop: stop trigger of the storyboard.
        files: every file that was read for it: the scenario, all files of its catalog directories, the map.
    """

    path: Path
    description: str
    parameters: Mapping[str, Value]
    variables: Mapping[str, Value]
    map_path: Path
    entities: tuple[EntityDefinition, ...]
    init: tuple[tuple[str | None, Action], ...]
    stories: tuple[Story, ...]
    stop: Trigger | None
    files: tuple[Path, ...] = ()

    def events(self) -> Iterator[Event]:
        """All events, in the order of the file."""
        for story in self.stories:
            for act in story.acts:
                for group in act.groups:
                    for maneuver in group.maneuvers:
                        yield from maneuver.events

    def conditions(self) -> Iterator[Condition]:
        """All conditions of all triggers."""
        triggers = [self.stop]
        triggers += [
            trigger for story in self.stories for act in story.acts for trigger in (act.start, act.stop)
        ]
        triggers += [event.start for event in self.events()]
        for trigger in triggers:
            for group in trigger or ():
                yield from group
