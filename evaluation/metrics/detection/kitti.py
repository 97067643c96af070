"""Average precision by KITTI's rule, in the image, from above and in space.

Source: KITTI object development kit, evaluate_object.cpp; its 40 recall points: Simonelli et al.,
"Disentangling Monocular 3D Object Detection", 2019. For each class and difficulty:

- a label counts if it is of the class and within the limits of height, occlusion and truncation; beyond them,
  or of a neighbouring class, it is ignored: neither missed nor, if detected, a true positive;
- a detection lower than the least height is ignored unless it is the one that a label gets;
- scores at which recall grows by 1/40 are the thresholds; at each of them labels are given the detection that
  overlaps most, in the order of the file, and precision is the best at this or any greater recall.

Each threshold is the score of a true positive: with n < 41 labels at most n of the 41 recalls are reached, so
that even detections without a fault have R40 of (n - 1)/40. That is the program's rule, and stays.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evaluation.metrics.detection.pairs import frame_pairs, image_overlap
from scenarios.recorded.kitti_objects.labels import DONT_CARE, ObjectLines
from smartmot.pointcloud.boxes import pair_overlaps
from smartmot.types import BoolArray, FloatArray, IntArray

DIFFICULTIES = ("easy", "moderate", "hard")
LEAST_HEIGHT_PX = (40.0, 25.0, 25.0)
MOST_OCCLUDED = (0, 1, 2)
MOST_TRUNCATED = (0.15, 0.30, 0.50)
"""Limits of the difficulties (evaluate_object.cpp)."""

NEIGHBOUR = {"Car": "Van", "Pedestrian": "Person_sitting"}
"""Classes whose labels are ignored where the other is scored."""

LEAST_OVERLAP = {"Car": 0.7, "Van": 0.7, "Truck": 0.7, "Tram": 0.7}
OTHER_OVERLAP = 0.5
"""IoU of a match; that of pedestrians, cyclists and all others."""

VIEWS = ("image", "bev", "3d")
_STEPS = 40


@dataclass(frozen=True, slots=True)
class AveragePrecision:
    """Result of one class, view and difficulty.

    Args:
        type_name: KITTI's type.
        view: one of VIEWS.
        difficulty: one of DIFFICULTIES.
        labels: those that count.
        least_overlap: IoU of a match.
        r11: mean precision at 11 recalls from 0 on, percent.
        r40: mean precision at 40 recalls from 1/40 on, percent.
    """

    type_name: str
    view: str
    difficulty: str
    labels: int
    least_overlap: float
    r11: float
    r40: float


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Pairs of labels and detections that overlap enough, of labels and detections that are not left out."""

    candidates: tuple[tuple[int, tuple[tuple[int, float], ...]], ...]
    label_ignored: BoolArray
    detection_ignored: BoolArray
    detection_valid: BoolArray
    score: FloatArray


def average_precision(
    labels: ObjectLines,
    detections: ObjectLines,
    type_names: Sequence[str],
    least_overlap: float | None = None,
) -> list[AveragePrecision]:
    """Average precision of some classes.

    Args:
        labels: Of all frames.
        detections: Of the same frames.
        type_names: KITTI's types.
        least_overlap: IoU of a match; None: `LEAST_OVERLAP`.
    """
    kept = labels.chosen(labels.type_name != DONT_CARE)
    i, j = frame_pairs(kept.frame, detections.frame)
    bev, space = pair_overlaps(kept.boxes[i], detections.boxes[j])
    by_view = dict(zip(VIEWS, (image_overlap(kept.image_box_px[i], detections.image_box_px[j]), bev, space)))  # noqa: B905
    regions = labels.chosen(labels.type_name == DONT_CARE)
    results = []
    for name in type_names:
        least = LEAST_OVERLAP.get(name, OTHER_OVERLAP) if least_overlap is None else least_overlap
        in_region = _in_region(regions, detections, least)
        for view, overlap in by_view.items():
            near = overlap > least
            for level, difficulty in enumerate(DIFFICULTIES):
                pairs, valid = _pairs(kept, detections, name, level, (i[near], j[near], overlap[near]))
                unlabelled = in_region if view == "image" else np.zeros(len(detections), dtype=np.bool_)
                precision = _precision(pairs, valid, unlabelled)
                r11, r40 = 100.0 * precision[::4].mean(), 100.0 * precision[1:].mean()
                results.append(AveragePrecision(name, view, difficulty, valid, least, float(r11), float(r40)))
    return results


def _in_region(regions: ObjectLines, detections: ObjectLines, least: float) -> BoolArray:
    """(M,) whether a region that is not labelled covers enough of a detection's image box."""
    i, j = frame_pairs(regions.frame, detections.frame)
    share = image_overlap(regions.image_box_px[i], detections.image_box_px[j], of_b=True)
    covered = np.zeros(len(detections), dtype=np.bool_)
    covered[j[share > least]] = True
    return covered


def _pairs(
    labels: ObjectLines,
    detections: ObjectLines,
    name: str,
    level: int,
    near: tuple[IntArray, IntArray, FloatArray],
) -> tuple[_Pairs, int]:
    """What a class and difficulty compare, and how many labels count."""
    height = labels.image_box_px[:, 3] - labels.image_box_px[:, 1]
    within = (
        (labels.occluded <= MOST_OCCLUDED[level])
        & (labels.truncated <= MOST_TRUNCATED[level])
        & (height > LEAST_HEIGHT_PX[level])
    )
    own = labels.type_name == name
    used = own | (labels.type_name == NEIGHBOUR.get(name, name))
    # as in evaluate_object.cpp: a low detection of any class can be given to a label
    low = np.abs(detections.image_box_px[:, 3] - detections.image_box_px[:, 1]) < LEAST_HEIGHT_PX[level]
    valid = (detections.type_name == name) & ~low
    i, j, overlap = near
    chosen = used[i] & (valid | low)[j]
    rows: dict[int, list[tuple[int, float]]] = {}
    for label, detection, share in zip(
        i[chosen].tolist(), j[chosen].tolist(), overlap[chosen].tolist(), strict=True
    ):
        rows.setdefault(label, []).append((detection, share))
    candidates = tuple((label, tuple(pairs)) for label, pairs in rows.items())
    counted = own & within
    return _Pairs(candidates, ~counted, low, valid, detections.score), int(counted.sum())


def _precision(pairs: _Pairs, valid: int, unlabelled: BoolArray) -> FloatArray:
    """(41,) best precision at recalls of at least k/40; 0 where none is reached."""
    precision = np.zeros(_STEPS + 1)
    thresholds = _thresholds(_true_positive_scores(pairs), valid)
    for number, threshold in enumerate(thresholds):
        true, false = _counts(pairs, threshold, unlabelled)
        precision[number] = true / (true + false) if true + false else 0.0
    return np.maximum.accumulate(precision[::-1])[::-1]


def _true_positive_scores(pairs: _Pairs) -> list[float]:
    """Scores of the labels' detections if each takes the one with the greatest score."""
    assigned: set[int] = set()
    scores = []
    for label, candidates in pairs.candidates:
        free = [detection for detection, _ in candidates if detection not in assigned]
        if not free:
            continue
        best = max(free, key=lambda detection: float(pairs.score[detection]))
        assigned.add(best)
        if not (pairs.label_ignored[label] or pairs.detection_ignored[best]):
            scores.append(float(pairs.score[best]))
    return scores


def _thresholds(scores: list[float], valid: int) -> list[float]:
    """Scores at which recall comes nearest to the next multiple of 1/40."""
    thresholds = []
    recall = 0.0
    ordered = sorted(scores, reverse=True)
    for number, score in enumerate(ordered):
        left = (number + 1) / valid
        last = number == len(ordered) - 1
        right = left if last else (number + 2) / valid
        if not last and right - recall < recall - left:
            continue
        thresholds.append(score)
        recall += 1.0 / _STEPS
    return thresholds[: _STEPS + 1]


def _counts(pairs: _Pairs, threshold: float, unlabelled: BoolArray) -> tuple[int, int]:
    """True and false positives among the detections with a score of at least the threshold."""
    above = pairs.score >= threshold
    assigned = np.zeros(len(above), dtype=np.bool_)
    true = 0
    for label, candidates in pairs.candidates:
        best, most, low = -1, 0.0, -1
        for detection, overlap in candidates:
            if assigned[detection] or not above[detection]:
                continue
            if pairs.detection_ignored[detection]:
                low = detection if low < 0 else low
            elif overlap > most:
                best, most = detection, overlap
        if best < 0 and low < 0:
            continue
        assigned[best if best >= 0 else low] = True
        true += best >= 0 and not pairs.label_ignored[label]
    false = pairs.detection_valid & above & ~assigned & ~unlabelled
    return true, int(np.count_nonzero(false))
