"""How the lanes of a network are joined: neighbours, successors, lane changes, routes."""

from collections.abc import Collection
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike

from opendrive.arrays import FloatArray, finite
from opendrive.errors import PositionError
from opendrive.lanes.graph import LaneGraph, Side, crossing_ranges, may_cross, neighbour_key
from opendrive.lanes.travel import (
    LANE_CHANGE_COST_M,
    ROUTE_LANE_TYPES,
    LanePlaces,
    LaneRoute,
    lane_route,
    travelled,
)
from opendrive.roads.network_lanes import NetworkLanes


class NetworkTopology(NetworkLanes):
    """How lanes are joined: the second group of a `RoadNetwork`'s methods.

    Lanes are named by their index (`NetworkLanes.lanes`), places on them by the s of their road. Left and
    right, before and after are those of travel direction.
    """

    @cached_property
    def _graph(self) -> LaneGraph:
        return LaneGraph.build(self._geometry.roads, self.lanes, self._model.junctions.values())

    def successors(self, lane: int) -> tuple[int, ...]:
        """Return the lanes that traffic reaches next from a lane, across sections, roads and junctions.

        Raises:
            LaneNotFoundError: no such lane.
        """
        return self._graph.successors[self._checked(lane)]

    def predecessors(self, lane: int) -> tuple[int, ...]:
        """Return the lanes that traffic reaches a lane from.

        Raises:
            LaneNotFoundError: no such lane.
        """
        return self._graph.predecessors[self._checked(lane)]

    def left_neighbour(self, lane: int) -> int | None:
        """Return the lane on the left as seen in travel direction, of whatever type and direction, or None.

        Raises:
            LaneNotFoundError: no such lane.
        """
        return self._neighbour(lane, "left")

    def right_neighbour(self, lane: int) -> int | None:
        """Return the lane on the right as seen in travel direction, of whatever type and direction, or None.

        Raises:
            LaneNotFoundError: no such lane.
        """
        return self._neighbour(lane, "right")

    def lane_change(self, lane: int, s_m: float, side: Side) -> bool:
        """Return whether the road mark at `s_m` allows changing to the neighbour on a side (chapter "Lanes").

        A mark without the attribute laneChange allows it, and so does a border without mark; false if there
        is no neighbour. Type and direction of the neighbour are not looked at.

        Args:
            lane: index of the lane.
            s_m: road s.
            side: ``left`` or ``right``, in travel direction.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane, or the side is neither.
        """
        if side not in ("left", "right"):
            raise PositionError(f"side: expected 'left' or 'right', got {side!r}")
        s = float(self._on_lane(lane, s_m))
        other = self._neighbour(lane, side)
        return other is not None and may_cross(self._model, self.lanes.key[lane], self.lanes.key[other], s)

    def lane_change_ranges(self, lane: int, side: Side) -> FloatArray:
        """Return the stretches of s (K, 2) on which `lane_change` is true.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: the side is neither left nor right.
        """
        if side not in ("left", "right"):
            raise PositionError(f"side: expected 'left' or 'right', got {side!r}")
        other = self._neighbour(lane, side)
        if other is None:
            return np.empty((0, 2))
        start, end = float(self.lanes.s_start_m[lane]), float(self.lanes.s_end_m[lane])
        ranges = crossing_ranges(self._model, self.lanes.key[lane], self.lanes.key[other], start, end)
        return np.array(ranges, dtype=np.float64).reshape(-1, 2)

    def places_ahead(
        self, lane: ArrayLike, s_m: ArrayLike, distance_m: ArrayLike, backward: bool = False
    ) -> LanePlaces:
        """Return all places that are some metres further on in travel direction, on every branch.

        The distance is measured along the reference lines, as s is. Ways that end before it are left out.

        Args:
            lane: (N,) lanes, or one.
            s_m: (N,) road s where to start, broadcast against `lane`.
            distance_m: (N,) how far to go, broadcast as well.
            backward: go against travel direction instead.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane, or a distance is negative or has too many
                branches.
        """
        lanes, s = self._on_lanes(lane, s_m)
        lanes, s, distance = np.broadcast_arrays(lanes, s, finite(distance_m, "distance_m"))
        if distance.size and distance.min() < 0.0:
            raise PositionError(f"distance_m: expected no negative value, got {distance.min()}")
        return travelled(self.lanes, self._graph, lanes.ravel(), s.ravel(), distance.ravel(), backward)

    def shortest_route(self, from_lane: int, to_lane: int) -> tuple[int, ...]:
        """Return the lanes of the shortest way between two lanes, both included, without lane changes.

        Raises:
            LaneNotFoundError: no such lane.
            RouteNotFoundError: no chain of successors leads there.
        """
        start, goal = self._checked(from_lane), self._checked(to_lane)
        forward = self.lanes.direction > 0
        entry = float(np.where(forward, self.lanes.s_start_m, self.lanes.s_end_m)[start])
        leave = float(np.where(forward, self.lanes.s_end_m, self.lanes.s_start_m)[goal])
        route = lane_route(self._model, self.lanes, self._graph, (start, entry), (goal, leave), np.inf)
        return tuple(route.lane.tolist())

    def route(
        self,
        from_lane: int,
        from_s_m: float,
        to_lane: int,
        to_s_m: float,
        lane_change_cost_m: float = LANE_CHANGE_COST_M,
        lane_types: Collection[str] = ROUTE_LANE_TYPES,
    ) -> LaneRoute:
        """Return the cheapest way between two places on lanes, with lane changes where the marks allow them.

        The cost is the length along the reference lines plus `lane_change_cost_m` for each lane change.
        Changes lead to lanes of the same direction and of the given types. `nearest_lane` finds the place of
        a pose.

        Args:
            from_lane: lane of the start.
            from_s_m: road s of the start.
            to_lane: lane of the goal.
            to_s_m: road s of the goal.
            lane_change_cost_m: detour that a lane change is worth; infinite for none.
            lane_types: OpenDRIVE lane types that may be changed into.

        Raises:
            LaneNotFoundError: no such lane.
            PositionError: s is not finite or off the lane, or the cost is not positive.
            RouteNotFoundError: no way leads there.
        """
        if not lane_change_cost_m > 0.0:
            raise PositionError(f"lane_change_cost_m: expected a positive number, got {lane_change_cost_m}")
        start = (self._checked(from_lane), float(self._on_lane(from_lane, from_s_m)))
        goal = (self._checked(to_lane), float(self._on_lane(to_lane, to_s_m)))
        return lane_route(self._model, self.lanes, self._graph, start, goal, lane_change_cost_m, lane_types)

    # Checks

    def _neighbour(self, lane: int, side: Side) -> int | None:
        i = self._checked(lane)
        return self.lanes.lane_of_key.get(
            neighbour_key(self.lanes.key[i], int(self.lanes.direction[i]), side)
        )
