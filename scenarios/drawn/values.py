"""Values drawn at random: the laws of `distributions.toml`, by inverse transform of uniform numbers.

Only the generator's uniform numbers are used, and each value is rounded to three decimals, so that every
machine and every version of numpy draws the same.
"""

from __future__ import annotations

import hashlib
import tomllib
from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import accumulate
from pathlib import Path
from statistics import NormalDist
from typing import Any, Protocol

import numpy as np

from scenarios.errors import ScenarioError

DATA = Path(__file__).parent / "distributions.toml"
DIGITS = 3


class RejectedDraw(Exception):  # noqa: N818 - no fault: another draw follows
    """A draw that cannot be a scene; its text is the reason, the same for all that have it."""


@dataclass(frozen=True, slots=True)
class Law:
    """A distribution: uniform or normal between two limits, or a choice among texts.

    Args:
        law: uniform, normal or choice.
        low, high: limits of a number.
        mean, sd: of the normal distribution before it is cut at the limits.
        choices: texts with their weights.
    """

    law: str
    low: float = 0.0
    high: float = 0.0
    mean: float = 0.0
    sd: float = 0.0
    choices: tuple[tuple[str, float], ...] = ()

    def number(self, uniform: float) -> float:
        """The value at which the distribution function is that of [0, 1)."""
        if self.law == "normal":
            normal = NormalDist(self.mean, self.sd)
            below, above = normal.cdf(self.low), normal.cdf(self.high)
            value = normal.inv_cdf(below + uniform * (above - below))
        else:
            value = self.low + uniform * (self.high - self.low)
        return round(min(max(value, self.low), self.high), DIGITS)

    def text(self, uniform: float) -> str:
        """The choice that a number of [0, 1) falls on."""
        names, weights = zip(*self.choices, strict=True)
        return str(names[weighted(weights, uniform)])


def weighted(weights: Sequence[float], uniform: float) -> int:
    """Index that a number of [0, 1) falls on, each with a probability like its weight."""
    sums = [*accumulate(weights)]
    return min(bisect_right(sums, uniform * sums[-1]), len(sums) - 1)


@cache
def data() -> Mapping[str, Any]:
    """What the data file holds."""
    return tomllib.loads(DATA.read_text(encoding="utf-8"))


@cache
def law(name: str) -> Law:
    """A distribution of the data file.

    Raises:
        ScenarioError: there is none of that name, or it is not understood.
    """
    entry = data()["draw"].get(name)
    if entry is None:
        raise ScenarioError(f"{DATA.name}: nothing is drawn as {name!r}")
    fields = {key: value for key, value in entry.items() if key != "source"}
    choices = tuple((str(key), float(value)) for key, value in fields.pop("choices", {}).items())
    try:
        return Law(choices=choices, **fields)
    except TypeError as error:
        raise ScenarioError(f"{DATA.name}, {name}: {error}") from None


class Uniform(Protocol):
    """Where uniform numbers come from."""

    def random(self) -> float:
        """The next number of [0, 1)."""


class Given:
    """Uniform numbers that are given, in their order; then others, which follow from these.

    Args:
        numbers: of [0, 1).
    """

    def __init__(self, numbers: Sequence[float]) -> None:
        self._left = [*reversed(numbers)]
        text = ",".join(number.hex() for number in numbers)
        self._seed = int.from_bytes(hashlib.sha256(text.encode()).digest()[:8], "big")
        self._more: np.random.Generator | None = None

    def random(self) -> float:
        """The next one."""
        if self._left:
            return self._left.pop()
        if self._more is None:
            self._more = np.random.default_rng(self._seed)
        return float(self._more.random())


class Draw:
    """The values of one draw, in the order in which they are asked for.

    Args:
        rng: of the scene.

    Attributes:
        values: what has been drawn so far, by name.
    """

    def __init__(self, rng: Uniform) -> None:
        self._rng = rng
        self.values: dict[str, float | str] = {}

    def uniform(self) -> float:
        """A number of [0, 1) that is not noted."""
        return float(self._rng.random())

    def number(self, name: str, note: str = "") -> float:
        """A number of the distribution of that name, noted under it or under another name."""
        value = law(name).number(self.uniform())
        self.values[note or name] = value
        return value

    def text(self, name: str, note: str = "") -> str:
        """A choice of the distribution of that name, noted likewise."""
        value = law(name).text(self.uniform())
        self.values[note or name] = value
        return value

    def sign(self) -> int:
        """1 or -1, not noted."""
        return 1 if self.uniform() < 0.5 else -1

    def between(self, low: float, high: float) -> float:
        """A number between two, not noted."""
        return round(low + self.uniform() * (high - low), DIGITS)
