"""A second monitored area: whatever is beside the planned path, up to a distance and within some seconds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmot import Boxes, EgoState, PlannedPath
from smartmot.area import Relevance
from smartmot.types import BoolArray, FloatArray, StrArray


@dataclass(frozen=True)
class Corridor:
    path: PlannedPath
    ego: EgoState
    half_width_m: float

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        station, offset = self.path.place(center_m)
        ahead = station - self.path.project(self.ego.x_m, self.ego.y_m)[0]
        return np.asarray(
            (ahead >= 0.0) & (ahead <= 4.0 * self.ego.speed_mps) & (abs(offset) <= self.half_width_m)
        )

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        return np.ones(len(boxes), dtype=np.bool_)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        inside = self.on_lane(boxes.center_m)
        return Relevance(inside, inside, inside)

    def polygons(self) -> list[tuple[str, FloatArray]]:
        return []


class CorridorArea:
    name = "corridor"
    uses_path = True

    def __init__(self, half_width_m: float = 1.5) -> None:
        self.half_width_m = half_width_m

    def at(self, ego: EgoState, path: PlannedPath | None = None) -> Corridor:
        straight = np.array([[0.0, 0.0], [np.cos(ego.yaw_rad), np.sin(ego.yaw_rad)]])
        return Corridor(
            path or PlannedPath.through(straight + np.array([ego.x_m, ego.y_m])), ego, self.half_width_m
        )


def make(view: object, preset: object) -> CorridorArea:
    return CorridorArea()
