"""Which lanes contain a point, and which lane is nearest, for many points at once.

Every lane is cut into stretches short enough for quadrilaterals to follow its borders. A tree over them
yields the candidates; each candidate is then decided exactly, by projecting the point to (s, t) and comparing
t with the borders.
"""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import shapely
from numpy.typing import NDArray

from opendrive.arrays import BoolArray, FloatArray, IntArray
from opendrive.road_geometry import NetworkGeometry

TOLERANCE_M = 0.05
"""How far a quadrilateral may depart from the lane's border; candidates are taken twice as wide."""

_BORDER_M = 1e-9
_FOOT_M = 1e-6
_NO_MARGINS = np.zeros(2)


class LaneHits(NamedTuple):
    """Every lane that contains a point: K pairs of point and lane, by point and then lane.

    Attributes:
        point: (K,) index of the point.
        lane: (K,) index of the lane.
        s_m: (K,) road s of the point.
        t_m: (K,) t of the point.
        margin_m: (K,) distance to the nearer border of the lane, measured along t.
    """

    point: IntArray
    lane: IntArray
    s_m: FloatArray
    t_m: FloatArray
    margin_m: FloatArray


class NearestLanes(NamedTuple):
    """The nearest lane of each of N points.

    Attributes:
        found: (N,) false where the map has no lane of the wanted types; the other fields are then 0.
        lane: (N,) index of the lane.
        s_m: (N,) road s of the foot on the lane's road, within the lane.
        t_m: (N,) t of the point.
        distance_m: (N,) distance to the lane, 0 inside it; beside the lane it is measured along t.
    """

    found: BoolArray
    lane: IntArray
    s_m: FloatArray
    t_m: FloatArray
    distance_m: FloatArray


class _Feet(NamedTuple):
    """Points projected onto stretches of lanes."""

    s_m: FloatArray
    t_m: FloatArray
    margin_m: FloatArray
    centre_m: FloatArray
    distance_m: FloatArray
    left_over_m: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LaneIndex:
    """Spatial index of the lanes of a network.

    Attributes:
        geometry: geometry of the network.
        lane: (Q,) lane of each stretch.
        low_m: (Q,) road s where it starts.
        high_m: (Q,) road s where it ends.
        start_xy: (Q, 2) middle of the lane at `low_m`, map frame.
        end_xy: (Q, 2) middle of the lane at `high_m`, map frame.
        cells: (Q,) the stretches' quadrilaterals.
        tree: tree over `cells`.
        trees: trees over the cells of some lane types, made when asked for: cells and tree.
    """

    geometry: NetworkGeometry
    lane: IntArray
    low_m: FloatArray
    high_m: FloatArray
    start_xy: FloatArray
    end_xy: FloatArray
    cells: NDArray[np.object_]
    tree: shapely.STRtree
    trees: dict[frozenset[str], tuple[IntArray, shapely.STRtree]] = field(default_factory=dict, repr=False)

    @classmethod
    def build(cls, geometry: NetworkGeometry) -> "LaneIndex":
        """Cut the lanes into stretches and index them."""
        every_lane = np.arange(len(geometry.lanes), dtype=np.int64)
        lane, low, high = geometry.knots(every_lane)
        lane, low, high = geometry.refine(lane, low, high, _NO_MARGINS, TOLERANCE_M)
        start = geometry.border_points(lane, low)
        end = geometry.border_points(lane, high)
        ring = np.stack([start[0], end[0], end[1], start[1], start[0]], axis=1)
        cells = np.asarray(shapely.polygons(ring), dtype=np.object_)
        return cls(
            geometry, lane, low, high, start.mean(axis=0), end.mean(axis=0), cells, shapely.STRtree(cells)
        )

    @property
    def bounds(self) -> tuple[float, float, float, float]:
        """Least and greatest x and y of all lanes: xmin, ymin, xmax, ymax."""
        if not len(self.cells):
            return (0.0, 0.0, 0.0, 0.0)
        x_min, y_min, x_max, y_max = shapely.total_bounds(self.cells).tolist()
        return (x_min, y_min, x_max, y_max)

    def containing(self, xy_m: FloatArray) -> LaneHits:
        """Return every lane that contains each point (N, 2); borders belong to the lane."""
        point, cell = self._near(xy_m)
        feet = self._project(xy_m[point], cell)
        lane, lanes = self.lane[cell], self.geometry.lanes
        inside = feet.margin_m >= -_BORDER_M
        inexact = np.flatnonzero(inside & (np.abs(feet.left_over_m) > _FOOT_M))
        inside[inexact] = self.geometry.in_wedge(
            lanes.road[lane[inexact]], xy_m[point[inexact]], feet.s_m[inexact]
        )
        point, lane = point[inside], lane[inside]
        s, t, margin = feet.s_m[inside], feet.t_m[inside], feet.margin_m[inside]
        # The same lane can be found from two stretches that meet at the point: keep the better foot.
        order = np.lexsort((-margin, np.abs(feet.left_over_m[inside]), lane, point))
        point, lane = point[order], lane[order]
        s, t, margin = s[order], t[order], margin[order]
        first = np.ones(point.size, dtype=np.bool_)
        first[1:] = (point[1:] != point[:-1]) | (lane[1:] != lane[:-1])
        return LaneHits(point[first], lane[first], s[first], t[first], np.maximum(margin[first], 0.0))

    def nearest(self, xy_m: FloatArray, lane_types: Collection[str]) -> NearestLanes:
        """Return the nearest lane of the given types for each point (N, 2).

        Of several lanes that contain a point, the one whose centre line is nearest is taken.
        """
        n = len(xy_m)
        result = NearestLanes(
            np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.int64), np.zeros(n), np.zeros(n), np.zeros(n)
        )
        chosen, tree = self._cells_of(frozenset(lane_types))
        if not chosen.size or not n:
            return result
        points = shapely.points(xy_m)
        (near_point, _), distance = tree.query_nearest(points, all_matches=False, return_distance=True)
        reach = np.zeros(n)
        reach[near_point] = distance
        point, cell = tree.query(points, predicate="dwithin", distance=reach + 2.0 * TOLERANCE_M)
        cell = chosen[cell]
        feet = self._project(xy_m[point], cell)
        order = np.lexsort((feet.centre_m, feet.distance_m, point))
        first = order[np.unique(point[order], return_index=True)[1]]
        rows = point[first]
        result.found[rows] = True
        result.lane[rows] = self.lane[cell[first]]
        result.s_m[rows] = feet.s_m[first]
        result.t_m[rows] = feet.t_m[first]
        result.distance_m[rows] = feet.distance_m[first]
        return result

    def _cells_of(self, lane_types: frozenset[str]) -> tuple[IntArray, shapely.STRtree]:
        """Return the cells of lanes of the given types, and a tree over them."""
        if lane_types not in self.trees:
            wanted = np.isin(self.geometry.lanes.lane_type, sorted(lane_types))
            chosen = np.flatnonzero(wanted[self.lane])
            self.trees[lane_types] = (chosen, shapely.STRtree(self.cells[chosen]))
        return self.trees[lane_types]

    def _near(self, xy_m: FloatArray) -> tuple[IntArray, IntArray]:
        """Return pairs of point and cell that are close enough to matter."""
        point, cell = self.tree.query(shapely.points(xy_m), predicate="dwithin", distance=2.0 * TOLERANCE_M)
        return point.astype(np.int64), cell.astype(np.int64)

    def _project(self, xy_m: FloatArray, cell: IntArray) -> _Feet:
        """Project points (K, 2) onto the stretches `cell` (K,)."""
        lane, low, high = self.lane[cell], self.low_m[cell], self.high_m[cell]
        lanes = self.geometry.lanes
        road = lanes.road[lane]
        axis = self.end_xy[cell] - self.start_xy[cell]
        squared = np.maximum((axis**2).sum(axis=1), 1e-18)
        fraction = np.clip(((xy_m - self.start_xy[cell]) * axis).sum(axis=1) / squared, 0.0, 1.0)
        s, t, left_over = self.geometry.project(road, xy_m, low + fraction * (high - low), low, high)
        t_inner, t_outer, _, _ = lanes.offsets_and_slopes(lane, s)
        side = lanes.side[lane]
        margin = np.minimum((t - t_inner) * side, (t_outer - t) * side)
        nearest_t = np.clip(t, np.minimum(t_inner, t_outer), np.maximum(t_inner, t_outer))
        foot = self.geometry.surface(road, s, nearest_t)
        distance = np.hypot(xy_m[:, 0] - foot.x_m, xy_m[:, 1] - foot.y_m)
        distance[(margin >= -_BORDER_M) & (np.abs(left_over) <= _FOOT_M)] = 0.0
        return _Feet(s, t, margin, np.abs(t - 0.5 * (t_inner + t_outer)), distance, left_over)
