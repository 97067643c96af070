"""Crosswalks, outlines of objects, and the signals that apply to a road."""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

import numpy as np

from opendrive.arrays import FloatArray, read_only
from opendrive.model import Change, LaneRange, ObjectRepeat, Outline, Road, RoadObject, Signal
from opendrive.roads.geometry import SurfacePoints
from opendrive.roads.road import RoadGeometry

_STRIP_STEP_M = 1.0
MAX_COPIES = 10_000
"""More than any real object has along one road."""


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


@dataclass(frozen=True, slots=True, eq=False)
class PlacedObject:
    """An object where it stands: one copy and one outline of what the map lists.

    Attributes:
        id: id of the object; its copies and outlines share it.
        name: free name.
        type: such as ``pole`` or ``crosswalk``.
        subtype: closer kind, empty when absent.
        road_id: road that carries it.
        s_m: position along the road.
        t_m: lateral position.
        xyz_m: position, map frame.
        heading_rad: heading, map frame.
        polygon: (P, 2) corners, map frame, without repetition of the first; empty for what has no extent.
    """

    id: str
    name: str
    type: str
    subtype: str
    road_id: str
    s_m: float
    t_m: float
    xyz_m: tuple[float, float, float]
    heading_rad: float
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


def objects_on(road: RoadGeometry) -> Iterator[PlacedObject]:
    """Yield the objects of a road, one for every copy of a repeated one and for every outline."""
    for item in road.record.objects:
        for copy in _copies(item):
            origin = road.point(min(max(copy.s_m, 0.0), road.length_m), copy.t_m)
            heading_rad = float(origin.heading_rad) + item.heading_rad
            for polygon in copy.polygons(road, origin, heading_rad) or [np.empty((0, 2))]:
                yield PlacedObject(
                    id=item.id,
                    name=item.name,
                    type=item.type,
                    subtype=item.subtype,
                    road_id=road.id,
                    s_m=copy.s_m,
                    t_m=copy.t_m,
                    xyz_m=(float(origin.x_m), float(origin.y_m), float(origin.z_m) + copy.z_offset_m),
                    heading_rad=heading_rad,
                    polygon=read_only(polygon),
                )


def crosswalks_of(objects: Iterable[PlacedObject]) -> Iterator[Crosswalk]:
    """Yield the crosswalks among objects that have an outline or a size."""
    for item in objects:
        if item.type == "crosswalk" and len(item.polygon) >= 3:
            yield Crosswalk(item.id, item.name, item.road_id, item.s_m, item.t_m, item.polygon)


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


@dataclass(frozen=True, slots=True)
class _Copy:
    """One copy of an object, or a stretch of road along which it is continuous.

    Attributes:
        item: the object.
        s_m: along the road.
        t_m: across it.
        z_offset_m: height above the road.
        length_m: length; None when absent.
        width_m: width; None when absent.
        radius_m: radius; None when absent.
        repeat: the repeat along which it is continuous; None for a single copy.
    """

    item: RoadObject
    s_m: float
    t_m: float
    z_offset_m: float
    length_m: float | None
    width_m: float | None
    radius_m: float | None
    repeat: ObjectRepeat | None = None

    def polygons(self, road: RoadGeometry, origin: SurfacePoints, heading_rad: float) -> list[FloatArray]:
        """Return its outlines as (P, 2) corners in the map frame.

        Without outlines, the rectangle of length and width, or the circle of the radius; nothing if the
        object has no extent (ASAM OpenDRIVE 1.8, chapter "Objects").
        """
        if self.repeat is not None:
            return self._strip(road, self.repeat)
        if self.item.outlines:
            rings = [self._ring(road, outline, origin, heading_rad) for outline in self.item.outlines]
            return [ring for ring in rings if len(ring)]
        if self.length_m and self.width_m:
            local = 0.5 * np.array([[1, 1], [-1, 1], [-1, -1], [1, -1]]) * [self.length_m, self.width_m]
        elif self.radius_m:
            angle = np.linspace(0.0, 2.0 * np.pi, 32, endpoint=False)
            local = self.radius_m * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        else:
            return []
        return [_open_ring(_turned(local, origin, heading_rad))]

    def _ring(
        self, road: RoadGeometry, outline: Outline, origin: SurfacePoints, heading_rad: float
    ) -> FloatArray:
        if not outline.in_road_frame:
            return _open_ring(_turned(outline.corners[:, :2], origin, heading_rad))
        s = np.clip(outline.corners[:, 0] + self.s_m - self.item.s_m, 0.0, road.length_m)
        corners = road.point(s, outline.corners[:, 1] + self.t_m - self.item.t_m)
        return _open_ring(np.stack([corners.x_m, corners.y_m], axis=1))

    def _strip(self, road: RoadGeometry, repeat: ObjectRepeat) -> list[FloatArray]:
        """Return the outline of an object that is continuous along a stretch of road."""
        count = int(np.clip(np.ceil(repeat.length_m / _STRIP_STEP_M), 1, MAX_COPIES))
        share = np.linspace(0.0, 1.0, count + 1)
        s = np.clip(repeat.s_m + share * repeat.length_m, 0.0, road.length_m)
        t = _changed(repeat.t, self.item.t_m, share)
        width = _changed(repeat.width, self.item.width_m or 0.0, share)
        if not width.any():
            return []
        sides = [road.point(s, t + half * width) for half in (-0.5, 0.5)]
        right, left = (np.stack([points.x_m, points.y_m], axis=1) for points in sides)
        return [_open_ring(np.concatenate([right, left[::-1]]))]


def copies_asked(repeat: ObjectRepeat) -> int:
    """Return how many copies a repeat with a distance asks for, of which at most `MAX_COPIES` are made."""
    # Beyond a number that nothing needs the count is not exact, and the quotient may be infinite.
    return math.floor(min(max(repeat.length_m, 0.0) / repeat.distance_m, 1e12) + 1e-9) + 1


def _copies(item: RoadObject) -> Iterator[_Copy]:
    """Yield the copies of an object: itself, or what its repeats make of it, which replace it."""
    if not item.repeats:
        yield _Copy(item, item.s_m, item.t_m, item.z_offset_m, item.length_m, item.width_m, item.radius_m)
    for repeat in item.repeats:
        if repeat.distance_m <= 0.0:
            t_m, z_m = (
                float(_changed(change, own, np.zeros(1))[0])
                for change, own in ((repeat.t, item.t_m), (repeat.z_offset, item.z_offset_m))
            )
            yield _Copy(item, repeat.s_m, t_m, z_m, None, None, None, repeat)
            continue
        count = min(copies_asked(repeat), MAX_COPIES)
        along_m = repeat.distance_m * np.arange(count)
        share = np.asarray(along_m / max(repeat.length_m, repeat.distance_m), dtype=np.float64)
        columns = [
            _changed(change, np.nan if own is None else own, share).tolist()
            for change, own in (
                (repeat.t, item.t_m),
                (repeat.z_offset, item.z_offset_m),
                (repeat.length, item.length_m),
                (repeat.width, item.width_m),
                (repeat.radius, item.radius_m),
            )
        ]
        for s_m, t_m, z_m, *sizes in zip((repeat.s_m + along_m).tolist(), *columns, strict=True):
            length_m, width_m, radius_m = (None if np.isnan(size) else size for size in sizes)
            yield _Copy(item, s_m, t_m, z_m, length_m, width_m, radius_m)


def _changed(change: Change, own: float, share: FloatArray) -> FloatArray:
    """Return a quantity along a repeat; `own` is the object's own value, where the repeat has none."""
    start = own if change.start_m is None else change.start_m
    end = start if change.end_m is None else change.end_m
    return start + share * (end - start)


def _turned(local: FloatArray, origin: SurfacePoints, heading_rad: float) -> FloatArray:
    """Return points (P, 2) of an object's own frame in the map frame."""
    cos, sin = np.cos(heading_rad), np.sin(heading_rad)
    placed: FloatArray = local @ np.array([[cos, sin], [-sin, cos]]) + [float(origin.x_m), float(origin.y_m)]
    return placed


def _open_ring(corners: FloatArray) -> FloatArray:
    """Drop the last corner if it repeats the first."""
    if len(corners) > 1 and np.hypot(*(corners[0] - corners[-1])) < 1e-9:
        return corners[:-1]
    return corners
