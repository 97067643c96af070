"""CARLA's ScenarioRunner examples with an ego that drives at a constant speed, by the numbers in each file.

ScenarioRunner looks at no edges: what has been met stays met. A `step` lasts as long as its value.
"""

import math

import numpy as np
import pytest

from scenarios.openscenario.motion.paths import Pose
from tests.scenarios.openscenario.published.conftest import ramp

FOLDER = "carla/srunner/examples"


@pytest.fixture
def play(published):
    def run(name, ego_mps, until_s=60.0, **values):
        return published(f"{FOLDER}/{name}.xosc", values, until_s, ego="hero", ego_mps=ego_mps)

    return run


def gone(played, name):
    """(T,) way since the start."""
    x, y, _, _ = played.of(name)
    return np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))))


def there(played, name):
    """(T,) whether an entity is there."""
    return played.run.exists[:, played.run.names.tolist().index(name)]


@pytest.mark.parametrize(("ego_mps", "lead_mps"), [(5.0, 2.0), (8.0, 4.0)])
def test_a_lead_vehicle_that_drives_a_while(play, ego_mps, lead_mps):
    """50 m ahead; with less than 40 m of free space it drives 20 m, and stands again."""
    played = play("FollowLeadingVehicle", ego_mps, leadingSpeed=lead_mps)
    t = played.time_s
    free_m = 50 - played.reach_m("hero")[1] - played.reach_m("adversary")[0]
    starts_s = (free_m - 40) / ego_mps
    assert starts_s > 1.0 / ego_mps  # the act begins after 1 m
    way, speed = ramp(t, (starts_s, np.inf, lead_mps), (starts_s + 20 / lead_mps, np.inf, 0.0), v0=0.0)
    np.testing.assert_allclose(gone(played, "hero"), ego_mps * t, atol=2e-3)
    np.testing.assert_allclose(gone(played, "adversary"), way, atol=2e-3)
    edges = np.abs(np.subtract.outer(t, [starts_s, starts_s + 20 / lead_mps])).min(axis=1) > 0.011
    np.testing.assert_allclose(played.of("adversary")[3][edges], speed[edges], atol=1e-9)


@pytest.mark.parametrize("ego_mps", [5.0, 10.0])
def test_a_pedestrian_who_steps_out(play, ego_mps):
    """At x = 140 m the ego has gone 10 m and is there: 1.5 m at 10 m/s, across, and standing again."""
    played = play("PedestrianCrossingFront", ego_mps, until_s=15.0)
    t = played.time_s
    starts_s = 10 / ego_mps
    x, y, _, speed = played.of("adversary")
    np.testing.assert_allclose(x, 110, atol=2e-3)  # its heading of 1.5708 clockwise is towards -y
    np.testing.assert_allclose(y, -52 - np.clip(10 * (t - starts_s), 0, 1.5), atol=1e-6)
    assert not speed[t < starts_s].any()
    assert not speed[t > starts_s + 0.16].any()


@pytest.mark.parametrize("ego_mps", [8.0, 9.0])
def test_a_lane_change_after_a_way(play, ego_mps):
    """81.8 m ahead; closer than 40 m it drives 50 m at 5 m/s, then over 25 m into the lane to its left."""
    played = play("LaneChangeSimple", ego_mps)
    t = played.time_s
    x, y, _, speed = played.of("adversary")
    hx, hy, _, _ = played.of("hero")
    near = int(np.flatnonzero(np.hypot(x - hx, y - hy) < 40.0)[0])
    starts_s = t[near]
    assert starts_s == pytest.approx((81.8 - 40) / ego_mps, abs=0.02)
    np.testing.assert_allclose(speed[t > starts_s + 0.02], 5.0)
    way = gone(played, "adversary")
    np.testing.assert_allclose(way, np.maximum(5 * (t - starts_s), 0), atol=0.06)
    world, yaw = played.engine.world, played.of("adversary")[2]
    before, after = (
        world.locator.roads.place(Pose(x[row], y[row], yaw[row]))
        for row in (played.row(round(starts_s + seconds, 2)) for seconds in (9.5, 17.0))
    )
    # one lane to its left, as ScenarioRunner counts: the ids of lanes against s grow outwards
    assert world.road_distances.beside(before, after).lane_id == before.lane_id + before.along_s
    assert abs(after.offset_m) < 0.02
    changing = (way > 51) & (way < 74)
    turned = played.of("adversary")[2]
    away = np.abs(np.angle(np.exp(1j * (turned - turned[0]))))
    assert away[changing].min() > 0.1  # 3.5 m over 25 m
    assert away[(way > 76) & (way < 90)].max() < 0.05


@pytest.mark.parametrize("name", ["SyncArrivalIntersection", "IntersectionCollisionAvoidance"])
@pytest.mark.parametrize("ego_mps", [6.0, 9.0])
def test_two_that_meet_at_an_intersection(play, name, ego_mps):
    """The other is at (92, 63.8) when the ego is at (103, 55), 3 m/s faster than it."""
    played = play(name, ego_mps, until_s=20.0)
    t = played.time_s
    x, _, _, _ = played.of("hero")
    row = int(np.flatnonzero(x < 103)[0])
    passes = float(np.interp(-103, -x[row - 1 : row + 1], t[row - 1 : row + 1]))
    ox, oy, _, speed = played.of("adversary")
    assert np.interp(passes, t, oy) == pytest.approx(-63.8, abs=0.1)
    assert np.interp(passes, t, ox) == pytest.approx(92, abs=1.5)  # beside the middle of its lane
    assert np.interp(passes, t, speed) == pytest.approx(ego_mps + 3, abs=0.15)


def test_entities_that_come_and_go(play):
    """20 m before the one ahead it drives at its speed; after 10 m of it another comes, or two go."""
    for name, events in (
        ("StoryAddEntityAction", {"adversary2": (10, True), "C1": (20, True)}),
        ("StoryDeleteEntityAction", {"adversary2": (10, False), "adversary3": (10, False)}),
    ):
        played = play(name, 6.0)
        t = played.time_s
        v = played.engine.definition.parameters["leadingSpeed"]
        free_m = 50 - played.reach_m("hero")[1] - played.reach_m("adversary")[0]
        starts_s = (free_m - 20) / 6
        lasts_m = 30 if name == "StoryAddEntityAction" else 50
        way, _ = ramp(t, (starts_s, np.inf, v), (starts_s + lasts_m / v, np.inf, 0.0), v0=0.0)
        np.testing.assert_allclose(gone(played, "adversary"), way, atol=5e-3)
        for entity, (after_m, comes) in events.items():
            at_s = starts_s + after_m / v
            known = np.abs(t - at_s) > 0.011
            assert ((there(played, entity) == comes) == (t > at_s))[known].all(), entity


def test_a_vehicle_that_is_caught_up_with(play):
    """1 m/s; within 20 m of the ego, 10 m/s."""
    played = play("OscControllerExample", 9.0, until_s=40.0)
    x, y, _, speed = played.of("adversary")
    hx, hy, _, _ = played.of("hero")
    row = int(np.flatnonzero(speed > 1.0)[1])
    np.testing.assert_allclose(speed[1 : row - 1], 1.0)
    np.testing.assert_allclose(speed[row:], 10.0)
    # it comes closer by no more than 10 m/s, and drives away from then on
    assert np.hypot(x - hx, y - hy)[row] == pytest.approx(20.0, abs=0.1)
    assert np.hypot(x - hx, y - hy).min() > 19.9


def test_obstacles_of_a_slalom(play):
    """Containers where the file puts them, y to the right; the ego stands before them."""
    played = play("Slalom", None, until_s=5.0)
    for name, place in {
        "hero": (92.44, 314),
        "c1": (90, 308),
        "c2": (95, 298),
        "c3": (91, 288),
        "c4": (93, 278),
        "c5": (91, 268),
    }.items():
        x, y, _, speed = played.of(name)
        np.testing.assert_allclose((x, -y), np.array(place)[:, None] + 0 * x, atol=1e-6)
        assert not speed.any()


@pytest.mark.parametrize("ego_mps", [6.0, 8.0])
def test_a_cyclist_who_crosses_a_little(play, ego_mps):
    """After 10 m of the ego and closer than 14 m to it: 1.5 m at 2 m/s; on only once the ego stands."""
    played = play("CyclistCrossing", ego_mps, until_s=15.0)
    t = played.time_s
    x, y, _, speed = played.of("adversary")
    hx, hy, _, _ = played.of("hero")
    near = (np.hypot(x - hx, y - hy) < 14.0) & (ego_mps * t >= 10.0)
    starts_s = t[np.flatnonzero(near)[0]]
    np.testing.assert_allclose(x, 95.5 - np.clip(2 * (t - starts_s), 0, 1.5), atol=0.021)  # within a step
    np.testing.assert_allclose(x[t > starts_s + 0.8], 94.0, atol=1e-6)
    np.testing.assert_allclose(y, -41, atol=1e-6)
    assert not speed[t < starts_s - 0.011].any()
    assert not speed[t > starts_s + 0.77].any()


@pytest.mark.parametrize("ego_mps", [5.0, 8.0])
def test_weather_changes_no_motion(play, ego_mps):
    """From 20 s on the weather is another; the ego drives on at its speed."""
    played = play("ChangingWeather", ego_mps, until_s=30.0)
    np.testing.assert_allclose(gone(played, "hero"), ego_mps * played.time_s, atol=5e-3)
    np.testing.assert_allclose(played.of("hero")[3], ego_mps, atol=1e-9)
    assert played.run.end_time_s == pytest.approx(30.0)


@pytest.mark.parametrize("ego_mps", [4.0, 8.0])
def test_an_offset_of_3_m_to_the_left(play, ego_mps):
    """At the start the ego stands: by 45 degrees at most; then it keeps the offset along the lane."""
    played = play("LaneOffsetActionExample", ego_mps, until_s=10.0)
    t = played.time_s
    x, y, yaw, _ = played.of("hero")
    along = math.atan2(y[-1] - y[500], x[-1] - x[500])
    ahead = (x - x[0]) * math.cos(along) + (y - y[0]) * math.sin(along)
    left = (y - y[0]) * math.cos(along) - (x - x[0]) * math.sin(along)
    across = np.minimum(ego_mps * t * math.sqrt(0.5), 3.0)
    np.testing.assert_allclose(left, across, atol=5e-3)
    np.testing.assert_allclose(
        ahead, np.where(across < 3.0, across, ego_mps * t - 3 * (math.sqrt(2) - 1)), atol=0.01
    )
    np.testing.assert_allclose(yaw[t > 2], along, atol=1e-3)
