"""A map in words: what it holds, and what the law says on the route ahead of a place."""

from __future__ import annotations

import numpy as np

from opendrive import RoadNetwork
from opendrive.checks import warning_table
from scenarios.catalogue.cpna import approach_m
from scenarios.errors import ScenarioError
from scenarios.places import RUN_OUT_M, Place, Site, lane_at, near_side, site_stretches
from smartmot.maps.regulatory import regulatory_elements
from smartmot.maps.route import route_ahead


def pose_site(network: RoadNetwork, place: Place) -> Site:
    """A place to look at, which need not be straight."""
    lane = lane_at(network, place)
    if network.lanes.lane_type[lane] != "driving":
        raise ScenarioError(
            f"lane {place.lane_id} of road {place.road_id} is of type {network.lanes.lane_type[lane]!s}; "
            "choose a driving lane"
        )
    route = route_ahead(network, lane, place.s_m, ahead_m=200.0, behind_m=100.0)
    return Site(network, route, route.station_of(lane, place.s_m), near_side(network, lane))


def describe_sites(network: RoadNetwork, speed_kmh: float) -> list[str]:
    """Every stretch of a map where a pedestrian test can stand, line by line, those with a sidewalk first."""
    stretches = site_stretches(network, approach_m(speed_kmh))
    rows = [("ROAD,LANE,S", "line from s to s", "straight", "sidewalk")] if stretches else []
    rows += [
        (
            f"{stretch.place.road_id},{stretch.place.lane_id},{stretch.place.s_m:.1f}",
            f"{stretch.s_low_m:.1f} .. {stretch.s_high_m:.1f}",
            f"{stretch.straight_m:.0f} m",
            "yes" if stretch.has_sidewalk else "no",
        )
        for stretch in stretches
    ]
    widths = [max(len(row[k]) for row in rows) for k in range(4)] if rows else []
    lines = ["  ".join(cell.ljust(n) for cell, n in zip(row, widths, strict=True)).rstrip() for row in rows]
    needed = f"{approach_m(speed_kmh):.0f} m straight before the line and {RUN_OUT_M:.0f} m after it"
    return [*lines, f"{len(stretches)} stretches for a test at {speed_kmh:g} km/h ({needed})"]


def describe_map(network: RoadNetwork, site: Site | None, speed_kmh: float) -> list[str]:
    """What a map holds, and what the law says on the route ahead of a place, line by line."""
    types, counts = np.unique(network.lanes.lane_type, return_counts=True)
    lines = [
        f"map: {network.name or '(unnamed)'}, {len(network.roads)} roads, {len(network.lanes.key)} lanes: "
        + ", ".join(f"{n} {t}" for t, n in zip(types, counts, strict=True)),
        f"crosswalks: {len(network.crosswalks)}, warnings: {len(network.warnings)}",
    ]
    if network.overlapping_roads:
        pairs = ", ".join(f"{a} and {b}" for a, b in network.overlapping_roads[:5])
        more = "" if len(network.overlapping_roads) <= 5 else ", ..."
        lines.append(f"levels: roads lie above each other ({pairs}{more}); queries there need a height")
    lines += [f"  warning: {line}" for line in warning_table(network.warnings[:20])[1:-1]]
    if len(network.warnings) > 20:
        lines.append(f"  and {len(network.warnings) - 20} more: --check lists all of them")
    if site is not None:
        lines.append(
            f"route: {len(site.route.strips)} lanes, {site.route.length_m - site.line_m:.0f} m ahead"
        )
        elements = regulatory_elements(network, site.route, site.line_m, 200.0)
        for element in elements:
            value = "" if element.value is None else f" {element.value:g}"
            lines.append(f"  {element.kind}{value} in {element.distance_m:.1f} m (road {element.road_id})")
        if not elements:
            lines.append("  no regulatory element within 200 m")
    return lines
