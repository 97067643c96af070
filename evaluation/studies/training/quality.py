"""How good boxes of frames are: right and missed ones by class, F1, and scores turned into probabilities."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize

from smartmot.arrays import BoolArray, FloatArray, IntArray, StrArray
from smartmot.lidar.learned import PillarGrid
from smartmot.overlap import bev_iou
from smartmot.pointcloud import Boxes3D

LEAST_OVERLAP = {"car": 0.5, "pedestrian": 0.3, "cyclist": 0.3}
"""IoU from above of a right box."""

LEAST_SCORES = tuple(round(0.05 * k, 2) for k in range(1, 19))
"""That are tried for the greatest F1."""

FARTHEST_M = 40.0
"""Of labels and boxes that count, which lie in the cells of the network, too."""


@dataclass(frozen=True, slots=True, eq=False)
class ClassBoxes:
    """All boxes of one class over some frames.

    Args:
        score: (N,) of each box.
        is_right: (N,) whether it is the surest box on a label that counts.
        is_ignored: (N,) whether it is on a label that does not count.
        labels: that count.
    """

    score: FloatArray
    is_right: BoolArray
    is_ignored: BoolArray
    labels: int

    def counts(self, least_score: float) -> tuple[int, int]:
        """Right and false boxes of at least a score."""
        taken = (self.score >= least_score) & ~self.is_ignored
        right = int((self.is_right & taken).sum())
        return right, int(taken.sum()) - right

    def f1(self, least_score: float) -> float:
        """Harmonic mean of precision and recall of the boxes of at least a score; 0 without labels."""
        right, false = self.counts(least_score)
        return 2.0 * right / max(right + false + self.labels, 1)

    def best(self) -> tuple[float, float]:
        """The greatest F1, and the least score at which it is reached."""
        values = [self.f1(least) for least in LEAST_SCORES]
        at = int(np.argmax(values))
        return values[at], LEAST_SCORES[at]


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
) -> tuple[FloatArray, BoolArray, BoolArray, int]:
    """One class of one frame; see `ClassBoxes`.

    Boxes beyond `FARTHEST_M` or off the grid are left out, and labels there do not count: a network sees
    nothing there. `is_unlabelled`: (N,) boxes that count only if they are right.
    """
    own = np.flatnonzero((category == name) & _counts_at(boxes.center_m, grid))
    own = own[np.argsort(-score[own], kind="stable")]
    those = np.flatnonzero(kinds == name)
    counting = _counts_at(labels.center_m[those], grid) & (counts[those] >= least_points)
    right, ignored = np.zeros(len(own), dtype=np.bool_), np.zeros(len(own), dtype=np.bool_)
    if len(own) and len(those):
        iou = bev_iou(boxes[own].on_ground, labels[those].on_ground)
        free = counting.copy()
        for row in range(len(own)):
            best = int(np.where(free, iou[row], -1.0).argmax())
            if free[best] and iou[row, best] > LEAST_OVERLAP[name]:
                right[row], free[best] = True, False
        ignored = ~right & (iou[:, ~counting].max(axis=1, initial=0.0) > LEAST_OVERLAP[name])
    if is_unlabelled is not None:
        ignored |= ~right & is_unlabelled[own]
    return score[own], right, ignored, int(counting.sum())


def _counts_at(center_m: FloatArray, grid: PillarGrid) -> BoolArray:
    """(N,) whether centres are near enough and in the cells of the grid."""
    x, y = center_m[:, :2].T
    counts: BoolArray = np.hypot(x, y) <= FARTHEST_M
    for value, (low, high) in ((x, grid.ahead_m), (y, grid.left_m)):
        counts &= (value >= low) & (value < high)
    return counts


def joined(parts: Sequence[tuple[FloatArray, BoolArray, BoolArray, int]]) -> ClassBoxes:
    """Boxes of all frames as one."""
    score, right, ignored = (np.concatenate([part[k] for part in parts]) for k in range(3))
    return ClassBoxes(score, right, ignored, sum(part[3] for part in parts))


def calibrated(score: FloatArray, is_right: BoolArray) -> tuple[float, float]:
    """Factor and offset of logits that make scores probabilities of being right (Platt, 1999).

    Identity where all or none are right.
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
    return float(solution[0]), float(solution[1])
