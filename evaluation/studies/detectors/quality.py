"""How many of a data set's road users a detector finds, and what it finds besides."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from evaluation.metrics.detection.from_above import LEAST_OVERLAP, ScoredBoxes, joined
from evaluation.results.tables import Table, fixed
from evaluation.studies.lidar.detect import Account, DetectedCloud
from evaluation.studies.training.quality import FARTHEST_M, match_frame
from smartmot.arrays import BoolArray, FloatArray, IntArray, StrArray
from smartmot.lidar import BoxDetections, DetectorConfig, LearnedConfig, detect
from smartmot.lidar.learned import PillarGrid
from smartmot.lidar.learned.network_file import LEAST_SCORE
from smartmot.pointcloud import Boxes3D, PointCloud

GRID = PillarGrid()
"""Labels and boxes outside do not count, whatever the detector: so all are counted alike."""


@dataclass(frozen=True, slots=True)
class QualityOptions:
    """What counts.

    Args:
        least_points: labels with fewer points count neither way.
        range_m: from and to, of the labels and boxes that count; those outside count neither way.
    """

    least_points: int = 5
    range_m: tuple[float, float] = (0.0, FARTHEST_M)


@dataclass(frozen=True, slots=True, eq=False)
class Truth:
    """A cloud and what is in it.

    Args:
        cloud: sensor's frame.
        boxes: T boxes of road users, in that frame.
        category: (T,) names out of `smartmot.types.CATEGORIES`.
        unlabelled: says of boxes which lie where nothing is labelled; None: none.
    """

    cloud: PointCloud
    boxes: Boxes3D
    category: StrArray
    unlabelled: Callable[[Boxes3D], BoolArray] | None = None


def measured_quality(
    frames: Iterable[Truth],
    config: DetectorConfig,
    asked: QualityOptions,
    done: Callable[[int, int | None], None] = lambda k, n: None,
) -> tuple[dict[str, ScoredBoxes], Account]:
    """By class, a detector's boxes against the labels; and the times of all frames.

    Raises:
        DatasetError: a frame cannot be read.
        ConfigError: a network cannot be loaded.
    """
    parts: dict[str, list[ScoredBoxes]] = {n: [] for n in LEAST_OVERLAP}
    account = Account()
    for frame in frames:
        start_s = time.thread_time()
        made = detect(frame.cloud, config)
        account.add(DetectedCloud("", frame.cloud, made, time.thread_time() - start_s))
        for name, matched in matched_frame(frame, made, asked).items():
            parts[name].append(matched)
        done(account.clouds, None)
    return {name: joined(part) for name, part in parts.items() if part}, account


def least_scores(config: DetectorConfig) -> dict[str, float]:
    """By class, the least score of boxes that count: what a network says, else `LEAST_SCORE`."""
    if not isinstance(config, LearnedConfig):
        return dict.fromkeys(LEAST_OVERLAP, LEAST_SCORE)
    own = dict(zip(config.network.decoder.classes, config.least_scores.tolist(), strict=True))
    return {name: own.get(name, LEAST_SCORE) for name in LEAST_OVERLAP}


def matched_frame(frame: Truth, made: BoxDetections, asked: QualityOptions) -> dict[str, ScoredBoxes]:
    """By class, detections of a frame against its labels."""
    labels = frame.boxes
    counts: IntArray = labels.point_counts(frame.cloud.xyz_m, 0.05)
    # farther or nearer labels are as those with too few points: whoever finds them is not wrong
    counts = np.where(_within(labels.center_m, asked.range_m), counts, -1)
    unlabelled = ~_within(made.boxes.center_m, asked.range_m)
    if frame.unlabelled is not None:
        unlabelled |= frame.unlabelled(made.boxes)
    return {
        name: match_frame(
            name, made.boxes, made.score, made.category, labels, frame.category, counts,
            asked.least_points, GRID, unlabelled,
        )
        for name in LEAST_OVERLAP
    }  # fmt: skip


def _within(center_m: FloatArray, range_m: tuple[float, float]) -> BoolArray:
    distance = np.hypot(*center_m[:, :2].T)
    inside: BoolArray = (distance >= range_m[0]) & (distance <= range_m[1])
    return inside


def quality_table(
    boxes: dict[str, ScoredBoxes], least_score: Mapping[str, float], asked: QualityOptions
) -> Table:
    """Right, false and missed boxes of each class at its least score, and the best F1 at any."""
    rows = []
    for name, each in boxes.items():
        least = least_score[name]
        counts = each.counts(least)
        right, false = counts.true_positives, counts.false_positives
        f1, at = each.best() if each.labels else (math.nan, math.nan)
        rows.append(
            (
                name,
                f"{LEAST_OVERLAP[name]:g}",
                fixed(least, 2),
                str(each.labels),
                str(right),
                str(false),
                fixed(right / (right + false) if right + false else math.nan, 3),
                fixed(right / each.labels if each.labels else math.nan, 3),
                fixed(each.f1(least) if each.labels else math.nan, 3),
                fixed(f1, 3),
                fixed(at, 2),
            )
        )
    low, high = asked.range_m
    caption = (
        f"Boxes of at least the score; overlap from above; labels with {asked.least_points} points or "
        f"more, {low:g} to {high:g} m away, ahead and at most {-GRID.left_m[0]:g} m aside. The best F1 is "
        "that of the least score that suits these very frames."
    )
    header = (
        "class",
        "IoU",
        "score",
        "labels",
        "right",
        "false",
        "precision",
        "recall",
        "F1",
        "best F1",
        "at score",
    )
    return Table(header, tuple(rows), (), caption)
