"""The score scale of recorded detections, for configurations whose thresholds are relative to it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from scenarios.recorded.dataset import Dataset
from smartmot.filters.motion_models import PerCategory, table
from smartmot.tracking.scores import reference_scores
from smartmot.tracking.settings import CODES, TrackerConfig
from smartmot.types import CATEGORIES

SCALES = ("file", "running", "fixed")
"""Where the reference score of each category comes from: all detections of the recordings, those so far, or
the configuration's thresholds are scores themselves."""


def with_score_scale(config: TrackerConfig, data: Dataset, scale: str) -> TrackerConfig:
    """A configuration for a recording; one whose thresholds are not relative stays as it is.

    Args:
        config: Settings of the tracker.
        data: The recordings.
        scale: One of `SCALES`.
    """
    if config.score_reference is not None or scale == "running":
        return config
    if scale == "fixed":
        return replace(config, score_reference=1.0)
    detections = [sequence.detections for sequence in data.sequences]
    code = np.array([CODES[name] for d in detections for name in d.category.tolist()], dtype=np.int64)
    score = np.concatenate([np.zeros(0), *(d.score for d in detections)])
    return replace(config, score_reference=PerCategory(*reference_scores(code, score).tolist()))


def scale_notes(config: TrackerConfig, data: Dataset) -> list[str]:
    """What a recording's score scale does, a line; nothing if thresholds are not relative."""
    reference = config.score_reference
    if not isinstance(reference, PerCategory):
        return []
    least = config.score_limits().start
    if not least.any() or all(s.detections.score.min(initial=1.0) == 1.0 for s in data.sequences):
        return []
    weak = {}
    for code, category in enumerate(CATEGORIES):
        scores = [s.detections.score[s.detections.category == category] for s in data.sequences]
        score = np.concatenate([np.zeros(0), *scores])
        if len(score):
            count = int(np.count_nonzero(score < least[code]))
            weak[category] = f"{table(reference)[code]:.3g} ({count} of {len(score)})"
    if not weak:  # no detections at all
        return []
    shown = ", ".join(f"{category} {value}" for category, value in weak.items())
    unit = " as probability" if data.log_odds else ""
    return [f"score of a sure detection{unit}, and how many are too weak to start a track: {shown}"]
