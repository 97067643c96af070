"""Poses of transforms alone are those of an odometry with the same poses."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.live.settings import LiveSettings
from scenarios.ros.frames.localisation import Localisation
from tests.scenarios.live.streams_made import BASE, LIDAR, MAP, ns, odometry, transform

SPEED_MPS = 8.0

# in steps of 0.1 s, so that gaps of all lengths about the limits come
steps = st.lists(st.integers(1, 16), min_size=1, max_size=12)


def localisations(times_s: list[float]) -> tuple[Localisation, Localisation]:
    by_odometry, by_transforms = Localisation(LiveSettings()), Localisation(LiveSettings())
    for time_s in times_s:
        x_m = SPEED_MPS * time_s
        by_odometry.add_odometry(odometry(time_s, (x_m, 1.0, 0.0)))  # the twist is not filled
        by_transforms.add_transforms(transform(time_s, MAP, BASE, x_m, 1.0, 0.0), static=False)
    for local in (by_odometry, by_transforms):
        local.decide(LIDAR, ns(times_s[-1]))
    return by_odometry, by_transforms


@given(steps, st.integers(-5, 200))
def test_both_tell_the_same_poses_over_gaps_and_beyond_the_ends(gaps: list[int], asked: int) -> None:
    times_s = [0.0]
    for gap in gaps:
        times_s.append(times_s[-1] + 0.1 * gap)
    by_odometry, by_transforms = localisations(times_s)
    # not halfway between two poses: nobody can say which is nearer
    stamp_ns = ns(0.1 * asked + 0.03)
    expected, pose = by_odometry.pose(stamp_ns), by_transforms.pose(stamp_ns)
    assert (pose is None) == (expected is None)
    if pose is not None and expected is not None:
        assert pose.map_SE3_base == pytest.approx(expected.map_SE3_base, abs=1e-6)
        assert pose.forward_mps == pytest.approx(expected.forward_mps, abs=1e-6)
        assert pose.carried == expected.carried
        assert pose.map_SE3_base[0, 3] == pytest.approx(SPEED_MPS * (stamp_ns - ns(0.0)) * 1e-9, abs=1e-5)


def test_a_transform_of_the_future_is_no_reason_to_guess() -> None:
    _, by_transforms = localisations([0.0, 0.1, 6.0])
    carried = by_transforms.pose(ns(0.25))
    assert carried is not None
    assert carried.carried
    assert carried.map_SE3_base[0, 3] == pytest.approx(SPEED_MPS * 0.25)
    assert by_transforms.pose(ns(3.0)) is None


def test_frames_without_a_way_between_them_have_no_pose() -> None:
    local = Localisation(LiveSettings())
    assert local.pose(ns(0.0)) is None
    local.add_transforms(transform(0.0, "a", "b", 0.0, 0.0, 0.0), static=False)
    local.decide(LIDAR, ns(0.0))
    assert local.pose(ns(0.0)) is None
