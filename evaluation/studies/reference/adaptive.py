"""Parts of the reference results that ask whether an area that adapts beats every fence."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evaluation.studies.answers.gain import Gain
from evaluation.studies.answers.lidar.question import lidar
from evaluation.studies.answers.rivals import ADAPTIVE, PATH
from evaluation.studies.answers.severity import Severity
from evaluation.studies.answers.study import Sample
from evaluation.studies.answers.tune import Tuning
from evaluation.studies.answers.tuned import TUNED, read_tuned

FOLDER = "adaptive"
MARGINS_M = (0.0, 0.9, 3.0, 5.0)
"""Beside the paper's 1.8 m and the tuned one: the ends of what is tried in tuning, and between."""

UNUSED_SEED = 3
"""Of scenes: the area was designed on training scenes of seed 0, shown on test scenes of seeds 1 and 2."""


@dataclass(frozen=True, slots=True)
class AdaptiveTuning(Tuning):
    """Settings of every fair rival and of the adaptive area, with the same number of trials."""

    name = f"{FOLDER}/tune"


@dataclass(frozen=True, slots=True)
class AdaptiveGain(Gain):
    """Every rival against the adaptive area, on scenes that were not used before."""

    name = f"{FOLDER}/gain"

    def given(self, out: Path) -> AdaptiveGain:
        """With what was chosen on the training scenes."""
        return replace(self, tuned=read_tuned(out / AdaptiveTuning.name / TUNED, self.sample))


@dataclass(frozen=True, slots=True)
class AdaptiveLidarGain(AdaptiveGain):
    """The same with detections from a LiDAR's clouds, on furnished streets."""

    name = f"{FOLDER}/lidar"


@dataclass(frozen=True, slots=True)
class FollowedSeverity(Severity):
    """What stops cost, with a car of SUMO behind the ego; made by hand, since it needs the extra `sumo`."""

    name = "behind"


BEHIND = FollowedSeverity(
    Sample(count=60, seed=2), ("png",), rules=("paper", "staged"), areas=(PATH, ADAPTIVE), followers=1
)
BEHIND_COMMAND = (
    "smartmot-eval study severity --followers 1 --seed 2 --count 60 --rule paper,staged "
    "--strategies path,adaptive"
)
"""What makes its runs; its folder of answers is kept as `reports/behind`."""


def adaptive_parts(
    formats: Sequence[str],
) -> tuple[AdaptiveTuning, AdaptiveGain, AdaptiveLidarGain, Severity]:
    """The parts, in the order in which they are made."""
    named = tuple(formats)
    own = (ADAPTIVE.name,)
    return (
        AdaptiveTuning(Sample("train", 60), named, preset="real", own=own, trials=8),
        AdaptiveGain(
            Sample(count=150, seed=UNUSED_SEED), named, presets=("real",), own=own, against=ADAPTIVE.name,
            varied=(("margin_m", MARGINS_M),),
        ),
        AdaptiveLidarGain(
            Sample(count=20, seed=UNUSED_SEED), named, lidar("hdl32", "classical"), presets=("real",),
            own=own, against=ADAPTIVE.name,
        ),
        Severity(Sample(count=60, seed=2), named),
    )  # fmt: skip
