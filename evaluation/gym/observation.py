"""What an agent observes: the ego, and the nearest objects as perception has them, in the ego's frame."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
from gymnasium import spaces
from numpy.typing import NDArray

from scenarios.sensors.world import World
from smartmot.area import MonitoredArea
from smartmot.pipeline import FrameResult
from smartmot.types import CATEGORIES, BoolArray, Boxes, EgoState, FloatArray, IntArray, StrArray

OBSERVED = ("tracks", "detections", "truth")
"""Where the objects come from."""

EGO_COLUMNS = ("speed_mps", "accel_mps2", "yaw_rate_radps", "time_s")
OBJECT_COLUMNS = (
    "ahead_m", "left_m", "ahead_mps", "left_mps", "length_m", "width_m", "cos_heading", "sin_heading",
    *(f"is_{name}" for name in CATEGORIES),
)  # fmt: skip
"""Of an object: place of its centre from the ego's, velocity over ground and heading, in the ego's axes."""
FLAGS = ("kept", "in_route", "on_way", "threat")
"""Whether the monitored area keeps it, its `smartmot.area.Relevance`, whether it is a threat."""

_LIMIT = 1e6
"""Of any number, so that spaces are bounded as learners want them."""


def observation_space(count: int) -> spaces.Dict:
    """The space of observations with so many objects."""
    return spaces.Dict(
        {
            "ego": spaces.Box(-_LIMIT, _LIMIT, (len(EGO_COLUMNS),), np.float32),
            "objects": spaces.Box(-_LIMIT, _LIMIT, (count, len(OBJECT_COLUMNS)), np.float32),
            "mask": spaces.Box(0, 1, (count,), np.int8),
            "flags": spaces.Box(0, 1, (count, len(FLAGS)), np.int8),
        }
    )


Observation = dict[str, NDArray[Any]]


def observed(
    source: str, result: FrameResult, area: MonitoredArea, ego: EgoState, world: World, count: int
) -> Observation:
    """The observation of a frame.

    Args:
        source: one of `OBSERVED`.
        result: what perception made of the frame.
        area: that it monitored.
        ego: the odometry.
        world: ground truth.
        count: of objects; the nearest to the ego's outline are taken, others left out.
    """
    boxes, velocity, category, ids = _SOURCES[source](result, world)
    relevance = area.relevance(boxes, category)
    flags = np.column_stack(
        (
            area.kept(boxes, category),
            relevance.in_route,
            relevance.on_way,
            np.isin(ids, result.threats.track_id) if source == "tracks" else np.zeros(len(boxes), np.bool_),
        )
    )
    cos, sin = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    turn = np.array([[cos, -sin], [sin, cos]])  # from the map's axes into the ego's, for rows
    place = (boxes.center_m - (ego.x_m, ego.y_m)) @ turn
    heading = boxes.yaw_rad - ego.yaw_rad
    values = np.column_stack(
        (
            place,
            np.nan_to_num(velocity) @ turn,
            boxes.size_m,
            np.cos(heading),
            np.sin(heading),
            category[:, None] == np.array(CATEGORIES),
        )
    )
    nearest = np.argsort(np.hypot(*place.T), kind="stable")[:count]
    made: Observation = {
        "ego": np.array([ego.speed_mps, ego.accel_mps2, ego.yaw_rate_radps, ego.stamp_s], np.float32),
        "objects": np.zeros((count, len(OBJECT_COLUMNS)), np.float32),
        "mask": np.zeros(count, np.int8),
        "flags": np.zeros((count, len(FLAGS)), np.int8),
    }
    made["objects"][: len(nearest)] = values[nearest]
    made["flags"][: len(nearest)] = flags[nearest]
    made["mask"][: len(nearest)] = 1
    return made


_Objects = tuple[Boxes, FloatArray, StrArray, IntArray]


def _tracks(result: FrameResult, world: World) -> _Objects:
    tracks = result.tracks
    return tracks.boxes, tracks.velocity_mps, tracks.category, tracks.track_id


def _detections(result: FrameResult, world: World) -> _Objects:
    detections = result.detections
    velocity = detections.velocity_mps
    none = np.zeros((len(detections.boxes), 2))
    ids: IntArray = np.arange(len(detections.boxes))
    return detections.boxes, none if velocity is None else velocity, detections.category, ids


def _truth(result: FrameResult, world: World) -> _Objects:
    there: BoolArray = world.exists
    boxes = world.boxes[there]
    along = np.column_stack((np.cos(boxes.yaw_rad), np.sin(boxes.yaw_rad)))
    return boxes, along * world.speed_mps[there, None], world.category[there], world.object_id[there]


_SOURCES: Mapping[str, Any] = {"tracks": _tracks, "detections": _detections, "truth": _truth}
