"""Which differences a number of paired scenes can decide, and p-values of several questions at once."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

POWER = 0.8
"""Share of samples in which a true difference is to be seen (J. Cohen, Statistical Power Analysis, 1988)."""


def holm(p_values: Sequence[float]) -> list[float]:
    """P-values that hold for all questions together.

    Source: S. Holm, Scand. J. Stat. 6 (1979) 65: the smallest is multiplied by the number of questions, the
    next by one less, and none is smaller than one before it.

    Args:
        p_values: (Q,) one per question.

    Returns:
        (Q,) adjusted, in the same order.
    """
    adjusted = [1.0] * len(p_values)
    greatest = 0.0
    for rank, k in enumerate(sorted(range(len(p_values)), key=p_values.__getitem__)):
        greatest = max(greatest, min(1.0, (len(p_values) - rank) * p_values[k]))
        adjusted[k] = greatest
    return adjusted


def mcnemar_power(difference: float, discordant: float, pairs: int, level: float) -> float:
    """Probability that McNemar's exact test sees a difference of two rates on the same pairs.

    It is the sum over the numbers of discordant pairs, each with its binomial probability, of the probability
    that they divide so unevenly (R. J. Connor, Biometrics 43 (1987) 207, has the approximation).

    Args:
        difference: true rate of the one less that of the other.
        discordant: share of pairs in which they differ, at least as large.
        pairs: how many.
        level: p-value at or below which the test rejects.

    Raises:
        ValueError: the difference is greater than the share of discordant pairs, or a value is out of range.
    """
    from scipy.stats import binom

    if not abs(difference) <= discordant <= 1 or pairs < 0 or not 0 < level < 1:
        raise ValueError(
            f"mcnemar_power: expected |difference| <= discordant <= 1, got {difference:g} and {discordant:g}"
        )
    if discordant == 0:
        return 0.0
    numbers = np.arange(pairs + 1)
    # greatest number of pairs on the one side that the two-sided test takes for too few
    reached = binom.ppf(level / 2, numbers, 0.5)
    few = reached - (2 * binom.cdf(reached, numbers, 0.5) > level)
    share = 0.5 * (1 + difference / discordant)
    seen = binom.cdf(few, numbers, share) + binom.cdf(few, numbers, 1 - share)
    return float(binom.pmf(numbers, pairs, discordant) @ seen)


def least_difference(pairs: int, discordant: float, level: float, power: float = POWER) -> float:
    """Least difference of two rates that McNemar's exact test sees with a power; NaN if it sees none.

    Args:
        pairs: how many.
        discordant: assumed share of pairs in which the two differ; no difference is greater.
        level: see `mcnemar_power`.
        power: probability to see it.
    """
    if mcnemar_power(discordant, discordant, pairs, level) < power:
        return math.nan
    low, high = 0.0, discordant
    while high - low > 1e-6:
        middle = 0.5 * (low + high)
        seen = mcnemar_power(middle, discordant, pairs, level) >= power
        low, high = (low, middle) if seen else (middle, high)
    return high
