"""Compressed parts of bags, expanded with bounded memory."""

from __future__ import annotations

import bz2
import io
from collections.abc import Callable
from pathlib import Path

from scenarios.reading import ReadError

MAX_PART_BYTES = 256 * 2**20
"""Largest chunk or message. Recorders cut chunks at 1 MB; a longer message is a chunk of its own."""

_LEAST_FILE_BYTES = 256 * 2**20
_MAX_FILE_RATIO = 100
"""A file may grow to the first, or by the second: recordings compress 2 to 20 times, a bomb thousands."""

_PIECE_BYTES = 2**20

ZSTD_MAGIC = b"\x28\xb5\x2f\xfd"
"""First bytes of every Zstandard frame (RFC 8878, 3.1.1)."""


def expand(data: bytes, form: str, size: int | None = None) -> bytes:
    """Decompressed data.

    Args:
        data: compressed bytes.
        form: zstd, lz4, bz2, or "" for none.
        size: what the bag says of their length; None: nothing.

    Raises:
        ReadError: they are damaged, longer than MAX_PART_BYTES or not as long as said, or of unknown form.
    """
    if form not in _EXPANDERS:
        raise ReadError(f"compression {form!r} is not read: only zstd, lz4 and none are")
    limit = MAX_PART_BYTES if size is None else size
    if limit > MAX_PART_BYTES:
        raise ReadError(f"a part of {size} bytes: more than {MAX_PART_BYTES} are not read")
    try:
        expanded = _EXPANDERS[form](data, limit)
    except ReadError:
        raise
    except Exception as error:  # each library has its own, some plain RuntimeErrors
        raise ReadError(f"{form}: damaged data ({error})") from None
    if len(expanded) > limit or (size is not None and len(expanded) != size):
        raise ReadError(f"{form or 'uncompressed'}: not the {limit} bytes that it should be")
    return expanded


def expand_file(source: Path, target: Path) -> None:
    """Decompress a file of Zstandard.

    Raises:
        ReadError: it is damaged, or grows beyond all measure.
        OSError: a file cannot be read or written.
    """
    import zstandard

    limit = max(_LEAST_FILE_BYTES, _MAX_FILE_RATIO * source.stat().st_size)
    written = 0
    with source.open("rb") as compressed, target.open("wb") as expanded:
        try:
            for piece in zstandard.ZstdDecompressor().read_to_iter(compressed, write_size=_PIECE_BYTES):
                written += len(piece)
                if written > limit:
                    raise ReadError(
                        f"zstd: grows beyond {limit} bytes; if it is what it should be, expand it"
                    )
                expanded.write(piece)
        except zstandard.ZstdError as error:
            raise ReadError(f"zstd: damaged data ({error})") from None


def _zstd(data: bytes, limit: int) -> bytes:
    import zstandard

    size = zstandard.frame_content_size(data)
    if size > limit:
        raise ReadError(f"zstd: {size} bytes: more than the {limit} that it should be")
    if size >= 0:
        expanded: bytes = zstandard.ZstdDecompressor().decompress(data, max_output_size=size)
        return expanded
    pieces, total = [], 0
    with zstandard.ZstdDecompressor().stream_reader(io.BytesIO(data)) as stream:
        while total <= limit and (piece := stream.read(_PIECE_BYTES)):
            pieces.append(piece)
            total += len(piece)
    return b"".join(pieces)


def _lz4(data: bytes, limit: int) -> bytes:
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]

    decompressor = LZ4FrameDecompressor()
    expanded: bytes = decompressor.decompress(data, max_length=limit + 1)
    if not decompressor.eof and len(expanded) <= limit:
        raise ReadError("lz4: data end too early")
    return expanded


def _bz2(data: bytes, limit: int) -> bytes:
    decompressor = bz2.BZ2Decompressor()
    expanded = decompressor.decompress(data, max_length=limit + 1)
    if not decompressor.eof and len(expanded) <= limit:
        raise ReadError("bz2: data end too early")
    return expanded


_EXPANDERS: dict[str, Callable[[bytes, int], bytes]] = {
    "": lambda data, limit: data,
    "none": lambda data, limit: data,
    "zstd": _zstd,
    "lz4": _lz4,
    "bz2": _bz2,
}
