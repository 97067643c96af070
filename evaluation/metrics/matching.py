"""Labels and tracks side by side: what is compared, and the best assignment of the two in each frame.

Two similarities on the ground plane:

- `distance`: 1 - d / 4 m, not below 0, for centres d apart; a match needs 0.5, so d <= 2 m.
- `iou`: intersection over union; a match needs 0.5 for cars and trucks, 0.25 for the others.

What is left out, as KITTI's tracking evaluation does (Geiger et al., CVPR 2012, and its devkit): labels that
are marked as ignored, tracks on them, and, where a camera is known, unmatched tracks that are at most 25 px
high in the image, outside it, or more than half inside a region without labels. The image boxes are always
projected from the boxes in space, so no tracker gains by not writing any.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import linear_sum_assignment

from scenarios.errors import DatasetError
from scenarios.recorded.camera import from_camera, image_boxes, to_camera
from scenarios.recorded.dataset import Objects, Sequence
from smartmot.overlap import iou_pairs
from smartmot.types import BoolArray, FloatArray, IntArray

SIMILARITIES = ("distance", "iou")
MATCH_DISTANCE_M = 2.0
"""Centres farther apart are no match (nuScenes detection and tracking challenges)."""

MATCH_IOU = {"car": 0.5, "truck": 0.5}
"""Least overlap of a match; others: `OTHER_MATCH_IOU`. AB3DMOT's evaluation on KITTI has 0.25, 0.5, 0.7."""
OTHER_MATCH_IOU = 0.25

MIN_IMAGE_HEIGHT_PX = 25.0
"""A box in the image that is no higher does not count (KITTI tracking evaluation)."""

MAX_DONT_CARE_SHARE = 0.5
"""Nor does one of whose area more than this is in a region without labels (the same)."""

_EPS = float(np.finfo(np.float64).eps)


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
        labels_there, i = np.unique(label[part], return_inverse=True)
        tracks_there, j = np.unique(track[part], return_inverse=True)
        # pairs that are not possible weigh nothing, so that they never take the place of one that is
        matrix = np.zeros((len(labels_there), len(tracks_there)))
        matrix[i, j] = value[part]
        row, column = linear_sum_assignment(matrix, maximize=True)
        matched = matrix[row, column] > 0.0
        rows.append(labels_there[row[matched]])
        columns.append(tracks_there[column[matched]])
    return np.concatenate(rows), np.concatenate(columns)
