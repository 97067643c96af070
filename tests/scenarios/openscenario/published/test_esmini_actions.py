"""People, signals, synchronisation, trailers, trajectories in esmini's files, by the numbers in each."""

import math

import numpy as np
import pytest

from tests.scenarios.openscenario.published.conftest import Lane, ramp

ESMINI = "esmini/resources/xosc"


def walked(played, name, corners, way_m, within_m=1e-6):
    """The entity is so far along straight lines through corners at every sample."""
    station = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(corners, axis=0).T))))
    x, y, _, _ = played.of(name)
    inside = way_m < station[-1] - 1e-6
    for values, column in ((x, corners[:, 0]), (y, corners[:, 1])):
        np.testing.assert_allclose(values[inside], np.interp(way_m, station, column)[inside], atol=within_m)


def corners_of(played, name):
    """(T, 4, 2) corners of an outline."""
    d = next(e for e in played.engine.definition.entities if e.name == name)
    x, y, yaw, _ = played.of(name)
    rows = []
    for along, left in ((1, 1), (1, -1), (-1, -1), (-1, 1)):
        a, b = d.center_x_m + along * d.length_m / 2, d.center_y_m + left * d.width_m / 2
        rows.append((x + a * np.cos(yaw) - b * np.sin(yaw), y + a * np.sin(yaw) + b * np.cos(yaw)))
    return np.moveaxis(np.array(rows), 2, 0)


def gap_along(played, name, other):
    """(T,) free space along the x axis of the first, who is behind."""
    x, y, yaw, _ = played.of(name)
    ahead = corners_of(played, other) - np.column_stack((x, y))[:, None]
    along = ahead[..., 0] * np.cos(yaw)[:, None] + ahead[..., 1] * np.sin(yaw)[:, None]
    return along.min(axis=1) - played.reach_m(name)[1]


def corners(network, road_id, *places):
    """(K, 2) points at (s, lane, offset) of a road."""
    return np.array([Lane(network, road_id, lane, offset).points(s) for s, lane, offset in places])


@pytest.mark.parametrize(
    ("name", "after_m", "walk_mps", "end_m"),
    [
        ("pedestrian", 5, 1.5, 7.5),
        ("pedestrian_collision", 1, 1.6, 0),
    ],
)
@pytest.mark.parametrize("ego_mps", [None, 8.0])
def test_people_who_cross(published, name, after_m, walk_mps, end_m, ego_mps):
    """They walk once the ego has gone so far, with 2 m/s2 up to their speed, along the given corners."""
    played = published(f"{ESMINI}/{name}.xosc", {} if ego_mps is None else {"HostSpeed": ego_mps})
    v = played.engine.definition.parameters["HostSpeed"]
    starts_s = after_m / v
    way, speed = ramp(played.time_s, (starts_s, 2.0, walk_mps), v0=0.0)
    until = played.run.contact_time_s if name == "pedestrian_collision" else None
    walking = played.time_s < (until or math.inf)
    places = [(15, 3, 0.5), (10.5, 3, 0.5), (10, 3, 0), (10, -3, 0), (9.5, -3, -0.5), (end_m, -3, -0.5)]
    points = corners(played.network, "0", *places)
    np.testing.assert_allclose(played.of("pedestrian_adult")[3][walking], speed[walking], atol=1e-6)
    walked(played, "pedestrian_adult", points, np.where(walking, way, math.inf))
    if name == "pedestrian":  # 1.2 s before the collision the ego brakes by 5.1 m/s2
        ego = played.of("Ego")[3]
        row = int(np.flatnonzero(ego < v - 1e-9)[0])
        gap = gap_along(played, "Ego", "pedestrian_adult")
        shrinks = -np.gradient(gap[: row + 1], played.time_s[: row + 1])[:-1]
        left_s = gap[:row] / shrinks
        assert left_s[row - 2] > 1.2 > left_s[row - 2] - 2 * (left_s[row - 3] - left_s[row - 2])
        falling = slice(row, row + 100)
        np.testing.assert_allclose(np.diff(ego[falling]), -0.051, atol=1e-6)


def test_a_traffic_light(published):
    """Yellow 50 m before, red 3 s later, green 10 s later; the ego stops over 44 m and goes on."""
    played = published(f"{ESMINI}/traffic_lights.xosc")
    t, v = played.time_s, 13.889
    yellow_s = (109 - 50 - 10) / v
    red_s, green_s = yellow_s + 3, yellow_s + 13
    way, speed = ramp(t, (yellow_s, v**2 / (2 * 44), 0.0), (green_s + 0.5, v / 5, v), v0=v)
    np.testing.assert_allclose(played.of("Ego")[3], speed, atol=1e-6)
    lane = Lane(played.network, "3", -1)
    x, y, _, _ = played.of("Ego")
    on_road = way < 100
    np.testing.assert_allclose(np.column_stack((x, y))[on_road], lane.points(10 + way)[on_road], atol=1e-6)
    for name, delay_s, walk_mps, *places in (
        ("Pedestrian_1", 0.5, 2.0, (113, -3, 0.5), (110, 3, -1.0), (109, 3, -0.5), (90, 3, 0.5)),
        ("Pedestrian_2", 1.0, 3.3, (110, 3, -0.5), (110, -3, 0.0), (110, -3, -0.5), (90, -3, -0.5)),
    ):
        way, _ = ramp(t, (red_s + 3 + delay_s, 1.0, walk_mps), v0=0.0)
        walked(played, name, corners(played.network, "3", *places), way)


def test_four_who_meet_a_master(published):
    """At s = 300 m of the ego they are at 305, 285, 297 and 330 m, as fast as it; from 495 m on they part."""
    played = published(f"{ESMINI}/synchronize.xosc")
    t, own = played.time_s, Lane(played.network, "0", -3)
    meets_s = (own.length_m(300) - own.length_m(100)) / 20
    goals = {"NPC1": (-2, 305, 30), "NPC2": (-3, 285, 0), "NPC3": (-4, 297, 17), "NPC4": (-3, 330, 0)}
    parts = np.hypot(*(own.points(own.s_after(100, 20 * t)) - own.points(500)).T)
    parts_s = np.interp(-5.0, -parts[: int(parts.argmin())], t[: int(parts.argmin())])
    for name, (lane_id, goal_m, last) in goals.items():
        x, y, _, speed = played.of(name)
        goal = Lane(played.network, "0", lane_id).points(goal_m)
        at = np.array([np.interp(meets_s, t, x), np.interp(meets_s, t, y)])
        assert np.hypot(*(at - goal)) < 0.02, name
        between = (t > meets_s + 0.05) & (t < parts_s)
        np.testing.assert_allclose(speed[between], 20.0, atol=1e-6)
        # sinusoidal, its greatest acceleration 3 m/s2: pi / 2 x the change / the duration
        duration_s = math.pi / 2 * abs(last - 20) / 3
        share = np.clip((t - parts_s) / duration_s, 0, 1)
        expected = 20 + (last - 20) * 0.5 * (1 - np.cos(np.pi * share))
        np.testing.assert_allclose(speed[t >= parts_s], expected[t >= parts_s], atol=0.02)
    stands_s = parts_s + math.pi / 2 * 20 / 3
    assert played.run.end_time_s == pytest.approx(stands_s + 2, abs=0.01)


def passes(played, name, point):
    """When an entity is nearest to a point, and how near: by a parabola through three samples."""
    x, y, _, _ = played.of(name)
    away = (x - point[0]) ** 2 + (y - point[1]) ** 2
    k = int(np.clip(away.argmin(), 1, len(away) - 2))
    a, b, c = np.polyfit(played.time_s[k - 1 : k + 2] - played.time_s[k], away[k - 1 : k + 2], 2)
    return float(played.time_s[k] - b / (2 * a)), math.sqrt(max(c - b**2 / (4 * a), 0.0))


@pytest.mark.parametrize(("host", "final"), [(10, 5), (8, 4)])
def test_a_bicycle_that_meets_the_ego(published, host, final):
    """Both are at their places at one instant; the bicycle rides its last 10 m at its final speed."""
    values = {"HostSpeed": host, "TargetFinalSpeed": final}
    played = published(f"{ESMINI}/synch_with_steady_state.xosc", values)
    ego_place = Lane(played.network, "240", -1, 1.5).points(6.0)
    place = Lane(played.network, "236", -1, 1.5).points(12.5)
    ego_s, ego_m = passes(played, "Ego", ego_place)
    target_s, target_m = passes(played, "Target", place)
    assert ego_m == pytest.approx(1.5, abs=0.02)  # the ego drives in the middle of its lane
    assert target_s == pytest.approx(ego_s, abs=0.01)
    _x, _y, _, speed = played.of("Target")
    steady = (played.time_s > target_s - 10 / final) & (played.time_s < target_s)
    np.testing.assert_allclose(speed[steady], final, atol=1e-6)
    (starts,) = np.flatnonzero(speed > 0)[:1]
    assert played.time_s[starts] < target_s - 10 / final
    assert target_m < 2.6  # at its own offset of 1 m beside the place


@pytest.mark.parametrize("final", [7, 5])
def test_a_left_turn_that_meets_the_ego(published, final):
    played = published(f"{ESMINI}/ltap-od.xosc", {"NPCFinalSpeed": final})
    ego_s, ego_m = passes(played, "Ego", Lane(played.network, "0", 1).points(7.0))
    assert ego_m < 1e-3
    t = played.time_s
    x, y, _, speed = played.of("NPC")
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    assert np.interp(ego_s, t, gone) == pytest.approx(203 - 150, abs=0.05)
    assert np.interp(ego_s, t, speed) == pytest.approx(final, abs=0.01)


@pytest.mark.parametrize("name", ["trailers", "truck_with_rotating_axle", "trailer_connect"])
def test_trailers_hang_on_their_hitches_and_do_not_slip(published, name):
    """Each coupler is on the hitch of who is ahead, and each axle goes where it points."""
    played = published(f"{ESMINI}/{name}.xosc")
    t, pairs = played.time_s, 0
    for actor in played.engine.world.actors.values():
        tower = actor.coupling.tower if actor.coupling is not None else None
        if name == "trailer_connect" and actor.name == "Trailer":
            tower = played.engine.world.actors["Car"]
        if tower is None:
            continue
        hitch_m, coupler_m = tower.definition.hitch_m, actor.definition.coupler_m
        x, y, yaw, _ = played.of(tower.name)
        tx, ty, tyaw, _ = played.of(actor.name)
        apart = np.hypot(
            x + hitch_m * np.cos(yaw) - tx - coupler_m * np.cos(tyaw),
            y + hitch_m * np.sin(yaw) - ty - coupler_m * np.sin(tyaw),
        )
        together = apart < 1e-6
        if name != "trailer_connect":
            assert together.all()
        assert together.sum() > 350
        slip = np.diff(ty) * np.cos(0.5 * (tyaw[1:] + tyaw[:-1])) - np.diff(tx) * np.sin(
            0.5 * (tyaw[1:] + tyaw[:-1])
        )
        slip = slip / np.diff(t).clip(1e-6)
        assert np.abs(slip[together[1:] & together[:-1] & (t[1:] > 0.05)]).max() < 0.02, actor.name
        pairs += 1
    assert pairs == {"trailers": 7, "truck_with_rotating_axle": 3, "trailer_connect": 1}[name]


def test_a_route_through_many_intersections(published):
    """At 50 m/s through its waypoints; the stop of 15 m/s2 begins within 2 m of s = 10 m of road 230."""
    played = published(f"{ESMINI}/routing-test.xosc")
    t = played.time_s
    x, y, _, speed = played.of("Ego")
    stops = int(np.flatnonzero(speed < 50)[0])
    gone = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))
    np.testing.assert_allclose(gone[:stops], 50 * t[:stops], rtol=2e-4)
    seconds = [
        passes(played, "Ego", Lane(played.network, *place).points(s))
        for place, s in (
            (("242", 1), 80.0),
            (("261", 1), 50.0),
            (("222", -1), 20.0),
            (("197", -1), 20.0),
            (("230", 1), 10.0),
        )
    ]
    assert all(away < 0.02 for _, away in seconds)
    assert [s for s, _ in seconds] == sorted(s for s, _ in seconds)
    goal = Lane(played.network, "230", 1).points(10.0)
    away = np.hypot(x - goal[0], y - goal[1])
    assert away[stops - 1] <= 2.5
    assert away[stops - 2] > 2.0
    np.testing.assert_allclose(np.diff(speed[stops : stops + 300]), -0.15, atol=1e-9)


def test_distances_in_time_on_a_motorway(published):
    """1 s and 1.5 s behind the one ahead at 25 m/s; two others at 40 m/s all the time."""
    played = published(f"{ESMINI}/highway_merge.xosc")
    last = -1
    for name in ("A4", "A5"):
        np.testing.assert_allclose(played.of(name)[3][1:], 40.0)
    for name, ahead, seconds in (("A2", "A1", 1.0), ("A3", "A2", 1.5)):
        gap = gap_along(played, name, ahead)[last]
        assert gap == pytest.approx(seconds * played.of(name)[3][last], abs=0.7)
        assert played.of(name)[3][last] == pytest.approx(25, abs=0.6)
        acceleration = np.diff(played.of(name)[3]) / 0.01
        assert acceleration[1:-1].max() <= 2 + 1e-6
        assert acceleration[1:-1].min() >= -5 - 1e-6


def test_a_time_gap_with_and_without_limits_of_the_jerk(published):
    """From 50 m behind one at 10 m/s: 2 s of free space behind it, that is 20 m, within 3 m/s2."""
    played = published(f"{ESMINI}/long_dist_action_with_jerk.xosc")
    t = played.time_s
    for name, jerk in (("Ego", math.inf), ("ego jerk", 1.0)):
        _x, _, _, speed = played.of(name)
        gap = gap_along(played, name, "Target")
        # 60 m apart at 20 against 10 m/s: 50 m after 1 s
        assert np.flatnonzero(speed != 20)[0] == played.row(1.01)
        assert gap[-1] == pytest.approx(20, abs=0.25)
        assert speed[-1] == pytest.approx(10, abs=0.1)
        acceleration = np.diff(speed) / np.diff(t)
        assert abs(acceleration).max() <= 3 + 1e-6
        if jerk < math.inf:
            assert abs(np.diff(acceleration)).max() <= 0.01 * jerk + 1e-6


def test_a_distance_to_the_side(published):
    """0.5 m of free space to the left of the ego, then to its right, then 1 m between the middles."""
    played = published(f"{ESMINI}/keep_lateral_distance.xosc")
    t = played.time_s
    own, other = (
        played.network.road_coordinates("0", np.column_stack(played.of(name)[:2]))[1]
        for name in ("Ego", "OverTaker")
    )
    width_m = sum(e.width_m for e in played.engine.definition.entities) / 2
    left = other - own
    # from 1 s on by a cubic of at most 2 m/s: 1.5 x the change / 2 m/s
    change_m = left[0] - width_m - 0.5
    share = np.clip((t - 1) / (1.5 * change_m / 2), 0, 1)
    closer = t < 1 + 1.5 * change_m / 2 + 0.2
    expected = left[0] - change_m * share**2 * (3 - 2 * share)
    np.testing.assert_allclose(left[closer], expected[closer], atol=2e-3)
    # closer than 0.6 m for a second, the ego begins to change lanes, within 2 s
    # its outline reaches further across while it heads along its way
    x, y, yaw, _ = played.of("Ego")
    ahead = corners_of(played, "OverTaker") - np.column_stack((x, y))[:, None]
    across = (ahead[..., 1] * np.cos(yaw)[:, None] - ahead[..., 0] * np.sin(yaw)[:, None]).min(axis=1)
    near = int(np.flatnonzero(across - played.engine.definition.entities[0].width_m / 2 < 0.6)[0])
    moved = int(np.flatnonzero(abs(own - own[0]) > 1e-3)[0])
    assert t[moved] == pytest.approx(t[near] + 1.0, abs=0.05)
    changed_s = t[near] + 1.0 + 2.0
    # the change back, over 4 s, begins when the one over 3 s from 8 s on has ended
    right = (t > 17.1) & (t < 11.0 + 4.0 + 3.0)
    np.testing.assert_allclose(left[right], -width_m - 0.5, atol=2e-3)
    assert changed_s < 8.0
    # 3 s after that to the left, within 7 m/s2: sqrt(6 x the change / 7)
    change_m = 1.0 + width_m + 0.5
    last_s = math.sqrt(6 * change_m / 7)
    share = np.clip((t - 18.0) / last_s, 0, 1)
    after = t > 18.0
    expected = -width_m - 0.5 + change_m * share**2 * (3 - 2 * share)
    np.testing.assert_allclose(left[after], expected[after], atol=0.02)
    assert left[-1] == pytest.approx(1.0, abs=2e-3)
    assert played.run.end_time_s == pytest.approx(18.0 + last_s + 5.0, abs=0.03)
