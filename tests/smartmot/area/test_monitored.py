from functools import cache
from pathlib import Path

import numpy as np
import pytest

from opendrive import RoadNetwork, load_map
from smartmot.area import (
    EverythingArea,
    MapArea,
    MapAreaConfig,
    RectangularArea,
    RectangularConfig,
    Relevance,
    ego_extent,
    ego_span,
    is_vulnerable,
)
from smartmot.decision.braking import BrakingDistance
from smartmot.errors import ShapeError
from smartmot.geometry import corners
from smartmot.maps.route import route_ahead
from smartmot.types import CATEGORIES, Boxes, EgoState

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"


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


def test_flags_of_an_own_area_are_one_per_object() -> None:
    one, two = np.ones(1, dtype=bool), np.ones(2, dtype=bool)
    assert Relevance(two, two, two).on_way.tolist() == [True, True]
    with pytest.raises(ShapeError, match="on_way: expected shape"):
        Relevance(two, one, two)
    with pytest.raises(ShapeError, match="in_route: expected shape"):
        Relevance(two[None], two, two)


def test_extent_against_corners() -> None:
    rng = np.random.default_rng(4)
    boxes = Boxes(rng.uniform(-30, 30, (50, 2)), rng.uniform(0.3, 9, (50, 2)), rng.uniform(-9, 9, 50))
    ego = _ego(3.0, 5.0, y=-7.0, yaw=0.7)
    c, s = np.cos(0.7), np.sin(0.7)
    local = (corners(boxes.center_m, boxes.size_m, boxes.yaw_rad) - (3.0, -7.0)) @ np.array([[c, -s], [s, c]])
    expected = (local[..., 0].min(1), local[..., 0].max(1), local[..., 1].min(1), local[..., 1].max(1))
    np.testing.assert_allclose(ego_extent(boxes, ego), expected, atol=1e-9)


def test_who_is_vulnerable() -> None:
    flags = is_vulnerable(np.array(CATEGORIES))
    assert [c for c, v in zip(CATEGORIES, flags, strict=True) if v] == ["pedestrian", "cyclist"]
    assert is_vulnerable(np.zeros(0, dtype=np.str_)).shape == (0,)


@pytest.mark.parametrize("strategy", ["map", "rectangular", "all"])
def test_no_objects(strategy: str) -> None:
    area = {
        "map": _street(),
        "rectangular": RectangularArea(RectangularConfig(), BrakingDistance()),
        "all": EverythingArea(),
    }[strategy]
    assert area.name == strategy
    here, none = area.at(_ego(300.0, 10.0)), np.zeros(0, dtype=np.str_)
    assert here.kept(Boxes.empty(), none).shape == (0,)
    assert here.relevance(Boxes.empty(), none).in_route.shape == (0,)
    assert here.on_lane(np.zeros((0, 2))).shape == (0,)
    assert here.relevance(Boxes.empty(), none).within_reach.shape == (0,)


def test_few_boxes_reach_as_far_along_the_egos_heading_as_many() -> None:
    rng = np.random.default_rng(4)
    ego = EgoState(0.0, 30.0, -8.0, 0.7, 10.0)
    boxes = Boxes(
        rng.uniform(-60.0, 60.0, (64, 2)), rng.uniform(0.2, 12.0, (64, 2)), rng.uniform(-4.0, 4.0, 64)
    )
    expected = ego_extent(boxes, ego)[:2]
    for count in (1, 2, 4, 5, 64):
        parts = [ego_span(boxes[k : k + count], ego) for k in range(0, 64, count)]
        np.testing.assert_allclose(np.concatenate(parts, axis=1), expected, rtol=0.0, atol=1e-12)
    assert np.shape(ego_span(Boxes.empty(), ego)) == (2, 0)
