"""Finished runs of all arms over the same scenes, and what they differ by."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from evaluation.metrics.intervals import (
    NO_SAMPLE,
    Estimate,
    clustered_difference,
    mean_t,
    median,
    sign_test,
    wilson,
)
from evaluation.metrics.power import POWER, holm, least_difference
from evaluation.results.gates import Side
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import DECISIVE, MEASURES, Decision
from scenarios.scenes.scenes import SceneRun
from smartmot.types import FloatArray

LEVEL = 0.05
"""Probability of seeing a difference in any question where there is none."""
DISCORDANT = (0.05, 0.1, 0.2)
"""Shares of scenes in which two sides differ, for which the power is stated before the runs; assumed."""


@dataclass(frozen=True, slots=True, eq=False)
class Results:
    """Finished runs.

    Args:
        scenes: independent of one another.
        runs: of each arm, in the order of the scenes.
    """

    scenes: tuple[SceneRun, ...]
    runs: Mapping[Arm, tuple[Decision, ...]]

    def values(self, arm: Arm, measure: str) -> FloatArray:
        """(S,) a measure in each scene; NaN where it has no meaning, or the run was cut off."""
        compared = MEASURES[measure]
        values = [
            compared.value(run) if scene.must == compared.must and not run.cut_off else None
            for scene, run in zip(self.scenes, self.runs[arm], strict=True)
        ]
        return np.array([math.nan if value is None else float(value) for value in values])

    def estimate(self, arm: Arm, measure: str) -> Estimate:
        """Rate with Wilson's interval, or mean with Student's, over the scenes; if partial, the median."""
        values = self.values(arm, measure)
        if MEASURES[measure].partial:
            return median(values)
        if MEASURES[measure].unit:
            return mean_t(values)
        outcomes = values[~np.isnan(values)]
        return wilson(int(outcomes.sum()), len(outcomes))


@dataclass(frozen=True, slots=True)
class Difference:
    """A measure of an arm less that of another in the same scenes.

    Args:
        arm, against: what is compared.
        measure: name of what is measured.
        estimate: mean difference, with its interval.
        more, fewer: scenes in which the arm has more of it, and less.
        p_value: of McNemar's exact test over these scenes.
        adjusted: the same corrected for the number of questions (Holm); NaN if it was not asked for.
    """

    arm: Arm
    against: Arm
    measure: str
    estimate: Estimate
    more: int
    fewer: int
    p_value: float
    adjusted: float = math.nan

    @property
    def is_decided(self) -> bool:
        """Whether the difference is seen in spite of the number of questions."""
        return self.adjusted <= LEVEL


def difference(results: Results, arm: Arm, against: Arm, measure: str) -> Difference:
    """Paired difference of two arms: of rates with Tango's interval, of means with Student's."""
    changes = results.values(arm, measure) - results.values(against, measure)
    paired = np.flatnonzero(~np.isnan(changes))
    kept = changes[paired].tolist()
    more, fewer = sum(change > 0 for change in kept), sum(change < 0 for change in kept)
    estimate = mean_t(kept) if MEASURES[measure].unit else clustered_difference(kept, paired.tolist())
    return Difference(arm, against, measure, estimate, more, fewer, sign_test(more, fewer))


def decisive_differences(results: Results, pairs: Sequence[tuple[Arm, Arm]]) -> list[Difference]:
    """Differences in what questions are decided by, corrected for their number."""
    made = [difference(results, *pair, measure) for pair in pairs for measure in DECISIVE]
    adjusted = holm([d.p_value for d in made])
    return [replace(d, adjusted=p) for d, p in zip(made, adjusted, strict=True)]


def benefit(avoided: Estimate, stops: Estimate) -> Estimate:
    """Collisions avoided per must-brake scene less unnecessary stops per nothing scene.

    One weighs as much as the other: a yardstick for curves, and no trade-off of lives against comfort. The
    two kinds of scenes are independent, so that their intervals add in squares: G. Y. Zou and A. Donner,
    Stat. Med. 27 (2008) 1693.

    Args:
        avoided: rate, or difference of rates.
        stops: the same.
    """
    if not avoided.count or not stops.count:
        return NO_SAMPLE
    value = avoided.value - stops.value
    low = math.hypot(avoided.value - avoided.low, stops.high - stops.value)
    high = math.hypot(avoided.high - avoided.value, stops.value - stops.low)
    return Estimate(value, value - low, value + high, avoided.count + stops.count)


def benefit_difference(results: Results, arm: Arm, against: Arm) -> Estimate:
    """What an arm gains over another; see `benefit`."""
    avoided, stops = (difference(results, arm, against, measure).estimate for measure in DECISIVE)
    return benefit(avoided, stops)


def power_lines(scenes: Sequence[SceneRun], questions: int) -> list[str]:
    """Which differences these scenes can decide, said before the runs.

    Args:
        scenes: of both kinds.
        questions: how many differences are asked for.
    """
    if not questions:
        return []
    lines = []
    for must, name in (("brake", "must-brake"), ("nothing", "nothing")):
        count = sum(scene.must == must for scene in scenes)
        if not count:
            continue
        least = {share: least_difference(count, share, LEVEL / questions) for share in DISCORDANT}
        parts = [
            f"above {100 * size:.1f} points if {100 * share:g} % are discordant"
            for share, size in least.items()
            if not math.isnan(size)
        ]
        few = f"none if {100 * max(DISCORDANT):g} % or fewer are discordant"
        lines.append(
            f"{count} {name} scenes decide differences with {100 * POWER:g} % power at {100 * LEVEL:g} % "
            f"corrected for {questions} questions: {', '.join(parts) or few}."
        )
    return lines


STUDY_MEASURES = (*MEASURES, "cut_off", "scenes")
"""Of a side over its scenes, for gates; docs/gates.md has their meaning."""


def sides_of_results(results: Results) -> list[Side]:
    """What each side came to, with the scenes that ended badly."""
    sides = []
    for arm, runs in results.runs.items():
        named = list(zip((scene.name for scene in results.scenes), runs, strict=True))
        nothing = {scene.name for scene in results.scenes if scene.must == "nothing"}
        counted = {
            "avoided": [name for name, run in named if name not in nothing and not run.avoided],
            "stops": [name for name, run in named if name in nothing and run.unnecessary_stop],
            "early": [name for name, run in named if name not in nothing and run.false_activation],
            "cut_off": [name for name, run in named if run.cut_off],
        }
        values: dict[str, float | None] = {name: results.estimate(arm, name).value for name in MEASURES}
        values |= {"cut_off": float(len(counted["cut_off"])), "scenes": float(len(named))}
        detail = ", ".join((arm.preset, arm.text))
        sides.append(Side(arm.name, values, detail, counted))
    return sides
