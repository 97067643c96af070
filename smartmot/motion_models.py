"""How objects move: the linear constant-velocity model of the filter and the CTRV path of the forecast.

The bird's-eye-view filter state has the order of `STATE`. Shape enters as area and aspect ratio (length over
width), as in the paper's reference code; the ratio is constant, the other four measured values have a rate.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields
from functools import lru_cache
from typing import Protocol

import numpy as np

from smartmot.errors import ConfigError
from smartmot.types import CATEGORIES, FloatArray, IntArray

STATE = ("x_m", "y_m", "area_m2", "ratio", "yaw_rad", "vx_mps", "vy_mps", "area_rate_m2ps", "yaw_rate_radps")
"""Names of the filter state's entries; the first MEASURED of them are what a detection measures."""

MEASURED = 5
X, Y, AREA, RATIO, YAW, VX, VY, AREA_RATE, YAW_RATE = range(len(STATE))
_VALUES = [X, Y, AREA, YAW]
_RATES = [VX, VY, AREA_RATE, YAW_RATE]


def check_range(owner: object, name: str, low: float, high: float) -> None:
    """Reject a setting outside [low, high].

    Args:
        owner: The configuration.
        name: Its field.
        low: Least allowed value.
        high: Greatest allowed value, possibly infinite.

    Raises:
        ConfigError: The value is out of range or not a number.
    """
    value = getattr(owner, name)
    if not isinstance(value, (int, float)) or not low <= value <= high or math.isinf(value):
        raise ConfigError(f"{type(owner).__name__}.{name}: allowed {low:g} to {high:g}, got {value!r}")


@dataclass(frozen=True, slots=True)
class PerCategory:
    """One positive number for each of the object categories."""

    car: float
    pedestrian: float
    cyclist: float
    truck: float
    motorcycle: float
    unknown: float

    def __post_init__(self) -> None:
        for field in fields(self):
            check_range(self, field.name, 1e-9, math.inf)

    def of(self, category_code: IntArray) -> FloatArray:
        """Value of each object.

        Args:
            category_code: (M,) positions in CATEGORIES.

        Returns:
            (M,) values.
        """
        return _table(self)[category_code]


@lru_cache(maxsize=64)
def _table(values: PerCategory) -> FloatArray:
    """(C,) values in the order of CATEGORIES."""
    return np.array([getattr(values, name) for name in CATEGORIES])


class MotionModel(Protocol):
    """Linear motion over a time step of any length."""

    def transition(self, dt_s: float) -> FloatArray:
        """(D, D) matrix that carries the state mean over dt_s seconds."""
        ...

    def process_noise(self, dt_s: float) -> FloatArray:
        """(D, D) covariance that dt_s seconds of unknown acceleration add."""
        ...


@dataclass(frozen=True, slots=True)
class ConstantVelocity:
    """Constant linear and angular velocity, disturbed by white noise on values and on their rates.

    The noise is given as densities and integrated exactly over the step, so two half steps add the same
    covariance as a whole one and any frame spacing works. Over a short step this is the paper's diagonal
    noise scaled by dt over its 0.05 s frame. `paper()` holds the paper's ratios in physical units; the
    defaults put all noise on the rates, because the paper's values follow a change slowly: at 20 Hz a
    pedestrian who starts to walk exceeds 0.5 m/s after 0.30 s instead of 0.15 s, and behind a car that
    brakes at 8 m/s2 the velocity lags by 4.0 m/s instead of 1.3 m/s. The price is more noise on a steady
    velocity, 0.15 m/s instead of 0.06 m/s.

    Args:
        position_m2ps: Density of the position noise, m2/s.
        velocity_m2ps3: Density of the acceleration noise, m2/s3. 0.5 lets the speed wander by 0.7 m/s within
            a second and gives 0.15 m/s of noise at 20 Hz with 0.05 m of position noise.
        area_m4ps: Density of the area noise, m4/s.
        area_rate_m4ps3: Density of the noise on the area rate, m4/s3. Road users keep their size.
        ratio_ps: Density of the noise on the aspect ratio, 1/s.
        yaw_rad2ps: Density of the heading noise, rad2/s.
        yaw_rate_rad2ps3: Density of the angular acceleration noise, rad2/s3. 0.02 gives 0.05 rad/s of noise
            at 20 Hz with 0.05 rad of heading noise.

    Raises:
        ConfigError: A density is negative or not finite.
    """

    position_m2ps: float = 0.0
    velocity_m2ps3: float = 0.5
    area_m4ps: float = 0.05
    area_rate_m4ps3: float = 0.0
    ratio_ps: float = 0.05
    yaw_rad2ps: float = 0.0
    yaw_rate_rad2ps3: float = 0.02

    def __post_init__(self) -> None:
        for field in fields(self):
            check_range(self, field.name, 0.0, math.inf)

    @classmethod
    def paper(cls) -> ConstantVelocity:
        """The noise of the paper's reference code, Q = 1 and 0.01 on the rates per frame of 0.05 s.

        Its unit is one pixel of a 1,000 pixel image of 45 m, about 0.05 m; a rate's unit is one pixel per
        frame, 1 m/s.
        """
        pixel_m, frame_s, rate_factor = 0.05, 0.05, 0.01
        value = pixel_m**2 / frame_s
        rate = rate_factor * pixel_m**2 / frame_s**3
        return cls(value, rate, value, rate, value, value, rate)

    def transition(self, dt_s: float) -> FloatArray:
        """(9, 9) identity, with dt_s from each rate to its value."""
        return _IDENTITY + dt_s * _SHIFT

    def process_noise(self, dt_s: float) -> FloatArray:
        """(9, 9) covariance added within dt_s: the integral of F(t) diag(densities) F(t)^T over the step."""
        linear, quadratic, cubic = _noise_terms(self)
        return dt_s * (linear + dt_s * (quadratic + dt_s * cubic))


_IDENTITY = np.eye(len(STATE))
_SHIFT = np.zeros_like(_IDENTITY)
_SHIFT[_VALUES, _RATES] = 1.0


@lru_cache(maxsize=16)
def _noise_terms(model: ConstantVelocity) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(9, 9) coefficients of dt, dt^2 and dt^3 in the process noise."""
    density = np.zeros(len(STATE))
    density[_VALUES] = model.position_m2ps, model.position_m2ps, model.area_m4ps, model.yaw_rad2ps
    density[RATIO] = model.ratio_ps
    density[_RATES] = (
        model.velocity_m2ps3,
        model.velocity_m2ps3,
        model.area_rate_m4ps3,
        model.yaw_rate_rad2ps3,
    )
    noise = np.diag(density)
    moved = _SHIFT @ noise
    return noise, 0.5 * (moved + moved.T), moved @ _SHIFT.T / 3.0


def ctrv_positions(
    x_m: FloatArray,
    y_m: FloatArray,
    course_rad: FloatArray,
    speed_mps: FloatArray,
    yaw_rate_radps: FloatArray,
    time_s: FloatArray,
) -> tuple[FloatArray, FloatArray]:
    """Path at constant speed and turn rate (CTRV), in closed form.

    In time t the course turns by w t. The chord of that arc has the length v t sinc(w t / 2) and the
    direction of the mean course, which holds without a special case for straight motion.

    Args:
        x_m: (M,) start, map frame.
        y_m: (M,) start, map frame.
        course_rad: (M,) direction of travel at the start.
        speed_mps: (M,) speed along the course.
        yaw_rate_radps: (M,) turn rate.
        time_s: (T,) times after the start, or (M, T).

    Returns:
        (M, T, 2) positions, map frame, metres, and (M, T) courses in radians (not wrapped).
    """
    half_turn = 0.5 * np.asarray(yaw_rate_radps)[..., None] * time_s
    start_course = np.asarray(course_rad)[..., None]
    chord = np.asarray(speed_mps)[..., None] * time_s * np.sinc(half_turn / np.pi)
    mean_course = start_course + half_turn
    positions = np.stack(
        (
            np.asarray(x_m)[..., None] + chord * np.cos(mean_course),
            np.asarray(y_m)[..., None] + chord * np.sin(mean_course),
        ),
        axis=-1,
    )
    return positions, start_course + 2.0 * half_turn
