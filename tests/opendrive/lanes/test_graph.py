from itertools import pairwise

import numpy as np
import pytest

from opendrive import LaneKey, RouteNotFoundError

# libcarla does not know direct junctions (ASAM OpenDRIVE 1.7 and later) and leaves their edges out.
WITH_DIRECT_JUNCTION = {"esmini_soderleden"}
# Nor does it walk from the end of a road into the start of the same road.
PARTLY_WALKED = {*WITH_DIRECT_JUNCTION, "esmini_circle_300m"}
# These marks carry "increase" or "decrease". libcarla takes them for right and left of the lane; the
# standard means towards greater and lesser lane ids.
ONE_WAY_MARKS = {"BrokenSolid", "SolidBroken"}


def keyed(network, lanes):
    return {tuple(network.lanes.key[i]) for i in lanes}


def lane_at(network, road, lane_id, s_m):
    sections = network.roads[str(road)].record.sections
    section = max(k for k, record in enumerate(sections) if k == 0 or record.s_m <= s_m + 1e-9)
    return network.lane_index_of(LaneKey(str(road), section, lane_id))


def test_topology(network_of, oracle, map_name):
    network, rows = network_of(map_name), oracle(map_name, "topology")["rows"]
    lanes = network.lanes
    expected = {(LaneKey(str(a), b, c), LaneKey(str(d), e, f)) for a, b, c, _, d, e, f, _ in rows}
    driving = lanes.lane_type == "driving"
    found = {
        (lanes.key[i], lanes.key[j])
        for i in range(len(lanes))
        for j in network.successors(i)
        if driving[i] and driving[j]
    }
    # A lane without successor is listed as its own successor, and so is one that runs in a circle.
    expected = {(a, b) for a, b in expected if a != b or (a, b) in found}
    assert expected <= found
    if map_name in WITH_DIRECT_JUNCTION:
        junctions = network.model.junctions.values()
        ways = {
            (c.incoming_road, c.connecting_road)
            for j in junctions
            if j.type == "direct"
            for c in j.connections
        }
        assert {(a.road_id, b.road_id) for a, b in found - expected} == ways
    else:
        assert found == expected


def test_predecessors_mirror_successors(network_of, map_name):
    network = network_of(map_name)
    forward = {(i, j) for i in range(len(network.lanes)) for j in network.successors(i)}
    backward = {(i, j) for j in range(len(network.lanes)) for i in network.predecessors(j)}
    assert forward == backward


def test_neighbours(network_of, oracle, map_name):
    network = network_of(map_name)
    for row in oracle(map_name, "succ")["rows"]:
        lane = lane_at(network, *row[:3])
        for neighbour, expected in ((network.left_neighbour, row[7]), (network.right_neighbour, row[8])):
            found = neighbour(lane)
            key = None if found is None else network.lanes.key[found]
            assert (None if key is None else [int(key.road_id), key.lane_id]) == expected, row[:3]


def test_lane_changes(network_of, oracle, map_name):
    network = network_of(map_name)
    compared = 0
    for row in oracle(map_name, "succ")["rows"]:
        lane = lane_at(network, *row[:3])
        start, end = network.lanes.s_start_m[lane], network.lanes.s_end_m[lane]
        s = min(max(row[2], start), end)
        permission = row[9].lower()
        for side, neighbour, mark in (("left", row[7], row[10]), ("right", row[8], row[11])):
            if neighbour is None:
                assert not network.lane_change(lane, s, side)
            elif mark is None or mark[0] not in ONE_WAY_MARKS:
                assert network.lane_change(lane, s, side) == (permission in (side, "both")), (row[:3], side)
                compared += 1
    assert compared or all(row[7] is None and row[8] is None for row in oracle(map_name, "succ")["rows"])


@pytest.mark.parametrize("backward", [False, True], ids=["next", "previous"])
def test_five_metres_on(network_of, oracle, map_name, backward):
    """Lanes and s that libcarla reaches, from all its places in one call."""
    network, rows = network_of(map_name), oracle(map_name, "succ")["rows"]
    lanes = network.lanes
    lane = np.array([lane_at(network, *row[:3]) for row in rows])
    s = np.clip([row[2] for row in rows], lanes.s_start_m[lane], lanes.s_end_m[lane])
    places = network.places_ahead(lane, s, 5.0, backward)
    to_edge = np.minimum(places.s_m - lanes.s_start_m[places.lane], lanes.s_end_m[places.lane] - places.s_m)
    compared = 0
    for k, row in enumerate(rows):
        mine = np.flatnonzero(places.start == k)
        # Within a centimetre of the end of a lane both lanes are right, and dead ends have no answer.
        if not mine.size or to_edge[mine].min() < 0.01:
            continue
        reached = {
            (lanes.key[i].road_id, lanes.key[i].lane_id): at
            for i, at in zip(places.lane[mine].tolist(), places.s_m[mine].tolist(), strict=True)
        }
        expected = {(str(road), lane_id): at for road, lane_id, at in row[6 if backward else 5]}
        if map_name in PARTLY_WALKED:
            assert expected.keys() <= reached.keys(), row[:3]
        else:
            assert expected.keys() == reached.keys(), row[:3]
        for name, at in expected.items():
            assert reached[name] == pytest.approx(at, abs=0.02), (row[:3], name)
        compared += 1
    assert compared > 0.3 * len(rows)


def two_roads(text, link_a='<successor elementType="road" elementId="b" contactPoint="start"/>', rule=""):
    width = text.record("width", 3.0)
    right = text.lane(-1, '<link><successor id="-1"/></link>' + width)
    left = text.lane(1, '<link><successor id="1"/></link>' + width)
    first = text.road(
        sections=text.section(left=left, right=right), road_id="a", link=link_a, attributes=rule
    )
    second = text.road(
        '<geometry s="0" x="200" y="5" hdg="0.3" length="50"><line/></geometry>',
        road_id="b",
        length=50.0,
        attributes=rule,
    )
    return first, second


@pytest.mark.parametrize("rule", ["", 'rule="LHT"'])
def test_a_link_leads_both_ways_in_travel_direction(load, text, rule):
    network = load(*two_roads(text, rule=rule))
    right_a, left_a, right_b, left_b = (
        network.lane_index_of(LaneKey(road, 0, lane)) for road in "ab" for lane in (-1, 1)
    )
    if rule:
        right_a, left_a, right_b, left_b = left_a, right_a, left_b, right_b
    assert network.successors(right_a) == (right_b,)
    assert network.successors(right_b) == ()
    assert network.successors(left_b) == (left_a,)
    assert network.predecessors(left_a) == (left_b,)
    assert network.left_neighbour(right_a) == (None if rule else left_a)
    assert network.right_neighbour(right_a) == (left_a if rule else None)


def test_links_to_nowhere_are_noted(load, text):
    first, _ = two_roads(text)
    messages = [warning.message for warning in load(first).warnings]
    assert messages == ["links to road 'b', not in the map"]


def test_shortest_route(network_of):
    network = network_of("Town01")
    lanes = network.lanes
    start = network.lane_index_of(LaneKey("9", 0, 1))
    goal = next(
        i for i in range(len(lanes)) if lanes.lane_type[i] == "driving" and lanes.key[i].road_id == "15"
    )
    route = network.shortest_route(start, goal)
    assert (route[0], route[-1]) == (start, goal)
    assert all(b in network.successors(a) for a, b in pairwise(route))
    assert network.shortest_route(start, start) == (start,)


def test_a_lane_that_cannot_be_reached_is_refused(load, text):
    network = load(*two_roads(text, link_a=""))
    with pytest.raises(RouteNotFoundError, match=r"\('a', 0, -1\) to lane \('b', 0, -1\)"):
        network.shortest_route(
            network.lane_index_of(LaneKey("a", 0, -1)), network.lane_index_of(LaneKey("b", 0, -1))
        )


def test_the_shorter_of_two_ways_is_taken(load, text):
    """Two connecting roads lead through a junction to the same road."""
    width = text.record("width", 3.0)
    through = text.lane(-1, '<link><predecessor id="-1"/><successor id="-1"/></link>' + width)
    link = (
        '<predecessor elementType="road" elementId="in" contactPoint="end"/>'
        '<successor elementType="road" elementId="out" contactPoint="start"/>'
    )
    connections = "".join(
        f'<connection id="{k}" incomingRoad="in" connectingRoad="{road}" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        for k, road in enumerate(("long", "short"))
    )
    network = load(
        text.road(road_id="in", link='<successor elementType="junction" elementId="J"/>'),
        text.road(road_id="out", link='<predecessor elementType="junction" elementId="J"/>'),
        text.road(road_id="long", junction="J", link=link, sections=text.section(right=through)),
        text.road(
            road_id="short", junction="J", link=link, length=20.0, sections=text.section(right=through)
        ),
        f'<junction id="J" name="">{connections}</junction>',
    )
    start, goal = (network.lane_index_of(LaneKey(road, 0, -1)) for road in ("in", "out"))
    route = [network.lanes.key[i].road_id for i in network.shortest_route(start, goal)]
    assert route == ["in", "short", "out"]
    assert keyed(network, network.successors(start)) == {("long", 0, -1), ("short", 0, -1)}
    assert network.lanes.junction_id[network.successors(start)[0]] == "J"


def test_connections_without_lane_links_join_equal_ids(load, text):
    width = text.record("width", 3.0)
    lanes = text.section(left=text.lane(1, width), right=text.lane(-1, width) + text.lane(-2, width))
    network = load(
        text.road(road_id="in", sections=lanes, link='<successor elementType="junction" elementId="J"/>'),
        text.road(road_id="inside", junction="J", sections=text.section(right=text.lane(-1, width))),
        '<junction id="J">'
        '<connection incomingRoad="in" connectingRoad="inside" contactPoint="start"/></junction>',
    )
    first, second = (network.lane_index_of(LaneKey("in", 0, i)) for i in (-1, -2))
    assert keyed(network, network.successors(first)) == {("inside", 0, -1)}
    assert network.successors(second) == ()


def test_direct_junction(network_of):
    """Three lanes of road 1 go on as two lanes of road 2 and one of road 3."""
    network = network_of("esut_direct_junction_simple")
    ways = {-1: {("2", 0, -1)}, -2: {("2", 0, -2)}, -3: {("3", 0, -1)}, -4: set()}
    for lane_id, expected in ways.items():
        lane = network.lane_index_of(LaneKey("1", 0, lane_id))
        assert keyed(network, network.successors(lane)) == expected


MARK = '<roadMark sOffset="{}" type="solid" {}/>'


@pytest.mark.parametrize(
    ("permission", "to_left", "to_right"),
    [("increase", True, False), ("decrease", False, True), ("both", True, True), ("none", False, False)],
)
def test_lane_change_follows_lane_ids(load, text, permission, to_left, to_right):
    width = text.record("width", 3.0)
    mark = MARK.format(0, f'laneChange="{permission}"')
    network = load(
        text.road(
            sections=text.section(
                left=text.lane(1, width + mark) + text.lane(2, width),
                center=mark,
                right=text.lane(-1, width + mark) + text.lane(-2, width),
            )
        )
    )
    right, outer_right, left, outer_left = (network.lane_index_of(LaneKey("r", 0, i)) for i in (-1, -2, 1, 2))
    # Along the road's s: to the left means to a greater id.
    assert network.lane_change(outer_right, 5.0, "left") == to_left
    assert network.lane_change(right, 5.0, "right") == to_right
    assert network.lane_change(right, 5.0, "left") == to_left
    # Against s, left in travel direction is towards lesser ids.
    assert network.lane_change(left, 5.0, "left") == to_right
    assert network.lane_change(left, 5.0, "right") == to_left
    assert network.lane_change(outer_left, 5.0, "left") == to_right
    assert not network.lane_change(outer_left, 5.0, "right")


def test_marks_hold_from_where_they_start_and_allow_changes_by_default(load, text):
    width = text.record("width", 3.0)
    marks = MARK.format(0, "") + MARK.format(40, 'laneChange="none"')
    network = load(
        text.road(sections=text.section(right=text.lane(-1, width + marks) + text.lane(-2, width)))
    )
    lane = network.lane_index_of(LaneKey("r", 0, -2))
    assert network.lane_change(lane, 39.9, "left")
    assert not network.lane_change(lane, 40.0, "left")
    assert not network.lane_change(lane, 10.0, "right")


def test_the_ranges_of_lane_changes_agree_with_the_single_answers(network_of, map_name):
    network = network_of(map_name)
    lanes = network.lanes
    for lane in range(0, len(lanes), max(1, len(lanes) // 40)):
        low, high = float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])
        for side in ("left", "right"):
            ranges = network.lane_change_ranges(lane, side)
            for s in low + (high - low) * np.array([0.013, 0.317, 0.711, 0.986]):
                inside = bool(((ranges[:, 0] < s) & (s < ranges[:, 1])).any())
                assert inside == network.lane_change(lane, s, side), (lanes.key[lane], s, side)


def virtual_junction(text):
    """A driveway: road "in" leaves the main road at 40 m, road "out" joins it at 60 m."""
    lane = text.lane(
        -1, '<link><predecessor id="-1"/><successor id="-1"/></link>' + text.record("width", 3.0)
    )
    one_lane = text.section(right=lane)
    east = '<geometry s="0" x="{}" y="{}" hdg="{}" length="{}"><line/></geometry>'
    return (
        text.road(east.format(0, 0, 0, 100), sections=one_lane, road_id="main"),
        text.road(
            east.format(40, 0, -0.5, 20),
            sections=one_lane,
            road_id="in",
            length=20.0,
            junction="J",
            link='<predecessor elementType="road" elementId="main" elementS="40" elementDir="+"/>'
            '<successor elementType="road" elementId="yard" contactPoint="start"/>',
        ),
        text.road(
            east.format(42, -30, 0.5, 30),
            sections=one_lane,
            road_id="out",
            length=30.0,
            junction="J",
            link='<predecessor elementType="road" elementId="yard" contactPoint="end"/>'
            '<successor elementType="road" elementId="main" elementS="60" elementDir="+"/>',
        ),
        text.road(
            east.format(60, -10, 0.0, 50),
            sections=one_lane,
            road_id="yard",
            length=50.0,
            link='<predecessor elementType="junction" elementId="J"/>'
            '<successor elementType="junction" elementId="J"/>',
        ),
        '<junction id="J" type="virtual" mainRoad="main" sStart="40" sEnd="60" orientation="+">'
        '<connection id="0" incomingRoad="main" connectingRoad="in" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection>'
        '<connection id="1" incomingRoad="yard" connectingRoad="out" contactPoint="start">'
        '<laneLink from="-1" to="-1"/></connection></junction>',
    )


def test_virtual_junctions_meet_the_main_road_on_its_way(load, text):
    network = load(*virtual_junction(text))
    main, into, out, yard = (
        network.lane_index_of(LaneKey(road, 0, -1)) for road in ("main", "in", "out", "yard")
    )
    assert network.successors(main) == (into,)
    assert network.successors(out) == (main,)
    assert network.successors(yard) == (out,)
    places = network.places_ahead(main, 30.0, 20.0)
    assert list(zip(places.lane.tolist(), places.s_m.tolist(), strict=True)) == [(main, 50.0), (into, 10.0)]
    # Behind the turning there is one way only.
    assert network.places_ahead(main, 41.0, 5.0).lane.tolist() == [main]
    back = network.places_ahead(main, 65.0, 10.0, backward=True)
    assert list(zip(back.lane.tolist(), back.s_m.tolist(), strict=True)) == [(main, 55.0), (out, 25.0)]
    # Out of the yard, into the main road at 60 m, on to 70 m.
    route = network.route(yard, 45.0, main, 70.0)
    assert route.lane.tolist() == [yard, out, main]
    assert route.s_from_m.tolist() == [45.0, 0.0, 60.0]
    assert route.length_m == pytest.approx(5.0 + 30.0 + 10.0)
    assert network.route(main, 10.0, yard, 5.0).length_m == pytest.approx(30.0 + 20.0 + 5.0)
    with pytest.raises(RouteNotFoundError):
        network.route(main, 45.0, yard, 5.0)


@pytest.mark.parametrize(("direction", "along"), [("standard", 1), ("both", 1), ("reversed", -1)])
def test_lanes_of_other_direction(load, text, direction, along):
    """A reversed lane is entered where others are left; one for both directions is used as a standard one."""
    attribute = f'type="driving" direction="{direction}"'
    network = load(*(road.replace('type="driving"', attribute) for road in two_roads(text)))
    right_a, right_b = (network.lane_index_of(LaneKey(road, 0, -1)) for road in "ab")
    assert network.lanes.direction[right_a] == along
    first, second = (right_a, right_b) if along > 0 else (right_b, right_a)
    assert network.successors(first) == (second,)
    assert network.successors(second) == ()
    assert network.predecessors(second) == (first,)
    heading = float(network.center_line(right_a, 10.0)[3])
    assert np.cos(heading - 0.3) == pytest.approx(along)


def test_a_reversed_lane_does_not_lead_into_one_that_comes_towards_it(load, text):
    first, second = two_roads(text)
    network = load(first.replace('type="driving"', 'type="driving" direction="reversed"'), second)
    right_a, right_b = (network.lane_index_of(LaneKey(road, 0, -1)) for road in "ab")
    assert network.successors(right_a) == network.successors(right_b) == ()
