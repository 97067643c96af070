"""The tables of the reference results, read back."""

from __future__ import annotations

import csv
import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

from evaluation.results import ResultsError

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
        with path.open(newline="", encoding="utf-8") as file:
            return list(csv.DictReader(file))
    except OSError as error:
        raise ResultsError(f"{path}: {error.strerror}; make it with smartmot-eval reports") from None


def read_records(path: Path, kind: type[Record]) -> list[Record]:
    """Lines of a table as values of the dataclass that they were written from.

    Raises:
        ResultsError: the file is missing, or is another table.
    """
    fields = dataclasses.fields(kind)  # type: ignore[arg-type]
    readers = {field.name: _READ[str(field.type).partition(" | ")[0]] for field in fields}
    optional = {field.name for field in fields if "None" in str(field.type)}
    rows = read_rows(path)
    try:
        return [
            kind(
                **{
                    name: None if name in optional and not row[name] else read(row[name])
                    for name, read in readers.items()
                }
            )
            for row in rows
        ]
    except (KeyError, ValueError) as error:
        raise ResultsError(f"{path}: not a table of this version ({error!r}); make it again") from None


def read_json(path: Path) -> dict[str, Any]:
    """A file of settings.

    Raises:
        ResultsError: the file is missing or not understood.
    """
    try:
        return dict(json.loads(path.read_text(encoding="utf-8")))
    except (OSError, ValueError) as error:
        raise ResultsError(f"{path}: {error}; make it with smartmot-eval reports") from None
