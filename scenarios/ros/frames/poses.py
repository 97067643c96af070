"""Where the vehicle was at a time: odometry, interpolated or carried on."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from dataclasses import dataclass

import numpy as np

from scenarios.recorded.poses import rotation_matrix
from scenarios.ros.frames.transforms import GAP_S, KEEP_S, between, gone_back
from scenarios.ros.messages import OdometryMessage
from smartmot.detection_input import MAX_POSITION_M, MAX_SPEED_MPS
from smartmot.types import FloatArray

CARRY_S = 0.2
"""The last pose is carried on for so long. With a turn rate that is off by 0.1 rad/s and an acceleration of
4 m/s2 unknown to it, it is off by 8 cm then, and the direction by 1.1 degrees."""
RATE_WINDOW_S = 0.2
"""Where twists are not filled, rates are differences of poses over this time: poses that are off by 1 cm make
0.07 m/s then, and a standing vehicle stands."""

_NS = 1e-9


@dataclass(frozen=True, slots=True, eq=False)
class VehiclePose:
    """Pose and motion of the vehicle's frame at a time.

    Args:
        map_SE3_base: (4, 4) pose, frame of the odometry.
        forward_mps: velocity along the vehicle's x.
        yaw_rate_radps: turn rate about its z.
        carried: whether the last pose was carried on to this time.
    """

    map_SE3_base: FloatArray  # noqa: N815 - dst_SE3_src is the field's notation
    forward_mps: float
    yaw_rate_radps: float
    carried: bool = False


@dataclass(frozen=True, slots=True, eq=False)
class _Sample:
    """A pose as it was received; `twist` is forward, sideways and turning, None where it was not filled."""

    map_SE3_base: FloatArray  # noqa: N815
    twist: tuple[float, float, float] | None


class PoseBuffer:
    """The poses of the last seconds, by their stamps.

    Args:
        carry_s: how long a pose is carried on beyond its time.
        keep_s: how long before the newest poses are remembered; None: all are.

    Attributes:
        frame_id: frame of the poses, "" before the first.
        child_frame_id: the vehicle's frame.
        refused: poses that are not finite, in another frame than the first, or of a time that is known.
    """

    def __init__(self, carry_s: float, keep_s: float | None = KEEP_S) -> None:
        self.frame_id = self.child_frame_id = ""
        self.refused = 0
        self._carry_ns = round(carry_s / _NS)
        self._keep_ns = None if keep_s is None else round(keep_s / _NS)
        self._stamps: list[int] = []
        self._samples: list[_Sample] = []

    @property
    def newest_ns(self) -> int | None:
        """Stamp of the newest pose."""
        return self._stamps[-1] if self._stamps else None

    def add(self, message: OdometryMessage) -> None:
        """Remember an odometry."""
        sample = _sample(message)
        k = bisect_left(self._stamps, message.time_ns)
        known = k < len(self._stamps) and self._stamps[k] == message.time_ns
        elsewhere = bool(self._stamps) and message.frame_id != self.frame_id
        if sample is None or known or elsewhere:
            self.refused += 1
            return
        if self._keep_ns is not None and gone_back(self._stamps, message.time_ns):
            self.forget_after(message.time_ns)
        self.frame_id, self.child_frame_id = message.frame_id, message.child_frame_id
        self.insert(message.time_ns, sample.map_SE3_base, sample.twist)

    def insert(
        self, stamp_ns: int, map_SE3_base: FloatArray, twist: tuple[float, float, float] | None
    ) -> None:
        """Remember a pose with its forward, sideways and turning velocity, None where they are not known."""
        k = bisect_left(self._stamps, stamp_ns)
        self._stamps.insert(k, stamp_ns)
        self._samples.insert(k, _Sample(map_SE3_base, twist))
        if self._keep_ns is None:
            return
        if self._stamps[0] < self._stamps[-1] - 2 * self._keep_ns:  # half of them at once
            cut = bisect_left(self._stamps, self._stamps[-1] - self._keep_ns)
            del self._stamps[:cut], self._samples[:cut]

    def forget_after(self, stamp_ns: int) -> None:
        """Forget poses newer than a time, after that has gone back."""
        cut = bisect_right(self._stamps, stamp_ns)
        del self._stamps[cut:], self._samples[cut:]

    def at(self, stamp_ns: int) -> VehiclePose | None:
        """The pose at a time; None: there is none near enough."""
        after = bisect_left(self._stamps, stamp_ns)
        if after < len(self._stamps) and self._stamps[after] == stamp_ns:
            return self._pose(after)
        if 0 < after < len(self._stamps):
            span = self._stamps[after] - self._stamps[after - 1]
            if span <= round(GAP_S / _NS):
                return self._between(after, (stamp_ns - self._stamps[after - 1]) / span)
        near = [k for k in (after - 1, after) if 0 <= k < len(self._stamps)]
        if not near:
            return None
        k = min(near, key=lambda k: abs(self._stamps[k] - stamp_ns))
        away = stamp_ns - self._stamps[k]
        return self._carried(k, away * _NS) if abs(away) <= self._carry_ns else None

    def _pose(self, k: int) -> VehiclePose:
        forward, _, turn = self._rates(k)
        return VehiclePose(self._samples[k].map_SE3_base, forward, turn)

    def _between(self, after: int, share: float) -> VehiclePose:
        """The pose between two; rates change evenly."""
        pose = between(self._samples[after - 1].map_SE3_base, self._samples[after].map_SE3_base, share)
        (forward_a, _, turn_a), (forward_b, _, turn_b) = self._rates(after - 1), self._rates(after)
        return VehiclePose(
            pose, forward_a + share * (forward_b - forward_a), turn_a + share * (turn_b - turn_a)
        )

    def _carried(self, k: int, elapsed_s: float) -> VehiclePose:
        """A pose carried on along the arc of its rates."""
        forward, left, turn = self._rates(k)
        angle = turn * elapsed_s
        # integrals of cosine and sine of the heading over the arc, by their series near a straight line
        if abs(angle) < 1e-6:
            ahead, aside = elapsed_s, 0.5 * angle * elapsed_s
        else:
            ahead, aside = math.sin(angle) / turn, (1.0 - math.cos(angle)) / turn
        step = np.eye(4)
        step[:2, :2] = ((math.cos(angle), -math.sin(angle)), (math.sin(angle), math.cos(angle)))
        step[:2, 3] = forward * ahead - left * aside, forward * aside + left * ahead
        return VehiclePose(self._samples[k].map_SE3_base @ step, forward, turn, carried=True)

    def _rates(self, k: int) -> tuple[float, float, float]:
        """Forward, sideways and turning velocity at a pose; those of the poses where no twist was filled."""
        twist = self._samples[k].twist
        if twist is not None:
            return twist
        first = bisect_right(self._stamps, self._stamps[k] - round(RATE_WINDOW_S / _NS)) - 1
        first, last = (max(first, 0), k) if k else (0, min(1, len(self._stamps) - 1))
        elapsed_s = (self._stamps[last] - self._stamps[first]) * _NS
        if elapsed_s <= 0.0:
            return 0.0, 0.0, 0.0
        a, b = self._samples[first].map_SE3_base, self._samples[last].map_SE3_base
        moved = b[:3, :3].T @ (b[:3, 3] - a[:3, 3])
        turned = a[:3, :3].T @ b[:3, :3]
        return (
            float(moved[0]) / elapsed_s,
            float(moved[1]) / elapsed_s,
            math.atan2(turned[1, 0], turned[0, 0]) / elapsed_s,
        )


def _sample(message: OdometryMessage) -> _Sample | None:
    """The message's pose; None: it is none."""
    values = np.concatenate(
        (message.position_m, message.quaternion, message.linear_mps, message.angular_radps)
    )
    if not (np.abs(values) <= MAX_POSITION_M).all() or not message.quaternion.any():
        return None
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation_matrix(message.quaternion), message.position_m
    twist = (float(message.linear_mps[0]), float(message.linear_mps[1]), float(message.angular_radps[2]))
    filled = any(twist) and max(map(abs, twist)) <= MAX_SPEED_MPS
    return _Sample(pose, twist if filled else None)
