"""The lanes behind an entity, along which it goes back in reverse."""

from __future__ import annotations

import numpy as np

from scenarios.openscenario.motion.paths import Path, Pose, backwards
from scenarios.openscenario.motion.roads import Roads
from smartmot.types import FloatArray


def with_way_behind(roads: Roads, path: Path) -> Path:
    """The same way by the same arc lengths, which also follows the lanes behind its beginning."""
    if path.both_ways or not path.on_road:
        return path
    start = Pose(*path.pose(0.0))
    place = roads.place(start)
    rows: list[FloatArray] = []
    if place is not None:
        legs = roads.legs_ahead(place.lane, place.s_m, -place.along_s)
        if sum(leg.length_m for leg in legs) > 1e-6:
            behind = backwards(roads.path(legs, -place.offset_m * place.along_s))
            rows = [_rows(behind)[:-1]]
    ahead = _rows(path)
    table = np.concatenate([*rows, ahead[ahead[:, 3] >= 0.0]])
    both = Path(table[:, 0], table[:, 1], np.unwrap(table[:, 2]), table[:, 3])
    both.on_road, both.both_ways = True, True
    return both


def _rows(path: Path) -> FloatArray:
    """(K, 4) x, y, heading and arc length at the points; at a corner the heading of what follows."""
    stations = np.array(path.station_of_vertices())
    yaw = path.yaw_at_points()
    if yaw is None:
        yaw = path.poses(stations)[:, 2]
    return np.column_stack((path.points_m, yaw, stations))
