"""A detector's profile from recordings without labels: its rate, its scores, the noise of its tracks."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.studies.mot.run import track_dataset
from evaluation.studies.mot.score_scale import with_score_scale
from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset
from smartmot.filters.motion_models import table
from smartmot.tracking.configs import tracker_config
from smartmot.tracking.profile import CategoryProfile, DetectorProfile
from smartmot.tracking.settings import ReportConfig
from smartmot.types import CATEGORIES, FloatArray

LEAST_TRIPLES = 100
"""Fewer tell nothing: the median of 100 is known to 6 %."""

_QUICK_S = 0.2
"""Over so short a time nobody accelerates by more than the noise: 2 m/s2 move by 4 cm."""

_STANDING_MPS = 0.5
"""Over longer times only what stands tells the noise."""

_MEDIAN = math.sqrt(2.0 * math.log(2.0))
"""Median length of a vector of two normal variables of variance 1 (Rayleigh distribution)."""


def profile_of(data: Dataset, name: str) -> DetectorProfile:
    """The profile of the detector that made some recordings.

    The noise is that of three detections of a track in successive frames: the middle one lies off the line
    between the others by sqrt(1 + w^2 + (1 - w)^2) times the noise, w being its share of the time. The median
    resists wrong matches.

    Args:
        data: The recordings.
        name: For the profile.

    Raises:
        DatasetError: There are no detections, or no time between frames.
    """
    spacing = [np.diff(sequence.stamp_s) for sequence in data.sequences]
    steps_s = np.concatenate([np.zeros(0), *spacing])
    if not len(steps_s) or not any(len(sequence.detections) for sequence in data.sequences):
        raise DatasetError("--profile: needs detections in two frames or more")
    config = with_score_scale(tracker_config("default"), data, "file")
    seen = replace(config, report=ReportConfig(detected_boxes=True, tentative=False, coasted_s=0.0))
    tracked = track_dataset(data, seen)
    assert config.score_reference is not None
    reference = table(config.score_reference)
    categories = {}
    for code, category in enumerate(CATEGORIES):
        count = sum(int((s.detections.category == category).sum()) for s in data.sequences)
        if count:
            offsets = np.concatenate([_offsets(each, category) for each in tracked])
            sigma = float(np.median(offsets)) / _MEDIAN if len(offsets) >= LEAST_TRIPLES else None
            categories[category] = CategoryProfile(count, float(reference[code]), sigma or None)
    return DetectorProfile(name, float(1.0 / np.median(steps_s)), categories)


def _offsets(tracked: TrackedSequence, category: str) -> FloatArray:
    """(T,) distances of a detection from the line between its neighbours, per metre of noise."""
    tracks = tracked.tracks
    rows = np.flatnonzero((tracks.category == category) & (tracked.coasted_s <= 0.0))
    rows = rows[np.lexsort((tracks.frame[rows], tracks.object_id[rows]))]
    if len(rows) < 3:
        return np.zeros(0)
    frame, center = tracks.frame[rows], tracks.center_m[rows]
    same = tracks.object_id[rows][2:] == tracks.object_id[rows][:-2]
    same &= frame[2:] - frame[:-2] == 2
    stamp = tracked.sequence.stamp_s[frame]
    span_s = np.where(same, stamp[2:] - stamp[:-2], np.inf)
    share = np.where(same, (stamp[1:-1] - stamp[:-2]) / span_s, 0.5)
    gone = np.linalg.norm(center[2:] - center[:-2], axis=1)
    same &= (0.5 * span_s <= _QUICK_S) | (gone < _STANDING_MPS * span_s)
    between = (1.0 - share)[:, None] * center[:-2] + share[:, None] * center[2:]
    factor = np.sqrt(1.0 + share**2 + (1.0 - share) ** 2)
    offsets: FloatArray = (np.linalg.norm(center[1:-1] - between, axis=1) / factor)[same]
    return offsets


def write_profile(data: Dataset, path: Path) -> DetectorProfile:
    """Estimate a profile and write it; its name is that of the file.

    Raises:
        ArgumentError: The file cannot be written, or does not end in .json.
        DatasetError: There are no detections, or no time between frames.
    """
    if path.suffix.lower() != ".json":
        raise ArgumentError(f"--profile: {path} must end in .json")
    profile = profile_of(data, path.stem)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        profile.save(path)
    except OSError as error:
        raise ArgumentError(f"--profile: cannot write {path}: {error.strerror or error}") from None
    return profile


def described(profile: DetectorProfile, path: Path) -> str:
    """A profile in one line."""
    parts = []
    for category, each in profile.categories.items():
        noise = (
            "noise unknown" if each.position_sigma_m is None else f"{each.position_sigma_m:.2f} m of noise"
        )
        parts.append(f"{category} {each.reference_score:.3g}, {noise}")
    return (
        f"profile {path}: {profile.rate_hz:.3g} Hz; score of a sure detection and noise: {'; '.join(parts)}"
    )
