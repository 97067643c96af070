"""Small files in which an engine went wrong, with the values that the standard asks for (straight road)."""

import math
from pathlib import Path

import pytest

from scenarios.openscenario import Engine, load
from tests.scenarios.openscenario.conftest import at

FILES = Path(__file__).parents[2] / "data" / "field" / "openscenario"


def played(name):
    return Engine(load(FILES / f"{name}.xosc")).run()


def test_the_end_of_an_act_ends_its_actions():
    """From 10 m/s by 2.5 m/s2 until the act ends at 2 s."""
    run = played("act_stop_speed")
    for t, v in ((1, 12.5), (2, 15), (3, 15), (5, 15)):
        assert at(run, "Ego", t)[3] == pytest.approx(v, abs=1e-6)
    assert at(run, "Ego", 5)[0] == pytest.approx(50 + 25 + 15 * 3, abs=1e-5)


def test_an_action_overridden_from_another_group_is_stopped():
    """B waits for the end of the action, C for its stop, which comes at 2 s."""
    run = played("conflict_other_group")
    assert at(run, "B", 5)[0] == 100.0
    assert at(run, "C", 1.99)[3] == 0.0
    assert at(run, "C", 5)[0] == pytest.approx(200 + 7 * 3, abs=1e-6)


def test_places_of_a_trajectory_are_those_of_its_start():
    run = played("relative_trajectory_later")
    assert at(run, "Ego", 1.99)[0] == pytest.approx(69.9)
    assert at(run, "Ego", 2.01)[0] == pytest.approx(70.1, abs=1e-3)
    long = math.hypot(30, 1)
    assert at(run, "Ego", 4)[:2] == pytest.approx((70 + 20 * 30 / long, -1.5 + 20 / long), abs=1e-6)


def test_a_synchronised_entity_arrives_with_its_master():
    run = played("sync_arrival")
    assert at(run, "Ego", 10)[0] == pytest.approx(150.0, abs=1e-9)
    assert at(run, "B", 10)[0] == pytest.approx(400.0, abs=1e-6)
    assert at(run, "B", 8)[0] == pytest.approx(416.0, abs=1e-6)


def test_no_condition_holds_on_a_deleted_entity():
    run = played("deleted_entity")
    assert at(run, "Ego", 6)[3] == 10.0
