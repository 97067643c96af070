"""The road network as scenarios see it: places in lanes, ways along lanes, routes."""

from __future__ import annotations

import math
from array import array
from collections.abc import Sequence
from dataclasses import replace
from functools import cached_property, lru_cache
from itertools import pairwise
from pathlib import Path as FilePath

import numpy as np

from opendrive import RoadNetwork, load_map
from opendrive.errors import OpenDriveError
from opendrive.model import Deferred, Header, MapModel
from scenarios.openscenario.elements import Immutable
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.model import RouteStrategy
from scenarios.openscenario.motion.lane_place import LanePlace
from scenarios.openscenario.motion.paths import (
    CHORD_ERROR_M,
    ON_PATH_M,
    SPACING_M,
    Path,
    Pose,
    Track,
    joined,
    straight,
)
from scenarios.openscenario.motion.route_changes import (
    Leg,
    RouteChange,
    changes_from,
    is_change,
    legs_between,
    settled,
)
from smartmot.maps.lane_map import LEVEL_M
from smartmot.types import FloatArray, IntArray

MAX_WAY_M = 5000.0
"""How far ahead a way along lanes is looked for."""

ON_LANE_RAD = math.pi / 4
"""An entity whose heading departs from the lane's line by more does not follow the lane."""


class Roads(Immutable):
    """Queries on one network.

    Args:
        network: the map.
    """

    def __init__(self, network: RoadNetwork) -> None:
        self.network = network

    @cached_property
    def has_levels(self) -> bool:
        """Whether roads lie above one another, so that a place needs a height."""
        return bool(self.network.overlapping_roads)

    @cached_property
    def forks(self) -> bool:
        """Whether any lane leads to more than one."""
        return any(len(self.network.successors(lane)) > 1 for lane in range(len(self.network.lanes)))

    def _level_m(self, pose: Pose) -> float | None:
        """The height of a pose where it matters."""
        return None if pose.z_m is None or not self.has_levels else pose.z_m

    def levels_m(self, x_m: float, y_m: float) -> list[float]:
        """Heights of the roads at a point, one for each level, the lowest first."""
        hits = self.network.locate(np.array([[x_m, y_m]]))
        levels: list[float] = []
        for height_m in sorted(self._heights_m(hits.lane, hits.s_m, hits.t_m)):
            if not levels or height_m > levels[-1] + LEVEL_M:
                levels.append(height_m)
        return levels

    def level_m(self, x_m: float, y_m: float, z_m: float | None) -> float:
        """Height of the road at a point: of the level nearest to a height; without height of the lowest.

        Beside the roads it is that of the nearest lane, and 0 without any.
        """
        levels = self.levels_m(x_m, y_m)
        if levels:
            return levels[0] if z_m is None else min(levels, key=lambda level_m: abs(level_m - z_m))
        nearest = self.network.nearest_lane(np.array([[x_m, y_m]]), z_m=z_m)
        return self._heights_m(nearest.lane, nearest.s_m, nearest.t_m)[0] if nearest.found[0] else 0.0

    def ground_m(self, x_m: float, y_m: float, before_m: float) -> float:
        """Height of the ground at a point, a step after it was another: that of the road of this level.

        Beside the roads it stays as it was: below a bridge may be grass.
        """
        levels = self.levels_m(x_m, y_m)
        level_m = min(levels, key=lambda height_m: abs(height_m - before_m), default=before_m)
        return level_m if abs(level_m - before_m) <= LEVEL_M else before_m

    def lane_height_m(self, way: Path, station_m: float, x_m: float, y_m: float) -> float | None:
        """Height of the lane below a point on a way; None beside the way, and where that is on no lane."""
        lane = way.lane_at(station_m)
        if lane is None:
            return None
        at_x_m, at_y_m, _ = way.pose(station_m)
        if abs(at_x_m - x_m) + abs(at_y_m - y_m) >= ON_PATH_M:
            return None
        return float(self.network.center_line(lane[0], lane[1])[2])

    def way_heights_m(
        self, way: Path, station_m: FloatArray, points_m: FloatArray, ground_m: float
    ) -> FloatArray:
        """(K,) heights of the ground along a way from a place on, where it is `ground_m`.

        Args:
            way: the way.
            station_m: (K,) arc lengths, ascending.
            points_m: (K, 2) the points there.
            ground_m: height at the first.
        """
        heights = []
        for station, (x_m, y_m) in zip(station_m.tolist(), points_m.tolist(), strict=True):
            known_m = self.lane_height_m(way, station, x_m, y_m)
            ground_m = self.ground_m(x_m, y_m, ground_m) if known_m is None else known_m
            heights.append(ground_m)
        return np.array(heights)

    def _heights_m(self, lane: IntArray, s_m: FloatArray, t_m: FloatArray) -> list[float]:
        """Heights of roads at (s, t) on them."""
        road_ids = [self.network.lanes.key[index].road_id for index in lane.tolist()]
        places = zip(road_ids, s_m.tolist(), t_m.tolist(), strict=True)
        return [float(self.network.road_point(road_id, s, t).z_m) for road_id, s, t in places]

    def _require_roads(self) -> None:
        if not self.network.roads:
            raise RunError(
                "a position by road or lane, but there is no road: RoadNetwork has no LogicFile, "
                "which makes it a plane; use WorldPosition"
            )

    def lane(self, road_id: str, lane_id: int, s_m: float) -> int:
        """Index of a lane of a road at s.

        Raises:
            RunError: no such road or lane, or s is off the road.
        """
        self._require_roads()
        lanes = self.network.lanes
        road = self.network.roads.get(road_id)
        if road is None:
            raise RunError(f"no road '{road_id}' in the map {self.network.name!r}")
        if not -1e-3 <= s_m <= road.length_m + 1e-3:
            raise RunError(f"s = {s_m:.6g} m is off road '{road_id}' (length {road.length_m:.6g} m)")
        best: int | None = None
        for key, index in lanes.lane_of_key.items():
            if key.road_id == road_id and key.lane_id == lane_id and lanes.s_start_m[index] <= s_m + 1e-9:
                best = index if best is None or lanes.s_start_m[index] > lanes.s_start_m[best] else best
        if best is None or s_m > lanes.s_end_m[best] + 1e-3:
            raise RunError(f"road '{road_id}' has no lane {lane_id} at s = {s_m:.6g} m")
        return best

    def lane_middle_m(self, lane: int, s_m: float) -> float:
        """T of the middle of a lane."""
        inner, outer = self.network.lane_offsets(lane, s_m)
        return 0.5 * float(inner + outer)

    def point(self, road_id: str, s_m: float, t_m: float) -> Pose:
        """Pose at road coordinates, heading along s.

        Raises:
            RunError: no such road, or s is off the road.
        """
        self._require_roads()
        try:
            points = self.network.road_point(road_id, s_m, t_m)
        except OpenDriveError as error:
            raise RunError(str(error)) from None
        return Pose(float(points.x_m), float(points.y_m), float(points.heading_rad), float(points.z_m))

    def direction(self, lane: int) -> int:
        """+1 if traffic in the lane runs along s, -1 if against."""
        return int(self.network.lanes.direction[lane])

    def nearest(self, pose: Pose) -> LanePlace | None:
        """The nearest lane beside a pose, on its level; None where there is none at all."""
        if not self.network.roads:
            return None
        hits = self.network.nearest_lane(np.array([[pose.x_m, pose.y_m]]), z_m=self._level_m(pose))
        lane, s, t = int(hits.lane[0]), float(hits.s_m[0]), float(hits.t_m[0])
        if lane < 0:
            return None
        key = self.network.lanes.key[lane]
        turn = math.cos(self.point(key.road_id, s, t).yaw_rad - pose.yaw_rad)
        offset = t - self.lane_middle_m(lane, s)
        return LanePlace(lane, key.road_id, key.lane_id, s, t, offset, 1 if turn >= 0 else -1)

    def place(self, pose: Pose) -> LanePlace | None:
        """The lane below a pose; of several, the one most nearly along its heading. None off the road.

        Of roads above one another the level counts that is nearest to the height of the pose, if it has one.
        """
        hits = self.network.locate(np.array([[pose.x_m, pose.y_m]]), self._level_m(pose))
        best: tuple[tuple[float, float], LanePlace] | None = None
        for lane, s, t in zip(hits.lane.tolist(), hits.s_m.tolist(), hits.t_m.tolist(), strict=True):
            key = self.network.lanes.key[lane]
            turn = math.cos(self.point(key.road_id, s, t).yaw_rad - pose.yaw_rad)
            place = LanePlace(
                lane, key.road_id, key.lane_id, s, t, t - self.lane_middle_m(lane, s), 1 if turn >= 0 else -1
            )
            # the straightest lane; among equals the one whose middle is nearest
            rank = (round(1.0 - abs(turn), 6), abs(place.offset_m))
            if best is None or rank < best[0]:
                best = rank, place
        return None if best is None else best[1]

    def is_off_road(self, pose: Pose) -> bool:
        """Whether a pose is in no lane, or in lanes of type `none` alone, which are beside the road.

        ASAM OpenDRIVE 1.8, lane types: such a lane is there so that whoever leaves the road is still found.
        """
        hits, level_m = self.network.locate(np.array([[pose.x_m, pose.y_m]])), self._level_m(pose)
        lanes = hits.lane.tolist()
        if level_m is not None:  # a bridge above is no road below
            heights_m = self._heights_m(hits.lane, hits.s_m, hits.t_m)
            lanes = [k for k, z_m in zip(lanes, heights_m, strict=True) if abs(z_m - level_m) <= LEVEL_M]
        return all(str(self.network.lanes.lane_type[lane]) == "none" for lane in lanes)

    # Ways

    def way(self, pose: Pose) -> Path:
        """Way of an entity without route: its lane, at its offset, and the straightest lanes after it.

        Off the road, or across it, straight ahead.
        """
        place = self.place(pose)
        if place is None or not self._is_driving(place.lane):
            return straight(pose)
        ahead = self.point(place.road_id, place.s_m, place.t_m).yaw_rad + (
            math.pi if place.along_s < 0 else 0.0
        )
        if math.cos(ahead - pose.yaw_rad) < math.cos(ON_LANE_RAD):
            return straight(pose)
        legs = self.legs_ahead(place.lane, place.s_m, place.along_s)
        return self.path(legs, place.offset_m * place.along_s)

    def lane_way(self, lane: int, s_m: float, along_s: int, roads: frozenset[str] = frozenset()) -> Path:
        """Way along the middle of a lane and the lanes after it; at forks onto given roads if it can be."""
        return self.path(self.legs_ahead(lane, s_m, along_s, roads), 0.0)

    def middle_m(self, road_id: str, s_m: float) -> float:
        """T of the line between the lanes of both directions, which is lane 0.

        Raises:
            RunError: there is no such road, s is off it, or it has no lanes.
        """
        for lane_id in (-1, 1):
            try:
                lane = self.lane(road_id, lane_id, s_m)
            except RunError:
                if lane_id == 1:
                    raise
                continue
            return float(self.network.lane_offsets(lane, s_m)[0])
        raise AssertionError

    def walked(self, lane: int, s_m: float, ds_m: float) -> tuple[int, float, int]:
        """Lane and s after a way along s from a place in a lane; -1 if s runs the other way there, else 1.

        Raises:
            RunError: the roads end before.
        """
        along_s = 1 if ds_m >= 0.0 else -1
        left_m = abs(ds_m)
        for leg in self.legs_ahead(lane, s_m, along_s):
            if left_m <= leg.length_m + 1e-6:
                return leg.lane, leg.s_start_m + leg.along_s * left_m, leg.along_s * along_s
            left_m -= leg.length_m
        raise RunError(f"the road ends {left_m:.6g} m before a place that lies {ds_m:.6g} m along it")

    def _is_driving(self, lane: int) -> bool:
        return str(self.network.lanes.lane_type[lane]) not in ("none", "border", "sidewalk", "shoulder")

    def legs_ahead(
        self, lane: int, s_m: float, along_s: int, roads: frozenset[str] = frozenset()
    ) -> list[Leg]:
        """Legs from a place on, through lanes of given roads, or else the straightest that follow."""
        lanes = self.network.lanes
        legs: list[Leg] = []
        length, seen = 0.0, set[int]()
        while True:
            end = float(lanes.s_end_m[lane] if along_s > 0 else lanes.s_start_m[lane])
            legs.append(Leg(lane, s_m, end))
            seen.add(lane)
            length += abs(end - s_m)
            with_traffic = along_s == self.direction(lane)
            following = self.network.successors(lane) if with_traffic else self.network.predecessors(lane)
            options = [
                (lanes.key[other].road_id not in roads, self._turn(lane, other, along_s, with_traffic), other)
                for other in following
                if other not in seen
            ]
            if not options or length > MAX_WAY_M:
                return legs
            _, _, lane = min(options)
            along_s = self.direction(lane) if with_traffic else -self.direction(lane)
            s_m = float(lanes.s_start_m[lane] if along_s > 0 else lanes.s_end_m[lane])

    def _turn(self, lane: int, other: int, along_s: int, with_traffic: bool) -> float:
        """How much a way turns within the lane that follows."""
        lanes = self.network.lanes
        along = self.direction(other) if with_traffic else -self.direction(other)
        start, end = float(lanes.s_start_m[other]), float(lanes.s_end_m[other])
        x, y, _, heading = self.network.center_line(other, np.array([start, end]))
        del x, y
        turn = float(heading[1] - heading[0]) * along
        return round(abs(math.remainder(turn, 2 * math.pi)), 6)

    def start_of(self, leg: Leg) -> LanePlace:
        """Where a leg begins, in the middle of its lane."""
        key = self.network.lanes.key[leg.lane]
        return LanePlace(leg.lane, key.road_id, key.lane_id, leg.s_start_m, 0.0, 0.0, leg.along_s)

    def route_legs(self, waypoints: list[LanePlace], strategies: Sequence[RouteStrategy] = ()) -> list[Leg]:
        """Legs of a route through waypoints, along lanes; with lane changes where nothing else leads there.

        A change stands where the lane marks begin to allow it; `path` gives it a length.

        Args:
            waypoints: places.
            strategies: how the way to each after the first is chosen; none: the shortest.

        Raises:
            RunError: no way leads from one to the next.
        """
        legs: list[Leg] = []
        chosen: Sequence[RouteStrategy] = strategies or ["shortest"] * (len(waypoints) - 1)
        for (start, end), strategy in zip(pairwise(waypoints), chosen, strict=True):
            legs += legs_between(self.network, (start.lane, start.s_m), (end.lane, end.s_m), strategy)
        return legs

    def taken_from(self, legs: list[Leg], place: LanePlace | None) -> list[Leg]:
        """Legs from a place on, where the route changes lanes beside it; else as they are.

        Who is in the new lane already does not change once more, and who is past the place of a change
        changes from where it is.
        """
        if place is None:
            return legs
        lanes, k = self.network.lanes, 0
        while k < len(legs):
            last = changes_from(self.network, legs, k)
            begin, end = legs[k].s_start_m, legs[last].s_end_m
            if (
                last > k
                and lanes.section[place.lane] == lanes.section[legs[k].lane]
                and min(begin, end) <= place.s_m <= max(begin, end)
            ):
                goal = replace(self.start_of(legs[last]), s_m=end)
                try:
                    taken = [*self.route_legs([place, goal]), *legs[last + 1 :]]
                    settled(self.network, taken, 0.0)
                except RunError:
                    return legs
                return taken
            k = last + 1
        return legs

    def path(self, legs: list[Leg], left_m: float, speed_mps: float = 0.0) -> Path:
        """Path along the middle of legs, moved to the left as seen in the direction of travel.

        Args:
            legs: the way.
            left_m: how far to the left.
            speed_mps: on which the length of lane changes depends.

        Raises:
            RunError: the legs have no length, or there is too little room for a lane change.
        """
        if any(is_change(self.network, *pair) for pair in pairwise(legs)):
            used, pieces = self._changing(*settled(self.network, legs, speed_mps), left_m)
        else:
            used = [leg for leg in legs if leg.length_m > 1e-6]
            pieces = [self._leg_rows(leg, left_m) for leg in used]
        if not used:
            raise RunError("route: it ends where it begins; give places that lie apart along the lanes")
        path, kept = joined(pieces)
        path.on_road = True
        path.track = Track(
            array("d", np.concatenate([piece[:, 3] for piece in pieces])[kept].tobytes()),
            array("q", np.repeat(np.arange(len(pieces)), [len(piece) for piece in pieces])[kept].tobytes()),
            [leg.lane for leg in used],
            [leg.s_start_m for leg in used],
            [leg.along_s for leg in used],
        )
        return path

    def _changing(
        self, legs: list[Leg], changes: list[RouteChange], left_m: float
    ) -> tuple[list[Leg], list[FloatArray]]:
        """Legs with lane changes, cut where these begin and end, and their rows; see `_leg_rows`."""
        used: list[Leg] = []
        pieces: list[FloatArray] = []
        bounds = sorted(c.at_m + side * c.half_m for c in changes for side in (-1.0, 1.0))
        begun = 0.0
        for leg in legs:
            cuts = [b - begun for b in bounds if 1e-6 < b - begun < leg.length_m - 1e-6]
            for low, high in pairwise([0.0, *cuts, leg.length_m]):
                if high - low <= 1e-6:
                    continue
                part = Leg(leg.lane, leg.s_start_m + leg.along_s * low, leg.s_start_m + leg.along_s * high)
                middle = begun + 0.5 * (low + high)
                change = next((c for c in changes if abs(middle - c.at_m) < c.half_m), None)
                if change is None:
                    rows = self._leg_rows(part, left_m)
                else:
                    rows = self._rows(part, left_m, max(3, math.ceil(part.length_m / SPACING_M) + 1))
                    way_m = begun + np.linspace(low, high, len(rows))
                    shift_m, slope = change.shift(way_m, np.full(len(rows), middle > change.at_m))
                    rows[:, 0] -= np.sin(rows[:, 2]) * shift_m
                    rows[:, 1] += np.cos(rows[:, 2]) * shift_m
                    rows[:, 2] += np.arctan(slope)
                used.append(part)
                pieces.append(rows)
            begun += leg.length_m
        return used, pieces

    def middle_line(self, lane: int) -> tuple[Path, list[float]]:
        """The middle line of a lane along s, and s at its points."""
        lanes = self.network.lanes
        rows = self._leg_rows(Leg(lane, float(lanes.s_start_m[lane]), float(lanes.s_end_m[lane])), 0.0)
        return Path(rows[:, 0], rows[:, 1], rows[:, 2]), rows[:, 3].tolist()

    def _leg_rows(self, leg: Leg, left_m: float) -> FloatArray:
        """(K, 4) x, y, yaw, s along a leg: its two ends if it is straight, dense points otherwise."""
        probes = max(3, math.ceil(leg.length_m) + 1)
        rows = self._rows(leg, left_m, probes)
        chord = rows[-1, :2] - rows[0, :2]
        across = (rows[:, 0] - rows[0, 0]) * chord[1] - (rows[:, 1] - rows[0, 1]) * chord[0]
        if np.abs(across).max() <= 1e-9 * float(chord @ chord) and np.ptp(np.unwrap(rows[:, 2])) < 1e-12:
            return rows[[0, -1]]
        yaw = np.unwrap(rows[:, 2])
        sharpest = np.abs(np.diff(yaw)).max() / (leg.length_m / (probes - 1))
        spacing = np.clip(math.sqrt(8.0 * CHORD_ERROR_M / sharpest), SPACING_M, 1.0)
        return self._rows(leg, left_m, max(probes, math.ceil(leg.length_m / spacing) + 1))

    def _rows(self, leg: Leg, left_m: float, count: int) -> FloatArray:
        s = np.linspace(leg.s_start_m, leg.s_end_m, count)
        x, y, _, heading = self.network.center_line(leg.lane, s)
        if leg.along_s != self.direction(leg.lane):
            heading = heading + np.pi
        return np.column_stack(
            (x - np.sin(heading) * left_m, y + np.cos(heading) * left_m, np.unwrap(heading), s)
        )


def load_roads(path: FilePath | None) -> Roads:
    """The network of an OpenDRIVE file; an unchanged file is loaded once. None: a plane without roads.

    Raises:
        RunError: the file cannot be read.
    """
    if path is None:
        return _plane()
    try:
        stat = path.stat()
        return _load(path.resolve(), stat.st_mtime_ns, stat.st_size)
    except OSError as error:
        raise RunError(f"{path}: {error.strerror}") from None
    except OpenDriveError as error:
        raise RunError(str(error)) from None


@lru_cache(maxsize=16)
def _load(path: FilePath, _mtime_ns: int, _size: int) -> Roads:
    return Roads(load_map(path))


@lru_cache(maxsize=1)
def _plane() -> Roads:
    """Flat ground without roads."""
    header = Header(
        *(1, 8, "plane", "", "", ""),
        north_m=None,
        south_m=None,
        east_m=None,
        west_m=None,
        geo_reference="",
        offset=None,
    )
    return Roads(RoadNetwork(MapModel(header, {}, {}, Deferred.of(()))))
