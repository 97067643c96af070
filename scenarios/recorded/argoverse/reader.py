"""Argoverse 2: a log of the Sensor Dataset, its boxes moved into the city's frame.

Files of a log (Argoverse 2 user guide, Sensor Dataset)::

    city_SE3_egovehicle.feather    timestamp_ns, qw, qx, qy, qz, tx_m, ty_m, tz_m: poses at their own rate
    annotations.feather            timestamp_ns, track_uuid, category, length_m, width_m, height_m,
                                   qw, qx, qy, qz, tx_m, ty_m, tz_m, num_interior_pts: labels
    annotations_with_ego.feather   in its place: the same with the ego vehicle's own box
    detections.feather             (optional) as annotations, with score, without track_uuid and
                                   num_interior_pts: the detection challenge's format
    map/log_map_archive_*.json     (optional) the vector map, see `scenarios.recorded.argoverse.archive`

Boxes are in the vehicle's frame at their time: x ahead, y left, z up from the middle of the rear axle.
Scenarios of the Motion Forecasting Dataset: see `scenarios.recorded.argoverse.forecasting`.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from scenarios.errors import DatasetError
from scenarios.recorded.argoverse.archive import map_archive
from scenarios.recorded.argoverse.feather import read_feather
from scenarios.recorded.argoverse.forecasting import read_scenarios, scenario_files
from scenarios.recorded.argoverse.poses import NS, VehiclePoses
from scenarios.recorded.classes import CLASSES_CSV, ClassMap, categories, read_classes, require_categories
from scenarios.recorded.dataset import LEFT_OUT, Dataset, Objects, Sequence, finished
from scenarios.recorded.poses import heading, rigid
from scenarios.recorded.textfile import TextTable, is_given
from smartmot.types import FloatArray, IntArray, StrArray

POSES = "city_SE3_egovehicle.feather"
ANNOTATIONS = ("annotations.feather", "annotations_with_ego.feather")
DETECTIONS = "detections.feather"

EGO_VEHICLE = "EGO_VEHICLE"
"""The vehicle's own box, which is nothing that it meets."""

CATEGORY_OF_CLASS = {
    "REGULAR_VEHICLE": "car",
    "LARGE_VEHICLE": "truck",
    "BOX_TRUCK": "truck",
    "TRUCK": "truck",
    "TRUCK_CAB": "truck",
    "VEHICULAR_TRAILER": "truck",
    "BUS": "truck",
    "ARTICULATED_BUS": "truck",
    "SCHOOL_BUS": "truck",
    "RAILED_VEHICLE": "truck",
    "PEDESTRIAN": "pedestrian",
    "OFFICIAL_SIGNALER": "pedestrian",
    "STROLLER": "pedestrian",
    "WHEELCHAIR": "pedestrian",
    "BICYCLE": "cyclist",
    "BICYCLIST": "cyclist",
    "WHEELED_DEVICE": "cyclist",
    "WHEELED_RIDER": "cyclist",
    "MOTORCYCLE": "motorcycle",
    "MOTORCYCLIST": "motorcycle",
    "ANIMAL": "unknown",
    "DOG": "unknown",
    "MESSAGE_BOARD_TRAILER": "unknown",
    "TRAFFIC_LIGHT_TRAILER": "unknown",
    "BOLLARD": LEFT_OUT,
    "CONSTRUCTION_BARREL": LEFT_OUT,
    "CONSTRUCTION_CONE": LEFT_OUT,
    "MOBILE_PEDESTRIAN_CROSSING_SIGN": LEFT_OUT,
    "SIGN": LEFT_OUT,
    "STOP_SIGN": LEFT_OUT,
}
"""All 30 categories (av2 0.3.6, datasets/sensor/constants.py). Left out are cones, posts and signs. A ridden
bicycle and its rider are two boxes in these data."""

_PLACE = ("tx_m", "ty_m", "tz_m")
_QUATERNION = ("qw", "qx", "qy", "qz")
_SIZE = ("length_m", "width_m", "height_m")

MAX_NORM_ERROR = 1e-3
"""Quaternions farther from length 1 are no rotations; rounding to single precision costs 1e-7."""

MAX_NS = 2**62
"""146 years."""

_CORNER_SIGNS = np.array(
    [
        *((1, 1, 1), (1, -1, 1), (1, -1, -1), (1, 1, -1)),
        *((-1, 1, 1), (-1, -1, 1), (-1, -1, -1), (-1, 1, -1)),
    ]
)
"""Corners of a box in the order of av2's `Cuboid.vertices_m`."""


@dataclass(frozen=True, slots=True, eq=False)
class Cuboids:
    """Boxes of a log in space, K of them, in the order of the file.

    Args:
        stamp_ns: (K,) times.
        category: (K,) the data set's names.
        city_SE3_object: (K, 4, 4) poses of the boxes' middles in the city's frame.
        size_m: (K, 3) length, width and height.
    """

    stamp_ns: IntArray
    category: StrArray
    city_SE3_object: FloatArray  # noqa: N815 - dst_SE3_src is the field's notation
    size_m: FloatArray

    def corners_m(self) -> FloatArray:
        """(K, 8, 3) corners in the city's frame; four in front, then those behind them."""
        offset = 0.5 * self.size_m[:, None, :] * _CORNER_SIGNS
        pose = self.city_SE3_object
        corners: FloatArray = np.einsum("kij,kcj->kci", pose[:, :3, :3], offset) + pose[:, None, :3, 3]
        return corners


def is_argoverse(path: Path) -> bool:
    """Whether a folder or file is a log's, or has forecasting scenarios."""
    if path.suffix == ".feather" or (path / POSES).is_file():
        return True
    return bool(scenario_files(path))


def read_argoverse(folder: Path) -> Dataset:
    """Read a log: labels, detections if there are any, poses; or forecasting scenarios.

    Args:
        folder: The log, or a file in it; a folder of scenarios, or one.

    Raises:
        DatasetError: A file is missing or wrong; the message names file, row and field.
    """
    if scenarios := scenario_files(folder):
        return read_scenarios(scenarios)
    if folder.is_file():
        folder = folder.parent
    poses = _read_poses(folder / POSES)
    classes = read_classes(folder, CATEGORY_OF_CLASS)
    labelled = _read_labels(folder, classes)
    detected = None
    if is_given(folder / DETECTIONS):
        detected = _read_boxes(folder / DETECTIONS, classes, numbers=("score",))
    tables = [table for table in (labelled, detected) if table is not None]
    if not tables:
        raise DatasetError(
            f"{folder}: no {' or '.join((*ANNOTATIONS, DETECTIONS))} in it; see docs/formats.md"
        )
    stamp_ns = np.unique(np.concatenate([table["timestamp_ns"] for table in tables]))
    if not len(stamp_ns):
        raise DatasetError(f"{tables[0].path}: no rows; there is nothing to track")
    # a frame that shows nothing but the ego is a frame
    labelled, detected = (_others(table) for table in (labelled, detected))
    labels = detections = None
    notes = []
    if labelled is not None:
        labels = _objects(labelled, poses, stamp_ns, classes)
        notes += _left_out(labelled, "labels", classes)
    if detected is not None:
        detections = _objects(detected, poses, stamp_ns, classes)
        notes += _left_out(detected, "detections", classes)
    sequence = Sequence(
        name=folder.resolve().name,
        stamp_s=stamp_ns * NS,
        frame_name=tuple(map(str, stamp_ns.tolist())),
        detections=Objects.empty() if detections is None else detections,
        labels=labels,
        world_SE3_ego=poses.at(stamp_ns),
        map_path=map_archive(folder),
        stamp_ns=stamp_ns.astype(np.int64),
    )
    return finished("argoverse", [sequence], tuple(notes))


def read_cuboids(folder: Path) -> Cuboids:
    """The labelled boxes of a log in space, those without a category of ours too, but not the ego's own.

    Raises:
        DatasetError: See `read_argoverse`.
    """
    table = _others(_read_labels(folder, read_classes(folder, CATEGORY_OF_CLASS)))
    if table is None:
        raise DatasetError(f"{folder}: no {' or '.join(ANNOTATIONS)} in it; see docs/formats.md")
    return _cuboids(table, _read_poses(folder / POSES))


def _read_poses(path: Path) -> VehiclePoses:
    table = read_feather(path, (*_QUATERNION, *_PLACE), integers=("timestamp_ns",))
    if not len(table):
        raise DatasetError(f"{path}: no rows; poses are needed")
    table.require_finite(*_QUATERNION, *_PLACE)
    _require_unit(table)
    _require_time(table)
    stamp_ns = table["timestamp_ns"]
    table.require(np.diff(stamp_ns, prepend=stamp_ns[0] - 1) > 0, "timestamp_ns", "must rise from row to row")
    return VehiclePoses(path, stamp_ns, _rotation(table), table.stacked(*_PLACE))


def _read_labels(folder: Path, classes: ClassMap) -> TextTable | None:
    """Annotations; None: there are none."""
    path = next((folder / name for name in ANNOTATIONS if is_given(folder / name)), None)
    if path is None:
        return None
    return _read_boxes(path, classes, integers=("num_interior_pts",), texts=("track_uuid",))


def _read_boxes(
    path: Path,
    classes: ClassMap,
    *,
    numbers: Iterable[str] = (),
    integers: Iterable[str] = (),
    texts: Iterable[str] = (),
) -> TextTable:
    """A file of boxes with further columns, its categories checked."""
    columns = (*_QUATERNION, *_PLACE, *_SIZE, *numbers)
    table = read_feather(path, columns, ("timestamp_ns", *integers), ("category", *texts))
    known = {**classes, EGO_VEHICLE: LEFT_OUT}
    require_categories(table, "category", known, f"must be one of Argoverse 2, or stand in {CLASSES_CSV}")
    _require_unit(table)
    _require_time(table)
    return table


def _require_time(table: TextTable) -> None:
    """Demand times whose differences are whole numbers too."""
    stamp_ns = table["timestamp_ns"]
    table.require((stamp_ns >= 0) & (stamp_ns < MAX_NS), "timestamp_ns", "must be nanoseconds, 0 or later")


def _require_unit(table: TextTable) -> None:
    """Demand unit quaternions; those that are not finite are no boxes, and left out later."""
    with np.errstate(over="ignore"):
        norm = np.sqrt((table.stacked(*_QUATERNION) ** 2).sum(axis=1))
    table.columns["|q|"] = norm
    table.require(~(np.abs(norm - 1.0) > MAX_NORM_ERROR), "|q|", "must be 1")


def _others(table: TextTable | None) -> TextTable | None:
    """A table without the ego's own boxes."""
    return None if table is None else table.rows(table["category"] != EGO_VEHICLE)


def _rotation(table: TextTable) -> Rotation:
    """Rotations of a table's rows; of quaternions that are not finite, no turn."""
    quaternion = table.stacked("qx", "qy", "qz", "qw")
    finite = np.asarray(np.isfinite(quaternion).all(axis=1))
    return Rotation.from_quat(np.where(finite[:, None], quaternion, (0.0, 0.0, 0.0, 1.0)))


def _cuboids(table: TextTable, poses: VehiclePoses) -> Cuboids:
    """Boxes of a table in the city's frame; NaN where a number is not finite."""
    stamp_ns = table["timestamp_ns"]
    unique_ns, frame = np.unique(stamp_ns, return_inverse=True)
    ego_SE3_object = rigid(_rotation(table).as_matrix(), table.stacked(*_PLACE))
    finite = np.isfinite(table.stacked(*_QUATERNION, *_PLACE)).all(axis=1)
    ego_SE3_object[~finite] = np.nan
    city_SE3_ego = poses.at(unique_ns)[frame]
    with np.errstate(over="ignore", invalid="ignore"):  # of places that are none
        pose = city_SE3_ego @ ego_SE3_object
    return Cuboids(stamp_ns, table["category"], pose, table.stacked(*_SIZE))


def _objects(table: TextTable, poses: VehiclePoses, stamp_ns: IntArray, classes: ClassMap) -> Objects:
    """Boxes on the ground of the city's frame."""
    cuboids = _cuboids(table, poses)
    pose, height = cuboids.city_SE3_object, cuboids.size_m[:, 2]
    columns: dict[str, NDArray[Any]] = {}
    with np.errstate(invalid="ignore", over="ignore"):  # boxes that are not finite are left out later
        bottom = pose[:, 2, 3] - 0.5 * height
    if "track_uuid" in table:
        columns["object_id"] = np.unique(table["track_uuid"], return_inverse=True)[1]
        # as in the data set's own evaluation, boxes that no lidar point hits do not count
        columns["ignored"] = table["num_interior_pts"] <= 0
    if "score" in table:
        columns["score"] = table["score"]
    return Objects.of(
        np.searchsorted(stamp_ns, cuboids.stamp_ns),
        pose[:, :2, 3],
        size_m=cuboids.size_m[:, :2],
        yaw_rad=heading(pose),
        bottom_m=bottom,
        height_m=height,
        category=categories(cuboids.category, classes),
        kind=cuboids.category,
        **columns,
    )


def _left_out(table: TextTable, what: str, classes: ClassMap) -> list[str]:
    """A line about the classes that are left out."""
    counts = Counter(name for name in table["category"].tolist() if classes[name] == LEFT_OUT)
    if not counts:
        return []
    listed = ", ".join(f"{count} {name}" for name, count in sorted(counts.items()))
    return [f"{what} left out, for they are no road users: {listed}"]
