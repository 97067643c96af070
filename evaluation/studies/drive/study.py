"""Drives of a data set: every sequence with every strategy and rule, their files and tables."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Mapping
from collections.abc import Sequence as Many
from dataclasses import asdict, dataclass, field, fields, replace
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
from evaluation.studies.compare.grid import FAIR
from evaluation.studies.drive.drive import Drive, DriveSpec, carry_out
from evaluation.studies.drive.measures import LoggedEvent, LoggedRow, events_of, off_map_note, row_of
from evaluation.studies.drive.parameters import Vary, check_vary, settings_of, with_rules
from evaluation.studies.drive.recordings import Recording, Recordings, Source, read_recordings
from evaluation.studies.drive.tables import (
    DRIVES_JSON,
    EVENTS_CSV,
    drives_csv,
    events_csv,
    summary_table,
    with_totals,
)
from evaluation.studies.mot.lanes import require_cover
from scenarios.errors import ScenarioError
from scenarios.presets import named_preset
from scenarios.recorded.maps.drive_map import DriveMap, load_drive_map, notes_on_levels
from scenarios.settings import Setting, setting_text
from scenarios.sources.pose_errors import NO_LOCALISATION_ERRORS
from scenarios.strategies import STRATEGIES
from smartmot.errors import ConfigError
from smartmot.maps.lane_map import LaneMap

NEEDS_MAP = "map"
"""Strategy that is nothing without a map."""

VEHICLE = "vehicle"
"""Field of a spec that each recording has its own value of."""


@dataclass(frozen=True, slots=True)
class Options:
    """What the user asks for.

    Args:
        source: the recordings.
        strategies: names of monitored areas; empty: all shipped ones that can be had.
        rules: names of brake rules.
        preset: name of the conditions.
        seed: of the errors of labels that stand in for detections.
        vary: values of further parameters; see `evaluation.studies.drive.parameters`.
    """

    source: Source
    strategies: tuple[str, ...] = ()
    rules: tuple[str, ...] = ("paper",)
    preset: str = "real"
    seed: int = 0
    vary: Mapping[str, tuple[Setting, ...]] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class DriveStudy:
    """What is driven.

    Args:
        options: what was asked for.
        recordings: the drives.
        maps: by their paths.
        specs: how each is seen and judged; the vehicle is that of the recording.
        notes: what a user should know, a line each.
    """

    options: Options
    recordings: tuple[Recording, ...]
    maps: Mapping[Path | None, LaneMap]
    specs: tuple[DriveSpec, ...]
    notes: tuple[str, ...]

    @property
    def frame_count(self) -> int:
        """Frames of all drives."""
        return len(self.specs) * sum(len(recording.sequence) for recording in self.recordings)

    @property
    def recorded_s(self) -> float:
        """Recorded time of all drives."""
        return len(self.specs) * sum(float(r.sequence.stamp_s[-1]) for r in self.recordings)


@dataclass(frozen=True, slots=True, eq=False)
class DriveResult:
    """What a study came to.

    Args:
        drives: by strategy, settings and rule, then in the order of the sequences.
        rows: of `drives.csv`.
        table: the summary.
        written: the files.
        spent_s: processor time of everything but reading and writing.
        notes: what came up on the way, a line each.
    """

    drives: tuple[Drive, ...]
    rows: tuple[LoggedRow, ...]
    table: Table
    written: tuple[Path, ...]
    spent_s: float
    notes: tuple[str, ...]


def prepare(options: Options) -> DriveStudy:
    """Read the recordings, and see that what is asked of them is possible.

    Raises:
        ArgumentError: a strategy needs a map, or a parameter means nothing or is out of range.
        DatasetError: a file is wrong, or a sequence is missing or cannot be driven.
        opendrive.OpenDriveError: a map cannot be read.
    """
    recordings = read_recordings(options.source)
    specs = specs_of(options, recordings)
    notes = list(recordings.notes)
    if not options.strategies and recordings.without_map:
        notes.append(f"strategy map is left out: {_whose(recordings)} no map")
    if named_preset(options.preset).localisation != NO_LOCALISATION_ERRORS:
        notes.append(
            f"errors of localisation of preset {options.preset} are left out: the recording has its own"
        )
    maps = maps_of(recordings.items)
    for recording in recordings.items:
        if (lane_map := maps.get(recording.map_path)) is not None:
            way_m = recording.sequence.ego_xy_yaw()[:, :2]
            require_cover(lane_map, way_m, f"way of sequence {recording.name}")
            notes += notes_on_levels(lane_map, recording.sequence)
    return DriveStudy(options, recordings.items, maps, specs, tuple(notes))


def specs_of(options: Options, recordings: Recordings) -> tuple[DriveSpec, ...]:
    """How each recording is to be seen and judged: by strategy, settings and rule; see `prepare`."""
    without_map = recordings.without_map
    if NEEDS_MAP in options.strategies and without_map:
        raise ArgumentError(
            f"strategy map: {_whose(recordings)} no map; give --map FILE.xodr in the frame of the ego poses"
        )
    strategies = options.strategies or tuple(s for s in STRATEGIES if s != NEEDS_MAP or not without_map)
    check_vary(options.vary, strategies, recordings.sees, without_map)
    specs = tuple(
        DriveSpec(strategy, rule, options.preset, settings, recordings.sees, options.seed)
        for strategy, rule, settings in with_rules(settings_of(strategies, options.vary), options.rules)
    )
    for spec in specs:  # settings out of range are refused before the first drive
        _check(spec, recordings.items, options.vary)
    names = Counter(log_name(spec, r) for spec in specs for r in recordings.items)
    name, count = names.most_common(1)[0]
    if count > 1:
        raise ArgumentError(f"{count} drives would be called {name}: two sequences or values look alike")
    return specs


def _whose(recordings: Recordings) -> str:
    """Who has no map, as the beginning of a sentence."""
    without_map = recordings.without_map
    return "the data have" if len(recordings.items) == len(without_map) else f"sequence {without_map[0]} has"


def _check(spec: DriveSpec, recordings: Many[Recording], vary: Vary) -> None:
    """See that the settings of a spec are possible.

    Raises:
        ArgumentError: they are not.
    """
    try:
        for recording in recordings:
            spec.preset_for(recording.sequence)
    except (ConfigError, ScenarioError) as error:
        varied = ", ".join(setting_text(name, value) for name, value in spec.settings if name in vary)
        if not varied:
            raise
        raise ArgumentError(f"--vary {varied}, rule {spec.rule}: {error}") from None


def log_name(spec: DriveSpec, recording: Recording) -> str:
    """Name of a drive's log."""
    return spec.log_name(recording.name, FAIR)


def drive_all(study: DriveStudy, out: Path, progress: Progress) -> DriveResult:
    """Drive all of it, and write logs, tables and settings.

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
    drives, rows, events, written, spent_s = [], [], [], [], 0.0
    for spec in study.specs:
        for recording in study.recordings:
            start_s = time.thread_time()
            seen = replace(spec, vehicle=recording.vehicle)
            drive = carry_out(recording.sequence, seen, study.maps.get(recording.map_path), progress.done)
            spent_s += time.thread_time() - start_s
            log = log_name(spec, recording)
            path = log_path(out, log)
            write_log(path, drive.log)
            start_s = time.thread_time()
            rows.append(LoggedRow(**asdict(row_of(drive)), log=log))
            events += [LoggedEvent(**asdict(event), log=log) for event in events_of(drive)]
            spent_s += time.thread_time() - start_s
            drives.append(drive)
            written.append(path)
    rows = with_totals(rows)
    table = summary_table(rows)
    files = {
        DRIVES_CSV: drives_csv(rows),
        EVENTS_CSV: events_csv(events),
        DRIVES_JSON: configuration_json(_configuration(study, out)),
        TABLE_MD: markdown_table(table).encode(),
    }
    paths = write_files(out, files)
    return DriveResult(
        tuple(drives), tuple(rows), table, (*paths, *written), spent_s, tuple(_off_map_notes(drives))
    )


def maps_of(recordings: Many[Recording]) -> dict[Path | None, DriveMap]:
    """The maps by their paths, each loaded once."""
    paths = dict.fromkeys(recording.map_path for recording in recordings)
    return {path: load_drive_map(path) for path in paths if path is not None}


def _configuration(study: DriveStudy, out: Path) -> dict[str, object]:
    options = study.options
    return {
        "command": "drive",
        "recordings": [
            {
                "name": recording.name,
                "data": _name_of(recording.data, out),
                "sequence": recording.stored_name,
                "format": recording.form,
                "map": None if recording.map_path is None else _name_of(recording.map_path, out),
                "vehicle": recording.vehicle,
            }
            for recording in study.recordings
        ],
        "columns": options.source.columns,
        "specs": [spec_values(spec) for spec in study.specs],
        "notes": study.notes,
    }


def spec_values(spec: DriveSpec) -> dict[str, object]:
    """A spec without the vehicle, which belongs to the recording."""
    values = {entry.name: getattr(spec, entry.name) for entry in fields(spec) if entry.name != VEHICLE}
    return values | {"settings": dict(spec.settings)}


def _name_of(path: Path, out: Path) -> str:
    """A file relative to the folder of results, so that both can be moved together."""
    return Path(os.path.relpath(path.resolve(), out.resolve())).as_posix()


def _off_map_notes(drives: Many[Drive]) -> list[str]:
    return [
        off_map_note(drive.spec.strategy, drive.sequence, *drive.off_map)
        for drive in drives
        if drive.off_map[0]
    ]
