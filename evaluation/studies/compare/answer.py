"""Which width? The answer of a comparison in words, worked out from its numbers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from evaluation.metrics.intervals import Estimate
from evaluation.studies.compare.grid import Point, shown_settings
from evaluation.studies.compare.table import AS_PRESET, Summary
from scenarios.settings import PARAMETERS, Settings, settings_text

WIDTHS = {"map": "margin_m", "rectangular": "half_width_m"}
"""Parameter along each strategy's curve."""


@dataclass(frozen=True, slots=True)
class Curve:
    """A strategy along one of its parameters.

    Args:
        strategy: monitored area.
        parameter: the parameter along the curve; empty where there is but one point.
        fixed: the other settings, the same along the curve.
        values: of the parameter, rising; empty where there is none.
        rows: a summary for each.
    """

    strategy: str
    parameter: str
    fixed: Settings
    values: tuple[float, ...]
    rows: tuple[Summary, ...]

    @property
    def name(self) -> str:
        """Strategy and other settings."""
        other = shown_settings(settings_text(self.fixed)) or ("" if self.parameter else AS_PRESET)
        return f"{self.strategy}, {other}" if other else self.strategy


def curves(rows: Sequence[Summary], points: Sequence[Point]) -> list[Curve]:
    """A curve per strategy and combination of the settings other than its width.

    Args:
        rows: summaries of one weather.
        points: that they are of.
    """
    by_name = {(row.strategy, row.settings): row for row in rows}
    groups: dict[tuple[str, Settings, bool], list[tuple[float, Summary]]] = {}
    for point in points:
        width = WIDTHS.get(point.strategy, "")
        value = dict(point.settings).get(width)
        fixed = tuple((name, other) for name, other in point.settings if name != width)
        at = math.nan if value is None else float(value)
        group = groups.setdefault((point.strategy, fixed, value is None), [])
        group.append((at, by_name[point.strategy, point.text]))
    made = []
    for (strategy, fixed, _), pairs in groups.items():
        ordered = sorted(pairs, key=lambda pair: pair[0])
        values = tuple(value for value, _ in ordered if not math.isnan(value))
        parameter = WIDTHS[strategy] if values else ""
        made.append(Curve(strategy, parameter, fixed, values, tuple(row for _, row in ordered)))
    return made


def best(curve: Curve) -> int:
    """Index of the point with most collisions avoided.

    Among equals that with the fewest false activations, then the fewest unnecessary stops.
    """

    def rank(k: int) -> tuple[float, float, float, int]:
        row = curve.rows[k]
        return -row.avoided.value, row.false_activations.value, row.needless_stops.value, k

    return min(range(len(curve.rows)), key=rank)


def answer(rows: Sequence[Summary], points: Sequence[Point]) -> list[str]:
    """Sentences on the width of each strategy's area."""
    lines: list[str] = []
    weathers = list(dict.fromkeys(row.weather for row in rows))
    for weather in weathers:
        where = f" ({weather})" if len(weathers) > 1 else ""
        lines += [
            f"{curve.name}{where}: {_told(curve)}"
            for curve in curves([row for row in rows if row.weather == weather], points)
            if curve.strategy not in WIDTHS or len(curve.rows) > 1 or not curve.fixed
        ]
    return lines


def told_intervals(rows: Sequence[Summary]) -> str:
    """What the intervals mean, and how far they reach."""
    over_scenes = (
        "Intervals over the scenes say what another choice of scenes would be worth: "
        f"{_reach([row.avoided for row in rows], [row.needless_stops for row in rows])}."
    )
    seeds = max(row.over_seeds["tracks"].count for row in rows)
    if seeds < 2:
        return f"{over_scenes} With one seed there are none over the seeds."
    avoided, stops = ([row.over_seeds[name] for row in rows] for name in ("avoided", "needless_stops"))
    return (
        f"{over_scenes} Intervals over the {seeds} seeds say what other noise and another frame phase would "
        f"be worth on these scenes: {_reach(avoided, stops)}."
    )


def _reach(avoided: Sequence[Estimate], stops: Sequence[Estimate]) -> str:
    """How wide intervals are, in percentage points."""
    texts = []
    for name, rates in (("collisions avoided", avoided), ("unnecessary stops", stops)):
        widths = [100 * (rate.high - rate.low) for rate in rates if rate.count]
        if widths:
            low, high = f"{min(widths):.0f}", f"{max(widths):.0f}"
            texts.append(f"{low if low == high else f'{low} to {high}'} points of {name}")
    return " and ".join(texts)


def _told(curve: Curve) -> str:
    first, last = curve.rows[0], curve.rows[-1]
    if len(curve.values) < 2:
        return f"{_numbers(first)}."
    parameter, k = PARAMETERS[curve.parameter], best(curve)
    text = (
        f"of {len(curve.values)} values of the {parameter.text} from {curve.values[0]:g} to "
        f"{curve.values[-1]:g} {parameter.unit}, "
    )
    if not first.false_activations.count:
        merit = "is the least that avoids most"
    elif not first.avoided.count:
        merit = "has the fewest false activations"
    else:
        merit = "avoids most at the fewest false activations"
    text += f"{curve.values[k]:g} {parameter.unit} {merit}: {_numbers(curve.rows[k])}. "
    ends = [
        f"{value:g} {parameter.unit}: {_numbers(row)}"
        for value, row in ((curve.values[0], first), (curve.values[-1], last))
        if value != curve.values[k]
    ]
    return text + "; ".join(ends) + "."


def _numbers(row: Summary) -> str:
    """Counts of one summary."""
    avoided, false = row.avoided, row.false_activations
    parts = []
    if avoided.count:
        parts.append(f"{avoided.hits} of {avoided.count} collisions avoided")
    if false.count:
        still = row.needless_stops.hits
        parts.append(f"{false.hits} of {false.count} false activations ({still} counting standstills)")
    return ", ".join(parts)
