import numpy as np

from smartmot.area import (
    EverythingArea,
)
from smartmot.types import Boxes, EgoState

SIZES = {"car": (4.4, 1.8), "pedestrian": (0.5, 0.5), "cyclist": (1.8, 0.6)}


def _ego(x: float, speed: float, y: float = -1.75, yaw: float = 0.0, yaw_rate: float = 0.0) -> EgoState:
    return EgoState(0.0, x, y, yaw, speed, yaw_rate_radps=yaw_rate)


def _boxes(category: str, *points: tuple[float, float]) -> tuple[Boxes, np.ndarray]:
    n = len(points)
    return Boxes(np.array(points), np.tile(SIZES[category], (n, 1)), np.zeros(n)), np.full(n, category)


def test_everything_keeps_all_and_counts_what_is_ahead() -> None:
    area = EverythingArea().at(_ego(0.0, 10.0, y=0.0))
    boxes, category = _boxes("car", (5, 40), (-2.1, 0), (-2.3, 0), (500, 1.7), (500, 1.8))
    assert area.kept(boxes, category).all()
    assert area.relevance(boxes, category).in_route.tolist() == [True, True, False, True, True]
    assert area.relevance(boxes, category).within_reach.tolist() == [True, True, False, True, True]
    assert area.on_lane(boxes.center_m).tolist() == [False, False, False, True, False]
    assert area.polygons() == []
