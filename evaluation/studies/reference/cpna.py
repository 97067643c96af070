"""The paper's test as a part of the reference results: table I and figures 4 and 5."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evaluation.protocols.paper import PUBLISHED
from evaluation.results.files import RUNS_CSV, log_path
from evaluation.results.logs import read_logs, write_log
from evaluation.results.rows import RunRow, read_runs
from evaluation.runs import plan as runner
from evaluation.runs.execution import FrameTime, execute
from evaluation.runs.fingerprint import fingerprint
from evaluation.studies.reference.part import Finished
from evaluation.studies.suite import write_folder
from evaluation.views.pictures import save_picture
from scenarios.spec import RunSpec


@dataclass(frozen=True, slots=True)
class LoggedRun:
    """A run whose log is kept in a folder."""

    spec: RunSpec
    folder: Path

    @property
    def key(self) -> str:
        """Hash of everything that determines the run."""
        return fingerprint(self.spec)

    @property
    def log(self) -> Path:
        """File of its log."""
        return log_path(self.folder, self.spec.log)


def run_logged(task: LoggedRun) -> tuple[RunRow, FrameTime]:
    """Carry out a run and write its log."""
    record = execute(task.spec)
    assert record.log is not None
    write_log(task.log, record.log)
    return record.row, record.spent


@dataclass(frozen=True, slots=True)
class CpnaPart:
    """A comparison in the paper's test.

    Args:
        name: of the folder.
        suite: what is run.
        beside: part whose speed curves are drawn beside those of this one; empty: none.
    """

    name: str
    suite: runner.CpnaSuite
    beside: str = ""
    table = RUNS_CSV
    kind = RunRow

    @property
    def journal(self) -> str:
        """A journal of its own: a log belongs to the part whose run wrote it."""
        return f"{self.name}_"

    def tasks(self, folder: Path) -> list[LoggedRun]:
        """The runs, by weather, then strategy, then speed."""
        return [LoggedRun(spec, folder) for spec in self.suite.specs(runner.load_site(self.suite))]

    @staticmethod
    def job(task: LoggedRun) -> tuple[RunRow, FrameTime]:
        """Carry out one of them."""
        return run_logged(task)

    def is_quick(self, task: LoggedRun) -> bool:
        """All of them."""
        return True

    def is_whole(self, task: LoggedRun) -> bool:
        """Whether its log is there."""
        return task.log.is_file()

    def write(self, folder: Path, tasks: Sequence[LoggedRun], found: Finished) -> None:
        """Write runs, table and pictures, as `smartmot-eval cpna` does."""
        write_folder(
            folder,
            [task.spec for task in tasks],
            [found[task.key][0] for task in tasks],
            runner.suite_configuration(self.suite, runner.load_site(self.suite), folder),
            "png",
            PUBLISHED if runner.is_published(self.suite) else None,
        )
        other = folder.parent / self.beside
        if self.beside and (other / RUNS_CSV).is_file():
            draw_beside(other, folder, folder / "figure_5.png")


def draw_beside(first: Path, second: Path, path: Path) -> None:
    """Speed curves of two folders in one figure, as figure 5 of the paper has them.

    Raises:
        ResultsError: a folder is not understood, or the picture cannot be written.
    """
    import pandas as pd

    from evaluation.views.plots import speed_curves

    runs = [read_runs(folder) for folder in (first, second)]
    logs = read_logs(first, runs[0]) | read_logs(second, runs[1])
    save_picture(speed_curves(pd.concat(runs, ignore_index=True), logs), path, "reports")
