"""Whether a data set is what it says: every label holds its points, every frame is in one split."""

from __future__ import annotations

from collections import Counter, defaultdict
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from evaluation.studies.datasets.make import DATASET_JSON
from evaluation.studies.datasets.reading import DatasetFrame, dataset_values, layout_of, read_frames
from scenarios.errors import DatasetError


@dataclass(slots=True)
class Report:
    """What has been found.

    Args:
        layout: of the data set.
        least_points: that every label must hold.
        frames: by split.
        points: in all clouds.
        label_points: points of each label, by category.
        findings: what is wrong, a line each.
    """

    layout: str
    least_points: int
    frames: Counter[str] = field(default_factory=Counter)
    points: int = 0
    label_points: dict[str, list[int]] = field(default_factory=lambda: defaultdict(list))
    findings: list[str] = field(default_factory=list)


def check_dataset(
    folder: Path, least_points: int | None = None, done: Callable[[int, int | None], None] = lambda k, n: None
) -> Report:
    """Read a data set whole.

    Args:
        folder: of the data set.
        least_points: that every label must hold; None: what the data set says of itself, else 1.
        done: takes how many frames have been read.

    Raises:
        DatasetError: it cannot be read.
    """
    frames = read_frames(folder)
    if least_points is None:
        said = dataset_values(folder, DATASET_JSON).get("min_points", 1)
        if type(said) is not int or said < 0:
            raise DatasetError(
                f"{folder / DATASET_JSON}: field 'min_points' must be a whole number, got {said!r}"
            )
        least_points = said
    report = Report(layout_of(folder), least_points)
    split_of_frame: dict[str, str] = {}
    splits_of_scene: dict[str, set[str]] = defaultdict(set)
    for number, frame in enumerate(frames, 1):
        if frame.name in split_of_frame:
            report.findings.append(f"{frame.name}: is in {split_of_frame[frame.name]} and in {frame.split}")
        split_of_frame[frame.name] = frame.split
        if frame.scene:
            splits_of_scene[frame.scene].add(frame.split)
        _add(report, frame)
        done(number, None)
    for scene, splits in splits_of_scene.items():
        if len(splits) > 1:
            report.findings.append(f"{scene}: its frames are in {' and '.join(sorted(splits))}")
    if not split_of_frame:
        report.findings.append("there is no frame")
    return report


def _add(report: Report, frame: DatasetFrame) -> None:
    report.frames[frame.split] += 1
    report.points += len(frame.cloud)
    if not len(frame.cloud):
        report.findings.append(f"{frame.name}: the cloud has no point")
    if frame.dropped:
        report.findings.append(f"{frame.name}: {frame.dropped} points with a value that is not finite")
    try:
        _ = frame.intensity
    except DatasetError as error:
        report.findings.append(str(error))
    counts = frame.point_counts()
    for category, count in zip(frame.labels.category.tolist(), counts.tolist(), strict=True):
        report.label_points[category].append(count)
    for row in np.flatnonzero(counts < report.least_points).tolist():
        report.findings.append(
            f"{frame.name}: label {row} ({frame.labels.kind[row]}) holds {counts[row]} points, "
            f"{report.least_points} at least expected"
        )
    if frame.written_count is not None:
        for row in np.flatnonzero(counts != frame.written_count).tolist():
            report.findings.append(
                f"{frame.name}: label {row} ({frame.labels.kind[row]}) holds {counts[row]} points, and "
                f"{frame.written_count[row]} are written"
            )
