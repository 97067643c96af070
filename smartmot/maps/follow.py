"""The route that a vehicle follows, from its way: known in advance, or recorded pose by pose."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import cache
from itertools import pairwise

import numpy as np

from smartmot.maps.lane_map import LaneMap, NearestLanes
from smartmot.maps.route import Route, RouteError, joined, route_ahead, route_from_lanes
from smartmot.maps.strips import LaneStrip, lane_strip
from smartmot.maps.walks import extend, lane_length_m, lanes_under, side_lane
from smartmot.path import chord_stations
from smartmot.types import BoolArray, FloatArray

_MAX_SHORT_LANES, _SHORT_M = 3, 5.0
"""So many lanes in a row, each shorter than that, may lie between two points of a way."""
_CHANGE_M = 100.0
"""No lane change is longer; at 50 km/h one takes 40 to 80 m."""
_MIDDLE_M = 0.05
"""A way is in the middle of its lane where it comes as near to it as that to its nearest."""
_LEAST_M = 1e-3
"""Shorter stretches of a lane are no part of a route."""
MAX_FROM_LANE_M = 3.0
"""A vehicle farther from every driving lane than a lane's width is off the map."""
_BEHIND_M = 100.0
"""Length of a route from poses behind the vehicle: more than any monitored area looks back."""


def route_along(
    network: LaneMap,
    points_m: FloatArray,
    ahead_m: float = 0.0,
    behind_m: float = 0.0,
    vru_margin_m: float = 0.0,
    z_m: FloatArray | None = None,
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
        z_m: (K,) heights of the points: where roads lie above one another, the way stays on its level.

    Raises:
        RouteError: the way runs on no driving lane.
    """
    margin_of = _lanes_under(network, points_m, z_m)

    @cache
    def longest(lane: int, k: int) -> tuple[int, int, float, tuple[tuple[int, int], ...]]:
        """The best chain that enters a lane at the k-th point.

        Returns:
            Where it ends, the number of lane changes (negative), how far inside the way is, and the lanes
            with the points at which they are entered.
        """
        # what follows depends on lane and point alone, so that each pair of them is searched once
        end, inside = k, 0.0
        while end < len(margin_of) and lane in margin_of[end]:
            inside += margin_of[end][lane]
            end += 1
        best: tuple[int, int, float, tuple[tuple[int, int], ...]] = (end, 0, 0.0, ())
        if end < len(margin_of):
            wanted = margin_of[end].keys()
            follow = _chains(network, lane, wanted)
            change = [] if follow else _changes(network, lane, wanted)
            for chain in follow + change:
                far, changes, further_inside, onward = longest(chain[-1], end)
                short = tuple((passed, end) for passed in chain[:-1])
                best = max(best, (far, changes - (chain in change), further_inside, (*short, *onward)))
        return best[0], best[1], inside + best[2], ((lane, k), *best[3])

    first = next((k for k, lanes in enumerate(margin_of) if lanes), None)
    if first is None:
        raise RouteError(
            "route: the ego's way runs on no driving lane of the map; give --map a map that has one there"
        )
    end, _, _, entered = max(longest(lane, first) for lane in margin_of[first])
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
    extend(network, legs[-1], strip.length_m - _station_near(strip, way[-1]), ahead_m, forward=True)
    begin = lane_strip(network, legs[0][0], 0.0)
    extend(network, legs[0], _station_near(begin, way[0]), behind_m, forward=False)
    if not turns:
        return route_from_lanes(network, legs[0], vru_margin_m)
    for before, after in pairwise(legs):  # both lanes belong to the route while it changes between them
        extend(network, before, 0.0, _CHANGE_M, forward=True)
        extend(network, after, 0.0, _CHANGE_M, forward=False)
    lines = [route_from_lanes(network, leg, vru_margin_m) for leg in legs]
    return _with_changes(lines, [k - first for k in turns], way)


def _lanes_under(lane_map: LaneMap, points_m: FloatArray, z_m: FloatArray | None) -> list[dict[int, float]]:
    """For each point of a way the driving lanes under it that run its way, and how far inside each it is."""
    course = np.gradient(points_m, axis=0)
    under = lanes_under(lane_map, points_m, np.arctan2(course[:, 1], course[:, 0]), z_m)
    margin_of: list[dict[int, float]] = [{} for _ in range(len(points_m))]
    for point, lane, margin in zip(
        under.point.tolist(), under.lane.tolist(), under.margin_m.tolist(), strict=True
    ):
        margin_of[point][lane] = margin
    return margin_of


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
            driven = chord_stations(path)
            # the shift at either end, blended in proportion to the distance driven between them
            share = (driven / driven[-1])[:, None]
            path = path + (1 - share) * (ends[1] - path[0]) + share * (following.pose(from_m)[:2] - path[-1])
            along = chord_stations(path) + to_m + shift_m
            center.append(path)
            station.append(along)
            first, shift_m = end, float(along[-1]) - from_m
    return joined(tuple(strips), np.array(entry), np.concatenate(center), np.concatenate(station))


def _steps_to_middle(line: Route, way_m: FloatArray) -> int:
    """After how many points a way comes as near to the middle of a route as it ever does; at least one."""
    aside = np.abs([line.project(x, y)[1] for x, y in way_m.tolist()])
    return max(int(np.argmax(aside <= aside.min() + _MIDDLE_M)), 1 if len(way_m) > 1 else 0)


def _chains(network: LaneMap, lane: int, wanted: Collection[int]) -> list[list[int]]:
    """The shortest chain of successors that leads from a lane to each wanted one, over short lanes alone."""
    chain_to: dict[int, list[int]] = {}
    front = [[lane]]
    for _ in range(_MAX_SHORT_LANES + 1):
        front = [[*chain, c] for chain in front for c in network.successors(chain[-1]) if c not in chain]
        for chain in front:
            if chain[-1] in wanted:
                chain_to.setdefault(chain[-1], chain[1:])
        front = [chain for chain in front if lane_length_m(network, chain[-1]) < _SHORT_M]
    return list(chain_to.values())


def _changes(network: LaneMap, lane: int, wanted: Collection[int]) -> list[list[int]]:
    """Chains that lead from a lane to a wanted one beside it, or beside a successor."""
    chains = [[side] for side in _beside(network, lane)]
    chains += [[passed, side] for passed in network.successors(lane) for side in _beside(network, passed)]
    return [chain for chain in chains if chain[-1] in wanted]


def _beside(lane_map: LaneMap, lane: int) -> list[int]:
    """Driving lanes beside a lane that run its way."""
    sides = (side_lane(lane_map, lane, "left"), side_lane(lane_map, lane, "right"))
    return [side for side in sides if side is not None]


def _station_near(strip: LaneStrip, point_m: FloatArray) -> float:
    """Station of the sample of a strip that is nearest to a point."""
    return float(strip.station_m[np.argmin(np.hypot(*(strip.center_m - point_m).T))])


class RouteFollower:
    """The route of a vehicle from pose to pose, without looking at those that follow.

    Where the vehicle is going to go is not known: the route is taken to go straight on from its lane, and is
    looked for again where the vehicle leaves it or comes too near to its end. Poses share a route as long as
    it holds.

    Args:
        network: the map.
        vru_margin_m: VRU margin kept with the strips.
    """

    def __init__(self, network: LaneMap, vru_margin_m: float = 0.0) -> None:
        self._network, self._margin_m = network, vru_margin_m
        self._route: Route | None = None

    def at(
        self, x_m: float, y_m: float, least_ahead_m: float, ahead_m: float, z_m: float | None = None
    ) -> Route | None:
        """The route at the next pose.

        Args:
            x_m: place of the vehicle, map frame.
            y_m: place of the vehicle, map frame.
            least_ahead_m: length that the route must have left in front, where the map goes on.
            ahead_m: length of a new one in front.
            z_m: height of the vehicle's ground, where it is known.

        Returns:
            The route; None where the vehicle is more than `MAX_FROM_LANE_M` beside every driving lane.
        """
        nearest = _nearest(self._network, np.array([[x_m, y_m]]), None if z_m is None else np.array([z_m]))
        if not (nearest.found[0] and nearest.distance_m[0] <= MAX_FROM_LANE_M):
            return None
        return self.on_lane(x_m, y_m, int(nearest.lane[0]), float(nearest.s_m[0]), least_ahead_m, ahead_m)

    def on_lane(
        self, x_m: float, y_m: float, lane: int, s_m: float, least_ahead_m: float, ahead_m: float
    ) -> Route:
        """The route at the next pose, whose nearest lane is known; see `at`."""
        network, route = self._network, self._route
        if route is None or lane not in route.lanes or _ends(network, route, x_m, y_m, least_ahead_m):
            route = route_ahead(network, lane, s_m, ahead_m, _BEHIND_M, vru_margin_m=self._margin_m)
            self._route = route
        return route


def routes_from_poses(
    network: LaneMap,
    points_m: FloatArray,
    least_ahead_m: FloatArray,
    ahead_m: FloatArray,
    vru_margin_m: float = 0.0,
    z_m: FloatArray | None = None,
) -> list[Route | None]:
    """The route of a vehicle at each of its recorded poses; see `RouteFollower`.

    Args:
        network: the map.
        points_m: (F, 2) places of the vehicle, map frame.
        least_ahead_m: (F,) length that the route must have left in front, where the map goes on.
        ahead_m: (F,) length of a new one in front.
        vru_margin_m: VRU margin kept with the strips.
        z_m: (F,) heights of the vehicle's ground, where they are known.

    Returns:
        F routes; None where the vehicle is more than `MAX_FROM_LANE_M` beside every driving lane.
    """
    nearest = _nearest(network, points_m, z_m)
    on_map: BoolArray = nearest.found & (nearest.distance_m <= MAX_FROM_LANE_M)
    follower = RouteFollower(network, vru_margin_m)
    rows = zip(
        *(points_m.T.tolist()), nearest.lane.tolist(), nearest.s_m.tolist(), on_map.tolist(), strict=True
    )
    return [
        follower.on_lane(x, y, int(lane), s, float(least_ahead_m[k]), float(ahead_m[k])) if on else None
        for k, (x, y, lane, s, on) in enumerate(rows)
    ]


def _nearest(network: LaneMap, points_m: FloatArray, z_m: FloatArray | None) -> NearestLanes:
    return network.nearest_lane(points_m) if z_m is None else network.nearest_lane(points_m, z_m=z_m)


def _ends(network: LaneMap, route: Route, x_m: float, y_m: float, least_m: float) -> bool:
    """Whether a route has less than a length left in front of a place, and may go on."""
    short = route.length_m - route.project(x_m, y_m)[0] < least_m
    return short and bool(network.successors(route.lanes[-1]))
