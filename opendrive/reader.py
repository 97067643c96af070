"""OpenDRIVE XML to records.

What places roads and lanes is read at once; a wrong value there is an error with file, road, element and
line. Road marks, signals, objects and the like are read when first asked for; there, what is wrong is left
out with a `MapWarning`. To ask for the warnings reads everything.
"""

from functools import partial
from itertools import pairwise
from os import PathLike
from pathlib import Path
from typing import NamedTuple, TypeVar

import numpy as np

from opendrive.arrays import FloatArray, read_only
from opendrive.errors import MapContentError, MapWarning, WarningKind
from opendrive.junction_reader import (
    read_controller,
    read_junction,
    read_junction_group,
    read_link,
)
from opendrive.lane_reader import LaneReader, SectionDraft
from opendrive.model import (
    Arc,
    Controller,
    Deferred,
    Geometry,
    GeoOffset,
    Header,
    Junction,
    JunctionGroup,
    Line,
    MapModel,
    ParamPoly3,
    Poly3,
    Road,
    RoadDetails,
    RoadType,
    Shape,
    Spiral,
    Station,
    TrafficRule,
)
from opendrive.object_reader import (
    read_object,
    read_object_reference,
    read_signal,
    read_signal_reference,
    read_station,
    read_structure,
    read_switch,
)
from opendrive.values import MAX_LENGTH_M, NO_CUBICS, ROWS, Element, Values, children, first, others
from opendrive.xml_document import parse

MAX_TURN_RAD = 1000.0
"""A piece of reference line that turns further than this is refused."""

_NO_SHAPES = read_only(np.empty((0, 6)))
_LINE = Line()
_Named = TypeVar("_Named", Road, Junction, Controller)


def read_map(path: str | PathLike[str]) -> MapModel:
    """Read an OpenDRIVE file (ASAM OpenDRIVE 1.4 to 1.8).

    Args:
        path: the ``.xodr`` file.

    Raises:
        MapReadError: the file does not exist, cannot be opened, is not well-formed XML or is not OpenDRIVE.
        MapContentError: a required element or attribute is missing, or has an impossible value.
    """
    return _MapReader(Path(path)).read()


class _RoadDraft(NamedTuple):
    """A road whose numbers are collected, but not yet converted."""

    element: Element
    parts: dict[str, Element]
    pieces: list[Element]
    piece_rows: range
    elevation: range
    superelevation: range
    lane_offset: range
    sections: list[SectionDraft]


class _MapReader:
    """Turns the children of the root into records."""

    def __init__(self, file: Path) -> None:
        self.file = file
        self.values = Values(str(file))
        self.lanes = LaneReader(self.values)
        self.header: Header | None = None
        self.roads: dict[str, Road] = {}
        self.junctions: dict[str, Junction] = {}
        self.controllers: dict[str, Controller] = {}
        self.groups: list[JunctionGroup] = []
        self.stations: list[Station] = []
        self.extra: list[str] = []

    def read(self) -> MapModel:
        values = self.values
        drafts: list[_RoadDraft] = []
        for element in parse(self.file):
            match element.tag:
                case "road":
                    drafts.append(self.draft(element))
                case "junction":
                    self.add(element, self.junctions, read_junction(values, element))
                case "controller":
                    self.add(element, self.controllers, read_controller(values, element))
                case "junctionGroup":
                    self.groups.append(read_junction_group(values, element))
                case "station":
                    self.stations.append(read_station(values, element))
                case "header" if self.header is None:
                    self.header = self.read_header(element)
                case _:
                    self.extra.extend(values.extra([element]))
        values.convert_rows()
        for draft in drafts:
            self.add(draft.element, self.roads, self.road(draft))
        if self.header is None:
            raise MapContentError(f"{self.file}: <header> is missing; it may be truncated or not OpenDRIVE")
        if not self.roads:
            raise MapContentError(f"{self.file}: the map has no <road>; it may be truncated")
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

    def add(self, element: Element, records: dict[str, _Named], record: _Named) -> None:
        if record.id in records:
            message = f"{element.tag} id {record.id!r:.80} is used twice; the first is kept"
            self.values.warn(WarningKind.DUPLICATE_ID, element, message)
        else:
            records[record.id] = record

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

    def draft(self, element: Element) -> _RoadDraft:
        """Collect the numbers of a road."""
        values = self.values
        parts: dict[str, Element] = {str(child.tag): child for child in reversed(element)}
        lanes = parts.get("lanes")
        if lanes is None:
            raise values.error(element, "<lanes> is missing; a road needs at least one lane section")
        pieces = children(parts.get("planView"), "geometry")
        if not pieces:
            raise values.error(element, "<planView> has no <geometry>; a road needs a reference line")
        return _RoadDraft(
            element,
            parts,
            pieces,
            values.add_rows(pieces, ROWS["geometry"]),
            self.rows(parts.get("elevationProfile"), "elevation"),
            self.rows(parts.get("lateralProfile"), "superelevation"),
            self.rows(lanes, "laneOffset"),
            self.lanes.drafts(lanes),
        )

    def road(self, draft: _RoadDraft) -> Road:
        """Return a road, once its numbers are converted."""
        values = self.values
        element, parts = draft.element, draft.parts
        get = element.get
        lateral, link = parts.get("lateralProfile"), parts.get("link")
        length_m = values.length_m(element)
        left, right = self.crossfall(lateral)
        junction = get("junction", "-1")
        return Road(
            id=values.text(element, "id"),
            name=get("name", ""),
            length_m=length_m,
            junction_id=None if junction in ("-1", "") else junction,
            rule=self.rule(element),
            predecessor=read_link(values, link, "predecessor"),
            successor=read_link(values, link, "successor"),
            geometries=self.geometries(draft.pieces, draft.piece_rows),
            elevation=values.cubics(draft.elevation),
            superelevation=values.cubics(draft.superelevation),
            crossfall_left=left,
            crossfall_right=right,
            shape=self.cross_sections(lateral),
            lane_offset=values.cubics(draft.lane_offset),
            types=tuple([self.road_type(child) for child in children(element, "type")])
            if "type" in parts
            else (),
            sections=self.lanes.sections(draft.sections, length_m),
            details=Deferred(partial(self.details, element)),
        )

    def rows(self, parent: Element | None, tag: str) -> range:
        return self.values.add_rows(children(parent, tag), ROWS[tag])

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
        )

    def rule(self, element: Element) -> TrafficRule:
        value = element.get("rule", "RHT")
        if value not in ("RHT", "LHT"):
            raise self.values.error(element, f"attribute 'rule' is {value!r:.40}, expected 'RHT' or 'LHT'")
        return "LHT" if value == "LHT" else "RHT"

    def road_type(self, element: Element) -> RoadType:
        speed = first(element, "speed")
        get = element.get
        return RoadType(
            s_m=self.values.number(element, "s", 0.0),
            type=get("type", "unknown"),
            country=get("country", ""),
            speed_mps=None if speed is None else self.values.speed_mps(speed),
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
        left, right = (self.values.sorted_table(side, ("s", "a", "b", "c", "d")) for side in sides.values())
        return left, right

    def cross_sections(self, lateral: Element | None) -> FloatArray:
        records = children(lateral, "shape")
        return (
            self.values.sorted_table(records, ("s", "t", "a", "b", "c", "d"), keys=2)
            if records
            else _NO_SHAPES
        )

    # Reference line

    def geometries(self, elements: list[Element], rows: range) -> tuple[Geometry, ...]:
        numbers = self.values.table[rows.start : rows.stop].tolist()
        records = [self.geometry(element, row) for element, row in zip(elements, numbers, strict=True)]
        if any(later.s_m < earlier.s_m for earlier, later in pairwise(records)):
            message = "pieces of the reference line are not in ascending s; sorted"
            self.values.warn(WarningKind.ORDER, elements[0], message)
            records.sort(key=lambda record: record.s_m)
        return tuple(records)

    def geometry(self, element: Element, row: list[float]) -> Geometry:
        values = self.values
        if not 0.0 <= row[4] <= MAX_LENGTH_M:
            raise values.error(element, f"attribute 'length' is {row[4]:g}, expected 0 to {MAX_LENGTH_M:g} m")
        child = next((child for child in element if child.tag != "userData"), None)
        if child is None:
            raise values.error(element, "has no shape; expected line, arc, spiral, poly3 or paramPoly3")
        shape = _LINE if child.tag == "line" else self.shape(child, row[0], row[4])
        return Geometry(row[0], row[1], row[2], row[3], row[4], shape)

    def shape(self, element: Element, s_m: float, length_m: float) -> Shape:
        values = self.values
        number = values.number
        shape: Shape
        turn_rad = 0.0
        match element.tag:
            case "arc":
                shape = Arc(number(element, "curvature"))
                turn_rad = abs(shape.curvature_per_m) * length_m
                if shape.curvature_per_m == 0.0:
                    kind = WarningKind.ARC_WITHOUT_CURVATURE
                    values.warn(kind, element, "arc of curvature 0; read as a line", s_m)
            case "spiral":
                start, end = number(element, "curvStart"), number(element, "curvEnd")
                shape = Spiral(start, end)
                turn_rad = max(abs(start), abs(end)) * length_m
                if start == end:
                    read_as = "an arc" if start else "a line"
                    kind = WarningKind.CONSTANT_SPIRAL
                    values.warn(kind, element, f"spiral of constant curvature; read as {read_as}", s_m)
            case "poly3":
                shape = Poly3(
                    (number(element, "a"), number(element, "b"), number(element, "c"), number(element, "d"))
                )
            case "paramPoly3":
                u0, u1, u2, u3 = (number(element, name) for name in ("aU", "bU", "cU", "dU"))
                v0, v1, v2, v3 = (number(element, name) for name in ("aV", "bV", "cV", "dV"))
                # Before 1.4 the attribute did not exist; the range was [0, 1].
                p_range = element.get("pRange", "normalized")
                if p_range not in ("normalized", "arcLength"):
                    raise values.error(
                        element,
                        f"attribute 'pRange' is {p_range!r:.40}, expected 'normalized' or 'arcLength'",
                    )
                shape = ParamPoly3((u0, u1, u2, u3), (v0, v1, v2, v3), p_range == "normalized")
            case other:
                raise values.error(
                    element, f"has the shape <{other:.40}>, expected line, arc, spiral, poly3 or paramPoly3"
                )
        if turn_rad > MAX_TURN_RAD:
            raise values.error(
                element, f"the piece turns by {turn_rad:.3g} rad; check its curvature and length"
            )
        return shape


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
