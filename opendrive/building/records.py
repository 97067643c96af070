"""Records of a map from few numbers: lanes, sections, roads, signals, objects, the map as a whole."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from opendrive import model
from opendrive.arrays import FloatArray, finite
from opendrive.building.reference_line import Curve, Piece, Pose, reference_line, to_15_digits, total_length_m
from opendrive.errors import OpenDriveError, PositionError

ROAD_MARK_WIDTH_M = 0.12

_MEET_M = 0.05
"""Lanes whose middles are nearer at a joint of sections go on; the checks ask for the same."""

NO_CUBICS = np.empty((0, 5))
_NO_SHAPE = np.empty((0, 6))

Profile: TypeAlias = float | FloatArray
"""A constant, or cubics (K, 5) in rows ``s, a, b, c, d``, as `profile` makes them."""


def profile(places: Sequence[tuple[float, float]], smooth: bool = True) -> FloatArray:
    """Return the cubics (K, 5) through values at s, for widths, heights, rolls and offsets.

    Args:
        places: s and value, ascending in s; the last value holds on.
        smooth: level at each place, so that slopes have no steps; else straight between them.

    Raises:
        PositionError: there are no places, or their s do not ascend.
    """
    if not places or any(b[0] <= a[0] for a, b in pairwise(places)):
        raise PositionError(f"places: expected s that ascend, got {list(places)!r:.80}")
    rows = []
    for (s_m, value), (next_m, next_value) in pairwise(places):
        step, length_m = next_value - value, next_m - s_m
        if smooth:
            rows.append([s_m, value, 0.0, 3.0 * step / length_m**2, -2.0 * step / length_m**3])
        else:
            rows.append([s_m, value, step / length_m, 0.0, 0.0])
    rows.append([places[-1][0], places[-1][1], 0.0, 0.0, 0.0])
    return np.array([[to_15_digits(value) for value in row] for row in rows])


@dataclass(frozen=True, slots=True)
class Lane:
    """A lane and the mark on its outer border; a broken one may be crossed, both ways.

    Attributes:
        kind: lane type, such as ``driving``.
        width_m: its width; s of a profile counts from the start of the lane section.
        mark: ``solid``, ``broken``, ``none`` or another type of road mark.
        speed_mps: speed limit; None: that of the road.
        height_m: height of the lane above the road, such as that of a sidewalk.
    """

    kind: str
    width_m: Profile
    mark: str = "none"
    speed_mps: float | None = None
    height_m: float = 0.0


CENTRE = Lane("none", 0.0, "broken")
UNMARKED_CENTRE = Lane("none", 0.0, "none")


def lane_record(
    lane_id: int, lane: Lane, predecessors: tuple[int, ...] = (), successors: tuple[int, ...] = ()
) -> model.Lane:
    """Return the record of a lane; the centre lane has no width."""
    mark = model.RoadMark(
        s_offset_m=0.0,
        type=lane.mark,
        weight="standard",
        color="standard",
        width_m=None if lane.mark == "none" else ROAD_MARK_WIDTH_M,
        lane_change="both" if lane.mark == "broken" else "none",
    )
    speeds = () if lane.speed_mps is None else (model.LaneSpeed(0.0, lane.speed_mps),)
    heights = [[0.0, lane.height_m, lane.height_m]] if lane.height_m else np.empty((0, 3))
    return model.Lane(
        lane_id,
        lane.kind,
        level=False,
        predecessors=predecessors,
        successors=successors,
        width=_cubics(lane.width_m) if lane_id else NO_CUBICS,
        border=NO_CUBICS,
        height=np.array(heights),
        details=model.Deferred.of(model.LaneDetails(road_marks=(mark,), speeds=speeds)),
    )


def section(
    left: Sequence[Lane] = (), right: Sequence[Lane] = (), centre: Lane = CENTRE, s_m: float = 0.0
) -> model.LaneSection:
    """Return a lane section: lanes of both sides from the middle outwards, from s on.

    `road` links lanes to those of the next section.
    """
    lanes = (
        *reversed([lane_record(k, lane) for k, lane in enumerate(left, start=1)]),
        lane_record(0, centre),
        *(lane_record(-k, lane) for k, lane in enumerate(right, start=1)),
    )
    return model.LaneSection(s_m, single_side=False, lanes=lanes)


def road(
    road_id: str,
    start: Pose,
    pieces: Sequence[Piece | Curve],
    sections: Sequence[model.LaneSection],
    *,
    name: str = "",
    junction_id: str | None = None,
    predecessor: model.RoadLink | None = None,
    successor: model.RoadLink | None = None,
    elevation: Profile = 0.0,
    superelevation: Profile = 0.0,
    lane_offset: Profile = 0.0,
    kind: str = "town",
    country: str = "",
    speed_mps: float | None = None,
    rule: model.TrafficRule = "RHT",
    details: model.RoadDetails | None = None,
) -> model.Road:
    """Return the record of a road.

    Args:
        road_id: its id.
        start: where its reference line begins.
        pieces: of the reference line.
        sections: lane sections by s; lanes of a type that meet in the next one are linked.
        name: free name.
        junction_id: junction that it is part of.
        predecessor: what its start is connected to.
        successor: what its end is connected to.
        elevation: height of the reference line, m.
        superelevation: roll about it, rad.
        lane_offset: t of the centre lane, m.
        kind: road type, such as ``town``, ``rural`` or ``motorway``.
        country: country code.
        speed_mps: speed limit; None for none.
        rule: ``RHT`` or ``LHT``: traffic keeps right or left.
        details: signals, objects and the like.

    Raises:
        PositionError: there are no pieces, a number is not finite, or lane sections do not start at 0, do not
            ascend or start after the road's end.
        OpenDriveError: there are no lane sections.
    """
    if not pieces:
        raise PositionError(f"road {road_id!r}: its reference line has no pieces")
    if not sections:
        raise OpenDriveError(f"road {road_id!r}: it has no lane sections")
    finite([start.x_m, start.y_m, start.yaw_rad], f"road {road_id!r}: start")
    starts_m = [section.s_m for section in sections]
    if starts_m[0] != 0.0 or not all(a < b for a, b in pairwise([*starts_m, total_length_m(pieces)])):
        written = ", ".join(f"{s_m:g}" for s_m in starts_m)
        raise PositionError(
            f"road {road_id!r}: lane sections start at s = {written} m, expected 0 first, then ascending, "
            f"before the road's end at {total_length_m(pieces):g} m"
        )
    return model.Road(
        road_id,
        name,
        to_15_digits(total_length_m(pieces)),
        junction_id,
        rule,
        predecessor,
        successor,
        geometries=reference_line(start, pieces),
        elevation=_cubics(elevation, none_for_0=True),
        superelevation=_cubics(superelevation, none_for_0=True),
        crossfall_left=NO_CUBICS,
        crossfall_right=NO_CUBICS,
        shape=_NO_SHAPE,
        lane_offset=_cubics(lane_offset, none_for_0=True),
        types=(model.RoadType(0.0, kind, country, speed_mps),),
        sections=_linked_sections(sections),
        details=model.Deferred.of(details or model.RoadDetails()),
    )


def _cubics(value: Profile, none_for_0: bool = False) -> FloatArray:
    finite(value, "profile")
    if isinstance(value, np.ndarray):
        return value
    return NO_CUBICS if none_for_0 and value == 0.0 else np.array([[0.0, value, 0.0, 0.0, 0.0]])


def _linked_sections(sections: Sequence[model.LaneSection]) -> tuple[model.LaneSection, ...]:
    """Link lanes of sections that follow each other: those of a type whose middles meet."""
    parts = list(sections)
    for k, (before, after) in enumerate(pairwise(parts)):
        begins = _middles(after, 0.0)
        links = {
            lane_id: other_id
            for lane_id, (kind, t_m) in _middles(before, after.s_m - before.s_m).items()
            for other_id, (other_kind, other_m) in begins.items()
            if kind == other_kind and abs(t_m - other_m) < _MEET_M
        }
        back = {other_id: lane_id for lane_id, other_id in links.items()}
        parts[k] = replace(
            parts[k],
            lanes=tuple(
                replace(lane, successors=(links[lane.id],)) if lane.id in links else lane
                for lane in parts[k].lanes
            ),
        )
        parts[k + 1] = replace(
            after,
            lanes=tuple(
                replace(lane, predecessors=(back[lane.id],)) if lane.id in back else lane
                for lane in after.lanes
            ),
        )
    return tuple(parts)


def _middles(part: model.LaneSection, ds_m: float) -> dict[int, tuple[str, float]]:
    """Return type and t, from the centre lane, of the middles of all lanes with width, by id."""
    middles: dict[int, tuple[str, float]] = {}
    for side in (1, -1):
        t_m = 0.0
        for lane in sorted(
            (lane for lane in part.lanes if lane.id * side > 0), key=lambda lane: abs(lane.id)
        ):
            cubics = lane.width[lane.width[:, 0] <= ds_m + 1e-9]
            s_m, a, b, c, d = cubics[-1] if len(cubics) else np.zeros(5)
            ds = ds_m - s_m
            width_m = float(a + ds * (b + ds * (c + ds * d)))
            if width_m > _MEET_M:
                middles[lane.id] = (lane.type, side * (t_m + width_m / 2))
            t_m += width_m
    return middles


def road_map(
    name: str,
    roads: Iterable[model.Road],
    junctions: Iterable[model.Junction] = (),
    *,
    geo_reference: str = "",
    extent_m: tuple[float, float, float, float] | None = None,
) -> model.MapModel:
    """Return a map (OpenDRIVE 1.6) of roads and junctions; `write_map` writes it, `RoadNetwork` reads it.

    Args:
        name: of the map.
        roads: its roads.
        junctions: its junctions.
        geo_reference: PROJ text of the projection.
        extent_m: least and greatest x and y, as ``xmin, ymin, xmax, ymax``; None for none in the header.

    Raises:
        OpenDriveError: two roads, or two junctions, have the same id.
    """
    roads, junctions = tuple(roads), tuple(junctions)
    for kind, items in (("road", roads), ("junction", junctions)):
        for item_id, count in Counter(item.id for item in items).items():
            if count > 1:
                raise OpenDriveError(f"{kind} {item_id!r}: {count} have this id; give each its own")
    west_m, south_m, east_m, north_m = (None,) * 4 if extent_m is None else map(to_15_digits, extent_m)
    header = model.Header(
        rev_major=1,
        rev_minor=6,
        name=name,
        version="1",
        date="",
        vendor="smartmot",
        north_m=north_m,
        south_m=south_m,
        east_m=east_m,
        west_m=west_m,
        geo_reference=geo_reference,
        offset=None,
    )
    return model.MapModel(
        header,
        roads={item.id: item for item in roads},
        junctions={item.id: item for item in junctions},
        noted=model.Deferred.of(()),
    )


# ------------------------------------------------------------------------------------ signals and objects


def signal(
    signal_id: str,
    kind: str,
    s_m: float,
    t_m: float,
    *,
    subtype: str = "-1",
    name: str = "",
    country: str = "",
    country_revision: str = "",
    value: float | None = None,
    unit: str = "",
    dynamic: bool = False,
    z_offset_m: float = 2.2,
    width_m: float = 0.6,
    height_m: float = 0.6,
    validity: Sequence[tuple[int, int]] = (),
) -> model.Signal:
    """Return a sign or light for the traffic on its side of the road: along s where t is negative.

    Args:
        signal_id: its id.
        kind: type in the country's catalogue.
        s_m: road s.
        t_m: lateral position.
        subtype: subtype in the catalogue.
        name: free name.
        country: country code.
        country_revision: year of the catalogue.
        value: such as a speed.
        unit: of the value.
        dynamic: whether its state changes, as a traffic light's does.
        z_offset_m: height above the road.
        width_m: width of the plate or head.
        height_m: height of the plate or head.
        validity: first and last lane that it is for; none for all.
    """
    return model.Signal(
        id=signal_id,
        name=name,
        s_m=to_15_digits(s_m),
        t_m=t_m,
        z_offset_m=z_offset_m,
        heading_offset_rad=0.0,
        type=kind,
        subtype=subtype,
        country=country,
        country_revision=country_revision,
        value=value,
        unit=unit,
        text="",
        dynamic=dynamic,
        orientation="+" if t_m < 0 else "-",
        height_m=height_m,
        width_m=width_m,
        validity=tuple(model.LaneRange(*pair) for pair in validity),
    )


def crosswalk(
    object_id: str, s_m: float, depth_m: float, t_right_m: float, t_left_m: float
) -> model.RoadObject:
    """Return a crosswalk across a road between two t, its middle at s."""
    half_m = depth_m / 2
    corners = [
        (to_15_digits(s_m + along * half_m), t_m, 0.0)
        for along, t_m in ((-1, t_right_m), (1, t_right_m), (1, t_left_m), (-1, t_left_m))
    ]
    return area_object(object_id, "crosswalk", s_m, corners, length_m=depth_m, name="crosswalk")


def area_object(
    object_id: str,
    kind: str,
    s_m: float,
    corners: Sequence[tuple[float, float, float]],
    *,
    length_m: float | None = None,
    height_m: float = 0.0,
    name: str = "",
) -> model.RoadObject:
    """Return an object with an outline, such as a crosswalk, a parking space or an island.

    Args:
        object_id: its id.
        kind: object type.
        s_m: road s of its middle.
        corners: s, t and height above the road of its corners, counter-clockwise.
        length_m: along the road; None: that of the outline.
        height_m: height of the object.
        name: free name.
    """
    places = np.array(corners)
    size = np.ptp(places, axis=0)
    outline = model.Outline(
        in_road_frame=True,
        corners=places,
        closed=True,
        heights_m=np.full(len(places), height_m),
        corner_ids=tuple(str(number) for number in range(len(places))),
        id="0",
        attributes=(("fillType", "paint"), ("outer", "true")),
    )
    return model.RoadObject(
        id=object_id,
        name=name,
        type=kind,
        subtype="",
        s_m=to_15_digits(s_m),
        t_m=to_15_digits(float(places[:, 1].min() + places[:, 1].max()) / 2),
        z_offset_m=0.0,
        heading_rad=0.0,
        orientation="none",
        length_m=float(size[0]) if length_m is None else length_m,
        width_m=float(size[1]),
        height_m=height_m,
        radius_m=None,
        outlines=(outline,),
        validity=(),
    )
