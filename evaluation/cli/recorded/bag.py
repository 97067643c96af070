"""`smartmot-eval bag`: what perception would have done on a bag of ROS, as a bag."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Annotated

import typer

from evaluation.cli import options
from evaluation.cli.output import counting, one_line, parse_gate
from evaluation.cli.recorded.options import EgoOutline, parse_vehicle
from evaluation.errors import ArgumentError

EXAMPLES = options.examples(
    "`smartmot-eval bag drive_bag --out seen` writes tracks, markers and decisions, and lists the requests.",
    "`smartmot-eval bag drive.mcap --out seen.mcap --map town.xodr --rule cascade`",
    "`smartmot-eval bag drive_bag --out seen --velocity-frame world --sensor 0.9,0,1.8 --ego 4.4,1.8,1.3`",
    "`smartmot-eval drive drive_bag` judges the same requests: false activations, exposure, page and film.",
    "Topics, frames, what a frame waits for: docs/ros.md.",
)


def command(
    path: Annotated[
        Path, typer.Argument(help="Folder of a bag, or its file (.mcap, .db3, .bag).", metavar="BAG")
    ],
    out: Annotated[
        Path,
        typer.Option(help="Folder of the bag to be written, or FILE.mcap, FILE.db3.", metavar="PATH"),
    ],
    storage: Annotated[
        str | None, typer.Option(help="mcap or sqlite3. Default: as the file's suffix says, else mcap.")
    ] = None,
    topic: options.BagTopic = None,
    detectors: Annotated[
        Path | None,
        typer.Option(
            help="Several detectors into one tracker: a file with topic, profile, delay and trust of each "
            "(docs/ros.md, Several detectors).",
            metavar="FILE.toml",
        ),
    ] = None,
    odometry: options.BagOdometry = None,
    map_file: Annotated[
        Path | None,
        typer.Option("--map", help="OpenDRIVE file in the frame of the odometry.", metavar="FILE"),
    ] = None,
    strategy: Annotated[
        str | None,
        typer.Option(
            help="Monitored area: rectangular, map, all, path, adaptive, or your own, package.module:name. "
            "Default: map where there is one, else path."
        ),
    ] = None,
    rule: Annotated[
        str,
        typer.Option(
            help="Brake rule: paper, cascade, cascade_gentle, required_deceleration, last_point_to_brake, "
            "rss, autoware, autoware_readme, r157, or your own, package.module:name."
        ),
    ] = "paper",
    preset: Annotated[str, typer.Option(help="paper, physical or real: brakes, areas and tracker.")] = "real",
    max_age: Annotated[
        int | None,
        typer.Option(min=0, help="Frames without a match that a track survives. Default: the preset's time."),
    ] = None,
    detection_th: Annotated[
        float | None,
        typer.Option(min=0, max=1, help="Boxes with a lower score are dropped. Default: the preset's, 0.3."),
    ] = None,
    dataset: Annotated[
        str, typer.Option(help="Whose classes the boxes have: simbev, nuscenes, or any: of both.")
    ] = "any",
    velocity_frame: Annotated[
        str,
        typer.Option(help="Axes of the boxes' velocities: sensor, world, or ignore: they are not used."),
    ] = "ignore",
    output_frame: Annotated[
        str, typer.Option(help="Frame of what is written: map (that of the odometry) or sensor.")
    ] = "map",
    sensor: Annotated[
        str | None,
        typer.Option(
            help="Place of the sensor in the vehicle's frame: x, y, z (m) and heading (degrees). Default: "
            "as the transforms say.",
            metavar="X,Y,Z[,YAW]",
        ),
    ] = None,
    ego: EgoOutline = None,
    map_frame: Annotated[
        str, typer.Option(help="Frame of the poses where there is no odometry.", metavar="NAME")
    ] = "map",
    base_frame: Annotated[
        str, typer.Option(help="The vehicle's frame where there is no odometry.", metavar="NAME")
    ] = "base_link",
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Track and judge the boxes of a ROS bag, and write a bag with what perception publishes."""
    import rich.console

    from evaluation.results.tables import rich_table
    from evaluation.studies.bag import (
        BAG_MEASURES,
        BagOptions,
        request_table,
        see_bag,
        side_of_bag,
        summary_table,
    )
    from scenarios.live.detectors import read_detectors
    from scenarios.live.settings import DATASETS, OUTPUT_FRAMES, LiveSettings
    from scenarios.recorded.vehicles import Vehicle
    from scenarios.ros.bags.writer import STORAGES
    from scenarios.ros.messages import VELOCITY_FRAMES
    from scenarios.settings import PARAMETERS

    if detectors is not None and topic is not None:
        raise ArgumentError("--topic and --detectors both name topics of boxes; give one of them")
    gate = parse_gate("bag", fail_on, junit, lambda: BAG_MEASURES)
    settings = LiveSettings(
        preset=options.parse_preset(preset),
        strategy=None if strategy is None else _single(options.parse_strategies(strategy)),
        rule=options.parse_name(rule, PARAMETERS["rule"].choices, "--rule", own=True),
        max_age=max_age,
        detection_th=detection_th,
        dataset=options.parse_name(dataset, tuple(DATASETS), "--dataset"),
        velocity_frame=options.parse_name(velocity_frame, VELOCITY_FRAMES, "--velocity-frame"),
        output_frame=options.parse_name(output_frame, OUTPUT_FRAMES, "--output-frame"),
        vehicle=Vehicle() if ego is None else parse_vehicle(ego),
        sensor_pose=None if sensor is None else parse_sensor(sensor),
        map_frame=map_frame,
        base_frame=base_frame,
        detectors=() if detectors is None else read_detectors(detectors),
    )
    stored = None if storage is None else options.parse_name(storage, tuple(STORAGES), "--storage")
    asked = BagOptions(path, out, stored, topic, odometry, settings, map_file)
    console = rich.console.Console(quiet=quiet)
    with counting("reading the bag", quiet) as progress:
        result = see_bag(asked, progress)
    for note in result.notes:
        console.print(f"note: {one_line(note)}", highlight=False, soft_wrap=True, markup=False)
    if result.requests:
        console.print(rich_table(request_table(result), f"requests ({result.strategy}, {rule}, {preset})"))
    console.print(rich_table(summary_table(result)))
    console.print(f"written to {out}: {result.written} messages", highlight=False, soft_wrap=True)
    gate.close(lambda: [side_of_bag(result)])


def _single(names: tuple[str, ...]) -> str:
    if len(names) > 1:
        raise ArgumentError(f"--strategy: expected one, got {len(names)}; drive compares several")
    return names[0]


def parse_sensor(text: str) -> tuple[float, float, float, float]:
    """`X,Y,Z` in metres, or `X,Y,Z,YAW` with degrees.

    Raises:
        ArgumentError: not of that form.
    """
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in (3, 4) or not all(map(math.isfinite, numbers)):
        raise ArgumentError(f"--sensor: expected X,Y,Z in m or X,Y,Z,YAW with degrees, got {text!r}")
    x_m, y_m, z_m, *yaw_deg = numbers
    return x_m, y_m, z_m, math.radians(yaw_deg[0] if yaw_deg else 0.0)
