"""Which detection belongs to which track: affinity, gates and one optimal assignment.

Affinity follows the paper, bird's-eye-view IoU with pairs under 0.001 dropped. Alone it loses whatever moves
more than its own size between two frames, such as a running pedestrian at 5 Hz, so pairs without overlap may
still match by distance within a gate. All distance matches together weigh less than the least overlap: they
fill in what the overlaps leave free.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Protocol

import numpy as np

from smartmot.geometry import iou_exact
from smartmot.motion_models import PerCategory, X, Y, check_range
from smartmot.types import CATEGORIES, BoolArray, Boxes, FloatArray, IntArray

_GROUPS = (("car", "truck"), ("cyclist", "motorcycle"), ("pedestrian",))
"""Categories that detectors confuse from one frame to the next and that therefore may match."""


_NO_REACH_M = 1e-9
"""Stands for a gate of 0 m in a division; closer centres than this overlap anyway."""


def _compatibility() -> BoolArray:
    """(C, C) flags: same group, or one of the two unknown."""
    group = {name: number for number, names in enumerate(_GROUPS) for name in names}
    table = [["unknown" in (a, b) or group.get(a) == group.get(b) for b in CATEGORIES] for a in CATEGORIES]
    return np.array(table)


COMPATIBLE = _compatibility()
"""(C, C) whether a track of one category may match a detection of another, in the order of CATEGORIES."""


@dataclass(frozen=True, slots=True)
class AssociationConfig:
    """Limits of a match.

    Args:
        iou_threshold: Least overlap that counts as one. Source: paper, 0.001.
        gate_probability: Share of true matches that the distance gate keeps if the filter's covariance is
            right. 0: no distance matches at all, the paper's rule.
        speed_change_mps: Change of speed within one frame that the gate allows on top, because the filter
            knows no sudden starts. 15 km/h is a running pedestrian or child; the rest is the speed at which
            a category commonly enters the view.

    Raises:
        ConfigError: A value is outside its range.
    """

    iou_threshold: float = 0.001
    gate_probability: float = 0.999
    speed_change_mps: PerCategory = field(
        default=PerCategory(
            car=10.0, pedestrian=15.0 / 3.6, cyclist=25.0 / 3.6, truck=10.0, motorcycle=10.0, unknown=10.0
        )
    )

    def __post_init__(self) -> None:
        check_range(self, "iou_threshold", 1e-9, 1.0)
        check_range(self, "gate_probability", 0.0, 1.0 - 1e-12)


@dataclass(frozen=True, slots=True, eq=False)
class Matches:
    """Outcome of an assignment, as index arrays.

    Args:
        track: (K,) matched tracks.
        detection: (K,) the detection of each.
        unmatched_tracks: (M - K,) the other tracks, ascending.
        unmatched_detections: (N - K,) the other detections, ascending.
    """

    track: IntArray
    detection: IntArray
    unmatched_tracks: IntArray
    unmatched_detections: IntArray


class Affinity(Protocol):
    """How well predicted tracks and detections go together."""

    def __call__(self, tracks: Boxes, detections: Boxes, reach_m: FloatArray) -> FloatArray:
        """(M, N) affinity, 0 for pairs that must not match; reach_m (M,) is the distance gate."""
        ...


def gate_reach_m(
    covariance: FloatArray,
    position_variance_m2: float,
    size_m: FloatArray,
    category_code: IntArray,
    dt_s: float,
    config: AssociationConfig,
) -> FloatArray:
    """Distance from the predicted centre within which a detection may still be the track's.

    The larger of two: the chi-square gate of the innovation, and half the box plus what a sudden change of
    speed covers since the last frame. The filter treats x and y alike, so the innovation ellipse is a circle
    of the mean variance.

    Args:
        covariance: (M, D, D) predicted covariances.
        position_variance_m2: Variance of a measured position along each axis.
        size_m: (M, 2) box sizes.
        category_code: (M,) positions in CATEGORIES.
        dt_s: Time since the last frame.
        config: Limits.

    Returns:
        (M,) metres; 0 where distance matches are switched off.
    """
    if config.gate_probability == 0.0:
        return np.zeros(len(category_code))
    variance = 0.5 * (covariance[:, X, X] + covariance[:, Y, Y]) + position_variance_m2
    # The chi-square quantile of two degrees of freedom has the closed form -2 ln(1 - p).
    statistical = np.sqrt(-2.0 * math.log1p(-config.gate_probability) * variance)
    sudden = 0.5 * size_m.max(axis=1) + config.speed_change_mps.of(category_code) * dt_s
    reach: FloatArray = np.maximum(statistical, sudden)
    return reach


@dataclass(frozen=True, slots=True)
class OverlapThenDistance:
    """IoU where overlapping boxes compete, else a small affinity that falls with the distance.

    Args:
        iou_threshold: Least IoU that counts as overlap.
    """

    iou_threshold: float = 0.001

    def __call__(self, tracks: Boxes, detections: Boxes, reach_m: FloatArray) -> FloatArray:
        """Affinity of every pair.

        A pair within the gate that competes with no other matches whatever its overlap, so the exact overlap
        is computed for the remaining pairs only.

        Args:
            tracks: M predicted boxes.
            detections: N detected boxes.
            reach_m: (M,) distance gates.

        Returns:
            (M, N) in [0, 1]; 0 where neither overlap nor gate allows the match.
        """
        offset = tracks.center_m[:, None] - detections.center_m
        distance = np.hypot(offset[..., 0], offset[..., 1])
        near = np.maximum(1.0 - distance / np.maximum(reach_m, _NO_REACH_M)[:, None], 0.0)
        diagonal = np.hypot(tracks.size_m[:, 0], tracks.size_m[:, 1])[:, None] + np.hypot(
            detections.size_m[:, 0], detections.size_m[:, 1]
        )
        touching, gated = distance <= 0.5 * diagonal, near > 0.0
        possible = touching | gated
        contested = (possible.sum(axis=1) > 1)[:, None] | (possible.sum(axis=0) > 1)
        i, j = (touching & (contested | ~gated)).nonzero()
        # All distance matches of a frame together stay below the least overlap.
        affinity: FloatArray = near * (self.iou_threshold / (min(near.shape) + 1.0))
        if len(i):
            iou = iou_exact(
                tracks.center_m[i],
                tracks.size_m[i],
                tracks.yaw_rad[i],
                detections.center_m[j],
                detections.size_m[j],
                detections.yaw_rad[j],
            )
            affinity[i, j] = np.where(iou >= self.iou_threshold, iou, affinity[i, j])
        return affinity


def assign(affinity: FloatArray) -> Matches:
    """Pairs of greatest total affinity (Hungarian algorithm); pairs without affinity stay unmatched.

    Args:
        affinity: (M, N) tracks by detections, 0 where a match is forbidden.

    Returns:
        The matches.
    """
    m, n = affinity.shape
    if m == 0 or n == 0:
        none = np.zeros(0, dtype=np.int64)
        return Matches(none, none, np.arange(m), np.arange(n))
    from scipy.optimize import linear_sum_assignment

    track, detection = linear_sum_assignment(affinity, maximize=True)
    wanted = affinity[track, detection] > 0.0
    if not wanted.all():
        track, detection = track[wanted], detection[wanted]
    free_track, free_detection = np.ones(m, dtype=np.bool_), np.ones(n, dtype=np.bool_)
    free_track[track] = False
    free_detection[detection] = False
    return Matches(track, detection, free_track.nonzero()[0], free_detection.nonzero()[0])


def associate(
    tracks: Boxes,
    track_category: IntArray,
    detections: Boxes,
    detection_category: IntArray,
    reach_m: FloatArray,
    affinity: Affinity,
) -> Matches:
    """Match predicted tracks with detections of a compatible category.

    Args:
        tracks: M predicted boxes.
        track_category: (M,) positions in CATEGORIES.
        detections: N detected boxes.
        detection_category: (N,) positions in CATEGORIES.
        reach_m: (M,) distance gates, from `gate_reach_m`.
        affinity: How well pairs go together.

    Returns:
        The matches.
    """
    if len(tracks) == 0 or len(detections) == 0:
        return assign(np.zeros((len(tracks), len(detections))))
    allowed = COMPATIBLE[track_category[:, None], detection_category[None]]
    return assign(affinity(tracks, detections, reach_m) * allowed)
