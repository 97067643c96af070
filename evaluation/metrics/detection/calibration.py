"""How well scores are probabilities."""

from __future__ import annotations

import numpy as np

from smartmot.types import BoolArray, FloatArray

BINS = 10


def calibration_error(score: FloatArray, is_right: BoolArray) -> float:
    """Expected calibration error: mean difference of score and share that is right, over ten equal bins.

    Source: Guo, Pleiss, Sun, Weinberger, "On calibration of modern neural networks", ICML 2017, equation 3.

    Args:
        score: (N,) in [0, 1].
        is_right: (N,) which are right.

    Returns:
        NaN without any score.
    """
    if not len(score):
        return float("nan")
    bins = np.minimum((score * BINS).astype(np.int64), BINS - 1)
    total = np.bincount(bins, score - is_right, minlength=BINS)
    return float(np.abs(total).sum() / len(score))
