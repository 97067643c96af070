"""The tree of transforms: chains, interpolation, and what cannot be."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.live.transforms import TransformTree, inverse, placed
from tests.scenarios.live.streams_made import ns, transform


def tree() -> TransformTree:
    """map - odom - base_link - lidar; the vehicle drives along x of odom with 10 m/s."""
    frames = TransformTree()
    frames.add(transform(0.0, "map", "odom", 100.0, 50.0, math.pi / 2), static=True)
    for k in range(11):
        frames.add(transform(0.1 * k, "odom", "base_link", 1.0 * k, 0.0, 0.0), static=False)
    frames.add(transform(0.0, "base_link", "lidar", 1.5, 0.0, math.pi), static=True)
    return frames


def test_a_point_is_seen_through_the_chain() -> None:
    pose = tree().at("map", "lidar", ns(0.25))
    assert pose is not None
    # 2 m ahead of the lidar is 0.5 m behind the vehicle's origin, which is at 2.5 m
    assert placed(pose, np.array([[2.0, 0.0, 0.0]]))[0] == pytest.approx([100.0, 52.0, 0.0])


@given(st.floats(0.0, 1.0))
def test_there_and_back_is_nowhere(time_s: float) -> None:
    frames = tree()
    there, back = (frames.at(*names, ns(time_s)) for names in (("map", "lidar"), ("lidar", "map")))
    assert there is not None
    assert back is not None
    assert there @ back == pytest.approx(np.eye(4), abs=1e-9)
    assert inverse(there) == pytest.approx(back, abs=1e-9)


def test_beyond_what_is_known_there_is_nothing_unless_it_is_held() -> None:
    frames = tree()
    assert frames.newest_ns("map", "lidar") == ns(1.0)
    assert frames.at("map", "base_link", ns(1.01)) is None
    assert frames.at("map", "base_link", ns(-0.01)) is None
    held = frames.at("map", "base_link", ns(5.0), hold=True)
    assert held is not None
    assert held[:3, 3] == pytest.approx([100.0, 60.0, 0.0])
    assert frames.newest_ns("base_link", "lidar") is None  # all static
    assert frames.at("base_link", "lidar", ns(1e5)) is not None
    assert frames.at("map", "camera", ns(0.0)) is None
    assert not frames.connected("map", "camera")


def test_time_that_went_back_forgets_what_moves() -> None:
    frames = tree()
    frames.forget_after(ns(0.5))
    assert frames.newest_ns("map", "base_link") == ns(0.5)
    assert frames.at("base_link", "lidar", ns(0.0)) is not None


def test_loops_and_impossible_transforms_end() -> None:
    frames = tree()
    frames.add(transform(0.0, "lidar", "lidar", 0.0, 0.0, 0.0), static=True)
    frames.add(replace(transform(0.0, "a", "b", 0.0, 0.0, 0.0), quaternion=np.zeros((1, 4))), static=True)
    frames.add(transform(0.0, "a", "c", np.nan, 0.0, 0.0), static=True)
    assert frames.refused == 3
    frames.add(transform(0.0, "lidar", "map", 0.0, 0.0, 0.0), static=True)
    assert frames.at("map", "a", ns(0.0)) is None
