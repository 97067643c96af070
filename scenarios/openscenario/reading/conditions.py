"""Triggers and conditions from XML, where their declarations alone do not say how."""

from __future__ import annotations

from typing import cast

from scenarios.openscenario.errors import ContentError, ParameterError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.model import (
    CollisionCondition,
    Condition,
    EntityCondition,
    EntityConditionKind,
    ParameterCondition,
    Rule,
    StoryboardElementStateCondition,
    TimeToCollisionCondition,
    Trigger,
    ValueConditionKind,
    VariableCondition,
)
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.elements import Context, allow, chosen, declared, one_of, read, reads
from scenarios.openscenario.reading.parameters import RULES, compare


def trigger(node: Node | None, context: Context) -> Trigger | None:
    """Trigger from a StartTrigger or StopTrigger element; None where there is none."""
    if node is None:
        return None
    node.allow(children="ConditionGroup")
    return tuple([tuple([_condition(child, context) for child in group.some("Condition")]) for group in node])


def _condition(node: Node, context: Context) -> Condition:
    child = node.one_of("ByEntityCondition ByValueCondition", "name delay conditionEdge")
    kind: ValueConditionKind | EntityCondition
    if child.tag == "ByEntityCondition":
        kind = read(EntityCondition, child, context)
    else:
        kind = cast(ValueConditionKind, one_of(ValueConditionKind, child, context))
    return declared(Condition, node, context, kind=kind)


@reads(ParameterCondition)
def _parameter(node: Node, context: Context) -> ParameterCondition:
    allow(ParameterCondition, node)
    name = node.text("parameterRef")
    if name not in node.scope:
        raise ParameterError(f"{node.where} parameter '{name}' is not declared")
    return ParameterCondition(node.scope[name], *_comparison(node, node.scope[name]))


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
        names.append(context.entity(child))
    return tuple(names)


@reads(CollisionCondition)
def _collision(node: Node, context: Context) -> CollisionCondition:
    return CollisionCondition(_target(node, context))


@reads(TimeToCollisionCondition)
def _time_to_collision(node: Node, context: Context) -> TimeToCollisionCondition:
    allow(TimeToCollisionCondition, node)
    entity = _target(node.need("TimeToCollisionConditionTarget"), context)
    return declared(TimeToCollisionCondition, node, context, entity=entity)


def _target(node: Node, context: Context) -> str:
    """The entity that an element holds a reference to."""
    child = node.one_of("EntityRef")
    child.allow("entityRef")
    return context.entity(child)
