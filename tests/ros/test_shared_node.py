"""One process of the node for several tests, among real publishers and subscribers of rclpy."""

from __future__ import annotations

import itertools
import signal
from collections.abc import Iterator
from typing import Any

import pytest

from scenarios.live.topics import PUBLISHED, READ, PublishedTopic
from tests.ros.drive_made import (
    BEGIN_NS,
    COLLISION,
    DETECTION_3D_ARRAY,
    DETECTIONS,
    MARKERS,
    ODOMETRY,
    PERIOD_NS,
    PREDICTION_ARRAY,
    SECOND_NS,
    SENSOR_AT,
    TRACKS,
    send_frames,
    stamps,
)
from tests.ros.messages_made import predictions
from tests.ros.peer import START_S, LiveProcess, Peer

_TEST = itertools.count()
FLOOD = 5000
"""Frames; more than DDS keeps on the way to a reader that stands still: 10 in the writer, and what fits into
half a megabyte of the transport."""


@pytest.fixture(scope="module")
def shared_node(tmp_path_factory: pytest.TempPathFactory) -> Iterator[LiveProcess]:
    """A node for several tests, each of which begins later than the one before ends."""
    folder = tmp_path_factory.mktemp("node")
    with LiveProcess(folder, "--ros-args", "-p", SENSOR_AT, "-p", "max_age:=3") as process:
        process.wait_until_ready()
        yield process
        assert process.stop() == 0
        assert "Traceback" not in process.output


@pytest.fixture
def begin_ns() -> int:
    return BEGIN_NS + next(_TEST) * 1000 * SECOND_NS


def counts(message: Any) -> dict[str, float]:
    """Numbers of a status by name."""
    return {pair.key: float(pair.value) for pair in message.status[0].values}


@pytest.mark.usefixtures("shared_node")
def test_20_boxes_at_20_hz_are_all_answered(peer: Peer, begin_ns: int) -> None:
    peer.advertise(ODOMETRY, "nav_msgs/msg/Odometry")
    peer.advertise(DETECTIONS, PREDICTION_ARRAY)
    tracks = peer.listen(TRACKS, DETECTION_3D_ARRAY)
    markers = peer.listen(MARKERS, "visualization_msgs/msg/MarkerArray")
    collisions = peer.listen(COLLISION, "std_msgs/msg/Bool")
    status = peer.listen("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    peer.wait_until_matched()
    sent = send_frames(peer, 200, 20, 0.05, begin_ns)
    peer.spin_until(lambda: len(tracks) >= 200 and len(markers) >= 200 and len(collisions) >= 200)
    assert stamps(tracks) == sent
    assert (len(markers), len(collisions)) == (200, 200)
    # boxes that stand are at the same place of the map in every frame
    last = tracks[-1].detections
    assert tracks[-1].header.frame_id == "map"
    assert sorted((round(d.bbox.center.position.x, 1), round(d.bbox.center.position.y, 1)) for d in last) == [
        (60.0 + 8.0 * i, 5.0 * (j - 2)) for i in range(5) for j in range(4)
    ]
    assert len({d.id for message in tracks[-100:] for d in message.detections}) == 20
    assert len(status) >= 8  # once a second
    told = counts(status[-1])
    answered_ms = [told[name] for name in told if name.startswith("receiving to publishing")]
    assert len(answered_ms) == 2
    assert 0.0 < answered_ms[0] <= answered_ms[1]


@pytest.mark.usefixtures("shared_node")
def test_quality_of_service_is_that_of_the_table(peer: Peer) -> None:
    from rclpy.qos import DurabilityPolicy, ReliabilityPolicy

    def published(topic: PublishedTopic) -> list[Any]:
        infos = peer.node.get_publishers_info_by_topic(topic.name)
        return [info for info in infos if info.node_name == "smartmot"]

    peer.spin_until(lambda: all(map(published, PUBLISHED)), START_S)
    for topic in PUBLISHED:
        (info,) = published(topic)
        assert info.topic_type == topic.type_name
        assert info.qos_profile.reliability == ReliabilityPolicy.RELIABLE
        assert info.qos_profile.durability == DurabilityPolicy.VOLATILE
    offered = {
        topic.name: peer.node.get_subscriptions_info_by_topic(topic.name)[0].qos_profile for topic in READ
    }
    assert offered[DETECTIONS].reliability == ReliabilityPolicy.RELIABLE
    assert offered[ODOMETRY].reliability == ReliabilityPolicy.BEST_EFFORT
    assert offered["/tf_static"].durability == DurabilityPolicy.TRANSIENT_LOCAL
    assert offered["/tf"].durability == DurabilityPolicy.VOLATILE


@pytest.mark.usefixtures("shared_node")
def test_late_frames_and_bytes_that_are_no_message_are_counted_and_not_answered(
    peer: Peer, begin_ns: int
) -> None:
    peer.advertise(ODOMETRY, "nav_msgs/msg/Odometry")
    peer.advertise(DETECTIONS, PREDICTION_ARRAY)
    tracks = peer.listen(TRACKS, DETECTION_3D_ARRAY)
    status = peer.listen("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    peer.wait_until_matched()
    peer.spin_until(lambda: status)
    before = counts(status[-1])
    sent = send_frames(peer, 10, 2, 0.05, begin_ns)
    peer.spin_until(lambda: len(tracks) >= 10)
    for k in (4, 9, 2):  # older, the same, and again older
        peer.send(DETECTIONS, predictions(begin_ns + k * PERIOD_NS, 2, 0.0))
    for data in (b"\x00\x01\x00\x00" + b"\xff" * 64, b"\x00\x01\x00\x00"):
        peer.send(DETECTIONS, data)
    seen = len(status)
    peer.spin_until(lambda: len(status) >= seen + 3)
    now = counts(status[-1])
    assert {name: now[name] - before[name] for name in ("frames late", "messages refused")} == {
        "frames late": 3,
        "messages refused": 2,
    }
    assert stamps(tracks) == sent


def test_frames_that_come_faster_than_they_are_taken_are_counted(
    shared_node: LiveProcess, peer: Peer, begin_ns: int
) -> None:
    peer.advertise(DETECTIONS, PREDICTION_ARRAY)
    status = peer.listen("/diagnostics", "diagnostic_msgs/msg/DiagnosticArray")
    peer.wait_until_matched()
    peer.spin_until(lambda: status)
    # the publishers of the tests before are gone: the node counts what is lost of a single one
    peer.spin_until(lambda: peer.node.count_publishers(DETECTIONS) == 1)
    before = counts(status[-1])
    peer.send(DETECTIONS, predictions(begin_ns, 2, 0.0))
    peer.spin_until(lambda: counts(status[-1])["frames"] > before["frames"])
    shared_node.process.send_signal(signal.SIGSTOP)
    for k in range(1, FLOOD):
        peer.send(DETECTIONS, predictions(begin_ns + k * PERIOD_NS, 2, 0.0))
    shared_node.process.send_signal(signal.SIGCONT)

    def since(name: str) -> float:
        return counts(status[-1])[name] - before[name]

    # the last frame to be taken shows what was lost before it
    peer.spin_until(lambda: since("frames") + since("frames lost") >= FLOOD, START_S)
    assert since("frames") + since("frames lost") == FLOOD
    assert 0 < since("frames lost") < FLOOD - 1


@pytest.mark.usefixtures("shared_node")
def test_parameters_cannot_change_while_it_runs(peer: Peer) -> None:
    from rcl_interfaces.srv import SetParameters
    from rclpy.parameter import Parameter

    client = peer.node.create_client(SetParameters, "/smartmot/set_parameters")
    peer.spin_until(client.service_is_ready, START_S)
    request = SetParameters.Request(parameters=[Parameter("max_age", value=5).to_parameter_msg()])
    future = client.call_async(request)
    peer.spin_until(future.done)
    (result,) = future.result().results
    assert not result.successful
    assert "max_age" in result.reason
