"""Records of an OpenDRIVE file, as read, in SI units and radians.

Nothing here is computed: positions, borders and topology are derived in the other modules. Ids are strings,
as in the standard. A piecewise cubic is an array of shape (K, 5) with the columns ``s, a, b, c, d``: from
``s`` on, the value is ``a + b ds + c ds^2 + d ds^3``. Clauses refer to ASAM OpenDRIVE 1.8.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, TypeAlias

from opendrive.arrays import FloatArray
from opendrive.errors import MapWarning

ContactPoint: TypeAlias = Literal["start", "end"]
TrafficRule: TypeAlias = Literal["RHT", "LHT"]


@dataclass(frozen=True, slots=True)
class GeoOffset:
    """Offset between the map frame and the georeferenced frame; never applied to positions."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class Header:
    """File header (chapter "Header")."""

    rev_major: int
    rev_minor: int
    name: str
    version: str
    date: str
    vendor: str
    north_m: float | None
    south_m: float | None
    east_m: float | None
    west_m: float | None
    geo_reference: str
    offset: GeoOffset | None


@dataclass(frozen=True, slots=True)
class Line:
    """Straight reference line (chapter "Geometry")."""


@dataclass(frozen=True, slots=True)
class Arc:
    """Reference line of constant curvature (chapter "Geometry"); positive bends left."""

    curvature_per_m: float


@dataclass(frozen=True, slots=True)
class Spiral:
    """Clothoid: the curvature changes linearly with s (chapter "Geometry")."""

    curvature_start_per_m: float
    curvature_end_per_m: float


@dataclass(frozen=True, slots=True)
class Poly3:
    """Cubic v(u) in the local frame; s is its arc length (deprecated since 1.6)."""

    coefficients: tuple[float, float, float, float]


@dataclass(frozen=True, slots=True)
class ParamPoly3:
    """Cubics u(p), v(p) in the local frame (chapter "Geometry"); s is the arc length, p is not.

    Attributes:
        u: coefficients a, b, c, d of u(p).
        v: coefficients a, b, c, d of v(p).
        normalized: p runs over [0, 1] if true, else over [0, length].
    """

    u: tuple[float, float, float, float]
    v: tuple[float, float, float, float]
    normalized: bool


Shape: TypeAlias = Line | Arc | Spiral | Poly3 | ParamPoly3


@dataclass(frozen=True, slots=True)
class Geometry:
    """One piece of the reference line: its start pose in the map frame, its length and shape."""

    s_m: float
    x_m: float
    y_m: float
    heading_rad: float
    length_m: float
    shape: Shape


@dataclass(frozen=True, slots=True)
class RoadLink:
    """What a road's start or end is connected to (chapter "Roads")."""

    element_type: str
    element_id: str
    contact_point: ContactPoint | None


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


@dataclass(frozen=True, slots=True)
class RoadMark:
    """Road mark on the outer border of a lane, or on the centre line (chapter "Lanes").

    Attributes:
        s_offset_m: start, from the start of the lane section.
        type: such as ``solid`` or ``broken``; ``none`` if nothing is painted.
        weight: ``standard`` or ``bold``.
        color: colour name.
        width_m: width; None when absent.
        lane_change: ``increase``, ``decrease``, ``both``, ``none``, or None when absent.
    """

    s_offset_m: float
    type: str
    weight: str
    color: str
    width_m: float | None
    lane_change: str | None


@dataclass(frozen=True, slots=True)
class LaneSpeed:
    """Speed limit of a lane from `s_offset_m` on (chapter "Lanes"); `speed_mps` is None for ``no limit``."""

    s_offset_m: float
    speed_mps: float | None


@dataclass(frozen=True, slots=True, eq=False)
class Lane:
    """One lane of a lane section (chapter "Lanes").

    Attributes:
        id: positive left of the centre lane, negative right of it, 0 for the centre lane.
        type: such as ``driving`` or ``sidewalk``.
        level: keep the lane horizontal, without superelevation.
        predecessors: ids of the linked lanes at the start of the section.
        successors: ids of the linked lanes at its end.
        width: (K, 5) cubics of the width; s counts from the start of the section.
        border: (K, 5) cubics of the t coordinate of the outer border; used only without `width`.
        height: (K, 3) rows ``s, inner, outer``: height of the lane's borders above the road.
        road_marks: marks on the outer border, by s.
        speeds: speed limits, by s.
        direction: ``standard``, ``reversed`` or ``both`` (since 1.8).
    """

    id: int
    type: str
    level: bool
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    width: FloatArray
    border: FloatArray
    height: FloatArray
    road_marks: tuple[RoadMark, ...]
    speeds: tuple[LaneSpeed, ...]
    direction: str = "standard"


@dataclass(frozen=True, slots=True, eq=False)
class LaneSection:
    """Lanes from `s_m` to the next section (chapter "Lanes"), from the leftmost to the rightmost."""

    s_m: float
    single_side: bool
    lanes: tuple[Lane, ...]


@dataclass(frozen=True, slots=True)
class LaneRange:
    """Lanes, by id, that a signal or object applies to (chapter "Signals"); both ends included."""

    from_lane: int
    to_lane: int


@dataclass(frozen=True, slots=True)
class Signal:
    """Traffic sign or light (chapter "Signals").

    Attributes:
        id: unique id.
        name: free name.
        s_m: position along the road.
        t_m: lateral position.
        z_offset_m: height above the road.
        heading_offset_rad: heading relative to the road's (to its opposite, for orientation ``-``).
        type: code from the country's catalogue.
        subtype: code from the country's catalogue.
        country: country code; empty when absent.
        value: value of the sign, such as its speed; None when absent.
        unit: unit of `value`; empty when absent.
        text: additional text.
        dynamic: whether its state changes (a traffic light).
        orientation: ``+`` valid along s, ``-`` valid against s, ``none`` both.
        height_m: height of the sign; None when absent.
        width_m: width of the sign; None when absent.
        validity: lanes it applies to; empty means all.
    """

    id: str
    name: str
    s_m: float
    t_m: float
    z_offset_m: float
    heading_offset_rad: float
    type: str
    subtype: str
    country: str
    value: float | None
    unit: str
    text: str
    dynamic: bool
    orientation: str
    height_m: float | None
    width_m: float | None
    validity: tuple[LaneRange, ...]


@dataclass(frozen=True, slots=True)
class SignalReference:
    """Reuse on this road of a signal placed on another one (chapter "Signals")."""

    signal_id: str
    s_m: float
    t_m: float
    orientation: str
    validity: tuple[LaneRange, ...]


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Outline of an object (chapter "Objects").

    Attributes:
        in_road_frame: corners are ``s, t, dz`` if true, else ``u, v, z`` in the object's own frame.
        corners: (K, 3) corners, metres.
        closed: whether the last corner is joined to the first.
    """

    in_road_frame: bool
    corners: FloatArray
    closed: bool


@dataclass(frozen=True, slots=True, eq=False)
class RoadObject:
    """Object beside or on the road (chapter "Objects"): crosswalk, pole, parking space and so on.

    Sizes are None when absent. `heading_rad` is relative to the road's heading.
    """

    id: str
    name: str
    type: str
    subtype: str
    s_m: float
    t_m: float
    z_offset_m: float
    heading_rad: float
    orientation: str
    length_m: float | None
    width_m: float | None
    height_m: float | None
    radius_m: float | None
    outlines: tuple[Outline, ...]
    validity: tuple[LaneRange, ...]


@dataclass(frozen=True, slots=True)
class Connection:
    """One way through a junction (chapter "Junctions").

    Attributes:
        id: unique within the junction.
        incoming_road: road that leads into the junction.
        connecting_road: road inside the junction; for a direct junction, the linked road.
        contact_point: the end of the connecting (or linked) road that touches the incoming road.
        lane_links: pairs (lane of the incoming road, lane of the connecting road).
    """

    id: str
    incoming_road: str
    connecting_road: str
    contact_point: ContactPoint
    lane_links: tuple[tuple[int, int], ...]


@dataclass(frozen=True, slots=True)
class Junction:
    """Junction (chapter "Junctions"); `type` is ``default``, ``direct``, ``virtual`` or ``crossing``."""

    id: str
    name: str
    type: str
    connections: tuple[Connection, ...]


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
        signals: signals placed on the road.
        signal_references: signals of other roads that also apply here.
        objects: objects.
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
    signals: tuple[Signal, ...]
    signal_references: tuple[SignalReference, ...]
    objects: tuple[RoadObject, ...]


@dataclass(frozen=True, slots=True, eq=False)
class MapModel:
    """A whole file: header, roads and junctions by id, and the defects that were tolerated."""

    header: Header
    roads: Mapping[str, Road]
    junctions: Mapping[str, Junction]
    warnings: tuple[MapWarning, ...]

    def __post_init__(self) -> None:
        """Protect the mappings against writing."""
        object.__setattr__(self, "roads", MappingProxyType(dict(self.roads)))
        object.__setattr__(self, "junctions", MappingProxyType(dict(self.junctions)))

    def __reduce__(self) -> tuple[type["MapModel"], tuple[object, ...]]:
        """Pickle the mappings as plain dictionaries."""
        return MapModel, (self.header, dict(self.roads), dict(self.junctions), self.warnings)
