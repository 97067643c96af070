"""Triggers and conditions from XML."""

from __future__ import annotations

from collections.abc import Callable
from typing import cast

from scenarios.openscenario.errors import ContentError, ParameterError, UnsupportedError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model import (
    AccelerationCondition,
    AngleCondition,
    CollisionCondition,
    Condition,
    Direction,
    Distance,
    EntityCondition,
    EntityConditionKind,
    ParameterCondition,
    ReachPositionCondition,
    RelativeDistanceCondition,
    RelativeSpeedCondition,
    SimulationTimeCondition,
    SpeedCondition,
    StandStillCondition,
    StoryboardElementStateCondition,
    TimeHeadwayCondition,
    TimeToCollisionCondition,
    TraveledDistanceCondition,
    Trigger,
    ValueConditionKind,
    VariableCondition,
)
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.parameters import RULES, compare
from scenarios.openscenario.reading.positions import Context, position

ELEMENT_KINDS = "story act maneuverGroup maneuver event action"
ELEMENT_STATES = (
    "startTransition endTransition stopTransition skipTransition completeState runningState standbyState"
)


def trigger(node: Node | None, context: Context) -> Trigger | None:
    """Trigger from a StartTrigger or StopTrigger element; None where there is none."""
    if node is None:
        return None
    node.allow(children="ConditionGroup")
    groups: list[tuple[Condition, ...]] = []
    for group in node:
        group.allow(children="Condition")
        groups.append(tuple(_condition(child, context) for child in group))
        if not groups[-1]:
            raise ContentError(f"{group.where} needs at least one Condition")
    return tuple(groups)


def _condition(node: Node, context: Context) -> Condition:
    child = node.one_of("ByEntityCondition ByValueCondition", "name delay conditionEdge")
    kind = _by_entity(child, context) if child.tag == "ByEntityCondition" else _by_value(child, context)
    return Condition(
        node.text("name"),
        node.positive("delay", 0.0),
        node.choice("conditionEdge", "none rising falling risingOrFalling"),
        kind,
    )


def _by_value(node: Node, context: Context) -> ValueConditionKind:
    child = node.one_of(
        "SimulationTimeCondition ParameterCondition VariableCondition StoryboardElementStateCondition"
    )
    if child.tag == "SimulationTimeCondition":
        child.allow("value rule")
        return SimulationTimeCondition(child.choice("rule", RULES), child.number("value"))
    if child.tag == "ParameterCondition":
        child.allow("parameterRef value rule")
        name = child.text("parameterRef")
        if name not in child.scope:
            raise ParameterError(f"{child.where} parameter '{name}' is not declared")
        rule, value = _comparison(child, child.scope[name])
        return ParameterCondition(child.scope[name], rule, value)
    if child.tag == "VariableCondition":
        child.allow("variableRef value rule")
        name = context.variable(child)
        return VariableCondition(name, *_comparison(child, context.variables[name]))
    child.allow("storyboardElementType storyboardElementRef state")
    path = child.text("storyboardElementRef").replace("::", "/").strip("/").split("/")
    return StoryboardElementStateCondition(
        child.choice("storyboardElementType", ELEMENT_KINDS),
        tuple(path),
        child.choice("state", ELEMENT_STATES),
    )


def _comparison(node: Node, actual: Value) -> tuple[str, Value]:
    """Rule and value of a condition that compares with `actual`.

    Raises:
        ParameterError: the two cannot be compared by the rule.
    """
    rule, value = node.choice("rule", RULES), node.value("value")
    try:
        compare(rule, actual, value)
    except ParameterError as error:
        raise ParameterError(f"{node.where} {error}") from None
    return rule, value


def _by_entity(node: Node, context: Context) -> EntityCondition:
    node.allow(children="TriggeringEntities EntityCondition")
    who = node.need("TriggeringEntities")
    who.allow("triggeringEntitiesRule", "EntityRef")
    entities: list[str] = []
    for reference in who:
        reference.allow("entityRef")
        entities.append(context.entity(reference))
    if not entities:
        raise ContentError(f"{who.where} needs at least one EntityRef")
    child = node.need("EntityCondition").one_of(" ".join(_ENTITY))
    every = who.choice("triggeringEntitiesRule", "any all") == "all"
    return EntityCondition(tuple(entities), every, _ENTITY[child.tag](child, context))


def _collision(node: Node, context: Context) -> EntityConditionKind:
    child = node.one_of("EntityRef")
    child.allow("entityRef")
    return CollisionCondition(context.entity(child))


def _speed(node: Node, context: Context) -> EntityConditionKind:
    node.allow("value rule direction")
    return SpeedCondition(node.choice("rule", RULES), node.number("value"), _direction(node))


def _relative_speed(node: Node, context: Context) -> EntityConditionKind:
    node.allow("entityRef value rule direction")
    return RelativeSpeedCondition(
        context.entity(node), node.choice("rule", RULES), node.number("value"), _direction(node)
    )


def _acceleration(node: Node, context: Context) -> EntityConditionKind:
    node.allow("value rule direction")
    return AccelerationCondition(node.choice("rule", RULES), node.number("value"), _direction(node))


def _direction(node: Node) -> Direction | None:
    if not node.has("direction"):
        return None
    return cast(Direction, node.choice("direction", "longitudinal lateral vertical"))


def _relative_distance(node: Node, context: Context) -> EntityConditionKind:
    node.allow("entityRef value rule relativeDistanceType freespace coordinateSystem routingAlgorithm")
    node.choice("coordinateSystem", "entity", "entity")
    return RelativeDistanceCondition(
        context.entity(node),
        node.choice("rule", RULES),
        node.number("value"),
        _distance_type(node),
        node.boolean("freespace"),
    )


def _distance_type(node: Node, default: str | None = None) -> Distance:
    """How a distance is measured; 1.0 calls the straight line `cartesianDistance`."""
    options = "longitudinal lateral cartesianDistance euclidianDistance"
    kind = node.choice("relativeDistanceType", options, default)
    return cast(Distance, "euclidianDistance" if kind == "cartesianDistance" else kind)


def _time_to_collision(node: Node, context: Context) -> EntityConditionKind:
    node.allow(_TIMED, "TimeToCollisionConditionTarget")
    target = node.need("TimeToCollisionConditionTarget").one_of("EntityRef")
    target.allow("entityRef")
    return TimeToCollisionCondition(
        context.entity(target),
        node.choice("rule", RULES),
        node.number("value"),
        _timed_distance(node),
        node.boolean("freespace"),
    )


def _time_headway(node: Node, context: Context) -> EntityConditionKind:
    node.allow(f"entityRef {_TIMED}")
    return TimeHeadwayCondition(
        context.entity(node),
        node.choice("rule", RULES),
        node.number("value"),
        _timed_distance(node),
        node.boolean("freespace"),
    )


_TIMED = "value rule freespace alongRoute coordinateSystem relativeDistanceType routingAlgorithm"


def _timed_distance(node: Node) -> Distance:
    """How a time to an entity measures the distance: in a straight line unless the file says otherwise."""
    node.choice("coordinateSystem", "entity", "entity")
    if node.boolean("alongRoute", False):
        raise UnsupportedError(f"{node.where} alongRoute='true' is not supported")
    return _distance_type(node, "euclidianDistance")


def _stand_still(node: Node, context: Context) -> EntityConditionKind:
    node.allow("duration")
    return StandStillCondition(node.positive("duration"))


def _traveled(node: Node, context: Context) -> EntityConditionKind:
    node.allow("value")
    return TraveledDistanceCondition(node.number("value"))


def _angle(node: Node, context: Context) -> EntityConditionKind:
    node.allow("angleType angle angleTolerance coordinateSystem")
    node.choice("angleType", "heading")
    node.choice("coordinateSystem", "world", "world")
    return AngleCondition(node.number("angle"), node.positive("angleTolerance"))


def _reach(node: Node, context: Context) -> EntityConditionKind:
    node.allow("tolerance", "Position")
    return ReachPositionCondition(position(node.need("Position"), context), node.positive("tolerance"))


_ENTITY: dict[str, Callable[[Node, Context], EntityConditionKind]] = {
    "CollisionCondition": _collision,
    "SpeedCondition": _speed,
    "RelativeSpeedCondition": _relative_speed,
    "AccelerationCondition": _acceleration,
    "RelativeDistanceCondition": _relative_distance,
    "TimeToCollisionCondition": _time_to_collision,
    "TimeHeadwayCondition": _time_headway,
    "StandStillCondition": _stand_still,
    "TraveledDistanceCondition": _traveled,
    "AngleCondition": _angle,
    "ReachPositionCondition": _reach,
}
