"""Routes that are assigned while an entity changes lanes or keeps an offset: that comes to its end first."""

import numpy as np
import pytest

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

CHANGE = (
    '<PrivateAction><LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="cubic" '
    'dynamicsDimension="time" value="4"/><LaneChangeTarget><AbsoluteTargetLane value="-2"/>'
    "</LaneChangeTarget></LaneChangeAction></LateralAction></PrivateAction>"
)
OFFSET = (
    '<PrivateAction><LateralAction><LaneOffsetAction continuous="true"><LaneOffsetActionDynamics '
    'dynamicsShape="cubic" maxLateralAcc="1"/><LaneOffsetTarget><AbsoluteTargetLaneOffset value="0.5"/>'
    "</LaneOffsetTarget></LaneOffsetAction></LateralAction></PrivateAction>"
)


def later(seconds):
    return trigger(condition(at_time(seconds)))


def assigned(lane):
    waypoints = "".join(
        f'<Waypoint routeStrategy="shortest">{lane_position(s, lane)}</Waypoint>' for s in (20, 290)
    )
    return (
        '<PrivateAction><RoutingAction><AssignRouteAction><Route name="r" closed="false">'
        f"{waypoints}</Route></AssignRouteAction></RoutingAction></PrivateAction>"
    )


def acquired(s, lane):
    return (
        "<PrivateAction><RoutingAction><AcquirePositionAction>"
        f"{lane_position(s, lane)}</AcquirePositionAction></RoutingAction></PrivateAction>"
    )


@pytest.mark.parametrize("at_s", [2.0, 3.0, 4.9])
@pytest.mark.parametrize("route", [assigned(-1), assigned(-2), acquired(200, -2)])
def test_a_lane_change_is_completed(play, at_s, route):
    """From lane -1 to -2 within 4 s from 1 s on, whatever is assigned meanwhile."""
    _, run = play(
        act(maneuver(event("c", CHANGE, later(1)), event("r", route, later(at_s))), actors="Ego"),
        init=private("Ego", teleport(lane_position(10)), speed(10))
        + private("Other", teleport(lane_position(250, 2))),
    )
    t = run.time_s
    share = np.clip((t - 1) / 4, 0, 1)
    np.testing.assert_allclose(run.y_m[:, 0], -1.75 - 3.5 * share**2 * (3 - 2 * share), atol=1e-3)


def test_a_position_in_the_lane_that_was_left_is_driven_to_after_it(play):
    """At 4 s the entity is in the new lane; once its change is over it changes back."""
    _, run = play(
        act(maneuver(event("c", CHANGE, later(1)), event("r", acquired(200, -1), later(4))), actors="Ego"),
        init=private("Ego", teleport(lane_position(10)), speed(10))
        + private("Other", teleport(lane_position(250, 2))),
        stop=trigger(condition(at_time(15)), kind="StopTrigger"),
    )
    assert at(run, "Ego", 5.0)[1] == pytest.approx(-5.25, abs=1e-3)
    assert at(run, "Ego", 14.0)[1] == pytest.approx(-1.75, abs=1e-6)


def test_an_offset_that_is_kept_is_kept_on_the_route(play):
    _, run = play(
        act(maneuver(event("o", OFFSET, later(1)), event("r", assigned(-1), later(5))), actors="Ego"),
        init=private("Ego", teleport(lane_position(10)), speed(10))
        + private("Other", teleport(lane_position(250, 2))),
    )
    assert at(run, "Ego", 4.9)[1] == pytest.approx(-1.25, abs=1e-6)
    assert at(run, "Ego", 9.0)[1] == pytest.approx(-1.25, abs=1e-6)
    assert at(run, "Ego", 9.0)[0] == pytest.approx(100.0, abs=0.05)
