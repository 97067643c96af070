"""From (s, t) to the map frame and back, for roads and lanes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
import shapely

from opendrive.arrays import (
    BoolArray,
    FloatArray,
    IntArray,
    concatenated_ranges,
    first_rows,
    run_starts,
    wrapped,
)
from opendrive.geometry.cells import RoadParts, arc_step
from opendrive.geometry.curves import CUBIC, CurveTable
from opendrive.geometry.lateral_shape import ShapeTable
from opendrive.geometry.profiles import CubicTable
from opendrive.lanes.table import LaneTable, RoadTable
from opendrive.model import Road

_FOOT_STEPS = 30
_FOOT_M = 1e-6
_MANY_CHORDS = 32
"""Of so many chords a tree finds the nearest in the time of comparing them all."""

_CHORD_RAD = 0.2
"""A chord of a reference line spans no greater turn."""

_CUBIC_SAMPLES = np.linspace(0.0, 1.0, 17)
_CUBIC_MARGIN = 1.5
"""By how much a cubic's curvature may be greater between its samples."""

_GREATEST_BEND_PER_M = 2.0
"""A cubic's cusp is not followed further."""

_SHAPE_STEPS = 12
_KINK_STEP_M = 1e-7
_SLOPE_STEP_M = 1e-3


class SurfacePoints(NamedTuple):
    """Points on road surfaces, map frame; arrays of one shape.

    `heading_rad` is the direction of increasing s, wrapped to (-pi, pi].
    """

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray


class CrossSections(NamedTuple):
    """Cross sections of roads at given s: arrays of one shape (N,).

    Attributes:
        road: road indices.
        s_m: along the road.
        x_m: reference line, map frame.
        y_m: reference line, map frame.
        heading_rad: heading of the reference line.
        curvature_per_m: its curvature.
        cos: cosine of the heading.
        sin: sine of the heading.
        z_m: height of the reference line.
        grade: its slope dz/ds.
        roll_rad: superelevation; meaningless if no road has any.
        d_roll: its derivative by s.
    """

    road: IntArray
    s_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    heading_rad: FloatArray
    curvature_per_m: FloatArray
    cos: FloatArray
    sin: FloatArray
    z_m: FloatArray
    grade: FloatArray
    roll_rad: FloatArray
    d_roll: FloatArray

    def take(self, rows: IntArray) -> "CrossSections":
        """Return some of the cross sections."""
        return CrossSections._make(column[rows] for column in self)


@dataclass(frozen=True, eq=False)
class NetworkGeometry:
    """Geometry of all roads and lanes, evaluated on arrays.

    Attributes:
        curves: reference lines.
        elevation: height; profile r belongs to road r.
        superelevation: roll about the reference line, rad.
        crossfall_left: slope left of the reference line, rad.
        crossfall_right: slope right of it, rad.
        shapes: lateral shapes.
        lanes: all lanes.
        roads: all roads.
    """

    curves: CurveTable
    elevation: CubicTable
    superelevation: CubicTable
    crossfall_left: CubicTable
    crossfall_right: CubicTable
    shapes: ShapeTable
    lanes: LaneTable
    roads: RoadTable

    @classmethod
    def collect(cls, roads: Sequence[Road]) -> "NetworkGeometry":
        """Collect the geometry of `roads`."""
        return cls(
            curves=CurveTable.stack([road.geometries for road in roads]),
            elevation=CubicTable.stack([road.elevation for road in roads]),
            superelevation=CubicTable.stack([road.superelevation for road in roads]),
            crossfall_left=CubicTable.stack([road.crossfall_left for road in roads]),
            crossfall_right=CubicTable.stack([road.crossfall_right for road in roads]),
            shapes=ShapeTable.stack([road.shape for road in roads]),
            lanes=LaneTable.collect(roads),
            roads=RoadTable.collect(roads),
        )

    @property
    def length_m(self) -> FloatArray:
        """(R,) lengths of the roads."""
        return self.roads.length_m

    @cached_property
    def is_banked(self) -> bool:
        """Whether any road has superelevation."""
        return bool(self.banked_roads.any())

    @cached_property
    def banked_roads(self) -> BoolArray:
        """(R,) the roads that have superelevation."""
        owner = np.repeat(np.arange(len(self.length_m)), np.diff(self.superelevation.first))
        banked = np.zeros(len(self.length_m), dtype=np.bool_)
        banked[owner[self.superelevation.coefficients.any(axis=1)]] = True
        return banked

    @cached_property
    def greatest_shear(self) -> FloatArray:
        """(R,) bound of how far banking moves the surface along a road that climbs, per metre of t."""
        roll = self.superelevation.greatest(self.length_m)
        grade = self.elevation.greatest(self.length_m, slope=True)
        return np.where(self.banked_roads, np.minimum(roll, 1.0) * np.minimum(grade, 1.0), 0.0)

    @cached_property
    def parts(self) -> RoadParts:
        """Parts of roads on which the reference line is one piece and every lane border one cubic."""
        return RoadParts.cut(self.curves, self.lanes.borders)

    @cached_property
    def plain_lanes(self) -> BoolArray:
        """(L,) the lanes whose height is the reference line's: no banking, crossfall, shape, lane height."""
        odd_roads = self.banked_roads | (np.diff(self.shapes.first) > 0)
        for slopes in (self.crossfall_left, self.crossfall_right):
            odd_roads = odd_roads | (np.diff(slopes.first) > 0)
        lanes = self.lanes
        return ~(odd_roads[lanes.road] | lanes.level | (np.diff(lanes.inner_height.first) > 0))

    @cached_property
    def _has_crossfall(self) -> bool:
        return bool(self.crossfall_left.coefficients.any() or self.crossfall_right.coefficients.any())

    @cached_property
    def _level_base(self) -> IntArray | None:
        """(L,) the lane from whose inner border on each is kept level, -1 for none; None if none is."""
        level = self.lanes.level
        if not level.any():
            return None
        base = np.full(len(level), -1, dtype=np.int64)
        for lane in np.flatnonzero(level).tolist():
            continued = self.lanes.rank[lane] > 0 and base[lane - 1] >= 0
            base[lane] = base[lane - 1] if continued else lane
        return base

    def cross_sections(self, road: IntArray, s_m: FloatArray) -> CrossSections:
        """Return what is needed to place points at `s_m` of roads, both (N,)."""
        poses = self.curves.evaluate(road, s_m)
        z, grade = self.elevation.value_and_slope(road, s_m)
        roll = d_roll = z
        if self.is_banked:
            roll, d_roll = self.superelevation.value_and_slope(road, s_m)
        cos, sin = np.cos(poses.heading_rad), np.sin(poses.heading_rad)
        return CrossSections(road, s_m, *poses, cos, sin, z, grade, roll, d_roll)

    def place(self, sections: CrossSections, t_m: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return x, y and z of the surface at `t_m` (N,) of cross sections.

        The t axis is the reference line's normal, rolled by the superelevation about the reference line with
        its grade (chapter "Roads"). Crossfall lowers the surface on both sides; the lateral shape raises it
        along the rolled normal of a banked road, and upwards elsewhere.
        """
        x, y, across, z = sections.x_m, sections.y_m, t_m, sections.z_m
        if self.shapes:
            height = self.shapes.height(sections.road, sections.s_m, t_m)
            z = z + np.where(self.banked_roads[sections.road], 0.0, height)
        if self.is_banked:
            sin_roll, cos_roll = np.sin(sections.roll_rad), np.cos(sections.roll_rad)
            steep = np.hypot(1.0, sections.grade)
            raised = self._raised(sections.road, sections.s_m, t_m)
            across, up = t_m * cos_roll - raised * sin_roll, t_m * sin_roll + raised * cos_roll
            along = -up * sections.grade / steep
            x, y, z = x + sections.cos * along, y + sections.sin * along, z + up / steep
        if self._has_crossfall:
            left = self.crossfall_left.value(sections.road, sections.s_m)
            right = self.crossfall_right.value(sections.road, sections.s_m)
            z = z - np.abs(t_m) * np.tan(np.where(t_m > 0.0, left, right))
        return x - sections.sin * across, y + sections.cos * across, z + np.zeros_like(t_m)

    def _raised(self, road: IntArray, s_m: FloatArray, t_m: FloatArray) -> FloatArray:
        """Return by how much the lateral shape of banked roads moves points along the rolled normal."""
        if not self.shapes:
            return np.zeros_like(t_m)
        return np.where(self.banked_roads[road], self.shapes.height(road, s_m, t_m), 0.0)

    @cached_property
    def greatest_raise(self) -> FloatArray:
        """(R,) bound of how far the lateral shape moves points of banked roads."""
        if not self.shapes:
            return np.zeros(len(self.length_m))
        low, high = self.lanes.borders.extremes()
        reach_m = np.maximum(np.abs(low), np.abs(high)).max(initial=0.0)
        return np.where(self.banked_roads, self.shapes.greatest_heights(reach_m), 0.0)

    def surface(
        self, road: IntArray, s_m: FloatArray, t_m: FloatArray, slope: FloatArray | float = 0.0
    ) -> SurfacePoints:
        """Return points of the road surface; see `place`.

        Args:
            road: (N,) road indices.
            s_m: (N,) along the road.
            t_m: (N,) across it, positive to the left.
            slope: dt/ds of the line whose heading is wanted, (N,) or 0 for lines parallel to the road.
        """
        return self._oriented(self.cross_sections(road, s_m), t_m, slope)

    def lane_surface(
        self, lane: IntArray, s_m: FloatArray, t_m: FloatArray, slope: FloatArray | float = 0.0
    ) -> SurfacePoints:
        """Return points of lanes, with the heights of the lanes; see `surface` and `lift`."""
        sections = self.cross_sections(self.lanes.road[lane], s_m)
        points = self._oriented(sections, t_m, slope)
        return points._replace(z_m=self.lift(lane, sections, t_m, points.z_m))

    def _oriented(self, sections: CrossSections, t_m: FloatArray, slope: FloatArray | float) -> SurfacePoints:
        x, y, z = self.place(sections, t_m)
        across, d_across = t_m, slope + np.zeros_like(t_m)
        if self.is_banked:
            cos_roll, sin_roll = np.cos(sections.roll_rad), np.sin(sections.roll_rad)
            raised, d_raised = np.zeros_like(t_m), np.zeros_like(t_m)
            if self.shapes:
                step, shift = _SLOPE_STEP_M, _SLOPE_STEP_M * d_across
                road, s_m = sections.road, sections.s_m
                raised = self._raised(road, s_m, t_m)
                d_raised = self._raised(road, s_m + step, t_m + shift)
                d_raised = (d_raised - self._raised(road, s_m - step, t_m - shift)) / (2.0 * step)
            across = t_m * cos_roll - raised * sin_roll
            d_across = (d_across - raised * sections.d_roll) * cos_roll
            d_across = d_across - (t_m * sections.d_roll + d_raised) * sin_roll
        turn = np.arctan2(d_across, 1.0 - sections.curvature_per_m * across)
        return SurfacePoints(x, y, z, wrapped(sections.heading_rad + turn))

    def lift(self, lane: IntArray, sections: CrossSections, t_m: FloatArray, z_m: FloatArray) -> FloatArray:
        """Return the heights of points of lanes, given those of the road surface there, all (N,).

        A lane that is kept level has the height of the inner border of the innermost level lane; the heights
        of a lane's borders are added, linearly between them and between their records (chapter "Lanes").
        """
        if self._level_base is not None:
            some = np.flatnonzero(self._level_base[lane] >= 0)
            edge = self.lanes.offsets_and_slopes(self._level_base[lane[some]], sections.s_m[some])[0]
            z_m = z_m.copy()
            z_m[some] = self.place(sections.take(some), edge)[2]
        lanes = self.lanes
        if len(lanes.inner_height.start_m):
            inner, outer = (t.value(lane, sections.s_m) for t in (lanes.inner_height, lanes.outer_height))
            t_inner, t_outer, _, _ = self.lanes.offsets_and_slopes(lane, sections.s_m)
            width = t_outer - t_inner
            share = np.divide(t_m - t_inner, width, out=np.zeros_like(width), where=width != 0.0)
            z_m = z_m + inner + share * (outer - inner)
        return z_m

    def project(
        self, road: IntArray, xy_m: FloatArray, s_m: FloatArray, low_m: FloatArray, high_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Find the foot of points on reference lines, from a first guess and within bounds.

        Each step goes to the foot on the circle that osculates the reference line: one step is exact on lines
        and arcs, even for points near the centre of the arc, and convergence is quadratic elsewhere.

        Args:
            road: (N,) road indices.
            xy_m: (N, 2) points, map frame.
            s_m: (N,) first guess.
            low_m: (N,) least s allowed.
            high_m: (N,) greatest s allowed.

        Returns:
            s (N,), t (N,) and the distance (N,) along the road that is left uncovered: 0 but where a bound
            was met.
        """
        s_m = np.clip(s_m, low_m, high_m)
        t_m = np.zeros_like(s_m)
        left_over = np.zeros_like(s_m)
        active = np.arange(len(s_m))
        for _ in range(_FOOT_STEPS):
            along, t, curvature = self._offset(road[active], xy_m[active], s_m[active])
            t_m[active], left_over[active] = t, along
            moved = np.clip(s_m[active] + arc_step(along, t, curvature), low_m[active], high_m[active])
            moving = np.abs(moved - s_m[active]) > 1e-11 * np.maximum(1.0, np.abs(moved))
            s_m[active] = moved
            active = active[moving]
            if not active.size:
                break
        return s_m, t_m, left_over

    def in_wedge(self, road: IntArray, xy_m: FloatArray, s_m: FloatArray) -> BoolArray:
        """Return whether points lie in the wedge that a kink of the reference line at `s_m` leaves uncovered.

        Such a point is past the end of the piece before the kink and short of the start of the piece after
        it: it has no exact foot, and the kink stands in for it.
        """
        before, after = s_m - _KINK_STEP_M, s_m + _KINK_STEP_M
        past, short = self._offset(road, xy_m, before)[0], self._offset(road, xy_m, after)[0]
        within_road = (before > 0.0) & (after < self.length_m[road])
        wedge: BoolArray = within_road & (past >= 0.0) & (short <= 0.0)
        return wedge

    def _offset(
        self, road: IntArray, xy_m: FloatArray, s_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Return how far points lie ahead of and left of the reference line at `s_m`, and its curvature."""
        poses = self.curves.evaluate(road, s_m)
        dx, dy = xy_m[:, 0] - poses.x_m, xy_m[:, 1] - poses.y_m
        cos, sin = np.cos(poses.heading_rad), np.sin(poses.heading_rad)
        along, across = cos * dx + sin * dy, cos * dy - sin * dx
        if self.is_banked:
            roll = self.superelevation.value(road, s_m)
            grade = self.elevation.value_and_slope(road, s_m)[1]
            sin_roll, cos_roll = np.sin(roll), np.maximum(np.cos(roll), 1e-3)
            plan, across = across, across / cos_roll
            raised = np.zeros_like(across)
            for _ in range(_SHAPE_STEPS if self.shapes else 0):
                raised = self._raised(road, s_m, across)
                across = (plan + raised * sin_roll) / cos_roll
            along = along + (across * sin_roll + raised * cos_roll) * grade / np.hypot(1.0, grade)
        return along, across, poses.curvature_per_m

    def border_points(
        self, lane: IntArray, s_m: FloatArray, margins_m: FloatArray | None = None
    ) -> FloatArray:
        """Return the inner and the outer border as (2, N, 2) points, moved outwards by `margins_m` (2,)."""
        t_inner, t_outer, _, _ = self.lanes.offsets_and_slopes(lane, s_m)
        if margins_m is not None:
            side = self.lanes.side[lane]
            t_inner, t_outer = t_inner - side * margins_m[0], t_outer + side * margins_m[1]
        road = self.lanes.road[lane]
        points = self.surface(np.tile(road, 2), np.tile(s_m, 2), np.concatenate([t_inner, t_outer]))
        return np.stack([points.x_m, points.y_m], axis=-1).reshape(2, -1, 2)

    def knots(self, lane: IntArray) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return the stretches of lanes between the records that shape them: lane, start and end."""
        borders, parts = self.lanes.borders, self.parts
        first = np.searchsorted(parts.stretch, borders.first_stretch[lane], side="left")
        count = np.searchsorted(parts.stretch, borders.last_stretch[lane], side="right") - first
        part = concatenated_ranges(first, count)
        return np.repeat(lane, count), parts.low_m[part], parts.high_m[part]

    @cached_property
    def _chords(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return first chord of each road (R + 1,), and the s (C,) and xy (C, 2) of the chords' ends."""
        roads: list[FloatArray] = []
        curves = self.curves
        greatest = np.abs(curves.curvature_per_m) + np.abs(curves.rate_per_m2) * curves.length_m
        cubic = np.flatnonzero(curves.kind == CUBIC)
        inside_m = curves.start_m[cubic] + _CUBIC_SAMPLES[:, None] * curves.length_m[cubic]
        many = np.broadcast_to(cubic, inside_m.shape)
        bends = curves.evaluate_pieces(many.ravel(), inside_m.ravel()).curvature_per_m.reshape(inside_m.shape)
        bends = np.abs(bends).max(axis=0, initial=0.0)
        greatest[cubic] = np.minimum(_CUBIC_MARGIN * bends, _GREATEST_BEND_PER_M)
        for r, length in enumerate(self.length_m.tolist()):
            pieces = slice(self.curves.first[r], self.curves.first[r + 1])
            starts = self.curves.start_m[pieces]
            ends = np.append(starts[1:], max(length, starts[-1]))
            span = ends - starts
            count = np.clip(np.ceil(span * greatest[pieces] / _CHORD_RAD), 1, 10_000).astype(np.int64)
            s = [
                low + (high - low) * np.arange(n) / n
                for low, high, n in zip(starts, ends, count, strict=True)
            ]
            roads.append(np.append(np.concatenate(s), ends[-1]))
        size = np.array([len(s) for s in roads], dtype=np.int64)
        s_m = np.concatenate(roads)
        poses = self.curves.evaluate(np.repeat(np.arange(len(roads)), size), s_m)
        return first_rows(size), s_m, np.stack([poses.x_m, poses.y_m], axis=-1)

    def nearest_on_road(self, road: int, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return s and t of the nearest point of one road's reference line, for points (N, 2)."""
        first, s_all, knots_all = self._chords
        part = slice(first[road], first[road + 1])
        s, knots = s_all[part], knots_all[part]
        step = np.diff(knots, axis=0)
        squared = np.maximum((step**2).sum(axis=1), 1e-18)
        best = self._nearest_chords(road, xy_m, knots, step, squared)
        along = ((xy_m - knots[best]) * step[best]).sum(axis=1)
        share = np.clip(along / squared[best], 0.0, 1.0)
        guess = s[best] + share * (s[best + 1] - s[best])
        low, high = s[np.maximum(best - 1, 0)], s[np.minimum(best + 2, len(s) - 1)]
        roads = np.full(len(xy_m), road)
        s_m, t_m, left_over = self.project(roads, xy_m, guess, low, high)
        # Off a kink there is no foot, and the steps lead to and fro, or to one that is farther away.
        off_chord = (s_m < s[best]) | (s_m > s[best + 1])
        some = np.flatnonzero(off_chord | (np.abs(left_over) > _FOOT_M))
        if some.size:
            along, across, _ = self._offset(roads[some], xy_m[some], guess[some])
            nearer = np.hypot(along, across) < np.hypot(left_over[some], t_m[some])
            s_m[some[nearer]], t_m[some[nearer]] = guess[some[nearer]], across[nearer]
        return s_m, t_m

    def _nearest_chords(
        self, road: int, xy_m: FloatArray, knots: FloatArray, step: FloatArray, squared: FloatArray
    ) -> IntArray:
        """Return the nearest chord of a road for each point, the first of equals; see `_chords`.

        Args:
            road: road index.
            xy_m: (N, 2) points, map frame.
            knots: (K + 1, 2) ends of the road's chords.
            step: (K, 2) the chords.
            squared: (K,) squares of their lengths.
        """
        if len(step) > _MANY_CHORDS and len(xy_m):
            tree = self._chord_trees.get(road)
            if tree is None:
                chords = shapely.linestrings(np.stack([knots[:-1], knots[1:]], axis=1))
                tree = self._chord_trees[road] = shapely.STRtree(np.asarray(chords))
            point, chord = tree.query_nearest(shapely.points(xy_m))
            nearest: IntArray = np.minimum.reduceat(chord, run_starts(point))
            return nearest
        best = np.empty(len(xy_m), dtype=np.int64)
        # Blocks bound the memory: each point is compared with every chord of the road.
        block = max(1, 2_000_000 // len(knots))
        for start in range(0, len(xy_m), block):
            offset = xy_m[start : start + block, None, :] - knots[:-1]
            fraction = np.clip((offset * step).sum(axis=2) / squared, 0.0, 1.0)
            distance = ((offset - fraction[..., None] * step) ** 2).sum(axis=2)
            best[start : start + block] = distance.argmin(axis=1)
        return best

    @cached_property
    def _chord_trees(self) -> dict[int, shapely.STRtree]:
        """Trees over the chords of roads, made when asked for."""
        return {}
