"""The sub-commands of `smartmot-eval lidar` put together."""

from __future__ import annotations

import typer

from evaluation.cli.lidar import bench, convert, detect, quality, score, train
from evaluation.cli.lidar.dataset import group as dataset

app = typer.Typer(
    name="lidar",
    help="Point clouds: convert files, detect road users, score boxes, make data sets.",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    context_settings={"help_option_names": ["-h", "--help"]},
)
# in the order of the help
app.command("convert", epilog=convert.EXAMPLES)(convert.command)
app.command("detect", epilog=detect.EXAMPLES)(detect.command)
app.command("score", epilog=score.EXAMPLES)(score.command)
app.command("quality", epilog=quality.EXAMPLES)(quality.command)
app.command("train", epilog=train.EXAMPLES)(train.command)
app.command("export", epilog=train.EXPORT_EXAMPLES)(train.export_command)
app.command("bench", epilog=bench.EXAMPLES)(bench.command)
app.add_typer(dataset.app)


@app.callback()
def group() -> None:
    """Point clouds: convert files, detect road users, score boxes, make data sets."""
