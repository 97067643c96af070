"""Braking distance that perception plans with, and from where distances count."""

from __future__ import annotations

import math
from dataclasses import dataclass

from smartmot.errors import ConfigError
from smartmot.types import EgoState

CAR_HALF_LENGTH_M = 2.2
"""From the centre to the front of the car that the paper's distances are meant for. Source: authors' code."""


@dataclass(frozen=True, slots=True)
class BrakingDistance:
    """Distance to stop from a speed: quadratic in the speed in km/h.

    The defaults pass through the table of the paper's authors (40, 50, 60, ... km/h: 18.62, 26.49,
    35.65, ... m; published with the code of the paper). They mean 0.74 s of reaction and 6.0 m/s2.
    """

    per_kmh2_m: float = 0.00645
    per_kmh_m: float = 0.2065
    constant_m: float = 0.04

    def __post_init__(self) -> None:
        if not all(0 <= c < math.inf for c in (self.per_kmh2_m, self.per_kmh_m, self.constant_m)):
            raise ConfigError("braking distance: coefficients must be finite and not negative")

    def at(self, speed_mps: float) -> float:
        """Metres needed to stop from `speed_mps`."""
        kmh = max(speed_mps, 0.0) * 3.6
        return (self.per_kmh2_m * kmh + self.per_kmh_m) * kmh + self.constant_m


def horizon_s(speed_mps: float, distance: BrakingDistance, minimum_s: float, maximum_s: float) -> float:
    """Forecast horizon: max(minimum, braking distance / speed), at most `maximum_s` (paper, section III)."""
    if speed_mps < 0.1:
        return minimum_s
    return min(max(minimum_s, distance.at(speed_mps) / speed_mps), maximum_s)


def overhang_m(ego: EgoState) -> float:
    """How much farther the ego's front is from its centre than a car's.

    Lengths of areas and the distances that count as near are the paper's, from the centre of a car. For a bus
    or a truck they grow by this.
    """
    return max(0.0, 0.5 * ego.length_m - CAR_HALF_LENGTH_M)
