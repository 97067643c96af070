"""Processor time of the pedestrian test with a LiDAR in the loop, by stage.

    python -m benchmarks.lidar_loop [--sensor hdl32] [--perception classical] [--street bare]

Twelve runs: rectangle and map at 10 to 60 km/h, one after the other on one core. Stages: clouds (ray casting,
noise, points), detections (the detector), perception (tracker, forecast, area, rule), and the rest (engine,
logs). Frames that both strategies share are made once, as in `cpna`. One run before that is not counted: it
compiles. Exits with 1 if the runs take more than the goal; without numba there is none, and that is said.
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable
from importlib.util import find_spec
from typing import Any

from evaluation.runs.cpna import CpnaSuite, load_site
from evaluation.runs.specs import Conditions
from scenarios.sensing import STREETS
from scenarios.sensors.lidar import chain as lidar_chain
from scenarios.sensors.lidar.chain import DEFAULT_PERCEPTION, PERCEPTIONS, CloudDetector
from scenarios.sensors.lidar.config import SENSORS
from scenarios.sensors.lidar.cutout import CutoutDetector, LabelDetector
from scenarios.sensors.lidar.sensor import LidarSensor
from scenarios.spec import simulation_of

GOAL_S = 20.0
"""Of processor time for all runs, with compiled ray casting."""

SPEEDS_KMH = tuple(float(speed) for speed in range(10, 61, 10))


def timed(owner: type, method: str, stage: str, spent_s: Counter[str], calls: Counter[str]) -> None:
    """Add the processor time of a method to a stage."""
    original: Callable[..., Any] = getattr(owner, method)

    def measured(*arguments: Any, **named: Any) -> Any:
        start = time.process_time()
        try:
            return original(*arguments, **named)
        finally:
            spent_s[stage] += time.process_time() - start
            calls[stage] += 1

    setattr(owner, method, measured)


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--sensor", choices=SENSORS, default="hdl32")
    parser.add_argument("--perception", choices=PERCEPTIONS, default=DEFAULT_PERCEPTION)
    parser.add_argument("--street", choices=STREETS, default=STREETS[0])
    parser.add_argument("--preset", default="physical")
    options = parser.parse_args()
    settings = (("sensor", options.sensor), ("perception", options.perception), ("street", options.street))
    conditions = Conditions(("rectangular", "map"), options.preset, settings=settings)
    suite = CpnaSuite(SPEEDS_KMH, conditions)
    specs = suite.specs(load_site(suite))
    simulation_of(specs[0]).run()
    lidar_chain._kept.clear()  # so that no frame of it is there
    spent_s: Counter[str] = Counter()
    calls: Counter[str] = Counter()
    timed(LidarSensor, "label", "clouds", spent_s, calls)
    for detector in (CloudDetector, CutoutDetector, LabelDetector):
        timed(detector, "detect", "detections", spent_s, calls)
    start, frames, perception_s = time.process_time(), 0, 0.0
    for spec in specs:
        outcome = simulation_of(spec).run()
        frames += len(outcome.frame_time_ms)
        perception_s += 1e-3 * float(outcome.frame_time_ms.sum())
    total_s = time.process_time() - start
    spent_s["perception"], calls["perception"] = perception_s, frames
    spent_s["rest"], calls["rest"] = total_s - sum(spent_s.values()), frames
    print(f"{options.sensor}, {options.perception}, {options.street} street, preset {options.preset}")
    print(f"{'stage':12} {'s':>8} {'frames':>8} {'ms':>8}")
    for stage in ("clouds", "detections", "perception", "rest"):
        each_ms = 1e3 * spent_s[stage] / max(calls[stage], 1)
        print(f"{stage:12} {spent_s[stage]:8.2f} {calls[stage]:8} {each_ms:8.2f}")
    print(f"{len(specs)} runs: {total_s:.1f} s of processor time, {frames} frames")
    if find_spec("numba") is None:
        print("no numba, no goal: pip install 'smartmot[fast]'")
        return
    print(f"goal {GOAL_S:g} s: {'met' if total_s <= GOAL_S else 'missed'}")
    sys.exit(total_s > GOAL_S)


if __name__ == "__main__":
    main()
