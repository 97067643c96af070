"""`smartmot-eval lidar dataset show`: clouds and labels to look at."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import print_written, results_folder

EXAMPLES = options.examples(
    "`smartmot-eval lidar dataset show results/dataset --scene 0005 --mode bev`",
    "`smartmot-eval lidar dataset show results/dataset --mode page` writes a page to turn and zoom clouds.",
)


def command(
    context: typer.Context,
    folder: Annotated[
        Path, typer.Argument(help="Data set in the layout of KITTI, nuScenes or SimBEV.", metavar="DIR")
    ],
    scene: Annotated[
        str | None, typer.Option(help="Scene by its name or number. Default: all.", metavar="SCENE")
    ] = None,
    mode: Annotated[
        str, typer.Option(help="bev: a picture from above of each frame; page: one page with all clouds.")
    ] = "bev",
    frames: Annotated[int, typer.Option(min=1, max=1000, help="So many frames at most.")] = 8,
    out: Annotated[Path, typer.Option(help="Folder of the pictures or the page.")] = Path("results/clouds"),
    quiet: options.Quiet = False,
) -> None:
    """Show clouds of a data set with their labels and the points in each."""
    from evaluation.studies.datasets.show import MODES, show_dataset

    mode = options.parse_name(mode, MODES, "--mode")
    out = results_folder(context, out)
    print_written(show_dataset(folder, out, mode, scene, frames), (), quiet)
