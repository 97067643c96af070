"""Files of a folder of results: their names, and each written as a whole or not at all."""

from __future__ import annotations

import dataclasses
import enum
import errno
import json
import os
from collections.abc import Iterable, Mapping
from importlib import metadata
from pathlib import Path

import numpy as np

from evaluation.results.calls import note

RUNS_CSV = "runs.csv"
RUNS_JSON = "runs.json"
SCHEMA = 2
"""Version of the format of `runs.json`; version 0.1.0 of the program wrote none."""
TABLE_MD = "table.md"
DRIVES_CSV = "drives.csv"
"""In place of `RUNS_CSV` in a folder of recorded drives."""
COMPARE_JSON = "compare.json"
"""In place of `RUNS_JSON` in a folder of a comparison."""
STUDY_JSON = "study.json"
"""In place of `RUNS_JSON` in a folder of a question."""
METRICS_CSV = "metrics.csv"
RESULTS = (RUNS_CSV, RUNS_JSON, DRIVES_CSV, COMPARE_JSON, STUDY_JSON, METRICS_CSV)
"""Files by which a folder of results is known."""
LOGS_FOLDER = "logs"


class ResultsError(ValueError):
    """A result file cannot be written, read or understood."""


def log_path(directory: Path, name: str) -> Path:
    """File of the log that the column `log` names."""
    return directory / LOGS_FOLDER / f"{name}.parquet"


def require_file(path: Path) -> None:
    """See that a file of results is there.

    Raises:
        ResultsError: it is not, or its folder is not.
    """
    if not path.parent.is_dir():
        raise ResultsError(
            f"{path.parent}: no such folder; give the folder that the evaluation wrote (--out)"
        )
    if not path.is_file():
        raise ResultsError(f"{path}: no such file; run the evaluation into this folder first")


def require_columns(where: Path | str, present: Iterable[str], wanted: Iterable[str]) -> None:
    """See that a table has its columns.

    Raises:
        ResultsError: one is missing.
    """
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
        reason = error.strerror or one_line(error)
        raise ResultsError(f"{path}: cannot be written ({reason}); choose another folder (--out)") from error


def write_whole(path: Path, content: bytes) -> None:
    """Write a file as a whole or not at all.

    Raises:
        OSError: it cannot be written; what was there before is as it was.
    """
    _require_name(path)
    note(path)
    part = path.with_name(f".{path.name}.part")
    try:
        part.write_bytes(content)
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise


def _require_name(path: Path) -> None:
    """Refuse a path without a name: "" and "." are the working folder."""
    if not path.name:
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))


def check_writable(path: Path) -> None:
    """Refuse a place for a file before its content is made, which may take long; nothing is left there.

    Raises:
        OSError: `write_whole` could not write it.
    """
    _require_name(path)
    part = path.with_name(f".{path.name}.part")
    part.touch()
    part.unlink()
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR))


def write_files(folder: Path, contents: Mapping[str, bytes]) -> list[Path]:
    """Write files by name into a folder; see `write_bytes`."""
    for name, content in contents.items():
        write_bytes(folder / name, content)
    return [folder / name for name in contents]


def discard_tables(folder: Path) -> None:
    """Remove the tables of earlier runs before the first log is written.

    Logs have the same names in other conditions: with the old tables a folder whose command was killed would
    be shown as runs that did not take place.

    Raises:
        ResultsError: one cannot be removed.
    """
    for name in (RUNS_CSV, RUNS_JSON, DRIVES_CSV, TABLE_MD):
        try:
            (folder / name).unlink(missing_ok=True)
        except OSError as error:
            raise ResultsError(
                f"{folder / name}: cannot be replaced ({error.strerror}); choose another folder (--out)"
            ) from None


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
        return json_bytes(content)
    except (TypeError, ValueError) as error:
        raise ResultsError(
            f"configuration of the runs: {error}; use numbers, texts, lists and mappings"
        ) from error


def json_bytes(content: object, indent: int = 2) -> bytes:
    """A value as JSON, keys sorted, so that equal values give equal bytes.

    Args:
        content: anything JSON can hold, and dataclasses, arrays, enumerations, paths and sets.
        indent: spaces per level.

    Raises:
        TypeError: it holds something else.
        ValueError: it holds a number that is not finite.
    """
    text = json.dumps(
        content, sort_keys=True, indent=indent, allow_nan=False, ensure_ascii=False, default=_json_default
    )
    return f"{text}\n".encode()


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


def one_line(error: Exception) -> str:
    """The message of an error without line breaks."""
    return " ".join(str(error).split())
