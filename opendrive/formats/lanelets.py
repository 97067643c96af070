"""Lanelets: stretches of lanes between two borders, as CommonRoad and Lanelet2 know roads.

A lane section is cut where a lane of it begins or ceases to have width, where a speed limit or a road mark
changes, where it has turned by nearly half a circle, and where a virtual junction is entered or left. Within
each of these slices lanes are as long as each other and share their borders (Bender, Ziegler, Stiller:
Lanelets, IV 2014).
"""

from collections import Counter
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import shapely

from opendrive.arrays import FloatArray
from opendrive.formats.slices import SHORTEST_M, Slice, border_points, slices_of
from opendrive.lanes.graph import may_cross
from opendrive.model import RoadMark
from opendrive.network import RoadNetwork


@dataclass(frozen=True, slots=True, eq=False)
class Border:
    """A border of lanelets.

    Attributes:
        xyz_m: (K, 3) points along s, map frame.
        marks: its lines, ``solid`` or ``broken``, from left to right along s, or another type of road mark;
            empty where nothing is painted.
        is_bold: whether the mark is bold.
    """

    xyz_m: FloatArray
    marks: tuple[str, ...]
    is_bold: bool


@dataclass(slots=True, eq=False)
class Lanelet:
    """A stretch of a lane; left and right, begin and end are those of its travel direction.

    Attributes:
        lane: index of the lane in the network.
        s_start_m: least road s.
        s_end_m: greatest road s.
        forward: whether it runs along s.
        left: index of its left border.
        right: index of its right border.
        successors: lanelets that it leads to.
        predecessors: lanelets that lead to it.
        left_neighbour: lanelet on its left, of whatever type and direction, or None.
        right_neighbour: the same on its right.
        may_change_left: whether the marks allow a change to the left neighbour.
        may_change_right: the same on the right.
        speed_mps: speed limit, or None.
    """

    lane: int
    s_start_m: float
    s_end_m: float
    forward: bool
    left: int
    right: int
    successors: list[int] = field(default_factory=list)
    predecessors: list[int] = field(default_factory=list)
    left_neighbour: int | None = None
    right_neighbour: int | None = None
    may_change_left: bool = False
    may_change_right: bool = False
    speed_mps: float | None = None


@dataclass(frozen=True, slots=True, eq=False)
class Lanelets:
    """All lanelets of a network.

    Attributes:
        lanelets: the lanelets.
        borders: their borders; neighbours share one where it has the same height for both.
        left_out: what has no lanelet, and how often.
    """

    lanelets: tuple[Lanelet, ...]
    borders: tuple[Border, ...]
    left_out: Counter[str]

    def bounds(self, lanelet: Lanelet) -> tuple[FloatArray, FloatArray]:
        """Return its left and its right border, (K, 3) each, in travel direction."""
        step = 1 if lanelet.forward else -1
        return self.borders[lanelet.left].xyz_m[::step], self.borders[lanelet.right].xyz_m[::step]

    def folded(self) -> int:
        """Return how many lanelets cross themselves: in a bend that is tighter than the lane is far out."""
        rings = [
            np.concatenate([right[:, :2], left[::-1, :2]]) for left, right in map(self.bounds, self.lanelets)
        ]
        return sum(not valid for valid in shapely.is_valid([shapely.Polygon(ring) for ring in rings]))

    def running_back(self) -> list[int]:
        """Return the lanelets of which one border runs back: in a bend that is tighter than the lane."""
        back = []
        for i, lanelet in enumerate(self.lanelets):
            left, right = (np.diff(border[:, :2], axis=0) for border in self.bounds(lanelet))
            if len(left) == len(right) and bool(((left * right).sum(axis=1) < 0.0).any()):
                back.append(i)
        return back


def lanelets_of(network: RoadNetwork) -> Lanelets:
    """Cut the lanes of a network into lanelets, whose borders are within 4 mm of those of the lanes."""
    left_out: Counter[str] = Counter()
    slices = slices_of(network, left_out)
    builder = _Builder(network, left_out)
    for piece in slices:
        builder.add(piece)
    return builder.finish()


class _Builder:
    """Puts lanelets together, slice by slice, and links them."""

    def __init__(self, network: RoadNetwork, left_out: Counter[str]) -> None:
        self.network = network
        self.left_out = left_out
        self.lanelets: list[Lanelet] = []
        self.borders: list[Border] = []
        self.of_lane: dict[int, list[int]] = {}

    def add(self, piece: Slice) -> None:
        """Make the lanelets of a slice, with their borders and neighbours."""
        network, lanes = self.network, self.network.lanes
        many = np.repeat(piece.lanes, len(piece.s_m))
        inner, outer = border_points(network, many, np.tile(piece.s_m, len(piece.lanes)))
        inner = inner.reshape(len(piece.lanes), -1, 3)
        outer = outer.reshape(len(piece.lanes), -1, 3)
        middle_m = 0.5 * (piece.start_m + piece.end_m)
        centre: int | None = None
        row: list[int] = []
        for side in (1, -1):
            innermost = True
            shared, passed = centre, [0]
            of_side: list[int] = []
            first_key = lanes.key[int(piece.lanes[0])]
            kept = {int(i): k for k, i in enumerate(piece.lanes) if lanes.side[i] == side}
            last = max((lanes.key[i].lane_id * side for i in kept), default=0)
            for number in range(1, last + 1):
                lane = lanes.lane_of_key.get(first_key._replace(lane_id=side * number))
                if lane is None:
                    continue
                if lane not in kept:
                    passed.append(side * number)
                    continue
                k = kept[lane]
                if shared is None or _apart_m(self.borders[shared].xyz_m, inner[k]) > SHORTEST_M:
                    shared = self._border(inner[k], lane, passed, middle_m)
                if innermost and centre is None:
                    centre = shared
                innermost = False
                passed = [side * number]
                beyond = self._border(outer[k], lane, passed, middle_m)
                outer_is_left = lanes.side[lane] == lanes.direction[lane]
                left, right = (beyond, shared) if outer_is_left else (shared, beyond)
                lanelet = Lanelet(
                    lane, piece.start_m, piece.end_m, bool(lanes.direction[lane] > 0), left, right
                )
                lanelet.speed_mps = network.speed_limit(lane, middle_m)
                of_side.append(len(self.lanelets))
                self.of_lane.setdefault(lane, []).append(len(self.lanelets))
                self.lanelets.append(lanelet)
                shared = beyond
            row = [*reversed(of_side), *row] if side > 0 else [*row, *of_side]
        for a, b in pairwise(row):
            self._neighbours(a, b, middle_m)

    def _border(self, xyz_m: FloatArray, lane: int, owners: list[int], s_m: float) -> int:
        """Add a border; its mark is the outermost on the outer borders of the lanes with the given ids."""
        key = self.network.lanes.key[lane]
        section = self.network.model.roads[key.road_id].sections[key.section]
        records = {record.id: record for record in section.lanes}
        painted: tuple[tuple[str, ...], bool] = ((), False)
        for lane_id in owners:
            marks = records[lane_id].road_marks if lane_id in records else ()
            begun = [mark for mark in marks if section.s_m + mark.s_offset_m <= s_m]
            if begun and begun[-1].type != "none":
                painted = (_lines(begun[-1], reverse=lane_id > 0), begun[-1].weight == "bold")
        self.borders.append(Border(xyz_m, *painted))
        return len(self.borders) - 1

    def _neighbours(self, a: int, b: int, s_m: float) -> None:
        """Make a lanelet and the one right of it, looking along s, neighbours."""
        network, lanes = self.network, self.network.lanes
        left, right = self.lanelets[a], self.lanelets[b]
        ids = _between(lanes.key[left.lane].lane_id, lanes.key[right.lane].lane_id)
        keys = [lanes.key[left.lane]._replace(lane_id=lane_id) for lane_id in ids]
        keys = [key for key in keys if key in lanes.lane_of_key]
        rightwards = all(may_cross(network.model, key, other, s_m) for key, other in pairwise(keys))
        leftwards = all(may_cross(network.model, other, key, s_m) for key, other in pairwise(keys))
        if left.forward:
            left.right_neighbour, left.may_change_right = b, rightwards
        else:
            left.left_neighbour, left.may_change_left = b, rightwards
        if right.forward:
            right.left_neighbour, right.may_change_left = a, leftwards
        else:
            right.right_neighbour, right.may_change_right = a, leftwards

    def finish(self) -> Lanelets:
        """Link the lanelets, and pass over those that are too short."""
        following: list[set[int]] = [set() for _ in self.lanelets]
        for lane, pieces in self.of_lane.items():
            forward = self.network.lanes.direction[lane] > 0
            for a, b in pairwise(pieces):
                if abs(self.lanelets[a].s_end_m - self.lanelets[b].s_start_m) < SHORTEST_M:
                    following[a if forward else b].add(b if forward else a)
        graph = self.network._graph
        edges = zip(
            graph.from_lane.tolist(),
            graph.to_lane.tolist(),
            graph.from_s_m.tolist(),
            graph.to_s_m.tolist(),
            strict=True,
        )
        for from_lane, to_lane, from_s_m, to_s_m in edges:
            leaves, enters = self._at(from_lane, from_s_m, True), self._at(to_lane, to_s_m, False)
            if leaves is None or enters is None:
                self.left_out["links of lanes where they have no width"] += 1
            else:
                following[leaves].add(enters)
        return self._without_short(following)

    def _at(self, lane: int, s_m: float, at_end: bool) -> int | None:
        """Return the lanelet of a lane that ends (or begins) at s, in travel direction."""
        for i in self.of_lane.get(lane, ()):
            lanelet = self.lanelets[i]
            end_m = lanelet.s_end_m if lanelet.forward == at_end else lanelet.s_start_m
            if abs(end_m - s_m) < SHORTEST_M:
                return i
        return None

    def _without_short(self, following: list[set[int]]) -> Lanelets:
        short = {i for i, a in enumerate(self.lanelets) if a.s_end_m - a.s_start_m < SHORTEST_M}
        before: list[set[int]] = [set() for _ in following]
        for i, after in enumerate(following):
            for j in after:
                before[j].add(i)
        for i in short:
            for a in before[i]:
                following[a] = (following[a] | following[i]) - {i}
            for b in following[i]:
                before[b] = (before[b] | before[i]) - {i}
        kept = [i for i in range(len(self.lanelets)) if i not in short]
        number = {old: new for new, old in enumerate(kept)}
        used = sorted({b for i in kept for b in (self.lanelets[i].left, self.lanelets[i].right)})
        border = {old: new for new, old in enumerate(used)}
        for i in kept:
            lanelet = self.lanelets[i]
            lanelet.left, lanelet.right = border[lanelet.left], border[lanelet.right]
            lanelet.successors = sorted(number[j] for j in following[i])
            lanelet.predecessors = sorted(number[j] for j in before[i])
            for name in ("left_neighbour", "right_neighbour"):
                neighbour = getattr(lanelet, name)
                setattr(lanelet, name, None if neighbour is None else number[neighbour])
        if short:
            self.left_out["lanelets shorter than 1 cm (links lead across)"] += len(short)
        return Lanelets(
            tuple(self.lanelets[i] for i in kept), tuple(self.borders[i] for i in used), self.left_out
        )


def _lines(mark: RoadMark, reverse: bool) -> tuple[str, ...]:
    """Return the lines of a mark from left to right along s.

    OpenDRIVE names two lines from the inside to the outside, on the centre lane from left to right.
    """
    parts = mark.type.split()
    if not set(parts) <= {"solid", "broken"}:
        return (mark.type,)
    return tuple(parts[::-1] if reverse else parts)


def _between(left_id: int, right_id: int) -> list[int]:
    return [lane_id for lane_id in range(left_id, right_id - 1, -1) if lane_id]


def _apart_m(a: FloatArray, b: FloatArray) -> float:
    return float(np.linalg.norm(a - b, axis=1).max())
