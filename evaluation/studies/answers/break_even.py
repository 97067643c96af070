"""How wrong may localisation and map be before a lane filter hurts?"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from evaluation.metrics.intervals import CONFIDENCE, Estimate
from evaluation.results.tables import EMPTY, Table, csv_bytes, fixed
from evaluation.studies.answers import figures
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import DECISIVE, MEASURES
from evaluation.studies.answers.results import Results, benefit, difference
from evaluation.studies.answers.rivals import MAP, PATH
from evaluation.studies.answers.study import Answer, Question
from evaluation.studies.answers.tables import points_text
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
        coin: whether it is a bias, whose side is drawn for each scene.
    """

    parameter: str
    values: tuple[float, ...]
    coin: bool = False


SWEEPS: tuple[Sweep, ...] = (
    Sweep("localisation_lateral_m", (0.25, 0.5, 1.0, 1.5), coin=True),
    Sweep("localisation_drift_m", (0.25, 0.5, 1.0)),
    Sweep("localisation_heading_deg", (0.5, 1.0, 2.0), coin=True),
    Sweep("map_kerb_m", (0.5, 1.0, 2.0), coin=True),
    Sweep("map_lane_m", (0.25, 0.5, 1.0), coin=True),
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
        sweep: the errors.
        points: the first without any.
        crossing: error at which the benefit is lost; infinite: not within the sweep; 0: there is none.
        low, high: its interval, from resampled scenes.
    """

    sweep: Sweep
    points: tuple[Point, ...]
    crossing: float
    low: float
    high: float

    @property
    def values(self) -> list[float]:
        """Sizes of the error."""
        return [0.0, *self.sweep.values]


@dataclass(frozen=True, slots=True)
class BreakEven(Question):
    """The map filter less the planned path, with growing errors of localisation and map.

    Args:
        preset: conditions without these errors.
        rule: brake rule.
        sweeps: errors that grow.
        named: errors that are there or not.
    """

    preset: str = "physical"
    rule: str = "paper"
    sweeps: tuple[Sweep, ...] = SWEEPS
    named: tuple[tuple[str, str], ...] = NAMED
    name = "break-even"

    @property
    def base(self) -> tuple[Arm, Arm]:
        """Map filter and planned path without errors."""
        return MAP.arm(self.preset, self.rule), PATH.arm(self.preset, self.rule)

    def pair(self, parameter: str, value: float | str, coin: bool = False) -> tuple[Arm, Arm]:
        """Both with an error; what means nothing for one of them leaves it as it is."""
        first, second = (arm.having((parameter, value), coin=coin) for arm in self.base)
        return first, second

    @property
    def pairs(self) -> list[tuple[Arm, Arm]]:
        """Both sides at every error."""
        grown = [self.pair(s.parameter, value, s.coin) for s in self.sweeps for value in s.values]
        return [self.base, *grown, *(self.pair(*setting) for setting in self.named)]

    @property
    def arms(self) -> tuple[Arm, ...]:
        """All of them, each once."""
        return tuple(dict.fromkeys(arm for pair in self.pairs for arm in pair))

    @property
    def questions(self) -> int:
        """Both differences at every error."""
        return len(self.pairs) * len(DECISIVE)

    def curve(self, results: Results, sweep: Sweep) -> Curve:
        """The differences along a sweep, and where the benefit is lost."""
        pairs = [self.base, *(self.pair(sweep.parameter, value, sweep.coin) for value in sweep.values)]
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
        return Curve(sweep, points, middle, low, high)

    def answer(self, results: Results) -> Answer:
        """Where the benefit of the map filter is lost."""
        curves = [self.curve(results, sweep) for sweep in self.sweeps]
        named = [(key, _point(results, self.pair(key, value), value)) for key, value in self.named]
        where = f"preset {self.preset}, rule {self.rule}"
        tables = {"By error": _table(curves, named), "Where the benefit is lost": _crossings(curves)}
        drawn = {
            "break_even": figures.break_even(curves, "benefit", where),
            "break_even_parts": figures.break_even(curves, "parts", where),
        }
        files = {"break_even.csv": _csv(curves, named)}
        return Answer(
            "How wrong may localisation and map be before a lane filter hurts?",
            findings(curves, named),
            tables,
            drawn,
            files,
            NOTES,
        )


NOTES = (
    "Benefit: collisions avoided per must-brake scene less unnecessary stops per nothing scene, of the map "
    "filter along the planned path less the planned path alone. One weighs as much as the other: a "
    "yardstick, "
    "and no trade-off of lives against comfort; both are given separately.",
    "A bias has in each scene the sign of a coin: its side is not known.",
    "The crossing is interpolated linearly between the sizes that were run; its interval is that of "
    f"{RESAMPLES} "
    "resamples of the scenes (percentiles, seeded).",
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


def findings(curves: Sequence[Curve], named: Sequence[tuple[str, Point]]) -> list[str]:
    """The answer in sentences."""
    start = curves[0].points[0] if curves else None
    lines = []
    if start:
        lines.append(
            f"Without errors the map filter against the planned path: collisions avoided "
            f"{points_text(start.avoided)}, unnecessary stops {points_text(start.stops)}, benefit "
            f"{points_text(start.benefit)} points."
        )
    lines += [_crossing_sentence(curve) for curve in curves]
    lines += [
        f"{PARAMETERS[key].text} {point.value}: collisions avoided {points_text(point.avoided)}, unnecessary "
        f"stops {points_text(point.stops)} points."
        for key, point in named
    ]
    return lines


def _crossing_sentence(curve: Curve) -> str:
    parameter = PARAMETERS[curve.sweep.parameter]
    most = f"{curve.sweep.values[-1]:g} {parameter.unit}"
    reach = f"[{_size(curve.low)}, {_size(curve.high)}]"
    if curve.crossing == 0.0:
        return f"{parameter.text}: there is no benefit to lose."
    if math.isinf(curve.crossing):
        return f"{parameter.text}: the benefit is not lost up to {most} (interval of the crossing {reach})."
    return f"{parameter.text}: the benefit is lost at {_size(curve.crossing)} {parameter.unit} {reach}."


def _size(value: float) -> str:
    return "beyond" if math.isinf(value) else f"{value:.2f}"


def _lines(curves: Sequence[Curve], named: Sequence[tuple[str, Point]]) -> list[tuple[str, Point]]:
    return [(curve.sweep.parameter, point) for curve in curves for point in curve.points] + list(named)


def _table(curves: Sequence[Curve], named: Sequence[tuple[str, Point]]) -> Table:
    header = (
        "error",
        "size",
        "collisions avoided (points)",
        "unnecessary stops (points)",
        "benefit (points)",
    )
    rows = []
    for key, point in _lines(curves, named):
        parameter = PARAMETERS[key]
        size = point.value if isinstance(point.value, str) else f"{point.value:g} {parameter.unit}".strip()
        parts = (point.avoided, point.stops, point.benefit)
        rows.append((parameter.text, size, *map(points_text, parts)))
    return Table(header, tuple(rows), (), "Map filter less planned path in the same scenes; 95 % intervals.")


def _crossings(curves: Sequence[Curve]) -> Table:
    rows = tuple(
        (
            PARAMETERS[c.sweep.parameter].text,
            PARAMETERS[c.sweep.parameter].unit,
            fixed(c.crossing, 2) if math.isfinite(c.crossing) else f"{EMPTY} (beyond {c.sweep.values[-1]:g})",
            f"[{_size(c.low)}, {_size(c.high)}]",
        )
        for c in curves
    )
    return Table(("error", "unit", "benefit lost at", "95 % interval"), rows)


def _csv(curves: Sequence[Curve], named: Sequence[tuple[str, Point]]) -> bytes:
    header = ["parameter", "value"]
    for name in ("avoided", "stops", "benefit"):
        header += [name, f"{name}_low", f"{name}_high"]
    rows = []
    for key, point in _lines(curves, named):
        line: list[object] = [key, point.value]
        for part in (point.avoided, point.stops, point.benefit):
            line += [part.value, part.low, part.high]
        rows.append(line)
    return csv_bytes(header, rows)
