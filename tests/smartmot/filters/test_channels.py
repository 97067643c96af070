from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from smartmot.filters.channels import ChannelFilter
from smartmot.filters.kalman import BevFilterConfig, heading_innovation
from smartmot.filters.motion_models import (
    AREA,
    CHANNELS,
    RATIO,
    YAW,
    ConstantAcceleration,
    ConstantVelocity,
    PerCategory,
    X,
    Y,
    process_noise,
)
from smartmot.types import FloatArray

CAR, PEDESTRIAN = 0, 1
MOTIONS = {
    "velocity": ConstantVelocity(),
    "paper": ConstantVelocity.paper(),
    "acceleration": ConstantAcceleration(),
    "per category": ConstantVelocity(velocity_m2ps3=PerCategory(3.0, 0.4, 1.0, 2.0, 1.5, 1.0)),
}


def _measurements(rng: np.random.Generator, n: int) -> FloatArray:
    return np.column_stack(
        (rng.normal(0, 50, (n, 2)), rng.uniform(0.3, 9, n), rng.uniform(0.5, 3, n), rng.uniform(-1, 1, n))
    )


class _Full:
    """The whole state of one track, channel after channel, in filterpy's own filter."""

    def __init__(self, motion: Any, config: BevFilterConfig, z: FloatArray, code: int) -> None:
        self.motion, self.code, self.k = motion, code, motion.order
        size = len(CHANNELS) * self.k
        self.filter = KalmanFilter(dim_x=size, dim_z=len(CHANNELS))
        self.filter.x = np.zeros(size)
        self.filter.x[:: self.k] = z
        variance = np.zeros((len(CHANNELS), self.k))
        variance[:, 0] = config.initial_factor * config.measurement_variance()[code]
        variance[:, 1] = config.initial_rate_variance()[code]
        if self.k == 3:
            variance[:2, 2] = motion.initial_acceleration_mps2**2
        self.filter.P = np.diag(variance.ravel())
        self.filter.H = np.zeros((len(CHANNELS), size))
        self.filter.H[range(len(CHANNELS)), range(0, size, self.k)] = 1.0
        self.filter.R = np.diag(config.measurement_variance()[code])

    def step(self, dt_s: float, z: FloatArray, velocity: FloatArray | None = None) -> None:
        blocks = process_noise(self.motion.densities(), dt_s)[self.code]
        transition = np.kron(np.eye(len(CHANNELS)), self.motion.transition(dt_s))
        noise = np.zeros_like(transition)
        for c, block in enumerate(blocks):
            noise[c * self.k : (c + 1) * self.k, c * self.k : (c + 1) * self.k] = block
        self.filter.predict(F=transition, Q=noise)
        nearest = z.copy()
        yaw = self.filter.x[YAW * self.k]
        nearest[YAW] = yaw + heading_innovation(z[YAW], yaw)
        self.filter.update(nearest)
        if velocity is not None:
            measures = np.zeros((2, len(self.filter.x)))
            measures[0, 1] = measures[1, self.k + 1] = 1.0
            self.filter.update(velocity, R=np.eye(2), H=measures)

    def entries(self, filter_: ChannelFilter) -> tuple[FloatArray, FloatArray]:
        places = [c * self.k for c in range(len(CHANNELS))] + [c * self.k + 1 for c in (X, Y, AREA, YAW)]
        places += [2, 5] if self.k == 3 else []
        assert len(places) == len(filter_.names)
        return self.filter.x[places], self.filter.P[np.ix_(places, places)]


@pytest.mark.parametrize("tracks", [1, 6])
@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
@pytest.mark.parametrize("with_velocity", [False, True])
def test_equals_filterpy_over_long_sequences(tracks: int, motion: Any, with_velocity: bool) -> None:
    rng = np.random.default_rng(tracks)
    config = BevFilterConfig.paper() if motion == MOTIONS["paper"] else BevFilterConfig()
    filter_ = ChannelFilter(motion, config)
    z0, code = _measurements(rng, tracks), np.arange(tracks) % 6
    state = filter_.born(z0, None, code)
    references = [_Full(motion, config, z, c) for z, c in zip(z0, code.tolist(), strict=True)]
    for _ in range(150):
        dt = rng.uniform(0.02, 0.3)
        z = z0 + rng.normal(0, 0.3, z0.shape)
        z[:, YAW] += np.pi * (rng.random(tracks) < 0.2)
        velocity = rng.normal(0, 1, (tracks, 2)) if with_velocity else None
        state = filter_.update(filter_.predict(state, code, dt), z, velocity, code)
        for k, reference in enumerate(references):
            reference.step(dt, z[k], None if velocity is None else velocity[k])
    mean, covariance = filter_.moments(state)
    expected = [reference.entries(filter_) for reference in references]
    np.testing.assert_allclose(mean, [m for m, _ in expected], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(covariance, [p for _, p in expected], rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("motion", MOTIONS.values(), ids=MOTIONS.keys())
def test_covariance_stays_positive(motion: Any) -> None:
    rng = np.random.default_rng(5)
    filter_ = ChannelFilter(motion, BevFilterConfig())
    code = np.zeros(4, dtype=np.int64)
    state = filter_.born(_measurements(rng, 4), None, code)
    for step in range(600):
        state = filter_.predict(state, code, float(rng.choice([1e-3, 0.05, 2.0])))
        if step % 3:
            state = filter_.update(state, _measurements(rng, 4), None, code)
        covariance = filter_.moments(state)[1]
        np.testing.assert_array_equal(covariance, np.swapaxes(covariance, 1, 2))
        assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_new_tracks_are_at_rest_and_as_fast_as_their_category_may_be() -> None:
    config = BevFilterConfig()
    filter_ = ChannelFilter(ConstantVelocity(), config)
    code = np.array([CAR, PEDESTRIAN])
    state = filter_.born(_measurements(np.random.default_rng(0), 2), None, code)
    assert (filter_.estimate(state).velocity_mps == 0.0).all()
    speed = filter_.speed_variance(state)
    assert speed[0] > speed[1]
    xx, yy, xy = filter_.position_covariance(state)
    np.testing.assert_allclose([xx, yy], config.measurement_variance()[code, 0] * np.ones((2, 1)))
    assert not xy.any()


def test_a_measured_velocity_starts_a_track_at_that_velocity() -> None:
    filter_ = ChannelFilter(ConstantVelocity(), BevFilterConfig(velocity_sigma_mps=0.1))
    z = _measurements(np.random.default_rng(0), 2)
    state = filter_.born(z, np.array([[10.0, -3.0], [np.nan, np.nan]]), np.array([CAR, CAR]))
    np.testing.assert_allclose(filter_.estimate(state).velocity_mps, [[10.0, -3.0], [0.0, 0.0]], rtol=1e-3)


def test_rows_without_velocity_change_nothing() -> None:
    filter_, z = ChannelFilter(ConstantVelocity(), BevFilterConfig()), np.ones((2, 5))
    code = np.zeros(2, dtype=np.int64)
    state = filter_.predict(filter_.born(z, None, code), code, 0.1)
    plain = filter_.update(state, z, None, code)
    mixed = filter_.update(state, z, np.array([[np.nan, 1.0], [5.0, 5.0]]), code)
    np.testing.assert_array_equal(mixed[0], plain[0])
    assert (filter_.estimate(mixed).velocity_mps[1] > 1.0).all()


@pytest.mark.parametrize(("use_size", "use_yaw"), [(False, True), (True, False), (False, False)])
def test_what_is_not_filtered_is_the_last_detections(use_size: bool, use_yaw: bool) -> None:
    rng = np.random.default_rng(3)
    filter_ = ChannelFilter(ConstantVelocity(), BevFilterConfig(use_size=use_size, use_yaw=use_yaw))
    z, code = _measurements(rng, 3), np.zeros(3, dtype=np.int64)
    state = filter_.born(z, None, code)
    for _ in range(5):
        z = z + rng.uniform(0.01, 0.05, z.shape)
        state = filter_.update(filter_.predict(state, code, 0.1), z, None, code)
    found = filter_.estimate(state)
    area = found.size_m.prod(axis=1)
    assert np.allclose(area, z[:, AREA], rtol=1e-12) != use_size
    assert np.allclose(found.size_m[:, 0] / found.size_m[:, 1], z[:, RATIO], rtol=1e-12) != use_size
    assert np.allclose(found.yaw_rad, z[:, YAW], rtol=1e-12) != use_yaw
    assert bool(found.yaw_rate_radps.any()) == use_yaw


def _driven(heading: str, born_yaw: float, measured_yaw: float, speed: float) -> float:
    filter_, code = ChannelFilter(ConstantVelocity(), BevFilterConfig(heading=heading)), np.zeros(1, np.int64)
    z = np.array([[0.0, 0.0, 8.0, 2.0, born_yaw]])
    state = filter_.born(z, None, code)
    for k in range(1, 20):
        z = np.array([[0.1 * k * speed, 0.0, 8.0, 2.0, measured_yaw]])
        state = filter_.update(filter_.predict(state, code, 0.1), z, None, code)
    return float(np.cos(filter_.estimate(state).yaw_rad[0]))


def test_rules_for_reversed_headings() -> None:
    # Born with the rear taken for the front, then seen the right way round while driving along x.
    assert _driven("track", np.pi, 0.0, 10.0) == pytest.approx(-1.0)
    assert _driven("detector", np.pi, 0.0, 10.0) == pytest.approx(1.0)
    assert _driven("motion", np.pi, np.pi, 10.0) == pytest.approx(1.0)
    # Backing out of a parking place at walking speed is no mistake.
    assert _driven("motion", np.pi, np.pi, 1.0) == pytest.approx(-1.0)
