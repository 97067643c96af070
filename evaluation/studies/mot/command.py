"""The command `smartmot-eval mot`: options, progress, tables."""

from __future__ import annotations

import re
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import rich.console
import rich.progress

from evaluation.cli.options import parse_name, parse_names
from evaluation.errors import ArgumentError
from evaluation.metrics.mot import SIMILARITIES, MotScore
from evaluation.runs.folder_lock import locked, writable_folder
from evaluation.studies.mot import run
from evaluation.studies.mot.film import Film, write_gif, write_video
from evaluation.studies.mot.forecast_quality import (
    MODELS,
    ForecastScore,
    carried_on,
    motions,
    score_forecasts,
)
from evaluation.studies.mot.lanes import LaneForecast, require_cover
from evaluation.studies.mot.map_filter import filter_by_map
from evaluation.studies.mot.tracking import TrackedSequence
from opendrive import RoadNetwork, load_map
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset
from smartmot.plugins import Plugin, is_plugin, plugin
from smartmot.tracking.configs import TRACKER_CONFIGS, tracker_config
from smartmot.tracking.own import limits_of_own, own
from smartmot.tracking.tracker import Tracker, TrackerConfig

OF_VELOCITY = ("cv", "ctrv")
"""Forecasts that need no more than the velocity and turn rate that every tracker tells."""


@dataclass(frozen=True, slots=True)
class MotOptions:
    """What the user asked for; the command's help says what each option means."""

    directory: Path
    form: str | None
    config: str
    area: str
    map_file: Path | None
    out: Path
    write: str | None
    similarity: str
    threshold: str
    sequence: str | None
    gif: Path | None
    video: Path | None
    frames: str | None
    forecast: bool
    quiet: bool


def run_mot(options: MotOptions) -> None:
    """Read, track, write, score, draw.

    Raises:
        ArgumentError: An option or the data cannot be used.
    """
    form = parse_name(options.form, run.FORMATS, "--format") if options.form else None
    name = parse_name(options.config, tuple(TRACKER_CONFIGS), "--config", own=True)
    config = plugin(name) if is_plugin(name) else tracker_config(name)
    parse_name(options.area, ("none", "map"), "--filter")
    similarities = parse_names(options.similarity, SIMILARITIES, "--similarity")
    best = parse_name(options.threshold, ("best", "none"), "--threshold") == "best"
    writers = parse_names(options.write, run.FORMATS, "--write") if options.write else None
    span = parse_frames(options.frames)
    if options.area == "map" and options.map_file is None:
        raise ArgumentError("--filter map: needs --map FILE.xodr")
    out = writable_folder(options.out)
    console = rich.console.Console(quiet=options.quiet)
    with locked(out):
        data = chosen(run.read_dataset(options.directory, form), options.sequence)
        network = load_map(options.map_file) if options.map_file is not None else None
        notes = list(data.notes)
        if options.area == "map":
            assert network is not None
            filtered = filter_by_map(data, network)
            data = filtered.data
            notes.append(f"{filtered.dropped} detections outside the monitored lanes left out")
            if filtered.off_map:
                notes.append(f"{filtered.off_map} frames off the map: everything kept in them")
        elif network is not None:
            for sequence in data.sequences:
                require_cover(
                    network, sequence.detections.center_m, f"detections of sequence {sequence.name}"
                )
        if isinstance(config, TrackerConfig):
            notes += run.weak_categories(data, config)
        limits = (
            Tracker(config).score_limits if isinstance(config, TrackerConfig) else limits_of_own(own(config))
        )
        if limits is not None:
            notes += run.told_dropped(data, limits)
        notes += run.unscored_categories(data)
        for note in notes:
            console.print(f"note: {note}", highlight=False, soft_wrap=True)
        labelled = any(sequence.labels is not None for sequence in data.sequences)
        lanes = LaneForecast(network) if network is not None else None
        with rich.progress.Progress(console=console, transient=True, disable=options.quiet) as progress:
            task = progress.add_task("tracking", total=data.frame_count)

            def begin(description: str, total: int) -> None:
                progress.reset(task, total=total, description=description)

            def done() -> None:
                progress.advance(task)

            start_s = time.thread_time()  # without the thread that draws the bar
            tracked = run.track_dataset(data, config, done)
            used_s = time.thread_time() - start_s
            forms = writers or dict.fromkeys((data.kind, "csv"))
            written = run.write_tracks(out, data, tracked, forms, use_map=options.area == "map")
            scores: list[MotScore] = []
            forecasts: list[ForecastScore] = []
            if labelled:
                categories = run.labelled_categories(tracked)
                begin("scoring", len(categories) * len(similarities))
                scores = run.score_tracks(tracked, similarities, best, done)
                written.append(run.write_scores(out, scores))
            if labelled and options.forecast:
                if isinstance(config, TrackerConfig):
                    begin("forecasting", data.frame_count * (len(MODELS) - 1))
                tracked_by_model = _tracked_by_model(data, config, tracked, done)
                along_lanes = lanes.along_lanes if lanes is not None else None
                forecasts = score_forecasts(tracked_by_model, categories, along_lanes)
                written.append(run.write_forecasts(out, forecasts))
            for path, write_film in ((options.gif, write_gif), (options.video, write_video)):
                if path is not None:
                    film = _film(tracked[0], config, span, lanes, network)
                    begin("drawing", len(film.frames))
                    write_film(film, path, done)
        console.print(str(run.summary(data, tracked)), highlight=False, soft_wrap=True)
        console.print(
            f"tracking: {1e3 * used_s / max(data.frame_count, 1):.2f} ms of processor time per frame",
            highlight=False,
        )
        for similarity in similarities if scores else ():
            console.print(run.score_table(scores, similarity), "")
        if forecasts:
            console.print(run.forecast_table(forecasts), "")
        if not labelled:
            console.print("no labels: tracks only, no metrics", highlight=False)
        console.print(f"written to {out}: {_listed(written)}", highlight=False, soft_wrap=True)
        for path in filter(None, (options.gif, options.video)):
            console.print(f"film: {path}", highlight=False, soft_wrap=True)


def _tracked_by_model(
    data: Dataset,
    config: TrackerConfig | Plugin,
    tracked: list[TrackedSequence],
    done: Callable[[], None],
) -> dict[str, list[TrackedSequence]]:
    """The tracks that each model's forecasts start from: ours with its filter, another's as they are."""
    if not isinstance(config, TrackerConfig):
        return dict.fromkeys(OF_VELOCITY, tracked)
    return {
        name: tracked
        if model == config.motion
        else run.track_dataset(data, replace(config, motion=model), done)
        for name, model in motions(config.motion).items()
    }


def _film(
    tracked: TrackedSequence,
    config: TrackerConfig | Plugin,
    span: slice,
    lanes: LaneForecast | None,
    network: RoadNetwork | None,
) -> Film:
    """What to draw of a sequence.

    Raises:
        ArgumentError: The sequence has none of the frames.
    """
    frames = range(len(tracked.sequence))[span]
    if not frames:
        raise ArgumentError(f"--frames: sequence {tracked.sequence.name} has {len(tracked.sequence)} frames")
    carry = carried_on("ctrv")
    if isinstance(config, TrackerConfig):
        kind = type(config.motion)
        carry = carried_on(next(name for name, model in MODELS.items() if type(model) is kind))
    return Film(tracked, lanes.along_lanes(carry) if lanes is not None else carry, frames, network)


def _listed(paths: list[Path], most: int = 6) -> str:
    """Names of files, the middle of a long list left out."""
    names = [path.name for path in paths]
    if len(names) > most:
        names = [names[0], "...", *names[1 - most :]]
    return ", ".join(names)


def chosen(data: Dataset, names: str | None) -> Dataset:
    """Only the sequences that the user named.

    Raises:
        DatasetError: There is no such sequence.
    """
    if names is None:
        return data
    known = {sequence.name: sequence for sequence in data.sequences}
    wanted = [name.strip() for name in names.split(",") if name.strip()]
    for name in wanted:
        if name not in known:
            raise DatasetError(f"--sequence: no {name!r}; there are: {', '.join(list(known)[:20])}")
    return replace(data, sequences=tuple(known[name] for name in dict.fromkeys(wanted)))


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
