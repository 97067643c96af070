"""Crosswalks, outlines of objects, and the signals that apply to a road."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from opendrive.arrays import FloatArray, read_only
from opendrive.model import LaneRange, Road, RoadObject, Signal
from opendrive.roads.road import RoadGeometry


@dataclass(frozen=True, slots=True, eq=False)
class Crosswalk:
    """Crosswalk on a road.

    Attributes:
        id: id of the object.
        name: free name.
        road_id: road that carries it.
        s_m: position along the road.
        t_m: lateral position.
        polygon: (P, 2) corners, map frame, without repetition of the first.
    """

    id: str
    name: str
    road_id: str
    s_m: float
    t_m: float
    polygon: FloatArray


@dataclass(frozen=True, slots=True)
class RoadSignal:
    """A signal that applies to a road: placed on it, or referenced from it.

    Attributes:
        road_id: road that it applies to.
        s_m: position along that road.
        t_m: lateral position.
        orientation: ``+`` valid along s, ``-`` valid against s, ``none`` both.
        validity: lanes that it applies to, by id; empty means all.
        signal: the signal as placed.
        is_reference: whether it stands on another road.
    """

    road_id: str
    s_m: float
    t_m: float
    orientation: str
    validity: tuple[LaneRange, ...]
    signal: Signal
    is_reference: bool

    @property
    def id(self) -> str:
        """Id of the signal."""
        return self.signal.id

    @property
    def name(self) -> str:
        """Free name of the signal."""
        return self.signal.name

    @property
    def type(self) -> str:
        """Type code."""
        return self.signal.type

    @property
    def subtype(self) -> str:
        """Subtype code."""
        return self.signal.subtype

    @property
    def value(self) -> float | None:
        """Value of the sign, such as a speed."""
        return self.signal.value

    @property
    def unit(self) -> str:
        """Unit of the value."""
        return self.signal.unit

    @property
    def dynamic(self) -> bool:
        """Whether its state changes (a traffic light)."""
        return self.signal.dynamic

    def applies_to(self, lane_id: int) -> bool:
        """Return whether the lane is within the validity."""
        return not self.validity or any(
            min(r.from_lane, r.to_lane) <= lane_id <= max(r.from_lane, r.to_lane) for r in self.validity
        )


def crosswalks_on(road: RoadGeometry) -> Iterator[Crosswalk]:
    """Yield the crosswalks of a road that have an outline or a size."""
    for item in road.record.objects:
        if item.type == "crosswalk":
            polygon = object_polygon(road, item)
            if len(polygon) >= 3:
                yield Crosswalk(item.id, item.name, road.id, item.s_m, item.t_m, read_only(polygon))


def signals_on(road: Road, signals: Mapping[str, Signal]) -> tuple[RoadSignal, ...]:
    """Return the signals placed on a road and those referenced from it, by s.

    Args:
        road: the road.
        signals: all signals of the map, by id; a reference to none of them is left out.
    """
    placed = [RoadSignal(road.id, g.s_m, g.t_m, g.orientation, g.validity, g, False) for g in road.signals]
    referenced = [
        RoadSignal(road.id, r.s_m, r.t_m, r.orientation, r.validity, signals[r.signal_id], True)
        for r in road.signal_references
        if r.signal_id in signals
    ]
    return tuple(sorted(placed + referenced, key=lambda signal: signal.s_m))


def object_polygon(road: RoadGeometry, item: RoadObject) -> FloatArray:
    """Return the outline of an object as (P, 2) corners in the map frame.

    The first outline is taken; without one, the rectangle of length and width, or the circle of the radius.
    The result is empty if the object has no extent (ASAM OpenDRIVE 1.8, chapter "Objects").
    """
    outline = item.outlines[0].corners if item.outlines else np.empty((0, 3))
    if item.outlines and item.outlines[0].in_road_frame:
        s = np.clip(outline[:, 0], 0.0, road.length_m)
        corners = road.point(s, outline[:, 1])
        return _open_ring(np.stack([corners.x_m, corners.y_m], axis=1))
    if len(outline):
        local = outline[:, :2]
    elif item.length_m and item.width_m:
        local = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [item.length_m, item.width_m]
    elif item.radius_m:
        angle = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
        local = item.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    else:
        return np.empty((0, 2))
    origin = road.point(min(max(item.s_m, 0.0), road.length_m), item.t_m)
    heading = float(origin.heading_rad) + item.heading_rad
    cos, sin = np.cos(heading), np.sin(heading)
    turned = local @ np.array([[cos, sin], [-sin, cos]])
    return _open_ring(turned + np.array([float(origin.x_m), float(origin.y_m)]))


def _open_ring(corners: FloatArray) -> FloatArray:
    """Drop the last corner if it repeats the first."""
    if len(corners) > 1 and np.hypot(*(corners[0] - corners[-1])) < 1e-9:
        return corners[:-1]
    return corners
