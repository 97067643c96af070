"""nuScenes: reads detections in the format of its detection challenge, writes its tracking challenge's.

A folder holds one JSON file of detections (`{"meta": ..., "results": {sample_token: [box, ...]}}`) and what
says when and in which scene each sample was taken: nuScenes' own tables `sample.json` and `scene.json` (in
the folder, or in a folder `v1.0-*` in it), or a small file `frames.csv` with the columns sample_token, scene
and stamp_s. Without either the samples are one recording at 2 Hz, in the file's order. With the tables
sample_annotation, instance and category there are labels; with sample_data, ego_pose, calibrated_sensor and
sensor there are ego poses (those of LIDAR_TOP's key frames). Tables with labels need no file of detections.
Annotated categories that the detection challenge leaves out are counted; `classes.csv` can give them one.

Boxes are in the global frame: translation is the centre, size is width, length, height, rotation a quaternion
w, x, y, z. Source: nuscenes-devkit, eval/detection and eval/tracking README, docs/schema_nuscenes.md.
"""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.classes import CLASSES_CSV, ClassMap, categories, read_classes
from scenarios.recorded.dataset import LEFT_OUT, Dataset, Objects, Sequence, finished
from scenarios.recorded.nuscenes_records import (
    FIELDS,
    LABEL_TABLES,
    OTHER_TABLES,
    POSE_TABLES,
    Rule,
    has_tables,
    is_number_or_null,
    missing_tables,
    read_records,
    referred,
    require,
    vector,
)
from scenarios.recorded.poses import quaternion_yaw, rigid, rotation_matrix
from scenarios.recorded.textfile import is_given, read_headed_table, read_json
from smartmot.types import CATEGORIES, FloatArray, StrArray

CATEGORY_OF_CLASS = {
    "car": "car",
    "truck": "truck",
    "bus": "truck",
    "trailer": "truck",
    "construction_vehicle": "truck",
    "pedestrian": "pedestrian",
    "motorcycle": "motorcycle",
    "bicycle": "cyclist",
    "barrier": LEFT_OUT,
    "traffic_cone": LEFT_OUT,
}
"""Detection classes. Other data in this format, such as SimBEV's, have some of these, or `classes.csv`."""

_CLASS_OF_LABEL = {
    "vehicle.car": "car",
    "vehicle.truck": "truck",
    "vehicle.bus.bendy": "bus",
    "vehicle.bus.rigid": "bus",
    "vehicle.trailer": "trailer",
    "vehicle.construction": "construction_vehicle",
    "vehicle.motorcycle": "motorcycle",
    "vehicle.bicycle": "bicycle",
    "human.pedestrian.adult": "pedestrian",
    "human.pedestrian.child": "pedestrian",
    "human.pedestrian.construction_worker": "pedestrian",
    "human.pedestrian.police_officer": "pedestrian",
}
"""Annotated categories as detection classes (nuscenes-devkit, eval/detection/utils.py)."""

TRACKING_CLASSES = ("bicycle", "bus", "car", "motorcycle", "pedestrian", "trailer", "truck")
"""Names that the tracking challenge knows."""

_UNTRACKED = frozenset(CATEGORY_OF_CLASS) - {*TRACKING_CLASSES, *CATEGORIES}
"""Names of nuScenes that its tracking challenge does not know."""

CATEGORY_OF_LABEL_CLASS = {kind: name for name, kind in reversed(_CLASS_OF_LABEL.items())} | {
    "bus": "vehicle.bus.rigid"
}
"""The commonest annotated category of each detection class."""

CLASS_OF_CATEGORY = {
    "car": "car",
    "truck": "truck",
    "pedestrian": "pedestrian",
    "motorcycle": "motorcycle",
    "cyclist": "bicycle",
}
"""Detection classes for the tracker's categories."""

MAX_BOXES_PER_SAMPLE = 500
"""The tracking challenge refuses more."""

FRAMES_CSV = "frames.csv"
FRAME_S = 0.5
"""nuScenes' samples are taken at 2 Hz."""

_META = ("use_camera", "use_lidar", "use_radar", "use_map", "use_external")

Scenes = dict[str, list[tuple[str, float]]]
"""Samples of each scene in the order of time: token and seconds."""

Boxes = list[tuple[int, Any]]
"""Boxes as JSON has them, each with its frame."""

Annotations = dict[str, list[tuple[int, str, dict[str, Any]]]]
"""Annotated road users by sample: number of the instance, class and record."""


def read_nuscenes(folder: Path) -> Dataset:
    """Read a folder in the layout above, or the file of detections in it.

    Raises:
        DatasetError: A file is missing or wrong; the message names file, sample and field.
    """
    place = folder.parent if folder.is_file() else folder
    tables = _table_folder(place)
    path = folder if folder.is_file() else _results_file(folder, tables)
    results = {} if path is None else _results(path)
    # without a file of detections the tables alone say which scenes there are
    labels_only, path = path is None, path or place
    notes: list[str] = []
    scenes = _scenes(path, results, tables, notes)
    classes = read_classes(place, CATEGORY_OF_CLASS)
    annotations = _annotations(tables, classes, scenes, notes) if tables else {}
    poses = _ego_poses(tables, notes) if tables else {}
    sequences, absent = [], 0
    for scene, samples in scenes.items():
        tokens = [token for token, _ in samples]
        missing = 0 if labels_only else sum(token not in results for token in tokens)
        if missing == len(tokens):
            continue
        absent += missing
        boxes = [(k, box) for k, token in enumerate(tokens) for box in _boxes(path, results, token)]
        sequences.append(
            Sequence(
                name=scene,
                stamp_s=np.array([stamp for _, stamp in samples]),
                frame_name=tuple(tokens),
                detections=_detections(path, tokens, boxes, classes),
                labels=_labels(tokens, annotations, classes) if annotations else None,
                world_SE3_ego=_poses_at(tables, scene, tokens, poses),
            )
        )
    if absent:
        notes.append(f"{absent} samples without an entry in 'results' are taken as frames without detections")
    return finished("nuscenes", sequences, tuple(notes))


def _scenes(path: Path, results: dict[str, Any], tables: Path | None, notes: list[str]) -> Scenes:
    """When and in which scene the samples were taken, from the tables, the small file, or their order."""
    times = path.parent / FRAMES_CSV
    if tables:
        scenes = _scenes_of_tables(tables)
    elif is_given(times):
        scenes = _scenes_of_csv(times)
    else:
        scenes = {path.stem: [(token, k * FRAME_S) for k, token in enumerate(results)]}
        notes.append(
            f"no times of the samples: taken as one recording in the file's order, {FRAME_S:g} s apart; put "
            f"sample.json and scene.json of nuScenes or {FRAMES_CSV} (sample_token, scene, stamp_s) beside it"
        )
    source = tables / "sample.json" if tables else times
    known = Counter(token for samples in scenes.values() for token, _ in samples)
    for token, count in known.items():
        if count > 1:
            raise DatasetError(f"{source}: sample {token!r} is there twice")
    for token in results:
        if token not in known:
            raise DatasetError(f"{path}: sample {token!r} is not in {source}")
    return scenes


def _results(path: Path) -> dict[str, Any]:
    """Boxes by sample token."""
    content = read_json(path)
    results = content.get("results") if isinstance(content, dict) else None
    if not isinstance(results, dict):
        raise DatasetError(f"{path}: no object 'results' with boxes by sample token")
    return results


def _results_file(folder: Path, table_folder: Path | None) -> Path | None:
    """The one JSON file of a folder that is no table of nuScenes; None where labels do without."""
    tables = {f"{name}.json" for name in (*FIELDS, *OTHER_TABLES)}
    paths = sorted(path for path in folder.glob("*.json") if path.name not in tables)
    if not paths and table_folder and has_tables(table_folder, LABEL_TABLES):
        return None
    if len(paths) != 1:
        listed = ", ".join(path.name for path in paths) or "none"
        raise DatasetError(
            f"{folder}: expected one JSON file of detections, found {listed}; name the file itself"
        )
    return paths[0]


def _table_folder(folder: Path) -> Path | None:
    """Where sample.json is; None when there is none."""
    for place in (folder, *sorted(folder.glob("v1.0-*"))):
        if is_given(place / "sample.json"):
            return place
    return None


def _scenes_of_tables(folder: Path) -> Scenes:
    """Scenes from nuScenes' tables; times there are microseconds."""
    names = {scene["token"]: scene["name"] for scene in read_records(folder, "scene")}
    scenes: Scenes = {name: [] for name in names.values()}
    if len(scenes) < len(names):
        name = Counter(names.values()).most_common(1)[0][0]
        raise DatasetError(f"{folder / 'scene.json'}: scene {name!r} is there twice")
    for sample in read_records(folder, "sample"):
        name = names.get(sample["scene_token"])
        if name is None:
            raise DatasetError(
                f"{folder / 'sample.json'}: scene {sample['scene_token']!r} is not in scene.json"
            )
        scenes[name].append((sample["token"], float(sample["timestamp"]) * 1e-6))
    for samples in scenes.values():
        samples.sort(key=lambda sample: sample[1])
    return scenes


def _scenes_of_csv(path: Path) -> Scenes:
    """Scenes from the small file beside the detections, in its order."""
    table = read_headed_table(path, ("sample_token", "scene", "stamp_s"), ("stamp_s",))
    table.require_finite("stamp_s")
    scenes: Scenes = {}
    for token, scene, stamp_s in zip(
        table["sample_token"].tolist(), table["scene"].tolist(), table["stamp_s"].tolist(), strict=True
    ):
        scenes.setdefault(scene, []).append((token, stamp_s))
    return scenes


def _boxes(path: Path, results: dict[str, Any], token: str) -> list[Any]:
    """Boxes of a sample, none without an entry."""
    boxes = results.get(token, [])
    if not isinstance(boxes, list):
        raise DatasetError(f"{path}: sample {token!r}: expected a list of boxes")
    return boxes


def _detections(path: Path, tokens: list[str], boxes: Boxes, classes: ClassMap) -> Objects:
    """Boxes of one scene, of the classes that have a category."""
    rules = {
        "translation": vector(3, is_number_or_null),
        "size": vector(3, is_number_or_null),
        "rotation": vector(4, is_number_or_null),
        "velocity": vector(2, is_number_or_null, needed=False),  # not every detector estimates it
        "detection_name": Rule(
            f"is unknown: {{}}; give it a category in {CLASSES_CSV}",
            lambda value: isinstance(value, str) and value in classes,
        ),
        "detection_score": Rule("must be a number", is_number_or_null),
    }
    for frame, box in boxes:
        require(box, rules, path, "sample", tokens[frame])
    return _objects(
        boxes,
        np.array([box["detection_name"] for _, box in boxes], dtype=np.str_),
        classes,
        score=_array([box["detection_score"] for _, box in boxes]),
        velocity_mps=_array([box.get("velocity") or (math.nan, math.nan) for _, box in boxes], 2),
    )


def _array(values: list[Any], width: int | None = None) -> FloatArray:
    """Numbers as float64, with None as NaN."""
    return np.array(values, dtype=np.float64).reshape((-1,) if width is None else (-1, width))


def _objects(boxes: Boxes, kinds: StrArray, classes: ClassMap, **columns: np.ndarray) -> Objects:
    """Boxes of nuScenes in the world frame, of the classes that have a category."""
    place, size = (_array([box[name] for _, box in boxes], 3) for name in ("translation", "size"))
    with np.errstate(invalid="ignore", over="ignore"):  # boxes that are not finite are rejected later
        bottom = place[:, 2] - 0.5 * size[:, 2]
    return Objects.of(
        np.array([frame for frame, _ in boxes], dtype=np.int64),
        place[:, :2],
        size_m=size[:, [1, 0]],
        yaw_rad=quaternion_yaw(_array([box["rotation"] for _, box in boxes], 4)),
        bottom_m=bottom,
        height_m=size[:, 2],
        category=categories(kinds, classes),
        kind=kinds,
        **columns,
    )


def _annotations(folder: Path, classes: ClassMap, scenes: Scenes, notes: list[str]) -> Annotations:
    """Annotated road users by sample; empty without the tables."""
    if missing := missing_tables(folder, LABEL_TABLES):
        if len(missing) < len(LABEL_TABLES):
            notes.append(f"no labels are read: they need {', '.join(missing)} as well")
        return {}
    names = {row["token"]: row["name"] for row in read_records(folder, "category")}
    instances: dict[str, tuple[int, str]] = {}
    for number, row in enumerate(read_records(folder, "instance")):
        instances[row["token"]] = number, referred(folder, names, "instance", row, "category")
    left_out: Counter[str] = Counter()
    by_sample: Annotations = {}
    for row in read_records(folder, "sample_annotation"):
        number, name = referred(folder, instances, "sample_annotation", row, "instance")
        # the user's own categories stand beside nuScenes' as they are
        kind = _CLASS_OF_LABEL.get(name, name)
        if kind in classes:
            by_sample.setdefault(row["sample_token"], []).append((number, kind, row))
        else:
            left_out[name] += 1
    samples = {token for each in scenes.values() for token, _ in each}
    if strays := sum(len(rows) for token, rows in by_sample.items() if token not in samples):
        notes.append(f"{strays} annotations of samples that are not in sample.json are left out")
    if left_out:
        counts = ", ".join(f"{count} {name}" for name, count in left_out.most_common(5))
        more = f" and {len(left_out) - 5} more" if len(left_out) > 5 else ""
        notes.append(
            f"annotations left out, for their category is none of the detection challenge: {counts}{more}; "
            f"give it one in {CLASSES_CSV}"
        )
    return by_sample


def _labels(tokens: list[str], annotations: Annotations, classes: ClassMap) -> Objects:
    """Labels of one scene; those that no sensor point hits are ignored, as in the challenge."""
    rows = [(k, *row) for k, token in enumerate(tokens) for row in annotations.get(token, [])]
    unseen = [
        record.get("num_lidar_pts") == 0 and record.get("num_radar_pts", 0) == 0 for _, _, _, record in rows
    ]
    return _objects(
        [(k, record) for k, _, _, record in rows],
        np.array([kind for _, _, kind, _ in rows], dtype=np.str_),
        classes,
        object_id=np.array([number for _, number, _, _ in rows], dtype=np.int64),
        ignored=np.array(unseen, dtype=np.bool_),
    )


def _ego_poses(folder: Path, notes: list[str]) -> dict[str, FloatArray]:
    """(4, 4) global pose of the vehicle at each sample; empty without the tables."""
    if missing := missing_tables(folder, POSE_TABLES):
        if len(missing) < len(POSE_TABLES):
            notes.append(f"no ego poses are read: they need {', '.join(missing)} as well")
        return {}
    lidars = {row["token"] for row in read_records(folder, "sensor") if row["channel"] == "LIDAR_TOP"}
    mounts = {
        row["token"] for row in read_records(folder, "calibrated_sensor") if row["sensor_token"] in lidars
    }
    sample_of = {
        row["ego_pose_token"]: row["sample_token"]
        for row in read_records(folder, "sample_data")
        if row["is_key_frame"] and row["calibrated_sensor_token"] in mounts
    }
    poses = {}
    for row in read_records(folder, "ego_pose"):
        if row["token"] in sample_of:
            if not any(row["rotation"]):
                raise DatasetError(f"{folder / 'ego_pose.json'}: {row['token']!r}: rotation must not be 0")
            rotation = rotation_matrix(_array(row["rotation"]))
            poses[sample_of[row["token"]]] = rigid(rotation[None], _array(row["translation"], 3))[0]
    if not poses:
        notes.append("no ego poses: sample_data.json has no key frames of LIDAR_TOP with one")
    return poses


def _poses_at(
    folder: Path | None, scene: str, tokens: list[str], poses: Mapping[str, FloatArray]
) -> FloatArray | None:
    """(F, 4, 4) poses of a scene; None where it has none at all."""
    missing = [token for token in tokens if token not in poses]
    if folder is None or len(missing) == len(tokens):
        return None
    if missing:
        raise DatasetError(
            f"{folder / 'sample_data.json'}: scene {scene}: {len(missing)} of {len(tokens)} samples have no "
            f"key frame of LIDAR_TOP with an ego pose, the first of them {missing[0]!r}"
        )
    return np.array([poses[token] for token in tokens])


def submission_text(
    parts: Iterable[tuple[Sequence, Objects]], frames_are_samples: bool = True, use_map: bool = False
) -> str:
    """Tracks in the format of the nuScenes tracking challenge.

    Every sample has its entry. A track carries one name, that of its class in the data if the challenge knows
    it, else its category's. Left out are tracks of unknown category, nuScenes classes that the challenge does
    not track (construction vehicles), and the least sure boxes beyond 500 in a sample.

    Args:
        parts: Sequences and their tracks.
        frames_are_samples: Whether the frames' names are sample tokens; else tokens are sequence and frame.
        use_map: Whether a map was used, for the file's header.
    """
    results: dict[str, list[dict[str, Any]]] = {}
    for sequence, tracks in parts:
        tokens = list(sequence.frame_name)
        if not frames_are_samples:
            tokens = [f"{sequence.name}_{k:06d}" for k in range(len(sequence))]
        results |= {token: [] for token in tokens}
        names = [
            _tracking_name(*pair) for pair in zip(tracks.kind.tolist(), tracks.category.tolist(), strict=True)
        ]
        place = np.column_stack((tracks.center_m, tracks.bottom_m + 0.5 * tracks.height_m))
        size = np.column_stack((tracks.size_m[:, 1], tracks.size_m[:, 0], tracks.height_m))
        zero = np.zeros(len(tracks))
        half = 0.5 * tracks.yaw_rad
        rotation = np.column_stack((np.cos(half), zero, zero, np.sin(half)))
        velocity = np.nan_to_num(tracks.velocity_mps)
        columns = [np.round(c, 6).tolist() for c in (place, size, rotation, velocity, tracks.score)]
        for frame, identity, name, at, extent, turn, speed, score in zip(
            tracks.frame.tolist(), tracks.object_id.tolist(), names, *columns, strict=True
        ):
            if name is None:
                continue
            results[tokens[frame]].append(
                {
                    "sample_token": tokens[frame],
                    "translation": at,
                    "size": extent,
                    "rotation": turn,
                    "velocity": speed,
                    "tracking_id": f"{sequence.name}_{identity}",
                    "tracking_name": name,
                    "tracking_score": score,
                }
            )
    for boxes in results.values():
        if len(boxes) > MAX_BOXES_PER_SAMPLE:
            boxes.sort(key=lambda box: -box["tracking_score"])
            del boxes[MAX_BOXES_PER_SAMPLE:]
    meta = {name: name == "use_lidar" or (name == "use_map" and use_map) for name in _META}
    return json.dumps({"meta": meta, "results": results}, allow_nan=False)


def _tracking_name(kind: str, category: str) -> str | None:
    if kind in TRACKING_CLASSES:
        return kind
    return None if kind in _UNTRACKED else CLASS_OF_CATEGORY.get(category)
