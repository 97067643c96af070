import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter

from smartmot.filters.kalman import BevFilterConfig
from smartmot.filters.motion_models import ConstantTurnRate
from smartmot.filters.turn import TurnFilter, ctrv_step
from smartmot.tracking.tracker import Tracker, TrackerConfig
from smartmot.types import Boxes, Detections, FloatArray


def _states(rng: np.random.Generator, n: int) -> FloatArray:
    return np.column_stack(
        (rng.normal(0, 30, (n, 2)), rng.uniform(-3, 3, n), rng.uniform(-5, 20, n), rng.normal(0, 0.5, n))
    )


@pytest.mark.parametrize("turn_rate", [None, 0.0, 1e-9, 1e-4, -1e-3, 2.0])
def test_jacobian_equals_central_differences(turn_rate: float | None) -> None:
    mean = _states(np.random.default_rng(0), 20)
    if turn_rate is not None:
        mean[:, 4] = turn_rate
    _, jacobian = ctrv_step(mean, 0.3)
    for column in range(5):
        shift = np.zeros(5)
        shift[column] = 1e-5
        slope = (ctrv_step(mean + shift, 0.3)[0] - ctrv_step(mean - shift, 0.3)[0]) / 2e-5
        np.testing.assert_allclose(jacobian[:, :, column], slope, atol=2e-7)


def test_steps_follow_one_arc() -> None:
    mean = _states(np.random.default_rng(1), 10)
    whole, parts = ctrv_step(mean, 0.8)[0], mean
    for _ in range(8):
        parts = ctrv_step(parts, 0.1)[0]
    np.testing.assert_allclose(parts, whole, atol=1e-9)


@pytest.mark.parametrize("with_velocity", [False, True])
def test_equals_filterpy(with_velocity: bool) -> None:
    rng, n = np.random.default_rng(2), 4
    motion, config = ConstantTurnRate(), BevFilterConfig()
    filter_, code = TurnFilter(motion, config), np.arange(n)
    z = np.column_stack((rng.normal(0, 30, (n, 2)), np.full(n, 8.0), np.full(n, 2.0), rng.uniform(-1, 1, n)))
    state = filter_.born(z, None, code)
    references = []
    for k in range(n):
        reference = ExtendedKalmanFilter(dim_x=5, dim_z=3)
        mean, covariance = filter_.moments(state)
        reference.x, reference.P = mean[k].copy(), covariance[k].copy()
        variance = config.measurement_variance()[k]
        reference.R = np.diag(variance[[0, 1, 4]])
        references.append(reference)
    true = np.column_stack((z[:, :2], z[:, 4], rng.uniform(0, 15, n), rng.normal(0, 0.3, n)))
    for _ in range(200):
        dt = rng.uniform(0.02, 0.2)
        true = ctrv_step(true, dt)[0]
        z[:, :2] = true[:, :2] + rng.normal(0, 0.05, (n, 2))
        z[:, 4] = true[:, 2] + rng.normal(0, 0.02, n)
        velocity = true[:, 3:4] * np.column_stack((np.cos(true[:, 2]), np.sin(true[:, 2])))
        noise = filter_.process_noise(state[:, :5], code, dt)
        for k, reference in enumerate(references):
            moved, jacobian = ctrv_step(reference.x[None], dt)
            reference.x = moved[0]
            reference.P = jacobian[0] @ reference.P @ jacobian[0].T + noise[k]
            reference.update(z[k, [0, 1, 4]], lambda x: np.eye(5)[[0, 1, 2]], lambda x: x[[0, 1, 2]])
            if with_velocity:
                reference.update(
                    velocity[k],
                    lambda x: np.array(
                        [
                            [0, 0, -x[3] * np.sin(x[2]), np.cos(x[2]), 0],
                            [0, 0, x[3] * np.cos(x[2]), np.sin(x[2]), 0],
                        ]
                    ),
                    lambda x: x[3] * np.array([np.cos(x[2]), np.sin(x[2])]),
                    R=np.eye(2),
                )
        state = filter_.predict(state, code, dt)
        state = filter_.update(state, z, velocity if with_velocity else None, code)
        mean, covariance = filter_.moments(state)
        np.testing.assert_allclose(mean, [r.x for r in references], rtol=0, atol=1e-9)
        np.testing.assert_allclose(covariance, [r.P for r in references], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(mean, true, atol=0.5)


def test_process_noise_adds_up_on_a_straight_line() -> None:
    filter_ = TurnFilter(ConstantTurnRate(), BevFilterConfig())
    mean, code = np.array([[0.0, 0.0, 0.7, 0.0, 0.0]]), np.zeros(1, dtype=np.int64)
    step = ctrv_step(mean, 0.2)[1][0]
    half = filter_.process_noise(mean, code, 0.2)[0]
    whole = filter_.process_noise(mean, code, 0.4)[0]
    np.testing.assert_allclose(step @ half @ step.T + half, whole, atol=1e-12)


@pytest.mark.parametrize("heading", ["track", "motion", "detector"])
def test_a_circling_car_is_followed(heading: str) -> None:
    tracker = Tracker(TrackerConfig(motion=ConstantTurnRate(), filter=BevFilterConfig(heading=heading)))
    rate, speed = 0.5, 8.0
    for k in range(60):
        yaw = rate * 0.05 * k
        center = speed / rate * np.array([[np.sin(yaw), 1.0 - np.cos(yaw)]])
        boxes = Boxes(center, np.array([[4.4, 1.8]]), np.array([yaw]))
        tracks = tracker.update(Detections(0.05 * k, boxes, np.ones(1), np.array(["car"])))
    assert tracks.track_id.tolist() == [1]
    assert tracks.yaw_rate_radps[0] == pytest.approx(rate, abs=0.02)
    np.testing.assert_allclose(tracks.velocity_mps[0], speed * np.array([np.cos(yaw), np.sin(yaw)]), atol=0.2)


def test_without_heading_the_course_is_learned_from_the_motion() -> None:
    tracker = Tracker(TrackerConfig(motion=ConstantTurnRate(), filter=BevFilterConfig(use_yaw=False)))
    for k in range(40):
        boxes = Boxes(np.array([[0.5 * k, 0.3 * k]]), np.array([[4.4, 1.8]]), np.array([0.2]))
        tracks = tracker.update(Detections(0.1 * k, boxes, np.ones(1), np.array(["car"])))
    np.testing.assert_allclose(tracks.velocity_mps, [[5.0, 3.0]], atol=0.1)
    assert tracks.boxes.yaw_rad[0] == pytest.approx(np.arctan2(3.0, 5.0), abs=0.02)


def test_a_track_that_drives_backwards_is_turned_round() -> None:
    tracker = Tracker(TrackerConfig(motion=ConstantTurnRate(), filter=BevFilterConfig(heading="motion")))
    for k in range(20):
        boxes = Boxes(np.array([[1.0 * k, 0.0]]), np.array([[4.4, 1.8]]), np.array([np.pi - 0.01]))
        tracks = tracker.update(Detections(0.1 * k, boxes, np.ones(1), np.array(["car"])))
    assert np.cos(tracks.boxes.yaw_rad[0]) > 0.99
    np.testing.assert_allclose(tracks.velocity_mps, [[10.0, 0.0]], atol=0.3)
    assert np.linalg.eigvalsh(tracks.covariance[0]).min() > 0.0
