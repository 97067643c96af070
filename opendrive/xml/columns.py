"""The geometry of all roads and lanes at once, straight from the XML, for files without anything odd.

To make a record of every lane and curve costs more than parsing the file does, and most of them are never
asked for. Here the numbers of all elements of a kind become columns instead. What is out of order, and
whatever needs an error, is left to the reading of the records.
"""

from collections.abc import Mapping, Sequence
from typing import TypeAlias

import numpy as np

from opendrive.arrays import FloatArray, IntArray, run_starts
from opendrive.errors import MapContentError
from opendrive.geometry.curves import CurveTable
from opendrive.geometry.lateral_shape import ShapeTable
from opendrive.geometry.profiles import CubicTable
from opendrive.lanes.table import LaneColumns, LaneTable, RoadTable, SectionColumns
from opendrive.model import RoadLink
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
from opendrive.xml.roads import ID, JUNCTION_ID, LINE, LINK, ROAD_TYPE, RULE, SHAPE, read_shape
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
_READ = (
    "geometry", "elevation", "superelevation", "crossfall", "shape", "laneOffset", "laneSection", "lane",
    "link", "predecessor", "successor", "width", "border", "height",
)  # fmt: skip
_ROAD_PARTS = ("planView", "elevationProfile", "lateralProfile", "lanes", "link")

Elements: TypeAlias = dict[str, list[Element]]


class _OddError(Exception):
    """Something that has to be read with care."""


def read_geometry(values: Values, root: Element, roads: Sequence[Element]) -> NetworkGeometry | None:
    """Return the geometry of `roads`, all children of that name of `root`; None if anything is odd.

    Then nothing has been warned of; else everything that the records' reader would warn of in the geometry.
    """
    if sum(1 for _ in root.iterchildren("road")) != len(roads):
        return None
    before = len(values.warnings)
    try:
        return _read(root, roads, values)
    except (_OddError, MapContentError):
        del values.warnings[before:]
        return None


def _read(root: Element, roads: Sequence[Element], values: Values) -> NetworkGeometry:
    parts: dict[str, dict[Element, int]] = {name: {} for name in _ROAD_PARTS}
    for r, road in enumerate(roads):
        for part in road:
            if (of_road := parts.get(str(part.tag))) is not None:
                of_road[part] = r
            elif part.tag == "type":
                ROAD_TYPE.read(values, part)
    for of_road in parts.values():
        # The records' reader takes the first part of a name.
        _check(len(set(of_road.values())) == len(of_road))
    _check(len(parts["planView"]) == len(parts["lanes"]) == len(roads))

    # One walk over the file, by name; which of them stand where they count is seen from their parents.
    elements: Elements = {tag: [] for tag in _READ}
    for element in root.iter(*_READ):
        elements[element.tag].append(element)

    def profiles(tag: str, part: str) -> CubicTable:
        return CubicTable.of_rows(*_records(elements[tag], parts[part], CUBIC), len(roads))

    def crossfall(side: str) -> CubicTable:
        sides = [element.get("side", "both") for element in elements["crossfall"]]
        _check(set(sides) <= {"left", "right", "both"})
        records = [e for e, of in zip(elements["crossfall"], sides, strict=True) if of in (side, "both")]
        return CubicTable.of_rows(*_records(records, parts["lateralProfile"], CUBIC), len(roads))

    table = _roads(roads, parts["link"], values)
    return NetworkGeometry(
        curves=_curves(elements["geometry"], parts["planView"], values),
        elevation=profiles("elevation", "elevationProfile"),
        superelevation=profiles("superelevation", "lateralProfile"),
        crossfall_left=crossfall("left"),
        crossfall_right=crossfall("right"),
        shapes=_shapes(elements["shape"], parts["lateralProfile"], len(roads)),
        lanes=_lanes(values, elements, parts["lanes"], table, profiles("laneOffset", "lanes")),
        roads=table,
    )


def _roads(roads: Sequence[Element], links: dict[Element, int], values: Values) -> RoadTable:
    ends: dict[str, dict[int, RoadLink | None]] = {"predecessor": {}, "successor": {}}
    for parent, r in links.items():
        for link in parent:
            of_road = ends.get(str(link.tag))
            if of_road is not None:
                _check(r not in of_road)
                of_road[r] = LINK.read(values, link)
    return RoadTable(
        id=tuple([ID.read(values, road) for road in roads]),
        length_m=np.array([LENGTH.read(values, road) for road in roads]),
        rule=tuple([RULE.read(values, road) for road in roads]),
        junction_id=tuple([JUNCTION_ID.read(values, road) for road in roads]),
        predecessor=tuple(map(ends["predecessor"].get, range(len(roads)))),
        successor=tuple(map(ends["successor"].get, range(len(roads)))),
    )


def _curves(elements: list[Element], plans: dict[Element, int], values: Values) -> CurveTable:
    pieces, _ = _children(elements, plans)
    road, rows = _records(pieces, plans, _GEOMETRY)
    _check(len(np.unique(road)) == len(plans))
    _check(bool((rows[:, 4] >= 0.0).all() and (rows[:, 4] <= MAX_LENGTH_M).all()))
    shapes = [
        LINE if len(piece) == 1 and piece[0].tag == "line" else read_shape(values, piece, s_m, length_m)
        for piece, s_m, length_m in zip(pieces, rows[:, 0].tolist(), rows[:, 4].tolist(), strict=True)
    ]
    return CurveTable.build(road, rows, shapes, len(plans))


def _shapes(elements: list[Element], parents: dict[Element, int], roads: int) -> ShapeTable:
    owner, rows = _records(elements, parents, SHAPE)
    # Places of one s ascend in t.
    together = (np.diff(owner) == 0) & (np.diff(rows[:, 0]) == 0.0)
    _check(not (np.diff(rows[:, 1])[together] < 0.0).any())
    return ShapeTable.stack(np.split(rows, np.searchsorted(owner, np.arange(1, roads))))


def _lanes(
    values: Values,
    elements: Elements,
    parents: dict[Element, int],
    roads: RoadTable,
    lane_offset: CubicTable,
) -> LaneTable:
    sections, _ = _children(elements["laneSection"], parents)
    road, starts = _records(sections, parents, ("s",))
    start_m = starts[:, 0]
    _check(len(np.unique(road)) == len(parents))
    _check(bool((start_m >= -OFF_ROAD_M).all() and (start_m <= roads.length_m[road] + OFF_ROAD_M).all()))

    section_of: dict[Element, int] = {}
    side_of: dict[Element, int] = {}
    for k, parent in enumerate(sections):
        for group in parent:
            if (sign := SIDES.get(str(group.tag))) is not None:
                section_of[group], side_of[group] = k, sign
    lanes, section = _children(elements["lane"], section_of)
    lane_id = np.array(_integers(lanes), dtype=np.int64)
    _check(np.array_equal(np.sign(lane_id), _children(lanes, side_of)[1]))
    order = np.lexsort((lane_id, section))
    _check(bool(((np.diff(section[order]) != 0) | (np.diff(lane_id[order]) != 0)).all()))

    lane_of = {lane: i for i, lane in enumerate(lanes)}
    links, owner = _children(elements["link"], lane_of)
    lane_of_link = dict(zip(links, owner.tolist(), strict=True))

    def linked(tag: str) -> list[tuple[int, ...]]:
        ids: list[tuple[int, ...]] = [()] * len(lanes)
        links, owner = _children(elements[tag], lane_of_link)
        for i, lane_id in zip(owner.tolist(), _integers(links), strict=True):
            ids[i] = (*ids[i], lane_id)
        return ids

    columns = LaneColumns(
        section=section,
        id=lane_id,
        type=[lane.get("type", "none") for lane in lanes],
        level=[lane.get("level") in ("true", "1") for lane in lanes],
        direction=[lane.get("direction", "standard") for lane in lanes],
        predecessors=linked("predecessor"),
        successors=linked("successor"),
        width=_records(elements["width"], lane_of, CUBIC_OFFSET),
        border=_records(elements["border"], lane_of, CUBIC_OFFSET),
        height=_records(elements["height"], lane_of, HEIGHT),
    )
    _warn_of_lanes(values, sections, lanes, columns)
    return LaneTable.build(roads, SectionColumns(road, start_m), columns, lane_offset)


def _warn_of_lanes(
    values: Values, sections: list[Element], lanes: list[Element], columns: LaneColumns
) -> None:
    """Warn of lanes and lane sections as the records' reader does."""
    start_m = np.full((2, len(lanes)), np.nan)
    for column, (owner, rows) in zip(start_m, (columns.border, columns.width), strict=True):
        first = run_starts(owner)
        column[owner[first]] = rows[first, 0]
    is_there = ~np.isnan(start_m)
    start_m = np.where(is_there[1], start_m[1], start_m[0])
    odd = (columns.id != 0) & ((is_there[0] == is_there[1]) | (start_m > LATE_M))
    if not LANE_TYPES.issuperset(columns.type):
        odd |= np.array([name not in LANE_TYPES for name in columns.type])
    for i in np.flatnonzero(odd).tolist():
        start = float(start_m[i]) if is_there[:, i].any() else None
        has_both = bool(is_there[:, i].all())
        warn_of_lane(values, lanes[i], int(columns.id[i]), columns.type[i], start, has_both)
    count = len(sections)
    low, high = np.zeros((2, count), dtype=np.int64)
    np.minimum.at(low, columns.section, columns.id)
    np.maximum.at(high, columns.section, columns.id)
    gaps = high - low + 1 != np.bincount(columns.section, minlength=count)
    for k in np.flatnonzero(gaps).tolist():
        warn_of_section(values, sections[k], columns.id[columns.section == k].tolist())


def _check(sound: bool) -> None:
    if not sound:
        raise _OddError


def _children(elements: list[Element], parents: Mapping[Element, int]) -> tuple[list[Element], IntArray]:
    """Return the elements whose parent is among `parents`, and the index of that."""
    index = [parents.get(element.getparent()) for element in elements]  # type: ignore[arg-type]
    if None in index:
        elements = [element for element, k in zip(elements, index, strict=True) if k is not None]
    owner = [k for k in index if k is not None]
    return elements, np.array(owner, dtype=np.int64)


def _records(
    elements: list[Element], parents: Mapping[Element, int], names: tuple[str, ...]
) -> tuple[IntArray, FloatArray]:
    """Return owner (K,) and numbers (K, len(names)) of records, ascending in the first of them."""
    elements, owner = _children(elements, parents)
    rows = _numbers(elements, names)
    _check(not ((np.diff(rows[:, 0]) < 0.0) & (np.diff(owner) == 0)).any())
    return owner, rows


def _numbers(elements: Sequence[Element], names: tuple[str, ...]) -> FloatArray:
    """Return attributes of elements (K, len(names)); all have to be there."""
    texts = [element.get(name) for element in elements for name in names]
    try:
        # Most numbers of a map are some text for 0.
        known = {text: float(text) for text in set(texts)}  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise _OddError from None
    numbers = np.fromiter(map(known.__getitem__, texts), np.float64, len(texts))
    # Not a number is not within either.
    _check(bool((np.abs(numbers) <= MAX_NUMBER).all()))
    return numbers.reshape(-1, len(names))


def _integers(elements: Sequence[Element]) -> list[int]:
    """Return the attributes id of elements as integers, such as lanes have."""
    try:
        return [SMALL_INTEGERS[element.get("id")] for element in elements]  # type: ignore[index]
    except KeyError:
        raise _OddError from None
