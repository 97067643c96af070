"""What is told of the tracks after a frame."""

from __future__ import annotations

import numpy as np

from smartmot.filters.kalman import BoxFilter
from smartmot.filters.motion_models import table
from smartmot.geometry import wrap_angle
from smartmot.tracking.frame import COASTED, Frame, Limits, Measured
from smartmot.tracking.settings import TrackerConfig
from smartmot.tracking.state import BIRTH_S, CONFIRMED, EXISTENCE, HITS, ID, MATCHED_S, SCORE, SCORE_SUM
from smartmot.types import CATEGORIES, BoolArray, Boxes, IntArray, Tracks, unchecked

_NAMES = np.array(CATEGORIES)


class Reporter:
    """Makes the tracks that users see.

    Args:
        config: Settings of the tracker.
        box_filter: The tracker's filter.
    """

    def __init__(self, config: TrackerConfig, box_filter: BoxFilter) -> None:
        self._config, self._filter = config, box_filter
        self._yaw_entry = box_filter.names.index("yaw_rad")
        self._nothing = _no_tracks(len(box_filter.names), config.existence is not None)
        self._outlier = table(config.outlier_speed_mps)
        self._dynamic = table(config.dynamic_speed_mps)
        self._sigmas = np.array(config.dynamic_sigmas)
        coasted = config.report.coasted_s
        least = table(config.report.existence)
        self._least_existence = least if least.any() else None
        self._shown_coasted = None if coasted is None else table(coasted) + 1e-6

    def nothing(self, stamp_s: float) -> Tracks:
        """No tracks at a time."""
        return unchecked(Tracks, stamp_s, *self._nothing)

    def report(self, frame: Frame, measured: Measured) -> Tracks:
        """What the tracks say at the frame's time."""
        config, now_s = self._config, measured.stamp_s
        rows, filtered, code = frame.rows, frame.filtered, frame.code
        shown, estimate = self._shown(frame, now_s, measured.limits), frame.estimate
        if shown is not None:
            rows, filtered, code = rows.take(shown, axis=0), filtered.take(shown, axis=0), code.take(shown)
        if shown is not None or estimate is None:
            estimate = self._filter.estimate(filtered)
        mean, covariance = self._filter.moments(filtered)
        velocity = estimate.velocity_mps
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        threshold = self._dynamic.take(code)
        if config.dynamic_sigmas > 0.0:
            variance = frame.speed_variance if shown is None else None
            sigma = np.sqrt(self._filter.speed_variance(filtered) if variance is None else variance)
            sigma *= self._sigmas
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
            seen = np.flatnonzero(source != COASTED)
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
            None if config.existence is None else rows[:, EXISTENCE].copy(),
        )

    def _shown(self, frame: Frame, now_s: float, limits: Limits) -> IntArray | None:
        """(K,) the tracks that the configuration wants to see; None: all."""
        rows, code = frame.rows, frame.code
        conditions: list[BoolArray] = []
        if not (self._config.report.tentative or frame.all_confirmed):
            conditions.append(rows[:, CONFIRMED] > 0.0)
        if self._shown_coasted is not None and frame.coasting:
            conditions.append(now_s - rows[:, MATCHED_S] <= self._shown_coasted.take(code))
        if limits.score is not None:
            conditions.append(rows[:, SCORE] >= limits.score.take(code))
        if limits.mean_score is not None:
            conditions.append(rows[:, SCORE_SUM] >= limits.mean_score.take(code) * rows[:, HITS])
        if self._least_existence is not None:
            conditions.append(rows[:, EXISTENCE] >= self._least_existence.take(code))
        if not conditions:
            return None
        shown = conditions[0]
        for condition in conditions[1:]:
            shown &= condition
        return None if np.count_nonzero(shown) == len(rows) else shown.nonzero()[0]


def _no_tracks(entries: int, existence: bool) -> tuple[object, ...]:
    """Values of `Tracks` after the stamp, without any track, for D entries of the filter's mean."""
    none, ids, flags = np.zeros(0), np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.bool_)
    mean, covariance = np.zeros((0, entries)), np.zeros((0, entries, entries))
    velocity, names = np.zeros((0, 2)), _NAMES[:0]
    return (
        ids,
        Boxes.empty(),
        names,
        none,
        mean,
        covariance,
        velocity,
        none,
        none,
        none,
        flags,
        flags,
        none if existence else None,
    )
