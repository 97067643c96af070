"""What perception takes from ROS messages, as frozen values with arrays.

One function per message type reads a deserialised message of any peer (rosbags, mcap-ros2-support, rclpy):
all that it needs is attributes. The traps of each type are dealt with here and nowhere else: see docs/ros.md.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.poses import quaternion_yaw
from scenarios.ros.definitions import (
    BEV_DETECTIONS,
    DETECTION_3D_ARRAY,
    MONITORED_LANES,
    ODOMETRY,
    OLD_TRANSFORMS,
    POINT_CLOUD,
    PREDICTION_ARRAY,
    TRANSFORMS,
)
from scenarios.ros.point_rows import CloudMessage, point_rows
from smartmot.types import FloatArray, IntArray, StrArray, frozen

NO_CLASS_ID = -1
"""In place of a class index where the message has none."""

VELOCITY_FRAMES = ("ignore", "sensor", "world")
"""Axes of the detector's velocities: those of the sensor, those of the odometry's frame, or not used."""

FLAT_HEIGHT_M = 1.5
"""Height of boxes that come without one, that of a car."""

_NS_PER_S = 1_000_000_000


@dataclass(frozen=True, slots=True, eq=False)
class DetectionMessage:
    """Boxes of one message, N of them, in the frame of the sensor that is named; not checked for NaN.

    Args:
        stamp_ns: time of the measurement; None: the header was empty.
        frame_id: frame of the boxes; "": the header did not name it.
        received_ns: when the message was received, which counts where there is no stamp.
        class_id: (N,) index of the class, or NO_CLASS_ID. It is no identity.
        class_name: (N,) the sender's names; "" where it gave none.
        position_m: (N, 3) middles of the boxes.
        size_m: (N, 3) length, width and height.
        quaternion: (N, 4) w, x, y and z of the boxes' rotation; of length 0 where it was not set.
        velocity_mps: (N, 3) as sent, in axes that the message does not name; NaN where it has none.
        score: (N,) confidence; NaN where it has none.
        pose_covariance: (N, 6, 6) of x, y, z and the rotations about them, frame of the boxes, as sent; None:
            the message has none.

    Raises:
        ShapeError: shapes disagree.
    """

    stamp_ns: int | None
    frame_id: str
    received_ns: int
    class_id: IntArray
    class_name: StrArray
    position_m: FloatArray
    size_m: FloatArray
    quaternion: FloatArray
    velocity_mps: FloatArray
    score: FloatArray
    pose_covariance: FloatArray | None = None

    def __post_init__(self) -> None:
        count = len(self.score)
        if self.pose_covariance is not None:
            _freeze(self, "pose_covariance", np.float64, (count, 6, 6))
        _freeze(self, "class_id", np.int64, (count,))
        _freeze(self, "score", np.float64, (count,))
        for name, width in (("position_m", 3), ("size_m", 3), ("quaternion", 4), ("velocity_mps", 3)):
            _freeze(self, name, np.float64, (count, width))

    def __len__(self) -> int:
        return len(self.score)

    @property
    def time_ns(self) -> int:
        """The stamp, or when the message was received."""
        return self.received_ns if self.stamp_ns is None else self.stamp_ns

    @property
    def heading_rad(self) -> FloatArray:
        """(N,) headings about z of the sensor's frame, counter-clockwise from its x; NaN without rotation."""
        return quaternion_yaw(self.quaternion)


@dataclass(frozen=True, slots=True, eq=False)
class OdometryMessage:
    """Pose and velocity of the vehicle.

    Args:
        stamp_ns: time of the pose; None: the header was empty.
        frame_id: frame of the pose.
        child_frame_id: the vehicle's frame, whose pose it is, and of the velocities.
        received_ns: when the message was received.
        position_m: (3,) position.
        quaternion: (4,) w, x, y and z of the rotation.
        linear_mps: (3,) velocity, vehicle's frame.
        angular_radps: (3,) turn rates, vehicle's frame.

    Raises:
        ShapeError: shapes disagree.
    """

    stamp_ns: int | None
    frame_id: str
    child_frame_id: str
    received_ns: int
    position_m: FloatArray
    quaternion: FloatArray
    linear_mps: FloatArray
    angular_radps: FloatArray

    def __post_init__(self) -> None:
        for name, width in (("position_m", 3), ("quaternion", 4), ("linear_mps", 3), ("angular_radps", 3)):
            _freeze(self, name, np.float64, (width,))

    @property
    def time_ns(self) -> int:
        """The stamp, or when the message was received."""
        return self.received_ns if self.stamp_ns is None else self.stamp_ns


@dataclass(frozen=True, slots=True, eq=False)
class TransformMessage:
    """Transforms of one message, T of them, each from a child's frame to its parent's.

    Args:
        received_ns: when the message was received.
        stamp_ns: (T,) times, 0 where the header was empty.
        frame_id: T names of the parents' frames.
        child_frame_id: T names of the children's frames.
        position_m: (T, 3) origins of the children, parent's frame.
        quaternion: (T, 4) w, x, y and z of the rotations from child to parent.

    Raises:
        ShapeError: shapes disagree.
    """

    received_ns: int
    stamp_ns: IntArray
    frame_id: tuple[str, ...]
    child_frame_id: tuple[str, ...]
    position_m: FloatArray
    quaternion: FloatArray

    def __post_init__(self) -> None:
        count = len(self.frame_id)
        _freeze(self, "stamp_ns", np.int64, (count,))
        _freeze(self, "position_m", np.float64, (count, 3))
        _freeze(self, "quaternion", np.float64, (count, 4))

    def __len__(self) -> int:
        return len(self.frame_id)


@dataclass(frozen=True, slots=True, eq=False)
class MonitoredLane:
    """A lane that a planner monitors.

    Args:
        role: the sender's word: current, front, back, left, right.
        left_m: (P, 3) left border, map frame.
        right_m: (Q, 3) right border, map frame.

    Raises:
        ShapeError: shapes disagree.
    """

    role: str
    left_m: FloatArray
    right_m: FloatArray

    def __post_init__(self) -> None:
        for name in ("left_m", "right_m"):
            _freeze(self, name, np.float64, (None, 3))


@dataclass(frozen=True, slots=True)
class LaneMessage:
    """Lanes that a planner monitors.

    Args:
        stamp_ns: time of the message; None: the header was empty.
        received_ns: when the message was received.
        lanes: the lanes, map frame of the odometry.
    """

    stamp_ns: int | None
    received_ns: int
    lanes: tuple[MonitoredLane, ...]

    @property
    def time_ns(self) -> int:
        """The stamp, or when the message was received."""
        return self.received_ns if self.stamp_ns is None else self.stamp_ns


Message = DetectionMessage | OdometryMessage | TransformMessage | LaneMessage | CloudMessage


def stamp_ns(header: Any) -> int | None:
    """Nanoseconds of a header's stamp; None: it is 0, which stands for an empty header."""
    time_ns = int(header.stamp.sec) * _NS_PER_S + int(header.stamp.nanosec)
    return time_ns or None


def read_predictions(message: Any, received_ns: int) -> DetectionMessage:
    """Boxes of a bevfusion_msgs/PredictionArray.

    Positions are of the undersides, sizes are width, length and height, and headings are those of
    mmdetection3d before 1.0, clockwise from -y (mmdetection3d, `docs/en/compatibility.md`, v1.0.0rc0).
    """
    rows = message.predictions
    table = _table(
        [
            (
                *_xyz(row.position),
                *_xyz(row.size),
                *_xyz(row.velocity),
                row.z_rotation,
                row.score,
            )
            for row in rows
        ],
        11,
    )
    position, width_length_height = table[:, :3].copy(), table[:, 3:6]
    position[:, 2] += 0.5 * width_length_height[:, 2]
    return DetectionMessage(
        stamp_ns(message.header),
        _frame_name(message.header.frame_id),
        received_ns,
        np.array([row.id for row in rows], dtype=np.int64),
        np.array([row.class_name for row in rows], dtype=np.str_),
        position,
        width_length_height[:, (1, 0, 2)],
        _about_z(-table[:, 9] - 0.5 * math.pi),
        table[:, 6:9],
        table[:, 10],
    )


def read_detections_3d(message: Any, received_ns: int) -> DetectionMessage:
    """Boxes of a vision_msgs/Detection3DArray, each with the likeliest of its classes.

    Raises:
        DatasetError: the boxes are in several frames.
    """
    rows = message.detections
    own_frames = {_frame_name(row.header.frame_id) for row in rows} - {""}
    frame_id = _frame_name(message.header.frame_id)
    frames = own_frames | ({frame_id} - {""})
    if len(frames) > 1:
        raise DatasetError(f"boxes of one message in several frames: {', '.join(sorted(frames))}")
    likeliest = [_likeliest(row.results) for row in rows]
    covariances = [_UNKNOWN_POSE if pose is None else np.asarray(pose.covariance) for _, _, pose in likeliest]
    table = _table(
        [
            (*_xyz(row.bbox.center.position), *_wxyz(row.bbox.center.orientation), *_xyz(row.bbox.size))
            for row in rows
        ],
        10,
    )
    return DetectionMessage(
        stamp_ns(message.header),
        next(iter(frames), ""),
        received_ns,
        np.full(len(rows), NO_CLASS_ID),
        np.array([name for name, _, _ in likeliest], dtype=np.str_),
        table[:, :3],
        table[:, 7:],
        table[:, 3:7],
        np.full((len(rows), 3), np.nan),
        np.array([score for _, score, _ in likeliest], dtype=np.float64),
        np.array(covariances, dtype=np.float64).reshape(-1, 6, 6),
    )


def read_bev_detections(message: Any, received_ns: int) -> DetectionMessage:
    """Boxes of a t4ac_msgs/BEV_detections_list.

    Its frame is that of a picture from above, x to the right and y down; the lidar's x is -y of the picture,
    its y is -x, and directions turn alike. Boxes are flat: their middles are taken for the lidar's height,
    their heights for FLAT_HEIGHT_M. The senders fill velocities differently or not at all: they are not read.
    """
    rows = message.bev_detections_list
    table = _table([(row.x, row.y, row.l, row.w, row.o, row.score) for row in rows], 6)
    count = len(rows)
    return DetectionMessage(
        stamp_ns(message.header),
        _frame_name(message.header.frame_id),
        received_ns,
        np.full(count, NO_CLASS_ID),
        np.array([row.type for row in rows], dtype=np.str_),
        np.column_stack((-table[:, 1], -table[:, 0], np.zeros(count))),
        np.column_stack((table[:, 2:4], np.full(count, FLAT_HEIGHT_M))),
        # (cos o, sin o) of the picture is (-sin o, -cos o) of the lidar
        _about_z(-table[:, 4] - 0.5 * math.pi),
        np.full((count, 3), np.nan),
        table[:, 5],
    )


def read_odometry(message: Any, received_ns: int) -> OdometryMessage:
    """Pose and velocity of a nav_msgs/Odometry."""
    pose, twist = message.pose.pose, message.twist.twist
    return OdometryMessage(
        stamp_ns(message.header),
        _frame_name(message.header.frame_id),
        _frame_name(message.child_frame_id),
        received_ns,
        np.array(_xyz(pose.position)),
        np.array(_wxyz(pose.orientation)),
        np.array(_xyz(twist.linear)),
        np.array(_xyz(twist.angular)),
    )


def read_transforms(message: Any, received_ns: int) -> TransformMessage:
    """Transforms of a tf2_msgs/TFMessage."""
    rows = message.transforms
    table = _table(
        [(*_xyz(row.transform.translation), *_wxyz(row.transform.rotation)) for row in rows],
        7,
    )
    return TransformMessage(
        received_ns,
        np.array([stamp_ns(row.header) or 0 for row in rows], dtype=np.int64),
        tuple(_frame_name(row.header.frame_id) for row in rows),
        tuple(_frame_name(row.child_frame_id) for row in rows),
        table[:, :3],
        table[:, 3:],
    )


def read_lanes(message: Any, received_ns: int) -> LaneMessage:
    """Lanes of a t4ac_msgs/MonitorizedLanes, whose y is CARLA's: negated against the odometry's map frame."""
    return LaneMessage(
        stamp_ns(message.header),
        received_ns,
        tuple(
            MonitoredLane(str(lane.role), _border(lane.left.way), _border(lane.right.way))
            for lane in message.lanes
        ),
    )


def read_point_cloud(message: Any, received_ns: int) -> CloudMessage:
    """Points of a sensor_msgs/PointCloud2 with any fields.

    Raises:
        ReadError: fields lie outside a point, or there are fewer bytes than points.
    """
    frame_id = _frame_name(message.header.frame_id)
    return CloudMessage(stamp_ns(message.header), frame_id, received_ns, point_rows(message))


Reader = Callable[[Any, int], Message]

READERS: dict[str, Reader] = {
    PREDICTION_ARRAY: read_predictions,
    DETECTION_3D_ARRAY: read_detections_3d,
    BEV_DETECTIONS: read_bev_detections,
    ODOMETRY: read_odometry,
    TRANSFORMS: read_transforms,
    OLD_TRANSFORMS: read_transforms,
    MONITORED_LANES: read_lanes,
    POINT_CLOUD: read_point_cloud,
}
"""What reads a deserialised message, by its type; called with the message and the time of its receipt."""

DETECTION_TYPES = (PREDICTION_ARRAY, DETECTION_3D_ARRAY, BEV_DETECTIONS)
"""Types that hold boxes."""


def _freeze(target: object, name: str, dtype: type, shape: tuple[int | None, ...]) -> None:
    object.__setattr__(target, name, frozen(getattr(target, name), dtype, shape, name))


def _frame_name(name: Any) -> str:
    """A frame's name without the leading slash that ROS 1's tf allowed."""
    return str(name).removeprefix("/")


def _xyz(point: Any) -> tuple[float, float, float]:
    return point.x, point.y, point.z


def _wxyz(quaternion: Any) -> tuple[float, float, float, float]:
    return quaternion.w, quaternion.x, quaternion.y, quaternion.z


def _table(rows: list[tuple[float, ...]], width: int) -> FloatArray:
    """(N, width) float64, of no rows too."""
    return np.array(rows, dtype=np.float64).reshape(-1, width)


def _about_z(angle_rad: FloatArray) -> FloatArray:
    """(N, 4) quaternions w, x, y, z of turns about z."""
    zero = np.zeros(len(angle_rad))
    with np.errstate(invalid="ignore"):  # of infinite angles
        return np.column_stack((np.cos(0.5 * angle_rad), zero, zero, np.sin(0.5 * angle_rad)))


def _border(nodes: Iterable[Any]) -> FloatArray:
    border = _table([_xyz(node) for node in nodes], 3)
    border[:, 1] *= -1.0
    return border


_UNKNOWN_POSE = np.zeros(36)
"""Senders that know no covariance leave its entries 0."""


def _likeliest(results: Iterable[Any]) -> tuple[str, float, Any]:
    """Name, score and pose with covariance of the class with the greatest score; ("", NaN, None) without any.

    In vision_msgs before 4.0 a result holds name and score itself, and the name is `id`.
    """
    best: tuple[str, float, Any] = ("", math.nan, None)
    for result in results:
        hypothesis = getattr(result, "hypothesis", result)
        name = hypothesis.class_id if hasattr(hypothesis, "class_id") else hypothesis.id
        # not (score <= best): any score is better than NaN
        if not float(hypothesis.score) <= best[1]:
            best = (str(name), float(hypothesis.score), getattr(result, "pose", None))
    return best
