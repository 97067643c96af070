"""Scenario files that others have published, and motions along lanes by their lengths alone."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path as FilePath

import numpy as np
import pytest

from opendrive import RoadNetwork
from scenarios.openscenario import Engine, Motion, Run, load
from scenarios.openscenario.motion.paths import Path
from smartmot.types import FloatArray

SHARED = FilePath(__file__).parents[4].parent / "shared" / "openscenario"
FINE_M = 0.1
"""Lanes are measured by chords of this length: 2e-6 of the way on a radius of 20 m."""


class Played:
    """A run of a published file.

    Args:
        engine: after the run.
        run: what it came to.
    """

    def __init__(self, engine: Engine, run: Run) -> None:
        self.engine, self.run = engine, run
        self.time_s = run.time_s

    def row(self, time_s: float) -> int:
        """Number of the sample at a time."""
        row = int(abs(self.time_s - time_s).argmin())
        assert abs(self.time_s[row] - time_s) < 1e-6, time_s
        return row

    def of(self, name: str) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """(T,) x, y, heading and speed of an entity."""
        column = self.run.names.tolist().index(name)
        arrays = (self.run.x_m, self.run.y_m, self.run.yaw_rad, self.run.speed_mps)
        return tuple(a[:, column] for a in arrays)  # type: ignore[return-value]

    def reach_m(self, name: str) -> tuple[float, float]:
        """How far the outline of an entity reaches behind and ahead of its reference point."""
        d = next(e for e in self.engine.definition.entities if e.name == name)
        return d.length_m / 2 - d.center_x_m, d.length_m / 2 + d.center_x_m

    @property
    def network(self) -> RoadNetwork:
        """The map."""
        return self.engine.world.locator.roads.network


class Cruise:
    """Drives the ego at a constant speed from the start."""

    def __init__(self, speed_mps: float) -> None:
        self.commands_from_s, self._speed_mps = 0.0, speed_mps

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Whatever its speed was."""

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """On along its way."""
        return Motion(self._speed_mps * duration_s, self._speed_mps)

    def advance(self, time_s: float, duration_s: float) -> None:
        """Nothing to remember."""


@cache
def _played(
    name: str, values: tuple[tuple[str, object], ...], until_s: float, ego: str, ego_mps: float | None
) -> Played:
    maps = SHARED.parent / "opendrive" / "maps"
    controller = None if ego_mps is None else Cruise(ego_mps)
    engine = Engine(load(SHARED / name, dict(values), maps), controller, ego)
    return Played(engine, engine.run(until_s))


@pytest.fixture
def published() -> Callable[..., Played]:
    """Run a file of `../shared/openscenario` with parameters of one's own."""
    if not SHARED.is_dir():
        pytest.skip(f"no scenario files of others at {SHARED}")

    def run(
        name: str,
        values: dict[str, object] | None = None,
        until_s: float = 300.0,
        ego: str = "Ego",
        ego_mps: float | None = None,
    ) -> Played:
        return _played(name, tuple((values or {}).items()), until_s, ego, ego_mps)

    return run


class Lane:
    """The middle of a lane by its length, whatever its bends: measured by short chords.

    Args:
        network: the map.
        road_id: road.
        lane_id: lane, which is there all along the road.
        offset_m: to the left of the middle along s.
    """

    def __init__(self, network: RoadNetwork, road_id: str, lane_id: int, offset_m: float = 0.0) -> None:
        lanes = [
            index
            for key, index in network.lanes.lane_of_key.items()
            if (key.road_id, key.lane_id) == (road_id, lane_id)
        ]
        rows = []
        for lane in sorted(lanes, key=lambda index: float(network.lanes.s_start_m[index])):
            begin, end = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
            s = np.linspace(begin, end, max(2, round((end - begin) / FINE_M)))
            inner, outer = network.lane_offsets(lane, s)
            points = network.road_point(road_id, s, 0.5 * (inner + outer) + offset_m)
            rows.append(np.column_stack((s, points.x_m, points.y_m)))
        self._s_m, self._x_m, self._y_m = np.concatenate(rows).T
        steps = np.hypot(np.diff(self._x_m), np.diff(self._y_m))
        self._gone_m = np.concatenate(([0.0], np.cumsum(steps)))

    def length_m(self, s_m: float) -> float:
        """Way along the lane from the beginning of the road to s."""
        return float(np.interp(s_m, self._s_m, self._gone_m))

    def s_after(self, s_m: float, way_m: FloatArray | float) -> FloatArray:
        """S after a way along the lane (along s) from s."""
        return np.asarray(np.interp(self.length_m(s_m) + np.asarray(way_m), self._gone_m, self._s_m))

    def points(self, s_m: FloatArray | float) -> FloatArray:
        """(..., 2) x and y at s."""
        x, y = (np.interp(s_m, self._s_m, column) for column in (self._x_m, self._y_m))
        return np.stack((x, y), axis=-1)


def ramp(
    time_s: FloatArray, *changes: tuple[float, float, float], v0: float
) -> tuple[FloatArray, FloatArray]:
    """Way and speed of who changes its speed at constant rates, one change after another.

    Args:
        time_s: (T,) times.
        changes: when each begins, its acceleration (infinite: at once) and the speed that it leads to; a
            later one takes the place of one that is not at its end yet. At once is after the instant.
        v0: speed at time 0.

    Returns:
        (T,) ways since time 0 and speeds.
    """
    way, speed = np.zeros_like(time_s), np.full_like(time_s, v0)
    begin_s, x0, v = 0.0, 0.0, v0
    acceleration, target = 0.0, v0

    def after(seconds: FloatArray) -> tuple[FloatArray, FloatArray]:
        if np.isinf(acceleration) or target == v:
            return target * seconds, np.full_like(seconds, target)
        changing = np.minimum(seconds, abs((target - v) / acceleration))
        rate = np.copysign(acceleration, target - v)
        ways = v * changing + 0.5 * rate * changing**2 + target * (seconds - changing)
        return ways, v + rate * changing

    for at_s, rate, goal in (*changes, (np.inf, 0.0, 0.0)):
        inside = (time_s > begin_s) & (time_s <= at_s)
        inside |= (time_s == 0.0) & (begin_s == 0.0) & (at_s > 0.0)
        ways, speeds = after(time_s[inside] - begin_s)
        way[inside], speed[inside] = x0 + ways, speeds
        if at_s < np.inf:
            gone, reached = after(np.array([at_s - begin_s]))
            x0, v, begin_s = x0 + float(gone[0]), float(reached[0]), at_s
            acceleration, target = rate, goal
    return way, speed
