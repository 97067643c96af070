"""`smartmot-eval replay`: a run as a film."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import counting, print_written

EXAMPLES = options.examples(
    "`smartmot-eval replay results/CPNA_map_dry_none_60kmh_seed0 --gif map60.gif`",
    "`smartmot-eval replay results/logs/CPNA_map_dry_none_60kmh_seed0.parquet --mp4 map60.mp4 --speed 0.5`",
)


def command(
    run: Annotated[Path, typer.Argument(help="DIR/NAME of a run, or the path of its log.", metavar="RUN")],
    gif: Annotated[
        Path | None,
        typer.Option(help="Animated GIF to write; default: NAME.gif in DIR.", metavar="FILE.gif"),
    ] = None,
    mp4: Annotated[
        Path | None,
        typer.Option(help="H.264 film to write; needs ffmpeg.", metavar="FILE.mp4"),
    ] = None,
    fps: Annotated[float, typer.Option(help="Pictures per second, 1 to 50.")] = 20.0,
    speed: Annotated[float, typer.Option(help="1: real time, 0.5: half as fast.")] = 1.0,
    allow_plugins: options.AllowPlugins = False,
    quiet: options.Quiet = False,
) -> None:
    """Film a run from above, with what happens in words."""
    from evaluation.views.film.replay import replay

    with counting("drawing", quiet) as done:
        written, notes = replay(run, gif, mp4, fps, speed, done, allow_plugins)
    print_written(written, notes, quiet)
