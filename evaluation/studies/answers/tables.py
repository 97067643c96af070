"""Tables and sentences that the questions share; every number in them is computed."""

from __future__ import annotations

import math
from collections.abc import Sequence

from evaluation.metrics.intervals import Estimate
from evaluation.results.tables import EMPTY, Table, csv_bytes, fixed
from evaluation.studies.answers.arms import Arm
from evaluation.studies.answers.measures import DECISIVE, MEASURES, Measure
from evaluation.studies.answers.results import Difference, Results
from scenarios.settings import settings_text


def rates_table(results: Results, arms: Sequence[Arm]) -> Table:
    """A line per arm: what its runs came to, over the scenes."""
    header = ["who", *map(_heading, MEASURES.values()), "cut off"]
    rows = [
        (
            arm.name,
            *(_cell(results.estimate(arm, name), name) for name in MEASURES),
            str(sum(run.cut_off for run in results.runs[arm])),
        )
        for arm in arms
    ]
    counts = {must: sum(s.must == must for s in results.scenes) for must in ("brake", "nothing")}
    caption = (
        f"{counts['brake']} scenes in which the ego must brake, {counts['nothing']} in which nothing should "
        "happen; 95 % intervals over the scenes (rates: Wilson, means: Student, medians: order statistics). "
        "Early activations: of the scenes whose target stands at first and sets off. Speed lost and peak "
        "deceleration: where nothing should happen. TTC: only of the n runs with a request, or warning, that "
        "was not early: who asks in fewer scenes may ask earlier in these. Runs that were cut off are in no "
        "number."
    )
    return Table(tuple(header), tuple(rows), (), caption)


def _heading(measure: Measure) -> str:
    return f"{measure.text} ({measure.unit or '%'}{', median' if measure.partial else ''})"


def _cell(estimate: Estimate, measure: str) -> str:
    text = interval_text(estimate, measure)
    return f"{text}, n = {estimate.count}" if MEASURES[measure].partial and estimate.count else text


def differences_table(differences: Sequence[Difference], questions: int, more: str = "") -> Table:
    """A line per pair of arms: both decisive measures, with discordant scenes and p-values.

    Args:
        differences: to be shown.
        questions: for how many their p-values are corrected.
        more: sentences after those that explain the table.
    """
    header = ["who", "against"]
    for name in DECISIVE:
        header += [f"{MEASURES[name].text} (points)", "more : fewer", "p", "p (Holm)"]
    lines: dict[tuple[str, str], list[str]] = {}
    for d in differences:
        line = lines.setdefault((d.arm.name, d.against.name), [d.arm.name, d.against.name])
        line += [change_text(d), f"{d.more} : {d.fewer}", p_text(d.p_value), p_text(d.adjusted)]
    caption = (
        "Scene by scene, with the same sensor noise: difference with Tango's interval (95 %), scenes in "
        "which only the one or only the other is so, p-value of McNemar's exact test, and the same corrected "
        f"for all {questions} questions of this study."
    )
    return Table(tuple(header), tuple(map(tuple, lines.values())), (), f"{caption} {more}".rstrip())


def differences_csv(differences: Sequence[Difference]) -> bytes:
    """One line per difference."""
    header = (
        "preset", "rule", "name", "settings", "against", "against_settings", "measure", "difference", "low",
        "high", "scenes", "more", "fewer", "p_value", "p_holm",
    )  # fmt: skip
    rows = [
        (
            d.arm.preset, d.arm.rule, d.arm.name, d.arm.text, d.against.name, d.against.text, d.measure,
            d.estimate.value, d.estimate.low, d.estimate.high, d.estimate.count, d.more, d.fewer, d.p_value,
            d.adjusted,
        )
        for d in differences
    ]  # fmt: skip
    return csv_bytes(header, rows)


def estimates_csv(results: Results) -> bytes:
    """One line per arm and measure."""
    header = ("preset", "rule", "name", "settings", "measure", "value", "low", "high", "count")
    rows = []
    for arm in results.runs:
        for name in MEASURES:
            e = results.estimate(arm, name)
            rows.append((arm.preset, arm.rule, arm.name, arm.text, name, e.value, e.low, e.high, e.count))
    return csv_bytes(header, rows)


def arms_table(arms: Sequence[Arm]) -> Table:
    """What stands behind the names."""
    rows = tuple(
        (arm.name, arm.strategy, arm.path_from or EMPTY, settings_text(arm.settings) or EMPTY) for arm in arms
    )
    return Table(("who", "strategy", "path from", "settings"), tuple(dict.fromkeys(rows)))


_SOURCES = {
    "planner": "from the planner, exact relative to the ego under every error of localisation and map",
    "map": "from the map, as wrong as that and the localisation are",
    "": "none",
}


def path_note(arms: Sequence[Arm]) -> str:
    """Where the planned path of each side comes from, in a sentence."""
    names: dict[str, list[str]] = {}
    for arm in arms:
        of_source = names.setdefault(arm.path_from, [])
        of_source += [arm.name] * (arm.name not in of_source)
    parts = [f"{_SOURCES[source]} ({', '.join(of)})" for source, of in names.items()]
    return f"Planned path: {'; '.join(parts)}."


def interval_text(estimate: Estimate, measure: str) -> str:
    """`74 [70, 78]`; rates in percent."""
    compared = MEASURES[measure]
    scale = 1.0 if compared.unit else 100.0
    digits = compared.digits if compared.unit else 1
    value, low, high = (fixed(scale * v, digits) for v in (estimate.value, estimate.low, estimate.high))
    return value if math.isnan(estimate.low) else f"{value} [{low}, {high}]"


def points_text(estimate: Estimate) -> str:
    """`+1.3 [-0.5, +3.1]`, in percentage points."""
    value, low, high = (fixed(100 * v, 1, "+") for v in (estimate.value, estimate.low, estimate.high))
    return value if math.isnan(estimate.low) else f"{value} [{low}, {high}]"


def change_text(d: Difference) -> str:
    """A difference with its interval, in points or the unit of the measure."""
    compared = MEASURES[d.measure]
    if not compared.unit:
        return points_text(d.estimate)
    numbers = (d.estimate.value, d.estimate.low, d.estimate.high)
    value, low, high = (fixed(v, compared.digits, "+") for v in numbers)
    return value if math.isnan(d.estimate.low) else f"{value} [{low}, {high}]"


def p_text(p_value: float) -> str:
    """A p-value as it is printed."""
    if math.isnan(p_value):
        return EMPTY
    return "< 0.001" if p_value < 0.001 else f"{p_value:.2g}"


def verdict(differences: Sequence[Difference]) -> str:
    """What one arm does against another, in one sentence, from its decisive differences."""
    first = differences[0]
    parts = [f"{MEASURES[d.measure].text} {change_text(d)} points" for d in differences]
    decided = [MEASURES[d.measure].text for d in differences if d.is_decided]
    if len(decided) == len(differences):
        end = "both are decided"
    elif decided:
        end = f"decided is the difference in {decided[0]}"
    else:
        end = "neither is decided by these scenes"
    return f"{first.arm.name} against {first.against.name}: {' and '.join(parts)}; {end}."
