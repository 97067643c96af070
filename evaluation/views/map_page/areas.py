"""What the page of a map needs to draw the monitored lanes at a pose: strips, ways on, sides and crossings.

The page puts them together as `smartmot.area.MapArea` does: route straight on, roles, stretches.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import shapely

from opendrive import RoadNetwork
from opendrive.arrays import FloatArray
from smartmot.area.lanes import LEAST_CROSSING_M2, SIDES, MapAreaConfig
from smartmot.maps.strips import LaneStrip, lane_strip, ring
from smartmot.maps.walks import lane_ends, side_lane

AHEAD_M, BEHIND_M = 200.0, 100.0
"""Length of the route: as `smartmot-eval map --at` takes it."""


def area_settings(config: MapAreaConfig, speed_kmh: float) -> dict[str, float]:
    """Lengths of the monitored area, and the speed that the page begins with."""
    return {
        "min_front": config.min_front_m,
        "front_time": config.front_time_s,
        "back": config.back_fraction,
        "ahead": AHEAD_M,
        "behind": BEHIND_M,
        "speed": speed_kmh,
    }


def area_lanes(
    network: RoadNetwork, config: MapAreaConfig, origin: FloatArray, units_per_m: int
) -> dict[int, dict[str, Any]]:
    """By lane what the monitored area takes from it: driving lanes, and what a route over them may reach.

    Args:
        network: the map.
        config: of the area.
        origin: (2,) of the page's frame.
        units_per_m: of the page's coordinates and lengths.
    """
    lanes = network.lanes
    wanted = set(np.flatnonzero(lanes.lane_type == "driving").tolist())
    front = list(wanted)
    while front:
        lane = front.pop()
        further = {*network.successors(lane), *network.predecessors(lane)} - wanted
        wanted |= further
        front += further
    crossings = _crossings(network)
    rows: dict[int, dict[str, Any]] = {}
    for lane in sorted(wanted):
        strip = lane_strip(network, lane, config.vru_margin_m)
        headings = network.center_line(lane, np.array(lane_ends(network, lane)))[3]
        sides = [side_lane(network, lane, side) for side in SIDES]
        rows[lane] = {
            **_strip(strip, origin, units_per_m),
            "ends": np.round(headings, 4).tolist(),
            "prev": list(network.predecessors(lane)),
            "side": sides,
            "change": [
                [] if beside is None else np.round(network.lane_change_ranges(lane, side), 2).tolist()
                for side, beside in zip(SIDES, sides, strict=True)
            ],
            "cross": crossings.get(lane, []),
        }
    return rows


def _strip(strip: LaneStrip, origin: FloatArray, units_per_m: int) -> dict[str, Any]:
    """Points, s and widths of a strip; one number for widths that are the same all along."""
    columns = {"half": strip.half_width_m, "left": strip.vru_left_m, "right": strip.vru_right_m}
    points = np.rint((strip.center_m - origin) * units_per_m).astype(np.int64)
    steps = np.concatenate((points[:1], np.diff(points, axis=0)))
    return {
        "at": steps.ravel().tolist(),
        "s": np.round(strip.s_m, 2).tolist(),
        **{
            name: round(float(column[0]), 3) if np.ptp(column) < 1e-3 else np.round(column, 3).tolist()
            for name, column in columns.items()
        },
    }


def _crossings(network: RoadNetwork) -> dict[int, list[int]]:
    """Driving lanes of junctions with the others of the junction whose surfaces meet theirs."""
    junctions: dict[str, list[int]] = {}
    for lane, junction_id in enumerate(network.lanes.junction_id):
        if junction_id is not None and network.lanes.lane_type[lane] == "driving":
            junctions.setdefault(junction_id, []).append(lane)
    crossings: dict[int, list[int]] = {}
    for members in junctions.values():
        strips = [lane_strip(network, lane, 0.0) for lane in members]
        # a ring that crosses itself in a tight bend is no polygon; a buffer of 0 makes it one
        surfaces = shapely.buffer([shapely.Polygon(ring(x, 0.0, x.length_m)) for x in strips], 0.0)
        first, second = shapely.STRtree(surfaces).query(surfaces, predicate="intersects")
        common = shapely.area(shapely.intersection(surfaces[first], surfaces[second]))
        for a, b in zip(
            *(rows[common > LEAST_CROSSING_M2].tolist() for rows in (first, second)), strict=True
        ):
            if a != b:
                crossings.setdefault(members[a], []).append(members[b])
    return crossings
