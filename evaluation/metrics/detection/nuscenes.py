"""nuScenes' mean average precision and errors of true positives.

Source: Caesar et al., "nuScenes: A multimodal dataset for autonomous driving", 2020, section 3.1; values of
nuscenes-devkit 1.2.0. Matching is by the distance of centres on the ground; by falling score each detection
takes the nearest free label of its class and frame. Precision and recall under 0.1 do not count.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evaluation.metrics.detection.counts import MatchedDetections
from evaluation.metrics.detection.pairs import frame_pairs
from scenarios.recorded.kitti_objects.labels import DONT_CARE, ObjectLines
from smartmot.geometry import wrap_angle
from smartmot.types import BoolArray, FloatArray, IntArray

MATCH_DISTANCES_M = (0.5, 1.0, 2.0, 4.0)
ERROR_DISTANCE_M = 2.0
"""Of the matches whose errors count."""

LEAST_RECALL = LEAST_PRECISION = 0.1
_POINTS = 101
_FIRST = 11
"""First of the recalls 0, 0.01, ... over 0.1."""


@dataclass(frozen=True, slots=True)
class ClassScore:
    """Result of one class.

    Args:
        type_name: the class.
        labels: how many there are.
        ap: average precision by distance of MATCH_DISTANCES_M, 0 to 1.
        translation_m: mean distance of the centres on the ground.
        scale: mean of 1 - IoU of the sizes.
        orientation_rad: mean difference of the headings.
    """

    type_name: str
    labels: int
    ap: tuple[float, ...]
    translation_m: float
    scale: float
    orientation_rad: float

    @property
    def mean_ap(self) -> float:
        """Mean over the distances."""
        return sum(self.ap) / len(self.ap)


@dataclass(frozen=True, slots=True, eq=False)
class _Match:
    """Detections of a class by falling score, and their labels.

    Args:
        row: (D,) detections.
        label: (D,) label of each, -1: none.
        score: (D,) confidences.
    """

    row: IntArray
    label: IntArray
    score: FloatArray

    @property
    def is_true(self) -> BoolArray:
        return self.label >= 0


def class_scores(labels: ObjectLines, detections: ObjectLines, type_names: Sequence[str]) -> list[ClassScore]:
    """Scores of some classes; a class without a true positive has errors of 1, as the devkit has.

    Args:
        labels: Of all frames; regions are left out.
        detections: Of the same frames.
        type_names: The classes, each with a label.
    """
    kept, pairs = _pairs(labels, detections)
    results = []
    for name in type_names:
        rows = np.flatnonzero(detections.type_name == name)
        count = int(np.count_nonzero(kept.type_name == name))
        matches = {limit: _match(detections, rows, pairs, limit) for limit in MATCH_DISTANCES_M}
        ap = tuple(_average_precision(match, count) for match in matches.values())
        errors = _errors(kept, detections, matches[ERROR_DISTANCE_M], count)
        results.append(ClassScore(name, count, ap, *errors))
    return results


def _pairs(
    labels: ObjectLines, detections: ObjectLines
) -> tuple[ObjectLines, tuple[IntArray, IntArray, FloatArray]]:
    """Labels without regions; detections and labels of one frame and class, and their distances."""
    kept = labels.chosen(labels.type_name != DONT_CARE)
    i, j = frame_pairs(detections.frame, kept.frame)
    a, b = detections.boxes.center_m, kept.boxes.center_m
    distance = np.hypot(*(a[i, :2] - b[j, :2]).T)
    same = detections.type_name[i] == kept.type_name[j]
    return kept, (i[same], j[same], distance[same])


def _match(
    detections: ObjectLines, rows: IntArray, pairs: tuple[IntArray, IntArray, FloatArray], limit_m: float
) -> _Match:
    """Give each detection, by falling score, the nearest free label within a distance."""
    # of equal scores the last comes first, as in the devkit
    rows = rows[::-1][np.argsort(-detections.score[rows][::-1], kind="stable")]
    near: dict[int, list[tuple[float, int]]] = {}
    for i, j, distance in zip(*(column.tolist() for column in pairs), strict=True):
        if distance < limit_m:
            near.setdefault(i, []).append((distance, j))
    taken: set[int] = set()
    label = np.full(len(rows), -1)
    for place, row in enumerate(rows.tolist()):
        free = [pair for pair in near.get(row, ()) if pair[1] not in taken]
        if free:
            label[place] = min(free)[1]
            taken.add(int(label[place]))
    return _Match(rows, label, detections.score[rows])


def _curve(match: _Match, labels: int, values: FloatArray) -> FloatArray:
    """(101,) values at equal steps of recall, 0 beyond the greatest."""
    recall = np.cumsum(match.is_true) / labels
    return np.interp(np.linspace(0.0, 1.0, _POINTS), recall, values, right=0.0)


def _average_precision(match: _Match, labels: int) -> float:
    if not labels or not match.is_true.any():
        return 0.0
    precision = np.cumsum(match.is_true) / np.arange(1, len(match.row) + 1)
    beyond = np.maximum(_curve(match, labels, precision)[_FIRST:] - LEAST_PRECISION, 0.0)
    return float(beyond.mean()) / (1.0 - LEAST_PRECISION)


def _errors(
    labels: ObjectLines, detections: ObjectLines, match: _Match, count: int
) -> tuple[float, float, float]:
    """Mean errors of translation, scale and orientation over the recalls that are reached."""
    if not count or not match.is_true.any():
        return 1.0, 1.0, 1.0
    i, j = match.row[match.is_true], match.label[match.is_true]
    a, b = detections.boxes[i], labels.boxes[j]
    common = np.minimum(a.size_m, b.size_m).prod(axis=1)
    errors = (
        np.hypot(*(a.center_m[:, :2] - b.center_m[:, :2]).T),
        1.0 - common / (a.volume_m3 + b.volume_m3 - common),
        np.abs(wrap_angle(a.yaw_rad - b.yaw_rad)),
    )
    score = _curve(match, count, match.score)
    reached = np.flatnonzero(score)
    last = int(reached[-1]) if len(reached) else 0
    if last < _FIRST:
        return 1.0, 1.0, 1.0
    true_score = match.score[match.is_true]
    means = []
    for error in errors:
        running = np.cumsum(error) / np.arange(1, len(error) + 1)
        by_recall = np.interp(score[::-1], true_score[::-1], running[::-1])[::-1]
        means.append(float(by_recall[_FIRST : last + 1].mean()))
    return means[0], means[1], means[2]


def matched_at(labels: ObjectLines, detections: ObjectLines, limit_m: float) -> MatchedDetections:
    """Labels and detections of all classes that belong together within a distance.

    Args:
        labels: Of all frames; regions are left out.
        detections: Of the same frames.
        limit_m: Greatest distance of the centres on the ground.
    """
    kept, pairs = _pairs(labels, detections)
    is_detected, is_true = np.zeros(len(kept), dtype=np.bool_), np.zeros(len(detections), dtype=np.bool_)
    match = _match(detections, np.arange(len(detections)), pairs, limit_m)
    is_detected[match.label[match.is_true]] = True
    is_true[match.row[match.is_true]] = True
    is_touched = np.zeros(len(kept), dtype=np.bool_)
    is_touched[pairs[1][pairs[2] < limit_m]] = True
    return MatchedDetections(kept, detections, is_detected, is_touched, is_true)
