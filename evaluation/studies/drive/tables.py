"""Tables of drives: `drives.csv`, a row per drive and one for all; `events.csv`, a row per request."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from itertools import groupby

from evaluation.results.gates import Side
from evaluation.results.tables import EMPTY, Table, csv_bytes
from evaluation.studies.drive.measures import DriveRow, LoggedEvent, LoggedRow, total_of

EVENTS_CSV, DRIVES_JSON = "events.csv", "drives.json"

HINDSIGHT = (
    "Open loop: the recorded vehicle was not braked. The planned path is the way that it then drove, which "
    "no planner knows; every strategy has it."
)

DRIVE_COLUMNS = tuple(field.name for field in dataclasses.fields(LoggedRow))
EVENT_COLUMNS = tuple(field.name for field in dataclasses.fields(LoggedEvent))


def with_totals(rows: Iterable[LoggedRow]) -> list[LoggedRow]:
    """The rows, and one for all sequences of each strategy, settings and rule that has several."""
    completed: list[LoggedRow] = []
    for _, group in groupby(rows, lambda row: row.side):
        members = list(group)
        completed += members
        if len(members) > 1:
            completed.append(LoggedRow(**dataclasses.asdict(total_of(members)), log=None))
    return completed


def totals_of(rows: Iterable[LoggedRow]) -> list[LoggedRow]:
    """The last row of each strategy, settings and rule: that of all its sequences."""
    return [list(group)[-1] for _, group in groupby(rows, lambda row: row.side)]


def drives_csv(rows: Sequence[LoggedRow]) -> bytes:
    """The rows as CSV."""
    return csv_bytes(DRIVE_COLUMNS, (dataclasses.astuple(row) for row in rows))


def events_csv(events: Iterable[LoggedEvent]) -> bytes:
    """Every request of every drive as CSV."""
    return csv_bytes(EVENT_COLUMNS, (dataclasses.astuple(event) for event in events))


def common_settings(texts: Iterable[str]) -> tuple[str, dict[str, str]]:
    """What is common to several settings, and what each has beyond that, as they are typed."""
    parts = {text: [part for part in text.split(", ") if part] for text in texts}
    common = [part for part in next(iter(parts.values()), []) if all(part in p for p in parts.values())]
    own = {text: ", ".join(part for part in own if part not in common) for text, own in parts.items()}
    return ", ".join(common), own


def summary_table(rows: Sequence[LoggedRow]) -> Table:
    """One line per strategy, settings and rule, of all its sequences."""
    of_all = totals_of(rows)
    common, own = common_settings(row.settings for row in of_all)
    varied, warn = any(own.values()), any(row.warnings for row in of_all)
    header = ["strategy", *(["settings"] if varied else []), "rule"]
    header += ["km", "h", "pedestrians met", "requests", "false activations", "undecided"]
    header += ["warnings", "false warnings"] if warn else []
    lines = []
    for row in of_all:
        line = [row.strategy, *([own[row.settings]] if varied else []), row.rule]
        line += [f"{row.km:.2f}", f"{row.hours:.3f}"]
        line.append(EMPTY if row.pedestrians is None else str(row.pedestrians))
        line += [str(row.requests), str(row.false_activations), str(row.undecided)]
        line += [str(row.warnings), str(row.false_warnings)] if warn else []
        lines.append(tuple(line))
    settings = [f"Settings of all: {common}."] if common else []
    return Table(tuple(header), tuple(lines), caption=" ".join((HINDSIGHT, *settings, *_bounds(of_all, own))))


def _bounds(rows: Sequence[DriveRow], own: dict[str, str]) -> list[str]:
    """What no request at all says about the rate."""
    quiet = [row for row in rows if row.at_most_per_km is not None]
    if not quiet:
        return []
    bound = quiet[0].at_most_per_km
    names = "; ".join(side_name(row.strategy, own[row.settings], row.rule) for row in quiet)
    return [
        f"No request ({names}): with 95 % confidence fewer than {bound:.2g} per km on such ways (3 / km)."
    ]


DRIVE_MEASURES = (
    "requests", "false_activations", "undecided", "standing", "warnings", "false_warnings",
    "undecided_warnings", "false_per_km", "km", "hours", "frames", "pedestrians",
)  # fmt: skip
"""Of a strategy, settings and rule over all drives, for `--fail-on`."""


def sides_of_drives(rows: Iterable[DriveRow]) -> list[Side]:
    """What strategies, settings and rules came to, with `DRIVE_MEASURES`.

    Args:
        rows: a row for each, of all its drives.
    """
    return [
        Side(
            row.strategy,
            {
                name: (row.false_activations / row.km if row.km else None)
                if name == "false_per_km"
                else getattr(row, name)
                for name in DRIVE_MEASURES
            },
            side_name("", row.settings, row.rule),
        )
        for row in rows
    ]


def side_name(strategy: str, settings: str, rule: str) -> str:
    """Strategy, settings and rule as one text."""
    return ", ".join(part for part in (strategy, settings, rule) if part)
