"""The geometry of all roads and lanes at once, straight from the XML.

To make a record of every lane and curve costs more than parsing the file does, and most of them are never
asked for. Here one walk over the file puts the numbers of all elements of a kind into columns instead. A road
with anything out of order, and whatever needs an error, is read by its record, which then fills the columns.
"""

from collections.abc import Sequence
from itertools import chain
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from opendrive.arrays import BoolArray, FloatArray, IntArray, first_rows, run_starts
from opendrive.errors import MapContentError
from opendrive.geometry.curves import CurveTable
from opendrive.geometry.lateral_shape import ShapeTable
from opendrive.geometry.profiles import CubicTable
from opendrive.lanes.table import LaneColumns, LaneTable, RoadTable, SectionColumns
from opendrive.model import Road, RoadLink, Shape, TrafficRule
from opendrive.roads.geometry import NetworkGeometry
from opendrive.xml.fields import LENGTH
from opendrive.xml.lanes import (
    HEIGHT,
    LANE_TYPES,
    LATE_M,
    OFF_ROAD_M,
    SIDES,
    warn_of_lane,
    warn_of_section,
)
from opendrive.xml.roads import (
    ID,
    JUNCTION_ID,
    LINE,
    LINK,
    ROAD_TYPE,
    RULE,
    SHAPE,
    read_road,
    read_shape,
)
from opendrive.xml.values import (
    CUBIC,
    CUBIC_OFFSET,
    MAX_LENGTH_M,
    MAX_NUMBER,
    SMALL_INTEGERS,
    Element,
    Values,
)

_GEOMETRY = ("s", "x", "y", "hdg", "length")
_OF_ROADS = {
    "geometry": _GEOMETRY, "elevation": CUBIC, "superelevation": CUBIC, "crossfall_left": CUBIC,
    "crossfall_right": CUBIC, "shape": SHAPE, "lane_offset": CUBIC, "section": ("s",),
}  # fmt: skip
_OF_LANES = {"width": CUBIC_OFFSET, "border": CUBIC_OFFSET, "height": HEIGHT}
_ATTRIBUTES = _OF_ROADS | _OF_LANES
"""Names of the numbers of each kind of element."""

_ROAD_PARTS = frozenset(("planView", "elevationProfile", "lateralProfile", "lanes", "link"))
_CROSSFALLS: dict[str, tuple[str, ...]] = {"left": ("crossfall_left",), "right": ("crossfall_right",)}
_CROSSFALLS["both"] = (*_CROSSFALLS["left"], *_CROSSFALLS["right"])
_ROAD_FIELDS = (ID, LENGTH, RULE, JUNCTION_ID)


class _OddError(Exception):
    """Something that has to be read with care."""


def read_geometry(values: Values, roads: Sequence[Element]) -> tuple[NetworkGeometry, list[Road]]:
    """Return the geometry of `roads`, and the records of those that are odd.

    Everything that the records' reader would warn of in the geometry has then been warned of.

    Raises:
        MapContentError: what places a road or lane is missing or impossible.
    """
    columns: list[_RoadColumns] = []
    odd: set[int] = set()
    for r, road in enumerate(roads):
        before = len(values.warnings)
        columns.append(_RoadColumns())
        try:
            columns[r].read(values, road)
        except (_OddError, MapContentError):
            del values.warnings[before:]
            columns[r] = _RoadColumns()
            odd.add(r)
    tables = _Tables.of(columns)
    odd |= tables.odd_roads()
    records = [read_road(values, roads[r]) for r in sorted(odd)]
    if odd:
        for r, record in zip(sorted(odd), records, strict=True):
            columns[r] = _RoadColumns()
            columns[r].enter(record)
        tables = _Tables.of(columns)
    return tables.geometry(values), records


class _LaneIds(dict[object, int]):
    """Ids of lanes by their texts."""

    def __missing__(self, text: object) -> int:
        raise _OddError


_LANE_IDS = _LaneIds(SMALL_INTEGERS)


_LaneRow: TypeAlias = tuple[int, int, str, bool, str, tuple[int, ...], tuple[int, ...], Element | None]
"""Section, id, type, level, direction, predecessors, successors of a lane; its element if it is still there.

The section is its index in the road.
"""


class _RoadColumns:
    """What the columns of a network's tables hold of one road.

    Attributes:
        numbers: numbers, or their texts, of all elements of a kind, one after the other.
        lane_of: index in the road of the lane that each element of a kind belongs to.
        shapes: shapes of the pieces of the reference line.
        sections: elements of the lane sections, as far as there are any.
        lanes: lanes, in any order within their section.
        row: what `RoadTable` has of the road.
    """

    __slots__ = ("lane_of", "lanes", "numbers", "row", "sections", "shapes")

    def __init__(self) -> None:
        self.numbers: dict[str, list[Any]] = {name: [] for name in _ATTRIBUTES}
        self.lane_of: dict[str, list[int]] = {name: [] for name in _OF_LANES}
        self.shapes: list[Shape] = []
        self.sections: list[Element | None] = []
        self.lanes: list[_LaneRow] = []
        self.row: tuple[str, float, TrafficRule, str | None, RoadLink | None, RoadLink | None]
        self.row = ("", 0.0, "RHT", None, None, None)

    def read(self, values: Values, road: Element) -> None:
        """Enter the numbers of a road's elements, as texts.

        Raises:
            MapContentError: something is missing or impossible.
            _OddError: something is not what its columns expect.
        """
        parts: dict[object, Element] = {}
        for part in road:
            tag = part.tag
            if tag in _ROAD_PARTS:
                # The records' reader takes the first part of a name.
                _check(tag not in parts)
                parts[tag] = part
            elif tag == "type":
                ROAD_TYPE.read(values, part)
        _check("planView" in parts and "lanes" in parts)
        for piece in parts["planView"]:
            if piece.tag == "geometry":
                self._add("geometry", piece)
                is_line = len(piece) == 1 and piece[0].tag == "line"
                self.shapes.append(LINE if is_line else read_shape(values, piece))
        for element in parts.get("elevationProfile", ()):
            if element.tag == "elevation":
                self._add("elevation", element)
        for element in parts.get("lateralProfile", ()):
            if element.tag in ("superelevation", "shape"):
                self._add(element.tag, element)
            elif element.tag == "crossfall":
                side = element.get("side", "both")
                _check(side in _CROSSFALLS)
                for name in _CROSSFALLS[side]:
                    self._add(name, element)
        for element in parts["lanes"]:
            if element.tag == "laneSection":
                self._add("section", element)
                self._read_section(element)
            elif element.tag == "laneOffset":
                self._add("lane_offset", element)
        _check(bool(self.shapes and self.sections))
        links: dict[object, RoadLink | None] = {}
        for link in parts.get("link", ()):
            if link.tag in ("predecessor", "successor"):
                _check(link.tag not in links)
                links[link.tag] = LINK.read(values, link)
        road_id, length_m, rule, junction_id = (field.read(values, road) for field in _ROAD_FIELDS)
        self.row = road_id, length_m, rule, junction_id, links.get("predecessor"), links.get("successor")

    def _add(self, name: str, element: Element) -> None:
        self.numbers[name] += map(element.get, _ATTRIBUTES[name])

    def _read_section(self, section: Element) -> None:
        k, first = len(self.sections), len(self.lanes)
        self.sections.append(section)
        numbers, lane_of, lanes = self.numbers, self.lane_of, self.lanes
        for group in section:
            sign = SIDES.get(str(group.tag))
            for lane in group if sign is not None else ():
                if lane.tag != "lane":
                    continue
                lane_id = _LANE_IDS[lane.get("id")]
                if (lane_id > 0) - (lane_id < 0) != sign:
                    raise _OddError
                before: tuple[int, ...] = ()
                after: tuple[int, ...] = ()
                for child in lane:
                    tag = child.tag
                    if tag in _OF_LANES:
                        numbers[tag] += map(child.get, _OF_LANES[tag])
                        lane_of[tag].append(len(lanes))
                    elif tag == "link":
                        for link in child:
                            if link.tag == "predecessor":
                                before += (_LANE_IDS[link.get("id")],)
                            elif link.tag == "successor":
                                after += (_LANE_IDS[link.get("id")],)
                kind, direction = lane.get("type", "none"), lane.get("direction", "standard")
                is_level = lane.get("level") in ("true", "1")
                lanes.append((k, lane_id, kind, is_level, direction, before, after, lane))
        ids = [lane[1] for lane in lanes[first:]]
        _check(len(set(ids)) == len(ids))

    def enter(self, road: Road) -> None:
        """Enter a road that was read by its record."""
        self.shapes = [piece.shape for piece in road.geometries]
        for p in road.geometries:
            self.numbers["geometry"] += (p.s_m, p.x_m, p.y_m, p.heading_rad, p.length_m)
        for name in _OF_ROADS.keys() - {"geometry", "section"}:
            self.numbers[name] += getattr(road, name).ravel().tolist()
        for k, section in enumerate(road.sections):
            self.numbers["section"].append(section.s_m)
            self.sections.append(None)
            for lane in section.lanes:
                for name, lane_of in self.lane_of.items():
                    rows: FloatArray = getattr(lane, name)
                    self.numbers[name] += rows.ravel().tolist()
                    lane_of += [len(self.lanes)] * len(rows)
                links = lane.predecessors, lane.successors
                self.lanes.append((k, lane.id, lane.type, lane.level, lane.direction, *links, None))
        self.row = road.id, road.length_m, road.rule, road.junction_id, road.predecessor, road.successor


class _Tables(NamedTuple):
    """The columns of all roads.

    Attributes:
        of: columns of each road.
        rows: owner (K,), road (K,) and numbers (K, N) of all elements of a kind; not a number for a text
            that is none.
        lane_section: (L,) index of the section of each lane.
    """

    roads: list[_RoadColumns]
    rows: dict[str, tuple[IntArray, IntArray, FloatArray]]
    lane_section: IntArray

    @classmethod
    def of(cls, roads: list[_RoadColumns]) -> "_Tables":
        """Put roads one after the other."""
        every = np.arange(len(roads))
        first_section, first_lane = (
            first_rows(np.array([len(lists) for lists in of_roads], dtype=np.int64))
            for of_roads in ([road.sections for road in roads], [road.lanes for road in roads])
        )
        rows = {}
        for name, names in _ATTRIBUTES.items():
            texts = list(chain.from_iterable([road.numbers[name] for road in roads]))
            try:
                numbers = np.fromiter(map(float, texts), np.float64, len(texts))
            except (TypeError, ValueError):
                numbers = np.fromiter(map(_number, texts), np.float64, len(texts))
            numbers = numbers.reshape(-1, len(names))
            owner = of_road = np.repeat(every, [len(road.numbers[name]) // len(names) for road in roads])
            if name in _OF_LANES:
                lane_of = list(chain.from_iterable([road.lane_of[name] for road in roads]))
                owner = first_lane[of_road] + np.array(lane_of, dtype=np.int64)
            rows[name] = owner, of_road, numbers
        of_road = np.repeat(every, np.diff(first_lane))
        section = [lane[0] for road in roads for lane in road.lanes]
        return cls(roads, rows, first_section[of_road] + np.array(section, dtype=np.int64))

    def odd_roads(self) -> set[int]:
        """Return the roads in which numbers are missing, impossible, or do not ascend."""
        odd: set[int] = set()
        for name, (owner, road, rows) in self.rows.items():
            # Not a number is not within either.
            is_odd: BoolArray = np.any(~(np.abs(rows) <= MAX_NUMBER), axis=1)
            start = rows[:, 0]
            together = np.diff(owner) == 0
            is_odd[1:] |= together & (np.diff(start) < 0.0)
            if name == "geometry":
                is_odd |= (rows[:, 4] < 0.0) | (rows[:, 4] > MAX_LENGTH_M)
            elif name == "shape":
                # Places of one s ascend in t.
                is_odd[1:] |= together & (np.diff(start) == 0.0) & (np.diff(rows[:, 1]) < 0.0)
            elif name == "section":
                length_m = np.array([columns.row[1] for columns in self.roads])[road]
                is_odd |= (start < -OFF_ROAD_M) | (start > length_m + OFF_ROAD_M)
            odd.update(road[is_odd].tolist())
        return odd

    def geometry(self, values: Values) -> NetworkGeometry:
        """Return the tables of the network; warn of lanes and lane sections as their records' reader does."""
        count = len(self.roads)
        tables = {name: (owner, rows) for name, (owner, _, rows) in self.rows.items()}

        def profiles(name: str) -> CubicTable:
            return CubicTable.of_rows(*tables[name], count)

        ids, length_m, rules, junctions, predecessors, successors = zip(
            *(road.row for road in self.roads), strict=True
        )
        roads = RoadTable(ids, np.array(length_m), rules, junctions, predecessors, successors)
        rows = [lane for road in self.roads for lane in road.lanes]
        _, lane_ids, *columns, elements = zip(*rows, strict=True) if rows else ((),) * 8
        lanes = LaneColumns(
            self.lane_section,
            np.array(lane_ids, dtype=np.int64),
            *columns,
            *(tables[name] for name in ("width", "border", "height")),
        )
        self._warn_of_lanes(values, lanes, elements)
        section_road, starts = tables["section"]
        shape_road, shape_rows = tables["shape"]
        return NetworkGeometry(
            curves=CurveTable.build(
                *tables["geometry"], [shape for road in self.roads for shape in road.shapes], count
            ),
            elevation=profiles("elevation"),
            superelevation=profiles("superelevation"),
            crossfall_left=profiles("crossfall_left"),
            crossfall_right=profiles("crossfall_right"),
            shapes=ShapeTable.stack(np.split(shape_rows, np.searchsorted(shape_road, np.arange(1, count)))),
            lanes=LaneTable.build(
                roads, SectionColumns(section_road, starts[:, 0]), lanes, profiles("lane_offset")
            ),
            roads=roads,
        )

    def _warn_of_lanes(
        self, values: Values, columns: LaneColumns, elements: Sequence[Element | None]
    ) -> None:
        start_m = np.full((2, len(elements)), np.nan)
        for column, (owner, rows) in zip(start_m, (columns.border, columns.width), strict=True):
            first = run_starts(owner)
            column[owner[first]] = rows[first, 0]
        is_there = ~np.isnan(start_m)
        start_m = np.where(is_there[1], start_m[1], start_m[0])
        odd = (columns.id != 0) & ((is_there[0] == is_there[1]) | (start_m > LATE_M))
        if not LANE_TYPES.issuperset(columns.type):
            odd |= np.array([name not in LANE_TYPES for name in columns.type])
        for i in np.flatnonzero(odd).tolist():
            lane = elements[i]
            if lane is not None:
                start = float(start_m[i]) if is_there[:, i].any() else None
                has_both = bool(is_there[:, i].all())
                warn_of_lane(values, lane, int(columns.id[i]), columns.type[i], start, has_both)
        sections = [section for road in self.roads for section in road.sections]
        low, high = np.zeros((2, len(sections)), dtype=np.int64)
        np.minimum.at(low, columns.section, columns.id)
        np.maximum.at(high, columns.section, columns.id)
        gaps = high - low + 1 != np.bincount(columns.section, minlength=len(sections))
        for k in np.flatnonzero(gaps).tolist():
            section = sections[k]
            if section is not None:
                warn_of_section(values, section, columns.id[columns.section == k].tolist())


def _check(sound: bool) -> None:
    if not sound:
        raise _OddError


def _number(text: object) -> float:
    try:
        return float(text)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        return np.nan
