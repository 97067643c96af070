"""The command `smartmot-eval compare --drives`: drives with a journal, tables, and what they decide."""

from __future__ import annotations

from pathlib import Path

import rich.console

from evaluation.results.tables import rich_table
from evaluation.runs.workers import Workers
from evaluation.studies.drive.side_by_side.comparison import (
    DriveComparison,
    SideBySide,
    items_of,
    side_by_side,
)
from evaluation.studies.drive.side_by_side.pairs import MEASURES, pairs_of, told_power
from evaluation.studies.study import done_line


def compare_drives(
    comparison: DriveComparison, out: Path, workers: Workers = 1, quiet: bool = False
) -> SideBySide:
    """Carry a comparison on recorded drives out, or go on with it.

    Args:
        comparison: what is compared.
        out: folder for everything.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        quiet: print nothing.

    Raises:
        ArgumentError, DatasetError: see `evaluation.studies.drive.study.prepare`.
        ResultsError: the folder cannot be written.
    """
    console = rich.console.Console(quiet=quiet)
    study = comparison.prepared()
    for note in study.notes:
        console.print(f"note: {note}", highlight=False, soft_wrap=True, markup=False)
    questions = len(MEASURES) * len(pairs_of(study.specs))
    console.print(told_power(len(study.recordings), questions), highlight=False)
    items = items_of(study)
    finished, before = comparison.carry_out_behind_bar(
        items, out, comparison.journal, workers, console, "driving"
    )
    compared = side_by_side(study.specs, items, finished, study.notes)
    for note in compared.notes[len(study.notes) :]:
        console.print(f"note: {note}", highlight=False, soft_wrap=True)
    written = compared.write(out, study.specs)
    for heading, table in compared.tables().items():
        if table.rows:
            console.print(rich_table(table, heading, texts=2))
    for line in compared.sentences()[1:]:
        console.print(line, highlight=False)
    names = [path.name for path in written]
    console.print(done_line(len(items), before, out, names).replace(" runs", " drives", 1), highlight=False)
    return compared
