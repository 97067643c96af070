"""Boxes against labels from above: average precision, F1 and both counts of misses at any score.

A box belongs to the free label of its class that it overlaps most, by falling score, so that boxes of at
least a score are matched as they would be without the others. Labels that do not count, for having too few
points or no place in the field of view, are neither missed nor, with a box on them, a false positive.

Both counts of misses are those of `evaluation.metrics.detection.counts`; there overlap is in space and the
score has a limit of its own.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evaluation.metrics.detection.counts import DetectionCounts
from smartmot.arrays import BoolArray, FloatArray
from smartmot.overlap import bev_iou
from smartmot.types import Boxes

RECALLS = np.arange(1, 41) / 40.0
"""At which precision is averaged (Simonelli et al., "Disentangling Monocular 3D Object Detection", 2019)."""


LEAST_OVERLAP = {"car": 0.5, "pedestrian": 0.3, "cyclist": 0.3}
"""IoU from above that a right box exceeds: half of it for cars; a person is two cells of a detector's grid
wide, so that a shift by one leaves a third."""

LEAST_SCORES = tuple(round(0.05 * k, 2) for k in range(1, 19))
"""That are tried for the greatest F1 at a round score."""


@dataclass(frozen=True, slots=True, eq=False)
class ScoredBoxes:
    """Boxes and labels of one class, matched; of one frame, or of several.

    Args:
        score: (M,) of the boxes, without those on labels that do not count.
        is_true: (M,) whether a box is the one of its label.
        label_score: (N,) score of the box of each label that counts; -inf: it has none.
        touched_score: (N,) highest score of all boxes that overlap it at all; -inf: none does.
    """

    score: FloatArray
    is_true: BoolArray
    label_score: FloatArray
    touched_score: FloatArray

    def counts(self, least_score: float, labels: BoolArray | None = None) -> DetectionCounts:
        """Counts of the boxes of at least a score.

        Args:
            least_score: of the boxes.
            labels: (N,) labels that are looked at; None: all. False positives are those of all boxes.
        """
        every = np.ones(len(self.label_score), dtype=np.bool_) if labels is None else labels
        right = int(np.count_nonzero(self.label_score[every] >= least_score))
        touched = int(np.count_nonzero(self.touched_score[every] >= least_score))
        false = int(np.count_nonzero((self.score >= least_score) & ~self.is_true))
        count = int(np.count_nonzero(every))
        return DetectionCounts(right, false, count - right, count - touched)

    @property
    def labels(self) -> int:
        """How many count."""
        return len(self.label_score)

    def f1(self, least_score: float) -> float:
        """Harmonic mean of precision and recall of the boxes of at least a score; 0: there is none."""
        counts = self.counts(least_score)
        boxes = counts.true_positives + counts.false_positives
        return 2.0 * counts.true_positives / max(boxes + self.labels, 1)

    def best(self) -> tuple[float, float]:
        """The greatest F1 at one of `LEAST_SCORES`, and the least of them that reaches it."""
        values = [self.f1(least) for least in LEAST_SCORES]
        at = int(np.argmax(values))
        return values[at], LEAST_SCORES[at]

    @property
    def best_score(self) -> float:
        """The score that is least where F1 is greatest; inf where no box is right."""
        order = np.argsort(-self.score, kind="stable")
        score, right = self.score[order], np.cumsum(self.is_true[order])
        if not len(score) or not right[-1]:
            return math.inf
        # boxes of one score are taken together
        last = np.append(score[1:] < score[:-1], True)
        f1 = 2.0 * right / (np.arange(1, len(score) + 1) + len(self.label_score))
        return float(score[last][int(f1[last].argmax())])

    @property
    def average_precision(self) -> float:
        """Mean over `RECALLS` of the best precision at that recall or a greater one; NaN without labels."""
        if not len(self.label_score):
            return math.nan
        order = np.argsort(-self.score, kind="stable")
        score, right = self.score[order], np.cumsum(self.is_true[order])
        last = np.append(score[1:] < score[:-1], True)[: len(score)]
        precision = (right / np.arange(1, len(score) + 1))[last]
        recall = right[last] / len(self.label_score)
        best = np.maximum.accumulate(precision[::-1])[::-1]
        place = np.searchsorted(recall, RECALLS - 1e-12)
        return float(np.append(best, 0.0)[place].sum() / len(RECALLS))


def match_from_above(
    boxes: Boxes,
    score: FloatArray,
    labels: Boxes,
    label_counts: BoolArray,
    least_overlap: float,
    is_unlabelled: BoolArray | None = None,
) -> ScoredBoxes:
    """Match the boxes of one class in one frame.

    Args:
        boxes: M boxes.
        score: (M,) of them.
        labels: N labels of the class, and what a box of it may lie on without being wrong.
        label_counts: (N,) whether a label counts.
        least_overlap: IoU from above that a right box exceeds.
        is_unlabelled: (M,) boxes where nothing is labelled, which count only if they are right; None: none.
    """
    order = np.argsort(-score, kind="stable")
    score = score[order]
    count = len(labels)
    is_true, is_ignored = np.zeros(len(score), dtype=np.bool_), np.zeros(len(score), dtype=np.bool_)
    label_score, touched = np.full(count, -np.inf), np.full(count, -np.inf)
    if len(score) and count:
        iou = bev_iou(boxes[order], labels)
        free = label_counts.copy()
        for row in range(len(score)):
            touched = np.where(iou[row] > 0.0, np.maximum(touched, score[row]), touched)
            best = int(np.where(free, iou[row], -1.0).argmax())
            if free[best] and iou[row, best] > least_overlap:
                is_true[row], free[best], label_score[best] = True, False, score[row]
        is_ignored = ~is_true & (iou[:, ~label_counts].max(axis=1, initial=0.0) > least_overlap)
    if is_unlabelled is not None:
        is_ignored |= ~is_true & is_unlabelled[order]
    return ScoredBoxes(
        score[~is_ignored], is_true[~is_ignored], label_score[label_counts], touched[label_counts]
    )


def joined(frames: Sequence[ScoredBoxes]) -> ScoredBoxes:
    """The boxes of all frames together."""
    if not frames:
        nothing = np.zeros(0)
        return ScoredBoxes(nothing, nothing.astype(np.bool_), nothing, nothing)
    columns = ("score", "is_true", "label_score", "touched_score")
    return ScoredBoxes(*(np.concatenate([getattr(frame, name) for frame in frames]) for name in columns))
