"""A bag of any kind: a folder of ROS 2, one of its files, or a bag of ROS 1."""

from __future__ import annotations

import re
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path

from scenarios.errors import DatasetError
from scenarios.reading import ReadError
from scenarios.ros.bags.compression import expand_file
from scenarios.ros.bags.decoding import decoded, require_readable
from scenarios.ros.bags.mcap_file import open_mcap
from scenarios.ros.bags.metadata import METADATA, Metadata, read_metadata
from scenarios.ros.bags.ros1_file import open_ros1
from scenarios.ros.bags.sqlite_file import open_sqlite
from scenarios.ros.bags.topics import BagFile, Choice, RawMessage, Topic
from scenarios.ros.libraries import require_libraries
from scenarios.ros.messages import Message

_OPENERS: dict[str, Callable[[Path], BagFile]] = {
    ".mcap": open_mcap,
    ".db3": open_sqlite,
    ".bag": open_ros1,
}

_COMPRESSED = (".zstd", ".zst")


@dataclass(frozen=True, slots=True)
class Bag:
    """An open bag.

    Args:
        path: folder or file.
        topics: what is in it, by name; a topic with two types is there twice.
        files: its files by their paths, in the order of time.
        counts: messages by topic, as metadata.yaml says; None: there is none.
        notes: what a user should know about how it was read.
    """

    path: Path
    topics: tuple[Topic, ...]
    files: tuple[tuple[Path, BagFile], ...]
    counts: Counter[str] | None
    notes: tuple[str, ...]

    def of_type(self, *type_names: str) -> tuple[Topic, ...]:
        """Topics of some types."""
        return tuple(topic for topic in self.topics if topic.type_name in type_names)

    def count(self, name: str) -> int | None:
        """Messages of a topic, as metadata.yaml or the files' own statistics say; None: neither does."""
        if self.counts is not None:
            return self.counts[name]
        counts = [file.counts for _, file in self.files]
        return None if None in counts else sum(count[name] for count in counts if count is not None)

    def raw(self, choice: Choice = None) -> Iterator[RawMessage]:
        """Messages of some topics as they are stored, in the order of the files.

        Args:
            choice: names of topics; None: all.

        Raises:
            DatasetError: a file is damaged, or there are more or fewer messages than the bag says, which is
                known after the last one.
        """
        counted: Counter[str] = Counter()
        for path, file in self.files:
            with _naming(path):
                for message in file.read(choice):
                    counted[message.topic.name] += 1
                    yield message
        for name, count in sorted((self.counts or {}).items()):
            if (choice is None or name in choice) and counted[name] != count:
                raise DatasetError(
                    f"{self.path}: topic {name}: {counted[name]} messages, {count} in {METADATA}: "
                    "the bag is damaged, or a file of it is missing"
                )

    def require_one_type(self, *names: str) -> None:
        """Demand that topics are there, with one type each.

        Raises:
            DatasetError: a topic is missing, or has two types.
        """
        for name in names:
            types = sorted({topic.type_name for topic in self.topics if topic.name == name})
            if len(types) != 1:
                listed = f"the types {' and '.join(types)}" if types else "no messages"
                raise DatasetError(f"{self.path}: topic {name} has {listed}")

    def messages(self, *names: str) -> list[tuple[Topic, Message]]:
        """Messages of some topics as values, in the order in which they were received.

        Raises:
            DatasetError: see `raw`; or a topic is missing, has two types, or holds what cannot be read.
        """
        self.require_one_type(*names)
        with _naming(self.path):
            for topic in self.topics:
                if topic.name in names:
                    require_readable(topic)
            read = [(message.topic, decoded(message)) for message in self.raw(names)]
        read.sort(key=lambda pair: pair[1].received_ns)  # stable: of equal times, the order of the files
        return read


@contextmanager
def open_bag(path: Path) -> Iterator[Bag]:
    """Open a bag: its folder, its metadata.yaml, or a single file (.mcap, .db3, .bag, also with .zstd).

    Raises:
        DatasetError: it cannot be read; the message names the file, and the topic where there is one.
    """
    require_libraries()
    path = path.parent if path.name == METADATA else path
    with tempfile.TemporaryDirectory(prefix="smartmot-bag-") as scratch:
        metadata = _metadata(path)
        files: list[tuple[Path, BagFile]] = []
        notes: list[str] = []
        for number, file in enumerate(_files(path, metadata)):
            with _naming(file):
                opened = _opened(file, Path(scratch), number)
            files.append((file, opened))
            notes += opened.notes
        hashes = {} if metadata is None else metadata.type_hashes
        topics = {
            replace(topic, type_hash=topic.type_hash or hashes.get(topic.name, ""))
            for _, file in files
            for topic in file.topics
        }
        counts = None if metadata is None else metadata.counts
        ordered = sorted(topics, key=lambda topic: (topic.name, topic.type_name, topic.encoding))
        yield Bag(path, tuple(ordered), tuple(files), counts, tuple(notes))


def is_bag(path: Path) -> bool:
    """Whether a path looks like a bag."""
    try:
        if path.is_dir():
            return (path / METADATA).is_file() or bool(_stored(path))
    except OSError:
        return False
    return path.name == METADATA or _form(path) in _OPENERS


@contextmanager
def _naming(path: Path) -> Iterator[None]:
    """Faults of a file as a `DatasetError` with its path."""
    try:
        yield
    except ReadError as error:
        raise DatasetError(f"{path}: {error}") from None
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror or error}") from None


def _form(path: Path) -> str:
    """Suffix of a file without that of its compression."""
    return Path(path.stem).suffix if path.suffix in _COMPRESSED else path.suffix


def _stored(folder: Path) -> list[Path]:
    """Files of bags in a folder, _9 before _10."""
    files = [file for file in folder.iterdir() if _form(file) in _OPENERS and file.is_file()]
    return sorted(
        files, key=lambda file: [int(t) if t.isdecimal() else t for t in re.split(r"(\d+)", file.name)]
    )


def _metadata(path: Path) -> Metadata | None:
    """What metadata.yaml of a folder says; None: there is none, or the bag is a single file."""
    file = path / METADATA
    if not path.is_dir() or not file.is_file():
        return None
    with _naming(file):
        return read_metadata(file)


def _files(path: Path, metadata: Metadata | None) -> list[Path]:
    """Files of a bag in their order."""
    if not path.is_dir():
        if not path.is_file():
            raise DatasetError(f"{path}: no such folder or file")
        if _form(path) not in _OPENERS:
            raise DatasetError(f"{path}: no bag; they end in {', '.join(_OPENERS)}")
        return [path]
    if metadata is not None:
        return [_named(path, name) for name in metadata.files]
    with _naming(path):
        files = _stored(path)
    if not files:
        raise DatasetError(f"{path}: no {METADATA} and no file that ends in {', '.join(_OPENERS)}")
    forms = {_form(file) for file in files}
    if len(forms) > 1:
        raise DatasetError(
            f"{path}: bags of several kinds ({', '.join(sorted(forms))}); name one of its files"
        )
    return files


def _named(folder: Path, name: str) -> Path:
    """A file that metadata.yaml names; before version 4 its path began with the folder's name."""
    for candidate in (folder / name, folder / Path(name).name):
        if candidate.is_file():
            if _form(candidate) not in _OPENERS:
                raise DatasetError(f"{candidate}: storage is not read: only {', '.join(_OPENERS)} are")
            return candidate
    raise DatasetError(f"{folder / name}: no such file, but {METADATA} names it")


def _opened(file: Path, scratch: Path, number: int) -> BagFile:
    opener = _OPENERS[_form(file)]
    if file.suffix not in _COMPRESSED:
        return opener(file)
    expanded = scratch / str(number) / file.stem
    expanded.parent.mkdir()
    expand_file(file, expanded)
    return opener(expanded)
