"""Routes that need lane changes: where they are driven, by the closed form of a cubic."""

import math

import numpy as np
import pytest

from scenarios.openscenario import RunError
from scenarios.openscenario.motion.route_changes import (
    LATERAL_MPS2,
    SHORTEST,
    RouteChange,
    length_of_change_m,
    with_room,
)
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

WIDTH_M = 3.5
DURATION_S = math.sqrt(6.0 * WIDTH_M / LATERAL_MPS2)


def route(*places: str) -> str:
    waypoints = "".join(f'<Waypoint routeStrategy="shortest">{place}</Waypoint>' for place in places)
    return (
        "<PrivateAction><RoutingAction><AssignRouteAction>"
        f'<Route name="r" closed="false">{waypoints}</Route>'
        "</AssignRouteAction></RoutingAction></PrivateAction>"
    )


def acquire(place: str) -> str:
    return (
        f"<PrivateAction><RoutingAction><AcquirePositionAction>{place}</AcquirePositionAction>"
        "</RoutingAction></PrivateAction>"
    )


def drives(lane: int, start_m: float, v: float, *routing: str, road: str = "A") -> str:
    ego = private("Ego", teleport(lane_position(start_m, lane, road_id=road)), speed(v), *routing)
    return ego + private("Other", teleport(lane_position(60, lane=1)))


@pytest.mark.parametrize("how", ["route", "acquire"])
@pytest.mark.parametrize(("lane", "goal", "sign"), [(-1, -2, -1), (-2, -1, 1)])
def test_a_change_begins_at_once_and_follows_a_cubic(play, how, lane, goal, sign):
    """Its acceleration across is 1 m/s2 at the ends; the way is 0.6 w^2 / L longer than straight on."""
    start, end = lane_position(20, lane), lane_position(290, goal)
    routing = route(start, end) if how == "route" else acquire(end)
    _, run = play(init=drives(lane, 20, 20, routing))
    length = 20 * DURATION_S
    more = 0.6 * WIDTH_M**2 / length
    y0 = (abs(lane) - 0.5) * -WIDTH_M
    x, y, yaw, v = at(run, "Ego", 10.0)
    assert (x, y, yaw, v) == pytest.approx((220 - more, y0 + sign * WIDTH_M, 0, 20), abs=2e-4)
    # in its middle: half the width across, with the slope 1.5 w / L
    t = round(DURATION_S / 2, 2)
    x, y, yaw, v = at(run, "Ego", t)
    slope = 1.5 * WIDTH_M / length
    assert (y - y0) * sign == pytest.approx(WIDTH_M / 2, abs=20 * 0.01 * slope)
    assert yaw * sign == pytest.approx(math.atan(slope), abs=1e-4)
    rows = run.time_s < DURATION_S - 0.2
    across = np.gradient(np.gradient(run.y_m[:, 0], 0.01), 0.01)[rows][3:]
    assert np.abs(across).max() == pytest.approx(LATERAL_MPS2, rel=0.02)


def test_a_change_on_the_road_behind(play):
    """Lane -1 of A leads into 1 of B, driven against s; the change is on A, where it is allowed first."""
    _, run = play(init=drives(-1, 250, 30, route(lane_position(250), lane_position(100, 2, road_id="B"))))
    y = at(run, "Ego", 9.0)[1]
    assert y == pytest.approx(-1.5 * WIDTH_M, abs=1e-6)
    assert abs(np.diff(run.y_m[:, 0])).max() < 0.03 * 1.2  # no jump: 30 m/s, slope under 0.12


def test_against_s(play):
    """On lanes that are driven against s left and right are those of the traveller."""
    start, end = lane_position(250, 1), lane_position(20, 2)
    _, run = play(init=drives(1, 250, 20, route(start, end)))
    x, y, yaw, _ = at(run, "Ego", 10.0)
    assert y == pytest.approx(1.5 * WIDTH_M, abs=1e-6)
    assert x == pytest.approx(50 + 0.6 * WIDTH_M**2 / (20 * DURATION_S), abs=2e-4)
    assert math.cos(yaw) == pytest.approx(-1)


def test_who_is_in_a_hurry_changes_within_what_is_left(play):
    """At 60 m/s a change takes 275 m; of the 100 m to the goal all are used."""
    _, run = play(init=drives(-1, 150, 60, route(lane_position(150), lane_position(250, -2))))
    assert at(run, "Ego", 0.83)[1] == pytest.approx(-WIDTH_M, abs=0.06)
    assert at(run, "Ego", 1.68)[1] == pytest.approx(-1.5 * WIDTH_M, abs=2e-3)


def test_a_route_without_changes_is_as_it_was(play):
    _, run = play(init=drives(-1, 20, 20, route(lane_position(20), lane_position(250))))
    assert np.abs(run.y_m[:, 0] + WIDTH_M / 2).max() < 1e-12


def test_how_long_a_change_is():
    assert length_of_change_m(3.5, 0.0) == math.inf
    assert length_of_change_m(-3.5, 20.0) == pytest.approx(20 * DURATION_S)
    # slower than this it would head more than 45 degrees off the lane: 1.5 w / L = 1
    assert length_of_change_m(3.5, 0.1) == pytest.approx(1.5 * 3.5)


def test_changes_share_the_room():
    changes = [RouteChange(10, 30, 3.5), RouteChange(30, 30, 3.5), RouteChange(80, 30, 3.5)]
    assert [c.half_m for c in with_room(changes, 100)] == [10, 10, 20]


def test_a_change_is_continuous_where_the_lane_below_is_another():
    change = RouteChange(50, 20, -3.0)
    way = np.array([30.0, 50.0, 50.0, 70.0])
    shift, slope = change.shift(way, np.array([False, False, True, True]))
    assert shift.tolist() == pytest.approx([0, -1.5, 1.5, 0])
    assert slope.tolist() == pytest.approx([0, -3 * 1.5 / 40, -3 * 1.5 / 40, 0])


@pytest.mark.parametrize("goal_s", [100.0, 100.1, 101.0, 105.2])
@pytest.mark.parametrize("how", ["route", "acquire"])
def test_no_room_for_a_change_is_said(play, goal_s, how):
    """By a cubic it would head more than 45 degrees off the lane."""
    end = lane_position(goal_s, -2)
    routing = route(lane_position(100), end) if how == "route" else acquire(end)
    with pytest.raises(RunError, match=r"left for a lane change of 3\.5 m; it takes 5\.25 m at least"):
        play(init=drives(-1, 100, 20, routing))


def test_the_least_room_is_taken(play):
    _, run = play(
        init=drives(-1, 100, 20, route(lane_position(100), lane_position(100 + SHORTEST * 3.5, -2)))
    )
    assert at(run, "Ego", 1.0)[1] == pytest.approx(-1.5 * WIDTH_M, abs=1e-6)
    assert np.abs(run.yaw_rad[:, 0]).max() < math.pi / 4 + 1e-6


@pytest.mark.parametrize("how", ["route", "acquire"])
def test_a_route_that_ends_where_it_begins_is_refused(play, how):
    place = lane_position(20)
    with pytest.raises(RunError, match="route: it ends where it begins"):
        play(init=drives(-1, 20, 20, route(place, place) if how == "route" else acquire(place)))


def test_a_change_that_finds_no_room_takes_place_behind(play):
    """2 m before the end of A; B goes on, where its lane 2 is beside."""
    _, run = play(init=drives(-1, 298, 10, route(lane_position(298), lane_position(200, 2, road_id="B"))))
    length = 10 * DURATION_S
    x, y, _, _ = at(run, "Ego", round(0.2 + 0.5 * DURATION_S, 2))
    assert (x, y) == pytest.approx((300 + length / 2 - 0.3 * WIDTH_M**2 / length, -WIDTH_M), abs=0.02)
    assert at(run, "Ego", 8.0)[1] == pytest.approx(-1.5 * WIDTH_M, abs=1e-6)


def test_who_is_in_the_new_lane_already_stays_in_it(play):
    _, run = play(init=drives(-2, 20, 10, route(lane_position(20), lane_position(250, -2))))
    assert np.abs(run.y_m[:, 0] + 1.5 * WIDTH_M).max() < 1e-9


def test_who_is_past_the_place_of_a_change_changes_from_there(play):
    _, run = play(init=drives(-1, 100, 10, route(lane_position(20), lane_position(250, -2))))
    length = 10 * DURATION_S
    x, y, _, _ = at(run, "Ego", round(DURATION_S / 2, 2))
    assert (x, y) == pytest.approx((100 + length / 2 - 0.3 * WIDTH_M**2 / length, -WIDTH_M), abs=0.02)
    assert at(run, "Ego", 8.0)[1] == pytest.approx(-1.5 * WIDTH_M, abs=1e-6)


def test_who_has_no_room_left_for_a_change_goes_on_in_its_lane(play):
    _, run = play(init=drives(-1, 248, 10, route(lane_position(20), lane_position(250, -2))))
    assert np.abs(run.y_m[:, 0] + 0.5 * WIDTH_M).max() < 1e-9


def test_who_moves_against_a_route_does_not_turn_round(play):
    """Lane -1 is driven eastwards, and the route leads west along lane 1 beside it."""
    points = "".join(
        f'<Waypoint routeStrategy="shortest">{lane_position(s, 1)}</Waypoint>' for s in (250, 20)
    )
    assign = (
        '<PrivateAction><RoutingAction><AssignRouteAction><Route name="back" closed="false">'
        f"{points}</Route></AssignRouteAction></RoutingAction></PrivateAction>"
    )
    with pytest.raises(RunError, match="'Ego' heads against route 'back', which it is assigned, at 1"):
        play(act(maneuver(event("e", assign, trigger(condition(at_time(1))))), actors="Ego"))
