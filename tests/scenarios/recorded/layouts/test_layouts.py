"""Recordings written in the layouts of SimBEV and nuScenes, and read again; with clouds and without."""

import json
import math
import os
import subprocess
import sys
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarios.errors import DatasetError
from scenarios.recorded.camera import truncation
from scenarios.recorded.clouds.files import read_cloud
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.kitti_objects.calibration import read_calibration
from scenarios.recorded.kitti_objects.labels import read_objects
from scenarios.recorded.layouts.kitti import KITTI_SWEEPS, boxes_in_lidar, calibration, kitti_files
from scenarios.recorded.layouts.nuscenes import NUSCENES_SWEEPS, REAR_AXLE_M, nuscenes_files, token_of
from scenarios.recorded.layouts.scenes import ScenePlace, split_of_scenes
from scenarios.recorded.layouts.simbev import (
    SIMBEV_SWEEPS,
    corners_of,
    difficulty,
    frame_grid,
    simbev_files,
)
from scenarios.recorded.layouts.sweeps import SweepFiles, boxes_of, swept, with_least_points
from scenarios.recorded.poses import rigid, turned_about
from smartmot.pointcloud import Boxes3D, PointCloud

CATEGORIES = ("car", "pedestrian", "cyclist", "truck", "motorcycle")
Files = Callable[..., Iterable[tuple[str, bytes]]]


def recording(name: str = "run", frames: int = 6, step_s: float = 0.05) -> Sequence:
    """Five road users of all categories around an ego on a bend; the last comes later."""
    rng = np.random.default_rng(7)
    frame = np.repeat(np.arange(frames), len(CATEGORIES))
    identity = np.tile(np.arange(len(CATEGORIES)), frames)
    stays = (identity < 4) | (frame >= 2)
    frame, identity = frame[stays], identity[stays]
    category = np.array(CATEGORIES)[identity]
    time_s = step_s * frame
    labels = Objects.of(
        frame,
        rng.uniform(-50, 50, (5, 2))[identity] + np.column_stack((3.0 * time_s, -2.0 * time_s)),
        object_id=10 + identity,
        category=category,
        kind=category,
        size_m=rng.uniform(0.4, 9, (5, 2))[identity],
        yaw_rad=rng.uniform(-math.pi, math.pi, 5)[identity],
        bottom_m=np.full(len(frame), 0.2),
        height_m=rng.uniform(1, 3, 5)[identity],
        velocity_mps=np.tile((3.0, -2.0), (len(frame), 1)) * (identity != 1)[:, None],
    )
    yaw = 0.1 * np.arange(frames)
    place = np.column_stack((10.0 + 0.4 * np.arange(frames), 20.0 + yaw, np.full(frames, 0.5)))
    return Sequence(
        name=name,
        stamp_s=step_s * np.arange(frames),
        frame_name=tuple(map(str, range(frames))),
        detections=Objects.empty(),
        labels=labels,
        world_SE3_ego=rigid(turned_about(2, yaw), place),
    )


def write(folder: Path, files: Iterable[tuple[str, bytes]]) -> Path:
    for name, content in files:
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def require_same_boxes(read: Sequence, written: Sequence, velocities: bool) -> None:
    """Boxes, identities, times and poses are the same within 1e-6."""
    assert read.labels is not None
    assert written.labels is not None
    assert read.labels.category.tolist() == written.labels.category.tolist()
    assert not read.labels.ignored.any()
    assert read.stamp_s == pytest.approx(written.stamp_s, abs=1e-6)
    for name in ("frame", "center_m", "size_m", "bottom_m", "height_m"):
        assert getattr(read.labels, name) == pytest.approx(getattr(written.labels, name), abs=1e-6), name
    turn = read.labels.yaw_rad - written.labels.yaw_rad
    assert np.cos(turn) == pytest.approx(1.0, abs=1e-12)
    if velocities:
        assert read.labels.velocity_mps == pytest.approx(written.labels.velocity_mps, abs=1e-6)
    # the same object keeps its identity, whatever its number is
    pairs = set(zip(read.labels.object_id.tolist(), written.labels.object_id.tolist(), strict=True))
    assert len(pairs) == len(set(written.labels.object_id.tolist()))


@pytest.mark.parametrize("step_s", [0.05, 0.1, 0.01, 0.5])
def test_simbev_read_again(tmp_path: Path, step_s: float) -> None:
    written = recording(step_s=step_s)
    data = read_dataset(write(tmp_path, simbev_files([written, recording("other", 3)])))
    assert data.kind == "simbev"
    require_same_boxes(data.sequences[0], written, velocities=True)
    assert data.sequences[0].world_SE3_ego == pytest.approx(written.world_SE3_ego, abs=1e-6)
    assert [note.split(":")[1] for note in data.notes] == [
        " labels without post-processing, so those that no sensor point hits count as well"
    ]


def test_simbev_s_labels_have_what_its_tools_ask_for(tmp_path: Path) -> None:
    folder = write(tmp_path, simbev_files([recording()]))
    infos = json.loads((folder / "simbev/infos/simbev_infos_train.json").read_text())
    [frame, *_] = infos["data"]["scene_0000"]["scene_data"]
    assert {"ego2global_translation", "ego2global_rotation", "timestamp", "GT_DET", "scene", "frame"} == set(
        frame
    )
    labels = np.load(folder / frame["GT_DET"], allow_pickle=True)  # as SimBEV's tools do
    assert labels.shape == (4,)
    assert [label["semantic_tags"] for label in labels] == [[14], [12], [19], [15]]
    assert "num_lidar_pts" not in labels[0]
    assert "valid_flag" not in labels[0]


def test_corners_are_in_simbev_s_order() -> None:
    """A car of 4.7 x 1.9 x 1.3 m at (53.5, 60) that drives south, as SimBEV has it."""
    labels = Objects.of(
        np.zeros(1),
        np.array([[53.5, 60.0]]),
        size_m=np.array([[4.7, 1.9]]),
        yaw_rad=np.array([-math.pi / 2]),
        height_m=np.array([1.3]),
    )
    assert corners_of(labels)[0] == pytest.approx(
        np.array([(x, y, z) for y in (62.35, 57.65) for x in (54.45, 52.55) for z in (0.0, 1.3)])
    )


def test_frames_are_numbered_by_the_greatest_step_that_they_have_in_common() -> None:
    whole = recording(frames=4)
    number, _, step_s = frame_grid(replace(whole, stamp_s=np.array([0.02, 0.07, 0.12, 0.17])))
    assert (number.tolist(), step_s) == ([2, 7, 12, 17], 0.01)
    # the instant of a contact is beside the grid
    number, on_grid, step_s = frame_grid(replace(whole, stamp_s=np.array([0.0, 0.05, 0.1, 0.13371])))
    assert (number[on_grid].tolist(), step_s) == ([0, 1, 2], 0.05)
    assert on_grid.tolist() == [True, True, True, False]
    with pytest.raises(DatasetError, match="not at multiples of"):
        frame_grid(replace(whole, stamp_s=np.array([0.0, 0.0333, 0.0667, 0.1])))
    with pytest.raises(DatasetError, match="from 0 on"):
        frame_grid(replace(whole, stamp_s=np.array([-0.1, 0.0, 0.1, 0.2])))


def test_nuscenes_read_again(tmp_path: Path) -> None:
    written = recording()
    folder = write(tmp_path, nuscenes_files([written, recording("other", 3)]))
    for place in (folder, folder / "v1.0-mini"):
        data = read_dataset(place)
        assert data.kind == "nuscenes"
        assert [len(sequence) for sequence in data.sequences] == [6, 3]
        require_same_boxes(data.sequences[0], written, velocities=False)
    pose, center = data.sequences[0].world_SE3_ego, written.world_SE3_ego
    assert pose is not None
    assert center is not None
    ahead = np.einsum("kij,j->ki", pose, (REAR_AXLE_M, 0.0, 0.0, 1.0))
    assert ahead[:, :3] == pytest.approx(center[:, :3, 3], abs=1e-6)


def test_nuscenes_links_and_attributes(tmp_path: Path) -> None:
    folder = write(tmp_path, nuscenes_files([recording()])) / "v1.0-mini"
    tables = {path.stem: json.loads(path.read_text()) for path in folder.glob("*.json")}
    assert set(tables) == {
        *("attribute", "calibrated_sensor", "category", "ego_pose", "instance", "log", "map", "sample"),
        *("sample_annotation", "sample_data", "scene", "sensor", "visibility", "splits"),
    }
    by_token = {row["token"]: row for row in tables["sample_annotation"]}
    assert len(by_token) == 5 * 6 - 2
    for instance in tables["instance"]:
        chain = [by_token[instance["first_annotation_token"]]]
        while chain[-1]["next"]:
            chain.append(by_token[chain[-1]["next"]])
        assert chain[-1]["token"] == instance["last_annotation_token"]
        assert len(chain) == instance["nbr_annotations"]
        assert {row["instance_token"] for row in chain} == {instance["token"]}
    names = {
        token_of("attribute", n): n for n in ("vehicle.moving", "pedestrian.standing", "cycle.with_rider")
    }
    first = [
        row for row in tables["sample_annotation"] if row["sample_token"] == tables["sample"][0]["token"]
    ]
    assert [[names[token] for token in row["attribute_tokens"]] for row in first] == [
        ["vehicle.moving"],
        ["pedestrian.standing"],
        ["cycle.with_rider"],
        ["vehicle.moving"],
    ]
    # unknown, not none: the devkit leaves boxes without points out
    assert {row["num_lidar_pts"] for row in first} == {-1}


def test_nuscenes_scenes_follow_one_another_in_time(tmp_path: Path) -> None:
    """The devkit lists scenes by their times, and fails at equal ones; within a scene nothing moves."""
    later = replace(recording("later", 3), stamp_s=np.array([100.0, 100.1, 100.2]))
    folder = write(tmp_path, nuscenes_files([recording("one", 4), recording("two", 3), later]))
    samples = json.loads((folder / "v1.0-mini/sample.json").read_text())
    stamps = [np.array([s["timestamp"] for s in samples][a:b]) for a, b in ((0, 4), (4, 7), (7, 10))]
    assert stamps[1][0] > stamps[0][-1]
    assert stamps[2].tolist() == [100_000_000, 100_100_000, 100_200_000]  # its own times rise anyway
    assert np.diff(stamps[1]) == pytest.approx(np.diff(recording("two", 3).stamp_s) * 1e6, abs=1.0)


def test_splits_are_by_scene_and_seeded(tmp_path: Path) -> None:
    assert split_of_scenes(1, 0) == ["train"]
    assert sorted(split_of_scenes(8, 0)) == 2 * ["test"] + 4 * ["train"] + 2 * ["val"]
    assert split_of_scenes(8, 3) == split_of_scenes(8, 3)
    assert len({tuple(split_of_scenes(8, seed)) for seed in range(9)}) > 4
    eight = [recording(str(k), 2) for k in range(8)]
    folder = write(tmp_path, [*simbev_files(eight, 3), *nuscenes_files(eight, 3)])
    splits = json.loads((folder / "v1.0-mini/splits.json").read_text())
    for name in ("train", "val", "test"):
        infos = json.loads((folder / f"simbev/infos/simbev_infos_{name}.json").read_text())
        numbers = [int(scene[-4:]) for scene in infos["data"]]
        assert splits[f"smartmot_{name}"] == [f"scene-{number:04d}" for number in numbers]


@pytest.mark.parametrize("files", [simbev_files, nuscenes_files])
def test_equal_recordings_give_equal_bytes_and_others_are_refused(files: Files) -> None:
    whole = recording()
    assert list(files([whole])) == list(files([recording()]))
    with pytest.raises(DatasetError, match="sequence run has no labels"):
        list(files([replace(whole, labels=None)]))
    with pytest.raises(DatasetError, match="sequence run has no ego poses"):
        list(files([replace(whole, world_SE3_ego=None)]))


def cast_labels() -> tuple[Sequence, list[PointCloud]]:
    """The recording with clouds of random points around its labels, some on their faces' level."""
    rng = np.random.default_rng(3)
    written = recording()
    assert written.world_SE3_ego is not None
    assert written.labels is not None
    clouds = []
    for k in range(len(written)):
        labels = written.labels[written.labels.frame == k]
        box = np.repeat(boxes_of(labels).center_m, 200, axis=0)
        world = box + rng.normal(0.0, 1.0, box.shape) * np.repeat(boxes_of(labels).size_m, 200, axis=0)
        pose = written.world_SE3_ego[k] @ LIDAR
        xyz = ((world - pose[:3, 3]) @ pose[:3, :3]).astype(np.float32)
        clouds.append(PointCloud(xyz, rng.random(len(xyz), dtype=np.float32), rng.integers(0, 32, len(xyz))))
    return written, clouds


LIDAR = rigid(turned_about(1, np.array([0.05])), np.array([[0.6, 0.0, 1.8]]))[0]
"""Ahead of the middle, and pitched."""

FIRST = ScenePlace(0, 0, "train")


@pytest.mark.parametrize(
    ("files", "sweeps"), [(simbev_files, SIMBEV_SWEEPS), (nuscenes_files, NUSCENES_SWEEPS)]
)
def test_clouds_are_read_again_and_hold_the_points_that_labels_say(
    files: Files, sweeps: SweepFiles, tmp_path: Path
) -> None:
    written, clouds = cast_labels()
    kept: dict[str, bytes] = {}
    made = swept(written, clouds, LIDAR, lambda k, cloud: kept.update(
        {sweeps.path(FIRST, written, k): sweeps.content(cloud)}))  # fmt: skip
    assert made.sweeps is not None
    assert made.labels is not None
    folder = write(tmp_path, [*kept.items(), *files([made])])
    names = sorted(kept)
    for name, cloud in zip(names, clouds, strict=True):
        xyz = read_cloud(folder / name).cloud.xyz_m
        if files is nuscenes_files:  # x right, y ahead
            xyz = np.column_stack((xyz[:, 1], -xyz[:, 0], xyz[:, 2]))
        assert xyz.tolist() == cloud.xyz_m.tolist()
    # half of the box is one standard deviation divided by two: 200 x 0.383^3
    assert made.sweeps.point_count.tolist() == pytest.approx([200 * 0.383**3] * len(made.labels), abs=15)
    if files is simbev_files:
        infos = json.loads((folder / "simbev/infos/simbev_infos_train.json").read_text())
        frames = infos["data"]["scene_0000"]["scene_data"]
        assert [frame["LIDAR"] for frame in frames] == names
        assert infos["metadata"]["LIDAR"]["sensor2ego_translation"] == [0.6, 0.0, 1.8]
        counts = [
            label["num_lidar_pts"]
            for frame in frames
            for label in np.load(folder / frame["GT_DET"], allow_pickle=True)
        ]
    else:
        tables = folder / "v1.0-mini"
        data = json.loads((tables / "sample_data.json").read_text())
        assert [row["filename"] for row in data] == names
        [sensor] = json.loads((tables / "calibrated_sensor.json").read_text())
        assert sensor["translation"] == pytest.approx([REAR_AXLE_M + 0.6, 0.0, 1.8])
        rows = json.loads((tables / "sample_annotation.json").read_text())
        counts = [row["num_lidar_pts"] for row in rows]
    assert counts == made.sweeps.point_count.tolist()
    with pytest.raises(DatasetError, match="in the same place in all recordings"):
        list(simbev_files([made, written]))


def test_kitti_s_files_are_read_again(tmp_path: Path) -> None:
    written, clouds = cast_labels()
    kept: dict[str, bytes] = {}
    level = rigid(turned_about(2, np.zeros(1)), np.array([[0.6, 0.0, 1.8]]))[0]
    made = swept(written, clouds, level, lambda k, cloud: kept.update(
        {KITTI_SWEEPS.path(FIRST, written, k): KITTI_SWEEPS.content(cloud)}))  # fmt: skip
    assert made.sweeps is not None
    assert made.labels is not None
    assert made.world_SE3_ego is not None
    share = np.linspace(0.0, 1.0, len(made.labels))
    made = replace(made, sweeps=replace(made.sweeps, seen_share=share))
    folder = write(tmp_path, [*kept.items(), *kitti_files([made])])
    assert (folder / "ImageSets/train.txt").read_text().split() == [f"{k:06d}" for k in range(6)]
    assert (folder / "ImageSets/scenes.txt").read_text().splitlines()[5] == "000005 run"
    levels = []
    for k in range(6):
        name = f"{k:06d}"
        read = read_cloud(folder / f"training/velodyne/{name}.bin").cloud
        assert read.xyz_m.tolist() == clouds[k].xyz_m.tolist()
        calib = read_calibration(folder / f"training/calib/{name}.txt")
        lines = read_objects(folder / f"training/label_2/{name}.txt")
        boxes, labels = calib.boxes_to_lidar(lines.camera_box), made.labels[made.labels.frame == k]
        expected = boxes_in_lidar(labels, made.world_SE3_ego[k] @ level)
        assert boxes.center_m == pytest.approx(expected.center_m, abs=1e-9)
        assert boxes.size_m == pytest.approx(expected.size_m, abs=1e-12)
        assert np.cos(boxes.yaw_rad - expected.yaw_rad) == pytest.approx(1.0, abs=1e-12)
        assert set(lines.type_name.tolist()) <= {"Car", "Pedestrian", "Cyclist", "Truck", "Misc"}
        # who is behind the camera is outside the image
        behind = boxes.center_m[:, 0] < 0.0
        assert (lines.truncated[behind] == 1.0).all()
        assert ((lines.truncated >= 0.0) & (lines.truncated <= 1.0)).all()
        levels += lines.occluded.tolist()
    assert levels == [0 if seen >= 0.8 else 1 if seen >= 0.4 else 2 for seen in share]
    with pytest.raises(DatasetError, match="sequence run has no clouds"):
        list(kitti_files([written]))


def test_the_camera_sees_what_is_ahead() -> None:
    """Half of a box that stands on the image's border is outside; one in the middle is inside."""
    calib = calibration()
    edge_m = 20.0 * 609.5593 / 721.5377  # 20 m ahead of the camera
    center = np.array([[20.27, 0.0, -1.0], [20.27, edge_m, -1.0], [20.27, edge_m + 3.0, -1.0]])
    boxes = Boxes3D(center, np.tile((0.01, 2.0, 1.0), (3, 1)), np.zeros(3))
    share = truncation(calib.boxes_to_camera(boxes), calib.projection[2])
    assert share == pytest.approx([0.0, 0.5, 1.0], abs=0.01)


def test_labels_with_few_points_go() -> None:
    written, clouds = cast_labels()
    made = swept(written, clouds, LIDAR, lambda k, cloud: None)
    assert made.sweeps is not None
    assert with_least_points(written, 5) is written
    counts = made.sweeps.point_count
    least = int(np.median(counts))
    fewer = with_least_points(made, least)
    assert fewer.labels is not None
    assert fewer.sweeps is not None
    assert fewer.sweeps.point_count.tolist() == counts[counts >= least].tolist()
    assert 0 < len(fewer.labels) < len(counts)


@pytest.mark.parametrize(
    ("kind", "distance_m", "points", "expected"),
    [  # SimBEV's limits of distance and points: car 30, 60 m and 80, 30; pedestrian 20, 40 m and 40, 20 ...
        ("car", 29.9, 80, "easy"),
        ("car", 30.0, 80, "medium"),
        ("car", 59.9, 30, "medium"),
        ("car", 60.0, 500, "hard"),
        ("car", 10.0, 79, "medium"),
        ("car", 10.0, 29, "hard"),
        ("truck", 39.9, 100, "easy"),
        ("truck", 40.0, 99, "medium"),
        ("bus", 80.0, 100, "hard"),
        ("bus", 10.0, 39, "hard"),
        ("pedestrian", 19.9, 40, "easy"),
        ("pedestrian", 20.0, 40, "medium"),
        ("bicycle", 39.9, 20, "medium"),
        ("motorcycle", 40.0, 40, "hard"),
        ("pedestrian", 1.0, 19, "hard"),
    ],
)
def test_difficulty_is_simbev_s(kind: str, distance_m: float, points: int, expected: str) -> None:
    assert difficulty(kind, distance_m, points) == expected


CHECK = """
import sys
import numpy as np
from nuscenes.nuscenes import NuScenes
from nuscenes.eval.common.data_classes import EvalBoxes
from nuscenes.eval.common.loaders import get_samples_of_custom_split, load_gt_of_sample_tokens
from nuscenes.eval.detection.data_classes import DetectionBox
from nuscenes.utils.splits import get_scenes_of_split

nusc = NuScenes("v1.0-mini", sys.argv[1], verbose=False)
assert len(nusc.scene) == 1 and len(nusc.sample) == 6 and len(nusc.sample_annotation) == 28
sample = nusc.get("sample", nusc.scene[0]["first_sample_token"])
_, boxes, _ = nusc.get_sample_data(sample["data"]["LIDAR_TOP"])
truth = np.array(eval(sys.argv[2]))
assert np.allclose([box.center for box in boxes], truth, atol=1e-6), ([box.center for box in boxes], truth)
moving = nusc.get("sample_annotation", sample["anns"][0])
assert np.allclose(nusc.box_velocity(moving["token"])[:2], (3.0, -2.0), atol=1e-6)
assert get_scenes_of_split("smartmot_train", nusc) == ["scene-0000"]
gt = load_gt_of_sample_tokens(nusc, get_samples_of_custom_split("smartmot_train", nusc), DetectionBox)
assert isinstance(gt, EvalBoxes) and len(gt.all) == 28 and all(box.num_pts == -1 for box in gt.all)
print("opened")
"""

POINTS = """
import sys
from nuscenes.nuscenes import NuScenes
from nuscenes.utils.data_classes import LidarPointCloud
from nuscenes.utils.geometry_utils import points_in_box

nusc = NuScenes("v1.0-mini", sys.argv[1], verbose=False)
counts = 0
for sample in nusc.sample:
    path, boxes, _ = nusc.get_sample_data(sample["data"]["LIDAR_TOP"])
    points = LidarPointCloud.from_file(path).points
    assert points[3].max() <= 255 and points[3].max() > 200
    for box in boxes:
        written = nusc.get("sample_annotation", box.token)["num_lidar_pts"]
        assert points_in_box(box, points[:3]).sum() == written, box
        counts += 1
print("counted", counts)
"""


def devkit_python() -> str | None:
    """An interpreter that has nuscenes-devkit: this one, or the one named in NUSCENES_DEVKIT_PYTHON."""
    for python in (sys.executable, os.environ.get("NUSCENES_DEVKIT_PYTHON", "")):
        if python and not subprocess.run([python, "-c", "import nuscenes"], capture_output=True).returncode:
            return python
    return None


def test_the_devkit_opens_it(tmp_path: Path) -> None:
    python = devkit_python()
    if python is None:
        pytest.skip(
            "nuscenes-devkit is not installed, and NUSCENES_DEVKIT_PYTHON names no Python that has it"
        )
    written = recording()
    labels, pose = written.labels, written.world_SE3_ego
    assert labels is not None
    assert pose is not None
    # boxes of the first frame in the frame of the sensor, which is the rear axle
    first = labels[labels.frame == 0]
    center = np.column_stack((first.center_m, first.bottom_m + 0.5 * first.height_m))
    origin = pose[0, :3, 3] - REAR_AXLE_M * pose[0, :3, 0]
    seen = (center - origin) @ pose[0, :3, :3]
    folder = write(tmp_path, nuscenes_files([written]))
    result = subprocess.run(
        [python, "-c", CHECK, str(folder), repr(seen.tolist())], capture_output=True, text=True
    )
    assert result.stdout.endswith("opened\n"), result.stderr
    folder = tmp_path / "cast"
    written, clouds = cast_labels()
    made = swept(
        written,
        clouds,
        LIDAR,
        lambda k, cloud: write(
            folder, [(NUSCENES_SWEEPS.path(FIRST, written, k), NUSCENES_SWEEPS.content(cloud))]
        ),
    )
    write(folder, nuscenes_files([made]))
    result = subprocess.run([python, "-c", POINTS, str(folder)], capture_output=True, text=True)
    assert result.stdout.endswith("counted 28\n"), result.stderr
