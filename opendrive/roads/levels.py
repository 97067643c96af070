"""Roads above each other, such as a bridge and the road below it."""

import numpy as np

from opendrive.roads.borders import sample_borders
from opendrive.roads.geometry import NetworkGeometry
from opendrive.roads.lane_index import LEVEL_M, LaneIndex

_STEP_M = 2.0


def overlapping_roads(geometry: NetworkGeometry, index: LaneIndex) -> tuple[tuple[str, str], ...]:
    """Return pairs of roads whose lanes lie above each other, found from middles of lanes every 2 m."""
    borders = sample_borders(geometry, _STEP_M)
    middle_m = 0.5 * (borders.left_m + borders.right_m)
    if not len(middle_m) or np.ptp(middle_m[:, 2]) <= LEVEL_M:
        return ()
    hits = index.containing(np.ascontiguousarray(middle_m[:, :2]))
    height_m = geometry.lane_surface(hits.lane, hits.s_m, hits.t_m).z_m
    apart = np.abs(height_m - middle_m[hits.point, 2]) > LEVEL_M
    lane_of_point = np.repeat(np.arange(len(geometry.lanes)), np.diff(borders.first))
    pairs = np.stack([lane_of_point[hits.point[apart]], hits.lane[apart]], axis=1)
    roads = np.unique(np.sort(geometry.lanes.road[pairs], axis=1), axis=0)
    return tuple((geometry.roads.id[a], geometry.roads.id[b]) for a, b in roads.tolist())
