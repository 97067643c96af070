from typing import Any

import numpy as np
import pytest
from filterpy.kalman import KalmanFilter

from smartmot.errors import ConfigError
from smartmot.filters.kalman import (
    MIN_AREA_M2,
    BevFilterConfig,
    heading_innovation,
    measurements,
    predict,
    sizes,
    update,
)
from smartmot.types import Boxes

D, K = 5, 2


def _boxes(rng: np.random.Generator, n: int) -> Boxes:
    return Boxes(rng.normal(0, 50, (n, 2)), rng.uniform(0.3, 8, (n, 2)), rng.uniform(-np.pi, np.pi, n))


def _covariances(rng: np.random.Generator, *shape: int) -> np.ndarray:
    spread = rng.normal(size=(*shape, shape[-1]))
    return spread @ np.swapaxes(spread, -1, -2) + 0.1 * np.eye(shape[-1])


@pytest.mark.parametrize("tracks", [1, 3, 17])
@pytest.mark.parametrize("direct", [True, False], ids=["first entries", "matrix"])
def test_steps_equal_filterpy(tracks: int, direct: bool) -> None:
    rng = np.random.default_rng(tracks)
    mean, covariance = rng.normal(size=(tracks, D)), _covariances(rng, tracks, D)
    noise, added = _covariances(rng, K), _covariances(rng, D)
    measures = np.eye(K, D) if direct else rng.normal(size=(K, D))
    references = []
    for m, p in zip(mean, covariance, strict=True):
        reference = KalmanFilter(dim_x=D, dim_z=K)
        reference.x, reference.P, reference.H, reference.R = m.copy(), p.copy(), measures, noise
        references.append(reference)
    for _ in range(100):
        transition = np.eye(D) + 0.1 * rng.normal(size=(D, D)) / D
        mean, covariance = predict(mean, covariance, transition, added)
        z = rng.normal(size=(tracks, K))
        innovation = z - mean @ measures.T
        mean, covariance = update(mean, covariance, innovation, noise, None if direct else measures)
        for reference, measured in zip(references, z, strict=True):
            reference.predict(F=transition, Q=added)
            reference.update(measured)
        np.testing.assert_allclose(mean, [r.x for r in references], rtol=0, atol=1e-9)
        np.testing.assert_allclose(covariance, [r.P for r in references], rtol=1e-9, atol=1e-9)


def test_update_never_raises_the_uncertainty() -> None:
    rng = np.random.default_rng(6)
    covariance = _covariances(rng, 8, D)
    _, after = update(np.zeros((8, D)), covariance, np.ones((8, K)), np.eye(K))
    assert np.linalg.eigvalsh(covariance - after).min() > -1e-9


def test_update_takes_a_noise_for_each_track() -> None:
    covariance = np.broadcast_to(np.eye(D), (2, D, D))
    noise = np.stack((np.eye(K), 1e6 * np.eye(K)))
    after, _ = update(np.zeros((2, D)), covariance, np.ones((2, K)), noise)
    assert after[0, 0] == pytest.approx(0.5)
    assert after[1, 0] == pytest.approx(0.0, abs=1e-5)


def test_boxes_survive_the_round_trip() -> None:
    boxes = _boxes(np.random.default_rng(7), 20)
    z = measurements(boxes)
    np.testing.assert_allclose(z[:, :2], boxes.center_m)
    np.testing.assert_allclose(sizes(z[:, 2], z[:, 3]), boxes.size_m)
    np.testing.assert_allclose(z[:, 4], boxes.yaw_rad)


def test_sizes_stay_positive() -> None:
    size = sizes(np.array([-1.0, 8.0]), np.array([-2.0, 2.0]))
    assert (size > 0.0).all()
    assert size[0].prod() == pytest.approx(MIN_AREA_M2)
    np.testing.assert_allclose(size[1], [4.0, 2.0])


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
    found = heading_innovation(np.array([measured_yaw]), np.array([track_yaw]))
    assert found[0] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan])
@pytest.mark.parametrize("name", ["position_sigma_m", "velocity_sigma_mps", "initial_speed_sigma_mps"])
def test_rejects_impossible_noise(name: str, value: float) -> None:
    settings: dict[str, Any] = {name: value}
    with pytest.raises(ConfigError, match=name):
        BevFilterConfig(**settings)


def test_rejects_an_unknown_rule_for_headings() -> None:
    with pytest.raises(ConfigError, match="choose one of track, detector, motion"):
        BevFilterConfig(heading="front")
