"""What several commands print in the same way."""

from __future__ import annotations

import json
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

if TYPE_CHECKING:
    from evaluation.results.gates import Rule, Side
    from evaluation.runs.workers import Workers

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


CALL = ".smartmot-call"
"""File in a default folder of results: the command, and the arguments that determine them."""
_OF_OTHER_MATTERS = frozenset(
    {
        "out", "workers", "scheduler", "quiet", "pictures", "form", "logs", "mcap", "gif", "film", "video",
        "page", "fail_on", "junit",
    }
)  # fmt: skip
"""Parameters that change no result: where, how fast, what else is made of it, and what is judged."""


def results_folder(context: typer.Context, out: Path) -> Path:
    """The folder for the results of a command: the one asked for, or a default one of its own.

    Without `--out` a command never writes into a folder with results of another call: it takes the next that
    is new, `results/run-2`. The same call goes into the same folder again.

    Args:
        context: of the command.
        out: value of `--out`.
    """
    source = context.get_parameter_source("out")
    if source is None or source.name != "DEFAULT":
        return out
    given = {name: str(value) for name, value in context.params.items() if name not in _OF_OTHER_MATTERS}
    from evaluation.results.files import write_bytes

    call = json.dumps({"command": context.info_name, "arguments": given}, sort_keys=True, indent=1)
    folder, number = out, 1
    while not _is_free(folder, call):
        number += 1
        folder = out.with_name(f"{out.name}-{number}")
    if folder != out:
        typer.echo(f"smartmot-eval: {out} holds results of another call; these go to {folder}", err=True)
    write_bytes(folder / CALL, call.encode())
    return folder


def _is_free(folder: Path, call: str) -> bool:
    """Whether a folder holds nothing yet, or results of the same call."""
    if not folder.exists():
        return True
    try:
        return (folder / CALL).read_text(encoding="utf-8") == call
    except (OSError, UnicodeDecodeError):
        return folder.is_dir() and not any(folder.iterdir())


@contextmanager
def counting(description: str, quiet: bool) -> Iterator[Callable[[int, int | None], None]]:
    """A progress bar on a terminal; gives the function that takes how many of how many are done."""
    import rich.progress

    with rich.progress.Progress(transient=True, disable=quiet or not sys.stdout.isatty()) as progress:
        task = progress.add_task(description, total=None)
        yield lambda done, total: progress.update(task, completed=done, total=total)


SchedulerAddress = Annotated[
    str | None,
    typer.Option(
        "--scheduler",
        help="Dask scheduler whose workers carry out the runs, in place of processes of this machine; the "
        "results are the same: docs/scale.md.",
        metavar="tcp://HOST:PORT",
    ),
]


def parse_workers(processes: int | None, scheduler: str | None) -> Workers:
    """Who carries out the runs: `--workers` processes, by default one per core, or a scheduler's workers.

    Raises:
        ArgumentError: both are given, or the address is none, or what connects to it is missing.
    """
    from evaluation.errors import ArgumentError
    from evaluation.runs.cluster.scheduler import Scheduler
    from evaluation.runs.workers import available_cores

    if scheduler is None:
        return processes or available_cores()
    if processes is not None:
        raise ArgumentError("--workers: counts processes of this machine; --scheduler has its own workers")
    return Scheduler(scheduler, lambda line: typer.echo(f"smartmot-eval: {line}", err=True))


def write_mcaps(out: Path, quiet: bool, workers: Workers = 1) -> None:
    """Write every run of a folder of runs as MCAP, with a progress bar; see `write_run_mcaps`.

    On this machine, where the logs are.
    """
    from evaluation.runs.workers import local_processes
    from evaluation.views.traces.folders import MCAP_FOLDER, write_run_mcaps

    with counting("writing MCAP", quiet) as done:
        notes = write_run_mcaps(out, local_processes(workers), done)
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
