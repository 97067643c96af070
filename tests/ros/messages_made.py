"""Messages of rclpy for the node: a vehicle that drives towards boxes, in map frame and seconds."""

from __future__ import annotations

import math
from typing import Any

SENSOR = "lidar"
SPEED_MPS = 8.0
_NS = 1_000_000_000


def header(stamp_ns: int, frame_id: str) -> Any:
    from builtin_interfaces.msg import Time
    from std_msgs.msg import Header

    sec, nanosec = divmod(stamp_ns, _NS)
    return Header(stamp=Time(sec=sec, nanosec=nanosec), frame_id=frame_id)


def predictions(stamp_ns: int, count: int, driven_m: float, frame_id: str = SENSOR) -> Any:
    """Boxes that stand in a grid of 8 m by 5 m ahead, x ahead and y left of the sensor."""
    from bevfusion_msgs.msg import Prediction, PredictionArray
    from geometry_msgs.msg import Point, Vector3

    return PredictionArray(
        header=header(stamp_ns, frame_id),
        predictions=[
            Prediction(
                id=0,
                class_name="car",
                position=Point(x=60.0 + 8.0 * (k // 4) - driven_m, y=5.0 * (k % 4 - 2), z=0.0),
                size=Vector3(x=1.8, y=4.5, z=1.6),
                z_rotation=-0.5 * math.pi,
                score=0.8,
            )
            for k in range(count)
        ],
    )


def detections_3d(stamp_ns: int, count: int, driven_m: float, frame_id: str = SENSOR) -> Any:
    """The same boxes in the other type."""
    from geometry_msgs.msg import Point, Pose, Quaternion, Vector3
    from vision_msgs.msg import (
        BoundingBox3D,
        Detection3D,
        Detection3DArray,
        ObjectHypothesis,
        ObjectHypothesisWithPose,
    )

    boxes = []
    for k in range(count):
        position = Point(x=60.0 + 8.0 * (k // 4) - driven_m, y=5.0 * (k % 4 - 2), z=0.8)
        hypothesis = ObjectHypothesis(class_id="car", score=0.8)
        boxes.append(
            Detection3D(
                header=header(stamp_ns, frame_id),
                results=[ObjectHypothesisWithPose(hypothesis=hypothesis)],
                bbox=BoundingBox3D(
                    center=Pose(position=position, orientation=Quaternion(w=1.0)),
                    size=Vector3(x=4.5, y=1.8, z=1.6),
                ),
            )
        )
    return Detection3DArray(header=header(stamp_ns, frame_id), detections=boxes)


def odometry(stamp_ns: int, driven_m: float) -> Any:
    from nav_msgs.msg import Odometry

    message = Odometry(header=header(stamp_ns, "map"), child_frame_id="base_link")
    message.pose.pose.position.x = driven_m
    message.twist.twist.linear.x = SPEED_MPS
    return message


def transforms(stamp_ns: int, *rows: tuple[str, str, float]) -> Any:
    """Rows of parent, child and how far the child is ahead of it."""
    from geometry_msgs.msg import TransformStamped
    from tf2_msgs.msg import TFMessage

    made = []
    for parent, child, ahead_m in rows:
        transform = TransformStamped(header=header(stamp_ns, parent), child_frame_id=child)
        transform.transform.translation.x = ahead_m
        made.append(transform)
    return TFMessage(transforms=made)
