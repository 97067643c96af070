"""Roads joined end to end, and by junctions whose connecting roads follow from the lanes to be connected."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from opendrive import model
from opendrive.building.records import UNMARKED_CENTRE, Lane, lane_record, profile, road, road_map
from opendrive.building.reference_line import Pose, bridge
from opendrive.errors import OpenDriveError, RoadNotFoundError
from opendrive.network import RoadNetwork

_GRADE_STEP_M = 0.01


@dataclass(frozen=True, slots=True)
class LaneEnd:
    """One end of a lane at an end of its road.

    Attributes:
        road_id: the road.
        end: ``start`` or ``end`` of the road.
        lane_id: the lane, of the lane section there.
    """

    road_id: str
    end: model.ContactPoint
    lane_id: int


def joined(
    roads: Iterable[model.Road], first: tuple[str, model.ContactPoint], second: tuple[str, model.ContactPoint]
) -> list[model.Road]:
    """Return the roads with an end of one linked to an end of another, and the lanes there.

    Lanes of equal id are linked where one road goes on along the other's s, those of opposite id otherwise.

    Args:
        roads: all roads.
        first: id and end of a road.
        second: id and end of the other.

    Raises:
        RoadNotFoundError: one of them is not there.
    """
    by_id = {item.id: item for item in roads}
    sign = 1 if first[1] != second[1] else -1
    for (road_id, end), (other_id, other_end) in ((first, second), (second, first)):
        item, other = _road(by_id, road_id), _road(by_id, other_id)
        there = {lane.id for lane in _end_section(other, other_end).lanes if lane.id}
        lane_ids = [lane.id for lane in _end_section(item, end).lanes if lane.id]
        links: dict[int, tuple[int, ...]] = {n: (sign * n,) for n in lane_ids if sign * n in there}
        by_id[road_id] = _with_link(item, end, model.RoadLink("road", other_id, other_end), links)
    return list(by_id.values())


def junction(
    roads: Iterable[model.Road],
    junction_id: str,
    ways: Sequence[tuple[LaneEnd, LaneEnd]],
    *,
    name: str = "",
    kind: str = "driving",
    speed_mps: float | None = None,
) -> tuple[list[model.Road], model.Junction]:
    """Return the roads, linked to a junction, with its connecting roads; and the junction.

    Each way becomes a connecting road with one lane: from the border of one lane end to that of the other, as
    wide as they are, along both headings and grades.

    Args:
        roads: all roads of the map; superelevated ones cannot be connected.
        junction_id: its id; connecting roads are named ``ID.1``, ``ID.2`` and so on.
        ways: where traffic leaves a road for the junction, and where it enters another, in its direction.
        name: free name.
        kind: lane type of the ways.
        speed_mps: speed limit on them; None for none.

    Raises:
        RoadNotFoundError: a road is not there.
        LaneNotFoundError: a lane is not there.
        OpenDriveError: traffic on a lane does not go that way, or roads keep to different sides.
    """
    by_id = {item.id: item for item in roads}
    network = RoadNetwork(road_map("", by_id.values()))
    connections, connecting_roads = [], []
    for number, (leaves, enters) in enumerate(ways, start=1):
        road_id = f"{junction_id}.{number}"
        rules = {_road(by_id, end.road_id).rule for end in (leaves, enters)}
        if len(rules) > 1:
            raise OpenDriveError(f"roads {leaves.road_id!r} and {enters.road_id!r} keep to different sides")
        (rule,) = rules
        lane_id = -1 if rule == "RHT" else 1
        start = _border_end(network, leaves, lane_id, leaving=True)
        end = _border_end(network, enters, lane_id, leaving=False)
        curve = bridge(start.pose, end.pose)
        width_m = profile([(0.0, start.width_m), (curve.length_m, end.width_m)])[:1]
        # Hermite's cubic through heights and grades.
        rise, length_m = end.z_m - start.z_m, curve.length_m
        square = (3.0 * rise - (2.0 * start.grade + end.grade) * length_m) / length_m**2
        cubic = ((start.grade + end.grade) * length_m - 2.0 * rise) / length_m**3
        elevation = np.array([[0.0, start.z_m, start.grade, square, cubic]])
        lanes = [
            lane_record(0, UNMARKED_CENTRE),
            lane_record(lane_id, Lane(kind, width_m), (leaves.lane_id,), (enters.lane_id,)),
        ]
        lanes.sort(key=lambda lane: -lane.id)
        connecting_roads.append(
            road(
                road_id,
                start.pose,
                [curve],
                [model.LaneSection(0.0, single_side=False, lanes=tuple(lanes))],
                junction_id=junction_id,
                predecessor=model.RoadLink("road", leaves.road_id, leaves.end),
                successor=model.RoadLink("road", enters.road_id, enters.end),
                elevation=elevation if elevation[:, 1:].any() else 0.0,
                speed_mps=speed_mps,
                rule=rule,
            )
        )
        connections.append(
            model.Connection(str(number), leaves.road_id, road_id, "start", ((leaves.lane_id, lane_id),))
        )
    for lane_end in {(end.road_id, end.end): end for way in ways for end in way}.values():
        link = model.RoadLink("junction", junction_id, None)
        by_id[lane_end.road_id] = _with_link(by_id[lane_end.road_id], lane_end.end, link, {})
    every = [*by_id.values(), *connecting_roads]
    return every, model.Junction(junction_id, name, "default", tuple(connections))


@dataclass(frozen=True, slots=True)
class _BorderEnd:
    """The inner border of a lane end in travel direction: pose, height, grade, and the lane's width."""

    pose: Pose
    z_m: float
    grade: float
    width_m: float


def _border_end(network: RoadNetwork, place: LaneEnd, lane_id: int, leaving: bool) -> _BorderEnd:
    """Return the border that the lane of a way begins or ends on: left of it where lanes are right."""
    section = 0 if place.end == "start" else len(network.model.roads[place.road_id].sections) - 1
    lane = network.lane_index_of((place.road_id, section, place.lane_id))
    lanes = network.lanes
    way = int(lanes.direction[lane])
    if ((place.end == "end") == (way > 0)) != leaving:
        verb = "leaves" if leaving else "enters"
        where = f"lane {place.lane_id} of road {place.road_id!r}"
        raise OpenDriveError(f"traffic {verb} {where} at its other end, not at its {place.end}")
    s_m = float(lanes.s_start_m[lane] if place.end == "start" else lanes.s_end_m[lane])
    inwards = _GRADE_STEP_M if place.end == "start" else -_GRADE_STEP_M
    at_m = np.array([s_m, s_m + inwards])
    side = 0 if lane_id < 0 else 1
    xy_m = network.borders(lane, at_m)[side]
    inner_m, outer_m = network.lane_offsets(lane, at_m)
    # Left of travel is where t is greater along s, and less against it.
    t_m = np.maximum(inner_m, outer_m) if (way > 0) == (side == 0) else np.minimum(inner_m, outer_m)
    z_m = network.road_point(place.road_id, at_m, t_m).z_m
    step = (xy_m[1] - xy_m[0]) * (1.0 if (inwards > 0) == (way > 0) else -1.0)
    length_m = float(np.hypot(*step))
    rise = float(z_m[1] - z_m[0]) * (1.0 if (inwards > 0) == (way > 0) else -1.0)
    pose = Pose(float(xy_m[0, 0]), float(xy_m[0, 1]), float(np.arctan2(step[1], step[0])))
    return _BorderEnd(pose, float(z_m[0]), rise / length_m, float(network.lane_width(lane, s_m)))


def _road(roads: dict[str, model.Road], road_id: str) -> model.Road:
    if road_id not in roads:
        raise RoadNotFoundError(f"no road {road_id!r} among those given")
    return roads[road_id]


def _end_section(item: model.Road, end: model.ContactPoint) -> model.LaneSection:
    return item.sections[0 if end == "start" else -1]


def _with_link(
    item: model.Road, end: model.ContactPoint, link: model.RoadLink, lane_links: dict[int, tuple[int, ...]]
) -> model.Road:
    """Return a road with a link at one end, and links of its lanes there."""
    section = _end_section(item, end)
    if end == "start":
        lanes = (replace(lane, predecessors=lane_links.get(lane.id, ())) for lane in section.lanes)
        changed = replace(section, lanes=tuple(lanes))
        return replace(item, predecessor=link, sections=(changed, *item.sections[1:]))
    lanes = (replace(lane, successors=lane_links.get(lane.id, ())) for lane in section.lanes)
    changed = replace(section, lanes=tuple(lanes))
    return replace(item, successor=link, sections=(*item.sections[:-1], changed))
