"""The motions of the configurations `imm` and `ukf`, built on filterpy; slower than the shipped filters."""

from __future__ import annotations

import math
from dataclasses import dataclass, field, fields
from functools import lru_cache, partial
from typing import Any

import numpy as np

from smartmot.filters.kalman import BevFilterConfig
from smartmot.filters.motion_models import (
    YAW,
    ConstantTurnRate,
    DecayingAcceleration,
    PerCategory,
    Setting,
    X,
    Y,
    check_range,
    table,
)
from smartmot.filters.turn import NAMES, TurnFilter
from smartmot.types import CATEGORIES, FloatArray


@dataclass(frozen=True, slots=True)
class InteractingModels:
    """Steady motion and acceleration that fades, whichever explains the measurements.

    Source: Blom and Bar-Shalom, IEEE Trans. Automatic Control 33, 1988.
    filterpy's `IMMEstimator` of two linear filters with place, velocity and acceleration along each axis.

    Args:
        steady_m2ps3: Density of the acceleration noise of steady motion, m2/s3.
        acceleration_mps2: Standard deviation of an acceleration along each axis while there is one; over
            half of what a comfortable stop takes.
        memory_s: Time over which it fades.
        steady_s: Mean time of steady motion before an acceleration begins.
        accelerated_s: Mean time before it ends: as long as a stop from 30 km/h takes at 3 m/s2.

    Raises:
        ConfigError: A value is outside its range.
    """

    steady_m2ps3: Setting = field(default=PerCategory.grouped(0.2, 0.1, 0.2))
    acceleration_mps2: Setting = field(default=PerCategory.grouped(2.0, 0.7, 1.5))
    memory_s: float = 1.0
    steady_s: float = 5.0
    accelerated_s: float = 3.0

    def __post_init__(self) -> None:
        for each in fields(self):
            check_range(self, each.name, 1e-3 if each.name.endswith("_s") else 0.0, math.inf)

    @property
    def names(self) -> tuple[str, ...]:
        """Place, velocity and acceleration, along x and then along y."""
        return ("x_m", "vx_mps", "ax_mps2", "y_m", "vy_mps", "ay_mps2")

    def make(self, category: str, config: BevFilterConfig) -> Any:
        """An `IMMEstimator`, at first as likely steady as it is in the long run."""
        from filterpy.kalman import IMMEstimator, KalmanFilter

        code = CATEGORIES.index(category)
        position = config.measurement_variance()[code, [X, Y]]
        speed = config.initial_rate_variance()[code, X]
        filters = []
        for acceleration in (0.0, table(self.acceleration_mps2)[code] ** 2):
            tracked = KalmanFilter(dim_x=6, dim_z=2)
            tracked.x = np.zeros(6)
            tracked.H = np.zeros((2, 6))
            tracked.H[0, 0] = tracked.H[1, 3] = 1.0
            tracked.R = np.diag(position)
            start = config.initial_factor * position
            tracked.P = np.diag([start[0], speed, acceleration, start[1], speed, acceleration])
            tracked.densities = self._densities(code, acceleration)
            filters.append(tracked)
        steady = self.steady_s / (self.steady_s + self.accelerated_s)
        return IMMEstimator(filters, np.array([steady, 1.0 - steady]), self._changes(1.0))

    def _densities(self, code: int, acceleration: float) -> tuple[float, float]:
        """Densities of the noise on velocity and acceleration: one of them is 0."""
        if acceleration > 0.0:
            return 0.0, 2.0 * acceleration / self.memory_s
        return float(table(self.steady_m2ps3)[code]), 0.0

    def _changes(self, dt_s: float) -> FloatArray:
        """(2, 2) chances that the motion changes within a time, of a Markov chain with the mean times."""
        rate = 1.0 / self.steady_s + 1.0 / self.accelerated_s
        changed = -math.expm1(-rate * dt_s) / rate
        begins, ends = changed / self.steady_s, changed / self.accelerated_s
        return np.array([[1.0 - begins, begins], [ends, 1.0 - ends]])

    def advance(self, tracked: Any, dt_s: float) -> None:
        """Mix the models by the chances of a change, and predict each."""
        for k, model in enumerate(tracked.filters):
            model.F, model.Q = _step(self.memory_s, dt_s, k == 0, *model.densities)
        tracked.M = self._changes(dt_s)
        tracked.cbar = tracked.mu @ tracked.M
        tracked.omega = tracked.M * tracked.mu[:, None] / tracked.cbar
        tracked.predict()


@lru_cache(maxsize=256)
def _step(
    memory_s: float, dt_s: float, steady: bool, velocity_m2ps3: float, acceleration_m2ps5: float
) -> tuple[FloatArray, FloatArray]:
    """(6, 6) transition over a step, and covariance of noise on velocity and acceleration."""
    fading = DecayingAcceleration(memory_s=memory_s)
    nodes, weights = np.polynomial.legendre.leggauss(8)
    noise: FloatArray = np.zeros((3, 3))
    for node, weight in zip(nodes.tolist(), weights.tolist(), strict=True):
        f = fading.transition(0.5 * dt_s * (node + 1.0))
        unit = velocity_m2ps3 * np.outer(f[:, 1], f[:, 1]) + acceleration_m2ps5 * np.outer(f[:, 2], f[:, 2])
        noise += 0.5 * dt_s * weight * unit
    transition = fading.transition(dt_s)
    if steady:  # an acceleration that was mixed in is none
        transition[:, 2] = 0.0
    along_both = np.eye(2)
    transitions, noises = (np.kron(along_both, part) for part in (transition, noise))
    return np.asarray(transitions, dtype=np.float64), np.asarray(noises, dtype=np.float64)


@dataclass(frozen=True, slots=True)
class UnscentedTurnRate:
    """Constant turn rate and speed by filterpy's `UnscentedKalmanFilter`, with van der Merwe's points.

    State and noise are those of `ConstantTurnRate`, whose filter linearises where this one samples.

    Args:
        model: The noise.
        alpha, beta, kappa: Spread of the sigma points: 1, 2 and 0 put them one standard deviation times the
            root of the dimension from the mean, with the weights of a normal distribution.

    Raises:
        ConfigError: A value is outside its range.
    """

    model: ConstantTurnRate = field(default_factory=ConstantTurnRate)
    alpha: float = 1.0
    beta: float = 2.0
    kappa: float = 0.0

    def __post_init__(self) -> None:
        check_range(self, "alpha", 1e-3, 1.0)
        check_range(self, "beta", 0.0, 10.0)
        check_range(self, "kappa", 0.0, 10.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Those of `TurnFilter`."""
        return NAMES

    def make(self, category: str, config: BevFilterConfig) -> Any:
        """An `UnscentedKalmanFilter`."""
        from filterpy.kalman import MerweScaledSigmaPoints, UnscentedKalmanFilter

        code = CATEGORIES.index(category)
        entries = 3 if config.use_yaw else 2
        points = MerweScaledSigmaPoints(len(NAMES), self.alpha, self.beta, self.kappa)
        tracked = UnscentedKalmanFilter(
            len(NAMES), entries, 0.1, partial(_measured, entries=entries), _moved, points
        )
        variance, rates = config.measurement_variance()[code], config.initial_rate_variance()[code]
        tracked.R = np.diag(variance[[X, Y, YAW][:entries]])
        start = config.initial_factor * variance
        tracked.P = np.diag([start[X], start[Y], start[YAW], rates[X], rates[YAW]])
        tracked.noise, tracked.code = TurnFilter(self.model, config), np.array([code])
        return tracked

    def advance(self, tracked: Any, dt_s: float) -> None:
        """Predict; the noise is that of the mean course."""
        tracked.Q = tracked.noise.process_noise(tracked.x[None], tracked.code, dt_s)[0]
        tracked.predict(dt=dt_s)


def _measured(state: FloatArray, entries: int) -> FloatArray:
    """(K,) x, y and, of three entries, the heading."""
    return state[:entries]


def _moved(state: FloatArray, dt_s: float) -> FloatArray:
    """(5,) state after a step: `ctrv_step` in scalars, since filterpy asks point by point."""
    x_m, y_m, yaw_rad, speed_mps, yaw_rate_radps = state.tolist()
    half = 0.5 * dt_s * yaw_rate_radps
    chord_m = speed_mps * dt_s * (math.sin(half) / half if half else 1.0)
    return np.array(
        [
            x_m + chord_m * math.cos(yaw_rad + half),
            y_m + chord_m * math.sin(yaw_rad + half),
            yaw_rad + dt_s * yaw_rate_radps,
            speed_mps,
            yaw_rate_radps,
        ]
    )
