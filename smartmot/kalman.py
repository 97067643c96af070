"""Batched linear Kalman filter and its use on bird's-eye-view boxes.

`predict` and `update` act on all tracks at once and know nothing of boxes. The rest puts boxes into the state
of `smartmot.motion_models.STATE` and back.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from smartmot.geometry import wrap_angle
from smartmot.motion_models import (
    AREA,
    AREA_RATE,
    MEASURED,
    RATIO,
    STATE,
    VX,
    VY,
    YAW,
    YAW_RATE,
    PerCategory,
    check_range,
)
from smartmot.types import Boxes, FloatArray, IntArray

MIN_AREA_M2 = 0.01
"""Least area the filter lets a box shrink to: 0.1 m x 0.1 m, smaller than any road user."""

MIN_RATIO = 0.05
"""Least length over width: a box twenty times wider than long, such as a trailer seen across."""


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
        initial_factor: Covariance of the measured entries of a new track over the measurement noise.
        initial_speed_sigma_mps: Velocity of a new track along each axis, half of a high speed.
        initial_area_rate_sigma_m2ps: Change of area of a new track.
        initial_yaw_rate_sigma_radps: Turn rate of a new track; a car at 0.3 g and 14 m/s has 0.2.

    Raises:
        ConfigError: A value is not positive or not finite.
    """

    position_sigma_m: float = 0.05
    area_sigma_m2: float = 0.05 * math.sqrt(10.0)
    ratio_sigma: float = 0.05 * math.sqrt(10.0)
    yaw_sigma_rad: float = 0.05
    initial_factor: float = 1.0
    initial_speed_sigma_mps: PerCategory = field(
        default=PerCategory(car=15.0, pedestrian=2.0, cyclist=5.0, truck=15.0, motorcycle=15.0, unknown=10.0)
    )
    initial_area_rate_sigma_m2ps: float = 0.1
    initial_yaw_rate_sigma_radps: float = 0.2

    def __post_init__(self) -> None:
        for name in (
            "position_sigma_m",
            "area_sigma_m2",
            "ratio_sigma",
            "yaw_sigma_rad",
            "initial_factor",
            "initial_area_rate_sigma_m2ps",
            "initial_yaw_rate_sigma_radps",
        ):
            check_range(self, name, 1e-9, math.inf)

    @classmethod
    def paper(cls) -> BevFilterConfig:
        """The paper's R = (1, 1, 10, 10, 10) and P0 = 10, 10^5 on the rates.

        Units of 0.05 m and 0.05 m per frame of 0.05 s (see `ConstantVelocity.paper`). R of the position is
        the unit itself; the factor 10 of P0 then holds for the position and is 1 for the other values, so
        `initial_factor` 10 is wider than the paper for these three, which only hastens their first update.
        """
        unit, rate_sigma = 0.05, math.sqrt(1e5)
        other = unit * math.sqrt(10.0)
        rates = PerCategory(*[rate_sigma] * 6)
        return cls(unit, other, other, other, 10.0, rates, rate_sigma, rate_sigma)

    def measurement_noise(self) -> FloatArray:
        """(5, 5) covariance R of a measurement (x, y, area, ratio, yaw)."""
        position = self.position_sigma_m
        sigma = np.array([position, position, self.area_sigma_m2, self.ratio_sigma, self.yaw_sigma_rad])
        return np.diag(sigma**2)


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
    mean: FloatArray, covariance: FloatArray, innovation: FloatArray, noise: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Correct M estimates by measurements of the first K state entries.

    The covariance is P - K H P, made symmetric. Joseph's form, which the tests compare with, takes twice the
    time and agrees to rounding here, where R is never small against P.

    Args:
        mean: (M, D) predicted states.
        covariance: (M, D, D) their covariances.
        innovation: (M, K) measurement minus prediction.
        noise: (K, K) or (M, K, K) measurement covariance R.

    Returns:
        (M, D) states and (M, D, D) covariances after the measurement.
    """
    k = innovation.shape[-1]
    cross = covariance[..., :, :k]
    gain = np.swapaxes(np.linalg.solve(cross[..., :k, :] + noise, np.swapaxes(cross, -1, -2)), -1, -2)
    corrected = mean + (gain @ innovation[..., None])[..., 0]
    spread = covariance - gain @ np.swapaxes(cross, -1, -2)
    return corrected, 0.5 * (spread + np.swapaxes(spread, -1, -2))


def measurements(boxes: Boxes) -> FloatArray:
    """Boxes as the filter measures them.

    Args:
        boxes: N boxes.

    Returns:
        (N, 5) x, y, area, aspect ratio and heading, map frame.
    """
    z = np.empty((len(boxes), MEASURED))
    length, width = boxes.size_m[:, 0], boxes.size_m[:, 1]
    z[:, :AREA] = boxes.center_m
    z[:, AREA] = length * width
    z[:, RATIO] = length / width
    z[:, YAW] = boxes.yaw_rad
    return z


def innovations(mean: FloatArray, measurement: FloatArray) -> FloatArray:
    """Measurement minus prediction, with the heading taken modulo half a turn.

    Detectors confuse front and rear. A heading more than pi/2 off the track is turned by pi, as in the
    paper's code, so the difference lies in [-pi/2, pi/2).

    Args:
        mean: (M, 9) predicted states.
        measurement: (M, 5) matched measurements.

    Returns:
        (M, 5) innovations.
    """
    difference: FloatArray = measurement - mean[:, :MEASURED]
    difference[:, YAW] = (difference[:, YAW] + 0.5 * np.pi) % np.pi - 0.5 * np.pi
    return difference


def valid_state(mean: FloatArray) -> FloatArray:
    """States with a positive box and the heading in [-pi, pi).

    Args:
        mean: (M, 9) states, changed in place.

    Returns:
        The same array. Where the area had to be raised, its rate is stopped.
    """
    small = mean[:, AREA] < MIN_AREA_M2
    if small.any():
        mean[small, AREA] = MIN_AREA_M2
        mean[small, AREA_RATE] = 0.0
    np.maximum(mean[:, RATIO], MIN_RATIO, out=mean[:, RATIO])
    mean[:, YAW] = wrap_angle(mean[:, YAW])
    return mean


def initial_states(
    measurement: FloatArray, category_code: IntArray, config: BevFilterConfig
) -> tuple[FloatArray, FloatArray]:
    """Estimates from a single measurement each: at rest, as uncertain as the configuration says.

    Args:
        measurement: (N, 5) measurements.
        category_code: (N,) positions in CATEGORIES.
        config: Noise and initial uncertainty.

    Returns:
        (N, 9) means and (N, 9, 9) covariances.
    """
    n = len(measurement)
    mean = np.zeros((n, len(STATE)))
    mean[:, :MEASURED] = measurement
    variance = np.empty_like(mean)
    variance[:, :MEASURED] = config.initial_factor * np.diagonal(config.measurement_noise())
    variance[:, VX] = variance[:, VY] = config.initial_speed_sigma_mps.of(category_code) ** 2
    variance[:, AREA_RATE] = config.initial_area_rate_sigma_m2ps**2
    variance[:, YAW_RATE] = config.initial_yaw_rate_sigma_radps**2
    covariance = np.zeros((n, len(STATE), len(STATE)))
    covariance[:, range(len(STATE)), range(len(STATE))] = variance
    return valid_state(mean), covariance


def boxes_of(mean: FloatArray) -> Boxes:
    """Boxes that states describe.

    Args:
        mean: (M, 9) valid states.

    Returns:
        M boxes, map frame.
    """
    size = np.empty((len(mean), 2))
    size[:, 0] = np.sqrt(mean[:, AREA] * mean[:, RATIO])
    size[:, 1] = size[:, 0] / mean[:, RATIO]
    return Boxes(mean[:, :AREA], size, mean[:, YAW])
