"""Steps in which nothing can change are carried out at once, and give what they give one by one."""

import random

import pytest

from scenarios.openscenario import Engine, load
from scenarios.openscenario.control import BrakeAt, Motion
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

    def counted(*arguments):
        count[0] += 1
        move(*arguments)

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


class Wavering:
    """Commands the ego for a while, takes more and less speed in turn, and gives it back inside a step."""

    def __init__(self, begin_s, end_s):
        self.commands_from_s, self._end_s = begin_s, end_s
        self._speed_mps, self._steps = 0.0, 0

    def take_over(self, time_s, path, station_m, speed_mps):
        self._speed_mps = speed_mps

    def _accel_mps2(self):
        return 2.0 if self._steps // 7 % 2 else -3.0

    def motion(self, time_s, duration_s):
        left = max(self._speed_mps + self._accel_mps2() * duration_s, 0.5)
        return Motion(0.5 * (self._speed_mps + left) * duration_s, left)

    def advance(self, time_s, duration_s):
        self._speed_mps = self.motion(time_s, duration_s).speed_mps
        self._steps += 1
        if time_s + duration_s > self._end_s:
            self.commands_from_s = float("inf")


@pytest.mark.parametrize("seed", range(24))
def test_who_is_commanded_goes_the_same_at_once_and_step_by_step(tmp_path, seed):
    rng = random.Random(seed)
    scene = any_scene(rng, load(write_scenario(tmp_path)))
    begin_s, decel_mps2, after_s = rng.uniform(0.1, 3.0), rng.uniform(1.0, 9.0), rng.uniform(0.1, 2.0)

    def controller():
        return BrakeAt(begin_s, decel_mps2) if seed % 2 else Wavering(begin_s, begin_s + after_s)

    at_once, stepped = Engine(scene, controller()), Engine(scene, controller())
    at_once.run(LIMIT_S)
    one_by_one(stepped)
    assert outcome(at_once) == outcome(stepped)


def test_who_brakes_is_moved_less_often(monkeypatch):
    definition = load(SCENES / "crossing.xosc")
    at_once, stepped = (Engine(definition, BrakeAt(0.5, 3.0), until_contact=True) for _ in range(2))
    moved = moves(monkeypatch, at_once, lambda: at_once.run(LIMIT_S))
    one_by_one(stepped)
    assert outcome(at_once) == outcome(stepped)
    assert moved <= 0.5 * len(stepped.result().time_s)


def test_without_samples_all_else_is_the_same():
    definition = load(SCENES / "crossing.xosc")
    with_samples, without = (
        Engine(definition, BrakeAt(0.5, 3.0), keeps_samples=kept) for kept in (True, False)
    )
    for engine in (with_samples, without):
        engine.run(LIMIT_S)
    assert outcome(without)[-4:] == outcome(with_samples)[-4:]
    assert without.entities.boxes.center_m.tobytes() == with_samples.entities.boxes.center_m.tobytes()
    assert without.result().x_m.shape == (0, len(definition.entities))
