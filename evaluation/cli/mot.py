"""`smartmot-eval mot`: recorded detections, tracked and scored."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options

EXAMPLES = options.examples(
    "`smartmot-eval mot kitti/training --out results/mot`",
    "`smartmot-eval mot nuscenes/detections.json --config centerpoint --write nuscenes`",
    "`smartmot-eval mot my_csv_folder --gif tracks.gif --sequence 0001`",
    "`smartmot-eval mot my_csv_folder --filter map --map town.xodr`",
    "`smartmot-eval mot kitti/training --config my_tracker:MyTracker`",
    "Formats, metrics and the files written: docs/mot.md. Metrics need trackeval: pip install trackeval.",
)


def command(
    directory: Annotated[Path, typer.Argument(help="Recorded detections, and labels if any.", metavar="DIR")],
    form: Annotated[
        str | None,
        typer.Option("--format", help="kitti, nuscenes or csv; default: what the files look like."),
    ] = None,
    config: Annotated[
        str,
        typer.Option(
            help="Tracker: default, smartmot, centerpoint, ab3dmot, or your own, package.module:name."
        ),
    ] = "default",
    area: Annotated[
        str, typer.Option("--filter", help="none, or map: only what is on lanes that matter to the ego.")
    ] = "none",
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map", help="OpenDRIVE file: for --filter map and forecasts along lanes.", metavar="FILE"
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for tracks and tables.")] = Path("results/mot"),
    write: Annotated[
        str | None,
        typer.Option(help="Track files: kitti, csv, nuscenes; default: csv and the format that was read."),
    ] = None,
    similarity: Annotated[
        str, typer.Option(help="distance (2 m) or iou, comma-separated: what makes a match.")
    ] = "distance",
    threshold: Annotated[
        str, typer.Option(help="best: leave out tracks below the score with the best MOTA; none: keep all.")
    ] = "best",
    sequence: Annotated[
        str | None,
        typer.Option(help="Only these sequences, comma-separated."),
    ] = None,
    gif: Annotated[
        Path | None,
        typer.Option(help="Film of the first sequence from above, as GIF.", metavar="FILE"),
    ] = None,
    video: Annotated[
        Path | None,
        typer.Option(help="The same as MP4; needs ffmpeg.", metavar="FILE"),
    ] = None,
    frames: Annotated[
        str | None,
        typer.Option(help="Frames of the film: 0..200. Default: all."),
    ] = None,
    forecast: Annotated[bool, typer.Option(help="Score forecasts too.")] = True,
    quiet: options.Quiet = False,
) -> None:
    """Track recorded detections (KITTI, nuScenes, CSV); score the tracks where there are labels."""
    from evaluation.studies.mot.command import MotOptions, run_mot

    run_mot(
        MotOptions(
            directory=directory,
            form=form,
            config=config,
            area=area,
            map_file=map_file,
            out=out,
            write=write,
            similarity=similarity,
            threshold=threshold,
            sequence=sequence,
            gif=gif,
            video=video,
            frames=frames,
            forecast=forecast,
            quiet=quiet,
        )
    )
