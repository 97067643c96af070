"""Single poses on the middles of lanes, without arrays; see `single`."""

from bisect import bisect_right
from dataclasses import dataclass, field
from math import atan2, cos, pi, sin
from typing import TypeAlias

import numpy as np

from opendrive.arrays import FloatArray, IntArray, concatenated_ranges, first_rows, until_next
from opendrive.geometry.cubic import restarted
from opendrive.geometry.curves import CIRCULAR, CUBIC
from opendrive.geometry.profiles import sort_keys
from opendrive.roads.geometry import NetworkGeometry

_GAUSS = tuple(
    (0.5 * (node + 1.0), 0.5 * weight)
    for node, weight in zip(*(v.tolist() for v in np.polynomial.legendre.leggauss(12)), strict=True)
)
_MAX_TURN_RAD = 1.5
"""Up to this turn twelve nodes integrate a clothoid to rounding; see `curves.clothoid`."""

Pose: TypeAlias = tuple[float, float, float, float]
"""x, y, z and heading in travel direction."""


_FEW = 8
"""As many poses are left to the arrays before it is worth making what answers them."""

_Stretches: TypeAlias = tuple[list[float], list[list[float]]]
"""Where the stretches of a lane start, then its end; and the numbers of each stretch."""


@dataclass(eq=False)
class LanePoses:
    """Stretches of lanes as plain numbers; each has one piece of reference line and cubics for the rest.

    Attributes:
        geometry: geometry of the network.
        asked: how many poses were asked for before any stretch was made.
        stretches: those of each lane, none where the arrays have to tell; empty before they are made.
    """

    geometry: NetworkGeometry
    asked: int = 0
    stretches: list[_Stretches] = field(default_factory=list)

    def pose(self, lane: object, s_m: object) -> Pose | None:
        """Return the pose in the middle of a lane; None if the arrays have to tell, as off the lane."""
        if type(lane) is not int or not isinstance(s_m, float):
            if not isinstance(lane, int | np.integer) or not isinstance(s_m, float | int | np.integer):
                return None
            if isinstance(lane, bool) or isinstance(s_m, bool):
                return None
            lane, s_m = int(lane), float(s_m)
        if not 0 <= lane < len(self.stretches):
            if self.stretches or not self._is_worth_it():
                return None
            return self.pose(lane, s_m)
        starts, numbers = self.stretches[lane]
        if not numbers or not starts[0] <= s_m < starts[-1]:
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

    def _is_worth_it(self) -> bool:
        """Make the stretches of all lanes after a few poses; return whether they are there."""
        self.asked += 1
        if self.asked <= _FEW:
            return False
        first, rows = self._table()
        numbers, ends_m = rows.tolist(), self.geometry.lanes.s_end_m.tolist()
        for low, high, end_m in zip(first[:-1].tolist(), first[1:].tolist(), ends_m, strict=True):
            of_lane = numbers[low:high]
            self.stretches.append(([*(row[0] for row in of_lane), end_m], of_lane))
        return bool(self.stretches)

    def _table(self) -> tuple[IntArray, FloatArray]:
        """Return first row of each lane (L + 1,) and the numbers (K, 15) of all stretches.

        Lanes with a cubic or a clothoid that winds have none, nor have those whose height is more than that
        of the reference line.
        """
        geometry, curves, lanes = self.geometry, self.geometry.curves, self.geometry.lanes
        every = np.arange(len(lanes))
        knot_lane, knot_m, _ = geometry.knots(every)
        climbs = geometry.elevation.first[lanes.road]
        count = geometry.elevation.first[lanes.road + 1] - climbs
        lane = np.concatenate([knot_lane, np.repeat(every, count)])
        low_m = np.concatenate([knot_m, geometry.elevation.start_m[concatenated_ranges(climbs, count)]])
        on_lane = np.flatnonzero((low_m >= lanes.s_start_m[lane]) & (low_m < lanes.s_end_m[lane]))
        on_lane = on_lane[np.lexsort((low_m[on_lane], lane[on_lane]))]
        lane, low_m = lane[on_lane], low_m[on_lane]
        again = (np.diff(lane, prepend=-1) == 0) & (np.diff(low_m, prepend=np.nan) == 0.0)
        lane, low_m = lane[~again], low_m[~again]
        road = lanes.road[lane]
        poses = curves.evaluate(road, low_m)
        piece = np.searchsorted(curves.key, sort_keys(road, low_m), side="right") - 1
        piece = np.maximum(piece, curves.first[road])
        rate = curves.rate_per_m2[piece]
        span = until_next(lane, low_m, lanes.s_end_m[lane]) - low_m
        turn = np.abs(poses.curvature_per_m) * span + np.abs(rate) * span**2
        winds = (curves.kind[piece] != CIRCULAR) & (turn > _MAX_TURN_RAD)
        usable = geometry.plain_lanes.copy()
        usable[lane[winds | (curves.kind[piece] == CUBIC)]] = False
        borders = lanes.borders
        stretch = borders.stretch_of(lane, road, low_m)
        row = borders.rows(stretch, lane)
        middle = restarted(
            0.5 * borders.coefficients[:, :, row].sum(axis=0).T, low_m - borders.low_m[stretch]
        )
        height = np.zeros((len(low_m), 4))
        if len(geometry.elevation.start_m):
            height = restarted(*geometry.elevation.records(road, low_m))
        against = np.where(lanes.direction[lane] > 0, 0.0, pi)
        columns = (low_m, poses.x_m, poses.y_m, poses.heading_rad, poses.curvature_per_m, rate, against)
        kept = usable[lane]
        rows = np.column_stack([*columns, middle, height])[kept]
        return first_rows(np.bincount(lane[kept], minlength=len(lanes))), rows
