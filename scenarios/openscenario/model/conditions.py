"""Conditions and triggers."""

from __future__ import annotations

from typing import Annotated, Literal, TypeAlias

from scenarios.openscenario.elements import Attribute, Child, Element, EntityName, Never, Only
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model.positions import Position

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

TimedDistance: TypeAlias = Annotated[
    Distance,
    Only("coordinateSystem", "entity", "entity"),
    Never("alongRoute", False),
    Attribute("relativeDistanceType", "euclidianDistance", DISTANCES),
]
"""How a time to an entity measures the distance: in a straight line unless the file says otherwise."""

TIMED = "value rule freespace alongRoute coordinateSystem relativeDistanceType routingAlgorithm"
"""Attributes of conditions on such a time."""


class SimulationTimeCondition(Element, attributes="value rule"):
    """Time of the run."""

    rule: RuleAttribute
    value: ValueAttribute


class ParameterCondition(Element, attributes="parameterRef value rule"):
    """A parameter's value, which is fixed."""

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
    """Overlap with an entity."""

    entity: EntityName


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

    entity: Annotated[EntityName, Only("coordinateSystem", "entity", "entity")]
    rule: RuleAttribute
    value: ValueAttribute
    kind: Annotated[Distance, Attribute("relativeDistanceType", values=DISTANCES)]
    freespace: Freespace


class TimeToCollisionCondition(Element, attributes=TIMED, children="TimeToCollisionConditionTarget"):
    """Distance to another entity over the speed at which it shrinks; does not hold while it does not."""

    entity: EntityName
    rule: RuleAttribute
    value: ValueAttribute
    kind: TimedDistance
    freespace: Freespace


class TimeHeadwayCondition(Element, attributes=f"entityRef {TIMED}"):
    """Distance to another entity over the own speed."""

    entity: EntityName
    rule: RuleAttribute
    value: ValueAttribute
    kind: TimedDistance
    freespace: Freespace


class StandStillCondition(Element):
    """Speed zero for a time."""

    duration_s: Annotated[float, Attribute("duration", sign="not negative")]


class TraveledDistanceCondition(Element):
    """Distance gone since the start of the run."""

    value: ValueAttribute


class AngleCondition(Element, attributes="angleType angle angleTolerance coordinateSystem"):
    """Heading in the map frame, within a tolerance."""

    angle_rad: Annotated[
        float, Only("angleType", "heading"), Only("coordinateSystem", "world", "world"), Attribute("angle")
    ]
    tolerance_rad: Annotated[float, Attribute("angleTolerance", sign="not negative")]


class ReachPositionCondition(Element):
    """Reference point within a tolerance of a position."""

    position: Annotated[Position, Child("Position")]
    tolerance_m: Annotated[float, Attribute("tolerance", sign="not negative")]


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


class EntityCondition(Element, tag="ByEntityCondition", children="TriggeringEntities EntityCondition"):
    """A condition on triggering entities: any or all of them."""

    entities: tuple[str, ...]
    every: bool
    kind: EntityConditionKind


class Condition(Element):
    """A condition with edge and delay."""

    name: Annotated[str, Attribute("name")]
    delay_s: Annotated[float, Attribute("delay", 0.0, sign="not negative")]
    edge: Annotated[Edge, Attribute("conditionEdge")]
    kind: ValueConditionKind | EntityCondition


Trigger: TypeAlias = tuple[tuple[Condition, ...], ...]
"""Alternatives; the conditions of one alternative hold together."""
