"""Finished runs on disk: a line each, written as soon as it is there, so that a killed comparison goes on."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import re
import sys
from collections.abc import Callable, Container, Iterable, Iterator, Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Generic, TypeAlias, TypeVar

from evaluation.results.files import ResultsError
from evaluation.runs.decoding import decode
from evaluation.runs.execution import FrameTime
from evaluation.runs.folder_lock import release, take
from evaluation.runs.workers import Workers, execute_as_finished
from scenarios.reading import ReadError, parse_json, shown

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Measures = TypeVar("Measures", bound=DataclassInstance)
    Kept = TypeVar("Kept", bound=DataclassInstance)
else:
    Measures, Kept = TypeVar("Measures"), TypeVar("Kept")

Item = TypeVar("Item")

RUNS = "runs.jsonl"
_KEY = re.compile(rb'{"key": "([0-9a-f]+)"')
_SEAL = re.compile(r', "check": "([0-9a-f]{16})"}\s*$')
TIMES = "times.jsonl"
"""Processor times have a file of their own: they are different in every run."""


_OPEN: set[Path] = set()
"""Journals that this process has open."""


class Journal(Generic[Measures]):
    """The journal of a folder; a context manager, which keeps other processes out of the folder.

    Args:
        folder: of the journal; made if needed.
        kind: dataclass of what is kept of a run; of numbers, texts and None.
        prefix: of the files' names, for several journals in one folder.

    Raises:
        ResultsError: another process writes into the folder, the files cannot be opened, or a line is not
            one of a journal.
    """

    def __init__(self, folder: Path, kind: type[Measures], prefix: str = "") -> None:
        self._kind = kind
        runs, times = (folder / f"{prefix}{name}" for name in (RUNS, TIMES))
        self._path, self._folder = runs, folder
        take(folder)
        # what is torn off may be a line that another journal of this process is just writing
        self._alone = runs.resolve() not in _OPEN
        try:
            self._lines, self._times = _read(runs, self._alone), _read(times, self._alone)
            self._files = _opened(runs), _opened(times)
            if self._alone:
                _OPEN.add(runs.resolve())
        except OSError as error:
            release(folder)
            raise ResultsError(
                f"{folder}: cannot be written ({error.strerror}); choose another folder"
            ) from None
        except BaseException:
            release(folder)
            raise

    def __enter__(self) -> Journal[Measures]:
        """The journal itself."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Close the files."""
        for file in self._files:
            with contextlib.suppress(OSError):  # of a line that could not be written; that was told
                file.close()
        if self._alone:
            _OPEN.discard(self._path.resolve())
        release(self._folder)

    def finished(self, keys: Container[str]) -> dict[str, tuple[Measures, FrameTime]]:
        """Runs with these keys that are finished.

        Raises:
            ResultsError: a line has other fields than this version writes, or values of another kind.
        """
        by_key: dict[str, tuple[Measures, FrameTime]] = {}
        try:
            for key, line in self._lines.items():
                if key in keys:
                    spent = FrameTime(0, 0.0, 0.0)
                    if key in self._times:
                        spent = _checked(FrameTime, self._times[key], f"times of run {shown(key)}")
                    by_key[key] = _checked(self._kind, line, f"run {shown(key)}"), spent
        except ReadError as error:
            raise ResultsError(f"{self._path}: not a journal of this version ({error}); remove it") from None
        return by_key

    def add(self, key: str, measures: Measures, spent: FrameTime) -> None:
        """Write a finished run down; when this returns it is on disk.

        Raises:
            ResultsError: it cannot be written, as on a full disk.
        """
        # the run last: without its line it counts as not done
        lines = (dataclasses.asdict(spent), dataclasses.asdict(measures))
        try:
            for file, values in zip(self._files[::-1], lines, strict=True):
                file.write(_sealed(json.dumps({"key": key, **values})) + "\n")
                file.flush()
            os.fsync(self._files[0].fileno())
        except OSError as error:
            raise ResultsError(
                f"{self._path}: cannot be written ({error.strerror}); the runs before are kept: make room, "
                "and start again"
            ) from None

    def carry_out(
        self,
        job: Callable[[Item], Any],
        items: Mapping[str, Item],
        workers: Workers,
        done: Callable[[int], None] = lambda count: None,
        is_whole: Callable[[Item], bool] = lambda item: True,
        kept: Callable[[Item, Any], tuple[Measures, FrameTime]] = lambda item, result: result,
    ) -> tuple[dict[str, tuple[Measures, FrameTime]], int]:
        """Carry out what is not finished, and write each item down as it is finished.

        At the end the lines of these items stand in their order, whatever order they were finished in.

        Args:
            job: see `evaluation.runs.workers.execute_as_finished`.
            items: by key.
            workers: see there.
            done: called with the number of items that are new on disk, first of those from before.
            is_whole: whether what a finished item has written beside the journal is there; if not, it is
                carried out again.
            kept: what is written down of a result; it may write files beside the journal.

        Returns:
            What is kept of each item, by key, and how many were finished before.

        Raises:
            ResultsError: a line has other fields than this version writes.
        """
        by_key = {key: kept for key, kept in self.finished(items).items() if is_whole(items[key])}
        before = len(by_key)
        done(before)
        missing = [key for key in items if key not in by_key]
        fresh = execute_as_finished(job, [items[key] for key in missing], workers)
        for number, result in fresh:
            key = missing[number]
            measures, spent = kept(items[key], result)
            self.add(key, measures, spent)
            by_key[key] = _shared(measures), spent
            done(1)
        self._sort(items)
        return by_key, before

    def _sort(self, keys: Iterable[str]) -> None:
        """Put the lines of some keys behind all others, in the order of the keys.

        Raises:
            ResultsError: the files cannot be written.
        """
        if not self._alone:  # a journal around this one writes into the same files
            return
        order = {key: place for place, key in enumerate(keys)}
        try:
            for file in self._files:
                file.close()
                _sort_lines(Path(file.name), order)
            runs, times = (Path(file.name) for file in self._files)
            self._files = _opened(runs), _opened(times)
        except OSError as error:
            raise ResultsError(
                f"{self._path}: cannot be written ({error.strerror}); all runs are kept: make room, and "
                "start again"
            ) from None


def _opened(path: Path) -> IO[str]:
    return path.open("a", encoding="utf-8")


_Line: TypeAlias = tuple[tuple[str, ...], tuple[Any, ...]]
"""Names and values of a line: the names are the same object in all lines that have the same."""


def _shared(measures: Kept) -> Kept:
    """The same, equal texts as one object: most runs are of the same few scenes and settings."""
    values = (getattr(measures, entry.name) for entry in dataclasses.fields(measures))
    return type(measures)(*(sys.intern(value) if type(value) is str else value for value in values))


def _checked(kind: type[Kept], line: _Line, where: str) -> Kept:
    """What a line holds, as it was written: a number that was written as a whole one stays one.

    Raises:
        ReadError: a field is missing, unknown or of another kind.
    """
    values = dict(zip(*line, strict=True))
    decode(kind, values, where)
    return kind(**values)


def _sealed(line: str) -> str:
    """An object of JSON with a checksum as its last entry."""
    return f'{line[:-1]}, "check": "{_check(line)}"}}'


def _unsealed(line: str) -> str:
    """The object without its checksum; lines of version 0.1.0 have none.

    Raises:
        ReadError: the line was changed.
    """
    sealed = _SEAL.search(line)
    if sealed is None:
        return line
    bare = line[: sealed.start()] + "}"
    if _check(bare) != sealed.group(1):
        raise ReadError("its checksum is another")
    return bare


def _check(line: str) -> str:
    return hashlib.sha256(line.encode()).hexdigest()[:16]


def _sort_lines(path: Path, order: Mapping[str, int]) -> None:
    """Sort a file of lines by key, of which the last one counts; lines of unknown keys stay in front.

    Only their places are held in memory.
    """
    places: dict[str, tuple[int, int]] = {}
    part = path.with_name(f".{path.name}.part")
    try:
        with path.open("rb") as file:
            begin = 0
            for line in file:
                match = _KEY.match(line)
                key = line.decode() if match is None else match.group(1).decode()
                places.pop(key, None)  # one that was carried out again stands where it was written last
                places[key] = begin, len(line)
                begin += len(line)
            ordered = sorted(places, key=lambda key: order.get(key, -1))
            if ordered == list(places) and begin == sum(length for _, length in places.values()):
                return
            with part.open("wb") as sorted_file:
                for key in ordered:
                    file.seek(places[key][0])
                    sorted_file.write(file.read(places[key][1]))
                sorted_file.flush()
                os.fsync(sorted_file.fileno())
        part.replace(path)
    except BaseException:
        part.unlink(missing_ok=True)
        raise


def _read(path: Path, cut: bool) -> dict[str, _Line]:
    """Lines by key.

    Args:
        path: the file.
        cut: whether to cut off what a killed process, or a system that failed, left of a last line.
    """
    if not path.exists():
        return {}
    by_key: dict[str, _Line] = {}
    known_names: dict[tuple[str, ...], tuple[str, ...]] = {}
    end = 0
    for key, values, line_end in _lines(path):
        names, end = tuple(values), line_end
        texts_shared = (sys.intern(value) if type(value) is str else value for value in values.values())
        by_key[key] = known_names.setdefault(names, names), tuple(texts_shared)
    if cut and end < path.stat().st_size:
        os.truncate(path, end)
    return by_key


def kept_lines(path: Path) -> Iterator[tuple[str, dict[str, Any]]]:
    """Keys and values of a journal, line by line; of a key that is there several times the last ones count.

    Raises:
        ResultsError: a line is none of a journal.
    """
    return ((key, values) for key, values, _ in _lines(path))


def _lines(path: Path) -> Iterator[tuple[str, dict[str, Any], int]]:
    """Key, values and end of each line that is whole."""
    end = 0
    with path.open("rb") as file:
        for number, line in enumerate(file, 1):
            if not line.endswith(b"\n"):  # torn by a kill
                return
            try:
                values = parse_json(_unsealed(line.decode()))
                key = values.pop("key")
                hash(key)
            except (ValueError, KeyError, TypeError, AttributeError) as error:
                if b"\0" in line and b"\n" not in file.read():  # what a file system leaves of a power cut
                    return
                raise ResultsError(
                    f"{path}: not a journal of a comparison (line {number}: {shown(error)}); remove it"
                ) from None
            end += len(line)
            yield key, values, end
