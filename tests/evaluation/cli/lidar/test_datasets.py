"""Data sets of labelled clouds: made, read again, checked; damaged ones are one line."""

import hashlib
import json
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from evaluation.cli import main
from evaluation.studies.datasets.reading import read_frames
from scenarios.catalogue.maps import shipped_map

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture(name="call")
def _call(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> Call:
    """Run a command as the console script does; exit code, output and errors."""

    def call(*arguments: object) -> tuple[int, str, str]:
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", "lidar", "dataset", *map(str, arguments)])
        with pytest.raises(SystemExit) as stop:
            main()
        return int(stop.value.code or 0), *capsys.readouterr()

    return call


def digest(folder: Path) -> dict[str, str]:
    return {
        path.relative_to(folder).as_posix(): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


MAKE = ("make", "--sensor", "mid70", "--map", shipped_map("urban_street"), "--frames", 10, "-q")


@pytest.fixture(scope="module", name="kitti")
def _kitti(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set in KITTI's layout; tests that change it copy it."""
    folder = tmp_path_factory.mktemp("kitti") / "data"
    before, sys.argv = sys.argv, ["smartmot-eval", "lidar", "dataset", *map(str, MAKE), "--out", str(folder),
                                  "--workers", "1"]  # fmt: skip
    with pytest.raises(SystemExit) as stop:
        main()
    sys.argv = before
    assert not stop.value.code
    return folder


def test_bytes_are_the_same_for_any_number_of_workers(kitti: Path, tmp_path: Path, call: Call) -> None:
    assert call(*MAKE, "--workers", 2, "--out", tmp_path)[0] == 0
    assert digest(tmp_path) == digest(kitti)
    assert len(digest(kitti)) == 3 * 10 + 5  # clouds, labels, calibrations; ImageSets and dataset.json


def test_kitti_s_tree_is_split_by_scene(kitti: Path) -> None:
    names = {
        split: (kitti / f"ImageSets/{split}.txt").read_text().split() for split in ("train", "val", "test")
    }
    assert sorted(name for frames in names.values() for name in frames) == [f"{k:06d}" for k in range(10)]
    for split, frames in names.items():
        part = "testing" if split == "test" else "training"
        for name in frames:
            assert (kitti / part / "velodyne" / f"{name}.bin").is_file()
            assert (kitti / part / "label_2" / f"{name}.txt").is_file()
        # four frames of one street each, the last street has two
        assert {int(name) // 4 for name in frames}.isdisjoint(
            {int(name) // 4 for other in names if other != split for name in names[other]}
        )
    said = json.loads((kitti / "dataset.json").read_text())
    assert said["frames"] == {split: len(frames) for split, frames in names.items()}
    assert said["sensor_height_m"] == 1.73


def test_every_label_holds_its_points_and_is_on_the_ground(kitti: Path, call: Call) -> None:
    frames = list(read_frames(kitti))
    assert len(frames) == 10
    assert sum(len(frame.labels) for frame in frames) > 30
    for frame in frames:
        assert frame.point_counts().min(initial=1) >= 1
        # streets have kerbs of 12 cm
        assert frame.boxes.bottom_m.min(initial=-1.73) > -1.74
        assert frame.boxes.bottom_m.max(initial=-1.73) < -1.5
    code, out, error = call("check", kitti)
    assert (code, error) == (0, "")
    assert "every label holds 1 points or more" in out
    code, _, error = call("check", kitti, "--min-points", 1000)
    assert code == 1
    assert "points, 1000 at least expected" in error
    assert error.splitlines()[-1].endswith(" more")


@pytest.mark.parametrize("layout", ["nuscenes", "simbev"])
def test_layouts_hold_the_same(layout: str, kitti: Path, tmp_path: Path, call: Call) -> None:
    assert call(*MAKE, "--layout", layout, "--out", tmp_path)[0] == 0
    code, _, error = call("check", tmp_path)
    assert (code, error) == (0, "")
    made = sorted(read_frames(tmp_path), key=lambda frame: (frame.scene, frame.name))
    ours = sorted(read_frames(kitti), key=lambda frame: frame.name)
    for frame, same in zip(made, ours, strict=True):
        assert frame.split == same.split
        assert frame.cloud.xyz_m.tobytes() == same.cloud.xyz_m.tobytes()
        assert frame.boxes.center_m == pytest.approx(same.boxes.center_m, abs=1e-6)
        assert np.cos(frame.boxes.yaw_rad - same.boxes.yaw_rad) == pytest.approx(1.0, abs=1e-9)
        assert frame.labels.category.tolist() == same.labels.category.tolist()
        assert frame.written_count is not None
        assert frame.written_count.tolist() == same.point_counts().tolist()
