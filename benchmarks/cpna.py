"""Time of the default comparison (two strategies, six speeds), and what each stage takes of it.

    python -m benchmarks.cpna

The peer, measured in the same process, is highway-env: its own vehicle and IDM on a straight road, stepped as
often and as long, without sensor, map, tracking or decision. The ratio says what perception and exact contact
cost on top of a bare traffic simulation.
"""

from __future__ import annotations

import inspect
import statistics
import sys
import tempfile
import time
from collections import defaultdict
from collections.abc import Callable
from pathlib import Path
from typing import Any

if not __package__:
    # a script's own folder comes first, and has a module of the name opendrive
    sys.path[0] = str(Path(__file__).parents[1])

ROUNDS = 5


class Stages:
    """Wall time per stage; time inside an inner stage is taken from the outer one."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._open: list[float] = []

    def wrap(self, owner: Any, name: str, stage: str) -> None:
        """Measure every call of `owner.name` as part of a stage."""
        member = inspect.getattr_static(owner, name)
        original: Callable[..., Any] = member.fget if isinstance(member, property) else getattr(owner, name)

        def measured(*args: Any, **kwargs: Any) -> Any:
            self._open.append(0.0)
            start = time.perf_counter()
            try:
                return original(*args, **kwargs)
            finally:
                spent = time.perf_counter() - start
                self.seconds[stage] += spent - self._open.pop()
                if self._open:
                    self._open[-1] += spent

        setattr(owner, name, property(measured) if isinstance(member, property) else measured)


def suite() -> Any:
    """The default of `smartmot-eval cpna`."""
    from evaluation.runs.cpna import CpnaSuite
    from evaluation.runs.specs import Conditions

    conditions = Conditions(("rectangular", "map"), "paper", ("dry",), "urban_street")
    return CpnaSuite((10, 20, 30, 40, 50, 60), conditions)


def computing(directory: Path) -> tuple[float, float]:
    """Seconds for loading, running and writing as the command does, and simulated seconds."""
    from evaluation.results.files import log_path
    from evaluation.results.logs import read_log
    from evaluation.results.rows import write_runs
    from evaluation.runs import cpna
    from evaluation.runs.logged import logged_runs
    from evaluation.studies.suite import suite_configuration

    start = time.perf_counter()
    comparison = suite()
    site = cpna.load_site(comparison)
    specs = comparison.specs(site)
    rows = [record.row for record in logged_runs(specs, directory, workers=1)]
    write_runs(directory, rows, suite_configuration(comparison, site, directory))
    spent = time.perf_counter() - start
    return spent, sum(float(read_log(log_path(directory, spec.log))["time_s"].max()) for spec in specs)


def peer(simulated_s: float) -> float:
    """Seconds for highway-env alone to step one vehicle as long, at the same 10 ms."""
    from highway_env.road.road import Road, RoadNetwork
    from highway_env.vehicle.behavior import IDMVehicle

    road = Road(RoadNetwork.straight_road_network(1, length=1000))
    vehicle = IDMVehicle(road, [0.0, 0.0], speed=13.9, target_lane_index=("0", "1", 0), target_speed=13.9)
    road.vehicles.append(vehicle)
    start = time.perf_counter()
    for step in range(round(simulated_s / 0.01)):
        if step % 5 == 0:
            road.act()
        road.step(0.01)
    return time.perf_counter() - start


def stage_shares(directory: Path) -> dict[str, float]:
    """Seconds per stage of one more run of the suite, with measuring switched on."""
    from evaluation.results import rows
    from evaluation.runs import cpna, logged
    from scenarios import spec
    from scenarios.openscenario.running.engine import Engine
    from scenarios.sensors.suite import SensorSuite
    from scenarios.simulation.log import RunLog
    from scenarios.simulation.simulation import Simulation
    from scenarios.simulation.truth import Truth
    from scenarios.sources import perception
    from smartmot import pipeline
    from smartmot.area import lanes, rectangle
    from smartmot.tracking import tracker

    stages = Stages()
    stages.wrap(cpna, "load_site", "map and place")
    stages.wrap(spec, "definition_of", "scenario file")
    stages.wrap(perception.AreaPipelines, "__call__", "map and place")
    stages.wrap(Simulation, "run", "closed loop")
    stages.wrap(Engine, "__init__", "world: engine")
    stages.wrap(Engine, "advance", "world: engine")
    stages.wrap(Truth, "entities", "world: engine")
    stages.wrap(SensorSuite, "measure", "sensor")
    stages.wrap(pipeline.Pipeline, "step", "forecast, threats, decision")
    stages.wrap(tracker.Tracker, "step", "tracking")
    for area in (lanes.MapArea, rectangle.RectangularArea):
        stages.wrap(area, "at", "monitored area")
    for area in (lanes.MonitoredLanes, rectangle._Rectangle):
        for name in ("kept", "relevance", "on_lane"):
            stages.wrap(area, name, "monitored area")
    for name in ("frame", "perception", "table"):
        stages.wrap(RunLog, name, "recording")
    stages.wrap(logged, "write_log", "files")
    stages.wrap(rows, "write_runs", "files")
    computing(directory)
    return dict(stages.seconds)


def main() -> int:
    """Print medians, the ratio to the peer and the share of each stage."""
    with tempfile.TemporaryDirectory() as scratch:
        directory = Path(scratch)
        computing(directory)  # warm up: imports, file cache
        times, ratios = [], []
        for _ in range(ROUNDS):
            seconds, simulated = computing(directory)
            times.append(seconds)
            ratios.append(seconds / peer(simulated))
        shares = stage_shares(directory)
    print(f"12 runs, {simulated:.0f} s simulated, median of {ROUNDS}:")
    print(f"  computing        {statistics.median(times):6.2f} s  ({min(times):.2f} .. {max(times):.2f})")
    print(f"  x real time      {simulated / statistics.median(times):6.1f}")
    print(f"  / highway-env    {statistics.median(ratios):6.2f}    (bare stepping, same run)")
    total = sum(shares.values())
    print("share of each stage (measured once more, with timers on):")
    for stage, seconds in sorted(shares.items(), key=lambda item: -item[1]):
        print(f"  {stage:<28}{100 * seconds / total:5.1f} %")
    return 0


if __name__ == "__main__":
    sys.exit(main())
