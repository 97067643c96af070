"""How many points road users would have if nothing else were there."""

from __future__ import annotations

import numpy as np

from scenarios.sensors.lidar.bodies import road_users
from scenarios.sensors.lidar.casting import Motion, RayTable, cast, sectors
from scenarios.sensors.lidar.config import LidarConfig
from scenarios.sensors.lidar.sensor import ray_table
from smartmot.arrays import IntArray, StrArray
from smartmot.pointcloud import Boxes3D


def unhidden_points(
    config: LidarConfig, boxes: Boxes3D, category: StrArray, number: int = 0, above_m: float = 0.0
) -> IntArray:
    """(N,) rays of a cloud that meet each road user within range if it is alone, and nobody moves.

    Args:
        config: the LiDAR; its pitch is left out.
        boxes: of N road users, level frame of the sensor.
        category: (N,) names out of `smartmot.types.CATEGORIES`.
        number: of the cloud.
        above_m: rays that meet it lower over its underside are left out; 0: none.
    """
    table, _ = ray_table(config.pattern.rays(number), 0.0)
    bottom = np.column_stack((boxes.center_m[:, :2], boxes.bottom_m))
    bodies, still = road_users(category, boxes.size_m, bottom, boxes.yaw_rad), Motion(0.0)
    reached = sectors(table, still, bodies)
    counts = np.zeros(len(boxes), dtype=np.int64)
    for body, (first, last) in enumerate(zip(reached.first.tolist(), reached.last.tolist(), strict=True)):
        # the second range lies beyond an azimuth of pi, at the table's beginning
        rows = np.concatenate([np.arange(first[k], last[k]) for k in (1, 0)])
        part = RayTable(table.direction[rows], table.time_s[rows])
        hits = cast(part, still, bodies.take(np.array([body])), None)
        met = (hits.range_m >= config.blind_m) & (hits.range_m <= config.range_m)
        if above_m > 0.0:
            height_m = np.where(met, hits.range_m, 0.0) * part.direction[:, 2]
            met &= height_m >= boxes.bottom_m[body] + above_m
        counts[body] = met.sum()
    return counts
