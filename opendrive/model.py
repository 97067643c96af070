"""Records of an OpenDRIVE file, as read, in SI units and radians.

Nothing here is computed: positions, borders and topology are derived in the other modules. Ids are strings,
as in the standard. A piecewise cubic is an array of shape (K, 5) with the columns ``s, a, b, c, d``: from
``s`` on, the value is ``a + b ds + c ds^2 + d ds^3``. `extra` holds the XML text of elements that have no
record, such as user data. Clauses refer to ASAM OpenDRIVE 1.8.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields
from types import MappingProxyType
from typing import Generic, Literal, TypeAlias, TypeVar

import numpy as np

from opendrive.arrays import FloatArray, read_only
from opendrive.errors import MapWarning

ContactPoint: TypeAlias = Literal["start", "end"]
TrafficRule: TypeAlias = Literal["RHT", "LHT"]
_Value = TypeVar("_Value")
NO_HEIGHTS = read_only(np.empty((0, 3)))


class Deferred(Generic[_Value]):
    """A value that is made when first asked for, and pickled as what it is then."""

    __slots__ = ("_make", "_value")

    def __init__(self, make: Callable[[], _Value]) -> None:
        """Defer a call."""
        self._make: Callable[[], _Value] | None = make

    @classmethod
    def of(cls, value: _Value) -> "Deferred[_Value]":
        """Return a value that is there already."""
        deferred = cls(lambda: value)
        deferred()
        return deferred

    def __call__(self) -> _Value:
        """Return the value."""
        if self._make is not None:
            self._value = self._make()
            self._make = None
        return self._value

    def __reduce__(self) -> "tuple[Callable[[_Value], Deferred[_Value]], tuple[_Value]]":
        """Pickle the value."""
        return Deferred.of, (self(),)


@dataclass(frozen=True, slots=True)
class GeoOffset:
    """Offset between the map frame and the georeferenced frame; never applied to positions."""

    x_m: float
    y_m: float
    z_m: float
    heading_rad: float


@dataclass(frozen=True, slots=True)
class Header:
    """File header (chapter "Header"); `extra` holds its other elements, such as the licence."""

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
    extra: tuple[str, ...] = ()


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


@dataclass(frozen=True, slots=True)
class RoadMarkLine:
    """One line of a road mark (chapter "Lanes").

    Attributes:
        s_offset_m: where it starts: from the start of the mark, or of the lane section if explicit.
        t_offset_m: its lateral offset from the lane's border.
        length_m: length of the painted part.
        space_m: length of the gap; 0 for explicit lines.
        width_m: width; None when absent.
        color: colour name; empty when absent.
        rule: ``no passing``, ``caution`` or ``none``; empty when absent.
    """

    s_offset_m: float
    t_offset_m: float
    length_m: float
    space_m: float
    width_m: float | None
    color: str
    rule: str


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
        material: name of the material.
        height_m: thickness; None when absent.
        pattern: name of the mark's own type, empty when absent; `lines` make it up.
        pattern_width_m: accumulated width of that type; None when absent.
        lines: repeated lines of that type.
        explicit_lines: single lines, not repeated.
        sway: cubics of the lateral offset, rows ``s, a, b, c, d``; s from the start of the mark.
    """

    s_offset_m: float
    type: str
    weight: str
    color: str
    width_m: float | None
    lane_change: str | None
    material: str = "standard"
    height_m: float | None = None
    pattern: str = ""
    pattern_width_m: float | None = None
    lines: tuple[RoadMarkLine, ...] = ()
    explicit_lines: tuple[RoadMarkLine, ...] = ()
    sway: tuple[tuple[float, ...], ...] = ()


@dataclass(frozen=True, slots=True)
class LaneSpeed:
    """Speed limit of a lane from `s_offset_m` on (chapter "Lanes"); `speed_mps` is None for ``no limit``."""

    s_offset_m: float
    speed_mps: float | None


@dataclass(frozen=True, slots=True)
class LaneMaterial:
    """Material of a lane from `s_offset_m` on (chapter "Lanes"); `roughness` is None when absent."""

    s_offset_m: float
    surface: str
    friction: float
    roughness: float | None


@dataclass(frozen=True, slots=True)
class LaneAccess:
    """Who may use a lane from `s_offset_m` on (chapter "Lanes").

    Attributes:
        s_offset_m: start, from the start of the lane section.
        rule: ``allow`` or ``deny``; empty before 1.5, where the restriction names who may use the lane.
        restriction: such as ``bus``.
        restrictions: further types named by child elements (since 1.8).
    """

    s_offset_m: float
    rule: str
    restriction: str
    restrictions: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LaneRule:
    """Rule of a lane from `s_offset_m` on, as free text (chapter "Lanes")."""

    s_offset_m: float
    value: str


@dataclass(frozen=True, slots=True, eq=False)
class LaneDetails:
    """What a lane has besides its shape and links (chapter "Lanes").

    Attributes:
        road_marks: marks on the outer border, by s.
        speeds: speed limits, by s.
        materials: materials, by s.
        accesses: restrictions of access, by s.
        rules: rules, by s.
        flags: other attributes of the lane (since 1.8), such as ``roadWorks``, with their values.
        extra: other elements, such as user data.
    """

    road_marks: tuple[RoadMark, ...] = ()
    speeds: tuple[LaneSpeed, ...] = ()
    materials: tuple[LaneMaterial, ...] = ()
    accesses: tuple[LaneAccess, ...] = ()
    rules: tuple[LaneRule, ...] = ()
    flags: tuple[tuple[str, str], ...] = ()
    extra: tuple[str, ...] = ()


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
        direction: ``standard``, ``reversed`` or ``both`` (since 1.8).
        height: (K, 3) rows ``s, inner, outer``: height of the lane's borders above the road.
        details: everything else, read when first asked for.
    """

    id: int
    type: str
    level: bool
    predecessors: tuple[int, ...]
    successors: tuple[int, ...]
    width: FloatArray
    border: FloatArray
    direction: str = "standard"
    height: FloatArray = field(default_factory=lambda: NO_HEIGHTS)
    details: Deferred[LaneDetails] = field(default_factory=lambda: Deferred.of(LaneDetails()))

    @property
    def road_marks(self) -> tuple[RoadMark, ...]:
        """Marks on the outer border, by s."""
        return self.details().road_marks

    @property
    def speeds(self) -> tuple[LaneSpeed, ...]:
        """Speed limits, by s."""
        return self.details().speeds

    @property
    def materials(self) -> tuple[LaneMaterial, ...]:
        """Materials, by s."""
        return self.details().materials

    @property
    def accesses(self) -> tuple[LaneAccess, ...]:
        """Restrictions of access, by s."""
        return self.details().accesses

    @property
    def rules(self) -> tuple[LaneRule, ...]:
        """Rules, by s."""
        return self.details().rules

    @property
    def flags(self) -> tuple[tuple[str, str], ...]:
        """Other attributes (since 1.8), such as ``roadWorks``, with their values."""
        return self.details().flags

    @property
    def extra(self) -> tuple[str, ...]:
        """Other elements, such as user data."""
        return self.details().extra


@dataclass(frozen=True, slots=True, eq=False)
class LaneSection:
    """Lanes from `s_m` to the next section (chapter "Lanes"), from the leftmost to the rightmost."""

    s_m: float
    single_side: bool
    lanes: tuple[Lane, ...]
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class LaneRange:
    """Lanes, by id, that a signal or object applies to (chapter "Signals"); both ends included."""

    from_lane: int
    to_lane: int


@dataclass(frozen=True, slots=True)
class SignalDependency:
    """Signal that is controlled by the one it is listed in (chapter "Signals")."""

    signal_id: str
    type: str


@dataclass(frozen=True, slots=True)
class SignalLink:
    """Object or signal that a signal belongs with (chapter "Signals")."""

    element_type: str
    element_id: str
    type: str


@dataclass(frozen=True, slots=True)
class SignalPosition:
    """Where a signal physically stands, if not where it applies (chapter "Signals").

    Attributes:
        road_id: road whose s, t and height above it are meant; empty for x, y, z of the map frame.
        position_m: s, t, height or x, y, z.
        heading_rad: heading, relative to the road's if there is one.
        pitch_rad: pitch.
        roll_rad: roll.
    """

    road_id: str
    position_m: tuple[float, float, float]
    heading_rad: float
    pitch_rad: float
    roll_rad: float


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
        pitch_rad: pitch.
        roll_rad: roll.
        length_m: depth of the sign; None when absent.
        country_revision: year of the catalogue; empty when absent.
        dependencies: signals it controls.
        links: objects and signals it belongs with.
        position: where it physically stands, if elsewhere.
        extra: other elements, such as user data and semantics.
        attributes: further attributes, with their values.
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
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    length_m: float | None = None
    country_revision: str = ""
    dependencies: tuple[SignalDependency, ...] = ()
    links: tuple[SignalLink, ...] = ()
    position: SignalPosition | None = None
    extra: tuple[str, ...] = ()
    attributes: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class SignalReference:
    """Reuse on this road of a signal placed on another one (chapter "Signals")."""

    signal_id: str
    s_m: float
    t_m: float
    orientation: str
    validity: tuple[LaneRange, ...]
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True, eq=False)
class Outline:
    """Outline of an object (chapter "Objects").

    Attributes:
        in_road_frame: corners are ``s, t, dz`` if true, else ``u, v, z`` in the object's own frame.
        corners: (K, 3) corners, metres.
        closed: whether the last corner is joined to the first.
        heights_m: (K,) height of the object at each corner.
        corner_ids: (K,) ids of the corners; empty where absent.
        id: id of the outline; empty when absent.
        attributes: further attributes, such as ``fillType``, ``laneType`` and ``outer``, with their values.
    """

    in_road_frame: bool
    corners: FloatArray
    closed: bool
    heights_m: FloatArray
    corner_ids: tuple[str, ...] = ()
    id: str = ""
    attributes: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class Change:
    """A quantity that changes linearly along a repeat; None where the object's own value holds."""

    start_m: float | None
    end_m: float | None


@dataclass(frozen=True, slots=True)
class ObjectRepeat:
    """Repetition of an object along the road (chapter "Objects").

    Attributes:
        s_m: where it starts.
        length_m: its length along the road.
        distance_m: distance between two copies; 0 for one continuous object.
        t: lateral position.
        z_offset: height above the road.
        width: width.
        height: height.
        length: length of one copy.
        radius: radius.
        detached: whether the copies do not follow the reference line (since 1.8).
    """

    s_m: float
    length_m: float
    distance_m: float
    t: Change
    z_offset: Change
    width: Change
    height: Change
    length: Change
    radius: Change
    detached: bool = False


@dataclass(frozen=True, slots=True)
class ObjectMarking:
    """Painted line along a side of an object, or along some of its corners (chapter "Objects")."""

    side: str
    color: str
    weight: str
    width_m: float | None
    z_offset_m: float
    line_length_m: float
    space_length_m: float
    start_offset_m: float
    stop_offset_m: float
    corner_ids: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ObjectBorder:
    """Frame along an outline of an object (chapter "Objects")."""

    outline_id: str
    type: str
    width_m: float
    whole_outline: bool
    corner_ids: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class ParkingSpace:
    """Who may park in an object of type ``parkingSpace``, and under which restrictions."""

    access: str
    restrictions: str


@dataclass(frozen=True, slots=True, eq=False)
class RoadObject:
    """Object beside or on the road (chapter "Objects"): crosswalk, pole, parking space and so on.

    Sizes are None when absent. `heading_rad` is relative to the road's heading. `valid_length_m` is the
    stretch of road that the object applies to. `attributes` holds further attributes, with their values.
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
    pitch_rad: float = 0.0
    roll_rad: float = 0.0
    dynamic: bool = False
    perpendicular_to_road: bool = False
    valid_length_m: float | None = None
    repeats: tuple[ObjectRepeat, ...] = ()
    markings: tuple[ObjectMarking, ...] = ()
    borders: tuple[ObjectBorder, ...] = ()
    materials: tuple[LaneMaterial, ...] = ()
    parking_space: ParkingSpace | None = None
    extra: tuple[str, ...] = ()
    attributes: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, slots=True)
class ObjectReference:
    """Use on this road of an object placed on another one (chapter "Objects")."""

    object_id: str
    s_m: float
    t_m: float
    z_offset_m: float | None
    valid_length_m: float | None
    orientation: str
    validity: tuple[LaneRange, ...]
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Structure:
    """Bridge or tunnel (chapter "Objects").

    Attributes:
        id: unique id.
        name: free name.
        type: such as ``concrete`` or ``underpass``.
        s_m: where it starts.
        length_m: its length along the road.
        lighting: artificial lighting of a tunnel, 0 to 1; None when absent.
        daylight: daylight in a tunnel, 0 to 1; None when absent.
        validity: lanes it applies to; empty means all.
        extra: other elements.
    """

    id: str
    name: str
    type: str
    s_m: float
    length_m: float
    lighting: float | None
    daylight: float | None
    validity: tuple[LaneRange, ...]
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Track:
    """Place and direction of a railroad track at a switch (chapter "Railroads")."""

    road_id: str
    s_m: float
    direction: str


@dataclass(frozen=True, slots=True)
class Switch:
    """Railroad switch (chapter "Railroads"); `partner_id` is empty if it has none."""

    id: str
    name: str
    position: str
    main_track: Track
    side_track: Track
    partner_id: str
    partner_name: str
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class PlatformSegment:
    """Stretch of road that a platform lies beside (chapter "Railroads")."""

    road_id: str
    s_start_m: float
    s_end_m: float
    side: str


@dataclass(frozen=True, slots=True)
class Platform:
    """Platform of a station (chapter "Railroads")."""

    id: str
    name: str
    segments: tuple[PlatformSegment, ...]


@dataclass(frozen=True, slots=True)
class Station:
    """Railroad, tram or bus station (chapter "Railroads")."""

    id: str
    name: str
    type: str
    platforms: tuple[Platform, ...]
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Control:
    """Signal of a controller (chapter "Signals")."""

    signal_id: str
    type: str


@dataclass(frozen=True, slots=True)
class Controller:
    """Signals that act together (chapter "Signals"); `sequence` is None when absent."""

    id: str
    name: str
    sequence: int | None
    controls: tuple[Control, ...]
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class Connection:
    """One way through a junction (chapter "Junctions").

    Attributes:
        id: unique within the junction.
        incoming_road: road that leads into the junction.
        connecting_road: road inside the junction; for a direct junction, the linked road.
        contact_point: the end of the connecting (or linked) road that touches the incoming road.
        lane_links: pairs (lane of the incoming road, lane of the connecting road).
        type: ``default`` or ``virtual``.
        is_linked: whether the incoming road meets `connecting_road` itself, as in direct junctions.
        predecessor: where a virtual connection leaves the main road.
        successor: where a virtual connection ends.
        overlap_zones_m: length of the overlap of each lane link (direct junctions); empty when all are 0.
    """

    id: str
    incoming_road: str
    connecting_road: str
    contact_point: ContactPoint
    lane_links: tuple[tuple[int, int], ...]
    type: str = "default"
    is_linked: bool = False
    predecessor: RoadLink | None = None
    successor: RoadLink | None = None
    overlap_zones_m: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class JunctionPriority:
    """Connecting road `high` has right of way over `low` (chapter "Junctions")."""

    high: str
    low: str


@dataclass(frozen=True, slots=True)
class JunctionController:
    """Controller that acts in a junction (chapter "Junctions"); `sequence` is None when absent."""

    controller_id: str
    type: str
    sequence: int | None


@dataclass(frozen=True, slots=True)
class CrossingRoad:
    """Stretch of a road that crosses others without connection (crossing junctions, since 1.8)."""

    id: str
    road_id: str
    s_start_m: float
    s_end_m: float


@dataclass(frozen=True, slots=True)
class CrossPath:
    """Way for pedestrians through a junction (since 1.8).

    `start` and `end` each are s and the lanes ``from, to`` of the road that is met there.
    """

    id: str
    crossing_road: str
    road_at_start: str
    road_at_end: str
    start: tuple[float, int, int]
    end: tuple[float, int, int]


@dataclass(frozen=True, slots=True)
class Junction:
    """Junction (chapter "Junctions").

    Attributes:
        id: unique id.
        name: free name.
        type: ``default``, ``direct``, ``virtual`` or ``crossing``.
        connections: ways through it.
        priorities: which connecting road has right of way.
        controllers: controllers that act in it.
        main_road: road that a virtual junction lies on; empty for the others.
        orientation: ``+``, ``-`` or ``none``: direction of the main road it is valid for.
        s_start_m: start of a virtual junction on the main road; None for the others.
        s_end_m: its end.
        crossing_roads: roads of a crossing junction.
        cross_paths: ways for pedestrians.
        extra: other elements, such as boundary, elevation grid and user data.
    """

    id: str
    name: str
    type: str
    connections: tuple[Connection, ...]
    priorities: tuple[JunctionPriority, ...] = ()
    controllers: tuple[JunctionController, ...] = ()
    main_road: str = ""
    orientation: str = ""
    s_start_m: float | None = None
    s_end_m: float | None = None
    crossing_roads: tuple[CrossingRoad, ...] = ()
    cross_paths: tuple[CrossPath, ...] = ()
    extra: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class JunctionGroup:
    """Junctions that belong together, such as those of a roundabout (chapter "Junctions")."""

    id: str
    name: str
    type: str
    junction_ids: tuple[str, ...]
    extra: tuple[str, ...] = ()


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

    @property
    def signals(self) -> tuple[Signal, ...]:
        """Signals placed on the road."""
        return self.details().signals

    @property
    def signal_references(self) -> tuple[SignalReference, ...]:
        """Signals of other roads that also apply here."""
        return self.details().signal_references

    @property
    def objects(self) -> tuple[RoadObject, ...]:
        """Objects on or beside the road."""
        return self.details().objects

    @property
    def object_references(self) -> tuple[ObjectReference, ...]:
        """Objects of other roads that also apply here."""
        return self.details().object_references

    @property
    def bridges(self) -> tuple[Structure, ...]:
        """Bridges."""
        return self.details().bridges

    @property
    def tunnels(self) -> tuple[Structure, ...]:
        """Tunnels."""
        return self.details().tunnels

    @property
    def switches(self) -> tuple[Switch, ...]:
        """Railroad switches."""
        return self.details().switches

    @property
    def extra(self) -> tuple[str, ...]:
        """Other elements, such as surfaces and user data."""
        return self.details().extra

    @property
    def attributes(self) -> tuple[tuple[str, str], ...]:
        """Further attributes, with their values."""
        return self.details().attributes


@dataclass(frozen=True, slots=True, eq=False)
class MapModel:
    """A whole file.

    Attributes:
        header: its header.
        roads: roads by id.
        junctions: junctions by id.
        noted: the defects that were tolerated in reading; to ask for them reads everything.
        controllers: controllers of signals, by id.
        junction_groups: groups of junctions.
        stations: stations.
        extra: other elements, such as user data.
    """

    header: Header
    roads: Mapping[str, Road]
    junctions: Mapping[str, Junction]
    noted: Deferred[tuple[MapWarning, ...]]
    controllers: Mapping[str, Controller] = field(default_factory=dict)
    junction_groups: tuple[JunctionGroup, ...] = ()
    stations: tuple[Station, ...] = ()
    extra: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        """Protect the mappings against writing."""
        for name in ("roads", "junctions", "controllers"):
            if isinstance(value := getattr(self, name), dict):
                object.__setattr__(self, name, MappingProxyType(dict(value)))

    @property
    def warnings(self) -> tuple[MapWarning, ...]:
        """The defects that were tolerated in reading."""
        return self.noted()

    def __reduce__(self) -> tuple[type["MapModel"], tuple[object, ...]]:
        """Pickle the mappings as plain dictionaries."""
        values = (getattr(self, item.name) for item in fields(self))
        return MapModel, tuple(dict(value) if isinstance(value, Mapping) else value for value in values)
