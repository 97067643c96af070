"""The classical detector on simulated streets: what is found, how steadily, and how honest its scores are."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from evaluation.metrics.detection.calibration import calibration_error
from evaluation.studies.lidar.drawn import CLASSES, drawn_frames
from scenarios.sensors.lidar import SENSORS, LidarConfig, LidarSensor, Mount, Spinning
from scenarios.sensors.world import World
from smartmot.arrays import FloatArray
from smartmot.errors import ConfigError
from smartmot.lidar import BoxDetections, ClassicalConfig, detect
from smartmot.pointcloud import PointCloud
from smartmot.pointcloud.boxes import overlaps
from smartmot.types import Boxes, EgoState

MAPS = sorted((Path(__file__).parents[3] / "scenarios" / "maps").glob("*.xodr"))
ADULT_M = (0.6, 0.5, 1.8)
"""Euro NCAP's target, ISO 19206-2."""


def front(name: str) -> LidarConfig:
    config = SENSORS[name]
    if isinstance(config.pattern, Spinning):
        config = replace(config, pattern=replace(config.pattern, field_rad=1.2))
    return config


def world_of(category: str, size: tuple[float, float, float], x: float, y: float, yaw: float) -> World:
    boxes = Boxes(np.array([[x, y]]), np.array([size[:2]]), np.array([yaw]))
    everyone = np.ones(1, dtype=np.bool_)
    names = np.array([category])
    return World(0.0, boxes, np.zeros(1), np.array([size[2]]), np.arange(1), names, everyone, everyone)


def seen(config: LidarConfig, world: World, seed: int, height_m: float = 1.73) -> PointCloud:
    sensor = LidarSensor(replace(config, mount=Mount(height_m)), seed)
    return sensor.measure(world, EgoState(0.0, 0.0, 0.0, 0.0, 0.0)).cloud


def adults(name: str) -> Iterator[BoxDetections]:
    """A standing adult at 20 m, anywhere within a step of the grid, with other noise each time."""
    rng = np.random.default_rng(5)
    config = front(name)
    for seed in range(20):
        # beside the axis of a rosette: on it scores are low, since few clouds of the fit have people there
        x, y = np.array([19.7, 3.4]) + rng.uniform(-0.1, 0.1, 2)
        cloud = seen(config, world_of("pedestrian", ADULT_M, x, y, 0.5 * math.pi), seed)
        detections = detect(cloud, ClassicalConfig(least_score=0.02))
        assert detections.category.tolist() == ["pedestrian"]
        yield replace_center(detections, x, y)


def replace_center(detections: BoxDetections, x: float, y: float) -> BoxDetections:
    """The same box, relative to the truth."""
    boxes = detections.boxes
    return replace(detections, boxes=replace(boxes, center_m=boxes.center_m - (x, y, 0.0)))


@pytest.mark.parametrize("name", ["hdl32", "hdl64", "mid70"])
def test_a_standing_adult_at_20_m_stands(name: str) -> None:
    places = np.concatenate([each.boxes.center_m[:, :2] for each in adults(name)])
    assert (places.std(axis=0) <= 0.05).all()
    assert np.abs(places.mean(axis=0)).max() < 0.10


@pytest.mark.parametrize(
    ("category", "size", "y", "yaw"),
    [
        ("car", (4.4, 1.8, 1.5), 2.5, 0.0),
        ("car", (4.4, 1.8, 1.5), -3.0, 0.5),
        ("car", (4.4, 1.8, 1.5), 0.0, 1.6),
        ("cyclist", (1.8, 0.6, 1.8), -2.0, 0.1),
        ("cyclist", (1.8, 0.6, 1.8), 1.0, 1.5),
        ("pedestrian", ADULT_M, 3.0, 1.0),
    ],
)
def test_road_users_in_the_open_are_found_where_they_are(
    category: str, size: tuple[float, float, float], y: float, yaw: float
) -> None:
    world = world_of(category, size, 15.0, y, yaw)
    detections = detect(seen(front("hdl64"), world, 3), ClassicalConfig(least_score=0.05))
    assert detections.category.tolist() == [category]
    truth = replace(detections.boxes, center_m=np.array([[15.0, y, 0.5 * size[2] - 1.73]]),
                    size_m=np.array([size]), yaw_rad=np.array([yaw]))  # fmt: skip
    assert overlaps(truth, detections.boxes)[0][0, 0] > (0.5 if category == "car" else 0.3)


@pytest.mark.parametrize("height_m", [0.9, 1.3, 2.2])
def test_the_height_of_the_sensor_comes_from_the_cloud(height_m: float) -> None:
    cloud = seen(front("hdl64"), world_of("pedestrian", ADULT_M, 12.0, 1.0, 1.0), 1, height_m)
    for mount in (None, 1.73):
        detections = detect(cloud, ClassicalConfig(), sensor_height_m=mount)
        assert detections.category.tolist() == ["pedestrian"]
        assert detections.boxes.bottom_m == pytest.approx([-height_m], abs=0.1)


def test_a_completed_box_does_not_flip_while_its_object_turns() -> None:
    """The middle of a car moves by no more than a few centimetres per degree."""
    places = []
    for degree in range(0, 181, 3):
        world = world_of("car", (4.4, 1.8, 1.5), 15.0, 1.0, math.radians(degree))
        detections = detect(seen(front("hdl64"), world, 1), ClassicalConfig(least_score=0.02))
        best = int(detections.score.argmax())
        assert detections.category[best] == "car"
        places.append(detections.boxes.center_m[best, :2])
    steps = np.hypot(*np.diff(np.array(places), axis=0).T)
    assert np.median(steps) < 0.1
    assert np.abs(np.array(places) - (15.0, 1.0)).max() < 1.0


def test_points_off_the_monitored_area_make_no_boxes() -> None:
    cloud = seen(front("hdl64"), world_of("pedestrian", ADULT_M, 12.0, 1.0, 1.0), 1)
    monitored = cloud.xyz_m[:, 1] < 0.0
    detections = detect(cloud, ClassicalConfig(), monitored=monitored)
    assert len(detections) == 0
    assert "monitored area" in [stage.name for stage in detections.stages]


@pytest.mark.parametrize("count", [0, 1, 2, 3, 10])
def test_few_points_make_no_boxes(count: int) -> None:
    xyz = np.random.default_rng(0).uniform(5.0, 5.2, (count, 3))
    detections = detect(PointCloud(xyz), ClassicalConfig())
    assert len(detections.point_cluster) == count


def test_equal_clouds_give_equal_boxes_whatever_the_order_of_their_points() -> None:
    frame = next(drawn_frames(MAPS, front("hdl64"), 1, 7))
    first = detect(frame.cloud, ClassicalConfig())
    again = detect(frame.cloud, ClassicalConfig())
    assert np.array_equal(first.boxes.center_m, again.boxes.center_m)
    order = np.random.default_rng(1).permutation(len(frame.cloud))
    turned = detect(frame.cloud[order], ClassicalConfig())
    assert sorted(turned.category.tolist()) == sorted(first.category.tolist())


def test_scores_are_probabilities_on_streets_that_they_were_not_fitted_to() -> None:
    """Expected calibration error of all classes together, over three sensors."""
    score: list[FloatArray] = []
    right = []
    for number, name in enumerate(SENSORS):
        for frame in drawn_frames(MAPS, front(name), 14, 77 + number):
            detections = detect(frame.cloud, ClassicalConfig())
            for category in CLASSES:
                rows, own = detections.category == category, frame.category == category
                if rows.any():
                    overlap = overlaps(detections.boxes[rows], frame.boxes[own])[0].max(axis=1, initial=0.0)
                    score.append(detections.score[rows])
                    right.append(overlap > (0.5 if category == "car" else 0.3))
    scores = np.concatenate(score)
    assert len(scores) > 100
    # 0.1 is asked for; with so few boxes chance alone adds about 0.05
    assert calibration_error(scores, np.concatenate(right)) < 0.15


def test_what_cannot_be_is_refused() -> None:
    with pytest.raises(ConfigError, match="lengths must be positive"):
        ClassicalConfig(reach_m=0.0)
    with pytest.raises(ConfigError, match="top_m must exceed"):
        ClassicalConfig(top_m=0.2)
    with pytest.raises(ConfigError, match="least_score"):
        ClassicalConfig(least_score=1.5)
