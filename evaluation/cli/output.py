"""What several commands print in the same way."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli.call.effects import is_typed

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
    is new, `results/run-2`. A folder that was asked for holds the results of its last call alone; see
    `replace_results`. The same call goes into the same folder again.

    Args:
        context: of the command.
        out: value of `--out`.
    """
    folder = out
    if not is_typed(context, "out"):
        call, number = _call(context), 1
        while not _is_free(folder, call):
            number += 1
            folder = out.with_name(f"{out.name}-{number}")
        if folder != out:
            typer.echo(f"smartmot-eval: {out} holds results of another call; these go to {folder}", err=True)
    return replace_results(context, folder)


def replace_results(context: typer.Context, folder: Path) -> Path:
    """Begin with the results of a call in a folder: files that another call has written are removed.

    Its journal stays, from which finished runs are taken again, and so does what others have put there.

    Args:
        context: of the command.
        folder: made if needed.

    Raises:
        ResultsError: another process writes into it, or it has results of a call that is not known.
    """
    from evaluation.results.calls import begin, call_of
    from evaluation.results.files import RESULTS, ResultsError
    from evaluation.runs.folder_lock import locked, writable_folder

    with locked(writable_folder(folder)):
        known = [name for name in RESULTS if (folder / name).exists()]
        if known and call_of(folder) is None:
            raise ResultsError(
                f"{folder}: has {known[0]} of a call that is not known; remove it, or name another folder "
                "(--out)"
            )
        line = f"smartmot-eval: results of another call in {folder} are replaced"
        try:
            begin(folder, _call(context), lambda: typer.echo(line, err=True))
        except OSError as error:
            raise ResultsError(
                f"{folder}: cannot be written ({error.strerror}); name another folder (--out)"
            ) from None
    return folder


def _call(context: typer.Context) -> str:
    """The command, and the arguments that determine its results."""
    from evaluation.results.calls import call_text

    given = {name: str(value) for name, value in context.params.items() if name not in _OF_OTHER_MATTERS}
    return call_text(str(context.info_name), given)


def _is_free(folder: Path, call: str) -> bool:
    """Whether a folder holds nothing yet, or results of the same call."""
    from evaluation.results.calls import call_of

    if not folder.exists():
        return True
    known = call_of(folder)
    return folder.is_dir() and not any(folder.iterdir()) if known is None else known == call


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
    from evaluation.results.calls import note
    from evaluation.runs.workers import local_processes
    from evaluation.views.traces.folders import MCAP_FOLDER, write_run_mcaps
    from evaluation.views.traces.mcap import SUFFIX

    with counting("writing MCAP", quiet) as done:
        notes = write_run_mcaps(out, local_processes(workers), done)
    for file in (out / MCAP_FOLDER).glob(f"*{SUFFIX}"):  # written by other processes
        note(file)
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
