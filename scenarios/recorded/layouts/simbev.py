"""Recordings in SimBEV's layout, as `scenarios.recorded.simbev` reads it.

The labels are as before SimBEV's post-processing: there is no LiDAR, so how many points hit a box
(`num_lidar_pts`, `valid_flag`) is not known, and the class follows from the semantic tag. The ego's pose is
that of the middle of its outline on the ground, as SimBEV has it.
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
from scenarios.recorded.simbev.reader import CLASS_OF_TAG, CONFIGS, INFOS, LABELS
from scenarios.recorded.textfile import MAX_FRAMES
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
            frames.append(
                {
                    "ego2global_translation": pose[k, :3, 3].tolist(),
                    "ego2global_rotation": rotation[k],
                    "timestamp": round(float(sequence.stamp_s[k]) * _STAMPS_PER_S),
                    "GT_DET": f"simbev/{LABELS}/{name}",
                    "scene": scene,
                    "frame": int(number[k]),
                }
            )
            yield f"simbev/{LABELS}/{name}", _label_bytes(labels[rows], pose[k])
        infos[split][f"scene_{scene:04d}"] = {
            "scene_info": {"map": "", "name": sequence.name},
            "scene_data": frames,
        }
    for split, scenes in infos.items():
        if scenes:
            text = json.dumps({"metadata": {}, "data": scenes}, allow_nan=False)
            yield f"simbev/{INFOS}/simbev_infos_{split}.json", text.encode()


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


def _label_bytes(labels: Objects, pose: FloatArray) -> bytes:
    """Labels of one frame, as `numpy.save` writes an array of objects."""
    corners = corners_of(labels)
    velocity = np.column_stack((labels.velocity_mps, np.zeros(len(labels))))
    distance_m = np.linalg.norm(labels.center_m - pose[:2, 3], axis=1).tolist()
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
    sink = io.BytesIO()
    np.save(sink, values, allow_pickle=True)
    return sink.getvalue()
