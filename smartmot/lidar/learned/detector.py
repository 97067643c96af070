"""Boxes of a cloud by a network."""

from __future__ import annotations

import numpy as np

from smartmot.lidar.detections import GROUND, OFF_AREA, OUT_OF_REACH, BoxDetections, StageClock
from smartmot.lidar.ground import ground_under
from smartmot.lidar.learned.network_file import LearnedConfig
from smartmot.lidar.learned.pillars import pillars_of
from smartmot.lidar.monitored import Monitored
from smartmot.pointcloud import Boxes3D, PointCloud


def detect_learned(
    cloud: PointCloud,
    config: LearnedConfig,
    *,
    monitored: Monitored | None = None,
    sensor_height_m: float | None = None,
) -> BoxDetections:
    """Boxes of a cloud by a network, sensor's frame; they lie in the field of the network's grid.

    Args:
        cloud: P points.
        config: the network.
        monitored: points that the network may see, as for `smartmot.lidar.detect`; None: all. The ground is
            found by all of them.
        sensor_height_m: as the mount says it; the cloud has the last word.

    Raises:
        ConfigError: the network cannot be loaded.
    """
    network = config.network
    clock = StageClock()
    xyz = cloud.xyz_m.astype(np.float64)
    distance = np.hypot(xyz[:, 0], xyz[:, 1])
    reach = float(np.hypot(network.grid.ahead_m[1], max(map(abs, network.grid.left_m))))
    near = np.flatnonzero((distance <= reach) & (xyz[:, 0] >= network.grid.ahead_m[0]))
    xyz, distance = xyz[near], distance[near]
    ground, height = ground_under(xyz, np.arctan2(xyz[:, 1], xyz[:, 0]), distance, reach, sensor_height_m)
    clock.note("ground", len(near), "points")
    point_cluster = np.full(len(cloud), OUT_OF_REACH, dtype=np.int64)
    if monitored is not None:
        kept = monitored(xyz) if callable(monitored) else monitored[near]
        point_cluster[near[~kept]] = OFF_AREA
        near, xyz, height = near[kept], xyz[kept], height[kept]
        clock.note("monitored area", len(near), "points")
    seen = pillars_of(xyz, height, network.grid)
    point_cluster[near[seen.point]] = GROUND
    clock.note("pillars", len(seen), "pillars")
    # without any pillar there is nothing to see, and networks may not know a cloud of none
    output = network.run(seen) if len(seen) else np.full(network.decoder.shape, -np.inf, dtype=np.float32)
    clock.note("network", output[0].size, "cells")
    boxes, score, category = network.decoder.decode(output, config.least_score)
    center = boxes.center_m.copy()
    center[:, 2] += ground.level_m(center[:, :2])
    boxes = Boxes3D(center, boxes.size_m, boxes.yaw_rad)
    clock.note("boxes", len(boxes), "boxes")
    return BoxDetections(
        boxes, score, category, clock.stages, point_cluster, np.arange(len(boxes), dtype=np.int64)
    )
