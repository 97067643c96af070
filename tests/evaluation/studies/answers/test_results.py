"""Differences, benefit and power from made-up runs, by hand."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from evaluation.metrics.intervals import NO_SAMPLE, Estimate, clustered_difference, wilson
from evaluation.metrics.power import least_difference
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.results import (
    Results,
    benefit,
    benefit_difference,
    decisive_differences,
    difference,
    power_lines,
)
from evaluation.studies.answers.tables import change_text, rates_table
from tests.evaluation.studies.answers.conftest import decision, scenes_of

ONE, TWO = Arm("one", "map"), Arm("two", "all")
RATES = {"one": (0.8, 0.1), "two": (0.6, 0.3)}


@pytest.fixture
def results(make) -> Results:
    return make((ONE, TWO), 40, lambda arm: RATES[arm.name])


def test_rates_have_wilsons_interval_and_means_are_of_their_kind(results: Results) -> None:
    assert results.estimate(ONE, "avoided") == wilson(32, 40)
    assert results.estimate(TWO, "stops") == wilson(12, 40)
    assert results.estimate(TWO, "speed_lost").value == pytest.approx(0.3 * 30.0)
    assert results.estimate(ONE, "impact").value == pytest.approx(0.2 * 20.0)
    assert results.estimate(ONE, "warning_ttc").count == 0


def test_a_difference_is_paired_by_scene(results: Results) -> None:
    avoided, stops = (difference(results, ONE, TWO, name) for name in ("avoided", "stops"))
    assert (avoided.more, avoided.fewer, avoided.estimate.count) == (8, 0, 40)
    assert avoided.estimate == clustered_difference([1] * 8 + [0] * 32, range(40))
    assert (stops.more, stops.fewer) == (0, 8)
    assert avoided.p_value == pytest.approx(2 / 2**8)


def test_runs_that_were_cut_off_are_in_no_pair(results: Results) -> None:
    first = dataclasses.replace(results.runs[ONE][0], end_reason="time_limit")
    cut = Results(results.scenes, {**results.runs, ONE: (first, *results.runs[ONE][1:])})
    assert cut.estimate(ONE, "avoided").count == 39
    assert difference(cut, ONE, TWO, "avoided").estimate.count == 39


@pytest.mark.parametrize("end_reason", ["time_limit", "not_begun"])
def test_an_unnecessary_stop_counts_whatever_was_still_to_come(results: Results, end_reason: str) -> None:
    """A run that stands before the scene's event has begun ends as not begun: what it did is known."""
    stopped = results.values(ONE, "stops") == 1.0
    runs = tuple(
        dataclasses.replace(run, end_reason=end_reason) if stops else run
        for run, stops in zip(results.runs[ONE], stopped, strict=True)
    )
    cut = Results(results.scenes, {**results.runs, ONE: runs})
    assert stopped.sum() == 4
    assert cut.estimate(ONE, "stops") == results.estimate(ONE, "stops") == wilson(4, 40)


def test_an_early_request_avoids_nothing(results: Results) -> None:
    early = dataclasses.replace(results.runs[ONE][0], false_activation=True)
    changed = Results(results.scenes, {**results.runs, ONE: (early, *results.runs[ONE][1:])})
    assert changed.estimate(ONE, "avoided") == wilson(31, 40)
    assert changed.estimate(ONE, "early") == wilson(1, 40)


def test_a_run_that_never_met_its_target_has_no_impact_speed(results: Results) -> None:
    early = dataclasses.replace(results.runs[ONE][0], false_activation=True)
    changed = Results(results.scenes, {**results.runs, ONE: (early, *results.runs[ONE][1:])})
    impact = changed.estimate(ONE, "impact")
    assert impact.count == 39
    assert impact.value == pytest.approx(8 * 20.0 / 39)


def test_what_only_some_runs_have_is_told_by_its_median_and_their_number(results: Results) -> None:
    """One request at a speed that hardly shrinks the distance: a mean would be 1000 s."""
    far = dataclasses.replace(results.runs[ONE][0], flag_ttc_s=40_000.0)
    none = dataclasses.replace(results.runs[ONE][1], flag_ttc_s=None)
    changed = Results(results.scenes, {ONE: (far, none, *results.runs[ONE][2:])})
    ours = changed.estimate(ONE, "flag_ttc")
    assert (ours.value, ours.low, ours.high, ours.count) == (1.5, 1.5, 1.5, 39)
    table = rates_table(changed, [ONE])
    column = table.header.index("TTC at the request (s, median)")
    assert table.rows[0][column] == "1.50 [1.50, 1.50], n = 39"


def test_p_values_are_corrected_for_all_questions(results: Results) -> None:
    both = decisive_differences(results, [(ONE, TWO), (ONE, ONE)])
    # 2 / 256 twice and 1 twice: the smallest times four, the next no smaller
    assert [d.adjusted for d in both] == pytest.approx([8 / 256, 8 / 256, 1.0, 1.0])
    assert [d.is_decided for d in both] == [True, True, False, False]


def test_the_benefit_adds_intervals_in_squares() -> None:
    ours = benefit(Estimate(0.1, 0.06, 0.15, 50), Estimate(-0.02, -0.05, 0.01, 60))
    assert ours.value == pytest.approx(0.12)
    assert ours.low == pytest.approx(0.12 - math.hypot(0.04, 0.03))
    assert ours.high == pytest.approx(0.12 + math.hypot(0.05, 0.03))
    assert benefit(NO_SAMPLE, ours) == NO_SAMPLE


@pytest.mark.parametrize(
    ("counts", "avoided", "stops"),
    [
        ((300, 300), (0.08, 0.03), (0.02, 0.06)),
        ((300, 300), (0.02, 0.0), (0.0, 0.03)),
        ((60, 300), (0.05, 0.05), (0.05, 0.05)),
    ],
)
def test_the_interval_of_the_benefit_covers_the_truth(
    counts: tuple[int, int], avoided: tuple[float, float], stops: tuple[float, float]
) -> None:
    """Each kind of scenes by itself; rates of scenes in which only the one, and only the other, is so."""
    rng, trials = np.random.default_rng(11), 1000
    ends = []
    for count, rates in zip(counts, (avoided, stops), strict=True):
        drawn = rng.multinomial(count, [*rates, 1 - sum(rates)], trials)
        changes = [[1] * more + [-1] * fewer + [0] * same for more, fewer, same in drawn]
        ends.append([clustered_difference(kept, range(count)) for kept in changes])
    truth = avoided[0] - avoided[1] - stops[0] + stops[1]
    both = [benefit(*pair) for pair in zip(*ends, strict=True)]
    inside = sum(e.low <= truth <= e.high for e in both) / trials
    assert 0.92 < inside < 0.99  # 0.947 to 0.96 in long simulations, four standard errors are 0.028


def test_the_benefit_of_one_over_another(results: Results) -> None:
    assert benefit_difference(results, ONE, TWO).value == pytest.approx(0.2 + 0.2)


def test_what_the_scenes_decide_is_said_before_the_runs() -> None:
    scenes = scenes_of(100)
    brake, nothing = power_lines(scenes, 4)
    least = 100 * least_difference(100, 0.2, 0.05 / 4)
    assert 10 < least < 20
    assert f"above {least:.1f} points if 20 % are discordant" in brake
    assert " 5 % are discordant" not in brake  # with so few discordant scenes, none is decided
    assert "none if 20 % or fewer" in power_lines(scenes_of(10), 4)[0]
    assert nothing.startswith("100 nothing scenes")
    assert power_lines(scenes, 0) == []


def test_of_no_scenes_there_is_neither_a_rate_nor_an_interval() -> None:
    scenes = tuple(scene for scene in scenes_of(3) if scene.must == "brake")
    runs = Results(scenes, {arm: tuple(decision("brake", True) for _ in scenes) for arm in (ONE, TWO)})
    (row,) = rates_table(runs, [ONE]).rows
    assert row[1:3] == ("100.0 [43.9, 100.0]", "–")  # 3 of 3: 3 / (3 + 3.8415); no nothing scene
    stops = difference(runs, ONE, TWO, "stops")
    assert (stops.estimate, stops.p_value) == (NO_SAMPLE, 1.0)
    assert change_text(stops) == "–"
    assert benefit_difference(runs, ONE, TWO) == NO_SAMPLE
    (line,) = power_lines(scenes, 2)
    assert line.startswith("3 must-brake scenes")


def test_unequal_numbers_of_scenes_have_each_their_own_power() -> None:
    scenes = [*scenes_of(300)[:300], *scenes_of(60)[60:]]
    brake, nothing = power_lines(scenes, 2)
    assert f"above {100 * least_difference(300, 0.1, 0.025):.1f} points if 10 %" in brake
    assert f"above {100 * least_difference(60, 0.2, 0.025):.1f} points if 20 %" in nothing
