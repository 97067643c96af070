"""Short-term forecasts of tracks and the ego: with constant turn rate and velocity, or by category."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from smartmot.errors import ConfigError
from smartmot.filters.motion_models import ctrv_positions
from smartmot.forecast.motion import (
    accelerations,
    class_motion,
    class_positions,
    codes,
    forecast_covariance,
)
from smartmot.path import PlannedPath
from smartmot.types import BoolArray, EgoState, FloatArray, Forecast, Tracks, frozen, unchecked

EGO_FORECASTS = ("ctrv", "path")
TRACK_FORECASTS = ("ctrv", "class")
_OLD_NAMES = {"route": "path"}


@dataclass(frozen=True, slots=True)
class ForecastConfig:
    """How far and how densely to look ahead.

    Args:
        ego: ctrv (paper): the ego keeps its speed and turn rate; path (formerly route): it keeps its speed
            along its planned path, if that is known. Before and in a bend CTRV points across the road.
        min_horizon_s: shortest horizon (paper: 3 s); it grows to braking distance / speed.
        max_horizon_s: longest horizon, for speeds near zero.
        step_s: spacing of the forecast boxes. The paper draws 4 boxes; 12.5 m apart at 60 km/h they would
            step over a crossing pedestrian, so the boxes here are dense enough to overlap each other.
        max_yaw_rate_radps: turn rates are limited to this; a track that is only just born may show more.

        model: how tracks move on: ctrv (paper), or class, by category.

    Raises:
        ConfigError: A value is outside its range.
    """

    ego: str = "ctrv"
    min_horizon_s: float = 3.0
    max_horizon_s: float = 6.0
    step_s: float = 0.1
    max_yaw_rate_radps: float = 1.0
    model: str = "ctrv"

    def __post_init__(self) -> None:
        object.__setattr__(self, "ego", _OLD_NAMES.get(self.ego, self.ego))
        if self.ego not in EGO_FORECASTS:
            raise ConfigError(f"forecast: ego must be one of {', '.join(EGO_FORECASTS)}, got {self.ego!r}")
        if self.model not in TRACK_FORECASTS:
            choices = ", ".join(TRACK_FORECASTS)
            raise ConfigError(f"forecast: model must be one of {choices}, got {self.model!r}")
        if not 0 < self.step_s <= self.min_horizon_s <= self.max_horizon_s < math.inf:
            raise ConfigError("forecast: needs 0 < step_s <= min_horizon_s <= max_horizon_s, finite")
        if not self.max_yaw_rate_radps >= 0:
            raise ConfigError("forecast: max_yaw_rate_radps must not be negative")


def forecast_times(horizon_s: float, step_s: float) -> FloatArray:
    """(T,) times from 0 to at least the horizon in equal steps, read-only."""
    return _times(math.ceil(horizon_s / step_s - 1e-9), step_s)


@lru_cache(maxsize=64)
def _times(steps: int, step_s: float) -> FloatArray:
    """(steps + 1,) times; every frame has the same few."""
    time_s = np.arange(steps + 1, dtype=np.float64) * step_s
    time_s.setflags(write=False)
    return time_s


def forecast_tracks(
    tracks: Tracks, time_s: FloatArray, config: ForecastConfig, delay_s: float = 0.0
) -> Forecast:
    """Forecast of all tracks. With model ctrv static tracks stay where they are.

    Args:
        tracks: M tracks, map frame.
        time_s: (T,) times after now.
        config: limits.
        delay_s: age of the tracks' estimate now (sensor latency); they are moved on by it first.

    Returns:
        Poses of the M tracks at the T times, map frame; with covariance if the model is class.
    """
    time_s = frozen(time_s, np.float64, (len(time_s),), "time_s")  # its own, unless it is read-only
    if not len(tracks):
        return unchecked(Forecast, time_s, *_of_nothing(len(time_s), config.model == "class"))
    shape, moved = (len(tracks), len(time_s)), time_s + delay_s
    limit = config.max_yaw_rate_radps
    if config.model == "class":
        code = codes(tracks.category)
        rate = np.clip(tracks.yaw_rate_radps, -limit, limit)
        acceleration = accelerations(tracks.mean)
        motion = class_motion(
            tracks.velocity_mps, tracks.boxes.yaw_rad, rate, acceleration, tracks.covariance, code
        )
        center, course = class_positions(tracks.boxes.center_m, motion, code, moved)
        turned = course - np.arctan2(motion.velocity_mps[:, 1], motion.velocity_mps[:, 0])[:, None]
        yaw = tracks.boxes.yaw_rad[:, None] + turned
        covariance = forecast_covariance(tracks.covariance, code, moved)
        return unchecked(Forecast, time_s, center, yaw, tracks.boxes.size_m, _valid(*shape), covariance)
    moving = tracks.dynamic.nonzero()[0]
    start, velocity, rate = tracks.boxes.center_m, tracks.velocity_mps, tracks.yaw_rate_radps
    if len(moving) < len(tracks):
        start, velocity, rate = start[moving], velocity[moving], rate[moving]
        center, yaw = np.empty((*shape, 2)), np.empty(shape)
        center[:], yaw[:] = tracks.boxes.center_m[:, None], tracks.boxes.yaw_rad[:, None]
    if len(moving):
        rate = np.minimum(np.maximum(rate, -limit), limit)
        reached, _ = ctrv_positions(
            start[:, 0],
            start[:, 1],
            np.arctan2(velocity[:, 1], velocity[:, 0]),
            np.hypot(velocity[:, 0], velocity[:, 1]),
            rate,
            moved,
        )
        turned = rate[:, None] * moved
        if len(moving) < len(tracks):
            center[moving] = reached
            yaw[moving] += turned
        else:
            center, yaw = reached, np.add(tracks.boxes.yaw_rad[:, None], turned, out=turned)
    return unchecked(Forecast, time_s, center, yaw, tracks.boxes.size_m, _valid(*shape), None)


@lru_cache(maxsize=256)
def _valid(m: int, steps: int) -> BoolArray:
    """(M, steps) flags, read-only, of forecasts that count everywhere."""
    valid = np.ones((m, steps), dtype=np.bool_)
    valid.setflags(write=False)
    return valid


@lru_cache(maxsize=64)
def _of_nothing(steps: int, spread: bool) -> tuple[object, ...]:
    """What follows the times in the forecast of no tracks."""
    nothing = np.zeros((0, steps))
    return (
        np.zeros((0, steps, 2)),
        nothing,
        np.zeros((0, 2)),
        nothing > 0.0,
        np.zeros((0, steps, 2, 2)) if spread else None,
    )


def forecast_ego(ego: EgoState, time_s: FloatArray) -> Forecast:
    """CTRV forecast of the ego at its present speed and turn rate; one object, (1, T)."""
    if ego.yaw_rate_radps == 0.0:  # the same sums; cosine and sine are those of one heading
        along = ego.speed_mps * time_s
        center, yaw = np.empty((1, len(along), 2)), np.empty((1, len(along)))
        np.add(ego.x_m, along * math.cos(ego.yaw_rad), out=center[0, :, 0])
        np.add(ego.y_m, along * math.sin(ego.yaw_rad), out=center[0, :, 1])
        yaw.fill(ego.yaw_rad)
    else:
        x, y, course, speed, rate = np.array(
            [[ego.x_m], [ego.y_m], [ego.yaw_rad], [ego.speed_mps], [ego.yaw_rate_radps]]
        )
        center, yaw = ctrv_positions(x, y, course, speed, rate, time_s)
    size = np.array([[ego.length_m, ego.width_m]])
    return unchecked(Forecast, time_s, center, yaw, size, _valid(*yaw.shape), None)


def forecast_ego_along(
    ego: EgoState, path: PlannedPath, time_s: FloatArray, *, keeps_offset: bool = True
) -> Forecast:
    """Forecast of the ego at its present speed along its planned path; one object, (1, T).

    Args:
        ego: odometry now.
        path: in the frame of the odometry.
        time_s: (T,) times after now.
        keeps_offset: whether it goes on beside the path as far as now, or on the path itself.
    """
    station, offset = path.project(ego.x_m, ego.y_m)
    center, yaw = path.poses(station + ego.speed_mps * time_s, offset if keeps_offset else 0.0)
    size = np.array([[ego.length_m, ego.width_m]])
    return unchecked(Forecast, time_s, center[None], yaw[None], size, _valid(1, len(time_s)), None)
