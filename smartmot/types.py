"""Core data: one value holds all objects of a frame as arrays.

Map frame throughout: OpenDRIVE's inertial frame, right-handed, x east, y north, yaw counter-clockwise
from x. SI units and radians. Arrays are checked, converted to float64 and made read-only once, at
construction.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from smartmot.errors import ShapeError

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
IntArray = NDArray[np.int64]
BoolArray = NDArray[np.bool_]
StrArray = NDArray[np.str_]
T = TypeVar("T")

CATEGORIES = ("car", "pedestrian", "cyclist", "truck", "motorcycle", "unknown")
"""Object categories that detections may carry; sensors and readers map their own names to these."""

_KNOWN_CATEGORIES = frozenset(CATEGORIES)

VULNERABLE = frozenset({"pedestrian", "cyclist"})
"""Vulnerable road users (VRU): those that also count beside the lane, over the sidewalk."""


def _frozen(value: ArrayLike, dtype: type, shape: tuple[int | None, ...], name: str) -> NDArray[Any]:
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
        array: NDArray[Any] = np.array(value, dtype=dtype)
    except (TypeError, ValueError) as error:
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


def _set(target: object, name: str, value: object) -> None:
    object.__setattr__(target, name, value)


def _positions(index: Any) -> Any:
    """A mask as positions, with which several arrays are taken in less time; else what was given."""
    masked = isinstance(index, np.ndarray) and index.dtype == np.bool_
    return index.nonzero()[0] if masked else index


def _part(array: NDArray[Any], index: Any) -> NDArray[Any]:
    """Rows of an array; positions are taken four times as fast as they are indexed."""
    return array.take(index, axis=0) if isinstance(index, np.ndarray) else array[index]


@cache
def _setters(cls: type) -> tuple[Callable[[object, object], None], ...]:
    """What sets the fields of a frozen slotted class: half the time of object.__setattr__."""
    return tuple(getattr(cls, name).__set__ for name in cls.__slots__)  # type: ignore[attr-defined]


def unchecked(cls: type[T], *values: object) -> T:
    """A frozen value made of arrays that this package has just computed and that nobody else holds.

    Construction checks and copies what a user brings; inside a frame that would be done dozens of times to
    arrays whose kind and shape are known.
    """
    made = object.__new__(cls)
    # mypy takes type[T] for unhashable
    for put, value in zip(_setters(cls), values, strict=True):  # type: ignore[arg-type]
        if type(value) is np.ndarray:
            value.setflags(False)  # type: ignore[call-arg]  # write; by name it takes twice the time
        put(made, value)
    return made


@dataclass(frozen=True, slots=True, eq=False)
class Boxes:
    """Oriented rectangles on the ground, map frame.

    Args:
        center_m: (N, 2) box centres, metres.
        size_m: (N, 2) length along the yaw direction and width across it, metres, positive.
        yaw_rad: (N,) heading.

    Raises:
        ShapeError: shapes disagree, a value is not finite or a size is not positive.
    """

    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray

    def __post_init__(self) -> None:
        center = _frozen(self.center_m, np.float64, (None, 2), "center_m")
        n = len(center)
        size = _frozen(self.size_m, np.float64, (n, 2), "size_m")
        yaw = _frozen(self.yaw_rad, np.float64, (n,), "yaw_rad")
        # one sum is finite only if every term is (an overflow of huge terms is refused as well)
        if not math.isfinite(float(center.sum() + size.sum() + yaw.sum())):
            raise ShapeError("boxes: every centre, size and yaw must be finite; drop such objects first")
        if n and size.min() <= 0.0:
            raise ShapeError(f"size_m: lengths and widths must be positive, got {size.min():g} m")
        _set(self, "center_m", center)
        _set(self, "size_m", size)
        _set(self, "yaw_rad", yaw)

    def __len__(self) -> int:
        return len(self.yaw_rad)

    def __getitem__(self, index: Any) -> Boxes:
        """Subset by a mask, a slice or an index array."""
        index = _positions(index)  # parts of checked arrays need no second check
        return unchecked(
            Boxes, _part(self.center_m, index), _part(self.size_m, index), _part(self.yaw_rad, index)
        )

    @classmethod
    def empty(cls) -> Boxes:
        """No boxes."""
        return unchecked(cls, np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0))


@dataclass(frozen=True, slots=True)
class Dropped:
    """How many detections of a frame were dropped, by reason.

    Args:
        score: no score in [0, 1], or one under the tracker's threshold.
        category: not in CATEGORIES.
        box: impossible: not finite, no size, no place on earth.
    """

    score: int = 0
    category: int = 0
    box: int = 0

    @property
    def total(self) -> int:
        """All of them."""
        return self.score + self.category + self.box

    def __add__(self, other: Dropped) -> Dropped:
        return Dropped(self.score + other.score, self.category + other.category, self.box + other.box)


NOTHING_DROPPED = Dropped()


@dataclass(frozen=True, slots=True, eq=False)
class Detections:
    """What a detector reports for one frame, map frame.

    Args:
        stamp_s: measurement time, seconds.
        boxes: N boxes.
        score: (N,) detector confidence in [0, 1].
        category: (N,) names out of CATEGORIES.
        velocity_mps: (N, 2) velocity over ground as the detector estimates it, map frame; a row of NaN where
            it has none. None: the detector measures no velocity.
        dropped: what the detector reported besides and is left out here.

    Raises:
        ShapeError: Shapes disagree, a score is outside [0, 1] or a category is unknown.
    """

    stamp_s: float
    boxes: Boxes
    score: FloatArray
    category: StrArray
    velocity_mps: FloatArray | None = None
    dropped: Dropped = NOTHING_DROPPED

    def __post_init__(self) -> None:
        n = len(self.boxes)
        score = _frozen(self.score, np.float64, (n,), "score")
        if not bool(((score >= 0.0) & (score <= 1.0)).all()):
            raise ShapeError("detections: every score must lie in [0, 1]")
        _set(self, "score", score)
        category = np.array(self.category, dtype=np.str_).reshape(-1)
        unknown = set(category.tolist()) - _KNOWN_CATEGORIES
        if len(category) != n or unknown:
            raise ShapeError(
                f"category: expected {n} names out of {', '.join(CATEGORIES)}, "
                f"got {len(category)}{f' with {sorted(unknown)}' if unknown else ''}"
            )
        category.flags.writeable = False
        _set(self, "category", category)
        if self.velocity_mps is not None:
            _set(self, "velocity_mps", _frozen(self.velocity_mps, np.float64, (n, 2), "velocity_mps"))

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, index: Any) -> Detections:
        """Subset by a mask, a slice or an index array."""
        index = _positions(index)
        velocity = None if self.velocity_mps is None else _part(self.velocity_mps, index)
        score, category = _part(self.score, index), _part(self.category, index)
        return unchecked(Detections, self.stamp_s, self.boxes[index], score, category, velocity, self.dropped)

    @classmethod
    def empty(cls, stamp_s: float) -> Detections:
        """A frame in which nothing was detected."""
        return unchecked(
            cls, stamp_s, Boxes.empty(), np.zeros(0), np.zeros(0, dtype=np.str_), None, NOTHING_DROPPED
        )


@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Estimated objects at one time, map frame.

    Args:
        stamp_s: time of the estimate, seconds.
        track_id: (M,) identifiers, unique per tracker.
        boxes: M filtered boxes.
        category: (M,) names.
        score: (M,) score of the last matched detection.
        mean: (M, D) filter state (see `smartmot.kalman`).
        covariance: (M, D, D) its covariance.
        velocity_mps: (M, 2) velocity over ground, map frame.
        yaw_rate_radps: (M,) turn rate.
        age_s: (M,) time since birth.
        coasted_s: (M,) time since the last matched detection (0 when matched in this frame).
        confirmed: (M,) whether the life cycle confirmed the track.
        dynamic: (M,) faster than the static/dynamic threshold.

    Raises:
        ShapeError: Shapes disagree.
    """

    stamp_s: float
    track_id: IntArray
    boxes: Boxes
    category: StrArray
    score: FloatArray
    mean: FloatArray
    covariance: FloatArray
    velocity_mps: FloatArray
    yaw_rate_radps: FloatArray
    age_s: FloatArray
    coasted_s: FloatArray
    confirmed: BoolArray
    dynamic: BoolArray

    def __post_init__(self) -> None:
        m = len(self.boxes)
        _set(self, "track_id", _frozen(self.track_id, np.int64, (m,), "track_id"))
        category = np.array(self.category, dtype=np.str_)
        category.flags.writeable = False
        _set(self, "category", category)
        mean = _frozen(self.mean, np.float64, (m, None), "mean")
        _set(self, "mean", mean)
        d = mean.shape[1]
        _set(self, "covariance", _frozen(self.covariance, np.float64, (m, d, d), "covariance"))
        _set(self, "velocity_mps", _frozen(self.velocity_mps, np.float64, (m, 2), "velocity_mps"))
        for name in ("score", "yaw_rate_radps", "age_s", "coasted_s"):
            _set(self, name, _frozen(getattr(self, name), np.float64, (m,), name))
        for name in ("confirmed", "dynamic"):
            _set(self, name, _frozen(getattr(self, name), np.bool_, (m,), name))

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, index: Any) -> Tracks:
        """Subset by a mask, a slice or an index array."""
        index = _positions(index)
        columns = (getattr(self, name)[index] for name in self.__slots__ if name != "stamp_s")
        return unchecked(Tracks, self.stamp_s, *columns)


@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """Predicted poses of M objects at T common times, map frame.

    Args:
        time_s: (T,) seconds after the frame, starting at 0.
        center_m: (M, T, 2) box centres.
        yaw_rad: (M, T) headings.
        size_m: (M, 2) box sizes, unchanged over the horizon.
        valid: (M, T) whether the prediction counts at that time.

    Raises:
        ShapeError: Shapes disagree.
    """

    time_s: FloatArray
    center_m: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    valid: BoolArray

    def __post_init__(self) -> None:
        time = _frozen(self.time_s, np.float64, (None,), "time_s")
        size = _frozen(self.size_m, np.float64, (None, 2), "size_m")
        m, t = len(size), len(time)
        _set(self, "time_s", time)
        _set(self, "size_m", size)
        _set(self, "center_m", _frozen(self.center_m, np.float64, (m, t, 2), "center_m"))
        _set(self, "yaw_rad", _frozen(self.yaw_rad, np.float64, (m, t), "yaw_rad"))
        _set(self, "valid", _frozen(self.valid, np.bool_, (m, t), "valid"))

    def __len__(self) -> int:
        return len(self.size_m)


@dataclass(frozen=True, slots=True)
class EgoState:
    """Odometry of the ego vehicle, map frame; the pose is that of the box centre.

    Args:
        stamp_s: Time of the measurement.
        x_m: East of the map's origin.
        y_m: North of the map's origin.
        yaw_rad: Heading, counter-clockwise from x.
        speed_mps: Along the heading; negative in reverse.
        accel_mps2: Along the heading.
        yaw_rate_radps: Turn rate, positive to the left.
        length_m: Outline along the heading.
        width_m: Outline across it.

    Raises:
        ShapeError: a value is not finite, or the outline is not positive.
    """

    stamp_s: float
    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float
    accel_mps2: float = 0.0
    yaw_rate_radps: float = 0.0
    length_m: float = 4.4
    width_m: float = 1.8

    def __post_init__(self) -> None:
        total = self.stamp_s + self.x_m + self.y_m + self.yaw_rad + self.speed_mps
        if not math.isfinite(total + self.accel_mps2 + self.yaw_rate_radps):
            raise ShapeError(f"ego state: every value must be finite, got {self!r}")
        if not (self.length_m > 0 and self.width_m > 0):
            raise ShapeError(f"ego state: length and width must be positive, got {self!r}")


@dataclass(frozen=True, slots=True, eq=False)
class Threats:
    """Tracks whose forecast meets the ego's, nearest in time first.

    Args:
        track_id: (K,) identifiers.
        time_to_collision_s: (K,) first forecast time at which the boxes overlap.
        gap_m: (K,) free distance along the ego's heading, from its front to the object's box.
        required_decel_mps2: (K,) constant deceleration that stops the ego within the gap.

    Raises:
        ShapeError: Shapes disagree.
    """

    track_id: IntArray
    time_to_collision_s: FloatArray
    gap_m: FloatArray
    required_decel_mps2: FloatArray

    def __post_init__(self) -> None:
        ids = _frozen(self.track_id, np.int64, (None,), "track_id")
        _set(self, "track_id", ids)
        for name in ("time_to_collision_s", "gap_m", "required_decel_mps2"):
            _set(self, name, _frozen(getattr(self, name), np.float64, (len(ids),), name))

    def __len__(self) -> int:
        return len(self.track_id)
