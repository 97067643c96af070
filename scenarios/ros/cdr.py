"""Messages as CDR, written value by value: for many markers faster than by objects of a library."""

from __future__ import annotations

from struct import Struct

HEAD = b"\x00\x01\x00\x00"
"""Representation identifier of plain CDR, little-endian, and options (OMG DDS-RTPS 2.5, 10.2.1.2)."""

_LENGTH = Struct("<I")


class CdrWriter:
    """Bytes of one message in plain CDR (XCDR1), little-endian.

    Values are aligned to their size, counted from the end of the head (OMG DDS-XTypes 1.3, 7.4.1). Padding
    is 0.

    Attributes:
        data: what is written so far.
    """

    def __init__(self) -> None:
        self.data = bytearray(HEAD)

    def align(self, size: int) -> None:
        """Pad up to the next multiple of a size."""
        self.data += bytes((len(HEAD) - len(self.data)) % size)

    def values(self, form: Struct, size: int, *values: float) -> None:
        """Values without padding between them, the first aligned to its size."""
        self.align(size)
        self.data += form.pack(*values)

    def count(self, number: int) -> None:
        """Length of a sequence."""
        self.values(_LENGTH, 4, number)

    def text(self, text: str) -> None:
        """A string, with the zero at its end."""
        content = text.encode()
        self.count(len(content) + 1)
        self.data += content + b"\x00"

    def copied(self, content: bytes) -> None:
        """Bytes that were written elsewhere, aligned to 4; they hold nothing that is aligned to 8."""
        self.align(4)
        self.data += content
