"""Distances and angles in each coordinate system, by closed forms on a bend.

Road A bends to the left with a radius of 100 m; its lanes -1 and -2 lie outside, their middles 101.75 m and
105.25 m from the centre. The entities are 50 m apart by s, half a radian.
"""

import math

import pytest

from scenarios.openscenario import Engine, load
from scenarios.openscenario.running.driving.separation import Separation, overhang_m
from tests.scenarios.openscenario.conftest import (
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
from tests.scenarios.openscenario.motion.test_trajectories import follow, polyline, world

RADIUS_M, OWN_M, BESIDE_M, PHI = 100.0, 101.75, 105.25, 0.5
STOP_AT_20_S = trigger(condition(at_time(20)), kind="StopTrigger")


@pytest.fixture
def bend(write):
    """A scenario on the bend."""

    def make(*acts, init, stop=STOP_AT_20_S):
        path = write(*acts, init=init, stop=stop)
        straight = road("A", 0, 0, 0, 500, "", "")
        text = straight.replace("<line/>", f'<arc curvature="{1 / RADIUS_M}"/>')
        header = '<OpenDRIVE><header revMajor="1" revMinor="6"/>'
        (path.parent / "two_roads.xodr").write_text(f"{header}{text}</OpenDRIVE>", encoding="utf-8")
        return path

    return make


def pair(lane=-1, v=10.0):
    return private("Ego", teleport(lane_position(10)), speed(v)) + private(
        "Other", teleport(lane_position(60, lane=lane)), speed(v)
    )


@pytest.mark.parametrize(
    ("system", "lane", "ahead", "left"),
    [
        ("entity", -1, OWN_M * math.sin(PHI), OWN_M * (1 - math.cos(PHI))),
        ("entity", -2, BESIDE_M * math.sin(PHI), BESIDE_M * math.cos(PHI) - OWN_M),
        ("road", -1, RADIUS_M * PHI, 0.0),
        ("road", -2, RADIUS_M * PHI, 3.5),
        ("lane", -1, OWN_M * PHI, 0.0),
        ("lane", -2, OWN_M * PHI, 3.5),
        ("trajectory", -1, math.nan, math.nan),
    ],
)
def test_distances_on_a_bend(bend, system, lane, ahead, left):
    engine = Engine(load(bend(init=pair(lane))))
    ego, other = engine.world.actors["Ego"], engine.world.actors["Other"]
    for a, b in ((ego, other), (other, ego)) if lane == -1 else ((ego, other),):
        separation = Separation(engine.world, a, b, system)
        states = a.state(0.0), b.state(0.0)
        assert separation.between_m(*states, False, False) == pytest.approx(ahead, abs=2e-4, nan_ok=True)
        assert separation.between_m(*states, True, False) == pytest.approx(abs(left), abs=2e-4, nan_ok=True)


@pytest.mark.parametrize(("system", "metres"), [("road", RADIUS_M), ("lane", OWN_M)])
def test_free_space_on_a_bend_counts_outlines_along_it(bend, system, metres):
    """Front 3.5 m ahead of the reference point, rear 0.5 m behind it; both head along the bend."""
    engine = Engine(load(bend(init=pair())))
    ego, other = engine.world.actors["Ego"], engine.world.actors["Other"]
    separation = Separation(engine.world, ego, other, system)
    states = ego.state(0.0), other.state(0.0)
    assert separation.between_m(*states, False, True) == pytest.approx(metres * PHI - 4.0, abs=2e-4)
    assert separation.between_m(*states, True, True) == pytest.approx(-2.0, abs=2e-4)


def test_outlines_that_head_across_an_axis(bend):
    """A car of 4 m by 2 m, its middle 1.5 m ahead of its reference point."""
    actor = Engine(load(bend(init=pair()))).world.actors["Ego"]
    assert overhang_m(actor, 0.0, False) == pytest.approx((0.5, 3.5))
    assert overhang_m(actor, math.pi, False) == pytest.approx((3.5, 0.5))
    assert overhang_m(actor, math.pi / 2, False) == pytest.approx((1.0, 1.0))
    assert overhang_m(actor, math.pi / 2, True) == pytest.approx((0.5, 3.5))
    half = 2.0 * math.sqrt(0.5) + 1.0 * math.sqrt(0.5)
    middle = 1.5 * math.sqrt(0.5)
    assert overhang_m(actor, math.pi / 4, False) == pytest.approx((half - middle, half + middle))


def keep(system, limits=""):
    inner = f"<DynamicConstraints {limits}/>" if limits else ""
    return (
        '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Ego" distance="30" '
        f'freespace="false" continuous="true" coordinateSystem="{system}">{inner}'
        "</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"
    )


@pytest.mark.parametrize("limits", ["", 'maxAcceleration="3" maxDeceleration="5"'])
@pytest.mark.parametrize(
    ("system", "angle"),
    [("entity", math.asin(30 / OWN_M)), ("road", 30 / RADIUS_M), ("lane", 30 / OWN_M)],
)
def test_a_distance_is_kept_in_its_coordinates(bend, system, angle, limits):
    """Who trails by 30 m on the bend is behind by the angle at which that is 30 m, as fast as the other."""
    init = private("Ego", teleport(lane_position(90)), speed(10)) + private(
        "Other", teleport(lane_position(40)), speed(10)
    )
    engine = Engine(load(bend(act(maneuver(event("e", keep(system, limits)))), init=init)))
    run = engine.run()
    ego, other = at(run, "Ego", 19.0), at(run, "Other", 19.0)
    assert math.remainder(ego[2] - other[2], 2 * math.pi) == pytest.approx(angle, abs=2e-4)
    assert other[3] == pytest.approx(10.0, abs=0.01)
    assert math.hypot(other[0], other[1] - RADIUS_M) == pytest.approx(OWN_M, abs=1e-3)


@pytest.mark.parametrize("limits", ["", '<DynamicConstraints maxAcceleration="4" maxDeceleration="4"/>'])
@pytest.mark.parametrize("system", ["road", "lane"])
@pytest.mark.parametrize("turned", [1.57, 1.6, -1.57])
def test_who_stands_across_its_lane_goes_along_it(bend, system, limits, turned):
    """As a bicycle on a car's carrier: 50 m behind by s (by the lane), and across the lane as it was put."""
    behind = (
        '<PrivateAction><LongitudinalAction><LongitudinalDistanceAction entityRef="Other" freespace="false" '
        f'distance="{50 if system == "road" else PHI * OWN_M}" continuous="true" coordinateSystem="{system}">'
        f"{limits}</LongitudinalDistanceAction></LongitudinalAction></PrivateAction>"
    )
    across = teleport(lane_position(5, inner=f'<Orientation type="relative" h="{turned}"/>'))
    init = private("Other", teleport(lane_position(60)), speed(10)) + private("Ego", across, behind)
    run = Engine(load(bend(init=init))).run(20.0)
    x, y, yaw, _ = at(run, "Ego", 18.0)
    angle = (60 + 18 * 10 / OWN_M * RADIUS_M) / RADIUS_M - PHI
    assert (x, y) == pytest.approx(
        (OWN_M * math.sin(angle), RADIUS_M - OWN_M * math.cos(angle)), abs=0.02 if limits else 1e-3
    )
    assert math.remainder(yaw - angle - turned, 2 * math.pi) == pytest.approx(0.0, abs=1e-3)


def test_a_distance_along_an_axis_that_the_other_crosses_is_noted(bend):
    init = private("Ego", teleport(lane_position(150)), speed(0)) + private(
        "Other", teleport(lane_position(10)), speed(5)
    )
    limits = 'maxAcceleration="3" maxDeceleration="5"'
    engine = Engine(load(bend(act(maneuver(event("e", keep("entity", limits)))), init=init)))
    engine.advance(0.1)
    assert sum("measured along its own x axis" in note for note in engine.notes) == 1


def test_a_distance_along_a_trajectory_and_without_one(write):
    """The trajectory heads north-east from (0, 20); the other stands at (70, 80): 130/sqrt(2) along it."""
    line = follow(polyline((0, 20), (200, 220)))
    init = private("Ego", teleport(world(0, 20)), speed(10), line) + private("Other", teleport(world(70, 80)))
    inner = (
        '<RelativeDistanceCondition entityRef="Other" value="{}" rule="lessThan" freespace="false" '
        'relativeDistanceType="{}" coordinateSystem="trajectory"/>'
    )
    starts = [
        trigger(condition(by_entity(inner.format(v, k)))) for v, k in ((50, "longitudinal"), (7.1, "lateral"))
    ]
    acts = act(
        *(maneuver(event("e", set_variable("n", 1), start), name=f"m{k}") for k, start in enumerate(starts))
    )
    engine = Engine(load(write(acts, init=init)))
    events = [element for element in engine.storyboard.elements if element.kind == "event"]
    assert events[1].state == "completeState"  # 10 / sqrt(2) to the side, all the time
    while events[0].state != "completeState":
        engine.advance()
    assert engine.time_s == pytest.approx((130 / math.sqrt(2) - 50) / 10, abs=0.011)
    still = Engine(load(write(acts, init=pair())))
    still.advance(0.1)
    assert any("follows none" in note for note in still.notes)


def angle_event(inner, write_bend, init):
    start = trigger(condition(by_entity(inner)))
    stop = trigger(condition(at_time(11)), kind="StopTrigger")
    path = write_bend(act(maneuver(event("e", set_variable("n", 1), start))), init=init, stop=stop)
    engine = Engine(load(path))
    element = next(e for e in engine.storyboard.elements if e.kind == "event")
    while element.state != "completeState" and not engine.over:
        engine.advance()
    return engine.time_s


@pytest.mark.parametrize(
    ("inner", "time_s"),
    [
        # the ego drives round at 10 m/s; the other stands half a radian ahead: angles meet after 0.5 r / v
        ('<RelativeAngleCondition entityRef="Other" {} angle="-0.1" {}/>', 0.4 * OWN_M / 10),
        (
            '<RelativeAngleCondition entityRef="Other" {} angle="-0.1" {} coordinateSystem="world"/>',
            0.4 * OWN_M / 10,
        ),
        # along the road both have no angle
        ('<RelativeAngleCondition entityRef="Other" {} angle="0" {} coordinateSystem="road"/>', 0.0),
        ('<RelativeAngleCondition entityRef="Other" {} angle="-0.1" {} coordinateSystem="lane"/>', 11.0),
        # absolute: 0.1 rad at the start, 1 rad after 0.9 r / v
        ('<AngleCondition {} angle="1" {}/>', 0.9 * OWN_M / 10),
        ('<AngleCondition {} angle="0" {} coordinateSystem="road"/>', 0.0),
        ('<AngleCondition {} angle="0" {} coordinateSystem="lane"/>', 0.0),
        ('<AngleCondition {} angle="0" {} coordinateSystem="trajectory"/>', 11.0),
    ],
)
def test_angles(bend, inner, time_s):
    init = private("Ego", teleport(lane_position(10)), speed(10)) + private(
        "Other", teleport(lane_position(60))
    )
    text = inner.format('angleType="heading"', 'angleTolerance="1e-6"')
    assert angle_event(text, bend, init) == pytest.approx(time_s, abs=0.011)


def test_a_lane_that_leaves_its_road_is_measured_along_itself(tmp_path, write):
    """Lane -2 beside one that widens by 10 m over 100 m is 100 sqrt(1.01) m long, and goes across by 10 m."""
    path = write()
    text = road("A", 0, 0, 0, 300, "", "").replace(
        '<lane id="-1" type="driving"><link></link><width sOffset="0" a="3.5" b="0" c="0" d="0"/>',
        '<lane id="-1" type="driving"><link></link><width sOffset="0" a="3.5" b="0.1" c="0" d="0"/>',
    )
    header = '<OpenDRIVE><header revMajor="1" revMinor="6"/>'
    (path.parent / "two_roads.xodr").write_text(f"{header}{text}</OpenDRIVE>", encoding="utf-8")
    init = private("Ego", teleport(lane_position(50, lane=-2)), speed(0)) + private(
        "Other", teleport(lane_position(150, lane=-2)), speed(0)
    )
    path.write_text(
        path.read_text(encoding="utf-8").replace(
            path.read_text(encoding="utf-8").split("<Actions>")[1].split("</Actions>")[0], init
        ),
        encoding="utf-8",
    )
    engine = Engine(load(path))
    ego, other = engine.world.actors["Ego"], engine.world.actors["Other"]
    states = ego.state(0.0), other.state(0.0)
    for system, metres in (("lane", 100 * math.sqrt(1.01)), ("road", 100.0)):
        got = Separation(engine.world, ego, other, system).between_m(*states, False, False)
        assert got == pytest.approx(metres, abs=1e-6)
    across = Separation(engine.world, ego, other, "road").between_m(*states, True, False)
    assert across == pytest.approx(10.0, abs=1e-6)
