"""Runs of folders of results as files of other tools: one run, or all of a folder."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path

from evaluation.results.files import log_path
from evaluation.results.rows import read_runs
from evaluation.runs.configuration import Stored, read_configuration
from evaluation.runs.folder import (
    UNKNOWN_SETUP,
    Run,
    RunSetup,
    read_folder,
    read_setups,
    read_shown_log,
)
from evaluation.runs.recordings import is_log_alone, recording_of_run, split_run
from evaluation.runs.workers import execute_all
from evaluation.views.traces.mcap import SUFFIX, write_mcap
from evaluation.views.traces.run import LoggedRun
from opendrive import OpenDriveError, load_map

MCAP_FOLDER = "mcap"


def logged_run(run: Path, allow_plugins: bool = False) -> tuple[LoggedRun, tuple[str, ...]]:
    """A run by its name, and what is missing; see `evaluation.views.film.replay.replay`.

    Raises:
        ResultsError: the folder or the log cannot be read.
        ArgumentError: the folder has no such run.
    """
    if is_log_alone(run):
        note = "Only the log is known: lanes and monitored areas are not drawn."
        return LoggedRun(run.stem, read_shown_log(run)), (note,)
    directory, name = split_run(run)
    folder = read_folder(directory, allow_plugins)
    return _with_setup(directory, folder.row(name), folder.setup(name)), folder.notes


def truth_of_run(run: Path) -> tuple[LoggedRun, tuple[str, ...]]:
    """A run on the map of its scenario, with heights as there, and what is missing; see `recording_of_run`.

    Raises:
        ResultsError: the log cannot be read.
    """
    directory, name = split_run(run)
    recording = recording_of_run(run)
    network, notes = None, recording.notes
    if recording.map_path is not None:
        try:
            network = load_map(recording.map_path)
        except (OpenDriveError, OSError) as error:
            notes += (f"The map is not known: {' '.join(str(error).split())}",)
    log = read_shown_log(run if run.is_file() else log_path(directory, name))
    heights = {identity: other.height_m for identity, other in enumerate(recording.others)}
    return LoggedRun(name, log, network, height_m=heights), notes


def write_run_mcaps(
    out: Path, workers: int = 1, progress: Callable[[int, int], None] = lambda done, total: None
) -> tuple[str, ...]:
    """Write every run that a folder has a log of as `mcap/NAME.mcap`; the same for any number of workers.

    Monitored areas of the user's own are made again, as by the command that has just run them.

    Args:
        out: folder of results.
        workers: processes.
        progress: called with the runs written so far and their number.

    Returns:
        What the files do not show, a line each.

    Raises:
        ResultsError: the folder cannot be read.
        ArgumentError: foxglove-sdk is missing, or a file cannot be written.
    """
    rows = [row for row in read_runs(out).to_dict("records") if isinstance(row["log"], str)]
    stored = read_configuration(out)
    by_log = {run.spec.log: run for run in stored.runs}
    jobs = [(row, replace(stored, runs=(by_log[row["log"]],))) for row in rows]
    notes: dict[str, None] = {}
    for done, lines in enumerate(execute_all(partial(_write_run, out), jobs, workers), 1):
        progress(done, len(rows))
        notes |= dict.fromkeys(lines)
    return tuple(notes)


def _write_run(out: Path, job: tuple[Run, Stored]) -> tuple[str, ...]:
    """Write one run of a folder."""
    import pandas as pd

    row, stored = job
    name = str(row["log"])
    setups, notes = read_setups(out, stored, pd.DataFrame([row]), allow_plugins=True)
    run = _with_setup(out, row, setups.get(name, UNKNOWN_SETUP))
    return (*notes, *write_mcap(out / MCAP_FOLDER / f"{name}{SUFFIX}", run))


def _with_setup(directory: Path, row: Run, setup: RunSetup) -> LoggedRun:
    """A run of a folder."""
    name, contact_s = str(row["log"]), float(row["contact_time_s"])
    return LoggedRun(
        name,
        read_shown_log(log_path(directory, name)),
        setup.network,
        setup.strategy,
        contact_time_s=None if math.isnan(contact_s) else contact_s,
    )
