"""The borders of all lanes of a map as flat arrays of points."""

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from opendrive.arrays import FloatArray, IntArray, concatenated_ranges
from opendrive.roads.geometry import NetworkGeometry


class SampledBorders(NamedTuple):
    """Borders of all lanes: the points of lane i are rows first[i] to first[i + 1].

    Attributes:
        first: (L + 1,) first row of each lane.
        s_m: (N,) road s, ascending within a lane.
        left_m: (N, 3) x, y, z of the left border as seen in travel direction, map frame.
        right_m: (N, 3) x, y, z of the right border.
    """

    first: IntArray
    s_m: FloatArray
    left_m: FloatArray
    right_m: FloatArray


def sample_borders(geometry: NetworkGeometry, step_m: float) -> SampledBorders:
    """Sample the borders of all lanes at equal distances of at most `step_m` along each lane section."""
    lanes, borders = geometry.lanes, geometry.lanes.borders
    lane_of_section = np.flatnonzero(np.diff(lanes.section, prepend=-1))
    start_m, end_m = lanes.s_start_m[lane_of_section], lanes.s_end_m[lane_of_section]
    count = np.maximum(np.ceil((end_m - start_m) / step_m), 1.0).astype(np.int64) + 1
    # Reference line and profiles are evaluated once per cross section, whatever the number of lanes.
    section = np.repeat(np.arange(len(count)), count)
    share = concatenated_ranges(np.zeros(len(count), dtype=np.int64), count) / (count - 1)[section]
    s_m = start_m[section] + share * (end_m - start_m)[section]
    road = lanes.road[lane_of_section][section]
    sections = geometry.cross_sections(road, s_m)
    stretch = borders.stretch_of(lane_of_section[section], road, s_m)

    dense = np.cumsum(np.diff(lanes.section, prepend=-1) != 0) - 1
    size = count[dense]
    first_of_section = np.cumsum(count) - count
    at = concatenated_ranges(first_of_section[dense], size)
    lane = np.repeat(np.arange(len(lanes), dtype=np.int64), size)
    row = borders.rows(stretch[at], lane)
    sections = sections.take(at)
    t_inner, t_outer = borders.offsets(row, sections.s_m - borders.low_m[stretch[at]])
    inner, outer = np.empty((len(at), 3)), np.empty((len(at), 3))
    for points, t_m in ((inner, t_inner), (outer, t_outer)):
        points[:, 0], points[:, 1], z = geometry.place(sections, t_m)
        points[:, 2] = geometry.lift(lane, sections, t_m, z)
    left, right = inner.copy(), outer.copy()
    outer_is_left = (lanes.side == lanes.direction)[lane]
    left[outer_is_left], right[outer_is_left] = outer[outer_is_left], inner[outer_is_left]
    first = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(size)])
    return SampledBorders(first, sections.s_m, left, right)


def lane_polygons(geometry: NetworkGeometry, tolerance_m: float) -> NDArray[np.object_]:
    """Return the outlines of all lanes, within `tolerance_m` of their borders, counter-clockwise, (L,)."""
    lanes = geometry.lanes
    every = np.arange(len(lanes), dtype=np.int64)
    lane, low_m, _ = geometry.refine(*geometry.knots(every), np.zeros(2), tolerance_m)
    # Along one border and back along the other: the ends of each stretch but the last are the next one's
    # start.
    size = np.bincount(lane, minlength=len(lanes)) + 1
    first = np.cumsum(size) - size
    s_m = np.empty(int(size.sum()))
    s_m[np.arange(len(lane)) + lane] = low_m
    s_m[first + size - 1] = lanes.s_end_m
    inner, outer = geometry.border_points(np.repeat(every, size), s_m)
    owner = np.repeat(every, 2 * size)
    k = concatenated_ranges(np.zeros(len(size), dtype=np.int64), 2 * size)
    on_outer = k < size[owner]
    at = first[owner] + np.where(on_outer, k, 2 * size[owner] - 1 - k)
    rings = shapely.linearrings(np.where(on_outer[:, None], outer[at], inner[at]), indices=owner)
    rings = np.where(shapely.is_ccw(rings), rings, shapely.reverse(rings))
    return np.asarray(shapely.polygons(rings), dtype=np.object_)
