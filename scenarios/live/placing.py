"""Boxes of a message as detections in the frame of the odometry."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.live.counts import Counts
from scenarios.recorded.classes import ClassMap
from scenarios.recorded.dataset import HEIGHT_M, LEFT_OUT
from scenarios.ros.frames.transforms import box_direction, ground_covariance, placed
from scenarios.ros.messages import DetectionMessage
from smartmot.detection_input import MAX_POSITION_M, MAX_SIZE_M, MIN_SIZE_M, detections_from_arrays
from smartmot.types import BoolArray, Detections, FloatArray, Tracks

_NS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class PlacedFrame:
    """Detections, and the vertical extent of all boxes of the message.

    Args:
        detections: what the tracker takes, frame of the odometry.
        center_m: (K, 2) centres of the boxes that are possible, same frame.
        bottom_m: (K,) heights of their undersides.
        height_m: (K,) their heights.
        sent_mps: (K, 3) their velocities as they were sent.
    """

    detections: Detections
    center_m: FloatArray
    bottom_m: FloatArray
    height_m: FloatArray
    sent_mps: FloatArray


def place(
    message: DetectionMessage,
    stamp_ns: int,
    map_SE3_sensor: FloatArray,
    classes: ClassMap,
    velocity_frame: str,
    counts: Counts,
) -> PlacedFrame:
    """Put the boxes of a message where they are, and count those that are left out.

    Args:
        message: N boxes, frame of the sensor.
        stamp_ns: of the frame.
        map_SE3_sensor: (4, 4) pose of the sensor.
        classes: category of each class name.
        velocity_frame: one of `scenarios.ros.messages.VELOCITY_FRAMES`.
        counts: where to count.
    """
    counts.boxes += len(message)
    category, kept = _categories(message, classes, counts)
    with np.errstate(invalid="ignore", over="ignore"):  # of numbers that are none
        center = placed(map_SE3_sensor, message.position_m[kept])
        ahead = box_direction(message.quaternion[kept]) @ map_SE3_sensor[:2, :3].T
        yaw = np.arctan2(ahead[:, 1], ahead[:, 0])
        velocity = _velocities(message.velocity_mps[kept], map_SE3_sensor, velocity_frame)
        noise = message.pose_covariance
        if noise is not None:
            noise = ground_covariance(map_SE3_sensor[:3, :3], noise[kept])
    size, score = message.size_m[kept], message.score[kept]
    detections, rejected = detections_from_arrays(
        stamp_ns * _NS, center[:, :2], size[:, :2], yaw, score, category, velocity, noise
    )
    counts.rejected += rejected
    counts.without_score += detections.dropped.score
    level = np.isfinite(center).all(axis=1) & (np.abs(center[:, 2]) <= MAX_POSITION_M)
    height = np.where((size[:, 2] >= MIN_SIZE_M) & (size[:, 2] <= MAX_SIZE_M), size[:, 2], HEIGHT_M)[level]
    center = center[level]
    return PlacedFrame(
        detections,
        center[:, :2],
        center[:, 2] - 0.5 * height,
        height,
        message.velocity_mps[kept][level],
    )


def _categories(message: DetectionMessage, classes: ClassMap, counts: Counts) -> tuple[list[str], BoolArray]:
    """Categories of the boxes that are road users, and (N,) which these are."""
    names = [classes.get(name.lower()) for name in message.class_name.tolist()]
    for name, category in zip(message.class_name.tolist(), names, strict=True):
        if category is None:
            counts.unknown_classes[name] += 1
        elif category == LEFT_OUT:
            counts.other_classes += 1
    kept = np.array([bool(category) for category in names], dtype=np.bool_)
    return [category for category in names if category], kept


def _velocities(sent_mps: FloatArray, map_SE3_sensor: FloatArray, velocity_frame: str) -> FloatArray | None:
    """(N, 2) velocities along the odometry's axes; None: they are not used, or there are none."""
    if velocity_frame == "ignore" or not np.isfinite(sent_mps).any():
        return None
    along = sent_mps if velocity_frame == "world" else sent_mps @ map_SE3_sensor[:3, :3].T
    return along[:, :2]


class Heights:
    """Undersides and heights of tracks, which are estimated on the ground: those of the nearest detection.

    A track keeps them while it coasts; frames may come in any order, the newest one counts.
    """

    def __init__(self) -> None:
        self._extent: dict[int, tuple[float, float, float]] = {}

    def see(self, tracks: Tracks, frame: PlacedFrame) -> None:
        """Take a frame.

        Args:
            tracks: at the time of the frame.
            frame: the frame.
        """
        rows = (tracks.coasted_s <= 0.0).nonzero()[0]
        if not len(rows) or not len(frame.center_m):
            return
        stamp_s = frame.detections.stamp_s
        offset = tracks.boxes.center_m[rows, None] - frame.center_m
        nearest = (offset * offset).sum(axis=2).argmin(axis=1)
        extents = zip(frame.bottom_m[nearest].tolist(), frame.height_m[nearest].tolist(), strict=True)
        for number, extent in zip(tracks.track_id[rows].tolist(), extents, strict=True):
            if self._extent.get(number, (-np.inf,))[0] <= stamp_s:
                self._extent[number] = (stamp_s, *extent)

    def of(self, ids: list[int]) -> tuple[FloatArray, FloatArray]:
        """(M,) undersides and (M,) heights of the M tracks alive; others are forgotten."""
        unseen = (-np.inf, 0.0, HEIGHT_M)
        self._extent = {number: self._extent.get(number, unseen) for number in ids}
        extent = np.array(list(self._extent.values())).reshape(-1, 3)
        return extent[:, 1], extent[:, 2]
