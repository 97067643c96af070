"""From (s, t) to the map frame and back, for roads and lanes."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from opendrive.arrays import BoolArray, FloatArray, IntArray, finite, points_xy, wrapped
from opendrive.curves import CurveTable, Poses
from opendrive.errors import PositionError
from opendrive.lanes import LaneTable
from opendrive.model import Road
from opendrive.profiles import CubicTable

S_TOLERANCE_M = 1e-3
"""A position this far off the end of a road or lane is moved onto it; further off is an error."""

_FOOT_STEPS = 30
_KINK_STEP_M = 1e-7

_SHARE = 0.9
"""Part of a tolerance that the probes may use up; the border may depart a little more between them."""

_PROBES = np.array([0.0, (3.0 - np.sqrt(3.0)) / 6.0, 0.5, (3.0 + np.sqrt(3.0)) / 6.0, 1.0])
"""Where a cubic departs most from its chord; irrational, so that no number of whole turns is overlooked."""


class SurfacePoints(NamedTuple):
    """Points on road surfaces, map frame; arrays of one shape.

    `heading_rad` is the direction of increasing s, wrapped to (-pi, pi].
    """

    x_m: FloatArray
    y_m: FloatArray
    z_m: FloatArray
    heading_rad: FloatArray


@dataclass(frozen=True, eq=False)
class NetworkGeometry:
    """Geometry of all roads and lanes, evaluated on arrays.

    Attributes:
        curves: reference lines.
        elevation: height; profile r belongs to road r.
        superelevation: roll about the reference line, rad.
        crossfall_left: slope left of the reference line, rad.
        crossfall_right: slope right of it, rad.
        lanes: all lanes.
        length_m: (R,) lengths of the roads.
    """

    curves: CurveTable
    elevation: CubicTable
    superelevation: CubicTable
    crossfall_left: CubicTable
    crossfall_right: CubicTable
    lanes: LaneTable
    length_m: FloatArray

    @classmethod
    def collect(cls, roads: Sequence[Road]) -> "NetworkGeometry":
        """Collect the geometry of `roads`."""
        return cls(
            curves=CurveTable.stack([road.geometries for road in roads]),
            elevation=CubicTable.stack([road.elevation for road in roads]),
            superelevation=CubicTable.stack([road.superelevation for road in roads]),
            crossfall_left=CubicTable.stack([road.crossfall_left for road in roads]),
            crossfall_right=CubicTable.stack([road.crossfall_right for road in roads]),
            lanes=LaneTable.collect(roads),
            length_m=np.array([road.length_m for road in roads]),
        )

    @cached_property
    def _is_banked(self) -> bool:
        return bool(self.superelevation.coefficients.any())

    @cached_property
    def _has_crossfall(self) -> bool:
        return bool(self.crossfall_left.coefficients.any() or self.crossfall_right.coefficients.any())

    def surface(
        self, road: IntArray, s_m: FloatArray, t_m: FloatArray, slope: FloatArray | float = 0.0
    ) -> SurfacePoints:
        """Return points of the road surface.

        The t axis is the reference line's normal, rolled by the superelevation about the reference line with
        its grade (chapter "Roads"). Crossfall lowers the surface on both sides.

        Args:
            road: (N,) road indices.
            s_m: (N,) along the road.
            t_m: (N,) across it, positive to the left.
            slope: dt/ds of the line whose heading is wanted, (N,) or 0 for lines parallel to the road.
        """
        poses = self.curves.evaluate(road, s_m)
        z, grade = self.elevation.value_and_slope(road, s_m)
        along, across, d_across = np.zeros_like(t_m), t_m, slope + np.zeros_like(t_m)
        if self._is_banked:
            roll, d_roll = self.superelevation.value_and_slope(road, s_m)
            along = -t_m * np.sin(roll) * grade / np.hypot(1.0, grade)
            across = t_m * np.cos(roll)
            d_across = d_across * np.cos(roll) - t_m * np.sin(roll) * d_roll
            z = z + t_m * np.sin(roll) / np.hypot(1.0, grade)
        if self._has_crossfall:
            left, right = self.crossfall_left.value(road, s_m), self.crossfall_right.value(road, s_m)
            z = z - np.abs(t_m) * np.tan(np.where(t_m > 0.0, left, right))
        cos, sin = np.cos(poses.heading_rad), np.sin(poses.heading_rad)
        turn = np.arctan2(d_across, 1.0 - poses.curvature_per_m * across)
        return SurfacePoints(
            x_m=poses.x_m + cos * along - sin * across,
            y_m=poses.y_m + sin * along + cos * across,
            z_m=z,
            heading_rad=wrapped(poses.heading_rad + turn),
        )

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
            moved = np.clip(s_m[active] + _step(along, t, curvature), low_m[active], high_m[active])
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
        if self._is_banked:
            roll = self.superelevation.value(road, s_m)
            grade = self.elevation.value_and_slope(road, s_m)[1]
            across = across / np.maximum(np.cos(roll), 1e-3)
            along = along + across * np.sin(roll) * grade / np.hypot(1.0, grade)
        return along, across, poses.curvature_per_m

    def refine(
        self, lane: IntArray, low_m: FloatArray, high_m: FloatArray, margins_m: FloatArray, tolerance_m: float
    ) -> tuple[IntArray, FloatArray, FloatArray]:
        """Split stretches of lanes until straight chords follow both borders within `tolerance_m`.

        Args:
            lane: (N,) lane indices.
            low_m: (N,) start of each stretch.
            high_m: (N,) end of each stretch.
            margins_m: (2,) by how much the inner and outer border are moved outwards.
            tolerance_m: greatest distance between border and chord.

        Returns:
            lane, start and end of the finer stretches, ordered by lane and start.
        """
        done: list[tuple[IntArray, FloatArray, FloatArray]] = []
        for _ in range(24):
            if not lane.size:
                break
            fractions = _PROBES[:, None]
            s = low_m + fractions * (high_m - low_m)
            xy = self.border_points(np.broadcast_to(lane, s.shape).ravel(), s.ravel(), margins_m)
            xy = xy.reshape(2, 5, lane.size, 2)
            chord = xy[:, :1] + fractions[:, :, None] * (xy[:, -1:] - xy[:, :1])
            rough = (np.hypot(*np.moveaxis(xy - chord, -1, 0)) > _SHARE * tolerance_m).any(axis=(0, 1))
            rough &= high_m - low_m > 0.01
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
        lanes = self.lanes
        stretches: list[FloatArray] = []
        for i in lane.tolist():
            road, start, end = int(lanes.road[i]), lanes.s_start_m[i], lanes.s_end_m[i]
            inside = np.concatenate(
                [self.curves.starts_of(road), lanes.lane_offset.starts_of(road), lanes.profiles.starts_of(i)]
            )
            inside = inside[(inside > start + 1e-6) & (inside < end - 1e-6)]
            stretches.append(np.concatenate([[start], np.unique(inside), [end]]))
        count = np.array([len(s) - 1 for s in stretches], dtype=np.int64)
        low = np.concatenate([np.empty(0), *(s[:-1] for s in stretches)])
        high = np.concatenate([np.empty(0), *(s[1:] for s in stretches)])
        return np.repeat(lane, count), low, high

    @cached_property
    def _chords(self) -> tuple[IntArray, FloatArray, FloatArray]:
        """Return first chord of each road (R + 1,), and the s (C,) and xy (C, 2) of the chords' ends."""
        roads: list[FloatArray] = []
        for r, length in enumerate(self.length_m.tolist()):
            starts = self.curves.starts_of(r)
            ends = np.append(starts[1:], max(length, starts[-1]))
            pieces = slice(self.curves.first[r], self.curves.first[r + 1])
            span = ends - starts
            bend = (
                np.abs(self.curves.curvature_per_m[pieces]) + np.abs(self.curves.rate_per_m2[pieces]) * span
            )
            bend[self.curves.kind[pieces] == 2] = 0.1
            count = np.clip(np.ceil(span * bend / 0.2), 1, 10_000).astype(np.int64)
            s = [
                low + (high - low) * np.arange(n) / n
                for low, high, n in zip(starts, ends, count, strict=True)
            ]
            roads.append(np.append(np.concatenate(s), ends[-1]))
        size = np.array([len(s) for s in roads], dtype=np.int64)
        s_m = np.concatenate(roads)
        poses = self.curves.evaluate(np.repeat(np.arange(len(roads)), size), s_m)
        first = np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(size)])
        return first, s_m, np.stack([poses.x_m, poses.y_m], axis=-1)

    def nearest_on_road(self, road: int, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return s and t of the nearest point of one road's reference line, for points (N, 2)."""
        first, s_all, knots_all = self._chords
        part = slice(first[road], first[road + 1])
        s, knots = s_all[part], knots_all[part]
        step = np.diff(knots, axis=0)
        squared = np.maximum((step**2).sum(axis=1), 1e-18)
        guess, low, high = (np.empty(len(xy_m)) for _ in range(3))
        # Blocks bound the memory: each point is compared with every chord of the road.
        block = max(1, 2_000_000 // len(s))
        for start in range(0, len(xy_m), block):
            offset = xy_m[start : start + block, None, :] - knots[:-1]
            fraction = np.clip((offset * step).sum(axis=2) / squared, 0.0, 1.0)
            distance = ((offset - fraction[..., None] * step) ** 2).sum(axis=2)
            best = distance.argmin(axis=1)
            share = fraction[np.arange(len(best)), best]
            rows = slice(start, start + block)
            guess[rows] = s[best] + share * (s[best + 1] - s[best])
            low[rows] = s[np.maximum(best - 1, 0)]
            high[rows] = s[np.minimum(best + 2, len(s) - 1)]
        s_m, t_m, _ = self.project(np.full(len(xy_m), road), xy_m, guess, low, high)
        return s_m, t_m


@dataclass(frozen=True, slots=True, eq=False)
class RoadGeometry:
    """Geometry of one road.

    Attributes:
        record: the road as read.
        index: its index in the network.
        geometry: geometry of the network.
    """

    record: Road
    index: int
    geometry: NetworkGeometry

    @property
    def id(self) -> str:
        """Id of the road."""
        return self.record.id

    @property
    def length_m(self) -> float:
        """Length of the reference line."""
        return self.record.length_m

    def reference_line(self, s_m: ArrayLike) -> Poses:
        """Return poses and curvature of the reference line at `s_m`, of any shape.

        Raises:
            PositionError: s is not finite or off the road.
        """
        s = self._on_road(s_m)
        road = np.full(s.size, self.index)
        return Poses(*(column.reshape(s.shape) for column in self.geometry.curves.evaluate(road, s.ravel())))

    def point(self, s_m: ArrayLike, t_m: ArrayLike) -> SurfacePoints:
        """Return points of the surface at (s, t), broadcast against each other.

        Raises:
            PositionError: s or t is not finite, or s is off the road.
        """
        s, t = np.broadcast_arrays(self._on_road(s_m), finite(t_m, "t_m"))
        road = np.full(s.size, self.index)
        return SurfacePoints(
            *(column.reshape(s.shape) for column in self.geometry.surface(road, s.ravel(), t.ravel()))
        )

    def coordinates(self, xy_m: ArrayLike) -> tuple[FloatArray, FloatArray]:
        """Return (s, t) of points (N, 2), each at the nearest point of the reference line.

        Beyond an end of the road s is held there and t is the lateral part of the offset.

        Raises:
            PositionError: the shape is not (N, 2), or a value is not finite.
        """
        return self.geometry.nearest_on_road(self.index, points_xy(xy_m))

    def _on_road(self, s_m: ArrayLike) -> FloatArray:
        s = finite(s_m, "s_m")
        return within(s, 0.0, self.length_m, f"road {self.id!r}")


def _step(along: FloatArray, t_m: FloatArray, curvature: FloatArray) -> FloatArray:
    """Return the arc length from the current foot to the foot on the osculating circle."""
    bent = np.abs(curvature) > 1e-9
    safe = np.where(bent, curvature, 1.0)
    step: FloatArray = np.where(bent, np.arctan2(safe * along, 1.0 - safe * t_m) / safe, along)
    return step


def within(s_m: FloatArray, low_m: float, high_m: float, where: str) -> FloatArray:
    """Return `s_m` moved onto [low, high] if it is off by at most `S_TOLERANCE_M`.

    Raises:
        PositionError: s is further off.
    """
    if s_m.size and (s_m.min() < low_m - S_TOLERANCE_M or s_m.max() > high_m + S_TOLERANCE_M):
        raise PositionError(
            f"{where}: s from {s_m.min():.6g} to {s_m.max():.6g} m, "
            f"expected within [{low_m:.6g}, {high_m:.6g}] m"
        )
    return np.clip(s_m, low_m, high_m)
