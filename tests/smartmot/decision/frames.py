"""Frames for rules, made by hand: one object on or beside a straight path, everything known exactly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
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
_CAR: Mapping[str, Any] = {
    "offset_m": 0.0,
    "velocity_mps": (0.0, 0.0),
    "size_m": (4.0, 1.8),
    "category": "car",
    "counts": True,
}


def frame(speed_mps: float, gap_m: float, *, stamp_s: float = 0.0, **kwargs: Any) -> Assessment:
    """The ego at the origin, heading east; an object whose rear is `gap_m` ahead of the ego's front."""
    return scene(speed_mps, [{"gap_m": gap_m, **kwargs}], stamp_s=stamp_s)


def scene(speed_mps: float, objects: Sequence[Mapping[str, Any]], *, stamp_s: float = 0.0) -> Assessment:
    """The ego at the origin, heading east, and objects by `gap_m` and what departs from `_CAR`."""
    ego = EgoState(stamp_s, 0.0, 0.0, 0.0, speed_mps, length_m=EGO_LENGTH_M, width_m=EGO_WIDTH_M)
    columns = [{**_CAR, "track_id": k + 1, **given} for k, given in enumerate(objects)]
    size, velocity, category, counts, track_id, gap, offset = (
        np.array([column[name] for column in columns])
        for name in ("size_m", "velocity_mps", "category", "counts", "track_id", "gap_m", "offset_m")
    )
    count = len(columns)
    tracks = tracks_from_arrays(
        stamp_s,
        track_id,
        np.stack((EGO_LENGTH_M / 2 + gap + size[:, 0] / 2, offset), axis=1),
        size,
        np.zeros(count),
        category,
        velocity,
        dynamic=np.hypot(*velocity.T) > 0.0,
    )
    no = np.zeros(count, dtype=np.bool_)
    return Assessment(
        ego=ego,
        tracks=tracks,
        forecast=forecast_tracks(tracks, TIMES, ForecastConfig()),
        ego_forecast=forecast_ego(ego, TIMES),
        threats=NO_THREATS,
        time_to_collision_s=np.full(count, np.inf),
        ahead_m=gap + EGO_LENGTH_M / 2,
        on_way=no,
        entering=no,
        threatening=no,
        vulnerable=np.isin(category, ("pedestrian", "cyclist")),
        lead=None,
        braking_distance_m=0.0,
        counts=counts,
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
