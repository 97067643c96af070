"""Reference lines: line, arc, spiral, poly3 and paramPoly3 (ASAM OpenDRIVE 1.8, chapter "Geometry").

All pieces of all roads sit in one table. A query is a road index and an s per point; it is answered with a
pose and a curvature per point. s is arc length for every shape: a cubic's parameter is found from it, not
taken for it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from opendrive.arrays import BoolArray, FloatArray, IntArray
from opendrive.geometry.cubic import slope_of, value_of
from opendrive.geometry.profiles import sort_keys
from opendrive.model import Arc, Geometry, Line, ParamPoly3, Poly3, Shape, Spiral

CIRCULAR, CLOTHOID, CUBIC = 0, 1, 2

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(12)
_UNIT_NODES, _UNIT_WEIGHTS = 0.5 * (_NODES + 1.0), 0.5 * _WEIGHTS
_PANEL_TURN_RAD = 1.5
_CELLS = 32
_NEWTON_STEPS = 6
_ROUNDING = 4e-16
"""Parameters up to 1 differ by this much after another step that changes nothing."""


class Poses(NamedTuple):
    """Poses on reference lines: arrays of one shape, map frame."""

    x_m: FloatArray
    y_m: FloatArray
    heading_rad: FloatArray
    curvature_per_m: FloatArray


def circular(ds_m: FloatArray, curvature_per_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return u, v after `ds_m` along an arc; curvature 0 gives a line."""
    half_turn = 0.5 * curvature_per_m * ds_m
    chord = ds_m * np.sinc(half_turn / np.pi)
    return chord * np.cos(half_turn), chord * np.sin(half_turn)


def clothoid(
    ds_m: FloatArray, curvature_per_m: FloatArray, rate_per_m2: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Return u, v after `ds_m` along a clothoid.

    The integral of (cos, sin) of the heading is taken by Gauss-Legendre over panels that turn by at most 1.5
    rad, where 12 nodes are exact to rounding. Unlike the Fresnel form it stays exact as the rate goes to 0.

    Args:
        ds_m: (N,) arc length.
        curvature_per_m: (N,) curvature at the start.
        rate_per_m2: (N,) change of curvature per metre.
    """
    turn = np.abs(curvature_per_m * ds_m) + np.abs(0.5 * rate_per_m2 * ds_m**2)
    panels = np.maximum(np.ceil(turn / _PANEL_TURN_RAD), 1.0)
    step = ds_m / panels
    u, v = np.zeros_like(ds_m), np.zeros_like(ds_m)
    for panel in range(int(panels.max(initial=0.0))):
        some = np.flatnonzero(panels > panel)
        at = step[some, None] * (panel + _UNIT_NODES)
        heading = at * (curvature_per_m[some, None] + 0.5 * rate_per_m2[some, None] * at)
        u[some] += step[some] * (np.cos(heading) @ _UNIT_WEIGHTS)
        v[some] += step[some] * (np.sin(heading) @ _UNIT_WEIGHTS)
    return u, v


@dataclass(frozen=True, slots=True, eq=False)
class CubicCurves:
    """Cubic curves u(q), v(q) for q in [0, 1], with their arc length tabulated.

    Attributes:
        u: (H, 4) coefficients a, b, c, d of u(q).
        v: (H, 4) coefficients of v(q).
        length_at: (H, 33) arc length at q = 0, 1/32, ... 1.
    """

    u: FloatArray
    v: FloatArray
    length_at: FloatArray

    @classmethod
    def tabulate(cls, u: FloatArray, v: FloatArray) -> "CubicCurves":
        """Tabulate the arc lengths of curves given by coefficients (H, 4)."""
        q = (np.arange(_CELLS)[:, None] + _UNIT_NODES) / _CELLS
        du = slope_of(u[:, None, None, :], q)
        dv = slope_of(v[:, None, None, :], q)
        cells = (np.hypot(du, dv) @ _UNIT_WEIGHTS) / _CELLS
        length_at = np.zeros((len(u), _CELLS + 1))
        np.cumsum(cells, axis=1, out=length_at[:, 1:])
        return cls(u, v, length_at)

    def parameter(self, curve: IntArray, ds_m: FloatArray) -> FloatArray:
        """Return q after `ds_m` of arc length, held at the ends of the curve."""
        table = self.length_at[curve]
        ds_m = np.clip(ds_m, 0.0, table[:, -1])
        cell = np.clip((table <= ds_m[:, None]).sum(axis=1) - 1, 0, _CELLS - 1)
        rows = np.arange(len(curve))
        base, end = table[rows, cell], table[rows, cell + 1]
        q_base = cell / _CELLS
        u, v = self.u[curve][:, None, :], self.v[curve][:, None, :]
        span = end - base
        fraction = np.divide(ds_m - base, span, out=np.zeros_like(span), where=span > 0.0)
        q: FloatArray = q_base + fraction / _CELLS
        for _ in range(_NEWTON_STEPS):
            at = q_base[:, None] + (q - q_base)[:, None] * _UNIT_NODES
            travelled = (q - q_base) * (np.hypot(slope_of(u, at), slope_of(v, at)) @ _UNIT_WEIGHTS)
            speed = np.hypot(slope_of(self.u[curve], q), slope_of(self.v[curve], q))
            excess = base + travelled - ds_m
            before = q
            q = q - np.divide(excess, speed, out=np.zeros_like(speed), where=speed > 0.0)
            q = np.clip(q, q_base, q_base + 1.0 / _CELLS)
            if np.abs(q - before).max(initial=0.0) <= _ROUNDING:
                break
        return q

    def evaluate(
        self, curve: IntArray, ds_m: FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Return u, v, heading and curvature after `ds_m` of arc length."""
        q = self.parameter(curve, ds_m)
        u, v = self.u[curve], self.v[curve]
        du, dv = slope_of(u, q), slope_of(v, q)
        ddu, ddv = 2.0 * u[:, 2] + 6.0 * u[:, 3] * q, 2.0 * v[:, 2] + 6.0 * v[:, 3] * q
        speed = np.hypot(du, dv)
        bend = du * ddv - dv * ddu
        curvature = np.divide(bend, speed**3, out=np.zeros_like(speed), where=speed > 1e-9)
        return value_of(u, q), value_of(v, q), np.arctan2(dv, du), curvature


@dataclass(frozen=True, slots=True, eq=False)
class CurveTable:
    """The reference lines of many roads.

    Attributes:
        key: (G,) road and start of each piece, ascending.
        road: (G,) road index.
        start_m: (G,) s at the start of the piece.
        x_m: (G,) start position, map frame.
        y_m: (G,) start position, map frame.
        heading_rad: (G,) start heading.
        length_m: (G,) length of the piece as stated by the file.
        kind: (G,) circular (line or arc), clothoid or cubic.
        curvature_per_m: (G,) curvature at the start; 0 for cubics.
        rate_per_m2: (G,) change of curvature per metre; 0 but for clothoids.
        cubic: (G,) row in `cubics`; 0 for the others.
        is_poly3: (G,) whether it is a poly3, which has no end of its own.
        is_normalized: (G,) whether it is a paramPoly3 over 0 to 1.
        cubics: the poly3 and paramPoly3 pieces.
        first: (R + 1,) index of the first piece of each road.
    """

    key: NDArray[np.complex128]
    road: IntArray
    start_m: FloatArray
    x_m: FloatArray
    y_m: FloatArray
    heading_rad: FloatArray
    length_m: FloatArray
    kind: NDArray[np.int8]
    curvature_per_m: FloatArray
    rate_per_m2: FloatArray
    cubic: IntArray
    is_poly3: BoolArray
    is_normalized: BoolArray
    cubics: CubicCurves
    first: IntArray

    @classmethod
    def build(cls, road: IntArray, rows: FloatArray, shapes: Sequence[Shape], roads: int) -> "CurveTable":
        """Make the table from pieces, ascending in road and s.

        Args:
            road: (G,) road index.
            rows: (G, 5) s, x, y, heading and length.
            shapes: (G,) shape of each piece.
            roads: number of roads R.
        """
        count = len(rows)
        kind, cubic = np.zeros(count, dtype=np.int8), np.zeros(count, dtype=np.int64)
        curvature, rate = np.zeros(count), np.zeros(count)
        is_poly3, is_normalized = np.zeros((2, count), dtype=np.bool_)
        u: list[tuple[float, ...]] = []
        v: list[tuple[float, ...]] = []
        for i, shape in enumerate(shapes):
            if isinstance(shape, Line):
                continue
            if isinstance(shape, Arc):
                curvature[i] = shape.curvature_per_m
            elif isinstance(shape, Spiral):
                curvature[i] = shape.curvature_start_per_m
                if rows[i, 4] > 0.0:
                    rate[i] = (shape.curvature_end_per_m - shape.curvature_start_per_m) / rows[i, 4]
                kind[i] = CLOTHOID if rate[i] else CIRCULAR
            elif isinstance(shape, Poly3 | ParamPoly3):
                kind[i] = CUBIC
                cubic[i] = len(u)
                is_poly3[i] = isinstance(shape, Poly3)
                is_normalized[i] = isinstance(shape, ParamPoly3) and shape.normalized
                u_of_q, v_of_q = _unit_coefficients(shape, float(rows[i, 4]))
                u.append(u_of_q)
                v.append(v_of_q)
        s, x, y, heading, length = (column.copy() for column in rows.T)
        return cls(
            key=sort_keys(road, s),
            road=road,
            start_m=s,
            x_m=x,
            y_m=y,
            heading_rad=heading,
            length_m=length,
            kind=kind,
            curvature_per_m=curvature,
            rate_per_m2=rate,
            cubic=cubic,
            is_poly3=is_poly3,
            is_normalized=is_normalized,
            cubics=CubicCurves.tabulate(np.array(u).reshape(-1, 4), np.array(v).reshape(-1, 4)),
            first=np.searchsorted(road, np.arange(roads + 1)),
        )

    @classmethod
    def stack(cls, roads: Sequence[Sequence[Geometry]]) -> "CurveTable":
        """Stack the pieces of R roads, each ascending in s."""
        road = np.repeat(np.arange(len(roads)), [len(pieces) for pieces in roads])
        pieces = [piece for road in roads for piece in road]
        rows = np.array([(p.s_m, p.x_m, p.y_m, p.heading_rad, p.length_m) for p in pieces]).reshape(-1, 5)
        return cls.build(road, rows, [piece.shape for piece in pieces], len(roads))

    def evaluate(self, road: IntArray, s_m: FloatArray) -> Poses:
        """Return the poses at `s_m` on the reference lines of `road`, both (N,).

        Before the first piece and after the last one its shape is continued, but a cubic is held at its ends.
        """
        piece = np.searchsorted(self.key, sort_keys(road, s_m), side="right") - 1
        return self.evaluate_pieces(np.maximum(piece, self.first[road]), s_m)

    def evaluate_pieces(self, piece: IntArray, s_m: FloatArray) -> Poses:
        """Return the poses at `s_m` on given pieces, both (N,)."""
        ds = s_m - self.start_m[piece]
        kind = self.kind[piece]
        curvature, rate = self.curvature_per_m[piece], self.rate_per_m2[piece]
        u, v = circular(ds, curvature)
        turn = ds * (curvature + 0.5 * rate * ds)
        curvature = curvature + rate * ds
        if (where := np.flatnonzero(kind == CLOTHOID)).size:
            i = piece[where]
            u[where], v[where] = clothoid(ds[where], self.curvature_per_m[i], self.rate_per_m2[i])
        if (where := np.flatnonzero(kind == CUBIC)).size:
            u[where], v[where], turn[where], curvature[where] = self.cubics.evaluate(
                self.cubic[piece[where]], ds[where]
            )
        heading = self.heading_rad[piece]
        cos, sin = np.cos(heading), np.sin(heading)
        return Poses(
            x_m=self.x_m[piece] + cos * u - sin * v,
            y_m=self.y_m[piece] + sin * u + cos * v,
            heading_rad=heading + turn,
            curvature_per_m=curvature,
        )


def _unit_coefficients(
    shape: Poly3 | ParamPoly3, length_m: float
) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """Return the coefficients of u(q), v(q) with q in [0, 1]."""
    if isinstance(shape, Poly3):
        u, v, scale = (0.0, 1.0, 0.0, 0.0), shape.coefficients, length_m
    else:
        u, v, scale = shape.u, shape.v, 1.0 if shape.normalized else length_m
    powers = [scale**k for k in range(4)]
    return tuple(a * b for a, b in zip(u, powers, strict=True)), tuple(
        a * b for a, b in zip(v, powers, strict=True)
    )
