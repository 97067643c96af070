"""Objects, bridges and tunnels (chapter "Objects")."""

from dataclasses import dataclass

from opendrive.arrays import FloatArray
from opendrive.model.lanes import LaneMaterial
from opendrive.model.signals import LaneRange


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
