from pathlib import Path

import numpy as np
import pytest
from highway_env.road.road import Road
from highway_env.vehicle.behavior import IDMVehicle

from opendrive import load_map
from scenarios.highway_road import MapLane, highway_road_network

SHARED = Path(__file__).parents[2].parent / "shared" / "opendrive" / "maps"
SHIPPED = sorted((Path(__file__).parents[2] / "scenarios" / "maps").glob("*.xodr"))


@pytest.fixture(scope="module")
def network():
    file = SHARED / "Town01.xodr"
    if not file.is_file():
        pytest.skip(f"reference maps are absent: {file}")
    return load_map(file)


@pytest.fixture(scope="module")
def roads(network):
    return highway_road_network(network)


def test_every_drivable_lane_is_there_once(network, roads):
    lanes = [lane.lane for lane in roads.lanes_list()]
    assert sorted(lanes) == np.flatnonzero(network.lanes.lane_type == "driving").tolist()
    for lane, name in roads.name_of_lane.items():
        assert roads.get_lane(name).lane == lane


def test_linked_lanes_share_a_node(network, roads):
    for lane, name in roads.name_of_lane.items():
        for following in network.successors(lane):
            if following in roads.name_of_lane:
                assert roads.name_of_lane[following][0] == name[1]


def test_lanes_keep_their_geometry(network, roads):
    """Against the map's own queries: positions along the middle, headings, widths, and back again."""
    bent = [lane for lane in roads.lanes_list() if 5.0 < lane.length < 60.0][::12]
    assert len(bent) > 5
    for lane in bent:
        key = network.lanes.key[lane.lane]
        for longitudinal in np.linspace(0.0, lane.length, 7):
            for lateral in (-1.0, 0.0, 1.2):
                point = lane.position(longitudinal, lateral)
                assert lane.local_coordinates(point) == pytest.approx((longitudinal, lateral), abs=1e-4), key
            s, t = network.road_coordinates(key.road_id, lane.position(longitudinal, 0.0))
            inner, outer = network.lane_offsets(lane.lane, s)
            assert t[0] == pytest.approx(0.5 * (inner[0] + outer[0]), abs=1e-6)
            x, y, _, heading = network.center_line(lane.lane, s)
            assert lane.heading_at(longitudinal) == pytest.approx(heading[0], abs=1e-5)
        # The longitudinal coordinate is the distance along the middle, measured with a fine polyline; the
        # map has gaps of some tenths of a millimetre between its pieces.
        s = np.linspace(network.lanes.s_start_m[lane.lane], network.lanes.s_end_m[lane.lane], 4000)
        x, y, _, _ = network.center_line(lane.lane, s)
        assert lane.length == pytest.approx(np.hypot(np.diff(x), np.diff(y)).sum(), abs=1e-3)


def test_lanes_go_on_straight_beyond_their_ends(roads):
    lane = roads.lanes_list()[0]
    for longitudinal in (-4.0, lane.length + 3.0):
        point = lane.position(longitudinal, 0.5)
        assert lane.local_coordinates(point) == pytest.approx((longitudinal, 0.5), abs=1e-6)


def test_the_lane_of_a_pose_is_the_one_in_its_direction(network, roads):
    for lane in roads.lanes_list()[::9]:
        middle = 0.5 * lane.length
        point, heading = lane.position(middle, 0.0), lane.heading_at(middle)
        found = roads.get_lane(roads.get_closest_lane_index(point, heading))
        assert (
            abs(found.local_coordinates(point)[1])
            <= 0.5 * found.width_at(found.local_coordinates(point)[0]) + 1e-6
        )
        off = found.heading_at(found.local_coordinates(point)[0]) - heading
        assert abs((off + np.pi) % (2.0 * np.pi) - np.pi) < 0.6


def drive(network, roads, lane, seconds):
    """Drive an IDM vehicle and yield lane and offset to its middle at each step."""
    road = Road(roads, np_random=np.random.RandomState(4))
    start = roads.get_lane(roads.name_of_lane[lane])
    vehicle = IDMVehicle(
        road, start.position(1.0, 0.0), heading=start.heading_at(1.0), speed=8.0, target_speed=8.0
    )
    vehicle.enable_lane_change = False
    road.vehicles.append(vehicle)
    for _ in range(int(seconds * 15)):
        road.act()
        road.step(1.0 / 15.0)
        target = roads.get_lane(vehicle.target_lane_index)
        longitudinal, lateral = target.local_coordinates(vehicle.position)
        yield vehicle, target, longitudinal, lateral


def test_an_idm_vehicle_drives_through_the_town(network, roads):
    """Over several junctions it stays within its lanes: the middle of the car and its flanks."""
    start = next(
        i
        for i in range(len(network.lanes))
        if i in roads.name_of_lane
        and network.lanes.junction_id[i] is None
        and roads.get_lane(roads.name_of_lane[i]).length < 100.0
        and len(network.successors(i)) > 1
    )
    visited, travelled = set(), 0.0
    for vehicle, target, longitudinal, lateral in drive(network, roads, start, 30.0):
        visited.add(target.lane)
        travelled += vehicle.speed / 15.0
        if 0.0 <= longitudinal <= target.length:
            free = 0.5 * (target.width_at(longitudinal) - vehicle.WIDTH)
            assert abs(lateral) < free, network.lanes.key[target.lane]
        if not network.successors(target.lane):
            break
    assert travelled > 150.0
    assert len(visited) > 3
    assert any(network.lanes.junction_id[i] is not None for i in visited)


@pytest.mark.parametrize("file", SHIPPED, ids=lambda file: file.stem)
def test_the_shipped_maps_convert(file):
    network = load_map(file)
    roads = highway_road_network(network)
    assert roads.lanes_list()
    for lane in roads.lanes_list():
        assert lane.length > 0.0
        middle = 0.5 * lane.length
        assert lane.local_coordinates(lane.position(middle, 0.3)) == pytest.approx((middle, 0.3), abs=1e-4)


def test_a_lane_is_not_made_from_a_configuration():
    with pytest.raises(TypeError, match="made from a RoadNetwork"):
        MapLane.from_config({})
