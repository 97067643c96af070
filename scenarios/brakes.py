"""Brakes with delay, build-up and friction, integrated without time-step error."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenarios.errors import ScenarioError


@dataclass(frozen=True, slots=True)
class BrakeConfig:
    """Emergency brake of a vehicle.

    Args:
        delay_s: from the request to the first deceleration.
        build_up_s: linear rise from none to the full deceleration.
        max_decel_mps2: full deceleration on dry road.
    """

    delay_s: float
    build_up_s: float
    max_decel_mps2: float

    def __post_init__(self) -> None:
        if not (self.delay_s >= 0 and self.build_up_s >= 0 and self.max_decel_mps2 > 0):
            raise ScenarioError(
                "brakes: delay and build-up must not be negative and the deceleration must be positive; got "
                f"{self.delay_s} s, {self.build_up_s} s, {self.max_decel_mps2} m/s2"
            )

    def decel_mps2(self, since_s: float) -> float:
        """Deceleration a time after the request."""
        if since_s <= self.delay_s:
            return 0.0
        if since_s >= self.delay_s + self.build_up_s:
            return self.max_decel_mps2
        return self.max_decel_mps2 * (since_s - self.delay_s) / self.build_up_s

    def travel(self, speed_mps: float, since_s: float, duration_s: float) -> tuple[float, float]:
        """Distance driven and speed left after braking for `duration_s`.

        The deceleration is linear between its kinks, so every piece is integrated in closed form; the
        vehicle stops at zero.

        Args:
            speed_mps: speed at the beginning.
            since_s: time since the request at the beginning.
            duration_s: how long.
        """
        distance, left, now = 0.0, duration_s, since_s
        kinks = (self.delay_s, self.delay_s + self.build_up_s, math.inf)
        while left > 0.0 and speed_mps > 0.0:
            # a piece too short to move the clock would never end
            kink = next(k for k in kinks if k > now + 1e-12)
            piece = min(left, kink - now)
            a0 = -self.decel_mps2(now + 1e-13)
            a1 = -self.decel_mps2(now + piece - 1e-13) if piece > 1e-12 else a0
            jerk = (a1 - a0) / piece
            piece = min(piece, _stop_time(speed_mps, a0, jerk))
            distance += speed_mps * piece + a0 * piece**2 / 2 + jerk * piece**3 / 6
            after = speed_mps + a0 * piece + jerk * piece**2 / 2
            speed_mps = after if after > 1e-9 else 0.0
            now += piece
            left -= piece
        return distance, speed_mps


def _stop_time(speed: float, acceleration: float, jerk: float) -> float:
    """First time at which speed + acceleration t + jerk t^2 / 2 reaches zero; infinite if it never does."""
    if abs(jerk) < 1e-9:
        return -speed / acceleration if acceleration < 0 else math.inf
    root = acceleration**2 - 2 * jerk * speed
    if root < 0:
        return math.inf
    times = ((-acceleration - math.sqrt(root)) / jerk, (-acceleration + math.sqrt(root)) / jerk)
    return min((t for t in times if t >= 0), default=math.inf)
