"""A touch that begins and ends within one step of 10 ms is not seen; docs/architecture.md says that the step size
changes neither triggers nor impact speed nor contact time."""

from dataclasses import replace

import numpy as np
import pytest

from scenarios.library import shipped_scenario
from scenarios.openscenario.engine import Engine
from scenarios.openscenario.model import EntityDefinition, SpeedAction, TeleportAction, WorldPosition
from scenarios.openscenario.reader import load


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


@pytest.mark.parametrize("ahead_m", [5.6, 5.7, 5.81, 5.85, 5.9, 5.94])
def test_the_step_size_does_not_decide_whether_there_is_a_contact(ahead_m):
    coarse, fine = contact(ahead_m, 0.01), contact(ahead_m, 0.0002)
    assert fine is not None
    assert coarse is not None
    assert coarse.time_s == pytest.approx(fine.time_s, abs=1e-6)
