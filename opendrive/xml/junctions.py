"""Junctions, their groups, and controllers (chapters "Junctions" and "Signals")."""

from opendrive.errors import WarningKind
from opendrive.model import (
    Connection,
    Control,
    Controller,
    CrossingRoad,
    CrossPath,
    Junction,
    JunctionController,
    JunctionGroup,
    JunctionPriority,
)
from opendrive.xml.roads import read_link
from opendrive.xml.values import Element, Values, children, first, others, xml_of

JUNCTION_TYPES = ("default", "direct", "virtual", "crossing")
_CONNECTION_PARTS = ("laneLink", "predecessor", "successor")


def read_junction(values: Values, element: Element) -> Junction:
    """Return a junction."""
    get = element.get
    kind = get("type", "default") or "default"
    if kind not in JUNCTION_TYPES:
        values.warn(WarningKind.UNKNOWN_VALUE, element, f"junction of type {kind!r:.40}; read as default")
        kind = "default"
    connections = [(child, _connection(values, child)) for child in children(element, "connection")]
    rest = others(element, "connection", "priority", "controller", "roadSection", "crossPath")
    return Junction(
        id=values.text(element, "id"),
        name=get("name", ""),
        type=kind,
        connections=tuple(record for _, record in connections if record is not None),
        priorities=tuple(
            JunctionPriority(child.get("high", ""), child.get("low", ""))
            for child in children(element, "priority")
        ),
        controllers=tuple(
            JunctionController(
                values.text(child, "id"),
                child.get("type", ""),
                values.integer(child, "sequence", None),
            )
            for child in children(element, "controller")
        ),
        main_road=get("mainRoad", ""),
        orientation=get("orientation", ""),
        s_start_m=values.number(element, "sStart", None),
        s_end_m=values.number(element, "sEnd", None),
        crossing_roads=tuple(
            CrossingRoad(
                child.get("id", ""),
                values.text(child, "roadId"),
                values.number(child, "sStart"),
                values.number(child, "sEnd"),
            )
            for child in children(element, "roadSection")
        ),
        cross_paths=tuple(_cross_path(values, child) for child in children(element, "crossPath")),
        extra=values.extra(
            rest
            + [part for child, record in connections if record for part in others(child, *_CONNECTION_PARTS)]
        )
        + tuple(xml_of(child) for child, record in connections if record is None),
    )


def _connection(values: Values, element: Element) -> Connection | None:
    get = element.get
    incoming, linked = get("incomingRoad"), get("linkedRoad")
    connecting = get("connectingRoad", linked)
    contact_point = values.contact_point(element)
    kind = get("type", "default") or "default"
    predecessor = read_link(values, first(element, "predecessor"))
    successor = read_link(values, first(element, "successor"))
    if kind == "virtual" and incoming is None and predecessor is not None:
        incoming = predecessor.element_id
    if kind == "virtual" and contact_point is None:
        contact_point = "start"
    if incoming is None or connecting is None or contact_point is None:
        values.warn(
            WarningKind.LINK,
            element,
            "connection without incomingRoad, connectingRoad or contactPoint; left out",
        )
        return None
    links = children(element, "laneLink")
    overlaps = tuple(values.number(child, "overlapZone", 0.0) for child in links)
    return Connection(
        id=get("id", ""),
        incoming_road=incoming,
        connecting_road=connecting,
        contact_point=contact_point,
        lane_links=tuple((values.integer(child, "from"), values.integer(child, "to")) for child in links),
        type=kind,
        is_linked="connectingRoad" not in element.attrib,
        predecessor=predecessor,
        successor=successor,
        overlap_zones_m=overlaps if any(overlaps) else (),
    )


def _cross_path(values: Values, element: Element) -> CrossPath:
    def end(tag: str) -> tuple[float, int, int]:
        link = first(element, tag)
        if link is None:
            raise values.error(element, f"<{tag}> is missing; add it")
        return values.number(link, "s"), values.integer(link, "from"), values.integer(link, "to")

    return CrossPath(
        id=values.text(element, "id"),
        crossing_road=values.text(element, "crossingRoad"),
        road_at_start=values.text(element, "roadAtStart"),
        road_at_end=values.text(element, "roadAtEnd"),
        start=end("startLaneLink"),
        end=end("endLaneLink"),
    )


def read_controller(values: Values, element: Element) -> Controller:
    """Return a controller of signals."""
    return Controller(
        id=values.text(element, "id"),
        name=element.get("name", ""),
        sequence=values.integer(element, "sequence", None),
        controls=tuple(
            Control(values.text(child, "signalId"), child.get("type", ""))
            for child in children(element, "control")
        ),
        extra=values.extra(others(element, "control")),
    )


def read_junction_group(values: Values, element: Element) -> JunctionGroup:
    """Return a group of junctions."""
    get = element.get
    return JunctionGroup(
        id=values.text(element, "id"),
        name=get("name", ""),
        type=get("type", ""),
        junction_ids=tuple(
            values.text(child, "junction") for child in children(element, "junctionReference")
        ),
        extra=values.extra(others(element, "junctionReference")),
    )
