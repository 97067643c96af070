"""Objects, bridges and tunnels (chapter "Objects")."""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from lxml import etree

from opendrive import model
from opendrive.arrays import read_only
from opendrive.errors import WarningKind
from opendrive.xml.fields import LENGTH, child, children_of, each, flag, number, row, text
from opendrive.xml.signals import ORIENTATION, VALIDITY
from opendrive.xml.tables import OTHER_ATTRIBUTES, REQUIRED, REST, Field, Table
from opendrive.xml.values import Element, Values, children

MATERIAL = Table(
    model.LaneMaterial,
    s_offset_m=number("sOffset", 0.0),
    surface=text("surface"),
    friction=number("friction", 0.0),
    roughness=number("roughness", None),
)


def _corner(*names: str) -> Field[tuple[Any, ...]]:
    """Return the field of a corner: three coordinates, the height of the object there, an id."""
    first, second, third = names
    return row(number(first), number(second), number(third, 0.0), number("height", 0.0), text("id"))


_CORNERS = {"cornerRoad": _corner("s", "t", "dz"), "cornerLocal": _corner("u", "v", "z")}
"""By the name of the element; the first that is there counts."""


@dataclass(frozen=True, slots=True)
class _OutlineElement:
    """Outline as it stands in the file."""

    corners: tuple[str, list[tuple[Any, ...]]]
    closed: bool
    id: str
    attributes: tuple[tuple[str, str], ...]


def _read_corners(values: Values, element: Element) -> tuple[str, list[tuple[Any, ...]]]:
    on_road, local = (children(element, tag) for tag in _CORNERS)
    if on_road and local:
        message = "outline mixes cornerRoad and cornerLocal; only cornerRoad is read"
        values.warn(WarningKind.IGNORED, element, message)
    tag = "cornerRoad" if on_road else "cornerLocal"
    return tag, [_CORNERS[tag].read(values, corner) for corner in on_road or local]


def _write_corners(element: Element, corners: tuple[str, list[tuple[Any, ...]]]) -> None:
    tag, rows = corners
    for values in rows:
        _CORNERS[tag].write(etree.SubElement(element, tag), values)


_OUTLINE_ELEMENT = Table(
    _OutlineElement,
    id=text("id"),
    closed=flag("closed", True, no="false"),
    attributes=OTHER_ATTRIBUTES,
    corners=Field(
        _read_corners,
        _write_corners,
        tags=tuple(_CORNERS),
        inner={tag: corner.names for tag, corner in _CORNERS.items() if corner.names is not None},
    ),
)


def _read_outline(values: Values, element: Element) -> model.Outline:
    outline = _OUTLINE_ELEMENT.read(values, element)
    tag, rows = outline.corners
    ids = tuple(corner[4] for corner in rows)
    return model.Outline(
        in_road_frame=tag == "cornerRoad",
        corners=read_only(np.array([corner[:3] for corner in rows], dtype=np.float64).reshape(-1, 3)),
        closed=outline.closed,
        heights_m=read_only(np.array([corner[3] for corner in rows])),
        corner_ids=ids if any(ids) else (),
        id=outline.id,
        attributes=outline.attributes,
    )


def _write_outline(element: Element, outline: model.Outline) -> None:
    tag = "cornerRoad" if outline.in_road_frame else "cornerLocal"
    ids = outline.corner_ids or ("",) * len(outline.corners)
    columns = zip(outline.corners.tolist(), outline.heights_m.tolist(), ids, strict=True)
    corners = tag, [(*place, height, corner_id) for place, height, corner_id in columns]
    written = _OutlineElement(corners, outline.closed, outline.id, outline.attributes)
    _OUTLINE_ELEMENT.write(element, written)


OUTLINE = Field(
    _read_outline,
    _write_outline,
    tags=_OUTLINE_ELEMENT.tags,
    names=_OUTLINE_ELEMENT.names._replace(apart=_CORNERS.keys()),
)
_OUTLINES = children_of("outline", OUTLINE, within="outlines", kept=True)
_OUTLINE_NAMES = {**_OUTLINES.inner, **children_of("outline", OUTLINE).inner}


def _read_outlines(values: Values, element: Element) -> tuple[model.Outline, ...]:
    """Return the outlines; before 1.5 one stood in the object itself."""
    direct = tuple([OUTLINE.read(values, child) for child in children(element, "outline")])
    return (*direct, *_OUTLINES.read(values, element))


def _change(quantity: str) -> Field[model.Change]:
    table = Table(
        model.Change, start_m=number(f"{quantity}Start", None), end_m=number(f"{quantity}End", None)
    )
    return Field(table.read, table.write, names=table.names)


_REPEAT = Table(
    model.ObjectRepeat,
    s_m=number("s"),
    length_m=number("length"),
    distance_m=number("distance"),
    detached=flag("detachFromReferenceLine"),
    t=_change("t"),
    z_offset=_change("zOffset"),
    width=_change("width"),
    height=_change("height"),
    length=_change("length"),
    radius=_change("radius"),
)
_CORNER_IDS = children_of("cornerReference", text("id", REQUIRED))
_MARKING = Table(
    model.ObjectMarking,
    side=text("side"),
    color=text("color"),
    weight=text("weight", "standard"),
    width_m=number("width", None),
    z_offset_m=number("zOffset", 0.0),
    line_length_m=number("lineLength", 0.0),
    space_length_m=number("spaceLength", 0.0),
    start_offset_m=number("startOffset", 0.0),
    stop_offset_m=number("stopOffset", 0.0),
    corner_ids=_CORNER_IDS,
)
_BORDER = Table(
    model.ObjectBorder,
    outline_id=text("outlineId"),
    type=text("type"),
    width_m=number("width", 0.0),
    whole_outline=flag("useCompleteOutline"),
    corner_ids=_CORNER_IDS,
)

OBJECT = Table(
    model.RoadObject,
    id=text("id"),
    name=text("name"),
    type=text("type", "none"),
    subtype=text("subtype"),
    s_m=number("s"),
    t_m=number("t"),
    z_offset_m=number("zOffset", 0.0).lenient(),
    heading_rad=number("hdg", 0.0),
    pitch_rad=number("pitch", 0.0).lenient(),
    roll_rad=number("roll", 0.0).lenient(),
    orientation=ORIENTATION,
    length_m=number("length", None),
    width_m=number("width", None),
    height_m=number("height", None).lenient(),
    radius_m=number("radius", None),
    dynamic=flag("dynamic", yes="yes"),
    perpendicular_to_road=flag("perpToRoad"),
    valid_length_m=number("validLength", None).lenient(),
    attributes=OTHER_ATTRIBUTES,
    repeats=each("repeat", _REPEAT),
    outlines=replace(_OUTLINES, read=_read_outlines, tags=("outlines", "outline"), inner=_OUTLINE_NAMES),
    materials=each("material", MATERIAL),
    validity=VALIDITY,
    parking_space=child(
        "parkingSpace", Table(model.ParkingSpace, access=text("access"), restrictions=text("restrictions"))
    ),
    markings=each("marking", _MARKING, within="markings", kept=True),
    borders=each("border", _BORDER, within="borders", kept=True),
    extra=REST,
)

OBJECT_REFERENCE = Table(
    model.ObjectReference,
    s_m=number("s"),
    t_m=number("t"),
    z_offset_m=number("zOffset", None).lenient(),
    valid_length_m=number("validLength", None).lenient(),
    orientation=ORIENTATION,
    object_id=text("id", REQUIRED),
    validity=VALIDITY,
    extra=REST,
)

STRUCTURE = Table(
    model.Structure,
    s_m=number("s"),
    length_m=LENGTH,
    name=text("name"),
    type=text("type"),
    lighting=number("lighting", None).lenient(),
    daylight=number("daylight", None).lenient(),
    id=text("id", REQUIRED),
    validity=VALIDITY,
    extra=REST,
)
"""A bridge or a tunnel."""
