"""What is kept of a drive: a row of counts beside its exposure, and an event per request."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Sequence as Many
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

from evaluation.runs.execution import FrameTime
from evaluation.studies.drive.drive import Drive, DriveSpec, carry_out
from evaluation.studies.drive.exposure import Exposure, exposure_of, total
from evaluation.studies.drive.verdicts import FALSE, STANDING, UNDECIDED
from scenarios.recorded.dataset import Sequence
from scenarios.recorded.maps.drive_map import load_drive_map
from scenarios.sources.requests import EMERGENCY, WARNING
from smartmot.maps.lane_map import LaneMap

ALL = "all"
"""Stands for all sequences together."""


@dataclass(frozen=True, slots=True)
class DriveRow:
    """One drive, or all of a strategy, settings and rule. None where there is no value.

    Args:
        sequence: name of the recording, or `ALL`.
        strategy, rule, settings, preset: what saw and judged it; settings as they are typed.
        sees: labels or detections.
        seed: of the errors of labels that stand in for detections.
        frames: decided on.
        km, hours: driven.
        pedestrians: labelled ones met.
        requests: for the emergency brake, those of a standing ego left out.
        false_activations, undecided: of these.
        standing: requests of an ego that stood or reversed, which ask nothing.
        at_most_per_km: where no request came, 3 / km: what the rate is below with 95 % confidence.
        warnings: of rules that warn.
        false_warnings, undecided_warnings: of these.
        held_s: time in which a request was held, so that no other could begin.
    """

    sequence: str
    strategy: str
    rule: str
    settings: str
    preset: str
    sees: str
    seed: int
    frames: int
    km: float
    hours: float
    pedestrians: int | None
    requests: int
    false_activations: int
    undecided: int
    standing: int
    at_most_per_km: float | None
    warnings: int
    false_warnings: int
    undecided_warnings: int
    held_s: float

    @property
    def side(self) -> tuple[str, str, str]:
        """Strategy, settings and rule."""
        return self.strategy, self.settings, self.rule


@dataclass(frozen=True, slots=True)
class DriveEvent:
    """A request or a warning of a drive, with its verdict; see `Request` and `Verdict`."""

    sequence: str
    strategy: str
    rule: str
    settings: str
    kind: str
    time_s: float
    speed_kmh: float
    track: int | None
    category: str
    ttc_s: float | None
    gap_m: float | None
    decel_mps2: float | None
    horizon_s: float
    verdict: str
    reason: str
    object: int | None
    object_category: str
    recorded_decel_mps2: float | None
    gap_recorded_m: float | None
    gap_braked_m: float | None
    gap_behind_m: float | None
    stop_s: float
    covers_stop: bool


@dataclass(frozen=True, slots=True)
class LoggedRow(DriveRow):
    """A row with the name of its log; None: there is none."""

    log: str | None


@dataclass(frozen=True, slots=True)
class LoggedEvent(DriveEvent):
    """An event with the name of its log."""

    log: str


def row_of(drive: Drive) -> DriveRow:
    """The row of a drive."""
    spec, exposure = drive.spec, exposure_of(drive.motion)
    judged = [(r.kind, v.verdict) for r, v in drive.requests]

    def count(kind: str, *verdicts: str) -> int:
        return sum(k == kind and v in verdicts for k, v in judged)

    requests = count(EMERGENCY, FALSE, UNDECIDED)
    return DriveRow(
        sequence=drive.sequence,
        strategy=spec.strategy,
        rule=spec.rule,
        settings=spec.text,
        preset=spec.preset,
        sees=spec.sees,
        seed=spec.seed,
        frames=drive.frames,
        km=exposure.km,
        hours=exposure.hours,
        pedestrians=exposure.pedestrians,
        requests=requests,
        false_activations=count(EMERGENCY, FALSE),
        undecided=count(EMERGENCY, UNDECIDED),
        standing=count(EMERGENCY, STANDING),
        at_most_per_km=None if requests else exposure.at_most_per_km,
        warnings=count(WARNING, FALSE, UNDECIDED),
        false_warnings=count(WARNING, FALSE),
        undecided_warnings=count(WARNING, UNDECIDED),
        held_s=drive.held_s,
    )


def events_of(drive: Drive) -> list[DriveEvent]:
    """The requests and warnings of a drive, in the order of time."""
    spec = drive.spec
    return [
        DriveEvent(
            drive.sequence, spec.strategy, spec.rule, spec.text, r.kind, r.time_s, r.speed_mps * 3.6,
            r.track_id, r.category, r.ttc_s, r.gap_m, r.decel_mps2, r.horizon_s, v.verdict, v.reason,
            v.object_id, v.category, v.decel_mps2, v.gap_recorded_m, v.gap_braked_m, v.gap_behind_m, v.stop_s,
            v.covers_stop,
        )
        for r, v in drive.requests
    ]  # fmt: skip


def total_of(rows: Many[DriveRow]) -> DriveRow:
    """Several drives of one strategy, settings and rule as one row."""
    first = rows[0]
    exposure = total(Exposure(row.km, row.hours, row.pedestrians) for row in rows)
    requests = sum(row.requests for row in rows)
    return DriveRow(
        sequence=ALL,
        strategy=first.strategy,
        rule=first.rule,
        settings=first.settings,
        preset=first.preset,
        sees=first.sees,
        seed=first.seed,
        frames=sum(row.frames for row in rows),
        km=exposure.km,
        hours=exposure.hours,
        pedestrians=exposure.pedestrians,
        requests=requests,
        false_activations=sum(row.false_activations for row in rows),
        undecided=sum(row.undecided for row in rows),
        standing=sum(row.standing for row in rows),
        at_most_per_km=None if requests else exposure.at_most_per_km,
        warnings=sum(row.warnings for row in rows),
        false_warnings=sum(row.false_warnings for row in rows),
        undecided_warnings=sum(row.undecided_warnings for row in rows),
        held_s=sum(row.held_s for row in rows),
    )


@dataclass(frozen=True, slots=True)
class KeptDrive(DriveRow):
    """A row with its requests, as a journal keeps it.

    Args:
        events: a list of `DriveEvent`, as JSON.
        off_map: stretches of the way on no driving lane of the map.
        stretches: of the way that a monitored area was laid along.
    """

    events: str
    off_map: int
    stretches: int

    @property
    def row(self) -> DriveRow:
        """The row alone."""
        return DriveRow(**{field.name: getattr(self, field.name) for field in dataclasses.fields(DriveRow)})

    @property
    def requests_and_warnings(self) -> list[DriveEvent]:
        """The requests and warnings, in the order of time."""
        return [DriveEvent(**values) for values in json.loads(self.events)]


@dataclass(frozen=True, slots=True, eq=False)
class DriveItem:
    """A drive of a study.

    Args:
        spec: how the recording is seen and judged, with its vehicle.
        sequence: the recording.
        map_path: its map; None: there is none.
        key: hash of everything that determines what comes out.
    """

    spec: DriveSpec
    sequence: Sequence
    map_path: Path | None
    key: str


def measure(item: DriveItem) -> tuple[KeptDrive, FrameTime]:
    """Carry out a drive; see `carry_out` for what it raises."""
    drive = carry_out(item.sequence, item.spec, None if item.map_path is None else _loaded(item.map_path))
    row = dataclasses.asdict(row_of(drive))
    events = [dataclasses.asdict(event) for event in events_of(drive)]
    off_map, stretches = drive.off_map
    return KeptDrive(**row, events=json.dumps(events), off_map=off_map, stretches=stretches), drive.spent


def off_map_note(strategy: str, sequence: str, off_map: int, stretches: int) -> str:
    """That a drive left its map's lanes, where the rectangle is monitored whatever the strategy."""
    return (
        f"{strategy}, sequence {sequence}: {off_map} of {stretches} stretches of the way run on no driving "
        "lane of the map; the rectangle stands in there"
    )


@lru_cache(maxsize=4)
def _loaded(path: Path) -> LaneMap:
    """A map, loaded once in a process."""
    return load_drive_map(path)
