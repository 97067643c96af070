"""Time of the tracker against norfair, motpy and a loop over filterpy's filters, all in one run.

    python -m benchmarks.tracking [--kitti DIR] [--peer-python PYTHON]

Scenes: constant-velocity cars on an 8 m grid, 10 to 1000 of them, that all drive the same way and so keep the
grid; the same with a velocity for each ("mixed"), which lets them drive through each other; and the
pedestrians of KITTI where DIR holds detections/Pedestrian. Times are processor time per update, medians over
the frames; every tracker gets the same detections in the form that it wants, prepared before. norfair and
motpy need an older NumPy: they run in an environment of their own, made from PyPI in a temporary folder
unless --peer-python names one that has them. norfair matches by distance, motpy by the IoU of axis-aligned
boxes; ours by rotated BEV IoU.
"""

from __future__ import annotations

import argparse
import json
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from functools import partial
from pathlib import Path

import numpy as np

from smartmot import Boxes, Detections, Tracker, bev_iou, detections_from_arrays, tracker_config
from smartmot.geometry import corners, near_pairs
from smartmot.types import FloatArray, IntArray

COUNTS = (10, 30, 100, 300, 1000)
PEER_LIMIT = 300
"""Peers are measured up to this many objects; they grow with the square and more."""

LIMIT_MS = {"10": 0.3, "30": 0.6, "100": 2.0, "300": 8.0, "1000": 40.0, "kitti": 0.4}
"""Times of a scene that the tracker is meant to stay under."""

FRAME_S = 0.1
SIZE_M = (4.5, 1.8)
PEER_PACKAGES = ("numpy<2", "norfair==2.3.0", "motpy==0.0.10", "filterpy==1.4.5")

PEER_PROGRAM = r"""
import json, statistics, sys, time
import numpy as np


def norfair(frames):
    import norfair as package

    tracker = package.Tracker(distance_function="euclidean", distance_threshold=2.0)
    given = [[package.Detection(points=row[None, :2]) for row in np.array(f).reshape(-1, 5)] for f in frames]
    return tracker.update, given


def motpy(frames):
    import motpy as package

    tracker = package.MultiObjectTracker(dt=0.1)
    given = []
    for frame in frames:
        rows = np.array(frame).reshape(-1, 5)
        low, high = rows[:, :2] - rows[:, 2:4] / 2, rows[:, :2] + rows[:, 2:4] / 2
        given.append([package.Detection(box=np.concatenate(b), score=0.9) for b in zip(low, high)])
    return tracker.step, given


def filterpy(frames):
    from filterpy.kalman import KalmanFilter
    from scipy.optimize import linear_sum_assignment

    filters = []

    def make(row):
        f = KalmanFilter(dim_x=4, dim_z=2)
        f.F = np.eye(4) + 0.1 * np.eye(4, k=2)
        f.H, f.R, f.Q = np.eye(2, 4), 0.01 * np.eye(2), 0.01 * np.eye(4)
        f.x[:2, 0] = row[:2]
        return f

    def update(rows):
        for f in filters:
            f.predict()
        if filters and len(rows):
            centers = np.array([f.x[:2, 0] for f in filters])
            cost = np.linalg.norm(centers[:, None] - rows[None, :, :2], axis=2)
            matched = {j: i for i, j in zip(*linear_sum_assignment(cost)) if cost[i, j] < 2.0}
        else:
            matched = {}
        for j, row in enumerate(rows):
            if j in matched:
                filters[matched[j]].update(row[:2])
            else:
                filters.append(make(row))

    return update, [np.array(f).reshape(-1, 5) for f in frames]


times = {}
for scene, frames in json.load(sys.stdin).items():
    for make in (norfair, motpy, filterpy):
        update, given = make(frames)
        spent = []
        for detections in given:
            start = time.process_time()
            update(detections)
            spent.append(time.process_time() - start)
        times[f"{make.__name__} {scene}"] = statistics.median(spent[5:]) * 1e3
json.dump(times, sys.stdout)
"""


def grid(count: int, frames: int, mixed: bool = False) -> list[FloatArray]:
    """(N, 5) rows x, y, length, width, yaw per frame: cars on an 8 m grid.

    Args:
        count: N, how many.
        frames: How many frames.
        mixed: Each car has its own velocity; after some seconds the grid is gone and some overlap.
    """
    rng = np.random.default_rng(count)
    side = int(np.ceil(np.sqrt(count)))
    start = 8.0 * np.stack(np.meshgrid(np.arange(side), np.arange(side)), axis=-1).reshape(-1, 2)[:count]
    own = (count,) if mixed else (1,)
    yaw, speed = rng.uniform(-np.pi, np.pi, own), rng.uniform(0, 2, own)
    velocity = speed[:, None] * np.column_stack((np.cos(yaw), np.sin(yaw)))
    size = np.tile(SIZE_M, (count, 1))
    scene = []
    for k in range(frames):
        center = start + FRAME_S * k * velocity + rng.normal(0, 0.05, (count, 2))
        rows = np.column_stack((center, size, yaw + rng.normal(0, 0.02, count)))
        scene.append(rows[rng.permutation(count)])
    return scene


def kitti(folder: Path) -> list[FloatArray]:
    """(N, 5) rows of the pedestrians in the camera's ground plane, all sequences one after the other."""
    scene: list[FloatArray] = []
    for path in sorted((folder / "detections" / "Pedestrian").glob("*.txt")):
        rows = np.loadtxt(path, delimiter=",", ndmin=2)
        # frame, type, 2D box (4), score, h, w, l, x, y, z, ry, alpha: x is to the right and z ahead.
        boxes = np.column_stack((rows[:, 12], -rows[:, 10], rows[:, 9], rows[:, 8], -rows[:, 13] - np.pi / 2))
        scene += [boxes[rows[:, 0] == k] for k in range(int(rows[:, 0].max()) + 1)]
    return scene


def ours(scene: list[FloatArray], category: str, config: str) -> float:
    """Median milliseconds per update, from arrays to tracks: everything included."""
    tracker, spent = Tracker(tracker_config(config)), []
    for k, rows in enumerate(scene):
        names = [category] * len(rows)
        start = time.process_time()
        detections, _ = detections_from_arrays(
            FRAME_S * k, rows[:, :2], rows[:, 2:4], rows[:, 4], category=names
        )
        tracker.update(detections)
        spent.append(time.process_time() - start)
    return statistics.median(spent[5:]) * 1e3


def ready(scene: list[FloatArray], category: str, config: str) -> float:
    """Median milliseconds per update alone, detections made before."""
    frames = [
        Detections(
            FRAME_S * k,
            Boxes(rows[:, :2], rows[:, 2:4], rows[:, 4]),
            np.ones(len(rows)),
            np.full(len(rows), category),
        )
        for k, rows in enumerate(scene)
    ]
    tracker, spent = Tracker(tracker_config(config)), []
    for frame in frames:
        start = time.process_time()
        tracker.update(frame)
        spent.append(time.process_time() - start)
    return statistics.median(spent[5:]) * 1e3


def peer_python(folder: Path) -> str:
    """Interpreter of a new environment with the peers."""
    venv.create(folder, with_pip=True)
    python = str(folder / "bin" / "python")
    subprocess.run([python, "-m", "pip", "install", "-q", *PEER_PACKAGES], check=True)
    return python


def peers(python: str, scenes: dict[str, list[FloatArray]]) -> dict[str, float]:
    """Median milliseconds per update of every peer and scene."""
    given = json.dumps({name: [rows.tolist() for rows in scene] for name, scene in scenes.items()})
    run = subprocess.run(
        [python, "-c", PEER_PROGRAM], input=given, capture_output=True, text=True, check=True
    )
    times_ms: dict[str, float] = json.loads(run.stdout)
    return times_ms


def overlaps() -> None:
    """Rotated IoU of N x N boxes against shapely on the pairs whose circles meet."""
    print("\nrotated BEV IoU, N x N boxes     gated pairs   us/gated pair   us/pair   shapely us/gated pair")
    for count, spacing_m in ((10, 2.0), (100, 8.0), (100, 2.0), (300, 2.0)):
        rng = np.random.default_rng(count)
        center = rng.uniform(0, spacing_m * np.sqrt(count), (count, 2))
        size = np.tile(SIZE_M, (count, 1))
        a = Boxes(center, size, rng.uniform(-3, 3, count))
        b = Boxes(center + rng.normal(0, 0.5, (count, 2)), size, rng.uniform(-3, 3, count))
        radius = 0.5 * np.hypot(size[:, 0], size[:, 1])
        i, j = near_pairs(a.center_m, b.center_m, radius, radius)

        us = median_us(partial(bev_iou, a, b))
        peer = median_us(partial(shapely_areas, a, b, i, j))
        print(
            f"  N = {count:<4} {count / (spacing_m**2 * count) * 100:5.1f} per 100 m2    {len(i):>8}"
            f"{us / len(i):>15.3f}{us / count**2:>11.4f}{peer / len(i):>18.3f}"
        )


def shapely_areas(a: Boxes, b: Boxes, i: IntArray, j: IntArray) -> FloatArray:
    """(P,) common areas of pairs."""
    import shapely

    first = shapely.polygons(corners(a.center_m[i], a.size_m[i], a.yaw_rad[i]))
    second = shapely.polygons(corners(b.center_m[j], b.size_m[j], b.yaw_rad[j]))
    return np.asarray(shapely.area(shapely.intersection(first, second)))


def median_us(call: Callable[[], object], repeats: int = 31) -> float:
    """Median microseconds of processor time."""
    spent = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        spent.append(time.process_time() - start)
    return statistics.median(spent) * 1e6


def main() -> int:
    """Print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--kitti", type=Path, default=Path(__file__).parents[2] / "shared" / "kitti")
    parser.add_argument("--peer-python", help="interpreter that has norfair, motpy and filterpy")
    parser.add_argument("--config", default="default")
    arguments = parser.parse_args()
    lengths = {count: 200 if count <= 100 else 60 for count in COUNTS}
    scenes = {str(count): grid(count, frames) for count, frames in lengths.items()}
    compared = {name: scene for name, scene in scenes.items() if int(name) <= PEER_LIMIT}
    scenes |= {f"{count} mixed": grid(count, frames, mixed=True) for count, frames in lengths.items()}
    if (arguments.kitti / "detections" / "Pedestrian").is_dir():
        compared["kitti"] = kitti(arguments.kitti)
    else:
        print(f"{arguments.kitti}: no detections/Pedestrian, KITTI left out")
    with tempfile.TemporaryDirectory() as scratch:
        python = arguments.peer_python or peer_python(Path(scratch))
        peer_times = peers(python, compared)
    print("median ms per update (processor time)")
    print("  objects       smartmot  from arrays  limit   norfair   motpy   filterpy   norfair / smartmot")
    for name, scene in (scenes | {k: v for k, v in compared.items() if k == "kitti"}).items():
        category = "pedestrian" if name == "kitti" else "car"
        own_ms, all_in = ready(scene, category, arguments.config), ours(scene, category, arguments.config)
        limit = LIMIT_MS.get(name)
        peer_ms = [peer_times.get(f"{peer} {name}") for peer in ("norfair", "motpy", "filterpy")]
        shown = "".join(f"{t:>10.3f}" if t else f"{'-':>10}" for t in peer_ms)
        ratio = f"{peer_ms[0] / own_ms:>12.1f}" if peer_ms[0] else ""
        bound = f"{limit:>9.1f}" if limit else f"{'-':>9}"
        print(f"  {name:<11}{own_ms:>10.3f}{all_in:>12.3f}{bound}{shown}{ratio}")
    overlaps()
    return 0


if __name__ == "__main__":
    sys.exit(main())
