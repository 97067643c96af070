"""Lane changes of a route: where they take place, and the way through them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from smartmot.types import FloatArray

LATERAL_MPS2 = 1.0
"""Greatest acceleration across of a lane change: UN R79, 5.6.4 (ACSF C)."""

SHORTEST = 1.5
"""A change by a cubic takes this many times its width at least: it heads up to 45 degrees off the lane."""


def length_of_change_m(left_m: float, speed_mps: float) -> float:
    """Way of a lane change that follows a cubic; infinite for who stands: as long as there is room.

    The acceleration across of left * p^2 (3 - 2p) is greatest at its ends, 6 left / duration^2.

    Args:
        left_m: how far to the side it leads.
        speed_mps: along the lane.
    """
    if speed_mps == 0.0:
        return math.inf
    duration_s = math.sqrt(6.0 * abs(left_m) / LATERAL_MPS2)
    return max(abs(speed_mps) * duration_s, SHORTEST * abs(left_m))


@dataclass(frozen=True, slots=True)
class RouteChange:
    """A change from a lane to its neighbour.

    Args:
        at_m: way along the route at its middle.
        half_m: way from its beginning to its middle, and from there to its end.
        left_m: how far the new lane is to the left.
    """

    at_m: float
    half_m: float
    left_m: float

    def shift(self, way_m: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far ways along the route are to the left of the lane below them, and the slope of that.

        Args:
            way_m: (K,) ways along the route.
            after: (K,) whether the new lane is the one below them.
        """
        part = np.clip((way_m - self.at_m) / (2.0 * self.half_m) + 0.5, 0.0, 1.0)
        inside = (part > 0.0) & (part < 1.0)
        done = part**2 * (3.0 - 2.0 * part)
        slope = np.where(inside, self.left_m * 3.0 * part * (1.0 - part) / self.half_m, 0.0)
        return self.left_m * (done - np.where(after, 1.0, 0.0)), slope


def with_room(changes: Sequence[RouteChange], length_m: float) -> list[RouteChange]:
    """Changes that neither reach into one another nor beyond the ends of a route.

    Args:
        changes: in the order of the route, each as long as it should be.
        length_m: of the route.
    """
    middles = [change.at_m for change in changes]
    bounds = [0.0, *(0.5 * (a + b) for a, b in pairwise(middles)), length_m]
    return [
        RouteChange(c.at_m, min(c.half_m, c.at_m - low, high - c.at_m), c.left_m)
        for c, (low, high) in zip(changes, pairwise(bounds), strict=True)
    ]
