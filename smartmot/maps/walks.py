"""Walks on a lane map: to the sides of a lane, along lanes, and from points to the lanes under them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from smartmot.maps.lane_map import LaneMap, PlacedPoints, Side
from smartmot.types import FloatArray, IntArray

KERBSIDE_TYPES = frozenset(
    {"parking", "shoulder", "border", "curb", "stop", "biking", "none", "restricted", "median"}
)
"""Lane types a pedestrian crosses between the sidewalk and the driving lane."""
SIDEWALK_TYPES = frozenset({"sidewalk", "walking"})

SAME_WAY = 0.5
"""Cosine of 60 degrees: what crosses a lane at more than that does not run along it."""


# --- to the side --------------------------------------------------------------------------------------


def outward(lane_map: LaneMap, lane: int, side: Side) -> Iterator[int]:
    """The lanes beside a lane, one after the other, to a side as seen in the lane's travel direction."""
    direction, current = lane_map.lanes.direction, lane
    while True:
        # a neighbour's left is the other side where traffic runs the other way
        same_way = int(direction[current]) == int(direction[lane])
        neighbour = lane_map.left_neighbour if (side == "left") == same_way else lane_map.right_neighbour
        following = neighbour(current)
        if following is None:
            return
        yield following
        current = following


def side_lane(lane_map: LaneMap, lane: int, side: Side) -> int | None:
    """The driving lane directly beside a lane that runs the same way, or None."""
    lanes, beside = lane_map.lanes, next(outward(lane_map, lane, side), None)
    if beside is None or lanes.lane_type[beside] != "driving":
        return None
    return beside if lanes.direction[beside] == lanes.direction[lane] else None


def kerb(
    lane_map: LaneMap,
    lane: int,
    s_m: FloatArray,
    side: Side,
    from_m: FloatArray | float = 0.0,
    *,
    over_lanes: bool = False,
) -> tuple[FloatArray, bool]:
    """How far it is across kerbside strips to the kerb, and whether a sidewalk begins there.

    Args:
        lane_map: the map.
        lane: where to begin.
        s_m: (P,) s on it.
        side: in the lane's travel direction.
        from_m: distance already covered, to which that of the strips is added; one, or (P,).
        over_lanes: go on over further driving lanes; else the walk ends at the first.

    Returns:
        (P,) distances, and whether a sidewalk follows.
    """
    distance = np.broadcast_to(np.asarray(from_m, dtype=np.float64), s_m.shape)
    for beside in outward(lane_map, lane, side):
        kind = str(lane_map.lanes.lane_type[beside])
        if kind in SIDEWALK_TYPES:
            return distance, True
        if kind not in KERBSIDE_TYPES and not (over_lanes and kind == "driving"):
            break
        distance = distance + lane_map.lane_width(beside, s_m)
    return distance, False


# --- along --------------------------------------------------------------------------------------------


def lane_length_m(lane_map: LaneMap, lane: int) -> float:
    """Length of a lane along its road."""
    return float(lane_map.lanes.s_end_m[lane] - lane_map.lanes.s_start_m[lane])


def lane_ends(lane_map: LaneMap, lane: int) -> tuple[float, float]:
    """S where traffic enters a lane, and where it leaves it."""
    ends = float(lane_map.lanes.s_start_m[lane]), float(lane_map.lanes.s_end_m[lane])
    return ends if lane_map.lanes.direction[lane] > 0 else ends[::-1]


def straightest(lane_map: LaneMap, lane: int, *, forward: bool, without: Sequence[int] = ()) -> int | None:
    """The successor of a lane, or the predecessor, over which the course turns least from end to end.

    Args:
        lane_map: the map.
        lane: the lane.
        forward: whether to go on, or back.
        without: lanes that it must not be.
    """
    choices = lane_map.successors(lane) if forward else lane_map.predecessors(lane)
    choices = tuple(choice for choice in choices if choice not in without)
    if not choices:
        return None
    enters, leaves = _end_headings(lane_map, lane)

    def turn(choice: int) -> float:
        # to the far end of the next lane: at a fork all of them begin straight on
        far = _end_headings(lane_map, choice)[1 if forward else 0]
        change = far - leaves if forward else enters - far
        return abs(float(np.arctan2(np.sin(change), np.cos(change))))

    return min(choices, key=turn)


def _end_headings(lane_map: LaneMap, lane: int) -> tuple[float, float]:
    """Headings of a lane's middle where traffic enters it, and where it leaves it."""
    enters, leaves = lane_map.center_line(lane, np.array(lane_ends(lane_map, lane)))[3].tolist()
    return enters, leaves


def extend(lane_map: LaneMap, lanes: list[int], covered_m: float, wanted_m: float, *, forward: bool) -> None:
    """Add the straightest lanes at one end until a length is covered or the map ends."""
    while covered_m < wanted_m:
        following = straightest(lane_map, lanes[-1 if forward else 0], forward=forward, without=lanes)
        if following is None:
            return
        lanes.insert(len(lanes) if forward else 0, following)
        covered_m += lane_length_m(lane_map, following)


# --- under points -------------------------------------------------------------------------------------


def located(lane_map: LaneMap, points_m: FloatArray, z_m: FloatArray | None) -> PlacedPoints:
    """Every lane under points; heights, where they are known, are told to the map."""
    return lane_map.locate(points_m) if z_m is None else lane_map.locate(points_m, z_m)


def lane_headings(lane_map: LaneMap, lane: IntArray, s_m: FloatArray) -> FloatArray:
    """(K,) headings in travel direction of the middles of K lanes at an s of each."""
    heading = np.empty(len(lane))
    for index in np.unique(lane).tolist():
        on_it = lane == index
        heading[on_it] = lane_map.center_line(index, s_m[on_it])[3]
    return heading


class LanesUnder(NamedTuple):
    """K pairs of a point and a driving lane under it that runs its way, by point and then lane.

    Attributes:
        point: (K,) index of the point.
        lane: (K,) index of the lane.
        s_m: (K,) s of the point.
        margin_m: (K,) distance from the nearer border of the lane.
    """

    point: IntArray
    lane: IntArray
    s_m: FloatArray
    margin_m: FloatArray


def lanes_under(
    lane_map: LaneMap, points_m: FloatArray, yaw_rad: FloatArray, z_m: FloatArray | None = None
) -> LanesUnder:
    """The driving lanes under poses that run their way.

    Args:
        lane_map: the map.
        points_m: (N, 2) points, map frame.
        yaw_rad: (N,) headings.
        z_m: (N,) heights, which choose the level where roads lie above one another.
    """
    hits = located(lane_map, points_m, z_m)
    driving = np.flatnonzero(lane_map.lanes.lane_type[hits.lane] == "driving")
    point, lane, s_m = hits.point[driving], hits.lane[driving], hits.s_m[driving]
    along = np.cos(lane_headings(lane_map, lane, s_m) - yaw_rad[point]) > SAME_WAY
    return LanesUnder(point[along], lane[along], s_m[along], hits.margin_m[driving][along])
