"""What several commands print in the same way."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path

import typer


def one_line(text: str) -> str:
    """A text without what would break its line or the terminal, such as parts of a damaged file."""
    return "".join(c if c.isprintable() else "\N{REPLACEMENT CHARACTER}" for c in " ".join(text.splitlines()))


def print_written(paths: Iterable[object], notes: Iterable[str], quiet: bool) -> None:
    """Print a line per note to the error output and, unless quiet, one per file that was written."""
    for note in notes:
        typer.echo(f"smartmot-eval: {one_line(note)}", err=True)
    for path in () if quiet else paths:
        typer.echo(path)


@contextmanager
def counting(description: str, quiet: bool) -> Iterator[Callable[[int, int | None], None]]:
    """A progress bar on a terminal; gives the function that takes how many of how many are done."""
    import rich.progress

    with rich.progress.Progress(transient=True, disable=quiet or not sys.stdout.isatty()) as progress:
        task = progress.add_task(description, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


def write_mcaps(out: Path, quiet: bool, workers: int = 1) -> None:
    """Write every run of a folder of runs as MCAP, with a progress bar; see `write_run_mcaps`."""
    from evaluation.views.traces.folders import MCAP_FOLDER, write_run_mcaps

    with counting("writing MCAP", quiet) as done:
        notes = write_run_mcaps(out, workers, done)
    print_written([out / MCAP_FOLDER], notes, quiet)
