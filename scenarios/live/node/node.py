"""Perception as a node of ROS 2; rclpy comes from the user's sourced workspace, and nothing else imports it.

Messages are taken and given as bytes, and read and written by what reads and writes bags: so the node answers
as `smartmot-eval bag` does on the same messages.
"""

from __future__ import annotations

import gc
import os
import sys
import time
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import replace
from functools import partial
from importlib import import_module
from typing import Any

from opendrive import OpenDriveError
from scenarios.errors import DatasetError, ScenarioError
from scenarios.live.counts import Diagnostics
from scenarios.live.node.answer_times import FRAMES, AnswerTimes
from scenarios.live.node.command import COMMAND, Interruption, NodeError
from scenarios.live.node.parameters import PARAMETERS, live_settings
from scenarios.live.node.warm_up import warm_up
from scenarios.live.outputs import FrameOutput
from scenarios.live.perception import LivePerception, Output
from scenarios.live.published import published
from scenarios.live.topics import PUBLISHED, STATIC_TRANSFORMS, PublishedTopic, read_topics
from scenarios.reading import ReadError
from scenarios.recorded.maps.drive_map import load_drive_map
from scenarios.ros.bags.decoding import decoded
from scenarios.ros.bags.topics import RawMessage, Topic
from scenarios.ros.definitions import PREDICTION_ARRAY
from scenarios.ros.messages import DETECTION_TYPES, DetectionMessage, TransformMessage
from smartmot.errors import SmartMotError

NODE = "smartmot"
REPEAT_S = 10.0
"""A warning is repeated so often at most."""
ANSWERED = f"receiving to publishing in the last {FRAMES} frames"
"""Beginning of the names of these times in a status."""
LONGEST_STEP = "longest step since the last status, ms"
TICK_S = 0.01
"""Frames that wait for a pose are looked at so often: a fifth of the time that they wait."""

_OF_RCLPY = ("use_sim_time", "start_type_description_service", "qos_overrides.")
"""Parameters that any node may be given, or beginnings of their names."""
_MISTAKES = (ScenarioError, DatasetError, SmartMotError, OpenDriveError)


def run(rclpy: Any, for_ros: Sequence[str], interruption: Interruption) -> None:
    """Run the node until its context is shut down.

    Args:
        rclpy: the package.
        for_ros: arguments for ROS.
        interruption: told when an executor spins.

    Raises:
        NodeError: an argument or parameter is wrong, a package of messages is missing, or a plug-in fails.
    """
    from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor

    node = _node(rclpy, for_ros)
    try:
        live = LiveNode(rclpy, node)
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        interruption.spinning = True
        with suppress(ExternalShutdownException):
            executor.spin()
    except _MISTAKES as error:
        raise NodeError(str(error)) from None
    except NodeError:
        raise
    except Exception:
        if rclpy.ok():
            raise
        # publishing failed in the context that a signal had shut down
    finally:
        rclpy.try_shutdown()
    sys.stderr.write(f"{COMMAND}: {live.summary()}\n")


def _node(rclpy: Any, for_ros: Sequence[str]) -> Any:
    """A node with all parameters that were given, known or not."""
    try:
        rclpy.init(args=[NODE, *for_ros])
        return rclpy.create_node(NODE, automatically_declare_parameters_from_overrides=True)
    except Exception as error:  # rclpy's have no common base; each is about the arguments
        raise NodeError(f"ROS 2 refuses the arguments: {error}") from None


def given_parameters(node: Any) -> dict[str, object]:
    """Values of the parameters that the node was given, without those of every node."""
    values = {name: parameter.value for name, parameter in node.get_parameters_by_prefix("").items()}
    return {name: value for name, value in values.items() if not name.startswith(_OF_RCLPY)}


class LiveNode:
    """The node's topics around `LivePerception`.

    Args:
        rclpy: the package.
        node: a node of rclpy with the parameters that the user gave.

    Raises:
        NodeError: a package of messages is missing.
        ScenarioError, DatasetError, smartmot.errors.SmartMotError, opendrive.OpenDriveError: a parameter is
            wrong.

    Attributes:
        node: of rclpy.
    """

    def __init__(self, rclpy: Any, node: Any) -> None:
        self.node, self._clock, self._log = node, node.get_clock(), node.get_logger()
        settings, map_file = live_settings(given_parameters(node))
        lane_map = None if map_file is None else load_drive_map(map_file)
        self._perception = LivePerception(settings, lane_map)
        self._detections = ""
        self._refused, self._lost, self._second = 0, 0, 0
        self._numbers: dict[str, int] = {}  # of the last frame of a topic, as its publisher counts
        self._slowest_s = 0.0
        self._times = AnswerTimes()
        warm_up(settings, lane_map)
        node.add_on_set_parameters_callback(_refuse_changes)
        self._publishers = {topic: self._publisher(topic) for topic in PUBLISHED}
        self._subscribe()
        steady = rclpy.clock.Clock(clock_type=rclpy.clock.ClockType.STEADY_TIME)
        node.create_timer(TICK_S, self._tick, clock=steady)  # goes on where /clock stands still
        gc.collect()
        gc.freeze()  # what is loaded by now is not looked through again while frames come
        self._log.info(
            f"strategy {self._perception.strategy}, preset {settings.preset}, rule {settings.rule}: ready"
        )

    def summary(self) -> str:
        """What came and what was left out, in one line."""
        counts = self._perception.counts
        rows = (
            ("frames", counts.frames),
            ("tracked", counts.tracked),
            ("late", counts.late),
            ("repeated", counts.repeated),
            ("far ahead of all others", counts.early),
            ("without pose", counts.without_pose),
            ("off the map", counts.off_map),
            ("boxes rejected", counts.rejected),
            ("messages refused", self._refused),
            ("frames lost", self._lost),
            ("frames of a second source", self._second),
        )
        line = ", ".join(
            f"{number} {name}" for name, number in rows if number or name in ("frames", "tracked")
        )
        detectors = self._perception.counts_of if self._perception.settings.detectors else {}
        for name, own in detectors.items():
            left_out = own.late + own.repeated + own.early
            line += f"; {name}: {own.frames} frames, {own.behind} behind a newer one, {left_out} left out"
        return line

    def _publisher(self, topic: PublishedTopic) -> Any:
        kind = _message_type(topic.type_name)
        return self.node.create_publisher(kind, topic.name, _quality(topic.depth))

    def _subscribe(self) -> None:
        """Read all topics whose types the workspace has; boxes of one type are enough, of one detector."""
        for topic, detector in read_topics(self._perception.settings.detectors):
            try:
                kind = _message_type(topic.type_name)
            except NodeError as error:
                if topic.type_name != PREDICTION_ARRAY or detector:
                    raise
                self._log.warning(f"{topic.name} is not read: {error}")
                continue
            stored = Topic(topic.name, topic.type_name, "cdr")
            quality = _quality(topic.depth, topic.reliable, topic.latched)
            take = partial(self._take, stored, detector)
            self.node.create_subscription(kind, topic.name, take, quality, raw=True)

    def _take(self, topic: Topic, detector: str, data: bytes, information: Any) -> None:
        """Take a message, and publish what it makes known."""
        begin = time.perf_counter()
        if topic.type_name in DETECTION_TYPES:
            if not detector and not self._is_first_source(topic):
                return
            self._count_lost(topic.name, information["publication_sequence_number"] or 0)
        now_ns = self._clock.now().nanoseconds
        try:
            message = decoded(RawMessage(topic, now_ns, data))
            if not now_ns and not isinstance(message, TransformMessage) and message.stamp_ns is None:
                raise ReadError(f"topic {topic.name}: no stamp, and /clock has not said a time yet")
        except ReadError as error:
            self._refused += 1
            self._log.warning(f"a message is refused: {error}", throttle_duration_sec=REPEAT_S)
            return
        if isinstance(message, DetectionMessage):
            self._times.receive(message, information["received_timestamp"] or 0)
        static = topic.name == STATIC_TRANSFORMS
        self._publish(self._perception.take(message, static, detector))
        self._slowest_s = max(self._slowest_s, time.perf_counter() - begin)

    def _is_first_source(self, topic: Topic) -> bool:
        """Whether a topic was the first to bring boxes; those of another are counted."""
        self._detections = self._detections or topic.name
        if topic.name == self._detections:
            return True
        self._second += 1
        self._log.warning(
            f"{topic.name} is left out: boxes come from {self._detections}", throttle_duration_sec=REPEAT_S
        )
        return False

    def _count_lost(self, topic: str, number: int) -> None:
        """Count the frames between the last one and this, which came faster than they could be taken.

        Numbers are of a publisher, which is not known: with several of them nothing can be said.
        """
        before = self._numbers.get(topic, 0)
        gap = number - before - 1
        if before and gap > 0 and self.node.count_publishers(topic) == 1:
            self._lost += gap
            self._log.warning(f"{topic}: {gap} frames lost", throttle_duration_sec=REPEAT_S)
        self._numbers[topic] = number

    def _tick(self) -> None:
        self._publish(self._perception.advance(self._clock.now().nanoseconds))

    def _publish(self, outputs: Iterable[Output]) -> None:
        for output in outputs:
            if isinstance(output, Diagnostics):
                output = self._with_own(output)
            for topic, data in published(output):
                self._publishers[topic].publish(data)
            if isinstance(output, FrameOutput):
                self._times.answer(output)

    def _with_own(self, status: Diagnostics) -> Diagnostics:
        """The status with what only the node knows."""
        values: tuple[tuple[str, str], ...] = (
            ("messages refused", str(self._refused)),
            ("frames lost", str(self._lost)),
            ("frames of a second source", str(self._second)),
            (LONGEST_STEP, f"{1e3 * self._slowest_s:.1f}"),
        )
        self._slowest_s = 0.0
        answered_ms = self._times.percentiles_ms()
        if answered_ms is not None:
            values += tuple(
                (f"{ANSWERED}, {name}, ms", f"{number:.1f}")
                for name, number in zip(("median", "99th percentile"), answered_ms, strict=True)
            )
        return replace(status, values=status.values + values)


def _message_type(name: str) -> Any:
    """The class of a type of messages.

    Raises:
        NodeError: its package is not in the sourced workspace.
    """
    package, _, short = name.split("/")
    try:
        return getattr(import_module(f"{package}.msg"), short)
    except (ImportError, AttributeError) as error:
        if name == PREDICTION_ARRAY:
            how = (
                "build ros/bevfusion_msgs of smartmot's repository with colcon, and source install/setup.bash"
            )
        else:
            how = f"install ros-{os.environ.get('ROS_DISTRO', 'DISTRO')}-{package.replace('_', '-')}"
        raise NodeError(f"{name} is not in the sourced workspace ({error}); {how}") from None


def _quality(depth: int, reliable: bool = True, latched: bool = False) -> Any:
    from rclpy.qos import DurabilityPolicy, HistoryPolicy, QoSProfile, ReliabilityPolicy

    return QoSProfile(
        history=HistoryPolicy.KEEP_LAST,
        depth=depth,
        reliability=ReliabilityPolicy.RELIABLE if reliable else ReliabilityPolicy.BEST_EFFORT,
        durability=DurabilityPolicy.TRANSIENT_LOCAL if latched else DurabilityPolicy.VOLATILE,
    )


def _refuse_changes(parameters: Sequence[Any]) -> Any:
    """Parameters hold from the start to the end; those of rclpy itself may change."""
    from rcl_interfaces.msg import SetParametersResult

    ours = sorted({parameter.name for parameter in parameters} & set(PARAMETERS))
    reason = f"{', '.join(ours)}: read at the start; start smartmot-ros anew" if ours else ""
    return SetParametersResult(successful=not ours, reason=reason)
