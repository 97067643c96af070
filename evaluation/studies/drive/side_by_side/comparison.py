"""Strategies, settings and brake rules side by side on recorded drives: `smartmot-eval compare --drives`."""

from __future__ import annotations

import dataclasses
import hashlib
from collections.abc import Sequence as Many
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evaluation.results.files import TABLE_MD, configuration_json, write_files
from evaluation.results.tables import Table, csv_bytes, markdown_table
from evaluation.runs.configuration import versions
from evaluation.runs.execution import FrameTime
from evaluation.runs.fingerprint import digest_of, file_digest, library_versions, version
from evaluation.studies.drive.drive import DriveSpec
from evaluation.studies.drive.measures import (
    DriveEvent,
    DriveItem,
    DriveRow,
    KeptDrive,
    measure,
    off_map_note,
    total_of,
)
from evaluation.studies.drive.recordings import Recording
from evaluation.studies.drive.side_by_side.pairs import (
    DriveDifference,
    Occasion,
    Side,
    difference_table,
    differences_csv,
    differences_of,
    occasion_table,
    occasions_csv,
    occasions_of,
    pairs_of,
    side_of,
    told_power,
)
from evaluation.studies.drive.side_by_side.totals import told_exposure, totals_csv, totals_table
from evaluation.studies.drive.study import VEHICLE, DriveStudy, Options, prepare, spec_values
from evaluation.studies.drive.tables import EVENTS_CSV, common_settings
from evaluation.studies.study import Finished, Study
from scenarios.recorded.dataset import Objects, Sequence
from smartmot.area import PathArea
from smartmot.plugins import is_plugin, plugin

RUN_COLUMNS = tuple(field.name for field in dataclasses.fields(DriveRow))
EVENT_COLUMNS = tuple(field.name for field in dataclasses.fields(DriveEvent))
COMPARE_JSON = "compare.json"


@dataclass(frozen=True, slots=True)
class DriveComparison(Study[DriveItem, KeptDrive]):
    """Every strategy, with every setting and brake rule, on every drive.

    Args:
        options: what is driven.
        name: of the folder.
    """

    options: Options
    name: str = "compare"
    journal = "drives_"
    table = "runs.csv"
    kind = KeptDrive

    def items(self, folder: Path) -> list[DriveItem]:
        """The drives, by side; see `prepare` for what is raised."""
        return items_of(self.prepared())

    def prepared(self) -> DriveStudy:
        """What is driven; unless strategies are named, the others are compared with the planned path."""
        study = prepare(self.options)
        if self.options.strategies:
            return study
        return replace(study, specs=tuple(sorted(study.specs, key=lambda s: s.strategy != PathArea.name)))

    @staticmethod
    def job(item: DriveItem) -> tuple[KeptDrive, FrameTime]:
        """Carry out one of them."""
        return measure(item)

    def is_quick(self, item: DriveItem) -> bool:
        """Whether it is a short one."""
        return len(item.sequence) <= QUICK_FRAMES

    def write(self, folder: Path, items: Many[DriveItem], finished: Finished[KeptDrive]) -> list[Path]:
        """Write the tables; the same bytes for any number of workers."""
        specs = specs_of(items)
        return side_by_side(specs, items, finished).write(folder, specs)


QUICK_FRAMES = 300
"""Of a drive that takes about a second."""


@dataclass(frozen=True, slots=True, eq=False)
class SideBySide:
    """What a comparison on recorded drives came to.

    Args:
        pairs: sides that are compared, see `pairs_of`.
        rows: of single drives, by side.
        events: requests and warnings, in the same order.
        notes: what a user should know of the recordings and the drives, a line each.
    """

    pairs: tuple[tuple[Side, Side], ...]
    rows: tuple[DriveRow, ...]
    events: tuple[DriveEvent, ...]
    notes: tuple[str, ...] = ()

    @property
    def totals(self) -> list[DriveRow]:
        """A row per side: all drives together."""
        drives = len(self.drives)
        return [total_of(self.rows[k : k + drives]) for k in range(0, len(self.rows), drives)]

    @property
    def drives(self) -> list[str]:
        """Names of the drives."""
        return list(dict.fromkeys(row.sequence for row in self.rows))

    @property
    def own_settings(self) -> dict[str, str]:
        """Settings of each side beyond those of all."""
        return common_settings(row.settings for row in self.rows)[1]

    @property
    def occasions(self) -> list[Occasion]:
        """When whichever side asked for the brake."""
        return occasions_of(self.events)

    @property
    def differences(self) -> list[DriveDifference]:
        """Of the sides that differ in one thing."""
        return differences_of(self.rows, self.occasions, self.pairs)

    def tables(self) -> dict[str, Table]:
        """Totals, differences and occasions, by heading."""
        own, sides = self.own_settings, [side_of(row) for row in self.totals]
        return {
            "All drives": totals_table(self.totals),
            "Differences": difference_table(self.differences, own),
            "Who asked when": occasion_table(self.occasions, sides, own),
        }

    def sentences(self) -> list[str]:
        """What the numbers can say, and what not."""
        return [told_power(len(self.drives), len(self.differences)), *told_exposure(self.totals)]

    def write(self, folder: Path, specs: Many[DriveSpec]) -> list[Path]:
        """Write all files.

        Args:
            folder: where to.
            specs: how the drives were seen.

        Raises:
            ResultsError: the folder cannot be written.
        """
        first, *others = self.tables().items()
        text = [markdown_table(first[1]), _lines(self.sentences())]
        if self.notes:
            text += ["## Notes\n", _lines(self.notes)]
        for heading, table in others:
            text += [f"## {heading}\n", markdown_table(table) if table.rows else "None.\n"]
        contents = {
            DriveComparison.table: csv_bytes(RUN_COLUMNS, map(dataclasses.astuple, self.rows)),
            "table.csv": totals_csv(self.totals, len(self.drives)),
            EVENTS_CSV: csv_bytes(EVENT_COLUMNS, map(dataclasses.astuple, self.events)),
            "differences.csv": differences_csv(self.differences),
            "occasions.csv": occasions_csv(self.occasions),
            TABLE_MD: "\n".join(text).encode(),
            COMPARE_JSON: self._configuration(specs),
        }
        return write_files(folder, contents)

    def _configuration(self, specs: Many[DriveSpec]) -> bytes:
        """How the drives were seen, as JSON."""
        values = {
            "command": "compare --drives",
            "versions": versions(),
            "drives": self.drives,
            "specs": [spec_values(spec) for spec in specs],
        }
        return configuration_json(values | ({"notes": self.notes} if self.notes else {}))


def items_of(study: DriveStudy) -> list[DriveItem]:
    """The drives of a study, by side, then recording."""
    digests = [_digest(recording) for recording in study.recordings]
    return [
        DriveItem(
            replace(spec, vehicle=recording.vehicle),
            recording.sequence,
            recording.map_path,
            _key(replace(spec, vehicle=recording.vehicle), recording, digest),
        )
        for spec in study.specs
        for recording, digest in zip(study.recordings, digests, strict=True)
    ]


def specs_of(items: Many[DriveItem]) -> tuple[DriveSpec, ...]:
    """The sides, with one vehicle for all."""
    vehicle = items[0].spec.vehicle
    return tuple(dict.fromkeys(replace(item.spec, vehicle=vehicle) for item in items))


def _lines(texts: Many[str]) -> str:
    return "".join(f"- {text}\n" for text in texts)


def side_by_side(
    specs: Many[DriveSpec],
    items: Many[DriveItem],
    finished: Finished[KeptDrive],
    notes: Many[str] = (),
) -> SideBySide:
    """Finished drives as one comparison; what is noted of them follows what is noted of the recordings."""
    kept = [finished[item.key][0] for item in items]
    events = tuple(event for drive in kept for event in drive.requests_and_warnings)
    off_map = [
        off_map_note(drive.strategy, drive.sequence, drive.off_map, drive.stretches)
        for drive in kept
        if drive.off_map
    ]
    rows = tuple(drive.row for drive in kept)
    return SideBySide(tuple(pairs_of(specs)), rows, events, (*notes, *off_map))


def _key(spec: DriveSpec, recording: Recording, digest: str) -> str:
    """Hash of everything that determines a drive."""
    values = {field.name: getattr(spec, field.name) for field in dataclasses.fields(spec)}
    values |= {VEHICLE: dataclasses.asdict(spec.vehicle), "settings": spec.text}
    preset = dataclasses.asdict(spec.preset_for(recording.sequence))
    own = plugin(spec.strategy).digest if is_plugin(spec.strategy) else ""
    return digest_of([values, preset, recording.name, digest, own, version(), library_versions()])


def _digest(recording: Recording) -> str:
    """Hash of a recording's content and of its map."""
    digest = hashlib.sha256()
    _feed(digest, recording.sequence)
    if recording.map_path is not None:
        digest.update(file_digest(recording.map_path).encode())
    return digest.hexdigest()


def _feed(digest: hashlib._Hash, value: Sequence | Objects) -> None:
    """Put the arrays and texts of a recording into a hash."""
    for field in dataclasses.fields(value):
        content = getattr(value, field.name)
        digest.update(field.name.encode())
        if isinstance(content, np.ndarray):
            digest.update(f"{content.dtype.str}{content.shape}".encode())
            digest.update(np.ascontiguousarray(content).tobytes())
        elif isinstance(content, Objects):
            _feed(digest, content)
        elif isinstance(content, (str, tuple)):
            digest.update(repr(content).encode())
