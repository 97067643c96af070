"""Speeds and distances in esmini's files (resources/xosc), by hand from the numbers in each.

Its straight road has lanes of 3.07 m; where a speed has a value in km/h, the file divides it by 3.6.
"""

import math

import numpy as np
import pytest

from tests.scenarios.openscenario.published.conftest import ramp

ESMINI = "esmini/resources/xosc"
NOW = math.inf
HALF_LANE_M = 3.07 / 2


def straight_on(played, name, way_m, speed_mps, y_m=-HALF_LANE_M):
    """The entity is where the way says at every sample, in its lane on the straight road."""
    x, y, yaw, speed = played.of(name)
    np.testing.assert_allclose(x, way_m, atol=1e-6)
    np.testing.assert_allclose(speed, speed_mps, atol=1e-6)
    np.testing.assert_allclose(y, y_m, atol=1e-9)
    np.testing.assert_allclose(np.cos(yaw), 1.0, atol=1e-9)


def test_a_slow_lead_vehicle(published):
    """At 30 m/s 150 m behind one at 1 m/s; 2.7 s before the collision the ego brakes by 6 m/s2."""
    played = published(f"{ESMINI}/slow-lead-vehicle.xosc")
    brakes_s = 150 / 29 - 2.7
    way, speed = ramp(played.time_s, (brakes_s, 6.0, 0.0), v0=30.0)
    straight_on(played, "Ego", 50 + way, speed)
    straight_on(played, "Lead", 200 + played.time_s, 1.0)
    assert played.run.end_time_s == pytest.approx(brakes_s + 29 / 6 + 4, abs=1e-6)


@pytest.mark.parametrize(
    ("name", "met", "start_m", "v"),
    [
        ("straight_500m", "Target", 350, 0.0),
        ("straight_500m_pedestrian", "Cyclist", 100, 10.0),
    ],
)
def test_contacts_on_a_straight_road(published, name, met, start_m, v):
    """The ego at 20 m/s from s = 50 m on reaches the rear of the first who is ahead in its lane."""
    played = published(f"{ESMINI}/{name}.xosc")
    front, rear = played.reach_m("Ego")[1], played.reach_m(met)[0]
    assert played.run.contact_entity == met
    assert played.run.contact_time_s == pytest.approx((start_m - 50 - front - rear) / (20 - v), abs=1e-6)
    straight_on(played, "Ego", 50 + 20 * played.time_s, 20.0)
    assert played.run.end_time_s == pytest.approx(30.0, abs=1e-6)


def test_a_bicycle_by_the_times_of_its_trajectory(published):
    """100 m at 0 s, 120 m at 2 s, 125 m at 2.5 s, 130 m at 3.5 s and at 4 s; there it stays."""
    played = published(f"{ESMINI}/bicycle_fall_over.xosc")
    x, y, _, speed = played.of("Cyclist")
    np.testing.assert_allclose(
        x, np.interp(played.time_s, [0, 2, 2.5, 3.5, 6], [100, 120, 125, 130, 130]), atol=1e-6
    )
    np.testing.assert_allclose(y, -HALF_LANE_M, atol=1e-9)
    assert speed[played.row(1.0)] == pytest.approx(10)
    assert speed[played.row(3.0)] == pytest.approx(5)
    assert not speed[played.row(3.51) :].any()


@pytest.mark.parametrize("start_s", [2.0, 3.3])
def test_speed_profiles(published, start_s):
    """0, 10, 4 and 8 m/s after 4, 4 and 2 s: by straight lines, or within limits of the jerk."""
    played = published(f"{ESMINI}/speed-profile.xosc", {"StartTime": start_s})
    times = start_s + np.array([0.0, 4.0, 8.0, 10.0])
    changes = zip(times[:3], [2.5, 1.5, 2.0], [10.0, 4.0, 8.0], strict=True)
    way, speed = ramp(played.time_s, *changes, v0=0.0)
    straight_on(played, "Car2", 10 + way, speed, y_m=HALF_LANE_M)
    x, _, _, smooth = played.of("Car1")
    np.testing.assert_allclose(np.interp(times[:3], played.time_s, smooth), [0, 10, 4], atol=2e-3)
    # 2 s are too short for 4 m/s: the acceleration a that grows by 4 and falls by 3 m/s3 takes 7 a / 12, and
    # half of a times that is 4 m/s
    longer_s = math.sqrt(2 * 4 * 7 / 12)
    assert longer_s > 2.0
    ends = times[2] + longer_s + np.array([-0.05, 0.01])
    reached = np.interp(ends, played.time_s, smooth)
    assert 8 - 3 * 0.05**2 < reached[0] < 8 - 1e-4
    assert reached[1] == pytest.approx(8, abs=1e-6)
    acceleration = np.gradient(smooth, played.time_s)
    assert -10.0 <= acceleration.min() < -1.5
    assert 2.5 < acceleration.max() <= 5.0
    jerk = np.gradient(acceleration, played.time_s)[3:-3]
    assert jerk.min() >= -3.0 - 1e-3
    assert jerk.max() <= 4.0 + 1e-3
    np.testing.assert_allclose(np.gradient(x, played.time_s)[1:-1], smooth[1:-1], atol=1e-3)


def test_a_target_that_drives_while_the_ego_is_close(published):
    """5 m/s2 up to 20 m/s within 30 m of the ego at 10 m/s, 5 m/s2 down beyond: 4 s each, again and again."""
    played = published(f"{ESMINI}/drive_when_close.xosc")
    way, speed = ramp(played.time_s, (0.0, 5.0, 10.0), v0=0.0)
    straight_on(played, "Ego", 20 + way, speed)
    # the gap of 80 m is 30 m after 2 + 4 s; faster by 5 t - 10 it is that again after 4 s, at 20 m/s
    changes = [(6.0 + 4 * k, 5.0, 20.0 if k % 2 == 0 else 0.0) for k in range(9)]
    way, speed = ramp(played.time_s, *changes, v0=0.0)
    straight_on(played, "Target", 100 + way, speed)


def test_distances_on_a_straight_road(published):
    """10 m behind the ego at 15 m/s, then 4 m once it is within 2 m of s = 250 m (35 mm beside it)."""
    played = published(f"{ESMINI}/distance_test.xosc")
    ego, _, _, _ = played.of("Ego")
    np.testing.assert_allclose(ego, 50 + 15 * played.time_s, atol=1e-6)
    x, y, _, speed = played.of("Dummy")
    gap = ego - played.reach_m("Ego")[0] - x - played.reach_m("Dummy")[1]
    closer_s = (200 - math.sqrt(2**2 - (HALF_LANE_M - 1.5) ** 2)) / 15
    before = played.row(round(closer_s - 0.01, 2))
    assert gap[before] == pytest.approx(10, abs=0.05)
    assert abs(gap[before + 10] - gap[before]) > abs(gap[before] - gap[before - 10])
    end = played.row(round(played.run.end_time_s - 4, 2))
    assert gap[end] == pytest.approx(4, abs=0.11)  # ends within 0.1 m
    acceleration = np.gradient(speed, played.time_s)
    assert abs(acceleration).max() <= 15.0 + 1e-6
    np.testing.assert_allclose(y, -HALF_LANE_M, atol=1e-9)


@pytest.mark.parametrize(("ego", "target"), [(120, 30), (90, 50)])
def test_speeds_and_lane_changes_of_a_target_for_acc(published, ego, target):
    """Two lane changes of 3.07 m, braking at 11 s, accelerating at 17 s, braking at 20 s."""
    played = published(f"{ESMINI}/acc-test.xosc", {"EgoSpeed": ego, "TargetSpeed": target})
    ego_way, ego_speed = ramp(played.time_s, (2.0, NOW, 1.0), (10.0, NOW, 0.25 * ego / 3.6), v0=ego / 3.6)
    straight_on(played, "Ego", 20 + ego_way, ego_speed)
    changes = ((11.0, 4.0, 0.0), (17.0, 10.0, 50.0), (20.0, 8.0, 5.0))
    way, speed = ramp(played.time_s, *changes, v0=target / 3.6)
    x, y, _, speeds = played.of("Target")
    np.testing.assert_allclose(speeds, speed, atol=1e-6)
    part = np.clip([(played.time_s - 5) / 1.5, (played.time_s - 7) / 1.4], 0, 1)
    left = 0.5 - 0.5 * np.cos(np.pi * part)
    np.testing.assert_allclose(y, -HALF_LANE_M + 3.07 * (left[0] - left[1]), atol=1e-3)
    # while it moves to the side it comes less far: the way of sqrt(v^2 - y'^2)
    side = np.gradient(y, played.time_s)
    lost = np.cumsum(speed - np.sqrt(np.maximum(speed**2 - side**2, 0.0))) * 0.01
    np.testing.assert_allclose(x, 100 + way - lost, atol=0.02)
    brakes_s = (float(speed[played.row(20.0)]) - 5) / 8
    assert played.run.end_time_s == pytest.approx(20 + brakes_s + 12, abs=1e-6)
