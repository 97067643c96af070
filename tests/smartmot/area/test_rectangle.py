from functools import cache
from pathlib import Path

import numpy as np
import pytest
import shapely

from opendrive import RoadNetwork, load_map
from smartmot.area import (
    MapArea,
    MapAreaConfig,
    RectangularArea,
    RectangularConfig,
)
from smartmot.decision.braking import BrakingDistance
from smartmot.errors import ConfigError
from smartmot.maps.route import route_ahead
from smartmot.types import Boxes, EgoState, FloatArray

MAPS = Path(__file__).parents[3] / "scenarios" / "maps"

SIZES = {"car": (4.4, 1.8), "pedestrian": (0.5, 0.5), "cyclist": (1.8, 0.6)}


@cache
def _network(name: str) -> RoadNetwork:
    return load_map(MAPS / f"{name}.xodr")


def _ego(x: float, speed: float, y: float = -1.75, yaw: float = 0.0, yaw_rate: float = 0.0) -> EgoState:
    return EgoState(0.0, x, y, yaw, speed, yaw_rate_radps=yaw_rate)


def _dots(center_m: FloatArray) -> Boxes:
    """Boxes so small that outline and centre are the same."""
    return Boxes(center_m, np.full((len(center_m), 2), 1e-6), np.zeros(len(center_m)))


def _boxes(category: str, *points: tuple[float, float]) -> tuple[Boxes, np.ndarray]:
    n = len(points)
    return Boxes(np.array(points), np.tile(SIZES[category], (n, 1)), np.zeros(n)), np.full(n, category)


def test_area_follows_the_bend_where_a_rectangle_misses() -> None:
    """60 degrees further on in the 60 m bend; 30 m aside of the ego's heading there."""
    network = _network("urban_bend")
    lane = network.lane_index_of(("1", 0, -1))
    route = route_ahead(network, lane, 0.0, 0.0)
    x, y, _, yaw = (float(v) for v in network.center_line(lane, 232.0))
    ego = EgoState(0.0, x, y, yaw, 24.0)
    px, py, _, heading = (float(v) for v in network.center_line(lane, 232.0 + 60.0 * np.pi / 3))
    assert heading - yaw == pytest.approx(np.pi / 3, abs=0.02)
    target = np.array([[px, py]])
    car = Boxes(target, np.array([[4.4, 1.8]]), np.array([heading]))
    area = MapArea(network, route, MapAreaConfig()).at(ego)
    assert area.kept(_dots(target), np.array(["car"])).all()
    assert area.relevance(car, np.array(["car"])).in_route.all()
    assert area.on_lane(target).all()
    long = RectangularConfig(max_length_m=100.0, min_length_m=100.0)
    for config in (RectangularConfig(), long):
        rectangle = RectangularArea(config, BrakingDistance()).at(ego)
        assert not rectangle.relevance(car, np.array(["car"])).in_route.any()
    # and the other way round: straight on lies the verge, which is no lane
    ahead = np.array([[x + 40 * np.cos(yaw), y + 40 * np.sin(yaw)]])
    assert not area.kept(_dots(ahead), np.array(["pedestrian"])).any()


@pytest.mark.parametrize(
    ("kmh", "length"), [(0, 12.0), (20, 12.0), (30, 1.4 * 12.04), (40, 1.4 * 18.62), (50, 30.0), (100, 30.0)]
)
def test_rectangle_is_as_long_as_the_clamped_braking_distance(kmh: float, length: float) -> None:
    rectangle = RectangularArea(RectangularConfig(), BrakingDistance()).at(_ego(0.0, kmh / 3.6))
    assert rectangle.length_m == pytest.approx(length, abs=0.02)
    assert rectangle.half_width_m == 2.6


@pytest.mark.parametrize(("radius", "share"), [(100.0, 1.0), (20.0, 1.0), (10.0, 0.5), (5.0, 0.25)])
@pytest.mark.parametrize("sign", [-1, 1])
def test_rectangle_shrinks_with_curvature(radius: float, share: float, sign: int) -> None:
    ego = _ego(0.0, 5.0, yaw_rate=sign * 5.0 / radius)
    rectangle = RectangularArea(RectangularConfig(), BrakingDistance()).at(ego)
    assert rectangle.length_m == pytest.approx(12.0 * share)
    assert rectangle.half_width_m == pytest.approx(2.6 * share)


def test_rectangle_counts_boxes_that_touch_it_and_keeps_all() -> None:
    rectangle = RectangularArea(RectangularConfig(), BrakingDistance()).at(_ego(0.0, 0.0, y=0.0))
    points = [(12.24, 0), (12.26, 0), (5, 2.84), (5, 2.86), (5, -2.84), (-0.24, 0), (-0.26, 0)]
    boxes, category = _boxes("pedestrian", *points)
    expected = [True, False, True, False, True, True, False]
    assert rectangle.relevance(boxes, category).in_route.tolist() == expected
    assert rectangle.relevance(boxes, category).within_reach.tolist() == expected
    assert rectangle.kept(boxes, category).all()


def test_rectangle_turns_with_the_ego() -> None:
    rectangle = RectangularArea(RectangularConfig(), BrakingDistance()).at(_ego(10.0, 0.0, y=5.0, yaw=2.0))
    ((role, ring),) = rectangle.polygons()
    assert role == "rectangle"
    drawn = shapely.Polygon(ring)
    assert drawn.area == pytest.approx(12.0 * 5.2)
    points = np.random.default_rng(1).uniform(-15, 30, (2000, 2))
    np.testing.assert_array_equal(rectangle.on_lane(points), shapely.contains_xy(drawn, points))


@pytest.mark.parametrize(
    "settings",
    [{"min_length_m": 31.0}, {"min_length_m": 0.0}, {"braking_factor": 0.0}, {"half_width_m": -1.0}],
)
def test_impossible_rectangle_settings_are_refused(settings: dict[str, float]) -> None:
    with pytest.raises(ConfigError):
        RectangularConfig(**settings)
