"""Lane sections and their lanes (chapter "Lanes").

What shapes and links a lane is read at once, everything else when it is first asked for.
"""

from functools import partial
from itertools import pairwise
from operator import attrgetter

import numpy as np

from opendrive.arrays import FloatArray, read_only
from opendrive.errors import WarningKind
from opendrive.model import (
    NO_HEIGHTS,
    Deferred,
    Lane,
    LaneAccess,
    LaneDetails,
    LaneRule,
    LaneSection,
    LaneSpeed,
    RoadMark,
    RoadMarkLine,
)
from opendrive.xml.objects import read_material
from opendrive.xml.values import (
    CUBIC_OFFSET,
    NO_CUBICS,
    Element,
    Values,
    children,
    first,
    other_attributes,
    others,
)

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

LANE_NAMES = ("id", "type", "level", "direction")
SHAPE_TAGS = {"width", "border", "height"}
SIDES = {"left": 1, "center": 0, "right": -1}


class LaneReader:
    """Reads lane sections."""

    def __init__(self, values: Values) -> None:
        """Read with the given values."""
        self.values = values
        # Most marks of a map are alike, and records cannot change: equal ones are one.
        self._marks: dict[tuple[tuple[str | bytes, str | bytes], ...], RoadMark] = {}

    def sections(self, lanes: Element, length_m: float) -> tuple[LaneSection, ...]:
        """Return the lane sections of a road, by s.

        Raises:
            MapContentError: none of them starts on the road, or a value is missing or impossible.
        """
        elements = children(lanes, "laneSection")
        if not elements:
            raise self.values.error(lanes, "no <laneSection>; a road needs at least one")
        sections: list[LaneSection] = []
        for element in elements:
            section = self._section(element)
            if -OFF_ROAD_M <= section.s_m <= length_m + OFF_ROAD_M:
                sections.append(section)
            else:
                message = f"lane section starts off the road, which is {length_m:.6g} m long; left out"
                self.values.warn(WarningKind.LEFT_OUT, element, message, section.s_m)
        if not sections:
            raise self.values.error(elements[0], f"no lane section starts on the road, 0 to {length_m:.6g} m")
        if any(later.s_m < earlier.s_m for earlier, later in pairwise(sections)):
            message = "lane sections are not in ascending s; sorted"
            self.values.warn(WarningKind.ORDER, elements[0], message)
            sections.sort(key=lambda section: section.s_m)
        return tuple(sections)

    def _section(self, element: Element) -> LaneSection:
        values = self.values
        s_m = values.number(element, "s")
        lanes: dict[int, Element] = {}
        rest: list[Element] = []
        for group in element:
            sign = SIDES.get(str(group.tag))
            if sign is None:
                rest.append(group)
                continue
            rest += others(group, "lane")
            for child in children(group, "lane"):
                lane_id = values.integer(child, "id")
                if (lane_id > 0) - (lane_id < 0) != sign:
                    raise values.error(child, f"lane id {lane_id} has the wrong sign for <{group.tag}>")
                if lane_id in lanes:
                    message = f"lane id {lane_id} is used twice in one lane section; the first is kept"
                    values.warn(WarningKind.DUPLICATE_ID, child, message)
                else:
                    lanes[lane_id] = child
        ids = sorted({0, *lanes}, reverse=True)
        if ids[0] - ids[-1] != len(ids) - 1:
            message = f"lane ids are not consecutive: {ids}; taken in this order"
            values.warn(WarningKind.LANE_IDS, element, message, s_m)
        return LaneSection(
            s_m,
            values.flag(element, "singleSide"),
            tuple(self._lane(lanes[lane_id], lane_id, s_m) for lane_id in ids if lane_id in lanes),
            values.extra(rest),
        )

    def _lane(self, element: Element, lane_id: int, s_m: float) -> Lane:
        values = self.values
        get = element.get
        parts: dict[str, list[Element]] = {}
        for child in element:
            parts.setdefault(str(child.tag), []).append(child)
        lane_type = get("type", "none")
        if lane_type not in LANE_TYPES:
            message = f"lane {lane_id} is of the unknown type {lane_type!r:.40}; kept"
            values.warn(WarningKind.UNKNOWN_LANE_TYPE, element, message, s_m)
        links = [link for parent in parts.get("link", ()) for link in parent]
        width, border = (
            values.cubics(parts[tag], CUBIC_OFFSET) if tag in parts else NO_CUBICS
            for tag in ("width", "border")
        )
        if lane_id:
            self._check_width(element, lane_id, width, border, s_m)
        heights = values.each(self._height, parts.get("height", ()))
        plain = parts.keys() <= SHAPE_TAGS and len(element.attrib) <= 3
        return Lane(
            lane_id,
            lane_type,
            get("level") in ("true", "1"),
            tuple(values.integer(link, "id") for link in links if link.tag == "predecessor"),
            tuple(values.integer(link, "id") for link in links if link.tag == "successor"),
            width,
            border,
            get("direction", "standard"),
            read_only(np.array(sorted(heights))) if heights else NO_HEIGHTS,
            _NO_DETAILS if plain else Deferred(partial(self._details, element)),
        )

    def _check_width(
        self, element: Element, lane_id: int, width: FloatArray, border: FloatArray, s_m: float
    ) -> None:
        warn = self.values.warn
        records = width if len(width) else border
        if not len(records):
            message = f"lane {lane_id} has neither width nor border; its width is read as 0"
            warn(WarningKind.NO_WIDTH, element, message, s_m)
            return
        if len(width) and len(border):
            message = f"lane {lane_id} has both width and border; the width is used"
            warn(WarningKind.WIDTH_AND_BORDER, element, message, s_m)
        late_m = float(records[0, 0])
        if late_m > LATE_M:
            message = f"the width of lane {lane_id} starts {late_m} m late; it is read as 0 before"
            warn(WarningKind.LATE_RECORD, element, message, s_m)

    def _details(self, element: Element) -> LaneDetails:
        """Return what is not needed to place the lane."""
        values = self.values
        parts: dict[str, list[Element]] = {}
        for child in element:
            parts.setdefault(str(child.tag), []).append(child)
        rest = others(parts.pop("link", [None])[0], "predecessor", "successor")
        take = parts.pop
        marks = values.each(self._road_mark, take("roadMark", ()))
        speeds = values.each(self._speed, take("speed", ()))
        return LaneDetails(
            road_marks=tuple(sorted(marks, key=_start)),
            speeds=tuple(sorted(speeds, key=_start)),
            materials=values.each(partial(read_material, values), take("material", ())),
            accesses=values.each(self._access, take("access", ())),
            rules=values.each(self._rule, take("rule", ())),
            flags=other_attributes(element, LANE_NAMES),
            extra=values.extra(
                rest + [child for tag in parts if tag not in SHAPE_TAGS for child in parts[tag]]
            ),
        )

    def _height(self, element: Element) -> tuple[float, float, float]:
        number = self.values.number
        return number(element, "sOffset"), number(element, "inner"), number(element, "outer")

    def _speed(self, element: Element) -> LaneSpeed:
        return LaneSpeed(self.values.number(element, "sOffset", 0.0), self.values.speed_mps(element))

    def _rule(self, element: Element) -> LaneRule:
        return LaneRule(self.values.number(element, "sOffset", 0.0), element.get("value", ""))

    def _access(self, element: Element) -> LaneAccess:
        get = element.get
        return LaneAccess(
            self.values.number(element, "sOffset", 0.0),
            get("rule", ""),
            get("restriction", ""),
            tuple(child.get("type", "") for child in children(element, "restriction")),
        )

    def _road_mark(self, element: Element) -> RoadMark:
        if len(element):
            return self._new_mark(element)
        key = tuple(element.items())
        mark = self._marks.get(key)
        if mark is None:
            mark = self._new_mark(element)
            # A mark with a defect is made anew, so that each is warned about.
            if mark.lane_change == element.get("laneChange"):
                self._marks[key] = mark
        return mark

    def _new_mark(self, element: Element) -> RoadMark:
        values = self.values
        number = values.number
        get = element.get
        lane_change = get("laneChange")
        if lane_change not in (None, "increase", "decrease", "both", "none"):
            message = f"laneChange is {lane_change!r:.40}; read as absent"
            values.warn(WarningKind.UNKNOWN_VALUE, element, message)
            lane_change = None
        kind, explicit = first(element, "type"), first(element, "explicit")
        return RoadMark(
            s_offset_m=number(element, "sOffset", 0.0),
            type=get("type", "none"),
            weight=get("weight", "standard"),
            color=get("color", "standard"),
            width_m=number(element, "width", None),
            lane_change=lane_change,
            material=get("material", "standard"),
            height_m=number(element, "height", None),
            pattern="" if kind is None else kind.get("name", ""),
            pattern_width_m=None if kind is None else number(kind, "width", None),
            lines=tuple(self._mark_line(line) for line in children(kind, "line")),
            explicit_lines=tuple(self._mark_line(line) for line in children(explicit, "line")),
            sway=tuple(
                tuple(number(sway, name) for name in ("ds", "a", "b", "c", "d"))
                for sway in children(element, "sway")
            ),
        )

    def _mark_line(self, element: Element) -> RoadMarkLine:
        number = self.values.number
        get = element.get
        return RoadMarkLine(
            s_offset_m=number(element, "sOffset", 0.0),
            t_offset_m=number(element, "tOffset", 0.0),
            length_m=number(element, "length", 0.0),
            space_m=number(element, "space", 0.0),
            width_m=number(element, "width", None),
            color=get("color", ""),
            rule=get("rule", ""),
        )


_NO_DETAILS = Deferred.of(LaneDetails())
_start = attrgetter("s_offset_m")
