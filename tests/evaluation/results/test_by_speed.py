"""The tables that a comparison ends with."""

from __future__ import annotations

from dataclasses import replace

import pandas as pd
import pytest

from evaluation.results.by_speed import comparison_table, impact_table
from evaluation.results.files import ResultsError
from evaluation.results.notes import told_runs
from tests.evaluation.results.conftest import CUT_OFF, HIT, PUBLISHED, STOPPED, runs_of


def test_comparison_sets_strategies_side_by_side() -> None:
    slow = [
        replace(row, v_test_kmh=10.0, v_impact_kmh=0.0, score=1.0, score_max=1.0) for row in (STOPPED, HIT)
    ]
    table = comparison_table(runs_of(STOPPED, HIT, *slow))
    assert table.header == (
        "v_test (km/h)",
        "rectangular v_impact (km/h)",
        "score",
        "map v_impact (km/h)",
        "score",
    )
    assert table.rows == (("10", "0.00", "1.00", "0.00", "1.00"), ("50", "23.00", "0.00", "0.00", "2.00"))
    assert table.totals == (("total", "", "1.00/3", "", "3.00/3"),)
    assert table.caption == ""


def test_comparison_with_published_values_shows_differences() -> None:
    table = comparison_table(runs_of(STOPPED, HIT), PUBLISHED)
    assert table.header[3:5] == ("published (km/h)", "diff. (km/h)")
    assert table.rows == (("50", "23.00", "0.00", "23.82", "-0.82", "0.00", "2.00", "0.00", "0.00"),)
    assert table.totals == (("total", "", "0.00/2", "score 2", "", "", "2.00/2", "score 2", ""),)


def test_comparison_leaves_out_what_was_not_run_or_published() -> None:
    fast = replace(HIT, v_test_kmh=80.0, v_impact_kmh=70.0, score=None, score_max=None)
    table = comparison_table(runs_of(STOPPED, HIT, fast), PUBLISHED)
    assert table.rows[1] == ("80", "70.00", "–", "–", "–", "–", "–", "–", "–")
    assert table.totals[0][2] == "0.00/2"


def test_comparison_takes_published_speeds_without_a_score() -> None:
    fast = replace(STOPPED, v_test_kmh=70.0, v_impact_kmh=0.0, score=None, score_max=None)
    table = comparison_table(runs_of(STOPPED, fast), PUBLISHED)
    assert table.rows[1] == ("70", "0.00", "–", "0.00", "0.00")
    assert table.totals == (("total", "", "2.00/2", "score 2", ""),)


def test_comparison_shows_each_weather_and_scores_their_mean() -> None:
    table = comparison_table(runs_of(HIT, replace(HIT, weather="rain", v_impact_kmh=30.0, score=1.0)))
    assert table.rows == (("clear", "50", "23.00", "0.00"), ("rain", "50", "30.00", "1.00"))
    assert table.totals == (
        ("clear", "total", "", "0.00/2"),
        ("rain", "total", "", "1.00/2"),
        ("mean", "total", "", "0.50/2"),
    )


def test_comparison_averages_seeds() -> None:
    table = comparison_table(runs_of(HIT, replace(HIT, seed=1, v_impact_kmh=30.0, score=1.0)))
    assert table.rows == (("50", "26.50", "0.50"),)
    assert table.totals == (("total", "", "0.50/2"),)
    assert table.caption == "Means over up to 2 runs per speed and strategy."


def test_comparison_keeps_conditions_apart_and_counts_false_activations() -> None:
    stop = replace(STOPPED, adversaries="static", false_activation=True)
    table = comparison_table(runs_of(STOPPED, HIT, stop))
    assert table.header[:2] == ("adversaries", "v_test (km/h)")
    assert [row[:2] for row in table.rows] == [("none", "50"), ("static", "50")]
    assert table.rows[1] == ("static", "50", "–", "–", "0.00", "2.00")
    assert table.totals[-1] == ("false activations", "", "0 of 1", "", "1 of 2", "")


def test_a_run_that_was_cut_off_has_no_number_in_a_table() -> None:
    table = comparison_table(runs_of(CUT_OFF, HIT))
    assert table.rows == (("50", "23.00", "0.00", "cut off", "–"),)
    assert table.totals == (
        ("total", "", "0.00/2", "", "–"),
        ("cut off", "0 of 1", "", "1 of 1", ""),
    )
    # false activations and cut-off runs have denominators of their own
    impacts = impact_table(runs_of(CUT_OFF, replace(STOPPED, v_test_kmh=60.0), HIT))
    assert impacts.rows == (("50", "23.00", "cut off"), ("60", "–", "0.00"))
    assert impacts.totals == (("contacts", "1 of 1", "0 of 1"), ("cut off", "0 of 1", "1 of 2"))
    assert told_runs([CUT_OFF, HIT]) == [
        "1 of 2 runs were cut off at 60 s: they count nowhere as avoided, and have no score; shorten what "
        "comes before, or give the scenario a stop trigger"
    ]
    assert told_runs([STOPPED, HIT]) == []


def test_a_mean_leaves_out_a_run_that_was_cut_off() -> None:
    table = comparison_table(runs_of(replace(CUT_OFF, strategy="rectangular", seed=2), HIT))
    assert table.rows == (("50", "23.00", "0.00"),)


def test_a_run_without_conflict_wins_no_points_and_is_not_avoided() -> None:
    nothing = replace(STOPPED, score=None)
    assert not nothing.avoided
    table = comparison_table(
        runs_of(nothing, replace(STOPPED, v_test_kmh=60.0, score=1.0, score_max=1.0), HIT)
    )
    assert table.rows == (("50", "23.00", "0.00", "no conflict", "–"), ("60", "–", "–", "0.00", "1.00"))
    assert table.totals == (
        ("total", "", "0.00/2", "", "1.00/1"),
        ("no conflict", "0 of 1", "", "1 of 2", ""),
    )


def test_comparison_of_nothing_says_so() -> None:
    with pytest.raises(ResultsError, match="table of runs is empty"):
        comparison_table(runs_of())
    with pytest.raises(ResultsError, match="columns missing: scenario"):
        comparison_table(pd.DataFrame({"strategy": ["map"]}))
