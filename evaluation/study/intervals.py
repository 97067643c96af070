"""Confidence intervals of rates and means, of independent values and of values in clusters.

Runs of one scene fail for the same reason, whatever the variant or the seed: they are a cluster, and the
scenes, not the runs, are the sample. Errors of clustered rates and means are those of the ratio estimator of
survey statistics (W. G. Cochran, Sampling Techniques, 3rd ed. 1977, section 9A), with Student's quantile for
the number of clusters. Rates take their design effect into Wilson's interval as an effective sample size, as
E. L. Korn and B. I. Graubard do with that of Clopper and Pearson (Survey Methodology 24 (1998) 193); N. Dean
and M. Pagano compare both (J. Surv. Stat. Methodol. 3 (2015) 484).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from smartmot.types import FloatArray

CONFIDENCE = 0.95


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
        return Estimate(math.nan, math.nan, math.nan, 0)
    rate = successes / trials
    return Estimate(rate, *_score_interval(rate, trials, confidence), trials)


def _score_interval(rate: float, trials: float, confidence: float) -> tuple[float, float]:
    """Wilson's interval; the sample size need not be a whole number."""
    from scipy.special import ndtri

    z2 = float(ndtri(0.5 + confidence / 2)) ** 2
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
        return Estimate(math.nan, math.nan, math.nan, 0)
    values = np.asarray(outcomes, dtype=np.float64)
    rate = float(values.mean())
    groups, error = _error_of_mean(values, clusters)
    if groups == 1:
        return Estimate(rate, 0.0, 1.0, n)
    from scipy.special import ndtri, stdtrit

    half = 0.5 + confidence / 2
    size = float(groups) if rate in (0.0, 1.0) else min(rate * (1 - rate) / max(error**2, 1e-300), float(n))
    size *= (float(ndtri(half)) / float(stdtrit(groups - 1, half))) ** 2
    return Estimate(rate, *_score_interval(rate, size, confidence), n)


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
        return Estimate(math.nan, math.nan, math.nan, 0)
    mean = float(values.mean())
    groups, error = _error_of_mean(values, clusters)
    if groups == 1:
        return Estimate(mean, math.nan, math.nan, len(values))
    from scipy.special import stdtrit

    half = float(stdtrit(groups - 1, 0.5 + confidence / 2)) * error
    return Estimate(mean, mean - half, mean + half, len(values))


def _error_of_mean(values: FloatArray, clusters: Sequence[Hashable]) -> tuple[int, float]:
    """Number of clusters, and standard error of the mean of values in clusters (0 for one)."""
    index = {cluster: k for k, cluster in enumerate(dict.fromkeys(clusters))}
    groups = len(index)
    if groups == 1:
        return 1, 0.0
    off = np.bincount([index[cluster] for cluster in clusters], values - values.mean(), groups)
    return groups, math.sqrt(groups / (groups - 1) * float((off**2).sum())) / len(values)


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
        return Estimate(math.nan, math.nan, math.nan, 0)
    mean = float(values.mean())
    if n == 1:
        return Estimate(mean, math.nan, math.nan, 1)
    from scipy.special import stdtrit

    half = float(stdtrit(n - 1, 0.5 + confidence / 2)) * float(values.std(ddof=1)) / math.sqrt(n)
    return Estimate(mean, mean - half, mean + half, n)
