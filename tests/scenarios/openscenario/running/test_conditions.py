"""Every condition: the time at which it first holds, computed by hand, and found inside the step.

Ego starts at s = 10 m with 10 m/s (front at 13.5 m), Other stands at s = 60 m (rear at 59.5 m): they meet at
4.6 s.
"""

import math

import pytest

from scenarios.openscenario import Engine, RunError, load
from tests.scenarios.openscenario.conftest import (
    EGO_AT_START,
    OTHER_AHEAD,
    act,
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

CAPTURE = 0.0123
"""A step that divides none of the expected times."""


def fires_at(write, *conditions, more=(), init=EGO_AT_START + OTHER_AHEAD, **parts):
    """Time at which a trigger first holds, or None within 10 s."""
    path = write(
        act(maneuver(event("e", set_variable("n", 1), trigger(*conditions)))), *more, init=init, **parts
    )
    engine = Engine(load(path), step_s=CAPTURE)
    times = []
    actual = engine.storyboard.execute

    def note(instant, action, entities):
        if not entities:
            times.append(instant.time_s)
        return actual(instant, action, entities)

    engine.storyboard.execute = note  # type: ignore[method-assign]
    if engine.world.variables["n"] == 1:
        return 0.0
    engine.run()
    return times[0] if times else None


def relative_distance(value, rule="lessOrEqual", kind="longitudinal", freespace="true"):
    return (
        f'<RelativeDistanceCondition entityRef="Other" value="{value}" rule="{rule}" freespace="{freespace}" '
        f'relativeDistanceType="{kind}"/>'
    )


BRAKING = act(
    maneuver(event("brake", speed(0, "linear", "rate", 5), trigger(condition(at_time(1)))), name="b"),
    actors="Ego",
    name="braking",
)  # from 10 m/s at 1 s to 0 at 3 s


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (by_entity('<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>'), 4.6),
        (by_entity('<CollisionCondition><EntityRef entityRef="Ego"/></CollisionCondition>', "Other"), 4.6),
        (by_entity(relative_distance(16)), 3.0),
        (by_entity(relative_distance(20, freespace="false")), 3.0),
        (by_entity(relative_distance(16, kind="euclidianDistance")), 3.0),
        (by_entity(relative_distance(20, kind="cartesianDistance", freespace="false")), 3.0),
        (by_entity(relative_distance(0.5, "lessThan", "lateral")), 0.0),
        (by_entity(relative_distance(25, "greaterThan")), 0.0),
        (by_entity('<TraveledDistanceCondition value="33"/>'), 3.3),
        (by_entity('<TimeHeadwayCondition entityRef="Other" value="2" rule="lessThan" freespace="true" '
        'alongRoute="false"/>'), 2.6),
        (by_entity('<TimeHeadwayCondition entityRef="Other" value="2" rule="lessThan" '
        'freespace="false" alongRoute="false"/>'), 3.0),
        (
            by_entity(
                '<TimeToCollisionCondition value="1.6" rule="lessOrEqual" freespace="true">'
                '<TimeToCollisionConditionTarget><EntityRef entityRef="Other"/>'
                '</TimeToCollisionConditionTarget>'
                "</TimeToCollisionCondition>"
            ),
            3.0,
        ),
        (by_entity(f'<ReachPositionCondition '
        f'tolerance="2">{lane_position(40)}</ReachPositionCondition>'), 2.8),
        (by_entity('<AngleCondition angleType="heading" angle="0" angleTolerance="0.01"/>'), 0.0),
        (by_entity('<AngleCondition angleType="heading" angle="1.57" angleTolerance="0.01"/>'), None),
        (by_entity('<SpeedCondition value="9" rule="greaterThan"/>'), 0.0),
        (by_entity('<SpeedCondition value="10" rule="greaterThan"/>'), None),
        (by_entity('<SpeedCondition value="1" rule="greaterThan" direction="lateral"/>'), None),
        (by_entity('<SpeedCondition value="-1" rule="lessThan" direction="vertical"/>'), None),
        (by_entity('<SpeedCondition value="10" rule="equalTo" direction="longitudinal"/>'), 0.0),
        (by_entity('<RelativeSpeedCondition entityRef="Other" value="10" rule="greaterOrEqual"/>'), 0.0),
        (by_entity('<RelativeSpeedCondition entityRef="Ego" value="-9" rule="lessThan"/>', "Other"), 0.0),
        (by_entity('<StandStillCondition duration="1.5"/>', "Other"), 1.5),
        (by_entity('<StandStillCondition duration="1.5"/>', "Ego", "Other"), 1.5),
        (by_entity('<StandStillCondition duration="1.5"/>', "Ego", "Other", rule="all"), None),
        (by_value('<SimulationTimeCondition value="1.2345" rule="greaterThan"/>'), 1.2345),
    ],
)  # fmt: skip
def test_first_time(write, kind, expected):
    found = fires_at(write, condition(kind))
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-8))


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (by_entity('<SpeedCondition value="4" rule="lessThan"/>'), 2.2),
        (by_entity('<RelativeSpeedCondition entityRef="Other" value="2.5" rule="lessOrEqual"/>'), 2.5),
        (by_entity('<AccelerationCondition value="-4" rule="lessThan" direction="longitudinal"/>'), 1.0),
        (by_entity('<AccelerationCondition value="4" rule="greaterThan"/>'), 1.0),  # its amount
        (by_entity('<AccelerationCondition value="-4" rule="lessThan"/>'), None),  # no amount is negative
        (by_entity('<TraveledDistanceCondition value="20"/>'), 3.0),
    ],
)
def test_while_braking(write, kind, expected):
    found = fires_at(write, condition(kind), more=(BRAKING,))
    assert found == (None if expected is None else pytest.approx(expected, abs=2e-3))


BESIDE = EGO_AT_START + private("Other", teleport(lane_position(60, lane=-2)))
"""Other stands 50 m ahead and 3.5 m to the right: 46 m and 1.5 m between the outlines."""


def timed(kind, value, rule="lessOrEqual", freespace="false", other="Other", more=""):
    """A time to collision or a time headway."""
    common = f'value="{value}" rule="{rule}" freespace="{freespace}" {more}'
    if kind == "headway":
        return f'<TimeHeadwayCondition entityRef="{other}" {common}/>'
    return (
        f"<TimeToCollisionCondition {common}><TimeToCollisionConditionTarget>"
        f'<EntityRef entityRef="{other}"/></TimeToCollisionConditionTarget></TimeToCollisionCondition>'
    )


LONGITUDINAL, LATERAL = 'relativeDistanceType="longitudinal"', 'relativeDistanceType="lateral"'


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        (relative_distance(3.6, "lessThan", "lateral", "false"), 0.0),
        (relative_distance(3.4, "lessThan", "lateral", "false"), None),
        (relative_distance(1.6, "lessThan", "lateral"), 0.0),
        (relative_distance(1.4, "lessThan", "lateral"), None),
        # 2.5 m between the corners: 2 m ahead and 1.5 m aside
        (relative_distance(2.5, kind="euclidianDistance"), 4.4),
        (relative_distance(12.5, kind="euclidianDistance", freespace="false"), 3.8),  # 12 m ahead
        # in a straight line, unless the file says otherwise: sqrt(19.69^2 + 3.5^2) = 20 m at 10 m/s
        (timed("headway", 2), 5 - math.sqrt(400 - 12.25) / 10),
        (timed("headway", 2, more=LONGITUDINAL), 3.0),
        (timed("headway", 0.34, more=LATERAL), None),
        (timed("headway", 0.36, more=LATERAL), 0.0),
        # distance d closes at 10 m/s * x / d: d^2 = x^2 + 12.25 = 1.6 s * 10 m/s * x
        (timed("collision", 1.6), 5 - (8 + math.sqrt(64 - 12.25)) / 10),
        (timed("collision", 1.6, more=LONGITUDINAL), 3.4),
        (timed("collision", 1.6, more=LONGITUDINAL, freespace="true"), 3.0),
        (timed("collision", 99, more=LATERAL), None),  # the lateral distance does not shrink
    ],
)
def test_beside_the_way(write, kind, expected):
    found = fires_at(write, condition(by_entity(kind)), init=BESIDE)
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-6))


AGAINST = '<Orientation type="relative" h="3.141592653589793"/>'
ACROSS = '<Orientation type="relative" h="1.5707963267948966"/>'
ONCOMING = EGO_AT_START + private("Other", teleport(lane_position(200, lane=-2, inner=AGAINST)), speed(5))
CROSSING = EGO_AT_START + private("Other", teleport(lane_position(200, offset=-50, inner=ACROSS)), speed(3))
LEAVING = EGO_AT_START + private("Other", teleport(lane_position(60)), speed(12))
REVERSING = private("Ego", teleport(lane_position(100)), speed(-2)) + private(
    "Other", teleport(lane_position(60))
)


def relative_speed(value, direction="", entity="Other"):
    """Within 0.01 m/s of a value."""
    way = f'direction="{direction}"' if direction else ""
    return tuple(
        condition(by_entity(f'<RelativeSpeedCondition entityRef="{entity}" value="{v}" rule="{r}" {way}/>'))
        for v, r in ((value - 0.01, "greaterThan"), (value + 0.01, "lessThan"))
    )


@pytest.mark.parametrize(
    ("init", "conditions", "expected"),
    [
        # two that drive towards each other: velocities add, speeds do not
        (ONCOMING, relative_speed(15, "longitudinal"), 0.0),
        (ONCOMING, relative_speed(5), 0.0),
        # one that crosses to the left: seen from the ego it moves with 3 m/s to the left
        (CROSSING, relative_speed(10, "longitudinal"), 0.0),
        (CROSSING, relative_speed(-3, "lateral"), 0.0),
        (CROSSING, relative_speed(0, "vertical"), 0.0),
        (CROSSING, relative_speed(7), 0.0),
        # in reverse the speed is 2 m/s, and -2 m/s in the direction of the car
        (REVERSING, relative_speed(2), 0.0),
        (REVERSING, relative_speed(-2, "longitudinal"), 0.0),
        (REVERSING, (condition(by_entity('<SpeedCondition value="1.9" rule="greaterThan"/>')),), 0.0),
        (
            REVERSING,
            (
                condition(
                    by_entity('<SpeedCondition value="1.9" rule="greaterThan" direction="longitudinal"/>')
                ),
            ),
            None,
        ),
        # nobody collides with one that drives away, not even late
        (LEAVING, (condition(by_entity(timed("collision", 1, "greaterThan"))),), None),
        (LEAVING, (condition(by_entity(timed("collision", 1, "lessThan"))),), None),
        # backwards towards a car 40 m behind: its front is 36 m behind the rear, or 18 s at 2 m/s
        (REVERSING, (condition(by_entity(timed("collision", 17, freespace="true"))),), 1.0),
    ],
)
def test_directions(write, init, conditions, expected):
    found = fires_at(write, *conditions, init=init)
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-6))


def test_standstill_after_braking(write):
    """The stop is noticed at the end of the step in which it happens."""
    found = fires_at(write, condition(by_entity('<StandStillCondition duration="0.5"/>')), more=(BRAKING,))
    assert found == pytest.approx(3.5, abs=CAPTURE)


ARC = (
    "<PrivateAction><RoutingAction><FollowTrajectoryAction><TimeReference><None/></TimeReference>"
    '<TrajectoryFollowingMode followingMode="position"/><TrajectoryRef>'
    '<Trajectory name="t" closed="false"><Shape>'
    '<ClothoidSpline><ClothoidSplineSegment length="30" curvatureStart="0.05" curvatureEnd="0.05"/>'
    "</ClothoidSpline>"
    "</Shape></Trajectory></TrajectoryRef></FollowTrajectoryAction></RoutingAction></PrivateAction>"
)
TURNING = private("Ego", teleport(lane_position(10)), speed(10), ARC) + OTHER_AHEAD
"""A circle of 20 m to the left at 10 m/s for 3 s: 0.5 rad/s, 5 m/s2 to the left."""


@pytest.mark.parametrize(
    ("kind", "expected"),
    [
        ('<AngleCondition angleType="heading" angle="1.0" angleTolerance="0.1"/>', 1.8),
        ('<AccelerationCondition value="4.9" rule="greaterThan" direction="lateral"/>', 0.0),
        ('<AccelerationCondition value="5.1" rule="greaterThan" direction="lateral"/>', None),
        ('<AccelerationCondition value="4.9" rule="greaterThan"/>', 0.0),
        ('<AccelerationCondition value="0.1" rule="greaterThan" direction="longitudinal"/>', None),
        ('<AccelerationCondition value="0.1" rule="greaterThan" direction="vertical"/>', None),
        ('<SpeedCondition value="0.1" rule="greaterThan" direction="lateral"/>', None),
    ],
)
def test_while_turning(write, kind, expected):
    found = fires_at(write, condition(by_entity(kind)), init=TURNING)
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-6))


@pytest.mark.parametrize(
    ("rule", "value", "holds"),
    [
        ("equalTo", "7", True),
        ("notEqualTo", "7", False),
        ("greaterThan", "6.5", True),
        ("greaterOrEqual", "7", True),
        ("lessThan", "7", False),
        ("lessOrEqual", "7", True),
    ],
)
def test_parameters_and_variables(write, rule, value, holds):
    parameter = by_value(f'<ParameterCondition parameterRef="p" rule="{rule}" value="{value}"/>')
    declared = '<ParameterDeclaration name="p" parameterType="double" value="7.0"/>'
    assert (fires_at(write, condition(parameter), parameters=declared) == 0.0) is holds
    variable = by_value(f'<VariableCondition variableRef="v" rule="{rule}" value="{value}"/>')
    both = "".join(
        f'<VariableDeclaration name="{n}" variableType="double" value="{v}"/>'
        for n, v in (("n", 0), ("v", 7))
    )
    assert (fires_at(write, condition(variable), variables=both) == 0.0) is holds


def test_texts_and_truth(write):
    declared = (
        '<ParameterDeclaration name="light" parameterType="string" value="Night"/>'
        '<ParameterDeclaration name="wet" parameterType="boolean" value="1"/>'
    )
    for name, value in (("light", "Night"), ("wet", "true")):
        kind = by_value(f'<ParameterCondition parameterRef="{name}" rule="equalTo" value="{value}"/>')
        assert fires_at(write, condition(kind), parameters=declared) == 0.0


def window(low, high):
    """Holds between two times."""
    return (
        condition(by_value(f'<SimulationTimeCondition value="{low}" rule="greaterOrEqual"/>')),
        condition(by_value(f'<SimulationTimeCondition value="{high}" rule="lessThan"/>')),
    )


TWO_S = by_value('<SimulationTimeCondition value="2" rule="greaterOrEqual"/>')
UNTIL_2_S = by_value('<SimulationTimeCondition value="2" rule="lessThan"/>')
FROM_START = by_value('<SimulationTimeCondition value="-1" rule="greaterThan"/>')


@pytest.mark.parametrize(
    ("kind", "edge", "delay", "expected"),
    [
        (TWO_S, "none", 0, 2.0),
        (TWO_S, "none", 1.5, 3.5),
        (TWO_S, "rising", 0, 2.0),
        (TWO_S, "rising", 1.5, 3.5),
        (TWO_S, "falling", 0, None),
        (TWO_S, "risingOrFalling", 0.25, 2.25),
        (UNTIL_2_S, "falling", 0, 2.0),
        (UNTIL_2_S, "risingOrFalling", 0, 2.0),
        (UNTIL_2_S, "none", 0.5, 0.5),
        (FROM_START, "rising", 0, None),  # it holds from the first look on: no edge
        (FROM_START, "none", 0, 0.0),
    ],
)
def test_edges_and_delays(write, kind, edge, delay, expected):
    found = fires_at(write, condition(kind, delay, edge))
    assert found == (None if expected is None else pytest.approx(expected, abs=1e-8))


def test_groups(write):
    """The conditions of a group hold together, an edge only at its instant; groups are alternatives."""
    assert fires_at(write, *window(3, 4)) == pytest.approx(3.0)
    early = condition(TWO_S, edge="rising")
    late = condition(by_value('<SimulationTimeCondition value="3" rule="greaterOrEqual"/>'))
    assert fires_at(write, early, late) is None
    assert fires_at(write, condition(TWO_S, 1.5, "rising"), late) == pytest.approx(3.5)
    either = (
        f"<StartTrigger><ConditionGroup>{late}</ConditionGroup>"
        f"<ConditionGroup>{early}</ConditionGroup></StartTrigger>"
    )
    path = write(act(maneuver(event("e", set_variable("n", 1), either))))
    engine = Engine(load(path))
    engine.advance(1.99)
    assert engine.world.variables["n"] == 0
    engine.advance(0.02)
    assert engine.world.variables["n"] == 1


def test_a_delayed_level_ends_later_too(write):
    """True from 2 s to 3 s, seen 1 s later: from 3 s to 4 s."""
    low = condition(by_value('<SimulationTimeCondition value="2" rule="greaterOrEqual"/>'), 1)
    high = condition(by_value('<SimulationTimeCondition value="3" rule="lessThan"/>'), 1)
    after = condition(by_value('<SimulationTimeCondition value="4.5" rule="greaterOrEqual"/>'))
    assert fires_at(write, low, high) == pytest.approx(3.0)
    assert fires_at(write, low, high, after) is None


def deleted(entity, when):
    gone = f'<EntityAction entityRef="{entity}"><DeleteEntityAction/></EntityAction>'
    start = trigger(condition(at_time(when)))
    action = f"<GlobalAction>{gone}</GlobalAction>"
    return act(maneuver(event("gone", action, start), name="gone"), actors=entity, name="deletes")


def fires_without(write, inner, entity, edge="none", rule="any", who=("Ego",), delay=0.0, later=()):
    """When a condition on an entity that is deleted at 1 s is seen by an event that waits for 2 s."""
    first = condition(by_entity(inner, *who, rule=rule), delay, edge)
    path = write(
        act(maneuver(event("e", set_variable("n", 1), trigger(first, condition(at_time(2)))))),
        deleted(entity, 1),
        *later,
    )
    engine = Engine(load(path))
    engine.run()
    return engine.world.variables["n"] == 1


HOLDS_ON_ANYBODY = {
    "speed": '<SpeedCondition value="-1" rule="greaterThan"/>',
    "acceleration": '<AccelerationCondition value="100" rule="lessThan"/>',
    "travelled": '<TraveledDistanceCondition value="0"/>',
    "angle": '<AngleCondition angleType="heading" angle="0" angleTolerance="4"/>',
    "reach": f'<ReachPositionCondition tolerance="1e4">{lane_position(50)}</ReachPositionCondition>',
    "standstill": '<StandStillCondition duration="0"/>',
}
TO_OTHER = {
    "distance": relative_distance(1e4),
    "lateral": relative_distance(1e4, kind="lateral", freespace="false"),
    "apart": relative_distance(0.0, rule="greaterOrEqual"),
    "relative speed": '<RelativeSpeedCondition entityRef="Other" value="-1e3" rule="greaterThan"/>',
    "headway": '<TimeHeadwayCondition entityRef="Other" value="1e4" rule="lessThan" freespace="true" '
    'alongRoute="false"/>',
    "ttc": '<TimeToCollisionCondition value="1e4" rule="lessThan" freespace="true" alongRoute="false">'
    '<TimeToCollisionConditionTarget><EntityRef entityRef="Other"/></TimeToCollisionConditionTarget>'
    "</TimeToCollisionCondition>",
    "reach": '<ReachPositionCondition tolerance="1e4"><Position><RelativeObjectPosition entityRef="Other" '
    'dx="0" dy="0"/></Position></ReachPositionCondition>',
}


@pytest.mark.parametrize("name", HOLDS_ON_ANYBODY)
def test_nothing_holds_on_one_that_is_deleted(write, name):
    inner = HOLDS_ON_ANYBODY[name]
    assert not fires_without(write, inner, "Other", who=("Other",))
    assert not fires_without(write, inner, "Other", who=("Other",), rule="all")
    if name != "standstill":  # Ego moves
        assert fires_without(write, inner, "Other", who=("Ego", "Other"))
        assert not fires_without(write, inner, "Other", who=("Ego", "Other"), rule="all")
    for edge in ("rising", "falling", "risingOrFalling"):
        assert not fires_without(write, inner, "Other", edge=edge, who=("Other",))


@pytest.mark.parametrize("name", TO_OTHER)
def test_nothing_holds_towards_one_that_is_deleted(write, name):
    for who in (("Ego",), ("Ego", "Ego")):
        for rule in ("any", "all"):
            assert not fires_without(write, TO_OTHER[name], "Other", who=who, rule=rule)


def edge_fires(write, inner, edge, who=("Ego",), delay=0.0, deletion_s=1):
    path = write(
        act(
            maneuver(
                event("e", set_variable("n", 1), trigger(condition(by_entity(inner, *who), delay, edge)))
            )
        ),
        deleted("Other", deletion_s),
    )
    engine = Engine(load(path))
    engine.run()
    return engine.world.variables["n"] == 1


@pytest.mark.parametrize("name", TO_OTHER)
def test_a_deletion_is_no_edge(write, name):
    for edge in ("rising", "falling", "risingOrFalling"):
        for delay in (0.0, 0.5):
            assert not edge_fires(write, TO_OTHER[name], edge, delay=delay)
            assert not edge_fires(write, HOLDS_ON_ANYBODY["speed"], edge, ("Ego", "Other"), delay)


def test_a_collision_with_one_that_is_deleted_does_not_happen(write):
    """They would meet at 4.6 s."""
    touch = '<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>'
    assert fires_at(write, condition(by_entity(touch))) == pytest.approx(4.6, abs=1e-6)
    assert edge_fires(write, touch, "none", deletion_s=9)
    assert not edge_fires(write, touch, "none")


def test_a_place_off_the_road_is_refused_before_the_run(write):
    reach = f'<ReachPositionCondition tolerance="1">{lane_position(400)}</ReachPositionCondition>'
    event_later = event(
        "e", set_variable("n", 1), trigger(condition(by_entity(reach)), condition(at_time(5)))
    )
    late = act(maneuver(event_later), start=trigger(condition(at_time(4))))
    with pytest.raises(RunError, match=r"s = 400 m is off road 'A'"):
        Engine(load(write(late)))


def test_a_place_that_moves_is_reached_where_it_is(write):
    """20 m behind Other, which drives off at 2 m/s at 1 s: 10 + 10 t = 40 + 2 (t - 1) - 0.1."""
    off = act(maneuver(event("off", speed(2), trigger(condition(at_time(1)))), name="off"), name="second")
    position = '<Position><RelativeObjectPosition entityRef="Other" dx="-20" dy="0"/></Position>'
    reach = f'<ReachPositionCondition tolerance="0.1">{position}</ReachPositionCondition>'
    assert fires_at(write, condition(by_entity(reach)), more=(off,)) == pytest.approx(27.9 / 8, abs=1e-6)
