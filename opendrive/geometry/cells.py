"""Short pieces of road, each with a box around it, and the foot of points on them.

A cell is a part of a road on which the reference line is one piece of small turn and every lane border one
cubic. Points are projected in the cell's own frame, all cells and all kinds of curve in one operation.
"""

from dataclasses import dataclass

import numpy as np

from opendrive.arrays import FloatArray, IntArray, concatenated_ranges, until_next
from opendrive.geometry.borders import BorderTable
from opendrive.geometry.cubic import control_values, restarted, slope_of, value_of
from opendrive.geometry.curves import CLOTHOID, CUBIC, CurveTable, circular
from opendrive.geometry.profiles import sort_keys

MAX_TURN_RAD = 0.25
"""Greatest turn of a cell: a foot is unique, boxes are tight and five nodes integrate a clothoid exactly."""

MAX_LENGTH_M = 30.0
"""Greatest length of a cell, so that boxes of diagonal roads, parallel to the axes, stay small."""

_CUBIC_LENGTH_M = 5.0
_MAX_CELLS = 2_000_000
_BOX_M = 1e-3
"""By how much boxes are wider than need be, so that rounding leaves no point outside."""

NEWTON_STEPS = 30
"""Convergence is quadratic; it slows down only near the centre of curvature."""

_CONVERGED_M = 1e-11
"""Rounding of a coordinate of 100 km in float64."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(5)
_UNIT_NODES, _UNIT_WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_FINE_NODES, _FINE_WEIGHTS = np.polynomial.legendre.leggauss(12)
_FINE_NODES, _FINE_WEIGHTS = 0.5 * (_FINE_NODES + 1.0), 0.5 * _FINE_WEIGHTS


@dataclass(frozen=True, slots=True, eq=False)
class RoadParts:
    """Parts of roads on which the reference line is one piece and every lane border one cubic.

    Attributes:
        stretch: (P,) stretch of the border table, ascending.
        piece: (P,) piece of the reference line.
        low_m: (P,) road s where it starts.
        high_m: (P,) road s where it ends.
    """

    stretch: IntArray
    piece: IntArray
    low_m: FloatArray
    high_m: FloatArray

    @classmethod
    def cut(cls, curves: CurveTable, borders: BorderTable) -> "RoadParts":
        """Cut the stretches of lane borders where pieces of the reference line start."""
        every = np.arange(len(borders.low_m), dtype=np.int64)
        beside = np.searchsorted(borders.key, curves.key, side="right") - 1
        cut = np.flatnonzero(beside >= 0)
        at = beside[cut]
        inside = (borders.road[at] == curves.road[cut]) & (curves.start_m[cut] > borders.low_m[at])
        inside &= curves.start_m[cut] < borders.high_m[at]
        stretch = np.concatenate([every, at[inside]])
        low_m = np.concatenate([borders.low_m, curves.start_m[cut[inside]]])
        order = np.lexsort((low_m, stretch))
        stretch, low_m = stretch[order], low_m[order]
        high_m = until_next(stretch, low_m, borders.high_m[stretch])
        road = borders.road[stretch]
        piece = np.searchsorted(curves.key, sort_keys(road, low_m), side="right") - 1
        return cls(stretch, np.maximum(piece, curves.first[road]), low_m, high_m)


@dataclass(frozen=True, slots=True, eq=False)
class RoadCells:
    """Cells of all roads, by road and s.

    Attributes:
        stretch: (C,) stretch of the border table.
        road: (C,) road index.
        low_m: (C,) road s where the cell starts.
        high_m: (C,) road s where it ends.
        start: (C, 6) x, y, cos and sin of the heading, curvature and its change per metre at the start.
        bent: (C,) 0 for lines, 1 for arcs, 2 for clothoids, 3 for cubics.
        cubic: (C,) row in `xy_of_r`; 0 for the others.
        xy_of_r: (H, 2, 4) cubic cells as x(r), y(r) with r in [0, 1], in the frame of the cell's start.
        frame: (C, 4) x, y, cos and sin of the heading at the middle: the box's frame.
        half_length_m: (C,) half of the length of the reference line's box.
        sagitta_m: (C,) how far the reference line may lie beside the box's axis.
        turn_rad: (C,) how far its heading may differ from the box's.
        open_m: (C, 2) how far the road may turn, per metre of t, and jump at the cell's start and end.
    """

    stretch: IntArray
    road: IntArray
    low_m: FloatArray
    high_m: FloatArray
    start: FloatArray
    bent: IntArray
    cubic: IntArray
    xy_of_r: FloatArray
    frame: FloatArray
    half_length_m: FloatArray
    sagitta_m: FloatArray
    turn_rad: FloatArray
    open_m: FloatArray

    @classmethod
    def cut(cls, curves: CurveTable, parts: RoadParts) -> "RoadCells":
        """Cut parts of roads until each turns little."""
        part, low_m, high_m = _short(curves, parts)
        piece = parts.piece[part]
        road = curves.road[piece]
        length_m = high_m - low_m
        start, middle = (
            curves.evaluate_pieces(piece, low_m),
            curves.evaluate_pieces(piece, low_m + 0.5 * length_m),
        )
        rate = curves.rate_per_m2[piece]
        kind = curves.kind[piece]
        bent = np.select([kind == CUBIC, kind == CLOTHOID, start.curvature_per_m != 0.0], [3, 2, 1], 0)
        turn_rad = 0.5 * length_m * (np.abs(start.curvature_per_m) + np.abs(rate) * length_m)
        half_length_m, sagitta_m = 0.5 * length_m, 0.25 * length_m * turn_rad
        is_cubic = np.flatnonzero(bent == 3)
        cubic = np.zeros(len(piece), dtype=np.int64)
        cubic[is_cubic] = np.arange(is_cubic.size)
        xy_of_r = _cubic_cells(curves, piece[is_cubic], low_m[is_cubic], high_m[is_cubic])
        half_length_m[is_cubic], sagitta_m[is_cubic], turn_rad[is_cubic] = _cubic_bounds(
            xy_of_r,
            np.stack([start.x_m, start.y_m, start.heading_rad])[:, is_cubic],
            np.stack([middle.x_m, middle.y_m, middle.heading_rad])[:, is_cubic],
        )
        ends = curves.evaluate_pieces(piece, high_m)
        kink_rad = np.abs(np.sin(0.5 * (start.heading_rad[1:] - ends.heading_rad[:-1]))) * 2.0
        jump_m = np.hypot(start.x_m[1:] - ends.x_m[:-1], start.y_m[1:] - ends.y_m[:-1])
        joined = (road[1:] == road[:-1])[:, None]
        joint = np.where(joined, np.stack([kink_rad, jump_m], axis=1), 0.0)
        nothing = np.zeros((min(1, len(piece)), 2))
        open_m = np.stack([np.concatenate([nothing, joint]), np.concatenate([joint, nothing])], axis=1)
        return cls(
            stretch=parts.stretch[part],
            road=road,
            low_m=low_m,
            high_m=high_m,
            start=np.stack(
                [
                    start.x_m,
                    start.y_m,
                    np.cos(start.heading_rad),
                    np.sin(start.heading_rad),
                    start.curvature_per_m,
                    rate,
                ],
                axis=1,
            ),
            bent=bent,
            cubic=cubic,
            xy_of_r=xy_of_r,
            frame=np.stack(
                [middle.x_m, middle.y_m, np.cos(middle.heading_rad), np.sin(middle.heading_rad)], axis=1
            ),
            half_length_m=half_length_m,
            sagitta_m=sagitta_m,
            turn_rad=turn_rad,
            open_m=open_m,
        )

    def overhang(self, t_low_m: FloatArray, t_high_m: FloatArray) -> FloatArray:
        """Return how far (C, 2) a kink or gap at a cell's start and end may leave points uncovered.

        Args:
            t_low_m: (C,) least t of the surface.
            t_high_m: (C,) greatest t of it.
        """
        reach = np.maximum(np.abs(t_low_m), np.abs(t_high_m))
        overhang: FloatArray = self.open_m[:, :, 0] * reach[:, None] + self.open_m[:, :, 1]
        return overhang

    def boxes(
        self, cell: IntArray, t_low_m: FloatArray, t_high_m: FloatArray, slack_m: FloatArray
    ) -> FloatArray:
        """Return boxes around the surface between two t, in the frames of cells.

        Args:
            cell: (K,) cells.
            t_low_m: (K,) least t of the surface.
            t_high_m: (K,) greatest t of it.
            slack_m: (K,) by how much the surface may be moved along the road, as banking does.

        Returns:
            (K, 4) least and greatest u, least and greatest v.
        """
        reach = np.maximum(np.abs(t_low_m), np.abs(t_high_m))
        turn = self.turn_rad[cell]
        along = self.half_length_m[cell] + slack_m + reach * np.sin(np.minimum(turn, 0.5 * np.pi)) + _BOX_M
        before, after = (self.open_m[cell, :, 0] * reach[:, None] + self.open_m[cell, :, 1]).T
        aside = self.sagitta_m[cell] + reach * (1.0 - np.cos(np.minimum(turn, np.pi))) + _BOX_M
        return np.stack([-along - before, along + after, t_low_m - aside, t_high_m + aside], axis=1)

    def project(self, xy_m: FloatArray, cell: IntArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """Find the foot of points (K, 2) on the reference lines of cells (K,).

        Returns:
            s (K,), t (K,), and how far along the road the points lie off the foot (K,): 0 but at the cell's
            ends.
        """
        x, y, cos, sin, curvature, rate = self.start[cell].T
        dx, dy = xy_m[:, 0] - x, xy_m[:, 1] - y
        u, v = cos * dx + sin * dy, cos * dy - sin * dx
        low_m = self.low_m[cell]
        length_m = self.high_m[cell] - low_m
        ds = np.clip(u, 0.0, length_m)
        t, left_over = v.copy(), u - ds
        bent = self.bent[cell]
        some = np.flatnonzero((bent == 1) | (bent == 2))
        if some.size:
            ds[some], t[some], left_over[some] = _foot_on_bend(
                u[some], v[some], length_m[some], curvature[some], rate[some]
            )
        some = np.flatnonzero(bent == 3)
        if some.size:
            ds[some], t[some], left_over[some] = _foot_on_cubic(
                u[some], v[some], self.xy_of_r[self.cubic[cell[some]]]
            )
            ds[some] = np.minimum(ds[some], length_m[some])
        return low_m + ds, t, left_over


def arc_step(along: FloatArray, t_m: FloatArray, curvature: FloatArray) -> FloatArray:
    """Return the arc length from a point of a curve to the foot on its osculating circle there.

    Args:
        along: how far ahead of the point of the curve the projected point lies.
        t_m: how far it lies to the left.
        curvature: curvature of the curve, 1/m.
    """
    bent = np.abs(curvature) > 1e-9
    safe = np.where(bent, curvature, 1.0)
    step: FloatArray = np.where(bent, np.arctan2(safe * along, 1.0 - safe * t_m) / safe, along)
    return step


def _foot_on_bend(
    u: FloatArray, v: FloatArray, length_m: FloatArray, curvature: FloatArray, rate: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return foot, t and what is left over on arcs and clothoids that start at the origin along u.

    The step to the osculating circle is exact on arcs; on clothoids it converges quadratically.
    """
    ds = np.clip(arc_step(u, v, curvature), 0.0, length_m)
    t, left_over = np.empty_like(ds), np.empty_like(ds)
    active = np.arange(len(ds))
    for _ in range(NEWTON_STEPS):
        at, k, r = ds[active], curvature[active], rate[active]
        foot_u, foot_v = circular(at, k)
        spiral = np.flatnonzero(r)
        if spiral.size:
            nodes = at[spiral, None] * _UNIT_NODES
            heading = nodes * (k[spiral, None] + 0.5 * r[spiral, None] * nodes)
            foot_u[spiral] = at[spiral] * (np.cos(heading) @ _UNIT_WEIGHTS)
            foot_v[spiral] = at[spiral] * (np.sin(heading) @ _UNIT_WEIGHTS)
        heading = at * (k + 0.5 * r * at)
        cos, sin = np.cos(heading), np.sin(heading)
        du, dv = u[active] - foot_u, v[active] - foot_v
        along, across = cos * du + sin * dv, cos * dv - sin * du
        t[active], left_over[active] = across, along
        if not spiral.size:
            break
        active, at, r = active[spiral], at[spiral], r[spiral]
        moved = np.clip(
            at + arc_step(along[spiral], across[spiral], k[spiral] + r * at), 0.0, length_m[active]
        )
        moving = np.abs(moved - at) > _CONVERGED_M
        ds[active] = moved
        active = active[moving]
        if not active.size:
            break
    return ds, t, left_over


def _foot_on_cubic(
    u: FloatArray, v: FloatArray, xy_of_r: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return foot, t and what is left over on cubics that start at the origin along u."""
    k_u, k_v = xy_of_r[:, 0], xy_of_r[:, 1]
    chord_u, chord_v = k_u.sum(axis=1), k_v.sum(axis=1)
    r = np.clip((u * chord_u + v * chord_v) / np.maximum(chord_u**2 + chord_v**2, 1e-18), 0.0, 1.0)
    t, left_over = v.copy(), u.copy()
    active = np.arange(len(r))
    for _ in range(NEWTON_STEPS):
        at, a, b = r[active], k_u[active], k_v[active]
        u_1, v_1 = slope_of(a, at), slope_of(b, at)
        speed = np.hypot(u_1, v_1)
        usable = speed > 1e-12
        safe = np.where(usable, speed, 1.0)
        cos, sin = np.where(usable, u_1 / safe, 1.0), np.where(usable, v_1 / safe, 0.0)
        du, dv = u[active] - value_of(a, at), v[active] - value_of(b, at)
        along, across = cos * du + sin * dv, cos * dv - sin * du
        t[active], left_over[active] = across, along
        u_2, v_2 = 2.0 * a[:, 2] + 6.0 * a[:, 3] * at, 2.0 * b[:, 2] + 6.0 * b[:, 3] * at
        curvature = np.where(usable, (u_1 * v_2 - v_1 * u_2) / safe**3, 0.0)
        step = np.where(usable, arc_step(along, across, curvature) / safe, 0.0)
        moved = np.clip(at + step, 0.0, 1.0)
        moving = np.abs(moved - at) * safe > _CONVERGED_M
        r[active] = moved
        active = active[moving]
        if not active.size:
            break
    nodes = r[:, None] * _FINE_NODES
    speeds = np.hypot(slope_of(k_u[:, None], nodes), slope_of(k_v[:, None], nodes))
    return r * (speeds @ _FINE_WEIGHTS), t, left_over


def _short(curves: CurveTable, parts: RoadParts) -> tuple[IntArray, FloatArray, FloatArray]:
    """Return part, start and end of cells that are short enough."""
    span = parts.high_m - parts.low_m
    before = np.abs(parts.low_m - curves.start_m[parts.piece])
    rate = np.abs(curves.rate_per_m2[parts.piece])
    bend = np.abs(curves.curvature_per_m[parts.piece]) + rate * (before + span)
    cubic = curves.kind[parts.piece] == CUBIC
    count = np.maximum(span / np.where(cubic, _CUBIC_LENGTH_M, MAX_LENGTH_M), span * bend / MAX_TURN_RAD)
    # Only absurd curvatures meet the limit; their cells turn further and have larger boxes.
    count = np.clip(np.ceil(count), 1, max(1, _MAX_CELLS // max(1, len(count)))).astype(np.int64)
    part = np.repeat(np.arange(len(span), dtype=np.int64), count)
    k = concatenated_ranges(np.zeros(len(count), dtype=np.int64), count)
    step = (span / count)[part]
    low_m = parts.low_m[part] + k * step
    return part, low_m, np.where(k + 1 == count[part], parts.high_m[part], low_m + step)


def _cubic_cells(curves: CurveTable, piece: IntArray, low_m: FloatArray, high_m: FloatArray) -> FloatArray:
    """Return u(r), v(r) of cubic cells (H, 2, 4), in the frame of each cell's start."""
    row, start = curves.cubic[piece], curves.start_m[piece]
    q = curves.cubics.parameter(row, low_m - start)
    dq = curves.cubics.parameter(row, high_m - start) - q
    # over r, with q + r dq in place of q
    powers = np.stack([np.ones_like(dq), dq, dq**2, dq**3], axis=1)
    local = np.stack([restarted(k[row], q) * powers for k in (curves.cubics.u, curves.cubics.v)], axis=1)
    local[:, :, 0] = 0.0
    poses = curves.evaluate_pieces(piece, low_m)
    turn = poses.heading_rad - curves.heading_rad[piece]
    cos, sin = np.cos(turn)[:, None], np.sin(turn)[:, None]
    u, v = local[:, 0], local[:, 1]
    return np.stack([cos * u + sin * v, cos * v - sin * u], axis=1)


def _cubic_bounds(
    xy_of_r: FloatArray, start: FloatArray, middle: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Return half length, sagitta and turn of cubic cells against the frame of their middle.

    A curve lies within the hull of its Bezier control points, and its tangents between the hull's sides.

    Args:
        xy_of_r: (H, 2, 4) the cells' curves in the frame of their start.
        start: (3, H) x, y, heading at the start.
        middle: (3, H) the same at the middle.
    """
    control = control_values(*np.moveaxis(xy_of_r, -1, 0))
    turn = middle[2] - start[2]
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = middle[0] - start[0], middle[1] - start[1]
    x, y = (
        np.cos(start[2]) * x + np.sin(start[2]) * y,
        np.cos(start[2]) * y - np.sin(start[2]) * x,
    )
    u, v = control[:, :, 0] - x, control[:, :, 1] - y
    u, v = cos * u + sin * v, cos * v - sin * u
    sides_u, sides_v = np.diff(u, axis=0), np.diff(v, axis=0)
    angle = np.where(np.hypot(sides_u, sides_v) > 1e-9, np.abs(np.arctan2(sides_v, sides_u)), 0.0)
    return np.abs(u).max(axis=0), np.abs(v).max(axis=0), angle.max(axis=0)
