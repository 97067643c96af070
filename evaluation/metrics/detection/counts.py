"""True and false positives and misses by overlap in space, with both ways of counting what was missed.

Source: "Detección de objetos 3D mediante LiDAR en sistemas embebidos", master's thesis, Bilbao 2022, chapter
on evaluation: a detection belongs to the label that it overlaps most; it is a true positive if their IoU is
over 0.5, the class is right and the label has none yet; every other one is a false positive. The thesis
counts as missed only labels that no detection of their class overlaps at all; the usual count is labels less
true positives.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from evaluation.metrics.detection.pairs import frame_pairs
from scenarios.recorded.kitti_objects.labels import DONT_CARE, ObjectLines
from smartmot.pointcloud.boxes import pair_overlaps
from smartmot.types import BoolArray

THESIS_OVERLAP = 0.5


@dataclass(frozen=True, slots=True)
class DetectionCounts:
    """Counts of one class or group.

    Args:
        true_positives: detections that are right.
        false_positives: all others.
        missed: labels less true positives.
        untouched: labels that no detection overlaps.
    """

    true_positives: int
    false_positives: int
    missed: int
    untouched: int

    @property
    def precision(self) -> float:
        """Share of the detections that are right; NaN without any."""
        return _share(self.true_positives, self.false_positives)

    def recall(self, thesis: bool = False) -> float:
        """Share of true positives among them and the missed, or the untouched; NaN without any."""
        return _share(self.true_positives, self.untouched if thesis else self.missed)

    def f1(self, thesis: bool = False) -> float:
        """Harmonic mean of precision and recall, 2 TP / (2 TP + FP + FN); NaN where there is nothing."""
        wrong = self.false_positives + (self.untouched if thesis else self.missed)
        return _share(2 * self.true_positives, wrong)


def _share(part: int, others: int) -> float:
    return part / (part + others) if part + others else math.nan


@dataclass(frozen=True, slots=True, eq=False)
class MatchedDetections:
    """Which labels and detections belong together.

    Args:
        labels: N labels without regions.
        detections: M detections.
        is_detected: (N,) whether a label has a true positive.
        is_touched: (N,) whether any detection overlaps it.
        is_true: (M,) whether a detection is a true positive.
    """

    labels: ObjectLines
    detections: ObjectLines
    is_detected: BoolArray
    is_touched: BoolArray
    is_true: BoolArray

    def counts(self, label_mask: BoolArray, detection_mask: BoolArray) -> DetectionCounts:
        """Counts of a part of the labels and of the detections.

        Args:
            label_mask: (N,) labels that count.
            detection_mask: (M,) detections whose mistakes count.
        """
        return DetectionCounts(
            int(np.count_nonzero(self.is_detected & label_mask)),
            int(np.count_nonzero(~self.is_true & detection_mask)),
            int(np.count_nonzero(~self.is_detected & label_mask)),
            int(np.count_nonzero(~self.is_touched & label_mask)),
        )


def match_detections(
    labels: ObjectLines, detections: ObjectLines, least_overlap: float = THESIS_OVERLAP
) -> MatchedDetections:
    """Give each detection, by falling score, the label that it overlaps most.

    Args:
        labels: Of all frames; regions are left out.
        detections: Of the same frames.
        least_overlap: IoU in space that a true positive exceeds.
    """
    kept = labels.chosen(labels.type_name != DONT_CARE)
    j, i = frame_pairs(detections.frame, kept.frame)
    _, overlap = pair_overlaps(detections.boxes[j], kept.boxes[i])
    # each class is counted on its own: a detection of another class touches nothing and is false
    touching = (overlap > 0.0) & (kept.type_name[i] == detections.type_name[j])
    i, j, overlap = i[touching], j[touching], overlap[touching]
    is_touched = np.zeros(len(kept), dtype=np.bool_)
    is_touched[i] = True
    # of each detection the pair with the greatest overlap; of equal ones the first label
    order = np.lexsort((i, -overlap, j))
    first = np.unique(j[order], return_index=True)[1]
    best = order[first]
    best = best[overlap[best] > least_overlap]
    best = best[np.argsort(-detections.score[j[best]], kind="stable")]
    winner = best[np.unique(i[best], return_index=True)[1]]
    is_detected, is_true = np.zeros(len(kept), dtype=np.bool_), np.zeros(len(detections), dtype=np.bool_)
    is_detected[i[winner]] = True
    is_true[j[winner]] = True
    return MatchedDetections(kept, detections, is_detected, is_touched, is_true)
