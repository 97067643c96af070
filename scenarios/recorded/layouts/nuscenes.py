"""Recordings in the layout of nuScenes: the tables of a version, as its devkit and `scenarios.recorded` read.

Every frame is a sample. With a LiDAR there are its clouds, in nuScenes' axes (x right, y ahead), and the
points in each box. Without one LIDAR_TOP stands for the poses, at the ego's origin, without a file, and the
points in a box are -1, the devkit's own number for unknown (0 would leave the box out). The ego's pose is
that of the middle of the rear axle, as nuScenes has it.

Source of tables and fields: nuscenes-devkit, docs/schema_nuscenes.md; of `splits.json`: utils/splits.py.
"""

from __future__ import annotations

import base64
import hashlib
import json
from collections import defaultdict
from collections.abc import Iterator
from collections.abc import Sequence as Many
from dataclasses import replace
from typing import Any

import numpy as np

from scenarios.recorded.clouds.arrays import bin_bytes
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.layouts.scenes import SPLITS, quaternion_of, split_of_scenes, truth_of
from scenarios.recorded.layouts.sweeps import SweepFiles, boxes_of
from scenarios.recorded.nuscenes import CATEGORY_OF_LABEL_CLASS, CLASS_OF_CATEGORY
from smartmot.pointcloud import PointCloud
from smartmot.types import FloatArray, IntArray

VERSION = "v1.0-mini"
"""Of the tables; the devkit's default."""

REAR_AXLE_M = 1.38
"""Behind the middle of a car: that of nuScenes' own vehicle (`scenarios.recorded.vehicles`)."""

MOVES_MPS = 0.2
"""What is faster has the attribute of moving things, as in mmdetection3d's export to nuScenes."""

UNKNOWN_POINTS = -1
"""Default of `num_pts` in the devkit's boxes."""

_UNKNOWN = "movable_object.debris"
"""Category of boxes of unknown kind: what is too large to be driven over safely."""

_ATTRIBUTES = (
    *("vehicle.moving", "vehicle.stopped", "cycle.with_rider", "pedestrian.moving", "pedestrian.standing"),
)
_VISIBILITIES = {"1": "v0-40", "2": "v40-60", "3": "v60-80", "4": "v80-100"}

_NO_MASK = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAAAAAA6fptVAAAACklEQVR4nGNgAAAAAgABSK+kcQAAAABJRU5ErkJggg=="
)
"""A map mask of one black pixel: nothing is said of the ground. The devkit opens no tables without one."""

Tables = dict[str, list[dict[str, Any]]]


def nuscenes_files(sequences: Many[Sequence], seed: int = 0) -> Iterator[tuple[str, bytes]]:
    """Files of the layout, by path below the data set's folder.

    Args:
        sequences: Recordings with labels and poses; each is a scene.
        seed: Of the splits.

    Raises:
        DatasetError: A recording has no labels or no poses.
    """
    tables = _fixed_tables()
    splits: dict[str, list[str]] = {f"smartmot_{split}": [] for split in SPLITS}
    for number, (sequence, split) in enumerate(
        zip(sequences, split_of_scenes(len(sequences), seed), strict=True)
    ):
        name = _scene_name(number)
        splits[f"smartmot_{split}"].append(name)
        _add_scene(tables, name, sequence)
    for table, records in tables.items():
        yield f"{VERSION}/{table}.json", _json(records)
    yield f"{VERSION}/splits.json", _json(splits)
    yield "maps/none.png", _NO_MASK


def token_of(*parts: object) -> str:
    """A token of 32 hexadecimal digits, the same for the same parts."""
    return hashlib.sha256("/".join(map(str, parts)).encode()).hexdigest()[:32]


def _json(content: object) -> bytes:
    return json.dumps(content, allow_nan=False).encode()


def _fixed_tables() -> Tables:
    """The tables that no recording changes, and the others, empty."""
    names = [*CATEGORY_OF_LABEL_CLASS.values(), _UNKNOWN]
    return {
        "category": [{"token": token_of("category", n), "name": n, "description": ""} for n in names],
        "attribute": [{"token": token_of("attribute", n), "name": n, "description": ""} for n in _ATTRIBUTES],
        "visibility": [{"token": t, "level": n, "description": ""} for t, n in _VISIBILITIES.items()],
        "sensor": [{"token": token_of("sensor"), "channel": "LIDAR_TOP", "modality": "lidar"}],
        "calibrated_sensor": [],
        "map": [
            {
                "token": token_of("map"),
                "category": "semantic_prior",
                "filename": "maps/none.png",
                "log_tokens": [],
            }
        ],
        **{
            table: []
            for table in (
                *("log", "scene", "sample", "sample_data", "ego_pose", "instance", "sample_annotation"),
            )
        },
    }


def _add_scene(tables: Tables, name: str, sequence: Sequence) -> None:
    """One recording's records in all tables."""
    labels, center_pose = truth_of(sequence)
    count = len(sequence)
    samples = [token_of("sample", name, k) for k in range(count)]
    calibrated = _add_calibration(tables, sequence)
    stamps = _after(tables["sample"], np.rint(sequence.stamp_s * 1e6).astype(np.int64)).tolist()
    tables["map"][0]["log_tokens"].append(token_of("log", name))
    tables["log"].append(
        {
            "token": token_of("log", name),
            "logfile": sequence.name,
            "vehicle": "smartmot",
            "date_captured": "1970-01-01",
            "location": "simulation",
        }
    )
    tables["scene"].append(
        {
            "token": token_of("scene", name),
            "name": name,
            "description": sequence.name,
            "log_token": token_of("log", name),
            "nbr_samples": count,
            "first_sample_token": samples[0] if samples else "",
            "last_sample_token": samples[-1] if samples else "",
        }
    )
    pose = rear_axle(center_pose)
    rotation = quaternion_of(pose).tolist()
    for k, sample in enumerate(samples):
        before, after = _neighbours(samples, k)
        tables["sample"].append(
            {
                "token": sample,
                "timestamp": stamps[k],
                "scene_token": token_of("scene", name),
                "prev": before,
                "next": after,
            }
        )
        tables["ego_pose"].append(
            {
                "token": token_of("ego_pose", sample),
                "timestamp": stamps[k],
                "rotation": rotation[k],
                "translation": pose[k, :3, 3].tolist(),
            }
        )
        tables["sample_data"].append(
            {
                "token": token_of("sample_data", sample),
                "sample_token": sample,
                "ego_pose_token": token_of("ego_pose", sample),
                "calibrated_sensor_token": calibrated,
                "timestamp": stamps[k],
                "fileformat": "pcd",
                "filename": "" if sequence.sweeps is None else _sweep_path(name, k),
                "is_key_frame": True,
                "height": 0,
                "width": 0,
                "prev": before and token_of("sample_data", before),
                "next": after and token_of("sample_data", after),
            }
        )
    points = None if sequence.sweeps is None else sequence.sweeps.point_count
    _add_annotations(tables, name, labels, points, samples)


def _add_calibration(tables: Tables, sequence: Sequence) -> str:
    """Token of where LIDAR_TOP is, in the frame of the rear axle; entered once for each place."""
    pose = np.eye(4)
    if sequence.sweeps is not None:
        pose = sequence.sweeps.ego_SE3_lidar @ NUSCENES_SE3_OURS.T
        pose[0, 3] += REAR_AXLE_M
    translation, rotation = pose[:3, 3].tolist(), quaternion_of(pose[None])[0].tolist()
    token = token_of("calibrated_sensor", translation, rotation)
    if token not in {row["token"] for row in tables["calibrated_sensor"]}:
        tables["calibrated_sensor"].append(
            {
                "token": token,
                "sensor_token": token_of("sensor"),
                "translation": translation,
                "rotation": rotation,
                "camera_intrinsic": [],
            }
        )
    return token


NUSCENES_SE3_OURS = np.array(
    [(0.0, -1.0, 0.0, 0.0), (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 1.0, 0.0), (0.0, 0.0, 0.0, 1.0)]
)
"""(4, 4) from our axes of a LiDAR (x ahead, y left) to those of LIDAR_TOP (x right, y ahead)."""

INTENSITY = 255.0
"""Greatest intensity in nuScenes; ours are from 0 to 1."""


def _sweep_path(scene: str, k: int) -> str:
    return f"samples/LIDAR_TOP/{scene}__LIDAR_TOP__{k:06d}.pcd.bin"


def sweep_bytes(cloud: PointCloud) -> bytes:
    """A cloud as nuScenes keeps it: x right, y ahead, intensities up to 255, rings."""
    xyz = cloud.xyz_m @ NUSCENES_SE3_OURS[:3, :3].T.astype(cloud.xyz_m.dtype)
    intensity = None if cloud.intensity is None else INTENSITY * cloud.intensity
    return bin_bytes(replace(cloud, xyz_m=xyz, intensity=intensity), nuscenes=True)


NUSCENES_SWEEPS = SweepFiles(lambda place, _, k: _sweep_path(_scene_name(place.number), k), sweep_bytes)


def _scene_name(number: int) -> str:
    return f"scene-{number:04d}"


def _after(samples: list[dict[str, Any]], stamp_us: IntArray) -> IntArray:
    """(F,) times of a scene, later as a whole where it would not begin after the samples before it.

    Runs all begin at 0; the devkit lists scenes by their times and fails at equal ones.
    """
    if not samples or not len(stamp_us):
        return stamp_us
    shift: int = samples[-1]["timestamp"] + _BETWEEN_US - int(stamp_us[0])
    return stamp_us + max(shift, 0)


_BETWEEN_US = 1_000_000
"""From the last sample of a scene to the first of the next, where their own times overlap; assumed."""


def _neighbours(tokens: list[str], k: int) -> tuple[str, str]:
    """The tokens before and after one; empty at the ends."""
    return tokens[k - 1] if k else "", tokens[k + 1] if k + 1 < len(tokens) else ""


def rear_axle(center_pose: FloatArray) -> FloatArray:
    """(F, 4, 4) poses of the middle of the rear axle, from those of the middle of the car."""
    pose = center_pose.copy()
    pose[:, :3, 3] -= REAR_AXLE_M * pose[:, :3, 0]
    return pose


def _add_annotations(
    tables: Tables, scene: str, labels: Objects, point_count: IntArray | None, samples: list[str]
) -> None:
    """Boxes and the objects that they are of."""
    points = len(labels) * [UNKNOWN_POINTS] if point_count is None else point_count.tolist()
    size = np.column_stack((labels.size_m[:, 1], labels.size_m[:, 0], labels.height_m)).tolist()
    center = boxes_of(labels).center_m.tolist()
    half = 0.5 * labels.yaw_rad
    zero = np.zeros(len(labels))
    rotation = np.column_stack((np.cos(half), zero, zero, np.sin(half))).tolist()
    speed = np.hypot(*labels.velocity_mps.T).tolist()
    tokens = [
        token_of("annotation", samples[frame], identity)
        for frame, identity in zip(labels.frame.tolist(), labels.object_id.tolist(), strict=True)
    ]
    of_object: dict[int, list[int]] = defaultdict(list)
    for row, identity in enumerate(labels.object_id.tolist()):
        of_object[identity].append(row)
    links: dict[int, tuple[str, str]] = {}
    for identity, rows in of_object.items():
        name = _category_name(str(labels.kind[rows[0]]), str(labels.category[rows[0]]))
        own = [tokens[row] for row in rows]
        links |= {row: _neighbours(own, k) for k, row in enumerate(rows)}
        tables["instance"].append(
            {
                "token": token_of("instance", scene, identity),
                "category_token": token_of("category", name),
                "nbr_annotations": len(rows),
                "first_annotation_token": own[0],
                "last_annotation_token": own[-1],
            }
        )
    for row, token in enumerate(tokens):
        attribute = _attribute(str(labels.category[row]), speed[row])
        tables["sample_annotation"].append(
            {
                "token": token,
                "sample_token": samples[int(labels.frame[row])],
                "instance_token": token_of("instance", scene, int(labels.object_id[row])),
                "visibility_token": "",
                "attribute_tokens": [token_of("attribute", attribute)] if attribute else [],
                "translation": center[row],
                "size": size[row],
                "rotation": rotation[row],
                "prev": links[row][0],
                "next": links[row][1],
                "num_lidar_pts": points[row],
                "num_radar_pts": 0,
            }
        )


def _category_name(kind: str, category: str) -> str:
    """The name in nuScenes of an annotated category."""
    kind = kind if kind in CATEGORY_OF_LABEL_CLASS else CLASS_OF_CATEGORY.get(category, "")
    return CATEGORY_OF_LABEL_CLASS.get(kind, _UNKNOWN)


def without_category(sequence: Sequence) -> int:
    """How many labels have no category in nuScenes; they are written as debris."""
    labels = truth_of(sequence)[0]
    kinds = zip(labels.kind.tolist(), labels.category.tolist(), strict=True)
    return sum(_category_name(*pair) == _UNKNOWN for pair in kinds)


def _attribute(category: str, speed_mps: float) -> str:
    """The attribute that nuScenes asks of a box; none where the speed is not known."""
    if category in ("cyclist", "motorcycle"):
        return "cycle.with_rider"
    if category == "unknown" or np.isnan(speed_mps):
        return ""
    moves = speed_mps > MOVES_MPS
    if category == "pedestrian":
        return "pedestrian.moving" if moves else "pedestrian.standing"
    return "vehicle.moving" if moves else "vehicle.stopped"
