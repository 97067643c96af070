"""Junctions and their groups (chapter "Junctions")."""

from dataclasses import dataclass

from opendrive.model.roads import ContactPoint, RoadLink


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
