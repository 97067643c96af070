"""Odd input that is refused in one line, or has no place to be at and goes on."""

import math

import pytest

from scenarios.openscenario import ContentError, Engine, RunError, UnsupportedError, expand, load, model
from scenarios.openscenario.running.driving.controllers import kind_of
from tests.scenarios.openscenario.conftest import (
    CAR,
    MAP,
    act,
    at,
    at_time,
    by_entity,
    condition,
    event,
    lane_position,
    maneuver,
    private,
    road,
    set_variable,
    speed,
    teleport,
    trigger,
)
from tests.scenarios.openscenario.motion.test_trajectories import follow, polyline
from tests.scenarios.openscenario.running.driving.test_trailers import (
    TOWER,
    TRAILER,
    inline,
)

ISLAND = MAP.replace("</OpenDRIVE>", road("C", 0, 50, 0, 300, "", "") + "</OpenDRIVE>")
"""Road C runs beside road A, and no lane leads from one to the other."""


def keep(other, limits="", system="road", continuous="true", distance=20):
    inner = f"<DynamicConstraints {limits}/>" if limits else ""
    return (
        f'<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="{other}" '
        f'distance="{distance}" freespace="false" continuous="{continuous}" coordinateSystem="{system}">'
        f"{inner}</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"
    )


def once(action, start_s=1.0):
    return act(maneuver(event("e", action, trigger(condition(at_time(start_s))))))


@pytest.mark.parametrize("name", ["maxAcceleration", "maxDeceleration"])
def test_a_distance_without_any_acceleration_is_refused(write, name):
    with pytest.raises(ContentError, match=name):
        load(write(once(keep("Ego", f'{name}="0"'))))


@pytest.mark.parametrize("limits", ["", 'maxAcceleration="3" maxDeceleration="5"'])
@pytest.mark.parametrize("continuous", ["true", "false"])
def test_who_is_to_keep_a_distance_where_no_way_leads_goes_on(write, limits, continuous):
    init = private("Ego", teleport(lane_position(60)), speed(10)) + private(
        "Other", teleport(lane_position(10, road_id="C")), speed(7)
    )
    path = write(once(keep("Ego", limits, continuous=continuous)), init=init)
    (path.parent / "two_roads.xodr").write_text(ISLAND, encoding="utf-8")
    engine = Engine(load(path))
    run = engine.run(5)
    assert at(run, "Other", 4.0) == pytest.approx((10 + 7 * 4, 48.25, 0.0, 7.0))
    assert sum("no way leads from 'Other' to 'Ego'" in note for note in engine.notes) == 1
    (element,) = [element for element in engine.storyboard.elements if element.kind == "action"]
    ends = limits == "" and continuous == "false"  # without limits it is over at once
    assert (element.state == "completeState") == ends


def test_a_way_that_ends_while_a_distance_is_kept(write):
    """The ego is put onto the island: who kept a distance from it goes on at its speed."""
    init = private("Ego", teleport(lane_position(60)), speed(10)) + private(
        "Other", teleport(lane_position(40)), speed(10)
    )
    leaves = act(
        maneuver(event("l", teleport(lane_position(10, road_id="C")), trigger(condition(at_time(2))))),
        actors="Ego",
        name="leaves",
    )
    for limits in ("", 'maxAcceleration="3" maxDeceleration="5"'):
        path = write(once(keep("Ego", limits)), leaves, init=init)
        (path.parent / "two_roads.xodr").write_text(ISLAND, encoding="utf-8")
        run = Engine(load(path)).run(6)
        assert at(run, "Other", 5.0) == pytest.approx((90, -1.75, 0.0, 10.0), abs=0.01)


def test_a_distance_to_the_end_of_the_only_road_has_a_speed(write):
    """The other stands at the beginning of the road: its place has no way on one side."""
    init = private("Ego", teleport(lane_position(0)), speed(5)) + private(
        "Other", teleport(lane_position(20)), speed(5)
    )
    action = keep("Ego").replace(
        "coordinateSystem", 'displacement="leadingReferencedEntity" coordinateSystem'
    )
    path = write(once(action, 0.0), init=init)
    header = '<OpenDRIVE><header revMajor="1" revMinor="6"/>'
    text = header + road("A", 0, 0, 0, 300, "", "") + "</OpenDRIVE>"
    (path.parent / "two_roads.xodr").write_text(text, encoding="utf-8")
    run = Engine(load(path)).run(5)
    assert at(run, "Other", 4.0) == pytest.approx((40.0, -1.75, 0.0, 5.0), abs=1e-3)


def test_a_chain_of_distances_and_trailers_has_no_ring(write):
    other = TOWER.format(inline())
    with pytest.raises(RunError, match="keeps a distance from 'box'"):
        Engine(load(write(once(keep("box", system="entity")), other=other))).run(3)
    connect = '<TrailerAction><ConnectTrailerAction trailerRef="Ego"/></TrailerAction>'
    connect = f"<PrivateAction>{connect}</PrivateAction>"
    later = act(maneuver(event("c", connect, trigger(condition(at_time(2))))), name="b")
    path = write(
        once(keep("Ego", system="entity")), later,
        other=TOWER.format(""),
    )  # fmt: skip
    text = path.read_text("utf-8").replace(CAR, TRAILER.format(""), 1)
    path.write_text(text, encoding="utf-8")
    with pytest.raises(RunError, match="cannot be coupled"):
        Engine(load(path)).run(3)


def test_a_trailer_that_is_the_entry_that_holds_it(write):
    reference = '<CatalogReference catalogName="c" entryName="box"/>'
    trailer = TRAILER.format(
        f'<TrailerHitch dx="-1"/><Trailer><Trailer name="t">{reference}</Trailer></Trailer>'
    )
    locations = '<VehicleCatalog><Directory path="cats"/></VehicleCatalog>'
    path = write(other=reference, catalogs=locations)
    (path.parent / "cats").mkdir()
    head = '<FileHeader revMajor="1" revMinor="3" date="2026-01-01T00:00:00" author="t" description="d"/>'
    (path.parent / "cats" / "c.xosc").write_text(
        f'<OpenSCENARIO>{head}<Catalog name="c">{trailer}</Catalog></OpenSCENARIO>', encoding="utf-8"
    )
    with pytest.raises(ContentError, match="without end"):
        load(path)


@pytest.mark.parametrize("system", ["world", "banana"])
def test_lateral_distances_have_four_systems(write, system):
    action = (
        '<PrivateAction><LateralAction><LateralDistanceAction entityRef="Ego" distance="1" freespace="false" '
        f'continuous="false" coordinateSystem="{system}"/></LateralAction></PrivateAction>'
    )
    with pytest.raises((ContentError, UnsupportedError), match=system):
        load(write(once(action)))


def test_a_tower_that_appears_by_an_event_brings_its_trailer(write):
    path = write(once(teleport(lane_position(60))), init=private("Ego", teleport(lane_position(10))),
                 other=TOWER.format(inline()))  # fmt: skip
    engine = Engine(load(path))
    assert not engine.world.actors["box"].exists
    engine.run(2)
    assert engine.world.actors["Other"].exists
    assert engine.world.actors["box"].exists


@pytest.mark.parametrize("inner", ['<EntityRef entityRef="Other"/>', '<ByType type="miscellaneous"/>'])
def test_who_drives_over_a_mark_does_not_collide(play, inner):
    mark = (
        '<MiscObject name="mark" miscObjectCategory="roadMark" mass="1"><BoundingBox>'
        '<Center x="0" y="0" z="0"/>'
        '<Dimensions length="4" width="3" height="0.01"/></BoundingBox></MiscObject>'
    )
    start = trigger(condition(by_entity(f"<CollisionCondition>{inner}</CollisionCondition>")))
    for other, hits in ((mark, 0.0), (mark.replace("roadMark", "obstacle"), 1.0)):
        engine, _ = play(act(maneuver(event("e", set_variable("n", 1), start))), other=other)
        assert engine.world.variables["n"] == hits


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("AccelerationLimiter", "unknown"), ("AccidentController", "unknown"), ("Balks", "unknown"),
        ("ACCController", "driver"), ("ControllerALKS_R157SM", "driver"), ("accController", "driver"),
        ("idm", "driver"), ("NaturalDriver", "driver"), ("natural_driver", "driver"),
        ("ControllerFollowRoute", "driver"), ("my_acc_2", "driver"), ("acccontroller", "driver"),
        ("npc_vehicle_control", "default"),
    ],
)  # fmt: skip
def test_whole_words_name_a_controller(name, kind):
    assert kind_of(model.Controller(name, ())) == kind


def control(name, properties=""):
    return (
        '<PrivateAction><ControllerAction><AssignControllerAction activateLongitudinal="true">'
        f'<Controller name="{name}"><Properties>{properties}</Properties></Controller>'
        "</AssignControllerAction></ControllerAction></PrivateAction>"
    )


@pytest.mark.parametrize(("name", "value"), [("setSpeed", "nan"), ("timeGap", "inf"), ("timeGap", "-1")])
def test_properties_of_drivers_are_numbers(write, name, value):
    """Before anything runs."""
    with pytest.raises(RunError, match=rf"small.xosc:\d+: .*'Other'.*'{value}'"):
        Engine(load(write(once(control("ACC", f'<Property name="{name}" value="{value}"/>')))))


def test_a_default_controller_takes_over_from_a_driver(play):
    init = private("Ego", teleport(lane_position(100, lane=-2))) + private(
        "Other",
        teleport(lane_position(10)),
        speed(5),
        control("ACC", '<Property name="setSpeed" value="30"/>'),
    )
    back = act(maneuver(event("b", control("npc_vehicle_control"), trigger(condition(at_time(3))))))
    _, run = play(back, init=init)
    assert at(run, "Other", 2.9)[3] > 6.5
    assert at(run, "Other", 5.0)[3] == pytest.approx(5.0)


def test_oncoming_traffic_is_not_across(write):
    init = private("Ego", teleport(lane_position(10)), speed(10)) + private(
        "Other", teleport(lane_position(200, lane=1)), speed(10)
    )
    engine = Engine(load(write(once(keep("Ego", 'maxAcceleration="3"', "entity")), init=init)))
    engine.run(2)
    assert math.cos(engine.world.actors["Other"].state(2.0).yaw_rad) == pytest.approx(-1.0)
    assert not [note for note in engine.notes if "heads across" in note]


def test_who_steers_to_a_closed_trajectory_does_not_jump(play):
    """From 1 m beside a square with times; a second after the start it is still beside it."""
    points = ((0, 60, 10), (10, 160, 10), (20, 160, 110), (30, 60, 110), (40, 60, 10))
    vertices = "".join(
        f'<Vertex time="{t}"><Position><WorldPosition x="{x}" y="{y}"/></Position></Vertex>'
        for t, x, y in points
    )
    action = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TrajectoryRef>"
        f'<Trajectory name="t" closed="true"><Shape><Polyline>{vertices}</Polyline></Shape>'
        "</Trajectory></TrajectoryRef><TimeReference>"
        '<Timing domainAbsoluteRelative="relative" scale="1" offset="0"/></TimeReference>'
        '<TrajectoryFollowingMode followingMode="follow"/></FollowTrajectoryAction>'
        "</RoutingAction></PrivateAction>"
    )
    init = private("Ego", teleport(lane_position(10))) + private(
        "Other", teleport('<Position><WorldPosition x="61" y="11" h="0"/></Position>'), speed(10), action
    )
    _, run = play(init=init)
    assert at(run, "Other", 0.0)[:2] == pytest.approx((61.0, 11.0), abs=1e-6)
    assert 10.2 < at(run, "Other", 1.0)[1] < 11.0
    assert at(run, "Other", 9.0)[1] == pytest.approx(10.0, abs=1e-3)


def test_a_trailer_that_overlaps_its_tower_touches_it_only_after_they_were_apart(write):
    """The trailer reaches 0.25 m over the rear; let go of, it is left behind by 9 m, and hits the ego."""
    tower = TOWER.replace('TrailerHitch dx="-1.2"', 'TrailerHitch dx="-0.5"').format(inline())
    let_go = "<PrivateAction><TrailerAction><DisconnectTrailerAction/></TrailerAction></PrivateAction>"
    steps = ((1, let_go), (2, speed(8)), (5, speed(0)))
    events = (event(f"e{t}", action, trigger(condition(at_time(t)))) for t, action in steps)
    init = private("Ego", teleport(lane_position(20)), speed(5)) + private(
        "Other", teleport(lane_position(250))
    )
    path = write(act(maneuver(*events), actors="Ego"), init=init)
    path.write_text(path.read_text("utf-8").replace(CAR, tower, 1), encoding="utf-8")
    engine = Engine(load(path))
    engine.run()
    assert engine.contact is not None
    assert engine.contact.entity == "box"
    assert engine.contact.time_s == pytest.approx(5 + (9 - 0.25) / 5, abs=1e-5)


def test_a_trailer_that_overlaps_before_it_is_connected_does_not_collide(write):
    connect = '<TrailerAction><ConnectTrailerAction trailerRef="Other"/></TrailerAction>'
    later = event("e", f"<PrivateAction>{connect}</PrivateAction>", trigger(condition(at_time(1))))
    init = private("Ego", teleport(lane_position(20))) + private("Other", teleport(lane_position(20 - 3.75)))
    path = write(act(maneuver(later), actors="Ego"), init=init, other=TRAILER.format(""))
    tower = TOWER.replace('TrailerHitch dx="-1.2"', 'TrailerHitch dx="-0.5"').format("")
    path.write_text(path.read_text("utf-8").replace(CAR, tower, 1), encoding="utf-8")
    engine = Engine(load(path))
    engine.run(3)
    assert engine.world.actors["Other"].coupling is not None
    assert engine.contact is None


BRIDGE_M = 6.0
BRIDGE = MAP.replace(
    "</OpenDRIVE>",
    road("C", 150, -150, math.pi / 2, 300, "", "").replace(
        "</planView>",
        f'</planView><elevationProfile><elevation s="0" a="{BRIDGE_M}" b="0" c="0" d="0"/>'
        "</elevationProfile>",
    )
    + "</OpenDRIVE>",
)
"""Road C crosses above road A at x = 150 m."""


@pytest.fixture
def on_levels(write):
    def make(*acts, **parts):
        path = write(*acts, **parts)
        (path.parent / "two_roads.xodr").write_text(BRIDGE, encoding="utf-8")
        return Engine(load(path))

    return make


@pytest.mark.parametrize(("z_m", "reached"), [(0.0, True), (1.0, True), (5.5, False), (BRIDGE_M, False)])
def test_a_place_is_reached_on_its_level_in_plan(on_levels, z_m, reached):
    place = f'<Position><WorldPosition x="150" y="-1.75" z="{z_m}"/></Position>'
    inner = f'<ReachPositionCondition tolerance="2">{place}</ReachPositionCondition>'
    start = trigger(condition(by_entity(inner)))
    init = private("Ego", teleport(lane_position(100)), speed(10)) + private(
        "Other", teleport(lane_position(20))
    )
    stop = trigger(condition(at_time(8)), kind="StopTrigger")
    engine = on_levels(act(maneuver(event("e", set_variable("n", 1), start))), init=init, stop=stop)
    while not engine.over and engine.world.variables["n"] == 0.0:
        engine.advance()
    assert (engine.world.variables["n"] == 1.0) == reached
    assert engine.time_s == pytest.approx(4.8 if reached else 8.0, abs=0.011)  # 48 m at 10 m/s


@pytest.mark.parametrize("z_m", [0.0, BRIDGE_M])
def test_a_driver_brakes_for_who_is_on_its_level(on_levels, z_m):
    walks = teleport(f'<Position><WorldPosition x="150" y="-1.75" z="{z_m}" h="1.5707963"/></Position>')
    init = private("Ego", walks) + private("Other", teleport(lane_position(100)), speed(10), control("ACC"))
    engine = on_levels(init=init)
    run = engine.run(3)
    x_m, _, _, speed_mps = at(run, "Other", 2.9)
    assert (speed_mps > 9.9 and x_m > 128.0) == (z_m > 0.0)


def test_drawn_values_that_no_load_takes(write, tmp_path):
    declared = '<ParameterDeclaration name="k" parameterType="integer" value="1"/>'
    write(parameters=declared)
    text = (
        '<OpenSCENARIO><FileHeader revMajor="1" revMinor="2" date="2026-01-01T00:00:00" author="t" '
        'description="v"/><ParameterValueDistribution><ScenarioFile filepath="small.xosc"/>'
        '<Stochastic numberOfTestRuns="3" randomSeed="1"><StochasticDistribution parameterName="k">{}'
        "</StochasticDistribution></Stochastic></ParameterValueDistribution></OpenSCENARIO>"
    )
    uniform = '<UniformDistribution><Range lowerLimit="0" upperLimit="9"/></UniformDistribution>'
    narrow = '<LogNormalDistribution expectedValue="1e-200" variance="1"/>'
    path = tmp_path / "variation.xosc"
    for inner, said in ((uniform, "parameter 'k': expected a value of type integer"), (narrow, "too large")):
        path.write_text(text.format(inner), encoding="utf-8")
        with pytest.raises(ContentError, match=said):
            expand(path)
    path.write_text(text.format('<PoissonDistribution expectedValue="3"/>'), encoding="utf-8")
    assert len([load(each.path, each.parameters) for each in expand(path)]) == 3


def test_a_time_gap_that_is_kept_at_once_is_time_at_the_speed_of_both(play):
    """1.5 s behind an ego that brakes by 2 m/s2 the place moves 3 m/s faster than the ego."""
    gap = keep("Ego", system="entity").replace('distance="20"', 'timeGap="1.5"')
    slow = event("slow", speed(4, "linear", "time", 3), trigger(condition(at_time(2))))
    init = private("Ego", teleport(lane_position(60)), speed(10)) + private(
        "Other", teleport(lane_position(10))
    )
    brakes = act(maneuver(slow), actors="Ego", name="brakes")
    _, run = play(once(gap), brakes, init=init)
    assert at(run, "Other", 1.5) == pytest.approx((60, -1.75, 0, 10), abs=1e-4)
    assert at(run, "Other", 3.0) == pytest.approx((60 + 29 - 12, -1.75, 0, 11), abs=1e-3)
    assert at(run, "Other", 6.0) == pytest.approx((60 + 20 + 21 + 4 - 6, -1.75, 0, 4), abs=1e-4)


@pytest.mark.parametrize("v_mps", [10, -10])
def test_a_time_to_collision_along_a_trajectory_also_in_reverse(play, v_mps):
    """Other stands 70 m along the trajectory: 3 s are left after 4 s."""
    line = follow(polyline((10, -1.75), (200, -1.75)))
    inner = (
        '<TimeToCollisionCondition value="3" rule="lessThan" freespace="false" coordinateSystem="trajectory" '
        'relativeDistanceType="longitudinal"><TimeToCollisionConditionTarget><EntityRef entityRef="Other"/>'
        "</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    )
    init = private("Ego", teleport(lane_position(10)), line, speed(v_mps))
    init += private("Other", teleport(lane_position(80)))
    stop = trigger(condition(by_entity(inner)), kind="StopTrigger")
    engine, _ = play(init=init, stop=stop)
    assert engine.time_s == pytest.approx(4.0, abs=0.011)
