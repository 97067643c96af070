"""Adaptive speed behind a leader: the Intelligent Driver Model with highway-env's parameters."""

from __future__ import annotations

import math
from dataclasses import dataclass

from smartmot.decision.rules import LeadObject

ACCEL_MPS2, COMFORT_MPS2, HEADWAY_S, EXPONENT = 3.0, 5.0, 1.5, 4.0
"""Greatest acceleration, comfortable deceleration, time gap of highway-env's `IDMVehicle`, and exponent of
the free-road term (Treiber et al. 2000). Its formula is worked out here: importing it takes a second."""

HARDEST_MPS2 = 4.0
"""Limit of the speed adaptation (ACC): ISO 15622 allows 3.5 to 5 m/s2 depending on speed."""

STANDSTILL_GAP_M = 2.0
"""Distance to a leader that stands."""

_LEAST = 0.01
"""highway-env divides by no speed and no distance under this."""


@dataclass(frozen=True, slots=True)
class Follower:
    """A vehicle that adapts its speed.

    Args:
        length_m: of the vehicle.
    """

    length_m: float

    def accel_mps2(
        self, speed_mps: float, lead: LeadObject | None, desired_mps: float, desired_mps2: float = 0.0
    ) -> float:
        """Acceleration at a speed behind a leader (None: on a free road), within the limits of comfort.

        A desired speed that changes is kept up with: its own change stands beside the model's free-road term.

        Args:
            speed_mps: of the vehicle.
            lead: whom it follows.
            desired_mps: speed on a free road.
            desired_mps2: how that changes; a harder deceleration than comfort allows is carried out.
        """
        free: float = ACCEL_MPS2 * (1.0 - (max(speed_mps, 0.0) / max(abs(desired_mps), _LEAST)) ** EXPONENT)
        wanted = free
        if lead is not None:
            # the desired gap is measured between the fronts, as highway-env does
            gap = self.length_m + STANDSTILL_GAP_M + speed_mps * HEADWAY_S
            gap += speed_mps * (speed_mps - lead.speed_mps) / (2.0 * math.sqrt(ACCEL_MPS2 * COMFORT_MPS2))
            apart = lead.gap_m + self.length_m
            if abs(apart) <= _LEAST:
                apart = math.copysign(_LEAST, apart)
            wanted -= ACCEL_MPS2 * (gap / apart) ** 2
        if desired_mps2:
            wanted += min(free + desired_mps2, max(free, ACCEL_MPS2)) - free
        if desired_mps <= 0.0:  # the free-road term divides by it
            wanted = min(wanted, 0.0)
        return min(max(wanted, min(-HARDEST_MPS2, desired_mps2)), ACCEL_MPS2)
