"""`smartmot-eval plot`: the pictures of a folder of runs, drawn again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import print_written

EXAMPLES = options.examples(
    "`smartmot-eval plot results`",
    "`smartmot-eval plot results --run CPNA_map_dry_none_60kmh_seed0 --format svg`",
)


def command(
    directory: Annotated[Path, typer.Argument(help="Folder that `cpna` or `run` wrote.", metavar="DIR")],
    run: Annotated[
        str | None,
        typer.Option(help="Log name (column log of runs.csv) for temporal diagram and bird's-eye view."),
    ] = None,
    form: options.PictureFormat = "png",
    allow_plugins: options.AllowPlugins = False,
    quiet: options.Quiet = False,
) -> None:
    """Draw the pictures of a folder of results again, for any of its runs."""
    from evaluation.studies.suite import draw_again

    written, notes = draw_again(directory, run, options.parse_format(form), allow_plugins)
    print_written(written, notes, quiet)
