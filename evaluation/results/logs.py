"""The log of one run, a Parquet file with a checksum; docs/run-log.md has the format."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from evaluation.results.files import (
    ResultsError,
    log_path,
    one_line,
    require_columns,
    require_file,
    write_bytes,
)
from evaluation.results.seal import KEY, PLACEHOLDER, check_seal, seal
from scenarios.simulation.log import COLUMNS, TEXT_COLUMNS

if TYPE_CHECKING:
    import pandas as pd

LOG_COLUMNS = COLUMNS
"""Columns of a run log, in the order in which they are written."""

BROKEN = (OSError, ValueError, TypeError, LookupError, NotImplementedError, OverflowError, MemoryError)
"""What pyarrow and pandas raise of a damaged file."""
GREATEST = 1e9
"""No time, place, angle or speed of a run is greater, in the units of its column."""

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

    require_columns(path, list(table), LOG_COLUMNS)
    lengths = {name: len(table[name]) for name in LOG_COLUMNS}
    if len(set(lengths.values())) > 1:
        raise ResultsError(f"{path}: columns of a log must be equally long, got {lengths}")
    try:
        arrays = [_log_column(name, table[name]) for name in LOG_COLUMNS]
        columns = [pa.array(values, type=kind, mask=absent) for values, kind, absent in arrays]
    except (TypeError, ValueError) as error:
        raise ResultsError(f"{path}: {one_line(error)}; see docs/run-log.md for the format") from error
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

    require_file(path)
    try:
        content = path.read_bytes()
        check_seal(content)
        log = pd.read_parquet(io.BytesIO(content), engine="pyarrow", page_checksum_verification=True)
    except (*BROKEN, pa.ArrowException) as error:
        raise ResultsError(
            f"{path}: not a readable Parquet log ({one_line(error)}); run the evaluation again"
        ) from error
    require_columns(path, list(map(str, log.columns)), LOG_COLUMNS)
    for name in LOG_COLUMNS:
        if name in _LOG_TEXT:
            good = all(isinstance(value, str) for value in log[name].dropna())
        else:
            good = pd.api.types.is_numeric_dtype(log[name]) and not pd.api.types.is_bool_dtype(log[name])
        if not good:
            raise ResultsError(f"{path}: column {name!r} holds other values; see docs/run-log.md")
    for name in LOG_COLUMNS:
        if name not in _LOG_TEXT and (log[name].abs() > GREATEST).any():
            raise ResultsError(f"{path}: column {name!r} holds a value beyond {GREATEST:g}")
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


def _log_column(name: str, values: NDArray[Any]) -> tuple[NDArray[Any], str, NDArray[np.bool_] | None]:
    """Values of one column of the log, their Arrow type and where they are absent."""
    if name in _LOG_TEXT:
        texts = np.asarray(values, dtype=object)
        if np.asarray(values).dtype.kind == "U":  # of a run; one read from a file has None where none is
            return texts, "string", np.asarray(values) == ""
        empty = [not isinstance(text, str) or not text for text in texts]
        return texts, "string", np.array(empty, dtype=bool)
    try:
        numbers = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise ValueError(f"column {name!r} of the log: expected numbers, got {values!r}") from error
    if name != "id":
        return numbers, "float64", None
    absent = ~np.isfinite(numbers)
    ids = np.where(absent, 0.0, numbers)
    if np.any(ids % 1.0):
        raise ValueError("column 'id' of the log: expected whole numbers")
    return ids.astype(np.int64), "int64", absent
