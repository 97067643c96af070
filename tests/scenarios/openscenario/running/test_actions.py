"""Every action with an expectation computed by hand."""

import math
from datetime import UTC, datetime

import pytest

from scenarios.openscenario import BrakeAt, Engine, Motion, RunError, load
from scenarios.openscenario.model import Environment, Performance
from tests.scenarios.openscenario.conftest import (
    CAR,
    EGO_AT_START,
    OTHER_AHEAD,
    act,
    add_to_variable,
    at,
    at_time,
    by_value,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    set_variable,
    speed,
    teleport,
    trigger,
)


def later(seconds):
    return trigger(condition(at_time(seconds)))


def wrap(inner):
    return f"<PrivateAction>{inner}</PrivateAction>"


@pytest.mark.parametrize(
    ("change", "x", "v"),
    [
        (speed(6), 72.0, 6.0),
        (speed(6, "linear", "time", 4), 63.0, 3.0),  # 1.5 m/s2 for 2 s
        (speed(6, "linear", "rate", 1.5), 63.0, 3.0),
        (speed(6, "linear", "distance", 12), 63.0, 3.0),  # 12 m at a mean of 3 m/s: 4 s
        (speed(6, "cubic", "time", 4), 60.0 + 6 * 4 * 0.125 * 0.75, 3.0),  # integral of 6 (3 p^2 - 2 p^3)
        (speed(6, "sinusoidal", "time", 4), 60.0 + 3 * (2 - 4 / math.pi), 3.0),
    ],
)
def test_speed_from_2_s_on(play, change, x, v):
    _, run = play(act(maneuver(event("e", change, later(2)))))
    assert at(run, "Other", 4.0) == pytest.approx((x, -1.75, 0, v))
    assert at(run, "Other", 1.99) == (60, -1.75, 0, 0)
    assert at(run, "Other", 10.0)[3] == pytest.approx(6.0)


def test_at_a_rate_of_0_a_speed_never_changes(play):
    engine, run = play(act(maneuver(event("e", speed(6, "linear", "rate", 0), later(2)))))
    assert at(run, "Other", 9.0) == pytest.approx((60, -1.75, 0, 0))
    assert any("at a rate of 0" in note for note in engine.notes)


@pytest.mark.parametrize(("kind", "value", "expected"), [("delta", -4, 6.0), ("factor", 0.5, 5.0)])
def test_relative_speed(play, kind, value, expected):
    target = (
        f'<RelativeTargetSpeed entityRef="Ego" value="{value}" speedTargetValueType="{kind}" '
        f'continuous="false"/>'
    )
    change = speed(0).replace('<AbsoluteTargetSpeed value="0"/>', target)
    _, run = play(act(maneuver(event("e", change))))
    assert at(run, "Other", 1.0)[3] == expected


def distance(amount, side="leadingReferencedEntity", freespace="true", continuous="false", what="distance"):
    return wrap(
        f"<LongitudinalAction>"
        f'<LongitudinalDistanceAction entityRef="Ego" {what}="{amount}" freespace="{freespace}" '
        f'continuous="{continuous}" displacement="{side}" coordinateSystem="entity"/></LongitudinalAction>'
    )


@pytest.mark.parametrize(
    ("action", "x"),
    [
        (distance(12), 10 + 3.5 + 12 + 0.5),  # ego's front, gap, the other's rear overhang
        (distance(12, freespace="false"), 22.0),
        (distance(2, "trailingReferencedEntity"), 10 - 0.5 - 2 - 3.5),
        (distance(12, "any"), 26.0),
        (distance(1.5, what="timeGap", freespace="false"), 25.0),  # 1.5 s at the ego's 10 m/s
    ],
)
def test_distance_at_once(play, action, x):
    """The entity is put there and goes on with the other's speed, whatever that does later."""
    slow = event("slow", speed(5), later(3))
    _, run = play(
        act(maneuver(event("e", action))), act(maneuver(slow, name="ego"), actors="Ego", name="second")
    )
    assert at(run, "Other", 0.0) == pytest.approx((x, -1.75, 0, 10))
    assert at(run, "Other", 5.0) == pytest.approx((x + 50, -1.75, 0, 10))


def test_distance_kept(play):
    """As long as the action runs the gap stays; a speed action ends it."""
    follow = event("follow", distance(12, continuous="true"))
    slow = event("slow", speed(5), later(3))
    leave = event("leave", speed(7), later(5))
    _, run = play(act(maneuver(follow, leave)), act(maneuver(slow, name="ego"), actors="Ego", name="second"))
    assert at(run, "Other", 2.0) == pytest.approx((46, -1.75, 0, 10))
    assert at(run, "Other", 4.0) == pytest.approx((61, -1.75, 0, 5))
    assert at(run, "Other", 6.0) == pytest.approx((66 + 7, -1.75, 0, 7))


LANE_BESIDE = wrap(
    '<LateralAction><LaneChangeAction><LaneChangeActionDynamics dynamicsShape="cubic" '
    'dynamicsDimension="time" value="3"/><LaneChangeTarget><AbsoluteTargetLane value="-2"/>'
    "</LaneChangeTarget></LaneChangeAction></LateralAction>"
)
ROUTE_AHEAD = wrap(
    '<RoutingAction><AssignRouteAction><Route name="r" closed="false">'
    + "".join(f'<Waypoint routeStrategy="shortest">{lane_position(s)}</Waypoint>' for s in (20, 250))
    + "</Route></AssignRouteAction></RoutingAction>"
)
LINE_AHEAD = wrap(
    '<RoutingAction><FollowTrajectoryAction><TrajectoryRef><Trajectory name="t" closed="false">'
    "<Shape><Polyline>"
    + "".join(f"<Vertex>{lane_position(s)}</Vertex>" for s in (42, 290))
    + "</Polyline></Shape></Trajectory></TrajectoryRef><TimeReference><None/></TimeReference>"
    '<TrajectoryFollowingMode followingMode="position"/></FollowTrajectoryAction></RoutingAction>'
)


@pytest.mark.parametrize(
    ("way", "y"),
    [(LANE_BESIDE, -5.25), (ROUTE_AHEAD, -1.75), (LINE_AHEAD, -1.75), (teleport(lane_position(200)), -1.75)],
)
def test_a_distance_is_kept_whatever_way_the_entity_is_given(play, way, y):
    """12 m ahead of the ego's point at 10 + 10 t: also while it changes lanes and on another way."""
    keep = event("keep", distance(12, freespace="false", continuous="true").replace('"entity"', '"road"'))
    _, run = play(act(maneuver(keep, event("way", way, later(2)))))
    for t in (1.0, 2.0, 2.5, 4.0, 8.0):
        assert at(run, "Other", t)[0] == pytest.approx(22 + 10 * t, abs=1e-6)
    assert at(run, "Other", 8.0)[1:] == pytest.approx((y, 0, 10), abs=1e-6)


def test_a_teleport_ends_a_lane_change(play):
    """It is in the middle of lane -2 at s = 200 and goes on there; nothing brings it back to the old way."""
    init = EGO_AT_START + private("Other", teleport(lane_position(60)), speed(10))
    _, run = play(
        act(
            maneuver(
                event("swap", LANE_BESIDE, later(1)),
                event("put", teleport(lane_position(200, lane=-2)), later(2)),
            )
        ),
        init=init,
    )
    assert at(run, "Other", 1.99)[0] == pytest.approx(79.9, abs=0.3)
    for t in (2.0, 3.0, 8.0):
        assert at(run, "Other", t) == pytest.approx((200 + 10 * (t - 2), -5.25, 0, 10))


def test_distance_of_one_that_comes_towards(play):
    """Head on, both fronts face each other: ego's front 3.5 m, gap 20 m, the other's front 3.5 m."""
    against = '<Orientation type="relative" h="3.141592653589793"/>'
    init = EGO_AT_START + private("Other", teleport(lane_position(200, inner=against)))
    _, run = play(act(maneuver(event("e", distance(20, "trailingReferencedEntity")))), init=init)
    assert at(run, "Other", 0.0)[0] == pytest.approx(10 + 3.5 + 20 + 3.5)


def test_two_that_keep_a_distance_from_each_other_are_refused(play):
    one = act(maneuver(event("e", distance(12, continuous="true"))))
    mutual = distance(12, continuous="true").replace('entityRef="Ego"', 'entityRef="Other"')
    two = act(maneuver(event("e", mutual), name="back"), actors="Ego", name="second")
    with pytest.raises(RunError, match="keeps a distance from 'Other', which keeps one from it"):
        play(one, two)


def synchronize(target_s, master_s, final='<AbsoluteSpeed value="2">{steady}</AbsoluteSpeed>', steady=""):
    speed_part = f"<FinalSpeed>{final.format(steady=steady)}</FinalSpeed>" if final else ""
    places = (
        f'<TargetPositionMaster><LanePosition roadId="A" laneId="-1" s="{master_s}"/></TargetPositionMaster>'
        f'<TargetPosition><LanePosition roadId="A" laneId="-2" s="{target_s}"/></TargetPosition>'
    )
    return wrap(f'<SynchronizeAction masterEntityRef="Ego">{places}{speed_part}</SynchronizeAction>')


BESIDE = private("Ego", teleport(lane_position(10)), speed(10)) + private(
    "Other", teleport(lane_position(60, lane=-2))
)


def test_synchronised_from_rest(play):
    """Ego needs 8 s to s = 90. Other has 10 m to go, the last 6 m (3 s) at 2 m/s: the first 4 m take 4 s at
    0.5 m/s2. So it sets off at 1 s, is steady from 5 s on and at its place at 8 s.
    """
    _, run = play(
        act(maneuver(event("e", synchronize(70, 90, steady='<TargetDistanceSteadyState distance="6"/>')))),
        init=BESIDE,
    )
    assert (run.target_start_time_s, run.target_steady_time_s) == pytest.approx((1.0, 5.0))
    for t, x, v in ((1, 60, 0), (3, 61, 1), (5, 64, 2), (8, 70, 2), (10, 74, 2)):
        assert at(run, "Other", t) == pytest.approx((x, -5.25, 0, v))


def test_steady_time(play):
    """The same with 2 s of steady state: 4 m at 2 m/s; 6 m before take 6 s."""
    _, run = play(
        act(maneuver(event("e", synchronize(70, 90, steady='<TargetTimeSteadyState time="2"/>')))),
        init=BESIDE,
    )
    assert (run.target_start_time_s, run.target_steady_time_s) == pytest.approx((0.0, 6.0))
    assert at(run, "Other", 8.0) == pytest.approx((70, -5.25, 0, 2))


def test_synchronised_while_moving(play):
    """24 m in 8 s from 4 m/s to 2 m/s is a mean of 3 m/s: one constant deceleration."""
    init = BESIDE + private("Other", speed(4))
    _, run = play(act(maneuver(event("e", synchronize(84, 90)))), init=init)
    assert at(run, "Other", 4.0) == pytest.approx((60 + 14, -5.25, 0, 3))
    assert at(run, "Other", 8.0) == pytest.approx((84, -5.25, 0, 2))


def test_no_final_speed(play):
    """Constant acceleration: 16 m in 8 s from rest ends with 4 m/s."""
    _, run = play(act(maneuver(event("e", synchronize(76, 90, final="")))), init=BESIDE)
    assert at(run, "Other", 4.0) == pytest.approx((64, -5.25, 0, 2))
    assert at(run, "Other", 8.0) == pytest.approx((76, -5.25, 0, 4))


@pytest.mark.parametrize(("kind", "value"), [("delta", -8), ("factor", 0.2)])
def test_final_speed_relative_to_the_master(play, kind, value):
    final = (
        f'<RelativeSpeedToMaster value="{value}" '
        f'speedTargetValueType="{kind}">{{steady}}</RelativeSpeedToMaster>'
    )
    action = synchronize(70, 90, final=final, steady='<TargetDistanceSteadyState distance="6"/>')
    _, run = play(act(maneuver(event("e", action))), init=BESIDE)
    assert (run.target_start_time_s, run.target_steady_time_s) == pytest.approx((1.0, 5.0))


STEADY = synchronize(70, 90, steady='<TargetDistanceSteadyState distance="6"/>')


@pytest.mark.parametrize("brake_time_s", [6.0, 3.0])
def test_once_set_off_the_profile_stays_whatever_the_master_does(write, brake_time_s):
    definition = load(write(act(maneuver(event("e", STEADY))), init=BESIDE))
    run = Engine(definition, BrakeAt(brake_time_s, 9.0)).run()
    assert run.speed_mps[-1, 0] == 0.0
    assert (run.target_start_time_s, run.target_steady_time_s) == pytest.approx((1.0, 5.0))
    assert at(run, "Other", 8.0) == pytest.approx((70, -5.25, 0, 2))


def test_before_it_sets_off_it_waits_for_the_master(write):
    """A master that stops early never arrives: the target never starts."""
    run = Engine(load(write(act(maneuver(event("e", STEADY))), init=BESIDE)), BrakeAt(0.5, 20.0)).run()
    assert run.target_start_time_s is None
    assert at(run, "Other", 10.0)[0] == 60.0


def test_a_slower_master_delays_the_start(play):
    """At 0.5 s the ego slows to 5 m/s at once, at s = 15: 75 m take 15 s more; the start moves to 8.5 s."""
    slow = act(maneuver(event("slow", speed(5), later(0.5)), name="slow"), actors="Ego", name="second")
    stop = trigger(condition(at_time(20)), kind="StopTrigger")
    _, run = play(act(maneuver(event("e", STEADY))), slow, init=BESIDE, stop=stop)
    assert (run.target_start_time_s, run.target_steady_time_s) == pytest.approx((8.5, 12.5), abs=1e-6)


def test_teleport_visibility_light_and_deletion(write):
    events = (
        event("jump", teleport(lane_position(200)), later(1)),
        event("hide", wrap('<VisibilityAction graphics="true" traffic="true" sensors="false"/>'), later(2)),
        event(
            "light",
            wrap(
                "<AppearanceAction><LightStateAction><LightType>"
                '<VehicleLight vehicleLightType="lowBeam"/></LightType>'
                '<LightState mode="on"/></LightStateAction></AppearanceAction>'
            ),
        ),
    )
    delete = (
        '<GlobalAction><EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction></GlobalAction>'
    )
    gone = act(maneuver(event("gone", delete, later(3)), name="d"), name="b")
    engine = Engine(load(write(act(maneuver(*events)), gone)))
    engine.advance(1.5)
    assert engine.entities.reference_m[1, 0] == pytest.approx(200)
    assert engine.entities.seen.tolist() == [True, True]
    engine.advance(1.0)
    assert engine.entities.seen.tolist() == [True, False]
    assert engine.entities.exists.tolist() == [True, True]
    engine.advance(1.0)
    assert engine.entities.exists.tolist() == [True, False]
    assert engine.world.actors["Other"].lights == {"lowBeam": "on"}


def test_a_deleted_entity_is_not_hit(play):
    delete = (
        '<GlobalAction><EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction></GlobalAction>'
    )
    assert play()[1].contact_entity == "Other"
    assert play(act(maneuver(event("gone", delete))))[1].contact_entity is None


def added(x, heading=0.0):
    place = f'<Position><WorldPosition x="{x}" y="-1.75" h="{heading}"/></Position>'
    action = f"<AddEntityAction>{place}</AddEntityAction>"
    return f'<GlobalAction><EntityAction entityRef="Other">{action}</EntityAction></GlobalAction>'


def test_an_entity_is_added(play, write):
    """At 2 s at x = 45 m, its rear at 44.5 m; the ego's front, at 13.5 m + 10 m/s t, is there at 3.1 s."""
    comes = act(maneuver(event("comes", added(45), later(2))))
    engine = Engine(load(write(comes, init=EGO_AT_START)))
    engine.advance(1.9)
    assert engine.entities.exists.tolist() == [True, False]
    assert engine.entities.seen.tolist() == [True, False]
    engine.advance(0.2)
    assert engine.entities.exists.tolist() == [True, True]
    assert engine.entities.reference_m[1] == pytest.approx([45.0, -1.75])
    assert engine.run().contact_time_s == pytest.approx(3.1, abs=1e-6)
    # where the ego was before, nobody is hit
    behind = act(maneuver(event("comes", added(20, 0.5), later(2))))
    engine, run = play(behind, init=EGO_AT_START)
    assert run.contact_time_s is None
    assert engine.entities.boxes.yaw_rad[1] == pytest.approx(0.5)


def test_an_entity_that_exists_is_not_added_again(play):
    engine, _ = play(act(maneuver(event("comes", added(200), later(2)))))
    assert engine.entities.reference_m[1] == pytest.approx([60.0, -1.75])


def test_a_deleted_entity_comes_back_with_its_speed(play):
    """As in esmini; one that was never there comes standing."""
    gone = '<GlobalAction><EntityAction entityRef="Other"><DeleteEntityAction/></EntityAction></GlobalAction>'
    events = (
        event("sets off", speed(8)),
        event("goes", gone, later(1)),
        event("comes", added(200), later(2)),
    )
    engine, run = play(act(maneuver(*events)))
    assert at(run, "Other", 5.0) == pytest.approx((200 + 3 * 8, -1.75, 0, 8))
    assert engine.entities.exists.tolist() == [True, True]


def test_who_is_never_added_needs_a_place(play):
    with pytest.raises(RunError, match="entity 'Other' is never given a position in Init"):
        play(act(maneuver(event("e", speed(1)))), init=EGO_AT_START)
    with pytest.raises(RunError, match="entity 'Ego' is never given a position in Init"):
        play(
            act(maneuver(event("comes", added(9).replace("Other", "Ego")))),
            init=OTHER_AHEAD,
        )


def test_variables(play):
    multiply = add_to_variable("n", 3).replace("AddValue", "MultiplyByValue")
    engine, _ = play(
        act(
            maneuver(
                event("set", set_variable("n", 4)),
                event("add", add_to_variable("n", 1.5), later(1)),
                event("mul", multiply, later(2)),
            )
        )
    )
    assert engine.world.variables["n"] == 16.5
    text = '<VariableDeclaration name="n" variableType="string" value="x"/>'
    with pytest.raises(RunError, match="variable 'n' is not a number"):
        play(act(maneuver(event("add", add_to_variable("n", 1)))), variables=text)


def test_environment_action_replaces_the_first(play):
    def environment(name):
        return (
            f'<GlobalAction><EnvironmentAction><Environment name="{name}"/></EnvironmentAction>'
            f"</GlobalAction>"
        )

    engine, _ = play(
        act(maneuver(event("e", environment("night"), later(1)))),
        init=environment("day") + EGO_AT_START + OTHER_AHEAD,
    )
    assert engine.world.environment is not None
    assert engine.world.environment.name == "night"


def test_environment_of_version_1_0(play):
    """Its sun has an intensity in lux, its rain one from 0 to 1 that is no amount."""
    old = (
        '<GlobalAction><EnvironmentAction><Environment name="dusk">'
        '<TimeOfDay animation="false" dateTime="2026-01-01T18:00:00"/><Weather cloudState="overcast">'
        '<Sun intensity="400" azimuth="3.1" elevation="0.1"/><Fog visualRange="150"/>'
        '<Precipitation precipitationType="snow" intensity="0.5"/></Weather>'
        '<RoadCondition frictionScaleFactor="0.4"/></Environment></EnvironmentAction></GlobalAction>'
    )
    engine, _ = play(init=old + EGO_AT_START + OTHER_AHEAD, minor=0)
    evening_s = datetime(2026, 1, 1, 18, tzinfo=UTC).timestamp()
    expected = Environment("dusk", 400.0, 0.1, "snow", None, 150.0, 0.4, time_of_day_s=evening_s)
    assert engine.world.environment == expected


def test_the_scenario_drives_until_the_controller_commands(write):
    faster = act(maneuver(event("e", speed(30), later(1))), actors="Ego")
    engine = Engine(load(write(faster)), BrakeAt(2.0, 5.0))
    run = engine.run()
    for t, x, v in ((0.9, 19, 10), (1.5, 35, 30), (2.0, 50, 30), (3.0, 77.5, 25)):
        assert at(run, "Ego", t) == pytest.approx((x, -1.75, 0, v))


def test_a_commanding_controller_is_not_overruled(write):
    """The event ends as it would; the ego goes on braking, and what it is asked for is known."""
    faster = act(maneuver(event("e", speed(30, "linear", "time", 1), later(1))), actors="Ego")
    engine = Engine(load(write(faster)), BrakeAt(0.5, 2.0))
    run = engine.run()
    assert at(run, "Ego", 3.0)[3] == pytest.approx(5.0)
    assert engine.ego.asked_mps(engine.time_s) == 30.0


class Holds:
    """Keeps the speed, and commands within an interval."""

    def __init__(self, from_s=0.0):
        self.commands_from_s = from_s

    def take_over(self, time_s, path, station_m, speed_mps):
        self.taken_s, self.speed_mps = time_s, speed_mps

    def motion(self, time_s, duration_s):
        return Motion(self.speed_mps * duration_s, self.speed_mps)

    def advance(self, time_s, duration_s):
        pass


def test_command_is_taken_inside_a_step_and_given_back(write):
    """From 10 m/s by 2 m/s2 to 20 m/s; held at 12 m/s from 1 s on for 2 s, then on as asked."""
    faster = act(maneuver(event("e", speed(20, "linear", "rate", 2))), actors="Ego")
    beside = EGO_AT_START + private("Other", teleport(lane_position(60, lane=-2)))
    controller = Holds(1.0049)
    engine = Engine(load(write(faster, init=beside)), controller)
    while engine.time_s < 3.0 - 1e-9:
        engine.advance(0.01)
    assert (controller.taken_s, controller.speed_mps) == pytest.approx((1.0049, 12.0098))
    now = engine.entities
    assert now.speed_mps[0] == pytest.approx(12.0098)
    x = 10 + 10 * 1.0049 + 1.0049**2 + 12.0098 * (3 - 1.0049)
    assert now.reference_m[0, 0] == pytest.approx(x)
    controller.commands_from_s = math.inf
    engine.advance(0.5)
    assert engine.entities.speed_mps[0] == pytest.approx(17.0)
    assert engine.entities.reference_m[0, 0] == pytest.approx(x + 0.5 * 16.5)


def test_a_controller_takes_the_way_of_a_timed_trajectory_and_not_its_times(write):
    """From 1 s on the ego is on a line to the north that the file would have it stand on until 5 s."""
    line = wrap(
        '<RoutingAction><FollowTrajectoryAction><TimeReference><Timing domainAbsoluteRelative="absolute" '
        'scale="1" offset="0"/></TimeReference><TrajectoryFollowingMode followingMode="position"/>'
        '<TrajectoryRef><Trajectory name="t" closed="false"><Shape><Polyline>'
        '<Vertex time="5"><Position><WorldPosition x="20" y="0"/></Position></Vertex>'
        '<Vertex time="9"><Position><WorldPosition x="20" y="80"/></Position></Vertex>'
        "</Polyline></Shape></Trajectory></TrajectoryRef></FollowTrajectoryAction></RoutingAction>"
    )
    turn = act(maneuver(event("e", line, later(1))), actors="Ego")
    run = Engine(load(write(turn)), Holds()).run()
    assert at(run, "Ego", 0.99) == pytest.approx((19.9, -1.75, 0, 10))
    assert at(run, "Ego", 2.0) == pytest.approx((20, 10, math.pi / 2, 10))
    assert at(run, "Ego", 4.0) == pytest.approx((20, 30, math.pi / 2, 10))
    assert Engine(load(write(turn))).run().speed_mps[300, 0] == 0.0  # nobody else drives: it waits


def test_a_trajectory_gives_way_to_a_route(play):
    line = (
        "<RoutingAction><FollowTrajectoryAction><TimeReference><None/></TimeReference>"
        '<TrajectoryFollowingMode followingMode="follow"/><TrajectoryRef>'
        '<Trajectory name="t" closed="false"><Shape>'
        f"<Polyline><Vertex>{lane_position(60)}</Vertex><Vertex>{lane_position(90)}</Vertex></Polyline>"
        f"</Shape>"
        "</Trajectory></TrajectoryRef></FollowTrajectoryAction></RoutingAction>"
    )
    route = (
        '<RoutingAction><AssignRouteAction><Route name="r" closed="false">'
        f'<Waypoint routeStrategy="shortest">{lane_position(20)}</Waypoint>'
        f'<Waypoint routeStrategy="shortest">{lane_position(250)}</Waypoint></Route>'
        f"</AssignRouteAction></RoutingAction>"
    )
    init = EGO_AT_START + private("Other", wrap(line), speed(5))
    engine, run = play(act(maneuver(event("e", wrap(route), later(2)))), init=init)
    assert not engine.world.actors["Other"].on_trajectory
    assert at(run, "Other", 8.0) == pytest.approx((100, -1.75, 0, 5))


STOPPED = trigger(condition(at_time(3)), kind="StopTrigger")
"""Of an act that ends at 3 s."""


def kept(target, value="20"):
    return wrap(
        f'<LongitudinalAction><LongitudinalDistanceAction entityRef="{target}" distance="{value}" '
        'freespace="false" continuous="true" displacement="leadingReferencedEntity"/></LongitudinalAction>'
    )


TIMED = wrap(
    '<RoutingAction><FollowTrajectoryAction><TimeReference><Timing domainAbsoluteRelative="relative" '
    'scale="1" offset="0"/></TimeReference><TrajectoryFollowingMode followingMode="position"/>'
    '<TrajectoryRef><Trajectory name="t" closed="false"><Shape><Polyline>'
    '<Vertex time="0"><Position><WorldPosition x="60" y="-5.25"/></Position></Vertex>'
    '<Vertex time="2"><Position><WorldPosition x="64" y="-5.25"/></Position></Vertex>'
    '<Vertex time="4"><Position><WorldPosition x="76" y="-5.25"/></Position></Vertex>'
    "</Polyline></Shape></Trajectory></TrajectoryRef></FollowTrajectoryAction></RoutingAction>"
)


@pytest.mark.parametrize(
    ("action", "x", "v"),
    [
        (speed(8, "linear", "time", 4), 60 + 9, 6),
        (speed(8, "cubic", "time", 4), 60 + 4 * 8 * 0.75**3 * (1 - 0.5 * 0.75), 8 * 0.75**2 * 1.5),
        (synchronize(70, 90, steady='<TargetDistanceSteadyState distance="6"/>'), 61, 1),
        (kept("Ego", "20"), 60, 10),  # 20 m ahead of s = 40
        (TIMED, 70, 6),
    ],
)
def test_the_end_of_an_act_leaves_place_and_speed(play, action, x, v):
    _, run = play(act(maneuver(event("e", action)), stop=STOPPED), init=BESIDE)
    for t in (3, 5, 9):
        assert at(run, "Other", t)[0] == pytest.approx(x + v * (t - 3), abs=1e-4)
        assert at(run, "Other", t)[3] == pytest.approx(v, abs=1e-6)


def test_a_kept_distance_that_is_overridden_ends_with_the_speed_it_had(play):
    """Ego slows down at 5 s; Other has left it at 3 s, when it was to accelerate by 1 m/s2 to 12 m/s."""
    faster = event("faster", speed(12, "linear", "rate", 1), later(3))
    slow = act(maneuver(event("slow", speed(2), later(5)), name="slow"), actors="Ego", name="second")
    _, run = play(act(maneuver(event("e", kept("Ego")), faster)), slow, init=BESIDE)
    assert at(run, "Other", 3)[:1] == pytest.approx((60,))
    for t, x, v in ((4, 70.5, 11), (5, 82, 12), (8, 118, 12)):
        assert at(run, "Other", t) == pytest.approx((x, -5.25, 0, v), abs=1e-6)


def delete(entity, when):
    gone = f'<EntityAction entityRef="{entity}"><DeleteEntityAction/></EntityAction>'
    action = f"<GlobalAction>{gone}</GlobalAction>"
    return act(maneuver(event("gone", action, later(when)), name="gone"), actors=entity, name="deletes")


def test_without_the_leader_the_speed_is_kept(play):
    """Ego, 10 m/s and 2 m/s2 from 1 s on, is deleted at 3 s, when it has 14 m/s."""
    faster = act(
        maneuver(event("f", speed(30, "linear", "rate", 2), later(1)), name="f"), actors="Ego", name="f"
    )
    seen = condition(
        '<ByValueCondition><StoryboardElementStateCondition storyboardElementType="action" '
        'storyboardElementRef="e/a" state="stopTransition"/></ByValueCondition>'
    )
    tells = act(maneuver(event("tells", set_variable("n", 1), trigger(seen)), name="t"), name="tells")
    engine, run = play(act(maneuver(event("e", kept("Ego")))), faster, delete("Ego", 3), tells, init=BESIDE)
    place = 10 + 10 * 3 + 4 + 20
    for t in (3, 5, 9):
        assert at(run, "Other", t) == pytest.approx((place + 14 * (t - 3), -5.25, 0, 14), abs=1e-5)
    assert engine.world.variables["n"] == 1
    assert not run.exists[-1, 0]


@pytest.mark.parametrize(("when", "x"), [(0.5, 60.0), (3.0, 74.0)])
def test_without_the_master_who_waits_goes_on_waiting_and_who_has_set_off_keeps_the_plan(play, when, x):
    """The plan: from 1 s on by 0.5 m/s2 to 2 m/s at 5 s, 70 m at 8 s."""
    _, run = play(act(maneuver(event("e", STEADY))), delete("Ego", when), init=BESIDE)
    assert at(run, "Other", 10)[0] == pytest.approx(x, abs=1e-6)


def test_an_action_that_refers_to_a_deleted_entity_is_noted_and_not_begun(play):
    relative = speed(0, "step").replace(
        '<AbsoluteTargetSpeed value="0"/>',
        '<RelativeTargetSpeed entityRef="Other" value="1" speedTargetValueType="delta" continuous="false"/>',
    )
    engine, run = play(
        act(maneuver(event("e", relative, later(3)), event("f", kept("Other"), later(4))), actors="Ego"),
        delete("Other", 2),
    )
    assert at(run, "Ego", 9) == pytest.approx((100, -1.75, 0, 10))
    why = "is not carried out: it refers to 'Other', which is deleted"
    assert engine.notes == (
        f"SpeedAction of 'Ego' at 3.000 s {why}",
        f"LongitudinalDistanceAction of 'Ego' at 4.000 s {why}",
    )


def test_a_deleted_actor_stops_what_it_does(play):
    ramp = act(maneuver(event("ramp", speed(10, "linear", "time", 10))))
    seen = condition(
        '<ByValueCondition><StoryboardElementStateCondition storyboardElementType="action" '
        'storyboardElementRef="ramp/a" state="stopTransition"/></ByValueCondition>'
    )
    tells = act(maneuver(event("tells", set_variable("n", 1), trigger(seen)), name="t"), name="tells")
    engine, run = play(ramp, delete("Other", 2), tells)
    assert engine.world.variables["n"] == 1
    assert not run.exists[-1, 1]


def test_a_master_that_accelerates_arrives_when_its_own_plan_has_it(play):
    """Ego: an initial ramp from 0 to 10 m/s within 4 s, 20 m, then 60 m in 6 s: at s = 90 after 10 s.

    Other's last 6 m take 3 s, the 4 m before 4 s: it sets off at 3 s.
    """
    init = (
        private("Ego", teleport(lane_position(10)))
        + private("Ego", speed(10, "linear", "time", 4))
        + private("Other", teleport(lane_position(60, lane=-2)))
    )
    stop = trigger(condition(at_time(12)), kind="StopTrigger")
    _, run = play(act(maneuver(event("e", STEADY))), init=init, stop=stop)
    assert at(run, "Ego", 10)[0] == pytest.approx(90.0)
    assert (run.target_start_time_s, run.target_steady_time_s) == pytest.approx((3.0, 7.0), abs=1e-6)
    assert at(run, "Other", 10)[0] == pytest.approx(70.0, abs=1e-6)


def test_a_master_that_is_given_another_way_arrives_by_that(play):
    """At 1 s Ego is put on a line on which it has 110 m to go instead of 70: it arrives at 12 s."""
    line = wrap(
        "<RoutingAction><FollowTrajectoryAction><TimeReference><None/></TimeReference>"
        '<TrajectoryFollowingMode followingMode="position"/><TrajectoryRef><Trajectory name="t" '
        'closed="false"><Shape><Polyline><Vertex><Position><WorldPosition x="-20" y="-1.75"/></Position>'
        '</Vertex><Vertex><Position><WorldPosition x="200" y="-1.75"/></Position></Vertex></Polyline>'
        "</Shape></Trajectory></TrajectoryRef></FollowTrajectoryAction></RoutingAction>"
    )
    turn = act(maneuver(event("t", line, later(0.9)), name="t"), actors="Ego", name="second")
    stop = trigger(condition(at_time(14)), kind="StopTrigger")
    _, run = play(act(maneuver(event("e", STEADY))), turn, init=BESIDE, stop=stop)
    arrives = 0.9 + 11.0
    assert run.target_start_time_s == pytest.approx(arrives - 7.0, abs=1e-6)


def test_more_than_the_performance_allows_is_noted_or_not_done(write):
    """5 and 10 m/s2 are allowed: 10 m/s more within 1 s takes 2 s; who turns round accelerates as well."""
    changes = act(
        maneuver(
            event("up", speed(20, "linear", "time", 1), later(1)),
            event("down", speed(-10, "linear", "time", 2), later(4)),
        ),
        actors="Ego",
    )
    definition = load(write(changes, init=BESIDE))
    assert definition.entities[0].performance == Performance(70.0, 5.0, 10.0)
    engine = Engine(definition)
    assert engine.notes == ()
    run = engine.run()
    assert at(run, "Ego", 2.0)[3] == pytest.approx(20.0)
    assert engine.notes == (
        "the file asks for 15 m/s2 of 'Ego' (car), whose Performance allows an acceleration of 5",
        "the file asks for 15 m/s2 of 'Ego' (car), whose Performance allows a deceleration of 10",
    )
    engine = Engine(definition, apply_performance=True)
    run = engine.run()
    for t, v in ((2, 15), (3, 20), (4, 20), (5, 15), (8, 0), (9, -5), (10, -10)):
        assert at(run, "Ego", t)[3] == pytest.approx(v, abs=1e-6)
    assert all(note.endswith(": limited to that") for note in engine.notes)


def test_a_step_is_at_once_whatever_the_performance_is(write):
    step = act(maneuver(event("e", speed(60), later(1))), actors="Ego")
    engine = Engine(load(write(step, init=BESIDE)), apply_performance=True)
    run = engine.run()
    assert (at(run, "Ego", 2)[3], engine.notes) == (60.0, ())


def test_the_car_of_these_tests():
    assert 'Center x="1.5"' in CAR  # the hand computations above rest on these overhangs
    assert 'length="4"' in CAR


def animation(attributes):
    return (
        f"<PrivateAction><AppearanceAction><AnimationAction{attributes}><AnimationType><ComponentAnimation>"
        '<VehicleComponent vehicleComponentType="doorFrontLeft"/></ComponentAnimation></AnimationType>'
        '<AnimationState state="1"/></AnimationAction></AppearanceAction></PrivateAction>'
    )


@pytest.mark.parametrize(
    ("attributes", "ends_s"),
    [(' animationDuration="1.5"', 2.5), ("", 1.0), (' animationDuration="1.5" loop="true"', math.inf)],
)
def test_an_animation_lasts_as_long_as_it_says(play, attributes, ends_s):
    """It begins at 1 s; what waits for its end drives off at 4 m/s2 then."""
    done = by_value(
        '<StoryboardElementStateCondition storyboardElementType="event" storyboardElementRef="door" '
        'state="completeState"/>'
    )
    events = (
        event("door", animation(attributes), later(1)),
        event("go", speed(40, "linear", "rate", 4), trigger(condition(done))),
    )
    engine, run = play(act(maneuver(*events)))
    assert at(run, "Other", 4.0)[3] == pytest.approx(4 * max(4.0 - ends_s, 0.0), abs=1e-6)
    assert [note for note in engine.notes if "<AnimationAction> is not shown" in note]


def test_monitors_and_lights_of_ones_own_change_no_motion(write):
    monitor = '<GlobalAction><SetMonitorAction monitorRef="m" value="true"/></GlobalAction>'
    light = (
        "<PrivateAction><AppearanceAction><LightStateAction><LightType>"
        '<UserDefinedLight userDefinedLightType="beacon"/></LightType><LightState mode="on"/>'
        "</LightStateAction></AppearanceAction></PrivateAction>"
    )
    path = write(act(maneuver(event("m", monitor), event("light", light))))
    text = path.read_text(encoding="utf-8").replace(
        "<CatalogLocations>",
        '<MonitorDeclarations><MonitorDeclaration name="m" value="false"/></MonitorDeclarations>'
        "<CatalogLocations>",
    )
    path.write_text(text, encoding="utf-8")
    engine = Engine(load(path))
    engine.advance(1.0)
    assert engine.world.actors["Other"].lights == {"beacon": "on"}
    assert [note for note in engine.notes if "<SetMonitorAction> is not used: no condition reads" in note]
