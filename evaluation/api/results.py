"""A folder of results, in Python."""

from __future__ import annotations

import json
import os
import shutil
import weakref
from pathlib import Path
from typing import TYPE_CHECKING, Any

from evaluation.errors import ArgumentError
from evaluation.results.files import (
    COMPARE_JSON,
    DRIVES_CSV,
    LOGS_FOLDER,
    RUNS_CSV,
    TABLE_MD,
    ResultsError,
    json_bytes,
    log_path,
    require_file,
    write_bytes,
)
from evaluation.results.logs import read_log
from evaluation.results.rows import read_runs
from smartmot.errors import suggestion

if TYPE_CHECKING:
    import pandas as pd

_SHOWN_ROWS = 10
"""Rows of a folder without a table of its own, where it is shown as text."""


class Results:
    """What runs came to: tables, logs, page and films of a folder of results.

    Made by `sweep`, `ncap`, `compare`, `drive` and `load_results`. Without a folder of the user's it lies in
    a temporary one, which is gone with this object; `save` keeps it.

    Args:
        folder: of the results.
        text: what the command prints of them; empty: its table.
        is_temporary: whether the folder is to be removed with this object.
    """

    def __init__(self, folder: Path, text: str = "", is_temporary: bool = False) -> None:
        self.folder = folder
        self._text, self._is_temporary = text, is_temporary
        if is_temporary:
            weakref.finalize(self, shutil.rmtree, folder, ignore_errors=True)

    @property
    def text(self) -> str:
        """Tables and notes, as the command prints them."""
        if self._text:
            return self._text
        table = self.folder / TABLE_MD
        if table.is_file():
            return table.read_text(encoding="utf-8").rstrip()
        return str(self.frame().head(_SHOWN_ROWS))

    @property
    def tables(self) -> tuple[str, ...]:
        """Names of the tables that `frame` reads; the first is the main one."""
        first = [name for name in (RUNS_CSV, DRIVES_CSV) if (self.folder / name).is_file()]
        others = sorted(path.name for path in self.folder.glob("*.csv") if path.name not in first)
        return tuple(Path(name).stem for name in (*first, *others))

    @property
    def logs(self) -> tuple[str, ...]:
        """Names of the runs whose logs are there."""
        return tuple(sorted(path.stem for path in (self.folder / LOGS_FOLDER).glob("*.parquet")))

    def frame(self, table: str = "") -> pd.DataFrame:
        """A table of the folder.

        Args:
            table: one of `tables`; empty: the first, a row per run.

        Raises:
            ArgumentError: there is no such table.
            ResultsError: it cannot be read.
        """
        import pandas as pd

        name = table or next(iter(self.tables), "")
        if name not in self.tables:
            known = ", ".join(self.tables) or "none"
            raise ArgumentError(
                f"{self.folder}: no table {name!r}{suggestion(name, self.tables)}; it has: {known}"
            )
        path = self.folder / f"{name}.csv"
        if path.name == RUNS_CSV and not (self.folder / COMPARE_JSON).is_file():
            return read_runs(self.folder)
        try:
            frame: pd.DataFrame = pd.read_csv(path, float_precision="round_trip")
        except (OSError, ValueError) as error:
            raise ResultsError(f"{path}: not a readable table ({' '.join(str(error).split())})") from error
        return frame

    def log(self, run: str) -> pd.DataFrame:
        """The log of a run; docs/run-log.md has the columns.

        Args:
            run: one of `logs`.

        Raises:
            ArgumentError: there is none of that name.
            ResultsError: it cannot be read.
        """
        if run not in self.logs:
            known = f"{len(self.logs)} logs, such as {self.logs[0]}" if self.logs else "no logs"
            raise ArgumentError(f"{self.folder}: no log {run!r}{suggestion(run, self.logs)}; it has {known}")
        return read_log(log_path(self.folder, run))

    def report(self, file: str | Path | None = None) -> Path:
        """Write the page of the folder, as the command `report` does.

        Args:
            file: the page; None: `report.html` in the folder, if it is the user's.

        Raises:
            ArgumentError: no file is given for results that are not kept, or it cannot be written.
            ResultsError: the folder holds nothing that a page is made of.
        """
        from evaluation.studies.drive.folder import is_drive_folder
        from evaluation.studies.drive.page import write_drive_page
        from evaluation.views.page.page import write_page

        if file is None and self._is_temporary:
            raise ArgumentError(
                "report: name a file, since the folder of these results is not kept; or save() it"
            )
        target = None if file is None else Path(file)
        write = write_drive_page if is_drive_folder(self.folder) else write_page
        page, _ = write(self.folder, target)
        return page

    def replay(self, run: str, file: str | Path) -> Path:
        """Write the film of a run, as the command `replay` does.

        Args:
            run: one of `logs`.
            file: the film, GIF or MP4 by its ending.

        Raises:
            ArgumentError: there is no such run, or the film cannot be written.
            ResultsError: its log cannot be read.
        """
        from evaluation.studies.drive.folder import is_drive_folder
        from evaluation.studies.drive.views import replay_drive
        from evaluation.views.film.replay import asked_files, replay

        self._require(run)
        path = Path(file)
        gif, mp4 = (path, None) if path.suffix == ".gif" else (None, path)
        if is_drive_folder(self.folder):
            replay_drive(self.folder, run, asked_files(gif, mp4))
        else:
            replay(self.folder / run, gif, mp4)
        return path

    def save(self, folder: str | Path) -> Results:
        """Copy all of it into a folder, which must not hold anything yet.

        Raises:
            ArgumentError: there is something already.
            ResultsError: it cannot be written.
        """
        target = Path(folder)
        if target.exists() and (not target.is_dir() or any(target.iterdir())):
            raise ArgumentError(f"save: {target} holds something already; name a new folder")
        try:
            shutil.copytree(self.folder, target, dirs_exist_ok=True)
            for path in self.folder.rglob("*.json"):
                moved = target / path.relative_to(self.folder)
                content = _moved(
                    json.loads(path.read_text("utf-8")), path.parent.resolve(), moved.parent.resolve()
                )
                write_bytes(moved, json_bytes(content))
        except (OSError, shutil.Error) as error:
            raise ResultsError(f"{target}: cannot be written ({error}); choose another folder") from error
        return Results(target, self._text)

    def to_dict(self) -> dict[str, Any]:
        """Folder, and the rows of its main table as plain values; None where there is none."""
        rows = self.frame()
        plain = rows.astype(object).where(rows.notna(), None)
        return {"folder": str(self.folder), "table": self.tables[0], "rows": plain.to_dict("records")}

    def __repr__(self) -> str:
        return self.text

    def _require(self, run: str) -> None:
        if run not in self.logs:
            self.log(run)  # raises the error that names what there is


def _moved(content: Any, old: Path, new: Path) -> Any:
    """A configuration as another folder has it: names of files outside are relative to the folder."""
    if isinstance(content, dict):
        return {_moved(name, old, new): _moved(value, old, new) for name, value in content.items()}
    if isinstance(content, list):
        return [_moved(value, old, new) for value in content]
    if isinstance(content, str) and content.startswith("../") and (old / content).exists():
        return Path(os.path.relpath(os.path.normpath(old / content), new)).as_posix()
    return content


def load_results(folder: str | Path) -> Results:
    """Open a folder that a command or a function wrote.

    Raises:
        ResultsError: there is no such folder, or it holds no results.
    """
    path = Path(folder)
    results = Results(path)
    if not results.tables:
        require_file(path / RUNS_CSV)
    return results
