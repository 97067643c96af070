"""Whether who drives behind touches a vehicle that brakes, and how fast: from its speed over time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from smartmot.errors import ShapeError
from smartmot.types import FloatArray

STEP_S = 0.02
"""Of the time over which motions are compared. Speeds are linear between samples; gaps are exact to a
millimetre with it."""


@dataclass(frozen=True, slots=True)
class Followers:
    """Distribution of drivers behind: time gaps and reaction times, independent of each other.

    A follower drives as fast as the vehicle ahead, at a gap of its speed times the time gap. After the
    reaction time it takes over each speed of the vehicle ahead, as far as its brakes allow: it copies what it
    sees (Newell's car following, Transp. Res. B 36 (2002) 195) with a limited deceleration.

    Time gaps in steady car following have a lognormal distribution shifted by 0.26 s (Statistical models for
    preferred time headway and time headway of drivers in steady state car-following, ASCE 9th AATT, 2006).
    The median is the standard following time of openpilot, and the spread is assumed. Reaction times to
    brake lights are normal with 1.25 s and 0.46 s (Ergonomics 36 (1993) 391; the mean is that of M. Green,
    Transp. Hum. Factors 2 (2000) 195). The driver brakes with 0.774 g, which takes 0.6 s to build up
    (competent driver of UN R157); half of that is added to the reaction.

    Args:
        median_s: time gap that half of the followers keep (1.45 s).
        spread: standard deviation of the logarithm of the time gap beyond the shift (0.4).
        shift_s: least time gap (0.26 s).
        reaction_s, reaction_sigma_s: mean and standard deviation of reaction times (1.25 s, 0.46 s).
        build_up_s: of the driver's deceleration (0.6 s).
        decel_mps2: that deceleration (0.774 g).
        count: of time gaps, and of reaction times: so many equally probable ones.

    Raises:
        ShapeError: a value is out of range.
    """

    median_s: float = 1.45
    spread: float = 0.4
    shift_s: float = 0.26
    reaction_s: float = 1.25
    reaction_sigma_s: float = 0.46
    build_up_s: float = 0.6
    decel_mps2: float = 0.774 * 9.81
    count: int = 12

    def __post_init__(self) -> None:
        times = (self.shift_s, self.spread, self.reaction_s, self.reaction_sigma_s, self.build_up_s)
        if not all(0.0 <= value < math.inf for value in times):
            raise ShapeError(f"followers: no time may be negative or infinite, got {self}")
        if not (self.shift_s < self.median_s < math.inf and 0.0 < self.decel_mps2 < math.inf):
            raise ShapeError(
                f"followers: the median must be above the shift, and decel_mps2 positive: {self}"
            )
        if self.count < 1:
            raise ShapeError(f"followers: count must be positive, got {self.count}")

    @property
    def gap_s(self) -> FloatArray:
        """(count,) time gaps in the middle of equally probable parts."""
        over = math.log(self.median_s - self.shift_s)
        return self.shift_s + np.exp(over + self.spread * self._normal)

    @property
    def dead_s(self) -> FloatArray:
        """(count,) times from what is seen to a deceleration at once, none below 0."""
        return np.maximum(self.reaction_s + self.reaction_sigma_s * self._normal, 0.0) + self.build_up_s / 2

    @property
    def _normal(self) -> FloatArray:
        parts = [(k + 0.5) / self.count for k in range(self.count)]
        return np.array([NormalDist().inv_cdf(part) for part in parts])


def closing_speeds(
    time_s: FloatArray,
    speed_mps: FloatArray,
    gap_s: FloatArray,
    dead_s: FloatArray,
    decel_mps2: float,
) -> FloatArray:
    """Relative speeds at which followers touch a vehicle from behind.

    Before the first time it drove as at that, and after the last it drives on as at that. A follower's speed
    is the least that is nowhere below the speed ahead `dead_s` earlier and falls nowhere faster than
    `decel_mps2`.

    Args:
        time_s: (T,) ascending.
        speed_mps: (T,) of the vehicle, linear in between, none below 0.
        gap_s: (F,) time gaps of the followers at the first time.
        dead_s: (F,) after which they take over speeds.
        decel_mps2: their greatest deceleration.

    Returns:
        (F,) m/s; NaN of those that do not touch it.

    Raises:
        ShapeError: shapes disagree, times do not ascend, a speed is negative, or there is none.
    """
    if time_s.ndim != 1 or time_s.shape != speed_mps.shape or not len(time_s) or gap_s.shape != dead_s.shape:
        raise ShapeError(
            f"followers: shapes {time_s.shape}, {speed_mps.shape}, {gap_s.shape}, {dead_s.shape}"
        )
    if not ((np.diff(time_s) > 0.0).all() and (speed_mps >= 0.0).all() and decel_mps2 > 0.0):
        raise ShapeError("followers: times must ascend, no speed be negative, and decel_mps2 be positive")
    # after the last sample followers come to the speed ahead, in this time at most
    settles_s = float(dead_s.max(initial=0.0)) + float(speed_mps.max()) / decel_mps2
    count = math.ceil((time_s[-1] - time_s[0] + settles_s) / STEP_S) + 1
    time = time_s[0] + STEP_S * np.arange(count)
    ahead = np.interp(time, time_s, speed_mps)
    seen = np.interp(time - dead_s[:, None], time_s, speed_mps)
    fall = decel_mps2 * (time - time_s[0])
    behind = np.maximum.accumulate(seen + fall, axis=1) - fall
    closing = behind - ahead
    closed_m = np.cumsum((closing[:, 1:] + closing[:, :-1]) / 2, axis=1) * STEP_S
    touches = closed_m >= (gap_s * speed_mps[0])[:, None]
    first = touches.argmax(axis=1)
    at_contact = closing[np.arange(len(gap_s)), first + 1]
    return np.where(touches.any(axis=1), np.maximum(at_contact, 0.0), np.nan)


@dataclass(frozen=True, slots=True)
class Exposure:
    """What a braking costs those behind.

    Args:
        share: of the followers who touch the vehicle.
        closing_mps: mean relative speed of those; 0 if none does.
    """

    share: float
    closing_mps: float


def exposure(time_s: FloatArray, speed_mps: FloatArray, followers: Followers) -> Exposure:
    """Who of a distribution of followers touches a vehicle from behind; see `closing_speeds`."""
    gap, dead = np.meshgrid(followers.gap_s, followers.dead_s, indexing="ij")
    closing = closing_speeds(time_s, speed_mps, gap.ravel(), dead.ravel(), followers.decel_mps2)
    hit = closing[~np.isnan(closing)]
    return Exposure(len(hit) / len(closing), float(hit.mean()) if len(hit) else 0.0)
