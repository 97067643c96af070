"""Array types and checks shared by the modules."""

from math import isfinite
from typing import TypeAlias, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from opendrive.errors import PositionError

FloatArray: TypeAlias = NDArray[np.float64]
IntArray: TypeAlias = NDArray[np.int64]
BoolArray: TypeAlias = NDArray[np.bool_]

_Scalar = TypeVar("_Scalar", bound=np.generic)


def read_only(array: NDArray[_Scalar]) -> NDArray[_Scalar]:
    """Return the same array, protected against writing."""
    array.setflags(write=False)
    return array


def finite(values: ArrayLike, name: str) -> FloatArray:
    """Return `values` as float64.

    Raises:
        PositionError: a value is not a number, or not finite.
    """
    try:
        array = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise PositionError(f"{name}: expected numbers, got {values!r:.80}") from error
    # Of a single point the numbers themselves are asked: a tenth of the time.
    few = array.size <= 2 and all(map(isfinite, array.ravel().tolist()))
    if not (few or np.isfinite(array).all()):
        raise PositionError(f"{name}: expected finite numbers, got a NaN or infinity")
    return array


def positive(value: float, name: str) -> float:
    """Return a positive, finite number.

    Raises:
        PositionError: it is not.
    """
    if not (value > 0.0 and np.isfinite(value)):
        raise PositionError(f"{name}: expected a positive number, got {value}")
    return float(value)


def points_xy(xy_m: ArrayLike) -> FloatArray:
    """Return points as an (N, 2) float64 array; one (2,) point counts as N = 1.

    Raises:
        PositionError: the shape is not (N, 2), or a value is not finite.
    """
    array = finite(xy_m, "xy")
    if array.shape == (0,):
        return array.reshape(0, 2)
    if array.shape == (2,):
        return array.reshape(1, 2)
    if array.ndim != 2 or array.shape[1] != 2:
        raise PositionError(f"xy: expected shape (N, 2), got {array.shape}")
    return array


def per_point(values: ArrayLike, name: str, points: FloatArray) -> FloatArray:
    """Return one value for each of N points.

    Raises:
        PositionError: the shape is neither (N,) nor that of one value, or a value is not finite.
    """
    array = finite(values, name)
    if array.shape not in ((), (1,), (len(points),)):
        raise PositionError(f"{name}: expected shape ({len(points)},), got {array.shape}")
    return np.broadcast_to(array, len(points))


def wrapped(angle_rad: FloatArray) -> FloatArray:
    """Return angles wrapped to (-pi, pi]."""
    return np.pi - np.mod(np.pi - angle_rad, 2.0 * np.pi)


def first_rows(count: IntArray) -> IntArray:
    """Return the first row of each of N groups that follow one another, and the number of rows, (N + 1,)."""
    return np.concatenate([np.zeros(1, dtype=np.int64), np.cumsum(count)])


def run_starts(group: IntArray) -> IntArray:
    """Return where the runs of equal neighbours start; groups are 0 or greater."""
    return np.flatnonzero(np.diff(group, prepend=-1))


def until_next(owner: IntArray, start: FloatArray, end: FloatArray) -> FloatArray:
    """Return where each record ends: at the start of its owner's next one, and at `end` for the last one.

    Args:
        owner: (N,) owner of each record; those of one lie together.
        start: (N,) start of each record.
        end: (N,) where the last record of its owner ends.
    """
    has_next = np.append(owner[1:] == owner[:-1], False)
    return np.where(has_next, np.append(start[1:], 0.0), end)


def concatenated_ranges(first: IntArray, count: IntArray) -> IntArray:
    """Return ``first[0], first[0] + 1, ... (count[0] values), first[1], ...`` as one array."""
    ends = np.cumsum(count)
    total = int(ends[-1]) if count.size else 0
    indices: IntArray = np.arange(total, dtype=np.int64) + np.repeat(first - (ends - count), count)
    return indices
