"""Time of one frame of perception and decision, and of an update of the tracker, against another version.

    python -m benchmarks.frame [--against DIR] [--counts 3,30,200] [--rounds 9]

Frames are those of a closed-loop run: the pedestrian crossing at 50 km/h with others on the sidewalks and in
the other lane, all of them seen, map area, planned path known to every part, as `compare` has it. They are
recorded once and then processed again and again. Updates of the tracker are those of `benchmarks.tracking`.
DIR is a checkout of another version (`git worktree add DIR COMMIT`): it works in a process of its own, and
both take turns. A time is the least of all rounds, since other processes only ever add to it; shown are
medians over the frames, in milliseconds of processor time. The last column is the greatest difference of
tracks, forecasts, times to collision and commands between the two; the exit status is 1 if it is over 1e-9.
Last come the slow updates of the tracker: 99th percentile and greatest time over the median of all updates
of a process that has just been started, the first ones included; medians of several processes.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

if not __package__:
    # a script's own folder comes first, and has a module of the name opendrive; a worker is told its version
    sys.path[0] = sys.argv[2] if sys.argv[1:2] == ["--worker"] else str(Path(__file__).parents[1])

import numpy as np

import smartmot
from smartmot import Boxes, Detections, Tracker, tracker_config
from smartmot.pipeline import FrameResult, Pipeline

COUNTS = (3, 30, 200)
GOAL_MS = {3: 0.08, 30: 0.25, 200: 1.0}
"""Times of a frame that perception and decision are meant to stay under, by the number of objects."""
TRACKED = (10, 30, 100, 300, 1000)
TOLERANCE = 1e-9
FRAME_S = 0.1
UPDATES = 200
"""Of the tracker in a turn: the 99th percentile is the third greatest time."""
FRESH = 5
"""Processes in which the slowest updates are looked for."""
SPREAD_GOAL = 3.0
"""The 99th percentile of an update over its median is meant to stay under this in a fresh process."""
TRACKER = "default"

Timed = Callable[[], tuple[list[float], list[list[float]]]]
"""Processes all frames: milliseconds of each, and what came of each as numbers."""


def recorded(count: int) -> list[tuple[Pipeline, list[tuple[Any, ...]]]]:
    """The pipelines of a run among others and the arguments of their frames; `count` objects in all."""
    from evaluation.studies.compare.grid import FAIR
    from evaluation.studies.growth import GrowthStudy, with_others
    from scenarios.settings import preset_with
    from scenarios.simulation.simulation import Simulation
    from scenarios.spec import definition_of, preset_of
    from scenarios.strategies import make_strategy

    frames: dict[int, tuple[Pipeline, list[tuple[Any, ...]]]] = {}
    step = Pipeline.step

    def record(self: Pipeline, state: Any, *arguments: Any) -> Any:
        frames.setdefault(id(self), (self, []))[1].append(arguments)
        return step(self, state, *arguments)

    (item,) = GrowthStudy(("map",), "physical", "dry", 1, (count - 1,)).items(Path())
    definition = with_others(definition_of(item.spec), item.label, item.spec.seed)
    preset = preset_with(preset_of(item.spec, definition), FAIR)
    preset = replace(preset, sensor=replace(preset.sensor, min_visible=0.0))
    Pipeline.step = record  # type: ignore[method-assign, assignment]
    try:
        Simulation(definition, preset, lambda view: make_strategy("map", preset, view), 0).run()
    finally:
        Pipeline.step = step  # type: ignore[method-assign]
    return list(frames.values())


def numbers(result: FrameResult) -> list[float]:
    """What one frame came to, as numbers that two versions can be compared by."""
    tracks, command, lead = result.tracks, result.command, result.command.lead
    arrays = (
        tracks.track_id, tracks.boxes.center_m, tracks.boxes.size_m, tracks.velocity_mps, tracks.covariance,
        result.forecast.center_m, result.ego_forecast.center_m, result.kept,
        result.threats.time_to_collision_s, result.threats.gap_m,
    )  # fmt: skip
    of_arrays = [float(np.sum(array)) for array in arrays]
    of_lead = [0.0] if lead is None else [lead.track_id, lead.gap_m, lead.speed_mps]
    return [*of_arrays, *of_lead, float(command.emergency), float(len(result.events))]


def perception(count: int) -> Timed:
    """Frames of perception and decision among `count` objects."""
    runs = recorded(count)

    def timed() -> tuple[list[float], list[list[float]]]:
        spent, results = [], []
        for pipeline, frames in runs:
            state = pipeline.initial()
            for arguments in frames:
                start = time.thread_time_ns()
                state, result = pipeline.step(state, *arguments)
                spent.append((time.thread_time_ns() - start) / 1e6)
                results.append(numbers(result))
        return spent, results

    return timed


def tracking(count: int) -> Timed:
    """Updates of the tracker with `count` cars."""
    from benchmarks.tracking import grid

    scene = [
        Detections(
            FRAME_S * k,
            Boxes(rows[:, :2], rows[:, 2:4], rows[:, 4]),
            np.ones(count),
            np.full(count, "car"),
        )
        for k, rows in enumerate(grid(count, UPDATES))
    ]

    def timed() -> tuple[list[float], list[list[float]]]:
        tracker, spent, results = Tracker(tracker_config(TRACKER)), [], []
        for detections in scene:
            start = time.thread_time_ns()
            tracks = tracker.update(detections)
            spent.append((time.thread_time_ns() - start) / 1e6)
            results.append([float(tracks.boxes.center_m.sum()), float(len(tracks))])
        return spent, results

    return timed


def work(root: Path) -> None:
    """Answer requests, one per line: {"kind": ..., "count": ...}; scenes are made when first asked for."""
    if not Path(smartmot.__file__).is_relative_to(root):
        raise SystemExit(f"benchmarks.frame: {smartmot.__file__} is not in {root}; empty PYTHONPATH")
    scenes: dict[tuple[str, int], Timed] = {}
    made = {"frame": perception, "tracker": tracking}
    for line in sys.stdin:
        request = json.loads(line)
        key = (request["kind"], request["count"])
        if key not in scenes:
            scenes[key] = made[key[0]](key[1])
        spent, results = scenes[key]()
        print(json.dumps({"ms": spent, "results": results}), flush=True)


class Version:
    """One version of the program in a process of its own.

    Args:
        root: folder of its checkout.
    """

    def __init__(self, root: Path) -> None:
        command = [sys.executable, str(Path(__file__)), "--worker", str(root)]
        self._process = subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)

    def run(self, kind: str, count: int) -> dict[str, Any]:
        """One turn."""
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps({"kind": kind, "count": count}) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise SystemExit("benchmarks.frame: a version ended early; its message stands above")
        answer: dict[str, Any] = json.loads(line)
        return answer

    def close(self) -> None:
        """End the process."""
        assert self._process.stdin is not None
        self._process.stdin.close()
        self._process.wait()


def difference(a: list[list[float]], b: list[list[float]]) -> float:
    """Greatest difference, relative to numbers over 1; infinite where there are more of them on one side."""
    if [len(row) for row in a] != [len(row) for row in b]:
        return float("inf")
    pairs = [(x, y) for left, right in zip(a, b, strict=True) for x, y in zip(left, right, strict=True)]
    return max((abs(x - y) / max(1.0, abs(x)) for x, y in pairs), default=0.0)


def compare(versions: list[Version], kind: str, count: int, rounds: int) -> bool:
    """Print one line; False if the versions differ."""
    least: list[list[float]] = []
    first = [version.run(kind, count) for version in versions]  # warm up: caches, first calls
    for _ in range(rounds):
        for k, version in enumerate(versions):
            spent = version.run(kind, count)["ms"]
            if k == len(least):
                least.append(spent)
            else:
                least[k] = [min(x, y) for x, y in zip(least[k], spent, strict=True)]
    medians = [statistics.median(spent) for spent in least]
    goal = GOAL_MS.get(count) if kind == "frame" else None
    line = f"  {kind:<8}{count:>6}{len(least[0]):>8}{medians[0]:>10.3f}{goal if goal else '-':>8}"
    apart = 0.0
    if len(versions) > 1:
        apart = difference(first[0]["results"], first[1]["results"])
        line += f"{medians[1]:>10.3f}{medians[0] / medians[1]:>8.2f}{apart:>12.1e}"
    print(line, flush=True)
    return apart <= TOLERANCE


def slow_updates(root: Path, count: int) -> None:
    """Print one line: how much longer than the median the slow updates of a fresh process take."""
    high, most, middle = [], [], []
    for _ in range(FRESH):
        version = Version(root)
        spent = np.array(version.run("tracker", count)["ms"])
        version.close()
        median = float(np.median(spent))
        middle.append(median)
        high.append(float(np.percentile(spent, 99)) / median)
        most.append(float(spent.max()) / median)
    p99, greatest = statistics.median(high), statistics.median(most)
    print(
        f"  {count:>6}{statistics.median(middle):>12.3f}{p99:>10.2f}{SPREAD_GOAL:>8.1f}{greatest:>10.2f}",
        flush=True,
    )


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--against", type=Path, help="checkout of another version")
    parser.add_argument("--counts", default=",".join(map(str, COUNTS)), help="objects in a frame")
    parser.add_argument("--tracked", default=",".join(map(str, TRACKED)), help="objects that are tracked")
    parser.add_argument("--rounds", type=int, default=9)
    arguments = parser.parse_args()
    roots = [Path(__file__).parents[1], *([arguments.against.resolve()] if arguments.against else [])]
    versions = [Version(root) for root in roots]
    print("  kind   objects  frames  ms/frame    goal" + "   against   ratio  difference" * (len(roots) - 1))
    equal = True
    for kind, counts in (("frame", arguments.counts), ("tracker", arguments.tracked)):
        for count in (int(text) for text in counts.split(",") if text):
            equal &= compare(versions, kind, count, arguments.rounds)
    for version in versions:
        version.close()
    print("updates of the tracker in fresh processes\n  objects   median ms       p99    goal  greatest")
    for count in (int(text) for text in arguments.tracked.split(",") if text):
        slow_updates(roots[0], count)
    return 0 if equal else 1


if __name__ == "__main__":
    if sys.argv[1:2] == ["--worker"]:
        work(Path(sys.argv[2]))
    else:
        sys.exit(main())
