"""Which lane leads to which, in travel direction; neighbours, lane changes and routes.

A link of the file says that two lane ends touch. Together with the lanes' directions this makes the directed
graph: a lane leads to another if its exit touches the other's entry (ASAM OpenDRIVE 1.8,
chapters "Roads", "Lanes" and "Junctions").
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from opendrive.arrays import FloatArray, IntArray
from opendrive.errors import MapWarning
from opendrive.lanes import LaneKey, LaneTable
from opendrive.model import Connection, ContactPoint, Lane, MapModel, Road, RoadLink

Side: TypeAlias = Literal["left", "right"]
LanePlace: TypeAlias = tuple[int, ContactPoint | float]
"""A lane and its start, its end, or the s at which a virtual junction meets it."""


@dataclass(frozen=True, slots=True, eq=False)
class LaneGraph:
    """Directed graph of the lanes.

    Attributes:
        successors: (L,) lanes that each lane leads to, ascending.
        predecessors: (L,) lanes that lead to each lane, ascending.
        from_lane: (E,) lane that each edge leaves, ascending.
        to_lane: (E,) lane that it enters.
        from_s_m: (E,) road s where it leaves: the lane's exit, but in virtual junctions.
        to_s_m: (E,) road s where it enters: the lane's entry, but in virtual junctions.
        warnings: links that point nowhere.
    """

    successors: tuple[tuple[int, ...], ...]
    predecessors: tuple[tuple[int, ...], ...]
    from_lane: IntArray
    to_lane: IntArray
    from_s_m: FloatArray
    to_s_m: FloatArray
    warnings: tuple[MapWarning, ...]

    @classmethod
    def build(cls, model: MapModel, lanes: LaneTable) -> "LaneGraph":
        """Build the graph from the links of roads, lanes and junctions."""
        builder = _Builder(model, lanes)
        start_m, end_m, direction = lanes.s_start_m.tolist(), lanes.s_end_m.tolist(), lanes.direction.tolist()
        exits = ["end" if along > 0 else "start" for along in direction]
        edges: set[tuple[int, int, float, float]] = set()
        for (a, at_a), (b, at_b) in builder.touching_places():
            s_a, s_b = (
                at if isinstance(at, float) else (start_m if at == "start" else end_m)[lane]
                for lane, at in ((a, at_a), (b, at_b))
            )
            if _leaves(at_a, exits[a]) and _enters(at_b, exits[b]):
                edges.add((a, b, s_a, s_b))
            elif _leaves(at_b, exits[b]) and _enters(at_a, exits[a]):
                edges.add((b, a, s_b, s_a))
        successors: list[set[int]] = [set() for _ in start_m]
        predecessors: list[set[int]] = [set() for _ in start_m]
        for a, b, _, _ in edges:
            successors[a].add(b)
            predecessors[b].add(a)
        columns = np.array(sorted(edges), dtype=np.float64).reshape(-1, 4).T
        return cls(
            tuple(tuple(sorted(s)) for s in successors),
            tuple(tuple(sorted(p)) for p in predecessors),
            columns[0].astype(np.int64),
            columns[1].astype(np.int64),
            columns[2].copy(),
            columns[3].copy(),
            tuple(builder.warnings),
        )


def _leaves(at: ContactPoint | float, lane_exit: str) -> bool:
    return at == lane_exit or isinstance(at, float)


def _enters(at: ContactPoint | float, lane_exit: str) -> bool:
    return at != lane_exit


class _Builder:
    """Walks through the links of a map."""

    def __init__(self, model: MapModel, lanes: LaneTable) -> None:
        self.model = model
        self.lanes = lanes
        self.warnings: list[MapWarning] = []

    def touching_places(self) -> Iterator[tuple[LanePlace, LanePlace]]:
        """Yield every pair of places that the map links."""
        for road in self.model.roads.values():
            yield from self._between_sections(road)
            yield from self._between_roads(road, "start", road.predecessor)
            yield from self._between_roads(road, "end", road.successor)
        for junction in self.model.junctions.values():
            for connection in junction.connections:
                yield from self._through_junction(junction.id, connection)

    def _end(self, road: Road, end: ContactPoint, lane_id: int, source: str) -> LanePlace | None:
        section = 0 if end == "start" else len(road.sections) - 1
        return self._lane_end(LaneKey(road.id, section, lane_id), end, source)

    def _met(self, road: Road, link: RoadLink, lane_id: int, source: str) -> LanePlace | None:
        """Return the place of a lane that a link to its road meets."""
        if link.contact_point is not None:
            return self._end(road, link.contact_point, lane_id, source)
        s_m = float(np.clip(link.s_m or 0.0, 0.0, road.length_m))
        section = max(k for k, record in enumerate(road.sections) if k == 0 or record.s_m <= s_m)
        found = self._lane_end(LaneKey(road.id, section, lane_id), "start", source)
        return None if found is None else (found[0], s_m)

    def _lane_end(self, key: LaneKey, end: ContactPoint, source: str) -> LanePlace | None:
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

    def _between_sections(self, road: Road) -> Iterator[tuple[LanePlace, LanePlace]]:
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
    ) -> Iterator[tuple[LanePlace, LanePlace]]:
        if link is None or link.element_type != "road" or (link.contact_point is None and link.s_m is None):
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
                b = self._met(other, link, lane_id, "lane/link")
                if a is not None and b is not None:
                    yield a, b

    def _through_junction(
        self, junction_id: str, connection: Connection
    ) -> Iterator[tuple[LanePlace, LanePlace]]:
        incoming = self.model.roads.get(connection.incoming_road)
        connecting = self.model.roads.get(connection.connecting_road)
        if incoming is None or connecting is None:
            missing = connection.incoming_road if incoming is None else connection.connecting_road
            self.warnings.append(
                MapWarning(junction_id, "junction/connection", f"road {missing!r} is not in the map")
            )
            return
        link = _link_into_junction(junction_id, incoming, connecting, connection.contact_point)
        if link is None:
            self.warnings.append(
                MapWarning(
                    junction_id, "junction/connection", f"road {incoming.id!r} does not touch the junction"
                )
            )
            return
        for from_lane, to_lane in connection.lane_links or _same_ids(incoming, link, connecting, connection):
            a = self._met(incoming, link, from_lane, "junction/connection/laneLink")
            b = self._end(connecting, connection.contact_point, to_lane, "junction/connection/laneLink")
            if a is not None and b is not None:
                yield a, b


def _same_ids(
    incoming: Road, link: RoadLink, connecting: Road, connection: Connection
) -> tuple[tuple[int, int], ...]:
    """Return the links of a connection that lists none: lanes of equal id belong together."""
    before = incoming.sections[0 if link.contact_point == "start" else -1]
    after = connecting.sections[0 if connection.contact_point == "start" else -1]
    common = {lane.id for lane in before.lanes} & {lane.id for lane in after.lanes} - {0}
    return tuple((lane_id, lane_id) for lane_id in sorted(common))


def _links(lane: Lane, end: ContactPoint) -> tuple[int, ...]:
    return lane.predecessors if end == "start" else lane.successors


def _link_into_junction(
    junction_id: str, incoming: Road, connecting: Road, contact_point: ContactPoint
) -> RoadLink | None:
    """Return a link to the place of the incoming road that a connection starts from.

    The connecting road's own link is the best witness: a road can touch the same junction with both ends, and
    the main road of a virtual junction has no end there.
    """
    back = connecting.predecessor if contact_point == "start" else connecting.successor
    if (
        back is not None
        and back.element_type == "road"
        and back.element_id == incoming.id
        and (back.contact_point or back.s_m is not None)
    ):
        return back
    if incoming.successor is not None and _is_junction(incoming.successor, junction_id):
        return RoadLink("road", incoming.id, "end")
    if incoming.predecessor is not None and _is_junction(incoming.predecessor, junction_id):
        return RoadLink("road", incoming.id, "start")
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


def crossing_permissions(model: MapModel, key: LaneKey, other: LaneKey) -> list[tuple[float, bool]]:
    """Return from which s on the marks between two neighbouring lanes allow a change from `key` to `other`.

    The marks lie on the outer border of the inner lane, or on the centre line. Their laneChange counts lane
    ids: ``increase`` allows changes to a greater id. A mark without the attribute allows both, as the
    standard says; so does a border without any mark.
    """
    section = model.roads[key.road_id].sections[key.section]
    inner_id = 0 if key.lane_id * other.lane_id < 0 else min(key.lane_id, other.lane_id, key=abs)
    marks = next((lane.road_marks for lane in section.lanes if lane.id == inner_id), ())
    allowed = (None, "both", "increase" if other.lane_id > key.lane_id else "decrease")
    permissions = [(section.s_m + mark.s_offset_m, mark.lane_change in allowed) for mark in marks]
    return [(section.s_m, True), *permissions]


def may_cross(model: MapModel, key: LaneKey, other: LaneKey, s_m: float) -> bool:
    """Return whether the mark at `s_m` allows a change from a lane to its neighbour."""
    permissions = crossing_permissions(model, key, other)
    return [may for start_m, may in permissions if start_m <= s_m + 1e-9][-1]


def crossing_ranges(
    model: MapModel, key: LaneKey, other: LaneKey, start_m: float, end_m: float
) -> list[tuple[float, float]]:
    """Return the stretches of s between two limits on which a lane may be left for its neighbour."""
    ranges: list[tuple[float, float]] = []
    permissions = crossing_permissions(model, key, other)
    ends = [*(start for start, _ in permissions[1:]), np.inf]
    for (low_m, may), high_m in zip(permissions, ends, strict=True):
        low, high = max(low_m, start_m), min(high_m, end_m)
        if not may or high <= low:
            continue
        if ranges and ranges[-1][1] == low:
            ranges[-1] = (ranges[-1][0], high)
        else:
            ranges.append((low, high))
    return ranges
