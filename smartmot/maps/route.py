"""The lanes that the ego means to drive, as one path with stations."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import pairwise
from typing import ClassVar

import numpy as np

from smartmot.errors import ShapeError, SmartMotError
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.strips import LaneStrip, lane_strip
from smartmot.path import PlannedPath
from smartmot.types import FloatArray, frozen


class RouteError(SmartMotError):
    """A route cannot be built or a point is not on it."""


@dataclass(frozen=True, slots=True, eq=False, init=False)
class Route(PlannedPath):
    """Lanes in driving order, each a successor of the one before or, after a lane change, its neighbour.

    Args:
        strips: the stretch of each lane that belongs to the route. Over a lane change both lanes do.
        entry_m: (K,) station of the beginning of each strip along the route.
        center_m: (P, 2) the path, map frame: the joined centre lines, over a lane change the way from one to
            the other.
        station_m: (P,) distance along it, ascending from point to point.

    Raises:
        ShapeError: shapes disagree, a value is not finite, or the stations do not ascend.
    """

    _noun: ClassVar[str] = "route"

    strips: tuple[LaneStrip, ...]
    entry_m: FloatArray

    def __init__(
        self,
        strips: tuple[LaneStrip, ...],
        entry_m: FloatArray,
        center_m: FloatArray,
        station_m: FloatArray,
    ) -> None:
        object.__setattr__(self, "strips", strips)
        entry = frozen(entry_m, np.float64, (len(strips),), "entry_m")
        if not np.isfinite(entry).all():
            raise ShapeError("route: every point and station must be finite")
        object.__setattr__(self, "entry_m", entry)
        PlannedPath.__init__(self, center_m, station_m)

    @property
    def lanes(self) -> tuple[int, ...]:
        """Indices of the lanes in driving order."""
        return tuple(strip.lane for strip in self.strips)


def route_from_lanes(network: LaneMap, lanes: Sequence[int], vru_margin_m: float = 0.0) -> Route:
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
    return _route(strips, entry, center, station)


def _route(
    strips: tuple[LaneStrip, ...], entry_m: FloatArray, center_m: FloatArray, station_m: FloatArray
) -> Route:
    """A route without the points that lie twice where its parts meet."""
    keep = np.concatenate(([True], np.diff(station_m) > 1e-6))
    return Route(strips, entry_m, center_m[keep], station_m[keep])


def route_ahead(
    network: LaneMap,
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
    network: LaneMap,
    points_m: FloatArray,
    ahead_m: float = 0.0,
    behind_m: float = 0.0,
    vru_margin_m: float = 0.0,
) -> Route:
    """Route over the driving lanes that a way runs on, lane changes included.

    Where lanes overlap, as in junctions, the chain of lanes is taken that holds the way longest, of several
    the one with the fewest lane changes, then the one in whose middle it runs. Over a lane change both lanes
    belong to the route, and its path runs as the way does. The route ends where the way leaves the lanes.

    Args:
        network: the map.
        points_m: (K, 2) points of the way in driving order, map frame; a few metres apart or less.
        ahead_m: wanted length beyond the last point, straight on.
        behind_m: wanted length before the first point.
        vru_margin_m: VRU margin kept with the strips.

    Raises:
        RouteError: the way runs on no driving lane.
    """
    on = _lanes_under(network, points_m)

    @cache
    def longest(lane: int, k: int) -> tuple[int, int, float, tuple[tuple[int, int], ...]]:
        """The best chain that enters a lane at the k-th point.

        Returns:
            Where it ends, the number of lane changes (negative), how far inside the way is, and the lanes
            with the points at which they are entered.
        """
        end, inside = k, 0.0
        while end < len(on) and lane in on[end]:
            inside += on[end][lane]
            end += 1
        best: tuple[int, int, float, tuple[tuple[int, int], ...]] = (end, 0, 0.0, ())
        if end < len(on):
            wanted = on[end].keys()
            follow = _chains(network, lane, wanted)
            change = [] if follow else _changes(network, lane, wanted)
            for chain in follow + change:
                far, kept, more, rest = longest(chain[-1], end)
                short = tuple((passed, end) for passed in chain[:-1])
                best = max(best, (far, kept - (chain in change), more, (*short, *rest)))
        return best[0], best[1], inside + best[2], ((lane, k), *best[3])

    first = next((k for k, lanes in enumerate(on) if lanes), None)
    if first is None:
        raise RouteError(
            "route: the ego's way runs on no driving lane of the map; give --map a map that has one there"
        )
    end, _, _, entered = max(longest(lane, first) for lane in on[first])
    legs = [[entered[0][0]]]  # lanes that follow one another; between them the way changes lanes
    turns = list[int]()  # the points at which the legs after the first are entered
    for (lane, _), (following, k) in pairwise(entered):
        if following in network.successors(lane):
            legs[-1].append(following)
        else:
            legs.append([following])
            turns.append(k)
    way = points_m[first:end]
    strip = lane_strip(network, legs[-1][-1], 0.0)
    _extend(network, legs[-1], strip.length_m - _station_near(strip, way[-1]), ahead_m, forward=True)
    begin = lane_strip(network, legs[0][0], 0.0)
    _extend(network, legs[0], _station_near(begin, way[0]), behind_m, forward=False)
    if not turns:
        return route_from_lanes(network, legs[0], vru_margin_m)
    for before, after in pairwise(legs):  # both lanes belong to the route while it changes between them
        _extend(network, before, 0.0, _CHANGE_M, forward=True)
        _extend(network, after, 0.0, _CHANGE_M, forward=False)
    lines = [route_from_lanes(network, leg, vru_margin_m) for leg in legs]
    return _with_changes(lines, [k - first for k in turns], way)


def _lanes_under(network: LaneMap, points_m: FloatArray) -> list[dict[int, float]]:
    """For each point of a way the driving lanes under it that run its way, and how far inside each it is."""
    hits = network.locate(points_m)
    delta = np.gradient(points_m, axis=0)
    course = np.arctan2(delta[:, 1], delta[:, 0])
    on: list[dict[int, float]] = [{} for _ in range(len(points_m))]
    for lane in np.unique(hits.lane).tolist():
        if network.lanes.lane_type[lane] != "driving":
            continue
        mine = hits.lane == lane
        heading = network.center_line(lane, hits.s_m[mine])[3]
        along = np.cos(heading - course[hits.point[mine]]) > _SAME_WAY
        inside = zip(hits.point[mine][along].tolist(), hits.margin_m[mine][along].tolist(), strict=True)
        for k, margin in inside:
            on[k][lane] = margin
    return on


def _with_changes(lines: Sequence[Route], turns: Sequence[int], way_m: FloatArray) -> Route:
    """Routes without lane changes joined by the lane changes of a way.

    A change begins where the way was last in the middle of its lane, or nearest to it, and ends where it
    first is in that of the next. Between, the path is the way, moved so that both ends meet the middle.

    Args:
        lines: along the lanes before, between and after the changes.
        turns: where the way enters the lanes of the next.
        way_m: (K, 2) points of the way.
    """
    first, shift_m = 0, 0.0  # where the last change ended; route station less station on the present line
    low_m, from_m = 0.0, 0.0  # stations on the present line from which lanes and path belong to the route
    strips, entry = list[LaneStrip](), list[float]()
    center, station = list[FloatArray](), list[FloatArray]()
    for number, line in enumerate(lines):
        if number == len(turns):
            high_m = to_m = line.length_m
        else:
            k, following = turns[number], lines[number + 1]
            limit = turns[number + 1] if number + 1 < len(turns) else len(way_m)
            begin = k - _steps_to_middle(line, way_m[first : k + 1][::-1])
            end = k + _steps_to_middle(following, way_m[k:limit])
            to_m, high_m = line.project(*way_m[begin])[0], line.project(*way_m[end])[0]
        inner = (line.station_m > from_m) & (line.station_m < to_m)
        ends = [line.pose(s)[:2] for s in (from_m, to_m)]
        center.append(np.concatenate((ends[:1], line.center_m[inner], ends[1:])))
        station.append(np.concatenate(([from_m], line.station_m[inner], [to_m])) + shift_m)
        for strip, start in zip(line.strips, line.entry_m.tolist(), strict=True):
            part_from, part_to = max(low_m - start, 0.0), min(high_m - start, strip.length_m)
            if part_to - part_from > _LEAST_M:
                strips.append(strip.part(part_from, part_to))
                entry.append(start + part_from + shift_m)
        if number < len(turns):
            low_m, from_m = (following.project(*way_m[at])[0] for at in (begin, end))
            path = way_m[begin : end + 1]
            driven = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T))))
            share = (driven / driven[-1])[:, None]
            path = path + (1 - share) * (ends[1] - path[0]) + share * (following.pose(from_m)[:2] - path[-1])
            along = np.concatenate(([0.0], np.cumsum(np.hypot(*np.diff(path, axis=0).T)))) + to_m + shift_m
            center.append(path)
            station.append(along)
            first, shift_m = end, float(along[-1]) - from_m
    return _route(tuple(strips), np.array(entry), np.concatenate(center), np.concatenate(station))


def _steps_to_middle(line: Route, way_m: FloatArray) -> int:
    """After how many points a way comes as near to the middle of a route as it ever does; at least one."""
    aside = np.abs([line.project(x, y)[1] for x, y in way_m.tolist()])
    return max(int(np.argmax(aside <= aside.min() + _MIDDLE_M)), 1 if len(way_m) > 1 else 0)


_SAME_WAY = 0.5
"""Cosine of 60 degrees: a way that crosses a lane at more than that does not run along it."""
_MAX_SHORT_LANES, _SHORT_M = 3, 5.0
"""So many lanes in a row, each shorter than that, may lie between two points of a way."""
_CHANGE_M = 100.0
"""No lane change is longer; at 50 km/h one takes 40 to 80 m."""
_MIDDLE_M = 0.05
"""A way is in the middle of its lane where it comes as near to it as that to its nearest."""
_LEAST_M = 1e-3
"""Shorter stretches of a lane are no part of a route."""


def _chains(network: LaneMap, lane: int, wanted: Collection[int]) -> list[list[int]]:
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


def _changes(network: LaneMap, lane: int, wanted: Collection[int]) -> list[list[int]]:
    """Chains that lead from a lane to a wanted one beside it, or beside a successor."""
    chains = [[side] for side in _beside(network, lane)]
    chains += [[passed, side] for passed in network.successors(lane) for side in _beside(network, passed)]
    return [chain for chain in chains if chain[-1] in wanted]


def _beside(network: LaneMap, lane: int) -> list[int]:
    """Driving lanes beside a lane that run its way."""
    lanes = network.lanes
    sides = (network.left_neighbour(lane), network.right_neighbour(lane))
    return [
        side
        for side in sides
        if side is not None
        and lanes.lane_type[side] == "driving"
        and lanes.direction[side] == lanes.direction[lane]
    ]


def _station_near(strip: LaneStrip, point_m: FloatArray) -> float:
    """Station of the sample of a strip that is nearest to a point."""
    return float(strip.station_m[np.argmin(np.hypot(*(strip.center_m - point_m).T))])


def _extend(network: LaneMap, lanes: list[int], covered_m: float, wanted_m: float, *, forward: bool) -> None:
    """Add the straightest lanes at one end until a length is covered or the map ends."""
    while covered_m < wanted_m:
        following = _straightest(network, lanes[-1 if forward else 0], forward=forward, used=lanes)
        if following is None:
            return
        lanes.insert(len(lanes) if forward else 0, following)
        covered_m += _length(network, following)


def _length(network: LaneMap, lane: int) -> float:
    return float(network.lanes.s_end_m[lane] - network.lanes.s_start_m[lane])


def _entry_and_exit_heading(network: LaneMap, lane: int) -> tuple[float, float]:
    s = np.array([network.lanes.s_start_m[lane], network.lanes.s_end_m[lane]])
    if network.lanes.direction[lane] < 0:
        s = s[::-1]
    heading = network.center_line(lane, s)[3]
    return float(heading[0]), float(heading[1])


def _straightest(network: LaneMap, lane: int, *, forward: bool, used: Sequence[int]) -> int | None:
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
