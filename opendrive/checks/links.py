"""Defects across links: linked lanes that do not meet, and sides of a link that do not agree."""

from collections.abc import Iterator, Mapping

import numpy as np

from opendrive.checks.joints import Joints, LaneEnds, end_s_m, lane_name, meet
from opendrive.errors import MapWarning, WarningKind
from opendrive.lanes.table import LaneKey, LaneTable
from opendrive.model import ContactPoint, Junction, RoadLink
from opendrive.roads.geometry import NetworkGeometry

GAP_M = 0.05
"""Linked lanes whose nearer borders are further apart are reported."""

WIDTH_STEP_M = 0.05
"""A greater change of width across a link is reported."""

HEIGHT_STEP_M = 0.05
"""A greater step in height across a link is reported."""

TURN_RAD = 0.02
"""A greater kink between linked roads is reported."""

WIDE_M = 1.0
"""Lanes that are less wide where they end carry no traffic on."""

GAP_RULE = "asam.net:xodr:1.7.0:lane_smoothness.contact_point_no_horizontal_gaps"
ACROSS_RULE = "asam.net:xodr:1.4.0:road.lane.link.lanes_across_lane_sections"
CONTACT_RULE = "asam.net:xodr:1.7.0:road.geometry.contact_point"


def link_warnings(
    geometry: NetworkGeometry, joints: Joints, junctions: Mapping[str, Junction]
) -> Iterator[MapWarning]:
    """Yield what is wrong where roads, lanes and junctions are linked."""
    yield from _apart(geometry, joints)
    together = _joined_ends(geometry, joints)
    yield from _reference_lines_apart(geometry, set(together))
    yield from _one_sided_roads(geometry, junctions)
    yield from _one_sided_lanes(geometry)
    yield from _without_lane_links(geometry, together)
    yield from _unlinked_lanes(geometry, joints)
    yield from _junction_members(geometry, junctions)


def _apart(geometry: NetworkGeometry, joints: Joints) -> Iterator[MapWarning]:
    """Yield linked lanes that do not meet."""
    lanes = geometry.lanes
    # A kink is one of the roads: each pair of road ends is named once.
    roads = np.stack(
        [
            lanes.road[joints.first.lane],
            joints.first.at_end,
            lanes.road[joints.second.lane],
            joints.second.at_end,
        ],
        axis=1,
    )
    _, once = np.unique(roads, axis=0, return_index=True)
    turn_rad = np.zeros(len(roads))
    turn_rad[once] = joints.turn_rad[once]
    step_m = np.abs(np.diff(joints.width_m, axis=1)[:, 0])
    for amount, limit, kind, unit, rule, what in (
        (joints.gap_m, GAP_M, WarningKind.LINK_GAP, "m", GAP_RULE, "is {:.3g} m away from"),
        (step_m, WIDTH_STEP_M, WarningKind.LINK_WIDTH, "m", "", "changes its width by {:.3g} m to"),
        (
            joints.height_m,
            HEIGHT_STEP_M,
            WarningKind.LINK_HEIGHT,
            "m",
            "",
            "is {:.3g} m higher or lower than",
        ),
        (turn_rad, TURN_RAD, WarningKind.LINK_ANGLE, "rad", "", "meets at an angle of {:.3g} rad"),
    ):
        for k in np.flatnonzero(amount > limit).tolist():
            a, b = (lanes.key[int(end.lane[k])] for end in (joints.first, joints.second))
            where = "end" if joints.first.at_end[k] else "start"
            message = (
                f"lane {a.lane_id} {what.format(amount[k])} {lane_name(b, a.road_id)}, linked at its {where}"
            )
            yield MapWarning(
                a.road_id,
                "lane/link",
                message,
                kind,
                float(end_s_m(geometry, joints.first)[k]),
                a.lane_id,
                float(amount[k]),
                unit,
                rule,
            )


def _reference_lines_apart(
    geometry: NetworkGeometry, together: set[tuple[int, int, int, int]]
) -> Iterator[MapWarning]:
    """Yield roads that link to each other directly, but by no lanes, and whose reference lines are apart."""
    roads = geometry.roads
    road_of = {road_id: r for r, road_id in enumerate(roads.id)}
    for road, end, link in _road_links(geometry):
        other = road_of.get(link.element_id, -1)
        if link.element_type != "road" or link.contact_point is None or other < 0:
            continue
        if roads.junction_id[road] is not None or roads.junction_id[other] is not None:
            continue
        ends = (road, int(end == "end"), other, int(link.contact_point == "end"))
        if ends in together:
            continue
        together.add(ends[2:] + ends[:2])
        s_m = np.where([ends[1], ends[3]], roads.length_m[[road, other]], 0.0)
        poses = geometry.curves.evaluate(np.array([road, other]), s_m)
        gap_m = float(np.hypot(*np.diff([poses.x_m, poses.y_m], axis=1)[:, 0]))
        if gap_m > GAP_M:
            target = f"the {link.contact_point} of the linked road {link.element_id!r:.40}"
            message = f"the {end} is {gap_m:.3g} m away from {target}"
            yield MapWarning(
                roads.id[road],
                "road/link",
                message,
                WarningKind.LINK_GAP,
                float(s_m[0]),
                None,
                gap_m,
                "m",
                CONTACT_RULE,
            )


def _joined_ends(geometry: NetworkGeometry, joints: Joints) -> set[tuple[int, int, int, int]]:
    """Return the ends of roads that lanes join, both ways round: road, 1 for its end, and the same again."""
    road = geometry.lanes.road
    together = set[tuple[int, int, int, int]]()
    for a, b in ((joints.first, joints.second), (joints.second, joints.first)):
        columns = np.stack([road[a.lane], a.at_end, road[b.lane], b.at_end])
        together.update(map(tuple, np.unique(columns, axis=1).T.tolist()))
    return together


def _road_links(geometry: NetworkGeometry) -> Iterator[tuple[int, ContactPoint, RoadLink]]:
    roads = geometry.roads
    for road, (start, end) in enumerate(zip(roads.predecessor, roads.successor, strict=True)):
        if start is not None:
            yield road, "start", start
        if end is not None:
            yield road, "end", end


def _one_sided_roads(geometry: NetworkGeometry, junctions: Mapping[str, Junction]) -> Iterator[MapWarning]:
    """Yield links between roads whose other side says something else, and links to missing junctions."""
    roads = geometry.roads
    road_of = {road_id: r for r, road_id in enumerate(roads.id)}
    used = _junction_roads(geometry, junctions)
    for road, end, link in _road_links(geometry):
        s_m = float(roads.length_m[road]) if end == "end" else 0.0

        def found(kind: WarningKind, message: str, road: int = road, s_m: float = s_m) -> MapWarning:
            return MapWarning(roads.id[road], "road/link", message, kind, s_m)

        if link.element_type == "junction":
            if link.element_id not in junctions:
                message = f"the {end} links to junction {link.element_id!r:.40}, not in the map"
                yield found(WarningKind.LINK, message)
            elif roads.id[road] not in used[link.element_id]:
                message = (
                    f"the {end} links to junction {link.element_id!r:.40}, which has no way from or to it"
                )
                yield found(WarningKind.JUNCTION, message)
            continue
        other = road_of.get(link.element_id, -1)
        if link.element_type != "road" or link.contact_point is None or other < 0:
            continue
        back = (roads.predecessor if link.contact_point == "start" else roads.successor)[other]
        name = f"the {link.contact_point} of road {link.element_id!r:.40}"
        if back is None:
            yield found(WarningKind.ONE_SIDED_LINK, f"the {end} links to {name}, which links to nothing")
        elif back.element_type == "junction":
            if roads.junction_id[road] != back.element_id and not _is_direct(junctions.get(back.element_id)):
                message = (
                    f"the {end} links to {name}, which links to junction {back.element_id!r:.40}; "
                    "this road is not part of it"
                )
                yield found(WarningKind.CONTRADICTING_LINK, message)
        elif (
            back.element_type == "road"
            and back.s_m is None
            and roads.junction_id[road] is None
            and (back.element_id, back.contact_point) != (roads.id[road], end)
        ):
            named = f"the {back.contact_point} of road {back.element_id!r:.40}"
            yield found(WarningKind.CONTRADICTING_LINK, f"the {end} links to {name}, which links to {named}")


def _is_direct(junction: Junction | None) -> bool:
    return junction is not None and junction.type == "direct"


def _junction_roads(geometry: NetworkGeometry, junctions: Mapping[str, Junction]) -> dict[str, set[str]]:
    """Return the roads outside each junction that a way through it begins or ends at."""
    roads = geometry.roads
    used: dict[str, set[str]] = {}
    for junction_id, junction in junctions.items():
        used[junction_id] = {connection.incoming_road for connection in junction.connections}
        used[junction_id] |= {c.connecting_road for c in junction.connections if c.is_linked}
        used[junction_id] |= {crossing.road_id for crossing in junction.crossing_roads}
    for road, _, link in _road_links(geometry):
        junction_of = roads.junction_id[road]
        if link.element_type == "road" and junction_of in used:
            used[junction_of].add(link.element_id)
    return used


def _one_sided_lanes(geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield links between lanes of a road, or of directly linked roads, that only one side has."""
    roads, lanes = geometry.roads, geometry.lanes
    road_of = {road_id: r for r, road_id in enumerate(roads.id)}
    sections = np.bincount(lanes.sections.road, minlength=len(roads.id)).tolist()
    links = {(road, end): link for road, end, link in _road_links(geometry)}
    sides: tuple[tuple[ContactPoint, tuple[tuple[int, ...], ...]], ...] = (
        ("start", lanes.predecessors),
        ("end", lanes.successors),
    )
    road_of_lane = lanes.road.tolist()
    for lane, key in enumerate(lanes.key):
        for end, linked in sides:
            if not linked[lane]:
                continue
            road = road_of_lane[lane]
            section = key.section + (1 if end == "end" else -1)
            other, at = road, "start" if end == "end" else "end"
            if not 0 <= section < sections[road]:
                link = links.get((road, end))
                if link is None or link.element_type != "road" or link.contact_point is None:
                    continue
                other, at = road_of.get(link.element_id, -1), link.contact_point
                back = links.get((other, link.contact_point))
                # Inside a junction the lanes of the other road say nothing.
                if back is None or back.element_type != "road" or back.element_id != key.road_id:
                    continue
                section = 0 if at == "start" else sections[other] - 1
            answers = lanes.predecessors if at == "start" else lanes.successors
            for lane_id in linked[lane]:
                target = LaneKey(roads.id[other], section, lane_id)
                met = lanes.lane_of_key.get(target)
                if met is not None and key.lane_id not in answers[met]:
                    warning = _unanswered(lanes, lane, end, target, answers[met])
                    if warning is not None:
                        yield warning


def _unanswered(
    lanes: LaneTable, lane: int, end: ContactPoint, target: LaneKey, answers: tuple[int, ...]
) -> MapWarning | None:
    """Return a warning of a lane that links to one which links back to others, or to none."""
    key = lanes.key[lane]
    name = lane_name(target, key.road_id)
    kind, message = WarningKind.ONE_SIDED_LINK, f"lane {key.lane_id} links to {name}, which links to no lane"
    if answers:
        # Where several lanes become one, the one can name only one of them before 1.8.
        named = [lanes.lane_of_key.get(key._replace(lane_id=answer)) for answer in answers]
        own = lanes.successors if end == "end" else lanes.predecessors
        if any(lane_back is not None and target.lane_id in own[lane_back] for lane_back in named):
            return None
        ids = ", ".join(map(str, answers))
        kind = WarningKind.CONTRADICTING_LINK
        message = f"lane {key.lane_id} links to {name}, which links back to {ids}"
    s_m = float((lanes.s_end_m if end == "end" else lanes.s_start_m)[lane])
    return MapWarning(key.road_id, "lane/link", message, kind, s_m, key.lane_id, rule=ACROSS_RULE)


def _without_lane_links(
    geometry: NetworkGeometry, together: set[tuple[int, int, int, int]]
) -> Iterator[MapWarning]:
    """Yield lane sections and linked roads that follow each other by no lane, though both have traffic."""
    roads, lanes = geometry.roads, geometry.lanes
    of_section: dict[tuple[int, int], list[int]] = {}
    driving = (lanes.lane_type == "driving").tolist()
    for lane, road in enumerate(lanes.road.tolist()):
        of_section.setdefault((road, lanes.key[lane].section), []).append(lane)
    last_section = dict(sorted(of_section))
    road_of = {road_id: r for r, road_id in enumerate(roads.id)}

    def is_open(section: tuple[int, int], at: ContactPoint) -> bool:
        """Whether a section has traffic, and none of its lanes a link at an end."""
        members = of_section.get(section, [])
        links = lanes.successors if at == "end" else lanes.predecessors
        return any(driving[lane] for lane in members) and not any(links[lane] for lane in members)

    def unlinked(road: int, s_m: float, what: str) -> MapWarning:
        message = f"no lane is linked to {what}; no traffic passes there"
        return MapWarning(
            roads.id[road], "lane/link", message, WarningKind.ONE_SIDED_LINK, s_m, rule=ACROSS_RULE
        )

    for road, section in sorted(of_section):
        if is_open((road, section), "end") and is_open((road, section + 1), "start"):
            s_m = float(lanes.s_end_m[of_section[road, section][0]])
            yield unlinked(road, s_m, f"the lane section that begins at s = {s_m:.6g} m")
    seen = set[tuple[int, str, int, str]]()
    for road, end, link in _road_links(geometry):
        other = road_of.get(link.element_id, -1)
        if link.element_type != "road" or link.contact_point is None or other < 0:
            continue
        pair = (road, end, other, link.contact_point)
        if pair in seen or road not in last_section or other not in last_section:
            continue
        seen.add((other, link.contact_point, road, end))
        own, beyond = (
            (r, last_section[r] if at == "end" else 0) for r, at in ((road, end), (other, link.contact_point))
        )
        ends = (road, int(end == "end"), other, int(link.contact_point == "end"))
        if ends not in together and is_open(own, end) and is_open(beyond, link.contact_point):
            s_m = float(roads.length_m[road]) if end == "end" else 0.0
            yield unlinked(road, s_m, f"road {link.element_id!r:.40}, which the {end} links to")


def _unlinked_lanes(geometry: NetworkGeometry, joints: Joints) -> Iterator[MapWarning]:
    """Yield driving lanes that go on where other lanes are linked, but are linked to nothing themselves.

    Inside junctions only what has a way need be linked.
    """
    lanes = geometry.lanes
    is_linked = np.zeros((2, len(lanes)), dtype=np.bool_)
    for ends in (joints.first, joints.second):
        is_linked[ends.at_end, ends.lane] = True
    outside = np.array([junction_id is None for junction_id in lanes.junction_id], dtype=np.bool_)
    is_open = outside & (lanes.lane_type == "driving") & ~is_linked
    open_lanes: dict[tuple[int, int], list[int]] = {}
    for at_end, lane in np.argwhere(is_open).tolist():
        open_lanes.setdefault((int(lanes.section[lane]), at_end), []).append(lane)
    first, second = joints.first, joints.second
    columns = (lanes.section[first.lane], first.at_end, lanes.section[second.lane], second.at_end)
    pairs = [
        (a, at_a, b, at_b)
        for section, at_a, beyond, at_b in set(zip(*(column.tolist() for column in columns), strict=True))
        for a in open_lanes.get((section, at_a), ())
        for b in open_lanes.get((beyond, at_b), ())
        if ((lanes.direction[a] > 0) == (at_a == 1)) == ((lanes.direction[b] > 0) == (at_b == 0))
    ]
    rows = np.array(sorted(pairs), dtype=np.int64).reshape(-1, 4).T
    own, other = LaneEnds(rows[0], rows[1]), LaneEnds(rows[2], rows[3])
    for k in np.flatnonzero(meet(geometry, own, other, GAP_M, WIDE_M)).tolist():
        key, other_key = lanes.key[int(own.lane[k])], lanes.key[int(other.lane[k])]
        message = f"lane {key.lane_id} goes on as {lane_name(other_key, key.road_id)}, but no link joins them"
        s_m = float(end_s_m(geometry, own)[k])
        yield MapWarning(
            key.road_id,
            "lane/link",
            message,
            WarningKind.ONE_SIDED_LINK,
            s_m,
            key.lane_id,
            rule=ACROSS_RULE,
        )


def _junction_members(geometry: NetworkGeometry, junctions: Mapping[str, Junction]) -> Iterator[MapWarning]:
    """Yield roads and junctions that do not agree which roads belong to a junction."""
    roads = geometry.roads
    road_of = {road_id: r for r, road_id in enumerate(roads.id)}
    connecting = {
        (junction_id, connection.connecting_road)
        for junction_id, junction in junctions.items()
        for connection in junction.connections
        if not connection.is_linked
    }
    for road_id, junction_id in zip(roads.id, roads.junction_id, strict=True):
        if junction_id is None:
            continue
        if junction_id not in junctions:
            message = f"the road is part of junction {junction_id!r:.40}, not in the map"
            yield MapWarning(road_id, "road", message, WarningKind.JUNCTION)
        elif (junction_id, road_id) not in connecting and junctions[junction_id].type in (
            "default",
            "virtual",
        ):
            message = f"the road is part of junction {junction_id!r:.40}, which has no connection over it"
            yield MapWarning(road_id, "road", message, WarningKind.JUNCTION)
    for junction_id, road_id in sorted(connecting):
        road = road_of.get(road_id)
        if road is not None and roads.junction_id[road] != junction_id:
            message = f"the connecting road {road_id!r:.40} is not part of the junction"
            yield MapWarning(junction_id, "junction/connection", message, WarningKind.JUNCTION)
    for junction_id, junction in junctions.items():
        for connection in junction.connections:
            road = road_of.get(connection.connecting_road)
            if road is None or connection.is_linked or connection.type == "virtual":
                continue
            at_start = connection.contact_point == "start"
            link = (roads.predecessor if at_start else roads.successor)[road]
            named = None if link is None else link.element_id
            if named != connection.incoming_road:
                message = (
                    f"connection {connection.id!r:.40} meets road {connection.incoming_road!r:.40} at the "
                    f"{connection.contact_point} of road {connection.connecting_road!r:.40}, which links to "
                    + (f"{named!r:.40}" if named else "nothing")
                )
                rule = "start_along_linkage" if at_start else "end_opposite_linkage"
                yield MapWarning(
                    junction_id,
                    "junction/connection",
                    message,
                    WarningKind.CONTRADICTING_LINK,
                    rule=f"asam.net:xodr:1.7.0:junctions.connection.{rule}",
                )
