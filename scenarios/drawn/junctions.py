"""Maps of a junction: a crossing or a T, a roundabout, and the same for left-hand traffic by mirroring."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from opendrive import model
from opendrive.building.records import CENTRE, UNMARKED_CENTRE, lane_record
from opendrive.building.reference_line import Piece, Pose, moved, turned
from scenarios.catalogue.map_builder import (
    Lanes,
    crosswalk_record,
    kerb_at_m,
    map_record,
    road_record,
)
from smartmot.types import FloatArray

CROSSWALK_FROM_MOUTH_M = 4.0
RING_RAD = math.radians(28.0)
"""From the bearing of an arm to where its ways leave and join the ring of a roundabout (assumed)."""


@dataclass(frozen=True, slots=True)
class Arm:
    """A road away from a junction, traffic keeps right; s grows outwards, so lane -1 leads out and 1 in.

    Args:
        road_id: its id.
        bearing_rad: where it points, seen from the middle of the junction.
        mouth_m: from the middle to where it begins.
        length_m: its length.
        lanes: of each side, from the middle outwards.
    """

    road_id: str
    bearing_rad: float
    mouth_m: float
    length_m: float
    lanes: Lanes

    @property
    def outwards(self) -> Pose:
        """Where its reference line begins."""
        return turned(Pose(self.mouth_m, 0.0, 0.0), self.bearing_rad)

    @property
    def inwards(self) -> Pose:
        """The same point, looking to the junction."""
        return replace(self.outwards, yaw_rad=self.bearing_rad - math.pi)

    @property
    def end(self) -> Pose:
        """Where it ends."""
        return moved(self.outwards, self.length_m, 0.0, 0.0)

    @property
    def way_in(self) -> _End:
        """Where ways into the junction begin."""
        return _End(self.inwards, self.road_id, "start", 1)

    @property
    def way_out(self) -> _End:
        """Where ways out of the junction end."""
        return _End(self.outwards, self.road_id, "start", -1)

    def road(self, junction_id: str) -> model.Road:
        """Its road, with a crosswalk before the junction."""
        sides = {
            side: [lane_record(side * k, lane) for k, lane in enumerate(self.lanes, start=1)]
            for side in (1, -1)
        }
        crosswalk = crosswalk_record(self.road_id, CROSSWALK_FROM_MOUTH_M, kerb_at_m(self.lanes))
        return road_record(
            self.road_id,
            f"arm {self.road_id}",
            self.outwards,
            [Piece(self.length_m)],
            (*reversed(sides[1]), lane_record(0, CENTRE), *sides[-1]),
            predecessor=model.RoadLink("junction", junction_id, None),
            details=model.RoadDetails(objects=(crosswalk,)),
        )


def two_arcs(start: Pose, end: Pose) -> list[Piece]:
    """Two arcs of the same tangent length that lead from a pose to another; one straight where that does.

    With unit headings t0, t1 and the vector v between the points, the tangent length d solves
    v.v - 2 d v.(t0 + t1) + 2 d^2 (t0.t1 - 1) = 0.
    """
    t0, t1 = (np.array([math.cos(pose.yaw_rad), math.sin(pose.yaw_rad)]) for pose in (start, end))
    v = np.array([end.x_m - start.x_m, end.y_m - start.y_m])
    along, opening = float(v @ (t0 + t1)), 2.0 * (1.0 - float(t0 @ t1))
    square = float(v @ v)
    if opening < 1e-9:
        tangent_m = square / (2.0 * along)
    else:
        tangent_m = (-along + math.sqrt(along * along + opening * square)) / opening
    joint = (v + tangent_m * (t0 - t1)) / 2
    middle = 2.0 * math.atan2(joint[1], joint[0]) - start.yaw_rad
    pieces = [_arc(joint, start.yaw_rad), _arc(v - joint, middle)]
    if all(piece.curvature_start == 0.0 for piece in pieces):
        return [Piece(round(math.sqrt(square), 9))]
    return pieces


def _arc(chord: FloatArray, yaw_rad: float) -> Piece:
    """The arc over a chord that begins with a heading; rounded, so that files do not vary."""
    chord_m = math.hypot(*chord)
    half_turn = math.remainder(math.atan2(chord[1], chord[0]) - yaw_rad, 2.0 * math.pi)
    if abs(half_turn) < 1e-9:
        return Piece(round(chord_m, 9))
    radius_m = chord_m / 2.0 / math.sin(half_turn)
    curvature = round(1.0 / radius_m, 12)
    return Piece(round(2.0 * half_turn * radius_m, 9), curvature, curvature)


@dataclass(frozen=True, slots=True)
class _End:
    """Where a way through a junction meets a road.

    Args:
        pose: the reference point, in the direction of the way.
        road_id: of the road.
        contact: which end of the road it is.
        sign: of the ids of the road's lanes that the way goes on from or to.
    """

    pose: Pose
    road_id: str
    contact: model.ContactPoint
    sign: int


def _connecting(
    road_id: str, junction_id: str, lanes: Lanes, came: _End, goes: _End
) -> tuple[model.Road, model.Connection]:
    """A road through a junction from an end to another with lanes on its right only, and its connection."""
    numbered = [*enumerate(lanes, start=1)]
    road = road_record(
        road_id,
        f"{came.road_id} to {goes.road_id}",
        came.pose,
        two_arcs(came.pose, goes.pose),
        (
            lane_record(0, UNMARKED_CENTRE),
            *(lane_record(-k, lane, (k * came.sign,), (k * goes.sign,)) for k, lane in numbered),
        ),
        junction_id=junction_id,
        predecessor=model.RoadLink("road", came.road_id, came.contact),
        successor=model.RoadLink("road", goes.road_id, goes.contact),
    )
    links = tuple((k * came.sign, -k) for k, _ in numbered)
    return road, model.Connection(road_id, came.road_id, road_id, "start", links)


def _corners(arms: Sequence[Arm]) -> list[tuple[float, float]]:
    return [(arm.end.x_m, arm.end.y_m) for arm in arms] + [(0.0, 0.0)]


def _unmarked(lanes: Lanes) -> Lanes:
    """The innermost lane without a mark."""
    return (replace(lanes[0], mark="none"),)


def crossing_map(name: str, arms: Sequence[Arm]) -> model.MapModel:
    """A junction of arms with the same lanes, with a way from each to each other; sidewalks go round corners.

    Args:
        name: of the map.
        arms: counter-clockwise.
    """
    junction_id = "100"
    ways = []
    for index, source in enumerate(arms):
        for step in range(1, len(arms)):
            target = arms[(index + step) % len(arms)]
            lanes = source.lanes if step == 1 else _unmarked(source.lanes)
            name_of_way = f"{source.road_id}{target.road_id}"
            ways.append(_connecting(name_of_way, junction_id, lanes, source.way_in, target.way_out))
    roads = [*(arm.road(junction_id) for arm in arms), *(road for road, _ in ways)]
    junction = model.Junction(junction_id, name, "default", tuple(way for _, way in ways))
    return map_record(name, _corners(arms), kerb_at_m(arms[0].lanes) + 5.0, roads, [junction])


def roundabout_map(name: str, arms: Sequence[Arm], ring_m: float) -> model.MapModel:
    """A roundabout: a ring of one lane, at each arm a junction with the ways in, out and past.

    Args:
        name: of the map.
        arms: counter-clockwise, with a driving lane and a sidewalk.
        ring_m: radius of the ring's inner border.
    """

    def ring_pose(angle_rad: float) -> Pose:
        return turned(Pose(ring_m, 0.0, math.pi / 2), angle_rad)

    roads, junctions = [], []
    for index, arm in enumerate(arms):
        junction_id = f"10{arm.road_id}"
        following = arms[(index + 1) % len(arms)]
        before, after = f"2{arms[index - 1].road_id}", f"2{arm.road_id}"
        leaves, joins = ring_pose(arm.bearing_rad - RING_RAD), ring_pose(arm.bearing_rad + RING_RAD)
        lanes, driving = arm.lanes, _unmarked(arm.lanes)
        ring_before = _End(leaves, before, "end", -1)
        ring_after = _End(joins, after, "start", -1)
        ways = [
            _connecting(f"3{arm.road_id}1", junction_id, driving, ring_before, ring_after),
            _connecting(f"3{arm.road_id}2", junction_id, lanes, ring_before, arm.way_out),
            _connecting(f"3{arm.road_id}3", junction_id, lanes, arm.way_in, ring_after),
        ]
        turn_rad = (following.bearing_rad - arm.bearing_rad) % (2.0 * math.pi) - 2.0 * RING_RAD
        ring = road_record(
            after,
            f"ring after arm {arm.road_id}",
            joins,
            [Piece(round(turn_rad * ring_m, 9), 1.0 / ring_m, 1.0 / ring_m)],
            (
                lane_record(0, UNMARKED_CENTRE),
                *(lane_record(-k, lane) for k, lane in enumerate(lanes, start=1)),
            ),
            predecessor=model.RoadLink("junction", junction_id, None),
            successor=model.RoadLink("junction", f"10{following.road_id}", None),
        )
        roads += [arm.road(junction_id), ring, *(road for road, _ in ways)]
        junctions.append(
            model.Junction(junction_id, f"arm {arm.road_id}", "default", tuple(way for _, way in ways))
        )
    return map_record(name, _corners(arms), kerb_at_m(arms[0].lanes) + 5.0, roads, junctions)


# ----------------------------------------------------------------------------------------------- mirroring


def mirrored(content: model.MapModel) -> model.MapModel:
    """The map for left-hand traffic: mirrored about the x axis. Its objects are crosswalks at most."""
    header = content.header
    return model.MapModel(
        replace(header, north_m=-(header.south_m or 0.0), south_m=-(header.north_m or 0.0)),
        roads={road.id: _mirrored_road(road) for road in content.roads.values()},
        junctions={key: _mirrored_junction(junction) for key, junction in content.junctions.items()},
        noted=content.noted,
    )


def _mirrored_road(road: model.Road) -> model.Road:
    details = road.details()
    return replace(
        road,
        rule="LHT",
        geometries=tuple(
            replace(
                piece,
                y_m=0.0 - piece.y_m,
                heading_rad=0.0 - piece.heading_rad,
                shape=_mirrored_shape(piece.shape),
            )
            for piece in road.geometries
        ),
        sections=tuple(
            replace(section, lanes=tuple(_mirrored_lane(lane) for lane in reversed(section.lanes)))
            for section in road.sections
        ),
        details=model.Deferred.of(
            replace(details, objects=tuple(_mirrored_object(item) for item in details.objects))
        ),
    )


def _mirrored_shape(shape: model.Shape) -> model.Shape:
    if isinstance(shape, model.Arc):
        return model.Arc(-shape.curvature_per_m)
    if isinstance(shape, model.Spiral):
        return model.Spiral(0.0 - shape.curvature_start_per_m, 0.0 - shape.curvature_end_per_m)
    return shape


def _mirrored_lane(lane: model.Lane) -> model.Lane:
    return replace(
        lane,
        id=-lane.id,
        predecessors=tuple(-k for k in lane.predecessors),
        successors=tuple(-k for k in lane.successors),
    )


def _mirrored_object(item: model.RoadObject) -> model.RoadObject:
    """Corners about the middle line; in reverse, so that they stay counter-clockwise."""
    outlines = tuple(
        replace(outline, corners=outline.corners[::-1] * np.array([1.0, -1.0, 1.0]))
        for outline in item.outlines
    )
    return replace(item, t_m=0.0 - item.t_m, outlines=outlines)


def _mirrored_junction(junction: model.Junction) -> model.Junction:
    connections = tuple(
        replace(way, lane_links=tuple((-a, -b) for a, b in way.lane_links)) for way in junction.connections
    )
    return replace(junction, connections=connections)
