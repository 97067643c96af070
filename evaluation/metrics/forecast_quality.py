"""How well forecasts tell where objects go: displacement errors against the labels' later positions.

- ADE: mean distance between forecast and label over the label's frames up to the horizon.
- FDE: distance at the horizon.
- miss rate: share of forecasts whose distance at the horizon exceeds 2 m.
- minADE_6, minFDE_6: each of that of the six most likely hypotheses which is best by it, as in nuScenes'
prediction challenge, where a forecast has several; ADE, FDE and miss rate are those of the most likely one.
- inside: share of forecasts whose 95 % region, by their own covariance, holds the true place: 95 % if it is
right.

Source of the first three: Chang et al., Argoverse, CVPR 2019 (miss: endpoint error over 2 m). Distances are
between centres on the ground of the world frame, and contain the track's own error of position. `moving`
takes the objects that really move, 0.5 m/s on average up to the horizon, `standing` the others, and
`followed` the moving ones whose track is a second old: as much as data sets of forecasts show of an object
beforehand (Waymo 1 s, Argoverse and nuScenes 2 s), while the first detection tells no velocity.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass, fields

import numpy as np

from smartmot.forecast import CHI2_95
from smartmot.types import BoolArray, FloatArray, IntArray

HORIZONS_S = (1.0, 2.0, 3.0)
MISS_M = 2.0
"""An error at the horizon beyond this is a miss (Argoverse)."""

FOLLOWED_S = 1.0
"""A track of this age counts as followed."""

MOVING_MPS = 0.5
"""Slower objects count as standing (the paper's threshold between static and dynamic)."""

Spread = Callable[[IntArray, FloatArray], FloatArray]
"""(N, 2, 2) covariances of N of the forecasts, by their indices, for (N,) times after their beginning."""

Positions = Callable[[IntArray, FloatArray], FloatArray]
"""(N, K, 2) positions that N of the forecasts, by their indices, give for (N,) times after their beginning:
those of K hypotheses, the most likely first."""


@dataclass(frozen=True, slots=True)
class ForecastScore:
    """Quality of forecasts for one category.

    Args:
        category: Category of the objects.
        objects: all, moving, standing or followed.
        model: shipped, cv, ctrv, ca, imm or class.
        with_map: Whether forecasts followed the lanes of a map.
        horizon_s: How far ahead.
        ade_m, fde_m: Mean errors.
        miss_rate_percent: Share of forecasts that miss.
        forecasts: Number of forecasts.
        inside_95_percent: Share whose 95 % region holds the true place; NaN without covariance.
        min_ade_6_m, min_fde_6_m: Mean errors of the best of up to six hypotheses.
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
    inside_95_percent: float = math.nan
    min_ade_6_m: float = math.nan
    min_fde_6_m: float = math.nan


FORECAST_COLUMNS = tuple(item.name for item in fields(ForecastScore))


@dataclass(frozen=True, slots=True, eq=False)
class DisplacementErrors:
    """Errors of R forecasts at each of H horizons.

    Args:
        ade_m: (R, H) mean errors up to the horizon; NaN where the label is not known at it.
        fde_m: (R, H) errors at the horizon; NaN in the same places.
        moving: (R, H) objects that move on average up to it.
        inside: (R, H) 1 where the 95 % region holds the true place, else 0; NaN without covariance.
        min_ade_m, min_fde_m: (R, H) errors of the best hypothesis.
        followed: (R,) tracks that were followed before.
    """

    ade_m: FloatArray
    fde_m: FloatArray
    moving: BoolArray
    inside: FloatArray
    min_ade_m: FloatArray
    min_fde_m: FloatArray
    followed: BoolArray


def displacement_errors(
    stamp_s: FloatArray,
    object_id: IntArray,
    center_m: FloatArray,
    start: IntArray,
    positions: Positions,
    tolerance_s: float,
    followed: BoolArray,
    spread: Spread | None = None,
) -> DisplacementErrors:
    """Errors of forecasts, each of which begins at one row of the labels.

    Args:
        stamp_s: (L,) times of the labels; rows of an object stand together, in the order of time.
        object_id: (L,) identities.
        center_m: (L, 2) centres.
        start: (R,) rows at which the forecasts begin.
        positions: The forecasts.
        tolerance_s: A label is at a horizon if it is no farther from it in time.
        followed: (R,) forecasts of tracks that were followed before.
        spread: Covariances of the forecasts; None: they have none.
    """
    shape = (len(start), len(HORIZONS_S))
    ade, fde, mean_speed, inside, min_ade, min_fde = (np.full(shape, np.nan) for _ in range(6))
    total, count = None, np.zeros(len(start))
    # all forecasts go on by one label at a time, until their object or the longest horizon ends
    active = np.arange(len(start))
    step = 0
    while len(active):
        step += 1
        active = active[start[active] + step < len(stamp_s)]
        now, then = start[active], start[active] + step
        elapsed = stamp_s[then] - stamp_s[now]
        goes_on = (object_id[then] == object_id[now]) & (elapsed <= HORIZONS_S[-1] + tolerance_s)
        active, now, then, elapsed = active[goes_on], now[goes_on], then[goes_on], elapsed[goes_on]
        offsets = positions(active, elapsed) - center_m[then][:, None]
        errors = np.linalg.norm(offsets, axis=2)
        total = np.zeros((len(start), errors.shape[1])) if total is None else total
        total[active] += errors
        count[active] += 1
        offset, error = offsets[:, 0], errors[:, 0]
        for k, horizon_s in enumerate(HORIZONS_S):
            at = np.abs(elapsed - horizon_s) <= tolerance_s
            mean_m = total[active[at]] / count[active[at], None]
            ade[active[at], k], min_ade[active[at], k] = mean_m[:, 0], mean_m.min(axis=1)
            fde[active[at], k], min_fde[active[at], k] = error[at], errors[at].min(axis=1)
            gone_m = np.linalg.norm(center_m[then[at]] - center_m[now[at]], axis=1)
            mean_speed[active[at], k] = gone_m / elapsed[at]
            if spread is not None and at.any():
                scaled = np.linalg.solve(spread(active[at], elapsed[at]), offset[at][..., None])[..., 0]
                inside[active[at], k] = (offset[at] * scaled).sum(axis=1) <= CHI2_95
    with np.errstate(invalid="ignore"):
        moving = mean_speed >= MOVING_MPS
    return DisplacementErrors(ade, fde, moving, inside, min_ade, min_fde, followed)


def forecast_scores(
    errors: Iterable[DisplacementErrors], category: str, model: str, with_map: bool
) -> list[ForecastScore]:
    """Scores over some sequences: of all objects, of the moving and of the standing ones, at each horizon.

    Args:
        errors: Of each sequence.
        category: For the result.
        model: For the result.
        with_map: For the result.
    """
    parts = list(errors)
    names = ("ade_m", "fde_m", "inside", "min_ade_m", "min_fde_m")
    ade, fde, inside, min_ade, min_fde = (
        np.concatenate([getattr(part, name) for part in parts]) for name in names
    )
    moving = np.concatenate([part.moving for part in parts])
    followed = np.concatenate([part.followed for part in parts])[:, None]
    known = np.isfinite(fde)
    chosen = {
        "all": known,
        "moving": known & moving,
        "standing": known & ~moving,
        "followed": known & moving & followed,
    }
    return [
        _score(
            category,
            objects,
            model,
            with_map,
            horizon_s,
            *(values[rows[:, k], k] for values in (ade, fde, inside, min_ade, min_fde)),
        )
        for objects, rows in chosen.items()
        for k, horizon_s in enumerate(HORIZONS_S)
    ]


def _score(
    category: str,
    objects: str,
    model: str,
    with_map: bool,
    horizon_s: float,
    ade_m: FloatArray,
    fde_m: FloatArray,
    inside: FloatArray,
    min_ade_m: FloatArray,
    min_fde_m: FloatArray,
) -> ForecastScore:
    """One score; its errors are NaN without forecasts."""
    some = len(fde_m) > 0
    return ForecastScore(
        category=category,
        objects=objects,
        model=model,
        with_map=with_map,
        horizon_s=horizon_s,
        ade_m=float(ade_m.mean()) if some else np.nan,
        fde_m=float(fde_m.mean()) if some else np.nan,
        miss_rate_percent=float(100.0 * (fde_m > MISS_M).mean()) if some else np.nan,
        forecasts=len(fde_m),
        inside_95_percent=float(100.0 * inside.mean()) if some else np.nan,
        min_ade_6_m=float(min_ade_m.mean()) if some else np.nan,
        min_fde_6_m=float(min_fde_m.mean()) if some else np.nan,
    )
