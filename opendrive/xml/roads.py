"""Roads: links, types, the shape of the reference line, profiles (chapters "Roads" and "Geometry")."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

from lxml import etree

from opendrive import model
from opendrive.arrays import FloatArray
from opendrive.errors import WarningKind
from opendrive.xml.fields import LENGTH, child, children_of, each, number, numbers, table_of, text, write_rows
from opendrive.xml.lanes import LANE_SECTIONS, SPEED
from opendrive.xml.objects import OBJECT, OBJECT_REFERENCE, STRUCTURE
from opendrive.xml.signals import SIGNAL, SIGNAL_REFERENCE
from opendrive.xml.tables import OTHER_ATTRIBUTES, REQUIRED, REST, Field, Table, attribute
from opendrive.xml.values import CUBIC, Element, Values, children, empty_table, first

MAX_TURN_RAD = 100.0
"""A piece of reference line that turns further than this is refused."""

# Links and types


def _contact_point(values: Values, element: Element, name: str, text: str) -> str | None:
    if text not in ("start", "end", "none", ""):
        raise values.unexpected(element, name, text, "'start' or 'end'")
    return text if text in ("start", "end") else None


CONTACT_POINT = text("contactPoint", None, convert=_contact_point).lenient()


def _check_link(values: Values, element: Element, link: model.RoadLink) -> None:
    if link.element_type not in ("road", "junction"):
        message = f"elementType is {link.element_type!r:.40}; the link is not followed"
        values.warn(WarningKind.LINK, element, message)
    if link.element_type == "road" and link.contact_point is None and link.s_m is None:
        message = f"no contactPoint for road {link.element_id!r}; the link is not followed"
        values.warn(WarningKind.LINK, element, message)


_LINK = Table(
    model.RoadLink,
    check=_check_link,
    element_type=text("elementType", "road"),
    contact_point=CONTACT_POINT,
    s_m=number("elementS", None).lenient(),
    direction=text("elementDir"),
    element_id=text("elementId", REQUIRED),
)


def _read_link(values: Values, element: Element) -> model.RoadLink | None:
    element_id = element.get("elementId")
    contact_point: Any = element.get("contactPoint")
    if not element_id:
        values.warn(WarningKind.LINK, element, "the link names nothing (no elementId); not followed")
        return None
    if (
        contact_point in ("start", "end")
        and element.get("elementType") == "road"
        and len(element.keys()) == 3
    ):
        return model.RoadLink("road", element_id, contact_point)
    return _LINK.read(values, element)


LINK: Field[Any] = Field(_read_link, _LINK.write)

ROAD_TYPE = Table(
    model.RoadType,
    s_m=number("s", 0.0),
    type=text("type", "unknown"),
    country=text("country"),
    speed_mps=SPEED.inside("speed").lenient(),
)

# The reference line

LINE = model.Line()
_SHAPE_NAMES = "line, arc, spiral, poly3 or paramPoly3"


def _is_normalized(values: Values, element: Element, name: str, text: str) -> bool:
    if text not in ("normalized", "arcLength"):
        raise values.unexpected(element, name, text, "'normalized' or 'arcLength'")
    return text == "normalized"


_SHAPES: dict[type[model.Shape], tuple[str, Table[Any]]] = {
    model.Line: ("line", Table(model.Line)),
    model.Arc: ("arc", Table(model.Arc, curvature_per_m=number("curvature"))),
    model.Spiral: (
        "spiral",
        Table(model.Spiral, curvature_start_per_m=number("curvStart"), curvature_end_per_m=number("curvEnd")),
    ),
    model.Poly3: ("poly3", Table(model.Poly3, coefficients=numbers("a", "b", "c", "d"))),
    model.ParamPoly3: (
        "paramPoly3",
        Table(
            model.ParamPoly3,
            normalized=attribute(
                # Before 1.4 it did not exist; the range was [0, 1].
                "pRange",
                True,
                _is_normalized,
                lambda element, value: element.set("pRange", "normalized" if value else "arcLength"),
            ),
            u=numbers("aU", "bU", "cU", "dU"),
            v=numbers("aV", "bV", "cV", "dV"),
        ),
    ),
}
"""Name of the element and fields of each shape."""
_TABLE_OF_TAG = dict(_SHAPES.values())


def read_shape(values: Values, geometry: Element) -> model.Shape:
    """Return the shape of a piece of reference line.

    Raises:
        MapContentError: there is none, it is of an unknown kind, or it winds up.
    """
    s_m, length_m = values.number(geometry, "s"), LENGTH.read(values, geometry)
    elements = [child for child in geometry if child.tag != "userData"]
    element = elements[0] if elements else None
    if len(elements) > 1:
        message = f"a second shape, <{elements[1].tag!s:.80}>; the first is read"
        values.warn(WarningKind.IGNORED, elements[1], message, s_m)
    if element is None:
        raise values.error(geometry, f"has no shape; expected {_SHAPE_NAMES}")
    table = _TABLE_OF_TAG.get(str(element.tag))
    if table is None:
        raise values.error(element, f"has the shape <{element.tag:.40}>, expected {_SHAPE_NAMES}")
    shape: model.Shape = table.read(values, element)
    turn_rad = 0.0
    if isinstance(shape, model.Arc):
        turn_rad = abs(shape.curvature_per_m) * length_m
        if shape.curvature_per_m == 0.0:
            message = "arc of curvature 0; read as a line"
            values.warn(WarningKind.ARC_WITHOUT_CURVATURE, element, message, s_m)
    elif isinstance(shape, model.Spiral):
        start, end = shape.curvature_start_per_m, shape.curvature_end_per_m
        turn_rad = max(abs(start), abs(end)) * length_m
        if start == end:
            message = f"spiral of constant curvature; read as {'an arc' if start else 'a line'}"
            values.warn(WarningKind.CONSTANT_SPIRAL, element, message, s_m)
    if turn_rad > MAX_TURN_RAD:
        raise values.error(element, f"the piece turns by {turn_rad:.3g} rad; check its curvature and length")
    return shape


def _write_shape(geometry: Element, shape: model.Shape) -> None:
    tag, table = _SHAPES[type(shape)]
    table.write(etree.SubElement(geometry, tag), shape)


_GEOMETRY = Table(
    model.Geometry,
    s_m=number("s"),
    x_m=number("x"),
    y_m=number("y"),
    heading_rad=number("hdg"),
    length_m=LENGTH,
    shape=Field(read_shape, _write_shape),
)
ORDER_RULE = "asam.net:xodr:1.4.0:road.geometry.elem_asc_order"
_PIECES = children_of("geometry", _GEOMETRY)


def _read_pieces(values: Values, road: Element) -> tuple[model.Geometry, ...]:
    plan = first(road, "planView")
    elements = children(plan, "geometry")
    if plan is None or not elements:
        raise values.error(road, "<planView> has no <geometry>; a road needs a reference line")
    pieces = _PIECES.read(values, plan)
    if any(later.s_m < earlier.s_m for earlier, later in pairwise(pieces)):
        message = "pieces of the reference line are not in ascending s; sorted"
        values.warn(WarningKind.ORDER, elements[0], message, rule=ORDER_RULE)
        pieces = tuple(sorted(pieces, key=lambda piece: piece.s_m))
    return pieces


# Profiles


def _crossfall(name: str) -> Field[FloatArray]:
    """Return the field of the crossfall on one side; a record may hold for both."""

    def read(values: Values, lateral: Element) -> FloatArray:
        records = children(lateral, "crossfall")
        for record in records:
            if (side := record.get("side", "both")) not in ("left", "right", "both"):
                raise values.unexpected(record, "side", side, "'left', 'right' or 'both'")
        return values.table(
            [record for record in records if record.get("side", "both") in (name, "both")], CUBIC
        )

    def write(lateral: Element, rows: FloatArray) -> None:
        write_rows("crossfall", CUBIC, lateral, rows, side=name)

    return Field(read, write, tags=("crossfall",), absent=empty_table(len(CUBIC)))


def _rule(values: Values, element: Element, name: str, text: str) -> str:
    if text not in ("RHT", "LHT"):
        raise values.unexpected(element, name, text, "'RHT' or 'LHT'")
    return text


ID = text("id", REQUIRED)
JUNCTION_ID = attribute(
    "junction",
    None,
    lambda values, element, name, text: None if text in ("-1", "") else text,
    lambda element, value: element.set("junction", value or "-1"),
)
SHAPE = ("s", "t", "a", "b", "c", "d")
RULE = text("rule", "RHT", convert=_rule).lenient()

# Railroads

_TRACK = Table(model.Track, s_m=number("s"), road_id=text("id", REQUIRED), direction=text("dir", "+"))

SWITCH = Table(
    model.Switch,
    name=text("name"),
    id=text("id", REQUIRED),
    position=text("position", "dynamic"),
    main_track=child("mainTrack", _TRACK, required=True),
    side_track=child("sideTrack", _TRACK, required=True),
    partner_id=text("id", REQUIRED).inside("partner"),
    partner_name=text("name").inside("partner"),
    extra=REST,
)

_SEGMENT = Table(
    model.PlatformSegment,
    s_start_m=number("sStart"),
    s_end_m=number("sEnd"),
    side=text("side"),
    road_id=text("roadId", REQUIRED),
)
_PLATFORM = Table(
    model.Platform,
    name=text("name"),
    id=text("id", REQUIRED),
    segments=children_of("segment", _SEGMENT),
)

STATION = Table(
    model.Station,
    name=text("name"),
    type=text("type"),
    id=text("id", REQUIRED),
    platforms=children_of("platform", _PLATFORM, kept=True),
    extra=REST,
)

# Roads

ROAD = Table(
    model.Road,
    details=model.RoadDetails,
    name=text("name"),
    length_m=LENGTH,
    id=ID,
    junction_id=JUNCTION_ID,
    rule=RULE,
    attributes=OTHER_ATTRIBUTES,
    predecessor=child("predecessor", LINK).inside("link", always=True),
    successor=child("successor", LINK).inside("link", always=True),
    types=each("type", ROAD_TYPE),
    geometries=replace(_PIECES.inside("planView", always=True), read=_read_pieces, absent=None),
    elevation=table_of("elevation", CUBIC).inside("elevationProfile", always=True),
    superelevation=table_of("superelevation", CUBIC).inside("lateralProfile", always=True),
    crossfall_left=_crossfall("left").inside("lateralProfile", always=True),
    crossfall_right=_crossfall("right").inside("lateralProfile", always=True),
    shape=table_of("shape", SHAPE, keys=2).inside("lateralProfile", always=True),
    lane_offset=table_of("laneOffset", CUBIC).inside("lanes", always=True),
    sections=LANE_SECTIONS.inside("lanes", always=True),
    objects=each("object", OBJECT).inside("objects"),
    object_references=each("objectReference", OBJECT_REFERENCE).inside("objects"),
    tunnels=each("tunnel", STRUCTURE).inside("objects"),
    bridges=each("bridge", STRUCTURE).inside("objects"),
    signals=each("signal", SIGNAL).inside("signals"),
    signal_references=each("signalReference", SIGNAL_REFERENCE).inside("signals"),
    switches=each("switch", SWITCH).inside("railroad"),
    extra=REST,
)


def read_road(values: Values, element: Element) -> model.Road:
    """Return a road.

    Raises:
        MapContentError: what places it is missing or impossible.
    """
    if first(element, "lanes") is None:
        raise values.error(element, "<lanes> is missing; a road needs at least one lane section")
    return ROAD.read(values, element)


def read_known_road(values: Values, element: Element) -> model.Road:
    """Return a road whose geometry has been warned of already."""
    with values.quietly():
        return ROAD.read(values, element)
