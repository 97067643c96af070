"""`smartmot-eval lidar detect`: road users in clouds, and tracks of them."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import With, refuse_idle
from evaluation.cli.output import counting, one_line, parse_gate, results_folder
from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    import rich.console

    from evaluation.metrics.mot import MotScore
    from smartmot.lidar import DetectorConfig

EXAMPLES = options.examples(
    "`smartmot-eval lidar detect training/velodyne --calib training/calib --out results/lidar`",
    "`smartmot-eval lidar detect drive.mcap --topic /velodyne_points --method plain`",
    "`smartmot-eval lidar detect 000001.bin --stages`",
    "`smartmot-eval lidar detect velodyne --method network.onnx --score-min 0.1`",
    "`smartmot-eval lidar detect velodyne --calib calib.txt --track --labels label_02/0000.txt`",
    "Stages, parameters, files written: docs/lidar.md.",
)

NETWORK_ENDING = ".onnx"

Clouds = Annotated[
    list[Path],
    typer.Argument(
        help="Clouds (.bin, .pcd.bin, .pcd, .npz), folder of them, or bag.", metavar="FILE|DIR|BAG ..."
    ),
]
Method = Annotated[
    str, typer.Option(help="classical, pillars: the shipped network, plain: the thesis' chain, or FILE.onnx.")
]
Ahead = Annotated[
    str | None,
    typer.Option(
        help="Axis of the sensor that points ahead: x, y, -x or -y. Default: y for .pcd.bin (nuScenes), "
        "x for others.",
        metavar="AXIS",
    ),
]
Topic = Annotated[str | None, typer.Option(help="Topic of the clouds in a bag. Default: the only one.")]

EFFECTS = (With(("labels",), ("track",)), With(("fail_on", "junit"), ("labels",)))


def command(
    context: typer.Context,
    clouds: Clouds,
    method: Method = "classical",
    out: Annotated[Path, typer.Option(help="Folder for boxes and tracks.")] = Path("results/lidar"),
    calib: Annotated[
        Path | None,
        typer.Option(
            help="KITTI calibration, file or folder: result lines get the camera's frame and image boxes.",
            metavar="PATH",
        ),
    ] = None,
    score_min: Annotated[
        float | None,
        typer.Option(
            help="Leave out boxes with a lower score. Default: what a network says of each class, else 0.3, "
            "under which trackers drop them.",
            min=0.0,
            max=1.0,
        ),
    ] = None,
    stages: Annotated[
        bool, typer.Option(help="Show each step with count and ms; a picture and an .npz of each cloud.")
    ] = False,
    track: Annotated[bool, typer.Option(help="Track the boxes, as `mot` does.")] = False,
    labels: Annotated[
        Path | None,
        typer.Option(help="KITTI tracking labels of the clouds: scores the tracks.", metavar="FILE"),
    ] = None,
    ahead: Ahead = None,
    topic: Topic = None,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Detect cars, pedestrians and cyclists in point clouds."""
    import numpy as np
    import rich.console

    from evaluation.results.tables import rich_table
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.lidar.detect import (
        STAGES_FOLDER,
        Account,
        Calibrations,
        DetectionWriter,
        cloud_count,
        detected_clouds,
        stage_table,
        times_line,
        write_labels,
    )
    from evaluation.studies.mot.tables import MOT_MEASURES, sides_of_scores
    from evaluation.views.clouds import write_stages
    from smartmot.lidar import LearnedConfig

    refuse_idle(context, EFFECTS)
    gate = parse_gate("lidar detect", fail_on, junit, lambda: MOT_MEASURES)
    if labels is not None and calib is None:
        raise ArgumentError("--labels: needs --calib, which says where the camera is")
    ahead = parse_ahead(ahead)
    config = parse_method(method, score_min)
    calibrations = None if calib is None else Calibrations(calib)
    account, seen = Account(), 0
    grid = config.network.grid if isinstance(config, LearnedConfig) else None
    out = writable_folder(results_folder(context, out))
    console = rich.console.Console(quiet=quiet)
    with locked(out):
        writer = DetectionWriter(out, calibrations, account)
        total = cloud_count(clouds)
        with counting("detecting", quiet) as done:
            for detected in detected_clouds(clouds, topic, config, account, ahead):
                writer.add(detected)
                if grid is not None:
                    seen += int(np.count_nonzero(grid.covers(detected.cloud.xyz_m)))
                if stages:
                    write_stages(out / STAGES_FOLDER, detected.name, detected.cloud, detected.detections)
                done(account.clouds, total)
        writer.finish()
        if labels is not None and calibrations is not None:
            write_labels(labels, calibrations, writer)
        print_notes(account.notes, account.clouds)
        if stages:
            console.print(rich_table(stage_table(account), texts=1))
        counts = ", ".join(f"{name} {count}" for name, count in sorted(account.boxes.items())) or "none"
        console.print(
            f"{account.clouds} clouds, {account.points} points; boxes: {counts}; {times_line(account)}",
            highlight=False,
            soft_wrap=True,
        )
        if grid is not None:
            console.print(
                f"the network looked {grid.place}; {100.0 * seen / max(account.points, 1):.0f} % of the "
                "points are there",
                highlight=False,
                soft_wrap=True,
            )
        scores = _track(out, console) if track else []
        console.print(f"written to {out}", highlight=False, soft_wrap=True, markup=False)
    gate.close(lambda: sides_of_scores(scores))


def parse_ahead(ahead: str | None) -> str | None:
    """An axis that points ahead.

    Raises:
        ArgumentError: there is no such axis.
    """
    from scenarios.recorded.clouds.axes import AHEAD

    return None if ahead is None else options.parse_name(ahead, AHEAD, "--ahead")


def parse_method(method: str, score_min: float | None) -> DetectorConfig:
    """The parameters of a detector by its name, or the network of a file.

    Raises:
        ArgumentError: there is no such detector, or it has no scores to leave boxes out by.
    """
    from smartmot.lidar import METHODS, ClassicalConfig, LearnedConfig
    from smartmot.lidar.learned import SHIPPED, shipped_network

    if method.endswith(NETWORK_ENDING) or method in SHIPPED:
        network = (
            shipped_network(method, score_min)
            if method in SHIPPED
            else LearnedConfig(Path(method), "", score_min)
        )
        _ = network.network  # loaded now: what is wrong with it is said before any cloud is read
        return network
    kind = METHODS[options.parse_name(method, (*METHODS, *SHIPPED), "--method")]
    if score_min is None:
        return kind()
    if kind is not ClassicalConfig:
        raise ArgumentError(f"--score-min: all boxes of {method} have score 1; leave it out")
    return ClassicalConfig(least_score=score_min)


def print_notes(notes: Counter[str], clouds: int) -> None:
    """Say on stderr what is to be said of clouds, and of how many."""
    for note, times in notes.items():
        line = f"{note} ({times} clouds)" if clouds > 1 else note
        typer.echo(f"smartmot-eval: {one_line(line)}", err=True)


def _track(out: Path, console: rich.console.Console) -> list[MotScore]:
    """Track what has been written, as `mot` does with its default configuration."""
    from evaluation.progress import study_progress
    from evaluation.studies.mot import run
    from evaluation.studies.mot.tables import score_table, summary
    from smartmot.tracking.configs import tracker_config

    study = run.prepare(out, tracker_config("default"), "csv")
    for note in study.notes:
        console.print(f"note: {note}", highlight=False, soft_wrap=True)
    with study_progress(console) as progress:
        result = run.carry_out(study, out, None, ("distance",), False, False, progress)
    console.print(summary(study.data, result.tracked), highlight=False, soft_wrap=True)
    if result.scores:
        console.print(score_table(result.scores, "distance"), "")
    return result.scores
