"""The tree of transforms: laws of rigid motion, times, faults that are named."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.ros.frames.transforms import TransformTree, box_direction, inverse, is_static, placed
from scenarios.ros.messages import read_transforms
from tests.scenarios.live.streams_made import ns, transform
from tests.scenarios.ros import messages_made as made

angles = st.floats(-math.pi, math.pi)
metres = st.floats(-100.0, 100.0)


def tree_of(*rows: object, static: bool = False, keep: int | None = None) -> TransformTree:
    tree = TransformTree(keep)
    tree.add(read_transforms(made.transforms(*rows), 0), static)
    return tree


@given(angles, angles, metres, metres)
def test_the_way_back_is_the_inverse(a: float, b: float, x: float, y: float) -> None:
    tree = tree_of(
        made.transform(0, "map", "base", made.xyz(x, y), made.about_z(a)),
        made.transform(0, "base", "lidar", made.xyz(1.0, 0.0, 2.0), made.about_z(b)),
        static=True,
    )
    there, back = tree.at("map", "lidar", 5), tree.at("lidar", "map", 5)
    assert there is not None
    assert back is not None
    np.testing.assert_allclose(there @ back, np.eye(4), atol=1e-9)
    np.testing.assert_allclose(inverse(there), back, atol=1e-9)
    # by hand: the lidar is 1 m ahead of the base and turned by both angles
    expected = (x + math.cos(a), y + math.sin(a), 2.0)
    np.testing.assert_allclose(there[:3, 3], expected, atol=1e-9)
    turn = math.atan2(there[1, 0], there[0, 0])
    assert math.remainder(turn - a - b, 2 * math.pi) == pytest.approx(0.0, abs=1e-9)


def test_between_two_times_a_turn_goes_on_at_constant_rate() -> None:
    tree = tree_of(
        made.transform(1000, "map", "base", made.xyz(0.0, 0.0), made.about_z(0.0)),
        made.transform(3000, "map", "base", made.xyz(8.0, 4.0), made.about_z(math.pi / 2)),
    )
    for time_ns, share in ((1000, 0.0), (1500, 0.25), (2000, 0.5), (3000, 1.0)):
        pose = tree.at("map", "base", time_ns)
        assert pose is not None
        np.testing.assert_allclose(pose[:2, 3], (8.0 * share, 4.0 * share), atol=1e-12)
        assert math.atan2(pose[1, 0], pose[0, 0]) == pytest.approx(share * math.pi / 2)


def test_beyond_its_times_a_transform_is_not_known() -> None:
    tree = tree_of(
        made.transform(1000, "map", "base", made.xyz(1.0), made.wxyz()),
        made.transform(3000, "map", "base", made.xyz(3.0), made.wxyz()),
    )
    assert tree.at("map", "base", 999) is None
    assert tree.at("map", "base", 3001) is None
    held = tree.at("map", "base", 3001, hold=True)
    assert held is not None
    assert held[0, 3] == 3.0
    assert tree.newest_ns("map", "base") == 3000


def test_frames_that_are_not_connected_have_no_transform() -> None:
    tree = tree_of(made.transform(0, "map", "base", made.xyz(), made.wxyz()), static=True)
    assert tree.at("map", "lidar", 0) is None
    assert not tree.connected("lidar", "base")
    assert tree.frames() == ["base", "map"]


def test_loops_end() -> None:
    tree = tree_of(
        made.transform(0, "a", "b", made.xyz(1.0), made.wxyz()),
        made.transform(0, "b", "a", made.xyz(1.0), made.wxyz()),
        made.transform(0, "c", "c", made.xyz(1.0), made.wxyz()),
        static=True,
    )
    assert tree.at("a", "z", 0) is None
    assert tree.refused == 1


@pytest.mark.parametrize(
    ("translation", "rotation"),
    [
        (made.xyz(math.nan), made.wxyz()),
        (made.xyz(math.inf), made.wxyz()),
        (made.xyz(), made.wxyz(0.0)),
        (made.xyz(), made.wxyz(math.nan)),
    ],
)
def test_impossible_transforms_are_counted(translation: object, rotation: object) -> None:
    tree = tree_of(made.transform(0, "map", "base", translation, rotation))
    assert tree.refused == 1
    assert tree.frames() == []


def test_all_of_a_bag_is_remembered_and_little_of_a_stream() -> None:
    rows = [made.transform(k, "map", "base", made.xyz(float(k)), made.wxyz()) for k in range(1, 5001)]
    for keep, first in ((None, 1.0), (100, None)):
        pose = tree_of(*rows, keep=keep).at("map", "base", 1)
        assert (None if pose is None else pose[0, 3]) == first


def test_directions_of_boxes_are_those_of_their_rotations() -> None:
    quarter = math.sqrt(0.5)
    rotations = np.array([(1, 0, 0, 0), (quarter, 0, 0, quarter), (0, 0, 0, 2), (quarter, 0, -quarter, 0)])
    expected = [(1, 0, 0), (0, 1, 0), (-1, 0, 0), (0, 0, 1)]
    np.testing.assert_allclose(box_direction(rotations), expected, atol=1e-12)
    assert np.isnan(box_direction(np.zeros((1, 4)))).all()


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


def test_of_a_stream_a_single_transform_of_the_future_is_forgotten_with_the_next_one() -> None:
    frames = TransformTree()
    for time_s, x_m in ((0.9, 9.0), (1.0, 10.0), (1000.0, 0.0), (1.1, 11.0)):
        frames.add(transform(time_s, "odom", "base_link", x_m, 0.0, 0.0), static=False)
    assert frames.newest_ns("odom", "base_link") == ns(1.1)
    pose = frames.at("odom", "base_link", ns(1.05))
    assert pose is not None
    assert pose[0, 3] == pytest.approx(10.5)


def test_nothing_is_interpolated_over_more_than_a_second() -> None:
    frames = TransformTree()
    for time_s, x_m in ((0.0, 0.0), (1.0, 10.0), (2.1, 21.0), (2.2, 22.0)):
        frames.add(transform(time_s, "map", "odom", x_m, 0.0, 0.0), static=False)
    for time_s in (0.0, 0.4, 3.0):
        frames.add(transform(time_s, "odom", "base_link", 0.0, time_s, 0.0), static=False)
    near = frames.at("map", "odom", ns(0.5))
    assert near is not None
    assert near[0, 3] == pytest.approx(5.0)
    assert frames.at("map", "odom", ns(1.5)) is None
    # of sensors, which hardly move, the last place before counts
    held = frames.at("map", "odom", ns(2.0), hold=True)
    assert held is not None
    assert held[0, 3] == 10.0

    def known(time_s: float, later: bool) -> int | None:
        return frames.known_ns("map", "base_link", ns(time_s), later)

    assert known(0.3, False) == known(0.3, True) == ns(0.3)
    assert known(0.7, False) == ns(0.4)  # the one is known there, the other is not
    assert known(2.15, False) == ns(0.4)
    assert known(2.15, True) is None  # where the one is known again, the other is not any longer
    assert known(-0.1, True) == ns(0.0)
    assert known(-0.1, False) is None
    assert frames.known_ns("map", "camera", ns(0.0), False) is None


@pytest.mark.parametrize(
    ("topic", "static"),
    [
        ("/tf_static", True),
        ("tf_static", True),
        ("/robot/tf_static", True),
        ("/tf", False),
        ("/not_tf_static", False),
    ],
)
def test_static_topics_are_known_by_their_last_name(topic: str, static: bool) -> None:
    assert is_static(topic) == static
