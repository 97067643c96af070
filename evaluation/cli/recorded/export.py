"""`smartmot-eval export`: drives and simulated runs in the layouts of other tools, and as scenarios."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import For, is_typed, refuse_idle
from evaluation.cli.output import counting, print_written
from evaluation.cli.recorded.options import parse_vehicle
from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    from evaluation.studies.datasets.sweeps import LidarChoice

EXAMPLES = options.examples(
    "`smartmot-eval export results/run --format simbev --out data` writes every run of a folder as a scene.",
    "`smartmot-eval export results/run/NAME --format nuscenes --sensor hdl64 --street furnished --out data`",
    "`smartmot-eval export kitti/training --format nuscenes --out nuscenes`",
    "`smartmot-eval export kitti/training --sequence 0001 --format openscenario --out 0001.xosc`; then "
    "`smartmot-eval run 0001.xosc` drives it with the ego in our hands.",
    "What is written: docs/export.md.",
)

OPENSCENARIO = "openscenario"
DATA_SETS = ("kitti", "nuscenes", "simbev")
EFFECTS = (
    For(("map_file", "ego"), "form", (OPENSCENARIO,)),
    For(("seed", "sensor", "street", "street_density", "street_seed", "min_points"), "form", DATA_SETS),
)
NO_LIDAR = "none"
"""As `--sensor`: labels and poses alone."""


def command(
    context: typer.Context,
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
    form: Annotated[str, typer.Option("--format", help="simbev, nuscenes, kitti or openscenario.")],
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
    sensor: Annotated[
        str | None,
        typer.Option(
            help="LiDAR that is cast along runs, for a data set: hdl32, hdl64, mid70, or none. Default: that "
            "of the run, else hdl32.",
            metavar="NAME",
            rich_help_panel=options.LIDAR,
        ),
    ] = None,
    street: Annotated[
        str | None,
        typer.Option(
            help="bare or furnished; see `run --help`. Default: that of the run.",
            metavar="NAME",
            rich_help_panel=options.LIDAR,
        ),
    ] = None,
    street_density: options.StreetDensity = None,
    street_seed: options.StreetSeed = None,
    min_points: Annotated[
        int | None,
        typer.Option(
            "--min-points",
            min=0,
            max=1_000_000,
            help="Labels with fewer points in their box are left out. Default: 1.",
            rich_help_panel=options.LIDAR,
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
    from evaluation.studies.datasets.layouts import LAYOUTS, is_runs, write_layout
    from evaluation.studies.mot.openscenario import write_scenario

    form = options.parse_name(form, (*LAYOUTS, OPENSCENARIO), "--format")
    refuse_idle(context, EFFECTS)
    if is_typed(context, "sequence") and source.exists() and is_runs(source):
        raise ArgumentError("--sequence: for recorded drives; of runs name a single one, DIR/NAME")
    reading = options.source_reading(columns, frame_rate, topic, odometry, velocity_frame)
    typed = {
        "--sensor": sensor,
        "--street": street,
        "--street-density": street_density,
        "--street-seed": street_seed,
        "--min-points": min_points,
    }
    of_lidar = [name for name, value in typed.items() if value is not None]
    if form != OPENSCENARIO:
        if of_lidar and source.exists() and not is_runs(source):
            raise ArgumentError(f"{of_lidar[0]}: for runs; no LiDAR is cast along a recorded drive")
        lidar = parse_choice(sensor, street, street_density, street_seed, min_points)
        with counting("casting", quiet) as done:
            written, notes = write_layout(source, form, out, seed, sequence, reading, lidar, done)
    else:
        vehicle = None if ego is None else parse_vehicle(ego)
        written, notes = write_scenario(source, out, map_file, sequence, reading, vehicle)
    print_written([written], notes, quiet)


def parse_choice(
    sensor: str | None, street: str | None, density: float | None, seed: int | None, min_points: int | None
) -> LidarChoice | None:
    """The LiDAR that is cast along runs; None: none is.

    Raises:
        ArgumentError: an unknown name, or an option without what it belongs to.
    """
    from evaluation.studies.datasets.sweeps import DEFAULT_SENSOR, LidarChoice
    from scenarios.sensors.lidar import SENSORS

    if sensor is not None:
        sensor = options.parse_name(sensor, (*SENSORS, NO_LIDAR), "--sensor")
    if sensor == NO_LIDAR:
        if (street, density, seed, min_points) != (None, None, None, None):
            raise ArgumentError(
                "--sensor none: no LiDAR, so neither street nor points; leave their options out"
            )
        return None
    settings = options.parse_lidar(sensor or DEFAULT_SENSOR, None, street, density, seed)
    of_street = tuple((name, value) for name, value in settings if name != "sensor")
    return LidarChoice(sensor, of_street, 1 if min_points is None else min_points)
