"""A highway-env road network made from an OpenDRIVE map.

Lanes keep their exact geometry: positions, headings and widths come from the map, not from polylines.
"""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane, LineType
from highway_env.road.road import RoadNetwork as HighwayNetwork
from scipy.interpolate import PPoly

from opendrive import RoadNetwork
from opendrive.lanes.travel import ROUTE_LANE_TYPES

LaneName = tuple[str, str, int]

_STATION_STEP_M = 1.0
_INSIDE = 1e-6
_GAUSS = np.polynomial.legendre.leggauss(5)


class MapLane(AbstractLane):  # type: ignore[misc]
    """A lane of a map as a highway-env lane.

    The longitudinal coordinate is the distance along the middle of the lane from its entry, the lateral one
    the distance to the left of it in travel direction. Beyond its ends the lane goes on straight.

    Args:
        network: the map.
        lane: index of the lane.
    """

    def __init__(self, network: RoadNetwork, lane: int) -> None:
        self.network = network
        self.lane = lane
        self.direction = int(network.lanes.direction[lane])
        start, end = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
        self._entry, self._exit = (start, end) if self.direction > 0 else (end, start)
        travelled, station, speed = _stations(network, lane, self._entry, self._exit)
        self.length = float(station[-1])
        self._s_of = _cubics(station, travelled, 1.0 / speed)
        self._station_of = _cubics(travelled, station, speed)
        self.width = float(self.width_at(0.5 * self.length))
        self.forbidden = False
        self.priority = 0
        limit = network.speed_limit(lane, 0.5 * (start + end))
        self.speed_limit = 20.0 if limit is None else limit  # highway-env's own default
        self.line_types = [self._line_type("left"), self._line_type("right")]

    def position(self, longitudinal: float, lateral: float) -> Any:
        """(2,) point of the map frame, metres."""
        inside = min(max(longitudinal, 0.0), self.length)
        x, y, _, heading = (float(value) for value in self.network.center_line(self.lane, self._s_at(inside)))
        cos, sin, beyond = np.cos(heading), np.sin(heading), longitudinal - inside
        return np.array([x + cos * beyond - sin * lateral, y + sin * beyond + cos * lateral])

    def heading_at(self, longitudinal: float) -> float:
        """Travel direction, radians."""
        return float(self.network.center_line(self.lane, self._s_at(longitudinal))[3])

    def width_at(self, longitudinal: float) -> float:
        """Width across the travel direction, metres."""
        left, right = self.network.borders(self.lane, self._s_at(longitudinal))
        heading = self.heading_at(longitudinal)
        across = left[0] - right[0]
        return float(np.cos(heading) * across[1] - np.sin(heading) * across[0])

    def local_coordinates(self, position: Any) -> tuple[float, float]:
        """Longitudinal and lateral coordinate of a point, metres: its foot on the middle of the lane."""
        point = np.asarray(position, dtype=np.float64)
        low, high = sorted((self._entry, self._exit))
        road_id = self.network.lanes.key[self.lane].road_id
        s = float(np.clip(self.network.road_coordinates(road_id, point)[0][0], low, high))
        station = self._station_at(s)
        # The middle of the lane may slant against the road, whose foot is therefore a first guess only.
        for _ in range(20):
            x, y, _, heading = (float(v) for v in self.network.center_line(self.lane, self._s_at(station)))
            cos, sin = np.cos(heading), np.sin(heading)
            ahead = cos * (point[0] - x) + sin * (point[1] - y)
            aside = cos * (point[1] - y) - sin * (point[0] - x)
            moved = min(max(station + ahead * self._stretch(station, aside), 0.0), self.length)
            if abs(moved - station) < 1e-9:
                break
            station = moved
        return station + (ahead if station in (0.0, self.length) else 0.0), float(aside)

    def to_config(self) -> dict[str, Any]:
        """Road, section and lane id, for display."""
        return {"lane": tuple(self.network.lanes.key[self.lane])}

    @classmethod
    def from_config(cls, config: dict[str, Any]) -> MapLane:
        """Not available: a lane comes from a map.

        Raises:
            TypeError: always.
        """
        raise TypeError("a MapLane is made from a RoadNetwork, not from a configuration")

    def _s_at(self, longitudinal: float) -> float:
        inside = min(max(longitudinal, 0.0), self.length)
        travelled = min(max(float(self._s_of(inside)), 0.0), abs(self._exit - self._entry))
        return self._entry + self.direction * travelled

    def _station_at(self, s_m: float) -> float:
        return min(max(float(self._station_of(abs(s_m - self._entry))), 0.0), self.length)

    def _stretch(self, station: float, aside: float) -> float:
        """Return how far the foot moves for each metre ahead, beside a bend: 1 / (1 - curvature x offset)."""
        step = 0.5
        low, high = max(station - step, 0.0), min(station + step, self.length)
        if high - low < 1e-6:
            return 1.0
        turn = self.heading_at(high) - self.heading_at(low)
        curvature = (np.pi - (np.pi - turn) % (2.0 * np.pi)) / (high - low)
        return float(1.0 / max(1.0 - curvature * aside, 0.2))

    def _line_type(self, side: str) -> LineType:
        neighbour = self.network.left_neighbour if side == "left" else self.network.right_neighbour
        if neighbour(self.lane) is None:
            return LineType.CONTINUOUS_LINE
        middle = 0.5 * (self._entry + self._exit)
        may = self.network.lane_change(self.lane, middle, "left" if side == "left" else "right")
        return LineType.STRIPED if may else LineType.CONTINUOUS_LINE


class MapRoadNetwork(HighwayNetwork):  # type: ignore[misc]
    """A map as a highway-env road network.

    An edge holds the lanes of one lane section that run in the same direction and are next to each other,
    from right to left: what highway-env calls side lanes. Where the lanes of an edge lead to is taken from
    the map.

    Args:
        network: the map.
        lane_types: OpenDRIVE lane types that are taken over.
    """

    def __init__(self, network: RoadNetwork, lane_types: Collection[str] = ROUTE_LANE_TYPES) -> None:
        super().__init__()
        self.network = network
        self.lane_types = frozenset(lane_types)
        groups = _side_by_side(network, self.lane_types)
        entry_node, exit_node = _nodes(network, groups)
        self.name_of_lane: dict[int, LaneName] = {}
        for g, group in enumerate(groups):
            # Two edges between the same nodes must not be mistaken for neighbours.
            start, end = entry_node[g], exit_node[g]
            if end in self.graph.get(start, {}):
                end = f"{end}/{g}"
            for lane in group:
                self.name_of_lane[lane] = (start, end, len(self.graph.get(start, {}).get(end, [])))
                self.add_lane(start, end, MapLane(network, lane))

    def get_closest_lane_index(self, position: Any, heading: float | None = None) -> LaneName:
        """Name of the lane that holds a point, in the direction nearest to the heading, or of the nearest."""
        nearest = self.network.nearest_lane(position, tuple(self.lane_types), heading)
        return self.name_of_lane[int(nearest.lane[0])]

    def next_lane(
        self, current_index: LaneName, route: Any = None, position: Any = None, np_random: Any = np.random
    ) -> LaneName:
        """Name of the lane that follows: the one on the route, else one the map leads to, at random."""
        lane = self.get_lane(current_index).lane
        following = [self.name_of_lane[i] for i in self.network.successors(lane) if i in self.name_of_lane]
        if route and tuple(route[0])[:2] == tuple(current_index)[:2]:
            route.pop(0)
        if not following:
            return current_index
        planned = [name for name in following if route and tuple(route[0])[:2] == name[:2]]
        choice = planned or following
        return choice[0] if len(choice) == 1 else choice[int(np_random.randint(len(choice)))]


def highway_road_network(
    network: RoadNetwork, lane_types: Collection[str] = ROUTE_LANE_TYPES
) -> MapRoadNetwork:
    """Return a map as a highway-env road network."""
    return MapRoadNetwork(network, lane_types)


def _stations(network: RoadNetwork, lane: int, entry: float, leave: float) -> tuple[Any, Any, Any]:
    """Return what it takes to go between s and the distance along a lane's middle.

    Returns:
        travelled s (K,) and distance (K,) at the ends of short cells, and the change of the distance per
        metre of s (2, K - 1) at the start and the end of each cell. Curvature and width jump only between
        cells.
    """
    knots = np.abs(network.lane_knots(lane) - entry)
    knots = knots if knots[0] == 0.0 else knots[::-1]
    low, high = knots[:-1], knots[1:]
    count = np.maximum(np.ceil((high - low) / _STATION_STEP_M), 1.0).astype(int)
    cells = [np.linspace(a, b, n + 1)[:-1] for a, b, n in zip(low, high, count, strict=True)]
    travelled = np.concatenate([*cells, knots[-1:]])
    step = np.diff(travelled)
    nodes = np.concatenate([[_INSIDE], 0.5 * (_GAUSS[0] + 1.0), [1.0 - _INSIDE]])
    at = (travelled[:-1, None] + step[:, None] * nodes).ravel()
    speed = _centre_speed(network, lane, entry + np.sign(leave - entry) * at).reshape(-1, len(nodes))
    distance = np.concatenate([[0.0], np.cumsum(step * (speed[:, 1:-1] @ (0.5 * _GAUSS[1])))])
    return travelled, distance, speed[:, [0, -1]].T


def _centre_speed(network: RoadNetwork, lane: int, s: Any) -> Any:
    """Return the distance along a lane's middle per metre of s."""
    line = network.roads[network.lanes.key[lane].road_id].reference_line(s)
    inner, outer, d_inner, d_outer = network.lanes.offsets_and_slopes(np.full(s.size, lane), s)
    along = 1.0 - line.curvature_per_m * 0.5 * (inner + outer)
    return np.maximum(np.hypot(along, 0.5 * (d_inner + d_outer)), 1e-3)


def _cubics(x: Any, y: Any, slope: Any) -> PPoly:
    """Return the piecewise cubic through points (K,) with slopes (2, K - 1) at the ends of each piece."""
    h, mean = np.diff(x), np.diff(y) / np.diff(x)
    start, end = slope
    square, cube = (3.0 * mean - 2.0 * start - end) / h, (start + end - 2.0 * mean) / h**2
    return PPoly(np.stack([cube, square, start, y[:-1]]), x)


def _side_by_side(network: RoadNetwork, lane_types: frozenset[str]) -> list[list[int]]:
    """Return the groups of lanes that are next to each other and run the same way, from right to left."""
    lanes = network.lanes
    wanted = np.isin(lanes.lane_type, sorted(lane_types)) & (lanes.s_end_m - lanes.s_start_m > 0.0)

    def beside(lane: int | None, direction: int) -> bool:
        return lane is not None and bool(wanted[lane]) and int(lanes.direction[lane]) == direction

    groups = []
    for lane in np.flatnonzero(wanted).tolist():
        direction = int(lanes.direction[lane])
        if beside(network.right_neighbour(lane), direction):
            continue
        group = [lane]
        while beside(following := network.left_neighbour(group[-1]), direction) and following is not None:
            group.append(following)
        groups.append(group)
    return groups


def _nodes(network: RoadNetwork, groups: list[list[int]]) -> tuple[list[str], list[str]]:
    """Return the nodes where each group is entered and left; linked groups share one."""
    parent = list(range(2 * len(groups)))

    def root(node: int) -> int:
        while parent[node] != node:
            parent[node] = parent[parent[node]]
            node = parent[node]
        return node

    group_of = {lane: g for g, group in enumerate(groups) for lane in group}
    for g, group in enumerate(groups):
        for lane in group:
            for following in network.successors(lane):
                if following in group_of:
                    parent[root(2 * g + 1)] = root(2 * group_of[following])
    names = [str(root(node)) for node in range(len(parent))]
    return names[0::2], names[1::2]
