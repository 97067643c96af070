"""Bags of ROS 2 written without ROS."""

from __future__ import annotations

import contextlib
import shutil
import sqlite3
from collections.abc import Iterable, Iterator
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any, Protocol, Self

from scenarios.errors import DatasetError
from scenarios.ros.definitions import ros2_types
from scenarios.ros.libraries import require_libraries

if TYPE_CHECKING:
    from rosbags.interfaces import Qos

STORAGES = {"mcap": ".mcap", "sqlite3": ".db3"}
"""Storage plug-ins of rosbag2, and the suffixes of their files."""


class WrittenTopic(Protocol):
    """A topic of a bag."""

    @property
    def name(self) -> str:
        """Its name."""

    @property
    def type_name(self) -> str:
        """Type of its messages."""

    @property
    def depth(self) -> int:
        """Messages kept for a slow subscriber."""


class MessageWriter:
    """Writes a bag, message by message, that is only there once it is complete.

    Topics, types and their hashes, definitions, quality of service and numbers of messages stand in the bag
    and its metadata.yaml. Equal outputs give equal bytes in MCAP.

    How to use it::

        with MessageWriter(path, topics) as bag:
            bag.put(topic, time_ns, message)

    Args:
        path: folder to be made; with a suffix of `STORAGES` a single file, which needs no metadata.yaml.
        topics: all that are written.
        storage: one of `STORAGES`; None: as the suffix says, mcap for a folder.

    Raises:
        DatasetError: the path is there already or cannot be written, the storage is unknown or another than
            the suffix says, or the extra `ros` is not installed.

    Attributes:
        count: messages written so far.
    """

    def __init__(self, path: Path, topics: Iterable[WrittenTopic], storage: str | None = None) -> None:
        require_libraries()
        from rosbags.rosbag2 import StoragePlugin, Writer

        storage = _storage(path, storage)
        if path.exists():
            raise DatasetError(f"{path}: is there already; name another one or remove it")
        self.path, self.count = path, 0
        self._types = ros2_types()
        # rosbags names the file after the folder, which is therefore made inside another
        self._scratch = path.parent / f".{path.name}.unfinished"
        plugin = StoragePlugin.MCAP if storage == "mcap" else StoragePlugin.SQLITE3
        with _telling(path):
            shutil.rmtree(self._scratch, ignore_errors=True)
            self._scratch.mkdir(parents=True)
            self._writer = Writer(self._scratch / path.name, version=9, storage_plugin=plugin)
            self._writer.open()
        self._connections = {
            topic.name: self._writer.add_connection(
                topic.name,
                topic.type_name,
                typestore=self._types,
                offered_qos_profiles=[_quality(topic.depth)],
            )
            for topic in topics
        }

    def put(self, topic: WrittenTopic, time_ns: int, message: Any) -> None:
        """Write a message of rosbags' classes at the time of its receipt."""
        self.put_serialised(topic, time_ns, self._types.serialize_cdr(message, topic.type_name))

    def put_serialised(self, topic: WrittenTopic, time_ns: int, data: bytes | memoryview) -> None:
        """Write a message as CDR at the time of its receipt."""
        with _telling(self.path):
            self._writer.write(self._connections[topic.name], time_ns, data)
        self.count += 1

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the bag; after an error nothing of it stays."""
        try:
            if kind is None:
                with _telling(self.path):
                    self._finish()
            else:
                with contextlib.suppress(Exception):  # the first error is the one to tell
                    self._writer.abort()
        finally:
            shutil.rmtree(self._scratch, ignore_errors=True)

    def _finish(self) -> None:
        if not self.count:  # rosbags would write the greatest of all times
            self._writer.min_timestamp = 0
        self._writer.close()
        folder = self._scratch / self.path.name
        single = self.path.suffix in STORAGES.values()
        (next(folder.glob(f"*{self.path.suffix}")) if single else folder).rename(self.path)


@contextlib.contextmanager
def _telling(path: Path) -> Iterator[None]:
    """Faults of the disk as a `DatasetError` with the bag's path."""
    try:
        yield
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written ({error.strerror or error})") from None
    except sqlite3.Error as error:
        raise DatasetError(f"{path}: cannot be written ({error})") from None


def _storage(path: Path, asked: str | None) -> str:
    """The storage of a bag."""
    by_suffix = next((name for name, suffix in STORAGES.items() if suffix == path.suffix), None)
    storage = asked or by_suffix or next(iter(STORAGES))
    if storage not in STORAGES:
        raise DatasetError(f"storage: unknown {storage!r}; use one of: {', '.join(STORAGES)}")
    if by_suffix not in (None, storage):
        raise DatasetError(f"{path}: a file {path.suffix} is of storage {by_suffix}, not {storage}")
    return storage


def _quality(depth: int) -> Qos:
    """Quality of service as the topics have it: reliable, volatile, the last messages kept."""
    from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime

    # as rosbag2 writes unlimited times
    unlimited = QosTime(9223372036, 854775807)
    return Qos(
        QosHistory.KEEP_LAST,
        depth,
        QosReliability.RELIABLE,
        QosDurability.VOLATILE,
        unlimited,
        unlimited,
        QosLiveliness.AUTOMATIC,
        unlimited,
        False,
    )
