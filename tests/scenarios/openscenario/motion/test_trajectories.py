import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.openscenario import ContentError, Engine, RunError, UnsupportedError, load
from scenarios.openscenario.motion.paths import Path
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

NO_TIME = "<TimeReference><None/></TimeReference>"


def follow(shape, time=NO_TIME, offset="", mode="position"):
    return (
        f"<PrivateAction><RoutingAction><FollowTrajectoryAction{offset}>{time}"
        f'<TrajectoryFollowingMode followingMode="{mode}"/><TrajectoryRef>'
        f'<Trajectory name="curve" closed="false"><Shape>{shape}</Shape></Trajectory></TrajectoryRef>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )


def world(x, y):
    return f'<Position><WorldPosition x="{x}" y="{y}"/></Position>'


def polyline(*points, times=()):
    marks = [f' time="{t}"' for t in times] or [""] * len(points)
    vertices = "".join(f"<Vertex{mark}>{world(*p)}</Vertex>" for p, mark in zip(points, marks, strict=True))
    return f"<Polyline>{vertices}</Polyline>"


def other(play, *actions, **parts):
    return play(init=EGO_AT_START + private("Other", *actions), **parts)[1]


def test_polyline(play):
    corner = polyline((0, 20), (30, 20), (30, 60))
    run = other(play, follow(corner), speed(10))
    assert at(run, "Other", 0.0) == pytest.approx((0, 20, 0, 10))
    assert at(run, "Other", 2.0) == pytest.approx((20, 20, 0, 10))
    assert at(run, "Other", 5.0) == pytest.approx((30, 40, math.pi / 2, 10))
    assert at(run, "Other", 9.0) == pytest.approx((30, 80, math.pi / 2, 10))  # straight on after its end
    run = other(play, follow(corner, offset=' initialDistanceOffset="30"'), speed(10))
    assert at(run, "Other", 1.0) == pytest.approx((30, 30, math.pi / 2, 10))


def test_the_form_of_version_1_0(play):
    """The trajectory stands in the action itself."""
    new = follow(polyline((0, 20), (30, 20)))
    old = new.replace("<TrajectoryRef>", "").replace("</TrajectoryRef>", "")
    for action, minor in ((new, 3), (old, 0)):
        run = other(play, action, speed(10), minor=minor)
        assert at(run, "Other", 2.0) == pytest.approx((20, 20, 0, 10))


def test_reversing_along_a_trajectory(play):
    """It is followed from its start to its end, with the rear in front."""
    run = other(play, speed(-2), follow(polyline((100, 0), (0, 0)), mode="follow"))
    x, y, yaw, v = at(run, "Other", 5.0)
    assert (x, y, v) == pytest.approx((90, 0, -2))
    assert math.cos(yaw) == pytest.approx(1.0)


def test_times(play):
    """By vertex times the speed is constant between vertices; a later start is waited for."""
    shape = polyline((0, 20), (30, 20), (30, 60), times=(0, 3, 5))
    timing = '<TimeReference><Timing domainAbsoluteRelative="{}" scale="{}" offset="{}"/></TimeReference>'
    run = other(play, follow(shape, timing.format("absolute", 1, 2)))
    assert at(run, "Other", 1.0) == pytest.approx((0, 20, 0, 0))
    assert at(run, "Other", 3.5) == pytest.approx((15, 20, 0, 10))
    assert at(run, "Other", 6.0) == pytest.approx((30, 40, math.pi / 2, 20))
    run = other(play, follow(shape, timing.format("relative", 2, 0)))
    assert at(run, "Other", 3.0) == pytest.approx((15, 20, 0, 5))
    run = other(play, follow(shape, timing.format("absolute", 1, -1)))  # already under way
    assert at(run, "Other", 0.0) == pytest.approx((10, 20, 0, 10))
    with pytest.raises(RunError, match="growing times throughout"):
        other(play, follow(polyline((0, 0), (1, 0), times=(1, 1)), timing.format("absolute", 1, 0)))
    some = polyline((0, 0), (1, 0), times=(1, 2)).replace(' time="2"', "")
    with pytest.raises(RunError, match="growing times throughout"):
        other(play, follow(some, timing.format("absolute", 1, 0)))


def test_times_that_no_vertex_has(play):
    """The entity's own speed counts, as in esmini."""
    timing = '<TimeReference><Timing domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference>'
    for shape in (polyline((0, 20), (90, 20)), polyline((0, 20), (90, 20)).replace("y=", 'h="1" y=')):
        run = other(play, follow(shape, timing), speed(10))
        assert at(run, "Other", 2.0) == pytest.approx((20, 20, 0, 10))


@pytest.mark.parametrize(("scale", "wait"), [(1, 0), (2, 1)])
def test_times_of_who_begins_along_the_way(play, scale, wait):
    """From 15 m on, where half of the first three seconds would be gone: there at once, on after the wait."""
    shape = polyline((0, 20), (30, 20), (30, 60), times=(0, 3, 5))
    timing = (
        f'<TimeReference><Timing domainAbsoluteRelative="relative" scale="{scale}" offset="{wait}"/>'
        "</TimeReference>"
    )
    run = other(play, follow(shape, timing, offset=' initialDistanceOffset="15"'))
    assert at(run, "Other", 0.0)[:2] == pytest.approx((15, 20))
    assert at(run, "Other", wait + 0.9 * scale)[:2] == pytest.approx((24, 20))
    assert at(run, "Other", wait + 2.0 * scale) == pytest.approx((30, 30, math.pi / 2, 20 / scale))


def headed(*rows):
    """A polyline with times, and headings where they are given."""
    text = "".join(
        f'<Vertex time="{t}"><Position><WorldPosition x="{x}" y="{y}"'
        + ("" if h is None else f' h="{h}"')
        + "/></Position></Vertex>"
        for t, x, y, h in rows
    )
    return f"<Polyline>{text}</Polyline>"


BY_TIME = '<TimeReference><Timing domainAbsoluteRelative="absolute" scale="1" offset="0"/></TimeReference>'
WAITS = ((0, 0, 20, 0.2), (2, 20, 20, 0.4), (5, 20, 20, 0.5), (6, 20, 24, 1.0))


def test_headings_of_vertices_hold_if_all_have_one_and_times_are_kept(play):
    """10 m/s sideways for 2 s, 3 s of standstill, then 4 m to the left within a second."""
    run = other(play, follow(headed(*WAITS), BY_TIME))
    assert at(run, "Other", 1.0) == pytest.approx(
        (10, 20, 0.35, 10)
    )  # towards the heading that it stands with
    assert at(run, "Other", 3.5) == pytest.approx((20, 20, 0.5, 0))
    assert at(run, "Other", 5.5) == pytest.approx((20, 22, 0.75, 4))


def test_headings_that_point_backwards_are_those_of_who_drives_in_reverse(play):
    """20 m back along lane -1 in 2 s, a stop of 1 s, 10 m ahead in 1 s; then on at 10 m/s."""
    rows = ((0, 40, -1.75, 0), (2, 20, -1.75, 0), (3, 20, -1.75, 0), (4, 30, -1.75, 0))
    run = other(play, follow(headed(*rows), BY_TIME))
    assert at(run, "Other", 0.0) == pytest.approx((40, -1.75, 0, -10))
    assert at(run, "Other", 1.0) == pytest.approx((30, -1.75, 0, -10))
    assert at(run, "Other", 2.5) == pytest.approx((20, -1.75, 0, 0))
    assert at(run, "Other", 3.5) == pytest.approx((25, -1.75, 0, 10))
    assert at(run, "Other", 6.0) == pytest.approx((50, -1.75, 0, 10))


def test_after_a_way_in_reverse_it_goes_on_in_reverse(play):
    """Along the lane behind it, and stopped in the middle of it likewise."""
    back = follow(headed((0, 90, -1.75, 0), (4, 50, -1.75, 0)), BY_TIME)
    run = other(play, back)
    assert at(run, "Other", 5.0) == pytest.approx((40, -1.75, 0, -10))
    stop = trigger(condition(at_time(1)), kind="StopTrigger")
    run = play(act(maneuver(event("e", back)), stop=stop))[1]
    assert at(run, "Other", 1.0)[0] == pytest.approx(80)
    assert at(run, "Other", 3.0) == pytest.approx((60, -1.75, 0, -10))
    with pytest.raises(RunError, match="cannot steer to it in reverse"):
        other(
            play,
            teleport(lane_position(90, lane=-2)),
            follow(headed((0, 90, -1.75, 0), (4, 50, -1.75, 0)), BY_TIME, mode="follow"),
        )


def test_a_closed_way_in_reverse_stays_one(play):
    """A square of 20 m, seen to the west on its eastward side: in reverse there, ahead to the west."""
    corners = ((0, 0, 20), (2, 20, 20), (4, 20, 40), (6, 0, 40), (8, 0, 20))
    shape = follow(headed(*((t, x, y, math.pi) for t, x, y in corners)), BY_TIME)
    run = other(play, shape.replace('closed="false"', 'closed="true"'))
    for start in (0.0, 8.0):
        assert at(run, "Other", start + 1.0) == pytest.approx((10, 20, math.pi, -10))
    assert at(run, "Other", 5.0) == pytest.approx((10, 40, math.pi, 10))


def test_headings_do_not_hold_otherwise(play):
    some = (*WAITS[:2], (6, 20, 24, None))
    run = other(play, follow(headed(*some), BY_TIME))
    assert at(run, "Other", 1.0)[2] == 0.0
    run = other(play, follow(headed(*WAITS[:2])), speed(5))
    assert at(run, "Other", 1.0) == pytest.approx((5, 20, 0, 5))
    run = other(play, follow(headed(*WAITS)), speed(5))  # without times nobody waits
    assert at(run, "Other", 3.0) == pytest.approx((15, 20, 0, 5))
    with pytest.raises(RunError, match="all its vertices are at the same place"):
        other(play, follow(headed(*WAITS[1:3]), BY_TIME))


def piece(length, start, end, position=""):
    inner = f"<PositionStart>{position}</PositionStart>" if position else ""
    return (
        f'<ClothoidSplineSegment length="{length}" curvatureStart="{start}" '
        f'curvatureEnd="{end}">{inner}</ClothoidSplineSegment>'
    )


START = '<WorldPosition x="0" y="20" h="0"/>'


def test_arc(play):
    """A quarter of a circle of 10 m radius to the left ends at (10, 30), heading north."""
    quarter = 5 * math.pi
    shape = f"<ClothoidSpline>{piece(quarter, 0.1, 0.1, START)}{piece(20, 0, 0)}</ClothoidSpline>"
    run = other(play, follow(shape), speed(quarter / 2))
    assert at(run, "Other", 2.0) == pytest.approx((10, 30, math.pi / 2, quarter / 2), abs=1e-4)
    assert at(run, "Other", 3.0) == pytest.approx((10, 30 + quarter / 2, math.pi / 2, quarter / 2), abs=1e-4)
    x, y, yaw, _ = at(run, "Other", 1.0)
    assert (x, y) == pytest.approx((10 * math.sin(math.pi / 4), 30 - 10 * math.cos(math.pi / 4)), abs=1e-4)
    assert yaw == pytest.approx(math.pi / 4, abs=1e-6)


def test_clothoid_turns_by_the_mean_curvature(play):
    spline = f"<ClothoidSpline>{piece(20, 0, 0.1, START)}</ClothoidSpline>"
    single = (
        f'<Clothoid curvature="0" curvaturePrime="0.005" length="20"><Position>{START}</Position></Clothoid>'
    )
    for shape in (spline, single):
        run = other(play, follow(shape), speed(10))
        x, y, yaw, _ = at(run, "Other", 2.0)
        s = np.linspace(0.0, 20.0, 200_001)
        heading = 0.0025 * s**2
        assert yaw == pytest.approx(1.0, abs=1e-6)
        assert (x, y) == pytest.approx(
            (np.trapezoid(np.cos(heading), s), 20 + np.trapezoid(np.sin(heading), s)), abs=1e-4
        )


def test_a_spline_without_start_begins_at_the_entity(play):
    shape = f"<ClothoidSpline>{piece(10, 0, 0)}</ClothoidSpline>"
    run = other(play, teleport(lane_position(60)), follow(shape), speed(5))
    assert at(run, "Other", 1.0) == pytest.approx((65, -1.75, 0, 5))
    with pytest.raises(RunError, match="refers to 'Other' before"):
        other(play, follow(shape))


def test_nurbs_draws_a_circle(play):
    """The rational quadratic with weights 1, sqrt(1/2), 1 is a quarter of a circle."""
    weight = math.sqrt(0.5)
    points = "".join(
        f'<ControlPoint weight="{w}">{world(x, y)}</ControlPoint>'
        for x, y, w in ((10, 20, 1), (10, 30, weight), (0, 30, 1))
    )
    knots = "".join(f'<Knot value="{k}"/>' for k in (0, 0, 0, 1, 1, 1))
    run = other(play, follow(f'<Nurbs order="3">{points}{knots}</Nurbs>'), speed(2.5 * math.pi))
    column = run.names.tolist().index("Other")
    on_curve = run.time_s <= 2.0
    radius = np.hypot(run.x_m[on_curve, column], run.y_m[on_curve, column] - 20)
    np.testing.assert_allclose(radius, 10.0, atol=1e-4)
    assert at(run, "Other", 1.0)[:3] == pytest.approx(
        (10 * weight, 20 + 10 * weight, 0.75 * math.pi), abs=1e-3
    )


@pytest.mark.parametrize(
    ("shape", "error", "text"),
    [
        (polyline((0, 0)), ContentError, "at least two vertices"),
        (polyline((0, 0), (0, 0)), RunError, "'curve': all its vertices are at the same place"),
        ("<ClothoidSpline/>", ContentError, "at least one ClothoidSplineSegment"),
        (
            f"<ClothoidSpline>{piece(0, 0, 0, START)}</ClothoidSpline>",
            ContentError,
            "length: expected a positive",
        ),
        (
            f"<ClothoidSpline>{piece(5, 0, 0, START)}{piece(5, 0, 0, START)}</ClothoidSpline>",
            RunError,
            "piece 2 does not start where",
        ),
        ('<Nurbs order="2"/>', ContentError, "needs order >= 2 and 2 to"),
        (
            f'<Nurbs order="2"><ControlPoint>{world(0, 0)}</ControlPoint>'
            f"<ControlPoint>{world(1, 0)}</ControlPoint>"
            '<Knot value="0"/></Nurbs>',
            ContentError,
            "needs 4 Knots, got 1",
        ),
        (f"<ClothoidSpline>{piece(50, 0, 1e4, START)}</ClothoidSpline>", RunError, "turns by 5e.05 rad"),
        ("<Circle/>", UnsupportedError, "<Circle> in <Shape> is not supported"),
    ],
)
def test_refused(write, shape, error, text):
    with pytest.raises(error, match=text):
        Engine(load(write(init=EGO_AT_START + private("Other", follow(shape)))))


def test_too_far_along_and_closed(write):
    long = follow(polyline((0, 0), (5, 0)), offset=' initialDistanceOffset="6"')
    with pytest.raises(RunError, match="initialDistanceOffset 6 m is more than its length of 5 m"):
        Engine(load(write(init=EGO_AT_START + private("Other", long))))


def nurbs(order, knots, *points, closed="false"):
    """Control points as x, y, weight and time."""
    inner = "".join(
        f'<ControlPoint weight="{w}" time="{t}">{world(x, y)}</ControlPoint>' for x, y, w, t in points
    )
    inner += "".join(f'<Knot value="{k}"/>' for k in knots)
    return follow(f'<Nurbs order="{order}">{inner}</Nurbs>', BY_TIME).replace('"false"', f'"{closed}"')


def test_the_time_of_nurbs_is_a_dimension_of_the_curve(play):
    """x(u) = 40 u^2 and t(u) = 4 u: x = 2.5 t^2, a constant acceleration of 5 m/s2."""
    knots = (0, 0, 0, 1, 1, 1)
    run = other(play, nurbs(3, knots, (0, 20, 1, 0), (0, 20, 1, 2), (40, 20, 1, 4)))
    for t in (0.5, 1.0, 2.5, 4.0):
        assert at(run, "Other", t)[:2] == pytest.approx((2.5 * t**2, 20), abs=0.004), t
    # for 0.05 s at a time it goes on with the mean speed there
    assert at(run, "Other", 2.52)[3] == pytest.approx(5 * 2.525, abs=1e-3)


def test_weights_draw_the_times_too(play):
    """A quarter of a circle: in its middle both coordinates are 10 sqrt(1/2), half of the time has gone."""
    w, knots = math.sqrt(0.5), (0, 0, 0, 1, 1, 1)
    run = other(play, nurbs(3, knots, (10, 20, 1, 0), (10, 30, w, 2), (0, 30, 1, 4)))
    assert at(run, "Other", 2.0)[:2] == pytest.approx((10 * w, 20 + 10 * w), abs=0.005)
    assert at(run, "Other", 4.0)[:2] == pytest.approx((0, 30), abs=1e-6)


def test_times_of_nurbs_are_for_all_points_and_grow(write):
    knots = (0, 0, 1, 1)
    falling = nurbs(2, knots, (0, 0, 1, 3), (9, 0, 1, 2))
    with pytest.raises(RunError, match="'curve': its times do not grow all along the curve"):
        Engine(load(write(init=EGO_AT_START + private("Other", falling))))
    some = nurbs(2, knots, (0, 0, 1, 3), (9, 0, 1, 2)).replace(' time="3"', "")
    with pytest.raises(ContentError, match="needs a time at every ControlPoint, or at none"):
        load(write(init=EGO_AT_START + private("Other", some)))


def test_a_closed_trajectory_with_times_is_followed_again_and_again(play):
    """A square of 10 m, its sides in 1, 2, 1 and 4 s: a round takes 8 s."""
    corners = ((0, 20), (10, 20), (10, 30), (0, 30), (0, 20))
    square = follow(polyline(*corners, times=(0, 1, 3, 4, 8)), BY_TIME)
    run = other(play, square.replace('closed="false"', 'closed="true"'))
    for t, x, y in ((0.5, 5, 20), (2, 10, 25), (6, 0, 25), (8.5, 5, 20), (10, 10, 25)):
        assert at(run, "Other", t)[:2] == pytest.approx((x, y), abs=1e-6), t


def test_one_whose_way_back_has_no_time_is_followed_once_and_that_is_noted(play):
    line = follow(polyline((0, 20), (10, 20), times=(0, 2)), BY_TIME)
    init = EGO_AT_START + private("Other", line.replace('closed="false"', 'closed="true"'))
    engine, run = play(init=init)
    assert at(run, "Other", 3.0)[:2] == pytest.approx((15, 20))
    assert [note for note in engine.notes if "no time for the way from its end to its start" in note]


def test_a_closed_polyline_is_followed_round_and_round(play):
    """A square of 10 m at 5 m/s, begun in its first corner: after 9 s 5 m into the second lap."""
    square = follow(polyline((0, 20), (10, 20), (10, 30), (0, 30))).replace('closed="false"', 'closed="true"')
    run = other(play, square, speed(5))
    assert at(run, "Other", 1.0)[:2] == pytest.approx((5, 20))
    assert at(run, "Other", 7.0)[:2] == pytest.approx((0, 25))
    assert at(run, "Other", 9.0)[:2] == pytest.approx((5, 20))


def test_teleport_along_and_off_a_trajectory(play):
    line = follow(polyline((0, 20), (100, 20)))
    run = other(play, line, teleport(world(40, 20)), speed(5))
    assert at(run, "Other", 2.0) == pytest.approx((50, 20, 0, 5))
    with pytest.raises(RunError, match="teleported off the trajectory"):
        other(play, line, teleport(world(40, 22)))


def test_projection_is_the_inverse_of_the_pose():
    s = np.linspace(0.0, 3.0, 400)
    path = Path(10 * np.cos(s), 10 * np.sin(s), s + np.pi / 2)
    for station in (-5.0, 0.0, 7.3, 20.0, path.length_m, path.length_m + 4.0):
        x, y, yaw = path.pose(station)
        found, left = path.project(x - 0.5 * math.sin(yaw), y + 0.5 * math.cos(yaw))
        assert (found, left) == pytest.approx((station, 0.5), abs=0.02)


def test_projection_on_a_long_curve_is_that_of_all_its_chords():
    s = np.linspace(0.0, 40.0, 3000)
    path = Path(300 * np.sin(0.3 * s), 40 * s, None)
    chords = np.arange(len(s) - 1)
    places = [
        (0.0, -30.0),
        (250.0, 800.0),
        (-400.0, 100.0),
        (10.0, 1700.0),
        *path.points_m[100::700].tolist(),
    ]
    got = [path.project(x, y) for x, y in places]
    assert got == [path._project(x, y, chords) for x, y in places]


@given(st.floats(-3.0, 45.0), st.floats(-8.0, 8.0), st.floats(-12.0, 12.0))
def test_projection_from_near_by_on_a_bend_is_the_inverse_of_the_pose(station, left, away):
    """Up to 8 m beside a bend of 15 m radius, from up to 12 m further on or back."""
    s = np.linspace(0.0, 3.0, 901)
    path = Path(15 * np.cos(s), 15 * np.sin(s), s + np.pi / 2)
    x, y, yaw = path.pose(station)
    got = path.project_from(x - left * math.sin(yaw), y + left * math.cos(yaw), station + away)
    # a chord of 0.05 m turns by 3.3 mrad, which at 8 m is 27 mm
    assert got == pytest.approx((station, left), abs=0.03)


@pytest.mark.parametrize("mode", ["position", "follow"])
def test_after_a_trajectory_the_entity_follows_its_lane(play, mode):
    """It ends in lane -1 of A at s = 200, 0.5 m to the left of its middle, 10 degrees off its direction."""
    start = (200 - 50 * math.cos(0.17), -1.25 - 50 * math.sin(0.17))
    line = polyline(start, (200, -1.25))
    init = private("Ego", teleport(world(*start)), speed(10), follow(line, mode=mode))
    init += private("Other", teleport(lane_position(60)))
    run = play(init=init)[1]
    assert at(run, "Ego", 4.0)[1] < -1.5
    assert at(run, "Ego", 9.0)[:2] == pytest.approx((240, -1.25), abs=1e-6)
    assert math.sin(at(run, "Ego", 9.0)[2]) == pytest.approx(0.0, abs=1e-9)


def test_steering_to_a_trajectory_does_not_jump(play):
    """3 m to the left at 10 m/s: lateral acceleration 1 m/s2 takes 10 sqrt(18) = 42.4 m; half way 1.5 m."""
    line = polyline((-100, 1.25), (280, 1.25))
    init = EGO_AT_START + private("Ego", follow(line, mode="follow"))
    init += private("Other", teleport(lane_position(60, lane=-2)))
    engine, run = play(init=init)
    assert at(run, "Ego", 0.0)[:2] == pytest.approx((10, -1.75))
    within = 10 * math.sqrt(18)
    sideways = np.interp(10 + within / 2, run.x_m[:, 0], run.y_m[:, 0])
    assert sideways == pytest.approx(-0.25, abs=1e-3)
    assert np.abs(np.diff(run.y_m[:, 0], 2)).max() / 0.01**2 == pytest.approx(1.0, abs=0.1)
    assert at(run, "Ego", 6.0)[:2] == pytest.approx((70, 1.25), abs=0.05)
    assert engine.world.actors["Ego"].on_trajectory
    jumps = play(init=init.replace('"follow"', '"position"'))[1]
    assert at(jumps, "Ego", 0.0)[:2] == pytest.approx((-100, 1.25))


def test_steering_keeps_the_headings_of_the_lines_after_it(play):
    corner = polyline((0, -0.75), (100, -0.75), (100, 80))
    init = EGO_AT_START + private("Ego", follow(corner, mode="follow"))
    init += private("Other", teleport(lane_position(60, lane=-2)))
    run = play(init=init)[1]
    assert at(run, "Ego", 8.0)[2] == pytest.approx(0.0, abs=1e-6)
    assert at(run, "Ego", 9.9)[2] == pytest.approx(math.pi / 2, abs=1e-6)


def test_steering_by_times_meets_them(play):
    """10 m behind the first place, which it is to be at after 2 s: 5 m/s, then 20 m/s."""
    line = polyline((20, 1.25), (120, 1.25), times=(2, 7))
    timing = '<TimeReference><Timing domainAbsoluteRelative="absolute" scale="1" offset="0"/></TimeReference>'
    init = EGO_AT_START + private("Ego", follow(line, timing, mode="follow"))
    init += private("Other", teleport(lane_position(60, lane=-2)))
    run = play(init=init)[1]
    for t, x, v in ((0, 10, 5), (2, 20, 20), (4.5, 70, 20), (7, 120, 20)):
        assert at(run, "Ego", t)[0] == pytest.approx(x, abs=1e-6)
        assert at(run, "Ego", t)[3] == pytest.approx(v, abs=1e-6)


def test_no_room_to_steer_is_refused(write):
    line = polyline((0, 20), (12, 20))
    init = EGO_AT_START + private("Ego", follow(line, mode="follow"))
    init += private("Other", teleport(lane_position(60)))
    with pytest.raises(RunError, match=r"21\.8 m beside trajectory 'curve' and cannot steer"):
        Engine(load(write(init=init)))


def test_who_has_no_place_in_init_comes_with_its_trajectory(play):
    """At a speed that Init gives; before that it touches nobody and is not there."""
    line = follow(polyline((60, 20), (100, 20)))
    later = trigger(condition(at_time(2)))
    init = EGO_AT_START + private("Other", speed(4))
    engine, run = play(act(maneuver(event("e", line, later))), init=init)
    there = run.exists[:, run.names.tolist().index("Other")]
    assert run.time_s[there].min() == pytest.approx(2.0)
    assert at(run, "Other", 3.0) == pytest.approx((64, 20, 0, 4))
    assert [note for note in engine.notes if "'Other' has no position in Init: it comes with" in note]
