"""What the tracker works on during one frame: detections, tracks, thresholds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmot.filters.kalman import Estimate
from smartmot.filters.motion_models import Setting, table
from smartmot.tracking.scores import ScoreScale
from smartmot.tracking.settings import TrackerConfig
from smartmot.types import Boxes, FloatArray, IntArray

COASTED = -1
"""In place of a detection's position: the track had none in this frame."""


@dataclass(slots=True, eq=False)
class Limits:
    """(C,) thresholds on scores, None where everything passes; see `TrackerConfig` for what they mean."""

    reference: FloatArray
    drop: FloatArray | None
    first: FloatArray | None
    birth: FloatArray | None
    score: FloatArray | None
    mean_score: FloatArray | None


@dataclass(slots=True, eq=False)
class Measured:
    """The frame's detections over the score threshold, as the filter takes them: N rows each.

    `limits` are the thresholds of the frame, `scores` the score scale that they follow from. Scores are
    already multiplied by `trust`, which says how much each counts in a mean.
    """

    stamp_s: float
    boxes: Boxes
    score: FloatArray
    code: IntArray
    measurement: FloatArray
    velocity_mps: FloatArray | None
    limits: Limits
    scores: ScoreScale | None
    pose_covariance: FloatArray | None = None
    trust: float = 1.0

    @property
    def shares_noise(self) -> bool:
        """Whether noise along x and along y is stated to have something in common."""
        noise = self.pose_covariance
        return noise is not None and bool(np.nan_to_num(noise[:, 0, 1]).any())

    def own(self, detection: IntArray) -> tuple[FloatArray | None, FloatArray | None]:
        """Measured velocities (K, 2) and stated noise (K, 3, 3) of some of the detections; None: of none."""
        velocity, noise = self.velocity_mps, self.pose_covariance
        return (
            None if velocity is None else velocity[detection],
            None if noise is None else noise[detection],
        )


@dataclass(slots=True, eq=False)
class Frame:
    """M tracks while a frame is worked on: rows and filter states, and the detection each track has.

    `coasting` says whether a track is without detection, `all_confirmed` whether none is tentative, `born`
    counts the tracks of this frame, `merged` the detections that repeat another. Most frames bring no births,
    and in many nothing coasts: what that rules out is not computed. `estimate` is what the corrected filter
    states say, if somebody has asked, as `speed_variance` is. `found` are the matched tracks and how much
    likelier their detections are if the objects exist.
    """

    rows: FloatArray
    filtered: FloatArray
    code: IntArray
    source: IntArray
    coasting: bool = True
    all_confirmed: bool = False
    born: int = 0
    merged: int = 0
    estimate: Estimate | None = None
    speed_variance: FloatArray | None = None
    found: tuple[IntArray, FloatArray] | None = None


def limits_of(config: TrackerConfig) -> Limits:
    """Thresholds on scores where sure detections have the score 1."""

    def threshold(setting: Setting, least: Setting = 0.0) -> FloatArray | None:
        values = np.maximum(table(setting), table(least))
        return values if values.any() else None

    return Limits(
        reference=table(1.0),
        drop=threshold(config.score_threshold),
        first=threshold(config.second_stage_score),
        birth=threshold(config.lifecycle.birth_score, config.second_stage_score),
        score=threshold(config.report.score),
        mean_score=threshold(config.report.mean_score),
    )


def scaled(limits: Limits, reference: FloatArray) -> Limits:
    """The thresholds of `limits_of` for (C,) reference scores."""
    thresholds = (limits.drop, limits.first, limits.birth, limits.score, limits.mean_score)
    return Limits(reference, *(None if values is None else values * reference for values in thresholds))
