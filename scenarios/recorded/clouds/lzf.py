"""LZF, the compression of PCD's binary_compressed (Lehmann, liblzf; format in its lzf_d.c).

A control byte below 32 begins a literal of one byte more than it says. Any other is a back reference: three
bits of length (7: another byte adds to it) less 2, and 13 bits of distance less 1.
"""

from __future__ import annotations

import numpy as np

_MOST_LITERAL = 32
_MOST_MATCH = 264
_FARTHEST = 1 << 13
MOST_GROWTH = 88
"""Three bytes stand for 264 at most."""


def decompress(data: bytes, size: int) -> bytes:
    """Expand a block.

    Args:
        data: the compressed bytes.
        size: length of the expanded ones.

    Raises:
        ValueError: they have another length, or a reference leads before the beginning.
    """
    out = bytearray()
    at, end = 0, len(data)
    while at < end and len(out) <= size:
        control = data[at]
        at += 1
        if control < _MOST_LITERAL:
            out += data[at : at + control + 1]
            at += control + 1
            continue
        length = control >> 5
        if length == 7 and at < end:
            length += data[at]
            at += 1
        if at >= end:
            break
        start = len(out) - ((control & 0x1F) << 8 | data[at]) - 1
        at += 1
        length += 2
        if start < 0:
            raise ValueError("a reference leads before the beginning")
        distance = len(out) - start
        if distance >= length:
            out += out[start : start + length]
        else:  # overlaps what it makes
            out += (bytes(out[start:]) * (length // distance + 1))[:length]
    if len(out) != size or at > end:
        raise ValueError(f"{len(out)} bytes expanded, {size} expected")
    return bytes(out)


def compress(data: bytes) -> bytes:
    """Compress a block, greedily: each reference goes to the last place with the same three bytes."""
    out = bytearray()
    at = literal = 0
    previous = _previous(data)
    candidates = np.flatnonzero(previous >= 0).tolist()
    for place in candidates:
        if place < at:
            continue
        source = int(previous[place])
        length = _common_length(data, source, place)
        _put_literal(out, data[literal:place])
        code, distance = length - 2, place - source - 1
        if code < 7:
            out += bytes((code << 5 | distance >> 8, distance & 0xFF))
        else:
            out += bytes((7 << 5 | distance >> 8, code - 7, distance & 0xFF))
        at = literal = place + length
    _put_literal(out, data[literal:])
    return bytes(out)


def _previous(data: bytes) -> np.ndarray[tuple[int], np.dtype[np.int64]]:
    """Where the three bytes at each place stood last, within reach; -1: nowhere."""
    count = len(data) - 2
    if count < 1:
        return np.full(0, -1)
    values = np.frombuffer(data, dtype=np.uint8).astype(np.int64)
    key = values[:-2] << 16 | values[1:-1] << 8 | values[2:]
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    near = order[1:] - order[:-1] <= _FARTHEST
    previous = np.full(count, -1)
    previous[order[1:]] = np.where(same & near, order[:-1], -1)
    return previous


def _common_length(data: bytes, source: int, place: int) -> int:
    """How many bytes from two places on are equal, up to the longest reference."""
    most = min(_MOST_MATCH, len(data) - place)
    if data[source : source + most] == data[place : place + most]:
        return most
    length = 3
    while data[source + length] == data[place + length]:
        length += 1
    return length


def _put_literal(out: bytearray, data: bytes) -> None:
    for start in range(0, len(data), _MOST_LITERAL):
        piece = data[start : start + _MOST_LITERAL]
        out.append(len(piece) - 1)
        out += piece
