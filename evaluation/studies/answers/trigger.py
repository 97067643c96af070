"""Which brake rule, and how sensitive?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

from evaluation.metrics.intervals import Estimate
from evaluation.results.tables import Table
from evaluation.studies.answers import figures
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import DECISIVE
from evaluation.studies.answers.results import Results, benefit, decisive_differences
from evaluation.studies.answers.rivals import PATH, Rival
from evaluation.studies.answers.study import Answer, Question
from evaluation.studies.answers.tables import (
    differences_csv,
    differences_table,
    estimates_csv,
    interval_text,
    points_text,
)
from evaluation.studies.answers.tuned import BY_TUNING, NOTHING_BETTER, Tuned, given_tuned, tuned_settings
from scenarios.presets import named_preset
from scenarios.settings import PARAMETERS, TRIGGERS, Settings, preset_with, settings_text

FAMILIES: tuple[str, ...] = tuple(
    {trigger: rule for rule, trigger in reversed(list(TRIGGERS.items()))}.values()
)[::-1]
"""The first rule of each trigger; the others are the same with other values."""

SENSITIVITIES: Mapping[str, tuple[float, ...]] = MappingProxyType(
    {
        "braking_factor": (0.6, 0.8, 1.0, 1.25, 1.5, 2.0),
        "cascade_margin_s": (0.0, 0.25, 0.5, 1.0, 1.5),
        "required_decel_mps2": (3.0, 4.0, 5.0, 6.0, 7.0, 8.8),
        "rss_response_s": (0.0, 0.25, 0.5, 1.0, 1.5),
        "autoware_response_s": (0.0, 0.25, 0.5, 1.0, 1.5),
        "r157_ttc_s": (0.75, 1.0, 1.5, 2.0, 3.0),
        "staged_margin_s": (0.0, 0.25, 0.5, 1.0, 1.5),
    }
)
"""Values of each rule's trigger, around what its source has; assumed."""


@dataclass(frozen=True, slots=True)
class Trigger(Question):
    """Every rule with its trigger from late to early.

    Args:
        rival: what is monitored.
        preset: conditions.
        rules: brake rules; one without a trigger is a point.
        tuned: settings that were chosen for what is monitored with a rule on other scenes; a point each.
    """

    rival: Rival = PATH
    preset: str = "physical"
    rules: tuple[str, ...] = FAMILIES
    tuned: Tuned = ()
    name = "trigger"

    def given(self, out: Path) -> Trigger:
        """With what was chosen in the same folder."""
        return replace(self, tuned=given_tuned(out, self.sample))

    def chosen(self, rule: str) -> tuple[Settings, Arm] | None:
        """What was chosen with a rule on other scenes, None where nothing was.

        Where nothing better was found, no settings, and the point of the rule's source.

        Raises:
            ArgumentError: the settings are not possible.
        """
        settings = tuned_settings(self.rival.name, rule, self.tuned)
        if settings is None:
            return None
        arm = self.rival.arm(self.preset, rule).having(*settings, name=f"{rule}{BY_TUNING}")
        arm.check()
        for value, published in self.curve(rule):
            if published.conditions == arm.conditions and (value == self.usual(rule) or math.isnan(value)):
                return (), published
        return settings, arm

    def curve(self, rule: str) -> list[tuple[float, Arm]]:
        """Values of a rule's trigger with their arms, the value of its source among them."""
        arm, key = self.rival.arm(self.preset, rule), TRIGGERS.get(rule)
        if key is None:
            return [(math.nan, arm)]
        values = sorted({self.usual(rule), *SENSITIVITIES[key]})
        return [(value, arm.having((key, value), name=f"{rule}, {value:g}")) for value in values]

    def usual(self, rule: str) -> float:
        """Value of a rule's trigger as its source has it; NaN without a trigger."""
        key = TRIGGERS.get(rule)
        if key is None:
            return math.nan
        settings = self.rival.arm(self.preset, rule).settings
        return float(PARAMETERS[key].of(preset_with(named_preset(self.preset), settings)))

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All rules at all values."""
        arms = [arm for rule in self.rules for _, arm in self.curve(rule)]
        arms += [chosen[1] for rule in self.rules if (chosen := self.chosen(rule))]
        return tuple(dict.fromkeys(arms))

    @property
    def pairs(self) -> list[tuple[Arm, Arm]]:
        """Every rule as its source has it against the first."""
        published = [
            next(arm for value, arm in self.curve(rule) if value == self.usual(rule) or math.isnan(value))
            for rule in self.rules
        ]
        return [(arm, published[0]) for arm in published[1:]]

    @property
    def questions(self) -> int:
        """Both measures of every pair."""
        return len(self.pairs) * len(DECISIVE)

    def operating(self, results: Results) -> list[Operating]:
        """All rules at all values, with their rates."""
        points = []
        for rule in self.rules:
            usual = self.usual(rule)
            points += [
                _operating(results, rule, arm, value, value == usual) for value, arm in self.curve(rule)
            ]
            if chosen := self.chosen(rule):
                text = settings_text(chosen[0]) or NOTHING_BETTER
                points.append(_operating(results, rule, chosen[1], math.nan, tuned=text))
        return points

    def answer(self, results: Results) -> Answer:
        """What each rule avoids at what price."""
        points = self.operating(results)
        differences = decisive_differences(results, self.pairs)
        tables = {"Every rule and value": _table(points)}
        if differences:
            first = f"Each as its source has it, against {self.rules[0]}"
            tables[first] = differences_table(differences, self.questions)
        where = f"{self.rival.name}, preset {self.preset}"
        return Answer(
            "Which brake rule, and how sensitive?",
            findings(points),
            tables,
            {"trigger": figures.operating_curves(points, where)},
            {"trigger.csv": estimates_csv(results), "differences.csv": differences_csv(differences)},
            (
                "Each curve is a rule, from its latest trigger to its earliest; ringed: as its source "
                "has it.",
                "Tuned: chosen by `smartmot-eval study tune` on other scenes and maps. Without it the best "
                "value is the best in these very scenes.",
                "Rates: Wilson's interval over the scenes (95 %).",
            ),
        )


def _operating(
    results: Results, rule: str, arm: Arm, value: float, is_usual: bool = False, tuned: str = ""
) -> Operating:
    avoided, stops, early = (results.estimate(arm, name) for name in (*DECISIVE, "early"))
    return Operating(rule, value, is_usual, avoided, stops, early, tuned)


@dataclass(frozen=True, slots=True)
class Operating:
    """A rule at one value of its trigger.

    Args:
        rule: which.
        value: of its trigger; NaN without one.
        is_usual: whether its source has that value.
        avoided, stops, early: rates.
        tuned: settings that were chosen on other scenes, with these rates; empty: it is a point of the curve.
    """

    rule: str
    value: float
    is_usual: bool
    avoided: Estimate
    stops: Estimate
    early: Estimate
    tuned: str = ""

    @property
    def benefit(self) -> Estimate:
        """Collisions avoided less unnecessary stops."""
        return benefit(self.avoided, self.stops)


def findings(points: Sequence[Operating]) -> list[str]:
    """The answer in sentences: each rule as published, and tuned or else at its best; the best rule first."""
    groups: dict[str, list[Operating]] = {}
    for point in points:
        groups.setdefault(point.rule, []).append(point)
    usual = {rule: next((p for p in own if p.is_usual), own[0]) for rule, own in groups.items()}
    shown = {
        rule: next((p for p in own if p.tuned), max([usual[rule], *own], key=lambda p: p.benefit.value))
        for rule, own in groups.items()
    }
    lines = []
    for rule in sorted(groups, key=lambda rule: -shown[rule].benefit.value):
        text = f"{rule}: as its source has it, {_rates(usual[rule], 'of the collisions avoided')}"
        point, key = shown[rule], TRIGGERS.get(rule)
        if point.tuned == NOTHING_BETTER:
            text += f"; tuned on other scenes, {NOTHING_BETTER}"
        elif point.tuned:
            text += f"; tuned on other scenes ({point.tuned}), {_rates(point)}"
        elif key and point is not usual[rule]:
            text += (
                f"; avoided less stopped is greatest with {PARAMETERS[key].text} {point.value:g} "
                f"{PARAMETERS[key].unit}".rstrip()
                + f": {_rates(point)}"
            )
        lines.append(f"{text}.")
    return lines


def _rates(point: Operating, of: str = "avoided") -> str:
    avoided, stops = interval_text(point.avoided, "avoided"), interval_text(point.stops, "stops")
    return f"{avoided} % {of} at {stops} % unnecessary stops"


def _table(points: Sequence[Operating]) -> Table:
    header = (
        "rule",
        "trigger",
        "value",
        "avoided (%)",
        "early (%)",
        "unnecessary stops (%)",
        "avoided less stopped",
    )
    rows = []
    for p in points:
        key = TRIGGERS.get(p.rule)
        value = (
            f"{p.value:g} {PARAMETERS[key].unit}".strip() + (" (source)" if p.is_usual else "") if key else ""
        )
        cells = (
            interval_text(p.avoided, "avoided"),
            interval_text(p.early, "early"),
            interval_text(p.stops, "stops"),
        )
        cause = ("tuned", p.tuned) if p.tuned else (PARAMETERS[key].text if key else "", value)
        rows.append((p.rule, *cause, *cells, points_text(p.benefit)))
    return Table(header, tuple(rows))
