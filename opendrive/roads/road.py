"""One road: points, attitude and coordinates of its surface."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from opendrive.arrays import FloatArray, finite, points_xy
from opendrive.errors import PositionError
from opendrive.geometry.curves import Poses
from opendrive.model import Road
from opendrive.roads.geometry import NetworkGeometry, SurfacePoints

S_TOLERANCE_M = 1e-3
"""A position this far off the end of a road or lane is moved onto it; further off is an error."""

_SLOPE_STEP_M = 1e-3
"""Half the base of the central differences that give the slopes of a surface."""


class SurfaceAttitudes(NamedTuple):
    """How road surfaces lie in space at given points; arrays of one shape.

    Attributes:
        z_m: height.
        heading_rad: direction of increasing s, wrapped to (-pi, pi].
        pitch_rad: rotation about the axis to the left, right-handed: negative where the road climbs along s.
        roll_rad: rotation about the axis ahead, right-handed: positive where the left side is higher.
        normal: unit vectors upwards, map frame; one axis of length 3 more than the others.
    """

    z_m: FloatArray
    heading_rad: FloatArray
    pitch_rad: FloatArray
    roll_rad: FloatArray
    normal: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class RoadGeometry:
    """Geometry of one road.

    Attributes:
        id: id of the road.
        index: its index in the network.
        geometry: geometry of the network.
        records: roads as read, by id.
    """

    id: str
    index: int
    geometry: NetworkGeometry
    records: Mapping[str, Road]

    @property
    def record(self) -> Road:
        """The road as read."""
        return self.records[self.id]

    @property
    def length_m(self) -> float:
        """Length of the reference line."""
        return float(self.geometry.length_m[self.index])

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

    def attitude(self, s_m: ArrayLike, t_m: ArrayLike) -> SurfaceAttitudes:
        """Return height, heading, pitch, roll and normal of the surface at (s, t), broadcast.

        Elevation, superelevation, crossfall and lateral shape count. The slopes are taken over a few
        millimetres, towards the road where that is its end.

        Raises:
            PositionError: s or t is not finite, or s is off the road.
        """
        s, t = np.broadcast_arrays(self._on_road(s_m), finite(t_m, "t_m"))
        at, across = s.ravel(), t.ravel()
        road = np.full(s.size, self.index)
        low, high = np.maximum(at - _SLOPE_STEP_M, 0.0), np.minimum(at + _SLOPE_STEP_M, self.length_m)
        point = self.geometry.surface(road, at, across)
        steps = []
        for before, after in (
            ((low, across), (high, across)),
            ((at, across - _SLOPE_STEP_M), (at, across + _SLOPE_STEP_M)),
        ):
            first, second = (np.stack(self.geometry.surface(road, *place)[:3]) for place in (before, after))
            steps.append(second - first)
        normal = np.cross(steps[0], steps[1], axis=0)
        normal /= np.maximum(np.linalg.norm(normal, axis=0), 1e-300)
        cos, sin = np.cos(point.heading_rad), np.sin(point.heading_rad)
        ahead = cos * normal[0] + sin * normal[1]
        left = cos * normal[1] - sin * normal[0]
        pitch = np.arctan2(ahead, normal[2])
        roll = -np.arcsin(np.clip(left, -1.0, 1.0))
        z, heading, pitch, roll = (
            column.reshape(s.shape) for column in (point.z_m, point.heading_rad, pitch, roll)
        )
        return SurfaceAttitudes(z, heading, pitch, roll, normal.T.reshape(*s.shape, 3))

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
