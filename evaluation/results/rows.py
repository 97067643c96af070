"""The table of runs, `runs.csv`: a row per run, written and read; and which runs count as what.

What is written depends on the results alone (no time stamps, no paths), so that equal runs give equal bytes.
docs/run-log.md has the format.
"""

from __future__ import annotations

import csv
import dataclasses
import io
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.results.files import (
    RUNS_CSV,
    RUNS_JSON,
    ResultsError,
    configuration_json,
    one_line,
    require_columns,
    require_file,
    write_files,
)
from evaluation.results.logs import BROKEN, GREATEST
from evaluation.results.tables import csv_bytes
from scenarios.reading import exact_floats, read_text, shown
from scenarios.simulation.ends import CUT_OFF, EndReason, is_avoided

if TYPE_CHECKING:
    import pandas as pd

STRATEGY_ORDER = ("rectangular", "map", "all")
"""Order in which tables and pictures show the strategies; others follow by name."""

_CONDITIONS = ("scenario", "preset", "adversaries", "weather")

_LOG_NAME = re.compile(r"(?!\.+$)[\w.=+-]+( [\w.=+-]+)*")
"""Names of logs, which are names of files in the folder of logs."""


@dataclass(frozen=True, slots=True)
class RunRow:
    """One run, a row of `runs.csv`; None where a value does not exist.

    Args:
        scenario: name of the test.
        strategy: monitored-area strategy.
        preset: physical conditions.
        weather: weather, which sets the friction.
        adversaries: other participants, none or static.
        seed: seed of every random number in the run.
        v_test_kmh: speed of the test.
        v_impact_kmh: speed at contact, 0 without contact; None of a run that the time limit cut off.
        collided: whether the ego touched the target.
        score: points won; None where the test gives none, and of a run that was cut off or had no conflict.
        score_max: points to be won; None where the test gives none.
        flag_time_s: time at which the emergency brake was requested.
        flag_distance_m: free distance to the target at that time.
        stop_gap_m: free distance left when the ego stood still.
        contact_time_s: time of contact.
        t0_s: time of stop or contact.
        end_reason: why the run ended, an `EndReason` of the simulation; `time_limit` and `not_begun`: it was
            cut off.
        end_time_s: when it ended.
        false_activation: whether the emergency brake was requested where nothing should happen, or before a
            target that was to set off had done so; None where neither can be.
        detections: what the detector reported in the run.
        dropped_score: of these, dropped for a score under the tracker's threshold.
        dropped_category: for an unknown category.
        dropped_box: for an impossible box.
        target_start_time_s: when the target left standstill.
        target_steady_time_s: since when its speed was constant at the contact, or else at the end.
        ego_speed_at_contact_kmh: along its heading, negative in reverse.
        target_speed_at_contact_kmh: of whom the ego hit.
        impact_location_percent: where its centre met the ego's width; 0 the right edge, 100 the left one.
        log: name of the run's log, without folder and suffix.
    """

    scenario: str
    strategy: str
    preset: str
    weather: str
    adversaries: str
    seed: int
    v_test_kmh: float
    v_impact_kmh: float | None
    collided: bool
    score: float | None
    score_max: float | None
    flag_time_s: float | None
    flag_distance_m: float | None
    stop_gap_m: float | None
    contact_time_s: float | None
    t0_s: float | None
    end_reason: str
    end_time_s: float
    false_activation: bool | None
    detections: int | None
    dropped_score: int | None
    dropped_category: int | None
    dropped_box: int | None
    target_start_time_s: float | None
    target_steady_time_s: float | None
    ego_speed_at_contact_kmh: float | None
    target_speed_at_contact_kmh: float | None
    impact_location_percent: float | None
    log: str | None

    @property
    def dropped(self) -> int:
        """Detections dropped for whatever reason."""
        return sum(count or 0 for count in (self.dropped_score, self.dropped_category, self.dropped_box))

    @property
    def avoided(self) -> bool:
        """Whether the run counts as a collision avoided; see `scenarios.simulation.ends.is_avoided`."""
        no_conflict = self.score is None and self.score_max is not None
        return not no_conflict and is_avoided(self.collided, self.end_reason, self.false_activation)


RUN_COLUMNS = tuple(field.name for field in dataclasses.fields(RunRow))
"""Columns of `runs.csv`, in the order in which they are written."""

OLD_FALSE_ACTIVATION = "false_stop"
"""What version 0.1.0 called the column `false_activation`."""

SINCE_0_2 = (
    "end_reason",
    "end_time_s",
    "false_activation",
    "detections",
    "dropped_score",
    "dropped_category",
    "dropped_box",
)
"""Columns that folders of version 0.1.0 do not have."""


def write_runs(directory: Path, rows: Sequence[RunRow], configuration: Mapping[str, object]) -> None:
    """Write `runs.csv` and `runs.json` into a folder, which is made if needed.

    Args:
        directory: folder of the results.
        rows: the runs, written in this order.
        configuration: settings that made them; anything JSON can hold, and dataclasses, arrays, enumerations.

    Raises:
        ResultsError: the folder cannot be written or the configuration holds something JSON cannot.
    """
    records = [[_plain(getattr(row, name)) for name in RUN_COLUMNS] for row in rows]
    runs = [dict(zip(RUN_COLUMNS, record, strict=True)) for record in records]
    described = configuration_json(configuration, {"runs": runs})
    write_files(directory, {RUNS_CSV: csv_bytes(RUN_COLUMNS, records), RUNS_JSON: described})


def read_runs(directory: Path) -> pd.DataFrame:
    """Read `runs.csv` of a result folder.

    Returns:
        One row per run; missing numbers and texts are NaN, `false_activation` is True, False or None. What
        version 0.1.0 did not write is missing; its `false_stop` is taken for `false_activation`.

    Raises:
        ResultsError: the folder or the file is missing, or the file is no table of runs.
    """
    import pandas as pd

    path = directory / RUNS_CSV
    require_file(path)
    kinds = {"int": "int64", "float": "float64", "float | None": "float64", "int | None": "float64"}
    kinds |= {"bool": "bool", "bool | None": "boolean"}
    dtypes: dict[str, Any] = {f.name: kinds.get(str(f.type), "str") for f in dataclasses.fields(RunRow)}
    try:
        text = read_text(path)
        header = _header(text)
        of_old = OLD_FALSE_ACTIVATION in header
        new = SINCE_0_2 if of_old else ()
        require_columns(path, header, [name for name in RUN_COLUMNS if name not in new])
        if of_old:
            dtypes[OLD_FALSE_ACTIVATION] = dtypes.pop("false_activation")
        with np.errstate(invalid="ignore"):  # an infinite whole number: pandas warns, then refuses it
            runs: pd.DataFrame = pd.read_csv(
                io.StringIO(text), dtype=dtypes, keep_default_na=False, na_values=[""], **exact_floats()
            )
        _require_values(runs, [name for name in RUN_COLUMNS if name in runs])
        if of_old:
            runs = runs.rename(columns={OLD_FALSE_ACTIVATION: "false_activation"})
            runs = runs.reindex(columns=list(RUN_COLUMNS))
        marks = runs["false_activation"]
        runs["false_activation"] = marks.astype(object).where(marks.notna(), None)
        return runs
    except ResultsError:
        raise
    except (*BROKEN, csv.Error) as error:
        raise ResultsError(
            f"{path}: not a readable table of runs ({one_line(error)}); run the evaluation again"
        ) from error


def _header(text: str) -> list[str]:
    """Names of the columns of a table in which every row has all of them.

    Raises:
        ValueError: a row has another number of fields, or a column is there twice.
    """
    rows = csv.reader(io.StringIO(text, newline=""), strict=True)
    header = next(rows, [])
    if not header:
        raise ValueError("empty")
    for row in rows:
        if row and len(row) != len(header):
            raise ValueError(f"line {rows.line_num}: {len(row)} fields, {len(header)} expected")
    for name in header:
        if header.count(name) > 1:
            raise ValueError(f"column {name!r} is there twice")
    return header


def _require_values(runs: pd.DataFrame, names: Sequence[str]) -> None:
    """See that values are there where a run must have them, and possible.

    Raises:
        ValueError: one is not.
    """
    kinds = {field.name: str(field.type) for field in dataclasses.fields(RunRow)}
    for name in names:
        column = runs[name]
        if "None" not in kinds[name] and column.isna().any():
            raise ValueError(f"column {name!r}: a value is missing")
        if name != "seed" and kinds[name].startswith(("float", "int")) and (column.abs() > GREATEST).any():
            raise ValueError(f"column {name!r}: a value is beyond {GREATEST:g}")
    reasons = set(runs["end_reason"]) if "end_reason" in names else set()
    unknown = reasons - {reason.value for reason in EndReason}
    if unknown:
        raise ValueError(f"column 'end_reason': unknown: {shown(min(unknown))}")
    ended = ~runs["end_reason"].isin(CUT_OFF) if "end_reason" in names else True
    if (runs["v_impact_kmh"].isna() & ended).any():
        raise ValueError("column 'v_impact_kmh': a value is missing of a run that was not cut off")
    for log in runs["log"].dropna():
        if not _LOG_NAME.fullmatch(log):
            raise ValueError(f"column 'log': no name of a log: {shown(log)}")


def ordered_strategies(runs: pd.DataFrame) -> list[str]:
    """Strategies in a table of runs, the known ones first."""
    known = {name: rank for rank, name in enumerate(STRATEGY_ORDER)}
    names = {str(name) for name in runs["strategy"]}
    return sorted(names, key=lambda name: (known.get(name, len(known)), name))


def varying_conditions(runs: pd.DataFrame, names: Sequence[str] = _CONDITIONS) -> list[str]:
    """Columns among the named ones in which the runs differ."""
    return [name for name in names if len(set(runs[name])) > 1]


def cut_off(runs: pd.DataFrame) -> pd.Series[bool]:
    """Which runs the time limit ended; what they would have come to is not known."""
    return runs["end_reason"].isin(CUT_OFF)


def without_conflict(runs: pd.DataFrame) -> pd.Series[bool]:
    """Which runs of a test with points have none though they were not cut off: nothing was to be avoided."""
    return runs["score"].isna() & runs["score_max"].notna() & ~cut_off(runs)


def avoided(runs: pd.DataFrame) -> pd.Series[bool]:
    """Which runs count as a collision avoided; see `scenarios.simulation.ends.is_avoided`."""
    counts = ~cut_off(runs) & ~without_conflict(runs)
    return ~runs["collided"] & counts & ~runs["false_activation"].eq(True)


def _plain(value: object) -> object:
    """Python's own kind of a value; None for NaN."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and math.isnan(value):
        return None
    return value
