"""`smartmot-eval lidar quality`: right and false boxes of a detector on a data set."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.lidar.detect import parse_method
from evaluation.cli.output import counting, parse_gate
from evaluation.errors import ArgumentError

EXAMPLES = options.examples(
    "`smartmot-eval lidar quality data --method pillars --min-points 10`",
    "`smartmot-eval lidar quality kitti_object --method classical --split val`",
    "What counts, and how good the shipped network is: docs/learned.md.",
)

LEAST_BOX_SCORE = 0.05
"""Of boxes that are looked at, for the best F1."""


def command(
    data: Annotated[
        Path,
        typer.Argument(help="Data set with clouds in KITTI's, nuScenes' or SimBEV's layout.", metavar="DIR"),
    ],
    method: Annotated[str, typer.Option(help="pillars, classical, plain, or FILE.onnx.")] = "pillars",
    split: Annotated[
        str | None, typer.Option(help="train, val or test, comma-separated. Default: all.", metavar="NAMES")
    ] = None,
    min_points: Annotated[
        int, typer.Option(min=0, max=1_000_000, help="Labels with fewer points count neither way.")
    ] = 5,
    near: Annotated[float, typer.Option("--from", help="Least distance that counts, m.", min=0.0)] = 0.0,
    far: Annotated[float, typer.Option("--to", help="Greatest distance that counts, m.", min=0.0)] = 40.0,
    score: Annotated[
        float | None,
        typer.Option(
            help="Least score of a box. Default: what a network says of each class, else 0.3.",
            min=0.0,
            max=1.0,
        ),
    ] = None,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Count right and false boxes of a detector on labelled clouds, from above."""
    import rich.console

    from evaluation.metrics.detection.from_above import LEAST_OVERLAP
    from evaluation.results.gates import measures_of_table, sides_of_table
    from evaluation.results.tables import rich_table
    from evaluation.studies.datasets.reading import read_frames
    from evaluation.studies.detectors.quality import (
        QualityOptions,
        Truth,
        least_scores,
        measured_quality,
        quality_table,
    )
    from evaluation.studies.lidar.detect import times_line
    from smartmot.lidar import PlainConfig

    if not near < far:
        raise ArgumentError(f"--from {near:g} --to {far:g}: nothing lies between them")
    config = parse_method(method, None)
    least = least_scores(config) if score is None else dict.fromkeys(LEAST_OVERLAP, score)
    if not isinstance(config, PlainConfig):
        config = parse_method(method, min(LEAST_BOX_SCORE, *least.values()))
    splits = None if split is None else {name.strip() for name in split.split(",")}
    dropped = 0

    def truths() -> Iterator[Truth]:
        nonlocal dropped
        for frame in read_frames(data):
            if splits is None or frame.split in splits:
                dropped += frame.dropped
                covers = None if frame.unlabelled is None else frame.unlabelled.covers
                yield Truth(frame.cloud, frame.boxes, frame.labels.category, covers)

    asked = QualityOptions(min_points, (near, far))
    with counting("detecting", quiet) as done:
        boxes, account = measured_quality(truths(), config, asked, done)
    if not account.clouds:
        raise ArgumentError(f"{data}: no frame" + (f" of the splits {split}" if split else ""))
    if dropped:
        typer.echo(f"smartmot-eval: {dropped} points with a value that is not finite dropped", err=True)
    table = quality_table(boxes, least, asked)
    gate = parse_gate("lidar quality", fail_on, junit, lambda: measures_of_table(table))
    console = rich.console.Console(quiet=quiet)
    console.print(rich_table(table, f"{account.clouds} frames, {method}", texts=1))
    console.print(times_line(account), highlight=False, soft_wrap=True)
    gate.close(lambda: sides_of_table(table))
