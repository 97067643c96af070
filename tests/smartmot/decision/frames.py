"""Frames for rules, made by hand: one object on or beside a straight path, everything known exactly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np

from smartmot import Assessment, EgoState, ForecastConfig
from smartmot.decision.aeb import Event
from smartmot.decision.collision import NO_THREATS
from smartmot.decision.rules import Command
from smartmot.forecast import forecast_ego, forecast_times, forecast_tracks
from smartmot.tracking.own import tracks_from_arrays

KMH = 1 / 3.6
EGO_LENGTH_M, EGO_WIDTH_M = 4.4, 1.8
TIMES = forecast_times(3.0, 0.1)


def frame(
    speed_mps: float,
    gap_m: float,
    *,
    stamp_s: float = 0.0,
    offset_m: float = 0.0,
    velocity_mps: tuple[float, float] = (0.0, 0.0),
    size_m: tuple[float, float] = (4.0, 1.8),
    category: str = "car",
    counts: bool = True,
    track_id: int = 1,
) -> Assessment:
    """The ego at the origin, heading east; an object whose rear is `gap_m` ahead of the ego's front."""
    ego = EgoState(stamp_s, 0.0, 0.0, 0.0, speed_mps, length_m=EGO_LENGTH_M, width_m=EGO_WIDTH_M)
    center = np.array([[EGO_LENGTH_M / 2 + gap_m + size_m[0] / 2, offset_m]])
    tracks = tracks_from_arrays(
        stamp_s,
        np.array([track_id]),
        center,
        np.array([size_m]),
        np.zeros(1),
        np.array([category]),
        np.array([velocity_mps]),
        dynamic=np.array([math.hypot(*velocity_mps) > 0.0]),
    )
    no = np.zeros(1, dtype=np.bool_)
    return Assessment(
        ego=ego,
        tracks=tracks,
        forecast=forecast_tracks(tracks, TIMES, ForecastConfig()),
        ego_forecast=forecast_ego(ego, TIMES),
        threats=NO_THREATS,
        time_to_collision_s=np.full(1, np.inf),
        ahead_m=np.array([gap_m + EGO_LENGTH_M / 2]),
        on_way=no,
        entering=no,
        threatening=no,
        vulnerable=np.array([category in ("pedestrian", "cyclist")]),
        lead=None,
        braking_distance_m=0.0,
        counts=np.array([counts]),
    )


def free(speed_mps: float, stamp_s: float = 0.0) -> Assessment:
    """Nothing counts."""
    return frame(speed_mps, 50.0, stamp_s=stamp_s, counts=False)


def decided(rule: Any, frames: Sequence[Assessment]) -> list[tuple[Command, tuple[Event, ...]]]:
    """Commands and events of a rule in frames one after the other."""
    state, out = None, []
    for now in frames:
        state, command, events = rule.decide(state, now)
        out.append((command, events))
    return out


def approach(
    speed_mps: float, from_m: float, *, target_mps: float = 0.0, step_s: float = 0.001, **kwargs: Any
) -> list[Assessment]:
    """Frames at constant speeds until the gap is closed."""
    closing = speed_mps - target_mps
    count = int(from_m / (closing * step_s))
    velocity = (target_mps, 0.0)
    return [
        frame(speed_mps, from_m - closing * step_s * k, stamp_s=step_s * k, velocity_mps=velocity, **kwargs)
        for k in range(count)
    ]
