"""The builder of the maps that are shipped with the package: OpenDRIVE 1.6 files.

Every dimension stands here once, so that a border or a joint of a map can be checked with pencil and paper.
``python -m scenarios.catalogue.map_builder [directory]`` writes all of them again, byte by byte the same.

The reference line is the middle of the street; lanes are mirrored about it and traffic keeps right.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from math import pi
from pathlib import Path

import _smartmot
from opendrive import building, model
from opendrive.building.records import CENTRE, UNMARKED_CENTRE, Lane, lane_record
from opendrive.building.reference_line import ORIGIN, Piece, Pose, end_of, moved, total_length_m, turned
from opendrive.xml.writer import map_bytes
from scenarios.catalogue import maps as shipped

__getattr__ = _smartmot.names_of(__name__, "scenarios.catalogue.maps")

GEO_REFERENCE = "+proj=tmerc +lat_0=52 +lon_0=13 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"
COUNTRY = "DE"
SIGN_CATALOGUE_YEAR = "2017"
SPEED_LIMIT_KMH = 50

STREET_LENGTH_M = 600.0
EURO_NCAP_LENGTH_M = 1500.0
EURO_NCAP_LANE_Y_M = -14.0
"""Where the vehicle under test drives on the 28 m wide unmarked roads of Vector's Euro NCAP scenarios."""
BEND_STRAIGHT_M = 200.0
BEND_SPIRAL_M = 30.0
BEND_RADIUS_M = 60.0
JUNCTION_HALF_M = 12.0
ARM_LENGTH_M = 200.0

CROSSWALK_DEPTH_M = 4.0
CROSSWALK_FROM_STREET_END_M = 40.0
CROSSWALK_FROM_JUNCTION_M = 4.0
STOP_FROM_JUNCTION_M = 7.0
SPEED_SIGN_FROM_END_M = 20.0
CROSSING_SIGN_FROM_CROSSWALK_M = 1.0
SIGN_FROM_KERB_M = 0.5
SIGN_HEIGHT_ABOVE_ROAD_M = 2.2

JUNCTION_ID = "100"

DRIVING = Lane("driving", 3.5, "solid")
PARKING = Lane("parking", 2.0, "solid")
SIDEWALK = Lane("sidewalk", 2.5, "none")

Lanes = tuple[Lane, ...]
_STREET: Lanes = (DRIVING, SIDEWALK)
_STREET_WITH_PARKING: Lanes = (DRIVING, PARKING, SIDEWALK)


@dataclass(frozen=True, slots=True)
class _Sign:
    """A signal of the German catalogue: type and subtype, with the size of its plate or head."""

    name: str
    type: str
    subtype: str = "-1"
    width_m: float = 0.6
    height_m: float = 0.6
    value_kmh: float | None = None
    dynamic: bool = False


_LIMIT = _Sign("speed limit", "274", str(SPEED_LIMIT_KMH), value_kmh=float(SPEED_LIMIT_KMH))
_CROSSING = _Sign("pedestrian crossing", "350", "10")
_LIGHT = _Sign("traffic light", "1000001", width_m=0.3, height_m=0.9, dynamic=True)
_PRIORITY_ROAD = _Sign("priority road", "306")
_STOP = _Sign("stop", "206", width_m=0.9, height_m=0.9)
_GIVE_WAY = _Sign("give way", "205", width_m=0.9, height_m=0.9)


@dataclass(frozen=True, slots=True)
class _Arm:
    """One road of the intersection: where it points seen from the middle, and whether it ends there."""

    name: str
    road_id: str
    bearing_rad: float
    ends_at_junction: bool
    priority: _Sign

    @property
    def inbound(self) -> int:
        """Sign of the lane ids on which traffic comes in; the other side takes it out."""
        return -1 if self.ends_at_junction else 1

    @property
    def link(self) -> model.RoadLink:
        """Link from a road inside the junction to this arm."""
        return model.RoadLink("road", self.road_id, "end" if self.ends_at_junction else "start")

    def entry(self) -> Pose:
        """The reference point at the junction's edge, looking inwards."""
        return turned(Pose(-JUNCTION_HALF_M, 0.0, 0.0), self.bearing_rad - pi)


# Counter-clockwise: from each arm, the next one is reached by a right turn, the third one by a left turn.
_ARMS = (
    _Arm("west", "1", pi, ends_at_junction=True, priority=_PRIORITY_ROAD),
    _Arm("south", "2", 1.5 * pi, ends_at_junction=True, priority=_STOP),
    _Arm("east", "3", 2 * pi, ends_at_junction=False, priority=_PRIORITY_ROAD),
    _Arm("north", "4", 2.5 * pi, ends_at_junction=False, priority=_GIVE_WAY),
)


# ----------------------------------------------------------------------------------------------- records


def _two_way(lanes: Lanes) -> tuple[model.Lane, ...]:
    """The same lanes on both sides of a broken centre mark; overtaking across it is allowed."""
    left, right = ([lane_record(side * k, lane) for k, lane in enumerate(lanes, start=1)] for side in (1, -1))
    return (*reversed(left), lane_record(0, CENTRE), *right)


def width_of(lanes: Lanes) -> float:
    """Width of all lanes of a side; each is as wide everywhere."""
    return sum(float(lane.width_m) for lane in lanes)


def kerb_at_m(lanes: Lanes) -> float:
    """From the middle of a street to its kerb."""
    return width_of(tuple(lane for lane in lanes if lane.kind != "sidewalk"))


def crosswalk_record(crosswalk_id: str, s_m: float, kerb_m: float) -> model.RoadObject:
    """A crosswalk from kerb to kerb, its middle at s."""
    return building.crosswalk(crosswalk_id, s_m, CROSSWALK_DEPTH_M, -kerb_m, kerb_m)


def _signal(signal_id: str, sign: _Sign, s_m: float, side: int, kerb_m: float) -> model.Signal:
    """A sign on the right of the traffic that it is for: lanes whose ids have the sign of `side`."""
    return building.signal(
        signal_id,
        sign.type,
        s_m,
        side * (kerb_m + SIGN_FROM_KERB_M),
        subtype=sign.subtype,
        name=sign.name,
        country=COUNTRY,
        country_revision=SIGN_CATALOGUE_YEAR,
        value=sign.value_kmh,
        unit="" if sign.value_kmh is None else "km/h",
        dynamic=sign.dynamic,
        z_offset_m=SIGN_HEIGHT_ABOVE_ROAD_M,
        width_m=sign.width_m,
        height_m=sign.height_m,
        validity=((side, side),),
    )


def road_record(
    road_id: str,
    name: str,
    start: Pose,
    pieces: Sequence[Piece],
    lanes: tuple[model.Lane, ...],
    *,
    junction_id: str | None = None,
    predecessor: model.RoadLink | None = None,
    successor: model.RoadLink | None = None,
    details: model.RoadDetails | None = None,
) -> model.Road:
    """A flat road in town, with one lane section."""
    return building.road(
        road_id,
        start,
        pieces,
        [model.LaneSection(0.0, single_side=False, lanes=lanes)],
        name=name,
        junction_id=junction_id,
        predecessor=predecessor,
        successor=successor,
        country=COUNTRY,
        speed_mps=SPEED_LIMIT_KMH / 3.6,
        details=details,
    )


def map_record(
    name: str,
    corners: Sequence[tuple[float, float]],
    margin_m: float,
    roads: Sequence[model.Road],
    junctions: Sequence[model.Junction] = (),
) -> model.MapModel:
    """The map; its header's extent is that of `corners` widened by the margin."""
    x_m, y_m = zip(*corners, strict=True)
    extent_m = (min(x_m) - margin_m, min(y_m) - margin_m, max(x_m) + margin_m, max(y_m) + margin_m)
    return building.road_map(name, roads, junctions, geo_reference=GEO_REFERENCE, extent_m=extent_m)


# -------------------------------------------------------------------------------------------------- maps


def street_map(
    name: str, lanes: Lanes, pieces: Sequence[Piece], start: Pose = ORIGIN, *, furnished: bool = False
) -> bytes:
    """An OpenDRIVE file of one road with the same lanes on both sides.

    Args:
        name: of map and road.
        lanes: of each side, from the middle outwards.
        pieces: of the reference line.
        start: of the reference line.
        furnished: with a crosswalk and signs, all near the ends of the street: its middle stays free for
            scenarios.
    """
    details = _furniture(total_length_m(pieces), kerb_at_m(lanes)) if furnished else None
    road = road_record("1", name, start, pieces, _two_way(lanes), details=details)
    *_, end = accumulate(pieces, end_of, initial=start)
    corners = [(start.x_m, start.y_m), (end.x_m, end.y_m)]
    return map_bytes(map_record(name, corners, width_of(lanes), [road]))


def _furniture(length_m: float, kerb_m: float) -> model.RoadDetails:
    """A crosswalk at the end of a street, and for each direction its sign and that of the speed limit."""
    crosswalk_s_m = length_m - CROSSWALK_FROM_STREET_END_M
    signals = []
    for side, number in ((-1, "1"), (1, "2")):
        enters_at_m = SPEED_SIGN_FROM_END_M if side < 0 else length_m - SPEED_SIGN_FROM_END_M
        before_crosswalk_m = crosswalk_s_m + side * (CROSSWALK_DEPTH_M / 2 + CROSSING_SIGN_FROM_CROSSWALK_M)
        signals += [
            _signal(f"{number}1", _LIMIT, enters_at_m, side, kerb_m),
            _signal(f"{number}2", _CROSSING, before_crosswalk_m, side, kerb_m),
        ]
    return model.RoadDetails(signals=tuple(signals), objects=(crosswalk_record("1", crosswalk_s_m, kerb_m),))


def bend_pieces(radius_m: float, spiral_m: float) -> list[Piece]:
    """Straight, a left turn of exactly 90 degrees, straight.

    The clothoids at both ends turn by half of what an arc of their length would.
    """
    curvature = 1 / radius_m
    return [
        Piece(BEND_STRAIGHT_M),
        Piece(spiral_m, 0.0, curvature),
        Piece(radius_m * pi / 2 - spiral_m, curvature, curvature),
        Piece(spiral_m, curvature, 0.0),
        Piece(BEND_STRAIGHT_M),
    ]


def _arm_road(arm: _Arm) -> model.Road:
    """An arm, with its crosswalk, its speed signs for both directions, and what rules its stop line."""
    entry = arm.entry()

    def s_at(from_junction_m: float) -> float:
        return ARM_LENGTH_M - from_junction_m if arm.ends_at_junction else from_junction_m

    kerb_m = kerb_at_m(_STREET)
    signs = (
        (_LIMIT, ARM_LENGTH_M - SPEED_SIGN_FROM_END_M, arm.inbound),
        (_LIMIT, SPEED_SIGN_FROM_END_M, -arm.inbound),
        (_LIGHT, STOP_FROM_JUNCTION_M, arm.inbound),
        (arm.priority, STOP_FROM_JUNCTION_M, arm.inbound),
    )
    signals = tuple(
        _signal(f"{arm.road_id}{k}", sign, s_at(from_junction_m), side, kerb_m)
        for k, (sign, from_junction_m, side) in enumerate(signs, start=1)
    )
    crosswalk = crosswalk_record(arm.road_id, s_at(CROSSWALK_FROM_JUNCTION_M), kerb_m)
    junction = model.RoadLink("junction", JUNCTION_ID, None)
    return road_record(
        arm.road_id,
        f"{arm.name} arm",
        moved(entry, -ARM_LENGTH_M, 0.0, 0.0) if arm.ends_at_junction else moved(entry, 0.0, 0.0, -pi),
        [Piece(ARM_LENGTH_M)],
        _two_way(_STREET),
        predecessor=None if arm.ends_at_junction else junction,
        successor=junction if arm.ends_at_junction else None,
        details=model.RoadDetails(signals=signals, objects=(crosswalk,)),
    )


def _way_through(source: _Arm, target: _Arm, turn: int) -> tuple[model.Road, model.Connection]:
    """The road of one way through the junction, and its connection: turn is -1 right, 0 straight, 1 left.

    Right turns also carry the sidewalk round the corner, and their lanes have marks.
    """
    curvature = turn / JUNCTION_HALF_M
    length_m = JUNCTION_HALF_M * pi / 2 if turn else 2 * JUNCTION_HALF_M
    lanes = _STREET if turn < 0 else (replace(DRIVING, mark="none"),)
    numbered = [*enumerate(lanes, start=1)]
    road = road_record(
        source.road_id + target.road_id,
        f"{source.name} to {target.name}",
        source.entry(),
        [Piece(length_m, curvature, curvature)],
        (
            lane_record(0, UNMARKED_CENTRE),
            *(lane_record(-k, lane, (k * source.inbound,), (-k * target.inbound,)) for k, lane in numbered),
        ),
        junction_id=JUNCTION_ID,
        predecessor=source.link,
        successor=target.link,
    )
    lane_links = tuple((k * source.inbound, -k) for k, _ in numbered)
    return road, model.Connection(road.id, source.road_id, road.id, "start", lane_links)


def _urban_intersection(name: str) -> bytes:
    """Four arms; traffic lights on all of them, and the signs that rule while the lights are off."""
    reach_m = JUNCTION_HALF_M + ARM_LENGTH_M
    ways = [
        _way_through(source, _ARMS[(index + step) % len(_ARMS)], turn)
        for index, source in enumerate(_ARMS)
        for step, turn in ((1, -1), (2, 0), (3, 1))
    ]
    roads = [*map(_arm_road, _ARMS), *(road for road, _ in ways)]
    connections = tuple(connection for _, connection in ways)
    junction = model.Junction(JUNCTION_ID, "crossing", "default", connections)
    corners = [(-reach_m, -reach_m), (reach_m, reach_m)]
    return map_bytes(map_record(name, corners, 0.0, roads, [junction]))


def _street(name: str) -> bytes:
    """One of the maps that are a single street, eastwards at first."""
    lanes, pieces, start = _STREETS[name]
    return street_map(name, lanes, pieces, start, furnished=True)


_STREETS: Mapping[str, tuple[Lanes, Sequence[Piece], Pose]] = {
    "urban_street": (_STREET, [Piece(STREET_LENGTH_M)], ORIGIN),
    "urban_street_parking": (_STREET_WITH_PARKING, [Piece(STREET_LENGTH_M)], ORIGIN),
    "urban_bend": (_STREET, bend_pieces(BEND_RADIUS_M, BEND_SPIRAL_M), ORIGIN),
    # laid over the unmarked Euro NCAP road: its right lane is where the vehicle under test drives
    "euro_ncap_street": (
        _STREET_WITH_PARKING,
        [Piece(EURO_NCAP_LENGTH_M)],
        Pose(0.0, EURO_NCAP_LANE_Y_M + width_of((DRIVING,)) / 2, 0.0),
    ),
}


def build_map(name: str) -> bytes:
    """The OpenDRIVE file of a shipped map, built anew.

    Raises:
        UnknownMapError: No shipped map has this name.
    """
    return _street(name) if name in _STREETS else _urban_intersection(shipped.shipped_map(name).stem)


def write_maps(directory: Path, maps: Mapping[str, bytes]) -> None:
    """Write maps by their names into a directory, which is made if it is missing."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, content in maps.items():
        (directory / f"{name}.xodr").write_bytes(content)


if __name__ == "__main__":
    write_maps(
        Path(sys.argv[1]) if len(sys.argv) > 1 else shipped.MAPS,
        {name: build_map(name) for name in shipped.SHIPPED_MAPS},
    )
