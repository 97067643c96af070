"""Bags of ROS 2 with what perception publishes, written without ROS."""

from __future__ import annotations

from pathlib import Path

from scenarios.live.perception import Output
from scenarios.live.published import published, published_time_ns
from scenarios.live.topics import PUBLISHED
from scenarios.ros.bags.writer import MessageWriter


class BagWriter(MessageWriter):
    """A bag of all topics of perception; see `MessageWriter`.

    How to use it::

        with BagWriter(path) as bag:
            for output in perception.take(message):
                bag.write(output)

    Args:
        path: folder or single file to be made.
        storage: mcap, sqlite3, or None: as the suffix says.

    Raises:
        DatasetError: see `MessageWriter`.
    """

    def __init__(self, path: Path, storage: str | None = None) -> None:
        super().__init__(path, PUBLISHED, storage)

    def write(self, output: Output) -> None:
        """Write what is published of an output, at the time at which its detections were received."""
        time_ns = published_time_ns(output)
        for topic, data in published(output):
            self.put_serialised(topic, time_ns, data)
