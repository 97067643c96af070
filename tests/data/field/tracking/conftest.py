"""Helper of the cases: one frame of boxes into a tracker."""

import numpy as np
import pytest

import smartmot


def frame(tracker, stamp_s, center, size=(4.5, 1.8), yaw=0.0, score=0.95, category="car"):
    center = np.asarray(center, float).reshape(-1, 2)
    n = len(center)
    names = [category] * n if isinstance(category, str) else list(category)
    return tracker.update_arrays(
        stamp_s,
        center,
        np.broadcast_to(np.asarray(size, float), (n, 2)),
        np.broadcast_to(np.asarray(yaw, float), (n,)),
        np.broadcast_to(np.asarray(score, float), (n,)),
        names,
    )


@pytest.fixture
def tracker():
    return smartmot.Tracker(smartmot.tracker_config("default"))


@pytest.fixture
def step():
    return frame
