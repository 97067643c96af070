"""`smartmot-eval lidar detect` and `bench`: files that scores, trackers and drives read, and mistakes."""

from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

import numpy as np
import pytest

from evaluation.cli import main
from scenarios.recorded.clouds.arrays import bin_bytes
from scenarios.recorded.kitti_objects.calibration import read_calibration
from scenarios.recorded.kitti_objects.labels import read_objects
from scenarios.sensors.lidar import HDL32, LidarSensor
from scenarios.sensors.world import World
from smartmot.pointcloud import PointCloud
from smartmot.types import Boxes, EgoState

Capture = pytest.CaptureFixture[str]
ADULT_M, CAR_M = (0.6, 0.5, 1.8), (4.4, 1.8, 1.5)
CALIBRATION = """P2: 700 0 600 0 0 700 180 0 0 0 1 0
R0_rect: 1 0 0 0 1 0 0 0 1
Tr_velo_to_cam: 0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27
"""


def call(*arguments: object) -> int:
    """Run the command in this process; its exit status."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
        with pytest.raises(SystemExit) as ended:
            main()
    return int(ended.value.code or 0)


def rows_of(path: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(path.read_text().splitlines()))


@pytest.fixture(scope="module")
def velodyne(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Eight clouds of an adult and a car that stand, 0.1 s apart."""
    folder = tmp_path_factory.mktemp("drive") / "velodyne"
    folder.mkdir()
    boxes = Boxes(np.array([[10.0, -1.0], [15.0, 3.0]]), np.array([ADULT_M[:2], CAR_M[:2]]), np.zeros(2))
    everyone = np.ones(2, dtype=np.bool_)
    sensor = LidarSensor(HDL32, 1)
    for number in range(8):
        time_s = 0.1 * number
        world = World(
            time_s, boxes, np.zeros(2), np.array([ADULT_M[2], CAR_M[2]]), np.arange(2),
            np.array(["pedestrian", "car"]), everyone, everyone,
        )  # fmt: skip
        cloud = sensor.measure(world, EgoState(time_s, 0.0, 0.0, 0.0, 0.0)).cloud
        (folder / f"{number:06d}.bin").write_bytes(bin_bytes(cloud))
    (folder.parent / "calib.txt").write_text(CALIBRATION)
    return folder


def test_boxes_are_written_for_scores_trackers_and_drives(
    velodyne: Path, tmp_path: Path, capsys: Capture
) -> None:
    calib, out = velodyne.parent / "calib.txt", tmp_path / "out"
    assert call("lidar", "detect", velodyne, "--calib", calib, "--out", out) == 0
    assert "8 clouds" in capsys.readouterr().out
    rows = rows_of(out / "detections.csv")
    assert {(row["frame"], row["category"]) for row in rows} == {
        (str(frame), category) for frame in range(8) for category in ("pedestrian", "car")
    }
    lines = read_objects(out / "kitti", results=True, scored=True)
    assert len(lines) == len(rows)
    boxes = read_calibration(calib).boxes_to_lidar(lines.camera_box)
    assert np.sort(boxes.center_m[:, 0]) == pytest.approx(sorted(float(row["ahead_m"]) for row in rows))
    assert (lines.image_box_px[:, 2] > lines.image_box_px[:, 0]).all()
    assert call("mot", out, "--out", tmp_path / "mot") == 0
    ego = "stamp_s,x_m,y_m,yaw_rad\n".replace("stamp_s", "frame") + "".join(f"{k},0,0,0\n" for k in range(8))
    (out / "ego.csv").write_text(ego)
    assert call("drive", out, "--strategy", "path", "--out", tmp_path / "drive", "-q") == 0
    assert (tmp_path / "drive" / "drives.csv").is_file()


def test_one_command_detects_tracks_and_scores(velodyne: Path, tmp_path: Path, capsys: Capture) -> None:
    calib, labels = velodyne.parent / "calib.txt", tmp_path / "labels.txt"
    calibration = read_calibration(calib)
    from smartmot.pointcloud import Boxes3D

    center = np.array([[10.0, -1.0, 0.9 - 1.73], [15.0, 3.0, 0.75 - 1.73]])
    camera = calibration.boxes_to_camera(Boxes3D(center, np.array([ADULT_M, CAR_M]), np.zeros(2)))
    labels.write_text(
        "".join(
            f"{frame} {k} {kind} 0 0 0 100 100 200 200 {' '.join(f'{v:.6f}' for v in camera[k])}\n"
            for frame in range(8)
            for k, kind in enumerate(("Pedestrian", "Car"))
        )
        + "7 -1 DontCare -1 -1 -10 0 0 1 1 -1000 -1000 -1000 -10 -1 -1 -1\n"
    )
    out = tmp_path / "out"
    arguments = ("--calib", calib, "--track", "--labels", labels, "--out", out)
    assert call("lidar", "detect", velodyne, *arguments) == 0
    assert "Tracking accuracy" in capsys.readouterr().out
    assert {row["category"] for row in rows_of(out / "labels.csv")} == {"pedestrian", "car"}
    assert {row["track_id"] for row in rows_of(out / "tracks.csv")}


def test_stages_are_shown_with_arrays_and_a_picture(velodyne: Path, tmp_path: Path, capsys: Capture) -> None:
    for method in ("classical", "plain"):
        out = tmp_path / method
        cloud = velodyne / "000000.bin"
        assert call("lidar", "detect", cloud, "--method", method, "--stages", "--out", out) == 0
        text = capsys.readouterr().out
        assert "ground" in text
        assert "Host" in text
        arrays = np.load(out / "stages" / "000000.npz")
        assert len(arrays["point_cluster"]) == len(arrays["xyz_m"])
        assert (out / "stages" / "000000.png").stat().st_size > 10_000
        line = (out / "kitti" / "000000.txt").read_text().split()
        assert line[4:8] == ["0"] * 4  # no calibration, no image


def test_bench_says_milliseconds_by_stage(velodyne: Path, capsys: Capture) -> None:
    assert call("lidar", "bench", velodyne / "000000.bin", "--method", "classical,plain", "--rounds", 1) == 0
    text = capsys.readouterr().out
    assert text.count("processor time") == 2
    assert "features" in text


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("--method", "magic"), "--method: unknown 'magic'"),
        (("--method", "plain", "--score-min", "0.5"), "--score-min: all boxes of plain have score 1"),
        (("--labels", "x.txt"), "--labels: has no effect without --track; add it"),
    ],
)
def test_mistakes_are_one_line(
    velodyne: Path, tmp_path: Path, capsys: Capture, arguments: tuple[str, ...], message: str
) -> None:
    assert call("lidar", "detect", velodyne, "--out", tmp_path, *arguments) != 0
    error = capsys.readouterr().err
    assert message in error
    assert "Traceback" not in error


def test_labels_in_the_place_of_detections_are_refused_by_line(tmp_path: Path, capsys: Capture) -> None:
    box = "0 0 0 100 100 200 200 1.5 1.6 3.9 1.0 1.7 10.0 -1.4"
    labels, results = tmp_path / "labels", tmp_path / "results"
    for folder, lines in ((labels, f"Car {box}\n"), (results, f"Car {box}\nDontCare {box}\n")):
        folder.mkdir()
        (folder / "000000.txt").write_text(lines)
    assert call("lidar", "score", labels, results) == 2
    assert f"{results / '000000.txt'}:2: field 'type' is a region of label files" in capsys.readouterr().err
    (results / "000000.txt").write_text(f"Car {box}\n")
    assert call("lidar", "score", labels, results) == 2
    assert f"{results / '000000.txt'}:1: field 'score' is missing" in capsys.readouterr().err
    assert call("lidar", "score", labels, results, "--protocol", "thesis") == 0


def test_several_files_are_taken_one_after_the_other(velodyne: Path, tmp_path: Path, capsys: Capture) -> None:
    one, two = velodyne / "000003.bin", velodyne / "000001.bin"
    assert call("lidar", "detect", one, two, "--out", tmp_path / "out") == 0
    assert {row["frame"] for row in rows_of(tmp_path / "out" / "detections.csv")} == {"1", "3"}
    assert call("lidar", "bench", one, two, "--rounds", 1) == 0
    assert "2 clouds" in capsys.readouterr().out
    assert call("lidar", "detect", one, velodyne, "--out", tmp_path / "again") == 2
    assert "two clouds are named 000003" in capsys.readouterr().err


def test_a_cloud_without_points_is_not_converted(tmp_path: Path, capsys: Capture) -> None:
    (tmp_path / "empty.bin").write_bytes(b"")
    assert call("lidar", "convert", tmp_path / "empty.bin", tmp_path / "empty.pcd") == 2
    assert "no points to convert" in capsys.readouterr().err
    assert not (tmp_path / "empty.pcd").exists()
    for command in ("detect", "bench"):
        assert call("lidar", command, tmp_path / "empty.bin") == 2
        assert "empty.bin: no cloud has a point" in capsys.readouterr().err


def test_what_clouds_lack_is_said_by_detect_and_bench(tmp_path: Path, capsys: Capture) -> None:
    rng = np.random.default_rng(1)
    points = np.column_stack((rng.normal(0.0, 9.0, (300, 3)), rng.random(300))).astype("<f4")
    lost, afar = points.copy(), points.copy()
    lost[:7, 2] = np.nan
    afar[:, :2] *= 1000.0  # millimetres
    for name, rows in (("1.bin", lost), ("2.bin", afar), ("3.bin", points[:0]), ("4.bin", points[:1])):
        (tmp_path / name).write_bytes(rows.tobytes())
    for command in (("detect", "--out", tmp_path / "out"), ("bench", "--rounds", 1)):
        assert call("lidar", command[0], tmp_path, *command[1:], "--method", "pillars") == 0
        _, errors = capsys.readouterr()
        assert "points with a value that is not finite dropped (1 clouds)" in errors
        assert "half of the points are over 500 m away: expected metres in the sensor's frame" in errors
        assert "clouds without points (1 clouds)" in errors
        assert errors.count("\n") == 3


def test_a_cloud_far_from_any_road_user_has_no_boxes(tmp_path: Path) -> None:
    angle = np.linspace(-0.5, 0.5, 200)
    flat = np.column_stack((10.0 * np.cos(angle), 10.0 * np.sin(angle), np.full(200, -math.sqrt(3.0))))
    (tmp_path / "a.bin").write_bytes(bin_bytes(PointCloud(flat)))
    assert call("lidar", "detect", tmp_path / "a.bin", "--out", tmp_path / "out", "-q") == 0
    assert (tmp_path / "out" / "kitti" / "a.txt").read_text() == ""
    assert rows_of(tmp_path / "out" / "detections.csv") == []


def sweep(velodyne: Path, path: Path) -> Path:
    """The first cloud as a raw sweep of nuScenes: x right, y ahead."""
    rows = np.fromfile(velodyne / "000000.bin", dtype="<f4").reshape(-1, 4)
    raw = np.column_stack((-rows[:, 1], rows[:, 0], rows[:, 2], 255.0 * rows[:, 3], 0.0 * rows[:, 0]))
    path.parent.mkdir(parents=True, exist_ok=True)
    raw.astype("<f4").tofile(path)
    return path


@pytest.mark.parametrize("method", ["classical", "plain", "pillars"])
def test_sweeps_of_nuscenes_are_looked_at_ahead(
    velodyne: Path, tmp_path: Path, method: str, capsys: Capture
) -> None:
    """A network sees nothing behind and little aside: with x to the right it would look to the right."""
    pytest.importorskip("onnxruntime")
    raw = sweep(velodyne, tmp_path / "raw" / "000000.pcd.bin")
    words = ("--method", method)
    assert call("lidar", "detect", velodyne / "000000.bin", *words, "--out", tmp_path / "a") == 0
    assert ("the network looked from 0 to 44.8 m ahead, 28.8 m to the left" in capsys.readouterr().out) == (
        method == "pillars"
    )
    assert call("lidar", "detect", raw, *words, "--out", tmp_path / "b") == 0
    assert "the sensor's y points ahead: clouds and boxes turned" in capsys.readouterr().err
    rows, turned = (rows_of(tmp_path / name / "detections.csv") for name in "ab")
    assert rows
    assert turned == rows
    # the same in a file that does not say it
    assert call("lidar", "convert", raw, tmp_path / "c.bin") == 0
    assert call("lidar", "detect", tmp_path / "c.bin", *words, "--ahead", "y", "--out", tmp_path / "c") == 0
    again = [{**row, "frame": "0"} for row in rows_of(tmp_path / "c" / "detections.csv")]
    assert again == rows


def test_a_calibration_is_of_the_sensor_as_it_is_mounted(velodyne: Path, tmp_path: Path) -> None:
    raw = sweep(velodyne, tmp_path / "raw" / "000000.pcd.bin")
    (tmp_path / "calib.txt").write_text(
        CALIBRATION.replace("0 -1 0 0 0 0 -1 -0.08 1 0 0 -0.27", "1 0 0 0 0 0 -1 -0.08 0 1 0 -0.27")
    )
    first, calib = velodyne / "000000.bin", velodyne.parent / "calib.txt"
    assert call("lidar", "detect", first, "--calib", calib, "--out", tmp_path / "a") == 0
    assert call("lidar", "detect", raw, "--calib", tmp_path / "calib.txt", "--out", tmp_path / "b") == 0
    lines, turned = (read_objects(tmp_path / name / "kitti", results=True, scored=True) for name in "ab")
    assert len(lines) == 2
    assert turned.type_name.tolist() == lines.type_name.tolist()
    np.testing.assert_allclose(turned.camera_box, lines.camera_box, atol=1e-9)
    np.testing.assert_allclose(turned.image_box_px, lines.image_box_px, atol=1e-6)


def test_bench_turns_sweeps_too_and_no_other_axis_is_ahead(
    velodyne: Path, tmp_path: Path, capsys: Capture
) -> None:
    raw = sweep(velodyne, tmp_path / "raw" / "000000.pcd.bin")
    assert call("lidar", "bench", velodyne / "000000.bin", "--rounds", 1) == 0
    # lines break where the widths of times let them
    counted = [" ".join(capsys.readouterr().out.split()).partition("boxes of all: ")[2]]
    assert call("lidar", "bench", raw, "--rounds", 1) == 0
    counted.append(" ".join(capsys.readouterr().out.split()).partition("boxes of all: ")[2])
    assert counted[0] == counted[1] != ""
    assert call("lidar", "detect", raw, "--ahead", "z", "--out", tmp_path / "out") == 2
    assert "--ahead: unknown 'z'; use one of: x, y, -x, -y" in capsys.readouterr().err
