"""Where the vehicle and the labelled objects of a recording were at any time, between its frames as well."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Objects, Sequence
from smartmot.detection_input import MAX_POSITION_M
from smartmot.types import Boxes, FloatArray, IntArray, StrArray

LEAST_WINDOW_S = 0.5
"""Accelerations are second differences of the way driven over this time: poses that are off by 1 cm make an
error of 0.1 m/s2 then, and one of 2.4 m/s2 over the 0.1 s between two frames."""


def center_poses(sequence: Sequence, center_ahead_m: float = 0.0) -> FloatArray:
    """(F, 3) x, y and yaw of the middle of the vehicle's outline; zeros without odometry.

    Args:
        sequence: the recording.
        center_ahead_m: how far the middle is ahead of the point whose poses are recorded.

    Raises:
        DatasetError: a pose is impossible.
    """
    pose = sequence.ego_xy_yaw()
    if not (np.abs(pose) <= MAX_POSITION_M).all():
        raise DatasetError(f"sequence {sequence.name}: ego poses must be within {MAX_POSITION_M:g} m")
    pose[:, 0] += center_ahead_m * np.cos(pose[:, 2])
    pose[:, 1] += center_ahead_m * np.sin(pose[:, 2])
    return pose


JITTER_M = 0.5
"""Poses of a vehicle that stands wander by less: by centimetres with corrections, by decimetres without
(assumed)."""

LEAST_STEP_S = 1e-3
"""Velocities are differences over no less: stamps that are rounded may be equal."""


_ROUNDING_M = 1e-6
"""Places between two labels may be rounded."""


class EgoMotion:
    """The vehicle's way, straight between two frames; the pose is that of the middle of its outline.

    Args:
        time_s: (F,) times of the frames, ascending.
        pose: (F, 3) x, y and yaw.
        length_m: outline along the heading.
        width_m: outline across it.
    """

    def __init__(self, time_s: FloatArray, pose: FloatArray, length_m: float, width_m: float) -> None:
        self.time_s, self.size_m = time_s, np.array([length_m, width_m])
        self._pose = np.column_stack((pose[:, :2], np.unwrap(pose[:, 2])))
        step = np.diff(self._pose, axis=0)
        yaw = self._pose[1:, 2]
        ahead = step[:, 0] * np.cos(yaw) + step[:, 1] * np.sin(yaw)
        along = np.copysign(np.hypot(step[:, 0], step[:, 1]), ahead)
        self.station_m: FloatArray = np.concatenate(([0.0], np.cumsum(along)))
        interval_s = float(np.median(np.diff(time_s))) if len(time_s) > 1 else LEAST_WINDOW_S
        self._window_s = max(LEAST_WINDOW_S, interval_s)

    @property
    def end_s(self) -> float:
        """Time of the last frame."""
        return float(self.time_s[-1])

    @property
    def driven_m(self) -> float:
        """Length of the way, forward or in reverse, without the jitter of poses that stand."""
        driven_m, turned_m = 0.0, float(self.station_m[0])
        farthest_m = turned_m  # since the vehicle last turned round
        for station_m in self.station_m.tolist():
            onward_m = (station_m - farthest_m) * np.sign(farthest_m - turned_m or station_m - turned_m)
            if onward_m > 0.0:
                farthest_m = station_m
            elif onward_m <= -JITTER_M:
                driven_m += abs(farthest_m - turned_m)
                turned_m, farthest_m = farthest_m, station_m
        return driven_m + abs(farthest_m - turned_m)

    def pose(self, time_s: FloatArray) -> FloatArray:
        """(T, 3) poses at (T,) times; before the first and after the last frame it stands."""
        return np.column_stack([np.interp(time_s, self.time_s, column) for column in self._pose.T])

    def boxes(self, time_s: FloatArray) -> Boxes:
        """T outlines at (T,) times."""
        pose = self.pose(time_s)
        return Boxes(pose[:, :2], np.tile(self.size_m, (len(pose), 1)), pose[:, 2])

    def ahead(self, since_s: float, distance_m: FloatArray) -> Boxes:
        """Outlines on the way, a distance from where the vehicle was; beyond its end straight on.

        Args:
            since_s: when it was there.
            distance_m: (T,) distances along the way, not negative.
        """
        first = int(np.searchsorted(self.time_s, since_s, side="right"))
        start = self.pose(np.array([since_s]))
        poses = np.concatenate((start, self._pose[first:]))
        step = np.hypot(*np.diff(poses[:, :2], axis=0).T)
        station = np.concatenate(([0.0], np.cumsum(step)))
        pose = np.column_stack([np.interp(distance_m, station, column) for column in poses.T])
        beyond = np.maximum(distance_m - station[-1], 0.0)
        pose[:, :2] += beyond[:, None] * np.column_stack((np.cos(pose[:, 2]), np.sin(pose[:, 2])))
        return Boxes(pose[:, :2], np.tile(self.size_m, (len(pose), 1)), pose[:, 2])

    def accel_mps2(self, time_s: FloatArray) -> FloatArray:
        """(T,) accelerations along the way; NaN where the recording is too short on either side."""
        window = self._window_s
        before, now, after = (
            np.interp(time_s + shift, self.time_s, self.station_m) for shift in (-window, 0.0, window)
        )
        known = (time_s - window >= self.time_s[0] - 1e-9) & (time_s + window <= self.time_s[-1] + 1e-9)
        return np.where(known, (after - 2.0 * now + before) / window**2, np.nan)


@dataclass(frozen=True, slots=True, eq=False)
class ObjectMotion:
    """One labelled object from its first label to its last, straight between two.

    Args:
        object_id: identity of the label.
        category: name out of `smartmot.types.CATEGORIES`.
        time_s: (R,) times of its labels, ascending.
        center_m: (R, 2) centres.
        size_m: (R, 2) lengths and widths.
        yaw_rad: (R,) headings, without jumps.
        velocity_mps: (2,) at the last label.
        bounds_m: (4,) left, low, right, high of a rectangle that holds its outline at every time.
    """

    object_id: int
    category: str
    time_s: FloatArray
    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray
    velocity_mps: FloatArray
    bounds_m: FloatArray

    def boxes(self, time_s: FloatArray) -> Boxes:
        """T boxes at (T,) times; before its first and after its last label it stands."""
        x, y, length, width, yaw = self._columns_at(time_s)
        return Boxes(np.column_stack((x, y)), np.column_stack((length, width)), yaw)

    def _columns_at(self, time_s: FloatArray) -> list[FloatArray]:
        columns = (*self.center_m.T, *self.size_m.T, self.yaw_rad)
        return [np.interp(time_s, self.time_s, column) for column in columns]


def boxes_at(objects: list[ObjectMotion], time_s: float) -> Boxes:
    """K boxes of objects at one time; before its first and after its last label an object stands."""
    at = np.array([time_s])
    columns = np.array([o._columns_at(at) for o in objects]).reshape(len(objects), 5)
    return Boxes(columns[:, :2], columns[:, 2:4], columns[:, 4])


class LabelMotion:
    """The labelled objects of a recording.

    Args:
        labels: all labels; a second one of an object in the same frame is left out.
        time_s: (F,) times of the frames.

    Attributes:
        labels: the L labels, in the order of the frames.
        index: (L,) numbers of the objects that they are of.
        velocity_mps: (L, 2) mean velocities over the half second before, or over as much as is labelled.
        objects: the K objects, in the order of their identities.
        rows: F slices: the labels of each frame.
    """

    def __init__(self, labels: Objects, time_s: FloatArray) -> None:
        order = np.lexsort((labels.frame, labels.object_id))
        first = np.ones(len(order), dtype=np.bool_)
        first[1:] = np.diff(labels.frame[order]).astype(bool) | np.diff(labels.object_id[order]).astype(bool)
        self.labels = labels = labels[np.sort(order[first])]
        identity, self.index = np.unique(labels.object_id, return_inverse=True)
        self.rows = labels.frame_rows(len(time_s))
        by_object = np.lexsort((labels.frame, self.index))
        start = np.searchsorted(self.index[by_object], np.arange(len(identity) + 1))
        moving, stamp_s = _ByObject.of(labels, by_object), time_s[labels.frame[by_object]]
        velocity_mps = _velocities(time_s, labels.frame[by_object], moving.center_m, start)
        self.velocity_mps: FloatArray = np.zeros((len(labels), 2))
        self.velocity_mps[by_object] = velocity_mps
        self.objects = objects = _objects(moving, stamp_s, velocity_mps, start)
        self._first_s = np.array([o.time_s[0] for o in objects])
        self._last_s = np.array([o.time_s[-1] for o in objects])

    @property
    def category(self) -> StrArray:
        """(K,) categories of the objects."""
        return np.array([o.category for o in self.objects], dtype=np.str_)

    @property
    def speed_mps(self) -> FloatArray:
        """(L,) speeds, negative against the heading."""
        yaw, (x, y) = self.labels.yaw_rad, self.velocity_mps.T
        speed: FloatArray = np.copysign(np.hypot(x, y), x * np.cos(yaw) + y * np.sin(yaw))
        return speed

    def between(self, first_s: float, last_s: float) -> list[ObjectMotion]:
        """Objects that are labelled at some time of a span."""
        there = (self._last_s >= first_s - 1e-9) & (self._first_s <= last_s + 1e-9)
        return [self.objects[k] for k in np.flatnonzero(there).tolist()]


class _ByObject(NamedTuple):
    """Columns of the labels, object by object in the order of time."""

    object_id: IntArray
    category: StrArray
    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray

    @classmethod
    def of(cls, labels: Objects, by_object: IntArray) -> _ByObject:
        return cls(*(getattr(labels, name)[by_object] for name in cls._fields))


def _velocities(time_s: FloatArray, frame: IntArray, center_m: FloatArray, start: IntArray) -> FloatArray:
    """(L, 2) velocities at labels; that of an object's first label is the second's.

    Args:
        time_s: (F,) times of the frames.
        frame: (L,) of the labels, object by object.
        center_m: (L, 2) their centres.
        start: (K + 1,) first label of each object, and their number.
    """
    count, row = np.diff(start), np.arange(len(frame))
    first, last = (np.repeat(ends, count) for ends in (start[:-1], start[1:] - 1))
    # an object's labels of the window: numbers of frames ascend as their times do
    key = len(time_s) * first + frame
    since_frame = np.searchsorted(time_s, time_s - LEAST_WINDOW_S - 1e-6)
    since = np.searchsorted(key, len(time_s) * first + since_frame[frame])
    since = np.minimum(since, np.maximum(row - 1, first))
    until = np.minimum(np.maximum(row, first + 1), last)
    elapsed = np.maximum(time_s[frame[until]] - time_s[frame[since]], LEAST_STEP_S)
    velocity: FloatArray = (center_m[until] - center_m[since]) / elapsed[:, None]
    return velocity


def _objects(
    moving: _ByObject, stamp_s: FloatArray, velocity_mps: FloatArray, start: IntArray
) -> tuple[ObjectMotion, ...]:
    """The K objects from their labels."""
    if not len(stamp_s):
        return ()
    reach_m = 0.5 * np.hypot(*moving.size_m.T)[:, None] + _ROUNDING_M
    low_m = np.minimum.reduceat(moving.center_m - reach_m, start[:-1])
    high_m = np.maximum.reduceat(moving.center_m + reach_m, start[:-1])
    jumps = np.concatenate(([0], np.cumsum(np.abs(np.diff(moving.yaw_rad)) >= np.pi)))
    objects = []
    for k, (low, high) in enumerate(pairwise(start.tolist())):
        rows, yaw_rad = slice(low, high), moving.yaw_rad[low:high]
        objects.append(
            ObjectMotion(
                int(moving.object_id[low]),
                str(moving.category[low]),
                stamp_s[rows],
                moving.center_m[rows],
                moving.size_m[rows],
                np.unwrap(yaw_rad) if jumps[high - 1] > jumps[low] else yaw_rad,
                velocity_mps[high - 1],
                np.concatenate((low_m[k], high_m[k])),
            )
        )
    return tuple(objects)


@dataclass(frozen=True, slots=True, eq=False)
class RecordedMotion:
    """A recording as it went on: the vehicle, and the labelled objects around it.

    Args:
        ego: the vehicle.
        labels: the objects; None: nothing is labelled.
    """

    ego: EgoMotion
    labels: LabelMotion | None


def motion_of(
    sequence: Sequence, length_m: float, width_m: float, center_ahead_m: float = 0.0
) -> RecordedMotion:
    """The motion of a recording with ego poses; see `RecordedSource` for the outline."""
    ego = EgoMotion(sequence.stamp_s, center_poses(sequence, center_ahead_m), length_m, width_m)
    labels = None if sequence.labels is None else LabelMotion(sequence.labels, sequence.stamp_s)
    return RecordedMotion(ego, labels)
