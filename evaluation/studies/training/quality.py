"""Boxes of frames against their labels where a network looks, and scores turned into probabilities."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

from evaluation.metrics.detection.from_above import LEAST_OVERLAP, ScoredBoxes, match_from_above
from smartmot.arrays import BoolArray, FloatArray, IntArray, StrArray
from smartmot.lidar.learned import PillarGrid
from smartmot.pointcloud import Boxes3D

FARTHEST_M = 40.0
"""Of labels and boxes that count, which lie in the cells of the network, too."""


def match_frame(
    name: str,
    boxes: Boxes3D,
    score: FloatArray,
    category: StrArray,
    labels: Boxes3D,
    kinds: StrArray,
    counts: IntArray,
    least_points: int,
    grid: PillarGrid,
    is_unlabelled: BoolArray | None = None,
) -> ScoredBoxes:
    """One class of one frame.

    Boxes beyond `FARTHEST_M` or off the grid are left out, and labels there do not count: a network sees
    nothing there. `is_unlabelled`: (N,) boxes that count only if they are right.
    """
    own = (category == name) & _counts_at(boxes.center_m, grid)
    of_class = kinds == name
    counting = _counts_at(labels.center_m[of_class], grid) & (counts[of_class] >= least_points)
    return match_from_above(
        boxes[own].on_ground,
        score[own],
        labels[of_class].on_ground,
        counting,
        LEAST_OVERLAP[name],
        None if is_unlabelled is None else is_unlabelled[own],
    )


def _counts_at(center_m: FloatArray, grid: PillarGrid) -> BoolArray:
    """(N,) whether centres are near enough and in the cells of the grid."""
    x, y = center_m[:, :2].T
    counts: BoolArray = np.hypot(x, y) <= FARTHEST_M
    for value, (low, high) in ((x, grid.ahead_m), (y, grid.left_m)):
        counts &= (value >= low) & (value < high)
    return counts


def calibrated(score: FloatArray, is_right: BoolArray) -> tuple[float, float]:
    """Factor and offset of logits that make scores probabilities of being right (Platt, 1999).

    Identity where all or none are right, or where higher scores are not more often right.
    """
    if len(score) < 20 or is_right.all() or not is_right.any():
        return 1.0, 0.0
    logit = np.log(np.clip(score, 1e-6, 1.0 - 1e-6) / np.clip(1.0 - score, 1e-6, 1.0))
    # Platt's targets keep the probabilities of few boxes off 0 and 1
    many, few = int(is_right.sum()), int((~is_right).sum())
    wanted = np.where(is_right, (many + 1.0) / (many + 2.0), 1.0 / (few + 2.0))

    def loss(value: FloatArray) -> float:
        margin = value[0] * logit + value[1]
        return float((np.logaddexp(0.0, margin) - wanted * margin).mean())

    solution = minimize(loss, np.array([1.0, 0.0]), method="Nelder-Mead").x
    return (float(solution[0]), float(solution[1])) if solution[0] > 0.0 else (1.0, 0.0)


def rescored(boxes: ScoredBoxes, scale: float, offset: float) -> ScoredBoxes:
    """Boxes with calibrated scores, see `calibrated`; -inf stays what it is."""

    def probability(score: FloatArray) -> FloatArray:
        raw = np.clip(score, 1e-6, 1.0 - 1e-6)
        made: FloatArray = 1.0 / (1.0 + np.exp(-scale * np.log(raw / (1.0 - raw)) - offset))
        return np.where(np.isfinite(score), made, score)

    scores = (boxes.score, boxes.label_score, boxes.touched_score)
    score, of_label, touched = (probability(each) for each in scores)
    return replace(boxes, score=score, label_score=of_label, touched_score=touched)
