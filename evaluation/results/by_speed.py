"""The tables that a comparison ends with: impact speed and score of each strategy by test speed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

from evaluation.results.files import ResultsError, require_columns
from evaluation.results.rows import (
    RUN_COLUMNS,
    cut_off,
    ordered_strategies,
    varying_conditions,
    without_conflict,
)
from evaluation.results.tables import EMPTY, Table, fixed

if TYPE_CHECKING:
    import pandas as pd

Published = Mapping[float, tuple[float, float | None]]
"""Published impact speed in km/h and score, if there is one, of one strategy by test speed in km/h."""


def comparison_table(runs: pd.DataFrame, published: Mapping[str, Published] | None = None) -> Table:
    """Impact speed and score of each strategy, per test speed.

    Runs that differ in the seed only are averaged. Scenario, preset, adversaries and weather become columns
    where they differ; over several weather conditions the final score is the mean (paper, section IV).

    Args:
        runs: table of runs, as from `read_runs`.
        published: per strategy and test speed in km/h, the published impact speed in km/h and score
            (None where none was published).

    Returns:
        The table, with one line of total scores per condition and, if there were any, runs that were cut off
        and false activations at its foot. A strategy's columns stand together: impact speed, score and, if
        published, that impact speed and how far ours is above it.

    Raises:
        ResultsError: there are no runs or a column is missing.
    """
    _require_runs(runs)
    reference = published or {}
    strategies = ordered_strategies(runs)
    conditions = varying_conditions(runs)
    header = [*conditions, "v_test (km/h)"]
    for strategy in strategies:
        header += [f"{strategy} v_impact (km/h)", "score"]
        if strategy in reference:
            header += ["published (km/h)", "diff. (km/h)"]
    rows: list[tuple[str, ...]] = []
    totals: list[tuple[str, ...]] = []
    for lead, group, speeds in _groups(runs, conditions):
        for speed in speeds:
            cells = [_cells(group, strategy, speed, reference.get(strategy)) for strategy in strategies]
            rows.append((*lead, f"{speed:g}", *(text for cell in cells for text in cell)))
        totals.append((*lead, "total", *_total_cells(group, strategies, speeds, reference)))
    if "weather" in conditions:
        for lead, group, speeds in _groups(runs, [name for name in conditions if name != "weather"]):
            totals.append((*lead, "mean", "total", *_total_cells(group, strategies, speeds, reference)))
    for name, shares in _remarks(runs, strategies):
        line = [name, *[""] * len(conditions)]
        for strategy, share in zip(strategies, shares, strict=True):
            line += [share, *[""] * (3 if strategy in reference else 1)]
        totals.append(tuple(line))
    repeats = int(runs.groupby([*conditions, "strategy", "v_test_kmh"]).size().max())
    caption = f"Means over up to {repeats} runs per speed and strategy." if repeats > 1 else ""
    return Table(tuple(header), tuple(rows), tuple(totals), caption)


def impact_table(runs: pd.DataFrame) -> Table:
    """Impact speed of each strategy, per scenario and test speed, for tests without a score.

    Returns:
        The table, with the contacts and, if there were any, runs that were cut off and false activations at
        its foot.

    Raises:
        ResultsError: there are no runs or a column is missing.
    """
    _require_runs(runs)
    strategies = ordered_strategies(runs)
    conditions = varying_conditions(runs)
    rows = [
        (*lead, f"{speed:g}", *(_impact(_select(group, strategy, speed)) for strategy in strategies))
        for lead, group, speeds in _groups(runs, conditions)
        for speed in speeds
    ]
    finished = runs[~cut_off(runs)]
    contacts = ("contacts", _shares(finished, strategies, finished["collided"]))
    totals = [
        (name, *[""] * len(conditions), *shares) for name, shares in (contacts, *_remarks(runs, strategies))
    ]
    header = (*conditions, "v_test (km/h)", *(f"{strategy} v_impact (km/h)" for strategy in strategies))
    return Table(header, tuple(rows), tuple(totals))


def _require_runs(runs: pd.DataFrame) -> None:
    require_columns("comparison of runs", list(runs.columns), RUN_COLUMNS)
    if runs.empty:
        raise ResultsError("comparison of runs: the table of runs is empty; run at least one test")


def _groups(
    runs: pd.DataFrame, conditions: Sequence[str]
) -> Iterator[tuple[list[str], pd.DataFrame, list[float]]]:
    """Values of the conditions as text, the runs that have them, and the test speeds of these."""
    for values, group in runs.groupby(list(conditions), sort=True) if conditions else [((), runs)]:
        yield [str(value) for value in values], group, sorted({float(v) for v in group["v_test_kmh"]})


def _shares(runs: pd.DataFrame, strategies: Sequence[str], marks: pd.Series[bool]) -> list[str]:
    """How many runs of each strategy are marked."""
    chosen = [marks[runs["strategy"] == strategy] for strategy in strategies]
    return [f"{int(marked.sum())} of {len(marked)}" for marked in chosen]


def _remarks(runs: pd.DataFrame, strategies: Sequence[str]) -> list[tuple[str, list[str]]]:
    """What lowers the worth of a result, where it happened: name, and how many runs of each strategy."""
    can_be = runs[runs["false_activation"].notna()]
    remarks = (
        ("cut off", runs, cut_off(runs)),
        ("no conflict", runs, without_conflict(runs)),
        ("false activations", can_be, can_be["false_activation"].eq(True)),
    )
    return [(name, _shares(group, strategies, marks)) for name, group, marks in remarks if marks.any()]


def _with_conflict(runs: pd.DataFrame) -> pd.DataFrame:
    """The runs that were not cut off and had a conflict."""
    return runs[~cut_off(runs) & ~without_conflict(runs)]


def _impact(runs: pd.DataFrame) -> str:
    """Mean impact speed of the runs that were not cut off and had a conflict."""
    counted = _with_conflict(runs)
    if len(runs) and counted.empty:
        return "cut off" if cut_off(runs).all() else "no conflict"
    return fixed(float(counted["v_impact_kmh"].mean()) if len(counted) else math.nan, 2)


def _select(group: pd.DataFrame, strategy: str, speed: float) -> pd.DataFrame:
    return group[(group["strategy"] == strategy) & (group["v_test_kmh"] == speed)]


def _cells(group: pd.DataFrame, strategy: str, speed: float, published: Published | None) -> list[str]:
    """Texts of one strategy at one speed."""
    runs = _select(group, strategy, speed)
    texts = [_impact(runs), fixed(float(runs["score"].mean()) if len(runs) else math.nan, 2)]
    if published is not None:
        impact = float(_with_conflict(runs)["v_impact_kmh"].mean())
        printed, _ = published.get(speed, (math.nan, None))
        texts += [fixed(printed, 2), fixed(impact - printed, 2, "+")]
    return texts


def _total_cells(
    group: pd.DataFrame,
    strategies: Sequence[str],
    speeds: Sequence[float],
    reference: Mapping[str, Published],
) -> list[str]:
    """Sums of each strategy's scores: its mean at every speed, over what could be won there."""
    texts: list[str] = []
    for strategy in strategies:
        runs = [_select(group, strategy, speed) for speed in speeds]
        scored = [of_speed for of_speed in runs if of_speed["score"].notna().any()]
        total = EMPTY
        if scored:
            won = sum(float(of_speed["score"].mean()) for of_speed in scored)
            most = sum(float(of_speed["score_max"].mean()) for of_speed in scored)
            total = f"{won:.2f}/{most:g}"
        texts += ["", total]
        if strategy in reference:
            printed = [reference[strategy][speed][1] for speed in speeds if speed in reference[strategy]]
            known = [score for score in printed if score is not None]
            texts += [f"score {sum(known):g}" if known else "", ""]
    return texts
