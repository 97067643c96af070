"""CommonRoad's lanelets, signs, lights and intersections (XML format 2020a).

https://commonroad.in.tum.de and the documentation of commonroad-io say what the elements mean.
"""

import re
from collections import Counter
from dataclasses import dataclass
from os import PathLike
from pathlib import Path

import numpy as np
from lxml import etree

from opendrive.arrays import FloatArray, wrapped
from opendrive.formats.contents import (
    USERS,
    Export,
    PlacedSignal,
    crossing_bounds,
    folded_note,
    other_objects,
    placed_signals,
)
from opendrive.formats.lanelets import Border, Lanelet, Lanelets, lanelets_of
from opendrive.network import RoadNetwork

_DECIMALS = 4
_UNKNOWN_PLACE = "999"
"""CommonRoad's latitude and longitude of a place that is not on earth, or not known."""

_ROAD_TYPES = {
    "town": "urban",
    "lowSpeed": "urban",
    "townLocal": "urban",
    "townCollector": "urban",
    "townArterial": "urban",
    "townExpressway": "urban",
    "townPlayStreet": "urban",
    "townPrivate": "urban",
    "rural": "country",
    "motorway": "interstate",
}
_LANE_TYPES = {
    "bus": "busLane",
    "biking": "bicycleLane",
    "sidewalk": "sidewalk",
    "walking": "sidewalk",
    "shoulder": "shoulder",
    "stop": "shoulder",
    "parking": "parking",
    "border": "border",
    "restricted": "restricted",
    "exit": "exitRamp",
    "offRamp": "exitRamp",
    "mwyExit": "exitRamp",
    "entry": "accessRamp",
    "onRamp": "accessRamp",
    "mwyEntry": "accessRamp",
}
_DIRECTED_TYPES = {"driving", "bidirectional", "connectingRamp", "slipLane", "HOV", "taxi", "shared"}

_SIGNS = (
    " 101 102 103-10 103-20 108 114 123 124 125 131 133-10 133-20 138 142-10 145-50 201 205 206 208 209-10 "
    " 209-20 209-30 211-20 215 220-10 220-20 222-10 222-20 237 239 240 242.1 242.2 244.1 244.2 245 250 251 "
    " 253 254 255 259 260 261 262 264 265 266 267 270.1 270.2 272 275 276 277 278 280 281 282 283-10 "
    " 283-30 286-30 301 306 308 310 311 314 325.1 325.2 327 328 330.1 330.2 331.1 331.2 332 333 350 354 "
    " 356 357 363 "
)
"""Signs that commonroad-io 2026.1 knows, of the German catalogue (`TrafficSignIDZamunda`), up to 399."""

_MARKS = {"solid": "solid", "broken": "dashed"}

_STRAIGHT_RAD = np.pi / 4
"""A way through an intersection that turns by less goes straight on."""


def write_commonroad(network: RoadNetwork, path: str | PathLike[str]) -> Export:
    """Write the lanes of a network as a CommonRoad file without obstacles or planning problems.

    Args:
        network: the map.
        path: file to write, ``.xml``.

    Raises:
        OSError: the file cannot be written.
    """
    pieces = lanelets_of(network)
    file = _File(network, pieces)
    root = file.written()
    content = etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True)
    Path(path).write_bytes(content)
    counts = {
        "lanelets": len(root.findall("lanelet")),
        "traffic signs": len(root.findall("trafficSign")),
        "traffic lights": len(root.findall("trafficLight")),
        "intersections": len(root.findall("intersection")),
    }
    return Export(counts, file.left_out, tuple(file.notes))


@dataclass(frozen=True, slots=True)
class _Way:
    """A way through a junction: its first lanelet inside, and by how much it turns, rad."""

    first: int
    turn_rad: float


class _File:
    """A CommonRoad file in the making; ids are those of lanelets plus one, and then counted on."""

    def __init__(self, network: RoadNetwork, pieces: Lanelets) -> None:
        self.network = network
        self.pieces = pieces
        self.left_out: Counter[str] = Counter(pieces.left_out)
        self.notes = folded_note(pieces)
        self.next_id = len(pieces.lanelets) + 1

    def written(self) -> etree._Element:
        name = "".join(c for c in self.network.name.title() if c.isalnum() and c.isascii()) or "Map"
        root = etree.Element(
            "commonRoad",
            timeStepSize="0.1",
            commonRoadVersion="2020a",
            author="",
            affiliation="",
            source="ASAM OpenDRIVE, by smartmot",
            date="2020-01-01",
            benchmarkID=f"ZAM_{name}-1_1_T-1",
        )
        self._location(etree.SubElement(root, "location"))
        etree.SubElement(root, "scenarioTags")
        signals = self._known(placed_signals(self.network, self.pieces, self.left_out))
        signs, lights = [[s for s in signals if s.is_light == light] for light in (False, True)]
        limits = self._limits()
        sign_ids = {id(signal): self._new_id() for signal in (*signs, *lights)}
        limit_ids = {limit: self._new_id() for limit in limits}
        refs: dict[int, list[tuple[str, int]]] = {}
        for signal in (*signs, *lights):
            tag = "trafficLightRef" if signal.is_light else "trafficSignRef"
            for i in signal.lanelets:
                refs.setdefault(i, []).append((tag, sign_ids[id(signal)]))
        for limit, members in limits.items():
            for i in members:
                refs.setdefault(i, []).append(("trafficSignRef", limit_ids[limit]))
        for i, lanelet in enumerate(self.pieces.lanelets):
            self._lanelet(
                root, i, lanelet, sorted(refs.get(i, ()), key=lambda ref: (ref[0] != "trafficSignRef", ref))
            )
        crossing_ids = self._crosswalks(root)
        for signal in signs:
            code = _sign_code(signal)
            values = [] if signal.signal.value is None else [signal.signal.value]
            self._sign(root, sign_ids[id(signal)], code, values, signal.xyz_m, virtual=False)
        for limit, members in limits.items():
            bounds = self.pieces.bounds(self.pieces.lanelets[members[0]])
            self._sign(root, limit_ids[limit], "274", [limit[1]], tuple(bounds[1][0].tolist()), virtual=True)
        for signal in lights:
            self._light(root, sign_ids[id(signal)], signal)
        self._intersections(root, crossing_ids)
        for kind, count in Counter(other_objects(self.network)).items():
            self.left_out[f"objects of type {kind}"] += count
        return root

    def _new_id(self) -> int:
        self.next_id += 1
        return self.next_id - 1

    def _location(self, location: etree._Element) -> None:
        header = self.network.model.header
        for tag, text in (
            ("geoNameId", "-999"),
            ("gpsLatitude", _UNKNOWN_PLACE),
            ("gpsLongitude", _UNKNOWN_PLACE),
        ):
            etree.SubElement(location, tag).text = text
        if header.geo_reference.strip():
            transformation = etree.SubElement(location, "geoTransformation")
            etree.SubElement(transformation, "geoReference").text = header.geo_reference.strip()
            offset = header.offset
            if offset is not None:
                further = etree.SubElement(transformation, "additionalTransformation")
                for tag, value in (
                    ("xTranslation", offset.x_m),
                    ("yTranslation", offset.y_m),
                    ("zRotation", offset.heading_rad),
                    ("scaling", 1.0),
                ):
                    etree.SubElement(further, tag).text = repr(float(value))

    # Lanelets

    def _lanelet(self, root: etree._Element, i: int, lanelet: Lanelet, refs: list[tuple[str, int]]) -> None:
        pieces, lanes = self.pieces, self.network.lanes
        element = etree.SubElement(root, "lanelet", id=str(i + 1))
        key = lanes.key[lanelet.lane]
        name = f"{key.road_id}/{key.section}/{key.lane_id}"
        # No comment may hold two hyphens, or characters that XML cannot hold.
        element.append(etree.Comment(f" OpenDRIVE {re.sub('-(?=-)', '- ', name)} "))
        for tag, border, xyz_m in zip(
            ("leftBound", "rightBound"), (lanelet.left, lanelet.right), pieces.bounds(lanelet), strict=True
        ):
            self._bound(element, tag, xyz_m, self._marking(pieces.borders[border], lanelet.forward))
        for tag, others in (("predecessor", lanelet.predecessors), ("successor", lanelet.successors)):
            for other in others:
                etree.SubElement(element, tag, ref=str(other + 1))
        for tag, neighbour in (
            ("adjacentLeft", lanelet.left_neighbour),
            ("adjacentRight", lanelet.right_neighbour),
        ):
            if neighbour is not None:
                same = pieces.lanelets[neighbour].forward == lanelet.forward
                way = "same" if same else "opposite"
                etree.SubElement(element, tag, ref=str(neighbour + 1), drivingDir=way)
        lane_type = str(lanes.lane_type[lanelet.lane])
        for kind in self._types(lanelet, lane_type):
            etree.SubElement(element, "laneletType").text = kind
        both = lane_type == "bidirectional" or self._direction(lanelet.lane) == "both"
        user = USERS.get(lane_type)
        if user is not None:
            tag = "userBidirectional" if both or user == "pedestrian" else "userOneWay"
            etree.SubElement(element, tag).text = user
        for tag, number in refs:
            etree.SubElement(element, tag, ref=str(number))

    def _direction(self, lane: int) -> str:
        key = self.network.lanes.key[lane]
        section = self.network.model.roads[key.road_id].sections[key.section]
        return next(record.direction for record in section.lanes if record.id == key.lane_id)

    def _types(self, lanelet: Lanelet, lane_type: str) -> list[str]:
        lanes = self.network.lanes
        key = lanes.key[lanelet.lane]
        if lane_type in _LANE_TYPES:
            kinds = [_LANE_TYPES[lane_type]]
        elif lane_type in _DIRECTED_TYPES:
            types = [
                t for t in self.network.model.roads[key.road_id].types if t.s_m <= lanelet.s_start_m + 1e-6
            ]
            kinds = [_ROAD_TYPES.get(types[-1].type if types else "", "unknown")]
        else:
            self.left_out[f"types of lanelets: {lane_type} (written as unknown)"] += 1
            kinds = ["unknown"]
        return [*kinds, "intersection"] if lanes.junction_id[lanelet.lane] is not None else kinds

    def _marking(self, border: Border, forward: bool) -> str:
        if not border.marks:
            return "no_marking"
        if border.marks == ("curb",):
            return "curb"
        words = [_MARKS.get(mark, "") for mark in border.marks]
        if not all(words) or len(words) > 2:
            self.left_out[f"road marks of type {' '.join(border.marks)} (written as unknown)"] += 1
            return "unknown"
        if len(words) == 1:
            return f"broad_{words[0]}" if border.is_bold else words[0]
        return "_".join(words if forward else words[::-1])

    def _bound(self, parent: etree._Element, tag: str, xyz_m: FloatArray, marking: str) -> None:
        bound = etree.SubElement(parent, tag)
        for point in xyz_m.tolist():
            _point(bound, point)
        etree.SubElement(bound, "lineMarking").text = marking

    def _crosswalks(self, root: etree._Element) -> dict[int, str]:
        """Write the crosswalks as lanelets; the road of each by its id."""
        road_of: dict[int, str] = {}
        for crosswalk in self.network.crosswalks:
            number = self._new_id()
            road_of[number] = crosswalk.road_id
            element = etree.SubElement(root, "lanelet", id=str(number))
            for tag, xyz_m in zip(
                ("leftBound", "rightBound"), crossing_bounds(self.network, crosswalk), strict=True
            ):
                self._bound(element, tag, xyz_m, "no_marking")
            etree.SubElement(element, "laneletType").text = "crosswalk"
            etree.SubElement(element, "userBidirectional").text = "pedestrian"
        return road_of

    # Signs and lights

    def _limits(self) -> dict[tuple[str, float], list[int]]:
        """Return the lanelets of each road and speed limit."""
        limits: dict[tuple[str, float], list[int]] = {}
        for i, lanelet in enumerate(self.pieces.lanelets):
            if lanelet.speed_mps is not None:
                road_id = self.network.lanes.key[lanelet.lane].road_id
                limits.setdefault((road_id, lanelet.speed_mps), []).append(i)
        return limits

    def _known(self, signals: list[PlacedSignal]) -> list[PlacedSignal]:
        """Return the signals that CommonRoad has a name for."""
        kept = []
        for signal in signals:
            if signal.is_limit:
                self.left_out["signs of speed limits (lanelets have those of their lanes)"] += 1
            elif not signal.is_light and not _sign_code(signal):
                kind = signal.signal.type
                self.left_out[f"signs of type {kind}, unknown to CommonRoad"] += 1
            else:
                kept.append(signal)
        return kept

    def _sign(
        self,
        root: etree._Element,
        number: int,
        code: str,
        values: list[float],
        xyz_m: tuple[float, ...],
        virtual: bool,
    ) -> None:
        sign = etree.SubElement(root, "trafficSign", id=str(number))
        element = etree.SubElement(sign, "trafficSignElement")
        etree.SubElement(element, "trafficSignID").text = code
        for value in values:
            etree.SubElement(element, "additionalValue").text = repr(float(value))
        _point(etree.SubElement(sign, "position"), xyz_m)
        etree.SubElement(sign, "virtual").text = str(virtual).lower()

    def _light(self, root: etree._Element, number: int, signal: PlacedSignal) -> None:
        """Write a traffic light; OpenDRIVE has no phases, so that it is inactive."""
        light = etree.SubElement(root, "trafficLight", id=str(number))
        cycle = etree.SubElement(light, "cycle")
        step = etree.SubElement(cycle, "cycleElement")
        etree.SubElement(step, "duration").text = "1"
        etree.SubElement(step, "color").text = "inactive"
        _point(etree.SubElement(light, "position"), signal.xyz_m)
        etree.SubElement(light, "active").text = "false"

    # Intersections

    def _intersections(self, root: etree._Element, crossings: dict[int, str]) -> None:
        lanes, pieces = self.network.lanes, self.pieces.lanelets
        inside: dict[str, dict[str, dict[int, list[_Way]]]] = {}
        for i, lanelet in enumerate(pieces):
            junction = lanes.junction_id[lanelet.lane]
            if junction is None:
                continue
            for before in lanelet.predecessors:
                if lanes.junction_id[pieces[before].lane] != junction:
                    road_id = lanes.key[pieces[before].lane].road_id
                    ways = inside.setdefault(junction, {}).setdefault(road_id, {})
                    ways.setdefault(before, []).append(_Way(i, self._turn(i, junction)))
        for junction, incoming in inside.items():
            element = etree.SubElement(root, "intersection", id=str(self._new_id()))
            for ways in incoming.values():
                entry = etree.SubElement(element, "incoming", id=str(self._new_id()))
                for before in ways:
                    etree.SubElement(entry, "incomingLanelet", ref=str(before + 1))
                onwards = sorted({(way.first, _turn_name(way.turn_rad)) for w in ways.values() for way in w})
                for tag in ("successorsRight", "successorsStraight", "successorsLeft"):
                    for first, name in onwards:
                        if name == tag:
                            etree.SubElement(entry, tag, ref=str(first + 1))
            touching = {*incoming} | {
                lanes.key[lane].road_id for lane in range(len(lanes)) if lanes.junction_id[lane] == junction
            }
            crossing = [number for number, road_id in crossings.items() if road_id in touching]
            if crossing:
                group = etree.SubElement(element, "crossing")
                for number in crossing:
                    etree.SubElement(group, "crossingLanelet", ref=str(number))
        without = set(self.network.model.junctions) - set(inside)
        if without:
            self.left_out["junctions without connecting roads"] += len(without)

    def _turn(self, first: int, junction: str) -> float:
        """Return by how much the way through a junction turns that begins with a lanelet."""
        lanes, pieces = self.network.lanes, self.pieces.lanelets
        last, seen = first, {first}
        while onwards := [
            j
            for j in pieces[last].successors
            if lanes.junction_id[pieces[j].lane] == junction and j not in seen
        ]:
            last = onwards[0]
            seen.add(last)
        begins, ends = self._headings(first)[0], self._headings(last)[1]
        return float(wrapped(np.array(ends - begins)))

    def _headings(self, i: int) -> tuple[float, float]:
        lanelet = self.pieces.lanelets[i]
        ends = (lanelet.s_start_m, lanelet.s_end_m)
        heading = self.network.center_line(lanelet.lane, ends if lanelet.forward else ends[::-1])[3]
        return float(heading[0]), float(heading[1])


def _turn_name(turn_rad: float) -> str:
    if abs(turn_rad) < _STRAIGHT_RAD:
        return "successorsStraight"
    return "successorsLeft" if turn_rad > 0.0 else "successorsRight"


def _sign_code(signal: PlacedSignal) -> str:
    """Return CommonRoad's id of a sign; empty if it has none."""
    codes = (f"{signal.signal.type}-{signal.signal.subtype}", signal.signal.type)
    return next((code for code in codes if f" {code} " in _SIGNS), "")


def _point(parent: etree._Element, xyz_m: tuple[float, ...] | list[float]) -> None:
    point = etree.SubElement(parent, "point")
    for tag, value in zip("xyz", xyz_m, strict=True):
        etree.SubElement(point, tag).text = f"{value:.{_DECIMALS}f}"
