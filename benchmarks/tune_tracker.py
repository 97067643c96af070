"""Choice of the tracker's parameters by cross-validation over sequences.

    python -m benchmarks.tune_tracker [--kitti DIR] [--category car] [--candidates N] [--seed S]

Every category is tuned on its own. Candidates are drawn at random from the grid below; the present
`default` comes first. A candidate's score on a sequence is the mean of HOTA, MOTA and IDF1 at 2 m of centre
distance. For each sequence left out, the candidate with the best mean over the others, weighted by their
labels, is taken; the held-out rows pool what these choices reach on the sequences that they have not seen,
once with the threshold on the tracks' mean score fitted as in every evaluation, once with the others'. A wide
gap between fitted and held-out figures would mean parameters that fit these sequences only. At the end, the
mean score of the candidates with each value shows how broad the optimum is.
"""

from __future__ import annotations

import argparse
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from evaluation.mot.dataset import Dataset, Objects
from evaluation.mot.metrics import Comparison, MotScore, compare, evaluate
from evaluation.mot.run import read_dataset, track_dataset
from evaluation.mot.tracking import TrackedSequence
from smartmot import PerCategory, TrackerConfig, tracker_config
from smartmot.types import CATEGORIES

SIMILARITY = "distance"

GRID: dict[str, tuple[float, ...]] = {
    "position_sigma_m": (0.1, 0.15, 0.2, 0.3),
    "velocity_m2ps3": (0.1, 0.2, 0.5, 1.0, 2.0),
    "confirm_s": (0.0, 0.1),
    "max_age_s": (0.5, 0.7, 1.0, 1.5, 2.0),
    "coasted_s": (0.0, 0.1, 0.3, 0.4, 0.5),
    "shown_score": (0.0, 0.3, 0.4, 0.5, 0.6),
    "second_stage_score": (0.0, 0.6, 0.7, 0.75, 0.8, 0.9),
}
"""Values that a parameter may take."""

Parameters = dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A choice of parameters and what it reaches.

    Args:
        parameters: The choice.
        tracked: Its tracks.
        score: Of each sequence, mean of HOTA, MOTA and IDF1 in per cent.
        labels: Of each sequence.
    """

    parameters: Parameters
    tracked: list[TrackedSequence]
    score: dict[str, float]
    labels: dict[str, int]

    def mean(self, without: str | None = None) -> float:
        """Score over all sequences but one, weighted by their labels."""
        names = [name for name in self.score if name != without]
        weights = np.array([self.labels[name] for name in names], dtype=np.float64)
        return float(np.average([self.score[name] for name in names], weights=weights))


def present(category: str) -> Parameters:
    """The parameters of `default` for a category."""
    config = tracker_config("default")
    settings = {
        "position_sigma_m": config.filter.position_sigma_m,
        "velocity_m2ps3": getattr(config.motion, "velocity_m2ps3", 0.5),
        "confirm_s": config.lifecycle.confirm_s,
        "max_age_s": config.lifecycle.max_age_s,
        "coasted_s": config.report.coasted_s or 0.0,
        "shown_score": config.report.score,
        "second_stage_score": config.second_stage_score,
    }
    return {
        name: float(getattr(value, category) if isinstance(value, PerCategory) else value)
        for name, value in settings.items()
    }


def configured(parameters: Parameters) -> TrackerConfig:
    """`default` with other parameters, for data of one category."""
    config, p = tracker_config("default"), parameters
    return replace(
        config,
        motion=replace(config.motion, velocity_m2ps3=p["velocity_m2ps3"]),  # type: ignore[type-var]
        filter=replace(config.filter, position_sigma_m=p["position_sigma_m"]),
        lifecycle=replace(config.lifecycle, confirm_s=p["confirm_s"], max_age_s=p["max_age_s"]),
        report=replace(config.report, coasted_s=p["coasted_s"], score=p["shown_score"]),
        second_stage_score=p["second_stage_score"],
    )


def drawn(category: str, count: int, seed: int) -> Iterator[Parameters]:
    """`default`, then random choices."""
    yield present(category)
    rng = np.random.default_rng(seed)
    for _ in range(count - 1):
        yield {name: float(rng.choice(values)) for name, values in GRID.items()}


def of_category(data: Dataset, category: str) -> Dataset:
    """The data with the detections of one category."""
    sequences = tuple(
        replace(s, detections=s.detections[s.detections.category == category]) for s in data.sequences
    )
    return replace(data, sequences=sequences)


def comparisons(tracked: list[TrackedSequence], category: str) -> dict[str, Comparison]:
    """Tracks against labels, per sequence."""
    return {one.sequence.name: compare(one.sequence, one.tracks, category, SIMILARITY) for one in tracked}


def judged(data: Dataset, category: str, parameters: Parameters) -> Candidate:
    """Track all sequences and score them."""
    tracked = track_dataset(data, configured(parameters))
    rows = evaluate(comparisons(tracked, category), category, SIMILARITY)[1:]
    return Candidate(
        parameters,
        tracked,
        {row.sequence: (row.hota + row.mota + row.idf1) / 3.0 for row in rows},
        {row.sequence: row.labels for row in rows},
    )


def over(tracks: Objects, least_score: float) -> Objects:
    """Tracks whose mean score reaches a threshold."""
    _, index = np.unique(tracks.object_id, return_inverse=True)
    mean = np.bincount(index, tracks.score) / np.bincount(index)
    return tracks[mean[index] >= least_score]


def held_out(candidates: list[Candidate], category: str) -> tuple[MotScore, MotScore]:
    """What the choices made without a sequence reach on it, all sequences together.

    Returns:
        With the threshold on the tracks' mean score fitted as in every evaluation, and with each sequence's
        threshold fitted on the others.
    """
    all_tracks, unseen = {}, {}
    for name in candidates[0].score:
        best = max(candidates, key=lambda candidate: candidate.mean(without=name))
        others = [one for one in best.tracked if one.sequence.name != name]
        threshold = evaluate(comparisons(others, category), category, SIMILARITY)[0].score_threshold
        (left,) = [one for one in best.tracked if one.sequence.name == name]
        all_tracks[name] = compare(left.sequence, left.tracks, category, SIMILARITY)
        unseen[name] = compare(left.sequence, over(left.tracks, threshold), category, SIMILARITY)
        print(f"    without {name}: score {best.mean(name):.2f} on the others, {best.score[name]:.2f} on it")
    return (
        evaluate(all_tracks, category, SIMILARITY)[0],
        evaluate(unseen, category, SIMILARITY, best_threshold=False)[0],
    )


def tune(data: Dataset, category: str, count: int, seed: int) -> None:
    """Print the search of one category."""
    only = of_category(data, category)
    candidates = []
    for k, parameters in enumerate(drawn(category, count, seed)):
        candidates.append(judged(only, category, parameters))
        if candidates[-1].mean() == max(candidate.mean() for candidate in candidates):
            shown = ", ".join(f"{name} {value:g}" for name, value in parameters.items())
            print(f"  {category} {k:>3}: {candidates[-1].mean():.2f}  {shown}", flush=True)
    best = max(candidates, key=Candidate.mean)
    print(f"  {category}, left out one at a time:")
    unseen, unseen_threshold = held_out(candidates, category)
    results = {
        "default": evaluate(comparisons(candidates[0].tracked, category), category, SIMILARITY)[0],
        "fitted": evaluate(comparisons(best.tracked, category), category, SIMILARITY)[0],
        "held out": unseen,
        "threshold held out too": unseen_threshold,
    }
    print(f"  {category:<24}   HOTA    MOTA    IDF1")
    for name, row in results.items():
        print(f"    {name:<22}{row.hota:>7.2f}{row.mota:>8.2f}{row.idf1:>8.2f}", flush=True)
    values: defaultdict[tuple[str, float], list[float]] = defaultdict(list)
    for candidate in candidates[1:]:
        for name, value in candidate.parameters.items():
            values[name, value].append(candidate.mean())
    print("  mean (best) score of the candidates with each value:")
    for name, choices in GRID.items():
        found = [(v, values[name, v]) for v in choices if values[name, v]]
        print(f"    {name:<20}" + "  ".join(f"{v:g}: {np.mean(s):.1f} ({max(s):.1f})" for v, s in found))


def main() -> int:
    """Tune the categories that have labels."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kitti", type=Path, default=Path(__file__).parents[2] / "shared" / "kitti")
    parser.add_argument("--category", choices=CATEGORIES, action="append")
    parser.add_argument("--candidates", type=int, default=40)
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    data = read_dataset(arguments.kitti)
    for category in arguments.category or ("car", "pedestrian", "cyclist"):
        tune(data, category, arguments.candidates, arguments.seed)
    return 0


if __name__ == "__main__":
    sys.exit(main())
