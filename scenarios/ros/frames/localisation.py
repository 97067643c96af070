"""Where vehicle and sensor are at the stamp of a frame, from odometry and transforms."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Protocol

import numpy as np

from scenarios.ros.frames.poses import RATE_WINDOW_S, PoseBuffer, VehiclePose
from scenarios.ros.frames.transforms import TransformTree
from scenarios.ros.messages import DetectionMessage, OdometryMessage, TransformMessage
from smartmot.types import FloatArray

ODOMETRY, TRANSFORMS = "odometry", "transforms"
"""Where poses come from."""

ODOM_FRAME = "odom"
"""Frame of the poses where there is no map (REP 105)."""

_NS = 1e-9


class FrameSettings(Protocol):
    """What has to be said of frames."""

    @property
    def sensor_pose(self) -> tuple[float, float, float, float] | None:
        """x, y, z (m) and yaw (rad) of the sensor in the vehicle's frame; None: as the transforms say."""

    @property
    def map_frame(self) -> str:
        """Frame of the poses where transforms alone have them."""

    @property
    def base_frame(self) -> str:
        """The vehicle's frame where transforms alone have it; an odometry names its own."""

    @property
    def carry_s(self) -> float:
        """How long the last pose is carried on with its velocity and turn rate."""


class Localisation:
    """Knows pose and sensor, and says when there is nothing left to wait for.

    Poses come from the odometry if there is any when the first frame has waited, else from the transforms.

    Args:
        settings: frames, sensor and times.
        keep_all: whether all poses and transforms are remembered; else those of the last seconds.
        given: x, y, z (m) and yaw (rad) in the vehicle's frame, by sensor, of those that transforms need not
            tell.

    Attributes:
        poses: of the odometry.
        tree: of the transforms.
        source: `ODOMETRY`, `TRANSFORMS`, or None as long as there is neither.
        assumed: names of sensors that were taken to be at the vehicle's origin.
    """

    def __init__(
        self,
        settings: FrameSettings,
        keep_all: bool = False,
        given: Mapping[str, tuple[float, float, float, float]] | None = None,
    ) -> None:
        self.poses = PoseBuffer(settings.carry_s, None) if keep_all else PoseBuffer(settings.carry_s)
        self.tree = TransformTree(None) if keep_all else TransformTree()
        self.source: str | None = None
        self.assumed: set[str] = set()
        self._settings = settings
        self._fixed = None if settings.sensor_pose is None else _flat(*settings.sensor_pose)
        self._given = {sensor: _flat(*pose) for sensor, pose in (given or {}).items()}
        self._map_frame = settings.map_frame
        self._nothing_came = False
        self._newest_ns: int | None = None
        self._newest_received_ns = 0

    @property
    def frame_id(self) -> str:
        """Frame of the poses."""
        return (self.poses.frame_id if self.source == ODOMETRY else self._map_frame) or self._map_frame

    @property
    def base_frame(self) -> str:
        """The vehicle's frame."""
        return self.poses.child_frame_id or self._settings.base_frame

    def add_odometry(self, message: OdometryMessage) -> None:
        """Take an odometry."""
        self.poses.add(message)
        self._note_newest(message.received_ns)
        self._nothing_came = False

    def add_transforms(self, message: TransformMessage, static: bool) -> None:
        """Take transforms; see `TransformTree.add`."""
        self.tree.add(message, static)
        self._note_newest(message.received_ns)
        self._nothing_came = False

    def forget_after(self, stamp_ns: int) -> None:
        """Forget what is newer than a time, after that has gone back."""
        self.poses.forget_after(stamp_ns)
        self.tree.forget_after(stamp_ns)
        self._newest_ns = None

    def pose_time_ns(self, frame: DetectionMessage) -> int:
        """When the vehicle was where a frame saw it, asked when the frame is received.

        The frame's stamp. Without one that of the newest pose, as tf2 has it for stamp 0; the time of receipt
        where the newest pose was not received within the time for which poses are carried on.
        """
        if frame.stamp_ns is not None:
            return frame.stamp_ns
        away_s = abs(frame.received_ns - self._newest_received_ns) * _NS
        if self._newest_ns is None or away_s > self._settings.carry_s:
            return frame.received_ns
        return self._newest_ns

    def _note_newest(self, received_ns: int) -> None:
        """Note a pose that is newer than all before, and when it was received."""
        newest = None if self.source == TRANSFORMS else self.poses.newest_ns
        if newest is None and self.source != ODOMETRY:
            newest = self.tree.newest_ns(self._map_frame, self.base_frame)
            if newest is None and self.source is None:
                newest = self.tree.newest_ns(ODOM_FRAME, self.base_frame)
        if newest != self._newest_ns:
            self._newest_ns, self._newest_received_ns = newest, received_ns

    def complete(self, sensor: str, stamp_ns: int) -> bool:
        """Whether a frame need not wait: its sensor's place is known, and a pose that is not older."""
        if not (sensor in self.assumed or self._sensor(sensor, stamp_ns) is not None):
            return False
        if self.source is None:
            newest = self.poses.newest_ns
            return self._nothing_came if newest is None else newest >= stamp_ns
        newest = self.poses.newest_ns if self.source == ODOMETRY else self._newest_transform_ns()
        return newest is not None and newest >= stamp_ns

    def decide(self, sensor: str, stamp_ns: int) -> None:
        """Settle for what is known now, after a frame has waited."""
        if self.source is None:
            if self.poses.newest_ns is not None:
                self.source = ODOMETRY
            elif self._newest_transform_ns() is not None:
                self.source = TRANSFORMS
            self._nothing_came = self.source is None
        if self._sensor(sensor, stamp_ns) is None:
            self.assumed.add(sensor)
        else:
            self.assumed.discard(sensor)

    def pose(self, stamp_ns: int) -> VehiclePose | None:
        """The vehicle's pose at a time; None: it is not known."""
        if self.source == ODOMETRY:
            return self.poses.at(stamp_ns)
        if self.source is None:
            return None
        near_ns = [
            time_ns for later in (False, True) if (time_ns := self._known_ns(stamp_ns, later)) is not None
        ]
        if not near_ns:
            return None
        # two poses tell the rates; where none is known they are carried on as an odometry is
        known_ns = min(near_ns, key=lambda time_ns: abs(time_ns - stamp_ns))
        samples = PoseBuffer(self._settings.carry_s)
        for time_ns in (known_ns, self._another_ns(known_ns)):
            transform = None if time_ns is None else self.tree.at(self._map_frame, self.base_frame, time_ns)
            if time_ns is not None and transform is not None:
                samples.insert(time_ns, transform, None)
        return samples.at(stamp_ns)

    def _another_ns(self, known_ns: int) -> int | None:
        """A second time at which the transforms tell the pose: a window of rates before, else near it."""
        window_ns = round(RATE_WINDOW_S / _NS)
        for asked_ns in (known_ns - window_ns, known_ns + window_ns):
            for later in (False, True):
                time_ns = self._known_ns(asked_ns, later)
                if time_ns is not None and time_ns != known_ns:
                    return time_ns
        return None

    def _known_ns(self, stamp_ns: int, later: bool) -> int | None:
        return self.tree.known_ns(self._map_frame, self.base_frame, stamp_ns, later)

    def base_SE3_sensor(self, sensor: str, stamp_ns: int) -> FloatArray:  # noqa: N802
        """(4, 4) pose of a sensor in the vehicle's frame; where nothing tells it, at the origin."""
        known = self._sensor(sensor, stamp_ns)
        return np.eye(4) if known is None else known

    def _sensor(self, sensor: str, stamp_ns: int) -> FloatArray | None:
        if self._fixed is not None:
            return self._fixed
        if sensor in self._given:
            return self._given[sensor]
        if sensor == self.base_frame:
            return np.eye(4)
        return self.tree.at(self.base_frame, sensor, stamp_ns, hold=True)

    def _newest_transform_ns(self) -> int | None:
        """Up to when the transforms tell the vehicle's pose; in `odom` where there is no map."""
        newest = self.tree.newest_ns(self._map_frame, self.base_frame)
        if newest is None and self.source is None:
            newest = self.tree.newest_ns(ODOM_FRAME, self.base_frame)
            if newest is not None:
                self._map_frame = ODOM_FRAME
        return newest


def _flat(x_m: float, y_m: float, z_m: float, yaw_rad: float) -> FloatArray:
    """(4, 4) pose without roll and pitch."""
    pose = np.eye(4)
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    pose[:2, :2], pose[:3, 3] = ((c, -s), (s, c)), (x_m, y_m, z_m)
    return pose
