"""What a reader makes of an exported map, compared with the network that it was written from.

Nothing here knows how lanelets were cut: they are found again on their lanes by place.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np
import shapely

from opendrive import RoadNetwork

WITHIN_M = 0.01
STEP_M = 0.25
"""Chords of the true borders: within 3 mm of bends of 3 m radius."""
CLOSED_M = 0.5
SHORT_M = 0.01
"""Lanes that are shorter are passed over by the exports, and those that are nowhere wider than 1 mm."""
NARROW_M = 1e-3


@dataclass
class ReadLanelet:
    """A lanelet as a reader gives it: borders (K, 2 or 3) in travel direction, and ids of others."""

    id: int
    left: np.ndarray
    right: np.ndarray
    successors: set[int]
    left_neighbour: int | None = None
    right_neighbour: int | None = None
    left_same: bool | None = None
    right_same: bool | None = None
    speed_mps: float | None = None
    more: dict[str, Any] = field(default_factory=dict)
    lane: int = -1
    s_m: tuple[float, float] = (0.0, 0.0)


def true_borders(network: RoadNetwork, lane: int, s_m: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points (N, 3) of the left and right borders by the road's surface, in travel direction's sense."""
    inner, outer = network.lane_offsets(lane, s_m)
    key = network.lanes.key[lane]
    road = network.roads[key.road_id]
    sides = []
    for t_m in (inner, outer):
        point = road.point(s_m, t_m)
        sides.append(np.stack([point.x_m, point.y_m], axis=1))
    if network.lanes.side[lane] == network.lanes.direction[lane]:
        sides.reverse()
    return sides[0], sides[1]


def along(network: RoadNetwork, lane: int, left: np.ndarray, right: np.ndarray) -> float:
    """The s at which both borders of a lane are nearest to two points."""
    low, high = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
    s_m = np.linspace(low, high, max(int((high - low) / 2.0), 8))
    for _ in range(8):
        sides = true_borders(network, lane, s_m)
        off = np.linalg.norm(sides[0] - left, axis=1) + np.linalg.norm(sides[1] - right, axis=1)
        k = int(np.argmin(off))
        s_m = np.linspace(s_m[max(k - 1, 0)], s_m[min(k + 1, len(s_m) - 1)], 9)
    return float(s_m[4])


def place(network: RoadNetwork, lanelets: Iterable[ReadLanelet], names: dict[int, str]) -> None:
    """Find the s between which each lanelet lies on the lane that the file names."""
    for item in lanelets:
        road_id, section, lane_id = names[item.id].rsplit("/", 2)
        lane = item.lane = network.lane_index_of((road_id, int(section), int(lane_id)))
        start, end = (along(network, lane, item.left[k, :2], item.right[k, :2]) for k in (0, -1))
        way = int(network.lanes.direction[lane])
        first, last = (float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane]))[::way]
        if (end - start) * way <= 0.0:
            # A road that ends where it begins has two places there.
            start = first if abs(start - last) < CLOSED_M else start
            end = last if abs(end - first) < CLOSED_M else end
        item.s_m = (min(start, end), max(start, end))


def distance_m(
    network: RoadNetwork, lane: int, side: int, point: np.ndarray, low: float, high: float
) -> float:
    """Distance of a point from a border of a lane between two s."""
    s_m = np.linspace(low, high, 2000)
    for _ in range(6):
        off = np.linalg.norm(true_borders(network, lane, s_m)[side] - point, axis=1)
        k = int(np.argmin(off))
        s_m = np.linspace(s_m[max(k - 1, 0)], s_m[min(k + 1, len(s_m) - 1)], 9)
    return float(off.min())


def assert_geometry(
    network: RoadNetwork, lanelets: Sequence[ReadLanelet], within_m: float = WITHIN_M
) -> None:
    """Every border is within 1 cm of its lane's, both ways; every lane is covered where it is wide."""
    assert lanelets
    covered = np.zeros(len(network.lanes))
    for item in lanelets:
        low, high = item.s_m
        covered[item.lane] += high - low
        knots = network.lane_knots(item.lane)
        s_m = np.linspace(low, high, max(int((high - low) / STEP_M), 8))
        s_m = np.unique(np.concatenate([s_m, knots[(knots > low) & (knots < high)]]))
        if network.lanes.direction[item.lane] < 0:
            s_m = s_m[::-1]
        key = network.lanes.key[item.lane]
        for side, true in enumerate(true_borders(network, item.lane, s_m)):
            read = (item.left, item.right)[side][:, :2]
            assert shapely.distance(shapely.LineString(read), shapely.points(true)).max() < within_m, (
                key,
                item.s_m,
            )
            off = shapely.distance(shapely.LineString(true), shapely.points(read))
            # Chords of the true border are rough where a lane opens steeply.
            for k in np.flatnonzero(off > 0.5 * within_m):
                off[k] = distance_m(network, item.lane, side, read[k], low, high)
            assert off.max() < within_m, (key, item.s_m)
        if item.left.shape[1] == 3 and item.left.shape == item.right.shape:
            middle = 0.5 * (item.left + item.right)
            along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(middle[:, :2], axis=0), axis=1))])
            if along[-1] > 0.1:
                s_of, _ = network.road_coordinates(key.road_id, middle[:, :2])
                inside = (s_of > low + 1e-3) & (s_of < high - 1e-3)
                # A step in height is a slope over 1 cm.
                beside = s_of[inside] + np.array([[-0.011], [0.0], [0.011]])
                z_m = network.center_line(item.lane, np.clip(beside, low, high))[2]
                assert np.abs(middle[inside, 2] - z_m).min(axis=0).max(initial=0.0) < within_m
    length = network.lanes.s_end_m - network.lanes.s_start_m
    missing = length - covered
    for lane in np.flatnonzero(missing > 2 * WITHIN_M).tolist():
        s_m = np.linspace(network.lanes.s_start_m[lane], network.lanes.s_end_m[lane], 400)
        narrow = np.mean(network.lane_width(lane, s_m) <= NARROW_M)
        assert missing[lane] <= length[lane] * narrow + 0.05 + 0.01 * length[lane], network.lanes.key[lane]


def expected_links(network: RoadNetwork, present: set[int]) -> set[tuple[int, int]]:
    """Links between lanes that are exported, across those that are too short."""
    length = network.lanes.s_end_m - network.lanes.s_start_m
    links = set()
    for lane in present:
        stack, seen = list(network.successors(lane)), set()
        while stack:
            following = stack.pop()
            if following in present:
                links.add((lane, following))
            elif length[following] < SHORT_M and following not in seen:
                seen.add(following)
                stack += network.successors(following)
    return links


def read_links(network: RoadNetwork, lanelets: Sequence[ReadLanelet]) -> set[tuple[int, int]]:
    """Links between different lanes (or round a lane), by lanes."""
    by_id = {item.id: item for item in lanelets}
    links = set()
    for item in lanelets:
        forward = network.lanes.direction[item.lane] > 0
        for other in (by_id[number] for number in item.successors if number in by_id):
            onwards = other.s_m[0] - item.s_m[1] if forward else item.s_m[0] - other.s_m[1]
            if other.lane != item.lane or abs(onwards) > 0.02:
                links.add((item.lane, other.lane))
    return links


def pieces_of(lanelets: Sequence[ReadLanelet]) -> dict[int, list[ReadLanelet]]:
    """Lanelets of each lane, by s."""
    pieces: dict[int, list[ReadLanelet]] = {}
    for item in sorted(lanelets, key=lambda item: item.s_m):
        pieces.setdefault(item.lane, []).append(item)
    return pieces


def assert_chains(network: RoadNetwork, lanelets: Sequence[ReadLanelet]) -> None:
    """Lanelets of one lane that touch follow one another in travel direction."""
    for lane, pieces in pieces_of(lanelets).items():
        ordered = pieces if network.lanes.direction[lane] > 0 else pieces[::-1]
        for a, b in pairwise(ordered):
            gap = b.s_m[0] - a.s_m[1] if network.lanes.direction[lane] > 0 else a.s_m[0] - b.s_m[1]
            if abs(gap) < 5e-3:
                assert b.id in a.successors


def assert_neighbours(
    network: RoadNetwork,
    lanelets: Sequence[ReadLanelet],
    on_left: Callable[[ReadLanelet], bool] = lambda _: True,
) -> int:
    """Each lanelet has the neighbour that its lane has, where that one is wide; how many have one."""
    by_id = {item.id: item for item in lanelets}
    seen = 0
    for item in lanelets:
        middle = 0.5 * sum(item.s_m)
        for side, number, same in (
            ("left", item.left_neighbour, item.left_same),
            ("right", item.right_neighbour, item.right_same),
        ):
            find = network.left_neighbour if side == "left" else network.right_neighbour
            expected = find(item.lane)
            crossed = 0
            while (
                expected is not None
                and float(network.lane_width(expected, middle)) <= NARROW_M
                and crossed < 20
            ):
                onwards = (
                    find
                    if network.lanes.direction[expected] == network.lanes.direction[item.lane]
                    else (network.right_neighbour if side == "left" else network.left_neighbour)
                )
                expected = onwards(expected)
                crossed += 1
            if number is None:
                assert expected is None or item.more.get("lone"), (network.lanes.key[item.lane], side)
                continue
            other = by_id[number]
            if expected is not None and float(network.lane_width(expected, middle)) > 2 * NARROW_M:
                assert other.lane == expected, (
                    network.lanes.key[item.lane],
                    network.lanes.key[other.lane],
                    side,
                )
            assert same == (network.lanes.direction[other.lane] == network.lanes.direction[item.lane])
            seen += 1
    return seen


def assert_speeds(network: RoadNetwork, lanelets: Sequence[ReadLanelet]) -> None:
    """Each lanelet has the speed limit of its lane, at both ends and in the middle."""
    for item in lanelets:
        low, high = item.s_m
        inset = min(0.02, 0.25 * (high - low))
        for s_m in (low + inset, 0.5 * (low + high), high - inset):
            limit = network.speed_limit(item.lane, s_m)
            assert (limit is None) == (item.speed_mps is None)
            if limit is not None:
                assert abs(item.speed_mps - limit) < 1e-3
