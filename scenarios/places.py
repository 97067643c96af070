"""Places on maps for tests: straight stretches of driving lanes, and what lies beside them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

import _smartmot
from opendrive import RoadNetwork
from scenarios.errors import ScenarioError
from scenarios.openscenario.motion.paths import Pose
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.route import Route, route_ahead
from smartmot.maps.walks import kerb, lanes_under

STRAIGHT_M = 0.05
"""A stretch is straight where the lane's centre stays this near to a straight line: as far as the vehicle
under test may leave its path in a Euro NCAP test."""
SHORT_M = 1e-3
"""On a lane that is shorter nothing stands; alone it is no route."""
SITE_STEP_M = 1.0
"""Places of a lane are tried at this distance."""

RUN_OUT_M = 20.0
"""Straight length that a test needs after its line."""


@dataclass(frozen=True, slots=True)
class Place:
    """A place on a map as the user names it.

    Args:
        road_id: id of the road.
        lane_id: id of the lane on it.
        s_m: road coordinate.
    """

    road_id: str
    lane_id: int
    s_m: float


@dataclass(frozen=True, slots=True, eq=False)
class MapView:
    """Map and route of perception: what a monitored area is made from.

    Args:
        network: the map.
        route: the ego's way on it.
    """

    network: LaneMap
    route: Route

    @property
    def lane_map(self) -> LaneMap | None:
        """The map, for what can do without one; None where there is none."""
        return self.network


@dataclass(frozen=True, slots=True, eq=False)
class Site(MapView):
    """Where a test takes place: a stretch of a map, straight before and after a line across the ego's lane.

    Args:
        network: the map.
        route: the ego's way.
        line_m: station of the line on it.
        near_side: -1 where traffic keeps right (the near side is to the right), +1 where it keeps left.
    """

    network: RoadNetwork
    line_m: float
    near_side: int

    @property
    def line(self) -> Pose:
        """Where the line crosses the lane's centre, heading along it."""
        return Pose(*self.route.pose(self.line_m))

    @property
    def place(self) -> Place:
        """The line as a place of the map: on the last lane of the route that has it."""
        index = int(np.searchsorted(self.route.entry_m, self.line_m, side="right")) - 1
        strip = self.route.strips[max(index, 0)]
        key = self.network.lanes.key[strip.lane]
        s_m = strip.s_at(min(max(self.line_m - float(self.route.entry_m[index]), 0.0), strip.length_m))
        return Place(key.road_id, key.lane_id, float(s_m))

    @property
    def has_sidewalk(self) -> bool:
        """Whether a sidewalk begins at the kerb of the near side, without a driving lane between."""
        lane = lane_at(self.network, self.place)
        return kerb_m(self.network, lane, self.place.s_m, self.near_side, over_lanes=False)[1]


def lane_at(network: RoadNetwork, place: Place) -> int:
    """Index of the lane at a place.

    Raises:
        ScenarioError: there is no such road, lane or s; the message lists what there is.
    """
    roads = {key.road_id for key in network.lanes.key}
    if place.road_id not in roads:
        some = ", ".join(sorted(roads, key=lambda r: (len(r), r))[:12])
        raise ScenarioError(f"the map has no road {place.road_id!r}; it has {len(roads)} roads: {some} ...")
    road_lanes: list[str] = []
    for index, key in enumerate(network.lanes.key):
        if key.road_id != place.road_id:
            continue
        low, high = float(network.lanes.s_start_m[index]), float(network.lanes.s_end_m[index])
        if key.lane_id == place.lane_id and low <= place.s_m <= high:
            return index
        road_lanes.append(f"{key.lane_id} ({network.lanes.lane_type[index]!s}, s {low:g}..{high:g})")
    raise ScenarioError(
        f"road {place.road_id} has no lane {place.lane_id} at s = {place.s_m:g} m; "
        f"it has: {'; '.join(road_lanes[:12])}"
    )


def lane_under(network: RoadNetwork, pose: Pose) -> tuple[int, float]:
    """Driving lane under a pose that runs along its heading, and s there.

    Raises:
        ScenarioError: there is none.
    """
    under = lanes_under(network, np.array([[pose.x_m, pose.y_m]]), np.array([pose.yaw_rad]))
    if len(under.lane):
        return int(under.lane[0]), float(under.s_m[0])
    raise ScenarioError(
        f"no driving lane runs at x = {pose.x_m:g} m, y = {pose.y_m:g} m "
        f"with heading {np.degrees(pose.yaw_rad):g} degrees"
    )


def site_at(network: RoadNetwork, lane: int, s_m: float, approach_m: float) -> Site:
    """Take a place on a lane for the line.

    Args:
        network: the map.
        lane: index of the lane.
        s_m: road coordinate of the line.
        approach_m: straight length that is needed before it.

    Raises:
        ScenarioError: the lane is not for driving, or is not straight for long enough around the place.
    """
    name = tuple(network.lanes.key[lane])
    if network.lanes.lane_type[lane] != "driving":
        raise ScenarioError(
            f"lane {name} is of type {network.lanes.lane_type[lane]!s}; choose a driving lane"
        )
    route = route_ahead(network, lane, s_m, ahead_m=RUN_OUT_M + 60.0, behind_m=approach_m + 5.0)
    line = route.station_of(lane, s_m)
    before, after = straight_around(route, line)
    if before < approach_m or after < RUN_OUT_M:
        raise ScenarioError(
            f"no straight stretch: at lane {name}, s = {s_m:g} m the route is straight for {before:.0f} m "
            f"before and {after:.0f} m after; the test needs {approach_m:.0f} m and {RUN_OUT_M:.0f} m"
        )
    return Site(network, route, line, near_side(network, lane))


def straight_around(route: Route, station_m: float) -> tuple[float, float]:
    """Lengths before and after a station over which the route stays on the tangent there."""
    x, y, yaw = route.pose(station_m)
    along = route.station_m
    offset = np.cos(yaw) * (route.center_m[:, 1] - y) - np.sin(yaw) * (route.center_m[:, 0] - x)
    aside = np.flatnonzero(np.abs(offset) > STRAIGHT_M)
    first = int(np.searchsorted(along[aside], station_m))  # so many of them lie before it
    start = float(along[aside[first - 1] + 1]) if first else 0.0
    end = float(along[aside[first] - 1]) if first < len(aside) else route.length_m
    return station_m - start, end - station_m


def find_site(network: RoadNetwork, approach_m: float) -> Site:
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
    for lane in (beside or candidates)[:60]:
        low, high = float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])
        for share in (0.75, 0.5, 0.9, 0.99):
            s = low + share * (high - low) if lanes.direction[lane] > 0 else high - share * (high - low)
            try:
                return site_at(network, lane, s, approach_m)
            except ScenarioError:
                continue
    stretches = site_stretches(network, approach_m)
    if stretches:
        best = stretches[0].place
        return site_at(network, lane_at(network, best), best.s_m, approach_m)
    raise ScenarioError(
        f"no straight stretch of {approach_m:.0f} m on map "
        f"{network.name or '(unnamed)'}; use lower speeds, another map, or --at ROAD,LANE,S"
    )


@dataclass(frozen=True, slots=True)
class SiteStretch:
    """A stretch of a driving lane on which the line of a test can lie.

    Args:
        place: the middle of the stretch.
        s_low_m: least s of the line.
        s_high_m: greatest s of the line.
        straight_m: straight length before and after the middle together.
        has_sidewalk: whether a sidewalk begins at the kerb of the near side there.
    """

    place: Place
    s_low_m: float
    s_high_m: float
    straight_m: float
    has_sidewalk: bool


def site_stretches(network: RoadNetwork, approach_m: float) -> list[SiteStretch]:
    """Every stretch on which a test can stand, those with a sidewalk first, then the longest straight.

    Args:
        network: the map.
        approach_m: straight length that a test needs before its line.
    """
    lanes = network.lanes
    driving = (lanes.lane_type == "driving") & np.array(
        [j is None for j in lanes.junction_id], dtype=np.bool_
    )
    driving &= lanes.s_end_m - lanes.s_start_m > SHORT_M
    stretches = [
        s for lane in np.flatnonzero(driving).tolist() for s in _lane_stretches(network, lane, approach_m)
    ]
    return sorted(stretches, key=lambda s: (not s.has_sidewalk, -s.straight_m))


def _lane_stretches(network: RoadNetwork, lane: int, approach_m: float) -> Iterator[SiteStretch]:
    """Yield the stretches of one lane, looked for every `SITE_STEP_M`."""
    key = network.lanes.key[lane]
    low_m, high_m = float(network.lanes.s_start_m[lane]), float(network.lanes.s_end_m[lane])
    along = int(network.lanes.direction[lane]) > 0
    count = max(int(np.ceil((high_m - low_m) / SITE_STEP_M)), 1) + 1
    s_m = np.linspace(low_m, high_m, count)
    entry_m = low_m if along else high_m
    ahead_m = high_m - low_m + RUN_OUT_M + 60.0
    route = route_ahead(network, lane, entry_m, ahead_m=ahead_m, behind_m=approach_m + 5.0)
    around = np.array([straight_around(route, route.station_of(lane, s)) for s in s_m.tolist()])
    fits = (around[:, 0] >= approach_m) & (around[:, 1] >= RUN_OUT_M)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], fits, [False]]).astype(np.int8)))
    for first, last in zip(edges[::2].tolist(), (edges[1::2] - 1).tolist(), strict=True):
        middle = (first + last) // 2
        try:
            site_at(network, lane, float(s_m[middle]), approach_m)
        except ScenarioError:
            continue  # another branch lies ahead of that place
        at_m = float(s_m[middle])
        sidewalk = kerb_m(network, lane, at_m, near_side(network, lane), over_lanes=False)[1]
        place = Place(key.road_id, key.lane_id, at_m)
        straight_m = float(around[middle].sum())
        yield SiteStretch(place, float(s_m[first]), float(s_m[last]), straight_m, sidewalk)


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
    s = np.array([s_m])
    half_width = network.lane_width(lane, s) / 2
    distance, has_sidewalk = kerb(
        network, lane, s, "left" if side > 0 else "right", half_width, over_lanes=over_lanes
    )
    return float(distance[0]), has_sidewalk


def near_side(network: RoadNetwork, lane: int) -> int:
    """Side of a lane's near side: -1 (right) where traffic keeps right, +1 (left) where it keeps left."""
    return 1 if int(network.lanes.direction[lane]) * network.lanes.key[lane].lane_id > 0 else -1


__getattr__ = _smartmot.renamed(__name__, {"Scene": "scenarios.places.MapView"})
