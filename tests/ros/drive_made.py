"""A drive at 20 Hz through the node: names of its topics, what is sent and what comes back."""

from __future__ import annotations

from typing import Any

from tests.ros.messages_made import SPEED_MPS, odometry, predictions
from tests.ros.peer import Peer

DETECTIONS, DETECTIONS_3D, ODOMETRY = "/bevfusion_detections", "/detections", "/localization/pose"
TRACKS, MARKERS = "/smartmot/tracks", "/tracked_objects"
COLLISION = "/t4ac/perception/monitors/predicted_collision"
PREDICTION_ARRAY = "bevfusion_msgs/msg/PredictionArray"
DETECTION_3D_ARRAY = "vision_msgs/msg/Detection3DArray"
BEGIN_NS = 1_700_000_000_000_000_000
PERIOD_NS = 50_000_000
SECOND_NS = 1_000_000_000

SENSOR_AT = "sensor_pose:=[0.0, 0.0, 0.0, 0.0]"


def stamps(messages: list[Any]) -> list[int]:
    return [m.header.stamp.sec * 1_000_000_000 + m.header.stamp.nanosec for m in messages]


def send_frames(peer: Peer, count: int, boxes: int, period_s: float, begin_ns: int = BEGIN_NS) -> list[int]:
    """Odometry and boxes of a drive at 20 Hz; the stamps."""
    sent = []
    for k in range(count):
        stamp_ns = begin_ns + k * PERIOD_NS
        driven_m = SPEED_MPS * k * PERIOD_NS * 1e-9
        peer.send(ODOMETRY, odometry(stamp_ns, driven_m))
        peer.send(DETECTIONS, predictions(stamp_ns, boxes, driven_m))
        sent.append(stamp_ns)
        peer.spin_for(period_s)
    return sent
