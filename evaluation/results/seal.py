"""A checksum over a whole Parquet file, inside it.

Parquet's own checksums cover the data of pages, not their headers and not the footer. This one is SHA-256 of
the file with zeros in the checksum's place, which is found by its mark in the file's metadata.
"""

from __future__ import annotations

import hashlib
import re

from scenarios.reading import ReadError

KEY = "smartmot.checksum"
"""Key in the metadata of the file."""

_PREFIX = b"sha256:"
_EMPTY = _PREFIX + b"0" * 64
_SEALED = re.compile(re.escape(_PREFIX) + rb"([0-9a-f]{64})")

PLACEHOLDER = _EMPTY.decode()
"""Value in the metadata of a file that is yet to be sealed."""


def seal(content: bytes) -> bytes:
    """A file with its checksum.

    Raises:
        ValueError: its metadata has no placeholder.
    """
    if content.count(_EMPTY) != 1:
        raise ValueError("no single place for the checksum")
    return content.replace(_EMPTY, _PREFIX + hashlib.sha256(content).hexdigest().encode())


def check_seal(content: bytes) -> None:
    """Compare a file with its checksum; one of version 0.1.0 has none.

    Raises:
        ReadError: the file is damaged.
    """
    marks = content.count(KEY.encode()), content.count(_PREFIX)
    if marks == (0, 0):
        return
    checksums = list(_SEALED.finditer(content))
    # a mark alone, or another number of them, is what damage leaves
    if min(marks) == 0 or len(checksums) != 1:
        raise ReadError("damaged: its checksum is not whole")
    (match,) = checksums
    zeros = content[: match.start()] + _EMPTY + content[match.end() :]
    if hashlib.sha256(zeros).hexdigest().encode() != match.group(1):
        raise ReadError("damaged: its checksum is another")
