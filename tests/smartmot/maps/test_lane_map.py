"""Perception on a map of another format: all values by hand."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from smartmot import EgoState, MapArea, MapAreaConfig, Pipeline, PipelineConfig
from smartmot.forecast import ForecastConfig
from smartmot.maps.follow import route_along, routes_from_poses
from smartmot.maps.regulatory import regulatory_elements
from smartmot.maps.route import Route, route_ahead
from smartmot.maps.walks import kerb, lanes_under
from smartmot.types import Boxes, Detections
from tests.smartmot.maps.polyline_map import Lane, PolylineMap

RIGHT, LEFT, CYCLES, WALK, BEND = range(5)


def _signal(kind: str, s_m: float, orientation: str, value: float | None = None) -> SimpleNamespace:
    return SimpleNamespace(
        road_id="street", id=f"{kind}{s_m}", name="", type=kind, value=value, s_m=s_m,
        orientation=orientation, applies_to=lambda lane: lane == RIGHT,
    )  # fmt: skip


@pytest.fixture(scope="module")
def street() -> PolylineMap:
    """100 m eastwards: two lanes of 3.5 m, to the right a cycle lane of 1 m and a sidewalk; then 50 m to the
    north-east along (0.8, 0.6). The left lane may be changed into from s = 20 to 60."""
    return PolylineMap(
        [
            Lane(
                [(0, 0), (100, 0)], left=LEFT, right=CYCLES, next_lanes=(BEND,), change={"left": [(20, 60)]}
            ),
            Lane([(0, 3.5), (100, 3.5)], right=RIGHT),
            Lane([(0, -2.25), (100, -2.25)], width_m=1.0, kind="biking", left=RIGHT, right=WALK),
            Lane([(0, -3.75), (100, -3.75)], width_m=2.0, kind="sidewalk", left=CYCLES),
            Lane([(100, 0), (140, 30)], road="bend"),
        ],
        signals=[_signal("206", 90.0, "+"), _signal("274", 30.0, "none", 50.0), _signal("205", 80.0, "-")],
        crosswalks=[SimpleNamespace(id="c", road_id="bend", s_m=10.0)],
    )


@pytest.fixture(scope="module")
def route(street: PolylineMap) -> Route:
    return route_ahead(street, RIGHT, 10.0, 130.0)


def _boxes(*places: tuple[float, float], size: tuple[float, float] = (0.5, 0.5)) -> Boxes:
    return Boxes(np.array(places), np.tile(size, (len(places), 1)), np.zeros(len(places)))


def _names(category: str, count: int) -> np.ndarray:
    return np.array([category] * count)


def test_the_route_goes_round_the_bend(route: Route) -> None:
    assert route.lanes == (RIGHT, BEND)
    assert route.length_m == pytest.approx(150.0)
    assert route.pose(125.0) == pytest.approx((120.0, 15.0, math.atan2(0.6, 0.8)))
    # 2 m to the left of (108, 6): the normal is (-0.6, 0.8)
    assert route.project(108.0 - 1.2, 6.0 + 1.6) == pytest.approx((110.0, 2.0))


def test_a_way_is_laid_over_the_lanes(street: PolylineMap) -> None:
    way = np.column_stack((np.arange(5.0, 96.0, 2.0), np.zeros(46)))
    assert route_along(street, way, ahead_m=20.0).lanes == (RIGHT, BEND)


def test_routes_from_recorded_poses(street: PolylineMap) -> None:
    """The second frame keeps the route; the third is on the left lane, the fourth 3.1 m beside it."""
    points = np.array([[10.0, 0.0], [20.0, 0.0], [30.0, 3.5], [40.0, 3.5 + 1.75 + 3.1]])
    first, second, third, fourth = routes_from_poses(street, points, np.full(4, 30.0), np.full(4, 60.0))
    assert first is not None
    assert first.lanes == (RIGHT,)
    assert second is first
    assert third is not None
    assert third.lanes == (LEFT,)
    assert fourth is None


def test_a_route_that_ends_too_soon_is_looked_for_again(street: PolylineMap) -> None:
    points = np.array([[10.0, 0.0], [75.0, 0.0]])
    first, second = routes_from_poses(street, points, np.full(2, 30.0), np.full(2, 60.0))
    assert first is not None
    assert second is not None
    assert (first.lanes, second.lanes) == ((RIGHT,), (RIGHT, BEND))


def test_lanes_under_poses(street: PolylineMap) -> None:
    """A quarter of a metre inside the right lane's border; across it nothing runs along."""
    points = np.array([[50.0, 1.5], [50.0, 1.5], [104.0, 3.0]])
    under = lanes_under(street, points, np.array([0.0, math.pi / 2, math.atan2(0.6, 0.8)]))
    assert (under.point.tolist(), under.lane.tolist()) == ([0, 2], [RIGHT, BEND])
    assert under.s_m.tolist() == pytest.approx([50.0, 5.0])
    assert under.margin_m.tolist() == pytest.approx([0.25, 1.75])


def test_the_kerb_is_behind_the_cycle_lane(street: PolylineMap) -> None:
    s = np.array([10.0, 20.0])
    distance, has_sidewalk = kerb(street, RIGHT, s, "right", 1.75)
    assert (distance.tolist(), has_sidewalk) == ([2.75, 2.75], True)
    assert kerb(street, RIGHT, s, "left")[1] is False
    assert kerb(street, LEFT, s, "right", over_lanes=True)[0].tolist() == [4.5, 4.5]


def test_monitored_area(street: PolylineMap, route: Route) -> None:
    """At 10 m/s 30 m ahead and 15 m behind; VRUs to 1.8 m over the sidewalk, whose edge is at y = -2.75."""
    ego = EgoState(0.0, 50.0, 0.0, 0.0, 10.0)
    area = MapArea(street, route, MapAreaConfig()).at(ego)
    roles = {(lane.role, lane.front): (lane.from_m, lane.to_m) for lane in area.lanes}
    assert roles == {
        ("current", False): pytest.approx((35.0, 50.0)),
        ("current", True): pytest.approx((50.0, 80.0)),
        ("left", False): pytest.approx((35.0, 50.0)),
        ("left", True): pytest.approx((50.0, 80.0)),
    }
    places = [(70.0, -4.5), (70.0, -4.6), (79.9, 0.0), (80.1, 0.0), (35.1, 0.0), (34.9, 0.0), (70.0, 7.0)]
    expected = [True, False, True, False, True, False, True]
    assert area.kept(_boxes(*places), _names("pedestrian", 7)).tolist() == expected
    related = area.relevance(_boxes(*places), _names("pedestrian", 7))
    assert related.in_route.tolist() == [True, False, True, False, False, False, False]
    assert related.on_way.tolist() == [False, False, True, False, False, False, False]
    # a car 0.9 m + 0.3 m beside the path leaves the ego its way
    cars = _boxes((60.0, -2.0), (60.0, -2.15), size=(4.0, 1.8))
    related = area.relevance(cars, _names("car", 2))
    assert related.in_route.tolist() == [True, True]
    assert related.on_way.tolist() == [True, False]


def test_left_lane_only_where_the_mark_lets_the_ego_change(street: PolylineMap, route: Route) -> None:
    area = MapArea(street, route, MapAreaConfig()).at(EgoState(0.0, 65.0, 0.0, 0.0, 10.0))
    assert {lane.role for lane in area.lanes} == {"current"}


def test_regulatory_elements(street: PolylineMap, route: Route) -> None:
    """Signs for the other direction are left out; the crosswalk is 10 m after the bend at 100 m."""
    elements = regulatory_elements(street, route, 20.0, 120.0)
    assert [(e.kind, e.distance_m, e.value) for e in elements] == [
        ("speed_limit", pytest.approx(10.0), 50.0),
        ("stop", pytest.approx(70.0), None),
        ("crosswalk", pytest.approx(90.0), None),
    ]


def test_the_ego_is_forecast_round_the_bend(street: PolylineMap, route: Route) -> None:
    """At 10 m/s from x = 90: after 2 s it is 10 m round the bend."""
    config = PipelineConfig(forecast=ForecastConfig(ego="route"))
    pipeline = Pipeline(MapArea(street, route, MapAreaConfig()), config)
    ego = EgoState(0.0, 90.0, 0.0, 0.0, 10.0)
    _, frame = pipeline.step(pipeline.initial(), Detections.empty(0.0), ego)
    assert frame.ego_forecast.center_m[0, 20] == pytest.approx((108.0, 6.0))
