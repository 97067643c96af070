"""The study of recorded data: read, filter by a map, track, compare with labels, forecast, draw."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

from evaluation.errors import ArgumentError
from evaluation.metrics.forecast_quality import ForecastScore
from evaluation.metrics.matching import compare
from evaluation.metrics.mot import MotScore, evaluate
from evaluation.progress import Progress
from evaluation.studies.mot.detectors import detector_notes, detectors_of
from evaluation.studies.mot.film import Film
from evaluation.studies.mot.forecasts import MODELS, SHIPPED, carried_on, motions, score_forecasts
from evaluation.studies.mot.lanes import LaneForecast, require_cover
from evaluation.studies.mot.map_filter import filter_by_map
from evaluation.studies.mot.notes import notes_on, unscored_categories
from evaluation.studies.mot.offline import OFFLINE, offline_config, with_hindsight
from evaluation.studies.mot.score_scale import scale_notes, with_score_scale
from evaluation.studies.mot.tables import TRACK_FORMATS, write_forecasts, write_scores, write_tracks
from evaluation.studies.mot.tracking import TrackedSequence, track_sequence
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, labels_as_detections, log_odds
from scenarios.recorded.formats import Reading, read_dataset
from scenarios.recorded.maps.drive_map import DriveMap, load_drive_map, map_of
from smartmot.forecast import ForecastConfig
from smartmot.plugins import Plugin
from smartmot.tracking.configs import forecast_of
from smartmot.tracking.fusion.fused import FusedTracker
from smartmot.tracking.own import ObjectTracker, own
from smartmot.tracking.profile import DetectorProfile
from smartmot.tracking.tracker import Tracker, TrackerConfig
from smartmot.types import CATEGORIES

NEEDS_MAP = "--filter map: needs --map FILE (.xodr, or a map of Argoverse 2)"

OF_VELOCITY = ("cv", "ctrv", SHIPPED)
"""Forecasts that need no more than the velocity and turn rate that every tracker tells."""


@dataclass(frozen=True, slots=True, eq=False)
class MotStudy:
    """What is studied and how.

    Args:
        data: The recordings.
        config: Settings of the tracker, or one of the user's own.
        network: The map, in the frame of the data; None: there is none.
        filtered: Whether the map chose the detections.
        notes: What a user should know about them, a line each.
        detectors: Profiles by name where several detectors report; empty: one does.
    """

    data: Dataset
    config: TrackerConfig | Plugin
    network: DriveMap | None
    filtered: bool
    notes: tuple[str, ...]
    detectors: Mapping[str, DetectorProfile | None] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class MotResult:
    """What a study came to.

    Args:
        tracked: The sequences with their tracks.
        tracking_s: Processor time of the tracker.
        scores: Accuracy; empty without labels.
        forecasts: Quality of forecasts; empty without labels, or if they are not asked for.
        written: The files.
        with_hindsight: The sequences with smoothed tracks whose gaps are filled; empty unless asked for.
        offline_scores: Their accuracy.
    """

    tracked: list[TrackedSequence]
    tracking_s: float
    scores: list[MotScore]
    forecasts: list[ForecastScore]
    written: list[Path]
    with_hindsight: list[TrackedSequence] = field(default_factory=list)
    offline_scores: list[MotScore] = field(default_factory=list)


def prepare(
    folder: Path,
    config: TrackerConfig | Plugin,
    form: str | None = None,
    names: str | None = None,
    map_file: Path | None = None,
    by_map: bool = False,
    columns: Reading | None = None,
    scores: str = "file",
    profiles: Mapping[str, DetectorProfile] | None = None,
) -> MotStudy:
    """Read recordings, and choose from them.

    Args:
        folder: Where they are.
        config: Settings of the tracker, or one of the user's own.
        form: Their format; None: what the files look like.
        names: Only these sequences, comma-separated; None: all.
        map_file: OpenDRIVE file, or vector map; None: the recording's own, if it has one.
        by_map: Keep only what is on lanes that matter to the vehicle.
        columns: What the columns of a table mean, or which topics of a bag are read; None: ours, all.
        scores: Where relative thresholds on scores have their scale from, one of `score_scale.SCALES`.
        profiles: What is known of the detectors, by the names in the data; None: nothing.

    Raises:
        ArgumentError: There is no map to keep it by, or profiles are given to a tracker of the user's own.
        DatasetError: A file is wrong, a sequence is missing, or the map does not cover the data.
    """
    data = labels_as_detections(chosen(read_dataset(folder, form, columns), names))
    map_path = map_of(data.sequences, map_file)
    network = None if map_path is None else load_drive_map(map_path)
    notes = list(data.notes)
    if by_map:
        if network is None:
            raise ArgumentError(NEEDS_MAP)
        filtered = filter_by_map(data, network)
        data = filtered.data
        notes.append(f"{filtered.dropped} detections outside the monitored lanes left out")
        if filtered.off_map:
            notes.append(f"{filtered.off_map} frames off the map: everything kept in them")
    elif network is not None:
        for sequence in data.sequences:
            require_cover(network, sequence.detections.center_m, f"detections of sequence {sequence.name}")
    detectors: Mapping[str, DetectorProfile | None] = {}
    if profiles and not isinstance(config, TrackerConfig):
        raise ArgumentError("--detectors: a tracker of your own gets all boxes as they are; leave it out")
    if isinstance(config, TrackerConfig):
        detectors = detectors_of(data, scores, profiles or {})
        config = with_score_scale(config, data, scores)
        notes += detector_notes(data, detectors) if detectors else scale_notes(config, data)
    # of several detectors, what is weak is counted for each as it is tracked
    notes += unscored_categories(data) if detectors else notes_on(data, config)
    return MotStudy(data, config, network, by_map, tuple(notes), detectors)


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


def carry_out(
    study: MotStudy,
    out: Path,
    forms: Iterable[str] | None,
    similarities: Sequence[str],
    best_threshold: bool,
    with_forecasts: bool,
    progress: Progress,
    offline: bool = False,
) -> MotResult:
    """Track, write, compare with the labels if there are any.

    Args:
        study: What is studied.
        out: Folder for tracks and tables.
        forms: Formats of the tracks; None: CSV and that of the data.
        similarities: distance, iou.
        best_threshold: See `evaluation.metrics.mot.evaluate`.
        with_forecasts: Whether to score forecasts.
        progress: Is told how far the study has come.
        offline: Whether to smooth the tracks as well, and fill their gaps, in a folder of their own.

    Raises:
        ArgumentError: A file cannot be written, or the tracks cannot be smoothed.
        DatasetError: The tracker refuses a frame.
    """
    data = study.data
    if offline:
        offline_config(study.config, data)  # what cannot be smoothed is refused at once
    progress.begin("tracking", data.frame_count)
    start_s = time.thread_time()  # without the thread that draws the bar
    tracked = track_dataset(data, study.config, progress.done, study.detectors)
    tracking_s = time.thread_time() - start_s
    forms = forms or [form for form in dict.fromkeys((data.kind, "csv")) if form in TRACK_FORMATS]
    written = write_tracks(out, data, tracked, forms, use_map=study.filtered)
    scores: list[MotScore] = []
    forecasts: list[ForecastScore] = []
    if any(sequence.labels is not None for sequence in data.sequences):
        categories = labelled_categories(tracked)
        progress.begin("scoring", len(categories) * len(similarities))
        scores = score_tracks(tracked, similarities, best_threshold, progress.done)
        written.append(write_scores(out, scores))
        if with_forecasts:
            along_lanes = LaneForecast(study.network).along_lanes if study.network is not None else None
            by_model = _tracked_by_model(study, tracked, progress)
            forecast = ForecastConfig()
            if isinstance(study.config, TrackerConfig):
                forecast = forecast_of(study.config)
            forecasts = score_forecasts(by_model, categories, forecast, along_lanes)
            written.append(write_forecasts(out, forecasts))
    result = MotResult(tracked, tracking_s, scores, forecasts, written)
    if not offline:
        return result
    return _with_offline(study, out / OFFLINE, forms, similarities, best_threshold, progress, result)


def _with_offline(
    study: MotStudy,
    out: Path,
    forms: Iterable[str],
    similarities: Sequence[str],
    best_threshold: bool,
    progress: Progress,
    online: MotResult,
) -> MotResult:
    """The result with tracks that know the whole recording, written and scored apart from the online ones."""
    config = offline_config(study.config, study.data)
    progress.begin("smoothing", study.data.frame_count)
    matched = track_dataset(study.data, config, progress.done, study.detectors, hindsight=True)
    assert isinstance(study.config, TrackerConfig)
    shown = replace(config, report=study.config.report)
    tracked = [with_hindsight(each, shown, bool(study.detectors)) for each in matched]
    if study.data.log_odds:
        tracked = [_in_log_odds(each) for each in tracked]
    written = write_tracks(out, study.data, tracked, forms, use_map=study.filtered)
    scores: list[MotScore] = []
    if online.scores:
        scores = score_tracks(tracked, similarities, best_threshold)
        written.append(write_scores(out, scores))
    return replace(online, written=[*online.written, *written], with_hindsight=tracked, offline_scores=scores)


def track_dataset(
    data: Dataset,
    config: TrackerConfig | Callable[[], ObjectTracker],
    done: Callable[[], None] = lambda: None,
    detectors: Mapping[str, DetectorProfile | None] | None = None,
    hindsight: bool = False,
) -> list[TrackedSequence]:
    """Track every sequence with a new tracker; scores of the tracks are in the detector's scale.

    Args:
        data: The recordings.
        config: Settings of the tracker, or what makes one of your own.
        done: Called after every frame.
        detectors: What is known of several detectors, by name (`detectors.detectors_of`); None: there is one.
        hindsight: See `track_sequence`.

    Raises:
        DatasetError: The tracker refuses a frame.
        PluginError: A tracker of the user's own fails.
    """
    tracked = []
    for sequence in data.sequences:
        tracker: Tracker | FusedTracker | ObjectTracker
        if not isinstance(config, TrackerConfig):
            tracker = own(config)
        else:
            tracker = FusedTracker(config, detectors) if detectors else Tracker(config)
        each = track_sequence(sequence, tracker, done, hindsight)
        # smoothing compares scores with thresholds: they become log odds after it
        tracked.append(_in_log_odds(each) if data.log_odds and not hindsight else each)
    return tracked


def _in_log_odds(tracked: TrackedSequence) -> TrackedSequence:
    """The tracks with scores as log odds, which the detector gave."""
    return replace(tracked, tracks=replace(tracked.tracks, score=log_odds(tracked.tracks.score)))


def labelled_categories(tracked: Sequence[TrackedSequence]) -> list[str]:
    """Categories of which there are labels that count and detections, in the order of `CATEGORIES`."""
    labelled: set[str] = set()
    detected: set[str] = set()
    for each in tracked:
        detected |= set(each.sequence.detections.category.tolist())
        labels = each.sequence.labels
        if labels is not None:
            labelled |= set(labels.category[~labels.ignored].tolist())
    return [name for name in CATEGORIES if name in labelled & detected]


def score_tracks(
    tracked: Sequence[TrackedSequence],
    similarities: Iterable[str],
    best_threshold: bool = True,
    done: Callable[[], None] = lambda: None,
) -> list[MotScore]:
    """Accuracy of the tracks of labelled sequences, per similarity and category.

    Args:
        tracked: All sequences; those without labels are left out.
        similarities: distance, iou.
        best_threshold: See `evaluate`.
        done: Called after every similarity and category.
    """
    labelled = [each for each in tracked if each.sequence.labels is not None]
    scores: list[MotScore] = []
    for similarity in similarities:
        for category in labelled_categories(labelled):
            compared = {
                each.sequence.name: compare(each.sequence, each.tracks, category, similarity)
                for each in labelled
            }
            scores += evaluate(compared, category, similarity, best_threshold)
            done()
    return scores


def _tracked_by_model(
    study: MotStudy, tracked: list[TrackedSequence], progress: Progress
) -> dict[str, list[TrackedSequence]]:
    """The tracks that each model's forecasts start from: ours with its filter, another's as they are."""
    config = study.config
    if not isinstance(config, TrackerConfig):
        return dict.fromkeys(OF_VELOCITY, tracked)
    progress.begin("forecasting", study.data.frame_count * (len(MODELS) - 1))
    return {SHIPPED: tracked} | {
        name: tracked
        if model == config.motion
        else track_dataset(study.data, replace(config, motion=model), progress.done, study.detectors)
        for name, model in motions(config.motion).items()
    }


def film(study: MotStudy, tracked: TrackedSequence, span: slice) -> Film:
    """What to draw of a sequence: the forecast of its tracker's own model, along the lanes of the map.

    Raises:
        ArgumentError: The sequence has none of the frames.
    """
    frames = range(len(tracked.sequence))[span]
    if not frames:
        raise ArgumentError(f"--frames: sequence {tracked.sequence.name} has {len(tracked.sequence)} frames")
    carry = carried_on("ctrv")
    if isinstance(study.config, TrackerConfig):
        kind = type(study.config.motion)
        carry = carried_on(next((name for name, model in MODELS.items() if type(model) is kind), "ctrv"))
    if study.network is not None:
        carry = LaneForecast(study.network).first(carry)
    return Film(tracked, carry, frames, study.network)
