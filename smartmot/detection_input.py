"""Detections from a user's arrays: impossible ones dropped and counted, vehicle frame to map frame."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from smartmot.errors import ShapeError
from smartmot.geometry import from_frame, wrap_angle
from smartmot.types import (
    CATEGORIES,
    NOTHING_DROPPED,
    Boxes,
    Detections,
    Dropped,
    FloatArray,
    seconds,
    unchecked,
)

_KNOWN = frozenset(CATEGORIES)

MAX_SIZE_M = 100.0
"""Longest side of a road user: road trains reach 53.5 m, trams 75 m."""

MAX_POSITION_M = 1e8
"""Farthest coordinate: five times the northing of any point in UTM."""

MIN_SIZE_M = 1e-3
"""Shortest side: what is thinner than a millimetre is no box."""

MAX_YAW_RAD = 1e9
"""Greatest heading: a larger number has lost the digits that say where in the turn it is."""

MAX_SPEED_MPS = 500.0
"""Fastest measured velocity: the land speed record is 341 m/s."""

LEAST_BOX = np.array([-MAX_POSITION_M, -MAX_POSITION_M, MIN_SIZE_M, MIN_SIZE_M, -MAX_YAW_RAD])
GREATEST_BOX = np.array([MAX_POSITION_M, MAX_POSITION_M, MAX_SIZE_M, MAX_SIZE_M, MAX_YAW_RAD])
"""Of x, y, length, width and heading; NaN is in no range."""

_LEAST, _GREATEST = np.append(LEAST_BOX, 0.0), np.append(GREATEST_BOX, 1.0)
"""The same, then the score."""


def detections_from_arrays(
    stamp_s: float,
    center_m: ArrayLike,
    size_m: ArrayLike,
    yaw_rad: ArrayLike,
    score: ArrayLike | None = None,
    category: ArrayLike | None = None,
    velocity_mps: ArrayLike | None = None,
) -> tuple[Detections, int]:
    """Detections out of what a detector wrote, without the impossible ones.

    Dropped are rows with a value that is not finite, a side under 1 mm or over 100 m, a position or heading
    that no sensor means (beyond 1e8 m, 1e9 rad), a score outside [0, 1], or a category that is not in
    `smartmot.types.CATEGORIES`. A velocity that is not finite or over 500 m/s is taken as not measured.

    Args:
        stamp_s: Measurement time, seconds.
        center_m: (N, 2) centres.
        size_m: (N, 2) lengths and widths.
        yaw_rad: (N,) headings.
        score: (N,) confidences in [0, 1]; 1 when not given.
        category: (N,) names; "unknown" when not given.
        velocity_mps: (N, 2) measured velocities over ground.

    Returns:
        The detections and how many rows were dropped; `Detections.dropped` tells why. A row that is wrong in
        more than one way counts once: by its box, else its category, else its score.

    Raises:
        ShapeError: The arrays do not have one row per detection.
        StampError: The stamp is no finite number, or not in seconds.
    """
    stamp_s = seconds(stamp_s, "detections")
    center = _numbers(center_m, (2,), "center_m")
    n = len(center)
    size, yaw = _numbers(size_m, (2,), "size_m"), _numbers(yaw_rad, (), "yaw_rad")
    confidence = np.ones(n) if score is None else _numbers(score, (), "score")
    names = np.full(n, "unknown") if category is None else np.array(category, dtype=np.str_).reshape(-1)
    velocity = None if velocity_mps is None else _numbers(velocity_mps, (2,), "velocity_mps")
    lengths = {len(size), len(yaw), len(confidence), len(names), n if velocity is None else len(velocity)}
    if lengths != {n}:
        raise ShapeError(f"detections: expected {n} rows in every array, got {sorted(lengths)}")
    if velocity is not None:
        velocity = measured_velocities(velocity)
    rows = np.empty((n, len(_LEAST)))
    rows[:, :2], rows[:, 2:4], rows[:, 4], rows[:, 5] = center, size, yaw, confidence
    possible = (rows >= _LEAST) & (rows <= _GREATEST)
    dropped = NOTHING_DROPPED
    # Mostly all is well; which rows are not is asked only when something is wrong.
    given = names.tolist()
    if np.count_nonzero(possible) < possible.size or not _KNOWN.issuperset(given):
        box, known = (
            possible[:, :-1].all(axis=1),
            np.array([name in _KNOWN for name in given], dtype=np.bool_),
        )
        good = box & known & possible[:, -1]
        counts = [np.count_nonzero(lost) for lost in (box & known & ~good, box & ~known, ~box)]
        dropped = Dropped(*map(int, counts))
        rows, names = rows[good], names[good]
        velocity = None if velocity is None else velocity[good]
    # Everything that the constructors check has just been checked.
    boxes = unchecked(Boxes, rows[:, :2], rows[:, 2:4], wrap_angle(rows[:, 4]))
    return unchecked(Detections, stamp_s, boxes, rows[:, 5], names, velocity, dropped), dropped.total


def measured_velocities(velocity_mps: FloatArray) -> FloatArray:
    """Velocities with NaN in place of those that cannot be.

    Args:
        velocity_mps: (N, 2) velocities.

    Returns:
        (N, 2) velocities; a row is NaN where a component is not finite or over 500 m/s.
    """
    possible = (np.abs(velocity_mps) <= MAX_SPEED_MPS).all(axis=1, keepdims=True)
    return np.where(possible, velocity_mps, np.nan)


def _numbers(values: ArrayLike, row: tuple[int, ...], name: str) -> FloatArray:
    """(N, ...) array of numbers."""
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ShapeError(f"{name}: expected numbers, got {values!r}") from error
    if array.size == 0:
        array = array.reshape(0, *row)
    if array.shape[1:] != row or array.ndim != 1 + len(row):
        raise ShapeError(f"{name}: expected one row of shape {row} per detection, got {array.shape}")
    return array


def to_map(detections: Detections, x_m: float, y_m: float, yaw_rad: float) -> Detections:
    """Detections in the vehicle's frame, x ahead and y left, seen in the map frame.

    Args:
        detections: N detections, vehicle frame; velocities over ground, along the vehicle's axes.
        x_m: Position of the vehicle frame's origin, map frame.
        y_m: Position of the vehicle frame's origin, map frame.
        yaw_rad: Heading of the vehicle, map frame.

    Returns:
        N detections, map frame.
    """
    boxes, velocity = detections.boxes, detections.velocity_mps
    moved = Boxes(
        from_frame(boxes.center_m, x_m, y_m, yaw_rad), boxes.size_m, wrap_angle(boxes.yaw_rad + yaw_rad)
    )
    turned = None if velocity is None else from_frame(velocity, 0.0, 0.0, yaw_rad)
    return Detections(
        detections.stamp_s, moved, detections.score, detections.category, turned, detections.dropped
    )
