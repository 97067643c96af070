"""The borders of lanes as points: at equal distances, or as polygons within a tolerance."""

from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from opendrive.arrays import FloatArray, IntArray, concatenated_ranges, first_rows, run_starts
from opendrive.roads.geometry import NetworkGeometry

_SHARE = 0.9
"""Part of a tolerance that the probes may use up; the border may depart a little more between them."""

_PROBES = np.array([0.0, (3.0 - np.sqrt(3.0)) / 6.0, 0.5, (3.0 + np.sqrt(3.0)) / 6.0, 1.0])
"""Where a cubic departs most from its chord; irrational, so that no number of whole turns is overlooked."""

_LEAST_CHORD_M = 0.01
_AREA_SHARE = 5e-4
"""Half of what outlines may add to a lane's area or cut off: probes see 15/16 of it, and errors add up."""

_LEAST_WIDTH_M = 0.05
_LEAST_AREA_M2 = 1e-9
"""Twice the area of the smallest triangle that is not taken for a line."""

_GRID_M = 1e-6
"""Corners of triangles nearer to each other are one."""

_HALVINGS = 24
"""More than any stretch of a road needs: 1,000 km in chords of 6 cm."""

_BOUNDS_TOLERANCE_M = 5e-3
_NO_MARGINS = np.zeros(2)


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


class SampledCenters(NamedTuple):
    """Middles of all lanes: the points of lane i are rows first[i] to first[i + 1], in travel direction.

    Attributes:
        first: (L + 1,) first row of each lane.
        s_m: (N,) road s, monotonic within a lane.
        xyz_m: (N, 3) x, y, z, map frame.
        heading_rad: (N,) heading in travel direction, wrapped to (-pi, pi].
        width_m: (N,) width of the lane along t.
    """

    first: IntArray
    s_m: FloatArray
    xyz_m: FloatArray
    heading_rad: FloatArray
    width_m: FloatArray


def sample_borders(geometry: NetworkGeometry, step_m: float) -> SampledBorders:
    """Sample the borders of all lanes at equal distances of at most `step_m` along each lane section."""
    lanes, borders = geometry.lanes, geometry.lanes.borders
    lane_of_section = run_starts(lanes.section)
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
    return SampledBorders(first_rows(size), sections.s_m, left, right)


def chords(
    geometry: NetworkGeometry,
    stretches: tuple[IntArray, FloatArray, FloatArray],
    margins_m: FloatArray,
    tolerance_m: float,
    area_share: float = np.inf,
) -> tuple[IntArray, FloatArray, FloatArray]:
    """Halve stretches of lanes until straight chords follow both borders within a tolerance.

    Args:
        geometry: geometry of the network.
        stretches: lane, start and end of each, (N,).
        margins_m: (2,) by how much the inner and outer border are moved outwards.
        tolerance_m: greatest distance between border and chord.
        area_share: greatest share of the area between the borders that chords may add or cut off.

    Returns:
        lane, start and end of the chords, by lane and start.
    """
    lane, low_m, high_m = stretches
    done: list[tuple[IntArray, FloatArray, FloatArray]] = []
    share = _PROBES[:, None]
    for _ in range(_HALVINGS):
        if not lane.size:
            break
        s = low_m + share * (high_m - low_m)
        xy = geometry.border_points(np.broadcast_to(lane, s.shape).ravel(), s.ravel(), margins_m)
        xy = xy.reshape(2, len(_PROBES), lane.size, 2)
        chord = xy[:, :1] + share[:, :, None] * (xy[:, -1:] - xy[:, :1])
        rough = (np.hypot(*np.moveaxis(xy - chord, -1, 0)) > _SHARE * tolerance_m).any(axis=(0, 1))
        if np.isfinite(area_share):
            rough |= _area_errors(xy, high_m - low_m) > _SHARE * area_share
        rough &= high_m - low_m > _LEAST_CHORD_M
        done.append((lane[~rough], low_m[~rough], high_m[~rough]))
        middle = 0.5 * (low_m + high_m)[rough]
        lane, low_m, high_m = (
            np.concatenate([lane[rough], lane[rough]]),
            np.concatenate([low_m[rough], middle]),
            np.concatenate([middle, high_m[rough]]),
        )
    done.append((lane, low_m, high_m))
    lane, low_m, high_m = (np.concatenate(parts) for parts in zip(*done, strict=True))
    order = np.lexsort((low_m, lane))
    return lane[order], low_m[order], high_m[order]


def _area_errors(xy_m: FloatArray, length_m: FloatArray) -> FloatArray:
    """Return which share (N,) of the areas between two borders the chords over their ends get wrong.

    Args:
        xy_m: (2, P, N, 2) probes of both borders.
        length_m: (N,) lengths of the stretches.
    """
    ring = np.concatenate([xy_m[0], xy_m[1, ::-1]])
    areas_m2 = [
        0.5 * np.abs(np.sum(x * np.roll(y, -1, axis=0) - y * np.roll(x, -1, axis=0), axis=0))
        for corners in (ring, ring[[0, len(_PROBES) - 1, len(_PROBES), -1]])
        for x, y in [np.moveaxis(corners - ring[0], -1, 0)]
    ]
    # Where a lane is narrower than a painted line, its share of the whole lane is nothing.
    least_m2 = _LEAST_WIDTH_M * np.maximum(length_m, _LEAST_CHORD_M)
    share: FloatArray = np.abs(areas_m2[0] - areas_m2[1]) / np.maximum(areas_m2[0], least_m2)
    return share


def bounds_of(geometry: NetworkGeometry) -> tuple[float, float, float, float]:
    """Return the least and greatest x and y of all lanes, 0 without lanes; see `RoadNetwork.bounds`."""
    every = np.arange(len(geometry.lanes), dtype=np.int64)
    if not every.size:
        return (0.0, 0.0, 0.0, 0.0)
    lane, s_m, _ = chords(geometry, geometry.knots(every), _NO_MARGINS, _BOUNDS_TOLERANCE_M)
    lane, s_m = np.append(lane, every), np.append(s_m, geometry.lanes.s_end_m)
    xy_m = geometry.border_points(lane, s_m)
    (x_min, y_min), (x_max, y_max) = xy_m.min(axis=(0, 1)).tolist(), xy_m.max(axis=(0, 1)).tolist()
    return (x_min, y_min, x_max, y_max)


def lane_polygon(
    geometry: NetworkGeometry, lane: int, s0_m: float, s1_m: float, margins_m: FloatArray, tolerance_m: float
) -> FloatArray:
    """Return the outline (P, 2) of a lane between two s: along the right border and back along the left.

    Args:
        geometry: geometry of the network.
        lane: index of the lane.
        s0_m: least s.
        s1_m: greatest s.
        margins_m: (2,) by how much the left and the right border are moved outwards, along t.
        tolerance_m: greatest distance between border and outline.
    """
    outer_is_left = geometry.lanes.side[lane] == geometry.lanes.direction[lane]
    margins_m = margins_m[::-1] if outer_is_left else margins_m
    many, low, high = geometry.knots(np.array([lane]))
    low, high = np.maximum(low, s0_m), np.minimum(high, s1_m)
    kept = high > low
    _, low, high = chords(geometry, (many[kept], low[kept], high[kept]), margins_m, tolerance_m)
    s = np.append(low, high[-1]) if low.size else np.array([s0_m, s1_m])
    inner, outer = geometry.border_points(np.full(s.size, lane), s, margins_m)
    left, right = (outer, inner) if outer_is_left else (inner, outer)
    if geometry.lanes.direction[lane] < 0:
        left, right = left[::-1], right[::-1]
    return np.concatenate([right, left[::-1]])


def lane_polygons(geometry: NetworkGeometry, tolerance_m: float) -> NDArray[np.object_]:
    """Return the outlines of all lanes, within `tolerance_m` of their borders, (L,); see `NetworkLanes`.

    A lane whose borders touch or cross, or that meets itself, is put together from the triangles between its
    borders instead of from one ring.
    """
    lanes = geometry.lanes
    every = np.arange(len(lanes), dtype=np.int64)
    lane, low_m, _ = chords(geometry, geometry.knots(every), _NO_MARGINS, tolerance_m, _AREA_SHARE)
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
    polygons = np.asarray(shapely.polygons(rings), dtype=np.object_)
    # Along the outer border on the right and back along the inner one is counter-clockwise.
    sound = shapely.is_valid(polygons) & (shapely.is_ccw(rings) == (lanes.side < 0))
    for i in np.flatnonzero(~sound).tolist():
        rows = slice(first[i], first[i] + size[i])
        polygons[i] = _strip(geometry, i, s_m[rows])
    return np.asarray(shapely.orient_polygons(polygons), dtype=np.object_)


def _strip(geometry: NetworkGeometry, lane: int, s_m: FloatArray) -> shapely.Geometry:
    """Return the surface of one lane from the triangles between points of its borders.

    Borders end at the centre of the bend: beyond it lies what belongs to other places along the road. Where
    the borders have changed sides, there is no lane.
    """
    s_m = np.sort(np.append(s_m, _crossings(geometry, lane, s_m)))
    side = int(geometry.lanes.side[lane])
    every = np.full(len(s_m), lane)
    sections = geometry.cross_sections(geometry.lanes.road[every], s_m)
    inner_m, outer_m, _, _ = geometry.lanes.offsets_and_slopes(every, s_m)
    # The curvature jumps where pieces meet: each stretch goes by that of its middle.
    middles = geometry.curves.evaluate(sections.road[1:], 0.5 * (s_m[:-1] + s_m[1:]))
    bend = middles.curvature_per_m * side
    # the inverse of less than the least normal number is none
    is_bent = bend > np.finfo(np.float64).tiny
    centre_m = np.divide(1.0, bend, out=np.full(len(bend), np.inf), where=is_bent)

    def corners(end: slice, t_m: FloatArray) -> FloatArray:
        rows = np.arange(len(s_m))[end]
        held = side * np.minimum(side * t_m[end], centre_m)
        return np.stack(geometry.place(sections.take(rows), held)[:2], axis=1)

    starts, ends = slice(None, -1), slice(1, None)
    right_m, left_m = (inner_m, outer_m)[::side]
    right, next_right = corners(starts, right_m), corners(ends, right_m)
    left, next_left = corners(starts, left_m), corners(ends, left_m)
    triangles = np.concatenate(
        [np.stack([right, next_right, next_left], axis=1), np.stack([right, next_left, left], axis=1)]
    )
    (ax, ay), (bx, by) = ((triangles[:, k] - triangles[:, 0]).T for k in (1, 2))
    rings = triangles[ax * by - ay * bx > _LEAST_AREA_M2]
    triangles = np.concatenate([rings, rings[:, :1]], axis=1)
    united = shapely.union_all(shapely.polygons(triangles), grid_size=_GRID_M)
    parts = [part for part in shapely.get_parts(united) if part.geom_type == "Polygon"]
    return parts[0] if len(parts) == 1 else shapely.MultiPolygon(parts)


def _crossings(geometry: NetworkGeometry, lane: int, s_m: FloatArray) -> FloatArray:
    """Return where between given s the borders of a lane change sides, at most once between two of them."""

    def width(at_m: FloatArray) -> FloatArray:
        inner_m, outer_m, _, _ = geometry.lanes.offsets_and_slopes(np.full(len(at_m), lane), at_m)
        return outer_m - inner_m

    ends_m = width(s_m)
    some = np.flatnonzero(ends_m[:-1] * ends_m[1:] < 0.0)
    low_m, high_m = s_m[some], s_m[some + 1]
    for _ in range(_HALVINGS):
        middle_m = 0.5 * (low_m + high_m)
        before = width(middle_m) * ends_m[some] > 0.0
        low_m, high_m = np.where(before, middle_m, low_m), np.where(before, high_m, middle_m)
    return low_m
