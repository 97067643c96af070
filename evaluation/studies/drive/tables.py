"""Tables of drives: `drives.csv`, a row per drive and one for all; `events.csv`, a row per request."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby

from evaluation.results.tables import EMPTY, Table, csv_bytes
from evaluation.studies.drive.drive import Drive
from evaluation.studies.drive.exposure import Exposure, exposure_of, total
from evaluation.studies.drive.requests import EMERGENCY, WARNING
from evaluation.studies.drive.verdicts import FALSE, STANDING, UNDECIDED

EVENTS_CSV, DRIVES_JSON = "events.csv", "drives.json"
ALL = "all"
"""Stands for all sequences together."""

HINDSIGHT = (
    "Open loop: the recorded vehicle was not braked. The planned path is the way that it then drove, which "
    "no planner knows; every strategy has it."
)


@dataclass(frozen=True, slots=True)
class DriveRow:
    """One drive, or all of a strategy and rule; a row of `drives.csv`. None where there is no value.

    Args:
        sequence: name of the recording, or `ALL`.
        strategy, rule, preset: what saw and judged it.
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
        log: name of the log.
    """

    sequence: str
    strategy: str
    rule: str
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
    log: str | None


DRIVE_COLUMNS = tuple(field.name for field in dataclasses.fields(DriveRow))
EVENT_COLUMNS = (
    "sequence", "strategy", "rule", "kind", "time_s", "speed_kmh", "track", "category", "ttc_s", "gap_m",
    "decel_mps2", "horizon_s", "verdict", "reason", "object", "object_category", "recorded_decel_mps2",
    "gap_recorded_m", "gap_braked_m", "gap_behind_m", "stop_s", "covers_stop", "log",
)  # fmt: skip


def drive_rows(drives: Sequence[Drive]) -> list[DriveRow]:
    """A row per drive, and one for all sequences of each strategy and rule that has several."""
    rows = []

    def key(drive: Drive) -> tuple[str, str]:
        return drive.spec.strategy, drive.spec.rule

    for _, group in groupby(drives, key):
        members = list(group)
        exposures = [exposure_of(drive.motion) for drive in members]
        rows += [_row([d], e, d.sequence) for d, e in zip(members, exposures, strict=True)]
        if len(members) > 1:
            rows.append(_row(members, total(exposures), ALL))
    return rows


def _row(drives: Sequence[Drive], exposure: Exposure, name: str) -> DriveRow:
    spec = drives[0].spec
    judged = [(r.kind, v.verdict) for drive in drives for r, v in drive.requests]

    def count(kind: str, *verdicts: str) -> int:
        return sum(k == kind and v in verdicts for k, v in judged)

    requests = count(EMERGENCY, FALSE, UNDECIDED)
    return DriveRow(
        sequence=name,
        strategy=spec.strategy,
        rule=spec.rule,
        preset=spec.preset,
        sees=spec.sees,
        seed=spec.seed,
        frames=sum(drive.frames for drive in drives),
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
        held_s=sum(drive.held_s for drive in drives),
        log=None if name == ALL else spec.log_name(name),
    )


def drives_csv(rows: Sequence[DriveRow]) -> bytes:
    """The rows as CSV."""
    return csv_bytes(DRIVE_COLUMNS, (dataclasses.astuple(row) for row in rows))


def events_csv(drives: Sequence[Drive]) -> bytes:
    """Every request of every drive as CSV."""
    return csv_bytes(EVENT_COLUMNS, (fields for drive in drives for fields in _events(drive)))


def _events(drive: Drive) -> list[tuple[object, ...]]:
    spec = drive.spec
    return [
        (
            drive.sequence, spec.strategy, spec.rule, r.kind, r.time_s, r.speed_mps * 3.6, r.track_id,
            r.category, r.ttc_s, r.gap_m, r.decel_mps2, r.horizon_s, v.verdict, v.reason, v.object_id,
            v.category, v.decel_mps2, v.gap_recorded_m, v.gap_braked_m, v.gap_behind_m, v.stop_s,
            v.covers_stop, spec.log_name(drive.sequence),
        )
        for r, v in drive.requests
    ]  # fmt: skip


def summary_table(rows: Sequence[DriveRow]) -> Table:
    """One line per strategy and rule, of all its sequences."""
    groups = [list(group) for _, group in groupby(rows, lambda row: (row.strategy, row.rule))]
    of_all = [group[-1] for group in groups]  # the row of all stands last; of one sequence it is the only one
    warn = any(row.warnings for row in of_all)
    header = ["strategy", "rule", "km", "h", "pedestrians met", "requests", "false activations", "undecided"]
    header += ["warnings", "false warnings"] if warn else []
    lines = []
    for row in of_all:
        line = [row.strategy, row.rule, f"{row.km:.2f}", f"{row.hours:.3f}"]
        line.append(EMPTY if row.pedestrians is None else str(row.pedestrians))
        line += [str(row.requests), str(row.false_activations), str(row.undecided)]
        line += [str(row.warnings), str(row.false_warnings)] if warn else []
        lines.append(tuple(line))
    return Table(tuple(header), tuple(lines), caption=" ".join((HINDSIGHT, *_bounds(of_all))))


def _bounds(rows: Sequence[DriveRow]) -> list[str]:
    """What no request at all says about the rate."""
    quiet = [row for row in rows if row.at_most_per_km is not None]
    if not quiet:
        return []
    bound = quiet[0].at_most_per_km
    names = ", ".join(f"{row.strategy} with {row.rule}" for row in quiet)
    return [
        f"No request ({names}): with 95 % confidence fewer than {bound:.2g} per km on such ways (3 / km)."
    ]
