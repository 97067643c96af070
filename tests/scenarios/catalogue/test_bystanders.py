"""Bystanders stand where they are said to stand, in either direction and in left-hand traffic."""

import math

import numpy as np
import pytest

from opendrive import load_map
from scenarios.catalogue.bystanders import with_bystanders
from scenarios.catalogue.library import shipped_scenario
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import ScenarioError
from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine
from scenarios.openscenario.running.results import Entities

KERB_M = 3.5  # of the street, from its middle; the lane's centre is 1.75 m from there
PLACES = {
    "east": {"Line_x": 450.0, "Line_y": -1.75, "Line_yaw": 0.0, "Side": -1},
    "west": {"Line_x": 150.0, "Line_y": 1.75, "Line_yaw": math.pi, "Side": -1},
    "left-hand": {"Line_x": 450.0, "Line_y": -1.75, "Line_yaw": 0.0, "Side": 1},
}


def entities(place: dict[str, float], scenario: str = "cpna_paper") -> Entities:
    network = load_map(shipped_map("urban_street"))
    return Engine(with_bystanders(load(shipped_scenario(scenario), place), network)).entities


def along_and_across(found: Entities, place: dict[str, float]) -> np.ndarray:
    """(N, 2) box centres ahead of the line and to the near side of the lane's centre."""
    delta = found.boxes.center_m - (place["Line_x"], place["Line_y"])
    c, s = math.cos(place["Line_yaw"]), math.sin(place["Line_yaw"])
    return np.column_stack((delta @ (c, s), place["Side"] * (delta @ (-s, c))))


@pytest.mark.parametrize("scenario", ["cpna_paper", "crossing"])
@pytest.mark.parametrize("name", PLACES)
def test_people_and_cars_stand_on_both_sides(name: str, scenario: str) -> None:
    place = PLACES[name]
    found = entities(place, scenario)
    where = along_and_across(found, place)
    extra = np.array([n.startswith("bystander") for n in found.name])
    people, cars = (where[extra & (found.category == kind)] for kind in ("pedestrian", "car"))
    assert extra.sum() == len(found.name) - 2
    # the near kerb is on the side that traffic keeps to, except in the street taken for a left-hand one
    near, far = (1.75, 5.25) if name != "left-hand" else (5.25, 1.75)
    assert sorted(set(np.round(people[:, 1], 6))) == pytest.approx([-far - 1.0, near + 0.9, near + 2.2])
    if name == "left-hand":
        assert len(cars) == 0  # the far kerb is the lane's own border: no room for a parked car
    else:
        assert cars[:, 1] == pytest.approx(-(far - 0.9 - 0.1))
        assert len(cars) == 4
    assert (found.speed_mps[extra] == 0.0).all()


def test_a_line_on_no_lane_is_refused() -> None:
    network = load_map(shipped_map("urban_street"))
    definition = load(shipped_scenario("cpna_paper"), {"Line_y": 30.0})
    with pytest.raises(ScenarioError, match="no driving lane runs at x = 450 m, y = 30 m"):
        with_bystanders(definition, network)
