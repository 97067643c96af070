"""The shipped maps: the files are the builder's, and they lie where pencil and paper put them."""

import subprocess
import sys
from collections.abc import Callable
from math import cos, hypot, pi, sin, sqrt
from pathlib import Path

import numpy as np
import pytest
from lxml import etree
from scipy.special import fresnel

from opendrive import RoadNetwork, load_map
from scenarios.catalogue.map_builder import build_map
from scenarios.catalogue.maps import SHIPPED_MAPS, UnknownMapError, shipped_map

ARMS = {"1": "west", "2": "south", "3": "east", "4": "north"}
OUTWARD = {"1": (-1.0, 0.0), "2": (0.0, -1.0), "3": (1.0, 0.0), "4": (0.0, 1.0)}
# Ways through the intersection: two ids of arms, from and to. Arms are numbered counter-clockwise.
RIGHT, STRAIGHT, LEFT = ("12", "23", "34", "41"), ("13", "24", "31", "42"), ("14", "21", "32", "43")
ENDS_AT_JUNCTION = {"1", "2"}


@pytest.fixture(scope="module")
def networks() -> dict[str, RoadNetwork]:
    return {name: load_map(shipped_map(name)) for name in SHIPPED_MAPS}


def inbound(arm: str, number: int = 1) -> tuple[str, int, int]:
    """Key of the lane of an arm that leads to the junction: 1 for driving, 2 for the sidewalk beside it."""
    return arm, 0, -number if arm in ENDS_AT_JUNCTION else number


def outbound(arm: str, number: int = 1) -> tuple[str, int, int]:
    return arm, 0, number if arm in ENDS_AT_JUNCTION else -number


def at_junction(arm: str) -> float:
    """Road s of an arm where it meets the junction."""
    return 200.0 if arm in ENDS_AT_JUNCTION else 0.0


def point(network: RoadNetwork, road: str, s_m: float, t_m: float) -> tuple[float, float]:
    on_road = network.road_point(road, s_m, t_m)
    return float(on_road.x_m), float(on_road.y_m)


# ------------------------------------------------------------------------------------------------ files


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_shipped_file_is_what_the_builder_writes(name: str) -> None:
    assert shipped_map(name).read_bytes() == build_map(name)


@pytest.mark.parametrize("module", ["scenarios.catalogue.map_builder", "scenarios.map_builder"])
def test_command_writes_all_maps(tmp_path: Path, module: str) -> None:
    """By its name, and by its old one."""
    subprocess.run([sys.executable, "-m", module, str(tmp_path / "maps")], check=True)
    written = {path.name: path.read_bytes() for path in (tmp_path / "maps").iterdir()}
    assert written == {f"{name}.xodr": build_map(name) for name in SHIPPED_MAPS}


@pytest.mark.parametrize("function", [shipped_map, build_map])
def test_unknown_name_lists_the_known_ones(function: Callable[[str], object]) -> None:
    with pytest.raises(UnknownMapError, match=r"'motorway'.*urban_street, urban_street_parking, urban_bend"):
        function("motorway")


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_file_is_small_and_has_a_complete_header(name: str) -> None:
    assert shipped_map(name).stat().st_size < 60_000
    root = etree.parse(shipped_map(name)).getroot()
    header = root.find("header")
    assert root.tag == "OpenDRIVE"
    assert header is not None
    assert (header.get("revMajor"), header.get("revMinor"), header.get("name")) == ("1", "6", name)
    assert (header.findtext("geoReference") or "").startswith("+proj=tmerc +lat_0=52 +lon_0=13 ")


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_identifiers_are_unique(name: str) -> None:
    root = etree.parse(shipped_map(name)).getroot()
    for tag in ("road", "junction", "object", "signal", "connection"):
        ids = [element.get("id") for element in root.iter(tag)]
        assert len(set(ids)) == len(ids), tag
    assert not {e.get("id") for e in root.iter("road")} & {e.get("id") for e in root.iter("junction")}


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_objects_and_signals_are_on_their_road(name: str) -> None:
    for road in etree.parse(shipped_map(name)).getroot().iter("road"):
        for element in road.iter("object", "signal", "cornerRoad"):
            assert 0 <= float(element.get("s", "nan")) <= float(road.get("length", "nan"))


# --------------------------------------------------------------------------------- loaded: common to all


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_loads_without_warnings(networks: dict[str, RoadNetwork], name: str) -> None:
    assert networks[name].name == name
    assert networks[name].warnings == ()


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_header_encloses_all_lanes(networks: dict[str, RoadNetwork], name: str) -> None:
    header = etree.parse(shipped_map(name)).getroot().find("header")
    assert header is not None
    west, south, east, north = (float(header.get(side, "nan")) for side in ("west", "south", "east", "north"))
    x_min, y_min, x_max, y_max = networks[name].bounds
    assert west - 1e-9 <= x_min
    assert south - 1e-9 <= y_min
    assert x_max <= east + 1e-9
    assert y_max <= north + 1e-9


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_lane_widths_along_the_whole_network(networks: dict[str, RoadNetwork], name: str) -> None:
    network, expected = networks[name], {"driving": 3.5, "parking": 2.0, "sidewalk": 2.5}
    for lane in range(len(network.lanes)):
        s_m = np.linspace(network.lanes.s_start_m[lane], network.lanes.s_end_m[lane], 7)
        assert network.lane_width(lane, s_m) == pytest.approx(expected[str(network.lanes.lane_type[lane])])


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_speed_limit_is_50_everywhere(networks: dict[str, RoadNetwork], name: str) -> None:
    network = networks[name]
    for lane in range(len(network.lanes)):
        assert network.speed_limit(lane, 1.0) == pytest.approx(50 / 3.6)


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_crosswalks_are_rectangles_from_kerb_to_kerb(networks: dict[str, RoadNetwork], name: str) -> None:
    width_m = 11.0 if name in ("urban_street_parking", "euro_ncap_street") else 7.0
    assert len(networks[name].crosswalks) == (4 if name == "urban_intersection" else 1)
    for crosswalk in networks[name].crosswalks:
        assert crosswalk.polygon.shape == (4, 2)
        sides = np.roll(crosswalk.polygon, -1, axis=0) - crosswalk.polygon
        assert np.hypot(sides[:, 0], sides[:, 1]) == pytest.approx([4.0, width_m, 4.0, width_m])
        following = np.roll(sides, -1, axis=0)
        turn = sides[:, 0] * following[:, 1] - sides[:, 1] * following[:, 0]
        assert turn == pytest.approx([4.0 * width_m] * 4)  # right angles, counter-clockwise


@pytest.mark.parametrize("name", SHIPPED_MAPS)
def test_signals_stand_right_of_their_traffic_on_the_sidewalk(
    networks: dict[str, RoadNetwork], name: str
) -> None:
    network, seen = networks[name], 0
    for road in network.roads:
        for signal in network.signals_of(road):
            side = -1 if signal.orientation == "+" else 1
            assert signal.t_m * side > 0
            assert signal.applies_to(side)
            assert not signal.applies_to(-side)
            (hits,) = network.locate([point(network, road, signal.s_m, signal.t_m)]).lane.tolist()
            assert network.lanes.lane_type[hits] == "sidewalk"
            seen += 1
    assert seen == (16 if name == "urban_intersection" else 4)


# ------------------------------------------------------------------------------------------------ street


@pytest.mark.parametrize(
    ("name", "types", "borders_m"),
    [
        ("urban_street", ["driving", "sidewalk"], [3.5, 6.0]),
        ("urban_street_parking", ["driving", "parking", "sidewalk"], [3.5, 5.5, 8.0]),
    ],
)
def test_borders_of_the_straight_street(
    networks: dict[str, RoadNetwork], name: str, types: list[str], borders_m: list[float]
) -> None:
    network = networks[name]
    for side, direction in ((-1, 1), (1, -1)):
        inner_m = 0.0
        for number, (kind, outer_m) in enumerate(zip(types, borders_m, strict=True), start=1):
            lane = network.lane_index_of(("1", 0, side * number))
            assert network.lanes.lane_type[lane] == kind
            assert network.lanes.direction[lane] == direction
            left, right = network.borders(lane, [0.0, 300.0, 600.0])
            assert left == pytest.approx(np.array([[x, side * inner_m] for x in (0.0, 300.0, 600.0)]))
            assert right == pytest.approx(np.array([[x, side * outer_m] for x in (0.0, 300.0, 600.0)]))
            inner_m = outer_m


def test_euro_ncap_street_has_its_lane_where_the_vehicle_under_test_drives(
    networks: dict[str, RoadNetwork],
) -> None:
    """The unmarked road of the Euro NCAP scenarios: a 28 m lane right of y = 0, its centre at y = -14."""
    network = networks["euro_ncap_street"]
    lane = network.lane_index_of(("1", 0, -1))
    x, y, _, heading = network.center_line(lane, [0.0, 750.0, 1500.0])
    assert x == pytest.approx([0.0, 750.0, 1500.0])
    assert y == pytest.approx([-14.0] * 3)
    assert heading == pytest.approx([0.0] * 3)
    # kerb, 2 m of parking, 2.5 m of sidewalk: where a pedestrian who starts 4 m from the centre line stands
    for y_m, kind in ((-16.0, "parking"), (-18.0, "sidewalk"), (-10.0, "driving"), (-6.0, "sidewalk")):
        (hit,) = network.locate([[700.0, y_m]]).lane.tolist()
        assert network.lanes.lane_type[hit] == kind


@pytest.mark.parametrize("name", ["urban_street", "urban_street_parking", "urban_bend"])
def test_only_the_centre_mark_may_be_crossed(networks: dict[str, RoadNetwork], name: str) -> None:
    network = networks[name]
    for lane_id in (-1, 1):
        lane = network.lane_index_of(("1", 0, lane_id))
        assert network.lane_change(lane, 300.0, "left")
        assert not network.lane_change(lane, 300.0, "right")


def test_middle_of_the_street_is_free(networks: dict[str, RoadNetwork]) -> None:
    for name in ("urban_street", "urban_street_parking"):
        stations = [signal.s_m for signal in networks[name].signals_of("1")]
        stations += [float(x) for crosswalk in networks[name].crosswalks for x in crosswalk.polygon[:, 0]]
        assert not [s for s in stations if 100.0 <= s <= 500.0]
        assert sorted(s for s in stations if s >= 558.0 and s <= 562.0) == [558.0, 558.0, 562.0, 562.0]


# -------------------------------------------------------------------------------------------------- bend


def test_bend_joints_follow_from_the_clothoid_integrals(networks: dict[str, RoadNetwork]) -> None:
    network, radius_m, spiral_m = networks["urban_bend"], 60.0, 30.0
    # A clothoid that reaches curvature 1/R after length L is a scaled Fresnel curve and has turned by L / 2R.
    scale = sqrt(pi * radius_m * spiral_m)
    fresnel_sine, fresnel_cosine = fresnel(spiral_m / scale)
    along_m, aside_m = scale * float(fresnel_cosine), scale * float(fresnel_sine)
    turn = spiral_m / (2 * radius_m)
    # The bend is symmetric about the diagonal: it touches two perpendicular tangents at the same distance.
    tangent_m = along_m - radius_m * sin(turn) + aside_m + radius_m * cos(turn)
    arc_m = radius_m * (pi / 2 - 2 * turn)
    corner_x_m = 200.0 + tangent_m
    joints = [
        (200.0, (200.0, 0.0), 0.0),
        (230.0, (200.0 + along_m, aside_m), turn),
        (230.0 + arc_m, (corner_x_m - aside_m, tangent_m - along_m), pi / 2 - turn),
        (260.0 + arc_m, (corner_x_m, tangent_m), pi / 2),
        (460.0 + arc_m, (corner_x_m, tangent_m + 200.0), pi / 2),
    ]
    assert network.roads["1"].length_m == pytest.approx(460.0 + arc_m)
    for s_m, place, heading in joints:
        for just in (-1e-9, 0.0):
            pose = network.road_point("1", s_m + just, 0.0)
            assert hypot(float(pose.x_m) - place[0], float(pose.y_m) - place[1]) < 1e-6
            assert float(pose.heading_rad) == pytest.approx(heading, abs=1e-8)


def test_lanes_in_the_bend_are_concentric(networks: dict[str, RoadNetwork]) -> None:
    network = networks["urban_bend"]
    middle = point(network, "1", 262.0, 60.0)
    for lane_id, inner_m, outer_m in ((-2, 66.0, 63.5), (-1, 63.5, 60.0), (1, 60.0, 56.5), (2, 56.5, 54.0)):
        lane = network.lane_index_of(("1", 0, lane_id))
        borders = np.concatenate(network.borders(lane, np.linspace(231.0, 293.0, 9)))
        radii = np.hypot(borders[:, 0] - middle[0], borders[:, 1] - middle[1])
        assert np.unique(radii.round(6)).tolist() == sorted([inner_m, outer_m])


# ------------------------------------------------------------------------------------------ intersection


@pytest.mark.parametrize("arm", ARMS)
def test_arms_reach_from_12_m_to_212_m(networks: dict[str, RoadNetwork], arm: str) -> None:
    network, (x, y) = networks["urban_intersection"], OUTWARD[arm]
    assert network.roads[arm].record.name == f"{ARMS[arm]} arm"
    assert point(network, arm, at_junction(arm), 0.0) == pytest.approx((12 * x, 12 * y))
    assert point(network, arm, 200.0 - at_junction(arm), 0.0) == pytest.approx((212 * x, 212 * y))


@pytest.mark.parametrize("way", RIGHT + STRAIGHT + LEFT)
def test_way_through_the_junction_joins_its_arms(networks: dict[str, RoadNetwork], way: str) -> None:
    network, source, target = networks["urban_intersection"], way[0], way[1]
    length_m = 24.0 if way in STRAIGHT else 6 * pi
    assert network.roads[way].length_m == pytest.approx(length_m)
    lanes = (1, 2) if way in RIGHT else (1,)
    assert sum(key.road_id == way for key in network.lanes.key) == len(lanes)
    for number in lanes:
        before = network.lane_index_of(inbound(source, number))
        inside = network.lane_index_of((way, 0, -number))
        after = network.lane_index_of(outbound(target, number))
        assert inside in network.successors(before)
        assert network.successors(inside) == (after,)
        assert network.predecessors(inside) == (before,)
        joints = (
            (before, at_junction(source), inside, 0.0),
            (inside, length_m, after, at_junction(target)),
        )
        for lane, s_m, following, following_s_m in joints:
            gap = np.subtract(network.borders(lane, [s_m]), network.borders(following, [following_s_m]))
            assert np.abs(gap).max() < 1e-6
            turn = network.center_line(lane, s_m)[3] - network.center_line(following, following_s_m)[3]
            assert abs(sin(float(turn) / 2)) < 1e-9


@pytest.mark.parametrize("arm", ARMS)
def test_every_arm_leads_to_the_three_others(networks: dict[str, RoadNetwork], arm: str) -> None:
    network = networks["urban_intersection"]
    inside = network.successors(network.lane_index_of(inbound(arm)))
    reached = {network.lanes.key[after] for lane in inside for after in network.successors(lane)}
    assert reached == {outbound(other) for other in ARMS if other != arm}


@pytest.mark.parametrize("way", RIGHT)
def test_sidewalk_goes_round_the_corner(networks: dict[str, RoadNetwork], way: str) -> None:
    network = networks["urban_intersection"]
    arms = [OUTWARD[arm] for arm in way]
    corner = (12 * (arms[0][0] + arms[1][0]), 12 * (arms[0][1] + arms[1][1]))
    left, right = network.borders(network.lane_index_of((way, 0, -2)), np.linspace(0.0, 6 * pi, 5))
    assert np.hypot(*(left - corner).T) == pytest.approx([8.5] * 5)
    assert np.hypot(*(right - corner).T) == pytest.approx([6.0] * 5)


@pytest.mark.parametrize("arm", ARMS)
def test_crosswalk_lies_2_m_to_6_m_before_the_junction(networks: dict[str, RoadNetwork], arm: str) -> None:
    (crosswalk,) = (c for c in networks["urban_intersection"].crosswalks if c.road_id == arm)
    x, y = OUTWARD[arm]
    outward_m, aside_m = crosswalk.polygon @ [x, y], crosswalk.polygon @ [-y, x]
    assert sorted(outward_m) == pytest.approx([14.0, 14.0, 18.0, 18.0])
    assert sorted(aside_m) == pytest.approx([-3.5, -3.5, 3.5, 3.5])


@pytest.mark.parametrize(("arm", "priority"), [("1", "306"), ("2", "206"), ("3", "306"), ("4", "205")])
def test_signals_of_an_arm(networks: dict[str, RoadNetwork], arm: str, priority: str) -> None:
    network, (x, y) = networks["urban_intersection"], OUTWARD[arm]
    inwards = "+" if arm in ENDS_AT_JUNCTION else "-"
    found = {}
    for signal in network.signals_of(arm):
        px, py = point(network, arm, signal.s_m, signal.t_m)
        place = (round(px * x + py * y, 6), round(px * -y + py * x, 6))  # outwards, and left of that
        found[signal.type, signal.orientation == inwards] = (*place, signal.dynamic, signal.value)
    assert found == {
        ("274", True): (192.0, 4.0, False, 50.0),
        ("274", False): (32.0, -4.0, False, 50.0),
        ("1000001", True): (19.0, 4.0, True, None),
        (priority, True): (19.0, 4.0, False, None),
    }
    assert {s.signal.country for s in network.signals_of(arm)} == {"DE"}
