"""Detections from a user's arrays: impossible ones dropped and counted, vehicle frame to map frame."""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from smartmot.errors import ShapeError
from smartmot.geometry import from_frame, wrap_angle
from smartmot.types import (
    CATEGORIES,
    NOTHING_DROPPED,
    BoolArray,
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

LEAST_SIGMA, GREATEST_SIGMA = 1e-4, 1e4
"""Standard deviations (m, rad) that a detector can mean: 0.1 mm is finer than any, 10 km no measurement.
Messages hold 0 where nothing is stated."""

LEAST_BOX = np.array([-MAX_POSITION_M, -MAX_POSITION_M, MIN_SIZE_M, MIN_SIZE_M, -MAX_YAW_RAD])
GREATEST_BOX = np.array([MAX_POSITION_M, MAX_POSITION_M, MAX_SIZE_M, MAX_SIZE_M, MAX_YAW_RAD])
"""Of x, y, length, width and heading; NaN is in no range."""

_LEAST, _GREATEST = np.append(LEAST_BOX, 0.0), np.append(GREATEST_BOX, 1.0)
"""The same, then the score."""


_ENOUGH_REFUSED = 20
"""A second of a detector that sees two objects at 10 Hz: by then a box of one that fits was taken."""


def detections_from_arrays(
    stamp_s: float,
    center_m: ArrayLike,
    size_m: ArrayLike,
    yaw_rad: ArrayLike,
    score: ArrayLike | None = None,
    category: ArrayLike | None = None,
    velocity_mps: ArrayLike | None = None,
    pose_covariance: ArrayLike | None = None,
    detector: str = "",
) -> tuple[Detections, int]:
    """Detections out of what a detector wrote, without the impossible ones.

    Dropped are rows with a value that is not finite, a side under 1 mm or over 100 m, a position or heading
    that no sensor means (beyond 1e8 m, 1e9 rad), a score outside [0, 1], or a category that is not in
    `smartmot.types.CATEGORIES`. A velocity that is not finite or over 500 m/s is taken as not measured, a
    covariance that is no covariance or beyond 0.1 mm and 10 km as not stated.

    Args:
        stamp_s: Measurement time, seconds.
        center_m: (N, 2) centres.
        size_m: (N, 2) lengths and widths.
        yaw_rad: (N,) headings.
        score: (N,) confidences in [0, 1]; 1 when not given.
        category: (N,) names; "unknown" when not given.
        velocity_mps: (N, 2) measured velocities over ground.
        pose_covariance: (N, 3, 3) of x, y (m2) and yaw (rad2), or (N, 2, 2) of x and y; NaN or 0 where
            nothing is stated.
        detector: Who reports them, where several do.

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
    noise = None if pose_covariance is None else stated_covariances(pose_covariance)
    lengths = {len(size), len(yaw), len(confidence), len(names)}
    lengths |= {n if given is None else len(given) for given in (velocity, noise)}
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
        noise = None if noise is None else noise[good]
    # Everything that the constructors check has just been checked.
    boxes = unchecked(Boxes, rows[:, :2], rows[:, 2:4], wrap_angle(rows[:, 4]))
    made = unchecked(Detections, stamp_s, boxes, rows[:, 5], names, velocity, dropped, noise, detector)
    return made, dropped.total


class Refusals:
    """Warns, once, where none of a detector's first boxes can be taken: scores or classes of another kind."""

    def __init__(self) -> None:
        self._dropped: Dropped | None = NOTHING_DROPPED

    def see(self, detections: Detections) -> None:
        """Take a frame as `detections_from_arrays` made it."""
        if self._dropped is None:
            return
        if len(detections):
            self._dropped = None
            return
        self._dropped += detections.dropped
        if self._dropped.total < _ENOUGH_REFUSED:
            return
        reasons = (
            (
                self._dropped.score,
                "a score outside [0, 1]: give probabilities (of log odds 1 / (1 + exp(-s)))",
            ),
            (self._dropped.category, f"a class that is none of {', '.join(CATEGORIES)}"),
            (self._dropped.box, "no place or no size that a road user has, in metres"),
        )
        texts = "; ".join(f"{number} have {text}" for number, text in reasons if number)
        warnings.warn(f"none of the first {self._dropped.total} detections is taken: {texts}", stacklevel=3)
        self._dropped = None


def measured_velocities(velocity_mps: FloatArray) -> FloatArray:
    """Velocities with NaN in place of those that cannot be.

    Args:
        velocity_mps: (N, 2) velocities.

    Returns:
        (N, 2) velocities; a row is NaN where a component is not finite or over 500 m/s.
    """
    possible = (np.abs(velocity_mps) <= MAX_SPEED_MPS).all(axis=1, keepdims=True)
    return np.where(possible, velocity_mps, np.nan)


def stated_covariances(pose_covariance: ArrayLike) -> FloatArray:
    """Covariances with NaN in place of those that cannot be.

    Args:
        pose_covariance: (N, 3, 3) of x, y and yaw, or (N, 2, 2) of x and y.

    Returns:
        (N, 3, 3) covariances, symmetric; what position and yaw share is 0.

    Raises:
        ShapeError: They have another shape.
    """
    given = np.asarray(pose_covariance)
    row = given.shape[1:] if given.shape[1:] == (2, 2) else (3, 3)
    given = _numbers(pose_covariance, row, "pose_covariance")
    xx, yy, xy, yx = (given[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1), (1, 0)))
    yaw = given[:, 2, 2] if row == (3, 3) else np.full(len(given), np.nan)

    def possible(variance: FloatArray) -> BoolArray:
        return (variance >= LEAST_SIGMA**2) & (variance <= GREATEST_SIGMA**2)

    with np.errstate(invalid="ignore", over="ignore"):
        symmetric = np.abs(xy - yx) <= 1e-6 * (xx + yy)  # single precision
        position = possible(xx) & possible(yy) & symmetric & (xx * yy > (0.5 * (xy + yx)) ** 2)
        shared = 0.5 * (xy + yx)
    clean = np.zeros((len(given), 3, 3))
    for i, j, value in ((0, 0, xx), (1, 1, yy), (0, 1, shared), (1, 0, shared)):
        clean[:, i, j] = np.where(position, value, np.nan)
    clean[:, 2, 2] = np.where(possible(yaw), yaw, np.nan)
    return clean


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
    noise = detections.pose_covariance
    return Detections(
        detections.stamp_s,
        moved,
        detections.score,
        detections.category,
        turned,
        detections.dropped,
        None if noise is None else turned_covariances(noise, yaw_rad),
        detections.detector,
    )


def turned_covariances(pose_covariance: FloatArray, yaw_rad: float | FloatArray) -> FloatArray:
    """(N, 3, 3) covariances of x, y and yaw in axes against which theirs are turned by an angle, or (N,)."""
    c, s = np.cos(yaw_rad), np.sin(yaw_rad)
    xx, yy, xy = (pose_covariance[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1)))
    turned = pose_covariance.copy()
    turned[:, 0, 0] = c * c * xx - 2.0 * c * s * xy + s * s * yy
    turned[:, 1, 1] = s * s * xx + 2.0 * c * s * xy + c * c * yy
    turned[:, 0, 1] = turned[:, 1, 0] = c * s * (xx - yy) + (c * c - s * s) * xy
    turned[:, :2, 2] = turned[:, 2, :2] = 0.0  # not used, see `smartmot.types.Detections`
    return turned
