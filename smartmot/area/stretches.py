"""Stretches of strips between stations, asked which points and boxes lie in them.

A frame has a handful of objects and, on a straight road, a handful of segments: then a loop over plain
numbers takes a fraction of the time of the array operations, each of which takes as long for one number as
for a hundred. Both work out the same products and sums in the same order.
"""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Sequence

import numpy as np

from smartmot.area.monitored import outline_points
from smartmot.maps.strips import ROUNDING_ALONG_M, Row, Segments, StripSet
from smartmot.types import BoolArray, Boxes, FloatArray

FEW = 8
"""Up to so many points or boxes a loop is quicker than arrays."""


class Stretches:
    """Stretches of the strips of a set; an object is in them where it is in one of their segments.

    Args:
        strips: the set.
        between: strip, first and last station that count, of each stretch.
    """

    __slots__ = ("_ranges", "_segments", "_strips")

    def __init__(self, strips: StripSet, between: Sequence[tuple[int, float, float]]) -> None:
        self._strips = strips
        self._segments: Segments | None = None
        # segments of a strip come by their stations; those in which a point that counts may be are neighbours
        self._ranges: list[tuple[int, int, float, float]] = []
        for strip, low, high in between:
            first, last = strips.ranges[strip]
            begin = bisect_left(strips.last_m, low, first, last)
            end = bisect_right(strips.first_m, high, begin, last)
            if end > begin:
                self._ranges.append((begin, end, low, high))

    def _around(self, x: float, y: float, radius: float) -> list[tuple[Row, float, float]]:
        """Segments that points within a radius of a place may be in, and the stations that count."""
        rows, blocks, block_of = self._strips.rows, self._strips.blocks, self._strips.block_of
        around = []
        for begin, end, low, high in self._ranges:
            for x_min, x_max, y_min, y_max, first, last in blocks[block_of[begin] : block_of[end - 1] + 1]:
                if x_min - radius <= x <= x_max + radius and y_min - radius <= y <= y_max + radius:
                    around += [(row, low, high) for row in rows[max(first, begin) : min(last, end)]]
        return around

    @property
    def segments(self) -> Segments:
        """The same for arrays of points."""
        if self._segments is None:
            chosen = [np.arange(begin, end) for begin, end, _, _ in self._ranges]
            lengths = [len(part) for part in chosen]
            low, high = (np.repeat([entry[k] for entry in self._ranges], lengths) for k in (2, 3))
            index = np.concatenate(chosen) if chosen else np.zeros(0, dtype=np.int64)
            self._segments = self._strips.segments(index, low, high)
        return self._segments

    def place(self, points_m: FloatArray) -> tuple[BoolArray, BoolArray]:
        """(N,) points, (N, 2) map frame, in a lane; (N,) in a lane with its VRU margins."""
        n = len(points_m)
        if n > FEW:
            _, in_lane, in_margin = self.segments.place(points_m[:, None])
            return _any(in_lane), _any(in_margin)
        placed = [self._placed(x, y) for x, y in points_m.tolist()]
        in_lanes, in_margins = np.array(placed, dtype=np.bool_).reshape(n, 2).T
        return in_lanes, in_margins

    def _placed(self, x: float, y: float) -> tuple[bool, bool]:
        """`place` of one point."""
        in_lane = in_margin = False
        for row, low, high in self._around(x, y, 0.0):
            at = _beside(row, low, high, x, y)
            if at is None:
                continue
            on, lateral = at
            half = on * row[7] + row[6]
            if abs(lateral) <= half:
                in_lane = True
            if lateral <= half + row[8] + on * row[9] and -lateral <= half + row[10] + on * row[11]:
                in_margin = True
            if in_lane and in_margin:
                break
        return in_lane, in_margin

    def in_margins(self, points_m: FloatArray) -> BoolArray:
        """`place` with the margins alone."""
        if len(points_m) > FEW:
            return _any(self.segments.in_margins(points_m[:, None])[1])
        return self.place(points_m)[1]

    def in_lanes(self, points_m: FloatArray) -> BoolArray:
        """`place` with the lanes alone."""
        if len(points_m) > FEW:
            return _any(self.segments.in_lanes(points_m[:, None])[1])
        inside = [self._in_lane(x, y) for x, y in points_m.tolist()]
        return np.array(inside, dtype=np.bool_)

    def _in_lane(self, x: float, y: float) -> bool:
        """Whether a point is in a lane."""
        return any(_holds(row, low, high, x, y) for row, low, high in self._around(x, y, 0.0))

    def touched(self, boxes: Boxes) -> BoolArray:
        """(N,) boxes with one of nine outline points in a lane."""
        if len(boxes) > FEW:
            return _touched(boxes, self.segments)
        touched = [
            self._touched(x, y, length, width, yaw)
            for (x, y), (length, width), yaw in zip(
                boxes.center_m.tolist(), boxes.size_m.tolist(), boxes.yaw_rad.tolist(), strict=True
            )
        ]
        return np.array(touched, dtype=np.bool_)

    def _touched(self, x: float, y: float, length: float, width: float, yaw: float) -> bool:
        """`touched` of one box."""
        radius = 0.5 * math.hypot(length, width)
        points: list[tuple[float, float]] = []
        for row, low, high in self._around(x, y, radius):
            # as `Segments.near`: who is farther than the circle reaches has no point in the segment
            reach = radius + row[14]
            dx, dy = x - row[0], y - row[1]
            u = dx * row[2] + dy * row[3]
            if u < -reach or u - row[4] > reach or abs(row[2] * dy - dx * row[3]) > reach:
                continue
            points = points or _outline(x, y, length, width, yaw)
            for px, py in points:
                if _holds(row, low, high, px, py):
                    return True
        return False


def _beside(row: Row, low: float, high: float, x: float, y: float) -> tuple[float, float] | None:
    """Place along a segment and offset to its left of a point beside it that counts; as `Segments.place`."""
    dx, dy, ux, uy, length = x - row[0], y - row[1], row[2], row[3], row[4]
    u = dx * ux + dy * uy
    lateral = ux * dy - dx * uy
    aside = abs(lateral)
    if -u - aside * row[12] > ROUNDING_ALONG_M or u - length - aside * row[13] > ROUNDING_ALONG_M:
        return None
    if not low <= row[5] + u <= high:
        return None
    return (u if u < length else length) if u > 0.0 else 0.0, lateral


def _holds(row: Row, low: float, high: float, x: float, y: float) -> bool:
    """Whether a point is in a segment's lane and counts."""
    at = _beside(row, low, high, x, y)
    return at is not None and abs(at[1]) <= at[0] * row[7] + row[6]


def _outline(x: float, y: float, length: float, width: float, yaw: float) -> list[tuple[float, float]]:
    """`outline_points` of one box, the centre first: where that is in a lane the others need no look."""
    c, s = math.cos(yaw), math.sin(yaw)
    a, b = length / 2, width / 2
    places = ((0.0, 0.0), (-a, -b), (-a, 0.0), (-a, b), (0.0, -b), (0.0, b), (a, -b), (a, 0.0), (a, b))
    return [(x + c * along - s * aside, y + s * along + c * aside) for along, aside in places]


def _touched(boxes: Boxes, segments: Segments) -> BoolArray:
    """(N,) boxes with an outline point in a lane where the segments count."""
    touched = np.zeros(len(boxes), dtype=np.bool_)
    radius_m = 0.5 * np.hypot(boxes.size_m[:, 0], boxes.size_m[:, 1])
    box, segment = segments.near(boxes.center_m, radius_m)
    if len(box):
        points = outline_points(boxes).reshape(-1, 9, 2)[box]
        touched[box[_any(segments.pairs(segment).in_lanes(points)[1])]] = True
    return touched


def _any(mask: BoolArray) -> BoolArray:
    """(N,) whether any segment holds, from (N, S)."""
    held: BoolArray = np.logical_or.reduce(mask, axis=1)
    return held
