"""What several commands print in the same way."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import typer

if TYPE_CHECKING:
    from evaluation.results.gates import Rule, Side

FAILED = 3
"""Exit status where results meet a rule of `--fail-on`; 2 is a mistake of the user."""


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


@dataclass(frozen=True, slots=True)
class Gate:
    """What `--fail-on` and `--junit` ask for.

    Args:
        command: whose results are judged.
        rules: of `--fail-on`; none: nothing is judged.
        junit: file for the verdicts; None: none is written.
    """

    command: str
    rules: tuple[Rule, ...]
    junit: Path | None

    def close(self, sides: Callable[[], Sequence[Side]]) -> None:
        """Judge results: a line on the error output for each broken rule, and the exit status.

        Args:
            sides: gives what the command scored.

        Raises:
            ArgumentError: a rule is for a name that is not in the results.
            ResultsError: the JUnit file cannot be written.
            typer.Exit: results meet a rule, with status `FAILED`.
        """
        if not self.rules:
            return
        from evaluation.results.gates import judge, write_junit

        verdicts = judge(self.rules, sides())
        if self.junit is not None:
            write_junit(self.junit, self.command, verdicts)
        broken = [verdict.line for verdict in verdicts if verdict.broken]
        for line in broken:
            typer.echo(f"smartmot-eval: failed: {one_line(line)}", err=True)
        if broken:
            raise typer.Exit(FAILED)


def parse_gate(
    command: str, fail_on: str | None, junit: Path | None, measures: Callable[[], Sequence[str]]
) -> Gate:
    """The gate that was asked for, before anything is run.

    Args:
        command: its name.
        fail_on: rules; None: none.
        junit: file for the verdicts.
        measures: gives the names of what the command scores.

    Raises:
        ArgumentError: a rule cannot be read, or a file is asked for without rules.
        OSError: the file could not be written.
    """
    from evaluation.errors import ArgumentError

    if fail_on is None:
        if junit is not None:
            raise ArgumentError("--junit: writes the verdicts of --fail-on; add it")
        return Gate(command, (), None)
    from evaluation.results.files import check_writable
    from evaluation.results.gates import parse_rules

    rules = parse_rules(fail_on, measures())
    if junit is not None:
        junit.parent.mkdir(parents=True, exist_ok=True)
        check_writable(junit)
    return Gate(command, rules, junit)
