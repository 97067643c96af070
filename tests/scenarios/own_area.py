"""A monitored area as a user writes it: whatever is ahead counts; it keeps what it was told."""

from __future__ import annotations

import numpy as np

from scenarios.places import MapView
from smartmot import Boxes, EgoState, PlannedPath
from smartmot.area import Relevance, ego_extent
from smartmot.types import BoolArray, FloatArray, StrArray

TOLD: dict[int, tuple[MapView, list[tuple[EgoState, PlannedPath | None]]]] = {}
"""By area: the map and route, and in every frame pose and path."""


class Ahead:
    """Whatever is ahead of the ego."""

    def __init__(self, ego: EgoState) -> None:
        self.ego = ego

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        return np.ones(len(boxes), dtype=np.bool_)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        ahead = ego_extent(boxes, self.ego)[1] >= 0.0
        return Relevance(ahead, ahead, ahead)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        return np.ones(len(center_m), dtype=np.bool_)

    def polygons(self) -> list[tuple[str, FloatArray]]:
        return []


class AheadArea:
    name = "ahead"
    uses_path = True

    def __init__(self, view: MapView) -> None:
        TOLD[id(self)] = (view, [])

    def at(self, ego: EgoState, path: PlannedPath | None = None) -> Ahead:
        TOLD[id(self)][1].append((ego, path))
        return Ahead(ego)


def make(view: MapView, preset: object) -> AheadArea:
    return AheadArea(view)
