"""OpenDRIVE XML to records.

The parser expands no entities, opens no network connection and keeps libxml2's limits on depth and size.
Every number is checked to be finite; a wrong value is reported with its file, road, element and line.
"""

import math
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import Literal, TypeAlias, overload

import numpy as np
from lxml import etree

from opendrive.arrays import FloatArray, read_only
from opendrive.errors import MapContentError, MapReadError, MapWarning
from opendrive.model import (
    Arc,
    Connection,
    ContactPoint,
    Geometry,
    GeoOffset,
    Header,
    Junction,
    Lane,
    LaneRange,
    LaneSection,
    LaneSpeed,
    Line,
    MapModel,
    Outline,
    ParamPoly3,
    Poly3,
    Road,
    RoadLink,
    RoadMark,
    RoadObject,
    RoadType,
    Shape,
    Signal,
    SignalReference,
    Spiral,
    TrafficRule,
)

Element: TypeAlias = etree._Element

MPS_PER_UNIT = {"m/s": 1.0, "km/h": 1.0 / 3.6, "mph": 0.44704}
MAX_NUMBER = 1e9
"""A greater number is refused: no quantity of a road map comes near it."""

MAX_LENGTH_M = 1e6
"""A road that is longer is refused."""

MAX_TURN_RAD = 1000.0
"""A piece of reference line that turns further than this is refused."""

_NO_CUBICS = read_only(np.empty((0, 5)))
_NO_HEIGHTS = read_only(np.empty((0, 3)))
_NO_SHAPES = read_only(np.empty((0, 6)))


def read_map(path: str | PathLike[str]) -> MapModel:
    """Read an OpenDRIVE file (ASAM OpenDRIVE 1.4 to 1.8).

    Args:
        path: the ``.xodr`` file.

    Raises:
        MapReadError: the file does not exist, cannot be opened, is not well-formed XML or is not OpenDRIVE.
        MapContentError: a required element or attribute is missing, or has an impossible value.
    """
    file = Path(path)
    return _Reader(str(file)).map(_parse(file))


def _parse(file: Path) -> Element:
    try:
        data = file.read_bytes()
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or error
        raise MapReadError(f"{file}: cannot be opened ({reason}); give the path of an .xodr file") from error
    if not data.strip():
        raise MapReadError(f"{file}: the file is empty; give an OpenDRIVE file")
    parser = etree.XMLParser(
        resolve_entities=False, no_network=True, huge_tree=False, load_dtd=False, remove_comments=True
    )
    try:
        root = etree.fromstring(data, parser)
    except (etree.XMLSyntaxError, ValueError) as error:
        raise MapReadError(
            f"{file}: not well-formed XML ({error}); the file is truncated, damaged or not OpenDRIVE"
        ) from error
    if root.getroottree().docinfo.internalDTD is not None:
        raise MapReadError(f"{file}: declares a document type (DOCTYPE), which maps never need; remove it")
    if str(root.tag).startswith("{"):
        for element in root.iter(etree.Element):
            element.tag = etree.QName(element).localname
    if root.tag != "OpenDRIVE":
        raise MapReadError(
            f"{file}: the root element is <{root.tag}>, expected <OpenDRIVE>; give an OpenDRIVE file"
        )
    return root


class _Reader:
    """Turns elements into records, and collects what it tolerated."""

    def __init__(self, file: str) -> None:
        self.file = file
        self.warnings: list[MapWarning] = []

    # Errors and single values

    def error(self, element: Element, message: str) -> MapContentError:
        """Return an error that says where `element` is."""
        owner = _owner(element)
        inside = f"{owner.tag} {owner.get('id', '?')!r}, " if owner is not None else ""
        return MapContentError(f"{self.file}: {inside}<{element.tag}>, line {element.sourceline}: {message}")

    def warn(self, element: Element, message: str) -> None:
        """Note a tolerated defect."""
        owner = _owner(element)
        road_id = owner.get("id", "") if owner is not None else ""
        self.warnings.append(MapWarning(road_id, str(element.tag), f"line {element.sourceline}: {message}"))

    def text(self, element: Element, name: str) -> str:
        """Return a required attribute."""
        value = element.get(name)
        if value is None:
            raise self.error(element, f"attribute {name!r} is missing; add it")
        return value

    @overload
    def number(self, element: Element, name: str) -> float: ...
    @overload
    def number(self, element: Element, name: str, default: float) -> float: ...
    @overload
    def number(self, element: Element, name: str, default: None) -> float | None: ...
    def number(
        self, element: Element, name: str, default: float | Literal["required"] | None = "required"
    ) -> float | None:
        """Return an attribute as a finite number, or `default` when it is absent."""
        text = element.get(name)
        if text is None:
            if default == "required":
                raise self.error(element, f"attribute {name!r} is missing; add it")
            return default
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if abs(value) <= MAX_NUMBER:
            return value
        if math.isfinite(value):
            raise self.error(
                element, f"attribute {name!r} is {text!r:.40}, expected a value within {MAX_NUMBER:g}"
            )
        raise self.error(element, f"attribute {name!r} is {text!r:.40}, expected a finite number")

    def integer(self, element: Element, name: str) -> int:
        """Return a required attribute as an integer."""
        text = self.text(element, name)
        try:
            value = int(text)
        except ValueError:
            raise self.error(element, f"attribute {name!r} is {text!r:.40}, expected an integer") from None
        if abs(value) > 10**6:
            raise self.error(element, f"attribute {name!r} is {value}, expected a value within 1000000")
        return value

    def length_m(self, element: Element) -> float:
        """Return the attribute length, metres."""
        value = self.number(element, "length")
        if not 0.0 <= value <= MAX_LENGTH_M:
            raise self.error(element, f"attribute 'length' is {value:g}, expected 0 to {MAX_LENGTH_M:g} m")
        return value

    def contact_point(self, element: Element) -> ContactPoint | None:
        """Return the attribute contactPoint, or None when it is absent."""
        value = element.get("contactPoint")
        if value == "start":
            return "start"
        if value == "end":
            return "end"
        if value not in (None, "", "none"):
            raise self.error(element, f"attribute 'contactPoint' is {value!r:.40}, expected 'start' or 'end'")
        return None

    def speed_mps(self, element: Element) -> float | None:
        """Return the limit of a speed element; None for ``no limit`` and ``undefined``."""
        text = self.text(element, "max").strip()
        if text in ("no limit", "undefined", "unlimited"):
            return None
        unit = element.get("unit", "m/s") or "m/s"
        if unit not in MPS_PER_UNIT:
            raise self.error(
                element, f"attribute 'unit' is {unit!r:.40}, expected one of {', '.join(MPS_PER_UNIT)}"
            )
        value = self.number(element, "max")
        if value < 0.0:
            self.warn(element, f"negative speed {value}; read as no limit")
            return None
        return value * MPS_PER_UNIT[unit]

    # Tables

    def table(
        self, parent: Element | None, tag: str, columns: tuple[str, ...], empty: FloatArray
    ) -> FloatArray:
        """Return one row per child `tag` of `parent`, sorted by the first column."""
        if parent is None:
            return empty
        elements = parent.findall(tag)
        if not elements:
            return empty
        number = self.number
        rows = np.array([[number(element, name) for name in columns] for element in elements])
        start = rows[:, 0]
        if rows.shape[0] > 1 and (start[1:] < start[:-1]).any():
            self.warn(elements[0], f"records are not in ascending {columns[0]}; sorted")
            rows = rows[np.argsort(start, kind="stable")]
        return read_only(rows)

    def cubics(self, parent: Element | None, tag: str, start: str = "s") -> FloatArray:
        """Return the piecewise cubic made of the children `tag`."""
        return self.table(parent, tag, (start, "a", "b", "c", "d"), _NO_CUBICS)

    # Records

    def map(self, root: Element) -> MapModel:
        header = self.header(root)
        roads: dict[str, Road] = {}
        for element in root.iterfind("road"):
            road = self.road(element)
            if road.id in roads:
                raise self.error(element, f"road id {road.id!r} is used twice; ids must be unique")
            roads[road.id] = road
        junctions: dict[str, Junction] = {}
        for element in root.iterfind("junction"):
            junction = self.junction(element)
            if junction.id in junctions:
                raise self.error(element, f"junction id {junction.id!r} is used twice; ids must be unique")
            junctions[junction.id] = junction
        if not roads:
            raise MapContentError(f"{self.file}: the map has no <road>; it may be truncated")
        return MapModel(header, roads, junctions, tuple(self.warnings))

    def header(self, root: Element) -> Header:
        element = root.find("header")
        if element is None:
            raise MapContentError(f"{self.file}: <header> is missing; it may be truncated or not OpenDRIVE")
        geo = element.find("geoReference")
        offset = element.find("offset")
        return Header(
            rev_major=self.integer(element, "revMajor") if "revMajor" in element.attrib else 1,
            rev_minor=self.integer(element, "revMinor") if "revMinor" in element.attrib else 4,
            name=element.get("name", ""),
            version=element.get("version", ""),
            date=element.get("date", ""),
            vendor=element.get("vendor", ""),
            north_m=self.number(element, "north", None),
            south_m=self.number(element, "south", None),
            east_m=self.number(element, "east", None),
            west_m=self.number(element, "west", None),
            geo_reference=(geo.text or "").strip() if geo is not None else "",
            offset=None
            if offset is None
            else GeoOffset(
                self.number(offset, "x", 0.0),
                self.number(offset, "y", 0.0),
                self.number(offset, "z", 0.0),
                self.number(offset, "hdg", 0.0),
            ),
        )

    def road(self, element: Element) -> Road:
        length_m = self.length_m(element)
        link = element.find("link")
        lateral = element.find("lateralProfile")
        lanes = element.find("lanes")
        if lanes is None:
            raise self.error(element, "<lanes> is missing; a road needs at least one lane section")
        left, right = self.crossfall(lateral)
        if lateral is not None and lateral.find("shape") is not None:
            self.warn(lateral, "shape is read but not applied: heights are those of a flat cross section")
        signals = element.find("signals")
        junction = element.get("junction", "-1")
        return Road(
            id=self.text(element, "id"),
            name=element.get("name", ""),
            length_m=length_m,
            junction_id=None if junction in ("-1", "") else junction,
            rule=self.rule(element),
            predecessor=self.road_link(link, "predecessor"),
            successor=self.road_link(link, "successor"),
            geometries=self.geometries(element),
            elevation=self.cubics(element.find("elevationProfile"), "elevation"),
            superelevation=self.cubics(lateral, "superelevation"),
            crossfall_left=left,
            crossfall_right=right,
            shape=self.table(lateral, "shape", ("s", "t", "a", "b", "c", "d"), _NO_SHAPES),
            lane_offset=self.cubics(lanes, "laneOffset"),
            types=tuple(self.road_type(child) for child in element.iterfind("type")),
            sections=self.sections(lanes),
            signals=tuple(self.signal(child) for child in _children(signals, "signal")),
            signal_references=tuple(
                self.signal_reference(child) for child in _children(signals, "signalReference")
            ),
            objects=tuple(self.road_object(child) for child in _children(element.find("objects"), "object")),
        )

    def rule(self, element: Element) -> TrafficRule:
        value = element.get("rule", "RHT")
        if value not in ("RHT", "LHT"):
            raise self.error(element, f"attribute 'rule' is {value!r:.40}, expected 'RHT' or 'LHT'")
        return "LHT" if value == "LHT" else "RHT"

    def road_link(self, link: Element | None, tag: str) -> RoadLink | None:
        element = link.find(tag) if link is not None else None
        if element is None:
            return None
        element_type = element.get("elementType", "road")
        element_id = self.text(element, "elementId")
        contact_point = self.contact_point(element)
        if element_type == "road" and contact_point is None and element.get("elementS") is None:
            self.warn(element, f"no contactPoint for road {element_id!r}; the link is not followed")
        return RoadLink(element_type, element_id, contact_point)

    def road_type(self, element: Element) -> RoadType:
        speed = element.find("speed")
        return RoadType(
            s_m=self.number(element, "s", 0.0),
            type=element.get("type", "unknown"),
            country=element.get("country", ""),
            speed_mps=None if speed is None else self.speed_mps(speed),
        )

    def crossfall(self, lateral: Element | None) -> tuple[FloatArray, FloatArray]:
        elements = _children(lateral, "crossfall")
        sides: dict[str, list[list[float]]] = {"left": [], "right": []}
        for element in elements:
            side = element.get("side", "both")
            if side not in ("left", "right", "both"):
                raise self.error(
                    element, f"attribute 'side' is {side!r:.40}, expected 'left', 'right' or 'both'"
                )
            row = [self.number(element, name) for name in ("s", "a", "b", "c", "d")]
            for name, rows in sides.items():
                if side in (name, "both"):
                    rows.append(row)
        left, right = (read_only(np.array(sorted(rows)).reshape(-1, 5)) for rows in sides.values())
        return left, right

    def geometries(self, road: Element) -> tuple[Geometry, ...]:
        plan = road.find("planView")
        elements = _children(plan, "geometry")
        if not elements:
            raise self.error(road, "<planView> has no <geometry>; a road needs a reference line")
        records = [self.geometry(element) for element in elements]
        if any(later.s_m < earlier.s_m for earlier, later in pairwise(records)):
            self.warn(elements[0], "pieces of the reference line are not in ascending s; sorted")
            records.sort(key=lambda record: record.s_m)
        return tuple(records)

    def geometry(self, element: Element) -> Geometry:
        length_m = self.length_m(element)
        return Geometry(
            s_m=self.number(element, "s"),
            x_m=self.number(element, "x"),
            y_m=self.number(element, "y"),
            heading_rad=self.number(element, "hdg"),
            length_m=length_m,
            shape=self.shape(element, length_m),
        )

    def shape(self, element: Element, length_m: float) -> Shape:
        child = next((child for child in element if child.tag != "userData"), None)
        shape: Shape
        turn_rad = 0.0
        if child is None:
            raise self.error(element, "has no shape; expected line, arc, spiral, poly3 or paramPoly3")
        match child.tag:
            case "line":
                return Line()
            case "arc":
                shape = Arc(self.number(child, "curvature"))
                turn_rad = abs(shape.curvature_per_m) * length_m
            case "spiral":
                start = self.number(child, "curvStart")
                end = self.number(child, "curvEnd")
                shape = Spiral(start, end)
                turn_rad = max(abs(start), abs(end)) * length_m
            case "poly3":
                a, b, c, d = (self.number(child, name) for name in "abcd")
                shape = Poly3((a, b, c, d))
            case "paramPoly3":
                u = tuple(self.number(child, name + "U") for name in "abcd")
                v = tuple(self.number(child, name + "V") for name in "abcd")
                # Before 1.4 the attribute did not exist; the range was [0, 1].
                p_range = child.get("pRange", "normalized")
                if p_range not in ("normalized", "arcLength"):
                    raise self.error(
                        child, f"attribute 'pRange' is {p_range!r:.40}, expected 'normalized' or 'arcLength'"
                    )
                shape = ParamPoly3(
                    (u[0], u[1], u[2], u[3]), (v[0], v[1], v[2], v[3]), p_range == "normalized"
                )
            case other:
                raise self.error(
                    element, f"has the shape <{other}>, expected line, arc, spiral, poly3 or paramPoly3"
                )
        if turn_rad > MAX_TURN_RAD:
            raise self.error(
                element, f"the piece turns by {turn_rad:.3g} rad; check its curvature and length"
            )
        return shape

    # Lanes

    def sections(self, lanes: Element) -> tuple[LaneSection, ...]:
        elements = lanes.findall("laneSection")
        if not elements:
            raise self.error(lanes, "no <laneSection>; a road needs at least one")
        sections = [self.section(element) for element in elements]
        if any(later.s_m < earlier.s_m for earlier, later in pairwise(sections)):
            self.warn(elements[0], "lane sections are not in ascending s; sorted")
            sections.sort(key=lambda section: section.s_m)
        return tuple(sections)

    def section(self, element: Element) -> LaneSection:
        lanes: dict[int, Lane] = {}
        for side, sign in (("left", 1), ("center", 0), ("right", -1)):
            for group in element.iterfind(side):
                for child in group.iterfind("lane"):
                    lane = self.lane(child)
                    if (lane.id > 0) - (lane.id < 0) != sign:
                        raise self.error(child, f"lane id {lane.id} has the wrong sign for <{side}>")
                    if lane.id in lanes:
                        raise self.error(child, f"lane id {lane.id} is used twice in one lane section")
                    lanes[lane.id] = lane
        ids = sorted(lanes, reverse=True)
        for side_ids in ([i for i in ids if i > 0][::-1], [-i for i in ids if i < 0]):
            if side_ids != list(range(1, len(side_ids) + 1)):
                self.warn(element, f"lane ids are not consecutive: {ids}; taken in this order")
        return LaneSection(
            s_m=self.number(element, "s"),
            single_side=element.get("singleSide", "false") in ("true", "1"),
            lanes=tuple(lanes[i] for i in ids),
        )

    def lane(self, element: Element) -> Lane:
        link = element.find("link")
        width = self.cubics(element, "width", "sOffset")
        border = self.cubics(element, "border", "sOffset")
        lane_id = self.integer(element, "id")
        if lane_id != 0 and not len(width) and not len(border):
            self.warn(element, f"lane {lane_id} has neither width nor border; its width is read as 0")
        elif len(width) and len(border):
            self.warn(element, f"lane {lane_id} has both width and border; the width is used")
        elif len(width) and width[0, 0] > 1e-6:
            self.warn(
                element, f"the width of lane {lane_id} starts {width[0, 0]} m late; it is read as 0 before"
            )
        return Lane(
            id=lane_id,
            type=element.get("type", "none"),
            level=element.get("level", "false") in ("true", "1"),
            predecessors=tuple(self.integer(child, "id") for child in _children(link, "predecessor")),
            successors=tuple(self.integer(child, "id") for child in _children(link, "successor")),
            width=width,
            border=border,
            height=self.table(element, "height", ("sOffset", "inner", "outer"), _NO_HEIGHTS),
            road_marks=self.road_marks(element),
            speeds=tuple(
                LaneSpeed(self.number(child, "sOffset", 0.0), self.speed_mps(child))
                for child in element.iterfind("speed")
            ),
            direction=element.get("direction", "standard"),
        )

    def road_marks(self, lane: Element) -> tuple[RoadMark, ...]:
        marks = [
            RoadMark(
                s_offset_m=self.number(element, "sOffset", 0.0),
                type=element.get("type", "none"),
                weight=element.get("weight", "standard"),
                color=element.get("color", "standard"),
                width_m=self.number(element, "width", None),
                lane_change=self.lane_change(element),
            )
            for element in lane.iterfind("roadMark")
        ]
        marks.sort(key=lambda mark: mark.s_offset_m)
        return tuple(marks)

    def lane_change(self, element: Element) -> str | None:
        value = element.get("laneChange")
        if value in (None, "increase", "decrease", "both", "none"):
            return value
        self.warn(element, f"laneChange is {value!r:.40}; read as absent")
        return None

    # Signals, objects, junctions

    def validity(self, element: Element) -> tuple[LaneRange, ...]:
        return tuple(
            LaneRange(self.integer(child, "fromLane"), self.integer(child, "toLane"))
            for child in element.iterfind("validity")
        )

    def signal(self, element: Element) -> Signal:
        return Signal(
            id=self.text(element, "id"),
            name=element.get("name", ""),
            s_m=self.number(element, "s"),
            t_m=self.number(element, "t"),
            z_offset_m=self.number(element, "zOffset", 0.0),
            heading_offset_rad=self.number(element, "hOffset", 0.0),
            type=element.get("type", ""),
            subtype=element.get("subtype", ""),
            country=element.get("country", ""),
            value=self.number(element, "value", None),
            unit=element.get("unit", ""),
            text=element.get("text", ""),
            dynamic=element.get("dynamic", "no") in ("yes", "true", "1"),
            orientation=element.get("orientation", "none"),
            height_m=self.number(element, "height", None),
            width_m=self.number(element, "width", None),
            validity=self.validity(element),
        )

    def signal_reference(self, element: Element) -> SignalReference:
        return SignalReference(
            signal_id=self.text(element, "id"),
            s_m=self.number(element, "s"),
            t_m=self.number(element, "t"),
            orientation=element.get("orientation", "none"),
            validity=self.validity(element),
        )

    def road_object(self, element: Element) -> RoadObject:
        groups = [element, *element.iterfind("outlines")]
        return RoadObject(
            id=element.get("id", ""),
            name=element.get("name", ""),
            type=element.get("type", "none"),
            subtype=element.get("subtype", ""),
            s_m=self.number(element, "s"),
            t_m=self.number(element, "t"),
            z_offset_m=self.number(element, "zOffset", 0.0),
            heading_rad=self.number(element, "hdg", 0.0),
            orientation=element.get("orientation", "none"),
            length_m=self.number(element, "length", None),
            width_m=self.number(element, "width", None),
            height_m=self.number(element, "height", None),
            radius_m=self.number(element, "radius", None),
            outlines=tuple(self.outline(child) for group in groups for child in group.iterfind("outline")),
            validity=self.validity(element),
        )

    def outline(self, element: Element) -> Outline:
        local = [
            [self.number(child, "u"), self.number(child, "v"), self.number(child, "z", 0.0)]
            for child in element.iterfind("cornerLocal")
        ]
        road = [
            [self.number(child, "s"), self.number(child, "t"), self.number(child, "dz", 0.0)]
            for child in element.iterfind("cornerRoad")
        ]
        if local and road:
            self.warn(element, "outline mixes cornerRoad and cornerLocal; only cornerRoad is read")
        return Outline(
            in_road_frame=bool(road),
            corners=read_only(np.array(road or local, dtype=np.float64).reshape(-1, 3)),
            closed=element.get("closed", "true") in ("true", "1"),
        )

    def junction(self, element: Element) -> Junction:
        connections = tuple(
            connection
            for child in element.iterfind("connection")
            if (connection := self.connection(child)) is not None
        )
        return Junction(
            id=self.text(element, "id"),
            name=element.get("name", ""),
            type=element.get("type", "default") or "default",
            connections=connections,
        )

    def connection(self, element: Element) -> Connection | None:
        incoming = element.get("incomingRoad")
        connecting = element.get("connectingRoad", element.get("linkedRoad"))
        contact_point = self.contact_point(element)
        if incoming is None or connecting is None or contact_point is None:
            self.warn(element, "connection without incomingRoad, connectingRoad or contactPoint; left out")
            return None
        return Connection(
            id=element.get("id", ""),
            incoming_road=incoming,
            connecting_road=connecting,
            contact_point=contact_point,
            lane_links=tuple(
                (self.integer(child, "from"), self.integer(child, "to"))
                for child in element.iterfind("laneLink")
            ),
        )


def _owner(element: Element) -> Element | None:
    """Return the road or junction that an element belongs to."""
    if element.tag in ("road", "junction"):
        return element
    return next(element.iterancestors("road", "junction"), None)


def _children(parent: Element | None, tag: str) -> list[Element]:
    return parent.findall(tag) if parent is not None else []
