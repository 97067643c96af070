import networkx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import LaneKey, LaneNotFoundError, PositionError, RouteNotFoundError

WIDTH = '<width sOffset="0" a="3" b="0" c="0" d="0"/>'


def three_lanes(text, marks=""):
    """100 m of road with lanes -1, -2, -3; the mark between -1 and -2 is `marks`."""
    right = text.lane(-1, WIDTH + marks) + text.lane(-2, WIDTH) + text.lane(-3, WIDTH, "shoulder")
    return text.road(sections=text.section(right=right))


def test_a_route_along_one_lane(load, text):
    network = load(three_lanes(text))
    route = network.route(0, 10.0, 0, 60.0)
    assert (route.lane.tolist(), route.length_m) == ([0], 50.0)
    assert (route.s_from_m.tolist(), route.s_to_m.tolist()) == ([10.0], [60.0])
    with pytest.raises(RouteNotFoundError, match=r"\('r', 0, -1\)"):
        network.route(0, 60.0, 0, 10.0)


def test_a_route_changes_lanes_where_the_mark_allows_it(load, text):
    marks = '<roadMark sOffset="0" type="solid" laneChange="none"/><roadMark sOffset="50" type="broken"/>'
    network = load(three_lanes(text, marks))
    route = network.route(0, 10.0, 1, 90.0)
    assert route.lane.tolist() == [0, 1]
    assert route.is_change.tolist() == [False, True]
    assert route.length_m == pytest.approx(80.0)
    # Up to the goal there is no gap in the solid line.
    with pytest.raises(RouteNotFoundError):
        network.route(0, 10.0, 1, 45.0)
    # A shoulder is not changed into, and without lane changes there is no way.
    with pytest.raises(RouteNotFoundError):
        network.route(0, 10.0, 2, 90.0)
    with pytest.raises(RouteNotFoundError):
        network.route(0, 10.0, 1, 90.0, lane_change_cost_m=np.inf)
    assert network.route(0, 10.0, 2, 90.0, lane_types=("driving", "shoulder")).is_change.sum() == 2


def test_bad_arguments_are_refused(load, text):
    network = load(three_lanes(text))
    with pytest.raises(PositionError, match="lane_change_cost_m: expected a positive"):
        network.route(0, 10.0, 1, 90.0, lane_change_cost_m=0.0)
    with pytest.raises(PositionError, match="within"):
        network.route(0, 101.0, 1, 90.0)
    with pytest.raises(LaneNotFoundError):
        network.route(0, 10.0, 3, 90.0)
    with pytest.raises(PositionError, match="no negative"):
        network.places_ahead(0, 10.0, -1.0)
    with pytest.raises(PositionError, match="within"):
        network.places_ahead([0, 1], [10.0, 200.0], 5.0)
    with pytest.raises(LaneNotFoundError):
        network.places_ahead([0, 5], 10.0, 5.0)


def test_places_ahead_ends_where_the_road_does(load, text):
    network = load(three_lanes(text))
    places = network.places_ahead([0, 1, 2], [10.0, 50.0, 99.0], 30.0)
    assert places.start.tolist() == [0, 1]
    assert places.s_m.tolist() == [40.0, 80.0]
    assert network.places_ahead(0, 10.0, 5.0, backward=True).s_m.tolist() == [5.0]
    assert network.places_ahead(0, 10.0, 0.0).s_m.tolist() == [10.0]
    assert network.places_ahead(np.empty(0, dtype=int), np.empty(0), 5.0).lane.size == 0


def test_going_on_and_back_again(network_of):
    """Every place ahead has the start among the places behind it."""
    network = network_of("Town03")
    lanes = network.lanes
    rng = np.random.default_rng(11)
    lane = rng.choice(np.flatnonzero(lanes.lane_type == "driving"), 60)
    s = lanes.s_start_m[lane] + (lanes.s_end_m[lane] - lanes.s_start_m[lane]) * rng.random(60)
    ahead = network.places_ahead(lane, s, 80.0)
    behind = network.places_ahead(ahead.lane, ahead.s_m, 80.0, backward=True)
    assert ahead.lane.size > 60
    for k in range(ahead.lane.size):
        mine = behind.start == k
        same = (behind.lane[mine] == lane[ahead.start[k]]) & (
            np.abs(behind.s_m[mine] - s[ahead.start[k]]) < 1e-6
        )
        assert same.any()


@settings(max_examples=25, deadline=None)
@given(seed=st.integers(0, 10_000), change_cost=st.sampled_from([1.0, 50.0, np.inf]))
def test_routes_cost_what_networkx_says(network_of, seed, change_cost):
    """Against Dijkstra of networkx on a graph with a node per lane entry, exit and place of interest."""
    network = network_of("esmini_multi_intersections")
    lanes = network.lanes
    rng = np.random.default_rng(seed)
    driving = np.flatnonzero(lanes.lane_type == "driving")
    start, goal = rng.choice(driving, 2).tolist()
    middle = 0.5 * (lanes.s_start_m + lanes.s_end_m)
    graph = networkx.DiGraph()
    for lane in range(len(lanes)):
        half = float(0.5 * (lanes.s_end_m[lane] - lanes.s_start_m[lane]))
        graph.add_edge((lane, 0), (lane, 1), weight=half)
        graph.add_edge((lane, 1), (lane, 2), weight=half)
        for following in network.successors(lane):
            graph.add_edge((lane, 2), (following, 0), weight=0.0)
        for other, side in ((network.left_neighbour(lane), "left"), (network.right_neighbour(lane), "right")):
            if other is None or other not in driving or lanes.direction[other] != lanes.direction[lane]:
                continue
            low, mid, high = lanes.s_start_m[lane], middle[lane], lanes.s_end_m[lane]
            halves = [(low, mid), (mid, high)][:: int(lanes.direction[lane])]
            for part, (a, b) in enumerate(halves):
                ranges = network.lane_change_ranges(lane, side)
                if np.isfinite(change_cost) and ((ranges[:, 0] < b) & (ranges[:, 1] > a)).any():
                    graph.add_edge((lane, part), (other, part), weight=change_cost)
    try:
        expected = networkx.dijkstra_path_length(graph, (start, 1), (goal, 1))
    except networkx.NetworkXNoPath:
        with pytest.raises(RouteNotFoundError):
            network.route(start, middle[start], goal, middle[goal], change_cost)
        return
    route = network.route(start, middle[start], goal, middle[goal], change_cost)
    changes = int(route.is_change.sum())
    cost = route.length_m + (changes * change_cost if changes else 0.0)
    assert cost == pytest.approx(expected, abs=1e-6)


def test_the_place_of_a_pose_is_in_its_direction(load, text):
    """In a junction several lanes overlap; the heading tells which is meant."""
    east = '<geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>'
    north = '<geometry s="0" x="50" y="-50" hdg="1.5707963267948966" length="100"><line/></geometry>'
    network = load(text.road(east, road_id="e"), text.road(north, road_id="n"))
    point = np.repeat([[51.0, -1.0]], 4, axis=0)
    near = network.nearest_lane(point, heading_rad=[0.1, 1.5, 3.0, -1.5])
    # Only the right-hand lanes of both roads contain the point.
    assert [network.lanes.key[i] for i in near.lane] == [
        LaneKey("e", 0, -1),
        LaneKey("n", 0, -1),
        LaneKey("n", 0, -1),
        LaneKey("e", 0, -1),
    ]
    assert near.found.all()
    assert near.distance_m.tolist() == [0.0] * 4
    with pytest.raises(PositionError, match="heading_rad"):
        network.nearest_lane(point, heading_rad=[0.0, 1.0])
