"""Drives of a data set: every sequence with every strategy and rule, their files and tables."""

from __future__ import annotations

import os
import time
from collections.abc import Sequence as Many
from dataclasses import dataclass
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.progress import Progress
from evaluation.results.files import (
    DRIVES_CSV,
    TABLE_MD,
    configuration_json,
    discard_tables,
    log_path,
    write_files,
)
from evaluation.results.logs import write_log
from evaluation.results.tables import Table, markdown_table
from evaluation.studies.drive.drive import DETECTIONS, LABELS, Drive, DriveSpec, carry_out, drivable
from evaluation.studies.drive.tables import (
    DRIVES_JSON,
    EVENTS_CSV,
    DriveRow,
    drive_rows,
    drives_csv,
    events_csv,
    summary_table,
)
from evaluation.studies.mot.run import chosen
from scenarios.errors import DatasetError
from scenarios.presets import named_preset
from scenarios.recorded.dataset import Dataset, Sequence
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.maps.drive_map import load_drive_map, map_of
from scenarios.recorded.tables.columns import Columns
from scenarios.recorded.vehicles import Vehicle, vehicle_of
from scenarios.settings import Settings
from scenarios.sources.pose_errors import NO_LOCALISATION_ERRORS
from smartmot.maps.lane_map import LaneMap

NEEDS_MAP = "map"
"""Strategy that is nothing without a map."""


@dataclass(frozen=True, slots=True)
class Options:
    """What the user asks for.

    Args:
        folder: the data set.
        form: its format; None: what the files look like.
        sequences: only these, comma-separated; None: all.
        strategies: names of monitored areas; empty: all shipped ones that can be had.
        rules: names of brake rules, and the settings that choose them.
        preset: name of the conditions.
        sees: labels or detections; None: detections where there are any.
        map_file: a map in the frame of the poses; None: the recordings' own, if they have one.
        seed: of the errors of labels that stand in for detections.
        vehicle: the recording vehicle; None: that of the format.
        columns: what the columns of a table mean; None: it has ours.
    """

    folder: Path
    form: str | None = None
    sequences: str | None = None
    strategies: tuple[str, ...] = ()
    rules: tuple[tuple[str, Settings], ...] = (("paper", ()),)
    preset: str = "real"
    sees: str | None = None
    map_file: Path | None = None
    seed: int = 0
    vehicle: Vehicle | None = None
    columns: Columns | None = None


@dataclass(frozen=True, slots=True, eq=False)
class DriveStudy:
    """What is driven.

    Args:
        options: what was asked for.
        form: format of the data.
        sequences: the recordings.
        specs: how each is seen and judged.
        lane_map: the map; None: there is none.
        notes: what a user should know, a line each.
    """

    options: Options
    form: str
    sequences: tuple[Sequence, ...]
    specs: tuple[DriveSpec, ...]
    lane_map: LaneMap | None
    notes: tuple[str, ...]

    @property
    def frame_count(self) -> int:
        """Frames of all drives."""
        return len(self.specs) * sum(map(len, self.sequences))

    @property
    def recorded_s(self) -> float:
        """Recorded time of all drives."""
        return len(self.specs) * sum(float(sequence.stamp_s[-1]) for sequence in self.sequences)


@dataclass(frozen=True, slots=True, eq=False)
class DriveResult:
    """What a study came to.

    Args:
        drives: by strategy and rule, then in the order of the sequences.
        rows: of `drives.csv`.
        table: the summary.
        written: the files.
        spent_s: processor time of everything but reading and writing.
        notes: what came up on the way, a line each.
    """

    drives: tuple[Drive, ...]
    rows: tuple[DriveRow, ...]
    table: Table
    written: tuple[Path, ...]
    spent_s: float
    notes: tuple[str, ...]


def prepare(options: Options) -> DriveStudy:
    """Read the recordings, and see that what is asked of them is possible.

    Raises:
        ArgumentError: a strategy needs a map.
        DatasetError: a file is wrong, or a sequence is missing or cannot be driven.
    """
    data = read_dataset(options.folder, options.form, options.columns)
    recorded, notes = _driven(data, options.sequences)
    map_path = map_of(recorded, options.map_file)
    if NEEDS_MAP in options.strategies and map_path is None:
        raise ArgumentError(
            "--strategy map: the data have no map; give --map FILE.xodr in the frame of the ego poses"
        )
    lane_map = None if map_path is None else load_drive_map(map_path)
    sees, seen_note = _seen(recorded, options)
    strategies = options.strategies or ("rectangular", *(["map"] if lane_map else []), "all", "path")
    vehicle = options.vehicle or vehicle_of(data.kind)
    specs = tuple(
        DriveSpec(strategy, rule, options.preset, settings, sees, options.seed, vehicle)
        for strategy in strategies
        for rule, settings in options.rules
    )
    for spec in specs:
        spec.preset_for(recorded[0])  # settings out of range are refused before the first drive
    if named_preset(options.preset).localisation != NO_LOCALISATION_ERRORS:
        notes.append(
            f"errors of localisation of preset {options.preset} are left out: the recording has its own"
        )
    return DriveStudy(options, data.kind, recorded, specs, lane_map, (*data.notes, *notes, seen_note))


def _driven(data: Dataset, names: str | None) -> tuple[tuple[Sequence, ...], list[str]]:
    """The sequences that are asked for, ready to be driven; without being asked for: those with poses."""
    if names is not None:
        return tuple(map(drivable, chosen(data, names).sequences)), []
    driven = [s for s in data.sequences if s.world_SE3_ego is not None] or list(data.sequences)
    left_out = len(data.sequences) - len(driven)
    notes = [f"{left_out} sequences without ego poses are left out"] if left_out else []
    if not driven:
        raise DatasetError("no sequence to drive")
    return tuple(map(drivable, driven)), notes


def _seen(sequences: Many[Sequence], options: Options) -> tuple[str, str]:
    """What perception sees, and a line that says so."""
    labelled = all(sequence.labels is not None for sequence in sequences)
    detected = any(len(sequence.detections) for sequence in sequences)
    sees = options.sees or (DETECTIONS if detected or not labelled else LABELS)
    if sees == LABELS and not labelled:
        missing = next(s.name for s in sequences if s.labels is None)
        raise DatasetError(f"--detections labels: sequence {missing} has no labels")
    if sees == DETECTIONS and not detected:
        hint = "; use --detections labels" if labelled else ""
        raise DatasetError(f"--detections detections: no sequence has any{hint}")
    if sees == LABELS:
        return sees, f"labels stand in for detections, with the sensor's errors of preset {options.preset}"
    verdicts = "" if labelled else "; without labels every request of a moving ego stays undecided"
    return sees, f"the recorded detections are seen{verdicts}"


def drive_all(study: DriveStudy, out: Path, progress: Progress) -> DriveResult:
    """Drive every sequence with every strategy and rule, and write what came of it.

    Args:
        study: from `prepare`.
        out: folder of the results.
        progress: is told how far the study has come.

    Raises:
        ResultsError: a file cannot be written.
        DatasetError, ScenarioError: see `drive.carry_out`.
    """
    discard_tables(out)
    progress.begin("driving", study.frame_count)
    drives, written, spent_s = [], [], 0.0
    for spec in study.specs:
        for sequence in study.sequences:
            start_s = time.thread_time()
            drive = carry_out(sequence, spec, study.lane_map, progress.done)
            spent_s += time.thread_time() - start_s
            path = log_path(out, spec.log_name(sequence.name))
            write_log(path, drive.log)
            drives.append(drive)
            written.append(path)
    start_s = time.thread_time()
    rows = drive_rows(drives)
    table = summary_table(rows)
    spent_s += time.thread_time() - start_s
    files = {
        DRIVES_CSV: drives_csv(rows),
        EVENTS_CSV: events_csv(drives),
        DRIVES_JSON: configuration_json(_configuration(study, out)),
        TABLE_MD: markdown_table(table).encode(),
    }
    paths = write_files(out, files)
    return DriveResult(
        tuple(drives), tuple(rows), table, (*paths, *written), spent_s, tuple(_off_map_notes(drives))
    )


def _configuration(study: DriveStudy, out: Path) -> dict[str, object]:
    options = study.options
    map_path = map_of(study.sequences, options.map_file)
    return {
        "command": "drive",
        "data": _name_of(options.folder, out),
        "format": study.form,
        "columns": options.columns,
        "map": None if map_path is None else _name_of(map_path, out),
        "specs": study.specs,
        "sequences": [sequence.name for sequence in study.sequences],
        "notes": study.notes,
    }


def _name_of(path: Path, out: Path) -> str:
    """A file relative to the folder of results, so that both can be moved together."""
    return Path(os.path.relpath(path.resolve(), out.resolve())).as_posix()


def _off_map_notes(drives: Many[Drive]) -> list[str]:
    return [
        f"{drive.spec.strategy}, sequence {drive.sequence}: {drive.off_map[0]} of {drive.off_map[1]} "
        "stretches of the way run on no driving lane of the map; the rectangle stands in there"
        for drive in drives
        if drive.off_map[0]
    ]
