"""Finished runs on disk: a line each, written as soon as it is there, so that a killed comparison goes on."""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import re
from collections.abc import Callable, Container, Mapping
from pathlib import Path
from types import TracebackType
from typing import IO, TYPE_CHECKING, Any, Generic, TypeVar

from evaluation.results.files import ResultsError
from evaluation.runs.decoding import decode
from evaluation.runs.execution import FrameTime
from evaluation.runs.folder_lock import release, take
from evaluation.runs.workers import execute_all
from scenarios.reading import ReadError, parse_json, shown

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    Measures = TypeVar("Measures", bound=DataclassInstance)
    Kept = TypeVar("Kept", bound=DataclassInstance)
else:
    Measures, Kept = TypeVar("Measures"), TypeVar("Kept")

Item = TypeVar("Item")

RUNS = "runs.jsonl"
_SEAL = re.compile(r', "check": "([0-9a-f]{16})"}\s*$')
TIMES = "times.jsonl"
"""Processor times have a file of their own: they are different in every run."""


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
        # what is torn off may be a line that a journal of this process is just writing
        alone = take(folder)
        try:
            self._lines, self._times = _read(runs, alone), _read(times, alone)
            self._files: tuple[IO[str], IO[str]] = (
                runs.open("a", encoding="utf-8"),
                times.open("a", encoding="utf-8"),
            )
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
        release(self._folder)

    def finished(self, keys: Container[str]) -> dict[str, tuple[Measures, FrameTime]]:
        """Runs with these keys that are finished.

        Raises:
            ResultsError: a line has other fields than this version writes, or values of another kind.
        """
        by_key: dict[str, tuple[Measures, FrameTime]] = {}
        try:
            for key, values in self._lines.items():
                if key in keys:
                    spent = FrameTime(0, 0.0, 0.0)
                    if key in self._times:
                        spent = _checked(FrameTime, self._times[key], f"times of run {shown(key)}")
                    by_key[key] = _checked(self._kind, values, f"run {shown(key)}"), spent
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
        job: Callable[[Item], tuple[Measures, FrameTime]],
        items: Mapping[str, Item],
        workers: int,
        done: Callable[[int], None] = lambda count: None,
        is_whole: Callable[[Item], bool] = lambda item: True,
    ) -> tuple[dict[str, tuple[Measures, FrameTime]], int]:
        """Carry out what is not finished, and write it down.

        Args:
            job: see `evaluation.runs.workers.execute_all`.
            items: by key.
            workers: processes.
            done: called with the number of items that are new on disk, first of those from before.
            is_whole: whether what a finished item has written beside the journal is there; if not, it is
                carried out again.

        Returns:
            What is kept of each item, by key, and how many were finished before.

        Raises:
            ResultsError: a line has other fields than this version writes.
        """
        by_key = {key: kept for key, kept in self.finished(items).items() if is_whole(items[key])}
        before = len(by_key)
        done(before)
        missing = [key for key in items if key not in by_key]
        fresh = execute_all(job, [items[key] for key in missing], workers)
        for key, (measures, spent) in zip(missing, fresh, strict=True):
            self.add(key, measures, spent)
            by_key[key] = measures, spent
            done(1)
        return by_key, before


def _checked(kind: type[Kept], values: Mapping[str, Any], where: str) -> Kept:
    """What a line holds, as it was written: a number that was written as a whole one stays one.

    Raises:
        ReadError: a field is missing, unknown or of another kind.
    """
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


def _read(path: Path, cut: bool) -> dict[str, dict[str, Any]]:
    """Lines by key.

    Args:
        path: the file.
        cut: whether to cut off what a killed process, or a system that failed, left of a last line.
    """
    if not path.exists():
        return {}
    content = path.read_bytes()
    end = content.rfind(b"\n") + 1
    lines = content[:end].splitlines(keepends=True)
    by_key: dict[str, dict[str, Any]] = {}
    for number, line in enumerate(lines, 1):
        try:
            values = parse_json(_unsealed(line.decode()))
            by_key[values.pop("key")] = values
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            if number == len(lines) and b"\0" in line:  # what a file system leaves of a power cut
                end -= len(line)
                break
            raise ResultsError(
                f"{path}: not a journal of a comparison (line {number}: {shown(error)}); remove it"
            ) from None
    if cut and end < len(content):
        os.truncate(path, end)
    return by_key
