"""Short-term forecasts of tracks and the ego: with constant turn rate and velocity, or by category.

By category: pedestrians go straight on; the turn rate of vehicles and two-wheelers fades over 1 s, and their
acceleration, where the filter estimates one, over 0.5 s (docs/tracking.md has what that is worth).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.errors import ConfigError
from smartmot.filters.motion_models import PerCategory, ctrv_positions, fading_positions, table
from smartmot.path import PlannedPath
from smartmot.types import CATEGORIES, EgoState, FloatArray, Forecast, IntArray, Tracks, unchecked

EGO_FORECASTS = ("ctrv", "path")
TRACK_FORECASTS = ("ctrv", "class")
_OLD_NAMES = {"route": "path"}

_TURN_MEMORY_S = table(PerCategory.grouped(1.0, 0.0, 1.0))
"""Time over which turn rates fade; bends of a town last as long. Pedestrians go straight on."""

ACCELERATION_MEMORY_S = 0.5
"""Time over which accelerations fade, that of `DecayingAcceleration`."""

SPREAD_M2PS3 = table(PerCategory.grouped(1.5, 0.1, 0.5))
"""Density of the acceleration that no model knows of, by which the region of a forecast grows."""

CHI2_95 = -2.0 * math.log(0.05)
"""Square of the Mahalanobis distance within which 95 % of a normal distribution in the plane lie."""

_CODES = {name: code for code, name in enumerate(CATEGORIES)}


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
    """(T,) times from 0 to at least the horizon in equal steps."""
    steps = int(np.ceil(horizon_s / step_s - 1e-9))
    return np.arange(steps + 1, dtype=np.float64) * step_s


def forecast_tracks(
    tracks: Tracks, time_s: FloatArray, config: ForecastConfig, delay_s: float = 0.0
) -> Forecast:
    """Forecast of all tracks; static tracks stay where they are.

    Args:
        tracks: M tracks, map frame.
        time_s: (T,) times after now.
        config: limits.
        delay_s: age of the tracks' estimate now (sensor latency); they are moved on by it first.

    Returns:
        Poses of the M tracks at the T times, map frame.
    """
    time_s = np.array(time_s, dtype=np.float64)  # the forecast's own: its arrays are read-only
    shape = (len(tracks), len(time_s))
    center, yaw = np.empty((*shape, 2)), np.empty(shape)
    center[:], yaw[:] = tracks.boxes.center_m[:, None], tracks.boxes.yaw_rad[:, None]
    moving = tracks.dynamic.nonzero()[0]
    if len(moving):
        velocity, start = tracks.velocity_mps[moving], tracks.boxes.center_m[moving]
        limit = config.max_yaw_rate_radps
        rate = np.minimum(np.maximum(tracks.yaw_rate_radps[moving], -limit), limit)
        moved = time_s + delay_s
        if config.model == "class":
            code = np.array([_CODES[name] for name in tracks.category[moving].tolist()])
            course = np.arctan2(velocity[:, 1], velocity[:, 0])
            rate = sure_turn_rates(rate, tracks.covariance[moving])
            center[moving], courses = class_positions(
                start, velocity, rate, accelerations(tracks.mean[moving]), code, moved
            )
            yaw[moving] += courses - course[:, None]
            return _forecast(time_s, center, yaw, tracks)
        center[moving], _ = ctrv_positions(
            start[:, 0],
            start[:, 1],
            np.arctan2(velocity[:, 1], velocity[:, 0]),
            np.hypot(velocity[:, 0], velocity[:, 1]),
            rate,
            moved,
        )
        yaw[moving] += rate[:, None] * moved
    return _forecast(time_s, center, yaw, tracks)


def _forecast(time_s: FloatArray, center_m: FloatArray, yaw_rad: FloatArray, tracks: Tracks) -> Forecast:
    valid = np.ones(yaw_rad.shape, dtype=np.bool_)
    return unchecked(Forecast, time_s, center_m, yaw_rad, tracks.boxes.size_m, valid)


def accelerations(mean: FloatArray) -> FloatArray:
    """(M, 2) accelerations in (M, D) filter means, zero where the filter estimates none."""
    return mean[:, 9:11] if mean.shape[1] == _ACCELERATED else np.zeros((len(mean), 2))


_ACCELERATED = 11
"""Entries of the mean of linear filters that estimate accelerations, the last two
(`smartmot.filters.channels`); without them there are nine, x and y first, their rates sixth and seventh."""


def sure_turn_rates(yaw_rate_radps: FloatArray, covariance: FloatArray) -> FloatArray:
    """(M,) turn rates, shrunk by what of them may be noise (the positive part of James and Stein's estimate).

    A turn rate that is no more than its standard deviation is none: a detector at 2 Hz would bend every
    forecast.

    Args:
        yaw_rate_radps: (M,) estimates.
        covariance: (M, D, D) of the filter's states, see `forecast_covariance`.
    """
    entries = covariance.shape[1]
    entry = {5: 4, 9: 8, _ACCELERATED: 8}.get(entries)
    if entry is None:
        return yaw_rate_radps
    squared = np.maximum(yaw_rate_radps**2, 1e-12)
    return yaw_rate_radps * np.maximum(1.0 - covariance[:, entry, entry] / squared, 0.0)


def class_positions(
    center_m: FloatArray,
    velocity_mps: FloatArray,
    yaw_rate_radps: FloatArray,
    acceleration_mps2: FloatArray,
    code: IntArray,
    time_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Where M objects are after some times, each as its category moves.

    Args:
        center_m: (M, 2) centres, map frame.
        velocity_mps: (M, 2) velocities over ground.
        yaw_rate_radps: (M,) turn rates.
        acceleration_mps2: (M, 2) accelerations; zero where unknown.
        code: (M,) positions in CATEGORIES.
        time_s: (T,) times after now, or (M, T).

    Returns:
        (M, T, 2) centres and (M, T) courses, not wrapped.
    """
    speed = np.hypot(velocity_mps[:, 0], velocity_mps[:, 1])
    memory = _TURN_MEMORY_S.take(code)
    along = (acceleration_mps2 * velocity_mps).sum(axis=1) / np.maximum(speed, 0.5)
    return fading_positions(
        center_m[:, 0],
        center_m[:, 1],
        np.arctan2(velocity_mps[:, 1], velocity_mps[:, 0]),
        speed,
        yaw_rate_radps,
        np.where(memory > 0.0, along, 0.0),
        memory,
        ACCELERATION_MEMORY_S,
        time_s,
    )


def forecast_covariance(covariance: FloatArray, code: IntArray, time_s: FloatArray) -> FloatArray:
    """Covariance of forecast places: that of the estimate, carried on, and of what nobody can know.

    Args:
        covariance: (M, D, D) of the tracks (`Tracks.covariance`); D 0 for trackers that tell none.
        code: (M,) positions in CATEGORIES.
        time_s: (T,) times after now, or (M, T).

    Returns:
        (M, T, 2, 2) covariances along x and y, map frame, m2.
    """
    m, entries = covariance.shape[:2]
    time = np.broadcast_to(time_s, (m, np.shape(time_s)[-1]))
    variance = np.zeros((*time.shape, 2, 2))
    unknown = SPREAD_M2PS3.take(code)[:, None] * time**3 / 3.0
    ones = np.ones_like(time)
    for axis in (0, 1):
        if entries >= 9:  # linear: value, rate and, where there is one, acceleration of each axis
            which, steps = [axis, 5 + axis], [ones, time]
            if entries == _ACCELERATED:
                fade = ACCELERATION_MEMORY_S
                which, steps = [*which, 9 + axis], [*steps, fade * (time + fade * np.expm1(-time / fade))]
            row = np.stack(steps, axis=-1)
            part = covariance[np.ix_(range(m), which, which)] if m else np.zeros((0, len(which), len(which)))
            variance[..., axis, axis] = np.einsum("mti,mij,mtj->mt", row, part, row)
        elif entries == 5:  # CTRV: the variance of the speed, in every direction
            variance[..., axis, axis] = covariance[:, None, axis, axis] + time**2 * covariance[:, None, 3, 3]
        variance[..., axis, axis] += unknown
    return variance


def forecast_ego(ego: EgoState, time_s: FloatArray) -> Forecast:
    """CTRV forecast of the ego at its present speed and turn rate; one object, (1, T)."""
    x, y, course, speed, rate = np.array(
        [[ego.x_m], [ego.y_m], [ego.yaw_rad], [ego.speed_mps], [ego.yaw_rate_radps]]
    )
    center, yaw = ctrv_positions(x, y, course, speed, rate, time_s)
    size = np.array([[ego.length_m, ego.width_m]])
    return unchecked(Forecast, time_s, center, yaw, size, np.ones(yaw.shape, dtype=np.bool_))


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
    return unchecked(
        Forecast, time_s, center[None], yaw[None], size, np.ones((1, len(time_s)), dtype=np.bool_)
    )
