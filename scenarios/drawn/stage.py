"""Where a drawn scene takes place: the ego's way over a map, a line across it, and what lies beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from opendrive import RoadNetwork
from scenarios.drawn.actors import EGO
from scenarios.drawn.values import Draw, RejectedDraw, weighted
from scenarios.openscenario.motion.paths import Pose
from scenarios.openscenario.motion.roads import load_roads
from scenarios.places import near_side
from smartmot.errors import SmartMotError
from smartmot.maps.route import Route, route_from_lanes
from smartmot.maps.strips import lane_strip
from smartmot.maps.walks import KERBSIDE_TYPES, SIDEWALK_TYPES, extend, lane_ends, outward
from smartmot.types import FloatArray

RUN_OUT_M = 45.0
"""Length of the ego's way beyond the line: where it would end without it."""
SLOWEST_MPS = 10.0 / 3.6
"""Lowest speed of the ego, as in the tests of Euro NCAP."""
LATERAL_MPS2 = 3.0
"""Greatest lateral acceleration of the ego in bends (assumed; what drivers rarely go beyond in town)."""
STRAIGHT_RAD, BEND_RAD = math.radians(4.0), math.radians(20.0)
"""An approach is straight if it turns by less over `APPROACH_M` before the line, a bend if by more."""
APPROACH_M = 35.0
TURN_RAD = math.radians(45.0)
"""A way through a junction is a turn if it turns by more."""
PAVED = frozenset(
    {
        "driving",
        "bidirectional",
        "entry",
        "exit",
        "onRamp",
        "offRamp",
        "parking",
        "shoulder",
        "stop",
        "biking",
    }
)
CARRIAGEWAY = PAVED | KERBSIDE_TYPES
_CHORD_M = 2.0


@dataclass(frozen=True, slots=True)
class Strip:
    """A lane beside the ego's lane, at distances from the middle of that.

    Args:
        kind: lane type.
        inner_m, outer_m: its borders; for the ego's own lane the inner one is negative.
        same_way: whether its traffic runs the ego's way.
        lane: index in the map.
    """

    kind: str
    inner_m: float
    outer_m: float
    same_way: bool
    lane: int

    @property
    def middle_m(self) -> float:
        """Distance of its middle."""
        return (self.inner_m + self.outer_m) / 2

    @property
    def width_m(self) -> float:
        """Its width."""
        return self.outer_m - self.inner_m


@dataclass(frozen=True, slots=True)
class SideStrips:
    """What lies to one side of the ego's lane.

    Args:
        half_width_m: of the ego's lane.
        strips: outwards.
    """

    half_width_m: float
    strips: tuple[Strip, ...]

    def nearest(self, kind: str, *, same_way: bool | None = None) -> Strip | None:
        """The nearest strip of a kind."""
        fits = (s for s in self.strips if s.kind == kind and same_way in (None, s.same_way))
        return next(fits, None)

    @property
    def kerb_m(self) -> float:
        """Distance of the kerb: where the carriageway with its parking and cycle lanes ends."""
        return self._edge_m(CARRIAGEWAY)

    @property
    def paved_m(self) -> float:
        """Distance up to which vehicles may drive or stand; verges without a name of their own are beyond."""
        return self._edge_m(PAVED)

    def _edge_m(self, kinds: frozenset[str]) -> float:
        edge = self.half_width_m
        for strip in self.strips:
            if strip.kind not in kinds:
                break
            edge = strip.outer_m
        return edge

    @property
    def is_outermost(self) -> bool:
        """Whether no other driving lane lies to this side."""
        return self.nearest("driving") is None

    @property
    def sidewalk(self) -> Strip | None:
        """The sidewalk beyond the kerb, if there is one."""
        return next((strip for strip in self.strips if strip.kind in SIDEWALK_TYPES), None)


class Ground:
    """A map on which scenes are placed.

    Args:
        path: its OpenDRIVE file.

    Raises:
        scenarios.openscenario.errors.RunError: the file cannot be read.
    """

    def __init__(self, path: Path) -> None:
        self.path, self.name = path, path.stem
        self.network: RoadNetwork = load_roads(path).network

    @cached_property
    def driving(self) -> tuple[tuple[int, ...], tuple[float, ...]]:
        """Driving lanes outside junctions, and their lengths along the road."""
        lanes = self.network.lanes
        chosen = [
            k
            for k in range(len(lanes.key))
            if lanes.lane_type[k] == "driving" and lanes.junction_id[k] is None
        ]
        return tuple(chosen), tuple(float(lanes.s_end_m[k] - lanes.s_start_m[k]) for k in chosen)

    @cached_property
    def ways_through(self) -> tuple[tuple[int, float], ...]:
        """Driving lanes in junctions that lead from a lane to another, and how far each turns."""
        lanes, network = self.network.lanes, self.network
        ways = []
        for k in range(len(lanes.key)):
            if lanes.lane_type[k] != "driving" or lanes.junction_id[k] is None:
                continue
            if network.predecessors(k) and network.successors(k):
                heading = network.center_line(k, np.array(lane_ends(network, k)))[3]
                ways.append((k, math.remainder(float(heading[1] - heading[0]), 2.0 * math.pi)))
        return tuple(ways)

    @cached_property
    def turns(self) -> tuple[int, ...]:
        """The ways through junctions that turn."""
        return tuple(k for k, turn in self.ways_through if abs(turn) > TURN_RAD)

    @cached_property
    def crosswalk_lanes(self) -> tuple[tuple[int, float], ...]:
        """Driving lanes outside junctions that a crosswalk lies across, and s of its middle."""
        lanes, places = self.network.lanes, []
        for crosswalk in self.network.crosswalks:
            for k in self.driving[0]:
                on_road = lanes.key[k].road_id == crosswalk.road_id
                if on_road and float(lanes.s_start_m[k]) < crosswalk.s_m < float(lanes.s_end_m[k]):
                    places.append((k, crosswalk.s_m))
        return tuple(places)


@dataclass(frozen=True, slots=True, eq=False)
class Stage:
    """The ego's way and the line at which the scene is about something.

    Args:
        ground: the map.
        route: the ego's way.
        line_m: station of the line.
        speed_mps: of the ego.
        lead_s: from the start until the middle of the ego would be at the line.
        kind: straight, bend, turn, crosswalk or crossing.
    """

    ground: Ground
    route: Route
    line_m: float
    speed_mps: float
    lead_s: float
    kind: str

    @property
    def network(self) -> RoadNetwork:
        """The map."""
        return self.ground.network

    @property
    def start_m(self) -> float:
        """Station of the ego's start."""
        return self.line_m - self.speed_mps * self.lead_s

    @property
    def hit_s(self) -> float:
        """When the ego's front would be at the line."""
        return self.lead_s - EGO.length_m / 2 / self.speed_mps

    @property
    def near(self) -> int:
        """The near side as a sign: 1 to the left, -1 to the right."""
        return near_side(self.network, self.lane_at(self.line_m)[0])

    def pose(self, station_m: float, left_m: float = 0.0, turn_rad: float = 0.0) -> Pose:
        """A pose beside the way, heading along it but for a turn."""
        x, y, _ = self.route.pose(station_m, left_m)
        return Pose(x, y, self.heading_rad(station_m) + turn_rad)

    def heading_rad(self, station_m: float) -> float:
        """Heading of the way: that of a chord around the place."""
        a, b = (np.array(self.route.pose(station_m + ds)[:2]) for ds in (-_CHORD_M / 2, _CHORD_M / 2))
        return math.atan2(*(b - a)[::-1].tolist())

    def beside(self, from_m: float, to_m: float, left_m: float) -> FloatArray:
        """(P, 2) points beside the way from a station to another, which may lie behind."""
        count = max(2, math.ceil(abs(to_m - from_m) / _CHORD_M) + 1)
        return self.route.poses(np.linspace(from_m, to_m, count), left_m)[0]

    def side(self, station_m: float, sign: int) -> SideStrips:
        """What lies to a side (1 left, -1 right) at a station."""
        lane, s = self.lane_at(station_m)
        lanes, network = self.network.lanes, self.network
        along = int(lanes.direction[lane])
        own = [float(t) for t in network.lane_offsets(lane, s)]
        middle = sum(own) / 2
        strips = []
        for other in outward(network, lane, "left" if sign > 0 else "right"):
            t = [(float(value) - middle) * along * sign for value in network.lane_offsets(other, s)]
            same_way = int(lanes.direction[other]) == along
            strips.append(Strip(str(lanes.lane_type[other]), min(t), max(t), same_way, other))
        return SideStrips(abs(own[1] - own[0]) / 2, tuple(s for s in strips if s.width_m > 1e-3))

    def lane_at(self, station_m: float) -> tuple[int, float]:
        """Lane of the way at a station, and s there."""
        k = int(np.searchsorted(self.route.entry_m, station_m, side="right")) - 1
        k = min(max(k, 0), len(self.route.strips) - 1)
        strip = self.route.strips[k]
        return strip.lane, strip.s_at(station_m - float(self.route.entry_m[k]))

    def place_at(self, station_m: float) -> tuple[str, int, float]:
        """Road, lane id and s of the way at a station."""
        lane, s = self.lane_at(station_m)
        key = self.network.lanes.key[lane]
        return key.road_id, key.lane_id, s

    def waypoints(self) -> list[tuple[str, int, float]]:
        """Road, lane id and s of places that determine the way: its start, each lane after it, its end."""
        places = [self.place_at(self.start_m)]
        ends = [*self.route.entry_m.tolist()[1:], self.route.length_m]
        for enters, leaves in zip(self.route.entry_m.tolist(), ends, strict=True):
            if enters > self.start_m and leaves - enters > 0.2:
                places.append(self.place_at((enters + leaves) / 2))
        last = self.place_at(self.route.length_m - 0.05)
        return [*places, last] if self.route.length_m - 0.1 > self.start_m else places


# ------------------------------------------------------------------------------------------------ choosing


def choose_stage(ground: Ground, kind: str, draw: Draw) -> Stage:
    """Draw a place of a kind, with the ego's speed and the time until it is there.

    Args:
        ground: the map.
        kind: straight, bend, any, turn, crosswalk or crossing.
        draw: of the scene.

    Raises:
        RejectedDraw: the map has no such place, or the drawn one does not fit.
    """
    speed = draw.number("turning_speed_kmh" if kind == "turn" else "ego_speed_kmh") / 3.6
    lead = draw.number("lead_s")
    if kind in ("turn", "crossing"):
        route, line = _through_junction(ground, kind, draw, speed * lead)
    elif kind == "crosswalk":
        places = ground.crosswalk_lanes
        if not places:
            raise RejectedDraw("the map has no crosswalk over a lane outside junctions")
        lane, s = places[weighted([1.0] * len(places), draw.uniform())]
        route, line = way_over(ground.network, [lane], s, speed * lead)
    else:
        lanes, lengths = ground.driving
        if not lanes:
            raise RejectedDraw("the map has no driving lane outside junctions")
        lane = lanes[weighted(lengths, draw.uniform())]
        low, high = (
            float(ends[lane]) for ends in (ground.network.lanes.s_start_m, ground.network.lanes.s_end_m)
        )
        route, line = way_over(ground.network, [lane], low + draw.uniform() * (high - low), speed * lead)
    speed = min(speed, _fastest_mps(route, line - speed * lead, line + 5.0))
    if speed < SLOWEST_MPS:
        raise RejectedDraw("the bend is too narrow for the least speed")
    speed = math.floor(speed * 3600.0) / 3600.0
    stage = Stage(ground, route, round(line, 3), speed, lead, kind)
    if stage.start_m < 0.5:
        raise RejectedDraw("the ego's lane begins too near before the line")
    if route.length_m - line < 12.0:
        raise RejectedDraw("the ego's lane ends too near behind the line")
    turned = abs(_turned_rad(route, max(line - APPROACH_M, stage.start_m), line + 3.0))
    if kind == "straight" and turned > STRAIGHT_RAD:
        raise RejectedDraw("the approach is not straight")
    if kind == "bend" and turned < BEND_RAD:
        raise RejectedDraw("the approach is no bend")
    draw.values["ego_speed_kmh"] = round(speed * 3.6, 3)
    return stage


def way_over(network: RoadNetwork, lanes: list[int], s_m: float, before_m: float) -> tuple[Route, float]:
    """The way over lanes, straight on at both ends, and the station of a place on the last of them."""
    lanes, last = list(lanes), lanes[-1]
    strips = [lane_strip(network, lane, 0.0) for lane in lanes]
    station = strips[-1].station_at(s_m)
    behind = sum(strip.length_m for strip in strips[:-1]) + station
    extend(network, lanes, strips[-1].length_m - station, RUN_OUT_M, forward=True)
    extend(network, lanes, behind, before_m + 2.0, forward=False)
    try:
        route = route_from_lanes(network, lanes)
    except SmartMotError:
        raise RejectedDraw("the lanes around the place make no way") from None
    return route, route.station_of(last, s_m)


def _through_junction(ground: Ground, kind: str, draw: Draw, before_m: float) -> tuple[Route, float]:
    """A way through a junction; the line lies behind a turn, and in the middle of the way over a crossing."""
    network = ground.network
    turns = set(ground.turns)
    ways = [k for k, _ in ground.ways_through if (k in turns) == (kind == "turn")]
    if not ways:
        raise RejectedDraw("the map has no turn" if kind == "turn" else "the map has no way over a junction")
    way = ways[weighted([1.0] * len(ways), draw.uniform())]
    before, after = network.predecessors(way)[0], network.successors(way)[0]
    if kind == "crossing":
        low, high = lane_ends(network, way)
        return way_over(network, [before, way], (low + high) / 2, before_m)
    low, high = lane_ends(network, after)
    beyond = min(draw.number("beyond_junction_m"), abs(high - low) / 2)
    return way_over(network, [before, way, after], low + math.copysign(beyond, high - low), before_m)


def _headings(route: Route, from_m: float, to_m: float) -> tuple[FloatArray, float]:
    """Headings of chords of the way, unwrapped, and the length of each."""
    count = max(3, math.ceil((to_m - from_m) / _CHORD_M) + 1)
    points, _ = route.poses(np.linspace(max(from_m, 0.0), to_m, count))
    step = np.diff(points, axis=0)
    return np.unwrap(np.arctan2(step[:, 1], step[:, 0])), float(np.hypot(*step.T).mean())


def _turned_rad(route: Route, from_m: float, to_m: float) -> float:
    """How far the way turns in all, whichever way."""
    return float(np.abs(np.diff(_headings(route, from_m, to_m)[0])).sum())


def _fastest_mps(route: Route, from_m: float, to_m: float) -> float:
    """Highest speed at which the lateral acceleration stays below its limit."""
    headings, chord_m = _headings(route, from_m, to_m)
    curvature = float(np.abs(np.diff(headings)).max()) / chord_m
    return math.sqrt(LATERAL_MPS2 / max(curvature, 1e-6))
