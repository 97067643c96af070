from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from smartmot.errors import ConfigError
from smartmot.forecast import (
    CHI2_95,
    SPREAD_M2PS3,
    ForecastConfig,
    Motion,
    class_motion,
    forecast_covariance,
    forecast_ego,
    forecast_ego_along,
    forecast_times,
    forecast_tracks,
)
from smartmot.maps.route import route_ahead
from smartmot.types import CATEGORIES, Boxes, EgoState, FloatArray, Tracks

TIMES = forecast_times(3.0, 0.1)


def _tracks(
    velocity: FloatArray | list[list[float]],
    yaw_rate: FloatArray | list[float] | None = None,
    *,
    center: FloatArray | None = None,
    yaw: FloatArray | list[float] | None = None,
    dynamic: bool | list[bool] = True,
    stamp_s: float = 0.0,
) -> Tracks:
    velocity = np.array(velocity, dtype=float).reshape(-1, 2)
    m = len(velocity)
    course = np.arctan2(velocity[:, 1], velocity[:, 0]) if yaw is None else np.array(yaw, dtype=float)
    return Tracks(
        stamp_s=stamp_s,
        track_id=np.arange(1, m + 1),
        boxes=Boxes(np.zeros((m, 2)) if center is None else center, np.full((m, 2), 0.5), course),
        category=np.full(m, "pedestrian"),
        score=np.ones(m),
        mean=np.zeros((m, 9)),
        covariance=np.zeros((m, 9, 9)),
        velocity_mps=velocity,
        yaw_rate_radps=np.zeros(m) if yaw_rate is None else np.array(yaw_rate, dtype=float),
        age_s=np.ones(m),
        coasted_s=np.zeros(m),
        confirmed=np.ones(m, dtype=bool),
        dynamic=np.broadcast_to(dynamic, m),
    )


def _unicycle(x: float, y: float, yaw: float, speed: float, rate: float, times: FloatArray) -> FloatArray:
    """(T, 3) poses of x' = v cos(yaw), y' = v sin(yaw), yaw' = rate, integrated numerically."""

    def slope(_: float, state: FloatArray) -> list[float]:
        return [speed * np.cos(state[2]), speed * np.sin(state[2]), rate]

    solved = solve_ivp(slope, (0.0, times[-1]), [x, y, yaw], t_eval=times, rtol=1e-10, atol=1e-10)
    return np.asarray(solved.y.T)


@settings(max_examples=40, deadline=None)
@given(
    yaw=st.floats(-np.pi, np.pi),
    speed=st.floats(0.01, 40.0),
    rate=st.one_of(st.floats(-1.0, 1.0), st.sampled_from([0.0, 1e-9, -1e-7, 1e-4])),
)
def test_ctrv_against_the_integrated_unicycle(yaw: float, speed: float, rate: float) -> None:
    truth = _unicycle(4.0, -9.0, yaw, speed, rate, TIMES)
    ego = forecast_ego(EgoState(0.0, 4.0, -9.0, yaw, speed, yaw_rate_radps=rate), TIMES)
    np.testing.assert_allclose(ego.center_m[0], truth[:, :2], atol=1e-6)
    np.testing.assert_allclose(ego.yaw_rad[0], truth[:, 2], atol=1e-9)
    velocity = [[speed * np.cos(yaw), speed * np.sin(yaw)]]
    tracks = _tracks(velocity, [rate], center=np.array([[4.0, -9.0]]))
    track = forecast_tracks(tracks, TIMES, ForecastConfig())
    np.testing.assert_allclose(track.center_m[0], truth[:, :2], atol=1e-6)


def test_turn_rate_towards_zero_becomes_the_straight_line() -> None:
    rates = np.array([0.0, 1e-15, 1e-12, 1e-9, 1e-6])
    forecast = forecast_tracks(_tracks(np.tile([10.0, 0.0], (5, 1)), rates), TIMES, ForecastConfig())
    assert np.isfinite(forecast.center_m).all()
    np.testing.assert_allclose(forecast.center_m[0, :, 0], 10.0 * TIMES)
    np.testing.assert_allclose(forecast.center_m[:, :, 1], 0.5 * 10.0 * rates[:, None] * TIMES**2, atol=1e-9)


def test_full_circle_by_hand() -> None:
    """2 m/s at 1 rad/s: a circle of 2 m radius about (0, 2)."""
    times = np.array([0.0, np.pi / 2, np.pi, 2 * np.pi])
    forecast = forecast_tracks(_tracks([[2.0, 0.0]], [1.0]), times, ForecastConfig())
    np.testing.assert_allclose(forecast.center_m[0], [[0, 0], [2, 2], [0, 4], [0, 0]], atol=1e-12)
    np.testing.assert_allclose(forecast.yaw_rad[0], times)


def test_static_tracks_stay_whatever_their_estimate_says() -> None:
    center = np.array([[1.0, 2.0], [1.0, 2.0]])
    tracks = _tracks([[0.4, 0.1], [0.4, 0.1]], [0.7, 0.7], center=center, dynamic=[False, True])
    forecast = forecast_tracks(tracks, TIMES, ForecastConfig(), 0.3)
    np.testing.assert_array_equal(forecast.center_m[0], np.tile([1.0, 2.0], (len(TIMES), 1)))
    np.testing.assert_array_equal(forecast.yaw_rad[0], np.full(len(TIMES), tracks.boxes.yaw_rad[0]))
    assert np.hypot(*(forecast.center_m[1, -1] - (1.0, 2.0))) > 0.5


def test_box_heading_may_differ_from_the_course() -> None:
    """A car that reverses keeps its heading and moves along its velocity."""
    forecast = forecast_tracks(_tracks([[-2.0, 0.0]], yaw=[0.0]), TIMES, ForecastConfig())
    np.testing.assert_allclose(forecast.center_m[0, -1], [-6.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(forecast.yaw_rad[0], 0.0)


def test_latency_is_caught_up() -> None:
    """An estimate that is 0.2 s old is moved on by 0.2 s on its own curve."""
    tracks = _tracks([[3.0, 4.0]], [0.5], stamp_s=1.0)
    late = forecast_tracks(tracks, TIMES, ForecastConfig(), 0.2)
    prompt = forecast_tracks(tracks, TIMES + 0.2, ForecastConfig())
    np.testing.assert_allclose(late.center_m, prompt.center_m)
    np.testing.assert_allclose(late.yaw_rad, prompt.yaw_rad)
    np.testing.assert_array_equal(late.time_s, TIMES)


def test_turn_rate_is_limited() -> None:
    config = ForecastConfig(max_yaw_rate_radps=0.5)
    wild, limit = (forecast_tracks(_tracks([[2.0, 0.0]], [w]), TIMES, config) for w in (-9.0, -0.5))
    np.testing.assert_allclose(wild.center_m, limit.center_m)


@pytest.mark.parametrize(
    ("horizon", "step", "count", "last"), [(3.0, 0.1, 31, 3.0), (3.05, 0.1, 32, 3.1), (0.3, 0.1, 4, 0.3)]
)
def test_times_start_now_and_reach_the_horizon(horizon: float, step: float, count: int, last: float) -> None:
    times = forecast_times(horizon, step)
    assert len(times) == count
    assert times[0] == 0.0
    assert times[-1] == pytest.approx(last)
    np.testing.assert_allclose(np.diff(times), step)


def test_the_callers_times_stay_writeable() -> None:
    times = np.array([0.0, 1.0])
    forecast = forecast_tracks(_tracks([[2.0, 0.0]]), times, ForecastConfig())
    times[1] = 9.0
    assert forecast.time_s.tolist() == [0.0, 1.0]


def test_no_tracks() -> None:
    forecast = forecast_tracks(_tracks(np.zeros((0, 2))), TIMES, ForecastConfig())
    assert forecast.center_m.shape == (0, 31, 2)


@pytest.mark.parametrize(
    "settings",
    [
        {"step_s": 0.0},
        {"step_s": 3.5},
        {"min_horizon_s": 7.0},
        {"max_yaw_rate_radps": -0.1},
    ],
)
def test_impossible_settings_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        ForecastConfig(**settings)


# --- along the route ----------------------------------------------------------------------------------


def test_ego_along_its_route_follows_the_bend() -> None:
    """On the shipped bend's arc (radius 60 m, lane centre 1.75 m outside it) the ego stays on its circle."""
    network = load_map(shipped_map("urban_bend"))
    lane = network.lane_index_of(("1", 0, -1))
    route = route_ahead(network, lane, s_m=240.0, ahead_m=100.0)
    s_m = np.linspace(240.0, 280.0, 50)
    x, y, _, heading = network.center_line(lane, s_m)
    ego = EgoState(0.0, float(x[0]), float(y[0]), float(heading[0]), 8.0)
    ahead = forecast_ego_along(ego, route, np.arange(31) * 0.1)
    distance = np.hypot(ahead.center_m[0, :, None, 0] - x[None], ahead.center_m[0, :, None, 1] - y[None])
    driven = np.hypot(*np.diff(ahead.center_m[0], axis=0).T)
    assert distance.min(axis=1).max() < 0.5  # between samples of the lane, 0.8 m apart
    np.testing.assert_allclose(driven, 0.8, rtol=1e-3)
    turned = np.unwrap(ahead.yaw_rad[0])
    assert turned[-1] - turned[0] == pytest.approx(24.0 / 61.75, abs=0.04)  # chords turn in steps of 0.03
    straight = forecast_ego(ego, np.arange(31) * 0.1)
    assert np.hypot(*(straight.center_m[0, -1] - ahead.center_m[0, -1])) > 4.0


def test_ego_beside_its_route_keeps_its_offset() -> None:
    network = load_map(shipped_map("urban_street"))
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), s_m=100.0, ahead_m=200.0)
    ego = EgoState(0.0, 100.0, -1.75 + 0.4, 0.1, 10.0)
    ahead = forecast_ego_along(ego, route, np.array([0.0, 1.0, 3.0, 100.0]))
    np.testing.assert_allclose(ahead.center_m[0], [[100, -1.35], [110, -1.35], [130, -1.35], [1100, -1.35]])
    np.testing.assert_allclose(ahead.yaw_rad[0], 0.0, atol=1e-12)
    on_it = forecast_ego_along(ego, route, np.array([0.0, 1.0]), keeps_offset=False)
    np.testing.assert_allclose(on_it.center_m[0], [[100, -1.75], [110, -1.75]])


def test_unknown_ego_forecast_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"ego must be one of ctrv, path, got 'magic'"):
        ForecastConfig(ego="magic")


BY_CLASS = ForecastConfig(model="class")


def test_by_class_pedestrians_go_straight_on_and_vehicles_leave_their_bend() -> None:
    walker = _tracks([[1.4, 0.0]], [0.8])
    straight = forecast_tracks(walker, TIMES, BY_CLASS)
    np.testing.assert_allclose(straight.center_m[0], 1.4 * TIMES[:, None] * [1.0, 0.0], atol=1e-9)
    np.testing.assert_allclose(straight.yaw_rad[0], 0.0, atol=1e-9)
    car = replace(_tracks([[10.0, 0.0]], [0.4]), category=np.array(["car"]))
    bend = forecast_tracks(car, TIMES, BY_CLASS)
    # in all it turns by the rate times the memory of 1 s
    np.testing.assert_allclose(bend.yaw_rad[0], 0.4 * (1.0 - np.exp(-TIMES)), atol=1e-9)
    assert 0.0 < bend.center_m[0, -1, 1] < forecast_tracks(car, TIMES, ForecastConfig()).center_m[0, -1, 1]


def test_by_class_a_known_acceleration_fades() -> None:
    """10 m/s and -4 m/s2 that fade over 0.5 s: 2 m/s slower in the end."""
    mean = np.zeros((1, 11))
    mean[0, 9] = -4.0
    car = replace(
        _tracks([[10.0, 0.0]]), category=np.array(["car"]), mean=mean, covariance=np.zeros((1, 11, 11))
    )
    x = forecast_tracks(car, TIMES, BY_CLASS).center_m[0, :, 0]
    np.testing.assert_allclose(
        x, 10.0 * TIMES - 2.0 * (TIMES - 0.5 * (1.0 - np.exp(-TIMES / 0.5))), atol=1e-6
    )


def test_by_class_a_velocity_within_its_noise_is_none() -> None:
    """A parked car drifts by 10 cm/s with 20 cm/s of noise; one at 0.4 m/s keeps three quarters of it."""
    covariance = np.zeros((2, 9, 9))
    covariance[:, 5, 5] = covariance[:, 6, 6] = 0.04
    tracks = replace(
        _tracks([[0.1, 0.0], [0.4, 0.0]], dynamic=False),
        category=np.array(["car", "car"]),
        mean=np.zeros((2, 9)),
        covariance=covariance,
    )
    forecast = forecast_tracks(tracks, TIMES, BY_CLASS)
    assert (forecast.center_m[0] == 0.0).all()
    np.testing.assert_allclose(forecast.center_m[1, :, 0], 0.3 * TIMES, atol=1e-9)


def test_forecasts_by_class_carry_the_region() -> None:
    tracks = _tracks([[1.4, 0.0]])
    forecast = forecast_tracks(tracks, TIMES, BY_CLASS, delay_s=0.2)
    assert forecast.covariance_m2 is not None
    code = np.array([CATEGORIES.index("pedestrian")])
    np.testing.assert_array_equal(
        forecast.covariance_m2, forecast_covariance(tracks.covariance, code, TIMES + 0.2)
    )
    assert forecast_tracks(tracks, TIMES, ForecastConfig()).covariance_m2 is None


CAR = np.array([CATEGORIES.index("car")])


def _motion(covariance: FloatArray, velocity: list[float], rate: float, acceleration: list[float]) -> Motion:
    return class_motion(
        np.array([velocity]), np.zeros(1), np.array([rate]), np.array([acceleration]), covariance[None], CAR
    )


def test_turn_rates_within_their_noise_are_none() -> None:
    covariance = np.zeros((9, 9))
    covariance[8, 8] = 0.01
    rates = [_motion(covariance, [5.0, 0.0], rate, [0.0, 0.0]).yaw_rate_radps[0] for rate in (0.05, 0.2)]
    np.testing.assert_allclose(rates, [0.0, 0.2 * 0.75])
    unknown = _motion(np.zeros((0, 0)), [5.0, 0.0], 0.05, [0.0, 0.0])
    assert unknown.yaw_rate_radps.tolist() == [0.05]


def test_what_has_wheels_does_not_go_sideways() -> None:
    """A car heads along x with a velocity at 45 degrees to it that is unsure; its heading is sure."""
    covariance = np.zeros((9, 9))
    covariance[5, 5] = covariance[6, 6] = 1.0
    across = _motion(covariance, [5.0, 5.0], 0.0, [0.0, 0.0]).velocity_mps[0]
    kept = 0.3**2 / (1.0 + 0.3**2)
    assert across[1] / across[0] == pytest.approx(kept)
    squared = 25.0 + (5.0 * kept) ** 2
    assert np.hypot(*across) == pytest.approx(np.sqrt(squared) * (1.0 - 1.0 / squared))
    sure = _motion(np.zeros((9, 9)), [5.0, 5.0], 0.0, [0.0, 0.0]).velocity_mps[0]
    np.testing.assert_allclose(sure, [5.0, 5.0])


def test_a_lateral_acceleration_is_a_turn_rate() -> None:
    """10 m/s and 3 m/s2 to the left are 0.3 rad/s; unsure as the heading's rate, it counts as much."""
    covariance = np.zeros((11, 11))
    covariance[8, 8], covariance[10, 10] = 1e-6, 1e-6 * 10.0**2
    motion = _motion(covariance, [10.0, 0.0], 0.1, [-2.0, 3.0])
    assert motion.yaw_rate_radps[0] == pytest.approx(0.5 * (0.1 + 0.3), abs=1e-4)
    assert motion.acceleration_mps2[0] == pytest.approx(-2.0)
    fast = _motion(covariance, [30.0, 0.0], 0.5, [0.0, 15.0])
    assert fast.yaw_rate_radps[0] == pytest.approx(4.0 / 30.0)  # no car corners harder


def test_the_region_of_a_forecast_by_hand() -> None:
    """After 2 s: position, velocity and their covariance, and the acceleration that nobody knows."""
    covariance = np.zeros((1, 9, 9))
    covariance[0, 0, 0], covariance[0, 5, 5], covariance[0, 0, 5] = 0.04, 0.25, 0.05
    covariance[0, 5, 0] = 0.05
    code = np.array([CATEGORIES.index("car")])
    region = forecast_covariance(covariance, code, np.array([0.0, 2.0]))
    unknown = SPREAD_M2PS3[code[0]] * 2.0**3 / 3.0
    np.testing.assert_allclose(region[0, :, 0, 0], [0.04, 0.04 + 2 * 2.0 * 0.05 + 4.0 * 0.25 + unknown])
    np.testing.assert_allclose(region[0, :, 1, 1], [0.0, unknown])
    assert (region[..., 0, 1] == 0.0).all()


def test_what_x_and_y_share_stays_in_the_region() -> None:
    """A covariance turned by 45 degrees: carried on, it is that of the turned motion."""
    code, time = np.array([CATEGORIES.index("car")]), np.array([0.0, 1.5])
    straight = np.zeros((1, 9, 9))
    straight[0, range(7), range(7)] = 0.04, 0.25, 0.0, 0.0, 0.0, 0.09, 0.01
    straight[0, 0, 5] = straight[0, 5, 0] = 0.03
    turn = np.array([[1.0, -1.0], [1.0, 1.0]]) / np.sqrt(2.0)
    whole = np.eye(9)
    whole[:2, :2] = whole[5:7, 5:7] = turn
    turned = whole @ straight @ whole.T
    unknown = (SPREAD_M2PS3[code[0]] * time**3 / 3.0)[:, None, None] * np.eye(2)
    along = forecast_covariance(straight, code, time)[0] - unknown
    np.testing.assert_allclose(
        forecast_covariance(turned, code, time)[0] - unknown, turn @ along @ turn.T, atol=1e-12
    )


def test_a_filter_without_turn_rate_turns_as_its_acceleration_says() -> None:
    """10 m/s and 3 m/s2 to the left are 0.3 rad/s; the rate of 0 that such a filter gives is no estimate."""
    covariance = np.zeros((11, 11))
    covariance[9, 9] = covariance[10, 10] = 1e-4
    motion = _motion(covariance, [10.0, 0.0], 0.0, [0.0, 3.0])
    assert motion.yaw_rate_radps[0] == pytest.approx(0.3, rel=1e-3)


def test_the_region_holds_the_truth_as_often_as_it_says() -> None:
    """Objects that white noise of that density disturbs, from an exact start: 95 % after 3 s."""
    rng, steps, dt_s = np.random.default_rng(0), 300, 0.01
    code = CATEGORIES.index("pedestrian")
    velocity = np.cumsum(rng.normal(0.0, np.sqrt(SPREAD_M2PS3[code] * dt_s), (4000, steps, 2)), axis=1)
    error = velocity.sum(axis=1) * dt_s
    region = forecast_covariance(np.zeros((1, 9, 9)), np.array([code]), np.array([3.0]))[0, 0]
    inside = (error * np.linalg.solve(region, error.T).T).sum(axis=1) <= CHI2_95
    assert inside.mean() == pytest.approx(0.95, abs=0.015)


def test_an_unknown_model_is_refused() -> None:
    with pytest.raises(ConfigError, match="forecast: model must be one of ctrv, class, got 'best'"):
        ForecastConfig(model="best")


@pytest.mark.parametrize("speed_mps", [13.9, -3.0, 0.0])
def test_ego_without_turn_is_the_limit_of_small_turns(speed_mps: float) -> None:
    ego = EgoState(0.0, 5.0, -2.0, 2.1, speed_mps)
    straight, turning = (forecast_ego(replace(ego, yaw_rate_radps=rate), TIMES) for rate in (0.0, 1e-11))
    np.testing.assert_allclose(straight.center_m, turning.center_m, rtol=0.0, atol=1e-8)
    np.testing.assert_allclose(straight.yaw_rad, turning.yaw_rad, rtol=0.0, atol=1e-9)
    way = straight.center_m[0, -1] - straight.center_m[0, 0]
    np.testing.assert_allclose(way, 3.0 * speed_mps * np.array([np.cos(2.1), np.sin(2.1)]), atol=1e-12)


def test_forecasts_of_moving_tracks_do_not_depend_on_those_beside_them() -> None:
    rng = np.random.default_rng(6)
    velocity, rate = rng.uniform(-9.0, 9.0, (6, 2)), rng.uniform(-2.0, 2.0, 6)
    center, yaw = rng.uniform(-50.0, 50.0, (6, 2)), rng.uniform(-3.0, 3.0, 6)
    moving = _tracks(velocity, rate, center=center, yaw=yaw)
    mixed = _tracks(velocity, rate, center=center, yaw=yaw, dynamic=[True, False, True, True, False, True])
    alone, beside = (forecast_tracks(tracks, TIMES, ForecastConfig(), 0.03) for tracks in (moving, mixed))
    rows = mixed.dynamic
    np.testing.assert_array_equal(beside.center_m[rows], alone.center_m[rows])
    np.testing.assert_array_equal(beside.yaw_rad[rows], alone.yaw_rad[rows])
    np.testing.assert_array_equal(
        beside.center_m[~rows], np.broadcast_to(center[~rows, None], (2, len(TIMES), 2))
    )
