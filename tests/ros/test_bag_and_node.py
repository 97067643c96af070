"""Messages of a bag through the node, against `smartmot-eval bag` on the same bag: equal in every digit."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from scenarios.live.topics import PUBLISHED
from scenarios.ros.bags.bag import open_bag
from scenarios.ros.bags.topics import RawMessage
from tests.ros.messages_made import header
from tests.ros.peer import LiveProcess, Peer, message_class
from tests.ros.test_serialisation import fields

BAG = Path(__file__).parents[1] / "data" / "ros2" / "bevfusion" / "tracker_input_mcap"
DETECTIONS, ODOMETRY = "/bevfusion_detections", "/localization/pose"
TYPES = {DETECTIONS: "bevfusion_msgs/msg/PredictionArray", ODOMETRY: "nav_msgs/msg/Odometry"}
ANSWERS = {topic.name: topic.type_name for topic in PUBLISHED if topic.name != "/diagnostics"}
FRAMES = 40
WITHOUT_STAMP = 7
"""The frame whose header is empty."""


def stored(path: Path) -> list[RawMessage]:
    """Messages in the order in which they were received."""
    with open_bag(path) as bag:
        return sorted(bag.raw(), key=lambda message: message.received_ns)


def by_bag(path: Path, out: Path) -> dict[str, list[Any]]:
    """Fields of what the command writes, by topic."""
    from rclpy.serialization import deserialize_message

    command = "from _smartmot import main; main()"
    run = subprocess.run(
        [sys.executable, "-c", command, "bag", str(path), "--out", str(out), "--quiet"],
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stdout + run.stderr
    answers: dict[str, list[Any]] = {name: [] for name in ANSWERS}
    for message in stored(out):
        name = message.topic.name
        if name in answers:
            kind = message_class(ANSWERS[name])
            answers[name].append(fields(deserialize_message(message.data, kind)))
    return answers


def by_node(folder: Path, messages: list[RawMessage], clock: bool) -> dict[str, list[Any]]:
    """Fields of what the node publishes, by topic; with a clock that shows the bag's times of receipt."""
    from rosgraph_msgs.msg import Clock

    arguments = ("--ros-args", "-p", "use_sim_time:=true") if clock else ()
    with LiveProcess(folder, *arguments) as process, Peer() as peer:
        process.wait_until_ready()
        received = {name: peer.listen(name, kind) for name, kind in ANSWERS.items()}
        for name, kind in TYPES.items():
            peer.advertise(name, kind)
        if clock:
            peer.advertise("/clock", "rosgraph_msgs/msg/Clock")
        peer.wait_until_matched()
        unstamped = [message for message in messages if message.topic.name == DETECTIONS][WITHOUT_STAMP]
        for message in messages:
            # the time of receipt counts for one frame alone: it has to be there when that comes
            pause_s = 0.3 if message is unstamped else 0.02
            for _ in range(3 if clock else 0):  # of a best-effort topic
                peer.send("/clock", Clock(clock=header(message.received_ns, "").stamp))
                peer.spin_for(pause_s)
            peer.send(message.topic.name, message.data)
            peer.spin_for(pause_s)
        tracks = received["/smartmot/tracks"]
        frames = sum(message.topic.name == DETECTIONS for message in messages)
        peer.spin_until(lambda: len(tracks) >= frames)
        peer.spin_for(0.5)
        assert process.stop() == 0
    return {name: [fields(message) for message in rows] for name, rows in received.items()}


@pytest.mark.parametrize("clock", [True, False])
def test_node_and_bag_command_give_the_same_answers(tmp_path: Path, clock: bool) -> None:
    messages = stored(BAG)
    path = BAG
    if not clock:  # the time of receipt of the frame without a stamp is another one
        messages = without_frame(messages)
        path = tmp_path / "stamped"
        write(path, messages)
    expected = by_bag(path, tmp_path / "answers")
    frames = FRAMES if clock else FRAMES - 1
    assert [len(rows) for rows in expected.values()] == [frames] * len(ANSWERS)
    assert sum(len(message["detections"]) for message in expected["/smartmot/tracks"]) > frames
    answered = by_node(tmp_path, messages, clock)
    for name, rows in expected.items():
        assert answered[name] == rows, name


def without_frame(messages: list[RawMessage]) -> list[RawMessage]:
    """The messages without the frame whose header is empty."""
    frames = [message for message in messages if message.topic.name == DETECTIONS]
    assert len(frames) == FRAMES
    return [message for message in messages if message is not frames[WITHOUT_STAMP]]


def write(path: Path, messages: list[RawMessage]) -> None:
    """A bag of the messages."""
    from rosbags.rosbag2 import StoragePlugin, Writer

    from scenarios.ros.definitions import ros2_types

    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as bag:
        connections = {
            name: bag.add_connection(name, kind, typestore=ros2_types()) for name, kind in TYPES.items()
        }
        for message in messages:
            bag.write(connections[message.topic.name], message.received_ns, message.data)
