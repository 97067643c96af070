"""What the first frames of a live node would wait for, done before they come: imports and first calls."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from scenarios.live.perception import LivePerception
from scenarios.live.published import published
from scenarios.live.settings import LiveSettings
from scenarios.live.topics import read_topics
from scenarios.ros.bags.decoding import decoded
from scenarios.ros.bags.topics import RawMessage, Topic
from scenarios.ros.definitions import ros2_types
from scenarios.ros.making import rosbags_make
from scenarios.ros.messages import DetectionMessage, OdometryMessage
from smartmot.maps.lane_map import LaneMap
from smartmot.plugins import is_plugin

_FRAMES, _INTERVAL_NS = 12, 50_000_000
"""More frames than the frame rate is measured over, so that all is done that a frame may ask for."""
_SPEED_MPS = 10.0


def warm_up(settings: LiveSettings, lane_map: LaneMap | None) -> None:
    """See and publish a few frames made up for it; plug-ins of the user's own are left out.

    Args:
        settings: those of the node.
        lane_map: its map.
    """
    types = ros2_types()
    make = rosbags_make(types)
    for topic, _ in read_topics(settings.detectors):
        data = bytes(types.serialize_cdr(make(topic.type_name), topic.type_name))
        decoded(RawMessage(Topic(topic.name, topic.type_name, "cdr"), 1, data))
    if settings.strategy is not None and is_plugin(settings.strategy):
        settings = replace(settings, strategy=None)
    if is_plugin(settings.rule):
        settings = replace(settings, rule="paper")
    perception = LivePerception(settings, lane_map)
    names = [each.name for each in settings.detectors] or [""]
    for k, message in enumerate(_messages(_start(lane_map))):
        for output in perception.take(message, detector=names[k // 2 % len(names)]):
            published(output)


def _start(lane_map: LaneMap | None) -> tuple[float, float, float]:
    """x, y and heading in the middle of the map's longest driving lane."""
    if lane_map is None:
        return 0.0, 0.0, 0.0
    lanes = lane_map.lanes
    length = np.where(np.asarray(lanes.lane_type) == "driving", lanes.s_end_m - lanes.s_start_m, 0.0)
    if not len(length):
        return 0.0, 0.0, 0.0
    lane = int(np.argmax(length))
    x, y, _, heading = lane_map.center_line(lane, [0.5 * (lanes.s_start_m[lane] + lanes.s_end_m[lane])])
    return float(x[0]), float(y[0]), float(heading[0])


def _messages(start: tuple[float, float, float]) -> Iterator[OdometryMessage | DetectionMessage]:
    """A vehicle that drives towards a car and a pedestrian who stand, and past one that moves."""
    x, y, heading = start
    along = np.array((np.cos(heading), np.sin(heading), 0.0))
    for k in range(1, _FRAMES + 1):
        stamp_ns = k * _INTERVAL_NS
        driven_m = _SPEED_MPS * stamp_ns * 1e-9
        yield OdometryMessage(
            stamp_ns,
            "map",
            "base_link",
            stamp_ns,
            np.array((x, y, 0.0)) + driven_m * along,
            np.array((np.cos(0.5 * heading), 0.0, 0.0, np.sin(0.5 * heading))),
            np.array((_SPEED_MPS, 0.0, 0.0)),
            np.zeros(3),
        )
        yield DetectionMessage(
            stamp_ns,
            "base_link",
            stamp_ns,
            np.zeros(3, dtype=np.int64),
            np.array(["car", "pedestrian", "car"]),
            np.array(((15.0 - driven_m, 0.0, 0.8), (12.0 - driven_m, 1.0, 0.9), (20.0, 3.5, 0.8))),
            np.array(((4.5, 1.8, 1.6), (0.6, 0.6, 1.8), (4.5, 1.8, 1.6))),
            np.tile((1.0, 0.0, 0.0, 0.0), (3, 1)),
            np.zeros((3, 3)),
            np.full(3, 0.9),
        )
