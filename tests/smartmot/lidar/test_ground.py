"""The ground of planes, slopes and crests that are given in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from smartmot.arrays import FloatArray
from smartmot.lidar.ground import ASSUMED_HEIGHT_M, Ground, ground_under

REACH_M = 45.0


def polar(count: int = 4000, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    rng = np.random.default_rng(seed)
    distance, azimuth = rng.uniform(3.0, 44.0, count), rng.uniform(-1.0, 1.0, count)
    return distance * np.cos(azimuth), distance * np.sin(azimuth)


def under(xyz: FloatArray, prior_m: float | None = None) -> tuple[Ground, FloatArray]:
    x, y = xyz[:, 0], xyz[:, 1]
    return ground_under(xyz, np.arctan2(y, x), np.hypot(x, y), REACH_M, prior_m)


@settings(max_examples=25, deadline=None)
@given(st.floats(1.2, 2.4), st.floats(-0.1, 0.1), st.floats(-0.08, 0.08), st.integers(0, 99))
def test_a_tilted_plane_is_found(height: float, along: float, across: float, seed: int) -> None:
    x, y = polar(seed=seed)
    noise = np.random.default_rng(seed).normal(0.0, 0.02, len(x))
    ground, over = under(np.column_stack((x, y, along * x + across * y - height + noise)))
    assert ground.is_seen
    # the lowest of the points of a cell is under the plane by up to three standard deviations
    assert ground.sensor_height_m == pytest.approx(height, abs=0.08)
    assert ground.slope == pytest.approx([along, across], abs=0.01)
    assert np.quantile(np.abs(over), 0.99) < 0.15


def test_blocks_roofs_and_stray_echoes_are_not_the_ground() -> None:
    x, y = polar()
    rng = np.random.default_rng(1)
    z = np.full(len(x), -1.7)
    roof = (y > 5.0) & (x > 5.0)
    z[roof] = 1.5
    wall = (y < -8.0) & (x > 10.0)
    z[wall] = rng.uniform(-1.7, 2.0, int(wall.sum()))
    z[:20] = -6.0
    ground, over = under(np.column_stack((x, y, z)))
    assert ground.sensor_height_m == pytest.approx(1.7, abs=0.01)
    assert over[roof & (z > 0)].min() > 2.5
    assert np.abs(over[(z == -1.7)]).max() < 0.25


def test_the_ground_follows_a_crest() -> None:
    x, y = polar(8000)
    z = -1.7 + 0.05 * x - 0.0025 * np.maximum(x - 10.0, 0.0) ** 2
    _, over = under(np.column_stack((x, y, z)))
    near = np.hypot(x, y) < 40.0
    assert np.quantile(np.abs(over[near]), 0.98) < 0.25


def test_a_kerb_is_no_obstacle_and_a_block_is() -> None:
    x, y = polar(8000)
    z = np.where(y > 3.0, -1.58, -1.7)
    block = (np.abs(x - 15.0) < 0.5) & (np.abs(y) < 0.5)
    z[block] = np.linspace(-1.4, -0.5, int(block.sum()))
    _, over = under(np.column_stack((x, y, z)))
    assert over[~block].max() < 0.25
    assert over[block].min() == pytest.approx(0.3, abs=0.05)


@pytest.mark.parametrize("prior", [None, 1.2])
def test_without_ground_the_mount_counts(prior: float | None) -> None:
    ground, _ = under(np.array([[10.0, 0.0, 0.3], [11.0, 1.0, 0.4]]), prior)
    assert not ground.is_seen
    assert ground.sensor_height_m == (prior or ASSUMED_HEIGHT_M)


def test_the_level_under_a_point_is_what_its_height_is_over() -> None:
    x, y = polar()
    xyz = np.column_stack((x, y, 0.03 * x - 1.6))
    ground, over = under(xyz)
    assert xyz[:, 2] - ground.level_m(xyz[:, :2]) == pytest.approx(over, abs=1e-9)
    assert math.isclose(float(np.median(over)), 0.0, abs_tol=0.02)
