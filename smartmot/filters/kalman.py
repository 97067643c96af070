"""Batched Kalman filter steps, and what the box filters have in common: noise, measurement, estimate.

`predict` and `update` act on all tracks at once and know nothing of boxes. A `BoxFilter` keeps the state of M
tracks in one array (M, W) and never changes it in place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from smartmot.errors import ConfigError
from smartmot.filters.motion_models import (
    AREA,
    CHANNELS,
    RATIO,
    YAW,
    PerCategory,
    Setting,
    X,
    Y,
    check_range,
    table,
)
from smartmot.types import BoolArray, Boxes, FloatArray, IntArray

MIN_AREA_M2 = 0.01
"""Least area a box shrinks to: 0.1 m x 0.1 m, smaller than any road user."""

MIN_RATIO = 0.05
"""Least length over width: a box twenty times wider than long, such as a trailer seen across."""

# Arrays of no dimension: NumPy would make them of numbers anew in every call.
_LEAST_AREA_M2, _LEAST_RATIO = np.array(MIN_AREA_M2), np.array(MIN_RATIO)
_QUARTER_TURN, _HALF_TURN = np.array(0.5 * np.pi), np.array(np.pi)

BACKWARDS_MPS = 2.0
"""A track that moves faster than this against its heading is turned round: people and parking cars go
backwards more slowly, 7 km/h."""

HEADINGS = ("track", "detector", "motion", "evidence")
"""Whose word counts when a measured heading points the other way: see `BevFilterConfig.heading`."""


@dataclass(frozen=True, slots=True)
class BevFilterConfig:
    """Measurement noise and the uncertainty of a new track, in physical units (one standard deviation).

    The paper's code works in pixels of about 0.05 m, which is also the position noise it puts on ground-truth
    detections; its R is 1 for the position and 10 for area, ratio and heading, its initial covariance 10 and
    10^5 on the rates. `paper()` holds these. The defaults differ in what they say about a new track:
    a first detection is as uncertain as any detection (factor 1, not 10) and the unknown velocity is bounded
    by what the category can do. Otherwise the second frame of a standing pedestrian reads as 1.4 m/s, and a
    heading noise of 0.05 rad as a turn of 1.4 rad/s.

    Args:
        position_sigma_m: Noise of a measured centre along each axis. Source: paper's code, 0.05 m.
        area_sigma_m2: Noise of a measured area. Source: sqrt(10) x 0.05, paper's R.
        ratio_sigma: Noise of a measured aspect ratio. Source: sqrt(10) x 0.05, paper's R.
        yaw_sigma_rad: Noise of a measured heading, 3 degrees, common for lidar detectors at short range.
        velocity_sigma_mps: Noise of a velocity that the detector measures, along each axis. It enters only
            where detections carry one and `use_velocity` is set.
        use_size: Size is part of the state; otherwise a track has the size of its last detection.
        use_yaw: The heading is part of the state; otherwise it is the last detection's.
        use_velocity: A velocity that detections carry is a measurement.
        heading: What a measured heading means that is more than a quarter turn off the track. "track": the
            detector took the rear for the front (the paper's code). "detector": the track did. "motion": as
            "track", and a track that clearly drives backwards is turned round. "evidence": what most of the
            last detections and the motion say (`smartmot.tracking.evidence`).
        initial_factor: Covariance of the measured entries of a new track over the measurement noise.
        initial_speed_sigma_mps: Velocity of a new track along each axis, half of a high speed.
        initial_area_rate_sigma_m2ps: Change of area of a new track.
        initial_yaw_rate_sigma_radps: Turn rate of a new track; a car at 0.3 g and 14 m/s has 0.2.

    Raises:
        ConfigError: A value is outside its range.
    """

    position_sigma_m: Setting = 0.05
    area_sigma_m2: Setting = 0.05 * math.sqrt(10.0)
    ratio_sigma: Setting = 0.05 * math.sqrt(10.0)
    yaw_sigma_rad: Setting = 0.05
    velocity_sigma_mps: Setting = 1.0
    use_size: bool = True
    use_yaw: bool = True
    use_velocity: bool = True
    heading: str = "track"
    initial_factor: float = 1.0
    initial_speed_sigma_mps: Setting = field(
        default=PerCategory(car=15.0, pedestrian=2.0, cyclist=5.0, truck=15.0, motorcycle=15.0, unknown=10.0)
    )
    initial_area_rate_sigma_m2ps: Setting = 0.1
    initial_yaw_rate_sigma_radps: Setting = 0.2

    def __post_init__(self) -> None:
        for name in (
            "position_sigma_m",
            "area_sigma_m2",
            "ratio_sigma",
            "yaw_sigma_rad",
            "velocity_sigma_mps",
            "initial_factor",
            "initial_speed_sigma_mps",
        ):
            check_range(self, name, 1e-9, math.inf)
        for name in ("initial_area_rate_sigma_m2ps", "initial_yaw_rate_sigma_radps"):
            check_range(self, name, 0.0, math.inf)
        if self.heading not in HEADINGS:
            raise ConfigError(
                f"BevFilterConfig.heading: choose one of {', '.join(HEADINGS)}, got {self.heading!r}"
            )

    @classmethod
    def paper(cls) -> BevFilterConfig:
        """The paper's R = (1, 1, 10, 10, 10) and P0 = 10, 10^5 on the rates.

        Units of 0.05 m and 0.05 m per frame of 0.05 s (see `ConstantVelocity.paper`). R of the position is
        the unit itself; the factor 10 of P0 then holds for the position and is 1 for the other values, so
        `initial_factor` 10 is wider than the paper for these three, which only hastens their first update.
        """
        unit, rate_sigma = 0.05, math.sqrt(1e5)
        other = unit * math.sqrt(10.0)
        return cls(
            unit,
            other,
            other,
            other,
            initial_factor=10.0,
            initial_speed_sigma_mps=rate_sigma,
            initial_area_rate_sigma_m2ps=rate_sigma,
            initial_yaw_rate_sigma_radps=rate_sigma,
        )

    def measurement_variance(self) -> FloatArray:
        """(C, 5) variances of a measurement (x, y, area, ratio, yaw) for each category."""
        position = self.position_sigma_m
        settings = (position, position, self.area_sigma_m2, self.ratio_sigma, self.yaw_sigma_rad)
        return np.stack([table(setting) for setting in settings], axis=-1) ** 2

    def initial_rate_variance(self) -> FloatArray:
        """(C, 5) variances of the rates of a new track for each category; the ratio has none."""
        speed = self.initial_speed_sigma_mps
        settings = (speed, speed, self.initial_area_rate_sigma_m2ps, 0.0, self.initial_yaw_rate_sigma_radps)
        return np.stack([table(setting) for setting in settings], axis=-1) ** 2


@dataclass(slots=True, eq=False)
class Estimate:
    """What M filter states say of the objects, map frame. Not frozen, which would cost more than its content.

    Args:
        center_m: (M, 2) centres.
        size_m: (M, 2) lengths and widths, positive.
        yaw_rad: (M,) headings, any multiple of a turn.
        velocity_mps: (M, 2) velocities over ground.
        yaw_rate_radps: (M,) turn rates.
    """

    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    yaw_rate_radps: FloatArray


class BoxFilter(Protocol):
    """Estimates M boxes in one array (M, W). N stands for new or corrected tracks.

    A state is (W,), a measurement (5,) as from `measurements`, a measured velocity (2,) or NaN where there is
    none; `velocity_mps` is None where the detector measures none. `code` holds positions in CATEGORIES.
    `pose_covariance` (N, 3, 3) of x, y and yaw is the measurement's own noise, NaN where the configured one
    holds; None: everywhere.
    """

    @property
    def widths(self) -> tuple[int, ...]:
        """W, the entries of one track's state; then V of those that `widened` makes."""
        ...

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the D entries of `mean`, with their units."""
        ...

    def born(
        self,
        measurement: FloatArray,
        velocity_mps: FloatArray | None,
        code: IntArray,
        pose_covariance: FloatArray | None = None,
    ) -> FloatArray:
        """(N, W) states from one measurement each: at rest, or at the detector's velocity."""
        ...

    def widened(self, state: FloatArray) -> FloatArray:
        """(M, V) states with room for what noise along x and y shares; themselves where there is room."""
        ...

    def predict(self, state: FloatArray, code: IntArray, dt_s: float) -> FloatArray:
        """(M, W) states dt_s later."""
        ...

    def update(
        self,
        state: FloatArray,
        measurement: FloatArray,
        velocity_mps: FloatArray | None,
        code: IntArray,
        pose_covariance: FloatArray | None = None,
    ) -> FloatArray:
        """(N, W) states after a measurement each."""
        ...

    def estimate(self, state: FloatArray) -> Estimate:
        """What the states say."""
        ...

    def motion(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M,) headings, any multiple of a turn, and (M, 2) velocities over ground, of `estimate`."""
        ...

    def position_covariance(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(M,) variances along x and along y, and the covariance of the two."""
        ...

    def speed_variance(self, state: FloatArray) -> FloatArray:
        """(M,) variance of the velocity along one axis, mean of the two."""
        ...

    def moments(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M, D) means and (M, D, D) covariances in the order of `names`."""
        ...

    def turn_round(self, state: FloatArray, which: BoolArray) -> None:
        """Let tracks (M,) face the other way, in place: the heading alone changes, not the motion."""
        ...


def predict(
    mean: FloatArray, covariance: FloatArray, transition: FloatArray, process_noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Carry M estimates over one time step.

    Args:
        mean: (M, D) states.
        covariance: (M, D, D) their covariances.
        transition: (D, D) or (M, D, D) matrix F.
        process_noise: (D, D) or (M, D, D) matrix Q.

    Returns:
        (M, D) F m and (M, D, D) F P F^T + Q.
    """
    moved = (transition @ mean[..., None])[..., 0]
    spread = transition @ covariance @ np.swapaxes(transition, -1, -2) + process_noise
    return moved, spread


def update(
    mean: FloatArray,
    covariance: FloatArray,
    innovation: FloatArray,
    noise: FloatArray,
    measures: FloatArray | None = None,
) -> tuple[FloatArray, FloatArray]:
    """Correct M estimates by measurements.

    The covariance is P - K H P, made symmetric. Joseph's form, which the tests compare with, takes twice the
    time and agrees to rounding here, where R is never small against P.

    Args:
        mean: (M, D) predicted states.
        covariance: (M, D, D) their covariances.
        innovation: (M, K) measurement minus prediction.
        noise: (K, K) or (M, K, K) measurement covariance R.
        measures: (K, D) or (M, K, D) matrix H. None: the first K state entries are measured.

    Returns:
        (M, D) states and (M, D, D) covariances after the measurement.
    """
    k = innovation.shape[-1]
    if measures is None:
        cross = covariance[..., :k, :]
        spread = cross[..., :k]
    else:
        cross = measures @ covariance
        spread = cross @ np.swapaxes(measures, -1, -2)
    gain = np.swapaxes(np.linalg.solve(spread + noise, cross), -1, -2)
    corrected = mean + (gain @ innovation[..., None])[..., 0]
    left = covariance - gain @ cross
    return corrected, 0.5 * (left + np.swapaxes(left, -1, -2))


def measurements(boxes: Boxes) -> FloatArray:
    """Boxes as the filters measure them.

    Args:
        boxes: N boxes.

    Returns:
        (N, 5) x, y, area, aspect ratio and heading, map frame.
    """
    z = np.empty((len(boxes), len(CHANNELS)))
    length, width = boxes.size_m[:, 0], boxes.size_m[:, 1]
    z[:, :AREA] = boxes.center_m
    np.multiply(length, width, out=z[:, AREA])
    np.divide(length, width, out=z[:, RATIO])
    z[:, YAW] = boxes.yaw_rad
    return z


def measurement_noise(
    variance: FloatArray, pose_covariance: FloatArray | None
) -> tuple[FloatArray, FloatArray | None]:
    """Noise of measurements, each detection's own where it states one.

    Args:
        variance: (N, 5) configured variances of x, y, area, ratio and yaw.
        pose_covariance: (N, 3, 3) as `smartmot.types.Detections` has it; None: nothing is stated.

    Returns:
        (N, 5) variances and (N,) what the noise of x and y shares; None: nothing.
    """
    if pose_covariance is None:
        return variance, None
    variance = variance.copy()
    shared = pose_covariance[:, X, Y]
    own = np.isfinite(shared)
    variance[own, X], variance[own, Y] = pose_covariance[own, X, X], pose_covariance[own, Y, Y]
    yaw = pose_covariance[:, 2, 2]
    variance[:, YAW] = np.where(np.isfinite(yaw), yaw, variance[:, YAW])
    shared = np.where(own, shared, 0.0)
    return variance, shared if np.count_nonzero(shared) else None


def sizes(area_m2: FloatArray, ratio: FloatArray) -> FloatArray:
    """Lengths and widths.

    Args:
        area_m2: (M,) areas; raised to MIN_AREA_M2.
        ratio: (M,) length over width; raised to MIN_RATIO.

    Returns:
        (M, 2) length and width, metres.
    """
    ratio = np.maximum(ratio, _LEAST_RATIO)
    size = np.empty((len(ratio), 2))
    length = np.maximum(area_m2, _LEAST_AREA_M2)
    length *= ratio
    np.sqrt(length, out=size[:, 0])
    np.divide(size[:, 0], ratio, out=size[:, 1])
    return size


def heading_innovation(measured_rad: FloatArray, predicted_rad: FloatArray) -> FloatArray:
    """Difference of headings modulo half a turn, in [-pi/2, pi/2): detectors confuse front and rear.

    Args:
        measured_rad: (N,) headings.
        predicted_rad: (N,) headings.

    Returns:
        (N,) radians.
    """
    return fold(measured_rad - predicted_rad)


def fold(difference_rad: FloatArray) -> FloatArray:
    """Differences of headings (N,) modulo half a turn, in place; see `heading_innovation`."""
    difference_rad += _QUARTER_TURN
    difference_rad %= _HALF_TURN
    difference_rad -= _QUARTER_TURN
    return difference_rad
