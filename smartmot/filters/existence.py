"""Probability that the object of a track exists: integrated probabilistic data association.

Source: Musicki, Evans, Stankovic, "Integrated probabilistic data association", IEEE Trans. Automatic Control
39 (6), 1994, the Markov chain of one ("exists or not"), here with the one detection that the association
chose. That is by 1 - P_D + P_D g(v) / clutter density likelier if the object exists, g being the normal
density of the innovation v and P_D the detection probability; a look without detection is likelier by
1 - P_D.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.filters.motion_models import Setting, check_range, table
from smartmot.types import FloatArray, IntArray

_CERTAIN = 1e-9
"""No setting is surer: from 0 or 1 no evidence leads back."""

# Arrays of no dimension: NumPy would make them of numbers anew in every call.
_ONE, _MINUS_HALF = np.array(1.0), np.array(-0.5)

_FEW = 8
"""Up to so many tracks are looked at faster one by one than as arrays."""

_STEPS = 32
"""Time steps whose survival is remembered, as in `smartmot.filters.channels`."""


@dataclass(frozen=True, slots=True)
class ExistenceConfig:
    """What is taken for known of detector and objects.

    Args:
        detection_probability: Of an object that exists, in one frame.
        clutter_per_m2: False detections of the category in one frame, per square metre.
        initial: Probability of a new track: the share of true ones among detections without a track.
        mean_life_s: Mean time until an object leaves. Source: the paper's survival of 0.98 per second.

    Raises:
        ConfigError: A value is outside its range.
    """

    # assumed: 9 of 10 objects seen; one false detection in 100 m x 100 m; births as often true as false
    detection_probability: Setting = 0.9
    clutter_per_m2: Setting = 1e-4
    initial: Setting = 0.5
    mean_life_s: Setting = 50.0

    def __post_init__(self) -> None:
        for name in ("detection_probability", "initial"):
            check_range(self, name, _CERTAIN, 1.0 - _CERTAIN)
        for name in ("clutter_per_m2", "mean_life_s"):
            check_range(self, name, 1e-12, math.inf)


class Existence:
    """The probabilities of M tracks at a time.

    Args:
        config: What is known.
        position_variance_m2: (C,) configured variance of a measured position along each axis.
    """

    def __init__(self, config: ExistenceConfig, position_variance_m2: FloatArray) -> None:
        self._seen = table(config.detection_probability)
        self._missed = 1.0 - self._seen
        # P_D g / clutter: all that does not depend on the innovation
        self._found = self._seen / (2.0 * math.pi * table(config.clutter_per_m2))
        self._initial, self._rate_ps = table(config.initial), 1.0 / table(config.mean_life_s)
        self._tables = np.column_stack((self._missed, self._found, position_variance_m2))
        self._rows = self._tables.tolist()
        self._survival: dict[float, FloatArray] = {}

    def initial(self, code: IntArray) -> FloatArray:
        """(N,) of new tracks; `code` holds positions in CATEGORIES."""
        return self._initial.take(code)

    def missed(self, code: IntArray) -> FloatArray:
        """(M,) how much likelier a look without detection is if the object exists."""
        return self._missed.take(code)

    def found(
        self,
        offset_m: FloatArray,
        covariance: tuple[FloatArray, FloatArray, FloatArray],
        code: IntArray,
        pose_covariance: FloatArray | None,
    ) -> FloatArray:
        """How much likelier detections are if the objects exist.

        Args:
            offset_m: (K, 2) from the predicted centres to the detections.
            covariance: Predicted variances (K,) of the position along x and y, and their covariance.
            code: (K,) positions in CATEGORIES.
            pose_covariance: (K, 3, 3) noise that the detections state, NaN where they state none.
        """
        if pose_covariance is None and len(code) <= _FEW:
            return self._few_found(offset_m, covariance, code)
        xx, yy, xy = covariance
        missed, density, noise = self._tables.take(code, axis=0).T
        if pose_covariance is not None:
            own = np.isfinite(pose_covariance[:, 0, 0])
            xx = xx + np.where(own, pose_covariance[:, 0, 0], noise)
            yy = yy + np.where(own, pose_covariance[:, 1, 1], noise)
            xy = xy + np.where(own, pose_covariance[:, 0, 1], 0.0)
        else:
            xx, yy = xx + noise, yy + noise
        dx, dy = offset_m[:, 0], offset_m[:, 1]
        determinant = xx * yy
        squared = yy * (dx * dx)
        squared += xx * (dy * dy)
        if np.count_nonzero(xy):
            determinant -= xy * xy
            squared -= 2.0 * xy * dx * dy
        # half the normalised innovation squared, with the inverse of the 2 x 2 covariance written out
        squared /= determinant
        squared *= _MINUS_HALF
        ratio: FloatArray = np.exp(squared, out=squared)
        ratio /= np.sqrt(determinant)
        ratio *= density
        ratio += missed
        return ratio

    def _few_found(
        self, offset_m: FloatArray, covariance: tuple[FloatArray, FloatArray, FloatArray], code: IntArray
    ) -> FloatArray:
        """`found` without arrays, by the configured noise."""
        ratio = []
        rows = zip(offset_m.tolist(), *(part.tolist() for part in covariance), code.tolist(), strict=True)
        for (dx, dy), xx, yy, xy, of in rows:
            missed, density, noise = self._rows[of]
            xx, yy = xx + noise, yy + noise
            determinant = xx * yy - xy * xy
            squared = (yy * (dx * dx) + xx * (dy * dy) - 2.0 * xy * dx * dy) / determinant
            ratio.append(math.exp(-0.5 * squared) / math.sqrt(determinant) * density + missed)
        return np.array(ratio)

    def after(self, existence: FloatArray, ratio: FloatArray, code: IntArray, dt_s: float) -> FloatArray:
        """(M,) probabilities after time has passed and a look was taken.

        Args:
            existence: (M,) before.
            ratio: (M,) from `found` or `missed`.
            code: (M,) positions in CATEGORIES.
            dt_s: Time since the look before.
        """
        survival = self._survival.get(dt_s)
        if survival is None:
            if len(self._survival) == _STEPS:
                self._survival.clear()
            survival = self._survival[dt_s] = np.exp(-dt_s * self._rate_ps)
        prior = survival.take(code)
        prior *= existence
        unknown = np.isnan(prior)
        if np.count_nonzero(unknown):
            # of tracks that a state without existence holds nothing is known yet
            prior = np.where(unknown, self._initial.take(code) * survival.take(code), prior)
        likely = ratio * prior
        # prior < 1 after any time: a miss lowers every probability
        odds = _ONE - prior
        odds += likely
        likely /= odds
        return likely
