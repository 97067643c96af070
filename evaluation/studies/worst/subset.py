"""Subset simulation: the probability of a rare failure as a product of probabilities that are not rare.

A margin falls below 0 where there is a failure. Of the first samples, drawn as things are drawn, the share
with the least margins sets a threshold; chains that begin in these go on within what lies below it, and so
down to 0. Sources: S.-K. Au and J. L. Beck, Probabilistic Engineering Mechanics 16 (2001) 263, for the
method and the variation of its estimate; I. Papaioannou, W. Betz, K. Zwirglmaier and D. Straub, ibid. 41
(2015) 89, for chains that propose correlated normal numbers and for how far they step.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from statistics import NormalDist

import numpy as np

from evaluation.errors import ArgumentError
from smartmot.types import BoolArray, FloatArray

Margins = Callable[[FloatArray], FloatArray]
"""Margins (N,) of samples (N, D) of independent standard normal numbers; NaN of one that cannot be."""

_ACCEPTED = 0.44
"""Share of proposals that chains are to accept. Source: Papaioannou et al., section 3.3."""
_FIRST_STEP = 0.6
"""Standard deviation of the first proposals. Source: ibid."""
_REDRAWN = 0.2
"""Share of proposals in which a number without neighbours, such as a seed, is drawn anew (ours)."""
_MOST_DRAWN = 200
"""So many draws for one that can be, at most: else there is hardly any."""
_Z = NormalDist().inv_cdf(0.975)


@dataclass(frozen=True, slots=True, eq=False)
class Level:
    """What one level came to.

    Args:
        threshold: margin at or below which the level's share lies; 0 or less at the last.
        share: of the samples at or below it.
        variation: coefficient of variation of that share.
        accepted: share of the proposals that were accepted; NaN of the first level, which has no chains.
        sample: (N, D) standard normal numbers.
        margin: (N,) margins.
    """

    threshold: float
    share: float
    variation: float
    accepted: float
    sample: FloatArray
    margin: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class RareFailure:
    """An estimate of a failure probability.

    Args:
        levels: in their order.
        runs: how many samples were tried that can be, in all levels.
        drawn: how many were drawn for the first level; the others of these cannot be.
        proposed_in_vain: proposals that cannot be.
    """

    levels: tuple[Level, ...]
    runs: int
    drawn: int
    proposed_in_vain: int

    @property
    def probability(self) -> float:
        """Of a failure, among what can be."""
        return math.prod(level.share for level in self.levels)

    @property
    def variation(self) -> float:
        """Coefficient of variation of the probability, levels taken for independent (Au and Beck, eq. 29)."""
        return math.sqrt(sum(level.variation**2 for level in self.levels))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the probability: its logarithm taken for normal."""
        if self.probability == 0.0:
            return 0.0, math.nan
        sigma = math.sqrt(math.log1p(self.variation**2))
        low, high = (self.probability * math.exp(side * _Z * sigma) for side in (-1.0, 1.0))
        return low, min(high, 1.0)

    @property
    def monte_carlo_runs(self) -> float:
        """How many independent samples give the same coefficient of variation: (1 - p) / (p d^2)."""
        p, d = self.probability, self.variation
        return (1.0 - p) / (p * d**2) if p > 0.0 and d > 0.0 else math.nan


def subset_simulation(
    margins: Margins,
    dimension: int,
    *,
    samples: int = 500,
    share: float = 0.2,
    seed: int = 0,
    apart: int = 0,
    most_levels: int = 12,
) -> RareFailure:
    """Estimate how probable a margin of 0 or less is.

    Args:
        margins: of samples; called with as many as a level begins with, and then with one per chain.
        dimension: D, numbers of a sample.
        samples: N, of each level.
        share: of the samples of a level that the next begins with; N times it, and its inverse, are whole
            numbers.
        seed: of the numbers.
        apart: how many of the numbers, the last ones, have no neighbours (seeds of noise): they are kept or
            drawn anew, and not moved.
        most_levels: then it ends, with the probability that was reached as an upper bound.

    Raises:
        ArgumentError: the numbers do not divide, or hardly any draw can be.
    """
    begun = round(samples * share)
    length = round(1.0 / share)
    if begun < 2 or abs(begun * length - samples) > 1e-9:
        raise ArgumentError(f"samples {samples} and share {share:g}: expected numbers that divide each other")
    rng = np.random.default_rng(seed)
    sample, margin, drawn = _first(margins, dimension, samples, rng)
    runs, vain = samples, 0
    accepted = math.nan
    chains: int | None = None
    levels: list[Level] = []
    while True:
        failed = margin <= 0.0
        last = np.count_nonzero(failed) >= begun or len(levels) + 1 == most_levels
        threshold = 0.0 if last else float(np.partition(margin, begun - 1)[begun - 1])
        below = failed if last else margin <= threshold
        levels.append(
            Level(threshold, float(below.mean()), _variation(below, chains), accepted, sample, margin)
        )
        if last:
            return RareFailure(tuple(levels), runs, drawn, vain)
        # of equal margins at the threshold all are below it: who begins is drawn from all of them
        start = rng.choice(np.flatnonzero(below), begun, replace=False)
        sample, margin, accepted, tried, lost = _chains(
            margins, sample[start], margin[start], threshold, length, apart, rng
        )
        chains, runs, vain = begun, runs + tried, vain + lost


def monte_carlo(margins: Margins, dimension: int, count: int, seed: int = 0) -> tuple[int, int]:
    """How many of some independent samples that can be fail; both numbers, failed first."""
    _, margin, _ = _first(margins, dimension, count, np.random.default_rng(seed))
    return int(np.count_nonzero(margin <= 0.0)), count


def _first(
    margins: Margins, dimension: int, samples: int, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray, int]:
    """(N, D) samples that can be, their (N,) margins, and how many were drawn for them."""
    found_samples: list[FloatArray] = []
    found_margins: list[FloatArray] = []
    left, drawn = samples, 0
    while left > 0:
        sample = rng.standard_normal((left, dimension))
        margin = margins(sample)
        can_be = ~np.isnan(margin)
        drawn += left
        found_samples.append(sample[can_be])
        found_margins.append(margin[can_be])
        left -= int(np.count_nonzero(can_be))
        if left > 0 and drawn > _MOST_DRAWN * samples:
            raise ArgumentError(
                f"only {samples - left} of {drawn} draws can be; take another family, or maps with "
                "room for it"
            )
    return np.concatenate(found_samples), np.concatenate(found_margins), drawn


def _chains(
    margins: Margins,
    sample: FloatArray,
    margin: FloatArray,
    threshold: float,
    length: int,
    apart: int,
    rng: np.random.Generator,
) -> tuple[FloatArray, FloatArray, float, int, int]:
    """Chains within what lies at or below a threshold, each of a length, its start with it.

    Returns:
        (C * L, D) samples and (C * L,) margins, one time after the other; share of proposals accepted; how
        many were tried that can be; how many cannot.
    """
    count, dimension = sample.shape
    steps = _FIRST_STEP
    kept_samples, kept_margins = [sample], [margin]
    accepted_in_all = tried = vain = 0
    for number in range(1, length):
        moved = math.sqrt(1.0 - steps**2) * sample + steps * rng.standard_normal(sample.shape)
        if apart:
            again = np.less(rng.random(count), _REDRAWN)
            fresh = rng.standard_normal((count, apart))
            moved[:, dimension - apart :] = np.where(again[:, None], fresh, sample[:, dimension - apart :])
        of_moved = margins(moved)
        can_be = ~np.isnan(of_moved)
        goes = np.asarray(can_be & (of_moved <= threshold))
        sample, margin = np.where(goes[:, None], moved, sample), np.where(goes, of_moved, margin)
        kept_samples.append(sample)
        kept_margins.append(margin)
        tried += int(np.count_nonzero(can_be))
        vain += int(np.count_nonzero(~can_be))
        share = float(goes.mean())
        accepted_in_all += int(np.count_nonzero(goes))
        # Papaioannou et al., eq. 25: farther where many are accepted, nearer where few are
        steps = min(1.0, steps * math.exp((share - _ACCEPTED) / math.sqrt(number)))
    done = count * (length - 1)
    return (
        np.concatenate(kept_samples),
        np.concatenate(kept_margins),
        accepted_in_all / done,
        tried,
        vain,
    )


def _variation(below: BoolArray, chains: int | None) -> float:
    """Coefficient of variation of a share: of independent samples, or of chains by their correlation.

    Args:
        below: (N,) of the samples, one time after the other.
        chains: how many chains they are; None: independent ones.

    Source: Au and Beck, eqs. 25 to 28.
    """
    share = float(below.mean())
    if share in (0.0, 1.0):
        return 0.0 if share else math.inf
    alone = (1.0 - share) / (share * len(below))
    if chains is None:
        return math.sqrt(alone)
    table = below.reshape(-1, chains).astype(float)
    length = len(table)
    of_one = share * (1.0 - share)
    gamma = 0.0
    for lag in range(1, length):
        together = float((table[:-lag] * table[lag:]).mean()) - share**2
        gamma += 2.0 * (1.0 - lag / length) * together / of_one
    return math.sqrt(alone * (1.0 + max(gamma, 0.0)))
