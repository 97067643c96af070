"""Scenes with moving background traffic, driven by highway-env and recorded as timed trajectories.

The vehicles follow each other by the Intelligent Driver Model and change lanes by MOBIL (highway-env's
`IDMVehicle`) on the scene's own road. The ego drives among them as it would unbraked, and they see it. Of the
random traffic of rising seeds those are taken in which nobody touches anybody, nobody goes on to another road
and the ego always keeps its distance to who is ahead and behind. Recorded vehicles do not react to an ego
that brakes: one that brakes unnecessarily may be hit from behind.

``python -m scenarios.scenes.traffic [MAPS]`` writes all of them again, byte by byte the same; those on outer
maps only where the folder MAPS has the maps. `scenes.toml` says what is recorded.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from highway_env.road.road import Road
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.controller import ControlledVehicle
from lxml import etree

from opendrive import RoadNetwork, load_map
from scenarios.highway_road import MapLane, MapRoadNetwork, highway_road_network
from scenarios.scenes.scene_maps import MAPS
from scenarios.scenes.scenes import SCENES, recordings
from smartmot.maps.route import route_from_lanes
from smartmot.types import FloatArray

STEP_S, VERTEX_EVERY = 0.1, 5
"""Step of highway-env, and how many make the time between two vertices of a trajectory."""
DRIVEN_M, DRIVEN_IN_TOWN_M, AFTER_S = 250.0, 120.0, 6.0
"""Way of the ego on the scenes' own roads and on the shorter ones of outer maps, and how long the traffic is
recorded beyond it for an ego that falls behind."""
FREE_S = 1.2
"""The unbraked ego has at least that time gap in front and behind; highway-env's drivers aim at 1.5 s."""
REFERENCE_M = 1.368
"""Middle of the catalogue's small car in front of its reference point."""


@dataclass(frozen=True, slots=True)
class TrafficScene:
    """Traffic on a road of one of the scenes' maps or of an outer map.

    Args:
        name: of the file.
        description: in the file.
        map_name: of the map's file.
        road_id: of the road.
        lane_id, start_s: where the ego starts on the road.
        speed_kmh: of the ego.
        number: which of the admissible random seeds, from 0.
        groups: lane, number of vehicles, lowest and highest place ahead of the ego, lowest and highest
            desired speed in km/h.
        outer: whether the map is an outer one, whose place the file does not know: it declares it as `Map`.
    """

    name: str
    description: str
    map_name: str
    road_id: str
    lane_id: int
    start_s: float
    speed_kmh: float
    number: int
    groups: tuple[tuple[int, int, Sequence[float], Sequence[float]], ...]
    outer: bool

    def map_path(self, maps: Path | None) -> Path | None:
        """The map's file; None where it is an outer one that is not in the folder of outer maps."""
        if not self.outer:
            return MAPS / self.map_name
        path = maps / self.map_name if maps else None
        return path if path and path.is_file() else None

    @property
    def driven_m(self) -> float:
        """Way of the ego."""
        return DRIVEN_IN_TOWN_M if self.outer else DRIVEN_M


def _scenes_of(entry: Mapping[str, Any]) -> Iterator[TrafficScene]:
    """The recordings that an entry of the data file asks for."""
    outer = "outer" in entry
    for number in range(entry["count"]):
        yield TrafficScene(
            name=f"{entry['name']}_{number + 1}",
            description=entry["description"],
            map_name=entry["outer" if outer else "map"],
            road_id=entry["road"],
            lane_id=entry["lane"],
            start_s=float(entry["start_s"]),
            speed_kmh=float(entry["speed_kmh"]),
            number=number,
            groups=tuple(map(tuple, entry["groups"])),
            outer=outer,
        )


TRAFFIC = tuple(scene for entry in recordings() for scene in _scenes_of(entry))


class _SampledLane(MapLane):
    """A lane as a polyline, millimetres from its middle: highway-env asks for coordinates very often."""

    def __init__(self, network: RoadNetwork, lane: int) -> None:
        self._line = route_from_lanes(network, [lane])
        super().__init__(network, lane)

    def width_at(self, longitudinal: float) -> float:
        """Width in the middle; the lanes of the scenes keep theirs."""
        strip = self._line.strips[0]
        return 2.0 * float(strip.half_width_m[len(strip.half_width_m) // 2])

    def position(self, longitudinal: float, lateral: float) -> Any:
        """(2,) point of the map frame, metres."""
        return np.array(self._line.pose(longitudinal, lateral)[:2])

    def heading_at(self, longitudinal: float) -> float:
        """Travel direction, radians."""
        return self._line.pose(longitudinal)[2]

    def local_coordinates(self, position: Any) -> tuple[float, float]:
        """Longitudinal and lateral coordinate of a point, metres."""
        return self._line.project(float(position[0]), float(position[1]))


def _sampled(network: RoadNetwork, road_id: str) -> MapRoadNetwork:
    """The map as highway-env has it, with sampled lanes on the road."""
    roads = highway_road_network(network)
    for lane, (start, end, number) in roads.name_of_lane.items():
        if network.lanes.key[lane].road_id == road_id:
            roads.graph[start][end][number] = _SampledLane(network, lane)
    return roads


class _Traffic:
    """One random traffic, and the way that it goes.

    Args:
        scene: what it is to be.
        network: the scene's road.
        seed: of places and speeds.
    """

    def __init__(self, scene: TrafficScene, network: MapRoadNetwork, seed: int) -> None:
        rng = np.random.default_rng(seed)
        self._road_id = scene.road_id
        self._road = Road(network, np_random=np.random.RandomState(seed))
        self._own, start = self._lane(network, scene.lane_id), scene.start_s
        speed = scene.speed_kmh / 3.6
        name = network.name_of_lane[self._own.lane]
        self._ego = ControlledVehicle(
            self._road, self._own.position(start, 0.0), self._own.heading_at(start), speed, name, speed
        )
        self._road.vehicles.append(self._ego)
        for lane_id, vehicles, places, speeds in scene.groups:
            lane = self._lane(network, lane_id)
            begin = start if lane.direction == self._own.direction else lane.length - start
            sign = 1.0 if lane.direction == self._own.direction else -1.0
            share = (np.arange(vehicles) + rng.uniform(0.1, 0.9, vehicles)) / vehicles
            for at in places[0] + share * (places[1] - places[0]):
                station, wanted = begin + sign * at, float(rng.uniform(speeds[0], speeds[1])) / 3.6
                self._road.vehicles.append(
                    IDMVehicle(
                        self._road, lane.position(station, 0.0), lane.heading_at(station), wanted,
                        network.name_of_lane[lane.lane], wanted,
                    )
                )  # fmt: skip

    def _lane(self, network: MapRoadNetwork, lane_id: int) -> MapLane:
        key = (self._road_id, 0, lane_id)
        lane: MapLane = network.get_lane(network.name_of_lane[network.network.lane_index_of(key)])
        return lane

    def run(self, duration_s: float, driven_s: float) -> list[FloatArray] | None:
        """(T, 3) x, y and heading of each vehicle but the ego; None where the traffic cannot be used."""
        steps = round(duration_s / STEP_S)
        ways: list[list[tuple[float, float, float]]] = [[] for _ in self._road.vehicles[1:]]
        for step in range(steps + 1):
            if step % VERTEX_EVERY == 0:
                for way, vehicle in zip(ways, self._road.vehicles[1:], strict=True):
                    way.append((*vehicle.position, vehicle.heading))
                if step * STEP_S <= driven_s and not self._is_free():
                    return None
            self._road.act()
            self._road.step(STEP_S)
            if step * STEP_S <= driven_s and any(vehicle.crashed for vehicle in self._road.vehicles):
                return None
            if any(self._has_left(vehicle) for vehicle in self._road.vehicles):
                return None
        return [np.array(way) for way in ways]

    def _has_left(self, vehicle: ControlledVehicle) -> bool:
        """Whether a vehicle has gone on to another road; where none follows it stays on this one."""
        lane: MapLane = vehicle.lane
        return lane.network.lanes.key[lane.lane].road_id != self._road_id

    def _is_free(self) -> bool:
        """Whether nobody is near ahead of the ego in its lane, or behind it."""
        own = self._own.local_coordinates(self._ego.position)[0]
        for vehicle in self._road.vehicles[1:]:
            along, aside = self._own.local_coordinates(vehicle.position)
            if abs(aside) > (self._own.width + vehicle.WIDTH) / 2:
                continue
            gap = abs(along - own) - vehicle.LENGTH
            if gap < FREE_S * (self._ego.speed if along > own else vehicle.speed):
                return False
        return True


def build_scene(scene: TrafficScene, map_path: Path) -> bytes:
    """The scene as an OpenSCENARIO file, recorded on a map.

    Raises:
        opendrive.errors.OpenDriveError: there is no map.
    """
    network = _sampled(load_map(map_path), scene.road_id)
    driven_s = scene.driven_m / (scene.speed_kmh / 3.6)
    admissible = scene.number
    for seed in count():
        ways = _Traffic(scene, network, seed).run(driven_s + AFTER_S, driven_s)
        if ways is not None and admissible == 0:
            return _file(scene, ways)
        admissible -= ways is not None
    raise AssertionError("seeds do not end")


def _file(scene: TrafficScene, ways: list[FloatArray]) -> bytes:
    root = etree.Element("OpenSCENARIO")
    _add(root, "FileHeader", revMajor=1, revMinor=3, date="2026-11-22T00:00:00", author="smartmot",
         description=scene.description)  # fmt: skip
    declared = _add(root, "ParameterDeclarations")
    if scene.outer:
        _add(declared, "ParameterDeclaration", name="Map", parameterType="string", value=scene.map_name)
    for name, value in (("Ego_length", 4.4), ("Ego_width", 1.8)):
        _add(declared, "ParameterDeclaration", name=name, parameterType="double", value=value)
    catalogs = _add(root, "CatalogLocations")
    _add(_add(catalogs, "VehicleCatalog"), "Directory", path="../definitions/catalogs/vehicles")
    map_file = "$Map" if scene.outer else f"maps/{scene.map_name}"
    _add(_add(root, "RoadNetwork"), "LogicFile", filepath=map_file)
    entities = _add(root, "Entities")
    ego = _add(_add(entities, "ScenarioObject", name="Ego"), "CatalogReference", catalogName="Vehicles",
               entryName="ego")  # fmt: skip
    assignments = _add(ego, "ParameterAssignments")
    for name in ("Length", "Width"):
        _add(assignments, "ParameterAssignment", parameterRef=name, value=f"$Ego_{name.lower()}")
    storyboard = _add(root, "Storyboard")
    actions = _add(_add(storyboard, "Init"), "Actions")
    own = _add(actions, "Private", entityRef="Ego")
    position = _add(_add(_add(own, "PrivateAction"), "TeleportAction"), "Position")
    _add(position, "LanePosition", roadId=scene.road_id, laneId=scene.lane_id, s=scene.start_s)
    speed = _add(_add(_add(own, "PrivateAction"), "LongitudinalAction"), "SpeedAction")
    _add(speed, "SpeedActionDynamics", dynamicsShape="step", dynamicsDimension="time", value=0)
    target = _add(speed, "SpeedActionTarget")
    _add(target, "AbsoluteTargetSpeed", value=f"${{{scene.speed_kmh:g}/3.6}}")
    for number, way in enumerate(ways, start=1):
        name = f"Car {number}"
        _add(_add(entities, "ScenarioObject", name=name), "CatalogReference", catalogName="Vehicles",
             entryName="small_car")  # fmt: skip
        _trajectory(_add(actions, "Private", entityRef=name), way)
    stop = _add(storyboard, "StopTrigger")
    for name, condition, limit in (
        ("passed", "TraveledDistanceCondition", {"value": scene.driven_m}),
        ("the ego waits", "StandStillCondition", {"duration": 3}),
    ):
        group = _add(stop, "ConditionGroup")
        entity = _add(_add(group, "Condition", name=name, delay=0, conditionEdge="none"), "ByEntityCondition")
        triggering = _add(entity, "TriggeringEntities", triggeringEntitiesRule="any")
        _add(triggering, "EntityRef", entityRef="Ego")
        _add(_add(entity, "EntityCondition"), condition, **limit)
    etree.indent(root)
    for vertex in root.iter("Vertex"):  # one line each
        vertex.text = vertex[0].text = vertex[0].tail = vertex[0][0].tail = None
    return etree.tostring(root, xml_declaration=True, encoding="UTF-8") + b"\n"


def _trajectory(private: etree._Element, way: FloatArray) -> None:
    """Follow a way, given for the middle of the box, with the reference point."""
    follow = _add(_add(_add(private, "PrivateAction"), "RoutingAction"), "FollowTrajectoryAction")
    trajectory = _add(_add(follow, "TrajectoryRef"), "Trajectory", name="recorded", closed="false")
    line = _add(_add(trajectory, "Shape"), "Polyline")
    reference = way[:, :2] - REFERENCE_M * np.column_stack((np.cos(way[:, 2]), np.sin(way[:, 2])))
    for k, (x, y) in enumerate(reference.tolist()):
        vertex = _add(line, "Vertex", time=round(k * VERTEX_EVERY * STEP_S, 3))
        _add(_add(vertex, "Position"), "WorldPosition", x=f"{x:.2f}", y=f"{y:.2f}")
    timing = _add(follow, "TimeReference")
    _add(timing, "Timing", domainAbsoluteRelative="absolute", offset=0, scale=1)
    _add(follow, "TrajectoryFollowingMode", followingMode="position")


def _add(parent: etree._Element, tag: str, **attributes: Any) -> etree._Element:
    values = {k: f"{v:g}" if isinstance(v, float) else str(v) for k, v in attributes.items()}
    return etree.SubElement(parent, tag, values)


def write_scenes(directory: Path = SCENES, maps: Path | None = None) -> None:
    """Write all scenes whose maps are there into a directory, which is made if it is missing.

    Args:
        directory: to write to.
        maps: folder of outer maps.
    """
    directory.mkdir(parents=True, exist_ok=True)
    for scene in TRAFFIC:
        if path := scene.map_path(maps):
            (directory / f"{scene.name}.xosc").write_bytes(build_scene(scene, path))


if __name__ == "__main__":
    write_scenes(maps=Path(sys.argv[1]) if len(sys.argv) > 1 else None)
