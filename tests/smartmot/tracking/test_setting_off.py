"""People who set off, by simulation: flagged early, while hardly anybody who stands is."""

from dataclasses import replace

import numpy as np
import pytest

from smartmot import Boxes, Detections, Tracker, TrackerConfig, tracker_config
from smartmot.types import FloatArray

FRAME_S, NOISE_M, PEOPLE = 0.05, 0.05, 200
STANDING, WALKING = 60, 6
"""Frames at 20 Hz: 3 s of standing, 0.3 s of walking."""


def _flags(config: TrackerConfig, speed_mps: float) -> FloatArray:
    """(frames, people) whom the tracker takes for moving."""
    rng, tracker = np.random.default_rng(0), Tracker(config)
    places = 10.0 * np.stack(np.divmod(np.arange(PEOPLE), 20), axis=-1)
    size, yaw, names = np.full((PEOPLE, 2), 0.5), np.zeros(PEOPLE), np.full(PEOPLE, "pedestrian")
    flags = []
    for k in range(STANDING + WALKING):
        walked_m = speed_mps * FRAME_S * max(k - STANDING + 1, 0)
        center = places + np.array([walked_m, 0.0]) + rng.normal(0.0, NOISE_M, (PEOPLE, 2))
        tracks = tracker.update(Detections(FRAME_S * k, Boxes(center, size, yaw), np.ones(PEOPLE), names))
        assert len(tracks) == PEOPLE
        flags.append(tracks.dynamic)
    return np.array(flags)


def _told_the_noise() -> TrackerConfig:
    """`default`, whose noise is that of a detector in the street, for one of 5 cm, as from a profile."""
    config = tracker_config("default")
    return replace(config, filter=replace(config.filter, position_sigma_m=NOISE_M))


@pytest.mark.parametrize("config", [TrackerConfig(), _told_the_noise()], ids=["presets", "profile"])
def test_who_sets_off_is_known_to_move_within_three_tenths(config: TrackerConfig) -> None:
    """5 km/h from one frame to the next: at least half are flagged, of those who stand at most 1 %."""
    flags = _flags(config, 5.0 / 3.6)
    assert flags[STANDING:].any(axis=0).mean() >= 0.5
    assert flags[20:STANDING].any(axis=0).mean() <= 0.01
