"""The plain chain on clouds that are made of rectangles."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.arrays import FloatArray
from smartmot.errors import ConfigError, ShapeError
from smartmot.lidar import PlainConfig, detect
from smartmot.lidar.detections import GROUND, OFF_AREA
from smartmot.lidar.plain import least_rectangle, voxels
from smartmot.pointcloud import PointCloud

HEIGHT_M = 1.73


def ground(step_m: float = 0.4) -> FloatArray:
    x, y = np.meshgrid(np.arange(2.0, 38.0, step_m), np.arange(-15.0, 15.0, step_m))
    return np.column_stack((x.ravel(), y.ravel(), np.full(x.size, -HEIGHT_M)))


def block(x: float, y: float, length: float, width: float, height: float, yaw: float = 0.0) -> FloatArray:
    """Points 5 cm apart on the two sides of a block that a sensor at the origin sees."""
    u = np.arange(-0.5 * length, 0.5 * length + 0.01, 0.05)
    v = np.arange(-0.5 * width, 0.5 * width + 0.01, 0.05)
    z = np.arange(0.0, height + 0.01, 0.05) - HEIGHT_M
    near_v = -0.5 * width if y > 0 else 0.5 * width
    rear = np.array([(-0.5 * length, b, c) for b in v for c in z])
    side = np.array([(a, near_v, c) for a in u for c in z])
    local = np.concatenate((rear, side))
    c, s = math.cos(yaw), math.sin(yaw)
    turned = np.column_stack((c * local[:, 0] - s * local[:, 1], s * local[:, 0] + c * local[:, 1]))
    return np.column_stack((turned + np.array([x, y]), local[:, 2]))


SCENE = np.concatenate((ground(), block(12.0, 4.0, 3.9, 1.6, 1.5), block(15.0, -4.0, 0.6, 0.5, 1.75)))


def test_a_car_and_an_adult_are_found_where_they_are() -> None:
    detections = detect(PointCloud(SCENE), PlainConfig())
    assert sorted(detections.category.tolist()) == ["car", "pedestrian"]
    by_class = dict(zip(detections.category.tolist(), detections.boxes.center_m, strict=True))
    # around two sides, rectangles along the sides and along the diagonal have the same area
    assert by_class["car"][:2] == pytest.approx([12.0, 4.0], abs=0.7)
    assert by_class["pedestrian"][:2] == pytest.approx([15.0, -4.0], abs=0.15)
    assert np.count_nonzero(detections.point_cluster == GROUND) >= len(ground())


def test_points_off_the_monitored_area_make_no_boxes() -> None:
    monitored = SCENE[:, 1] < 0.0
    detections = detect(PointCloud(SCENE), PlainConfig(), monitored=monitored)
    assert detections.category.tolist() == ["pedestrian"]
    assert np.count_nonzero(detections.point_cluster == OFF_AREA) > 100
    assert [stage.name for stage in detections.stages] == [
        "voxel grid", "region of interest", "ground plane", "monitored area", "clusters", "rules of size",
    ]  # fmt: skip


@pytest.mark.parametrize("count", [0, 1, 2, 5])
def test_few_points_make_no_boxes(count: int) -> None:
    cloud = PointCloud(SCENE[:count])
    detections = detect(cloud, PlainConfig())
    assert len(detections) == 0
    assert len(detections.point_cluster) == count


@settings(max_examples=40, deadline=None)
@given(
    st.floats(-30.0, 30.0),
    st.floats(-30.0, 30.0),
    st.floats(1.0, 6.0),
    st.floats(0.2, 0.9),
    st.integers(0, 89),
)
def test_the_least_rectangle_of_a_rectangle_is_itself(
    x: float, y: float, length: float, share: float, step: int
) -> None:
    yaw, width = math.radians(2.0 * step), share * length
    t = np.linspace(-0.5, 0.5, 21)
    sides = [np.column_stack((t, np.full(21, k))) for k in (-0.5, 0.5)]
    outline = np.concatenate([*sides, *(side[:, ::-1] for side in sides)]) * (length, width)
    turn = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    middle, extent, heading = least_rectangle(outline @ turn + (x, y))
    assert middle == pytest.approx([x, y], abs=1e-6)
    assert extent == pytest.approx([length, width], abs=1e-6)
    assert math.sin(heading - yaw) == pytest.approx(0.0, abs=1e-6)


@settings(max_examples=40, deadline=None)
@given(st.lists(st.tuples(*[st.floats(-50.0, 50.0)] * 3), min_size=1, max_size=60), st.floats(0.05, 2.0))
def test_voxels_hold_the_points_of_a_cell_and_their_mean(
    points: list[tuple[float, float, float]], edge_m: float
) -> None:
    xyz = np.array(points)
    which, mean = voxels(xyz, edge_m)
    cells = [tuple(row) for row in np.floor(xyz / edge_m).tolist()]
    assert len(mean) == len(set(cells))
    for a, b in zip(range(len(xyz)), range(1, len(xyz)), strict=False):
        assert (cells[a] == cells[b]) == (which[a] == which[b])
    for voxel in range(len(mean)):
        assert mean[voxel] == pytest.approx(xyz[which == voxel].mean(axis=0), abs=1e-9)


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ConfigError, match="lengths must be positive"):
        PlainConfig(voxel_m=0.0)
    with pytest.raises(ConfigError, match="plane_trials"):
        PlainConfig(plane_trials=0)
    with pytest.raises(ConfigError, match="sensor_height_m"):
        detect(PointCloud(SCENE), PlainConfig(), sensor_height_m=-1.0)
    with pytest.raises(ShapeError, match="monitored"):
        detect(PointCloud(SCENE), PlainConfig(), monitored=np.ones(3, dtype=np.bool_))
