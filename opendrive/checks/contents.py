"""Defects of what a map lists: references to nothing, places beyond the road, missing parts."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from opendrive.errors import MapWarning, WarningKind
from opendrive.geo import GeoReferenceError, coordinate_system
from opendrive.model import MapModel, RoadDetails, RoadObject
from opendrive.roads.geometry import NetworkGeometry
from opendrive.roads.objects import MAX_COPIES, copies_asked
from opendrive.roads.road_records import RoadRecords

OFF_ROAD_M = 0.01
"""Signals and objects this much beyond their road still stand on it."""

BESIDE_M = 1000.0
"""Signals and objects this far beside their reference line do not belong to it: no lane lies there either."""


def content_warnings(geometry: NetworkGeometry, model: MapModel) -> Iterator[MapWarning]:
    """Yield what is wrong with the contents of a map."""
    yield from _geo_reference(model)
    rows = {road_id: r for r, road_id in enumerate(geometry.roads.id)}
    roads = [_RoadContent(road_id, rows[road_id], details) for road_id, details in _details(model)]
    for road in roads:
        yield from _beyond_road(road, geometry)
        yield from _validity(road, geometry)
        yield from _parts_of_objects(road)
    yield from _references(roads, geometry, model)


class _RoadContent(NamedTuple):
    """What stands on a road: its id, its row in the geometry's roads, its details."""

    id: str
    row: int
    details: RoadDetails


def _details(model: MapModel) -> Iterator[tuple[str, RoadDetails]]:
    """Yield id and details of the roads that have any."""
    if isinstance(model.roads, RoadRecords):
        yield from model.roads.details()
    else:
        for road in model.roads.values():
            yield road.id, road.details()


def _geo_reference(model: MapModel) -> Iterator[MapWarning]:
    text = model.header.geo_reference.strip()
    if not text:
        return
    try:
        coordinate_system(text)
    except GeoReferenceError as error:
        yield MapWarning("", "header/geoReference", str(error), WarningKind.GEO_REFERENCE)
    except ImportError:
        return


def _beyond_road(road: _RoadContent, geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield signals, objects and structures beyond the ends of their road, or far beside it."""
    details = road.details
    places = [("signal", item.id, item.s_m, item.t_m) for item in details.signals]
    places += [("signalReference", item.signal_id, item.s_m, item.t_m) for item in details.signal_references]
    places += [("objectReference", item.object_id, item.s_m, item.t_m) for item in details.object_references]
    for item in details.objects:
        places += [] if item.repeats else [("object", item.id, item.s_m, item.t_m)]
        for repeat in item.repeats:
            ends = (repeat.s_m, repeat.s_m + repeat.length_m)
            places += [("object/repeat", item.id, s_m, 0.0) for s_m in ends]
        for outline in item.outlines:
            if outline.in_road_frame and not item.repeats and len(outline.corners):
                along_m = outline.corners[:, 0]
                ends = (float(along_m.min()), float(along_m.max()))
                places += [("object/outline", item.id, s_m, 0.0) for s_m in ends]
    for name, structures in (("bridge", details.bridges), ("tunnel", details.tunnels)):
        for structure in structures:
            ends = (structure.s_m, structure.s_m + structure.length_m)
            places += [(name, structure.id, s_m, 0.0) for s_m in ends]
    for element, item_id, s_m, t_m in places:
        yield from _beyond(road.id, element, item_id, s_m, t_m, float(geometry.roads.length_m[road.row]))
    for signal in details.signals:
        if (position := signal.position) is not None and position.road_id in geometry.roads.id:
            s_m, t_m, _ = position.position_m
            length_m = float(geometry.roads.length_m[geometry.roads.id.index(position.road_id)])
            yield from _beyond(position.road_id, "signal/positionRoad", signal.id, s_m, t_m, length_m)


def _beyond(
    road_id: str, element: str, item_id: str, s_m: float, t_m: float, length_m: float
) -> Iterator[MapWarning]:
    excess_m = max(-s_m, s_m - length_m)
    if excess_m > OFF_ROAD_M:
        message = f"{element} {item_id!r:.40} is {excess_m:.3g} m beyond the road, 0 to {length_m:.6g} m"
        yield MapWarning(road_id, element, message, WarningKind.BEYOND_ROAD, s_m, None, excess_m, "m")
    if abs(t_m) > BESIDE_M:
        message = f"{element} {item_id!r:.40} is {abs(t_m):.3g} m beside the reference line"
        yield MapWarning(road_id, element, message, WarningKind.BEYOND_ROAD, s_m, None, abs(t_m), "m")


def _validity(road: _RoadContent, geometry: NetworkGeometry) -> Iterator[MapWarning]:
    """Yield signals and objects that apply to lanes of which the road has none where they stand."""
    details = road.details
    records = (
        details.signals, details.signal_references, details.objects, details.object_references,
        details.bridges, details.tunnels,
    )  # fmt: skip
    for item in (item for of_kind in records for item in of_kind if item.validity):
        ids = _lane_ids(geometry, road.row, item.s_m)
        for lanes in item.validity:
            low, high = sorted((lanes.from_lane, lanes.to_lane))
            if ids and not any(low <= lane_id <= high for lane_id in ids):
                message = (
                    f"applies to lanes {low} to {high}, of which the road has none at s = {item.s_m:.6g} m"
                )
                yield MapWarning(road.id, "validity", message, WarningKind.REFERENCE, item.s_m, low)


def _lane_ids(geometry: NetworkGeometry, road: int, s_m: float) -> list[int]:
    """Return the ids of the lanes at a place of a road, with 0; none before its first lane section."""
    lanes = geometry.lanes
    sections = np.flatnonzero((lanes.sections.road == road) & (lanes.sections.start_m <= s_m))
    if not sections.size:
        return []
    first, after = np.searchsorted(lanes.section, [sections[-1], sections[-1] + 1])
    return [0, *(key.lane_id for key in lanes.key[first:after])]


def _parts_of_objects(road: _RoadContent) -> Iterator[MapWarning]:
    """Yield repeats and outlines that have no extent, and parts of objects that name no corner or outline."""

    def odd(kind: WarningKind, element: str, item: RoadObject, message: str) -> MapWarning:
        return MapWarning(road.id, element, f"object {item.id!r:.40}: {message}", kind, item.s_m)

    for item in road.details.objects:
        for repeat in item.repeats:
            for name, value in (("distance", repeat.distance_m), ("length", repeat.length_m)):
                if value < 0.0:
                    message = f"the {name} of a repeat is {value:.3g} m; read as 0"
                    yield odd(WarningKind.UNKNOWN_VALUE, "object/repeat", item, message)
            if repeat.distance_m > 0.0 and (asked := copies_asked(repeat)) > MAX_COPIES:
                message = f"a repeat asks for {asked:.3g} copies; the first {MAX_COPIES} are read"
                yield odd(WarningKind.LEFT_OUT, "object/repeat", item, message)
        for outline in item.outlines:
            if item.type == "crosswalk" and len(outline.corners) < 3:
                message = f"an outline of {len(outline.corners)} corners encloses nothing; left out"
                yield odd(WarningKind.MISSING, "object/outline", item, message)
        corners = {name for outline in item.outlines for name in outline.corner_ids}
        outlines = {outline.id for outline in item.outlines}
        parts = [("object/marking", marking.corner_ids) for marking in item.markings]
        parts += [("object/border", border.corner_ids) for border in item.borders]
        for element, name in ((element, name) for element, names in parts for name in names):
            if name not in corners:
                message = f"refers to corner {name!r:.40}, not in its outlines"
                yield odd(WarningKind.REFERENCE, element, item, message)
        for border in item.borders:
            if border.outline_id and border.outline_id not in outlines:
                message = f"refers to outline {border.outline_id!r:.40}, which it has not"
                yield odd(WarningKind.REFERENCE, "object/border", item, message)


def _references(
    roads: Sequence[_RoadContent], geometry: NetworkGeometry, model: MapModel
) -> Iterator[MapWarning]:
    """Yield references to signals, objects, roads, controllers and junctions that are not in the map."""
    signals = {item.id for road in roads for item in road.details.signals}
    objects = {item.id for road in roads for item in road.details.objects}
    road_ids = set(geometry.roads.id)

    def missing(owner: str, element: str, what: str, name: str, s_m: float | None = None) -> MapWarning:
        message = f"refers to {what} {name!r:.40}, not in the map; not followed"
        return MapWarning(owner, element, message, WarningKind.REFERENCE, s_m)

    for road in roads:
        details = road.details
        for reference in details.signal_references:
            if reference.signal_id not in signals:
                yield missing(road.id, "signalReference", "signal", reference.signal_id, reference.s_m)
        for object_reference in details.object_references:
            if object_reference.object_id not in objects:
                name = object_reference.object_id
                yield missing(road.id, "objectReference", "object", name, object_reference.s_m)
        for signal in details.signals:
            for dependency in signal.dependencies:
                if dependency.signal_id not in signals:
                    yield missing(road.id, "signal/dependency", "signal", dependency.signal_id, signal.s_m)
            for link in signal.links:
                known = objects if link.element_type == "object" else signals
                if link.element_id not in known:
                    what = link.element_type or "signal"
                    yield missing(road.id, "signal/reference", what, link.element_id, signal.s_m)
            if signal.position is not None and signal.position.road_id not in {"", *road_ids}:
                yield missing(road.id, "signal/positionRoad", "road", signal.position.road_id, signal.s_m)
        for switch in details.switches:
            for track in (switch.main_track, switch.side_track):
                if track.road_id not in road_ids:
                    yield missing(road.id, "railroad/switch", "road", track.road_id)
    for controller in model.controllers.values():
        for control in controller.controls:
            if control.signal_id not in signals:
                yield missing("", f"controller {controller.id!r:.40}", "signal", control.signal_id)
    for station in model.stations:
        for segment in (segment for platform in station.platforms for segment in platform.segments):
            if segment.road_id not in road_ids:
                yield missing("", f"station {station.id!r:.40}", "road", segment.road_id)
    for junction in model.junctions.values():
        for use in junction.controllers:
            if use.controller_id not in model.controllers:
                yield missing(junction.id, "junction/controller", "controller", use.controller_id)
        named = [("junction/priority", name) for p in junction.priorities for name in (p.high, p.low) if name]
        named += [("junction/roadSection", crossing.road_id) for crossing in junction.crossing_roads]
        for path in junction.cross_paths:
            named += [
                ("junction/crossPath", name)
                for name in (path.crossing_road, path.road_at_start, path.road_at_end)
            ]
        named += [("junction", junction.main_road)] if junction.main_road else []
        for element, name in named:
            if name not in road_ids:
                yield missing(junction.id, element, "road", name)
    for group in model.junction_groups:
        for junction_id in group.junction_ids:
            if junction_id not in model.junctions:
                yield missing("", f"junctionGroup {group.id!r:.40}", "junction", junction_id)
