import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenarios.openscenario import BrakeAt, Engine, Motion, RunError, load
from scenarios.openscenario.motion.paths import Pose
from tests.scenarios.openscenario.conftest import (
    EGO_AT_START,
    WALKER,
    act,
    at_time,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
    write_scenario,
)

FREE_M = 46.0
"""From the ego's front at 13.5 m to the rear of Other at 59.5 m."""


def test_contact_is_a_root(play):
    _, run = play()
    assert run.contact_time_s == pytest.approx(FREE_M / 10, abs=1e-8)
    assert (run.contact_entity, run.target) == ("Other", "Other")
    assert (run.ego_speed_at_contact_kmh, run.target_speed_at_contact_kmh) == pytest.approx((36.0, 0.0))
    assert run.impact_location_percent == pytest.approx(50.0)
    assert run.target_start_time_s is None
    assert run.target_steady_time_s == 0.0


@pytest.mark.parametrize(("offset", "percent"), [(0.5, 75.0), (-0.5, 25.0), (-1.0, 0.0), (1.0, 100.0)])
def test_impact_location_counts_from_the_right_edge(play, offset, percent):
    """The ego is 2 m wide."""
    init = EGO_AT_START + private("Other", teleport(lane_position(60, offset=offset)))
    assert play(init=init)[1].impact_location_percent == pytest.approx(percent)


def test_no_contact(play):
    init = EGO_AT_START + private("Other", teleport(lane_position(60, lane=-2)))
    _, run = play(init=init)
    assert (run.contact_time_s, run.contact_entity, run.impact_location_percent) == (None, None, None)
    assert run.end_time_s == pytest.approx(10.0)


def test_crossing_walker(play):
    """A walker of 0.6 x 0.5 m crosses from the right at 2 m/s and is hit where it is when the ego arrives."""
    turned = '<Orientation type="relative" h="1.5707963267948966"/>'
    init = EGO_AT_START + private("Other", teleport(lane_position(40, offset=-6, inner=turned)), speed(2))
    _, run = play(init=init, other=WALKER)
    contact = (40 - 0.25 - 13.5) / 10
    assert run.contact_time_s == pytest.approx(contact, abs=1e-8)
    assert run.impact_location_percent == pytest.approx(50 + 100 * (-6 + 2 * contact) / 2)
    assert run.target_speed_at_contact_kmh == pytest.approx(7.2)


@pytest.fixture(scope="module")
def small(tmp_path_factory):
    return load(write_scenario(tmp_path_factory.mktemp("small")))


@settings(max_examples=15, deadline=None)
@given(brake_time_s=st.floats(0.0, 4.0), decel=st.floats(2.0, 12.0))
def test_braking_is_exact(small, brake_time_s, decel):
    run = Engine(small, BrakeAt(brake_time_s, decel)).run()
    left_m = FREE_M - 10 * brake_time_s
    squared = 100.0 - 2 * decel * left_m
    if squared < -1e-6:
        assert run.contact_time_s is None
        assert run.speed_mps[-1, 0] == 0.0
        assert run.x_m[-1, 0] == pytest.approx(10 + 10 * brake_time_s + 100 / (2 * decel))
    elif squared > 1e-6:
        v = math.sqrt(squared)
        assert run.ego_speed_at_contact_kmh == pytest.approx(3.6 * v, abs=1e-4)
        assert run.contact_time_s == pytest.approx(brake_time_s + (10 - v) / decel, abs=1e-6)


RAMP = act(
    maneuver(
        event("go", speed(8, "sinusoidal", "time", 3), trigger(condition(at_time(0.777)))),
        event("halt", speed(0, "linear", "rate", 3), trigger(condition(at_time(4.321)))),
    )
)


@pytest.mark.parametrize("step_s", [0.003, 0.0201, 0.1])
def test_the_step_changes_nothing(write, step_s):
    definition = load(write(RAMP))
    fine, coarse = Engine(definition).run(), Engine(definition, step_s=step_s).run()
    assert coarse.contact_time_s == pytest.approx(fine.contact_time_s, abs=1e-8)
    assert coarse.target_start_time_s == pytest.approx(0.777, abs=1e-8)
    assert coarse.x_m[-1] == pytest.approx(fine.x_m[-1], abs=1e-6)


def test_equal_runs_are_equal(write):
    definition = load(write(RAMP))
    one, other = Engine(definition, BrakeAt(2.0, 1.0)).run(), Engine(definition, BrakeAt(2.0, 1.0)).run()
    for name in ("time_s", "x_m", "y_m", "yaw_rad", "speed_mps"):
        assert getattr(one, name).tobytes() == getattr(other, name).tobytes()


def test_stepwise(write):
    engine = Engine(load(write()))
    assert engine.entities.name.tolist() == ["Ego", "Other"]
    assert engine.entities.category.tolist() == ["car", "car"]
    engine.advance(0.5)
    engine.advance()
    now = engine.entities
    assert now.time_s == engine.time_s == pytest.approx(0.51)
    np.testing.assert_allclose(now.reference_m, [[15.1, -1.75], [60, -1.75]])
    np.testing.assert_allclose(now.boxes.center_m, [[16.6, -1.75], [61.5, -1.75]])
    np.testing.assert_allclose(now.boxes.size_m, [[4, 2], [4, 2]])
    np.testing.assert_allclose(now.speed_mps, [10, 0])
    assert engine.contact is None
    engine.advance(5.0)
    assert engine.contact is not None
    assert engine.contact.time_s == pytest.approx(4.6)
    assert not engine.over
    engine.advance(60.0)
    assert engine.over
    assert engine.time_s == pytest.approx(10.0)
    assert engine.result().stopped


class Swerve:
    """Leaves the lane: drives straight on from the take-over at an angle."""

    commands_from_s = 0.0

    def take_over(self, time_s, path, station_m, speed_mps):
        self.pose, self.speed = Pose(*path.pose(station_m)).moved(0, 0, 0.1), speed_mps

    def motion(self, time_s, duration_s):
        return Motion(self.speed * duration_s, self.speed, self.pose.moved(self.speed * duration_s, 0.0))

    def advance(self, time_s, duration_s):
        self.pose = self.motion(time_s, duration_s).pose


def test_a_controller_may_leave_the_way(write):
    run = Engine(load(write()), Swerve()).run()
    row = int(abs(run.time_s - 2.0).argmin())
    assert (run.x_m[row, 0], run.y_m[row, 0]) == pytest.approx(
        (10 + 20 * math.cos(0.1), -1.75 + 20 * math.sin(0.1))
    )
    assert run.contact_time_s is None


def test_the_ego_need_not_be_called_ego(write):
    engine = Engine(load(write()), ego="Other")
    assert engine.run().contact_entity == "Ego"
    assert Engine(load(write()), ego="nobody").ego.name == "Ego"


def test_steady_time_of_a_changing_target(play):
    """Other brakes from 5 m/s at 1 m/s2 when it is hit: its speed is not steady."""
    init = EGO_AT_START + private("Other", teleport(lane_position(40)), speed(5))
    slow = act(maneuver(event("e", speed(0, "linear", "rate", 1), trigger(condition(at_time(2))))))
    _, run = play(slow, init=init)
    assert run.target_start_time_s == 0.0
    assert run.target_steady_time_s is None
    # gap 26 m: 10 t = 26 + 5 t - (t - 2)^2 / 2
    contact = -3 + math.sqrt(9 + 48)
    assert run.contact_time_s == pytest.approx(contact, abs=1e-8)
    assert run.target_speed_at_contact_kmh == pytest.approx(3.6 * (5 - (contact - 2)), abs=1e-6)


def test_steady_since_a_change(play):
    init = EGO_AT_START + private("Other", teleport(lane_position(40)), speed(5))
    slow = act(maneuver(event("e", speed(4, "linear", "rate", 1), trigger(condition(at_time(2))))))
    assert play(slow, init=init)[1].target_steady_time_s == pytest.approx(3.0)


def test_refused(write):
    with pytest.raises(RunError, match="step_s: expected a positive number"):
        Engine(load(write()), step_s=0.0)


@pytest.mark.parametrize("step_s", [0.002, 0.01, 0.1])
@pytest.mark.parametrize("when_s", [0.0, 1.2345])
def test_who_is_put_into_contact_touches_at_that_instant(write, when_s, step_s):
    """Ego drives at 10 m/s from s = 10 m on; Other is put 2 m ahead of its rear axle, 0.5 m to its left."""
    start = trigger(condition(at_time(when_s)))
    put = event("put", teleport(lane_position(12 + 10 * when_s, offset=0.5)), start)
    engine = Engine(load(write(act(maneuver(put)))), step_s=step_s)
    run = engine.run()
    assert run.contact_time_s == pytest.approx(when_s, abs=1e-8)
    assert run.ego_speed_at_contact_kmh == pytest.approx(36.0)
    assert run.target_speed_at_contact_kmh == 0.0
    assert run.impact_location_percent == pytest.approx(50.0 + 100.0 * 0.5 / 2.0, abs=1e-5)


@pytest.mark.parametrize("when_s", [0.57, 1.0, 3.0, 7.01])
def test_what_happens_at_the_end_of_a_step_is_sampled_there(play, when_s):
    """Steps of 0.01 s add up to the times that a file gives in decimals."""
    start = trigger(condition(at_time(when_s)))
    put = event("put", teleport(lane_position(250)), start)
    _, run = play(act(maneuver(put)))
    row = round(when_s / 0.01)
    assert run.time_s[row] == when_s
    assert run.x_m[row - 1 : row + 1, 1] == pytest.approx([60.0, 250.0])


def test_many_steps_at_once_end_where_as_many_steps_end(write):
    """What is due at 120 s, where the time limit is, takes place."""
    stop = trigger(condition(at_time(120.0)), kind="StopTrigger")
    run = Engine(load(write(stop=stop))).run(120.0)
    assert (run.stopped, run.end_time_s) == (True, 120.0)
