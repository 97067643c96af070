"""How many points road users would have if nothing else were there."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from scenarios.sensors.lidar.bodies import road_users
from scenarios.sensors.lidar.casting import Motion, RayTable, caster, sectors
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
    slope, rows = table.slope, []
    for body, (first, last) in enumerate(zip(reached.first.tolist(), reached.last.tolist(), strict=True)):
        # the second range lies beyond an azimuth of pi, at the table's beginning
        own = np.concatenate([np.arange(first[k], last[k]) for k in (1, 0)])
        low, high = reached.low_slope[body], reached.high_slope[body]
        rows.append(own[(slope[own] >= low) & (slope[own] <= high)])
    if not rows:
        return np.zeros(0, dtype=np.int64)
    # rays of one body after those of another, and each body is tried with its own alone
    row, count = np.concatenate(rows), np.array([len(own) for own in rows])
    last = np.column_stack((np.cumsum(count), np.zeros_like(count)))
    tried = replace(reached, first=last - np.column_stack((count, np.zeros_like(count))), last=last)
    own_rays = RayTable(table.direction[row], np.zeros(len(row)))
    range_m = caster(None)(own_rays, still, bodies, -math.inf, tried).range_m
    met = (range_m >= config.blind_m) & (range_m <= config.range_m)
    of_body = np.repeat(np.arange(len(boxes)), count)
    if above_m > 0.0:
        height_m = np.where(met, range_m, 0.0) * own_rays.direction[:, 2]
        met &= height_m >= boxes.bottom_m[of_body] + above_m
    counts: IntArray = np.bincount(of_body[met], minlength=len(boxes))
    return counts
