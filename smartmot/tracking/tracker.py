"""The tracker: predict, associate, update, life cycle; one call per frame.

`Tracker.step` is a function of state and detections. `Tracker.update` keeps the state for callers that do not
want to. Everything is estimated in the frame of the detections. In the map frame the ego vehicle's own motion
never enters a velocity; detections in the vehicle's frame work too, with velocities relative to it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smartmot.detection_input import detections_from_arrays
from smartmot.errors import ConfigError, ShapeError, TimeOrderError
from smartmot.filters.box_filter import box_filter
from smartmot.filters.kalman import Estimate, measurements
from smartmot.filters.motion_models import Setting, X, table
from smartmot.geometry import wrap_angle
from smartmot.tracking.association import Affinity, Associator
from smartmot.tracking.lifecycle import LONGEST_GAP_S, Lifecycle
from smartmot.tracking.settings import CODES, ReportConfig, ScoreLimits, TrackerConfig
from smartmot.tracking.state import (
    BIRTH_S,
    CODE,
    COLUMNS,
    CONFIRMED,
    HITS,
    ID,
    INSIDE_S,
    MATCHED_S,
    SCORE,
    SCORE_SUM,
    TrackerState,
)
from smartmot.types import (
    CATEGORIES,
    BoolArray,
    Boxes,
    Detections,
    FloatArray,
    IntArray,
    StrArray,
    Tracks,
    unchecked,
)

__all__ = [
    "Monitored",
    "ReportConfig",
    "ScoreLimits",
    "Tracker",
    "TrackerConfig",
    "TrackerState",
    "box_filter",
]

Monitored = Callable[[Boxes, StrArray], BoolArray]
"""Which objects are monitored: M boxes in the map frame and (M,) categories to (M,) flags."""

_NAMES = np.array(CATEGORIES)
_UNKNOWN = CODES["unknown"]
_COASTED = -1
"""In place of a detection's position: the track had none in this frame."""

_NONE = np.zeros(0, dtype=np.int64)


@dataclass(slots=True, eq=False)
class _Measured:
    """The frame's detections over the score threshold, as the filter takes them: N rows each."""

    stamp_s: float
    boxes: Boxes
    score: FloatArray
    code: IntArray
    measurement: FloatArray
    velocity_mps: FloatArray | None


@dataclass(slots=True, eq=False)
class _Frame:
    """M tracks while a frame is worked on: rows and filter states, and the detection each track has.

    `coasting` says whether a track is without detection, `all_confirmed` whether none is tentative, `born`
    counts the tracks of this frame. Most frames bring no births, and in many nothing coasts: what that rules
    out is not computed. `estimate` is what the corrected filter states say, if somebody has asked.
    """

    rows: FloatArray
    filtered: FloatArray
    code: IntArray
    source: IntArray
    coasting: bool = True
    all_confirmed: bool = False
    born: int = 0
    estimate: Estimate | None = None


class Tracker:
    """Multi-object tracker on bird's-eye-view boxes.

    Args:
        config: Settings; the defaults suit 5 to 20 Hz.
        affinity: How well a predicted track and a detection go together, in place of the configured cost.

    Raises:
        ConfigError: `config` is no `TrackerConfig`.

    Attributes:
        config: The settings.
        state: All that is remembered; assign a saved one to go on from it.
        rejected: Impossible detections that `update_arrays` has dropped so far.
        score_limits: Scores that it asks for.
    """

    def __init__(self, config: TrackerConfig | None = None, affinity: Affinity | None = None) -> None:
        if not isinstance(config, TrackerConfig | None):
            raise ConfigError(
                f"Tracker: expected a TrackerConfig, got {config!r}; smartmot.tracker_config has named ones"
            )
        self.config = TrackerConfig() if config is None else config
        self.state = TrackerState.empty()
        self.rejected = 0
        config = self.config
        self._filter = box_filter(config.motion, config.filter)
        self._associator = Associator(
            config.association, config.filter.measurement_variance()[:, X], affinity
        )
        self._lifecycle = Lifecycle(config.lifecycle)
        self._yaw_entry = self._filter.names.index("yaw_rad")
        self._nothing = _no_tracks(len(self._filter.names))
        self._score = _unless_zero(config.score_threshold)
        self._first_stage = table(config.second_stage_score)
        self._two_stages = bool(self._first_stage.any())
        self._birth = np.maximum(table(config.lifecycle.birth_score), self._first_stage)
        self._outlier = table(config.outlier_speed_mps)
        self._dynamic = table(config.dynamic_speed_mps)
        report = config.report
        self._shown_coasted = None if report.coasted_s is None else table(report.coasted_s) + 1e-6
        self._shown_score = _unless_zero(report.score)
        self._shown_mean_score = _unless_zero(report.mean_score)
        self.score_limits = config.score_limits()

    def reset(self) -> None:
        """Forget all tracks; identifiers start at 1 again."""
        self.state = TrackerState.empty()
        self.rejected = 0

    def update(self, detections: Detections, monitored: Monitored | None = None) -> Tracks:
        """Process one frame and keep the state.

        Args:
            detections: The frame's detections, map frame.
            monitored: The monitored area; None when everything is monitored.

        Returns:
            The tracks that `TrackerConfig.report` chooses, oldest first; by default all that are alive.

        Raises:
            TimeOrderError: The frame is not newer than the one before.
            ShapeError: `detections` are no `Detections`, or `monitored` does not return one flag per object.
        """
        if not isinstance(detections, Detections):
            raise ShapeError(
                f"Tracker.update: expected smartmot.Detections, got {type(detections).__name__}; "
                "plain arrays go to update_arrays"
            )
        self.state, tracks = self.step(self.state, detections, monitored)
        return tracks

    def update_arrays(
        self,
        stamp_s: float,
        center_m: ArrayLike,
        size_m: ArrayLike,
        yaw_rad: ArrayLike,
        score: ArrayLike | None = None,
        category: ArrayLike | None = None,
        velocity_mps: ArrayLike | None = None,
    ) -> Tracks:
        """Process one frame given as arrays; impossible detections are dropped and counted in `rejected`.

        Args:
            stamp_s: Measurement time.
            center_m: (N, 2) centres.
            size_m: (N, 2) lengths and widths.
            yaw_rad: (N,) headings.
            score: (N,) confidences in [0, 1]; 1 when not given.
            category: (N,) names; "unknown" when not given.
            velocity_mps: (N, 2) measured velocities, NaN where there is none.

        Returns:
            As `update`.

        Raises:
            TimeOrderError: The frame is not newer than the one before.
            ShapeError: The arrays do not have one row per detection.
        """
        detections, rejected = detections_from_arrays(
            stamp_s, center_m, size_m, yaw_rad, score, category, velocity_mps
        )
        tracks = self.update(detections)
        self.rejected += rejected
        return tracks

    def step(
        self, state: TrackerState, detections: Detections, monitored: Monitored | None = None
    ) -> tuple[TrackerState, Tracks]:
        """Process one frame: a function of its arguments and the configuration.

        Args:
            state: What is known so far.
            detections: The frame's detections, map frame.
            monitored: The monitored area; None when everything is monitored.

        Returns:
            The new state and the tracks that `TrackerConfig.report` chooses, oldest first; by default all
            that are alive.

        Raises:
            TimeOrderError: The frame is not newer than the one before.
            ShapeError: `monitored` does not return one flag per object.
            ConfigError: The state comes from a tracker with another motion model.
        """
        measured = self._measured(detections)
        dt_s = _elapsed_s(state.stamp_s, measured.stamp_s)
        if len(state) == 0 and len(measured.score) == 0:
            nothing = unchecked(TrackerState, measured.stamp_s, state.next_id, state.rows, state.filtered)
            return nothing, unchecked(Tracks, measured.stamp_s, *self._nothing)
        frame = self._predicted(state, dt_s)
        unmatched = self._correct(frame, measured, dt_s)
        if len(unmatched):
            self._start(frame, measured, unmatched)
        self._live(frame, measured.stamp_s, monitored)
        if frame.born:
            # Newborn tracks stand at the end; some may have died at once, outside the monitored area.
            frame.rows[len(frame.rows) - frame.born :, ID] = np.arange(
                state.next_id, state.next_id + frame.born
            )
        after = unchecked(
            TrackerState, measured.stamp_s, state.next_id + frame.born, frame.rows, frame.filtered
        )
        return after, self._report(frame, measured)

    def _measured(self, detections: Detections) -> _Measured:
        """Detections over the score threshold."""
        # counting and taking cost a fraction of any(), all() and index arrays, which add up in small frames
        code = np.array([CODES[name] for name in detections.category.tolist()], dtype=np.int64)
        boxes, score, velocity = detections.boxes, detections.score, detections.velocity_mps
        if self._score is not None:
            sure = score >= self._score.take(code)
            if np.count_nonzero(sure) < len(score):
                boxes, score, code = boxes[sure], score[sure], code[sure]
                velocity = None if velocity is None else velocity[sure]
        return _Measured(detections.stamp_s, boxes, score, code, measurements(boxes), velocity)

    def _predicted(self, state: TrackerState, dt_s: float) -> _Frame:
        """Tracks carried over the time step, without those that a pause in the recording ended."""
        rows, filtered = state.rows.copy(), state.filtered
        code = rows[:, CODE].astype(np.int64)
        if dt_s > LONGEST_GAP_S:
            bridged = self._lifecycle.bridges(dt_s, code)
            rows, filtered, code = rows[bridged], filtered[bridged], code[bridged]
        source = np.empty(len(rows), dtype=np.int64)
        source.fill(_COASTED)
        if len(rows) == 0:
            return _Frame(rows, np.zeros((0, self._filter.width)), code, source)
        if filtered.shape[1] != self._filter.width:
            raise ConfigError(
                f"tracker state: {filtered.shape[1]} filter entries per track, this tracker's motion "
                f"model has {self._filter.width}; resume with the configuration that made the state"
            )
        return _Frame(rows, self._filter.predict(filtered, code, dt_s), code, source)

    def _correct(self, frame: _Frame, measured: _Measured, dt_s: float) -> IntArray:
        """Match and correct the tracks in place; the detections left over."""
        n = len(measured.score)
        if n == 0 or len(frame.rows) == 0:
            return np.arange(n)
        first = None
        if self._two_stages:
            first = measured.score >= self._first_stage.take(measured.code)
            first = None if np.count_nonzero(first) == n else first
        track, detection = self._associator.match(
            self._filter.estimate(frame.filtered),
            frame.code,
            self._filter.position_covariance(frame.filtered),
            measured.boxes,
            measured.code,
            dt_s,
            first,
        )
        if len(track) == 0:
            return np.arange(n)
        velocity = None if measured.velocity_mps is None else measured.velocity_mps[detection]
        rows, code, score = frame.rows, frame.code.take(track), measured.score.take(detection)
        measurement = measured.measurement.take(detection, axis=0)
        frame.coasting = len(track) < len(rows)
        # Tracks come in order: where all are matched, nothing has to be taken out and put back.
        matched = rows.take(track, axis=0) if frame.coasting else rows
        if not frame.coasting:
            frame.filtered = self._filter.update(frame.filtered, measurement, velocity, code)
            frame.source = detection
        else:
            frame.filtered[track] = self._filter.update(
                frame.filtered.take(track, axis=0), measurement, velocity, code
            )
            frame.source[track] = detection
        matched[:, SCORE] = score
        score_sum, hits = matched[:, SCORE_SUM], matched[:, HITS]
        score_sum += score
        hits += 1.0
        matched[:, MATCHED_S] = measured.stamp_s
        if frame.coasting:
            rows[track] = matched
        unknown = code == _UNKNOWN
        if np.count_nonzero(unknown):
            # An unknown track learns its category from the first detection that knows it.
            frame.code[track[unknown]] = measured.code[detection[unknown]]
            rows[:, CODE] = frame.code
        if len(track) == n:
            return _NONE
        left = np.ones(n, dtype=np.bool_)
        left[detection] = False
        return left.nonzero()[0]

    def _start(self, frame: _Frame, measured: _Measured, new: IntArray) -> None:
        """Append a track for every unmatched detection, without identifier and never inside so far."""
        if self._birth.any():
            new = new[measured.score[new] >= self._birth[measured.code[new]]]
        n = frame.born = len(new)
        if n == 0:
            return
        rows = np.zeros((n, len(COLUMNS)))
        code, score = measured.code[new], measured.score[new]
        velocity = None if measured.velocity_mps is None else measured.velocity_mps[new]
        rows[:, CODE] = code
        rows[:, SCORE] = rows[:, SCORE_SUM] = score
        rows[:, HITS] = 1.0
        rows[:, BIRTH_S] = rows[:, MATCHED_S] = measured.stamp_s
        rows[:, INSIDE_S] = -np.inf
        born = self._filter.born(measured.measurement[new], velocity, code)
        frame.rows = np.concatenate((frame.rows, rows))
        frame.filtered = np.concatenate((frame.filtered, born))
        frame.code = np.concatenate((frame.code, code))
        frame.source = np.concatenate((frame.source, new))

    def _live(self, frame: _Frame, now_s: float, monitored: Monitored | None) -> None:
        """Confirm tracks and drop dead ones, in place."""
        rows, code = frame.rows, frame.code
        inside_all = monitored is None
        if monitored is None:
            rows[:, INSIDE_S] = now_s
        else:
            inside = self._inside(frame, monitored)
            rows[inside, INSIDE_S] = now_s
            inside_all = np.count_nonzero(inside) == len(rows)
        confirmed = rows[:, CONFIRMED] > 0.0
        frame.all_confirmed = np.count_nonzero(confirmed) == len(rows)
        may_die = frame.coasting or not inside_all
        if frame.all_confirmed and not may_die:
            return
        coasted_s = now_s - rows[:, MATCHED_S]
        if not frame.all_confirmed:
            confirmed = self._lifecycle.confirm(confirmed, now_s - rows[:, BIRTH_S], coasted_s, code)
            rows[:, CONFIRMED] = confirmed
            frame.all_confirmed = np.count_nonzero(confirmed) == len(rows)
        if not may_die:
            return
        outside_s = None if inside_all else now_s - rows[:, INSIDE_S]
        alive = self._lifecycle.survives(
            None if frame.all_confirmed else confirmed, coasted_s, outside_s, code
        )
        if np.count_nonzero(alive) == len(rows):
            return
        if frame.born:
            frame.born = int(np.count_nonzero(alive[-frame.born :]))
        left = alive.nonzero()[0]
        frame.rows, frame.filtered = rows.take(left, axis=0), frame.filtered.take(left, axis=0)
        frame.code, frame.source = code.take(left), frame.source.take(left)
        frame.estimate = None

    def _inside(self, frame: _Frame, monitored: Monitored) -> BoolArray:
        """(M,) which tracks the monitored area takes."""
        estimate = frame.estimate = self._filter.estimate(frame.filtered)
        boxes = unchecked(Boxes, estimate.center_m, estimate.size_m, wrap_angle(estimate.yaw_rad))
        inside = np.asarray(monitored(boxes, _NAMES[frame.code]), dtype=np.bool_)
        if inside.shape != (len(frame.rows),):
            raise ShapeError(f"monitored: expected {(len(frame.rows),)} flags, got {inside.shape}")
        return inside

    def _shown(self, frame: _Frame, now_s: float) -> IntArray | None:
        """(K,) the tracks that the configuration wants to see; None: all."""
        rows, code = frame.rows, frame.code
        conditions: list[BoolArray] = []
        if not (self.config.report.tentative or frame.all_confirmed):
            conditions.append(rows[:, CONFIRMED] > 0.0)
        if self._shown_coasted is not None and frame.coasting:
            conditions.append(now_s - rows[:, MATCHED_S] <= self._shown_coasted.take(code))
        if self._shown_score is not None:
            conditions.append(rows[:, SCORE] >= self._shown_score.take(code))
        if self._shown_mean_score is not None:
            conditions.append(rows[:, SCORE_SUM] >= self._shown_mean_score.take(code) * rows[:, HITS])
        if not conditions:
            return None
        shown = conditions[0]
        for condition in conditions[1:]:
            shown &= condition
        return None if np.count_nonzero(shown) == len(rows) else shown.nonzero()[0]

    def _report(self, frame: _Frame, measured: _Measured) -> Tracks:
        """What the tracks say at the frame's time."""
        config, now_s = self.config, measured.stamp_s
        rows, filtered, code = frame.rows, frame.filtered, frame.code
        shown, estimate = self._shown(frame, now_s), frame.estimate
        if shown is not None:
            rows, filtered, code = rows.take(shown, axis=0), filtered.take(shown, axis=0), code.take(shown)
        if shown is not None or estimate is None:
            estimate = self._filter.estimate(filtered)
        mean, covariance = self._filter.moments(filtered)
        velocity = estimate.velocity_mps
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        threshold = self._dynamic.take(code)
        if config.dynamic_sigmas > 0.0:
            sigma = np.sqrt(self._filter.speed_variance(filtered))
            sigma *= config.dynamic_sigmas
            np.maximum(threshold, sigma, out=threshold)
        dynamic = speed > threshold
        outlier = speed > self._outlier.take(code)
        if np.count_nonzero(outlier):
            velocity = np.where(outlier[:, None], 0.0, velocity)
            dynamic &= ~outlier
        center, size, yaw = estimate.center_m, estimate.size_m, wrap_angle(estimate.yaw_rad)
        mean[:, self._yaw_entry] = yaw
        if config.report.detected_boxes:
            center, size = center.copy(), size.copy()
            source = frame.source if shown is None else frame.source.take(shown)
            seen = np.flatnonzero(source != _COASTED)
            boxes = measured.boxes[source[seen]]
            center[seen], size[seen], yaw[seen] = boxes.center_m, boxes.size_m, boxes.yaw_rad
        return unchecked(
            Tracks,
            now_s,
            rows[:, ID].astype(np.int64),
            unchecked(Boxes, center, size, yaw),
            _NAMES.take(code),
            rows[:, SCORE],
            mean,
            covariance,
            velocity,
            estimate.yaw_rate_radps,
            now_s - rows[:, BIRTH_S],
            now_s - rows[:, MATCHED_S],
            rows[:, CONFIRMED] > 0.0,
            dynamic,
        )


def _no_tracks(entries: int) -> tuple[object, ...]:
    """Values of `Tracks` after the stamp, without any track, for D entries of the filter's mean."""
    none, ids, flags = np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_)
    mean, covariance = np.zeros((0, entries)), np.zeros((0, entries, entries))
    velocity, names = np.zeros((0, 2)), _NAMES[:0]
    return (ids, Boxes.empty(), names, none, mean, covariance, velocity, none, none, none, flags, flags)


def _unless_zero(setting: Setting) -> FloatArray | None:
    """(C,) values of a threshold; None where it lets everything pass."""
    values = table(setting)
    return values if values.any() else None


def _elapsed_s(last_s: float | None, now_s: float) -> float:
    """Time since the last frame; 0 at the first.

    Raises:
        TimeOrderError: The new stamp is not later than the last.
    """
    if last_s is None:
        return 0.0
    if not last_s < now_s:
        raise TimeOrderError(f"frame at {now_s!r} s is not newer than the last one at {last_s!r} s")
    return now_s - last_s
