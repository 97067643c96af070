"""Confidence intervals of rates, means and paired differences, of independent values and of clusters.

Runs of one scene fail for the same reason, whatever the variant or the seed: they are a cluster, and the
scenes, not the runs, are the sample. Errors of clustered rates and means are those of the ratio estimator of
survey statistics (W. G. Cochran, Sampling Techniques, 3rd ed. 1977, sections 3.12 and 6.4), with Student's
quantile for the number of clusters. Rates take their design effect into Wilson's interval as an effective
sample size, as E. L. Korn and B. I. Graubard do with that of Clopper and Pearson (Survey Methodology 24
(1998) 193); N. Dean and M. Pagano compare such intervals (J. Surv. Stat. Methodol. 3 (2015) 484). Paired
differences of rates take it into Tango's score interval in the same way.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smartmot.types import FloatArray

CONFIDENCE = 0.95
"""Share of samples whose interval is to cover the true value."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its confidence interval; NaN where there is nothing to estimate.

    Args:
        value: rate or mean.
        low, high: ends of the interval.
        count: size of the sample.
    """

    value: float
    low: float
    high: float
    count: int

    @property
    def hits(self) -> int:
        """Of a rate: how many of the sample are so."""
        return round(self.value * self.count) if self.count else 0


NO_SAMPLE = Estimate(math.nan, math.nan, math.nan, 0)
"""Of nothing."""


def wilson(successes: int, trials: int, confidence: float = CONFIDENCE) -> Estimate:
    """Rate of a binomial sample with Wilson's score interval.

    Source: E. B. Wilson, J. Am. Stat. Assoc. 22 (1927) 209. It stays within [0, 1] and has a width where all
    or none succeed.

    Raises:
        ValueError: the numbers are not those of a sample.
    """
    if not 0 <= successes <= trials:
        raise ValueError(f"wilson: expected 0 <= successes <= trials, got {successes} of {trials}")
    if trials == 0:
        return NO_SAMPLE
    rate = successes / trials
    return Estimate(rate, *_score_interval(rate, trials, confidence), trials)


def _score_interval(rate: float, trials: float, confidence: float) -> tuple[float, float]:
    """Wilson's interval; the sample size need not be a whole number."""
    z2 = _normal(confidence) ** 2
    middle = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    half = math.sqrt(z2 * (rate * (1 - rate) + z2 / (4 * trials)) / trials) / (1 + z2 / trials)
    return 0.0 if rate == 0.0 else middle - half, 1.0 if rate == 1.0 else middle + half


def clustered_rate(
    outcomes: Sequence[bool], clusters: Sequence[Hashable], confidence: float = CONFIDENCE
) -> Estimate:
    """Rate of a sample in clusters, with Wilson's interval for its effective size.

    The effective size is that of an independent sample with the same error; where all or none succeed the
    error is unknown, and every cluster counts once. Copies of the whole sample change nothing. The interval
    of a single cluster is the whole range.

    Args:
        outcomes: (N,) whether each succeeded.
        clusters: (N,) which cluster each belongs to.
        confidence: see `wilson`.
    """
    n = len(outcomes)
    if n == 0:
        return NO_SAMPLE
    values = np.asarray(outcomes, dtype=np.float64)
    rate = float(values.mean())
    groups, error = _error_of_mean(values, clusters)
    if groups == 1:
        return Estimate(rate, 0.0, 1.0, n)
    size = float(groups) if rate in (0.0, 1.0) else min(rate * (1 - rate) / max(error**2, 1e-300), float(n))
    # few clusters do not know their own spread well: Student's quantile in place of the normal one
    size *= (_normal(confidence) / _student(groups, confidence)) ** 2
    return Estimate(rate, *_score_interval(rate, size, confidence), n)


def mean_t(sample: ArrayLike, confidence: float = CONFIDENCE) -> Estimate:
    """Mean of a sample with Student's interval; of one value without an interval (NaN).

    Args:
        sample: (N,) values; NaN are left out.
        confidence: share of samples whose interval covers the true mean, if values are normally distributed.
    """
    values = np.asarray(sample, dtype=np.float64)
    values = values[~np.isnan(values)]
    n = len(values)
    if n == 0:
        return NO_SAMPLE
    mean = float(values.mean())
    if n == 1:
        return Estimate(mean, math.nan, math.nan, 1)
    half = _student(n, confidence) * float(values.std(ddof=1)) / math.sqrt(n)
    return Estimate(mean, mean - half, mean + half, n)


def median(sample: ArrayLike, confidence: float = CONFIDENCE) -> Estimate:
    """Median of a sample with the interval between two of its values; of too few without one (NaN).

    It holds the true median whatever the distribution, at least as often as the confidence says: the values
    below that are as many as heads of a fair coin (W. J. Conover, Practical Nonparametric Statistics, 3rd ed.
    1999, section 3.2).

    Args:
        sample: (N,) values; NaN are left out.
        confidence: see `wilson`.
    """
    from scipy.special import bdtr

    values = np.sort(np.asarray(sample, dtype=np.float64))
    values = values[~np.isnan(values)]
    n = len(values)
    if n == 0:
        return NO_SAMPLE
    # so many values at either end may be left out
    beyond = int(np.count_nonzero(bdtr(np.arange(n), n, 0.5) <= (1 - confidence) / 2))
    ends = (values[beyond - 1], values[n - beyond]) if beyond else (math.nan, math.nan)
    return Estimate(float(np.median(values)), float(ends[0]), float(ends[1]), n)


def clustered_mean(
    sample: ArrayLike, clusters: Sequence[Hashable], confidence: float = CONFIDENCE
) -> Estimate:
    """Mean of a sample in clusters with Student's interval over the clusters; of one cluster without (NaN).

    Args:
        sample: (N,) values.
        clusters: (N,) which cluster each belongs to.
        confidence: see `mean_t`.
    """
    values = np.asarray(sample, dtype=np.float64)
    if not len(values):
        return NO_SAMPLE
    mean = float(values.mean())
    groups, error = _error_of_mean(values, clusters)
    if groups == 1:
        return Estimate(mean, math.nan, math.nan, len(values))
    half = _student(groups, confidence) * error
    return Estimate(mean, mean - half, mean + half, len(values))


def clustered_difference(
    changes: Sequence[float], clusters: Sequence[Hashable], confidence: float = CONFIDENCE
) -> Estimate:
    """Difference of two rates on the same runs in clusters, with an interval that has always a width.

    The interval is Tango's (see `tango`) for the effective number of pairs: that of an independent sample
    with the same error, at most all. Of N independent pairs it is N - 1, as P. J. Laud has it in
    his package ratesci. Where all runs change alike the error is unknown, and every cluster counts once.
    The interval of a single cluster is the whole range.

    Args:
        changes: (N,) outcome of the one less outcome of the other: -1, 0 or 1, or the mean of such over
            repetitions, which count as one.
        clusters: (N,) which cluster each belongs to.
        confidence: see `wilson`.
    """
    n = len(changes)
    if n == 0:
        return NO_SAMPLE
    values = np.asarray(changes, dtype=np.float64)
    difference = float(values.mean())
    groups, error = _error_of_mean(values, clusters)
    if groups == 1:
        return Estimate(difference, -1.0, 1.0, n)
    better, worse = float(np.maximum(values, 0).mean()), float(np.maximum(-values, 0).mean())
    variance = better + worse - difference**2
    # rounding leaves a variance of 1e-17 where all changes are the same
    size = float(groups) if variance < 1e-12 else min(variance / max(error**2, 1e-300), float(n))
    return Estimate(difference, *tango(better * size, worse * size, size, confidence), n)


def tango(better: float, worse: float, pairs: float, confidence: float = CONFIDENCE) -> tuple[float, float]:
    """Score interval of the difference of two rates on the same pairs.

    Source: T. Tango, Stat. Med. 17 (1998) 891. Its ends are the differences whose score statistic, with the
    likeliest rates for that difference, is the normal quantile. Numbers need not be whole.

    Args:
        better: pairs in which the first alone succeeded.
        worse: pairs in which the second alone succeeded.
        pairs: all of them.
        confidence: see `wilson`.

    Raises:
        ValueError: the numbers are not those of a sample.
    """
    if not 0 <= better + worse <= pairs * (1 + 1e-9) or min(better, worse) < 0 or pairs <= 0:
        raise ValueError(f"tango: expected counts of pairs, got {better:g} and {worse:g} of {pairs:g}")
    quantile = _normal(confidence)
    high = _tango_upper(better, worse, pairs, quantile)
    # the lower end is the upper one of the second less the first
    return -_tango_upper(worse, better, pairs, quantile), high


def _tango_upper(better: float, worse: float, pairs: float, quantile: float) -> float:
    """Upper end of Tango's interval, by bisection: the statistic falls as the difference grows."""
    low, high = -1.0, 1.0
    while low < (middle := 0.5 * (low + high)) < high:
        # the likeliest rate of pairs in which the second alone succeeds solves a quadratic equation
        b = (2 * pairs - better + worse) * middle - better - worse
        root = math.sqrt(max(b**2 + 8 * pairs * worse * middle * (1 - middle), 0.0))
        rate = (root - b) / (4 * pairs)
        error = math.sqrt(max(pairs * (2 * rate + middle * (1 - middle)), 0.0))
        inside = better - worse - pairs * middle >= -quantile * error
        low, high = (middle, high) if inside else (low, middle)
    return low


def sign_test(better: int, worse: int) -> float:
    """Two-sided p-value of the exact sign test, which is McNemar's for discordant pairs.

    How probable it is that a fair coin divides the pairs at least as unevenly; 1 if there are none.

    Raises:
        ValueError: a count is negative.
    """
    from scipy.special import bdtr

    if min(better, worse) < 0:
        raise ValueError(f"sign_test: expected counts, got {better} and {worse}")
    return min(1.0, 2.0 * float(bdtr(min(better, worse), better + worse, 0.5)))


def poisson_mean(count: int, confidence: float = CONFIDENCE) -> Estimate:
    """Mean of a Poisson distribution of which one count is known, with Garwood's exact interval.

    Source: F. Garwood, Biometrika 28 (1936) 437. Of no event its upper end is 3.69, for both sides together;
    the rule of three is one-sided.

    Raises:
        ValueError: the count is negative.
    """
    from scipy.special import gammaincinv

    if count < 0:
        raise ValueError(f"poisson_mean: expected a count, got {count}")
    outside = (1.0 - confidence) / 2.0
    low = float(gammaincinv(count, outside)) if count else 0.0
    return Estimate(float(count), low, float(gammaincinv(count + 1, 1.0 - outside)), 1)


def _error_of_mean(values: FloatArray, clusters: Sequence[Hashable]) -> tuple[int, float]:
    """Number of clusters, and standard error of the mean of values in clusters (0 for one)."""
    index, groups = _numbered(clusters)
    if groups == 1:
        return 1, 0.0
    # deviations within a cluster add up before they are squared: its runs are not independent
    residual = np.bincount(index, values - values.mean(), groups)
    return groups, math.sqrt(groups / (groups - 1) * float((residual**2).sum())) / len(values)


def _normal(confidence: float) -> float:
    """Quantile of the normal distribution for a two-sided interval."""
    from scipy.special import ndtri

    return float(ndtri(0.5 + confidence / 2))


def _student(count: int, confidence: float) -> float:
    """Quantile of Student's distribution for a two-sided interval of the mean of so many values."""
    from scipy.special import stdtrit

    return float(stdtrit(count - 1, 0.5 + confidence / 2))


def _numbered(clusters: Sequence[Hashable]) -> tuple[list[int], int]:
    """(N,) number of each cluster, and how many there are."""
    index = {cluster: k for k, cluster in enumerate(dict.fromkeys(clusters))}
    return [index[cluster] for cluster in clusters], len(index)
