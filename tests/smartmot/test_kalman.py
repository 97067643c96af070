import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from smartmot.errors import ConfigError
from smartmot.kalman import (
    MIN_AREA_M2,
    BevFilterConfig,
    boxes_of,
    initial_states,
    innovations,
    measurements,
    predict,
    update,
    valid_state,
)
from smartmot.motion_models import AREA, AREA_RATE, MEASURED, RATIO, STATE, VX, YAW, ConstantVelocity
from smartmot.types import Boxes

CAR, PEDESTRIAN = 0, 1
D = len(STATE)


def _boxes(rng: np.random.Generator, n: int) -> Boxes:
    return Boxes(rng.normal(0, 50, (n, 2)), rng.uniform(0.3, 8, (n, 2)), rng.uniform(-np.pi, np.pi, n))


@pytest.mark.parametrize("tracks", [1, 3, 17])
@pytest.mark.parametrize(
    ("motion", "config"),
    [(ConstantVelocity(), BevFilterConfig()), (ConstantVelocity.paper(), BevFilterConfig.paper())],
    ids=["default", "paper"],
)
def test_equals_filterpy_over_long_sequences(
    tracks: int, motion: ConstantVelocity, config: BevFilterConfig
) -> None:
    rng = np.random.default_rng(tracks)
    z0 = measurements(_boxes(rng, tracks))
    mean, covariance = initial_states(z0, np.arange(tracks) % 6, config)
    noise = config.measurement_noise()
    references = []
    for m, p in zip(mean, covariance, strict=True):
        reference = KalmanFilter(dim_x=D, dim_z=MEASURED)
        reference.x, reference.P = m.copy(), p.copy()
        reference.H, reference.R = np.eye(MEASURED, D), noise
        references.append(reference)
    for _ in range(400):
        dt = rng.uniform(0.02, 0.3)
        mean, covariance = predict(mean, covariance, motion.transition(dt), motion.process_noise(dt))
        z = z0 + rng.normal(0, 0.3, z0.shape)
        mean, covariance = update(mean, covariance, z - mean[:, :MEASURED], noise)
        for reference, measured in zip(references, z, strict=True):
            reference.predict(F=motion.transition(dt), Q=motion.process_noise(dt))
            reference.update(measured)
        np.testing.assert_allclose(mean, [r.x for r in references], rtol=0, atol=1e-9)
        np.testing.assert_allclose(covariance, [r.P for r in references], rtol=1e-9, atol=1e-9)


def test_covariance_stays_symmetric_and_positive() -> None:
    rng = np.random.default_rng(5)
    motion, config = ConstantVelocity.paper(), BevFilterConfig.paper()
    mean, covariance = initial_states(measurements(_boxes(rng, 4)), np.zeros(4, dtype=np.int64), config)
    for step in range(2000):
        dt = float(rng.choice([1e-3, 0.05, 2.0]))
        mean, covariance = predict(mean, covariance, motion.transition(dt), motion.process_noise(dt))
        if step % 3:
            mean, covariance = update(mean, covariance, rng.normal(0, 1, (4, 5)), config.measurement_noise())
        np.testing.assert_allclose(covariance, np.swapaxes(covariance, 1, 2), rtol=1e-12)
        assert np.linalg.eigvalsh(covariance).min() > 0.0


def test_update_never_raises_the_uncertainty() -> None:
    rng = np.random.default_rng(6)
    spread = rng.normal(size=(8, D, D))
    covariance = spread @ np.swapaxes(spread, 1, 2)
    noise = BevFilterConfig().measurement_noise()
    _, after = update(np.zeros((8, D)), covariance, np.ones((8, 5)), noise)
    assert np.linalg.eigvalsh(covariance - after).min() > -1e-9


def test_update_takes_a_noise_for_each_track() -> None:
    config = BevFilterConfig()
    mean, covariance = initial_states(np.ones((2, 5)), np.zeros(2, dtype=np.int64), config)
    noise = np.stack((config.measurement_noise(), 1e6 * config.measurement_noise()))
    after, _ = update(mean, covariance, np.ones((2, 5)), noise)
    assert after[0, 0] == pytest.approx(1.5)
    assert after[1, 0] == pytest.approx(1.0, abs=1e-5)


def test_boxes_survive_the_round_trip() -> None:
    boxes = _boxes(np.random.default_rng(7), 20)
    mean, _ = initial_states(measurements(boxes), np.zeros(20, dtype=np.int64), BevFilterConfig())
    back = boxes_of(mean)
    np.testing.assert_allclose(back.center_m, boxes.center_m)
    np.testing.assert_allclose(back.size_m, boxes.size_m)
    np.testing.assert_allclose(back.yaw_rad, boxes.yaw_rad)


@pytest.mark.parametrize(
    ("track_yaw", "measured_yaw", "expected"),
    [
        (0.0, 0.1, 0.1),
        (0.0, np.pi - 0.1, -0.1),
        (0.0, -np.pi + 0.1, 0.1),
        (3.1, -3.1, 2 * np.pi - 6.2),
        (0.3, 0.3 + 7 * np.pi, 0.0),
        (0.0, 1.5, 1.5),
        (0.0, 1.6, 1.6 - np.pi),
    ],
)
def test_heading_innovation_is_wrapped_and_flipped(
    track_yaw: float, measured_yaw: float, expected: float
) -> None:
    mean, z = np.zeros((1, D)), np.zeros((1, MEASURED))
    mean[0, YAW], z[0, YAW] = track_yaw, measured_yaw
    assert innovations(mean, z)[0, YAW] == pytest.approx(expected, abs=1e-12)


def test_states_stay_valid() -> None:
    mean = np.zeros((2, D))
    mean[0, [AREA, RATIO, YAW, AREA_RATE]] = -1.0, -2.0, 4.0, -3.0
    mean[1, [AREA, RATIO, YAW, AREA_RATE]] = 8.0, 2.0, 1.0, -0.1
    fixed = valid_state(mean.copy())
    assert fixed[0, AREA] == MIN_AREA_M2
    assert fixed[0, AREA_RATE] == 0.0
    assert fixed[0, RATIO] > 0.0
    assert fixed[0, YAW] == pytest.approx(4.0 - 2 * np.pi)
    np.testing.assert_allclose(fixed[1], mean[1])


def test_new_tracks_are_at_rest_and_as_fast_as_their_category_may_be() -> None:
    config = BevFilterConfig()
    mean, covariance = initial_states(np.ones((2, 5)), np.array([CAR, PEDESTRIAN]), config)
    assert (mean[:, MEASURED:] == 0.0).all()
    assert covariance[0, VX, VX] > covariance[1, VX, VX]
    np.testing.assert_allclose(covariance[:, :5, :5], [config.measurement_noise()] * 2)


@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan])
def test_rejects_impossible_noise(value: float) -> None:
    with pytest.raises(ConfigError, match="position_sigma_m"):
        BevFilterConfig(position_sigma_m=value)
