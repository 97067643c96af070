"""The extended Kalman filter of constant turn rate and velocity (CTRV), batched over tracks.

The path is the closed form of `motion_models.ctrv_positions`, its Jacobian is exact, straight motion
included. Size does not depend on the motion: area and aspect ratio are filtered on their own.
"""

from __future__ import annotations

import numpy as np

from smartmot.filters.kalman import (
    BACKWARDS_MPS,
    BevFilterConfig,
    Estimate,
    heading_innovation,
    measurement_noise,
    sizes,
    update,
)
from smartmot.filters.motion_models import AREA, RATIO, YAW, ConstantTurnRate, X, Y, table
from smartmot.types import BoolArray, FloatArray, IntArray

NAMES = ("x_m", "y_m", "yaw_rad", "speed_mps", "yaw_rate_radps")
"""The state that motion couples; size follows it in a track's row."""

_D = len(NAMES)
_HEADING, _SPEED, _TURN = 2, 3, 4
_SIZE = _D + _D * _D
"""Where area, ratio and their variances stand in a track's row."""

_SMALL_TURN_RAD = 1e-4
"""Below it the derivative of sin(h)/h is taken from its series, -h/3, which is then exact to 1e-13."""


def ctrv_step(mean: FloatArray, dt_s: float) -> tuple[FloatArray, FloatArray]:
    """States and Jacobian after one step of constant turn rate and velocity.

    Args:
        mean: (M, 5) states in the order of NAMES.
        dt_s: Time step.

    Returns:
        (M, 5) states and (M, 5, 5) derivatives of the new state by the old.
    """
    yaw, speed, turn_rate = mean[:, _HEADING], mean[:, _SPEED], mean[:, _TURN]
    half = 0.5 * dt_s * turn_rate
    # the chord of the arc, v t sinc(w t / 2), points along the mean course; `change` is its derivative by w
    chord = dt_s * np.sinc(half / np.pi)
    small = np.abs(half) < _SMALL_TURN_RAD
    divisor = np.where(small, 1.0, half)
    change = np.where(small, -half / 3.0, (np.cos(half) - np.sinc(half / np.pi)) / divisor)
    c, s = np.cos(yaw + half), np.sin(yaw + half)
    moved = mean.copy()
    moved[:, 0] += speed * chord * c
    moved[:, 1] += speed * chord * s
    moved[:, _HEADING] += dt_s * turn_rate
    jacobian = np.zeros((len(mean), _D, _D))
    jacobian[:, range(_D), range(_D)] = 1.0
    jacobian[:, 0, _HEADING] = -speed * chord * s
    jacobian[:, 1, _HEADING] = speed * chord * c
    jacobian[:, 0, _SPEED] = chord * c
    jacobian[:, 1, _SPEED] = chord * s
    stretch, swing = 0.5 * dt_s**2 * speed * change, 0.5 * dt_s * speed * chord
    jacobian[:, 0, _TURN] = stretch * c - swing * s
    jacobian[:, 1, _TURN] = stretch * s + swing * c
    jacobian[:, _HEADING, _TURN] = dt_s
    return moved, jacobian


class TurnFilter:
    """Constant turn rate and velocity.

    Args:
        motion: Process noise.
        config: Measurement noise and initial uncertainty.
    """

    def __init__(self, motion: ConstantTurnRate, config: BevFilterConfig) -> None:
        self._config = config
        self._noise = config.measurement_variance()
        self._initial_rates = config.initial_rate_variance()
        self._velocity_noise = table(config.velocity_sigma_mps) ** 2
        self._speed_density = table(motion.accel_m2ps3)
        self._turn_density = table(motion.yaw_rate_rad2ps3)
        self._position_density = table(motion.position_m2ps)
        self._size_density = np.stack((table(motion.area_m4ps), table(motion.ratio_ps)), axis=-1)
        self._measured = [0, 1, _HEADING] if config.use_yaw else [0, 1]

    @property
    def widths(self) -> tuple[int, ...]:
        """State, covariance, area and ratio with their variances; x and y are correlated in any case."""
        return (_SIZE + 4,)

    @property
    def names(self) -> tuple[str, ...]:
        """The coupled entries."""
        return NAMES

    def widened(self, state: FloatArray) -> FloatArray:
        """The states, which have room for correlated noise; see `BoxFilter`."""
        return state

    def born(
        self,
        measurement: FloatArray,
        velocity_mps: FloatArray | None,
        code: IntArray,
        pose_covariance: FloatArray | None = None,
    ) -> FloatArray:
        """(N, W) states from one measurement each; see `BoxFilter`."""
        state = np.zeros((len(measurement), _SIZE + 4))
        state[:, [0, 1, _HEADING]] = measurement[:, [X, Y, YAW]]
        covariance = self._covariance(state)
        noise, shared = measurement_noise(self._noise[code], pose_covariance)
        variance = self._config.initial_factor * noise
        covariance[:, 0, 0], covariance[:, 1, 1] = variance[:, X], variance[:, Y]
        if shared is not None:
            covariance[:, 0, 1] = covariance[:, 1, 0] = self._config.initial_factor * shared
        covariance[:, _HEADING, _HEADING] = variance[:, YAW]
        covariance[:, _SPEED, _SPEED] = self._initial_rates[code, X]
        covariance[:, _TURN, _TURN] = self._initial_rates[code, YAW]
        state[:, _SIZE : _SIZE + 2] = measurement[:, [AREA, RATIO]]
        state[:, _SIZE + 2 :] = variance[:, [AREA, RATIO]]
        if velocity_mps is not None and self._config.use_velocity:
            self._measure_velocity(state, velocity_mps, code)
        return state

    def predict(self, state: FloatArray, code: IntArray, dt_s: float) -> FloatArray:
        """(M, W) states dt_s later; see `BoxFilter`."""
        predicted = state.copy()
        mean, jacobian = ctrv_step(state[:, :_D], dt_s)
        predicted[:, :_D] = mean
        spread = jacobian @ self._covariance(state) @ np.swapaxes(jacobian, 1, 2)
        spread += self.process_noise(state[:, :_D], code, dt_s)
        self._covariance(predicted)[:] = spread
        predicted[:, _SIZE + 2 :] += dt_s * self._size_density[code]
        return predicted

    def process_noise(self, mean: FloatArray, code: IntArray, dt_s: float) -> FloatArray:
        """(M, 5, 5) covariance of white noise on speed, turn rate and position over the step.

        Args:
            mean: (M, 5) states before the step.
            code: (M,) positions in CATEGORIES.
            dt_s: Time step.
        """
        # noise on the speed moves the position along the mean course; speed and turn rate are integrated once
        course = mean[:, _HEADING] + 0.5 * dt_s * mean[:, _TURN]
        along = np.zeros((len(mean), _D))
        along[:, 0], along[:, 1] = np.cos(course), np.sin(course)
        noise = np.zeros((len(mean), _D, _D))
        speed, turn = self._speed_density[code], self._turn_density[code]
        noise += (speed * dt_s**3 / 3.0)[:, None, None] * along[:, :, None] * along[:, None, :]
        noise[:, 0, 0] += self._position_density[code] * dt_s
        noise[:, 1, 1] += self._position_density[code] * dt_s
        noise[:, :, _SPEED] += (speed * dt_s**2 / 2.0)[:, None] * along
        noise[:, _SPEED, :] += (speed * dt_s**2 / 2.0)[:, None] * along
        noise[:, _SPEED, _SPEED] = speed * dt_s
        noise[:, _HEADING, _HEADING] = turn * dt_s**3 / 3.0
        noise[:, _HEADING, _TURN] = noise[:, _TURN, _HEADING] = turn * dt_s**2 / 2.0
        noise[:, _TURN, _TURN] = turn * dt_s
        return noise

    def update(
        self,
        state: FloatArray,
        measurement: FloatArray,
        velocity_mps: FloatArray | None,
        code: IntArray,
        pose_covariance: FloatArray | None = None,
    ) -> FloatArray:
        """(N, W) states after a measurement each; see `BoxFilter`."""
        config = self._config
        noise, shared = measurement_noise(self._noise[code], pose_covariance)
        corrected = state.copy()
        measured = self._measured
        innovation = measurement[:, [X, Y, YAW]] - state[:, [0, 1, _HEADING]]
        innovation[:, 2] = heading_innovation(measurement[:, YAW], state[:, _HEADING])
        k = len(measured)
        variance = np.zeros((len(state), k, k))
        variance[:, range(k), range(k)] = noise[:, [X, Y, YAW][:k]]
        if shared is not None:
            variance[:, 0, 1] = variance[:, 1, 0] = shared
        mean, covariance = update(state[:, :_D], self._covariance(state), innovation[:, :k], variance)
        corrected[:, :_D] = mean
        self._covariance(corrected)[:] = covariance
        size, spread = corrected[:, _SIZE : _SIZE + 2], corrected[:, _SIZE + 2 :]
        # area and ratio are scalars of their own, without rates
        gain = spread / (spread + noise[:, [AREA, RATIO]]) if config.use_size else np.ones_like(spread)
        size += gain * (measurement[:, [AREA, RATIO]] - size)
        spread *= 1.0 - gain
        if velocity_mps is not None and config.use_velocity:
            self._measure_velocity(corrected, velocity_mps, code)
        if config.heading == "detector":
            self.turn_round(corrected, np.cos(measurement[:, YAW] - corrected[:, _HEADING]) < 0.0)
        elif config.heading == "motion":
            self.turn_round(corrected, corrected[:, _SPEED] < -BACKWARDS_MPS)
        return corrected

    def _measure_velocity(self, state: FloatArray, velocity_mps: FloatArray, code: IntArray) -> None:
        """Correct by measured velocities, in place; rows of NaN measure nothing."""
        known = np.flatnonzero(np.isfinite(velocity_mps).all(axis=1))
        if len(known) == 0:
            return
        part = state[known]
        speed, c, s = part[:, _SPEED], np.cos(part[:, _HEADING]), np.sin(part[:, _HEADING])
        # H is the derivative of (v cos yaw, v sin yaw) by heading and speed
        measures = np.zeros((len(known), 2, _D))
        measures[:, 0, _HEADING], measures[:, 0, _SPEED] = -speed * s, c
        measures[:, 1, _HEADING], measures[:, 1, _SPEED] = speed * c, s
        innovation = velocity_mps[known] - np.stack((speed * c, speed * s), axis=-1)
        noise = self._velocity_noise[code[known], None, None] * np.eye(2)
        mean, covariance = update(part[:, :_D], self._covariance(part), innovation, noise, measures)
        state[known, :_D] = mean
        state[known, _D:_SIZE] = covariance.reshape(len(known), -1)

    def turn_round(self, state: FloatArray, which: BoolArray) -> None:
        """Let tracks face the other way, in place: the speed and what it is correlated with change sign."""
        rows = np.flatnonzero(which)
        if len(rows) == 0:
            return
        state[rows, _HEADING] += np.pi
        state[rows, _SPEED] *= -1.0
        covariance = state[rows, _D:_SIZE].reshape(-1, _D, _D)
        covariance[:, _SPEED, :] *= -1.0
        covariance[:, :, _SPEED] *= -1.0
        state[rows, _D:_SIZE] = covariance.reshape(len(rows), -1)

    def estimate(self, state: FloatArray) -> Estimate:
        """Boxes and velocities that (M, W) states say."""
        yaw, speed = state[:, _HEADING], state[:, _SPEED]
        return Estimate(
            center_m=state[:, :2],
            size_m=sizes(state[:, _SIZE], state[:, _SIZE + 1]),
            yaw_rad=yaw,
            velocity_mps=np.stack((speed * np.cos(yaw), speed * np.sin(yaw)), axis=-1),
            yaw_rate_radps=state[:, _TURN],
        )

    def motion(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M,) headings and (M, 2) velocities; see `BoxFilter`."""
        estimate = self.estimate(state)
        return estimate.yaw_rad, estimate.velocity_mps

    def position_covariance(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(M,) variances along x and along y, and the covariance of the two."""
        covariance = self._covariance(state)
        return covariance[:, 0, 0], covariance[:, 1, 1], covariance[:, 0, 1]

    def speed_variance(self, state: FloatArray) -> FloatArray:
        """(M,) variance of the velocity along one axis, mean of the two."""
        covariance = self._covariance(state)
        sideways = state[:, _SPEED] ** 2 * covariance[:, _HEADING, _HEADING]
        variance: FloatArray = 0.5 * (covariance[:, _SPEED, _SPEED] + sideways)
        return variance

    def moments(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M, D) means and (M, D, D) covariances of the entries in `names`."""
        return state[:, :_D].copy(), self._covariance(state).copy()

    def _covariance(self, state: FloatArray) -> FloatArray:
        """(M, 5, 5) view of the covariances."""
        return state[:, _D:_SIZE].reshape(len(state), _D, _D)
