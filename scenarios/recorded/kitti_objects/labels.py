"""KITTI's object labels and results: a line per box, in the axes of the rectified camera.

Type, truncated (0 to 1), occluded (0 to 3), alpha, 2-D box (left, top, right, bottom), h w l, x y z of the
middle of the underside, ry; results have a score as well. Source: readme.txt of the object development kit.
Tracking files have frame and identity before that; AB3DMOT's detections are another table of the same.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.camera import image_boxes
from scenarios.recorded.kitti import DETECTION_COLUMNS, TRACKING_COLUMNS
from scenarios.recorded.kitti_objects.calibration import Calibration
from scenarios.recorded.textfile import TextTable, read_table, read_text
from smartmot.arrays import StrArray
from smartmot.geometry import wrap_angle
from smartmot.pointcloud import Boxes3D
from smartmot.types import BoolArray, FloatArray, frozen

OBJECT_COLUMNS = TRACKING_COLUMNS[2:]
"""Fields of a line; the last one, the score, is optional."""

DONT_CARE = "DontCare"
"""Regions of the image whose objects are not labelled."""

_TYPE_OF_CODE = {1: "Pedestrian", 2: "Car", 3: "Cyclist"}
"""Codes of AB3DMOT's detection files."""


@dataclass(frozen=True, slots=True, eq=False)
class ObjectLines:
    """Lines of label or result files of many frames.

    Args:
        frame: (K,) names of the frames.
        type_name: (K,) KITTI's types.
        truncated: (K,) share outside the image, -1 in results.
        occluded: (K,) 0 visible, 1 partly, 2 largely, 3 unknown, -1 in results.
        alpha_rad: (K,) heading as the camera sees it.
        image_box_px: (K, 4) left, top, right, bottom.
        camera_box: (K, 7) h w l x y z ry.
        score: (K,) confidence; 1 in labels.
        frames: names of all frames, those without a line too.

    Raises:
        ShapeError: shapes disagree.
    """

    frame: StrArray
    type_name: StrArray
    truncated: FloatArray
    occluded: FloatArray
    alpha_rad: FloatArray
    image_box_px: FloatArray
    camera_box: FloatArray
    score: FloatArray
    frames: tuple[str, ...]

    def __post_init__(self) -> None:
        count = len(self.frame)
        for name in ("truncated", "occluded", "alpha_rad", "score"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.float64, (count,), name))
        for name, width in (("image_box_px", 4), ("camera_box", 7)):
            object.__setattr__(self, name, frozen(getattr(self, name), np.float64, (count, width), name))

    def __len__(self) -> int:
        return len(self.frame)

    def chosen(self, mask: BoolArray) -> ObjectLines:
        """The lines for which a (K,) mask is true; the frames stay."""
        return replace(self, **{name: getattr(self, name)[mask] for name in COLUMNS})

    @property
    def boxes(self) -> Boxes3D:
        """The K boxes in the camera's place with axes ahead, left and up.

        Raises:
            ShapeError: a line has no box, as those of DontCare have none.
        """
        h, w, l, x, y, z, ry = self.camera_box.T  # noqa: E741 - KITTI's names
        center = np.column_stack((z, -x, 0.5 * h - y))
        return Boxes3D(center, np.column_stack((l, w, h)), wrap_angle(-ry - 0.5 * np.pi))


COLUMNS = tuple(name for name in ObjectLines.__slots__ if name != "frames")
"""Fields with an entry per line."""


def read_objects(path: Path, *, results: bool = False, scored: bool = False) -> ObjectLines:
    """Read a file of a frame or sequence, a folder of them, or AB3DMOT's folder with one per class.

    Frames are named after their files; those of sequences SEQUENCE/FRAME.

    Args:
        path: file or folder.
        results: whether the lines are those of a detector, which has no regions.
        scored: whether every line must have a score; if not, it is 1 where there is none.

    Raises:
        DatasetError: there is no file, or a line is wrong; the message names file, line and field.
    """
    if path.is_dir():
        files = sorted([*path.glob("*.txt"), *path.glob("*/*.txt")])
        if not files:
            raise DatasetError(f"{path}: no file *.txt and no folder with one")
    else:
        files = [path]
    parts = [_lines(file, results, scored) for file in files]
    frames = sorted({name for part in parts for name in part.frames})
    if any("/" in name for name in frames):
        # an empty file does not show its layout: beside files of sequences it is one of them
        filled = {name for part in parts for name in part.frame.tolist()}
        frames = [name for name in frames if "/" in name or name in filled]
    columns: dict[str, Any] = {
        name: np.concatenate([getattr(part, name) for part in parts]) for name in COLUMNS
    }
    return ObjectLines(**columns, frames=tuple(frames))


def _lines(path: Path, results: bool, scored: bool) -> ObjectLines:
    """The lines of one file of any of the layouts."""
    first = next((line for line in read_text(path).splitlines() if line.strip()), "")
    if "," in first:
        table = read_table(path, DETECTION_COLUMNS, ("type",))
        sequence = "" if path.stem in _TYPE_OF_CODE.values() else path.stem
        return _sequence_lines(_with_types(table), sequence, results, scored)
    if not first or len(first.split()) <= len(OBJECT_COLUMNS):
        table = read_table(path, OBJECT_COLUMNS, ("type",), optional=1)
        return _checked(table, np.full(len(table), path.stem), (path.stem,), results, scored)
    return _sequence_lines(
        read_table(path, TRACKING_COLUMNS, ("type",), optional=1), path.stem, results, scored
    )


def _with_types(table: TextTable) -> TextTable:
    """AB3DMOT's table with types for their codes."""
    types = {str(code): name for code, name in _TYPE_OF_CODE.items()}
    known = np.isin(table["type"], [*types, *types.values()])
    table.require(known, "type", "must be 1, 2, 3 or a type of KITTI")
    names = np.array([types.get(name, name) for name in table["type"].tolist()], dtype=np.str_)
    return TextTable(table.path, table.line, {**table.columns, "type": names})


def _sequence_lines(table: TextTable, sequence: str, results: bool, scored: bool) -> ObjectLines:
    """Lines with a number of the frame."""
    number = table.whole("frame")
    table.require(number >= 0, "frame", "must not be negative")
    prefix = f"{sequence}/"
    names = np.array([f"{prefix}{k:06d}" for k in number.tolist()], dtype=np.str_)
    return _checked(table, names, tuple(np.unique(names).tolist()), results, scored)


def _checked(
    table: TextTable, frame: StrArray, frames: tuple[str, ...], results: bool, scored: bool
) -> ObjectLines:
    """Lines whose boxes are boxes."""
    if results:
        rule = "is a region of label files and no detection; leave such lines out"
        table.require(table["type"] != DONT_CARE, "type", rule)
    if scored and len(table) and "score" not in table:
        raise DatasetError(
            f"{table.path}:{table.line[0]}: field 'score' is missing, as in labels; add it at the line's end"
        )
    given = [name for name in ("score", "truncated", "occluded") if name in table]
    table.require_finite("x1", "y1", "x2", "y2", "h", "w", "l", "x", "y", "z", "ry", "alpha", *given)
    region = table["type"] == DONT_CARE
    for name in ("h", "w", "l"):
        table.require(region | (table[name] > 0.0), name, "must be positive")
    return ObjectLines(
        frame,
        table["type"],
        _optional(table, "truncated", -1.0),
        _optional(table, "occluded", -1.0),
        table["alpha"],
        table.stacked("x1", "y1", "x2", "y2"),
        table.stacked("h", "w", "l", "x", "y", "z", "ry"),
        _optional(table, "score", 1.0),
        frames,
    )


def _optional(table: TextTable, name: str, default: float) -> FloatArray:
    """A column, or the same number for every line of a table that does not have it."""
    return np.asarray(table[name]) if name in table else np.full(len(table), default)


def object_text(
    boxes: Boxes3D,
    type_names: Iterable[str],
    calibration: Calibration,
    score: FloatArray | None = None,
    truncated: FloatArray | None = None,
    occluded: FloatArray | None = None,
    *,
    image: bool = True,
) -> str:
    """Label or result lines of one frame; alpha and the 2-D box, cut at the image's border, are computed.

    Args:
        boxes: K boxes of the LiDAR's frame.
        type_names: K types of KITTI.
        calibration: Of the frame.
        score: (K,) confidences, for results.
        truncated: (K,) shares outside the image; None: -1, as in results.
        occluded: (K,) levels; None: -1.
        image: whether there is one; if not, the 2-D box is 0 0 0 0.
    """
    camera_box = calibration.boxes_to_camera(boxes)
    x, z, ry = camera_box[:, 3], camera_box[:, 5], camera_box[:, 6]
    alpha = wrap_angle(ry - np.arctan2(x, z))
    pixels = image_boxes(camera_box, calibration.projection[2]) if image else np.zeros((len(boxes), 4))
    lines = []
    for row, name in enumerate(type_names):
        share = -1.0 if truncated is None else truncated[row]
        level = -1 if occluded is None else int(occluded[row])
        numbers = [alpha[row], *pixels[row], *camera_box[row]]
        numbers += [] if score is None else [score[row]]
        lines.append(f"{name} {share:g} {level} {' '.join(f'{number:.17g}' for number in numbers)}\n")
    return "".join(lines)
