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

from opendrive import RoadNetwork
from smartmot.braking import BrakingDistance
from smartmot.errors import ConfigError
from smartmot.route import Route
from smartmot.strips import LaneStrip, StripSet, lane_strip, ring
from smartmot.types import VULNERABLE, BoolArray, Boxes, EgoState, FloatArray, StrArray

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
    """

    in_route: BoolArray
    on_way: BoolArray
    within_reach: BoolArray


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
    """Makes the area for an ego state."""

    name: str

    def at(self, ego: EgoState) -> MonitoredArea:
        """The monitored area around `ego`."""


def is_vulnerable(category: StrArray) -> BoolArray:
    """(N,) whether each category is a vulnerable road user."""
    found = np.zeros(len(category), dtype=np.bool_)
    for name in VULNERABLE:
        found |= category == name
    return found


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
        return Relevance(inside, inside & self.on_lane(boxes.center_m), inside)

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
        length = min(max(wanted, c.min_length_m), c.max_length_m)
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
        return Relevance(ahead, ahead & self.on_lane(boxes.center_m), ahead)

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
    lanes: tuple[MonitoredLane, ...]
    strips: StripSet
    low_m: FloatArray
    high_m: FloatArray
    route_low_m: FloatArray
    route_high_m: FloatArray
    reach_m: float | None

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
            station, in_lane, _ = self.strips.place(points)
            ahead = (station >= self.route_low_m) & (station <= self.route_high_m)
            in_route[others] = _any(in_lane & ahead).reshape(len(others), -1).any(axis=1)
            station, near = self.strips.near_center(points, self.ego.width_m / 2 + PATH_CLEARANCE_M)
            on_way[others] = _any(near & ahead).reshape(len(others), -1).any(axis=1)
        return Relevance(in_route, on_way, within_reach)

    def _inside(self, boxes: Boxes, category: StrArray, low_m: FloatArray, high_m: FloatArray) -> BoolArray:
        """(N,) whether VRUs' centres lie in lanes or margins, or other outlines meet a lane, in a span."""
        vru = is_vulnerable(category)
        found = np.zeros(len(boxes), dtype=np.bool_)
        if vru.any():
            station, _, in_margin = self.strips.place(boxes.center_m[vru])
            found[vru] = _any(in_margin & (station >= low_m) & (station <= high_m))
        if not vru.all():
            others = boxes[~vru]
            station, in_lane, _ = self.strips.place(outline_points(others))
            hit = _any(in_lane & (station >= low_m) & (station <= high_m))
            found[~vru] = hit.reshape(len(others), -1).any(axis=1)
        return found

    def on_lane(self, center_m: FloatArray) -> BoolArray:
        """(N,) points on the route's lanes ahead."""
        station, in_lane, _ = self.strips.place(center_m)
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

    def __init__(self, network: RoadNetwork, route: Route, config: MapAreaConfig) -> None:
        self.network, self.route, self.config = network, route, config
        entries: list[tuple[LaneStrip, str, int, float]] = []  # strip, role, position on route, entry station
        on_route = set(route.lanes)
        for k, strip in enumerate(route.strips):
            entries.append((lane_strip(network, strip.lane, config.vru_margin_m), "current", k, 0.0))
            for role in ("left", "right"):
                side = self._side_lane(strip.lane, role)
                if side is not None and side not in on_route:
                    entries.append((lane_strip(network, side, config.vru_margin_m), role, k, 0.0))
            for lane, role in self._intersection_lanes(k):
                if lane not in on_route:
                    entries.append((lane_strip(network, lane, config.vru_margin_m), role, k, 0.0))
        self._entries = entries
        self.strips = StripSet([e[0] for e in entries])

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

    def _change_allowed(self, lane: int, side: str, s_m: float) -> bool:
        return bool(self.network.lane_change(lane, s_m, "left" if side == "left" else "right"))

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
        """Monitored length ahead of the ego's centre."""
        return max(self.config.min_front_m, self.config.front_time_s * speed_mps)

    def at(self, ego: EgoState) -> MonitoredLanes:
        """The monitored lanes around `ego`."""
        here, _ = self.route.project(ego.x_m, ego.y_m)
        front = self.front_m(ego.speed_mps)
        back = self.config.back_fraction * front
        spans = np.array([self._span(e, here, front, back) for e in self._entries]).reshape(-1, 4)
        chosen = []
        for (strip, role, _, _), (b0, b1, f0, f1) in zip(self._entries, spans, strict=True):
            if b1 > b0:
                chosen.append(MonitoredLane(strip, role, False, b0, b1))
            if f1 > f0:
                chosen.append(MonitoredLane(strip, role, True, f0, f1))
        of = self.strips.strip
        # one interval per strip: what is behind and what is ahead join at the ego
        has_back, has_front = spans[:, 1] > spans[:, 0], spans[:, 3] > spans[:, 2]
        low = np.where(has_back, spans[:, 0], np.where(has_front, spans[:, 2], np.inf))
        high = np.where(has_front, spans[:, 3], np.where(has_back, spans[:, 1], -np.inf))
        current = np.array([role == "current" for _, role, _, _ in self._entries])
        route_low = np.where(current & has_front, spans[:, 2], np.inf)
        route_high = np.where(current & has_front, spans[:, 3], -np.inf)
        return MonitoredLanes(
            ego,
            tuple(chosen),
            self.strips,
            low[of],
            high[of],
            route_low[of],
            route_high[of],
            self.config.reach_m,
        )

    def _span(
        self, entry: tuple[LaneStrip, str, int, float], here: float, front: float, back: float
    ) -> tuple[float, float, float, float]:
        """Stations (back from, back to, front from, front to) of one lane; empty spans have from >= to."""
        strip, role, k, _ = entry
        own = self.route.strips[k]
        start = float(self.route.entry_m[k])
        scale = strip.length_m / own.length_m
        a, b, c = (min(max(x - start, 0.0), own.length_m) for x in (here - back, here, here + front))
        nothing = (0.0, 0.0, 0.0, 0.0)
        if role in ("left", "right"):
            reference = own.s_at(min(max(here - start, 0.0), own.length_m))
            if not self._change_allowed(own.lane, role, reference):
                return nothing
        elif role != "current":
            # a junction's lanes matter as a whole while the route ahead passes it
            return (0.0, 0.0, 0.0, strip.length_m) if c > b else nothing
        return (a * scale, b * scale, b * scale, c * scale)
