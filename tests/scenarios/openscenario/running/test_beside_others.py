"""Distances within limits of the jerk; offsets and lanes beside others on bends and on other roads."""

import math

import numpy as np
import pytest

from scenarios.openscenario import Engine, load
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

LIMIT = 3.0


def distance(gap, jerk, limit=LIMIT):
    rates = "" if jerk is None else f' maxAccelerationRate="{jerk}" maxDecelerationRate="{jerk}"'
    return (
        '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Other" freespace="false" '
        f'continuous="true" displacement="trailingReferencedEntity" {gap}><DynamicConstraints '
        f'maxAcceleration="{limit}" maxDeceleration="{limit}" maxSpeed="40"{rates}/>'
        "</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"
    )


@pytest.mark.parametrize("jerk", [None, 0.5, 3.0])
@pytest.mark.parametrize(
    ("gap", "wanted_m", "ego_mps", "start_m"),
    [
        ('distance="15"', 15, 10, 10),
        ('timeGap="2"', 10, 0, 30),
        ('timeGap="1"', 5, 5, 52),
        ('timeGap="2"', 10, 10, 20),
    ],
)
def test_a_distance_within_limits_of_the_jerk_comes_to_rest(play, jerk, gap, wanted_m, ego_mps, start_m):
    """Behind another at 5 m/s, from 50, 40, 30 and 8 m: it settles, without swinging, within every limit."""
    ego = private("Ego", teleport(lane_position(start_m)), speed(ego_mps), distance(gap, jerk))
    _, run = play(
        init=ego + private("Other", teleport(lane_position(60)), speed(5)),
        stop=trigger(condition(at_time(40)), kind="StopTrigger"),
    )
    left = run.x_m[:, 1] - run.x_m[:, 0] - wanted_m
    v = run.speed_mps[:, 0]
    assert abs(left[-1]) < 0.15
    assert v[-1] == pytest.approx(5.0, abs=0.1)
    assert abs(left[-1000:]).max() < 0.5
    acceleration = np.diff(v[:-1]) / 0.01
    assert abs(acceleration).max() <= LIMIT + 1e-6
    if jerk is not None:
        assert abs(np.diff(acceleration)).max() <= 0.01 * jerk + 1e-6
    # it passes the place at most once, where it has no choice, and then comes back to it
    side = np.sign(left[abs(left) > 0.2])
    assert (np.diff(side) != 0).sum() <= 1


RADIUS_M = 100.0
ARC = (
    '<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="A" junction="-1" length="300"><link/><planView>'
    f'<geometry s="0" x="0" y="0" hdg="0" length="300"><arc curvature="{1 / RADIUS_M}"/></geometry>'
    "</planView>"
    '<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>'
    + "".join(
        f'<lane id="{-k}" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane>'
        for k in (1, 2)
    )
    + "</right></laneSection></lanes></road></OpenDRIVE>"
)


def lateral_distance(metres):
    return (
        '<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" freespace="false" '
        f'continuous="true" distance="{metres}" coordinateSystem="lane" '
        'displacement="rightToReferencedEntity"/></LateralAction></PrivateAction>'
    )


def offset_beside(metres):
    return (
        '<PrivateAction><LateralAction><LaneOffsetAction continuous="true"><LaneOffsetActionDynamics '
        'dynamicsShape="step"/><LaneOffsetTarget><RelativeTargetLaneOffset entityRef="Other" '
        f'value="{metres}"/></LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>'
    )


@pytest.mark.parametrize("other_m", [20, 100, 180])
@pytest.mark.parametrize(("action", "left_m"), [(lateral_distance(4), -4.0), (offset_beside(-3), -3.0)])
def test_offsets_beside_another_behind_or_ahead_on_a_bend(write, tmp_path, other_m, action, left_m):
    """Both at 5 m/s on a circle of 100 m, one of them up to 80 m behind: the difference of the radii."""
    ego = private("Ego", teleport(lane_position(100)), speed(5), action)
    other = private("Other", teleport(lane_position(other_m, offset=0.3)), speed(5))
    path = write(init=ego + other)
    (tmp_path / "two_roads.xodr").write_text(ARC, encoding="utf-8")
    run = Engine(load(path)).run(5.0)
    radius = np.hypot(run.x_m, run.y_m - RADIUS_M)
    np.testing.assert_allclose(radius[1:, 1] - radius[1:, 0], left_m, atol=2e-3)


def lane_change(value):
    return (
        '<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="cubic" '
        'dynamicsDimension="time" value="2"/><LaneChangeTarget><RelativeTargetLane entityRef="Other" '
        f'value="{value}"/></LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>'
    )


@pytest.mark.parametrize(
    ("ego", "other", "value", "y"),
    [
        # road B runs west: its lane 1 goes on from lane -1 of A, and its lane 2 from lane -2
        ((("A", 250, -2)), ("B", 380, 1), 0, -1.75),
        ((("A", 250, -1)), ("B", 380, 2), 0, -5.25),
        ((("A", 250, -1)), ("B", 380, 1), -1, -5.25),
        ((("A", 250, -2)), ("B", 380, 2), 1, -1.75),
        # the other is behind
        (("B", 380, 2), ("A", 250, -1), 0, -1.75),
        # and comes towards it: to its left is the right
        (("A", 250, -2), ("B", 380, -1), 1, -1.75),
    ],
)
def test_a_lane_relative_to_another_on_another_road(play, ego, other, value, y):
    place = {
        name: teleport(lane_position(s, lane, road_id=road))
        for name, (road, s, lane) in (("Ego", ego), ("Other", other))
    }
    change = event("e", lane_change(value), trigger(condition(at_time(1))))
    _, run = play(
        act(maneuver(change), actors="Ego"),
        init=private("Ego", place["Ego"], speed(5)) + private("Other", place["Other"], speed(1)),
    )
    assert at(run, "Ego", 4.0)[1] == pytest.approx(y, abs=1e-6)
    assert math.isclose(at(run, "Ego", 0.5)[2] % (2 * math.pi), 0.0, abs_tol=1e-9)
