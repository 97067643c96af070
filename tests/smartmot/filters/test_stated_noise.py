"""Noise that detections state: gains against inverse variances and against filterpy's whole filter."""

from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.filters.box_filter import box_filter
from smartmot.filters.kalman import BevFilterConfig, measurement_noise
from smartmot.filters.motion_models import (
    ConstantAcceleration,
    ConstantTurnRate,
    ConstantVelocity,
    DecayingAcceleration,
)
from smartmot.types import FloatArray

LINEAR = [ConstantVelocity(), ConstantAcceleration(), DecayingAcceleration()]
CAR = np.zeros(1, dtype=np.int64)


def _covariance(sigma_x: float, sigma_y: float, correlation: float, yaw_sigma: float = np.nan) -> FloatArray:
    shared = correlation * sigma_x * sigma_y
    covariance = np.diag([sigma_x**2, sigma_y**2, yaw_sigma**2])
    covariance[0, 1] = covariance[1, 0] = shared
    return covariance[None]


@pytest.mark.parametrize("motion", [*LINEAR, ConstantTurnRate()], ids=lambda motion: type(motion).__name__)
@pytest.mark.parametrize(("first", "second"), [(0.3, 0.1), (0.1, 0.1), (2.0, 0.05)])
def test_two_measurements_at_one_time_weigh_by_their_inverse_variances(
    motion: Any, first: float, second: float
) -> None:
    filter_ = box_filter(motion, BevFilterConfig())
    z = np.array([[10.0, 5.0, 8.0, 2.5, 0.2], [11.0, 4.0, 8.0, 2.5, 0.6]])
    state = filter_.born(z[:1], None, CAR, _covariance(first, 2 * first, 0.0, first))
    state = filter_.update(state, z[1:], None, CAR, _covariance(second, 2 * second, 0.0, second))
    weights = np.array([first**-2, second**-2])
    estimate = filter_.estimate(state)
    np.testing.assert_allclose(estimate.center_m[0], weights @ z[:, :2] / weights.sum(), rtol=1e-12)
    np.testing.assert_allclose(estimate.yaw_rad, weights @ z[:, 4] / weights.sum(), rtol=1e-12)
    xx, yy, xy = (part[0] for part in filter_.position_covariance(state))
    np.testing.assert_allclose([xx, yy, xy], [1 / weights.sum(), 4 / weights.sum(), 0.0], rtol=1e-9)


@pytest.mark.parametrize("motion", [*LINEAR, ConstantTurnRate()], ids=lambda motion: type(motion).__name__)
def test_a_camera_and_a_radar_cross_bear(motion: Any) -> None:
    """One is sure across its line of sight, the other along it: together they are sure of both.

    The two errors lie along the same diagonals, so the closed form is that of two independent axes.
    """
    filter_ = box_filter(motion, BevFilterConfig())
    rotation = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2.0)

    def turned(along: float, across: float) -> FloatArray:
        covariance = np.full((1, 3, 3), np.nan)
        covariance[0, :2, :2] = rotation @ np.diag([along**2, across**2]) @ rotation.T
        return covariance

    z = np.array([[20.0, 20.0, 8.0, 2.5, 0.7], [21.0, 20.0, 8.0, 2.5, 0.7]])
    state = filter_.born(z[:1], None, CAR, turned(3.0, 0.1))
    state = filter_.update(filter_.widened(state), z[1:], None, CAR, turned(0.2, 2.0))
    seen = z[:, :2] @ rotation  # along and across
    weights = np.array([[3.0**-2, 0.1**-2], [0.2**-2, 2.0**-2]])
    expected = rotation @ ((weights * seen).sum(axis=0) / weights.sum(axis=0))
    np.testing.assert_allclose(filter_.estimate(state).center_m[0], expected, rtol=1e-9)
    left = rotation @ np.diag(1.0 / weights.sum(axis=0)) @ rotation.T
    xx, yy, xy = (part[0] for part in filter_.position_covariance(state))
    np.testing.assert_allclose([xx, yy, xy], [left[0, 0], left[1, 1], left[0, 1]], rtol=1e-9)


@pytest.mark.parametrize("motion", LINEAR, ids=lambda motion: type(motion).__name__)
@pytest.mark.parametrize("with_velocity", [False, True])
def test_equals_filterpy_with_noise_that_x_and_y_share(motion: Any, with_velocity: bool) -> None:
    rng = np.random.default_rng(3)
    config, k = BevFilterConfig(velocity_sigma_mps=0.7), motion.order
    filter_ = box_filter(motion, config)
    covariance = _covariance(0.3, 0.8, 0.7)
    z = np.array([[1.0, 2.0, 8.0, 2.5, 0.3]])
    state = filter_.widened(filter_.born(z, None, CAR, covariance))
    mean, spread = filter_.moments(state)
    names = list(filter_.names)
    places = [names.index(name) for name in ("x_m", "vx_mps", "ax_mps2") if name in names]
    places += [names.index(name) for name in ("y_m", "vy_mps", "ay_mps2") if name in names]
    reference = KalmanFilter(dim_x=2 * k, dim_z=2)
    reference.x, reference.P = mean[0, places], spread[0][np.ix_(places, places)]
    reference.H = np.zeros((2, 2 * k))
    reference.H[0, 0] = reference.H[1, k] = 1.0
    velocities = np.zeros((2, 2 * k))
    velocities[0, 1] = velocities[1, k + 1] = 1.0
    for step in range(60):
        dt = rng.uniform(0.02, 0.5)
        _, spread_before = filter_.moments(state)
        calm = filter_.predict(state, CAR, dt)
        # the motion's own noise is what the plain filter adds to each axis
        transition = np.kron(np.eye(2), motion.transition(dt))
        noise = filter_.moments(calm)[1][0][np.ix_(places, places)]
        noise = noise - transition @ spread_before[0][np.ix_(places, places)] @ transition.T
        np.testing.assert_allclose(noise[:k, k:], 0.0, atol=1e-9)
        reference.predict(F=transition, Q=noise)
        z[0, :2] += rng.normal(0.0, 0.5, 2)
        covariance = _covariance(*rng.uniform(0.1, 1.0, 2), rng.uniform(-0.95, 0.95) * (step % 3 > 0))
        velocity = rng.normal(0.0, 1.0, (1, 2)) if with_velocity else None
        state = filter_.update(calm, z, velocity, CAR, covariance)
        reference.update(z[0, :2], R=covariance[0, :2, :2])
        if velocity is not None:
            reference.update(velocity[0], R=0.49 * np.eye(2), H=velocities)
    mean, spread = filter_.moments(state)
    np.testing.assert_allclose(mean[0, places], reference.x, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(spread[0][np.ix_(places, places)], reference.P, rtol=1e-7, atol=1e-10)


@pytest.mark.parametrize("motion", [*LINEAR, ConstantTurnRate()], ids=lambda motion: type(motion).__name__)
@settings(max_examples=20)
@given(
    sigma=st.tuples(st.floats(0.05, 3.0), st.floats(0.05, 3.0)),
    correlation=st.floats(-0.9, 0.9),
    turn_rad=st.floats(-3.0, 3.0),
)
def test_turning_everything_turns_the_estimate(
    motion: Any, sigma: tuple[float, float], correlation: float, turn_rad: float
) -> None:
    """A map frame is a choice: estimates in another one are the same estimates."""
    config = BevFilterConfig(yaw_sigma_rad=0.1)
    filter_ = box_filter(motion, config)
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    rotation = np.array([[c, -s], [s, c]])
    whole = np.eye(3)
    whole[:2, :2] = rotation
    covariance = _covariance(*sigma, correlation, 0.1)
    ends = []
    for turned in (False, True):
        state = None
        for k in range(4):
            z = np.array([[5.0 + k, 3.0 - 0.5 * k, 8.0, 2.5, -0.4]])
            stated = covariance
            if turned:
                z[0, :2], z[0, 4] = rotation @ z[0, :2], z[0, 4] + turn_rad
                stated = whole @ covariance @ whole.T
            if state is None:
                state = filter_.widened(filter_.born(z, None, CAR, stated))
            else:
                state = filter_.update(filter_.predict(state, CAR, 0.1), z, None, CAR, stated)
        assert state is not None
        xx, yy, xy = (part[0] for part in filter_.position_covariance(state))
        ends.append((filter_.estimate(state), np.array([[xx, xy], [xy, yy]])))
    (plain, spread), (other, other_spread) = ends
    np.testing.assert_allclose(other.center_m[0], rotation @ plain.center_m[0], rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(other.velocity_mps[0], rotation @ plain.velocity_mps[0], rtol=1e-5, atol=1e-5)
    np.testing.assert_allclose(other_spread, rotation @ spread @ rotation.T, rtol=1e-5, atol=1e-8)


def test_what_is_not_stated_is_as_configured() -> None:
    variance = np.arange(10.0).reshape(2, 5) + 1.0
    stated = np.full((2, 3, 3), np.nan)
    stated[1, 2, 2] = 0.25
    noise, shared = measurement_noise(variance, stated)
    assert shared is None
    np.testing.assert_array_equal(noise[0], variance[0])
    np.testing.assert_array_equal(noise[1], [6.0, 7.0, 8.0, 9.0, 0.25])
