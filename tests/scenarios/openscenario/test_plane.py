"""Scenarios without a road network take place on a plane."""

import pytest

from scenarios.errors import ScenarioError
from scenarios.openscenario import RunError, load
from scenarios.openscenario.running.engine import Engine
from scenarios.presets import named_preset
from scenarios.simulation.simulation import Simulation
from scenarios.spec import NO_AEB, RunSpec, perception_map, simulation_of
from scenarios.strategies import NamedStrategy
from smartmot.errors import SmartMotError
from tests.scenarios.openscenario.conftest import (
    act,
    at,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
)


def world(x, y, h=0.0):
    return teleport(f'<Position><WorldPosition x="{x}" y="{y}" h="{h}"/></Position>')


EGO = private("Ego", world(0, 0), speed(10))
OTHER = private("Other", world(60, 0))


@pytest.fixture
def plane(write):
    """A scenario of the small car and the other one, without its map."""

    def make(*acts, init=EGO + OTHER, network="<RoadNetwork/>"):
        path = write(*acts, init=init)
        text = path.read_text()
        path.write_text(
            text.replace('<RoadNetwork><LogicFile filepath="two_roads.xodr"/></RoadNetwork>', network)
        )
        return path

    return make


def test_everybody_goes_straight_on(plane):
    """The ego's front is at 3.5 m + 10 m/s t, the other's rear at 59.5 m: contact after 5.6 s."""
    definition = load(plane())
    assert definition.map_path is None
    assert definition.files == (definition.path,)
    run = Engine(definition).run()
    assert run.contact_time_s == pytest.approx(5.6, abs=1e-6)
    assert at(run, "Ego", 3.0) == pytest.approx((30, 0, 0, 10))


@pytest.mark.parametrize(
    "init",
    [
        EGO + private("Other", teleport(lane_position(60))),
        EGO + private("Other", teleport('<Position><RoadPosition roadId="A" s="5" t="0"/></Position>')),
    ],
)
def test_places_by_road_are_one_error(plane, init):
    with pytest.raises(RunError, match="there is no road: RoadNetwork has no LogicFile") as error:
        Engine(load(plane(init=init)))
    assert "small.xosc" in str(error.value)
    assert "\n" not in str(error.value)


def test_places_beside_lanes_of_an_entity_are_one_error(plane):
    beside = teleport(
        '<Position><RelativeLanePosition entityRef="Ego" dLane="1" ds="5" offset="0"/></Position>'
    )
    with pytest.raises(RunError, match="'Ego' is not on a road"):
        Engine(load(plane(act(maneuver(event("e", beside)))))).run()


@pytest.mark.parametrize("strategy", ["rectangular", "path", "all"])
def test_areas_that_need_no_lanes_stop_the_ego(plane, strategy):
    definition = load(plane())
    assert perception_map(definition, None) is None
    preset = named_preset("physical")
    outcome = Simulation(definition, preset, NamedStrategy(strategy, preset), adapts=False).run()
    assert outcome.contact is None
    assert outcome.stop_time_s is not None


def test_areas_that_need_lanes_ask_for_them(plane):
    spec = RunSpec("s", str(plane()), (), "map", "physical", "dry", 36.0)
    with pytest.raises((SmartMotError, ScenarioError), match="lane"):
        simulation_of(spec).run()
    with pytest.raises(ScenarioError, match="static adversaries stand beside a road, and there is none"):
        simulation_of(RunSpec("s", spec.file, (), NO_AEB, "physical", "dry", 36.0, adversaries="static"))
