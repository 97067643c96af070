"""Euro NCAP CPNA: an adult steps out from the near side (figure 3 of the SmartMOT paper)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from opendrive import RoadNetwork
from scenarios.actors import KMH, Actor, Actors
from scenarios.errors import ScenarioError
from scenarios.presets import Preset
from scenarios.sensors import Sensor
from scenarios.simulation import Simulation, StopRule
from scenarios.vehicle import EgoVehicle
from smartmot.monitored_area import (
    EverythingArea,
    MapArea,
    MonitoredAreaStrategy,
    RectangularArea,
)
from smartmot.pipeline import Pipeline
from smartmot.route import Route, route_ahead
from smartmot.strips import KERBSIDE_TYPES, SIDEWALK_TYPES

ADULT_LENGTH_M, ADULT_WIDTH_M = 0.60, 0.50
"""Euro NCAP adult target EPTa: along and across its walking direction."""
ADULT_REFERENCE_M = -0.06
"""Its H-point, the reference of the impact location, lies 0.06 m behind the box centre."""
TARGET_SPEED_KMH = 5.0
START_OFFSET_M = 4.0
"""From the lane centre (paper, figure 3; Euro NCAP start offset of CPNA)."""
ACCEL_DISTANCE_M = 1.0
"""Euro NCAP: distance over which the target reaches its speed. In the paper it starts at speed."""
PATH_M = 10.5
"""How far the pedestrian walks: over the other lane and onto the far sidewalk."""

LEAD_S = 2.0
"""The ego drives this long before the pedestrian starts. A whole number of sensor frames, so that a frame
falls on the start: the phase of the frames is fixed and the same in every run."""
STRAIGHT_RAD = np.radians(1.0)
RUN_OUT_M = 20.0
STRATEGIES = ("rectangular", "map", "all")
ADVERSARIES = ("none", "static")


@dataclass(frozen=True, slots=True)
class CpnaTest:
    """Parameters of one test.

    Args:
        speed_kmh: test speed of the ego.
        impact_point_percent: Euro NCAP impact location across the ego's width (0: right edge, 100: left
            edge), with the pedestrian's run-up; None: the paper's test, meeting at the lane centre.
        adversaries: none, or static: parked cars and standing pedestrians (figure 5c, d).
        seed: of the sensor noise.
    """

    speed_kmh: float
    impact_point_percent: float | None = None
    adversaries: str = "none"
    seed: int = 0

    def __post_init__(self) -> None:
        if not 0 < self.speed_kmh <= 140:
            raise ScenarioError(f"test speed must lie in (0, 140] km/h, got {self.speed_kmh:g}")
        if self.impact_point_percent is not None and not 0 <= self.impact_point_percent <= 100:
            raise ScenarioError(f"impact point must lie in 0..100 %, got {self.impact_point_percent:g}")
        if self.adversaries not in ADVERSARIES:
            raise ScenarioError(
                f"unknown adversaries {self.adversaries!r}; use one of: {', '.join(ADVERSARIES)}"
            )

    @property
    def name(self) -> str:
        """Scenario name for the results."""
        return "CPNA" if self.impact_point_percent is None else f"CPNA-{self.impact_point_percent:g}"


@dataclass(frozen=True, slots=True, eq=False)
class Site:
    """Where a test takes place: a straight stretch of a map.

    Args:
        network: the map.
        route: the ego's way.
        line_m: station of the pedestrian's line on it.
        near_side: -1 where traffic keeps right (the near side is to the right), +1 where it keeps left.
    """

    network: RoadNetwork
    route: Route
    line_m: float
    near_side: int


def approach_m(speed_kmh: float) -> float:
    """Straight length that a test needs before the pedestrian's line."""
    walk_s = (START_OFFSET_M + 1.0 + ACCEL_DISTANCE_M) / (TARGET_SPEED_KMH * KMH)
    return speed_kmh * KMH * (LEAD_S + walk_s) + 10.0


def site_at(network: RoadNetwork, lane: int, s_m: float, max_speed_kmh: float) -> Site:
    """Take a place on a lane for the pedestrian's line.

    Raises:
        ScenarioError: the lane is not for driving, or is not straight for long enough around the place.
    """
    name = tuple(network.lanes.key[lane])
    if network.lanes.lane_type[lane] != "driving":
        raise ScenarioError(
            f"lane {name} is of type {network.lanes.lane_type[lane]!s}; choose a driving lane"
        )
    needed = approach_m(max_speed_kmh)
    route = route_ahead(network, lane, s_m, ahead_m=RUN_OUT_M + 60.0, behind_m=needed + 5.0)
    index = route.lanes.index(lane)
    line = float(route.entry_m[index]) + route.strips[index].station_at(s_m)
    free = straight_around(route, line)
    if free[0] < needed or free[1] < RUN_OUT_M:
        raise ScenarioError(
            f"no straight stretch: at lane {name}, s = {s_m:g} m the route is straight for {free[0]:.0f} m "
            f"before and {free[1]:.0f} m after; {max_speed_kmh:g} km/h needs {needed:.0f} m and "
            f"{RUN_OUT_M:.0f} m"
        )
    return Site(network, route, line, near_side(network, lane))


def straight_around(route: Route, station_m: float) -> tuple[float, float]:
    """Lengths before and after a station over which the heading stays within one degree of that there."""
    delta = np.diff(route.center_m, axis=0)
    heading = np.unwrap(np.arctan2(delta[:, 1], delta[:, 0]))
    k = int(np.clip(np.searchsorted(route.station_m, station_m) - 1, 0, len(heading) - 1))
    bent = np.abs(heading - heading[k]) > STRAIGHT_RAD
    before = np.flatnonzero(bent[:k])
    after = np.flatnonzero(bent[k:])
    start = route.station_m[before[-1] + 1] if len(before) else 0.0
    end = route.station_m[k + after[0]] if len(after) else route.length_m
    return station_m - float(start), float(end) - station_m


def find_site(network: RoadNetwork, max_speed_kmh: float) -> Site:
    """Choose a place: the longest straight driving lane outside junctions, beside a sidewalk if there is one.

    Raises:
        ScenarioError: no lane is straight for long enough.
    """
    lanes = network.lanes
    length = lanes.s_end_m - lanes.s_start_m
    candidates = [
        i
        for i in np.argsort(-length, kind="stable").tolist()
        if lanes.lane_type[i] == "driving" and lanes.junction_id[i] is None
    ]
    middle = (lanes.s_start_m + lanes.s_end_m) / 2
    beside = [
        i
        for i in candidates
        if kerb_m(network, i, float(middle[i]), near_side(network, i), over_lanes=False)[1]
    ]
    needed = approach_m(max_speed_kmh)
    for lane in (beside or candidates)[:60]:
        low, high = float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])
        for share in (0.75, 0.5, 0.9, 0.99):
            s = low + share * (high - low) if lanes.direction[lane] > 0 else high - share * (high - low)
            try:
                return site_at(network, lane, s, max_speed_kmh)
            except ScenarioError:
                continue
    raise ScenarioError(
        f"no straight stretch of {needed:.0f} m for {max_speed_kmh:g} km/h among the longest lanes of map "
        f"{network.name or '(unnamed)'}; use lower speeds, another map, or --at ROAD,LANE,S"
    )


def kerb_m(
    network: RoadNetwork, lane: int, s_m: float, side: int, *, over_lanes: bool = True
) -> tuple[float, bool]:
    """Distance from a lane's centre over the carriageway to the kerb, and whether a sidewalk begins there.

    Args:
        network: the map.
        lane: index of the lane.
        s_m: road coordinate.
        side: +1 to the left of the lane's travel direction, -1 to the right.
        over_lanes: go on over further driving lanes; else the search ends at the first.
    """
    along = int(network.lanes.direction[lane])
    here = np.array([s_m])
    distance = float(network.lane_width(lane, here)[0]) / 2
    current = lane
    while True:
        same_way = int(network.lanes.direction[current]) == along
        outward = network.left_neighbour if (side > 0) == same_way else network.right_neighbour
        following = outward(current)
        if following is None:
            return distance, False
        kind = str(network.lanes.lane_type[following])
        if kind in SIDEWALK_TYPES:
            return distance, True
        if kind not in KERBSIDE_TYPES and not (over_lanes and kind == "driving"):
            return distance, False
        distance += float(network.lane_width(following, here)[0])
        current = following


def near_side(network: RoadNetwork, lane: int) -> int:
    """Side of a lane's near side: -1 (right) where traffic keeps right, +1 (left) where it keeps left."""
    return 1 if int(network.lanes.direction[lane]) * network.lanes.key[lane].lane_id > 0 else -1


def make_strategy(name: str, preset: Preset, site: Site) -> MonitoredAreaStrategy:
    """Build a monitored-area strategy by name.

    Raises:
        ScenarioError: there is none of that name.
    """
    if name == "rectangular":
        return RectangularArea(preset.rectangular, preset.pipeline.braking_distance)
    if name == "map":
        return MapArea(site.network, site.route, preset.map_area)
    if name == "all":
        return EverythingArea()
    raise ScenarioError(f"unknown strategy {name!r}; use one of: {', '.join(STRATEGIES)}")


def _target(test: CpnaTest, site: Site, ego_width_m: float) -> tuple[Actor, float]:
    """The pedestrian, and the distance from the ego's front to its line at which it must start."""
    side = site.near_side
    x, y, yaw = site.route.pose(site.line_m, side * START_OFFSET_M)
    speed = TARGET_SPEED_KMH * KMH
    paper = test.impact_point_percent is None
    actor = Actor(
        category="pedestrian",
        label="target",
        x_m=x,
        y_m=y,
        yaw_rad=yaw - side * np.pi / 2,
        length_m=ADULT_LENGTH_M,
        width_m=ADULT_WIDTH_M,
        speed_mps=speed,
        accel_distance_m=0.0 if paper else ACCEL_DISTANCE_M,
        path_m=PATH_M,
    )
    if test.impact_point_percent is None:
        # the impact point lies on the lane's centre, on the pedestrian's line
        return actor, test.speed_kmh * KMH * actor.time_to(START_OFFSET_M)
    # the reference point meets the front at the impact location when the box's near face is reached
    across = ego_width_m * (test.impact_point_percent / 100 - 0.5)
    walk = START_OFFSET_M - side * across - ADULT_REFERENCE_M
    return actor, test.speed_kmh * KMH * actor.time_to(walk) + ADULT_WIDTH_M / 2


def _adversaries(site: Site) -> list[Actor]:
    """Parked cars at the far kerb, pedestrians standing on the monitored and the non-relevant sidewalk.

    Cars stand 0.1 m from the far kerb, pedestrians 0.9 m over the near kerb (inside the usual margin of
    1.8 m) and 2.2 m over it (outside), and on the far sidewalk.
    """
    side = site.near_side
    index = int(np.searchsorted(site.route.entry_m, site.line_m, side="right")) - 1
    strip = site.route.strips[index]
    s_m = strip.s_at(site.line_m - float(site.route.entry_m[index]))
    near, far = (kerb_m(site.network, strip.lane, s_m, k)[0] for k in (side, -side))
    actors: list[Actor] = []

    def put(category: str, along: float, across: float, size: tuple[float, float], turn: float = 0.0) -> None:
        x, y, yaw = site.route.pose(site.line_m + along, side * across)
        actors.append(Actor(category, "adversary", x, y, yaw + turn, *size))

    car, adult = (4.4, 1.8), (ADULT_LENGTH_M, ADULT_WIDTH_M)
    # where the far kerb is too near for a parked car (the innermost lane of a divided road) none stands there
    half_lane = float(strip.half_width_m.max())
    roomy = far >= half_lane + car[1] + 0.2
    for along in (-25.0, -12.0, 3.0, 12.0) if roomy else ():
        put("car", along, -(far - car[1] / 2 - 0.1), car, np.pi)
    for along in (-18.0, 6.0, 14.0):
        put("pedestrian", along, near + 0.9, adult)
    for along in (-22.0, 9.0):
        put("pedestrian", along, near + 2.2, adult)
    put("pedestrian", 2.0, -(far + 1.0), adult)
    return actors


def build(
    test: CpnaTest,
    site: Site,
    preset: Preset,
    strategy: MonitoredAreaStrategy | None,
    rule: StopRule | None = None,
) -> Simulation:
    """Set up a run.

    Args:
        test: parameters.
        site: where.
        preset: vehicle, sensor, perception.
        strategy: monitored area; None: no perception and no braking.
        rule: when to end; the default holds long enough for the pedestrian to cross and the ego to drive on.

    Raises:
        ScenarioError: the ego would have to start before the route's beginning.
    """
    target, start_distance = _target(test, site, preset.ego_width_m)
    trigger = site.line_m - start_distance
    speed = test.speed_kmh * KMH
    start = trigger - preset.ego_length_m / 2 - speed * LEAD_S
    if start < 0:
        raise ScenarioError(
            f"{test.speed_kmh:g} km/h needs {site.line_m - start:.0f} m of road before the pedestrian's "
            f"line; the route offers {site.line_m:.0f} m"
        )
    ego = EgoVehicle(site.route, start, speed, preset.ego_length_m, preset.ego_width_m, preset.brakes)
    actors = [target] + (_adversaries(site) if test.adversaries == "static" else [])
    return Simulation(
        ego=ego,
        actors=Actors(actors),
        route=site.route,
        trigger_station_m=trigger,
        target=0,
        sensor=Sensor(preset.sensor, test.seed),
        pipeline=Pipeline(strategy, preset.pipeline) if strategy else None,
        rule=rule or StopRule(),
    )
