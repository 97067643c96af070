"""Where the boxes of a bag are: poses of vehicle and sensor at each frame, boxes on the ground of the map."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from scenarios.recorded.classes import CLASSES_CSV, ClassMap, most_common
from scenarios.recorded.dataset import HEIGHT_M, LEFT_OUT, Objects
from scenarios.ros.bags.topics import Topic
from scenarios.ros.frames.localisation import Localisation
from scenarios.ros.frames.poses import CARRY_S
from scenarios.ros.frames.transforms import box_direction, ground_covariance, is_static, placed
from scenarios.ros.messages import DetectionMessage, Message, OdometryMessage, TransformMessage
from smartmot.detection_input import MAX_SIZE_M, MIN_SIZE_M, stated_covariances
from smartmot.types import FloatArray, IntArray, StrArray

_UNKNOWN = "?"
"""In place of a category: the class is not known."""


@dataclass(frozen=True, slots=True)
class _FrameSettings:
    """Names of REP 105; see `scenarios.ros.frames.localisation.FrameSettings`."""

    carry_s: float = CARRY_S
    sensor_pose: None = None
    map_frame: str = "map"
    base_frame: str = "base_link"


class Places:
    """Poses of vehicle and sensor at the frames of a bag, all of whose messages are known.

    Args:
        received: messages in the order of their receipt, the frames among them.
    """

    def __init__(self, received: Iterable[tuple[Topic, Message]]) -> None:
        self.localisation = Localisation(_FrameSettings(), keep_all=True)
        self._pose_ns: dict[int, int] = {}  # of frames without a stamp, by their times of receipt
        for topic, message in received:
            if isinstance(message, OdometryMessage):
                self.localisation.add_odometry(message)
            elif isinstance(message, TransformMessage):
                self.localisation.add_transforms(message, is_static(topic.name))
            elif isinstance(message, DetectionMessage) and message.stamp_ns is None:
                self._pose_ns.setdefault(message.received_ns, self.localisation.pose_time_ns(message))

    def at(self, frame: DetectionMessage, sensor: str) -> tuple[FloatArray, FloatArray] | None:
        """(4, 4) `map_SE3_base` and `map_SE3_sensor` of a frame; None: no pose is near enough."""
        time_ns = self._pose_ns[frame.received_ns] if frame.stamp_ns is None else frame.stamp_ns
        self.localisation.decide(sensor, time_ns)
        pose = self.localisation.pose(time_ns)
        if pose is None:
            return None
        sensor_pose = pose.map_SE3_base @ self.localisation.base_SE3_sensor(sensor, time_ns)
        return pose.map_SE3_base, sensor_pose

    @property
    def any(self) -> bool:
        """Whether there are poses at all."""
        return self.localisation.source is not None

    def notes(self) -> list[str]:
        """What a user should know about poses and transforms."""
        local, notes = self.localisation, []
        if local.poses.refused:
            notes.append(f"{local.poses.refused} poses left out: impossible, or of a time that is known")
        if local.tree.refused:
            notes.append(f"{local.tree.refused} impossible transforms left out")
        for sensor in sorted(local.assumed):
            frames = ", ".join(local.tree.frames()) or "none"
            notes.append(
                f"no transform from {sensor or 'a frame without a name'} to {local.base_frame} (transforms "
                f"of: {frames}): the sensor is taken to be at its origin"
            )
        return notes


def objects_on_map(
    frames: list[DetectionMessage],
    map_SE3_sensor: FloatArray,
    classes: ClassMap,
    velocity_frame: str,
    notes: list[str],
) -> Objects:
    """Boxes of all frames on the ground of the map; what is left out is noted.

    Args:
        frames: F messages, at least one.
        map_SE3_sensor: (F, 4, 4) poses of the sensor.
        classes: category of each class, in small letters.
        velocity_frame: one of `scenarios.ros.messages.VELOCITY_FRAMES`.
        notes: where to note.
    """
    number: IntArray = np.repeat(np.arange(len(frames)), [len(frame) for frame in frames])
    kind = np.concatenate([frame.class_name for frame in frames])
    category = _categories(kind, classes, notes)
    pairs = list(zip(frames, map_SE3_sensor, strict=True))
    with np.errstate(invalid="ignore", over="ignore"):  # of boxes that are none
        center = np.concatenate([placed(pose, frame.position_m) for frame, pose in pairs])
        ahead = np.concatenate([box_direction(frame.quaternion) @ pose[:2, :3].T for frame, pose in pairs])
        sent = np.concatenate([frame.velocity_mps for frame in frames])
        turned = np.einsum("kij,kj->ki", map_SE3_sensor[number, :3, :3], sent)
        noise = [np.zeros((len(f), 6, 6)) if f.pose_covariance is None else f.pose_covariance for f in frames]
        covariance = ground_covariance(map_SE3_sensor[number, :3, :3], np.concatenate(noise))
    size = np.concatenate([frame.size_m for frame in frames])
    height = np.where((size[:, 2] >= MIN_SIZE_M) & (size[:, 2] <= MAX_SIZE_M), size[:, 2], HEIGHT_M)
    velocity = {"ignore": np.full_like(sent, np.nan), "sensor": turned, "world": sent}[velocity_frame]
    return Objects.of(
        number,
        center[:, :2],
        size_m=size[:, :2],
        yaw_rad=np.arctan2(ahead[:, 1], ahead[:, 0]),
        bottom_m=center[:, 2] - 0.5 * height,
        height_m=height,
        category=category,
        kind=kind,
        score=np.concatenate([frame.score for frame in frames]),
        velocity_mps=velocity[:, :2],
        pose_covariance=stated_covariances(covariance),
    )


def _categories(kind: StrArray, classes: ClassMap, notes: list[str]) -> StrArray:
    """(K,) categories of classes, LEFT_OUT where they have none or are not known."""
    category = np.array([classes.get(name.lower(), _UNKNOWN) for name in kind.tolist()], dtype=np.str_)
    reasons = {
        _UNKNOWN: f"of classes that are not known ({CLASSES_CSV} can say what they are)",
        LEFT_OUT: "that are no road users",
    }
    for sign, reason in reasons.items():
        counts = Counter(kind[category == sign].tolist())
        if counts:
            notes.append(f"detections left out {reason}: {most_common(counts, 'without a class')}")
    category[category == _UNKNOWN] = LEFT_OUT
    return category
