"""What does a lane filter gain over what any planner knows?"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.studies.answers import figures
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import DECISIVE
from evaluation.studies.answers.results import (
    Difference,
    Results,
    benefit_difference,
    decisive_differences,
)
from evaluation.studies.answers.rivals import MAP, PATH, Rival, rivals, varied
from evaluation.studies.answers.study import Answer, Question
from evaluation.studies.answers.tables import (
    arms_table,
    differences_csv,
    differences_table,
    estimates_csv,
    points_text,
    rates_table,
    verdict,
)
from evaluation.studies.answers.tuned import (
    BY_TUNING,
    Tuned,
    given_tuned,
    told_unchanged,
    tuned_arm,
    unchanged_table,
)
from scenarios.presets import Preset
from scenarios.settings import Setting

NOTES = (
    "Scenes are drawn independently and are the sample; in each, all sides meet the same sensor noise.",
    "A collision counts as avoided only if the ego had not braked before the target set off.",
    "A difference is called decided if McNemar's exact test sees it at 5 %, corrected for all questions "
    "of the "
    "study by Holm's method. Where it is not, the interval says how large it may be.",
    "How often scenes of either kind happen on the road is not known here: what a stop weighs against a "
    "collision is left to you.",
    "Sources of the methods: docs/answers.md.",
)


@dataclass(frozen=True, slots=True)
class Gain(Question):
    """Every rival against the planned path, by preset and brake rule.

    Args:
        presets: conditions.
        rules: brake rules.
        own: strategies of the user's own.
        tuned: settings that were chosen for a strategy and rule on other scenes (see `Tuning`), in place of
            the rivals' own; both are run.
        against: name of the rival that all others are compared with, tuned where it was: the planned path, or
            what is to be shown better than all. Then rivals as published, which differ in more than the
            area, are left out.
        varied: values of parameters, each of which makes a further rival of every area that it changes.

    Raises:
        ArgumentError: settings were chosen for no strategy that is run, or for none of the rules; what is
            compared with is not run, or no area has a parameter.
    """

    presets: tuple[str, ...] = ("physical",)
    rules: tuple[str, ...] = ("paper",)
    own: tuple[str, ...] = ()
    tuned: Tuned = ()
    against: str = PATH.name
    varied: tuple[tuple[str, tuple[Setting, ...]], ...] = ()
    name = "gain"

    def __post_init__(self) -> None:
        names = [rival.name for rival in self.rivals]
        if self.against not in names:
            raise ArgumentError(f"--against: {self.against} is not run; there are: {', '.join(names)}")
        if absent := [name for name, _, _ in self.tuned if name not in names]:
            raise ArgumentError(f"--tuned: settings of {', '.join(absent)}, which is not run")
        if self.tuned and not any(rule in self.rules for _, rule, _ in self.tuned):
            chosen = ", ".join(dict.fromkeys(rule for _, rule, _ in self.tuned))
            raise ArgumentError(f"--tuned: settings for rule {chosen} alone; give it with --rule")

    def given(self, out: Path) -> Gain:
        """With what was chosen in the same folder."""
        return replace(self, tuned=given_tuned(out, self.sample))

    @property
    def rivals(self) -> list[Rival]:
        """Who takes part, by name each once."""
        run = [rival for rival in rivals(self.own) if not rival.is_as_published or self.against == PATH.name]
        return [*run, *(rival for name, values in self.varied for rival in varied(run, name, values))]

    @property
    def groups(self) -> dict[tuple[str, str], list[Arm]]:
        """The arms by preset and rule, each once: a varied value may be the one that there is anyway."""
        groups = {}
        for preset, rule in itertools.product(self.presets, self.rules):
            arms = [arm for rival in self.rivals for arm in self._sides(rival, preset, rule)]
            # the same runs would be counted twice, and each question more makes the correction stricter
            first: dict[tuple[str, Preset], Arm] = {}
            for arm in arms:
                first.setdefault((arm.strategy, arm.conditions), arm)
            groups[preset, rule] = list(first.values())
        return groups

    def _sides(self, rival: Rival, preset: str, rule: str) -> list[Arm]:
        """A rival as it is, and tuned where it was; what is the paper's as published has the paper's rule."""
        if rival.is_as_published and rule != "paper":
            return []
        arm = rival.arm(preset, rule)
        tuned = tuned_arm(arm, self.tuned)
        return [arm] if tuned in (None, arm) else [arm, tuned]

    @property
    def unchanged(self) -> list[Arm]:
        """Arms for which tuning found nothing better."""
        return [arm for arm in self.arms if tuned_arm(arm, self.tuned) == arm]

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All of them, each once."""
        return tuple(dict.fromkeys(arm for group in self.groups.values() for arm in group))

    @property
    def pairs(self) -> list[tuple[Arm, Arm]]:
        """Every arm against the planned path, tuned ones against the tuned path; or all against another."""
        pairs = []
        for group in self.groups.values():
            plain = next(arm for arm in group if arm.name == self.against)
            tuned = next((arm for arm in group if arm.name == f"{self.against}{BY_TUNING}"), plain)
            if self.against != PATH.name:
                pairs += [(arm, tuned) for arm in group if arm not in (plain, tuned)]
                continue
            for arm in group[1:]:
                pairs.append((arm, tuned if arm.name.endswith(BY_TUNING) and arm is not tuned else plain))
        return pairs

    @property
    def questions(self) -> int:
        """Differences that are tested."""
        return len(self.pairs) * len(DECISIVE)

    @property
    def _against(self) -> str:
        return "the planned path" if self.against == PATH.name else self.against

    def answer(self, results: Results) -> Answer:
        """The gain of each rival, that of the map first; before them how `against` stands among all."""
        differences = decisive_differences(results, self.pairs)
        tables, drawn = {}, {}
        for (preset, rule), arms in self.groups.items():
            own = [d for d in differences if d.arm in arms]
            where = f"preset {preset}, rule {rule}"
            more = told_unchanged([arm for arm in self.unchanged if arm in arms])
            tables[f"Against {self._against}: {where}"] = differences_table(own, len(differences), more)
            tables[f"Each by itself: {where}"] = rates_table(results, arms)
            drawn[f"gain_{preset}_{rule}".replace(":", ".")] = figures.gain(own, self._against, where)
        named = [replace(arm, settings=tuple(s for s in arm.settings if s[0] != "rule")) for arm in self.arms]
        tables["Who is who"] = unchanged_table(self.unchanged, arms_table(named))
        files = {"gain.csv": differences_csv(differences), "table.csv": estimates_csv(results)}
        sentences = findings(results, differences)
        if self.against != PATH.name:
            sentences = [*standings(results, differences), *sentences]
        return Answer(
            "What does a lane filter gain over what any planner knows?",
            sentences,
            tables,
            drawn,
            files,
            NOTES,
        )


def findings(results: Results, differences: Sequence[Difference]) -> list[str]:
    """The answer in sentences: the map filter against the planned path first, then the others."""
    groups: dict[tuple[Arm, Arm], list[Difference]] = {}
    for d in differences:
        groups.setdefault((d.arm, d.against), []).append(d)
    ranked = sorted(
        groups, key=lambda pair: pair[0].name != MAP.name
    )  # stable: else in the order of the arms
    lines = []
    for arm, against in ranked:
        gained = points_text(benefit_difference(results, arm, against))
        where = f"Preset {arm.preset}, rule {arm.rule}"
        price = exchange(groups[arm, against]) if arm.name.startswith(MAP.name) else ""
        lines.append(
            f"{where}: {verdict(groups[arm, against])} Avoided less stopped: {gained} points.{price}"
        )
    return lines


def standings(results: Results, differences: Sequence[Difference]) -> list[str]:
    """How that with which all others are compared stands among them, a sentence per preset and rule.

    Better is who has a decided gain in one of the two measures and no decided loss in the other.
    """
    groups: dict[Arm, list[Difference]] = {}
    for d in differences:
        groups.setdefault(d.against, []).append(d)
    lines = []
    for against, own in groups.items():
        rivals_by_standing: dict[str, list[str]] = {}
        others = list(dict.fromkeys(d.arm for d in own))
        for other in others:
            of_pair = [d for d in own if d.arm == other]
            rivals_by_standing.setdefault(_standing(of_pair), []).append(other.name)
        parts = [
            f"{text}: {'; '.join(rivals_by_standing[text])}"
            for text in _STANDINGS
            if text in rivals_by_standing
        ]
        gains = {other: benefit_difference(results, other, against) for other in others}
        best = max(others, key=lambda other: gains[other].value)
        lines.append(
            f"Preset {against.preset}, rule {against.rule}: {against.name} is {'. It is '.join(parts)}. "
            f"The best of them by avoided less stopped is {best.name}, {points_text(gains[best])} points "
            "against it."
        )
    return lines


_BETTER, _WORSE = "better than", "worse than"
_TRADES, _UNDECIDED = "better in the one and worse in the other than", "not decidedly different from"
_STANDINGS = (_BETTER, _TRADES, _UNDECIDED, _WORSE)


def _standing(differences: Sequence[Difference]) -> str:
    """Of that with which a rival is compared, by the rival's decided differences."""
    signs = {"avoided": -1.0, "stops": 1.0}
    gains = [signs[d.measure] * d.estimate.value for d in differences if d.is_decided]
    if not gains:
        return _UNDECIDED
    return _TRADES if min(gains) < 0 < max(gains) else _BETTER if min(gains) > 0 else _WORSE


def exchange(differences: Sequence[Difference]) -> str:
    """From which weight of an unnecessary stop on a side pays that gives collisions for stops; else nothing.

    Args:
        differences: in collisions avoided and in unnecessary stops, of one arm against another.
    """
    avoided, stops = differences
    lost, saved = -avoided.estimate.value, -stops.estimate.value
    if not lost > 0 or not saved > 0:
        return ""
    return (
        f" It gives {100 * lost:.1f} points of collisions avoided for {100 * saved:.1f} points of stops, "
        f"which pays if a stop in a nothing scene weighs more than {lost / saved:.1f} collisions in a "
        "must-brake scene."
    )
