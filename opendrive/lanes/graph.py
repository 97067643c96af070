"""Which lane leads to which, in travel direction; neighbours, lane changes and routes.

A link of the file says that two lane ends touch. Together with the lanes' directions this makes the directed
graph: a lane leads to another if its exit touches the other's entry (ASAM OpenDRIVE 1.8,
chapters "Roads", "Lanes" and "Junctions").
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from opendrive.arrays import FloatArray, IntArray
from opendrive.errors import MapWarning, WarningKind
from opendrive.lanes.table import LaneKey, LaneTable, RoadTable
from opendrive.model import Connection, ContactPoint, Junction, MapModel, RoadLink

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
        touching: every pair of places on lanes that the map links; a pair may come twice, from both sides.
        warnings: links that point nowhere.
    """

    successors: tuple[tuple[int, ...], ...]
    predecessors: tuple[tuple[int, ...], ...]
    from_lane: IntArray
    to_lane: IntArray
    from_s_m: FloatArray
    to_s_m: FloatArray
    touching: tuple[tuple[LanePlace, LanePlace], ...]
    warnings: tuple[MapWarning, ...]

    @classmethod
    def build(cls, roads: RoadTable, lanes: LaneTable, junctions: Iterable[Junction]) -> "LaneGraph":
        """Build the graph from the links of roads, lanes and junctions."""
        builder = _Builder(roads, lanes)
        start_m, end_m, direction = lanes.s_start_m.tolist(), lanes.s_end_m.tolist(), lanes.direction.tolist()
        exits = ["end" if along > 0 else "start" for along in direction]
        edges: set[tuple[int, int, float, float]] = set()
        touching = tuple(builder.touching_places(junctions))
        for (a, at_a), (b, at_b) in touching:
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
            touching,
            tuple(builder.warnings),
        )


def _leaves(at: ContactPoint | float, lane_exit: str) -> bool:
    return at == lane_exit or isinstance(at, float)


def _enters(at: ContactPoint | float, lane_exit: str) -> bool:
    return at != lane_exit


class _Builder:
    """Walks through the links of a map."""

    def __init__(self, roads: RoadTable, lanes: LaneTable) -> None:
        self.roads = roads
        self.lanes = lanes
        self.road_of = {road_id: r for r, road_id in enumerate(roads.id)}
        sections = lanes.sections
        self.first_section = np.searchsorted(sections.road, np.arange(len(roads.id) + 1)).tolist()
        self.first_lane = np.searchsorted(lanes.section, np.arange(len(sections.road) + 1)).tolist()
        self.warnings: list[MapWarning] = []

    def touching_places(self, junctions: Iterable[Junction]) -> Iterator[tuple[LanePlace, LanePlace]]:
        """Yield every pair of places that the map links."""
        for road, links in enumerate(zip(self.roads.predecessor, self.roads.successor, strict=True)):
            yield from self._between_sections(road)
            yield from self._between_roads(road, "start", links[0])
            yield from self._between_roads(road, "end", links[1])
        for junction in junctions:
            for connection in junction.connections:
                yield from self._through_junction(junction.id, connection)

    def _warn(
        self, road_id: str, element: str, message: str, s_m: float | None = None, rule: str = ""
    ) -> None:
        self.warnings.append(MapWarning(road_id, element, message, WarningKind.LINK, s_m, rule=rule))

    def _section_at(self, road: int, end: ContactPoint) -> int:
        return 0 if end == "start" else self.first_section[road + 1] - self.first_section[road] - 1

    def _lanes_of(self, road: int, section: int) -> range:
        k = self.first_section[road] + section
        return range(self.first_lane[k], self.first_lane[k + 1])

    def _end(self, road: int, end: ContactPoint, lane_id: int, source: str) -> LanePlace | None:
        return self._lane_end(road, self._section_at(road, end), lane_id, end, source)

    def _met(self, road: int, link: RoadLink, lane_id: int, source: str) -> LanePlace | None:
        """Return the place of a lane that a link to its road meets."""
        if link.contact_point is not None:
            return self._end(road, link.contact_point, lane_id, source)
        s_m = min(max(link.s_m or 0.0, 0.0), float(self.roads.length_m[road]))
        starts = self.lanes.sections.start_m[self.first_section[road] : self.first_section[road + 1]]
        section = max(int(np.searchsorted(starts, s_m, side="right")) - 1, 0)
        place = self._lane_end(road, section, lane_id, "start", source)
        return None if place is None else (place[0], s_m)

    def _lane_end(
        self, road: int, section: int, lane_id: int, end: ContactPoint, source: str
    ) -> LanePlace | None:
        road_id = self.roads.id[road]
        lane = self.lanes.lane_of_key.get(LaneKey(road_id, section, lane_id))
        if lane is None:
            if lane_id != 0:
                s_m = float(self.lanes.sections.start_m[self.first_section[road] + section])
                self._warn(road_id, source, f"links to lane {lane_id} of section {section}, not there", s_m)
            return None
        return lane, end

    def _between_sections(self, road: int) -> Iterator[tuple[LanePlace, LanePlace]]:
        for k in range(self._section_at(road, "end")):
            lanes = self.lanes
            pairs = [
                (lanes.key[i].lane_id, link) for i in self._lanes_of(road, k) for link in lanes.successors[i]
            ]
            pairs += [
                (link, lanes.key[i].lane_id)
                for i in self._lanes_of(road, k + 1)
                for link in lanes.predecessors[i]
            ]
            for earlier, later in dict.fromkeys(pairs):
                a = self._lane_end(road, k, earlier, "end", "lane/link")
                b = self._lane_end(road, k + 1, later, "start", "lane/link")
                if a is not None and b is not None:
                    yield a, b

    def _between_roads(
        self, road: int, end: ContactPoint, link: RoadLink | None
    ) -> Iterator[tuple[LanePlace, LanePlace]]:
        if link is None or link.element_type != "road" or (link.contact_point is None and link.s_m is None):
            return
        s_m = 0.0 if end == "start" else float(self.roads.length_m[road])
        other = self.road_of.get(link.element_id)
        if other is None:
            message = f"links to road {link.element_id!r}, not in the map"
            self._warn(self.roads.id[road], "road/link", message, s_m)
            return
        links = self.lanes.predecessors if end == "start" else self.lanes.successors
        for lane in self._lanes_of(road, self._section_at(road, end)):
            for lane_id in links[lane]:
                met = self._met(other, link, lane_id, "lane/link")
                if met is not None:
                    yield (lane, end), met

    def _through_junction(
        self, junction_id: str, connection: Connection
    ) -> Iterator[tuple[LanePlace, LanePlace]]:
        incoming = self.road_of.get(connection.incoming_road)
        connecting = self.road_of.get(connection.connecting_road)
        if incoming is None or connecting is None:
            missing = connection.incoming_road if incoming is None else connection.connecting_road
            self._warn(junction_id, "junction/connection", f"road {missing!r} is not in the map")
            return
        link = self._link_into_junction(junction_id, incoming, connecting, connection.contact_point)
        if link is None:
            message = f"road {connection.incoming_road!r} does not touch the junction"
            self._warn(junction_id, "junction/connection", message)
            return
        source = "junction/connection/laneLink"
        for from_lane, to_lane in connection.lane_links or self._same_ids(
            incoming, link.contact_point or "end", connecting, connection.contact_point
        ):
            a = self._met(incoming, link, from_lane, source)
            b = self._end(connecting, connection.contact_point, to_lane, source)
            if a is not None and b is not None:
                yield a, b

    def _same_ids(
        self, incoming: int, leaves_at: ContactPoint, connecting: int, enters_at: ContactPoint
    ) -> list[tuple[int, int]]:
        """Return the links of a connection that lists none: lanes of equal id belong together."""
        before, after = (
            {self.lanes.key[lane].lane_id for lane in self._lanes_of(road, self._section_at(road, end))}
            for road, end in ((incoming, leaves_at), (connecting, enters_at))
        )
        return [(lane_id, lane_id) for lane_id in sorted(before & after)]

    def _link_into_junction(
        self, junction_id: str, incoming: int, connecting: int, contact_point: ContactPoint
    ) -> RoadLink | None:
        """Return a link to the place of the incoming road that a connection starts from.

        The connecting road's own link is the best witness: a road can touch the same junction with both ends,
        and the main road of a virtual junction has no end there.
        """
        roads = self.roads
        back = (roads.predecessor if contact_point == "start" else roads.successor)[connecting]
        if (
            back is not None
            and back.element_type == "road"
            and back.element_id == roads.id[incoming]
            and (back.contact_point or back.s_m is not None)
        ):
            return back
        ends: tuple[tuple[RoadLink | None, ContactPoint], ...] = (
            (roads.successor[incoming], "end"),
            (roads.predecessor[incoming], "start"),
        )
        for link, end in ends:
            if link is not None and link.element_type == "junction" and link.element_id == junction_id:
                return RoadLink("road", roads.id[incoming], end)
        return None


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
