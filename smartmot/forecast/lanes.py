"""Forecasts along the lanes of a map: at forks several hypotheses with probabilities, and the motion alone.

A vehicle or cyclist over a lane that runs its way may follow each way that the lanes ahead lead. How likely a
way is says how well it fits what the object does now: its offset and course, its turn rate against the
bend ahead, and whether it could take the bend at its speed. What fits no lane well moves as without a map,
and so does everything else.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from smartmot.forecast.motion import (
    SPREAD_M2PS3,
    Motion,
    accelerations,
    class_motion,
    class_positions,
    codes,
    driven_m,
    forecast_covariance,
)
from smartmot.forecast.tracks import ForecastConfig
from smartmot.geometry import wrap_angle
from smartmot.maps.lane_map import LaneMap
from smartmot.maps.route import Route, route_from_lanes
from smartmot.maps.walks import lane_ends, lane_length_m, lanes_under
from smartmot.types import CATEGORIES, BoolArray, FloatArray, Forecast, IntArray, Tracks

FOLLOWERS = ("car", "truck", "motorcycle", "cyclist", "unknown")
"""Categories that keep to lanes."""

LEAST_SPEED_MPS = 0.5
"""Slower objects have no direction to compare with the lane's."""

MOST_WAYS = 6
"""Hypotheses of an object that are kept, the motion alone among them: the six of Argoverse."""

_LANE_SIGMA_M = 0.5
"""How far a driver strays from the line that keeps the present offset; half a lane's free width is 0.8 m."""

_OFFSET_SIGMA_M, _COURSE_SIGMA_RAD, _TURN_SIGMA_RAD = 1.0, 0.2, 0.15
"""Distance from the middle, angle to the lane, and how far the turn of the next second may be off that of the
lane: standard deviations with which a way is weighed."""

_CORNERING_MPS2, _CORNERING_SIGMA_MPS2 = 4.0, 2.0
"""Lateral acceleration that a driver takes without slowing down, and how much more makes a bend unlikely: a
driver who still brakes for it may come faster."""

_STRAIGHT_RAD, _TURN_WEIGHT = 0.15, 0.4
"""Of the ways of an object, one that turns is so much less likely than one that is straight within this angle
before anything is known of the object: of three vehicles at a junction in town two go straight on."""

_DRIFT_MEMORY_S = 1.0
"""Time over which drivers come back to the direction of their lane."""

_SAME_M = 0.5
"""Ways that end so near to each other within the horizon are one."""

_FREE_WEIGHT = 0.05
"""Weight of the motion alone beside ways that fit perfectly (1): lane changes, and lanes the map lacks."""

_STEP_M = 10.0
"""Ways are listed for lengths in steps of this."""


@dataclass(frozen=True, slots=True, eq=False)
class ForecastHypotheses:
    """Where M tracks may be: K hypotheses, those of each track by falling probability.

    Args:
        forecast: Poses of the K hypotheses at T times, with their covariance, map frame.
        track: (K,) row of the track, ascending.
        probability: (K,) those of a track sum to 1.
        along_lane: (K,) whether the hypothesis follows lanes.
    """

    forecast: Forecast
    track: IntArray
    probability: FloatArray
    along_lane: BoolArray


class Way(NamedTuple):
    """One way of an object.

    Attributes:
        weight: Its probability but for a factor.
        route: Its lanes; None: the motion alone.
        station_m, offset_m: Where the object is on it.
        drift_mps: How fast the offset grows.
    """

    weight: float
    route: Route | None
    station_m: float
    offset_m: float
    drift_mps: float


class Ways(NamedTuple):
    """K ways of some objects, those of each by falling probability; the last by itself is the motion alone.

    Attributes:
        row: (K,) the object, ascending.
        probability: (K,) those of an object sum to 1.
        routes: The lanes of each; None: the motion alone.
        station_m, offset_m: (K,) where the object is on the way.
        drift_mps: (K,) how fast its offset grows.
    """

    row: IntArray
    probability: FloatArray
    routes: tuple[Route | None, ...]
    station_m: FloatArray
    offset_m: FloatArray
    drift_mps: FloatArray


class LaneForecaster:
    """Forecasts along lanes; remembers the ways of lanes that it has met.

    Args:
        lane_map: The map, in the frame of the tracks.
    """

    def __init__(self, lane_map: LaneMap) -> None:
        self._map = lane_map
        self._ways: dict[tuple[int, int], tuple[Route, ...]] = {}

    def forecast(
        self, tracks: Tracks, time_s: FloatArray, config: ForecastConfig, delay_s: float = 0.0
    ) -> ForecastHypotheses:
        """All hypotheses of all tracks.

        Args:
            tracks: M tracks, map frame.
            time_s: (T,) times after now, ascending from 0.
            config: Limits of the turn rate.
            delay_s: Age of the tracks' estimate now.
        """
        time, code = np.array(time_s, dtype=np.float64), codes(tracks.category)
        limit = config.max_yaw_rate_radps
        motion = class_motion(
            tracks.velocity_mps,
            tracks.boxes.yaw_rad,
            np.clip(tracks.yaw_rate_radps, -limit, limit),
            accelerations(tracks.mean),
            tracks.covariance,
            code,
        )
        moved = time + delay_s
        free, course = class_positions(tracks.boxes.center_m, motion, code, moved)
        ways = self.ways(tracks.boxes.center_m, motion, code, float(moved[-1]))
        center, heading = self.along(ways, motion, free[ways.row], np.tile(moved, (len(ways.row), 1)))
        on_lane = np.array([route is not None for route in ways.routes], dtype=np.bool_)
        now = np.arctan2(motion.velocity_mps[:, 1], motion.velocity_mps[:, 0])
        yaw = tracks.boxes.yaw_rad[ways.row, None] + (course - now[:, None])[ways.row]
        yaw[on_lane] = heading[on_lane]
        covariance = forecast_covariance(tracks.covariance, code, moved)[ways.row]
        covariance[on_lane] = _beside_lane(covariance[on_lane], heading[on_lane])
        valid = np.ones(yaw.shape, dtype=np.bool_)
        size = tracks.boxes.size_m[ways.row]
        return ForecastHypotheses(
            Forecast(time, center, yaw, size, valid, covariance), ways.row, ways.probability, on_lane
        )

    def ways(self, center_m: FloatArray, motion: Motion, code: IntArray, horizon_s: float) -> Ways:
        """Where M objects may go, and how likely that is.

        Args:
            center_m: (M, 2) centres, map frame.
            motion: Of the objects.
            code: (M,) positions in `smartmot.types.CATEGORIES`.
            horizon_s: How far ahead the ways are told apart.
        """
        velocity = motion.velocity_mps
        speed = np.hypot(velocity[:, 0], velocity[:, 1])
        course = np.arctan2(velocity[:, 1], velocity[:, 0])
        follows = np.isin(np.array(CATEGORIES)[code], FOLLOWERS) & (speed > LEAST_SPEED_MPS)
        candidates: dict[int, list[Way]] = {
            row: [Way(_FREE_WEIGHT, None, 0.0, 0.0, 0.0)] for row in range(len(code))
        }
        rows = follows.nonzero()[0]
        reach = driven_m(motion, np.array([horizon_s]))[:, 0]
        if len(rows):
            under = lanes_under(self._map, center_m[rows], course[rows])
            left = np.array([lane_ends(self._map, lane)[1] for lane in under.lane.tolist()])
            left = np.abs(left - under.s_m)
            for point, lane, left_m in zip(under.point.tolist(), under.lane.tolist(), left, strict=True):
                row = int(rows[point])
                for route in self._routes(lane, float(reach[row] - left_m)):
                    place = route.place(center_m[row : row + 1])
                    station, offset = float(place[0][0]), float(place[1][0])
                    turn = motion.yaw_rate_radps[row]
                    weight, drift = _weight(route, station, offset, course[row], speed[row], turn, reach[row])
                    _add(candidates[row], Way(weight, route, station, offset, drift), float(reach[row]))
        return _ranked(candidates)

    def along(
        self, ways: Ways, motion: Motion, free_m: FloatArray, time_s: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """Places along K ways at (K, T) times.

        What the motion alone and the lane say of the place is weighed by how far each may be off: the motion
        alone is surer at first, the lane after a second.

        Args:
            ways: The ways.
            motion: Of the objects that the ways' rows count.
            free_m: (K, T, 2) places by the motion alone.
            time_s: (K, T) times.

        Returns:
            (K, T, 2) places and (K, T) headings of the lanes there (0 where there is none), map frame.
        """
        center, heading = np.array(free_m), np.zeros(time_s.shape)
        if not len(ways.row):
            return center, heading
        driven = driven_m(Motion(*(part[ways.row] for part in motion)), time_s)
        by_route: dict[int, list[int]] = {}
        for k, route in enumerate(ways.routes):
            if route is not None:
                by_route.setdefault(id(route), []).append(k)
        steps = time_s.shape[1]
        sure = _lane_share(time_s)[..., None]
        for members in by_route.values():
            route, chosen = ways.routes[members[0]], np.array(members)
            assert route is not None
            station = (ways.station_m[chosen, None] + driven[chosen]).ravel()
            gone_s = -np.expm1(-time_s[chosen] / _DRIFT_MEMORY_S) * _DRIFT_MEMORY_S
            offset = ways.offset_m[chosen, None] + gone_s * ways.drift_mps[chosen, None]
            points, headings = route.poses(station, offset.ravel())
            center[chosen] += sure[chosen] * (points.reshape(-1, steps, 2) - center[chosen])
            heading[chosen] = headings.reshape(-1, steps)
        return center, heading

    def _routes(self, lane: int, beyond_m: float) -> tuple[Route, ...]:
        """Every way over a lane, and over what follows it for at least a length beyond its end."""
        steps = int(max(beyond_m, -_STEP_M) // _STEP_M) + 1
        if (lane, steps) not in self._ways:
            chains = _chains(self._map, lane, steps * _STEP_M)
            self._ways[lane, steps] = tuple(route_from_lanes(self._map, chain) for chain in chains)
        return self._ways[lane, steps]


def _chains(lane_map: LaneMap, lane: int, beyond_m: float) -> list[tuple[int, ...]]:
    """Chains of lanes that begin with a lane and cover a length beyond it, each successor in turn."""
    complete: list[tuple[int, ...]] = []
    open_chains: list[tuple[tuple[int, ...], float]] = [((lane,), beyond_m)]
    while open_chains and len(complete) + len(open_chains) <= 4 * MOST_WAYS:
        chain, left_m = open_chains.pop(0)
        following = [lane for lane in lane_map.successors(chain[-1]) if lane not in chain]
        if left_m <= 0.0 or not following:
            complete.append(chain)
            continue
        open_chains += [((*chain, lane), left_m - lane_length_m(lane_map, lane)) for lane in following]
    return complete + [chain for chain, _ in open_chains]


def _weight(
    route: Route,
    station_m: float,
    offset_m: float,
    course_rad: float,
    speed_mps: float,
    yaw_rate_radps: float,
    reach_m: float,
) -> tuple[float, float]:
    """How well a way fits what an object does, 1 where everything does; how fast the offset grows."""
    ahead = station_m + np.array([0.0, speed_mps, *np.linspace(0.0, reach_m, 7)[1:]])
    heading = route.poses(ahead)[1]
    turned = wrap_angle(heading - heading[0])
    misfit = (offset_m / _OFFSET_SIGMA_M) ** 2
    aside = float(wrap_angle(course_rad - heading[0]))
    misfit += (aside / _COURSE_SIGMA_RAD) ** 2
    misfit += ((yaw_rate_radps - turned[1]) / _TURN_SIGMA_RAD) ** 2  # both over the next second
    bends = np.abs(np.diff(np.unwrap(heading[[0, *range(2, 8)]]))) / max(reach_m / 6.0, 1.0)
    excess = max(speed_mps**2 * float(bends.max()) - _CORNERING_MPS2, 0.0)
    misfit += (excess / _CORNERING_SIGMA_MPS2) ** 2
    turn = float(np.abs(turned[2:]).max())
    straight = float(np.exp(-0.5 * (turn / _STRAIGHT_RAD) ** 2))
    weight = (_TURN_WEIGHT + (1.0 - _TURN_WEIGHT) * straight) * float(np.exp(-0.5 * misfit))
    return weight, speed_mps * float(np.sin(aside))


def _add(ways: list[Way], way: Way, reach_m: float) -> None:
    """Add a way to those of an object; of ways that part only later the one that fits better stays."""
    assert way.route is not None
    end = way.route.pose(way.station_m + reach_m)
    for k, other in enumerate(ways):
        if other.route is None:
            continue
        its_end = other.route.pose(other.station_m + reach_m)
        if np.hypot(end[0] - its_end[0], end[1] - its_end[1]) < _SAME_M:
            if way.weight > other.weight:
                ways[k] = way
            return
    ways.append(way)


def _ranked(candidates: dict[int, list[Way]]) -> Ways:
    """The most likely ways of each object, by falling probability, the motion alone always among them."""
    rows: list[int] = []
    kept: list[Way] = []
    for row, (free, *lanes) in candidates.items():
        lanes.sort(key=lambda way: -way.weight)
        best = sorted([*lanes[: MOST_WAYS - 1], free], key=lambda way: -way.weight)
        total = sum(way.weight for way in best)
        rows += [row] * len(best)
        kept += [way._replace(weight=way.weight / total) for way in best]
    columns = (np.array([way[k] for way in kept], dtype=np.float64) for k in (0, 2, 3, 4))
    probability, station, offset, drift = columns
    routes = tuple(way.route for way in kept)
    return Ways(np.array(rows, dtype=np.int64), probability, routes, station, offset, drift)


def _lane_share(time_s: FloatArray) -> FloatArray:
    """How much the lane counts against the motion alone: by the variances of the places that both say."""
    free = _FREE_SPREAD_M2PS3 * np.asarray(time_s) ** 3 / 3.0
    share: FloatArray = free / (free + _LANE_SIGMA_M**2)
    return share


_FREE_SPREAD_M2PS3 = float(SPREAD_M2PS3[CATEGORIES.index("car")])
"""Density of the acceleration that the motion alone does not know of."""


def _beside_lane(covariance_m2: FloatArray, heading_rad: FloatArray) -> FloatArray:
    """Covariances (K, T, 2, 2) whose variance across headings (K, T) the lane bounds."""
    c, s = np.cos(heading_rad), np.sin(heading_rad)
    along, across = np.stack((c, s), axis=-1), np.stack((-s, c), axis=-1)
    along_m2 = np.einsum("kti,ktij,ktj->kt", along, covariance_m2, along)
    across_m2 = np.einsum("kti,ktij,ktj->kt", across, covariance_m2, across)
    # as from a measurement of the distance to the lane's line
    across_m2 = across_m2 * _LANE_SIGMA_M**2 / (across_m2 + _LANE_SIGMA_M**2)
    bounded: FloatArray = along_m2[..., None, None] * along[..., :, None] * along[..., None, :]
    bounded += across_m2[..., None, None] * across[..., :, None] * across[..., None, :]
    return bounded
