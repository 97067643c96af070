"""Poses of positions, given where the entities are."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from opendrive.errors import OpenDriveError
from scenarios.openscenario.elements import referred
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.model import (
    GeoPosition,
    LanePosition,
    Orientation,
    Position,
    RelativeLanePosition,
    RelativeObjectPosition,
    RelativeRoadPosition,
    RelativeWorldPosition,
    RoadPosition,
    Route,
    RoutePosition,
    RouteStrategy,
    Trajectory,
    TrajectoryPosition,
    WorldPosition,
)
from scenarios.openscenario.motion.lane_place import LanePlace
from scenarios.openscenario.motion.paths import Path, Pose
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.motion.route_changes import Leg
from scenarios.openscenario.motion.trajectories import build, starts_at_entity

CLOSED_WAY_M = 10_000.0
"""A closed route is driven round for so long a way."""

ROUTE_REACH_M = 10.0
"""Who is further beside a route is not on it."""

SHORTEST_ROUND_M = 0.1
"""A closed route that is shorter has its waypoints at one place."""


class Locator:
    """Turns positions into poses, routes into legs and trajectories into paths.

    What is relative to an entity is worked out anew every time; of the rest routes and trajectories are kept.

    Args:
        roads: the network.
        pose_of: pose of an entity by name, now.
        kept: routes and trajectories worked out before.
    """

    def __init__(
        self, roads: Roads, pose_of: Callable[[str], Pose], kept: dict[Route | Trajectory, Any] | None = None
    ) -> None:
        self.roads, self._pose_of = roads, pose_of
        self._kept: dict[Route | Trajectory, Any] = {} if kept is None else kept

    def at(self, pose_of: Callable[[str], Pose]) -> Locator:
        """The same at another time: with other poses of the entities."""
        return Locator(self.roads, pose_of, self._kept)

    def pose(self, position: Position) -> Pose:
        """Pose of a position.

        Raises:
            RunError: it is off the road.
        """
        match position:
            case WorldPosition():
                return Pose(position.x_m, position.y_m, position.heading_rad, position.z_m)
            case GeoPosition():
                return oriented(self._geographic(position), position.orientation)
            case LanePosition():
                return self._in_lane(
                    position.road_id, position.lane_id, position.s_m, position.offset_m, position.orientation
                )
            case RoadPosition():
                frame = self.roads.point(position.road_id, position.s_m, position.t_m)
            case RelativeLanePosition():
                return self._relative_lane(position)
            case RelativeRoadPosition():
                place = self._place(position.entity)
                lane, s_m, turned = self.roads.walked(place.lane, place.s_m, position.ds_m)
                road_id = self.roads.network.lanes.key[lane].road_id
                frame = self.roads.point(road_id, s_m, (place.t_m + position.dt_m) * turned)
                if turned < 0:
                    frame = frame.moved(0.0, 0.0, math.pi)
            case RelativeObjectPosition():
                frame = self._pose_of(position.entity).moved(position.dx_m, position.dy_m)
                frame = frame.raised(position.dz_m)
            case RelativeWorldPosition():
                pose = self._pose_of(position.entity).raised(position.dz_m)
                frame = Pose(pose.x_m + position.dx_m, pose.y_m + position.dy_m, pose.yaw_rad, pose.z_m)
            case RoutePosition():
                frame = self._on_route(position)
            case TrajectoryPosition():
                path = self.trajectory(position.trajectory, None)
                frame = Pose(*path.pose(position.s_m)).moved(0.0, position.t_m)
        return oriented(frame, position.orientation)

    def _geographic(self, position: GeoPosition) -> Pose:
        """The point on the map, heading with the traffic of the lane there; beside all lanes along x."""
        try:
            x_m, y_m = self.roads.network.from_geographic(position.latitude_deg, position.longitude_deg)[
                0
            ].tolist()
        except OpenDriveError as error:
            raise RunError(f"a position by latitude and longitude: {error}") from None
        point = Pose(x_m, y_m, 0.0, position.z_m)
        place = self.roads.place(point)
        if place is None:
            return point
        turned = 0.0 if self.roads.direction(place.lane) > 0 else math.pi
        return replace(point, yaw_rad=self.roads.point(place.road_id, place.s_m, place.t_m).yaw_rad + turned)

    def _in_lane(
        self,
        road_id: str,
        lane_id: int,
        s_m: float,
        offset_m: float,
        orientation: Orientation,
        against: bool = False,
    ) -> Pose:
        """The heading without orientation is that of the traffic in the lane, or against it."""
        if lane_id == 0:  # the line between the lanes of both directions
            return oriented(
                self.roads.point(road_id, s_m, self.roads.middle_m(road_id, s_m) + offset_m), orientation
            )
        lane = self.roads.lane(road_id, lane_id, s_m)
        frame = self.roads.point(road_id, s_m, self.roads.lane_middle_m(lane, s_m) + offset_m)
        if (self.roads.direction(lane) < 0) != against:
            frame = frame.moved(0.0, 0.0, math.pi)
        return oriented(frame, orientation)

    def _place(self, entity: str) -> LanePlace:
        place = self.roads.place(self._pose_of(entity))
        if place is None:
            raise RunError(f"'{entity}' is not on a road, which a position relative to it needs")
        return place

    def _relative_lane(self, position: RelativeLanePosition) -> Pose:
        """DLane counts lanes to the left of the entity, ds the way ahead of it.

        Of an entity that drives against the traffic of its lane the heading is against it, too.
        """
        place = self._place(position.entity)
        against = self.roads.direction(place.lane) != place.along_s
        lane_id = place.beside(position.d_lane)
        s = place.s_m + (0.0 if position.along_lane else position.ds_m * place.along_s)
        length_m = self.roads.network.roads[place.road_id].length_m
        if not position.along_lane and not 0.0 <= s <= length_m and lane_id != 0:
            lane = self.roads.lane(place.road_id, lane_id, place.s_m)
            lane, s, turned = self.roads.walked(lane, place.s_m, position.ds_m * place.along_s)
            key = self.roads.network.lanes.key[lane]
            return self._in_lane(
                key.road_id, key.lane_id, s, position.offset_m * turned, position.orientation, against
            )
        if position.along_lane:
            lane = self.roads.lane(place.road_id, lane_id, place.s_m)
            end = self.roads.network.roads[place.road_id].length_m if place.along_s > 0 else 0.0
            path = self.roads.path([Leg(lane, place.s_m, end)], 0.0)
            x, y, _ = path.pose(position.ds_m)
            s = float(self.roads.network.road_coordinates(place.road_id, np.array([[x, y]]))[0][0])
        return self._in_lane(place.road_id, lane_id, s, position.offset_m, position.orientation, against)

    def _on_route(self, position: RoutePosition) -> Pose:
        if position.entity is not None:
            return self._beside_route(position.route, position.entity)
        leg, s = self._leg_at(self.legs(position.route), position.path_s_m, position.route.name)
        key = self.roads.network.lanes.key[leg.lane]
        t = position.offset_m * leg.along_s
        if position.lane_id is not None:
            lane_id = position.lane_id * leg.along_s
            if leg.along_s < 0 and self._is_that_of_the_road(key.road_id, position.lane_id, s):
                lane_id, t = position.lane_id, position.offset_m
            t += self.roads.lane_middle_m(self.roads.lane(key.road_id, lane_id, s), s)
        frame = self.roads.point(key.road_id, s, t)
        return frame if leg.along_s > 0 else frame.moved(0.0, 0.0, math.pi)

    def _beside_route(self, route: Route, entity: str) -> Pose:
        """Where an entity is, heading along a route.

        Raises:
            RunError: it is not on the route.
        """
        pose, way = self._pose_of(entity), self.roads.path(self.legs(route), 0.0)
        station_m, left_m = way.project(pose.x_m, pose.y_m)
        if not -1e-3 <= station_m <= way.length_m + 1e-3 or abs(left_m) > ROUTE_REACH_M:
            raise RunError(f"'{entity}' is not on route '{route.name}', to which a position of it refers")
        return replace(pose, yaw_rad=way.pose(station_m)[2])

    def _is_that_of_the_road(self, road_id: str, lane_id: int, s_m: float) -> bool:
        """Whether the lane of a place on a route against s is meant as the road has it.

        As esmini does by default. Of both readings that is meant whose lane is driven along the route.
        """
        try:
            return self.roads.direction(self.roads.lane(road_id, lane_id, s_m)) < 0
        except RunError:
            return False

    def _leg_at(self, legs: list[Leg], path_s_m: float, name: str) -> tuple[Leg, float]:
        left = path_s_m
        for leg in legs:
            if left <= leg.length_m + 1e-6:
                return leg, leg.s_start_m + leg.along_s * min(left, leg.length_m)
            left -= leg.length_m
        raise RunError(f"pathS = {path_s_m:.6g} m lies {left:.6g} m beyond the end of route '{name}'")

    def legs(self, route: Route) -> list[Leg]:
        """Legs of a route.

        Raises:
            RunError: a waypoint is in no lane, or no way leads there.
        """
        known_legs: list[Leg] | None = self._kept.get(route)
        if known_legs is not None:
            return known_legs
        places: list[LanePlace] = []
        for waypoint in route.waypoints:
            place = self.lane_place(waypoint)
            if place is None:
                raise RunError(f"route '{route.name}' has a waypoint that is in no lane")
            places.append(place)
        shortest: RouteStrategy = "shortest"
        strategies = route.strategies or (shortest,) * len(places)
        if route.closed:
            places, strategies = [*places, places[0]], (*strategies, strategies[0])
        legs = self.roads.route_legs(places, strategies[1:])
        if route.closed:
            if sum(leg.length_m for leg in legs) < SHORTEST_ROUND_M:
                raise RunError(f"route '{route.name}': it is closed, and its waypoints are at one place")
            legs = legs * max(2, math.ceil(CLOSED_WAY_M / sum(leg.length_m for leg in legs)))
        if not referred(route):
            self._kept[route] = legs
        return legs

    def lane_place(self, position: Position) -> LanePlace | None:
        """The lane of a position; None if it is in none."""
        if isinstance(position, LanePosition):
            lane = self.roads.lane(position.road_id, position.lane_id, position.s_m)
            return LanePlace(lane, position.road_id, position.lane_id, position.s_m, 0.0, 0.0, 1)
        return self.roads.place(self.pose(position))

    def trajectory(self, trajectory: Trajectory, entity: str | None) -> Path:
        """Path of a trajectory; one without start begins at the entity.

        Raises:
            RunError: it has no start and there is no entity to begin at.
        """
        known_path: Path | None = self._kept.get(trajectory)
        if known_path is not None:
            return known_path
        entity_pose = self._pose_of(entity) if entity is not None and starts_at_entity(trajectory) else None
        path = build(trajectory, self.pose, entity_pose)
        if not starts_at_entity(trajectory) and not referred(trajectory):
            self._kept[trajectory] = path
        return path


def oriented(frame: Pose, orientation: Orientation) -> Pose:
    """Pose with an orientation relative to its frame, or absolute."""
    if orientation.relative:
        return frame.moved(0.0, 0.0, orientation.heading_rad)
    return Pose(frame.x_m, frame.y_m, orientation.heading_rad, frame.z_m)
