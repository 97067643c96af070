"""Lanes as sampled strips in travel direction: the fast geometry behind the monitored area.

A strip is a polyline along a lane's centre with the free width to each side. All strips that matter to a
route are concatenated, so that one array operation places any number of points in all of them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import accumulate
from weakref import WeakKeyDictionary

import numpy as np

from smartmot.maps.lane_map import LaneMap, Side
from smartmot.maps.walks import kerb
from smartmot.path import chord_stations
from smartmot.types import BoolArray, FloatArray, IntArray

MAX_STEP_M = 20.0
MAX_TURN_RAD = 0.03
MAX_SAGITTA_M = 0.01
"""Sampling: greatest length, turn and distance from the true centre line of a chord. At 60 m radius 0.03 rad
gives chords of 1.8 m, 7 mm off; on wider bends the sagitta rules."""
MAX_WIDTH_CHANGE_M = 0.02
"""Greatest change of the widths over a chord, between whose ends they are taken for linear."""
_FINE_STEP_M = 0.5
"""Spacing at which a lane is looked at before most of the samples are left out again."""
_ROUNDING_M = 1e-6
"""Distances on a map are rounded by less."""
ROUNDING_ALONG_M = 1e-9
"""Points at a joint are beside both segments, whatever the rounding."""
_ROUNDING_ALONG = np.array(ROUNDING_ALONG_M)
_ZERO = np.array(0.0)
_BLOCK = 8
"""So many segments of a strip share a rectangle; a look at more of either takes longer."""


@dataclass(frozen=True, slots=True, eq=False)
class LaneStrip:
    """One lane sampled in travel direction, map frame.

    Args:
        lane: index of the lane in its map.
        s_m: (P,) road coordinate of the samples (falls along the strip where traffic runs against s).
        center_m: (P, 2) lane centre.
        station_m: (P,) distance along the centre from the lane's entry.
        half_width_m: (P,) half of the lane's width.
        vru_left_m, vru_right_m: (P,) what lies between the lane's border and the far end of the VRU margin.
    """

    lane: int
    s_m: FloatArray
    center_m: FloatArray
    station_m: FloatArray
    half_width_m: FloatArray
    vru_left_m: FloatArray
    vru_right_m: FloatArray

    @property
    def length_m(self) -> float:
        """Length of the lane's centre line."""
        return float(self.station_m[-1])

    def station_at(self, s_m: float) -> float:
        """Distance from the lane's entry at road coordinate `s_m`."""
        along = np.abs(self.s_m - self.s_m[0])
        return float(np.interp(abs(s_m - self.s_m[0]), along, self.station_m))

    def s_at(self, station_m: float) -> float:
        """Road coordinate at a distance from the lane's entry."""
        return float(np.interp(station_m, self.station_m, self.s_m))

    def part(self, from_m: float, to_m: float) -> LaneStrip:
        """The strip between two stations, cut to its length; the part's own stations begin at 0."""
        from_m, to_m = max(from_m, 0.0), min(to_m, self.length_m)
        if (from_m, to_m) == (0.0, self.length_m):
            return self
        inner = self.station_m[(self.station_m > from_m) & (self.station_m < to_m)]
        station = np.concatenate(([from_m], inner, [to_m]))

        def at(values: FloatArray) -> FloatArray:
            return np.interp(station, self.station_m, values)

        return LaneStrip(
            lane=self.lane,
            s_m=at(self.s_m),
            center_m=np.column_stack((at(self.center_m[:, 0]), at(self.center_m[:, 1]))),
            station_m=station - from_m,
            half_width_m=at(self.half_width_m),
            vru_left_m=at(self.vru_left_m),
            vru_right_m=at(self.vru_right_m),
        )


_STRIPS: WeakKeyDictionary[LaneMap, dict[tuple[int, float], LaneStrip]] = WeakKeyDictionary()
"""Strips by map, lane and margin."""


def lane_strip(network: LaneMap, lane: int, vru_margin_m: float) -> LaneStrip:
    """Sample a lane in travel direction, as densely as its curvature and width ask for; once per map."""
    known = _STRIPS.setdefault(network, {})  # a map never changes
    strip = known.get((lane, vru_margin_m))
    if strip is None:
        strip = known[lane, vru_margin_m] = _sampled(network, lane, vru_margin_m)
    return strip


def _sampled(lane_map: LaneMap, lane: int, vru_margin_m: float) -> LaneStrip:
    low, high = float(lane_map.lanes.s_start_m[lane]), float(lane_map.lanes.s_end_m[lane])
    s = np.linspace(low, high, max(2, int(np.ceil((high - low) / _FINE_STEP_M)) + 1))
    if lane_map.lanes.direction[lane] < 0:
        s = s[::-1]
    x, y, _, heading = lane_map.center_line(lane, s)
    width = lane_map.lane_width(lane, s)
    vru_left = _vru_reach(lane_map, lane, s, "left", vru_margin_m)
    vru_right = _vru_reach(lane_map, lane, s, "right", vru_margin_m)
    course = np.unwrap(heading)
    turned = _travelled(course)
    # the sagitta of a chord is length x turn / 8, so its root adds up along the chord
    bent = np.concatenate(([0.0], np.cumsum(np.sqrt(np.abs(np.diff(course) * np.diff(s)) / 8))))
    widened = _travelled(width) + _travelled(vru_left) + _travelled(vru_right)
    # buckets entered so far; a sample starts a new chord when any measure enters its next bucket
    bucket = (
        np.floor(turned / MAX_TURN_RAD)
        + np.floor(bent / np.sqrt(MAX_SAGITTA_M))
        + np.floor(widened / MAX_WIDTH_CHANGE_M)
        + np.floor(np.abs(s - s[0]) / MAX_STEP_M)
    )
    entered = np.diff(bucket)
    keep = np.concatenate(([True], entered > 0))
    keep[-1] = True
    keep[:-1] |= entered > 1  # a sudden change must not be spread over the chord before it
    s, width = s[keep], width[keep]
    center = np.column_stack((x[keep], y[keep]))
    return LaneStrip(
        lane=lane,
        s_m=s,
        center_m=center,
        station_m=chord_stations(center),
        half_width_m=width / 2,
        vru_left_m=vru_left[keep],
        vru_right_m=vru_right[keep],
    )


def _travelled(values: FloatArray) -> FloatArray:
    """(P,) sum of the absolute changes up to each sample."""
    return np.concatenate(([0.0], np.cumsum(np.abs(np.diff(values)))))


def _vru_reach(lane_map: LaneMap, lane: int, s_m: FloatArray, side: Side, margin_m: float) -> FloatArray:
    """(P,) width beside the lane in which VRUs count: kerbside strips up to the sidewalk, plus margin.

    Where no sidewalk follows, the margin is measured from the lane's own border.
    """
    passed, has_sidewalk = kerb(lane_map, lane, s_m, side)
    return passed + margin_m if has_sidewalk else np.full_like(s_m, margin_m)


ALL = slice(None)
"""Every segment."""

Row = tuple[float, ...]
"""What is known of one segment, in the order of the columns of `Segments`."""


class Segments:
    """Segments of strips, one or more of each; places points in them.

    Args:
        columns: what is known of the segments, rows of (S,), or (P, 1) for pairs of points and segments:
            start x and y, direction x and y, length, station of the start, half width and its slope, reach of
            the VRU margin to the left and its slope, the same to the right, tangents of half the turns at the
            start and at the end, reach of the lane.
        bends: whether any segment turns at a joint.
        low_m, high_m: like the columns, stations between which points count; None: all do.
    """

    __slots__ = ("_bends", "_columns", "_high_m", "_low_m", "reach_m")

    def __init__(
        self,
        columns: FloatArray,
        bends: bool,
        low_m: FloatArray | None = None,
        high_m: FloatArray | None = None,
    ) -> None:
        self._columns, self._bends, self._low_m, self._high_m = columns, bends, low_m, high_m
        self.reach_m: FloatArray = columns[14]

    def pairs(self, segments: IntArray) -> Segments:
        """One segment for each of P points, or rows of points: columns (P, 1)."""
        low, high = self._low_m, self._high_m
        return Segments(
            self._columns.take(segments, axis=1)[..., None],
            self._bends,
            None if low is None else low.take(segments)[:, None],
            None if high is None else high.take(segments)[:, None],
        )

    def near(self, center_m: FloatArray, radius_m: FloatArray) -> tuple[IntArray, IntArray]:
        """Circles that may reach into a lane: (P,) rows of them and (P,) segments; misses no pair.

        Args:
            center_m: (N, 2) map frame.
            radius_m: (N,) of the circles.
        """
        u, lateral = self._along_and_aside(center_m[:, None])
        # a wedge goes on for 0.55 of the half width at most, so that this covers it too
        reach = radius_m[:, None] + self.reach_m
        near = np.abs(lateral) <= reach
        near &= u >= -reach
        near &= u - self._columns[4] <= reach
        circle, segment = near.nonzero()
        return circle, segment

    def place(self, points_m: FloatArray) -> tuple[FloatArray, BoolArray, BoolArray]:
        """(..., S) stations along each segment's strip, whether in the lane, and whether in its margins.

        Args:
            points_m: (..., 2) map frame, as they broadcast with the columns.
        """
        u, lateral, beside = self._project(points_m)
        at, station = self._clipped(u), self._columns[5] + u
        beside = self._counted(station, beside)
        half = self._half_at(at)
        in_lane: BoolArray = beside & (np.abs(lateral) <= half)
        beside &= self._reaches(at, lateral, half)
        return station, in_lane, beside

    def in_lanes(self, points_m: FloatArray) -> tuple[FloatArray, BoolArray]:
        """`place` without the margins."""
        u, lateral, beside = self._project(points_m)
        half = self._half_at(self._clipped(u))
        station = np.add(self._columns[5], u, out=u)
        beside = self._counted(station, beside)
        beside &= np.abs(lateral, out=lateral) <= half
        return station, beside

    def in_margins(self, points_m: FloatArray) -> tuple[FloatArray, BoolArray]:
        """`place` with the margins alone."""
        u, lateral, beside = self._project(points_m)
        at = self._clipped(u)
        station = np.add(self._columns[5], u, out=u)
        beside = self._counted(station, beside)
        beside &= self._reaches(at, lateral, self._half_at(at))
        return station, beside

    def _counted(self, station_m: FloatArray, beside: BoolArray) -> BoolArray:
        """What is beside a segment, in place, between the stations that count."""
        if self._low_m is not None:
            beside &= station_m >= self._low_m
        if self._high_m is not None:
            beside &= station_m <= self._high_m
        return beside

    def _clipped(self, u: FloatArray) -> FloatArray:
        """(...) the same on the segment: in a wedge the widths are those of its joint."""
        at: FloatArray = np.maximum(u, _ZERO)
        np.minimum(at, self._columns[4], out=at)
        return at

    def _half_at(self, at: FloatArray) -> FloatArray:
        """(...) half widths at distances along the segments."""
        half: FloatArray = at * self._columns[7]
        half += self._columns[6]
        return half

    def _reaches(self, at: FloatArray, lateral: FloatArray, half_m: FloatArray) -> BoolArray:
        """(N, S) whether the VRU margins reach an offset to the left."""
        _, _, _, _, _, _, _, _, left, left_slope, right, right_slope, *_ = self._columns
        reaches: BoolArray = lateral <= half_m + left + at * left_slope
        reaches &= -lateral <= half_m + right + at * right_slope
        return reaches

    def _project(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
        """(...) distance along each segment, offset to its left, and whether the point is beside it."""
        u, lateral = self._along_and_aside(points_m)
        before, beyond = np.negative(u), u - self._columns[4]
        if self._bends:
            aside = np.abs(lateral)
            before -= aside * self._columns[12]
            beyond -= np.multiply(aside, self._columns[13], out=aside)
        return u, lateral, np.maximum(before, beyond, out=before) <= _ROUNDING_ALONG

    def _along_and_aside(self, points_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(...) distance along each segment and offset to its left, of (..., 2) points that broadcast."""
        x, y, ux, uy = self._columns[:4]
        dx, dy = points_m[..., 0] - x, points_m[..., 1] - y
        u, lateral = dx * ux, ux * dy
        # what is not needed any more is written over: fresh memory takes as long as the sums
        u += np.multiply(dy, uy, out=dy)
        lateral -= np.multiply(dx, uy, out=dx)
        return u, lateral


class StripSet:
    """Many strips as one set of segments; places points in all of them at once.

    Args:
        strips: the strips; their order is the strip index used by every method.

    Attributes:
        strip: (S,) strip of each segment.
        ranges: first segment of each strip, and the first one after it.
        first_m, last_m: stations outside of which no point is beside each segment; they ascend along a strip.
    """

    def __init__(self, strips: Sequence[LaneStrip]) -> None:
        self.strips = tuple(strips)
        parts = [s for s in self.strips if len(s.s_m) > 1]
        counts = [max(len(s.s_m) - 1, 0) for s in self.strips]
        self.strip: IntArray = np.repeat(np.arange(len(counts)), counts)
        ends_at = list(accumulate(counts))
        self.ranges = [(end - count, end) for end, count in zip(ends_at, counts, strict=True)]

        def joined(values: list[FloatArray]) -> FloatArray:
            return np.concatenate(values or [np.zeros(0)])

        def ends(values: list[FloatArray]) -> tuple[FloatArray, FloatArray]:
            """(S,) value at each segment's start and its slope along the segment."""
            start, end = joined([v[:-1] for v in values]), joined([v[1:] for v in values])
            return start, (end - start) / np.maximum(length, 1e-12)

        delta = np.concatenate([np.diff(p.center_m, axis=0) for p in parts] or [np.zeros((0, 2))])
        length = np.hypot(delta[:, 0], delta[:, 1])
        station = joined([p.station_m[:-1] for p in parts])
        half, half_slope = ends([p.half_width_m for p in parts])
        # at a joint on the outside of a bend the normals leave a wedge; half the turn there covers it
        turn = [_half_turns(p.center_m) for p in parts]
        wedges = joined([t[:-1] for t in turn]), joined([t[1:] for t in turn])
        self._bends = bool(wedges[0].any() or wedges[1].any())
        # no wedge is longer than the reach to a side times tan(0.5), 0.55; twice that is on the safe side
        self._widest_m = max((self._widest(p) for p in parts), default=0.0)
        past_m = 1.1 * self._widest_m + 1.0
        # stations between which a point that counts is beside a segment
        self.first_m: list[float] = (station - past_m).tolist()
        self.last_m: list[float] = (station + length + past_m).tolist()
        self._columns = np.stack(
            (
                *(joined([p.center_m[:-1, k] for p in parts]) for k in (0, 1)),
                *(delta / np.maximum(length, 1e-12)[:, None]).T,
                length,
                station,
                half,
                half_slope,
                *ends([p.vru_left_m for p in parts]),
                *ends([p.vru_right_m for p in parts]),
                *wedges,
                np.maximum(np.abs(half), np.abs(half + length * half_slope)) + _ROUNDING_M,
            )
        )

    @cached_property
    def block_of(self) -> list[int]:
        """Position in `blocks` of each segment."""
        lengths = [last - first for *_, first, last in self.blocks]
        block_of: list[int] = np.repeat(np.arange(len(lengths)), lengths).tolist()
        return block_of

    @cached_property
    def blocks(self) -> list[tuple[float, float, float, float, int, int]]:
        """Least and greatest x and y of all points in a few segments, the first of these, the one after them.

        They come like the segments; each is of one strip.
        """
        # in a wedge a point is farther from the segment than aside, by the root of 1 + 0.55^2 at most
        beyond_m = 1.2 * self._widest_m + 1.0
        x, y, ux, uy, length = self._columns[:5]
        ends = np.stack((x, x + ux * length)), np.stack((y, y + uy * length))
        blocks = []
        for begin, end in self.ranges:
            for first in range(begin, end, _BLOCK):
                last = min(first + _BLOCK, end)
                (x_min, x_max), (y_min, y_max) = (
                    (float(v[:, first:last].min()) - beyond_m, float(v[:, first:last].max()) + beyond_m)
                    for v in ends
                )
                blocks.append((x_min, x_max, y_min, y_max, first, last))
        return blocks

    @staticmethod
    def _widest(strip: LaneStrip) -> float:
        """The farthest that a strip reaches to a side."""
        aside = np.maximum(np.maximum(strip.vru_left_m, strip.vru_right_m), 0.0)
        return float((np.abs(strip.half_width_m) + aside).max())

    def segments(
        self,
        segments: IntArray | slice = ALL,
        low_m: FloatArray | None = None,
        high_m: FloatArray | None = None,
    ) -> Segments:
        """All segments, or S chosen ones; see `Segments`."""
        return Segments(self._columns[:, segments], self._bends, low_m, high_m)

    @cached_property
    def rows(self) -> list[Row]:
        """The columns of each segment as plain numbers."""
        return [tuple(row) for row in self._columns.T.tolist()]

    def place(
        self, points_m: FloatArray, segments: IntArray | slice = ALL
    ) -> tuple[FloatArray, BoolArray, BoolArray]:
        """Place points in every segment, or in S chosen ones.

        Args:
            points_m: (N, 2) map frame.
            segments: which.

        Returns:
            (N, S) station along the segment's strip; (N, S) whether the point lies between the lane's
            borders there; (N, S) the same with the VRU margins added.
        """
        return self.segments(segments).place(points_m[:, None])


def _half_turns(center_m: FloatArray) -> FloatArray:
    """(P,) tangent of half the turn at each sample; the ends turn like the samples next to them."""
    course = np.arctan2(*np.diff(center_m, axis=0).T[::-1])
    turn = np.diff(course)
    turn = np.abs(np.arctan2(np.sin(turn), np.cos(turn)))
    half = np.tan(0.5 * np.minimum(turn, 1.0))
    return np.concatenate((half[:1], half, half[-1:])) if len(half) else np.zeros(len(center_m))


def ring(strip: LaneStrip, from_m: float, to_m: float, *, vru: bool = False) -> FloatArray:
    """(P, 2) outline of a strip between two stations, map frame; with the VRU margins when asked.

    The outline follows the strip's samples, so it bends with the road.
    """
    inner = strip.station_m[(strip.station_m > from_m) & (strip.station_m < to_m)]
    station = np.concatenate(([from_m], inner, [to_m]))
    center = np.column_stack([np.interp(station, strip.station_m, strip.center_m[:, k]) for k in (0, 1)])
    tangent = np.gradient(center, axis=0)
    tangent /= np.maximum(np.hypot(tangent[:, 0], tangent[:, 1]), 1e-12)[:, None]
    normal = np.column_stack((-tangent[:, 1], tangent[:, 0]))
    left = np.interp(station, strip.station_m, strip.half_width_m + (strip.vru_left_m if vru else 0.0))
    right = np.interp(station, strip.station_m, strip.half_width_m + (strip.vru_right_m if vru else 0.0))
    return np.concatenate((center + normal * left[:, None], (center - normal * right[:, None])[::-1]))
