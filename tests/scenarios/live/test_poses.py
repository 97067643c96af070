"""Poses between, before and after those that were received: closed forms on lines and circles."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.live.ways import MOST_CURVATURE_PM, PATH_M, arc_ahead
from scenarios.recorded.poses import heading
from scenarios.ros.frames.poses import PoseBuffer
from smartmot.types import EgoState
from tests.scenarios.live.streams_made import ns, odometry


def on_circle(time_s: float, radius_m: float, speed_mps: float) -> tuple[float, float, float]:
    """Counter-clockwise about (0, radius), from the origin along x."""
    angle = speed_mps * time_s / radius_m
    return radius_m * math.sin(angle), radius_m * (1.0 - math.cos(angle)), angle


def buffer_of(times_s: list[float], radius_m: float = 20.0, twists: bool = True) -> PoseBuffer:
    poses = PoseBuffer(carry_s=0.2)
    for time_s in times_s:
        rates = (10.0, 10.0 / radius_m) if twists else (0.0, 0.0)
        poses.add(odometry(time_s, on_circle(time_s, radius_m, 10.0), *rates))
    return poses


@given(st.floats(1.0, 1.2), st.sampled_from([-15.0, 15.0, 40.0, 1e7]))
def test_a_pose_is_carried_on_along_its_arc(time_s: float, radius_m: float) -> None:
    pose = buffer_of([0.8, 0.9, 1.0], radius_m).at(ns(time_s))
    assert pose is not None
    x, y, yaw = on_circle((ns(time_s) - ns(0.0)) * 1e-9, radius_m, 10.0)
    assert pose.map_SE3_base[:2, 3] == pytest.approx((x, y), abs=1e-6)
    assert float(heading(pose.map_SE3_base[None])[0]) == pytest.approx(yaw, abs=1e-6)
    assert pose.carried == (ns(time_s) > ns(1.0))


def test_between_poses_places_move_evenly_and_headings_turn_evenly() -> None:
    pose = buffer_of([0.0, 0.1]).at(ns(0.025))
    assert pose is not None
    a, b = (np.array(on_circle(t, 20.0, 10.0)) for t in (0.0, 0.1))
    expected = a + 0.25 * (b - a)
    assert pose.map_SE3_base[:2, 3] == pytest.approx(expected[:2])
    assert float(heading(pose.map_SE3_base[None])[0]) == pytest.approx(expected[2])
    # the chord is off by no more than the height of the arc over it
    x, y, _ = on_circle(0.025, 20.0, 10.0)
    assert math.hypot(*(pose.map_SE3_base[:2, 3] - (x, y))) <= 1.0**2 / (8 * 20.0)
    assert not pose.carried


@pytest.mark.parametrize("time_s", [0.5, 1.0])
def test_rates_are_differences_where_twists_are_not_filled(time_s: float) -> None:
    poses = buffer_of([k * 0.05 for k in range(21)], twists=False)
    pose = poses.at(ns(time_s))
    assert pose is not None
    chord = 2 * 20.0 * math.sin(0.5 * 10.0 * 0.2 / 20.0) / 0.2
    assert pose.forward_mps == pytest.approx(chord, rel=0.01)
    assert pose.yaw_rate_radps == pytest.approx(0.5, rel=1e-6)


def test_a_standing_vehicle_without_twists_stands() -> None:
    poses = PoseBuffer(0.2)
    for k in range(10):
        poses.add(odometry(0.05 * k, (1.0, 2.0, 0.3)))
    pose = poses.at(ns(0.4))
    assert pose is not None
    assert (pose.forward_mps, pose.yaw_rate_radps) == pytest.approx((0.0, 0.0), abs=1e-12)


def test_far_from_every_pose_there_is_none() -> None:
    poses = buffer_of([1.0, 3.0])  # too far apart to be interpolated
    known = {t: poses.at(ns(t)) is not None for t in (0.79, 0.81, 1.19, 1.21, 2.0, 2.81, 3.19, 3.21)}
    assert known == {
        0.79: False, 0.81: True, 1.19: True, 1.21: False, 2.0: False, 2.81: True, 3.19: True, 3.21: False,
    }  # fmt: skip
    assert PoseBuffer(0.2).at(ns(0.0)) is None


def test_the_order_of_arrival_does_not_matter() -> None:
    times = [0.1 * k for k in range(8)]
    a, b = buffer_of(times), buffer_of(times[::-1])
    for time_s in (0.0, 0.05, 0.33, 0.7, 0.75):
        first, second = a.at(ns(time_s)), b.at(ns(time_s))
        assert first is not None
        assert second is not None
        assert np.array_equal(first.map_SE3_base, second.map_SE3_base)


def test_impossible_repeated_and_foreign_poses_are_refused_and_counted() -> None:
    poses = buffer_of([0.0])
    good = odometry(0.1, (1.0, 0.0, 0.0), 10.0)
    bad = (
        odometry(0.0, (5.0, 0.0, 0.0)),
        replace(good, position_m=np.array([np.nan, 0.0, 0.0])),
        replace(good, quaternion=np.zeros(4)),
        replace(good, linear_mps=np.array([np.inf, 0.0, 0.0])),
        replace(good, frame_id="odom"),
    )
    for message in bad:
        poses.add(message)
    assert (poses.refused, poses.newest_ns) == (5, ns(0.0))


def test_memory_is_bounded() -> None:
    poses = PoseBuffer(0.2)
    for k in range(5000):
        poses.insert(ns(k * 0.01), np.eye(4), (1.0, 0.0, 0.0))
    assert len(poses._stamps) <= 2001
    assert poses.at(ns(49.99)) is not None


@pytest.mark.parametrize("turn", [0.0, 0.3, -0.3])
def test_the_path_ahead_is_the_arc_of_the_turn_rate(turn: float) -> None:
    path = arc_ahead(EgoState(0.0, 3.0, 4.0, 0.0, 10.0, yaw_rate_radps=turn))
    assert path.length_m == PATH_M
    curvature = turn / 10.0
    station = path.station_m[path.station_m * abs(curvature) < math.pi / 2 - 0.05]
    if turn:
        expected = np.column_stack((np.sin(station * curvature), 1 - np.cos(station * curvature))) / curvature
    else:
        expected = np.column_stack((station, 0.0 * station))
    assert path.center_m[: len(station)] == pytest.approx(expected + np.array([3.0, 4.0]), abs=0.02)


def test_a_slow_vehicle_looks_straight_on_and_none_turns_on_the_spot() -> None:
    slow = arc_ahead(EgoState(0.0, 0.0, 0.0, 0.0, 0.5, yaw_rate_radps=1.0))
    assert slow.center_m[-1] == pytest.approx((PATH_M, 0.0))
    tight = arc_ahead(EgoState(0.0, 0.0, 0.0, 0.0, 2.0, yaw_rate_radps=5.0))
    radius = 1.0 / MOST_CURVATURE_PM
    assert tight.center_m[:, 0].max() == pytest.approx(radius, abs=0.2)
    assert tight.center_m[-1, 1] > PATH_M - 2.0 * radius
