"""People and riders of many shapes fill their boxes, and only what they carry or push stands out."""

import numpy as np
import pytest

from evaluation.studies.lidar.people import drawn_person, drawn_rider
from scenarios.sensors.lidar.shapes import ROLLER


@pytest.mark.parametrize("size", [(0.4, 0.5, 1.75), (0.9, 0.6, 1.8), (0.5, 0.45, 1.1)])
def test_people_fill_their_boxes(size: tuple[float, float, float]) -> None:
    outlines = set()
    for seed in range(60):
        parts = drawn_person(np.array(size), np.random.default_rng(seed))
        low, high = (parts.center_m - parts.half_m).min(axis=0), (parts.center_m + parts.half_m).max(axis=0)
        assert high[2] == pytest.approx(size[2], rel=1e-9)
        assert low[2] == pytest.approx(0.0, abs=1e-9)
        # a head and a foot are where the box is; a pram is ahead, a bag at the side
        head = int(np.argmax((parts.center_m + parts.half_m)[:, 2]))
        assert (np.abs(parts.center_m[head, :2]) < 0.5 * np.array(size[:2])).all()
        assert low[1] >= -0.7 * size[1] - 1e-9
        assert high[1] <= 0.7 * size[1] + 1e-9
        assert low[0] >= -0.85 * size[0]
        assert high[0] <= 0.5 * size[0] + 1.2
        outlines.add((len(parts), round(float(high[0]), 3)))
    assert len(outlines) > 30


def test_a_step_is_longer_than_standing() -> None:
    """Feet of a long box are apart along it, those of a short one across it."""
    apart = {0.4: [], 0.9: []}
    for length, kept in apart.items():
        for seed in range(60):
            parts = drawn_person(np.array((length, 0.6, 1.8)), np.random.default_rng(seed))
            feet = parts.center_m[np.isclose((parts.center_m - parts.half_m)[:, 2], 0.0)]
            kept.append(np.ptp(feet[:2, 0]))
    assert max(apart[0.4]) < 1e-9
    assert np.median(apart[0.9]) > 0.2


def test_riders_sit_between_two_wheels() -> None:
    for seed in range(60):
        size = np.array((1.8, 0.6, 1.75))
        parts = drawn_rider(size, np.random.default_rng(seed))
        low, high = parts.center_m - parts.half_m, parts.center_m + parts.half_m
        wheel = parts.kind == ROLLER
        assert wheel.sum() == 2
        assert low[wheel, 0].min() == pytest.approx(-0.9)
        assert high[wheel, 0].max() == pytest.approx(0.9)
        # as high as long: wheels are round
        np.testing.assert_allclose(parts.half_m[wheel, 0], parts.half_m[wheel, 2])
        assert high[:, 2].max() == pytest.approx(1.75)
        head = int(np.argmax(high[:, 2]))
        assert abs(parts.center_m[head, 0]) < 0.5
        assert (np.abs(low[:, :2]) <= 0.5 * size[:2] + 1e-9).all()
