"""Where the ego is to go: a polyline with stations."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smartmot.errors import ShapeError
from smartmot.types import FloatArray, frozen


@dataclass(frozen=True, slots=True, eq=False)
class PlannedPath:
    """The planned path of the ego; straight on before its first and beyond its last point.

    Args:
        center_m: (P, 2) points that the centre of the ego is to pass, map frame.
        station_m: (P,) distance along the path, ascending from point to point.
        height_m: (P,) heights of the ground on the way, where roads lie above one another; None: not known.

    Raises:
        ShapeError: shapes disagree, a value is not finite, or the stations do not ascend.
    """

    _noun: ClassVar[str] = "planned path"

    center_m: FloatArray
    station_m: FloatArray
    height_m: FloatArray | None = field(default=None, kw_only=True)
    _unit: FloatArray = field(init=False, repr=False)
    _low_m: FloatArray = field(init=False, repr=False)
    _high_m: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        center = frozen(self.center_m, np.float64, (None, 2), "center_m")
        station = frozen(self.station_m, np.float64, (len(center),), "station_m")
        if not math.isfinite(float(center.sum() + station.sum())):
            raise ShapeError(f"{self._noun}: every point and station must be finite")
        if len(center) < 2 or not (np.diff(station) > 0.0).all():
            raise ShapeError(
                f"{self._noun}: expected two points or more, each at a greater station than the last"
            )
        if self.height_m is not None:
            heights = frozen(self.height_m, np.float64, (len(center),), "height_m")
            if not np.isfinite(heights).all():
                raise ShapeError(f"{self._noun}: every height must be finite")
            object.__setattr__(self, "height_m", heights)
        # every frame projects points; the segments are made once
        length = np.diff(station)
        low, high = np.zeros_like(length), length.copy()
        low[0], high[-1] = -np.inf, np.inf  # the first and the last segment go straight on
        columns = {
            "center_m": center,
            "station_m": station,
            "_unit": np.diff(center, axis=0) / length[:, None],
            "_low_m": low,
            "_high_m": high,
        }
        for name, column in columns.items():
            object.__setattr__(self, name, column)

    @classmethod
    def through(cls, points_m: ArrayLike, height_m: ArrayLike | None = None) -> PlannedPath:
        """The path through (P, 2) points, map frame, whose stations are measured along the chords from 0.

        Heights of the ground, (P,), tell roads above one another apart.

        Raises:
            ShapeError: not of that shape, fewer than two points, two neighbours are equal, or a value is not
                finite.
        """
        points = frozen(points_m, np.float64, (None, 2), "points_m")
        heights = None if height_m is None else np.asarray(height_m, dtype=np.float64)
        return PlannedPath(points, chord_stations(points), height_m=heights)

    @property
    def length_m(self) -> float:
        """Station of the last point."""
        return float(self.station_m[-1])

    def project(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Station and signed offset (left positive) of the nearest point of the path, metres.

        Before the first and after the last point the end segments are extended straight on.
        """
        station, offset = self.place(np.array([[x_m, y_m]]))
        return float(station[0]), float(offset[0])

    def place(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N,) stations and (N,) signed offsets, as from `project`, of many points, (N, 2) map frame."""
        dx = points_m[:, 0, None] - self.center_m[:-1, 0]
        dy = points_m[:, 1, None] - self.center_m[:-1, 1]
        ux, uy = self._unit[:, 0], self._unit[:, 1]
        along, lateral = dx * ux, ux * dy
        along += np.multiply(dy, uy, out=dy)
        lateral -= np.multiply(dx, uy, out=dx)
        # the foot on each segment; the nearest of all feet is that on the path
        foot = np.maximum(along, self._low_m)
        np.minimum(foot, self._high_m, out=foot)
        apart = np.subtract(along, foot, out=dx)
        apart *= apart
        apart += np.multiply(lateral, lateral, out=dy)
        k = apart.argmin(axis=1)
        rows = np.arange(len(k))
        foot, offset = foot[rows, k], lateral[rows, k]
        beyond = along[rows, k] - foot  # outside a corner the nearest point is the corner itself
        if beyond.any():
            offset = np.copysign(np.hypot(beyond, offset), offset)
        return self.station_m[k] + foot, offset

    def poses(
        self, station_m: FloatArray, offset_m: float | FloatArray = 0.0
    ) -> tuple[FloatArray, FloatArray]:
        """Points beside the path (left positive) at many stations, straight on beyond its ends.

        At a joint of the path the heading is that after it.

        Args:
            station_m: (T,) distances along it.
            offset_m: to the left, one for all or (T,).

        Returns:
            (T, 2) points, map frame, and (T,) headings of the path there.
        """
        k = np.clip(np.searchsorted(self.station_m, station_m, side="right") - 1, 0, len(self._unit) - 1)
        unit, along = self._unit[k], station_m - self.station_m[k]
        normal = np.column_stack((-unit[:, 1], unit[:, 0]))
        aside = offset_m[:, None] if isinstance(offset_m, np.ndarray) else offset_m
        points = self.center_m[k] + unit * along[:, None] + normal * aside
        return points, np.arctan2(unit[:, 1], unit[:, 0])

    def pose(self, station_m: float, offset_m: float = 0.0) -> tuple[float, float, float]:
        """(x_m, y_m, yaw_rad) of a point beside the path (left positive), map frame; see `poses`."""
        (point,), (yaw_rad,) = self.poses(np.array([station_m]), offset_m)
        return float(point[0]), float(point[1]), float(yaw_rad)


def chord_stations(points_m: FloatArray) -> FloatArray:
    """(P,) distances of the points of a polyline, (P, 2), from its beginning along its chords."""
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points_m, axis=0).T))))
