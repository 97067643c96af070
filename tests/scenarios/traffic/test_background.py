"""Vehicles and pedestrians of SUMO in step with the engine, against closed forms."""

import copy
import math
import pickle

import numpy as np
import pytest

from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import ScenarioError
from scenarios.openscenario.control import BrakeAt
from scenarios.openscenario.running.engine import Engine
from scenarios.openscenario.running.results import Run
from scenarios.simulation.ends import THROUGH
from scenarios.spec import RunSpec, definition_of, simulation_of
from scenarios.traffic import SumoTraffic, Traffic, with_traffic

pytestmark = pytest.mark.usefixtures("sumo")

EXACT = "reaction_s=0.1,sigma=0,min_gap_m=0"
EGO_AND_CAR_M = 4.4 / 2 + 5.0 / 2
"""Between the middles of the shipped ego and a car behind that touches it."""


def engine_of(text: str, speed_kmh: float, brake_s: float, decel_mps2: float, seed: int = 1) -> Engine:
    """A long drive on a straight street between two standing cars, with a brake at a time."""
    parameters = (("Ego_speed_kmh", speed_kmh), ("Line_x", 590.0), ("Start_s", 1800.0 / speed_kmh))
    definition = definition_of(
        RunSpec("long", "pass_through", parameters, "none", "physical", "dry", speed_kmh)
    )
    traffic = Traffic.parsed(text)
    definition = with_traffic(definition, traffic)
    assert definition.map_path is not None
    background = SumoTraffic(traffic, definition.map_path, seed)
    return Engine(definition, BrakeAt(brake_s, decel_mps2), background=background)


def gaps_m(run: Run, name: str = "traffic follower 1", ahead: str = "Ego") -> np.ndarray:
    """(T,) free distance behind the ego, or behind another car, on the straight street."""
    names = list(run.names)
    apart = run.x_m[:, names.index(ahead)] - run.x_m[:, names.index(name)]
    return apart - (EGO_AND_CAR_M if ahead == "Ego" else 5.0)


@pytest.mark.parametrize(("speed_kmh", "brake_s"), [(30.0, 1.0), (50.0, 1.37), (70.0, 2.0)])
def test_krauss_drivers_who_decide_within_the_time_gap_never_touch(speed_kmh: float, brake_s: float) -> None:
    """tau at least the time between decisions, brakes as good as those ahead: safe (Krauss 1998)."""
    engine = engine_of("tau_s=1,reaction_s=1,sigma=0,decel_mps2=9", speed_kmh, brake_s, 9.0)
    run = engine.run(8.0)
    assert engine.struck == ()
    assert gaps_m(run).min() > 0.0
    assert run.speed_mps[-1, -1] == 0.0


def test_a_weaker_brake_at_a_small_gap_touches_at_a_computed_speed() -> None:
    """9 m/s2 ahead, 4 behind, 4 m between: closed in the time in which the difference of the ways is 4 m.

    The driver behind begins to brake one to two steps of 0.1 s later.
    """
    engine = engine_of(f"gap_m=4,tau_s=0.1,decel_mps2=4,emergency_decel_mps2=4,{EXACT}", 50.0, 1.0, 9.0)
    run = engine.run(6.0)
    [hit] = engine.struck

    def closing_mps(late_s: float) -> float:
        # 4.5 t^2 - 2 (t - late)^2 = 4
        t = (-2 * late_s + math.sqrt(4 * late_s**2 + 2.5 * (4 + 2 * late_s**2))) / 2.5
        return 9 * t - 4 * (t - late_s)

    closing = hit.entity_speed_mps - hit.ego_speed_mps
    assert closing_mps(0.1) < closing < closing_mps(0.2)
    assert hit.entity == "traffic follower 1"
    at = int(np.searchsorted(run.time_s, hit.time_s))
    assert gaps_m(run)[at - 1] > 0.0
    # the run goes on without who has struck, and the ego has had no contact
    assert not run.exists[-1, -1]
    assert engine.contact is None
    assert run.end_time_s == pytest.approx(6.0)


def test_the_gap_of_idm_is_that_of_its_equilibrium() -> None:
    """(s0 + v T) / sqrt(1 - (v / v0)^4): 10 m/s where 50 km/h are allowed (Treiber et al. 2000)."""
    speed, limit = 10.0, 50.0 / 3.6
    gap = (2.5 + speed * 1.0) / math.sqrt(1.0 - (speed / limit) ** 4)
    run = engine_of("model=IDM,reaction_s=0.1,gap_m=25", 36.0, 1000.0, 1.0).run(45.0)
    assert gaps_m(run)[-1] == pytest.approx(gap, abs=0.05)


def test_krauss_keeps_tau_and_the_gap_at_standstill() -> None:
    run = engine_of("followers=2,reaction_s=0.1,sigma=0", 36.0, 1000.0, 1.0).run(20.0)
    assert gaps_m(run)[-1] == pytest.approx(2.5 + 10.0, abs=0.1)
    second = gaps_m(run, "traffic follower 2", "traffic follower 1")
    assert second[-1] == pytest.approx(2.5 + 10.0, abs=0.1)


def test_behind_an_ego_at_rest_is_a_queue() -> None:
    run = engine_of("followers=3,reaction_s=0.1,sigma=0", 50.0, 2.0, 5.0).run(20.0)
    assert run.speed_mps[-1, -3:].tolist() == [0.0, 0.0, 0.0]
    ahead = "Ego"
    for number in (1, 2, 3):
        name = f"traffic follower {number}"
        assert gaps_m(run, name, ahead)[-1] == pytest.approx(2.5, abs=0.1)
        ahead = name


def test_free_vehicles_reach_the_limit_and_walkers_their_speed() -> None:
    run = engine_of("followers=0,vehicles=3,walkers=3,sigma=0,walking_mps=1.2", 50.0, 1000.0, 1.0, 3).run(8.0)
    names = list(run.names)
    for name in names:
        k = names.index(name)
        there = run.exists[:, k]
        if name.startswith("traffic vehicle"):
            free = run.speed_mps[there, k][-1]
            assert free <= 50.0 / 3.6 + 1e-4
        if name.startswith("traffic walker"):
            way = np.hypot(np.diff(run.x_m[there, k]), np.diff(run.y_m[there, k])).sum()
            driven_s = run.time_s[there][-1] - run.time_s[there][0]
            assert way / driven_s == pytest.approx(1.2, abs=0.01)
            assert (np.abs(run.y_m[there, k]) > 3.5).all()
    fastest = max(run.speed_mps[-1, names.index(n)] for n in names if n.startswith("traffic vehicle"))
    assert fastest == pytest.approx(50.0 / 3.6, abs=0.01)


def test_within_a_step_nobody_jumps() -> None:
    """Between samples of 10 ms everybody goes as far as their speeds say."""
    run = engine_of("followers=2,vehicles=4,walkers=4", 50.0, 3.0, 6.0).run(8.0)
    for k in range(1, len(run.names)):
        there = run.exists[1:, k] & run.exists[:-1, k]
        way = np.hypot(np.diff(run.x_m[:, k]), np.diff(run.y_m[:, k]))[there]
        speed = 0.5 * (np.abs(run.speed_mps[1:, k]) + np.abs(run.speed_mps[:-1, k]))[there]
        assert np.abs(way - speed * np.diff(run.time_s)[there]).max() < 0.01


@pytest.mark.parametrize("map_name", ["urban_bend", "urban_intersection"])
def test_vehicles_drive_on_the_lanes_of_our_map(map_name: str) -> None:
    """The middle of the front within 10 cm of a lane's middle outside junctions, as the export promises."""
    path = shipped_map(map_name)
    network = load_map(path)
    lane = next(k for k, kind in enumerate(network.lanes.lane_type) if kind == "driving")
    middle_s = 0.5 * float(network.lanes.s_start_m[lane] + network.lanes.s_end_m[lane])
    line = dict(zip(("x", "y", "z", "yaw"), map(float, network.center_line(lane, middle_s)), strict=True))
    place = tuple((f"Line_{name}", line[name]) for name in ("x", "y", "yaw"))
    parameters = (("Ego_speed_kmh", 20.0), ("Lead_s", 0.1), ("Map", str(path)), *place)
    traffic = Traffic(followers=0, vehicles=6)
    spec = RunSpec("c", "crossing", parameters, "none", "physical", "dry", 20.0, traffic=traffic)
    run = simulation_of(spec, THROUGH).engine.run(6.0)
    compared = 0
    for k, name in enumerate(run.names):
        if not name.startswith("traffic vehicle") or not run.exists[0, k]:
            continue
        front = np.stack(
            [run.x_m[:, k] + 2.5 * np.cos(run.yaw_rad[:, k]), run.y_m[:, k] + 2.5 * np.sin(run.yaw_rad[:, k])]
        ).T[run.exists[:, k]]
        nearest = network.nearest_lane(front, ("driving",), run.yaw_rad[run.exists[:, k], k])
        outside = [network.lanes.junction_id[i] is None for i in nearest.lane.tolist()]
        x, y, _, _ = zip(
            *(network.center_line(i, s) for i, s in zip(nearest.lane.tolist(), nearest.s_m, strict=True)),
            strict=True,
        )
        off = np.hypot(front[:, 0] - np.ravel(x), front[:, 1] - np.ravel(y))
        assert off[outside].max() < 0.12
        compared += 1
    assert compared >= 3


def test_the_same_seed_gives_the_same_bytes_and_another_does_not() -> None:
    def bytes_of(seed: int) -> bytes:
        run = engine_of("followers=2,vehicles=4,walkers=2", 50.0, 2.0, 8.0, seed).run(5.0)
        return run.x_m.tobytes() + run.speed_mps.tobytes()

    first = bytes_of(1)
    other = bytes_of(2)
    assert bytes_of(1) == first != other


def test_copies_and_two_at_once_are_refused_by_a_line() -> None:
    first = engine_of("followers=1", 50.0, 1000.0, 1.0)
    first.advance(0.5)
    with pytest.raises(ScenarioError, match="cannot be copied"):
        copy.deepcopy(first)
    with pytest.raises(ScenarioError, match="cannot be pickled"):
        pickle.dumps(first)
    second = engine_of("followers=1", 50.0, 1000.0, 1.0)
    with pytest.raises(ScenarioError, match="another run with traffic has begun in this process"):
        first.advance(1.0)
    second.advance(1.0)
    assert second.time_s == pytest.approx(1.0)


def test_where_the_road_is_too_short_a_note_says_so() -> None:
    engine = engine_of("followers=3,gap_m=60", 50.0, 1000.0, 1.0)
    assert "traffic: there is no room for 'traffic follower 3'" in engine.notes
    assert engine.entities.exists.tolist()[-3:] == [True, False, False]


def test_a_run_with_perception_shows_it_and_counts_who_strikes_from_behind() -> None:
    """A tailgater with weak brakes: the pedestrian is avoided, and the ego is struck from behind."""
    text = "gap_m=3,tau_s=0.1,decel_mps2=3,emergency_decel_mps2=3,reaction_s=0.1,sigma=0,min_gap_m=0"
    parameters = (("Ego_speed_kmh", 50.0),)
    spec = RunSpec("c", "crossing", parameters, "map", "physical", "dry", 50.0, traffic=Traffic.parsed(text))
    outcome = simulation_of(spec).run()
    assert outcome.avoided
    assert outcome.contact is None
    assert [hit.entity for hit in outcome.struck] == ["traffic follower 1"]
    assert "struck from behind by traffic follower 1" in outcome.text
    log = outcome.log.table()
    cars = (log["kind"] == "actor") & (log["category"] == "car")
    assert cars.any()
    assert log["time_s"][cars].max() <= outcome.struck[0].time_s
