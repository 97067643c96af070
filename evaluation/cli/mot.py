"""`smartmot-eval mot`: recorded detections, tracked and scored."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from evaluation.cli import options
from evaluation.cli.call.effects import With, refuse_idle
from evaluation.cli.output import parse_gate, results_folder
from evaluation.errors import ArgumentError

if TYPE_CHECKING:
    import rich.console

    from evaluation.studies.mot.run import MotResult, MotStudy
    from smartmot.tracking.profile import DetectorProfile

EXAMPLES = options.examples(
    "`smartmot-eval mot kitti/training --out results/mot`",
    "`smartmot-eval mot nuscenes/detections.json --config centerpoint --write nuscenes`",
    "`smartmot-eval mot my_csv_folder --gif tracks.gif --sequence 0001`",
    "`smartmot-eval mot my_csv_folder --filter map --map town.xodr`",
    "`smartmot-eval mot 00_tracks.csv --frame-rate 25 --columns x_m=xCenter,y_m=yCenter,yaw_deg=heading,"
    "length_m=length,width_m=width,track_id=trackId`",
    "`smartmot-eval mot argoverse2/7fab2350 --filter map`",
    "`smartmot-eval mot kitti/training --config my_tracker:MyTracker`",
    "`smartmot-eval mot my_csv_folder --scores running`",
    "`smartmot-eval mot my_csv_folder --profile my_detector.json`",
    "`smartmot-eval mot my_csv_folder --offline`",
    "`smartmot-eval mot kitti/training --config my_tracker:MyTracker --fail-on 'car/hota<80,id_switches>20'`",
    "`smartmot-eval mot my_csv_folder --detectors lidar=lidar.json,camera=camera.json`",
    "Formats: docs/formats.md. Metrics (pip install 'smartmot[metrics]') and files written: docs/mot.md.",
)

EFFECTS = (With(("frames",), ("gif", "video")),)

MOST_LISTED = 6
"""Files that are named at the end."""


def command(
    context: typer.Context,
    directory: Annotated[
        Path, typer.Argument(help="Recorded detections, and labels if any.", metavar="PATH")
    ],
    form: Annotated[
        str | None,
        typer.Option(
            "--format",
            help="kitti, nuscenes, csv, simbev, argoverse, bag; default: as the files look.",
        ),
    ] = None,
    columns: options.ColumnPairs = None,
    frame_rate: options.FrameRate = None,
    topic: options.BagTopic = None,
    odometry: options.BagOdometry = None,
    velocity_frame: options.VelocityFrame = None,
    config: Annotated[
        str,
        typer.Option(
            help="Tracker: default, smartmot, centerpoint, ab3dmot, imm, ukf, default for a detector "
            "(profile *.json), or your own, package.module:name."
        ),
    ] = "default",
    scores: Annotated[
        str,
        typer.Option(
            help="Scale of the scores, if thresholds are relative to it: file (all detections), running "
            "(those so far) or fixed (1)."
        ),
    ] = "file",
    detectors: Annotated[
        str | None,
        typer.Option(
            help="Profiles of several detectors (column `detector`): lidar=lidar.json,camera=camera.json.",
            metavar="NAME=FILE,...",
        ),
    ] = None,
    area: Annotated[
        str, typer.Option("--filter", help="none, or map: only what is on lanes that matter to the ego.")
    ] = "none",
    map_file: Annotated[
        Path | None,
        typer.Option(
            "--map",
            help="OpenDRIVE file, Argoverse 2 map or log: for --filter map and forecasts along lanes. "
            "Default: the log's own.",
            metavar="FILE",
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
    offline: Annotated[
        bool,
        typer.Option(
            "--offline",
            help="Also tracks smoothed with hindsight, their gaps filled: folder offline, scored apart.",
        ),
    ] = False,
    profile: Annotated[
        Path | None,
        typer.Option(
            help="Write the detector's profile (rate, scores, noise), estimated from the detections: "
            "for --config, and for --tracker of other commands.",
            metavar="FILE.json",
        ),
    ] = None,
    fail_on: options.FailOn = None,
    junit: options.Junit = None,
    quiet: options.Quiet = False,
) -> None:
    """Track recorded detections, of a data set or a table; score them where there are labels."""
    import rich.console

    from evaluation.metrics.matching import SIMILARITIES
    from evaluation.progress import study_progress
    from evaluation.runs.folder_lock import locked, writable_folder
    from evaluation.studies.mot import run
    from evaluation.studies.mot.profile import described, write_profile
    from evaluation.studies.mot.score_scale import SCALES
    from evaluation.studies.mot.tables import MOT_MEASURES, TRACK_FORMATS, sides_of_scores
    from scenarios.recorded.formats import FORMATS
    from smartmot.plugins import is_plugin, plugin
    from smartmot.tracking.configs import TRACKER_CONFIGS, tracker_config
    from smartmot.tracking.profile import is_profile

    refuse_idle(context, EFFECTS)
    gate = parse_gate("mot", fail_on, junit, lambda: MOT_MEASURES)
    form = options.parse_name(form, FORMATS, "--format") if form else None
    if not is_profile(config):
        config = options.parse_name(config, tuple(TRACKER_CONFIGS), "--config", own=True)
    tracker = plugin(config) if is_plugin(config) else tracker_config(config)
    reading = options.source_reading(columns, frame_rate, topic, odometry, velocity_frame)
    profiles = parse_detectors(detectors)
    by_map = options.parse_name(area, ("none", "map"), "--filter") == "map"
    if map_file is not None and not by_map and not forecast:
        raise ArgumentError("--map: has no effect with --no-forecast; add --filter map")
    similarities = options.parse_names(similarity, SIMILARITIES, "--similarity")
    scale = options.parse_name(scores, SCALES, "--scores")
    best = options.parse_name(threshold, ("best", "none"), "--threshold") == "best"
    forms = options.parse_names(write, TRACK_FORMATS, "--write") if write else None
    span = parse_frames(frames)
    films = [(path, option) for path, option in ((gif, "--gif"), (video, "--video")) if path is not None]
    out = writable_folder(results_folder(context, out))
    console = rich.console.Console(quiet=quiet)
    with locked(out):
        study = run.prepare(directory, tracker, form, sequence, map_file, by_map, reading, scale, profiles)
        for note in study.notes:
            console.print(f"note: {note}", highlight=False, soft_wrap=True, markup=False)
        if profile is not None:
            console.print(described(write_profile(study.data, profile), profile), soft_wrap=True)
        with study_progress(console) as progress:
            result = run.carry_out(study, out, forms, similarities, best, forecast, progress, offline)
            for path, option in films:
                film = run.film(study, result.tracked[0], span)
                progress.begin("drawing", len(film.frames))
                film.write(path, option, progress.done)
        _print(console, study, result, similarities)
        console.print(f"written to {out}: {_listed(result.written)}", highlight=False, soft_wrap=True)
        for path, _ in films:
            console.print(f"film: {path}", highlight=False, soft_wrap=True)
    gate.close(lambda: sides_of_scores(result.scores))


def _print(
    console: rich.console.Console, study: MotStudy, result: MotResult, similarities: Sequence[str]
) -> None:
    """What the study came to."""
    from evaluation.studies.mot.detectors import left_out_lines
    from evaluation.studies.mot.tables import forecast_table, score_table, summary

    frame_count = max(study.data.frame_count, 1)
    console.print(summary(study.data, result.tracked), highlight=False, soft_wrap=True)
    console.print(
        f"tracking: {1e3 * result.tracking_s / frame_count:.2f} ms of processor time per frame",
        highlight=False,
    )
    for line in left_out_lines(result.tracked):
        console.print(line, highlight=False, soft_wrap=True)
    for similarity in similarities if result.scores else ():
        console.print(score_table(result.scores, similarity), "")
        if result.offline_scores:
            console.print(score_table(result.offline_scores, similarity, "Offline tracking accuracy"), "")
    if result.forecasts:
        console.print(forecast_table(result.forecasts), "")
    if all(sequence.labels is None for sequence in study.data.sequences):
        console.print("no labels: tracks only, no metrics", highlight=False)


def _listed(paths: Sequence[Path]) -> str:
    """Names of files, the middle of a long list left out."""
    names = [path.name for path in paths]
    if len(names) > MOST_LISTED:
        names = [names[0], "...", *names[1 - MOST_LISTED :]]
    return ", ".join(names)


def parse_detectors(text: str | None) -> dict[str, DetectorProfile]:
    """`lidar=lidar.json,camera=camera.json` as profiles by name.

    Raises:
        ArgumentError: Not of that form.
        ConfigError: A file is no profile.
    """
    from smartmot.tracking.profile import DetectorProfile

    profiles = {}
    for part in text.split(",") if text else ():
        name, sign, path = (piece.strip() for piece in part.partition("="))
        if not (name and sign and path) or name in profiles:
            raise ArgumentError(f"--detectors: expected NAME=FILE,... with each name once, got {part!r}")
        profiles[name] = DetectorProfile.load(path)
    return profiles


def parse_frames(text: str | None) -> slice:
    """`0..200` as a slice that includes both ends.

    Raises:
        ArgumentError: Not of that form.
    """
    if text is None:
        return slice(None)
    match = re.fullmatch(r"\s*(\d+)\s*\.\.\s*(\d+)\s*", text)
    if match is None or int(match[2]) < int(match[1]):
        raise ArgumentError(f"--frames: expected FIRST..LAST such as 0..200, got {text!r}")
    return slice(int(match[1]), int(match[2]) + 1)
