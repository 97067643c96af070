"""Runs whose logs are written into a folder as they end."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from evaluation.results.files import discard_tables, log_path
from evaluation.results.logs import write_log
from evaluation.runs.execution import RunRecord, execute
from evaluation.runs.workers import Workers, execute_all
from scenarios.spec import RunSpec


def logged_runs(
    specs: Sequence[RunSpec],
    folder: Path,
    workers: Workers,
    done: Callable[[], object] = lambda: None,
    keep_logs: bool = True,
    through: bool = False,
) -> Iterator[RunRecord]:
    """Carry out runs, and write the log of each; the records come in the order of the runs, without logs.

    Args:
        specs: the runs.
        folder: of the results; its old tables are removed before the first log is written.
        workers: processes, or a scheduler.
        done: called after each run.
        keep_logs: whether logs are written at all.
        through: see `evaluation.runs.execution.execute`.

    Raises:
        ResultsError: the folder cannot be written.
    """
    first = True
    for record in execute_all(partial(execute, keep_log=keep_logs, through=through), specs, workers):
        if record.log is not None:
            if first:
                discard_tables(folder)
                first = False
            write_log(log_path(folder, record.spec.log), record.log)
        done()
        yield replace(record, log=None)
