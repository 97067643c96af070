"""Tracks found again that plain association loses, and detections that repeat others.

What disappears while it moves may have stopped meanwhile, anywhere between the place where it was last seen
and the one that the prediction leads to: detections near that segment may be the track's. What a detector
called pedestrian may be called cyclist from now on. Both get only what association left over, tracks as well
as detections.
"""

from __future__ import annotations

import numpy as np

from smartmot.filters.kalman import BoxFilter, Estimate
from smartmot.filters.motion_models import Setting, table
from smartmot.geometry import near_pairs
from smartmot.tracking.assignment import solve
from smartmot.tracking.association import COMPATIBLE, Associator
from smartmot.tracking.frame import Frame, Measured
from smartmot.tracking.state import MATCHED_S
from smartmot.types import CATEGORIES, BoolArray, Boxes, FloatArray, IntArray

_RIDERS = {"pedestrian", "cyclist", "motorcycle"}
"""Categories of which one turns out another: from the side, or far off, a rider is a pedestrian. Unlike those
that `association` lets match at once, they are often side by side."""

CONFUSED = np.array([[{a, b} <= _RIDERS for b in CATEGORIES] for a in CATEGORIES])
"""(C, C) whether a track of one category may turn out to be of the other, in the order of CATEGORIES."""

_NONE = np.zeros(0, dtype=np.int64)

# Arrays of no dimension: NumPy would make them of numbers anew in every call.
_HALF, _MINUS_HALF = np.array(0.5), np.array(-0.5)

NEW, TAKEN = 1, 2
"""Of a detection: it may start a track, it has one."""

_ROUNDING_S = 1e-6
"""Stamps in seconds since 1970 carry 2.4e-7 s of rounding."""


class Recovery:
    """Finds tracks again.

    Args:
        gate_m: Distance from the segment within which a hidden object may be found again.
        box_filter: The tracker's filter.
        associator: What matched before.
    """

    def __init__(self, gate_m: Setting, box_filter: BoxFilter, associator: Associator) -> None:
        self._gate_m, self._filter, self._associator = table(gate_m), box_filter, associator

    def extended(
        self,
        frame: Frame,
        measured: Measured,
        predicted: Estimate,
        track: IntArray,
        detection: IntArray,
        first: BoolArray | None,
        dt_s: float,
    ) -> tuple[IntArray, IntArray, IntArray]:
        """All matches (K,), (K,), and the tracks (L,) whose filter begins anew: far from what it expected."""
        free = np.ones(len(measured.score), dtype=np.bool_)
        free[detection] = False
        if first is not None:
            free &= first
        of = free.nonzero()[0]
        if len(of) == 0:
            return track, detection, _NONE
        lost = np.ones(len(frame.rows), dtype=np.bool_)
        lost[track] = False
        at = lost.nonzero()[0]
        code = frame.code.take(at)
        missing_s = measured.stamp_s - frame.rows[:, MATCHED_S].take(at)
        i, j = recovered(
            predicted.center_m.take(at, axis=0),
            predicted.velocity_mps.take(at, axis=0),
            predicted.size_m.take(at, axis=0),
            code,
            missing_s,
            missing_s > dt_s + _ROUNDING_S,
            self._gate_m.take(code),
            measured.boxes.center_m.take(of, axis=0),
            measured.code.take(of),
        )
        if len(i) == 0:
            return track, detection, _NONE
        i, j = at[i], of[j]
        offset = measured.boxes.center_m[j] - predicted.center_m[i]
        variance = self._filter.position_covariance(frame.filtered[i])
        noise = None
        if measured.pose_covariance is not None:
            noise = self._associator.mean_noise_m2(frame.code[i], measured.pose_covariance[j])
        reach = self._associator.reach_m(
            0.5 * (variance[0] + variance[1]), predicted.size_m[i].max(axis=1), frame.code[i], dt_s, noise
        )
        anew = i[np.hypot(offset[:, 0], offset[:, 1]) > reach]
        track, detection = np.concatenate((track, i)), np.concatenate((detection, j))
        order = np.argsort(track)
        return track[order], detection[order], anew


def recovered(
    center_m: FloatArray,
    velocity_mps: FloatArray,
    size_m: FloatArray,
    code: IntArray,
    missing_s: FloatArray,
    hidden: BoolArray,
    gate_m: FloatArray,
    detected_m: FloatArray,
    detected: IntArray,
) -> tuple[IntArray, IntArray]:
    """Matches of M tracks and N detections that association left.

    Args:
        center_m: (M, 2) predicted centres.
        velocity_mps: (M, 2) velocities over ground.
        size_m: (M, 2) lengths and widths.
        code: (M,) positions in CATEGORIES.
        missing_s: (M,) time since the last detection.
        hidden: (M,) tracks that had no detection in the frame before either.
        gate_m: (M,) distance from the segment within which a hidden object may be found again.
        detected_m: (N, 2) centres of the detections.
        detected: (N,) their positions in CATEGORIES.

    Returns:
        (K,) tracks, ascending, and (K,) their detections.
    """
    half_way = (_MINUS_HALF * missing_s)[:, None] * velocity_mps
    middle, reach = center_m + half_way, np.hypot(half_way[:, 0], half_way[:, 1])
    # what turned out something else lies where it was expected, within its own length
    own_m = _HALF * np.maximum(size_m[:, 0], size_m[:, 1])
    reach_m = np.maximum(gate_m, own_m)
    reach_m += reach
    i, j = near_pairs(middle, detected_m, reach_m, np.zeros(len(detected)))
    if len(i) == 0:
        return i, j
    same, other = COMPATIBLE[code[i], detected[j]], CONFUSED[code[i], detected[j]]
    limit = np.where(same, np.where(hidden[i], gate_m[i], 0.0), np.where(other, own_m[i], 0.0))
    offset = detected_m[j] - middle[i]
    # nearest point of the segment: its middle plus a share in [-1, 1] of the half way
    share = (offset * half_way[i]).sum(axis=1) / np.maximum(reach[i], 1e-9) ** 2
    share = np.clip(share, -1.0, 1.0)
    away = offset - share[:, None] * half_way[i]
    nearness = 1.0 - np.hypot(away[:, 0], away[:, 1]) / np.maximum(limit, 1e-9)
    pair = solve(i, j, np.where(limit > 0.0, nearness, 0.0))
    return i[pair], j[pair]


def repeats(boxes: Boxes, code: IntArray, score: FloatArray, state: IntArray) -> BoolArray | None:
    """Which detections repeat another: two objects cannot have their centres in one box.

    Args:
        boxes: N detections.
        code: (N,) positions in CATEGORIES.
        score: (N,) scores.
        state: (N,) NEW, TAKEN (these repeat nothing), or 0 (these have no part).

    Returns:
        (N,) flags: the centre of the one lies in the box of the other, which has a track or a higher score.
        None: no two are near.
    """
    new = (state == NEW).nonzero()[0]
    half_m = _HALF * np.hypot(boxes.size_m[:, 0], boxes.size_m[:, 1])
    i, j = near_pairs(
        boxes.center_m.take(new, axis=0), boxes.center_m, np.zeros(len(new)), half_m, half_m.take(new)
    )
    if len(i) == len(new):  # each with itself
        return None
    i = new.take(i)
    close = (i != j) & (state.take(j) > 0) & COMPATIBLE[code.take(i), code.take(j)]
    i, j = i[close], j[close]
    if len(i) == 0:
        return None
    repeated, taken = np.zeros(len(score), dtype=np.bool_), state == TAKEN
    close = _holds(boxes, i, j) | _holds(boxes, j, i)
    better: dict[int, list[int]] = {}
    for a, b in zip(i[close].tolist(), j[close].tolist(), strict=True):
        better.setdefault(a, []).append(b)
    # a detection that repeats another hides none itself
    for a in sorted(better, key=lambda k: -score[k]):
        repeated[a] = any(
            taken[b] or (not repeated[b] and (score[b], -b) > (score[a], -a)) for b in better[a]
        )
    return repeated


def _holds(boxes: Boxes, i: IntArray, j: IntArray) -> BoolArray:
    """(P,) whether the boxes i hold the centres of the boxes j."""
    offset, yaw = boxes.center_m[j] - boxes.center_m[i], boxes.yaw_rad[i]
    c, s = np.cos(yaw), np.sin(yaw)
    along, across = offset[:, 0] * c + offset[:, 1] * s, offset[:, 1] * c - offset[:, 0] * s
    half = 0.5 * boxes.size_m[i]
    inside: BoolArray = (np.abs(along) < half[:, 0]) & (np.abs(across) < half[:, 1])
    return inside
