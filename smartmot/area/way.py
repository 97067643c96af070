"""The ego's way as a factor of its own: strategies that look at the same way differ in their area alone.

What speed adaptation follows, what keeps the ego from driving on and which standing objects count is part of
the area's answer in the paper. Here it can be taken from the way straight ahead, or from the planned path,
for any area.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from smartmot.area.monitored import (
    MonitoredArea,
    Relevance,
    ego_frame,
    outline_points,
    reaching,
    within_reach,
)
from smartmot.forecast.uncertain import UncertainMotion
from smartmot.path import PlannedPath
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, StrArray, unchecked

OF_AREA, STRAIGHT, ALONG_PATH = "area", "straight", "path"
WAYS = (OF_AREA, STRAIGHT, ALONG_PATH)
"""Where the ego's way is taken from: the area's own answer (paper), straight ahead, the planned path."""

WAY_HALF_WIDTH_M = 1.75
"""Half an urban lane: 3.5 m is the width of the marked lanes on Euro NCAP's roads and junctions."""
PATH_CLEARANCE_M = 0.3
"""Free space beside the ego's outline that its path asks for (ours; a parked car at the kerb is passed)."""
_ROUNDING_M = 1e-6
"""Offsets are rounded by less: coordinates of 1e8 m carry 1.5e-8 m."""


@dataclass(frozen=True, slots=True, eq=False)
class Way:
    """The ego's way ahead: a lane's width for what is followed or waited for, the ego's for what stands.

    Whoever moves, or may, is in the way when the centre is in a lane's width: two cars of 1.8 m touch when
    their middles are 1.8 m apart, and a person has the lane's border left. What stands and is to be braked
    for is measured by its outline, against the ego's with some clearance: it will not give way, and a car
    parked beside the way is passed.

    Args:
        ego: odometry now.
        path: the way, on which the centre of the ego is to pass; None: straight ahead.
    """

    ego: EgoState
    path: PlannedPath | None

    def place(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(N,) distances ahead along the way and (N,) offsets to its left of points, (N, 2) map frame."""
        if self.path is None:
            return ego_frame(points_m, self.ego)
        station, offset = self.path.place(points_m)
        station -= self.path.project(self.ego.x_m, self.ego.y_m)[0]
        return station, offset

    def course_rad(self, ahead_m: FloatArray) -> FloatArray:
        """(N,) headings of the way at (N,) distances ahead along it, map frame."""
        if self.path is None:
            return np.full(len(ahead_m), self.ego.yaw_rad)
        return self.path.poses(self.path.project(self.ego.x_m, self.ego.y_m)[0] + ahead_m)[1]

    def points(self, ahead_m: FloatArray, aside_m: float) -> FloatArray:
        """(K, 2) points beside the way (left positive) at (K,) distances ahead, map frame."""
        ego = self.ego
        if self.path is None:
            c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
            return np.column_stack((ego.x_m + c * ahead_m - s * aside_m, ego.y_m + s * ahead_m + c * aside_m))
        return self.path.poses(self.path.project(ego.x_m, ego.y_m)[0] + ahead_m, aside_m)[0]

    def in_lane(self, points_m: FloatArray) -> BoolArray:
        """(N,) points, (N, 2) map frame, ahead and within a lane's width."""
        ahead, aside = self.place(points_m)
        return np.asarray((ahead >= 0.0) & (np.abs(aside) <= WAY_HALF_WIDTH_M), dtype=np.bool_)

    def meets(self, boxes: Boxes) -> tuple[BoolArray, BoolArray]:
        """(N,) boxes with an outline point ahead where the ego passes; (N,) with the centre in the lane."""
        beside_m = self.ego.width_m / 2 + PATH_CLEARANCE_M
        ahead, aside = self.place(boxes.center_m)
        aside = np.abs(aside)
        in_lane = (ahead >= 0.0) & (aside <= WAY_HALF_WIDTH_M)
        passed = np.zeros(len(aside), dtype=np.bool_)
        # an offset is the distance from the way: no outline point is nearer to it than its circle
        radius_m = 0.5 * np.hypot(boxes.size_m[:, 0], boxes.size_m[:, 1])
        rows = (aside <= radius_m + (beside_m + _ROUNDING_M)).nonzero()[0]
        if len(rows):
            ahead, aside = self.place(outline_points(boxes if len(rows) == len(aside) else boxes[rows]))
            outline = (ahead >= 0.0) & (np.abs(aside) <= beside_m)
            passed[rows] = np.logical_or.reduce(outline.reshape(-1, 9), axis=1)
        return passed, in_lane


@dataclass(frozen=True, slots=True, eq=False)
class WayArea:
    """An area whose way, or whose standing objects, are those of another way than its own.

    Args:
        area: what is kept, and how far objects count.
        ways: those that are not the area's own, by name.
        way: one of `WAYS`: what is on the way and on its lane.
        standing: one of `WAYS`: which objects are in the route, where that is asked of standing ones.
    """

    area: MonitoredArea
    ways: dict[str, Way]
    way: str
    standing: str

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) what the area keeps."""
        return self.area.kept(boxes, category)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        """As the area says, but for the way and what stands on it; nothing counts out of the area's reach."""
        if OF_AREA in (self.standing, self.way):
            of_area = self.area.relevance(boxes, category)
            in_route, on_way, near = of_area.in_route, of_area.on_way, of_area.within_reach
        else:
            near = within_reach(self.area, boxes, category)
        for name, way in self.ways.items():
            passed, in_lane = way.meets(boxes)
            if name == self.standing:
                in_route = near & passed
            if name == self.way:
                on_way = near & in_lane
        return unchecked(Relevance, in_route, on_way, near)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        """(N,) points on the lane of the way."""
        return self.area.on_lane(center_m) if self.way == OF_AREA else self.ways[self.way].in_lane(center_m)

    def reaching(self, motion: Callable[[], UncertainMotion]) -> BoolArray | None:
        """(M,) which objects reach the path, where the area says so."""
        return reaching(self.area, motion)

    def polygons(self) -> list[tuple[str, FloatArray]]:
        """Outlines of the area."""
        return self.area.polygons()


def with_way(
    area: MonitoredArea, ego: EgoState, path: PlannedPath | None, way: str, standing: str
) -> MonitoredArea:
    """An area with the way and the standing objects of a name; see `WayArea`.

    Args:
        area: the area at this moment.
        ego: odometry now.
        path: planned path; None: not known, and the way is straight ahead.
        way: one of `WAYS`.
        standing: one of `WAYS`.
    """
    if isinstance(area, WayArea):  # of an area with a way of its own, only what is asked for is replaced
        way, standing = (
            asked if asked != OF_AREA else own for asked, own in ((way, area.way), (standing, area.standing))
        )
        if (way, standing) == (area.way, area.standing):
            return area
        area = area.area
    if way == standing == OF_AREA:
        return area
    ways = {
        name: unchecked(Way, ego, path if name == ALONG_PATH else None)
        for name in ((way,) if way == standing else (way, standing))
        if name != OF_AREA
    }
    return unchecked(WayArea, area, ways, way, standing)
