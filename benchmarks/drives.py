"""Processor time of recorded drives, against the time that they recorded.

    python -m benchmarks.drives FOLDER [--repeats 3] [--profile]

Labels stand in for detections. Reading, each strategy with each rule, and writing have a line each; the last
is a drive with all parts on: reading, the slowest strategy and rule, and writing. `--profile` says where the
time is spent. The status is 1 where all parts together run less than 20 times faster than real time.
"""

from __future__ import annotations

import argparse
import cProfile
import pstats
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TypeVar

import pandas  # noqa: F401 - what is imported later would be counted as reading
import pyarrow.compute  # noqa: F401

if not __package__:
    # a script's own folder comes first, and has a module of the name opendrive
    sys.path[0] = str(Path(__file__).parents[1])

from evaluation.results.logs import write_log
from evaluation.studies.drive.drive import Drive, DriveSpec, carry_out
from evaluation.studies.drive.recordings import Source, data_sets_of
from evaluation.studies.drive.study import DriveStudy, Options, prepare

STRATEGIES, RULES = "rectangular,map,all,path", "paper,cascade"
GOAL = 20.0
"""Times faster than real time that a log at 10 Hz has to run."""


_T = TypeVar("_T")


def bench(data: Path, strategies: tuple[str, ...], rules: tuple[str, ...], repeats: int) -> float:
    """Print the times of a data set; how many times faster than real time it is with all parts on."""
    asked = Options(Source(data, sees="labels"), strategies=strategies, rules=rules, preset="real")
    study, read_s = _least(lambda: prepare(asked), repeats)
    recorded_s = study.recorded_s / len(study.specs)
    print(f"{data.name}: {study.frame_count // len(study.specs)} frames, {recorded_s:.1f} s recorded")
    _print("reading", read_s, recorded_s)
    slowest_s = write_s = 0.0
    for spec in study.specs:
        drives, spent_s = _least(partial(_driven, study, spec), repeats)
        _print(f"{spec.strategy}, {spec.rule}", spent_s, recorded_s)
        slowest_s = max(slowest_s, spent_s)
        write_s = max(write_s, _least(partial(_written, drives), repeats)[1])
    _print("writing of a log", write_s, recorded_s)
    return _print("all parts on", read_s + slowest_s + write_s, recorded_s)


def _driven(study: DriveStudy, spec: DriveSpec) -> list[Drive]:
    return [
        carry_out(r.sequence, replace(spec, vehicle=r.vehicle), study.maps.get(r.map_path))
        for r in study.recordings
    ]


def _written(drives: list[Drive]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for drive in drives:
            write_log(Path(folder) / "log.parquet", drive.log)


def _least(call: Callable[[], _T], repeats: int) -> tuple[_T, float]:
    """A result, and the least processor time that it took, s: what else runs can only make it longer."""
    times = []
    for _ in range(repeats):
        start_s = time.thread_time()
        result = call()
        times.append(time.thread_time() - start_s)
    return result, min(times)


def _print(what: str, spent_s: float, recorded_s: float) -> float:
    print(f"  {what:28s} {spent_s:7.3f} s  {recorded_s / spent_s:6.1f} x real time", flush=True)
    return recorded_s / spent_s


def _main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, nargs="+", help="data sets, or folders of them")
    parser.add_argument("--strategy", default=STRATEGIES)
    parser.add_argument("--rule", default=RULES)
    parser.add_argument(
        "--repeats", type=int, default=3, help="runs of each part, of which the fastest counts"
    )
    parser.add_argument("--profile", action="store_true")
    options = parser.parse_args()
    profile = cProfile.Profile(time.thread_time)
    strategies, rules = (tuple(text.split(",")) for text in (options.strategy, options.rule))
    paths = [path for folder in options.folder for path in data_sets_of(folder, None, None)[0]]
    if options.profile:
        profile.enable()
    ratios = [bench(path, strategies, rules, options.repeats) for path in paths]
    profile.disable()
    if options.profile:
        pstats.Stats(profile).sort_stats("cumulative").print_stats(60)
        pstats.Stats(profile).sort_stats("tottime").print_stats(40)
    return min(ratios) < GOAL


if __name__ == "__main__":
    raise SystemExit(_main())
