"""A folder of drives, read again for pages, films and pictures."""

from __future__ import annotations

import csv
import dataclasses
import io
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from evaluation.results.files import DRIVES_CSV, ResultsError, log_path, require_columns, require_file
from evaluation.results.logs import GREATEST
from evaluation.runs.decoding import decode, decoded_settings, list_of, object_of
from evaluation.runs.folder import read_shown_log
from evaluation.studies.drive.account import explain_drive
from evaluation.studies.drive.drive import DrivenArea, DriveSpec, drivable, driven_area
from evaluation.studies.drive.measures import ALL
from evaluation.studies.drive.parameters import ordered
from evaluation.studies.drive.study import VEHICLE
from evaluation.studies.drive.tables import (
    DRIVE_COLUMNS,
    DRIVES_JSON,
    EVENT_COLUMNS,
    EVENTS_CSV,
    common_settings,
    side_name,
)
from evaluation.views.account.account import Account
from evaluation.views.frames import LogFrames, frames_of
from evaluation.views.traces.run import LoggedRun
from opendrive import OpenDriveError
from scenarios.errors import DatasetError, ScenarioError
from scenarios.reading import ReadError, read_json, read_text, shown
from scenarios.recorded.bags.reader import BagReading
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.formats import READERS, Reading, read_dataset
from scenarios.recorded.maps.drive_map import DriveMap, load_drive_map
from scenarios.recorded.tables.columns import Columns
from scenarios.recorded.vehicles import Vehicle
from scenarios.settings import TRIGGERS
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
class StoredRecording:
    """A recording of a folder of drives, read again.

    Args:
        sequence: the recording.
        vehicle: that recorded it.
        network: its map; None: there is none.
        start_s: stamp of its first frame; the times in seconds of `sequence` count from there.
    """

    sequence: Sequence
    vehicle: Vehicle
    network: DriveMap | None
    start_s: float = 0.0


@dataclass(frozen=True, slots=True, eq=False)
class DriveFolder:
    """A folder that `drive` wrote.

    Args:
        path: the folder.
        rows: of `drives.csv`.
        events: rows of `events.csv`.
        recordings: sequences, vehicles and maps by name; empty where they cannot be read again.
        specs: how they were seen, by strategy and settings.
        notes: what the reader has to know about what is missing, one line each.
    """

    path: Path
    rows: tuple[Row, ...]
    events: tuple[Row, ...]
    recordings: Mapping[str, StoredRecording]
    specs: Mapping[tuple[str, str], DriveSpec]
    notes: tuple[str, ...]
    _areas: dict[tuple[str, ...], DrivenArea] = field(default_factory=dict, repr=False)

    @property
    def drives(self) -> list[Row]:
        """Rows of single drives."""
        return [row for row in self.rows if row["sequence"] != ALL]

    @property
    def settings(self) -> str:
        """What all drives have beyond the preset."""
        return common_settings(row["settings"] for row in self.rows)[0]

    @property
    def networks(self) -> list[DriveMap]:
        """The maps, each once."""
        return list({id(r.network): r.network for r in self.recordings.values() if r.network}.values())

    def label(self, row: Row) -> str:
        """Strategy, settings that not all have, and rule."""
        own = common_settings(row["settings"] for row in self.rows)[1]
        return side_name(row["strategy"], own[row["settings"]], row["rule"])

    def network(self, row: Row) -> DriveMap | None:
        """The map of a drive; None: there is none, or it is not known."""
        recording = self.recordings.get(row["sequence"])
        return None if recording is None else recording.network

    def view(self, log: str) -> DriveView:
        """A drive by the name of its log.

        Raises:
            ResultsError: there is none, or its log is missing or broken.
        """
        row = self._row(log)
        frames = frames_of(read_shown_log(log_path(self.path, log)), self._area(row))
        events = [event for event in self.events if event["log"] == log]
        title = f"{self.label(row)}, {row['sequence']}"
        return DriveView(row, frames, explain_drive(frames, events), self.network(row), title)

    def logged_run(self, log: str) -> LoggedRun:
        """A drive by the name of its log, for files of other tools.

        Raises:
            ResultsError: there is none, or its log is missing or broken.
        """
        row = self._row(log)
        recording = self.recordings.get(row["sequence"])
        return LoggedRun(
            log,
            read_shown_log(log_path(self.path, log)),
            self.network(row),
            self._area(row),
            0.0 if recording is None else recording.start_s,
            frame_ns=None if recording is None else recording.sequence.stamp_ns,
        )

    def _row(self, log: str) -> Row:
        row = next((row for row in self.drives if row["log"] == log), None)
        if row is None:
            known = [row["log"] for row in self.drives]
            more = f" and {len(known) - 3} more" if len(known) > 3 else ""
            raise ResultsError(f"{self.path}: no drive {log!r}; it has: {', '.join(known[:3])}{more}")
        return row

    def _area(self, row: Row) -> DrivenArea | None:
        """The monitored area of a drive, the same for all rules; None where it is not known."""
        name, side = row["sequence"], (row["strategy"], row["settings"])
        if side not in self.specs or name not in self.recordings:
            return None
        key = (name, *side)
        if key not in self._areas:
            recording = self.recordings[name]
            spec = replace(self.specs[side], vehicle=recording.vehicle)
            self._areas[key] = driven_area(recording.sequence, spec, recording.network)
        return self._areas[key]


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
        recordings, specs = _stored(path)
        own = dict.fromkeys(row["strategy"] for row in rows if is_plugin(row["strategy"]))
        notes = [f"The monitored area of {name} is not drawn: it is code of your own." for name in own]
        if any(name in row["settings"] for row in rows for name in ("localisation_", "odometry_")):
            notes.append("Monitored areas are drawn without errors of localisation and odometry.")
        return DriveFolder(path, rows, events, recordings, specs, tuple(notes))
    except (ReadError, OpenDriveError, ScenarioError, DatasetError, SmartMotError, OSError) as error:
        note = f"Lanes and monitored areas are not drawn: {' '.join(str(error).split())}"
        return DriveFolder(path, rows, events, {}, {}, (note,))


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


_OF_DECISIONS = ("rule", "tracker", "tracker_sigma_m", "dynamic_sigmas", "near_m", *TRIGGERS.values())
"""Settings that change no area; rule and tracker may be code of the user's own."""


def _stored(path: Path) -> tuple[dict[str, StoredRecording], dict[tuple[str, str], DriveSpec]]:
    """The recordings of a folder, read again, and how they were seen."""
    file = path / DRIVES_JSON
    content = object_of(read_json(file), "the file")
    stored = object_of(content.get("configuration"), "configuration")
    columns = stored.get("columns")
    reading: Reading | None = None
    if isinstance(columns, dict) and "velocity_frame" in columns:
        reading = decode(BagReading, columns, "columns")
    elif columns is not None:
        reading = decode(Columns, columns, "columns")
    recordings: dict[str, StoredRecording] = {}
    data_sets: dict[tuple[str, str], dict[str, Sequence]] = {}
    maps: dict[str, DriveMap] = {}
    for k, listed in enumerate(list_of(stored.get("recordings"), "recordings")):
        entry = object_of(listed, f"recordings[{k}]")
        name, data, sequence, form, map_file = (
            entry.get(key) for key in ("name", "data", "sequence", "format", "map")
        )
        if not (
            isinstance(name, str)
            and isinstance(data, str)
            and isinstance(sequence, str)
            and isinstance(form, str)
            and isinstance(map_file, str | None)
        ):
            raise ReadError(f"{file}: recordings[{k}]: name, data, sequence, format and map must be texts")
        if form not in READERS:
            raise ReadError(f"{file}: unknown format {shown(form)}")
        if (data, form) not in data_sets:
            dataset = read_dataset(path / data, form, reading)
            data_sets[data, form] = {s.name: s for s in dataset.sequences}
        if map_file is not None and map_file not in maps:
            maps[map_file] = load_drive_map(path / map_file)
        if sequence in data_sets[data, form]:
            vehicle = decode(Vehicle, entry.get(VEHICLE), f"recordings[{k}].{VEHICLE}")
            network = None if map_file is None else maps[map_file]
            recorded = data_sets[data, form][sequence]
            driven = replace(drivable(recorded), name=name)
            recordings[name] = StoredRecording(driven, vehicle, network, float(recorded.stamp_s[0]))
    return recordings, dict(_specs_of(stored))


def _specs_of(stored: Mapping[str, object]) -> Iterator[tuple[tuple[str, str], DriveSpec]]:
    """How drives were seen, by strategy and settings; those of the user's own strategies are left out."""
    for k, listed in enumerate(list_of(stored.get("specs"), "specs")):
        values = {**object_of(listed, f"specs[{k}]"), VEHICLE: dataclasses.asdict(Vehicle())}
        settings = decoded_settings(values.get("settings"), f"specs[{k}].settings")
        spec = replace(
            decode(DriveSpec, values | {"settings": []}, f"specs[{k}]"), settings=ordered(settings)
        )
        if not is_plugin(spec.strategy):
            of_area = tuple((name, value) for name, value in spec.settings if name not in _OF_DECISIONS)
            yield (spec.strategy, spec.text), replace(spec, rule="", settings=of_area)
