"""Maps shipped with the package, and the builder that writes them as OpenDRIVE 1.6 files.

Every dimension stands here once, so that a border or a joint of a map can be checked with pencil and paper.
``python -m scenarios.catalogue.map_builder [directory]`` writes all of them again, byte by byte the same.

The reference line is the middle of the street; lanes are mirrored about it and traffic keeps right.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from math import cos, factorial, pi, sin
from pathlib import Path
from types import MappingProxyType

from lxml import etree

import _smartmot
from scenarios.catalogue.maps import MAPS, SHIPPED_MAPS, shipped_map

__getattr__ = _smartmot.names_of(__name__, "scenarios.catalogue.maps")

DRIVING_WIDTH_M = 3.5
PARKING_WIDTH_M = 2.0
SIDEWALK_WIDTH_M = 2.5
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
SIGN_FROM_KERB_M = 0.5

JUNCTION_ID = "100"

_GEO_REFERENCE = "+proj=tmerc +lat_0=52 +lon_0=13 +k=1 +x_0=0 +y_0=0 +datum=WGS84 +units=m +no_defs"


@dataclass(frozen=True, slots=True)
class _Pose:
    x_m: float
    y_m: float
    yaw_rad: float


_ORIGIN = _Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of reference line whose curvature runs linearly from start to end."""

    length_m: float
    curvature_start: float = 0.0
    curvature_end: float = 0.0


@dataclass(frozen=True, slots=True)
class Lane:
    """A lane and the mark on its outer border."""

    kind: str
    width_m: float
    mark: str


DRIVING = Lane("driving", DRIVING_WIDTH_M, "solid")
PARKING = Lane("parking", PARKING_WIDTH_M, "solid")
SIDEWALK = Lane("sidewalk", SIDEWALK_WIDTH_M, "none")

Lanes = tuple[Lane, ...]
_STREET: Lanes = (DRIVING, SIDEWALK)
_STREET_WITH_PARKING: Lanes = (DRIVING, PARKING, SIDEWALK)


@dataclass(frozen=True, slots=True)
class _Arm:
    """One road of the intersection: where it points seen from the middle, and whether it ends there."""

    name: str
    road_id: str
    bearing_rad: float
    ends_at_junction: bool
    priority_sign: str

    @property
    def inbound(self) -> int:
        """Sign of the lane ids on which traffic comes in; the other side takes it out."""
        return -1 if self.ends_at_junction else 1

    def as_neighbour(self) -> dict[str, str]:
        """Attributes of a link from a road inside the junction to this arm."""
        contact = "end" if self.ends_at_junction else "start"
        return {"elementType": "road", "elementId": self.road_id, "contactPoint": contact}

    def entry(self) -> _Pose:
        """The reference point at the junction's edge, looking inwards."""
        return _turned(_Pose(-JUNCTION_HALF_M, 0.0, 0.0), self.bearing_rad - pi)


# Counter-clockwise: from each arm, the next one is reached by a right turn, the third one by a left turn.
_ARMS = (
    _Arm("west", "1", pi, ends_at_junction=True, priority_sign="306"),
    _Arm("south", "2", 1.5 * pi, ends_at_junction=True, priority_sign="206"),
    _Arm("east", "3", 2 * pi, ends_at_junction=False, priority_sign="306"),
    _Arm("north", "4", 2.5 * pi, ends_at_junction=False, priority_sign="205"),
)


# ---------------------------------------------------------------------------------------------- geometry


def _turned(pose: _Pose, by_rad: float) -> _Pose:
    """The pose turned about the origin; coordinates are snapped to 1e-10 m so that files do not vary."""
    c, s = cos(by_rad), sin(by_rad)
    return _Pose(
        round(c * pose.x_m - s * pose.y_m, 10), round(s * pose.x_m + c * pose.y_m, 10), pose.yaw_rad + by_rad
    )


def _moved(start: _Pose, x_m: float, y_m: float, turn_rad: float) -> _Pose:
    """The pose reached by a step given in the frame of `start`."""
    step = _turned(_Pose(x_m, y_m, turn_rad), start.yaw_rad)
    return _Pose(round(start.x_m + step.x_m, 10), round(start.y_m + step.y_m, 10), step.yaw_rad)


def _clothoid(length_m: float, turn_rad: float) -> tuple[float, float]:
    """End of a clothoid that starts straight along x and turns by `turn_rad`: series of its integrals."""
    x_m = sum((-1) ** n * turn_rad ** (2 * n) / (factorial(2 * n) * (4 * n + 1)) for n in range(10))
    y_m = sum((-1) ** n * turn_rad ** (2 * n + 1) / (factorial(2 * n + 1) * (4 * n + 3)) for n in range(10))
    return length_m * x_m, length_m * y_m


def _end(start: _Pose, piece: Piece) -> _Pose:
    """Pose at the end of a line, an arc, or a clothoid with one straight end."""
    length_m, k_start, k_end = piece.length_m, piece.curvature_start, piece.curvature_end
    turn_rad = length_m * (k_start + k_end) / 2
    if k_start == k_end == 0:
        return _moved(start, length_m, 0.0, 0.0)
    if k_start == k_end:
        return _moved(start, sin(turn_rad) / k_start, (1 - cos(turn_rad)) / k_start, turn_rad)
    along_m, aside_m = _clothoid(length_m, turn_rad)
    if k_start == 0:
        return _moved(start, along_m, aside_m, turn_rad)
    # Straightening out is winding up seen from the end, so the step is known in the end's frame.
    turned = _Pose(start.x_m, start.y_m, start.yaw_rad + turn_rad)
    return _moved(turned, along_m, -aside_m, 0.0)


# --------------------------------------------------------------------------------------------------- XML


def _number(value: float) -> str:
    return f"{value + 0.0:.15g}"


def _add(parent: etree._Element, tag: str, **attributes: str | float) -> etree._Element:
    texts = {key: value if isinstance(value, str) else _number(value) for key, value in attributes.items()}
    return etree.SubElement(parent, tag, texts)


def _document(name: str, corners: Sequence[tuple[float, float]], margin_m: float) -> etree._Element:
    """An OpenDRIVE element with its header; the extent is that of `corners` widened by the margin."""
    root = etree.Element("OpenDRIVE")
    header = _add(
        root,
        "header",
        revMajor="1",
        revMinor="6",
        name=name,
        version="1",
        north=max(y for _, y in corners) + margin_m,
        south=min(y for _, y in corners) - margin_m,
        east=max(x for x, _ in corners) + margin_m,
        west=min(x for x, _ in corners) - margin_m,
        vendor="smartmot",
    )
    _add(header, "geoReference").text = etree.CDATA(_GEO_REFERENCE)
    return root


def _road(
    root: etree._Element,
    road_id: str,
    name: str,
    pieces: Sequence[Piece],
    junction: str = "-1",
    neighbours: Mapping[str, Mapping[str, str]] = MappingProxyType({}),
) -> etree._Element:
    """A road up to its type; `neighbours` holds the attributes of its predecessor and its successor."""
    length_m = sum(piece.length_m for piece in pieces)
    road = _add(root, "road", name=name, length=length_m, id=road_id, junction=junction, rule="RHT")
    link = _add(road, "link")
    for end, attributes in neighbours.items():
        _add(link, end, **attributes)
    kind = _add(road, "type", s="0", type="town", country="DE")
    _add(kind, "speed", max=SPEED_LIMIT_KMH, unit="km/h")
    return road


def _plan_view(road: etree._Element, start: _Pose, pieces: Sequence[Piece]) -> _Pose:
    """Write the reference line and return the pose at its end."""
    plan, pose, s_m = _add(road, "planView"), start, 0.0
    for piece in pieces:
        geometry = _add(
            plan, "geometry", s=s_m, x=pose.x_m, y=pose.y_m, hdg=pose.yaw_rad, length=piece.length_m
        )
        if piece.curvature_start != piece.curvature_end:
            _add(geometry, "spiral", curvStart=piece.curvature_start, curvEnd=piece.curvature_end)
        elif piece.curvature_start:
            _add(geometry, "arc", curvature=piece.curvature_start)
        else:
            _add(geometry, "line")
        pose, s_m = _end(pose, piece), s_m + piece.length_m
    return pose


def _mark(lane: etree._Element, kind: str, lane_change: str) -> None:
    width = {} if kind == "none" else {"width": "0.12"}
    _add(
        lane,
        "roadMark",
        sOffset="0",
        type=kind,
        weight="standard",
        color="standard",
        **width,
        laneChange=lane_change,
    )


def _lane(
    side: etree._Element, lane_id: int, lane: Lane, links: tuple[int, int] | None = None, mark: str = ""
) -> None:
    element = _add(side, "lane", id=lane_id, type=lane.kind, level="false")
    if links is not None:
        link = _add(element, "link")
        _add(link, "predecessor", id=links[0])
        _add(link, "successor", id=links[1])
    _add(element, "width", sOffset="0", a=lane.width_m, b="0", c="0", d="0")
    _mark(element, mark or lane.mark, "none")


def _two_way(road: etree._Element, lanes: Lanes) -> None:
    """The same lanes on both sides of a broken centre mark; overtaking across it is allowed."""
    section = _add(_add(road, "lanes"), "laneSection", s="0")
    left, center, right = (_add(section, side) for side in ("left", "center", "right"))
    for number in range(len(lanes), 0, -1):
        _lane(left, number, lanes[number - 1])
    _mark(_add(center, "lane", id="0", type="none", level="false"), "broken", "both")
    for number, lane in enumerate(lanes, start=1):
        _lane(right, -number, lane)


def _kerb_m(lanes: Lanes) -> float:
    return sum(lane.width_m for lane in lanes if lane.kind != "sidewalk")


def _half_width_m(lanes: Lanes) -> float:
    return sum(lane.width_m for lane in lanes)


def _crosswalk(road: etree._Element, object_id: str, s_m: float, kerb_m: float) -> None:
    """A crosswalk from kerb to kerb, its middle at s, its corners counter-clockwise."""
    crosswalk = _add(
        _add(road, "objects"),
        "object",
        id=object_id,
        name="crosswalk",
        type="crosswalk",
        s=s_m,
        t="0",
        zOffset="0",
        orientation="none",
        hdg="0",
        length=CROSSWALK_DEPTH_M,
        width=2 * kerb_m,
        height="0",
    )
    outline = _add(
        _add(crosswalk, "outlines"), "outline", id="0", fillType="paint", outer="true", closed="true"
    )
    half_m = CROSSWALK_DEPTH_M / 2
    corners = ((-half_m, -kerb_m), (half_m, -kerb_m), (half_m, kerb_m), (-half_m, kerb_m))
    for number, (ahead_m, t_m) in enumerate(corners):
        _add(outline, "cornerRoad", id=number, s=s_m + ahead_m, t=t_m, dz="0", height="0")


@dataclass(frozen=True, slots=True)
class _Sign:
    """A signal of the German catalogue: type and subtype, with the size of its plate or head."""

    name: str
    kind: str
    subtype: str = "-1"
    width_m: float = 0.6
    height_m: float = 0.6


_SPEED_LIMIT = _Sign("speed limit", "274", str(SPEED_LIMIT_KMH))
_CROSSING = _Sign("pedestrian crossing", "350", "10")
_TRAFFIC_LIGHT = _Sign("traffic light", "1000001", width_m=0.3, height_m=0.9)
_PRIORITY_SIGNS = {
    "205": _Sign("give way", "205", width_m=0.9, height_m=0.9),
    "206": _Sign("stop", "206", width_m=0.9, height_m=0.9),
    "306": _Sign("priority road", "306"),
}


def _signal(
    signals: etree._Element, signal_id: str, sign: _Sign, s_m: float, traffic_side: int, kerb_m: float
) -> None:
    """A signal on the right of the traffic it is for: lanes with ids of `traffic_side`'s sign."""
    is_light, is_limit = sign is _TRAFFIC_LIGHT, sign is _SPEED_LIMIT
    limit: dict[str, str | float] = {"value": SPEED_LIMIT_KMH, "unit": "km/h"} if is_limit else {}
    signal = _add(
        signals,
        "signal",
        id=signal_id,
        name=sign.name,
        s=s_m,
        t=traffic_side * (kerb_m + SIGN_FROM_KERB_M),
        zOffset="2.2",
        orientation="+" if traffic_side < 0 else "-",
        dynamic="yes" if is_light else "no",
        country="DE",
        countryRevision="2017",
        type=sign.kind,
        subtype=sign.subtype,
        **limit,
        width=sign.width_m,
        height=sign.height_m,
        hOffset="0",
        pitch="0",
        roll="0",
    )
    _add(signal, "validity", fromLane=traffic_side, toLane=traffic_side)


# -------------------------------------------------------------------------------------------------- maps


def _furniture(road: etree._Element, length_m: float, kerb_m: float) -> None:
    """Crosswalk and signs, all near the ends of the street: its middle stays free for scenarios."""
    s_m = length_m - CROSSWALK_FROM_STREET_END_M
    _crosswalk(road, "1", s_m, kerb_m)
    signals = _add(road, "signals")
    for side, number in ((-1, "1"), (1, "2")):
        enters_at_m = SPEED_SIGN_FROM_END_M if side < 0 else length_m - SPEED_SIGN_FROM_END_M
        _signal(signals, f"{number}1", _SPEED_LIMIT, enters_at_m, side, kerb_m)
        before_crosswalk_m = s_m + side * (CROSSWALK_DEPTH_M / 2 + 1.0)
        _signal(signals, f"{number}2", _CROSSING, before_crosswalk_m, side, kerb_m)


def _single_street(
    name: str, lanes: Lanes, pieces: Sequence[Piece], start: _Pose = _ORIGIN
) -> etree._Element:
    """One road, eastwards at first."""
    end = start
    for piece in pieces:
        end = _end(end, piece)
    root = _document(name, [(start.x_m, start.y_m), (end.x_m, end.y_m)], _half_width_m(lanes))
    road = _road(root, "1", name, pieces)
    _plan_view(road, start, pieces)
    _two_way(road, lanes)
    _furniture(road, sum(piece.length_m for piece in pieces), _kerb_m(lanes))
    return root


def street_map(name: str, lanes: Lanes, pieces: Sequence[Piece]) -> bytes:
    """An OpenDRIVE file of one road with the same lanes on both sides; a broken mark may be crossed.

    Args:
        name: of map and road.
        lanes: of each side, from the middle outwards.
        pieces: of the reference line, from the origin along x.
    """
    end = _ORIGIN
    for piece in pieces:
        end = _end(end, piece)
    root = _document(name, [(0.0, 0.0), (end.x_m, end.y_m)], _half_width_m(lanes))
    road = _road(root, "1", name, pieces)
    _plan_view(road, _ORIGIN, pieces)
    _two_way(road, lanes)
    for mark in road.iter("roadMark"):
        if mark.get("type") == "broken":
            mark.set("laneChange", "both")
    return etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8")


def _urban_street() -> etree._Element:
    return _single_street("urban_street", _STREET, [Piece(STREET_LENGTH_M)])


def _urban_street_parking() -> etree._Element:
    return _single_street("urban_street_parking", _STREET_WITH_PARKING, [Piece(STREET_LENGTH_M)])


def _euro_ncap_street() -> etree._Element:
    """Laid over the unmarked Euro NCAP road: its right lane is where the vehicle under test drives."""
    start = _Pose(0.0, EURO_NCAP_LANE_Y_M + DRIVING_WIDTH_M / 2, 0.0)
    return _single_street("euro_ncap_street", _STREET_WITH_PARKING, [Piece(EURO_NCAP_LENGTH_M)], start)


def _urban_bend() -> etree._Element:
    """A left bend of exactly 90 degrees; the clothoids turn by half of what an arc of their length would."""
    curvature = 1 / BEND_RADIUS_M
    arc_m = BEND_RADIUS_M * pi / 2 - BEND_SPIRAL_M
    pieces = [
        Piece(BEND_STRAIGHT_M),
        Piece(BEND_SPIRAL_M, 0.0, curvature),
        Piece(arc_m, curvature, curvature),
        Piece(BEND_SPIRAL_M, curvature, 0.0),
        Piece(BEND_STRAIGHT_M),
    ]
    return _single_street("urban_bend", _STREET, pieces)


def _arm_road(root: etree._Element, arm: _Arm) -> None:
    """An arm, with its crosswalk, its speed signs for both directions, and what rules its stop line."""
    entry, pieces = arm.entry(), [Piece(ARM_LENGTH_M)]
    near_end = "successor" if arm.ends_at_junction else "predecessor"
    junction = {"elementType": "junction", "elementId": JUNCTION_ID}
    road = _road(root, arm.road_id, f"{arm.name} arm", pieces, neighbours={near_end: junction})
    outer = _moved(entry, -ARM_LENGTH_M, 0.0, 0.0)
    _plan_view(road, outer if arm.ends_at_junction else _moved(entry, 0.0, 0.0, -pi), pieces)
    _two_way(road, _STREET)

    def s_at(from_junction_m: float) -> float:
        return ARM_LENGTH_M - from_junction_m if arm.ends_at_junction else from_junction_m

    kerb_m, number = _kerb_m(_STREET), arm.road_id
    _crosswalk(road, number, s_at(CROSSWALK_FROM_JUNCTION_M), kerb_m)
    signals = _add(road, "signals")
    far_m = ARM_LENGTH_M - SPEED_SIGN_FROM_END_M
    _signal(signals, f"{number}1", _SPEED_LIMIT, s_at(far_m), arm.inbound, kerb_m)
    _signal(signals, f"{number}2", _SPEED_LIMIT, s_at(SPEED_SIGN_FROM_END_M), -arm.inbound, kerb_m)
    _signal(signals, f"{number}3", _TRAFFIC_LIGHT, s_at(STOP_FROM_JUNCTION_M), arm.inbound, kerb_m)
    sign = _PRIORITY_SIGNS[arm.priority_sign]
    _signal(signals, f"{number}4", sign, s_at(STOP_FROM_JUNCTION_M), arm.inbound, kerb_m)


def _connecting_road(root: etree._Element, source: _Arm, target: _Arm, turn: int) -> Lanes:
    """One way through the junction: turn is -1 right, 0 straight, 1 left. Returns its lanes.

    Right turns also carry the sidewalk round the corner.
    """
    curvature = turn / JUNCTION_HALF_M
    length_m = JUNCTION_HALF_M * pi / 2 if turn else 2 * JUNCTION_HALF_M
    pieces = [Piece(length_m, curvature, curvature)]
    road_id = source.road_id + target.road_id
    neighbours = {"predecessor": source.as_neighbour(), "successor": target.as_neighbour()}
    road = _road(root, road_id, f"{source.name} to {target.name}", pieces, JUNCTION_ID, neighbours)
    _plan_view(road, source.entry(), pieces)
    section = _add(_add(road, "lanes"), "laneSection", s="0")
    _mark(_add(_add(section, "center"), "lane", id="0", type="none", level="false"), "none", "none")
    right = _add(section, "right")
    lanes = _STREET if turn < 0 else (DRIVING,)
    for number, lane in enumerate(lanes, start=1):
        links = (number * source.inbound, -number * target.inbound)
        _lane(right, -number, lane, links, mark="" if turn < 0 else "none")
    return lanes


def _urban_intersection() -> etree._Element:
    """Four arms; traffic lights on all of them, and the signs that rule while the lights are off."""
    reach_m = JUNCTION_HALF_M + ARM_LENGTH_M
    root = _document("urban_intersection", [(-reach_m, -reach_m), (reach_m, reach_m)], 0.0)
    for arm in _ARMS:
        _arm_road(root, arm)
    junction = etree.Element("junction", {"id": JUNCTION_ID, "name": "crossing", "type": "default"})
    for index, source in enumerate(_ARMS):
        for step, turn in ((1, -1), (2, 0), (3, 1)):
            target = _ARMS[(index + step) % len(_ARMS)]
            lanes = _connecting_road(root, source, target, turn)
            connection = _add(
                junction,
                "connection",
                id=source.road_id + target.road_id,
                incomingRoad=source.road_id,
                connectingRoad=source.road_id + target.road_id,
                contactPoint="start",
            )
            for number in range(1, len(lanes) + 1):
                _add(connection, "laneLink", **{"from": number * source.inbound, "to": -number})
    root.append(junction)
    return root


_BUILDERS: dict[str, Callable[[], etree._Element]] = {
    "urban_street": _urban_street,
    "urban_street_parking": _urban_street_parking,
    "urban_bend": _urban_bend,
    "euro_ncap_street": _euro_ncap_street,
    "urban_intersection": _urban_intersection,
}


def build_map(name: str) -> bytes:
    """The OpenDRIVE file of a shipped map, built anew.

    Raises:
        UnknownMapError: No shipped map has this name.
    """
    shipped_map(name)
    root = _BUILDERS[name]()
    return etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8")


def write_maps(directory: Path = MAPS) -> None:
    """Write every shipped map into a directory, which is made if it is missing."""
    directory.mkdir(parents=True, exist_ok=True)
    for name in SHIPPED_MAPS:
        (directory / f"{name}.xodr").write_bytes(build_map(name))


if __name__ == "__main__":
    write_maps(*map(Path, sys.argv[1:2]))
