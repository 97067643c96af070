"""Processor time of recorded drives, against the time that they recorded.

    python -m benchmarks.drives FOLDER [--repeats 3] [--profile]

Labels stand in for detections. Each strategy with each rule has a line: the drive alone, and with all parts
on, which are reading of the log and its map, the drive with its verdicts, and writing of its log. The last
line of a data set names the slowest. `--profile` says where the time is spent. The status is 1 where any of
them runs less than 20 times faster than real time.
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

import numpy as np
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
    """Print the times of a data set; how many times faster than real time its slowest drive is.

    All parts take turns: what else runs for a while does not make one of them slow in all rounds.
    """
    asked = Options(Source(data, sees="labels"), strategies=strategies, rules=rules, preset="real")
    read, drive, write = [], [], []
    for _ in range(repeats):
        study, read_s = _timed(lambda: prepare(asked))
        driven = [_timed(partial(_driven, study, spec)) for spec in study.specs]
        read.append(read_s)
        drive.append([spent_s for _, spent_s in driven])
        write.append([_timed(partial(_written, drives))[1] for drives, _ in driven])
    recorded_s = study.recorded_s / len(study.specs)
    print(f"{data.name}: {study.frame_count // len(study.specs)} frames, {recorded_s:.1f} s recorded")
    print(f"  {'strategy, rule':28s} {'reading':>9s} {'drive':>9s} {'writing':>9s} {'all parts':>9s}")
    ratios = {}
    # what else runs can only make a part longer
    for spec, drive_s, write_s in zip(study.specs, np.min(drive, axis=0), np.min(write, axis=0), strict=True):
        name, times = f"{spec.strategy}, {spec.rule}", (min(read), drive_s, write_s)
        ratios[name] = recorded_s / sum(times)
        columns = " ".join(f"{spent_s:7.3f} s" for spent_s in (*times, sum(times)))
        print(f"  {name:28s} {columns} {ratios[name]:6.1f} x real time")
    slowest = min(ratios, key=ratios.__getitem__)
    met = "at least" if ratios[slowest] >= GOAL else "less than"
    print(
        f"  {met} {GOAL:g} times faster than real time with all parts on: {ratios[slowest]:.1f} times with "
        f"{slowest}, the slowest",
        flush=True,
    )
    return ratios[slowest]


def _driven(study: DriveStudy, spec: DriveSpec) -> list[Drive]:
    return [
        carry_out(r.sequence, replace(spec, vehicle=r.vehicle), study.maps.get(r.map_path))
        for r in study.recordings
    ]


def _written(drives: list[Drive]) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for drive in drives:
            write_log(Path(folder) / "log.parquet", drive.log)


def _timed(call: Callable[[], _T]) -> tuple[_T, float]:
    """A result, and the processor time that it took, s."""
    start_s = time.thread_time()
    result = call()
    return result, time.thread_time() - start_s


def _main() -> int:
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("folder", type=Path, nargs="+", help="data sets, or folders of them")
    parser.add_argument("--strategy", default=STRATEGIES)
    parser.add_argument("--rule", default=RULES)
    parser.add_argument(
        "--repeats", type=int, default=3, help="rounds, of which the fastest counts for each part"
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
    return int(min(ratios) < GOAL)


if __name__ == "__main__":
    raise SystemExit(_main())
