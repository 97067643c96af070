"""Bare conditions on the place and the motion of one entity."""

from __future__ import annotations

import math

from scenarios.openscenario import model
from scenarios.openscenario.elements import referred
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.paths import Pose
from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.holding import SLACK, Compared, Holding, settled_for_s
from scenarios.openscenario.running.world import TIME_EPSILON_S, Instant, World
from smartmot.maps.lane_map import LEVEL_M

STEEPEST = 0.3
"""Grade that no road exceeds: the steepest streets have 35 %, those on bridges and ramps at most 10 %."""

MOMENT_S = 1e-3
"""Over which velocities change for an acceleration, and how often is looked where it follows a curvature."""


class StandStill(Holding):
    """StandStillCondition."""

    def __init__(self, condition: model.StandStillCondition, actor: Actor) -> None:
        self._duration_s, self._actor = condition.duration_s, actor
        self._least_s = condition.duration_s - TIME_EPSILON_S

    def holds(self, instant: Instant) -> bool:
        """Whether the entity has stood long enough."""
        since = self._actor.standing_since(instant.time_s, instant.state(self._actor.name))
        return since is not None and instant.time_s - since >= self._least_s

    def next_s(self) -> float:
        """When it will have, if it goes on to stand."""
        since = self._actor.standing_since_s
        return math.inf if since is None else since + self._duration_s

    def settled_s(self, now: Instant) -> float:
        """Until it has stood long enough at the earliest; then as long as it rests."""
        if self.holds(now):
            return math.inf if self._actor.rests(now.time_s) else now.time_s
        since = self._actor.standing_since(now.time_s, now.state(self._actor.name))
        return (now.time_s if since is None else since) + self._least_s


class TraveledDistance(Holding):
    """TraveledDistanceCondition."""

    def __init__(self, condition: model.TraveledDistanceCondition, actor: Actor) -> None:
        self._distance_m, self._actor = condition.value, actor

    def holds(self, instant: Instant) -> bool:
        """Whether the entity has gone that far."""
        return instant.state(self._actor.name).travelled_m >= self._distance_m

    def settled_s(self, now: Instant) -> float:
        """Until it can have."""
        left_m = self._distance_m - now.state(self._actor.name).travelled_m
        return settled_for_s(now, left_m, self._actor.fastest_mps(now.time_s))


class Angle(Compared):
    """AngleCondition, RelativeAngleCondition: how far a heading, or a difference of two, is from an angle."""

    def __init__(
        self,
        condition: model.AngleCondition | model.RelativeAngleCondition,
        actor: Actor,
        world: World,
        other: Actor | None = None,
    ) -> None:
        super().__init__("lessOrEqual", condition.tolerance_rad)
        self._angle_rad, self._system = condition.angle_rad, condition.system
        self._actor, self._world = actor, world
        self._actors = [actor] if other is None else [actor, other]

    def quantity(self, instant: Instant) -> float:
        """The difference, not negative; not a number where there is no road (no trajectory) to count from."""
        difference: float | None = instant.memo.get(self)
        if difference is None:
            headings = [instant.state(actor.name).yaw_rad for actor in self._actors]
            directions = self._directions(instant)
            turned = [yaw - direction for yaw, direction in zip(headings, directions, strict=True)]
            angle = turned[0] - (turned[1] if len(turned) > 1 else 0.0) - self._angle_rad
            difference = abs(math.remainder(angle, 2 * math.pi)) if math.isfinite(angle) else math.nan
            instant.memo[self] = difference
        return difference

    def _directions(self, instant: Instant) -> list[float]:
        """Directions from which headings count, at each of the entities."""
        states = [instant.state(actor.name) for actor in self._actors]
        if self._system in ("entity", "world"):
            return [0.0] * len(states)
        if self._system == "trajectory":
            path = self._actor.path
            if not self._actor.on_trajectory:
                return [math.nan] * len(states)
            return [path.pose(path.project(state.x_m, state.y_m)[0])[2] for state in states]
        distances = self._world.road_distances
        return [
            distances.direction_at(actor.path, state.station_m, actor.pose_in(state), self._system == "lane")
            for actor, state in zip(self._actors, states, strict=True)
        ]

    def reach(self, a: Instant, b: Instant) -> float:
        """How much the entities, and the directions that count, turn."""
        names = [actor.name for actor in self._actors]
        turn = sum(
            actor.turn_rad(a.state(name), b.state(name))
            for actor, name in zip(self._actors, names, strict=True)
        )
        if self._system in ("entity", "world"):
            return turn
        pairs = zip(self._directions(a), self._directions(b), strict=True)
        turns = [abs(math.remainder(y - x, 2 * math.pi)) for x, y in pairs if math.isfinite(x + y)]
        return turn + sum(turns)

    def settled_s(self, now: Instant) -> float:
        """As long as the entities rest."""
        resting = all(actor.rests(now.time_s) for actor in self._actors)
        return math.inf if resting else now.time_s


class Speed(Compared):
    """SpeedCondition; within a step a speed only grows or only falls."""

    def __init__(self, condition: model.SpeedCondition, actor: Actor) -> None:
        super().__init__(condition.rule, condition.value)
        self._direction, self._actor = condition.direction, actor

    def quantity(self, instant: Instant) -> float:
        """Speed in the direction: entities move along their own x axis, nothing is left for the others."""
        if self._direction is None:
            return abs(instant.state(self._actor.name).speed_mps)
        return instant.state(self._actor.name).speed_mps if self._direction == "longitudinal" else 0.0

    def reach(self, a: Instant, b: Instant) -> float:
        """An amount is smallest where the entity turns round inside the step."""
        if self._direction is not None:
            return 0.0
        speed_mps, later_mps = a.state(self._actor.name).speed_mps, b.state(self._actor.name).speed_mps
        return abs(later_mps - speed_mps) if speed_mps * later_mps < 0.0 else 0.0

    def settled_s(self, now: Instant) -> float:
        """As long as the speed stays as it is."""
        if self._direction in ("lateral", "vertical"):
            return math.inf
        return math.inf if self._actor.steady(now.time_s) else now.time_s


class Acceleration(Compared):
    """AccelerationCondition."""

    def __init__(self, condition: model.AccelerationCondition, actor: Actor) -> None:
        super().__init__(condition.rule, condition.value)
        self._direction, self._actor = condition.direction, actor

    def quantity(self, instant: Instant) -> float:
        """Acceleration in the direction."""
        return acceleration_mps2(self._actor, instant, self._direction)

    def flips(self, a: Instant, b: Instant) -> bool:
        """In a bend the acceleration follows the curvature, which is looked at every millisecond."""
        name = self._actor.name
        if self._direction == "longitudinal" or self._actor.turn_rad(a.state(name), b.state(name)) <= SLACK:
            return False
        count = int((b.time_s - a.time_s) / MOMENT_S)
        before, step_s = self.mark(a), (b.time_s - a.time_s) / max(count, 1)
        return any(self.mark(Instant(a.time_s + k * step_s, a.actors)) != before for k in range(1, count))


def acceleration_mps2(actor: Actor, instant: Instant, direction: model.Direction | None) -> float:
    """Acceleration of an entity in a direction of it, or its amount, from its velocities within a moment."""
    now, soon = instant.state(actor.name), actor.state(instant.time_s + MOMENT_S)
    turn = soon.yaw_rad - now.yaw_rad
    along = (soon.speed_mps * math.cos(turn) - now.speed_mps) / MOMENT_S
    left = soon.speed_mps * math.sin(turn) / MOMENT_S
    if direction is None:
        return math.hypot(along, left)
    return {"longitudinal": along, "lateral": left, "vertical": 0.0}[direction]


class ReachPosition(Compared):
    """ReachPositionCondition: the distance in plan from a place, which may move with other entities.

    Where roads lie above one another, a place on another level is infinitely far away.
    """

    def __init__(self, condition: model.ReachPositionCondition, actor: Actor, world: World) -> None:
        super().__init__("lessOrEqual", condition.tolerance_m)
        self._position, self._actor, self._world = condition.position, actor, world
        self._leaders = [world.actors[name] for name in sorted(referred(condition.position))]
        self._fixed: Pose | None = None

    def quantity(self, instant: Instant) -> float:
        """The distance, worked out once for an instant."""
        distance_m: float | None = instant.memo.get(self)
        if distance_m is None:
            distance_m = instant.memo[self] = self._distance_m(instant)
        return distance_m

    def _distance_m(self, instant: Instant) -> float:
        pose, locator = self._fixed, self._world.locator
        if pose is None and not self._leaders:
            pose = self._fixed = locator.pose(self._position)
        elif pose is None:
            try:
                actors = self._world.actors
                pose = locator.at(lambda name: actors[name].pose(instant.time_s)).pose(self._position)
            except RunError:  # there is no such place while the other is there
                return math.inf
        state = instant.state(self._actor.name)
        apart_m = math.hypot(pose.x_m - state.x_m, pose.y_m - state.y_m)
        ground_m = self._actor.ground_m(state)
        if ground_m is None or pose.z_m is None:
            return apart_m
        level_m = locator.roads.level_m(pose.x_m, pose.y_m, pose.z_m)
        return math.inf if abs(level_m - ground_m) > LEVEL_M + STEEPEST * apart_m else apart_m

    def reach(self, a: Instant, b: Instant) -> float:
        """The way of the entity, and that of the place."""
        seconds = b.time_s - a.time_s
        way_m = _faster_mps(self._actor, a, b) * seconds
        for leader in self._leaders:
            # a place beside or ahead of another swings with it, and covers more way outside a bend
            way_m += 2.0 * _faster_mps(leader, a, b) * seconds
            way_m += leader.turn_rad(a.state(leader.name), b.state(leader.name)) * _offset_m(self._position)
        return way_m

    def settled_s(self, now: Instant) -> float:
        """Until a place that is fixed can be reached or left."""
        if self._leaders or math.isinf(self.quantity(now)):
            return now.time_s
        left_m = abs(self.quantity(now) - self._value)
        return settled_for_s(now, left_m, self._actor.fastest_mps(now.time_s))


def _faster_mps(actor: Actor, a: Instant, b: Instant) -> float:
    return max(abs(a.state(actor.name).speed_mps), abs(b.state(actor.name).speed_mps))


def _offset_m(position: model.Position) -> float:
    """How far a place is from the entity that it is relative to; 0 along the road, whatever the heading."""
    match position:
        case model.RelativeObjectPosition() | model.RelativeWorldPosition():
            return math.hypot(position.dx_m, position.dy_m)
    return 0.0
