"""Accuracy of tracks against labels: HOTA, CLEAR and identity metrics, per category.

trackeval computes them; `matching` says what is compared.

sAMOTA and AMOTA are the means over 40 recall values (Weng et al., AB3DMOT, IROS 2020); the score
threshold of each comes from the tracks' mean scores. The other numbers are those at one threshold: the one
with the best MOTA among these (AB3DMOT's evaluation), or all tracks.
"""

from __future__ import annotations

import contextlib
import io
import math
from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

import _smartmot
from evaluation.errors import ArgumentError
from evaluation.metrics.matching import Comparison, assigned_pairs, match_threshold
from smartmot.types import BoolArray, IntArray

RECALL_POINTS = 40
"""Recall values over which accuracy is averaged: 1/40, 2/40, ... 1 (AB3DMOT)."""

_RECALL_MARGIN = 0.02
"""The recall of a point may differ a little from that at its threshold: fewer tracks match otherwise."""


@dataclass(frozen=True, slots=True)
class MotScore:
    """Accuracy for one category; ratios in per cent.

    Args:
        sequence: Name, or "all" for all of them together.
        category: Category of the objects.
        similarity: distance or iou.
        hota, deta, assa: Higher order tracking accuracy and its detection and association parts.
        mota, motp: CLEAR MOT accuracy, and precision as the mean similarity of matches.
        idf1: Identity F1.
        samota, amota: Averages over recall; NaN for a single sequence.
        id_switches, fragmentations: Counts.
        false_positives, misses, matches, labels: Counts.
        score_threshold: Tracks whose mean score is lower were left out, in the detector's scale.
    """

    sequence: str
    category: str
    similarity: str
    hota: float
    deta: float
    assa: float
    mota: float
    motp: float
    idf1: float
    samota: float
    amota: float
    id_switches: int
    fragmentations: int
    false_positives: int
    misses: int
    matches: int
    labels: int
    score_threshold: float


SCORE_COLUMNS = tuple(item.name for item in fields(MotScore))


def _counted(c: Comparison, least_score: float, least: float) -> tuple[BoolArray, dict[str, Any]]:
    """What counts when tracks with a lower mean score are left out: (T,) flags and trackeval's input."""
    counts = c.track_score >= least_score
    # a track that matches an ignored label is no mistake and no success: both leave the comparison
    row, column = assigned_pairs(c, np.ones(len(c.label_id), dtype=np.bool_), counts, least)
    ignored = c.track_ignored.copy()
    ignored[column] = ~c.label_counts[row]
    counts &= ~ignored
    shown = c.label_counts[c.pair_label] & counts[c.pair_track]
    labels = _per_frame(c.label_frame[c.label_counts], c.frame_count)
    tracks = _per_frame(c.track_frame[counts], c.frame_count)
    used = np.flatnonzero((labels > 0) | (tracks > 0))  # empty frames change nothing
    labels, tracks = labels[used], tracks[used]
    label_ids, label_index = np.unique(c.label_id[c.label_counts], return_inverse=True)
    track_ids, track_index = np.unique(c.track_id[counts], return_inverse=True)
    matrices = _split(c.similarity[shown], labels * tracks)
    shapes = zip(labels.tolist(), tracks.tolist(), strict=True)
    return counts, {
        "gt_ids": _split(label_index, labels),
        "tracker_ids": _split(track_index, tracks),
        "similarity_scores": [m.reshape(shape) for m, shape in zip(matrices, shapes, strict=True)],
        "num_gt_dets": len(label_index),
        "num_tracker_dets": len(track_index),
        "num_gt_ids": len(label_ids),
        "num_tracker_ids": len(track_ids),
        "num_timesteps": c.frame_count,
    }


def _per_frame(frame: IntArray, frame_count: int) -> IntArray:
    """(F,) rows in each frame."""
    return np.bincount(frame, minlength=frame_count)


def _split(values: NDArray[Any], lengths: IntArray) -> list[NDArray[Any]]:
    """Consecutive pieces of the given lengths."""
    stop = np.cumsum(lengths)
    return [values[a:b] for a, b in zip((stop - lengths).tolist(), stop.tolist(), strict=True)]


class _TrackEval:
    """trackeval's metrics for one threshold of similarity; it prints, and this keeps it quiet."""

    def __init__(self, least_similarity: float) -> None:
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                from trackeval.metrics import CLEAR, HOTA, Identity  # type: ignore[import-untyped]

                setting = {"THRESHOLD": least_similarity, "PRINT_CONFIG": False}
                self.clear, self.identity, self.hota = CLEAR(setting), Identity(setting), HOTA()
        except ImportError as error:
            raise MetricsUnavailableError(_smartmot.missing_extra("metrics", "metrics", error)) from None

    def run(self, metric: Any, counted: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """Results per sequence, and of all together under "all"."""
        results = {name: metric.eval_sequence(data) for name, data in counted.items()}
        return results | {"all": metric.combine_sequences(results)}


class MetricsUnavailableError(ArgumentError):
    """The library that computes the metrics is not installed."""


def evaluate(
    compared: Mapping[str, Comparison],
    category: str,
    similarity: str,
    best_threshold: bool = True,
    averages: bool = True,
) -> list[MotScore]:
    """Accuracy of all sequences together, then of each.

    Args:
        compared: Comparison of each sequence, of the same category and similarity.
        category: For the result.
        similarity: distance or iou.
        best_threshold: Leave out tracks below the mean score at which MOTA is best; else keep all.
        averages: Compute sAMOTA and AMOTA, which takes most of the time; else they are NaN.

    Raises:
        MetricsUnavailableError: trackeval is not installed.
    """
    least = match_threshold(category, similarity)
    tool = _TrackEval(least)

    def counted(score: float) -> dict[str, dict[str, Any]]:
        return {name: _counted(c, score, least)[1] for name, c in compared.items()}

    label_count = sum(int(c.label_counts.sum()) for c in compared.values())
    samota = amota = 0.0
    best = (-math.inf, -math.inf)
    known: dict[float, dict[str, Any]] = {}
    points = _recall_points(compared, label_count, least)
    for recall, score in reversed(points) if averages or best_threshold else ():
        if not averages and recall + _RECALL_MARGIN < best[0]:
            break  # MOTA is never above recall
        if score not in known:
            known[score] = tool.run(tool.clear, counted(score))["all"]
        clear = known[score]
        # MOTA = 1 - errors / labels; sAMOTA's scales it to reach 1 where all that is recalled is right
        errors = clear["CLR_FP"] + clear["CLR_FN"] + clear["IDSW"]
        samota += min(1.0, max(0.0, 1.0 - (errors - (1.0 - recall) * label_count) / (recall * label_count)))
        amota += max(0.0, clear["MOTA"])
        best = max(best, (clear["MOTA"], score))
    threshold = best[1] if best_threshold else -math.inf
    data = counted(threshold)
    clear, identity, hota = (tool.run(m, data) for m in (tool.clear, tool.identity, tool.hota))
    scores = [
        _score(name, category, similarity, clear[name], identity[name], hota[name], threshold)
        for name in ("all", *compared)
    ]
    if not averages:
        return scores
    per_point = 100.0 / RECALL_POINTS
    return [replace(scores[0], samota=per_point * samota, amota=per_point * amota), *scores[1:]]


def _recall_points(
    compared: Mapping[str, Comparison], label_count: int, least: float
) -> list[tuple[float, float]]:
    """Recall values that are reached, and the mean track score that reaches each."""
    matched = [np.zeros(0)]
    for c in compared.values():
        counts, _ = _counted(c, -math.inf, least)
        _, column = assigned_pairs(c, c.label_counts, counts, least)
        matched.append(c.track_score[column])
    # with the k best of the matched tracks, k labels are recalled
    scores = np.sort(np.concatenate(matched))[::-1]
    points = []
    for k in range(1, RECALL_POINTS + 1):
        index = math.ceil(k / RECALL_POINTS * label_count) - 1
        if 0 <= index < len(scores):
            points.append((k / RECALL_POINTS, float(scores[index])))
    return points


def _score(
    sequence: str,
    category: str,
    similarity: str,
    clear: dict[str, Any],
    identity: dict[str, Any],
    hota: dict[str, Any],
    threshold: float,
) -> MotScore:
    """One row of the result."""
    return MotScore(
        sequence=sequence,
        category=category,
        similarity=similarity,
        hota=100.0 * float(np.mean(hota["HOTA"])),
        deta=100.0 * float(np.mean(hota["DetA"])),
        assa=100.0 * float(np.mean(hota["AssA"])),
        mota=100.0 * float(clear["MOTA"]),
        motp=100.0 * float(clear["MOTP"]),
        idf1=100.0 * float(identity["IDF1"]),
        samota=math.nan,
        amota=math.nan,
        id_switches=int(clear["IDSW"]),
        fragmentations=int(clear["Frag"]),
        false_positives=int(clear["CLR_FP"]),
        misses=int(clear["CLR_FN"]),
        matches=int(clear["CLR_TP"]),
        labels=int(clear["CLR_TP"] + clear["CLR_FN"]),
        score_threshold=threshold,
    )
