"""A corridor along the planned path: no lanes, no kerb, no filter."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from smartmot.area.monitored import MonitoredArea, Relevance, ego_span, outline_points
from smartmot.area.way import ALONG_PATH, Way, with_way
from smartmot.errors import ConfigError
from smartmot.path import PlannedPath
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, StrArray, unchecked

DRAWN_M = 60.0
"""The corridor has no end; it is drawn so far (ours)."""
_RING_STEP_M = 2.0
"""Spacing of the points of its outline."""


@dataclass(frozen=True, slots=True)
class PathAreaConfig:
    """The corridor.

    Args:
        half_width_m: to each side of the planned path; None: whatever is ahead counts.

    Raises:
        ConfigError: the width is not positive.
    """

    half_width_m: float | None = None

    def __post_init__(self) -> None:
        if self.half_width_m is not None and not self.half_width_m > 0:
            raise ConfigError(f"path area: half_width_m must be positive, got {self.half_width_m}")


@dataclass(frozen=True, slots=True, eq=False)
class _Corridor:
    way: Way
    half_width_m: float | None

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        return np.ones(len(boxes), dtype=np.bool_)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        inside = ego_span(boxes, self.way.ego)[1] >= 0.0
        if self.half_width_m is not None:
            ahead, aside = self.way.place(outline_points(boxes))
            near = (ahead >= 0.0) & (np.abs(aside) <= self.half_width_m)
            inside &= near.reshape(-1, 9).any(axis=1)
        return unchecked(Relevance, inside, inside, inside)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        return self.way.in_lane(center_m)

    def polygons(self) -> list[tuple[str, FloatArray]]:
        if self.half_width_m is None:
            return []
        along = np.arange(0.0, DRAWN_M + _RING_STEP_M, _RING_STEP_M)
        left, right = (self.way.points(along, side * self.half_width_m) for side in (1.0, -1.0))
        return [("path", np.concatenate((left, right[::-1])))]


def corridor(way: Way, half_width_m: float | None = None) -> MonitoredArea:
    """What is ahead along a way: within a width to each side, None: at any distance from it."""
    return _Corridor(way, half_width_m)


class PathArea:
    """Counts what is ahead of the ego within a corridor along its planned path; tracks everything.

    What is in the way, and which standing objects count, follows from the path too (`smartmot.area.way`).
    While no path is known, it goes straight ahead.

    Args:
        config: width of the corridor.
    """

    name = "path"
    uses_path = True

    def __init__(self, config: PathAreaConfig | None = None) -> None:
        self.config = config or PathAreaConfig()

    def at(self, ego: EgoState, path: PlannedPath | None = None) -> MonitoredArea:
        """The corridor ahead of `ego`."""
        ahead = corridor(Way(ego, path), self.config.half_width_m)
        return with_way(ahead, ego, path, ALONG_PATH, ALONG_PATH)
