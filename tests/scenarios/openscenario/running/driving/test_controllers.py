"""Controllers that a file gives to entities."""

import math

import pytest

from benchmarks.openscenario_actors import write_road, write_scenario
from scenarios.openscenario import Engine, UnsupportedError, load
from scenarios.openscenario.running.driving.controllers import (
    ACCEL_MPS2,
    HEADWAY_S,
    STANDSTILL_M,
    Driver,
    Traffic,
)
from scenarios.openscenario.running.world import Instant
from tests.scenarios.openscenario.conftest import (
    EGO_AT_START,
    act,
    at,
    at_time,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
)


def controller(name, properties=""):
    return f'<Controller name="{name}"><Properties>{properties}</Properties></Controller>'


def assign(inner, activate="true"):
    return (
        f'<PrivateAction><ControllerAction><AssignControllerAction activateLongitudinal="{activate}" '
        f'activateLateral="false">{inner}</AssignControllerAction></ControllerAction></PrivateAction>'
    )


ACTIVATE = '<PrivateAction><ActivateControllerAction longitudinal="true" lateral="false"/></PrivateAction>'


def behind(*actions, s=10, v=10):
    """The other one in front of the ego's lane, with actions."""
    return private("Other", teleport(lane_position(s)), speed(v), *actions)


def test_controllers_of_the_ego_are_noted(play):
    init = private("Ego", teleport(lane_position(10)), speed(10), assign(controller("Remote"))) + behind(
        s=60, v=0
    )
    engine, run = play(init=init)
    assert at(run, "Ego", 2.0)[:2] == pytest.approx((30, -1.75))
    assert any("controllers of 'Ego' are not used" in note for note in engine.notes)


def test_one_that_is_not_activated_changes_nothing(play):
    engine, run = play(init=EGO_AT_START + behind(assign(controller("Remote"), "false"), s=60))
    assert at(run, "Other", 2.0)[0] == pytest.approx(80)
    assert engine.notes == ()


def test_an_unknown_one_that_is_to_drive_is_refused_with_its_line(write):
    path = write(init=EGO_AT_START + behind(assign(controller("Remote")), s=60))
    with pytest.raises(
        UnsupportedError, match=r"small.xosc:\d+: <AssignControllerAction> controller 'Remote'"
    ):
        Engine(load(path))


def test_activation_without_a_controller_is_the_default_one(play):
    _, run = play(init=EGO_AT_START + behind(ACTIVATE, s=60))
    assert at(run, "Other", 2.0)[0] == pytest.approx(80)


def test_carlas_default_controllers_do_as_asked(play):
    module = controller("Npc", '<Property name="module" value="npc_vehicle_control"/>')
    engine, run = play(init=EGO_AT_START + behind(assign(module), s=60))
    assert at(run, "Other", 2.0)[0] == pytest.approx(80)
    assert any("'Npc' of 'Other' is the default one" in note for note in engine.notes)


def test_a_driver_keeps_the_distance_of_the_model(write):
    """Behind a car at 10 m/s the gap tends to (s0 + v T) / sqrt(1 - (v / v0)^4), Treiber's equilibrium."""
    acc = controller("ACCController", '<Property name="setSpeed" value="20"/>')
    init = private("Ego", teleport(lane_position(100)), speed(10)) + behind(assign(acc), s=10, v=20)
    stop = trigger(condition(at_time(60)), kind="StopTrigger")
    engine = Engine(load(write(init=init, stop=stop)))
    run = engine.run()
    gap_m = at(run, "Ego", 50.0)[0] - 0.5 - (at(run, "Other", 50.0)[0] + 3.5)
    expected_m = (STANDSTILL_M + 10 * HEADWAY_S) / math.sqrt(1 - 0.5**4)
    assert gap_m == pytest.approx(expected_m, abs=0.2)
    assert at(run, "Other", 50.0)[3] == pytest.approx(10.0, abs=0.05)
    assert run.contact_time_s is None


def test_a_driver_alone_accelerates_by_the_model_to_the_speed_that_is_asked(play):
    acc = controller("ACCController")
    later = event("e", speed(12), trigger(condition(at_time(1))))
    ego = private("Ego", teleport(lane_position(10, lane=1)), speed(0))
    _, run = play(act(maneuver(later)), init=ego + behind(assign(acc), s=60, v=10))
    assert at(run, "Other", 1.0)[3] == pytest.approx(10.0)
    assert at(run, "Other", 1.1)[3] == pytest.approx(10 + 0.1 * ACCEL_MPS2 * (1 - (10 / 12) ** 4), abs=1e-3)


def test_an_overridden_pedal_of_another_is_refused(write):
    brake = (
        "<PrivateAction><ControllerAction><OverrideControllerValueAction>"
        '<Brake active="true" value="1"/></OverrideControllerValueAction></ControllerAction></PrivateAction>'
    )
    with pytest.raises(UnsupportedError, match="of 'Other' sets Brake"):
        Engine(load(write(init=EGO_AT_START + behind(brake, s=60))))
    Engine(load(write(init=EGO_AT_START + behind(brake.replace("true", "false"), s=60))))


def test_a_driver_sees_the_one_ahead_that_a_search_of_all_finds(tmp_path):
    road, path = tmp_path / "road.xodr", tmp_path / "many.xosc"
    write_road(road, 600.0)
    write_scenario(path, road, "driver", 24, 25.0)
    engine = Engine(load(path), ego="car0")
    engine.advance(0.01)
    drivers = [actor for actor in engine.world.actors.values() if isinstance(actor.controller, Driver)]
    assert len(drivers) == 23
    for actor in drivers:
        own, gaps = actor.state(0.01), [math.inf]
        for other in engine.world.actors.values():
            station, left = actor.path.project(*other.state(0.01)[:2])
            if abs(left) < 1.8 and station > own.station_m + 1.0:
                gaps.append(station - own.station_m - other.rear_m - actor.front_m)
        gap_m, _ = actor.controller._ahead(Traffic(Instant(0.01, engine.world.actors)))
        assert gap_m == pytest.approx(min(gaps), abs=1e-6)
