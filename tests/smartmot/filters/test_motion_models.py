import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from smartmot.errors import ConfigError
from smartmot.filters.motion_models import (
    AREA,
    RATIO,
    YAW,
    ConstantAcceleration,
    ConstantVelocity,
    DecayingAcceleration,
    PerCategory,
    X,
    ctrv_positions,
    fading_positions,
    process_noise,
    table,
)

MODELS = [ConstantVelocity(), ConstantVelocity.paper(), ConstantAcceleration()]
FADING = DecayingAcceleration()


def test_transitions_by_hand() -> None:
    assert (ConstantVelocity().transition(0.5) @ [1.0, 4.0] == [3.0, 4.0]).all()
    assert (ConstantAcceleration().transition(0.5) @ [1.0, 4.0, 8.0] == [4.0, 8.0, 8.0]).all()


@pytest.mark.parametrize("model", MODELS)
@settings(max_examples=50, deadline=None)
@given(first=st.floats(1e-4, 2.0), second=st.floats(1e-4, 2.0))
def test_two_steps_equal_one(
    model: ConstantVelocity | ConstantAcceleration, first: float, second: float
) -> None:
    f1, f2 = model.transition(first), model.transition(second)
    np.testing.assert_allclose(f2 @ f1, model.transition(first + second), atol=1e-12)
    noise = model.densities()
    added = f2 @ process_noise(noise, first) @ f2.T + process_noise(noise, second)
    np.testing.assert_allclose(added, process_noise(noise, first + second), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("model", MODELS)
@pytest.mark.parametrize("dt_s", [0.0, 1e-3, 0.05, 1.0])
def test_process_noise_is_a_covariance(model: ConstantVelocity | ConstantAcceleration, dt_s: float) -> None:
    noise = process_noise(model.densities(), dt_s)
    assert noise.shape == (6, 5, model.order, model.order)
    np.testing.assert_allclose(noise, np.swapaxes(noise, -1, -2))
    assert np.linalg.eigvalsh(noise).min() >= -1e-15


def test_paper_noise_is_the_diagonal_of_the_reference_code() -> None:
    # One pixel is 0.05 m and one frame 0.05 s: a pixel per frame is 1 m/s.
    noise = process_noise(ConstantVelocity.paper().densities(), 0.05)
    for channel in (X, AREA, YAW):
        assert noise[0, channel, 0, 0] == pytest.approx(0.05**2, rel=0.01)
        assert noise[0, channel, 1, 1] == pytest.approx(0.01)
    assert noise[0, RATIO, 0, 0] == pytest.approx(0.05**2)
    assert noise[0, RATIO, 1, 1] == 0.0


@pytest.mark.parametrize("value", [-1.0, np.inf, np.nan])
def test_rejects_impossible_densities(value: float) -> None:
    with pytest.raises(ConfigError, match="velocity_m2ps3: allowed 0 to inf"):
        ConstantVelocity(velocity_m2ps3=value)
    with pytest.raises(ConfigError, match="jerk_m2ps5: allowed 0 to inf"):
        ConstantAcceleration(jerk_m2ps5=value)


def test_per_category() -> None:
    values = PerCategory(1, 2, 3, 4, 5, 6)
    np.testing.assert_array_equal(table(values)[[5, 0, 1, 1]], [6, 1, 2, 2])
    np.testing.assert_array_equal(table(0.5), [0.5] * 6)
    np.testing.assert_array_equal(table(PerCategory.grouped(1, 2, 3)), [1, 2, 3, 1, 3, 1])
    with pytest.raises(ConfigError, match=r"PerCategory\.truck"):
        PerCategory(1, 2, 3, np.nan, 5, 6)
    with pytest.raises(ConfigError, match="velocity_m2ps3"):
        ConstantVelocity(velocity_m2ps3=PerCategory(1, 2, 3, -1, 5, 6))


def _one(course: float, speed: float, rate: float, times: list[float]) -> tuple[np.ndarray, np.ndarray]:
    start = np.array([2.0]), np.array([-1.0])
    return ctrv_positions(*start, np.array([course]), np.array([speed]), np.array([rate]), np.array(times))


def test_ctrv_by_hand() -> None:
    # Radius 2 m, from east to north in a quarter turn, then on to west.
    position, course = _one(0.0, np.pi, np.pi / 2, [0.0, 1.0, 2.0])
    np.testing.assert_allclose(position[0], [[2, -1], [4, 1], [2, 3]], atol=1e-12)
    np.testing.assert_allclose(course[0], [0, np.pi / 2, np.pi])
    position, course = _one(np.pi / 2, 3.0, 0.0, [0.0, 2.0])
    np.testing.assert_allclose(position[0], [[2, -1], [2, 5]], atol=1e-12)


@settings(max_examples=25, deadline=None)
@given(st.floats(-4, 4), st.floats(-40, 40), st.floats(-2, 2))
def test_ctrv_solves_its_differential_equation(course: float, speed: float, rate: float) -> None:
    position, _ = _one(course, speed, rate, [1.3])
    solved = solve_ivp(
        lambda t, _: [speed * np.cos(course + rate * t), speed * np.sin(course + rate * t)],
        (0, 1.3), [2.0, -1.0], rtol=1e-10, atol=1e-10,
    )  # fmt: skip
    np.testing.assert_allclose(position[0, 0], solved.y[:, -1], atol=1e-6)


@pytest.mark.parametrize("rate", [1e-300, 1e-12, 1e-9, 1e-6, 1e-4])
def test_ctrv_is_smooth_through_straight_motion(rate: float) -> None:
    left, _ = _one(0.4, 20.0, rate, [3.0])
    right, _ = _one(0.4, 20.0, -rate, [3.0])
    straight, _ = _one(0.4, 20.0, 0.0, [3.0])
    np.testing.assert_allclose(0.5 * (left + right), straight, atol=100 * rate**2 + 1e-12)
    # Offset of a slight turn: v w t^2 / 2.
    assert np.linalg.norm(left - straight) == pytest.approx(90.0 * rate, rel=1e-3, abs=1e-13)


@pytest.mark.parametrize(("m", "t"), [(0, 4), (1, 1), (5, 3)])
def test_ctrv_shapes(m: int, t: int) -> None:
    x, y, yaw, speed, rate = np.random.default_rng(0).normal(size=(5, m))
    position, course = ctrv_positions(x, y, yaw, speed, rate, np.linspace(0, 3, t))
    assert position.shape == (m, t, 2)
    assert course.shape == (m, t)
    own_times, _ = ctrv_positions(x, y, yaw, speed, rate, np.broadcast_to(np.linspace(0, 3, t), (m, t)))
    np.testing.assert_array_equal(own_times, position)


@given(st.floats(0.01, 1.0), st.floats(0.01, 1.0))
@settings(max_examples=50, deadline=None)
def test_steps_of_a_fading_acceleration_compose(first_s: float, second_s: float) -> None:
    f, g = FADING.transition(first_s), FADING.transition(second_s)
    np.testing.assert_allclose(g @ f, FADING.transition(first_s + second_s), atol=1e-12)
    composed = g @ FADING.process_noise(first_s) @ g.T + FADING.process_noise(second_s)
    np.testing.assert_allclose(composed, FADING.process_noise(first_s + second_s), atol=1e-9)


def test_a_fading_acceleration_keeps_its_variance() -> None:
    """Singer's model is stationary: what fades is made up by the noise."""
    f, noise = FADING.transition(0.3), FADING.process_noise(0.3)
    variance = table(FADING.acceleration_mps2) ** 2
    np.testing.assert_allclose(f[2, 2] ** 2 * variance + noise[:, X, 2, 2], variance)
    assert (noise[:, YAW, 2, 2] == 0.0).all()


def test_with_a_long_memory_it_is_a_constant_acceleration() -> None:
    slow = DecayingAcceleration(memory_s=1e6)
    np.testing.assert_allclose(slow.transition(0.5), ConstantAcceleration().transition(0.5), atol=1e-5)


def _fading(
    speed: float, rate: float, acceleration: float, turn_memory_s: float, memory_s: float = 0.5
) -> np.ndarray:
    one = np.ones(1)
    time = np.linspace(0.0, 3.0, 7)
    positions, _ = fading_positions(
        0.0 * one,
        0.0 * one,
        0.3 * one,
        speed * one,
        rate * one,
        acceleration * one,
        turn_memory_s * one,
        memory_s,
        time,
    )
    return np.asarray(positions[0])


def test_a_fading_path_agrees_with_an_ode_solver() -> None:
    def change(t: float, state: np.ndarray) -> list[float]:
        speed = 10.0 + 2.0 * 0.5 * (1.0 - np.exp(-t / 0.5))
        course = 0.3 + 0.4 * 1.0 * (1.0 - np.exp(-t / 1.0))
        return [speed * np.cos(course), speed * np.sin(course)]

    truth = solve_ivp(change, (0.0, 3.0), [0.0, 0.0], t_eval=np.linspace(0.0, 3.0, 7), rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(_fading(10.0, 0.4, 2.0, 1.0), truth.y.T, atol=1e-6)


def test_limits_of_fading_paths() -> None:
    time = np.linspace(0.0, 3.0, 7)
    line = 8.0 * time[:, None] * [np.cos(0.3), np.sin(0.3)]
    np.testing.assert_allclose(_fading(8.0, 0.5, 0.0, 0.0), line, atol=1e-9)
    one = np.ones(1)
    arc, _ = ctrv_positions(0.0 * one, 0.0 * one, 0.3 * one, 8.0 * one, 0.5 * one, time)
    np.testing.assert_allclose(_fading(8.0, 0.5, 0.0, 1e6), arc[0], atol=1e-4)


def test_what_brakes_stops_and_does_not_return() -> None:
    """1 m/s and -4 m/s2 that fade over 0.5 s: it stands after 0.5 ln 2 s, 0.153 m on."""
    gone_m = np.hypot(*_fading(1.0, 0.0, -4.0, 1.0).T)
    stop_s = 0.5 * np.log(2.0)
    expected = stop_s - 4.0 * 0.5 * (stop_s - 0.5 * (1.0 - np.exp(-stop_s / 0.5)))
    np.testing.assert_allclose(gone_m[1:], expected, atol=0.011)


@pytest.mark.parametrize("values", [{"memory_s": 0.0}, {"acceleration_mps2": -1.0}])
def test_a_fading_acceleration_must_be_possible(values: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="DecayingAcceleration"):
        DecayingAcceleration(**values)
