"""Lanes of an OpenDRIVE map as lanes and lane boundaries of ASAM OSI; imported only where osi-python is."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from osi3.osi_common_pb2 import Identifier, Vector3d
from osi3.osi_groundtruth_pb2 import GroundTruth
from osi3.osi_lane_pb2 import Lane, LaneBoundary

from evaluation.views.traces.lanes import NearLanes
from opendrive import RoadNetwork
from opendrive.lanes.table import LaneKey
from opendrive.model import RoadMark
from smartmot.types import FloatArray

OPENDRIVE = "net.asam.opendrive"
"""Type of a reference to an element of an OpenDRIVE map (osi_common.proto, ExternalReference)."""

BOUNDARY_IDS, LANE_IDS = 2_000_000_000, 3_000_000_000
"""First identifiers: over those of road users, which are small."""

_Boundary, _Lane = LaneBoundary.Classification, Lane.Classification

MARK_TYPES = {
    "none": _Boundary.TYPE_NO_LINE,
    "solid": _Boundary.TYPE_SOLID_LINE,
    "solid solid": _Boundary.TYPE_SOLID_LINE,
    "broken": _Boundary.TYPE_DASHED_LINE,
    "broken broken": _Boundary.TYPE_DASHED_LINE,
    "botts dots": _Boundary.TYPE_BOTTS_DOTS,
    "curb": _Boundary.TYPE_CURB,
    "grass": _Boundary.TYPE_GRASS_EDGE,
    "edge": _Boundary.TYPE_ROAD_EDGE,
}
"""Types of boundaries by the road mark's; TYPE_OTHER of all others, as of a solid beside a broken line."""
MARK_COLOURS = {
    "standard": _Boundary.COLOR_WHITE,
    "white": _Boundary.COLOR_WHITE,
    "yellow": _Boundary.COLOR_YELLOW,
    "red": _Boundary.COLOR_RED,
    "blue": _Boundary.COLOR_BLUE,
    "green": _Boundary.COLOR_GREEN,
    "violet": _Boundary.COLOR_VIOLET,
    "orange": _Boundary.COLOR_ORANGE,
}
DRIVING = frozenset({"driving", "entry", "exit", "onRamp", "offRamp", "connectingRamp", "bidirectional"})
SUBTYPES = {
    "driving": _Lane.SUBTYPE_NORMAL,
    "biking": _Lane.SUBTYPE_BIKING,
    "sidewalk": _Lane.SUBTYPE_SIDEWALK,
    "walking": _Lane.SUBTYPE_SIDEWALK,
    "parking": _Lane.SUBTYPE_PARKING,
    "stop": _Lane.SUBTYPE_STOP,
    "restricted": _Lane.SUBTYPE_RESTRICTED,
    "border": _Lane.SUBTYPE_BORDER,
    "shoulder": _Lane.SUBTYPE_SHOULDER,
    "exit": _Lane.SUBTYPE_EXIT,
    "entry": _Lane.SUBTYPE_ENTRY,
    "onRamp": _Lane.SUBTYPE_ONRAMP,
    "offRamp": _Lane.SUBTYPE_OFFRAMP,
    "connectingRamp": _Lane.SUBTYPE_CONNECTINGRAMP,
}
"""OpenDRIVE's lane types; SUBTYPE_OTHER of all others."""


@dataclass(frozen=True, slots=True)
class _Border:
    """A border of lanes in a lane section, by the lane whose outer border it is; 0: the centre line."""

    road_id: str
    section: int
    lane_id: int


def add_lanes(truth: GroundTruth, network: RoadNetwork, near: NearLanes) -> None:
    """Add lanes and their boundaries to a message.

    All points run along the road's s, as OSI recommends for OpenDRIVE, so that left and right are those of s.

    Args:
        truth: the message.
        network: the map.
        near: lanes to add.
    """
    written = set(near.lane.tolist())
    boundaries: dict[_Border, list[int]] = {}
    for lane in near.lane.tolist():
        key = network.lanes.key[lane]
        step = 1 if key.lane_id > 0 else -1
        outer, inner = (_Border(key.road_id, key.section, n) for n in (key.lane_id, key.lane_id - step))
        for border in (outer, inner):
            if border not in boundaries:
                boundaries[border] = _add_boundaries(truth, network, border, key)
        left, right = (outer, inner) if step > 0 else (inner, outer)
        _add_lane(truth, network, lane, boundaries[left], boundaries[right], written)


def _add_lane(
    truth: GroundTruth,
    network: RoadNetwork,
    lane: int,
    left: Sequence[int],
    right: Sequence[int],
    written: set[int],
) -> None:
    lanes = network.lanes
    key, lane_type, along = lanes.key[lane], str(lanes.lane_type[lane]), bool(lanes.direction[lane] > 0)
    added = truth.lane.add(id=_identifier(LANE_IDS + lane))
    source = added.source_reference.add(type=OPENDRIVE)
    section = network.model.roads[key.road_id].sections[key.section]
    source.identifier.extend((key.road_id, repr(section.s_m), str(key.lane_id)))
    lane_class = added.classification
    lane_class.type = _Lane.TYPE_DRIVING if lane_type in DRIVING else _Lane.TYPE_NONDRIVING
    lane_class.subtype = SUBTYPES.get(lane_type, _Lane.SUBTYPE_OTHER)
    lane_class.left_lane_boundary_id.extend(map(_identifier, left))
    lane_class.right_lane_boundary_id.extend(map(_identifier, right))
    beside = network.left_neighbour(lane), network.right_neighbour(lane)
    of_s = beside if along else beside[::-1]
    for field, neighbour in zip(
        (lane_class.left_adjacent_lane_id, lane_class.right_adjacent_lane_id), of_s, strict=True
    ):
        if neighbour in written:
            field.append(_identifier(LANE_IDS + neighbour))
    before, after = network.predecessors(lane), network.successors(lane)
    for earlier, later in _pairings(*((before, after) if along else (after, before)), written):
        pairing = lane_class.lane_pairing.add()
        if earlier is not None:
            pairing.antecessor_lane_id.value = LANE_IDS + earlier
        if later is not None:
            pairing.successor_lane_id.value = LANE_IDS + later
    if lane_class.type == _Lane.TYPE_DRIVING:
        right_m, left_m = _borders(network, lane, float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane]))
        lane_class.centerline.extend(_points(0.5 * (right_m + left_m)))
        lane_class.centerline_is_driving_direction = along


def _pairings(
    before: Sequence[int], after: Sequence[int], written: set[int]
) -> Iterator[tuple[int | None, int | None]]:
    """Every lane before with every lane after, of those that are written; None where there are none."""
    earlier_lanes: list[int | None] = [lane for lane in before if lane in written]
    later_lanes: list[int | None] = [lane for lane in after if lane in written]
    if earlier_lanes or later_lanes:
        yield from itertools.product(earlier_lanes or [None], later_lanes or [None])


def _add_boundaries(truth: GroundTruth, network: RoadNetwork, border: _Border, asked: LaneKey) -> list[int]:
    """One boundary per road mark along a border, in the order of s; their identifiers."""
    # the centre line has no lane of its own: it is the inner border of the lane that asks
    own = border.lane_id or asked.lane_id
    lane = network.lane_index_of((border.road_id, border.section, own))
    identifiers = []
    for low_m, high_m, mark in _marked(network, border, lane):
        right_m, left_m = _borders(network, lane, low_m, high_m)
        on_left = (own > 0) == (border.lane_id != 0)  # outer borders lie away from the centre line
        value = BOUNDARY_IDS + len(truth.lane_boundary)
        added = truth.lane_boundary.add(id=_identifier(value))
        for position in _points(left_m if on_left else right_m):
            point = added.boundary_line.add(position=position)
            if mark is not None and mark.width_m is not None:
                point.width = mark.width_m
        painted = mark is not None and mark.type != "none"
        added.classification.type = MARK_TYPES.get(mark.type if mark else "none", _Boundary.TYPE_OTHER)
        added.classification.color = (
            MARK_COLOURS.get(mark.color, _Boundary.COLOR_OTHER)
            if mark is not None and painted
            else _Boundary.COLOR_NONE
        )
        identifiers.append(value)
    return identifiers


def _marked(
    network: RoadNetwork, border: _Border, lane: int
) -> Iterator[tuple[float, float, RoadMark | None]]:
    """Stretches of s along a border, each with its road mark; None where there is none."""
    section = network.model.roads[border.road_id].sections[border.section]
    marks = next((each.road_marks for each in section.lanes if each.id == border.lane_id), ())
    start, end = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
    starts: list[tuple[float, RoadMark | None]] = [(start, None)]
    starts += [(section.s_m + mark.s_offset_m, mark) for mark in marks]
    ends = [*(low for low, _ in starts[1:]), end]
    for (low, mark), high in zip(starts, ends, strict=True):
        if min(high, end) > max(low, start):
            yield max(low, start), min(high, end), mark


def _borders(network: RoadNetwork, lane: int, low_m: float, high_m: float) -> tuple[FloatArray, FloatArray]:
    """Right and left border (P, 2) of a stretch of a lane, both along s and as seen along s.

    The outline is within 5 cm of the border, as OSI asks.
    """
    outline = network.lane_polygon(lane, low_m, high_m)
    half = len(outline) // 2
    right, left = outline[:half], outline[half:][::-1]
    if network.lanes.direction[lane] < 0:
        return left[::-1], right[::-1]
    return right, left


def _points(line_m: FloatArray) -> list[Vector3d]:
    return [Vector3d(x=x, y=y, z=0.0) for x, y in np.asarray(line_m).tolist()]


def _identifier(value: int) -> Identifier:
    return Identifier(value=value)
