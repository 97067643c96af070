"""What a scenario does to the ego's speed after the start is dropped without a word once our drive has it.

Here the ego is to reach 40 km/h linearly within 1 s of the initial actions. The engine alone does so and meets the
pedestrian at 5.36 s. `smartmot-eval run ... --no-aeb` (nobody brakes) leaves the ego standing at 0 km/h for 60 s and
writes v_test 40, v_impact 0, no contact. A SpeedAction in an event (accelerate, slow down before the test) is dropped in
the same way. The README says that what is not supported is refused by name before the run starts.
"""

import pytest

from evaluation.runs import RunSpec, execute
from scenarios.library import DEFINITIONS
from scenarios.openscenario.engine import Engine
from scenarios.openscenario.reader import load

STEP = '<SpeedActionDynamics dynamicsShape="step" dynamicsDimension="time" value="0"/>'
LINEAR = '<SpeedActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="1.0"/>'


@pytest.fixture
def scenario(tmp_path):
    text = (DEFINITIONS / "cpna_paper.xosc").read_text()
    first = text.index(STEP)  # that of the ego, in Init
    text = text[:first] + LINEAR + text[first + len(STEP) :]
    file = tmp_path / "linear.xosc"
    file.write_text(
        text.replace('"../maps/', f'"{DEFINITIONS.parent / "maps"}/').replace(
            '"catalogs/', f'"{DEFINITIONS / "catalogs"}/'
        )
    )
    return file


def test_the_unbraked_run_is_the_scenario(scenario):
    alone = Engine(load(scenario, {"Ego_speed_kmh": 40.0})).run(30.0)
    assert alone.contact_time_s == pytest.approx(5.357, abs=0.01)
    spec = RunSpec("x", str(scenario), (("Ego_speed_kmh", 40.0),), "none", "physical", "dry", 40.0)
    assert execute(spec).row.contact_time_s == pytest.approx(alone.contact_time_s, abs=1e-3)
