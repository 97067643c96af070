"""Choice of the tracker's parameters by cross-validation over sequences.

    python -m benchmarks.tune_tracker [--kitti DIR] [--category car] [--part search] [--jobs N]

Search: every category is tuned on its own. Candidates are drawn at random from the grid below; the present
`default` comes first. A candidate's score on a sequence is the mean of HOTA, MOTA and IDF1 at 2 m of centre
distance, at the threshold on the tracks' mean score with the best MOTA over all sequences. Sequences weigh
with the root of their labels, between every object and every sequence counting the same.

Single events lift a candidate over its neighbours, so it is judged by its plateau: the mean score of itself
and the nearest candidates. For each sequence left out, the candidate with the best plateau on the others is
taken; the held-out rows pool what these choices reach on the sequences that they have not seen, once with the
threshold on the mean score fitted as in every evaluation, once with the others'. `default` itself was chosen
by hand with all sequences in view; its second row holds out the threshold alone. A wide gap between fitted
and held-out figures means parameters that fit these sequences only.

Sensitivity: one parameter of `default` at a time takes the values of the grid.

Robustness: the data are made worse, and `default` is compared with the configurations of the peers.

All three take about 25 minutes of processor time; two processes share it.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from evaluation.metrics.matching import compare
from evaluation.metrics.mot import MotScore, evaluate
from evaluation.studies.mot.run import track_dataset
from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.recorded.camera import from_camera, to_camera
from scenarios.recorded.dataset import Dataset, Objects, Sequence
from scenarios.recorded.formats import read_dataset
from smartmot import PerCategory, TrackerConfig, tracker_config
from smartmot.types import CATEGORIES, FloatArray

SIMILARITY = "distance"

GRID: dict[str, tuple[float, ...]] = {
    "position_sigma_m": (0.05, 0.1, 0.15, 0.2, 0.25, 0.3),
    "velocity_m2ps3": (0.1, 0.2, 0.5, 1.0, 2.0),
    "widest_gate_m": (1.0, 1.5, 2.0, 3.0, 5.0, 20.0),
    "confirm_s": (0.0, 0.05, 0.15, 0.25),
    "max_age_s": (0.55, 0.65, 0.75, 0.85, 1.05, 1.25, 1.55, 2.05, 2.55, 3.05),
    "second_stage_score": (0.4, 0.5, 0.6, 0.7, 0.8, 0.9),
    "coasted_s": (0.0, 0.15, 0.25, 0.35, 0.45, 0.55, 0.65),
    "shown_score": (0.0, 0.4, 0.5, 0.6),
    "mean_score": (0.0, 0.5, 0.6, 0.65, 0.7, 0.8, 0.9),
}
"""Values that a parameter may take, in ascending order; times lie halfway between frames."""

NEIGHBOURS = 6
"""Candidates that a plateau consists of, the candidate itself included."""

BROAD = 0.3
"""A parameter's range ends where the score falls by more points."""

Parameters = dict[str, float]


@dataclass(frozen=True, slots=True, eq=False)
class Candidate:
    """A choice of parameters and what it reaches.

    Args:
        parameters: The choice.
        rows: All sequences together, then each.
    """

    parameters: Parameters
    rows: list[MotScore]

    def score(self, names: Iterable[str] | None = None) -> float:
        """Mean over the named sequences, or over all."""
        rows = [row for row in self.rows[1:] if names is None or row.sequence in names]
        return float(np.average([_mean(row) for row in rows], weights=[row.labels**0.5 for row in rows]))


def _mean(row: MotScore) -> float:
    return (row.hota + row.mota + row.idf1) / 3.0


def present(category: str) -> Parameters:
    """The parameters of `default` for a category."""
    config = tracker_config("default")
    settings = {
        "position_sigma_m": config.filter.position_sigma_m,
        "velocity_m2ps3": getattr(config.motion, "velocity_m2ps3", 0.5),
        "widest_gate_m": config.association.widest_gate_m,
        "confirm_s": config.lifecycle.confirm_s,
        "max_age_s": config.lifecycle.max_age_s,
        "second_stage_score": config.second_stage_score,
        "coasted_s": config.report.coasted_s or 0.0,
        "shown_score": config.report.score,
        "mean_score": config.report.mean_score,
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
        association=replace(config.association, widest_gate_m=p["widest_gate_m"]),
        lifecycle=replace(config.lifecycle, confirm_s=p["confirm_s"], max_age_s=p["max_age_s"]),
        report=replace(
            config.report, coasted_s=p["coasted_s"], score=p["shown_score"], mean_score=p["mean_score"]
        ),
        second_stage_score=p["second_stage_score"],
    )


def drawn(count: int, seed: int) -> list[Parameters]:
    """Random choices."""
    rng = np.random.default_rng(seed)
    return [{name: float(rng.choice(values)) for name, values in GRID.items()} for _ in range(count)]


def of_category(data: Dataset, category: str) -> Dataset:
    """The data with the detections of one category."""
    sequences = tuple(
        replace(s, detections=s.detections[s.detections.category == category]) for s in data.sequences
    )
    return replace(data, sequences=sequences)


def rated(tracked: Iterable[TrackedSequence], category: str, best_threshold: bool = True) -> list[MotScore]:
    """Accuracy of all sequences together, then of each."""
    compared = {
        sequence.sequence.name: compare(sequence.sequence, sequence.tracks, category, SIMILARITY)
        for sequence in tracked
    }
    return evaluate(compared, category, SIMILARITY, best_threshold, averages=False)


def judged(data: Dataset, category: str, parameters: Parameters) -> Candidate:
    """Track all sequences and score them."""
    return Candidate(parameters, rated(track_dataset(data, configured(parameters)), category))


def plateaus(candidates: list[Candidate], names: Iterable[str] | None = None) -> FloatArray:
    """(N,) mean scores of the candidates with their nearest ones, in steps of the grid."""
    places = np.array(
        [
            [np.searchsorted(GRID[n], v) / (len(GRID[n]) - 1) for n, v in c.parameters.items()]
            for c in candidates
        ]
    )
    distance = np.abs(places[:, None] - places[None]).sum(axis=2)
    nearest = np.argsort(distance, axis=1, kind="stable")[:, :NEIGHBOURS]
    return np.asarray(np.array([c.score(names) for c in candidates])[nearest].mean(axis=1))


def over(tracked: TrackedSequence, least_score: float) -> TrackedSequence:
    """Without the tracks whose mean score is lower."""
    tracks = tracked.tracks
    _, index = np.unique(tracks.object_id, return_inverse=True)
    mean = np.bincount(index, tracks.score) / np.bincount(index)
    return replace(tracked, tracks=tracks[mean[index] >= least_score])


def held_out(data: Dataset, category: str, chosen: dict[str, Parameters]) -> dict[str, list[MotScore]]:
    """What the parameters chosen without a sequence reach on it, all sequences together and each.

    Args:
        data: The data of one category.
        category: Its name.
        chosen: For each sequence, the parameters chosen without it.
    """
    unseen, unseen_threshold = [], []
    for name, parameters in chosen.items():
        tracked = track_dataset(data, configured(parameters))
        training = [sequence for sequence in tracked if sequence.sequence.name != name]
        [left] = [sequence for sequence in tracked if sequence.sequence.name == name]
        unseen.append(left)
        unseen_threshold.append(over(left, rated(training, category)[0].score_threshold))
    return {
        "held out": rated(unseen, category),
        "threshold held out too": rated(unseen_threshold, category, best_threshold=False),
    }


def fifth_missing(sequence: Sequence, rng: np.random.Generator) -> Sequence:
    """A random fifth of the detections left out."""
    detections = sequence.detections
    return replace(sequence, detections=detections[rng.random(len(detections)) >= 0.2])


def every_second_frame(sequence: Sequence, _: np.random.Generator) -> Sequence:
    """5 Hz instead of 10 Hz."""

    def thinned(objects: Objects) -> Objects:
        kept = objects[objects.frame % 2 == 0]
        return replace(kept, frame=kept.frame // 2)

    camera, poses = sequence.camera, sequence.world_SE3_ego
    if camera is not None:
        even = camera.dont_care_frame % 2 == 0
        camera = replace(
            camera,
            dont_care_frame=camera.dont_care_frame[even] // 2,
            dont_care_px=camera.dont_care_px[even],
        )
    return replace(
        sequence,
        stamp_s=sequence.stamp_s[::2],
        frame_name=sequence.frame_name[::2],
        detections=thinned(sequence.detections),
        labels=None if sequence.labels is None else thinned(sequence.labels),
        world_SE3_ego=None if poses is None else poses[::2],
        camera=camera,
    )


def noisy(sequence: Sequence, rng: np.random.Generator) -> Sequence:
    """0.2 m of noise on each coordinate of the detected centres."""
    detections = sequence.detections
    center = detections.center_m + rng.normal(0.0, 0.2, detections.center_m.shape)
    return replace(sequence, detections=replace(detections, center_m=center))


def without_poses(sequence: Sequence, _: np.random.Generator) -> Sequence:
    """Everything in the vehicle's own frame."""

    def seen(objects: Objects) -> Objects:
        own = from_camera(objects.frame, to_camera(objects, sequence.world_SE3_ego), None)
        return replace(objects, center_m=own.center_m, yaw_rad=own.yaw_rad, bottom_m=own.bottom_m)

    labels = None if sequence.labels is None else seen(sequence.labels)
    return replace(sequence, detections=seen(sequence.detections), labels=labels, world_SE3_ego=None)


def modest(sequence: Sequence, _: np.random.Generator) -> Sequence:
    """Scores that a surer detector would call 0 to 1 reach 0.6 only."""
    detections = sequence.detections
    return replace(sequence, detections=replace(detections, score=0.6 * detections.score))


WORSE: dict[str, Callable[[Sequence, np.random.Generator], Sequence]] = {
    "as recorded": lambda sequence, _: sequence,
    "20 % of detections missing": fifth_missing,
    "every second frame": every_second_frame,
    "0.2 m position noise": noisy,
    "no ego poses": without_poses,
    "scores from 0 to 0.6": modest,
}

COMPARED = ("default", "ab3dmot", "centerpoint")
"""Configurations in the part on robustness."""

PARTS = ("search", "sensitivity", "robustness")


def _print_rows(title: str, rows: dict[str, MotScore]) -> None:
    print(f"\n  {title:<42}   HOTA    MOTA    IDF1    mean")
    for name, row in rows.items():
        print(f"    {name:<40}{row.hota:>7.2f}{row.mota:>8.2f}{row.idf1:>8.2f}{_mean(row):>8.2f}", flush=True)


def search(data: Dataset, category: str, count: int, seed: int, pool: ProcessPoolExecutor) -> None:
    """Print what random candidates reach, and what the best reach on sequences that did not choose them."""
    judge = partial(judged, data, category)
    start, *candidates = pool.map(judge, [present(category), *drawn(count, seed)])
    names = [s.name for s in data.sequences]
    print(f"{category}: {count} candidates")
    chosen = {}
    for left in names:
        training = [name for name in names if name != left]
        best = candidates[int(plateaus(candidates, training).argmax())]
        chosen[left] = best.parameters
        shown = ", ".join(f"{name} {value:g}" for name, value in best.parameters.items())
        print(f"  without {left}: {shown}")
    fitted = candidates[int(plateaus(candidates).argmax())]
    unseen = held_out(data, category, chosen)
    same = held_out(data, category, dict.fromkeys(names, start.parameters))
    table = {"default": start.rows, "default, threshold held out": same["threshold held out too"]}
    table |= {"fitted by plateau": fitted.rows} | unseen
    _print_rows(category, {name: rows[0] for name, rows in table.items()})
    print("\n  mean of the three by sequence" + "".join(f"{name:>8}" for name in names))
    for title, rows in table.items():
        print(f"    {title:<27}" + "".join(f"{_mean(r):>8.1f}" if r.labels else "       -" for r in rows[1:]))


def sensitivity(data: Dataset, category: str, pool: ProcessPoolExecutor) -> None:
    """Print what one changed parameter of `default` does."""
    usual = present(category)
    changes = [(name, value) for name, values in GRID.items() for value in values if value != usual[name]]
    choices = [usual, *(usual | {name: value} for name, value in changes)]
    start, *changed = pool.map(partial(judged, data, category), choices)
    tried = [(name, c) for (name, _), c in zip(changes, changed, strict=True)]
    print(f"\n  one parameter of default at a time: change of the score ({start.score():.2f})")
    for name, values in GRID.items():
        loss = {value: 0.0 for value in values if value == start.parameters[name]}
        loss |= {c.parameters[name]: c.score() - start.score() for which, c in tried if which == name}
        ordered = sorted(loss)
        place = low = high = ordered.index(start.parameters[name])
        while low > 0 and loss[ordered[low - 1]] >= -BROAD:
            low -= 1
        while high + 1 < len(ordered) and loss[ordered[high + 1]] >= -BROAD:
            high += 1
        shown = "  ".join(f"{value:g}: {loss[value]:+.2f}" for value in ordered)
        print(f"    {name:<19}{ordered[place]:>4g}, broad {ordered[low]:g} to {ordered[high]:g}   {shown}")


def robustness(data: Dataset, category: str, seed: int, pool: ProcessPoolExecutor) -> None:
    """Print what configurations reach on data made worse."""
    rng = np.random.default_rng(seed)
    results = {
        f"{name}, {title}": pool.submit(_followed, worse, category, name)
        for title, change in WORSE.items()
        for worse in [replace(data, sequences=tuple(change(s, rng) for s in data.sequences))]
        for name in COMPARED
    }
    _print_rows(f"{category}, configuration and data", {n: result.result() for n, result in results.items()})
    kept = rated(track_dataset(data, tracker_config("default")), category, best_threshold=False)
    _print_rows(f"{category}, no threshold", {"default, as recorded": kept[0]})


def _followed(data: Dataset, category: str, name: str) -> MotScore:
    """Accuracy of a named configuration, all sequences together."""
    return rated(track_dataset(data, tracker_config(name)), category)[0]


def main() -> int:
    """Tune the categories that have labels."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kitti", type=Path, default=Path(__file__).parents[2] / "shared" / "kitti")
    parser.add_argument("--category", choices=CATEGORIES, action="append")
    parser.add_argument("--part", choices=PARTS, action="append")
    parser.add_argument("--candidates", type=int, default=60)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--jobs", type=int, default=2)
    arguments = parser.parse_args()
    data = read_dataset(arguments.kitti)
    with ProcessPoolExecutor(arguments.jobs) as pool:
        for category in arguments.category or ("car", "pedestrian", "cyclist"):
            started, only, parts = time.perf_counter(), of_category(data, category), arguments.part or PARTS
            if "search" in parts:
                search(only, category, arguments.candidates, arguments.seed, pool)
            if "sensitivity" in parts:
                sensitivity(only, category, pool)
            if "robustness" in parts:
                robustness(only, category, arguments.seed, pool)
            print(f"\n  {category}: {time.perf_counter() - started:.0f} s\n", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
