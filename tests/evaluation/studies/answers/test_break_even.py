"""Where a benefit is lost: interpolation by hand, resampling against theory, words from made-up runs."""

from __future__ import annotations

import math

import numpy as np
import pytest

from evaluation.studies.answers.break_even import BreakEven, Sweep, crossing, resampled_benefits

SIZES = np.array([0.0, 0.5, 1.0, 2.0])


@pytest.mark.parametrize(
    ("benefits", "at"),
    [
        ((0.04, 0.02, -0.02, -0.1), 0.75),
        ((0.03, 0.03, 0.01, 0.0), 2.0),
        ((0.03, -0.03, 0.04, -0.1), 0.25),  # the first loss counts
        ((0.03, 0.02, 0.02, 0.01), math.inf),
        ((0.0, 0.02, 0.02, 0.01), 0.0),
    ],
)
def test_crossing_is_interpolated(benefits: tuple[float, ...], at: float) -> None:
    assert crossing(SIZES, np.array(benefits)) == pytest.approx(at)


def test_resampled_benefits_have_the_mean_and_the_error_of_independent_scenes() -> None:
    """The error of a mean is the standard deviation over the root of the number of scenes."""
    rng = np.random.default_rng(3)
    avoided, stops = (rng.choice([-1.0, 0.0, 1.0], (2, n), p=[0.1, 0.7, 0.2]) for n in (150, 200))
    avoided[0, 5] = math.nan
    drawn = resampled_benefits(avoided, stops, 1)
    assert drawn.shape == (2000, 2)
    assert drawn.mean(axis=0) == pytest.approx(np.nanmean(avoided, axis=1) - stops.mean(axis=1), abs=0.004)
    error = math.sqrt(avoided[1].var() / 150 + stops[1].var() / 200)
    assert drawn[:, 1].std() == pytest.approx(error, rel=0.06)
    assert (drawn == resampled_benefits(avoided, stops, 1)).all()


def test_the_answer_says_where_the_benefit_is_lost(make) -> None:
    """The map stops 10 points less without error, and 10 points more at 1 m: lost at 0.5 m."""
    lost, kept = Sweep("margin_m", (1.0,)), Sweep("reach_m", (10.0, 20.0))
    study = BreakEven(sweeps=(lost, kept), named=(("filter", "none"),))

    def rates(arm) -> tuple[float, float]:
        wide = dict(arm.settings).get("margin_m") == 1.0
        return 0.9, 0.2 if arm.strategy == "path" else 0.3 if wide else 0.1

    results = make(study.arms, 100, rates)
    first, second = study.curves(results)["map"]
    assert first.crossing == pytest.approx(0.5)
    assert 0.2 < first.low < 0.5 < first.high < 0.8
    assert math.isinf(second.crossing)
    answer = study.answer(results)
    assert "benefit +10.0 [" in answer.sentences[0]
    assert "the benefit is lost at 0.50 m [" in answer.sentences[1]
    assert "not lost up to 20 m" in answer.sentences[2]
    assert len(answer.files["break_even.csv"].decode().splitlines()) == 1 + 2 + 3 + 1


def test_an_error_that_means_nothing_for_the_path_runs_it_once() -> None:
    study = BreakEven(sweeps=(Sweep("margin_m", (1.0, 2.0)),), named=())
    assert [arm.strategy for arm in study.arms].count("path") == 1
    assert [arm.strategy for arm in study.arms].count("map") == 3


def test_all_errors_can_be_run() -> None:
    study = BreakEven()
    for arm in study.arms:
        arm.check()
    errors = sum(len(sweep.values) for sweep in study.sweeps) + len(study.named)
    assert len(study.pairs_of(study.sides[0])) == 1 + errors


def test_tuned_settings_are_compared_as_well_and_with_the_tuned_path() -> None:
    chosen = (("map", "paper", (("margin_m", 4.0),)), ("path", "paper", (("corridor_m", 2.0),)))
    (_, path), (wide, narrow) = BreakEven(tuned=chosen).sides
    assert (wide.name, dict(wide.settings)["margin_m"]) == ("map, tuned", 4.0)
    assert (narrow.name, dict(narrow.settings)["corridor_m"]) == ("path, tuned", 2.0)
    assert "corridor_m" not in dict(path.settings)


def test_what_stays_as_it_is_is_not_asked_twice(make) -> None:
    """Nothing was chosen for the path, and for the map what the preset has anyway."""
    short = {"sweeps": (Sweep("map_kerb_m", (1.0,)),), "named": ()}
    study = BreakEven(tuned=(("map", "rss", ()), ("map", "paper", (("margin_m", 1.8),))), **short)
    assert (study.sides, study.questions) == (BreakEven(**short).sides, 4)
    table = study.answer(make(study.arms, 20, lambda arm: (0.9, 0.1))).tables["Who is who"]
    assert table.rows[-1] == ("map, tuned", "map", "planner", "as map: nothing better was found")
    half = BreakEven(tuned=(("map", "paper", (("margin_m", 4.0),)), ("path", "paper", ())), **short)
    (_, path), (wide, same) = half.sides
    assert (wide.name, same, half.questions) == ("map, tuned", path, 8)
    assert [arm.name for arm in half.arms].count("path") == 2  # without the error and with it


def test_the_row_without_errors_shows_its_p(make) -> None:
    """10 of 50 scenes that only the path avoids: p = 2 / 2^10, times the four questions of the study."""
    study = BreakEven(sweeps=(Sweep("map_kerb_m", (1.0,)),), named=())
    rates = {"path": (0.8, 0.2), "map": (0.6, 0.2)}
    table = study.answer(make(study.arms, 50, lambda arm: rates[arm.name])).tables["By error: map"]
    for row in table.rows:
        assert (row[4], row[6]) == ("0.0078", "1")


def test_without_a_benefit_there_is_nothing_to_lose(make) -> None:
    study = BreakEven(sweeps=(Sweep("margin_m", (1.0,)),), named=())
    answer = study.answer(make(study.arms, 50, lambda arm: (0.9 if arm.strategy == "path" else 0.8, 0.1)))
    first, second = answer.sentences[1:]
    assert first.startswith("map: there is no benefit that an error could take")
    assert "-10.0 [" in second
