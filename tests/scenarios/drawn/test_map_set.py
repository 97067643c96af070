"""The maps of drawn scenes against their files, the checks of maps, and lengths and widths by hand."""

import math

import numpy as np
import pytest

from opendrive import RoadNetwork, load_map
from opendrive.building.reference_line import Pose, end_of
from scenarios.drawn.junctions import two_arcs
from scenarios.drawn.map_set import MAPS, build_maps
from scenarios.drawn.values import data
from scenarios.places import near_side

NAMES = [*data()["maps"]["train"], *data()["maps"]["test"]]


@pytest.fixture(scope="module")
def networks() -> dict[str, RoadNetwork]:
    return {name: load_map(MAPS / f"{name}.xodr") for name in NAMES}


def test_files_are_what_the_builder_makes() -> None:
    built = build_maps()
    assert sorted(built) == sorted(path.stem for path in MAPS.glob("*.xodr")) == sorted(NAMES)
    assert [name for name, content in built.items() if (MAPS / f"{name}.xodr").read_bytes() != content] == []


def test_splits_share_no_map() -> None:
    train, test = data()["maps"]["train"], data()["maps"]["test"]
    assert set(train) & set(test) == set()
    assert min(len(train), len(test)) >= 5


def test_no_map_has_a_defect(networks: dict[str, RoadNetwork]) -> None:
    assert {name: network.warnings for name, network in networks.items() if network.warnings} == {}


@pytest.mark.parametrize(
    ("name", "length_m"),
    [
        ("straight_street", 500.0),
        # five straights; each bend is as long as its radius times its angle, and a clothoid longer
        ("winding_street", 5 * 50.0 + 4 * 20.0 + math.radians(80 * 45 + 60 * 60 + 120 * 50 + 45 * 70)),
        ("country_road", 3 * 90.0 + 2 * 40.0 + math.radians(150 * 30 + 120 * 45)),
        ("dual_carriageway", 220.0 + 2 * 120.0 + 20.0 + math.radians(140 * 35)),
    ],
)
def test_streets_are_as_long_as_their_pieces(
    networks: dict[str, RoadNetwork], name: str, length_m: float
) -> None:
    assert networks[name].roads["1"].length_m == pytest.approx(length_m, abs=1e-9)


def test_bends_turn_by_their_angles(networks: dict[str, RoadNetwork]) -> None:
    road = networks["winding_street"]
    start, end = (float(road.road_point("1", s, 0.0).heading_rad) for s in (0.0, road.roads["1"].length_m))
    turned = math.remainder(end - start - math.radians(45 - 60 + 50 - 70), 2 * math.pi)
    assert turned == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("name", "kinds", "kerb_m"),
    [
        ("straight_street", {"driving", "sidewalk"}, 3.25),
        ("parking_street", {"driving", "parking", "sidewalk"}, 5.25),
        ("cycle_street", {"driving", "biking", "sidewalk"}, 5.1),
        ("country_road", {"driving", "shoulder"}, 4.0),
        ("dual_carriageway", {"median", "driving", "sidewalk"}, 1.25 + 2 * 3.25),
        ("one_way_street", {"driving", "parking", "sidewalk"}, 2 * 3.25 + 2.0),
    ],
)
def test_streets_are_as_wide_as_their_lanes(
    networks: dict[str, RoadNetwork], name: str, kinds: set[str], kerb_m: float
) -> None:
    network = networks[name]
    lanes = network.lanes
    right = [k for k in range(len(lanes.key)) if lanes.key[k].lane_id < 0]
    assert {str(kind) for kind in lanes.lane_type} == kinds
    widths = sum(float(network.lane_width(k, 50.0)) for k in right if lanes.lane_type[k] != "sidewalk")
    assert widths == pytest.approx(kerb_m, abs=1e-9)


def test_one_way_street_has_no_oncoming_lane(networks: dict[str, RoadNetwork]) -> None:
    lanes = networks["one_way_street"].lanes
    driving = np.asarray(lanes.lane_type) == "driving"
    assert set(np.asarray(lanes.direction)[driving].tolist()) == {1}


def test_left_hand_maps_drive_on_the_left(networks: dict[str, RoadNetwork]) -> None:
    for name, network in networks.items():
        sides = {
            near_side(network, k)
            for k in range(len(network.lanes.key))
            if network.lanes.lane_type[k] == "driving"
        }
        assert sides == ({1} if name.startswith("left_hand") else {-1}), name


@pytest.mark.parametrize("name", ["crossing", "t_junction", "left_hand_crossing", "roundabout"])
def test_every_arm_leads_to_every_other(networks: dict[str, RoadNetwork], name: str) -> None:
    network = networks[name]
    lanes = network.lanes
    arms = [
        k for k in range(len(lanes.key)) if lanes.lane_type[k] == "driving" and len(lanes.key[k].road_id) == 1
    ]
    inwards = [k for k in arms if network.successors(k)]
    outwards = [k for k in arms if network.predecessors(k)]
    assert len(inwards) == len(outwards) == len(arms) / 2
    for start in inwards:
        for end in outwards:
            if lanes.key[start].road_id != lanes.key[end].road_id:
                route = network.shortest_route(start, end)
                assert (route[0], route[-1]) == (start, end)


@pytest.mark.parametrize("end", [Pose(12.0, -12.0, -math.pi / 2), Pose(20.0, 3.0, 0.2), Pose(9.0, 0.0, 0.0)])
def test_two_arcs_end_where_they_are_to(end: Pose) -> None:
    at = Pose(0.0, 0.0, 0.0)
    for piece in two_arcs(at, end):
        at = end_of(at, piece)
    assert (at.x_m, at.y_m) == pytest.approx((end.x_m, end.y_m), abs=1e-7)
    assert math.remainder(at.yaw_rad - end.yaw_rad, 2 * math.pi) == pytest.approx(0.0, abs=1e-8)


def test_a_right_angle_between_equal_legs_is_one_radius() -> None:
    pieces = two_arcs(Pose(0.0, 0.0, 0.0), Pose(12.0, -12.0, -math.pi / 2))
    assert [piece.curvature_start for piece in pieces] == pytest.approx([-1 / 12, -1 / 12])
    assert sum(piece.length_m for piece in pieces) == pytest.approx(6 * math.pi)
