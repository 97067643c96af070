"""Power against simulation and closed forms, Holm's correction by hand."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.metrics.intervals import sign_test
from evaluation.metrics.power import holm, least_difference, mcnemar_power


def test_holm_by_hand() -> None:
    """0.01 x 4; 0.02 x 3; 0.03 x 2 = 0.06, no smaller than the one before; 0.2 x 1."""
    assert holm([0.03, 0.01, 0.2, 0.02]) == pytest.approx([0.06, 0.04, 0.2, 0.06])
    assert holm([0.6, 0.7]) == [1.0, 1.0]
    assert holm([]) == []


@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=12))
def test_holm_keeps_the_order_and_lies_between_the_value_and_bonferroni(p_values: list[float]) -> None:
    adjusted = holm(p_values)
    for p, own in zip(p_values, adjusted, strict=True):
        assert p <= own <= min(1.0, len(p_values) * p) + 1e-12
    order = np.argsort(p_values, kind="stable")
    assert (np.diff(np.array(adjusted)[order]) >= 0).all()


@pytest.mark.parametrize(
    ("difference", "discordant", "pairs", "level"),
    [(0.08, 0.15, 120, 0.05), (0.05, 0.1, 300, 0.005), (0.2, 0.2, 40, 0.01)],
)
def test_power_is_the_share_of_simulated_samples_in_which_the_test_rejects(
    difference: float, discordant: float, pairs: int, level: float
) -> None:
    rng, trials = np.random.default_rng(7), 4000
    better = rng.binomial(pairs, 0.5 * (discordant + difference), trials)
    # of the pairs that are left, those in which the second alone succeeds
    worse = rng.binomial(
        pairs - better, 0.5 * (discordant - difference) / (1 - 0.5 * (discordant + difference))
    )
    seen = np.mean([sign_test(int(b), int(c)) <= level for b, c in zip(better, worse, strict=True)])
    power = mcnemar_power(difference, discordant, pairs, level)
    assert abs(seen - power) < 4 * math.sqrt(power * (1 - power) / trials)


def test_power_without_an_effect_is_below_the_level_and_of_a_certain_one_is_whole() -> None:
    assert 0.0 < mcnemar_power(0.0, 0.3, 200, 0.05) <= 0.05
    assert mcnemar_power(1.0, 1.0, 6, 0.05) == pytest.approx(1.0)  # 6 of 6: p = 2 / 64
    assert mcnemar_power(1.0, 1.0, 5, 0.05) == pytest.approx(0.0)  # 5 of 5: p = 2 / 32
    assert mcnemar_power(0.0, 0.0, 50, 0.05) == 0.0
    with pytest.raises(ValueError, match=r"0\.2 and 0\.1"):
        mcnemar_power(0.2, 0.1, 50, 0.05)


def test_the_least_difference_is_the_one_with_that_power() -> None:
    least = least_difference(300, 0.1, 0.005)
    assert mcnemar_power(least, 0.1, 300, 0.005) == pytest.approx(0.8, abs=1e-3)
    assert math.isnan(least_difference(10, 0.1, 0.05))
    more, stricter = least_difference(600, 0.1, 0.005), least_difference(300, 0.1, 0.001)
    assert more < least < stricter
