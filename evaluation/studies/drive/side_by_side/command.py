"""The command `smartmot-eval compare --drives`: drives with a journal, tables, and what they decide."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import rich.console

from evaluation.progress import study_progress
from evaluation.results.tables import rich_table
from evaluation.runs.workers import Workers
from evaluation.studies.drive.side_by_side.comparison import (
    DriveComparison,
    SideBySide,
    items_of,
    side_by_side,
)
from evaluation.studies.drive.side_by_side.pairs import MEASURES, pairs_of, told_power
from evaluation.studies.drive.study import DriveStudy, drive_all
from evaluation.studies.logged import LOGGED, MOST_REPLAYS
from evaluation.studies.study import done_line


def compare_drives(
    comparison: DriveComparison, out: Path, workers: Workers = 1, quiet: bool = False, logs: bool = False
) -> SideBySide:
    """Carry a comparison on recorded drives out, or go on with it.

    Args:
        comparison: what is compared.
        out: folder for everything.
        workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
        quiet: print nothing.
        logs: whether to drive again with logs, on the drives that say most, `MOST_REPLAYS` at most.

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
    if logs:
        logged = telling_drives(study, compared)
        with study_progress(console) as progress:
            drive_all(logged, out / LOGGED, progress)
        console.print(
            f"logs of {len(logged.recordings)} of {len(study.recordings)} drives by all sides, "
            f"{MOST_REPLAYS} logs at most; smartmot-eval report {out} makes a page with replays",
            highlight=False,
            soft_wrap=True,
        )
    return compared


def telling_drives(study: DriveStudy, compared: SideBySide) -> DriveStudy:
    """The drives that are logged, by all sides: first those in which some side brakes falsely, or brakes."""
    ranks: Counter[str] = Counter()
    for row in compared.rows:
        ranks[row.sequence] += len(compared.rows) * row.false_activations + row.requests
    most = max(1, MOST_REPLAYS // len(study.specs))
    kept = {name for name, _ in ranks.most_common(most)}
    return replace(study, recordings=tuple(r for r in study.recordings if r.name in kept))
