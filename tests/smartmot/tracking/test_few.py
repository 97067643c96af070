"""Few objects are tracked one by one, many as arrays: with the same results."""

import numpy as np
import pytest

from smartmot import Boxes, Detections, Tracker, TrackerConfig, Tracks, tracker_config
from smartmot.filters import existence
from smartmot.tracking import association, evidence

NAMES = np.array(["car", "pedestrian", "cyclist", "unknown", "truck"])


def _crowd(seed: int, most: int) -> list[Detections]:
    """Objects that cross, vanish, change their class and are false: 40 frames."""
    rng = np.random.default_rng(seed)
    place, velocity = rng.uniform(-6, 6, (most, 2)), rng.uniform(-3, 3, (most, 2))
    size, name = rng.uniform(0.5, 4, (most, 2)), rng.choice(NAMES, most)
    frames = []
    for k in range(40):
        seen = rng.random(most) < 0.8
        n = int(seen.sum())
        center = (place + 0.1 * k * velocity)[seen] + rng.normal(0, 0.1, (n, 2))
        yaw = np.arctan2(velocity[:, 1], velocity[:, 0])[seen] + np.pi * (rng.random(n) < 0.2)
        names = np.where(rng.random(n) < 0.9, name[seen], rng.choice(NAMES, n))
        frames.append(Detections(0.1 * k, Boxes(center, size[seen], yaw), rng.uniform(0.1, 1, n), names))
    return frames


def _tracked(config: TrackerConfig, frames: list[Detections]) -> list[Tracks]:
    tracker = Tracker(config)
    return [tracker.update(frame) for frame in frames]


@pytest.mark.parametrize("name", ["default", "presets"])
@pytest.mark.parametrize("most", [1, 4, 9])
@pytest.mark.parametrize("seed", range(5))
def test_loops_and_arrays_track_alike(
    monkeypatch: pytest.MonkeyPatch, name: str, most: int, seed: int
) -> None:
    config = TrackerConfig() if name == "presets" else tracker_config(name)
    frames = _crowd(seed, most)
    made = []
    for few in (0, 10_000):
        for module, limits in (
            (association, ("FEW_CELLS", "FEW_PAIRS")),
            (evidence, ("_FEW",)),
            (existence, ("_FEW",)),
        ):
            for limit in limits:
                monkeypatch.setattr(module, limit, few)
        made.append(_tracked(config, frames))
    assert sum(len(tracks) for tracks in made[0]) > 0
    for arrays, loops in zip(*made, strict=True):
        assert arrays.track_id.tolist() == loops.track_id.tolist()
        assert arrays.category.tolist() == loops.category.tolist()
        np.testing.assert_allclose(loops.mean, arrays.mean, rtol=0.0, atol=1e-9)
        np.testing.assert_allclose(loops.covariance, arrays.covariance, rtol=0.0, atol=1e-9)
        if arrays.existence is not None:
            np.testing.assert_allclose(loops.existence, arrays.existence, rtol=0.0, atol=1e-9)
