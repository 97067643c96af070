"""Maps of the scenes: left bends of several radii, a street with cycle lanes, one with two lanes each way.

They are made like the shipped maps (`scenarios.catalogue.map_builder`). ``python -m
scenarios.scenes.scene_maps`` writes all of them again, byte by byte the same.
"""

from __future__ import annotations

from math import pi
from pathlib import Path

from scenarios.catalogue.map_builder import DRIVING, PARKING, SIDEWALK, Lane, Lanes, Piece, street_map

MAPS = Path(__file__).parent / "maps"

STRAIGHT_M = 200.0
STREET_M = 500.0
SPIRAL_M = {30.0: 20.0, 60.0: 30.0, 120.0: 40.0}
"""Length of the clothoids at both ends of a bend, by its radius; a bend begins at s = 200 m."""
CYCLE_LANE_M = 1.8

_CYCLE = Lane("biking", CYCLE_LANE_M, "solid")
_RIGHT_OF_TWO = Lane("driving", 3.5, "solid")
_LEFT_OF_TWO = Lane("driving", 3.5, "broken")


def bend_pieces(radius_m: float) -> list[Piece]:
    """Straight, a left turn of 90 degrees between clothoids, straight."""
    curvature, spiral = 1 / radius_m, SPIRAL_M[radius_m]
    return [
        Piece(STRAIGHT_M),
        Piece(spiral, 0.0, curvature),
        Piece(radius_m * pi / 2 - spiral, curvature, curvature),
        Piece(spiral, curvature, 0.0),
        Piece(STRAIGHT_M),
    ]


def bend_length_m(radius_m: float) -> float:
    """Length of the reference line between the straights."""
    return radius_m * pi / 2 + SPIRAL_M[radius_m]


def build_maps() -> dict[str, bytes]:
    """All maps by name, as OpenDRIVE files."""
    street: Lanes = (DRIVING, SIDEWALK)
    found = {
        f"bend_{radius:.0f}": street_map(f"bend_{radius:.0f}", street, bend_pieces(radius))
        for radius in SPIRAL_M
    }
    parking: Lanes = (DRIVING, PARKING, SIDEWALK)
    found["bend_60_parking"] = street_map("bend_60_parking", parking, bend_pieces(60.0))
    cycle: Lanes = (DRIVING, _CYCLE, SIDEWALK)
    found["street_cycle"] = street_map("street_cycle", cycle, [Piece(STREET_M)])
    found["bend_60_cycle"] = street_map("bend_60_cycle", cycle, bend_pieces(60.0))
    two: Lanes = (_LEFT_OF_TWO, _RIGHT_OF_TWO, SIDEWALK)
    found["street_two_lanes"] = street_map("street_two_lanes", two, [Piece(STREET_M)])
    return found


def write_maps(directory: Path = MAPS) -> None:
    """Write all maps into a directory, which is made if it is missing."""
    directory.mkdir(parents=True, exist_ok=True)
    for name, content in build_maps().items():
        (directory / f"{name}.xodr").write_bytes(content)


if __name__ == "__main__":
    write_maps()
