"""Displacement errors of forecasts on arrays, against errors counted by hand."""

import math

import numpy as np
import pytest

from evaluation.metrics.forecast_quality import MISS_M, displacement_errors, forecast_scores
from smartmot.types import FloatArray, IntArray

STAMP_S = np.arange(7) * 0.5
STILL = np.zeros((7, 2))
NEW = np.zeros(2, dtype=np.bool_)
"""Tracks that were not followed before."""


def ahead(speed_mps: float) -> FloatArray:
    """(7, 2) places of an object that drives along x."""
    return np.column_stack((speed_mps * STAMP_S, np.zeros(7)))


def stays(forecasts: IntArray, elapsed_s: FloatArray) -> FloatArray:
    """Forecasts of an object that stays at the origin."""
    return np.zeros((len(forecasts), 1, 2))


def test_errors_of_an_object_that_was_to_stay() -> None:
    """At 1 m/s: 0.5, 1, 1.5, ... m after each half second; from the second label on there are 2.5 s."""
    errors = displacement_errors(
        STAMP_S, np.zeros(7, np.int64), ahead(1.0), np.array([0, 1]), stays, 0.25, NEW[:2]
    )
    assert errors.fde_m[0] == pytest.approx([1.0, 2.0, 3.0])
    assert errors.ade_m[0] == pytest.approx([0.75, 1.25, 1.75])
    assert errors.fde_m[1] == pytest.approx([1.5, 2.5, math.nan], nan_ok=True)
    assert errors.moving.tolist() == [[True, True, True], [True, True, False]]


def test_a_forecast_ends_with_its_object() -> None:
    """The label after the second one is another object's."""
    identity = np.array([0, 0, 1, 1, 1, 1, 1])
    errors = displacement_errors(STAMP_S, identity, ahead(1.0), np.array([0, 2]), stays, 0.25, NEW[:2])
    assert np.isnan(errors.fde_m[0]).all()
    assert errors.fde_m[1] == pytest.approx([2.0, 3.0, math.nan], nan_ok=True)


def test_scores_of_all_and_of_the_moving() -> None:
    starts = np.array([0])
    both = [
        displacement_errors(STAMP_S, np.zeros(7, np.int64), center, starts, stays, 0.25, NEW[:1])
        for center in (ahead(1.0), STILL)
    ]
    scores = forecast_scores(both, "car", "cv", with_map=False)
    by_kind = {(s.objects, s.horizon_s): s for s in scores}
    assert by_kind["all", 3.0].fde_m == pytest.approx(1.5)
    assert by_kind["all", 3.0].miss_rate_percent == pytest.approx(50.0)
    assert by_kind["moving", 3.0].fde_m == pytest.approx(3.0)
    assert (by_kind["all", 3.0].forecasts, by_kind["moving", 3.0].forecasts) == (2, 1)
    # an error of just the limit is no miss
    assert by_kind["moving", 2.0].fde_m == pytest.approx(MISS_M)
    assert by_kind["moving", 2.0].miss_rate_percent == 0.0


def test_without_forecasts_there_is_no_error() -> None:
    none = displacement_errors(
        STAMP_S, np.zeros(7, np.int64), STILL, np.zeros(0, np.int64), stays, 0.25, NEW[:0]
    )
    for score in forecast_scores([none], "car", "cv", with_map=True):
        assert score.forecasts == 0
        assert math.isnan(score.ade_m)
        assert math.isnan(score.miss_rate_percent)


def test_true_places_in_the_region_of_the_forecast() -> None:
    """1 m/s away from who was to stay, standard deviations of 0.9 m: within 2.45 of them up to 2.2 s."""

    def spread(forecasts: IntArray, elapsed_s: FloatArray) -> FloatArray:
        return np.tile(0.81 * np.eye(2), (len(forecasts), 1, 1))

    start = np.array([0])
    errors = displacement_errors(
        STAMP_S, np.zeros(7, np.int64), ahead(1.0), start, stays, 0.25, NEW[:1], spread
    )
    assert errors.inside[0].tolist() == [1.0, 1.0, 0.0]
    scores = forecast_scores([errors], "car", "cv", with_map=False)
    assert [s.inside_95_percent for s in scores if s.objects == "all"] == [100.0, 100.0, 0.0]
    without = displacement_errors(STAMP_S, np.zeros(7, np.int64), ahead(1.0), start, stays, 0.25, NEW[:1])
    assert np.isnan(without.inside).all()


def test_calibration_is_counted_of_moving_and_standing_objects_apart() -> None:
    """Who walks on at 1 m/s leaves a region of 0.9 m around its place; who stays does not."""

    def spread(forecasts: IntArray, elapsed_s: FloatArray) -> FloatArray:
        return np.tile(0.81 * np.eye(2), (len(forecasts), 1, 1))

    frames = np.zeros(7, np.int64)
    parts = [
        displacement_errors(STAMP_S, frames, way, np.array([0]), stays, 0.25, NEW[:1], spread)
        for way in (ahead(1.0), ahead(0.0), ahead(0.0))
    ]
    scores = forecast_scores(parts, "car", "cv", with_map=False)
    inside = {
        objects: [s.inside_95_percent for s in scores if s.objects == objects]
        for objects in ("all", "moving", "standing")
    }
    assert inside["moving"] == [100.0, 100.0, 0.0]
    assert inside["standing"] == [100.0, 100.0, 100.0]
    assert inside["all"] == pytest.approx([100.0, 100.0, 200.0 / 3.0])
