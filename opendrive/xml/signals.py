"""Signals and their controllers (chapter "Signals")."""

from lxml import etree

from opendrive import model
from opendrive.xml.fields import constant, each, flag, integer, number, row, text
from opendrive.xml.tables import OTHER_ATTRIBUTES, REQUIRED, REST, Field, Table
from opendrive.xml.values import Element, Values, first


def _orientation(values: Values, element: Element, name: str, text: str) -> str:
    if text not in ("+", "-", "none"):
        raise values.unexpected(element, name, text, "'+', '-' or 'none'")
    return text


ORIENTATION = text("orientation", "none", convert=_orientation).lenient()
VALIDITY = each("validity", Table(model.LaneRange, from_lane=integer("fromLane"), to_lane=integer("toLane")))

_POSITIONS = {
    "positionRoad": Table(
        model.SignalPosition,
        road_id=text("roadId", REQUIRED),
        position_m=row(number("s"), number("t"), number("zOffset", 0.0)),
        heading_rad=number("hOffset", 0.0),
        pitch_rad=number("pitch", 0.0),
        roll_rad=number("roll", 0.0),
    ),
    "positionInertial": Table(
        model.SignalPosition,
        road_id=constant(""),
        position_m=row(number("x"), number("y"), number("z", 0.0)),
        heading_rad=number("hdg", 0.0),
        pitch_rad=number("pitch", 0.0),
        roll_rad=number("roll", 0.0),
    ),
}
"""By the name of the element; the first that is there counts."""


def _read_position(values: Values, element: Element) -> model.SignalPosition | None:
    for tag, table in _POSITIONS.items():
        if (child := first(element, tag)) is not None:
            return table.read(values, child)
    return None


def _write_position(element: Element, position: model.SignalPosition | None) -> None:
    if position is not None:
        tag = "positionRoad" if position.road_id else "positionInertial"
        _POSITIONS[tag].write(etree.SubElement(element, tag), position)


SIGNAL = Table(
    model.Signal,
    name=text("name"),
    s_m=number("s"),
    t_m=number("t"),
    z_offset_m=number("zOffset", 0.0).lenient(),
    heading_offset_rad=number("hOffset", 0.0).lenient(),
    pitch_rad=number("pitch", 0.0).lenient(),
    roll_rad=number("roll", 0.0).lenient(),
    dynamic=flag("dynamic", yes="yes", no="no"),
    country=text("country"),
    country_revision=text("countryRevision"),
    type=text("type"),
    subtype=text("subtype"),
    value=number("value", None).lenient(),
    unit=text("unit"),
    text=text("text"),
    height_m=number("height", None).lenient(),
    width_m=number("width", None).lenient(),
    length_m=number("length", None).lenient(),
    id=text("id", REQUIRED),
    orientation=ORIENTATION,
    attributes=OTHER_ATTRIBUTES,
    validity=VALIDITY,
    dependencies=each(
        "dependency", Table(model.SignalDependency, type=text("type"), signal_id=text("id", REQUIRED))
    ),
    links=each(
        "reference",
        Table(
            model.SignalLink,
            element_type=text("elementType"),
            type=text("type"),
            element_id=text("elementId", REQUIRED),
        ),
    ),
    position=Field(_read_position, _write_position, tags=tuple(_POSITIONS)).lenient(),
    extra=REST,
)

SIGNAL_REFERENCE = Table(
    model.SignalReference,
    s_m=number("s"),
    t_m=number("t"),
    signal_id=text("id", REQUIRED),
    orientation=ORIENTATION,
    validity=VALIDITY,
    extra=REST,
)

CONTROLLER = Table(
    model.Controller,
    id=text("id", REQUIRED),
    name=text("name"),
    sequence=integer("sequence", None).lenient(),
    controls=each("control", Table(model.Control, signal_id=text("signalId", REQUIRED), type=text("type"))),
    extra=REST,
)
