"""Actions of a run: what starts them, and until when they go on."""

from __future__ import annotations

import math
from itertools import pairwise

from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.paths import Path, Pose
from scenarios.openscenario.motion.positions import references
from scenarios.openscenario.motion.profiles import Piece, SpeedProfile, transition
from scenarios.openscenario.motion.roads import Leg, Roads
from scenarios.openscenario.reading.document import as_number
from scenarios.openscenario.running.actors import STANDING_MPS, Actor
from scenarios.openscenario.running.synchronize import approach, final_speed_without_wish
from scenarios.openscenario.running.world import Instant, World

LONGITUDINAL, LATERAL = "longitudinal", "lateral"

ROUTE_REACH_M = 10.0
"""An entity that is assigned a route has to be this near to it."""

TRAJECTORY_REACH_M = 1.0
"""An entity that follows a trajectory can be teleported this far beside it."""

ON_TRAJECTORY_M = 0.01
"""An entity that is to steer to a trajectory is on it if it is this near."""

STEERING_MPS2 = 1.0
"""Lateral acceleration of who steers to a trajectory: that of a lane change after UN R79, 5.6.4 (ACSF C)."""

GENTLY = 3.0
"""Steering takes at least this many times the offset: the heading stays within 27 degrees of the line."""

SAME_WAY = math.cos(math.pi / 4)
"""Who heads further away from its route than 45 degrees does not go on along it."""

ASKED = ("a speed of", "an acceleration of", "a deceleration of")
UNITS = ("m/s", "m/s2", "m/s2")
PERFORMANCE_ROUNDED = 1e-6
"""Share by which rounding may exceed a limit without a note."""

PLAN_EPSILON_S = 1e-9
"""A plan is made again if the master's expected arrival changes by more."""

NO_ARRIVAL_S = 1e5
"""Time that is planned with as long as a master stands: who is synchronised with it comes to a standstill."""


class RunningAction:
    """An action of one entity (or of none). Those that end at once are over when `start` returns.

    Args:
        world: what it acts on.
        actor: who carries it out; None: a global action.
    """

    domains: frozenset[str] = frozenset()
    """Actions that share an entity and a domain replace each other."""

    def __init__(self, world: World, actor: Actor | None) -> None:
        self.world, self.actor = world, actor
        self.over = False
        self.stopped = False

    def start(self, time_s: float) -> None:
        """Begin."""
        raise NotImplementedError

    def ended(self, instant: Instant) -> bool:
        """Whether it has come to its end by itself at an instant."""
        return True

    def update(self, instant: Instant) -> bool:
        """Adapt at the beginning of a step; whether something is new. Most actions have nothing to adapt."""
        return False

    def needs(self) -> frozenset[str]:
        """Entities without which it cannot go on."""
        return frozenset()

    def stop(self, time_s: float) -> None:
        """End it from outside: the entity keeps the place and the speed that it has."""
        self.leave(time_s)
        self.over = self.stopped = True

    def finish(self, time_s: float) -> None:
        """End it because `ended` says so."""
        self.over = True

    def leave(self, time_s: float) -> None:
        """Let go of the entity before the end; who is not moved by the action has nothing to do."""
        return

    def drive(self, time_s: float, profile: SpeedProfile) -> SpeedProfile:
        """Give the entity a speed profile, within its Performance if that is to be applied; the one it has.

        A profile that asks for more is noted.
        """
        who, limits = self.who, self.who.definition.performance
        if limits is not None:
            name = f"'{who.name}' ({who.definition.model})"
            allowed = (limits.max_speed_mps, limits.max_acceleration_mps2, limits.max_deceleration_mps2)
            for asked, most, unit, what in zip(profile.demands(), allowed, UNITS, ASKED, strict=True):
                if asked > most * (1.0 + PERFORMANCE_ROUNDED):
                    self.world.note(
                        f"the file asks for {asked:.3g} {unit} of {name}, whose "
                        f"Performance allows {what} {most:.3g}"
                        + (": limited to that" if self.world.apply_performance else ""),
                        (who.name, what),
                        asked,
                    )
            if self.world.apply_performance:
                profile = profile.limited(limits)
        who.drive(time_s, profile)
        return profile

    @property
    def who(self) -> Actor:
        """The entity that carries it out."""
        assert self.actor is not None
        return self.actor


class Speed(RunningAction):
    """SpeedAction."""

    domains = frozenset({LONGITUDINAL})

    def __init__(self, world: World, actor: Actor, action: model.SpeedAction) -> None:
        super().__init__(world, actor)
        self._action = action

    def start(self, time_s: float) -> None:
        """Set the profile that leads to the target speed."""
        action = self._action
        now = self.who.state(time_s).speed_mps
        target = target_speed_mps(action.target, self.world, time_s)
        pieces = transition(action.shape, action.dimension, action.value, now, target)
        self._profile = self.drive(time_s, SpeedProfile(time_s, target, pieces))

    def ended(self, instant: Instant) -> bool:
        """At the target speed."""
        return instant.time_s >= self._profile.end_s - 1e-9

    def leave(self, time_s: float) -> None:
        """Go on with the present speed."""
        self.who.keep_speed(time_s)


class LongitudinalDistance(RunningAction):
    """LongitudinalDistanceAction without limits of dynamics: the distance is there at once."""

    domains = frozenset({LONGITUDINAL})

    def __init__(self, world: World, actor: Actor, action: model.LongitudinalDistanceAction) -> None:
        super().__init__(world, actor)
        self._action = action

    def start(self, time_s: float) -> None:
        """Take up the distance; keep it, or go on with the other's speed."""
        action, actor, other = self._action, self.who, self.world.actors[self._action.entity]
        own, seen = actor.state(time_s), other.state(time_s)
        ahead = action.ahead
        if ahead is None:
            ahead = actor.path.project(seen.x_m, seen.y_m)[0] <= own.station_m
        distance = action.distance_m
        if distance is None:
            distance = (action.time_gap_s or 0.0) * abs(own.speed_mps if not ahead else seen.speed_mps)
        if action.freespace:
            # the overhangs of one that faces the other way swap
            same_way = math.cos(actor.path.pose(own.station_m)[2] - seen.yaw_rad) > 0.0
            front_m, rear_m = (other.front_m, other.rear_m) if same_way else (other.rear_m, other.front_m)
            distance += actor.rear_m + front_m if ahead else actor.front_m + rear_m
        actor.attach(time_s, other, distance if ahead else -distance)
        if not action.continuous:
            actor.detach(time_s)

    def ended(self, instant: Instant) -> bool:
        """At once, unless it is continuous."""
        return not self._action.continuous

    def needs(self) -> frozenset[str]:
        """Whom it keeps the distance from."""
        return frozenset({self._action.entity})

    def leave(self, time_s: float) -> None:
        """Go on with the present speed."""
        self.who.detach(time_s)


class FollowTrajectory(RunningAction):
    """FollowTrajectoryAction. Who is commanded by a controller follows the way and not the times."""

    domains = frozenset({LATERAL})

    def __init__(self, world: World, actor: Actor, action: model.FollowTrajectoryAction) -> None:
        super().__init__(world, actor)
        self._action = action
        if action.timing is not None:
            self.domains = frozenset({LATERAL, LONGITUDINAL})

    def start(self, time_s: float) -> None:
        """Be at the start of the trajectory (or as far along as the file says)."""
        action = self._action
        trajectory = self._path = self.world.locator.trajectory(action.trajectory, self.who.name)
        station = action.initial_distance_m
        if station > self._path.length_m:
            raise RunError(
                f"trajectory '{action.trajectory.name}': initialDistanceOffset {station:.6g} m is more than "
                f"its length of {self._path.length_m:.6g} m"
            )
        here: float | None = None
        pose = self.who.state(time_s).pose
        if action.steers and self.who.placed and not self._is_at(station, pose):
            here = station = self._steer(time_s, pose)
        if action.timing is None:
            self.who.follow(time_s, self._path, station, trajectory=True)
            return
        profile = timed_profile(action, trajectory, time_s, here)
        if here is None:
            station = profile.at(time_s)[0]
        self.who.follow(time_s, self._path, station, trajectory=True)
        self.drive(time_s, profile)

    def _is_at(self, station_m: float, pose: Pose) -> bool:
        x, y, _ = self._path.pose(station_m)
        return math.hypot(x - pose.x_m, y - pose.y_m) <= ON_TRAJECTORY_M

    def _steer(self, time_s: float, pose: Pose) -> float:
        """Join the trajectory from a place beside it; where on it that is."""
        name = self._action.trajectory.name
        station, left = self._path.project(pose.x_m, pose.y_m)
        speed = abs(self.who.state(time_s).speed_mps)
        within = speed * math.sqrt(
            6.0 * abs(left) / STEERING_MPS2
        )  # 6 is the greatest curvature of the shape
        within = max(within, GENTLY * abs(left))
        if station + within > self._path.length_m:
            raise RunError(
                f"'{self.who.name}' is {abs(left):.3g} m beside trajectory '{name}' and cannot steer to it "
                f"in the {max(self._path.length_m - station, 0.0):.3g} m that are left; use "
                "followingMode='position'"
            )
        if abs(left) > ON_TRAJECTORY_M:
            self._path = self._path.joined_from(station, left, within)
        return station

    def ended(self, instant: Instant) -> bool:
        """At its end."""
        return instant.state(self.who.name).station_m >= self._path.length_m

    def finish(self, time_s: float) -> None:
        """Go on along the route or the lane."""
        go_on(self.who, self.world, time_s)
        self.over = True

    def leave(self, time_s: float) -> None:
        """Go on along the route or the lane, with the present speed."""
        go_on(self.who, self.world, time_s)
        if self._action.timing is not None:
            self.who.keep_speed(time_s)


def go_on(actor: Actor, world: World, time_s: float) -> None:
    """Leave a trajectory: on along the route of the entity or its lane, at its offset; else straight."""
    pose, roads = actor.state(time_s).pose, world.locator.roads
    path = route_way(roads, actor.route, pose) if actor.route is not None else None
    if path is None or math.cos(path.pose(path.project(pose.x_m, pose.y_m)[0])[2] - pose.yaw_rad) < SAME_WAY:
        path = roads.way(pose)
    actor.follow(time_s, path, path.project(pose.x_m, pose.y_m)[0], trajectory=False)


def route_way(roads: Roads, legs: list[Leg], pose: Pose) -> Path | None:
    """The way along a route at the offset of a pose; None if the pose is too far from it."""
    middle = roads.path(legs, 0.0)
    station, left = middle.project(pose.x_m, pose.y_m)
    if not -1e-3 <= station <= middle.length_m or abs(left) > ROUTE_REACH_M:
        return None
    return middle if abs(left) < 1e-9 else roads.path(legs, left)


def timed_profile(
    action: model.FollowTrajectoryAction, path: Path, time_s: float, here_m: float | None = None
) -> SpeedProfile:
    """Speed profile that meets the times of a trajectory's vertices.

    Args:
        action: what is followed.
        path: the trajectory.
        time_s: now.
        here_m: where on it the entity is now; None: where it should be.

    Raises:
        RunError: a vertex has no time, or times do not grow.
    """
    shape, timing = action.trajectory.shape, action.timing
    assert timing is not None
    if isinstance(shape, model.Polyline):
        times = [vertex.time_s for vertex in shape.vertices]
        stations = path.station_of_vertices()
    elif isinstance(shape, model.ClothoidSpline):
        times, stations = [0.0, shape.time_end_s], [0.0, path.length_m]
    else:
        times, stations = [None], [0.0]
    base = time_s if timing.relative else 0.0
    given = [base + timing.offset_s + timing.scale * t for t in times if t is not None]
    if len(given) < len(times) or any(b <= a for a, b in pairwise(given)):
        raise RunError(
            f"trajectory '{action.trajectory.name}': following it by time needs growing times throughout"
        )
    points = list(zip(given, stations, strict=True))
    if here_m is not None:
        ahead = [(t, s) for t, s in points if t > time_s and s > here_m]
        points = [(time_s, here_m), *ahead]
    pieces = [
        Piece(t1 - t0, (s1 - s0) / (t1 - t0), (s1 - s0) / (t1 - t0))
        for (t0, s0), (t1, s1) in pairwise(points)
    ]
    if here_m is not None:
        return SpeedProfile(time_s, 0.0, pieces)
    wait = max(given[0] - time_s, 0.0)
    return SpeedProfile(min(given[0], time_s), 0.0, [Piece(wait, 0.0, 0.0), *pieces])


class AssignRoute(RunningAction):
    """AssignRouteAction: from its lane on along the route, at its offset."""

    domains = frozenset({LATERAL})

    def __init__(self, world: World, actor: Actor, action: model.AssignRouteAction) -> None:
        super().__init__(world, actor)
        self._route = action.route

    def start(self, time_s: float) -> None:
        """Put the entity on the route."""
        legs = self.world.locator.legs(self._route)
        pose = self.who.state(time_s).pose
        path = route_way(self.world.locator.roads, legs, pose)
        if path is None:
            raise RunError(f"'{self.who.name}' is not on route '{self._route.name}', which it is assigned")
        self.who.route = legs
        self.who.follow(time_s, path, path.project(pose.x_m, pose.y_m)[0], trajectory=False)


class Teleport(RunningAction):
    """TeleportAction. An entity that follows a trajectory goes on from the nearest point of it."""

    def __init__(self, world: World, actor: Actor, action: model.TeleportAction) -> None:
        super().__init__(world, actor)
        self._position = action.position

    def start(self, time_s: float) -> None:
        """Be there."""
        pose = self.world.locator.pose(self._position)
        if self.who.on_trajectory:
            station, left = self.who.path.project(pose.x_m, pose.y_m)
            if abs(left) > TRAJECTORY_REACH_M:
                raise RunError(f"'{self.who.name}' is teleported off the trajectory that it follows")
            self.who.follow(time_s, self.who.path, station, trajectory=True)
            return
        self.who.route = None
        path = self.world.locator.roads.way(pose)
        self.who.teleport(time_s, path, path.project(pose.x_m, pose.y_m)[0], pose.yaw_rad)


class Synchronize(RunningAction):
    """SynchronizeAction.

    While the entity waits, its plan follows the master's expected arrival. From the moment that it sets off
    (or, if it was already moving, from the beginning of its steady state) the plan is kept, whatever the
    master does.
    """

    domains = frozenset({LONGITUDINAL})

    def __init__(self, world: World, actor: Actor, action: model.SynchronizeAction) -> None:
        super().__init__(world, actor)
        self._action = action
        self._arrival_s = math.inf
        self._frozen = False
        self._own_path: Path | None = None
        self._master_path: Path | None = None

    def start(self, time_s: float) -> None:
        """Find both places, and make the first plan."""
        action, actor = self._action, self.who
        self._master = self.world.actors[action.master]
        self._target = self.world.locator.pose(action.target)
        self._master_target = self.world.locator.pose(action.master_target)
        self._from_rest = abs(actor.asked_mps(time_s)) <= STANDING_MPS
        self._find_stations()
        self._arrival_s = self._master.arrives_s(time_s, self._master_station)
        self._plan(time_s)

    def _find_stations(self) -> bool:
        """Find both places on the ways of the two, if these are new; whether one is."""
        actor, master = self.who, self._master
        if actor.path is self._own_path and master.path is self._master_path:
            return False
        self._own_path, self._master_path = actor.path, master.path
        self._station = actor.path.project(self._target.x_m, self._target.y_m)[0]
        self._master_station = master.path.project(self._master_target.x_m, self._master_target.y_m)[0]
        return True

    def update(self, instant: Instant) -> bool:
        """Make a new plan if a way is a new one, or the master will arrive at another time than planned."""
        time_s = instant.time_s
        moved = self._find_stations()
        if self._frozen:
            return False
        speed = abs(instant.state(self.who.name).speed_mps)
        if (self._from_rest and speed > STANDING_MPS) or time_s >= self._steady_from_s:
            self._frozen = True
            return False
        arrival = self._master.arrives_s(time_s, self._master_station)
        if moved or (arrival != self._arrival_s and not abs(arrival - self._arrival_s) <= PLAN_EPSILON_S):
            self._arrival_s = arrival
            self._plan(time_s)
            return True
        return False

    def _plan(self, time_s: float) -> None:
        action, actor, arrival = self._action, self.who, self._arrival_s
        state = actor.state(time_s)
        speed = actor.progress_mps(state)
        left_m = max(self._station - state.station_m, 0.0)
        left_s = arrival - time_s if arrival < math.inf else NO_ARRIVAL_S
        if action.final_speed is None:
            final = final_speed_without_wish(speed, left_m, left_s) if arrival < math.inf else 0.0
        else:
            final = target_speed_mps(action.final_speed, self.world, time_s)
        if self._from_rest and final <= 0.0:
            self._steady_from_s = time_s + left_s
            return
        steady_m, steady_s = self._steady(final)
        pieces = approach(max(speed, 0.0), final, left_m - steady_m, left_s - steady_s)
        # no way or no time left: on at the final speed
        profile = self.drive(time_s, SpeedProfile(time_s, final, pieces or ()))
        self._steady_from_s = profile.end_s

    def _steady(self, final_mps: float) -> tuple[float, float]:
        """Way and duration of the steady state."""
        steady = self._action.steady
        if steady is None or final_mps <= 0.0:
            return 0.0, 0.0
        if steady.distance_m is not None:
            return steady.distance_m, steady.distance_m / final_mps
        duration = steady.time_s or 0.0
        return duration * final_mps, duration

    def ended(self, instant: Instant) -> bool:
        """The entity is at its place."""
        return instant.state(self.who.name).station_m >= self._station - 1e-9

    def needs(self) -> frozenset[str]:
        """The master, as long as the plan follows it."""
        return frozenset() if self._frozen else frozenset({self._action.master})

    def leave(self, time_s: float) -> None:
        """Go on with the present speed."""
        self.who.keep_speed(time_s)


class Switch(RunningAction):
    """Actions that change a value and are over: visibility, light, environment, variables, deletion."""

    def __init__(self, world: World, actor: Actor | None, action: model.Action) -> None:
        super().__init__(world, actor)
        self._action = action

    def start(self, time_s: float) -> None:
        """Change it."""
        world, action = self.world, self._action
        match action:
            case model.VisibilityAction():
                self.who.seen = action.sensors
            case model.LightStateAction():
                self.who.lights = {**self.who.lights, action.light: action.mode}
            case model.EnvironmentAction():
                world.environment = action.environment
            case model.DeleteEntityAction():
                world.actors[action.entity].exists = False
            case model.SetVariableAction():
                world.variables[action.variable] = action.value
            case model.ModifyVariableAction():
                before = as_number(world.variables[action.variable])
                if before is None:
                    raise RunError(f"variable '{action.variable}' is not a number and cannot be modified")
                value = before + action.value if action.operator == "add" else before * action.value
                world.variables[action.variable] = value
            case _:
                raise RunError(f"{type(action).__name__} is not carried out")


def target_speed_mps(target: float | model.RelativeSpeed, world: World, time_s: float) -> float:
    """Speed that an action asks for, at a time."""
    if isinstance(target, model.RelativeSpeed):
        other = world.actors[target.entity].state(time_s).speed_mps
        return other * target.value if target.is_factor else other + target.value
    return target


def referred(action: model.Action) -> frozenset[str]:
    """Entities that an action refers to when it starts."""
    match action:
        case model.SpeedAction(target=model.RelativeSpeed(entity=name)):
            return frozenset({name})
        case model.LongitudinalDistanceAction():
            return frozenset({action.entity})
        case model.SynchronizeAction():
            speed = action.final_speed
            names = {speed.entity} if isinstance(speed, model.RelativeSpeed) else set[str]()
            return references(action.target) | references(action.master_target) | names | {action.master}
        case model.TeleportAction():
            return references(action.position)
        case model.FollowTrajectoryAction():
            return references(action.trajectory)
        case model.AssignRouteAction():
            return references(action.route)
    return frozenset()


def running(world: World, actor: Actor | None, action: model.Action) -> RunningAction:
    """The action as it is carried out by an entity (None: a global action)."""
    if actor is not None:
        match action:
            case model.SpeedAction():
                return Speed(world, actor, action)
            case model.LongitudinalDistanceAction():
                return LongitudinalDistance(world, actor, action)
            case model.FollowTrajectoryAction():
                return FollowTrajectory(world, actor, action)
            case model.AssignRouteAction():
                return AssignRoute(world, actor, action)
            case model.TeleportAction():
                return Teleport(world, actor, action)
            case model.SynchronizeAction():
                return Synchronize(world, actor, action)
    return Switch(world, actor, action)
