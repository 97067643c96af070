"""`lidar quality`: right and false boxes of a detector, and regions without labels."""

import shutil
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest

from evaluation.cli import main
from evaluation.metrics.detection.from_above import ScoredBoxes
from evaluation.studies.datasets.reading import read_frames
from evaluation.studies.detectors.quality import QualityOptions, Truth, measured_quality
from scenarios.recorded.kitti_objects.calibration import Calibration, calibration_text
from smartmot.lidar import ClassicalConfig
from smartmot.pointcloud import Boxes3D, PointCloud

Call = Callable[..., tuple[int, str, str]]

CALIBRATION = Calibration(
    np.tile([[700.0, 0.0, 620.0, 0.0], [0.0, 700.0, 187.0, 0.0], [0.0, 0.0, 1.0, 0.0]], (4, 1, 1)),
    np.eye(3),
    np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]]),
)
PLACES = ((10.0, 1.0), (14.0, -3.0))


@pytest.fixture(name="call")
def _call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", "lidar", "quality", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        return int(stop.value.code or 0), *capsys.readouterr()

    return call


def street() -> PointCloud:
    """Level ground and two people on it, seen from 1.7 m."""
    rng = np.random.default_rng(1)
    x, y = (v.ravel() for v in np.meshgrid(np.arange(3.0, 40.0, 0.25), np.arange(-15.0, 15.0, 0.25)))
    parts = [np.column_stack((x, y, np.full(len(x), -1.7)))]
    for px, py in PLACES:
        angle, up = rng.uniform(0.0, 2.0 * np.pi, 200), rng.uniform(0.0, 1.75, 200)
        parts.append(np.column_stack((px + 0.25 * np.cos(angle), py + 0.25 * np.sin(angle), up - 1.7)))
    return PointCloud(np.concatenate(parts).astype(np.float32))


def people(*places: tuple[float, float]) -> Boxes3D:
    center = [(x, y, 0.875 - 1.7) for x, y in places]
    return Boxes3D(np.array(center), np.tile((0.5, 0.5, 1.75), (len(places), 1)), np.zeros(len(places)))


def right_and_false(boxes: Mapping[str, ScoredBoxes]) -> tuple[int, int]:
    counts = boxes["pedestrian"].counts(0.0)
    return counts.true_positives, counts.false_positives


def test_who_has_no_label_is_false_unless_nothing_is_labelled_there() -> None:
    labels, names = people(PLACES[0]), np.array(["pedestrian"])
    truth = Truth(street(), labels, names)
    boxes, account = measured_quality([truth], ClassicalConfig(least_score=0.0), QualityOptions())
    assert account.clouds == 1
    assert len(account.stages) == len(account.spent_s) == 1
    assert right_and_false(boxes) == (1, 1)

    def around(found: Boxes3D) -> np.ndarray:
        return np.hypot(*(found.center_m[:, :2] - PLACES[1]).T) < 1.0

    truth = Truth(street(), labels, names, around)
    boxes, _ = measured_quality([truth], ClassicalConfig(least_score=0.0), QualityOptions())
    assert right_and_false(boxes) == (1, 0)
    boxes, _ = measured_quality(
        [truth], ClassicalConfig(least_score=0.0), QualityOptions(range_m=(12.0, 40.0))
    )
    assert boxes["pedestrian"].labels == 0
    assert right_and_false(boxes) == (0, 0)


def written(folder: Path, with_region: bool) -> Path:
    """A data set in KITTI's layout: one of the people labelled, the other at most in a region."""
    for name in ("velodyne", "label_2", "calib"):
        (folder / "training" / name).mkdir(parents=True)
    (folder / "ImageSets").mkdir()
    (folder / "ImageSets" / "val.txt").write_text("000007\n")
    (folder / "training" / "calib" / "000007.txt").write_text(calibration_text(CALIBRATION))
    cloud = street()
    rows = np.column_stack((cloud.xyz_m, np.zeros(len(cloud)))).astype("<f4")
    (folder / "training" / "velodyne" / "000007.bin").write_bytes(rows.tobytes())
    camera = CALIBRATION.boxes_to_camera(people(PLACES[0]))[0]
    text = "Pedestrian 0 0 0 500 100 600 300 " + " ".join(f"{v:.4f}" for v in camera) + "\n"
    if with_region:
        text += "DontCare -1 -1 -10 700 150 850 300 -1 -1 -1 -1000 -1000 -1000 -10\n"
    (folder / "training" / "label_2" / "000007.txt").write_text(text)
    return folder


def test_regions_of_kitti_are_where_the_camera_sees_them(tmp_path: Path) -> None:
    (frame,) = read_frames(written(tmp_path / "data", True))
    assert frame.unlabelled is not None
    assert frame.unlabelled.covers(people(*PLACES)).tolist() == [False, True]
    assert frame.unlabelled.covers(people(PLACES[1])[[False]]).tolist() == []


def test_the_table_counts_and_regions_count_neither_way(tmp_path: Path, call: Call) -> None:
    lines = []
    for with_region in (False, True):
        folder = tmp_path / f"data_{with_region}"
        code, text, _ = call(written(folder, with_region), "--method", "classical", "--score", 0)
        assert code == 0
        (line,) = (line.split() for line in text.splitlines() if line.startswith("pedestrian"))
        lines.append(line[3:6])
        assert "ms of processor time a cloud: region of interest " in text
        shutil.rmtree(folder)
    assert lines == [["1", "1", "1"], ["1", "1", "0"]]


def test_what_cannot_be_counted_is_one_line(tmp_path: Path, call: Call) -> None:
    folder = written(tmp_path / "data", False)
    assert "nothing lies between them" in call(folder, "--from", 9, "--to", 8)[2]
    code, _, errors = call(folder, "--split", "train")
    assert (code, errors.count("\n")) == (2, 1)
    assert "no frame of the splits train" in errors
