"""Bare conditions on one entity and another: contact, relative speed, distance, and times to it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

from scenarios.openscenario import model
from scenarios.openscenario.running.actors import STANDING_MPS, Actor, State
from scenarios.openscenario.running.driving.separation import Separation, moved
from scenarios.openscenario.running.holding import (
    EQUAL,
    HORIZON_S,
    SLACK,
    Compared,
    Holding,
    Mark,
    settled_for_s,
)
from scenarios.openscenario.running.on_road import PlaceActor
from scenarios.openscenario.running.own import MOMENT_S
from scenarios.openscenario.running.world import Instant, World
from smartmot.geometry import signed_gap_scalar

ROAD_SETTLED_S = 0.2
"""A distance along the road is worked out again after this at the latest."""

BRIEFLY_S = 1e-5
"""Over which a distance changes for the speed at which it shrinks."""

DistanceKind: TypeAlias = (
    model.RelativeDistanceCondition
    | model.DistanceCondition
    | model.TimeHeadwayCondition
    | model.TimeToCollisionCondition
)


class Pair:
    """Two entities, and how they can move against each other between two instants."""

    def __init__(self, actor: Actor, other: Actor) -> None:
        self.actor, self.other = actor, other

    def states(self, instant: Instant) -> tuple[State, State]:
        """Their states."""
        return instant.state(self.actor.name), self._seen(instant)

    def _seen(self, instant: Instant) -> State:
        """State of the other, which may be a place that is none of the entities."""
        if not isinstance(self.other, PlaceActor):
            return instant.state(self.other.name)
        state: State | None = instant.memo.get(self.other)
        if state is None:
            state = instant.memo[self.other] = self.other.state(instant.time_s)
        return state

    def apart_m(self, instant: Instant) -> float:
        """Distance of their reference points."""
        state, other = self.states(instant)
        return math.hypot(state.x_m - other.x_m, state.y_m - other.y_m)

    def fastest_mps(self, now: Instant) -> float:
        """Greatest speed at which they can approach or part from now on."""
        return self.actor.fastest_mps(now.time_s) + self.other.fastest_mps(now.time_s)

    def passed(self, a: Instant, b: Instant) -> tuple[float, float, float]:
        """How far the reference points can have moved against each other, and how far each entity turned.

        By the difference of their ways, and by what velocities that change can depart from their means.
        """
        (state, other), (later, other_later) = self.states(a), self.states(b)
        turn, other_turn = self.actor.turn_rad(state, later), self.other.turn_rad(other, other_later)
        changes_mps = change_mps(state, later, turn) + change_mps(other, other_later, other_turn)
        dx = (later.x_m - state.x_m) - (other_later.x_m - other.x_m)
        dy = (later.y_m - state.y_m) - (other_later.y_m - other.y_m)
        return math.hypot(dx, dy) + changes_mps * (b.time_s - a.time_s), turn, other_turn


def change_mps(state: State, later: State, turn_rad: float) -> float:
    """By how much a velocity can have changed."""
    faster_mps = max(abs(state.speed_mps), abs(later.speed_mps))
    return abs(later.speed_mps - state.speed_mps) + turn_rad * faster_mps


def is_driven_over(actor: Actor, other: Actor) -> bool:
    """Whether one of two lies in the road's surface: no contact."""
    return actor.definition.flat or other.definition.flat


class Touching(Holding):
    """Whether two outlines touch or overlap: CollisionCondition, and the ego's contacts."""

    def __init__(self, actor: Actor, other: Actor) -> None:
        self._pair, self._names = Pair(actor, other), (actor.name, other.name)

    def holds(self, instant: Instant) -> bool:
        """Whether no gap is left, in plan and in height; a trailer and who tows it do not collide.

        Before they are connected and after they are let go of they can, once they have been apart.
        """
        actor, other = self._pair.actor, self._pair.other
        if (actor.coupling or other.coupling) is not None and actor.train() is other.train():
            return False
        if other in actor.unparted or actor in other.unparted:
            return False
        if instant.circle_gap_m(*self._names) > 0.0 or instant.gap_m(*self._names) > 0.0:
            return False
        return not instant.above(*self._names)

    def flips(self, a: Instant, b: Instant) -> bool:
        """Whether they can have met and parted, or parted and met."""
        pair, names = self._pair, self._names
        passed_m, turn, other_turn = pair.passed(a, b)
        passed_m = passed_m + turn * pair.actor.radius_m + other_turn * pair.other.radius_m
        if a.circle_gap_m(*names) + b.circle_gap_m(*names) >= passed_m:
            return False
        return abs(a.gap_m(*names)) + abs(b.gap_m(*names)) + SLACK < passed_m

    def settled_s(self, now: Instant) -> float:
        """Until circles around them can meet."""
        return settled_for_s(now, now.circle_gap_m(*self._names), self._pair.fastest_mps(now))


class TouchingAny(Holding):
    """CollisionCondition by type: whether the outline of one of several touches.

    Args:
        parts: each of the others that there may be, with its outline's touching.
    """

    def __init__(self, parts: Sequence[tuple[Actor, Touching]]) -> None:
        self._parts = parts

    def holds(self, instant: Instant) -> bool:
        """Whether one that exists touches."""
        return any(other.exists and part.holds(instant) for other, part in self._parts)

    def mark(self, instant: Instant) -> Mark:
        """Which of them touch."""
        return tuple(other.exists and part.holds(instant) for other, part in self._parts)

    def flips(self, a: Instant, b: Instant) -> bool:
        """Whether one of them can have met and parted, or parted and met."""
        return any(other.exists and part.flips(a, b) for other, part in self._parts)

    def settled_s(self, now: Instant) -> float:
        """As long as none of them can meet."""
        times = [part.settled_s(now) for other, part in self._parts if other.exists]
        return min(times, default=now.time_s + HORIZON_S)


class RelativeSpeed(Compared):
    """RelativeSpeedCondition."""

    def __init__(self, condition: model.RelativeSpeedCondition, actor: Actor, other: Actor) -> None:
        super().__init__(condition.rule, condition.value)
        self._pair, self._direction = Pair(actor, other), condition.direction

    def quantity(self, instant: Instant) -> float:
        """The relative speed in the direction."""
        return relative_speed_mps(*self._pair.states(instant), self._direction)

    def reach(self, a: Instant, b: Instant) -> float:
        """By how much speed and the other's velocity, seen from an entity that turns, change."""
        (state, other), (later, other_later) = self._pair.states(a), self._pair.states(b)
        turn_rad = 0.0
        if self._direction:
            pair = self._pair
            turn_rad = pair.actor.turn_rad(state, later) + pair.other.turn_rad(other, other_later)
        return abs(later.speed_mps - state.speed_mps) + change_mps(other, other_later, turn_rad)

    def settled_s(self, now: Instant) -> float:
        """As long as both speeds stay as they are."""
        pair, time_s = self._pair, now.time_s
        steady = self._direction is None and pair.actor.steady(time_s) and pair.other.steady(time_s)
        return math.inf if steady else time_s


def relative_speed_mps(a: State, b: State, direction: model.Direction | None) -> float:
    """Velocity of a minus that of b in a direction of a; without direction the difference of their speeds."""
    if direction is None:
        return abs(a.speed_mps) - abs(b.speed_mps)
    turn = b.yaw_rad - a.yaw_rad
    if direction == "longitudinal":
        return a.speed_mps - b.speed_mps * math.cos(turn)
    return -b.speed_mps * math.sin(turn) if direction == "lateral" else 0.0


class _Distance(Compared):
    """What conditions on a distance share."""

    def __init__(self, condition: DistanceKind, actor: Actor, other: Actor, world: World) -> None:
        super().__init__(condition.rule, condition.value)
        self._pair, self._kind, self._freespace = Pair(actor, other), condition.kind, condition.freespace
        system = condition.system
        if condition.along_route:  # the word of 1.0 for a distance along the road
            system, self._kind = "road", "longitudinal"
        along = system != "entity" and self._kind != "euclidianDistance"
        self._along = Separation(world, actor, other, system) if along else None

    def _between_m(self, state: State, other: State) -> float:
        if self._along is not None:
            return self._along.between_m(state, other, self._kind == "lateral", self._freespace)
        return signed_distance_m(
            self._pair.actor, self._pair.other, state, other, self._kind, self._freespace
        )

    def _signed_m(self, instant: Instant) -> float:
        """The distance, negative where they overlap, worked out once for an instant."""
        distance_m: float | None = instant.memo.get(self)
        if distance_m is None:
            distance_m = instant.memo[self] = self._between_m(*self._pair.states(instant))
        return distance_m

    def reach(self, a: Instant, b: Instant) -> float:
        """How much the distance can have changed."""
        pair = self._pair
        reach_m, turn, other_turn = pair.passed(a, b)
        if self._along is not None:
            # beside a bend the way along the road is longer or shorter, by no more than twice
            (state, other), (later, other_later) = pair.states(a), pair.states(b)
            way_m = abs(later.travelled_m - state.travelled_m) + abs(
                other_later.travelled_m - other.travelled_m
            )
            if self._freespace:
                way_m += turn * pair.actor.radius_m + other_turn * pair.other.radius_m
            return 2.0 * way_m
        actor_m, other_m = pair.actor.radius_m, pair.other.radius_m
        if self._freespace:
            reach_m += turn * actor_m + other_turn * other_m
        if self._kind != "euclidianDistance" and turn > 0.0:
            # the axis along which it is measured turns with the entity
            spread_m = max(pair.apart_m(a), pair.apart_m(b))
            reach_m += turn * (spread_m + (actor_m + other_m if self._freespace else 0.0))
        return reach_m

    def _settled_s(self, now: Instant, value_m: float, headway_s: float = 0.0) -> float:
        """Until when the distance stays on one side of a value, to which a time at the speed may add."""
        pair = self._pair
        apart_m, fastest_mps = pair.apart_m(now), pair.fastest_mps(now)
        if not math.isfinite(fastest_mps):
            return now.time_s
        if self._along is not None:
            left_m = self._signed_m(now) - value_m - headway_s * fastest_mps
            until_s = settled_for_s(now, left_m if left_m > 0.0 or headway_s else -left_m, 2.0 * fastest_mps)
            # a fork ahead may change the distance at once
            return min(until_s, now.time_s + ROAD_SETTLED_S) if math.isfinite(until_s) else now.time_s
        # distances along an axis and between outlines are no greater, whatever the headings
        if apart_m < value_m and headway_s == 0.0:
            return settled_for_s(now, value_m - apart_m, fastest_mps)
        if self._kind != "euclidianDistance":
            return now.time_s
        radii_m = pair.actor.radius_m + pair.other.radius_m if self._freespace else 0.0
        return settled_for_s(now, apart_m - radii_m - value_m - headway_s * fastest_mps, fastest_mps)


class RelativeDistance(_Distance):
    """RelativeDistanceCondition."""

    def quantity(self, instant: Instant) -> float:
        """The distance, not negative."""
        return max(self._signed_m(instant), 0.0)

    def flips(self, a: Instant, b: Instant) -> bool:
        """How deep two overlap tells how soon they can be apart."""
        value_m = self._value
        both_ways_m = abs(self._signed_m(a) - value_m) + abs(self._signed_m(b) - value_m)
        return both_ways_m + SLACK < self.reach(a, b)

    def settled_s(self, now: Instant) -> float:
        """As long as the distance stays on this side of the value."""
        return self._settled_s(now, self._value)


class TimeHeadway(_Distance):
    """TimeHeadwayCondition: distance over speed, looked into as the distance less that time at the speed."""

    def _speed_mps(self, instant: Instant) -> float:
        return abs(instant.state(self._pair.actor.name).speed_mps)

    def quantity(self, instant: Instant) -> float:
        """The time; infinite for an entity that stands."""
        speed_mps = self._speed_mps(instant)
        return max(self._signed_m(instant), 0.0) / speed_mps if speed_mps > STANDING_MPS else math.inf

    def _over_m(self, instant: Instant) -> float:
        return self._signed_m(instant) - self._value * self._speed_mps(instant)

    def flips(self, a: Instant, b: Instant) -> bool:
        """Whether the distance can have come to the way within that time and gone back."""
        change_mps = abs(self._speed_mps(b) - self._speed_mps(a))
        both_ways_m = abs(self._over_m(a)) + abs(self._over_m(b))
        return both_ways_m + SLACK < self.reach(a, b) + abs(self._value) * change_mps

    def settled_s(self, now: Instant) -> float:
        """As long as the distance is greater than the way within that time."""
        return self._settled_s(now, 0.0, max(self._value, 0.0))


class TimeToCollision(_Distance):
    """TimeToCollisionCondition; does not hold while the distance does not shrink."""

    def __init__(
        self, condition: model.TimeToCollisionCondition, actor: Actor, other: Actor, world: World
    ) -> None:
        super().__init__(condition, actor, other, world)
        self._upwards = condition.rule not in ("lessThan", "lessOrEqual")

    def _closing(self, instant: Instant) -> tuple[float, float]:
        """The distance, and the speed at which it shrinks."""
        (state, other), actor, seen = self._pair.states(instant), self._pair.actor, self._pair.other

        def apart_m(time_s: float) -> float:
            return max(self._between_m(moved(actor, state, time_s), moved(seen, other, time_s)), 0.0)

        return apart_m(0.0), (apart_m(-BRIEFLY_S) - apart_m(BRIEFLY_S)) / (2.0 * BRIEFLY_S)

    def quantity(self, instant: Instant) -> float:
        """The time; infinite while the distance does not shrink."""
        apart_m, speed_mps = self._closing(instant)
        return apart_m / speed_mps if speed_mps > STANDING_MPS else math.inf

    def _side(self, instant: Instant) -> int:
        """0: it does not shrink; else whether the time is below (2), at (3) or above (4) the value."""
        apart_m, speed_mps = self._closing(instant)
        if not speed_mps > STANDING_MPS:  # also where there is no distance
            return 0
        differs = apart_m / speed_mps - self._value
        return 3 if abs(differs) <= EQUAL else 4 if differs > 0.0 else 2

    def holds(self, instant: Instant) -> bool:
        """Whether the distance shrinks and the rule holds for the time."""
        if self._equality:
            side = self._side(instant)
            return side > 0 and (side == 3) == (self._rule == "equalTo")
        apart_m, speed_mps = self._closing(instant)
        return speed_mps > STANDING_MPS and self._compare(apart_m / speed_mps, self._value)

    def mark(self, instant: Instant) -> Mark:
        """For an equality also on which side of the value the time is."""
        return self._side(instant) if self._equality else self.holds(instant)

    def flips(self, a: Instant, b: Instant) -> bool:
        """Whether the distance can have come to the way within the time at the closing speed and gone back.

        That speed changes with the velocities (`changes_mps`), with the axis along which the distance is
        measured, which turns with the entities, and with the line of sight, which turns the faster the nearer
        they are (`bend_mps`).
        """
        (apart_m, speed_mps), (later_m, later_mps) = self._closing(a), self._closing(b)
        reach_m, seconds = self.reach(a, b), b.time_s - a.time_s
        _, turn, other_turn = self._pair.passed(a, b)
        (state, other), (later, other_later) = self._pair.states(a), self._pair.states(b)
        changes_mps = change_mps(state, later, turn) + change_mps(other, other_later, other_turn)
        nearest_m = min(apart_m, later_m) - reach_m
        if nearest_m <= 0.0:
            # where they meet, the direction in which they approach can be any: look every millisecond
            return seconds > MOMENT_S
        rate_mps = reach_m / seconds
        bend_mps = changes_mps + rate_mps * (turn + other_turn)
        bend_mps += rate_mps * reach_m / nearest_m if self._kind == "euclidianDistance" else 0.0
        over_m = abs(apart_m - self._value * speed_mps) + abs(later_m - self._value * later_mps)
        if over_m + SLACK < reach_m + abs(self._value) * bend_mps:
            return True
        begins = abs(speed_mps) + abs(later_mps) + SLACK < bend_mps
        return self._upwards and seconds > MOMENT_S and begins

    def settled_s(self, now: Instant) -> float:
        """As long as the distance is greater than the way within the time."""
        if self._upwards:  # it also begins to hold where they begin to approach each other, however far apart
            return now.time_s
        return self._settled_s(now, 0.0, max(self._value, 0.0))


def signed_distance_m(
    actor: Actor, other: Actor, a: State, b: State, kind: model.Distance, freespace: bool
) -> float:
    """Distance of two entities in the states a and b, in the frame of the first.

    Between reference points, or, if `freespace`, between outlines: for `longitudinal` and `lateral` between
    their extents along that axis. Negative where outlines (or their extents) overlap: by how far.
    """
    if kind == "euclidianDistance":
        if freespace:
            return signed_gap_scalar(actor.box(a), other.box(b))
        return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m)
    c, s = math.cos(a.yaw_rad), math.sin(a.yaw_rad)
    if kind == "lateral":
        c, s = -s, c
    if not freespace:
        return abs((b.x_m - a.x_m) * c + (b.y_m - a.y_m) * s)
    (low_a, high_a), (low_b, high_b) = _extent(actor.box(a), c, s), _extent(other.box(b), c, s)
    return max(low_b - high_a, low_a - high_b)


def _extent(box: tuple[float, float, float, float, float], c: float, s: float) -> tuple[float, float]:
    """Least and greatest coordinate of a rectangle along an axis."""
    x, y, length, width, yaw = box
    along = math.cos(yaw) * c + math.sin(yaw) * s
    half = 0.5 * (length * abs(along) + width * math.sqrt(max(1.0 - along * along, 0.0)))
    middle = x * c + y * s
    return middle - half, middle + half
