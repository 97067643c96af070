"""A folder of drives, read again for pages, films and pictures."""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from evaluation.results.files import DRIVES_CSV, ResultsError, log_path, require_columns, require_file
from evaluation.results.logs import GREATEST
from evaluation.runs.decoding import decode, list_of, object_of
from evaluation.runs.folder import read_shown_log
from evaluation.studies.drive.account import explain_drive
from evaluation.studies.drive.drive import DrivenArea, DriveSpec, drivable, driven_area
from evaluation.studies.drive.tables import (
    ALL,
    DRIVE_COLUMNS,
    DRIVES_JSON,
    EVENT_COLUMNS,
    EVENTS_CSV,
)
from evaluation.views.account.account import Account
from evaluation.views.frames import LogFrames, frames_of
from opendrive import OpenDriveError
from scenarios.errors import DatasetError, ScenarioError
from scenarios.reading import ReadError, read_json, read_text, shown
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.formats import READERS, read_dataset
from scenarios.recorded.maps.drive_map import DriveMap, load_drive_map
from scenarios.recorded.tables.columns import Columns
from smartmot.errors import SmartMotError
from smartmot.plugins import is_plugin

Row = Mapping[str, str]
"""A row of a table, as text."""


_OPTIONAL = {"pedestrians", "at_most_per_km", "gap_m"}
_NUMBERS = _OPTIONAL | {
    "km", "hours", "requests", "false_activations", "undecided", "warnings", "false_warnings", "time_s",
    "speed_kmh", "stop_s",
}  # fmt: skip
"""Columns that pages and films compute with."""


@dataclass(frozen=True, slots=True, eq=False)
class DriveView:
    """A drive as pages and films show it.

    Args:
        row: of `drives.csv`.
        frames: its log by frames.
        account: what happened, in words.
        network: the map; None: there is none, or it is not known.
        title: strategy, rule and sequence.
    """

    row: Row
    frames: LogFrames
    account: Account
    network: DriveMap | None
    title: str


@dataclass(frozen=True, slots=True, eq=False)
class DriveFolder:
    """A folder that `drive` wrote.

    Args:
        path: the folder.
        rows: of `drives.csv`.
        events: rows of `events.csv`.
        sequences: the recordings by name; empty where they cannot be read again.
        specs: how they were seen, by strategy.
        network: the map.
        notes: what the reader has to know about what is missing, one line each.
    """

    path: Path
    rows: tuple[Row, ...]
    events: tuple[Row, ...]
    sequences: Mapping[str, Sequence]
    specs: Mapping[str, DriveSpec]
    network: DriveMap | None
    notes: tuple[str, ...]
    _areas: dict[tuple[str, str], DrivenArea] = field(default_factory=dict, repr=False)

    @property
    def drives(self) -> list[Row]:
        """Rows of single drives."""
        return [row for row in self.rows if row["sequence"] != ALL]

    def view(self, log: str) -> DriveView:
        """A drive by the name of its log.

        Raises:
            ResultsError: there is none, or its log is missing or broken.
        """
        row = next((row for row in self.drives if row["log"] == log), None)
        if row is None:
            known = [row["log"] for row in self.drives]
            more = f" and {len(known) - 3} more" if len(known) > 3 else ""
            raise ResultsError(f"{self.path}: no drive {log!r}; it has: {', '.join(known[:3])}{more}")
        frames = frames_of(read_shown_log(log_path(self.path, log)), self._area(row))
        events = [event for event in self.events if event["log"] == log]
        title = ", ".join((row["strategy"], row["rule"], row["sequence"]))
        return DriveView(row, frames, explain_drive(frames, events), self.network, title)

    def _area(self, row: Row) -> DrivenArea | None:
        """The monitored area of a drive, the same for all rules; None where it is not known."""
        strategy, name = row["strategy"], row["sequence"]
        if strategy not in self.specs or name not in self.sequences:
            return None
        if (name, strategy) not in self._areas:
            spec = self.specs[strategy]
            self._areas[name, strategy] = driven_area(self.sequences[name], spec, self.network)
        return self._areas[name, strategy]


def is_drive_folder(path: Path) -> bool:
    """Whether `drive` wrote a folder."""
    return (path / DRIVES_CSV).is_file()


def read_drive_folder(path: Path) -> DriveFolder:
    """Read a folder of drives; logs are read when asked for, the recordings if they are where they were.

    Raises:
        ResultsError: a table is missing or not understood.
    """
    rows = _rows(path / DRIVES_CSV, DRIVE_COLUMNS)
    events = _rows(path / EVENTS_CSV, EVENT_COLUMNS)
    if not rows:
        raise ResultsError(f"{path / DRIVES_CSV}: no drives; drive something into this folder")
    for row in rows:
        if row["sequence"] != ALL and ("/" in row["log"] or "\\" in row["log"] or not row["log"].strip(".")):
            raise ResultsError(f"{path / DRIVES_CSV}: column 'log': no name of a log: {shown(row['log'])}")
    try:
        sequences, specs, network = _recordings(path)
        own = dict.fromkeys(row["strategy"] for row in rows if is_plugin(row["strategy"]))
        notes = tuple(f"The monitored area of {name} is not drawn: it is code of your own." for name in own)
        return DriveFolder(path, rows, events, sequences, specs, network, notes)
    except (ReadError, OpenDriveError, ScenarioError, DatasetError, SmartMotError, OSError) as error:
        note = f"Lanes and monitored areas are not drawn: {' '.join(str(error).split())}"
        return DriveFolder(path, rows, events, {}, {}, None, (note,))


def _rows(path: Path, columns: tuple[str, ...]) -> tuple[Row, ...]:
    """Rows of a table with at least these columns.

    Raises:
        ResultsError: it is missing or no table.
    """
    require_file(path)
    try:
        reader = csv.DictReader(io.StringIO(read_text(path), newline=""), strict=True)
        require_columns(path, reader.fieldnames or (), columns)
        rows = tuple(reader)
    except (ReadError, csv.Error, UnicodeError, OSError) as error:
        raise ResultsError(f"{path}: not a readable table ({' '.join(str(error).split())})") from error
    for number, row in enumerate(rows, 2):
        if None in row or None in row.values():
            raise ResultsError(f"{path}: line {number}: {len(columns)} fields expected")
        for name, text in row.items():
            if name in _NUMBERS and not _is_number(text, optional=name in _OPTIONAL):
                raise ResultsError(
                    f"{path}: line {number}: column {name!r}: expected a number, got {shown(text)}"
                )
    return rows


def _is_number(text: str, optional: bool) -> bool:
    if not text:
        return optional
    try:
        return abs(float(text)) <= GREATEST
    except ValueError:
        return False


def _recordings(
    path: Path,
) -> tuple[dict[str, Sequence], dict[str, DriveSpec], DriveMap | None]:
    """The recordings of a folder, read again."""
    content = object_of(read_json(path / DRIVES_JSON), "the file")
    stored = object_of(content.get("configuration"), "configuration")
    listed = list_of(stored.get("specs"), "specs")
    specs = [decode(DriveSpec, values, f"specs[{k}]") for k, values in enumerate(listed)]
    data, form, map_file = (stored.get(name) for name in ("data", "format", "map"))
    if not (isinstance(data, str) and isinstance(form, str) and isinstance(map_file, str | None)):
        raise ReadError(f"{path / DRIVES_JSON}: data, format and map must be texts")
    if form not in READERS:
        raise ReadError(f"{path / DRIVES_JSON}: unknown format {shown(form)}")
    columns = stored.get("columns")
    dataset = read_dataset(
        path / data, form, None if columns is None else decode(Columns, columns, "columns")
    )
    names = list_of(stored.get("sequences"), "sequences")
    chosen = {s.name: drivable(s) for s in dataset.sequences if s.name in names}
    network = None if map_file is None else load_drive_map(path / map_file)
    # a rule, which may be code of the user's own, changes no area
    by_strategy = {spec.strategy: replace(spec, rule="", settings=()) for spec in specs}
    return chosen, {key: spec for key, spec in by_strategy.items() if not is_plugin(key)}, network
