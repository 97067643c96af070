"""What every part of the reference results can do."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from evaluation.runs.execution import FrameTime

if TYPE_CHECKING:
    from _typeshed import DataclassInstance


class Task(Protocol):
    """One run."""

    @property
    def key(self) -> str:
        """Hash of everything that determines it."""


Finished = Mapping[str, tuple[Any, FrameTime]]
"""What is kept of each run, by its key."""


class Part(Protocol):
    """A folder of the reference results."""

    @property
    def name(self) -> str:
        """Name of the folder."""

    @property
    def journal(self) -> str:
        """Prefix of the journal's files; parts with the same one share their runs."""

    @property
    def table(self) -> str:
        """File with a line per task, in the order of the tasks."""

    @property
    def kind(self) -> type[DataclassInstance]:
        """What is kept of a run."""

    def tasks(self, folder: Path) -> Sequence[Any]:
        """The runs; what they write beside the journal goes to the folder."""

    def job(self, task: Any) -> tuple[Any, FrameTime]:
        """Carry out one of them."""

    def is_quick(self, task: Any) -> bool:
        """Whether a check may carry it out again; it should take a second or so."""

    def is_whole(self, task: Any) -> bool:
        """Whether what a finished run has written beside the journal is there."""

    def write(self, folder: Path, tasks: Sequence[Any], found: Finished) -> None:
        """Write tables and figures of the finished runs."""
