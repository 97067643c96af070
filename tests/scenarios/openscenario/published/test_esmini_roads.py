"""Lanes, controllers' actions, trajectories and parking in esmini's files, by the numbers in each."""

import math

import numpy as np
import pytest
from scipy.integrate import quad

from tests.scenarios.openscenario.published.conftest import Lane, ramp

ESMINI = "esmini/resources/xosc"


def off_m(played, name, lane, s_m):
    """(T,) distance of an entity from these s of a lane."""
    x, y, _, _ = played.of(name)
    return np.hypot(*(np.column_stack((x, y)) - lane.points(s_m)).T)


def cubic(part):
    """What a cubic change has done after a share of its time."""
    part = np.clip(part, 0, 1)
    return part**2 * (3 - 2 * part)


def test_five_cars_through_tunnels(published):
    """At 50 and 30 km/h on two roads of bends, in both directions, until one has left its road."""
    played = published(f"{ESMINI}/tunnels.xosc")
    t = played.time_s
    for name, road, lane_id, s, kmh in (
        ("Car1", "1", -1, 10, 50),
        ("Car2", "1", 1, 570, 50),
        ("Car3", "1", 1, 280, 50),
        ("Car4", "2", -1, 10, 30),
        ("Car5", "2", 1, 280, 30),
    ):
        lane = Lane(played.network, road, lane_id)
        way = kmh / 3.6 * t
        ahead = lane.length_m(580 if road == "1" else 300) - lane.length_m(s)
        on_road = way < (ahead if lane_id < 0 else lane.length_m(s)) - 0.1
        assert off_m(played, name, lane, lane.s_after(s, -lane_id * way))[on_road].max() < 5e-3, name
        np.testing.assert_allclose(played.of(name)[3][on_road], kmh / 3.6, atol=1e-9)
    lane = Lane(played.network, "1", -1)
    end_s = (lane.length_m(580) - lane.length_m(10)) / (50 / 3.6) + 3
    assert played.run.end_time_s == pytest.approx(end_s, abs=2e-3)


@pytest.mark.parametrize("mps", [12.0, 15.0])
def test_overtaking_where_a_lane_begins(published, mps):
    """15 m behind; from s = 125 m on there is a lane to the left; 20 m ahead of the other it goes back."""
    played = published(f"{ESMINI}/two_plus_one_road.xosc", {"InitialSpeed": mps})
    t = played.time_s
    ego_x, ego_y, _, _ = played.of("Ego")
    np.testing.assert_allclose(ego_x, 70 + mps * t, atol=1e-6)
    np.testing.assert_allclose(ego_y, -1.75, atol=1e-6)
    starts_s = (125 - 55) / mps
    x, y, _, speed = played.of("Target")
    np.testing.assert_allclose(speed, ramp(t, (starts_s, 10 / 3, mps + 10), v0=mps)[1], atol=0.04)
    # its own speed, and not that along the road, is what the scenario asks for
    chords = np.hypot(np.diff(x), np.diff(y))
    np.testing.assert_allclose(chords, 0.5 * (speed[1:] + speed[:-1]) * np.diff(t), atol=2e-3)
    back = int(np.flatnonzero(x - ego_x > 20)[0])
    back_s = t[back - 1] + 0.01 * (20 - (x - ego_x)[back - 1]) / ((x - ego_x)[back] - (x - ego_x)[back - 1])
    assert played.run.end_time_s == pytest.approx(back_s + 7, abs=0.011)
    # the middle of the new lane is at y = 1.75 m once it has its width, at s = 175 m
    before = t <= starts_s
    np.testing.assert_allclose(y[before], -1.75, atol=1e-6)
    beside = (t > starts_s + 3.5) & (t < back_s) & (x > 175)
    np.testing.assert_allclose(y[beside], 1.75, atol=1e-3)
    returning = t > back_s + 0.01
    np.testing.assert_allclose(y[returning], 1.75 - 3.5 * cubic((t[returning] - back_s) / 2.5), atol=0.01)


def test_lane_changes_beside_a_reference(published):
    """Steps, a line, a sine and a cubic of 2 s, and three speeds, each after the one before."""
    played = published(f"{ESMINI}/follow_reference.xosc")
    t = played.time_s
    x, y, _, speed = played.of("Ego")
    # the act begins after 3 s, its first event 2 s later; 4 s, and then each 2 s after the change before
    at = (5.0, 9.0, 13.0, 17.0)
    half = 3.07 / 2
    part = [np.clip((t - begin) / 2, 0, 1) for begin in at]
    expected = -half + 2 * half * (t > at[0]) - 2 * half * part[1]
    expected = expected + half * (1 - np.cos(np.pi * part[2])) - 2 * half * cubic(part[3])
    clear = abs(t - at[0]) > 0.011
    np.testing.assert_allclose(y[clear], expected[clear], atol=5e-3)
    faster_s = at[3] + 2 + 2
    ends_s = faster_s + (70 - 50) / 3.6 / 5
    _, expected = ramp(t, (0.0, 5.0, 50 / 3.6), (faster_s, 5.0, 70 / 3.6), (ends_s + 2, 8.0, 0.0), v0=0.0)
    np.testing.assert_allclose(speed, expected, atol=0.081)  # an event begins within a step
    np.testing.assert_allclose(speed[t < 20], expected[t < 20], atol=1e-6)
    assert played.run.end_time_s == pytest.approx(ends_s + 2 + 70 / 3.6 / 8 + 10, abs=0.011)
    straight = (t > 11.1) & (t < 13.0)
    np.testing.assert_allclose(np.diff(x[straight]), 50 / 3.6 * 0.01, atol=1e-6)


def test_what_a_ghost_would_drive(published):
    """100 km/h within 2 s, two lane changes at 6 and 9 s, 10 m/s from 12 s on and a stop from 15 s on."""
    played = published(f"{ESMINI}/follow_ghost.xosc")
    t = played.time_s
    v = 100 / 3.6
    expected = ramp(t, (0.0, v / 2, v), (12.0, (v - 10) / 2, 10.0), (15.0, 10.0, 0.0), v0=0.0)[1]
    np.testing.assert_allclose(played.of("Ego")[3], expected, atol=0.11)
    x, y, _, _ = played.of("Ego")
    lanes = {number: Lane(played.network, "0", number) for number in (-2, -3)}
    lines = {number: lane.points(np.linspace(0, 500, 50_001)) for number, lane in lanes.items()}

    def beside(number, seconds):
        row = played.row(seconds)
        return float(np.hypot(*(lines[number] - (x[row], y[row])).T).min())

    for seconds in (0, 3, 6, 11.1, 14, 20):
        assert beside(-3, seconds) < 0.02, seconds
    for seconds in (8.1, 8.5, 9):
        assert beside(-2, seconds) < 0.02, seconds
    for seconds in (7, 10):  # half of the time: half of the way
        assert beside(-2, seconds) == pytest.approx(beside(-3, seconds), abs=0.06)
    assert played.run.end_time_s == pytest.approx(15 + 1 + 6, abs=0.011)


def test_ten_cars_on_a_motorway(published):
    """The ego at 90 km/h from s = 100 m: at the rear of the first in its lane, 60 m ahead at 30 km/h."""
    played = published(f"{ESMINI}/highway_driver.xosc")
    t = played.time_s
    for name, lane_id, s, kmh in (
        ("Ego", -3, 100, 90),
        ("Target1", -3, 160, 30),
        ("Target2", -2, 200, 30),
        ("Target3", -4, 160, 30),
        ("Target4", -3, 220, 30),
        ("Target5", -4, 260, 30),
        ("Target6", -3, 280, 30),
        ("Target7", -2, 700, 0),
        ("Target8", -3, 700, 0),
        ("Target9", -4, 700, 0),
    ):
        lane = Lane(played.network, "0", lane_id)
        way = kmh / 3.6 * t
        on_road = way < lane.length_m(1e4) - lane.length_m(s) - 0.1
        assert off_m(played, name, lane, lane.s_after(s, way))[on_road].max() < 0.02, name
    lane = Lane(played.network, "0", -3)
    gap_m = lane.length_m(160) - lane.length_m(100) - played.reach_m("Ego")[1] - played.reach_m("Target1")[0]
    assert played.run.contact_entity == "Target1"
    assert played.run.contact_time_s == pytest.approx(gap_m / ((90 - 30) / 3.6), abs=2e-3)
    assert played.run.end_time_s == pytest.approx(45, abs=0.011)


def test_a_polyline_a_clothoid_and_a_curve_by_their_times(published):
    """6 s along a polyline, 4 s along a clothoid of 70 m, 12.2 s along a NURBS, each from where it is."""
    played = published(f"{ESMINI}/trajectory-test.xosc")
    t = played.time_s
    x, y, _, speed = played.of("Target")
    ego_x, ego_y, _, _ = played.of("Ego")
    near = int(np.flatnonzero(np.hypot(ego_x - x, ego_y - y) < 0.5 * 30)[0])
    starts_s = played.run.end_time_s - (6 + 4 + 12.2 + 5)
    assert starts_s == pytest.approx(t[near] + 0.2, abs=0.011)

    def state(seconds):
        return tuple(float(np.interp(seconds, t, column)) for column in (x, y))

    # its corners: so far along the road, in the lane beside and 0.465 m to the left of its middle
    road = Lane(played.network, "1", -1)
    s0 = float(road.s_after(10, 30 * starts_s))
    for seconds, ahead, lane_id, offset in ((2, 60, 1, 0.465), (4, 110, 1, 0.465), (6, 165, -1, 0.0)):
        corner = Lane(played.network, "1", lane_id, offset).points(s0 + ahead)
        assert state(starts_s + seconds) == pytest.approx(tuple(corner), abs=0.05), seconds
    # between them at constant speed on a straight line
    (ax, ay), (bx, by) = state(starts_s + 2), state(starts_s + 4)
    assert state(starts_s + 3) == pytest.approx((0.5 * (ax + bx), 0.5 * (ay + by)), abs=0.02)
    # the clothoid in the direction of the road, at 17.5 m/s
    begin_s = starts_s + 6
    bx, by = state(begin_s)
    tangent = road.points(s0 + 165.5) - road.points(s0 + 164.5)
    first = math.atan2(tangent[1], tangent[0])

    def heading(way):
        return first - 0.1 * way + 0.5 * 0.00036 * way**2

    inside = (t > begin_s + 0.02) & (t < begin_s + 3.98)
    np.testing.assert_allclose(speed[inside], 70 / 4, atol=1e-6)
    for seconds in (1.0, 2.5, 3.9):
        way = 17.5 * seconds
        along = (
            quad(lambda w: math.cos(heading(w)), 0, way)[0],
            quad(lambda w: math.sin(heading(w)), 0, way)[0],
        )
        assert state(begin_s + seconds) == pytest.approx((bx + along[0], by + along[1]), abs=0.1), seconds


def test_a_car_that_parks(published):
    """30 km/h for 39.2 m, then to a stop within 7 s; after 2.5 s of it along a clothoid of 12 m."""
    played = published(f"{ESMINI}/parking_demo.xosc")
    t = played.time_s
    x, y, yaw, speed = played.of("Target3")
    v = 30 / 3.6
    brakes_s = 39.2 / v
    way, expected = ramp(t, (brakes_s, v / 7, 0.0), v0=v)
    np.testing.assert_allclose(speed, expected, atol=1e-6)
    lane = Lane(played.network, "1", 1)
    before = t < brakes_s + 2.5
    assert off_m(played, "Target3", lane, lane.s_after(130.4, -way))[before].max() < 5e-3
    begin_m = float(np.interp(brakes_s + 2.5, t, way))
    bx, by = lane.points(float(lane.s_after(130.4, -begin_m)))

    def heading(along):
        return math.pi - 0.5 * 0.011 * along**2  # it drives against x there

    after = np.flatnonzero((t > brakes_s + 2.52) & (way < begin_m + 12))[::50]
    for row in after:
        along = way[row] - begin_m
        place = (
            bx + quad(lambda w: math.cos(heading(w)), 0, along)[0],
            by + quad(lambda w: math.sin(heading(w)), 0, along)[0],
        )
        assert (x[row], y[row]) == pytest.approx(place, abs=0.03)
        assert math.remainder(yaw[row] - heading(along), 2 * math.pi) == pytest.approx(0.0, abs=0.01)
    for name, place in (("Target0", (20.8, 4.7)), ("Target", (45.2, 4.9)), ("Target1", (93.75, 4.1))):
        px, py, _, still = played.of(name)
        assert not still.any()
        assert (px.min(), py.max()) == pytest.approx(place)
        assert (px.max(), py.min()) == pytest.approx(place)
