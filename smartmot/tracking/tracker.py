"""The tracker: predict, associate, update, life cycle; one call per frame.

`Tracker.step` is a function of state and detections. `Tracker.update` keeps the state for callers that do not
want to. Everything is estimated in the frame of the detections. In the map frame the ego vehicle's own motion
never enters a velocity; detections in the vehicle's frame work too, with velocities relative to it.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from smartmot.detection_input import Refusals, detections_from_arrays
from smartmot.errors import ConfigError, ShapeError, TimeOrderError
from smartmot.filters.box_filter import box_filter
from smartmot.filters.existence import Existence
from smartmot.filters.kalman import measurements
from smartmot.filters.motion_models import YAW, X, table
from smartmot.geometry import wrap_angle
from smartmot.tracking.association import Affinity, Associator
from smartmot.tracking.evidence import UNIT, Evidence
from smartmot.tracking.frame import COASTED, Frame, Measured, limits_of, scaled
from smartmot.tracking.lifecycle import LONGEST_GAP_S, REST_MPS, REST_SEEN_S, Lifecycle
from smartmot.tracking.recovery import NEW, TAKEN, Recovery, repeats
from smartmot.tracking.report import Reporter
from smartmot.tracking.scores import ScoreScale
from smartmot.tracking.settings import CODES, ReportConfig, ScoreLimits, TrackerConfig, codes
from smartmot.tracking.state import (
    BIRTH_S,
    CODE,
    COLUMNS,
    CONFIRMED,
    EVIDENCE,
    EXISTENCE,
    FRONT,
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
_NONE = np.zeros(0, dtype=np.int64)


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
        self.rejected, self._refusals = 0, Refusals()
        config = self.config
        self._filter = box_filter(config.motion, config.filter)
        variance_m2 = config.filter.measurement_variance()[:, X]
        self._associator = Associator(config.association, variance_m2, affinity)
        known = config.existence
        self._existence = None if known is None else Existence(known, variance_m2)
        self._lifecycle = Lifecycle(config.lifecycle)
        self._reporter = Reporter(config, self._filter)
        reference = config.score_reference
        self._unscaled = limits_of(config)
        self._limits = scaled(self._unscaled, table(1.0 if reference is None else reference))
        hidden = config.association.hidden_gate_m
        self._recovery = None if hidden is None else Recovery(hidden, self._filter, self._associator)
        memory_s = config.evidence_memory_s
        by_evidence = config.filter.heading == "evidence"
        self._evidence = None if memory_s is None else Evidence(memory_s, by_evidence, self._filter)
        self.score_limits = config.score_limits()

    def reset(self) -> None:
        """Forget all tracks; identifiers start at 1 again."""
        self.state = TrackerState.empty()
        self.rejected, self._refusals = 0, Refusals()

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
        pose_covariance: ArrayLike | None = None,
    ) -> Tracks:
        """Process one frame given as arrays; impossible detections are dropped and counted in `rejected`.

        Where all of the first ones are, a warning says why.

        Args:
            stamp_s: Measurement time.
            center_m: (N, 2) centres.
            size_m: (N, 2) lengths and widths.
            yaw_rad: (N,) headings.
            score: (N,) confidences in [0, 1]; 1 when not given.
            category: (N,) names; "unknown" when not given.
            velocity_mps: (N, 2) measured velocities, NaN where there is none.
            pose_covariance: (N, 3, 3) noise of x, y and yaw, or (N, 2, 2) of x and y; NaN where nothing is
                stated.

        Returns:
            As `update`.

        Raises:
            TimeOrderError: The frame is not newer than the one before.
            ShapeError: The arrays do not have one row per detection.
        """
        detections, rejected = detections_from_arrays(
            stamp_s, center_m, size_m, yaw_rad, score, category, velocity_mps, pose_covariance
        )
        tracks = self.update(detections)
        self.rejected += rejected
        self._refusals.see(detections)
        return tracks

    def step(
        self,
        state: TrackerState,
        detections: Detections,
        monitored: Monitored | None = None,
        together: bool = False,
        trust: float = 1.0,
    ) -> tuple[TrackerState, Tracks]:
        """Process one frame: a function of its arguments and the configuration.

        Args:
            state: What is known so far.
            detections: The frame's detections, map frame.
            monitored: The monitored area; None when everything is monitored.
            together: Whether the frame may have the time of the one before, being another detector's.
            trust: What scores were multiplied by, the trust in the detector: over 0, at most 1. Its scores
                count for so much less in the mean of a track's scores.

        Returns:
            The new state and the tracks that `TrackerConfig.report` chooses, oldest first; by default all
            that are alive.

        Raises:
            TimeOrderError: The frame is not newer than the one before.
            ShapeError: `monitored` does not return one flag per object.
            ConfigError: The state comes from a tracker with another motion model.
        """
        dt_s = 0.0
        if not (together and state.stamp_s == detections.stamp_s):
            dt_s = _elapsed_s(state.stamp_s, detections.stamp_s)
        if not len(state.rows) and not len(detections.score):
            return self._nothing(state, detections.stamp_s, state.scores)
        measured = self._measured(detections, state.scores)
        measured.trust = trust
        if not len(state.rows) and not len(measured.score):
            return self._nothing(state, detections.stamp_s, measured.scores)
        frame = self._predicted(state, dt_s)
        if measured.shares_noise:
            frame.filtered = self._filter.widened(frame.filtered)
        unmatched = self._correct(frame, measured, dt_s)
        if self._existence is not None and len(frame.rows):
            rows = frame.rows
            if frame.found is not None and not frame.coasting:
                ratio = frame.found[1]
            else:
                ratio = self._existence.missed(frame.code)
                if frame.found is not None:
                    ratio[frame.found[0]] = frame.found[1]
            rows[:, EXISTENCE] = self._existence.after(rows[:, EXISTENCE], ratio, frame.code, dt_s)
        if len(unmatched):
            self._start(frame, measured, unmatched)
        self._live(frame, measured.stamp_s, monitored)
        if frame.born:
            # Newborn tracks stand at the end; some may have died at once, outside the monitored area.
            frame.rows[len(frame.rows) - frame.born :, ID] = np.arange(
                state.next_id, state.next_id + frame.born
            )
        after = unchecked(
            TrackerState,
            measured.stamp_s,
            state.next_id + frame.born,
            frame.rows,
            frame.filtered,
            measured.scores,
            state.merged + frame.merged,
        )
        return after, self._reporter.report(frame, measured)

    def _nothing(
        self, state: TrackerState, stamp_s: float, scores: ScoreScale | None
    ) -> tuple[TrackerState, Tracks]:
        """A frame without tracks and detections."""
        if scores is None and self.config.score_reference is None:
            scores = ScoreScale.empty()
        after = unchecked(
            TrackerState, stamp_s, state.next_id, state.rows, state.filtered, scores, state.merged
        )
        return after, self._reporter.nothing(stamp_s)

    def _measured(self, detections: Detections, scores: ScoreScale | None) -> Measured:
        """Detections over the score threshold, and the thresholds of the frame."""
        # counting and taking cost a fraction of any(), all() and index arrays, which add up in small frames
        code = codes(detections.category)
        boxes, score, velocity = detections.boxes, detections.score, detections.velocity_mps
        noise = detections.pose_covariance
        limits = self._limits
        if self.config.score_reference is None:
            scores = (ScoreScale.empty() if scores is None else scores).after(detections.stamp_s, code, score)
            if scores.reference is not limits.reference:
                # kept for the next frames; a function of the reference, so nothing is remembered by it
                limits = self._limits = scaled(self._unscaled, scores.reference)
        if limits.drop is not None:
            sure = score >= limits.drop.take(code)
            if np.count_nonzero(sure) < len(score):
                boxes, score, code = boxes[sure], score[sure], code[sure]
                velocity = None if velocity is None else velocity[sure]
                noise = None if noise is None else noise[sure]
        return Measured(
            detections.stamp_s, boxes, score, code, measurements(boxes), velocity, limits, scores, noise
        )

    def _predicted(self, state: TrackerState, dt_s: float) -> Frame:
        """Tracks carried over the time step, without those that a pause in the recording ended."""
        rows, filtered = state.rows.copy(), state.filtered
        code = rows[:, CODE].astype(np.int64)
        if dt_s > LONGEST_GAP_S:
            bridged = self._lifecycle.bridges(dt_s, code)
            rows, filtered, code = rows[bridged], filtered[bridged], code[bridged]
        source = np.empty(len(rows), dtype=np.int64)
        source.fill(COASTED)
        if len(rows) == 0:
            return Frame(rows, np.zeros((0, self._filter.widths[0])), code, source)
        if filtered.shape[1] not in self._filter.widths:
            raise ConfigError(
                f"tracker state: {filtered.shape[1]} filter entries per track, this tracker's motion "
                f"model has {self._filter.widths[0]}; resume with the configuration that made the state"
            )
        return Frame(rows, self._filter.predict(filtered, code, dt_s), code, source)

    def _correct(self, frame: Frame, measured: Measured, dt_s: float) -> IntArray:
        """Match and correct the tracks in place; the detections left over."""
        n = len(measured.score)
        if n == 0 or len(frame.rows) == 0:
            return np.arange(n)
        first = None
        if measured.limits.first is not None:
            first = measured.score >= measured.limits.first.take(measured.code)
            first = None if np.count_nonzero(first) == n else first
        predicted = self._filter.estimate(frame.filtered)
        overdue = None
        if self._lifecycle.knows_rest:
            # what lives on only because it was at rest is found where it stood
            before_s = measured.stamp_s - dt_s
            if np.count_nonzero(frame.rows[:, MATCHED_S] < before_s - self._lifecycle.least_max_age_s):
                overdue = self._lifecycle.overdue(before_s - frame.rows[:, MATCHED_S], frame.code)
                overdue = overdue if np.count_nonzero(overdue) else None
        covariance = self._filter.position_covariance(frame.filtered)
        track, detection = self._associator.match(
            predicted,
            frame.code,
            covariance,
            measured.boxes,
            measured.code,
            dt_s,
            first,
            overdue,
            measured.pose_covariance,
        )
        anew = _NONE
        if self._recovery is not None and len(track) < min(n, len(frame.rows)):
            track, detection, anew = self._recovery.extended(
                frame, measured, predicted, track, detection, first, dt_s
            )
        if len(track) == 0:
            return np.arange(n)
        velocity, noise = measured.own(detection)
        rows, score = frame.rows, measured.score.take(detection)
        measurement = measured.measurement.take(detection, axis=0)
        frame.coasting = len(track) < len(rows)
        code = frame.code.take(track) if frame.coasting else frame.code
        if self._existence is not None:
            center = predicted.center_m
            if frame.coasting:
                center = center.take(track, axis=0)
                covariance = covariance[0].take(track), covariance[1].take(track), covariance[2].take(track)
            frame.found = track, self._existence.found(measurement[:, :2] - center, covariance, code, noise)
        # Tracks come in order: where all are matched, nothing has to be taken out and put back.
        matched = rows.take(track, axis=0) if frame.coasting else rows
        if not frame.coasting:
            frame.filtered = self._filter.update(frame.filtered, measurement, velocity, code, noise)
            frame.source = detection
        else:
            frame.filtered[track] = self._filter.update(
                frame.filtered.take(track, axis=0), measurement, velocity, code, noise
            )
            frame.source[track] = detection
        if len(anew):
            frame.filtered[anew] = self._born(frame, measured, frame.source[anew], frame.code[anew])
        if self._evidence is not None:
            detected = measured.code.take(detection)
            self._evidence.weigh(frame, matched, track, code, detected, measurement[:, YAW], score, dt_s)
        matched[:, SCORE] = score if measured.trust == 1.0 else score / measured.trust
        score_sum, hits = matched[:, SCORE_SUM], matched[:, HITS]
        score_sum += score
        hits += measured.trust
        matched[:, MATCHED_S] = measured.stamp_s
        if frame.coasting:
            rows[track] = matched
        unknown = None if self._evidence is not None else code == _UNKNOWN
        if unknown is not None and np.count_nonzero(unknown):
            # An unknown track learns its category from the first detection that knows it.
            frame.code[track[unknown]] = measured.code[detection[unknown]]
            rows[:, CODE] = frame.code
        if len(track) == n:
            return _NONE
        left = np.ones(n, dtype=np.bool_)
        left[detection] = False
        return left.nonzero()[0]

    def _start(self, frame: Frame, measured: Measured, new: IntArray) -> None:
        """Append a track for every unmatched detection, without identifier and never inside so far."""
        if measured.limits.birth is not None:
            sure = measured.score.take(new) >= measured.limits.birth.take(measured.code.take(new))
            new = new[sure] if np.count_nonzero(sure) < len(new) else new
        if self.config.merge_duplicates and len(new):
            # what neither has a track nor may start one repeats nothing and hides nothing
            state = np.zeros(len(measured.score), dtype=np.int64)
            state[frame.source[frame.source != COASTED]] = TAKEN
            state[new] = NEW
            repeated = repeats(measured.boxes, measured.code, measured.score, state)
            if repeated is not None:
                frame.merged = int(np.count_nonzero(repeated))
                state[repeated] = 0
                new = (state == NEW).nonzero()[0]
        n = frame.born = len(new)
        if n == 0:
            return
        rows = np.zeros((n, len(COLUMNS)))
        code, score = measured.code.take(new), measured.score.take(new)
        rows[:, CODE] = code
        rows[:, SCORE], rows[:, SCORE_SUM] = score / measured.trust, score
        rows[:, HITS] = measured.trust
        rows[:, BIRTH_S] = rows[:, MATCHED_S] = measured.stamp_s
        rows[:, INSIDE_S] = -np.inf
        rows[:, FRONT] = score
        rows[:, EXISTENCE] = np.nan if self._existence is None else self._existence.initial(code)
        evidence = UNIT.take(code, axis=0)
        evidence *= score[:, None]
        evidence[:, _UNKNOWN] = 0.0
        rows[:, EVIDENCE] = evidence
        frame.estimate = frame.speed_variance = None
        born = self._born(frame, measured, new, code)
        frame.rows = np.concatenate((frame.rows, rows))
        frame.filtered = np.concatenate((frame.filtered, born))
        frame.code = np.concatenate((frame.code, code))
        frame.source = np.concatenate((frame.source, new))

    def _born(self, frame: Frame, measured: Measured, detection: IntArray, code: IntArray) -> FloatArray:
        """(K, W) filter states from detections, as wide as the frame's."""
        velocity, noise = measured.own(detection)
        born = self._filter.born(measured.measurement.take(detection, axis=0), velocity, code, noise)
        return born if born.shape[1] == frame.filtered.shape[1] else self._filter.widened(born)

    def _live(self, frame: Frame, now_s: float, monitored: Monitored | None) -> None:
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
        if not may_die or (inside_all and self._lifecycle.all_young(coasted_s, frame.all_confirmed)):
            return
        outside_s = None if inside_all else now_s - rows[:, INSIDE_S]
        resting = None
        if self._lifecycle.knows_rest and frame.coasting:
            resting = self._at_rest(frame, confirmed, coasted_s)
        alive = self._lifecycle.survives(
            None if frame.all_confirmed else confirmed, coasted_s, outside_s, code, resting
        )
        if np.count_nonzero(alive) == len(rows):
            return
        if frame.born:
            frame.born = int(np.count_nonzero(alive[-frame.born :]))
        left = alive.nonzero()[0]
        frame.rows, frame.filtered = rows.take(left, axis=0), frame.filtered.take(left, axis=0)
        frame.code, frame.source = code.take(left), frame.source.take(left)
        frame.estimate = frame.speed_variance = None

    def _at_rest(self, frame: Frame, confirmed: BoolArray, coasted_s: FloatArray) -> BoolArray | None:
        """(M,) confirmed tracks that were at rest when last seen, among those that would die; None: none."""
        rows = frame.rows
        followed_s = rows[:, MATCHED_S] - rows[:, BIRTH_S]
        late = self._lifecycle.overdue(coasted_s, frame.code) & confirmed & (followed_s >= REST_SEEN_S)
        which = late.nonzero()[0]
        if len(which) == 0:
            return None
        velocity = self._filter.motion(frame.filtered[which])[1]
        late[which] = np.hypot(velocity[:, 0], velocity[:, 1]) < REST_MPS
        return late

    def _inside(self, frame: Frame, monitored: Monitored) -> BoolArray:
        """(M,) which tracks the monitored area takes."""
        estimate = frame.estimate = self._filter.estimate(frame.filtered)
        boxes = unchecked(Boxes, estimate.center_m, estimate.size_m, wrap_angle(estimate.yaw_rad))
        inside = np.asarray(monitored(boxes, _NAMES[frame.code]), dtype=np.bool_)
        if inside.shape != (len(frame.rows),):
            raise ShapeError(f"monitored: expected {(len(frame.rows),)} flags, got {inside.shape}")
        return inside


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
