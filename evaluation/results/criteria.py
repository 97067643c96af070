"""Pass criteria that scenario files name, over the runs of a folder."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from evaluation.results.files import write_bytes
from evaluation.results.rows import RunRow
from evaluation.results.tables import EMPTY, Table, csv_bytes
from scenarios.openscenario.running.driving.criteria import Criterion

CRITERIA_CSV = "criteria.csv"
"""A row per run and criterion; docs/run-log.md has the format."""

Judged = Sequence[tuple[RunRow, Sequence[Criterion]]]
"""Runs with what their files judge them by."""

_COLUMNS = ("log", "scenario", "strategy", "criterion", "met", "detail")


def criteria_table(runs: Judged) -> Table | None:
    """Each criterion by strategy: in how many of its runs it is met; None if no file names one."""
    names = list(dict.fromkeys(criterion.name for _, criteria in runs for criterion in criteria))
    if not names:
        return None
    strategies = list(dict.fromkeys(row.strategy for row, _ in runs))
    lines = []
    for name in names:
        cells = []
        for strategy in strategies:
            own = [
                c for row, criteria in runs if row.strategy == strategy for c in criteria if c.name == name
            ]
            judged = [criterion.met for criterion in own if criterion.met is not None]
            cells.append(f"{sum(judged)} of {len(judged)}" if judged else "not evaluated" if own else EMPTY)
        lines.append((name, *cells))
    return Table(("pass criterion, met in", *strategies), tuple(lines))


def write_criteria(directory: Path, runs: Judged) -> None:
    """Write `criteria.csv`.

    Raises:
        ResultsError: the folder cannot be written.
    """
    rows = [
        (row.log, row.scenario, row.strategy, criterion.name, criterion.met, criterion.detail)
        for row, criteria in runs
        for criterion in criteria
    ]
    write_bytes(directory / CRITERIA_CSV, csv_bytes(_COLUMNS, rows))
