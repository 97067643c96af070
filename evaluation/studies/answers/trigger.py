"""Which brake rule, and how sensitive?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
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
from scenarios.presets import named_preset
from scenarios.settings import PARAMETERS, TRIGGERS, preset_with

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
    """

    rival: Rival = PATH
    preset: str = "physical"
    rules: tuple[str, ...] = FAMILIES
    name = "trigger"

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
        return tuple(dict.fromkeys(arm for rule in self.rules for _, arm in self.curve(rule)))

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
            for value, arm in self.curve(rule):
                avoided, stops, early = (results.estimate(arm, name) for name in (*DECISIVE, "early"))
                points.append(Operating(rule, value, value == usual, avoided, stops, early))
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
                "The best values are the best in these very scenes. To choose one, use `smartmot-eval "
                "study tune`, "
                "which looks at other scenes and maps.",
                "Rates: Wilson's interval over the scenes (95 %).",
            ),
        )


@dataclass(frozen=True, slots=True)
class Operating:
    """A rule at one value of its trigger.

    Args:
        rule: which.
        value: of its trigger; NaN without one.
        is_usual: whether its source has that value.
        avoided, stops, early: rates.
    """

    rule: str
    value: float
    is_usual: bool
    avoided: Estimate
    stops: Estimate
    early: Estimate

    @property
    def benefit(self) -> Estimate:
        """Collisions avoided less unnecessary stops."""
        return benefit(self.avoided, self.stops)


def findings(points: Sequence[Operating]) -> list[str]:
    """The answer in sentences: each rule as published and at its best, the best rule first."""
    groups: dict[str, list[Operating]] = {}
    for point in points:
        groups.setdefault(point.rule, []).append(point)
    best = {rule: max(own, key=lambda p: p.benefit.value) for rule, own in groups.items()}
    lines = []
    for rule in sorted(best, key=lambda rule: -best[rule].benefit.value):
        key, point = TRIGGERS.get(rule), best[rule]
        usual = next((p for p in groups[rule] if p.is_usual), point)
        text = (
            f"{rule}: as its source has it, {interval_text(usual.avoided, 'avoided')} % of the "
            "collisions avoided at "
            f"{interval_text(usual.stops, 'stops')} % unnecessary stops"
        )
        if key and point is not usual:
            text += (
                f"; avoided less stopped is greatest with {PARAMETERS[key].text} {point.value:g} "
                f"{PARAMETERS[key].unit}".rstrip()
                + f": {interval_text(point.avoided, 'avoided')} % at {interval_text(point.stops, 'stops')} %"
            )
        lines.append(f"{text}.")
    return lines


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
        rows.append((p.rule, PARAMETERS[key].text if key else "", value, *cells, points_text(p.benefit)))
    return Table(header, tuple(rows))
