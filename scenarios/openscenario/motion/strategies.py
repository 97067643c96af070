"""Ways between two places along lanes, as a route's strategy chooses among them."""

from __future__ import annotations

import heapq
import random
from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from opendrive import RoadNetwork
from opendrive.lanes.travel import LANE_CHANGE_COST_M, ROUTE_LANE_TYPES
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.model import RouteStrategy

Cost: TypeAlias = tuple[float, float]
"""What a strategy counts, and the length, which decides between ways of the same."""

SEED = 0
"""A random way is drawn with it: the same scenario takes the same one."""


def chain(
    network: RoadNetwork,
    start: tuple[int, float],
    goal: tuple[int, float],
    strategy: RouteStrategy,
    changes: bool = False,
) -> list[int]:
    """Lanes from one place (lane, s) to another, which may lie behind it on the same lane.

    `fastest` counts the times at the speed limits; a lane without a limit has the greatest of the map.
    `leastIntersections` counts junctions. `random` is the shortest way of lanes whose lengths are drawn.

    Args:
        network: the map.
        start: place where it begins.
        goal: place where it ends.
        strategy: how to choose.
        changes: whether lanes may be changed, each for the length that `RoadNetwork.route` counts.

    Raises:
        RunError: no way leads there.
    """
    cost_of = _costs(network, strategy)
    (first, begin_m), (last, end_m) = start, goal
    lanes = network.lanes
    if first == last and (end_m - begin_m) * float(lanes.direction[first]) >= 0.0:
        return [first]

    def bounds(lane: int) -> tuple[float, float]:
        low, high = float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])
        return (low, high) if lanes.direction[lane] > 0 else (high, low)

    def onward(lane: int) -> list[tuple[int, Cost]]:
        ways = [
            (other, cost_of(other, abs((end_m if other == last else bounds(other)[1]) - bounds(other)[0])))
            for other in network.successors(lane)
        ]
        if changes:
            extra = (LANE_CHANGE_COST_M if strategy == "shortest" else 0.0, LANE_CHANGE_COST_M)
            ways += [(other, extra) for other in _beside(network, lane)]
        return ways

    # the start is no node of its own: a way that leads round comes to its lane again
    heap: list[tuple[Cost, int, tuple[int, ...]]] = [
        (cost, other, (first, other)) for other, cost in onward(first)
    ]
    heapq.heapify(heap)
    done: set[int] = set()
    while heap:
        cost, lane, way = heapq.heappop(heap)
        if lane == last:
            return list(way)
        if lane in done:
            continue
        done.add(lane)
        for other, more in onward(lane):
            if other not in done:
                heapq.heappush(heap, ((cost[0] + more[0], cost[1] + more[1]), other, (*way, other)))
    raise RunError(f"route: no way leads from lane {_name(network, first)} to lane {_name(network, last)}")


def _name(network: RoadNetwork, lane: int) -> str:
    key = network.lanes.key[lane]
    return f"{key.lane_id} of road '{key.road_id}'"


def _beside(network: RoadNetwork, lane: int) -> list[int]:
    """Lanes of the same direction next to a lane."""
    lanes, key = network.lanes, network.lanes.key[lane]
    near = np.flatnonzero(lanes.section == lanes.section[lane]).tolist()
    return [
        other
        for other in near
        if abs(lanes.key[other].lane_id - key.lane_id) == 1
        and lanes.direction[other] == lanes.direction[lane]
        and str(lanes.lane_type[other]) in ROUTE_LANE_TYPES
    ]


def _costs(network: RoadNetwork, strategy: RouteStrategy) -> Callable[[int, float], Cost]:
    """What a stretch of a lane costs."""
    if strategy == "shortest":
        return lambda lane, length_m: (length_m, length_m)
    if strategy == "leastIntersections":
        roads = [network.roads[key.road_id].record for key in network.lanes.key]
        return lambda lane, length_m: (float(roads[lane].junction_id is not None), length_m)
    if strategy == "random":
        factors = random.Random(SEED)
        drawn = [factors.random() for _ in network.lanes.key]
        return lambda lane, length_m: (drawn[lane] * length_m, length_m)
    low, high = network.lanes.s_start_m, network.lanes.s_end_m
    limits = [network.speed_limit(lane, 0.5 * float(low[lane] + high[lane])) for lane in range(len(low))]
    known = [limit for limit in limits if limit]
    speeds = [limit or max(known, default=1.0) for limit in limits]
    return lambda lane, length_m: (length_m / speeds[lane], length_m)
