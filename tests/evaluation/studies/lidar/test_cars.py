"""Cars of many shapes fill their boxes, and only mirrors stand out."""

import numpy as np
import pytest

from evaluation.studies.lidar.cars import LOST, drawn_car, lost_share
from scenarios.sensors.lidar.shapes import ELLIPSOID


@pytest.mark.parametrize("size", [(3.4, 1.5, 1.4), (4.6, 1.8, 1.5), (5.8, 2.0, 2.1)])
def test_cars_fill_their_boxes(size: tuple[float, float, float]) -> None:
    for seed in range(40):
        parts = drawn_car(np.array(size), np.random.default_rng(seed))
        body = parts.kind != ELLIPSOID
        low = (parts.center_m - parts.half_m)[body].min(axis=0)
        high = (parts.center_m + parts.half_m)[body].max(axis=0)
        np.testing.assert_allclose(high[:2] - low[:2], size[:2], rtol=1e-9)
        assert low[2] == pytest.approx(0.0, abs=1e-9)
        assert high[2] == pytest.approx(size[2], rel=1e-9)
        mirrors = parts.half_m[~body][:, 1] + np.abs(parts.center_m[~body][:, 1]) - 0.5 * size[1]
        assert len(mirrors) == 2
        assert (mirrors < 0.13 * size[1]).all()


def test_some_cars_lose_echoes() -> None:
    rng = np.random.default_rng(2)
    shares = np.array([lost_share(rng) for _ in range(2000)])
    assert np.mean(shares > 0.0) == pytest.approx(LOST[0], abs=0.05)
    assert shares.max() <= LOST[1]
