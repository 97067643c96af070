"""The reference line of a road: its pieces laid one after the other from a start pose.

Numbers that are computed are rounded, so that files do not vary between machines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import cos, inf, isfinite, sin

import numpy as np
from numpy.typing import ArrayLike

from opendrive import model
from opendrive.arrays import points_xy
from opendrive.errors import PositionError
from opendrive.geometry.curves import clothoid


@dataclass(frozen=True, slots=True)
class Pose:
    """A point of the reference line, map frame, and its heading."""

    x_m: float
    y_m: float
    yaw_rad: float


ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of reference line whose curvature runs linearly from start to end.

    Raises:
        PositionError: the length is not positive, or a number is not finite.
    """

    length_m: float
    curvature_start: float = 0.0
    curvature_end: float = 0.0

    def __post_init__(self) -> None:
        """See that it is a piece."""
        if not 0.0 < self.length_m < inf:
            raise PositionError(f"length_m: a piece must be longer than 0 and finite, got {self.length_m}")
        if not (isfinite(self.curvature_start) and isfinite(self.curvature_end)):
            raise PositionError(
                f"curvature: must be finite, got {self.curvature_start} to {self.curvature_end}"
            )


@dataclass(frozen=True, slots=True)
class Curve:
    """A piece of reference line with cubics u(p) and v(p), p from 0 to 1; it begins along u, at 0, 0.

    Attributes:
        length_m: its arc length.
        u: coefficients of p, p^2, p^3.
        v: coefficients of p^2, p^3.
    """

    length_m: float
    u: tuple[float, float, float]
    v: tuple[float, float]


def line(length_m: float) -> Piece:
    """Return a straight piece."""
    return Piece(length_m)


def arc(length_m: float, radius_m: float) -> Piece:
    """Return an arc; a positive radius bends left.

    Raises:
        PositionError: the radius is 0.
    """
    if radius_m == 0.0:
        raise PositionError("radius_m: must not be 0; a straight piece is `line`")
    return Piece(length_m, 1.0 / radius_m, 1.0 / radius_m)


def spiral(length_m: float, curvature_start: float, curvature_end: float) -> Piece:
    """Return a clothoid, whose curvature changes linearly, 1/m; positive bends left."""
    return Piece(length_m, curvature_start, curvature_end)


def through(points_m: ArrayLike) -> tuple[Pose, list[Curve]]:
    """Return the start and the pieces of a smooth reference line through points.

    The line is a cubic spline over the chord lengths, so that heading and curvature have no steps.

    Args:
        points_m: (N, 2) points, at least two, no two in a row the same.

    Raises:
        PositionError: there are not enough points, two in a row are the same, or one is not finite.
    """
    # Only those who build from points wait for it.
    from scipy.interpolate import CubicSpline

    points = points_xy(points_m)
    chords_m = np.linalg.norm(np.diff(points, axis=0), axis=1)
    if len(points) < 2 or chords_m.min() <= 0.0:
        raise PositionError("points_m: expected at least two points, no two in a row the same")
    spline = CubicSpline(np.concatenate([[0.0], np.cumsum(chords_m)]), points)
    pieces = []
    start: Pose | None = None
    for k, chord_m in enumerate(chords_m.tolist()):
        cubic, square, slope = (spline.c[row, k] * chord_m ** (3 - row) for row in range(3))
        yaw_rad = float(np.arctan2(slope[1], slope[0]))
        start = start or Pose(float(points[0, 0]), float(points[0, 1]), yaw_rad)
        along = np.array([np.cos(yaw_rad), np.sin(yaw_rad)])
        aside = np.array([-along[1], along[0]])
        u, v = ([float(row @ axis) for row in (slope, square, cubic)] for axis in (along, aside))
        pieces.append(_curve((u[0], u[1], u[2]), (v[1], v[2])))
    assert start is not None
    return start, pieces


def bridge(start: Pose, end: Pose) -> Curve:
    """Return the cubic from one pose to another, along both headings."""
    dx, dy = end.x_m - start.x_m, end.y_m - start.y_m
    c, s = cos(start.yaw_rad), sin(start.yaw_rad)
    x, y, turn = c * dx + s * dy, c * dy - s * dx, end.yaw_rad - start.yaw_rad
    # Hermite's form with tangents as long as the chord.
    chord = float(np.hypot(x, y))
    tx, ty = chord * cos(turn), chord * sin(turn)
    return _curve((chord, 3.0 * x - 2.0 * chord - tx, chord + tx - 2.0 * x), (3.0 * y - ty, ty - 2.0 * y))


def _curve(u: tuple[float, float, float], v: tuple[float, float]) -> Curve:
    return Curve(_arc_length_m(u, v), u, v)


def _arc_length_m(u: tuple[float, float, float], v: tuple[float, float]) -> float:
    """Return the arc length of cubics over p from 0 to 1: Gauss-Legendre over 32 panels."""
    nodes, weights = np.polynomial.legendre.leggauss(12)
    panels = 32
    p = (np.arange(panels)[:, None] + 0.5 * (nodes + 1.0)) / panels
    du = u[0] + p * (2.0 * u[1] + p * 3.0 * u[2])
    dv = p * (2.0 * v[0] + p * 3.0 * v[1])
    return float((np.hypot(du, dv) * weights).sum() / (2 * panels))


def turned(pose: Pose, by_rad: float) -> Pose:
    """The pose turned about the origin; coordinates are snapped to 1e-10 m so that files do not vary."""
    c, s = cos(by_rad), sin(by_rad)
    return Pose(
        round(c * pose.x_m - s * pose.y_m, 10), round(s * pose.x_m + c * pose.y_m, 10), pose.yaw_rad + by_rad
    )


def moved(start: Pose, x_m: float, y_m: float, turn_rad: float) -> Pose:
    """The pose reached by a step given in the frame of `start`."""
    step = turned(Pose(x_m, y_m, turn_rad), start.yaw_rad)
    return Pose(round(start.x_m + step.x_m, 10), round(start.y_m + step.y_m, 10), step.yaw_rad)


def end_of(start: Pose, piece: Piece | Curve) -> Pose:
    """Pose at the end of a piece."""
    if isinstance(piece, Curve):
        turn = float(
            np.arctan2(2 * piece.v[0] + 3 * piece.v[1], piece.u[0] + 2 * piece.u[1] + 3 * piece.u[2])
        )
        return moved(start, sum(piece.u), sum(piece.v), turn)
    length_m, k_start, k_end = piece.length_m, piece.curvature_start, piece.curvature_end
    rate = (k_end - k_start) / length_m
    along_m, aside_m = (float(step[0]) for step in clothoid(*np.array([[length_m], [k_start], [rate]])))
    return moved(start, along_m, aside_m, length_m * (k_start + k_end) / 2)


def to_15_digits(value: float) -> float:
    """The value to 15 digits, since a last bit may vary between machines; no zero is negative."""
    return float(f"{value:.15g}") + 0.0


def total_length_m(pieces: Sequence[Piece | Curve]) -> float:
    """Length of the reference line."""
    return sum(piece.length_m for piece in pieces)


def _shape(piece: Piece | Curve) -> model.Shape:
    if isinstance(piece, Curve):
        u, v = ([to_15_digits(value) for value in values] for values in (piece.u, piece.v))
        return model.ParamPoly3((0.0, u[0], u[1], u[2]), (0.0, 0.0, v[0], v[1]), normalized=True)
    if piece.curvature_start != piece.curvature_end:
        return model.Spiral(to_15_digits(piece.curvature_start), to_15_digits(piece.curvature_end))
    return model.Arc(to_15_digits(piece.curvature_start)) if piece.curvature_start else model.Line()


def reference_line(start: Pose, pieces: Sequence[Piece | Curve]) -> tuple[model.Geometry, ...]:
    """The pieces as they stand in a map, each with s and pose of its start."""
    s_m = accumulate((piece.length_m for piece in pieces), initial=0.0)
    poses = accumulate(pieces, end_of, initial=start)
    return tuple(
        model.Geometry(
            to_15_digits(s_start_m),
            to_15_digits(pose.x_m),
            to_15_digits(pose.y_m),
            to_15_digits(pose.yaw_rad),
            to_15_digits(piece.length_m),
            _shape(piece),
        )
        for piece, s_start_m, pose in zip(pieces, s_m, poses, strict=False)
    )
