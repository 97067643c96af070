"""Numbers of the ego over time as protobuf messages, which viewers plot, written for all times at once."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from smartmot.types import FloatArray

PACKAGE, MESSAGE = "smartmot", "EgoSignals"
SIGNALS = ("speed_mps", "accel_mps2", "time_to_collision_s")
"""Fields of the message, numbered from 1; all are doubles, NaN where there is no value."""

_LENGTH_DELIMITED, _DOUBLE_TAG = 2, 1
"""Wire types of protobuf: bytes after their length, and eight bytes."""
_OPTIONAL, _TYPE_DOUBLE = 1, 1
"""Label and type of a field in a descriptor (google/protobuf/descriptor.proto)."""


def encoded(columns: Sequence[FloatArray]) -> list[bytes]:
    """(T,) messages from one (T,) column per signal."""
    numbers = range(1, len(columns) + 1)
    fields = [part for k in numbers for part in ((f"tag{k}", "u1"), (f"value{k}", "<f8"))]
    rows = np.zeros(len(columns[0]), dtype=np.dtype(fields))
    for k, column in zip(numbers, columns, strict=True):
        rows[f"tag{k}"], rows[f"value{k}"] = k << 3 | _DOUBLE_TAG, column
    content, size = rows.tobytes(), rows.dtype.itemsize
    return [content[at : at + size] for at in range(0, len(content), size)]


def descriptor() -> bytes:
    """The message's schema as a FileDescriptorSet."""
    fields = [
        _bytes(1, name.encode()) + _varint_field(3, number) + _varint_field(4, _OPTIONAL)
        + _varint_field(5, _TYPE_DOUBLE)
        for number, name in enumerate(SIGNALS, 1)
    ]  # fmt: skip
    message = _bytes(1, MESSAGE.encode()) + b"".join(_bytes(2, field) for field in fields)
    file = (
        _bytes(1, b"smartmot/ego_signals.proto")
        + _bytes(2, PACKAGE.encode())
        + _bytes(4, message)
        + _bytes(12, b"proto3")
    )
    return _bytes(1, file)


def _bytes(number: int, content: bytes) -> bytes:
    return _varint(number << 3 | _LENGTH_DELIMITED) + _varint(len(content)) + content


def _varint_field(number: int, value: int) -> bytes:
    return _varint(number << 3) + _varint(value)


def _varint(value: int) -> bytes:
    """Seven bits per byte, the lowest first; all but the last are marked."""
    parts = []
    while value > 0x7F:
        parts.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes([*parts, value])
