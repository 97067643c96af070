"""Scenes of data sets: scans of their own, occlusion, runs and splits."""

from pathlib import Path

import numpy as np
import pytest

from evaluation.errors import ArgumentError
from evaluation.studies.datasets.compose import Composer
from evaluation.studies.datasets.frames import LabelledFrame, _seen_share
from evaluation.studies.datasets.make import Recipe, make_dataset
from evaluation.studies.datasets.scenarios import ScenarioFrames, unbraked_runs
from evaluation.studies.datasets.streets import Streets
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import DatasetError
from scenarios.recorded.layouts.scenes import ScenePlace, scene_places
from scenarios.sensors.lidar import HDL64, MID70, LidarConfig, LidarSensor
from scenarios.sensors.world import World
from smartmot.pointcloud import Boxes3D
from smartmot.types import Boxes, EgoState

SIZES = {"pedestrian": (0.5, 0.55, 1.75), "car": (4.4, 1.8, 1.5), "cyclist": (1.8, 0.6, 1.75)}


@pytest.mark.parametrize("config", [HDL64, MID70])
@pytest.mark.parametrize("category", list(SIZES))
def test_who_stands_alone_is_not_occluded(config: LidarConfig, category: str) -> None:
    """Range noise puts points outside the box, and a rosette has other rays in every scan."""
    size, everyone, rng = np.array([SIZES[category]]), np.ones(1, dtype=np.bool_), np.random.default_rng(4)
    names, shares = np.array([category]), []
    for scan in range(8):
        place, yaw = np.array([[rng.uniform(8.0, 20.0), 0.0]]), rng.uniform(-3.0, 3.0, 1)
        time_s = scan / config.pattern.rate_hz
        boxes = Boxes(place, size[:, :2], yaw)
        world = World(time_s, boxes, np.zeros(1), size[:, 2], np.arange(1), names, everyone, everyone)
        cloud = LidarSensor(config, scan).measure(world, EgoState(time_s, 0.0, 0.0, 0.0, 0.0)).cloud
        middle = np.column_stack((place, 0.5 * size[:, 2] - config.mount.height_m))
        frame = LabelledFrame(cloud, Boxes3D(middle, size, yaw), names, (0.0, 0.0, 0.0, 0.0), scan)
        shares.append(float(_seen_share(frame, config, np.zeros(1, dtype=np.int64))[0]))
    assert len(shares) == 8
    assert min(shares) >= 0.8


def test_a_rosette_goes_on_from_frame_to_frame() -> None:
    """Frames of streets have other rays each, as clouds that follow one another."""
    streets = Streets((shipped_map("urban_street"),), MID70, 1)
    frames = list(streets.frames(ScenePlace(1, 4, "train"), 2))
    assert [frame.scan for frame in frames] == [4, 5]
    expected = [MID70.pattern.rays(scan).direction for scan in (4, 5)]
    for frame, rays, others in zip(frames, expected, expected[::-1], strict=True):
        xyz = frame.cloud.xyz_m[::200].astype(np.float64)
        along = xyz / np.linalg.norm(xyz, axis=1)[:, None]
        assert (along @ rays.T).max(axis=1).mean() > 1.0 - 1e-9
        assert (along @ others.T).max(axis=1).mean() < 1.0 - 1e-8


def test_no_run_is_in_two_splits() -> None:
    runs = unbraked_runs(("cpna", "cbla", "cpla"))
    maker, used = ScenarioFrames(runs, HDL64, 1), dict[str, set[int]]()
    for place in scene_places([4] * 100, 1):
        own = maker._runs(place.split)
        used.setdefault(place.split, set()).add(runs.index(own[place.number_in_split % len(own)]))
    assert set(used) == {"train", "val", "test"}
    assert sum(map(len, used.values())) == len(set().union(*used.values())) == min(len(runs), 100)


def test_too_few_runs_to_hold_some_back_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    maker = ScenarioFrames(unbraked_runs(("cpna",))[:2], HDL64, 1)
    with pytest.raises(ArgumentError, match="2 runs are too few for the split test"):
        make_dataset(Recipe(maker, "kitti", 40, 1, 1, {}), tmp_path / "data")
    assert not (tmp_path / "data").exists()


def test_crops_without_a_split_are_refused_before_anything_is_written(tmp_path: Path) -> None:
    source = tmp_path / "crops"
    (source / "ImageSets").mkdir(parents=True)
    (source / "ImageSets/train.txt").write_text("")
    with pytest.raises(DatasetError, match="split test has no pedestrian, cyclist or car"):
        make_dataset(Recipe(Composer(HDL64, 1, source), "kitti", 40, 1, 1, {}), tmp_path / "data")
    assert not (tmp_path / "data").exists()
