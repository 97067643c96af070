"""Actions that put entities on ways: trajectories, routes, teleports."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import accumulate, pairwise
from typing import TypeVar

import numpy as np

from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.paths import Path, Pose
from scenarios.openscenario.motion.positions import ROUTE_REACH_M
from scenarios.openscenario.motion.profiles import Piece, SpeedProfile
from scenarios.openscenario.motion.roads import Roads
from scenarios.openscenario.motion.route_changes import LATERAL_MPS2, Leg
from scenarios.openscenario.motion.trajectories import laps, returns, schedule
from scenarios.openscenario.running.actions import LATERAL, LONGITUDINAL, RunningAction
from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.world import Instant, World
from smartmot.types import FloatArray

ON_TRAJECTORY_M = 0.01
"""An entity that is to steer to a trajectory is on it if it is this near."""

TICK_S = 0.05
"""A curve with times is followed at a constant speed for so long: at 10 m/s2 3 mm beside its time."""

GENTLY = 3.0
"""Steering takes at least this many times the offset: the heading stays within 27 degrees of the line."""


class FollowTrajectory(RunningAction[model.FollowTrajectoryAction]):
    """FollowTrajectoryAction. Who is commanded by a controller follows the way and not the times."""

    domains = frozenset({LATERAL})

    def __init__(self, world: World, actor: Actor, action: model.FollowTrajectoryAction) -> None:
        super().__init__(world, actor, action)
        self._closed = action.trajectory.closed
        if action.timing is not None:
            self.domains = frozenset({LATERAL, LONGITUDINAL})

    def start(self, time_s: float) -> None:
        """Be at the start of the trajectory (or as far along as the file says)."""
        action = self.action
        trajectory = self._path = self.world.locator.trajectory(action.curve, self.who.name)
        station = action.initial_distance_m
        if station > self._path.length_m:
            raise RunError(
                f"trajectory '{action.trajectory.name}': initialDistanceOffset {station:.6g} m is more than "
                f"its length of {self._path.length_m:.6g} m"
            )
        own_station: float | None = None
        joined: tuple[float, float, float] | None = None
        pose = self.who.pose(time_s)
        if action.steers and self.who.placed and not self._is_at(station, pose):
            joined = self._steer(time_s, pose)
            own_station = station = joined[0]
        if action.timing is None:
            self._join(joined)
            self.who.follow(time_s, self._path, station, trajectory=True)
            return
        table = self._timetable(trajectory)
        if self._closed:
            self._path, count = laps(trajectory)
            round_s, round_m = table[-1][0] - table[0][0], trajectory.length_m
            table = [(t + k * round_s, s + k * round_m) for k in range(count) for t, s in table[k > 0 :]]
        self._join(joined)
        profile = timed_profile(action, table, time_s, own_station)
        if own_station is None:
            station = profile.at(time_s)[0] + (station if action.timing.relative else 0.0)
        self.who.follow(time_s, self._path, station, trajectory=True)
        self.drive(time_s, profile)

    def _timetable(self, path: Path) -> list[tuple[float, float]]:
        """Times of one round, and where on the path the entity is at them."""
        curve = self.action.trajectory
        self._closed = curve.closed and returns(path)
        if curve.closed and not self._closed:
            self.world.note(
                f"trajectory '{curve.name}' is closed, and has no time for the way from its end to its "
                f"start: '{self.who.name}' follows it once"
            )
        if isinstance(curve.shape, model.Nurbs):
            try:
                return self._sampled(schedule(curve.shape, self.world.locator.pose))
            except RunError as error:
                raise RunError(f"trajectory '{curve.name}': {error}") from None
        return timetable(curve, path)

    def _sampled(self, table: FloatArray) -> list[tuple[float, float]]:
        """A schedule at times that are TICK_S apart."""
        begin_s, end_s = table[0, 0], table[-1, 0]
        times = np.linspace(begin_s, end_s, max(2, math.ceil((end_s - begin_s) / TICK_S) + 1))
        stations = np.interp(times, table[:, 0], table[:, 1])
        return list(zip(times.tolist(), stations.tolist(), strict=True))

    def _is_at(self, station_m: float, pose: Pose) -> bool:
        x, y, _ = self._path.pose(station_m)
        return math.hypot(x - pose.x_m, y - pose.y_m) <= ON_TRAJECTORY_M

    def _steer(self, time_s: float, pose: Pose) -> tuple[float, float, float]:
        """Where the trajectory is joined from a place beside it: station, offset, and within which way."""
        name = self.action.trajectory.name
        if self._path.reverse is not None:
            raise RunError(
                f"'{self.who.name}' is beside trajectory '{name}', whose headings point backwards, and "
                "cannot steer to it in reverse; use followingMode='position'"
            )
        station, left = self._path.project(pose.x_m, pose.y_m)
        speed = abs(self.who.state(time_s).speed_mps)
        within = speed * math.sqrt(6.0 * abs(left) / LATERAL_MPS2)  # 6 is the greatest curvature of the shape
        within = max(within, GENTLY * abs(left))
        if station + within > self._path.length_m:
            raise RunError(
                f"'{self.who.name}' is {abs(left):.3g} m beside trajectory '{name}' and cannot steer to it "
                f"in the {max(self._path.length_m - station, 0.0):.3g} m that are left; use "
                "followingMode='position'"
            )
        return station, left, within

    def _join(self, joined: tuple[float, float, float] | None) -> None:
        """Let the way begin beside the trajectory."""
        if joined is not None and abs(joined[1]) > ON_TRAJECTORY_M:
            self._path = self._path.joined_from(*joined)

    def ended(self, instant: Instant) -> bool:
        """At its end; a closed one has none."""
        if self._closed:
            return False
        return instant.state(self.who.name).station_m >= self._path.length_m

    def finish(self, time_s: float) -> None:
        """Go on along the route or the lane."""
        self._go_on(time_s)
        self.over = True

    def leave(self, time_s: float) -> None:
        """Go on along the route or the lane, with the present speed."""
        self._go_on(time_s)
        super().leave(time_s)

    def _go_on(self, time_s: float) -> None:
        speed_mps = self.who.state(time_s).speed_mps
        go_on(self.who, self.world, time_s)
        if speed_mps < 0.0 < self.who.asked_mps(time_s):  # its headings point backwards: on in reverse
            self.drive(time_s, SpeedProfile(time_s, speed_mps))


SAME_WAY = math.cos(math.pi / 4)
"""Who heads further away from its route than 45 degrees does not go on along it."""


def go_on(actor: Actor, world: World, time_s: float) -> None:
    """Leave a trajectory: on along the route of the entity or its lane, at its offset; else straight."""
    pose, roads = actor.pose(time_s), world.locator.roads
    speed_mps = actor.state(time_s).speed_mps
    path = route_way(roads, actor.route, pose, speed_mps) if actor.route is not None else None
    if path is None or math.cos(path.pose(path.project(pose.x_m, pose.y_m)[0])[2] - pose.yaw_rad) < SAME_WAY:
        path = roads.way(pose)
    actor.follow(time_s, path, path.project(pose.x_m, pose.y_m)[0], trajectory=False)


def route_way(roads: Roads, legs: list[Leg], pose: Pose, speed_mps: float) -> Path | None:
    """The way along a route at the offset of a pose; None if the pose is too far from it.

    Raises:
        RunError: see `Roads.path`.
    """
    legs = roads.taken_from(legs, roads.place(pose))
    middle = roads.path(legs, 0.0, speed_mps)
    station, left = middle.project(pose.x_m, pose.y_m)
    if not -1e-3 <= station <= middle.length_m or abs(left) > ROUTE_REACH_M:
        return None
    return middle if abs(left) < 1e-9 else roads.path(legs, left, speed_mps)


def timetable(trajectory: model.Trajectory, path: Path) -> list[tuple[float, float]]:
    """Times of a polyline or spline, and where on its path they are.

    Raises:
        RunError: a time is missing, or they do not grow.
    """
    shape = trajectory.shape
    times: list[float | None] = []
    stations: list[float] = []
    if isinstance(shape, model.Polyline):
        times = [vertex.time_s for vertex in shape.vertices]
        stations = path.station_of_vertices()
    elif isinstance(shape, model.ClothoidSpline):
        starts = [segment.time_start_s for segment in shape.segments]
        lengths = [segment.length_m for segment in shape.segments]
        if all(start is None for start in starts[1:]):
            times, stations = [starts[0] or 0.0, shape.time_end_s], [0.0, path.length_m]
        else:
            times = [starts[0] or 0.0, *starts[1:], shape.time_end_s]
            stations = [0.0, *accumulate(lengths)]
    given = [t for t in times if t is not None]
    if not times or len(given) < len(times) or any(b <= a for a, b in pairwise(given)):
        raise RunError(f"trajectory '{trajectory.name}': following it by time needs growing times throughout")
    return list(zip(given, stations, strict=True))


def begun(table: list[tuple[float, float]], distance_m: float) -> list[tuple[float, float]]:
    """Times of a way that begins further along it; at the time at which the whole one would have begun."""
    times, stations = zip(*table, strict=True)
    passed_s = float(np.interp(distance_m, stations, times)) - times[0]
    ahead = [(t - passed_s, s) for t, s in table if s > distance_m]
    return [(times[0], distance_m), *ahead]


def timed_profile(
    action: model.FollowTrajectoryAction,
    table: list[tuple[float, float]],
    time_s: float,
    here_m: float | None = None,
) -> SpeedProfile:
    """Speed profile that meets the times of a trajectory.

    Args:
        action: what is followed.
        table: times as the file has them, and places on the trajectory.
        time_s: now.
        here_m: where on it the entity is now; None: where it should be.
    """
    timing = action.timing
    assert timing is not None
    base = time_s if timing.relative else 0.0
    if timing.relative and action.initial_distance_m > 0.0:
        table = begun(table, action.initial_distance_m)
    points = [(base + timing.offset_s + timing.scale * t, s) for t, s in table]
    first_s = points[0][0]
    if here_m is not None:
        ahead = [(t, s) for t, s in points if t > time_s and s > here_m]
        points = [(time_s, here_m), *ahead]
    pieces = [
        Piece(t1 - t0, (s1 - s0) / (t1 - t0), (s1 - s0) / (t1 - t0))
        for (t0, s0), (t1, s1) in pairwise(points)
    ]
    if here_m is not None:
        return SpeedProfile(time_s, 0.0, pieces)
    wait = max(first_s - time_s, 0.0)
    return SpeedProfile(min(first_s, time_s), 0.0, [Piece(wait, 0.0, 0.0), *pieces])


RoutingT_co = TypeVar(
    "RoutingT_co", bound="model.AssignRouteAction | model.AcquirePositionAction", covariant=True
)


class Routing(RunningAction[RoutingT_co]):
    """What gives an entity a route, which is taken at once, or once a change of its offset is over."""

    domains = frozenset({LATERAL})
    waits = False

    def _take(self, time_s: float, legs: list[Leg], name: str) -> None:
        if self.waits:
            self.who.route = legs
        else:
            take_route(self.who, self.world, time_s, legs, name)


class AssignRoute(Routing[model.AssignRouteAction]):
    """AssignRouteAction: from its lane on along the route, at its offset."""

    def start(self, time_s: float) -> None:
        """Put the entity on the route."""
        legs = self.world.locator.legs(self.action.route)
        self._take(time_s, legs, f"route '{self.action.route.name}'")


class AcquirePosition(Routing[model.AcquirePositionAction]):
    """AcquirePositionAction: the shortest way along lanes to a place, from where the entity is."""

    def start(self, time_s: float) -> None:
        """Put the entity on the way there."""
        roads = self.world.locator.roads
        goal = self.world.locator.lane_place(self.action.position)
        place = roads.place(self.who.pose(time_s))
        if place is None or goal is None:
            raise RunError(f"'{self.who.name}' is to acquire a position, and one of the two is in no lane")
        self._take(time_s, roads.route_legs([place, goal]), "the way to a position")


def take_route(actor: Actor, world: World, time_s: float, legs: list[Leg], name: str) -> None:
    """Go on along a route; to one that begins elsewhere, along the lanes that lead to its beginning.

    Who stands where no lane leads there (parked across a road) takes it after a trajectory.

    Raises:
        RunError: no way leads there, and the entity moves.
    """
    roads, pose = world.locator.roads, actor.pose(time_s)
    speed_mps = actor.state(time_s).speed_mps
    path = route_way(roads, legs, pose, speed_mps)
    if path is None:
        try:
            legs, path = _led_to(roads, legs, pose, speed_mps)
        except RunError as error:
            if speed_mps != 0.0:
                raise RunError(f"'{actor.name}' is not on {name}, which it is assigned: {error}") from None
            actor.route = legs
            world.note(
                f"'{actor.name}' stands where no lane leads to {name}, which it is assigned: it takes it "
                "once a trajectory has brought it there"
            )
            return
    station = path.project(pose.x_m, pose.y_m)[0]
    if speed_mps != 0.0 and math.cos(path.pose(station)[2] - pose.yaw_rad) < 0.0:
        raise RunError(f"'{actor.name}' heads against {name}, which it is assigned, at {time_s:.3f} s")
    actor.route = legs
    actor.follow(time_s, path, station, trajectory=False)


def _led_to(roads: Roads, legs: list[Leg], pose: Pose, speed_mps: float) -> tuple[list[Leg], Path]:
    """A route with the lanes that lead to its beginning from a pose, and the way along it."""
    place = roads.place(pose)
    if place is None:
        raise RunError("it is in no lane")
    legs = [*roads.route_legs([place, roads.start_of(legs[0])]), *legs]
    path = route_way(roads, legs, pose, speed_mps)
    if path is None:
        raise RunError("it is too far beside it")
    return legs, path


TRAJECTORY_REACH_M = 1.0
"""An entity that follows a trajectory can be teleported this far beside it."""


def put(actor: Actor, world: World, time_s: float, pose: Pose) -> None:
    """Put an entity at a pose, on its way from there; of roads above one another on that of its height."""
    roads = world.locator.roads
    if actor.levels is not None and pose.z_m is None:
        levels_m = roads.levels_m(pose.x_m, pose.y_m)
        if len(levels_m) > 1:
            heights = ", ".join(f"{height_m:.1f}" for height_m in levels_m)
            world.note(
                f"'{actor.name}' is put at x = {pose.x_m:.6g} m, y = {pose.y_m:.6g} m, where roads lie above "
                f"one another (z = {heights} m); the lowest is taken, as its position has no z",
                (actor.name, "level"),
            )
            pose = replace(pose, z_m=levels_m[0])
    path = roads.way(pose)
    actor.teleport(time_s, path, path.project(pose.x_m, pose.y_m)[0], pose.yaw_rad, pose.z_m)


class Teleport(RunningAction[model.TeleportAction]):
    """TeleportAction. An entity that follows a trajectory goes on from the nearest point of it.

    What else moves an entity sideways is stopped, as its way begins elsewhere.
    """

    def __init__(self, world: World, actor: Actor, action: model.TeleportAction) -> None:
        super().__init__(world, actor, action)
        if not actor.on_trajectory:
            self.domains = frozenset({LATERAL})

    def start(self, time_s: float) -> None:
        """Be there."""
        pose = self.world.locator.pose(self.action.position)
        if self.who.on_trajectory:
            station, left = self.who.path.project(pose.x_m, pose.y_m)
            if abs(left) > TRAJECTORY_REACH_M:
                raise RunError(f"'{self.who.name}' is teleported off the trajectory that it follows")
            self.who.follow(time_s, self.who.path, station, trajectory=True)
            return
        self.who.route = None
        put(self.who, self.world, time_s, pose)


class AddEntity(RunningAction[model.AddEntityAction]):
    """AddEntityAction: it stands there until it is moved, and has the speed that it had if it was deleted.

    One that exists already stays where it is.
    """

    def start(self, time_s: float) -> None:
        """Be there."""
        who = self.world.actors[self.action.entity]
        if who.exists and who.placed:
            return
        pose = self.world.locator.pose(self.action.position)
        for actor in who.towed():
            actor.exists = True
        who.route, who.on_trajectory = None, False
        put(who, self.world, time_s, pose)
        who.drive(time_s, SpeedProfile(time_s, who.left_mps))
