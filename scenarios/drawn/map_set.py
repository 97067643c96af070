"""Maps for drawn scenes: streets and junctions of differing kinds, some for training and others for tests.

They are made like the shipped maps (`scenarios.catalogue.map_builder`). ``python -m scenarios.drawn.map_set``
writes all of them again, byte by byte the same. Which of them are for which split stands in
`distributions.toml`.

Widths are those of the German guideline for urban streets, RASt 06 (FGSV, 2006): carriageways of 6.0 to
6.5 m, parking strips of 2.0 m, sidewalks of 2.5 m, cycle lanes of 1.85 m, medians of 2.0 m and more.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import accumulate
from math import radians
from pathlib import Path

from opendrive import model
from opendrive.building.records import CENTRE, UNMARKED_CENTRE, Lane, lane_record
from opendrive.building.reference_line import ORIGIN, Piece, end_of, total_length_m
from opendrive.xml.writer import map_bytes
from scenarios.catalogue.map_builder import (
    Lanes,
    crosswalk_record,
    kerb_at_m,
    map_record,
    road_record,
    width_of,
    write_maps,
)
from scenarios.drawn.junctions import Arm, crossing_map, mirrored, roundabout_map

MAPS = Path(__file__).parent / "maps"

DRIVING = Lane("driving", 3.25, "solid")
NARROW = Lane("driving", 3.0, "solid")
INNER = Lane("driving", 3.25, "broken")
COUNTRY = Lane("driving", 3.5, "solid")
PARKING = Lane("parking", 2.0, "solid")
CYCLE = Lane("biking", 1.85, "solid")
SIDEWALK = Lane("sidewalk", 2.5, "none")
WIDE_SIDEWALK = Lane("sidewalk", 4.0, "none")
VERGE = Lane("shoulder", 0.5, "none")
HALF_MEDIAN = Lane("median", 1.25, "solid")

STREET_M = 500.0
ARM_M = 130.0

STREET: Lanes = (DRIVING, SIDEWALK)
PARKING_STREET: Lanes = (DRIVING, PARKING, SIDEWALK)
NARROW_PARKING_STREET: Lanes = (NARROW, PARKING, WIDE_SIDEWALK)
CYCLE_STREET: Lanes = (DRIVING, CYCLE, WIDE_SIDEWALK)
COUNTRY_ROAD: Lanes = (COUNTRY, VERGE)
DUAL: Lanes = (HALF_MEDIAN, INNER, DRIVING, SIDEWALK)
ONE_WAY: Lanes = (INNER, DRIVING, PARKING, SIDEWALK)
ONE_WAY_OTHER_SIDE: Lanes = (PARKING, SIDEWALK)


def bends(straight_m: float, turns: Sequence[tuple[float, float]], spiral_m: float = 20.0) -> list[Piece]:
    """Straights joined by bends with clothoids at both ends.

    Args:
        straight_m: length of each straight.
        turns: radius and angle in degrees of each bend; left positive.
        spiral_m: length of each clothoid. Two of them turn as far as an arc of the length of one.
    """
    pieces = [Piece(straight_m)]
    for radius_m, angle_deg in turns:
        curvature = (1.0 if angle_deg > 0.0 else -1.0) / radius_m
        arc_m = radius_m * abs(radians(angle_deg)) - spiral_m
        pieces += [
            Piece(spiral_m, 0.0, curvature),
            Piece(arc_m, curvature, curvature),
            Piece(spiral_m, curvature, 0.0),
            Piece(straight_m),
        ]
    return pieces


def street(
    name: str,
    right: Lanes,
    pieces: Sequence[Piece],
    left: Lanes | None = None,
    centre: Lane = CENTRE,
    crosswalks_m: Sequence[float] = (),
) -> model.MapModel:
    """A map of one road.

    Args:
        name: of map and road.
        right: lanes from the middle outwards.
        pieces: of the reference line.
        left: the same of the other side; None: as on the right.
        centre: what is in the middle.
        crosswalks_m: s of each crosswalk.
    """
    left = right if left is None else left
    lanes = (
        *reversed([lane_record(k, lane) for k, lane in enumerate(left, start=1)]),
        lane_record(0, centre),
        *(lane_record(-k, lane) for k, lane in enumerate(right, start=1)),
    )
    objects = tuple(
        crosswalk_record(str(number), s_m, kerb_at_m(right))
        for number, s_m in enumerate(crosswalks_m, start=1)
    )
    details = model.RoadDetails(objects=objects)
    road = road_record("1", name, ORIGIN, pieces, lanes, details=details)
    poses = [*accumulate(pieces, end_of, initial=ORIGIN)]
    margin_m = max(map(width_of, (left, right)))
    return map_record(name, [(pose.x_m, pose.y_m) for pose in poses], margin_m, [road])


def arms(bearings_deg: Sequence[float], lanes: Lanes, mouth_m: float, length_m: float = ARM_M) -> list[Arm]:
    """Arms of a junction, counter-clockwise, numbered from 1."""
    return [
        Arm(str(number), radians(bearing_deg), mouth_m, length_m, lanes)
        for number, bearing_deg in enumerate(bearings_deg, start=1)
    ]


def _maps() -> dict[str, model.MapModel]:
    unmarked = UNMARKED_CENTRE
    winding = bends(50.0, [(80.0, 45.0), (60.0, -60.0), (120.0, 50.0), (45.0, -70.0)])
    s_bends = bends(30.0, [(35.0, 60.0), (35.0, -60.0), (50.0, -45.0), (50.0, 45.0), (40.0, 80.0)], 12.0)
    country = bends(90.0, [(150.0, 30.0), (120.0, -45.0)], 40.0)
    country_test = bends(60.0, [(100.0, -40.0), (180.0, 35.0), (90.0, 60.0)], 40.0)
    parking_bend = bends(110.0, [(90.0, 60.0), (70.0, -50.0)])
    straight = [Piece(STREET_M)]
    cycle_bend = bends(140.0, [(75.0, -70.0)])
    left_hand = bends(130.0, [(70.0, 60.0), (110.0, -40.0)])
    straight_m, middle = 250.0, total_length_m(cycle_bend) / 4
    return {
        # for training
        "straight_street": street("straight_street", STREET, straight, crosswalks_m=(straight_m,)),
        "winding_street": street("winding_street", STREET, winding),
        "parking_street": street(
            "parking_street", PARKING_STREET, straight, centre=unmarked, crosswalks_m=(150.0, 350.0)
        ),
        "country_road": street("country_road", COUNTRY_ROAD, country),
        "cycle_street": street("cycle_street", CYCLE_STREET, straight, crosswalks_m=(120.0, 380.0)),
        "crossing": crossing_map("crossing", arms([0.0, 90.0, 180.0, 270.0], STREET, 14.0)),
        "roundabout": roundabout_map("roundabout", arms([0.0, 90.0, 180.0, 270.0], STREET, 34.0), 17.0),
        "left_hand_street": mirrored(
            street("left_hand_street", PARKING_STREET, left_hand, crosswalks_m=(70.0,))
        ),
        # for tests
        "s_bends": street("s_bends", STREET, s_bends),
        "t_junction": crossing_map("t_junction", arms([0.0, 180.0, 270.0], PARKING_STREET, 15.0)),
        "one_way_street": street("one_way_street", ONE_WAY, straight, ONE_WAY_OTHER_SIDE, unmarked),
        "dual_carriageway": street(
            "dual_carriageway", DUAL, [Piece(220.0), *bends(120.0, [(140.0, 35.0)])], centre=unmarked
        ),
        "parking_bend": street(
            "parking_bend", NARROW_PARKING_STREET, parking_bend, centre=unmarked, crosswalks_m=(60.0,)
        ),
        "country_bends": street("country_bends", COUNTRY_ROAD, country_test),
        "cycle_bend": street("cycle_bend", CYCLE_STREET, cycle_bend, crosswalks_m=(middle,)),
        "left_hand_crossing": mirrored(
            crossing_map("left_hand_crossing", arms([0.0, 80.0, 180.0, 265.0], STREET, 15.0))
        ),
    }


def build_maps() -> Mapping[str, bytes]:
    """All maps by name, as OpenDRIVE files."""
    return {name: map_bytes(content) for name, content in _maps().items()}


if __name__ == "__main__":
    write_maps(MAPS, build_maps())
