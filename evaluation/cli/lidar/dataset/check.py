"""`smartmot-eval lidar dataset check`: whether every label holds its points."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import counting, one_line

EXAMPLES = options.examples(
    "`smartmot-eval lidar dataset check results/dataset` exits with 1 where something is wrong.",
    "What is looked at: docs/datasets.md.",
)

SHOWN = 20
"""Findings that are printed; of the others the number."""


def command(
    folder: Annotated[
        Path, typer.Argument(help="Data set in the layout of KITTI, nuScenes or SimBEV.", metavar="DIR")
    ],
    min_points: Annotated[
        int | None,
        typer.Option(min=0, help="That every label must hold. Default: what the data set says, else 1."),
    ] = None,
    quiet: options.Quiet = False,
) -> None:
    """Check a data set: clouds, labels and their points, splits by scene."""
    from statistics import median

    from evaluation.studies.datasets.check import check_dataset

    with counting("checking", quiet) as done:
        report = check_dataset(folder, min_points, done)
    frames = ", ".join(f"{name or 'no split'} {count}" for name, count in report.frames.items()) or "none"
    labels = ", ".join(
        f"{name} {len(points)} (median {median(points):g} points)"
        for name, points in sorted(report.label_points.items())
    )
    if not quiet:
        typer.echo(f"layout: {report.layout}; frames: {frames}; points: {report.points}")
        typer.echo(f"labels: {labels or 'none'}")
    for finding in report.findings[:SHOWN]:
        typer.echo(f"smartmot-eval: {one_line(finding)}", err=True)
    if len(report.findings) > SHOWN:
        typer.echo(f"smartmot-eval: and {len(report.findings) - SHOWN} more", err=True)
    if report.findings:
        raise typer.Exit(1)
    if not quiet:
        typer.echo(f"every label holds {report.least_points} points or more")
