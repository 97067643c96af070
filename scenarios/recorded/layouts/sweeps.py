"""Clouds of recordings in files of data sets, and what they hold of the labels."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Objects, Sequence, Sweeps
from scenarios.recorded.layouts.scenes import ScenePlace
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True)
class SweepFiles:
    """How a layout keeps clouds.

    Args:
        path: of a cloud below the data set's folder, from the scene's place, the recording and the frame.
        content: of the file.
    """

    path: Callable[[ScenePlace, Sequence, int], str]
    content: Callable[[PointCloud], bytes]


def boxes_of(labels: Objects) -> Boxes3D:
    """The boxes of labels, world frame."""
    center = np.column_stack((labels.center_m, labels.bottom_m + 0.5 * labels.height_m))
    return Boxes3D(center, np.column_stack((labels.size_m, labels.height_m)), labels.yaw_rad)


def points_inside(labels: Objects, world_SE3_lidar: FloatArray, cloud: PointCloud) -> IntArray:
    """(K,) points in the box of each label of a frame, those on its faces included.

    Args:
        labels: of the frame, world frame.
        world_SE3_lidar: (4, 4) pose of the sensor.
        cloud: the frame's.
    """
    xyz_m = cloud.xyz_m.astype(np.float64) @ world_SE3_lidar[:3, :3].T + world_SE3_lidar[:3, 3]
    return boxes_of(labels).point_counts(xyz_m)


def swept(
    sequence: Sequence,
    clouds: Iterable[PointCloud],
    ego_SE3_lidar: FloatArray,
    write: Callable[[int, PointCloud], None],
) -> Sequence:
    """A recording with what its clouds hold of the labels; each cloud is written meanwhile.

    Args:
        sequence: with labels and poses.
        clouds: one per frame, in their order.
        ego_SE3_lidar: (4, 4) pose of the sensor in the vehicle's frame.
        write: takes the number of a frame and its cloud.
    """
    labels, pose = sequence.labels, sequence.world_SE3_ego
    assert labels is not None
    assert pose is not None
    count = np.zeros(len(labels), dtype=np.int64)
    for k, (rows, cloud) in enumerate(zip(labels.frame_rows(len(sequence)), clouds, strict=True)):
        write(k, cloud)
        count[rows] = points_inside(labels[rows], pose[k] @ ego_SE3_lidar, cloud)
    return replace(sequence, sweeps=Sweeps(ego_SE3_lidar, count))


def with_least_points(sequence: Sequence, least: int) -> Sequence:
    """A recording without the labels whose boxes hold fewer points; one without a LiDAR as it is."""
    if sequence.sweeps is None or sequence.labels is None:
        return sequence
    kept = sequence.sweeps.point_count >= least
    return replace(sequence, labels=sequence.labels[kept], sweeps=sequence.sweeps[kept])


def common_lidar(sequences: Many[Sequence]) -> FloatArray | None:
    """(4, 4) pose of the sensor in the vehicle's frame; None: there is none.

    Raises:
        DatasetError: not all recordings have it in the same place.
    """
    poses = [s.sweeps.ego_SE3_lidar for s in sequences if s.sweeps is not None]
    if not poses:
        return None
    if len(poses) < len(sequences) or any(not np.array_equal(pose, poses[0]) for pose in poses):
        raise DatasetError("the LiDAR must be in the same place in all recordings of a data set")
    return poses[0]
