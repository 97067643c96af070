"""The node among peers that are not rclpy: rosless speaks DDS by itself, with types from the .msg files."""

from __future__ import annotations

import os
import time
from pathlib import Path

import pytest

from tests.ros.messages_made import SPEED_MPS
from tests.ros.peer import START_S, LiveProcess

PACKAGES = (
    Path(__file__).parents[2] / "ros" / "bevfusion_msgs",
    Path(__file__).parent / "packages" / "vision_msgs",
)
BEGIN_NS, PERIOD_S, FRAMES, BOXES = 1_700_000_000_000_000_000, 0.05, 200, 20
ANSWER_S = 60.0
"""A loaded machine may take so long for an answer."""


def stamp(frame: int) -> dict[str, int]:
    sec, nanosec = divmod(BEGIN_NS + frame * round(PERIOD_S * 1e9), 1_000_000_000)
    return {"sec": sec, "nanosec": nanosec}


def prediction(k: int, driven_m: float) -> dict[str, object]:
    return {
        "id": 0,
        "class_name": "car",
        "position": {"x": 60.0 + 8.0 * (k // 4) - driven_m, "y": 5.0 * (k % 4 - 2), "z": 0.0},
        "size": {"x": 1.8, "y": 4.5, "z": 1.6},
        "z_rotation": -1.5707963,
        "score": 0.8,
    }


def test_20_boxes_at_20_hz_are_all_answered(tmp_path: Path) -> None:
    import rosless

    for package in PACKAGES:
        rosless.register_path(str(package))
    domain = int(os.environ["ROS_DOMAIN_ID"])
    reliable = {"reliability": "reliable", "depth": 500, "domain": domain}
    arguments = ("--ros-args", "-p", "sensor_pose:=[0.0, 0.0, 0.0, 0.0]")
    with LiveProcess(tmp_path, *arguments) as process:
        process.wait_until_ready()
        with (
            rosless.advertise("/localization/pose", "nav_msgs/msg/Odometry", **reliable) as odometry,
            rosless.advertise(
                "/bevfusion_detections", "bevfusion_msgs/msg/PredictionArray", **reliable
            ) as boxes,
            rosless.subscribe("/smartmot/tracks", **reliable) as tracks,
        ):
            deadline = time.monotonic() + START_S
            while not (odometry.subscriber_count and boxes.subscriber_count):
                assert time.monotonic() < deadline, "the node is not found"
                time.sleep(0.1)
            time.sleep(1.0)  # the node's publisher has to know of us, too
            answers = []
            begin = time.monotonic()
            for frame in range(FRAMES):
                driven_m = SPEED_MPS * frame * PERIOD_S
                header = {"stamp": stamp(frame), "frame_id": "map"}
                position = {"x": driven_m, "y": 0.0, "z": 0.0}
                odometry.send(
                    {
                        "header": header,
                        "child_frame_id": "base_link",
                        "pose": {"pose": {"position": position, "orientation": {"w": 1.0}}},
                        "twist": {"twist": {"linear": {"x": SPEED_MPS}}},
                    }
                )
                predictions = [prediction(k, driven_m) for k in range(BOXES)]
                boxes.send({"header": {**header, "frame_id": "lidar"}, "predictions": predictions})
                # rosless keeps what is not read, but not without limit
                due = begin + (frame + 1) * PERIOD_S
                late = time.monotonic() + ANSWER_S
                # a slow machine slows the sender down: the node keeps the last ten frames
                while (left := due - time.monotonic()) > 0.0 or len(answers) < frame - 5:
                    assert time.monotonic() < late, process.output
                    if (message := tracks.read(timeout=max(left, 0.05))) is not None:
                        answers.append(message)
            while len(answers) < FRAMES and (message := tracks.read(timeout=10.0)) is not None:
                answers.append(message)
        assert process.stop() == 0
    assert [{"sec": m.header.stamp.sec, "nanosec": m.header.stamp.nanosec} for m in answers] == [
        stamp(frame) for frame in range(FRAMES)
    ], process.output
    last = answers[-1]
    assert last.header.frame_id == "map"
    assert len(last.detections) == BOXES
    places = sorted((d.bbox.center.position.x, d.bbox.center.position.y) for d in last.detections)
    expected = sorted((60.0 + 8.0 * (k // 4), 5.0 * (k % 4 - 2)) for k in range(BOXES))
    assert places == [pytest.approx(place, abs=0.1) for place in expected]
