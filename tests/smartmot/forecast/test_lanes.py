"""Forecasts along lanes: at a fork of a made map, and on maps of OpenDRIVE and Argoverse 2."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from scenarios.recorded.maps.drive_map import load_drive_map
from smartmot.forecast import ForecastConfig, forecast_times, forecast_tracks
from smartmot.forecast.lanes import MOST_WAYS, LaneForecaster
from smartmot.maps.walks import lane_ends
from smartmot.types import Boxes, Tracks
from tests.smartmot.maps.polyline_map import Lane, PolylineMap

TIMES = forecast_times(3.0, 0.5)
CONFIG = ForecastConfig(model="class")
RADIUS_M = 12.0
LOGS = Path(__file__).resolve().parents[4] / "shared" / "argoverse2" / "logs"
"""Beside the project; elsewhere the test is skipped."""


def _fork() -> PolylineMap:
    """50 m eastwards; there straight on for 100 m, or to the left by 90 degrees and 100 m northwards."""
    angle = np.linspace(0.0, 0.5 * np.pi, 16)
    arc = np.column_stack((50.0 + RADIUS_M * np.sin(angle), RADIUS_M * (1.0 - np.cos(angle)))).tolist()
    end = arc[-1]
    return PolylineMap(
        [
            Lane([(0.0, 0.0), (50.0, 0.0)], next_lanes=(1, 2)),
            Lane([(50.0, 0.0), (150.0, 0.0)]),
            Lane([tuple(point) for point in arc], next_lanes=(3,)),
            Lane([tuple(end), (end[0], end[1] + 100.0)]),
        ]
    )


def _track(
    x: float, y: float, speed: float, course: float = 0.0, rate: float = 0.0, category: str = "car"
) -> Tracks:
    """One track, surely estimated."""
    covariance = np.zeros((1, 9, 9))
    covariance[0, range(9), range(9)] = 1e-4
    return Tracks(
        stamp_s=0.0,
        track_id=np.ones(1),
        boxes=Boxes(np.array([[x, y]]), np.array([[4.4, 1.8]]), np.array([course])),
        category=np.array([category]),
        score=np.ones(1),
        mean=np.zeros((1, 9)),
        covariance=covariance,
        velocity_mps=speed * np.array([[np.cos(course), np.sin(course)]]),
        yaw_rate_radps=np.array([rate]),
        age_s=np.ones(1),
        coasted_s=np.zeros(1),
        confirmed=np.ones(1, dtype=np.bool_),
        dynamic=np.ones(1, dtype=np.bool_),
    )


@pytest.fixture(scope="module")
def fork() -> LaneForecaster:
    return LaneForecaster(_fork())


def test_both_ways_of_a_fork_are_told(fork: LaneForecaster) -> None:
    """Six metres per second, 8 m before the fork: straight on is likelier, the turn is possible."""
    told = fork.forecast(_track(42.0, 0.3, 6.0), TIMES, CONFIG)
    assert told.along_lane.tolist() == [True, True, False]
    assert told.probability[0] > 2.0 * told.probability[1] > 0.2
    straight, turn = told.forecast.center_m[0, -1], told.forecast.center_m[1, -1]
    np.testing.assert_allclose(straight, [60.0, 0.3], atol=0.05)
    # 10 m along an arc of 12 m, 0.3 m inside it; the motion alone still counts for 2 %
    angle = 10.0 / RADIUS_M
    on_arc = 50.0 + (RADIUS_M - 0.3) * np.sin(angle), RADIUS_M - (RADIUS_M - 0.3) * np.cos(angle)
    np.testing.assert_allclose(turn, on_arc, atol=0.2)
    assert told.forecast.yaw_rad[1, -1] == pytest.approx(angle, abs=0.1)


def test_who_turns_is_seen_to_turn(fork: LaneForecaster) -> None:
    turning = fork.forecast(_track(51.0, 0.05, 6.0, 1.0 / RADIUS_M, 6.0 / RADIUS_M), TIMES, CONFIG)
    assert turning.forecast.yaw_rad[0, -1] > 1.0
    assert turning.probability[0] > 0.8


def test_headings_begin_after_the_delay() -> None:
    """Far from lanes: half a second of 0.2 rad/s is in the heading now, as without a map."""
    nowhere = LaneForecaster(PolylineMap([Lane([(900.0, 900.0), (999.0, 900.0)])]))
    track = _track(0.0, 0.0, 8.0, rate=0.2)
    alone = forecast_tracks(track, TIMES, CONFIG, 0.5)
    beside = nowhere.forecast(track, TIMES, CONFIG, 0.5).forecast
    np.testing.assert_allclose(beside.yaw_rad[0], alone.yaw_rad[0], atol=1e-9)
    assert beside.yaw_rad[0, 0] > 0.05


def test_nobody_turns_at_speed(fork: LaneForecaster) -> None:
    """At 20 m/s the turn would take 33 m/s2: the ways are straight on and the motion alone."""
    told = fork.forecast(_track(42.0, 0.0, 20.0), TIMES, CONFIG)
    assert told.probability[0] > 0.9
    assert told.probability[2] < 1e-6
    np.testing.assert_allclose(told.forecast.center_m[0, -1], [102.0, 0.0], atol=1e-3)


@pytest.mark.parametrize(
    "track",
    [
        _track(42.0, 0.0, 1.4, category="pedestrian"),
        _track(42.0, 0.0, 0.2),
        _track(42.0, 0.0, 6.0, course=np.pi / 2),
        _track(42.0, 0.0, 6.0, course=np.pi),
        _track(42.0, 9.0, 6.0),
    ],
    ids=["pedestrian", "slow", "across", "wrong way", "beside"],
)
def test_what_follows_no_lane_moves_as_without_a_map(fork: LaneForecaster, track: Tracks) -> None:
    told = fork.forecast(track, TIMES, CONFIG)
    free = forecast_tracks(track, TIMES, CONFIG)
    assert told.probability.tolist() == [1.0]
    assert not told.along_lane.any()
    for name in ("center_m", "yaw_rad", "covariance_m2"):
        np.testing.assert_allclose(getattr(told.forecast, name), getattr(free, name), atol=1e-9)


def test_the_lane_bounds_the_region_across_it(fork: LaneForecaster) -> None:
    track = _track(10.0, 0.0, 8.0)
    told, free = fork.forecast(track, TIMES, CONFIG), forecast_tracks(track, TIMES, CONFIG)
    assert told.forecast.covariance_m2 is not None
    assert free.covariance_m2 is not None
    along, across = (told.forecast.covariance_m2[0, -1, k, k] for k in (0, 1))
    assert along == pytest.approx(free.covariance_m2[0, -1, 0, 0])
    assert across == pytest.approx(1.0 / (1.0 / free.covariance_m2[0, -1, 1, 1] + 1.0 / 0.5**2))


def test_no_tracks_have_no_hypotheses(fork: LaneForecaster) -> None:
    told = fork.forecast(_track(0.0, 0.0, 1.0)[np.zeros(0, dtype=np.int64)], TIMES, CONFIG)
    assert len(told.forecast) == len(told.probability) == 0


@settings(max_examples=60)
@given(
    st.floats(-20.0, 170.0),
    st.floats(-4.0, 40.0),
    st.floats(0.0, 40.0),
    st.floats(-np.pi, np.pi),
    st.floats(-1.5, 1.5),
    st.sampled_from(["car", "cyclist", "pedestrian", "truck"]),
)
def test_laws(x: float, y: float, speed: float, course: float, rate: float, category: str) -> None:
    """Probabilities sum to 1 and fall; every hypothesis begins where the track is, and is finite."""
    told = FORK.forecast(_track(x, y, speed, course, rate, category), TIMES, CONFIG)
    assert told.probability.sum() == pytest.approx(1.0)
    assert (np.diff(told.probability) <= 0.0).all()
    assert 1 <= len(told.probability) <= MOST_WAYS
    assert (~told.along_lane).sum() == 1
    np.testing.assert_allclose(told.forecast.center_m[:, 0], np.tile([x, y], (len(told.track), 1)), atol=1e-9)
    covariance = told.forecast.covariance_m2
    assert covariance is not None
    assert (np.linalg.eigvalsh(covariance) > -1e-9).all()


FORK = LaneForecaster(_fork())


def _before_forks(network: Any) -> tuple[int, int, int]:
    """Driving lanes before a fork; those told all ways; those where the likeliest way follows lanes."""
    lanes, forecaster = network.lanes, LaneForecaster(network)
    forks = told_all = first = 0
    for lane in range(len(lanes.lane_type)):
        following = [k for k in network.successors(lane) if lanes.lane_type[k] == "driving"]
        if lanes.lane_type[lane] != "driving" or len(following) < 2:
            continue
        _, leaves = lane_ends(network, lane)
        back = np.clip(leaves - 3.0 * lanes.direction[lane], lanes.s_start_m[lane], lanes.s_end_m[lane])
        x, y, _, heading = network.center_line(lane, np.array([back]))
        forks += 1
        told = forecaster.forecast(_track(float(x[0]), float(y[0]), 5.0, float(heading[0])), TIMES, CONFIG)
        first += int(told.along_lane[0])
        told_all += int(told.along_lane.sum()) >= len(following)
    return forks, told_all, first


def test_forks_of_an_opendrive_map() -> None:
    forks, told_all, first = _before_forks(load_map(shipped_map("urban_intersection")))
    assert forks == told_all == first >= 4


@pytest.mark.skipif(not LOGS.is_dir(), reason="needs shared/argoverse2 beside the project")
def test_forks_of_an_argoverse_map() -> None:
    """Some lanes of this map bend at once, so that a car that still drives straight fits none of them."""
    forks, told_all, first = _before_forks(load_drive_map(LOGS / "7fab2350-7eaf-3b7e-a39d-6937a4c1bede"))
    assert forks == told_all >= 10
    assert first >= 0.8 * forks
