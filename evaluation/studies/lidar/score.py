"""Scores of detected boxes by several protocols, as tables."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.metrics.detection import nuscenes
from evaluation.metrics.detection.counts import (
    THESIS_OVERLAP,
    DetectionCounts,
    MatchedDetections,
    match_detections,
)
from evaluation.metrics.detection.frames import in_same_frames
from evaluation.metrics.detection.groups import Group, occlusion_groups, point_groups, range_groups
from evaluation.metrics.detection.kitti import DIFFICULTIES, VIEWS, average_precision
from evaluation.results.tables import EMPTY, Table, fixed
from scenarios.recorded.kitti_objects.labels import ObjectLines, read_objects
from smartmot.types import BoolArray

PROTOCOLS = ("kitti", "thesis", "nuscenes")
SCORED_TYPES = ("Car", "Pedestrian", "Cyclist")
"""Those that KITTI's protocol scores."""


@dataclass(frozen=True, slots=True)
class ScoreOptions:
    """What is scored, and how.

    Args:
        protocol: one of PROTOCOLS.
        type_names: KITTI's types; empty: those of SCORED_TYPES that have labels.
        least_overlap: IoU of a match; None: the protocol's.
        least_score: detections below it are left out; None: none is.
        by: of `groups.GROUPINGS`.
        clouds: folder of clouds, for points.
        calibration: file or folder, for points.
    """

    protocol: str
    type_names: tuple[str, ...] = ()
    least_overlap: float | None = None
    least_score: float | None = None
    by: tuple[str, ...] = ()
    clouds: Path | None = None
    calibration: Path | None = None


@dataclass(frozen=True, slots=True)
class Scores:
    """Tables with their titles, and what the reader has to know."""

    tables: tuple[tuple[str, Table], ...]
    notes: tuple[str, ...]


def score_files(label_path: Path, detection_path: Path, options: ScoreOptions) -> Scores:
    """Score result files against label files.

    Raises:
        DatasetError: a file cannot be read.
        ArgumentError: nothing can be compared, or an option lacks another.
    """
    labels, detections, notes = in_same_frames(
        read_objects(label_path),
        read_objects(detection_path, results=True, scored=options.protocol != "thesis"),
    )
    if options.least_score is not None:
        detections = detections.chosen(detections.score >= options.least_score)
    present = set(labels.type_name.tolist())
    names = options.type_names or tuple(name for name in SCORED_TYPES if name in present)
    missing = [name for name in names if name not in present]
    if missing or not names:
        listed = ", ".join(sorted(present)) or "none"
        raise ArgumentError(
            f"{label_path}: no labels of {', '.join(missing or SCORED_TYPES)}; there are: {listed}"
        )
    others = ~np.isin(detections.type_name, names)
    if others.any():
        kinds = ", ".join(sorted(set(detections.type_name[others].tolist())))
        notes.append(f"{np.count_nonzero(others)} detections of other classes not scored ({kinds})")
    summary = f"{len(labels.frames)} frames, {np.count_nonzero(np.isin(labels.type_name, names))} labels, "
    flat = detections.image_box_px[:, 3] <= detections.image_box_px[:, 1]
    if options.protocol == "kitti" and flat.any():
        notes.append(
            f"{np.count_nonzero(flat)} detections have image boxes without height, which KITTI's rule ignores"
        )
    notes.insert(0, f"{summary}{len(detections) - np.count_nonzero(others)} detections")
    tables = [_TABLES[options.protocol](labels, detections, names, options)]
    tables += [_group_table(labels, detections, names, options, by) for by in options.by]
    return Scores(tuple(tables), tuple(notes))


def _kitti_table(
    labels: ObjectLines, detections: ObjectLines, names: Sequence[str], options: ScoreOptions
) -> tuple[str, Table]:
    results = average_precision(labels, detections, names, options.least_overlap)
    if (labels.image_box_px[:, 3] <= labels.image_box_px[:, 1]).all():
        raise ArgumentError("KITTI's difficulties need the image boxes of the labels, which have no height")
    rows = []
    for start in range(0, len(results), len(DIFFICULTIES)):
        row = results[start : start + len(DIFFICULTIES)]
        first = row[0]
        numbers = [fixed(each.r40 if each.labels else math.nan, 2) for each in row]
        numbers += [fixed(each.r11 if each.labels else math.nan, 2) for each in row]
        rows.append((first.type_name, first.view, f"{first.least_overlap:g}", *numbers))
    counts = [[str(e.labels) for e in results if (e.type_name, e.view) == (n, VIEWS[0])] for n in names]
    listed = "; ".join(f"{name} {', '.join(row)}" for name, row in zip(names, counts, strict=True))
    header = (
        "class",
        "view",
        "IoU",
        *(f"R40 {d}" for d in DIFFICULTIES),
        *(f"R11 {d}" for d in DIFFICULTIES),
    )
    caption = (
        f"Labels that count, {', '.join(DIFFICULTIES)}: {listed}. KITTI's rule reaches 100 with 41 labels or "
        "more; R40 of n labels is (n - 1)/40 at most."
    )
    return "KITTI: average precision in %", Table(header, tuple(rows), caption=caption)


def _thesis_table(
    labels: ObjectLines, detections: ObjectLines, names: Sequence[str], options: ScoreOptions
) -> tuple[str, Table]:
    matched = _matched(labels, detections, options)
    rows = [(name, *_count_cells(matched.counts(*_of_type(matched, (name,))))) for name in names]
    caption = (
        "Missed: labels less true positives; untouched, the thesis' count of misses: labels that no "
        "detection of their class overlaps."
    )
    title = f"True and false positives, IoU in space over {_overlap(options):g}"
    return title, Table(("class", *_COUNT_COLUMNS), tuple(rows), caption=caption)


_COUNT_COLUMNS = (
    "TP", "FP", "missed", "precision", "recall", "F1", "untouched", "recall untouched", "F1 untouched",
)  # fmt: skip


def _count_cells(counts: DetectionCounts, has_false: bool = True) -> tuple[str, ...]:
    """Cells of a line; without false positives neither precision nor F1."""
    nothing = math.nan
    return (
        str(counts.true_positives),
        str(counts.false_positives) if has_false else EMPTY,
        str(counts.missed),
        fixed(counts.precision if has_false else nothing, 4),
        fixed(counts.recall(), 4),
        fixed(counts.f1() if has_false else nothing, 4),
        str(counts.untouched),
        fixed(counts.recall(thesis=True), 4),
        fixed(counts.f1(thesis=True) if has_false else nothing, 4),
    )


def _nuscenes_table(
    labels: ObjectLines, detections: ObjectLines, names: Sequence[str], options: ScoreOptions
) -> tuple[str, Table]:
    results = nuscenes.class_scores(labels, detections, names)
    rows = [
        (
            each.type_name,
            str(each.labels),
            *(fixed(100.0 * value, 2) for value in (*each.ap, each.mean_ap)),
            fixed(each.translation_m, 4),
            fixed(each.scale, 4),
            fixed(each.orientation_rad, 4),
        )
        for each in results
    ]
    columns = np.array(
        [(*r.ap, r.mean_ap, r.translation_m, r.scale, r.orientation_rad) for r in results], dtype=np.float64
    ).mean(axis=0)
    means = [*(fixed(100.0 * value, 2) for value in columns[:5]), *(fixed(v, 4) for v in columns[5:])]
    distances = (f"AP {limit:g} m" for limit in nuscenes.MATCH_DISTANCES_M)
    header = ("class", "labels", *distances, "AP", "ATE (m)", "ASE", "AOE (rad)")
    total = str(sum(each.labels for each in results))
    caption = (
        "No limit of range; velocities and attributes, which the files do not hold, are not scored: no NDS."
    )
    table = Table(header, tuple(rows), (("mean", total, *means),), caption)
    return "nuScenes: average precision in %, errors of true positives", table


_TABLES = {"kitti": _kitti_table, "thesis": _thesis_table, "nuscenes": _nuscenes_table}


def _overlap(options: ScoreOptions) -> float:
    return THESIS_OVERLAP if options.least_overlap is None else options.least_overlap


def _matched(labels: ObjectLines, detections: ObjectLines, options: ScoreOptions) -> MatchedDetections:
    if options.protocol == "nuscenes":
        return nuscenes.matched_at(labels, detections, nuscenes.ERROR_DISTANCE_M)
    return match_detections(labels, detections, _overlap(options))


def _of_type(matched: MatchedDetections, names: Sequence[str]) -> tuple[BoolArray, BoolArray]:
    """Labels and detections of some classes."""
    return np.isin(matched.labels.type_name, names), np.isin(matched.detections.type_name, names)


def _group_table(
    labels: ObjectLines, detections: ObjectLines, names: Sequence[str], options: ScoreOptions, by: str
) -> tuple[str, Table]:
    """Counts of each class by range, points or occlusion."""
    matched = _matched(labels, detections, options)
    rows = []
    for name in names:
        label_mask, detection_mask = _of_type(matched, (name,))
        for group in _groups(matched, options, by):
            own = group.detections
            counts = matched.counts(
                label_mask & group.labels,
                detection_mask if own is None else detection_mask & own,
            )
            if (label_mask & group.labels).any() or (own is not None and (detection_mask & own).any()):
                rows.append((name, group.name, *_count_cells(counts, own is not None)))
    rule = f"IoU in space over {_overlap(options):g}"
    if options.protocol == "nuscenes":
        rule = f"centres within {nuscenes.ERROR_DISTANCE_M:g} m"
    return f"By {by}, {rule}", Table(("class", by, *_COUNT_COLUMNS), tuple(rows))


def _groups(matched: MatchedDetections, options: ScoreOptions, by: str) -> list[Group]:
    if by == "range":
        return range_groups(matched.labels, matched.detections)
    if by == "occlusion":
        return occlusion_groups(matched.labels)
    if options.clouds is None or options.calibration is None:
        raise ArgumentError("--by points: needs --clouds and --calib")
    return point_groups(matched.labels, matched.detections, options.clouds, options.calibration)
