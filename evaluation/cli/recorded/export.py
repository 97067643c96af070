"""`smartmot-eval export`: drives and simulated runs in the layouts of other tools, and as scenarios."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import print_written
from evaluation.cli.recorded.drive import parse_vehicle
from evaluation.errors import ArgumentError

EXAMPLES = options.examples(
    "`smartmot-eval export results/run --format simbev --out data` writes every run of a folder as a scene.",
    "`smartmot-eval export results/run/NAME --format nuscenes --out nuscenes`",
    "`smartmot-eval export kitti/training --format nuscenes --out nuscenes`",
    "`smartmot-eval export kitti/training --sequence 0001 --format openscenario --out 0001.xosc`; then "
    "`smartmot-eval run 0001.xosc` drives it with the ego in our hands.",
    "What is written: docs/export.md.",
)

OPENSCENARIO = "openscenario"


def command(
    source: Annotated[
        Path,
        typer.Argument(
            help="A folder of runs, a run, DIR/NAME or its log; or a recorded drive, as for mot.",
            metavar="PATH",
        ),
    ],
    out: Annotated[
        Path, typer.Option(help="Folder of the data set, or the scenario, FILE.xosc.", metavar="PATH")
    ],
    form: Annotated[str, typer.Option("--format", help="simbev, nuscenes or openscenario.")],
    sequence: Annotated[
        str | None, typer.Option(help="Only these sequences of a drive, comma-separated.", metavar="NAMES")
    ] = None,
    seed: Annotated[
        int, typer.Option(min=0, max=2**63 - 1, help="Seed of the splits: scenes in train, val and test.")
    ] = 0,
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            help="Of a scenario: OpenDRIVE file in whose frame the drive is. Default: that of the run; of a "
            "drive none, a plane.",
            metavar="FILE",
        ),
    ] = None,
    ego: Annotated[
        str | None,
        typer.Option(
            help="Of a scenario: the recording vehicle's length, width, and how far its middle is ahead of "
            "the recorded point (m). Default: that of the data set, else a car of 4.4 m x 1.8 m.",
            metavar="L,W[,AHEAD]",
        ),
    ] = None,
    columns: options.ColumnPairs = None,
    frame_rate: options.FrameRate = None,
    topic: options.BagTopic = None,
    odometry: options.BagOdometry = None,
    velocity_frame: options.VelocityFrame = None,
    quiet: options.Quiet = False,
) -> None:
    """Write simulated runs or recorded drives as a data set in another layout, or one as a scenario."""
    from evaluation.studies.mot.layouts import LAYOUTS, write_layout
    from evaluation.studies.mot.openscenario import write_scenario

    form = options.parse_name(form, (*LAYOUTS, OPENSCENARIO), "--format")
    reading = options.source_reading(columns, frame_rate, topic, odometry, velocity_frame)
    if form != OPENSCENARIO:
        if map_file is not None or ego is not None:
            raise ArgumentError(f"--map and --ego: for --format openscenario, not for {form}")
        written, notes = write_layout(source, form, out, seed, sequence, reading)
    else:
        vehicle = None if ego is None else parse_vehicle(ego)
        written, notes = write_scenario(source, out, map_file, sequence, reading, vehicle)
    print_written([written], notes, quiet)
