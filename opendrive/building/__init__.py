"""Maps built in code, on the records of `opendrive.model`; docs/maps.md has an example."""

from opendrive.building.joints import LaneEnd, joined, junction
from opendrive.building.records import (
    CENTRE,
    UNMARKED_CENTRE,
    Lane,
    area_object,
    crosswalk,
    profile,
    road,
    road_map,
    section,
    signal,
)
from opendrive.building.reference_line import Curve, Piece, Pose, arc, line, spiral, through

__all__ = [
    "CENTRE",
    "UNMARKED_CENTRE",
    "Curve",
    "Lane",
    "LaneEnd",
    "Piece",
    "Pose",
    "arc",
    "area_object",
    "crosswalk",
    "joined",
    "junction",
    "line",
    "profile",
    "road",
    "road_map",
    "section",
    "signal",
    "spiral",
    "through",
]
