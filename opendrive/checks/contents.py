"""Defects of what a map lists: references to nothing, places beyond the road, missing parts."""

from collections.abc import Iterator

from opendrive.errors import MapWarning, WarningKind
from opendrive.geo import GeoReferenceError, projection_text
from opendrive.model import MapModel, Road

OFF_ROAD_M = 0.01
"""Signals and objects this much beyond their road still stand on it."""


def content_warnings(model: MapModel) -> Iterator[MapWarning]:
    """Yield what is wrong with the contents of a map."""
    yield from _geo_reference(model)
    for road in model.roads.values():
        yield from _centre_lanes(road)
        yield from _beyond_road(road)
        yield from _validity(road)
    yield from _references(model)


def _geo_reference(model: MapModel) -> Iterator[MapWarning]:
    text = model.header.geo_reference.strip()
    if not text:
        return
    reason = ""
    try:
        from pyproj import CRS
        from pyproj.exceptions import ProjError
    except ImportError:
        return
    try:
        CRS.from_user_input(projection_text(text))
    except GeoReferenceError as error:
        reason = str(error)
    except ProjError as error:
        reason = f"geoReference {text!r:.120}: {str(error).splitlines()[0]}"
    if reason:
        yield MapWarning("", "header/geoReference", reason, WarningKind.GEO_REFERENCE)


def _centre_lanes(road: Road) -> Iterator[MapWarning]:
    for section in road.sections:
        if not any(lane.id == 0 for lane in section.lanes):
            message = f"the lane section at s = {section.s_m:.6g} m has no centre lane"
            yield MapWarning(road.id, "laneSection", message, WarningKind.MISSING, section.s_m, 0)


def _beyond_road(road: Road) -> Iterator[MapWarning]:
    """Yield signals, objects and structures whose place is beyond the ends of their road."""
    places = [("signal", item.id, item.s_m) for item in road.signals]
    places += [("signalReference", item.signal_id, item.s_m) for item in road.signal_references]
    places += [("objectReference", item.object_id, item.s_m) for item in road.object_references]
    for item in road.objects:
        places += [] if item.repeats else [("object", item.id, item.s_m)]
        for repeat in item.repeats:
            ends = (repeat.s_m, repeat.s_m + repeat.length_m)
            places += [("object/repeat", item.id, s_m) for s_m in ends]
    for name, structures in (("bridge", road.bridges), ("tunnel", road.tunnels)):
        for structure in structures:
            ends = (structure.s_m, structure.s_m + structure.length_m)
            places += [(name, structure.id, s_m) for s_m in ends]
    for element, item_id, s_m in places:
        excess_m = max(-s_m, s_m - road.length_m)
        if excess_m > OFF_ROAD_M:
            message = (
                f"{element} {item_id!r:.40} is {excess_m:.3g} m beyond the road, 0 to {road.length_m:.6g} m"
            )
            yield MapWarning(road.id, element, message, WarningKind.BEYOND_ROAD, s_m, None, excess_m, "m")


def _validity(road: Road) -> Iterator[MapWarning]:
    """Yield signals that apply to lanes of which the road has none where they stand."""
    applied = [(signal.s_m, signal.validity) for signal in road.signals]
    applied += [(reference.s_m, reference.validity) for reference in road.signal_references]
    for s_m, validity in applied:
        section = next((s for s in reversed(road.sections) if s.s_m <= s_m), None)
        ids = [] if section is None else [lane.id for lane in section.lanes]
        for lanes in validity:
            low, high = sorted((lanes.from_lane, lanes.to_lane))
            if ids and not any(low <= lane_id <= high for lane_id in ids):
                message = f"applies to lanes {low} to {high}, of which the road has none at s = {s_m:.6g} m"
                yield MapWarning(road.id, "validity", message, WarningKind.REFERENCE, s_m, low)


def _references(model: MapModel) -> Iterator[MapWarning]:
    """Yield references to signals, objects, controllers and junctions that are not in the map."""
    roads = model.roads.values()
    signals = {item.id for road in roads for item in road.signals}
    objects = {item.id for road in roads for item in road.objects}

    def missing(owner: str, element: str, what: str, name: str, s_m: float | None = None) -> MapWarning:
        message = f"refers to {what} {name!r:.40}, not in the map; not followed"
        return MapWarning(owner, element, message, WarningKind.REFERENCE, s_m)

    for road in roads:
        for reference in road.signal_references:
            if reference.signal_id not in signals:
                yield missing(road.id, "signalReference", "signal", reference.signal_id, reference.s_m)
        for object_reference in road.object_references:
            if object_reference.object_id not in objects:
                name = object_reference.object_id
                yield missing(road.id, "objectReference", "object", name, object_reference.s_m)
        for signal in road.signals:
            for dependency in signal.dependencies:
                if dependency.signal_id not in signals:
                    yield missing(road.id, "signal/dependency", "signal", dependency.signal_id, signal.s_m)
            for link in signal.links:
                known = objects if link.element_type == "object" else signals
                if link.element_id not in known:
                    what = link.element_type or "signal"
                    yield missing(road.id, "signal/reference", what, link.element_id, signal.s_m)
    for controller in model.controllers.values():
        for control in controller.controls:
            if control.signal_id not in signals:
                yield missing("", f"controller {controller.id!r:.40}", "signal", control.signal_id)
    for junction in model.junctions.values():
        for use in junction.controllers:
            if use.controller_id not in model.controllers:
                yield missing(junction.id, "junction/controller", "controller", use.controller_id)
    for group in model.junction_groups:
        for junction_id in group.junction_ids:
            if junction_id not in model.junctions:
                yield missing("", f"junctionGroup {group.id!r:.40}", "junction", junction_id)
