"""The tracker: predict, associate, update, life cycle; one call per frame.

`Tracker.step` is a function of state and detections. `Tracker.update` keeps the state for callers that do not
want to. Everything is estimated in the map frame, so the ego vehicle's own motion never enters a velocity.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from smartmot.association import (
    Affinity,
    AssociationConfig,
    Matches,
    OverlapThenDistance,
    associate,
    gate_reach_m,
)
from smartmot.errors import ShapeError, TimeOrderError
from smartmot.kalman import (
    BevFilterConfig,
    boxes_of,
    initial_states,
    innovations,
    measurements,
    predict,
    update,
    valid_state,
)
from smartmot.lifecycle import LifecycleConfig, confirm, survives
from smartmot.motion_models import (
    STATE,
    VX,
    VY,
    YAW_RATE,
    ConstantVelocity,
    MotionModel,
    PerCategory,
    check_range,
)
from smartmot.types import CATEGORIES, BoolArray, Boxes, Detections, FloatArray, IntArray, StrArray, Tracks

Monitored = Callable[[Boxes, StrArray], BoolArray]
"""Which objects are monitored: M boxes in the map frame and (M,) categories to (M,) flags."""

_NAMES = np.array(CATEGORIES)
_CODES = {name: code for code, name in enumerate(CATEGORIES)}
_UNKNOWN = _CODES["unknown"]


@dataclass(frozen=True, slots=True)
class TrackerConfig:
    """All settings of the tracker.

    Args:
        motion: Motion model and its noise.
        filter: Measurement noise and initial uncertainty.
        association: Limits of a match.
        lifecycle: Times of confirmation and deletion.
        score_threshold: Detections below it are dropped. Source: paper, 0.3.
        dynamic_speed_mps: A faster track is dynamic. Source: paper, 0.5 with the map and 1.0 without.
        dynamic_sigmas: Besides, its speed must be this many standard deviations from zero, so that position
            noise does not set a standing object moving; 0 leaves the paper's plain threshold. At 2.5 noise
            passes in 4 % of the frames after birth and hardly ever once the track has settled.
        outlier_speed_mps: A faster estimate is rejected: the track counts as static with velocity 0 in that
            frame. Source: paper, 15 m/s, written for pedestrians and town traffic. Vehicles on the
            scenarios' motorways are faster, so theirs is 60 m/s.

    Raises:
        ConfigError: A value is outside its range.
    """

    motion: MotionModel = field(default_factory=ConstantVelocity)
    filter: BevFilterConfig = field(default_factory=BevFilterConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    lifecycle: LifecycleConfig = field(default_factory=LifecycleConfig)
    score_threshold: float = 0.3
    dynamic_speed_mps: float = 0.5
    dynamic_sigmas: float = 2.5
    outlier_speed_mps: PerCategory = field(
        default=PerCategory(60.0, pedestrian=15.0, cyclist=25.0, truck=60.0, motorcycle=60.0, unknown=60.0)
    )

    def __post_init__(self) -> None:
        check_range(self, "score_threshold", 0.0, 1.0)
        check_range(self, "dynamic_speed_mps", 0.0, 10.0)
        check_range(self, "dynamic_sigmas", 0.0, 10.0)

    @classmethod
    def paper(cls, *, with_map: bool = True) -> TrackerConfig:
        """The paper's filter noise, matching and thresholds, in physical units.

        Args:
            with_map: The dynamic threshold is 0.5 m/s with the map and 1.0 m/s without.
        """
        return cls(
            motion=ConstantVelocity.paper(),
            filter=BevFilterConfig.paper(),
            association=AssociationConfig(gate_probability=0.0),
            dynamic_speed_mps=0.5 if with_map else 1.0,
            dynamic_sigmas=0.0,
            outlier_speed_mps=PerCategory(*[15.0] * len(CATEGORIES)),
        )


@dataclass(frozen=True, slots=True, eq=False)
class TrackerState:
    """All that the tracker remembers between frames.

    Args:
        stamp_s: Time of the last frame; None before the first.
        next_id: Identifier of the next track.
        track_id: (M,) identifiers.
        category_code: (M,) positions in CATEGORIES.
        score: (M,) score of the last matched detection.
        mean: (M, 9) filter states at stamp_s.
        covariance: (M, 9, 9) their covariances.
        birth_s: (M,) time of birth.
        matched_s: (M,) time of the last match.
        inside_s: (M,) time the track was last inside the monitored area.
        confirmed: (M,) flags.
    """

    stamp_s: float | None
    next_id: int
    track_id: IntArray
    category_code: IntArray
    score: FloatArray
    mean: FloatArray
    covariance: FloatArray
    birth_s: FloatArray
    matched_s: FloatArray
    inside_s: FloatArray
    confirmed: BoolArray

    def __post_init__(self) -> None:
        m = len(self.track_id)
        for name in _PER_TRACK:
            array = getattr(self, name)
            if len(array) != m:
                raise ShapeError(f"{name}: expected {m} rows, one per track, got {len(array)}")
            array.flags.writeable = False

    def __len__(self) -> int:
        return len(self.track_id)

    def __getitem__(self, index: BoolArray) -> TrackerState:
        """Subset of the tracks by a mask."""
        return self._changed({name: getattr(self, name)[index] for name in _PER_TRACK})

    def with_tracks_of(self, other: TrackerState) -> TrackerState:
        """The same state with another one's tracks appended."""
        return self._changed(
            {name: np.concatenate((getattr(self, name), getattr(other, name))) for name in _PER_TRACK}
        )

    def _changed(self, arrays: dict[str, NDArray[Any]]) -> TrackerState:
        """The same state with other arrays."""
        changes: dict[str, Any] = arrays
        return replace(self, **changes)

    @classmethod
    def empty(cls) -> TrackerState:
        """Before the first frame."""
        none, codes, d = np.zeros(0), np.zeros(0, dtype=np.int64), len(STATE)
        return cls(
            None, 1, codes, codes, none, np.zeros((0, d)), np.zeros((0, d, d)), none, none, none, codes > 0
        )


_PER_TRACK = tuple(item.name for item in fields(TrackerState))[2:]


@dataclass(frozen=True, slots=True, eq=False)
class _Measured:
    """The frame's detections over the score threshold, as the filter takes them: N rows each."""

    stamp_s: float
    boxes: Boxes
    score: FloatArray
    category_code: IntArray
    measurement: FloatArray


class Tracker:
    """Multi-object tracker on bird's-eye-view boxes.

    Args:
        config: Settings; the defaults suit 5 to 20 Hz.
        affinity: How well a predicted track and a detection go together; IoU, then distance, by default.
    """

    def __init__(self, config: TrackerConfig | None = None, affinity: Affinity | None = None) -> None:
        self.config = TrackerConfig() if config is None else config
        self.state = TrackerState.empty()
        self._affinity = affinity or OverlapThenDistance(self.config.association.iou_threshold)
        self._noise = self.config.filter.measurement_noise()

    def reset(self) -> None:
        """Forget all tracks; identifiers start at 1 again."""
        self.state = TrackerState.empty()

    def update(self, detections: Detections, monitored: Monitored | None = None) -> Tracks:
        """Process one frame and keep the state.

        Args:
            detections: The frame's detections, map frame.
            monitored: The monitored area; None when everything is monitored.

        Returns:
            All tracks alive after the frame, oldest first, coasted ones included.

        Raises:
            TimeOrderError: The frame is not newer than the one before.
            ShapeError: `monitored` does not return one flag per object.
        """
        self.state, tracks = self.step(self.state, detections, monitored)
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
            The new state and all tracks alive after the frame, oldest first, coasted ones included.

        Raises:
            TimeOrderError: The frame is not newer than the one before.
            ShapeError: `monitored` does not return one flag per object.
        """
        measured = self._measured(detections)
        dt_s = _elapsed_s(state.stamp_s, measured.stamp_s)
        predicted = self._predict(state, dt_s)
        matches = self._associate(predicted, measured, dt_s)
        after = self._correct(predicted, measured, matches)
        if len(matches.unmatched_detections):
            after = after.with_tracks_of(self._candidates(measured, matches.unmatched_detections))
        after = self._live(after, measured.stamp_s, monitored)
        return after, self._report(after, measured.stamp_s)

    def _measured(self, detections: Detections) -> _Measured:
        """Detections over the score threshold."""
        sure = detections.score >= self.config.score_threshold
        if not sure.all():
            detections = detections[sure]
        code = np.array([_CODES[name] for name in detections.category.tolist()], dtype=np.int64)
        boxes = detections.boxes
        return _Measured(detections.stamp_s, boxes, detections.score, code, measurements(boxes))

    def _predict(self, state: TrackerState, dt_s: float) -> TrackerState:
        """Tracks carried over the time step."""
        if len(state) == 0:
            return state
        motion = self.config.motion
        mean, covariance = predict(
            state.mean, state.covariance, motion.transition(dt_s), motion.process_noise(dt_s)
        )
        return replace(state, mean=valid_state(mean), covariance=covariance)

    def _associate(self, tracks: TrackerState, measured: _Measured, dt_s: float) -> Matches:
        """Matches of predicted tracks and detections."""
        boxes = boxes_of(tracks.mean)
        reach = gate_reach_m(
            tracks.covariance,
            self.config.filter.position_sigma_m**2,
            boxes.size_m,
            tracks.category_code,
            dt_s,
            self.config.association,
        )
        return associate(
            boxes, tracks.category_code, measured.boxes, measured.category_code, reach, self._affinity
        )

    def _correct(self, tracks: TrackerState, measured: _Measured, matches: Matches) -> TrackerState:
        """Tracks after their matched measurements; the others stay as predicted."""
        track, detection = matches.track, matches.detection
        if len(track) == 0:
            return tracks
        mean, covariance = tracks.mean.copy(), tracks.covariance.copy()
        score, matched_s = tracks.score.copy(), tracks.matched_s.copy()
        prior = mean[track]
        innovation = innovations(prior, measured.measurement[detection])
        corrected, covariance[track] = update(prior, covariance[track], innovation, self._noise)
        mean[track] = valid_state(corrected)
        score[track] = measured.score[detection]
        matched_s[track] = measured.stamp_s
        # An unknown track learns its category from the first detection that knows it.
        category = tracks.category_code.copy()
        own = category[track]
        category[track] = np.where(own == _UNKNOWN, measured.category_code[detection], own)
        return replace(
            tracks,
            category_code=category,
            score=score,
            mean=mean,
            covariance=covariance,
            matched_s=matched_s,
        )

    def _candidates(self, measured: _Measured, new: IntArray) -> TrackerState:
        """A track for every unmatched detection, without identifier and never inside so far."""
        code = measured.category_code[new]
        mean, covariance = initial_states(measured.measurement[new], code, self.config.filter)
        n = len(new)
        now = np.full(n, measured.stamp_s)
        return TrackerState(
            stamp_s=measured.stamp_s,
            next_id=1,
            track_id=np.zeros(n, dtype=np.int64),
            category_code=code,
            score=measured.score[new],
            mean=mean,
            covariance=covariance,
            birth_s=now,
            matched_s=now,
            inside_s=np.full(n, -np.inf),
            confirmed=np.zeros(n, dtype=np.bool_),
        )

    def _live(self, tracks: TrackerState, now_s: float, monitored: Monitored | None) -> TrackerState:
        """Tracks that live on, confirmed where due, newborn ones with their identifiers."""
        config = self.config.lifecycle
        inside_s = np.full(len(tracks), now_s)
        if monitored is not None:
            inside = np.asarray(
                monitored(boxes_of(tracks.mean), _NAMES[tracks.category_code]), dtype=np.bool_
            )
            if inside.shape != inside_s.shape:
                raise ShapeError(f"monitored: expected {inside_s.shape} flags, got {inside.shape}")
            inside_s = np.where(inside, now_s, tracks.inside_s)
        coasted_s = now_s - tracks.matched_s
        alive = survives(coasted_s, now_s - inside_s, config)
        confirmed = confirm(tracks.confirmed, now_s - tracks.birth_s, coasted_s, config)
        newborn = alive & (tracks.track_id == 0)
        count = int(newborn.sum())
        track_id = tracks.track_id
        if count:
            track_id = track_id.copy()
            track_id[newborn] = np.arange(tracks.next_id, tracks.next_id + count)
        lived = replace(
            tracks,
            stamp_s=now_s,
            next_id=tracks.next_id + count,
            track_id=track_id,
            inside_s=inside_s,
            confirmed=confirmed,
        )
        return lived if alive.all() else lived[alive]

    def _report(self, tracks: TrackerState, now_s: float) -> Tracks:
        """What the tracks say at the frame's time."""
        velocity = tracks.mean[:, VX : VY + 1].copy()
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        sigma = np.sqrt(0.5 * (tracks.covariance[:, VX, VX] + tracks.covariance[:, VY, VY]))
        outlier = speed > self.config.outlier_speed_mps.of(tracks.category_code)
        velocity[outlier] = 0.0
        threshold = np.maximum(self.config.dynamic_speed_mps, self.config.dynamic_sigmas * sigma)
        return Tracks(
            stamp_s=now_s,
            track_id=tracks.track_id,
            boxes=boxes_of(tracks.mean),
            category=_NAMES[tracks.category_code],
            score=tracks.score,
            mean=tracks.mean,
            covariance=tracks.covariance,
            velocity_mps=velocity,
            yaw_rate_radps=tracks.mean[:, YAW_RATE],
            age_s=now_s - tracks.birth_s,
            coasted_s=now_s - tracks.matched_s,
            confirmed=tracks.confirmed,
            dynamic=(speed > threshold) & ~outlier,
        )


def _elapsed_s(last_s: float | None, now_s: float) -> float:
    """Time since the last frame; 0 at the first.

    Raises:
        TimeOrderError: The new stamp is not later than the last, or not a number.
    """
    if last_s is None:
        if not math.isfinite(now_s):
            raise TimeOrderError(f"frame at {now_s!r} s: the stamp must be a finite number of seconds")
        return 0.0
    if not last_s < now_s < math.inf:
        raise TimeOrderError(f"frame at {now_s!r} s is not newer than the last one at {last_s!r} s")
    return now_s - last_s
