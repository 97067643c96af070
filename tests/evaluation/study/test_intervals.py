"""Intervals against closed forms, reference values and their coverage."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from evaluation.study.intervals import mean_t, wilson


@pytest.mark.parametrize(("successes", "trials"), [(0, 10), (3, 10), (10, 10), (17, 250), (1, 1)])
def test_wilson_agrees_with_scipy(successes: int, trials: int) -> None:
    reference = stats.binomtest(successes, trials).proportion_ci(0.95, method="wilson")
    ours = wilson(successes, trials)
    assert (ours.low, ours.high) == pytest.approx((reference.low, reference.high), abs=1e-12)
    assert ours.value == successes / trials


@given(st.integers(1, 400).flatmap(lambda n: st.tuples(st.integers(0, n), st.just(n))))
def test_wilson_holds_the_rate_and_is_symmetric(sample: tuple[int, int]) -> None:
    successes, trials = sample
    ours, mirrored = wilson(successes, trials), wilson(trials - successes, trials)
    assert 0.0 <= ours.low <= ours.value <= ours.high <= 1.0
    assert ours.low == pytest.approx(1.0 - mirrored.high, abs=1e-12)


def test_wilson_of_nothing_and_of_nonsense() -> None:
    assert math.isnan(wilson(0, 0).value)
    with pytest.raises(ValueError, match="3 of 2"):
        wilson(3, 2)


def test_mean_agrees_with_scipy() -> None:
    sample = np.random.default_rng(1).normal(5.0, 2.0, 12)
    reference = stats.ttest_1samp(sample, 0.0).confidence_interval(0.95)
    ours = mean_t([*sample, math.nan])
    assert (ours.low, ours.high) == pytest.approx((reference.low, reference.high), rel=1e-12)
    assert ours.count == 12


def test_mean_covers_the_truth_as_often_as_it_says() -> None:
    rng = np.random.default_rng(2)
    inside = 0
    for _ in range(2000):
        interval = mean_t(rng.normal(1.0, 3.0, 4))
        inside += interval.low <= 1.0 <= interval.high
    assert wilson(inside, 2000, 0.9999).low < 0.95 < wilson(inside, 2000, 0.9999).high


def test_mean_of_one_value_has_no_interval() -> None:
    ours = mean_t([4.0])
    assert ours.value == 4.0
    assert math.isnan(ours.low)
    assert mean_t([]).count == 0
