"""Numbers of a run in few bytes: whole centimetres, milliradians and milliseconds, as differences, deflated.

The page's script reads what `pack` and `columns` write (`unpack`, `restored` in `page.js`); `unpack` and
`restored` here are its counterparts, so that the way there and back can be tested without a browser.
"""

from __future__ import annotations

import base64
import json
import zlib
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from evaluation.results.files import ResultsError
from smartmot.types import FloatArray

PER_METRE = 100.0
PER_RADIAN = 1000.0
PER_SECOND = 1000.0

_GREATEST_M = 1e9
"""No outline of a run reaches further: numbers of centimetres stay whole."""

_RAW_DEFLATE = -15
"""Window bits of zlib for a stream without header, as the browser's `deflate-raw` reads it."""


def deltas(values: ArrayLike, per_unit: float = 1.0) -> list[int]:
    """The first value and the differences that follow, in whole numbers of 1 / `per_unit`.

    Differences are taken after rounding, so that no error adds up.
    """
    rounded = np.rint(np.asarray(values, dtype=np.float64) * per_unit).astype(np.int64)
    steps: list[int] = np.diff(rounded, prepend=0).tolist()
    return steps


def restored(steps: Sequence[int], per_unit: float = 1.0) -> FloatArray:
    """Inverse of `deltas`, within half of 1 / `per_unit`."""
    return np.cumsum(np.asarray(steps, dtype=np.int64)) / per_unit


def ring(points_m: FloatArray, origin_m: FloatArray) -> list[int]:
    """An outline (P, 2), map frame, as x and y in turn: centimetres from the origin, then differences.

    Raises:
        ResultsError: it reaches further than any that can be shown.
    """
    if not (np.abs(points_m - origin_m) < _GREATEST_M).all():
        raise ResultsError(f"an outline reaches further than {_GREATEST_M:g} m; see presets in runs.json")
    rounded = np.rint((points_m - origin_m) * PER_METRE).astype(np.int64)
    steps: list[int] = np.diff(rounded, axis=0, prepend=np.zeros((1, 2), dtype=np.int64)).ravel().tolist()
    return steps


def restored_ring(steps: Sequence[int], origin_m: FloatArray) -> FloatArray:
    """Inverse of `ring`: (P, 2) points, map frame, metres."""
    points: FloatArray = np.cumsum(np.asarray(steps).reshape(-1, 2), axis=0) / PER_METRE + origin_m
    return points


def pack(content: Mapping[str, object]) -> str:
    """JSON, deflated, in base64: letters that mean nothing in HTML."""
    text = json.dumps(content, separators=(",", ":"), allow_nan=False, ensure_ascii=False).encode()
    squeeze = zlib.compressobj(9, zlib.DEFLATED, _RAW_DEFLATE)
    return base64.b64encode(squeeze.compress(text) + squeeze.flush()).decode("ascii")


def unpack(packed: str) -> dict[str, Any]:
    """Inverse of `pack`."""
    content: dict[str, Any] = json.loads(zlib.decompress(base64.b64decode(packed), _RAW_DEFLATE))
    return content
