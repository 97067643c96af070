"""A tracker of the user's own in place of `smartmot.Tracker`: what it must do, and what it returns."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from smartmot.errors import PluginError
from smartmot.plugins import called, name_of, require
from smartmot.tracking.tracker import ScoreLimits, Tracker
from smartmot.types import CATEGORIES, Boxes, Detections, Tracks

DYNAMIC_MPS = 0.5
"""A faster track is dynamic unless the tracker says otherwise. Source: paper, with the map."""


class ObjectTracker(Protocol):
    """What a tracker of one's own must do. `smartmot.Tracker` does it as well.

    It may have a number `score_threshold`: then detections under it are counted as dropped, and a detector of
    which none reaches it is an error instead of a run in which nobody is seen.
    """

    def update(self, detections: Detections, /) -> Tracks:
        """Process one frame and remember what it needs for the next.

        Args:
            detections: The frame's detections, map frame; those that the monitored area keeps.

        Returns:
            The tracks at the frame's time, map frame, whose identifiers are unique; see
            `tracks_from_arrays`.
        """
        ...


def tracks_from_arrays(
    stamp_s: float,
    track_id: ArrayLike,
    center_m: ArrayLike,
    size_m: ArrayLike,
    yaw_rad: ArrayLike,
    category: ArrayLike,
    velocity_mps: ArrayLike,
    *,
    score: ArrayLike | None = None,
    yaw_rate_radps: ArrayLike | None = None,
    age_s: ArrayLike | None = None,
    coasted_s: ArrayLike | None = None,
    confirmed: ArrayLike | None = None,
    dynamic: ArrayLike | None = None,
    existence: ArrayLike | None = None,
) -> Tracks:
    """Tracks out of what a tracker estimates; what most trackers do not know may be left out.

    Args:
        stamp_s: Time of the estimate, that of the detections.
        track_id: (M,) whole numbers, each once.
        center_m: (M, 2) box centres, map frame.
        size_m: (M, 2) lengths and widths.
        yaw_rad: (M,) headings.
        category: (M,) names out of `smartmot.types.CATEGORIES`.
        velocity_mps: (M, 2) velocities over ground, map frame.
        score: (M,) scores of the last detections; 1 when not given.
        yaw_rate_radps: (M,) turn rates; 0 when not given: forecasts are straight.
        age_s: (M,) time since birth; infinite when not given. A track without a detection since then shows no
            velocity yet: where it stands, the ego neither brakes for it nor adapts its speed to it.
        coasted_s: (M,) time since the last detection; 0 when not given.
        confirmed: (M,) only confirmed tracks raise a flag; all of them when not given.
        dynamic: (M,) only dynamic tracks are forecast; those over `DYNAMIC_MPS` when not given.
        existence: (M,) probability that there is an object; not told when not given.

    Returns:
        The tracks, with an empty filter state.

    Raises:
        ShapeError: The arrays do not have one row per track, or a value is impossible; see `Tracks`.
        StampError: The stamp is no finite number, or not in seconds.
    """
    boxes = Boxes(np.asarray(center_m), np.asarray(size_m), np.asarray(yaw_rad))
    m = len(boxes)
    velocity = np.array(velocity_mps, dtype=np.float64).reshape(-1, 2)

    def column(values: ArrayLike | None, default: float) -> ArrayLike:
        return np.full(m, default) if values is None else values

    moves = np.hypot(velocity[:, 0], velocity[:, 1]) > DYNAMIC_MPS if dynamic is None else dynamic
    return Tracks(
        stamp_s=stamp_s,
        track_id=np.asarray(track_id),
        boxes=boxes,
        category=np.asarray(category),
        score=np.asarray(column(score, 1.0)),
        mean=np.zeros((m, 0)),
        covariance=np.zeros((m, 0, 0)),
        velocity_mps=velocity,
        yaw_rate_radps=np.asarray(column(yaw_rate_radps, 0.0)),
        age_s=np.asarray(column(age_s, math.inf)),
        coasted_s=np.asarray(column(coasted_s, 0.0)),
        confirmed=np.ones(m, dtype=np.bool_) if confirmed is None else np.asarray(confirmed),
        dynamic=np.asarray(moves),
        existence=None if existence is None else np.asarray(existence),
    )


def own(make: Callable[[], ObjectTracker]) -> ObjectTracker:
    """A new tracker of the user's.

    Args:
        make: What makes it.

    Raises:
        PluginError: It fails, or makes something that is no tracker.
    """
    return require(make(), "update", str(getattr(make, "name", make)))


def limits_of_own(tracker: object) -> ScoreLimits | None:
    """Scores that a tracker of the user's asks for; None: it tells none.

    Raises:
        PluginError: its `score_threshold` is no number in [0, 1].
    """
    if isinstance(tracker, Tracker):
        return tracker.score_limits
    threshold = getattr(tracker, "score_threshold", None)
    if threshold is None:
        return None
    if not isinstance(threshold, (int, float)) or not 0.0 <= threshold <= 1.0:
        raise PluginError(
            f"{name_of('tracker', tracker)}: score_threshold must be a number in [0, 1], got {threshold!r}"
        )
    least = np.full(len(CATEGORIES), float(threshold))
    return ScoreLimits(least, least)


def update_own(tracker: ObjectTracker, detections: Detections) -> Tracks:
    """One frame of a user's tracker, with its errors named and its tracks checked.

    Args:
        tracker: Any object with `update`.
        detections: The frame.

    Raises:
        PluginError: The tracker fails, or returns something else than tracks of the frame's time.
    """
    name = f"{name_of('tracker', tracker)}, frame at {detections.stamp_s:g} s"
    tracks = called(name, tracker.update, detections)
    if not isinstance(tracks, Tracks):
        raise PluginError(
            f"{name}: update() returned {type(tracks).__name__}; return smartmot.Tracks, "
            "for example from smartmot.tracks_from_arrays"
        )
    if abs(tracks.stamp_s - detections.stamp_s) > 1e-9:
        raise PluginError(f"{name}: the tracks are of {tracks.stamp_s:g} s; give the frame's time")
    return tracks
