"""Triggers and conditions from XML, where their declarations alone do not say how."""

from __future__ import annotations

import math
from typing import cast, get_args

from scenarios.openscenario.errors import ContentError, ExpressionError, ParameterError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model import (
    CollisionCondition,
    Condition,
    Edge,
    EntityCondition,
    EntityConditionKind,
    ParameterCondition,
    RelativeClearanceCondition,
    Rule,
    StoryboardElementStateCondition,
    TimeOfDayCondition,
    TimeToCollisionCondition,
    TrafficSignalControllerCondition,
    Trigger,
    ValueConditionKind,
    VariableCondition,
)
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.elements import Context, allow, chosen, declared, one_of, read, reads
from scenarios.openscenario.reading.parameters import RULES, compare
from scenarios.openscenario.reading.positions import position


def trigger(node: Node | None, context: Context) -> Trigger | None:
    """Trigger from a StartTrigger or StopTrigger element; None where there is none."""
    if node is None:
        return None
    node.allow(children="ConditionGroup")
    return tuple([tuple([_condition(child, context) for child in group.some("Condition")]) for group in node])


CRITERION = "criteria_"
"""How names of conditions begin by which CARLA's ScenarioRunner judges a run, and does not stop it."""


def stop_trigger(node: Node | None, context: Context) -> tuple[Trigger | None, tuple[tuple[str, str], ...]]:
    """Trigger that stops the storyboard, and the criteria of CARLA's ScenarioRunner that stand in it."""
    if node is None:
        return None, ()
    node.allow(children="ConditionGroup")
    criteria: list[tuple[str, str]] = []
    groups: list[tuple[Condition, ...]] = []
    for group in node:
        conditions: list[Condition] = []
        for child in group.some("Condition"):
            name = child.text("name")
            if name.startswith(CRITERION):
                held = child.need("ByValueCondition").get("ParameterCondition")
                value = "" if held is None else held.text("value", "")
                criteria.append((name.removeprefix(CRITERION), value))
            else:
                conditions.append(_condition(child, context))
        if conditions:
            groups.append(tuple(conditions))
    return tuple(groups), tuple(criteria)


def _condition(node: Node, context: Context) -> Condition:
    child = node.one_of("ByEntityCondition ByValueCondition", "name delay conditionEdge")
    kind: ValueConditionKind | EntityCondition
    if child.tag == "ByEntityCondition":
        kind = read(EntityCondition, child, context)
    else:
        kind = cast(ValueConditionKind, one_of(ValueConditionKind, child, context))
    given: dict[str, object] = {"kind": kind, "name": _label(node, context)}
    given["where"] = f"{node.file.name}:{node.element.sourceline}"
    if context.of_carla:
        node.choice("conditionEdge", " ".join(get_args(Edge)))
        given.update(edge="none", stays=True)
    return declared(Condition, node, context, **given)


def _label(node: Node, context: Context) -> str:
    """Name of a condition, which nothing refers to: where it has no value, the text itself."""
    try:
        return node.text("name")
    except ExpressionError as error:
        context.note(node, f"has a name without a value: {error}")
        return str(node.element.get("name"))


@reads(ParameterCondition)
def _parameter(node: Node, context: Context) -> ParameterCondition:
    allow(ParameterCondition, node)
    name = node.text("parameterRef")
    if name not in node.scope:
        raise ParameterError(f"{node.where} parameter '{name}' is not declared")
    return ParameterCondition(name, node.scope[name], *_comparison(node, node.scope[name]))


@reads(VariableCondition)
def _variable(node: Node, context: Context) -> VariableCondition:
    allow(VariableCondition, node)
    name = context.variable(node)
    return VariableCondition(name, *_comparison(node, context.variables[name]))


def _comparison(node: Node, actual: Value) -> tuple[Rule, Value]:
    """Rule and value of a condition that compares with `actual`.

    Raises:
        ParameterError: the two cannot be compared by the rule.
    """
    rule, value = node.choice("rule", RULES), node.value("value")
    try:
        compare(rule, actual, value)
    except ParameterError as error:
        raise ParameterError(f"{node.where} {error}") from None
    return cast(Rule, rule), value


@reads(TimeOfDayCondition)
def _time_of_day(node: Node, context: Context) -> TimeOfDayCondition:
    allow(TimeOfDayCondition, node)
    return declared(TimeOfDayCondition, node, context, value_s=node.date_time("dateTime"))


@reads(TrafficSignalControllerCondition)
def _phase(node: Node, context: Context) -> TrafficSignalControllerCondition:
    allow(TrafficSignalControllerCondition, node)
    return TrafficSignalControllerCondition(*context.phase(node))


@reads(StoryboardElementStateCondition)
def _element_state(node: Node, context: Context) -> StoryboardElementStateCondition:
    allow(StoryboardElementStateCondition, node)
    path = node.text("storyboardElementRef").replace("::", "/").strip("/").split("/")
    return declared(StoryboardElementStateCondition, node, context, path=tuple(path))


@reads(EntityCondition)
def _by_entity(node: Node, context: Context) -> EntityCondition:
    allow(EntityCondition, node)
    who = node.need("TriggeringEntities")
    who.allow("triggeringEntitiesRule", "EntityRef")
    entities = entity_references(who, context)
    if not entities:
        raise ContentError(f"{who.where} needs at least one EntityRef")
    kind, child = chosen(EntityConditionKind, node.need("EntityCondition"))
    every = who.choice("triggeringEntitiesRule", "any all") == "all"
    return EntityCondition(entities, every, cast(EntityConditionKind, read(kind, child, context)))


def entity_references(node: Node, context: Context) -> tuple[str, ...]:
    """Names of the entities that the EntityRef children of an element refer to."""
    names: list[str] = []
    for child in node:
        child.allow("entityRef")
        names += context.members(child)
    return tuple(dict.fromkeys(names))


@reads(CollisionCondition)
def _collision(node: Node, context: Context) -> CollisionCondition:
    target = node.one_of("EntityRef ByType")
    if target.tag == "EntityRef":
        target.allow("entityRef")
        return CollisionCondition(context.entity(target))
    target.allow("type")
    return CollisionCondition(None, target.choice("type", "vehicle pedestrian miscellaneous"))


@reads(TimeToCollisionCondition)
def _time_to_collision(node: Node, context: Context) -> TimeToCollisionCondition:
    allow(TimeToCollisionCondition, node)
    target = node.need("TimeToCollisionConditionTarget").one_of("EntityRef Position")
    entity, place = None, None
    if target.tag == "Position":
        place = position(target, context)
    else:
        target.allow("entityRef")
        entity = context.entity(target)
    return declared(TimeToCollisionCondition, node, context, entity=entity, position=place)


@reads(RelativeClearanceCondition)
def _clearance(node: Node, context: Context) -> RelativeClearanceCondition:
    allow(RelativeClearanceCondition, node)
    lanes: list[tuple[float, float]] = []
    for child in node.all("RelativeLaneRange"):
        child.allow("from to")
        low = child.integer("from") if child.has("from") else -math.inf
        high = child.integer("to") if child.has("to") else math.inf
        lanes.append((low, high))
    names = tuple(context.entity(child) for child in node.all("EntityRef"))
    return RelativeClearanceCondition(
        names,
        tuple(lanes),
        node.positive("distanceForward", 0.0),
        node.positive("distanceBackward", 0.0),
        node.boolean("freeSpace"),
        node.boolean("oppositeLanes"),
    )
