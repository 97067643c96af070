"""Vector maps of Argoverse 2 as lane maps."""

import copy
import json
import math
import pickle
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import shapely

from scenarios.errors import DatasetError
from scenarios.recorded.argoverse.archive import MAY_LEAVE, read_vector_map
from scenarios.recorded.maps.drive_map import load_drive_map
from scenarios.recorded.maps.vector_map import VectorMap
from smartmot.area import MapArea, MapAreaConfig
from smartmot.maps.faulty import FaultyMap, MapErrors
from smartmot.maps.follow import route_along
from smartmot.maps.regulatory import regulatory_elements
from smartmot.maps.route import route_from_lanes
from smartmot.maps.strips import lane_strip
from smartmot.maps.walks import kerb
from smartmot.types import Boxes, EgoState
from tests.scenarios.recorded import argoverse_log as made

# av2 0.3.6, map/lane_segment.py
AV2_MARKS = [
    "DASHED_WHITE",
    "DASHED_YELLOW",
    "DASH_SOLID_WHITE",
    "DASH_SOLID_YELLOW",
    "DOUBLE_DASH_WHITE",
    "DOUBLE_DASH_YELLOW",
    "DOUBLE_SOLID_WHITE",
    "DOUBLE_SOLID_YELLOW",
    "NONE",
    "SOLID_BLUE",
    "SOLID_DASH_WHITE",
    "SOLID_DASH_YELLOW",
    "SOLID_WHITE",
    "SOLID_YELLOW",
    "UNKNOWN",
]

ROW = {10: 0, 11: 1, 12: 2, 13: 3, 20: 4, 21: 5, 22: 6}
"""Rows of the lanes of `argoverse_log.street`."""


def load(folder: Path, content: Any) -> VectorMap:
    return read_vector_map(made.write_map(folder / "log_map_archive_x.json", content))


def with_lanes(*lanes: dict[str, Any], area: Any = None) -> dict[str, Any]:
    areas = {} if area is None else {"1": {"area_boundary": made.points(*area), "id": 1}}
    segments = {str(k): each for k, each in enumerate(lanes)}
    return {"lane_segments": segments, "drivable_areas": areas, "pedestrian_crossings": {}}


@pytest.fixture
def street(tmp_path: Path) -> VectorMap:
    return load(tmp_path, made.street())


# --- lanes --------------------------------------------------------------------------------------------


def test_lanes_beside_each_other_are_one_road(street: VectorMap) -> None:
    lanes = street.lanes
    assert list(lanes.key[:7]) == [("10", 0, k) for k in (10, 11, 12, 13)] + [
        ("20", 0, k) for k in (20, 21, 22)
    ]
    assert lanes.lane_type[:7].tolist() == [*["driving"] * 3, "biking", *["driving"] * 3]
    assert lanes.direction[:7].tolist() == [1, 1, -1, 1, 1, 1, -1]
    assert lanes.s_end_m[:7].tolist() == [60.0] * 4 + [40.0] * 3
    assert len(set(lanes.key)) == len(lanes.key)
    assert street.bounds == pytest.approx((0.0, -7.0, 100.0, 11.5))


@pytest.mark.parametrize(("number", "y_m", "heading_rad"), [(10, -1.75, 0.0), (12, 5.25, np.pi)])
def test_center_line(street: VectorMap, number: int, y_m: float, heading_rad: float) -> None:
    s = np.array([0.0, 12.5, 60.0])  # that of the road, which the oncoming lane runs against
    x, y, z, heading = street.center_line(ROW[number], s)
    assert x == pytest.approx(s)
    assert y == pytest.approx([y_m] * 3)
    assert z.tolist() == [0.0] * 3
    assert np.abs(heading) == pytest.approx([heading_rad] * 3)
    assert street.lane_width(ROW[number], s) == pytest.approx([3.5] * 3)


def test_links(street: VectorMap) -> None:
    assert street.successors(ROW[10]) == (ROW[20],)  # lane 99 is beyond the map
    assert street.successors(ROW[11]) == (ROW[21],)
    assert street.predecessors(ROW[21]) == (ROW[11],)
    assert street.predecessors(ROW[12]) == (ROW[22],)  # said by its predecessor alone
    assert street.successors(ROW[20]) == ()


def test_neighbours(street: VectorMap) -> None:
    assert street.left_neighbour(ROW[10]) == ROW[11]
    assert street.right_neighbour(ROW[10]) == ROW[13]
    assert street.left_neighbour(ROW[11]) == ROW[12]
    assert street.left_neighbour(ROW[12]) == ROW[11]
    kinds = street.lanes.lane_type
    shoulder = street.right_neighbour(ROW[13])
    assert shoulder is not None
    assert kinds[shoulder] == "shoulder"
    sidewalk = street.right_neighbour(shoulder)
    assert sidewalk is not None
    assert kinds[sidewalk] == "sidewalk"
    assert street.left_neighbour(shoulder) == ROW[13]
    assert street.left_neighbour(sidewalk) == shoulder
    assert street.right_neighbour(sidewalk) is None


def test_lane_changes_by_the_mark_next_to_the_lane(street: VectorMap) -> None:
    assert street.lane_change_ranges(ROW[10], "left").tolist() == [[0.0, 60.0]]  # dashed
    assert street.lane_change_ranges(ROW[11], "right").tolist() == []  # solid, then dashed
    assert street.lane_change_ranges(ROW[10], "right").tolist() == []
    assert street.lane_change_ranges(ROW[20], "left").tolist() == [[0.0, 40.0]]  # no paint
    assert street.lane_change_ranges(ROW[12], "left").tolist() == []  # two solid lines


def test_every_mark_says_whether_it_may_be_crossed() -> None:
    assert sorted(MAY_LEAVE) == AV2_MARKS
    for name, may in MAY_LEAVE.items():
        nearest = name.removeprefix("DOUBLE_")
        assert may == nearest.startswith(("DASH", "NONE", "UNKNOWN"))


def test_points_in_lanes(street: VectorMap) -> None:
    hits = street.locate([(20.0, -1.0), (30.0, 5.25), (50.0, 50.0)])
    assert hits.point.tolist() == [0, 1]
    assert hits.lane.tolist() == [ROW[10], ROW[12]]
    assert hits.s_m == pytest.approx([20.0, 30.0])
    assert hits.margin_m == pytest.approx([1.0, 1.75])


def test_nearest_lanes(street: VectorMap) -> None:
    points = [(20.0, -1.0), (-3.0, 4.0), (20.0, -6.0), (60.0, 0.5)]
    nearest = street.nearest_lane(points)
    assert nearest.lane[:3].tolist() == [ROW[10], ROW[12], ROW[10]]
    assert nearest.lane[3] in (ROW[11], ROW[21])  # where they meet
    assert nearest.distance_m == pytest.approx([0.0, 3.0, 2.5, 0.0])
    assert nearest.s_m[:3] == pytest.approx([20.0, 0.0, 20.0])
    assert street.nearest_lane(points[2:3], ("biking",)).distance_m == pytest.approx([1.0])
    assert not street.nearest_lane(points, ("rail",)).found.any()


def test_of_lanes_that_overlap_the_one_whose_middle_is_nearest(tmp_path: Path) -> None:
    lanes = [
        made.straight(k, 0, 20, 2.0 + y, -2.0 + y, is_intersection=True) for k, y in ((1, 0.0), (2, 1.0))
    ]
    network = load(tmp_path, with_lanes(*lanes))
    points = [(5.0, y) for y in (-0.5, 0.4, 0.6, 1.9, 2.5)]
    assert network.nearest_lane(points).lane.tolist() == [0, 0, 1, 1, 1]


def test_outlines(street: VectorMap) -> None:
    assert street.lane_polygon(ROW[10], 0.0, 60.0).tolist() == [[0, 0], [60, 0], [60, -3.5], [0, -3.5]]
    assert street.lane_polygon(ROW[12], 10.0, 20.0) == pytest.approx(
        np.array([(20, 3.5), (10, 3.5), (10, 7), (20, 7)])
    )


def test_crosswalks_on_each_road_that_they_cross(street: VectorMap) -> None:
    (crosswalk,) = street.crosswalks
    assert (crosswalk.id, crosswalk.road_id, crosswalk.s_m) == ("5", "10", pytest.approx(31.5))
    route = route_from_lanes(street, [ROW[10], ROW[20]])
    (element,) = regulatory_elements(street, route, 10.0, 50.0)
    assert (element.kind, element.distance_m) == ("crosswalk", pytest.approx(21.5))


def test_a_bend(tmp_path: Path) -> None:
    """A quarter of a ring between 20 and 23.5 m from its centre, with chords of 1 degree."""
    angle = np.radians(np.arange(91))
    inner, outer = ([(r * np.sin(a), r * (1 - np.cos(a)) - r) for a in angle] for r in (20.0, 23.5))
    network = load(tmp_path, with_lanes(made.lane(1, inner, outer)))
    length_m = 21.75 * np.pi / 2
    chord_share = np.sin(np.radians(0.5)) / np.radians(0.5)
    assert network.lanes.s_end_m.tolist() == pytest.approx([length_m * chord_share])
    s = np.linspace(0.0, network.lanes.s_end_m[0], 19)  # each at a joint
    x, y, _, _ = network.center_line(0, s)
    assert np.hypot(x, y) == pytest.approx(np.full(19, 21.75))
    assert network.lane_width(0, s) == pytest.approx(np.full(19, 3.5), abs=1e-3)
    _, _, _, heading = network.center_line(0, s[:-1] + 0.1)
    assert heading == pytest.approx(np.radians(5.0 * np.arange(18) + 0.5))
    assert lane_strip(network, 0, 0.0).length_m == pytest.approx(length_m, rel=1e-3)


def test_the_width_of_a_lane_that_ends_askew(tmp_path: Path) -> None:
    network = load(tmp_path, with_lanes(made.lane(1, [(0, 3), (20, 3)], [(4, 0), (24, 0)])))
    assert network.lane_width(0, [0.0, 10.0, 20.0]) == pytest.approx([3.0] * 3)


def test_junctions_are_lanes_that_overlap(tmp_path: Path) -> None:
    junction = {"is_intersection": True}
    lanes = [
        made.straight(1, 0, 20, 2.0, -2.0, **junction),
        made.lane(2, [(8, -10), (8, 10)], [(12, -10), (12, 10)], **junction),
        made.straight(3, 100, 120, 2.0, -2.0, **junction),
        made.straight(4, 5, 15, 2.0, -2.0),
    ]
    junctions = load(tmp_path, with_lanes(*lanes)).lanes.junction_id
    assert junctions[0] == junctions[1] == "junction of lane 1"
    assert list(junctions[2:]) == ["junction of lane 3", None]


# --- the edge of the drivable area ----------------------------------------------------------------------


@pytest.mark.parametrize(
    ("number", "side", "across_m", "there"),
    [
        (10, "right", 2.0, True),  # cycle lane 1.5 m, then 0.5 m
        (20, "right", 2.0, True),
        (12, "right", 3.0, True),
        (22, "right", 3.0, True),
        (11, "right", 0.0, False),  # a driving lane
        (11, "left", 0.0, False),
    ],
)
def test_the_kerb_is_the_edge(
    street: VectorMap, number: int, side: Any, across_m: float, there: bool
) -> None:
    distance, sidewalk = kerb(street, ROW[number], np.array([3.0, 17.0, 31.0]), side)
    assert distance == pytest.approx([across_m] * 3)
    assert sidewalk is there


def edge_beside(folder: Path, *lanes: dict[str, Any], area: Any) -> tuple[list[float], bool]:
    """How far the edge is to the right of the first lane, and whether there is one."""
    network = load(folder, with_lanes(*lanes, area=area))
    distance, there = kerb(network, 0, np.linspace(0.0, 60.0, 5), "right")
    return distance.tolist(), there


def test_an_edge_too_far_away_is_none(tmp_path: Path) -> None:
    one = made.straight(1, 0, 60, 0.0, -3.5)
    for edge_m, there in ((5.4, True), (5.6, False)):
        area = [(-1, 3), (61, 3), (61, -3.5 - edge_m), (-1, -3.5 - edge_m)]
        distance, found = edge_beside(tmp_path, one, area=area)
        assert found is there
        assert distance == pytest.approx([edge_m if there else 0.0] * 5)


def test_beyond_the_mouth_of_a_junction_there_is_no_edge(tmp_path: Path) -> None:
    """A street of 20 m joins from the right in the middle; the margin is measured from the lane there."""
    area = [(0, 3), (60, 3), (60, -5), (40, -5), (40, -40), (20, -40), (20, -5), (0, -5)]
    distance, there = edge_beside(tmp_path, made.straight(1, 0, 60, 0.0, -3.5), area=area)
    assert there
    assert distance == pytest.approx([1.5, 1.5, 0.0, 1.5, 1.5])


@pytest.mark.parametrize(("kind", "there"), [("VEHICLE", False), ("BUS", False), ("BIKE", True)])
def test_before_the_edge_is_no_other_lane(tmp_path: Path, kind: str, there: bool) -> None:
    """A lane beside it that the map does not call a neighbour."""
    lanes = (made.straight(1, 0, 60, 0.0, -3.5), made.straight(2, 0, 60, -3.6, -6.0, lane_type=kind))
    area = [(-1, 3), (61, 3), (61, -7), (-1, -7)]
    assert edge_beside(tmp_path, *lanes, area=area)[1] is there


def test_a_neighbour_beyond_the_map_is_a_neighbour(tmp_path: Path) -> None:
    one = made.straight(1, 0, 60, 0.0, -3.5, right_neighbor_id=7)
    assert edge_beside(tmp_path, one, area=[(0, 3), (60, 3), (60, -5), (0, -5)]) == ([0.0] * 5, False)


def test_a_border_outside_the_drivable_area_is_the_edge(tmp_path: Path) -> None:
    area = [(0, 3), (60, 3), (60, -3.3), (0, -3.3)]
    assert edge_beside(tmp_path, made.straight(1, 0, 60, 0.0, -3.5), area=area) == ([0.0] * 5, True)


def test_cracks_between_drivable_areas_are_no_edge(tmp_path: Path) -> None:
    content = with_lanes(made.straight(1, 0, 60, 0.0, -3.5), area=[(-1, 3), (61, 3), (61, -3.6), (-1, -3.6)])
    beyond = made.points((-1, -3.7), (61, -3.7), (61, -6.5), (-1, -6.5))
    content["drivable_areas"]["2"] = {"area_boundary": beyond, "id": 2}
    distance, there = kerb(load(tmp_path, content), 0, np.array([20.0]), "right")
    assert (distance.tolist(), there) == ([pytest.approx(3.0)], True)


def turned(content: dict[str, Any], yaw_rad: float) -> dict[str, Any]:
    """A map far from the origin in another direction, so that none of its coordinates is exact."""
    c, s = math.cos(yaw_rad), math.sin(yaw_rad)
    lines = [each["area_boundary"] for each in content["drivable_areas"].values()]
    for lane in content["lane_segments"].values():
        lines += [lane["left_lane_boundary"], lane["right_lane_boundary"]]
    for point in (point for line in lines for point in line):
        x, y = point["x"], point["y"]
        point.update(x=5000.0 + c * x - s * y, y=-2000.0 + s * x + c * y)
    return content


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, 1.1, 2.5, -0.7])
def test_a_lane_that_ends_at_the_edge_is_not_before_it(tmp_path: Path, yaw_rad: float) -> None:
    """As where lanes of a junction part: the border of one lies on the edge, that of the other near it."""
    lanes = (made.straight(1, 0, 60, 0.0, -3.5), made.straight(2, 0, 60, 0.0, -3.55))
    area = [(-1, 3), (61, 3), (61, -3.55), (-1, -3.55)]
    network = load(tmp_path, turned(with_lanes(*lanes, area=area), yaw_rad))
    for row, across_m in ((0, 0.05), (1, 0.0)):
        beside = network.right_neighbour(row)
        assert beside is not None
        sidewalk = network.right_neighbour(beside)
        assert sidewalk is not None
        s_m = np.linspace(0.0, 60.0, 121)
        assert network.lane_width(beside, s_m) == pytest.approx(np.full(121, across_m), abs=1e-9)
        assert network.lane_width(sidewalk, s_m) == pytest.approx(np.full(121, 1.5))


@pytest.mark.parametrize("yaw_rad", [0.0, 0.3, 1.1, 2.5, -0.7])
def test_the_edge_is_where_the_drivable_area_first_ends(tmp_path: Path, yaw_rad: float) -> None:
    """Bays of all depths, and behind a gap another drivable area, into which the deeper ones open."""
    deep_m = 3.3 + 0.5 * np.random.default_rng(3).integers(0, 14, 30)
    border = [(2 * k + at, -deep) for k, deep in enumerate(deep_m.tolist()) for at in (-1, 1)]
    one = made.straight(1, 0, 58, 0.0, -3.5)
    content = with_lanes(one, area=[*border, (59, 3), (-1, 3)])
    behind = made.points((-1, -8.05), (61, -8.05), (61, -8.6), (-1, -8.6))
    content["drivable_areas"]["2"] = {"area_boundary": behind, "id": 2}
    network = load(tmp_path, turned(content, yaw_rad))
    shoulder = network.right_neighbour(0)
    assert shoulder is not None
    ends_m = np.where((deep_m > 8.05) & (deep_m < 8.6), 8.6, deep_m) - 3.5
    expected = np.where(ends_m <= 5.5, np.maximum(ends_m, 0.0), 0.0)
    width_m = network.lane_width(shoulder, np.arange(0.0, 60.0, 2.0))
    assert width_m == pytest.approx(expected, abs=1e-9)
    assert {0.0, 0.3, 5.1} <= set(np.round(width_m, 6).tolist())


# --- what perception makes of it ------------------------------------------------------------------------


def test_the_monitored_area(street: VectorMap) -> None:
    """People are kept up to 1.8 m beyond the edge, cars in the lanes that the ego may change to."""
    way = np.column_stack((np.arange(5.0, 95.0, 2.0), np.full(45, -1.75)))
    route = route_along(street, way)
    assert route.lanes == (ROW[10], ROW[20])
    area = MapArea(street, route, MapAreaConfig(vru_margin_m=1.8)).at(EgoState(0.0, 20.0, -1.75, 0.0, 10.0))

    def kept(category: str, *y_m: float) -> list[bool]:
        count = len(y_m)
        boxes = Boxes(
            np.column_stack((np.full(count, 40.0), y_m)), np.full((count, 2), 0.02), np.zeros(count)
        )
        return area.kept(boxes, np.full(count, category)).tolist()

    # edge at -5.5; to the left the mark lets it into lane 11, whose margin is measured from its own border
    assert kept("pedestrian", -7.2, -7.4, 5.2, 5.4) == [True, False, True, False]
    assert kept("car", -1.75, 1.75, 5.25, -4.25) == [True, True, False, False]


def test_a_map_with_errors(street: VectorMap) -> None:
    route = route_from_lanes(street, [ROW[10], ROW[20]])
    faulty = FaultyMap(street, route, route.center_m, MapErrors(kerb_m=0.7))
    assert kerb(faulty, ROW[20], np.array([20.0]), "right")[0] == pytest.approx([2.7])


def test_heights_that_are_not_known_are_those_beside_them(tmp_path: Path) -> None:
    content = made.street()
    for side in ("left", "right"):
        border = content["lane_segments"]["10"][f"{side}_lane_boundary"]
        border.insert(1, {"x": 15.0, "y": border[0]["y"], "z": math.nan})
        border[0]["z"], border[2]["z"] = 1.0, 3.0
        content["lane_segments"]["20"][f"{side}_lane_boundary"] = [
            point | {"z": math.nan} for point in content["lane_segments"]["20"][f"{side}_lane_boundary"]
        ]
    network = load(tmp_path, content)
    assert network.center_line(ROW[10], np.array([0.0, 15.0, 60.0]))[2].tolist() == [1.0, 2.0, 3.0]
    assert network.center_line(ROW[20], np.array([0.0, 40.0]))[2].tolist() == [0.0, 0.0]


def test_repeated_points_and_borders_of_few_points_do_not_move_a_lane(tmp_path: Path) -> None:
    content = made.street()
    lane = content["lane_segments"]["10"]
    lane["left_lane_boundary"] = made.points((0, 0), (0, 0), (10, 0), (10, 0), (60, 0), (60, 0))
    lane["right_lane_boundary"] = made.points((0, -3.5), (60, -3.5), (60, -3.5))
    network = load(tmp_path, content)
    s = np.array([0.0, 5.0, 10.0, 37.0, 60.0])
    x, y, _, heading = network.center_line(ROW[10], s)
    assert x == pytest.approx(s)
    assert y == pytest.approx([-1.75] * 5)
    assert heading == pytest.approx([0.0] * 5)
    assert network.lane_width(ROW[10], s) == pytest.approx([3.5] * 5)


def test_maps_can_be_copied(street: VectorMap) -> None:
    for other in (copy.deepcopy(street), pickle.loads(pickle.dumps(street))):
        assert other.nearest_lane([(20.0, -1.0)]).lane.tolist() == [ROW[10]]


# --- maps of others, and damaged ones -------------------------------------------------------------------

SHARED = Path(__file__).parents[4].parent / "shared" / "argoverse2"
ARCHIVES = sorted(SHARED.glob("**/log_map_archive_*.json"))


@pytest.mark.parametrize("index", range(3))
def test_real_maps(index: int) -> None:
    """What holds on any map: widths, joints, neighbours that meet, lanes under their own middles."""
    if not ARCHIVES:
        pytest.skip("maps of Argoverse 2 are not in ../shared/argoverse2")
    network = load_drive_map(ARCHIVES[index])
    lanes = network.lanes
    count = len(json.loads(ARCHIVES[index].read_text())["lane_segments"])
    for lane in range(count):
        middle = 0.5 * lanes.s_end_m[lane]
        (x,), (y,), _, _ = network.center_line(lane, np.array([middle]))
        hits = network.locate([(x, y)])
        assert lane in hits.lane
        on_it = hits.lane == lane
        assert hits.s_m[on_it] == pytest.approx([middle], abs=0.05)
        ends = (lanes.s_end_m[lane], 0.0) if lanes.direction[lane] > 0 else (0.0, lanes.s_end_m[lane])
        for following in network.successors(lane):
            into = 0.0 if lanes.direction[following] > 0 else lanes.s_end_m[following]
            leaves, enters = (
                np.array(network.center_line(k, np.array([s]))[:2])[:, 0]
                for k, s in ((lane, ends[0]), (following, into))
            )
            assert leaves == pytest.approx(enters, abs=1e-6)
        for beside in (network.left_neighbour(lane), network.right_neighbour(lane)):
            if beside is not None and beside < count:
                assert lanes.s_end_m[beside] == lanes.s_end_m[lane]
                assert lanes.key[beside][0] == lanes.key[lane][0]


def flat(points: list[dict[str, float]]) -> list[tuple[float, float]]:
    return [(point["x"], point["y"]) for point in points]


def polygon(ring: list[tuple[float, float]]) -> shapely.Geometry:
    return shapely.make_valid(shapely.Polygon(ring))


@pytest.mark.parametrize("index", range(3))
def test_queries_are_what_the_file_says(index: int) -> None:
    """Another way to the same answers: one polygon per lane, all of them asked for every random point."""
    if not ARCHIVES:
        pytest.skip("maps of Argoverse 2 are not in ../shared/argoverse2")
    content = json.loads(ARCHIVES[index].read_text())
    given = list(content["lane_segments"].values())
    row = {lane["id"]: k for k, lane in enumerate(given)}
    network = load_drive_map(ARCHIVES[index])
    assert isinstance(network, VectorMap)
    for lane, k in zip(given, row.values(), strict=True):
        assert set(network.successors(k)) == {row[each] for each in lane["successors"] if each in row}
        for side, neighbour in (("left", network.left_neighbour(k)), ("right", network.right_neighbour(k))):
            named = lane[f"{side}_neighbor_id"]
            if named in row:
                assert neighbour == row[named]
            else:  # the edge of the street, or nothing
                assert neighbour is None or network.lanes.lane_type[neighbour] == "shoulder"

    xy = np.random.default_rng(index).uniform(network.bounds[:2], network.bounds[2:], (1000, 2))
    points = shapely.points(xy)
    borders = [(flat(lane["left_lane_boundary"]), flat(lane["right_lane_boundary"])) for lane in given]
    off_m = np.array([shapely.distance(points, polygon(left + right[::-1])) for left, right in borders])
    hits = network.locate(xy)
    is_given = hits.lane < len(given)
    assert set(zip(hits.lane[is_given].tolist(), hits.point[is_given].tolist(), strict=True)) == set(
        zip(*(axis.tolist() for axis in np.nonzero(off_m == 0.0)), strict=True)
    )
    for k, lane_row, margin_m in zip(hits.point, hits.lane, hits.margin_m, strict=True):
        if lane_row < len(given):
            lines = shapely.linestrings(borders[lane_row][0]), shapely.linestrings(borders[lane_row][1])
            assert margin_m == pytest.approx(min(shapely.distance(points[k], line) for line in lines))
    for kind, name in (("VEHICLE", "driving"), ("BIKE", "biking")):
        rows = [k for k, lane in enumerate(given) if lane["lane_type"] == kind]
        nearest = network.nearest_lane(xy, (name,))
        assert nearest.found.all() == bool(rows)
        if rows:
            assert nearest.distance_m == pytest.approx(off_m[rows].min(axis=0))
            assert off_m[nearest.lane, np.arange(len(xy))] == pytest.approx(nearest.distance_m)

    # shoulders are drivable; sidewalks are not, but where the edge bends inwards within their 1.5 m
    drivable = shapely.union_all(
        [polygon(flat(a["area_boundary"])) for a in content["drivable_areas"].values()]
    )
    kinds = network.lanes.lane_type[hits.lane]
    beyond_m = shapely.distance(points, drivable)
    assert beyond_m[hits.point[kinds == "shoulder"]].max() < 0.1
    sidewalk = np.unique(hits.point[kinds == "sidewalk"])
    assert len(sidewalk) > 20
    assert (beyond_m[sidewalk] > 0.0).mean() > 0.9
    assert beyond_m[sidewalk].max() < 2.0


def _first(**fields: Any) -> Callable[[dict[str, Any]], None]:
    """Fields of the first lane; None of them is taken away."""

    def damage(content: dict[str, Any]) -> None:
        content["lane_segments"]["10"] |= fields

    return damage


def _lacking(name: str) -> Callable[[dict[str, Any]], None]:
    return lambda content: content["lane_segments"]["10"].pop(name)


def _circle(content: dict[str, Any]) -> None:
    """Three lanes, each to the left of the next."""
    numbers = (10, 11, 13, 10)
    for k, left in pairwise(numbers):
        content["lane_segments"][str(k)]["left_neighbor_id"] = left
        content["lane_segments"][str(left)]["right_neighbor_id"] = k


FAR = made.points((0, 0), (1e9, 0))
POINT = made.points((1, 1), (1, 1))
DAMAGES: dict[str, tuple[Callable[[dict[str, Any]], Any], str]] = {
    "no lanes": (lambda m: m["lane_segments"].clear(), "no lanes in it"),
    "no lane segments": (lambda m: m.pop("lane_segments"), "not a map of Argoverse 2: expected objects"),
    "lanes as a list": (lambda m: m.update(lane_segments=[]), "not a map of Argoverse 2: expected objects"),
    "no areas": (lambda m: m.pop("drivable_areas"), "not a map of Argoverse 2: expected objects"),
    "a lane that is none": (
        lambda m: m["lane_segments"].update({"7": 3}),
        "lane 7: expected an object, got 3",
    ),
    "no successors": (_lacking("successors"), "lane 10: field 'successors' is missing"),
    "successors null": (_first(successors=None), "'successors' must be a list of whole numbers, got None"),
    "successor no number": (_first(successors=["20"]), "'successors' must be a list of whole numbers"),
    "id missing": (_lacking("id"), "lane 10: field 'id' is missing"),
    "id twice": (_first(id=11), "two lanes have the same id"),
    "another type": (_first(lane_type="TRAM"), "'lane_type' must be one of VEHICLE, BIKE, BUS, got 'TRAM'"),
    "another mark": (_first(left_lane_mark_type="ZIGZAG"), "'left_lane_mark_type' must be one of NONE, "),
    "mark a list": (_first(left_lane_mark_type=[]), "'left_lane_mark_type' must be one of NONE, "),
    "neighbour no number": (
        _first(left_neighbor_id=1.5),
        "'left_neighbor_id' must be a whole number, got 1.5",
    ),
    "junction a number": (_first(is_intersection=1), "'is_intersection' must be true or false, got 1"),
    "one point": (_first(left_lane_boundary=POINT[:1]), "'left_lane_boundary' must be 2 or more points"),
    "no points": (_first(left_lane_boundary={}), "'left_lane_boundary' must be 2 or more points"),
    "point without y": (_first(left_lane_boundary=[{"x": 1}, {"x": 2}]), "'left_lane_boundary' must be 2 or"),
    "no place": (
        _first(left_lane_boundary=[{"x": math.nan, "y": 0, "z": 0}, {"x": 9, "y": 0, "z": 0}]),
        "'left_lane_boundary' must be 2 or more points",
    ),
    "a place that is true": (
        _first(left_lane_boundary=[{"x": True, "y": 0, "z": 0}, {"x": 9, "y": 0, "z": 0}]),
        "'left_lane_boundary' must be 2 or more points",
    ),
    "a place as text": (
        _first(left_lane_boundary=[{"x": "1", "y": 0, "z": 0}, {"x": 9, "y": 0, "z": 0}]),
        "'left_lane_boundary' must be 2 or more points",
    ),
    "a place of 400 digits": (
        _first(left_lane_boundary=[{"x": 10**400, "y": 0, "z": 0}, {"x": 9, "y": 0, "z": 0}]),
        "number out of range",
    ),
    "a point as a list": (
        _first(left_lane_boundary=[[0, 0, 0], [9, 0, 0]]),
        "'left_lane_boundary' must be 2 or more points",
    ),
    "height without end": (
        _first(left_lane_boundary=[{"x": 0, "y": 0, "z": math.inf}, {"x": 9, "y": 0, "z": 0}]),
        "'left_lane_boundary' must be 2 or more points",
    ),
    "point far away": (_first(left_lane_boundary=FAR), "'left_lane_boundary' must be 2 or more points"),
    "no length": (_first(left_lane_boundary=POINT, right_lane_boundary=POINT), "lane 10: it has no length"),
    "too long": (
        _first(left_lane_boundary=made.points((0, 0), (3e4, 0))),
        "lane 10: it is 15030 m long, 10000 m at most expected",
    ),
    "neighbours in a circle": (_circle, "lane 10: its neighbours go round in a circle"),
    "area of two points": (
        lambda m: m["drivable_areas"]["1"].update(area_boundary=POINT),
        "drivable area 1: field 'area_boundary' must be 3 or more points",
    ),
    "crossing without edge": (
        lambda m: m["pedestrian_crossings"]["5"].pop("edge2"),
        "pedestrian crossing 5: field 'edge2' is missing",
    ),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_maps_are_one_line(tmp_path: Path, damage: str) -> None:
    content = made.street()
    spoil, message = DAMAGES[damage]
    spoil(content)
    with pytest.raises(DatasetError) as error:
        load(tmp_path, content)
    assert message in str(error.value)
    assert "log_map_archive_x.json" in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "not JSON"),
        ('{"lane_segments": {"1": ', "not JSON"),
        ("[]", "not a map of Argoverse 2"),
        ("[" * 100_000, "nested too deeply"),
        ('{"lane_segments": NaN}', "not a map of Argoverse 2"),
    ],
)
def test_files_that_are_no_map(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "log_map_archive_x.json"
    path.write_text(text)
    with pytest.raises(DatasetError, match=message):
        read_vector_map(path)


def test_folders_without_a_map(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no map/log_map_archive"):
        load_drive_map(tmp_path)


@pytest.mark.parametrize(
    "fields", [{"left_neighbor_id": 10}, {"left_neighbor_id": 12}, {"left_neighbor_id": 4}]
)
def test_neighbours_that_only_one_side_tells_are_none(tmp_path: Path, fields: dict[str, Any]) -> None:
    content = made.street()
    content["lane_segments"]["10"] |= fields
    assert load(tmp_path, content).left_neighbour(ROW[10]) is None
