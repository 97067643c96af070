"""The bound of forecasts: states of exact motion, carried on, meet the truth."""

import numpy as np
import pytest

from benchmarks.forecast_bound import MODELS, WINDOWS_S, errors_m, states

STAMP_S = np.arange(0.0, 8.05, 0.1)


@pytest.mark.parametrize("window", WINDOWS_S)
def test_steady_motion_is_foretold_to_the_digit_and_its_first_label_tells_nothing(window: str) -> None:
    center = np.column_stack((3.0 + 12.0 * STAMP_S, 1.0 - 5.0 * STAMP_S))
    age_s, motion, elapsed_s = states(STAMP_S, center, WINDOWS_S[window])
    np.testing.assert_allclose(age_s, STAMP_S[:51], atol=1e-9)
    for memories in MODELS.values():
        errors = errors_m(motion, elapsed_s, memories)
        # at 13 m/s whoever knows no speed is 39 m off after 3 s
        assert errors[0] == pytest.approx(39.0 if window == "past" else 0.0, abs=1e-6)
        np.testing.assert_allclose(errors[1:], 0.0, atol=1e-6)


def test_uniform_acceleration_costs_steady_speed_half_a_t_squared() -> None:
    center = np.column_stack((8.0 * STAMP_S + 0.5 * 1.5 * STAMP_S**2, np.zeros_like(STAMP_S)))
    _, motion, elapsed_s = states(STAMP_S, center, WINDOWS_S["known"])
    np.testing.assert_allclose(errors_m(motion, elapsed_s, MODELS["cv"]), 0.5 * 1.5 * 9.0, atol=1e-6)
    np.testing.assert_allclose(errors_m(motion, elapsed_s, MODELS["ca"]), 0.0, atol=1e-4)


def test_a_steady_bend_is_that_of_constant_turn_rate() -> None:
    turn = 0.1 * STAMP_S
    center = 80.0 * np.column_stack((np.sin(turn), 1.0 - np.cos(turn)))
    _, motion, elapsed_s = states(STAMP_S, center, WINDOWS_S["known"])
    inner = slice(5, -5)  # parabolas to both sides
    # whoever goes straight on leaves a circle of 80 m, on which 3 s are 0.3 rad, by this chord
    straight = 80.0 * np.hypot(np.sin(0.3) - 0.3, 1.0 - np.cos(0.3))
    np.testing.assert_allclose(errors_m(motion, elapsed_s, MODELS["cv"])[inner], straight, rtol=0.02)
    assert errors_m(motion, elapsed_s, MODELS["ctra"])[inner].max() < 0.05
