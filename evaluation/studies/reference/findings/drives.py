"""What recorded drives came to, in sentences from their kept tables."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evaluation.results.files import ResultsError
from evaluation.results.tables import Table
from evaluation.studies.drive.measures import DriveEvent, DriveRow
from evaluation.studies.drive.side_by_side.comparison import SideBySide
from evaluation.studies.drive.side_by_side.pairs import MEASURES, DriveDifference, Side
from evaluation.studies.drive.side_by_side.totals import told_way
from evaluation.studies.drive.tables import EVENTS_CSV
from evaluation.studies.reference.kept import read_records, read_rows
from evaluation.studies.reference.outside import DrivesPart
from evaluation.studies.reference.words import counted, listed, span

LEVEL = 0.05
"""Of the tests."""

EARLY_S = 1.0
"""Ten frames of most recordings: tracks have hardly begun."""


@dataclass(frozen=True, slots=True, eq=False)
class KeptDrives:
    """A part with its kept drives.

    Args:
        part: what was driven.
        compared: what came out.
    """

    part: DrivesPart
    compared: SideBySide

    @property
    def title(self) -> str:
        """Of the data."""
        return TITLES[self.part.name.rpartition("/")[2]]


TITLES = {
    "kitti": "KITTI, a detector's output, without a map",
    "argoverse2": "Argoverse 2, labels with the errors of a sensor, with its map",
}
"""By the last part of the name."""


def read(parts: Sequence[DrivesPart], reports: Path) -> list[KeptDrives]:
    """The parts that are kept: they need data of others.

    Raises:
        ResultsError: a table is missing or of another version.
    """
    there = [part for part in parts if (reports / part.name / part.table).is_file()]
    return [KeptDrives(part, _compared(reports / part.name, part)) for part in there]


def _compared(folder: Path, part: DrivesPart) -> SideBySide:
    path = folder / "differences.csv"
    try:
        pairs = [(_side(row, ""), _side(row, "against_")) for row in read_rows(path)]
    except (KeyError, csv.Error) as error:
        raise ResultsError(f"{path}: not a table of this version ({error!r}); make it again") from None
    rows = read_records(folder / part.table, DriveRow)
    if not rows:
        raise ResultsError(f"{folder / part.table}: no drives; make it again")
    return SideBySide(
        tuple(dict.fromkeys(pairs)), tuple(rows), tuple(read_records(folder / EVENTS_CSV, DriveEvent))
    )


def _side(row: dict[str, str], against: str) -> Side:
    return row[f"{against}strategy"], row[f"{against}settings"], row[f"{against}rule"]


def told_in_short(kept: Sequence[KeptDrives]) -> str:
    """What so few kilometres say at all."""
    parts = []
    for drives in kept:
        totals = drives.compared.totals
        false = [row.false_activations for row in totals]
        parts.append(
            f"{drives.title} ({told_way(totals[0])}): {span(false, 0)} false activations by area and rule, "
            f"{counted(len(_decided(drives)), len(drives.compared.differences))} differences decided"
        )
    areas = [d for drives in kept for d in _decided(drives) if d.side[0] != d.against[0]]
    end = "" if areas else " Which area is quieter, so few drives do not decide."
    return f"**And on recorded drives?** {'; '.join(parts)}.{end}"


def _decided(drives: KeptDrives) -> list[DriveDifference]:
    return [d for d in drives.compared.differences if d.p_corrected <= LEVEL]


def findings(drives: KeptDrives) -> list[str]:
    """What can be said of the drives, and what not."""
    compared = drives.compared
    occasions, totals = compared.occasions, compared.totals
    asked = [len(occasion.sides(MEASURES[0])) for occasion in occasions]
    drives_count = f"{len(compared.drives)} drive{'s' * (len(compared.drives) != 1)}"
    lines = [f"{drives_count}, {told_way(totals[0])}.", *compared.sentences()]
    if occasions:
        lines.append(
            f"Occasions on which any side asked for the brake: {len(occasions)}; all {len(totals)} sides did "
            f"on {asked.count(len(totals))} of them, one side alone on {asked.count(1)}."
        )
        early = sum(occasion.events[0].time_s <= EARLY_S for occasion in occasions)
        lines += [
            f"Of these, {early} within {EARLY_S:g} s of a recording's start, before anything has been "
            "tracked for long: a vehicle that comes along has tracks by then."
        ] * bool(early)
    return [*lines, *_told_pairs(drives)]


def _told_pairs(drives: KeptDrives) -> list[str]:
    """Where the false activations of two areas differ, and which differences are decided."""
    areas: dict[tuple[str, str], list[str]] = {}
    for d in drives.compared.differences:
        if d.side[0] != d.against[0] and d.measure == MEASURES[1] and d.count != d.count_against:
            text = f"{d.count} against {d.count_against} with {d.side[2]}"
            areas.setdefault((d.side[0], d.against[0]), []).append(text)
    lines = [
        f"False activations of {strategy} against {against}: {listed(texts)}; with the other rules as many."
        for (strategy, against), texts in areas.items()
    ]
    lines += [
        f"Decided: {_name(d.side)} has {d.count} {d.measure.replace('_', ' ')}, {_name(d.against)} "
        f"{d.count_against} (p = {d.p_corrected:.2g}, corrected)."
        for d in _decided(drives)
    ]
    return lines


def _name(side: Side) -> str:
    return f"{side[0]} with {side[2]}"


def rules_table(drives: KeptDrives) -> Table:
    """False activations and undecided requests by rule and strategy."""
    totals = {row.side: row for row in drives.compared.totals}
    strategies = list(dict.fromkeys((strategy, settings) for strategy, settings, _ in totals))
    lines = []
    for rule in dict.fromkeys(rule for *_, rule in totals):
        cells = [totals[(*side, rule)] for side in strategies]
        lines.append((rule, *(f"{row.false_activations} + {row.undecided}" for row in cells)))
    caption = "False activations + undecided requests."
    return Table(("rule", *(strategy for strategy, _ in strategies)), tuple(lines), caption=caption)
