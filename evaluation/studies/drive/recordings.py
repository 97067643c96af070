"""The recordings that are driven: of one data set, or of all that a folder holds."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from pathlib import Path

from evaluation.studies.drive.drive import DETECTIONS, LABELS, drivable
from evaluation.studies.drive.measures import ALL
from evaluation.studies.mot.run import chosen
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, Sequence
from scenarios.recorded.formats import Reading, form_of, read_dataset, recognised
from scenarios.recorded.maps.drive_map import map_of
from scenarios.recorded.vehicles import Vehicle, vehicle_of


@dataclass(frozen=True, slots=True)
class Source:
    """Where recordings come from.

    Args:
        folder: a data set, or a folder of data sets.
        form: format; None: what the files look like.
        sequences: only these, comma-separated; None: all.
        sees: labels or detections; None: detections where there are any.
        map_file: a map in the frame of the poses; None: the recordings' own, if they have one.
        vehicle: the recording vehicle; None: that of the format.
        columns: what the columns of a table mean, or which topics of a bag are read; None: ours, all.
    """

    folder: Path
    form: str | None = None
    sequences: str | None = None
    sees: str | None = None
    map_file: Path | None = None
    vehicle: Vehicle | None = None
    columns: Reading | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A sequence that can be driven.

    Args:
        sequence: from `drivable`; its name is unique among those that are driven.
        data: the data set.
        stored_name: name of the sequence there.
        form: format of the data set.
        vehicle: that recorded it.
        map_path: its map; None: there is none.
    """

    sequence: Sequence
    data: Path
    stored_name: str
    form: str
    vehicle: Vehicle
    map_path: Path | None

    @property
    def name(self) -> str:
        """Of the sequence."""
        return self.sequence.name


@dataclass(frozen=True, slots=True, eq=False)
class Recordings:
    """What is driven.

    Args:
        items: the recordings, by data set.
        sees: what perception sees of all of them, one of `SEES`.
        notes: what a user should know, a line each.
    """

    items: tuple[Recording, ...]
    sees: str
    notes: tuple[str, ...]

    @property
    def without_map(self) -> list[str]:
        """Names of those that have no map."""
        return [recording.name for recording in self.items if recording.map_path is None]


def read_recordings(source: Source) -> Recordings:
    """Read what is to be driven.

    Raises:
        DatasetError: there is nothing to drive, a file is wrong, or a sequence cannot be driven.
    """
    paths, notes = data_sets_of(source.folder, source.form, source.columns)
    data_sets = [read_dataset(path, source.form, source.columns) for path in paths]
    listed = [
        Recording(
            sequence,
            path,
            sequence.name,
            data.kind,
            source.vehicle or vehicle_of(data.kind),
            map_of(data.sequences, source.map_file),
        )
        for path, data in zip(paths, data_sets, strict=True)
        for sequence in data.sequences
    ]
    for path, data in zip(paths, data_sets, strict=True):
        impossible = [f"{data.rejected} impossible detections left out"] if data.rejected else []
        own = [*data.notes, *impossible]
        notes += [f"{path.name}: {note}" if len(paths) > 1 else note for note in own]
    recordings, left_out = _driven(_with_unique_names(listed), source.sequences)
    sees, seen_note = _seen(recordings, source.sees)
    return Recordings(recordings, sees, (*notes, *left_out, seen_note))


def data_sets_of(folder: Path, form: str | None, columns: Reading | None) -> tuple[list[Path], list[str]]:
    """The data sets that a folder is or holds, and what is said of what it holds besides.

    Raises:
        DatasetError: it cannot be read.
    """
    if not folder.is_dir():
        return [folder], []
    try:
        inside = sorted(path for path in folder.iterdir() if path.is_dir() and path.name[0] != ".")
    except OSError as error:
        raise DatasetError(f"{folder}: {error.strerror}") from None
    forms = {path: recognised(path) for path in inside}
    if recognised(folder) is not None:
        # folders of JSON files, which look like nuScenes or SimBEV, are parts of data sets
        own = [path.name for path, shown in forms.items() if shown not in (None, "nuscenes", "simbev")]
        return [folder], [f"recordings in folders inside are left out: {', '.join(own)}"] if own else []
    wanted = form or form_of(columns)
    data_sets = [path for path, shown in forms.items() if shown and wanted in (None, shown)]
    if not data_sets:  # what is missing is then said of the folder itself
        return [folder], []
    others = [path.name for path in inside if path not in data_sets]
    return data_sets, [f"no recordings in {', '.join(others)}"] if others else []


def _with_unique_names(recordings: Many[Recording]) -> list[Recording]:
    """The recordings, their names behind those of their data sets where two would be alike."""
    if len({recording.name for recording in recordings}) == len(recordings):
        return list(recordings)
    named = [
        replace(r, sequence=replace(r.sequence, name=f"{r.data.name}/{r.stored_name}")) for r in recordings
    ]
    name, count = Counter(recording.name for recording in named).most_common(1)[0]
    if count > 1:
        raise DatasetError(f"{count} sequences are called {name}")
    return named


def _driven(recordings: Many[Recording], names: str | None) -> tuple[tuple[Recording, ...], list[str]]:
    """The recordings that are asked for, ready to be driven; without being asked for: those with poses."""
    by_name = {recording.name: recording for recording in recordings}
    notes: list[str] = []
    if names is not None:
        every = Dataset("", tuple(recording.sequence for recording in recordings))
        wanted = [by_name[sequence.name] for sequence in chosen(every, names).sequences]
    else:
        wanted = [r for r in recordings if r.sequence.world_SE3_ego is not None] or list(recordings)
        left_out = len(recordings) - len(wanted)
        notes = [f"{left_out} sequences without ego poses are left out"] if left_out else []
    if not wanted:
        raise DatasetError("no sequence to drive")
    if any(recording.name == ALL for recording in wanted):
        raise DatasetError(f"sequence {ALL!r}: the name stands for all sequences together; rename it")
    return tuple(replace(r, sequence=drivable(r.sequence)) for r in wanted), notes


def _seen(recordings: Many[Recording], asked: str | None) -> tuple[str, str]:
    """What perception sees of all recordings, and a line that says so."""
    by_data: dict[Path, list[Sequence]] = {}
    for recording in recordings:
        by_data.setdefault(recording.data, []).append(recording.sequence)
    seen = {path: _seen_of(sequences, asked) for path, sequences in by_data.items()}
    if len(set(seen.values())) > 1:
        examples = {sees: path.name for path, sees in seen.items()}
        raise DatasetError(
            f"{examples[DETECTIONS]} has detections and {examples[LABELS]} has labels alone: counts of both "
            "mean different things; drive them apart, or use --detections labels for all"
        )
    sees = next(iter(seen.values()))
    if sees == LABELS:
        return sees, "labels stand in for detections, with the sensor's errors of the preset"
    labelled = all(recording.sequence.labels is not None for recording in recordings)
    verdicts = "" if labelled else "; without labels every request of a moving ego stays undecided"
    return sees, f"the recorded detections are seen{verdicts}"


def _seen_of(sequences: Many[Sequence], asked: str | None) -> str:
    """What perception sees of a data set."""
    labelled = all(sequence.labels is not None for sequence in sequences)
    detected = any(len(sequence.detections) for sequence in sequences)
    sees = asked or (DETECTIONS if detected or not labelled else LABELS)
    if sees == LABELS and not labelled:
        missing = next(s.name for s in sequences if s.labels is None)
        raise DatasetError(f"--detections labels: sequence {missing} has no labels")
    if sees == DETECTIONS and not detected:
        hint = "; use --detections labels" if labelled else ""
        raise DatasetError(f"--detections detections: no sequence has any{hint}")
    return sees
