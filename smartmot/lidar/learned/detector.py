"""Boxes of a cloud by a network."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.arrays import IntArray
from smartmot.lidar.detections import (
    GROUND,
    OFF_AREA,
    OUT_OF_REACH,
    BoxDetections,
    StageClock,
)
from smartmot.lidar.ground import Ground, ground_under
from smartmot.lidar.learned.network_file import LearnedConfig
from smartmot.lidar.learned.pillars import PillarGrid, Pillars, pillars_of
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
    view = _view(cloud, network.grid, monitored, sensor_height_m, clock)
    seen = view.pillars
    # without any pillar there is nothing to see, and networks may not know a cloud of none
    output = network.run(seen) if len(seen) else np.full(network.decoder.shape, -np.inf, dtype=np.float32)
    clock.note("network", output[0].size, "cells")
    boxes, score, category = network.decoder.decode(output, config.least_scores)
    center = boxes.center_m.copy()
    center[:, 2] += view.ground.level_m(center[:, :2])
    boxes = Boxes3D(center, boxes.size_m, boxes.yaw_rad)
    clock.note("boxes", len(boxes), "boxes")
    rows = np.arange(len(boxes), dtype=np.int64)
    return BoxDetections(boxes, score, category, clock.stages, view.point_cluster, rows)


def seen_in(cloud: PointCloud, grid: PillarGrid) -> Pillars:
    """The pillars that a network with a grid is given of a cloud."""
    return _view(cloud, grid, None, None, StageClock()).pillars


@dataclass(frozen=True, slots=True, eq=False)
class _View:
    """A cloud as a network is given it.

    Args:
        pillars: of it.
        ground: under it.
        point_cluster: (P,) what has become of each point, see `BoxDetections`.
    """

    pillars: Pillars
    ground: Ground
    point_cluster: IntArray


def _view(
    cloud: PointCloud,
    grid: PillarGrid,
    monitored: Monitored | None,
    sensor_height_m: float | None,
    clock: StageClock,
) -> _View:
    """See `detect_learned`."""
    xyz = cloud.xyz_m.astype(np.float64)
    distance = np.hypot(xyz[:, 0], xyz[:, 1])
    reach = math.hypot(max(map(abs, grid.ahead_m)), max(map(abs, grid.left_m)))
    near = np.flatnonzero((distance <= reach) & (xyz[:, 0] >= grid.ahead_m[0]))
    xyz, distance = xyz[near], distance[near]
    ground, height = ground_under(xyz, np.arctan2(xyz[:, 1], xyz[:, 0]), distance, reach, sensor_height_m)
    clock.note("ground", len(near), "points")
    point_cluster = np.full(len(cloud), OUT_OF_REACH, dtype=np.int64)
    if monitored is not None:
        kept = monitored(xyz) if callable(monitored) else monitored[near]
        point_cluster[near[~kept]] = OFF_AREA
        near, xyz, height = near[kept], xyz[kept], height[kept]
        clock.note("monitored area", len(near), "points")
    pillars = pillars_of(xyz, height, grid)
    point_cluster[near[pillars.point]] = GROUND
    clock.note("pillars", len(pillars), "pillars")
    return _View(pillars, ground, point_cluster)
