"""Settings of the tracker; `smartmot.tracking.configs` has named ones."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from smartmot.errors import ConfigError
from smartmot.filters.box_filter import Motion
from smartmot.filters.existence import ExistenceConfig
from smartmot.filters.kalman import BevFilterConfig
from smartmot.filters.motion_models import (
    ConstantVelocity,
    PerCategory,
    Setting,
    check_range,
    table,
)
from smartmot.tracking.association import AssociationConfig
from smartmot.tracking.lifecycle import LifecycleConfig
from smartmot.types import CATEGORIES, Detections, FloatArray, IntArray, StrArray

CODES = {name: code for code, name in enumerate(CATEGORIES)}
"""Position of each name in CATEGORIES."""


_SECOND_LETTERS = np.zeros(128, dtype=np.int64)
_SECOND_LETTERS[[ord(name[1]) for name in CATEGORIES]] = np.arange(len(CATEGORIES))
"""Categories differ in their second letter: so many names are looked up at once."""


def codes(names: StrArray) -> IntArray:
    """(N,) positions in CATEGORIES of names out of them."""
    if len(names) == 0:
        return np.zeros(0, dtype=np.int64)
    letters = np.ascontiguousarray(names).view(np.uint32).reshape(len(names), -1)
    return _SECOND_LETTERS.take(letters[:, 1])


@dataclass(frozen=True, slots=True, eq=False)
class ScoreLimits:
    """Which scores a tracker takes, by category in the order of `smartmot.types.CATEGORIES`.

    Args:
        drop: (C,) detections under it are dropped.
        start: (C,) a detection under it can start no track that is returned.
    """

    drop: FloatArray
    start: FloatArray
    highest: float = field(init=False)
    """A score as high as that is taken in every category."""

    def __post_init__(self) -> None:
        object.__setattr__(self, "highest", max(*self.drop.tolist(), *self.start.tolist()))

    def counts(self, detections: Detections) -> tuple[int, int]:
        """How many detections are dropped, and how many can start a track."""
        score = detections.score
        if not len(score):
            return 0, 0
        if min(score.tolist()) >= self.highest:
            return 0, len(score)
        code = codes(detections.category)
        dropped = np.count_nonzero(score < self.drop.take(code))
        return int(dropped), int(np.count_nonzero(score >= self.start.take(code)))


@dataclass(frozen=True, slots=True)
class ReportConfig:
    """Which of the tracks alive are returned, and with which boxes.

    Args:
        detected_boxes: A matched track has the box of its detection, not the filtered one. A detector's box
            has no lag; the filtered one has less noise.
        tentative: Tracks not yet confirmed are returned as well.
        coasted_s: Time without a match up to which a track is returned. None: until it dies.
        score: Tracks whose last detection had a lower score are not returned.
        mean_score: Tracks whose detections so far had a lower mean score are not returned.
        existence: Tracks that exist with a lower probability are not returned; needs
            `TrackerConfig.existence`.

    Raises:
        ConfigError: A value is outside its range.
    """

    detected_boxes: bool = False
    tentative: bool = True
    coasted_s: Setting | None = None
    score: Setting = 0.0
    mean_score: Setting = 0.0
    existence: Setting = 0.0

    def __post_init__(self) -> None:
        if self.coasted_s is not None:
            check_range(self, "coasted_s", 0.0, math.inf)
        check_range(self, "score", 0.0, 1.0)
        check_range(self, "mean_score", 0.0, 1.0)
        check_range(self, "existence", 0.0, 1.0)


@dataclass(frozen=True, slots=True)
class TrackerConfig:
    """All settings of the tracker. `smartmot.tracker_config` has named ones.

    Args:
        motion: Motion model and its noise; any `smartmot.filters.filterpy_adapter.FilterpyMotion`, too.
        filter: Measurement noise and initial uncertainty.
        association: Costs and gates of a match.
        lifecycle: Birth, confirmation and deletion.
        report: Which tracks are returned, and with which boxes.
        score_threshold: Detections below it are dropped. Source: paper, 0.3.
        second_stage_score: Detections below it may only have the tracks that the others left, and start none
            (two-stage association of the ByteTrack family). 0: one stage.
        dynamic_speed_mps: A faster track is dynamic. Source: paper, 0.5 with the map and 1.0 without.
        dynamic_sigmas: Besides, its speed must be this many standard deviations from zero, so that position
            noise does not set a standing object moving; 0 leaves the paper's plain threshold. At 2.5 noise
            passes in 4 % of the frames after birth and hardly ever once the track has settled.
        outlier_speed_mps: A faster estimate is rejected: the track counts as static with velocity 0 in that
            frame. Source: paper, 15 m/s, written for pedestrians and town traffic. Vehicles on the
            scenarios' motorways are faster, so theirs is 60 m/s.
        score_reference: What all thresholds on scores are multiplied by: the score that a sure detection has,
            see `smartmot.tracking.scores`. 1: the thresholds are scores. None: estimated from the detections
            so far.
        evidence_memory_s: The category of a track is the one with most evidence, the scores of its
            detections, which fades over this time, as the evidence for its heading does. None: the category
            is that of the first detection for ever, and heading "evidence" is refused.
        existence: What the probability that a track's object exists is estimated from. None: it is not.
        merge_duplicates: A detection without a track whose centre lies in the box of one that has a track
            starts none, nor one whose centre lies in that of another with a higher score.

    Raises:
        ConfigError: A value is outside its range.
    """

    motion: Motion = field(default_factory=ConstantVelocity)
    filter: BevFilterConfig = field(default_factory=BevFilterConfig)
    association: AssociationConfig = field(default_factory=AssociationConfig)
    lifecycle: LifecycleConfig = field(default_factory=LifecycleConfig)
    report: ReportConfig = field(default_factory=ReportConfig)
    score_threshold: Setting = 0.3
    second_stage_score: Setting = 0.0
    dynamic_speed_mps: Setting = 0.5
    dynamic_sigmas: float = 2.5
    outlier_speed_mps: Setting = field(
        default=PerCategory(60.0, pedestrian=15.0, cyclist=25.0, truck=60.0, motorcycle=60.0, unknown=60.0)
    )

    score_reference: Setting | None = 1.0
    evidence_memory_s: float | None = None
    merge_duplicates: bool = False
    existence: ExistenceConfig | None = None

    def __post_init__(self) -> None:
        if self.score_reference is not None:
            check_range(self, "score_reference", 1e-9, 1.0)
        if self.evidence_memory_s is not None:
            check_range(self, "evidence_memory_s", 1e-9, math.inf)
        elif self.filter.heading == "evidence":
            raise ConfigError('TrackerConfig: heading "evidence" needs evidence_memory_s')
        if self.existence is None and table(self.report.existence).any():
            raise ConfigError("TrackerConfig: report.existence needs existence, an ExistenceConfig")
        check_range(self, "score_threshold", 0.0, 1.0)
        check_range(self, "second_stage_score", 0.0, 1.0)
        check_range(self, "dynamic_speed_mps", 0.0, 10.0)
        check_range(self, "dynamic_sigmas", 0.0, 10.0)
        check_range(self, "outlier_speed_mps", 1e-9, math.inf)

    @classmethod
    def paper(cls, *, with_map: bool = True) -> TrackerConfig:
        """The paper's filter noise, matching and thresholds, in physical units.

        Args:
            with_map: The dynamic threshold is 0.5 m/s with the map and 1.0 m/s without.
        """
        return cls(
            motion=ConstantVelocity.paper(),
            filter=BevFilterConfig.paper(),
            association=AssociationConfig(gate_probability=0.0),
            dynamic_speed_mps=0.5 if with_map else 1.0,
            dynamic_sigmas=0.0,
            outlier_speed_mps=15.0,
        )

    def score_limits(self) -> ScoreLimits:
        """Scores that a tracker with these settings asks for; 0 where they follow from the detections."""
        if self.score_reference is None:
            return ScoreLimits(np.zeros(len(CATEGORIES)), np.zeros(len(CATEGORIES)))
        drop = table(self.score_threshold)
        least = [
            self.second_stage_score,
            self.lifecycle.birth_score,
            self.report.score,
            self.report.mean_score,
        ]
        reference = table(self.score_reference)
        return ScoreLimits(drop * reference, np.max([drop, *map(table, least)], axis=0) * reference)
