"""Places and speeds that esmini's own tests state, for the same situations in files of our own.

The numbers are those of `test/smoke_test.py` of esmini/esmini (commit 0039c5b6), with three decimals. Its
steps are 10 ms: what holds after a time begins with the next step, and a step is made with the speed of its
end, so that a change of speed leads it 5 ms x the change further.
"""

import math

import pytest

from scenarios.openscenario import Engine, load
from tests.scenarios.openscenario.conftest import (
    act,
    at,
    at_time,
    by_entity,
    by_value,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
)

LANE_M = 3.07
LANE = f'<width sOffset="0" a="{LANE_M}" b="0" c="0" d="0"/></lane>'
LINKED = '<lane id="{}" type="driving"><link><successor id="{}"/></link>' + LANE


def road(name, x, heading, length, link=""):
    return (
        f'<road id="{name}" junction="-1" length="{length}"><link>{link}</link><planView>'
        f'<geometry s="0" x="{x}" y="0" hdg="{heading}" length="{length}"><line/></geometry></planView>'
        f'<lanes><laneSection s="0"><left>{LINKED.format(1, -1)}</left>'
        f'<center><lane id="0" type="none"/></center>'
        f"<right>{LINKED.format(-1, 1)}</right></laneSection></lanes></road>"
    )


def onto(name):
    return f'<successor elementType="road" elementId="{name}" contactPoint="end"/>'


STRAIGHT = road("1", 0, 0, 500).replace('<link><successor id="-1"/></link>', "")
STRAIGHT = STRAIGHT.replace('<link><successor id="1"/></link>', "")
OPPOSITE = road("1", 0, 0, 100, onto("2")) + road("2", 200, math.pi, 100, onto("1"))
"""Two roads whose ends meet: on the second, s and the ids of lanes run the other way."""


@pytest.fixture
def run(write, tmp_path):
    def play(*acts, until=40.0, roads=STRAIGHT, init="", plane=False, apply_performance=False):
        stop = trigger(condition(at_time(until)), kind="StopTrigger")
        path = write(*acts, init=init, stop=stop)
        network = f'<OpenDRIVE><header revMajor="1" revMinor="6"/>{roads}</OpenDRIVE>'
        (tmp_path / "two_roads.xodr").write_text(network, encoding="utf-8")
        text = path.read_text(encoding="utf-8")
        if plane:
            text = text.replace('<LogicFile filepath="two_roads.xodr"/>', "")
        text = text.replace('maxAcceleration="5"', 'maxAcceleration="10"')  # that of esmini's cars
        path.write_text(text, encoding="utf-8")
        return Engine(load(path), apply_performance=apply_performance).run(until)

    return play


def place(s, lane=-1, inner="", offset=0.0):
    return lane_position(s, lane, offset, inner, "1")


def after(seconds):
    """A step after a time: `greaterThan`."""
    return trigger(condition(at_time(seconds + 0.01)))


def lane_change(lane, shape, dimension, value, offset=0.0):
    return (
        f'<PrivateAction><LateralAction><LaneChangeAction targetLaneOffset="{offset}">'
        f'<LaneChangeActionDynamics dynamicsShape="{shape}" dynamicsDimension="{dimension}" value="{value}"/>'
        f'<LaneChangeTarget><AbsoluteTargetLane value="{lane}"/></LaneChangeTarget></LaneChangeAction>'
        "</LateralAction></PrivateAction>"
    )


FAR = private("Other", teleport(place(450, 1)))


def test_a_lane_change_in_reverse(run):
    """reverse_lane_change: to -50 km/h within 4 s, longer by the Performance, then one lane to the left."""
    v = 50 / 3.6
    back = event("back", speed(-v, "sinusoidal", "time", 4), after(1))
    change = event("change", lane_change(1, "cubic", "time", 3), after(5))
    driven = run(
        act(maneuver(back, change), actors="Ego"),
        init=private("Ego", teleport(place(250)), speed(v)) + FAR,
        until=11,
        apply_performance=True,
    )
    assert at(driven, "Ego", 2.0) == pytest.approx((276.626, -1.535, 0, 10.507), abs=0.005 * 3.4 + 0.001)
    assert at(driven, "Ego", 3.19) == pytest.approx((283.248, -1.535, 0, 0.017), abs=0.005 * 13.9 + 0.001)
    x, y, yaw, v_mps = at(driven, "Ego", 7.0)
    # a car that goes back to the left has its front to the right: 6.184 rad
    assert (x, y, v_mps) == pytest.approx((241.403, 0.725, -13.889), abs=0.005 * 27.8 + 0.001)
    assert math.remainder(yaw - 6.184, 2 * math.pi) == pytest.approx(0, abs=0.002)
    assert at(driven, "Ego", 10.0)[:2] == pytest.approx((199.766, 1.535), abs=0.14)


def test_lane_changes_while_the_speed_changes(run):
    """test_action_dynamics: by time, way and rate, with offsets; road 2 counts lanes the other way."""
    about = '<Orientation type="relative" h="3.1415926"/>'
    events = (
        event("lane 1", lane_change(-1, "linear", "time", 5, -1.0), after(2)),
        event("speed 1", speed(4, "linear", "time", 4), after(3)),
        event("lane 2", lane_change(1, "linear", "distance", 25, -0.2), after(10)),
        event("lane 3", lane_change(1, "sinusoidal", "rate", 1), after(17)),
        event("speed 2", speed(7, "cubic", "time", 3), after(18)),
    )
    driven = run(
        act(maneuver(*events), actors="Ego"),
        init=private("Ego", teleport(place(10, 1, about)), speed(10)) + private("Other", teleport(place(5))),
        roads=OPPOSITE,
        until=23,
    )
    for seconds, x, y, v in [
        (2.01, 30.100, 1.535, 10.0),
        (6.37, 65.070, -2.014, 4.960),
        (7.00, 67.854, -2.527, 4.015),
        (14.4, 97.247, 0.151, 4.0),
        (18.15, 112.130, 0.914, 4.019),
        (22.54, 138.567, -1.529, 7.0),
    ]:
        assert at(driven, "Ego", seconds)[:2] == pytest.approx((x, y), abs=0.005 * 6 + 0.002)
        assert at(driven, "Ego", seconds)[3] == pytest.approx(v, abs=0.005)


def test_speeds_over_ways(run):
    """speed_over_distance: sinusoidal over 50 m, linear over 80 m, cubic over 100 m."""

    def reached(s):
        reach = f'<ReachPositionCondition tolerance="1">{place(s)}</ReachPositionCondition>'
        return trigger(condition(by_entity(reach)))

    first = speed(50 / 3.6, "sinusoidal", "distance", 50)
    driven = run(
        act(
            maneuver(event("slower", speed(10 / 3.6, "linear", "distance", 80), reached(101)), name="m1"),
            maneuver(event("faster", speed(80 / 3.6, "cubic", "distance", 100), reached(201)), name="m2"),
            actors="Ego",
        ),
        init=private("Ego", teleport(place(10)), first) + FAR,
        until=36,
    )
    for seconds, x, v in [
        (5.0, 31.740, 10.928),
        (10.08, 100.069, 13.889),
        (19.68, 180.014, 2.778),
        (28.0, 203.527, 3.814),
        (34.86, 299.667, 22.222),
    ]:  # the sum of steps with the speed of their ends is further by half of what a step adds
        assert at(driven, "Ego", seconds)[0] == pytest.approx(x, abs=0.01 * max(v, 6.0))
        assert at(driven, "Ego", seconds)[3] == pytest.approx(v, abs=0.002)


def entity(name, inner):
    return f'<GlobalAction><EntityAction entityRef="{name}">{inner}</EntityAction></GlobalAction>'


def test_entities_that_go_and_come_back(run):
    """add_delete_entity: what is there is not added; who is deleted comes back from there with its speed."""
    v = 70 / 3.6
    relative = '<Position><RelativeLanePosition entityRef="Ego" ds="220" dLane="0"/></Position>'
    at_end = trigger(condition(by_entity('<EndOfRoadCondition duration="0"/>')))
    ego = (
        event("in vain", entity("Ego", f"<AddEntityAction>{place(10)}</AddEntityAction>"), after(2)),
        event("goes", entity("Ego", "<DeleteEntityAction/>"), after(10)),
        event("comes", entity("Ego", f"<AddEntityAction>{relative}</AddEntityAction>"), after(12)),
        event("ends", entity("Ego", "<DeleteEntityAction/>"), at_end),
    )
    comes = event("comes", entity("Other", f"<AddEntityAction>{place(90)}</AddEntityAction>"), after(3))
    comes = comes.replace("</Action>", f'</Action><Action name="b">{speed(v)}</Action>')
    goes = event("goes", entity("Other", "<DeleteEntityAction/>"), after(7))
    driven = run(
        act(maneuver(*ego), actors="Ego"),
        act(maneuver(comes, goes, name="other"), name="second"),
        init=private("Ego", teleport(place(10)), speed(v)),
        until=18,
    )
    assert at(driven, "Ego", 3.02)[:2] == pytest.approx((68.722, -1.535), abs=1e-3)
    assert at(driven, "Other", 3.02)[:2] == pytest.approx((90.194, -1.535), abs=1e-3)
    assert at(driven, "Other", 7.01)[0] == pytest.approx(167.778, abs=1e-3)
    assert at(driven, "Ego", 15.88)[0] == pytest.approx(499.889, abs=1e-3)
    ego_column, other_column = (driven.names.tolist().index(name) for name in ("Ego", "Other"))
    there = {
        (name, t): bool(driven.exists[int(abs(driven.time_s - t).argmin()), column])
        for name, column in (("Ego", ego_column), ("Other", other_column))
        for t in (1.0, 5.0, 8.0, 11.0, 14.0, 17.0)
    }
    assert [there["Ego", t] for t in (1.0, 5.0, 8.0, 11.0, 14.0, 17.0)] == [
        True,
        True,
        True,
        False,
        True,
        False,
    ]
    assert [there["Other", t] for t in (1.0, 5.0, 8.0)] == [False, True, False]


def point(x, y, h=None):
    heading = "" if h is None else f' h="{h}"'
    return f'<Position><WorldPosition x="{x}" y="{y}"{heading}/></Position>'


def follow(shape, time="<None/>"):
    return (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        f'<Trajectory name="t" closed="false"><Shape>{shape}</Shape></Trajectory></TrajectoryRef>'
        f'<TimeReference>{time}</TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )


CLOTHOID = '<Clothoid curvature="0" curvatureDot="0.0007" length="90">{}</Clothoid>'


def test_a_clothoid_forwards_and_in_reverse(run):
    """trajectory_heading: 90 m whose curvature grows by 0.0007 1/m2; in reverse the rear is in front."""
    driven = run(
        init=private("Ego", speed(10), follow(CLOTHOID.format(point(0, 0, 0))))
        + private("Other", speed(-10), follow(CLOTHOID.format(point(-15, 4, 0)))),
        until=8,
        plane=True,
    )
    assert at(driven, "Ego", 5.9) == pytest.approx((50.824, 21.537, 1.218, 10), abs=1e-3)
    assert at(driven, "Ego", 6.1) == pytest.approx((51.435, 23.441, 1.302, 10), abs=1e-3)
    assert at(driven, "Other", 5.9) == pytest.approx((35.824, 25.537, 4.360, -10), abs=1e-3)
    assert at(driven, "Other", 6.1) == pytest.approx((36.435, 27.441, 4.444, -10), abs=1e-3)


def test_trajectories_that_turn_round_and_that_wait(run):
    """trajectory_special_cases: back along the same line at once; and by times, with a second of standing."""
    corners = [(0, 0), (-10, 0), (-17.07, -7.07), (-17.07, -17.07), (-17.07, 2)]
    line = "".join(f"<Vertex>{point(*corner)}</Vertex>" for corner in corners)
    timed = [(0, -12, 15, 0.0), (1.25, -22, 15, 0.79), (2.5, -29.07, 7.93, 1.57), (3.75, -29.07, -2.07, 1.57)]
    timed += [(4.75, -29.07, -2.07, 1.57), (4.75 + 19.07 / 8, -29.07, 17, 1.57)]
    waits = "".join(f'<Vertex time="{t}">{point(x, y, h)}</Vertex>' for t, x, y, h in timed)
    timing = '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/>'
    driven = run(
        init=private("Ego", speed(8), follow(f"<Polyline>{line}</Polyline>"))
        + private("Other", speed(8), follow(f"<Polyline>{waits}</Polyline>", timing)),
        until=7,
        plane=True,
    )
    for seconds, x, y in [(2.5, -17.070, -7.072), (3.9, -17.070, -15.868)]:
        assert at(driven, "Ego", seconds)[:2] == pytest.approx((x, y), abs=1e-3)
    for seconds, x, y in [(2.5, -29.070, 7.930), (3.9, -29.070, -2.070), (6.2, -29.070, 9.530)]:
        assert at(driven, "Other", seconds)[:2] == pytest.approx((x, y), abs=1e-3)
    assert at(driven, "Other", 3.9)[2:] == pytest.approx((1.57, 0), abs=1e-3)


def test_rising_edge_of_a_speed(run):
    """rising_edge: from rest to 10 m/s and back within 5 s each; below 1 m/s only once it has been above."""
    profile = (
        '<PrivateAction><LongitudinalAction><SpeedProfileAction followingMode="position">'
        '<SpeedProfileEntry speed="0" time="0"/><SpeedProfileEntry speed="10" time="5"/>'
        '<SpeedProfileEntry speed="0" time="5"/></SpeedProfileAction></LongitudinalAction></PrivateAction>'
    )
    below = by_entity('<SpeedCondition value="1" rule="lessThan"/>')
    mark = event("mark", speed(3), trigger(condition(below, edge="rising")))
    driven = run(
        act(maneuver(mark), actors="Ego"), init=private("Ego", teleport(place(40)), profile) + FAR, until=12
    )
    # esmini with steps of 0.1 s: 64.5 m at 4.9 s, 1.000 m/s at 9.5 s, and at 9.6 s it is below
    assert at(driven, "Ego", 5.0)[3] == pytest.approx(10.0)
    assert at(driven, "Ego", 4.9)[0] == pytest.approx(40 + 4.9**2)
    assert at(driven, "Ego", 9.4)[3] == pytest.approx(1.2)
    assert at(driven, "Ego", 9.51)[3] == 3.0


def test_groups_that_take_place_three_times(run):
    """maneuver_groups_x_3: to the side by 0.5 m and back, sinusoidal within 2 m/s2, three times."""

    def offset(value):
        return (
            '<PrivateAction><LateralAction><LaneOffsetAction continuous="true">'
            '<LaneOffsetActionDynamics dynamicsShape="sinusoidal" maxLateralAcc="2"/><LaneOffsetTarget>'
            f'<AbsoluteTargetLaneOffset value="{value}"/></LaneOffsetTarget></LaneOffsetAction>'
            "</LateralAction></PrivateAction>"
        )

    ended = by_value(
        '<StoryboardElementStateCondition storyboardElementType="event" storyboardElementRef="out" '
        'state="endTransition"/>'
    )
    once = offset(0.5).replace('continuous="true"', 'continuous="false"')
    back = offset(0.0).replace('continuous="true"', 'continuous="false"')
    driven = run(
        act(
            maneuver(event("out", once), event("back", back, trigger(condition(ended)))),
            actors="Ego",
            count=3,
        ),
        init=private("Ego", teleport(place(40)), speed(5)) + FAR,
        until=9,
    )
    half = math.pi * math.sqrt(0.5 * 0.5 / 2)  # esmini: 1.12 s, and 6.72 s in all
    for k in range(3):
        row = int(abs(driven.time_s - (2 * k + 1) * half).argmin())
        assert driven.y_m[row, 0] == pytest.approx(-1.535 + 0.5, abs=0.01)
    assert at(driven, "Ego", 6.79)[1] == pytest.approx(-1.535, abs=1e-6)
    assert 6 * half == pytest.approx(6.72, abs=0.07)
