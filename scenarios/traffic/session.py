"""SUMO in this process: its network made from a map, vehicles and pedestrians added, placed and read.

libsumo has one simulation per process. Whoever begins one ends the one before.
"""

from __future__ import annotations

import contextlib
import hashlib
import io
import math
import os
from collections.abc import Sequence
from functools import cache, lru_cache
from importlib import metadata
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.sax.saxutils import quoteattr

import _smartmot
from opendrive import load_map
from opendrive.formats.sumo import write_sumo
from scenarios.errors import ScenarioError
from scenarios.openscenario.motion.paths import Pose
from scenarios.traffic.carried import Place

EXTRA = "sumo"
LIBRARIES = ("libsumo", "eclipse-sumo")
"""Distributions whose versions a run with traffic depends on."""

FREE_TO_MOVE = 2
"""`keepRoute` of moveToXY: exactly there, whatever the route (https://sumo.dlr.de/docs/TraCI)."""

LANE_CHANGE_S = 5.0
"""Lane changes take 5 to 6 s on average (T. Toledo and D. Zohar, Transp. Res. Rec. 1999 (2007) 71)"""

_current: Session | None = None


@cache
def library() -> Any:
    """The module libsumo.

    Raises:
        ScenarioError: it is not installed.
    """
    try:
        # it prints about versions of a library that writes Parquet, which is not used here
        with contextlib.redirect_stdout(io.StringIO()):
            import libsumo
    except ImportError as error:
        raise ScenarioError(_smartmot.missing_extra("vehicles of SUMO", EXTRA, error)) from None
    return libsumo


def library_versions() -> dict[str, str]:
    """Versions of SUMO's distributions; empty text for one that is not installed."""
    versions = {}
    for name in LIBRARIES:
        try:
            versions[name] = metadata.version(name)
        except metadata.PackageNotFoundError:
            versions[name] = ""
    return versions


@cache
def _folder(process: int) -> TemporaryDirectory[str]:
    """Of a process, which a copy of the process does not share; as long as it lives."""
    return TemporaryDirectory(prefix="smartmot-sumo-")


def _own_folder() -> Path:
    return Path(_folder(os.getpid()).name)


def network_file(map_path: Path) -> Path:
    """The map as a SUMO network; an unchanged file is converted once per process.

    Raises:
        opendrive.OpenDriveError: netconvert is not installed, or refuses the map.
    """
    stat = map_path.stat()
    return _network_file(map_path.resolve(), stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=64)
def _network_file(map_path: Path, mtime_ns: int, size: int) -> Path:
    digest = hashlib.sha256(f"{map_path} {mtime_ns} {size}".encode()).hexdigest()[:16]
    path = _own_folder() / f"{map_path.stem}_{digest}.net.xml"
    write_sumo(load_map(map_path), path)
    return path


class Session:
    """A simulation of SUMO.

    Args:
        network: file of its network.
        types: vehicle types by name, with SUMO's attributes.
        seed: of its random numbers.
        step_s: its step.
    """

    def __init__(self, network: Path, types: dict[str, dict[str, object]], seed: int, step_s: float) -> None:
        global _current
        self._sumo, self._persons, self._lengths_m = library(), set[str](), dict[str, float]()
        file = _own_folder() / "types.add.xml"
        lines = [
            f"<vType id={quoteattr(name)} "
            + " ".join(f"{key}={quoteattr(str(value))}" for key, value in attributes.items())
            + "/>"
            for name, attributes in types.items()
        ]
        file.write_text(f"<additional>{''.join(lines)}</additional>", encoding="utf-8")
        if _current is not None:
            self._sumo.close()
        _current = None
        self._sumo.start(
            [
                "sumo",
                *("-n", str(network), "-a", str(file), "--seed", str(seed % 2**31)),
                *("--step-length", f"{step_s:g}", "--step-method.ballistic", "true"),
                # contacts are the engine's; nobody disappears for having waited
                *("--collision.action", "none", "--time-to-teleport", "-1"),
                *("--lanechange.duration", f"{LANE_CHANGE_S:g}"),
                # pedestrians keep the speed that they want unless somebody is in their way
                *("--pedestrian.striping.dawdling", "0"),
                *("--no-step-log", "true", "--no-warnings", "true", "--xml-validation", "never"),
            ]
        )
        _current = self

    def check(self) -> None:
        """See that SUMO still runs this simulation.

        Raises:
            ScenarioError: another one has begun in this process.
        """
        if _current is not self:
            raise ScenarioError(
                "traffic: another run with traffic has begun in this process; SUMO has one simulation per "
                "process, so finish a run before the next begins, or use --workers"
            )

    # Roads

    def edges_along(self, poses: Sequence[tuple[float, float, float]]) -> list[str]:
        """Edges under points along a way, connected, to where their connection ends."""
        roads, edges = self._sumo.simulation, list[str]()
        for x, y, _ in poses:
            edge = roads.convertRoad(x, y, False, "passenger")[0]
            if edge.startswith(":") or (edges and edges[-1] == edge):
                continue
            between = roads.findRoute(edges[-1], edge).edges if edges else [edge]
            if not between:
                break
            edges += between[1:] if edges else between
        return edges

    def lanes(self, walkers: bool) -> list[tuple[str, float]]:
        """Lanes outside junctions for pedestrians, or for cars, and their lengths."""
        lane = self._sumo.lane
        wanted = []
        for name in lane.getIDList():
            allowed, banned = lane.getAllowed(name), lane.getDisallowed(name)
            on_foot = "pedestrian" in allowed
            cars = not on_foot and (not allowed or "passenger" in allowed) and "passenger" not in banned
            if not name.startswith(":") and (on_foot if walkers else cars):
                wanted.append((name, float(lane.getLength(name))))
        return wanted

    def pose(self, lane: str, at_m: float) -> Pose:
        """Point on a lane at least 1 m from its beginning, and the heading there."""
        edge, _, index = lane.rpartition("_")
        convert = self._sumo.simulation.convert2D
        (x0, y0), (x, y) = convert(edge, at_m - 1.0, int(index)), convert(edge, at_m, int(index))
        return Pose(x, y, math.atan2(y - y0, x - x0))

    def following(self, lane: str) -> list[str]:
        """Edges that a lane leads to."""
        return [link[0].rpartition("_")[0] for link in self._sumo.lane.getLinks(lane)]

    def lane_of_edge(self, edge: str) -> str:
        """The leftmost lane of an edge, which is for vehicles."""
        return f"{edge}_{self._sumo.edge.getLaneNumber(edge) - 1}"

    def limit_mps(self, lane: str) -> float:
        """Speed limit of a lane."""
        return float(self._sumo.lane.getMaxSpeed(lane))

    def lane_of(self, vehicle: str) -> str:
        """The lane that a vehicle is on."""
        return str(self._sumo.vehicle.getLaneID(vehicle))

    # Who is there

    def add_vehicle(self, name: str, kind: str, edges: Sequence[str]) -> None:
        """Add a vehicle with a route; `put` says where it is."""
        self._sumo.route.add(f"route of {name}", list(edges))
        self._sumo.vehicle.add(name, f"route of {name}", kind, departLane="first")
        self._lengths_m[name] = float(self._sumo.vehicletype.getLength(kind))

    def add_walker(self, name: str, kind: str, lane: str, at_m: float, to_m: float) -> None:
        """Add a pedestrian who walks along the edge of a sidewalk."""
        edge = lane.rpartition("_")[0]
        self._sumo.person.add(name, edge, at_m, typeID=kind)
        self._sumo.person.appendWalkingStage(name, [edge], to_m)
        self._persons.add(name)

    def put(self, name: str, front: Pose) -> None:
        """Where the middle of a vehicle's front is after the next step."""
        angle = 90.0 - math.degrees(front.yaw_rad)
        self._sumo.vehicle.moveToXY(name, "", -1, front.x_m, front.y_m, angle, FREE_TO_MOVE)

    def is_driving(self, name: str, speed_mps: float) -> None:
        """Which speed a vehicle has now."""
        self._sumo.vehicle.setPreviousSpeed(name, max(speed_mps, 0.0))

    def wants(self, name: str, speed_mps: float) -> None:
        """Which speed a vehicle has where nothing hinders it, also above the limit."""
        self._sumo.vehicle.setSpeedFactor(name, speed_mps / self.limit_mps(self.lane_of(name)))

    def decides_now(self, name: str, every_s: float) -> None:
        """Let a driver's decisions be so far apart, from now on."""
        self._sumo.vehicle.setActionStepLength(name, every_s, True)

    def step(self) -> None:
        """Go on by a step.

        Raises:
            ScenarioError: SUMO cannot go on, or runs another simulation.
        """
        self.check()
        try:
            self._sumo.simulationStep()
        except self._sumo.TraCIException as error:
            raise ScenarioError(f"traffic: SUMO: {error}") from None

    def present(self) -> set[str]:
        """Names of all who are there."""
        return {*self._sumo.vehicle.getIDList(), *self._sumo.person.getIDList()}

    def place(self, name: str) -> Place:
        """Where somebody who is there is."""
        on_foot = name in self._persons
        who = self._sumo.person if on_foot else self._sumo.vehicle
        (x, y), yaw = who.getPosition(name), math.radians(90.0 - who.getAngle(name))
        back_m = 0.0 if on_foot else self._lengths_m[name] / 2
        speed = float(who.getSpeed(name))
        return Place(x - back_m * math.cos(yaw), y - back_m * math.sin(yaw), yaw, speed)
