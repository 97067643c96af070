"""Filters of filterpy as track filters: the same numbers as filterpy alone, and as our closed forms."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from filterpy.kalman import (
    CubatureKalmanFilter,
    EnsembleKalmanFilter,
    ExtendedKalmanFilter,
    IMMEstimator,
    InformationFilter,
    KalmanFilter,
    MMAEFilterBank,
    UnscentedKalmanFilter,
)
from hypothesis import given
from hypothesis import strategies as st

from smartmot import Boxes, ConfigError, Detections, PluginError, Tracker, TrackerConfig, tracker_config
from smartmot.filters.box_filter import box_filter
from smartmot.filters.channels import ChannelFilter
from smartmot.filters.filterpy_adapter import FilterpyFilter
from smartmot.filters.filterpy_motions import InteractingModels, UnscentedTurnRate, _moved, _step
from smartmot.filters.kalman import BevFilterConfig
from smartmot.filters.motion_models import ConstantTurnRate, ConstantVelocity, process_noise
from smartmot.filters.turn import TurnFilter, ctrv_step
from smartmot.tracking.state import TrackerState
from smartmot.types import FloatArray

ROOT = Path(__file__).resolve().parents[3]
CAR = np.zeros(1, dtype=np.int64)


class Steady:
    """Constant velocity, with the noise of `ConstantVelocity`."""

    names: tuple[str, ...] = ("x_m", "vx_mps", "y_m", "vy_mps")

    def make(self, category: str, config: BevFilterConfig) -> Any:
        tracked = KalmanFilter(dim_x=4, dim_z=2)
        tracked.H = np.array([[1.0, 0, 0, 0], [0, 0, 1.0, 0]])
        tracked.R *= config.measurement_variance()[0, 0]
        position, speed = config.measurement_variance()[0, 0], config.initial_rate_variance()[0, 0]
        tracked.P = np.diag([position, speed, position, speed])
        return tracked

    def advance(self, tracked: Any, dt_s: float) -> None:
        tracked.F = np.kron(np.eye(2), [[1.0, dt_s], [0.0, 1.0]])
        tracked.Q = np.kron(np.eye(2), process_noise(np.array([0.0, 0.5]), dt_s))
        tracked.predict()


class Turning:
    """State of `ConstantTurnRate` in a filter that linearises, or takes other points."""

    names = ("x_m", "y_m", "yaw_rad", "speed_mps", "yaw_rate_radps")

    def __init__(self, kind: type) -> None:
        self.kind, self.noise = kind, TurnFilter(ConstantTurnRate(), BevFilterConfig())

    def make(self, category: str, config: BevFilterConfig) -> Any:
        if self.kind is ExtendedKalmanFilter:
            tracked = ExtendedKalmanFilter(dim_x=5, dim_z=3)
        else:
            tracked = CubatureKalmanFilter(5, 3, 0.1, lambda x: x[:3], lambda x, dt: _moved(x.ravel(), dt))
        mean, covariance = self.noise.moments(self.noise.born(np.array([[0, 0, 8.0, 2.0, 0]]), None, CAR))
        tracked.x, tracked.P = mean[0], covariance[0]
        tracked.R = np.diag(config.measurement_variance()[0, [0, 1, 4]])
        return tracked

    def advance(self, tracked: Any, dt_s: float) -> None:
        noise = self.noise.process_noise(np.reshape(tracked.x, (1, 5)), CAR, dt_s)[0]
        if self.kind is ExtendedKalmanFilter:
            moved, jacobian = ctrv_step(tracked.x[None], dt_s)
            tracked.x = moved[0]
            tracked.P = jacobian[0] @ tracked.P @ jacobian[0].T + noise
        else:
            tracked.Q = noise
            tracked.predict(dt=dt_s)

    def correct(self, tracked: Any, measurement: FloatArray) -> None:
        if self.kind is ExtendedKalmanFilter:
            tracked.update(measurement, lambda x: np.eye(3, 5), lambda x: x[:3])
        else:
            tracked.update(measurement[:, None])


def _drive(turn_radps: float, steps: int = 40) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Time steps, measurements (K, 5) and true speeds of a car that speeds up on an arc."""
    rng = np.random.default_rng(5)
    dt = rng.uniform(0.05, 0.15, steps)
    time = np.cumsum(dt)
    speed = 6.0 + np.maximum(time - 1.5, 0.0)
    yaw = turn_radps * time
    places = np.cumsum(dt[:, None] * speed[:, None] * np.stack((np.cos(yaw), np.sin(yaw)), axis=-1), axis=0)
    z = np.column_stack((places, np.full(steps, 8.0), np.full(steps, 2.0), yaw))
    z[:, :2] += rng.normal(0, 0.05, (steps, 2))
    z[:, 4] += rng.normal(0, 0.02, steps)
    return dt, z, speed


def test_a_kalman_filter_equals_the_closed_form() -> None:
    config = BevFilterConfig()
    adapted, reference = FilterpyFilter(Steady(), config), ChannelFilter(ConstantVelocity(), config)
    dt, z, _ = _drive(0.0)
    velocity = np.array([[6.0, np.nan]]), np.array([[6.0, 0.1]])
    a, b = adapted.born(z[:1], None, CAR), reference.born(z[:1], None, CAR)
    for k in range(1, len(z)):
        a, b = adapted.predict(a, CAR, dt[k]), reference.predict(b, CAR, dt[k])
        a = adapted.update(a, z[k : k + 1], velocity[k % 2], CAR)
        b = reference.update(b, z[k : k + 1], velocity[k % 2], CAR)
    linear = [0, 1, 5, 6]
    for mine, theirs in zip(adapted.moments(a), reference.moments(b), strict=True):
        places = (0, linear) if mine.ndim == 2 else (0, *np.ix_(linear, linear))
        np.testing.assert_allclose(mine[places], theirs[places], atol=1e-9)
    np.testing.assert_allclose(
        adapted.position_covariance(a)[0], reference.position_covariance(b)[0], rtol=1e-9
    )
    np.testing.assert_allclose(adapted.speed_variance(a), reference.speed_variance(b), rtol=1e-9)
    assert adapted.names == reference.names


def test_an_extended_filter_equals_the_turn_filter() -> None:
    config = BevFilterConfig()
    adapted, reference = (
        FilterpyFilter(Turning(ExtendedKalmanFilter), config),
        TurnFilter(ConstantTurnRate(), config),
    )
    dt, z, _ = _drive(0.3)
    velocity = np.array([[6.0, 0.5]])
    a, b = adapted.born(z[:1], None, CAR), reference.born(z[:1], None, CAR)
    for k in range(1, len(z)):
        a, b = adapted.predict(a, CAR, dt[k]), reference.predict(b, CAR, dt[k])
        a, b = (f.update(s, z[k : k + 1], velocity, CAR) for f, s in ((adapted, a), (reference, b)))
    for mine, theirs in zip(adapted.moments(a), reference.moments(b), strict=True):
        np.testing.assert_allclose(mine, theirs, atol=1e-9)
    turned = a.copy()
    adapted.turn_round(turned, np.array([True]))
    np.testing.assert_allclose(adapted.estimate(turned).velocity_mps, adapted.estimate(a).velocity_mps)
    assert np.cos(adapted.estimate(turned).yaw_rad - adapted.estimate(a).yaw_rad) == pytest.approx(-1.0)


@pytest.mark.parametrize("motion", [UnscentedTurnRate(), Turning(CubatureKalmanFilter)])
def test_filters_that_sample_stay_near_the_one_that_linearises(motion: Any) -> None:
    config = BevFilterConfig()
    sampled, linearised = box_filter(motion, config), TurnFilter(ConstantTurnRate(), config)
    dt, z, speed = _drive(0.3)
    a, b = sampled.born(z[:1], None, CAR), linearised.born(z[:1], None, CAR)
    for k in range(1, len(z)):
        a, b = sampled.predict(a, CAR, dt[k]), linearised.predict(b, CAR, dt[k])
        a, b = (f.update(s, z[k : k + 1], None, CAR) for f, s in ((sampled, a), (linearised, b)))
    np.testing.assert_allclose(sampled.moments(a)[0], linearised.moments(b)[0], atol=0.02)
    assert np.hypot(*sampled.estimate(a).velocity_mps[0]) == pytest.approx(speed[-1], abs=0.5)


@pytest.mark.parametrize("motion", [InteractingModels(), UnscentedTurnRate()])
def test_equals_filterpy_alone(motion: Any) -> None:
    """Loading and taking out leaves nothing behind: one filter that lives on gives the same numbers."""
    config = BevFilterConfig()
    adapted, alone = box_filter(motion, config), motion.make("car", config)
    assert isinstance(alone, IMMEstimator | UnscentedKalmanFilter)
    dt, z, _ = _drive(0.0 if isinstance(alone, IMMEstimator) else 0.3)
    measured = [motion.names.index(name) for name in ("x_m", "y_m", "yaw_rad") if name in motion.names]
    columns = [0, 1, 4][: len(measured)]
    models = getattr(alone, "filters", [alone])
    for model in models:
        model.x[measured] = z[0, columns]
    state = adapted.born(z[:1], None, CAR)
    for k in range(1, len(z)):
        state = adapted.predict(state, CAR, dt[k])
        state = adapted.update(state, z[k : k + 1], None, CAR)
        motion.advance(alone, dt[k])
        alone.update(z[k, columns])
    mean, covariance = adapted.moments(state)
    to = [adapted.names.index(name) for name in motion.names]
    if isinstance(alone, IMMEstimator):
        np.testing.assert_allclose(state[0, adapted._weights], alone.mu, atol=1e-9)  # type: ignore[attr-defined]
    np.testing.assert_allclose(mean[0, to], np.ravel(alone.x), atol=1e-9)
    np.testing.assert_allclose(covariance[0][np.ix_(to, to)], alone.P, atol=1e-9)


def test_the_interacting_models_know_who_brakes() -> None:
    """10 m/s, then a brake at 6 m/s2 for half a second, 20 Hz, 5 cm of noise."""
    config, rng = BevFilterConfig(), np.random.default_rng(1)
    models, steady = box_filter(InteractingModels(), config), box_filter(ConstantVelocity(), config)
    a = b = None
    accelerated = []
    for k in range(50):
        braked_s = max(0.05 * (k - 39), 0.0)
        x = 10.0 * 0.05 * k - 3.0 * braked_s**2
        z = np.array([[x + rng.normal(0.0, 0.05), rng.normal(0.0, 0.05), 8.0, 2.0, 0.0]])
        if a is None or b is None:
            a, b = models.born(z, None, CAR), steady.born(z, None, CAR)
        else:
            a = models.update(models.predict(a, CAR, 0.05), z, None, CAR)
            b = steady.update(steady.predict(b, CAR, 0.05), z, None, CAR)
        accelerated.append(float(a[0, models._weights][1]))  # type: ignore[attr-defined]
    assert accelerated[39] < 0.2
    assert accelerated[-1] > 0.8
    true_mps = 10.0 - 6.0 * 0.05 * 10
    lag, lag_steady = (f.estimate(s).velocity_mps[0, 0] - true_mps for f, s in ((models, a), (steady, b)))
    assert abs(lag) < 0.5 * lag_steady


@given(st.floats(0.01, 2.0), st.floats(0.01, 2.0))
def test_two_steps_of_the_interacting_models_are_one(first_s: float, second_s: float) -> None:
    motion = InteractingModels()
    np.testing.assert_allclose(
        motion._changes(first_s) @ motion._changes(second_s), motion._changes(first_s + second_s), atol=1e-12
    )
    for steady, densities in ((True, (0.2, 0.0)), (False, (0.0, 8.0))):
        (_, q1), (f2, q2) = (_step(1.0, dt, steady, *densities) for dt in (first_s, second_s))
        _, whole = _step(1.0, first_s + second_s, steady, *densities)
        np.testing.assert_allclose(f2 @ q1 @ f2.T + q2, whole, atol=1e-9)


@given(st.floats(-3.0, 3.0), st.floats(-5.0, 30.0), st.floats(-2.0, 2.0), st.floats(0.01, 1.0))
def test_scalar_arc_is_the_array_one(yaw: float, speed: float, turn: float, dt_s: float) -> None:
    state = np.array([3.0, -4.0, yaw, speed, turn])
    np.testing.assert_allclose(_moved(state, dt_s), ctrv_step(state[None], dt_s)[0][0], atol=1e-9)


@pytest.mark.parametrize("name", ["imm", "ukf"])
def test_a_saved_state_goes_on(name: str, tmp_path: Path) -> None:
    whole, first, second = (Tracker(tracker_config(name)) for _ in range(3))
    dt, z, _ = _drive(0.2, 12)
    frames = [
        Detections(
            float(s), Boxes(row[None, :2], np.array([[4.0, 2.0]]), row[4:]), np.ones(1), np.array(["car"])
        )
        for s, row in zip(np.cumsum(dt), z, strict=True)
    ]
    expected = [whole.update(frame) for frame in frames][-1]
    for frame in frames[:6]:
        first.update(frame)
    first.state.save(tmp_path / "state.npz")
    second.state = TrackerState.load(tmp_path / "state.npz")
    resumed = [second.update(frame) for frame in frames[6:]][-1]
    np.testing.assert_array_equal(resumed.mean, expected.mean)
    assert resumed.dynamic.tolist() == [True]


def test_the_documented_example_runs() -> None:
    text = (ROOT / "docs" / "tracking.md").read_text()
    blocks = [block for block in re.findall(r"```python\n(.*?)```", text, re.S) if "class Walker" in block]
    assert len(blocks) == 1
    space: dict[str, Any] = {}
    exec(blocks[0].replace("print(", "shown = ("), space)
    np.testing.assert_allclose(space["shown"], [[1.4, 0.0]], atol=0.05)


class _Odd(Steady):
    def __init__(self, names: tuple[str, ...] = Steady.names, fault: str = "") -> None:
        self.names, self.fault = names, fault

    def make(self, category: str, config: BevFilterConfig) -> Any:
        if self.fault == "make":
            raise RuntimeError("no licence")
        return super().make(category, config)

    def advance(self, tracked: Any, dt_s: float) -> None:
        if self.fault == "advance":
            raise ZeroDivisionError("dt")
        super().advance(tracked, dt_s)
        if self.fault == "nan":
            tracked.x[0] = np.nan


@pytest.mark.parametrize(
    ("motion", "error", "words"),
    [
        (_Odd(("x_m", "y_m", "vx_mps", "speed")), ConfigError, "names must each stand once"),
        (_Odd(("x_m", "y_m", "vx_mps", "vx_mps")), ConfigError, "names must each stand once"),
        (
            _Odd((*Steady.names, "ax_mps2")),
            ConfigError,
            r"5 names, but a filter for car with x of shape \(4, 1\)",
        ),
        (_Odd(fault="make"), PluginError, "motion _Odd: failed with RuntimeError: no licence"),
        (_Odd(fault="advance"), PluginError, "motion _Odd: failed with ZeroDivisionError: dt"),
        (_Odd(fault="nan"), PluginError, "not finite"),
        (object(), ConfigError, "expected a motion model"),
    ],
)
def test_a_motion_that_cannot_be_used_is_named(motion: Any, error: type[Exception], words: str) -> None:
    config = TrackerConfig(motion=motion)

    def track() -> None:
        tracker = Tracker(config)
        for k in range(2):
            tracker.update_arrays(0.1 * k, [[0.0, 0.0]], [[4.0, 2.0]], [0.0], category=["car"])

    with pytest.raises(error, match=words):
        track()


@pytest.mark.parametrize("motion", [Steady(), Turning(ExtendedKalmanFilter)])
def test_noise_that_a_detection_states_is_taken(motion: Any) -> None:
    """The same as in the filters of ours, with noise that x and y share; then the usual noise again."""
    config = BevFilterConfig()
    own = ConstantVelocity() if isinstance(motion, Steady) else ConstantTurnRate()
    adapted, reference = FilterpyFilter(motion, config), box_filter(own, config)
    dt, z, _ = _drive(0.3)
    stated = np.array([[[0.3, 0.1, 0.0], [0.1, 0.2, 0.0], [0.0, 0.0, 0.01]]])
    a = adapted.born(z[:1], None, CAR, stated)
    b = reference.born(z[:1], None, CAR, stated)
    for k in range(1, len(z)):
        noise = stated if k % 2 else None
        a, b = adapted.predict(a, CAR, dt[k]), reference.predict(b, CAR, dt[k])
        a, b = (f.update(s, z[k : k + 1], None, CAR, noise) for f, s in ((adapted, a), (reference, b)))
    linear = [0, 1, 5, 6] if isinstance(motion, Steady) else list(range(5))
    for mine, theirs in zip(adapted.moments(a), reference.moments(b), strict=True):
        places = (0, linear) if mine.ndim == 2 else (0, *np.ix_(linear, linear))
        np.testing.assert_allclose(mine[places], theirs[places], atol=1e-9)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (
            lambda: EnsembleKalmanFilter(np.zeros(4), np.eye(4), 2, 0.1, 20, _nothing, _nothing),
            "does not keep its state",
        ),
        (lambda: InformationFilter(4, 2), "does not keep its state"),
        (lambda: MMAEFilterBank([Steady().make("car", BevFilterConfig())], [1.0], 4), "no probabilities mu"),
    ],
)
def test_filters_of_another_kind_are_refused(make: Any, words: str) -> None:
    """Their state is in samples, in an inverse, or in probabilities of another name."""

    class Other(Steady):
        def make(self, category: str, config: BevFilterConfig) -> Any:
            return make()

    with pytest.raises(ConfigError, match=words):
        Tracker(TrackerConfig(motion=Other()))


def _nothing(*arguments: Any) -> Any:
    return arguments[0]
