"""Detections of one of several detectors on a common scale: scores by its own, noise by its profile."""

from __future__ import annotations

import numpy as np

from smartmot.tracking.profile import DetectorProfile
from smartmot.tracking.scores import ScoreScale
from smartmot.tracking.settings import CODES
from smartmot.types import CATEGORIES, Detections, FloatArray, IntArray, unchecked


class Weighing:
    """What the detections of a detector count.

    A score becomes the share of the score that a sure detection of the detector has, at most 1, times the
    detector's trust. Where the profile does not know a category's score, it is estimated from the detections
    so far.

    Args:
        profile: The detector; None: nothing is known of it.
    """

    def __init__(self, profile: DetectorProfile | None) -> None:
        categories = {} if profile is None else profile.categories
        self.trust = 1.0 if profile is None else profile.trust
        self.delay_s = 0.0 if profile is None else profile.delay_s
        known = {name: each.reference_score for name, each in categories.items()}
        noise = {name: each.position_sigma_m for name, each in categories.items()}
        self._reference = np.array([known.get(name, np.nan) for name in CATEGORIES])
        self._variance = np.array([(noise.get(name) or np.nan) ** 2 for name in CATEGORIES])
        self._estimates = bool(np.isnan(self._reference).any())
        self._states = bool(np.isfinite(self._variance).any())

    def weighed(
        self, detections: Detections, scale: ScoreScale | None
    ) -> tuple[Detections, ScoreScale | None]:
        """Detections for the common tracker, and the detector's score scale after them.

        Args:
            detections: As the detector reports them.
            scale: The detector's score scale before; None: nothing was seen of it.
        """
        code = np.array([CODES[name] for name in detections.category.tolist()], dtype=np.int64)
        reference = self._reference
        if self._estimates:
            scale = (ScoreScale.empty() if scale is None else scale).after(
                detections.stamp_s, code, detections.score
            )
            reference = np.where(np.isnan(reference), scale.reference, reference)
        score = self.trust * np.minimum(detections.score / reference.take(code), 1.0)
        return unchecked(
            Detections,
            detections.stamp_s,
            detections.boxes,
            score,
            detections.category,
            detections.velocity_mps,
            detections.dropped,
            self._noise(detections, code),
            detections.detector,
        ), scale

    def _noise(self, detections: Detections, code: IntArray) -> FloatArray | None:
        """(N, 3, 3) noise: each detection's own, else that of the profile; None: of none."""
        stated = detections.pose_covariance
        if not self._states:
            return stated
        noise = np.full((len(code), 3, 3), np.nan) if stated is None else stated.copy()
        silent = np.isnan(noise[:, :2, :2]).any(axis=(1, 2))
        variance = self._variance.take(code)[silent]
        noise[silent, :2, :2] = variance[:, None, None] * np.eye(2)
        return noise
