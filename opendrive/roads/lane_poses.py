"""Single poses on the middles of lanes, without arrays; see `single`."""

from bisect import bisect_right
from dataclasses import dataclass, field
from math import atan2, cos, pi, sin
from typing import TypeAlias

import numpy as np

from opendrive.geometry.cubic import restarted
from opendrive.geometry.curves import CIRCULAR, CUBIC
from opendrive.roads.geometry import NetworkGeometry

_GAUSS = tuple(
    (0.5 * (node + 1.0), 0.5 * weight)
    for node, weight in zip(*(v.tolist() for v in np.polynomial.legendre.leggauss(12)), strict=True)
)
_MAX_TURN_RAD = 1.5
"""Up to this turn twelve nodes integrate a clothoid to rounding; see `curves.clothoid`."""

Pose: TypeAlias = tuple[float, float, float, float]
"""x, y, z and heading in travel direction."""


@dataclass(frozen=True, slots=True, eq=False)
class LanePoses:
    """Stretches of lanes as plain numbers, made when a lane is first asked for.

    Attributes:
        geometry: geometry of the network.
        stretches: by lane, where the stretches start, and the numbers of each.
    """

    geometry: NetworkGeometry
    stretches: dict[int, tuple[list[float], list[tuple[float, ...]]]] = field(default_factory=dict)

    def pose(self, lane: object, s_m: object) -> Pose | None:
        """Return the pose in the middle of a lane; None if the arrays have to tell, as off the lane."""
        if not isinstance(lane, int) or not isinstance(s_m, float) or not self.geometry.is_plain:
            return None
        known = self.stretches.get(lane)
        if known is None:
            if not 0 <= lane < len(self.geometry.lanes):
                return None
            known = self.stretches[lane] = self._stretches(lane)
        starts, numbers = known
        if not starts or not starts[0] <= s_m < starts[-1]:
            return None
        row = numbers[bisect_right(starts, s_m) - 1]
        low_m, x, y, heading, k, rate, turn, a, b, c, d, za, zb, zc, zd = row
        ds = s_m - low_m
        if rate:
            u = v = 0.0
            for node, weight in _GAUSS:
                at = ds * node
                angle = heading + at * (k + 0.5 * rate * at)
                u += weight * cos(angle)
                v += weight * sin(angle)
            x, y = x + ds * u, y + ds * v
            heading += ds * (k + 0.5 * rate * ds)
            k += rate * ds
        elif k:
            half = 0.5 * k * ds
            chord = ds * (sin(half) / half if half else 1.0)
            x, y = x + chord * cos(heading + half), y + chord * sin(heading + half)
            heading += k * ds
        else:
            x, y = x + ds * cos(heading), y + ds * sin(heading)
        t = a + ds * (b + ds * (c + ds * d))
        x, y = x - t * sin(heading), y + t * cos(heading)
        heading += atan2(b + ds * (2.0 * c + ds * 3.0 * d), 1.0 - k * t) + turn
        return x, y, za + ds * (zb + ds * (zc + ds * zd)), pi - (pi - heading) % (2.0 * pi)

    def _stretches(self, lane: int) -> tuple[list[float], list[tuple[float, ...]]]:
        """Return where a lane's stretches start (and its end), and their numbers; none if it has a cubic."""
        geometry, curves, lanes = self.geometry, self.geometry.curves, self.geometry.lanes
        road = int(lanes.road[lane])
        start_m, end_m = float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])
        elevation = slice(*geometry.elevation.first[road : road + 2].tolist())
        _, low_m, _ = geometry.knots(np.array([lane]))
        cuts = np.concatenate([low_m, geometry.elevation.start_m[elevation]])
        low_m = np.unique(cuts[(cuts >= start_m) & (cuts < end_m)])
        many, roads = np.full(len(low_m), lane), np.full(len(low_m), road)
        poses = curves.evaluate(roads, low_m)
        key_s_m = curves.start_m[curves.first[road] : curves.first[road + 1]]
        piece = curves.first[road] + np.maximum(np.searchsorted(key_s_m, low_m, side="right") - 1, 0)
        rate = curves.rate_per_m2[piece]
        span = np.append(low_m[1:], end_m) - low_m
        turn = np.abs(poses.curvature_per_m) * span + np.abs(rate) * span**2
        if (curves.kind[piece] == CUBIC).any() or (
            (curves.kind[piece] != CIRCULAR) & (turn > _MAX_TURN_RAD)
        ).any():
            return [], []
        borders = lanes.borders
        stretch = borders.stretch_of(many, roads, low_m)
        row = borders.rows(stretch, many)
        middle = restarted(
            0.5 * borders.coefficients[:, :, row].sum(axis=0).T, low_m - borders.low_m[stretch]
        )
        height = np.zeros((len(low_m), 4))
        if len(geometry.elevation.start_m):
            height = restarted(*geometry.elevation.records(roads, low_m))
        against = np.full(len(low_m), 0.0 if lanes.direction[lane] > 0 else pi)
        columns = np.column_stack(
            [
                low_m,
                poses.x_m,
                poses.y_m,
                poses.heading_rad,
                poses.curvature_per_m,
                rate,
                against,
                middle,
                height,
            ]
        )
        return [*low_m.tolist(), end_m], [tuple(numbers) for numbers in columns.tolist()]
