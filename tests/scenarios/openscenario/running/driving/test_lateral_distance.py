"""Lateral distances, most along the y axis of the actor (the standard's default), against closed forms."""

import math

import numpy as np
import pytest

from scenarios.openscenario import Engine, load
from tests.scenarios.openscenario.conftest import (
    CAR,
    MAP,
    act,
    at_time,
    condition,
    event,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
    write_scenario,
)

LENGTH_M, WIDTH_M, CENTER_M = 4.0, 2.0, 1.5
"""The box of the car of the tests, and how far its centre is ahead of the reference point."""
assert 'length="4" width="2"' in CAR
assert 'Center x="1.5"' in CAR

STEP_S = 0.01
"""The other is seen at the beginning of each step."""


def world(x, y, h=0.0):
    return f'<Position><WorldPosition x="{x}" y="{y}" h="{h}"/></Position>'


def aside(distance, side, freespace=False, continuous=True, limits="", system=""):
    coordinates = f' coordinateSystem="{system}"' if system else ""
    return (
        '<PrivateAction><LateralAction><LateralDistanceAction entityRef="Other" '
        f'distance="{distance}" freespace="{str(freespace).lower()}" '
        f'continuous="{str(continuous).lower()}" displacement="{side}"{coordinates}>{limits}'
        "</LateralDistanceAction></LateralAction></PrivateAction>"
    )


def limits(acceleration=None, most=None):
    parts = "" if acceleration is None else f' maxAcceleration="{acceleration}"'
    parts += "" if most is None else f' maxSpeed="{most}"'
    return f"<DynamicConstraints{parts}/>"


def along(shape):
    return (
        '<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" '
        f'closed="false"><Shape>{shape}</Shape></Trajectory></TrajectoryRef>'
        '<TimeReference><None/></TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )


def polyline(points):
    vertices = "".join(f"<Vertex>{world(x, y)}</Vertex>" for x, y in points)
    return along(f"<Polyline>{vertices}</Polyline>")


def circle(x, y, radius, angle, mps):
    """Where a circle to the left begins, and the actions of who drives along it."""
    shape = (
        f'<Clothoid curvature="{1 / radius}" curvaturePrime="0" length="{2 * math.pi * radius}">'
        f"{world(x, y, angle)}</Clothoid>"
    )
    return teleport(world(x, y, angle)), speed(mps), along(shape)


@pytest.fixture
def played(tmp_path):
    """A run on a plane: everything a scenario has, without its road."""

    def play(*acts, init, seconds=10.0, road=None):
        path = write_scenario(tmp_path, *acts, init=init, stop="")
        if road is None:
            text = path.read_text(encoding="utf-8")
            logic = '<LogicFile filepath="two_roads.xodr"/>'
            assert logic in text
            path.write_text(text.replace(logic, ""), encoding="utf-8")
        else:
            (tmp_path / "two_roads.xodr").write_text(road, encoding="utf-8")
        return Engine(load(path)).run(seconds)

    return play


def seen(run):
    """The other in coordinates of the ego (ahead, left, heading), each (T,)."""
    names = run.names.tolist()
    ego, other = names.index("Ego"), names.index("Other")
    yaw = run.yaw_rad[:, ego]
    dx, dy = run.x_m[:, other] - run.x_m[:, ego], run.y_m[:, other] - run.y_m[:, ego]
    ahead, left = dx * np.cos(yaw) + dy * np.sin(yaw), dy * np.cos(yaw) - dx * np.sin(yaw)
    return ahead, left, run.yaw_rad[:, other] - yaw


def gap(run, sign):
    """Between the boxes across the ego's axis: sign +1 where the ego is on the left of the other."""
    _, left, turn = seen(run)
    middle = left + CENTER_M * np.sin(turn)
    half = 0.5 * (LENGTH_M * abs(np.sin(turn)) + WIDTH_M * abs(np.cos(turn)))
    return sign * (0.0 - middle) - half - 0.5 * WIDTH_M


HEADING = 0.7
SIDES = [("leftToReferencedEntity", 1), ("rightToReferencedEntity", -1), ("any", -1)]


@pytest.mark.parametrize("bounds", ["", limits(4), limits(4, 3)])
@pytest.mark.parametrize("continuous", [True, False])
@pytest.mark.parametrize("freespace", [True, False])
@pytest.mark.parametrize(("side", "sign"), SIDES)
def test_beside_one_on_a_straight_line(played, side, sign, freespace, continuous, bounds):
    """Both in direction 0.7, the ego at first 6 m to the right, 3 m behind: 5 m aside, on that side."""
    c, s = math.cos(HEADING), math.sin(HEADING)
    init = private("Ego", teleport(world(-3 * c + 6 * s, -3 * s - 6 * c, HEADING)), speed(8)) + private(
        "Other", teleport(world(0, 0, HEADING)), speed(8)
    )
    run = played(
        act(maneuver(event("e", aside(5, side, freespace, continuous, bounds))), actors="Ego"), init=init
    )
    wide = WIDTH_M if freespace else 0.0
    late = run.time_s > (8.0 if bounds else 0.02)
    np.testing.assert_allclose(seen(run)[1][late], -sign * (5 + wide), atol=1e-6)
    np.testing.assert_allclose(seen(run)[2][late], 0.0, atol=1e-9)


RADIUS_M, MPS = 40.0, 4.0


@pytest.mark.parametrize("bounds", ["", limits(3)])
@pytest.mark.parametrize("freespace", [True, False])
@pytest.mark.parametrize(("side", "sign"), SIDES)
def test_beside_one_on_a_circle(played, side, sign, freespace, bounds):
    """The other drives round at 0.1 rad/s; the ego goes straight on, and across as the other does.

    The other moves across by 4 sin(0.1 t) m/s and gains at most 0.4 m/s2: within the limits.
    """
    init = private("Ego", teleport(world(0, -5)), speed(5)) + private(
        "Other", *circle(0, 0, RADIUS_M, 0.0, MPS)
    )
    run = played(
        act(maneuver(event("e", aside(5, side, freespace, True, bounds))), actors="Ego"),
        init=init,
        seconds=14,
    )
    late = run.time_s > (9.0 if bounds else 0.02)
    _, left, turn = seen(run)
    np.testing.assert_allclose(turn[late], MPS / RADIUS_M * run.time_s[late], atol=1e-6)
    apart = gap(run, sign) if freespace else -sign * left
    np.testing.assert_allclose(apart[late], 5.0, atol=6 * STEP_S)
    # straight on, at its own speed
    x = run.x_m[:, run.names.tolist().index("Ego")]
    np.testing.assert_allclose(np.diff(x[late]), 5 * STEP_S, atol=1e-6)


def bend(radius_m, length_m=300.0):
    return (
        '<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="A" junction="-1" '
        f'length="{length_m}"><link/><planView><geometry s="0" x="0" y="0" hdg="0" length="{length_m}">'
        f'<arc curvature="{1 / radius_m}"/></geometry></planView><lanes><laneSection s="0"><center>'
        '<lane id="0" type="none"/></center><right><lane id="-1" type="driving">'
        '<width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes>'
        "</road></OpenDRIVE>"
    )


@pytest.mark.parametrize(("side", "sign"), SIDES[:2])
@pytest.mark.parametrize("system", ["", "entity"])
def test_an_actor_that_turns_measures_across_its_own_axis(played, side, sign, system):
    """On a road round (0, 100), beside one that drives straight: the axis turns with the lane."""
    start = '<Position><LanePosition roadId="A" laneId="-1" s="20"/></Position>'
    init = private("Ego", teleport(start), speed(10)) + private(
        "Other", teleport(world(30, 2, 0.3)), speed(9)
    )
    run = played(
        act(maneuver(event("e", aside(3, side, system=system))), actors="Ego"),
        init=init,
        road=bend(100),
        seconds=5,
    )
    ego = run.names.tolist().index("Ego")
    late = run.time_s > 0.02
    np.testing.assert_allclose(seen(run)[1][late], -sign * 3.0, atol=10 * STEP_S)
    # it heads along the lane: across the radius
    angle = np.arctan2(run.x_m[:, ego], 100 - run.y_m[:, ego])
    np.testing.assert_allclose(run.yaw_rad[late, ego], angle[late], atol=1e-6)
    assert run.yaw_rad[-1, ego] > 0.5


def test_who_is_in_front_on_a_bend_is_far_aside(played):
    """Both on the lane of radius 101.75 m, 0.5 rad apart: r (1 - cos 0.5) to the left of the ego's axis."""
    places = [f'<Position><LanePosition roadId="A" laneId="-1" s="{s}"/></Position>' for s in (50, 100)]
    init = private("Ego", teleport(places[0])) + private("Other", teleport(places[1]))
    run = played(
        act(maneuver(event("e", aside(0, "any"))), actors="Ego"), init=init, road=bend(100), seconds=1
    )
    assert seen(run)[1][-1] == pytest.approx(0.0, abs=1e-3)
    ego = run.names.tolist().index("Ego")
    radius = np.hypot(run.x_m[-1, ego], run.y_m[-1, ego] - 100)
    # the lane is a polyline: its heading is off by up to half of the turn between two corners
    assert radius == pytest.approx(101.75 * math.cos(0.5), abs=0.1)


@pytest.mark.parametrize("most", [None, 2.0])
@pytest.mark.parametrize(
    ("system", "road"), [("entity", None), ("entity", MAP), ("lane", MAP), ("road", MAP)]
)
def test_following_stays_within_the_limits(played, system, road, most):
    """The other jumps 8 m aside: the ego comes after it at 1.5 m/s2 and 2 m/s at most, without overshoot."""
    jump = event("jump", teleport(world(60, 3)), trigger(condition(at_time(5))))
    init = private("Ego", teleport(world(10, -2)), speed(10)) + private(
        "Other", teleport(world(10, -5)), speed(10)
    )
    keep = event("e", aside(3, "any", limits=limits(1.5, most), system=system))
    run = played(
        act(maneuver(keep), actors="Ego"),
        act(maneuver(jump, name="j"), actors="Other", name="jumps"),
        init=init,
        road=road,
        seconds=14,
    )
    y = run.y_m[:, run.names.tolist().index("Ego")]
    before = run.time_s < 5.0
    np.testing.assert_allclose(y[before], -2.0, atol=1e-9)
    across = np.diff(y) / STEP_S
    assert np.abs(np.diff(across)).max() <= 1.5 * STEP_S + 1e-6
    assert across.max() <= (most or math.sqrt(8 * 1.5)) + 1e-6
    assert y.max() <= 6.0 + 1.5 * STEP_S**2 / 8  # the last step of a braking is none of full braking
    assert y[-1] == pytest.approx(6.0, abs=1e-6)
    # half of the way at full acceleration, half at full braking; or with the greatest speed between
    needed = 2 * math.sqrt(8 / 1.5) if most is None else 8 / most + most / 1.5
    there = run.time_s[np.flatnonzero(y > 6.0 - 1e-3)[0]]
    assert there == pytest.approx(5 + needed, abs=0.1)


@pytest.mark.parametrize(("system", "road"), [("entity", None), ("lane", bend(1e9))])
def test_it_ends_at_the_distance_though_the_other_moves_away(played, system, road):
    """The other moves across at 2 m/s: once and for all 3 m to its right, then straight on."""
    init = private("Ego", teleport(world(0, 0)), speed(10)) + private(
        "Other", teleport(world(0, 10, math.pi / 2)), speed(2)
    )
    reach = event("e", aside(3, "any", continuous=False, limits=limits(4), system=system))
    done = (
        "<ByValueCondition><StoryboardElementStateCondition storyboardElementType='event' "
        "storyboardElementRef='e' state='endTransition'/></ByValueCondition>"
    )
    brake = event("after", speed(4), trigger(condition(done)))
    run = played(act(maneuver(reach, brake), actors="Ego"), init=init, seconds=12, road=road)
    ego = run.names.tolist().index("Ego")
    ended = np.flatnonzero(run.speed_mps[:, ego] == 4.0)[0]
    assert run.time_s[ended] < 8.0
    assert seen(run)[1][ended] == pytest.approx(3.0, abs=3 * 2 * STEP_S)
    np.testing.assert_allclose(np.diff(run.y_m[ended + 1 :, ego]), 0.0, atol=1e-7)


def test_one_that_turns_off_at_a_corner(played):
    """Along two lines, 5 m/s: across the ego's axis the other moves as its line says."""
    init = private("Ego", teleport(world(0, 4)), speed(5)) + private(
        "Other", teleport(world(0, 0)), speed(5), polyline([(0, 0), (10, 0), (40, 40)])
    )
    run = played(
        act(maneuver(event("e", aside(4, "leftToReferencedEntity", limits=limits(5)))), actors="Ego"),
        init=init,
        seconds=9,
    )
    y = run.y_m[:, run.names.tolist().index("Ego")]
    late = run.time_s > 6.0
    np.testing.assert_allclose(y[late], 4 + 0.8 * 5 * (run.time_s[late] - 2), atol=4 * 2 * STEP_S)
    np.testing.assert_allclose(run.yaw_rad[:, run.names.tolist().index("Ego")], 0.0, atol=1e-9)
