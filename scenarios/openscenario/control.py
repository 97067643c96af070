"""Who drives the ego: the seam between the scenario and a controller.

The scenario places the ego, gives it its way (lane, route or trajectory) and moves it: by speed actions,
distances, synchronisation, timed trajectories. A controller, if there is one, says from when on it commands
the ego. Then it decides how far the ego goes and how fast it is; it may also leave the way by giving poses of
its own. What the scenario does to the ego's speed meanwhile changes only what `Actor.asked_mps` tells.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

from scenarios.openscenario.motion.paths import Path, Pose


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
    """Drives the ego while it commands it.

    Attributes:
        commands_from_s: from when on it commands the ego; the scenario drives before that, and again if it is
            set later than now. The engine looks at it at the beginning of every step, and splits the step
            that it falls into.
    """

    commands_from_s: float

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Take the ego over, at the instant from which on it is commanded.

        Args:
            time_s: now.
            path: its way.
            station_m: where on it.
            speed_mps: its speed, negative in reverse.
        """

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """How the ego moves within a duration from `time_s` on (where it was left); changes nothing.

        The engine asks for several durations of one step to find contacts and triggers inside it, so the
        answer has to be continuous in the duration.
        """

    def advance(self, time_s: float, duration_s: float) -> None:
        """Move on by a duration from `time_s` on."""


class BrakeAt:
    """Leaves the ego to the scenario until a time, then brakes to a standstill.

    Args:
        time_s: when to brake.
        decel_mps2: constant deceleration.
    """

    def __init__(self, time_s: float, decel_mps2: float) -> None:
        self.commands_from_s, self.decel_mps2 = time_s, decel_mps2
        self.speed_mps = 0.0

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Brake from the speed that it has."""
        self.speed_mps = speed_mps

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """Braking and standing within the duration."""
        speed = abs(self.speed_mps)
        braking = min(duration_s, speed / self.decel_mps2)
        distance = speed * braking - 0.5 * self.decel_mps2 * braking**2
        left = speed - self.decel_mps2 * braking
        sign = -1.0 if self.speed_mps < 0.0 else 1.0
        return Motion(sign * distance, sign * left if left > 1e-12 else 0.0)

    def advance(self, time_s: float, duration_s: float) -> None:
        """Keep the speed that is left."""
        self.speed_mps = self.motion(time_s, duration_s).speed_mps
