"""What an agent is rewarded for."""

from __future__ import annotations

import math
from dataclasses import dataclass

from evaluation.errors import ArgumentError


@dataclass(frozen=True, slots=True)
class Reward:
    """Weights; the greatest return is 0.

    A contact costs `contact * (v / 10 m/s)^2`, since the energy of the impact grows with the square of its
    speed v; braking for nothing `unnecessary` once, at the end; braking `comfort * (a / g)^2` per second,
    with the mean deceleration a of each step.

    Args:
        contact: at an impact of 10 m/s.
        unnecessary: an emergency request where nothing should happen, or before a target has set off; see
            `Outcome.false_activation`.
        comfort: a second of braking with 1 g.

    Raises:
        ArgumentError: a weight is negative or not finite.
    """

    contact: float = 10.0
    unnecessary: float = 5.0
    comfort: float = 0.5

    def __post_init__(self) -> None:
        for name in ("contact", "unnecessary", "comfort"):
            value = getattr(self, name)
            if not (math.isfinite(value) and value >= 0):
                raise ArgumentError(f"reward: {name} must be 0 or more, got {value!r}")

    def of_braking(self, lost_mps: float, duration_s: float) -> float:
        """For the speed that is lost in a time."""
        if duration_s <= 0.0:
            return 0.0
        return -self.comfort * (max(lost_mps, 0.0) / _G_MPS2) ** 2 / duration_s

    def of_end(self, impact_speed_mps: float, is_unnecessary: bool) -> float:
        """For the end of a run."""
        impact = self.contact * (impact_speed_mps / 10.0) ** 2
        return -impact - (self.unnecessary if is_unnecessary else 0.0)


_G_MPS2 = 9.80665
"""Standard gravity (ISO 80000-3)."""
