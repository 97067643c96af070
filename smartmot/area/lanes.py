"""The lanes of the map that matter to the ego: its route, its neighbours, and the junction ahead.

Source of the roles: the map monitor of the paper's authors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from smartmot.area.monitored import Relevance, ego_span, is_vulnerable, outline_points
from smartmot.area.way import PATH_CLEARANCE_M
from smartmot.decision.braking import overhang_m
from smartmot.errors import ConfigError
from smartmot.maps.lane_map import LaneMap, Side
from smartmot.maps.route import Route
from smartmot.maps.strips import LaneStrip, Segments, StripSet, lane_strip, ring
from smartmot.maps.walks import side_lane
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray, StrArray, unchecked

CURRENT = "current"
"""Role of the route's own lanes."""
SIDES: tuple[Side, Side] = ("left", "right")
"""Roles of the lanes beside them."""

LEAST_CROSSING_M2 = 0.1
"""Lanes whose surfaces share less only touch, or meet by rounding."""
_LEAST_M = 0.1
"""Shorter stretches of a neighbouring lane are left out."""


@dataclass(frozen=True, slots=True)
class MapAreaConfig:
    """Monitored lanes around the ego (paper, section III; roles of the authors' map monitor).

    Args:
        vru_margin_m: how far over the sidewalk VRUs are kept (paper: 1.8 m).
        min_front_m: monitored length in front at standstill.
        front_time_s: the length in front grows with speed to at least the distance driven in this time;
            3 s is the paper's shortest forecast.
        back_fraction: monitored length behind, as a share of that in front.
        reach_m: how far ahead of the ego's centre an object may count in a decision; None: as far as it is
            monitored. The paper's own system was limited to 22.2 m (see docs).
    """

    vru_margin_m: float = 1.8
    min_front_m: float = 30.0
    front_time_s: float = 3.0
    back_fraction: float = 0.5
    reach_m: float | None = None

    def __post_init__(self) -> None:
        if not (self.vru_margin_m >= 0 and self.min_front_m > 0 and self.front_time_s >= 0):
            raise ConfigError("map area: margin and time must not be negative, length must be positive")
        if not 0 <= self.back_fraction <= 1:
            raise ConfigError(f"map area: back_fraction must lie in [0, 1], got {self.back_fraction}")
        if self.reach_m is not None and not self.reach_m > 0:
            raise ConfigError(f"map area: reach_m must be positive, got {self.reach_m}")


@dataclass(frozen=True, slots=True, eq=False)
class MonitoredLane:
    """A stretch of one lane with its role.

    Args:
        strip: the lane.
        role: current, left, right, split, merge or cross.
        front: ahead of the ego (else behind it).
        from_m, to_m: stations along the strip.
    """

    strip: LaneStrip
    role: str
    front: bool
    from_m: float
    to_m: float


@dataclass(frozen=True, slots=True, eq=False)
class MonitoredLanes:
    """The map area at one moment; see `MonitoredArea`."""

    ego: EgoState
    entries: tuple[_Entry, ...]
    spans_m: FloatArray
    strips: StripSet
    current: BoolArray
    route: Route
    path_m: tuple[float, float]
    reach_m: float | None
    _segments: tuple[Segments | None, Segments | None] = field(default=(None, None), init=False, repr=False)

    @property
    def lanes(self) -> tuple[MonitoredLane, ...]:
        """The monitored stretches, behind the ego and ahead of it."""
        stretches = []
        for entry, (begin, middle, end) in zip(self.entries, self.spans_m.T.tolist(), strict=True):
            if middle > begin:
                stretches.append(MonitoredLane(entry.strip, entry.role, False, begin, middle))
            if end > middle:
                stretches.append(MonitoredLane(entry.strip, entry.role, True, middle, end))
        return tuple(stretches)

    @property
    def _monitored(self) -> Segments:
        """What is monitored of the strips: what is behind and what is ahead join at the ego."""
        monitored, ahead = self._segments
        if monitored is None:
            begin, _, end = self.spans_m
            monitored = self.strips.between(begin, end, end > begin)
            object.__setattr__(self, "_segments", (monitored, ahead))
        return monitored

    @property
    def _ahead(self) -> Segments:
        """The route's lanes ahead of the ego."""
        monitored, ahead = self._segments
        if ahead is None:
            _, middle, end = self.spans_m
            ahead = self.strips.between(middle, end, self.current & (end > middle))
            object.__setattr__(self, "_segments", (monitored, ahead))
        return ahead

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) objects in a monitored lane; VRUs also in the margins."""
        if not len(boxes):
            return np.zeros(0, dtype=np.bool_)
        vru = is_vulnerable(category)
        vru_count = np.count_nonzero(vru)
        if vru_count == len(vru):
            return _any(self._monitored.in_margins(boxes.center_m[:, None])[1])
        if not vru_count:
            return _touched(boxes, self._monitored)
        kept = np.zeros(len(vru), dtype=np.bool_)
        kept[vru] = _any(self._monitored.in_margins(boxes.center_m[vru][:, None])[1])
        kept[~vru] = _touched(boxes[~vru], self._monitored)
        return kept

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        """Objects on the route ahead and within reach: in the lane, in its margins, on the ego's path."""
        within_reach = self.within_reach(boxes, category)
        in_route, on_way = np.zeros(len(boxes), dtype=np.bool_), np.zeros(len(boxes), dtype=np.bool_)
        vru = is_vulnerable(category)
        vrus, vehicles = np.flatnonzero(within_reach & vru), np.flatnonzero(within_reach & ~vru)
        if len(vrus):
            _, in_lane, in_margin = self._ahead.place(boxes.center_m[vrus][:, None])
            in_route[vrus], on_way[vrus] = _any(in_margin), _any(in_lane)
        if len(vehicles):
            in_route[vehicles] = _touched(boxes[vehicles], self._ahead)
            # a vehicle beside the path is passed, even where it stands with a wheel in the lane
            station, offset = self.route.place(outline_points(boxes[vehicles]))
            near = np.abs(offset) <= self.ego.width_m / 2 + PATH_CLEARANCE_M
            near &= (station >= self.path_m[0]) & (station <= self.path_m[1])
            on_way[vehicles] = _of_outlines(near)
        return unchecked(Relevance, in_route, on_way, within_reach)

    def within_reach(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) boxes not wholly behind the ego's centre, and no farther ahead than objects may count."""
        x_min, x_max = ego_span(boxes, self.ego)
        return x_max >= 0.0 if self.reach_m is None else (x_max >= 0.0) & (x_min <= self.reach_m)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        """(N,) points on the route's lanes ahead."""
        return _any(self._ahead.in_lanes(center_m[:, None])[1])

    def polygons(self) -> list[tuple[str, FloatArray]]:
        """Outlines: the VRU margins first, the lanes over them."""
        margins = [("vru_margin", ring(x.strip, x.from_m, x.to_m, vru=True)) for x in self.lanes]
        lanes = [
            (x.role if x.front or x.role != CURRENT else "back", ring(x.strip, x.from_m, x.to_m))
            for x in self.lanes
        ]
        return margins + lanes


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


def _of_outlines(mask: BoolArray) -> BoolArray:
    """(N,) whether any of a box's nine outline points holds, from (N * 9,)."""
    return np.asarray(mask.reshape(-1, 9).any(axis=1), dtype=np.bool_)


class MapArea:
    """Monitored lanes from map, route and ego pose.

    Roles: `current` on the route, ahead and behind; `left` and `right` where the road mark allows the lane
    change and the neighbour runs the same way; in junctions on the route `split` (starts with the route's
    lane, ends elsewhere), `merge` (the reverse) and `cross` (neither, but its surface meets the route's).

    Args:
        network: the map.
        route: lanes the ego means to drive; the planning layer's part.
        config: lengths and margins.
    """

    name = "map"
    uses_path = True

    def __init__(self, network: LaneMap, route: Route, config: MapAreaConfig) -> None:
        self.network, self.route, self.config = network, route, config
        entries: list[_Entry] = []
        on_route = set(route.lanes)
        for k, strip in enumerate(route.strips):
            span = (float(strip.s_m[0]), float(strip.s_m[-1]))
            entries.append(self._alongside(k, strip.lane, CURRENT, span))
            for side in SIDES:
                beside = side_lane(network, strip.lane, side)
                # one that the route changes into, or comes from, is a neighbour only before, or after, that
                free = None if beside is None else _without(span, beside, route.strips)
                if beside is not None and free is not None:
                    entries.append(self._alongside(k, beside, side, free))
            for lane, role in self._intersection_lanes(k):
                if lane not in on_route:
                    entry_m = float(route.entry_m[k])
                    crossing = lane_strip(network, lane, config.vru_margin_m)
                    entries.append(_Entry(crossing, role, k, entry_m, entry_m + strip.length_m))
        self._entries = tuple(entries)
        self.strips = StripSet([entry.strip for entry in entries])
        # every frame asks for all of them
        self._from_m = np.array([entry.from_m for entry in entries])
        self._long_m = np.array([entry.to_m - entry.from_m for entry in entries])
        self._length_m = np.array([entry.strip.length_m for entry in entries])
        self._scale = self._length_m / self._long_m
        self._current = np.array([entry.role == CURRENT for entry in entries])
        self._whole = np.array([entry.role not in (CURRENT, *SIDES) for entry in entries])
        self._crossed = bool(self._whole.any())
        self._beside = [(k, entry) for k, entry in enumerate(entries) if entry.role in SIDES]

    def _alongside(self, k: int, lane: int, role: str, s_span_m: tuple[float, float]) -> _Entry:
        """The stretch of a lane of the same road that lies beside the k-th strip of the route, or is it."""
        route_strip, entry_m = self.route.strips[k], float(self.route.entry_m[k])
        strip = lane_strip(self.network, lane, self.config.vru_margin_m)
        part = strip.part(*(strip.station_at(s) for s in s_span_m))
        first, last = (entry_m + route_strip.station_at(s) for s in s_span_m)
        if role not in SIDES:
            return _Entry(part, role, k, first, last)
        change = self.network.lane_change_ranges(route_strip.lane, role)
        return _Entry(part, role, k, first, last, tuple((low, high) for low, high in change.tolist()))

    def _intersection_lanes(self, k: int) -> Sequence[tuple[int, str]]:
        """Lanes of the junction that the k-th lane of the route passes, with their roles."""
        import shapely

        def surface(strip: LaneStrip) -> shapely.Polygon:
            # a ring that crosses itself in a tight bend is no polygon; a buffer of 0 makes it one
            return shapely.Polygon(ring(strip, 0.0, strip.length_m)).buffer(0)

        network, lanes = self.network, self.network.lanes
        strips, passed = self.route.strips, self.route.strips[k].lane
        junction = lanes.junction_id[passed]
        if junction is None:
            return ()
        before = set(network.predecessors(passed)) | ({strips[k - 1].lane} if k else set())
        after = set(network.successors(passed)) | ({strips[k + 1].lane} if k + 1 < len(strips) else set())
        passed_surface = surface(strips[k])
        roles: list[tuple[int, str]] = []
        for lane, lane_junction in enumerate(lanes.junction_id):
            if lane_junction != junction or lane == passed or lanes.lane_type[lane] != "driving":
                continue
            same_start = bool(before & set(network.predecessors(lane)))
            same_end = bool(after & set(network.successors(lane)))
            if same_start != same_end:
                roles.append((lane, "split" if same_start else "merge"))
            elif not same_start:
                common = passed_surface.intersection(surface(lane_strip(network, lane, 0.0)))
                if common.area > LEAST_CROSSING_M2:
                    roles.append((lane, "cross"))
        return roles

    def front_m(self, speed_mps: float) -> float:
        """Monitored length ahead of a car's centre."""
        return max(self.config.min_front_m, self.config.front_time_s * speed_mps)

    def at(self, ego: EgoState) -> MonitoredLanes:
        """The monitored lanes around `ego`."""
        station, _ = self.route.project(ego.x_m, ego.y_m)
        front, beyond, reach = self.front_m(ego.speed_mps), overhang_m(ego), self.config.reach_m
        spans = self._spans(station, front + beyond, self.config.back_fraction * front)
        return unchecked(
            MonitoredLanes,
            ego,
            self._entries,
            spans,
            self.strips,
            self._current,
            self.route,
            (max(station, 0.0), min(station + front + beyond, self.route.length_m)),
            None if reach is None else reach + beyond,
            (None, None),
        )

    def _spans(self, ego_m: float, front_m: float, back_m: float) -> FloatArray:
        """(3, E) stations along each entry's strip: first one monitored, the ego's, last one monitored."""
        points = np.array([[ego_m - back_m], [ego_m], [ego_m + front_m]])
        # clipped to each entry's stretch of the route; its own lane may be longer or shorter than that
        spans: FloatArray = np.minimum(np.maximum(points - self._from_m, 0.0), self._long_m)
        spans *= self._scale
        # a junction's lanes matter as a whole while the route ahead passes it
        if self._crossed:
            passed = self._whole & (spans[2] > spans[1])
            spans[:, self._whole] = 0.0
            spans[2, passed] = self._length_m[passed]
        for k, entry in self._beside:
            strip, start = self.route.strips[entry.k], float(self.route.entry_m[entry.k])
            s = strip.s_at(min(max(ego_m - start, 0.0), strip.length_m))
            if not any(low <= s <= high for low, high in entry.change_s_m):
                spans[:, k] = 0.0
        return spans


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """A lane that may be monitored.

    Args:
        strip: the lane, or the stretch of it that matters.
        role: see `MonitoredLane`.
        k: the strip of the route that it belongs to.
        from_m, to_m: stations of its ends along the route; of a junction's lane, where the route passes that.
        change_s_m: stretches of s on which the road mark lets the ego change into it from the route's lane.
    """

    strip: LaneStrip
    role: str
    k: int
    from_m: float
    to_m: float
    change_s_m: tuple[tuple[float, float], ...] = ()


def _without(span: tuple[float, float], lane: int, strips: Sequence[LaneStrip]) -> tuple[float, float] | None:
    """What is left of a span of s, in travel direction, without a lane's stretches that are on the route."""
    low, high = span
    sign = 1.0 if high >= low else -1.0
    for strip in strips:
        if strip.lane == lane:
            first, last = float(strip.s_m[0]), float(strip.s_m[-1])
            if sign * (first - low) > 0.0:
                high = min(high, first, key=lambda s: sign * s)
            else:
                low = max(low, last, key=lambda s: sign * s)
    return (low, high) if sign * (high - low) > _LEAST_M else None
