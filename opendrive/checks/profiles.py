"""Defects of profiles: steps between their records, and records that start late or lie beyond the road."""

from collections.abc import Iterator

import numpy as np

from opendrive.arrays import FloatArray, IntArray, concatenated_ranges, run_starts, until_next
from opendrive.checks.curves import NEGATIVE_WIDTH_M, least_value
from opendrive.checks.joints import Joints
from opendrive.errors import MapWarning, WarningKind
from opendrive.geometry.cubic import value_of
from opendrive.geometry.profiles import CubicTable
from opendrive.roads.geometry import NetworkGeometry

STEP_M = 0.02
"""A greater step in height, width or lane offset is reported."""

STEP_RAD = 0.005
"""A greater step in superelevation or crossfall is reported: 2 cm at 4 m."""

OVERLAP_RULE = "asam.net:xodr:1.4.0:road.lane.border.overlap_with_inner_lanes"

LATE_M = 1e-3
"""Records that start this much after their road are still taken to start with it."""


def profile_warnings(geometry: NetworkGeometry, joints: Joints) -> Iterator[MapWarning]:
    """Yield what is wrong with elevation, superelevation, crossfall, lane offset, width and border."""
    roads, lanes = geometry.roads, geometry.lanes
    every = np.arange(len(roads.id), dtype=np.int64)
    no_lane = np.zeros(len(every), dtype=np.int64)
    start_m = np.zeros(len(every))
    for table, element, limit, unit in (
        (geometry.elevation, "elevation", STEP_M, "m"),
        (geometry.superelevation, "superelevation", STEP_RAD, "rad"),
        (geometry.crossfall_left, "crossfall", STEP_RAD, "rad"),
        (geometry.crossfall_right, "crossfall", STEP_RAD, "rad"),
        (lanes.lane_offset, "laneOffset", STEP_M, "m"),
    ):
        finder = _Finder(geometry, table, element, every, no_lane, start_m, roads.length_m)
        # Where lane sections are linked, lanes may take each other's place: their links are checked instead.
        excused = _linked_sections(geometry, joints) if element == "laneOffset" else set()
        yield from finder.steps(limit, unit, excused)
        yield from finder.late(limit, unit)
        yield from finder.beyond()
    yield from _lateral_shapes(geometry)
    yield from _bare_starts(geometry)
    lane_id = np.array([key.lane_id for key in lanes.key], dtype=np.int64)
    finder = _Finder(
        geometry, lanes.profiles, "lane/width", lanes.road, lane_id, lanes.s_start_m, lanes.s_end_m
    )
    yield from finder.steps(STEP_M, "m", set())
    yield from finder.beyond()
    yield from crossed_borders(geometry, NEGATIVE_WIDTH_M, np.inf, WarningKind.NEGATIVE_WIDTH)


def _linked_sections(geometry: NetworkGeometry, joints: Joints) -> set[tuple[int, float]]:
    """Return road and s of the starts of lane sections that are linked to the one before, or bare."""
    lanes, sections = geometry.lanes, geometry.lanes.sections
    a, b = lanes.section[joints.first.lane], lanes.section[joints.second.lane]
    one_road = sections.road[a] == sections.road[b]
    linked = np.maximum(a, b)[one_road & (np.abs(a - b) == 1)]
    count = np.bincount(lanes.section, minlength=len(sections.road))
    empty = np.flatnonzero((count == 0) | (np.append(0, count[:-1]) == 0))
    rows = np.concatenate([linked, empty])
    return set(zip(sections.road[rows].tolist(), sections.start_m[rows].tolist(), strict=True))


def _lateral_shapes(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield lateral shapes that start late, lie off their road, or step from one cubic to the next."""
    roads, shapes = geometry.roads, geometry.shapes
    road = np.repeat(np.arange(len(roads.id)), np.diff(shapes.first))

    def at(place: int, message: str, kind: WarningKind, amount_m: float) -> MapWarning:
        road_id, s_m = roads.id[int(road[place])], float(shapes.s_m[place])
        return MapWarning(road_id, "shape", message, kind, s_m, None, abs(amount_m), "m")

    end_m = roads.length_m[road]
    for place in np.flatnonzero((shapes.s_m > end_m + LATE_M) | (shapes.s_m < -LATE_M)).tolist():
        excess_m = max(float(shapes.s_m[place] - end_m[place]), -float(shapes.s_m[place]))
        message = f"the lateral shape lies {excess_m:.3g} m off the road"
        yield at(place, message, WarningKind.BEYOND_ROAD, excess_m)
    first = run_starts(road)
    for place in first[shapes.s_m[first] > LATE_M].tolist():
        s_m = float(shapes.s_m[place])
        message = f"the first lateral shape is at s = {s_m:.6g} m; it is held before"
        yield at(place, message, WarningKind.LATE_RECORD, s_m)
    heights = shapes.heights
    owner = np.repeat(np.arange(len(shapes.s_m)), np.diff(heights.first))
    joined = np.flatnonzero(owner[1:] == owner[:-1])
    ends = value_of(heights.coefficients[joined], heights.start_m[joined + 1] - heights.start_m[joined])
    step_m = heights.coefficients[joined + 1, 0] - ends
    for k in np.flatnonzero(np.abs(step_m) > STEP_M).tolist():
        t_m = heights.start_m[joined[k] + 1]
        message = f"the lateral shape steps by {step_m[k]:+.3g} m at t = {t_m:.6g} m; left as it is"
        yield at(int(owner[joined[k]]), message, WarningKind.STEP, float(step_m[k]))


def _bare_starts(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield roads and lane sections without length or off their road, and first sections that are late."""
    roads, sections = geometry.roads, geometry.lanes.sections
    for road in np.flatnonzero(roads.length_m <= 0.0).tolist():
        yield MapWarning(roads.id[road], "road", "the road has no length", WarningKind.ROAD_LENGTH, 0.0)
    first = run_starts(sections.road)
    for row in first[sections.start_m[first] > LATE_M].tolist():
        start_m = float(sections.start_m[row])
        message = f"the first lane section starts at s = {start_m:.6g} m; no lane is before it"
        road_id = roads.id[int(sections.road[row])]
        yield MapWarning(
            road_id, "laneSection", message, WarningKind.LATE_RECORD, start_m, None, start_m, "m"
        )
    for row in np.flatnonzero(sections.start_m < -LATE_M).tolist():
        start_m = float(sections.start_m[row])
        message = f"the lane section starts {-start_m:.3g} m before its road"
        road_id = roads.id[int(sections.road[row])]
        yield MapWarning(
            road_id, "laneSection", message, WarningKind.BEYOND_ROAD, start_m, None, -start_m, "m"
        )
    end_m = until_next(sections.road, sections.start_m, roads.length_m[sections.road])
    has_length = (end_m > sections.start_m) | (roads.length_m[sections.road] <= 0.0)
    for row in np.flatnonzero(~has_length).tolist():
        start_m = float(sections.start_m[row])
        message = f"the lane section at s = {start_m:.6g} m has no length"
        road_id = roads.id[int(sections.road[row])]
        yield MapWarning(road_id, "laneSection", message, WarningKind.SECTION_LENGTH, start_m)


def crossed_borders(
    geometry: NetworkGeometry, over_m: float, up_to_m: float, kind: WarningKind
) -> Iterator[MapWarning]:
    """Yield lanes given by a border that lies inside the lanes further in, by some amount at most."""
    lanes, borders = geometry.lanes, geometry.lanes.borders
    lane = concatenated_ranges(borders.first_lane, borders.lane_count)
    stretch = np.repeat(np.arange(len(borders.low_m)), borders.lane_count)
    rows = np.flatnonzero(lanes.is_border[lane])
    lane, stretch = lane[rows], stretch[rows]
    inner, outer = borders.coefficients[:, :, rows]
    width = ((outer - inner) * lanes.side[lane]).T
    least_m = least_value(width, borders.high_m[stretch] - borders.low_m[stretch])
    for k in np.flatnonzero((least_m < -over_m) & (least_m >= -up_to_m)).tolist():
        key, s_m = lanes.key[int(lane[k])], float(borders.low_m[stretch[k]])
        message = f"the border of lane {key.lane_id} lies {-least_m[k]:.3g} m inside the lanes further in"
        excess_m = float(-least_m[k])
        yield MapWarning(
            key.road_id, "lane/border", message, kind, s_m, key.lane_id, excess_m, "m", OVERLAP_RULE
        )


class _Finder:
    """Looks through the records of one kind of profile."""

    def __init__(
        self,
        geometry: NetworkGeometry,
        table: CubicTable,
        element: str,
        road: IntArray,
        lane_id: IntArray,
        start_m: FloatArray,
        end_m: FloatArray,
    ) -> None:
        self.roads = geometry.roads
        self.table = table
        self.element = element
        self.road, self.lane_id = road, lane_id
        self.start_m, self.end_m = start_m, end_m
        self.owner = np.repeat(np.arange(len(road)), np.diff(table.first))

    def _warning(
        self, row: int, kind: WarningKind, message: str, amount: float | None = None, unit: str = ""
    ) -> MapWarning:
        owner = int(self.owner[row])
        s_m = float(self.table.start_m[row])
        lane = int(self.lane_id[owner]) or None
        return MapWarning(
            self.roads.id[int(self.road[owner])], self.element, message, kind, s_m, lane, amount, unit
        )

    def steps(self, limit: float, unit: str, excused: set[tuple[int, float]]) -> Iterator[MapWarning]:
        """Yield where a record does not begin with what the one before ends with."""
        table = self.table
        joined = np.flatnonzero(
            (self.owner[1:] == self.owner[:-1]) & (table.start_m[1:] < self.end_m[self.owner[1:]])
        )
        ends = value_of(table.coefficients[joined], table.start_m[joined + 1] - table.start_m[joined])
        step = table.coefficients[joined + 1, 0] - ends
        for k in np.flatnonzero(np.abs(step) > limit).tolist():
            row = int(joined[k]) + 1
            if (int(self.road[self.owner[row]]), float(table.start_m[row])) not in excused:
                message = f"steps by {step[k]:+.3g} {unit} at s = {table.start_m[row]:.6g} m; left as it is"
                yield self._warning(row, WarningKind.STEP, message, float(abs(step[k])), unit)

    def late(self, limit: float, unit: str) -> Iterator[MapWarning]:
        """Yield first records that start late with another value than 0, which holds before."""
        first = self.table.first[:-1][np.diff(self.table.first) > 0]
        late = self.table.start_m[first] - self.start_m[self.owner[first]] > LATE_M
        for row in first[late & (np.abs(self.table.coefficients[first, 0]) > limit)].tolist():
            value = float(self.table.coefficients[row, 0])
            s_m = self.table.start_m[row]
            message = f"the first record starts at s = {s_m:.6g} m with {value:.3g} {unit}; 0 before"
            yield self._warning(row, WarningKind.LATE_RECORD, message, abs(value), unit)

    def beyond(self) -> Iterator[MapWarning]:
        """Yield records that start after the end of what they shape, or before its start."""
        end_m = self.end_m[self.owner]
        for row in np.flatnonzero(self.table.start_m > end_m + LATE_M).tolist():
            excess_m = float(self.table.start_m[row] - end_m[row])
            message = f"starts {excess_m:.3g} m after the end, at s = {end_m[row]:.6g} m; never used"
            yield self._warning(row, WarningKind.BEYOND_ROAD, message, excess_m, "m")
        early_m = self.start_m[self.owner] - self.table.start_m
        for row in np.flatnonzero(early_m > LATE_M).tolist():
            excess_m = float(early_m[row])
            message = f"starts {excess_m:.3g} m before s = {self.start_m[self.owner[row]]:.6g} m, its start"
            yield self._warning(row, WarningKind.BEYOND_ROAD, message, excess_m, "m")
