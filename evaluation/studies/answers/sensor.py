"""Which error of the sensor costs most?"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from evaluation.metrics.intervals import Estimate
from evaluation.results.tables import Table, csv_bytes
from evaluation.studies.answers import figures
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import DECISIVE, MEASURES
from evaluation.studies.answers.results import (
    Difference,
    Results,
    benefit,
    decisive_differences,
    difference,
)
from evaluation.studies.answers.rivals import MAP, Rival
from evaluation.studies.answers.study import Answer, Question
from evaluation.studies.answers.tables import (
    differences_csv,
    differences_table,
    estimates_csv,
    points_text,
    rates_table,
)
from scenarios.presets import named_preset
from scenarios.settings import PARAMETERS, Settings

ERRORS: dict[str, tuple[str, ...]] = {
    "position noise": ("position_sigma_m", "position_correlation_s"),
    "position bias": ("position_bias_m",),
    "headings": ("heading_sigma_deg", "heading_flip"),
    "sizes": ("size_sigma", "size_bias"),
    "categories": ("class_confusion",),
    "misses": ("miss_rate", "miss_persistence"),
    "ghosts": ("ghosts_per_frame",),
    "frame rate": ("rate_hz",),
    "latency": ("latency_s",),
    "range": ("range_m",),
    "localisation": (
        "localisation_lateral_m",
        "localisation_longitudinal_m",
        "localisation_heading_deg",
        "localisation_drift_m",
        "localisation_noise_m",
    ),
}
"""Parameters by what they are about; those of one kind of error go together."""


@dataclass(frozen=True, slots=True)
class Cost:
    """What an error costs.

    Args:
        error: which.
        alone: rates with it alone less those without any.
        among: rates with all less those with all others; each for collisions avoided, stops and the benefit.
    """

    error: str
    alone: tuple[Estimate, Estimate, Estimate]
    among: tuple[Estimate, Estimate, Estimate]


@dataclass(frozen=True, slots=True)
class SensorErrors(Question):
    """One error of a real sensor at a time, and all but one.

    Args:
        rival: what is monitored.
        rule: brake rule.
        ideal: preset of a sensor without these errors.
        real: preset of one with all.
        errors: kinds of errors.
    """

    rival: Rival = MAP
    rule: str = "paper"
    ideal: str = "physical"
    real: str = "real"
    errors: tuple[str, ...] = tuple(ERRORS)
    name = "sensor"

    def having(self, errors: Sequence[str]) -> Arm:
        """The real sensor with only some of its errors: the others have the ideal one's values."""
        ideal = named_preset(self.ideal)
        absent: Settings = tuple(
            (key, PARAMETERS[key].of(ideal))
            for error in self.errors
            if error not in errors
            for key in ERRORS[error]
        )
        if len(errors) == 1:
            name = f"{errors[0]} alone"
        elif len(errors) == len(self.errors) - 1:
            name = f"all but {next(error for error in self.errors if error not in errors)}"
        else:
            name = "all errors" if errors else "no error"
        return self.rival.arm(self.real, self.rule).having(*absent, name=name)

    def all_but(self, error: str) -> Arm:
        """With all errors but one."""
        return self.having([other for other in self.errors if other != error])

    @property
    def arms(self) -> tuple[Arm, ...]:
        """Without any, with each alone, with all but each, with all."""
        each = (arm for error in self.errors for arm in (self.having([error]), self.all_but(error)))
        return tuple(dict.fromkeys([self.having([]), *each, self.having(self.errors)]))

    @property
    def pairs(self) -> list[tuple[Arm, Arm]]:
        """With each error against without it: alone, and among all."""
        none, every = self.having([]), self.having(self.errors)
        alone = [(self.having([error]), none) for error in self.errors]
        return alone + [(every, self.all_but(error)) for error in self.errors]

    @property
    def questions(self) -> int:
        """Both differences of each pair."""
        return len(self.pairs) * len(DECISIVE)

    def costs(self, results: Results) -> list[Cost]:
        """What each error costs, the greatest first: by the benefit that is lost, alone or among all."""
        changes = [_change(results, *pair) for pair in self.pairs]
        half = len(self.errors)
        costs = [Cost(*parts) for parts in zip(self.errors, changes[:half], changes[half:], strict=True)]
        return sorted(costs, key=lambda cost: min(cost.alone[2].value, cost.among[2].value))

    def total(self, results: Results) -> tuple[Estimate, Estimate, Estimate]:
        """What all errors together cost: collisions avoided, stops and the benefit."""
        return _change(results, self.having(self.errors), self.having([]))

    def answer(self, results: Results) -> Answer:
        """Which error costs most."""
        costs = self.costs(results)
        where = f"{self.rival.name}, rule {self.rule}"
        differences = decisive_differences(results, self.pairs)
        tables = {
            "What each error costs": _table(costs),
            "Whether it costs anything": differences_table(differences, self.questions),
            "Each by itself": rates_table(results, self.arms),
        }
        return Answer(
            "Which error of the sensor costs most?",
            [*findings(costs, self.total(results)), decided(differences)],
            tables,
            {"sensor": figures.tornado(costs, where)},
            {
                "sensor.csv": _csv(costs),
                "differences.csv": differences_csv(differences),
                "table.csv": estimates_csv(results),
            },
            (
                f"The sensor is that of the preset {self.real}; an error that is left out has the value "
                f"of the preset {self.ideal}; how much of an object may be hidden stays that of {self.real}. "
                "The tracker knows the sensor's noise, whichever it is.",
                "Alone: with the error less without any. Among all: with all less with all others. "
                "Errors that "
                "matter only together show in the second alone.",
                "Benefit: collisions avoided per must-brake scene less unnecessary stops per nothing scene. "
                "Its intervals are of each error by itself: the greatest of several looks greater than it "
                "is.",
            ),
        )


def _change(results: Results, arm: Arm, against: Arm) -> tuple[Estimate, Estimate, Estimate]:
    avoided, stops = (difference(results, arm, against, measure).estimate for measure in DECISIVE)
    return avoided, stops, benefit(avoided, stops)


def findings(costs: Sequence[Cost], total: tuple[Estimate, Estimate, Estimate]) -> list[str]:
    """The answer in sentences."""
    avoided, stops, both = map(points_text, total)
    lines = [
        f"All errors together against none: collisions avoided {avoided}, unnecessary stops {stops}, "
        f"benefit {both} "
        "points."
    ]
    for text, part in (("alone", "alone"), ("among all others", "among")):
        ranked = sorted(costs, key=lambda cost: getattr(cost, part)[2].value)
        worst = getattr(ranked[0], part) if ranked else None
        if worst is not None and worst[2].value < 0:
            clear = "" if worst[2].high < 0 else "; its interval holds 0"
            lines.append(
                f"{text.capitalize()}, {ranked[0].error} cost most: collisions avoided "
                f"{points_text(worst[0])}, "
                f"unnecessary stops {points_text(worst[1])}, benefit {points_text(worst[2])} points{clear}."
            )
        elif worst is not None:
            lines.append(f"{text.capitalize()}, no error costs anything in these scenes.")
    return lines


def decided(differences: Sequence[Difference]) -> str:
    """Which differences are seen in spite of their number, in a sentence."""
    seen = [
        f"{d.arm.name} against {d.against.name}, {MEASURES[d.measure].text}"
        for d in differences
        if d.is_decided
    ]
    return f"Decided, corrected for {len(differences)} questions: {'; '.join(seen) or 'none'}."


def _table(costs: Sequence[Cost]) -> Table:
    header = ["error"]
    for part in ("alone", "among all"):
        header += [f"{part}: avoided (points)", "stops (points)", "benefit (points)"]
    rows = tuple((c.error, *map(points_text, (*c.alone, *c.among))) for c in costs)
    return Table(tuple(header), rows, (), "Differences in the same scenes; 95 % intervals.")


def _csv(costs: Sequence[Cost]) -> bytes:
    names = [f"{part}_{name}" for part in ("alone", "among") for name in ("avoided", "stops", "benefit")]
    header = ["error", *(f"{name}{end}" for name in names for end in ("", "_low", "_high"))]
    rows = [[c.error, *(v for e in (*c.alone, *c.among) for v in (e.value, e.low, e.high))] for c in costs]
    return csv_bytes(header, rows)
