"""The rectangle of the paper's baseline: what is in front of the ego, as far as it would brake."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmot.area.monitored import Relevance, ego_extent, ego_frame
from smartmot.decision.braking import BrakingDistance, overhang_m
from smartmot.errors import ConfigError
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, StrArray, unchecked


@dataclass(frozen=True, slots=True)
class RectangularConfig:
    """The geometric monitored area of the paper's baseline (its reference [3], authors' code).

    Args:
        min_length_m, max_length_m: the rectangle's length is braking_factor x braking distance, clamped.
        braking_factor: 40 % of safety.
        half_width_m: to each side of the ego's axis.
        straight_radius_m: turning radius from which the road counts as straight; below it length and width
            shrink in proportion, to nothing.
    """

    min_length_m: float = 12.0
    max_length_m: float = 30.0
    braking_factor: float = 1.4
    half_width_m: float = 2.6
    straight_radius_m: float = 20.0

    def __post_init__(self) -> None:
        if not 0 < self.min_length_m <= self.max_length_m:
            raise ConfigError("rectangular area: needs 0 < min_length_m <= max_length_m")
        if not (self.braking_factor > 0 and self.half_width_m > 0 and self.straight_radius_m > 0):
            raise ConfigError("rectangular area: factor, half width and radius must be positive")


@dataclass(frozen=True, slots=True, eq=False)
class _Rectangle:
    ego: EgoState
    length_m: float
    half_width_m: float

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        return np.ones(len(boxes), dtype=np.bool_)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        x_min, x_max, y_min, y_max = ego_extent(boxes, self.ego)
        inside = (x_min <= self.length_m) & (x_max >= 0.0)
        inside &= (y_min <= self.half_width_m) & (y_max >= -self.half_width_m)
        return unchecked(Relevance, inside, inside & self.on_lane(boxes.center_m), inside)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        x, y = ego_frame(center_m, self.ego)
        inside: BoolArray = (x >= 0.0) & (x <= self.length_m) & (np.abs(y) <= self.half_width_m)
        return inside

    def polygons(self) -> list[tuple[str, FloatArray]]:
        local = np.array(
            [
                [0.0, -self.half_width_m],
                [self.length_m, -self.half_width_m],
                [self.length_m, self.half_width_m],
                [0.0, self.half_width_m],
            ]
        )
        c, s = np.cos(self.ego.yaw_rad), np.sin(self.ego.yaw_rad)
        turned = local @ np.array([[c, s], [-s, c]])
        return [("rectangle", turned + np.array([self.ego.x_m, self.ego.y_m]))]


class RectangularArea:
    """Tracks everything; counts what is in a rectangle that starts at the ego's centre."""

    name = "rectangular"

    def __init__(self, config: RectangularConfig, distance: BrakingDistance) -> None:
        self.config = config
        self._distance = distance

    def at(self, ego: EgoState) -> _Rectangle:
        """The rectangle for this speed and curvature."""
        c = self.config
        curvature = abs(ego.yaw_rate_radps) / max(ego.speed_mps, 0.5)
        straight = min(1.0, 1.0 / max(curvature * c.straight_radius_m, 1e-9))
        wanted = c.braking_factor * self._distance.at(ego.speed_mps)
        length = min(max(wanted, c.min_length_m), c.max_length_m) + overhang_m(ego)
        return _Rectangle(ego, straight * length, straight * c.half_width_m)
