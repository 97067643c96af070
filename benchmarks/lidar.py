"""Processor time of ray casting, with Open3D's beside it.

    python -m benchmarks.lidar [--peer-python PYTHON] [--no-peer] [--rounds N]

The same rays meet the same 30 boxes on a plane in both programs, on one thread; ranges must agree. Then come
bodies of several parts, kerbs and furniture of a shipped street. Open3D runs in an environment of its own,
which is made for the occasion unless an interpreter that has it is named. Exits with 1 if ranges differ or,
where numba is installed, a goal is missed.
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
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from opendrive import RoadNetwork, load_map
from scenarios.sensors.lidar import HDL32, HDL64, MID70, Rosette, Spinning, furnished_street
from scenarios.sensors.lidar.bodies import road_users
from scenarios.sensors.lidar.casting import Motion, RayTable, cast
from scenarios.sensors.lidar.shapes import Bodies, joined

ROOT = Path(__file__).parents[1]
STREET = ROOT / "scenarios" / "maps" / "urban_street_parking.xodr"
PEER = "open3d==0.19.0"
HEIGHT_M = 1.73
BODIES = 30
ROUNDS = 15
GOALS_MS = {"hdl32, front third": 1.0, "hdl64, front third": 5.0}
"""Of processor time, for single boxes; bodies of parts on a furnished street may take three times that."""
RANGE_TOLERANCE_M = 1e-3
"""Open3D calculates in float32: 4e-6 m at 100 m for ranges alone, more for slanted faces."""
SIZES_M = {
    "car": (4.3, 1.8, 1.5),
    "pedestrian": (0.6, 0.5, 1.8),
    "cyclist": (1.9, 0.6, 1.85),
    "truck": (8.0, 2.5, 3.5),
}


@dataclass(frozen=True)
class Row:
    """One line of the table: rays, scene, and what casts them."""

    pattern: str
    scene: str
    caster: str
    rays: int
    spent_ms: float


def spent_ms(work: Callable[[], Any], rounds: int) -> float:
    """Median processor time of `work`, after one call that is not counted."""
    work()
    spent = []
    for _ in range(rounds):
        start = time.process_time()
        work()
        spent.append(time.process_time() - start)
    return 1e3 * statistics.median(spent)


def tables() -> Iterator[tuple[str, RayTable]]:
    """Rays by name; directions are tabulated once, as the sensor does it."""
    for name, config in (("hdl32", HDL32), ("hdl64", HDL64)):
        assert isinstance(config.pattern, Spinning)
        for part, pattern in (
            ("front third", replace(config.pattern, field_rad=2.0 * math.pi / 3.0)),
            ("whole turn", config.pattern),
        ):
            rays = pattern.rays(0)
            yield f"{name}, {part}", RayTable.of(rays.direction, rays.time_offset_s)[0]
    assert isinstance(MID70.pattern, Rosette)
    rays = MID70.pattern.rays(0)
    yield "mid70, 0.1 s", RayTable.of(rays.direction, rays.time_offset_s)[0]


def scene(seed: int, single_box: bool, moving: bool) -> Bodies:
    """Road users 5 to 60 m ahead."""
    rng = np.random.default_rng(seed)
    place = np.column_stack(
        (rng.uniform(5.0, 60.0, BODIES), rng.uniform(-20.0, 20.0, BODIES), np.zeros(BODIES))
    )
    category = rng.choice(list(SIZES_M), BODIES)
    size = np.array([SIZES_M[name] for name in category.tolist()])
    velocity = rng.uniform(-10.0, 10.0, (BODIES, 2)) * moving
    yaw = rng.uniform(-math.pi, math.pi, BODIES)
    return road_users(category, size, place, yaw, velocity, single_box=single_box)


def street_around(network: RoadNetwork) -> Bodies:
    """Kerbs, furniture and parked cars around a place on the middle of a lane, seen from there."""
    lane = int(np.flatnonzero(network.lanes.lane_type == "driving")[0])
    middle = 0.5 * (network.lanes.s_start_m[lane] + network.lanes.s_end_m[lane])
    x, y, _, yaw = (float(column[0]) for column in network.center_line(np.array([lane]), np.array([middle])))
    return furnished_street(network, 10.0, 1).near(x, y, 100.0).seen_from(np.array([x, y]), yaw)


def measured(rounds: int) -> list[Row]:
    """What this program takes."""
    street = street_around(load_map(STREET))
    boxes, parts = scene(1, True, True), scene(1, False, True)
    scenes = {
        f"{BODIES} boxes": boxes,
        f"{BODIES} of parts": parts,
        "parts and street": joined([parts, street]),
    }
    motion = Motion(HEIGHT_M, 14.0, 0.05)
    casters = {"numpy": False} | ({"numba": True} if find_spec("numba") else {})
    rows = []
    for pattern, rays in tables():
        for name, bodies in scenes.items():
            for caster, compiled in casters.items():

                def work(rays: RayTable = rays, bodies: Bodies = bodies, compiled: bool = compiled) -> None:
                    cast(rays, motion, bodies, 0.0, compiled=compiled)

                rows.append(Row(pattern, name, caster, len(rays.time_s), spent_ms(work, rounds)))
    return rows


def compared(python: Path, rounds: int, folder: Path) -> tuple[list[Row], float]:
    """What Open3D takes for standing boxes, and the greatest difference of ranges where both have one."""
    bodies = scene(1, True, False)
    low, high = bodies.bounds
    request = {"rounds": rounds, "height_m": HEIGHT_M, "tables": {}}
    request["boxes"] = np.column_stack((bodies.position_m, bodies.yaw_rad, low, high)).tolist()
    names = dict(tables())
    for number, rays in enumerate(names.values()):
        np.save(folder / f"{number}.npy", rays.direction)
    request["tables"] = [str(folder / f"{number}.npy") for number in range(len(names))]
    (folder / "request.json").write_text(json.dumps(request), encoding="utf-8")
    command = [python, ROOT / "benchmarks" / "lidar_peer.py", folder / "request.json"]
    output = subprocess.run(command, check=True, capture_output=True, text=True).stdout
    answer = json.loads(output.splitlines()[-1])
    rows, worst = [], 0.0
    for number, (name, rays) in enumerate(names.items()):
        ours = cast(rays, Motion(HEIGHT_M), bodies, 0.0).range_m
        theirs = np.load(folder / f"{number}.ranges.npy").astype(np.float64)
        # beyond 300 m a plane of triangles ends; at an outline float32 may see past it
        both = (ours < 300.0) & (theirs < 300.0)
        difference = np.abs(ours[both] - theirs[both])
        worst = max(worst, float(np.quantile(difference, 0.999)))
        rows.append(Row(name, f"{BODIES} boxes", "open3d", len(rays.time_s), answer["spent_ms"][number]))
    return rows, worst


def peer_python(given: Path | None, folder: Path) -> Path:
    """An interpreter that has Open3D."""
    if given is not None:
        return given
    venv.create(folder / "peer", with_pip=True)
    python = folder / "peer" / "bin" / "python"
    subprocess.run([python, "-m", "pip", "install", "-q", PEER], check=True)
    return python


def missed(rows: list[Row]) -> list[str]:
    """Goals that compiled loops miss."""
    lines = []
    for row in rows:
        if row.caster == "numba" and row.pattern in GOALS_MS:
            goal = GOALS_MS[row.pattern] * (1.0 if row.scene == f"{BODIES} boxes" else 3.0)
            if row.spent_ms > goal:
                lines.append(f"{row.pattern}, {row.scene}: {row.spent_ms:.2f} ms, goal {goal:g} ms")
    return lines


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--peer-python", type=Path, help="interpreter that has Open3D")
    parser.add_argument("--no-peer", action="store_true", help="leave Open3D out")
    parser.add_argument("--rounds", type=int, default=ROUNDS)
    options = parser.parse_args()
    rows, worst = measured(options.rounds), 0.0
    if not options.no_peer:
        with tempfile.TemporaryDirectory() as name:
            folder = Path(name)
            peer_rows, worst = compared(peer_python(options.peer_python, folder), options.rounds, folder)
        rows += peer_rows
    print(f"{'rays':22} {'scene':18} {'caster':8} {'number':>8} {'ms':>8}")
    for row in rows:
        print(f"{row.pattern:22} {row.scene:18} {row.caster:8} {row.rays:8} {row.spent_ms:8.2f}")
    if not options.no_peer:
        print(f"ranges of Open3D and ours differ by {worst:.1e} m at most in 999 of 1000 rays")
    lines = missed(rows)
    print("\n".join(lines) if lines else "all goals met" if find_spec("numba") else "no numba, no goals")
    sys.exit(1 if lines or worst > RANGE_TOLERANCE_M else 0)


if __name__ == "__main__":
    main()
