"""Junctions and their groups (chapter "Junctions")."""

from dataclasses import dataclass, replace

from opendrive import model
from opendrive.errors import WarningKind
from opendrive.xml.fields import child, children_of, each, integer, number, row, text
from opendrive.xml.roads import CONTACT_POINT, LINK
from opendrive.xml.tables import REQUIRED, REST, Field, Table
from opendrive.xml.values import Element, Values, children, children_but

JUNCTION_TYPES = ("default", "direct", "virtual", "crossing")


@dataclass(slots=True)
class _ConnectionElement:
    """Connection as it stands in the file, but for its lane links."""

    incoming_road: str | None
    linked_road: str | None
    connecting_road: str | None
    contact_point: model.ContactPoint | None
    type: str
    predecessor: model.RoadLink | None
    successor: model.RoadLink | None
    id: str


_CONNECTION = Table(
    _ConnectionElement,
    id=text("id"),
    type=text("type", "default", omitted="default"),
    contact_point=CONTACT_POINT,
    incoming_road=text("incomingRoad", None),
    linked_road=text("linkedRoad", None),
    connecting_road=text("connectingRoad", None),
    predecessor=child("predecessor", LINK),
    successor=child("successor", LINK),
)
_LANE_LINKS = each(
    "laneLink", row(integer("from"), integer("to"), number("overlapZone", 0.0).lenient(), order=(1, 2, 0))
)


def _read_connection(values: Values, element: Element) -> model.Connection | None:
    """Return a connection; None, with a warning, if it does not say what it connects."""
    raw = _CONNECTION.read(values, element)
    incoming, contact_point = raw.incoming_road, raw.contact_point
    connecting = raw.linked_road if raw.connecting_road is None else raw.connecting_road
    kind = raw.type or "default"
    if kind == "virtual":
        if incoming is None and raw.predecessor is not None:
            incoming = raw.predecessor.element_id
        contact_point = contact_point or "start"
    if incoming is None or connecting is None or contact_point is None:
        message = "connection without incomingRoad, connectingRoad or contactPoint; left out"
        values.warn(WarningKind.LINK, element, message)
        values.left_out.add(element)
        return None
    links = _LANE_LINKS.read(values, element)
    overlaps = tuple(overlap for _, _, overlap in links)
    return model.Connection(
        id=raw.id,
        incoming_road=incoming,
        connecting_road=connecting,
        contact_point=contact_point,
        lane_links=tuple((from_lane, to_lane) for from_lane, to_lane, _ in links),
        type=kind,
        is_linked=raw.connecting_road is None,
        predecessor=raw.predecessor,
        successor=raw.successor,
        overlap_zones_m=overlaps if any(overlaps) else (),
    )


def _write_connection(element: Element, connection: model.Connection) -> None:
    road = connection.connecting_road
    raw = _ConnectionElement(
        incoming_road=connection.incoming_road,
        linked_road=road if connection.is_linked else None,
        connecting_road=None if connection.is_linked else road,
        contact_point=connection.contact_point,
        type=connection.type,
        predecessor=connection.predecessor,
        successor=connection.successor,
        id=connection.id,
    )
    _CONNECTION.write(element, raw)
    overlaps = connection.overlap_zones_m or (None,) * len(connection.lane_links)
    links = zip(connection.lane_links, overlaps, strict=True)
    _LANE_LINKS.write(element, tuple((*lanes, overlap) for lanes, overlap in links))


def _unread(values: Values, element: Element) -> list[Element]:
    """Return what is kept, but not read, of connections: their other children, or all of one left out."""
    connections = children(element, "connection")
    parts = [
        part
        for connection in connections
        if connection not in values.left_out
        for part in children_but(connection, (*_CONNECTION.tags, *_LANE_LINKS.tags))
    ]
    return parts + [connection for connection in connections if connection in values.left_out]


_CONNECTIONS = replace(
    children_of("connection", Field(_read_connection, _write_connection)).then(
        lambda connections: tuple(connection for connection in connections if connection is not None)
    ),
    leftovers=_unread,
)


def _known_type(values: Values, element: Element, name: str, text: str) -> str:
    kind = text or "default"
    if kind in JUNCTION_TYPES:
        return kind
    values.warn(WarningKind.UNKNOWN_VALUE, element, f"junction of type {kind!r:.40}; read as default")
    return "default"


_END = row(number("s"), integer("from"), integer("to"), order=(0, 2, 1))
"""Where a way for pedestrians meets a road."""

JUNCTION = Table(
    model.Junction,
    name=text("name"),
    type=text("type", "default", convert=_known_type),
    main_road=text("mainRoad"),
    orientation=text("orientation"),
    s_start_m=number("sStart", None).lenient(),
    s_end_m=number("sEnd", None).lenient(),
    id=text("id", REQUIRED),
    connections=_CONNECTIONS,
    priorities=each("priority", Table(model.JunctionPriority, high=text("high"), low=text("low"))),
    controllers=each(
        "controller",
        Table(
            model.JunctionController,
            type=text("type"),
            sequence=integer("sequence", None).lenient(),
            controller_id=text("id", REQUIRED),
        ),
    ),
    crossing_roads=each(
        "roadSection",
        Table(
            model.CrossingRoad,
            id=text("id"),
            s_start_m=number("sStart"),
            s_end_m=number("sEnd"),
            road_id=text("roadId", REQUIRED),
        ),
    ),
    cross_paths=each(
        "crossPath",
        Table(
            model.CrossPath,
            id=text("id", REQUIRED),
            crossing_road=text("crossingRoad", REQUIRED),
            road_at_start=text("roadAtStart", REQUIRED),
            road_at_end=text("roadAtEnd", REQUIRED),
            start=child("startLaneLink", _END, required=True),
            end=child("endLaneLink", _END, required=True),
        ),
    ),
    extra=REST,
)

JUNCTION_GROUP = Table(
    model.JunctionGroup,
    id=text("id", REQUIRED),
    name=text("name"),
    type=text("type"),
    junction_ids=each("junctionReference", text("junction", REQUIRED)),
    extra=REST,
)
