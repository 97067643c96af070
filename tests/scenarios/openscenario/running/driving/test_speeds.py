"""Continuous relative speeds, speed profiles and distances within limits."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import quad

from scenarios.openscenario import BrakeAt, Engine, RunError, load
from scenarios.openscenario.model import DynamicConstraints
from scenarios.openscenario.motion.profiles import SLOPES, Piece, SpeedProfile
from scenarios.openscenario.running.driving.speeds import changed
from tests.scenarios.openscenario.conftest import (
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


def later(seconds):
    return trigger(condition(at_time(seconds)))


def longitudinal(inner):
    return f"<PrivateAction><LongitudinalAction>{inner}</LongitudinalAction></PrivateAction>"


def relative(value, kind="delta", entity="Ego", **dynamics):
    target = (
        f'<RelativeTargetSpeed entityRef="{entity}" value="{value}" speedTargetValueType="{kind}" '
        'continuous="true"/>'
    )
    return speed(0, **dynamics).replace('<AbsoluteTargetSpeed value="0"/>', target)


def ego_brakes(at_s=4, to=4, rate=2):
    return act(maneuver(event("b", speed(to, "linear", "rate", rate), later(at_s))), actors="Ego", name="ego")


@pytest.mark.parametrize(("value", "kind", "factor", "plus"), [(2, "delta", 1, 2), (1.5, "factor", 1.5, 0)])
def test_a_speed_stays_relative_to_one_that_changes(play, value, kind, factor, plus):
    """The ego brakes from 10 to 4 m/s between 4 and 7 s; the other has its speed, changed, all the time."""
    _, run = play(act(maneuver(event("e", relative(value, kind), later(1)))), ego_brakes())
    for t in (1.0, 3.0, 5.0, 6.5, 9.0):
        assert at(run, "Other", t)[3] == pytest.approx(factor * at(run, "Ego", t)[3] + plus)
    gone = quad(lambda t: factor * np.interp(t, [4, 7], [10, 4]) + plus, 1, 8, points=[4, 7])[0]
    assert at(run, "Other", 8.0)[0] == pytest.approx(60 + gone, abs=1e-6)


def test_the_change_to_it_has_the_dynamics_of_the_file(play):
    _, run = play(
        act(maneuver(event("e", relative(2, shape="linear", dimension="rate", amount=3), later(1))))
    )
    assert at(run, "Other", 3.0)[3] == pytest.approx(6.0)
    assert at(run, "Other", 5.0)[3] == pytest.approx(12.0)


def test_the_change_follows_a_target_that_moves(play):
    """In 4 s from rest to 2 m/s more than the ego, which brakes from 10 by 1 m/s2 meanwhile: 8 m/s at 5 s."""
    action = relative(2, shape="linear", dimension="time", amount=4)
    _, run = play(act(maneuver(event("e", action, later(1)))), ego_brakes(at_s=1, rate=1))
    assert at(run, "Other", 5.0)[3] == pytest.approx(8.0, abs=0.02)
    assert at(run, "Other", 6.0)[3] == pytest.approx(7.0, abs=1e-6)


def test_it_follows_one_that_a_controller_brakes(write):
    path = write(act(maneuver(event("e", relative(0), later(1)))))
    run = Engine(load(path), ego_controller=BrakeAt(time_s=3.0, decel_mps2=5.0)).run()
    for t in (2.0, 4.0, 4.5, 6.0):
        assert at(run, "Other", t)[3] == pytest.approx(at(run, "Ego", t)[3], abs=0.051)
    assert at(run, "Other", 8.0)[3] == 0.0


def test_it_goes_on_until_another_speed_action(play):
    _, run = play(
        act(maneuver(event("e", relative(2), later(1)), event("s", speed(3), later(3)))), ego_brakes()
    )
    assert at(run, "Other", 8.0)[3] == 3.0


def test_relative_to_itself_is_an_error(play):
    with pytest.raises(RunError, match="relative to its own"):
        play(act(maneuver(event("e", relative(2, entity="Other"), later(1)))))


# Profiles

LIMITS = (
    'maxAcceleration="5" maxDeceleration="10" maxAccelerationRate="4" maxDecelerationRate="3" maxSpeed="50"'
)


def profile(*entries, mode="position", limits=LIMITS, entity=""):
    inner = "".join(
        f'<SpeedProfileEntry speed="{v}"' + ("" if t is None else f' time="{t}"') + "/>" for t, v in entries
    )
    return longitudinal(
        f'<SpeedProfileAction followingMode="{mode}"{entity}><DynamicConstraints {limits}/>{inner}'
        "</SpeedProfileAction>"
    )


def test_speeds_by_straight_lines(play):
    """Times count from one entry to the next."""
    _, run = play(act(maneuver(event("e", profile((0, 2), (2, 10), (2, 4), (1, 8)), later(1)))))
    for t, v in ((1.0, 2), (2.0, 6), (3.0, 10), (4.0, 7), (5.0, 4), (5.5, 6), (6.0, 8), (8.0, 8)):
        assert at(run, "Other", t)[3] == pytest.approx(v)
    assert at(run, "Other", 6.0)[0] == pytest.approx(60 + 12 + 14 + 6)


def test_speeds_without_times_are_reached_as_the_limits_allow(play):
    _, run = play(act(maneuver(event("e", profile((None, 10), (None, 5)), later(1)))))
    assert at(run, "Other", 2.0)[3] == pytest.approx(5.0)
    assert at(run, "Other", 3.0)[3] == pytest.approx(10.0)
    assert at(run, "Other", 3.5)[3] == pytest.approx(5.0)


def test_speeds_added_to_an_entitys(play):
    _, run = play(act(maneuver(event("e", profile((2, 4), entity=' entityRef="Ego"'), later(1)))))
    assert at(run, "Other", 4.0)[3] == pytest.approx(14.0)


@given(
    start=st.floats(0, 30), end=st.floats(0, 30), time_s=st.none() | st.floats(0.1, 10),
    up=st.floats(1, 8), jerk_up=st.floats(0.5, 10), jerk_down=st.floats(0.5, 10),
)  # fmt: skip
def test_smooth_changes_keep_all_limits(start, end, time_s, up, jerk_up, jerk_down):
    limits = DynamicConstraints(up, up, None, jerk_up, jerk_down)
    pieces = changed(start, end, time_s, limits, smooth=True)
    if not pieces:
        return
    drive = SpeedProfile(0.0, start, pieces)
    assert drive.final_mps == pytest.approx(end)
    assert drive.end_s >= (time_s or 0.0) - 1e-9
    t = np.linspace(0.0, drive.end_s, 4001)
    v = np.array([drive.at(x)[1] for x in t])
    a = np.gradient(v, t) if drive.end_s > 1e-6 else np.zeros_like(v)
    assert np.abs(a).max() <= up * 1.01 + 1e-6
    # the distance is the integral of the speed
    assert drive.length_m == pytest.approx(np.trapezoid(v, t), rel=1e-5, abs=1e-4)


@pytest.mark.parametrize("end", [5e-324, 1e-38, 1e-12, 1e-6])
@pytest.mark.parametrize("time_s", [None, 1.0, 10.0])
def test_a_change_by_next_to_nothing_is_none(end, time_s):
    pieces = changed(0.0, end, time_s, DynamicConstraints(1, 1, None, 1, 1), smooth=True)
    duration = sum(piece.duration_s for piece in pieces)
    assert duration == pytest.approx(time_s or 2.0 * math.sqrt(end), abs=2e-6)
    assert all(abs(piece.end_mps - end) < 1e-9 for piece in pieces[-1:])


def test_a_smooth_change_by_hand():
    """10 m/s in 4 s with jerks 4 and 3: a^2 (1/8 + 1/6) - 4 a + 10 = 0, a = 3.305 m/s2."""
    pieces = changed(0.0, 10.0, 4.0, DynamicConstraints(5, 10, 50, 4, 3), smooth=True)
    peak = (4 - math.sqrt(16 - 4 * 10 * 7 / 24)) / (2 * 7 / 24)
    assert [p.duration_s for p in pieces] == pytest.approx([peak / 4, 4 - peak * 7 / 12, peak / 3])
    assert pieces[0].end_mps == pytest.approx(peak**2 / 8)


@pytest.mark.parametrize("shape", ["rising", "falling", *SLOPES])
def test_pieces_cover_the_integral_of_their_speed(shape):
    piece = Piece(3.0, 2.0, 9.0, shape)
    for t in (0.7, 3.0):
        assert piece.after(t)[0] == pytest.approx(quad(lambda x: piece.after(x)[1], 0, t)[0])
    assert piece.after(3.0) == pytest.approx((piece.length_m, 9.0))


# Distances within limits


def keep(amount, limits='maxAcceleration="3" maxDeceleration="3"', continuous="true", what="distance"):
    return longitudinal(
        f'<LongitudinalDistanceAction entityRef="Ego" {what}="{amount}" freespace="true" '
        f'continuous="{continuous}" displacement="trailingReferencedEntity" coordinateSystem="entity">'
        f"<DynamicConstraints {limits}/></LongitudinalDistanceAction>"
    )


BEHIND = private("Ego", teleport(lane_position(100)), speed(10)) + private(
    "Other", teleport(lane_position(10)), speed(10)
)


def gap_m(run):
    """From the front of the other (3.5 m ahead of its rear axle) to the rear of the ego (0.5 m behind)."""
    return run.x_m[:, 0] - 0.5 - run.x_m[:, 1] - 3.5


STOP_AT_30_S = trigger(condition(at_time(30)), kind="StopTrigger")


@pytest.mark.parametrize("fastest", [15, 40])
def test_a_distance_is_reached_within_limits_and_kept(play, fastest):
    limits = f'maxAcceleration="3" maxDeceleration="2" maxSpeed="{fastest}"'
    _, run = play(act(maneuver(event("e", keep(20, limits), later(1)))), init=BEHIND, stop=STOP_AT_30_S)
    v = run.speed_mps[:, 1]
    a = np.diff(v) / np.diff(run.time_s)
    assert a.max() <= 3 + 1e-6
    assert a.min() >= -2 - 1e-6
    assert v.max() <= fastest + 1e-9
    assert gap_m(run)[-1] == pytest.approx(20.0, abs=0.01)
    assert gap_m(run).min() >= 20.0 - 0.05  # it does not come nearer on the way
    assert v[-1] == pytest.approx(10.0, abs=0.01)


def test_a_gap_in_time_is_driven_by_who_is_behind(play):
    _, run = play(
        act(maneuver(event("e", keep(2, what="timeGap"), later(1)))), init=BEHIND, stop=STOP_AT_30_S
    )
    assert gap_m(run)[-1] == pytest.approx(20.0, abs=0.2)


def test_rates_of_the_acceleration_are_limits_too(play):
    limits = 'maxAcceleration="3" maxDeceleration="3" maxAccelerationRate="1" maxDecelerationRate="1"'
    _, run = play(act(maneuver(event("e", keep(20, limits), later(1)))), init=BEHIND, stop=STOP_AT_30_S)
    a = np.diff(run.speed_mps[:, 1]) / np.diff(run.time_s)
    assert np.abs(np.diff(a)).max() <= 0.01 * (1 + 1e-6) + 1e-9
    assert gap_m(run)[-1] == pytest.approx(20.0, abs=0.3)


def test_one_that_is_not_kept_ends_where_it_is_reached(play):
    _, run = play(
        act(maneuver(event("e", keep(20, continuous="false"), later(1)))), ego_brakes(at_s=25, to=0),
        init=BEHIND, stop=STOP_AT_30_S,
    )  # fmt: skip
    assert gap_m(run)[2400] == pytest.approx(20.0, abs=0.5)
    assert run.speed_mps[-1, 1] == pytest.approx(10.0, abs=0.15)
