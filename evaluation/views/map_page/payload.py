"""What the page of a map shows, as plain numbers."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import shapely

from evaluation.views.map_page.areas import area_lanes, area_settings
from opendrive import RoadNetwork
from opendrive.arrays import FloatArray
from smartmot.area.lanes import MapAreaConfig

TOLERANCE_M = 0.05
"""Outlines depart this much from the borders at most."""

UNITS_PER_M = 100
"""Places are whole centimetres, relative to the corner of the map."""

LINE_STEP_M = 1.0
"""Distance of the points of a reference line at most."""

TICK_M = 10.0
"""Distance of the marks along reference lines."""


def map_payload(
    network: RoadNetwork, area: Sequence[FloatArray], config: MapAreaConfig, speed_kmh: float
) -> dict[str, Any]:
    """Return lanes, reference lines, links, junctions, signals, objects and findings of a map.

    Args:
        network: the map.
        area: outlines of a monitored area, (P, 2) each, map frame.
        config: of the monitored lanes at a pose that is clicked.
        speed_kmh: of the ego there, at first.
    """
    x_min, y_min, x_max, y_max = network.bounds
    origin = np.array([x_min, y_min])
    outlines = network.lane_polygons(TOLERANCE_M)
    lanes = network.lanes
    middle_s = 0.5 * (lanes.s_start_m + lanes.s_end_m)
    every = np.arange(len(lanes))
    middle_x, middle_y, middle_z, heading = network.center_line(every, middle_s)
    width = network.lane_width(every, middle_s)
    middles = _units(np.stack([middle_x, middle_y], axis=1), origin).tolist()
    strips = area_lanes(network, config, origin, UNITS_PER_M)
    rows = []
    for lane, key in enumerate(lanes.key):
        limit = network.speed_limit(lane, float(middle_s[lane]))
        rows.append(
            {
                "road": key.road_id,
                "section": key.section,
                "lane": key.lane_id,
                "type": str(lanes.lane_type[lane]),
                "s": [round(float(lanes.s_start_m[lane]), 2), round(float(lanes.s_end_m[lane]), 2)],
                "junction": lanes.junction_id[lane],
                "limit": None if limit is None else round(3.6 * limit, 1),
                "next": list(network.successors(lane)),
                "rings": _rings(outlines[lane], origin),
                "middle": middles[lane],
                "heading": round(float(heading[lane]), 3),
                "width": round(float(width[lane]), 2),
                "z": round(float(middle_z[lane]), 1),
                **({"strip": strips[lane]} if lane in strips else {}),
            }
        )
    return {
        "name": network.name,
        "origin": [float(x_min), float(y_min)],
        "size": _units(np.array([[x_max, y_max]]), origin)[0].tolist(),
        "units": UNITS_PER_M,
        "lanes": rows,
        "roads": [_road(network, road_id, origin) for road_id in network.roads],
        "junctions": _junctions(network, middles),
        "signals": _signals(network, origin),
        "objects": [
            {
                "id": item.id,
                "type": item.type,
                "name": item.name,
                "road": item.road_id,
                "s": round(item.s_m, 2),
                "at": _units(np.array([item.xyz_m[:2]]), origin)[0].tolist(),
                "ring": _delta(_units(item.polygon, origin)) if len(item.polygon) else [],
            }
            for item in network.objects
        ],
        "findings": _findings(network, origin),
        "pose": area_settings(config, speed_kmh),
        "area": [_delta(_units(outline, origin)) for outline in area if len(outline)],
    }


def _units(xy_m: FloatArray, origin: FloatArray) -> np.ndarray:
    return np.rint((xy_m - origin) * UNITS_PER_M).astype(np.int64)


def _delta(points: np.ndarray) -> list[int]:
    """Return points as the first one and differences, which take fewer digits."""
    first = points[:1]
    flat: list[int] = np.concatenate([first, np.diff(points, axis=0)]).ravel().tolist()
    return flat


def _rings(outline: shapely.Geometry, origin: FloatArray) -> list[list[int]]:
    rings = shapely.get_rings(shapely.get_parts(outline))
    return [_delta(_units(shapely.get_coordinates(ring)[:-1], origin)) for ring in rings]


def _road(network: RoadNetwork, road_id: str, origin: FloatArray) -> dict[str, Any]:
    road = network.roads[road_id]
    count = max(int(np.ceil(road.length_m / LINE_STEP_M)), 1) + 1
    s_m = np.linspace(0.0, road.length_m, count)
    line = road.reference_line(s_m)
    ticks_m = np.arange(0.0, road.length_m, TICK_M)
    at = road.reference_line(ticks_m)
    return {
        "id": road_id,
        "name": road.record.name,
        "length": round(road.length_m, 2),
        "line": _delta(_units(np.stack([line.x_m, line.y_m], axis=1), origin)),
        "ticks": np.column_stack(
            [_units(np.stack([at.x_m, at.y_m], axis=1), origin), np.rint(1000 * at.heading_rad).astype(int)]
        )
        .ravel()
        .tolist(),
        "links": [
            f"{name}: {link.element_type} {link.element_id} {link.contact_point or ''}".strip()
            for name, link in (
                ("predecessor", road.record.predecessor),
                ("successor", road.record.successor),
            )
            if link is not None
        ],
    }


def _junctions(network: RoadNetwork, middles: list[list[int]]) -> list[dict[str, Any]]:
    members: dict[str, list[list[int]]] = {}
    for lane, junction_id in enumerate(network.lanes.junction_id):
        if junction_id is not None:
            members.setdefault(junction_id, []).append(middles[lane])
    return [
        {
            "id": junction.id,
            "name": junction.name,
            "type": junction.type,
            "connections": len(junction.connections),
            "at": np.mean(members[junction.id], axis=0).round().astype(int).tolist(),
        }
        for junction in network.model.junctions.values()
        if junction.id in members
    ]


def _signals(network: RoadNetwork, origin: FloatArray) -> list[dict[str, Any]]:
    rows = []
    for road_id, road in network.roads.items():
        for signal in network.signals_of(road_id):
            at = road.point(min(max(signal.s_m, 0.0), road.length_m), signal.t_m)
            rows.append(
                {
                    "id": signal.id,
                    "name": signal.name,
                    "type": signal.type,
                    "subtype": signal.subtype,
                    "value": signal.value,
                    "road": road_id,
                    "s": round(signal.s_m, 2),
                    "dynamic": signal.dynamic,
                    "reference": signal.is_reference,
                    "at": _units(np.array([[float(at.x_m), float(at.y_m)]]), origin)[0].tolist(),
                }
            )
    return rows


def _findings(network: RoadNetwork, origin: FloatArray) -> list[dict[str, Any]]:
    rows = []
    for finding in network.findings:
        place = network.place_of(finding)
        rows.append(
            {
                "kind": finding.kind.value,
                "road": finding.road_id,
                "lane": finding.lane_id,
                "s": None if finding.s_m is None else round(finding.s_m, 2),
                "message": finding.message,
                "rule": finding.rule,
                "at": None if place is None else _units(np.array([place[:2]]), origin)[0].tolist(),
            }
        )
    return rows
