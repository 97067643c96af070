"""The command `smartmot-eval`: its commands put together, and how a mistake of the user ends it.

Heavy libraries are imported by the commands that use them, so that `--help` answers at once.
"""

from __future__ import annotations

import os
import sys
from typing import Annotated

import typer

from evaluation.cli import (
    compare,
    cpna,
    list,  # noqa: A004 - named after its command
    map,  # noqa: A004 - named after its command
    mot,
    ncap,
    reference,
    run,
    scenes,
    study,
    views,
)
from evaluation.cli.lidar import group as lidar
from evaluation.cli.output import one_line
from evaluation.cli.recorded import bag, drive, export
from evaluation.results.calls import end as end_call

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
RUNS, RESULTS, RECORDED, STUDIES, INPUTS = (
    "Run tests and scenarios", "Look at results", "Recorded data", "Studies over many scenes",
    "Scenarios, maps, point clouds",
)  # fmt: skip
"""Headings of the help."""

# in the order of the help
app.command("cpna", epilog=cpna.EXAMPLES, rich_help_panel=RUNS)(cpna.command)
app.command("run", epilog=run.EXAMPLES, rich_help_panel=RUNS)(run.command)
app.command("ncap", epilog=ncap.EXAMPLES, rich_help_panel=RUNS)(ncap.command)
app.command("report", epilog=views.REPORT_EXAMPLES, rich_help_panel=RESULTS)(views.report)
app.command("replay", epilog=views.REPLAY_EXAMPLES, rich_help_panel=RESULTS)(views.replay)
app.command("plot", epilog=views.PLOT_EXAMPLES, rich_help_panel=RESULTS)(views.plot)
app.command("diff", epilog=views.DIFF_EXAMPLES, rich_help_panel=RESULTS)(views.diff)
app.command("rows", epilog=views.ROWS_EXAMPLES, rich_help_panel=RESULTS)(views.rows)
app.command("compare", epilog=compare.EXAMPLES, rich_help_panel=STUDIES)(compare.command)
app.command("study", epilog=study.EXAMPLES, rich_help_panel=STUDIES)(study.command)
app.command("reference", epilog=reference.EXAMPLES, rich_help_panel=STUDIES)(reference.command)
app.command("mot", epilog=mot.EXAMPLES, rich_help_panel=RECORDED)(mot.command)
app.command("drive", epilog=drive.EXAMPLES, rich_help_panel=RECORDED)(drive.command)
app.command("bag", epilog=bag.EXAMPLES, rich_help_panel=RECORDED)(bag.command)
app.command("export", epilog=export.EXAMPLES, rich_help_panel=RECORDED)(export.command)
app.command("list", rich_help_panel=INPUTS)(list.command)
app.command("scenes", epilog=scenes.EXAMPLES, rich_help_panel=INPUTS)(scenes.command)
app.command("map", epilog=map.EXAMPLES, rich_help_panel=INPUTS)(map.command)
app.add_typer(lidar.app, name="lidar", rich_help_panel=INPUTS)

OLD_NAMES = {"reports": "reference"}
"""Names that commands had before; each is still understood, for one version."""


def _print_version(asked: bool) -> None:
    """Version of this program and of Python."""
    if asked:
        import platform
        from importlib import metadata

        typer.echo(f"smartmot {metadata.version('smartmot')}, Python {platform.python_version()}")
        raise typer.Exit


@app.callback()
def options_of_all(
    version: Annotated[
        bool,
        typer.Option("--version", help="Print the version and stop.", callback=_print_version, is_eager=True),
    ] = False,
) -> None:
    """HD-map-aware tracking and automatic emergency braking, evaluated in closed loop."""


def main() -> None:
    """Entry point: run the command; one line and status 2 for a mistake of the user, 130 for Ctrl-C."""
    if len(sys.argv) > 1 and sys.argv[1] in OLD_NAMES:
        old, new = sys.argv[1], OLD_NAMES[sys.argv[1]]
        typer.echo(
            f"smartmot-eval: {old} is now called {new}; the old name goes with the next version", err=True
        )
        sys.argv[1] = new
    try:
        status = app(standalone_mode=False)
        if status == INTERRUPTED:
            typer.echo(
                "smartmot-eval: interrupted; compare, study and reference go on if started again", err=True
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
    finally:
        end_call()


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
