"""How objects of each category move on from what a filter says of them.

Pedestrians go straight on. Vehicles and two-wheelers move along their heading; their turn rate fades over
1 s, and their acceleration, where the filter estimates one, over 0.5 s (docs/tracking.md has what that is
worth).
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from smartmot.filters.motion_models import PerCategory, fading_positions, table
from smartmot.types import CATEGORIES, BoolArray, FloatArray, IntArray, StrArray

_TURN_MEMORY_S = table(PerCategory.grouped(1.0, 0.0, 1.0))
"""Time over which turn rates fade; bends of a town last as long. Pedestrians go straight on."""

ACCELERATION_MEMORY_S = 0.5
"""Time over which accelerations fade, that of `DecayingAcceleration`."""

SPREAD_M2PS3 = table(PerCategory.grouped(2.0, 0.05, 0.2))
"""Density of the acceleration that no model knows of, by which the region of a forecast grows: with it 93 to
98 % of moving cars are inside the 95 % region on two detectors (docs/tracking.md)."""

CHI2_95 = -2.0 * math.log(0.05)
"""Square of the Mahalanobis distance within which 95 % of a normal distribution in the plane lie."""

_SIDE_SLIP_MPS = 0.3
"""Standard deviation of the speed across the heading of what has wheels: 2 degrees of slip at 30 km/h."""

_CORNERING_MPS2 = 4.0
"""Greatest lateral acceleration in a bend, what drivers take at most on dry roads."""

_LINEAR, _ACCELERATED, _TURNING = 9, 11, 5
"""Entries of a filter's mean: x, y, area, ratio, yaw and rates of all but the ratio; with accelerations along
x and y besides; x, y, yaw, speed and turn rate."""

_CODES = {name: code for code, name in enumerate(CATEGORIES)}


def codes(category: StrArray) -> IntArray:
    """(M,) positions in `smartmot.types.CATEGORIES` of names."""
    return np.array([_CODES[name] for name in category.tolist()], dtype=np.int64)


class Motion(NamedTuple):
    """How M objects move now.

    Attributes:
        velocity_mps: (M, 2) velocities over ground.
        yaw_rate_radps: (M,) turn rates.
        acceleration_mps2: (M,) accelerations along the course.
    """

    velocity_mps: FloatArray
    yaw_rate_radps: FloatArray
    acceleration_mps2: FloatArray


def accelerations(mean: FloatArray) -> FloatArray:
    """(M, 2) accelerations in (M, D) filter means, zero where the filter estimates none."""
    return mean[:, 9:11] if mean.shape[1] == _ACCELERATED else np.zeros((len(mean), 2))


def class_motion(
    velocity_mps: FloatArray,
    yaw_rad: FloatArray,
    yaw_rate_radps: FloatArray,
    acceleration_mps2: FloatArray,
    covariance: FloatArray,
    code: IntArray,
) -> Motion:
    """What a filter says of M objects, with what their category adds: what has wheels does not go sideways.

    A linear filter estimates velocity, heading and their rates apart from each other. Here the heading
    corrects the velocity across it, and the lateral acceleration corrects the turn rate, each by their
    variances. Of velocity and turn rate only what is more than their own noise counts (the positive part of
    James and Stein's estimate): else parked cars would drift, and a detector at 2 Hz would bend every
    forecast. Pedestrians keep their velocity; most of them walk.

    Args:
        velocity_mps: (M, 2) velocities over ground.
        yaw_rad: (M,) headings.
        yaw_rate_radps: (M,) turn rates.
        acceleration_mps2: (M, 2) accelerations, map frame; zero where unknown.
        covariance: (M, D, D) of the filter's states; D 0 for trackers that tell none.
        code: (M,) positions in CATEGORIES.
    """
    entries = covariance.shape[1]
    speed = np.hypot(velocity_mps[:, 0], velocity_mps[:, 1])
    wheeled = _TURN_MEMORY_S.take(code) > 0.0
    rate, velocity = yaw_rate_radps, velocity_mps
    if entries in (_LINEAR, _ACCELERATED):
        velocity = _along_heading(velocity, yaw_rad, covariance, wheeled)
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        direction = velocity / np.maximum(speed, 1e-9)[:, None]
        variance = covariance[:, 8, 8]
        if entries == _ACCELERATED:
            slow = np.maximum(speed, 0.5)
            across = direction[:, 0] * acceleration_mps2[:, 1] - direction[:, 1] * acceleration_mps2[:, 0]
            of_bend = (
                direction[:, 1] ** 2 * covariance[:, 9, 9] + direction[:, 0] ** 2 * covariance[:, 10, 10]
            ) / slow**2
            # a filter without turn rate says 0 with variance 0: there the bend alone is known
            unknown = variance == 0.0
            share = np.where(unknown, 1.0, variance / (variance + of_bend + 1e-12))
            rate = rate + share * (across / slow - rate)
            variance = np.where(unknown, of_bend, (1.0 - share) * variance)
        rate = _sure(rate, variance)
    elif entries == _TURNING:
        rate = _sure(rate, covariance[:, 4, 4])
    limit = _CORNERING_MPS2 / np.maximum(speed, 1.0)
    along = (acceleration_mps2 * velocity).sum(axis=1) / np.maximum(speed, 0.5)
    rate = np.where(wheeled, np.clip(rate, -limit, limit), 0.0)
    return Motion(velocity, rate, np.where(wheeled, along, 0.0))


def _along_heading(
    velocity_mps: FloatArray, yaw_rad: FloatArray, covariance: FloatArray, wheeled: BoolArray
) -> FloatArray:
    """(M, 2) velocities of what has wheels: none across the heading is measured, and none in noise."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    ahead = velocity_mps[:, 0] * c + velocity_mps[:, 1] * s
    across = velocity_mps[:, 1] * c - velocity_mps[:, 0] * s
    variance = covariance[:, 5, 5] * s**2 + covariance[:, 6, 6] * c**2
    noise = _SIDE_SLIP_MPS**2 + ahead**2 * covariance[:, 4, 4]
    across = across * noise / (variance + noise)
    variance_ahead = covariance[:, 5, 5] * c**2 + covariance[:, 6, 6] * s**2
    sure = np.maximum(1.0 - variance_ahead / np.maximum(ahead**2 + across**2, 1e-12), 0.0)
    along = np.stack((ahead * c - across * s, ahead * s + across * c), axis=-1)
    velocity: FloatArray = np.where(wheeled[:, None], sure[:, None] * along, velocity_mps)
    return velocity


def _sure(rate_radps: FloatArray, variance: FloatArray) -> FloatArray:
    """(M,) turn rates, shrunk by what of them may be noise."""
    squared = np.maximum(rate_radps**2, 1e-12)
    return rate_radps * np.maximum(1.0 - variance / squared, 0.0)


def class_positions(
    center_m: FloatArray, motion: Motion, code: IntArray, time_s: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Where M objects are after some times, each as its category moves.

    Args:
        center_m: (M, 2) centres, map frame.
        motion: Of the objects.
        code: (M,) positions in CATEGORIES.
        time_s: (T,) times after now, or (M, T).

    Returns:
        (M, T, 2) centres and (M, T) courses, not wrapped.
    """
    velocity = motion.velocity_mps
    return fading_positions(
        center_m[:, 0],
        center_m[:, 1],
        np.arctan2(velocity[:, 1], velocity[:, 0]),
        np.hypot(velocity[:, 0], velocity[:, 1]),
        motion.yaw_rate_radps,
        motion.acceleration_mps2,
        _TURN_MEMORY_S.take(code),
        ACCELERATION_MEMORY_S,
        time_s,
    )


def driven_m(motion: Motion, time_s: FloatArray) -> FloatArray:
    """(M, T) ways that objects drive in (T,) or (M, T) times: their accelerations fade, who brakes stops."""
    speed = np.hypot(motion.velocity_mps[:, 0], motion.velocity_mps[:, 1])
    nothing = np.zeros(len(speed))
    straight, _ = fading_positions(
        nothing, nothing, nothing, speed, nothing, motion.acceleration_mps2, nothing,
        ACCELERATION_MEMORY_S, time_s,
    )  # fmt: skip
    return straight[..., 0]


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
    if entries >= _LINEAR:  # linear: value, rate and, where there is one, acceleration of each axis
        orders, steps = [0, 5], [ones, time]
        if entries == _ACCELERATED:
            fade = ACCELERATION_MEMORY_S
            orders, steps = [*orders, 9], [*steps, fade * (time + fade * np.expm1(-time / fade))]
        row = np.stack(steps, axis=-1)
        for a, b in ((0, 0), (0, 1), (1, 1)):
            of_a, of_b = ([order + axis for order in orders] for axis in (a, b))
            part = covariance[:, of_a][:, :, of_b]
            variance[..., a, b] = variance[..., b, a] = np.einsum("mti,mij,mtj->mt", row, part, row)
    elif entries == _TURNING:  # CTRV: the variance of the speed, in every direction
        variance += covariance[:, None, :2, :2]
        for axis in (0, 1):
            variance[..., axis, axis] += time**2 * covariance[:, None, 3, 3]
    for axis in (0, 1):
        variance[..., axis, axis] += unknown
    return variance
