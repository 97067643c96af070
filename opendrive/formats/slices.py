"""Slices of lane sections in which every lane is a lanelet, and the points that follow their borders."""

from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np

from opendrive.arrays import FloatArray, IntArray, concatenated_ranges, run_starts
from opendrive.network import RoadNetwork

TOLERANCE_M = 0.004
"""Between a border and its chords; writers may add rounding and the joining of ends, and stay within 1 cm."""

NARROW_M = 1e-3
"""A lane that is nowhere wider has no surface."""

SHORTEST_M = 0.01
"""Lanelets that are shorter are passed over: links lead across them."""

_LEAST_STRETCH_M = 1.0
"""A lane without width is cut off from this length on; a lane that opens by a cubic is narrow for less."""

_TURN_STEP_M = 2.0
_GREATEST_TURN_RAD = 3.0
_WIDTH_PROBES = 33
_HALVINGS = 40
_PROBES = np.array([0.0, (3.0 - np.sqrt(3.0)) / 6.0, 0.5, (3.0 + np.sqrt(3.0)) / 6.0, 1.0])
"""Where a cubic departs most from its chord."""

_LEAST_CHORD_M = 0.01
_SHARE = 0.9
"""Part of the tolerance that the probes may use up; the border may depart a little more between them."""


@dataclass(slots=True, eq=False)
class Slice:
    """A stretch of a lane section: its lanes with width, and points of their borders."""

    section: int
    start_m: float
    end_m: float
    lanes: IntArray
    s_m: FloatArray = field(default_factory=lambda: np.empty(0))


def slices_of(network: RoadNetwork, left_out: Counter[str]) -> list[Slice]:
    """Cut the lane sections of a network into slices, and choose the points of their borders."""
    slices = list(_slices(network, left_out))
    _sample(network, slices)
    return slices


# ------------------------------------------------------------------------------------------------ slices


def _slices(network: RoadNetwork, left_out: Counter[str]) -> Iterator[Slice]:
    lanes = network.lanes
    firsts = run_starts(lanes.section)
    ends = np.append(firsts[1:], len(lanes))[: len(firsts)]
    cuts = _cuts(network)
    wide_anywhere = np.zeros(len(lanes), dtype=np.bool_)
    for first, end in zip(firsts.tolist(), ends.tolist(), strict=True):
        start_m, end_m = float(lanes.s_start_m[first]), float(lanes.s_end_m[first])
        every = np.arange(first, end)
        limits = _apart(cuts.get(int(lanes.section[first]), set()), start_m, end_m)
        share = np.linspace(0.0, 1.0, _WIDTH_PROBES)
        for low_m, high_m in pairwise(limits):
            probes = low_m + share * (high_m - low_m)
            wide = network.lane_width(every[:, None], probes[None, :]).max(axis=1) > 2.0 * NARROW_M
            wide_anywhere[every] |= wide
            if wide.any():
                yield Slice(int(lanes.section[first]), low_m, high_m, every[wide])
    if not wide_anywhere.all():
        left_out["lanes without width"] += int((~wide_anywhere).sum())


def _apart(cuts: set[float], start_m: float, end_m: float) -> list[float]:
    """Return start, cuts and end of a section; of cuts nearer than the shortest lanelet, the first."""
    limits = [start_m]
    for cut in sorted(cuts):
        if cut - limits[-1] >= SHORTEST_M and end_m - cut >= SHORTEST_M:
            limits.append(cut)
    return [*limits, end_m]


def _cuts(network: RoadNetwork) -> dict[int, set[float]]:
    """Return where each lane section is cut."""
    lanes = network.lanes
    cuts: dict[int, set[float]] = {}

    def cut(lane: int, s_m: float) -> None:
        cuts.setdefault(int(lanes.section[lane]), set()).add(s_m)

    for lane, low_m, high_m in _narrow_stretches(network):
        cut(lane, low_m)
        cut(lane, high_m)
    turns = _half_turns(network)
    graph = network._graph
    for edge_lane, edge_s in ((graph.from_lane, graph.from_s_m), (graph.to_lane, graph.to_s_m)):
        for lane, s_m in zip(edge_lane.tolist(), edge_s.tolist(), strict=True):
            cut(lane, s_m)
    by_section = {int(lanes.section[i]): i for i in run_starts(lanes.section).tolist()}
    for first in by_section.values():
        key = lanes.key[first]
        road = network.model.roads[key.road_id]
        section = road.sections[key.section]
        for s_m in turns.get(int(lanes.road[first]), ()):
            cut(first, s_m)
        for kind, following in pairwise(road.types):
            if following.speed_mps != kind.speed_mps or following.type != kind.type:
                cut(first, following.s_m)
        for lane in section.lanes:
            for speed in lane.speeds:
                cut(first, section.s_m + speed.s_offset_m)
            for mark, next_mark in pairwise(lane.road_marks):
                if (mark.type, mark.weight, mark.lane_change) != (
                    next_mark.type,
                    next_mark.weight,
                    next_mark.lane_change,
                ):
                    cut(first, section.s_m + next_mark.s_offset_m)
    return cuts


def _half_turns(network: RoadNetwork) -> dict[int, list[float]]:
    """Return the s of roads after every turn by nearly half a circle: no lanelet may meet itself."""
    turns: dict[int, list[float]] = {}
    for r, road in enumerate(network.roads.values()):
        s_m = np.linspace(0.0, road.length_m, max(int(road.length_m / _TURN_STEP_M), 1) + 1)
        heading = np.unwrap(road.reference_line(s_m).heading_rad)
        turned = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(heading)))])
        if turned[-1] > _GREATEST_TURN_RAD:
            steps = np.linspace(0.0, turned[-1], int(np.ceil(turned[-1] / _GREATEST_TURN_RAD)) + 1)[1:-1]
            turns[r] = np.interp(steps, turned, s_m).tolist()
    return turns


def _narrow_stretches(network: RoadNetwork) -> Iterator[tuple[int, float, float]]:
    """Yield the stretches of lanes that have no width, or a negative one."""
    lane, low_m, high_m = network._geometry.knots(np.arange(len(network.lanes), dtype=np.int64))
    share = np.linspace(0.0, 1.0, _WIDTH_PROBES)
    s_m = low_m[:, None] + share * (high_m - low_m)[:, None]
    narrow = network.lane_width(lane[:, None], s_m) <= NARROW_M
    narrow_of: dict[int, list[tuple[float, float]]] = {}
    for row in np.flatnonzero(narrow.any(axis=1)).tolist():
        index = int(lane[row])
        stretches = narrow_of.setdefault(index, [])
        changes = np.flatnonzero(narrow[row, 1:] != narrow[row, :-1]).tolist()
        places = [
            low_m[row],
            *(_crossing(network, index, s_m[row, k], s_m[row, k + 1]) for k in changes),
            high_m[row],
        ]
        is_narrow = bool(narrow[row, 0])
        for start, end in pairwise(places):
            if is_narrow and stretches and stretches[-1][1] == start:
                stretches[-1] = (stretches[-1][0], float(end))
            elif is_narrow:
                stretches.append((float(start), float(end)))
            is_narrow = not is_narrow
    for index, stretches in narrow_of.items():
        for start, end in stretches:
            if end - start >= _LEAST_STRETCH_M:
                yield index, start, end


def _crossing(network: RoadNetwork, lane: int, low_m: float, high_m: float) -> float:
    """Return where between two s a lane begins or ceases to have width: the last s that it has none."""
    narrow = float(network.lane_width(lane, low_m)) <= NARROW_M
    for _ in range(_HALVINGS):
        middle_m = 0.5 * (low_m + high_m)
        if (float(network.lane_width(lane, middle_m)) <= NARROW_M) == narrow:
            low_m = middle_m
        else:
            high_m = middle_m
    return low_m if narrow else high_m


# ---------------------------------------------------------------------------------------------- sampling


def border_points(network: RoadNetwork, lane: IntArray, s_m: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Return points (N, 3) of the inner and the outer borders of lanes (N,) at s (N,)."""
    geometry = network._geometry
    sections = geometry.cross_sections(geometry.lanes.road[lane], s_m)
    inner_m, outer_m, _, _ = geometry.lanes.offsets_and_slopes(lane, s_m)
    borders = []
    for t_m in (inner_m, outer_m):
        x_m, y_m, z_m = geometry.place(sections, t_m)
        borders.append(np.stack([x_m, y_m, geometry.lift(lane, sections, t_m, z_m)], axis=1))
    return borders[0], borders[1]


def _sample(network: RoadNetwork, slices: list[Slice]) -> None:
    """Choose the s of each slice so that chords follow all of its borders in space."""
    if not slices:
        return
    knots = [
        np.unique(
            np.concatenate(
                [[piece.start_m, piece.end_m]] + [network.lane_knots(lane) for lane in piece.lanes.tolist()]
            ).clip(piece.start_m, piece.end_m)
        )
        for piece in slices
    ]
    owner = np.repeat(np.arange(len(slices)), [len(s) - 1 for s in knots])
    low_m = np.concatenate([s[:-1] for s in knots])
    high_m = np.concatenate([s[1:] for s in knots])
    size = np.array([len(piece.lanes) for piece in slices])
    first = np.cumsum(size) - size
    lanes = np.concatenate([piece.lanes for piece in slices])
    chosen = [owner], [low_m]
    share = _PROBES[:, None]
    while owner.size:
        interval = np.repeat(np.arange(owner.size), size[owner])
        lane = lanes[concatenated_ranges(first[owner], size[owner])]
        s_m = low_m[interval] + share * (high_m - low_m)[interval]
        shape = (len(_PROBES), lane.size)
        rough = np.zeros(lane.size, dtype=np.bool_)
        for border in border_points(network, np.broadcast_to(lane, shape).ravel(), s_m.ravel()):
            xyz = border.reshape(*shape, 3)
            chord = xyz[:1] + share[:, :, None] * (xyz[-1:] - xyz[:1])
            rough |= (np.linalg.norm(xyz - chord, axis=2) > _SHARE * TOLERANCE_M).any(axis=0)
        halve = (np.bincount(interval, weights=rough, minlength=owner.size) > 0) & (
            high_m - low_m > _LEAST_CHORD_M
        )
        owner, low_m, high_m = owner[halve], low_m[halve], high_m[halve]
        middle_m = 0.5 * (low_m + high_m)
        chosen[0].append(owner)
        chosen[1].append(middle_m)
        owner = np.concatenate([owner, owner])
        low_m, high_m = np.concatenate([low_m, middle_m]), np.concatenate([middle_m, high_m])
    owner, s_m = np.concatenate(chosen[0]), np.concatenate(chosen[1])
    order = np.lexsort((s_m, owner))
    for piece, s in zip(slices, np.split(s_m[order], np.cumsum(np.bincount(owner))[:-1]), strict=True):
        piece.s_m = np.append(s, piece.end_m)
