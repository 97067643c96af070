"""PCD, the point cloud library's files: ascii, binary and binary_compressed, with any fields.

Source: pointclouds.org, "The PCD (Point Cloud Data) file format", version 0.7.
"""

from __future__ import annotations

import io
import re
import struct
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from scenarios.errors import DatasetError
from scenarios.reading import shown
from scenarios.recorded.clouds.fields import NamedCloud, cloud_from_rows, require_rings, rows_from_cloud
from scenarios.recorded.clouds.lzf import MOST_GROWTH, compress, decompress
from smartmot.pointcloud import PointCloud

ENCODINGS = ("binary", "binary_compressed", "ascii")
"""Values of DATA; the first is the default when written."""

_KEYS = (
    "VERSION",
    "FIELDS",
    "COLUMNS",
    "SIZE",
    "TYPE",
    "COUNT",
    "WIDTH",
    "HEIGHT",
    "VIEWPOINT",
    "POINTS",
    "DATA",
)
_KINDS = {"I": "i", "U": "u", "F": "f"}
_SIZES = {"I": (1, 2, 4, 8), "U": (1, 2, 4, 8), "F": (4, 8)}
_NO_TURN = (0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
"""VIEWPOINT of a cloud in its sensor's frame: position, quaternion w x y z."""

_MOST_HEADER_BYTES = 65_536
_MOST_POINTS = 500_000_000
_MOST_COUNT = 100_000


@dataclass(frozen=True, slots=True)
class _Header:
    dtype: np.dtype[Any]
    points: int
    encoding: str
    notes: tuple[str, ...]


def read_pcd(path: Path) -> NamedCloud:
    """Read a PCD file; as many points as POINTS says, whatever the file's length.

    Raises:
        DatasetError: the header is wrong, or there are fewer points.
    """
    try:
        data = path.read_bytes()
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror or error}") from None
    try:
        header, body = _split(data)
        rows, notes = _READERS[header.encoding](header, body)
        named = cloud_from_rows(rows, path.stem)
    except (DatasetError, ValueError, MemoryError) as error:
        raise DatasetError(f"{path}: {error or 'too large for the memory'}") from None
    return replace(named, notes=(*header.notes, *notes, *named.notes))


def _split(data: bytes) -> tuple[_Header, bytes]:
    """The header, and what follows the line DATA."""
    match = re.search(rb"^DATA[ \t]+(\S+)[ \t]*\r?(\n|\Z)", data[:_MOST_HEADER_BYTES], re.MULTILINE)
    if match is None:
        raise DatasetError("no PCD file: there is no line DATA in its header")
    try:
        text = data[: match.end()].decode("ascii")
    except UnicodeDecodeError as error:
        raise DatasetError(f"header: no text at byte {error.start}") from None
    values: dict[str, list[str]] = {}
    for number, line in enumerate(text.splitlines(), 1):
        words = line.split()
        if not words or words[0].startswith("#"):
            continue
        if words[0] not in _KEYS:
            raise DatasetError(f"line {number}: {shown(words[0])} is no entry of a PCD header")
        if words[0] in values:
            raise DatasetError(f"line {number}: {words[0]} is there twice")
        values[words[0]] = words[1:]
    return _header(values), data[match.end() :]


def _header(values: dict[str, list[str]]) -> _Header:
    fields = values.get("FIELDS", values.get("COLUMNS"))
    if not fields:
        raise DatasetError("header: no FIELDS")
    kinds = values.get("TYPE", ["F"] * len(fields))
    sizes = _numbers(values, "SIZE", [4] * len(fields))
    counts = _numbers(values, "COUNT", [1] * len(fields))
    for key, given in (("TYPE", kinds), ("SIZE", sizes), ("COUNT", counts)):
        if len(given) != len(fields):
            raise DatasetError(f"header: {len(given)} values of {key} for {len(fields)} fields")
    columns: list[tuple[Any, ...]] = []
    for number, (name, kind, size, count) in enumerate(zip(fields, kinds, sizes, counts, strict=True)):
        if kind not in _KINDS or size not in _SIZES[kind]:
            raise DatasetError(f"header: field {shown(name)}: TYPE {kind} of SIZE {size} does not exist")
        if not 1 <= count <= _MOST_COUNT:
            raise DatasetError(f"header: field {shown(name)}: COUNT {count}")
        padding = name == "_"
        if not padding and name in fields[:number]:
            raise DatasetError(f"header: field {shown(name)} is there twice")
        unique = f"_{number}" if padding else name
        columns.append((unique, f"<{_KINDS[kind]}{size}", *((count,) if count > 1 else ())))
    points, notes = _point_count(values)
    viewpoint = tuple(_floats(values.get("VIEWPOINT", [])))
    if viewpoint and viewpoint != _NO_TURN:
        notes.append("VIEWPOINT is not applied: points are as stored")
    encoding = values["DATA"][0].lower()
    if encoding not in ENCODINGS:
        raise DatasetError(f"DATA {shown(encoding)} is not read; {', '.join(ENCODINGS)} are")
    return _Header(np.dtype(columns), points, encoding, tuple(notes))


def _point_count(values: dict[str, list[str]]) -> tuple[int, list[str]]:
    """POINTS, or else WIDTH times HEIGHT; a note where both are there and differ."""
    sizes = [
        _numbers(values, key, [1] if key == "HEIGHT" else [])[:1] for key in ("WIDTH", "HEIGHT", "POINTS")
    ]
    for key, size in zip(("WIDTH", "HEIGHT", "POINTS"), sizes, strict=True):
        if size and not 0 <= size[0] <= _MOST_POINTS:
            raise DatasetError(f"header: {key} {size[0]}: expected 0 to {_MOST_POINTS}")
    width, height, points = sizes
    product = width[0] * height[0] if width else None
    if points and product not in (None, points[0]):
        return points[0], [f"WIDTH x HEIGHT is {product}, POINTS {points[0]}: the latter counts"]
    if not points and product is None:
        raise DatasetError("header: neither POINTS nor WIDTH")
    count = points[0] if points else product or 0
    if count > _MOST_POINTS:
        raise DatasetError(f"header: {count} points: expected {_MOST_POINTS} at most")
    return count, []


def _numbers(values: dict[str, list[str]], key: str, default: list[int]) -> list[int]:
    """Whole numbers of an entry."""
    if key not in values:
        return default
    words = values[key]
    if not words or not all(re.fullmatch(r"[0-9]{1,18}", word) for word in words):
        raise DatasetError(f"header: {key}: expected whole numbers, got {shown(' '.join(words))}")
    return [int(word) for word in words]


def _floats(words: list[str]) -> list[float]:
    try:
        return [float(word) for word in words]
    except ValueError:
        raise DatasetError(f"header: VIEWPOINT: expected numbers, got {shown(' '.join(words))}") from None


def _read_binary(header: _Header, body: bytes) -> tuple[NDArray[Any], list[str]]:
    needed = header.points * header.dtype.itemsize
    _require_length(len(body), needed, header)
    return np.frombuffer(body, header.dtype, header.points), _surplus(len(body) - needed)


def _read_compressed(header: _Header, body: bytes) -> tuple[NDArray[Any], list[str]]:
    """Fields stand one after the other, each of all points."""
    if header.points == 0 and not body:
        return np.empty(0, header.dtype), []
    if len(body) < 8:
        raise DatasetError("no sizes after the header")
    packed, size = struct.unpack_from("<II", body)
    if packed > len(body) - 8:
        raise DatasetError(f"{len(body) - 8} compressed bytes, {packed} expected: the file is cut off")
    if size > MOST_GROWTH * packed:
        raise DatasetError(f"{packed} compressed bytes cannot hold {size}")
    _require_length(size, header.points * header.dtype.itemsize, header)
    stored, left = divmod(size, header.dtype.itemsize)
    if left:
        raise DatasetError(f"{size} bytes are no whole number of points of {header.dtype.itemsize} bytes")
    data = decompress(body[8 : 8 + packed], size)
    rows = np.empty(header.points, header.dtype)
    start = 0
    for name in header.dtype.names or ():
        column = header.dtype[name]
        rows[name] = np.frombuffer(data, column, stored, start)[: header.points]
        start += stored * column.itemsize
    return rows, _surplus((stored - header.points) * header.dtype.itemsize)


def _read_ascii(header: _Header, body: bytes) -> tuple[NDArray[Any], list[str]]:
    lines = [line for line in body.decode("ascii", "replace").splitlines() if line.strip()]
    if len(lines) < header.points:
        raise DatasetError(f"{len(lines)} lines of points, POINTS is {header.points}: the file is cut off")
    surplus = len(lines) - header.points
    widths = [int(np.prod(header.dtype[name].shape, dtype=np.int64)) for name in header.dtype.names or ()]
    if header.points == 0:
        return np.empty(0, header.dtype), [f"{surplus} lines after the last point ignored"] if surplus else []
    try:
        text = io.StringIO("\n".join(lines[: header.points]))
        table = np.loadtxt(text, dtype=np.float64, ndmin=2, comments=None)
    except ValueError as error:
        raise DatasetError(f"points: {' '.join(str(error).split())}") from None
    if table.shape[1] != sum(widths):
        raise DatasetError(f"{table.shape[1]} numbers per point, {sum(widths)} expected")
    rows = np.empty(header.points, header.dtype)
    start = 0
    for name, width in zip(header.dtype.names or (), widths, strict=True):
        column = table[:, start] if width == 1 else table[:, start : start + width]
        rows[name] = _cast(column, header.dtype[name].base, name)
        start += width
    return rows, [f"{surplus} lines after the last point ignored"] if surplus else []


def _cast(column: NDArray[Any], dtype: np.dtype[Any], name: str) -> NDArray[Any]:
    """Numbers of a text as the header's kind."""
    if dtype.kind == "f":
        with np.errstate(over="ignore"):  # infinite points are dropped later, and counted
            return column.astype(dtype)
    limits = np.iinfo(dtype)
    if not ((np.trunc(column) == column) & (column >= limits.min) & (column <= limits.max)).all():
        raise DatasetError(f"field {name}: expected whole numbers from {limits.min} to {limits.max}")
    return column.astype(dtype)


_READERS = {"binary": _read_binary, "binary_compressed": _read_compressed, "ascii": _read_ascii}


def _require_length(length: int, needed: int, header: _Header) -> None:
    if length < needed:
        raise DatasetError(
            f"{length} bytes of points, {needed} expected for POINTS {header.points}: the file is cut off"
        )


def _surplus(length: int) -> list[str]:
    return [f"{length} bytes after the last point ignored"] if length else []


def pcd_bytes(cloud: PointCloud, encoding: str = ENCODINGS[0]) -> bytes:
    """A cloud as PCD, with the fields that it has.

    Args:
        cloud: the points.
        encoding: one of `ENCODINGS`.

    Raises:
        DatasetError: the encoding is unknown, or a ring does not fit into 32 bits.
    """
    if encoding not in ENCODINGS:
        raise DatasetError(f"PCD: {shown(encoding)} is unknown; use one of: {', '.join(ENCODINGS)}")
    require_rings(cloud)
    rows = rows_from_cloud(cloud)
    names = rows.dtype.names or ()
    kinds = [rows.dtype[name] for name in names]
    header = (
        "# .PCD v0.7 - Point Cloud Data file format\nVERSION 0.7\n"
        f"FIELDS {' '.join(names)}\nSIZE {' '.join(str(kind.itemsize) for kind in kinds)}\n"
        f"TYPE {' '.join(kind.kind.upper() for kind in kinds)}\nCOUNT {' '.join('1' for _ in names)}\n"
        f"WIDTH {len(cloud)}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {len(cloud)}\nDATA {encoding}\n"
    ).encode()
    if encoding == "ascii":
        return header + _ascii(rows)
    if encoding == "binary":
        return header + rows.astype(rows.dtype.newbyteorder("<")).tobytes()
    data = b"".join(rows[name].astype(rows.dtype[name].newbyteorder("<")).tobytes() for name in names)
    packed = compress(data)
    return header + struct.pack("<II", len(packed), len(data)) + packed


def _ascii(rows: NDArray[Any]) -> bytes:
    """A line per point; the digits bring every number back as it is."""
    digits = {"f4": ".9g", "f8": ".17g"}
    forms = [digits.get(rows.dtype[name].str[1:], "d") for name in rows.dtype.names or ()]
    line = " ".join(f"{{:{form}}}" for form in forms)
    return "".join(f"{line.format(*row)}\n" for row in rows.tolist()).encode()
