"""Result tables: one row per run in `runs.csv`, one Parquet log per run, and the comparison of strategies.

The formats are those of docs/run-log.md. What is written depends on the results alone (no time stamps, no
paths), so that equal runs give equal bytes.
"""

from __future__ import annotations

import csv
import dataclasses
import enum
import io
import json
import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from evaluation.results.seal import KEY, PLACEHOLDER, check_seal, seal
from scenarios.reading import exact_floats, read_text, shown
from scenarios.simulation.log import COLUMNS, TEXT_COLUMNS
from scenarios.simulation.simulation import CUT_OFF, TIME_LIMIT_S, EndReason, is_avoided

if TYPE_CHECKING:
    import pandas as pd
    import rich.table

RUNS_CSV = "runs.csv"
RUNS_JSON = "runs.json"
SCHEMA = 2
"""Version of the format of `runs.json`; version 0.1.0 of the program wrote none."""
TABLE_MD = "table.md"
LOGS_FOLDER = "logs"

LOG_COLUMNS = COLUMNS
"""Columns of a run log, in the order in which they are written."""

STRATEGY_ORDER = ("rectangular", "map", "all")
"""Order in which tables and pictures show the strategies; others follow by name."""

Published = Mapping[float, tuple[float, float | None]]
"""Published impact speed in km/h and score, if there is one, of one strategy by test speed in km/h."""

_LOG_TEXT = frozenset(TEXT_COLUMNS)
_NEEDED = (
    (("actor", "detection", "ego", "ego_forecast", "forecast", "track"), ["x_m", "y_m", "yaw_rad"]),
    (("actor", "detection", "ego", "ego_forecast", "forecast", "track"), ["length_m", "width_m"]),
    (("actor", "ego", "track"), ["speed_mps"]),
    (("ego",), ["accel_mps2"]),
    (("actor", "forecast", "track"), ["id"]),
    (("ego_forecast", "forecast"), ["horizon_s"]),
)
"""Kinds of rows, and columns that they have values in."""
_GREATEST = 1e9
"""No time, place, angle or speed of a run is greater, in the units of its column."""
_LOG_NAME = re.compile(r"(?!\.+$)[\w.=+-]+( [\w.=+-]+)*")
"""Names of logs, which are names of files in the folder of logs."""
_BROKEN = (OSError, ValueError, TypeError, LookupError, NotImplementedError, OverflowError, MemoryError)
"""What pyarrow and pandas raise of a damaged file."""
_CONDITIONS = ("scenario", "preset", "adversaries", "weather")
MANY_DROPPED = 0.1
"""Users are told when more than this share of the detections of a run is dropped."""

_EMPTY, _CUT_OFF, _NO_CONFLICT = "–", "cut off", "no conflict"


class ResultsError(ValueError):
    """A result file cannot be written, read or understood."""


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
        """Whether the run counts as a collision avoided; see `scenarios.simulation.simulation.is_avoided`."""
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


@dataclass(frozen=True, slots=True)
class Table:
    """A finished table as text, for the terminal, a report or a test.

    Args:
        header: name of each column, with its unit.
        rows: one tuple per line, as long as the header.
        totals: lines at the foot, as long as the header.
        caption: what the reader has to know about the numbers, may be empty.
    """

    header: tuple[str, ...]
    rows: tuple[tuple[str, ...], ...]
    totals: tuple[tuple[str, ...], ...] = ()
    caption: str = ""


def log_path(directory: Path, name: str) -> Path:
    """File of the log that the column `log` names."""
    return directory / LOGS_FOLDER / f"{name}.parquet"


def write_runs(directory: Path, rows: Sequence[RunRow], configuration: Mapping[str, object]) -> None:
    """Write `runs.csv` and `runs.json` into a folder, which is made if needed.

    Args:
        directory: folder of the results.
        rows: the runs, written in this order.
        configuration: settings that made them; anything JSON can hold, and dataclasses, arrays, enumerations.

    Raises:
        ResultsError: the folder cannot be written or the configuration holds something JSON cannot.
    """
    records = [{name: _plain(getattr(row, name)) for name in RUN_COLUMNS} for row in rows]
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(RUN_COLUMNS)
    writer.writerows([_csv_cell(value) for value in record.values()] for record in records)
    described = configuration_json(configuration, {"runs": records})
    write_bytes(directory / RUNS_CSV, text.getvalue().encode())
    write_bytes(directory / RUNS_JSON, described)


def configuration_json(
    configuration: Mapping[str, object], more: Mapping[str, object] | None = None
) -> bytes:
    """A configuration with schema and version, as JSON.

    Args:
        configuration: anything JSON can hold, and dataclasses, arrays, enumerations.
        more: what stands beside it.

    Raises:
        ResultsError: it holds something that JSON cannot.
    """
    content = {
        "schema": SCHEMA,
        "version": metadata.version("smartmot"),
        "configuration": configuration,
        **(more or {}),
    }
    try:
        described = json.dumps(
            content, sort_keys=True, indent=2, allow_nan=False, ensure_ascii=False, default=_json_default
        )
    except (TypeError, ValueError) as error:
        raise ResultsError(
            f"configuration of the runs: {error}; use numbers, texts, lists and mappings"
        ) from error
    return f"{described}\n".encode()


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
    _require_file(path)
    kinds = {"int": "int64", "float": "float64", "float | None": "float64", "int | None": "float64"}
    kinds |= {"bool": "bool", "bool | None": "boolean"}
    dtypes: dict[str, Any] = {f.name: kinds.get(str(f.type), "str") for f in dataclasses.fields(RunRow)}
    try:
        text = read_text(path)
        header = _header(text)
        of_old = OLD_FALSE_ACTIVATION in header
        new = SINCE_0_2 if of_old else ()
        _require_columns(path, header, [name for name in RUN_COLUMNS if name not in new])
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
    except (*_BROKEN, csv.Error) as error:
        raise ResultsError(
            f"{path}: not a readable table of runs ({_one_line(error)}); run the evaluation again"
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
        if kinds[name].startswith(("float", "int")) and (column.abs() > _GREATEST).any():
            raise ValueError(f"column {name!r}: a value is beyond {_GREATEST:g}")
    told = set(runs["end_reason"]) if "end_reason" in names else set()
    unknown = told - {reason.value for reason in EndReason}
    if unknown:
        raise ValueError(f"column 'end_reason': unknown: {shown(min(unknown))}")
    ended = ~runs["end_reason"].isin(CUT_OFF) if "end_reason" in names else True
    if (runs["v_impact_kmh"].isna() & ended).any():
        raise ValueError("column 'v_impact_kmh': a value is missing of a run that was not cut off")
    for log in runs["log"].dropna():
        if not _LOG_NAME.fullmatch(log):
            raise ValueError(f"column 'log': no name of a log: {shown(log)}")


def write_log(path: Path, table: Mapping[str, NDArray[Any]]) -> None:
    """Write the log of one run as Parquet; folders are made if needed.

    Args:
        path: file to write.
        table: one array per column of `LOG_COLUMNS`, all of the same length. Absent numbers are NaN,
            absent texts are empty or None.

    Raises:
        ResultsError: a column is missing or has another length or kind, or the file cannot be written.
    """
    import pyarrow as pa  # type: ignore[import-untyped]
    import pyarrow.parquet as pq  # type: ignore[import-untyped]

    _require_columns(path, list(table), LOG_COLUMNS)
    lengths = {name: len(table[name]) for name in LOG_COLUMNS}
    if len(set(lengths.values())) > 1:
        raise ResultsError(f"{path}: columns of a log must be equally long, got {lengths}")
    try:
        arrays = [_log_column(name, table[name]) for name in LOG_COLUMNS]
        columns = [pa.array(values, type=kind, mask=absent) for values, kind, absent in arrays]
    except (TypeError, ValueError) as error:
        raise ResultsError(f"{path}: {_one_line(error)}; see docs/run-log.md for the format") from error
    sink = io.BytesIO()
    table = pa.table(columns, names=list(LOG_COLUMNS), metadata={KEY: PLACEHOLDER})
    pq.write_table(table, sink, compression="zstd", write_page_checksum=True)
    write_bytes(path, seal(sink.getvalue()))


def read_log(path: Path) -> pd.DataFrame:
    """Read the log of one run.

    Raises:
        ResultsError: the file is missing, is no Parquet file, is damaged, lacks a column, or holds values
            that are of another kind, too great or missing.
    """
    import pandas as pd
    import pyarrow as pa

    _require_file(path)
    try:
        content = path.read_bytes()
        check_seal(content)
        log = pd.read_parquet(io.BytesIO(content), engine="pyarrow", page_checksum_verification=True)
    except (*_BROKEN, pa.ArrowException) as error:
        raise ResultsError(
            f"{path}: not a readable Parquet log ({_one_line(error)}); run the evaluation again"
        ) from error
    _require_columns(path, list(map(str, log.columns)), LOG_COLUMNS)
    for name in LOG_COLUMNS:
        if name in _LOG_TEXT:
            good = all(isinstance(value, str) for value in log[name].dropna())
        else:
            good = pd.api.types.is_numeric_dtype(log[name]) and not pd.api.types.is_bool_dtype(log[name])
        if not good:
            raise ResultsError(f"{path}: column {name!r} holds other values; see docs/run-log.md")
    for name in LOG_COLUMNS:
        if name not in _LOG_TEXT and (log[name].abs() > _GREATEST).any():
            raise ResultsError(f"{path}: column {name!r} holds a value beyond {_GREATEST:g}")
    if not np.isfinite(log["time_s"].to_numpy(np.float64)).all():
        raise ResultsError(f"{path}: column 'time_s' has a row without a value")
    for kinds, names in _NEEDED:
        rows = log[log["kind"].isin(kinds)]
        holes = rows[names].isna()
        if holes.to_numpy().any():
            name = str(holes.any().idxmax())
            kind = rows.loc[holes[name], "kind"].iloc[0]
            raise ResultsError(f"{path}: column {name!r} has a row of kind {kind} without a value")
    return log


def read_logs(directory: Path, runs: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """Read the logs that a table of runs names, by name.

    Raises:
        ResultsError: a log is missing or broken.
    """
    return {str(name): read_log(log_path(directory, str(name))) for name in runs["log"].dropna()}


def ordered_strategies(runs: pd.DataFrame) -> list[str]:
    """Strategies in a table of runs, the known ones first."""
    known = {name: rank for rank, name in enumerate(STRATEGY_ORDER)}
    names = {str(name) for name in runs["strategy"]}
    return sorted(names, key=lambda name: (known.get(name, len(known)), name))


def varying_conditions(runs: pd.DataFrame, names: Sequence[str] = _CONDITIONS) -> list[str]:
    """Columns among the named ones in which the runs differ."""
    return [name for name in names if len(set(runs[name])) > 1]


def comparison_table(runs: pd.DataFrame, published: Mapping[str, Published] | None = None) -> Table:
    """Impact speed and score of each strategy, per test speed.

    Runs that differ in the seed only are averaged. Scenario, preset, adversaries and weather become columns
    where they differ; over several weather conditions the final score is the mean (paper, section IV).

    Args:
        runs: table of runs, as from `read_runs`.
        published: per strategy and test speed in km/h, the published impact speed in km/h and score
            (None where none was published).

    Returns:
        The table, with one line of total scores per condition and, if there were any, runs that were cut off
        and false activations at its foot. A strategy's columns stand together: impact speed, score and, if
        published, that impact speed and how far ours is above it.

    Raises:
        ResultsError: there are no runs or a column is missing.
    """
    _require_columns("comparison of runs", list(runs.columns), RUN_COLUMNS)
    if runs.empty:
        raise ResultsError("comparison of runs: the table of runs is empty; run at least one test")
    reference = published or {}
    strategies = ordered_strategies(runs)
    conditions = varying_conditions(runs)
    header = [*conditions, "v_test (km/h)"]
    for strategy in strategies:
        header += [f"{strategy} v_impact (km/h)", "score"]
        if strategy in reference:
            header += ["published (km/h)", "diff. (km/h)"]
    rows: list[tuple[str, ...]] = []
    totals: list[tuple[str, ...]] = []
    groups = runs.groupby(conditions, sort=True) if conditions else [((), runs)]
    for values, group in groups:
        lead = [str(value) for value in values]
        speeds = sorted({float(speed) for speed in group["v_test_kmh"]})
        for speed in speeds:
            cells = [_cells(group, strategy, speed, reference.get(strategy)) for strategy in strategies]
            rows.append((*lead, f"{speed:g}", *(text for cell in cells for text in cell)))
        cells = [_total_cells(group, strategy, speeds, reference.get(strategy)) for strategy in strategies]
        totals.append((*lead, "total", *(text for cell in cells for text in cell)))
    if "weather" in conditions:
        rest = [name for name in conditions if name != "weather"]
        for values, group in runs.groupby(rest, sort=True) if rest else [((), runs)]:
            speeds = sorted({float(speed) for speed in group["v_test_kmh"]})
            cells = [_total_cells(group, name, speeds, reference.get(name)) for name in strategies]
            lead = [*map(str, values), "mean", "total"]
            totals.append((*lead, *(text for cell in cells for text in cell)))
    for name, shares in _remarks(runs, strategies):
        line = [name, *[""] * len(conditions)]
        for strategy, share in zip(strategies, shares, strict=True):
            line += [share, *[""] * (3 if strategy in reference else 1)]
        totals.append(tuple(line))
    repeats = int(runs.groupby([*conditions, "strategy", "v_test_kmh"]).size().max())
    caption = f"Means over up to {repeats} runs per speed and strategy." if repeats > 1 else ""
    return Table(tuple(header), tuple(rows), tuple(totals), caption)


def impact_table(runs: pd.DataFrame) -> Table:
    """Impact speed of each strategy, per scenario and test speed, for tests without a score.

    Returns:
        The table, with the contacts and, if there were any, runs that were cut off and false activations at
        its foot.

    Raises:
        ResultsError: there are no runs or a column is missing.
    """
    _require_columns("comparison of runs", list(runs.columns), RUN_COLUMNS)
    if runs.empty:
        raise ResultsError("comparison of runs: the table of runs is empty; run at least one test")
    strategies = ordered_strategies(runs)
    conditions = varying_conditions(runs)
    lead = [*conditions, "v_test_kmh"]
    rows = []
    for values, group in runs.groupby(lead, sort=True):
        *names, speed = values
        cells = [_impact(group[group["strategy"] == strategy]) for strategy in strategies]
        rows.append((*map(str, names), f"{speed:g}", *cells))
    finished = runs[~cut_off(runs)]
    contacts = ("contacts", *[""] * len(conditions), *_shares(finished, strategies, finished["collided"]))
    remarks = [(name, *[""] * len(conditions), *shares) for name, shares in _remarks(runs, strategies)]
    totals = [contacts, *remarks]
    header = (*conditions, "v_test (km/h)", *(f"{strategy} v_impact (km/h)" for strategy in strategies))
    return Table(header, tuple(rows), tuple(totals))


def cut_off(runs: pd.DataFrame) -> pd.Series[bool]:
    """Which runs the time limit ended; what they would have come to is not known."""
    return runs["end_reason"].isin(CUT_OFF)


def without_conflict(runs: pd.DataFrame) -> pd.Series[bool]:
    """Which runs of a test with points have none though they were not cut off: nothing was to be avoided."""
    return runs["score"].isna() & runs["score_max"].notna() & ~cut_off(runs)


def avoided(runs: pd.DataFrame) -> pd.Series[bool]:
    """Which runs count as a collision avoided; see `scenarios.simulation.simulation.is_avoided`."""
    counts = ~cut_off(runs) & ~without_conflict(runs)
    return ~runs["collided"] & counts & ~runs["false_activation"].eq(True)


def _shares(runs: pd.DataFrame, strategies: Sequence[str], marks: pd.Series[bool]) -> list[str]:
    """How many runs of each strategy are marked."""
    chosen = [marks[runs["strategy"] == strategy] for strategy in strategies]
    return [f"{int(mine.sum())} of {len(mine)}" for mine in chosen]


def _remarks(runs: pd.DataFrame, strategies: Sequence[str]) -> list[tuple[str, list[str]]]:
    """What lowers the worth of a result, where it happened: name, and how many runs of each strategy."""
    found = []
    ended, can_be = cut_off(runs), runs[runs["false_activation"].notna()]
    false = can_be["false_activation"].eq(True)
    if ended.any():
        found.append(("cut off", _shares(runs, strategies, ended)))
    if without_conflict(runs).any():
        found.append(("no conflict", _shares(runs, strategies, without_conflict(runs))))
    if false.any():
        found.append(("false activations", _shares(can_be, strategies, false)))
    return found


def told_runs(rows: Sequence[RunRow], time_limit_s: float = TIME_LIMIT_S) -> list[str]:
    """What the reader has to know about finished runs, one line each; none if all ended as they should."""
    ended = sum(row.end_reason == EndReason.TIME_LIMIT for row in rows)
    lines = []
    if ended:
        lines.append(
            f"{ended} of {len(rows)} runs were cut off at {time_limit_s:g} s: they count nowhere as avoided, "
            "and have no score; shorten what comes before, or give the scenario a stop trigger"
        )
    not_begun = sum(row.end_reason == EndReason.NOT_BEGUN for row in rows)
    if not_begun:
        lines.append(
            f"{not_begun} of {len(rows)} runs were ended by the scenario's stop trigger before any event of "
            "the target began: they count nowhere as avoided, and have no score"
        )
    lost = [row for row in rows if row.dropped > MANY_DROPPED * (row.detections or 0)]
    if lost:
        worst = max(lost, key=lambda row: row.dropped / (row.detections or 1))
        lines.append(
            f"in {len(lost)} of {len(rows)} runs more than a tenth of the detections were dropped; most in "
            f"{worst.scenario}, {worst.strategy}, {worst.v_test_kmh:g} km/h: of {worst.detections} "
            f"{worst.dropped_score} for a score under the tracker's threshold, {worst.dropped_category} for "
            f"an unknown category, {worst.dropped_box} for an impossible box"
        )
    return lines


def told_notes(notes: Sequence[Sequence[str]]) -> list[str]:
    """Notes of finished runs, one line for those about the same: the first, and in how many runs.

    Args:
        notes: of every run.
    """
    first: dict[str, str] = {}
    runs: dict[str, int] = {}
    for lines in notes:
        for line in lines:
            about = line.partition(" of ")[2] or line  # the amounts before differ from run to run
            first.setdefault(about, line)
            runs[about] = runs.get(about, 0) + 1
    return [f"{line} (in {runs[about]} of {len(notes)} runs)" for about, line in first.items()]


def _impact(chosen: pd.DataFrame) -> str:
    """Mean impact speed of the runs that were not cut off and had a conflict."""
    finished = chosen[~cut_off(chosen) & ~without_conflict(chosen)]
    if len(chosen) and finished.empty:
        return _CUT_OFF if cut_off(chosen).all() else _NO_CONFLICT
    return _number(float(finished["v_impact_kmh"].mean()) if len(finished) else math.nan, ".2f")


def rich_table(table: Table, title: str | None = None) -> rich.table.Table:
    """The table for the terminal."""
    from rich.box import SIMPLE_HEAD
    from rich.markup import escape
    from rich.table import Table as RichTable

    view = RichTable(
        title=title,
        box=SIMPLE_HEAD,
        show_edge=False,
        pad_edge=False,
        padding=(0, 0),
        caption=table.caption or None,
        caption_justify="left",
    )
    for name, *cells in zip(table.header, *table.rows, *table.totals, strict=True):
        # Wide enough for every cell and every word of the header, so that only headers break, at spaces.
        width = max(map(len, [*name.split(), *cells]))
        view.add_column(escape(name), justify="right", width=width)
    for index, row in enumerate(table.rows):
        view.add_row(*map(escape, row), end_section=index == len(table.rows) - 1)
    for row in table.totals:
        view.add_row(*map(escape, row), style="bold")
    return view


def markdown_table(table: Table) -> str:
    """The table as Markdown, with its caption below; ends with a line break."""
    lines = [table.header, ("---:",) * len(table.header), *table.rows]
    lines += [tuple(f"**{text}**" if text else "" for text in row) for row in table.totals]
    text = "".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |\n" for line in lines)
    return f"{text}\n{table.caption}\n" if table.caption else text


def write_table(directory: Path, table: Table) -> None:
    """Write the comparison as `table.md` beside `runs.csv`.

    Raises:
        ResultsError: the folder cannot be written.
    """
    write_bytes(directory / TABLE_MD, markdown_table(table).encode())


def _select(group: pd.DataFrame, strategy: str, speed: float) -> pd.DataFrame:
    return group[(group["strategy"] == strategy) & (group["v_test_kmh"] == speed)]


def _cells(group: pd.DataFrame, strategy: str, speed: float, published: Published | None) -> list[str]:
    """Texts of one strategy at one speed."""
    chosen = _select(group, strategy, speed)
    score = float(chosen["score"].mean()) if len(chosen) else math.nan
    texts = [_impact(chosen), _number(score, ".2f")]
    if published is not None:
        impact = float(chosen["v_impact_kmh"][~cut_off(chosen) & ~without_conflict(chosen)].mean())
        there, _ = published.get(speed, (math.nan, None))
        texts += [_number(there, ".2f"), _number(impact - there, "+.2f")]
    return texts


def _total_cells(
    group: pd.DataFrame,
    strategy: str,
    speeds: Sequence[float],
    published: Published | None,
) -> list[str]:
    """Sums of the scores of one strategy: its mean at every speed, over what could be won there."""
    chosen = [_select(group, strategy, speed) for speed in speeds]
    scored = [one for one in chosen if one["score"].notna().any()]
    if scored:
        won = sum(float(one["score"].mean()) for one in scored)
        possible = sum(float(one["score_max"].mean()) for one in scored)
        text = f"{won:.2f}/{possible:g}"
    else:
        text = _EMPTY
    texts = ["", text]
    if published is not None:
        scores = [published[speed][1] for speed in speeds if speed in published]
        known = [score for score in scores if score is not None]
        texts += [f"score {sum(known):g}" if known else "", ""]
    return texts


def _number(value: float, form: Literal[".2f", "+.2f"]) -> str:
    if math.isnan(value):
        return _EMPTY
    rounded = round(value, 2)
    return format(rounded, form) if rounded else "0.00"


def _plain(value: object) -> object:
    """Python's own kind of a value; None for NaN."""
    if isinstance(value, np.generic):
        value = value.item()
    if isinstance(value, float) and math.isnan(value):
        return None
    return value


def _csv_cell(value: object) -> str:
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return repr(value) if isinstance(value, float) else str(value)


def _json_default(value: object) -> object:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    if isinstance(value, (np.ndarray, np.generic)):
        return value.tolist()
    if isinstance(value, enum.Enum):
        return value.name
    if isinstance(value, Path):
        return value.as_posix()
    if isinstance(value, Mapping):
        return dict(value)
    if isinstance(value, (set, frozenset)):
        return sorted(value, key=str)
    raise TypeError(f"cannot write a {type(value).__name__}")


def _log_column(name: str, values: NDArray[Any]) -> tuple[NDArray[Any], str, NDArray[np.bool_] | None]:
    """Values of one column of the log, their Arrow type and where they are absent."""
    if name in _LOG_TEXT:
        texts = np.asarray(values, dtype=object)
        return (
            texts,
            "string",
            np.array([not isinstance(text, str) or not text for text in texts], dtype=bool),
        )
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"column {name!r} of the log: expected numbers, got {values!r}") from error
    if name != "id":
        return numbers, "float64", None
    absent = ~np.isfinite(numbers)
    whole = np.where(absent, 0.0, numbers)
    if np.any(whole % 1.0):
        raise ValueError("column 'id' of the log: expected whole numbers")
    return whole.astype(np.int64), "int64", absent


def _require_file(path: Path) -> None:
    if not path.parent.is_dir():
        raise ResultsError(
            f"{path.parent}: no such folder; give the folder that the evaluation wrote (--out)"
        )
    if not path.is_file():
        raise ResultsError(f"{path}: no such file; run the evaluation into this folder first")


def _require_columns(where: Path | str, present: Sequence[str], wanted: Sequence[str]) -> None:
    missing = [name for name in wanted if name not in present]
    if missing:
        raise ResultsError(
            f"{where}: columns missing: {', '.join(missing)}; see docs/run-log.md for the format"
        )


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file as a whole or not at all; folders are made if needed.

    Raises:
        ResultsError: it cannot be written, as on a full disk.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content)
    except OSError as error:
        reason = error.strerror or _one_line(error)
        raise ResultsError(f"{path}: cannot be written ({reason}); choose another folder (--out)") from error


def write_whole(path: Path, content: bytes) -> None:
    """Write a file as a whole or not at all.

    Raises:
        OSError: it cannot be written; what was there before is as it was.
    """
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def _one_line(error: Exception) -> str:
    return " ".join(str(error).split())
