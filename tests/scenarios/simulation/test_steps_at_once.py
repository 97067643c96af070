"""A closed loop that goes many steps at once comes to what it comes to step by step, to the bit."""

import random
from collections.abc import Callable
from dataclasses import replace

import pytest

from scenarios.openscenario.reading.reader import load
from scenarios.openscenario.running.engine import Engine
from scenarios.presets import PAPER, PHYSICAL, Preset
from scenarios.scenes.placement import SCENES
from scenarios.simulation.ends import StopRule
from scenarios.simulation.simulation import Simulation
from scenarios.sources import Frame
from scenarios.strategies import NamedStrategy
from smartmot.decision.rules import Command, LeadObject
from tests.scenarios.simulation.test_stepping import commanded, values

LATE = replace(PHYSICAL, sensor=replace(PHYSICAL.sensor, latency_s=0.07, phase_s=0.02))


@pytest.fixture
def step_by_step(monkeypatch: pytest.MonkeyPatch) -> Callable[[], None]:
    def begin() -> None:
        monkeypatch.setattr(Engine, "_leap", lambda engine, most: 0)
        monkeypatch.setattr(Simulation, "_keeps_moving", lambda simulation, duration_s: False)

    return begin


@pytest.mark.parametrize(
    ("scene", "preset", "adapts"),
    [
        ("crossing", PAPER, True),
        ("crossing", LATE, False),
        ("hesitating", PHYSICAL, True),
        ("stopping", LATE, True),
        ("turn_people", PHYSICAL, True),
        ("traffic_bend_1", PHYSICAL, True),
    ],
)
def test_runs_are_the_same(
    step_by_step: Callable[[], None], scene: str, preset: Preset, adapts: bool
) -> None:
    definition = load(SCENES / f"{scene}.xosc")

    def run() -> tuple[object, ...]:
        rule = StopRule(at_standstill=not adapts)
        maker = NamedStrategy("map", preset)
        return values(Simulation(definition, preset, maker, 3, rule=rule, adapts=adapts).run())

    at_once = run()
    step_by_step()
    assert at_once == run()


@pytest.mark.parametrize("seed", range(12))
def test_any_commands_are_carried_out_the_same(step_by_step: Callable[[], None], seed: int) -> None:
    """Full and partial brakes, let go of again, and leaders, each held for some frames."""
    scene = random.Random(seed).choice(["crossing", "hesitating", "stopping", "traffic_bend_1"])
    definition = load(SCENES / f"{scene}.xosc")

    def run() -> tuple[object, ...]:
        rng, held = random.Random(seed), [Command(emergency=False), 0]

        def decide(frame: Frame) -> Command:
            if held[1] == 0:
                lead = LeadObject(1, rng.uniform(0.5, 60.0), rng.uniform(0.0, 15.0))
                held[:] = [
                    rng.choice(
                        [
                            Command(emergency=False),
                            Command(emergency=False, lead=lead),
                            Command(emergency=True),
                            Command(emergency=True, decel_mps2=rng.uniform(0.5, 6.0)),
                        ]
                    ),
                    rng.randrange(1, 30),
                ]
            held[1] -= 1
            return held[0]

        rule = StopRule(at_standstill=bool(seed % 2), time_limit_s=12.0)
        preset = LATE if seed % 3 else PHYSICAL
        return values(
            commanded(Simulation(definition, preset, NamedStrategy("map", preset), 3, rule=rule), decide)
        )

    at_once = run()
    step_by_step()
    assert at_once == run()
