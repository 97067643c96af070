"""The node with several detectors, among stand-ins for rclpy: what it reads, and what the command writes."""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path
from types import ModuleType, SimpleNamespace
from typing import Any

import pytest

from evaluation.studies.bag import BagOptions, see_bag
from scenarios.live.detectors import read_detectors
from scenarios.live.node.node import LiveNode
from scenarios.live.settings import LiveSettings
from scenarios.live.topics import PUBLISHED, READ
from scenarios.ros.bags.bag import open_bag
from scenarios.ros.bags.topics import RawMessage
from tests.evaluation.cli.recorded.test_bag import DETECTORS, write_by_two, write_drive

STATUS = "/diagnostics"


class StandIn:
    """A node of rclpy without ROS: keeps what is subscribed to, published and logged."""

    def __init__(self, parameters: dict[str, object]) -> None:
        self.parameters, self.now_ns = parameters, 0
        self.readers: dict[str, tuple[Callable[[bytes, dict[str, int]], None], Any]] = {}
        self.sent: dict[str, list[bytes]] = {topic.name: [] for topic in PUBLISHED}
        self.warnings: list[str] = []

    def get_clock(self) -> Any:
        return SimpleNamespace(now=lambda: SimpleNamespace(nanoseconds=self.now_ns))

    def get_logger(self) -> Any:
        return SimpleNamespace(info=lambda text: None, warning=lambda text, **_: self.warnings.append(text))

    def get_parameters_by_prefix(self, prefix: str) -> dict[str, Any]:
        return {name: SimpleNamespace(value=value) for name, value in self.parameters.items()}

    def add_on_set_parameters_callback(self, callback: object) -> None:
        pass

    def create_publisher(self, kind: type, topic: str, quality: object) -> Any:
        return SimpleNamespace(publish=self.sent[topic].append)

    def create_subscription(
        self, kind: type, topic: str, take: Callable[..., None], quality: Any, raw: bool
    ) -> None:
        assert raw
        self.readers[topic] = (take, quality)

    def create_timer(self, interval_s: float, tick: Callable[[], None], clock: object) -> None:
        self.tick = tick

    def count_publishers(self, topic: str) -> int:
        return 1


@pytest.fixture
def rclpy(monkeypatch: pytest.MonkeyPatch) -> Any:
    """Stands in for rclpy and the packages of messages."""
    names = ("KEEP_LAST", "RELIABLE", "BEST_EFFORT", "TRANSIENT_LOCAL", "VOLATILE")
    policies = SimpleNamespace(**{name: name for name in names})
    quality = ModuleType("rclpy.qos")
    for name in ("DurabilityPolicy", "HistoryPolicy", "ReliabilityPolicy"):
        setattr(quality, name, policies)
    quality.QoSProfile = lambda **values: SimpleNamespace(**values)  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "rclpy", ModuleType("rclpy"))
    monkeypatch.setitem(sys.modules, "rclpy.qos", quality)
    kinds = {topic.type_name for topic in (*PUBLISHED, *READ)}
    for package in {kind.split("/")[0] for kind in kinds}:
        module = ModuleType(f"{package}.msg")
        for kind in kinds:
            setattr(module, kind.split("/")[2], type(kind.split("/")[2], (), {}))
        monkeypatch.setitem(sys.modules, package, ModuleType(package))
        monkeypatch.setitem(sys.modules, f"{package}.msg", module)
    steady = SimpleNamespace(Clock=lambda clock_type: None, ClockType=SimpleNamespace(STEADY_TIME=1))
    return SimpleNamespace(clock=steady)


def stored(path: Path) -> list[RawMessage]:
    with open_bag(path) as bag:
        return sorted(bag.raw(), key=lambda message: message.received_ns)


@pytest.fixture
def recorded(tmp_path: Path) -> Path:
    """A drive of 2 s on two topics, one 0.12 s late."""
    return write_by_two(tmp_path / "by_two", write_drive(tmp_path / "drive", 40), 120_000_000)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    made = tmp_path / "detectors.toml"
    made.write_text(DETECTORS + "reliable = true\ndepth = 3\n")
    return made


def play(node: StandIn, path: Path) -> None:
    """Give the messages of a bag to a node, at the times at which they were received."""
    numbers: dict[str, int] = {}
    for message in stored(path):
        node.now_ns, name = message.received_ns, message.topic.name
        numbers[name] = numbers.get(name, 0) + 1
        reader = "/localization/pose" if name == "/odom" else name
        information = {"publication_sequence_number": numbers[name], "received_timestamp": 0}
        node.readers[reader][0](message.data, information)


def test_the_node_answers_as_the_command_on_the_same_messages(
    tmp_path: Path, rclpy: Any, recorded: Path, file: Path
) -> None:
    settings = LiveSettings(detectors=read_detectors(file))
    see_bag(BagOptions(recorded, tmp_path / "out", settings=settings), lambda done, total: None)
    node = StandIn({"detectors": str(file)})
    live = LiveNode(rclpy, node)
    play(node, recorded)
    node.now_ns += 100_000_000
    node.tick()
    written: dict[str, list[bytes]] = {topic.name: [] for topic in PUBLISHED}
    for message in stored(tmp_path / "out"):
        written[message.topic.name].append(bytes(message.data))
    assert len(written["/smartmot/tracks"]) == 40
    for name in written.keys() - {STATUS}:
        assert [bytes(each) for each in node.sent[name]] == written[name], name
    assert live.summary() == (
        "40 frames, 40 tracked; lidar: 20 frames, 0 behind a newer one, 0 left out; "
        "camera: 20 frames, 19 behind a newer one, 0 left out"
    )
    assert not node.warnings


def test_topics_types_and_quality_are_those_of_the_file(rclpy: Any, file: Path) -> None:
    node = StandIn({"detectors": str(file)})
    LiveNode(rclpy, node)
    assert set(node.readers) == {"/lidar", "/camera", "/localization/pose", "/tf", "/tf_static"}
    lidar, camera = (node.readers[name][1] for name in ("/lidar", "/camera"))
    assert (lidar.reliability, lidar.depth, lidar.durability) == ("BEST_EFFORT", 10, "VOLATILE")
    assert (camera.reliability, camera.depth) == ("RELIABLE", 3)


def test_lost_frames_are_counted_by_topic(rclpy: Any, recorded: Path, file: Path) -> None:
    """Numbers of two publishers run side by side: only those that are missing on one of them are lost."""
    node = StandIn({"detectors": str(file)})
    live = LiveNode(rclpy, node)
    play(node, recorded)
    assert "lost" not in live.summary()
    last = [each for each in stored(recorded) if each.topic.name == "/camera"][-1]
    node.readers["/camera"][0](last.data, {"publication_sequence_number": 24, "received_timestamp": 0})
    assert "3 frames lost" in live.summary()


def test_a_detectors_type_that_the_workspace_does_not_have_ends_the_node(
    rclpy: Any, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from scenarios.live.node.command import NodeError

    monkeypatch.setitem(sys.modules, "bevfusion_msgs.msg", None)
    with pytest.raises(NodeError, match="bevfusion_msgs/msg/PredictionArray is not in the sourced workspace"):
        LiveNode(rclpy, StandIn({"detectors": str(file)}))
