"""Processor time of the LiDAR detectors on a simulated front cloud and on clouds of the user's own.

    python -m benchmarks.lidar_detect [CLOUD ...] [--rounds N]

The plain chain of the thesis stands beside the classical detector in the same run. Each named cloud is taken;
without, a front cloud of 64 lines on a drawn street. The third line is for points within 6 m of the ego's
way only, as a monitored area leaves them. The goal is for front clouds of KITTI, about 19,000 points: the
median over those that are named. Exits with 1 if the classical detector misses it.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from evaluation.studies.lidar.detect import host_name
from evaluation.studies.lidar.drawn import drawn_frames
from scenarios.recorded.clouds.files import read_cloud
from scenarios.sensors.lidar import HDL64, Spinning
from smartmot.lidar import METHODS, BoxDetections, detect
from smartmot.pointcloud import PointCloud

GOAL_MS = 8.0
"""Of a front cloud of KITTI."""
KITTI_POINTS = 17_000, 21_000
"""Such clouds have 19,000 points; other clouds have no goal."""
FIELD_RAD = 1.57
"""Field of KITTI's camera cut out of a turn."""
CORRIDOR_M = 6.0
ROUNDS = 21
MAPS = sorted((Path(__file__).parents[1] / "scenarios" / "maps").glob("*.xodr"))


def spent(cloud: PointCloud, method: str, corridor: bool, rounds: int) -> tuple[float, BoxDetections]:
    """Median processor time in ms after one call that is not counted, and what is detected."""
    config = METHODS[method]()
    monitored = np.abs(cloud.xyz_m[:, 1]) <= CORRIDOR_M if corridor else None
    detections = detect(cloud, config, monitored=monitored)
    times = []
    for _ in range(rounds):
        start = time.process_time()
        detect(cloud, config, monitored=monitored)
        times.append(time.process_time() - start)
    return 1e3 * statistics.median(times), detections


def clouds(paths: list[Path]) -> dict[str, PointCloud]:
    """Those of the files, or a simulated one."""
    if paths:
        return {path.name: read_cloud(path).cloud for path in paths}
    assert isinstance(HDL64.pattern, Spinning)
    config = replace(HDL64, pattern=replace(HDL64.pattern, field_rad=FIELD_RAD))
    return {"simulated front cloud": next(drawn_frames(MAPS, config, 1, 3)).cloud}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("clouds", nargs="*", type=Path, help="files with a cloud each")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    options = parser.parse_args()
    print(f"{host_name()}, one thread")
    print(f"{'cloud':24} {'points':>8} {'method':24} {'ms':>7} {'boxes':>6}")
    judged = []
    for name, cloud in clouds(options.clouds).items():
        for method, corridor in (("plain", False), ("classical", False), ("classical", True)):
            milliseconds, detections = spent(cloud, method, corridor, options.rounds)
            label = f"{method}, {CORRIDOR_M:g} m corridor" if corridor else method
            print(f"{name:24} {len(cloud):8} {label:24} {milliseconds:7.2f} {len(detections):6}")
            if method == "classical" and not corridor and KITTI_POINTS[0] <= len(cloud) <= KITTI_POINTS[1]:
                judged.append(milliseconds)
    if not judged:
        print(f"no front cloud of KITTI named: the goal of {GOAL_MS:g} ms is not judged")
        return
    median_ms = statistics.median(judged)
    missed = median_ms > GOAL_MS
    verdict = "missed" if missed else "met"
    print(f"median of {len(judged)} clouds {median_ms:.2f} ms, goal {GOAL_MS:g} ms: {verdict}")
    sys.exit(1 if missed else 0)


if __name__ == "__main__":
    main()
