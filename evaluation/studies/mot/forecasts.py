"""Forecasts of recorded tracks: each motion model carries on what its own filter estimates, and is scored.

A forecast is made for every confirmed track that matches a label (centres at most 2 m apart, as in
`evaluation.metrics.matching`), in every frame from which the label is known one, two or three seconds later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from evaluation.metrics.forecast_quality import (
    DisplacementErrors,
    ForecastScore,
    displacement_errors,
    forecast_scores,
)
from evaluation.metrics.matching import MATCH_DISTANCE_M, assigned_pairs, compare, match_threshold
from evaluation.studies.mot.tracking import TrackedSequence
from smartmot.filters.box_filter import Motion
from smartmot.filters.filterpy_motions import InteractingModels
from smartmot.filters.motion_models import (
    ConstantAcceleration,
    ConstantTurnRate,
    ConstantVelocity,
    DecayingAcceleration,
    ctrv_positions,
)
from smartmot.forecast import ForecastConfig, class_positions, forecast_covariance, sure_turn_rates
from smartmot.types import CATEGORIES, FloatArray, IntArray

MAX_YAW_RATE_RADPS = ForecastConfig().max_yaw_rate_radps
"""Turn rates of tracks are limited to this, as in `smartmot.forecast`."""

MODELS: dict[str, Motion] = {
    "cv": ConstantVelocity(),
    "ctrv": ConstantTurnRate(),
    "ca": ConstantAcceleration(),
    "imm": InteractingModels(),
    "class": DecayingAcceleration(),
}
"""Motion models by name, with their default noise."""

SHIPPED = "shipped"
"""The pipeline's forecast: CTRV of the tracker's own tracks; what is static stays (`smartmot.forecast`)."""

assert MATCH_DISTANCE_M == 2.0  # the module's text says so

Carry = Callable[[TrackedSequence, IntArray, FloatArray], FloatArray]
"""Positions (R, 2) of some track rows (R,) after some times (R,)."""


def motions(own: Motion) -> dict[str, Motion]:
    """`MODELS`, the one of the tracker's own kind with the tracker's noise."""
    return {name: own if type(own) is type(model) else model for name, model in MODELS.items()}


def carried_on(model: str) -> Carry:
    """How a model moves tracks on."""
    return {
        "cv": _constant_velocity,
        "ctrv": _constant_turn_rate,
        "ca": _constant_acceleration,
        "imm": _interacting_models,
        "class": _by_class,
        SHIPPED: _shipped,
    }[model]


def _constant_velocity(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
    tracks = tracked.tracks
    return tracks.center_m[rows] + time_s[:, None] * tracks.velocity_mps[rows]


def _constant_turn_rate(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
    center, velocity = tracked.tracks.center_m[rows], tracked.tracks.velocity_mps[rows]
    positions, _ = ctrv_positions(
        center[:, 0],
        center[:, 1],
        np.arctan2(velocity[:, 1], velocity[:, 0]),
        np.hypot(velocity[:, 0], velocity[:, 1]),
        np.clip(tracked.yaw_rate_radps[rows], -MAX_YAW_RATE_RADPS, MAX_YAW_RATE_RADPS),
        time_s[:, None],
    )
    return positions[:, 0]


def _constant_acceleration(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
    moved = _constant_velocity(tracked, rows, time_s)
    return moved + 0.5 * time_s[:, None] ** 2 * tracked.acceleration_mps2[rows]


def _interacting_models(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
    """The mean of both models: an acceleration fades, and it ends."""
    models = MODELS["imm"]
    assert isinstance(models, InteractingModels)
    fade_s = 1.0 / (1.0 / models.memory_s + 1.0 / models.accelerated_s)
    gained = fade_s * (time_s + fade_s * np.expm1(-time_s / fade_s))
    moved = _constant_velocity(tracked, rows, time_s)
    return moved + gained[:, None] * tracked.acceleration_mps2[rows]


def _by_class(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
    tracks = tracked.tracks
    rate = np.clip(tracked.yaw_rate_radps[rows], -MAX_YAW_RATE_RADPS, MAX_YAW_RATE_RADPS)
    if tracked.covariance is not None:
        rate = sure_turn_rates(rate, tracked.covariance[rows])
    positions, _ = class_positions(
        tracks.center_m[rows],
        tracks.velocity_mps[rows],
        rate,
        tracked.acceleration_mps2[rows],
        _codes(tracked, rows),
        time_s[:, None],
    )
    return positions[:, 0]


def _shipped(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
    moved = _constant_turn_rate(tracked, rows, time_s)
    if tracked.dynamic is None:
        return moved
    return np.where(tracked.dynamic[rows, None], moved, tracked.tracks.center_m[rows])


def _codes(tracked: TrackedSequence, rows: IntArray) -> IntArray:
    return np.array(
        [CATEGORIES.index(name) for name in tracked.tracks.category[rows].tolist()], dtype=np.int64
    )


def forecast_errors(tracked: TrackedSequence, category: str, carry: Carry) -> DisplacementErrors:
    """Compare forecasts of a sequence with its labels.

    Args:
        tracked: A sequence with labels, and its tracks.
        category: Category of tracks and labels.
        carry: The forecast.
    """
    sequence = tracked.sequence
    assert sequence.labels is not None
    labels = sequence.labels[sequence.labels.category == category]
    track_rows = np.flatnonzero(tracked.tracks.category == category)
    compared = compare(sequence, tracked.tracks, category, "distance")
    label, track = assigned_pairs(
        compared,
        compared.label_counts,
        np.ones(len(track_rows), dtype=np.bool_),
        match_threshold(category, "distance"),
    )
    by_object = np.lexsort((labels.frame, labels.object_id))
    place = np.empty_like(by_object)
    place[by_object] = np.arange(len(by_object))
    rows = track_rows[track]
    covariance = tracked.covariance

    def spread(forecasts: IntArray, elapsed_s: FloatArray) -> FloatArray:
        assert covariance is not None
        chosen = rows[forecasts]
        return forecast_covariance(covariance[chosen], _codes(tracked, chosen), elapsed_s[:, None])[:, 0]

    return displacement_errors(
        sequence.stamp_s[labels.frame[by_object]],
        labels.object_id[by_object],
        labels.center_m[by_object],
        place[label],
        lambda forecasts, elapsed_s: carry(tracked, rows[forecasts], elapsed_s),
        0.5 * float(np.median(np.diff(sequence.stamp_s))) if len(sequence) > 1 else 0.0,
        None if covariance is None or covariance.shape[1] == 0 else spread,
    )


def score_forecasts(
    tracked_by_model: Mapping[str, Iterable[TrackedSequence]],
    categories: Sequence[str],
    along_lanes: Callable[[Carry], Carry] | None = None,
) -> list[ForecastScore]:
    """Quality of every model's forecasts, per category.

    Args:
        tracked_by_model: What the tracker made of the sequences with each of `MODELS`.
        categories: Categories to score.
        along_lanes: Makes a forecast follow the lanes of a map; None without a map.
    """
    scores: list[ForecastScore] = []
    for model, sequences in tracked_by_model.items():
        labelled = [tracked for tracked in sequences if tracked.sequence.labels is not None]
        carries = [carried_on(model)]
        if along_lanes is not None:
            carries.append(along_lanes(carries[0]))
        for with_map, carry in enumerate(carries):
            for category in categories:
                errors = [forecast_errors(tracked, category, carry) for tracked in labelled]
                scores += forecast_scores(errors, category, model, bool(with_map))
    return sorted(scores, key=lambda s: (categories.index(s.category), s.objects))
