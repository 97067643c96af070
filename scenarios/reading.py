"""Text, JSON and numbers from files that others have written or damaged: every fault is one `ReadError`."""

from __future__ import annotations

import json
import math
import re
import reprlib
from pathlib import Path
from typing import Any

_WHOLE_DIGITS = 18
"""A whole number with more digits is read as a float: it may not fit into 64 bits."""

_HALF = re.compile(r"\\u[dD][89a-fA-F]")
"""Half of a pair of UTF-16, as JSON writes it."""

_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother = 2, 60, 60
_SHORT.maxdict = _SHORT.maxlist = _SHORT.maxtuple = 4


class ReadError(ValueError):
    """A file cannot be read, or holds something else than it should."""


class NoFileError(ReadError):
    """The system does not give the file: it is not there, no file, or not to be read."""


def shown(value: object) -> str:
    """A value for a message: short, in one line, whatever it is."""
    try:
        text = _SHORT.repr(value)
    except ValueError:  # a number of more digits than Python writes
        text = f"{type(value).__name__} with a number of too many digits"
    return " ".join(text.split())


def read_text(path: Path) -> str:
    """The text of a file in UTF-8.

    Raises:
        NoFileError: it cannot be read.
        ReadError: it is no text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ReadError(f"not a text file ({error.reason} at byte {error.start})") from None
    except ValueError as error:  # a zero byte in the path
        raise ReadError(str(error)) from None
    except OSError as error:
        raise NoFileError(error.strerror or str(error)) from None


def parse_json(text: str) -> Any:
    """What a text in JSON holds.

    Raises:
        ReadError: it is no JSON, is nested too deeply, names a key of an object twice, or holds a number
            beyond all floats or half a character; the message has the line where that is known.
    """
    try:
        content = json.loads(text, parse_int=_whole, parse_float=_finite, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise ReadError(f"line {error.lineno}: not JSON: {error.msg} at column {error.colno}") from None
    except RecursionError:
        raise ReadError("nested too deeply") from None
    if _HALF.search(text):
        _require_whole_characters(content)
    return content


def read_json(path: Path) -> Any:
    """What a file in JSON holds; see `read_text` and `parse_json`."""
    return parse_json(read_text(path))


def _require_whole_characters(content: object) -> None:
    """Refuse texts with one half of a pair of UTF-16, which no file could be written with."""
    todo = [content]
    while todo:
        value = todo.pop()
        if isinstance(value, dict):
            todo += [*value, *value.values()]
        elif isinstance(value, list):
            todo += value
        elif isinstance(value, str) and any("\ud800" <= c <= "\udfff" for c in value):
            raise ReadError(f"half a character in {shown(value)}")


def _whole(text: str) -> int | float:
    return int(text) if len(text) <= _WHOLE_DIGITS else _finite(text)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ReadError(f"number out of range: {shown(text)}")
    return value


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ReadError(f"key {shown(twice)} is there twice")
    return values


def exact_floats() -> dict[str, Any]:
    """Argument of `pandas.read_csv` for floats without rounding errors.

    From version 3 on, pandas reads them so anyway, and warns of the argument.
    """
    import pandas as pd

    return {} if int(pd.__version__.partition(".")[0]) >= 3 else {"float_precision": "round_trip"}
