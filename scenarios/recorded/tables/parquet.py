"""Columns of Parquet files, as those of text files."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from scenarios import reading
from scenarios.errors import DatasetError
from scenarios.recorded.textfile import MAX_ROWS, LongTextError, TextTable, as_texts, missing_columns

if TYPE_CHECKING:
    import pandas as pd

SUFFIX = ".parquet"

_BROKEN = (OSError, ValueError, TypeError, LookupError, NotImplementedError, OverflowError, MemoryError)
"""What pyarrow and pandas raise of a damaged file."""


def column_names(path: Path) -> list[str]:
    """Names of a file's columns.

    Raises:
        DatasetError: It is missing or no Parquet file.
    """
    import pyarrow as pa  # type: ignore[import-untyped]
    import pyarrow.parquet as pq  # type: ignore[import-untyped]

    try:
        metadata = pq.read_metadata(path)
        names: list[str] = metadata.schema.to_arrow_schema().names
    except (*_BROKEN, pa.ArrowException) as error:
        raise _unreadable(path, error) from None
    if metadata.num_rows > MAX_ROWS:
        raise DatasetError(f"{path}: {metadata.num_rows} rows, {MAX_ROWS} at most expected")
    for name in names:
        if names.count(name) > 1:
            raise DatasetError(f"{path}: column {reading.shown(name)} is there twice")
    return names


def read_parquet_table(
    path: Path, needed: Collection[str], numbers: Collection[str], texts: Collection[str]
) -> TextTable:
    """Read the named columns that a file has; its rows are counted from 1.

    Args:
        path: The file.
        needed: Columns that must be there.
        numbers: Columns that hold numbers, or times, which become seconds.
        texts: Columns that hold texts.

    Raises:
        DatasetError: A column is missing or holds something else, or the file is damaged.
    """
    import pandas as pd
    import pyarrow as pa

    names = column_names(path)
    if missing := [name for name in needed if name not in names]:
        raise DatasetError(f"{path}: {missing_columns(missing)}")
    used = [name for name in names if name in numbers or name in texts or name in needed]
    try:
        frame = pd.read_parquet(path, columns=used, engine="pyarrow")
    except (*_BROKEN, pa.ArrowException) as error:
        raise _unreadable(path, error) from None
    columns = {name: (_numbers if name in numbers else _texts)(path, frame[name]) for name in used}
    return TextTable(path, np.arange(1, len(frame) + 1), columns)


def _unreadable(path: Path, error: BaseException) -> DatasetError:
    return DatasetError(f"{path}: not a readable Parquet file ({reading.shown(str(error))})")


def _numbers(path: Path, column: pd.Series[Any]) -> NDArray[Any]:
    """(N,) float64; NaN where there is no value."""
    import pandas as pd

    if isinstance(column.dtype, pd.CategoricalDtype):
        column = column.astype(column.cat.categories.dtype)
    if pd.api.types.is_datetime64_any_dtype(column.dtype):
        seconds = (column - pd.Timestamp(0, tz=column.dt.tz)) / pd.Timedelta(seconds=1)
        return seconds.to_numpy(np.float64, na_value=np.nan)
    if not pd.api.types.is_numeric_dtype(column.dtype) and not column.isna().all():
        raise DatasetError(f"{path}: column {reading.shown(column.name)} holds no numbers")
    return column.to_numpy(np.float64, na_value=np.nan)


def _texts(path: Path, column: pd.Series[Any]) -> NDArray[Any]:
    """(N,) texts; empty where there is no value."""
    absent = column.isna().to_numpy()
    values = column.astype(object).to_numpy()
    texts = ["" if none else str(value).strip() for value, none in zip(values, absent, strict=True)]
    try:
        return as_texts(texts, str(column.name))
    except LongTextError as error:
        raise DatasetError(f"{path}: {error}") from None
