"""Time and memory of `opendrive`, as ratios against lxml's bare parsing and against CARLA's C++ library.

    python -m benchmarks.opendrive [--peer-python PYTHON] [--no-peer] [--rounds N] [MAP.xodr ...]

Everything is timed in one run, in processor time, as medians over rounds. CARLA's library (libcarla,
package carla on PyPI) runs in an environment of its own, which is made for the occasion unless an
interpreter that has it is named. Without maps on the command line the reference maps beside the project are
taken if they are there, else the ones that are shipped.
"""

from __future__ import annotations

import argparse
import json
import math
import statistics
import subprocess
import sys
import tempfile
import time
import venv
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from opendrive import RoadNetwork, load_map

ROOT = Path(__file__).parents[1]
REFERENCE = ROOT.parent / "shared" / "opendrive" / "maps"
REFERENCE_NAMES = ("esmini_fabriksgatan", "Town01", "c0910_Town10HD", "Town03", "Town04", "Town05")
PEER = "carla==0.9.16"
POINTS = 10_000
ROUNDS = 7
STEP_M = 1.0
SINGLES = 1_000
"""Points and poses that are asked for one by one."""

FAR_M = 500.0
"""How far points lie from the longest road."""

_MEMORY = """
import gc, sys
import numpy as np
def resident_mb():
    gc.collect()
    with open("/proc/self/statm") as stream:
        return int(stream.read().split()[1]) * 4096 / 1e6
bare = resident_mb()
from opendrive import load_map
network = load_map(sys.argv[1])
loaded = resident_mb()
points = np.zeros((1, 2))
network.locate(points), network.nearest_lane(points), network.successors(0)
print(loaded - bare, resident_mb() - bare)
"""


_LOAD = """
import gc, os, statistics, sys, time
from lxml import etree
from opendrive import load_map
path, rounds = sys.argv[1], int(sys.argv[2])
def spent(work):
    start = time.process_time()
    result = work()
    return time.process_time() - start, result
def apart(steps):
    # In a process of its own: memory that one reading gave back slows the next one down, whosever it is.
    end, start = os.pipe()
    child = os.fork()
    if not child:
        os.write(start, " ".join(map(str, steps())).encode())
        os._exit(0)
    os.close(start)
    os.waitpid(child, 0)
    with os.fdopen(end) as stream:
        return [float(word) for word in stream.read().split()]
def bare():
    return [spent(lambda: etree.parse(path))[0]]
def ours():
    loading, network = spent(lambda: load_map(path))
    return loading, spent(lambda: network.model.warnings)[0], spent(lambda: network.findings)[0]
# What only the first reading of a process pays for is not counted.
bare(), ours()
# Else a collection in a child would copy the memory of its parent.
gc.collect()
gc.freeze()
rows = [[*apart(bare), *apart(ours)] for _ in range(rounds)]
print(*(statistics.median(column) for column in zip(*rows)))
"""


def seconds(work: Callable[[], Any], rounds: int) -> float:
    """Median processor time of `work`."""
    spent = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        spent.append(time.process_time() - start)
    return statistics.median(spent)


def points_of(network: RoadNetwork) -> np.ndarray:
    """Half of the points anywhere within the map's bounds, half on its lanes."""
    rng = np.random.default_rng(0)
    bounds = network.bounds
    anywhere = rng.uniform(bounds[:2], bounds[2:], (POINTS // 2, 2))
    borders = network.sampled_borders(STEP_M)
    row = rng.integers(0, len(borders.s_m), POINTS - POINTS // 2)
    share = rng.random((len(row), 1))
    on_lanes = borders.left_m[row, :2] + share * (borders.right_m[row] - borders.left_m[row])[:, :2]
    return np.concatenate([anywhere, on_lanes])


def places_of(network: RoadNetwork) -> list[tuple[int, int, float]]:
    """Road, lane and s of every metre of every lane, for roads whose ids are numbers."""
    borders = network.sampled_borders(STEP_M)
    lane = np.repeat(np.arange(len(network.lanes)), np.diff(borders.first)).tolist()
    keys = network.lanes.key
    return [
        (int(keys[i].road_id), keys[i].lane_id, s)
        for i, s in zip(lane, borders.s_m.tolist(), strict=True)
        if keys[i].road_id.lstrip("-").isdigit()
    ]


def ours(path: Path, rounds: int) -> dict[str, float]:
    """Seconds of each task on one map; the first query of a network includes making its index."""
    parsing, loading, reading, checking = load_times(path, rounds)
    network = load_map(path)
    points = points_of(network)
    first: dict[str, list[float]] = {}
    for _ in range(rounds):
        for name, query in (
            ("inside_first_s", lambda fresh: fresh.locate(points)),
            ("nearest_first_s", lambda fresh: fresh.nearest_lane(points)),
            ("borders_first_s", lambda fresh: fresh.sampled_borders(STEP_M)),
            ("graph_first_s", lambda fresh: fresh.successors(0)),
        ):
            fresh = load_map(path)
            start = time.process_time()
            query(fresh)
            first.setdefault(name, []).append(time.process_time() - start)
    return {
        "lanes": len(network.lanes),
        "lxml_s": parsing,
        "load_s": loading,
        "warnings_s": reading,
        "findings_s": checking,
        **singles(network, points, rounds),
        "far_s": far_off(network, rounds),
        "inside_s": seconds(lambda: network.locate(points), rounds),
        "nearest_s": seconds(lambda: network.nearest_lane(points), rounds),
        "borders_s": seconds(lambda: network.sampled_borders(STEP_M), rounds),
        **{name: statistics.median(spent) for name, spent in first.items()},
    }


def singles(network: RoadNetwork, points: np.ndarray, rounds: int) -> dict[str, float]:
    """Seconds of a single query, asked after each other."""
    some = [point[None] for point in points[:: len(points) // SINGLES]]
    lanes = network.lanes
    every = range(0, len(lanes), max(1, len(lanes) // SINGLES))
    poses = [(i, float(0.5 * (lanes.s_start_m[i] + lanes.s_end_m[i]))) for i in every]
    return {
        "single_inside_s": seconds(lambda: [network.locate(point) for point in some], rounds) / len(some),
        "single_nearest_s": seconds(lambda: [network.nearest_lane(p) for p in some], rounds) / len(some),
        "single_pose_s": seconds(lambda: [network.center_line(*pose) for pose in poses], rounds) / len(poses),
    }


def far_off(network: RoadNetwork, rounds: int) -> float:
    """Seconds per point of coordinates along the longest road, of points far off it."""
    road = max(network.roads.values(), key=lambda road: road.length_m)
    rng = np.random.default_rng(0)
    at = road.point(rng.uniform(0.0, road.length_m, POINTS), np.zeros(POINTS))
    angle = rng.uniform(0.0, 2.0 * np.pi, POINTS)
    points = np.stack([at.x_m + FAR_M * np.cos(angle), at.y_m + FAR_M * np.sin(angle)], axis=1)
    return seconds(lambda: road.coordinates(points), rounds) / POINTS


def load_times(path: Path, rounds: int) -> tuple[float, float, float, float]:
    """Median seconds of lxml's parsing, loading, warnings of reading and checks, each in processes apart."""
    command = [sys.executable, "-c", _LOAD, str(path), str(rounds)]
    result = subprocess.run(command, capture_output=True, text=True, cwd=ROOT, check=True)
    parsing, loading, reading, checking = (float(value) for value in result.stdout.split())
    return parsing, loading, reading, checking


def memory_mb(path: Path) -> tuple[float, float] | None:
    """Resident memory over a bare interpreter with numpy: loaded, indexed; None where it cannot be read."""
    result = subprocess.run(
        [sys.executable, "-c", _MEMORY, str(path)], capture_output=True, text=True, cwd=ROOT, check=False
    )
    if result.returncode:
        return None
    loaded, indexed = (float(value) for value in result.stdout.split())
    return loaded, indexed


def peer_times(python: str, path: Path, rounds: int) -> dict[str, float]:
    """Seconds of each task with the peer.

    Raises:
        RuntimeError: the peer cannot read the map.
    """
    network = load_map(path)
    with tempfile.TemporaryDirectory() as directory:
        request = Path(directory) / "request.json"
        request.write_text(
            json.dumps(
                {
                    "map": str(path.resolve()),
                    "points": points_of(network).tolist(),
                    "places": places_of(network),
                    "rounds": min(rounds, 3),
                }
            ),
            encoding="utf-8",
        )
        script = Path(__file__).with_name("opendrive_peer.py")
        result = subprocess.run(
            [python, str(script), str(request)], capture_output=True, text=True, check=False
        )
    if result.returncode:
        reason = (result.stderr.strip() or "no output").splitlines()[-1]
        raise RuntimeError(f"exit code {result.returncode}: {reason:.120}")
    times: dict[str, float] = json.loads(result.stdout.splitlines()[-1])
    return times


def make_peer(directory: Path) -> str:
    """Make an environment with the peer and return its interpreter.

    Raises:
        RuntimeError: the environment cannot be made, for want of a network or of a wheel for this Python.
    """
    venv.create(directory, with_pip=True)
    python = directory / ("Scripts/python.exe" if sys.platform == "win32" else "bin/python")
    install = [str(python), "-m", "pip", "install", "--quiet", "--disable-pip-version-check", PEER]
    result = subprocess.run(install, capture_output=True, text=True, check=False)
    if result.returncode:
        raise RuntimeError((result.stderr.strip() or "pip failed").splitlines()[-1])
    return str(python)


def default_maps() -> list[Path]:
    """The reference maps if they are there, else the shipped ones."""
    reference = [REFERENCE / f"{name}.xodr" for name in REFERENCE_NAMES]
    return [path for path in reference if path.is_file()] or sorted(
        (ROOT / "scenarios" / "maps").glob("*.xodr")
    )


def report(path: Path, rounds: int, python: str | None) -> dict[str, float]:
    """Measure one map and print its lines."""
    our_values = ours(path, rounds)
    per_point = 1e6 / POINTS
    print(f"\n{path.stem}: {our_values['lanes']} lanes")
    print(
        f"  load                 {1e3 * our_values['load_s']:8.1f} ms   "
        f"{our_values['load_s'] / our_values['lxml_s']:6.2f} x lxml"
    )
    for name, label in (("warnings", "warnings of reading"), ("findings", "checks")):
        spent = our_values[f"{name}_s"]
        print(f"  {label:<20} {1e3 * spent:8.1f} ms   {spent / our_values['lxml_s']:6.2f} x lxml")
    for name, label in (("inside", "one point"), ("nearest", "nearest to one"), ("pose", "one pose")):
        print(f"  {label:<20} {1e6 * our_values[f'single_{name}_s']:8.2f} us")
    print(f"  far off a long road  {1e6 * our_values['far_s']:8.2f} us per point")
    for name, label in (("inside", "lanes at a point"), ("nearest", "nearest driving lane")):
        steady, first = (per_point * our_values[f"{name}{suffix}"] for suffix in ("_s", "_first_s"))
        print(f"  {label:<20} {steady:8.2f} us   {first:6.2f} us with the index made")
    steady, first = 1e3 * our_values["borders_s"], 1e3 * our_values["borders_first_s"]
    print(f"  borders at 1 m       {steady:8.1f} ms   {first:6.1f} ms the first time")
    print(f"  lane graph           {1e3 * our_values['graph_first_s']:8.1f} ms to make")
    used = memory_mb(path)
    if used is None:
        print("  memory               cannot be read on this system")
    else:
        print(f"  memory over numpy    {used[0]:8.1f} MB   {used[1]:6.1f} MB indexed")
    if python is not None:
        try:
            peer = peer_times(python, path, rounds)
        except (RuntimeError, OSError) as error:
            print(f"  libcarla             cannot do this map: {error}")
            return our_values
        print(
            f"  libcarla             load {1e3 * peer['load_s']:.1f} ms, "
            f"{peer['load_s'] / our_values['lxml_s']:.2f} x lxml"
        )
        for name, label in (
            ("inside", "lanes at a point"),
            ("nearest", "nearest driving lane"),
            ("borders", "borders at 1 m"),
            ("pose", "one pose"),
        ):
            if name == "pose":
                ratio = peer["pose_s"] / our_values["single_pose_s"]
                print(f"    {label:<20} {1e6 * peer['pose_s']:6.1f} us, {ratio:5.1f} x ours")
                continue
            ratio = peer[f"{name}_s"] / our_values[f"{name}_s"]
            unit = 1e3 * peer[f"{name}_s"] if name == "borders" else per_point * peer[f"{name}_s"]
            print(f"    {label:<20} {unit:6.1f} {'ms' if name == 'borders' else 'us'}, {ratio:5.1f} x ours")
    return our_values


def main(arguments: list[str] | None = None) -> None:
    """Run the benchmark."""
    parser = argparse.ArgumentParser(prog="benchmarks.opendrive", description=__doc__.splitlines()[0])
    parser.add_argument("maps", nargs="*", type=Path)
    parser.add_argument("--peer-python", help="interpreter of an environment that has carla")
    parser.add_argument("--no-peer", action="store_true")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    options = parser.parse_args(arguments)
    maps = options.maps or default_maps()
    print(f"{POINTS} points, half of them on lanes; processor time, medians of {options.rounds} rounds")
    with tempfile.TemporaryDirectory() as directory:
        python = None
        if not options.no_peer:
            try:
                python = options.peer_python or make_peer(Path(directory) / "peer")
            except (RuntimeError, OSError, subprocess.SubprocessError) as error:
                print(f"libcarla cannot be had, its ratios are left out: {error}")
        measured = [report(path, options.rounds, python) for path in maps]
    print(
        "\nGrowth with the size of the map, against the smallest one: time per point, logarithm of the lanes"
    )
    base = min(measured, key=lambda one: one["lanes"])
    for path, one in zip(maps, measured, strict=True):
        growth = [one[name] / base[name] for name in ("inside_s", "nearest_s")]
        expected = math.log(max(one["lanes"], 2)) / math.log(max(base["lanes"], 2))
        print(f"  {path.stem:<24} inside x {growth[0]:.2f}, nearest x {growth[1]:.2f}, log x {expected:.2f}")


if __name__ == "__main__":
    main()
