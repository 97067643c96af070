"""Text and JSON from files that others have written or damaged: every fault is one `ReadError`."""

from __future__ import annotations

import json
import math
import reprlib
from pathlib import Path
from typing import Any

_WHOLE_DIGITS = 18
"""A whole number with more digits is read as a float: it may not fit into 64 bits."""

_SHORT = reprlib.Repr()
_SHORT.maxlevel, _SHORT.maxstring, _SHORT.maxother = 2, 60, 60
_SHORT.maxdict = _SHORT.maxlist = _SHORT.maxtuple = 4


class ReadError(ValueError):
    """A file cannot be read, or holds something else than it should."""


def shown(value: object) -> str:
    """A value for a message: short, in one line, whatever it is."""
    return " ".join(_SHORT.repr(value).split())


def read_text(path: Path) -> str:
    """The text of a file in UTF-8.

    Raises:
        ReadError: it cannot be read, or is no text.
    """
    try:
        return path.read_text(encoding="utf-8-sig")
    except UnicodeDecodeError as error:
        raise ReadError(f"not a text file ({error.reason} at byte {error.start})") from None
    except ValueError as error:  # a zero byte in the path
        raise ReadError(str(error)) from None
    except OSError as error:
        raise ReadError(error.strerror or str(error)) from None


def parse_json(text: str) -> Any:
    """What a text in JSON holds.

    Raises:
        ReadError: it is no JSON, is nested too deeply, names a key of an object twice, or holds a number
            beyond all floats; the message has the line where that is known.
    """
    try:
        return json.loads(text, parse_int=_whole, parse_float=_finite, object_pairs_hook=_object)
    except json.JSONDecodeError as error:
        raise ReadError(f"line {error.lineno}: not JSON: {error.msg} at column {error.colno}") from None
    except RecursionError:
        raise ReadError("nested too deeply") from None


def read_json(path: Path) -> Any:
    """What a file in JSON holds; see `read_text` and `parse_json`."""
    return parse_json(read_text(path))


def _whole(text: str) -> int | float:
    return int(text) if len(text) <= _WHOLE_DIGITS else _finite(text)


def _finite(text: str) -> float:
    value = float(text)
    if not math.isfinite(value):
        raise ReadError(f"number out of range: {shown(text)}")
    return value


def _object(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    found = dict(pairs)
    if len(found) < len(pairs):
        names = [name for name, _ in pairs]
        twice = next(name for name in names if names.count(name) > 1)
        raise ReadError(f"key {shown(twice)} is there twice")
    return found
