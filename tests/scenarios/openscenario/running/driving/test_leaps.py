"""Steps in which nothing can change are carried out at once, and give what they give one by one."""

import random

import pytest

from scenarios.openscenario import Engine, load
from scenarios.scenes.placement import SCENES
from tests.scenarios.openscenario.conftest import write_scenario
from tests.scenarios.openscenario.running.test_holding import any_scene

LIMIT_S = 6.0


def outcome(engine):
    """Everything that a run comes to, floats by their bytes."""
    run = engine.result()
    tables = [getattr(run, name).tobytes() for name in ("time_s", "x_m", "y_m", "yaw_rad", "speed_mps")]
    contact = repr((engine.contact, run.target_start_time_s, run.target_steady_time_s, engine.time_s))
    states = [(element.path, element.state, element.transition) for element in engine.storyboard.elements]
    return (*tables, run.exists.tobytes(), contact, states, engine.world.variables, engine.notes)


def moves(monkeypatch, engine, run):
    """How often a run moves its entities."""
    count, move = [0], engine._move

    def counted(instant):
        count[0] += 1
        move(instant)

    monkeypatch.setattr(engine, "_move", counted)
    run()
    monkeypatch.undo()
    return count[0]


def one_by_one(engine):
    while not engine.over and engine.time_s < LIMIT_S - 1e-9:
        engine.advance()


@pytest.mark.parametrize("seed", range(24))
def test_random_scenes_are_the_same_at_once_and_step_by_step(tmp_path, seed):
    scene = any_scene(random.Random(seed), load(write_scenario(tmp_path)))
    at_once, stepped = Engine(scene), Engine(scene)
    at_once.run(LIMIT_S)
    one_by_one(stepped)
    assert outcome(at_once) == outcome(stepped)


@pytest.mark.parametrize("name", ["crossing", "hesitating", "traffic_bend_1"])
def test_shipped_scenes_are_the_same_and_are_moved_less_often(monkeypatch, name):
    definition = load(SCENES / f"{name}.xosc")
    at_once, stepped = Engine(definition), Engine(definition)
    moved = moves(monkeypatch, at_once, lambda: at_once.run(LIMIT_S))
    one_by_one(stepped)
    assert outcome(at_once) == outcome(stepped)
    assert moved <= 0.4 * len(stepped.result().time_s)
