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


@pytest.mark.parametrize("continuous", ["true", "false"])
def test_an_offset_from_the_entity_itself_is_from_where_it_is_at_the_start(play, continuous):
    own = lane_offset('entityRef="Other" value="1"', continuous=continuous, target="RelativeTargetLaneOffset")
    _, run = begun(play, own)
    for time_s in (3.0, 6.0):
        assert at(run, "Other", time_s)[1] == pytest.approx(-5.25 + 1.0, abs=1e-6)


@pytest.mark.parametrize(
    ("action", "y"),
    [
        (aside('distance="1"'), -1.75 - 1 - 2),  # both are 2 m wide
        (aside('distance="1"', freespace="false"), -2.75),
        (aside('distance="1"', "leftToReferencedEntity"), -1.75 + 3),
        (aside('distance="1"', continuous="false"), -4.75),
        (aside("", inner='<DynamicConstraints maxAcceleration="2"/>'), -1.75 - 2),  # no distance is 0
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


BEND_M = 100.0


@pytest.fixture
def bend(write, tmp_path):
    """A run on a road that bends to the left around (0, 100) with a radius of 100 m at t = 0."""

    def play(*acts, init):
        path = write(*acts, init=init + private("Other", teleport(lane_position(290))))
        file = tmp_path / "two_roads.xodr"
        text = file.read_text(encoding="utf-8")
        head, tail = text.split("<line/>", 1)
        file.write_text(f'{head}<arc curvature="0.01"/>{tail}', encoding="utf-8")
        return Engine(load(path)).run()

    return play


def on_bend(run, time_s):
    """Radius, angle along the road, and heading less that of the road."""
    x, y, yaw, _ = at(run, "Ego", time_s)
    angle = math.atan2(x, BEND_M - y) % (2 * math.pi)
    return math.hypot(x, y - BEND_M), angle, math.remainder(yaw - angle, 2 * math.pi)


def test_who_goes_back_follows_the_lanes_behind_it(bend):
    """In reverse from the start, and after a stop: lane -1 has a radius of 101.75 m."""
    radius = BEND_M + 1.75
    run = bend(init=private("Ego", teleport(lane_position(150)), speed(-10)))
    assert on_bend(run, 10.0) == pytest.approx((radius, 1.5 - 100 / radius, 0), abs=1e-3)
    stop = event("stop", speed(-10, "linear", "time", 4), trigger(condition(at_time(2))))
    run = bend(
        act(maneuver(stop), actors="Ego"), init=private("Ego", teleport(lane_position(150)), speed(10))
    )
    # 20 m ahead, from 10 to -10 m/s on the spot, then 40 m back
    assert on_bend(run, 10.0) == pytest.approx((radius, 1.5 - 20 / radius, 0), abs=1e-3)


def test_a_lane_change_in_reverse_on_a_bend(bend):
    """4 s at 10 m/s: half of 3.5 m after 2 s, when it heads across the lane by asin of its slope."""
    swap = event(
        "swap", change("cubic", "time", 4, '<AbsoluteTargetLane value="1"/>'), trigger(condition(at_time(2)))
    )
    run = bend(
        act(maneuver(swap), actors="Ego"), init=private("Ego", teleport(lane_position(200)), speed(-10))
    )
    radius, _, turned = on_bend(run, 4.0)
    assert radius == pytest.approx(BEND_M, abs=1e-3)
    # backwards to the left: the front points to the right
    assert turned == pytest.approx(-math.asin(1.5 * 3.5 / 40), abs=1e-3)
    assert on_bend(run, 8.0)[0] == pytest.approx(BEND_M - 1.75, abs=1e-3)
    assert on_bend(run, 8.0)[2] == pytest.approx(0.0, abs=1e-6)


def beside(
    system, value=4.0, side="leftToReferencedEntity", limits='<DynamicConstraints maxSpeed="2.8125"/>'
):
    return lateral(
        f'<LateralDistanceAction entityRef="Ego" distance="{value}" freespace="false" continuous="false" '
        f'displacement="{side}" coordinateSystem="{system}">{limits}</LateralDistanceAction>'
    )


@pytest.mark.parametrize("system", ["entity", "lane", "road"])
def test_a_lateral_distance_across_the_lane(play, system):
    """4 m to the left of the ego, which is in the middle of lane -1 (y = -1.75): at y = 2.25."""
    init = EGO_AT_START + private("Other", teleport(lane_position(60, lane=-2)), speed(10))
    _, run = play(act(maneuver(event("e", beside(system)))), init=init)
    # 7.5 m at up to 2.8125 m/s: 4 s, as 1.5 is the greatest slope of a cubic
    assert at(run, "Other", 2.0)[1] == pytest.approx(0.5 * (2.25 - 5.25), abs=1e-3)
    assert at(run, "Other", 4.0)[1] == pytest.approx(2.25, abs=1e-6)


def test_a_lateral_distance_beside_all_lanes_counts_from_straight_ahead(play):
    init = EGO_AT_START + private(
        "Other", teleport('<Position><WorldPosition x="60" y="80" h="0.5"/></Position>'), speed(10)
    )
    action = beside("entity", 20, "any", "")
    _, run = play(act(maneuver(event("e", action))), init=init)
    x, y, yaw, _ = at(run, "Other", 0.0)
    # the ego is at (10, -1.75): across the line ahead of the other it is now 20 m away
    assert -(10 - x) * math.sin(yaw) + (-1.75 - y) * math.cos(yaw) == pytest.approx(-20, abs=1e-6)
    with pytest.raises(RunError, match="'Other' is on no road at"):
        play(act(maneuver(event("e", beside("lane", 20, "any", "")))), init=init)


def test_a_lateral_distance_across_a_trajectory(play):
    """Along a line of slope 3 to 4 from (60, -20): 5 m to the left of it passes the ego's place by 5 m."""
    points = "".join(
        f'<Vertex><Position><WorldPosition x="{60 + 40 * k}" y="{-20 + 30 * k}"/></Position></Vertex>'
        for k in (0, 4)
    )
    line = (
        '<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" '
        f'closed="false"><Shape><Polyline>{points}</Polyline></Shape></Trajectory></TrajectoryRef>'
        '<TimeReference><None/></TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )
    init = private("Ego", teleport(lane_position(10))) + private("Other", speed(10), line)
    later = trigger(condition(at_time(2)))
    _, run = play(act(maneuver(event("e", beside("trajectory", 5, "any", ""), later))), init=init)
    x, y, yaw, _ = at(run, "Other", 4.0)
    across = (-(10 - x) * 0.6 + (-1.75 - y) * 0.8, math.atan2(3, 4))
    assert (abs(across[0]), yaw) == pytest.approx((5.0, across[1]), abs=1e-6)
    with pytest.raises(RunError, match="across its trajectory, and follows none at"):
        play(act(maneuver(event("e", beside("trajectory", 5, "any", "")))))


def test_speeds_that_follow_one_another_in_a_circle_are_refused(play):
    def paced(other):
        target = (
            f'<RelativeTargetSpeed entityRef="{other}" value="1" speedTargetValueType="delta" '
            'continuous="true"/>'
        )
        return speed(0).replace('<AbsoluteTargetSpeed value="0"/>', target)

    ego = act(maneuver(event("e", paced("Other"))), actors="Ego", name="first")
    with pytest.raises(RunError, match="relative to that of 'Ego', which follows that of 'Other'"):
        play(ego, act(maneuver(event("o", paced("Ego")), name="n")))
    # one that has stopped to follow is followed again
    stop = event("stop", speed(5), trigger(condition(at_time(1))))
    back = event("o", paced("Ego"), trigger(condition(at_time(2))))
    _, run = play(ego, act(maneuver(stop, name="s"), actors="Ego", name="s"), act(maneuver(back, name="n")))
    assert at(run, "Other", 3.0)[3] == 6.0


@pytest.mark.parametrize("first", [-5, 5])
def test_who_turns_back_within_a_lane_change_goes_on_with_it(play, first):
    """From one direction to the other on the spot, 2 s after the beginning of a change of 6 s."""
    swap = event("swap", change("cubic", "time", 6), trigger(condition(at_time(1))))
    back = event("back", speed(-first), trigger(condition(at_time(3))))
    init = private("Ego", teleport(lane_position(10))) + private(
        "Other", teleport(lane_position(150, lane=-2)), speed(first)
    )
    _, run = play(act(maneuver(swap, back)), init=init)
    x, y, _, _ = at(run, "Other", 3.0)
    assert y == pytest.approx(-5.25 + 3.5 * PART["cubic"][0](2 / 6), abs=0.01)
    # the rest of the change begins anew within the 4 s that are left
    assert at(run, "Other", 5.0)[1] == pytest.approx(0.5 * (y - 1.75), abs=0.02)
    assert at(run, "Other", 8.0)[1] == pytest.approx(-1.75, abs=1e-3)
    assert (at(run, "Other", 8.0)[0] - x) * first < -4.0 * 5.0
