"""Lanelet2's lanelets, signs and lights, as OSM XML.

Its repository says in lanelet2_core/doc what the tags mean
(https://github.com/fzi-forschungszentrum-informatik/Lanelet2).
"""

from collections import Counter
from collections.abc import Callable
from os import PathLike
from pathlib import Path

import numpy as np
from lxml import etree

import _smartmot
from opendrive.arrays import FloatArray
from opendrive.errors import OpenDriveError
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
from opendrive.geo import GeoReferenceError
from opendrive.network import RoadNetwork

ORIGIN_DEG = (49.0, 9.0)
"""Latitude and longitude where the map frame of maps without geoReference lies: on UTM zone 32's meridian."""

JOIN_M = 0.02
"""Ends of linked lanes that are nearer become one point, each moved by half of that at most."""

_UTM_32 = "EPSG:32632"
_FAR_M = 100_000.0
"""Maps without geoReference that reach farther are moved near the origin, by whole kilometres."""

_DEGREE_DECIMALS = 11
_METRE_DECIMALS = 4

_SUBTYPES = {
    "bus": "bus_lane",
    "biking": "bicycle_lane",
    "sidewalk": "walkway",
    "walking": "walkway",
    "exit": "exit",
    "offRamp": "exit",
    "mwyExit": "exit",
    "stop": "emergency_lane",
}
_PARTICIPANTS = {
    "vehicle": "vehicle",
    "bicycle": "bicycle",
    "pedestrian": "pedestrian",
    "bus": "vehicle:bus",
    "taxi": "vehicle:taxi",
    "train": "train",
}
_NONURBAN = frozenset({"motorway", "rural"})
_MARKS = {"solid": "solid", "broken": "dashed"}


def write_lanelet2(network: RoadNetwork, path: str | PathLike[str]) -> Export:
    """Write the lanes of a network as a Lanelet2 map, with heights.

    Latitude and longitude follow from the map's geoReference. Without one, the map frame is laid on UTM zone
    32 at 49 degrees north, 9 degrees east: Lanelet2's ``UtmProjector(Origin(49, 9))`` gives its metres again.
    Points also have the tags ``local_x`` and ``local_y``, metres of the map frame.

    Args:
        network: the map.
        path: file to write, ``.osm``.

    Raises:
        GeoReferenceError: pyproj is not installed, or the map's geoReference is not understood.
        PositionError: a point lies outside the projection that the geoReference names.
        OSError: the file cannot be written.
    """
    file = _File(network, lanelets_of(network))
    root = file.written()
    Path(path).write_bytes(etree.tostring(root, xml_declaration=True, encoding="UTF-8", pretty_print=True))
    return Export(file.counts, file.left_out, tuple(file.notes))


class _Joints:
    """Points of which some become one: the middle of all, from which none may be more than 1 cm."""

    def __init__(self, xyz_m: FloatArray) -> None:
        self.xyz_m = xyz_m
        self.parent = list(range(len(xyz_m)))
        self.members: dict[int, list[int]] = {}

    def root(self, i: int) -> int:
        while self.parent[i] != i:
            i = self.parent[i]
        return i

    def joined(self, a: int, b: int) -> bool:
        return self.root(a) == self.root(b)

    def middle(self, root: int) -> FloatArray:
        middle: FloatArray = self.xyz_m[self.members.get(root, [root])].mean(axis=0)
        return middle

    def may_join(self, a: int, b: int) -> bool:
        points = self.xyz_m[self._group(a) + self._group(b)]
        return bool(np.linalg.norm(points - points.mean(axis=0), axis=1).max() <= 0.5 * JOIN_M)

    def join(self, a: int, b: int) -> None:
        first, second = self.root(a), self.root(b)
        if first != second:
            self.members[first] = self._group(first) + self._group(second)
            self.members.pop(second, None)
            self.parent[second] = first

    def _group(self, i: int) -> list[int]:
        root = self.root(i)
        return self.members.get(root, [root])


class _File:
    """A Lanelet2 map in the making."""

    def __init__(self, network: RoadNetwork, pieces: Lanelets) -> None:
        self.network = network
        self.pieces = pieces
        self.left_out: Counter[str] = Counter(pieces.left_out)
        self.notes = [*folded_note(pieces), *_turned_note(network, pieces)]
        self.counts: dict[str, int] = {}
        self.points: list[FloatArray] = []
        self.ways: list[tuple[list[int], dict[str, str]]] = []
        self.relations: list[tuple[list[tuple[str, str, int]], dict[str, str]]] = []
        self.steps: set[frozenset[int]] = set()
        self.changes = self._permitted_changes()
        if self.steps:
            self.left_out["neighbours that are not level with each other"] += len(self.steps)

    def written(self) -> etree._Element:
        pieces = self.pieces
        signals = self._signals()
        regulatory: dict[int, list[int]] = {}
        number_of_lanelets = len(pieces.lanelets)
        for k, signal in enumerate(signals):
            for i in signal.lanelets:
                regulatory.setdefault(i, []).append(number_of_lanelets + k)
        points_of = self._border_points()
        for k, border in enumerate(pieces.borders):
            self.ways.append((points_of[k], self._border_tags(k, border)))
        for i, lanelet in enumerate(pieces.lanelets):
            members = [("way", "left", lanelet.left), ("way", "right", lanelet.right)]
            members += [("relation", "regulatory_element", number) for number in regulatory.get(i, ())]
            self.relations.append((members, self._lanelet_tags(lanelet)))
        for signal in signals:
            self._signal(signal)
        for crosswalk in self.network.crosswalks:
            sides = [
                self._way(side, {"type": "zebra_marking"})
                for side in crossing_bounds(self.network, crosswalk)
            ]
            tags = {
                "type": "lanelet",
                "subtype": "crosswalk",
                "one_way": "no",
                "participant:pedestrian": "yes",
                "opendrive": f"object {crosswalk.id}",
            }
            self.relations.append(([("way", "left", sides[0]), ("way", "right", sides[1])], tags))
        for kind, count in Counter(other_objects(self.network)).items():
            self.left_out[f"objects of type {kind}"] += count
        lights = sum(signal.is_light for signal in signals)
        self.counts = {
            "lanelets": number_of_lanelets,
            "crosswalks": len(self.network.crosswalks),
            "traffic signs": len(signals) - lights,
            "traffic lights": lights,
        }
        return self._xml()

    # Borders

    def _border_points(self) -> list[list[int]]:
        """Add the points of all borders; ends that meet where lanes are linked are one."""
        pieces = self.pieces
        first: list[int] = []
        total = 0
        for border in pieces.borders:
            first.append(total)
            total += len(border.xyz_m)
        xyz_m = np.concatenate([border.xyz_m for border in pieces.borders]) if total else np.empty((0, 3))
        joints = _Joints(xyz_m)

        def end(lanelet: Lanelet, border: int, at_end: bool) -> int:
            return first[border] + (len(pieces.borders[border].xyz_m) - 1 if lanelet.forward == at_end else 0)

        apart = 0
        for lanelet in pieces.lanelets:
            for j in lanelet.successors:
                following = pieces.lanelets[j]
                pairs = [
                    (end(lanelet, lanelet.left, True), end(following, following.left, False)),
                    (end(lanelet, lanelet.right, True), end(following, following.right, False)),
                ]
                # Both or none: a lanelet follows another if both of its borders do.
                if all(joints.may_join(a, b) for a, b in pairs):
                    for a, b in pairs:
                        joints.join(a, b)
                if not all(joints.joined(a, b) for a, b in pairs):
                    apart += 1
        if apart:
            self.left_out[f"links of lanes whose ends are more than {JOIN_M * 100:.0f} cm apart"] += apart
        self._say_implied_links(joints, end)
        roots = np.array([joints.root(i) for i in range(total)], dtype=np.int64)
        used, number = np.unique(roots, return_inverse=True)
        self.points = [joints.middle(int(root)) for root in used]
        numbers = number.ravel().tolist()
        return [
            numbers[start : start + len(border.xyz_m)]
            for start, border in zip(first, pieces.borders, strict=True)
        ]

    def _say_implied_links(self, joints: _Joints, end: Callable[[Lanelet, int, bool], int]) -> None:
        """Note the links that the map does not have, and that follow from shared ends all the same."""

        def gate(lanelet: Lanelet, at_end: bool) -> tuple[int, int]:
            left, right = (end(lanelet, border, at_end) for border in (lanelet.left, lanelet.right))
            return joints.root(left), joints.root(right)

        begins: dict[tuple[int, int], set[int]] = {}
        for i, lanelet in enumerate(self.pieces.lanelets):
            begins.setdefault(gate(lanelet, False), set()).add(i)
        implied = sum(
            len(begins.get(gate(lanelet, True), set()) - set(lanelet.successors))
            for lanelet in self.pieces.lanelets
        )
        if implied:
            self.notes.append(f"{implied} links more than in the map: lanes that end together go on alike")

    def _border_tags(self, number: int, border: Border) -> dict[str, str]:
        if not border.marks:
            tags = {"type": "virtual"}
        elif border.marks == ("curb",):
            tags = {"type": "curbstone", "subtype": "high"}
        elif all(mark in _MARKS for mark in border.marks) and len(border.marks) <= 2:
            subtype = "_".join(_MARKS[mark] for mark in border.marks)
            tags = {"type": "line_thick" if border.is_bold else "line_thin", "subtype": subtype}
        elif border.marks in (("edge",), ("grass",)):
            tags = {"type": "road_border"}
        else:
            self.left_out[f"road marks of type {' '.join(border.marks)} (written as virtual)"] += 1
            tags = {"type": "virtual"}
        for side, may in sorted(self.changes.get(number, {}).items()):
            tags[f"lane_change:{side}"] = "yes" if may else "no"
        return tags

    def _permitted_changes(self) -> dict[int, dict[str, bool]]:
        """Return for borders between two lanelets whether lanes may be changed to their left and right."""
        changes: dict[int, dict[str, bool]] = {}
        lanelets = self.pieces.lanelets
        for lanelet in lanelets:
            for side, border, neighbour, may in (
                ("left", lanelet.left, lanelet.left_neighbour, lanelet.may_change_left),
                ("right", lanelet.right, lanelet.right_neighbour, lanelet.may_change_right),
            ):
                if neighbour is not None and border in (lanelets[neighbour].left, lanelets[neighbour].right):
                    # Borders run along s.
                    other = {"left": "right", "right": "left"}[side]
                    changes.setdefault(border, {})[side if lanelet.forward else other] = may
                elif neighbour is not None:
                    self.steps.add(frozenset((id(lanelet), id(lanelets[neighbour]))))
        return changes

    def _lanelet_tags(self, lanelet: Lanelet) -> dict[str, str]:
        network = self.network
        key = network.lanes.key[lanelet.lane]
        lane_type = str(network.lanes.lane_type[lanelet.lane])
        types = [t.type for t in network.model.roads[key.road_id].types if t.s_m <= lanelet.s_start_m + 1e-6]
        road_type = types[-1] if types else "town"
        user = USERS.get(lane_type)
        subtype = _SUBTYPES.get(lane_type)
        if subtype is None and user == "vehicle":
            subtype = "highway" if road_type == "motorway" else "road"
        record = next(
            record
            for record in network.model.roads[key.road_id].sections[key.section].lanes
            if record.id == key.lane_id
        )
        both = lane_type == "bidirectional" or record.direction == "both" or user == "pedestrian"
        tags = {
            "type": "lanelet",
            "subtype": subtype or lane_type,
            "location": "nonurban" if road_type in _NONURBAN else "urban",
            "one_way": "no" if both else "yes",
            "opendrive": f"{key.road_id}/{key.section}/{key.lane_id}",
        }
        if user is None:
            if subtype is None:
                self.left_out[f"subtypes of lanelets: {lane_type} (written as it is, for no traffic)"] += 1
        else:
            tags[f"participant:{_PARTICIPANTS[user]}"] = "yes"
        if lanelet.speed_mps is not None:
            tags["speed_limit"] = f"{lanelet.speed_mps * 3.6:.6g} km/h"
        return tags

    # Signs and lights

    def _signals(self) -> list[PlacedSignal]:
        signals = placed_signals(self.network, self.pieces, self.left_out)
        limits = sum(signal.is_limit for signal in signals)
        if limits:
            self.left_out["signs of speed limits (lanelets have those of their lanes)"] += limits
        return [signal for signal in signals if not signal.is_limit]

    def _signal(self, signal: PlacedSignal) -> None:
        record = signal.signal
        kind = "traffic_light" if signal.is_light else "traffic_sign"
        half_m = 0.5 * (record.width_m or 0.6)
        aside = np.array([np.sin(signal.heading_rad), -np.cos(signal.heading_rad), 0.0])
        ends = np.array(signal.xyz_m) + half_m * np.stack([-aside, aside])
        country = record.country.lower() if len(record.country) == 2 else ""
        code = record.type + (f"-{record.subtype}" if record.subtype not in ("", "-1", "none") else "")
        tags = {"type": kind, "opendrive": f"signal {record.id}"}
        tags["subtype"] = "red_yellow_green" if signal.is_light else country + code
        if record.height_m is not None:
            tags["height"] = f"{record.height_m:.6g}"
        way = self._way(ends, tags)
        self.relations.append(([("way", "refers", way)], {"type": "regulatory_element", "subtype": kind}))

    def _way(self, xyz_m: FloatArray, tags: dict[str, str]) -> int:
        numbers = range(len(self.points), len(self.points) + len(xyz_m))
        self.points += list(xyz_m)
        self.ways.append((list(numbers), tags))
        return len(self.ways) - 1

    # The file

    def _xml(self) -> etree._Element:
        root = etree.Element("osm", version="0.6", generator="smartmot")
        points = np.array(self.points).reshape(-1, 3)
        latitude, longitude = self._geographic(points[:, :2])
        first_way = len(points) + 1
        first_relation = first_way + len(self.ways)
        columns = zip(points.tolist(), latitude.tolist(), longitude.tolist(), strict=True)
        for number, ((x, y, z), lat, lon) in enumerate(columns, start=1):
            node = etree.SubElement(
                root,
                "node",
                id=str(number),
                version="1",
                visible="true",
                lat=f"{lat:.{_DEGREE_DECIMALS}f}",
                lon=f"{lon:.{_DEGREE_DECIMALS}f}",
            )
            for tag, value in (("ele", z), ("local_x", x), ("local_y", y)):
                etree.SubElement(node, "tag", k=tag, v=f"{value:.{_METRE_DECIMALS}f}")
        for number, (members, tags) in enumerate(self.ways, start=first_way):
            way = etree.SubElement(root, "way", id=str(number), version="1", visible="true")
            for point in members:
                etree.SubElement(way, "nd", ref=str(point + 1))
            _tags(way, tags)
        for number, (parts, tags) in enumerate(self.relations, start=first_relation):
            relation = etree.SubElement(root, "relation", id=str(number), version="1", visible="true")
            for kind, role, index in parts:
                offset = first_way if kind == "way" else first_relation
                etree.SubElement(relation, "member", type=kind, role=role, ref=str(offset + index))
            _tags(relation, tags)
        return root

    def _geographic(self, xy_m: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Return latitude and longitude of points of the map frame, degrees."""
        if self.network.model.header.geo_reference.strip():
            self.notes.append("latitude and longitude are those of the map's geoReference")
            return self.network.to_geographic(xy_m)
        try:
            from pyproj import Transformer
        except ImportError as error:
            raise GeoReferenceError(_smartmot.missing_extra("Lanelet2 maps", "maps", error)) from None
        moved_m = np.zeros(2)
        if len(xy_m) and np.abs(xy_m).max() > _FAR_M:
            moved_m = 1000.0 * np.round(xy_m.mean(axis=0) / 1000.0)
            if np.abs(xy_m - moved_m).max() > _FAR_M:
                raise OpenDriveError(
                    "the map has no geoReference and is over 200 km wide; add one to write it as Lanelet2"
                )
            moved = f"{moved_m[0]:.0f}, {moved_m[1]:.0f}"
            self.notes.append(f"({moved}) m of the map frame lie at the origin")
        at = f"{ORIGIN_DEG[0]:g}, {ORIGIN_DEG[1]:g}"
        self.notes.append(f"no geoReference: UtmProjector(Origin({at})) gives the metres of the map frame")
        transformer = Transformer.from_crs(_UTM_32, "EPSG:4326", always_xy=True)
        east, north = transformer.transform(ORIGIN_DEG[1], ORIGIN_DEG[0], direction="INVERSE")
        longitude, latitude = transformer.transform(*(xy_m - moved_m + [east, north]).T)
        return np.asarray(latitude, dtype=np.float64), np.asarray(longitude, dtype=np.float64)


def _turned_note(network: RoadNetwork, pieces: Lanelets) -> list[str]:
    """Return what to say of borders that run back: by one point of each the library sees which is left."""
    lanes = {network.lanes.key[pieces.lanelets[i].lane] for i in pieces.running_back()}
    if not lanes:
        return []
    names = ", ".join("/".join(map(str, lane)) for lane in sorted(lanes))
    return [
        f"{len(lanes)} lanes have a border that runs back in a tight bend: {names}; the library lanelet2 may"
        " turn it round and lose their links"
    ]


def _tags(parent: etree._Element, tags: dict[str, str]) -> None:
    for name, value in tags.items():
        etree.SubElement(parent, "tag", k=name, v=value)
