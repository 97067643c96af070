"""The tables of the reference results, read back."""

from __future__ import annotations

import csv
import dataclasses
import gzip
import math
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from evaluation.results.files import ResultsError
from evaluation.results.rows import OLD_FALSE_ACTIVATION, SINCE_0_2
from scenarios import reading

Record = TypeVar("Record")

_READ: Mapping[str, Any] = {
    "str": str,
    "int": int,
    "float": float,
    "bool": lambda text: text.lower() == "true",
}


def read_rows(path: Path) -> list[dict[str, str]]:
    """Lines of a table by column.

    Raises:
        ResultsError: the file is missing.
    """
    try:
        with (gzip.open if path.suffix == ".gz" else open)(path, "rt", newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file, strict=True))
    except OSError as error:
        raise ResultsError(f"{path}: {error.strerror}; make it with smartmot-eval reference") from None
    except (csv.Error, ValueError, EOFError, zlib.error) as error:
        raise ResultsError(f"{path}: not a table ({error}); make it with smartmot-eval reference") from None


def read_records(path: Path, kind: type[Record]) -> list[Record]:
    """Lines of a table as values of the dataclass that they were written from.

    Raises:
        ResultsError: the file is missing, or is another table.
    """
    fields = dataclasses.fields(kind)  # type: ignore[arg-type]
    rows = read_rows(path)
    try:
        return [
            kind(**{field.name: _value(row, field.name, str(field.type)) for field in fields}) for row in rows
        ]
    except (KeyError, ValueError, TypeError, AttributeError) as error:
        raise ResultsError(f"{path}: not a table of this version ({error!r}); make it again") from None


def _value(row: Mapping[str, str], name: str, kind: str) -> Any:
    """A cell as the value that was written; what version 0.1.0 did not write is not known."""
    of_old = OLD_FALSE_ACTIVATION in row
    if of_old and name in (*SINCE_0_2, "dropped_share"):
        name = OLD_FALSE_ACTIVATION if name == "false_activation" else name
        if name not in row:
            return None if "None" in kind else {"str": "", "float": math.nan}[kind]
    text = row[name]
    return None if "None" in kind and not text else _READ[kind.partition(" | ")[0]](text)


def read_json(path: Path) -> dict[str, Any]:
    """A file of settings.

    Raises:
        ResultsError: the file is missing or not understood.
    """
    try:
        content = reading.read_json(path)
    except reading.ReadError as error:
        raise ResultsError(f"{path}: {error}; make it with smartmot-eval reference") from None
    if not isinstance(content, dict):
        raise ResultsError(f"{path}: holds no settings; make it with smartmot-eval reference")
    return content
