"""What to tell users about recordings whose scores or labels do not suit the tracker, a line each."""

from __future__ import annotations

import numpy as np

from evaluation.results.notes import MANY_DROPPED
from scenarios.recorded.dataset import Dataset
from smartmot.plugins import Plugin
from smartmot.tracking.own import limits_of_own, own
from smartmot.tracking.tracker import ScoreLimits, Tracker, TrackerConfig
from smartmot.types import CATEGORIES

LEAST_SHARE = 0.1
"""Users are told when a smaller share of their detections can start a track; on KITTI it is over a half."""


def notes_on(data: Dataset, config: TrackerConfig | Plugin) -> list[str]:
    """All lines about recordings and the tracker that is to track them."""
    if isinstance(config, TrackerConfig):
        # with relative thresholds the detections themselves say what is weak
        notes = weak_categories(data, config) if config.score_reference == 1.0 else []
        limits: ScoreLimits | None = Tracker(config).score_limits
    else:
        notes, limits = [], limits_of_own(own(config))
    if limits is not None:
        notes += dropped_detections(data, limits)
    return notes + unscored_categories(data)


def weak_categories(data: Dataset, config: TrackerConfig) -> list[str]:
    """Categories whose scores hardly ever start a track."""
    least = Tracker(config).score_limits.start
    notes = []
    for code, category in enumerate(CATEGORIES):
        scores = [s.detections.score[s.detections.category == category] for s in data.sequences]
        score = np.concatenate([np.zeros(0), *scores])
        share = float(np.mean(score >= least[code])) if len(score) else 1.0
        if share < LEAST_SHARE:
            notes.append(
                f"{100.0 * share:.0f} % of the {category} detections have a score of {least[code]:g} or more"
                f"{_scale(data)}; others start no track: fit the "
                "configuration to the detector (docs/tracking.md)"
            )
    return notes


def dropped_detections(data: Dataset, limits: ScoreLimits) -> list[str]:
    """Detections under the tracker's score threshold: many of them, or all."""
    counts = [limits.counts(frame) for s in data.sequences for frame in s.frames()]
    dropped, usable = (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0)
    total = sum(len(s.detections) for s in data.sequences)
    if total and not usable:
        highest = max(float(s.detections.score.max(initial=0.0)) for s in data.sequences)
        return [
            f"no tracks: none of {total} detections has the score of {float(limits.start.min()):g}"
            f"{_scale(data)} that the tracker needs to start one (highest: {highest:.3g}); scale the scores, "
            "or give a configuration with lower thresholds (--config)"
        ]
    if dropped > MANY_DROPPED * total:
        return [f"{dropped} of {total} detections dropped: their scores are under the tracker's threshold"]
    return []


def unscored_categories(data: Dataset) -> list[str]:
    """Categories of labels that the detector never reports."""
    labelled = {name for s in data.sequences if s.labels is not None for name in s.labels.category.tolist()}
    detected = {name for s in data.sequences for name in s.detections.category.tolist()}
    missing = [name for name in CATEGORIES if name in labelled - detected and name != "unknown"]
    return [f"labels, but no detections, of {', '.join(missing)}: not scored"] if missing else []


def _scale(data: Dataset) -> str:
    return " (as probability)" if data.log_odds else ""


told_dropped = dropped_detections  # its name in version 0.1.0, found from the old module
