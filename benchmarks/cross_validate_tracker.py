"""One set of the tracker's parameters for several detectors, chosen by cross-validation.

    python -m benchmarks.cross_validate_tracker [--kitti DIR] [--argoverse2 DIR]

Candidates are `default` with every combination of `GRID`; the thresholds on scores are relative to the
detector, which estimates itself frame by frame. A candidate's score on a sequence is the mean of HOTA, MOTA
and IDF1 at 2 m over the categories, weighed with the root of their labels as in `benchmarks.tune_tracker`.
Three choices are shown:

- in sample: the best candidate on all sequences, on these;
- leave one sequence out: for each sequence the best on all others, on that one; the rows pool them;
- leave one data set out: for each data set the best on the other, on that one.

The last two decide: what they lose against the first is what choosing on too few data costs. `default` as it
is stands beside them. About 4 minutes of processor time.
"""

from __future__ import annotations

import argparse
import sys
from dataclasses import dataclass, replace
from itertools import product
from pathlib import Path

import numpy as np

from benchmarks.tune_tracker import rated
from evaluation.metrics.mot import MotScore
from evaluation.studies.mot.run import track_dataset
from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.recorded.dataset import Dataset
from scenarios.recorded.formats import read_dataset
from smartmot import PerCategory, TrackerConfig, tracker_config

SHARED = Path(__file__).parents[2] / "shared"
CATEGORIES = ("car", "pedestrian", "cyclist")

GRID: dict[str, tuple[float, ...]] = {
    "relative_score": (0.2, 0.3, 0.4, 0.5, 0.6),
    "rest_max_age_s": (1.25, 4.05),
    "hidden_gate_m": (0.5, 1.0),
}
"""`second_stage_score`, `report.mean_score`, for cyclists `report.score`; and two for hidden objects."""

Values = tuple[float, ...]


def configured(values: Values) -> TrackerConfig:
    """`default` with other parameters, in the order of `GRID`."""
    config, (score, rest_s, gate_m) = tracker_config("default"), values
    return replace(
        config,
        association=replace(config.association, hidden_gate_m=gate_m),
        lifecycle=replace(config.lifecycle, rest_max_age_s=rest_s),
        report=replace(config.report, score=PerCategory.grouped(0.0, 0.0, score), mean_score=score),
        second_stage_score=score,
    )


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A choice of parameters and what it makes of every sequence.

    Args:
        tracked: By data set and sequence.
        scores: (sequence, category) to the mean of the three, and the labels.
    """

    tracked: dict[tuple[str, str], TrackedSequence]
    scores: dict[tuple[tuple[str, str], str], tuple[float, int]]

    def score(self, keys: list[tuple[str, str]]) -> float:
        """Mean over some sequences: of every data set alike, within it by the root of the labels."""
        means = []
        for name in dict.fromkeys(data for data, _ in keys):
            rows = [row for (key, _), row in self.scores.items() if key in keys and key[0] == name]
            means.append(np.average([mean for mean, _ in rows], weights=[labels**0.5 for _, labels in rows]))
        return float(np.mean(means))


def judged(data: dict[str, Dataset], values: Values) -> Candidate:
    """Track everything and score it."""
    tracked = {
        (name, each.sequence.name): each
        for name, recordings in data.items()
        for each in track_dataset(recordings, configured(values))
    }
    scores = {}
    for name in data:
        keys = [key for key in tracked if key[0] == name]
        for category in CATEGORIES:
            for key, row in zip(keys, rated([tracked[key] for key in keys], category)[1:], strict=True):
                if row.labels:
                    scores[key, category] = (row.hota + row.mota + row.idf1) / 3.0, row.labels
    return Candidate(tracked, scores)


def show(title: str, tracked: dict[tuple[str, str], TrackedSequence], data: dict[str, Dataset]) -> None:
    """Print HOTA, MOTA and IDF1 per data set and category, sequences pooled."""
    cells = []
    for name in data:
        part = [each for key, each in tracked.items() if key[0] == name]
        for category in CATEGORIES:
            whole: MotScore = rated(part, category)[0]
            cells.append(f"{whole.hota:5.1f} /{whole.mota:5.1f} /{whole.idf1:5.1f}")
    print(f"  {title:<42}" + "   ".join(cells), flush=True)


def main() -> int:
    """Print the choices and what they reach."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kitti", type=Path, default=SHARED / "kitti")
    parser.add_argument("--argoverse2", type=Path, default=SHARED / "argoverse2" / "detections_2hz")
    arguments = parser.parse_args()
    data = {"kitti": read_dataset(arguments.kitti), "argoverse2": read_dataset(arguments.argoverse2)}
    candidates = {}
    for values in product(*GRID.values()):
        candidates[values] = judged(data, values)
        keys = list(candidates[values].tracked)
        by_data = ", ".join(
            f"{name} {candidates[values].score([k for k in keys if k[0] == name]):.2f}" for name in data
        )
        print(
            f"  {dict(zip(GRID, values, strict=True))}: {candidates[values].score(keys):.2f} ({by_data})",
            flush=True,
        )

    def best(chosen: list[tuple[str, str]]) -> Values:
        return max(candidates, key=lambda values: candidates[values].score(chosen))

    print(
        f"\n  HOTA / MOTA / IDF1 {'':<23}"
        + "   ".join(f"{n + ' ' + c:<19}" for n in data for c in CATEGORIES)
    )
    config = tracker_config("default")
    tracked = {(n, t.sequence.name): t for n, d in data.items() for t in track_dataset(d, config)}
    show("default", tracked, data)
    in_sample = best(keys)
    show(f"in sample {in_sample}", candidates[in_sample].tracked, data)
    without = {key: best([k for k in keys if k != key]) for key in keys}
    show("leave one sequence out", {key: candidates[v].tracked[key] for key, v in without.items()}, data)
    others = {name: best([k for k in keys if k[0] != name]) for name in data}
    show("leave one data set out", {key: candidates[others[key[0]]].tracked[key] for key in keys}, data)
    for key, values in without.items():
        print(f"    without {' '.join(key)}: {values}")
    for name, values in others.items():
        print(f"    without {name}: {values}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
