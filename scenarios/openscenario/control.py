"""Who drives the ego: the seam between the scenario and a controller.

The scenario places the ego and gives it its initial speed and its way (lane, route or trajectory). From then
on a controller, if there is one, decides how far it goes and how fast it is; it may also leave the way by
giving poses of its own. Without one the ego keeps its speed along its way.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from scenarios.openscenario.paths import Path, Pose


@dataclass(frozen=True, slots=True)
class Motion:
    """How the ego moves on from an instant.

    Args:
        distance_m: driven since then, negative in reverse.
        speed_mps: at the end, negative in reverse.
        pose: of the reference point (rear axle) at the end; None: on the ego's way.
    """

    distance_m: float
    speed_mps: float
    pose: Pose | None = None


class EgoController(Protocol):
    """Drives the ego."""

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Take the ego over.

        Args:
            time_s: now.
            path: its way.
            station_m: where on it.
            speed_mps: initial speed, negative in reverse.
        """

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """How the ego moves within a duration from `time_s` on (where it was left); changes nothing.

        The engine asks for several durations of one step to find contacts and triggers inside it, so the
        answer has to be continuous in the duration.
        """

    def advance(self, time_s: float, duration_s: float) -> None:
        """Move on by a duration from `time_s` on."""


class BrakeAt:
    """Keeps the speed until a time, then brakes to a standstill.

    Args:
        time_s: when to brake.
        decel_mps2: constant deceleration.
    """

    def __init__(self, time_s: float, decel_mps2: float) -> None:
        self.brake_time_s, self.decel_mps2 = time_s, decel_mps2
        self.speed_mps = 0.0

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Start with the initial speed."""
        self.speed_mps = speed_mps

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """Free rolling, braking and standing within the duration."""
        free = min(max(self.brake_time_s - time_s, 0.0), duration_s)
        speed = abs(self.speed_mps)
        braking = min(duration_s - free, speed / self.decel_mps2)
        distance = speed * (free + braking) - 0.5 * self.decel_mps2 * braking**2
        left = speed - self.decel_mps2 * braking
        sign = -1.0 if self.speed_mps < 0.0 else 1.0
        return Motion(sign * distance, sign * left if left > 1e-12 else 0.0)

    def advance(self, time_s: float, duration_s: float) -> None:
        """Keep the speed that is left."""
        self.speed_mps = self.motion(time_s, duration_s).speed_mps
