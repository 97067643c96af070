from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import RoadNetwork, load_map
from smartmot.maps.follow import route_along
from smartmot.maps.route import Route, RouteError, route_ahead, route_from_lanes

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"

TOWN = Path(__file__).parents[4] / "shared" / "opendrive" / "maps" / "Town03.xodr"


@cache
def _network(name: str) -> RoadNetwork:
    return load_map(MAPS / f"{name}.xodr")


@cache
def _crossing(*roads: str) -> Route:
    """Route over the intersection through the driving lanes of these roads."""
    network = _network("urban_intersection")
    ids = {"1": -1, "2": -1, "3": -1, "4": -1} | dict.fromkeys(("13", "12", "14", "24"), -1)
    return route_from_lanes(network, [network.lane_index_of((r, 0, ids[r])) for r in roads])


def _driving(network: RoadNetwork) -> list[int]:
    return np.flatnonzero(network.lanes.lane_type == "driving").tolist()


def _walk(network: RoadNetwork, start: int, turns: list[int]) -> list[int]:
    """A chain of lanes: at every fork one of the successors, until the map ends."""
    lanes = [start]
    for turn in turns:
        following = network.successors(lanes[-1])
        if not following:
            break
        lanes.append(following[turn % len(following)])
    return lanes


def _way(route: Route, spacing_m: float, offset_m: float, margin_m: float = 0.0) -> np.ndarray:
    """(K, 2) points beside a route's centre line, from a margin after its start to one before its end."""
    length = route.length_m - 2 * margin_m
    stations = margin_m + np.linspace(0.0, length, max(2, round(length / spacing_m) + 1))
    return np.array([route.pose(float(s), offset_m)[:2] for s in stations])


@settings(max_examples=60, deadline=None)
@given(
    name=st.sampled_from(["urban_street", "urban_street_parking", "urban_bend", "urban_intersection"]),
    pick=st.integers(0, 10_000),
    turns=st.lists(st.integers(0, 2), min_size=2, max_size=2),
    spacing=st.floats(0.5, 2.5),
    offset=st.floats(-0.6, 0.6),
)
def test_a_way_along_lanes_gives_these_lanes(
    name: str, pick: int, turns: list[int], spacing: float, offset: float
) -> None:
    """The centre line of any chain of lanes, or a line beside it, is the route over these lanes."""
    network = _network(name)
    starts = [lane for lane in _driving(network) if network.lanes.junction_id[lane] is None]
    lanes = _walk(network, starts[pick % len(starts)], turns)
    known = route_from_lanes(network, lanes)
    assert route_along(network, _way(known, spacing, offset, margin_m=3.0)).lanes == tuple(lanes)


@pytest.mark.parametrize("name", ["Town01", "Town03", "Town04"])
def test_ways_on_public_maps_stay_in_their_lanes(name: str) -> None:
    """Junction lanes lie on one another there: whatever is chosen, every point is in a lane of the route."""
    path = TOWN.with_stem(name)
    if not path.is_file():
        pytest.skip(f"reference map is absent: {path}")
    network = load_map(path)
    rng = np.random.default_rng(4)
    starts = [
        lane
        for lane in _driving(network)
        if network.lanes.junction_id[lane] is None and network.lanes.s_end_m[lane] > 20.0
    ]
    for lane in rng.choice(starts, 20).tolist():
        lanes = _walk(network, lane, rng.integers(0, 4, 3).tolist())
        way = _way(route_from_lanes(network, lanes), 2.0, 0.0, margin_m=3.0)
        found = route_along(network, way)
        assert found.lanes[0] == lane
        beside = [abs(found.project(*point)[1]) for point in way]
        assert max(beside) < 1.0, (name, lanes, found.lanes)


def test_a_way_goes_on_straight_where_it_is_asked_to() -> None:
    network = _network("urban_intersection")
    across = _crossing("1", "13", "3")
    first = across.lanes[0]
    way = _way(route_from_lanes(network, [first]), 2.0, 0.0, margin_m=20.0)
    assert route_along(network, way).lanes == (first,)
    # its last point is 20 m before the end of the first lane, the junction is 24 m wide
    assert route_along(network, way, ahead_m=19.0).lanes == (first,)
    assert route_along(network, way, ahead_m=30.0).lanes == across.lanes[:2]
    assert route_along(network, way, ahead_m=60.0).lanes == across.lanes
    last = across.lanes[-1]
    back = _way(route_from_lanes(network, [last]), 2.0, 0.0, margin_m=20.0)
    assert route_along(network, back, behind_m=60.0).lanes == across.lanes


def test_a_way_against_the_traffic_across_or_beside_it_is_on_no_lane() -> None:
    network = _network("urban_street")
    way = _way(route_from_lanes(network, [network.lane_index_of(("1", 0, -1))]), 2.0, 0.0)
    for wrong in (
        way[::-1],
        way - np.array([0.0, 5.0]),
        np.column_stack((np.full(9, 300.0), np.linspace(-4, 0, 9))),
    ):
        with pytest.raises(RouteError, match="the ego's way runs on no driving lane of the map"):
            route_along(network, wrong)


def test_a_route_ends_where_the_way_leaves_the_lanes() -> None:
    """Over the kerb: it does not come back."""
    network = _network("urban_street")
    lane = network.lane_index_of(("1", 0, -1))
    x = np.arange(50.0, 400.0, 2.0)
    leaving = np.column_stack((x, np.where(x < 250.0, -1.75, -9.0)))
    assert route_along(network, leaving).lanes == (lane,)
    late = np.column_stack((x, np.where(x < 120.0, -9.0, -1.75)))
    assert route_along(network, late).lanes == (lane,)


TWO_LANES = MAPS.parent / "scenes" / "maps" / "street_two_lanes.xodr"

MIDDLE = {-2: -5.25, -1: -1.75, 1: 1.75, 2: 5.25}

"""Middles of the lanes of the street, which runs along x and is 500 m long."""


@cache
def _two_lanes() -> RoadNetwork:
    return load_map(TWO_LANES)


def _ramp(x: np.ndarray, begin: float, end: float) -> np.ndarray:
    """0 before, 1 after, a cosine between."""
    return (1 - np.cos(np.pi * np.clip((x - begin) / (end - begin), 0.0, 1.0))) / 2


def _changing(first: int, second: int, begin: float, end: float, aside: float = 0.0) -> np.ndarray:
    """A way along the street that changes lanes between two places on its way, points 2 m apart."""
    along = np.arange(10.0, 491.0, 2.0)
    y = MIDDLE[first] + (MIDDLE[second] - MIDDLE[first]) * _ramp(along, begin, end) + aside
    return np.column_stack((along if first < 0 else 500.0 - along, y))


@pytest.mark.parametrize(("first", "second"), [(-2, -1), (-1, -2), (2, 1), (1, 2)])
def test_a_lane_change_is_part_of_the_route(first: int, second: int) -> None:
    network = _two_lanes()
    lanes = tuple(network.lane_index_of(("1", 0, lane)) for lane in (first, second))
    way = _changing(first, second, 200.0, 240.0)
    route = route_along(network, way, ahead_m=100.0, behind_m=50.0)
    assert route.lanes == lanes
    # the first lane is on the route until the change ends, the second from where it begins
    before, after = route.strips
    assert route.entry_m[0] == 0.0
    assert before.length_m == pytest.approx(240.0, abs=4.0)
    assert route.entry_m[1] == pytest.approx(200.0, abs=4.0)
    # the path is the street's length, and as much more as the cosine is longer than its base
    fine = np.linspace(200.0, 240.0, 4001)
    longer = np.hypot(np.diff(fine), np.diff(3.5 * _ramp(fine, 200.0, 240.0))).sum() - 40.0
    assert route.length_m == pytest.approx(500.0 + longer, abs=0.05)
    assert route.entry_m[1] + after.length_m == pytest.approx(route.length_m, abs=1e-6)
    # it runs in the middle of the lanes, and as the way over the change
    assert np.abs(route.place(way)[1]).max() < 0.06
    steps = np.hypot(*np.diff(route.center_m, axis=0).T)
    np.testing.assert_allclose(np.diff(route.station_m), steps, atol=1e-9)


@pytest.mark.parametrize("aside", [0.5, -0.5])
@pytest.mark.parametrize(("first", "second"), [(-2, -1), (1, 2)])
def test_a_way_beside_the_middles_stays_beside_the_path(first: int, second: int, aside: float) -> None:
    network = _two_lanes()
    way = _changing(first, second, 200.0, 240.0, aside)
    route = route_along(network, way, ahead_m=100.0, behind_m=50.0)
    assert route.lanes == tuple(network.lane_index_of(("1", 0, lane)) for lane in (first, second))
    station, offset = route.place(way)
    assert (np.diff(station) > 0.0).all()
    left = aside if first < 0 else -aside
    np.testing.assert_allclose(offset[[0, -1]], left, atol=1e-9)
    assert np.abs(offset).max() < 0.55
    assert np.hypot(*np.diff(route.center_m, axis=0).T).min() > 1e-6


@settings(max_examples=60, deadline=None)
@given(
    start=st.sampled_from([-2, -1, 1, 2]),
    places=st.lists(st.floats(40.0, 70.0), min_size=2, max_size=5),
    length=st.floats(15.0, 35.0),
    data=st.data(),
)
def test_any_number_of_changes(start: int, places: list[float], length: float, data: st.DataObject) -> None:
    """Lanes as driven, one smooth path, and every place of the path in a strip of the route."""
    network, other = _two_lanes(), {-2: -1, -1: -2, 1: 2, 2: 1}
    changes = np.cumsum(places)
    along = np.arange(10.0, 491.0, data.draw(st.floats(0.5, 2.5)))
    y, lanes = np.full_like(along, MIDDLE[start]), [start]
    for begin in changes:
        y += (MIDDLE[other[lanes[-1]]] - MIDDLE[lanes[-1]]) * _ramp(along, begin, begin + length)
        lanes.append(other[lanes[-1]])
    way = np.column_stack((along if start < 0 else 500.0 - along, y))
    route = route_along(network, way)
    assert route.lanes == tuple(network.lane_index_of(("1", 0, lane)) for lane in lanes)
    assert np.abs(route.place(way)[1]).max() < 0.06
    heading = np.unwrap(np.arctan2(*np.diff(route.center_m, axis=0).T[::-1]))
    # a cosine of 3.5 m over 15 m has a slope of 0.37 and turns by 0.077 per metre at most
    assert np.abs(np.diff(heading)).max() < 0.25
    for station in np.linspace(0.0, route.length_m, 200):
        x, y_m, _ = route.pose(float(station))
        inside = [
            -1e-6 <= station - entry <= strip.length_m + 0.6
            and abs(np.interp(station - entry, strip.station_m, strip.center_m[:, 1]) - y_m) <= 1.76
            for strip, entry in zip(route.strips, route.entry_m, strict=True)
        ]
        assert any(inside), (station, x, y_m)


def test_a_change_begun_before_the_way_or_ended_after_it() -> None:
    network = _two_lanes()
    lanes = tuple(network.lane_index_of(("1", 0, lane)) for lane in (-2, -1))
    whole = _changing(-2, -1, 200.0, 240.0)
    for part in (whole[whole[:, 0] > 216.0], whole[whole[:, 0] < 226.0]):
        route = route_along(network, part, 100.0, 50.0)
        assert route.lanes == lanes
        assert (np.diff(route.station_m) > 0.0).all()


def test_a_change_into_oncoming_traffic_ends_the_route() -> None:
    network = _network("urban_street")
    x = np.arange(50.0, 400.0, 2.0)
    overtaking = np.column_stack((x, -1.75 + 3.5 * _ramp(x, 200.0, 240.0)))
    assert route_along(network, overtaking).lanes == (network.lane_index_of(("1", 0, -1)),)


def test_changes_over_many_lane_sections() -> None:
    """On a motorway whose lanes end and begin at every section, wherever a change falls."""
    path = TOWN.with_stem("Town04")
    if not path.is_file():
        pytest.skip(f"reference map is absent: {path}")
    network = load_map(path)
    changed = 0
    for lane in _driving(network):
        long = network.lanes.s_end_m[lane] - network.lanes.s_start_m[lane] > 30.0
        if not long or network.lanes.junction_id[lane] is not None or network.left_neighbour(lane) is None:
            continue
        own = route_ahead(network, lane, float(network.lanes.s_start_m[lane]), 200.0)
        stations = np.arange(5.0, min(own.length_m, 200.0), 2.0)
        width = float(network.lane_width(lane, own.strips[0].s_m[:1])[0])
        for begin in (10.0, own.strips[0].length_m - 22.0):
            aside = width * _ramp(stations, begin, begin + 40.0)
            way = np.array(
                [own.pose(s, a)[:2] for s, a in zip(stations.tolist(), aside.tolist(), strict=True)]
            )
            try:
                found = route_along(network, way)
            except RouteError:
                continue
            if len(set(found.lanes)) == len(found.lanes) and any(
                b not in network.successors(a) for a, b in zip(found.lanes, found.lanes[1:], strict=False)
            ):
                changed += 1
                hits = network.locate(way)  # where lanes fork or end, some ways leave them
                there = np.unique(hits.point[np.isin(hits.lane, found.lanes)])
                assert np.abs(found.place(way[there])[1]).max() < 1.9, (lane, begin)
    assert changed > 20
