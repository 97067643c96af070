"""The builder of the maps that are shipped with the package: OpenDRIVE 1.6 files.

Every dimension stands here once, so that a border or a joint of a map can be checked with pencil and paper;
`map.xodr.j2` has the elements and attributes. The files are not what `opendrive.write_map` makes of a model:
results are known by the hash of their map, which must not change with that writer.
``python -m scenarios.catalogue.map_builder [directory]`` writes all of them again, byte by byte the same.

The reference line is the middle of the street; lanes are mirrored about it and traffic keeps right.
"""

from __future__ import annotations

import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import accumulate
from math import cos, pi, sin
from pathlib import Path

import jinja2
import numpy as np

import _smartmot
from opendrive.geometry.curves import clothoid
from scenarios.catalogue import maps as shipped

__getattr__ = _smartmot.names_of(__name__, "scenarios.catalogue.maps")

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


@dataclass(frozen=True, slots=True)
class Pose:
    """A point of the reference line, map frame, and its heading."""

    x_m: float
    y_m: float
    yaw_rad: float


ORIGIN = Pose(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Piece:
    """A piece of reference line whose curvature runs linearly from start to end."""

    length_m: float
    curvature_start: float = 0.0
    curvature_end: float = 0.0


@dataclass(frozen=True, slots=True)
class Lane:
    """A lane and the mark on its outer border; a broken one may be crossed, both ways."""

    kind: str
    width_m: float
    mark: str


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
    value: int | None = None
    dynamic: bool = False


_LIMIT = _Sign("speed limit", "274", str(SPEED_LIMIT_KMH), value=SPEED_LIMIT_KMH)
_CROSSING = _Sign("pedestrian crossing", "350", "10")
_LIGHT = _Sign("traffic light", "1000001", width_m=0.3, height_m=0.9, dynamic=True)
_PRIORITY_ROAD = _Sign("priority road", "306")
_STOP = _Sign("stop", "206", width_m=0.9, height_m=0.9)
_GIVE_WAY = _Sign("give way", "205", width_m=0.9, height_m=0.9)


@dataclass(frozen=True, slots=True)
class _Signal:
    """A sign on the right of the traffic that it is for: lanes whose ids have the sign of `side`."""

    id: str
    sign: _Sign
    s_m: float
    side: int
    kerb_m: float

    @property
    def t_m(self) -> float:
        return self.side * (self.kerb_m + SIGN_FROM_KERB_M)


@dataclass(frozen=True, slots=True)
class _Crosswalk:
    """A crosswalk from kerb to kerb, its middle at s."""

    id: str
    s_m: float
    kerb_m: float
    depth_m: float = CROSSWALK_DEPTH_M

    @property
    def corners(self) -> list[tuple[float, float]]:
        """(s, t), counter-clockwise."""
        half_m = self.depth_m / 2
        signs = ((-1, -1), (1, -1), (1, 1), (-1, 1))
        return [(self.s_m + along * half_m, aside * self.kerb_m) for along, aside in signs]


@dataclass(frozen=True, slots=True)
class _LaneOfRoad:
    """A lane with its id, and the lanes before and behind it where it lies in the junction."""

    id: int
    type: str
    width_m: float
    mark: str
    predecessor: int | None = None
    successor: int | None = None


@dataclass(frozen=True, slots=True)
class _Link:
    """What a road's predecessor or successor is."""

    end: str
    type: str
    id: str
    contact: str = ""


@dataclass(frozen=True, slots=True)
class _Road:
    id: str
    name: str
    start: Pose
    pieces: Sequence[Piece]
    sides: Mapping[str, Sequence[_LaneOfRoad]]
    junction_id: str = "-1"
    links: Sequence[_Link] = ()
    crosswalk: _Crosswalk | None = None
    signals: Sequence[_Signal] = ()

    @property
    def length_m(self) -> float:
        return sum(piece.length_m for piece in self.pieces)

    @property
    def geometries(self) -> list[tuple[float, Pose, Piece]]:
        """S and pose of the start of each piece."""
        s_m = accumulate((piece.length_m for piece in self.pieces), initial=0.0)
        poses = accumulate(self.pieces, _end, initial=self.start)
        return [*zip(s_m, poses, self.pieces, strict=False)]


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

    def link(self, end: str) -> _Link:
        """Link from a road inside the junction to this arm."""
        return _Link(end, "road", self.road_id, "end" if self.ends_at_junction else "start")

    def entry(self) -> Pose:
        """The reference point at the junction's edge, looking inwards."""
        return _turned(Pose(-JUNCTION_HALF_M, 0.0, 0.0), self.bearing_rad - pi)


# Counter-clockwise: from each arm, the next one is reached by a right turn, the third one by a left turn.
_ARMS = (
    _Arm("west", "1", pi, ends_at_junction=True, priority=_PRIORITY_ROAD),
    _Arm("south", "2", 1.5 * pi, ends_at_junction=True, priority=_STOP),
    _Arm("east", "3", 2 * pi, ends_at_junction=False, priority=_PRIORITY_ROAD),
    _Arm("north", "4", 2.5 * pi, ends_at_junction=False, priority=_GIVE_WAY),
)


# ---------------------------------------------------------------------------------------------- geometry


def _turned(pose: Pose, by_rad: float) -> Pose:
    """The pose turned about the origin; coordinates are snapped to 1e-10 m so that files do not vary."""
    c, s = cos(by_rad), sin(by_rad)
    return Pose(
        round(c * pose.x_m - s * pose.y_m, 10), round(s * pose.x_m + c * pose.y_m, 10), pose.yaw_rad + by_rad
    )


def _moved(start: Pose, x_m: float, y_m: float, turn_rad: float) -> Pose:
    """The pose reached by a step given in the frame of `start`."""
    step = _turned(Pose(x_m, y_m, turn_rad), start.yaw_rad)
    return Pose(round(start.x_m + step.x_m, 10), round(start.y_m + step.y_m, 10), step.yaw_rad)


def _end(start: Pose, piece: Piece) -> Pose:
    """Pose at the end of a line, an arc or a clothoid."""
    length_m, k_start, k_end = piece.length_m, piece.curvature_start, piece.curvature_end
    rate = (k_end - k_start) / length_m
    along_m, aside_m = (float(step[0]) for step in clothoid(*np.array([[length_m], [k_start], [rate]])))
    return _moved(start, along_m, aside_m, length_m * (k_start + k_end) / 2)


# ------------------------------------------------------------------------------------------------- texts


def _number(value: float) -> str:
    return f"{value + 0.0:.15g}"  # without the sign of a negative zero


def _text(
    name: str, corners: Sequence[tuple[float, float]], margin_m: float, roads: Sequence[_Road], **more: object
) -> bytes:
    """The file; its header's extent is that of `corners` widened by the margin."""
    environment = jinja2.Environment(
        loader=jinja2.FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters["number"] = _number
    x_m, y_m = zip(*corners, strict=True)
    text = environment.get_template("map.xodr.j2").render(
        name=name,
        north_m=max(y_m) + margin_m,
        south_m=min(y_m) - margin_m,
        east_m=max(x_m) + margin_m,
        west_m=min(x_m) - margin_m,
        limit_kmh=SPEED_LIMIT_KMH,
        junction_id=JUNCTION_ID,
        roads=roads,
        **more,
    )
    return text.encode()


def _two_way(lanes: Lanes) -> dict[str, list[_LaneOfRoad]]:
    """The same lanes on both sides of a broken centre mark; overtaking across it is allowed."""
    left, right = (
        [_LaneOfRoad(side * k, lane.kind, lane.width_m, lane.mark) for k, lane in enumerate(lanes, start=1)]
        for side in (1, -1)
    )
    return {"left": left[::-1], "center": [_LaneOfRoad(0, "none", 0.0, "broken")], "right": right}


def _kerb_m(lanes: Lanes) -> float:
    return sum(lane.width_m for lane in lanes if lane.kind != "sidewalk")


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
    road = _Road("1", name, start, pieces, _two_way(lanes))
    if furnished:
        road = _furnished(road, _kerb_m(lanes))
    *_, end = accumulate(pieces, _end, initial=start)
    corners = [(start.x_m, start.y_m), (end.x_m, end.y_m)]
    return _text(name, corners, sum(lane.width_m for lane in lanes), [road])


def _furnished(road: _Road, kerb_m: float) -> _Road:
    crosswalk = _Crosswalk("1", road.length_m - CROSSWALK_FROM_STREET_END_M, kerb_m)
    signals = []
    for side, number in ((-1, "1"), (1, "2")):
        enters_at_m = SPEED_SIGN_FROM_END_M if side < 0 else road.length_m - SPEED_SIGN_FROM_END_M
        before_crosswalk_m = crosswalk.s_m + side * (CROSSWALK_DEPTH_M / 2 + 1.0)
        signals += [
            _Signal(f"{number}1", _LIMIT, enters_at_m, side, kerb_m),
            _Signal(f"{number}2", _CROSSING, before_crosswalk_m, side, kerb_m),
        ]
    return replace(road, crosswalk=crosswalk, signals=signals)


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


def _arm_road(arm: _Arm) -> _Road:
    """An arm, with its crosswalk, its speed signs for both directions, and what rules its stop line."""
    entry = arm.entry()

    def s_at(from_junction_m: float) -> float:
        return ARM_LENGTH_M - from_junction_m if arm.ends_at_junction else from_junction_m

    kerb_m = _kerb_m(_STREET)
    signs = (
        (_LIMIT, ARM_LENGTH_M - SPEED_SIGN_FROM_END_M, arm.inbound),
        (_LIMIT, SPEED_SIGN_FROM_END_M, -arm.inbound),
        (_LIGHT, STOP_FROM_JUNCTION_M, arm.inbound),
        (arm.priority, STOP_FROM_JUNCTION_M, arm.inbound),
    )
    return _Road(
        arm.road_id,
        f"{arm.name} arm",
        _moved(entry, -ARM_LENGTH_M, 0.0, 0.0) if arm.ends_at_junction else _moved(entry, 0.0, 0.0, -pi),
        [Piece(ARM_LENGTH_M)],
        _two_way(_STREET),
        links=[_Link("successor" if arm.ends_at_junction else "predecessor", "junction", JUNCTION_ID)],
        crosswalk=_Crosswalk(arm.road_id, s_at(CROSSWALK_FROM_JUNCTION_M), kerb_m),
        signals=[
            _Signal(f"{arm.road_id}{k}", sign, s_at(from_junction_m), side, kerb_m)
            for k, (sign, from_junction_m, side) in enumerate(signs, start=1)
        ],
    )


def _connecting_road(source: _Arm, target: _Arm, turn: int) -> _Road:
    """One way through the junction: turn is -1 right, 0 straight, 1 left.

    Right turns also carry the sidewalk round the corner, and their lanes have marks.
    """
    curvature = turn / JUNCTION_HALF_M
    length_m = JUNCTION_HALF_M * pi / 2 if turn else 2 * JUNCTION_HALF_M
    lanes = [
        _LaneOfRoad(
            -number,
            lane.kind,
            lane.width_m,
            lane.mark if turn < 0 else "none",
            predecessor=number * source.inbound,
            successor=-number * target.inbound,
        )
        for number, lane in enumerate(_STREET if turn < 0 else (DRIVING,), start=1)
    ]
    return _Road(
        source.road_id + target.road_id,
        f"{source.name} to {target.name}",
        source.entry(),
        [Piece(length_m, curvature, curvature)],
        {"center": [_LaneOfRoad(0, "none", 0.0, "none")], "right": lanes},
        JUNCTION_ID,
        [source.link("predecessor"), target.link("successor")],
    )


def _urban_intersection(name: str) -> bytes:
    """Four arms; traffic lights on all of them, and the signs that rule while the lights are off."""
    reach_m = JUNCTION_HALF_M + ARM_LENGTH_M
    arms = [_arm_road(arm) for arm in _ARMS]
    inside = [
        _connecting_road(source, _ARMS[(index + step) % len(_ARMS)], turn)
        for index, source in enumerate(_ARMS)
        for step, turn in ((1, -1), (2, 0), (3, 1))
    ]
    corners = [(-reach_m, -reach_m), (reach_m, reach_m)]
    return _text(name, corners, 0.0, [*arms, *inside], connections=inside)


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
        Pose(0.0, EURO_NCAP_LANE_Y_M + DRIVING.width_m / 2, 0.0),
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
