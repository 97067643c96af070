"""The command `smartmot-eval`: its commands put together, and how a mistake of the user ends it.

Heavy libraries are imported by the commands that use them, so that `--help` answers at once.
"""

from __future__ import annotations

import os
import sys

import typer

from evaluation.cli import (
    compare,
    cpna,
    list,  # noqa: A004 - named after its command
    map,  # noqa: A004 - named after its command
    mot,
    ncap,
    reports,
    run,
    scenes,
    study,
    views,
)
from evaluation.cli.lidar import group as lidar
from evaluation.cli.output import one_line
from evaluation.cli.recorded import bag, drive, export

MISTAKE = 2
"""Exit status after a mistake of the user."""
INTERRUPTED = 130
"""Exit status after Ctrl-C, as shells have it."""
BROKEN_PIPE = 141
"""Exit status where the reader of the output has ended, as shells have it."""

app = typer.Typer(
    name="smartmot-eval",
    help="HD-map-aware tracking and automatic emergency braking, evaluated in closed loop.",
    no_args_is_help=True,
    add_completion=False,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)
# in the order of the help
app.command("cpna", epilog=cpna.EXAMPLES)(cpna.command)
app.command("run", epilog=run.EXAMPLES)(run.command)
app.command("ncap", epilog=ncap.EXAMPLES)(ncap.command)
app.command("list")(list.command)
app.command("plot", epilog=views.PLOT_EXAMPLES)(views.plot)
app.command("report", epilog=views.REPORT_EXAMPLES)(views.report)
app.command("diff", epilog=views.DIFF_EXAMPLES)(views.diff)
app.command("replay", epilog=views.REPLAY_EXAMPLES)(views.replay)
app.command("map", epilog=map.EXAMPLES)(map.command)
app.command("mot", epilog=mot.EXAMPLES)(mot.command)
app.command("export", epilog=export.EXAMPLES)(export.command)
app.command("drive", epilog=drive.EXAMPLES)(drive.command)
app.command("bag", epilog=bag.EXAMPLES)(bag.command)
app.add_typer(lidar.app, name="lidar")
app.command("compare", epilog=compare.EXAMPLES)(compare.command)
app.command("scenes", epilog=scenes.EXAMPLES)(scenes.command)
app.command("study", epilog=study.EXAMPLES)(study.command)
app.command("reports", epilog=reports.EXAMPLES)(reports.command)


def main() -> None:
    """Entry point: run the command; one line and status 2 for a mistake of the user, 130 for Ctrl-C."""
    try:
        status = app(standalone_mode=False)
        if status == INTERRUPTED:
            typer.echo(
                "smartmot-eval: interrupted; compare, study and reports go on if started again", err=True
            )
        sys.exit(status)
    except BrokenPipeError:
        # who reads the output has ended, as `head` does; what is left of it must not fail at the exit
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        sys.exit(BROKEN_PIPE)
    except Exception as error:
        message = _message_for_user(error)
        if message is None:
            raise
        if message:
            typer.echo(message, err=True)
        sys.exit(MISTAKE)


def _message_for_user(error: Exception) -> str | None:
    """What to print for a mistake of the user; None for anything else."""
    if hasattr(error, "format_message"):
        # an error of the option parser, whose classes have moved between typer's versions; without a
        # command it has printed the help already, or its message is the help
        text = str(error.format_message())
        return text if not text or "Usage:" in text else f"smartmot-eval: {text}"
    # the packages of the named errors are loaded only now, when one was raised
    from evaluation.errors import ArgumentError, WorkerError
    from evaluation.protocols.errors import ProtocolError
    from evaluation.results.files import ResultsError
    from opendrive import OpenDriveError
    from scenarios.errors import DatasetError, ScenarioError
    from smartmot.errors import SmartMotError

    named = (ArgumentError, DatasetError, WorkerError, ProtocolError, ResultsError)
    if isinstance(error, (*named, ScenarioError, SmartMotError, OpenDriveError)):
        return f"smartmot-eval: {one_line(str(error))}"
    if isinstance(error, OSError):
        # a full disk, a limit on files or a folder that has gone, wherever that is noticed
        place = f"{error.filename}: " if error.filename else "output: "
        return one_line(f"smartmot-eval: {place}cannot be read or written ({error.strerror or error})")
    return None
