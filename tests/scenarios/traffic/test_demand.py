"""Traffic as values: what is typed, what is refused, and the entities that stand for it."""

import math
import sys
from dataclasses import replace

import pytest

from scenarios.errors import ScenarioError
from scenarios.spec import RunSpec, definition_of, simulation_of
from scenarios.traffic import Traffic, session, with_traffic
from scenarios.traffic.carried import Carried, Place


def crossing(**values: object) -> RunSpec:
    return RunSpec("crossing", "crossing", (), "none", "physical", "dry", 40.0, **values)


def test_what_is_typed_is_read() -> None:
    read = Traffic.parsed("followers=2, vehicles=3,model=IDM,tau_s=0.8,gap_m=4")
    assert read == Traffic(followers=2, vehicles=3, model="IDM", tau_s=0.8, gap_m=4.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "'' is not known; give NAME=VALUE of followers"),
        ("cars=3", "'cars=3' is not known"),
        ("followers", "'followers' is not known"),
        ("followers=1,followers=2", "'followers=2' is given twice"),
        ("followers=one", "followers must be a number, got 'one'"),
        ("followers=1.5", "followers must be a number"),
        ("followers=0", "no vehicle or pedestrian is asked for"),
        ("walkers=1000", "walkers must be 0 to 200, got 1000"),
        ("model=Wiedemann", "model must be one of Krauss, IDM"),
        ("tau_s=0", "tau_s must be positive, got 0"),
        ("tau_s=nan", "tau_s must be positive, got nan"),
        ("gap_m=-1", "gap_m must not be negative, got -1"),
        ("sigma=2", "sigma must be 0 to 1, got 2"),
        ("decel_mps2=9.5", "emergency_decel_mps2 must not be below decel_mps2, got 9 and 9.5"),
        ("reaction_s=0.25", "reaction_s must be a multiple of 0.1 s up to 10 s, got 0.25"),
    ],
)
def test_what_cannot_be_is_refused_in_a_line(text: str, message: str) -> None:
    with pytest.raises(ScenarioError, match=f"^traffic: {message}"):
        Traffic.parsed(text)


def test_entities_stand_for_it_and_none_is_the_target() -> None:
    definition = definition_of(crossing())
    enlarged = with_traffic(definition, Traffic(followers=1, vehicles=2, walkers=1))
    added = enlarged.entities[len(definition.entities) :]
    assert [(e.name, e.category) for e in added] == [
        ("traffic follower 1", "car"),
        ("traffic vehicle 1", "car"),
        ("traffic vehicle 2", "car"),
        ("traffic walker 1", "pedestrian"),
    ]
    with pytest.raises(ScenarioError, match="'traffic follower 1' is a name of the traffic"):
        with_traffic(enlarged, Traffic())


def test_a_test_on_a_plane_has_none() -> None:
    definition = replace(definition_of(crossing()), map_path=None)
    with pytest.raises(ScenarioError, match="traffic needs a road, and there is none"):
        with_traffic(definition, Traffic())


def test_without_the_library_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    session.library.cache_clear()
    monkeypatch.setitem(sys.modules, "libsumo", None)
    with pytest.raises(ScenarioError, match=r"^vehicles of SUMO need the extra sumo .*smartmot\[sumo\]'$"):
        simulation_of(crossing(traffic=Traffic()))
    session.library.cache_clear()


def test_within_a_step_the_acceleration_is_constant() -> None:
    """From 10 to 9 m/s in 0.1 s: half way in time 4.875 dm of 9.5."""
    carried = Carried(Place(0.0, 0.0, 0.0, 10.0), 0.0, 0.1)
    carried.go_on(Place(0.95, 0.0, 0.0, 9.0), 0.0)
    half = carried.motion(0.0, 0.05)
    assert half.pose is not None
    assert (half.speed_mps, half.pose.x_m) == (pytest.approx(9.5), pytest.approx(0.4875))
    rest = carried.motion(0.05, 0.05)
    assert rest.distance_m == pytest.approx(0.95 - 0.4875)
    assert rest.speed_mps == pytest.approx(9.0)


def test_who_stops_within_a_step_stands_from_then_on() -> None:
    """0.4 m/s with 10 m/s2: at rest after 0.04 s and 8 mm."""
    carried = Carried(Place(5.0, 2.0, math.pi / 2, 0.4), 3.0, 0.1)
    carried.go_on(Place(5.0, 2.008, math.pi / 2, 0.0), 3.0)
    half = carried.motion(3.0, 0.02)
    assert half.pose is not None
    assert (half.speed_mps, half.pose.y_m) == (pytest.approx(0.2), pytest.approx(2.006))
    for at_s in (0.04, 0.07, 0.1):
        stood = carried.motion(3.0, at_s)
        assert stood.pose is not None
        assert (stood.speed_mps, stood.pose.y_m) == (pytest.approx(0.0), pytest.approx(2.008))


def test_headings_turn_the_short_way() -> None:
    carried = Carried(Place(0.0, 0.0, math.pi - 0.1, 1.0), 0.0, 0.1)
    carried.go_on(Place(-0.1, 0.0, -math.pi + 0.1, 1.0), 0.0)
    pose = carried.motion(0.0, 0.05).pose
    assert pose is not None
    assert math.cos(pose.yaw_rad) == pytest.approx(-1.0)
