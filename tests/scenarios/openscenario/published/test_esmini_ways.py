"""Ways along lanes, lane changes and distances in esmini's files, by the numbers in each.

Where a road bends, a way is measured along the middle of the lane on the map, by chords.
"""

import math

import numpy as np
import pytest

from tests.scenarios.openscenario.published.conftest import Lane, ramp

ESMINI = "esmini/resources/xosc"


def in_lane(played, name, lane, s_m, rows=slice(None), within_m=1e-3):
    """The entity is at these s of a lane, for some of the samples."""
    x, y, _, _ = played.of(name)
    off = np.hypot(*(np.column_stack((x, y)) - lane.points(s_m))[rows].T)
    assert off.max() < within_m, (name, off.max(), played.time_s[rows][off.argmax()])


def test_laps_in_a_velodrome(published):
    """From standstill with 5 m/s2 to 200, 190 and 210 km/h, along three lanes of a banked loop of 2 km."""
    played = published(f"{ESMINI}/velodrome.xosc")
    t = played.time_s
    lanes = {
        name: Lane(played.network, "1", lane) for name, lane in (("Car1", -1), ("Car2", -2), ("Car3", -3))
    }
    way, speed = ramp(t, (0.0, 5.0, 200 / 3.6), v0=0.0)
    np.testing.assert_allclose(played.of("Car1")[3], speed, atol=1e-6)
    lap_m = lanes["Car1"].length_m(2000.0)
    first = way < lap_m - lanes["Car1"].length_m(50.0)
    in_lane(played, "Car1", lanes["Car1"], lanes["Car1"].s_after(50, way), first)
    # the end: 5 s after it is 2 m before s = 40 m, on the straight
    end_s = np.interp(lap_m - 10 - 2, way, t) + 5
    assert played.run.end_time_s == pytest.approx(end_s, abs=1e-3)
    # Car2 falls back by 0.65 s of its own speed and then goes for 206 km/h
    own_way, own_speed = ramp(t, (0.0, 5.0, 190 / 3.6), v0=0.0)
    ahead, behind = (
        lane.points(lane.s_after(50, gone)) for lane, gone in ((lanes["Car1"], way), (lanes["Car2"], own_way))
    )
    apart = np.hypot(*(ahead - behind).T) / np.maximum(own_speed, 1e-9)
    row = int(np.flatnonzero((t > 11) & (apart >= 0.65))[0])
    quicker = np.flatnonzero(played.of("Car2")[3] > 190 / 3.6 + 1e-6)[0]
    assert abs(int(quicker) - row) <= 1
    own_way, own_speed = ramp(t, (0.0, 5.0, 190 / 3.6), (t[row], 5.0, 206 / 3.6), v0=0.0)
    np.testing.assert_allclose(played.of("Car2")[3], own_speed, atol=0.06)
    # Car3 changes to lane -2 within 1.5 s from 5 m before s = 1600 m on, on the straight or not
    way, _ = ramp(t, (0.0, 5.0, 210 / 3.6), v0=0.0)
    s = lanes["Car3"].s_after(50, way)
    goal = lanes["Car3"].points(1600.0)
    near = np.flatnonzero(np.hypot(*(lanes["Car3"].points(s) - goal).T) <= 5.0)[0]
    in_lane(played, "Car3", lanes["Car3"], s, slice(0, int(near)))
    on = lanes["Car2"]
    x, y, _, _ = played.of("Car3")
    after = slice(int(near) + 152, int(near) + 300)
    along = on.points(np.linspace(1500, 2000, 20001))
    for point in np.column_stack((x, y))[after][::25]:
        assert np.hypot(*(along - point).T).min() < 0.02


def test_a_lap_of_a_bend_at_a_constant_speed(published):
    """15 m/s from s = 20 m until 10 m from s = 750 m, along lane -1, whose radius is 101.535 m."""
    played = published(f"{ESMINI}/controller_test.xosc")
    lane = Lane(played.network, "0", -1)
    in_lane(played, "Ego", lane, lane.s_after(20, 15 * played.time_s), within_m=2e-3)
    # 750 m on lane 0 is 1.535 m beside: 10 m from it is sqrt(100 - 1.535^2) before it, on the straight
    before_m = math.sqrt(10**2 - (3.07 / 2) ** 2)
    end_s = (lane.length_m(750) - before_m - lane.length_m(20)) / 15
    assert played.run.end_time_s == pytest.approx(end_s, abs=1e-3)


def test_a_lane_change_before_a_bend(published):
    """Cubic to 25 m/s within 4 s; 1 m before s = 50 m sinusoidal to the left lane within 4 s."""
    played = published(f"{ESMINI}/lane_change_simple.xosc")
    t, lane = played.time_s, Lane(played.network, "0", -1)
    part = np.minimum(t / 4, 1.0)
    speed = 25 * part**2 * (3 - 2 * part)
    way = np.where(t <= 4, 25 * 4 * (part**3 - part**4 / 2), 50 + 25 * (t - 4))
    apart = np.hypot(*(lane.points(lane.s_after(20, way)) - lane.points(50.0)).T)
    row = int(np.flatnonzero(apart <= 1.0)[0])
    begins_s = t[row - 1] + (apart[row - 1] - 1.0) / (apart[row - 1] - apart[row]) * 0.01
    x, y, _, v = played.of("Ego")
    np.testing.assert_allclose(v[way < 600], speed[way < 600], atol=1e-6)
    in_lane(played, "Ego", lane, lane.s_after(20, way), t < begins_s, within_m=2e-3)
    # 500 m straight, then the quarter of a circle of 100 m around (500, 100), in the new lane
    left = np.where(x < 500, y, 100 - np.hypot(x - 500, y - 100))
    share = np.clip((t - begins_s) / 4, 0, 1)
    on_arc = way < 600
    expected = -3.07 / 2 + 3.07 * 0.5 * (1 - np.cos(np.pi * share))
    np.testing.assert_allclose(left[on_arc], expected[on_arc], atol=0.01)


def test_overtaking_on_a_crest(published):
    """At 1.3 x 15 m/s against the traffic of the lane beside; 0.25 s ahead it changes to that lane."""
    played = published(f"{ESMINI}/lane_change_crest.xosc")
    t = played.time_s
    assert all((played.of(name)[3] == 15).all() for name in ("Ego", "Target1"))
    # at time 0 the relative speed has not begun yet
    np.testing.assert_allclose(played.of("Target2")[3][1:], 19.5)
    slow, quick = Lane(played.network, "0", 1), Lane(played.network, "0", -1)

    def s_of(lane, s_m, v, seconds):
        return np.interp(lane.length_m(s_m) - v * np.asarray(seconds), lane._gone_m, lane._s_m)

    in_lane(played, "Target1", slow, s_of(slow, 350, 15, t))

    def ahead_s(seconds):
        a = slow.points(s_of(slow, 350, 15, seconds))
        b = quick.points(s_of(quick, 370, 19.5, seconds))
        return float(np.hypot(*(a - b))) / 15 - 0.25

    start = played.engine.definition  # the condition rises where the distance grows through it
    assert start is not None
    seconds = np.linspace(0, 12, 1201)
    values = np.array([ahead_s(k) for k in seconds])
    rises = np.flatnonzero((values[:-1] <= 0) & (values[1:] > 0))
    if len(rises):
        at_s = float(seconds[rises[0]])
        in_lane(played, "Target2", quick, s_of(quick, 370, 19.5, t), t < at_s)


@pytest.mark.parametrize("ego_kmh", [108, 90])
def test_a_cut_in_on_a_motorway(published, ego_kmh):
    """1.2 times as fast; 0.4 s ahead by s the lane change of 3 s; 0.7 s ahead along x it brakes by 4 m/s2."""
    played = published(f"{ESMINI}/cut-in.xosc", {"EgoSpeed": ego_kmh})
    t, v = played.time_s, ego_kmh / 3.6
    own, beside = Lane(played.network, "0", -3), Lane(played.network, "0", -2)
    own_s, other_s = own.s_after(50, v * t), beside.s_after(25, 1.2 * v * t)
    in_lane(played, "Ego", own, own_s)
    changes = int(np.flatnonzero(other_s - own_s > 0.4 * v)[0])
    in_lane(played, "OverTaker", beside, other_s, slice(0, changes))
    x, y, _, speed = played.of("OverTaker")
    # three seconds later it is in the ego's lane, and stays there
    s = np.linspace(0, 1400, 28001)
    for row in range(changes + 301, len(t) - 1, 200):
        assert np.hypot(*(own.points(s) - np.array([x[row], y[row]])).T).min() < 0.03
    ex, ey, yaw, _ = played.of("Ego")
    ahead = (x - ex) * np.cos(yaw) + (y - ey) * np.sin(yaw)
    braking = int(np.flatnonzero(speed[1:] < 1.2 * v - 1e-9)[0])
    assert ahead[braking] <= 0.7 * v <= ahead[braking + 1] + 1e-6
    # from the instant of 0.7 s on the speed falls by 4 m/s2
    at_s = t[braking] + (0.7 * v - ahead[braking]) / (0.2 * v)
    falling = slice(braking + 1, braking + 500)
    np.testing.assert_allclose(speed[falling], np.maximum(1.2 * v - 4 * (t[falling] - at_s), 0), atol=2e-3)
    assert played.run.end_time_s == pytest.approx(at_s + 1.2 * v / 4 + 5, abs=2e-3)


def test_a_cut_in_on_a_straight_road(published):
    """At 20 and 25 m/s side by side: the gaps of both conditions in time grow by 5 m/s."""
    played = published(f"{ESMINI}/cut-in_simple.xosc")
    t = played.time_s
    parameters = played.engine.definition.parameters
    front, rear = played.reach_m("Ego")[1], played.reach_m("OverTaker")[0]
    x, y, _, speed = played.of("OverTaker")

    def starts_s(headway_s):
        return (20 * headway_s + front + rear + 20) / 5

    changes_s, brakes_s = (starts_s(parameters[f"HeadwayTime_{name}"]) for name in ("LaneChange", "Brake"))
    part = np.clip((t - changes_s) / 3, 0, 1)
    begin = -3.07 / 2 + 3.1
    expected = begin + (-3.07 / 2 - begin) * 0.5 * (1 - np.cos(np.pi * part))
    np.testing.assert_allclose(y, expected, atol=2e-3)
    # heading along its way it comes less far ahead while it moves to the side
    middle, aside = 0.5 * (speed[1:] + speed[:-1]), np.diff(y) / np.diff(t)
    way = 30 + np.concatenate(([0.0], np.cumsum(np.sqrt(np.maximum(middle**2 - aside**2, 0)) * np.diff(t))))
    np.testing.assert_allclose(x, way, atol=5e-3)
    gap = x - (50 + 20 * t) - front - rear
    row = int(np.flatnonzero(gap > 20 * parameters["HeadwayTime_Brake"])[0])
    np.testing.assert_allclose(speed, np.clip(25 - 5 * (t - t[row]), 0, 25), atol=0.06)
    assert brakes_s <= t[row] < brakes_s + 0.1
    # nothing changes any more once it stands (or its acceleration is zero), 2 s later the end, after 10 s
    assert played.run.end_time_s >= 10.0


@pytest.mark.parametrize("start_m", [40, 90])
def test_traffic_on_the_left_by_headings(published, start_m):
    """Both drive against the direction of lane 3: 1.4 times as fast, 10 m of free space ahead it changes."""
    played = published(f"{ESMINI}/left-hand-traffic_by_heading.xosc", {"EgoStartS": start_m})
    t = played.time_s
    own = Lane(played.network, "0", 3)
    in_lane(played, "Ego", own, own.s_after(start_m, 30 * t))
    x, y, _, speed = played.of("OverTaker")
    np.testing.assert_allclose(speed[1:], 42.0)
    ex, ey, yaw, _ = played.of("Ego")
    ahead = (x - ex) * np.cos(yaw) + (y - ey) * np.sin(yaw)
    gap = ahead - played.reach_m("Ego")[1] - played.reach_m("OverTaker")[0]
    changes = int(np.flatnonzero(gap > 10)[0])
    beside = Lane(played.network, "0", 2)
    in_lane(played, "OverTaker", beside, beside.s_after(start_m - 30, 42 * t), slice(0, changes - 1))
    assert played.run.end_time_s == pytest.approx(t[changes] + 2 + 4, abs=0.02)
    s = np.linspace(0, 1400, 28001)
    for row in range(changes + 205, len(t) - 1, 100):
        assert np.hypot(*(own.points(s) - np.array([x[row], y[row]])).T).min() < 0.03
