"""A copy of a running engine, taken at any step, goes on with the same bytes."""

import copy
import pickle
from pathlib import Path

import pytest

from scenarios.catalogue.library import shipped_scenario
from scenarios.openscenario import BrakeAt, Engine, expand, load
from tests.scenarios.openscenario.conftest import (
    EGO_AT_START,
    OTHER_AHEAD,
    act,
    at_time,
    by_entity,
    condition,
    event,
    maneuver,
    set_variable,
    speed,
    trigger,
)
from tests.scenarios.openscenario.running.test_actions import BESIDE, STEADY

FIELD = Path(__file__).parents[3] / "data" / "field" / "openscenario"
FILES = (
    "act_stop_speed",
    "conflict_other_group",
    "deleted_entity",
    "init_order",
    "relative_trajectory_later",
    "sync_arrival",
)
LIMIT_S = 12.0


def pickled(engine):
    return pickle.loads(pickle.dumps(engine))


def outcome(engine):
    """Everything that a run comes to, floats by their bytes."""
    while not engine.over and engine.time_s < LIMIT_S:
        engine.advance()
    run = engine.result()
    tables = [getattr(run, name).tobytes() for name in ("time_s", "x_m", "y_m", "yaw_rad", "speed_mps")]
    values = repr((run.contact_time_s, run.contact_entity, run.target_start_time_s, run.target_steady_time_s))
    states = [(element.path, element.state, element.transition) for element in engine.storyboard.elements]
    return (*tables, run.exists.tobytes(), values, states, engine.world.variables, engine.notes)


def copies(engine, instants_s):
    """Copies of both kinds at the instants, then the engine itself, run to the end in this order."""
    taken = []
    for instant_s in instants_s:
        while not engine.over and engine.time_s < instant_s - 1e-9:
            engine.advance()
        taken += [copy.deepcopy(engine), pickled(engine)]
    return [outcome(taken_engine) for taken_engine in taken], outcome(engine)


def check(definition, instants_s, controller=None, **options):
    """Copies and the engine that was copied end as one that nobody copied."""
    alone = outcome(Engine(definition, copy.deepcopy(controller), **options))
    results, original = copies(Engine(definition, copy.deepcopy(controller), **options), instants_s)
    assert original == alone
    assert all(result == alone for result in results)


def last_variation(path):
    variation = expand(path)[-1]
    return load(variation.path, variation.parameters)


@pytest.mark.parametrize("name", ["ahead", "cbla", "cpnco", "crossing_obstructed", "cpla_fcw"])
@pytest.mark.parametrize("controller", [None, BrakeAt(2.5, 4.0)], ids=["alone", "braking"])
def test_shipped_scenarios(name, controller):
    check(last_variation(shipped_scenario(name)), (0.0, 1.37, 2.6, 4.0), controller)


@pytest.mark.parametrize("name", FILES)
def test_field_files(name):
    check(load(FIELD / f"{name}.xosc"), (0.5, 1.99, 2.0, 2.01, 5.0))


@pytest.mark.parametrize(
    "file", ["AEB_C2C_2023/*CCFtap*", "AEB_VRU_2023/*CPTA*", "AEB_VRU_2023/*CBNA_*", "CA-FC_2026/CCCscp*"]
)
def test_published_scenarios(ncap, file):
    path = sorted((ncap / "scenarios" / "OpenSCENARIO" / "NCAP").glob(file))[0]
    check(last_variation(path), (1.0, 3.33, 5.0, 8.0))


STEERING = (
    "<PrivateAction><RoutingAction><FollowTrajectoryAction><TimeReference><None/></TimeReference>"
    '<TrajectoryFollowingMode followingMode="follow"/><TrajectoryRef><Trajectory name="t" closed="false">'
    '<Shape><Polyline><Vertex><Position><WorldPosition x="0" y="1.75"/></Position></Vertex><Vertex><Position>'
    '<WorldPosition x="200" y="1.75"/></Position></Vertex></Polyline></Shape></Trajectory></TrajectoryRef>'
    "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
)
"""A lane change: it steers to the middle of the lane on its left."""


@pytest.mark.parametrize(
    ("events", "actors", "instants_s"),
    [
        ((event("ramp", speed(2, "sinusoidal", "time", 5), trigger(condition(at_time(1)))),), "Ego", (3.21,)),
        ((event("change", STEERING, trigger(condition(at_time(1)))),), "Ego", (1.5, 2.0)),
        ((event("meets", STEADY),), "Other", (0.5, 4.2, 6.0)),
        (
            (
                event(
                    "late",
                    set_variable("n", 1),
                    trigger(
                        condition(
                            by_entity(
                                '<TimeHeadwayCondition entityRef="Other" value="2.5" rule="lessThan" '
                                'freespace="true" alongRoute="false"/>'
                            ),
                            delay=1.3,
                            edge="rising",
                        )
                    ),
                ),
            ),
            "Ego",
            (2.0, 3.0, 3.7),
        ),
    ],
    ids=["speed change", "lane change", "synchronisation", "pending delay"],
)
@pytest.mark.parametrize("apply_performance", [False, True])
def test_in_the_middle_of_an_action(write, events, actors, instants_s, apply_performance):
    definition = load(write(act(maneuver(*events), actors=actors), init=BESIDE))
    check(definition, instants_s, apply_performance=apply_performance)


def test_a_copy_is_independent(write):
    engine = Engine(load(write(init=EGO_AT_START + OTHER_AHEAD)))
    engine.advance(1.0)
    other = copy.deepcopy(engine)
    other.world.variables["n"] = 5.0
    other.advance(1.0)
    assert (engine.time_s, engine.world.variables["n"]) == (1.0, 0.0)
    assert len(engine.result().time_s) + 100 == len(other.result().time_s)


def test_a_copy_shares_what_is_never_changed(write):
    engine = Engine(load(write()))
    engine.advance(1.0)
    other = copy.deepcopy(engine)
    assert other.definition is engine.definition
    assert other.world.locator.roads is engine.world.locator.roads
    assert other.ego.path is engine.ego.path
    assert other.ego is not engine.ego


def test_a_pickle_needs_no_file(write):
    path = write()
    engine = Engine(load(path))
    engine.advance(1.0)
    data = pickle.dumps(engine)
    path.unlink()
    (path.parent / "two_roads.xodr").unlink()
    assert outcome(pickle.loads(data)) == outcome(engine)
