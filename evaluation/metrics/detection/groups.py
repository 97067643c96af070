"""Labels and detections by range, points or occlusion."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np

from evaluation.errors import ArgumentError
from scenarios.recorded.clouds.files import file_format, read_cloud
from scenarios.recorded.kitti_objects.calibration import read_calibration
from scenarios.recorded.kitti_objects.labels import ObjectLines
from smartmot.types import BoolArray, FloatArray, IntArray

RANGE_EDGES_M = (0.0, 10.0, 20.0, 30.0, 40.0, 60.0, np.inf)
POINT_EDGES = (0.0, 1.0, 10.0, 50.0, 200.0, np.inf)
OCCLUSIONS = ("visible", "partly occluded", "largely occluded", "unknown")
"""KITTI's levels 0 to 3 (readme.txt of the object development kit)."""

GROUPINGS = ("range", "points", "occlusion")


@dataclass(frozen=True, slots=True, eq=False)
class Group:
    """A part of the labels and of the detections.

    Args:
        name: for the table.
        labels: (N,) its labels.
        detections: (M,) its detections; None: detections cannot be in one, as nobody knows their occlusion.
    """

    name: str
    labels: BoolArray
    detections: BoolArray | None


def range_groups(labels: ObjectLines, detections: ObjectLines) -> list[Group]:
    """By the distance on the ground from the camera, which in KITTI's car is 0.27 m ahead of the LiDAR."""
    ranges = [np.hypot(*lines.camera_box[:, (3, 5)].T) for lines in (labels, detections)]
    return _between(RANGE_EDGES_M, ranges[0], ranges[1], "{:g} to {:g} m", "over {:g} m")


def point_groups(
    labels: ObjectLines, detections: ObjectLines, clouds: Path, calibration: Path
) -> list[Group]:
    """By the points in each box.

    Args:
        labels: N labels.
        detections: M detections.
        clouds: Folder with a cloud per frame, in one per sequence if there are several.
        calibration: File for all frames, or folder with one per frame or sequence.

    Raises:
        ArgumentError: there is no cloud of a frame with boxes.
        DatasetError: a file is damaged.
    """
    counts = [_point_counts(lines, clouds, calibration) for lines in (labels, detections)]
    groups = _between(POINT_EDGES, counts[0], counts[1], "{:g} to {:g} points", "{:g} points or more")
    return [Group(_inclusive(group.name), group.labels, group.detections) for group in groups]


def occlusion_groups(labels: ObjectLines) -> list[Group]:
    """By the labels' level of occlusion."""
    return [Group(name, labels.occluded == level, None) for level, name in enumerate(OCCLUSIONS)]


def _between(
    edges: tuple[float, ...], a: FloatArray | IntArray, b: FloatArray | IntArray, between: str, over: str
) -> list[Group]:
    groups = []
    for low, high in pairwise(edges):
        name = over.format(low) if np.isinf(high) else between.format(low, high)
        groups.append(Group(name, (a >= low) & (a < high), (b >= low) & (b < high)))
    return groups


def _inclusive(name: str) -> str:
    """Whole numbers below the upper edge: 1 to 9 instead of 1 to 10."""
    words = name.split()
    if words[1] != "to":
        return name
    last = int(words[2]) - 1
    return f"{words[0]} points" if int(words[0]) == last else f"{words[0]} to {last} points"


def _point_counts(lines: ObjectLines, clouds: Path, calibration: Path) -> IntArray:
    """(K,) points in each box."""
    counts = np.zeros(len(lines), dtype=np.int64)
    for frame in np.unique(lines.frame).tolist():
        rows = np.flatnonzero(lines.frame == frame)
        sequence, _, name = frame.rpartition("/")
        folder = clouds / sequence if sequence and (clouds / sequence).is_dir() else clouds
        cloud = read_cloud(_cloud_file(folder, name)).cloud
        file = calibration
        if calibration.is_dir():
            own = [calibration / f"{stem}.txt" for stem in (name, sequence)]
            file = next((path for path in own if path.is_file()), own[0])
        boxes = read_calibration(file).boxes_to_lidar(lines.camera_box[rows])
        counts[rows] = boxes.point_counts(cloud.xyz_m)
    return counts


def _cloud_file(folder: Path, name: str) -> Path:
    for path in sorted(folder.glob(f"{name}.*")):
        if file_format(path):
            return path
    raise ArgumentError(f"--clouds: {folder} has no cloud {name}")
