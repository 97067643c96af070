"""The progress bars of commands: of many runs, and of a study in several parts."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

import rich.console
import rich.progress


class Progress(Protocol):
    """What is told how far a study has come."""

    def begin(self, description: str, total: int) -> None:
        """A part of the study begins, with so many steps."""

    def done(self) -> None:
        """One of the steps is done."""


@contextmanager
def study_progress(console: rich.console.Console) -> Iterator[Progress]:
    """A bar that begins anew with each part of a study, and is gone when it is finished."""
    with rich.progress.Progress(console=console, transient=True, disable=console.quiet) as bar:
        task = bar.add_task("", total=None)

        class Bar:
            def begin(self, description: str, total: int) -> None:
                bar.reset(task, total=total, description=description)

            def done(self) -> None:
                bar.advance(task)

        yield Bar()


def progress_bar(console: rich.console.Console) -> rich.progress.Progress:
    """A bar with counts and time left, gone when it is finished."""
    return rich.progress.Progress(
        *rich.progress.Progress.get_default_columns(),
        rich.progress.MofNCompleteColumn(),
        console=console,
        transient=True,
        disable=console.quiet,
    )
