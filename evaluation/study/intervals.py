"""Confidence intervals of rates and means."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

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
    from scipy.special import ndtri

    z2 = float(ndtri(0.5 + confidence / 2)) ** 2
    rate = successes / trials
    middle = (rate + z2 / (2 * trials)) / (1 + z2 / trials)
    half = math.sqrt(z2 * (rate * (1 - rate) + z2 / (4 * trials)) / trials) / (1 + z2 / trials)
    low = 0.0 if successes == 0 else middle - half
    high = 1.0 if successes == trials else middle + half
    return Estimate(rate, low, high, trials)


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
