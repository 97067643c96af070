"""The lanes of the map that matter to the ego: its route, its neighbours, and the junction ahead.

Source of the roles: the map monitor of the paper's authors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from smartmot.area.monitored import Relevance, ego_span, is_vulnerable, outline_points
from smartmot.area.stretches import Stretches
from smartmot.area.way import PATH_CLEARANCE_M
from smartmot.decision.braking import overhang_m
from smartmot.errors import ConfigError
from smartmot.maps.lane_map import LaneMap, Side
from smartmot.maps.route import Route
from smartmot.maps.strips import LaneStrip, StripSet, lane_strip, ring
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
_FEW_ENTRIES = 16
"""Up to so many lanes a loop over all of them is quicker than a search for the near ones."""


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
    """The map area at one moment; see `MonitoredArea`.

    What is near the ego is looked up when it is first asked for: in many frames nobody is there to be placed.

    Args:
        ego: odometry now, map frame.
        map_area: whose lanes these are.
    """

    ego: EgoState
    map_area: MapArea
    _spans: list[tuple[int, float, float, float]] | None = field(default=None, init=False, repr=False)
    _monitored_lanes: Stretches | None = field(default=None, init=False, repr=False)
    _route_lanes: Stretches | None = field(default=None, init=False, repr=False)

    @property
    def lanes(self) -> tuple[MonitoredLane, ...]:
        """The monitored stretches, behind the ego and ahead of it."""
        stretches = []
        for k, begin, middle, end in self._near():
            entry = self.map_area.entries[k]
            if middle > begin:
                stretches.append(MonitoredLane(entry.strip, entry.role, False, begin, middle))
            if end > middle:
                stretches.append(MonitoredLane(entry.strip, entry.role, True, middle, end))
        return tuple(stretches)

    @property
    def reach_m(self) -> float | None:
        """How far ahead of the ego's centre an object may count; None: as far as it is monitored."""
        reach_m = self.map_area.config.reach_m
        return None if reach_m is None else reach_m + overhang_m(self.ego)

    def _near(self) -> list[tuple[int, float, float, float]]:
        """Stations along the strips of the monitored entries: first one monitored, the ego's, last one."""
        if self._spans is None:
            object.__setattr__(self, "_spans", self.map_area.spans(self.ego))
        assert self._spans is not None
        return self._spans

    @property
    def _monitored(self) -> Stretches:
        """What is monitored of the strips: what is behind and what is ahead join at the ego."""
        if self._monitored_lanes is None:
            stretches = [(k, begin, end) for k, begin, _, end in self._near()]
            object.__setattr__(self, "_monitored_lanes", Stretches(self.map_area.strips, stretches))
        assert self._monitored_lanes is not None
        return self._monitored_lanes

    @property
    def _ahead(self) -> Stretches:
        """The route's lanes ahead of the ego."""
        if self._route_lanes is None:
            entries = self.map_area.entries
            stretches = [
                (k, middle, end)
                for k, _, middle, end in self._near()
                if end > middle and entries[k].role == CURRENT
            ]
            object.__setattr__(self, "_route_lanes", Stretches(self.map_area.strips, stretches))
        assert self._route_lanes is not None
        return self._route_lanes

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) objects in a monitored lane; VRUs also in the margins."""
        if not len(boxes):
            return np.zeros(0, dtype=np.bool_)
        vru = is_vulnerable(category)
        vru_count = np.count_nonzero(vru)
        if vru_count == len(vru):
            return self._monitored.in_margins(boxes.center_m)
        if not vru_count:
            return self._monitored.touched(boxes)
        kept = np.zeros(len(vru), dtype=np.bool_)
        kept[vru] = self._monitored.in_margins(boxes.center_m[vru])
        kept[~vru] = self._monitored.touched(boxes[~vru])
        return kept

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        """Objects on the route ahead and within reach: in the lane, in its margins, on the ego's path."""
        within_reach = self.within_reach(boxes, category)
        in_route, on_way = np.zeros(len(boxes), dtype=np.bool_), np.zeros(len(boxes), dtype=np.bool_)
        vru = is_vulnerable(category)
        vrus, vehicles = (within_reach & vru).nonzero()[0], (within_reach & ~vru).nonzero()[0]
        if len(vrus):
            on_way[vrus], in_route[vrus] = self._ahead.place(boxes.center_m[vrus])
        if len(vehicles):
            route, (first_m, last_m) = self.map_area.route, self.map_area.path_m(self.ego)
            of_vehicles = boxes[vehicles]
            in_route[vehicles] = self._ahead.touched(of_vehicles)
            # a vehicle beside the path is passed, even where it stands with a wheel in the lane
            station, offset = route.place(outline_points(of_vehicles))
            near = np.abs(offset) <= self.ego.width_m / 2 + PATH_CLEARANCE_M
            near &= (station >= first_m) & (station <= last_m)
            on_way[vehicles] = _of_outlines(near)
        return unchecked(Relevance, in_route, on_way, within_reach)

    def within_reach(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) boxes not wholly behind the ego's centre, and no farther ahead than objects may count."""
        x_min, x_max = ego_span(boxes, self.ego)
        reach_m = self.reach_m
        return x_max >= 0.0 if reach_m is None else (x_max >= 0.0) & (x_min <= reach_m)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        """(N,) points on the route's lanes ahead."""
        return self._ahead.in_lanes(center_m)

    def polygons(self) -> list[tuple[str, FloatArray]]:
        """Outlines: the VRU margins first, the lanes over them."""
        margins = [("vru_margin", ring(x.strip, x.from_m, x.to_m, vru=True)) for x in self.lanes]
        lanes = [
            (x.role if x.front or x.role != CURRENT else "back", ring(x.strip, x.from_m, x.to_m))
            for x in self.lanes
        ]
        return margins + lanes


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
        self.entries = tuple(entries)
        self.strips = StripSet([entry.strip for entry in entries])
        # every frame asks for the entries near it
        self._from_m = np.array([entry.from_m for entry in entries])
        self._long_m = np.array([entry.long_m for entry in entries])

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
        return unchecked(MonitoredLanes, ego, self, None, None, None)

    def path_m(self, ego: EgoState) -> tuple[float, float]:
        """Stations along the route of the ego, and as far as it is monitored."""
        station, _ = self.route.project(ego.x_m, ego.y_m)
        front_m = self.front_m(ego.speed_mps) + overhang_m(ego)
        return max(station, 0.0), min(station + front_m, self.route.length_m)

    def spans(self, ego: EgoState) -> list[tuple[int, float, float, float]]:
        """Stations along the strips of what is monitored: entry, first one monitored, the ego's, last one."""
        ego_m, _ = self.route.project(ego.x_m, ego.y_m)
        front_m = self.front_m(ego.speed_mps)
        back_m, ahead_m = ego_m - self.config.back_fraction * front_m, ego_m + (front_m + overhang_m(ego))
        spans = []
        for k in self._around(back_m, ahead_m):
            entry = self.entries[k]
            from_m, long_m, scale = entry.from_m, entry.long_m, entry.scale
            # clipped to the entry's stretch of the route; its own lane may be longer or shorter than that
            begin = min(max(back_m - from_m, 0.0), long_m) * scale
            middle = min(max(ego_m - from_m, 0.0), long_m) * scale
            end = min(max(ahead_m - from_m, 0.0), long_m) * scale
            if entry.role in SIDES:
                if not self._may_change(entry, ego_m):
                    continue
            elif entry.role != CURRENT:
                # a junction's lanes matter as a whole while the route ahead passes it
                begin, middle, end = 0.0, 0.0, entry.strip.length_m if end > middle else 0.0
            if end > begin:
                spans.append((k, begin, middle, end))
        return spans

    def _around(self, back_m: float, ahead_m: float) -> Sequence[int]:
        """Entries that reach between two stations of the route; of few, all."""
        if len(self.entries) <= _FEW_ENTRIES:
            return range(len(self.entries))
        near = (ahead_m - self._from_m > 0.0) & (back_m - self._from_m < self._long_m)
        around: list[int] = near.nonzero()[0].tolist()
        return around

    def _may_change(self, entry: _Entry, ego_m: float) -> bool:
        """Whether the road mark lets the ego change into an entry's lane from where it is on its route."""
        strip, start = self.route.strips[entry.k], float(self.route.entry_m[entry.k])
        s = strip.s_at(min(max(ego_m - start, 0.0), strip.length_m))
        return any(low <= s <= high for low, high in entry.change_s_m)


@dataclass(frozen=True, slots=True, eq=False)
class _Entry:
    """A lane that may be monitored.

    Args:
        strip: the lane, or the stretch of it that matters.
        role: see `MonitoredLane`.
        k: the strip of the route that it belongs to.
        from_m, to_m: stations of its ends along the route; of a junction's lane, where the route passes that.
        change_s_m: stretches of s on which the road mark lets the ego change into it from the route's lane.
        long_m, scale: length along the route, and the strip's length over it.
    """

    strip: LaneStrip
    role: str
    k: int
    from_m: float
    to_m: float
    change_s_m: tuple[tuple[float, float], ...] = ()
    long_m: float = field(init=False)
    scale: float = field(init=False)

    def __post_init__(self) -> None:
        long_m = self.to_m - self.from_m
        object.__setattr__(self, "long_m", long_m)
        object.__setattr__(self, "scale", self.strip.length_m / long_m if long_m else 0.0)


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
