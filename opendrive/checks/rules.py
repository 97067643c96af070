"""Rules of the standard that break no map, but that ASAM's checker asks for."""

from collections import defaultdict
from collections.abc import Iterator

import numpy as np

from opendrive.arrays import wrapped
from opendrive.checks.curves import LENGTH_ERROR_M, NEGATIVE_WIDTH_M
from opendrive.checks.joints import Joints, end_s_m, lane_name
from opendrive.checks.profiles import crossed_borders
from opendrive.errors import MapWarning, WarningKind
from opendrive.geometry.cubic import restarted
from opendrive.geometry.curves import CIRCULAR, CUBIC
from opendrive.lanes.table import LaneKey
from opendrive.model import MapModel, Road
from opendrive.roads.geometry import NetworkGeometry
from opendrive.roads.road_records import RoadRecords

NO_WIDTH_M = 1e-6
"""A lane that is less wide has no width."""

LENGTH_M = 1e-3
"""A parametric cubic may be this much longer or shorter than its length, as in ASAM's checker."""

OVERLAP_M = 1e-7
"""A border this much inside the one of the next lane may be rounded."""

SAME = 1e-6
"""Coefficients and angles that differ by less are the same."""

SAME_SLOPE = 1e-3
"""A parametric cubic may start at this angle to its own frame, rad: files round."""


def rule_warnings(geometry: NetworkGeometry, joints: Joints, model: MapModel) -> Iterator[MapWarning]:
    """Yield where a map breaks rules of the revision it was written for.

    Rules hold from a revision on, which is part of their name.
    """
    revision = (model.header.rev_major, model.header.rev_minor)
    yield from _shared_contacts(geometry)
    yield from _incoming_roads(geometry, model)
    yield from _new_lanes(geometry, joints)
    yield from crossed_borders(geometry, OVERLAP_M, NEGATIVE_WIDTH_M, WarningKind.RULE)
    yield from _lengths(geometry)
    yield from _curves(geometry)
    if revision >= (1, 7):
        yield from _widthless_links(geometry, joints)
        yield from _level_changes(geometry, joints)
        yield from _level_sides(geometry)
        roads = model.roads
        for road in roads.with_part("access") if isinstance(roads, RoadRecords) else roads.values():
            yield from _mixed_access(road)
        yield from _redundant(geometry)
    if revision == (1, 7):
        yield from _shared_connecting_roads(model)
    if revision >= (1, 8):
        yield from _against_traffic(geometry, model)


def _broken(
    rule: str, owner: str, element: str, message: str, s_m: float | None = None, lane_id: int | None = None
) -> MapWarning:
    return MapWarning(owner, element, message, WarningKind.RULE, s_m, lane_id, rule=f"asam.net:xodr:{rule}")


# Roads and junctions


def _shared_contacts(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield ends of roads that several roads outside junctions link to."""
    roads = geometry.roads
    callers: dict[tuple[str, str], list[str]] = defaultdict(list)
    for road_id, junction_id, *links in zip(
        roads.id, roads.junction_id, roads.predecessor, roads.successor, strict=True
    ):
        for link in links:
            if (
                junction_id is None
                and link is not None
                and link.contact_point
                and link.element_type == "road"
            ):
                callers[link.element_id, link.contact_point].append(road_id)
    for (road_id, end), names in callers.items():
        if len(names) > 1:
            message = f"the {end} is linked to by roads {', '.join(names):.200}; a junction is needed"
            yield _broken("1.4.0:road.linkage.is_junction_needed", road_id, "road/link", message)


def _incoming_roads(geometry: NetworkGeometry, model: MapModel) -> Iterator[MapWarning]:
    junction_of = dict(zip(geometry.roads.id, geometry.roads.junction_id, strict=True))
    for junction in model.junctions.values():
        for connection in junction.connections:
            if junction_of.get(connection.incoming_road) is not None:
                message = f"the incoming road {connection.incoming_road!r:.40} is itself part of a junction"
                rule = "1.4.0:junctions.connection.connect_road_no_incoming_road"
                yield _broken(rule, junction.id, "junction/connection", message)


def _shared_connecting_roads(model: MapModel) -> Iterator[MapWarning]:
    for junction in model.junctions.values():
        names = [c.connecting_road for c in junction.connections if not c.is_linked]
        for name in dict.fromkeys(name for name in names if names.count(name) > 1):
            message = (
                f"road {name!r:.40} is the connecting road of {names.count(name)} connections, not of one"
            )
            rule = "1.7.0:junctions.connection.one_connection_element"
            yield _broken(rule, junction.id, "junction/connection", message)


def _against_traffic(geometry: NetworkGeometry, model: MapModel) -> Iterator[MapWarning]:
    """Yield lane links into connecting roads whose lanes do not lead that way."""
    lanes, roads = geometry.lanes, geometry.roads
    road_of = {road_id: r for r, road_id in enumerate(roads.id)}
    sections = np.bincount(lanes.sections.road, minlength=len(roads.id))
    for junction in model.junctions.values():
        for connection in junction.connections:
            incoming, connecting = (
                road_of.get(n) for n in (connection.incoming_road, connection.connecting_road)
            )
            if incoming is None or connecting is None or connection.is_linked:
                continue
            at_start = connection.contact_point == "start"
            link = (roads.predecessor if at_start else roads.successor)[connecting]
            if link is None or link.contact_point is None or link.element_id != connection.incoming_road:
                continue
            leaves_at_end = link.contact_point == "end"
            section = int(sections[incoming]) - 1 if leaves_at_end else 0
            entered = 0 if at_start else int(sections[connecting]) - 1
            for from_id, to_id in connection.lane_links:
                before = LaneKey(connection.incoming_road, section, from_id)
                after = LaneKey(connection.connecting_road, entered, to_id)
                a, b = lanes.lane_of_key.get(before), lanes.lane_of_key.get(after)
                if a is None or b is None:
                    continue
                leaves = _is_both(model, before) or (lanes.direction[a] > 0) == leaves_at_end
                enters = _is_both(model, after) or (lanes.direction[b] > 0) == at_start
                if not (leaves and enters):
                    message = (
                        f"connection {connection.id!r:.40} links lane {from_id} of road "
                        f"{before.road_id!r:.40} to lane {to_id} of road {after.road_id!r:.40}, against "
                        "the traffic"
                    )
                    rule = "1.8.0:junctions.connection.one_link_to_incoming"
                    yield _broken(rule, junction.id, "junction/connection/laneLink", message)


def _is_both(model: MapModel, key: LaneKey) -> bool:
    lane = next(
        lane for lane in model.roads[key.road_id].sections[key.section].lanes if lane.id == key.lane_id
    )
    return lane.direction == "both" or lane.type == "bidirectional"


# Lanes


def _new_lanes(geometry: NetworkGeometry, joints: Joints) -> Iterator[MapWarning]:
    """Yield links to lanes that appear or vanish there."""
    lanes = geometry.lanes
    none = np.abs(joints.width_m) < NO_WIDTH_M
    for k in np.flatnonzero(none.any(axis=1)).tolist():
        ends = (joints.first, joints.second) if none[k, 1] else (joints.second, joints.first)
        a, b = (lanes.key[int(end.lane[k])] for end in ends)
        message = f"lane {a.lane_id} is linked to {lane_name(b, a.road_id)}, which has no width there"
        s_m = float(end_s_m(geometry, ends[0])[k])
        yield _broken("1.4.0:road.lane.link.new_lane_appear", a.road_id, "lane/link", message, s_m, a.lane_id)


def _widthless_links(geometry: NetworkGeometry, joints: Joints) -> Iterator[MapWarning]:
    lanes = geometry.lanes
    for side, ends in enumerate((joints.first, joints.second)):
        for k in np.flatnonzero(np.abs(joints.width_m[:, side]) < NO_WIDTH_M).tolist():
            key, end = lanes.key[int(ends.lane[k])], "end" if ends.at_end[k] else "start"
            message = f"lane {key.lane_id} has no width at its {end}, but is linked there"
            s_m = float(end_s_m(geometry, ends)[k])
            rule = f"1.7.0:road.lane.link.zero_width_at_{end}"
            yield _broken(rule, key.road_id, "lane/link", message, s_m, key.lane_id)


_LEVEL_RULE = "1.7.0:road.lane.level_true_one_side"


def _level_sides(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield lanes that are not level beyond a level one."""
    lanes = geometry.lanes
    beside = (np.diff(lanes.section) == 0) & (np.diff(lanes.side) == 0)
    for inner in np.flatnonzero(beside & lanes.level[:-1] & ~lanes.level[1:]).tolist():
        a, b = lanes.key[inner], lanes.key[inner + 1]
        message = f"lane {b.lane_id} is not level beyond the level lane {a.lane_id}"
        s_m = float(lanes.s_start_m[inner])
        yield _broken(_LEVEL_RULE, b.road_id, "lane", message, s_m, b.lane_id)


def _level_changes(geometry: NetworkGeometry, joints: Joints) -> Iterator[MapWarning]:
    lanes = geometry.lanes
    for k in np.flatnonzero(lanes.level[joints.first.lane] != lanes.level[joints.second.lane]).tolist():
        a, b = (lanes.key[int(end.lane[k])] for end in (joints.first, joints.second))
        message = f"of lane {a.lane_id} and {lane_name(b, a.road_id)}, linked to it, one is level"
        s_m = float(end_s_m(geometry, joints.first)[k])
        yield _broken(_LEVEL_RULE, a.road_id, "lane/link", message, s_m, a.lane_id)


def _mixed_access(road: Road) -> Iterator[MapWarning]:
    for section in road.sections:
        for lane in section.lanes:
            rules: dict[float, set[str]] = defaultdict(set)
            for access in lane.accesses:
                if access.rule:
                    rules[round(access.s_offset_m, 6)].add(access.rule)
            for s_offset_m, at_place in rules.items():
                if len(at_place) > 1:
                    message = f"lane {lane.id} mixes access rules {', '.join(sorted(at_place))} at one place"
                    s_m = section.s_m + s_offset_m
                    rule = "1.7.0:road.lane.access.no_mix_of_deny_or_allow"
                    yield _broken(rule, road.id, "lane/access", message, s_m, lane.id)


# Geometry


def _lengths(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield parametric cubics whose arc length is not their length, by too little for a warning."""
    curves = geometry.curves
    for piece in np.flatnonzero((curves.kind == CUBIC) & ~curves.is_poly3).tolist():
        short_m = float(curves.length_m[piece] - curves.cubics.length_at[curves.cubic[piece], -1])
        if LENGTH_M < abs(short_m) <= LENGTH_ERROR_M:
            message = f"the curve is {short_m:.2g} m longer or shorter than its length says"
            rule = "length_match" if curves.is_normalized[piece] else "arclength_range"
            road_id, s_m = geometry.roads.id[int(curves.road[piece])], float(curves.start_m[piece])
            name = f"1.7.0:road.geometry.parampoly3.{rule}"
            yield _broken(name, road_id, "planView/geometry", message, s_m)


def _curves(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield parametric cubics that do not start at the origin of their own frame, along it."""
    curves = geometry.curves
    pieces = np.flatnonzero((curves.kind == CUBIC) & ~curves.is_poly3)
    (a_u, b_u), (a_v, b_v) = (
        table[curves.cubic[pieces], :2].T for table in (curves.cubics.u, curves.cubics.v)
    )
    odd = (np.maximum(np.abs(a_u), np.abs(a_v)) > SAME) | (b_u <= 0.0) | (np.abs(b_v) > SAME_SLOPE * b_u)
    for k in np.flatnonzero(odd).tolist():
        piece = int(pieces[k])
        angle_rad = float(np.arctan2(b_v[k], b_u[k]))
        message = f"starts at ({a_u[k]:.3g}, {a_v[k]:.3g}) towards {angle_rad:.3g} rad, not at 0 along u"
        rule = "1.7.0:road.geometry.paramPoly3.valid_parameters"
        road_id, s_m = geometry.roads.id[int(curves.road[piece])], float(curves.start_m[piece])
        yield _broken(rule, road_id, "planView/geometry", message, s_m)


def _redundant(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield records that only go on with the one before."""
    rule = "1.7.0:performance.avoid_redundant_info"
    roads, lanes, curves = geometry.roads, geometry.lanes, geometry.curves
    every = np.arange(len(roads.id))
    for element, table, road in (
        ("elevation", geometry.elevation, every),
        ("superelevation", geometry.superelevation, every),
        ("laneOffset", lanes.lane_offset, every),
        ("lane", lanes.profiles, lanes.road),
    ):
        owner = np.repeat(np.arange(len(road)), np.diff(table.first))
        joined = np.flatnonzero(owner[1:] == owner[:-1])
        continued = restarted(table.coefficients[joined], table.start_m[joined + 1] - table.start_m[joined])
        same = (np.abs(continued - table.coefficients[joined + 1]) < SAME).all(axis=1)
        for row in (joined[same] + 1).tolist():
            lane = int(owner[row])
            lane_id = lanes.key[lane].lane_id if element == "lane" else None
            kind = f"lane/{'border' if lanes.is_border[lane] else 'width'}" if element == "lane" else element
            s_m = float(table.start_m[row])
            message = f"the record at s = {s_m:.6g} m only goes on with the one before"
            yield _broken(rule, roads.id[int(road[lane])], kind, message, s_m, lane_id)
    is_line = (curves.kind == CIRCULAR) & (curves.curvature_per_m == 0.0)
    turn_rad = wrapped(np.diff(curves.heading_rad))
    goes_on = (np.diff(curves.road) == 0) & is_line[1:] & is_line[:-1] & (np.abs(turn_rad) < SAME)
    for piece in (np.flatnonzero(goes_on) + 1).tolist():
        s_m = float(curves.start_m[piece])
        message = f"the line at s = {s_m:.6g} m only goes on with the one before"
        yield _broken(rule, roads.id[int(curves.road[piece])], "planView/geometry", message, s_m)
