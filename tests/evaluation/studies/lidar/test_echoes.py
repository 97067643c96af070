"""Echoes that are too weak, lines with errors of their own, and ground that is not flat."""

import math

import numpy as np
import pytest

from evaluation.studies.lidar.echoes import (
    FADING,
    LINE_SIGMA_M,
    LINE_SIGMA_RAD,
    WAVE_SLOPE,
    WEAKEST,
    miscalibrated,
    on_waves,
    too_weak,
)
from smartmot.pointcloud import Boxes3D, PointCloud


def cloud_of(xyz_m: np.ndarray, intensity: float, ring: np.ndarray | None = None) -> PointCloud:
    strength = np.full(len(xyz_m), intensity, dtype=np.float32)
    return PointCloud(xyz_m.astype(np.float32), strength, ring)


@pytest.mark.parametrize("seed", range(20))
def test_strong_echoes_stay_and_weak_ones_are_lost(seed: int) -> None:
    """Five standard deviations of fading beyond both ends of what sensors notice."""
    distance = 30.0
    points = np.tile([0.0, distance, 0.0], (300, 1))
    strong = WEAKEST[1] * math.exp(5.0 * FADING) * distance**2
    weak = WEAKEST[0] * math.exp(-5.0 * FADING) * distance**2
    assert not too_weak(cloud_of(points, strong), np.random.default_rng(seed)).any()
    assert too_weak(cloud_of(points, weak), np.random.default_rng(seed)).all()


def test_the_same_echo_is_lost_more_often_farther_away() -> None:
    near, far = np.tile([10.0, 0.0, 0.0], (500, 1)), np.tile([45.0, 0.0, 0.0], (500, 1))
    share = {
        name: np.mean([too_weak(cloud_of(xyz, 4e-3), np.random.default_rng(k)).mean() for k in range(60)])
        for name, xyz in (("near", near), ("far", far))
    }
    assert share["near"] < 0.05
    assert 0.2 < share["far"] < 0.9


def test_each_line_has_an_error_of_its_own() -> None:
    lines, columns = 64, 50
    azimuth = np.tile(np.linspace(-0.5, 0.5, columns), lines)
    ring = np.repeat(np.arange(lines), columns)
    elevation = np.radians(np.linspace(-20.0, 2.0, lines))[ring]
    direction = np.column_stack(
        (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation))
    )
    cloud = cloud_of(20.0 * direction, 0.3, ring)
    spread_m, spread_rad = [], []
    for seed in range(40):
        made = miscalibrated(cloud, np.random.default_rng(seed)).xyz_m.astype(np.float64)
        off = (np.linalg.norm(made, axis=1) - 20.0).reshape(lines, columns)
        up = (np.arcsin(made[:, 2] / np.linalg.norm(made, axis=1)) - elevation).reshape(lines, columns)
        np.testing.assert_allclose(np.arctan2(made[:, 1], made[:, 0]), azimuth, atol=1e-6)
        assert np.ptp(off, axis=1).max() < 1e-4
        assert np.ptp(up, axis=1).max() < 1e-5
        spread_m.append(off[:, 0].std())
        spread_rad.append(up[:, 0].std())
    # the share of the greatest is drawn evenly
    assert np.mean(spread_m) == pytest.approx(0.5 * LINE_SIGMA_M, rel=0.25)
    assert np.mean(spread_rad) == pytest.approx(0.5 * LINE_SIGMA_RAD, rel=0.25)
    assert miscalibrated(cloud_of(20.0 * direction, 0.3), np.random.default_rng(0)).ring is None


def test_what_stands_on_waves_moves_with_the_ground() -> None:
    x, y = (v.ravel() for v in np.meshgrid(np.linspace(0.0, 45.0, 91), np.linspace(-20.0, 20.0, 81)))
    ground = np.column_stack((x, y, np.full(len(x), -1.7)))
    boxes = Boxes3D(np.array([[20.0, 5.0, -0.8]]), np.array([[0.6, 0.6, 1.8]]), np.zeros(1))
    slopes = []
    for seed in range(60):
        cloud, moved = on_waves(cloud_of(ground, 0.2), boxes, np.random.default_rng(seed))
        under = int(np.argmin(np.hypot(x - 20.0, y - 5.0)))
        raised = cloud.xyz_m[:, 2].astype(np.float64) + 1.7
        assert moved.center_m[0, 2] + 0.8 == pytest.approx(raised[under], abs=1e-5)
        # the sensor stays as high over the ground under it
        assert raised[int(np.argmin(np.hypot(x, y)))] == pytest.approx(0.0, abs=1e-5)
        np.testing.assert_array_equal(cloud.xyz_m[:, :2], ground[:, :2].astype(np.float32))
        slopes.append((np.diff(raised.reshape(81, 91), axis=1) / 0.5).std())
    assert 0.2 * WAVE_SLOPE < np.mean(slopes) < 1.5 * WAVE_SLOPE
