"""Predicted collisions: overlap of time-aligned forecast boxes."""

from __future__ import annotations

import math

import numpy as np

from smartmot.overlap import iou_exact
from smartmot.types import BoolArray, FloatArray, Forecast, Threats, Tracks, unchecked

IOU_THRESHOLD = 0.01
"""Paper, section V."""
_CAR_M2 = 4.4 * 1.8
"""Outline of the ego that the threshold was chosen for. Source: authors' code."""
_ROUNDING_IOU = 1e-9
"""Boxes that are apart may show a common area of rounding size; a threshold of 0 must not count it."""


def collision_times(ego: Forecast, objects: Forecast, iou_threshold: float = IOU_THRESHOLD) -> FloatArray:
    """First time at which each forecast meets the ego's; infinite where it never does.

    The threshold is meant for a car. A pedestrian cannot cover 1 % of a bus: for an ego larger than a car it
    falls with the ego's area, so that the same common area counts.

    Args:
        ego: one object at T times.
        objects: M of them at the same T times.
        iou_threshold: bird's-eye-view intersection over union that counts as a collision of a car.

    Returns:
        (M,) seconds after now.
    """
    m = len(objects)
    if m == 0:
        return np.zeros(0)
    length, width = ego.size_m[0].tolist()
    reach = 0.5 * (math.hypot(length, width) + np.hypot(objects.size_m[:, 0], objects.size_m[:, 1]))
    offset = objects.center_m - ego.center_m
    close = (np.hypot(offset[..., 0], offset[..., 1]) < reach[:, None]) & objects.valid & ego.valid
    time = np.full(m, np.inf)
    row, column = close.nonzero()
    if len(row) == 0:
        return time
    threshold = iou_threshold * min(1.0, _CAR_M2 / (length * width))
    hit = iou_exact(
        ego.center_m[0, column],
        ego.size_m[0],
        ego.yaw_rad[0, column],
        objects.center_m[row, column],
        objects.size_m[row],
        objects.yaw_rad[row, column],
    ) > max(threshold, _ROUNDING_IOU)
    np.minimum.at(time, row[hit], ego.time_s[column[hit]])
    return time


def threats(
    tracks: Tracks,
    time_to_collision_s: FloatArray,
    threatening: BoolArray,
    gap_m: FloatArray,
    ego_speed_mps: float,
) -> Threats:
    """The tracks that are on a collision course, nearest in time first.

    Args:
        tracks: M tracks.
        time_to_collision_s: (M,) from `collision_times`.
        threatening: (M,) which of them are on a collision course and count.
        gap_m: (M,) distance along the ego's heading from its front to each box; below zero counts as zero.
        ego_speed_mps: the ego's speed.
    """
    chosen = np.flatnonzero(threatening)
    if len(chosen) == 0:
        return NO_THREATS
    chosen = chosen[np.argsort(time_to_collision_s[chosen], kind="stable")]
    gap = np.maximum(gap_m[chosen], 0.0)
    needed = np.full(len(gap), np.inf if ego_speed_mps > 0 else 0.0)
    np.divide(ego_speed_mps**2, 2 * gap, out=needed, where=gap > 0)
    return unchecked(Threats, tracks.track_id[chosen], time_to_collision_s[chosen], gap, needed)


NO_THREATS = Threats(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros(0), np.zeros(0))
"""Nobody on a collision course."""
