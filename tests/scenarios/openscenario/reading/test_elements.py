"""Records are read by what they declare."""

from pathlib import Path
from typing import Annotated, Literal, get_args

import pytest
from lxml import etree

from scenarios.openscenario import ContentError, UnsupportedError, model
from scenarios.openscenario.elements import Attribute, Child, Element, EntityName, Never, Only, referred
from scenarios.openscenario.reading.document import Node
from scenarios.openscenario.reading.elements import Context, one_of, read

CONTEXT = Context(catalogs=None, entities=("Ego", "Other"), variables={})


class Lamp(Element):
    """A record with a field of every sort."""

    name: Annotated[str, Attribute("name")]
    watts: Annotated[float, Attribute("watts", sign="positive")]
    count: Annotated[int, Attribute("count", 2)]
    on: Annotated[bool, Attribute("state", values={"on": True, "off": False})]
    colour: Annotated[Literal["red", "green"], Only("shape", "round flat", "flat"), Attribute("colour")]
    owner: EntityName
    height_m: Annotated[float | None, Never("hidden", False, "; show it"), Attribute("height", older="z")]


class Pole(Element, group="Holder", first="lamp", children="Lamp Rust"):
    """A record that stands in a group, and holds another."""

    height_m: Annotated[float, Attribute("height")]
    lamp: Annotated[Lamp | None, Child("Lamp")]


LAMP = '<Lamp name="a" watts="5" state="off" colour="green" entityRef="Ego"/>'


def node(text):
    return Node(etree.fromstring(text), Path("file.xosc"), {})


def lamp(**values):
    element = node(LAMP)
    for name, value in values.items():
        element.element.set(name, value)
    return read(Lamp, element, CONTEXT)


def test_fields():
    assert lamp() == Lamp("a", 5.0, 2, False, "green", "Ego", None)
    assert lamp(state="on", count="3", height="4").height_m == 4.0
    assert lamp(z="6").height_m == 6.0


@pytest.mark.parametrize(
    ("values", "error", "message"),
    [
        ({"watts": "0"}, ContentError, "file.xosc:1: <Lamp> watts: expected a positive number, got 0"),
        ({"count": "2.5"}, ContentError, "<Lamp> count: expected a whole number, got 2.5"),
        ({"state": "dim"}, UnsupportedError, "<Lamp> state='dim' is not supported; supported: on, off"),
        (
            {"colour": "blue"},
            UnsupportedError,
            "colour='blue' is not supported; supported: red, green",
        ),
        ({"shape": "long"}, UnsupportedError, "<Lamp> shape='long' is not supported; supported: round, flat"),
        ({"hidden": "true"}, UnsupportedError, "<Lamp> hidden='true' is not supported; show it"),
        ({"entityRef": "Third"}, ContentError, "<Lamp> entityRef: no entity 'Third'; entities: Ego, Other"),
        ({"price": "1"}, UnsupportedError, "<Lamp> attribute 'price' is not supported; supported: shape, "),
    ],
)
def test_refusals(values, error, message):
    with pytest.raises(error) as caught:
        lamp(**values)
    assert message in str(caught.value)


def test_a_needed_attribute_that_is_missing():
    with pytest.raises(ContentError, match="<Lamp> needs an attribute 'name'"):
        read(Lamp, node("<Lamp/>"), CONTEXT)


def test_groups_children_and_order():
    pole = one_of(Lamp | Pole, node(f'<At><Holder><Pole height="3">{LAMP}</Pole></Holder></At>'), CONTEXT)
    assert pole == Pole(3.0, lamp())
    assert read(Pole, node('<Pole height="3"><Rust/></Pole>'), CONTEXT).lamp is None
    # the child comes first, as declared
    with pytest.raises(ContentError, match="<Lamp> needs an attribute 'name'"):
        read(Pole, node('<Pole height="x"><Lamp/></Pole>'), CONTEXT)
    with pytest.raises(UnsupportedError, match="supported there: Lamp, Holder"):
        one_of(Lamp | Pole, node("<At><Tree/></At>"), CONTEXT)


def test_records_are_values():
    assert hash(lamp()) == hash(lamp())
    with pytest.raises(AttributeError):
        lamp().count = 3


def test_entities_that_a_record_refers_to():
    place = model.RelativeObjectPosition("Ego", 1.0, 2.0, model.Orientation())
    route = model.Route("r", (place, model.WorldPosition(0.0, 0.0, 0.0)))
    assert referred(model.TeleportAction(place)) == {"Ego"}
    assert referred(model.AssignRouteAction(route)) == {"Ego"}
    assert referred(model.SpeedAction("step", "time", 0.0, model.RelativeSpeed("Other", 1.0, True))) == {
        "Other"
    }
    both = model.SynchronizeAction("Other", place, place, 3.0, None)
    assert referred(both) == {"Ego", "Other"}
    assert referred(model.DeleteEntityAction("Other")) == frozenset()


@pytest.mark.parametrize("union", [model.Position, model.PrivateAction, model.EntityConditionKind])
def test_everything_that_may_stand_in_a_file_is_named_once(union):
    tags = [(kind.xml.group, kind.xml.tag) for kind in get_args(union)]
    assert len(set(tags)) == len(tags)
