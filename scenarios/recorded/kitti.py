"""KITTI tracking data with AB3DMOT's detections: reader, writer and the camera's projection.

Layout of the folder, every file per sequence::

    detections/<Class>/<seq>.txt   frame,type,x1,y1,x2,y2,score,h,w,l,x,y,z,ry,alpha     (AB3DMOT)
    detections/<seq>.txt           or KITTI tracking text; without its last field, the score, that is 1;
                                   without the folder there are labels alone
    calib/<seq>.txt                row P2                                               (optional)
    ego_pose/<seq>.txt             3 x 4 pose of the camera in the first camera's frame (optional)
    oxts/<seq>.txt                 or KITTI's GPS and IMU records                       (optional)
    label_02/<seq>.txt             KITTI tracking labels                                (optional)
    times/<seq>.txt                one time per frame, seconds; 10 Hz without it        (optional)
    seqmap.txt                     name, "empty", first frame, number of frames         (optional)
    classes.csv                    other types, or others' categories (`classes`)       (optional)

KITTI's camera frame is x right, y down, z ahead; a box's origin is the middle of its underside. The world
frame of `Sequence` is the first camera's, turned to x ahead, y left, z up.

Source: KITTI tracking devkit, readme.txt; AB3DMOT, docs/KITTI.md.
"""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from scenarios.errors import DatasetError
from scenarios.reading import shown
from scenarios.recorded.camera import from_camera, image_boxes, to_camera
from scenarios.recorded.classes import CLASSES_CSV, ClassMap, categories, read_classes, require_categories
from scenarios.recorded.dataset import Camera, Dataset, Objects, Sequence, finished
from scenarios.recorded.kitti_poses import read_matrix, read_poses
from scenarios.recorded.textfile import (
    MAX_FRAMES,
    TextTable,
    is_given,
    is_given_folder,
    read_table,
    read_text,
)
from smartmot.geometry import wrap_angle
from smartmot.types import FloatArray, IntArray

TRACKING_COLUMNS = (
    *("frame", "id", "type", "truncated", "occluded", "alpha", "x1", "y1", "x2", "y2"),
    *("h", "w", "l", "x", "y", "z", "ry", "score"),
)
DETECTION_COLUMNS = (
    *("frame", "type", "x1", "y1", "x2", "y2", "score"),
    *("h", "w", "l", "x", "y", "z", "ry", "alpha"),
)
CATEGORY_OF_TYPE = {
    "Car": "car",
    "Van": "car",
    "Truck": "truck",
    "Pedestrian": "pedestrian",
    "Person_sitting": "pedestrian",
    "Cyclist": "cyclist",
    "Person": "unknown",
    "Tram": "unknown",
    "Misc": "unknown",
}
"""KITTI's types as categories."""

NEIGHBOURS = ("Van", "Person_sitting")
"""Types so near to a scored one that a track on them is no mistake (KITTI's evaluation)."""

TYPE_OF_CATEGORY = {
    "car": "Car",
    "pedestrian": "Pedestrian",
    "cyclist": "Cyclist",
    "truck": "Truck",
    "motorcycle": "Misc",
    "unknown": "Misc",
}
_TYPE_OF_CODE = {1: "Pedestrian", 2: "Car", 3: "Cyclist"}
"""Codes of AB3DMOT's detection files."""

FRAME_S = 0.1
"""KITTI's frames are 0.1 s apart."""

MAX_TRUNCATION, MAX_OCCLUSION = 0, 2
"""Labels beyond these are ignored (KITTI tracking evaluation)."""

_COUNT = re.compile(r"[0-9]{1,18}")


def read_kitti(folder: Path) -> Dataset:
    """Read a folder in the layout above.

    Raises:
        DatasetError: A file is missing or wrong; the message names file, line and field.
    """
    lengths = _sequence_map(folder)
    files = _detection_files(folder)
    labels_only = not (folder / "detections").is_dir() and is_given_folder(folder / "label_02")
    stems = (path.stem for path in (folder / "label_02").glob("*.txt")) if labels_only else files
    names = list(lengths) if lengths else sorted(stems)
    if not names:
        raise DatasetError(
            f"{folder}: no detections/*/<seq>.txt or detections/<seq>.txt (see docs/formats.md)"
        )
    classes = read_classes(folder, CATEGORY_OF_TYPE)
    sequences = [
        _read_sequence(
            folder, name, [] if labels_only else _files_of(folder, files, name), lengths.get(name), classes
        )
        for name in names
    ]
    notes = []
    if all(s.world_SE3_ego is None for s in sequences):
        notes.append("no ego poses: tracking in the vehicle's own frame")
    if not (folder / "times").is_dir():
        notes.append(f"no times/<seq>.txt: frames are {FRAME_S:g} s apart")
    return finished("kitti", sequences, tuple(notes))


def _sequence_map(folder: Path) -> dict[str, int]:
    """Frames per sequence; empty without a seqmap."""
    path = folder / "seqmap.txt"
    if not is_given(path):
        return {}
    lengths: dict[str, int] = {}
    for number, line in enumerate(read_text(path).splitlines(), 1):
        fields = line.split()
        if not fields:
            continue
        if len(fields) != 4 or not all(map(_COUNT.fullmatch, fields[2:])):
            raise DatasetError(
                f"{path}:{number}: expected 'name empty first_frame frames', got {shown(line)}"
            )
        name, frames = fields[0], int(fields[3])
        if "/" in name or "\\" in name or "\0" in name:
            raise DatasetError(f"{path}:{number}: {shown(name)} is no name of a sequence")
        if frames > MAX_FRAMES:
            raise DatasetError(f"{path}:{number}: {frames} frames, {MAX_FRAMES} at most expected")
        if name in lengths:
            raise DatasetError(f"{path}:{number}: sequence {shown(name)} is there twice")
        lengths[name] = frames
    return lengths


def _detection_files(folder: Path) -> dict[str, list[Path]]:
    """Detection files of each sequence."""
    root = folder / "detections"
    files: dict[str, list[Path]] = {}
    for path in sorted([*root.glob("*.txt"), *root.glob("*/*.txt")]):
        files.setdefault(path.stem, []).append(path)
    return files


def _files_of(folder: Path, files: dict[str, list[Path]], name: str) -> list[Path]:
    """The detection files of a sequence, of which there has to be one."""
    if name not in files:
        raise DatasetError(
            f"{folder / 'detections'}: no file {name}.txt; write an empty one for no detections"
        )
    return files[name]


def _read_sequence(
    folder: Path, name: str, files: list[Path], length: int | None, classes: ClassMap
) -> Sequence:
    """One sequence of all folders; without a seqmap it is as long as what is known of it."""
    tables = [_detection_table(path) for path in files]
    label_path = folder / "label_02" / f"{name}.txt"
    label_table = None
    if is_given_folder(label_path.parent):
        label_table = read_table(label_path, TRACKING_COLUMNS, ("type",), optional=1)
    poses = read_poses(folder, name)
    times = _read_times(folder / "times" / f"{name}.txt")
    if length is None:
        length = _length([values for values in (poses, times) if values is not None], tables, label_table)
    for what, values in (("ego poses", poses), ("times", times)):
        if values is not None and len(values) < length:
            raise DatasetError(f"{folder}: sequence {name} has {len(values)} {what} for {length} frames")
    pose = None if poses is None else poses[:length]
    calibration = folder / "calib" / f"{name}.txt"
    detections = _joined([_objects(table, length, pose, classes) for table in tables])
    labels = camera = None
    dont_care = (np.zeros(0, dtype=np.int64), np.zeros((0, 4)))
    if label_table is not None:
        labels = _labels(label_table, length, pose, classes)
        dont_care = _dont_care(label_table)
    if is_given_folder(calibration.parent):
        camera = Camera(read_matrix(calibration, ("P2",), (3, 4)), *dont_care)
    return Sequence(
        name=name,
        stamp_s=np.arange(length, dtype=np.float64) * FRAME_S if times is None else times[:length],
        frame_name=tuple(map(str, range(length))),
        detections=detections,
        labels=labels,
        world_SE3_ego=pose,
        camera=camera,
    )


def _length(known: list[FloatArray], tables: list[TextTable], label_table: TextTable | None) -> int:
    """Frames of a sequence: those of its poses or else times, and up to the last of its boxes."""
    given = tables + ([label_table] if label_table is not None else [])
    for table in given:
        table.require(table["frame"] < MAX_FRAMES, "frame", f"must be under {MAX_FRAMES}")
    last = [int(table.whole("frame").max()) + 1 for table in given if len(table)]
    return max([*map(len, known[:1]), *last], default=0)


def _detection_table(path: Path) -> TextTable:
    """Detections in either format, with the columns of both."""
    first = next((line for line in read_text(path).splitlines() if line.strip()), "")
    if "," not in first and len(first.split()) != len(DETECTION_COLUMNS):
        table = read_table(path, TRACKING_COLUMNS, ("type",), optional=1)
    else:
        table = read_table(path, DETECTION_COLUMNS)
        codes = table["type"]
        table.require(
            np.isin(codes, list(_TYPE_OF_CODE)), "type", "must be 1 (Pedestrian), 2 (Car) or 3 (Cyclist)"
        )
        names = np.array(["", *(_TYPE_OF_CODE[k] for k in (1, 2, 3))])
        table.columns["type"] = names[codes.astype(np.int64)]
    return table


def _objects(
    table: TextTable, length: int, pose: FloatArray | None, classes: ClassMap, **columns: np.ndarray
) -> Objects:
    """Rows of a table as boxes in the world frame, with further columns of `Objects`."""
    frame = table.whole("frame")
    table.require((frame >= 0) & (frame < length), "frame", f"must lie in 0..{length - 1}")
    rule = f"is no type of KITTI and not in {CLASSES_CSV}"
    columns["category"], columns["kind"] = require_categories(table, "type", classes, rule), table["type"]
    if "score" in table:
        columns["score"] = table["score"]
    if "id" in table:
        columns["object_id"] = table.whole("id")
    boxes = table.stacked("h", "w", "l", "x", "y", "z", "ry")
    return from_camera(frame, boxes, pose, **columns)


def _labels(table: TextTable, length: int, pose: FloatArray | None, classes: ClassMap) -> Objects:
    """The labelled objects, with KITTI's rules of what is ignored."""
    rows = table.rows(table["type"] != "DontCare")
    rows.columns.pop("score", None)
    ignored = np.isin(rows["type"], NEIGHBOURS)
    ignored |= (rows["truncated"] > MAX_TRUNCATION) | (rows["occluded"] > MAX_OCCLUSION)
    return _objects(rows, length, pose, classes, ignored=ignored)


def _dont_care(table: TextTable) -> tuple[IntArray, FloatArray]:
    """Frames and image regions that have no labels."""
    chosen = table["type"] == "DontCare"
    frame = table.whole("frame")[chosen]
    order = np.argsort(frame, kind="stable")
    return frame[order], table.stacked("x1", "y1", "x2", "y2")[chosen][order]


def read_tracks(path: Path, length: int, world_SE3_ego: FloatArray | None = None) -> Objects:
    """Tracks in KITTI tracking text, as `write_tracks` and other trackers write them.

    Args:
        path: The file.
        length: Frames of the sequence.
        world_SE3_ego: (F, 4, 4) poses of the sequence.

    Raises:
        DatasetError: The file is missing or wrong.
    """
    table = read_table(path, TRACKING_COLUMNS, ("type",), optional=1)
    return _objects(table, length, world_SE3_ego, CATEGORY_OF_TYPE)


def tracking_text(sequence: Sequence, tracks: Objects) -> str:
    """Tracks as KITTI tracking text, with boxes in the image projected from those in space.

    Truncation and occlusion are not known and written as 0. Without calibration the image boxes are -1.
    Scores are written as they are in `tracks`.
    """
    boxes = to_camera(tracks, sequence.world_SE3_ego)
    if sequence.camera is None:
        image = np.full((len(tracks), 4), -1.0)
    else:
        image = image_boxes(boxes, sequence.camera.projection)
    alpha = wrap_angle(boxes[:, 6] - np.arctan2(boxes[:, 3], boxes[:, 5]))
    kind = categories(tracks.category, TYPE_OF_CATEGORY)
    numbers = np.column_stack((alpha, image, boxes, tracks.score))
    form = "%d %d %s 0 0" + " %.6f" * numbers.shape[1]
    frame_number = sequence.frame_numbers()[tracks.frame]
    rows = zip(frame_number.tolist(), tracks.object_id.tolist(), kind.tolist(), numbers.tolist(), strict=True)
    return "".join(form % (frame, track, name, *values) + "\n" for frame, track, name, values in rows)


def _joined(parts: list[Objects]) -> Objects:
    """Rows of several values as one."""
    if not parts:
        return Objects.empty()
    if len(parts) == 1:
        return parts[0]
    names = ("frame", "category", "kind", "score", "center_m", "size_m", "yaw_rad", "bottom_m", "height_m")
    return Objects.of(**{name: np.concatenate([getattr(part, name) for part in parts]) for name in names})


def _read_times(path: Path) -> FloatArray | None:
    """(F,) seconds; None without the folder."""
    if not is_given_folder(path.parent):
        return None
    table = read_table(path, ["stamp_s"])
    table.require_finite("stamp_s")
    return table["stamp_s"]
