"""An entity that another simulator moves: exactly as that one does between two of its steps."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenarios.openscenario.control import Motion
from scenarios.openscenario.motion.paths import Path, Pose


@dataclass(frozen=True, slots=True)
class Place:
    """Middle of an outline in the map frame, and the speed along its heading."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float


class Carried:
    """Moves an entity from one place to the next within a step, with constant acceleration.

    This is how SUMO's ballistic update moves a vehicle; one that comes to rest inside the step stands from
    then on.

    Args:
        place: where it is.
        from_s: when the step begins.
        step_s: its duration.
    """

    commands_from_s = 0.0

    def __init__(self, place: Place, from_s: float, step_s: float) -> None:
        self.before = self.after = place
        self.from_s, self.step_s = from_s, step_s

    def go_on(self, place: Place, from_s: float) -> None:
        """Begin the next step, which ends at a place."""
        self.before, self.after, self.from_s = self.after, place, from_s

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Nothing of the scenario's is gone on with."""

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """Where it is then, and how far it has gone since."""
        before, after = self.before, self.after
        into_s = time_s - self.from_s
        part, speed_mps = self._gone(into_s + duration_s)
        dx, dy = after.x_m - before.x_m, after.y_m - before.y_m
        turn = math.remainder(after.yaw_rad - before.yaw_rad, 2.0 * math.pi)
        pose = Pose(before.x_m + part * dx, before.y_m + part * dy, before.yaw_rad + part * turn)
        return Motion((part - self._gone(into_s)[0]) * math.hypot(dx, dy), speed_mps, pose)

    def advance(self, time_s: float, duration_s: float) -> None:
        """Nothing: where it is follows from the time alone."""

    def _gone(self, into_s: float) -> tuple[float, float]:
        """Share of the step's way at a time into it, and the speed then."""
        v0, v1, step_s = self.before.speed_mps, self.after.speed_mps, self.step_s
        t = min(max(into_s, 0.0), step_s)
        length_m = math.hypot(self.after.x_m - self.before.x_m, self.after.y_m - self.before.y_m)
        steady_m = 0.5 * (v0 + v1) * step_s
        if v1 == 0.0 and 0.0 < length_m < steady_m:
            stops_s = 2.0 * length_m / v0
            t = min(t, stops_s)
            return (2.0 - t / stops_s) * t / stops_s, v0 * (1.0 - t / stops_s)
        speed_mps = v0 + (v1 - v0) * t / step_s
        if steady_m <= 0.0:
            return t / step_s, speed_mps
        return 0.5 * (v0 + speed_mps) * t / steady_m, speed_mps
