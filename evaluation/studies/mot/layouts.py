"""Simulated runs and recorded drives as data sets in the layouts of SimBEV and nuScenes."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from collections.abc import Sequence as Many
from dataclasses import replace
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.results.files import RUNS_CSV, write_bytes
from evaluation.results.rows import read_runs
from evaluation.runs.recordings import is_run, recording_of_run, recordings_of_runs
from evaluation.studies.mot.run import chosen
from scenarios.recorded.dataset import HEIGHT_M, Sequence
from scenarios.recorded.formats import Reading, read_dataset
from scenarios.recorded.layouts.nuscenes import VERSION, nuscenes_files, without_category
from scenarios.recorded.layouts.simbev import frame_grid, simbev_files, without_class
from scenarios.recorded.vehicles import vehicle_of

Files = Callable[[Many[Sequence], int], Iterator[tuple[str, bytes]]]

LAYOUTS: dict[str, tuple[str, Files]] = {
    "simbev": ("simbev", simbev_files),
    "nuscenes": (VERSION, nuscenes_files),
}
"""The folder that a layout consists of, and its files."""


def write_layout(
    source: Path, form: str, out: Path, seed: int, name: str | None = None, columns: Reading | None = None
) -> tuple[Path, tuple[str, ...]]:
    """Write every run, or every sequence of a drive, as a scene.

    Args:
        source: a folder of results, a run `DIR/NAME` or its log; or a recorded drive, as for `mot`.
        form: one of `LAYOUTS`.
        out: folder of the data set.
        seed: of the splits.
        name: which sequences of a drive, comma-separated; None: all.
        columns: what the columns of a table mean, or which topics of a bag are read; None: ours, all.

    Returns:
        The folder that was written, and what a user should know, a line each.

    Raises:
        ArgumentError: the folder has a data set of this layout already.
        DatasetError: a drive cannot be read, or has no labels or poses.
        ResultsError: a log cannot be read, or a file cannot be written.
    """
    folder, files = LAYOUTS[form]
    if (out / folder).exists():
        raise ArgumentError(f"--out: {out / folder} is there already; name another folder or remove it")
    if (source / RUNS_CSV).is_file() or is_run(source):
        sequences, notes = _runs(source)
    else:
        data = chosen(read_dataset(source, None, columns), name)
        sequences, notes = [_centred(s, data.kind) for s in data.sequences], list(data.notes)
    for path, content in files(sequences, seed):
        write_bytes(out / path, content)
    return out / folder, (*notes, *_notes(sequences, form))


def _runs(source: Path) -> tuple[list[Sequence], list[str]]:
    """The runs of a folder that have a log, or the one that is named."""
    if (source / RUNS_CSV).is_file():
        recordings = recordings_of_runs(source, map(str, read_runs(source)["log"].dropna()))
    else:
        recordings = iter([recording_of_run(source)])
    sequences: list[Sequence] = []
    notes: list[str] = []
    for recording in recordings:
        sequences.append(recording.sequence)
        notes += recording.notes
        if not recording.others:
            notes.append(f"heights are not known: {HEIGHT_M:g} m is written")
    return sequences, _once(notes)


def _once(notes: Iterable[str]) -> list[str]:
    return list(dict.fromkeys(notes))


def _centred(sequence: Sequence, form: str) -> Sequence:
    """A drive with the poses of the middle of the vehicle, which both layouts start from."""
    if sequence.world_SE3_ego is None:
        return sequence
    pose = sequence.world_SE3_ego.copy()
    pose[:, :3, 3] += vehicle_of(form).center_ahead_m * pose[:, :3, 0]
    return replace(sequence, world_SE3_ego=pose)


def _notes(sequences: list[Sequence], form: str) -> list[str]:
    """What the data set does not say."""
    notes = ["no LiDAR: num_lidar_pts is unknown, and no box is left out for having no point"]
    if form == "simbev":
        nameless = sum(map(without_class, sequences))
        beside = sum(int((~frame_grid(sequence)[1]).sum()) for sequence in sequences)
        if beside:
            notes.append(f"{beside} instants of contact between two frames are left out")
    else:
        nameless = sum(map(without_category, sequences))
    if nameless:
        notes.append(f"{nameless} boxes are of no class of the layout")
    return notes
