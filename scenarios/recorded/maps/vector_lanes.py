"""Lanes given by their two borders: the surface between them, and what is beside it up to the road's edge."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from scenarios.errors import DatasetError
from smartmot.maps.lane_map import Side
from smartmot.types import BoolArray, FloatArray, IntArray

MAX_SHOULDER_M = 5.5
"""Widest strip from a lane to the edge of the drivable area that is taken for a part of the street: stalls at
right angles are 18 ft deep (ITE, Traffic Engineering Handbook). What is wider is the mouth of a junction."""

SIDEWALK_M = 1.5
"""Width of the sidewalk beyond the edge, of which these maps say nothing: 5 ft, at which two wheelchairs pass
(US Access Board, PROWAG R302)."""

_EDGE_STEP_M = 0.5
"""Spacing at which the edge of the drivable area is looked for: that at which lanes are sampled."""
_BESIDE_M = 0.3
"""Lanes that overlap by less only meet."""
_PAST_M = 1e-3
"""Lanes before the edge are looked for up to so far past it."""
_SLIVER_M = 0.1
"""Cracks between drivable areas, twice so wide, are none; their coordinates are given in centimetres."""
_ROUNDING = 1e-9
"""Shares of a ray or an edge that differ by less are the same: some nanometres."""
ROADWAY = ("driving", "bus")
"""Types beyond which no edge is looked for."""
MAX_LANE_M = 10_000.0
"""Longest lane; maps of drives are cut out around them, and lanes of a log are under 200 m."""
_LEAST_M = 1e-3
"""Points of a lane's middle are farther apart."""

SIDES: tuple[Side, Side] = ("left", "right")


@dataclass(frozen=True, slots=True, eq=False)
class VectorLane:
    """A lane as the map gives it.

    Args:
        id: Its number, unique in the map.
        kind: OpenDRIVE type name.
        borders_m: (P, 3) left and (Q, 3) right border in travel direction.
        in_junction: Whether it is part of a junction.
        successors, predecessors: Numbers of lanes, which the map need not have.
        beside: Number of the lane on each side, if there is one.
        may_leave: Whether the mark on each side lets traffic leave the lane over it.
    """

    id: int
    kind: str
    borders_m: tuple[FloatArray, FloatArray]
    in_junction: bool
    successors: tuple[int, ...]
    predecessors: tuple[int, ...]
    beside: Mapping[Side, int]
    may_leave: Mapping[Side, bool]


class Ribbon(NamedTuple):
    """The surface of one lane.

    Attributes:
        along_m: (P,) way from its entry; of a strip beside a lane, that of the lane.
        center_m: (P, 3) its middle.
        width_m: (P,) its width.
        left_m, right_m: (Q, 2) borders.
        left_share, right_share: (Q,) shares of the way at their points.
    """

    along_m: FloatArray
    center_m: FloatArray
    width_m: FloatArray
    left_m: FloatArray
    right_m: FloatArray
    left_share: FloatArray
    right_share: FloatArray

    @property
    def length_m(self) -> float:
        """Length of the way."""
        return float(self.along_m[-1])

    def outline(self, low: float = 0.0, high: float = 1.0) -> FloatArray:
        """(Q, 2) the borders between two shares of the way, as one ring."""
        left = _between(self.left_m, self.left_share, low, high)
        return np.concatenate((left, _between(self.right_m, self.right_share, low, high)[::-1]))


def opposite(side: Side) -> Side:
    """The other side."""
    return "right" if side == "left" else "left"


def same_way(lane: VectorLane, other: VectorLane) -> bool:
    """Whether two lanes beside each other run the same way."""
    a, b = (sum((border[-1] - border[0])[:2] for border in each.borders_m) for each in (lane, other))
    return bool(np.dot(a, b) > 0.0)


def ribbon_between(lane: VectorLane) -> Ribbon:
    """The surface between two borders; both are passed at the same share of their lengths."""
    shares = [_shares(border) for border in lane.borders_m]
    share = np.union1d(*shares)
    left, right = (
        np.column_stack([np.interp(share, at, column) for column in border.T])
        for at, border in zip(shares, lane.borders_m, strict=True)
    )
    center = 0.5 * (left + right)
    steps = np.hypot(*np.diff(center[:, :2], axis=0).T)
    along = np.append(0.0, np.cumsum(steps))
    keep = np.append(True, np.diff(np.floor(along / _LEAST_M)) > 0)
    keep[-1] = True  # rather the end than the point before it
    keep[1:-1] &= along[1:-1] < along[-1] - _LEAST_M
    left, right, center, along = left[keep], right[keep], center[keep], along[keep]
    if len(along) < 2 or along[-1] < _LEAST_M:
        raise DatasetError(f"lane {lane.id}: it has no length between its borders")
    if along[-1] > MAX_LANE_M:
        raise DatasetError(
            f"lane {lane.id}: it is {along[-1]:.0f} m long, {MAX_LANE_M:.0f} m at most expected"
        )
    # borders that end askew are nearer to each other than their ends are
    width = np.abs(((left - right)[:, :2] * _normals(center[:, :2])).sum(axis=1))
    flat = (border[:, :2] for border in lane.borders_m)
    return Ribbon(along, center, width, *flat, *shares)


def _between(points_m: FloatArray, share: FloatArray, low: float, high: float) -> FloatArray:
    """(P, 2) the part of a line between two shares of its way."""
    if (low, high) == (0.0, 1.0):
        return points_m
    at = np.concatenate(([low], share[(share > low) & (share < high)], [high]))
    return np.column_stack([np.interp(at, share, column) for column in points_m.T])


def _shares(points_m: FloatArray) -> FloatArray:
    """(P,) share of a line's length up to each of its points."""
    travelled = np.append(0.0, np.cumsum(np.hypot(*np.diff(points_m[:, :2], axis=0).T)))
    if travelled[-1] <= 0.0:
        return np.linspace(0.0, 1.0, len(points_m))
    shares: FloatArray = travelled / travelled[-1]
    return shares


def _normals(points_m: FloatArray) -> FloatArray:
    """(P, 2) unit vectors to the left of a line at its points."""
    step = np.diff(points_m, axis=0)
    step = step / np.maximum(np.hypot(step[:, 0], step[:, 1]), 1e-12)[:, None]
    tangent = np.concatenate((step[:1], step[:-1] + step[1:], step[-1:]))
    tangent = tangent / np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-12)[:, None]
    return np.column_stack((-tangent[:, 1], tangent[:, 0]))


def outlines(ribbons: Sequence[Ribbon]) -> NDArray[np.object_]:
    """Rings around lanes; some cross themselves."""
    if not ribbons:
        return np.empty(0, dtype=np.object_)
    points_m = [ribbon.outline() for ribbon in ribbons]
    owner = np.repeat(np.arange(len(ribbons)), [len(points) for points in points_m])
    return np.asarray(shapely.linearrings(np.concatenate(points_m), indices=owner), dtype=np.object_)


def surfaces(ribbons: Sequence[Ribbon]) -> list[shapely.Geometry]:
    """Polygons of lanes; outlines that cross themselves are made valid."""
    areas = np.asarray(shapely.polygons(outlines(ribbons)), dtype=np.object_)
    crossed = np.flatnonzero(~shapely.is_valid(areas))
    areas[crossed] = shapely.make_valid(areas[crossed])
    polygons: list[shapely.Geometry] = areas.tolist()
    return polygons


# --- the edge of the drivable area ----------------------------------------------------------------------


def edge_strips(
    lanes: Sequence[VectorLane],
    ribbons: Sequence[Ribbon],
    areas: Sequence[shapely.Geometry],
    drivable_m: Sequence[FloatArray],
) -> list[tuple[int, Side, tuple[Ribbon, Ribbon]]]:
    """Shoulder and sidewalk beside each lane that has no lane on a side, by row and side.

    Args:
        lanes: The lanes.
        ribbons: Their surfaces.
        areas: The same as polygons.
        drivable_m: (P, 2) outlines of the drivable areas.
    """
    if not drivable_m:
        return []
    union = shapely.union_all([shapely.make_valid(shapely.Polygon(ring)) for ring in drivable_m])
    drivable = union.buffer(_SLIVER_M, join_style="mitre").buffer(-_SLIVER_M, join_style="mitre")
    roadway_rows = np.array([k for k, lane in enumerate(lanes) if lane.kind in ROADWAY], dtype=np.int64)
    roadway = shapely.STRtree([areas[k] for k in roadway_rows.tolist()])
    # a lane beside that the map does not have is one too
    sides = [(row, side) for row, lane in enumerate(lanes) for side in SIDES if side not in lane.beside]
    if not sides:
        return []
    middles = {row: _sampled(ribbons[row]) for row, _ in sides}
    courses = [_border(middles[row], side) for row, side in sides]
    edges_m = _edge_distances(courses, [row for row, _ in sides], drivable, roadway, roadway_rows)
    return [
        (row, side, _strips(course, edge_m, side))
        for (row, side), course, edge_m in zip(sides, courses, edges_m, strict=True)
        if np.isfinite(edge_m).any()
    ]


class _Course(NamedTuple):
    """A border of a lane, point by point: way along the lane, place, unit vector outwards, and ray."""

    along_m: FloatArray
    border_m: FloatArray
    height_m: FloatArray
    outward: FloatArray
    rays_m: FloatArray


class _Middle(NamedTuple):
    """Points along the middle of a lane: way, place, height, unit vector to the left, and half the width."""

    along_m: FloatArray
    center_m: FloatArray
    height_m: FloatArray
    left: FloatArray
    half_m: FloatArray


def _sampled(ribbon: Ribbon) -> _Middle:
    """The middle of a lane at the spacing at which the edge is looked for."""
    along = np.linspace(0.0, ribbon.length_m, max(2, int(np.ceil(ribbon.length_m / _EDGE_STEP_M)) + 1))
    x, y, z, half = (
        np.interp(along, ribbon.along_m, values) for values in (*ribbon.center_m.T, 0.5 * ribbon.width_m)
    )
    center = np.column_stack((x, y))
    return _Middle(along, center, z, _normals(center), half)


def _border(middle: _Middle, side: Side) -> _Course:
    """One border of a lane."""
    outward = middle.left if side == "left" else -middle.left
    border = middle.center_m + outward * middle.half_m[:, None]
    rays = np.stack((border, border + outward * MAX_SHOULDER_M), axis=1)
    return _Course(middle.along_m, border, middle.height_m, outward, rays)


def _edge_distances(
    courses: Sequence[_Course],
    rows: Sequence[int],
    drivable: shapely.Geometry,
    roadway: shapely.STRtree,
    roadway_rows: IntArray,
) -> list[FloatArray]:
    """(P,) distances from each border to the edge; NaN where there is none, or a lane before it."""
    counts = [len(course.along_m) for course in courses]
    border_m, outward, rays_m = (
        np.concatenate([getattr(course, name) for course in courses])
        for name in ("border_m", "outward", "rays_m")
    )
    distance = np.hypot(*(_ways_out(rays_m, drivable) - border_m).T)
    ends = np.flatnonzero(np.isfinite(distance))
    if len(ends):
        # a lane that ends at the edge is not before it, whichever way that is rounded
        to_edge = distance[ends] + _PAST_M
        beyond, edge = (
            border_m[ends] + outward[ends] * at[:, None]
            for at in (np.minimum(_BESIDE_M + _PAST_M, to_edge), to_edge)
        )
        lines = shapely.linestrings(np.stack((beyond, edge), axis=1))
        ray, lane = roadway.query(lines, predicate="intersects")
        own = np.repeat(rows, counts)[ends[ray]]
        distance[ends[ray[roadway_rows[lane] != own]]] = np.nan
    return np.split(distance, np.cumsum(counts[:-1]))


def _ways_out(rays_m: FloatArray, area: shapely.Geometry) -> FloatArray:
    """(R, 2) where each of (R, 2, 2) rays first leaves an area; NaN where it stays inside.

    Whether a ray is inside changes only where it meets the boundary: between two such places one point tells.
    """
    points, part = shapely.get_coordinates(shapely.get_parts(shapely.boundary(area)), return_index=True)
    edges_m = np.stack((points[:-1], points[1:]), axis=1)[part[:-1] == part[1:]]
    ray, edge = shapely.STRtree(shapely.linestrings(edges_m)).query(shapely.linestrings(rays_m))
    run, step = rays_m[:, 1] - rays_m[:, 0], edges_m[edge, 1] - edges_m[edge, 0]
    offset = edges_m[edge, 0] - rays_m[ray, 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # along an edge, the edges at its ends are met
        share, on_edge = (_cross(offset, each) / _cross(run[ray], step) for each in (step, run[ray]))
    met = (share > 0.0) & (share < 1.0) & (np.abs(on_edge - 0.5) <= 0.5 + _ROUNDING)
    own = np.arange(len(rays_m))
    ray = np.concatenate((own, ray[met], own))
    share = np.concatenate((np.zeros(len(own)), share[met], np.ones(len(own))))
    order = np.lexsort((share, ray))
    ray, share = ray[order], share[order]
    stretch = np.flatnonzero((ray[:-1] == ray[1:]) & (np.diff(share) > _ROUNDING))
    middle = 0.5 * (share[stretch] + share[stretch + 1])
    shapely.prepare(area)
    inside = shapely.intersects_xy(area, rays_m[ray[stretch], 0] + run[ray[stretch]] * middle[:, None])
    leaving = stretch[~inside][::-1]  # the last one written is the first of a ray
    out = np.full(len(rays_m), np.nan)
    out[ray[leaving]] = share[leaving]
    return np.asarray(rays_m[:, 0] + out[:, None] * run)


def _cross(a: FloatArray, b: FloatArray) -> FloatArray:
    """(N,) cross products of (N, 2) vectors."""
    return np.asarray(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0])


def _strips(course: _Course, edge_m: FloatArray, side: Side) -> tuple[Ribbon, Ribbon]:
    """Shoulder and sidewalk; without width where there is no edge."""
    there: BoolArray = np.isfinite(edge_m)
    inner = np.zeros(len(edge_m))
    share = course.along_m / course.along_m[-1]
    ribbons = []
    for width in (np.where(there, edge_m, 0.0), np.where(there, SIDEWALK_M, 0.0)):
        outer = inner + width
        lines = [course.border_m + course.outward * at[:, None] for at in (inner, outer)]
        left, right = lines[::-1] if side == "left" else lines
        center = np.column_stack((0.5 * (left + right), course.height_m))
        ribbons.append(Ribbon(course.along_m, center, width, left, right, share, share))
        inner = outer
    return ribbons[0], ribbons[1]
