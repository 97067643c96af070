"""What every study is: runs, a job that measures each, and the tables that are made of them.

The runs that are finished stand in a journal, so that a study that was stopped goes on where it was.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, Generic, Protocol, TypeVar

from evaluation.progress import progress_bar
from evaluation.runs.execution import FrameTime
from evaluation.runs.fingerprint import fingerprint
from evaluation.runs.journal import Journal
from evaluation.runs.workers import Workers
from scenarios.spec import RunSpec

if TYPE_CHECKING:
    from _typeshed import DataclassInstance
    from rich.console import Console


class Keyed(Protocol):
    """An item of a study: what it is known by in the journal."""

    @property
    def key(self) -> str:
        """Hash of everything that determines what comes out."""


Label = TypeVar("Label")
Item = TypeVar("Item", bound=Keyed)
Measures = TypeVar("Measures", bound="DataclassInstance")

Finished = Mapping[str, tuple[Measures, FrameTime]]
"""What is kept of each run, by its key."""


@dataclass(frozen=True, slots=True)
class LabelledRun(Generic[Label]):
    """A run of a study, and what it is there.

    Args:
        spec: what is run.
        label: its scene, cell, condition, or whatever tells it apart in the study.
        more: what determines the run beside the spec, if anything does; it is hashed.
    """

    spec: RunSpec
    label: Label
    more: tuple[object, ...] = field(default=(), kw_only=True)
    _key: list[str] = field(default_factory=list, init=False, repr=False, compare=False)

    @property
    def key(self) -> str:
        """Hash of everything that determines the run; what is read for it is read once."""
        if not self._key:
            self._key.append(fingerprint(self.spec, *self.more))
        return self._key[0]


JOURNAL = "journal"
"""Folder, beside those of the parts of a report, of what can be made again and is not kept."""


class Study(ABC, Generic[Item, Measures]):
    """A folder of results that can be made again.

    Subclasses are frozen values; their jobs run in other processes.
    """

    __slots__ = ()

    name: str
    """Of the folder."""
    journal: str
    """Prefix of the journal's files; studies with the same one share their runs."""
    table: str
    """File with a line per run, in the order of the runs."""
    kind: type[Measures]
    """What is kept of a run."""

    def given(self, out: Path) -> Study[Item, Measures]:
        """The study as it is after others whose results are in a folder: one may settle what is run here."""
        return self

    @property
    def needs(self) -> tuple[str, ...]:
        """What it takes from a folder of data from outside, by paths in it; see `with_outside`."""
        return ()

    def with_outside(self, outside: Path) -> Study[Item, Measures]:
        """The study with the data that it needs from outside."""
        return self

    def place(self, out: Path) -> Path:
        """Folder for what its runs need, and write, in a folder of several studies."""
        return out / self.name

    @abstractmethod
    def items(self, folder: Path) -> Sequence[Item]:
        """The runs; what they write beside the journal goes to the folder."""

    @staticmethod
    @abstractmethod
    def job(item: Any) -> Any:
        """Carry out one of them, on whichever machine: see `kept`."""

    def kept(self, item: Item, result: Any) -> tuple[Measures, FrameTime]:
        """What the journal keeps of a job's result; what stands beside the journal is written here."""
        measures: Measures
        measures, spent = result
        return measures, spent

    def is_quick(self, item: Item) -> bool:
        """Whether a check may carry it out again; it should take a second or so."""
        return True

    def some(self, count: int, folder: Path) -> tuple[int, dict[int, Item]]:
        """How many runs there are, and a few of the quick ones by their number, evenly spread."""
        items = self.items(folder)
        quick = [k for k, item in enumerate(items) if self.is_quick(item)]
        return len(items), {k: items[k] for k in (quick[i] for i in evenly(count, len(quick)))}

    def is_whole(self, item: Item) -> bool:
        """Whether what a finished run has written beside the journal is there."""
        return True

    @abstractmethod
    def write(self, folder: Path, items: Sequence[Item], finished: Finished[Measures]) -> list[Path]:
        """Write tables and figures of the finished runs."""

    def carry_out(
        self,
        items: Sequence[Item],
        folder: Path,
        prefix: str,
        workers: Workers,
        done: Callable[[int], None] = lambda count: None,
    ) -> tuple[dict[str, tuple[Measures, FrameTime]], int]:
        """Carry out the runs that a journal does not have; see `Journal.carry_out`.

        Args:
            items: the runs.
            folder: of the journal.
            prefix: of the journal's files.
            workers: processes, or a scheduler; see `evaluation.runs.workers.execute_as_finished`.
            done: called with the number of runs that are new on disk, first of those from before.
        """
        with Journal(folder, self.kind, prefix) as journal:
            return journal.carry_out(
                self.job, {item.key: item for item in items}, workers, done, self.is_whole, self.kept
            )

    def carry_out_behind_bar(
        self,
        items: Sequence[Item],
        out: Path,
        prefix: str,
        workers: Workers,
        console: Console,
        title: str,
    ) -> tuple[dict[str, tuple[Measures, FrameTime]], int]:
        """The same with a progress bar."""
        with progress_bar(console) as progress:
            bar = progress.add_task(title, total=len({item.key for item in items}))
            return self.carry_out(items, out, prefix, workers, lambda count: progress.advance(bar, count))


def evenly(count: int, of: int) -> list[int]:
    """Numbers below one, as evenly spread as so many can be."""
    return sorted({of * (2 * n + 1) // (2 * count) for n in range(count)})


def done_line(count: int, before: int, out: Path, names: Sequence[str]) -> str:
    """How many runs there are, and what was written where."""
    runs = f"{count} runs" + (f", {before} of them from before" if before else "")
    return f"{runs}; in {out}: {', '.join(names)}"
