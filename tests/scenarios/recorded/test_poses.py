"""Rigid transforms: laws that quaternions, angles and poses keep."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.recorded.poses import (
    heading,
    moved,
    quaternion_yaw,
    rigid,
    rotation_matrix,
    turned,
    turned_about,
    unit_quaternion,
)

part = st.floats(-1.0, 1.0)


@pytest.mark.parametrize("length", [1.0, 2.5, 1e-200, 1e300])
def test_a_rotation_may_have_any_length(length: float) -> None:
    """A quarter turn about z, and its quaternion in any scale."""
    half = np.sqrt(0.5) * length
    turn = rotation_matrix(np.array([half, 0.0, 0.0, half]))
    np.testing.assert_allclose(turn, [[0, -1, 0], [1, 0, 0], [0, 0, 1]], atol=1e-12)


@given(st.tuples(part, part, part, part).filter(lambda q: max(map(abs, q)) > 0.1))
def test_a_quaternion_and_its_matrix_turn_alike(parts: tuple[float, ...]) -> None:
    quaternion = np.array(parts)
    matrix = rotation_matrix(quaternion)
    assert matrix @ matrix.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(matrix) == pytest.approx(1.0)
    if np.hypot(matrix[0, 0], matrix[1, 0]) > 1e-3:  # ahead is not up
        pose = rigid(matrix[None], np.zeros((1, 3)))
        difference = quaternion_yaw(quaternion[None]) - heading(pose)
        assert np.cos(difference) == pytest.approx([1.0])


def test_a_quaternion_without_length_has_no_heading() -> None:
    assert np.isnan(quaternion_yaw(np.zeros((1, 4)))).all()
    assert unit_quaternion(np.array([0.0, 3.0, 0.0, 4.0])).tolist() == [0.0, 0.6, 0.0, 0.8]


@pytest.mark.parametrize(
    ("axis", "vector", "turns_to"),
    [(0, (0, 1, 0), (0, 0, 1)), (1, (0, 0, 1), (1, 0, 0)), (2, (1, 0, 0), (0, 1, 0))],
)
def test_a_quarter_turn_about_each_axis(
    axis: int, vector: tuple[float, ...], turns_to: tuple[float, ...]
) -> None:
    [rotation] = turned_about(axis, np.array([np.pi / 2]))
    assert rotation @ np.array(vector) == pytest.approx(np.array(turns_to))


def test_points_are_turned_then_moved_in_the_plane_as_in_space() -> None:
    pose = rigid(turned_about(2, np.array([np.pi / 2, 0.3])), np.array([[100.0, 50.0, 2.0], [0.0, 1.0, 2.0]]))
    point = np.array([[10.0, 2.0, 1.0], [3.0, -4.0, 0.0]])
    assert moved(pose, point)[0] == pytest.approx((98.0, 60.0, 3.0))
    assert moved(pose, point[:, :2]) == pytest.approx(moved(pose, point)[:, :2])
    assert turned(pose, point)[0] == pytest.approx((-2.0, 10.0, 1.0))
