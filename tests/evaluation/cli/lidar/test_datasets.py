"""Data sets of labelled clouds: made, read again, checked; damaged ones are one line."""

import base64
import hashlib
import json
import shutil
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
    assert said["map"] == ["urban_street.xodr"]


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
    assert call(*MAKE[:-2], 5, "-q", "--workers", 1, "--layout", layout, "--out", tmp_path)[0] == 0
    code, _, error = call("check", tmp_path)
    assert (code, error) == (0, "")
    made = sorted(read_frames(tmp_path), key=lambda frame: (frame.scene, frame.name))
    ours = sorted(read_frames(kitti), key=lambda frame: frame.name)[:5]
    for frame, same in zip(made, ours, strict=True):
        assert frame.split == "train"  # two scenes are too few to hold one back
        assert frame.cloud.xyz_m.tobytes() == same.cloud.xyz_m.tobytes()
        assert frame.boxes.center_m == pytest.approx(same.boxes.center_m, abs=1e-6)
        assert np.cos(frame.boxes.yaw_rad - same.boxes.yaw_rad) == pytest.approx(1.0, abs=1e-9)
        assert frame.labels.category.tolist() == same.labels.category.tolist()
        assert frame.written_count is not None
        assert frame.written_count.tolist() == same.point_counts().tolist()


@pytest.mark.parametrize("yaw_deg", [5.0, 90.0, -160.0])
def test_a_lidar_of_simbev_may_be_turned_on_its_mount(yaw_deg: float, tmp_path: Path, call: Call) -> None:
    """Clouds are given with x ahead all the same, where detectors look; labels hold the same points."""
    assert call(*MAKE[:-2], 2, "-q", "--workers", 1, "--layout", "simbev", "--out", tmp_path)[0] == 0
    straight = list(read_frames(tmp_path))
    half, yaw = 0.5 * np.radians(yaw_deg), np.radians(yaw_deg)
    for path in tmp_path.glob("simbev/infos/*.json"):
        content = json.loads(path.read_text())
        content["metadata"]["LIDAR"]["sensor2ego_rotation"] = [np.cos(half), 0.0, 0.0, np.sin(half)]
        path.write_text(json.dumps(content))
    back = np.array([[np.cos(yaw), np.sin(yaw), 0.0], [-np.sin(yaw), np.cos(yaw), 0.0], [0.0, 0.0, 1.0]])
    for path in tmp_path.glob("simbev/sweeps/LIDAR/*.npz"):
        with np.load(path) as archive:
            np.savez(path, data=archive["data"].astype(np.float64) @ back.T)
    for frame, same in zip(read_frames(tmp_path), straight, strict=True):
        np.testing.assert_allclose(frame.cloud.xyz_m, same.cloud.xyz_m, atol=1e-5)
        np.testing.assert_allclose(frame.boxes.center_m, same.boxes.center_m, atol=1e-9)
        assert np.cos(frame.boxes.yaw_rad - same.boxes.yaw_rad) == pytest.approx(1.0, abs=1e-12)
    assert call("check", tmp_path)[0] == 0


def test_crops_of_a_data_set_in_its_own_frames(kitti: Path, tmp_path: Path, call: Call) -> None:
    composed = ("--from", "crops", "--crops", kitti, "--background", kitti, "--flip", "--scale", 0.1)
    assert call(*MAKE[:3], "--frames", 4, "-q", *composed, "--workers", 1, "--out", tmp_path)[0] == 0
    assert call("check", tmp_path)[0] == 0
    train = [len(frame.labels) for frame in read_frames(kitti) if frame.split == "train"]
    assert sum(len(frame.labels) for frame in read_frames(tmp_path)) > 4 * min(train)
    assert json.loads((tmp_path / "dataset.json").read_text())["crops"] == "data"


def test_frames_of_scenarios(tmp_path: Path, call: Call) -> None:
    """Three runs of one shipped scenario and one of another, each on a street of its own."""
    words = ("--scenario", "cbla,cpna", "--frames", 13, "--layout", "simbev", "--min-points", 0)
    assert call(*MAKE[:3], "-q", "--workers", 1, *words, "--out", tmp_path)[0] == 0
    frames = list(read_frames(tmp_path))
    assert len(frames) == 13
    assert call("check", tmp_path, "--min-points", 0)[0] == 0
    by_scene = {frame.scene: set(frame.labels.category.tolist()) for frame in frames}
    assert "cyclist" in by_scene["scene_0000"]
    assert "pedestrian" in by_scene["scene_0003"]
    ego = [tuple(frame.world_SE3_lidar[:2, 3]) for frame in frames]
    assert len(set(ego)) == 13
    split_of = {frame.scene: frame.split for frame in frames}
    assert sorted(split_of.values()) == ["test", "train", "train", "val"]


def test_clouds_are_shown(kitti: Path, tmp_path: Path, call: Call) -> None:
    code, out, _ = call("show", kitti, "--scene", "0001", "--mode", "bev", "--frames", 1, "--out", tmp_path)
    assert (code, out) == (0, f"{tmp_path / '000004.png'}\n")
    assert (tmp_path / "000004.png").read_bytes()[:4] == b"\x89PNG"
    assert call("show", kitti, "--mode", "page", "--out", tmp_path, "-q")[0] == 0
    page = (tmp_path / "clouds.html").read_text()
    data = json.loads(page.split('type="application/json">')[1].split("</script>")[0])
    frames = list(read_frames(kitti))[:8]
    assert [len(frame["boxes"]) for frame in data["frames"]] == [len(frame.labels) for frame in frames]
    points = (
        np.frombuffer(base64.b64decode(data["frames"][0]["points"]), "<i2").reshape(-1, 3) / data["units"]
    )
    assert np.abs(points - frames[0].cloud.xyz_m).max() < 0.006


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("show", "{data}", "--scene", "0099"), "--scene: no '0099' in {data}; there are: scene_0000"),
        (("show", "{data}", "--mode", "rgb"), "--mode: unknown 'rgb'; use one of: bev, page"),
        (("check", "{data}/nothing"), "{data}/nothing: no data set with clouds"),
        (("make", "--out", "{data}"), "ImageSets is there already; name another folder or remove it"),
        (("make", "--from", "gazebo"), "--from: unknown 'gazebo'; use one of: scenes, crops"),
        (("make", "--flip"), "--flip: has no effect with --from scenes; it is for crops"),
        (
            ("make", "--from", "crops", "--map", "x.xodr"),
            "--map: has no effect with --from crops; it is for scenes",
        ),
        (("make", "--scenario", "cpna", "--from", "crops"), "--scenario: has no effect with --from crops"),
        (("make", "--scenario", "no.xosc"), "no.xosc"),
        (("make", "--height", "9"), "--height: expected 0.1 to 5 m, got 9"),
        (("make", "--sensor", "truth"), "--sensor: unknown 'truth'; use one of: hdl32, hdl64, mid70"),
        (("make", "--frames", "1", "--workers", "1", "--map", "{data}/no.xodr"), "no.xodr"),
        (
            ("make", "--from", "crops", "--background", "{data}", "--height", "1.5"),
            "--background: its sensor is at 1.73 m; add --height 1.73",
        ),
    ],
)
def test_mistakes_are_one_line(
    words: tuple[str, ...], message: str, kitti: Path, tmp_path: Path, call: Call
) -> None:
    arguments = [word.format(data=kitti) for word in words]
    if words[0] != "check" and "--out" not in arguments:
        arguments += ["--out", str(tmp_path / "out")]
    code, _, error = call(*arguments)
    assert code == 2
    assert message.format(data=kitti) in error
    assert error.count("\n") == 1


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("training/velodyne/{first}.bin", b"12345", "no whole number of points"),
        ("training/velodyne/{first}.bin", None, "No such file"),
        ("training/label_2/{first}.txt", b"Car 0 0", "field"),
        ("training/calib/{first}.txt", b"P2: 1 2 3", "P2"),
        ("training/label_2/{first}.txt", None, "No such file"),
        ("ImageSets/train.txt", b"../../secret\n", "is no name of a frame"),
        ("ImageSets/scenes.txt", b"000000\n", "expected FRAME SCENE"),
        ("dataset.json", b"[]", "expected an object"),
        ("dataset.json", b'{"min_points": "many"}', "must be a whole number"),
    ],
)
def test_damaged_data_sets_are_one_line(
    name: str, content: bytes | None, message: str, kitti: Path, tmp_path: Path, call: Call
) -> None:
    folder = tmp_path / "data"
    shutil.copytree(kitti, folder)
    [first, *_] = (kitti / "ImageSets/train.txt").read_text().split()
    path = folder / name.format(first=first)
    if content is None:
        path.unlink()
    else:
        path.write_bytes(content)
    code, _, error = call("check", folder)
    assert code == 2
    assert path.name in error
    assert message in error
    assert error.count("\n") == 1


def test_what_is_wrong_in_a_readable_data_set_is_found(kitti: Path, tmp_path: Path, call: Call) -> None:
    folder = tmp_path / "data"
    shutil.copytree(kitti, folder)
    splits = folder / "ImageSets"
    [first, *_] = (splits / "train.txt").read_text().split()
    with (splits / "val.txt").open("a") as val:
        val.write(f"{first}\n")
    label = folder / "training/label_2" / f"{first}.txt"
    words = label.read_text().splitlines()[0].split()
    words[11] = "500"  # x: half a kilometre to the right
    with label.open("a") as lines:
        lines.write(" ".join(words) + "\n")
    cloud = folder / "training/velodyne" / f"{first}.bin"
    rows = np.frombuffer(cloud.read_bytes(), dtype="<f4").reshape(-1, 4).copy()
    rows[:, 3] *= 3.0
    rows[0, 0] = np.nan
    cloud.write_bytes(rows.tobytes())
    code, _, error = call("check", folder)
    assert code == 1
    assert f"{first}: 1 points with a value that is not finite" in error
    assert f"frame {first}: intensities from 0" in error
    assert "expected 0 to 1; divide them by the greatest that the sensor has" in error
    assert f"{first}: is in train and in val" in error
    assert "holds 0 points, 1 at least expected" in error
    assert "its frames are in train and val" in error
