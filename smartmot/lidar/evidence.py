"""Scores: the probability that a box overlaps a road user of its class, by logistic regression.

The coefficients are in `evidence.json`, which `python -m benchmarks.fit_lidar` writes from simulated streets.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import lru_cache
from importlib.resources import files

import numpy as np

from smartmot.arrays import FloatArray, IntArray, StrArray

FARTHEST = 3.0
"""Features farther from their mean, in standard deviations, count as this far: nothing is known of them."""


@dataclass(frozen=True, slots=True, eq=False)
class Evidence:
    """A logistic regression on features and their products by two.

    Args:
        mean: (F,) of each feature.
        scale: (F,) standard deviation of each.
        weight: (F + F (F + 1) / 2 + 1,) of standardised features, of their products and squares, and of 1.
    """

    mean: FloatArray
    scale: FloatArray
    weight: FloatArray

    def probability(self, features: FloatArray) -> FloatArray:
        """(N,) of (N, F) features."""
        probability: FloatArray = 1.0 / (
            1.0 + np.exp(-(terms(features, self.mean, self.scale) @ self.weight))
        )
        return probability


def terms(features: FloatArray, mean: FloatArray, scale: FloatArray) -> FloatArray:
    """(N, F + F (F + 1) / 2 + 1) what the weights are for."""
    standard = np.clip((features - mean) / scale, -FARTHEST, FARTHEST)
    i, j = _pairs(features.shape[1])
    return np.column_stack((standard, standard[:, i] * standard[:, j], np.ones(len(features))))


@lru_cache(maxsize=4)
def _pairs(count: int) -> tuple[IntArray, IntArray]:
    """Every pair of features, and each with itself."""
    return np.triu_indices(count)


@lru_cache(maxsize=1)
def by_class() -> dict[str, Evidence]:
    """The regression of each class."""
    table = json.loads(files("smartmot.lidar").joinpath("evidence.json").read_text(encoding="utf-8"))
    return {
        name: Evidence(*(np.array(row[key]) for key in ("mean", "scale", "weight")))
        for name, row in table["classes"].items()
    }


def probability(category: StrArray, features: FloatArray) -> FloatArray:
    """(N,) scores of boxes of (N,) classes with (N, F) features."""
    score = np.zeros(len(category))
    for name, evidence in by_class().items():
        rows = np.flatnonzero(category == name)
        score[rows] = evidence.probability(features[rows])
    return score
