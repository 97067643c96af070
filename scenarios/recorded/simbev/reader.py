"""SimBEV: reads ego poses and labels of a data set that was made with CARLA.

A folder holds `simbev/` (or is that folder itself)::

    infos/simbev_infos_{train,val,test}.json      scenes, their frames, ego poses
    configs/SimBEV-scene-0000.yaml                `timestep`, seconds
    ground-truth/det/SimBEV-scene-0000-frame-0000-GT_DET.bin or .json      labels of a frame
    ground-truth/hd_map/SimBEV-scene-0000-frame-0000-HD_MAP.json      the ego's lane (`hd_map`)

The time of a frame is its number times the time step: `timestamp` is the clock of the computer that recorded.
Paths in the files are those of that computer; only their names count. Labels are eight corners in the world's
axes, which are right-handed (CARLA's y negated), as are their velocities. `.bin` is a pickle, of which arrays
and plain values are read and nothing is run (`safe_pickle`). Post-processing adds `class` and `valid_flag`;
without it the class follows from the semantic tag. No detector's output is part of the layout.

Source: SimBEV (GoodarzMehr/SimBEV, 2026), README and the files that it writes.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import Path, PurePosixPath
from typing import Any

import numpy as np

from scenarios.errors import DatasetError
from scenarios.reading import ReadError, shown
from scenarios.recorded.classes import CLASSES_CSV, ClassMap, read_classes
from scenarios.recorded.dataset import (
    LEFT_OUT,
    Dataset,
    Objects,
    Sequence,
    finished,
)
from scenarios.recorded.poses import rigid, rotation_matrix
from scenarios.recorded.simbev.safe_pickle import PickledArray, read_npy_list
from scenarios.recorded.textfile import MAX_FRAMES, is_given, read_json, read_text
from smartmot.types import FloatArray, IntArray

CATEGORY_OF_CLASS = {
    "car": "car",
    "truck": "truck",
    "bus": "truck",
    "motorcycle": "motorcycle",
    "bicycle": "cyclist",
    "rider": "cyclist",
    "pedestrian": "pedestrian",
    "traffic_light": LEFT_OUT,
    "traffic_sign": LEFT_OUT,
    "traffic_cone": LEFT_OUT,
    "barrier": LEFT_OUT,
}
"""Classes of the post-processing."""

CLASS_OF_TAG = {
    12: "pedestrian",
    14: "car",
    15: "truck",
    16: "bus",
    18: "motorcycle",
    19: "bicycle",
    13: "rider",
    7: "traffic_light",
    8: "traffic_sign",
    30: "traffic_cone",
    31: "barrier",
}
"""CARLA's semantic tags; a vehicle has its rider's tag as well, and is what comes first here."""

INFOS, CONFIGS, LABELS, HD_MAPS = "infos", "configs", "ground-truth/det", "ground-truth/hd_map"
_INFOS_GLOB = "simbev_infos_*.json"
_SCENE = re.compile(r"scene_(\d{1,9})")
_TIMESTEP = re.compile(r"^[ \t]*timestep[ \t]*:[ \t]*([^\s#]+)", re.MULTILINE)

TIMESTEP_S = 0.05
"""SimBEV's default, where a scene's configuration is not there."""

MAX_TIMESTEP_S = 10.0
"""Of a time step in seconds; a greater one is in another unit."""

MAX_LABELS, MAX_LABEL_BYTES, MAX_TAGS = 10_000, 10_000_000, 256
"""Of one frame, and of a label: CARLA runs some hundred road users, with one or two tags each; a label takes
about 1 kB."""

EGO_ITSELF_M = 0.5
"""No other vehicle's centre is so near to the ego's: a box there is the ego's own."""

_LONGEST_NAME = 200
"""Bytes of a file's name; file systems have 255."""

_CORNERS, _VECTOR = (8, 3), (3,)


@dataclass(slots=True)
class _Rows:
    """Labels of a scene, column by column."""

    frame: list[int] = field(default_factory=list)
    identity: list[int] = field(default_factory=list)
    kind: list[str] = field(default_factory=list)
    corners: list[Any] = field(default_factory=list)
    velocity: list[Any] = field(default_factory=list)
    ignored: list[bool] = field(default_factory=list)


@dataclass(slots=True)
class _Counts:
    """What is to be said of the data set."""

    unprocessed: list[str] = field(default_factory=list)
    without_timestep: list[str] = field(default_factory=list)
    unknown: Counter[str] = field(default_factory=Counter)
    left_out: Counter[str] = field(default_factory=Counter)
    ego: int = 0

    def notes(self) -> list[str]:
        """A line each."""
        lines = []
        if self.unprocessed:
            lines.append(
                f"{_listed(self.unprocessed)}: labels without post-processing, so those that no sensor point "
                "hits count as well"
            )
        if self.without_timestep:
            lines.append(
                f"{_listed(self.without_timestep)}: no timestep in {CONFIGS}: taken as {TIMESTEP_S:g} s"
            )
        if self.unknown:
            classes = ", ".join(
                f"{count} of class {shown(name)}" for name, count in self.unknown.most_common(5)
            )
            lines.append(f"labels left out: {classes}; give the class a category in {CLASSES_CSV}")
        if self.left_out:
            listed = ", ".join(f"{count} {name}" for name, count in sorted(self.left_out.items()))
            lines.append(f"labels left out, for they are no road users: {listed}")
        if self.ego:
            lines.append(f"{self.ego} boxes of the ego itself left out")
        return lines


def _listed(names: list[str]) -> str:
    return ", ".join(names[:3]) + (f" and {len(names) - 3} more" if len(names) > 3 else "")


def is_simbev(path: Path) -> bool:
    """Whether a folder or file is SimBEV's."""
    if path.is_file():
        return PurePosixPath(path.name).match(_INFOS_GLOB)
    return any(any(place.glob(_INFOS_GLOB)) for place in _places(path))


def read_simbev(folder: Path) -> Dataset:
    """Read a folder in the layout above, or the scenes of one of its files `simbev_infos_*.json`.

    Raises:
        DatasetError: A file is missing or wrong, or a pickle holds something else than labels; the message
            names file, place and field.
    """
    root, counts = simbev_root(folder), _Counts()
    classes = read_classes(folder if folder.is_dir() else root, CATEGORY_OF_CLASS)
    scenes: dict[str, Path] = {}
    sequences = []
    for path in infos_of(folder):
        for name, frames in scene_frames(path).items():
            if name in scenes:
                raise DatasetError(f"{path}: scene {name!r} is in {scenes[name].name} as well")
            scenes[name] = path
            sequences.append(_sequence(root, path, name, frames, classes, counts))
    return finished("simbev", sequences, tuple(counts.notes()))


def simbev_root(path: Path) -> Path:
    """The folder that holds `infos`."""
    return infos_of(path)[0].parent.parent


def infos_of(path: Path) -> list[Path]:
    """The files of scenes below a folder, or the one that is named.

    Raises:
        DatasetError: There are none.
    """
    if path.is_file():
        return [path]
    for place in _places(path):
        if files := sorted(place.glob(_INFOS_GLOB)):
            return files
    raise DatasetError(f"{path}: no simbev/{INFOS}/{_INFOS_GLOB} in it; see docs/formats.md")


def _places(folder: Path) -> tuple[Path, ...]:
    return (folder / INFOS, folder / "simbev" / INFOS, folder)


def scene_frames(path: Path) -> dict[str, list[dict[str, Any]]]:
    """The frames of each scene of a file, in the order of time.

    Raises:
        DatasetError: The file is wrong.
    """
    content = read_json(path)
    data = content.get("data") if isinstance(content, dict) else None
    if not isinstance(data, dict):
        raise DatasetError(f"{path}: no object 'data' with scenes by name")
    scenes = {}
    for name, scene in data.items():
        frames = scene.get("scene_data") if isinstance(scene, dict) else None
        if not _SCENE.fullmatch(name) or not isinstance(frames, list):
            raise DatasetError(f"{path}: scene {shown(name)}: expected scene_0000 with a list 'scene_data'")
        for k, info in enumerate(frames):
            number = info.get("frame") if isinstance(info, dict) else None
            if type(number) is not int or not 0 <= number < MAX_FRAMES:
                raise DatasetError(
                    f"{path}: scene {name}[{k}]: field 'frame' must be a whole number from 0 to "
                    f"{MAX_FRAMES - 1}, got {shown(number)}"
                )
        frames = sorted(frames, key=lambda info: info["frame"])
        for before, after in pairwise(frames):
            if before["frame"] == after["frame"]:
                raise DatasetError(f"{path}: scene {name}: frame {after['frame']} is there twice")
        scenes[name] = frames
    return scenes


def file_of(root: Path, folder: str, info: dict[str, Any], field_name: str, where: str) -> Path:
    """A file of a frame, by its name below the folder; its recorded folder is another computer's.

    Raises:
        DatasetError: The field is no path.
    """
    recorded = info.get(field_name)
    name = re.split(r"[/\\]", recorded)[-1] if isinstance(recorded, str) else ""
    if not name or name in (".", "..") or len(name.encode()) > _LONGEST_NAME or not name.isprintable():
        raise DatasetError(f"{where}: field {field_name!r} must be a path, got {shown(recorded)}")
    return root / folder / name


def _sequence(
    root: Path, path: Path, name: str, frames: list[dict[str, Any]], classes: ClassMap, counts: _Counts
) -> Sequence:
    """One scene."""
    places, rotations, rows = [], [], _Rows()
    processed = True
    for k, info in enumerate(frames):
        where = f"{path}: scene {name}, frame {info['frame']}"
        places.append(_numbers(info.get("ego2global_translation"), _VECTOR, where, "ego2global_translation"))
        rotation = _numbers(info.get("ego2global_rotation"), (4,), where, "ego2global_rotation")
        if not any(rotation):
            raise DatasetError(f"{where}: field 'ego2global_rotation' must not be 0")
        rotations.append(rotation_matrix(np.array(rotation, dtype=np.float64)))
        file = file_of(root, LABELS, info, "GT_DET", where)
        for index, label in enumerate(_labels(file)):
            if _add(rows, k, label, f"{file}: label {index}", classes, counts):
                processed &= "valid_flag" in label
    if rows.frame and not processed:
        counts.unprocessed.append(name)
    place_m = _floats(places, (-1, 3), path)
    pose = rigid(np.array(rotations).reshape(-1, 3, 3), place_m)
    labels = _objects(rows, classes, path)
    own = np.hypot(*(labels.center_m - place_m[labels.frame, :2]).T) < EGO_ITSELF_M
    counts.ego += int(own.sum())
    labels = labels[~own]
    number = [info["frame"] for info in frames]
    return Sequence(
        name=name,
        stamp_s=np.array(number, dtype=np.float64) * _timestep_s(root, name, counts.without_timestep),
        frame_name=tuple(map(str, number)),
        detections=Objects.empty(),
        labels=labels,
        world_SE3_ego=pose,
    )


def frame_labels(path: Path, classes: ClassMap) -> tuple[Objects, IntArray | None]:
    """Road users among the labels of one frame, and (K,) their LiDAR points, where post-processing counted.

    Raises:
        DatasetError: The file is wrong.
    """
    rows, points = _Rows(), []
    for index, label in enumerate(_labels(path)):
        if _add(rows, 0, label, f"{path}: label {index}", classes, _Counts()):
            points.append(_plain(label.get("num_lidar_pts")))
    counted = all(_is_number(count) and 0 <= count < 2**31 for count in points)
    return _objects(rows, classes, path), np.array(points, dtype=np.int64) if counted else None


def _timestep_s(root: Path, scene: str, missing: list[str]) -> float:
    """Time between the frames of a scene, by its configuration."""
    match = _SCENE.fullmatch(scene)
    assert match is not None  # as of every scene that was read
    path = root / CONFIGS / f"SimBEV-scene-{match[1]}.yaml"
    timestep = _TIMESTEP.search(read_text(path)) if is_given(path) else None
    if timestep is None:
        missing.append(scene)
        return TIMESTEP_S
    try:
        timestep_s = float(timestep[1].strip("'\""))
    except ValueError:
        timestep_s = 0.0
    if not 0.0 < timestep_s <= MAX_TIMESTEP_S:
        raise DatasetError(
            f"{path}: timestep must be between 0 and {MAX_TIMESTEP_S:g} s, got {shown(timestep[1])}"
        )
    return timestep_s


def _labels(path: Path) -> list[Any]:
    """Labels of a frame; the file may be in the other form than the frame says."""
    other = path.with_suffix(".json" if path.suffix == ".bin" else ".bin")
    if not path.is_file() and other.is_file():
        path = other
    if path.suffix == ".json":
        labels = read_json(path)
        if not isinstance(labels, list):
            raise DatasetError(f"{path}: expected a list of labels")
    else:
        labels = _unpickled(path)
    if len(labels) > MAX_LABELS:
        raise DatasetError(f"{path}: {len(labels)} labels in one frame, {MAX_LABELS} at most expected")
    return labels


def _unpickled(path: Path) -> list[Any]:
    try:
        if path.stat().st_size > MAX_LABEL_BYTES:
            raise DatasetError(f"{path}: over {MAX_LABEL_BYTES} bytes, too many for the labels of a frame")
        return read_npy_list(path.read_bytes())
    except ReadError as error:
        raise DatasetError(f"{path}: {error}") from None
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror}; for the folder's layout see docs/formats.md") from None


def _add(rows: _Rows, frame: int, label: object, where: str, classes: ClassMap, counts: _Counts) -> bool:
    """Take a label, if it is one of a road user."""
    if not isinstance(label, dict):
        raise DatasetError(f"{where}: expected an object, got {shown(label)}")
    kind = _class_of(label, where)
    if classes.get(kind, LEFT_OUT) == LEFT_OUT:
        (counts.unknown if kind and kind not in classes else counts.left_out)[kind or "without a class"] += 1
        return False
    rows.frame.append(frame)
    rows.identity.append(_identity(label, where))
    rows.kind.append(kind)
    rows.corners.append(_numbers(label.get("bounding_box"), _CORNERS, where, "bounding_box"))
    velocity = label.get("linear_velocity")
    known = velocity is not None
    rows.velocity.append(_numbers(velocity, _VECTOR, where, "linear_velocity") if known else 3 * (np.nan,))
    rows.ignored.append(not _valid(label, where))
    return True


def _identity(label: dict[str, Any], where: str) -> int:
    identity = _plain(label.get("id"))
    is_whole = isinstance(identity, (int, np.integer)) and not isinstance(identity, bool)
    is_whole |= isinstance(identity, float) and identity.is_integer()
    if not is_whole or abs(identity) >= 2**64:
        raise DatasetError(f"{where}: field 'id' must be a whole number, got {shown(identity)}")
    return int(identity) % 2**63  # CARLA's have up to 64 bits without a sign


def _valid(label: dict[str, Any], where: str) -> bool:
    flag = _plain(label.get("valid_flag", True))
    if not isinstance(flag, (bool, np.bool_)):
        raise DatasetError(f"{where}: field 'valid_flag' must be true or false, got {shown(flag)}")
    return bool(flag)


def _class_of(label: dict[str, Any], where: str) -> str:
    """Class by the post-processing, else by the semantic tags; empty for what is no road user."""
    name = _plain(label.get("class"))
    name = str(name) if isinstance(name, str) else ""
    # the box of a ridden vehicle is the vehicle's, whichever of its tags came last
    if name not in ("", "rider"):
        return name
    tags = _plain(label.get("semantic_tags"))
    if isinstance(tags, np.ndarray) and tags.size <= MAX_TAGS:
        tags = tags.tolist()
    if not isinstance(tags, (list, tuple)) or len(tags) > MAX_TAGS:
        raise DatasetError(f"{where}: field 'semantic_tags' must be a list, got {shown(tags)}")
    kinds = [kind for tag, kind in CLASS_OF_TAG.items() if any(_is_number(t) and t == tag for t in tags)]
    return kinds[0] if kinds else name


def _plain(value: object) -> Any:
    return value.value if isinstance(value, PickledArray) else value


def _is_number(value: object) -> bool:
    return isinstance(value, (int, float, np.integer, np.floating)) and not isinstance(value, bool)


def _numbers(value: object, shape: tuple[int, ...], where: str, name: str) -> Any:
    """A field of numbers, as an array or as lists.

    Raises:
        DatasetError: It is none, or has another shape; nothing of a greater shape is made.
    """
    value = _plain(value)
    good = value.shape == shape and value.dtype.kind in "iuf" if isinstance(value, np.ndarray) else None
    if good is None:
        good = _has_shape(value, shape)
    if not good:
        size = " x ".join(map(str, shape))
        raise DatasetError(f"{where}: field {name!r} must be {size} numbers, got {shown(value)}")
    return value


def _has_shape(value: object, shape: tuple[int, ...]) -> bool:
    if not shape:
        return _is_number(value)
    if not isinstance(value, (list, tuple)) or len(value) != shape[0]:
        return False
    return all(_has_shape(item, shape[1:]) for item in value)


def _floats(values: Iterable[Any], shape: tuple[int, ...], path: Path) -> FloatArray:
    try:
        return np.array(values, dtype=np.float64).reshape(shape)
    except OverflowError:
        raise DatasetError(f"{path}: a number in a pose or label is beyond all floats") from None


def _objects(rows: _Rows, classes: ClassMap, path: Path) -> Objects:
    """Boxes from corners: 0 to 4 is the length, ahead; 0 to 2 the width; 0 to 1 the height."""
    corner = _floats(rows.corners, (-1, *_CORNERS), path)
    with np.errstate(invalid="ignore", over="ignore"):  # impossible boxes are left out later
        edge = corner[:, [4, 2, 1]] - corner[:, :1]
        size = np.linalg.norm(edge, axis=2)
        center = 0.5 * (corner[:, 0] + corner[:, 7])
        bottom = center[:, 2] - 0.5 * size[:, 2]
    return Objects.of(
        np.array(rows.frame, dtype=np.int64),
        center[:, :2],
        object_id=np.array(rows.identity, dtype=np.int64),
        category=np.array([classes[kind] for kind in rows.kind], dtype=np.str_),
        kind=np.array(rows.kind, dtype=np.str_),
        size_m=size[:, :2],
        yaw_rad=np.arctan2(edge[:, 0, 1], edge[:, 0, 0]),
        bottom_m=bottom,
        height_m=size[:, 2],
        velocity_mps=_floats(rows.velocity, (-1, 3), path)[:, :2],
        ignored=np.array(rows.ignored, dtype=np.bool_),
    )
