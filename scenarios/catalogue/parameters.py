"""The parameters of the shipped scenarios: what each means, and in which unit."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple


class Meaning(NamedTuple):
    """What a parameter is.

    Args:
        unit: of its values; empty for names, ratios and truth values.
        text: what it is.
    """

    unit: str
    text: str


MEANINGS: Mapping[str, Meaning] = MappingProxyType(
    {
        "Ego_speed_kmh": Meaning("km/h", "test speed: of the vehicle under test"),
        "Target_speed_kmh": Meaning("km/h", "speed of the target"),
        "Target_entry": Meaning(
            "", "the target, an entry of the shipped catalogs: adult, child, bicyclist, vehicle_device"
        ),
        "Impact_percent": Meaning(
            "%", "where the target meets the ego's width: 0 its right edge, 100 its left edge"
        ),
        "Illuminance": Meaning("lx", "light: a clear day 100000, a night 0.1"),
        "Target_offset": Meaning("m", "from the target's start to the centre of the ego's lane"),
        "Acceleration_distance": Meaning("m", "way on which the target reaches its speed"),
        "Steady_distance": Meaning("m", "way of the target at its speed, up to the line"),
        "Target_heading_deg": Meaning(
            "degrees", "turns the target's way about the point where it meets the ego's front"
        ),
        "Target_deceleration": Meaning("m/s2", "of the car ahead"),
        "Run_out": Meaning("m", "how far beyond the centre of the lane the target goes"),
        "Headway": Meaning("m", "from the ego's front to the rear of the car ahead"),
        "Headway_s": Meaning("s", "how long the headway is held before the car ahead brakes"),
        "Lead_s": Meaning("s", "how long the ego drives before the target sets off"),
        "Start_s": Meaning("s", "from the start until an unbraked ego would reach the target"),
        "Side_gap": Meaning("m", "between the ego and the parked cars, across the road"),
        "Front_gap": Meaning(
            "m", "along the road: from the target to the first parked car, and between both"
        ),
        "Gap": Meaning("m", "between the cars that the ego drives through"),
        "Reported": Meaning("", "whether sensors report the plate"),
        "Plate_length": Meaning("m", "of the steel plate"),
        "Plate_width": Meaning("m", "of the steel plate"),
        "Plate_height": Meaning("m", "of the steel plate"),
        "Map": Meaning("", "OpenDRIVE file, seen from the folder of the scenario"),
        "Line_x": Meaning("m", "place of the line where the ego meets the target: map frame, east"),
        "Line_y": Meaning("m", "the same: map frame, north"),
        "Line_yaw": Meaning("rad", "heading of the ego's lane there, counter-clockwise from east"),
        "Side": Meaning("", "near side of the road: -1 right of the ego, 1 left of it"),
        "Ego_length": Meaning("m", "of the vehicle under test"),
        "Ego_width": Meaning("m", "of the vehicle under test"),
    }
)
"""By name, the order in which they are shown."""

INTERNAL = frozenset(
    {
        "Ego_center", "Target_catalog", "Target_width", "Target_reference", "Target_rear", "From_near_side",
        "Near_entry", "Near_center", "Near_length", "Near_width",
        "Far_entry", "Far_center", "Far_length", "Far_width",
    }
)  # fmt: skip
"""Parameters that follow from others, as the outline of a target from its entry; they are not shown."""
