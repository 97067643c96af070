"""What detections of a cloud are kept by."""

from dataclasses import replace

import numpy as np

from scenarios.sensors.lidar import BARE, HDL32
from scenarios.sensors.lidar.chain import RunLidar
from scenarios.sensors.world import World
from smartmot.types import Boxes, EgoState


def test_heights_of_the_ground_are_part_of_it() -> None:
    """On a bridge and below it all else is the same."""
    everyone = np.ones(1, dtype=np.bool_)
    boxes = Boxes(np.array([[10.0, 0.0]]), np.array([[0.5, 0.5]]), np.zeros(1))
    world = World(
        0.0, boxes, np.zeros(1), np.array([1.8]), np.arange(1), np.array(["pedestrian"]), everyone, everyone
    )
    lidar, ego = RunLidar(HDL32, 1, lambda: BARE), EgoState(0.0, 0.0, 0.0, 0.0, 0.0)
    worlds = (
        world,
        replace(world, ground_m=np.array([6.0])),
        replace(world, ground_m=np.array([0.0])),
        replace(world, ego_ground_m=6.0),
    )
    assert len({lidar.key(each, ego) for each in worlds}) == len(worlds)
    assert lidar.key(replace(world), ego) == lidar.key(world, ego)
