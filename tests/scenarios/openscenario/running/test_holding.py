"""What holds for less than a step is found, whatever the step. Times follow from the geometry."""

import math
import random
from dataclasses import replace

import pytest

from scenarios.openscenario import Engine, load
from scenarios.openscenario import model as m
from tests.scenarios.openscenario.conftest import (
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
    write_scenario,
)

STEPS_S = [0.002, 0.01, 0.1]


def world(x, y, heading=0.0):
    return f'<Position><WorldPosition x="{x}" y="{y}" h="{heading}"/></Position>'


PASSING = private("Ego", teleport(lane_position(10)), speed(20)) + private(
    "Other", teleport(lane_position(60, lane=-2))
)
"""Ego passes Other, which stands 50 m ahead and 3.5 m to the right, at 20 m/s."""

ACROSS = private("Ego", teleport(world(0, -50, math.pi / 2)), speed(20)) + private(
    "Other", teleport(lane_position(60, lane=-2))
)
"""Ego crosses the line y = -5.25 along which Other heads, 60 m behind it."""

CORNERS = private("Ego", teleport(world(0, 50)), speed(20)) + private(
    "Other", teleport(world(18, 26.02, math.pi / 2)), speed(20)
)
"""Two cars at right angles, as fast as each other. Ego's rear leaves the lane of Other, x = 17 to 19, after
0.975 s; Other's front, 3.5 m ahead of its rear axle, reaches Ego's right side, y = 49, after 0.974 s."""


class Clocked(dict):
    """Variables that know when they were set."""

    def __init__(self, engine):
        super().__init__(engine.world.variables)
        self.engine, self.set_s = engine, []

    def __setitem__(self, name, value):
        self.set_s.append(self.engine.time_s)
        super().__setitem__(name, value)


def triggered_s(write, init, inner, step_s, delay=0.0, edge="none", also=()):
    """When an event starts that waits for a condition, as often as it does."""
    waits = event("waits", set_variable("n", 1), trigger(condition(inner, delay, edge)), count=9)
    engine = Engine(load(write(act(maneuver(waits)), *also, init=init)), step_s=step_s)
    clock = engine.world.variables = Clocked(engine)
    while not engine.over:
        engine.advance()
    return clock.set_s


def relative_distance(kind, value, rule="lessThan", freespace="false", entity="Other"):
    return (
        f'<RelativeDistanceCondition entityRef="{entity}" relativeDistanceType="{kind}" value="{value}" '
        f'freespace="{freespace}" rule="{rule}"/>'
    )


def timed(name, value, rule="lessThan"):
    if name == "TimeHeadwayCondition":
        return f'<{name} entityRef="Other" value="{value}" freespace="false" rule="{rule}"/>'
    return (
        f'<{name} value="{value}" freespace="false" rule="{rule}"><TimeToCollisionConditionTarget>'
        f'<EntityRef entityRef="Other"/></TimeToCollisionConditionTarget></{name}>'
    )


NEAR_M = math.sqrt(3.501**2 - 3.5**2)
"""Ahead or behind, 3.501 m away: for 8.4 ms."""

BRIEF = {
    "reach": (
        PASSING,
        by_entity(f'<ReachPositionCondition tolerance="0.05">{lane_position(50)}</ReachPositionCondition>'),
        (40 - 0.05) / 20,
    ),
    "straight": (PASSING, by_entity(relative_distance("euclidianDistance", 3.501)), (50 - NEAR_M) / 20),
    "ahead": (PASSING, by_entity(relative_distance("longitudinal", 0.05)), (50 - 0.05) / 20),
    "aside": (
        ACROSS,
        by_entity(relative_distance("lateral", 0.05, entity="Ego"), "Other"),
        (44.75 - 0.05) / 20,
    ),
    "outlines": (
        CORNERS,
        by_entity(relative_distance("euclidianDistance", 0.01, freespace="true")),
        0.974 - 0.01 / 20,
    ),
    "ttc": (
        PASSING,
        by_entity(timed("TimeToCollisionCondition", 0.3501)),
        (50 - 3.501 - NEAR_M) / 20,
    ),
    "headway": (PASSING, by_entity(timed("TimeHeadwayCondition", 3.501 / 20)), (50 - NEAR_M) / 20),
    "time": (PASSING, by_value('<SimulationTimeCondition value="1.2345" rule="equalTo"/>'), 1.2345),
    "passed": (PASSING, by_entity(relative_distance("longitudinal", 12.3, "equalTo")), (50 - 12.3) / 20),
}


TOUCH = '<CollisionCondition><EntityRef entityRef="Other"/></CollisionCondition>'


@pytest.mark.parametrize("step_s", STEPS_S)
@pytest.mark.parametrize("name", BRIEF)
def test_what_holds_for_less_than_a_step_is_found(write, name, step_s):
    init, inner, expected = BRIEF[name]
    found = triggered_s(write, init, inner, step_s, edge="rising")
    assert found[0] == pytest.approx(expected, abs=1e-6)
    assert len(found) == (2 if name == "passed" else 1)  # before and behind Other


@pytest.mark.parametrize("step_s", STEPS_S)
def test_edges_and_delays_of_what_is_brief(write, step_s):
    """5 cm around a place at 20 m/s: 5 ms."""
    reach = BRIEF["reach"][1]
    rises, falls = (40 - 0.05) / 20, (40 + 0.05) / 20
    for edge, delay, expected in (
        ("rising", 0.0, [rises]),
        ("falling", 0.0, [falls]),
        ("risingOrFalling", 0.3, [rises + 0.3, falls + 0.3]),
        ("falling", 0.3, [falls + 0.3]),
    ):
        found = triggered_s(write, PASSING, reach, step_s, delay, edge)
        assert found == pytest.approx(expected, abs=1e-6), edge
    assert triggered_s(write, PASSING, reach, step_s, 0.3)[0] == pytest.approx(rises + 0.3, abs=1e-6)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_brief_overlap_is_a_collision(write, step_s):
    found = triggered_s(write, CORNERS, by_entity(TOUCH), step_s, edge="risingOrFalling")
    assert found == pytest.approx([0.974, 0.975], abs=1e-6)


def ego_does(*events):
    """An act of Ego's."""
    return (act(maneuver(*events), actors="Ego", name="moves"),)


def later(seconds):
    return trigger(condition(at_time(seconds)))


def own(name, value, rule):
    return by_entity(f'<{name} value="{value}" rule="{rule}"/>')


@pytest.mark.parametrize("step_s", STEPS_S)
@pytest.mark.parametrize(
    ("inner", "expected"),
    [
        # from 10 to 12 m/s within 4 ms and back as quickly
        (own("SpeedCondition", 11.9, "greaterThan"), 1.0 + 0.004 * 0.95),
        (own("SpeedCondition", 11, "equalTo"), 1.002),
        (own("AccelerationCondition", 450, "greaterThan"), 1.0),
        (
            by_entity('<RelativeSpeedCondition entityRef="Other" value="11.5" rule="greaterThan"/>'),
            1.003,
        ),
    ],
)
def test_a_peak_of_the_speed_is_found(write, inner, expected, step_s):
    init = PASSING + private("Ego", speed(10))
    after = trigger(
        condition(
            by_value(
                '<StoryboardElementStateCondition storyboardElementType="event" '
                'storyboardElementRef="up" state="completeState"/>'
            )
        )
    )
    moves = ego_does(
        event("up", speed(12, "linear", "time", 0.004), later(1)),
        event("down", speed(10, "linear", "time", 0.004), after),
    )
    found = triggered_s(write, init, inner, step_s, edge="rising", also=moves)
    assert found[0] == pytest.approx(expected, abs=1e-6)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_who_turns_round_stands_for_a_moment(write, step_s):
    """From 5 to -5 m/s by 10 m/s2: slower than 0.01 m/s for 2 ms."""
    init = PASSING + private("Ego", speed(5))
    moves = ego_does(event("back", speed(-5, "linear", "rate", 10), later(1)))
    inner = own("SpeedCondition", 0.01, "lessThan")
    found = triggered_s(write, init, inner, step_s, edge="rising", also=moves)
    assert found == pytest.approx([1.0 + 4.99 / 10], abs=1e-6)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_heading_that_is_had_for_a_moment_is_found(write, step_s):
    """Along a line with a kink of 0.1 m to the left at x = 30, driven through within 5 ms."""
    corners = ((10, 0), (30, 0), (30 + 0.1 * math.cos(0.5), 0.1 * math.sin(0.5)), (80, 0.1 * math.sin(0.5)))
    vertices = "".join(f"<Vertex>{world(x, y)}</Vertex>" for x, y in corners)
    line = (
        "<PrivateAction><RoutingAction><FollowTrajectoryAction><TimeReference><None/></TimeReference>"
        '<TrajectoryFollowingMode followingMode="position"/><TrajectoryRef><Trajectory name="t" '
        f'closed="false"><Shape><Polyline>{vertices}</Polyline></Shape></Trajectory></TrajectoryRef>'
        "</FollowTrajectoryAction></RoutingAction></PrivateAction>"
    )
    init = PASSING + private("Ego", line)
    inner = by_entity('<AngleCondition angleType="heading" angle="0.5" angleTolerance="0.01"/>')
    assert triggered_s(write, init, inner, step_s, edge="rising") == pytest.approx([1.0], abs=1e-6)


@pytest.mark.parametrize("step_s", STEPS_S)
def test_a_standstill_is_counted_from_the_instant_of_the_stop(write, step_s):
    """From 10 m/s by 3 m/s2 from 1 s on: it stands from 4.3333 s on, and for 1.5 s at 5.8333 s."""
    init = PASSING + private("Ego", speed(10))
    moves = ego_does(event("stop", speed(0, "linear", "rate", 3), later(1)))
    inner = by_entity('<StandStillCondition duration="1.5"/>')
    found = triggered_s(write, init, inner, step_s, edge="rising", also=moves)
    assert found == pytest.approx([1 + 10 / 3 + 1.5], abs=1e-6)


# ---- random scenes ---------------------------------------------------------------------------------------


def any_condition(r):
    """A condition of Ego's towards B, or on itself."""
    kind = r.choice(("longitudinal", "lateral", "euclidianDistance"))
    rule = r.choice(("lessThan", "greaterThan", "equalTo", "lessOrEqual", "greaterOrEqual"))
    free = r.random() < 0.5
    places = (
        m.RelativeObjectPosition("B", r.uniform(-10, 10), r.uniform(-5, 5), m.Orientation()),
        m.WorldPosition(r.uniform(0, 60), r.uniform(-20, 20), 0.0),
    )
    along = r.choice((None, "longitudinal", "lateral"))
    return r.choice(
        (
            m.CollisionCondition("B"),
            m.RelativeDistanceCondition("B", rule, r.uniform(0, 15), kind, free),
            m.TimeToCollisionCondition("B", rule, r.uniform(0.05, 3), kind, free),
            m.TimeHeadwayCondition("B", rule, r.uniform(0.05, 3), kind, free),
            m.ReachPositionCondition(r.choice(places), r.uniform(0.02, 2)),
            m.RelativeSpeedCondition("B", rule, r.uniform(-15, 15), along),
            m.SpeedCondition(rule, r.uniform(-5, 20), None),
            m.AngleCondition(r.uniform(-3, 3), r.uniform(0.005, 0.3)),
            m.TraveledDistanceCondition(r.uniform(0, 80)),
            m.StandStillCondition(r.uniform(0, 2)),
        )
    )


def any_line(r, name):
    x, y, heading = r.uniform(-20, 20), r.uniform(-20, 20), r.uniform(-3, 3)
    vertices = []
    for _ in range(r.randrange(2, 9)):
        vertices.append(m.Vertex(m.WorldPosition(x, y, 0.0), None))
        length = r.uniform(0.05, 30)
        heading += r.uniform(-0.8, 0.8)
        x, y = x + length * math.cos(heading), y + length * math.sin(heading)
    return m.FollowTrajectoryAction(m.Trajectory(name, m.Polyline(tuple(vertices))), 0.0, None)


def at_once(name, action, kind, edge="none", delay=0.0):
    started = ((m.Condition("c", delay, edge, kind),),)
    actor = () if isinstance(action, m.ModifyVariableAction) else ("Ego",)
    return m.Event(name, "parallel", 5, (m.NamedAction("a", action, actor),), started)


def any_scene(r, base):
    """Two cars near each other, straight on or along lines with corners, that change their speeds."""
    sizes = [(r.uniform(0.5, 6), r.uniform(0.4, 2.5), 1.5, r.uniform(0, 1.5), 0.0) for _ in range(2)]
    cars = tuple(
        m.EntityDefinition(n, "car", "car", *size) for n, size in zip(("Ego", "B"), sizes, strict=True)
    )
    init = []
    for name in ("Ego", "B"):
        place = m.WorldPosition(r.uniform(-9, 9), 100 + r.uniform(-9, 9), r.uniform(-3, 3))
        init.append((name, m.TeleportAction(place) if r.random() < 0.5 else any_line(r, name)))
        init.append((name, m.SpeedAction("step", "time", 0.0, r.uniform(-3, 20))))
    edges = ("rising", "falling", "risingOrFalling")
    counts = m.ModifyVariableAction("n", "add", 1.0)
    events = [
        at_once(
            f"w{k}",
            counts,
            m.EntityCondition(("Ego",), False, any_condition(r)),
            r.choice(edges),
            r.choice((0.0, 0.37)),
        )
        for k in range(3)
    ]
    shapes = ("step", "linear", "cubic", "sinusoidal")
    for k in range(2):
        change = m.SpeedAction(r.choice(shapes), "time", r.choice((0.003, 0.5, 2.0)), r.uniform(-3, 20))
        when = m.SimulationTimeCondition("greaterOrEqual", r.uniform(0, 4))
        events.append(replace(at_once(f"s{k}", change, when), max_executions=1))
    group = m.ManeuverGroup("g", 1, (m.Maneuver("m", tuple(events)),))
    story = m.Story("s", (m.Act("a", (group,), None, None),))
    return replace(base, entities=cars, init=tuple(init), stories=(story,))


def what_happens(definition, step_s):
    engine = Engine(definition, step_s=step_s)
    clock = engine.world.variables = Clocked(engine)
    while not engine.over and engine.time_s < 6.0 - 1e-9:
        engine.advance(min(step_s, 6.0 - engine.time_s))
    return clock.set_s, engine.contact.time_s if engine.contact else math.inf


@pytest.mark.parametrize("seed", range(16))
def test_the_step_decides_nothing_in_random_scenes(tmp_path, seed):
    scene = any_scene(random.Random(seed), load(write_scenario(tmp_path)))
    (coarse, touched), (fine, touched_fine) = what_happens(scene, 0.05), what_happens(scene, 0.0017)
    assert coarse == pytest.approx(fine, abs=1e-5)
    assert touched == pytest.approx(touched_fine, abs=1e-5)
