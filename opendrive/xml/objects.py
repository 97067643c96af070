"""Signals, objects, bridges, tunnels and railroads of a road (chapters "Signals", "Objects", "Railroads")."""

import numpy as np

from opendrive.arrays import FloatArray, read_only
from opendrive.errors import WarningKind
from opendrive.model import (
    Change,
    LaneMaterial,
    ObjectBorder,
    ObjectMarking,
    ObjectReference,
    ObjectRepeat,
    Outline,
    ParkingSpace,
    Platform,
    PlatformSegment,
    RoadObject,
    Signal,
    SignalDependency,
    SignalLink,
    SignalPosition,
    SignalReference,
    Station,
    Structure,
    Switch,
    Track,
)
from opendrive.xml.values import Element, Values, children, first, other_attributes, others

OUTLINE_NAMES = ("id", "closed")
PLACED_NAMES = (
    "id", "name", "s", "t", "zOffset", "type", "subtype", "dynamic", "orientation", "height", "width",
    "length", "pitch", "roll",
)  # fmt: skip
"""Attributes that signals and objects have in common."""
SIGNAL_NAMES = (*PLACED_NAMES, "hOffset", "country", "countryRevision", "value", "unit", "text")
OBJECT_NAMES = (*PLACED_NAMES, "hdg", "radius", "perpToRoad", "validLength")


def read_signal(values: Values, element: Element) -> Signal:
    """Return a signal."""
    get = element.get
    number = values.number
    known = ("validity", "dependency", "reference", "positionRoad", "positionInertial")
    return Signal(
        id=values.text(element, "id"),
        name=get("name", ""),
        s_m=number(element, "s"),
        t_m=number(element, "t"),
        z_offset_m=number(element, "zOffset", 0.0),
        heading_offset_rad=number(element, "hOffset", 0.0),
        type=get("type", ""),
        subtype=get("subtype", ""),
        country=get("country", ""),
        value=number(element, "value", None),
        unit=get("unit", ""),
        text=get("text", ""),
        dynamic=values.flag(element, "dynamic"),
        orientation=get("orientation", "none"),
        height_m=number(element, "height", None),
        width_m=number(element, "width", None),
        validity=values.validity(element),
        pitch_rad=number(element, "pitch", 0.0),
        roll_rad=number(element, "roll", 0.0),
        length_m=number(element, "length", None),
        country_revision=get("countryRevision", ""),
        dependencies=tuple(
            SignalDependency(values.text(child, "id"), child.get("type", ""))
            for child in children(element, "dependency")
        ),
        links=tuple(
            SignalLink(
                child.get("elementType", ""),
                values.text(child, "elementId"),
                child.get("type", ""),
            )
            for child in children(element, "reference")
        ),
        position=_position(values, element),
        extra=values.extra(others(element, *known)),
        attributes=other_attributes(element, SIGNAL_NAMES),
    )


def _position(values: Values, element: Element) -> SignalPosition | None:
    number = values.number
    on_road, inertial = first(element, "positionRoad"), first(element, "positionInertial")
    if on_road is not None:
        return SignalPosition(
            values.text(on_road, "roadId"),
            (number(on_road, "s"), number(on_road, "t"), number(on_road, "zOffset", 0.0)),
            number(on_road, "hOffset", 0.0),
            number(on_road, "pitch", 0.0),
            number(on_road, "roll", 0.0),
        )
    if inertial is not None:
        return SignalPosition(
            "",
            (number(inertial, "x"), number(inertial, "y"), number(inertial, "z", 0.0)),
            number(inertial, "hdg", 0.0),
            number(inertial, "pitch", 0.0),
            number(inertial, "roll", 0.0),
        )
    return None


def read_signal_reference(values: Values, element: Element) -> SignalReference:
    """Return a reference to a signal."""
    return SignalReference(
        signal_id=values.text(element, "id"),
        s_m=values.number(element, "s"),
        t_m=values.number(element, "t"),
        orientation=element.get("orientation", "none"),
        validity=values.validity(element),
        extra=values.extra(others(element, "validity")),
    )


def read_object(values: Values, element: Element) -> RoadObject:
    """Return an object."""
    get = element.get
    number = values.number
    known = (
        "outlines", "outline", "validity", "repeat", "markings", "borders", "material", "parkingSpace",
    )  # fmt: skip
    groups = [element, *children(element, "outlines")]
    parking = first(element, "parkingSpace")
    return RoadObject(
        id=get("id", ""),
        name=get("name", ""),
        type=get("type", "none"),
        subtype=get("subtype", ""),
        s_m=number(element, "s"),
        t_m=number(element, "t"),
        z_offset_m=number(element, "zOffset", 0.0),
        heading_rad=number(element, "hdg", 0.0),
        orientation=get("orientation", "none"),
        length_m=number(element, "length", None),
        width_m=number(element, "width", None),
        height_m=number(element, "height", None),
        radius_m=number(element, "radius", None),
        outlines=tuple(_outline(values, child) for group in groups for child in children(group, "outline")),
        validity=values.validity(element),
        pitch_rad=number(element, "pitch", 0.0),
        roll_rad=number(element, "roll", 0.0),
        dynamic=values.flag(element, "dynamic"),
        perpendicular_to_road=values.flag(element, "perpToRoad"),
        valid_length_m=number(element, "validLength", None),
        repeats=tuple(_repeat(values, child) for child in children(element, "repeat")),
        markings=tuple(
            _marking(values, child)
            for group in children(element, "markings")
            for child in children(group, "marking")
        ),
        borders=tuple(
            _border(values, child)
            for group in children(element, "borders")
            for child in children(group, "border")
        ),
        materials=tuple(read_material(values, child) for child in children(element, "material")),
        parking_space=None if parking is None else _parking_space(parking),
        extra=values.extra(
            others(element, *known)
            + [
                child
                for tag, inner in (("markings", "marking"), ("borders", "border"), ("outlines", "outline"))
                for group in children(element, tag)
                for member in (group, *children(group, inner))
                for child in others(member, inner, "cornerLocal", "cornerRoad", "cornerReference")
            ]
        ),
        attributes=other_attributes(element, OBJECT_NAMES),
    )


def read_material(values: Values, element: Element) -> LaneMaterial:
    """Return the material of a lane or object."""
    return LaneMaterial(
        values.number(element, "sOffset", 0.0),
        element.get("surface", ""),
        values.number(element, "friction", 0.0),
        values.number(element, "roughness", None),
    )


def _outline(values: Values, element: Element) -> Outline:
    local, road = children(element, "cornerLocal"), children(element, "cornerRoad")
    if local and road:
        values.warn(
            WarningKind.IGNORED, element, "outline mixes cornerRoad and cornerLocal; only cornerRoad is read"
        )
    corners = road or local
    names = ("s", "t", "dz") if road else ("u", "v", "z")
    ids = tuple(corner.get("id", "") for corner in corners)
    return Outline(
        in_road_frame=bool(road),
        corners=_table(
            [
                [values.number(corner, name) for name in names[:2]] + [values.number(corner, names[2], 0.0)]
                for corner in corners
            ]
        ),
        closed=values.flag(element, "closed", True),
        heights_m=read_only(np.array([values.number(corner, "height", 0.0) for corner in corners])),
        corner_ids=ids if any(ids) else (),
        id=element.get("id", ""),
        attributes=other_attributes(element, OUTLINE_NAMES),
    )


def _table(rows: list[list[float]]) -> FloatArray:
    return read_only(np.array(rows, dtype=np.float64).reshape(-1, 3))


def _repeat(values: Values, element: Element) -> ObjectRepeat:
    def change(name: str) -> Change:
        return Change(
            values.number(element, f"{name}Start", None), values.number(element, f"{name}End", None)
        )

    return ObjectRepeat(
        s_m=values.number(element, "s"),
        length_m=values.number(element, "length"),
        distance_m=values.number(element, "distance"),
        t=change("t"),
        z_offset=change("zOffset"),
        width=change("width"),
        height=change("height"),
        length=change("length"),
        radius=change("radius"),
        detached=values.flag(element, "detachFromReferenceLine"),
    )


def _corner_ids(values: Values, element: Element) -> tuple[str, ...]:
    return tuple(values.text(child, "id") for child in children(element, "cornerReference"))


def _marking(values: Values, element: Element) -> ObjectMarking:
    get = element.get
    number = values.number
    return ObjectMarking(
        side=get("side", ""),
        color=get("color", ""),
        weight=get("weight", "standard"),
        width_m=number(element, "width", None),
        z_offset_m=number(element, "zOffset", 0.0),
        line_length_m=number(element, "lineLength", 0.0),
        space_length_m=number(element, "spaceLength", 0.0),
        start_offset_m=number(element, "startOffset", 0.0),
        stop_offset_m=number(element, "stopOffset", 0.0),
        corner_ids=_corner_ids(values, element),
    )


def _border(values: Values, element: Element) -> ObjectBorder:
    get = element.get
    return ObjectBorder(
        outline_id=get("outlineId", ""),
        type=get("type", ""),
        width_m=values.number(element, "width", 0.0),
        whole_outline=values.flag(element, "useCompleteOutline"),
        corner_ids=_corner_ids(values, element),
    )


def _parking_space(element: Element) -> ParkingSpace:
    get = element.get
    return ParkingSpace(get("access", ""), get("restrictions", ""))


def read_object_reference(values: Values, element: Element) -> ObjectReference:
    """Return a reference to an object."""
    return ObjectReference(
        object_id=values.text(element, "id"),
        s_m=values.number(element, "s"),
        t_m=values.number(element, "t"),
        z_offset_m=values.number(element, "zOffset", None),
        valid_length_m=values.number(element, "validLength", None),
        orientation=element.get("orientation", "none"),
        validity=values.validity(element),
        extra=values.extra(others(element, "validity")),
    )


def read_structure(values: Values, element: Element) -> Structure:
    """Return a bridge or a tunnel."""
    get = element.get
    return Structure(
        id=values.text(element, "id"),
        name=get("name", ""),
        type=get("type", ""),
        s_m=values.number(element, "s"),
        length_m=values.length_m(element),
        lighting=values.number(element, "lighting", None),
        daylight=values.number(element, "daylight", None),
        validity=values.validity(element),
        extra=values.extra(others(element, "validity")),
    )


def read_switch(values: Values, element: Element) -> Switch:
    """Return a railroad switch."""
    get = element.get
    partner = first(element, "partner")
    return Switch(
        id=values.text(element, "id"),
        name=get("name", ""),
        position=get("position", "dynamic"),
        main_track=_track(values, element, "mainTrack"),
        side_track=_track(values, element, "sideTrack"),
        partner_id="" if partner is None else values.text(partner, "id"),
        partner_name="" if partner is None else partner.get("name", ""),
        extra=values.extra(others(element, "mainTrack", "sideTrack", "partner")),
    )


def _track(values: Values, element: Element, tag: str) -> Track:
    track = first(element, tag)
    if track is None:
        raise values.error(element, f"<{tag}> is missing; add it")
    return Track(values.text(track, "id"), values.number(track, "s"), track.get("dir", "+"))


def read_station(values: Values, element: Element) -> Station:
    """Return a station."""
    get = element.get
    platforms = [
        Platform(
            values.text(platform, "id"),
            platform.get("name", ""),
            tuple(
                PlatformSegment(
                    values.text(segment, "roadId"),
                    values.number(segment, "sStart"),
                    values.number(segment, "sEnd"),
                    segment.get("side", ""),
                )
                for segment in children(platform, "segment")
            ),
        )
        for platform in children(element, "platform")
    ]
    rest = others(element, "platform") + [
        child for platform in children(element, "platform") for child in others(platform, "segment")
    ]
    return Station(
        values.text(element, "id"), get("name", ""), get("type", ""), tuple(platforms), values.extra(rest)
    )
