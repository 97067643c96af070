from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given
from hypothesis import strategies as st

from opendrive import RoadNetwork, load_map
from smartmot.area import (
    MapArea,
    MapAreaConfig,
    MonitoredLanes,
    PathArea,
    with_way,
)
from smartmot.errors import ConfigError
from smartmot.maps.follow import route_along
from smartmot.maps.route import route_ahead, route_from_lanes
from smartmot.types import CATEGORIES, Boxes, EgoState, FloatArray

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"

TOWN04 = Path(__file__).parents[4] / "shared" / "opendrive" / "maps" / "Town04.xodr"

SIZES = {"car": (4.4, 1.8), "pedestrian": (0.5, 0.5), "cyclist": (1.8, 0.6)}


@cache
def _network(name: str) -> RoadNetwork:
    return load_map(MAPS / f"{name}.xodr")


@cache
def _street(name: str = "urban_street", **settings: float) -> MapArea:
    """Eastbound on the street; the lane's middle is y = -1.75 m."""
    network = _network(name)
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), 0.0, 0.0)
    return MapArea(network, route, MapAreaConfig(**settings))


def _ego(x: float, speed: float, y: float = -1.75, yaw: float = 0.0, yaw_rate: float = 0.0) -> EgoState:
    return EgoState(0.0, x, y, yaw, speed, yaw_rate_radps=yaw_rate)


def _dots(center_m: FloatArray) -> Boxes:
    """Boxes so small that outline and centre are the same."""
    return Boxes(center_m, np.full((len(center_m), 2), 1e-6), np.zeros(len(center_m)))


def _kept(area: MonitoredLanes, category: str, *points: tuple[float, float]) -> list[bool]:
    center = np.array(points, dtype=float)
    return area.kept(_dots(center), np.full(len(center), category)).tolist()


def _boxes(category: str, *points: tuple[float, float]) -> tuple[Boxes, np.ndarray]:
    n = len(points)
    return Boxes(np.array(points), np.tile(SIZES[category], (n, 1)), np.zeros(n)), np.full(n, category)


@pytest.mark.parametrize(("speed", "front"), [(0.0, 30.0), (10.0, 30.0), (50 / 3.6, 41.667), (20.0, 60.0)])
def test_front_grows_with_speed_and_back_is_half_of_it(speed: float, front: float) -> None:
    area = _street().at(_ego(300.0, speed))
    assert _kept(area, "car", (300 + front - 0.01, -1.75), (300 + front + 0.01, -1.75)) == [True, False]
    assert _kept(area, "car", (300 - front / 2 + 0.01, -1.75), (300 - front / 2 - 0.01, -1.75)) == [
        True,
        False,
    ]


def test_lengths_are_cut_where_the_map_ends() -> None:
    area = _street().at(_ego(590.0, 20.0))
    assert _kept(area, "car", (599.9, -1.75), (600.1, -1.75)) == [True, False]


@pytest.mark.parametrize(("name", "kerbside"), [("urban_street", 0.0), ("urban_street_parking", 2.0)])
@pytest.mark.parametrize("category", CATEGORIES)
def test_margin_over_the_sidewalk_is_for_vulnerable_users_only(
    name: str, kerbside: float, category: str
) -> None:
    """1.8 m over the sidewalk, measured from its edge: behind the parking strip where there is one."""
    area = _street(name).at(_ego(300.0, 10.0))
    near = -1.75 - (1.75 + kerbside + 1.79)
    far = -1.75 - (1.75 + kerbside + 1.81)
    vulnerable = category in ("pedestrian", "cyclist")
    assert _kept(area, category, (320, near), (320, far)) == [vulnerable, False]
    # in the lane itself everybody counts, up to its borders
    assert _kept(area, category, (320, -0.01), (320, -3.49)) == [True, True]
    # on the oncoming side: vehicles nowhere, VRUs up to 1.8 m beyond the middle of the street
    assert _kept(area, category, (320, 1.79), (320, 1.81), (320, 3.4)) == [vulnerable, False, False]


def test_oncoming_vehicle_is_not_kept() -> None:
    area = _street().at(_ego(300.0, 10.0))
    assert _kept(area, "car", (320, 1.75), (320, 0.02)) == [False, False]
    assert {lane.role for lane in area.lanes} == {"current"}


def test_no_margin_when_none_is_asked_for() -> None:
    area = _street(vru_margin_m=0.0).at(_ego(300.0, 10.0))
    assert _kept(area, "pedestrian", (320, -3.49), (320, -3.51)) == [True, False]


def test_in_route_is_ahead_only_and_on_lane_has_no_margin() -> None:
    area = _street().at(_ego(300.0, 10.0))
    boxes, category = _boxes(
        "pedestrian", (310, -1.75), (310, -4.5), (310, -5.31), (299, -1.75), (329, -1.75)
    )
    assert area.relevance(boxes, category).in_route.tolist() == [True, True, False, False, True]
    assert area.on_lane(boxes.center_m).tolist() == [True, False, False, False, True]
    assert area.kept(boxes, category).tolist() == [True, True, False, True, True]


def test_reach_is_measured_from_the_egos_centre_to_the_near_side() -> None:
    area = _street(reach_m=22.2).at(_ego(300.0, 10.0))
    boxes, category = _boxes("pedestrian", (322.44, -1.75), (322.46, -1.75), (299.76, -1.75), (299.74, -1.75))
    assert area.relevance(boxes, category).within_reach.tolist() == [True, False, True, False]
    assert area.relevance(boxes, category).in_route.tolist() == [True, False, False, False]
    # what is beyond the reach still is tracked
    assert area.kept(boxes, category).all()


def test_in_route_follows_the_lane_not_the_heading() -> None:
    """An ego that points 20 degrees off the lane still monitors the lane."""
    area = _street().at(_ego(300.0, 10.0, yaw=0.35))
    assert _kept(area, "car", (325, -1.75), (325, -1.75 + 25 * 0.36)) == [True, False]


def _roles(*route: tuple[str, int]) -> dict[str, set[str]]:
    """Roads of the junction by role, with the ego 10 m before the junction."""
    network = _network("urban_intersection")
    lanes = [network.lane_index_of((road, 0, lane)) for road, lane in route]
    path = route_from_lanes(network, lanes)
    area = MapArea(network, path, MapAreaConfig()).at(EgoState(0.0, *path.pose(190.0), 5.0))
    roles: dict[str, set[str]] = {}
    for lane in area.lanes:
        roles.setdefault(lane.role, set()).add(network.lanes.key[lane.strip.lane].road_id)
    return roles


def test_roles_driving_straight_on_from_the_west() -> None:
    assert _roles(("1", -1), ("13", -1), ("3", -1)) == {
        "current": {"1", "13"},  # 30 m ahead end inside the junction of 24 m
        "split": {"12", "14"},
        "merge": {"23", "43"},
        # both crossing directions, the left turn from the south and the oncoming left turn
        "cross": {"24", "42", "21", "32"},
    }


def test_roles_turning_left_from_the_west() -> None:
    assert _roles(("1", -1), ("14", -1), ("4", -1)) == {
        "current": {"1", "14"},  # 30 m ahead end on the left turn
        "split": {"12", "13"},
        "merge": {"24", "34"},
        "cross": {"31", "42", "21", "43"},
    }


def test_roles_turning_right_from_the_west() -> None:
    assert _roles(("1", -1), ("12", -1), ("2", 1)) == {
        "current": {"1", "12", "2"},
        "split": {"13", "14"},
        "merge": {"42", "32"},
    }


def test_junction_lanes_count_as_a_whole_and_only_while_ahead() -> None:
    network = _network("urban_intersection")
    lanes = [network.lane_index_of((road, 0, -1)) for road in ("1", "13", "3")]
    path = route_from_lanes(network, lanes)
    strategy = MapArea(network, path, MapAreaConfig())
    from_south = (1.75, -11.0)
    for station, seen in ((165.0, False), (175.0, True), (210.0, True), (225.0, False)):
        area = strategy.at(EgoState(0.0, *path.pose(station), 5.0))
        assert _kept(area, "car", from_south) == [seen], station
    # tracked, but never an object in the route
    area = strategy.at(EgoState(0.0, *path.pose(190.0), 5.0))
    boxes, category = _boxes("car", from_south)
    assert not area.relevance(boxes, category).in_route.any()


@pytest.fixture
def motorway(tmp_path: Path) -> Callable[..., MapArea]:
    """Three lanes per direction, 300 m; marks give the laneChange on each right lane's outer border."""

    def make(
        ego_lane: int = -2,
        marks: dict[int, str] | None = None,
        kinds: dict[int, str] | None = None,
        later: str | None = None,
    ) -> MapArea:
        def lane(number: int) -> str:
            mark = f'<roadMark sOffset="0" type="solid" laneChange="{(marks or {}).get(number, "both")}"/>'
            if later and number == -2:
                mark += f'<roadMark sOffset="100" type="solid" laneChange="{later}"/>'
            kind = (kinds or {}).get(number, "driving")
            width = '<width sOffset="0" a="3.5" b="0" c="0" d="0"/>' if number else ""
            return f'<lane id="{number}" type="{kind if number else "none"}">{width}{mark}</lane>'

        file = tmp_path / "motorway.xodr"
        file.write_text(
            '<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="1" length="300" junction="-1"><planView>'
            '<geometry s="0" x="0" y="0" hdg="0" length="300"><line/></geometry></planView><lanes>'
            f'<laneSection s="0"><left>{"".join(lane(k) for k in (3, 2, 1))}</left><center>{lane(0)}</center>'
            f"<right>{''.join(lane(k) for k in (-1, -2, -3))}</right></laneSection></lanes></road>"
            "</OpenDRIVE>",
            encoding="utf-8",
        )
        network = load_map(file)
        index = network.lane_index_of(("1", 0, ego_lane))
        return MapArea(network, route_from_lanes(network, [index]), MapAreaConfig())

    return make


def _sides(area: MapArea, x: float = 50.0) -> dict[str, int]:
    """Lane ids by side, for an ego at x."""
    lane = area.route.strips[0]
    k = lane.center_m[0, 1]
    yaw = 0.0 if lane.center_m[-1, 0] > lane.center_m[0, 0] else np.pi
    found = area.at(_ego(x, 10.0, y=float(k), yaw=yaw)).lanes
    return {
        m.role: area.network.lanes.key[m.strip.lane].lane_id for m in found if m.role in ("left", "right")
    }


# the mark left of lane -2 is on lane -1, the mark right of it on lane -2 itself; ids grow to the left
@pytest.mark.parametrize(
    ("left_mark", "right_mark", "expected"),
    [
        ("both", "both", {"left": -1, "right": -3}),
        ("none", "both", {"right": -3}),
        ("both", "none", {"left": -1}),
        ("none", "none", {}),
        ("increase", "increase", {"left": -1}),
        ("decrease", "decrease", {"right": -3}),
    ],
)
def test_neighbours_only_where_the_mark_allows_the_change(
    motorway: Callable[..., MapArea], left_mark: str, right_mark: str, expected: dict[str, int]
) -> None:
    assert _sides(motorway(marks={-1: left_mark, -2: right_mark})) == expected


def test_neighbours_seen_against_the_road(motorway: Callable[..., MapArea]) -> None:
    """On lane 2 traffic runs against s: its left is lane 1, and `increase` leads to lane 3, its right."""
    assert _sides(motorway(ego_lane=2)) == {"left": 1, "right": 3}
    assert _sides(motorway(ego_lane=2, marks={1: "increase", 2: "increase"})) == {"right": 3}
    assert _sides(motorway(ego_lane=2, marks={1: "decrease", 2: "decrease"})) == {"left": 1}


def test_lanes_of_other_direction_or_type_are_no_neighbours(motorway: Callable[..., MapArea]) -> None:
    assert _sides(motorway(ego_lane=-1)) == {"right": -2}
    assert _sides(motorway(kinds={-3: "shoulder"})) == {"left": -1}
    assert _sides(motorway(ego_lane=-3)) == {"left": -2}


def test_permission_is_read_where_the_ego_is(motorway: Callable[..., MapArea]) -> None:
    area = motorway(later="none")  # right change allowed until x = 100 m
    assert _sides(area, 99.0) == {"left": -1, "right": -3}
    assert _sides(area, 101.0) == {"left": -1}


def test_vehicles_in_a_permitted_neighbour_are_kept_but_not_in_the_route(
    motorway: Callable[..., MapArea],
) -> None:
    here = motorway(marks={-2: "none"}).at(_ego(150.0, 10.0, y=-5.25))
    left, right = (165.0, -1.75), (165.0, -8.75)
    assert _kept(here, "car", left, right, (165.0, 1.75)) == [True, False, False]
    boxes, category = _boxes("car", left, (165.0, -5.25))
    assert here.relevance(boxes, category).in_route.tolist() == [False, True]
    # along the neighbour the same stretch counts: 30 m in front, 15 m behind
    stretch = [(179.9, -1.75), (180.1, -1.75), (135.1, -1.75), (134.9, -1.75)]
    assert _kept(here, "car", *stretch) == [True, False, True, False]


def test_motorway_of_town04_has_neighbours_on_both_sides() -> None:
    if not TOWN04.is_file():
        pytest.skip(f"reference map is absent: {TOWN04}")
    network = load_map(TOWN04)
    for number, sides in (
        (-1, {"right": -2}),
        (-2, {"left": -1, "right": -3}),
        (-3, {"left": -2, "right": -4}),
        (-4, {"left": -3}),
    ):
        lane = network.lane_index_of(("35", 0, number))
        s = 0.5 * float(network.lanes.s_start_m[lane] + network.lanes.s_end_m[lane])
        area = MapArea(network, route_from_lanes(network, [lane]), MapAreaConfig())
        x, y, _, yaw = (float(v) for v in network.center_line(lane, s))
        lanes = area.at(EgoState(0.0, x, y, yaw, 30.0)).lanes
        found = {m.role: network.lanes.key[m.strip.lane].lane_id for m in lanes if m.role != "current"}
        assert found == sides


def test_outlines_contain_what_is_kept() -> None:
    network = _network("urban_intersection")
    path = route_from_lanes(network, [network.lane_index_of((r, 0, -1)) for r in ("1", "13", "3")])
    area = MapArea(network, path, MapAreaConfig()).at(EgoState(0.0, *path.pose(190.0), 5.0))
    outlines = area.polygons()
    assert {role for role, _ in outlines} == {
        "vru_margin", "current", "back", "split", "merge", "cross"
    }  # fmt: skip
    points = np.random.default_rng(0).uniform((-50, -25), (30, 25), (4000, 2))
    for category, roles in (("car", {"vru_margin"}), ("pedestrian", set())):
        drawn = shapely.union_all([shapely.Polygon(ring).buffer(0) for r, ring in outlines if r not in roles])
        sure = shapely.distance(drawn.boundary, shapely.points(points)) > 0.1
        kept = area.kept(_dots(points), np.full(len(points), category))
        np.testing.assert_array_equal(kept[sure], shapely.contains_xy(drawn, points)[sure])


@pytest.mark.parametrize(
    "settings",
    [
        {"vru_margin_m": -0.1},
        {"min_front_m": 0.0},
        {"front_time_s": -1.0},
        {"back_fraction": 1.1},
        {"reach_m": 0.0},
    ],
)
def test_impossible_map_settings_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        MapAreaConfig(**settings)


def _changing_area() -> MapArea:
    """From the right into the left of two lanes eastbound, from x = 200 m to 240 m."""
    network = load_map(MAPS.parent / "scenes" / "maps" / "street_two_lanes.xodr")
    x = np.arange(50.0, 450.0, 2.0)
    share = (1 - np.cos(np.pi * np.clip((x - 200.0) / 40.0, 0.0, 1.0))) / 2
    route = route_along(network, np.column_stack((x, -5.25 + 3.5 * share)), 30.0, 30.0)
    return MapArea(network, route, MapAreaConfig())


def test_what_stands_where_the_route_has_left_the_lane_is_not_in_the_way() -> None:
    area = _changing_area().at(_ego(205.0, 20.0, y=-5.2))
    boxes, category = _boxes("car", (230, -5.25), (255, -5.25), (260, -1.75), (195, -1.75), (215, -1.75))
    found = area.relevance(boxes, category)
    # beside the path's end, in the lane that it leaves, in the lane that it takes, and there behind the ego
    assert found.in_route.tolist() == [True, False, True, False, True]
    # the path passes the cars at 230 and 215 m by about 3 and 2.4 m, more than half of both and 0.3 m
    assert found.on_way.tolist() == [False, False, True, False, False]
    # the left lane is monitored behind the ego too, since it may be changed into; the right one ahead
    assert area.kept(boxes, category).tolist() == [True, True, True, True, True]


def test_the_lane_changed_into_is_a_neighbour_before_the_change() -> None:
    area = _changing_area()
    roles = {(lane.role, lane.front) for lane in area.at(_ego(120.0, 10.0, y=-5.25)).lanes}
    assert roles == {("current", False), ("current", True), ("left", False), ("left", True)}
    roles = {(lane.role, lane.front) for lane in area.at(_ego(300.0, 10.0)).lanes}
    assert roles == {("current", False), ("current", True), ("right", False), ("right", True)}


# --- against the planned path -------------------------------------------------------------------------


@cache
def _turning(margin_m: float) -> MapArea:
    """To the left at the shipped intersection, from the west."""
    network = _network("urban_intersection")
    lanes = [network.lane_index_of((road, 0, -1)) for road in ("1", "14", "4")]
    return MapArea(network, route_from_lanes(network, lanes), MapAreaConfig(vru_margin_m=margin_m))


MARGINS_M = (0.0, 0.5, 1.8, 5.0, 8.0, 30.0)


@given(
    st.integers(0, 2**32 - 1), st.floats(0.0, 1.0), st.floats(0.0, 20.0), st.sampled_from(["street", "turn"])
)
def test_the_map_is_the_planned_path_without_what_its_lanes_and_margins_leave_out(
    seed: int, share: float, speed: float, where: str
) -> None:
    """With path and factors alike: a wider margin only adds people; who is left is as the path has it."""
    areas = [_street(vru_margin_m=m) if where == "street" else _turning(m) for m in MARGINS_M]
    route = areas[0].route
    x, y, yaw = route.pose(share * route.length_m)
    ego, rng = EgoState(0.0, x, y, yaw, speed), np.random.default_rng(seed)
    boxes = Boxes(
        np.array([x, y]) + rng.uniform(-50.0, 50.0, (60, 2)),
        rng.uniform(0.4, 5.0, (60, 2)),
        rng.uniform(-3, 3, 60),
    )
    category = rng.choice(["car", "pedestrian", "cyclist"], 60)
    of_path = PathArea().at(ego, route).relevance(boxes, category)
    kept = [area.at(ego).kept(boxes, category) for area in areas]
    for area, mask, wider in zip(areas, kept, [*kept[1:], np.ones(60, dtype=bool)], strict=True):
        assert not (mask & ~wider).any()
        assert (mask == kept[0])[category == "car"].all()
        relevance = with_way(area.at(ego), ego, route, "path", "path").relevance(boxes, category)
        for name in ("in_route", "on_way", "within_reach"):
            assert getattr(relevance, name)[mask].tolist() == getattr(of_path, name)[mask].tolist()


def test_a_margin_is_cut_by_nothing_beside_the_road() -> None:
    """With 8 m people count beyond the far border of the sidewalk, 8 m from the kerb at y = -3.5 m."""
    area = _street(vru_margin_m=8.0).at(_ego(100.0, 10.0))
    assert _kept(area, "pedestrian", (120.0, -11.49), (120.0, -11.51)) == [True, False]
