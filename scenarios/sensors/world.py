"""What sensors measure: ground truth of one instant, with heights and the road's surface."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Protocol

import numpy as np

from opendrive import RoadNetwork
from scenarios.errors import ScenarioError
from smartmot.errors import ShapeError
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, IntArray, StrArray, frozen


class RoadSurface(Protocol):
    """The ground on which everybody stands."""

    def elevation_m(self, points_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
        """(N,) height of the ground at (N, 2) points, map frame.

        Args:
            points_m: where.
            yaw_rad: (N,) headings of what stands there. Where roads lie above one another, the road counts
                along which a heading runs.
        """
        ...


class FlatGround:
    """A plane.

    Args:
        height_m: of it, map frame.
    """

    def __init__(self, height_m: float = 0.0) -> None:
        self.height_m = height_m

    def elevation_m(self, points_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
        """(N,) the height of the plane."""
        return np.full(len(points_m), self.height_m)


class MapSurface:
    """The road surface of a map; beside the roads it goes on as at the edge of the nearest lane.

    Args:
        network: the map.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network

    @cached_property
    def _lane_types(self) -> tuple[str, ...]:
        return tuple(sorted({str(kind) for kind in self.network.lanes.lane_type}))

    @property
    def is_level(self) -> bool:
        """Whether all roads lie at one height."""
        return self._level_m is not None

    @cached_property
    def _level_m(self) -> float | None:
        """The height at which all roads lie: looked at every 5 m on reference lines and beside these."""
        heights = [
            self.network.road_point(road_id, s, t).z_m
            for road_id, road in self.network.roads.items()
            for s in (np.linspace(0.0, road.length_m, max(math.ceil(road.length_m / 5.0), 1) + 1),)
            for t in (-5.0, 0.0, 5.0)
        ]
        height = np.concatenate(heights) if heights else np.zeros(1)
        return float(height[0]) if float(np.ptp(height)) < 1e-9 else None

    def elevation_m(self, points_m: FloatArray, yaw_rad: FloatArray) -> FloatArray:
        """(N,) height of the road's surface; see `RoadSurface`.

        Raises:
            ScenarioError: the map has no lanes.
        """
        elevation = np.zeros(len(points_m))
        if not len(points_m):
            return elevation
        network = self.network
        if not self._lane_types:
            raise ScenarioError(f"map {network.name!r} has no lanes, so that it has no road surface")
        if self._level_m is not None:
            return np.full(len(points_m), self._level_m)
        nearest = network.nearest_lane(points_m, self._lane_types, yaw_rad)
        inner, outer = network.lane_offsets(nearest.lane, nearest.s_m)
        t = np.clip(nearest.t_m, np.minimum(inner, outer), np.maximum(inner, outer))
        road = np.array([network.lanes.key[lane].road_id for lane in nearest.lane.tolist()])
        for road_id in np.unique(road).tolist():
            rows = np.flatnonzero(road == road_id)
            elevation[rows] = network.road_point(road_id, nearest.s_m[rows], t[rows]).z_m
        return elevation


@dataclass(frozen=True, slots=True, eq=False)
class World:
    """Ground truth of one instant: everybody but the vehicle that carries the sensors. N objects, map frame.

    Args:
        time_s: when, seconds.
        boxes: N outlines on the ground.
        speed_mps: (N,) along the headings, negative in reverse.
        height_m: (N,) heights of the boxes.
        object_id: (N,) numbers that an object keeps for the whole run.
        category: (N,) names out of `smartmot.types.CATEGORIES`.
        exists: (N,) not deleted.
        seen: (N,) exists and is visible to sensors.
        surface: the ground.
        ground_m: (N,) heights of the ground below the boxes, where roads lie above one another; None: as the
            surface says.
        ego_ground_m: that below the vehicle with the sensors.

    Raises:
        smartmot.errors.ShapeError: shapes disagree, a value is not finite, or a height is not positive.
    """

    time_s: float
    boxes: Boxes
    speed_mps: FloatArray
    height_m: FloatArray
    object_id: IntArray
    category: StrArray
    exists: BoolArray
    seen: BoolArray
    surface: RoadSurface = field(default_factory=FlatGround)
    ground_m: FloatArray | None = None
    ego_ground_m: float | None = None

    def __post_init__(self) -> None:
        shape = (len(self.boxes),)
        for name, dtype in _COLUMNS.items():
            object.__setattr__(self, name, frozen(getattr(self, name), dtype, shape, name))
        if self.ground_m is not None:
            object.__setattr__(self, "ground_m", frozen(self.ground_m, np.float64, shape, "ground_m"))
        category = np.array(self.category, dtype=np.str_)
        if category.shape != shape:
            raise ShapeError(f"category: expected shape {shape}, got {category.shape}")
        category.setflags(write=False)
        object.__setattr__(self, "category", category)
        if not (self.height_m > 0.0).all() or not np.isfinite(self.height_m + self.speed_mps).all():
            raise ShapeError("world: speeds must be finite, and heights positive and finite")

    def __len__(self) -> int:
        return len(self.boxes)

    @property
    def velocity_mps(self) -> FloatArray:
        """(N, 2) velocities over ground, map frame."""
        yaw = self.boxes.yaw_rad
        return np.column_stack((np.cos(yaw), np.sin(yaw))) * self.speed_mps[:, None]

    @property
    def bottom_m(self) -> FloatArray:
        """(N,) heights of the undersides of the boxes: the ground's at their centres."""
        if self.ground_m is not None:
            return self.ground_m
        return self.surface.elevation_m(self.boxes.center_m, self.boxes.yaw_rad)


_COLUMNS = {
    "speed_mps": np.float64,
    "height_m": np.float64,
    "object_id": np.int64,
    "exists": np.bool_,
    "seen": np.bool_,
}


def reversed_course(odometry: EgoState) -> EgoState:
    """The state of an ego in reverse as that of a vehicle that drives ahead, with its rear in front."""
    return replace(
        odometry,
        yaw_rad=math.remainder(odometry.yaw_rad + math.pi, 2 * math.pi),
        speed_mps=-odometry.speed_mps,
        accel_mps2=-odometry.accel_mps2,
    )
