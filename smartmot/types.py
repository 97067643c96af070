"""Core data: one value holds all objects of a frame as arrays.

Map frame throughout: OpenDRIVE's inertial frame, right-handed, x east, y north, yaw counter-clockwise
from x. SI units and radians. Arrays are checked, converted to float64 and made read-only once, at
construction.

Long because every value that crosses a seam is here, with its checks.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from smartmot.arrays import (
    BoolArray,
    ComplexArray,
    FloatArray,
    IntArray,
    StrArray,
    are_covariances,
    box_arrays,
    frozen,
    part,
    positions,
    shared_by_copies,
    unchecked,
)
from smartmot.errors import ShapeError, StampError

__all__ = [
    "CATEGORIES", "NOTHING_DROPPED", "VULNERABLE",
    "BoolArray", "Boxes", "ComplexArray", "Detections", "Dropped", "EgoState", "FloatArray", "Forecast",
    "IntArray", "StrArray", "Threats", "Tracks", "frozen", "seconds", "unchecked",
]  # fmt: skip

CATEGORIES = ("car", "pedestrian", "cyclist", "truck", "motorcycle", "unknown")
"""Object categories that detections may carry; sensors and readers map their own names to these."""

_KNOWN_CATEGORIES = frozenset(CATEGORIES)

VULNERABLE = frozenset({"pedestrian", "cyclist"})
"""Vulnerable road users (VRU): those that also count beside the lane, over the sidewalk."""


_GREATEST_STAMP_S = 1e11
"""Unix time reaches it in the year 5138. In milliseconds it did in 1973, so that a greater stamp is in a
smaller unit: milliseconds up to 1e14, microseconds up to 1e17 (5138 again), then nanoseconds."""

_NO_PAIRS, _NO_NUMBERS, _NO_NAMES = np.zeros((0, 2)), np.zeros(0), np.zeros(0, dtype=np.str_)
"""Columns of nothing; whatever holds them makes them read-only."""


def seconds(stamp: Any, what: str) -> float:
    """A stamp that is a number of seconds.

    Args:
        stamp: What was given.
        what: What has the stamp, for the message.

    Raises:
        StampError: It is no finite number, or so great that it must be in a smaller unit.
    """
    try:
        if isinstance(stamp, str | bytes):
            raise TypeError("text")
        number = float(stamp)
    except (TypeError, ValueError, OverflowError):
        raise StampError(f"{what}: stamp_s: expected a number of seconds, got {stamp!r}") from None
    if -_GREATEST_STAMP_S < number < _GREATEST_STAMP_S:
        return number
    if not math.isfinite(number):
        raise StampError(f"{what}: stamp_s: expected a finite number of seconds, got {stamp!r}")
    size = abs(number)
    unit, per_s = next(
        (unit, per_s)
        for unit, per_s, limit in (
            ("milliseconds", 1e3, 1e14),
            ("microseconds", 1e6, 1e17),
            ("nanoseconds", 1e9, math.inf),
        )
        if size < limit
    )
    raise StampError(f"{what}: stamp_s {stamp!r} looks like {unit}; give seconds (divide by {per_s:g})")


def _finite(array: FloatArray, name: str) -> FloatArray:
    """The array, if one sum over it, which is finite only if every term is, says so."""
    if not math.isfinite(float(array.sum())):
        raise ShapeError(f"{name}: a value is not finite")
    return array


def _names(value: ArrayLike, n: int, noun: str) -> StrArray:
    """(n,) read-only names out of CATEGORIES."""
    try:
        category: StrArray = np.array(value, dtype=np.str_).reshape(-1)
    except ValueError as error:
        raise ShapeError(f"category: expected {n} {noun}, got {value!r}") from error
    unknown = set(category.tolist()) - _KNOWN_CATEGORIES
    if len(category) != n or unknown:
        raise ShapeError(
            f"category: expected {n} {noun} out of {', '.join(CATEGORIES)}, "
            f"got {len(category)}{f' with {sorted(unknown)}' if unknown else ''}"
        )
    category.flags.writeable = False
    return category


def _within_one(score: FloatArray, what: str) -> FloatArray:
    if not bool(((score >= 0.0) & (score <= 1.0)).all()):
        raise ShapeError(f"{what}: every score must lie in [0, 1]")
    return score


def _boxes(value: object, what: str) -> Boxes:
    if not isinstance(value, Boxes):
        raise ShapeError(f"{what}: boxes must be smartmot.Boxes, got {type(value).__name__}")
    return value


def _set(target: object, name: str, value: object) -> None:
    object.__setattr__(target, name, value)


@shared_by_copies
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
        center, size, yaw = box_arrays(self.center_m, self.size_m, self.yaw_rad, 2)
        _set(self, "center_m", center)
        _set(self, "size_m", size)
        _set(self, "yaw_rad", yaw)

    def __len__(self) -> int:
        return len(self.yaw_rad)

    def __getitem__(self, index: Any) -> Boxes:
        """Subset by a mask, a slice or an index array."""
        index = positions(index)  # parts of checked arrays need no second check
        return unchecked(
            Boxes, part(self.center_m, index), part(self.size_m, index), part(self.yaw_rad, index)
        )

    @classmethod
    def empty(cls) -> Boxes:
        """No boxes."""
        return unchecked(cls, _NO_PAIRS, _NO_PAIRS, _NO_NUMBERS)


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


@shared_by_copies
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
        pose_covariance: (N, 3, 3) covariance of the noise of x, y (m2) and yaw (rad2), map frame, as the
            detector states it. NaN in the position's part, or in the yaw's variance: not stated, the filter's
            own noise holds; what position and yaw share is not used. None: nothing is stated.
        detector: who reports them, where several do (`smartmot.FusedTracker`).

    Raises:
        ShapeError: Shapes disagree, a score is outside [0, 1], a velocity is infinite, a category is
            unknown, or a covariance is not symmetric and positive definite.
        StampError: The stamp is no finite number, or not in seconds.
    """

    stamp_s: float
    boxes: Boxes
    score: FloatArray
    category: StrArray
    velocity_mps: FloatArray | None = None
    dropped: Dropped = NOTHING_DROPPED
    pose_covariance: FloatArray | None = None
    detector: str = ""

    def __post_init__(self) -> None:
        n = len(_boxes(self.boxes, "detections"))
        if not isinstance(self.detector, str):
            raise ShapeError(f"detections: detector must be a name, got {self.detector!r}")
        _set(self, "stamp_s", seconds(self.stamp_s, "detections"))
        score = frozen(self.score, np.float64, (n,), "score")
        _set(self, "score", _within_one(score, "detections"))
        _set(self, "category", _names(self.category, n, "names"))
        if self.velocity_mps is not None:
            velocity = frozen(self.velocity_mps, np.float64, (n, 2), "velocity_mps")
            if np.isinf(velocity).any():
                raise ShapeError("velocity_mps: infinite; give NaN where the detector has no velocity")
            _set(self, "velocity_mps", velocity)
        if self.pose_covariance is not None:
            covariance = frozen(self.pose_covariance, np.float64, (n, 3, 3), "pose_covariance")
            if not are_covariances(covariance):
                raise ShapeError(
                    "pose_covariance: expected symmetric, positive definite (3, 3) matrices of x, y and yaw, "
                    "or NaN where nothing is stated"
                )
            half = np.isnan(covariance[:, :2, :2]).any(axis=(1, 2))
            if half.any():  # a position of which a part is stated is not stated
                covariance = covariance.copy()
                covariance[half, :2, :2] = np.nan
                covariance.flags.writeable = False
            _set(self, "pose_covariance", covariance)

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, index: Any) -> Detections:
        """Subset by a mask, a slice or an index array."""
        index = positions(index)
        velocity = None if self.velocity_mps is None else part(self.velocity_mps, index)
        covariance = None if self.pose_covariance is None else part(self.pose_covariance, index)
        score, category = part(self.score, index), part(self.category, index)
        return unchecked(
            Detections,
            self.stamp_s,
            self.boxes[index],
            score,
            category,
            velocity,
            self.dropped,
            covariance,
            self.detector,
        )

    @classmethod
    def empty(cls, stamp_s: float) -> Detections:
        """A frame in which nothing was detected.

        Raises:
            StampError: The stamp is no finite number, or not in seconds.
        """
        stamp_s = seconds(stamp_s, "detections")
        return unchecked(
            cls,
            stamp_s,
            Boxes.empty(),
            _NO_NUMBERS,
            _NO_NAMES,
            None,
            NOTHING_DROPPED,
            None,
            "",
        )


@shared_by_copies
@dataclass(frozen=True, slots=True, eq=False)
class Tracks:
    """Estimated objects at one time, map frame.

    Args:
        stamp_s: time of the estimate, seconds.
        track_id: (M,) identifiers, unique per tracker.
        boxes: M filtered boxes.
        category: (M,) names out of CATEGORIES.
        score: (M,) score of the last matched detection, in [0, 1].
        mean: (M, D) filter state (see `smartmot.filters.kalman`).
        covariance: (M, D, D) its covariance.
        velocity_mps: (M, 2) velocity over ground, map frame.
        yaw_rate_radps: (M,) turn rate.
        age_s: (M,) time since birth; infinite where nobody knows.
        coasted_s: (M,) time since the last matched detection (0 when matched in this frame).
        confirmed: (M,) whether the life cycle confirmed the track.
        dynamic: (M,) faster than the static/dynamic threshold.
        existence: (M,) probability that there is an object; None: the tracker does not tell.

    Raises:
        ShapeError: Shapes disagree, a value is not finite, a score is outside [0, 1], a time is negative, an
            identifier comes twice or a category is unknown.
        StampError: The stamp is no finite number, or not in seconds.
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
    existence: FloatArray | None = None

    def __post_init__(self) -> None:
        m = len(_boxes(self.boxes, "tracks"))
        _set(self, "stamp_s", seconds(self.stamp_s, "tracks"))
        ids = frozen(self.track_id, np.int64, (m,), "track_id")
        if len(np.unique(ids)) < m:
            raise ShapeError("track_id: an identifier comes twice; give each track one of its own")
        _set(self, "track_id", ids)
        _set(self, "category", _names(self.category, m, "categories"))
        mean = frozen(self.mean, np.float64, (m, None), "mean")
        d = mean.shape[1]
        covariance = frozen(self.covariance, np.float64, (m, d, d), "covariance")
        velocity = frozen(self.velocity_mps, np.float64, (m, 2), "velocity_mps")
        rate = frozen(self.yaw_rate_radps, np.float64, (m,), "yaw_rate_radps")
        values = (
            ("mean", mean),
            ("covariance", covariance),
            ("velocity_mps", velocity),
            ("yaw_rate_radps", rate),
        )
        for name, value in values:
            _set(self, name, _finite(value, name))
        _set(self, "score", _within_one(frozen(self.score, np.float64, (m,), "score"), "tracks"))
        for name in ("age_s", "coasted_s"):
            time = frozen(getattr(self, name), np.float64, (m,), name)
            if not (time >= 0.0).all():
                raise ShapeError(f"{name}: every time must be 0 or more, got {time.tolist()}")
            _set(self, name, time)
        for name in ("confirmed", "dynamic"):
            _set(self, name, frozen(getattr(self, name), np.bool_, (m,), name))
        if self.existence is not None:
            probable = frozen(self.existence, np.float64, (m,), "existence")
            _set(self, "existence", _within_one(probable, "tracks, existence"))

    def __len__(self) -> int:
        return len(self.boxes)

    def __getitem__(self, index: Any) -> Tracks:
        """Subset by a mask, a slice or an index array."""
        index = positions(index)
        columns = (getattr(self, name) for name in self.__slots__ if name != "stamp_s")
        return unchecked(Tracks, self.stamp_s, *(None if c is None else c[index] for c in columns))


@shared_by_copies
@dataclass(frozen=True, slots=True, eq=False)
class Forecast:
    """Predicted poses of M objects at T common times, map frame.

    Args:
        time_s: (T,) seconds after the frame, ascending from 0.
        center_m: (M, T, 2) box centres.
        yaw_rad: (M, T) headings.
        size_m: (M, 2) box sizes, unchanged over the horizon.
        valid: (M, T) whether the prediction counts at that time.
        covariance_m2: (M, T, 2, 2) covariances of the centres; None: not told, as by the paper's forecast.

    Raises:
        ShapeError: Shapes disagree, times do not ascend from 0, or a size is not positive. Poses that do not
            count may be anything; one that counts and is not finite is an error.
    """

    time_s: FloatArray
    center_m: FloatArray
    yaw_rad: FloatArray
    size_m: FloatArray
    valid: BoolArray
    covariance_m2: FloatArray | None = None

    def __post_init__(self) -> None:
        time = frozen(self.time_s, np.float64, (None,), "time_s")
        size = frozen(self.size_m, np.float64, (None, 2), "size_m")
        m, t = len(size), len(time)
        center = frozen(self.center_m, np.float64, (m, t, 2), "center_m")
        yaw = frozen(self.yaw_rad, np.float64, (m, t), "yaw_rad")
        valid = frozen(self.valid, np.bool_, (m, t), "valid")
        if t == 0 or time[0] != 0.0 or not (np.diff(time) > 0.0).all() or not math.isfinite(time[-1]):
            raise ShapeError("time_s: expected times that ascend from 0")
        if m and not (size.min() > 0.0 and math.isfinite(size.sum())):
            raise ShapeError("size_m: lengths and widths must be positive and finite")
        if not (np.isfinite(center).all(axis=2) & np.isfinite(yaw))[valid].all():
            raise ShapeError("forecast: every pose that counts must be finite")
        _set(self, "time_s", time)
        _set(self, "size_m", size)
        _set(self, "center_m", center)
        _set(self, "yaw_rad", yaw)
        _set(self, "valid", valid)
        if self.covariance_m2 is not None:
            spread = frozen(self.covariance_m2, np.float64, (m, t, 2, 2), "covariance_m2")
            _set(self, "covariance_m2", _finite(spread, "covariance_m2"))

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
        StampError: the stamp is no finite number, or not in seconds.
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
        seconds(self.stamp_s, "ego state")
        try:
            total = (
                self.x_m + self.y_m + self.yaw_rad + self.speed_mps + self.accel_mps2 + self.yaw_rate_radps
            )
            finite = math.isfinite(total)
            outlined = 0.0 < self.length_m < math.inf and 0.0 < self.width_m < math.inf
        except TypeError:
            raise ShapeError(f"ego state: every value must be a number, got {self!r}") from None
        if not finite:
            raise ShapeError(f"ego state: every value must be finite, got {self!r}")
        if not outlined:
            raise ShapeError(f"ego state: length and width must be positive and finite, got {self!r}")


@shared_by_copies
@dataclass(frozen=True, slots=True, eq=False)
class Threats:
    """Tracks whose forecast meets the ego's, nearest in time first.

    Args:
        track_id: (K,) identifiers.
        time_to_collision_s: (K,) first forecast time at which the boxes overlap.
        gap_m: (K,) free distance along the ego's heading, from its front to the object's box.
        required_decel_mps2: (K,) constant deceleration that stops the ego within the gap; infinite
            without one.

    Raises:
        ShapeError: Shapes disagree, a value is negative or NaN, or the times do not ascend.
    """

    track_id: IntArray
    time_to_collision_s: FloatArray
    gap_m: FloatArray
    required_decel_mps2: FloatArray

    def __post_init__(self) -> None:
        ids = frozen(self.track_id, np.int64, (None,), "track_id")
        _set(self, "track_id", ids)
        for name in ("time_to_collision_s", "gap_m", "required_decel_mps2"):
            values = frozen(getattr(self, name), np.float64, (len(ids),), name)
            if not (values >= 0.0).all():
                raise ShapeError(f"{name}: every value must be 0 or more, got {values.tolist()}")
            _set(self, name, values)
        if (np.diff(self.time_to_collision_s) < 0.0).any():
            raise ShapeError("time_to_collision_s: expected the nearest in time first")

    def __len__(self) -> int:
        return len(self.track_id)
