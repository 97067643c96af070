"""Points of road users if nothing else were there."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.sensors.lidar import HDL32, HDL64, MID70, LidarConfig, LidarSensor
from scenarios.sensors.lidar.unhidden import unhidden_points
from scenarios.sensors.world import World
from smartmot.pointcloud import Boxes3D
from smartmot.types import Boxes, EgoState


def world(center: np.ndarray, size: np.ndarray, yaw: np.ndarray, category: list[str]) -> World:
    count, everyone = len(center), np.ones(len(center), dtype=np.bool_)
    boxes = Boxes(center, size[:, :2], yaw)
    names = np.array(category)
    return World(0.0, boxes, np.zeros(count), size[:, 2], np.arange(count), names, everyone, everyone)


@pytest.mark.parametrize("config", [HDL32, MID70])
def test_they_are_what_the_sensor_has_of_one_alone(config: LidarConfig) -> None:
    """Ahead, behind across an azimuth of pi, and around the sensor's own place; a van hides a child."""
    center = np.array([[12.0, 1.0], [-15.0, 0.2], [20.0, -6.0], [9.0, -2.7]])
    size = np.array([[4.5, 1.8, 1.5], [1.8, 0.6, 1.8], [0.5, 0.5, 1.2], [5.0, 2.0, 2.1]])
    yaw, category = np.array([0.3, 1.0, 2.0, 0.4]), ["car", "cyclist", "pedestrian", "car"]
    above = np.column_stack((center, 0.5 * size[:, 2] - config.mount.height_m))
    counts = unhidden_points(config, Boxes3D(above, size, yaw), np.array(category))
    ego, sensor = EgoState(0.0, 0.0, 0.0, 0.0, 0.0), LidarSensor(config)
    for row in range(4):
        alone = slice(row, row + 1)
        _, label = sensor.label(world(center[alone], size[alone], yaw[alone], category[alone]), ego)
        assert counts[row] == (label == 0).sum()
    assert counts[0] > 50
    assert (counts[1] > 0) == (config is HDL32)  # the rosette looks ahead
    _, together = sensor.label(world(center, size, yaw, category), ego)
    assert (together == 2).sum() < 0.5 * counts[2]


def test_the_lowest_points_can_be_left_out() -> None:
    """They are those of the sensor's own hits from a height on."""
    size, middle = np.array([[0.5, 0.5, 1.8]]), np.array([[8.0, 0.0, 0.9 - HDL64.mount.height_m]])
    boxes, names = Boxes3D(middle, size, np.zeros(1)), np.array(["pedestrian"])
    everyone = np.ones(1, dtype=np.bool_)
    alone = World(
        0.0, Boxes(middle[:, :2], size[:, :2], np.zeros(1)), np.zeros(1), size[:, 2], np.arange(1), names,
        everyone, everyone,
    )  # fmt: skip
    exact = replace(HDL64, range_sigma_m=0.0, dropout=0.0)
    made, label = LidarSensor(exact).label(alone, EgoState(0.0, 0.0, 0.0, 0.0, 0.0))
    height = made.cloud.xyz_m[label == 0, 2] + HDL64.mount.height_m
    (count,) = unhidden_points(HDL64, boxes, names, above_m=0.5)
    assert count == pytest.approx((height >= 0.5).sum(), abs=2)
    assert 50 < count < 0.95 * len(height)
