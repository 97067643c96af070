"""Lane sections and their lanes (chapter "Lanes").

What shapes and links a lane is read at once, everything else when it is first asked for.
"""

from collections.abc import Iterable
from dataclasses import replace
from itertools import pairwise
from operator import attrgetter
from typing import Any

import numpy as np
from lxml import etree

from opendrive import model
from opendrive.arrays import FloatArray, read_only
from opendrive.errors import MapContentError, WarningKind
from opendrive.xml.fields import LENGTH, children_of, each, flag, integer, number, numbers, table_of, text
from opendrive.xml.objects import MATERIAL
from opendrive.xml.tables import OTHER_ATTRIBUTES, REST, Field, Table
from opendrive.xml.values import CUBIC_OFFSET, Element, Values, children, children_but

LATE_M = 1e-6
"""A width that starts this much after its lane section is still taken to start with it."""

OFF_ROAD_M = 1.0
"""A lane section that starts this much before or after its road still belongs to it."""

LANE_TYPES = frozenset(
    (
        "none", "driving", "stop", "shoulder", "biking", "sidewalk", "walking", "border", "restricted",
        "parking", "bidirectional", "median", "special1", "special2", "special3", "roadWorks",
        "tram", "rail", "entry", "exit", "offRamp", "onRamp", "connectingRamp", "slipLane", "bus", "taxi",
        "HOV", "curb", "shared", "mwyEntry", "mwyExit",
    )
)  # fmt: skip
"""Lane types of OpenDRIVE 1.4 to 1.8."""

HEIGHT = ("sOffset", "inner", "outer")
SIDES = {"left": 1, "center": 0, "right": -1}
"""Sign of the lane ids in each part of a lane section."""

SPEED = Field(Values.speed_mps, Values.write_speed, ("max", "unit"))

# What a lane has


def _lane_change(values: Values, element: Element, name: str, text: str) -> str | None:
    if text in ("increase", "decrease", "both", "none"):
        return text
    values.warn(WarningKind.UNKNOWN_VALUE, element, f"{name} is {text!r:.40}; read as absent")
    return None


_MARK_LINE = Table(
    model.RoadMarkLine,
    length_m=number("length", 0.0),
    space_m=number("space", 0.0),
    t_offset_m=number("tOffset", 0.0),
    s_offset_m=number("sOffset", 0.0),
    width_m=number("width", None),
    color=text("color"),
    rule=text("rule"),
)
_ROAD_MARK = Table(
    model.RoadMark,
    s_offset_m=number("sOffset", 0.0),
    width_m=number("width", None),
    lane_change=text("laneChange", None, convert=_lane_change),
    height_m=number("height", None),
    type=text("type", "none"),
    weight=text("weight", "standard"),
    color=text("color", "standard"),
    material=text("material", "standard"),
    sway=children_of("sway", numbers("ds", "a", "b", "c", "d")),
    pattern=text("name").inside("type"),
    pattern_width_m=number("width", None).inside("type"),
    lines=children_of("line", _MARK_LINE).inside("type"),
    explicit_lines=children_of("line", _MARK_LINE).inside("explicit"),
)


def _read_road_mark(values: Values, element: Element) -> model.RoadMark:
    """Return a road mark: most of a map are alike, and records cannot change, so equal ones are one."""
    if len(element):
        return _ROAD_MARK.read(values, element)
    key = tuple(element.items())
    mark = values.road_marks.get(key)
    if mark is None:
        mark = _ROAD_MARK.read(values, element)
        # A mark with a defect is made anew, so that each is warned about.
        if mark.lane_change == element.get("laneChange"):
            values.road_marks[key] = mark
    return mark


def _by_start(records: tuple[Any, ...]) -> tuple[Any, ...]:
    return tuple(sorted(records, key=attrgetter("s_offset_m")))


_HEIGHT_ROW = numbers(*HEIGHT)


def _read_heights(values: Values, element: Element) -> FloatArray:
    heights = values.each(_HEIGHT_ROW.read, children(element, "height"))
    return read_only(np.array(sorted(heights))) if heights else model.NO_HEIGHTS


def _linked(tag: str) -> Field[tuple[int, ...]]:
    """Return the field of the ids of linked lanes, in however many links they stand."""
    ids = children_of(tag, integer("id"))

    def read(values: Values, element: Element) -> tuple[int, ...]:
        linked: list[int] = []
        for link in [link for group in children(element, "link") for link in children(group, tag)]:
            try:
                linked.append(_ID.read(values, link))
            except MapContentError:
                message = f"the link names no lane (id {link.get('id')!r:.40}); not followed"
                values.warn(WarningKind.LINK, link, message)
        return tuple(linked)

    return replace(ids.inside("link"), read=read, is_single=False)


_ID = integer("id")


def _check_lane(values: Values, element: Element, lane: model.Lane) -> None:
    records = lane.width if len(lane.width) else lane.border
    start_m = float(records[0, 0]) if len(records) else None
    warn_of_lane(values, element, lane.id, lane.type, start_m, bool(len(lane.width) and len(lane.border)))


def warn_of_lane(
    values: Values, element: Element, lane_id: int, lane_type: str, start_m: float | None, has_both: bool
) -> None:
    """Warn of an unknown type, and of a width that is missing, late or given twice.

    Args:
        values: takes the warnings.
        element: the lane.
        lane_id: its id.
        lane_type: its type.
        start_m: where its width or border starts in its lane section; None if it has neither.
        has_both: whether it has both.
    """
    if lane_type not in LANE_TYPES:
        message = f"lane {lane_id} is of the unknown type {lane_type!r:.40}; kept"
        values.warn(WarningKind.UNKNOWN_LANE_TYPE, element, message)
    if not lane_id:
        return
    if start_m is None:
        message = f"lane {lane_id} has neither width nor border; its width is read as 0"
        values.warn(WarningKind.NO_WIDTH, element, message)
    elif has_both:
        message = f"lane {lane_id} has both width and border; the width is used"
        values.warn(WarningKind.WIDTH_AND_BORDER, element, message)
    if start_m is not None and start_m > LATE_M:
        message = f"the width of lane {lane_id} starts {start_m} m late; it is read as 0 before"
        values.warn(WarningKind.LATE_RECORD, element, message, amount_m=start_m)


LANE = Table(
    model.Lane,
    details=model.LaneDetails,
    check=_check_lane,
    id=_ID,
    type=text("type", "none"),
    level=flag("level", no="false", true=("true", "1")),
    direction=text("direction", "standard", omitted="standard"),
    flags=OTHER_ATTRIBUTES,
    predecessors=_linked("predecessor"),
    successors=_linked("successor"),
    border=table_of("border", CUBIC_OFFSET),
    width=table_of("width", CUBIC_OFFSET),
    road_marks=each("roadMark", Field(_read_road_mark, _ROAD_MARK.write)).then(_by_start),
    materials=each("material", MATERIAL),
    speeds=each("speed", Table(model.LaneSpeed, s_offset_m=number("sOffset", 0.0), speed_mps=SPEED)).then(
        _by_start
    ),
    accesses=each(
        "access",
        Table(
            model.LaneAccess,
            s_offset_m=number("sOffset", 0.0),
            rule=text("rule"),
            restriction=text("restriction"),
            restrictions=children_of("restriction", text("type")),
        ),
    ),
    height=replace(table_of("height", HEIGHT), read=_read_heights),
    rules=each("rule", Table(model.LaneRule, s_offset_m=number("sOffset", 0.0), value=text("value"))),
    extra=REST,
)

# Sections


def _read_lanes(values: Values, element: Element) -> tuple[model.Lane, ...]:
    lanes: dict[int, Element] = {}
    for group in element:
        sign = SIDES.get(str(group.tag))
        for child in children(group, "lane") if sign is not None else ():
            lane_id = _ID.read(values, child)
            if (lane_id > 0) - (lane_id < 0) != sign:
                raise values.error(child, f"lane id {lane_id} has the wrong sign for <{group.tag}>")
            if lane_id in lanes:
                message = f"lane id {lane_id} is used twice in one lane section; the first is kept"
                values.warn(WarningKind.DUPLICATE_ID, child, message)
            else:
                lanes[lane_id] = child
    warn_of_section(values, element, lanes)
    ids = sorted({0, *lanes}, reverse=True)
    return tuple([LANE.read(values, lanes[lane_id]) for lane_id in ids if lane_id in lanes])


def warn_of_section(values: Values, element: Element, lane_ids: Iterable[int]) -> None:
    """Warn of a lane section whose lane ids have gaps, or which has no centre lane."""
    has = set(lane_ids)
    if 0 not in has:
        message = "the lane section has no centre lane"
        values.warn(WarningKind.MISSING, element, message)
    ids = sorted({0, *has}, reverse=True)
    if ids[0] - ids[-1] != len(ids) - 1:
        message = f"lane ids are not consecutive: {ids}; taken in this order"
        values.warn(WarningKind.LANE_IDS, element, message)


def _write_lanes(element: Element, lanes: tuple[model.Lane, ...]) -> None:
    for side, sign in SIDES.items():
        members = [lane for lane in lanes if (lane.id > 0) - (lane.id < 0) == sign]
        group = etree.SubElement(element, side) if members else element
        for lane in members:
            LANE.write(etree.SubElement(group, "lane"), lane)


def _beside_lanes(values: Values, element: Element) -> list[Element]:
    return [child for group in element if group.tag in SIDES for child in children_but(group, ("lane",))]


_SECTION = Table(
    model.LaneSection,
    s_m=number("s"),
    single_side=flag("singleSide"),
    lanes=Field(_read_lanes, _write_lanes, tags=tuple(SIDES), leftovers=_beside_lanes),
    extra=REST,
)


def read_remaining(values: Values, road: Element) -> None:
    """Read what is left of a road's lane sections and lanes, as far as it can be warned of."""
    for section in road.iter("laneSection"):
        for group in section:
            if group.tag not in SIDES:
                values.extra([group])
                continue
            for lane in group:
                if lane.tag == "lane":
                    _read_lane(values, lane)
                else:
                    values.extra([lane])


def _read_lane(values: Values, lane: Element) -> None:
    if values.is_plain(lane, LANE.names):
        return
    before = len(values.warnings)
    LANE.details(values, lane)()
    if len(values.warnings) == before:
        values.sound.update(values.content(child) for child in lane if child.tag in LANE.names.late)


_SECTIONS = children_of("laneSection", _SECTION)


def _read_sections(values: Values, lanes: Element) -> tuple[model.LaneSection, ...]:
    """Return the lane sections of a road, by s.

    Raises:
        MapContentError: none of them starts on the road, or a value is missing or impossible.
    """
    elements = children(lanes, "laneSection")
    if not elements:
        raise values.error(lanes, "no <laneSection>; a road needs at least one")
    road = lanes.getparent()
    assert road is not None
    length_m: float = LENGTH.read(values, road)
    sections: list[model.LaneSection] = []
    for element in elements:
        section = _SECTION.read(values, element)
        if -OFF_ROAD_M <= section.s_m <= length_m + OFF_ROAD_M:
            sections.append(section)
        else:
            message = f"lane section starts off the road, which is {length_m:.6g} m long; left out"
            values.warn(WarningKind.LEFT_OUT, element, message, section.s_m)
    if not sections:
        raise values.error(elements[0], f"no lane section starts on the road, 0 to {length_m:.6g} m")
    if any(later.s_m < earlier.s_m for earlier, later in pairwise(sections)):
        values.warn(WarningKind.ORDER, elements[0], "lane sections are not in ascending s; sorted")
        sections.sort(key=lambda section: section.s_m)
    return tuple(sections)


LANE_SECTIONS = replace(_SECTIONS, read=_read_sections)
"""The lane sections of a road, inside its lanes."""
