"""Arrays of the data types: their kinds, and how they are checked, frozen and taken apart."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numpy import ndarray
from numpy.typing import ArrayLike, NDArray

from smartmot.errors import ShapeError

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
StrArray = NDArray[np.str_]
T = TypeVar("T")


def frozen(value: ArrayLike, dtype: type, shape: tuple[int | None, ...], name: str) -> NDArray[Any]:
    """Read-only array of the wanted kind and shape (None: any length)."""
    if (
        isinstance(value, np.ndarray)
        and value.dtype == dtype
        and not value.flags.writeable
        and value.base is None
        and value.shape == shape
    ):
        return value
    try:
        if dtype is not np.float64:
            _unchanged(np.asarray(value), dtype, name)
        elif isinstance(value, np.ndarray) and value.dtype.kind == "c":
            raise TypeError("complex")
        array: NDArray[Any] = np.array(value, dtype=dtype)
    except ShapeError:
        raise
    except (TypeError, ValueError, OverflowError) as error:
        raise ShapeError(f"{name}: expected numbers in shape {shape}, got {value!r}") from error
    if array.size == 0 and array.ndim != len(shape):
        array = array.reshape([0 if n is None else n for n in shape])
    if array.shape != shape and (
        array.ndim != len(shape)
        or any(n is not None and n != m for n, m in zip(shape, array.shape, strict=True))
    ):
        raise ShapeError(f"{name}: expected shape {shape}, got {array.shape}")
    array.flags.writeable = False
    return array


def box_arrays(
    center_m: ArrayLike, size_m: ArrayLike, yaw_rad: ArrayLike, dimensions: int
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Centres, sizes and headings of boxes, frozen and checked.

    Args:
        center_m: (N, D) box centres, metres.
        size_m: (N, D) length along the heading, width across it, with D = 3 also height; metres, positive.
        yaw_rad: (N,) heading.
        dimensions: D, 2 or 3.

    Raises:
        ShapeError: shapes disagree, a value is not finite or a size is not positive.
    """
    center = frozen(center_m, np.float64, (None, dimensions), "center_m")
    size = frozen(size_m, np.float64, (len(center), dimensions), "size_m")
    yaw = frozen(yaw_rad, np.float64, (len(center),), "yaw_rad")
    # one sum is finite only if every term is (an overflow of huge terms is refused as well)
    if not math.isfinite(float(center.sum() + size.sum() + yaw.sum())):
        raise ShapeError("boxes: every centre, size and yaw must be finite; drop such objects first")
    if len(size) and size.min() <= 0.0:
        raise ShapeError(f"size_m: every size must be positive, got {size.min():g} m")
    return center, size, yaw


def are_covariances(pose_covariance: FloatArray) -> bool:
    """Whether what (N, 3, 3) matrices of x, y, yaw state is symmetric and positive definite; NaN: nothing."""
    xx, yy, xy, yx = (pose_covariance[:, i, j] for i, j in ((0, 0), (1, 1), (0, 1), (1, 0)))
    yaw = pose_covariance[:, 2, 2]
    with np.errstate(invalid="ignore", over="ignore"):
        silent = np.isnan(xx + yy + xy + yx)
        # Sylvester's criterion; symmetric but for rounding
        definite = (xx > 0.0) & (xx * yy > xy * xy) & (np.abs(xy - yx) <= 1e-9 * (xx + yy))
        sound = (silent | definite) & (np.isnan(yaw) | (yaw > 0.0))
    return bool(sound.all()) and not np.isinf(pose_covariance).any()


def _unchanged(given: NDArray[Any], dtype: type, name: str) -> None:
    """Refuse what would become another number or truth value: 1.5 as an identifier, NaN as a truth value."""
    if not given.size or given.dtype == dtype:
        return
    if dtype is np.bool_:
        if given.dtype.kind not in "biuf" or not ((given == 0) | (given == 1)).all():
            raise ShapeError(f"{name}: expected true or false, got {given.tolist()!r}")
    elif given.dtype.kind not in "biuf" or not ((np.trunc(given) == given) & (abs(given) < 2.0**63)).all():
        raise ShapeError(f"{name}: expected whole numbers of 64 bits, got {given.tolist()!r}")


def positions(index: Any) -> Any:
    """A mask as positions, with which several arrays are taken in less time; else what was given."""
    masked = isinstance(index, np.ndarray) and index.dtype == np.bool_
    return index.nonzero()[0] if masked else index


def part(array: NDArray[Any], index: Any) -> NDArray[Any]:
    """Rows of an array; positions are taken four times as fast as they are indexed."""
    return array.take(index, axis=0) if isinstance(index, np.ndarray) else array[index]


@cache
def _maker(cls: type) -> Callable[..., Any]:
    """What makes a frozen slotted class of the values of its fields, written out as dataclasses are.

    The fields are set by their slots, in half the time of object.__setattr__, and without a loop.
    """
    names = cls.__slots__  # type: ignore[attr-defined]
    lines = [f"def make({', '.join(f'v{k}' for k in range(len(names)))}):", " made = new(cls)"]
    for k in range(len(names)):
        # write access ends; given by its name, the flag takes twice the time
        lines += [f" if type(v{k}) is ndarray: v{k}.setflags(False)", f" set{k}(made, v{k})"]
    scope: dict[str, Any] = {f"set{k}": getattr(cls, name).__set__ for k, name in enumerate(names)}
    scope |= {"new": object.__new__, "cls": cls, "ndarray": ndarray}
    exec("\n".join([*lines, " return made"]), scope)
    make: Callable[..., Any] = scope["make"]
    return make


def unchecked(cls: type[T], *values: object) -> T:
    """A frozen value made of arrays that this package has just computed and that nobody else holds.

    Construction checks and copies what a user brings; inside a frame that would be done dozens of times to
    arrays whose kind and shape are known.
    """
    made: T = _maker(cls)(*values)  # type: ignore[arg-type]  # mypy takes type[T] for unhashable
    return made


def shared_by_copies(cls: type[T]) -> type[T]:
    """Class decorator of frozen slotted values: a copy is the value itself; one unpickled is read-only too.

    Else `copy.deepcopy` and `pickle` would make arrays that can be written to.
    """

    def same(self: T, memo: object = None) -> T:
        return self

    def reduced(self: T, protocol: int) -> str | tuple[Any, ...]:
        if type(self) is not cls:  # a class derived from it has fields of its own
            return object.__reduce_ex__(self, protocol)
        return unchecked, (cls, *(getattr(self, name) for name in cls.__slots__))  # type: ignore[attr-defined]

    for name, method in (("__copy__", same), ("__deepcopy__", same), ("__reduce_ex__", reduced)):
        setattr(cls, name, method)
    return cls
