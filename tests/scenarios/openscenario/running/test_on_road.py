"""Conditions along the road, at its end, beside it; traffic signals, parameters, who triggers."""

import pytest

from scenarios.openscenario import Engine, FileReadError, UnsupportedError, load
from scenarios.openscenario.running.on_road import lanes_between
from tests.scenarios.openscenario.conftest import (
    EGO_AT_START,
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
    set_variable,
    speed,
    teleport,
    trigger,
)

STOP_AT_40_S = trigger(condition(at_time(40)), kind="StopTrigger")


def first_s(write, kind, init, stop=STOP_AT_40_S, **parts):
    """The instant at which a condition holds first, to a step; None if it never does."""
    start = trigger(condition(kind))
    path = write(act(maneuver(event("e", set_variable("n", 1), start))), init=init, stop=stop, **parts)
    engine = Engine(load(path), step_s=0.05)
    element = next(e for e in engine.storyboard.elements if e.kind == "event")
    while not engine.over:
        if element.state == "completeState":
            return engine.time_s
        engine.advance()
    return None


# Road A runs 300 m east, then B (400 m), whose s runs west and ends where A ends.
EGO = private("Ego", teleport(lane_position(250)), speed(10))
ON_B = EGO + private("Other", teleport(lane_position(340, lane=1, road_id="B")))  # x = 360


def relative(value, system="road", freespace="false", kind="longitudinal", rule="lessThan"):
    return by_entity(
        f'<RelativeDistanceCondition entityRef="Other" value="{value}" rule="{rule}" freespace="{freespace}" '
        f'relativeDistanceType="{kind}" coordinateSystem="{system}"/>'
    )


@pytest.mark.parametrize("system", ["road", "lane"])
def test_a_distance_along_two_roads(write, system):
    """110 m at the start, 10 m/s: less than 60 m after 5 s, on another road whose s runs the other way."""
    assert first_s(write, relative(60, system), ON_B) == pytest.approx(5.0, abs=0.051)


@pytest.mark.parametrize("system", ["world"])
def test_other_coordinates_are_refused(write, system):
    start = trigger(condition(relative(60, system)))
    path = write(act(maneuver(event("e", set_variable("n", 1), start))), init=ON_B)
    with pytest.raises(UnsupportedError, match=f"coordinateSystem.*{system}"):
        load(path)


def test_free_space_along_the_road(write):
    """Front 3.5 m ahead of the ego, rear 0.5 m behind the other, which faces the same way."""
    assert first_s(write, relative(60, freespace="true"), ON_B) == pytest.approx(4.6, abs=0.051)


def test_lateral_distances_across_the_road(write):
    init = EGO_AT_START + private("Other", teleport(lane_position(60, lane=1)))
    assert first_s(write, relative(3.6, kind="lateral"), init) == pytest.approx(0.0)
    assert first_s(write, relative(3.4, kind="lateral"), init) is None
    assert first_s(write, relative(1.6, kind="lateral", freespace="true"), init) == pytest.approx(0.0)


def test_times_along_the_road(write):
    headway = '<TimeHeadwayCondition entityRef="Other" value="6" rule="lessThan" freespace="false" {}/>'
    for words in ('alongRoute="true"', 'coordinateSystem="road" relativeDistanceType="longitudinal"'):
        assert first_s(write, by_entity(headway.format(words)), ON_B) == pytest.approx(5.0, abs=0.051)
    collision = (
        '<TimeToCollisionCondition value="6" rule="lessThan" freespace="false" alongRoute="true">'
        '<TimeToCollisionConditionTarget><EntityRef entityRef="Other"/></TimeToCollisionConditionTarget>'
        "</TimeToCollisionCondition>"
    )
    assert first_s(write, by_entity(collision), ON_B) == pytest.approx(5.0, abs=0.051)


def test_distance_and_time_to_a_position(write):
    place = lane_position(290)
    init = EGO + private("Other", teleport(lane_position(60)))
    near = f'<DistanceCondition value="20" rule="lessThan" freespace="{{}}">{place}</DistanceCondition>'
    assert first_s(write, by_entity(near.format("false")), init) == pytest.approx(2.0, abs=0.051)
    assert first_s(write, by_entity(near.format("true")), init) == pytest.approx(1.65, abs=0.051)
    soon = (
        '<TimeToCollisionCondition value="2" rule="lessThan" freespace="false">'
        f"<TimeToCollisionConditionTarget>{place}</TimeToCollisionConditionTarget></TimeToCollisionCondition>"
    )
    assert first_s(write, by_entity(soon), init) == pytest.approx(2.0, abs=0.051)


@pytest.mark.parametrize("duration", [0, 1.5])
def test_the_end_of_the_road(write, duration):
    """Lane -1 of A goes on as lane 1 of B, whose end in this direction is at x = 700."""
    init = private("Ego", teleport(lane_position(100)), speed(30)) + private(
        "Other", teleport(lane_position(60))
    )
    kind = by_entity(f'<EndOfRoadCondition duration="{duration}"/>')
    assert first_s(write, kind, init) == pytest.approx(20.0 + duration, abs=0.051)


@pytest.mark.parametrize("duration", [0.0, 2.0])
def test_the_end_of_the_road_behind_who_drives_in_reverse(write, duration):
    """From x = 90 back at 30 m/s: road A begins at x = 0, where nothing joins it."""
    init = private("Ego", teleport(lane_position(90)), speed(-30)) + private(
        "Other", teleport(lane_position(60, lane=1))
    )
    kind = by_entity(f'<EndOfRoadCondition duration="{duration}"/>')
    assert first_s(write, kind, init) == pytest.approx(3.0 + duration, abs=0.051)
    # who begins there and drives away from it is not at an end
    away = private("Ego", teleport(lane_position(0)), speed(30)) + private(
        "Other", teleport(lane_position(60))
    )
    assert first_s(write, kind, away) is None or first_s(write, kind, away) > 20.0


def test_who_stops_at_the_end_behind_stays_there(write):
    """From 20 m/s in reverse with 4 m/s2 over 50 m: at x = 0 after 5 s, and 1 s later."""
    init = private("Ego", teleport(lane_position(50)), speed(-20), speed(0, "linear", "rate", 4)) + private(
        "Other", teleport(lane_position(60, lane=1))
    )
    kind = by_entity('<EndOfRoadCondition duration="1"/>')
    assert first_s(write, kind, init) == pytest.approx(6.0, abs=0.051)


def test_off_the_road(write):
    """Across the road (two lanes of 3.5 m) from its middle at 2 m/s."""
    walks = '<Position><WorldPosition x="100" y="0" h="1.5707963267948966"/></Position>'
    init = private("Ego", teleport(walks), speed(2)) + private("Other", teleport(lane_position(60)))
    kind = by_entity('<OffroadCondition duration="1"/>')
    assert first_s(write, kind, init) == pytest.approx(3.5 + 1.0, abs=0.051)


def test_a_lane_of_type_none_is_beside_the_road(write, tmp_path):
    """ASAM OpenDRIVE: such a lane is there for whoever leaves the road."""
    walks = '<Position><WorldPosition x="100" y="0" h="1.5707963267948966"/></Position>'
    init = private("Ego", teleport(walks), speed(2)) + private("Other", teleport(lane_position(60)))
    off = trigger(condition(by_entity('<OffroadCondition duration="0"/>')))
    outer = '<lane id="2" type="driving">'

    def first_outside_s(lane):
        path = write(act(maneuver(event("e", set_variable("n", 1), off))), init=init)
        network = tmp_path / "two_roads.xodr"
        text = network.read_text()
        assert outer in text
        network.write_text(text.replace(outer, lane))
        engine = Engine(load(path))
        while engine.world.variables["n"] == 0 and not engine.over:
            engine.advance(0.01)
        return engine.time_s

    assert first_outside_s(outer) == pytest.approx(3.5, abs=0.011)
    assert first_outside_s('<lane id="2" type="none">') == pytest.approx(1.75, abs=0.011)


def clearance(lanes="", forward=20, backward=10, freespace="false", opposite="false", entity=""):
    return by_entity(
        f'<RelativeClearanceCondition distanceForward="{forward}" distanceBackward="{backward}" '
        f'freeSpace="{freespace}" oppositeLanes="{opposite}">{lanes}{entity}</RelativeClearanceCondition>'
    )


@pytest.mark.parametrize(
    ("kind", "time_s"),
    [
        # the other one stands 50 m ahead in the lane beside: free until 20 m before, again 10 m behind it
        (clearance('<RelativeLaneRange from="0" to="0"/>'), 0.0),
        (clearance('<RelativeLaneRange from="-1" to="0"/>', forward=60), 6.0),
        (clearance(forward=60, freespace="true"), 5.0 + (10 + 0.5 + 3.5) / 10),
        (clearance(forward=60, entity='<EntityRef entityRef="Other"/>'), 6.0),
    ],
)
def test_clearance(write, kind, time_s):
    init = EGO_AT_START + private("Other", teleport(lane_position(60, lane=-2)))
    assert first_s(write, kind, init) == pytest.approx(time_s, abs=0.051)


@pytest.mark.parametrize(
    ("lanes", "opposite", "time_s"),
    [
        ('<RelativeLaneRange from="1" to="2"/>', "false", None),  # to the left all come towards it
        ('<RelativeLaneRange from="1" to="2"/>', "true", 0.0),
        ('<RelativeLaneRange from="-1" to="-1"/>', "false", 0.0),
        ('<RelativeLaneRange from="-3" to="-2"/>', "false", None),  # there are two lanes
    ],
)
def test_no_lane_is_not_clear(write, lanes, opposite, time_s):
    init = EGO_AT_START + private("Other", teleport(lane_position(250, lane=-2)))
    assert first_s(write, clearance(lanes, opposite=opposite), init) == time_s


def test_lanes_are_counted_without_a_lane_0():
    assert [lanes_between(-1, other) for other in (-2, -1, 1, 2)] == [-1, 0, 1, 2]
    assert [lanes_between(2, other) for other in (-1, 1, 2, 3)] == [-2, -1, 0, 1]


# Traffic signals and parameters

SIGNALS = (
    '<TrafficSignals><TrafficSignalController name="c"><Phase name="go" duration="4">'
    '<TrafficSignalState trafficSignalId="1" state="green"/></Phase><Phase name="stop" duration="6">'
    '<TrafficSignalState trafficSignalId="1" state="red"/></Phase></TrafficSignalController>'
    '<TrafficSignalController name="late" delay="3" reference="c"><Phase name="go" duration="4"/>'
    '<Phase name="stop" duration="6"/></TrafficSignalController></TrafficSignals>'
)


def signalled(path):
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("</RoadNetwork>", f"{SIGNALS}</RoadNetwork>"), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("kind", "time_s"),
    [
        ('<TrafficSignalCondition name="1" state="red"/>', 4.0),
        ('<TrafficSignalControllerCondition trafficSignalControllerRef="c" phase="stop"/>', 4.0),
        ('<TrafficSignalControllerCondition trafficSignalControllerRef="late" phase="go"/>', 3.0),
        ('<TrafficSignalCondition name="9" state="red"/>', None),
    ],
)
def test_phases_of_traffic_signals(write, kind, time_s):
    def with_signals(*acts, **parts):
        return signalled(write(*acts, **parts))

    found = first_s(
        with_signals, by_value(kind), EGO_AT_START + private("Other", teleport(lane_position(60)))
    )
    assert found == (None if time_s is None else pytest.approx(time_s, abs=0.051))


def infrastructure(inner):
    return (
        "<GlobalAction><InfrastructureAction><TrafficSignalAction>"
        f"{inner}</TrafficSignalAction></InfrastructureAction></GlobalAction>"
    )


def reacts(play, action, kind):
    """The other one goes from when a condition holds, which an action at 2 s brings about."""
    first = event("first", action, trigger(condition(at_time(2))))
    second = event("second", speed(1), trigger(condition(by_value(kind))))
    _, run = play(act(maneuver(first, second)))
    return at(run, "Other", 5.0)[0] - 60


def test_actions_on_signals_and_parameters(play):
    state = infrastructure('<TrafficSignalStateAction name="x" state="on"/>')
    assert reacts(play, state, '<TrafficSignalCondition name="x" state="on"/>') == pytest.approx(3.0)
    declared = '<ParameterDeclaration name="p" parameterType="double" value="1"/>'
    for change, value in (
        ('<SetAction value="4"/>', 4),
        ('<ModifyAction><Rule><MultiplyByValue value="3"/></Rule></ModifyAction>', 3),
    ):
        action = f'<GlobalAction><ParameterAction parameterRef="p">{change}</ParameterAction></GlobalAction>'
        kind = f'<ParameterCondition parameterRef="p" rule="equalTo" value="{value}"/>'
        _, run = play(
            act(
                maneuver(
                    event("first", action, trigger(condition(at_time(2)))),
                    event("second", speed(1), trigger(condition(by_value(kind)))),
                )
            ),
            parameters=declared,
        )
        assert at(run, "Other", 5.0)[0] - 60 == pytest.approx(3.0)


def test_who_triggers_acts(write):
    """Of two that may trigger, the one that does carries the action out."""
    start = trigger(condition(by_entity('<TraveledDistanceCondition value="20"/>', "Ego", "Other")))
    path = write(act(maneuver(event("e", speed(3), start)), actors=""))
    text = path.read_text(encoding="utf-8").replace(
        'selectTriggeringEntities="false"', 'selectTriggeringEntities="true"'
    )
    path.write_text(text, encoding="utf-8")
    run = Engine(load(path)).run()
    assert at(run, "Ego", 3.0)[3] == 3.0
    assert at(run, "Other", 3.0)[3] == 0.0


# Levels by name, and criteria


def test_a_road_by_the_name_of_a_level(write, tmp_path):
    path = write()
    text = path.read_text(encoding="utf-8")
    path.write_text(text.replace("two_roads.xodr", "Town99"), encoding="utf-8")
    with pytest.raises(FileReadError, match=r"a folder with Town99.xodr, by --road"):
        load(path)
    assert load(path, road=tmp_path / "two_roads.xodr").map_path == tmp_path / "two_roads.xodr"
    (tmp_path / "maps").mkdir()
    (tmp_path / "two_roads.xodr").rename(tmp_path / "maps" / "Town99.xodr")
    assert load(path, road=tmp_path / "maps").map_path == tmp_path / "maps" / "Town99.xodr"


def test_criteria_judge_and_do_not_stop(write):
    criterion = (
        '<Condition name="criteria_CollisionTest" delay="0" conditionEdge="rising">'
        '<ByValueCondition><ParameterCondition parameterRef="" value="" rule="lessThan"/></ByValueCondition>'
        "</Condition>"
    )
    stop = f"<StopTrigger><ConditionGroup>{criterion}{condition(at_time(8))}</ConditionGroup></StopTrigger>"
    definition = load(write(stop=stop))
    assert definition.criteria == (("CollisionTest", ""),)
    engine = Engine(definition)
    assert "criterion CollisionTest: met" in engine.notes
    assert engine.run().end_time_s == pytest.approx(8.0)
    assert "criterion CollisionTest: not met" in engine.notes  # the ego drives into the other one
    alone = f"<StopTrigger><ConditionGroup>{criterion}</ConditionGroup></StopTrigger>"
    assert not Engine(load(write(stop=alone))).run(5.0).stopped


@pytest.mark.parametrize(
    ("kind", "time_s"), [("vehicle", 4.6), ("pedestrian", None), ("miscellaneous", None)]
)
def test_a_collision_by_type_is_one_with_anybody_of_it(write, kind, time_s):
    """Front 3.5 m ahead of the ego at 10 m, rear 0.5 m behind the car at 60 m: 46 m at 10 m/s."""
    inner = by_entity(f'<CollisionCondition><ByType type="{kind}"/></CollisionCondition>')
    init = EGO_AT_START + private("Other", teleport(lane_position(60)))
    stop = trigger(condition(at_time(6)), kind="StopTrigger")
    got = first_s(write, inner, init, stop=stop)
    assert got == (None if time_s is None else pytest.approx(time_s, abs=0.051))
