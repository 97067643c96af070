"""Which lanes contain a point, and which lane is nearest, for many points at once.

Roads are cut into cells with a box around each. A tree over the boxes yields the candidates; each candidate
is then decided exactly, by projecting the point to (s, t) and comparing t with the borders of all lanes
there.
"""

from collections.abc import Collection
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
import shapely

from opendrive.arrays import BoolArray, FloatArray, IntArray, concatenated_ranges, run_starts, wrapped
from opendrive.geometry.cells import RoadCells
from opendrive.roads.cell_tree import CellTree
from opendrive.roads.geometry import NetworkGeometry
from opendrive.roads.single import BORDER_M, FOOT_M, SingleLookup

if TYPE_CHECKING:
    from scipy.spatial import cKDTree

_BOX_M = 1e-3
_BORDER_STEPS = 4
_SAME_LEVEL_M = 1e-3
"""Of lanes as near as this in space, the one whose middle is nearest is taken, as without heights."""

_SINGLE_QUERIES = 8
"""From that many single points on, it is worth making what answers them."""

LEVEL_M = 2.0
"""Lanes that a point lies in count as one level if their heights differ by less: no car passes between."""


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
        found: (N,) false where there is no lane of the wanted types, or none within the distance that was
            asked for; the other fields are then 0.
        lane: (N,) index of the lane.
        s_m: (N,) road s of the foot on the lane's road, within the lane.
        t_m: (N,) t of the point.
        distance_m: (N,) distance to the lane in plan, 0 inside it.
    """

    found: BoolArray
    lane: IntArray
    s_m: FloatArray
    t_m: FloatArray
    distance_m: FloatArray

    @property
    def inside(self) -> BoolArray:
        """(N,) whether the point lies in that lane; else it is off every lane of the wanted types."""
        inside: BoolArray = self.found & (self.distance_m <= 0.0)
        return inside

    def within(self, distance_m: float) -> "NearestLanes":
        """Return the same, with nothing found where the lane is farther away than a distance."""
        near = self.found & (self.distance_m <= distance_m)
        return NearestLanes(near, *(np.where(near, column, 0) for column in self[1:]))


class _Feet(NamedTuple):
    """Points on the reference lines of cells: K pairs of point and cell."""

    point: IntArray
    cell: IntArray
    s_m: FloatArray
    t_m: FloatArray
    left_over_m: FloatArray

    def chosen(self, mask: BoolArray) -> "_Feet":
        """Return the pairs where `mask` is true."""
        rows = np.flatnonzero(mask)
        return _Feet._make(column[rows] for column in self)


class _Offers(NamedTuple):
    """Lanes beside the feet: pairs of foot and lane, with its row in the border table and its borders."""

    foot: IntArray
    lane: IntArray
    row: IntArray
    inner_m: FloatArray
    outer_m: FloatArray
    margin_m: FloatArray

    def chosen(self, mask: BoolArray) -> "_Offers":
        """Return the pairs where `mask` is true."""
        rows = np.flatnonzero(mask)
        return _Offers._make(column[rows] for column in self)


@dataclass(frozen=True, slots=True, eq=False)
class LaneIndex:
    """Spatial index of the lanes of a network.

    Attributes:
        geometry: geometry of the network.
        cells: cells of its roads.
        overhang_m: (C, 2) how far beyond a cell's start and end a point can lie between two pieces of a
            kinked reference line.
        trees: cells of some lane types, made when asked for; those of all lanes have no key.
        wanted: which lanes are of some types.
        single: what answers single points, once it is made.
        single_queries: how many single points were asked for before it was made.
    """

    geometry: NetworkGeometry
    cells: RoadCells
    overhang_m: FloatArray
    trees: dict[frozenset[str] | None, CellTree] = field(default_factory=dict, repr=False)
    wanted: dict[frozenset[str], list[bool]] = field(default_factory=dict, repr=False)
    single: list[SingleLookup] = field(default_factory=list, repr=False)
    single_queries: list[int] = field(default_factory=lambda: [0], repr=False)

    @classmethod
    def build(cls, geometry: NetworkGeometry) -> "LaneIndex":
        """Cut the roads into cells; trees are made when first needed."""
        cells = RoadCells.cut(geometry.curves, geometry.parts)
        low_m, high_m = _extremes(geometry, np.ones(len(geometry.lanes), dtype=np.bool_))
        return cls(geometry, cells, cells.overhang(low_m[cells.stretch], high_m[cells.stretch]) + FOOT_M)

    def containing(self, xy_m: FloatArray, z_m: FloatArray | None = None) -> LaneHits:
        """Return every lane that contains each point (N, 2); borders belong to the lane.

        With heights (N,), only the lanes of the level that is nearest to each.
        """
        hits = self._containing(xy_m)
        if z_m is None or not hits.lane.size:
            return hits
        height_m = self.geometry.lane_surface(hits.lane, hits.s_m, hits.t_m).z_m
        off_m = np.abs(height_m - z_m[hits.point])
        nearest = off_m == _per_group(np.minimum, off_m, hits.point)
        level_m = _per_group(np.maximum, np.where(nearest, height_m, -np.inf), hits.point)
        kept = np.flatnonzero(np.abs(height_m - level_m) <= LEVEL_M)
        return LaneHits._make(column[kept] for column in hits)

    def _single(self, xy_m: FloatArray) -> SingleLookup | None:
        """Return what answers a single point; None for other numbers of points, and for few queries."""
        if len(xy_m) != 1:
            return None
        if not self.single:
            self.single_queries[0] += 1
            if self.single_queries[0] < _SINGLE_QUERIES:
                return None
            tree = self._tree(None)
            lanes = self.geometry.lanes
            rows = tree.cell, tree.frame, tree.box
            side = lanes.side.tolist()
            banked = self.geometry.banked_roads
            self.single.append(
                SingleLookup.build(
                    self.cells, lanes.borders, side, banked, rows, tree.circle, self.overhang_m
                )
            )
        return self.single[0]

    def _containing(self, xy_m: FloatArray) -> LaneHits:
        single = self._single(xy_m)
        if single is not None:
            x_m, y_m = xy_m[0].tolist()
            lane_hits = single.containing(x_m, y_m)
            if lane_hits is not None:
                lanes = np.array([hit[0] for hit in lane_hits], dtype=np.int64)
                numbers = np.array([hit[1:] for hit in lane_hits], dtype=np.float64).reshape(-1, 3)
                return LaneHits(np.zeros(len(lanes), dtype=np.int64), lanes, *numbers.T.copy())
        tree = self._tree(None)
        point, row = tree.candidates(xy_m)
        feet = self._feet(xy_m, point, tree.cell[row])
        before, after = self.overhang_m[feet.cell].T
        feet = feet.chosen((feet.left_over_m >= -before) & (feet.left_over_m <= after))
        offers = self._offers(feet, tree.lane_wanted)
        offers = offers.chosen(offers.margin_m >= -BORDER_M)
        left_over = np.abs(feet.left_over_m[offers.foot])
        inexact = np.flatnonzero(left_over > FOOT_M)
        if inexact.size:
            foot = offers.foot[inexact]
            inside = np.ones(offers.foot.size, dtype=np.bool_)
            inside[inexact] = self.geometry.in_wedge(
                self.cells.road[feet.cell[foot]], xy_m[feet.point[foot]], feet.s_m[foot]
            )
            offers, left_over = offers.chosen(inside), left_over[inside]
        name = feet.point[offers.foot] * len(self.geometry.lanes) + offers.lane
        order = np.argsort(name, kind="stable")
        again = name[order[1:]] == name[order[:-1]]
        if again.any():
            # The same lane can be found from two cells that meet at the point: the better foot is kept.
            order = np.lexsort((-offers.margin_m, left_over, name))
            order = order[np.append(True, ~again)]
        foot, lane = offers.foot[order], offers.lane[order]
        margin = np.maximum(offers.margin_m[order], 0.0)
        return LaneHits(feet.point[foot], lane, feet.s_m[foot], feet.t_m[foot], margin)

    def nearest(
        self, xy_m: FloatArray, lane_types: Collection[str], z_m: FloatArray | None = None
    ) -> NearestLanes:
        """Return the nearest lane of the given types for each point (N, 2), with heights (N,) in space.

        Of several lanes that contain a point, the one whose centre line is nearest is taken.
        """
        single = self._single(xy_m) if z_m is None else None
        if single is not None:
            x_m, y_m = xy_m[0].tolist()
            hit = single.nearest(x_m, y_m, self._wanted(frozenset(lane_types)))
            if hit is not None:
                numbers = np.array(hit[1:])[:, None]
                return NearestLanes(np.array([True]), np.array([hit[0]]), *numbers)
        n = len(xy_m)
        result = NearestLanes(
            np.zeros(n, dtype=np.bool_), np.zeros(n, dtype=np.int64), np.zeros(n), np.zeros(n), np.zeros(n)
        )
        tree = self._tree(frozenset(lane_types))
        if not tree.cell.size or not n:
            return result
        reach = self._reach(xy_m, tree, z_m) + _BOX_M
        # Far points last, so that few blocks have any.
        order = np.argsort(reach, kind="stable")
        for k, row in tree.within(xy_m[order], reach[order]):
            self._settle(result, xy_m, z_m, order[k], row, tree)
        return result

    def _wanted(self, lane_types: frozenset[str]) -> list[bool]:
        """Return which lanes are of given types, as a list."""
        wanted = self.wanted.get(lane_types)
        if wanted is None:
            wanted = np.isin(self.geometry.lanes.lane_type, sorted(lane_types)).tolist()
            self.wanted[lane_types] = wanted
        return wanted

    def nearest_along(
        self,
        xy_m: FloatArray,
        lane_types: Collection[str],
        heading_rad: FloatArray,
        z_m: FloatArray | None = None,
    ) -> NearestLanes:
        """Return the nearest lane of the given types for each point (N, 2) that is headed somewhere, (N,).

        Of several lanes that contain a point, the one whose travel direction is nearest to the heading is
        taken.
        """
        nearest, lanes = self.nearest(xy_m, lane_types, z_m), self.geometry.lanes
        hits = self.containing(xy_m, z_m)
        wanted = np.flatnonzero(np.isin(lanes.lane_type[hits.lane], tuple(lane_types)))
        point, lane, s, t = hits.point[wanted], hits.lane[wanted], hits.s_m[wanted], hits.t_m[wanted]
        road_heading = self.geometry.curves.evaluate(lanes.road[lane], s).heading_rad
        travel = road_heading + np.where(lanes.direction[lane] > 0, 0.0, np.pi)
        off = np.abs(wrapped(travel - heading_rad[point]))
        order = np.lexsort((off, point))
        first = order[run_starts(point[order])]
        rows = point[first]
        nearest.lane[rows], nearest.s_m[rows], nearest.t_m[rows] = lane[first], s[first], t[first]
        nearest.distance_m[rows] = 0.0
        return nearest

    def _reach(self, xy_m: FloatArray, tree: CellTree, z_m: FloatArray | None) -> FloatArray:
        """Return how far points (N, 2) at most are from the lane of the nearest sample."""
        distance, sample = tree.samples.query(xy_m)
        reach = np.asarray(distance)
        if z_m is not None:
            in_space: FloatArray = np.hypot(reach, tree.sample_z_m[sample] - z_m)
            return in_space
        if self.geometry.is_banked:
            return reach
        borders = self.geometry.lanes.borders
        feet = self._feet(xy_m, np.arange(len(xy_m)), tree.cell_of_sample[sample])
        stretch = self.cells.stretch[feet.cell]
        row = borders.rows(stretch, tree.lane_of_sample[sample])
        inner, outer = borders.offsets(row, feet.s_m - borders.low_m[stretch])
        beside = np.clip(feet.t_m, np.minimum(inner, outer), np.maximum(inner, outer))
        nearer: FloatArray = np.minimum(reach, np.hypot(feet.left_over_m, feet.t_m - beside))
        return nearer

    def _settle(
        self,
        result: NearestLanes,
        xy_m: FloatArray,
        z_m: FloatArray | None,
        point: IntArray,
        row: IntArray,
        tree: CellTree,
    ) -> None:
        """Enter the nearest of the lanes that rows of a tree offer to points."""
        feet = self._feet(xy_m, point, tree.cell[row])
        offers = self._offers(feet, tree.lane_wanted)
        low, high = np.minimum(offers.inner_m, offers.outer_m), np.maximum(offers.inner_m, offers.outer_m)
        t, left_over = feet.t_m[offers.foot], feet.left_over_m[offers.foot]
        beside = np.clip(t, low, high)
        distance = np.hypot(left_over, t - beside)
        distance[(offers.margin_m >= -BORDER_M) & (np.abs(left_over) <= FOOT_M)] = 0.0
        if self.geometry.is_banked:
            outside = np.flatnonzero(distance)
            foot = offers.foot[outside]
            surface = self.geometry.surface(self.cells.road[feet.cell[foot]], feet.s_m[foot], beside[outside])
            at = xy_m[feet.point[foot]]
            distance[outside] = np.hypot(at[:, 0] - surface.x_m, at[:, 1] - surface.y_m)
        if not distance.size:
            return
        self._follow_borders(xy_m, feet, offers, beside, distance)
        # The offers of a point lie together: the trees answer point by point.
        point = feet.point[offers.foot]
        in_space = distance
        if z_m is not None:
            surface = self.geometry.lane_surface(offers.lane, feet.s_m[offers.foot], beside)
            in_space = np.hypot(distance, surface.z_m - z_m[point])
        behind = in_space > _per_group(np.minimum, in_space, point) + (0.0 if z_m is None else _SAME_LEVEL_M)
        first = _least(np.where(behind, np.inf, np.abs(t - 0.5 * (low + high))), point)
        rows, foot = point[first], offers.foot[first]
        result.found[rows] = True
        result.lane[rows] = offers.lane[first]
        result.s_m[rows] = feet.s_m[foot]
        result.t_m[rows] = feet.t_m[foot]
        result.distance_m[rows] = distance[first]

    def _follow_borders(
        self, xy_m: FloatArray, feet: _Feet, offers: _Offers, beside_m: FloatArray, distance_m: FloatArray
    ) -> None:
        """Lessen distances to lanes whose borders slant: their nearest point is not abreast of the foot."""
        geometry, borders = self.geometry, self.geometry.lanes.borders
        some = np.flatnonzero((distance_m > 0.0) & borders.is_slanted[offers.row])
        if not some.size:
            return
        foot, row, lane = offers.foot[some], offers.row[some], offers.lane[some]
        cell, x, y = feet.cell[foot], xy_m[feet.point[foot], 0], xy_m[feet.point[foot], 1]
        low_m, high_m = self.cells.low_m[cell], self.cells.high_m[cell]
        start_m = borders.low_m[self.cells.stretch[cell]]
        inner_is_nearer = np.abs(beside_m - offers.inner_m)[some] < np.abs(beside_m - offers.outer_m)[some]
        s = feet.s_m[foot]
        for _ in range(_BORDER_STEPS):
            t = np.where(inner_is_nearer, *borders.offsets(row, s - start_m))
            slope = np.where(inner_is_nearer, *borders.slopes(row, s - start_m))
            sections = geometry.cross_sections(geometry.lanes.road[lane], s)
            border_x, border_y, _ = geometry.place(sections, t)
            dx, dy = x - border_x, y - border_y
            distance_m[some] = np.minimum(distance_m[some], np.hypot(dx, dy))
            ahead = sections.cos * dx + sections.sin * dy
            left = sections.cos * dy - sections.sin * dx
            along = np.maximum(1.0 - sections.curvature_per_m * t, 1e-3)
            s = np.clip(s + (ahead * along + left * slope) / (along**2 + slope**2), low_m, high_m)

    def _feet(self, xy_m: FloatArray, point: IntArray, cell: IntArray) -> _Feet:
        """Project points onto cells, K pairs."""
        at = xy_m[point]
        s, t, left_over = self.cells.project(at, cell)
        if self.geometry.is_banked:
            road = self.cells.road[cell]
            some = np.flatnonzero(self.geometry.banked_roads[road])
            low_m, high_m = self.cells.low_m[cell[some]], self.cells.high_m[cell[some]]
            s[some], t[some], left_over[some] = self.geometry.project(
                road[some], at[some], s[some], low_m, high_m
            )
        return _Feet(point, cell, s, t, left_over)

    def _offers(self, feet: _Feet, lane_wanted: BoolArray) -> _Offers:
        """Return the wanted lanes beside the feet."""
        borders = self.geometry.lanes.borders
        stretch = self.cells.stretch[feet.cell]
        count = borders.lane_count[stretch]
        lane = concatenated_ranges(borders.first_lane[stretch], count)
        row = concatenated_ranges(borders.first_row[stretch], count)
        foot = np.repeat(np.arange(len(stretch), dtype=np.int64), count)
        if not lane_wanted.all():
            wanted = np.flatnonzero(lane_wanted[lane])
            lane, row, foot = lane[wanted], row[wanted], foot[wanted]
        inner, outer = borders.offsets(row, (feet.s_m - borders.low_m[stretch])[foot])
        t, side = feet.t_m[foot], self.geometry.lanes.side[lane]
        return _Offers(foot, lane, row, inner, outer, np.minimum((t - inner) * side, (outer - t) * side))

    def _tree(self, lane_types: frozenset[str] | None) -> CellTree:
        if lane_types not in self.trees:
            self.trees[lane_types] = self._plant(lane_types)
        return self.trees[lane_types]

    def _plant(self, lane_types: frozenset[str] | None) -> CellTree:
        """Make the tree over the cells of the lanes of some types, or of all lanes."""
        from scipy.spatial import cKDTree  # takes longer to import than everything else here

        geometry, cells = self.geometry, self.cells
        wanted = np.ones(len(geometry.lanes), dtype=np.bool_)
        if lane_types is not None:
            wanted = np.isin(geometry.lanes.lane_type, sorted(lane_types))
        t_low, t_high = _extremes(geometry, wanted)
        cell = np.flatnonzero(np.isfinite(t_low)[cells.stretch])
        stretch = cells.stretch[cell]
        raised = geometry.greatest_raise[cells.road[cell]]
        slack = (
            geometry.greatest_shear[cells.road[cell]] * np.maximum(-t_low[stretch], t_high[stretch]) + raised
        )
        box = cells.boxes(cell, t_low[stretch] - raised, t_high[stretch] + raised, slack)
        frame = cells.frame[cell]
        x, y, cos, sin = frame[:, :, None].transpose(1, 0, 2)
        u, v = box[:, [0, 1, 1, 0]], box[:, [2, 2, 3, 3]]
        corners = np.stack([x + cos * u - sin * v, y + sin * u + cos * v], axis=-1)
        rings = np.concatenate([corners, corners[:, :1]], axis=1)
        polygons = np.asarray(shapely.polygons(rings), dtype=np.object_)
        middle = 0.5 * (corners[:, 0] + corners[:, 2])
        radius = np.hypot(*(corners[:, 0] - middle).T) + _BOX_M
        circle = (middle[:, 0].copy(), middle[:, 1].copy(), radius)
        boxes, centres = shapely.STRtree(polygons), cKDTree(middle)
        return CellTree(wanted, cell, frame, box, circle, boxes, centres, *self._samples(cell, wanted))

    def _samples(
        self, cell: IntArray, lane_wanted: BoolArray
    ) -> "tuple[cKDTree, IntArray, IntArray, FloatArray]":
        """Return the middles of the wanted lanes half-way along cells, with cells, lanes and heights."""
        from scipy.spatial import cKDTree  # takes longer to import than everything else here

        low_m, high_m = self.cells.low_m[cell], self.cells.high_m[cell]
        nothing = np.zeros(len(cell))
        feet = _Feet(np.arange(len(cell)), cell, 0.5 * (low_m + high_m), nothing, nothing)
        offers = self._offers(feet, lane_wanted)
        middle = 0.5 * (offers.inner_m + offers.outer_m)
        points = self.geometry.lane_surface(offers.lane, feet.s_m[offers.foot], middle)
        tree = cKDTree(np.stack([points.x_m, points.y_m], axis=1))
        return tree, cell[offers.foot], offers.lane, points.z_m


def _per_group(reduction: np.ufunc, value: FloatArray, group: IntArray) -> FloatArray:
    """Return the reduction of each group of equal neighbours, for each member."""
    first = run_starts(group)
    reduced: FloatArray = np.repeat(reduction.reduceat(value, first), np.diff(np.append(first, len(group))))
    return reduced


def _least(value: FloatArray, group: IntArray) -> IntArray:
    """Return the index of the first least value of each group of equal neighbours."""
    if not value.size:
        return np.empty(0, dtype=np.int64)
    least = np.flatnonzero(value == _per_group(np.minimum, value, group))
    return least[run_starts(group[least])]


def _extremes(geometry: NetworkGeometry, lane_wanted: BoolArray) -> tuple[FloatArray, FloatArray]:
    """Return the least and greatest t of wanted lanes per stretch of the border table; infinite without any.

    On banked roads the surface is drawn in towards the reference line, which is therefore included.
    """
    borders = geometry.lanes.borders
    row = np.flatnonzero(lane_wanted[concatenated_ranges(borders.first_lane, borders.lane_count)])
    stretch = np.repeat(np.arange(len(borders.low_m)), borders.lane_count)[row]
    low, high = (bound[row] for bound in borders.extremes())
    low_m, high_m = np.full(len(borders.low_m), np.inf), np.full(len(borders.low_m), -np.inf)
    np.minimum.at(low_m, stretch, low)
    np.maximum.at(high_m, stretch, high)
    banked = geometry.banked_roads[borders.road] & np.isfinite(low_m)
    low_m[banked], high_m[banked] = np.minimum(low_m[banked], 0.0), np.maximum(high_m[banked], 0.0)
    return low_m, high_m
