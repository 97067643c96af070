"""Recorded drives and simulated runs as OpenSCENARIO files."""

from __future__ import annotations

from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.results.files import RUNS_CSV, write_bytes
from evaluation.results.rows import read_runs
from evaluation.runs.recordings import is_run, recording_of_run
from evaluation.studies.mot.run import chosen
from evaluation.studies.mot.tracking import track_sequence
from opendrive import load_map
from scenarios.errors import DatasetError
from scenarios.recorded.formats import Reading, read_dataset
from scenarios.recorded.to_openscenario import openscenario_bytes
from scenarios.recorded.vehicles import Vehicle, vehicle_of
from smartmot.tracking.configs import tracker_config
from smartmot.tracking.tracker import Tracker


def write_scenario(
    source: Path,
    out: Path,
    map_file: Path | None = None,
    name: str | None = None,
    columns: Reading | None = None,
    vehicle: Vehicle | None = None,
) -> tuple[Path, tuple[str, ...]]:
    """Write a run or a drive as a scenario; see `run_bytes` and `drive_bytes`.

    Args:
        source: a folder of one run, a run `DIR/NAME` or its log; or a recorded drive, as for `mot`.
        out: file to write.
        map_file: OpenDRIVE file; None: that of the run; of a drive none.
        name: which sequence of a drive; None: the only one.
        columns: what the columns of a table mean, or which topics of a bag are read; None: ours, all.
        vehicle: that recorded a drive; None: that of the format.

    Returns:
        The file, and what a user should know, a line each.

    Raises:
        ArgumentError: the source has several runs or sequences, or a file is none.
        DatasetError: a drive cannot be read, or has no poses.
        ResultsError: a log cannot be read, or the file cannot be written.
        opendrive.OpenDriveError: the map cannot be read.
    """
    if out.suffix != ".xosc":
        raise ArgumentError(f"--out: expected a file FILE.xosc, got {out}")
    if map_file is not None:
        load_map(map_file)  # one that is none is refused before anything is written
    if (source / RUNS_CSV).is_file():
        source = _only_run(source)
    if is_run(source):
        content, notes = run_bytes(source, out, map_file)
    else:
        content, notes = drive_bytes(source, out, map_file, name, columns, vehicle)
    write_bytes(out, content)
    return out, notes


def _only_run(folder: Path) -> Path:
    logs = [str(name) for name in read_runs(folder)["log"].dropna()]
    if len(logs) != 1:
        shown = ", ".join(logs[:3]) + (f" and {len(logs) - 3} more" if len(logs) > 3 else "")
        raise ArgumentError(f"{folder}: {len(logs)} runs with logs; name one, {folder}/NAME: {shown}")
    return folder / logs[0]


def run_bytes(run: Path, out: Path, map_file: Path | None) -> tuple[bytes, tuple[str, ...]]:
    """The file of a run, and what is not known of it.

    Args:
        run: `DIR/NAME`, or the path of its log.
        out: where the file is to be.
        map_file: in place of the scenario's map.

    Raises:
        ResultsError: the log cannot be read.
        DatasetError: the ego drives in reverse.
    """
    recording = recording_of_run(run)
    length_m, width_m = recording.ego_size_m
    content = openscenario_bytes(
        recording.sequence,
        map_file=_map_name(map_file or recording.map_path, out),
        ego=Vehicle(length_m, width_m),
        names={number: entity.name for number, entity in enumerate(recording.others)},
        first=recording.target,
    )
    return content, recording.notes


def drive_bytes(
    path: Path,
    out: Path,
    map_file: Path | None,
    name: str | None,
    columns: Reading | None,
    vehicle: Vehicle | None = None,
) -> tuple[bytes, tuple[str, ...]]:
    """The file of a recorded drive, and how it was read. Without labels the others are tracks.

    Args:
        path: folder or file of the recording.
        out: where the file is to be.
        map_file: OpenDRIVE file; None: a plane.
        name: which sequence; None: the only one.
        columns: what the columns of a table mean, or which topics of a bag are read; None: ours, all.
        vehicle: the recording vehicle; None: that of the format.

    Raises:
        ArgumentError: there are several sequences.
        DatasetError: a file or the name is wrong, or the ego has no poses or drives in reverse.
    """
    data = chosen(read_dataset(path, None, columns), name)
    if len(data.sequences) != 1:
        names = ", ".join(sequence.name for sequence in data.sequences[:10])
        raise ArgumentError(f"--sequence: {path} has {len(data.sequences)} recordings; name one of: {names}")
    [sequence] = data.sequences
    notes = list(data.notes)
    if sequence.world_SE3_ego is None:
        raise DatasetError(f"{path}: sequence {sequence.name} has no ego poses, which a scenario needs")
    labels = sequence.labels
    if labels is None:
        labels = track_sequence(sequence, Tracker(tracker_config("default"))).tracks
        notes.append("no labels: the others are the tracks of the default tracker")
    if map_file is None:
        notes.append("no --map: the scenario takes place on a plane without roads")
    content = openscenario_bytes(
        sequence, labels, map_file=_map_name(map_file, out), ego=vehicle or vehicle_of(data.kind)
    )
    return content, tuple(notes)


def _map_name(map_file: Path | None, out: Path) -> str | None:
    """How a scenario names its map: from its own folder if it is below that, else in full."""
    if map_file is None:
        return None
    path, folder = map_file.resolve(), out.resolve().parent
    return str(path.relative_to(folder) if path.is_relative_to(folder) else path)
