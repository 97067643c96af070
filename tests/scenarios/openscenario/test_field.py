"""Small files in which an engine went wrong, with the values that the standard asks for (straight road)."""

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from scenarios.catalogue.library import shipped_scenario
from scenarios.openscenario import Engine, load
from scenarios.openscenario.model import EntityDefinition, SpeedAction, TeleportAction, WorldPosition
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


def test_an_entity_waits_on_a_trajectory_with_times():
    run = played("waits_on_trajectory")
    assert at(run, "Ego", 6)[0] == pytest.approx(100.0)
    assert at(run, "Ego", 8)[0] == pytest.approx(110.0)


def test_a_rate_is_an_amount():
    run = played("negative_rate")
    assert at(run, "Ego", 5)[3] == pytest.approx(0.0, abs=1e-6)


def test_a_route_that_begins_ahead_is_driven_to():
    assert at(played("route_begins_ahead"), "Ego", 4)[0] == pytest.approx(94.0)


def test_what_the_file_has_and_nothing_uses_is_noted():
    engine = Engine(load(FILES / "default_controller.xosc"))
    run = engine.run()
    assert at(run, "Ego", 1)[3] == 12.0
    assert any("<TrailerHitch>" in note and "no trailer is coupled" in note for note in engine.notes)


def contact(ahead_m, step_s):
    """Two cars of 4 x 2 m at 20 m/s, at right angles; their corners overlap for (5.95 - ahead_m) / 20 s."""
    base = load(shipped_scenario("crossing"), {"Ego_speed_kmh": 60.0})
    cars = tuple(EntityDefinition(name, "car", "car", 4.0, 2.0, 1.5, 0.0, 0.0) for name in ("Ego", "Other"))
    init = (
        ("Ego", TeleportAction(WorldPosition(1000.0, 1000.0, 0.0))),
        ("Ego", SpeedAction("step", "time", 0.0, 20.0)),
        ("Other", TeleportAction(WorldPosition(1020.0 + ahead_m, 980.05, np.pi / 2))),
        ("Other", SpeedAction("step", "time", 0.0, 20.0)),
    )
    engine = Engine(replace(base, entities=cars, init=init, stories=()), step_s=step_s, until_contact=True)
    while engine.time_s < 2.0 and not engine.over:
        engine.advance(step_s)
    return engine.contact


@pytest.mark.parametrize("ahead_m", [5.6, 5.7, 5.81, 5.85, 5.9, 5.94, 5.949])
@pytest.mark.parametrize("step_s", [0.003, 0.01, 0.1])
def test_the_step_does_not_decide_whether_there_is_a_contact(ahead_m, step_s):
    """The ego's front reaches the other's side after (17 + ahead_m) / 20 s, and its tail leaves later."""
    found = contact(ahead_m, step_s)
    assert found is not None
    assert found.time_s == pytest.approx((17.0 + ahead_m) / 20.0, abs=1e-7)


@pytest.mark.parametrize("step_s", [0.003, 0.01, 0.1])
def test_who_passes_a_millimetre_beside_is_not_hit(step_s):
    assert contact(5.951, step_s) is None
