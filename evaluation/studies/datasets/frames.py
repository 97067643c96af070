"""Labelled clouds one by one, and scenes made of them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

import numpy as np

from scenarios.recorded.dataset import Objects, Sequence, Sweeps
from scenarios.recorded.layouts.sweeps import points_inside
from scenarios.recorded.poses import rigid, turned_about
from scenarios.sensors.lidar import LidarConfig
from scenarios.sensors.lidar.recording import mounted
from scenarios.sensors.lidar.unhidden import unhidden_points
from smartmot.arrays import IntArray, StrArray
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import FloatArray

FRAME_S = 0.5
"""Between the frames of a scene, which have nothing to do with one another: as nuScenes' samples."""

BODY_M = 0.1
"""Points higher over a box's underside are taken to be its road user's, not the ground's: range noise is a
fifth of it."""

AROUND_M = 0.1
"""So far outside the sides and the top of its box a point is taken to be a road user's: range noise puts a
quarter of the points of a flat side outside."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelledFrame:
    """A cloud and its road users.

    Args:
        cloud: level frame of the sensor.
        boxes: K boxes in that frame.
        category: (K,) names out of `smartmot.types.CATEGORIES`.
        pose: x, y and z of the ground under the vehicle's middle, and its heading, world frame.
        scan: number of the cloud, on which the rays of a rosette depend.
    """

    cloud: PointCloud
    boxes: Boxes3D
    category: StrArray
    pose: tuple[float, float, float, float]
    scan: int = 0


def empty_scene(name: str, frame_count: int) -> Sequence:
    """A scene without labels and poses."""
    names = tuple(map(str, range(frame_count)))
    return Sequence(name, FRAME_S * np.arange(frame_count, dtype=np.float64), names, Objects.empty())


def with_frames(
    scene: Sequence,
    frames: Iterable[LabelledFrame],
    config: LidarConfig,
    least: int,
    write: Callable[[int, PointCloud], None],
) -> tuple[Sequence, int]:
    """A scene with its frames, and how many labels are left out because their boxes hold too few points.

    Clouds are written one by one. No object of one frame is in another.

    Args:
        scene: without labels.
        frames: as many as it has.
        config: the LiDAR.
        least: points that a box must hold.
        write: takes the number of a frame and its cloud.
    """
    ego_SE3_lidar = mounted(config.mount)
    poses, labels, counts, shares, hidden = [], [Objects.empty()], [], [], 0
    for k, frame in zip(range(len(scene)), frames, strict=True):
        write(k, frame.cloud)
        x, y, z, yaw = frame.pose
        pose = rigid(turned_about(2, np.array([yaw])), np.array([[x, y, z]]))[0]
        rows = _labels(k, frame, pose @ ego_SE3_lidar, yaw)
        count = points_inside(rows, pose @ ego_SE3_lidar, frame.cloud)
        kept = np.flatnonzero(count >= least)
        hidden += len(count) - len(kept)
        shares.append(_seen_share(frame, config, kept))
        poses.append(pose)
        labels.append(rows[kept])
        counts.append(count[kept])
    columns = {name: np.concatenate([getattr(part, name) for part in labels]) for name in Objects.__slots__}
    made = replace(
        scene,
        labels=Objects.of(columns.pop("frame"), columns.pop("center_m"), **columns),
        world_SE3_ego=np.array(poses).reshape(-1, 4, 4),
        sweeps=Sweeps(ego_SE3_lidar, np.concatenate(counts), np.concatenate(shares)),
    )
    return made, hidden


def _labels(k: int, frame: LabelledFrame, world_SE3_lidar: FloatArray, yaw_rad: float) -> Objects:
    """The labels of a frame, world frame; nobody is in two frames."""
    boxes = frame.boxes
    center = boxes.center_m @ world_SE3_lidar[:3, :3].T + world_SE3_lidar[:3, 3]
    count = len(boxes)
    return Objects.of(
        np.full(count, k),
        center[:, :2],
        object_id=1000 * k + np.arange(count),
        category=frame.category,
        size_m=boxes.size_m[:, :2],
        yaw_rad=np.arctan2(np.sin(boxes.yaw_rad + yaw_rad), np.cos(boxes.yaw_rad + yaw_rad)),
        bottom_m=center[:, 2] - 0.5 * boxes.size_m[:, 2],
        height_m=boxes.size_m[:, 2],
    )


def _seen_share(frame: LabelledFrame, config: LidarConfig, rows: IntArray) -> FloatArray:
    """(K,) points on road users over those that they would have alone, without the lowest `BODY_M`."""
    boxes = frame.boxes[rows]
    raised = boxes.center_m + np.array([0.0, 0.0, 0.5 * (BODY_M + AROUND_M)])
    size = boxes.size_m + np.array([2.0 * AROUND_M, 2.0 * AROUND_M, AROUND_M - BODY_M])
    body = Boxes3D(raised, size, boxes.yaw_rad)
    alone = unhidden_points(config, boxes, frame.category[rows], frame.scan, BODY_M)
    share: FloatArray = np.minimum(body.point_counts(frame.cloud.xyz_m) / np.maximum(alone, 1), 1.0)
    return share
