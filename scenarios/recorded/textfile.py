"""Tables of numbers from text files, read in bulk; a mistake is reported with file, line and field."""

from __future__ import annotations

import io
import os
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

import _smartmot
from scenarios import reading
from scenarios.errors import DatasetError
from smartmot.types import BoolArray, FloatArray, IntArray, StrArray

MAX_FRAMES = 10_000_000
"""Longest sequence, 11 days at 10 Hz; a greater frame number is a mistake that would fill the memory."""

MAX_ROWS = 50_000_000
"""Longest table in a binary file: a few bytes can claim any number of rows."""

MAX_TEXT_BYTES = 2**30
"""Of a column of texts, each of which takes as much memory as the longest."""

GREATEST_WHOLE = 2.0**53
"""Up to here all whole numbers are floats."""

_NOT_A_NUMBER = ["nan", "NaN", "NAN", "-nan", "+nan"]
"""Spellings that Python's `float` reads and pandas does not."""


class LongTextError(DatasetError):
    """A text is too long for a column."""


@dataclass(frozen=True, slots=True, eq=False)
class TextTable:
    """Columns of a text file.

    Args:
        path: The file.
        line: (N,) line numbers of the rows, from 1.
        columns: (N,) float64 or texts, by name; a column that the file does not have is missing.
    """

    path: Path
    line: IntArray
    columns: dict[str, NDArray[Any]]

    def __len__(self) -> int:
        return len(self.line)

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __getitem__(self, name: str) -> NDArray[Any]:
        return self.columns[name]

    def rows(self, chosen: BoolArray | IntArray) -> TextTable:
        """The rows for which an (N,) mask is true, or those with given numbers."""
        columns = {name: values[chosen] for name, values in self.columns.items()}
        return TextTable(self.path, self.line[chosen], columns)

    def stacked(self, *names: str) -> FloatArray:
        """(N, C) columns side by side."""
        return np.column_stack([self.columns[name] for name in names])

    def whole(self, name: str) -> IntArray:
        """A column as whole numbers.

        Raises:
            DatasetError: A value is not whole.
        """
        values = self.columns[name]
        self.require(np.isfinite(values) & (np.floor(values) == values), name, "must be a whole number")
        self.require(np.abs(values) <= GREATEST_WHOLE, name, "must be below 9e15")
        return values.astype(np.int64)

    def require(self, good: BoolArray, name: str, rule: str) -> None:
        """Demand a rule of every row.

        Raises:
            DatasetError: The first row that breaks it, with file, line, field and value.
        """
        if not good.all():
            row = int(np.argmin(good))
            value = self.columns[name][row]
            shown = f"{value:g}" if isinstance(value, float) else repr(str(value))
            raise DatasetError(f"{self.path}:{self.line[row]}: field {name!r} {rule}, got {shown}")

    def require_finite(self, *names: str) -> None:
        """Demand that columns be finite, one column after the other; see `require`."""
        for name in names:
            self.require(np.isfinite(self.columns[name]), name, "must be finite")


def is_given(path: Path) -> bool:
    """Whether an optional file is there.

    Raises:
        DatasetError: What has its name is no file: a folder, or a link that leads nowhere.
    """
    if path.is_file():
        return True
    if os.path.lexists(path):
        raise DatasetError(f"{path}: no file, but a folder or a link to nothing; remove it or copy it again")
    return False


def is_given_folder(path: Path) -> bool:
    """Whether an optional folder is there.

    Raises:
        DatasetError: What has its name is no folder.
    """
    if path.is_dir():
        return True
    if os.path.lexists(path):
        raise DatasetError(f"{path}: no folder; remove it or copy it again")
    return False


def read_text(path: Path) -> str:
    """The file's text.

    Raises:
        DatasetError: It is missing, not readable or no text.
    """
    try:
        return reading.read_text(path)
    except reading.NoFileError as error:
        raise DatasetError(f"{path}: {error}; for the folder's layout see docs/formats.md") from None
    except reading.ReadError as error:
        raise DatasetError(f"{path}: {error}") from None


def read_json(path: Path) -> Any:
    """Content of a JSON file.

    Raises:
        DatasetError: See `read_text`; or it is no JSON, see `scenarios.reading.parse_json`.
    """
    text = read_text(path)
    try:
        return reading.parse_json(text)
    except reading.ReadError as error:
        raise DatasetError(f"{path}: {error}") from None


def read_table(
    path: Path, columns: Sequence[str], text_columns: Collection[str] = (), optional: int = 0
) -> TextTable:
    """Read rows of fields separated by commas or by white space; blank lines are skipped.

    Args:
        path: The file; without any text it is a table without rows.
        columns: Names of the fields in their order.
        text_columns: Those that are no numbers.
        optional: How many of the last columns may be absent.

    Raises:
        DatasetError: A row has another number of fields or a field is no number; names file, line and field.
    """
    return _table(path, _filled_lines(path), list(columns), text_columns, optional)


def read_headed_table(path: Path, needed: Collection[str], numbers: Collection[str]) -> TextTable:
    """Read rows of fields separated by commas, whose names are in the first line.

    Args:
        path: The file.
        needed: Columns that must be there.
        numbers: Columns that hold numbers; all others are texts.

    Raises:
        DatasetError: A column is missing or named twice, a row has another number of fields than the
            header, or a field is no number; names file, line and field.
    """
    lines = _filled_lines(path)
    number, header = _header(path, lines)
    names = [name.strip() for name in header.split(",")]
    missing = [name for name in needed if name not in names]
    if missing:
        raise DatasetError(f"{path}:{number}: {missing_columns(missing)}")
    for name in names:
        if names.count(name) > 1:
            raise DatasetError(f"{path}:{number}: column {name!r} is named twice")
    return _table(path, lines[1:], names, [name for name in names if name not in numbers])


def header_names(path: Path) -> list[str]:
    """Names in the first line of a file.

    Raises:
        DatasetError: It cannot be read, or is empty.
    """
    return [name.strip() for name in _header(path, _filled_lines(path))[1].split(",")]


def missing_columns(names: Iterable[str]) -> str:
    """What a message says of columns that are not there."""
    return f"columns missing: {', '.join(names)} (see docs/formats.md)"


def _header(path: Path, lines: list[tuple[int, str]]) -> tuple[int, str]:
    """Number and text of the line that names the columns."""
    if not lines:
        raise DatasetError(f"{path}:1: empty; the first line must name the columns (docs/formats.md)")
    return lines[0]


def _filled_lines(path: Path) -> list[tuple[int, str]]:
    """Lines that are not blank, with their numbers."""
    lines = enumerate(read_text(path).splitlines(), 1)
    return [(number, line) for number, line in lines if line and not line.isspace()]


def _table(
    path: Path, lines: list[tuple[int, str]], names: list[str], texts: Collection[str], optional: int = 0
) -> TextTable:
    """Rows with the named fields, the last ones of which may be absent."""
    rows = [line for _, line in lines]
    number = np.array([number for number, _ in lines], dtype=np.int64)
    if not rows:
        return TextTable(path, number, {n: np.zeros(0, np.str_ if n in texts else np.float64) for n in names})
    separator = "," if "," in rows[0] else None
    widths = np.array([len(row.split(separator)) for row in rows], dtype=np.int64)
    present = int(widths[0])
    if not len(names) - optional <= present <= len(names):
        present = len(names)
    names = names[:present]
    wrong = np.flatnonzero(widths != present)
    if len(wrong):
        raise DatasetError(
            f"{path}:{number[wrong[0]]}: {widths[wrong[0]]} fields, {present} expected: {' '.join(names)}"
        )
    numbers = [name for name in names if name not in texts]
    try:
        return TextTable(path, number, _columns(rows, separator, names, numbers))
    except LongTextError as error:
        raise DatasetError(f"{path}: {error}") from None
    except ValueError:  # pandas does not tell where
        raise _no_number(path, lines, separator, names, numbers) from None


def _columns(
    rows: list[str], separator: str | None, names: list[str], numbers: list[str]
) -> dict[str, NDArray[Any]]:
    """The columns of rows that all have the right number of fields."""
    import pandas as pd

    table = pd.read_csv(
        io.StringIO("\n".join(rows)),
        sep=separator or r"\s+",
        names=names,
        header=None,
        index_col=False,
        dtype={name: np.float64 if name in numbers else str for name in names},
        keep_default_na=False,
        na_values=dict.fromkeys(numbers, _NOT_A_NUMBER),
        quoting=3,  # no quotes: a quotation mark is a character like any other
        **reading.exact_floats(),
    )
    columns: dict[str, NDArray[Any]] = {}
    for name in names:
        values = table[name].to_numpy()
        columns[name] = values if name in numbers else np.char.strip(as_texts(values.tolist(), name))
    return columns


def as_texts(values: list[str], name: str) -> StrArray:
    """(N,) texts.

    Raises:
        LongTextError: The longest of them would make the column fill the memory.
    """
    longest = max(map(len, values), default=0)
    if 4 * longest * len(values) > MAX_TEXT_BYTES:
        raise LongTextError(f"column {name!r} has a text of {longest} characters, too long for a name")
    return np.array(values, dtype=np.str_)


def _no_number(
    path: Path, lines: list[tuple[int, str]], separator: str | None, names: list[str], numbers: list[str]
) -> DatasetError:
    """The first field that is no number."""
    for line, row in lines:
        for name, value in zip(names, row.split(separator), strict=True):
            if name in numbers and not _is_number(value):
                return DatasetError(f"{path}:{line}: field {name!r} is no number: {value.strip()!r}")
    return DatasetError(f"{path}: not a readable table; expected the fields {' '.join(names)}")


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True


__getattr__ = _smartmot.renamed(__name__, {"Table": "scenarios.recorded.textfile.TextTable"})
