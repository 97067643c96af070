"""Connected components of cells against SciPy's labels of an image, and laws of gaps."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.ndimage import label

from smartmot.lidar.clusters import components

CELL_M = 0.25
"""Exact in binary: nothing lies on the wrong side of a border of cells."""


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 10_000), st.integers(1, 120))
def test_gaps_of_a_cell_and_its_diagonal_are_scipys_eight_neighbours(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    cells = rng.integers(0, 15, (count, 2))
    xy = (cells + 0.5) * CELL_M
    number, sample = components(xy[:, 0], xy[:, 1], CELL_M, np.full(count, 1.5 * CELL_M))
    image = np.zeros((15, 15), dtype=np.int64)
    image[cells[:, 0], cells[:, 1]] = 1
    expected = label(image, np.ones((3, 3)))[0][cells[:, 0], cells[:, 1]]
    same = number[:, None] == number
    assert (same == (expected[:, None] == expected)).all()
    assert len(sample) == image.sum()


@pytest.mark.parametrize(("gap", "groups"), [(0.45, 2), (0.5, 1)])
def test_points_as_far_apart_as_the_gap_are_joined(gap: float, groups: int) -> None:
    x = np.array([0.0, 0.25, 0.75])
    number, _ = components(x, np.zeros(3), CELL_M, np.full(3, gap))
    assert len(set(number.tolist())) == groups


def test_the_greater_of_two_gaps_counts() -> None:
    number, _ = components(np.array([0.0, 0.75]), np.zeros(2), CELL_M, np.array([0.25, 0.75]))
    assert number[0] == number[1]


def test_no_points_make_no_components() -> None:
    assert len(components(np.zeros(0), np.zeros(0), CELL_M, np.zeros(0))[0]) == 0
