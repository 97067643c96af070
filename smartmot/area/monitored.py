"""Which objects matter: what a monitored area answers, and how objects lie to the ego.

A strategy gives, for an ego state, an area that answers two questions about object boxes: is the object kept
(tracked), and how does it relate to the ego's route.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from smartmot.forecast.uncertain import UncertainMotion
from smartmot.path import PlannedPath
from smartmot.types import VULNERABLE, BoolArray, Boxes, EgoState, FloatArray, StrArray, frozen


@dataclass(frozen=True, slots=True, eq=False)
class Relevance:
    """How N objects relate to the ego's route now.

    Args:
        in_route: (N,) which count as being in the ego's route; VRUs also beside it, in the margin.
        on_way: (N,) which are in the ego's way. With a map: VRUs on its lane, others on its path. The
            baseline knows neither: whoever is in its rectangle is in its way, also on the sidewalk.
        within_reach: (N,) which are near enough in front of the ego to count at all.

    Raises:
        ShapeError: Shapes disagree.
    """

    in_route: BoolArray
    on_way: BoolArray
    within_reach: BoolArray

    def __post_init__(self) -> None:
        n = np.size(self.in_route)
        for name in ("in_route", "on_way", "within_reach"):
            object.__setattr__(self, name, frozen(getattr(self, name), np.bool_, (n,), name))


class MonitoredArea(Protocol):
    """The area at one moment.

    VRUs are placed by their centres, since margins widen the area for them; all others by their outlines.

    It may also have `within_reach(boxes, category)`: that part of `relevance` alone (`within_reach` below);
    and `reaching(motion)`: which tracks count by where they are forecast to go (`reaching` below).
    """

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) which objects are tracked at all."""

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        """How objects relate to the ego's route."""

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        """(N,) which points, (N, 2) map frame, lie on the ego's lane ahead, without any margin."""

    def polygons(self) -> list[tuple[str, FloatArray]]:
        """Outlines to draw: (role, (P, 2) ring in the map frame)."""


def within_reach(area: MonitoredArea, boxes: Boxes, category: StrArray) -> BoolArray:
    """(N,) which objects are near enough in front of the ego to count at all.

    An area's own `within_reach` is asked if it has one; else that of its `relevance` is taken. One that a
    class inherits is not: it may answer `relevance` in another way than the class it is derived from.
    """
    of_area = vars(type(area)).get("within_reach")
    if callable(of_area):
        return np.asarray(of_area(area, boxes, category), dtype=np.bool_)
    return area.relevance(boxes, category).within_reach


def reaching(area: MonitoredArea, motion: Callable[[], UncertainMotion]) -> BoolArray | None:
    """(M,) which tracks count by where they are going; None: the area does not ask.

    Args:
        area: asked if it has `reaching(motion)`.
        motion: makes the tracks' motion, in the frame of the area.
    """
    of_area = getattr(area, "reaching", None)
    return None if of_area is None else of_area(motion)


class MonitoredAreaStrategy(Protocol):
    """Makes the area for an ego state.

    It may have `uses_path = True`: then, if `at` has a parameter `path`, it gets the planned path there (None
    while it is not known). Whether the ego is forecast along the path is a setting, the same for all areas.
    """

    name: str

    def at(self, ego: EgoState) -> MonitoredArea:
        """The monitored area around `ego`."""


def known_path(strategy: MonitoredAreaStrategy) -> PlannedPath | None:
    """The path that a strategy was made for, if it was for one: its attribute `route`, as of a `MapArea`.

    Strategies written for version 0.1.0 have no other way to say where the ego is going to go.
    """
    route = getattr(strategy, "route", None)
    return route if isinstance(route, PlannedPath) else None


def uses_path(strategy: MonitoredAreaStrategy) -> bool:
    """Whether a strategy uses the planned path; one that does not say so does if it was made for one."""
    return bool(getattr(strategy, "uses_path", known_path(strategy) is not None))


def is_vulnerable(category: StrArray) -> BoolArray:
    """(N,) whether each category is a vulnerable road user."""
    return np.array([name in VULNERABLE for name in category.tolist()], dtype=np.bool_)


_NINE_POINTS = np.array([(i, k) for i in (-1, 0, 1) for k in (-1, 0, 1)], dtype=np.float64)
"""Corners, middles of the edges and centre of a box, in half lengths and half widths."""


def outline_points(boxes: Boxes) -> FloatArray:
    """(N * 9, 2) centre, corners and edge middles of boxes, map frame, one box after the other."""
    half = boxes.size_m[:, None, :] / 2 * _NINE_POINTS
    c, s = np.cos(boxes.yaw_rad)[:, None], np.sin(boxes.yaw_rad)[:, None]
    points = np.empty_like(half)
    points[..., 0] = boxes.center_m[:, 0, None] + c * half[..., 0] - s * half[..., 1]
    points[..., 1] = boxes.center_m[:, 1, None] + s * half[..., 0] + c * half[..., 1]
    return points.reshape(-1, 2)


def ego_frame(points_m: FloatArray, ego: EgoState) -> tuple[FloatArray, FloatArray]:
    """(N,) x ahead and (N,) y to the left of points, (N, 2) map frame, from the ego's centre, metres."""
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    dx, dy = points_m[:, 0] - ego.x_m, points_m[:, 1] - ego.y_m
    return c * dx + s * dy, c * dy - s * dx


def ego_extent(boxes: Boxes, ego: EgoState) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Extent of boxes along and across the ego's heading, from the ego's centre.

    Returns:
        x_min, x_max, y_min, y_max: (N,) metres, ego frame (x ahead, y left).
    """
    x, y = ego_frame(boxes.center_m, ego)
    half_x, half_y = _shadows(boxes, ego)
    return x - half_x, x + half_x, y - half_y, y + half_y


def ego_span(boxes: Boxes, ego: EgoState) -> tuple[FloatArray, FloatArray]:
    """x_min and x_max of `ego_extent` alone."""
    if len(boxes) <= _FEW:
        return _span_of_few(boxes, ego)
    x, half_x = ego_frame(boxes.center_m, ego)[0], _shadows(boxes, ego)[0]
    return x - half_x, x + half_x


_FEW = 4
"""Up to so many boxes a loop is quicker than arrays."""


def _span_of_few(boxes: Boxes, ego: EgoState) -> tuple[FloatArray, FloatArray]:
    """`ego_span` by plain numbers: the same products and sums."""
    c, s = math.cos(ego.yaw_rad), math.sin(ego.yaw_rad)
    low, high = [], []
    for (x, y), (length, width), yaw in zip(
        boxes.center_m.tolist(), boxes.size_m.tolist(), boxes.yaw_rad.tolist(), strict=True
    ):
        ahead = c * (x - ego.x_m) + s * (y - ego.y_m)
        turn = yaw - ego.yaw_rad
        half = 0.5 * length * abs(math.cos(turn)) + 0.5 * width * abs(math.sin(turn))
        low.append(ahead - half)
        high.append(ahead + half)
    return np.array(low, dtype=np.float64), np.array(high, dtype=np.float64)


def _shadows(boxes: Boxes, ego: EgoState) -> tuple[FloatArray, FloatArray]:
    """(N,) half the extent of boxes along and across the ego's heading, metres."""
    turn = boxes.yaw_rad - ego.yaw_rad
    # a turned rectangle reaches as far along an axis as the shadows of its two half sides add up to
    ct, st = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half_length, half_width = (0.5 * boxes.size_m).T
    return half_length * ct + half_width * st, half_length * st + half_width * ct
