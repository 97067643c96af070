"""Maps of the scenes: left bends of several radii, a street with cycle lanes, one with two lanes each way.

They are made like the shipped maps (`scenarios.catalogue.map_builder`). ``python -m
scenarios.scenes.scene_maps`` writes all of them again, byte by byte the same.
"""

from __future__ import annotations

from math import pi
from pathlib import Path

from opendrive.building.records import Lane
from opendrive.building.reference_line import Piece
from scenarios.catalogue.map_builder import (
    BEND_STRAIGHT_M,
    DRIVING,
    PARKING,
    SIDEWALK,
    bend_pieces,
    street_map,
    write_maps,
)

MAPS = Path(__file__).parent / "maps"

STRAIGHT_M = BEND_STRAIGHT_M
STREET_M = 500.0
SPIRAL_M = {30.0: 20.0, 60.0: 30.0, 120.0: 40.0}
"""Length of the clothoids at both ends of a bend, by its radius; a bend begins at s = 200 m."""

CYCLE_LANE = Lane("biking", 1.8, "solid")
LEFT_OF_TWO = Lane("driving", 3.5, "broken")


def bend_length_m(radius_m: float) -> float:
    """Length of the reference line between the straights."""
    return radius_m * pi / 2 + SPIRAL_M[radius_m]


def build_maps() -> dict[str, bytes]:
    """All maps by name, as OpenDRIVE files."""
    bends = {radius: bend_pieces(radius, spiral) for radius, spiral in SPIRAL_M.items()}
    street = [Piece(STREET_M)]
    roads = {f"bend_{radius:.0f}": ((DRIVING, SIDEWALK), bend) for radius, bend in bends.items()} | {
        "bend_60_parking": ((DRIVING, PARKING, SIDEWALK), bends[60.0]),
        "street_cycle": ((DRIVING, CYCLE_LANE, SIDEWALK), street),
        "bend_60_cycle": ((DRIVING, CYCLE_LANE, SIDEWALK), bends[60.0]),
        "street_two_lanes": ((LEFT_OF_TWO, DRIVING, SIDEWALK), street),
    }
    return {name: street_map(name, lanes, pieces) for name, (lanes, pieces) in roads.items()}


if __name__ == "__main__":
    write_maps(MAPS, build_maps())
