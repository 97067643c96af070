"""Intervals against closed forms, reference values and their coverage."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats
from scipy.special import gammaln, xlogy

from evaluation.metrics.intervals import (
    clustered_difference,
    clustered_mean,
    clustered_rate,
    mean_t,
    median,
    sign_test,
    tango,
    wilson,
)


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


@pytest.mark.parametrize("count", [6, 17, 40, 201])
def test_the_median_is_covered_as_conover_has_it(count: int) -> None:
    """Of the values 1 to N the ends name their ranks; what is left out at both ends is a fair coin's tail."""
    ours = median(np.random.default_rng(count).permutation(np.arange(1.0, count + 1)))
    beyond = int(ours.low)
    assert ours.value == (count + 1) / 2
    assert ours.high == count + 1 - beyond
    assert 2 * stats.binom.cdf(beyond - 1, count, 0.5) <= 0.05 < 2 * stats.binom.cdf(beyond, count, 0.5)


def test_the_median_of_few_values_has_no_interval_and_far_ones_do_not_move_it() -> None:
    few = median([1.0, 2.0, 3.0, 4.0, 5.0])  # 2 / 32 > 0.05: not even all of them are wide enough
    assert (few.value, few.count) == (3.0, 5)
    assert math.isnan(few.low)
    assert math.isnan(median([]).value)
    assert median([1.0, 2.0, 3.0, math.nan, 1e9, 1e9]).value == 3.0


def test_mean_of_one_value_has_no_interval() -> None:
    ours = mean_t([4.0])
    assert ours.value == 4.0
    assert math.isnan(ours.low)
    assert mean_t([]).count == 0


# ---- clusters ----------------------------------------------------------------------------------------------

CLUSTERED = st.lists(
    st.lists(st.booleans(), min_size=1, max_size=6), min_size=2, max_size=12
)  # outcomes per cluster


def _flat(groups: list[list[bool]]) -> tuple[list[bool], list[int]]:
    return [v for group in groups for v in group], [k for k, group in enumerate(groups) for _ in group]


@given(CLUSTERED)
def test_a_clustered_rate_is_the_rate_and_lies_in_its_interval(groups: list[list[bool]]) -> None:
    outcomes, clusters = _flat(groups)
    ours = clustered_rate(outcomes, clusters)
    assert ours.value == pytest.approx(sum(outcomes) / len(outcomes))
    assert 0.0 <= ours.low <= ours.value + 1e-12
    assert ours.value <= ours.high + 1e-12 <= 1.0 + 2e-12
    mirrored = clustered_rate([not outcome for outcome in outcomes], clusters)
    assert ours.low == pytest.approx(1.0 - mirrored.high, abs=1e-9)


@given(st.lists(st.booleans(), min_size=2, max_size=12), CLUSTERED, st.integers(2, 5))
def test_more_seeds_with_the_same_outcomes_change_nothing(
    scenes: list[bool], groups: list[list[bool]], seeds: int
) -> None:
    once, many = (clustered_rate(*_flat([[outcome] * n for outcome in scenes])) for n in (1, seeds))
    assert (many.low, many.high) == pytest.approx((once.low, once.high), abs=1e-9)
    values, clusters = _flat([group * seeds for group in groups])
    few, more = clustered_mean(*_flat(groups)), clustered_mean(values, clusters)
    assert (more.low, more.high) == pytest.approx((few.low, few.high), abs=1e-9)


def test_clusters_of_one_are_the_ordinary_error_of_a_mean() -> None:
    sample = np.random.default_rng(3).normal(5.0, 2.0, 15)
    ours, plain = clustered_mean(sample, range(15)), mean_t(sample)
    assert (ours.low, ours.high) == pytest.approx((plain.low, plain.high), rel=1e-12)


def test_clusters_that_agree_within_count_once_each() -> None:
    """Four of ten scenes fail in all their five runs: error p (1 - p) / (G - 1), and Student's factor."""
    outcomes, clusters = _flat([[True] * 5] * 4 + [[False] * 5] * 6)
    t, z = stats.t.ppf(0.975, 9), stats.norm.ppf(0.975)
    size = 9 * (z / t) ** 2
    middle, spread = (0.4 + z**2 / (2 * size)) / (1 + z**2 / size), 1 + z**2 / size
    half = z / spread * math.sqrt(0.24 / size + z**2 / (4 * size**2))
    ours = clustered_rate(outcomes, clusters)
    assert (ours.low, ours.high) == pytest.approx((middle - half, middle + half), abs=1e-12)
    # the interval that takes the 50 runs for independent is less than half as wide
    naive = wilson(20, 50)
    assert naive.high - naive.low < 0.5 * (ours.high - ours.low)


def test_clustered_rates_cover_the_truth() -> None:
    """Twelve scenes with rates of their own around 0.3, six runs each; runs taken for independent fail."""
    rng = np.random.default_rng(4)
    clusters = np.repeat(np.arange(12), 6).tolist()
    covered, naive, trials = 0, 0, 1500
    for _ in range(trials):
        outcomes = rng.random(72) < np.repeat(rng.beta(0.6, 1.4, 12), 6)
        ours, plain = clustered_rate(outcomes.tolist(), clusters), wilson(int(outcomes.sum()), 72)
        covered += ours.low <= 0.3 <= ours.high
        naive += plain.low <= 0.3 <= plain.high
    assert covered / trials > 0.93
    assert naive / trials < 0.80


def test_one_cluster_tells_nothing_of_others() -> None:
    ours = clustered_rate([True, True], ["a", "a"])
    assert (ours.value, ours.low, ours.high) == (1.0, 0.0, 1.0)
    assert math.isnan(clustered_mean([1.0, 2.0], ["a", "a"]).low)
    assert math.isnan(clustered_rate([], []).value)
    assert clustered_mean([], []).count == 0


# ---- paired differences ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("better", "worse", "pairs", "low", "high"),
    [
        # M. W. Fagerland, S. Lydersen, P. Laake, Stat. Med. 33 (2014) 2850, table V: hyper-responsive airways
        (1, 7, 21, -0.517, -0.026),
        # the same authors, Statistical Analysis of Contingency Tables (2017), chapter 8: complete response
        (6, 16, 161, -0.1240, -0.0054),
    ],
)
def test_tango_gives_published_intervals(
    better: int, worse: int, pairs: int, low: float, high: float
) -> None:
    digits = 3 if pairs == 21 else 4
    assert [round(end, digits) for end in tango(better, worse, pairs)] == [low, high]


def test_tango_without_discordant_pairs_in_closed_form() -> None:
    """Nothing differs: the ends are those of Wilson's interval of 0 of N to both sides."""
    quantile = stats.norm.ppf(0.975) ** 2
    assert tango(0, 0, 50) == pytest.approx((-quantile / (50 + quantile), quantile / (50 + quantile)))
    with pytest.raises(ValueError, match="3 and 2 of 4"):
        tango(3, 2, 4)


def test_independent_pairs_have_the_interval_of_one_pair_less() -> None:
    changes = [1] * 5 + [-1] * 2 + [0] * 33
    ours = clustered_difference(changes, range(40))
    assert ours.value == pytest.approx(3 / 40)
    assert (ours.low, ours.high) == pytest.approx(tango(5 * 39 / 40, 2 * 39 / 40, 39), abs=1e-12)


RATES = [
    (0.02, 0.02), (0.05, 0.05), (0.08, 0.04), (0.1, 0.02), (0.1, 0.05), (0.1, 0.1), (0.15, 0.05), (0.2, 0.0),
    (0.2, 0.02), (0.2, 0.1), (0.3, 0.05), (0.3, 0.3), (0.4, 0.1), (0.6, 0.2),
]  # fmt: skip
"""Probabilities that the first alone, and that the second alone, succeeds."""


@pytest.mark.parametrize(
    ("pairs", "least", "most"), [(30, 0.94, 1.0), (100, 0.94, 0.965), (150, 0.94, 0.965)]
)
def test_differences_of_independent_scenes_cover_the_truth_as_often_as_they_say(
    pairs: int, least: float, most: float
) -> None:
    """Exact: the sum of the probabilities of all pairs of counts whose interval holds the true difference."""
    counts = [(b, c) for b in range(pairs + 1) for c in range(pairs + 1 - b)]
    # counts that none of the rates makes likelier than 1e-9 are left out
    log = gammaln(pairs + 1) - np.array([gammaln([b + 1, c + 1, pairs - b - c + 1]).sum() for b, c in counts])
    better, worse = np.array(counts).T
    chances = [
        np.exp(log + xlogy(better, p) + xlogy(worse, q) + xlogy(pairs - better - worse, 1 - p - q))
        for p, q in RATES
    ]
    kept = np.flatnonzero(np.max(chances, axis=0) > 1e-9)
    ends = np.array([_ends(better[k], worse[k], pairs) for k in kept])
    for (p, q), chance in zip(RATES, chances, strict=True):
        inside = (ends[:, 0] <= p - q + 1e-12) & (p - q - 1e-12 <= ends[:, 1])
        assert least <= chance[kept] @ inside <= most, (p, q)


def _ends(better: int, worse: int, pairs: int) -> tuple[float, float]:
    ours = clustered_difference([1] * better + [-1] * worse + [0] * (pairs - better - worse), range(pairs))
    return ours.low, ours.high


CHANGES = st.lists(st.lists(st.sampled_from([-1, 0, 1]), min_size=1, max_size=6), min_size=2, max_size=12)


def _changes(groups: list[list[int]], sign: int = 1) -> tuple[list[int], list[int]]:
    return [sign * v for group in groups for v in group], [k for k, group in enumerate(groups) for _ in group]


@given(CHANGES, st.integers(2, 4))
def test_a_difference_has_a_width_and_is_symmetric_and_copies_add_little(
    groups: list[list[int]], seeds: int
) -> None:
    ours = clustered_difference(*_changes(groups))
    assert -1.0 <= ours.low < ours.high <= 1.0
    assert ours.low - 1e-12 <= ours.value <= ours.high + 1e-12
    swapped = clustered_difference(*_changes(groups, -1))
    assert (swapped.low, swapped.high) == pytest.approx((-ours.high, -ours.low), abs=1e-12)
    many = clustered_difference(*_changes([group * seeds for group in groups]))
    assert ours.low - 1e-9 <= many.low < many.high <= ours.high + 1e-9
    alike, copied = (clustered_difference(*_changes([g[:1] * n for g in groups])) for n in (1, seeds))
    assert (copied.low, copied.high) == pytest.approx((alike.low, alike.high), abs=1e-9)


def test_differences_cover_the_truth() -> None:
    """Twelve scenes, in which a strategy is better with rates around 0.25 and worse with 0.05."""
    rng = np.random.default_rng(5)
    clusters = np.repeat(np.arange(12), 3).tolist()
    covered, trials = 0, 1000
    for _ in range(trials):
        rates = rng.dirichlet([0.5, 0.1, 1.4], 12)
        changes = [rng.choice([1.0, -1.0, 0.0], p=rates[k]) for k in clusters]
        ours = clustered_difference(changes, clusters)
        covered += ours.low <= 0.2 <= ours.high
    assert 0.93 < covered / trials < 0.97


def test_one_scene_or_none_tells_nothing_of_a_difference() -> None:
    ours = clustered_difference([1, 1], ["a", "a"])
    assert (ours.value, ours.low, ours.high) == (1.0, -1.0, 1.0)
    assert math.isnan(clustered_difference([], []).value)


@given(st.integers(0, 60), st.integers(0, 60))
def test_sign_test_agrees_with_scipy(better: int, worse: int) -> None:
    reference = stats.binomtest(better, better + worse, 0.5).pvalue if better + worse else 1.0
    assert sign_test(better, worse) == pytest.approx(reference, rel=1e-9)


def test_sign_test_by_hand() -> None:
    assert sign_test(0, 0) == 1.0
    assert sign_test(5, 0) == pytest.approx(2 / 32)
    assert sign_test(1, 4) == pytest.approx(2 * (1 + 5) / 32)
    with pytest.raises(ValueError, match="-1"):
        sign_test(-1, 2)
