"""Ways that leave a curve sideways or come to it: lane changes and lane offsets.

The offset from a curve changes by a shape over a time, or over a way along the curve. An entity drives the
resulting way with its own speed, heading along it: across the lane it is no faster than it drives.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from scenarios.openscenario.model import SpeedShape
from scenarios.openscenario.motion.paths import SPACING_M, Path
from smartmot.types import FloatArray

SHAPES: dict[SpeedShape, Callable[[FloatArray], FloatArray]] = {
    "linear": lambda part: part,
    "cubic": lambda part: part**2 * (3.0 - 2.0 * part),
    "sinusoidal": lambda part: 0.5 * (1.0 - np.cos(np.pi * part)),
}
"""Share of a change that is done after a share of its time or way."""

BENDS: dict[SpeedShape, float] = {"linear": 6.0, "cubic": 6.0, "sinusoidal": math.pi**2 / 2}
"""The greatest acceleration of a shape, in units of change / duration^2.

That of a linear change is infinite at both ends: it takes as long as a cubic one, as in esmini.
"""

STEEPEST = math.sin(math.pi / 4)
"""Who would have to head further away from the lane than 45 degrees is too slow for a change."""

FEWEST, MOST = 50, 20_000
"""Points of a change."""

CORNER_M = 1e-6
"""Length over which a heading changes at a corner."""


class Swerve(NamedTuple):
    """A way with a change of the offset.

    Args:
        path: the way; arc length 0 where the change begins.
        gone_m: (K,) arc lengths of points of the change.
        station_m: (K,) arc lengths on the curve beside them.
        left_m: (K,) offsets to the left of the curve.
    """

    path: Path
    gone_m: FloatArray
    station_m: FloatArray
    left_m: FloatArray


def too_steep(gone_m: FloatArray, left_m: FloatArray) -> bool:
    """Whether offsets after ways cannot be reached by an entity that heads along the lane."""
    return bool((np.abs(np.diff(left_m)) > STEEPEST * np.diff(gone_m)).any())


def count_of(length_m: float) -> int:
    """How many points a change over a way has."""
    return int(np.clip(math.ceil(length_m / SPACING_M), FEWEST, MOST)) + 1


def by_way_gone(
    curve: Path, station_m: float, gone_m: FloatArray, left_m: FloatArray, smooth: tuple[bool, bool]
) -> Swerve:
    """The way of an entity that has an offset from a curve after a way gone.

    Args:
        curve: the curve.
        station_m: arc length on it at the beginning.
        gone_m: (K,) ways gone, from 0 on, growing.
        left_m: (K,) offsets.
        smooth: whether the change begins, and ends, along the curve.
    """
    ahead = np.sqrt(np.maximum(np.diff(gone_m) ** 2 - np.diff(left_m) ** 2, 0.0))
    middle = 0.5 * (left_m[1:] + left_m[:-1])
    along = station_m + np.concatenate(([0.0], np.cumsum(ahead)))
    # beside a bend the way ahead is shorter or longer than on the curve; the curvature there settles quickly
    for _ in range(4):
        yaw = np.unwrap(curve.poses(along)[:, 2])
        step = np.diff(along)
        curvature = np.divide(np.diff(yaw), step, out=np.zeros_like(step), where=step > 0.0)
        if not curvature.any():
            break
        along = station_m + np.concatenate(
            ([0.0], np.cumsum(ahead / np.maximum(1.0 - curvature * middle, 0.1)))
        )
    return _swerve(curve, gone_m, along, left_m, smooth)


def by_station(curve: Path, station_m: FloatArray, left_m: FloatArray, smooth: tuple[bool, bool]) -> Swerve:
    """The way through offsets at arc lengths of a curve.

    Args:
        curve: the curve.
        station_m: (K,) arc lengths on it, growing.
        left_m: (K,) offsets.
        smooth: whether the change begins, and ends, along the curve.
    """
    frames = curve.poses(station_m)
    x = frames[:, 0] - np.sin(frames[:, 2]) * left_m
    y = frames[:, 1] + np.cos(frames[:, 2]) * left_m
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    return _swerve(curve, gone, station_m, left_m, smooth)


def _swerve(
    curve: Path, gone_m: FloatArray, along_m: FloatArray, left_m: FloatArray, smooth: tuple[bool, bool]
) -> Swerve:
    """The way through the offsets, and on beside the curve at the last one."""
    frames = curve.poses(along_m)
    slope = np.gradient(left_m, gone_m, edge_order=2 if len(gone_m) > 2 else 1)
    slope[[0, -1]] *= [not smooth[0], not smooth[1]]
    turn = np.arcsin(np.clip(slope, -1.0, 1.0))
    change = _rows(frames, left_m, gone_m, turn)
    tail = _tail(curve, float(along_m[-1]), float(left_m[-1]), float(gone_m[-1]))
    rows = np.concatenate((change, tail))
    path = Path(rows[:, 0], rows[:, 1], np.unwrap(rows[:, 2]), rows[:, 3])
    path.on_road = curve.on_road
    return Swerve(path, gone_m, along_m, left_m)


def _rows(
    frames: FloatArray, left_m: FloatArray | float, gone_m: FloatArray, turn: FloatArray | float
) -> FloatArray:
    """(K, 4) x, y, heading and arc length beside a curve."""
    x = frames[:, 0] - np.sin(frames[:, 2]) * left_m
    y = frames[:, 1] + np.cos(frames[:, 2]) * left_m
    return np.column_stack((x, y, frames[:, 2] + turn, gone_m))


def _tail(curve: Path, along_m: float, left_m: float, gone_m: float) -> FloatArray:
    """(K, 4) the way on beside a curve at an offset: a corner, both headings of further corners."""
    points = np.array(curve.station_of_vertices())
    corners = points[points > along_m + 3 * CORNER_M]
    if not len(corners):
        corners = np.array([along_m + 1.0])
    along = np.concatenate(([along_m + CORNER_M], np.column_stack((corners - CORNER_M, corners)).ravel()))
    frames = curve.poses(along)
    rows = _rows(frames, left_m, along, 0.0)
    if left_m == 0.0:
        rows[:, 3] = gone_m + along - along_m
    else:
        steps = np.hypot(*np.diff(rows[:, :2], axis=0).T)
        rows[:, 3] = gone_m + CORNER_M + np.concatenate(([0.0], np.cumsum(steps)))
    keep = np.concatenate(([True], np.diff(rows[:, 3]) > 0.1 * CORNER_M))
    return rows[keep]
