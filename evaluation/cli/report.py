"""`smartmot-eval report`: the page of a folder of runs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import counting, print_written

EXAMPLES = options.examples(
    "`smartmot-eval report results`",
    "`smartmot-eval report results --out comparison.html`",
)


def command(
    directory: Annotated[Path, typer.Argument(help="Folder that a run wrote.", metavar="DIR")],
    out: Annotated[
        Path | None,
        typer.Option(help="Page to write; default: report.html in the folder.", metavar="FILE.html"),
    ] = None,
    allow_plugins: options.AllowPlugins = False,
    quiet: options.Quiet = False,
) -> None:
    """Write a folder of results as one HTML page: findings, scores, diagrams, a replay of every run."""
    from evaluation.views.page.page import write_page

    with counting("reading runs", quiet) as done:
        page, notes = write_page(directory, out, done, allow_plugins)
    print_written([page], notes, quiet)
