"""Distances along the roads of a network."""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from scenarios.openscenario.motion.lane_place import LanePlace
from scenarios.openscenario.motion.paths import ON_PATH_M, Path, Pose
from scenarios.openscenario.motion.roads import Roads

NO_DISTANCE_M = math.nan
"""Between places that no lanes join: no rule but `notEqualTo` holds for it."""

AGAINST = math.cos(0.75 * math.pi)
"""Who heads further away from its way than 135 degrees looks back along it; who is across it, ahead."""


class _Stretch(NamedTuple):
    """A road on the way ahead: where it is entered, which way, and how far ahead of the lane's end."""

    road_id: str
    enter_m: float
    along_s: int
    before_m: float
    length_m: float
    lane: int


class _Middle(NamedTuple):
    """The middle line of a lane along s, and s at its points."""

    path: Path
    s_m: list[float]

    def station_m(self, s_m: float) -> float:
        """About where on it the road is at s."""
        k = min(max(bisect_right(self.s_m, s_m) - 1, 0), len(self.s_m) - 2)
        part = (s_m - self.s_m[k]) / (self.s_m[k + 1] - self.s_m[k])
        return self.path.length_m * (k + part) / (len(self.s_m) - 1)


class RoadDistances:
    """Distances of places along the reference lines of roads, ahead or back along lanes.

    Args:
        roads: the network.
    """

    def __init__(self, roads: Roads) -> None:
        self._roads = roads
        self._chains: dict[tuple[int, int], list[_Stretch]] = {}
        self._middles: dict[int, _Middle] = {}

    def place(self, pose: Pose) -> LanePlace | None:
        """The lane below a pose; beside the road that of the nearest lane. None without roads."""
        return self._roads.place(pose) or self._roads.nearest(pose)

    def apart(self, a: Pose, b: Pose) -> tuple[float, float]:
        """How far b is ahead of a along the road, and to the left of it, as a sees it; NaN without a way."""
        place, other = self.place(a), self.place(b)
        hit = None if place is None or other is None else self.relate(place, other)
        return (NO_DISTANCE_M, NO_DISTANCE_M) if hit is None else hit[:2]

    def ahead_m(self, a: LanePlace | None, b: LanePlace | None) -> float:
        """How far one place is ahead of another; NaN without a way."""
        hit = None if a is None or b is None else self.relate(a, b)
        return NO_DISTANCE_M if hit is None else hit[0]

    def place_on(self, path: Path, station_m: float, pose: Pose) -> LanePlace | None:
        """The lane below an entity on a path, without a look at the map where that is known; t is not."""
        known = path.lane_at(station_m)
        if known is not None:
            x, y, yaw = path.pose(station_m)
            if abs(x - pose.x_m) + abs(y - pose.y_m) < ON_PATH_M:
                lane, s, along = known
                facing = -1 if math.cos(yaw - pose.yaw_rad) < AGAINST else 1
                key = self._roads.network.lanes.key[lane]
                return LanePlace(lane, key.road_id, key.lane_id, s, math.nan, math.nan, along * facing)
        return self.place(pose)

    def with_t(self, place: LanePlace, pose: Pose) -> LanePlace:
        """A place with its t."""
        if not math.isnan(place.t_m):
            return place
        middle = self._roads.lane_middle_m(place.lane, place.s_m)
        at = self._roads.point(place.road_id, place.s_m, middle)
        c, s = math.cos(at.yaw_rad), math.sin(at.yaw_rad)
        left = c * (pose.y_m - at.y_m) - s * (pose.x_m - at.x_m)
        return replace(place, t_m=middle + left, offset_m=left)

    def direction(self, place: LanePlace) -> float:
        """Heading along the road at a place, rad, the way that it faces."""
        yaw = self._roads.point(place.road_id, place.s_m, 0.0).yaw_rad
        return yaw if place.along_s > 0 else yaw + math.pi

    def direction_at(self, path: Path, station_m: float, pose: Pose, lane: bool) -> float:
        """Heading of the s axis of the road (of the middle of the lane) below an entity, rad; NaN without."""
        place = self.place_on(path, station_m, pose)
        if place is None:
            return math.nan
        if not lane:
            return self._roads.point(place.road_id, place.s_m, 0.0).yaw_rad
        _, _, yaw = self._foot(place.lane, place.s_m, 1, pose)
        return yaw

    def along_lane(
        self, place: LanePlace, pose: Pose, other: LanePlace, other_pose: Pose
    ) -> tuple[float, float, float, float] | None:
        """How far another is ahead along the middle of a lane, and to the left of it; directions at both.

        Where no lanes that follow lead there, its road goes on for the lane.
        """
        for way in (1, -1):
            travelled = 0.0
            chain = self._chain(place.lane, way * place.along_s)
            begin, own_left, axis = self._foot(place.lane, place.s_m, chain[0].along_s, pose)
            for stretch in chain:
                gone = (other.s_m - stretch.enter_m) * stretch.along_s
                if stretch.road_id == other.road_id and -1e-6 <= gone <= stretch.length_m + 1e-6:
                    end, left, other_axis = self._foot(stretch.lane, other.s_m, stretch.along_s, other_pose)
                    turned = 0.0 if way > 0 else math.pi
                    ahead = way * (travelled + end - begin)
                    return ahead, way * (left - own_left), axis + turned, other_axis + turned
                travelled += self._middle(stretch.lane).path.length_m
        hit = self.relate(self.with_t(place, pose), self.with_t(other, other_pose))
        return None if hit is None else (hit[0], hit[1], self.direction(place), self.direction(other))

    def _foot(self, lane: int, s_m: float, along_s: int, pose: Pose) -> tuple[float, float, float]:
        """Arc length of a lane's middle line up to beside a pose, offset to its left, and its direction."""
        middle = self._middle(lane)
        station, left = middle.path.project_from(pose.x_m, pose.y_m, middle.station_m(s_m))
        yaw = middle.path.pose(station)[2]
        return (station, left, yaw) if along_s > 0 else (middle.path.length_m - station, -left, yaw + math.pi)

    def _middle(self, lane: int) -> _Middle:
        """The middle line of a lane."""
        if lane not in self._middles:
            self._middles[lane] = _Middle(*self._roads.middle_line(lane))
        return self._middles[lane]

    def relate(self, place: LanePlace, other: LanePlace) -> tuple[float, float, int] | None:
        """How far another place is ahead and to the left; -1 if s runs the other way there, else 1."""
        side = place.along_s
        if place.road_id == other.road_id:
            return (other.s_m - place.s_m) * side, (other.t_m - place.t_m) * side, 1
        for way in (1, -1):
            hit = self._ahead(place, other, way * side)
            if hit is not None:
                ahead_m, turned = hit
                return way * ahead_m, (other.t_m * turned - place.t_m) * side, turned
        return None

    def beside(self, place: LanePlace, other: LanePlace) -> LanePlace:
        """Another place as the lanes next to a place have it: on the lane of these that leads to it.

        On another road lanes may have other ids, and s may run the other way. Where no lane leads there (or
        comes from there), the other place as it is.
        """
        lanes = self._roads.network.lanes
        if lanes.section[other.lane] == lanes.section[place.lane]:
            return other
        for along_s in (place.along_s, -place.along_s):
            for lane in np.flatnonzero(lanes.section == lanes.section[place.lane]).tolist():
                for stretch in self._chain(lane, along_s)[1:]:
                    if stretch.lane == other.lane:
                        turned = stretch.along_s * along_s
                        key = lanes.key[lane]
                        return LanePlace(
                            *(lane, key.road_id, key.lane_id, place.s_m),
                            *(other.t_m * turned, other.offset_m * turned, other.along_s * turned),
                        )
        return other

    def _ahead(self, place: LanePlace, other: LanePlace, along_s: int) -> tuple[float, int] | None:
        chain = self._chain(place.lane, along_s)
        first = chain[0]
        left_m = first.length_m - (place.s_m - first.enter_m) * along_s
        for stretch in chain[1:]:
            gone = (other.s_m - stretch.enter_m) * stretch.along_s
            if stretch.road_id == other.road_id and -1e-6 <= gone <= stretch.length_m + 1e-6:
                return left_m + stretch.before_m + gone, stretch.along_s * along_s
        return None

    def _chain(self, lane: int, along_s: int) -> list[_Stretch]:
        """Roads on the way from a lane on; the first is that of the lane itself."""
        if (lane, along_s) not in self._chains:
            lanes = self._roads.network.lanes
            start = float(lanes.s_start_m[lane] if along_s > 0 else lanes.s_end_m[lane])
            chain: list[_Stretch] = []
            before = 0.0
            for leg in self._roads.legs_ahead(lane, start, along_s):
                if chain:
                    before += chain[-1].length_m if len(chain) > 1 else 0.0
                chain.append(
                    _Stretch(
                        lanes.key[leg.lane].road_id,
                        leg.s_start_m,
                        leg.along_s,
                        before,
                        leg.length_m,
                        leg.lane,
                    )
                )
            self._chains[lane, along_s] = chain
        return self._chains[lane, along_s]
