"""The ego's way apart from the area: straight ahead or along the planned path, for any area."""

from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from opendrive import load_map
from smartmot import (
    ConfigError,
    EverythingArea,
    PathArea,
    PathAreaConfig,
    PipelineConfig,
    PlannedPath,
    RectangularArea,
    RectangularConfig,
)
from smartmot.area import MapArea, MapAreaConfig, MonitoredArea, MonitoredLanes, Relevance, with_way
from smartmot.area.localised import Alignment, LocalisedArea
from smartmot.area.monitored import outline_points, within_reach
from smartmot.area.way import PATH_CLEARANCE_M, WAY_HALF_WIDTH_M, Way
from smartmot.decision.braking import BrakingDistance
from smartmot.maps.route import route_ahead
from smartmot.types import Boxes, EgoState

STREET = Path(__file__).parents[3] / "scenarios" / "maps" / "urban_street.xodr"
EGO = EgoState(0.0, 10.0, 0.0, 0.0, 10.0, width_m=1.8)
LEFT_TURN = PlannedPath.through([[0.0, 0.0], [30.0, 0.0], [30.0, 50.0]])
"""Straight on for 20 m from the ego, then to the left."""


def boxes(*points: tuple[float, float], width_m: float = 1.8) -> tuple[Boxes, np.ndarray]:
    """Standing cars, or narrower ones, side on to x."""
    n = len(points)
    return Boxes(np.array(points), np.tile((0.2, width_m), (n, 1)), np.zeros(n)), np.full(n, "car")


def everything(way: str, standing: str, path: PlannedPath | None = LEFT_TURN) -> MonitoredArea:
    return with_way(EverythingArea().at(EGO), EGO, path, way, standing)


def test_as_the_area_says_is_the_area_itself() -> None:
    area = EverythingArea().at(EGO)
    assert with_way(area, EGO, LEFT_TURN, "area", "area") is area


@pytest.mark.parametrize(
    ("way", "on_way"),
    [
        ("straight", [True, True, False, True, False, False]),
        ("path", [True, True, False, False, True, False]),
    ],
)
def test_a_centre_within_half_a_lane_of_the_way_is_in_it(way: str, on_way: list[bool]) -> None:
    """Before the turn both ways are the same; beyond it one goes on along x, the other along y."""
    where = ((20.0, 0.0), (20.0, 1.75), (20.0, 1.76), (50.0, -1.7), (31.7, 20.0), (31.8, 20.0))
    area = everything(way, "area")
    assert area.relevance(*boxes(*where)).on_way.tolist() == on_way
    assert area.on_lane(np.array(where)).tolist() == on_way


@pytest.mark.parametrize(
    ("standing", "in_route"), [("straight", [True, False, True, False]), ("path", [True, False, False, True])]
)
def test_what_stands_counts_by_its_outline_and_the_egos(standing: str, in_route: list[bool]) -> None:
    """Half the ego, 0.3 m of clearance, half a car: 0.9 + 0.3 + 0.9 m; 0.1 m beside a path along y."""
    where = ((20.0, 2.09), (20.0, 2.11), (60.0, 2.0), (31.29, 20.0))
    assert everything("area", standing).relevance(*boxes(*where)).in_route.tolist() == in_route


def test_the_way_begins_at_the_ego_and_the_area_limits_it() -> None:
    ways = with_way(
        RectangularArea(RectangularConfig(max_length_m=30.0), BrakingDistance()).at(EGO),
        EGO,
        None,
        "straight",
        "straight",
    )
    relevance = ways.relevance(*boxes((9.8, 0.0), (35.0, 0.0), (60.0, 0.0)))
    length_m = 1.4 * BrakingDistance().at(10.0)
    assert length_m < 25.0
    assert relevance.on_way.tolist() == relevance.in_route.tolist() == [False, length_m >= 24.9, False]


def test_without_a_path_the_way_is_straight() -> None:
    cars = boxes((20.0, 1.0), (31.0, 20.0), (45.0, -1.0))
    straight, unknown = everything("straight", "straight"), everything("path", "path", None)
    for name in ("in_route", "on_way", "within_reach"):
        assert (
            getattr(straight.relevance(*cars), name).tolist()
            == getattr(unknown.relevance(*cars), name).tolist()
        )


@given(st.floats(-3.0, 3.0), st.floats(-1.5, 1.5), st.floats(-30.0, 30.0), st.floats(-5.0, 5.0))
def test_along_a_straight_path_the_lane_lies_about_the_path(
    yaw_rad: float, beside_m: float, x_m: float, y_m: float
) -> None:
    """Straight ahead it lies about the ego, which may be beside its path."""
    ego = EgoState(0.0, 4.0, -3.0, yaw_rad, 10.0)
    along, left = np.array([np.cos(yaw_rad), np.sin(yaw_rad)]), np.array([-np.sin(yaw_rad), np.cos(yaw_rad)])
    start = np.array([4.0, -3.0]) + beside_m * left - 20.0 * along
    path = PlannedPath.through([start, start + 90.0 * along])
    point = np.array([[4.0, -3.0]]) + x_m * along + y_m * left
    for way, middle_m in (("straight", 0.0), ("path", beside_m)):
        aside_m = abs(y_m - middle_m)
        if min(abs(aside_m - 1.75), abs(x_m)) > 1e-6:
            lane = with_way(EverythingArea().at(ego), ego, path, way, "area").on_lane(point)
            assert lane.tolist() == [x_m >= 0.0 and aside_m <= 1.75]


@pytest.mark.parametrize("name", ["way", "standing"])
def test_an_unknown_way_is_refused(name: str) -> None:
    with pytest.raises(ConfigError, match=rf"{name} must be one of area, straight, path, got 'route'"):
        PipelineConfig(**{name: "route"})  # type: ignore[arg-type]


def test_the_corridor_follows_the_path_and_has_the_width_asked_for() -> None:
    """Half a car's width reaches into a corridor of 3 m to each side."""
    where = ((20.0, 3.89), (20.0, 3.91), (60.0, 0.0), (32.9, 30.0), (33.2, 30.0), (5.0, 0.0))
    area = PathArea(PathAreaConfig(3.0)).at(EGO, LEFT_TURN)
    assert area.relevance(*boxes(*where)).within_reach.tolist() == [True, False, False, True, False, False]
    assert area.kept(*boxes(*where)).all()
    ((role, ring),) = area.polygons()
    assert role == "path"
    straight = np.column_stack((np.arange(10.0, 30.0, 2.0), np.full(10, 3.0)))
    assert ring[:10] == pytest.approx(straight)
    assert ring[-10:] == pytest.approx(straight[::-1] * (1.0, -1.0))


def test_a_corridor_without_limit_counts_whatever_is_ahead() -> None:
    area = PathArea().at(EGO, LEFT_TURN)
    cars = boxes((20.0, 80.0), (9.0, 0.0), (20.0, 0.0), (31.0, 20.0))
    relevance = area.relevance(*cars)
    assert relevance.within_reach.tolist() == [True, False, True, True]
    assert relevance.in_route.tolist() == relevance.on_way.tolist() == [False, False, True, True]
    assert area.polygons() == []
    with pytest.raises(ConfigError, match="half_width_m must be positive"):
        PathAreaConfig(0.0)


def test_an_area_with_a_way_of_its_own_is_not_asked_twice() -> None:
    area = PathArea().at(EGO, LEFT_TURN)
    assert with_way(area, EGO, LEFT_TURN, "path", "path") is area
    assert with_way(area, EGO, LEFT_TURN, "area", "area") is area
    objects, category = boxes((40.0, 0.0), (30.0, 20.0))  # straight ahead, and beyond the turn
    straight = with_way(area, EGO, LEFT_TURN, "straight", "area").relevance(objects, category)
    assert straight.on_way.tolist() == [True, False]
    assert straight.in_route.tolist() == [False, True]


@pytest.mark.parametrize("reach_m", [None, 20.0])
def test_reach_alone_is_that_of_the_relevance(reach_m: float | None) -> None:
    network = load_map(STREET)
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), 0.0, 0.0)
    area = MapArea(network, route, MapAreaConfig(reach_m=reach_m)).at(EGO)
    shifted = LocalisedArea(area, Alignment(replace(EGO, x_m=3.0, yaw_rad=0.3), EGO))
    asked = boxes(*((x, y) for x in np.linspace(-30.0, 60.0, 31) for y in (-3.0, 0.0)))
    for each in (area, shifted, EverythingArea().at(EGO)):
        reach = within_reach(each, *asked)
        assert reach.tolist() == each.relevance(*asked).within_reach.tolist()
        assert reach.any()
        assert not reach.all()


def test_an_area_derived_from_ours_is_asked_for_its_own_relevance() -> None:
    class Blind(MonitoredLanes):
        def relevance(self, boxes: Boxes, category: np.ndarray) -> Relevance:
            nothing = np.zeros(len(boxes), dtype=np.bool_)
            return Relevance(nothing, nothing, nothing)

    network = load_map(STREET)
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), 0.0, 0.0)
    ours = MapArea(network, route, MapAreaConfig()).at(EGO)
    theirs = Blind(*(getattr(ours, item.name) for item in fields(ours) if item.init))
    asked = boxes((20.0, 0.0))
    assert with_way(ours, EGO, LEFT_TURN, "path", "path").relevance(*asked).in_route.all()
    assert not with_way(theirs, EGO, LEFT_TURN, "path", "path").relevance(*asked).in_route.any()


@given(st.integers(0, 2**32 - 1), st.booleans())
def test_boxes_meet_the_way_where_any_of_their_outline_points_does(seed: int, straight: bool) -> None:
    """Every point of every box is placed here; `meets` leaves out the boxes that cannot reach the way."""
    rng = np.random.default_rng(seed)
    n, step = 30, rng.uniform(-0.3, 0.3, 20).cumsum()
    points = np.cumsum(5.0 * np.column_stack((np.cos(step), np.sin(step))), axis=0)
    way = Way(EGO, None if straight else PlannedPath.through(points))
    near = np.column_stack((rng.uniform(-20.0, 80.0, n), rng.uniform(-8.0, 8.0, n)))
    ring = Boxes(near, rng.uniform(0.2, 12.0, (n, 2)), rng.uniform(-4.0, 4.0, n))
    passed, in_lane = way.meets(ring)
    ahead, aside = (placed.reshape(n, 9) for placed in way.place(outline_points(ring)))
    on_it = (ahead >= 0.0) & (np.abs(aside) <= EGO.width_m / 2 + PATH_CLEARANCE_M)
    np.testing.assert_array_equal(passed, on_it.any(axis=1))
    centered = (ahead[:, 4] >= 0.0) & (np.abs(aside[:, 4]) <= WAY_HALF_WIDTH_M)
    np.testing.assert_array_equal(in_lane, centered)
