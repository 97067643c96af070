"""How wrong may localisation and map be before a lane filter hurts?"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evaluation.metrics.intervals import CONFIDENCE, Estimate
from evaluation.results.tables import EMPTY, Table, csv_bytes, fixed
from evaluation.studies.answers import figures
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import DECISIVE, MEASURES
from evaluation.studies.answers.results import Results, benefit, decisive_differences, difference
from evaluation.studies.answers.rivals import MAP, PATH
from evaluation.studies.answers.study import Answer, Question
from evaluation.studies.answers.tables import arms_table, differences_csv, p_text, points_text
from evaluation.studies.answers.tuned import Tuned, given_tuned, tuned_arm, unchanged_table
from scenarios.settings import PARAMETERS
from smartmot.types import FloatArray

RESAMPLES = 2000
"""Of the bootstrap: B. Efron and R. Tibshirani (1993) ask for 1000 or more for intervals of percentiles."""


@dataclass(frozen=True, slots=True)
class Sweep:
    """Growing errors of one kind.

    Args:
        parameter: which.
        values: greater than zero, rising.
        side: in words, of a bias whose side is drawn for each scene; empty: it has none.
    """

    parameter: str
    values: tuple[float, ...]
    side: str = ""

    @property
    def text(self) -> str:
        """What grows, in words."""
        return self.side or PARAMETERS[self.parameter].text

    @property
    def unit(self) -> str:
        """Of the values."""
        return PARAMETERS[self.parameter].unit


SWEEPS: tuple[Sweep, ...] = (
    Sweep("localisation_lateral_m", (0.25, 0.5, 1.0, 1.5), "localisation biased left or right"),
    Sweep("localisation_drift_m", (0.25, 0.5, 1.0)),
    Sweep("localisation_heading_deg", (0.5, 1.0, 2.0), "heading biased left or right"),
    Sweep("map_kerb_m", (0.5, 1.0, 2.0), "sidewalks of the map too far out or in"),
    Sweep("map_lane_m", (0.25, 0.5, 1.0), "lanes of the map too far left or right"),
)
"""From what survey-grade localisation and maps keep to what a receiver without corrections has; assumed."""
NAMED = (
    ("map_sidewalk", "missing"),
    ("map_lanes", "missing"),
    ("map_types", "strips_drive"),
    ("map_types", "no_sidewalk"),
)
"""Errors that are there or not."""


@dataclass(frozen=True, slots=True)
class Point:
    """Map filter less planned path at one size of an error.

    Args:
        value: the size, or its name.
        avoided, stops: differences of the rates.
        benefit: of both; see `evaluation.studies.answers.results.benefit`.
    """

    value: float | str
    avoided: Estimate
    stops: Estimate
    benefit: Estimate


@dataclass(frozen=True, slots=True)
class Curve:
    """The differences along a sweep, from no error on.

    Args:
        side: name of the map filter that is compared.
        sweep: the errors.
        points: the first without any.
        crossing: error at which the benefit is lost; infinite: not within the sweep; 0: there is none.
        low, high: its interval, from resampled scenes.
    """

    side: str
    sweep: Sweep
    points: tuple[Point, ...]
    crossing: float
    low: float
    high: float

    @property
    def values(self) -> list[float]:
        """Sizes of the error."""
        return [0.0, *self.sweep.values]


Pair = tuple[Arm, Arm]
"""A map filter, and the planned path that it is compared with."""


@dataclass(frozen=True, slots=True)
class BreakEven(Question):
    """The map filter less the planned path, with growing errors of localisation and map.

    Args:
        preset: conditions without these errors.
        rule: brake rule.
        sweeps: errors that grow.
        named: errors that are there or not.
        tuned: settings of both that were chosen on other scenes; with them both are also compared.
        path_from: planner: the path is exact relative to the ego; map: it is as wrong as localisation and
            map, for both alike.
    """

    preset: str = "physical"
    rule: str = "paper"
    sweeps: tuple[Sweep, ...] = SWEEPS
    named: tuple[tuple[str, str], ...] = NAMED
    tuned: Tuned = ()
    path_from: str = "planner"
    name = "break-even"

    def given(self, out: Path) -> BreakEven:
        """With what was chosen in the same folder."""
        return replace(self, tuned=given_tuned(out, self.sample))

    @property
    def sides(self) -> list[Pair]:
        """Map filter and planned path without errors: with the paper's margin, and tuned."""
        where = () if self.path_from == "planner" else (("path_from", self.path_from),)
        arms = [rival.arm(self.preset, self.rule).having(*where) for rival in (MAP, PATH)]
        first = arms[0], arms[1]
        second = tuple(tuned_arm(arm, self.tuned) or arm for arm in first)
        return list(dict.fromkeys([first, (second[0], second[1])]))

    @property
    def unchanged(self) -> list[Arm]:
        """Arms for which tuning found nothing better."""
        return [arm for arm in self.sides[0] if tuned_arm(arm, self.tuned) == arm]

    @staticmethod
    def having(side: Pair, parameter: str, value: float | str, coin: bool = False) -> Pair:
        """Both with an error; what means nothing for one of them leaves it as it is."""
        first, second = (arm.having((parameter, value), coin=coin) for arm in side)
        return first, second

    def pairs_of(self, side: Pair) -> list[Pair]:
        """Both at every error, first at none."""
        return [side, *(self.having(side, *error) for error in self._errors())]

    def _errors(self) -> list[tuple[str, float | str, bool]]:
        """Parameter, value and whether it has a side, of every error as the tables list them."""
        return [
            *((s.parameter, v, bool(s.side)) for s in self.sweeps for v in s.values),
            *((key, value, False) for key, value in self.named),
        ]

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All of them, each once."""
        pairs = (pair for side in self.sides for pair in self.pairs_of(side))
        return tuple(dict.fromkeys(arm for pair in pairs for arm in pair))

    @property
    def questions(self) -> int:
        """Both differences at every error."""
        return len(DECISIVE) * sum(len(self.pairs_of(side)) for side in self.sides)

    def curve(self, results: Results, side: Pair, sweep: Sweep) -> Curve:
        """The differences along a sweep, and where the benefit is lost."""
        errors = (self.having(side, sweep.parameter, value, bool(sweep.side)) for value in sweep.values)
        pairs = [side, *errors]
        values = [0.0, *sweep.values]
        points = tuple(_point(results, pair, value) for pair, value in zip(pairs, values, strict=True))
        sizes = np.array(values)
        avoided, stops = (changes(results, pairs, measure) for measure in DECISIVE)
        drawn = resampled_benefits(avoided, stops, self.sample.seed)
        ends = np.sort([crossing(sizes, row) for row in drawn])
        tail = 0.5 * (1 - CONFIDENCE)
        # order statistics: infinite ones cannot be interpolated
        low, high = (float(ends[round(q * (len(ends) - 1))]) for q in (tail, 1 - tail))
        middle = crossing(sizes, np.array([point.benefit.value for point in points]))
        return Curve(side[0].name, sweep, points, middle, low, high)

    def curves(self, results: Results) -> dict[str, list[Curve]]:
        """The differences along every sweep, by the name of the map filter."""
        return {side[0].name: [self.curve(results, side, s) for s in self.sweeps] for side in self.sides}

    def points_named(self, results: Results) -> dict[str, list[tuple[str, Point]]]:
        """The differences at errors that are there or not: parameter and point, by the map filter."""
        return {
            side[0].name: [(key, _point(results, self.having(side, key, v), v)) for key, v in self.named]
            for side in self.sides
        }

    @staticmethod
    def parts_figure(side: str) -> str:
        """Name of the figure of a map filter's two differences."""
        return f"break_even_{side}".replace(", ", "_")

    def answer(self, results: Results) -> Answer:
        """Where the benefit of the map filter is lost."""
        curves, named = self.curves(results), self.points_named(results)
        where = f"preset {self.preset}, rule {self.rule}, path from the {self.path_from}"
        tables = {"Where the benefit is lost": _crossings(curves)}
        differences = decisive_differences(results, [p for side in self.sides for p in self.pairs_of(side)])
        seen = {(d.arm, d.measure): d.adjusted for d in differences}
        for pair in self.sides:
            first = pair[0].name
            points = _lines(curves[first], named[first])
            p_values = [[seen[arm, measure] for measure in DECISIVE] for arm, _ in self.pairs_of(pair)]
            tables[f"By error: {first}"] = _table(points, p_values, self.questions)
        tables["Who is who"] = unchanged_table(
            self.unchanged, arms_table([arm for side in self.sides for arm in side])
        )
        drawn = {"break_even": figures.break_even(curves, where)}
        for side, own in curves.items():
            drawn[self.parts_figure(side)] = figures.break_even_parts(own, f"{side}, {where}")
        files = {"break_even.csv": _csv(curves, named), "differences.csv": differences_csv(differences)}
        return Answer(
            "How wrong may localisation and map be before a lane filter hurts?",
            [line for side in curves for line in findings(side, curves[side], named[side])],
            tables,
            drawn,
            files,
            NOTES,
        )


NOTES = (
    "Benefit: collisions avoided per must-brake scene less unnecessary stops per nothing scene, of the map "
    "filter along the planned path less the planned path alone. One weighs as much as the other: a "
    "yardstick, and no trade-off of lives against comfort; both are given separately.",
    "A bias has in each scene the sign of a coin: its side is not known.",
    "The crossing is interpolated linearly between the sizes that were run; its interval is that of "
    f"{RESAMPLES} resamples of the scenes (percentiles, seeded).",
    "Differences: Tango's interval over the scenes; benefit: the squares of both added (Zou and Donner).",
)


def changes(results: Results, pairs: Sequence[tuple[Arm, Arm]], measure: str) -> FloatArray:
    """(V, S) first less second of each pair in the scenes of the measure's kind; NaN: cut off."""
    rows = np.array([results.values(a, measure) - results.values(b, measure) for a, b in pairs])
    of_kind = [scene.must == MEASURES[measure].must for scene in results.scenes]
    return rows[:, np.array(of_kind, dtype=bool)]


def resampled_benefits(avoided: FloatArray, stops: FloatArray, seed: int) -> FloatArray:
    """(B, V) benefits of resampled scenes: each drawn as often as chance has it, all values in the same ones.

    Args:
        avoided: (V, S) see `changes`.
        stops: (V, T) the same.
        seed: of the resampling.
    """
    rng = np.random.default_rng(seed)
    return _resampled(avoided, rng) - _resampled(stops, rng)


def _resampled(values: FloatArray, rng: np.random.Generator) -> FloatArray:
    """(B, V) means over resampled scenes."""
    scenes = values.shape[1]
    if not scenes:
        return np.full((RESAMPLES, len(values)), math.nan)
    times = rng.multinomial(scenes, np.full(scenes, 1 / scenes), RESAMPLES).astype(np.float64)
    there = ~np.isnan(values)
    sums = times @ np.where(there, values, 0.0).T
    means: FloatArray = sums / np.maximum(times @ there.T.astype(np.float64), 1.0)
    return means


def crossing(values: FloatArray, benefits: FloatArray) -> float:
    """Where a benefit is first lost, interpolated linearly; infinite if nowhere, 0 if there is none at first.

    Args:
        values: (V,) rising, the first 0.
        benefits: (V,) at these.
    """
    lost = np.flatnonzero(benefits <= 0.0)
    if not len(lost):
        return math.inf
    k = int(lost[0])
    if k == 0:
        return 0.0
    share = benefits[k - 1] / (benefits[k - 1] - benefits[k])
    return float(values[k - 1] + share * (values[k] - values[k - 1]))


def _point(results: Results, pair: tuple[Arm, Arm], value: float | str) -> Point:
    avoided, stops = (difference(results, *pair, measure).estimate for measure in DECISIVE)
    return Point(value, avoided, stops, benefit(avoided, stops))


def findings(side: str, curves: Sequence[Curve], named: Sequence[tuple[str, Point]]) -> list[str]:
    """The answer for one map filter in sentences."""
    lines = []
    if curves:
        start = curves[0].points[0]
        lines.append(
            f"{side}: without errors, against the planned path, collisions avoided "
            f"{points_text(start.avoided)}, unnecessary stops {points_text(start.stops)}, benefit "
            f"{points_text(start.benefit)} points."
        )
        if start.benefit.value <= 0.0:
            lines.append(f"{side}: there is no benefit that an error could take; what errors cost besides:")
            lines += [f"{side}: {_fall(curve)}" for curve in curves]
        else:
            if start.benefit.low <= 0.0:
                lines.append(
                    f"{side}: these scenes do not decide whether there is a benefit without errors; where "
                    "it is lost is no more certain."
                )
            lines += [f"{side}: {crossing_sentence(curve)}" for curve in curves]
    lines += [
        f"{side}: {PARAMETERS[key].text} {point.value}: collisions avoided {points_text(point.avoided)}, "
        f"unnecessary stops {points_text(point.stops)} points."
        for key, point in named
    ]
    return lines


def crossing_sentence(curve: Curve) -> str:
    """Where the benefit is lost, for one error."""
    text, unit = curve.sweep.text, curve.sweep.unit
    reach = f"[{_size(curve.low)}, {_size(curve.high)}]"
    if curve.crossing == 0.0:
        return f"{text}: there is no benefit to lose."
    if math.isinf(curve.crossing):
        most = f"{curve.sweep.values[-1]:g} {unit}"
        return f"{text}: the benefit is not lost up to {most} (interval of the crossing {reach})."
    return f"{text}: the benefit is lost at {_size(curve.crossing)} {unit} {reach}."


def _fall(curve: Curve) -> str:
    """How far a benefit falls, for one error."""
    first, last = curve.points[0].benefit, curve.points[-1].benefit
    most = f"{curve.values[-1]:g} {curve.sweep.unit}"
    return f"{curve.sweep.text}: {points_text(first)} points without, {points_text(last)} at {most}."


def _size(value: float) -> str:
    return "beyond" if math.isinf(value) else f"{value:.2f}"


def _lines(curves: Sequence[Curve], named: Sequence[tuple[str, Point]]) -> list[tuple[str, Point]]:
    return [(curve.sweep.parameter, point) for curve in curves for point in curve.points] + list(named)


def _table(points: Sequence[tuple[str, Point]], p_values: Sequence[Sequence[float]], questions: int) -> Table:
    header = ["error", "size", "benefit (points)"]
    for name in DECISIVE:
        header += [f"{MEASURES[name].text} (points)", "p (Holm)"]
    rows = []
    base, *of_errors = p_values
    errors = iter(of_errors)
    for key, point in points:
        parameter = PARAMETERS[key]
        size = point.value if isinstance(point.value, str) else f"{point.value:g} {parameter.unit}".strip()
        # without an error both are the same runs whatever the error is: one question
        adjusted = tuple(map(p_text, base if point.value == 0.0 else next(errors)))
        parts = (point.avoided, adjusted[0]), (point.stops, adjusted[1])
        cells = [cell for part, p_value in parts for cell in (points_text(part), p_value)]
        rows.append((parameter.text, size, points_text(point.benefit), *cells))
    caption = (
        "Map filter less planned path in the same scenes, 95 % intervals; p-values of McNemar's exact test, "
        f"corrected for all {questions} questions of this study."
    )
    return Table(tuple(header), tuple(rows), (), caption)


def _crossings(curves: Mapping[str, Sequence[Curve]]) -> Table:
    rows = tuple(
        (
            side,
            c.sweep.text,
            c.sweep.unit,
            _lost_at(c),
            f"[{_size(c.low)}, {_size(c.high)}]",
        )
        for side, own in curves.items()
        for c in own
    )
    return Table(("who", "error", "unit", "benefit lost at", "95 % interval"), rows)


def _lost_at(curve: Curve) -> str:
    if curve.crossing == 0.0:
        return "no benefit to lose"
    return (
        fixed(curve.crossing, 2)
        if math.isfinite(curve.crossing)
        else f"{EMPTY} (beyond {curve.sweep.values[-1]:g})"
    )


def _csv(curves: Mapping[str, Sequence[Curve]], named: Mapping[str, Sequence[tuple[str, Point]]]) -> bytes:
    header = ["name", "parameter", "value"]
    for name in ("avoided", "stops", "benefit"):
        header += [name, f"{name}_low", f"{name}_high"]
    rows = []
    for side in curves:
        for key, point in _lines(curves[side], named[side]):
            line: list[object] = [side, key, point.value]
            for part in (point.avoided, point.stops, point.benefit):
                line += [part.value, part.low, part.high]
            rows.append(line)
    return csv_bytes(header, rows)
