"""Several detectors in one recording: what is known of each, and what to tell the user."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping

import numpy as np

from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, Objects
from smartmot.tracking.profile import CategoryProfile, DetectorProfile
from smartmot.tracking.scores import reference_scores
from smartmot.tracking.settings import CODES
from smartmot.types import CATEGORIES, FloatArray

MOST_LATE_S = 60.0
"""Nobody tracks with boxes of a minute ago: such times are of another clock or unit."""


def detectors_of(
    data: Dataset, scale: str, profiles: Mapping[str, DetectorProfile]
) -> dict[str, DetectorProfile | None]:
    """Profiles of the detectors that the recordings name, by name; empty if they name none.

    Args:
        data: The recordings.
        scale: Where scores have their scale from where there is no profile: one of `score_scale.SCALES`.
        profiles: Those that the user gives.

    Raises:
        DatasetError: A profile is of a detector that is not there, only some boxes name their detector, or
            some arrive later than anybody waits.
    """
    names = sorted({name for s in data.sequences for name in s.detections.detector.tolist()})
    for name in profiles:
        if name not in names:
            there = ", ".join(filter(None, names)) or "none (column `detector` names them)"
            raise DatasetError(f"--detectors: no detector {name!r} in the data; there are: {there}")
    if not any(names):
        return {}
    if "" in names:
        raise DatasetError("column detector: some boxes have none; name the detector of every box")
    for name in names:
        late_s = _lateness_s(data, name)
        if len(late_s) and late_s.max() > MOST_LATE_S:
            raise DatasetError(
                f"column received_s: boxes of {name} arrive up to {late_s.max():.3g} s late, over "
                f"{MOST_LATE_S:g} s; is it in seconds, by the clock of stamp_s?"
            )
        if len(late_s) and late_s.min() < -MOST_LATE_S:
            raise DatasetError(
                f"column received_s: boxes of {name} arrive {-late_s.min():.3g} s before they are measured; "
                "is it in seconds, by the clock of stamp_s?"
            )
    return {name: profiles.get(name) or _from_file(data, name, scale) for name in names}


def _from_file(data: Dataset, name: str, scale: str) -> DetectorProfile | None:
    """A detector's score scale by all its detections, or 1 where scores are fixed; None: as they come."""
    if scale == "running":
        return None
    parts = [_of(s.detections, name) for s in data.sequences]
    code = np.array(
        [CODES[category] for part in parts for category in part.category.tolist()], dtype=np.int64
    )
    reference = reference_scores(code, np.concatenate([part.score for part in parts]))
    counts = np.bincount(code, minlength=len(CATEGORIES))
    categories = {
        category: CategoryProfile(int(counts[k]), 1.0 if scale == "fixed" else float(reference[k]))
        for k, category in enumerate(CATEGORIES)
        if counts[k]
    }
    steps_s = [
        np.diff(s.stamp_s[np.unique(part.frame)]) for s, part in zip(data.sequences, parts, strict=True)
    ]
    steps, late_s = np.concatenate(steps_s), _lateness_s(data, name)
    delay_s = max(float(np.median(late_s)), 0.0) if len(late_s) else 0.0
    return DetectorProfile(name, float(1.0 / np.median(steps)) if len(steps) else 1.0, categories, delay_s)


def _lateness_s(data: Dataset, name: str) -> FloatArray:
    """(K,) times from measurement to arrival of a detector's boxes, where they are known."""
    late = [s.detections.received_s - s.stamp_s[s.detections.frame] for s in data.sequences]
    own = [s.detections.detector == name for s in data.sequences]
    late_s = np.concatenate([each[rows] for each, rows in zip(late, own, strict=True)])
    known: FloatArray = late_s[np.isfinite(late_s)]
    return known


def _of(objects: Objects, name: str) -> Objects:
    return objects[objects.detector == name]


def detector_notes(data: Dataset, detectors: Mapping[str, DetectorProfile | None]) -> list[str]:
    """What each detector reports, a line each."""
    notes = []
    for name, profile in detectors.items():
        parts = [_of(s.detections, name) for s in data.sequences]
        boxes = sum(len(part) for part in parts)
        measurements = sum(len(np.unique(part.frame)) for part in parts)
        facts = [f"{boxes} boxes in {measurements} measurements"]
        late_s = _lateness_s(data, name)
        if len(late_s):
            facts.append(f"{np.median(late_s):.3g} s late (median)")
        if profile is not None:
            facts.append(f"trust {profile.trust:g}")
            facts += [f"{name} {each.reference_score:.3g}" for name, each in profile.categories.items()]
        notes.append(f"detector {name}: {', '.join(facts)}")
    return notes


LEFT_OUT_TEXTS = {
    "too_late": "measurements arrived later than the tracker waits: left out",
    "too_early": "measurements are stamped far ahead of all others, as by a wrong clock: left out",
    "repeated": "measurements are of a time that it had reported already: left out",
    "dropped": "boxes are under the tracker's score threshold: left out",
    "weak": "boxes have scores too low to start a track, by its scale and trust",
}
"""What each number of `smartmot.tracking.fusion.fused.LeftOut` counts."""


def left_out_lines(tracked: Iterable[TrackedSequence]) -> list[str]:
    """What was left out of each of several detectors, or starts no track, and why, a line each."""
    sums: Counter[tuple[str, str]] = Counter()
    for sequence in tracked:
        for name, left_out in sequence.left_out.items():
            sums.update({(name, field): getattr(left_out, field) for field in LEFT_OUT_TEXTS})
    return [
        f"detector {name}: {number} {LEFT_OUT_TEXTS[field]}"
        for (name, field), number in sums.items()
        if number
    ]
