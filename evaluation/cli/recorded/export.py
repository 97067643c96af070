"""`smartmot-eval export`: recorded drives and simulated runs in the layouts of other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import print_written

EXAMPLES = options.examples(
    "`smartmot-eval export results/run --format simbev --out data` writes every run of a folder as a scene.",
    "`smartmot-eval export results/run/NAME --format nuscenes --out nuscenes`",
    "`smartmot-eval export kitti/training --format nuscenes --out nuscenes`",
    "What is written: docs/export.md.",
)


def command(
    source: Annotated[
        Path,
        typer.Argument(
            help="A folder of runs, a run, DIR/NAME or its log; or a recorded drive, as for mot.",
            metavar="PATH",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder of the data set.", metavar="DIR")],
    form: Annotated[str, typer.Option("--format", help="simbev or nuscenes.")],
    sequence: Annotated[
        str | None, typer.Option(help="Only these sequences of a drive, comma-separated.", metavar="NAMES")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=2**63 - 1, help="Seed of the splits: scenes in train, val and test.")
    ] = 0,
    columns: options.ColumnPairs = None,
    frame_rate: options.FrameRate = None,
    quiet: options.Quiet = False,
) -> None:
    """Write simulated runs or recorded drives as a data set in another layout, every run a scene."""
    from evaluation.studies.mot.layouts import LAYOUTS, write_layout

    form = options.parse_name(form, tuple(LAYOUTS), "--format")
    pairs = options.table_columns(columns, frame_rate)
    written, notes = write_layout(source, form, out, seed, sequence, pairs)
    print_written([written], notes, quiet)
