"""Probability of existence: closed forms, and shares counted in simulated clutter."""

from dataclasses import replace
from math import exp, pi, sqrt

import numpy as np
import pytest

from smartmot import (
    ConfigError,
    ExistenceConfig,
    Tracker,
    TrackerConfig,
    detections_from_arrays,
    tracker_config,
)
from smartmot.filters.existence import Existence
from smartmot.types import FloatArray

CAR = np.zeros(1, dtype=np.int64)


def test_a_miss_is_bayes_rule() -> None:
    """0.5 with a detection probability of 0.9: 0.5 x 0.1 / (0.5 x 0.1 + 0.5)."""
    existence = Existence(ExistenceConfig(detection_probability=0.9, mean_life_s=1e9), np.full(6, 0.04))
    after = existence.after(np.array([0.5]), existence.missed(CAR), CAR, 0.1)
    np.testing.assert_allclose(after, [0.05 / 0.55], rtol=1e-9)


def test_a_detection_is_the_ratio_of_densities() -> None:
    """P = diag(0.05, 0.2), R = 0.04, v = (0.3, -0.2): 1 - 0.8 + 0.8 N(v; 0, P + R) / 1e-3."""
    config = ExistenceConfig(detection_probability=0.8, clutter_per_m2=1e-3, mean_life_s=2.0)
    existence = Existence(config, np.full(6, 0.04))
    covariance = (np.array([0.05]), np.array([0.2]), np.array([0.0]))
    ratio = existence.found(np.array([[0.3, -0.2]]), covariance, CAR, None)
    density = exp(-0.5 * (0.09 / 0.09 + 0.04 / 0.24)) / (2.0 * pi * sqrt(0.09 * 0.24))
    expected = 0.2 + 0.8 * density / 1e-3
    np.testing.assert_allclose(ratio, [expected], rtol=1e-12)
    prior = 0.3 * exp(-0.5 / 2.0)
    after = existence.after(np.array([0.3]), ratio, CAR, 0.5)
    np.testing.assert_allclose(after, [expected * prior / (1.0 - prior + expected * prior)], rtol=1e-12)


def test_stated_noise_takes_the_place_of_the_configured() -> None:
    existence = Existence(ExistenceConfig(), np.full(6, 0.04))
    covariance = (np.array([0.05]), np.array([0.2]), np.array([0.01]))
    stated = np.zeros((1, 3, 3))
    stated[0] = np.diag([0.04, 0.04, np.nan])
    offset = np.array([[0.3, 0.1]])
    np.testing.assert_allclose(
        existence.found(offset, covariance, CAR, stated), existence.found(offset, covariance, CAR, None)
    )
    stated[0, 0, 1] = stated[0, 1, 0] = 0.02
    spread = np.array([[0.09, 0.03], [0.03, 0.24]])
    density = exp(-0.5 * offset[0] @ np.linalg.inv(spread) @ offset[0]) / (
        2.0 * pi * sqrt(np.linalg.det(spread))
    )
    np.testing.assert_allclose(existence.found(offset, covariance, CAR, stated), [0.1 + 0.9 * density / 1e-4])


SIDE_M, FRAME_S, DETECTED, LIFE_S = 100.0, 0.1, 0.8, 5.0


def _simulated(seed: int, clutter_per_frame: float, births_per_frame: float) -> tuple[FloatArray, FloatArray]:
    """Existence of all tracks in all frames of 40 s, and whether an object that exists is at the track.

    Cars at up to 5 m/s live 5 s on average in a square of 100 m; detections are seen with probability 0.8 and
    0.2 m of noise; false ones are uniform, their number is Poisson's.
    """
    rng = np.random.default_rng(seed)
    fresh = births_per_frame * DETECTED
    config = tracker_config("default")
    config = replace(
        config,
        lifecycle=replace(
            config.lifecycle, confirm_s=0.0, max_age_s=0.55, tentative_max_age_s=None, rest_max_age_s=None
        ),
        association=replace(config.association, hidden_gate_m=None),
        report=replace(config.report, tentative=True, coasted_s=None, score=0.0, mean_score=0.0),
        score_reference=1.0,
        existence=ExistenceConfig(
            detection_probability=DETECTED,
            clutter_per_m2=clutter_per_frame / SIDE_M**2,
            initial=fresh / (fresh + clutter_per_frame),
            mean_life_s=LIFE_S,
        ),
    )
    tracker = Tracker(config)
    place, velocity = np.zeros((0, 2)), np.zeros((0, 2))
    said, true = [], []
    for k in range(400):
        lives = rng.random(len(place)) < exp(-FRAME_S / LIFE_S)
        place, velocity = place[lives] + FRAME_S * velocity[lives], velocity[lives]
        new = rng.poisson(births_per_frame)
        place = np.concatenate((place, rng.uniform(0, SIDE_M, (new, 2))))
        velocity = np.concatenate((velocity, rng.uniform(-3.5, 3.5, (new, 2))))
        seen = place[rng.random(len(place)) < DETECTED]
        false = rng.uniform(0, SIDE_M, (rng.poisson(clutter_per_frame), 2))
        center = np.concatenate((seen + rng.normal(0, 0.2, seen.shape), false))
        n = len(center)
        detections, _ = detections_from_arrays(
            FRAME_S * k, center, np.tile([4.5, 1.8], (n, 1)), np.zeros(n), category=["car"] * n
        )
        tracks = tracker.update(detections)
        assert tracks.existence is not None
        if k < 20 or not len(tracks):
            continue
        apart = np.linalg.norm(tracks.boxes.center_m[:, None] - place[None], axis=2)
        said.append(tracks.existence)
        true.append((apart < 2.0).any(axis=1))
    return np.concatenate(said), np.concatenate(true).astype(float)


@pytest.mark.parametrize("clutter_per_frame", [1.0, 4.0])
def test_tracks_exist_as_often_as_they_say(clutter_per_frame: float) -> None:
    said, true = _simulated(1, clutter_per_frame, 0.3)
    edges = [0.0, 0.1, 0.5, 0.9, 0.99, 1.0]
    bins = np.digitize(said, edges[1:-1])
    counts = np.bincount(bins, minlength=5)
    assert (counts > 50).all()
    expected = np.bincount(bins, said, minlength=5) / counts
    counted = np.bincount(bins, true, minlength=5) / counts
    # frames of a track are not independent: an error of 0.1 in the middle, 0.03 at the ends
    np.testing.assert_allclose(counted, expected, atol=0.1)
    assert counted[0] < 0.1
    assert counted[-1] > 0.97


def test_clutter_is_told_from_objects() -> None:
    """By its existence a track is sorted right in at least 95 of 100 pairs of a true and a false one."""
    said, true = _simulated(2, 4.0, 0.3)
    exists, ghost = said[true == 1.0], said[true == 0.0]
    rng = np.random.default_rng(0)
    pairs = rng.choice(exists, 4000) > rng.choice(ghost, 4000)
    assert pairs.mean() > 0.95


def test_a_tracker_without_the_setting_does_not_tell() -> None:
    tracks = Tracker(TrackerConfig()).update_arrays(0.0, [[0, 0]], [[4, 2]], [0.0], category=["car"])
    assert tracks.existence is None
    assert tracks[:0].existence is None
    told = Tracker(tracker_config("default")).update_arrays(0.0, [[0, 0]], [[4, 2]], [0.0], category=["car"])
    assert told.existence is not None
    assert told.existence.tolist() == [0.5]


@pytest.mark.parametrize(
    "setting",
    [{"detection_probability": 1.0}, {"clutter_per_m2": 0.0}, {"initial": 0.0}, {"mean_life_s": -1.0}],
)
def test_impossible_settings_are_refused(setting: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match=next(iter(setting))):
        ExistenceConfig(**setting)  # type: ignore[arg-type]


def test_what_is_shown_by_existence_needs_existence() -> None:
    with pytest.raises(ConfigError, match=r"report\.existence needs existence"):
        TrackerConfig(report=replace(TrackerConfig().report, existence=0.5))
