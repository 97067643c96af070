"""The lanes that the ego means to drive, as one path with stations."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from functools import cache
from itertools import pairwise

import numpy as np

from opendrive import RoadNetwork
from smartmot.errors import SmartMotError
from smartmot.strips import LaneStrip, lane_strip
from smartmot.types import FloatArray


class RouteError(SmartMotError):
    """A route cannot be built or a point is not on it."""


@dataclass(frozen=True, slots=True, eq=False)
class Route:
    """Consecutive lanes in travel direction.

    Args:
        strips: the lanes in driving order.
        entry_m: (K,) station of each lane's entry along the route.
        center_m: (P, 2) the joined centre line, map frame.
        station_m: (P,) distance along it.
    """

    strips: tuple[LaneStrip, ...]
    entry_m: FloatArray
    center_m: FloatArray
    station_m: FloatArray
    _unit: FloatArray = field(init=False, repr=False)
    _low_m: FloatArray = field(init=False, repr=False)
    _high_m: FloatArray = field(init=False, repr=False)

    def __post_init__(self) -> None:
        # every frame projects points; the segments are made once
        length = np.diff(self.station_m)
        low, high = np.zeros_like(length), length.copy()
        low[0], high[-1] = -np.inf, np.inf
        object.__setattr__(self, "_unit", np.diff(self.center_m, axis=0) / length[:, None])
        object.__setattr__(self, "_low_m", low)
        object.__setattr__(self, "_high_m", high)

    @property
    def length_m(self) -> float:
        """Length of the centre line."""
        return float(self.station_m[-1])

    @property
    def lanes(self) -> tuple[int, ...]:
        """Indices of the lanes in driving order."""
        return tuple(strip.lane for strip in self.strips)

    def project(self, x_m: float, y_m: float) -> tuple[float, float]:
        """Station and signed offset (left positive) of the nearest point of the centre line, metres.

        Before the first and after the last sample the end segments are extended straight on.
        """
        dx, dy = x_m - self.center_m[:-1, 0], y_m - self.center_m[:-1, 1]
        ux, uy = self._unit[:, 0], self._unit[:, 1]
        u = dx * ux + dy * uy
        on = np.minimum(np.maximum(u, self._low_m), self._high_m)
        lateral = ux * dy - uy * dx
        k = int(np.argmin((u - on) ** 2 + lateral**2))
        return float(self.station_m[k] + on[k]), float(lateral[k])

    def poses(self, station_m: FloatArray, offset_m: float = 0.0) -> tuple[FloatArray, FloatArray]:
        """Points beside the centre line (left positive) at many stations, straight on beyond its ends.

        Args:
            station_m: (T,) distances along it.
            offset_m: to the left.

        Returns:
            (T, 2) points, map frame, and (T,) headings of the centre line there.
        """
        k = np.clip(np.searchsorted(self.station_m, station_m, side="right") - 1, 0, len(self._unit) - 1)
        unit, along = self._unit[k], station_m - self.station_m[k]
        normal = np.column_stack((-unit[:, 1], unit[:, 0]))
        points = self.center_m[k] + unit * along[:, None] + normal * offset_m
        return points, np.arctan2(unit[:, 1], unit[:, 0])

    def pose(self, station_m: float, offset_m: float = 0.0) -> tuple[float, float, float]:
        """(x_m, y_m, yaw_rad) of a point beside the centre line (left positive), map frame."""
        k = int(np.clip(np.searchsorted(self.station_m, station_m) - 1, 0, len(self.station_m) - 2))
        ux, uy = self._unit[k]
        u = station_m - self.station_m[k]
        x, y = self.center_m[k]
        return (
            float(x + ux * u - uy * offset_m),
            float(y + uy * u + ux * offset_m),
            float(np.arctan2(uy, ux)),
        )


def route_from_lanes(network: RoadNetwork, lanes: Sequence[int], vru_margin_m: float = 0.0) -> Route:
    """Join lanes, each a successor of the one before, into a route.

    Raises:
        RouteError: no lanes, or two neighbours in the list do not follow each other.
    """
    if not lanes:
        raise RouteError("route: no lanes given")
    for a, b in pairwise(lanes):
        if b not in network.successors(a):
            raise RouteError(
                f"route: lane {tuple(network.lanes.key[b])} does not follow "
                f"lane {tuple(network.lanes.key[a])}"
            )
    strips = tuple(lane_strip(network, lane, vru_margin_m) for lane in lanes)
    entry = np.concatenate(([0.0], np.cumsum([s.length_m for s in strips])))[:-1]
    center = np.concatenate([s.center_m for s in strips])
    station = np.concatenate([s.station_m + e for s, e in zip(strips, entry, strict=True)])
    keep = np.concatenate(([True], np.diff(station) > 1e-6))
    return Route(strips, entry, center[keep], station[keep])


def route_ahead(
    network: RoadNetwork,
    lane: int,
    s_m: float,
    ahead_m: float,
    behind_m: float = 0.0,
    vru_margin_m: float = 0.0,
) -> Route:
    """Route straight on: at every fork the successor that turns least, until `ahead_m` are covered.

    Args:
        network: the map.
        lane: index of the lane to start on.
        s_m: road coordinate on that lane.
        ahead_m: wanted length in front of that point; the route ends earlier where the map does.
        behind_m: wanted length behind it, along the straightest predecessors.
        vru_margin_m: VRU margin kept with the strips.
    """
    strip = lane_strip(network, lane, vru_margin_m)
    here = strip.station_at(s_m)
    lanes = [lane]
    _extend(network, lanes, strip.length_m - here, ahead_m, forward=True)
    _extend(network, lanes, here, behind_m, forward=False)
    return route_from_lanes(network, lanes, vru_margin_m)


def route_along(
    network: RoadNetwork,
    points_m: FloatArray,
    ahead_m: float = 0.0,
    behind_m: float = 0.0,
    vru_margin_m: float = 0.0,
) -> Route:
    """Route over the driving lanes that a way runs on.

    Where lanes overlap, as in junctions, the chain of lanes is taken that holds the way longest, and of
    several the one in whose middle it runs. The route ends where the way leaves the lanes or changes into one
    that does not follow.

    Args:
        network: the map.
        points_m: (K, 2) points of the way in driving order, map frame; a few metres apart or less.
        ahead_m: wanted length beyond the last point, straight on.
        behind_m: wanted length before the first point.
        vru_margin_m: VRU margin kept with the strips.

    Raises:
        RouteError: the way runs on no driving lane.
    """
    hits = network.locate(points_m)
    delta = np.gradient(points_m, axis=0)
    course = np.arctan2(delta[:, 1], delta[:, 0])
    on: list[dict[int, float]] = [{} for _ in range(len(points_m))]  # lanes, and how far inside each
    for lane in np.unique(hits.lane).tolist():
        if network.lanes.lane_type[lane] != "driving":
            continue
        mine = hits.lane == lane
        heading = network.center_line(lane, hits.s_m[mine])[3]
        along = np.cos(heading - course[hits.point[mine]]) > _SAME_WAY
        inside = zip(hits.point[mine][along].tolist(), hits.margin_m[mine][along].tolist(), strict=True)
        for k, margin in inside:
            on[k][lane] = margin

    @cache
    def longest(lane: int, k: int) -> tuple[int, float, tuple[int, ...]]:
        """Where the best chain ends that enters a lane at the k-th point, how far inside, and the chain."""
        end, inside = k, 0.0
        while end < len(on) and lane in on[end]:
            inside += on[end][lane]
            end += 1
        follow = _chains(network, lane, on[end].keys()) if end < len(on) else []
        options = [(longest(chain[-1], end), chain[:-1]) for chain in follow]
        best = max(((*o[:2], (*short, *o[2])) for o, short in options), default=(end, 0.0, ()))
        return best[0], inside + best[1], (lane, *best[2])

    first = next((k for k, lanes in enumerate(on) if lanes), None)
    if first is None:
        raise RouteError("route: the ego's way runs on no driving lane of the map")
    k, _, best = max(longest(lane, first) for lane in on[first])
    chain = list(best)
    strip = lane_strip(network, chain[-1], 0.0)
    end = float(np.clip(_station_near(strip, points_m[min(k, len(on)) - 1]), 0.0, strip.length_m))
    start = lane_strip(network, chain[0], 0.0)
    begin = float(np.clip(_station_near(start, points_m[first]), 0.0, start.length_m))
    _extend(network, chain, strip.length_m - end, ahead_m, forward=True)
    _extend(network, chain, begin, behind_m, forward=False)
    return route_from_lanes(network, chain, vru_margin_m)


_SAME_WAY = 0.5
"""Cosine of 60 degrees: a way that crosses a lane at more than that does not run along it."""
_MAX_SHORT_LANES, _SHORT_M = 3, 5.0
"""So many lanes in a row, each shorter than that, may lie between two points of a way."""


def _chains(network: RoadNetwork, lane: int, wanted: Collection[int]) -> list[list[int]]:
    """The shortest chain of successors that leads from a lane to each wanted one, over short lanes alone."""
    found: dict[int, list[int]] = {}
    front = [[lane]]
    for _ in range(_MAX_SHORT_LANES + 1):
        front = [[*chain, c] for chain in front for c in network.successors(chain[-1]) if c not in chain]
        for chain in front:
            if chain[-1] in wanted:
                found.setdefault(chain[-1], chain[1:])
        front = [chain for chain in front if _length(network, chain[-1]) < _SHORT_M]
    return list(found.values())


def _station_near(strip: LaneStrip, point_m: FloatArray) -> float:
    """Station of the sample of a strip that is nearest to a point."""
    return float(strip.station_m[np.argmin(np.hypot(*(strip.center_m - point_m).T))])


def _extend(
    network: RoadNetwork, lanes: list[int], covered_m: float, wanted_m: float, *, forward: bool
) -> None:
    """Add the straightest lanes at one end until a length is covered or the map ends."""
    while covered_m < wanted_m:
        following = _straightest(network, lanes[-1 if forward else 0], forward=forward, used=lanes)
        if following is None:
            return
        lanes.insert(len(lanes) if forward else 0, following)
        covered_m += _length(network, following)


def _length(network: RoadNetwork, lane: int) -> float:
    return float(network.lanes.s_end_m[lane] - network.lanes.s_start_m[lane])


def _entry_and_exit_heading(network: RoadNetwork, lane: int) -> tuple[float, float]:
    s = np.array([network.lanes.s_start_m[lane], network.lanes.s_end_m[lane]])
    if network.lanes.direction[lane] < 0:
        s = s[::-1]
    heading = network.center_line(lane, s)[3]
    return float(heading[0]), float(heading[1])


def _straightest(network: RoadNetwork, lane: int, *, forward: bool, used: Sequence[int]) -> int | None:
    choices = network.successors(lane) if forward else network.predecessors(lane)
    choices = tuple(c for c in choices if c not in used)
    if not choices:
        return None
    own = _entry_and_exit_heading(network, lane)

    def turn(choice: int) -> float:
        entry, leave = _entry_and_exit_heading(network, choice)
        change = leave - own[1] if forward else own[0] - entry
        return abs(float(np.arctan2(np.sin(change), np.cos(change))))

    return min(choices, key=turn)
