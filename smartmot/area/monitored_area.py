"""Which objects matter: the rectangle of the baseline, the lanes of the map, or everything.

A strategy gives, for an ego state, an area that answers two questions about object boxes: is the object kept
(tracked), and how does it relate to the ego's route.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from smartmot.decision.braking import BrakingDistance, overhang_m
from smartmot.errors import ConfigError
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.route import Route
from smartmot.maps.strips import LaneStrip, StripSet, lane_strip, ring
from smartmot.types import (
    VULNERABLE,
    BoolArray,
    Boxes,
    EgoState,
    FloatArray,
    StrArray,
    frozen,
    unchecked,
)

PATH_CLEARANCE_M = 0.3
"""Free space beside the ego's outline that its path asks for (ours; a parked car at the kerb is passed)."""
_OUTLINE = np.array([(i, k) for i in (-1, 0, 1) for k in (-1, 0, 1)], dtype=np.float64)


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
    """

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) which objects are tracked at all."""

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        """How objects relate to the ego's route."""

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        """(N,) which points, (N, 2) map frame, lie on the ego's lane ahead, without any margin."""

    def polygons(self) -> list[tuple[str, FloatArray]]:
        """Outlines to draw: (role, (P, 2) ring in the map frame)."""


class MonitoredAreaStrategy(Protocol):
    """Makes the area for an ego state.

    It may have `uses_path = True`: then the ego is forecast along its planned path where the settings ask for
    that, and if `at` has a parameter `path`, it gets the path there (None while it is not known).
    """

    name: str

    def at(self, ego: EgoState) -> MonitoredArea:
        """The monitored area around `ego`."""


def is_vulnerable(category: StrArray) -> BoolArray:
    """(N,) whether each category is a vulnerable road user."""
    return np.array([name in VULNERABLE for name in category.tolist()], dtype=np.bool_)


def _any(mask: BoolArray) -> BoolArray:
    """(N,) whether any segment holds, from (N, S)."""
    return np.asarray(mask.any(axis=1), dtype=np.bool_)


def outline_points(boxes: Boxes) -> FloatArray:
    """(N * 9, 2) centre, corners and edge middles of boxes, map frame, one box after the other."""
    half = boxes.size_m[:, None, :] / 2 * _OUTLINE
    c, s = np.cos(boxes.yaw_rad)[:, None], np.sin(boxes.yaw_rad)[:, None]
    x = boxes.center_m[:, 0, None] + c * half[..., 0] - s * half[..., 1]
    y = boxes.center_m[:, 1, None] + s * half[..., 0] + c * half[..., 1]
    return np.stack((x, y), axis=-1).reshape(-1, 2)


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
    turn = boxes.yaw_rad - ego.yaw_rad
    ct, st = np.abs(np.cos(turn)), np.abs(np.sin(turn))
    half_x = 0.5 * (boxes.size_m[:, 0] * ct + boxes.size_m[:, 1] * st)
    half_y = 0.5 * (boxes.size_m[:, 0] * st + boxes.size_m[:, 1] * ct)
    return x - half_x, x + half_x, y - half_y, y + half_y


# --- the rectangle of the baseline -------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RectangularConfig:
    """The geometric monitored area of the paper's baseline (its reference [3], authors' code).

    Args:
        min_length_m, max_length_m: the rectangle's length is braking_factor x braking distance, clamped.
        braking_factor: 40 % of safety.
        half_width_m: to each side of the ego's axis.
        straight_radius_m: turning radius from which the road counts as straight; below it length and width
            shrink in proportion, to nothing.
    """

    min_length_m: float = 12.0
    max_length_m: float = 30.0
    braking_factor: float = 1.4
    half_width_m: float = 2.6
    straight_radius_m: float = 20.0

    def __post_init__(self) -> None:
        if not 0 < self.min_length_m <= self.max_length_m:
            raise ConfigError("rectangular area: needs 0 < min_length_m <= max_length_m")
        if not (self.braking_factor > 0 and self.half_width_m > 0 and self.straight_radius_m > 0):
            raise ConfigError("rectangular area: factor, half width and radius must be positive")


@dataclass(frozen=True, slots=True, eq=False)
class _Rectangle:
    ego: EgoState
    length_m: float
    half_width_m: float

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        return np.ones(len(boxes), dtype=np.bool_)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        x_min, x_max, y_min, y_max = ego_extent(boxes, self.ego)
        inside = (x_min <= self.length_m) & (x_max >= 0.0)
        inside &= (y_min <= self.half_width_m) & (y_max >= -self.half_width_m)
        return unchecked(Relevance, inside, inside & self.on_lane(boxes.center_m), inside)

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        x, y = ego_frame(center_m, self.ego)
        inside: BoolArray = (x >= 0.0) & (x <= self.length_m) & (np.abs(y) <= self.half_width_m)
        return inside

    def polygons(self) -> list[tuple[str, FloatArray]]:
        local = np.array(
            [
                [0.0, -self.half_width_m],
                [self.length_m, -self.half_width_m],
                [self.length_m, self.half_width_m],
                [0.0, self.half_width_m],
            ]
        )
        c, s = np.cos(self.ego.yaw_rad), np.sin(self.ego.yaw_rad)
        turned = local @ np.array([[c, s], [-s, c]])
        return [("rectangle", turned + np.array([self.ego.x_m, self.ego.y_m]))]


class RectangularArea:
    """Tracks everything; counts what is in a rectangle that starts at the ego's centre."""

    name = "rectangular"

    def __init__(self, config: RectangularConfig, distance: BrakingDistance) -> None:
        self.config = config
        self._distance = distance

    def at(self, ego: EgoState) -> _Rectangle:
        """The rectangle for this speed and curvature."""
        c = self.config
        curvature = abs(ego.yaw_rate_radps) / max(ego.speed_mps, 0.5)
        straight = min(1.0, 1.0 / max(curvature * c.straight_radius_m, 1e-9))
        wanted = c.braking_factor * self._distance.at(ego.speed_mps)
        length = min(max(wanted, c.min_length_m), c.max_length_m) + overhang_m(ego)
        return _Rectangle(ego, straight * length, straight * c.half_width_m)


# --- everything --------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True, eq=False)
class _Everything:
    ego: EgoState
    path_half_width_m: float

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        return np.ones(len(boxes), dtype=np.bool_)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        ahead = ego_extent(boxes, self.ego)[1] >= 0.0
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
    WAY_HALF_WIDTH_M = 1.75

    def at(self, ego: EgoState) -> _Everything:
        """The same answer everywhere."""
        return _Everything(ego, self.WAY_HALF_WIDTH_M)


# --- the lanes of the map ----------------------------------------------------------------------------


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
    low_m: FloatArray
    high_m: FloatArray
    route_low_m: FloatArray
    route_high_m: FloatArray
    route: Route
    path_m: tuple[float, float]
    reach_m: float | None

    @property
    def lanes(self) -> tuple[MonitoredLane, ...]:
        """The monitored stretches, behind the ego and ahead of it."""
        found = []
        for entry, (begin, middle, end) in zip(self.entries, self.spans_m.T.tolist(), strict=True):
            if middle > begin:
                found.append(MonitoredLane(entry.strip, entry.role, False, begin, middle))
            if end > middle:
                found.append(MonitoredLane(entry.strip, entry.role, True, middle, end))
        return tuple(found)

    def kept(self, boxes: Boxes, category: StrArray) -> BoolArray:
        """(N,) objects in a monitored lane; VRUs also in the margins."""
        return self._inside(boxes, category, self.low_m, self.high_m)

    def relevance(self, boxes: Boxes, category: StrArray) -> Relevance:
        """Objects on the route ahead and within reach: in the lane, in its margins, on the ego's path."""
        x_min, x_max, _, _ = ego_extent(boxes, self.ego)
        within_reach = x_max >= 0.0  # not wholly behind the ego's centre
        if self.reach_m is not None:
            within_reach &= x_min <= self.reach_m
        in_route, on_way = np.zeros(len(boxes), dtype=np.bool_), np.zeros(len(boxes), dtype=np.bool_)
        vru = is_vulnerable(category)
        walkers, others = np.flatnonzero(within_reach & vru), np.flatnonzero(within_reach & ~vru)
        if len(walkers):
            station, in_lane, in_margin = self.strips.place(boxes.center_m[walkers])
            ahead = (station >= self.route_low_m) & (station <= self.route_high_m)
            in_route[walkers], on_way[walkers] = _any(in_margin & ahead), _any(in_lane & ahead)
        if len(others):
            points = outline_points(boxes[others])
            station, in_lane = self.strips.place_in_lanes(points)
            ahead = (station >= self.route_low_m) & (station <= self.route_high_m)
            in_route[others] = _any(in_lane & ahead).reshape(len(others), -1).any(axis=1)
            station, offset = self.route.place(points)
            near = np.abs(offset) <= self.ego.width_m / 2 + PATH_CLEARANCE_M
            near &= (station >= self.path_m[0]) & (station <= self.path_m[1])
            on_way[others] = near.reshape(len(others), -1).any(axis=1)
        return unchecked(Relevance, in_route, on_way, within_reach)

    def _inside(self, boxes: Boxes, category: StrArray, low_m: FloatArray, high_m: FloatArray) -> BoolArray:
        """(N,) whether VRUs' centres lie in lanes or margins, or other outlines meet a lane, in a span."""
        vru = is_vulnerable(category)
        found = np.zeros(len(boxes), dtype=np.bool_)
        count = np.count_nonzero(vru)
        if count:
            station, in_margin = self.strips.place_in_margins(boxes.center_m[vru])
            found[vru] = _any(in_margin & (station >= low_m) & (station <= high_m))
        if count < len(vru):
            others = boxes[~vru]
            station, in_lane = self.strips.place_in_lanes(outline_points(others))
            hit = _any(in_lane & (station >= low_m) & (station <= high_m))
            found[~vru] = hit.reshape(len(others), -1).any(axis=1)
        return found

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        """(N,) points on the route's lanes ahead."""
        station, in_lane = self.strips.place_in_lanes(center_m)
        span = (station >= self.route_low_m) & (station <= self.route_high_m)
        return _any(span & in_lane)

    def polygons(self) -> list[tuple[str, FloatArray]]:
        """Outlines: the VRU margins first, the lanes over them."""
        margins = [("vru_margin", ring(x.strip, x.from_m, x.to_m, vru=True)) for x in self.lanes]
        lanes = [
            (x.role if x.front or x.role != "current" else "back", ring(x.strip, x.from_m, x.to_m))
            for x in self.lanes
        ]
        return margins + lanes


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
        for k, own in enumerate(route.strips):
            span = (float(own.s_m[0]), float(own.s_m[-1]))
            entries.append(self._alongside(k, own.lane, "current", span))
            for role in ("left", "right"):
                side = self._side_lane(own.lane, role)
                # one that the route changes into, or comes from, is a neighbour only before, or after, that
                free = span if side is None else _without(span, side, route.strips)
                if side is not None and free is not None:
                    entries.append(self._alongside(k, side, role, free))
            for lane, role in self._intersection_lanes(k):
                if lane not in on_route:
                    strip = lane_strip(network, lane, config.vru_margin_m)
                    entry_m = float(route.entry_m[k])
                    entries.append(_Entry(strip, role, k, entry_m, entry_m + own.length_m))
        self._entries = tuple(entries)
        self.strips = StripSet([entry.strip for entry in entries])
        # every frame asks for all of them
        self._from_m = np.array([entry.from_m for entry in entries])
        self._long_m = np.array([entry.to_m - entry.from_m for entry in entries])
        self._length_m = np.array([entry.strip.length_m for entry in entries])
        self._scale = self._length_m / self._long_m
        self._current = np.array([entry.role == "current" for entry in entries])
        self._whole = np.array([entry.role not in ("current", "left", "right") for entry in entries])
        self._beside = [(k, entry) for k, entry in enumerate(entries) if entry.role in ("left", "right")]

    def _alongside(self, k: int, lane: int, role: str, s_span_m: tuple[float, float]) -> _Entry:
        """The stretch of a lane of the same road that lies beside the k-th strip of the route, or is it."""
        whole = lane_strip(self.network, lane, self.config.vru_margin_m)
        own, entry_m = self.route.strips[k], float(self.route.entry_m[k])
        part = whole.part(*(whole.station_at(s) for s in s_span_m))
        first, last = (entry_m + own.station_at(s) for s in s_span_m)
        if role == "current":
            return _Entry(part, role, k, first, last)
        change = self.network.lane_change_ranges(own.lane, "left" if role == "left" else "right")
        return _Entry(part, role, k, first, last, tuple((low, high) for low, high in change.tolist()))

    def _side_lane(self, lane: int, side: str) -> int | None:
        lanes = self.network.lanes
        other = self.network.left_neighbour(lane) if side == "left" else self.network.right_neighbour(lane)
        if (
            other is None
            or lanes.lane_type[other] != "driving"
            or lanes.direction[other] != lanes.direction[lane]
        ):
            return None
        return other

    def _intersection_lanes(self, k: int) -> Sequence[tuple[int, str]]:
        """Lanes of the junction that the k-th lane of the route passes, with their roles."""
        import shapely

        lanes = self.network.lanes
        own = self.route.strips[k].lane
        junction = lanes.junction_id[own]
        if junction is None:
            return ()
        strips = self.route.strips
        before = set(self.network.predecessors(own)) | ({strips[k - 1].lane} if k else set())
        after = set(self.network.successors(own)) | ({strips[k + 1].lane} if k + 1 < len(strips) else set())
        surface = shapely.Polygon(ring(strips[k], 0.0, strips[k].length_m)).buffer(0)
        found = []
        for lane, where in enumerate(lanes.junction_id):
            if where != junction or lane == own or lanes.lane_type[lane] != "driving":
                continue
            same_start = bool(before & set(self.network.predecessors(lane)))
            same_end = bool(after & set(self.network.successors(lane)))
            if same_start and same_end:
                continue
            if same_start or same_end:
                found.append((lane, "split" if same_start else "merge"))
                continue
            strip = lane_strip(self.network, lane, 0.0)
            other = shapely.Polygon(ring(strip, 0.0, strip.length_m)).buffer(0)
            if surface.intersection(other).area > 0.1:
                found.append((lane, "cross"))
        return found

    def front_m(self, speed_mps: float) -> float:
        """Monitored length ahead of a car's centre."""
        return max(self.config.min_front_m, self.config.front_time_s * speed_mps)

    def at(self, ego: EgoState) -> MonitoredLanes:
        """The monitored lanes around `ego`."""
        here, _ = self.route.project(ego.x_m, ego.y_m)
        front, beyond, reach = self.front_m(ego.speed_mps), overhang_m(ego), self.config.reach_m
        spans = self._spans(here, front + beyond, self.config.back_fraction * front)
        begin, middle, end = spans
        # one interval per strip: what is behind and what is ahead join at the ego
        monitored, ahead = end > begin, self._current & (end > middle)
        of = self.strips.strip
        return MonitoredLanes(
            ego,
            self._entries,
            spans,
            self.strips,
            np.where(monitored, begin, np.inf)[of],
            np.where(monitored, end, -np.inf)[of],
            np.where(ahead, middle, np.inf)[of],
            np.where(ahead, end, -np.inf)[of],
            self.route,
            (max(here, 0.0), min(here + front + beyond, self.route.length_m)),
            None if reach is None else reach + beyond,
        )

    def _spans(self, here_m: float, front_m: float, back_m: float) -> FloatArray:
        """(3, E) stations along each entry's strip: first one monitored, the ego's, last one monitored."""
        points = np.array([[here_m - back_m], [here_m], [here_m + front_m]])
        spans: FloatArray = np.minimum(np.maximum(points - self._from_m, 0.0), self._long_m)
        spans *= self._scale
        # a junction's lanes matter as a whole while the route ahead passes it
        passed = self._whole & (spans[2] > spans[1])
        spans[:, self._whole] = 0.0
        spans[2, passed] = self._length_m[passed]
        for k, entry in self._beside:
            own, start = self.route.strips[entry.k], float(self.route.entry_m[entry.k])
            s = own.s_at(min(max(here_m - start, 0.0), own.length_m))
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


_LEAST_M = 0.1
"""Shorter stretches of a neighbouring lane are left out."""
