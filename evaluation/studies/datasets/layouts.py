"""Simulated runs and recorded drives as data sets in the layouts of SimBEV, nuScenes and KITTI."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.results.files import RUNS_CSV, write_bytes
from evaluation.results.rows import read_runs
from evaluation.runs.recordings import RunRecording, is_run, recording_of_run, recordings_of_runs
from evaluation.studies.datasets.sweeps import LidarChoice, sweeps_of
from evaluation.studies.mot.run import chosen
from scenarios.recorded.dataset import HEIGHT_M, Sequence
from scenarios.recorded.formats import Reading, read_dataset
from scenarios.recorded.layouts.kitti import KITTI_SWEEPS, kitti_files
from scenarios.recorded.layouts.nuscenes import NUSCENES_SWEEPS, VERSION, nuscenes_files, without_category
from scenarios.recorded.layouts.scenes import ScenePlace, split_of_scenes
from scenarios.recorded.layouts.simbev import SIMBEV_SWEEPS, frame_grid, simbev_files, without_class
from scenarios.recorded.layouts.sweeps import SweepFiles, swept, with_least_points
from scenarios.recorded.vehicles import vehicle_of
from scenarios.sensors.lidar.recording import RecordedSweeps
from smartmot.pointcloud import PointCloud


@dataclass(frozen=True, slots=True)
class Layout:
    """A layout of data sets.

    Args:
        folder: what a data set consists of, below its own folder.
        files: all files but the clouds, by path, from recordings and the seed of the splits.
        sweeps: the clouds.
    """

    folder: str
    files: Callable[[Many[Sequence], int], Iterator[tuple[str, bytes]]]
    sweeps: SweepFiles


LAYOUTS = {
    "simbev": Layout("simbev", simbev_files, SIMBEV_SWEEPS),
    "nuscenes": Layout(VERSION, nuscenes_files, NUSCENES_SWEEPS),
    "kitti": Layout("ImageSets", kitti_files, KITTI_SWEEPS),
}


def write_layout(
    source: Path,
    form: str,
    out: Path,
    seed: int,
    name: str | None = None,
    columns: Reading | None = None,
    lidar: LidarChoice | None = None,
    done: Callable[[int, int | None], None] = lambda number, total: None,
) -> tuple[Path, tuple[str, ...]]:
    """Write every run, or every sequence of a drive, as a scene.

    Args:
        source: a folder of results, a run `DIR/NAME` or its log; or a recorded drive, as for `mot`.
        form: one of `LAYOUTS`.
        out: folder of the data set.
        seed: of the splits.
        name: which sequences of a drive, comma-separated; None: all.
        columns: what the columns of a table mean, or which topics of a bag are read; None: ours, all.
        lidar: what is cast along runs; None: nothing.
        done: takes along how many of how many runs the LiDAR has been cast.

    Returns:
        The folder that was written, and what a user should know, a line each.

    Raises:
        ArgumentError: the folder has a data set of this layout already.
        DatasetError: a drive cannot be read, or has no labels or poses.
        ResultsError: a log cannot be read, or a file cannot be written.
    """
    layout = LAYOUTS[form]
    if (out / layout.folder).exists():
        there = out / layout.folder
        raise ArgumentError(f"--out: {there} is there already; name another folder or remove it")
    if is_runs(source):
        recordings, count = _recordings(source)
        sequences, notes = [], _Notes()
        splits, first = split_of_scenes(count, seed), 0
        for number, recording in enumerate(recordings):
            notes.of_run(recording)
            if lidar is None:
                sequences.append(recording.sequence)
                continue
            sweeps = sweeps_of(recording, lidar)
            sequence = _cast(sweeps, layout, out, ScenePlace(number, first, splits[number]), notes)
            first += len(sequence)
            kept = with_least_points(sequence, lidar.least_points)
            notes.hidden(sequence, kept, lidar.least_points)
            sequences.append(kept)
            done(number + 1, count)
        lines = notes.lines()
    else:
        data = chosen(read_dataset(source, None, columns), name)
        sequences, lines = [_centred(s, data.kind) for s in data.sequences], list(data.notes)
    for path, content in layout.files(sequences, seed):
        write_bytes(out / path, content)
    return out / layout.folder, (*lines, *_notes(sequences, form))


def is_runs(source: Path) -> bool:
    """Whether a path is a folder of runs, a run or its log."""
    return (source / RUNS_CSV).is_file() or is_run(source)


def _recordings(source: Path) -> tuple[Iterator[RunRecording], int]:
    """The runs of a folder that have a log, or the one that is named, and how many they are."""
    if not (source / RUNS_CSV).is_file():
        return iter([recording_of_run(source)]), 1
    names = read_runs(source)["log"].dropna().astype(str).tolist()
    return recordings_of_runs(source, names), len(names)


def _cast(sweeps: RecordedSweeps, layout: Layout, out: Path, place: ScenePlace, notes: _Notes) -> Sequence:
    """A run with what the LiDAR has of its labels; the clouds are written."""
    sequence = sweeps.sequence
    notes.frames_left_out += sweeps.left_out

    def write(frame: int, cloud: PointCloud) -> None:
        write_bytes(out / layout.sweeps.path(place, sequence, frame), layout.sweeps.content(cloud))

    return swept(sequence, sweeps, sweeps.ego_SE3_lidar, write)


class _Notes:
    """What is to be said of runs."""

    def __init__(self) -> None:
        self.frames_left_out = 0
        self._runs: list[str] = []
        self._hidden = self._labels = 0
        self._least = 0

    def of_run(self, recording: RunRecording) -> None:
        """What is not known of a run."""
        self._runs += recording.notes
        if not recording.others:
            self._runs.append(f"heights are not known: {HEIGHT_M:g} m is written")

    def hidden(self, cast: Sequence, kept: Sequence, least: int) -> None:
        """Which labels are left out."""
        assert cast.labels is not None
        assert kept.labels is not None
        self._least = least
        self._labels += len(cast.labels)
        self._hidden += len(cast.labels) - len(kept.labels)

    def lines(self) -> list[str]:
        """A line each, no line twice."""
        lines = list(dict.fromkeys(self._runs))
        if self.frames_left_out:
            lines.append(f"{self.frames_left_out} frames at which no turn of the LiDAR ends are left out")
        if self._hidden:
            few = "no point" if self._least == 1 else f"fewer than {self._least} points"
            lines.append(f"{self._hidden} of {self._labels} labels have {few} in their box and are left out")
        return lines


def _centred(sequence: Sequence, form: str) -> Sequence:
    """A drive with the poses of the middle of the vehicle, which both layouts start from."""
    if sequence.world_SE3_ego is None:
        return sequence
    pose = sequence.world_SE3_ego.copy()
    pose[:, :3, 3] += vehicle_of(form).center_ahead_m * pose[:, :3, 0]
    return replace(sequence, world_SE3_ego=pose)


def _notes(sequences: list[Sequence], form: str) -> list[str]:
    """What the data set does not say."""
    notes = []
    if any(sequence.sweeps is None for sequence in sequences):
        notes.append("no LiDAR: num_lidar_pts is unknown, and no box is left out for having no point")
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
