"""Who is on the ego's level where roads lie above one another."""

from __future__ import annotations

from functools import cached_property

import numpy as np

from opendrive import RoadNetwork
from smartmot.maps.lane_map import LEVEL_M
from smartmot.types import BoolArray, FloatArray

STEEPEST = 0.3
"""Grade that no road exceeds: the steepest streets have 35 %, those on bridges and ramps at most 10 %."""

CONNECTED_M = 200.0
"""Lanes within this way of the ego's are its own level, whatever their height: as far as sensors see, twice
over, since ways bend. A ramp from a street to the bridge above it is longer than that, or curves so far out
that nobody on it is seen below the bridge."""


class RoadLevels:
    """Levels of a road network.

    Args:
        network: the map.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self._network = network
        self._reached: dict[int, frozenset[int]] = {}

    def __deepcopy__(self, memo: dict[int, object]) -> RoadLevels:
        return self

    def shared(
        self, ego_m: FloatArray, ego_ground_m: float, center_m: FloatArray, ground_m: FloatArray
    ) -> BoolArray:
        """(N,) who is on the ego's level: nearly at its height, or on lanes that lead to it uphill or down.

        Args:
            ego_m: (2,) the ego, map frame.
            ego_ground_m: height of the ground below it.
            center_m: (N, 2) the others.
            ground_m: (N,) heights of the ground below them.
        """
        rise_m = np.abs(ground_m - ego_ground_m)
        shared: BoolArray = rise_m <= LEVEL_M
        distance_m = np.hypot(*(center_m - ego_m).T)
        uphill = np.flatnonzero(~shared & (rise_m <= LEVEL_M + STEEPEST * distance_m))
        if not len(uphill):
            return shared
        network, types = self._network, self._lane_types
        own = int(network.nearest_lane(ego_m[None], types, z_m=ego_ground_m).lane[0])
        reached = self._connected(own)
        above = frozenset(
            road for pair in network.overlapping_roads if self._road(own) in pair for road in pair
        )
        lanes = network.nearest_lane(center_m[uphill], types, z_m=ground_m[uphill]).lane.tolist()
        shared[uphill] = [
            lane in reached and (self._road(lane) == self._road(own) or self._road(lane) not in above)
            for lane in lanes
        ]
        return shared

    @cached_property
    def _lane_types(self) -> tuple[str, ...]:
        return tuple(sorted(set(self._network.lanes.lane_type.tolist())))

    def _road(self, lane: int) -> str:
        return self._network.lanes.key[lane].road_id

    def _connected(self, lane: int) -> frozenset[int]:
        """Lanes that `CONNECTED_M` of road join to a lane, beside it, before it and after it."""
        if lane not in self._reached:
            network, lanes = self._network, self._network.lanes
            way_m, front = {lane: 0.0}, [lane]
            while front:
                at = front.pop()
                beside = (network.left_neighbour(at), network.right_neighbour(at))
                # the ego's own lane counts nothing: the ego may be at its end
                length_m = float(lanes.s_end_m[at] - lanes.s_start_m[at]) if at != lane else 0.0
                steps = [(next_lane, way_m[at]) for next_lane in beside if next_lane is not None]
                further = (*network.successors(at), *network.predecessors(at))
                steps += [(next_lane, way_m[at] + length_m) for next_lane in further]
                for next_lane, gone_m in steps:
                    if gone_m <= CONNECTED_M and gone_m < way_m.get(next_lane, np.inf):
                        way_m[next_lane] = gone_m
                        front.append(next_lane)
            self._reached[lane] = frozenset(way_m)
        return self._reached[lane]
