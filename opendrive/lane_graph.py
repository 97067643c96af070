"""Which lane leads to which, in travel direction; neighbours, lane changes and routes.

A link of the file says that two lane ends touch. Together with the lanes' directions this makes the directed
graph: a lane leads to another if its exit touches the other's entry (ASAM OpenDRIVE 1.8,
chapters "Roads", "Lanes" and "Junctions").
"""

import heapq
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from opendrive.errors import MapWarning, RouteNotFoundError
from opendrive.lanes import LaneKey, LaneTable
from opendrive.model import Connection, ContactPoint, Lane, MapModel, Road, RoadLink

Side: TypeAlias = Literal["left", "right"]
LaneEnd: TypeAlias = tuple[int, ContactPoint]


@dataclass(frozen=True, slots=True, eq=False)
class LaneGraph:
    """Directed graph of the lanes.

    Attributes:
        successors: (L,) lanes that each lane leads to, ascending.
        predecessors: (L,) lanes that lead to each lane, ascending.
        warnings: links that point nowhere.
    """

    successors: tuple[tuple[int, ...], ...]
    predecessors: tuple[tuple[int, ...], ...]
    warnings: tuple[MapWarning, ...]

    @classmethod
    def build(cls, model: MapModel, lanes: LaneTable) -> "LaneGraph":
        """Build the graph from the links of roads, lanes and junctions."""
        builder = _Builder(model, lanes)
        successors: list[set[int]] = [set() for _ in range(len(lanes))]
        predecessors: list[set[int]] = [set() for _ in range(len(lanes))]
        for (a, end_a), (b, end_b) in builder.touching_ends():
            exit_a = "end" if lanes.direction[a] > 0 else "start"
            exit_b = "end" if lanes.direction[b] > 0 else "start"
            if end_a == exit_a and end_b != exit_b:
                successors[a].add(b)
                predecessors[b].add(a)
            elif end_b == exit_b and end_a != exit_a:
                successors[b].add(a)
                predecessors[a].add(b)
        return cls(
            tuple(tuple(sorted(s)) for s in successors),
            tuple(tuple(sorted(p)) for p in predecessors),
            tuple(builder.warnings),
        )

    def shortest_route(self, lanes: LaneTable, start: int, goal: int) -> tuple[int, ...]:
        """Return the lanes from `start` to `goal`, both included, of least total length (Dijkstra).

        Raises:
            RouteNotFoundError: no chain of successors leads there.
        """
        length_m = (lanes.s_end_m - lanes.s_start_m).tolist()
        best = {start: length_m[start]}
        came_from: dict[int, int] = {}
        queue = [(best[start], start)]
        while queue:
            travelled, lane = heapq.heappop(queue)
            if lane == goal:
                route = [goal]
                while route[-1] != start:
                    route.append(came_from[route[-1]])
                return tuple(reversed(route))
            if travelled > best[lane]:
                continue
            for following in self.successors[lane]:
                total = travelled + length_m[following]
                if total < best.get(following, np.inf):
                    best[following] = total
                    came_from[following] = lane
                    heapq.heappush(queue, (total, following))
        raise RouteNotFoundError(
            f"no route leads from lane {tuple(lanes.key[start])} to lane {tuple(lanes.key[goal])}"
        )


class _Builder:
    """Walks through the links of a map."""

    def __init__(self, model: MapModel, lanes: LaneTable) -> None:
        self.model = model
        self.lanes = lanes
        self.warnings: list[MapWarning] = []

    def touching_ends(self) -> Iterator[tuple[LaneEnd, LaneEnd]]:
        """Yield every pair of lane ends that the map links."""
        for road in self.model.roads.values():
            yield from self._between_sections(road)
            yield from self._between_roads(road, "start", road.predecessor)
            yield from self._between_roads(road, "end", road.successor)
        for junction in self.model.junctions.values():
            for connection in junction.connections:
                yield from self._through_junction(junction.id, connection)

    def _end(self, road: Road, end: ContactPoint, lane_id: int, source: str) -> LaneEnd | None:
        section = 0 if end == "start" else len(road.sections) - 1
        return self._lane_end(LaneKey(road.id, section, lane_id), end, source)

    def _lane_end(self, key: LaneKey, end: ContactPoint, source: str) -> LaneEnd | None:
        lane = self.lanes.lane_of_key.get(key)
        if lane is None:
            if key.lane_id != 0:
                self.warnings.append(
                    MapWarning(
                        key.road_id,
                        source,
                        f"links to lane {key.lane_id} of section {key.section}, not there",
                    )
                )
            return None
        return lane, end

    def _between_sections(self, road: Road) -> Iterator[tuple[LaneEnd, LaneEnd]]:
        for k in range(len(road.sections) - 1):
            before, after = road.sections[k], road.sections[k + 1]
            pairs = [(lane.id, link) for lane in before.lanes if lane.id for link in lane.successors]
            pairs += [(link, lane.id) for lane in after.lanes if lane.id for link in lane.predecessors]
            for earlier, later in dict.fromkeys(pairs):
                a = self._lane_end(LaneKey(road.id, k, earlier), "end", "lane/link")
                b = self._lane_end(LaneKey(road.id, k + 1, later), "start", "lane/link")
                if a is not None and b is not None:
                    yield a, b

    def _between_roads(
        self, road: Road, end: ContactPoint, link: RoadLink | None
    ) -> Iterator[tuple[LaneEnd, LaneEnd]]:
        if link is None or link.element_type != "road" or link.contact_point is None:
            return
        other = self.model.roads.get(link.element_id)
        if other is None:
            self.warnings.append(
                MapWarning(road.id, "road/link", f"links to road {link.element_id!r}, not in the map")
            )
            return
        section = road.sections[0 if end == "start" else -1]
        for lane in section.lanes:
            for lane_id in _links(lane, end) if lane.id else ():
                a = self._end(road, end, lane.id, "lane/link")
                b = self._end(other, link.contact_point, lane_id, "lane/link")
                if a is not None and b is not None:
                    yield a, b

    def _through_junction(
        self, junction_id: str, connection: Connection
    ) -> Iterator[tuple[LaneEnd, LaneEnd]]:
        incoming = self.model.roads.get(connection.incoming_road)
        connecting = self.model.roads.get(connection.connecting_road)
        if incoming is None or connecting is None:
            missing = connection.incoming_road if incoming is None else connection.connecting_road
            self.warnings.append(
                MapWarning(junction_id, "junction/connection", f"road {missing!r} is not in the map")
            )
            return
        end = _end_at_junction(junction_id, incoming, connecting, connection.contact_point)
        if end is None:
            self.warnings.append(
                MapWarning(
                    junction_id, "junction/connection", f"road {incoming.id!r} does not touch the junction"
                )
            )
            return
        for from_lane, to_lane in connection.lane_links or _same_ids(incoming, end, connecting, connection):
            a = self._end(incoming, end, from_lane, "junction/connection/laneLink")
            b = self._end(connecting, connection.contact_point, to_lane, "junction/connection/laneLink")
            if a is not None and b is not None:
                yield a, b


def _same_ids(
    incoming: Road, end: ContactPoint, connecting: Road, connection: Connection
) -> tuple[tuple[int, int], ...]:
    """Return the links of a connection that lists none: lanes of equal id belong together."""
    before = incoming.sections[0 if end == "start" else -1]
    after = connecting.sections[0 if connection.contact_point == "start" else -1]
    common = {lane.id for lane in before.lanes} & {lane.id for lane in after.lanes} - {0}
    return tuple((lane_id, lane_id) for lane_id in sorted(common))


def _links(lane: Lane, end: ContactPoint) -> tuple[int, ...]:
    return lane.predecessors if end == "start" else lane.successors


def _end_at_junction(
    junction_id: str, incoming: Road, connecting: Road, contact_point: ContactPoint
) -> ContactPoint | None:
    """Return the end of the incoming road that a connection starts from.

    The connecting road's own link is the best witness: a road can touch the same junction with both ends.
    """
    back = connecting.predecessor if contact_point == "start" else connecting.successor
    if (
        back is not None
        and back.element_type == "road"
        and back.element_id == incoming.id
        and back.contact_point
    ):
        return back.contact_point
    if incoming.successor is not None and _is_junction(incoming.successor, junction_id):
        return "end"
    if incoming.predecessor is not None and _is_junction(incoming.predecessor, junction_id):
        return "start"
    return None


def _is_junction(link: RoadLink, junction_id: str) -> bool:
    return link.element_type == "junction" and link.element_id == junction_id


def neighbour_key(key: LaneKey, direction: int, side: Side) -> LaneKey:
    """Return the key of the lane next to `key` on a side as seen in its travel direction.

    Lane ids grow to the left of the road; the centre lane is skipped.
    """
    step = direction if side == "left" else -direction
    lane_id = key.lane_id + step
    return key._replace(lane_id=lane_id if lane_id else step)


def may_cross(model: MapModel, key: LaneKey, other: LaneKey, s_m: float) -> bool:
    """Return whether the mark between two neighbouring lanes allows a change from `key` to `other`.

    The mark lies on the outer border of the inner lane, or on the centre line. Its laneChange counts lane
    ids: ``increase`` allows changes to a greater id. A mark without the attribute allows both, as the
    standard says; so does a border without any mark.
    """
    section = model.roads[key.road_id].sections[key.section]
    inner_id = 0 if key.lane_id * other.lane_id < 0 else min(key.lane_id, other.lane_id, key=abs)
    marks = next((lane.road_marks for lane in section.lanes if lane.id == inner_id), ())
    permission: str | None = None
    for mark in marks:
        if section.s_m + mark.s_offset_m <= s_m + 1e-9:
            permission = mark.lane_change
    wanted = "increase" if other.lane_id > key.lane_id else "decrease"
    return permission in (None, "both", wanted)
