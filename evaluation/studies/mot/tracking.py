"""The tracker over a recorded sequence."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Objects, Sequence
from scenarios.sources.frames import frames
from scenarios.sources.recorded import RecordedSource
from smartmot.errors import SmartMotError
from smartmot.tracking.fusion.fused import FusedTracker, LeftOut
from smartmot.tracking.own import ObjectTracker, update_own
from smartmot.tracking.tracker import Tracker, box_filter
from smartmot.types import BoolArray, FloatArray, IntArray, Tracks

_ACCELERATION = ("ax_mps2", "ay_mps2")
_FAR_M = 1e6
"""Added to the distance of a detection of another category: taken only where there is no other."""


@dataclass(frozen=True, slots=True, eq=False)
class TrackedSequence:
    """What the tracker made of a sequence.

    Args:
        sequence: The recording.
        tracks: K confirmed tracks, frame after frame; identities are unique in the sequence.
        yaw_rate_radps: (K,) turn rates.
        acceleration_mps2: (K, 2) acceleration, world frame; zero where the motion model has none.
        coasted_s: (K,) time since the last detection.
        dynamic: (K,) what the tracker says moves; None: not known.
        covariance: (K, D, D) of the filter's states; None: not known.
        existence: (K,) probabilities that there is an object; None: the tracker does not tell.
        mean: (K, D) of the filter's states; None: not known.
        confirmed: (K,) whether the row's track was confirmed by then; None: all were.
        left_out: Of several detectors, what was left out of each, by name.
    """

    sequence: Sequence
    tracks: Objects
    yaw_rate_radps: FloatArray
    acceleration_mps2: FloatArray
    coasted_s: FloatArray
    dynamic: BoolArray | None = None
    covariance: FloatArray | None = None
    existence: FloatArray | None = None
    mean: FloatArray | None = None
    confirmed: BoolArray | None = None
    left_out: Mapping[str, LeftOut] = field(default_factory=dict)


def track_sequence(
    sequence: Sequence,
    tracker: Tracker | FusedTracker | ObjectTracker,
    done: Callable[[], None] = lambda: None,
    hindsight: bool = False,
) -> TrackedSequence:
    """Run a tracker over all frames and keep what it confirmed.

    Of several detectors, measurements are taken in as they arrive. A frame's tracks are those that were known
    when the first measurement of its time arrived; if a later frame had been tracked by then, those that this
    measurement leads to.

    The tracker estimates boxes on the ground. A track's height and underside are those of the detection
    nearest to it, and stay while it coasts.

    Args:
        sequence: The recording.
        tracker: A tracker that has seen nothing yet.
        done: Called after every frame.
        hindsight: Whether tentative tracks are kept too, and measurements of several detectors are taken in
            as they were made, all those of a time before its tracks are told.

    Raises:
        DatasetError: The tracker refuses a frame, for example one that is not newer than the one before; or
            one of the user's own fails.
    """
    if isinstance(tracker, FusedTracker):
        reported = _reported_by_several(sequence, tracker, done, hindsight)
    else:
        reported = []
        update = tracker.update if isinstance(tracker, Tracker) else partial(update_own, tracker)
        for k, frame in enumerate(frames(RecordedSource(sequence, needs_odometry=False))):
            try:
                reported.append(update(frame.detections))
            except SmartMotError as error:
                raise DatasetError(
                    f"sequence {sequence.name}, frame {sequence.frame_name[k]}: {error}"
                ) from None
            done()
    if not reported:
        return TrackedSequence(sequence, Objects.empty(), np.zeros(0), np.zeros((0, 2)), np.zeros(0))
    frame_index = np.repeat(np.arange(len(reported)), [len(t) for t in reported])

    def column(name: str) -> FloatArray:
        return np.concatenate([getattr(t, name) for t in reported])

    tracks = Objects.of(
        frame_index,
        np.concatenate([t.boxes.center_m for t in reported]),
        size_m=np.concatenate([t.boxes.size_m for t in reported]),
        yaw_rad=np.concatenate([t.boxes.yaw_rad for t in reported]),
        object_id=column("track_id"),
        category=column("category"),
        score=column("score"),
        velocity_mps=column("velocity_mps"),
    )
    coasted_s = column("coasted_s")
    tracks = _with_heights(tracks, coasted_s <= 0.0, sequence.detections, len(sequence))
    confirmed = column("confirmed").astype(np.bool_)
    kept = np.ones_like(confirmed) if hindsight else confirmed
    return TrackedSequence(
        sequence=sequence,
        tracks=tracks[kept],
        yaw_rate_radps=column("yaw_rate_radps")[kept],
        acceleration_mps2=_accelerations(tracker, column("mean"))[kept],
        coasted_s=coasted_s[kept],
        dynamic=column("dynamic").astype(np.bool_)[kept],
        covariance=column("covariance")[kept],
        existence=None if reported[0].existence is None else column("existence")[kept],
        mean=column("mean")[kept],
        confirmed=confirmed[kept],
        left_out=tracker.finish() if isinstance(tracker, FusedTracker) else {},
    )


def _reported_by_several(
    sequence: Sequence, tracker: FusedTracker, done: Callable[[], None], hindsight: bool
) -> list[Tracks]:
    """Tracks of every frame, measurements taken in as they arrive; see `track_sequence`."""
    first_name = next(iter(tracker.delays_s))
    arrivals = []
    for k, received_s, detections in sequence.measurements():
        if not detections.detector:  # a frame in which nobody saw anything
            detections = replace(detections, detector=first_name)
        if hindsight:
            received_s = detections.stamp_s
        elif math.isnan(received_s):
            received_s = detections.stamp_s + tracker.delays_s[detections.detector]
        arrivals.append((max(received_s, detections.stamp_s), k, detections))
    arrivals.sort(key=lambda each: each[:2])
    reported: dict[int, Tracks] = {}
    waiting: dict[int, float] = {}  # frames whose measurement is far ahead of all others
    for _, k, detections in arrivals:
        try:
            tracks = tracker.update(detections)
        except SmartMotError as error:
            raise DatasetError(f"sequence {sequence.name}, frame {sequence.frame_name[k]}: {error}") from None
        if hindsight or k not in reported:
            then = tracks if tracks.stamp_s == detections.stamp_s else tracker.at(detections.stamp_s)
            reported[k] = tracks[:0] if then is None else then
            if then is None and tracker.waiting:
                waiting[k] = detections.stamp_s
            done()
        if waiting and not tracker.waiting:
            reported |= {frame: tracker.at(stamp_s) or reported[frame] for frame, stamp_s in waiting.items()}
            waiting.clear()
    return [reported[k] for k in range(len(sequence))]


def _accelerations(tracker: Tracker | FusedTracker | ObjectTracker, mean: FloatArray) -> FloatArray:
    """(K, 2) accelerations in the filter's states, zero where its model has none."""
    if not isinstance(tracker, Tracker | FusedTracker):
        return np.zeros((len(mean), 2))
    names = box_filter(tracker.config.motion, tracker.config.filter).names
    if _ACCELERATION[0] not in names:
        return np.zeros((len(mean), 2))
    return mean[:, [names.index(name) for name in _ACCELERATION]]


def _with_heights(tracks: Objects, matched: BoolArray, detections: Objects, frame_count: int) -> Objects:
    """Tracks with the vertical extent of the detections that they follow, and the class name of the first."""
    nearest = _nearest(tracks, detections, frame_count)
    seen = matched & (nearest >= 0)
    # rows track by track: a coasting one keeps what its last matched row had
    order = np.lexsort((tracks.frame, tracks.object_id))
    place = np.arange(len(order))
    last = np.empty_like(order)
    last[order] = order[np.maximum.accumulate(np.where(seen[order], place, 0))]
    ids = tracks.object_id[order]
    new = np.concatenate((np.ones(1, dtype=np.bool_), ids[1:] != ids[:-1]))[: len(ids)]
    first = np.empty_like(order)
    first[order] = order[np.maximum.accumulate(np.where(new, place, 0))]
    if not len(detections):
        return tracks
    return replace(
        tracks,
        bottom_m=detections.bottom_m[nearest[last]],
        height_m=detections.height_m[nearest[last]],
        kind=detections.kind[nearest[first]],
    )


def _nearest(tracks: Objects, detections: Objects, frame_count: int) -> IntArray:
    """(K,) row of the detection nearest to each track in its frame, -1 in a frame without detections."""
    nearest = np.full(len(tracks), -1, dtype=np.int64)
    track_rows, detection_rows = tracks.frame_rows(frame_count), detections.frame_rows(frame_count)
    for at, seen in zip(track_rows, detection_rows, strict=True):
        if at.start == at.stop or seen.start == seen.stop:
            continue
        offset = tracks.center_m[at, None] - detections.center_m[None, seen]
        distance = np.einsum("ijk,ijk->ij", offset, offset)
        distance[tracks.category[at, None] != detections.category[None, seen]] += _FAR_M**2
        nearest[at] = seen.start + distance.argmin(axis=1)
    return nearest
