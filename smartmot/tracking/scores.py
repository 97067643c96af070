"""The score scale of a detector: what score a sure detection of a category has.

Detectors do not agree on scores: one gives nine in ten true cars over 0.9, another gives none over 0.7.
Thresholds of the tracker are therefore multiplied by a reference score of the category. It is the quantile
`REFERENCE_QUANTILE` of the category's scores, each weighted with itself: a flood of weak detections, which
every network can be made to report, has little weight and moves it little. Thresholds relative to it do not
change when all scores are scaled.

Online it is estimated from the detections so far, of one frame every `COUNT_INTERVAL_S`: frames that follow
each other closely show the same objects. Before the first, a detector is taken to be sure (reference 1); this
counts as much as `PRIOR_DETECTIONS` sure detections, so that the first false detection does not set the
scale.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.arrays import shared_by_copies, unchecked
from smartmot.errors import ShapeError
from smartmot.types import CATEGORIES, FloatArray, IntArray

REFERENCE_QUANTILE = 0.75
"""Three quarters of the sum of the scores are from detections up to the reference: well inside the sure ones,
and no extreme value."""

PRIOR_DETECTIONS = 1.0
"""How many sure detections the assumption weighs that the detector gives them a score of 1. One suffices to
doubt the first detections; more would make a detector with low scores blind for seconds."""

COUNT_INTERVAL_S = 0.5
"""Time from one frame that is counted to the next; nuScenes annotates at this interval."""

_LEAST_SCORE = 1e-3
_STEP = 1.05
"""Bins of scores grow by 5 %, which is how well a reference is known; no threshold needs more."""

_BINS = int(np.ceil(np.log(1.0 / _LEAST_SCORE) / np.log(_STEP)))
_UPPER = _STEP ** np.arange(1.0 - _BINS, 1.0)
"""(B,) upper ends of the bins, the last 1."""


@shared_by_copies
@dataclass(frozen=True, slots=True, eq=False)
class ScoreScale:
    """What is known of a detector's scores.

    Args:
        counted_s: Stamp of the last frame that was counted; -inf before the first.
        mass: (C, B) sums of scores by category, in the order of CATEGORIES, and bin of the score.
        reference: (C,) reference scores that follow, in (0, 1].

    Raises:
        ShapeError: The arrays do not have these shapes, or a value is impossible.
    """

    counted_s: float
    mass: FloatArray
    reference: FloatArray

    def __post_init__(self) -> None:
        shape = len(CATEGORIES), _BINS
        if self.mass.shape != shape or self.reference.shape != shape[:1]:
            raise ShapeError(
                f"score scale: expected {shape} sums and {shape[:1]} references, "
                f"got {self.mass.shape} and {self.reference.shape}"
            )
        possible = np.isfinite(self.mass).all() and (self.mass >= 0.0).all()
        if (
            not possible
            or math.isnan(self.counted_s)
            or not ((self.reference > 0) & (self.reference <= 1)).all()
        ):
            raise ShapeError("score scale: sums must be finite and not negative, references in (0, 1]")
        self.mass.flags.writeable = False
        self.reference.flags.writeable = False

    @classmethod
    def empty(cls) -> ScoreScale:
        """Before the first frame."""
        return cls(-math.inf, np.zeros((len(CATEGORIES), _BINS)), np.ones(len(CATEGORIES)))

    def after(self, stamp_s: float, code: IntArray, score: FloatArray) -> ScoreScale:
        """With one more frame, if it is time to count one.

        Args:
            stamp_s: Time of the frame.
            code: (N,) positions in CATEGORIES.
            score: (N,) scores in [0, 1].
        """
        if not stamp_s - self.counted_s >= COUNT_INTERVAL_S - _ROUNDING_S or not len(score):
            return self
        mass = self.mass + _mass(code, score)
        return unchecked(ScoreScale, stamp_s, mass, _references(mass, PRIOR_DETECTIONS))


_ROUNDING_S = 1e-6
"""Stamps in seconds since 1970 carry 2.4e-7 s of rounding."""


def reference_scores(code: IntArray, score: FloatArray) -> FloatArray:
    """Reference score of each category from all detections of a recording, without the online assumption.

    Args:
        code: (N,) positions in CATEGORIES.
        score: (N,) scores in [0, 1].

    Returns:
        (C,) scores in (0, 1]; 1 for a category without detections.
    """
    return _references(_mass(code, score), 0.0)


def _mass(code: IntArray, score: FloatArray) -> FloatArray:
    """(C, B) sums of scores by category and bin."""
    place = np.searchsorted(_UPPER, score) + code * _BINS
    mass = np.bincount(place, score, len(CATEGORIES) * _BINS).astype(np.float64)
    return mass.reshape(-1, _BINS)


def _references(mass: FloatArray, prior: float) -> FloatArray:
    """(C,) weighted quantiles, mixed with `prior` detections of score 1."""
    running = mass.cumsum(axis=1)
    total = running[:, -1]
    quantile = _UPPER.take((running >= REFERENCE_QUANTILE * total[:, None]).argmax(axis=1))
    # as many sure detections have that sum; scores compare by their ratio, so the mean is the geometric one
    count = total / quantile
    share = np.divide(count, count + prior, out=np.zeros(len(CATEGORIES)), where=count > 0.0)
    reference: FloatArray = np.minimum(quantile**share, 1.0)
    return reference
