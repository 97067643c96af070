"""OpenDRIVE XML to records.

What places roads and lanes is read at once; a wrong value there is an error with file, road, element and
line. Road marks, signals, objects and the like are read when first asked for; there, what is wrong is left
out with a `MapWarning`. To ask for the warnings reads everything.
"""

from functools import partial
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import TypeVar

import numpy as np

from opendrive.arrays import FloatArray, read_only
from opendrive.errors import MapContentError, MapWarning, WarningKind
from opendrive.model import (
    Controller,
    Deferred,
    Geometry,
    GeoOffset,
    Header,
    Junction,
    JunctionGroup,
    MapModel,
    Road,
    RoadDetails,
    Station,
)
from opendrive.xml.columns import read_geometry
from opendrive.xml.document import parse
from opendrive.xml.junctions import read_controller, read_junction, read_junction_group
from opendrive.xml.lanes import LaneReader
from opendrive.xml.objects import (
    read_object,
    read_object_reference,
    read_signal,
    read_signal_reference,
    read_station,
    read_structure,
    read_switch,
)
from opendrive.xml.road_records import RoadRecords
from opendrive.xml.roads import read_link, read_road_type, read_shape
from opendrive.xml.values import NO_CUBICS, Element, Values, children, first, other_attributes, others

_NO_SHAPES = read_only(np.empty((0, 6)))
_Record = TypeVar("_Record")


def read_map(path: str | PathLike[str]) -> MapModel:
    """Read an OpenDRIVE file (ASAM OpenDRIVE 1.4 to 1.8).

    Args:
        path: the ``.xodr`` file.

    Raises:
        MapReadError: the file does not exist, cannot be opened, is not well-formed XML or is not OpenDRIVE.
        MapContentError: a required element or attribute is missing, or has an impossible value.
    """
    return _MapReader(Path(path)).read()


class _MapReader:
    """Turns the children of the root into records."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.values = Values(str(file))
        self.lanes = LaneReader(self.values)
        self.header: Header | None = None
        self.junctions: dict[str, Junction] = {}
        self.controllers: dict[str, Controller] = {}
        self.groups: list[JunctionGroup] = []
        self.stations: list[Station] = []
        self.extra: list[str] = []

    def read(self) -> MapModel:
        values = self.values
        root = parse(self.file)
        elements: dict[str, Element] = {}
        for element in root:
            match element.tag:
                case "road":
                    self.add(element, elements, values.text(element, "id"), element)
                case "junction":
                    junction = read_junction(values, element)
                    self.add(element, self.junctions, junction.id, junction)
                case "controller":
                    controller = read_controller(values, element)
                    self.add(element, self.controllers, controller.id, controller)
                case "junctionGroup":
                    self.groups.append(read_junction_group(values, element))
                case "station":
                    self.stations.append(read_station(values, element))
                case "header" if self.header is None:
                    self.header = self.read_header(element)
                case _:
                    self.extra.extend(values.extra([element]))
        if self.header is None:
            raise MapContentError(f"{self.file}: <header> is missing; it may be truncated or not OpenDRIVE")
        if not elements:
            raise MapContentError(f"{self.file}: the map has no <road>; it may be truncated")
        geometry = read_geometry(root, list(elements.values()))
        self.roads = RoadRecords(elements, self.road, geometry)
        if geometry is None:
            for road_id in elements:
                self.roads[road_id]
        return MapModel(
            self.header,
            self.roads,
            self.junctions,
            Deferred(self.warnings),
            self.controllers,
            tuple(self.groups),
            tuple(self.stations),
            tuple(self.extra),
        )

    def warnings(self) -> tuple[MapWarning, ...]:
        """Read everything that was deferred, and return what was tolerated."""
        warnings = self.values.warnings
        used: set[tuple[str, str]] = set()
        for road in self.roads.values():
            for tag, records in (("signal", road.signals), ("object", road.objects)):
                for record in records:
                    if (tag, record.id) in used:
                        message = f"{tag} id {record.id!r:.80} is used twice; both are kept"
                        warnings.append(
                            MapWarning(road.id, tag, message, WarningKind.DUPLICATE_ID, record.s_m)
                        )
                    used.add((tag, record.id))
            for section in road.sections:
                for lane in section.lanes:
                    lane.details()
        return tuple(warnings)

    def add(self, element: Element, records: dict[str, _Record], name: str, record: _Record) -> None:
        if name in records:
            message = f"{element.tag} id {name!r:.80} is used twice; the first is kept"
            self.values.warn(WarningKind.DUPLICATE_ID, element, message)
        else:
            records[name] = record

    def read_header(self, element: Element) -> Header:
        values = self.values
        get = element.get
        geo, offset = first(element, "geoReference"), first(element, "offset")
        return Header(
            rev_major=values.integer(element, "revMajor", None) or 1,
            rev_minor=4 if (minor := values.integer(element, "revMinor", None)) is None else minor,
            name=get("name", ""),
            version=get("version", ""),
            date=get("date", ""),
            vendor=get("vendor", ""),
            north_m=values.number(element, "north", None),
            south_m=values.number(element, "south", None),
            east_m=values.number(element, "east", None),
            west_m=values.number(element, "west", None),
            geo_reference="" if geo is None else (geo.text or "").strip(),
            offset=None
            if offset is None
            else GeoOffset(
                values.number(offset, "x", 0.0),
                values.number(offset, "y", 0.0),
                values.number(offset, "z", 0.0),
                values.number(offset, "hdg", 0.0),
            ),
            extra=values.extra(others(element, "geoReference", "offset")),
        )

    def road(self, element: Element) -> Road:
        values = self.values
        get = element.get
        parts: dict[str, Element] = {str(child.tag): child for child in reversed(element)}
        lateral, lanes = parts.get("lateralProfile"), parts.get("lanes")
        if lanes is None:
            raise values.error(element, "<lanes> is missing; a road needs at least one lane section")
        length_m = values.length_m(element)
        left, right = self.crossfall(lateral)
        return Road(
            id=values.text(element, "id"),
            name=get("name", ""),
            length_m=length_m,
            junction_id=values.junction_id(element),
            rule=values.rule(element),
            predecessor=read_link(values, first(parts.get("link"), "predecessor")),
            successor=read_link(values, first(parts.get("link"), "successor")),
            geometries=self.geometries(element, parts.get("planView")),
            elevation=values.cubics(children(parts.get("elevationProfile"), "elevation")),
            superelevation=values.cubics(children(lateral, "superelevation")),
            crossfall_left=left,
            crossfall_right=right,
            shape=self.cross_sections(lateral),
            lane_offset=values.cubics(children(lanes, "laneOffset")),
            types=tuple([read_road_type(values, child) for child in children(element, "type")]),
            sections=self.lanes.sections(lanes, length_m),
            details=Deferred(partial(self.details, element)),
        )

    def details(self, element: Element) -> RoadDetails:
        """Return what is not needed to place the road."""
        values = self.values
        signals, objects = first(element, "signals"), first(element, "objects")
        railroad = first(element, "railroad")
        rest = others(element, "type", *_ROAD_PARTS)
        for part, known in _ROAD_PARTS.items():
            rest += others(first(element, part), *known)
        return RoadDetails(
            signals=values.each(partial(read_signal, values), children(signals, "signal")),
            signal_references=values.each(
                partial(read_signal_reference, values), children(signals, "signalReference")
            ),
            objects=values.each(partial(read_object, values), children(objects, "object")),
            object_references=values.each(
                partial(read_object_reference, values), children(objects, "objectReference")
            ),
            bridges=values.each(partial(read_structure, values), children(objects, "bridge")),
            tunnels=values.each(partial(read_structure, values), children(objects, "tunnel")),
            switches=values.each(partial(read_switch, values), children(railroad, "switch")),
            extra=values.extra(rest),
            attributes=other_attributes(element, _ROAD_NAMES),
        )

    # Profiles

    def crossfall(self, lateral: Element | None) -> tuple[FloatArray, FloatArray]:
        records = children(lateral, "crossfall")
        if not records:
            return NO_CUBICS, NO_CUBICS
        sides: dict[str, list[Element]] = {"left": [], "right": []}
        for record in records:
            side = record.get("side", "both")
            if side not in ("left", "right", "both"):
                raise self.values.error(
                    record, f"attribute 'side' is {side!r:.40}, expected 'left', 'right' or 'both'"
                )
            for name in sides if side == "both" else (side,):
                sides[name].append(record)
        left, right = (self.values.cubics(side) for side in sides.values())
        return left, right

    def cross_sections(self, lateral: Element | None) -> FloatArray:
        records = children(lateral, "shape")
        return (
            self.values.sorted_table(records, ("s", "t", "a", "b", "c", "d"), keys=2)
            if records
            else _NO_SHAPES
        )

    def geometries(self, road: Element, plan: Element | None) -> tuple[Geometry, ...]:
        values = self.values
        elements = children(plan, "geometry")
        if not elements:
            raise values.error(road, "<planView> has no <geometry>; a road needs a reference line")
        records = []
        for element in elements:
            s, x, y, heading = (values.number(element, name) for name in ("s", "x", "y", "hdg"))
            length = values.length_m(element)
            records.append(Geometry(s, x, y, heading, length, read_shape(values, element, s, length)))
        if any(later.s_m < earlier.s_m for earlier, later in pairwise(records)):
            message = "pieces of the reference line are not in ascending s; sorted"
            values.warn(WarningKind.ORDER, elements[0], message)
            records.sort(key=lambda record: record.s_m)
        return tuple(records)


_ROAD_NAMES = ("name", "length", "id", "junction", "rule")
_ROAD_PARTS = {
    "link": ("predecessor", "successor"),
    "planView": ("geometry",),
    "elevationProfile": ("elevation",),
    "lateralProfile": ("superelevation", "crossfall", "shape"),
    "lanes": ("laneOffset", "laneSection"),
    "signals": ("signal", "signalReference"),
    "objects": ("object", "objectReference", "bridge", "tunnel"),
    "railroad": ("switch",),
}
"""Parts of a road and what is read of them."""
