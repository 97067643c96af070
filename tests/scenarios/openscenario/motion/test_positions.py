"""Every kind of position, by hand, on the map of conftest.

Road A runs east from (0, 0) to (300, 0). Road B runs west from (700, 0) to (300, 0): its s falls where A's
goes on. Lanes are 3.5 m wide, so the middle of lane -1 of A (eastbound) lies at y = -1.75.
"""

from math import pi

import pytest

from scenarios.openscenario import ContentError, Engine, RunError, load
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


def place(write, position, ego=EGO_AT_START):
    engine = Engine(load(write(init=ego + private("Other", teleport(f"<Position>{position}</Position>")))))
    now = engine.entities
    return (*now.reference_m[1], now.boxes.yaw_rad[1])


ORIENTED = '<Orientation type="relative" h="0.5"/>'
ABSOLUTE = '<Orientation h="0.5"/>'


def route_of(*points):
    waypoints = "".join(f'<Waypoint routeStrategy="shortest">{point}</Waypoint>' for point in points)
    return f'<Route name="through" closed="false">{waypoints}</Route>'


THROUGH = route_of(lane_position(100), lane_position(50, lane=1, road_id="B"))  # 200 m on A, then 350 m on B


def on_route(inner, orientation=""):
    return (
        f"<RoutePosition><RouteRef>{THROUGH}</RouteRef><InRoutePosition>{inner}</InRoutePosition>"
        f"{orientation}</RoutePosition>"
    )


LINE = (
    '<TrajectoryRef><Trajectory name="line" closed="false"><Shape><Polyline>'
    '<Vertex><Position><WorldPosition x="0" y="10"/></Position></Vertex>'
    '<Vertex><Position><WorldPosition x="0" y="110"/></Position></Vertex>'
    "</Polyline></Shape></Trajectory></TrajectoryRef>"
)


@pytest.mark.parametrize(
    ("position", "expected"),
    [
        ('<WorldPosition x="12" y="34" h="1"/>', (12, 34, 1)),
        ('<LanePosition roadId="A" laneId="-1" s="50"/>', (50, -1.75, 0)),
        ('<LanePosition roadId="A" laneId="-2" s="50" offset="1"/>', (50, -4.25, 0)),
        ('<LanePosition roadId="A" laneId="1" s="50"/>', (50, 1.75, pi)),  # with the traffic of the lane
        (f'<LanePosition roadId="A" laneId="1" s="50">{ORIENTED}</LanePosition>', (50, 1.75, pi + 0.5)),
        (f'<LanePosition roadId="A" laneId="1" s="50">{ABSOLUTE}</LanePosition>', (50, 1.75, 0.5)),
        ('<RoadPosition roadId="B" s="100" t="2"/>', (600, -2, pi)),
        (f'<RoadPosition roadId="A" s="100" t="2">{ORIENTED}</RoadPosition>', (100, 2, 0.5)),
        ('<RelativeObjectPosition entityRef="Ego" dx="5" dy="-2"/>', (15, -3.75, 0)),
        (f'<RelativeObjectPosition entityRef="Ego" dx="5" '
        f'dy="0">{ORIENTED}</RelativeObjectPosition>', (15, -1.75, 0.5)),
        ('<RelativeWorldPosition entityRef="Ego" dx="5" dy="-2"/>', (15, -3.75, 0)),
        ('<RelativeLanePosition entityRef="Ego" dLane="0" ds="20" offset="0.5"/>', (30, -1.25, 0)),
        ('<RelativeLanePosition entityRef="Ego" dLane="-1" ds="20"/>', (30, -5.25, 0)),
        ('<RelativeLanePosition entityRef="Ego" dLane="1" '
        'ds="20"/>', (30, 1.75, pi)),  # lane 0 does not count
        ('<RelativeLanePosition entityRef="Ego" dLane="-1" dsLane="20"/>', (30, -5.25, 0)),
        ('<RelativeRoadPosition entityRef="Ego" ds="40" dt="1"/>', (50, -0.75, 0)),
        (f'<RelativeRoadPosition entityRef="Ego" ds="40" '
        f'dt="1">{ABSOLUTE}</RelativeRoadPosition>', (50, -0.75, 0.5)),
        (on_route('<FromLaneCoordinates pathS="30" laneId="-1"/>'), (130, -1.75, 0)),
        (on_route('<FromRoadCoordinates pathS="30" t="1"/>'), (130, 1, 0)),
        # beyond x = 300 the route runs against s of road B: lanes, t and heading follow the route
        (on_route('<FromLaneCoordinates pathS="230" laneId="-1" laneOffset="0.5"/>'), (330, -1.25, 0)),
        (on_route('<FromLaneCoordinates pathS="230" laneId="-2"/>', ORIENTED), (330, -5.25, 0.5)),
        (on_route('<FromRoadCoordinates pathS="230" t="1"/>'), (330, 1, 0)),
        (f'<TrajectoryPosition s="40" t="3">{LINE}</TrajectoryPosition>', (-3, 50, pi / 2)),
    ],
)  # fmt: skip
def test_position(write, position, expected):
    x, y, yaw = place(write, position)
    assert (x, y) == pytest.approx(expected[:2], abs=1e-9)
    assert (yaw - expected[2] + pi) % (2 * pi) - pi == pytest.approx(0.0, abs=1e-9)


def test_relative_positions_turn_with_the_entity(write):
    """An ego that faces west has its left to the south, and lanes ahead of it at smaller s."""
    ego = private("Ego", teleport(lane_position(100, lane=1)), speed(5))
    assert place(write, '<RelativeObjectPosition entityRef="Ego" dx="5" dy="1"/>', ego) == pytest.approx(
        (95, 0.75, pi)
    )
    assert place(write, '<RelativeWorldPosition entityRef="Ego" dx="5" dy="1"/>', ego) == pytest.approx(
        (105, 2.75, pi)
    )
    # one lane to the left of lane 1 seen westwards is lane -1, of which the traffic runs east
    x, y, yaw = place(write, '<RelativeLanePosition entityRef="Ego" dLane="1" ds="20"/>', ego)
    assert (x, y) == pytest.approx((80, -1.75))
    assert yaw == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(("turn", "yaw"), [(0.0, 0.0), (pi, pi)])
def test_beside_who_drives_against_the_traffic_the_heading_is_against_it(write, turn, yaw):
    """Lane -1 runs east: an ego that drives west in it has lane -2 to its right, 20 m ahead at s = 80."""
    turned = f'<Orientation type="relative" h="{turn}"/>'
    ego = private("Ego", teleport(lane_position(100, inner=turned)), speed(5))
    sign = -1 if turn else 1
    x, y, heading = place(write, f'<RelativeLanePosition entityRef="Ego" dLane="{-sign}" ds="20"/>', ego)
    assert (x, y) == pytest.approx((100 + 20 * sign, -5.25))
    assert abs((heading - yaw + pi) % (2 * pi) - pi) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("lane", "offset", "y"),
    [
        # beyond x = 300 the route runs against s of B, whose lane 1 is driven along it: both ids mean it
        (-1, 0.5, -1.25),
        (1, 0.5, -2.25),
        # of lane 2 and -2 the same holds
        (2, 0.0, -5.25),
    ],
)
def test_lanes_of_a_route_as_the_road_counts_them(write, lane, offset, y):
    inner = f'<FromLaneCoordinates pathS="230" laneId="{lane}" laneOffset="{offset}"/>'
    assert place(write, on_route(inner)) == pytest.approx((330, y, 0), abs=1e-9)


def test_refused(write):
    with pytest.raises(RunError, match="pathS = 551 m lies 1 m beyond the end of route 'through'"):
        place(write, on_route('<FromRoadCoordinates pathS="551" t="0"/>'))
    ego = private("Ego", teleport('<Position><WorldPosition x="0" y="99"/></Position>'), speed(1))
    with pytest.raises(RunError, match="'Ego' is not on a road"):
        place(write, '<RelativeRoadPosition entityRef="Ego" ds="1" dt="1"/>', ego)
    with pytest.raises(RunError, match="refers to 'Other' before that has one"):
        place(write, '<RelativeObjectPosition entityRef="Other" dx="1" dy="1"/>')
    with pytest.raises(ContentError, match="either 'ds' or 'dsLane'"):
        place(write, '<RelativeLanePosition entityRef="Ego" dLane="0" ds="1" dsLane="1"/>')


def test_lanes_go_on_where_the_road_ends(play):
    """Without a route an entity follows its lane from A into B, and straight on beyond the end of B."""
    init = private("Ego", teleport(lane_position(250)), speed(50)) + private(
        "Other", teleport(lane_position(60))
    )
    _, run = play(init=init)
    assert at(run, "Ego", 4.0) == pytest.approx((450, -1.75, 0, 50))
    assert at(run, "Ego", 10.0) == pytest.approx((750, -1.75, 0, 50))


def test_assigned_route(play):
    """Offset and speed stay; the route leads on from A to B."""
    assign = (
        f"<PrivateAction><RoutingAction><AssignRouteAction>{THROUGH}</AssignRouteAction>"
        f"</RoutingAction></PrivateAction>"
    )
    init = private("Ego", teleport(lane_position(120, offset=0.25)), speed(30), assign) + private(
        "Other", teleport(lane_position(60))
    )
    _, run = play(init=init)
    assert at(run, "Ego", 0.0) == pytest.approx((120, -1.5, 0, 30))
    assert at(run, "Ego", 10.0) == pytest.approx((420, -1.5, 0, 30))


def test_an_entity_off_its_route_is_refused(write):
    assign = (
        f"<PrivateAction><RoutingAction><AssignRouteAction>{THROUGH}</AssignRouteAction>"
        f"</RoutingAction></PrivateAction>"
    )
    other = private("Other", teleport(lane_position(60)))
    init = private("Ego", teleport(lane_position(50, lane=1)), assign) + other
    engine = Engine(load(write(init=init)))
    assert any("'Ego' stands where no lane leads to route 'through'" in note for note in engine.notes)
    init = private("Ego", teleport(lane_position(50, lane=1)), speed(5), assign) + other
    with pytest.raises(RunError, match="'Ego' is not on route 'through'"):
        Engine(load(write(init=init)))


def test_a_route_that_begins_ahead_and_a_position_to_acquire(play):
    """Along the lane to where the route begins, and along the route; a position gives the same way."""
    acquire = "<AcquirePositionAction>" + lane_position(50, lane=1, road_id="B") + "</AcquirePositionAction>"
    for routing in (f"<AssignRouteAction>{THROUGH}</AssignRouteAction>", acquire):
        action = f"<PrivateAction><RoutingAction>{routing}</RoutingAction></PrivateAction>"
        init = private("Ego", teleport(lane_position(50, offset=0.25)), speed(30), action)
        _, run = play(init=init + private("Other", teleport(lane_position(60))))
        assert at(run, "Ego", 1.0) == pytest.approx((80, -1.5, 0, 30))
        assert at(run, "Ego", 10.0) == pytest.approx((350, -1.5, 0, 30))


def test_an_entity_against_the_traffic_keeps_its_heading(play):
    against = '<Orientation type="relative" h="3.141592653589793"/>'
    init = EGO_AT_START + private("Other", teleport(lane_position(200, offset=0.5, inner=against)), speed(10))
    _, run = play(init=init)
    assert at(run, "Other", 5.0)[:2] == pytest.approx((150, -1.25))
    assert abs(at(run, "Other", 5.0)[2]) == pytest.approx(pi)


def test_reverse(play):
    init = private("Ego", teleport(lane_position(100)), speed(-2)) + private(
        "Other", teleport(lane_position(60))
    )
    _, run = play(init=init)
    assert at(run, "Ego", 5.0) == pytest.approx((90, -1.75, 0, -2))


def from_4_s(write, action, **parts):
    """A run in which Other, beside the road at first, does something at 4 s, when Ego is at s = 50."""
    init = EGO_AT_START + private("Other", teleport(lane_position(30, lane=-2)), speed(5))
    start = trigger(condition(at_time(4)))
    return Engine(load(write(act(maneuver(event("e", action, start))), init=init, **parts))).run()


def along(curve):
    return (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TimeReference><None/></TimeReference>"
        '<TrajectoryFollowingMode followingMode="position"/><TrajectoryRef><Trajectory name="t" '
        f'closed="false"><Shape>{curve}</Shape></Trajectory></TrajectoryRef></FollowTrajectoryAction>'
        "</RoutingAction></PrivateAction>"
    )


def ahead_of_ego(*metres):
    return [
        f'<Position><RelativeObjectPosition entityRef="Ego" dx="{m}" dy="-3.5"/></Position>' for m in metres
    ]


POLYLINE = "<Polyline>" + "".join(f"<Vertex>{p}</Vertex>" for p in ahead_of_ego(10, 100)) + "</Polyline>"
SPLINE = (
    '<ClothoidSpline><ClothoidSplineSegment curvatureStart="0" curvatureEnd="0" length="90">'
    f"<PositionStart>{ahead_of_ego(10)[0][10:-11]}</PositionStart></ClothoidSplineSegment></ClothoidSpline>"
)
NURBS = (
    '<Nurbs order="2">'
    + "".join(f"<ControlPoint>{p}</ControlPoint>" for p in ahead_of_ego(10, 55, 100))
    + "".join(f'<Knot value="{k}"/>' for k in (0, 0, 1, 2, 2))
    + "</Nurbs>"
)


@pytest.mark.parametrize("curve", [POLYLINE, SPLINE, NURBS])
def test_a_curve_relative_to_an_entity_begins_where_that_is_when_it_starts(write, curve):
    """At 4 s Ego is at s = 50, the beginning is at x = 60, and 2 s later Other has gone 10 m."""
    run = from_4_s(write, along(curve))
    assert at(run, "Other", 3.99)[0] == pytest.approx(30 + 19.95)
    assert at(run, "Other", 6)[:2] == pytest.approx((70, -5.25), abs=1e-6)


def test_the_same_curve_is_another_one_later(write):
    """A second event follows the same trajectory, of which nothing is kept, at 8 s: Ego is at s = 90."""
    line = along(POLYLINE)
    init = EGO_AT_START + private("Other", teleport(lane_position(30, lane=-2)), speed(5))
    events = [event(f"e{t}", line, trigger(condition(at_time(t)))) for t in (4, 8)]
    run = Engine(load(write(act(maneuver(*events)), init=init))).run()
    assert at(run, "Other", 7.99)[0] == pytest.approx(60 + 5 * 3.99)
    assert at(run, "Other", 9)[0] == pytest.approx(100 + 5)


def test_a_route_relative_to_an_entity_is_that_of_its_start(write):
    """From 40 m behind Ego to 50 m beyond: at t = 0 that begins before the road."""
    points = "".join(
        f'<Waypoint routeStrategy="shortest"><Position><RelativeLanePosition entityRef="Ego" dLane="-1" '
        f'ds="{ds}"/></Position></Waypoint>'
        for ds in (-40, 50)
    )
    route = f'<Route name="r" closed="false">{points}</Route>'
    assign = f"<RoutingAction><AssignRouteAction>{route}</AssignRouteAction></RoutingAction>"
    run = from_4_s(write, f"<PrivateAction>{assign}</PrivateAction>")
    assert at(run, "Other", 8)[:2] == pytest.approx((70, -5.25), abs=1e-6)
    place = f"<RoutePosition><RouteRef>{route}</RouteRef><InRoutePosition>"
    place += '<FromLaneCoordinates pathS="60" laneId="-2"/></InRoutePosition></RoutePosition>'
    run = from_4_s(write, teleport(f"<Position>{place}</Position>"))
    assert at(run, "Other", 6)[:2] == pytest.approx((10 + 60 + 10, -5.25), abs=1e-6)


def test_a_place_on_a_trajectory_relative_to_an_entity(write):
    shape = f'<Trajectory name="t" closed="false"><Shape>{POLYLINE}</Shape></Trajectory>'
    place = f'<TrajectoryPosition s="20"><TrajectoryRef>{shape}</TrajectoryRef></TrajectoryPosition>'
    run = from_4_s(write, teleport(f"<Position>{place}</Position>"))
    assert at(run, "Other", 6)[:2] == pytest.approx((50 + 10 + 20 + 10, -5.25), abs=1e-6)


def test_what_is_on_the_road_only_later_is_not_refused(write):
    """60 m behind Ego there is no road before 5 s; at 9 s Other is put there."""
    position = '<Position><RelativeRoadPosition entityRef="Ego" ds="-60" dt="-3.5"/></Position>'
    init = EGO_AT_START + private("Other", teleport(lane_position(30, lane=-2)), speed(5))
    start = trigger(condition(at_time(9)))
    run = Engine(load(write(act(maneuver(event("e", teleport(position), start))), init=init))).run()
    assert at(run, "Other", 9.5)[0] == pytest.approx(40 + 2.5)
