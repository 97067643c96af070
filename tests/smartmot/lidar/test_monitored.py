"""Points on a monitored area."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from smartmot.arrays import BoolArray, FloatArray, StrArray
from smartmot.lidar import ClassicalConfig, PlainConfig, detect
from smartmot.lidar.monitored import CELL_M, points_on
from smartmot.pointcloud import PointCloud
from smartmot.types import Boxes

from .test_plain import SCENE

POINTS = arrays(np.float64, st.tuples(st.integers(0, 40), st.just(2)), elements=st.floats(-60.0, 60.0))
WITHIN_M = 2.0 * CELL_M
"""How far off its edge an area is asked for: a cell beside one that is kept, and half of that cell more."""


@given(POINTS, st.floats(-50.0, 50.0), st.floats(-3.0, 3.0))
def test_points_beyond_a_straight_edge_are_dropped_and_those_on_the_area_stay(
    xy_m: FloatArray, offset_m: float, turn_rad: float
) -> None:
    normal = np.array([np.cos(turn_rad), np.sin(turn_rad)])

    def keeps(boxes: Boxes, category: StrArray) -> BoolArray:
        assert set(category.tolist()) == {"pedestrian"}
        inside: BoolArray = boxes.center_m @ normal <= offset_m
        return inside

    beyond_m = xy_m @ normal - offset_m
    on_area = points_on(keeps, xy_m)
    assert on_area[beyond_m <= 0.0].all()
    assert not on_area[beyond_m > WITHIN_M * np.sqrt(2.0)].any()


@pytest.mark.parametrize(
    "config", [ClassicalConfig(least_score=0.0), PlainConfig()], ids=["classical", "plain"]
)
def test_an_area_may_be_a_mask_or_be_asked(config: ClassicalConfig | PlainConfig) -> None:
    """The second is asked for no point on the ground."""
    asked = []

    def left_half(xyz_m: FloatArray) -> BoolArray:
        asked.append(len(xyz_m))
        left: BoolArray = xyz_m[:, 1] > 0.0
        return left

    cloud = PointCloud(SCENE)
    found = detect(cloud, config, monitored=left_half)
    masked = detect(cloud, config, monitored=left_half(cloud.xyz_m))
    assert 0 < asked[0] < len(cloud)
    assert len(found) > 0
    np.testing.assert_array_equal(found.boxes.center_m, masked.boxes.center_m)
    np.testing.assert_array_equal(found.point_cluster, masked.point_cluster)
