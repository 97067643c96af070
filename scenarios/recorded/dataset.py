"""Recorded data as arrays: the boxes of a whole sequence in one value, frame after frame.

How to use it::

    from scenarios.recorded.kitti import read_kitti

    data = read_kitti(Path("kitti/training"))
    for sequence in data.sequences:
        tracker = smartmot.Tracker(config)
        for detections in sequence.frames():  # smartmot.Detections, world frame, in the order of time
            tracks = tracker.update(detections)

or with the vehicle's motion, for decisions (`scenarios.sources.recorded`)::

    for frame in frames(RecordedSource(sequence)):
        state, result = pipeline.step(state, frame.detections, frame.ego)

The world frame is that of the data set: x and y span the ground, z points up. With ego poses it stands still;
without them it is the vehicle's own (x ahead, y left), and a track's velocity is relative to the vehicle.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, fields, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import _smartmot
from scenarios.errors import DatasetError
from scenarios.recorded.poses import heading
from smartmot.detection_input import (
    GREATEST_BOX,
    LEAST_BOX,
    MAX_POSITION_M,
    MAX_SIZE_M,
    MIN_SIZE_M,
    measured_velocities,
)
from smartmot.errors import StampError
from smartmot.types import BoolArray, Boxes, Detections, FloatArray, IntArray, StrArray, seconds

_LONGEST_NUMBER = 16
"""A name with so many digits is a token, not a number."""

HEIGHT_M = 1.5
"""Of boxes without a height: that of a car."""

LEFT_OUT = ""
"""In place of a category: boxes of this class are not read."""


@dataclass(frozen=True, slots=True, eq=False)
class Objects:
    """Boxes of one sequence: K rows in the order of the frames.

    Args:
        frame: (K,) positions in the sequence's frames, ascending.
        object_id: (K,) identity: of the label or the track; the row's number for detections.
        category: (K,) names out of `smartmot.types.CATEGORIES`.
        kind: (K,) the data set's own name of the class.
        score: (K,) confidence: of detections in [0, 1], of tracks to be written in the detector's scale.
        center_m: (K, 2) centres on the ground, world frame.
        size_m: (K, 2) length and width.
        yaw_rad: (K,) headings, counter-clockwise from x, world frame.
        bottom_m: (K,) height of the box's underside, world frame.
        height_m: (K,) height of the box.
        velocity_mps: (K, 2) velocity over ground, world frame; NaN where it is not known.
        ignored: (K,) labels that count neither as found nor as missed.
        pose_covariance: (K, 3, 3) noise of x, y and yaw that the detector states, world frame; NaN where it
            states none.
        detector: (K,) who reported the box, where several detectors did; "" otherwise.
        received_s: (K,) when it arrived, by the clock of the frames; NaN where that is not known.
    """

    frame: IntArray
    object_id: IntArray
    category: StrArray
    kind: StrArray
    score: FloatArray
    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray
    bottom_m: FloatArray
    height_m: FloatArray
    velocity_mps: FloatArray
    ignored: BoolArray
    pose_covariance: FloatArray
    detector: StrArray
    received_s: FloatArray

    def __post_init__(self) -> None:
        shapes = {item.name: getattr(self, item.name).shape[:1] for item in fields(self)}
        if len(set(shapes.values())) != 1:
            raise DatasetError(f"objects: expected arrays of one length, got {shapes}")
        if np.any(np.diff(self.frame) < 0):
            raise DatasetError("objects: rows must be in the order of the frames")

    def __len__(self) -> int:
        return len(self.frame)

    def __getitem__(self, index: Any) -> Objects:
        """Subset by a mask, a slice or an ascending index array."""
        return Objects(**{item.name: getattr(self, item.name)[index] for item in fields(self)})

    @classmethod
    def of(cls, frame: NDArray[Any], center_m: FloatArray, **columns: NDArray[Any]) -> Objects:
        """Rows in any order, sorted by frame; columns not given are filled with what says nothing.

        Rows whose category is `LEFT_OUT` are left out.

        Args:
            frame: (K,) positions in the sequence's frames.
            center_m: (K, 2) centres.
            columns: The other fields; sizes and headings are needed.
        """
        count = len(frame)
        filled: dict[str, NDArray[Any]] = {
            "frame": np.asarray(frame, dtype=np.int64),
            "object_id": np.arange(count),
            "category": np.full(count, "unknown"),
            "kind": columns.get("category", np.full(count, "unknown")),
            "score": np.ones(count),
            "center_m": center_m,
            "bottom_m": np.zeros(count),
            "height_m": np.full(count, HEIGHT_M),
            "velocity_mps": np.full((count, 2), np.nan),
            "ignored": np.zeros(count, dtype=np.bool_),
            "pose_covariance": np.full((count, 3, 3), np.nan),
            "detector": np.full(count, ""),
            "received_s": np.full(count, np.nan),
        } | columns
        order = np.argsort(filled["frame"], kind="stable")
        order = order[filled["category"][order] != LEFT_OUT]
        return cls(**{name: values[order] for name, values in filled.items()})

    @classmethod
    def empty(cls) -> Objects:
        """No rows."""
        return cls.of(np.zeros(0), np.zeros((0, 2)), size_m=np.zeros((0, 2)), yaw_rad=np.zeros(0))

    def frame_starts(self, frame_count: int) -> IntArray:
        """(F + 1,) rows at which the frames start, and the number of rows."""
        return np.searchsorted(self.frame, np.arange(frame_count + 1)).astype(np.int64)

    def frame_rows(self, frame_count: int) -> list[slice]:
        """F slices: the rows of each frame."""
        start = self.frame_starts(frame_count).tolist()
        return [slice(first, last) for first, last in pairwise(start)]

    def usable(self) -> BoolArray:
        """(K,) rows whose box is possible (as in `smartmot.detections_from_arrays`) and has a score."""
        box = np.column_stack((self.center_m, self.size_m, self.yaw_rad))
        good = ((box >= LEAST_BOX) & (box <= GREATEST_BOX)).all(axis=1) & np.isfinite(self.score)
        good &= (self.height_m >= MIN_SIZE_M) & (self.height_m <= MAX_SIZE_M)
        good &= np.abs(self.bottom_m) <= MAX_POSITION_M
        return np.asarray(good, dtype=np.bool_)


@dataclass(frozen=True, slots=True, eq=False)
class Camera:
    """What the image of a KITTI sequence adds: projection and regions without labels.

    Args:
        projection: (3, 4) matrix from the camera's frame to pixels.
        dont_care_frame: (D,) frames of the regions, ascending.
        dont_care_px: (D, 4) left, top, right and bottom of the regions.
    """

    projection: FloatArray
    dont_care_frame: IntArray
    dont_care_px: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class Sweeps:
    """What a LiDAR with a cloud for every frame adds: where it is, and what its clouds hold of the labels.

    Args:
        ego_SE3_lidar: (4, 4) pose of the sensor (x ahead, y left, z up) in the vehicle's frame.
        point_count: (K,) points of the frame's cloud in the box of each label, those on its faces included.
        seen_share: (K,) points on each of them over those that it would have if nothing else were there, 0 to
            1; None: not known.
    """

    ego_SE3_lidar: FloatArray  # noqa: N815 - dst_SE3_src is the field's notation
    point_count: IntArray
    seen_share: FloatArray | None = None

    def __getitem__(self, index: Any) -> Sweeps:
        """What is known of some of the labels."""
        share = None if self.seen_share is None else self.seen_share[index]
        return Sweeps(self.ego_SE3_lidar, self.point_count[index], share)


@dataclass(frozen=True, slots=True, eq=False)
class Sequence:
    """One recording.

    Args:
        name: Unique in the data set.
        stamp_s: (F,) times of the frames, as they were recorded.
        frame_name: F names of the frames: frame numbers, times or sample tokens.
        detections: What the detector reported.
        labels: The truth, or None.
        world_SE3_ego: (F, 4, 4) poses of the vehicle (x ahead, y left, z up), or None without odometry.
        camera: The camera of KITTI data, or None.
        sweeps: What a LiDAR adds to the labels, or None.
        map_path: The recording's own map (`scenarios.recorded.maps.drive_map`), in its world frame, or None.
        stamp_ns: (F,) the times as whole nanoseconds since 1970, where they were recorded so, or None. In
            seconds such times are 0.24 us apart.
    """

    name: str
    stamp_s: FloatArray
    frame_name: tuple[str, ...]
    detections: Objects
    labels: Objects | None = None
    world_SE3_ego: FloatArray | None = None  # noqa: N815 - dst_SE3_src is the field's notation
    camera: Camera | None = None
    sweeps: Sweeps | None = None
    map_path: Path | None = None
    stamp_ns: IntArray | None = None

    def __len__(self) -> int:
        return len(self.stamp_s)

    def frame_numbers(self) -> IntArray:
        """(F,) numbers of the frames for files that have numbers: their names if all are, else positions."""
        if all(name.isdecimal() and len(name) < _LONGEST_NUMBER for name in self.frame_name):
            return np.array(list(map(int, self.frame_name)), dtype=np.int64)
        return np.arange(len(self))

    def frames(self, first: int = 0) -> Iterator[Detections]:
        """The detections of each frame, as the tracker takes them.

        Args:
            first: From which frame on.

        Raises:
            smartmot.errors.StampError: A stamp is not in seconds.
        """
        made = self._maker()
        frame_rows = self.detections.frame_rows(len(self))
        for stamp_s, rows in zip(self.stamp_s[first:].tolist(), frame_rows[first:], strict=True):
            yield made(stamp_s, rows, "")

    def measurements(self) -> Iterator[tuple[int, float, Detections]]:
        """What each detector reported in each frame: the frame, when it arrived (NaN: not known), detections.

        A frame without any detections is one of no detector, named "". A detector that saw nothing in a frame
        in which another saw something is not there: files do not tell it.
        """
        made, objects = self._maker(), self.detections
        for k, rows in enumerate(objects.frame_rows(len(self))):
            names = objects.detector[rows]
            for name in dict.fromkeys(names.tolist()) or ("",):
                own = np.flatnonzero(names == name) + rows.start
                received_s = objects.received_s[own]
                known = received_s[np.isfinite(received_s)]
                yield (
                    k,
                    float(known.max()) if len(known) else math.nan,
                    made(float(self.stamp_s[k]), own, name),
                )

    def _maker(self) -> Callable[[float, slice | IntArray, str], Detections]:
        """What makes detections of a time out of rows."""
        objects = self.detections
        measured = bool(np.isfinite(objects.velocity_mps).any())
        stated = bool(np.isfinite(objects.pose_covariance).any())

        def made(stamp_s: float, rows: slice | IntArray, detector: str) -> Detections:
            return Detections(
                stamp_s,
                Boxes(objects.center_m[rows], objects.size_m[rows], objects.yaw_rad[rows]),
                objects.score[rows],
                objects.category[rows],
                objects.velocity_mps[rows] if measured else None,
                pose_covariance=objects.pose_covariance[rows] if stated else None,
                detector=detector,
            )

        return made

    def ego_xy_yaw(self) -> FloatArray:
        """(F, 3) x, y and yaw of the vehicle; zeros without odometry."""
        if self.world_SE3_ego is None:
            return np.zeros((len(self), 3))
        pose = self.world_SE3_ego
        return np.column_stack((pose[:, :2, 3], heading(pose)))

    def ego_heights_m(self) -> FloatArray | None:
        """(F,) heights of the recorded poses, which tell levels apart; None where all are 0: not recorded."""
        heights = None if self.world_SE3_ego is None else self.world_SE3_ego[:, 2, 3]
        return heights if heights is not None and heights.any() else None


@dataclass(frozen=True, slots=True)
class Dataset:
    """Everything read from a folder.

    Args:
        kind: Name of the format, one of `scenarios.recorded.formats.FORMATS`.
        sequences: The recordings.
        rejected: Detections left out because a number is not finite or the box is impossible.
        log_odds: Whether the detector's scores were log odds; `Objects.score` holds probabilities.
        notes: What a user should know about how the data were read.
    """

    kind: str
    sequences: tuple[Sequence, ...]
    rejected: int = 0
    log_odds: bool = False
    notes: tuple[str, ...] = field(default=())

    @property
    def frame_count(self) -> int:
        """Frames of all sequences."""
        return sum(map(len, self.sequences))


def probability(score: FloatArray) -> FloatArray:
    """Logistic function of log odds."""
    return np.asarray(0.5 * (1.0 + np.tanh(0.5 * score)))


def log_odds(probability: FloatArray) -> FloatArray:
    """Inverse of `probability`; certain scores stay finite."""
    # log1p: the difference 1 - p has lost the digits of a small p
    clipped = np.clip(probability, 1e-12, 1.0 - 1e-12)
    return np.asarray(np.log(clipped) - np.log1p(-clipped))


_SCORE_ROUNDING = 1e-6
"""Probabilities that left single precision may be over 1 by so much."""

_LONGEST_STEP_S = 10.0
"""Nobody records frames so far apart; stamps in milliseconds or nanoseconds look that way."""


def finished(kind: str, sequences: list[Sequence], notes: tuple[str, ...] = ()) -> Dataset:
    """A data set from sequences as read: impossible boxes out, scores made probabilities.

    One scale holds for a whole data set: if any score lies outside [0, 1], all are taken for log odds, which
    is what detectors put out before their last sigmoid.
    """
    for sequence in sequences:
        require_seconds(f"sequence {sequence.name}", sequence.stamp_s)
    kept = [_possible(sequence) for sequence in sequences]
    rejected = sum(len(a.detections) - len(b.detections) for a, b in zip(sequences, kept, strict=True))
    lowest = min((s.detections.score.min() for s in kept if len(s.detections)), default=0.0)
    highest = max((s.detections.score.max() for s in kept if len(s.detections)), default=1.0)
    as_log_odds = bool(lowest < -_SCORE_ROUNDING or highest > 1.0 + _SCORE_ROUNDING)
    if as_log_odds:
        notes += (f"scores from {lowest:g} to {highest:g}: taken for log odds",)
    steps = np.concatenate([np.zeros(0), *(np.diff(s.stamp_s) for s in kept)])
    if len(steps) and np.median(steps) > _LONGEST_STEP_S:
        notes += (f"frames are {np.median(steps):g} s apart: are the times in seconds?",)
    to_scale = probability if as_log_odds else _within_bounds
    scaled = (replace(s, detections=replace(s.detections, score=to_scale(s.detections.score))) for s in kept)
    return Dataset(kind, tuple(scaled), rejected, as_log_odds, (*notes, *_label_notes(sequences)))


def require_seconds(what: str, stamp_s: FloatArray) -> None:
    """Demand times that are finite and in seconds.

    Raises:
        DatasetError: One is not; the message begins with `what`.
    """
    try:
        for extreme_s in (stamp_s.min(initial=0.0), stamp_s.max(initial=0.0)):
            seconds(float(extreme_s), what)
    except StampError as error:
        raise DatasetError(str(error)) from None


def _label_notes(sequences: list[Sequence]) -> list[str]:
    """Lines about labels that are left out or doubtful."""
    labels = [s.labels for s in sequences if s.labels is not None]
    impossible = sum(int((~each.usable()).sum()) for each in labels)
    twice = sum(map(_labelled_again, labels))
    notes = [f"{impossible} impossible labels left out"] if impossible else []
    if twice:
        notes.append(f"{twice} labels are of an object that has another label in the same frame")
    return notes


def labels_as_detections(data: Dataset) -> Dataset:
    """Data without a detector's output, with labels in its place: all that count, exact and sure.

    Data with any detections stay what they are.
    """
    labels = [Objects.empty() if s.labels is None else s.labels[~s.labels.ignored] for s in data.sequences]
    if any(len(s.detections) for s in data.sequences) or not any(map(len, labels)):
        return data
    stand_ins = (
        replace(counted, object_id=np.arange(len(counted)), score=np.ones(len(counted))) for counted in labels
    )
    sequences = (replace(s, detections=d) for s, d in zip(data.sequences, stand_ins, strict=True))
    note = (
        "no detections: labels stand in for them, more exact than any detector; the accuracy is none of one"
    )
    return replace(data, sequences=tuple(sequences), notes=(*data.notes, note))


def _within_bounds(score: FloatArray) -> FloatArray:
    """Scores without what rounding has put beyond [0, 1]."""
    return score.clip(0.0, 1.0)


def _possible(sequence: Sequence) -> Sequence:
    """The sequence without impossible boxes, also among the labels, and without impossible velocities."""
    labels = sequence.labels
    return replace(
        sequence,
        detections=_with_velocities(sequence.detections[sequence.detections.usable()]),
        labels=None if labels is None else _with_velocities(labels[labels.usable()]),
    )


def _with_velocities(objects: Objects) -> Objects:
    """The objects with velocities that can be, or none."""
    return replace(objects, velocity_mps=measured_velocities(objects.velocity_mps))


def _labelled_again(labels: Objects) -> int:
    """How many labels are of an object that has another in the same frame."""
    order = np.lexsort((labels.frame, labels.object_id))
    same = (np.diff(labels.frame[order]) == 0) & (np.diff(labels.object_id[order]) == 0)
    return int(same.sum())


__getattr__ = _smartmot.renamed(__name__, {"MAX_FRAMES": "scenarios.recorded.textfile.MAX_FRAMES"})
