"""The reference line of a road: its pieces laid one after the other from a start pose.

Numbers that are computed are rounded, so that the files do not vary between machines.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate
from math import cos, sin

import numpy as np

from opendrive import model
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
    """A piece of reference line whose curvature runs linearly from start to end."""

    length_m: float
    curvature_start: float = 0.0
    curvature_end: float = 0.0


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


def end_of(start: Pose, piece: Piece) -> Pose:
    """Pose at the end of a line, an arc or a clothoid."""
    length_m, k_start, k_end = piece.length_m, piece.curvature_start, piece.curvature_end
    rate = (k_end - k_start) / length_m
    along_m, aside_m = (float(step[0]) for step in clothoid(*np.array([[length_m], [k_start], [rate]])))
    return moved(start, along_m, aside_m, length_m * (k_start + k_end) / 2)


def to_15_digits(value: float) -> float:
    """The value to 15 digits, since a last bit may vary between machines; no zero is negative."""
    return float(f"{value:.15g}") + 0.0


def total_length_m(pieces: Sequence[Piece]) -> float:
    """Length of the reference line."""
    return sum(piece.length_m for piece in pieces)


def _shape(piece: Piece) -> model.Shape:
    if piece.curvature_start != piece.curvature_end:
        return model.Spiral(to_15_digits(piece.curvature_start), to_15_digits(piece.curvature_end))
    return model.Arc(to_15_digits(piece.curvature_start)) if piece.curvature_start else model.Line()


def reference_line(start: Pose, pieces: Sequence[Piece]) -> tuple[model.Geometry, ...]:
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
