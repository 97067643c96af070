"""Frames of data sets that are damaged in ways that look sound."""

import json
from pathlib import Path

import numpy as np
import pytest

from evaluation.studies.datasets.compose import Composer
from evaluation.studies.datasets.reading import DatasetFrame, _nuscenes_splits
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Objects
from scenarios.recorded.layouts.scenes import ScenePlace
from scenarios.sensors.lidar import HDL64
from smartmot.pointcloud import PointCloud


def test_a_scene_in_two_splits_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "splits.json"
    path.write_text(json.dumps({"smartmot_train": ["a", "b"], "val": ["c"]}))
    assert _nuscenes_splits(path) == {"a": "train", "b": "train", "c": "val"}
    path.write_text(json.dumps({"smartmot_train": ["a", "b"], "smartmot_test": ["b"]}))
    with pytest.raises(DatasetError, match="scene b is in the splits train and test"):
        _nuscenes_splits(path)


def test_echoes_of_backgrounds_have_the_unit_of_those_that_are_pasted(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """nuScenes' strengths are 0 to 255, ours 0 to 1."""
    xyz = np.array([[10.0, 0.0, -1.7], [-20.0, 0.0, -1.7]], dtype=np.float32)
    frames = [
        DatasetFrame("f", "s", "train", PointCloud(xyz, np.array(given)), Objects.empty(), np.eye(4), None)
        for given in ([51.0, 255.0], [0.2, 1.0])
    ]
    assert [frame.intensity.tolist() for frame in frames] == [[0.2, 1.0]] * 2
    monkeypatch.setattr("evaluation.studies.datasets.compose._backgrounds", lambda folder, split: frames[:1])
    composer, place = Composer(HDL64, 1, background=Path("data")), ScenePlace(0, 0, "train")
    ground = composer._ground(place, 0, np.random.default_rng(1))
    assert ground.cloud.intensity is not None
    assert ground.cloud.intensity.tolist() == pytest.approx([0.2, 1.0])


@pytest.mark.parametrize(
    ("given", "greatest", "wanted"),
    [
        ([0.0, 0.25, 1.0], None, [0.0, 0.25, 1.0]),
        ([0.0, 51.0, 255.0], None, [0.0, 0.2, 1.0]),  # whole numbers of 8 bits
        ([0.0, 0.5, 1.0], 255.0, [0.0, 0.5 / 255.0, 1.0 / 255.0]),  # a dark cloud of nuScenes
        (None, None, [0.0, 0.0, 0.0]),
    ],
)
def test_strengths_of_echoes_are_shares(
    given: list[float] | None, greatest: float | None, wanted: list[float]
) -> None:
    intensity = None if given is None else np.array(given)
    cloud = PointCloud(np.ones((3, 3)), intensity)
    frame = DatasetFrame(
        "a", "", "train", cloud, Objects.empty(), np.eye(4), None, greatest_intensity=greatest
    )
    assert frame.intensity == pytest.approx(wanted)


@pytest.mark.parametrize("given", [[0.0, 0.5, 1.02], [0.0, 7.0, 40_000.0], [0.0, -3.0, 9.0]])
def test_strengths_without_a_known_unit_are_one_line(given: list[float]) -> None:
    cloud = PointCloud(np.ones((3, 3)), np.array(given))
    frame = DatasetFrame("a", "", "train", cloud, Objects.empty(), np.eye(4), None)
    with pytest.raises(DatasetError, match=r"frame a: intensities from .*: expected 0 to (1|255); divide"):
        _ = frame.intensity
