"""Where the ego is to go: a polyline with stations."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from smartmot.errors import ShapeError
from smartmot.types import FloatArray, IntArray, frozen

_FEW = 16
"""Up to so many segments a loop over them is quicker than arrays."""


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
    _segments: FloatArray = field(init=False, repr=False)
    _unit: FloatArray = field(init=False, repr=False)
    _normal: FloatArray = field(init=False, repr=False)
    _yaw_rad: FloatArray = field(init=False, repr=False)
    _joint_m: FloatArray = field(init=False, repr=False)
    _rows: list[list[float]] | None = field(init=False, repr=False)
    _projected: tuple[float, float, tuple[float, float]] | None = field(init=False, repr=False)

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
        unit = np.diff(center, axis=0) / length[:, None]
        segments = np.empty((6, len(length)))
        segments[0], segments[1], segments[2], segments[3] = *center[:-1].T, *unit.T
        segments[4], segments[5] = 0.0, length
        segments[4, 0], segments[5, -1] = -np.inf, np.inf  # the first and the last segment go straight on
        columns = {
            "center_m": center,
            "station_m": station,
            "_segments": segments,
            "_unit": unit,
            "_normal": np.column_stack((-unit[:, 1], unit[:, 0])),
            "_yaw_rad": np.arctan2(unit[:, 1], unit[:, 0]),
            "_joint_m": station[1:-1].copy(),
            "_rows": None,
            "_projected": None,
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
        last = self._projected  # area, way and forecast ask for the ego's place in turn
        if last is not None and last[0] == x_m and last[1] == y_m:
            return last[2]
        if len(self._yaw_rad) <= _FEW:
            beyond, on, offset, k = self._foot(x_m, y_m)
        else:
            along, foot, lateral, nearest = self._feet(x_m, y_m)
            k = int(nearest)
            on, offset = float(foot[k]), float(lateral[k])
            beyond = float(along[k]) - on
        if beyond:  # outside a corner the nearest point is the corner itself
            offset = math.copysign(math.hypot(beyond, offset), offset)
        place = float(self.station_m[k]) + on, offset
        object.__setattr__(self, "_projected", (x_m, y_m, place))
        return place

    def place(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N,) stations and (N,) signed offsets, as from `project`, of many points, (N, 2) map frame."""
        along, foot, lateral, k = self._feet(points_m[:, 0, None], points_m[:, 1, None])
        rows = np.arange(len(k))
        foot, offset = foot[rows, k], lateral[rows, k]
        beyond = along[rows, k] - foot
        if np.count_nonzero(beyond):
            offset = np.copysign(np.hypot(beyond, offset), offset)
        return self.station_m.take(k) + foot, offset

    def _foot(self, x_m: float, y_m: float) -> tuple[float, float, float, int]:
        """`_feet` of one point by plain numbers: the same products and sums, for few segments.

        Returns:
            Distance beyond the nearest segment's end, on that segment, offset to its left, and its number.
        """
        if self._rows is None:
            object.__setattr__(self, "_rows", self._segments.T.tolist())
        assert self._rows is not None
        nearest, least = (0.0, 0.0, 0.0, 0), math.inf
        for k, (x, y, ux, uy, low, high) in enumerate(self._rows):
            dx, dy = x_m - x, y_m - y
            along, lateral = dx * ux + dy * uy, ux * dy - dx * uy
            foot = low if along < low else high if along > high else along
            beyond = along - foot
            apart = beyond * beyond + lateral * lateral
            if apart < least:
                nearest, least = (beyond, foot, lateral, k), apart
        return nearest

    def _feet(
        self, x_m: float | FloatArray, y_m: float | FloatArray
    ) -> tuple[FloatArray, FloatArray, FloatArray, IntArray]:
        """Feet of one point, or of N (N, 1), on each of the S segments.

        Returns:
            (..., S) distances along each segment, unlimited and as far as the segment goes, (..., S)
            offsets to its left, and (...) the segments whose foot is the nearest: that on the path.
        """
        x, y, ux, uy, low, high = self._segments
        dx, dy = x_m - x, y_m - y
        along, lateral = dx * ux, ux * dy
        along += np.multiply(dy, uy, out=dy)
        lateral -= np.multiply(dx, uy, out=dx)
        foot = np.maximum(along, low)
        np.minimum(foot, high, out=foot)
        apart = np.subtract(along, foot, out=dx)
        apart *= apart
        apart += np.multiply(lateral, lateral, out=dy)
        return along, foot, lateral, apart.argmin(axis=-1)

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
        k = self._joint_m.searchsorted(station_m, side="right")
        points = self._unit.take(k, axis=0)
        points *= (station_m - self.station_m.take(k))[:, None]
        points += self.center_m.take(k, axis=0)
        aside = offset_m[:, None] if isinstance(offset_m, np.ndarray) else offset_m
        points += self._normal.take(k, axis=0) * aside
        return points, self._yaw_rad.take(k)

    def pose(self, station_m: float, offset_m: float = 0.0) -> tuple[float, float, float]:
        """(x_m, y_m, yaw_rad) of a point beside the path (left positive), map frame; see `poses`."""
        (point,), (yaw_rad,) = self.poses(np.array([station_m]), offset_m)
        return float(point[0]), float(point[1]), float(yaw_rad)


def chord_stations(points_m: FloatArray) -> FloatArray:
    """(P,) distances of the points of a polyline, (P, 2), from its beginning along its chords."""
    return np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(points_m, axis=0).T))))
