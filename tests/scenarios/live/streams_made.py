"""Streams made by hand: a vehicle on a line or a circle, and boxes around it."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace

import numpy as np

from scenarios.live.outputs import FrameOutput
from scenarios.live.perception import LivePerception, Output
from scenarios.live.settings import LiveSettings
from scenarios.ros.messages import DetectionMessage, Message, OdometryMessage, TransformMessage
from smartmot.maps.lane_map import LaneMap

START_NS = 1_700_000_000_000_000_000
LIDAR, BASE, MAP = "lidar", "base_link", "map"

Row = tuple[str, float, float, float, float, float, float]
"""Class, x, y, yaw, length, width and score, frame of the sensor."""


def ns(time_s: float) -> int:
    return START_NS + round(time_s * 1e9)


def about_z(yaw_rad: float) -> tuple[float, float, float, float]:
    return math.cos(0.5 * yaw_rad), 0.0, 0.0, math.sin(0.5 * yaw_rad)


def boxes(
    time_s: float,
    rows: Sequence[Row],
    velocity_mps: Iterable[Sequence[float]] | None = None,
    frame_id: str = LIDAR,
    after_s: float = 0.0,
) -> DetectionMessage:
    """Boxes that stand on the ground, 1.6 m high, received some time after their stamp."""
    table = np.array([row[1:] for row in rows], dtype=np.float64).reshape(-1, 6)
    count = len(table)
    velocity = np.full((count, 3), np.nan) if velocity_mps is None else np.array(list(velocity_mps))
    return DetectionMessage(
        ns(time_s),
        frame_id,
        ns(time_s + after_s),
        np.full(count, -1),
        np.array([row[0] for row in rows], dtype=np.str_),
        np.column_stack((table[:, :2], np.full(count, 0.8))),
        np.column_stack((table[:, 3:5], np.full(count, 1.6))),
        np.array([about_z(yaw) for yaw in table[:, 2]]).reshape(-1, 4),
        velocity,
        table[:, 5],
    )


def odometry(
    time_s: float,
    pose: tuple[float, float, float],
    speed_mps: float = 0.0,
    yaw_rate_radps: float = 0.0,
    after_s: float = 0.0,
) -> OdometryMessage:
    x_m, y_m, yaw_rad = pose
    return OdometryMessage(
        ns(time_s),
        MAP,
        BASE,
        ns(time_s + after_s),
        np.array([x_m, y_m, 0.0]),
        np.array(about_z(yaw_rad)),
        np.array([speed_mps, 0.0, 0.0]),
        np.array([0.0, 0.0, yaw_rate_radps]),
    )


def transform(
    time_s: float, parent: str, child: str, x_m: float, y_m: float, yaw_rad: float
) -> TransformMessage:
    return TransformMessage(
        ns(time_s),
        np.array([ns(time_s)]),
        (parent,),
        (child,),
        np.array([[x_m, y_m, 0.0]]),
        np.array([about_z(yaw_rad)]),
    )


def received(messages: Iterable[Message]) -> list[Message]:
    """Messages in the order in which they are received; at equal times poses first."""
    return sorted(messages, key=lambda m: (m.received_ns, isinstance(m, DetectionMessage)))


def later(message: Message, delay_ns: int) -> Message:
    return replace(message, received_ns=message.received_ns + delay_ns)


def outputs_of(
    messages: Iterable[Message],
    settings: LiveSettings | None = None,
    lane_map: LaneMap | None = None,
) -> tuple[list[Output], LivePerception]:
    perception = LivePerception(settings or LiveSettings(preset="physical"), lane_map)
    outputs: list[Output] = []
    for message in messages:
        outputs += perception.take(message)
    return outputs + perception.finish(), perception


def frames_of(
    messages: Iterable[Message],
    settings: LiveSettings | None = None,
    lane_map: LaneMap | None = None,
) -> tuple[list[FrameOutput], LivePerception]:
    outputs, perception = outputs_of(messages, settings, lane_map)
    return [output for output in outputs if isinstance(output, FrameOutput)], perception


def straight(
    count: int,
    objects: Callable[[float], list[Row]],
    speed_mps: float = 10.0,
    interval_s: float = 0.05,
    after_s: float = 0.0,
) -> list[Message]:
    """A drive along x from 0 with poses at the stamps of the frames; `objects` gives rows, map frame."""
    messages: list[Message] = []
    for k in range(count):
        time_s = k * interval_s
        x_m = speed_mps * time_s
        rows = [(name, x - x_m, *more) for name, x, *more in objects(time_s)]
        messages.append(odometry(time_s, (x_m, 0.0, 0.0), speed_mps, after_s=after_s))
        messages.append(boxes(time_s, rows, after_s=after_s))  # type: ignore[arg-type]
    return received(messages)
