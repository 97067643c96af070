"""What the study of recorded data writes and shows: files of tracks, tables of scores, a summary."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import astuple
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.metrics.forecast_quality import FORECAST_COLUMNS, HORIZONS_S, ForecastScore
from evaluation.metrics.mot import SCORE_COLUMNS, MotScore
from evaluation.results.files import METRICS_CSV, write_whole
from evaluation.results.gates import Side
from evaluation.results.tables import Table, csv_bytes, rich_table
from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.errors import DatasetError
from scenarios.recorded.csv_files import tracks_text
from scenarios.recorded.dataset import Dataset
from scenarios.recorded.kitti import tracking_text
from scenarios.recorded.nuscenes import submission_text

if TYPE_CHECKING:
    import rich.table

FORECAST_CSV, TRACKS_CSV = "forecast.csv", "tracks.csv"
TRACKS_NUSCENES = "tracks_nuscenes.json"
TRACK_FORMATS = ("kitti", "nuscenes", "csv")
"""What tracks are written in."""


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
        DatasetError: Two sequences would be written to one file.
    """
    parts = [(each.sequence, each.tracks) for each in tracked]
    written = []
    for form in forms:
        if form == "kitti":
            _require_own_files(data)
            texts = {f"{_file_name(part[0].name)}.txt": tracking_text(*part) for part in parts}
        elif form == "csv":
            texts = {TRACKS_CSV: tracks_text(parts, [each.existence for each in tracked])}
        else:
            texts = {TRACKS_NUSCENES: submission_text(parts, data.kind == "nuscenes", use_map)}
        written += [_write(folder / name, text.encode()) for name, text in texts.items()]
    return written


def _require_own_files(data: Dataset) -> None:
    """See that no two sequences would be written to one file."""
    first: dict[str, str] = {}
    for sequence in data.sequences:
        namesake = first.setdefault(_file_name(sequence.name), sequence.name)
        if namesake != sequence.name:
            raise DatasetError(
                f"sequences {namesake!r} and {sequence.name!r} have the same file name; write csv or nuscenes"
            )


def _file_name(sequence: str) -> str:
    """A sequence's name without what would lead to another folder, or is no name of a file."""
    return "".join("_" if c in "/\\" or not c.isprintable() else c for c in sequence)


def _write(path: Path, content: bytes) -> Path:
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        write_whole(path, content)
    except OSError as error:
        raise ArgumentError(
            f"{path}: cannot be written ({error.strerror or error}); choose another --out"
        ) from None
    return path


def write_rows(path: Path, columns: Sequence[str], rows: Iterable[Any]) -> Path:
    """Write dataclasses as CSV, with six digits; NaN becomes an empty field."""
    return _write(path, csv_bytes(columns, (map(_cell, astuple(row)) for row in rows)))


def _cell(value: object) -> str:
    if isinstance(value, float):
        return "" if math.isnan(value) else f"{value:.6g}"
    return str(value)


def write_scores(folder: Path, scores: Iterable[MotScore]) -> Path:
    """Write `metrics.csv`."""
    return write_rows(folder / METRICS_CSV, SCORE_COLUMNS, scores)


def write_forecasts(folder: Path, scores: Iterable[ForecastScore]) -> Path:
    """Write `forecast.csv`."""
    return write_rows(folder / FORECAST_CSV, FORECAST_COLUMNS, scores)


MOT_MEASURES = tuple(name for name in SCORE_COLUMNS if name not in ("sequence", "category", "similarity"))
"""Of a category over all sequences, for `--fail-on`."""


def sides_of_scores(scores: Iterable[MotScore]) -> list[Side]:
    """What each category came to over all sequences, with `MOT_MEASURES`; none without labels."""
    return [
        Side(score.category, {name: getattr(score, name) for name in MOT_MEASURES}, score.similarity)
        for score in scores
        if score.sequence == "all"
    ]


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


def score_table(
    scores: Iterable[MotScore], similarity: str, name: str = "Tracking accuracy"
) -> rich.table.Table:
    """Accuracy over all sequences, for the terminal."""
    rows = [
        tuple(_shown(getattr(score, name)) for name in _SHOWN)
        for score in scores
        if score.sequence == "all" and score.similarity == similarity
    ]
    rule = "centres at most 2 m apart" if similarity == "distance" else "overlap on the ground"
    title = f"{name} in %, match: {rule}"
    return rich_table(Table(tuple(_SHOWN.values()), tuple(rows)), title, texts=1)


def forecast_table(scores: Iterable[ForecastScore]) -> rich.table.Table:
    """Forecast quality over all sequences, for the terminal: one line per category, objects and model."""
    by_line: dict[tuple[str, ...], list[ForecastScore]] = {}
    for score in scores:
        way = f"{score.model} map" if score.with_map else score.model
        by_line.setdefault((score.category, score.objects, way), []).append(score)
    header = ["category", "objects", "model"]
    header += [f"{name} {h:g}s" for name in ("ADE", "FDE") for h in HORIZONS_S]
    header += [f"minFDE6 {HORIZONS_S[-1]:g}s"]
    header += [f"miss {h:g}s" for h in HORIZONS_S[1:]] + [f"in95 {HORIZONS_S[-1]:g}s"]
    rows = []
    for key, horizons in by_line.items():
        errors = [_fixed(s.ade_m, 2) for s in horizons] + [_fixed(s.fde_m, 2) for s in horizons]
        shares = [_fixed(s.miss_rate_percent, 1) for s in horizons[1:]]
        errors.append(_fixed(horizons[-1].min_fde_6_m, 2))
        rows.append((*key, *errors, *shares, _fixed(horizons[-1].inside_95_percent, 0)))
    title = "Forecasts: errors in m; misses (over 2 m), true places in the 95 % region in %"
    return rich_table(Table(tuple(header), tuple(rows)), title, texts=3)


def _shown(value: object) -> str:
    return _fixed(value, 2) if isinstance(value, float) else str(value)


def _fixed(value: float, digits: int) -> str:
    """A number for the terminal; a dash where there is none."""
    return "-" if math.isnan(value) else f"{value:.{digits}f}"


def summary(data: Dataset, tracked: Iterable[TrackedSequence]) -> str:
    """What was read and found, in one line."""
    detections = sum(len(sequence.detections) for sequence in data.sequences)
    tracks = sum(len(np.unique(each.tracks.object_id)) for each in tracked)
    return (
        f"{len(data.sequences)} sequences, {data.frame_count} frames, {detections} detections "
        f"({data.rejected} impossible ones rejected), {tracks} tracks"
    )
