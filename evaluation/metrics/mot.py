"""Accuracy of tracks against labels: HOTA, CLEAR and identity metrics, per category.

trackeval computes them; this module decides what is compared. Two similarities on the ground plane:

- `distance`: 1 - d / 4 m, not below 0, for centres d apart; a match needs 0.5, so d <= 2 m.
- `iou`: intersection over union; a match needs 0.5 for cars and trucks, 0.25 for the others.

What is left out, as KITTI's tracking evaluation does (Geiger et al., CVPR 2012, and its devkit): labels that
are marked as ignored, tracks on them, and, where a camera is known, unmatched tracks that are at most 25 px
high in the image, outside it, or more than half inside a region without labels. The image boxes are always
projected from the boxes in space, so no tracker gains by not writing any.

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
from scipy.optimize import linear_sum_assignment

from evaluation.errors import ArgumentError
from scenarios.errors import DatasetError
from scenarios.recorded.camera import from_camera, image_boxes, to_camera
from scenarios.recorded.dataset import Objects, Sequence
from smartmot.geometry import iou_pairs
from smartmot.types import BoolArray, FloatArray, IntArray

SIMILARITIES = ("distance", "iou")
MATCH_DISTANCE_M = 2.0
"""Centres farther apart are no match (nuScenes detection and tracking challenges)."""

MATCH_IOU = {"car": 0.5, "truck": 0.5}
"""Least overlap of a match; others: `OTHER_MATCH_IOU`. AB3DMOT's evaluation on KITTI has 0.25, 0.5, 0.7."""
OTHER_MATCH_IOU = 0.25

MIN_IMAGE_HEIGHT_PX = 25.0
MAX_DONT_CARE_SHARE = 0.5
RECALL_POINTS = 40
_RECALL_MARGIN = 0.02
"""The recall of a point may differ a little from that at its threshold: fewer tracks match otherwise."""
_EPS = float(np.finfo(np.float64).eps)


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


@dataclass(frozen=True, slots=True, eq=False)
class Comparison:
    """Labels and tracks of one category in one sequence: G label rows, T track rows, P pairs in a frame.

    Args:
        frame_count: F frames.
        label_frame: (G,) frames, ascending.
        label_id: (G,) identities.
        label_counts: (G,) labels that are not ignored.
        track_frame: (T,) frames, ascending.
        track_id: (T,) identities.
        track_score: (T,) mean score of the row's track.
        track_ignored: (T,) tracks that do not count unless they match a label.
        pair_label: (P,) label rows; all pairs of a frame, as a matrix of labels times tracks, row by row.
        pair_track: (P,) track rows.
        similarity: (P,) values in [0, 1].
    """

    frame_count: int
    label_frame: IntArray
    label_id: IntArray
    label_counts: BoolArray
    track_frame: IntArray
    track_id: IntArray
    track_score: FloatArray
    track_ignored: BoolArray
    pair_label: IntArray
    pair_track: IntArray
    similarity: FloatArray


def match_threshold(category: str, similarity: str) -> float:
    """Least similarity of a match."""
    return 0.5 if similarity == "distance" else MATCH_IOU.get(category, OTHER_MATCH_IOU)


def compare(sequence: Sequence, tracks: Objects, category: str, similarity: str) -> Comparison:
    """Labels and tracks of a category side by side.

    Raises:
        DatasetError: The sequence has no labels, or a track or a label appears twice in a frame.
    """
    if sequence.labels is None:
        raise DatasetError(f"sequence {sequence.name}: has no labels to compare with")
    labels = sequence.labels[sequence.labels.category == category]
    tracks = tracks[tracks.category == category]
    for name, objects in (("label", labels), ("track", tracks)):
        _require_unique(sequence, objects, name)
    start = [objects.frame_starts(len(sequence)) for objects in (labels, tracks)]
    pair_label, pair_track = pairs_of_frames(*start)
    value = _similarity(
        _on_ground(sequence, labels), _on_ground(sequence, tracks), pair_label, pair_track, similarity
    )
    return Comparison(
        frame_count=len(sequence),
        label_frame=labels.frame,
        label_id=labels.object_id,
        label_counts=~labels.ignored,
        track_frame=tracks.frame,
        track_id=tracks.object_id,
        track_score=_mean_scores(tracks),
        track_ignored=_outside_image(sequence, tracks),
        pair_label=pair_label,
        pair_track=pair_track,
        similarity=value,
    )


def _require_unique(sequence: Sequence, objects: Objects, name: str) -> None:
    keys = np.column_stack((objects.frame, objects.object_id))
    unique, count = np.unique(keys, axis=0, return_counts=True)
    if np.any(count > 1):
        frame, identity = unique[np.argmax(count > 1)]
        where = f"sequence {sequence.name}, frame {sequence.frame_name[frame]}"
        raise DatasetError(f"{where}: {name} id {identity} appears twice in one category")


def pairs_of_frames(a_start: IntArray, b_start: IntArray) -> tuple[IntArray, IntArray]:
    """Rows of a and rows of b that share a frame: every combination, frame after frame, a's rows outermost.

    Args:
        a_start: (F + 1,) rows at which the frames start.
        b_start: (F + 1,) the same of b.
    """
    a_count, b_count = np.diff(a_start), np.diff(b_start)
    of_row = np.repeat(b_count, a_count)  # partners of each row of a
    first = np.repeat(b_start[:-1], a_count)
    a = np.repeat(np.arange(a_start[0], a_start[-1]), of_row)
    within = np.arange(of_row.sum()) - np.repeat(np.cumsum(of_row) - of_row, of_row)
    return a, np.repeat(first, of_row) + within


def _mean_scores(tracks: Objects) -> FloatArray:
    """(K,) mean score of each row's track."""
    _, inverse, count = np.unique(tracks.object_id, return_inverse=True, return_counts=True)
    total = np.bincount(inverse, weights=tracks.score, minlength=len(count))
    return np.asarray((total / np.maximum(count, 1))[inverse])


def _on_ground(sequence: Sequence, objects: Objects) -> Objects:
    """Boxes on the plane of comparison: the camera's x-z plane for KITTI, else the world's ground."""
    if sequence.camera is None or sequence.world_SE3_ego is None:
        return objects
    return from_camera(objects.frame, to_camera(objects, sequence.world_SE3_ego), None)


def _similarity(labels: Objects, tracks: Objects, i: IntArray, j: IntArray, similarity: str) -> FloatArray:
    """(P,) similarity of label i and track j."""
    if similarity == "distance":
        distance = np.linalg.norm(labels.center_m[i] - tracks.center_m[j], axis=1)
        return np.asarray(np.maximum(0.0, 1.0 - distance / (2.0 * MATCH_DISTANCE_M)))
    return iou_pairs(
        *(labels.center_m[i], labels.size_m[i], labels.yaw_rad[i]),
        *(tracks.center_m[j], tracks.size_m[j], tracks.yaw_rad[j]),
    )


def _outside_image(sequence: Sequence, tracks: Objects) -> BoolArray:
    """(K,) tracks too small in the image, outside it, or in a region without labels."""
    camera = sequence.camera
    if camera is None:
        return np.zeros(len(tracks), dtype=np.bool_)
    box = image_boxes(to_camera(tracks, sequence.world_SE3_ego), camera.projection)
    outside = (box[:, 3] - box[:, 1] <= MIN_IMAGE_HEIGHT_PX) | (box[:, 2] <= box[:, 0])
    start = [np.searchsorted(f, np.arange(len(sequence) + 1)) for f in (tracks.frame, camera.dont_care_frame)]
    i, j = pairs_of_frames(*start)
    a, b = box[i], camera.dont_care_px[j]
    edges = np.minimum(a[:, 2:], b[:, 2:]) - np.maximum(a[:, :2], b[:, :2])
    area = (a[:, 2] - a[:, 0]) * (a[:, 3] - a[:, 1])
    inside = np.clip(edges, 0.0, None).prod(axis=1) > MAX_DONT_CARE_SHARE * np.maximum(area, 1e-9)
    outside[i[inside]] = True
    return outside


def _counted(c: Comparison, least_score: float, least: float) -> tuple[BoolArray, dict[str, Any]]:
    """What counts when tracks with a lower mean score are left out: (T,) flags and trackeval's input."""
    counts = c.track_score >= least_score
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


def assigned_pairs(
    c: Comparison, labels: BoolArray, tracks: BoolArray, least: float
) -> tuple[IntArray, IntArray]:
    """Label and track rows of the assignment with the greatest similarity in each frame.

    Args:
        c: What is compared.
        labels: (G,) labels that take part.
        tracks: (T,) tracks that take part.
        least: Less similar pairs do not match.
    """
    possible = (c.similarity >= max(least - _EPS, _EPS)) & labels[c.pair_label] & tracks[c.pair_track]
    label, track, value = c.pair_label[possible], c.pair_track[possible], c.similarity[possible]
    # pairs for which nothing competes are matched; the others need an assignment
    alone = np.bincount(label, minlength=len(labels))[label] == 1
    alone &= np.bincount(track, minlength=len(tracks))[track] == 1
    rows, columns = [label[alone]], [track[alone]]
    label, track, value = label[~alone], track[~alone], value[~alone]
    stops = np.flatnonzero(np.diff(c.label_frame[label])) + 1
    for part in np.split(np.arange(len(label)), stops) if len(label) else []:
        own_label, i = np.unique(label[part], return_inverse=True)
        own_track, j = np.unique(track[part], return_inverse=True)
        matrix = np.zeros((len(own_label), len(own_track)))
        matrix[i, j] = value[part]
        row, column = linear_sum_assignment(matrix, maximize=True)
        matched = matrix[row, column] > 0.0
        rows.append(own_label[row[matched]])
        columns.append(own_track[column[matched]])
    return np.concatenate(rows), np.concatenate(columns)


class _TrackEval:
    """trackeval's metrics for one threshold of similarity; it prints, and this keeps it quiet."""

    def __init__(self, least_similarity: float) -> None:
        try:
            with contextlib.redirect_stdout(io.StringIO()):
                from trackeval.metrics import CLEAR, HOTA, Identity  # type: ignore[import-untyped]

                setting = {"THRESHOLD": least_similarity, "PRINT_CONFIG": False}
                self.clear, self.identity, self.hota = CLEAR(setting), Identity(setting), HOTA()
        except ImportError as error:
            raise MetricsUnavailableError(
                f"metrics need trackeval ({error}); install it with: pip install trackeval"
            ) from None

    def run(self, metric: Any, counted: Mapping[str, dict[str, Any]]) -> dict[str, dict[str, Any]]:
        """Results per sequence, and of all together under "all"."""
        found = {name: metric.eval_sequence(data) for name, data in counted.items()}
        return found | {"all": metric.combine_sequences(found)}


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
    found = []
    for c in compared.values():
        counts, _ = _counted(c, -math.inf, least)
        _, column = assigned_pairs(c, c.label_counts, counts, least)
        found.append(c.track_score[column])
    scores = np.sort(np.concatenate(found))[::-1] if found else np.zeros(0)
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
