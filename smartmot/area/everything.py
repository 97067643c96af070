"""The control: no monitored area at all."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmot.area.monitored import Relevance, ego_frame, ego_span
from smartmot.area.way import WAY_HALF_WIDTH_M
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, StrArray, unchecked


@dataclass(frozen=True, slots=True, eq=False)
class _Everything:
    ego: EgoState
    path_half_width_m: float

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        return np.ones(len(boxes), dtype=np.bool_)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        ahead = ego_span(boxes, self.ego)[1] >= 0.0
        return unchecked(Relevance, ahead, ahead & self.on_lane(boxes.center_m), ahead)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        x, y = ego_frame(center_m, self.ego)
        inside: BoolArray = (x >= 0.0) & (np.abs(y) <= self.path_half_width_m)
        return inside

    def polygons(self) -> list[tuple[str, FloatArray]]:
        return []


class EverythingArea:
    """The control: no area at all. Whatever is ahead of the ego counts.

    The way that must be free before driving on is an urban lane's width, straight ahead.
    """

    name = "all"
    WAY_HALF_WIDTH_M = WAY_HALF_WIDTH_M

    def at(self, ego: EgoState) -> _Everything:
        """The same answer everywhere."""
        return _Everything(ego, self.WAY_HALF_WIDTH_M)
