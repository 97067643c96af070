"""Brakes against closed forms, numerical integration and the Euro NCAP fact sheet's limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from scenarios.brakes import BrakeConfig
from scenarios.errors import ScenarioError

KMH = 1 / 3.6

PROFILES = {
    "ideal": BrakeConfig(0.0, 0.0, 9.0),
    "delay only": BrakeConfig(0.3, 0.0, 9.0),
    "build-up only": BrakeConfig(0.0, 0.4, 9.0),
    "real car": BrakeConfig(0.2, 0.4, 8.8),
    "paper": BrakeConfig(0.07, 0.5, 14.5),
    "snow": BrakeConfig(0.2, 0.4, 2.15),
}
profiles = st.builds(
    BrakeConfig,
    delay_s=st.sampled_from([0.0, 0.07, 0.2]) | st.floats(0.0, 1.0),
    build_up_s=st.sampled_from([0.0, 0.4, 0.5]) | st.floats(0.001, 1.0),
    max_decel_mps2=st.floats(0.5, 15.0),
)


def stopping_m(brakes: BrakeConfig, speed_mps: float) -> float:
    """Delay, linear build-up and constant deceleration, for a speed that outlasts the build-up."""
    a, ramp = brakes.max_decel_mps2, brakes.build_up_s
    assert speed_mps >= a * ramp / 2
    return speed_mps * (brakes.delay_s + ramp / 2) + speed_mps**2 / (2 * a) - a * ramp**2 / 24


def speed_at(brakes: BrakeConfig, speed_mps: float, distance_m: float) -> float:
    """Speed when a distance has been driven since the request; 0 if the vehicle stops before."""
    if brakes.travel(speed_mps, 0.0, 60.0)[0] <= distance_m:
        return 0.0
    time = brentq(lambda t: brakes.travel(speed_mps, 0.0, t)[0] - distance_m, 0.0, 60.0, xtol=1e-12)
    return brakes.travel(speed_mps, 0.0, time)[1]


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("speed_kmh", [20, 50, 80])
def test_stopping_distance_is_the_closed_form(name: str, speed_kmh: float) -> None:
    brakes, speed = PROFILES[name], speed_kmh * KMH
    distance, left = brakes.travel(speed, 0.0, 60.0)
    assert left == 0.0
    assert distance == pytest.approx(stopping_m(brakes, speed), abs=1e-9)


@pytest.mark.parametrize("name", PROFILES)
@pytest.mark.parametrize("speed_mps", [0.4, 2.0, 13.9])
@pytest.mark.parametrize("since_s", [0.0, 0.1, 0.35, 1.0])
def test_agrees_with_a_numerical_integration(name: str, speed_mps: float, since_s: float) -> None:
    brakes = PROFILES[name]

    def derivative(time: float, state: list[float]) -> list[float]:
        return [state[1], -brakes.decel_mps2(since_s + time)]

    def standstill(_time: float, state: list[float]) -> float:
        return state[1]

    standstill.terminal = True  # type: ignore[attr-defined]
    ode = solve_ivp(
        derivative, (0.0, 1.2), [0.0, speed_mps], events=standstill, rtol=1e-9, atol=1e-10, max_step=0.005
    )
    distance, left = brakes.travel(speed_mps, since_s, 1.2)
    # a step of the deceleration inside a step of the solver costs it some accuracy
    assert distance == pytest.approx(ode.y[0, -1], abs=1e-4)
    assert left == pytest.approx(ode.y[1, -1], abs=1e-4)


@given(
    profiles,
    st.floats(0.0, 40.0),
    st.floats(0.0, 2.0),
    st.lists(st.floats(1e-6, 1.0), min_size=1, max_size=8),
)
def test_splitting_a_duration_changes_nothing(
    brakes: BrakeConfig, speed_mps: float, since_s: float, pieces_s: list[float]
) -> None:
    whole, left = brakes.travel(speed_mps, since_s, sum(pieces_s))
    distance, now, speed = 0.0, since_s, speed_mps
    for piece in pieces_s:
        step, speed = brakes.travel(speed, now, piece)
        distance, now = distance + step, now + piece
    assert distance == pytest.approx(whole, abs=1e-7)
    assert speed == pytest.approx(left, abs=1e-7)


@given(profiles, st.floats(0.0, 40.0), st.floats(0.0, 2.0))
def test_stops_at_exactly_zero_and_stays(brakes: BrakeConfig, speed_mps: float, since_s: float) -> None:
    distance, left = brakes.travel(speed_mps, since_s, 200.0)
    assert left == 0.0
    assert brakes.travel(0.0, since_s, 5.0) == (0.0, 0.0)
    assert brakes.travel(speed_mps, since_s, 300.0)[0] == pytest.approx(distance, abs=1e-9)


@given(profiles, st.floats(0.1, 40.0), st.floats(0.001, 3.0))
def test_never_faster_than_before_and_never_backwards(
    brakes: BrakeConfig, speed_mps: float, duration_s: float
) -> None:
    distance, left = brakes.travel(speed_mps, 0.0, duration_s)
    assert 0.0 <= left <= speed_mps
    assert left * duration_s - 1e-9 <= distance <= speed_mps * duration_s + 1e-9


@given(st.floats(1.0, 15.0), st.floats(1.0, 40.0), st.floats(0.01, 0.99))
def test_ideal_brake_obeys_the_energy_equation(decel: float, speed: float, share: float) -> None:
    distance = share * speed**2 / (2 * decel)
    left = speed_at(BrakeConfig(0.0, 0.0, decel), speed, distance)
    assert left == pytest.approx(math.sqrt(speed**2 - 2 * decel * distance), abs=1e-6)


def test_nothing_happens_during_the_delay() -> None:
    assert PROFILES["real car"].travel(10.0, 0.0, 0.2) == (pytest.approx(2.0), pytest.approx(10.0))
    assert PROFILES["real car"].decel_mps2(0.1999) == 0.0


def test_build_up_is_linear() -> None:
    brakes = PROFILES["real car"]
    rise = [brakes.decel_mps2(t) for t in (0.2, 0.3, 0.4, 0.5, 0.6, 9.0)]
    assert rise == pytest.approx([0.0, 2.2, 4.4, 6.6, 8.8, 8.8])


def test_no_duration_no_distance() -> None:
    assert PROFILES["paper"].travel(10.0, 0.3, 0.0) == (0.0, 10.0)


@pytest.mark.parametrize(
    ("name", "least_ttc_s"),
    [
        # Euro NCAP fact sheet, theoretical limits: 1 ms integration of the same profiles, two decimals
        (BrakeConfig(0.0, 0.0, 9.0), (0.15, 0.31, 0.46, 0.62, 0.77, 0.93)),
        (BrakeConfig(0.1, 0.3, 9.0), (0.39, 0.55, 0.71, 0.86, 1.02, 1.17)),
        (BrakeConfig(0.2, 0.4, 9.0), (0.53, 0.70, 0.86, 1.01, 1.17, 1.32)),
        (BrakeConfig(0.1, 0.3, 5.0), (0.52, 0.80, 1.08, 1.36, 1.64, 1.92)),
        (BrakeConfig(0.1, 0.3, 6.0), (0.47, 0.71, 0.94, 1.17, 1.41, 1.64)),
        (BrakeConfig(0.1, 0.3, 2.5), (0.80, 1.36, 1.92, 2.47, 3.03, 3.58)),
    ],
    ids=["ideal", "0.1+0.3", "0.2+0.4", "R152", "wet", "snow"],
)
def test_least_time_to_collision_that_still_avoids_the_impact(
    name: BrakeConfig, least_ttc_s: tuple[float, ...]
) -> None:
    for speed_kmh, ttc in zip((10, 20, 30, 40, 50, 60), least_ttc_s, strict=True):
        speed = speed_kmh * KMH
        assert name.travel(speed, 0.0, 60.0)[0] / speed == pytest.approx(ttc, abs=0.006)


@pytest.mark.parametrize(
    ("enters_at_ttc_s", "impact_kmh"),
    [
        # fact sheet: 9 m/s2 with 0.2 + 0.4 s, requested when the pedestrian enters the corridor; where the
        # pedestrian is still there at contact
        (0.586, {20: 12.0, 30: 22.9, 40: 33.2, 50: 43.4, 60: 53.5}),
        (0.913, {40: 16.1, 50: 28.7, 60: 39.9}),
        (1.239, {60: 18.0}),
    ],
    ids=["CPNA-25", "CPNA-50", "CPNA-75"],
)
def test_impact_speeds_of_the_fact_sheet(enters_at_ttc_s: float, impact_kmh: dict[int, float]) -> None:
    brakes = BrakeConfig(0.2, 0.4, 9.0)
    for speed_kmh, impact in impact_kmh.items():
        speed = speed_kmh * KMH
        # the sheet gives the time to three decimals, which is worth up to 0.1 km/h near standstill
        left = speed_at(brakes, speed, speed * enters_at_ttc_s)
        assert left / KMH == pytest.approx(impact, abs=0.15)


@pytest.mark.parametrize("values", [(-0.1, 0.4, 9.0), (0.2, -0.4, 9.0), (0.2, 0.4, 0.0), (0.2, 0.4, -9.0)])
def test_impossible_brakes_are_refused(values: tuple[float, float, float]) -> None:
    with pytest.raises(ScenarioError, match=r"brakes: .* got"):
        BrakeConfig(*values)


def test_less_friction_means_a_longer_way() -> None:
    ways = [
        BrakeConfig(0.2, 0.4, 8.8 * mu / 0.9).travel(15.0, 0.0, 60.0)[0] for mu in (0.9, 0.65, 0.55, 0.22)
    ]
    assert np.all(np.diff(ways) > 0)


# --- partial brakes ---------------------------------------------------------------------------------------


def test_a_partial_brake_by_hand() -> None:
    """3.8 m/s2 at the rate of 8.8 m/s2 in 0.4 s, 22 m/s3: it is there 0.2 + 3.8/22 s after the request.

    From 15 m/s: 3.0 m of delay; in the ramp t = 0.17273 s it drives 15 t - 22 t^3/6 = 2.5720 m and loses
    3.8 t/2 = 0.3282 m/s; then 14.67182^2 / 7.6 = 28.3240 m.
    """
    brakes = PROFILES["real car"]
    partial = brakes.requested(3.8)
    assert partial.decel_mps2(0.2 + 0.1) == pytest.approx(2.2)
    assert partial.decel_mps2(0.2 + 3.8 / 22 + 1e-9) == pytest.approx(3.8)
    assert brakes.travel(15.0, 0.0, 60.0, partial) == (pytest.approx(33.8960, abs=1e-4), 0.0)


def test_more_than_the_brakes_give_is_all_that_they_give() -> None:
    brakes = PROFILES["snow"]
    assert brakes.requested(9.8) == brakes.requested() == brakes.requested(2.15)
    assert brakes.travel(9.0, 0.0, 1.0, brakes.requested(9.8)) == brakes.travel(9.0, 0.0, 1.0)


@pytest.mark.parametrize("name", ["real car", "delay only", "paper"])
@pytest.mark.parametrize("second", [1.0, 5.3, None])
@pytest.mark.parametrize("change_s", [0.1, 0.25, 0.45, 1.5])
def test_a_change_of_stage_agrees_with_a_numerical_integration(
    name: str, second: float | None, change_s: float
) -> None:
    """The deceleration follows what is asked at the rate of the build-up, after the delay of the first."""
    brakes, speed, step = PROFILES[name], 40.0, 1e-4
    rate = brakes.max_decel_mps2 / brakes.build_up_s if brakes.build_up_s else math.inf
    decel, left, distance = 0.0, speed, 0.0
    for k in range(round(2.5 / step)):
        time = (k + 0.5) * step
        asked = 3.8 if time < change_s else second or brakes.max_decel_mps2
        if time > brakes.delay_s:
            decel += max(min(asked - decel, rate * step), -rate * step)
        distance += left * step - decel * step**2 / 2
        left -= decel * step
    first = brakes.requested(3.8)
    before, speed_then = brakes.travel(speed, 0.0, change_s, first)
    stage = brakes.changed(first, change_s, second)
    after, speed_left = brakes.travel(speed_then, change_s, 2.5 - change_s, stage)
    assert speed_left == pytest.approx(left, abs=2e-3)
    assert before + after == pytest.approx(distance, abs=4e-3)


@given(
    profiles,
    st.floats(0.1, 40.0),
    st.floats(0.0, 2.0),
    st.lists(st.none() | st.floats(0.1, 12.0), min_size=1, max_size=4),
)
def test_stages_one_after_the_other_never_jump(
    brakes: BrakeConfig, first: float, step_s: float, asked: list[float | None]
) -> None:
    """The deceleration is continuous at every change, and ends at what was asked last, if there is time."""
    stage, now = brakes.requested(first), 0.0
    for decel in asked:
        now += step_s
        changed = brakes.changed(stage, now, decel)
        if now > brakes.delay_s:
            assert changed.decel_mps2(now) == pytest.approx(stage.decel_mps2(now), abs=1e-9)
        stage = changed
    final = min(asked[-1] or math.inf, brakes.max_decel_mps2)
    assert stage.decel_mps2(now + brakes.delay_s + brakes.build_up_s + 1e-9) == pytest.approx(final)
