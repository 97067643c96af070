"""Laws of drawn values against their closed forms, and what the data file has to hold."""

from __future__ import annotations

import math

import numpy as np
import pytest

from scenarios.drawn.values import Draw, Law, data, law, weighted
from scenarios.errors import ScenarioError

N = 4_000
NUMBERS = [name for name, entry in data()["draw"].items() if entry["law"] != "choice"]
TEXTS = [name for name, entry in data()["draw"].items() if entry["law"] == "choice"]


def moments(entry: dict[str, float]) -> tuple[float, float]:
    """Mean and standard deviation of the distribution, by integration of its density."""
    x = np.linspace(entry["low"], entry["high"], 20_001)
    density = np.ones_like(x)
    if entry["law"] == "normal":
        density = np.exp(-(((x - entry["mean"]) / entry["sd"]) ** 2) / 2)
    density /= density.sum()
    mean = float((x * density).sum())
    return mean, math.sqrt(float(((x - mean) ** 2 * density).sum()))


@pytest.mark.parametrize("name", NUMBERS)
def test_numbers_have_the_moments_of_the_data_file(name: str) -> None:
    entry = data()["draw"][name]
    draw = Draw(np.random.default_rng(1))
    values = np.array([draw.number(name) for _ in range(N)])
    mean, sd = moments(entry)
    assert values.mean() == pytest.approx(mean, abs=5 * sd / math.sqrt(N))
    # the fourth moment is at most 3 sd^4 here, so the sd has an error below sd / sqrt(2 N)
    assert values.std() == pytest.approx(sd, rel=5 / math.sqrt(2 * N))
    assert values.min() >= entry["low"]
    assert values.max() <= entry["high"]


@pytest.mark.parametrize("name", TEXTS)
def test_choices_have_the_shares_of_the_data_file(name: str) -> None:
    choices = data()["draw"][name]["choices"]
    assert sum(choices.values()) == pytest.approx(1.0)
    draw = Draw(np.random.default_rng(2))
    values = [draw.text(name) for _ in range(N)]
    for value, share in choices.items():
        spread = math.sqrt(share * (1 - share) / N)
        assert values.count(value) / N == pytest.approx(share, abs=5 * spread)


@pytest.mark.parametrize("name", [*NUMBERS, *TEXTS])
def test_every_distribution_has_a_source(name: str) -> None:
    assert len(data()["draw"][name]["source"]) >= len("assumed")


def test_median_of_a_cut_normal_is_that_of_its_probability() -> None:
    # cut at its mean from below: the median is where the standard normal has a probability of 0.75
    assert Law("normal", low=0.0, high=100.0, mean=0.0, sd=1.0).number(0.5) == pytest.approx(0.674, abs=6e-4)


def test_weights_are_probabilities() -> None:
    assert [weighted([1.0, 0.0, 3.0], u) for u in (0.0, 0.249, 0.25, 0.999)] == [0, 0, 2, 2]


def test_unknown_names_are_refused() -> None:
    with pytest.raises(ScenarioError, match="nothing is drawn as 'shoe_size'"):
        law("shoe_size")
