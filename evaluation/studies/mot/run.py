"""The work of `smartmot-eval mot`: read, track, write, compare."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import astuple, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.metrics.mot import SCORE_COLUMNS, MotScore, compare, evaluate
from evaluation.results.files import write_whole
from evaluation.results.notes import MANY_DROPPED
from evaluation.results.tables import csv_bytes
from evaluation.studies.mot.forecast_quality import FORECAST_COLUMNS, HORIZONS_S, ForecastScore
from evaluation.studies.mot.tracking import TrackedSequence, track_sequence
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, log_odds
from scenarios.recorded.kitti import read_kitti, tracking_text
from scenarios.recorded.nuscenes import read_nuscenes, submission_text
from scenarios.recorded.table import DETECTIONS, read_csv, tracks_text
from smartmot.tracking.own import ObjectTracker, own
from smartmot.tracking.tracker import ScoreLimits, Tracker, TrackerConfig
from smartmot.types import CATEGORIES

if TYPE_CHECKING:
    from rich.table import Table

READERS: dict[str, Callable[[Path], Dataset]] = {
    "kitti": read_kitti,
    "nuscenes": read_nuscenes,
    "csv": read_csv,
}
FORMATS = tuple(READERS)
METRICS_CSV, FORECAST_CSV, TRACKS_CSV = "metrics.csv", "forecast.csv", "tracks.csv"
TRACKS_NUSCENES = "tracks_nuscenes.json"

LEAST_SHARE = 0.1
"""Users are told when a smaller share of their detections can start a track; on KITTI it is over a half."""


def read_dataset(folder: Path, form: str | None = None) -> Dataset:
    """Read a folder in a given format, or in the one that its files show.

    Raises:
        DatasetError: The format is not recognised, or a file is missing or wrong.
    """
    if not folder.exists():
        raise DatasetError(f"{folder}: no such folder or file")
    return READERS[form or _recognised(folder)](folder)


def _recognised(folder: Path) -> str:
    """Name of the format."""
    if folder.is_file():
        return "csv" if folder.suffix == ".csv" else "nuscenes"
    if (folder / "detections").is_dir():
        return "kitti"
    if (folder / DETECTIONS).is_file():
        return "csv"
    if any(folder.glob("*.json")):
        return "nuscenes"
    raise DatasetError(
        f"{folder}: no detections/ (kitti), {DETECTIONS} (csv) or *.json (nuscenes) in it; see docs/mot.md"
    )


def weak_categories(data: Dataset, config: TrackerConfig) -> list[str]:
    """What to tell users of a detector whose scores hardly start a track, by category."""
    least = Tracker(config).score_limits.start
    notes = []
    for code, category in enumerate(CATEGORIES):
        found = [s.detections.score[s.detections.category == category] for s in data.sequences]
        score = np.concatenate([np.zeros(0), *found])
        share = float(np.mean(score >= least[code])) if len(score) else 1.0
        if share < LEAST_SHARE:
            notes.append(
                f"{100.0 * share:.0f} % of the {category} detections have a score of {least[code]:g} or more"
                f"{' (as probability)' if data.log_odds else ''}; others start no track: fit the "
                "configuration to the detector (docs/tracking.md)"
            )
    return notes


def told_dropped(data: Dataset, limits: ScoreLimits) -> list[str]:
    """What to tell users of detections under the tracker's score threshold: many of them, or all."""
    counts = [limits.counts(frame) for s in data.sequences for frame in s.frames()]
    dropped, usable = (sum(column) for column in zip(*counts, strict=True)) if counts else (0, 0)
    total = sum(len(s.detections) for s in data.sequences)
    scale = " (as probability)" if data.log_odds else ""
    if total and not usable:
        highest = max(float(s.detections.score.max(initial=0.0)) for s in data.sequences)
        return [
            f"no tracks: none of {total} detections has the score of {float(limits.start.min()):g}{scale} "
            f"that the tracker needs to start one (highest: {highest:.3g}); scale the scores, or give a "
            "configuration with lower thresholds (--config)"
        ]
    if dropped > MANY_DROPPED * total:
        return [f"{dropped} of {total} detections dropped: their scores are under the tracker's threshold"]
    return []


def unscored_categories(data: Dataset) -> list[str]:
    """What to tell users whose labels have categories that the detector never reports."""
    labels = {name for s in data.sequences if s.labels is not None for name in s.labels.category.tolist()}
    found = {name for s in data.sequences for name in s.detections.category.tolist()}
    missing = [name for name in CATEGORIES if name in labels - found and name != "unknown"]
    return [f"labels, but no detections, of {', '.join(missing)}: not scored"] if missing else []


def track_dataset(
    data: Dataset,
    config: TrackerConfig | Callable[[], ObjectTracker],
    done: Callable[[], None] = lambda: None,
) -> list[TrackedSequence]:
    """Track every sequence with a new tracker; scores of the tracks are in the detector's scale.

    Args:
        data: The recordings.
        config: Settings of the tracker, or what makes one of your own.
        done: Called after every frame.

    Raises:
        DatasetError: The tracker refuses a frame.
        PluginError: A tracker of the user's own fails.
    """
    tracked = []
    for sequence in data.sequences:
        tracker = Tracker(config) if isinstance(config, TrackerConfig) else own(config)
        one = track_sequence(sequence, tracker, done)
        if data.log_odds:
            one = replace(one, tracks=replace(one.tracks, score=log_odds(one.tracks.score)))
        tracked.append(one)
    return tracked


def write_tracks(
    folder: Path,
    data: Dataset,
    tracked: Sequence[TrackedSequence],
    forms: Iterable[str],
    use_map: bool = False,
) -> list[Path]:
    """Write the tracks in some formats.

    Args:
        folder: Where to.
        data: What was tracked.
        tracked: Its sequences with their tracks.
        forms: kitti, csv, nuscenes.
        use_map: Whether a map chose the detections, for the header of nuScenes' format.

    Returns:
        What was written.

    Raises:
        ArgumentError: A file cannot be written.
    """
    written = []
    for form in forms:
        if form == "kitti":
            _require_own_files(data)
            written += [
                _write(
                    folder / f"{_file_name(one.sequence.name)}.txt", tracking_text(one.sequence, one.tracks)
                )
                for one in tracked
            ]
        elif form == "csv":
            text = tracks_text((one.sequence, one.tracks) for one in tracked)
            written.append(_write(folder / TRACKS_CSV, text))
        else:
            text = submission_text(
                ((one.sequence, one.tracks) for one in tracked), data.kind == "nuscenes", use_map
            )
            written.append(_write(folder / TRACKS_NUSCENES, text))
    return written


def _require_own_files(data: Dataset) -> None:
    """See that no two sequences would be written to one file."""
    first: dict[str, str] = {}
    for sequence in data.sequences:
        other = first.setdefault(_file_name(sequence.name), sequence.name)
        if other != sequence.name:
            raise DatasetError(
                f"sequences {other!r} and {sequence.name!r} have the same file name; write csv or nuscenes"
            )


def _file_name(sequence: str) -> str:
    """A sequence's name without what would lead to another folder, or is no name of a file."""
    return "".join("_" if c in "/\\" or not c.isprintable() else c for c in sequence)


def _write(path: Path, text: str) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, text.encode())
    except OSError as error:
        raise ArgumentError(
            f"{path}: cannot be written ({error.strerror or error}); choose another --out"
        ) from None
    return path


def labelled_categories(tracked: Sequence[TrackedSequence]) -> list[str]:
    """Categories of which there are labels that count and detections, in the order of `CATEGORIES`."""
    labelled: set[str] = set()
    detected: set[str] = set()
    for one in tracked:
        detected |= set(one.sequence.detections.category.tolist())
        if one.sequence.labels is not None:
            labels = one.sequence.labels
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
    labelled = [one for one in tracked if one.sequence.labels is not None]
    scores: list[MotScore] = []
    for similarity in similarities:
        for category in labelled_categories(labelled):
            compared = {
                one.sequence.name: compare(one.sequence, one.tracks, category, similarity) for one in labelled
            }
            scores += evaluate(compared, category, similarity, best_threshold)
            done()
    return scores


def write_rows(path: Path, columns: Sequence[str], rows: Iterable[Any]) -> Path:
    """Write dataclasses as CSV; NaN becomes an empty field."""
    return _write(path, csv_bytes(columns, (map(_cell, astuple(row)) for row in rows)).decode())


def write_scores(folder: Path, scores: Iterable[MotScore]) -> Path:
    """Write `metrics.csv`."""
    return write_rows(folder / METRICS_CSV, SCORE_COLUMNS, scores)


def write_forecasts(folder: Path, scores: Iterable[ForecastScore]) -> Path:
    """Write `forecast.csv`."""
    return write_rows(folder / FORECAST_CSV, FORECAST_COLUMNS, scores)


def forecast_table(scores: Iterable[ForecastScore]) -> Table:
    """Forecast quality over all sequences, for the terminal: one line per category, objects and model."""
    lines: dict[tuple[str, ...], list[ForecastScore]] = {}
    for score in scores:
        way = f"{score.model} map" if score.with_map else score.model
        lines.setdefault((score.category, score.objects, way), []).append(score)
    header = ["category", "objects", "model"]
    header += [f"{name} {h:g}s" for name in ("ADE", "FDE", "miss") for h in HORIZONS_S]
    rows = []
    for key, three in lines.items():
        errors = [_fixed(s.ade_m, 2) for s in three] + [_fixed(s.fde_m, 2) for s in three]
        rows.append([*key, *errors, *(_fixed(s.miss_rate_percent, 1) for s in three)])
    return rich_table("Forecasts: errors in m, misses (over 2 m) in %", header, rows, texts=3)


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "" if np.isnan(value) else f"{value:.6g}"
    return str(value)


_SHOWN = {
    "category": "category",
    "hota": "HOTA",
    "deta": "DetA",
    "assa": "AssA",
    "mota": "MOTA",
    "motp": "MOTP",
    "idf1": "IDF1",
    "samota": "sAMOTA",
    "amota": "AMOTA",
    "id_switches": "IDs",
    "fragmentations": "Frag",
}


def score_table(scores: Iterable[MotScore], similarity: str) -> Table:
    """Accuracy over all sequences, for the terminal."""
    rule = "centres at most 2 m apart" if similarity == "distance" else "overlap on the ground"
    return rich_table(
        f"Tracking accuracy in %, match: {rule}",
        list(_SHOWN.values()),
        [
            [_shown(getattr(score, name)) for name in _SHOWN]
            for score in scores
            if score.sequence == "all" and score.similarity == similarity
        ],
    )


def _shown(value: object) -> str:
    return _fixed(value, 2) if isinstance(value, float) else str(value)


def _fixed(value: float, digits: int) -> str:
    """A number for the terminal; a dash where there is none."""
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def rich_table(title: str, header: Sequence[str], rows: Sequence[Sequence[str]], texts: int = 1) -> Table:
    """A plain table: the first columns are texts, the others numbers. Only headers break, at spaces."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table as RichTable

    view = RichTable(
        title=title, box=SIMPLE_HEAD, show_edge=False, pad_edge=False, padding=(0, 0), title_justify="left"
    )
    for index, name in enumerate(header):
        width = max(map(len, [*name.split(), *(row[index] for row in rows)]))
        view.add_column(name, justify="right" if index >= texts else "left", width=width)
    for row in rows:
        view.add_row(*row)
    return view


@dataclass(frozen=True, slots=True)
class Summary:
    """What a run says about itself in one line."""

    sequences: int
    frames: int
    detections: int
    rejected: int
    tracks: int

    def __str__(self) -> str:
        return (
            f"{self.sequences} sequences, {self.frames} frames, {self.detections} detections "
            f"({self.rejected} impossible ones rejected), {self.tracks} tracks"
        )


def summary(data: Dataset, tracked: Sequence[TrackedSequence]) -> Summary:
    """Count what was read and found."""
    return Summary(
        sequences=len(data.sequences),
        frames=data.frame_count,
        detections=sum(len(s.detections) for s in data.sequences),
        rejected=data.rejected,
        tracks=sum(len(np.unique(one.tracks.object_id)) for one in tracked),
    )
