"""Pillars: which points are in them, and the features of each."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.errors import ConfigError
from smartmot.lidar.learned import FEATURES, PillarGrid, pillars_of

GRID = PillarGrid((0.0, 8.0), (-4.0, 4.0), 0.5, 4)


def column(name: str) -> int:
    return FEATURES.index(name)


def test_features_of_three_points_by_hand() -> None:
    """Two points in the cell from (2, 1) to (2.5, 1.5), one in another."""
    xyz = np.array([[2.1, 1.2, -1.0], [2.3, 1.4, -0.2], [6.0, -3.9, -1.5]])
    seen = pillars_of(xyz, np.array([0.7, 1.5, 0.2]), GRID)
    assert len(seen) == 2
    assert seen.cell.tolist() == [4 * 16 + 10, 12 * 16]
    first = seen.features[0]
    np.testing.assert_allclose(first[:2, column("ahead_of_cell")], [-0.3, 0.1], atol=1e-6)
    np.testing.assert_allclose(first[:2, column("left_of_cell")], [-0.1, 0.3], atol=1e-6)
    np.testing.assert_allclose(first[:2, column("height")], [0.7, 1.5], atol=1e-6)
    np.testing.assert_allclose(first[:2, column("ahead_of_mean")], [-0.1, 0.1], atol=1e-6)
    np.testing.assert_allclose(first[:2, column("left_of_mean")], [-0.1, 0.1], atol=1e-6)
    np.testing.assert_allclose(first[:2, column("over_mean")], [-0.4, 0.4], atol=1e-6)
    np.testing.assert_allclose(
        first[:2, column("distance")], np.hypot([2.1, 2.3], [1.2, 1.4]) / 40.0, atol=1e-6
    )
    np.testing.assert_allclose(first[:, column("count")], math.log(3.0) / 4.0, atol=1e-6)
    # what is missing repeats the first point
    np.testing.assert_array_equal(first[2:], first[[0, 0]])


def test_points_outside_the_grid_or_its_heights_are_left_out() -> None:
    xyz = np.array([[-0.1, 0, 0], [8.0, 0, 0], [1.0, 4.0, 0], [1.0, -4.0, 0], [1.0, 0, 0], [1.0, 0, 0.0]])
    height = np.array([1.0, 1.0, 1.0, 1.0, 3.1, -0.6])
    assert pillars_of(xyz, height, GRID).point.tolist() == [3]
    assert len(pillars_of(xyz[:0], height[:0], GRID)) == 0
    assert pillars_of(xyz[:1], height[:1], GRID).features.shape == (0, 4, len(FEATURES))


def test_of_many_points_some_are_taken_evenly() -> None:
    xyz = np.column_stack((np.linspace(1.0, 1.4, 9), np.full(9, 0.1), np.zeros(9)))
    seen = pillars_of(xyz, np.arange(9.0) / 9.0, GRID)
    np.testing.assert_allclose(seen.features[0, :, column("height")], np.array([0, 2, 4, 6]) / 9.0, atol=1e-6)


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10_000), count=st.integers(1, 400))
def test_pillars_hold_their_points(seed: int, count: int) -> None:
    """Each cell once and in order, its points inside it, whatever their order in the cloud."""
    rng = np.random.default_rng(seed)
    xyz = rng.uniform((-1.0, -5.0, -2.0), (9.0, 5.0, 2.0), (count, 3))
    height = xyz[:, 2] + 1.0
    seen = pillars_of(xyz, height, GRID)
    assert (np.diff(seen.cell) > 0).all()
    assert (np.abs(seen.features[..., :2]) <= 0.5 + 1e-5).all()
    rows, columns = np.divmod(seen.cell, GRID.shape[1])
    inside = xyz[seen.point]
    cell = np.floor(inside[:, 0] / 0.5).astype(int) * 16 + np.floor((inside[:, 1] + 4.0) / 0.5).astype(int)
    assert set(cell.tolist()) == set(seen.cell.tolist())
    x, y = xyz[:, 0], xyz[:, 1]
    in_grid = (x >= 0) & (x < 8) & (y >= -4) & (y < 4)
    assert len(seen.point) == np.count_nonzero(in_grid & (height >= -0.5) & (height <= 3))
    mixed = rng.permutation(count)
    again = pillars_of(xyz[mixed], height[mixed], GRID)
    np.testing.assert_array_equal(again.cell, seen.cell)
    few = np.array([np.count_nonzero(cell == c) <= GRID.most_points for c in seen.cell], dtype=bool)
    np.testing.assert_allclose(again.features[few].max(axis=1), seen.features[few].max(axis=1), atol=1e-5)
    assert rows.max(initial=0) < 16
    assert columns.max(initial=0) < 16


@pytest.mark.parametrize(
    "words",
    [
        {"cell_m": 0.0}, {"cell_m": 0.3}, {"ahead_m": (5.0, 5.0)}, {"most_points": 0},
        {"heights_m": (3.0, 1.0)}, {"left_m": (0.0, math.inf)},
    ],
)  # fmt: skip
def test_impossible_grids_are_refused(words: dict[str, object]) -> None:
    with pytest.raises(ConfigError, match="pillars: "):
        PillarGrid(**words)  # type: ignore[arg-type]
