"""Sensors whose x is not ahead: clouds and boxes turned by whole quarters, exactly and back again."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.recorded.clouds.axes import AHEAD, boxes_ahead, boxes_of_sensor, cloud_ahead
from smartmot.pointcloud import Boxes3D, PointCloud


@pytest.mark.parametrize(
    ("ahead", "point"),
    [("x", (3.0, 1.0)), ("y", (1.0, -3.0)), ("-x", (-3.0, -1.0)), ("-y", (-1.0, 3.0))],
)
def test_the_axis_that_is_named_is_ahead(ahead: str, point: tuple[float, float]) -> None:
    """The point (3, 1) of the sensor, by hand: where y is ahead, it is 1 m ahead and 3 m to the right."""
    cloud = PointCloud(np.array([[3.0, 1.0, -0.5]], dtype=np.float32), np.array([7.0]), np.array([4]))
    turned = cloud_ahead(cloud, ahead)
    assert turned.xyz_m.tolist() == [[*point, -0.5]]
    assert turned.xyz_m.dtype == np.float32
    assert turned.intensity is not None
    assert turned.ring is not None
    assert (turned.intensity[0], turned.ring[0]) == (7.0, 4)
    box = boxes_ahead(Boxes3D(np.array([[3.0, 1.0, 0.0]]), np.ones((1, 3)), np.zeros(1)), ahead)
    assert box.center_m[0, :2].tolist() == list(point)


@given(seed=st.integers(0, 1000), ahead=st.sampled_from(AHEAD))
def test_boxes_keep_their_points_and_come_back(seed: int, ahead: str) -> None:
    rng = np.random.default_rng(seed)
    xyz = rng.uniform(-3.0, 3.0, (60, 3))
    size, yaw = rng.uniform(0.5, 4.0, (4, 3)), rng.uniform(-3.0, 3.0, 4)
    boxes = Boxes3D(rng.uniform(-2.0, 2.0, (4, 3)), size, yaw)
    turned = boxes_ahead(boxes, ahead)
    cloud = cloud_ahead(PointCloud(xyz), ahead)
    assert turned.point_counts(cloud.xyz_m).tolist() == boxes.point_counts(xyz).tolist()
    back = boxes_of_sensor(turned, ahead)
    np.testing.assert_array_equal(back.center_m, boxes.center_m)
    np.testing.assert_allclose(np.cos(back.yaw_rad - yaw), 1.0)
    assert (np.abs(turned.yaw_rad) <= math.pi).all()
