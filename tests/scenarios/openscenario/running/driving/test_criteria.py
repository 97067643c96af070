"""Criteria of CARLA's ScenarioRunner: each against a run whose outcome is plain."""

import pytest

from scenarios.openscenario import Engine, load
from tests.scenarios.openscenario.conftest import (
    act,
    at_time,
    condition,
    criterion,
    event,
    lane_position,
    maneuver,
    private,
    speed,
    teleport,
    trigger,
)


@pytest.fixture
def judge(write):
    """Run 5 s with one criterion: the ego from s = 10 m on at 10 m/s; its verdict."""

    def run(name, value="", ego=None, other_s=250.0, acts=(), after=str):
        ego = ego or private("Ego", teleport(lane_position(10)), speed(10))
        stop = f"<StopTrigger><ConditionGroup>{criterion(name, value)}</ConditionGroup></StopTrigger>"
        init = ego + private("Other", teleport(lane_position(other_s)))
        path = write(*acts, init=init, stop=stop)
        road = path.parent / "two_roads.xodr"
        road.write_text(after(road.read_text()))
        engine = Engine(load(path))
        engine.run(5.0)
        (verdict,) = engine.criteria
        assert verdict.name == name
        assert str(verdict) in engine.notes
        return verdict

    return run


@pytest.mark.parametrize(("other_s", "met"), [(250.0, True), (40.0, False)])
def test_collisions(judge, other_s, met):
    assert judge("CollisionTest", other_s=other_s).met is met


@pytest.mark.parametrize(("asked", "met"), [("49.9", True), ("50.1", False)])
def test_the_distance_driven(judge, asked, met):
    """10 m/s for 5 s."""
    verdict = judge("DrivenDistanceTest", asked)
    assert (verdict.met, verdict.detail) == (met, f"50.0 m of {asked} m")


def test_a_distance_without_a_number_is_not_evaluated(judge):
    verdict = judge("DrivenDistanceTest", "")
    assert (verdict.met, verdict.detail) == (None, "it has no number")


@pytest.mark.parametrize(("asked", "met"), [("10.1", True), ("9.9", False)])
def test_the_greatest_speed(judge, asked, met):
    assert judge("MaxVelocityTest", asked).met is met


def offset(y: float) -> str:
    return private("Ego", teleport(lane_position(10, offset=y)), speed(10))


@pytest.mark.parametrize(("y", "met"), [(0.0, True), (0.7, True), (-0.7, True), (0.8, False), (-0.8, False)])
def test_keeping_the_lane(judge, y, met):
    """A car 2 m wide in a lane of 3.5 m: within 0.75 m of the middle."""
    assert judge("KeepLaneTest", ego=offset(y)).met is met


def test_going_on_into_the_next_road_keeps_the_lane(judge):
    """A ends at 300 m, where the lanes have other ids in B."""
    assert judge("KeepLaneTest", ego=private("Ego", teleport(lane_position(280)), speed(10))).met is True


LEAVES = (
    "<PrivateAction><LateralAction><LaneChangeAction>"
    '<LaneChangeActionDynamics dynamicsShape="linear" dynamicsDimension="time" value="3"/>'
    '<LaneChangeTarget><AbsoluteTargetLane value="-2"/></LaneChangeTarget></LaneChangeAction></LateralAction>'
    "</PrivateAction>"
)


def test_a_lane_change_breaks_it_when_an_edge_is_over_the_border(judge):
    """3.5 m in 3 s at 10 m/s: 0.117 rad, which takes the front 0.41 m of the 0.75 m to the border.

    The rest takes 0.29 s from 1 s on; places are looked at every 0.1 s.
    """
    begin = trigger(condition(at_time(1)))
    acts = [act(maneuver(event("e", LEAVES, begin)), actors="Ego")]
    verdict = judge("KeepLaneTest", acts=acts)
    assert verdict.met is False
    assert verdict.detail == "at 1.3 s"


@pytest.mark.parametrize(("lane", "turned", "met"), [(-1, False, True), (1, False, True), (1, True, False)])
def test_the_wrong_lane(judge, lane, turned, met):
    """Lane 1 is driven westwards; who heads east there is against the traffic."""
    heading = '<Orientation type="absolute" h="0"/>' if turned else ""
    ego = private("Ego", teleport(lane_position(100, lane, inner=heading)), speed(10))
    assert judge("WrongLaneTest", ego=ego).met is met


@pytest.mark.parametrize("lane", [-1, -2])
def test_sidewalks(judge, lane):
    def second_lane_is_a_sidewalk(text: str) -> str:
        return text.replace('<lane id="-2" type="driving">', '<lane id="-2" type="sidewalk">')

    ego = private("Ego", teleport(lane_position(10, lane)), speed(10))
    assert judge("OnSidewalkTest", ego=ego, after=second_lane_is_a_sidewalk).met is (lane == -1)


@pytest.mark.parametrize("name", ["RunningRedLightTest", "RunningStopTest", "SomethingTest"])
def test_what_is_not_evaluated_says_why(judge, name):
    verdict = judge(name)
    assert verdict.met is None
    assert verdict.detail
