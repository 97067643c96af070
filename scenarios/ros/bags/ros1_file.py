"""One bag of ROS 1, by rosbags; its chunks are expanded with bounded memory."""

from __future__ import annotations

import bz2
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from scenarios.reading import ReadError
from scenarios.ros.bags.compression import expand
from scenarios.ros.bags.topics import BagFile, Choice, RawMessage, Topic


def open_ros1(path: Path) -> BagFile:
    """A bag of ROS 1.

    Raises:
        ReadError: it is damaged, or was never indexed.
    """
    with _reader(path) as reader:
        topics = {c.id: _topic(c) for c in reader.connections}
        counts = Counter({name: info.msgcount for name, info in reader.topics.items()})

    def read(choice: Choice) -> Iterator[RawMessage]:
        with _reader(path) as reader:
            chosen = [c for c in reader.connections if choice is None or c.topic in choice]
            # without connections rosbags would read all
            for connection, received_ns, data in reader.messages(chosen) if chosen else ():
                yield RawMessage(topics[connection.id], received_ns, data)

    return BagFile(tuple(dict.fromkeys(topics.values())), read, counts)


def _topic(connection: Any) -> Topic:
    return Topic(connection.topic, connection.msgtype, "ros1", connection.msgdef.data)


@contextmanager
def _reader(path: Path) -> Iterator[Any]:
    """Rosbags' reader with every fault as a `ReadError`."""
    from rosbags.rosbag1 import Reader
    from rosbags.rosbag1.reader import Chunk

    class BoundedReader(Reader):
        def read_chunk(self) -> Chunk:
            chunk = super().read_chunk()
            form = {"decompress": "bz2" if chunk.decompressor is bz2.decompress else "lz4"}
            name = form.get(getattr(chunk.decompressor, "__name__", ""), "")
            return Chunk(chunk.datasize, chunk.datapos, lambda data: expand(data, name))

    try:
        with BoundedReader(path) as reader:
            yield reader
    except (ReadError, OSError):
        raise
    except Exception as error:  # of damaged files: assertions, struct, keys, texts, rosbags' own
        text = " ".join(str(error).split()) or type(error).__name__
        raise ReadError(f"no readable bag of ROS 1 ({text}); an unindexed one: rosbag reindex") from None
