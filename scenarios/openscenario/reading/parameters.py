"""Parameter and variable declarations: types, values that refer to one another, constraints."""

from __future__ import annotations

import operator
from collections.abc import Callable, Mapping
from typing import Any

from scenarios.openscenario.errors import ConstraintError, ExpressionError, ParameterError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.reading.document import Node, Scope, as_number, as_text, as_truth, resolve

TYPES = "integer int double string unsignedInt unsignedShort boolean dateTime"
RULES = "equalTo notEqualTo greaterThan greaterOrEqual lessThan lessOrEqual"
COMPARE: dict[str, Callable[[Any, Any], bool]] = {
    "equalTo": operator.eq,
    "notEqualTo": operator.ne,
    "greaterThan": operator.gt,
    "greaterOrEqual": operator.ge,
    "lessThan": operator.lt,
    "lessOrEqual": operator.le,
}
_WHOLE = {"integer", "int", "unsignedInt", "unsignedShort"}


def typed(value: Value, kind: str) -> Value:
    """Value as a declared type.

    Raises:
        ParameterError: it is not of that type.
    """
    if kind in ("string", "dateTime"):
        return as_text(value)
    if kind == "boolean":
        truth = as_truth(value)
        if truth is not None:
            return truth
    else:
        number = as_number(value)
        if number is not None and (
            kind not in _WHOLE
            or (number == round(number) and (number >= 0 or not kind.startswith("unsigned")))
        ):
            return number
    raise ParameterError(f"expected a value of type {kind} (numbers without unit), got '{as_text(value)}'")


def compare(rule: str, left: Value, right: Value) -> bool:
    """Whether a rule holds between two values: as numbers if both are, otherwise as text.

    Raises:
        ParameterError: text or truth values cannot be ordered.
    """
    a, b = as_number(left), as_number(right)
    if a is not None and b is not None:
        return COMPARE[rule](a, b)
    if rule not in ("equalTo", "notEqualTo"):
        raise ParameterError(f"'{as_text(left)}' and '{as_text(right)}' cannot be ordered by {rule}")
    return COMPARE[rule](as_text(left), as_text(right))


class Declarations:
    """Parameters of one ParameterDeclarations element (or of none).

    Values are worked out on demand, so that the order in the file does not matter; a circle is an error.

    Args:
        node: the element, or None.
        given: values from outside (catalog reference, variation, command line) in place of the declared ones.
        outer: parameters of the surrounding scope.
        notes: takes lines about what stands twice, or is of another type.
        loose: whether a given value may be of another type than the declared one: it is then a text, which
            is refused where a number is needed.
    """

    def __init__(
        self,
        node: Node | None,
        given: Mapping[str, Value],
        outer: Scope,
        notes: dict[str, None] | None = None,
        loose: bool = False,
    ) -> None:
        self._given, self._outer, self._loose = given, outer, loose
        self._notes = {} if notes is None else notes
        self._declared: dict[str, Node] = {}
        self._open: list[str] = []
        self._values: dict[str, Value] = {}
        if node is not None:
            node.allow(children="ParameterDeclaration")
            for child in node:
                child.allow("name parameterType value", "ConstraintGroup")
                name = str(child.element.get("name", "")).strip().removeprefix("$")
                if not name:
                    raise ParameterError(f"{child.where} needs an attribute 'name'")
                if name in self._declared:
                    if _same(child, self._declared[name]) and notes is not None:
                        self._notes[f"{child.where} declares '{name}' a second time, with the same value"] = (
                            None
                        )
                        continue
                    raise ParameterError(f"{child.where} declares '{name}' a second time")
                self._declared[name] = child
        unknown = [name for name in given if name not in self._declared]
        if unknown:
            raise ParameterError(
                f"parameter '{unknown[0]}' is not declared; declared: {', '.join(self._declared) or 'none'}"
            )

    def scope(self) -> Scope:
        """All values: outer ones, overlaid by these.

        Raises:
            ParameterError: a circle, a wrong type, or a constraint that does not hold.
            ExpressionError: an expression has no value.
        """
        for name in self._declared:
            self._value(name)
        return {**self._outer, **self._values}

    def _value(self, name: str) -> Value:
        if name in self._values:
            return self._values[name]
        node = self._declared.get(name)
        if node is None:
            if name in self._outer:
                return self._outer[name]
            raise ParameterError(f"parameter '{name}' is not declared")
        if name in self._open:
            circle = " -> ".join([*self._open[self._open.index(name) :], name])
            raise ParameterError(f"{node.where} parameters refer to one another in a circle: {circle}")
        self._open.append(name)
        try:
            value = self._typed(name, node)
        except (ParameterError, ExpressionError) as error:
            message = str(error)
            if not message.startswith(str(node.file)):
                message = f"{node.where} {name}: {message}"
            raise type(error)(message) from None
        self._open.pop()
        self._check(node, name, value)
        self._values[name] = value
        return value

    def _typed(self, name: str, node: Node) -> Value:
        kind = node.choice("parameterType", TYPES)
        try:
            return typed(self._raw(name, node), kind)
        except ParameterError:
            if not (self._loose and name in self._given):
                raise
            text = as_text(self._given[name])
            self._notes[f"{node.where} {name}: '{text}' is given, which is not of type {kind}"] = None
            return text

    def _raw(self, name: str, node: Node) -> Value:
        if name in self._given:
            return self._given[name]
        text = str(node.element.get("value", "")).strip()
        if not text and not node.has("value"):
            raise ParameterError("needs an attribute 'value'")
        return resolve(text, self._value) if text.startswith("$") else text

    def _check(self, node: Node, name: str, value: Value) -> None:
        """Groups are alternatives; the constraints of one group hold together."""
        groups = node.within({**self._outer, **self._values, name: value}).all("ConstraintGroup")
        if not groups:
            return
        texts: list[str] = []
        for group in groups:
            group.allow(children="ValueConstraint")
            holds = True
            parts: list[str] = []
            for constraint in group:
                constraint.allow("rule value")
                rule, limit = constraint.choice("rule", RULES), constraint.value("value")
                holds &= compare(rule, value, limit)
                parts.append(f"{rule} {as_text(limit)}")
            if holds:
                return
            texts.append(" and ".join(parts))
        raise ConstraintError(
            f"{node.where} {name} = {as_text(value)} breaks its constraints: {' or '.join(texts)}"
        )


def _same(node: Node, other: Node) -> bool:
    """Whether two elements have the same attributes and nothing in them."""
    a, b = node.element, other.element
    return sorted(a.items()) == sorted(b.items()) and len(a) + len(b) == 0


def variables(node: Node | None) -> dict[str, Value]:
    """Start values of a VariableDeclarations element (or of none).

    Raises:
        ParameterError: a name stands twice, or a value is of the wrong type.
    """
    values: dict[str, Value] = {}
    if node is None:
        return values
    node.allow(children="VariableDeclaration")
    for child in node:
        child.allow("name variableType value")
        name = child.text("name")
        if name in values:
            raise ParameterError(f"{child.where} declares '{name}' a second time")
        try:
            values[name] = typed(child.value("value"), child.choice("variableType", TYPES))
        except ParameterError as error:
            raise ParameterError(f"{child.where} {name}: {error}") from None
    return values
