"""Runs where roads lie above one another: a bridge over a street, people and a car below it."""

from pathlib import Path

import numpy as np
import pytest

from opendrive import load_map
from scenarios.openscenario.model import Polyline, ScenarioDefinition, Trajectory, Vertex, WorldPosition
from scenarios.openscenario.motion.paths import Pose
from scenarios.openscenario.motion.positions import Locator
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.motion.trajectories import build
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine
from scenarios.presets import PHYSICAL
from scenarios.simulation.levels import RoadLevels
from scenarios.simulation.outcome import Outcome
from scenarios.simulation.simulation import Simulation
from scenarios.strategies import STRATEGIES, make_strategy
from smartmot.maps.follow import RouteFollower, route_along

DATA = Path(__file__).parents[2] / "data" / "levels"
NETWORK = load_map(DATA / "overpass.xodr")
DECKS = load_map(DATA / "two_decks.xodr")
DECK_M = 6.0
EGO_MPS = 50.0 / 3.6


def scenario(**parameters: str) -> ScenarioDefinition:
    return load(DATA / "overpass.xosc", parameters)


def driven(definition: ScenarioDefinition, strategy: str | None) -> Outcome:
    def made(view):  # type: ignore[no-untyped-def]
        return make_strategy(str(strategy), PHYSICAL, view)

    return Simulation(definition, PHYSICAL, None if strategy is None else made).run()


@pytest.mark.parametrize("strategy", [None, *STRATEGIES])
def test_the_ego_on_a_bridge_neither_meets_nor_sees_those_below(strategy: str | None) -> None:
    outcome = driven(scenario(EgoStarts_m="120"), strategy)
    assert outcome.contact is None
    assert outcome.flag_time_s is None
    log = outcome.log.table()
    ego = log["kind"] == "ego"
    np.testing.assert_allclose(log["speed_mps"][ego], EGO_MPS, atol=1e-9)
    assert not np.isin(log["kind"], ("detection", "track")).any()
    assert np.isin("actor", log["kind"])  # the truth has them
    if strategy is not None:
        assert sum("on another level" in note for note in outcome.notes) == 3


@pytest.mark.parametrize("strategy", ["map", "all"])
def test_the_ego_on_a_bridge_brakes_for_people_on_it(strategy: str) -> None:
    outcome = driven(scenario(StandsAt_m=str(DECK_M), EgoStarts_m="120"), strategy)
    assert outcome.contact is None
    assert outcome.flag_time_s is not None


def test_outlines_touch_on_one_level_alone() -> None:
    """The front of the car is 3.65 m before its rear axle, and the person is 0.6 m long."""
    on_bridge = Engine(scenario(StandsAt_m=str(DECK_M)), until_contact=True)
    on_bridge.advance(14.0)
    assert on_bridge.contact is not None
    assert on_bridge.contact.time_s == pytest.approx((200.0 - 0.3 - 30.0 - 3.65) / EGO_MPS, abs=1e-6)
    # the street passes below: its right lane is at x = 198.25, the person 1.45 m beside the ego
    below = Engine(scenario(EgoRoad="2"), until_contact=True)
    below.advance(6.0)
    assert below.contact is None or below.contact.entity == "Car"


@pytest.mark.parametrize(("z_m", "road_id"), [(0.0, "1"), (0.9, "1"), (5.0, "2"), (DECK_M, "2")])
def test_a_route_stays_on_its_level(z_m: float, road_id: str) -> None:
    way_m = np.column_stack((np.arange(20.0, 120.0, 4.0), np.full(25, -1.75)))
    heights_m = np.full(len(way_m), z_m)
    routes = (
        route_along(DECKS, way_m, z_m=heights_m),
        RouteFollower(DECKS).at(*way_m[0], 20.0, 50.0, z_m),
    )
    assert all(route is not None for route in routes)
    assert [{DECKS.lanes.key[lane].road_id for lane in route.lanes} for route in routes if route] == [
        {road_id},
        {road_id},
    ]


def test_the_route_of_a_run_is_on_the_road_that_the_ego_is_on() -> None:
    for road_id in ("1", "2"):
        definition = scenario(EgoRoad=road_id)
        view = Simulation(definition, PHYSICAL, None).map_view()
        assert [NETWORK.lanes.key[lane].road_id for lane in view.route.lanes] == [road_id]


@pytest.mark.parametrize(("z_m", "road_id"), [(0.0, "2"), (2.5, "2"), (3.5, "1"), (DECK_M, "1"), (50.0, "1")])
def test_the_height_of_a_world_position_chooses_the_level(z_m: float, road_id: str) -> None:
    place = Roads(NETWORK).place(Pose(198.25, -1.75, 0.3, z_m))
    assert place is not None
    assert place.road_id == road_id


def test_a_position_without_height_below_a_bridge_is_noted() -> None:
    text = (DATA / "overpass.xosc").read_text(encoding="utf-8")
    assert 'z="$StandsAt_m"' in text
    assert Engine(scenario()).notes == ()
    bare = scenario_from(text.replace('z="$StandsAt_m" ', ""))
    (note,) = Engine(bare).notes
    assert "'Standing'" in note
    assert "z = 0.0, 6.0 m" in note


def scenario_from(text: str) -> ScenarioDefinition:
    import tempfile

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "bare.xosc"
        path.write_text(text.replace('"overpass.xodr"', f'"{DATA / "overpass.xodr"}"'), encoding="utf-8")
        return load(path)


def test_who_is_uphill_on_the_same_road_is_on_the_same_level() -> None:
    levels = RoadLevels(NETWORK)
    ego_m, others_m = np.array([60.0, -1.75]), np.array([[120.0, -1.75], [120.0, -4.5], [205.0, -60.0]])
    heights_m = np.array([NETWORK.road_point("1", x, 0.0).z_m for x in (120.0, 120.0)] + [0.0])
    assert heights_m[0] > 3.0
    assert levels.shared(ego_m, 0.0, others_m, heights_m).tolist() == [True, True, True]
    deck_m, below_m = np.array([195.0, -1.75]), np.array([[205.0, -4.0], [205.0, -30.0], [205.0, -60.0]])
    assert levels.shared(deck_m, DECK_M, below_m, np.zeros(3)).tolist() == [False, False, False]


def test_who_walks_below_a_bridge_stays_below_it() -> None:
    engine = Engine(scenario())
    walking = engine.world.actors["Walking"]
    heights_m = []
    for _ in range(200):
        engine.advance(0.1)
        heights_m.append(walking.ground_m(walking.state(engine.time_s)))
    assert walking.state(engine.time_s).y_m > 11.0  # on the far side of the bridge
    np.testing.assert_allclose(heights_m, 0.0, atol=1e-9)


def test_a_run_is_not_slowed_where_no_roads_lie_above_one_another() -> None:
    flat = Roads(load_map(DATA.parent / "field" / "opendrive" / "linked_roads_apart.xodr"))
    assert not flat.has_levels


@pytest.mark.parametrize("z_m", [0.0, DECK_M])
def test_the_first_vertex_of_a_trajectory_chooses_the_level(z_m: float) -> None:
    vertices = tuple(Vertex(WorldPosition(198.0, y_m, 0.0, z_m), None) for y_m in (-1.75, 1.75))
    locator = Locator(Roads(NETWORK), lambda name: Pose(0.0, 0.0, 0.0))
    path = build(Trajectory("t", Polyline(vertices)), locator.pose, None)
    walker = Engine(scenario()).world.actors["Standing"]
    walker.follow(0.0, path, 0.0, trajectory=True)
    assert walker.ground_m(walker.state(0.0)) == pytest.approx(z_m)


@pytest.mark.parametrize(("z_m", "is_off"), [(0.0, True), (DECK_M, False)])
def test_below_a_bridge_is_off_the_road(z_m: float, is_off: bool) -> None:
    assert Roads(NETWORK).is_off_road(Pose(215.0, -1.75, 0.0, z_m)) is is_off
