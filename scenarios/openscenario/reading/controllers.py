"""Controllers and actions on them from XML."""

from __future__ import annotations

from scenarios.openscenario.model import ActivateControllerAction, Controller, ControllerAction
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.elements import Context, reads
from scenarios.openscenario.reading.positions import referenced

OVERRIDDEN = "Throttle Brake Clutch ParkingBrake SteeringWheel Gear"
"""What a scenario can set in place of a controller."""

HOLDERS = "name activateLateral activateLongitudinal activateLighting activateAnimation"
"""Attributes of the elements that hold a controller."""


def controller(parent: Node, context: Context) -> Controller:
    """Controller from an element that holds one, or a reference to a catalog."""
    node = referenced(parent, "Controller", context, HOLDERS)
    node.allow("name controllerType", "ParameterDeclarations Properties")
    properties: list[tuple[str, str]] = []
    given = node.get("Properties")
    if given is not None:
        given.allow(children="Property File CustomContent")
        properties = [(child.text("name"), child.text("value")) for child in given.all("Property")]
    properties.append(("name", node.text("name")))
    if node.has("controllerType"):
        properties.append(("controllerType", node.text("controllerType")))
    name = (
        parent.text("name") if parent.tag == "ObjectController" and parent.has("name") else node.text("name")
    )
    return Controller(name, tuple(properties))


@reads(ActivateControllerAction)
def _activate(node: Node, context: Context) -> ActivateControllerAction:
    node.allow("controllerRef objectControllerRef lateral longitudinal lighting animation")
    reference = "objectControllerRef" if node.has("objectControllerRef") else "controllerRef"
    return ActivateControllerAction(
        node.text(reference) if node.has(reference) else None,
        _if_given(node, "lateral"),
        _if_given(node, "longitudinal"),
        node.where,
    )


def _if_given(node: Node, name: str) -> bool | None:
    return node.boolean(name) if node.has(name) else None


@reads(ControllerAction)
def _controller_action(node: Node, context: Context) -> ControllerAction:
    node.allow(children="AssignControllerAction OverrideControllerValueAction ActivateControllerAction")
    assigned, activated = None, None
    assign = node.get("AssignControllerAction")
    if assign is not None:
        assign.allow(
            "activateLateral activateLongitudinal activateLighting activateAnimation",
            "Controller CatalogReference ObjectController",
        )
        held = assign.get("ObjectController")
        assigned = controller(assign if held is None else held, context)
        lateral, longitudinal = (
            _if_given(assign, "activateLateral"),
            _if_given(assign, "activateLongitudinal"),
        )
        if lateral or longitudinal:
            activated = ActivateControllerAction(None, lateral, longitudinal, assign.where)
    activate = node.get("ActivateControllerAction")
    if activate is not None:
        activated = _activate(activate, context)
    return ControllerAction(
        assigned, activated, _overridden(node.get("OverrideControllerValueAction")), node.where
    )


def _overridden(node: Node | None) -> tuple[str, ...]:
    if node is None:
        return ()
    node.allow(children=OVERRIDDEN)
    return tuple(child.tag for child in node if child.boolean("active"))
