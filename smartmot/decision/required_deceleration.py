"""Braking when the deceleration that is needed reaches a threshold; with it, at the last point to brake."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.decision.aeb import Event
from smartmot.decision.along_path import Braking, next_braking, targets, until_standstill
from smartmot.decision.rules import Assessment, Command
from smartmot.errors import ConfigError
from smartmot.types import FloatArray


@dataclass(frozen=True, slots=True)
class RequiredDeceleration:
    """Brakes fully once v^2 / (2 d) reaches a threshold, v the closing speed and d the gap along the path.

    Source: Stellet et al., "Analytical derivation of performance bounds of autonomous emergency brake
    systems" (IV 2016), by the table of lu-w/criticality-metrics@ac5bd9a: 6 m/s2. Other thresholds there: 3.4
    (classification) and 5 m/s2 (UN R157).

    With the delay and build-up of the vehicle's brakes and their deceleration as threshold, it brakes at the
    last point from which they prevent the collision, if the object keeps its speed. The source says nothing
    of how long it brakes: here until standstill. A pedestrian who crosses sets it off on entering the width
    that the ego sweeps, not before.

    Args:
        required_decel_mps2: threshold; less brakes earlier.
        delay_s, build_up_s: of the brakes that are reckoned with (0: the deceleration is there at once).
        name: of the set of parameters.

    Raises:
        ConfigError: a value is out of range.
    """

    required_decel_mps2: float = 6.0
    delay_s: float = 0.0
    build_up_s: float = 0.0
    name: str = "required_deceleration"

    def __post_init__(self) -> None:
        if not (0 < self.required_decel_mps2 < math.inf and self.delay_s >= 0 and self.build_up_s >= 0):
            raise ConfigError(f"{self.name}: the threshold must be positive, and no time negative")

    def needed_m(self, closing_mps: FloatArray) -> FloatArray:
        """(M,) distances in which closing speeds are braked away, after the delay at the threshold."""
        speed, decel, build_up = np.maximum(closing_mps, 0.0), self.required_decel_mps2, self.build_up_s
        braked = speed * build_up / 2 + speed**2 / (2 * decel) - decel * build_up**2 / 24
        # what stops within the build-up: at the rate decel / build_up for sqrt(2 v / rate), 2/3 of it at v
        stopped = 2 / 3 * speed * np.sqrt(2 * speed * build_up / decel)
        return speed * self.delay_s + np.where(speed < decel * build_up / 2, stopped, braked)

    def decide(self, state: Braking | None, now: Assessment) -> tuple[Braking, Command, tuple[Event, ...]]:
        """One decision; see `smartmot.decision.rules.BrakeRule`."""
        chosen, urgent = targets(now), False
        if np.count_nonzero(chosen):
            closing = (now.ego.speed_mps - now.path_speed_mps)[chosen]
            gap = np.maximum(now.path_gap_m[chosen], 0.0)
            urgent = bool(((closing > 0.0) & (gap <= self.needed_m(closing))).any())
        braking, events = next_braking(state or Braking(), now, int(urgent), until_standstill(now))
        return braking, Command(braking.stage > 0, now.lead), events


LAST_POINT_TO_BRAKE = RequiredDeceleration(8.8, 0.2, 0.4, "last_point_to_brake")
"""With the brakes of the preset `physical`; a run puts those of its own preset in their place, and adds a
frame of its sensor to the delay."""
