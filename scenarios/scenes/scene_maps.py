"""Maps of the scenes: left bends of several radii, a street with cycle lanes, one with two lanes each way.

They are made like the shipped maps (`scenarios.map_builder`). ``python -m scenarios.scenes.scene_maps``
writes all of them again, byte by byte the same.
"""

from __future__ import annotations

from math import pi
from pathlib import Path

from lxml import etree

from scenarios.map_builder import (
    _DRIVING,
    _ORIGIN,
    _PARKING,
    _SIDEWALK,
    _add,
    _document,
    _end,
    _half_width_m,
    _Lane,
    _lane,
    _Lanes,
    _mark,
    _Piece,
    _plan_view,
    _Pose,
    _road,
)

MAPS = Path(__file__).parent / "maps"

STRAIGHT_M = 200.0
STREET_M = 500.0
SPIRAL_M = {30.0: 20.0, 60.0: 30.0, 120.0: 40.0}
"""Length of the clothoids at both ends of a bend, by its radius; a bend begins at s = 200 m."""
CYCLE_LANE_M = 1.8

_CYCLE = _Lane("biking", CYCLE_LANE_M, "solid")
_RIGHT_OF_TWO = _Lane("driving", 3.5, "solid")
_LEFT_OF_TWO = _Lane("driving", 3.5, "broken")


def bend_pieces(radius_m: float) -> list[_Piece]:
    """Straight, a left turn of 90 degrees between clothoids, straight."""
    curvature, spiral = 1 / radius_m, SPIRAL_M[radius_m]
    return [
        _Piece(STRAIGHT_M),
        _Piece(spiral, 0.0, curvature),
        _Piece(radius_m * pi / 2 - spiral, curvature, curvature),
        _Piece(spiral, curvature, 0.0),
        _Piece(STRAIGHT_M),
    ]


def bend_length_m(radius_m: float) -> float:
    """Length of the reference line between the straights."""
    return radius_m * pi / 2 + SPIRAL_M[radius_m]


def _street(name: str, lanes: _Lanes, pieces: list[_Piece]) -> bytes:
    """One road with the same lanes on both sides; a broken mark may be crossed."""
    end: _Pose = _ORIGIN
    for piece in pieces:
        end = _end(end, piece)
    root = _document(name, [(0.0, 0.0), (end.x_m, end.y_m)], _half_width_m(lanes))
    road = _road(root, "1", name, pieces)
    _plan_view(road, _ORIGIN, pieces)
    section = _add(_add(road, "lanes"), "laneSection", s="0")
    left, center, right = (_add(section, side) for side in ("left", "center", "right"))
    for number in range(len(lanes), 0, -1):
        _lane(left, number, lanes[number - 1])
    _mark(_add(center, "lane", id="0", type="none", level="false"), "broken", "both")
    for number, lane in enumerate(lanes, start=1):
        _lane(right, -number, lane)
    for mark in road.iter("roadMark"):
        if mark.get("type") == "broken":
            mark.set("laneChange", "both")
    return etree.tostring(root, pretty_print=True, xml_declaration=True, encoding="UTF-8")


def build_maps() -> dict[str, bytes]:
    """All maps by name, as OpenDRIVE files."""
    street: _Lanes = (_DRIVING, _SIDEWALK)
    found = {
        f"bend_{radius:.0f}": _street(f"bend_{radius:.0f}", street, bend_pieces(radius))
        for radius in SPIRAL_M
    }
    parking: _Lanes = (_DRIVING, _PARKING, _SIDEWALK)
    found["bend_60_parking"] = _street("bend_60_parking", parking, bend_pieces(60.0))
    cycle: _Lanes = (_DRIVING, _CYCLE, _SIDEWALK)
    found["street_cycle"] = _street("street_cycle", cycle, [_Piece(STREET_M)])
    found["bend_60_cycle"] = _street("bend_60_cycle", cycle, bend_pieces(60.0))
    two: _Lanes = (_LEFT_OF_TWO, _RIGHT_OF_TWO, _SIDEWALK)
    found["street_two_lanes"] = _street("street_two_lanes", two, [_Piece(STREET_M)])
    return found


def write_maps(directory: Path = MAPS) -> None:
    """Write all maps into a directory, which is made if it is missing."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, content in build_maps().items():
        (directory / f"{name}.xodr").write_bytes(content)


if __name__ == "__main__":
    write_maps()
