"""One MCAP file: topics from its summary, messages chunk by chunk, all counts checked.

The format is read here and not by the `mcap` library: a bag is read by topic, with bounded memory (a chunk
may claim any length), up to the byte where its recording was cut off, and with each fault in one line.
Source: https://mcap.dev/spec, version 0.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

from scenarios.reading import ReadError, shown
from scenarios.ros.bags.compression import MAX_PART_BYTES, expand
from scenarios.ros.bags.topics import BagFile, Choice, RawMessage, Topic, normalised_type

MAGIC = b"\x89MCAP0\r\n"

_FOOTER, _SCHEMA, _CHANNEL, _MESSAGE, _CHUNK = 0x02, 0x03, 0x04, 0x05, 0x06
_CHUNK_INDEX, _STATISTICS, _DATA_END = 0x08, 0x0B, 0x0F

_TAKEN = (_SCHEMA, _CHANNEL, _MESSAGE)

_HEAD = struct.Struct("<BQ")
_MESSAGE_HEAD = struct.Struct("<HIQQ")
_PAIR = struct.Struct("<HQ")
_FOOTER_CONTENT = 8 + 8 + 4
_FOOTER_BYTES = _HEAD.size + _FOOTER_CONTENT + len(MAGIC)

_DEFINITION_FORMS = {"ros2msg": "msg", "ros1msg": "msg", "ros2idl": "idl"}

Record = tuple[int, bytes]
"""Kind and content."""


@dataclass(slots=True)
class _Contents:
    """What the records read so far say of the file.

    Args:
        schemas: name, encoding and text by number.
        channels: topics by number.
        counts: messages by channel, out of the statistics; None: they do not say.
        total: messages in all; None: there are no statistics.
        chunk_channels: channels of each chunk by its place; none where the chunk has no index.
    """

    schemas: dict[int, tuple[str, str, str]] = field(default_factory=dict)
    channels: dict[int, Topic] = field(default_factory=dict)
    counts: dict[int, int] | None = None
    total: int | None = None
    chunk_channels: dict[int, frozenset[int]] = field(default_factory=dict)

    def add(self, kind: int, content: bytes) -> None:
        """Take a record of the summary or of the data.

        Raises:
            ReadError: it is damaged, or contradicts one before it.
        """
        fields = _Fields(content)
        if kind == _SCHEMA:
            self._add_schema(fields)
        elif kind == _CHANNEL:
            self._add_channel(fields)
        elif kind == _STATISTICS:
            self.total = fields.unsigned("Q")
            fields.take(2 + 4 + 4 + 4 + 4 + 8 + 8)
            counts = dict(fields.numbers())
            self.counts = counts if counts or not self.total else None
        elif kind == _CHUNK_INDEX:
            fields.take(8 + 8)
            start = fields.unsigned("Q")
            fields.take(8)
            self.chunk_channels[start] = frozenset(number for number, _ in fields.numbers())

    def _add_schema(self, fields: _Fields) -> None:
        number, name, encoding, data = fields.unsigned("H"), fields.text(), fields.text(), fields.block()
        text = _text(data) if encoding in _DEFINITION_FORMS else ""
        self.schemas[number] = (name, encoding, text)

    def _add_channel(self, fields: _Fields) -> None:
        number, schema = fields.unsigned("H"), fields.unsigned("H")
        name, encoding, metadata = fields.text(), fields.text(), fields.pairs()
        if schema and schema not in self.schemas:
            raise _NoSchemaError(f"topic {shown(name)}: its schema {schema} is missing")
        type_name, form, definition = self.schemas.get(schema, ("", "", ""))
        topic = Topic(
            name,
            normalised_type(type_name),
            encoding,
            definition,
            _DEFINITION_FORMS.get(form, "msg"),
            metadata.get("topic_type_hash", ""),
        )
        if self.channels.setdefault(number, topic) != topic:
            raise ReadError(f"channel {number} stands for two topics")

    @property
    def complete(self) -> bool:
        """Whether a summary names every channel that it counts messages of."""
        return self.counts is not None and set(self.counts) <= set(self.channels)

    def topic_counts(self) -> Counter[str] | None:
        """Messages by topic; None: the file does not say."""
        if self.counts is None:
            return None
        counted = Counter({topic.name: 0 for topic in self.channels.values()})
        for number, count in self.counts.items():
            if number not in self.channels:
                raise ReadError(f"{count} messages of channel {number} are counted, which is missing")
            counted[self.channels[number].name] += count
        return counted


class _NoSchemaError(ReadError):
    """A channel's schema is missing: in the data that is damage, in a summary it is allowed."""


class _Fields:
    """Fields of a record, one after the other; one beyond the end, or no text, is a `ReadError`."""

    def __init__(self, content: bytes) -> None:
        self._content, self._at = content, 0

    def take(self, count: int) -> bytes:
        start, self._at = self._at, self._at + count
        if self._at > len(self._content):
            raise ReadError("damaged: a record is shorter than its fields")
        return self._content[start : self._at]

    def unsigned(self, letter: str) -> int:
        form = f"<{letter}"
        return int(struct.unpack(form, self.take(struct.calcsize(form)))[0])

    def block(self) -> bytes:
        return self.take(self.unsigned("I"))

    def text(self) -> str:
        return _text(self.block())

    def pairs(self) -> dict[str, str]:
        """A map of texts."""
        inner, pairs = _Fields(self.block()), {}
        while inner._at < len(inner._content):
            key = inner.text()
            pairs[key] = inner.text()
        return pairs

    def numbers(self) -> list[tuple[int, int]]:
        """A map of channels to 64 bits."""
        block = self.block()
        if len(block) % _PAIR.size:
            raise ReadError("damaged: a record is shorter than its fields")
        return [(channel, value) for channel, value in _PAIR.iter_unpack(block)]


def _text(data: bytes) -> str:
    try:
        return data.decode()
    except UnicodeDecodeError:
        raise ReadError(f"damaged: a name is no UTF-8: {shown(data)}") from None


def open_mcap(path: Path) -> BagFile:
    """An MCAP file.

    Raises:
        ReadError: it is damaged.
        OSError: it cannot be read.
    """
    with path.open("rb") as stream:
        data_end, complete = _data_end(stream)
        contents = _summary(stream) if complete else _Contents()
    notes: tuple[str, ...] = ()
    if not contents.complete:
        scanned = _Contents(counts=contents.counts, total=contents.total)
        scanned.chunk_channels = contents.chunk_channels
        count = sum(1 for _ in _messages(path, data_end, complete, scanned, None))
        if scanned.total not in (None, count):
            raise ReadError(f"{count} messages, {scanned.total} in its statistics: the file is damaged")
        if not complete:
            notes = (f"{path.name}: cut off; its {count} whole messages are read",)
        contents = scanned

    def read(choice: Choice) -> Iterator[RawMessage]:
        return _messages(path, data_end, complete, contents, choice)

    topics = tuple(dict.fromkeys(contents.channels.values()))
    return BagFile(topics, read, contents.topic_counts(), notes)


def _data_end(stream: BinaryIO) -> tuple[int, bool]:
    """Where the footer begins, and whether there is one; raises `ReadError` if the start is no MCAP."""
    size = stream.seek(0, 2)
    stream.seek(0)
    if stream.read(len(MAGIC)) != MAGIC:
        raise ReadError("no MCAP file of version 0")
    footer = size - _FOOTER_BYTES
    if footer < len(MAGIC):
        return size, False
    stream.seek(footer)
    tail = stream.read(_FOOTER_BYTES)
    complete = tail.endswith(MAGIC) and tail.startswith(_HEAD.pack(_FOOTER, _FOOTER_CONTENT))
    return (footer, True) if complete else (size, False)


def _summary(stream: BinaryIO) -> _Contents:
    """What the summary says, whose place is in the footer; nothing if there is none."""
    contents = _Contents()
    footer = stream.seek(-_FOOTER_BYTES, 2)
    stream.seek(_HEAD.size, 1)
    start = int(struct.unpack("<Q", stream.read(8))[0])
    if not start:
        return contents
    stream.seek(start)
    while stream.tell() < footer:
        kind, length = _head(stream, footer)
        with suppress(_NoSchemaError):
            contents.add(kind, stream.read(length))
    return contents


def _head(stream: BinaryIO, end: int) -> tuple[int, int]:
    """Kind and length of the next record; raises `ReadError` where it goes beyond a byte."""
    available = end - stream.tell() - _HEAD.size
    kind, length = _HEAD.unpack(stream.read(_HEAD.size)) if available >= 0 else (0, 0)
    if not kind or length > available:
        raise _BeyondError("damaged: a record goes beyond its place")
    return kind, length


class _BeyondError(ReadError):
    """A record goes beyond its place; in a file that was cut off, that is its end."""


def _messages(
    path: Path, end: int, complete: bool, contents: _Contents, choice: Choice
) -> Iterator[RawMessage]:
    """Messages of some topics in the order of the file; raises `ReadError` unless all of them are there.

    Args:
        path: the file.
        end: up to which byte it is read.
        complete: whether it was closed; otherwise the first record that goes beyond the end is the end.
        contents: what is known of it, to which schemas and channels are added.
        choice: names of topics; None: all.
    """
    counted: Counter[str] = Counter()
    with path.open("rb") as stream:
        stream.seek(len(MAGIC))
        try:
            for kind, content in _data_records(stream, end, contents, choice):
                if kind != _MESSAGE:
                    contents.add(kind, content)
                    continue
                message = _message(content, contents)
                counted[message.topic.name] += 1
                if choice is None or message.topic.name in choice:
                    yield message
        except _BeyondError:
            if complete:
                raise
    if complete:
        _require_counts(counted, contents.topic_counts(), choice)


def _require_counts(counted: Counter[str], known: Counter[str] | None, choice: Choice) -> None:
    for name, count in sorted((known or {}).items()):
        if (choice is None or name in choice) and counted[name] != count:
            raise ReadError(
                f"topic {name}: {counted[name]} messages, {count} in the file's statistics: it is damaged"
            )


def _data_records(stream: BinaryIO, end: int, contents: _Contents, choice: Choice) -> Iterator[Record]:
    """Schemas, channels and messages, those of chunks too, but not of chunks without a topic chosen."""
    while (start := stream.tell()) < end:
        kind, length = _head(stream, end)
        if kind == _DATA_END:
            return
        if kind == _CHUNK and not _skipped(contents, start, choice):
            yield from _chunk_records(_content(stream, length))
        elif kind in _TAKEN:
            yield kind, _content(stream, length)
        else:
            stream.seek(length, 1)


def _skipped(contents: _Contents, start: int, choice: Choice) -> bool:
    """Whether the index says that a chunk has no message of the topics chosen."""
    numbers = contents.chunk_channels.get(start)
    if choice is None or not numbers or not numbers <= set(contents.channels):
        return False
    return not any(contents.channels[number].name in choice for number in numbers)


def _content(stream: BinaryIO, length: int) -> bytes:
    if length > MAX_PART_BYTES:
        raise ReadError(f"a record of {length} bytes: more than {MAX_PART_BYTES} are not read")
    return stream.read(length)


def _chunk_records(chunk: bytes) -> Iterator[Record]:
    fields = _Fields(chunk)
    fields.take(8 + 8)
    size, checksum = fields.unsigned("Q"), fields.unsigned("I")
    compression, length = fields.text(), fields.unsigned("Q")
    data = expand(fields.take(length), compression, size)
    if checksum and zlib.crc32(data) != checksum:
        raise ReadError("damaged: the checksum of a chunk is wrong")
    at = 0
    while at < len(data):
        kind, length = _HEAD.unpack_from(data, at) if len(data) - at >= _HEAD.size else (0, 0)
        at += _HEAD.size
        if not kind or length > len(data) - at:
            raise ReadError("damaged: a record goes beyond its chunk")
        if kind in _TAKEN:
            yield kind, data[at : at + length]
        at += length


def _message(content: bytes, contents: _Contents) -> RawMessage:
    if len(content) < _MESSAGE_HEAD.size:
        raise ReadError("damaged: a message is shorter than its head")
    channel, _, received_ns, _ = _MESSAGE_HEAD.unpack_from(content)
    if channel not in contents.channels:
        raise ReadError(f"damaged: a message of channel {channel}, which is missing")
    return RawMessage(contents.channels[channel], received_ns, content[_MESSAGE_HEAD.size :])
