"""Where linked lanes meet: pairs of lane ends, and how far they are apart."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from opendrive.arrays import BoolArray, FloatArray, IntArray, wrapped
from opendrive.lanes.graph import LanePlace
from opendrive.lanes.table import LaneKey
from opendrive.roads.geometry import NetworkGeometry


class LaneEnds(NamedTuple):
    """Ends of lanes, (K,) each.

    Attributes:
        lane: lanes.
        at_end: whether the end of the lane is meant, or its start.
    """

    lane: IntArray
    at_end: IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Joints:
    """Pairs of lane ends that links join; virtual junctions, which meet lanes in between, are left out.

    Attributes:
        first: (K,) ends.
        second: (K,) ends that they are linked to.
        gap_m: (K,) distance between the nearer borders, in plan.
        height_m: (K,) greater height between borders.
        turn_rad: (K,) angle between the reference lines.
        width_m: (K, 2) widths of both lanes there.
    """

    first: LaneEnds
    second: LaneEnds
    gap_m: FloatArray
    height_m: FloatArray
    turn_rad: FloatArray
    width_m: FloatArray

    @classmethod
    def of(cls, geometry: NetworkGeometry, touching: Iterable[tuple[LanePlace, LanePlace]]) -> "Joints":
        """Measure all joints of a network, from the pairs of places that its links join."""
        pairs = dict.fromkeys(
            tuple(sorted(((a, int(at_a == "end")), (b, int(at_b == "end")))))
            for (a, at_a), (b, at_b) in touching
            if isinstance(at_a, str) and isinstance(at_b, str)
        )
        ends = np.array(list(pairs), dtype=np.int64).reshape(-1, 2, 2)
        first, second = (LaneEnds(ends[:, k, 0], ends[:, k, 1]) for k in (0, 1))
        # The way through the joint leaves the first lane and enters the second one.
        left, right, heading, width = _cross_section(geometry, first, leaves=True)
        other_left, other_right, other_heading, other_width = _cross_section(geometry, second, leaves=False)
        apart = [np.hypot(*(a - b)[:, :2].T) for a, b in ((left, other_left), (right, other_right))]
        height = [np.abs(a - b)[:, 2] for a, b in ((left, other_left), (right, other_right))]
        return cls(
            first,
            second,
            np.minimum(*apart),
            np.maximum(*height),
            np.abs(wrapped(heading - other_heading)),
            np.stack([width, other_width], axis=1),
        )


def meet(
    geometry: NetworkGeometry, first: LaneEnds, second: LaneEnds, gap_m: float, wide_m: float
) -> BoolArray:
    """Return which ends (K,) of lanes lie on each other with both borders, and are wide."""
    left, right, _, width = _cross_section(geometry, first, leaves=True)
    other_left, other_right, _, other_width = _cross_section(geometry, second, leaves=False)
    apart = [np.hypot(*(a - b)[:, :2].T) for a, b in ((left, other_left), (right, other_right))]
    height = [np.abs(a - b)[:, 2] for a, b in ((left, other_left), (right, other_right))]
    near = np.maximum(np.maximum(*apart), np.maximum(*height)) <= gap_m
    lie_together: BoolArray = near & (np.minimum(width, other_width) >= wide_m)
    return lie_together


def _cross_section(
    geometry: NetworkGeometry, ends: LaneEnds, leaves: bool
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return left and right border (K, 3), heading of the way through, and width at ends of lanes."""
    lanes = geometry.lanes
    lane = ends.lane
    s_m = end_s_m(geometry, ends)
    along = (ends.at_end == 1) == leaves
    inner_m, outer_m, _, _ = lanes.offsets_and_slopes(lane, s_m)
    sections = geometry.cross_sections(lanes.road[lane], s_m)
    borders = []
    for t_m in (inner_m, outer_m):
        x, y, z = geometry.place(sections, t_m)
        borders.append(np.stack([x, y, geometry.lift(lane, sections, t_m, z)], axis=1))
    outer_is_left = ((lanes.side[lane] > 0) == along)[:, None]
    left, right = np.where(outer_is_left, borders[1], borders[0]), np.where(outer_is_left, *borders)
    heading = sections.heading_rad + np.where(along, 0.0, np.pi)
    return left, right, heading, (outer_m - inner_m) * lanes.side[lane]


def end_s_m(geometry: NetworkGeometry, ends: LaneEnds) -> FloatArray:
    """Return the road s of ends of lanes."""
    lanes = geometry.lanes
    s_m: FloatArray = np.where(ends.at_end == 1, lanes.s_end_m[ends.lane], lanes.s_start_m[ends.lane])
    return s_m


def lane_name(key: LaneKey, road_id: str) -> str:
    """Return a lane in words, seen from a road."""
    return f"lane {key.lane_id}" + ("" if key.road_id == road_id else f" of road {key.road_id!r:.40}")
