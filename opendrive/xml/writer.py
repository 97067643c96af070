"""Records to OpenDRIVE XML: what is read again equals what was written."""

from collections.abc import Iterable
from os import PathLike
from pathlib import Path
from typing import Protocol

from lxml import etree

from opendrive.arrays import FloatArray
from opendrive.errors import OpenDriveError
from opendrive.model import (
    Arc,
    Connection,
    Geometry,
    Header,
    Junction,
    Lane,
    LaneMaterial,
    LaneRange,
    Line,
    MapModel,
    Outline,
    ParamPoly3,
    Poly3,
    Road,
    RoadLink,
    RoadMark,
    RoadMarkLine,
    RoadObject,
    Signal,
    SignalPosition,
    Spiral,
    Station,
    Structure,
    Switch,
    Track,
)
from opendrive.xml.values import Element


class HasModel(Protocol):
    """A network that was made from a map."""

    @property
    def model(self) -> MapModel:
        """The map as read."""


def write_map(source: MapModel | HasModel, path: str | PathLike[str]) -> None:
    """Write a map as an OpenDRIVE file; speeds are written in m/s.

    Args:
        source: a network, or its model.
        path: file to write.

    Raises:
        OpenDriveError: the file cannot be written.
    """
    model = source if isinstance(source, MapModel) else source.model
    root = etree.Element("OpenDRIVE")
    _header(root, model.header)
    for road in model.roads.values():
        _road(root, road)
    for controller in model.controllers.values():
        element = _add(
            root, "controller", id=controller.id, name=controller.name, sequence=controller.sequence
        )
        for control in controller.controls:
            _add(element, "control", signalId=control.signal_id, type=control.type)
        _extra(element, controller.extra)
    for junction in model.junctions.values():
        _junction(root, junction)
    for group in model.junction_groups:
        element = _add(root, "junctionGroup", id=group.id, name=group.name, type=group.type)
        for junction_id in group.junction_ids:
            _add(element, "junctionReference", junction=junction_id)
        _extra(element, group.extra)
    for station in model.stations:
        _station(root, station)
    _extra(root, model.extra)
    data = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    try:
        Path(path).write_bytes(data)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise OpenDriveError(f"{path}: cannot be written ({reason})") from error


Value = str | float | bool | None


def _text(value: str | float | bool) -> str:
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else repr(value)


def _add(parent: Element, tag: str, **attributes: Value) -> Element:
    """Append an element; attributes that are None or empty are left out."""
    kept = {name: _text(value) for name, value in attributes.items() if value is not None and value != ""}
    return etree.SubElement(parent, tag, kept)


def _extra(parent: Element, texts: Iterable[str]) -> None:
    for text in texts:
        parent.append(etree.fromstring(text))


def _attributes(element: Element, attributes: Iterable[tuple[str, str]]) -> None:
    for name, value in attributes:
        element.set(name, value)


def _rows(parent: Element, tag: str, rows: FloatArray, names: tuple[str, ...], **attributes: Value) -> None:
    for row in rows.tolist():
        _add(parent, tag, **attributes, **dict(zip(names, row, strict=True)))


_CUBIC = ("s", "a", "b", "c", "d")
_CUBIC_OFFSET = ("sOffset", "a", "b", "c", "d")


def _header(root: Element, header: Header) -> None:
    element = _add(
        root,
        "header",
        revMajor=header.rev_major,
        revMinor=header.rev_minor,
        name=header.name,
        version=header.version,
        date=header.date,
        vendor=header.vendor,
        north=header.north_m,
        south=header.south_m,
        east=header.east_m,
        west=header.west_m,
    )
    if header.geo_reference:
        etree.SubElement(element, "geoReference").text = header.geo_reference
    if (offset := header.offset) is not None:
        _add(element, "offset", x=offset.x_m, y=offset.y_m, z=offset.z_m, hdg=offset.heading_rad)
    _extra(element, header.extra)


def _road(root: Element, road: Road) -> None:
    element = _add(
        root,
        "road",
        name=road.name,
        length=road.length_m,
        id=road.id,
        junction=road.junction_id or "-1",
        rule=road.rule,
    )
    _attributes(element, road.attributes)
    # An id may be empty, but never absent.
    element.set("id", road.id)
    link = _add(element, "link")
    _link(link, "predecessor", road.predecessor)
    _link(link, "successor", road.successor)
    for kind in road.types:
        child = _add(element, "type", s=kind.s_m, type=kind.type, country=kind.country)
        if kind.speed_mps is not None:
            _add(child, "speed", max=kind.speed_mps, unit="m/s")
    plan = _add(element, "planView")
    for piece in road.geometries:
        _geometry(plan, piece)
    _rows(_add(element, "elevationProfile"), "elevation", road.elevation, _CUBIC)
    lateral = _add(element, "lateralProfile")
    _rows(lateral, "superelevation", road.superelevation, _CUBIC)
    _rows(lateral, "crossfall", road.crossfall_left, _CUBIC, side="left")
    _rows(lateral, "crossfall", road.crossfall_right, _CUBIC, side="right")
    _rows(lateral, "shape", road.shape, ("s", "t", "a", "b", "c", "d"))
    lanes = _add(element, "lanes")
    _rows(lanes, "laneOffset", road.lane_offset, _CUBIC)
    for section in road.sections:
        child = _add(lanes, "laneSection", s=section.s_m, singleSide=section.single_side or None)
        for side, sign in (("left", 1), ("center", 0), ("right", -1)):
            members = [lane for lane in section.lanes if (lane.id > 0) - (lane.id < 0) == sign]
            if members:
                group = _add(child, side)
                for lane in members:
                    _lane(group, lane)
        _extra(child, section.extra)
    _objects(element, road)
    _signals(element, road)
    if road.switches:
        railroad = _add(element, "railroad")
        for switch in road.switches:
            _switch(railroad, switch)
    _extra(element, road.extra)


def _link(parent: Element, tag: str, link: RoadLink | None) -> None:
    if link is not None:
        child = _add(
            parent,
            tag,
            elementType=link.element_type,
            contactPoint=link.contact_point,
            elementS=link.s_m,
            elementDir=link.direction,
        )
        child.set("elementId", link.element_id)


def _geometry(plan: Element, piece: Geometry) -> None:
    element = _add(
        plan, "geometry", s=piece.s_m, x=piece.x_m, y=piece.y_m, hdg=piece.heading_rad, length=piece.length_m
    )
    match piece.shape:
        case Line():
            _add(element, "line")
        case Arc(curvature):
            _add(element, "arc", curvature=curvature)
        case Spiral(start, end):
            _add(element, "spiral", curvStart=start, curvEnd=end)
        case Poly3(coefficients):
            _add(element, "poly3", **dict(zip("abcd", coefficients, strict=True)))
        case ParamPoly3(u, v, normalized):
            values = dict(zip(("aU", "bU", "cU", "dU", "aV", "bV", "cV", "dV"), (*u, *v), strict=True))
            _add(element, "paramPoly3", pRange="normalized" if normalized else "arcLength", **values)


def _lane(parent: Element, lane: Lane) -> None:
    direction = lane.direction if lane.direction != "standard" else None
    element = _add(parent, "lane", id=lane.id, type=lane.type, level=lane.level, direction=direction)
    element.set("type", lane.type)
    _attributes(element, lane.flags)
    if lane.predecessors or lane.successors:
        link = _add(element, "link")
        for lane_id in lane.predecessors:
            _add(link, "predecessor", id=lane_id)
        for lane_id in lane.successors:
            _add(link, "successor", id=lane_id)
    _rows(element, "border", lane.border, _CUBIC_OFFSET)
    _rows(element, "width", lane.width, _CUBIC_OFFSET)
    for mark in lane.road_marks:
        _road_mark(element, mark)
    for material in lane.materials:
        _material(element, material)
    for speed in lane.speeds:
        limit = "no limit" if speed.speed_mps is None else speed.speed_mps
        _add(element, "speed", sOffset=speed.s_offset_m, max=limit, unit="m/s")
    for access in lane.accesses:
        child = _add(
            element, "access", sOffset=access.s_offset_m, rule=access.rule, restriction=access.restriction
        )
        for restriction in access.restrictions:
            _add(child, "restriction", type=restriction)
    _rows(element, "height", lane.height, ("sOffset", "inner", "outer"))
    for rule in lane.rules:
        _add(element, "rule", sOffset=rule.s_offset_m, value=rule.value)
    _extra(element, lane.extra)


def _road_mark(parent: Element, mark: RoadMark) -> None:
    element = _add(
        parent,
        "roadMark",
        sOffset=mark.s_offset_m,
        width=mark.width_m,
        laneChange=mark.lane_change,
        height=mark.height_m,
    )
    for name, value in (
        ("type", mark.type), ("weight", mark.weight), ("color", mark.color), ("material", mark.material),
    ):  # fmt: skip
        element.set(name, value)
    for row in mark.sway:
        _add(element, "sway", **dict(zip(("ds", "a", "b", "c", "d"), row, strict=True)))
    if mark.pattern or mark.lines or mark.pattern_width_m is not None:
        kind = _add(element, "type", name=mark.pattern, width=mark.pattern_width_m)
        for line in mark.lines:
            _mark_line(kind, line)
    if mark.explicit_lines:
        explicit = _add(element, "explicit")
        for line in mark.explicit_lines:
            _mark_line(explicit, line)


def _mark_line(parent: Element, line: RoadMarkLine) -> None:
    _add(
        parent,
        "line",
        length=line.length_m,
        space=line.space_m,
        tOffset=line.t_offset_m,
        sOffset=line.s_offset_m,
        width=line.width_m,
        color=line.color,
        rule=line.rule,
    )


def _material(parent: Element, material: LaneMaterial) -> None:
    _add(
        parent,
        "material",
        sOffset=material.s_offset_m,
        surface=material.surface,
        friction=material.friction,
        roughness=material.roughness,
    )


def _validity(parent: Element, ranges: Iterable[LaneRange]) -> None:
    for lanes in ranges:
        _add(parent, "validity", fromLane=lanes.from_lane, toLane=lanes.to_lane)


def _objects(road_element: Element, road: Road) -> None:
    if not (road.objects or road.object_references or road.bridges or road.tunnels):
        return
    parent = _add(road_element, "objects")
    for item in road.objects:
        _object(parent, item)
    for reference in road.object_references:
        child = _add(
            parent,
            "objectReference",
            s=reference.s_m,
            t=reference.t_m,
            zOffset=reference.z_offset_m,
            validLength=reference.valid_length_m,
            orientation=reference.orientation,
        )
        child.set("id", reference.object_id)
        _validity(child, reference.validity)
        _extra(child, reference.extra)
    for tag, structures in (("tunnel", road.tunnels), ("bridge", road.bridges)):
        for structure in structures:
            _structure(parent, tag, structure)


def _structure(parent: Element, tag: str, structure: Structure) -> None:
    element = _add(
        parent,
        tag,
        s=structure.s_m,
        length=structure.length_m,
        name=structure.name,
        type=structure.type,
        lighting=structure.lighting,
        daylight=structure.daylight,
    )
    element.set("id", structure.id)
    _validity(element, structure.validity)
    _extra(element, structure.extra)


def _object(parent: Element, item: RoadObject) -> None:
    element = _add(
        parent,
        "object",
        id=item.id,
        name=item.name,
        type=item.type,
        subtype=item.subtype,
        s=item.s_m,
        t=item.t_m,
        zOffset=item.z_offset_m,
        hdg=item.heading_rad,
        pitch=item.pitch_rad,
        roll=item.roll_rad,
        orientation=item.orientation,
        length=item.length_m,
        width=item.width_m,
        height=item.height_m,
        radius=item.radius_m,
        dynamic="yes" if item.dynamic else None,
        perpToRoad=item.perpendicular_to_road or None,
        validLength=item.valid_length_m,
    )
    element.set("type", item.type)
    element.set("orientation", item.orientation)
    _attributes(element, item.attributes)
    for repeat in item.repeats:
        changes = {
            f"{name}{end}": value
            for name, change in (
                ("t", repeat.t), ("zOffset", repeat.z_offset), ("width", repeat.width),
                ("height", repeat.height), ("length", repeat.length), ("radius", repeat.radius),
            )
            for end, value in (("Start", change.start_m), ("End", change.end_m))
        }  # fmt: skip
        _add(
            element,
            "repeat",
            s=repeat.s_m,
            length=repeat.length_m,
            distance=repeat.distance_m,
            detachFromReferenceLine=repeat.detached or None,
            **changes,
        )
    if item.outlines:
        outlines = _add(element, "outlines")
        for outline in item.outlines:
            _outline(outlines, outline)
    for material in item.materials:
        _material(element, material)
    _validity(element, item.validity)
    if item.parking_space is not None:
        space = item.parking_space
        _add(element, "parkingSpace", access=space.access, restrictions=space.restrictions)
    if item.markings:
        markings = _add(element, "markings")
        for marking in item.markings:
            child = _add(
                markings,
                "marking",
                side=marking.side,
                color=marking.color,
                weight=marking.weight,
                width=marking.width_m,
                zOffset=marking.z_offset_m,
                lineLength=marking.line_length_m,
                spaceLength=marking.space_length_m,
                startOffset=marking.start_offset_m,
                stopOffset=marking.stop_offset_m,
            )
            child.set("weight", marking.weight)
            for corner_id in marking.corner_ids:
                _add(child, "cornerReference").set("id", corner_id)
    if item.borders:
        borders = _add(element, "borders")
        for border in item.borders:
            child = _add(
                borders,
                "border",
                outlineId=border.outline_id,
                type=border.type,
                width=border.width_m,
                useCompleteOutline=border.whole_outline or None,
            )
            for corner_id in border.corner_ids:
                _add(child, "cornerReference").set("id", corner_id)
    _extra(element, item.extra)


def _outline(parent: Element, outline: Outline) -> None:
    element = _add(parent, "outline", id=outline.id, closed=outline.closed)
    _attributes(element, outline.attributes)
    tag, names = (
        ("cornerRoad", ("s", "t", "dz")) if outline.in_road_frame else ("cornerLocal", ("u", "v", "z"))
    )
    ids = outline.corner_ids or ("",) * len(outline.corners)
    for corner, height, corner_id in zip(
        outline.corners.tolist(), outline.heights_m.tolist(), ids, strict=True
    ):
        _add(element, tag, **dict(zip(names, corner, strict=True)), height=height, id=corner_id)


def _signals(road_element: Element, road: Road) -> None:
    if not (road.signals or road.signal_references):
        return
    parent = _add(road_element, "signals")
    for signal in road.signals:
        _signal(parent, signal)
    for reference in road.signal_references:
        child = _add(parent, "signalReference", s=reference.s_m, t=reference.t_m)
        child.set("id", reference.signal_id)
        child.set("orientation", reference.orientation)
        _validity(child, reference.validity)
        _extra(child, reference.extra)


def _signal(parent: Element, signal: Signal) -> None:
    element = _add(
        parent,
        "signal",
        name=signal.name,
        s=signal.s_m,
        t=signal.t_m,
        zOffset=signal.z_offset_m,
        hOffset=signal.heading_offset_rad,
        pitch=signal.pitch_rad,
        roll=signal.roll_rad,
        dynamic="yes" if signal.dynamic else "no",
        country=signal.country,
        countryRevision=signal.country_revision,
        type=signal.type,
        subtype=signal.subtype,
        value=signal.value,
        unit=signal.unit,
        text=signal.text,
        height=signal.height_m,
        width=signal.width_m,
        length=signal.length_m,
    )
    element.set("id", signal.id)
    element.set("orientation", signal.orientation)
    _attributes(element, signal.attributes)
    _validity(element, signal.validity)
    for dependency in signal.dependencies:
        _add(element, "dependency", type=dependency.type).set("id", dependency.signal_id)
    for link in signal.links:
        child = _add(element, "reference", elementType=link.element_type, type=link.type)
        child.set("elementId", link.element_id)
    if signal.position is not None:
        _position(element, signal.position)
    _extra(element, signal.extra)


def _position(parent: Element, position: SignalPosition) -> None:
    first, second, third = position.position_m
    if position.road_id:
        _add(
            parent,
            "positionRoad",
            roadId=position.road_id,
            s=first,
            t=second,
            zOffset=third,
            hOffset=position.heading_rad,
            pitch=position.pitch_rad,
            roll=position.roll_rad,
        )
    else:
        _add(
            parent,
            "positionInertial",
            x=first,
            y=second,
            z=third,
            hdg=position.heading_rad,
            pitch=position.pitch_rad,
            roll=position.roll_rad,
        )


def _switch(parent: Element, switch: Switch) -> None:
    element = _add(parent, "switch", name=switch.name)
    element.set("id", switch.id)
    element.set("position", switch.position)

    def track(tag: str, track: Track) -> None:
        child = _add(element, tag, s=track.s_m)
        child.set("id", track.road_id)
        child.set("dir", track.direction)

    track("mainTrack", switch.main_track)
    track("sideTrack", switch.side_track)
    if switch.partner_id:
        _add(element, "partner", id=switch.partner_id, name=switch.partner_name)
    _extra(element, switch.extra)


def _station(root: Element, station: Station) -> None:
    element = _add(root, "station", name=station.name, type=station.type)
    element.set("id", station.id)
    for platform in station.platforms:
        child = _add(element, "platform", name=platform.name)
        child.set("id", platform.id)
        for segment in platform.segments:
            part = _add(child, "segment", sStart=segment.s_start_m, sEnd=segment.s_end_m, side=segment.side)
            part.set("roadId", segment.road_id)
    _extra(element, station.extra)


def _junction(root: Element, junction: Junction) -> None:
    element = _add(
        root,
        "junction",
        name=junction.name,
        type=junction.type,
        mainRoad=junction.main_road,
        orientation=junction.orientation,
        sStart=junction.s_start_m,
        sEnd=junction.s_end_m,
    )
    element.set("id", junction.id)
    for connection in junction.connections:
        _connection(element, connection)
    for priority in junction.priorities:
        _add(element, "priority", high=priority.high, low=priority.low)
    for controller in junction.controllers:
        child = _add(element, "controller", type=controller.type, sequence=controller.sequence)
        child.set("id", controller.controller_id)
    for crossing in junction.crossing_roads:
        child = _add(element, "roadSection", id=crossing.id, sStart=crossing.s_start_m, sEnd=crossing.s_end_m)
        child.set("roadId", crossing.road_id)
    for path in junction.cross_paths:
        child = _add(element, "crossPath")
        for name, text in (
            ("id", path.id), ("crossingRoad", path.crossing_road), ("roadAtStart", path.road_at_start),
            ("roadAtEnd", path.road_at_end),
        ):  # fmt: skip
            child.set(name, text)
        for tag, (s_m, from_lane, to_lane) in (("startLaneLink", path.start), ("endLaneLink", path.end)):
            _add(child, tag, s=s_m, to=to_lane).set("from", _text(from_lane))
    _extra(element, junction.extra)


def _connection(parent: Element, connection: Connection) -> None:
    element = _add(
        parent,
        "connection",
        id=connection.id,
        type=connection.type if connection.type != "default" else None,
        contactPoint=connection.contact_point,
    )
    element.set("incomingRoad", connection.incoming_road)
    element.set("linkedRoad" if connection.is_linked else "connectingRoad", connection.connecting_road)
    _link(element, "predecessor", connection.predecessor)
    _link(element, "successor", connection.successor)
    overlaps = connection.overlap_zones_m or (None,) * len(connection.lane_links)
    for (from_lane, to_lane), overlap in zip(connection.lane_links, overlaps, strict=True):
        _add(element, "laneLink", to=to_lane, overlapZone=overlap).set("from", _text(from_lane))
