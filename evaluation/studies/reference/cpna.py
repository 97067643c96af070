"""The paper's test as a part of the reference results: table I and figures 4 and 5."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from evaluation.protocols.paper import PUBLISHED
from evaluation.results.files import RUNS_CSV, log_path
from evaluation.results.logs import read_logs, write_log
from evaluation.results.rows import RunRow, read_runs
from evaluation.runs.cpna import CpnaSuite, is_published, load_site
from evaluation.runs.execution import FrameTime, RunRecord, execute
from evaluation.studies.study import Finished, LabelledRun, Study
from evaluation.studies.suite import suite_configuration, write_folder
from evaluation.views.pictures import save_picture

CpnaItem = LabelledRun[Path]
"""A run, and the folder that keeps its log."""


def log_of(item: CpnaItem) -> Path:
    """File of a run's log."""
    return log_path(item.label, item.spec.log)


@dataclass(frozen=True, slots=True)
class CpnaStudy(Study[CpnaItem, RunRow]):
    """A comparison in the paper's test.

    Args:
        name: of the folder.
        suite: what is run.
        beside: study whose speed curves are drawn beside those of this one; empty: none.
    """

    name: str
    suite: CpnaSuite
    beside: str = ""
    table = RUNS_CSV
    kind = RunRow

    @property
    def journal(self) -> str:  # type: ignore[override]  # the others have the same for every value
        """A journal of its own: a log belongs to the study whose run wrote it."""
        return f"{self.name}_"

    def items(self, folder: Path) -> list[CpnaItem]:
        """The runs, by weather, then strategy, then speed."""
        return [LabelledRun(spec, folder) for spec in self.suite.specs(load_site(self.suite))]

    @staticmethod
    def job(item: CpnaItem) -> RunRecord:
        """Carry out a run."""
        return execute(item.spec)

    def kept(self, item: CpnaItem, result: RunRecord) -> tuple[RunRow, FrameTime]:
        """Write the log of a run."""
        assert result.log is not None
        write_log(log_of(item), result.log)
        return result.row, result.spent

    def is_whole(self, item: CpnaItem) -> bool:
        """Whether its log is there."""
        return log_of(item).is_file()

    def write(self, folder: Path, items: Sequence[CpnaItem], finished: Finished[RunRow]) -> list[Path]:
        """Write runs, table and pictures, as `smartmot-eval cpna` does."""
        _, drawn = write_folder(
            folder,
            [item.spec for item in items],
            [finished[item.key][0] for item in items],
            suite_configuration(self.suite, load_site(self.suite), folder),
            "png",
            PUBLISHED if is_published(self.suite) else None,
        )
        other = folder.parent / self.beside
        if self.beside and (other / RUNS_CSV).is_file():
            drawn.append(folder / "figure_5.png")
            draw_beside(other, folder, drawn[-1])
        return drawn


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
