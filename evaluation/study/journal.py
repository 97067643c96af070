"""Finished runs on disk: a line each, written as soon as it is there, so that a killed comparison goes on."""

from __future__ import annotations

import dataclasses
import json
import os
from collections.abc import Container
from pathlib import Path
from types import TracebackType
from typing import IO, Any

from evaluation.results import ResultsError
from evaluation.study.measures import FrameTime, RunMeasures

RUNS = "runs.jsonl"
TIMES = "times.jsonl"
"""Processor times have a file of their own: they are different in every run."""


class Journal:
    """The journal of a folder; a context manager.

    Args:
        folder: that exists.

    Raises:
        ResultsError: the files cannot be opened, or a line is not one of a journal.
    """

    def __init__(self, folder: Path) -> None:
        self._path = folder / RUNS
        self._lines = _read(self._path)
        self._times = _read(folder / TIMES)
        try:
            self._files: tuple[IO[str], IO[str]] = tuple(  # type: ignore[assignment]
                (folder / name).open("a", encoding="utf-8") for name in (RUNS, TIMES)
            )
        except OSError as error:
            raise ResultsError(
                f"{folder}: cannot be written ({error.strerror}); choose another folder"
            ) from None

    def __enter__(self) -> Journal:
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
            file.close()

    def finished(self, keys: Container[str]) -> dict[str, tuple[RunMeasures, FrameTime]]:
        """Runs with these keys that are finished.

        Raises:
            ResultsError: a line has other fields than this version writes.
        """
        found: dict[str, tuple[RunMeasures, FrameTime]] = {}
        try:
            for key, values in self._lines.items():
                if key in keys:
                    spent = FrameTime(**self._times[key]) if key in self._times else FrameTime(0, 0.0, 0.0)
                    found[key] = RunMeasures(**values), spent
        except TypeError as error:
            raise ResultsError(f"{self._path}: not a journal of this version ({error}); remove it") from None
        return found

    def add(self, key: str, measures: RunMeasures, spent: FrameTime) -> None:
        """Write a finished run down; when this returns it is on disk."""
        # the run last: without its line it counts as not done
        lines = (dataclasses.asdict(spent), dataclasses.asdict(measures))
        for file, values in zip(self._files[::-1], lines, strict=True):
            file.write(json.dumps({"key": key, **values}) + "\n")
            file.flush()
        os.fsync(self._files[0].fileno())


def _read(path: Path) -> dict[str, dict[str, Any]]:
    """Lines by key. What a killed process left of a last line is cut off."""
    if not path.exists():
        return {}
    found: dict[str, dict[str, Any]] = {}
    try:
        content = path.read_bytes()
        whole = content.rfind(b"\n") + 1
        if whole < len(content):
            os.truncate(path, whole)
        for line in content[:whole].splitlines():
            values = json.loads(line)
            found[values.pop("key")] = values
    except OSError as error:
        raise ResultsError(f"{path}: {error.strerror}; choose another folder") from None
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise ResultsError(f"{path}: not a journal of a comparison ({error!r}); remove it") from None
    return found
