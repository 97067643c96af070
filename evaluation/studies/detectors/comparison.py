"""The comparison of the thesis: detectors on the same clouds, by class, range and points."""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import time
from collections.abc import Sequence
from dataclasses import asdict, astuple, dataclass, fields, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from evaluation.metrics.detection.from_above import (
    LEAST_OVERLAP,
    ScoredBoxes,
    joined,
    match_from_above,
)
from evaluation.results.files import configuration_json, write_files
from evaluation.results.tables import EMPTY, Table, csv_bytes, markdown_table
from evaluation.runs.execution import FrameTime, frame_time
from evaluation.runs.fingerprint import library_versions, version
from evaluation.studies.detectors.clouds import (
    AROUND_M,
    CloudSet,
    KittiDrive,
    KittiObjects,
    LabelledCloud,
    all_clouds,
)
from evaluation.studies.study import Finished, Study
from smartmot.arrays import BoolArray, FloatArray
from smartmot.lidar import METHODS, BoxDetections, ClassicalConfig, DetectorConfig, detect
from smartmot.lidar.learned import SHIPPED, LearnedConfig, shipped_network
from smartmot.pointcloud import Boxes3D

FARTHEST_M, ASIDE_RAD = 40.0, math.radians(40.0)
"""Of labels and boxes that count. KITTI labels what its camera sees, 40 degrees to each side of straight
ahead (1242 pixels at a focal length of 721), so that boxes elsewhere are neither right nor wrong."""

LEAST_POINTS = 10
"""Of labels that count."""

LEAST_SCORE = 0.3
"""Trackers here drop boxes under it; the thesis' counts are taken there."""

LOWEST_SCORE = 0.02
"""Boxes under it are not asked for: average precision needs the unsure ones, too."""

DETECTORS_JSON = "detectors.json"
"""What a comparison was made with."""

RANGES_M = (0.0, 15.0, 25.0, FARTHEST_M)
POINTS = (LEAST_POINTS, 30, 100, math.inf)
"""Edges of the groups of labels."""


@dataclass(frozen=True, slots=True)
class DetectorScores:
    """What one detector makes of one class in a set of clouds.

    Args:
        clouds, method, category: who and where.
        frames: clouds.
        labels: that count.
        average_precision: at 40 recalls; None without labels.
        true_positives, false_positives, missed, untouched: at `LEAST_SCORE`.
        best_score, best_f1: the score with the greatest F1 on these very clouds; None where no box is right.
        near_labels, mid_labels, far_labels, near_missed, mid_missed, far_missed: by range.
        few_labels, some_labels, many_labels, few_missed, some_missed, many_missed: by points.
    """

    clouds: str
    method: str
    category: str
    frames: int
    labels: int
    average_precision: float | None
    true_positives: int
    false_positives: int
    missed: int
    untouched: int
    best_score: float | None
    best_f1: float | None
    near_labels: int
    mid_labels: int
    far_labels: int
    near_missed: int
    mid_missed: int
    far_missed: int
    few_labels: int
    some_labels: int
    many_labels: int
    few_missed: int
    some_missed: int
    many_missed: int

    @property
    def f1(self) -> float:
        """With misses as labels less true positives; NaN where there is nothing."""
        return _share(2 * self.true_positives, self.false_positives + self.missed)

    @property
    def f1_untouched(self) -> float:
        """With the thesis' count of misses."""
        return _share(2 * self.true_positives, self.false_positives + self.untouched)


def _share(part: int, others: int) -> float:
    return part / (part + others) if part + others else math.nan


@dataclass(frozen=True, slots=True)
class DetectorItem:
    """One class, one detector, one set of clouds."""

    clouds: CloudSet
    method: str
    category: str

    @property
    def key(self) -> str:
        """Hash of everything that determines the scores."""
        values = (
            repr(self.clouds), self.clouds.digest, _told(self.method), self.category, version(),
        )  # fmt: skip
        return hashlib.sha256(json.dumps(values).encode()).hexdigest()


def _told(method: str) -> str:
    """A detector with its parameters; a network by its hash, wherever its file is."""
    config = config_of(method)
    return f"{method} {config.digest}" if isinstance(config, LearnedConfig) else repr(config)


def config_of(method: str) -> DetectorConfig:
    """Parameters of a detector, or shipped network, that reports unsure boxes, too."""
    if method in SHIPPED:
        return shipped_network(method, LOWEST_SCORE)
    kind = METHODS[method]
    return ClassicalConfig(least_score=LOWEST_SCORE) if kind is ClassicalConfig else kind()


@lru_cache(maxsize=1)
def _detected(clouds: CloudSet, method: str) -> tuple[tuple[BoxDetections, ...], FrameTime]:
    """Boxes in all clouds, for every class alike, and the processor time of a cloud."""
    config = config_of(method)
    detections, spent_ms = [], []
    for labelled in all_clouds(clouds):
        start_s = time.thread_time()
        detections.append(detect(labelled.cloud, config))
        spent_ms.append(1e3 * (time.thread_time() - start_s))
    return tuple(detections), frame_time(np.array(spent_ms))


def _in_view(boxes: Boxes3D) -> BoolArray:
    x, y = boxes.center_m[:, :2].T
    inside: BoolArray = (np.hypot(x, y) <= FARTHEST_M) & (np.abs(np.arctan2(y, x)) <= ASIDE_RAD)
    return inside


def match_cloud(
    labelled: LabelledCloud, detections: BoxDetections, category: str
) -> tuple[ScoredBoxes, FloatArray, FloatArray]:
    """One class in one cloud.

    Returns:
        The boxes, and the distance and the points of each label that counts.
    """
    own = (detections.category == category) & _in_view(detections.boxes)
    of_class = labelled.category == category
    labels = labelled.boxes[of_class]
    points = labels.point_counts(labelled.cloud.xyz_m, AROUND_M).astype(np.float64)
    counts = _in_view(labels) & (points >= LEAST_POINTS) & ~labelled.is_neighbour[of_class]
    boxes = detections.boxes[own]
    unlabelled = None if labelled.unlabelled is None else labelled.unlabelled.covers(boxes)
    least = LEAST_OVERLAP[category]
    matched = match_from_above(
        boxes.on_ground, detections.score[own], labels.on_ground, counts, least, unlabelled
    )
    distance_m: FloatArray = np.hypot(labels.center_m[:, 0], labels.center_m[:, 1])
    return matched, distance_m[counts], points[counts]


def scores_of(clouds: CloudSet, method: str, category: str) -> tuple[DetectorScores, FrameTime]:
    """What a detector makes of one class in all clouds of a set."""
    detections, spent = _detected(clouds, method)
    parts = [
        match_cloud(labelled, each, category)
        for labelled, each in zip(all_clouds(clouds), detections, strict=True)
    ]
    boxes = joined([part[0] for part in parts])
    distance_m, points = (np.concatenate([part[k] for part in parts]) for k in (1, 2))
    counts = boxes.counts(LEAST_SCORE)
    best = boxes.best_score
    groups = [
        (values >= low) & (values < high) if high < edges[-1] else values >= low
        for values, edges in ((distance_m, RANGES_M), (points, POINTS))
        for low, high in itertools.pairwise(edges)
    ]
    labels = [int(np.count_nonzero(group)) for group in groups]
    missed = [boxes.counts(LEAST_SCORE, group).missed for group in groups]
    known = len(boxes.label_score) > 0
    scores = DetectorScores(
        clouds.name, method, category, len(detections), len(boxes.label_score),
        boxes.average_precision if known else None,
        counts.true_positives, counts.false_positives, counts.missed, counts.untouched,
        best if math.isfinite(best) else None, boxes.counts(best).f1() if math.isfinite(best) else None,
        *labels[:3], *missed[:3], *labels[3:], *missed[3:],
    )  # fmt: skip
    return scores, spent


@dataclass(frozen=True, slots=True)
class DetectorComparison(Study[DetectorItem, DetectorScores]):
    """Detectors on sets of clouds.

    Args:
        name: of the folder.
        sets: clouds.
        methods: detectors by name.
    """

    name: str
    sets: tuple[CloudSet, ...]
    methods: tuple[str, ...]
    journal = "detectors_"
    table = "runs.csv"
    kind = DetectorScores

    @property
    def needs(self) -> tuple[str, ...]:
        """Folders of recorded clouds."""
        return tuple(
            each.folder.as_posix() for each in self.sets if isinstance(each, KittiObjects | KittiDrive)
        )

    def with_outside(self, outside: Path) -> DetectorComparison:
        """The comparison with its recorded clouds."""
        sets = [
            replace(each, folder=outside / each.folder)
            if isinstance(each, KittiObjects | KittiDrive)
            else each
            for each in self.sets
        ]
        return replace(self, sets=tuple(sets))

    def items(self, folder: Path) -> list[DetectorItem]:
        """By set, detector and class: what is cast and detected is kept for the next."""
        return [
            DetectorItem(each, method, category)
            for each in self.sets
            for method in self.methods
            for category in LEAST_OVERLAP
        ]

    @staticmethod
    def job(item: DetectorItem) -> tuple[DetectorScores, FrameTime]:
        """Carry out one of them."""
        return scores_of(item.clouds, item.method, item.category)

    def is_quick(self, item: DetectorItem) -> bool:
        """The last set of clouds takes a second or so to cast, or is read."""
        return item.clouds == self.sets[-1]

    def write(
        self, folder: Path, items: Sequence[DetectorItem], finished: Finished[DetectorScores]
    ) -> list[Path]:
        """Write tables and settings; times are different in every run and stand by themselves."""
        runs, spent = zip(*(finished[item.key] for item in items), strict=True)
        times = [
            (run.clouds, run.method, time.frames, time.median_ms, time.p95_ms)
            for run, time in zip(runs, spent, strict=True)
            if run.category == next(iter(LEAST_OVERLAP))
        ]
        settings = {
            "sets": [each.title for each in self.sets],
            "methods": {method: _told(method) for method in self.methods},
            "versions": {"smartmot": version(), **library_versions()},
        }
        contents = {
            "runs.csv": csv_bytes([entry.name for entry in fields(DetectorScores)], map(astuple, runs)),
            "times.csv": csv_bytes(("clouds", "method", "frames", "median_ms", "p95_ms"), times),
            DETECTORS_JSON: configuration_json(settings),
            "table.md": markdown_table(score_table(runs)).encode(),
            "groups.md": markdown_table(group_table(runs)).encode(),
        }
        return write_files(folder, contents)


def _text(value: float | None) -> str:
    return EMPTY if value is None or math.isnan(value) else f"{value:.2f}"


def score_table(runs: Sequence[DetectorScores]) -> Table:
    """A line per set, class and detector."""
    rows = [
        (
            run.clouds, run.category, run.method, str(run.labels), _text(run.average_precision),
            str(run.true_positives), str(run.false_positives), str(run.missed), _text(run.f1),
            str(run.untouched), _text(run.f1_untouched), _text(run.best_f1), _text(run.best_score),
        )
        for run in sorted(runs, key=lambda run: _place(runs, run))
    ]  # fmt: skip
    header = (
        "clouds", "class", "detector", "labels", "AP", "TP", "FP", "missed", "F1", "untouched",
        "F1 untouched", "best F1", "at score",
    )  # fmt: skip
    overlaps = ", ".join(f"{value:g} for a {name}" for name, value in LEAST_OVERLAP.items())
    caption = (
        f"IoU from above over {overlaps}; labels with {LEAST_POINTS} points or more, to {FARTHEST_M:g} m and "
        f"{math.degrees(ASIDE_RAD):g} degrees to each side, KITTI's DontCare regions "
        f"left out. AP: average precision at 40 recalls. TP, FP, "
        f"missed and F1 at a score of {LEAST_SCORE:g}. Untouched, the thesis' count of misses: labels that "
        "no box of their class overlaps. The best F1 is that of the score which is best on these very clouds."
    )
    return Table(header, tuple(rows), (), caption)


def _place(runs: Sequence[DetectorScores], run: DetectorScores) -> tuple[int, int]:
    sets = list(dict.fromkeys(each.clouds for each in runs))
    return sets.index(run.clouds), list(LEAST_OVERLAP).index(run.category)


def group_table(runs: Sequence[DetectorScores]) -> Table:
    """Recall by range and by points."""
    groups = ("near", "mid", "far", "few", "some", "many")
    rows = []
    for run in sorted(runs, key=lambda run: _place(runs, run)):
        values = asdict(run)
        cells = []
        for group in groups:
            count = values[f"{group}_labels"]
            cells.append(f"{1.0 - values[f'{group}_missed'] / count:.2f} of {count}" if count else EMPTY)
        rows.append((run.clouds, run.category, run.method, *cells))
    ranges = [f"to {high:g} m" for high in RANGES_M[1:]]
    points = [f"{low:g} points and more" for low in POINTS[:-1]]
    caption = f"Recall at a score of {LEAST_SCORE:g}, and of how many labels."
    return Table(("clouds", "class", "detector", *ranges, *points), tuple(rows), (), caption)
