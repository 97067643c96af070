from typing import Any

import numpy as np
import pytest
import shapely

from smartmot import geometry
from smartmot.geometry import (
    corners,
    from_frame,
    near_pairs,
    signed_gap,
    to_frame,
    wrap_angle,
)
from smartmot.types import FloatArray

Rectangles = tuple[FloatArray, FloatArray, FloatArray]


def _random(rng: np.random.Generator, *shape: int) -> Rectangles:
    return rng.uniform(-4, 4, (*shape, 2)), rng.uniform(0.05, 6, (*shape, 2)), rng.uniform(-7, 7, shape)


def _polygon(center: FloatArray, size: FloatArray, yaw: FloatArray) -> Any:
    return shapely.polygons(corners(center, size, yaw))


@pytest.mark.parametrize(
    ("angle", "wrapped"),
    [(0.0, 0.0), (np.pi, -np.pi), (-np.pi, -np.pi), (7.0, 7.0 - 2 * np.pi), (-4.0, 2 * np.pi - 4)],
)
def test_wrap_angle(angle: float, wrapped: float) -> None:
    assert wrap_angle(np.array(angle)) == pytest.approx(wrapped)


def test_frames_by_hand_and_round_trip() -> None:
    # Facing north from (10, 5), a point 2 m north is ahead, one 3 m west is to the left.
    local = to_frame(np.array([[10.0, 7.0], [7.0, 5.0]]), 10.0, 5.0, np.pi / 2)
    np.testing.assert_allclose(local, [[2.0, 0.0], [0.0, 3.0]], atol=1e-12)
    points = np.random.default_rng(0).normal(0, 30, (4, 6, 2))
    np.testing.assert_allclose(from_frame(to_frame(points, 3, -8, 2.2), 3, -8, 2.2), points, atol=1e-12)


def test_corners_by_hand() -> None:
    found = corners(np.array([1.0, 2.0]), np.array([4.0, 2.0]), np.array(np.pi / 2))
    np.testing.assert_allclose(found, [[0, 4], [0, 0], [2, 0], [2, 4]], atol=1e-12)


@pytest.mark.parametrize("shape", [(), (7,), (3, 5), (2, 1, 4)])
def test_corners_run_counter_clockwise_in_every_batch_shape(shape: tuple[int, ...]) -> None:
    center, size, yaw = _random(np.random.default_rng(1), *shape)
    polygons = np.atleast_1d(_polygon(center, size, yaw)).ravel()
    assert corners(center, size, yaw).shape == (*shape, 4, 2)
    assert all(shapely.is_ccw(shapely.get_exterior_ring(polygons)))
    np.testing.assert_allclose(shapely.area(polygons), size.prod(axis=-1).ravel())


def test_penetration_is_the_shift_that_separates() -> None:
    rng = np.random.default_rng(5)
    a, b = _random(rng, 300), _random(rng, 300)
    gap = signed_gap(*a, *b)
    direction = np.linspace(0, 2 * np.pi, 721)
    shift = np.stack((np.cos(direction), np.sin(direction)), axis=-1)
    for i in np.flatnonzero(gap < 0.0):
        shifted = b[0][i] + shift * -gap[i] * (1.0 - 1e-3)
        assert signed_gap(a[0][i], a[1][i], a[2][i], shifted, b[1][i], b[2][i]).max() < 0.0


def test_strips_find_the_pairs_of_the_table(monkeypatch: pytest.MonkeyPatch) -> None:
    rng = np.random.default_rng(9)
    a, b = rng.uniform(0, 40, (70, 2)), rng.uniform(0, 40, (90, 2))
    # From a crowd's short reaches to a long one, and none at all.
    reach_a, reach_b = rng.choice([0.0, 0.3, 2.0, 15.0], 70), rng.uniform(0, 1, 90)
    table = near_pairs(a, b, reach_a, reach_b)
    monkeypatch.setattr(geometry, "_DENSE_PAIRS", 0)
    swept = near_pairs(a, b, reach_a, reach_b)
    assert len(table[0]) > 300
    np.testing.assert_array_equal(swept, table)


@pytest.mark.parametrize("offset_m", [0.0, 1e6, -1e8])
def test_strips_keep_neighbours_at_the_very_reach(monkeypatch: pytest.MonkeyPatch, offset_m: float) -> None:
    # whole metres are exact: each point of a grid has itself and four neighbours at exactly 1 m
    monkeypatch.setattr(geometry, "_DENSE_PAIRS", 0)
    side = 20
    grid = offset_m + np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)
    alone = np.array([[offset_m + 0.5, -offset_m + 3e4]])
    i, j = near_pairs(np.vstack((grid, alone)), grid, np.full(side**2 + 1, 0.25), np.full(side**2, 0.75))
    assert len(i) == side**2 + 4 * side * (side - 1)
    assert i.max() < side**2
    np.testing.assert_allclose(np.hypot(*(grid[i] - grid[j]).T), np.where(i == j, 0.0, 1.0))


@pytest.mark.parametrize("dense", [10**9, 0])
def test_a_least_distance_adds_pairs_to_those_within_reach(
    monkeypatch: pytest.MonkeyPatch, dense: int
) -> None:
    monkeypatch.setattr(geometry, "_DENSE_PAIRS", dense)
    rng = np.random.default_rng(6)
    a, b = rng.uniform(0, 30, (40, 2)), rng.uniform(0, 30, (50, 2))
    reach_a, reach_b, least = rng.uniform(0, 3, 40), rng.uniform(0, 2, 50), rng.uniform(0, 6, 40)
    found = set(zip(*(part.tolist() for part in near_pairs(a, b, reach_a, reach_b, least)), strict=True))
    distance = np.hypot(*(a[:, None] - b).transpose(2, 0, 1))
    near = (distance <= reach_a[:, None] + reach_b) | (distance <= least[:, None])
    assert found == {(i, j) for i, j in np.argwhere(near).tolist()}
