"""Forecasts of recorded tracks: each motion model carries on what its own filter estimates, and is scored.

A forecast is made for every confirmed track that matches a label (centres at most 2 m apart, as in
`evaluation.metrics.matching`), in every frame from which the label is known one, two or three seconds later.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from evaluation.metrics.forecast_quality import (
    FOLLOWED_S,
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
from smartmot.forecast import (
    ForecastConfig,
    class_motion,
    class_positions,
    codes,
    forecast_covariance,
)
from smartmot.forecast import (
    Motion as ObjectMotion,
)
from smartmot.types import FloatArray, IntArray

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
"""The configuration's forecast of its own tracks (`smartmot.forecast_tracks`)."""

WITH_MAP = (SHIPPED, "class")
"""Forecasts that follow lanes too, where there is a map."""

assert MATCH_DISTANCE_M == 2.0  # the module's text says so

Carry = Callable[[TrackedSequence, IntArray, FloatArray], FloatArray]
"""Positions (R, 2) of some track rows (R,) after some times (R,)."""

Hypotheses = Callable[[TrackedSequence, IntArray, FloatArray], FloatArray]
"""Positions (R, K, 2) of the same, of K hypotheses, the most likely first."""


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
    }[model]


def shipped(forecast: ForecastConfig) -> Carry:
    """The pipeline's forecast with some settings; with constant turn rates what is static stays."""
    if forecast.model == "class":
        return _by_class
    free = _constant_turn_rate if forecast.max_yaw_rate_radps > 0.0 else _constant_velocity

    def carry(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
        moved = free(tracked, rows, time_s)
        if tracked.dynamic is None:
            return moved
        return np.where(tracked.dynamic[rows, None], moved, tracked.tracks.center_m[rows])

    return carry


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
    code = codes(tracked.tracks.category[rows])
    center, motion = tracked.tracks.center_m[rows], motion_of(tracked, rows)
    return class_positions(center, motion, code, time_s[:, None])[0][:, 0]


def motion_of(tracked: TrackedSequence, rows: IntArray) -> ObjectMotion:
    """How some track rows (R,) move, as their category does."""
    tracks = tracked.tracks
    rate = np.clip(tracked.yaw_rate_radps[rows], -MAX_YAW_RATE_RADPS, MAX_YAW_RATE_RADPS)
    covariance = np.zeros((len(rows), 0, 0)) if tracked.covariance is None else tracked.covariance[rows]
    return class_motion(
        tracks.velocity_mps[rows],
        tracks.yaw_rad[rows],
        rate,
        tracked.acceleration_mps2[rows],
        covariance,
        codes(tracks.category[rows]),
    )


def forecast_errors(tracked: TrackedSequence, category: str, carry: Carry | Hypotheses) -> DisplacementErrors:
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
    tolerance_s = 0.5 * float(np.median(np.diff(sequence.stamp_s))) if len(sequence) > 1 else 0.0

    def positions(forecasts: IntArray, elapsed_s: FloatArray) -> FloatArray:
        moved = carry(tracked, rows[forecasts], elapsed_s)
        return moved if moved.ndim == 3 else moved[:, None]

    def spread(forecasts: IntArray, elapsed_s: FloatArray) -> FloatArray:
        assert covariance is not None
        chosen = rows[forecasts]
        code = codes(tracked.tracks.category[chosen])
        return forecast_covariance(covariance[chosen], code, elapsed_s[:, None])[:, 0]

    return displacement_errors(
        sequence.stamp_s[labels.frame[by_object]],
        labels.object_id[by_object],
        labels.center_m[by_object],
        place[label],
        positions,
        tolerance_s,
        _ages_s(tracked)[rows] >= FOLLOWED_S - tolerance_s,
        None if covariance is None or covariance.shape[1] == 0 else spread,
    )


def _ages_s(tracked: TrackedSequence) -> FloatArray:
    """(K,) time since each track row's identity was first told."""
    stamp = tracked.sequence.stamp_s[tracked.tracks.frame]
    _, first, identity = np.unique(tracked.tracks.object_id, return_index=True, return_inverse=True)
    return np.asarray(stamp - stamp[first][identity])  # rows stand in the order of time


def score_forecasts(
    tracked_by_model: Mapping[str, Iterable[TrackedSequence]],
    categories: Sequence[str],
    forecast: ForecastConfig,
    along_lanes: Callable[[Carry], Hypotheses] | None = None,
) -> list[ForecastScore]:
    """Quality of every model's forecasts, per category.

    Args:
        tracked_by_model: What the tracker made of the sequences with each of `MODELS`.
        categories: Categories to score.
        forecast: Settings of the one that is shipped.
        along_lanes: Makes a forecast by category follow the lanes of a map; None without a map.
    """
    scores: list[ForecastScore] = []
    for model, sequences in tracked_by_model.items():
        labelled = [tracked for tracked in sequences if tracked.sequence.labels is not None]
        free = shipped(forecast) if model == SHIPPED else carried_on(model)
        carries: list[Carry | Hypotheses] = [free]
        if along_lanes is not None and model in WITH_MAP:
            carries.append(along_lanes(free))
        for with_map, carry in enumerate(carries):
            for category in categories:
                errors = [forecast_errors(tracked, category, carry) for tracked in labelled]
                scores += forecast_scores(errors, category, model, bool(with_map))
    return sorted(scores, key=lambda s: (categories.index(s.category), s.objects))
