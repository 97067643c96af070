"""Legs of routes, and their lane changes: where these take place, and the way through them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from opendrive import RoadNetwork
from opendrive.errors import OpenDriveError
from opendrive.lanes.graph import Side
from scenarios.openscenario.elements import Immutable
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.model import RouteStrategy
from scenarios.openscenario.motion.strategies import chain
from smartmot.types import FloatArray

LATERAL_MPS2 = 1.0
"""Greatest acceleration across of a lane change: UN R79, 5.6.4 (ACSF C)."""

SHORTEST = 1.5
"""A change by a cubic takes this many times its width at least: it heads up to 45 degrees off the lane."""


@dataclass(frozen=True, slots=True)
class Leg(Immutable):
    """A stretch of a lane in the direction of travel (`s_end_m` < `s_start_m`: against s)."""

    lane: int
    s_start_m: float
    s_end_m: float

    @property
    def along_s(self) -> int:
        """+1 where s grows along the leg, -1 where it falls."""
        return 1 if self.s_end_m >= self.s_start_m else -1

    @property
    def length_m(self) -> float:
        """Length along the road."""
        return abs(self.s_end_m - self.s_start_m)


def length_of_change_m(left_m: float, speed_mps: float) -> float:
    """Way of a lane change that follows a cubic; infinite for who stands: as long as there is room.

    The acceleration across of left * p^2 (3 - 2p) is greatest at its ends, 6 left / duration^2.

    Args:
        left_m: how far to the side it leads.
        speed_mps: along the lane.
    """
    if speed_mps == 0.0:
        return math.inf
    duration_s = math.sqrt(6.0 * abs(left_m) / LATERAL_MPS2)
    return max(abs(speed_mps) * duration_s, SHORTEST * abs(left_m))


@dataclass(frozen=True, slots=True)
class RouteChange:
    """A change from a lane to its neighbour.

    Args:
        at_m: way along the route at its middle.
        half_m: way from its beginning to its middle, and from there to its end.
        left_m: how far the new lane is to the left.
    """

    at_m: float
    half_m: float
    left_m: float

    def shift(self, way_m: FloatArray, after: FloatArray) -> tuple[FloatArray, FloatArray]:
        """How far ways along the route are to the left of the lane below them, and the slope of that.

        Args:
            way_m: (K,) ways along the route.
            after: (K,) whether the new lane is the one below them.
        """
        part = np.clip((way_m - self.at_m) / (2.0 * self.half_m) + 0.5, 0.0, 1.0)
        inside = (part > 0.0) & (part < 1.0)
        done = part**2 * (3.0 - 2.0 * part)
        slope = np.where(inside, self.left_m * 3.0 * part * (1.0 - part) / self.half_m, 0.0)
        return self.left_m * (done - np.where(after, 1.0, 0.0)), slope


def with_room(changes: Sequence[RouteChange], length_m: float) -> list[RouteChange]:
    """Changes that neither reach into one another nor beyond the ends of a route.

    Args:
        changes: in the order of the route, each as long as it should be.
        length_m: of the route.
    """
    if not changes:
        return []
    middles = [change.at_m for change in changes]
    bounds = [0.0, *(0.5 * (a + b) for a, b in pairwise(middles)), length_m]
    return [
        RouteChange(c.at_m, min(c.half_m, c.at_m - low, high - c.at_m), c.left_m)
        for c, (low, high) in zip(changes, pairwise(bounds), strict=True)
    ]


def _direction(network: RoadNetwork, lane: int) -> int:
    """+1 if traffic in the lane runs along s, -1 if against."""
    return int(network.lanes.direction[lane])


def _middle_m(network: RoadNetwork, lane: int, s_m: float) -> float:
    """T of the middle of a lane."""
    inner, outer = network.lane_offsets(lane, s_m)
    return 0.5 * float(inner + outer)


def is_change(network: RoadNetwork, leg: Leg, following: Leg) -> bool:
    """Whether the second of two legs begins beside the end of the first."""
    section = network.lanes.section
    return (
        leg.lane != following.lane
        and bool(section[leg.lane] == section[following.lane])
        and abs(leg.s_end_m - following.s_start_m) < 1e-6
    )


def changes_from(network: RoadNetwork, legs: Sequence[Leg], first: int) -> int:
    """Number of the leg in which the lane changes end that begin at the end of a leg; itself without any."""
    last = first
    while last + 1 < len(legs) and is_change(network, legs[last], legs[last + 1]):
        last += 1
    return last


def legs_between(
    network: RoadNetwork, start: tuple[int, float], end: tuple[int, float], strategy: RouteStrategy
) -> list[Leg]:
    """Legs between two places (lane, s), as a strategy chooses them; with lane changes only where it must be.

    With lane changes the shortest way is taken.

    Raises:
        RunError: no way leads there, or the strategy asks for other roads than the shortest way with changes.
    """
    try:
        lanes = chain(network, start, end, strategy)
    except RunError:
        legs = legs_with_changes(network, start, end)
        if strategy != "shortest":
            roads = {network.lanes.key[leg.lane].road_id for leg in legs}
            asked = {network.lanes.key[lane].road_id for lane in chain(network, start, end, strategy, True)}
            if roads != asked:
                raise RunError(
                    f"route: routeStrategy '{strategy}' asks for another way than 'shortest', with lane "
                    "changes, which is not carried out; give a waypoint on the way that is meant"
                ) from None
        return legs
    legs = []
    for number, lane in enumerate(lanes):
        along = _direction(network, lane)
        low, high = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
        enter, leave = (low, high) if along > 0 else (high, low)
        enter = start[1] if number == 0 else enter
        leave = end[1] if number == len(lanes) - 1 else leave
        legs.append(Leg(lane, enter, leave if abs(leave - enter) > 1e-9 else enter + along * 1e-9))
    return legs


def legs_with_changes(network: RoadNetwork, start: tuple[int, float], end: tuple[int, float]) -> list[Leg]:
    """Legs between two places (lane, s) of which none leads to the other without lane changes.

    A lane change for which what is left of a lane section is too short takes place on a road behind it,
    if it can.

    Raises:
        RunError: with them neither.
    """
    legs = _shortest(network, start, end)
    k = 0
    while k < len(legs):
        last = changes_from(network, legs, k)
        if _is_tight(network, legs[k : last + 1]):
            later = _changing_later(network, legs[k], end)
            return legs if later is None else legs[:k] + later
        k = last + 1
    return legs


def _is_tight(network: RoadNetwork, legs: Sequence[Leg]) -> bool:
    """Whether lane changes from the first to the last of legs side by side would be too steep."""
    begun, end = legs[0].s_end_m, legs[-1].s_end_m
    middles = [_middle_m(network, leg.lane, begun) for leg in legs]
    widest = max((abs(b - a) for a, b in pairwise(middles)), default=0.0)
    return abs(end - begun) < SHORTEST * widest * (len(legs) - 1)


def _changing_later(network: RoadNetwork, leg: Leg, end: tuple[int, float]) -> list[Leg] | None:
    """A leg to the end of its lane, and the shortest way from there; None: there is none."""
    lanes = network.lanes

    def bounds(lane: int) -> tuple[float, float]:
        low, high = float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])
        return (low, high) if _direction(network, lane) > 0 else (high, low)

    ways: list[list[Leg]] = []
    for following in network.successors(leg.lane):
        try:
            ways.append(legs_with_changes(network, (following, bounds(following)[0]), end))
        except RunError:
            continue
    if not ways:
        return None
    along = Leg(leg.lane, leg.s_start_m, bounds(leg.lane)[1])
    return [along, *min(ways, key=lambda way: sum(own.length_m for own in way))]


def _shortest(network: RoadNetwork, start: tuple[int, float], end: tuple[int, float]) -> list[Leg]:
    """The shortest way with lane changes, each where it is first allowed.

    Raises:
        RunError: there is none.
    """
    try:
        route = network.route(*start, *end)
    except OpenDriveError as error:
        raise RunError(f"route: {error}") from None
    columns = (
        route.lane.tolist(),
        route.s_from_m.tolist(),
        route.s_to_m.tolist(),
        route.is_change.tolist(),
    )
    legs: list[Leg] = []
    for lane, enter, leave, changes in zip(*columns, strict=True):
        along = _direction(network, lane)
        if changes:
            before = legs.pop()
            enter = _first_crossing_m(network, before, lane, leave)
            legs.append(Leg(before.lane, before.s_start_m, enter + along * 1e-9))
        legs.append(Leg(lane, enter, leave if abs(leave - enter) > 1e-9 else enter + along * 1e-9))
    return legs


def _first_crossing_m(network: RoadNetwork, leg: Leg, other: int, leave_m: float) -> float:
    """Road s from which on a leg may be left for the lane beside it."""
    along = _direction(network, leg.lane)
    key, beside = network.lanes.key[leg.lane], network.lanes.key[other]
    side: Side = "left" if (beside.lane_id - key.lane_id) * along > 0 else "right"
    ranges = network.lane_change_ranges(leg.lane, side).tolist()
    starts = [(low, high) if along > 0 else (high, low) for low, high in ranges]
    reached = [
        max(leg.s_start_m, low) if along > 0 else min(leg.s_start_m, low)
        for low, high in starts
        if (high - leg.s_start_m) * along > 0.0 and (leave_m - low) * along > 0.0
    ]
    return (min if along > 0 else max)(reached, default=leg.s_end_m)


def settled(
    network: RoadNetwork, legs: Sequence[Leg], speed_mps: float
) -> tuple[list[Leg], list[RouteChange]]:
    """Legs that change lanes where it suits a speed, and these changes by the way along the legs.

    Changes of a lane section follow one another from where they are allowed, or share what is left of it.

    Raises:
        RunError: what is left is too short.
    """
    placed, k = list(legs), 0
    jumps: dict[int, float] = {}
    start_m = 0.0
    while k < len(placed):
        last = changes_from(network, placed, k)
        begun, end = placed[k].s_end_m, placed[last].s_end_m
        along = _direction(network, placed[k].lane)
        for n in range(k, last):
            own_m, other_m = (_middle_m(network, leg.lane, begun) for leg in placed[n : n + 2])
            left_m = along * (other_m - own_m)
            room_m = abs(end - begun) / (last - n)
            if room_m < SHORTEST * abs(left_m) - 1e-6:
                road_id = network.lanes.key[placed[n].lane].road_id
                raise RunError(
                    f"route: {room_m:.3g} m of road '{road_id}' are left for "
                    f"a lane change of {abs(left_m):.3g} m; it takes {SHORTEST * abs(left_m):.3g} m at least"
                )
            length_m = length_of_change_m(left_m, speed_mps)
            jumps[n + 1] = left_m
            switch = begun + along * 0.5 * min(length_m, room_m)
            placed[n] = Leg(placed[n].lane, placed[n].s_start_m if n == k else start_m, switch)
            start_m, begun = switch, begun + along * min(length_m, room_m)
        if last > k:
            placed[last] = Leg(placed[last].lane, start_m, end)
        k = last + 1
    ends = np.cumsum([leg.length_m for leg in placed])
    changes = [
        RouteChange(float(ends[n - 1]), 0.5 * length_of_change_m(left_m, speed_mps), left_m)
        for n, left_m in jumps.items()
    ]
    return placed, with_room(changes, float(ends[-1]))
