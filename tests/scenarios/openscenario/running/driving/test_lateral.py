"""Lane changes, lane offsets and lateral distances against closed forms."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import quad

from scenarios.openscenario import Engine, RunError, load
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
    write_scenario,
)

PART = {
    "linear": (lambda p: p, lambda p: 1.0, 1.0),
    "cubic": (lambda p: p * p * (3 - 2 * p), lambda p: 6 * p * (1 - p), 1.5),
    "sinusoidal": (
        lambda p: 0.5 * (1 - math.cos(math.pi * p)),
        lambda p: 0.5 * math.pi * math.sin(math.pi * p),
        math.pi / 2,
    ),
}
"""Shapes after a share: what is done, its slope, the greatest slope."""


def lateral(inner):
    return f"<PrivateAction><LateralAction>{inner}</LateralAction></PrivateAction>"


def change(shape="cubic", dimension="time", value=4.0, target='<AbsoluteTargetLane value="-1"/>', offset=0.0):
    return lateral(
        f'<LaneChangeAction targetLaneOffset="{offset}"><LaneChangeActionDynamics dynamicsShape="{shape}" '
        f'dynamicsDimension="{dimension}" value="{value}"/><LaneChangeTarget>{target}</LaneChangeTarget>'
        "</LaneChangeAction>"
    )


def lane_offset(
    value, shape="cubic", limit=' maxLateralAcc="2"', continuous="false", target="AbsoluteTargetLaneOffset"
):
    return lateral(
        f'<LaneOffsetAction continuous="{continuous}">'
        f'<LaneOffsetActionDynamics dynamicsShape="{shape}"{limit}/>'
        f"<LaneOffsetTarget><{target} {value}/></LaneOffsetTarget></LaneOffsetAction>"
    )


def aside(distance, side="any", freespace="true", continuous="true", inner=""):
    return lateral(
        f'<LateralDistanceAction entityRef="Ego" {distance} freespace="{freespace}" '
        f'continuous="{continuous}" '
        f'displacement="{side}">{inner}</LateralDistanceAction>'
    )


def later(seconds):
    return trigger(condition(at_time(seconds)))


def in_lane(lane=-2, v=20, s=20):
    return EGO_AT_START + private("Other", teleport(lane_position(s, lane=lane)), speed(v))


def begun(play, action, **parts):
    parts.setdefault("init", in_lane())
    return play(act(maneuver(event("e", action, later(1)))), **parts)


@pytest.mark.parametrize("shape", PART)
def test_a_change_over_a_time_follows_its_shape_at_the_speed_of_the_entity(play, shape):
    """3.5 m in 4 s at 20 m/s: the offset follows the shape, and the way gone is that of the speed."""
    done, slope, _ = PART[shape]
    _, run = begun(play, change(shape))
    for t in (1.5, 2.0, 3.0, 4.2):
        part = (t - 1) / 4
        x, y, yaw, v = at(run, "Other", t)
        across = 3.5 * slope(part) / 4
        along = quad(lambda p: 4 * math.sqrt(400 - (3.5 * slope(p) / 4) ** 2), 0, part)[0]
        assert y == pytest.approx(-5.25 + 3.5 * done(part), abs=1e-4)
        assert x == pytest.approx(40 + along, abs=1e-4)
        assert yaw == pytest.approx(math.asin(across / 20), abs=1e-3)
        assert v == 20.0
    assert at(run, "Other", 5.01)[1:] == pytest.approx((-1.75, 0, 20), abs=1e-6)
    assert at(run, "Other", 8.0)[1:] == pytest.approx((-1.75, 0, 20), abs=1e-9)


@pytest.mark.parametrize("shape", PART)
def test_a_change_by_rate_has_that_greatest_lateral_speed(play, shape):
    done, _, steepest = PART[shape]
    duration = steepest * 3.5 / 1.4
    _, run = begun(play, change(shape, "rate", 1.4))
    for t in (2.0, 3.0):
        assert at(run, "Other", t)[1] == pytest.approx(-5.25 + 3.5 * done((t - 1) / duration), abs=1e-4)
    assert at(run, "Other", math.ceil(100 + 100 * duration) / 100)[1] == pytest.approx(-1.75, abs=1e-6)


@pytest.mark.parametrize("shape", PART)
def test_a_change_over_a_way_follows_its_shape_along_the_lane(play, shape):
    done, _, _ = PART[shape]
    _, run = begun(play, change(shape, "distance", 50))
    for t in (1.5, 2.0, 3.0):
        x, y, _, v = at(run, "Other", t)
        assert y == pytest.approx(-5.25 + 3.5 * done((x - 40) / 50), abs=1e-3)
        assert v == 20.0
    assert at(run, "Other", 4.0)[1] == pytest.approx(-1.75, abs=1e-9)


def test_a_step_is_at_once(play):
    _, run = begun(play, change("step", "time", 0))
    assert at(run, "Other", 1.0)[:3] == pytest.approx((40, -1.75, 0))
    assert at(run, "Other", 2.0)[:3] == pytest.approx((60, -1.75, 0))


@pytest.mark.parametrize(
    ("target", "y"),
    [
        ('<RelativeTargetLane entityRef="Other" value="1"/>', -1.75),
        ('<RelativeTargetLane entityRef="Ego" value="-1"/>', -5.25),
        ('<RelativeTargetLane entityRef="Ego" value="1"/>', 1.75),  # there is no lane 0
        ('<AbsoluteTargetLane value="1"/>', 1.75),
    ],
)
def test_targets(play, target, y):
    _, run = begun(play, change(target=target))
    assert at(run, "Other", 6.0)[1] == pytest.approx(y, abs=1e-9)


def test_the_offset_in_the_target_lane(play):
    _, run = begun(play, change(offset=0.5))
    assert at(run, "Other", 6.0)[1:3] == pytest.approx((-1.25, 0), abs=1e-9)


def test_against_the_direction_of_the_road_left_is_on_the_other_side(play):
    init = EGO_AT_START + private("Other", teleport(lane_position(250, lane=1)), speed(20))
    _, run = begun(play, change(target='<RelativeTargetLane entityRef="Other" value="-1"/>'), init=init)
    x, y, yaw, _ = at(run, "Other", 6.0)
    assert y == pytest.approx(5.25, abs=1e-9)
    assert math.cos(yaw) == pytest.approx(-1.0)
    assert x == pytest.approx(130, abs=0.2)


def test_the_event_ends_with_the_change(play):
    changed = event("e", change(), later(1))
    after = event(
        "after",
        speed(5),
        trigger(
            condition(
                "<ByValueCondition><StoryboardElementStateCondition storyboardElementType='event' "
                "storyboardElementRef='e' state='endTransition'/></ByValueCondition>"
            )
        ),
    )
    _, run = play(act(maneuver(changed, after)), init=in_lane())
    assert at(run, "Other", 4.99)[3] == 20.0
    assert at(run, "Other", 5.01)[3] == 5.0


def test_a_change_keeps_its_time_where_the_speed_changes_meanwhile(play):
    """Braking from 20 to 8 m/s during the change: the offset follows the shape, and all ends after 4 s."""
    brake = event("b", speed(8, "linear", "rate", 4), later(2))
    _, run = play(act(maneuver(event("e", change(), later(1)), brake)), init=in_lane())
    done = PART["cubic"][0]
    for t in (2.0, 3.0, 4.5):
        assert at(run, "Other", t)[1] == pytest.approx(-5.25 + 3.5 * done((t - 1) / 4), abs=1e-3)
    assert at(run, "Other", 5.02)[1:3] == pytest.approx((-1.75, 0), abs=1e-6)
    assert at(run, "Other", 5.02)[3] == 8.0


def test_who_is_too_slow_takes_longer_and_it_is_noted(play):
    engine, run = begun(play, change(value=1.0), init=in_lane(v=2))
    assert at(run, "Other", 8.0)[1:] == pytest.approx((-1.75, 0, 2), abs=1e-6)
    headings = run.yaw_rad[:, 1]
    assert headings.max() <= math.pi / 4 + 0.01
    assert any("too slow to move 3.5 m sideways" in note for note in engine.notes)


def test_who_stands_waits(play):
    setting_off = event("s", speed(10), later(3))
    _, run = play(act(maneuver(event("e", change(), later(1)), setting_off)), init=in_lane(v=0))
    assert at(run, "Other", 2.9)[:3] == pytest.approx((20, -5.25, 0))
    assert at(run, "Other", 9.0)[1] == pytest.approx(-1.75, abs=1e-6)


def test_a_change_that_is_stopped_leaves_the_entity_at_its_offset(play):
    """The act ends at 3 s, when half of the change is done."""
    _, run = play(
        act(
            maneuver(event("e", change(), later(1))), stop=trigger(condition(at_time(3)), kind="StopTrigger")
        ),
        init=in_lane(),
    )
    assert at(run, "Other", 3.0)[1] == pytest.approx(-3.5, abs=1e-3)
    assert at(run, "Other", 6.0)[1:3] == pytest.approx((-3.5, 0), abs=1e-3)


def test_a_lane_that_is_not_there_is_an_error_of_one_line(write):
    path = write(
        act(maneuver(event("e", change(target='<AbsoluteTargetLane value="-7"/>'), later(1)))), init=in_lane()
    )
    with pytest.raises(RunError, match="road 'A' has no lane -7"):
        Engine(load(path)).run()


@settings(max_examples=15, deadline=None)
@given(
    shape=st.sampled_from(sorted(PART)),
    duration=st.floats(1.5, 6.0),
    v=st.floats(6.0, 35.0),
    decel=st.sampled_from([0.0, 1.0, 3.0]),
)
def test_speed_and_way_agree_whatever_the_change(tmp_path_factory, shape, duration, v, decel):
    """The way gone is the integral of the speed, the end the middle of the lane, and y never overshoots."""
    slower = [event("b", speed(v / 2, "linear", "rate", decel), later(1.5))] if decel else []
    path = write_scenario(
        tmp_path_factory.mktemp("s"),
        act(maneuver(event("e", change(shape, "time", duration), later(1)), *slower)),
        init=in_lane(v=v),
        stop=trigger(condition(at_time(9)), kind="StopTrigger"),
    )
    run = Engine(load(path)).run()
    column = run.names.tolist().index("Other")
    x, y, s = run.x_m[:, column], run.y_m[:, column], run.speed_mps[:, column]
    chords = np.hypot(np.diff(x), np.diff(y))
    np.testing.assert_allclose(chords, 0.5 * (s[1:] + s[:-1]) * np.diff(run.time_s), atol=2e-3)
    assert np.diff(y).min() >= -1e-6
    assert y[-1] == pytest.approx(-1.75, abs=1e-6)


@pytest.mark.parametrize(
    ("shape", "duration"),
    [
        ("cubic", math.sqrt(6 * 1.0 / 2)),  # 6 d / T^2 is the greatest second derivative of d (3 p^2 - 2 p^3)
        ("sinusoidal", math.pi * math.sqrt(1.0 / (2 * 2))),
        ("linear", math.sqrt(6 * 1.0 / 2)),
    ],
)
def test_an_offset_within_the_lateral_acceleration(play, shape, duration):
    _, run = begun(play, lane_offset('value="1"', shape))
    done = PART[shape][0]
    assert at(run, "Other", 1.5)[1] == pytest.approx(-5.25 + done(0.5 / duration), abs=1e-3)
    assert at(run, "Other", 1.01 + math.ceil(duration * 100) / 100)[1:3] == pytest.approx(
        (-4.25, 0), abs=1e-6
    )


def test_an_offset_without_limit_is_at_once(play):
    _, run = begun(play, lane_offset('value="1"', limit=""))
    assert at(run, "Other", 1.0)[1] == pytest.approx(-4.25)


def test_an_offset_beside_an_entity_that_moves_is_kept(play):
    """The ego jumps 1 m to the left at 4 s; the other keeps 2 m to the right of it, within its limits."""
    beside = lane_offset('entityRef="Ego" value="-2"', continuous="true", target="RelativeTargetLaneOffset")
    away = act(maneuver(event("m", lane_offset('value="1"', limit=""), later(4))), actors="Ego", name="away")
    _, run = play(act(maneuver(event("e", beside, later(1)))), away, init=in_lane())
    assert at(run, "Other", 3.9)[1] == pytest.approx(-3.75, abs=1e-6)
    assert at(run, "Other", 8.0)[1] == pytest.approx(-2.75, abs=1e-3)


@pytest.mark.parametrize(
    ("action", "y"),
    [
        (aside('distance="1"'), -1.75 - 1 - 2),  # both are 2 m wide
        (aside('distance="1"', freespace="false"), -2.75),
        (aside('distance="1"', "leftToReferencedEntity"), -1.75 + 3),
        (aside('distance="1"', continuous="false"), -4.75),
        (aside("", inner='<DynamicConstraints maxAcceleration="2"/>'), -5.25),
    ],
)
def test_lateral_distance(play, action, y):
    _, run = begun(play, action)
    assert at(run, "Other", 5.0)[1:3] == pytest.approx((y, 0), abs=1e-6)


def test_lateral_distance_within_limits(play):
    """0.5 m with 1 m/s2 at most: sqrt(6 x 0.5 / 1) s."""
    _, run = begun(play, aside('distance="1"', inner='<DynamicConstraints maxAcceleration="1"/>'))
    half = 1 + math.sqrt(3.0) / 2
    x = np.interp(half, run.time_s, run.y_m[:, 1])
    assert x == pytest.approx(-5.0, abs=1e-3)
