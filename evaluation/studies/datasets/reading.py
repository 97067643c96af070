"""Frames of data sets with clouds, in the layouts of KITTI, nuScenes and SimBEV."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from evaluation.metrics.detection.pairs import image_overlap
from scenarios.errors import DatasetError
from scenarios.recorded.camera import image_boxes
from scenarios.recorded.classes import read_classes
from scenarios.recorded.clouds.files import read_cloud
from scenarios.recorded.dataset import Objects
from scenarios.recorded.kitti import CATEGORY_OF_TYPE
from scenarios.recorded.kitti_objects.calibration import Calibration, read_calibration
from scenarios.recorded.kitti_objects.labels import DONT_CARE, read_objects
from scenarios.recorded.layouts.kitti import SCENES_TXT, boxes_in_lidar
from scenarios.recorded.layouts.nuscenes import INTENSITY, NUSCENES_SE3_OURS
from scenarios.recorded.layouts.scenes import SPLITS
from scenarios.recorded.layouts.sweeps import points_inside
from scenarios.recorded.nuscenes import CATEGORY_OF_LABEL_CLASS, CLASS_OF_CATEGORY
from scenarios.recorded.nuscenes_records import read_records, referred
from scenarios.recorded.poses import quaternion_yaw, rigid, rotation_matrix, turned_about
from scenarios.recorded.simbev.reader import (
    CATEGORY_OF_CLASS,
    LABELS,
    file_of,
    frame_labels,
    infos_of,
    is_simbev,
    scene_frames,
    simbev_root,
)
from scenarios.recorded.textfile import read_json, read_text
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import BoolArray, FloatArray, IntArray

SIMBEV_CLOUDS = "sweeps/LIDAR"

EIGHT_BITS = 255.0
"""Greatest of whole numbers that sensors give as strengths of echoes (Velodyne, Livox)."""

DONT_CARE_SHARE = 0.5
"""Of a box's outline in the image: where regions without labels cover more, it counts neither way (KITTI)."""


@dataclass(frozen=True, slots=True, eq=False)
class Unlabelled:
    """Where an image has road users that are not labelled: KITTI's DontCare.

    Args:
        regions_px: (R, 4) left, top, right, bottom.
        calibration: of camera and LiDAR.
    """

    regions_px: FloatArray
    calibration: Calibration

    def covers(self, boxes: Boxes3D) -> BoolArray:
        """(K,) whether boxes of the sensor's frame lie there, as the camera sees them."""
        pixels = image_boxes(self.calibration.boxes_to_camera(boxes), self.calibration.projection[2])
        i, j = np.repeat(np.arange(len(boxes)), len(self.regions_px)), np.arange(len(self.regions_px))
        share = image_overlap(self.regions_px[np.tile(j, len(boxes))], pixels[i], of_b=True)
        covered: BoolArray = (
            share.reshape(len(boxes), len(self.regions_px)).max(axis=1, initial=0.0) > DONT_CARE_SHARE
        )
        return covered


@dataclass(frozen=True, slots=True, eq=False)
class DatasetFrame:
    """A frame of a data set.

    Args:
        name: of the frame.
        scene: of which it is; empty where the layout does not say.
        split: out of `SPLITS`, or as the data set calls it.
        cloud: sensor's frame: x ahead, y left, z up.
        labels: K labels, world frame.
        world_SE3_lidar: (4, 4) pose of the sensor.
        written_count: (K,) points in each box, as the data set says; None: it does not.
        unlabelled: regions without labels; None: all is labelled.
        dropped: points of the cloud's file with a value that is not finite.
        greatest_intensity: of an echo, as the layout says it; None: it does not.
    """

    name: str
    scene: str
    split: str
    cloud: PointCloud
    labels: Objects
    world_SE3_lidar: FloatArray  # noqa: N815 - dst_SE3_src is the field's notation
    written_count: IntArray | None
    unlabelled: Unlabelled | None = None
    dropped: int = 0
    greatest_intensity: float | None = None

    @property
    def intensity(self) -> FloatArray:
        """(P,) strengths of the echoes, 0 to 1; 0 where the cloud has none.

        Where the layout does not say the greatest, whole numbers are taken to be of 8 bits.

        Raises:
            DatasetError: they lie outside.
        """
        given = np.zeros(len(self.cloud)) if self.cloud.intensity is None else self.cloud.intensity
        strength = given.astype(np.float64)
        greatest = self.greatest_intensity
        if greatest is None:
            of_bytes = strength.max(initial=0.0) > 1.0 and bool((np.trunc(strength) == strength).all())
            greatest = EIGHT_BITS if of_bytes else 1.0
        if not ((strength >= 0.0) & (strength <= greatest)).all():
            raise DatasetError(
                f"frame {self.name}: intensities from {strength.min():g} to {strength.max():g}: expected "
                f"0 to {greatest:g}; divide them by the greatest that the sensor has"
            )
        return strength / greatest

    @property
    def boxes(self) -> Boxes3D:
        """The K boxes in the sensor's frame."""
        return boxes_in_lidar(self.labels, self.world_SE3_lidar)

    def point_counts(self) -> IntArray:
        """(K,) points in each box."""
        return points_inside(self.labels, self.world_SE3_lidar, self.cloud)


def read_frames(folder: Path) -> Iterator[DatasetFrame]:
    """The frames of a data set, one at a time.

    Raises:
        DatasetError: it is in none of the layouts, or a file is missing or damaged.
    """
    if (folder / "ImageSets").is_dir():
        return _kitti_frames(folder)
    if is_simbev(folder):
        return _simbev_frames(folder)
    tables = [
        path for path in (folder, *sorted(folder.glob("v1.0-*"))) if (path / "sample_data.json").is_file()
    ]
    if tables:
        return _nuscenes_frames(tables[0])
    raise DatasetError(f"{folder}: no data set with clouds; expected ImageSets, v1.0-* or simbev/infos in it")


def _require_possible(labels: Objects, where: str) -> None:
    """See that boxes can be boxes.

    Raises:
        DatasetError: one is not finite, has no size, or is larger than any road user.
    """
    impossible = np.flatnonzero(~labels.usable())
    if len(impossible):
        row = int(impossible[0])
        raise DatasetError(
            f"{where}: label {row} ({labels.kind[row]}): no box of a road user has such numbers"
        )


def layout_of(folder: Path) -> str:
    """Name of the layout of a folder that `read_frames` reads."""
    return "kitti" if (folder / "ImageSets").is_dir() else "simbev" if is_simbev(folder) else "nuscenes"


# ---- KITTI -------------------------------------------------------------------------------------------------


def _kitti_frames(folder: Path) -> Iterator[DatasetFrame]:
    scenes = _kitti_scenes(folder / SCENES_TXT)
    lists = [folder / "ImageSets" / f"{split}.txt" for split in SPLITS]
    if not any(path.is_file() for path in lists):
        raise DatasetError(f"{folder / 'ImageSets'}: none of train.txt, val.txt, test.txt is there")
    for split, path in zip(SPLITS, lists, strict=True):
        for line, text in enumerate(read_text(path).splitlines() if path.is_file() else (), 1):
            name = text.strip()
            if not name:
                continue
            if Path(name).name != name or not name.isprintable():
                raise DatasetError(f"{path}:{line}: {name!r} is no name of a frame")
            part = folder / ("testing" if split == "test" else "training")
            if (part / "label_2" / f"{name}.txt").is_file() or split != "test":
                yield _kitti_frame(part, name, scenes.get(name, ""), split)


def _kitti_scenes(path: Path) -> dict[str, str]:
    """The scene of each frame, where there is a file of them."""
    if not path.is_file():
        return {}
    scenes = {}
    for line, text in enumerate(read_text(path).splitlines(), 1):
        words = text.split(maxsplit=1)
        if len(words) != 2:
            raise DatasetError(f"{path}:{line}: expected FRAME SCENE, got {text!r}")
        scenes[words[0]] = words[1]
    return scenes


def _kitti_frame(part: Path, name: str, scene: str, split: str) -> DatasetFrame:
    calib = read_calibration(part / "calib" / f"{name}.txt")
    lines = read_objects(part / "label_2" / f"{name}.txt")
    regions = lines.image_box_px[lines.type_name == DONT_CARE]
    unlabelled = Unlabelled(regions, calib) if len(regions) else None
    lines = lines.chosen(lines.type_name != DONT_CARE)
    boxes = calib.boxes_to_lidar(lines.camera_box)
    kinds = lines.type_name.tolist()
    labels = Objects.of(
        np.zeros(len(boxes)),
        boxes.center_m[:, :2],
        category=np.array([CATEGORY_OF_TYPE.get(kind, "unknown") for kind in kinds], dtype=np.str_),
        kind=lines.type_name,
        size_m=boxes.size_m[:, :2],
        yaw_rad=boxes.yaw_rad,
        bottom_m=boxes.bottom_m,
        height_m=boxes.size_m[:, 2],
    )
    _require_possible(labels, str(part / "label_2" / f"{name}.txt"))
    named = read_cloud(part / "velodyne" / f"{name}.bin")
    return DatasetFrame(name, scene, split, named.cloud, labels, np.eye(4), None, unlabelled, named.dropped)


# ---- SimBEV ------------------------------------------------------------------------------------------------


def _simbev_frames(folder: Path) -> Iterator[DatasetFrame]:
    root = simbev_root(folder)
    classes = read_classes(folder, CATEGORY_OF_CLASS)
    for path in infos_of(folder):
        split = path.stem.removeprefix("simbev_infos_")
        ego_SE3_lidar = _simbev_lidar(path)
        for scene, frames in scene_frames(path).items():
            for info in frames:
                where = f"{path}: scene {scene}, frame {info['frame']}"
                ego = _pose(info, ("ego2global_translation", "ego2global_rotation"), where)
                file = file_of(root, LABELS, info, "GT_DET", where)
                labels, counts = frame_labels(file, classes)
                _require_possible(labels, str(file))
                named = read_cloud(file_of(root, SIMBEV_CLOUDS, info, "LIDAR", where))
                cloud, pose = _ahead(named.cloud, ego_SE3_lidar)
                name = f"{scene}_{info['frame']:04d}"
                yield DatasetFrame(
                    name, scene, split, cloud, labels, ego @ pose, counts, dropped=named.dropped
                )


def _ahead(cloud: PointCloud, ego_SE3_lidar: FloatArray) -> tuple[PointCloud, FloatArray]:
    """A cloud and the (4, 4) pose of its sensor, turned so that x points as the vehicle's does."""
    yaw = math.atan2(ego_SE3_lidar[1, 0], ego_SE3_lidar[0, 0])
    if yaw == 0.0:
        return cloud, ego_SE3_lidar
    turn = turned_about(2, np.array([yaw]))[0]
    pose = ego_SE3_lidar.copy()
    pose[:3, :3] = ego_SE3_lidar[:3, :3] @ turn.T
    # float64: points on the faces of labels stay on the same side
    return replace(cloud, xyz_m=cloud.xyz_m.astype(np.float64) @ turn.T), pose


def _simbev_lidar(path: Path) -> FloatArray:
    """(4, 4) pose of the LiDAR in the vehicle's frame."""
    content = read_json(path)
    metadata = content.get("metadata") if isinstance(content, dict) else None
    lidar = metadata.get("LIDAR") if isinstance(metadata, dict) else None
    if not isinstance(lidar, dict):
        raise DatasetError(f"{path}: no 'LIDAR' in 'metadata': a data set without clouds")
    return _pose(lidar, ("sensor2ego_translation", "sensor2ego_rotation"), f"{path}: metadata LIDAR")


def _pose(record: dict[str, Any], names: tuple[str, str], where: str) -> FloatArray:
    """(4, 4) pose of a translation and a quaternion."""
    parts = []
    for name, length in zip(names, (3, 4), strict=True):
        value = record.get(name)
        if (
            not isinstance(value, list)
            or len(value) != length
            or not all(type(number) in (int, float) and abs(number) < 1e9 for number in value)
        ):
            raise DatasetError(f"{where}: field {name!r} must be {length} numbers")
        parts.append(np.array(value, dtype=np.float64))
    if not parts[1].any():
        raise DatasetError(f"{where}: field {names[1]!r} must not be 0")
    pose: FloatArray = rigid(rotation_matrix(parts[1])[None], parts[0][None])[0]
    return pose


# ---- nuScenes ----------------------------------------------------------------------------------------------


def _nuscenes_frames(tables: Path) -> Iterator[DatasetFrame]:
    root = tables.parent if tables.name.startswith("v1.0-") else tables
    rows = {
        name: {row["token"]: row for row in read_records(tables, name)}
        for name in ("scene", "sample", "instance", "category", "sensor", "calibrated_sensor", "ego_pose")
    }
    splits = _nuscenes_splits(tables / "splits.json")
    annotations: dict[str, list[dict[str, Any]]] = {}
    for row in read_records(tables, "sample_annotation"):
        annotations.setdefault(row["sample_token"], []).append(row)
    for row in read_records(tables, "sample_data"):
        calibrated = referred(tables, rows["calibrated_sensor"], "sample_data", row, "calibrated_sensor")
        sensor = referred(tables, rows["sensor"], "calibrated_sensor", calibrated, "sensor")
        if sensor["channel"] != "LIDAR_TOP" or not row["is_key_frame"]:
            continue
        sample = referred(tables, rows["sample"], "sample_data", row, "sample")
        scene = referred(tables, rows["scene"], "sample", sample, "scene")["name"]
        ego = referred(tables, rows["ego_pose"], "sample_data", row, "ego_pose")
        where = f"{tables / 'sample_data.json'}: sample {sample['token']}"
        file = row.get("filename")
        if not isinstance(file, str) or not file or Path(file).is_absolute() or ".." in Path(file).parts:
            raise DatasetError(
                f"{where}: field 'filename' must be a path below the data set: it has no cloud"
            )
        fields = ("translation", "rotation")
        pose = _pose(ego, fields, where) @ _pose(calibrated, fields, where) @ NUSCENES_SE3_OURS
        named = read_cloud(root / file)
        cloud = named.cloud
        turned = (cloud.xyz_m @ NUSCENES_SE3_OURS[:3, :3].astype(cloud.xyz_m.dtype)).astype(cloud.xyz_m.dtype)
        own = PointCloud(turned, cloud.intensity, cloud.ring, frame=cloud.frame)
        labels, counts = _nuscenes_labels(tables, rows, annotations.get(sample["token"], []))
        _require_possible(labels, f"{tables / 'sample_annotation.json'}: sample {sample['token']}")
        yield DatasetFrame(
            Path(file).name, scene, splits.get(scene, ""), own, labels, pose, counts,
            dropped=named.dropped, greatest_intensity=INTENSITY,
        )  # fmt: skip


def _nuscenes_splits(path: Path) -> dict[str, str]:
    """The split of each scene, where there is a file of them."""
    if not path.is_file():
        return {}
    content = read_json(path)
    if not isinstance(content, dict) or not all(isinstance(names, list) for names in content.values()):
        raise DatasetError(f"{path}: expected an object with lists of scenes")
    splits: dict[str, str] = {}
    for split, names in content.items():
        for name in map(str, names):
            own = split.removeprefix("smartmot_")
            if splits.setdefault(name, own) != own:
                raise DatasetError(f"{path}: scene {name} is in the splits {splits[name]} and {own}")
    return splits


def _nuscenes_labels(
    tables: Path, rows: dict[str, dict[str, Any]], annotations: list[dict[str, Any]]
) -> tuple[Objects, IntArray | None]:
    kinds = []
    for row in annotations:
        instance = referred(tables, rows["instance"], "sample_annotation", row, "instance")
        kinds.append(referred(tables, rows["category"], "instance", instance, "category")["name"])
    center = np.array([row["translation"] for row in annotations]).reshape(-1, 3)
    size = np.array([row["size"] for row in annotations]).reshape(-1, 3)
    class_of = {name: kind for kind, name in CATEGORY_OF_LABEL_CLASS.items()}
    category_of = {kind: category for category, kind in CLASS_OF_CATEGORY.items()}
    category = [category_of.get(class_of.get(kind, ""), "unknown") for kind in kinds]
    counts = [row.get("num_lidar_pts") for row in annotations]
    labels = Objects.of(
        np.zeros(len(kinds)),
        center[:, :2],
        category=np.array(category, dtype=np.str_),
        kind=np.array(kinds, dtype=np.str_),
        size_m=size[:, [1, 0]],
        yaw_rad=quaternion_yaw(np.array([row["rotation"] for row in annotations]).reshape(-1, 4)),
        bottom_m=center[:, 2] - 0.5 * size[:, 2],
        height_m=size[:, 2],
    )
    known = all(type(count) is int and 0 <= count < 2**31 for count in counts)
    return labels, np.array(counts, dtype=np.int64) if known else None


def dataset_values(folder: Path, name: str) -> dict[str, Any]:
    """What a data set says of itself; empty where there is no such file.

    Raises:
        DatasetError: the file is damaged.
    """
    path = folder / name
    if not path.is_file():
        return {}
    content = read_json(path)
    if not isinstance(content, dict):
        raise DatasetError(f"{path}: expected an object, got {json.dumps(content)[:40]}")
    return content
