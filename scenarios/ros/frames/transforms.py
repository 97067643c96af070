"""The tree of transforms between frames, as `/tf` and `/tf_static` tell it."""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from scenarios.recorded.poses import rotation_matrix
from scenarios.ros.messages import TransformMessage
from smartmot.detection_input import MAX_POSITION_M
from smartmot.types import FloatArray

GAP_S = 1.0
"""Nothing is interpolated between poses or transforms farther apart: 10 m at 10 m/s may hold a turn."""
KEEP_S = 10.0
"""Of a stream, what is older than that before the newest is of no use, as in tf2's buffer."""
KEEP = 4096
"""So many transforms of a frame are remembered of a stream: 10 s at 200 Hz, twice."""

_NS = 1e-9
_GAP_NS = round(GAP_S / _NS)
_STATIC = "tf_static"


@dataclass(slots=True, eq=False)
class _Edge:
    """A frame in its parent's; static ones have one transform that holds at any time."""

    parent: str
    static: bool
    keep: int | None
    stamps: list[int] = field(default_factory=list)
    parent_SE3_child: list[FloatArray] = field(default_factory=list)  # noqa: N815

    def add(self, stamp_ns: int, transform: FloatArray) -> None:
        if self.static:
            self.stamps, self.parent_SE3_child = [stamp_ns], [transform]
            return
        if self.keep is not None and gone_back(self.stamps, stamp_ns):
            self.forget_after(stamp_ns)
        k = bisect_left(self.stamps, stamp_ns)
        if k < len(self.stamps) and self.stamps[k] == stamp_ns:
            return
        self.stamps.insert(k, stamp_ns)
        self.parent_SE3_child.insert(k, transform)
        if self.keep is not None and len(self.stamps) > self.keep:
            del self.stamps[: self.keep // 2], self.parent_SE3_child[: self.keep // 2]

    def forget_after(self, stamp_ns: int) -> None:
        cut = bisect_right(self.stamps, stamp_ns)
        del self.stamps[cut:], self.parent_SE3_child[cut:]

    def at(self, stamp_ns: int, hold: bool) -> FloatArray | None:
        k = bisect_left(self.stamps, stamp_ns)
        if self.static or (k < len(self.stamps) and self.stamps[k] == stamp_ns):
            return self.parent_SE3_child[0 if self.static else k]
        if self._bridged(k):
            return between(
                self.parent_SE3_child[k - 1],
                self.parent_SE3_child[k],
                (stamp_ns - self.stamps[k - 1]) / (self.stamps[k] - self.stamps[k - 1]),
            )
        return self.parent_SE3_child[max(k - 1, 0)] if hold else None

    def known_ns(self, stamp_ns: int, later: bool) -> int | None:
        """The nearest time at which the transform is known, from a time on (`later`) or up to it."""
        k = bisect_left(self.stamps, stamp_ns)
        if (k < len(self.stamps) and self.stamps[k] == stamp_ns) or self._bridged(k):
            return stamp_ns
        k -= not later
        return self.stamps[k] if 0 <= k < len(self.stamps) else None

    def _bridged(self, k: int) -> bool:
        """Whether two stamps are near enough for what lies between: the k-th and the one before."""
        return 0 < k < len(self.stamps) and self.stamps[k] - self.stamps[k - 1] <= _GAP_NS


class TransformTree:
    """Frames and their parents.

    Args:
        keep: so many transforms of a frame are remembered at most; None: all.

    Attributes:
        refused: transforms that are not finite, or of a frame to itself.
    """

    def __init__(self, keep: int | None = KEEP) -> None:
        self.refused = 0
        self._keep = keep
        self._edges: dict[str, _Edge] = {}

    def add(self, message: TransformMessage, static: bool) -> None:
        """Remember the transforms of a message.

        Args:
            message: of `/tf` or `/tf_static`.
            static: whether it is of `/tf_static`, whose transforms hold at any time.
        """
        rows = np.concatenate((message.position_m, message.quaternion), axis=1)
        possible = np.abs(rows).max(axis=1, initial=0.0) <= MAX_POSITION_M
        possible &= np.abs(message.quaternion).max(axis=1, initial=0.0) > 0.0
        for k, (parent, child) in enumerate(zip(message.frame_id, message.child_frame_id, strict=True)):
            if not possible[k] or parent == child:
                self.refused += 1
                continue
            edge = self._edges.get(child)
            if edge is None or edge.parent != parent or edge.static != static:
                edge = self._edges[child] = _Edge(parent, static, self._keep)
            transform = np.eye(4)
            transform[:3, :3] = rotation_matrix(message.quaternion[k])
            transform[:3, 3] = message.position_m[k]
            edge.add(int(message.stamp_ns[k]), transform)

    def forget_after(self, stamp_ns: int) -> None:
        """Forget transforms newer than a time, after that has gone back; static ones stay."""
        for child, edge in list(self._edges.items()):
            if not edge.static:
                edge.forget_after(stamp_ns)
                if not edge.stamps:
                    del self._edges[child]

    def frames(self) -> list[str]:
        """Names of all frames."""
        return sorted({*self._edges, *(edge.parent for edge in self._edges.values())})

    def connected(self, dst: str, src: str) -> bool:
        """Whether there is a way between two frames."""
        return self._legs(dst, src) is not None

    def newest_ns(self, dst: str, src: str) -> int | None:
        """Up to when the transform between two frames is known.

        None: there is no way between them, or all on it is static.
        """
        up, down = self._legs(dst, src) or ((), ())
        moving = [self._edges[child] for child in (*up, *down) if not self._edges[child].static]
        return min((edge.stamps[-1] for edge in moving), default=None)

    def known_ns(self, dst: str, src: str, stamp_ns: int, later: bool) -> int | None:
        """The nearest time at which the transform between two frames is known.

        Args:
            dst: the one frame.
            src: the other.
            stamp_ns: the time that is asked for.
            later: look from that time on; else up to it.

        Returns:
            None: there is no way between the frames, or there is no such time.
        """
        legs = self._legs(dst, src)
        if legs is None:
            return None
        moving = [self._edges[child] for leg in legs for child in leg if not self._edges[child].static]
        # every step goes on to a time at which one transform is known, until all are
        known_ns, asked_ns = stamp_ns, None
        while known_ns != asked_ns:
            asked_ns = known_ns
            for edge in moving:
                nearest_ns = edge.known_ns(known_ns, later)
                if nearest_ns is None:
                    return None
                known_ns = nearest_ns
        return known_ns

    def at(self, dst: str, src: str, stamp_ns: int, hold: bool = False) -> FloatArray | None:
        """(4, 4) `dst_SE3_src` at a time.

        Args:
            dst: the one frame.
            src: the other.
            stamp_ns: when.
            hold: where none is known at that time, take the last one before, else the first.

        Returns:
            None: there is no way between the frames, or it is not known at that time.
        """
        legs = self._legs(dst, src)
        if legs is None:
            return None
        sides = []
        for leg in legs:
            total = np.eye(4)
            for child in leg:
                transform = self._edges[child].at(stamp_ns, hold)
                if transform is None:
                    return None
                total = transform @ total
            sides.append(total)
        return inverse(sides[0]) @ sides[1]

    def _legs(self, dst: str, src: str) -> tuple[list[str], list[str]] | None:
        """Frames from each of two up to their first common ancestor, without it."""
        up, down = self._ancestors(dst), self._ancestors(src)
        common = next((frame for frame in up if frame in down), None)
        return None if common is None else (up[: up.index(common)], down[: down.index(common)])

    def _ancestors(self, frame: str) -> list[str]:
        line = [frame]
        while (edge := self._edges.get(line[-1])) is not None and edge.parent not in line:
            line.append(edge.parent)
        return line


def is_static(topic: str) -> bool:
    """Whether the transforms of a topic hold at any time: `/tf_static`, also in a namespace."""
    return topic.rpartition("/")[2] == _STATIC


def gone_back(stamps: Sequence[int], stamp_ns: int) -> bool:
    """Whether a time of a stream is so long before the newest stamp that time has gone back.

    Either that, or the newest was a single stamp of the future: it must not hide what comes after it.
    """
    return bool(stamps) and stamp_ns < stamps[-1] - round(KEEP_S / _NS)


def between(a: FloatArray, b: FloatArray, share: float) -> FloatArray:
    """The (4, 4) pose between two: places move evenly, rotations turn about one axis at constant rate."""
    pose = a + share * (b - a)
    turn = Rotation.from_matrix(a[:3, :3].T @ b[:3, :3]).as_rotvec()
    pose[:3, :3] = a[:3, :3] @ Rotation.from_rotvec(share * turn).as_matrix()
    return pose


def inverse(pose: FloatArray) -> FloatArray:
    """The inverse of a rigid (4, 4) transform."""
    back = np.eye(4)
    back[:3, :3] = pose[:3, :3].T
    back[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
    return back


def placed(pose: FloatArray, point_m: FloatArray) -> FloatArray:
    """(N, 3) points seen from another frame: `dst_SE3_src` applied to them."""
    points: FloatArray = point_m @ pose[:3, :3].T + pose[:3, 3]
    return points


def box_direction(quaternion: FloatArray) -> FloatArray:
    """(N, 3) directions of the x axes of (N, 4) rotations w, x, y, z; NaN for those of length 0."""
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        squared = (quaternion * quaternion).sum(axis=1)
        w, x, y, z = quaternion.T
        along = np.column_stack((w * w + x * x - y * y - z * z, 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)))
        direction: FloatArray = along / squared[:, None]
    return direction


def ground_covariance(rotation: FloatArray, pose_covariance: FloatArray) -> FloatArray:
    """Covariances of poses as the tracker takes them: x, y and yaw of a frame whose z points up.

    Args:
        rotation: (3, 3) or (N, 3, 3), from the frame of the covariances to that frame.
        pose_covariance: (N, 6, 6) of x, y, z and the rotations about them.

    Returns:
        (N, 3, 3); what position and yaw share is left out.
    """
    ground = np.zeros((len(pose_covariance), 3, 3))
    back = np.swapaxes(rotation, -1, -2)
    ground[:, :2, :2] = (rotation @ pose_covariance[:, :3, :3] @ back)[:, :2, :2]
    ground[:, 2, 2] = (rotation @ pose_covariance[:, 3:, 3:] @ back)[:, 2, 2]
    return ground
