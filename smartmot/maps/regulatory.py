"""Regulatory elements on the route ahead: stop, give way, traffic light, speed limit, crosswalk."""

from __future__ import annotations

import re
from dataclasses import dataclass

from smartmot.maps.lane_map import LaneMap, MapSignal
from smartmot.maps.route import Route

SIGNAL_KINDS = {
    # German catalogue (StVO), as OpenDRIVE 1.4 and CARLA's towns use it without naming a country
    "206": "stop",
    "205": "give_way",
    "274": "speed_limit",
    # ASAM OpenDRIVE 1.8, signal types of traffic lights
    "1000001": "traffic_light",
    "1000009": "traffic_light",
    "1000010": "traffic_light",
    "1000011": "traffic_light",
    # a crosswalk given as a signal instead of an object
    "1000003": "crosswalk",
    "293": "crosswalk",
}
NAMED_KINDS = (("Sign_Stop", "stop"), ("Sign_Yield", "give_way"), ("Sign_SpeedLimit", "speed_limit"))
"""Beginnings of the names that RoadRunner gives to signs whose type it leaves open (-1)."""


@dataclass(frozen=True, slots=True)
class RegulatoryElement:
    """One element ahead.

    Args:
        kind: stop, give_way, traffic_light, speed_limit or crosswalk.
        distance_m: from the ego's centre along the route.
        road_id: the road that carries it.
        s_m: its road coordinate.
        value: number on the sign in the file's unit (speed limits: from the sign's name where the file gives
            no value), None when there is none.
    """

    kind: str
    distance_m: float
    road_id: str
    s_m: float
    value: float | None


def _kind(signal: MapSignal) -> str | None:
    if signal.type in SIGNAL_KINDS:
        return SIGNAL_KINDS[signal.type]
    return next((kind for start, kind in NAMED_KINDS if signal.name.startswith(start)), None)


def _value(signal: MapSignal) -> float | None:
    """The limit on a speed sign: its value, else the number in its name."""
    if signal.value is not None and signal.value > 0:
        return signal.value
    number = re.search(r"_(\d+)", signal.name)
    return float(number[1]) if number else None


def regulatory_elements(
    network: LaneMap, route: Route, station_m: float, ahead_m: float
) -> tuple[RegulatoryElement, ...]:
    """Elements that face the ego between two stations of the route, nearest first.

    Args:
        network: the map.
        route: the ego's route.
        station_m: the ego's station on it.
        ahead_m: how far to look.
    """
    elements: list[RegulatoryElement] = []
    # where two stretches of a road meet, both contain the place
    seen: set[tuple[str, str, str, float]] = set()
    for strip, entry_m in zip(route.strips, route.entry_m.tolist(), strict=True):
        if entry_m > station_m + ahead_m or entry_m + strip.length_m < station_m:
            continue
        road_id, _, lane_id = network.lanes.key[strip.lane]
        low, high = sorted((float(strip.s_m[0]), float(strip.s_m[-1])))
        facing = "+" if network.lanes.direction[strip.lane] > 0 else "-"
        on_road: list[tuple[str, str, float, float | None]] = [
            (kind, signal.id, signal.s_m, _value(signal) if kind == "speed_limit" else None)
            for signal in network.signals_of(road_id)
            if (kind := _kind(signal)) is not None
            and signal.orientation in (facing, "none")
            and signal.applies_to(lane_id)
        ]
        on_road += [("crosswalk", c.id, c.s_m, None) for c in network.crosswalks if c.road_id == road_id]
        for kind, name, s_m, value in on_road:
            place = (road_id, kind, name, s_m)
            distance = entry_m + strip.station_at(s_m) - station_m
            if low <= s_m <= high and 0.0 <= distance <= ahead_m and place not in seen:
                seen.add(place)
                elements.append(RegulatoryElement(kind, distance, road_id, s_m, value))
    return tuple(sorted(elements, key=lambda element: element.distance_m))
