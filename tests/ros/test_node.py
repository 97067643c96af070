"""Processes of the node, each with parameters of its own, among publishers and subscribers of rclpy."""

from __future__ import annotations

import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.ros.drive_made import (
    BEGIN_NS,
    DETECTION_3D_ARRAY,
    DETECTIONS,
    DETECTIONS_3D,
    ODOMETRY,
    PERIOD_NS,
    PREDICTION_ARRAY,
    SECOND_NS,
    SENSOR_AT,
    TRACKS,
    send_frames,
    stamps,
)
from tests.ros.messages_made import (
    detections_3d,
    header,
    odometry,
    predictions,
    transforms,
)
from tests.ros.peer import LiveProcess, Peer, run_node


@pytest.fixture
def node(tmp_path: Path) -> Iterator[Any]:
    """Starts the node with parameters; it is killed at the end if it still runs."""
    with ExitStack() as stack:

        def start(*parameters: str, remap: tuple[str, ...] = ()) -> LiveProcess:
            arguments = [word for parameter in parameters for word in ("-p", parameter)]
            arguments += [word for rule in remap for word in ("-r", rule)]
            process = stack.enter_context(LiveProcess(tmp_path, "--ros-args", *arguments))
            process.wait_until_ready()
            return process

        yield start


def test_odometry_of_a_best_effort_sender_is_taken(node: Any, peer: Peer) -> None:
    node(SENSOR_AT, remap=(f"{ODOMETRY}:=/odom",))
    peer.advertise("/odom", "nav_msgs/msg/Odometry", reliable=False)
    peer.advertise(DETECTIONS, PREDICTION_ARRAY)
    tracks = peer.listen(TRACKS, DETECTION_3D_ARRAY)
    peer.wait_until_matched()
    for k in range(5):
        peer.send("/odom", odometry(BEGIN_NS + k * PERIOD_NS, 100.0))
        peer.spin_for(0.02)
        peer.send(DETECTIONS, predictions(BEGIN_NS + k * PERIOD_NS, 1, 0.0))
        peer.spin_for(0.05)
    peer.spin_until(lambda: len(tracks) >= 5)
    assert tracks[-1].header.frame_id == "map"
    assert tracks[-1].detections[0].bbox.center.position.x == pytest.approx(160.0, abs=0.1)


def test_poses_of_transforms_alone_with_static_ones_sent_before_the_node_came(node: Any, peer: Peer) -> None:
    peer.advertise("/tf_static", "tf2_msgs/msg/TFMessage", latched=True)
    peer.send("/tf_static", transforms(0, ("base_link", "lidar", 2.0)))
    node()
    peer.advertise("/tf", "tf2_msgs/msg/TFMessage")
    peer.advertise(DETECTIONS, PREDICTION_ARRAY)
    tracks = peer.listen(TRACKS, DETECTION_3D_ARRAY)
    peer.wait_until_matched()
    for k in range(8):
        stamp_ns = BEGIN_NS + k * PERIOD_NS
        peer.send("/tf", transforms(stamp_ns, ("map", "odom", 1000.0), ("odom", "base_link", 0.4 * k)))
        peer.send(DETECTIONS, predictions(stamp_ns, 1, 0.4 * k))
        peer.spin_for(0.1)
    peer.spin_until(lambda: len(tracks) >= 8)
    assert tracks[-1].header.frame_id == "map"
    assert tracks[-1].detections[0].bbox.center.position.x == pytest.approx(1000.0 + 2.0 + 60.0, abs=0.1)


def test_simulated_time_stands_in_for_stamps_that_are_not_there(node: Any, peer: Peer) -> None:
    node(SENSOR_AT, "use_sim_time:=true")
    peer.advertise("/clock", "rosgraph_msgs/msg/Clock")
    peer.advertise(DETECTIONS, PREDICTION_ARRAY)
    tracks = peer.listen(TRACKS, DETECTION_3D_ARRAY)
    status = peer.listen("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    peer.wait_until_matched()
    times = [BEGIN_NS + k * SECOND_NS for k in range(1, 5)]
    for k, time_ns in enumerate(times):
        set_clock(peer, time_ns, lambda time_ns=time_ns: time_ns in stamps(status))
        peer.send(DETECTIONS, predictions(0, 1, 0.0, frame_id=""))
        peer.spin_for(0.3)
        # the first frame waits for a pose
        set_clock(peer, time_ns + 2 * PERIOD_NS, lambda k=k: len(tracks) > k)
    late_ns = np.subtract(stamps(tracks), times)
    assert ((late_ns >= 0) & (late_ns <= 2 * PERIOD_NS)).all()


def set_clock(peer: Peer, time_ns: int, seen: Callable[[], bool]) -> None:
    """Say a time until it is seen to have arrived; the topic is a best-effort one."""
    from rosgraph_msgs.msg import Clock

    for _ in range(100):
        peer.send("/clock", Clock(clock=header(time_ns, "").stamp))
        peer.spin_for(0.1)
        if seen():
            return
    raise AssertionError("the time has not arrived")


def test_boxes_of_vision_msgs_give_the_tracks_of_those_of_bevfusion(node: Any, peer: Peer) -> None:
    process = node(SENSOR_AT)
    peer.advertise(DETECTIONS_3D, DETECTION_3D_ARRAY, reliable=False)
    peer.advertise(DETECTIONS, PREDICTION_ARRAY)
    tracks = peer.listen(TRACKS, DETECTION_3D_ARRAY)
    peer.wait_until_matched()
    for k in range(4):
        peer.send(DETECTIONS_3D, detections_3d(BEGIN_NS + k * PERIOD_NS, 3, 0.0))
        peer.spin_for(0.1)
    peer.spin_until(lambda: len(tracks) >= 4)
    places = [(d.bbox.center.position.x, d.bbox.center.position.y) for d in tracks[-1].detections]
    assert sorted(places) == [pytest.approx((60.0, 5.0 * (j - 2)), abs=0.1) for j in range(3)]
    # a second source is left out, and that is said
    peer.send(DETECTIONS, predictions(BEGIN_NS + 4 * PERIOD_NS, 3, 0.0))
    peer.spin_for(1.0)
    assert len(tracks) == 4
    assert process.stop() == 0
    assert "1 frames of a second source" in process.output
    assert "is left out: boxes come from /detections" in process.output


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signals_end_it_cleanly_while_frames_come(node: Any, peer: Peer, number: int) -> None:
    process = node(SENSOR_AT)
    peer.advertise(ODOMETRY, "nav_msgs/msg/Odometry")
    peer.advertise(DETECTIONS, PREDICTION_ARRAY)
    tracks = peer.listen(TRACKS, DETECTION_3D_ARRAY)
    peer.wait_until_matched()
    send_frames(peer, 20, 20, 0.01)
    peer.spin_until(lambda: len(tracks) >= 5)
    process.process.send_signal(number)
    send_frames(peer, 20, 20, 0.01, BEGIN_NS + 20 * PERIOD_NS)
    assert process.process.wait(30) == 0
    lines = process.output.splitlines()
    assert "Traceback" not in process.output
    assert lines[-1].startswith("smartmot-ros: ")
    assert "frames" in lines[-1]


@pytest.mark.parametrize(
    ("parameter", "named"),
    [
        ("max_aeg:=3", "max_aeg"),
        ("detection_th:=high", "detection_th"),
        ("strategy:=map", "needs a map"),
        ("rule:=no_such_module:Rule", "no_such_module"),
    ],
)
def test_wrong_parameters_are_one_line_and_status_2(parameter: str, named: str) -> None:
    run = run_node("--ros-args", "-p", parameter)
    assert (run.returncode, run.stdout) == (2, "")
    (line,) = run.stderr.splitlines()
    assert line.startswith("smartmot-ros: ")
    assert named in line


def test_arguments_that_ros_refuses_are_said() -> None:
    run = run_node("--ros-args", "-p", "max_age")
    assert run.returncode == 2
    lines = [line for line in run.stderr.splitlines() if "[rcl]" not in line]  # rcl logs one of its own
    assert len(lines) == 1
    assert lines[0].startswith("smartmot-ros: ROS 2 refuses the arguments")


def test_missing_packages_of_messages_are_named() -> None:
    hidden = (
        "import sys; sys.modules['vision_msgs'] = None;from scenarios.live.node.command import main; main()"
    )
    run = run_node(python=(sys.executable, "-c", hidden))
    assert run.returncode == 2
    (line,) = [line for line in run.stderr.splitlines() if line.startswith("smartmot-ros: ")]
    assert "vision_msgs" in line
    assert "install ros-" in line
