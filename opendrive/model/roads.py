"""Roads (chapter "Roads")."""

from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from opendrive.arrays import FloatArray
from opendrive.model.curves import Geometry
from opendrive.model.deferred import Deferred, Detail
from opendrive.model.lanes import LaneSection
from opendrive.model.objects import ObjectReference, RoadObject, Structure
from opendrive.model.railroads import Switch
from opendrive.model.signals import Signal, SignalReference

ContactPoint: TypeAlias = Literal["start", "end"]


TrafficRule: TypeAlias = Literal["RHT", "LHT"]


@dataclass(frozen=True, slots=True)
class RoadLink:
    """What a road's start or end is connected to (chapter "Roads").

    Attributes:
        element_type: ``road`` or ``junction``.
        element_id: its id.
        contact_point: the end of the other road that is touched; None for junctions.
        s_m: where the road of a virtual junction is met; None for the others.
        direction: ``+`` or ``-``, the direction in which it is met there; empty for the others.
    """

    element_type: str
    element_id: str
    contact_point: ContactPoint | None
    s_m: float | None = None
    direction: str = ""


@dataclass(frozen=True, slots=True)
class RoadType:
    """Road type from `s_m` on (chapter "Roads"), with its speed limit.

    Attributes:
        s_m: where it starts.
        type: such as ``town`` or ``motorway``.
        country: country code, empty when absent.
        speed_mps: limit; None when none is given, or ``no limit`` or ``undefined`` is.
    """

    s_m: float
    type: str
    country: str
    speed_mps: float | None


@dataclass(frozen=True, slots=True, eq=False)
class RoadDetails:
    """What stands on and beside a road (chapters "Objects", "Signals" and "Railroads").

    Attributes:
        signals: signals placed on the road.
        signal_references: signals of other roads that also apply here.
        objects: objects.
        object_references: objects of other roads that also apply here.
        bridges: bridges.
        tunnels: tunnels.
        switches: railroad switches.
        extra: other elements, such as surfaces and user data.
        attributes: further attributes of the road, with their values.
    """

    signals: tuple[Signal, ...] = ()
    signal_references: tuple[SignalReference, ...] = ()
    objects: tuple[RoadObject, ...] = ()
    object_references: tuple[ObjectReference, ...] = ()
    bridges: tuple[Structure, ...] = ()
    tunnels: tuple[Structure, ...] = ()
    switches: tuple[Switch, ...] = ()
    extra: tuple[str, ...] = ()
    attributes: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Road:
    """One road (chapter "Roads").

    Attributes:
        id: unique id.
        name: free name.
        length_m: length of the reference line.
        junction_id: junction that the road is part of, or None.
        rule: right-hand or left-hand traffic.
        predecessor: link of the start.
        successor: link of the end.
        geometries: pieces of the reference line, by s.
        elevation: (K, 5) cubics of the height.
        superelevation: (K, 5) cubics of the roll about the reference line, rad.
        crossfall_left: (K, 5) cubics of the slope left of the reference line, rad (removed in 1.6).
        crossfall_right: (K, 5) cubics of the slope right of it, rad.
        shape: (K, 6) rows ``s, t, a, b, c, d``: height over t.
        lane_offset: (K, 5) cubics of the t coordinate of the centre lane.
        types: road types, by s.
        sections: lane sections, by s.
        details: everything else, read when first asked for.
    """

    id: str
    name: str
    length_m: float
    junction_id: str | None
    rule: TrafficRule
    predecessor: RoadLink | None
    successor: RoadLink | None
    geometries: tuple[Geometry, ...]
    elevation: FloatArray
    superelevation: FloatArray
    crossfall_left: FloatArray
    crossfall_right: FloatArray
    shape: FloatArray
    lane_offset: FloatArray
    types: tuple[RoadType, ...]
    sections: tuple[LaneSection, ...]
    details: Deferred[RoadDetails] = field(default_factory=lambda: Deferred.of(RoadDetails()))

    signals = Detail[tuple[Signal, ...]]()
    signal_references = Detail[tuple[SignalReference, ...]]()
    objects = Detail[tuple[RoadObject, ...]]()
    object_references = Detail[tuple[ObjectReference, ...]]()
    bridges = Detail[tuple[Structure, ...]]()
    tunnels = Detail[tuple[Structure, ...]]()
    switches = Detail[tuple[Switch, ...]]()
    extra = Detail[tuple[str, ...]]()
    attributes = Detail[tuple[tuple[str, str], ...]]()
