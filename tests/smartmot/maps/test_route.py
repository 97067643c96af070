from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from opendrive import RoadNetwork, load_map
from scenarios.scenes.scenes import SCENES
from smartmot.errors import ShapeError, SmartMotError
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


def test_straight_street_by_hand() -> None:
    network = _network("urban_street")
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), 50.0, 100.0)
    assert route.length_m == pytest.approx(600.0)
    assert route.project(120.0, -1.0) == pytest.approx((120.0, 0.75))
    assert route.pose(120.0, -0.5) == pytest.approx((120.0, -2.25, 0.0))
    # beyond both ends the end segments go straight on
    assert route.project(-7.0, -1.75) == pytest.approx((-7.0, 0.0))
    assert route.pose(612.0) == pytest.approx((612.0, -1.75, 0.0))


def test_against_the_road_left_is_south() -> None:
    network = _network("urban_street")
    route = route_ahead(network, network.lane_index_of(("1", 0, 1)), 50.0, 10.0)
    assert route.project(550.0, 1.0) == pytest.approx((50.0, 0.75))
    x, y, yaw = route.pose(50.0)
    assert (x, y, abs(yaw)) == pytest.approx((550.0, 1.75, np.pi))


@pytest.mark.parametrize(
    ("roads", "length", "end"),
    [
        (("1", "13", "3"), 200.0 + 24.0 + 200.0, (212.0, -1.75, 0.0)),
        (("1", "14", "4"), 200.0 + 13.75 * np.pi / 2 + 200.0, (1.75, 212.0, np.pi / 2)),
    ],
)
def test_lanes_join_without_gap_or_step(
    roads: tuple[str, ...], length: float, end: tuple[float, ...]
) -> None:
    route = _crossing(*roads)
    assert route.length_m == pytest.approx(length, abs=0.01)
    assert len(route.strips) == len(route.entry_m) == 3
    steps = np.hypot(*np.diff(route.center_m, axis=0).T)
    np.testing.assert_allclose(steps, np.diff(route.station_m), atol=1e-6)
    assert (steps > 1e-6).all()
    heading = np.arctan2(*np.diff(route.center_m, axis=0).T[::-1])
    assert np.abs(np.diff(np.unwrap(heading))).max() < 0.06
    assert route.pose(route.length_m) == pytest.approx(end, abs=0.03)


@settings(max_examples=200, deadline=None)
@given(share=st.floats(0.0, 1.0), offset=st.floats(-8.0, 8.0))
@pytest.mark.parametrize("name", ["urban_street", "urban_bend"])
def test_project_inverts_pose(name: str, share: float, offset: float) -> None:
    network = _network(name)
    route = _whole(name, network.lane_index_of(("1", 0, -1)))
    station = share * route.length_m
    x, y, _ = route.pose(station, offset)
    found, aside = route.project(x, y)
    # normals of neighbouring chords overlap inside a bend: turn (0.034 rad at most) times offset
    assert found == pytest.approx(station, abs=1e-6 + 0.035 * abs(offset))
    assert aside == pytest.approx(offset, abs=1e-6 + 0.001 * abs(offset))


@cache
def _whole(name: str, lane: int) -> Route:
    return route_ahead(_network(name), lane, 0.0, 1000.0)


@settings(max_examples=100, deadline=None)
@given(share=st.floats(0.0, 1.0), offset=st.floats(-8.0, 8.0), turn=st.sampled_from(["13", "14"]))
def test_pose_inverts_project(share: float, offset: float, turn: str) -> None:
    """A point is where its station and offset say, on routes over the intersection."""
    route = _crossing("1", turn, {"13": "3", "14": "4"}[turn])
    x, y, _ = route.pose(share * route.length_m, offset)
    again = route.pose(*route.project(x, y))
    assert again[:2] == pytest.approx((x, y), abs=1e-3 + 0.05 * abs(offset))


@pytest.mark.parametrize(("arm", "lane_id"), [("1", -1), ("2", -1), ("3", 1), ("4", 1)])
def test_straightest_successor_at_the_intersection(arm: str, lane_id: int) -> None:
    network = _network("urban_intersection")
    across = {"1": ("13", "3"), "2": ("24", "4"), "3": ("31", "1"), "4": ("42", "2")}[arm]
    start = network.lane_index_of((arm, 0, lane_id))
    route = route_ahead(network, start, 100.0, 300.0)
    assert tuple(network.lanes.key[lane].road_id for lane in route.lanes) == (arm, *across)
    # 100 m lie ahead on the arm already
    assert route_ahead(network, start, 100.0, 99.0).lanes == (start,)


def test_straightest_predecessor() -> None:
    network = _network("urban_intersection")
    lane = network.lane_index_of(("3", 0, -1))
    route = route_ahead(network, lane, 50.0, 10.0, behind_m=80.0)
    assert tuple(network.lanes.key[i].road_id for i in route.lanes) == ("1", "13", "3")
    assert route_ahead(network, lane, 50.0, 10.0, behind_m=49.0).lanes == (lane,)


def test_a_route_never_uses_a_lane_twice() -> None:
    if not TOWN.is_file():
        pytest.skip(f"reference map is absent: {TOWN}")
    network = load_map(TOWN)
    rng = np.random.default_rng(2)
    driving = np.flatnonzero((network.lanes.lane_type == "driving") & (network.lanes.s_end_m > 20.0))
    for lane in rng.choice(driving, 25):
        route = route_ahead(network, int(lane), float(network.lanes.s_start_m[lane]), 2000.0)
        assert len(set(route.lanes)) == len(route.lanes)
        assert (np.diff(route.station_m) > 0).all()
        # steps of the joined line are the stations' steps, but for what the map itself leaves open at joints
        steps = np.hypot(*np.diff(route.center_m, axis=0).T)
        assert np.abs(steps - np.diff(route.station_m)).max() < 0.1


def test_bad_routes_are_refused() -> None:
    network = _network("urban_intersection")
    with pytest.raises(RouteError, match="no lanes"):
        route_from_lanes(network, [])
    apart = [network.lane_index_of((r, 0, -1)) for r in ("1", "3")]
    with pytest.raises(RouteError, match=r"'3', 0, -1.*does not follow.*'1', 0, -1"):
        route_from_lanes(network, apart)
    assert issubclass(RouteError, SmartMotError)


def test_one_place_and_many_places_agree() -> None:
    """In a bend, at every joint, between joints and beyond both ends."""
    network = load_map(SCENES / "maps" / "bend_30.xodr")
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), 10.0, ahead_m=500.0)
    joints = route.station_m
    stations = np.concatenate((joints, (joints[1:] + joints[:-1]) / 2, [-7.0, route.length_m + 7.0]))
    for offset in (0.0, 1.5):
        points, yaw = route.poses(stations, offset)
        one = np.array([route.pose(float(station), offset) for station in stations])
        np.testing.assert_array_equal(one, np.column_stack((points, yaw)))


def test_at_a_joint_the_heading_is_that_after_it() -> None:
    """East for 10 m, then north; the ends go on straight."""
    center = np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]])
    route = Route((), np.zeros(0), center, np.array([0.0, 10.0, 20.0]))
    assert route.pose(-1.0) == (-1.0, 0.0, 0.0)
    assert route.pose(0.0, 2.0) == (0.0, 2.0, 0.0)
    assert route.pose(10.0, 2.0) == (8.0, 0.0, np.pi / 2)
    assert route.pose(20.0) == (10.0, 10.0, np.pi / 2)
    assert route.pose(21.0, -1.0) == (11.0, 11.0, np.pi / 2)


@pytest.mark.parametrize(
    ("wrong", "told"),
    [
        ({"station_m": np.array([0.0, 10.0])}, "station_m: expected shape"),
        ({"station_m": np.array([0.0, 10.0, 10.0])}, "each at a greater station"),
        ({"station_m": np.array([0.0, 20.0, 10.0])}, "each at a greater station"),
        ({"station_m": np.zeros(1), "center_m": np.zeros((1, 2))}, "two points or more"),
        ({"station_m": np.array([0.0, np.nan, 20.0])}, "finite"),
        ({"center_m": np.full((3, 2), np.inf)}, "finite"),
        ({"entry_m": np.zeros(1)}, "entry_m: expected shape"),
    ],
)
def test_what_is_no_path_is_refused(wrong: dict[str, np.ndarray], told: str) -> None:
    good = Route(
        (), np.zeros(0), np.array([[0.0, 0.0], [10.0, 0.0], [10.0, 10.0]]), np.array([0.0, 10.0, 20.0])
    )
    with pytest.raises(ShapeError, match=told):
        replace(good, **wrong)
