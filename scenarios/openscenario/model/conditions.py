"""Conditions and triggers."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from scenarios.openscenario.elements import Attribute, Child, Element, EntityName, Only, Reference
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model.positions import Position, System

Direction: TypeAlias = Literal["longitudinal", "lateral", "vertical"]
Distance: TypeAlias = Literal["longitudinal", "lateral", "euclidianDistance"]
Rule: TypeAlias = Literal["equalTo", "notEqualTo", "greaterThan", "greaterOrEqual", "lessThan", "lessOrEqual"]
Edge: TypeAlias = Literal["none", "rising", "falling", "risingOrFalling"]
ElementKind: TypeAlias = Literal["story", "act", "maneuverGroup", "maneuver", "event", "action"]
ElementState: TypeAlias = Literal[
    "startTransition",
    "endTransition",
    "stopTransition",
    "skipTransition",
    "completeState",
    "runningState",
    "standbyState",
]

RuleAttribute: TypeAlias = Annotated[Rule, Attribute("rule")]
ValueAttribute: TypeAlias = Annotated[float, Attribute("value")]
DirectionAttribute: TypeAlias = Annotated[Direction | None, Attribute("direction")]
Freespace: TypeAlias = Annotated[bool, Attribute("freespace")]

DISTANCES = {
    "longitudinal": "longitudinal",
    "lateral": "lateral",
    "cartesianDistance": "euclidianDistance",
    "euclidianDistance": "euclidianDistance",
}
"""How a distance is measured; 1.0 calls the straight line `cartesianDistance`."""

SystemAttribute: TypeAlias = Annotated[System, Attribute("coordinateSystem", "entity")]
AlongRoute: TypeAlias = Annotated[bool, Attribute("alongRoute", False)]
"""The older word for a distance along the road."""

Routing: TypeAlias = Literal["assignedRoute", "fastest", "leastIntersections", "shortest", "undefined"]
RoutingAttribute: TypeAlias = Annotated[Routing, Attribute("routingAlgorithm", "undefined")]
"""How the way of a distance along roads is chosen."""

TimedDistance: TypeAlias = Annotated[
    Distance, Attribute("relativeDistanceType", "euclidianDistance", DISTANCES)
]
"""How a time to an entity measures the distance: in a straight line unless the file says otherwise."""

TIMED = "value rule freespace alongRoute coordinateSystem relativeDistanceType routingAlgorithm"
"""Attributes of conditions on such a time."""


class SimulationTimeCondition(Element, attributes="value rule"):
    """Time of the run."""

    rule: RuleAttribute
    value: ValueAttribute


class TimeOfDayCondition(Element, attributes="dateTime rule"):
    """Time of day, in seconds since 1970; without a time zone it counts as UTC."""

    rule: RuleAttribute
    value_s: float


class ParameterCondition(Element, attributes="parameterRef value rule"):
    """A parameter's value, which actions may set; `actual` is that at the start."""

    parameter: str
    actual: Value
    rule: Rule
    value: Value


class VariableCondition(Element, attributes="variableRef value rule"):
    """A variable's value."""

    variable: str
    rule: Rule
    value: Value


class StoryboardElementStateCondition(Element, attributes="storyboardElementType storyboardElementRef state"):
    """State or transition of an element, named by its path from the storyboard's stories."""

    kind: Annotated[ElementKind, Attribute("storyboardElementType")]
    path: tuple[str, ...]
    state: Annotated[ElementState, Attribute("state")]


class CollisionCondition(Element):
    """Overlap with an entity, or with any other one of a type of object."""

    entity: Annotated[str | None, Reference()]
    object_type: str | None = None


class SpeedCondition(Element, attributes="value rule direction"):
    """Speed in a direction of the entity; without direction its amount."""

    rule: RuleAttribute
    value: ValueAttribute
    direction: DirectionAttribute


class RelativeSpeedCondition(Element, attributes="entityRef value rule direction"):
    """Velocity less another entity's, in a direction of the first; without direction speed less speed."""

    entity: EntityName
    rule: RuleAttribute
    value: ValueAttribute
    direction: DirectionAttribute


class AccelerationCondition(Element, attributes="value rule direction"):
    """Acceleration in a direction of the entity; without direction its amount."""

    rule: RuleAttribute
    value: ValueAttribute
    direction: DirectionAttribute


class RelativeDistanceCondition(
    Element,
    attributes="entityRef value rule relativeDistanceType freespace coordinateSystem routingAlgorithm",
):
    """Distance to another entity: between reference points, or between outlines if `freespace`."""

    entity: EntityName
    rule: RuleAttribute
    value: ValueAttribute
    kind: Annotated[Distance, Attribute("relativeDistanceType", values=DISTANCES)]
    freespace: Freespace
    system: SystemAttribute = "entity"
    along_route: AlongRoute = False
    routing: RoutingAttribute = "undefined"


class DistanceCondition(Element, attributes=TIMED, children="Position"):
    """Distance to a position: from the reference point, or from the outline if `freespace`."""

    position: Annotated[Position, Child("Position")]
    rule: RuleAttribute
    value: ValueAttribute
    kind: TimedDistance
    freespace: Freespace
    system: SystemAttribute = "entity"
    along_route: AlongRoute = False
    routing: RoutingAttribute = "undefined"


class TimeToCollisionCondition(Element, attributes=TIMED, children="TimeToCollisionConditionTarget"):
    """Distance to another entity over the speed at which it shrinks; does not hold while it does not.

    `position` is in place of the entity where that is None.
    """

    entity: Annotated[str | None, Reference()]
    rule: RuleAttribute
    value: ValueAttribute
    kind: TimedDistance
    freespace: Freespace
    system: SystemAttribute = "entity"
    along_route: AlongRoute = False
    routing: RoutingAttribute = "undefined"
    position: Position | None = None


class TimeHeadwayCondition(Element, attributes=f"entityRef {TIMED}"):
    """Distance to another entity over the own speed."""

    entity: EntityName
    rule: RuleAttribute
    value: ValueAttribute
    kind: TimedDistance
    freespace: Freespace
    system: SystemAttribute = "entity"
    along_route: AlongRoute = False
    routing: RoutingAttribute = "undefined"


class StandStillCondition(Element):
    """Speed zero for a time."""

    duration_s: Annotated[float, Attribute("duration", sign="not negative")]


class TraveledDistanceCondition(Element):
    """Distance gone since the start of the run."""

    value: ValueAttribute


class AngleCondition(Element, attributes="angleType angle angleTolerance coordinateSystem"):
    """Heading in the map frame, or less the direction of road, lane or trajectory, within a tolerance."""

    angle_rad: Annotated[float, Only("angleType", "heading"), Attribute("angle")]
    tolerance_rad: Annotated[float, Attribute("angleTolerance", sign="not negative")]
    system: Annotated[
        Literal["world", "road", "lane", "trajectory"], Attribute("coordinateSystem", "world")
    ] = "world"


class RelativeAngleCondition(Element, attributes="entityRef angleType angle angleTolerance coordinateSystem"):
    """Heading less another entity's, within a tolerance; along roads less the change of their direction."""

    entity: EntityName
    angle_rad: Annotated[float, Only("angleType", "heading"), Attribute("angle")]
    tolerance_rad: Annotated[float, Attribute("angleTolerance", sign="not negative")]
    system: Annotated[
        Literal["entity", "world", "road", "lane", "trajectory"], Attribute("coordinateSystem", "entity")
    ] = "entity"


class ReachPositionCondition(Element):
    """Reference point within a tolerance of a position."""

    position: Annotated[Position, Child("Position")]
    tolerance_m: Annotated[float, Attribute("tolerance", sign="not negative")]


class EndOfRoadCondition(Element):
    """At the end of the road for a time."""

    duration_s: Annotated[float, Attribute("duration", sign="not negative")]


class OffroadCondition(Element):
    """On no road for a time."""

    duration_s: Annotated[float, Attribute("duration", sign="not negative")]


class RelativeClearanceCondition(
    Element,
    attributes="oppositeLanes distanceForward distanceBackward freeSpace",
    children="RelativeLaneRange EntityRef",
):
    """Whether a part of some lanes is free of entities.

    Args:
        entities: who may be there; none named: anybody else.
        lanes: first and last lane, counted to the left from the own one; none: all.
        forward_m, backward_m: how far ahead and back.
        freespace: whether outlines count; else reference points.
        opposite_lanes: whether lanes of the other direction count.
    """

    entities: tuple[str, ...]
    lanes: tuple[tuple[float, float], ...]
    forward_m: float
    backward_m: float
    freespace: bool
    opposite_lanes: bool


class TrafficSignalCondition(Element):
    """A traffic signal shows a state."""

    signal: Annotated[str, Attribute("name")]
    state: Annotated[str, Attribute("state")]


class TrafficSignalControllerCondition(Element):
    """A controller of traffic signals is in a phase."""

    controller: Annotated[str, Attribute("trafficSignalControllerRef")]
    phase: Annotated[str, Attribute("phase")]


ValueConditionKind: TypeAlias = (
    SimulationTimeCondition
    | TimeOfDayCondition
    | ParameterCondition
    | VariableCondition
    | StoryboardElementStateCondition
    | TrafficSignalCondition
    | TrafficSignalControllerCondition
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
    | RelativeAngleCondition
    | ReachPositionCondition
    | DistanceCondition
    | EndOfRoadCondition
    | OffroadCondition
    | RelativeClearanceCondition
)


class EntityCondition(Element, tag="ByEntityCondition", children="TriggeringEntities EntityCondition"):
    """A condition on triggering entities: any or all of them."""

    entities: tuple[str, ...]
    every: bool
    kind: EntityConditionKind


class Condition(Element):
    """A condition with edge and delay; one that stays is met for good once it has been.

    Args:
        where: file and line of its element, for messages; empty: it is of no file.
    """

    name: Annotated[str, Attribute("name")]
    delay_s: Annotated[float, Attribute("delay", 0.0, sign="not negative")]
    edge: Annotated[Edge, Attribute("conditionEdge")]
    kind: ValueConditionKind | EntityCondition
    stays: bool = False
    where: str = ""


Trigger: TypeAlias = tuple[tuple[Condition, ...], ...]
"""Alternatives; the conditions of one alternative hold together."""
