"""What differs between two folders, as tables for the terminal and the page, and as CSV."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

from evaluation.results.files import write_files
from evaluation.results.tables import EMPTY, Table, csv_bytes
from evaluation.studies.diff.difference import Difference, Pair
from evaluation.studies.diff.results import SEVERITY
from evaluation.views.tables_page import Section, tables_page

MOST_SHOWN = 30
"""Lines of a table on the terminal; the files have all."""

PAGE, CHANGES_CSV, OUTCOMES_CSV = "diff.html", "changes.csv", "outcomes.csv"


def tables(folders: Difference, most: int | None = MOST_SHOWN) -> list[tuple[str, Table]]:
    """Title and table of: configuration, outcomes, runs that flip, numbers; those without lines left out.

    Args:
        folders: what differs.
        most: lines of a table; None: all.
    """
    made = [
        ("What determines the runs", _change_table(folders)),
        ("Outcomes, runs in both folders", _outcome_table(folders)),
        ("Runs with another outcome", _flip_table(folders)),
        ("Numbers that differ", _number_table(folders, most is None)),
        ("Runs in one folder only", _only_table(folders)),
    ]
    return [(title, _shortened(table, most)) for title, table in made if table.rows]


def summary(folders: Difference) -> str:
    """How much differs, in one line."""
    flips, differing = len(folders.flips), len(folders.differing)
    alone = len(folders.only_first) + len(folders.only_second)
    return (
        f"{len(folders.pairs)} runs in both folders: {flips} with another outcome, {differing - flips} more "
        f"with other numbers; {alone} in one folder only; {len(folders.changes)} changes of their inputs"
    )


def write_report(folders: Difference, out: Path) -> list[Path]:
    """Write `diff.html`, `changes.csv` and `outcomes.csv`.

    Raises:
        ResultsError: the folder cannot be written.
    """
    changes = [(c.kind, c.name, c.first, c.second, c.runs) for c in folders.changes]
    names = list(dict.fromkeys(name for pair in folders.pairs for name in pair.first.measures))
    header = ["run", "strategy", "outcome_first", "outcome_second", "log_first", "log_second"]
    header += [f"{name}_{which}" for name in names for which in ("first", "second")]
    rows = []
    for pair in folders.pairs:
        row: list[object] = [pair.name, pair.strategy, pair.first.outcome, pair.second.outcome]
        row += [pair.first.log, pair.second.log]
        row += [run.measures.get(name) for name in names for run in (pair.first, pair.second)]
        rows.append(row)
    empty = [None] * (len(header) - 4)
    rows += [[name, None, "", None, *empty] for name in folders.only_first]
    rows += [[name, None, None, "", *empty] for name in folders.only_second]
    sections = [Section(title, table) for title, table in tables(folders, None)]
    title = f"{folders.first.path.name} and {folders.second.path.name}"
    lead = (f"First: {folders.first.path}", f"Second: {folders.second.path}", f"{summary(folders)}.")
    return write_files(
        out,
        {
            PAGE: tables_page(title, lead, sections).encode(),
            CHANGES_CSV: csv_bytes(("kind", "name", "first", "second", "runs"), changes),
            OUTCOMES_CSV: csv_bytes(header, rows),
        },
    )


def _change_table(folders: Difference) -> Table:
    rows = tuple((c.kind, c.name, c.first or EMPTY, c.second or EMPTY, str(c.runs)) for c in folders.changes)
    return Table(("what", "name", "first", "second", "runs"), rows, caption="Files and plug-ins: SHA-256.")


def _outcome_table(folders: Difference) -> Table:
    """How many runs of each strategy have which outcome, in both folders."""
    counts: dict[str, Counter[tuple[int, str]]] = {}
    for pair in folders.pairs:
        own = counts.setdefault(pair.strategy, Counter())
        own[0, pair.first.outcome] += 1
        own[1, pair.second.outcome] += 1
    rows = []
    for strategy, own in counts.items():
        for outcome in SEVERITY:
            first, second = own[0, outcome], own[1, outcome]
            if first or second:
                rows.append(
                    (
                        strategy,
                        outcome,
                        str(first),
                        str(second),
                        f"{second - first:+d}" if second != first else "0",
                    )
                )
    return Table(("strategy", "outcome", "first", "second", "change"), tuple(rows))


def _flip_table(folders: Difference) -> Table:
    rows = tuple((p.name, p.strategy, p.first.outcome, p.second.outcome, _impact(p)) for p in folders.flips)
    return Table(("run", "strategy", "first", "second", "impact (km/h)"), rows)


def _impact(pair: Pair) -> str:
    """Impact speeds of both, where there are any."""
    values = [run.measures.get("v_impact_kmh") for run in (pair.first, pair.second)]
    if not any(values):
        return EMPTY
    return " → ".join(EMPTY if value is None else f"{value:.1f}" for value in values)


def _number_table(folders: Difference, named: bool) -> Table:
    """Of each measure in how many runs it differs, and how much; named: with the run where most."""
    by_name: dict[str, list[tuple[float, str]]] = {}
    for pair in folders.pairs:
        for name, (first, second) in pair.numbers().items():
            change = float("nan") if first is None or second is None else second - first
            by_name.setdefault(name, []).append((change, pair.name))
    rows: list[tuple[str, ...]] = []
    for name, changes in by_name.items():
        numbers = [(change, run) for change, run in changes if change == change]
        change, run = max(numbers, key=lambda item: abs(item[0]), default=(float("nan"), ""))
        line = (name, str(len(changes)), f"{change:+.4g}" if numbers else EMPTY)
        rows.append((*line, run or EMPTY) if named else line)
    caption = "Second less first; runs in which only one folder has a value count, and have no difference."
    header = ("measure", "runs", "largest difference")
    return Table((*header, "in") if named else header, tuple(rows), caption=caption)


def _only_table(folders: Difference) -> Table:
    rows = [("first", name) for name in folders.only_first] + [
        ("second", name) for name in folders.only_second
    ]
    return Table(("folder", "run"), tuple(rows))


def _shortened(table: Table, most: int | None) -> Table:
    if most is None or len(table.rows) <= most:
        return table
    left_out = f"{len(table.rows) - most} more lines are in the files."
    return Table(table.header, table.rows[:most], table.totals, f"{table.caption} {left_out}".strip())
