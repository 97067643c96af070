"""Any filter of filterpy as the track filter: Kalman, extended, unscented, cubature, interacting models.

The tracker keeps states as arrays, so that they can be saved and resumed. The adapter therefore keeps one
filter of each category, loads mean and covariance of a track into it for a step, and takes them out again.
It is as slow as filterpy, some tenths of a millisecond a track; the shipped filters step all tracks at once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from itertools import pairwise
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np

from smartmot.errors import ConfigError, PluginError, SmartMotError
from smartmot.filters.kalman import (
    BACKWARDS_MPS,
    BevFilterConfig,
    Estimate,
    heading_innovation,
    measurement_noise,
    sizes,
    update,
)
from smartmot.filters.motion_models import AREA, RATIO, YAW, X, Y, table
from smartmot.filters.turn import NAMES as TURN_NAMES
from smartmot.types import CATEGORIES, BoolArray, FloatArray, IntArray

LINEAR_NAMES = (
    "x_m", "y_m", "area_m2", "ratio", "yaw_rad", "vx_mps", "vy_mps", "area_rate_m2ps", "yaw_rate_radps",
    "ax_mps2", "ay_mps2",
)  # fmt: skip
"""Entries of a track's mean where the filter's state has velocities along x and y."""

_T = TypeVar("_T")

_SHAPE = (AREA, RATIO, YAW)
_SHAPE_DENSITY = np.array([0.05, 0.05, 0.05])
"""Densities of the noise on area, ratio and heading where they are filtered by themselves: those of
`ConstantVelocity` for the shape, and a heading that turns by a quarter of a radian in a second."""


@runtime_checkable
class FilterpyMotion(Protocol):
    """A motion model for `TrackerConfig.motion` whose filter is one of filterpy's, or works like one.

    Where a correction is more than `filter.update(measurement)`, it has `correct(filter, measurement)` too.
    """

    @property
    def names(self) -> tuple[str, ...]:
        """What the state's entries are: x_m and y_m, and vx_mps and vy_mps or yaw_rad and speed_mps.

        Known too: yaw_rad (then the heading is the third measurement), yaw_rate_radps, ax_mps2 and ay_mps2.
        Entries with other names are left to the filter.
        """
        ...

    def make(self, category: str, config: BevFilterConfig) -> Any:
        """A filter for a new track, which measures x, y and, if it is in the state, the heading.

        Args:
            category: One of `smartmot.types.CATEGORIES`.
            config: Noise of the measurements and uncertainty of a new track.

        Returns:
            A filter with `x`, `P`, `predict` and `update`, as it is before the first measurement: that is put
            into its `x`. An `IMMEstimator` has `filters` and `mu` besides.
        """
        ...

    def advance(self, tracked: Any, dt_s: float) -> None:
        """Predict a filter that `make` made, in place.

        Args:
            tracked: The filter, with the track's mean and covariance.
            dt_s: Time step, seconds.
        """
        ...


class FilterpyFilter:
    """A `BoxFilter` of filters of filterpy. Area and aspect ratio are filtered on their own, without rates.

    Args:
        motion: What makes and moves the filters.
        config: Noise and initial uncertainty.

    Raises:
        ConfigError: The names or the filter are not as `FilterpyMotion` asks.
    """

    def __init__(self, motion: FilterpyMotion, config: BevFilterConfig) -> None:
        self._motion, self._config = motion, config
        self._correct: Callable[[Any, FloatArray], None] = getattr(motion, "correct", _update)
        self._entry = _entries(motion.names)
        self._n = len(motion.names)
        self._filters = [self._made(category) for category in CATEGORIES]
        self._models = len(_models_of(self._filters[0]))
        counts = [len(_models_of(made)) for made in self._filters]
        if set(counts) != {self._models}:
            raise ConfigError(
                f"TrackerConfig.motion: filters of all categories need as many models, got {counts}"
            )
        self._polar = "speed_mps" in self._entry
        self._measured = [self._entry[name] for name in ("x_m", "y_m", "yaw_rad") if name in self._entry]
        self._noise = config.measurement_variance()
        self._velocity_noise = table(config.velocity_sigma_mps) ** 2
        sizes_of = (self._models * self._n, self._models * self._n**2, self._models, 2 * len(_SHAPE))
        ends: list[int] = np.cumsum((0, *sizes_of)).tolist()
        self._means, self._covariances, self._weights, self._shape = (slice(a, b) for a, b in pairwise(ends))
        self._width = ends[-1]
        self._fresh = np.zeros((len(CATEGORIES), self._width))
        for row, made in zip(self._fresh, self._filters, strict=True):
            self._take(row, made)
        self._fresh = self._fresh[:, : self._shape.start]

    def _made(self, category: str) -> Any:
        """The filter of a category, checked."""
        made = self._called(partial(self._motion.make, category, self._config))
        kind = type(made).__name__
        if hasattr(made, "filters") and not hasattr(made, "mu"):
            raise ConfigError(
                f"TrackerConfig.motion: {kind} for {category} has filters, but no probabilities mu"
            )
        for model in _models_of(made):
            if hasattr(model, "sigmas") or not _holds_moments(model):
                raise ConfigError(
                    f"TrackerConfig.motion: {type(model).__name__} for {category} does not keep its state in "
                    "x and P; use a Kalman, extended, unscented or cubature filter, or several of them (IMM)"
                )
            mean, covariance = np.asarray(getattr(model, "x", ())), np.asarray(getattr(model, "P", ()))
            if mean.size != self._n or covariance.shape != (self._n, self._n):
                raise ConfigError(
                    f"TrackerConfig.motion: {self._n} names, but a filter for {category} with x of shape "
                    f"{mean.shape} and P of shape {covariance.shape}"
                )
        return made

    def _called(self, do: Callable[[], _T]) -> _T:
        """What a user's function returns; its errors with its name."""
        try:
            return do()
        except SmartMotError:
            raise
        except Exception as error:
            name = type(self._motion).__name__
            raise PluginError(f"motion {name}: failed with {type(error).__name__}: {error}") from error

    @property
    def widths(self) -> tuple[int, ...]:
        """Means, covariances and weights of the models; area, ratio and heading with their variances."""
        return (self._width,)

    @property
    def names(self) -> tuple[str, ...]:
        """Those of the turn filter for states with a speed, else those of the linear filters."""
        if self._polar:
            return TURN_NAMES
        return LINEAR_NAMES if "ax_mps2" in self._entry else LINEAR_NAMES[:9]

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
        state = np.zeros((len(measurement), self._width))
        noise, shared = measurement_noise(self._noise[code], pose_covariance)
        variance = self._config.initial_factor * noise
        state[:, self._shape] = np.concatenate((measurement[:, _SHAPE], variance[:, _SHAPE]), axis=1)
        state[:, : self._shape.start] = self._fresh[code]
        means, covariances = self._moments_of_models(state)
        means[..., self._measured] = measurement[:, None, [X, Y, YAW][: len(self._measured)]]
        if pose_covariance is not None:
            for entry, channel in zip(self._measured, (X, Y, YAW), strict=False):
                covariances[..., entry, entry] = variance[:, None, channel]
            if shared is not None:
                x, y = self._measured[:2]
                both = self._config.initial_factor * shared[:, None]
                covariances[..., x, y] = covariances[..., y, x] = both
        self._put_moments(state, slice(None), means, covariances)
        if velocity_mps is not None and self._config.use_velocity:
            self._measure_velocity(state, velocity_mps, code)
        return state

    def predict(self, state: FloatArray, code: IntArray, dt_s: float) -> FloatArray:
        """(M, W) states dt_s later; see `BoxFilter`."""
        predicted = state.copy()
        for row, category in enumerate(code.tolist()):
            tracked = self._loaded(predicted[row], self._filters[category])
            self._called(partial(self._motion.advance, tracked, dt_s))
            self._take(predicted[row], tracked)
            if self._models > 1:  # the models may have changed over the step
                predicted[row, self._weights] = tracked.mu @ tracked.M
        predicted[:, self._shape][:, len(_SHAPE) :] += dt_s * _SHAPE_DENSITY
        return predicted

    def update(
        self,
        state: FloatArray,
        measurement: FloatArray,
        velocity_mps: FloatArray | None,
        code: IntArray,
        pose_covariance: FloatArray | None = None,
    ) -> FloatArray:
        """(N, W) states after a measurement each; see `BoxFilter`."""
        noise, shared = measurement_noise(self._noise[code], pose_covariance)
        corrected = state.copy()
        heading = self.estimate(state).yaw_rad
        z = measurement[:, [X, Y, YAW][: len(self._measured)]].copy()
        turned = heading_innovation(measurement[:, YAW], heading)
        z[:, 2:] = (heading + turned)[:, None]  # the measured heading nearest to the track's, front or rear
        no_change = np.eye(self._models)
        for row, category in enumerate(code.tolist()):
            tracked = self._loaded(corrected[row], self._filters[category], no_change)
            models = _models_of(tracked)
            usual = [model.R for model in models]
            for model in models:
                _redraw(model)
                if pose_covariance is not None:
                    model.R = self._stated(model.R, noise[row], 0.0 if shared is None else shared[row])
            self._called(partial(self._correct, tracked, z[row]))
            self._take(corrected[row], tracked)
            for model, of_category in zip(models, usual, strict=True):
                model.R = of_category
        self._measure_shape(corrected, measurement, turned, noise)
        if velocity_mps is not None and self._config.use_velocity:
            self._measure_velocity(corrected, velocity_mps, code)
        estimate = self.estimate(corrected)
        if self._config.heading == "detector":
            self.turn_round(corrected, np.cos(measurement[:, YAW] - estimate.yaw_rad) < 0.0)
        elif self._config.heading == "motion":
            facing = np.stack((np.cos(estimate.yaw_rad), np.sin(estimate.yaw_rad)), axis=-1)
            self.turn_round(corrected, (estimate.velocity_mps * facing).sum(axis=1) < -BACKWARDS_MPS)
        return corrected

    def _stated(self, usual: FloatArray, noise: FloatArray, shared: float) -> FloatArray:
        """Noise of a detection that states its own, for a filter of the measured entries.

        Raises:
            ConfigError: The filter measures something else.
        """
        count = len(self._measured)
        if np.shape(usual) != (count, count):
            raise ConfigError(
                f"TrackerConfig.motion: detections state their noise: R must be {count} x {count}, got "
                f"{np.shape(usual)}"
            )
        stated = np.diag(noise[[X, Y, YAW][:count]])
        stated[0, 1] = stated[1, 0] = shared
        return stated

    def _measure_shape(
        self, state: FloatArray, measurement: FloatArray, turned_rad: FloatArray, noise: FloatArray
    ) -> None:
        """Area, ratio and heading, each a scalar of its own, in place."""
        config, shape = self._config, state[:, self._shape]
        value, variance = shape[:, : len(_SHAPE)], shape[:, len(_SHAPE) :]
        filtered = np.array([config.use_size, config.use_size, config.use_yaw])
        gain = np.where(filtered, variance / (variance + noise[:, _SHAPE]), 1.0)
        innovation = measurement[:, _SHAPE] - value
        innovation[:, 2] = turned_rad
        value += gain * innovation
        variance *= 1.0 - gain

    def _measure_velocity(self, state: FloatArray, velocity_mps: FloatArray, code: IntArray) -> None:
        """Correct every model by measured velocities, in place; rows of NaN measure nothing."""
        rows = np.flatnonzero(np.isfinite(velocity_mps).all(axis=1))
        if len(rows) == 0:
            return
        means, covariances = self._moments_of_models(state[rows])
        noise = self._velocity_noise[code[rows], None, None] * np.eye(2)
        for k in range(self._models):
            mean, covariance = means[:, k], covariances[:, k]
            measures = self._velocity_jacobian(mean)
            innovation = velocity_mps[rows] - self._velocity(mean)
            means[:, k], covariances[:, k] = update(mean, covariance, innovation, noise, measures)
        self._put_moments(state, rows, means, covariances)

    def _velocity(self, mean: FloatArray) -> FloatArray:
        """(M, 2) velocities that (M, n) means say."""
        if not self._polar:
            return mean[:, [self._entry["vx_mps"], self._entry["vy_mps"]]]
        speed, yaw = mean[:, self._entry["speed_mps"]], mean[:, self._entry["yaw_rad"]]
        return np.stack((speed * np.cos(yaw), speed * np.sin(yaw)), axis=-1)

    def _velocity_jacobian(self, mean: FloatArray) -> FloatArray:
        """(M, 2, n) derivatives of the velocity by the state."""
        jacobian = np.zeros((len(mean), 2, self._n))
        if not self._polar:
            jacobian[:, [0, 1], [self._entry["vx_mps"], self._entry["vy_mps"]]] = 1.0
            return jacobian
        velocity, yaw = self._velocity(mean), mean[:, self._entry["yaw_rad"]]
        jacobian[:, 0, self._entry["speed_mps"]] = np.cos(yaw)
        jacobian[:, 1, self._entry["speed_mps"]] = np.sin(yaw)
        jacobian[:, 0, self._entry["yaw_rad"]] = -velocity[:, 1]
        jacobian[:, 1, self._entry["yaw_rad"]] = velocity[:, 0]
        return jacobian

    def turn_round(self, state: FloatArray, which: BoolArray) -> None:
        """Let tracks face the other way, in place; see `BoxFilter`."""
        rows = np.flatnonzero(which)
        if len(rows) == 0:
            return
        shape = state[rows, self._shape]
        shape[:, 2] += np.pi
        state[rows, self._shape] = shape
        if "yaw_rad" not in self._entry:
            return
        means, covariances = self._moments_of_models(state[rows])
        means[..., self._entry["yaw_rad"]] += np.pi
        if self._polar:
            speed = self._entry["speed_mps"]
            means[..., speed] *= -1.0
            covariances[..., speed, :] *= -1.0
            covariances[..., :, speed] *= -1.0
        self._put_moments(state, rows, means, covariances)

    def estimate(self, state: FloatArray) -> Estimate:
        """Boxes and velocities that (M, W) states say."""
        mean, _ = self._combined(state)
        shape = state[:, self._shape]
        turn = self._entry.get("yaw_rate_radps")
        return Estimate(
            center_m=mean[:, self._measured[:2]],
            size_m=sizes(shape[:, 0], shape[:, 1]),
            yaw_rad=mean[:, self._entry["yaw_rad"]] if "yaw_rad" in self._entry else shape[:, 2].copy(),
            velocity_mps=self._velocity(mean),
            yaw_rate_radps=np.zeros(len(state)) if turn is None else mean[:, turn],
        )

    def motion(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M,) headings and (M, 2) velocities; see `BoxFilter`."""
        estimate = self.estimate(state)
        return estimate.yaw_rad, estimate.velocity_mps

    def position_covariance(self, state: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
        """(M,) variances along x and along y, and the covariance of the two."""
        _, covariance = self._combined(state)
        x, y = self._measured[:2]
        return covariance[:, x, x], covariance[:, y, y], covariance[:, x, y]

    def speed_variance(self, state: FloatArray) -> FloatArray:
        """(M,) variance of the velocity along one axis, mean of the two."""
        mean, covariance = self._combined(state)
        jacobian = self._velocity_jacobian(mean)
        of_velocity = jacobian @ covariance @ np.swapaxes(jacobian, 1, 2)
        variance: FloatArray = 0.5 * np.trace(of_velocity, axis1=1, axis2=2)
        return variance

    def moments(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M, D) means and (M, D, D) covariances of the entries in `names`; 0 where the filter has none."""
        mean, covariance = self._combined(state)
        places = [(to, self._entry[name]) for to, name in enumerate(self.names) if name in self._entry]
        to, origin = (np.array(column) for column in zip(*places, strict=True))
        d = len(self.names)
        means, covariances = np.zeros((len(state), d)), np.zeros((len(state), d, d))
        means[:, to] = mean[:, origin]
        covariances[:, to[:, None], to] = covariance[:, origin[:, None], origin]
        shape = state[:, self._shape]
        for k, name in enumerate(("area_m2", "ratio", "yaw_rad")):
            if name in self.names and name not in self._entry:
                entry = self.names.index(name)
                means[:, entry], covariances[:, entry, entry] = shape[:, k], shape[:, len(_SHAPE) + k]
        return means, covariances

    def _moments_of_models(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M, K, n) means and (M, K, n, n) covariances of the models."""
        m, k, n = len(state), self._models, self._n
        return state[:, self._means].reshape(m, k, n), state[:, self._covariances].reshape(m, k, n, n)

    def _put_moments(
        self, state: FloatArray, rows: IntArray | slice, means: FloatArray, covariances: FloatArray
    ) -> None:
        """Write what `_moments_of_models` reads into some rows, in place."""
        state[rows, self._means] = means.reshape(len(means), -1)
        state[rows, self._covariances] = covariances.reshape(len(means), -1)

    def _combined(self, state: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(M, n) means and (M, n, n) covariances of the mixture of the models."""
        means, covariances = self._moments_of_models(state)
        if self._models == 1:
            return means[:, 0], covariances[:, 0]
        weight = state[:, self._weights]
        mean = np.einsum("mk,mki->mi", weight, means)
        off = means - mean[:, None]
        spread = covariances + off[..., :, None] * off[..., None, :]
        return mean, np.einsum("mk,mkij->mij", weight, spread)

    def _loaded(self, row: FloatArray, tracked: Any, changes: FloatArray | None = None) -> Any:
        """A filter with the moments of a track; `changes` (K, K) in place of its own chances of a change."""
        means = row[self._means].reshape(self._models, self._n)
        covariances = row[self._covariances].reshape(self._models, self._n, self._n)
        models = _models_of(tracked)
        for model, mean, covariance in zip(models, means, covariances, strict=True):
            model.x, model.P = mean.reshape(np.shape(model.x)).copy(), covariance.copy()
        if self._models == 1:
            return tracked
        # a new estimator computes what follows from the weights; the old one has no function for it
        return type(tracked)(
            models, row[self._weights].copy(), np.array(tracked.M if changes is None else changes)
        )

    def _take(self, row: FloatArray, tracked: Any) -> None:
        """Put the moments of a filter into a track's row."""
        models = _models_of(tracked)
        row[self._means] = np.concatenate([np.ravel(model.x) for model in models])
        covariances = [np.asarray(model.P) for model in models]
        row[self._covariances] = np.concatenate([0.5 * (p + p.T).ravel() for p in covariances])
        row[self._weights] = tracked.mu if self._models > 1 else 1.0
        if not np.isfinite(row).all():
            name = type(self._motion).__name__
            raise PluginError(f"motion {name}: its filter has a state that is not finite")


def _update(tracked: Any, measurement: FloatArray) -> None:
    tracked.update(measurement)


def _models_of(tracked: Any) -> Sequence[Any]:
    """The filters of an estimator of several models, or the one filter."""
    return tuple(getattr(tracked, "filters", (tracked,)))


def _holds_moments(model: Any) -> bool:
    """Whether x and P of a filter can be set."""
    try:
        model.x, model.P = model.x, model.P
    except AttributeError:
        return False
    return True


def _redraw(model: Any) -> None:
    """Let the sigma points of a filter, if it has any, be those of its moments."""
    if hasattr(model, "points_fn"):  # unscented
        model.sigmas_f = model.points_fn.sigma_points(model.x, model.P)
    elif hasattr(model, "sigmas_f"):  # cubature
        from filterpy.kalman import spherical_radial_sigmas

        model.sigmas_f = spherical_radial_sigmas(model.x, model.P)


def _entries(names: tuple[str, ...]) -> dict[str, int]:
    """Places of the state's entries by name.

    Raises:
        ConfigError: Place or velocity are not among them, or a name stands twice.
    """
    entry = {name: k for k, name in enumerate(names)}
    needed = [{"x_m", "y_m", "vx_mps", "vy_mps"}, {"x_m", "y_m", "yaw_rad", "speed_mps"}]
    if len(entry) != len(names) or not any(each <= entry.keys() for each in needed):
        raise ConfigError(
            "TrackerConfig.motion: names must each stand once, with x_m, y_m and vx_mps, vy_mps or yaw_rad, "
            f"speed_mps among them, got {names!r}"
        )
    return entry
