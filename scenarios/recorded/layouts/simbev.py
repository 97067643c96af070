"""Recordings in SimBEV's layout, as `scenarios.recorded.simbev` reads it.

With a LiDAR the labels are as after SimBEV's post-processing: points in the box (`num_lidar_pts`), whether
there is one (`valid_flag`), class and difficulty. Without one they are as before it, and the class follows
from the semantic tag. The ego's pose is that of the middle of its outline on the ground, as SimBEV has it.

Source: SimBEV (GoodarzMehr/SimBEV, 2026), README and the files that it writes.
"""

from __future__ import annotations

import io
import json
import math
from collections.abc import Iterator
from collections.abc import Sequence as Many
from typing import Any

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.recorded.layouts.scenes import SPLITS, quaternion_of, split_of_scenes, truth_of
from scenarios.recorded.layouts.sweeps import SweepFiles, common_lidar
from scenarios.recorded.simbev.reader import CLASS_OF_TAG, CONFIGS, INFOS, LABELS
from scenarios.recorded.textfile import MAX_FRAMES
from smartmot.pointcloud import PointCloud
from smartmot.types import BoolArray, FloatArray, IntArray

_TAG_OF_CLASS = {kind: tag for tag, kind in CLASS_OF_TAG.items()}
_CLASS_OF_CATEGORY = {
    "car": "car",
    "truck": "truck",
    "pedestrian": "pedestrian",
    "motorcycle": "motorcycle",
    "cyclist": "bicycle",
}
TICK_S = 0.01
"""Frames of a simulation are at multiples of it; the instant of a contact is not, and is left out."""
_SAME_S = 1e-6

_STAMPS_PER_S = 1e7
"""Unit of `timestamp`."""

EASY_WITHIN_M = {"car": 30.0, "truck": 40.0, "bus": 40.0}
EASY_WITHIN_OTHER_M = 20.0
"""Distances from the ego under which a label can be easy, by class; medium up to twice as far."""

EASY_POINTS = {"car": (80, 30), "truck": (100, 40), "bus": (100, 40)}
EASY_POINTS_OTHER = (40, 20)
"""Points from which on a label can be easy, and medium, by class."""

_SWEEPS = "sweeps/LIDAR"

# signs of the corners along, to the left and up: 0 is behind, left, below; 4 ahead; 2 to the right; 1 above
_CORNERS = np.array([(a, -r, u) for a in (-1, 1) for r in (-1, 1) for u in (-1, 1)], dtype=np.float64)


def simbev_files(sequences: Many[Sequence], seed: int = 0) -> Iterator[tuple[str, bytes]]:
    """Files of the layout, by path below the data set's folder.

    Args:
        sequences: Recordings with labels and poses; each is a scene.
        seed: Of the splits.

    Raises:
        DatasetError: The times of a recording have no common step.
    """
    lidar = common_lidar(sequences)
    splits = split_of_scenes(len(sequences), seed)
    infos: dict[str, dict[str, Any]] = {name: {} for name in SPLITS}
    for scene, (sequence, split) in enumerate(zip(sequences, splits, strict=True)):
        number, on_grid, timestep_s = frame_grid(sequence)
        yield (
            f"simbev/{CONFIGS}/SimBEV-scene-{scene:04d}.yaml",
            f"mode: create\ntimestep: {timestep_s!r}\n".encode(),
        )
        labels, pose = truth_of(sequence)
        rotation = quaternion_of(pose).tolist()
        frames = []
        for k, rows in enumerate(labels.frame_rows(len(sequence))):
            if not on_grid[k]:
                continue
            name = f"SimBEV-scene-{scene:04d}-frame-{number[k]:04d}-GT_DET.bin"
            sweep = {} if lidar is None else {"LIDAR": _sweep_path(scene, int(number[k]))}
            frames.append(
                {
                    "ego2global_translation": pose[k, :3, 3].tolist(),
                    "ego2global_rotation": rotation[k],
                    "timestamp": round(float(sequence.stamp_s[k]) * _STAMPS_PER_S),
                    "GT_DET": f"simbev/{LABELS}/{name}",
                    "scene": scene,
                    "frame": int(number[k]),
                    **sweep,
                }
            )
            count = None if sequence.sweeps is None else sequence.sweeps.point_count[rows]
            yield f"simbev/{LABELS}/{name}", _label_bytes(labels[rows], pose[k], count)
        infos[split][f"scene_{scene:04d}"] = {
            "scene_info": {"map": "", "name": sequence.name},
            "scene_data": frames,
        }
    for split, scenes in infos.items():
        if scenes:
            text = json.dumps({"metadata": _metadata(lidar), "data": scenes}, allow_nan=False)
            yield f"simbev/{INFOS}/simbev_infos_{split}.json", text.encode()


def _metadata(lidar: FloatArray | None) -> dict[str, Any]:
    """Where the sensors are in the vehicle's frame."""
    if lidar is None:
        return {}
    pose = {
        "sensor2lidar_translation": [0.0, 0.0, 0.0],
        "sensor2lidar_rotation": [1.0, 0.0, 0.0, 0.0],
        "sensor2ego_translation": lidar[:3, 3].tolist(),
        "sensor2ego_rotation": quaternion_of(lidar[None])[0].tolist(),
    }
    return {"LIDAR": pose}


def _sweep_path(scene: int, number: int) -> str:
    return f"simbev/{_SWEEPS}/SimBEV-scene-{scene:04d}-frame-{number:04d}-LIDAR.npz"


def sweep_bytes(cloud: PointCloud) -> bytes:
    """Points of a cloud, as SimBEV keeps them: (N, 3) float32, nothing else; compressing would gain 7 %."""
    sink = io.BytesIO()
    np.savez(sink, data=cloud.xyz_m.astype(np.float32))
    return sink.getvalue()


SIMBEV_SWEEPS = SweepFiles(
    lambda place, sequence, k: _sweep_path(place.number, int(frame_grid(sequence)[0][k])), sweep_bytes
)


def frame_grid(sequence: Sequence) -> tuple[IntArray, BoolArray, float]:
    """(F,) numbers of the frames, whether they are on the grid, and the time step that gives their times.

    Raises:
        DatasetError: There is no common step.
    """
    ticks = np.rint(sequence.stamp_s / TICK_S)
    on_grid = np.abs(ticks * TICK_S - sequence.stamp_s) < _SAME_S
    step = math.gcd(*ticks[on_grid].astype(np.int64).tolist()) or 1
    number = (ticks // step).astype(np.int64)
    if (~on_grid).sum() > 1 or number.min(initial=0) < 0 or number.max(initial=0) >= MAX_FRAMES:
        raise DatasetError(
            f"sequence {sequence.name}: SimBEV's frames are at multiples of one time step from 0 on, and "
            f"these are not at multiples of {TICK_S:g} s"
        )
    return number, on_grid, step * TICK_S


def without_class(sequence: Sequence) -> int:
    """How many labels have no class in SimBEV; they are written without a semantic tag."""
    return sum(_class_of(row) is None for row in _kinds(truth_of(sequence)[0]))


def _kinds(labels: Objects) -> zip[tuple[str, str]]:
    return zip(labels.kind.tolist(), labels.category.tolist(), strict=True)


def _class_of(kind_category: tuple[str, str]) -> str | None:
    kind, category = kind_category
    return kind if kind in _TAG_OF_CLASS else _CLASS_OF_CATEGORY.get(category)


def corners_of(labels: Objects) -> FloatArray:
    """(K, 8, 3) corners in SimBEV's order, world frame."""
    half = 0.5 * np.column_stack((labels.size_m, labels.height_m))
    local = _CORNERS * half[:, None]
    cos, sin = np.cos(labels.yaw_rad)[:, None], np.sin(labels.yaw_rad)[:, None]
    x, y = local[..., 0], local[..., 1]
    center = np.column_stack((labels.center_m, labels.bottom_m + half[:, 2]))
    return np.stack((cos * x - sin * y, sin * x + cos * y, local[..., 2]), axis=2) + center[:, None]


def difficulty(kind: str, distance_m: float, point_count: int) -> str:
    """How hard SimBEV takes a label to be to detect."""
    within = EASY_WITHIN_M.get(kind, EASY_WITHIN_OTHER_M)
    easy, medium = EASY_POINTS.get(kind, EASY_POINTS_OTHER)
    if distance_m >= 2.0 * within or point_count < medium:
        return "hard"
    return "medium" if distance_m >= within or point_count < easy else "easy"


def _post_processed(kind: str | None, distance_m: float, point_count: int) -> dict[str, Any]:
    """What SimBEV's post-processing adds to a label; there is no radar."""
    values: dict[str, Any] = {
        "num_lidar_pts": point_count,
        "num_radar_pts": 0,
        "valid_flag": point_count > 0,
    }
    if kind is None:
        return values
    return values | {"class": kind, "difficulty": difficulty(kind, distance_m, point_count)}


def _label_bytes(labels: Objects, pose: FloatArray, point_count: IntArray | None) -> bytes:
    """Labels of one frame, as `numpy.save` writes an array of objects."""
    corners = corners_of(labels)
    velocity = np.column_stack((labels.velocity_mps, np.zeros(len(labels))))
    middle = np.column_stack((labels.center_m, labels.bottom_m + 0.5 * labels.height_m))
    distance_m = np.linalg.norm(middle - pose[:3, 3], axis=1).tolist()
    values = np.empty(len(labels), dtype=object)
    for k, kind_category in enumerate(_kinds(labels)):
        kind = _class_of(kind_category)
        values[k] = {
            "id": int(labels.object_id[k]),
            "type": kind_category[0],
            "is_alive": True,
            "is_active": True,
            "is_dormant": False,
            "parent": None,
            "attributes": {},
            "semantic_tags": [] if kind is None else [_TAG_OF_CLASS[kind]],
            "bounding_box": corners[k],
            "location": 0.5 * (corners[k, 0] + corners[k, 7]),
            "rotation": np.array([0.0, 0.0, math.degrees(labels.yaw_rad[k])]),
            "linear_velocity": velocity[k],
            "angular_velocity": np.zeros(3),
            "distance_to_ego": distance_m[k],
        }
        if point_count is not None:
            values[k] |= _post_processed(kind, distance_m[k], int(point_count[k]))
    sink = io.BytesIO()
    np.save(sink, values, allow_pickle=True)
    return sink.getvalue()
