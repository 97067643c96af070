"""Ways along the lanes: places some metres on, and shortest routes with lane changes.

Distances are measured along the reference line, as s is.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from opendrive.arrays import BoolArray, FloatArray, IntArray, concatenated_ranges, first_rows
from opendrive.errors import PositionError, RouteNotFoundError
from opendrive.lanes.graph import LaneGraph, Side, crossing_ranges, neighbour_key
from opendrive.lanes.table import LaneTable
from opendrive.model import MapModel

LANE_CHANGE_COST_M = 50.0
"""Length of detour that one lane change is worth unless said otherwise; a convention of this package."""

ROUTE_LANE_TYPES = frozenset(
    {
        "driving",
        "entry",
        "exit",
        "onRamp",
        "offRamp",
        "connectingRamp",
        "slipLane",
        "mwyEntry",
        "mwyExit",
        "bidirectional",
    }
)
"""Lane types that any car may use (ASAM OpenDRIVE 1.8, chapter "Lanes", "Lane type")."""

_MAX_PLACES = 1_000_000
_MAX_STEPS = 100_000
_SAME_PLACE_M = 1e-9
_LEAST_WEIGHT_M = 1e-9


class LanePlaces(NamedTuple):
    """Places on lanes that are reached from N starting places: K pairs, by start.

    Attributes:
        start: (K,) index of the starting place.
        lane: (K,) index of the lane reached.
        s_m: (K,) road s reached.
    """

    start: IntArray
    lane: IntArray
    s_m: FloatArray


@dataclass(frozen=True, slots=True, eq=False)
class LaneRoute:
    """A way along lanes; two legs on the same lane section are joined by a lane change.

    Attributes:
        lane: (K,) lanes in order.
        s_from_m: (K,) road s where each is entered.
        s_to_m: (K,) road s where it is left.
        is_change: (K,) whether the lane is entered by a lane change.
        length_m: length along the reference lines.
    """

    lane: IntArray
    s_from_m: FloatArray
    s_to_m: FloatArray
    is_change: BoolArray
    length_m: float


def travelled(
    lanes: LaneTable,
    graph: LaneGraph,
    lane: IntArray,
    s_m: FloatArray,
    distance_m: FloatArray,
    backward: bool = False,
) -> LanePlaces:
    """Return all places that are `distance_m` (N,) further on in travel direction, or back.

    Raises:
        PositionError: there are more than a million branches, or lanes without length lead round in a circle.
    """
    sign = -1.0 if backward else 1.0
    near, far = (graph.to_lane, graph.from_lane) if backward else (graph.from_lane, graph.to_lane)
    near_s, far_s = (graph.to_s_m, graph.from_s_m) if backward else (graph.from_s_m, graph.to_s_m)
    order = np.argsort(near, kind="stable")
    first = np.searchsorted(near[order], np.arange(len(lanes) + 1))
    along = sign * lanes.direction
    start, left_m = np.arange(len(lane), dtype=np.int64), distance_m
    reached: list[tuple[IntArray, IntArray, FloatArray]] = []
    for _ in range(_MAX_STEPS):
        to_end = np.where(along[lane] > 0, lanes.s_end_m[lane] - s_m, s_m - lanes.s_start_m[lane])
        stays = left_m <= to_end
        reached.append((start[stays], lane[stays], (s_m + along[lane] * left_m)[stays]))
        count = first[lane + 1] - first[lane]
        edge = order[concatenated_ranges(first[lane], count)]
        place = np.repeat(np.arange(lane.size), count)
        to_edge = (near_s[edge] - s_m[place]) * along[lane[place]]
        taken = np.flatnonzero((to_edge >= -_SAME_PLACE_M) & (to_edge < left_m[place]))
        edge, place = edge[taken], place[taken]
        rows = np.stack(
            [start[place], far[edge], far_s[edge], left_m[place] - np.maximum(to_edge[taken], 0.0)], axis=1
        )
        if not len(rows):
            break
        if len(rows) > _MAX_PLACES:
            raise PositionError(
                f"distance {distance_m.max():.6g} m: more than {_MAX_PLACES} branches; ask for less"
            )
        rows = np.unique(rows, axis=0)
        start, lane = rows[:, 0].astype(np.int64), rows[:, 1].astype(np.int64)
        s_m, left_m = rows[:, 2], rows[:, 3]
    else:
        raise PositionError(f"distance {distance_m.max():.6g} m: lanes without length lead round in a circle")
    starts, ends, places = (np.concatenate(parts) for parts in zip(*reached, strict=True))
    order = np.lexsort((places, ends, starts))
    return LanePlaces(starts[order], ends[order], places[order])


def lane_route(
    model: MapModel,
    lanes: LaneTable,
    graph: LaneGraph,
    start: tuple[int, float],
    goal: tuple[int, float],
    lane_change_cost_m: float,
    lane_types: Collection[str] = ROUTE_LANE_TYPES,
) -> LaneRoute:
    """Return the cheapest way between two places (lane, s): its length plus a cost for each lane change.

    Raises:
        RouteNotFoundError: no way leads there.
    """
    changes = _LaneChanges.none()
    if np.isfinite(lane_change_cost_m):
        changes = _LaneChanges.allowed(model, lanes, lane_types)
    stations = _Stations(lanes, graph, changes, (start, goal))
    edges = (stations.along, stations.between(graph), stations.beside(changes, lane_change_cost_m))
    source, target, weight = (np.concatenate(parts) for parts in zip(*edges, strict=True))
    from scipy.sparse import coo_array
    from scipy.sparse.csgraph import dijkstra

    # Sparse matrices add up what stands twice; the least weight counts.
    order = np.lexsort((weight, target, source))
    source, target, weight = source[order], target[order], weight[order]
    distinct = np.ones(len(source), dtype=np.bool_)
    distinct[1:] = (source[1:] != source[:-1]) | (target[1:] != target[:-1])
    # SciPy 1.13 takes no other integers as indices
    nodes_32 = source[distinct].astype(np.int32), target[distinct].astype(np.int32)
    entries = (np.maximum(weight, _LEAST_WEIGHT_M)[distinct], nodes_32)
    size = len(stations.lane)
    first, last = stations.node(*start), stations.node(*goal)
    _, came_from = dijkstra(
        coo_array(entries, shape=(size, size)).tocsr(), indices=np.array([first]), return_predecessors=True
    )
    nodes = [last]
    while nodes[-1] != first:
        previous = int(came_from[0, nodes[-1]])
        if previous < 0:
            raise RouteNotFoundError(
                f"no route leads from lane {tuple(lanes.key[start[0]])} to lane {tuple(lanes.key[goal[0]])}"
            )
        nodes.append(previous)
    return stations.route(np.array(nodes[::-1]))


class _LaneChanges(NamedTuple):
    """Stretches of lanes where a change is allowed: lane, its neighbour, least and greatest s, (C,) each."""

    lane: IntArray
    other: IntArray
    low_m: FloatArray
    high_m: FloatArray

    @classmethod
    def none(cls) -> "_LaneChanges":
        lane, s_m = np.empty(0, dtype=np.int64), np.empty(0)
        return cls(lane, lane, s_m, s_m)

    @classmethod
    def allowed(cls, model: MapModel, lanes: LaneTable, lane_types: Collection[str]) -> "_LaneChanges":
        """Return where marks allow changes to lanes of the same direction and of given types."""
        routable = np.isin(lanes.lane_type, sorted(lane_types)).tolist()
        direction = lanes.direction.tolist()
        start_m, end_m = lanes.s_start_m.tolist(), lanes.s_end_m.tolist()
        rows: list[tuple[float, ...]] = []
        for lane, key in enumerate(lanes.key):
            sides: tuple[Side, ...] = ("left", "right")
            for side in sides:
                other = lanes.lane_of_key.get(neighbour_key(key, direction[lane], side))
                if other is None or not routable[other] or direction[other] != direction[lane]:
                    continue
                ranges = crossing_ranges(model, key, lanes.key[other], start_m[lane], end_m[lane])
                rows += [(lane, other, low_m, high_m) for low_m, high_m in ranges]
        columns = np.array(rows, dtype=np.float64).reshape(-1, 4).T
        return cls(columns[0].astype(np.int64), columns[1].astype(np.int64), columns[2], columns[3])


class _Stations:
    """Nodes of a routing graph: every lane at each s where something starts, ends or branches.

    Lanes of a section share their stations, so that lanes can be changed at each.
    """

    def __init__(
        self,
        lanes: LaneTable,
        graph: LaneGraph,
        changes: _LaneChanges,
        places: tuple[tuple[int, float], ...],
    ) -> None:
        self.lanes = lanes
        every = np.arange(len(lanes))
        section = lanes.section
        extra_lane = np.concatenate(
            [graph.from_lane, graph.to_lane, changes.lane, changes.lane, [lane for lane, _ in places]]
        ).astype(np.int64)
        extra_s = np.concatenate(
            [graph.from_s_m, graph.to_s_m, changes.low_m, changes.high_m, [s for _, s in places]]
        )
        of_section = np.concatenate([section, section, section[extra_lane]])
        s_m = np.concatenate([lanes.s_start_m, lanes.s_end_m, extra_s])
        pairs = np.unique(np.stack([of_section.astype(np.float64), s_m], axis=1), axis=0)
        bounds = np.searchsorted(pairs[:, 0], np.stack([section, section + 1]))
        count = bounds[1] - bounds[0]
        self.lane = np.repeat(every, count)
        self.s_m = pairs[concatenated_ranges(bounds[0], count), 1]
        self.first = first_rows(count)

    @property
    def along(self) -> tuple[IntArray, IntArray, FloatArray]:
        """Edges along the lanes: source, target and weight."""
        low = np.flatnonzero(self.lane[1:] == self.lane[:-1])
        forward = self.lanes.direction[self.lane[low]] > 0
        length = self.s_m[low + 1] - self.s_m[low]
        return np.where(forward, low, low + 1), np.where(forward, low + 1, low), length

    def between(self, graph: LaneGraph) -> tuple[IntArray, IntArray, FloatArray]:
        """Edges from lane to lane: source, target and weight."""
        source = self.nodes(graph.from_lane, graph.from_s_m)
        return source, self.nodes(graph.to_lane, graph.to_s_m), np.zeros(len(source))

    def beside(self, changes: _LaneChanges, cost_m: float) -> tuple[IntArray, IntArray, FloatArray]:
        """Lane changes at every station from which the mark allows them onwards."""
        first, last = self.nodes(changes.lane, changes.low_m), self.nodes(changes.lane, changes.high_m)
        against = self.lanes.direction[changes.lane] < 0
        source = concatenated_ranges(first + against, last - first)
        shift = np.repeat(self.first[changes.other] - self.first[changes.lane], last - first)
        return source, source + shift, np.full(len(source), cost_m)

    def node(self, lane: int, s_m: float) -> int:
        """Return the node at a place."""
        return int(self.nodes(np.array([lane]), np.array([s_m]))[0])

    def nodes(self, lane: IntArray, s_m: FloatArray) -> IntArray:
        """Return the nodes at places."""
        key = np.empty(len(self.lane), dtype=np.complex128)
        key.real, key.imag = self.lane, self.s_m
        wanted = np.empty(len(lane), dtype=np.complex128)
        wanted.real, wanted.imag = lane, s_m
        return np.searchsorted(key, wanted).astype(np.int64)

    def route(self, nodes: IntArray) -> LaneRoute:
        """Return the route through nodes."""
        lane, s_m = self.lane[nodes], self.s_m[nodes]
        enters = np.append(True, lane[1:] != lane[:-1])
        # A circular lane is entered again from its own end.
        forward = self.lanes.direction[lane[1:]] * (s_m[1:] - s_m[:-1]) >= 0.0
        enters[1:] |= ~forward
        first = np.flatnonzero(enters)
        last = np.append(first[1:], len(nodes)) - 1
        section = self.lanes.section[lane[first]]
        is_change = np.zeros(len(first), dtype=np.bool_)
        is_change[1:] = (
            (section[1:] == section[:-1])
            & (lane[first[1:]] != lane[first[:-1]])
            & (s_m[first[1:]] == s_m[last[:-1]])
        )
        length_m = float(np.abs(s_m[last] - s_m[first]).sum())
        return LaneRoute(lane[first], s_m[first], s_m[last], is_change, length_m)
