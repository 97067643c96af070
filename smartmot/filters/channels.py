"""The linear box filter: five independent channels in closed form.

With linear motion and independent measurements x, y, area, ratio and heading never become correlated, so the
Kalman filter of all nine or eleven state entries falls into five of two or three. Each is a row of numbers:
the mean (value, rate, ...) and the upper triangle of the covariance. Prediction is then one matrix product
for all rows of all tracks, and the gain a division. The tests compare with the full filter.

Where a detector states noise that x and y share, the two become correlated: states then are K * K entries
wider, the covariance of x and its derivatives with y and its own, and x and y are corrected together.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from smartmot.filters.kalman import (
    BACKWARDS_MPS,
    BevFilterConfig,
    Estimate,
    fold,
    measurement_noise,
    sizes,
    update,
)
from smartmot.filters.motion_models import (
    AREA,
    CHANNELS,
    RATIO,
    YAW,
    ConstantAcceleration,
    DecayingAcceleration,
    LinearMotion,
    X,
    Y,
    table,
    unit_noise,
)
from smartmot.types import BoolArray, FloatArray, IntArray

_RATED = [X, Y, AREA, YAW]
"""Channels whose rate is part of the state as users see it; the ratio is constant."""


_STEPS = 32
"""Time steps that are remembered: stamps k * 0.1 s differ by a dozen values, measured ones always."""


class ChannelFilter:
    """Constant velocity or constant acceleration.

    Args:
        motion: Motion model.
        config: Noise and initial uncertainty.
    """

    def __init__(self, motion: LinearMotion, config: BevFilterConfig) -> None:
        self._motion, self._config = motion, config
        self._densities = motion.densities()
        k = self._k = motion.order
        self._upper = np.triu_indices(k)
        self._cross = k + self._upper[1]
        self._parts = k + len(self._upper[0])
        self._width = len(CHANNELS) * self._parts
        # Out of all K * K entries of a covariance the upper triangle, and the reverse.
        i, j = self._upper
        pick = np.eye(k * k)[i * k + j]
        self._triangle = pick, np.maximum(pick, np.eye(k * k)[j * k + i]).T
        self._noise = config.measurement_variance()
        self._velocity_noise = table(config.velocity_sigma_mps) ** 2
        self._initial = self._initial_covariance()
        self._copied = [
            c
            for c, used in ((AREA, config.use_size), (RATIO, config.use_size), (YAW, config.use_yaw))
            if not used
        ]
        self._places = _places(k)
        self._steps: dict[float, tuple[FloatArray, FloatArray]] = {}

    @property
    def widths(self) -> tuple[int, ...]:
        """Five channels of mean and upper triangle; the same and the covariance of x with y."""
        return self._width, self._width + self._k * self._k

    @property
    def names(self) -> tuple[str, ...]:
        """Values, their rates, and the accelerations where the model has them."""
        rates = ("vx_mps", "vy_mps", "area_rate_m2ps", "yaw_rate_radps")
        return CHANNELS + rates + (("ax_mps2", "ay_mps2") if self._k == 3 else ())

    def _initial_covariance(self) -> FloatArray:
        """(C, 5, T) upper triangles of a new track's covariance."""
        variances = [self._config.initial_factor * self._noise, self._config.initial_rate_variance()]
        if isinstance(self._motion, ConstantAcceleration | DecayingAcceleration):
            acceleration = np.zeros_like(self._noise)
            acceleration[:, :AREA] = table(self._motion.initial_acceleration_mps2)[:, None] ** 2
            variances.append(acceleration)
        i, j = self._upper
        covariance: FloatArray = np.stack(variances, axis=-1)[..., i] * (i == j)
        return covariance

    def _step(self, dt_s: float) -> tuple[FloatArray, FloatArray]:
        """(parts, parts) matrix and (C, 5, parts) offset that carry mean and upper triangle over dt_s."""
        known = self._steps.get(dt_s)
        if known is not None:
            return known
        f, k = self._motion.transition(dt_s), self._k
        pick, spread = self._triangle
        matrix = np.zeros((self._parts, self._parts))
        matrix[:k, :k] = f
        # F P F^T, from upper triangle to upper triangle.
        matrix[k:, k:] = pick @ (f[:, None, :, None] * f[:, None, :]).reshape(k * k, k * k) @ spread
        offset = np.zeros((*self._noise.shape, self._parts))
        if isinstance(self._motion, DecayingAcceleration):
            unit = self._motion.unit_noise(dt_s)
        else:
            unit = unit_noise(k, dt_s)
        offset[..., k:] = self._densities @ unit.reshape(k, k * k) @ pick.T
        if len(self._steps) == _STEPS:
            self._steps.clear()
        step = self._steps[dt_s] = matrix.T.copy(), offset
        return step

    def _channels(self, state: FloatArray) -> FloatArray:
        """(M, 5, parts) view of the states."""
        return state[:, : self._width].reshape(len(state), len(CHANNELS), self._parts)

    def widened(self, state: FloatArray) -> FloatArray:
        """(M, V) states with room for the covariance of x with y; see `BoxFilter`."""
        if state.shape[1] > self._width:
            return state
        return np.hstack((state, np.zeros((len(state), self._k * self._k))))

    def born(
        self,
        measurement: FloatArray,
        velocity_mps: FloatArray | None,
        code: IntArray,
        pose_covariance: FloatArray | None = None,
    ) -> FloatArray:
        """(N, W) states from one measurement each; see `BoxFilter`."""
        state = np.zeros((len(measurement), self._width))
        channels = self._channels(state)
        channels[..., 0] = measurement
        channels[..., self._k :] = self._initial[code]
        shared = None
        if pose_covariance is not None:
            noise, shared = measurement_noise(self._noise.take(code, axis=0), pose_covariance)
            channels[..., self._k] = self._config.initial_factor * noise
        if shared is not None:
            state = self.widened(state)
            state[:, self._width] = self._config.initial_factor * shared
        if velocity_mps is not None and self._config.use_velocity:
            self._measure_velocity(state, velocity_mps, code)
        return state

    def predict(self, state: FloatArray, code: IntArray, dt_s: float) -> FloatArray:
        """(M, W) states dt_s later; see `BoxFilter`."""
        if state.shape[1] > self._width:
            f, k = self._motion.transition(dt_s), self._k
            own = self.predict(state[:, : self._width], code, dt_s)
            # the noise of the motion along x and along y has nothing in common
            shared = f @ state[:, self._width :].reshape(-1, k, k) @ f.T
            return np.hstack((own, shared.reshape(-1, k * k)))
        matrix, noise = self._step(dt_s)
        moved = state.reshape(-1, self._parts) @ matrix
        moved += noise.take(code, axis=0).reshape(-1, self._parts)
        return moved.reshape(state.shape)

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
        noise, shared = measurement_noise(self._noise.take(code, axis=0), pose_covariance)
        if shared is not None or state.shape[1] > self._width:
            corrected = self._corrected_together(self.widened(state), measurement, noise, shared)
        else:
            corrected = self._corrected(state, measurement, noise)
        channels = self._channels(corrected)
        if velocity_mps is not None and config.use_velocity:
            self._measure_velocity(corrected, velocity_mps, code)
        if self._copied:
            channels[:, self._copied, 0] = measurement[:, self._copied]
            channels[:, self._copied, 1] = 0.0
        if config.heading == "detector":
            # the innovation is modulo half a turn, so that the filter may face the other way
            off = np.cos(measurement[:, YAW] - channels[:, YAW, 0]) < 0.0
            if np.count_nonzero(off):
                channels[off, YAW, 0] += np.pi
        elif config.heading == "motion":
            yaw = channels[:, YAW, 0]
            forward = channels[:, X, 1] * np.cos(yaw) + channels[:, Y, 1] * np.sin(yaw)
            channels[forward < -BACKWARDS_MPS, YAW, 0] += np.pi
        return corrected

    def _corrected(self, state: FloatArray, measurement: FloatArray, noise: FloatArray) -> FloatArray:
        """(N, W) states after measurements whose noise (N, 5) is independent."""
        k, i = self._k, self._upper[0]
        corrected = state.copy()
        channels = self._channels(corrected)
        # One row for each channel of each track: arrays of two dimensions take less time than of three.
        rows = corrected.reshape(-1, self._parts)
        innovation = measurement - channels[..., 0]
        fold(innovation[:, YAW])
        # The first row of the covariance, from the value's variance on.
        gain = rows[:, k : 2 * k] / (rows[:, k : k + 1] + noise.reshape(-1, 1))
        # one scalar is measured: the mean moves by K y, the upper triangle of P falls by K (H P), of rank one
        fall = gain.take(i, axis=1)
        fall *= rows.take(self._cross, axis=1)
        gain *= innovation.reshape(-1, 1)
        rows[:, :k] += gain
        rows[:, k:] -= fall
        return corrected

    def _corrected_together(
        self, state: FloatArray, measurement: FloatArray, noise: FloatArray, shared: FloatArray | None
    ) -> FloatArray:
        """(N, V) states after measurements whose noise along x and y has `shared` (N,) in common."""
        k = self._k
        corrected = np.hstack(
            (self._corrected(state[:, : self._width], measurement, noise), state[:, self._width :])
        )
        mean, covariance = self._planar(state)
        joint = np.zeros((len(state), 2, 2))
        joint[:, 0, 0], joint[:, 1, 1] = noise[:, X], noise[:, Y]
        if shared is not None:
            joint[:, 0, 1] = joint[:, 1, 0] = shared
        measures = np.zeros((2, 2 * k))
        measures[0, 0] = measures[1, k] = 1.0
        innovation = measurement[:, :AREA] - mean[:, ::k]
        self._put_planar(corrected, *update(mean, covariance, innovation, joint, measures))
        return corrected

    def _planar(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Of wide states: (N, 2K) x and its derivatives, then y and its own; (N, 2K, 2K) covariances."""
        k, (i, j), channels = self._k, self._upper, self._channels(state)
        mean = channels[:, :AREA, :k].reshape(len(state), 2 * k)
        covariance = np.empty((len(state), 2 * k, 2 * k))
        for axis in (X, Y):
            block = covariance[:, axis * k : (axis + 1) * k, axis * k : (axis + 1) * k]
            block[:, i, j] = block[:, j, i] = channels[:, axis, k:]
        covariance[:, :k, k:] = state[:, self._width :].reshape(-1, k, k)
        covariance[:, k:, :k] = np.swapaxes(covariance[:, :k, k:], 1, 2)
        return mean, covariance

    def _put_planar(self, state: FloatArray, mean: FloatArray, covariance: FloatArray) -> None:
        """Write what `_planar` reads, in place."""
        k, (i, j), channels = self._k, self._upper, self._channels(state)
        channels[:, :AREA, :k] = mean.reshape(-1, 2, k)
        for axis in (X, Y):
            channels[:, axis, k:] = covariance[:, axis * k + i, axis * k + j]
        state[:, self._width :] = covariance[:, :k, k:].reshape(-1, k * k)

    def turn_round(self, state: FloatArray, which: BoolArray) -> None:
        """Let tracks face the other way, in place; see `BoxFilter`."""
        self._channels(state)[which, YAW, 0] += np.pi

    def _measure_velocity(self, state: FloatArray, velocity_mps: FloatArray, code: IntArray) -> None:
        """Correct x and y by measured velocities, in place; rows of NaN measure nothing."""
        k, (i, j) = self._k, self._upper
        known = np.flatnonzero(np.isfinite(velocity_mps).all(axis=1))
        if len(known) == 0:
            return
        noise = self._velocity_noise[code[known]]
        if state.shape[1] > self._width:
            wide = state[known]
            mean, covariance = self._planar(wide)
            measures = np.zeros((2, 2 * k))
            measures[0, 1] = measures[1, k + 1] = 1.0
            innovation = velocity_mps[known] - mean[:, 1::k]
            joint = noise[:, None, None] * np.eye(2)
            self._put_planar(wide, *update(mean, covariance, innovation, joint, measures))
            state[known] = wide
            return
        channels = self._channels(state)
        part = channels[known, :AREA]
        # Row 1 of the symmetric covariance.
        row = [k + int(np.flatnonzero((i == min(1, c)) & (j == max(1, c)))[0]) for c in range(k)]
        cross = part[..., row]
        # as in `_corrected`, with the rate as the scalar that is measured
        gain = cross / (cross[..., 1:2] + noise[:, None, None])
        part[..., :k] += gain * (velocity_mps[known] - part[..., 1])[..., None]
        part[..., k:] -= gain[..., i] * cross[..., j]
        channels[known, :AREA] = part

    def estimate(self, state: FloatArray) -> Estimate:
        """Boxes and velocities that (M, W) states say."""
        channels = self._channels(state)
        value, rate = channels[..., 0], channels[..., 1]
        return Estimate(
            center_m=value[:, :AREA],
            size_m=sizes(value[:, AREA], value[:, RATIO]),
            yaw_rad=value[:, YAW],
            velocity_mps=rate[:, :AREA],
            yaw_rate_radps=rate[:, YAW],
        )

    def motion(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M,) headings and (M, 2) velocities; see `BoxFilter`."""
        channels = self._channels(state)
        return channels[:, YAW, 0], channels[:, :AREA, 1]

    def position_covariance(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(M,) variances along x and along y, and the covariance of the two."""
        variance = self._channels(state)[:, :AREA, self._k]
        wide = state.shape[1] > self._width
        return variance[:, X], variance[:, Y], state[:, self._width] if wide else np.zeros(len(state))

    def speed_variance(self, state: FloatArray) -> FloatArray:
        """(M,) variance of the velocity along one axis, mean of the two."""
        variance = self._channels(state)[:, :AREA, 2 * self._k]
        return 0.5 * (variance[:, X] + variance[:, Y])

    def moments(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M, D) means and (M, D, D) covariances of the entries in `names`."""
        mean_from, covariance_from = self._places
        d, k = len(mean_from), self._k
        covariance = state.take(covariance_from, axis=1).reshape(-1, d, d)
        if state.shape[1] > self._width:
            along_x = np.flatnonzero(mean_from < k)
            along_y = np.flatnonzero((mean_from >= self._parts) & (mean_from < self._parts + k))
            shared = state[:, self._width :].reshape(-1, k, k)
            covariance[np.ix_(np.arange(len(state)), along_x, along_y)] = shared
            covariance[np.ix_(np.arange(len(state)), along_y, along_x)] = np.swapaxes(shared, 1, 2)
        return state.take(mean_from, axis=1), covariance


@lru_cache(maxsize=4)
def _places(k: int) -> tuple[IntArray, IntArray]:
    """Where the entries (D,) of the mean and (D * D,) of the covariance stand in a state.

    The ratio has no rate, so its covariance with its rate stands for all entries between channels: it is 0.
    """
    i, j = np.triu_indices(k)
    parts = k + len(i)

    def place(channel: int, first: int, second: int) -> int:
        entry = (i == min(first, second)) & (j == max(first, second))
        return channel * parts + k + int(np.flatnonzero(entry)[0])

    entries = [(channel, 0) for channel in range(len(CHANNELS))] + [(channel, 1) for channel in _RATED]
    if k == 3:
        entries += [(X, 2), (Y, 2)]
    zero = place(RATIO, 0, 1)
    covariance_from = [place(a[0], a[1], b[1]) if a[0] == b[0] else zero for a in entries for b in entries]
    return np.array([channel * parts + derivative for channel, derivative in entries]), np.array(
        covariance_from
    )
