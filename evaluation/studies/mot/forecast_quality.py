"""How well tracks foretell where their objects go: displacement errors against the labels' later positions.

A forecast is made for every confirmed track that matches a label (centres at most 2 m apart, as in
`metrics`), in every frame from which the label is known one, two or three seconds later. Each motion model
is the tracker's own: its filter estimates the state that the model then carries on.

- ADE: mean distance between forecast and label over the label's frames up to the horizon.
- FDE: distance at the horizon.
- miss rate: share of forecasts whose distance at the horizon exceeds 2 m.

Source of the three: Chang et al., Argoverse, CVPR 2019 (miss: endpoint error over 2 m). They hold
for one forecast per object. Distances are between centres on the ground of the world frame, and contain the
track's own error of position. `moving` takes the objects that really move, 0.5 m/s on average up to the
horizon.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from evaluation.metrics.mot import MATCH_DISTANCE_M, assigned_pairs, compare, match_threshold
from evaluation.studies.mot.tracking import TrackedSequence
from smartmot.filters.motion_models import (
    ConstantAcceleration,
    ConstantTurnRate,
    ConstantVelocity,
    LinearMotion,
    ctrv_positions,
)
from smartmot.types import BoolArray, FloatArray, IntArray

HORIZONS_S = (1.0, 2.0, 3.0)
MISS_M = 2.0
MOVING_MPS = 0.5
"""Slower objects count as standing (the paper's threshold between static and dynamic)."""

MAX_YAW_RATE_RADPS = 1.0
"""Turn rates of tracks are limited to this, as in `smartmot.forecast`."""

MODELS: dict[str, LinearMotion | ConstantTurnRate] = {
    "cv": ConstantVelocity(),
    "ctrv": ConstantTurnRate(),
    "ca": ConstantAcceleration(),
}
"""Motion models by name, with their default noise."""

assert MATCH_DISTANCE_M == 2.0  # the module's text says so

Carry = Callable[[TrackedSequence, IntArray, FloatArray], FloatArray]
"""Positions (R, 2) of some track rows (R,) after some times (R,)."""


@dataclass(frozen=True, slots=True)
class ForecastScore:
    """Quality of forecasts for one category.

    Args:
        category: Category of the objects.
        objects: all, or moving.
        model: cv, ctrv or ca.
        with_map: Whether forecasts followed the lanes of a map.
        horizon_s: How far ahead.
        ade_m, fde_m: Mean errors.
        miss_rate_percent: Share of forecasts that miss.
        forecasts: Number of forecasts.
    """

    category: str
    objects: str
    model: str
    with_map: bool
    horizon_s: float
    ade_m: float
    fde_m: float
    miss_rate_percent: float
    forecasts: int


FORECAST_COLUMNS = tuple(item.name for item in fields(ForecastScore))


def motions(own: LinearMotion | ConstantTurnRate) -> dict[str, LinearMotion | ConstantTurnRate]:
    """`MODELS`, the one of the tracker's own kind with the tracker's noise."""
    return {name: own if type(own) is type(model) else model for name, model in MODELS.items()}


def carried_on(model: str) -> Carry:
    """How a model moves tracks on."""
    return {"cv": _constant_velocity, "ctrv": _constant_turn_rate, "ca": _constant_acceleration}[model]


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


@dataclass(frozen=True, slots=True, eq=False)
class _Errors:
    """Errors of R forecasts at each of H horizons; NaN where the label is not known."""

    ade_m: FloatArray
    fde_m: FloatArray
    moving: BoolArray


def forecast_errors(tracked: TrackedSequence, category: str, carry: Carry) -> _Errors:
    """Compare forecasts of a sequence with its labels.

    Args:
        tracked: A sequence with labels, and its tracks.
        category: Category of tracks and labels.
        carry: The forecast.
    """
    sequence = tracked.sequence
    assert sequence.labels is not None
    labels = sequence.labels[sequence.labels.category == category]
    own = np.flatnonzero(tracked.tracks.category == category)
    compared = compare(sequence, tracked.tracks, category, "distance")
    everything = np.ones(len(own), dtype=np.bool_)
    matched, column = assigned_pairs(
        compared, compared.label_counts, everything, match_threshold(category, "distance")
    )
    rows = own[column]
    order = np.lexsort((labels.frame, labels.object_id))
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    start = place[matched]
    stamp_s = sequence.stamp_s[labels.frame[order]]
    identity, center = labels.object_id[order], labels.center_m[order]
    tolerance_s = 0.5 * float(np.median(np.diff(sequence.stamp_s))) if len(sequence) > 1 else 0.0

    shape = (len(rows), len(HORIZONS_S))
    ade, fde, gone = (np.full(shape, np.nan) for _ in range(3))
    total, count = np.zeros(len(rows)), np.zeros(len(rows))
    active = np.arange(len(rows))
    step = 0
    while len(active):
        step += 1
        active = active[start[active] + step < len(order)]
        here, then = start[active], start[active] + step
        elapsed = stamp_s[then] - stamp_s[here]
        goes_on = (identity[then] == identity[here]) & (elapsed <= HORIZONS_S[-1] + tolerance_s)
        active, here, then, elapsed = active[goes_on], here[goes_on], then[goes_on], elapsed[goes_on]
        error = np.linalg.norm(carry(tracked, rows[active], elapsed) - center[then], axis=1)
        total[active] += error
        count[active] += 1
        for k, horizon_s in enumerate(HORIZONS_S):
            at = np.abs(elapsed - horizon_s) <= tolerance_s
            ade[active[at], k] = total[active[at]] / count[active[at]]
            fde[active[at], k] = error[at]
            gone[active[at], k] = np.linalg.norm(center[then[at]] - center[here[at]], axis=1) / elapsed[at]
    with np.errstate(invalid="ignore"):
        return _Errors(ade, fde, gone >= MOVING_MPS)


def score_forecasts(
    tracked_by_model: Mapping[str, Iterable[TrackedSequence]],
    categories: Sequence[str],
    along_lanes: Callable[[Carry], Carry] | None = None,
    done: Callable[[], None] = lambda: None,
) -> list[ForecastScore]:
    """Quality of every model's forecasts, per category.

    Args:
        tracked_by_model: What the tracker made of the sequences with each of `MODELS`.
        categories: Categories to score.
        along_lanes: Makes a forecast follow the lanes of a map; None without a map.
        done: Called after every model.
    """
    scores: list[ForecastScore] = []
    for model, sequences in tracked_by_model.items():
        labelled = [one for one in sequences if one.sequence.labels is not None]
        ways: list[tuple[bool, Carry]] = [(False, carried_on(model))]
        if along_lanes is not None:
            ways.append((True, along_lanes(carried_on(model))))
        for with_map, carry in ways:
            for category in categories:
                errors = [forecast_errors(one, category, carry) for one in labelled]
                for objects in ("all", "moving"):
                    scores += _scores(category, objects, model, with_map, errors)
        done()
    return sorted(scores, key=lambda s: (categories.index(s.category), s.objects))


def _scores(
    category: str, objects: str, model: str, with_map: bool, errors: list[Any]
) -> list[ForecastScore]:
    """One score for each horizon."""
    ade = np.concatenate([e.ade_m for e in errors])
    fde = np.concatenate([e.fde_m for e in errors])
    chosen = np.isfinite(fde)
    if objects == "moving":
        chosen &= np.concatenate([e.moving for e in errors])
    scores = []
    for k, horizon_s in enumerate(HORIZONS_S):
        rows = chosen[:, k]
        known = bool(rows.any())
        scores.append(
            ForecastScore(
                category=category,
                objects=objects,
                model=model,
                with_map=with_map,
                horizon_s=horizon_s,
                ade_m=float(ade[rows, k].mean()) if known else np.nan,
                fde_m=float(fde[rows, k].mean()) if known else np.nan,
                miss_rate_percent=float(100.0 * (fde[rows, k] > MISS_M).mean()) if known else np.nan,
                forecasts=int(rows.sum()),
            )
        )
    return scores
