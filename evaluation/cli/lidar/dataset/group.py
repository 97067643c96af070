"""The sub-commands of `smartmot-eval lidar dataset` put together."""

from __future__ import annotations

import typer

from evaluation.cli.lidar.dataset import check, make, show

app = typer.Typer(
    name="dataset",
    help="Data sets of labelled clouds: make, check, show.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
)
app.command("make", epilog=make.EXAMPLES)(make.command)
app.command("check", epilog=check.EXAMPLES)(check.command)
app.command("show", epilog=show.EXAMPLES)(show.command)


@app.callback()
def group() -> None:
    """Data sets of labelled clouds: make, check, show."""
