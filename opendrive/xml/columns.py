"""The geometry of all roads and lanes at once, straight from the XML.

To make a record of every lane and curve costs more than parsing the file does, and most of them are never
asked for. Here one walk over the file puts the numbers of all elements of a kind into one table instead. A
road with anything out of place, and whatever needs an error, is read by its record, whose rows then take the
place of the road's own.
"""

from array import array
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from opendrive.arrays import BoolArray, FloatArray, IntArray, run_starts
from opendrive.errors import MapContentError, WarningKind
from opendrive.geometry.curves import CurveTable
from opendrive.geometry.lateral_shape import ShapeTable
from opendrive.geometry.profiles import CubicTable
from opendrive.lanes.table import LaneColumns, LaneTable, RoadTable, SectionColumns
from opendrive.model import Arc, Road, RoadLink, Shape, TrafficRule
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
    MAX_TURN_RAD,
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

_OF_ROADS = {
    "geometry": ("s", "x", "y", "hdg", "length"), "elevation": CUBIC, "superelevation": CUBIC,
    "crossfall_left": CUBIC, "crossfall_right": CUBIC, "shape": SHAPE, "laneOffset": CUBIC,
    "laneSection": ("s",),
}  # fmt: skip
_OF_LANES = {"width": CUBIC_OFFSET, "border": CUBIC_OFFSET, "height": HEIGHT}
_NUMBERS = _OF_ROADS | _OF_LANES
"""Names of the numbers of each kind of element; a crossfall may be of both sides."""

_ENDS = ("predecessor", "successor")
_CROSSFALLS: dict[str, tuple[str, ...]] = {"left": ("crossfall_left",), "right": ("crossfall_right",)}
_CROSSFALLS["both"] = (*_CROSSFALLS["left"], *_CROSSFALLS["right"])
_PROFILES = ("elevation", "superelevation", *_CROSSFALLS["both"], "laneOffset")
_SORTED = (*_PROFILES, "shape", "width", "border")
"""Kinds whose records, out of order, are sorted here."""

_PART_OF = {
    "predecessor": "link", "successor": "link", "geometry": "planView", "elevation": "elevationProfile",
    "superelevation": "lateralProfile", "crossfall": "lateralProfile", "shape": "lateralProfile",
    "laneOffset": "lanes", "laneSection": "lanes",
}  # fmt: skip
"""Part of the road that an element is of."""

_PARTS = frozenset(_PART_OF.values())
_TAGS = ("road", "type", *_PARTS, *_PART_OF, *SIDES, "lane", *_OF_LANES)
_NO_ID = 10**6
"""Stands for an id of a lane that is none, or a large one."""

_RoadRow: TypeAlias = tuple[str, float, TrafficRule, str | None, RoadLink | None, RoadLink | None]
"""What `RoadTable` has of a road."""


def read_geometry(
    values: Values, root: Element, roads: Sequence[Element]
) -> tuple[NetworkGeometry, list[Road]]:
    """Return the geometry of `roads`, which stand in `root`, and the records of those that are odd.

    Everything that the records' reader would warn of in the geometry has then been warned of.

    Raises:
        MapContentError: what places a road or lane is missing or impossible.
    """
    file = _File(root, roads)
    rows: list[_RoadRow] = [("", 0.0, "RHT", None, None, None)] * len(roads)
    for r in np.flatnonzero(~file.odd).tolist():
        before = len(values.warnings)
        try:
            rows[r] = file.read(values, r)
        except MapContentError:
            del values.warnings[before:]
            file.odd[r] = True
    file.sort(values)
    file.warn_of_lanes(values)
    columns = file.columns()
    odd = np.flatnonzero(file.odd)
    records = [read_road(values, roads[r]) for r in odd.tolist()]
    if records:
        columns = columns.replaced(odd, records)
        for r, road in zip(odd.tolist(), records, strict=True):
            rows[r] = road.id, road.length_m, road.rule, road.junction_id, road.predecessor, road.successor
    return columns.geometry(rows), records


class _Kind:
    """Elements of one kind: their numbers, one after the other, and the road or lane of each."""

    __slots__ = ("names", "numbers", "of")

    def __init__(self, names: tuple[str, ...]) -> None:
        self.names = names
        self.numbers = array("d")
        self.of: list[int] = []

    def add(self, element: Element, of: int) -> None:
        """Add an element; not a number for a text that is none."""
        try:
            self.numbers.extend(map(float, map(element.get, self.names)))  # type: ignore[arg-type]
        except (TypeError, ValueError):
            del self.numbers[len(self.of) * len(self.names) :]
            self.numbers.extend([_number(element.get(name)) for name in self.names])
        self.of.append(of)

    def rows(self) -> FloatArray:
        """Return the numbers, a row per element."""
        return np.array(self.numbers).reshape(-1, len(self.names))


class _RoadElements:
    """Elements of a road that are more than numbers.

    Attributes:
        types: its types.
        links: its links, by their names.
        bends: pieces of the reference line that are neither lines nor arcs, by their rows.
    """

    __slots__ = ("bends", "links", "types")

    def __init__(self) -> None:
        self.types: list[Element] = []
        self.links: dict[object, Element] = {}
        self.bends: dict[int, Element] = {}


class _File:
    """The elements of a file that place roads and lanes, and their numbers.

    Attributes:
        odd: (R,) whether something about a road is missing, double or impossible.
    """

    def __init__(self, root: Element, roads: Sequence[Element]) -> None:
        self._roads = roads
        self._elements = [_RoadElements() for _ in roads]
        self._kinds = {name: _Kind(names) for name, names in _NUMBERS.items()}
        self._shapes: list[Shape] = []
        self._sections: list[Element] = []
        self._lanes: list[Element] = []
        self._places: list[tuple[int, int, int]] = []
        self._types: list[str] = []
        self._levels: list[bool] = []
        self._directions: list[str] = []
        self._linked: tuple[list[tuple[int, ...]], list[tuple[int, ...]]] = [], []
        self.odd = np.zeros(len(roads), dtype=np.bool_)
        self.odd[list(self._walk(root))] = True
        self._rows = {name: kind.rows() for name, kind in self._kinds.items()}
        self._of = {name: np.array(kind.of, dtype=np.int64) for name, kind in self._kinds.items()}
        self._section, sign, self._id = np.array(self._places, dtype=np.int64).reshape(-1, 3).T
        self._lane_road = self._of["laneSection"][self._section]
        self._check_lanes(sign)
        self._check_numbers()

    def _walk(self, root: Element) -> set[int]:
        """Enter the elements of all roads, in the order of the file; return the roads that are odd.

        What an element is follows from its name and its parent, which is the road, part, lane section, side,
        lane or link that was entered last. With any other parent it says nothing about roads and lanes.
        """
        road_of = {road: r for r, road in enumerate(self._roads)}
        kinds, sections, lanes, places = self._kinds, self._sections, self._lanes, self._places
        before, after = self._linked
        odd: set[int] = set()
        parts: set[str] = set()
        r = sign = -1
        part_name = ""
        road: Element | None = None
        part, section, side, lane, link = (road,) * 5
        for element in root.iter(*_TAGS):
            # Comments and the like, whose tag is no text, are not in the tree.
            tag: Any = element.tag
            parent = element.getparent()
            if parent is part:
                if _PART_OF.get(tag) != part_name:
                    continue
                if tag == "geometry":
                    self._add_piece(element, r)
                elif tag == "laneSection":
                    section = element
                    sections.append(element)
                    kinds[tag].add(element, r)
                elif tag == "crossfall":
                    names = _CROSSFALLS.get(element.get("side", "both"), ())
                    for name in names:
                        kinds[name].add(element, r)
                    if not names:
                        odd.add(r)
                elif tag not in _ENDS:
                    kinds[tag].add(element, r)
                elif self._elements[r].links.setdefault(tag, element) is not element:
                    odd.add(r)
            elif parent is lane:
                if tag in _OF_LANES:
                    kinds[tag].add(element, len(lanes) - 1)
                elif tag == "link":
                    link = element
            elif parent is link:
                if tag in _ENDS:
                    lane_id = _lane_id(element)
                    if lane_id == _NO_ID:
                        odd.add(r)
                    (before if tag == "predecessor" else after)[-1] += (lane_id,)
            elif parent is side:
                if tag == "lane":
                    lane = element
                    lanes.append(lane)
                    places.append((len(sections) - 1, sign, _lane_id(lane)))
                    self._types.append(lane.get("type", "none"))
                    self._levels.append(lane.get("level") in ("true", "1"))
                    self._directions.append(lane.get("direction", "standard"))
                    before.append(())
                    after.append(())
            elif parent is section:
                if tag in SIDES:
                    side, sign = element, SIDES[tag]
            elif parent is road:
                if tag == "type":
                    self._elements[r].types.append(element)
                elif tag in _PARTS:
                    part, part_name = element, tag
                    # The records' reader takes the first part of a name.
                    if tag in parts:
                        odd.add(r)
                    parts.add(tag)
            elif tag == "road" and element in road_of:
                road, r = element, road_of[element]
                parts.clear()
        return odd

    def _add_piece(self, element: Element, r: int) -> None:
        """Enter a piece of the reference line; its shape at once, if it is a line or an arc."""
        self._kinds["geometry"].add(element, r)
        shape = element[0] if len(element) == 1 else element
        if shape.tag == "arc":
            curvature = _number(shape.get("curvature"))
            turn_rad = abs(curvature) * self._kinds["geometry"].numbers[-1]
            if 0.0 < turn_rad <= MAX_TURN_RAD:
                self._shapes.append(Arc(curvature))
                return
        if shape.tag != "line":
            self._elements[r].bends[len(self._shapes)] = element
        self._shapes.append(LINE)

    def _check_lanes(self, sign: IntArray) -> None:
        """Mark the roads in which a lane's id is used twice, is none, or is one of the other side."""
        wrong = (np.sign(self._id) != sign) | (self._id == _NO_ID)
        order = np.lexsort((self._id, self._section))
        again = (np.diff(self._section[order]) == 0) & (np.diff(self._id[order]) == 0)
        wrong[order[1:][again]] = True
        self.odd[self._lane_road[wrong]] = True

    def _check_numbers(self) -> None:
        """Mark the roads in which numbers are missing or impossible, or pieces or sections out of order."""
        length_m = np.array([_number(road.get("length")) for road in self._roads])
        for name, rows in self._rows.items():
            owner, start_m = self._of[name], rows[:, 0]
            road = self._road(name)
            # Not a number is not within either.
            odd: BoolArray = np.any(~(np.abs(rows) <= MAX_NUMBER), axis=1)
            if name not in _SORTED:
                odd[1:] |= (np.diff(owner) == 0) & (np.diff(start_m) < 0.0)
            if name == "geometry":
                odd |= (rows[:, 4] < 0.0) | (rows[:, 4] > MAX_LENGTH_M)
            elif name == "laneSection":
                odd |= (start_m < -OFF_ROAD_M) | (start_m > length_m[road] + OFF_ROAD_M)
            self.odd[road[odd]] = True
            if name in ("geometry", "laneSection"):
                self.odd |= np.bincount(road, minlength=len(self.odd)) == 0

    def _road(self, name: str) -> IntArray:
        """Return the road of each element of a kind."""
        return self._lane_road[self._of[name]] if name in _OF_LANES else self._of[name]

    def read(self, values: Values, r: int) -> _RoadRow:
        """Read what numbers do not say of a road: its types and links, and shapes of its reference line.

        Raises:
            MapContentError: something is missing or impossible.
        """
        elements, road = self._elements[r], self._roads[r]
        for element in elements.types:
            ROAD_TYPE.read(values, element)
        for row, element in elements.bends.items():
            self._shapes[row] = read_shape(values, element)
        links = [elements.links.get(tag) for tag in _ENDS]
        before, after = (None if link is None else LINK.read(values, link) for link in links)
        road_id, length_m, rule, junction_id = (
            field.read(values, road) for field in (ID, LENGTH, RULE, JUNCTION_ID)
        )
        return road_id, length_m, rule, junction_id, before, after

    def sort(self, values: Values) -> None:
        """Sort records that are out of order, and warn of them as their records' reader does."""
        for name in _SORTED:
            owner, rows, road = self._of[name], self._rows[name], self._road(name)
            keys = (rows[:, 1], rows[:, 0]) if name == "shape" else (rows[:, 0],)
            order = np.lexsort((*keys, owner))
            moved = np.flatnonzero(order != np.arange(len(order)))
            if not moved.size:
                continue
            self._rows[name] = rows[order]
            tag = name.partition("_")[0]
            for i in np.unique(owner[moved[~self.odd[road[moved]]]]).tolist():
                first = next((self._lanes[i] if name in _OF_LANES else self._roads[i]).iter(tag))
                message = f"records are not in ascending {_NUMBERS[name][0]}; sorted"
                values.warn(WarningKind.ORDER, first, message)

    def warn_of_lanes(self, values: Values) -> None:
        """Warn of lanes and lane sections as their records' reader does."""
        start_m = np.full((2, len(self._lanes)), np.nan)
        for column, name in zip(start_m, ("border", "width"), strict=True):
            first = run_starts(self._of[name])
            column[self._of[name][first]] = self._rows[name][first, 0]
        is_there = ~np.isnan(start_m)
        start_m = np.where(is_there[1], start_m[1], start_m[0])
        odd = (self._id != 0) & ((is_there[0] == is_there[1]) | (start_m > LATE_M))
        types = self._types
        if not LANE_TYPES.issuperset(types):
            odd |= np.array([name not in LANE_TYPES for name in types])
        for i in np.flatnonzero(odd & ~self.odd[self._lane_road]).tolist():
            start = float(start_m[i]) if is_there[:, i].any() else None
            has_both = bool(is_there[:, i].all())
            warn_of_lane(values, self._lanes[i], int(self._id[i]), types[i], start, has_both)
        low, high = np.zeros((2, len(self._sections)), dtype=np.int64)
        np.minimum.at(low, self._section, self._id)
        np.maximum.at(high, self._section, self._id)
        gaps = high - low + 1 != np.bincount(self._section, minlength=len(low))
        for k in np.flatnonzero(gaps & ~self.odd[self._of["laneSection"]]).tolist():
            warn_of_section(values, self._sections[k], self._id[self._section == k].tolist())

    def columns(self) -> "_Columns":
        """Return the columns of all roads, those of odd ones too."""
        placed = {name: (self._of[name], self._rows[name]) for name in _NUMBERS}
        return _Columns(
            rows={name: placed[name] for name in _OF_ROADS},
            shapes=self._shapes,
            lanes=LaneColumns(
                self._section,
                self._id,
                self._types,
                self._levels,
                self._directions,
                *self._linked,
                placed["width"],
                placed["border"],
                placed["height"],
            ),
        )


@dataclass(frozen=True, slots=True)
class _Columns:
    """The columns of the tables of a network.

    Attributes:
        rows: road (K,), ascending, and numbers (K, N) of all elements of a kind.
        shapes: shape of each piece of the reference lines.
        lanes: lanes, by the row of their section.
    """

    rows: dict[str, tuple[IntArray, FloatArray]]
    shapes: list[Shape]
    lanes: LaneColumns

    @classmethod
    def of_records(cls, roads: IntArray, records: Sequence[Road]) -> "_Columns":
        """Return the columns of some roads that were read by their records."""
        tables = {name: [getattr(road, name) for road in records] for name in ("shape", *_PROFILES[:-1])}
        tables["laneOffset"] = [road.lane_offset for road in records]
        tables["laneSection"] = [np.array([[section.s_m] for section in road.sections]) for road in records]
        tables["geometry"] = [
            np.array([(p.s_m, p.x_m, p.y_m, p.heading_rad, p.length_m) for p in road.geometries])
            for road in records
        ]
        return cls(
            {
                name: (np.repeat(roads, [len(rows) for rows in parts]), np.concatenate(parts))
                for name, parts in tables.items()
            },
            [piece.shape for road in records for piece in road.geometries],
            LaneColumns.collect([section for road in records for section in road.sections]),
        )

    def replaced(self, roads: IntArray, records: Sequence[Road]) -> "_Columns":
        """Return the columns with those of some roads replaced by their records'."""
        other = _Columns.of_records(roads, records)
        rows: dict[str, tuple[IntArray, FloatArray]] = {}
        orders: dict[str, IntArray] = {}
        for name, (road, numbers) in self.rows.items():
            more_road, more = other.rows[name]
            every = np.append(road, more_road)
            kept = np.flatnonzero(np.append(~np.isin(road, roads), np.ones(len(more), dtype=np.bool_)))
            order = orders[name] = kept[np.argsort(every[kept], kind="stable")]
            rows[name] = every[order], np.concatenate([numbers, more])[order]
        shapes = self.shapes + other.shapes
        section_count = len(self.rows["laneSection"][0])
        row_of_section = np.full(section_count + len(other.rows["laneSection"][0]), -1)
        row_of_section[orders["laneSection"]] = np.arange(len(orders["laneSection"]))
        return _Columns(
            rows,
            [shapes[i] for i in orders["geometry"].tolist()],
            self.lanes.joined(other.lanes, section_count).renumbered(row_of_section),
        )

    def geometry(self, roads: Sequence[_RoadRow]) -> NetworkGeometry:
        """Return the tables of the network."""
        count = len(roads)
        ids, length_m, rules, junctions, predecessors, successors = zip(*roads, strict=True)
        table = RoadTable(ids, np.array(length_m), rules, junctions, predecessors, successors)
        profiles = {name: CubicTable.of_rows(*self.rows[name], count) for name in _PROFILES}
        section_road, starts = self.rows["laneSection"]
        sections = SectionColumns(section_road, starts[:, 0])
        return NetworkGeometry(
            curves=CurveTable.build(*self.rows["geometry"], self.shapes, count),
            shapes=ShapeTable.build(*self.rows["shape"], count),
            lanes=LaneTable.build(table, sections, self.lanes, profiles.pop("laneOffset")),
            roads=table,
            **profiles,
        )


def _number(text: str | None) -> float:
    try:
        return float(text or "")
    except ValueError:
        return np.nan


def _lane_id(element: Element) -> int:
    return SMALL_INTEGERS.get(element.get("id", ""), _NO_ID)
