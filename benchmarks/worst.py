"""Runs that subset simulation needs for the interval of independent runs, on failures of known probability.

    python -m benchmarks.worst [--samples N] [--repeats N]

The ratio is that of variances: independent runs with the same mean squared error, over the runs that were
carried out. Coverage is the share of 95 % intervals that hold the truth.
"""

from __future__ import annotations

import argparse
import math
from collections.abc import Callable

import numpy as np
from scipy.stats import norm

from evaluation.studies.worst.subset import subset_simulation
from smartmot.types import FloatArray

DIMENSION = 60


def plane(beta: float) -> Callable[[FloatArray], FloatArray]:
    """Failure beyond a plane that all numbers matter for."""
    normal = np.full(DIMENSION, 1.0 / math.sqrt(DIMENSION))
    return lambda sample: beta - sample @ normal


def two_planes(beta: float) -> Callable[[FloatArray], FloatArray]:
    """Failure to two opposite sides of one number."""
    return lambda sample: beta - np.abs(sample[:, 0])


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--samples", type=int, default=500)
    parser.add_argument("--repeats", type=int, default=200)
    given = parser.parse_args()
    header = ("failure", "probability", "mean", "variation", "coverage", "runs", "ratio")
    print("{:12} {:>12} {:>10} {:>10} {:>9} {:>7} {}".format(*header))
    for name, made, sides in (("plane", plane, 1), ("two planes", two_planes, 2)):
        for probability in (1e-2, 1e-3, 1e-4, 1e-5):
            margin = made(float(norm.isf(probability / sides)))
            found = [
                subset_simulation(margin, DIMENSION, samples=given.samples, seed=seed)
                for seed in range(given.repeats)
            ]
            estimates = np.array([each.probability for each in found])
            error = math.sqrt(float(((estimates / probability - 1.0) ** 2).mean()))
            held = np.mean([each.interval[0] <= probability <= each.interval[1] for each in found])
            runs = float(np.mean([each.runs for each in found]))
            ratio = (1.0 - probability) / (probability * error**2) / runs
            print(
                f"{name:12} {probability:12.0e} {estimates.mean():10.2e} {error:10.2f} {held:9.2f} "
                f"{runs:7.0f} {ratio:.1f}"
            )


if __name__ == "__main__":
    main()
