"""Bare conditions: whether they hold at an instant, and how soon that can change.

A condition compares quantities with values. Between two instants a quantity changes by no more than its
*reach*: what the motion meanwhile allows. A condition that is the same at both ends of a step can have
changed and changed back only if some quantity is near enough to its value for its reach; then the step is
looked into.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.paths import Pose
from scenarios.openscenario.motion.positions import references
from scenarios.openscenario.reading.parameters import COMPARE, compare
from scenarios.openscenario.running.actors import STANDING_MPS, Actor, State
from scenarios.openscenario.running.world import Instant, World
from smartmot.geometry import signed_gap_scalar

HORIZON_S = 1.0
"""How far ahead a condition is found settled at most, where a controller may change speeds meanwhile."""

EQUAL, EQUAL_S = 1e-6, 2e-9
"""Quantities (times) that differ by less are equal: a quantity that passes a value is equal to it."""

SLACK = 1e-9
"""Reaches below it are rounding."""

TIME_EPSILON_S = 1e-9
"""Times closer than this are the same."""

Mark: TypeAlias = int | tuple["Mark", ...]
"""What a condition comes to; where it changes, the step is split."""

Evaluator: TypeAlias = Callable[[Instant], bool]
Quantity: TypeAlias = Callable[[Instant], float]
Reach: TypeAlias = Callable[[Instant, Instant], float]
Until: TypeAlias = Callable[[Instant], float]


def _unsettled(now: Instant) -> float:
    return now.time_s


@dataclass(frozen=True, slots=True)
class Holding:
    """A bare condition.

    Args:
        holds: whether it holds.
        mark: the same, finer where it also matters which part holds.
        flips: whether it may change and change back between two instants with the same mark; None: never.
        settled_s: until when it cannot change; the instant itself if that is not known.
        next_s: when it may change by the clock, if it can.
    """

    holds: Evaluator
    mark: Callable[[Instant], Mark]
    flips: Callable[[Instant, Instant], bool] | None = None
    settled_s: Until = _unsettled
    next_s: Callable[[], float] | None = None


def holding(kind: model.ValueConditionKind | model.EntityCondition, world: World) -> Holding:
    """A condition as read."""
    match kind:
        case model.EntityCondition():
            return _on_entities(kind, world)
        case model.SimulationTimeCondition():
            return _time(kind)
        case model.ParameterCondition():
            fixed = compare(kind.rule, kind.actual, kind.value)
            return _plain(lambda instant: fixed)
        case model.VariableCondition():
            name, wanted, how = kind.variable, kind.value, kind.rule
            return _plain(lambda instant: compare(how, world.variables[name], wanted))
        case model.StoryboardElementStateCondition():
            element = (kind.kind, kind.path, kind.state)
            return _plain(lambda instant: world.element_state(*element))


def _plain(
    holds: Evaluator, settled_s: Until = _unsettled, next_s: Callable[[], float] | None = None
) -> Holding:
    return Holding(holds, holds, settled_s=settled_s, next_s=next_s)


def _time(kind: model.SimulationTimeCondition) -> Holding:
    value, equal = kind.value, kind.rule in ("equalTo", "notEqualTo")
    rule = COMPARE[kind.rule]

    def holds(instant: Instant) -> bool:
        time_s = instant.time_s
        return rule(value if equal and abs(time_s - value) <= EQUAL_S else time_s, value)

    def mark(instant: Instant) -> int:
        return holds(instant) + 2 * (instant.time_s > value + EQUAL_S) if equal else holds(instant)

    def settled_s(now: Instant) -> float:
        if now.time_s > value + EQUAL_S:
            return math.inf
        return max(value - 2 * EQUAL_S, now.time_s)

    return Holding(holds, mark, settled_s=settled_s)


def _on_entities(kind: model.EntityCondition, world: World) -> Holding:
    """Nothing holds on an entity that is deleted."""
    parts = [
        (world.actors[name], entity_holding(kind.kind, world.actors[name], world)) for name in kind.entities
    ]
    others = [world.actors[name] for name in referred(kind.kind)]
    every = all if kind.every else any

    def there() -> bool:
        return all(other.exists for other in others)

    if len(parts) == 1:
        actor, part = parts[0]
        if not others:
            return Holding(
                lambda instant: actor.exists and part.holds(instant),
                lambda instant: actor.exists and part.mark(instant),
                part.flips,
                part.settled_s,
                part.next_s,
            )
        return Holding(
            lambda instant: actor.exists and there() and part.holds(instant),
            lambda instant: actor.exists and there() and part.mark(instant),
            part.flips,
            lambda now: part.settled_s(now) if actor.exists and there() else math.inf,
            part.next_s,
        )
    clocks = [part.next_s for _, part in parts if part.next_s is not None]
    return Holding(
        lambda instant: there() and every(actor.exists and part.holds(instant) for actor, part in parts),
        lambda instant: there() and tuple(actor.exists and part.mark(instant) for actor, part in parts),
        lambda a, b: any(part.flips is not None and part.flips(a, b) for _, part in parts),
        lambda now: min(part.settled_s(now) for _, part in parts),
        (lambda: min(clock() for clock in clocks)) if clocks else None,
    )


def referred(kind: model.EntityConditionKind) -> frozenset[str]:
    """Entities that a condition refers to beside the triggering ones."""
    match kind:
        case (
            model.CollisionCondition()
            | model.RelativeSpeedCondition()
            | model.RelativeDistanceCondition()
            | model.TimeToCollisionCondition()
            | model.TimeHeadwayCondition()
        ):
            return frozenset({kind.entity})
        case model.ReachPositionCondition():
            return references(kind.position)
    return frozenset()


def entity_holding(kind: model.EntityConditionKind, actor: Actor, world: World) -> Holding:
    """The bare condition on one entity that exists, as all that it refers to."""
    name = actor.name
    match kind:
        case model.CollisionCondition():
            other = world.actors[kind.entity]
            return _plain(lambda instant: False) if other is actor else touching(actor, other)
        case model.StandStillCondition():
            return _stand_still(kind.duration_s, actor)
        case model.TraveledDistanceCondition():
            distance = kind.value
            return _plain(
                lambda instant: instant.state(name).travelled_m >= distance,
                lambda now: _after(
                    now, distance - now.state(name).travelled_m, actor.fastest_mps(now.time_s)
                ),
            )
        case model.AngleCondition():
            angle = kind.angle_rad
            return _compared(
                lambda instant: abs(math.remainder(instant.state(name).yaw_rad - angle, 2 * math.pi)),
                "lessOrEqual",
                kind.tolerance_rad,
                lambda a, b: actor.turn_rad(a.state(name), b.state(name)),
                lambda now: math.inf if actor.rests(now.time_s) else now.time_s,
            )
        case model.ReachPositionCondition():
            return _reach_position(kind, actor, world)
        case model.SpeedCondition() | model.AccelerationCondition():
            return _own(kind, actor)
    other = world.actors[kind.entity]
    match kind:
        case model.RelativeSpeedCondition():
            return _relative_speed(kind, actor, other)
        case model.RelativeDistanceCondition():
            return _distance(kind, actor, other)
        case model.TimeToCollisionCondition():
            return _time_to_collision(kind, actor, other)
        case model.TimeHeadwayCondition():
            return _headway(kind, actor, other)


# Comparisons


def _kept(quantity: Quantity) -> Quantity:
    """The same, worked out once for an instant."""
    key = object()

    def kept(instant: Instant) -> float:
        value: float | None = instant.memo.get(key)
        if value is None:
            value = instant.memo[key] = quantity(instant)
        return value

    return kept


def _compared(
    quantity: Quantity, rule: str, value: float, reach: Reach, settled_s: Until = _unsettled
) -> Holding:
    """A quantity compared with a value. Equality is met where the quantity passes the value."""
    compares, equal = COMPARE[rule], rule in ("equalTo", "notEqualTo")

    def flips(a: Instant, b: Instant) -> bool:
        return abs(quantity(a) - value) + abs(quantity(b) - value) + SLACK < reach(a, b)

    if not equal:

        def holds(instant: Instant) -> bool:
            return compares(quantity(instant), value)

        return Holding(holds, holds, flips, settled_s)

    def side(instant: Instant) -> int:
        differs = quantity(instant) - value
        return 0 if abs(differs) <= EQUAL else 1 if differs > 0.0 else -1

    met = rule == "equalTo"
    return Holding(lambda instant: (side(instant) == 0) == met, side, flips, settled_s)


def _after(now: Instant, left: float, rate: float) -> float:
    """Until when something cannot have shrunk to zero that shrinks at a rate at most."""
    if left <= 0.0:
        return now.time_s
    return now.time_s + (min(left / rate, HORIZON_S) if rate > 0.0 else HORIZON_S)


# Motion between two instants


def _passed(actor: Actor, other: Actor, a: Instant, b: Instant) -> tuple[float, float, float]:
    """How far two reference points can have moved against each other, and how far each entity has turned."""
    one, one_later = a.state(actor.name), b.state(actor.name)
    two, two_later = a.state(other.name), b.state(other.name)
    turn, other_turn = actor.turn_rad(one, one_later), other.turn_rad(two, two_later)
    # velocities depart from their means by no more than they change
    changes = _change(one, one_later, turn) + _change(two, two_later, other_turn)
    dx = (one_later.x_m - one.x_m) - (two_later.x_m - two.x_m)
    dy = (one_later.y_m - one.y_m) - (two_later.y_m - two.y_m)
    return math.hypot(dx, dy) + changes * (b.time_s - a.time_s), turn, other_turn


def _change(state: State, later: State, turn_rad: float) -> float:
    """By how much a velocity can have changed."""
    return abs(later.speed_mps - state.speed_mps) + turn_rad * max(abs(state.speed_mps), abs(later.speed_mps))


def _gap_reach(actor: Actor, other: Actor) -> Reach:
    def reach(a: Instant, b: Instant) -> float:
        passed, turn, other_turn = _passed(actor, other, a, b)
        return passed + turn * actor.radius_m + other_turn * other.radius_m

    return reach


def _apart_m(now: Instant, actor: Actor, other: Actor) -> float:
    one, two = now.state(actor.name), now.state(other.name)
    return math.hypot(one.x_m - two.x_m, one.y_m - two.y_m)


def _both_mps(now: Instant, actor: Actor, other: Actor) -> float:
    return actor.fastest_mps(now.time_s) + other.fastest_mps(now.time_s)


def touching(actor: Actor, other: Actor) -> Holding:
    """Whether two outlines touch or overlap."""
    one, two = actor.name, other.name
    reach = _gap_reach(actor, other)

    def holds(instant: Instant) -> bool:
        return instant.circle_gap_m(one, two) <= 0.0 and instant.gap_m(one, two) <= 0.0

    def flips(a: Instant, b: Instant) -> bool:
        most = reach(a, b)
        if a.circle_gap_m(one, two) + b.circle_gap_m(one, two) >= most:
            return False
        return abs(a.gap_m(one, two)) + abs(b.gap_m(one, two)) + SLACK < most

    def settled_s(now: Instant) -> float:
        return _after(now, now.circle_gap_m(one, two), _both_mps(now, actor, other))

    return Holding(holds, holds, flips, settled_s)


def _stand_still(duration_s: float, actor: Actor) -> Holding:
    least = duration_s - TIME_EPSILON_S

    def holds(instant: Instant) -> bool:
        since = actor.standing_since(instant.time_s, instant.state(actor.name))
        return since is not None and instant.time_s - since >= least

    def next_s() -> float:
        since = actor.standing_since_s
        return math.inf if since is None else since + duration_s

    return _plain(holds, next_s=next_s)


def _reach_position(kind: model.ReachPositionCondition, actor: Actor, world: World) -> Holding:
    position, tolerance, name = kind.position, kind.tolerance_m, actor.name
    leaders = [world.actors[entity] for entity in sorted(references(position))]
    fixed: list[Pose] = []

    def away(instant: Instant) -> float:
        state = instant.state(name)
        if fixed:
            pose = fixed[0]
        elif leaders:
            try:
                pose = world.locator.at(lambda entity: instant.state(entity).pose).pose(position)
            except RunError:  # there is no such place while the other is there
                return math.inf
        else:
            pose = world.locator.pose(position)
            fixed.append(pose)
        return math.hypot(pose.x_m - state.x_m, pose.y_m - state.y_m)

    def reach(a: Instant, b: Instant) -> float:
        one, later = a.state(name), b.state(name)
        seconds = b.time_s - a.time_s
        way = max(abs(one.speed_mps), abs(later.speed_mps)) * seconds
        for leader in leaders:
            start, end = a.state(leader.name), b.state(leader.name)
            # a place beside or ahead of another swings with it, and covers more way outside a bend
            way += 2.0 * max(abs(start.speed_mps), abs(end.speed_mps)) * seconds
            way += leader.turn_rad(start, end) * _offset_m(position)
        return way

    def settled_s(now: Instant) -> float:
        if leaders:
            return now.time_s
        return _after(now, abs(away(now) - tolerance), actor.fastest_mps(now.time_s))

    return _compared(_kept(away), "lessOrEqual", tolerance, reach, settled_s)


def _offset_m(position: model.Position) -> float:
    """How far a place is from the entity that it is relative to."""
    match position:
        case model.RelativeObjectPosition() | model.RelativeWorldPosition():
            return math.hypot(position.dx_m, position.dy_m)
        case model.RelativeLanePosition() | model.RelativeRoadPosition():
            return 0.0  # along the road, whatever the heading
    return 0.0


def _own(kind: model.SpeedCondition | model.AccelerationCondition, actor: Actor) -> Holding:
    """A condition on the own speed or acceleration; within a step a speed only grows or only falls."""
    name, way = actor.name, kind.direction

    def steady_s(now: Instant) -> float:
        return math.inf if actor.steady(now.time_s) else now.time_s

    if isinstance(kind, model.SpeedCondition):
        if way == "longitudinal":
            return _compared(
                lambda instant: instant.state(name).speed_mps, kind.rule, kind.value, _none, steady_s
            )
        if way is None:
            # its amount is smallest where it turns round inside the step
            return _compared(
                lambda instant: abs(instant.state(name).speed_mps),
                kind.rule,
                kind.value,
                lambda a, b: (
                    abs(b.state(name).speed_mps - a.state(name).speed_mps)
                    if a.state(name).speed_mps * b.state(name).speed_mps < 0.0
                    else 0.0
                ),
                steady_s,
            )
        # entities move along their own x axis: nothing is left for the other directions
        return _compared(lambda instant: 0.0, kind.rule, kind.value, _none, lambda now: math.inf)
    bare = _compared(lambda instant: acceleration_mps2(actor, instant, way), kind.rule, kind.value, _none)
    if way == "longitudinal":
        return bare

    def flips(a: Instant, b: Instant) -> bool:
        """In a bend the acceleration follows the curvature, which is looked at every millisecond."""
        if actor.turn_rad(a.state(name), b.state(name)) <= SLACK:
            return False
        count = int((b.time_s - a.time_s) / _MOMENT_S)
        before, step_s = bare.mark(a), (b.time_s - a.time_s) / max(count, 1)
        return any(bare.mark(Instant(a.time_s + k * step_s, a.actors)) != before for k in range(1, count))

    return Holding(bare.holds, bare.mark, flips, bare.settled_s)


def _none(a: Instant, b: Instant) -> float:
    return 0.0


def _relative_speed(kind: model.RelativeSpeedCondition, actor: Actor, other: Actor) -> Holding:
    one, two, along = actor.name, other.name, kind.direction

    def reach(a: Instant, b: Instant) -> float:
        mine, mine_later, its, its_later = a.state(one), b.state(one), a.state(two), b.state(two)
        turn = actor.turn_rad(mine, mine_later) + other.turn_rad(its, its_later) if along else 0.0
        return abs(mine_later.speed_mps - mine.speed_mps) + _change(its, its_later, turn)

    def settled_s(now: Instant) -> float:
        steady = along is None and actor.steady(now.time_s) and other.steady(now.time_s)
        return math.inf if steady else now.time_s

    return _compared(
        lambda instant: relative_speed_mps(instant.state(one), instant.state(two), along),
        kind.rule,
        kind.value,
        reach,
        settled_s,
    )


def _distance_of(actor: Actor, other: Actor, kind: model.Distance, freespace: bool) -> Quantity:
    return _kept(
        lambda instant: signed_distance_m(
            actor, other, instant.state(actor.name), instant.state(other.name), kind, freespace
        )
    )


def _distance_reach(actor: Actor, other: Actor, kind: model.Distance, freespace: bool) -> Reach:
    def reach(a: Instant, b: Instant) -> float:
        passed, turn, other_turn = _passed(actor, other, a, b)
        if freespace:
            passed += turn * actor.radius_m + other_turn * other.radius_m
        if kind != "euclidianDistance" and turn > 0.0:
            # the axis along which it is measured turns with the entity
            spread = max(_apart_m(a, actor, other), _apart_m(b, actor, other))
            passed += turn * (spread + (actor.radius_m + other.radius_m if freespace else 0.0))
        return passed

    return reach


def _nearer_s(
    now: Instant, actor: Actor, other: Actor, kind: model.Distance, freespace: bool, value: float, also: float
) -> float:
    """Until when a distance, whatever the headings, stays on one side of a value that `also` may add to."""
    apart, both = _apart_m(now, actor, other), _both_mps(now, actor, other)
    if not math.isfinite(both):
        return now.time_s
    if apart < value and also == 0.0:
        return _after(now, value - apart, both)
    if kind != "euclidianDistance":
        return now.time_s
    radii = actor.radius_m + other.radius_m if freespace else 0.0
    return _after(now, apart - radii - value - also * both, both)


def _distance(kind: model.RelativeDistanceCondition, actor: Actor, other: Actor) -> Holding:
    how, freespace, value = kind.kind, kind.freespace, kind.value
    signed = _distance_of(actor, other, how, freespace)
    reach = _distance_reach(actor, other, how, freespace)
    bare = _compared(lambda instant: max(signed(instant), 0.0), kind.rule, value, reach)

    def flips(a: Instant, b: Instant) -> bool:
        # how deep two overlap tells how soon they can be apart
        return abs(signed(a) - value) + abs(signed(b) - value) + SLACK < reach(a, b)

    return Holding(
        bare.holds,
        bare.mark,
        flips,
        lambda now: _nearer_s(now, actor, other, how, freespace, value, 0.0),
    )


def _headway(kind: model.TimeHeadwayCondition, actor: Actor, other: Actor) -> Holding:
    """Distance over speed, compared as the distance with that times the speed."""
    how, freespace, value, name = kind.kind, kind.freespace, kind.value, actor.name
    signed = _distance_of(actor, other, how, freespace)
    reach = _distance_reach(actor, other, how, freespace)

    def quantity(instant: Instant) -> float:
        return _headway_s(max(signed(instant), 0.0), abs(instant.state(name).speed_mps))

    def over(instant: Instant) -> float:
        return signed(instant) - value * abs(instant.state(name).speed_mps)

    def flips(a: Instant, b: Instant) -> bool:
        change = abs(b.state(name).speed_mps - a.state(name).speed_mps)
        return abs(over(a)) + abs(over(b)) + SLACK < reach(a, b) + abs(value) * change

    bare = _compared(quantity, kind.rule, value, reach)
    return Holding(
        bare.holds,
        bare.mark,
        flips,
        lambda now: _nearer_s(now, actor, other, how, freespace, 0.0, max(value, 0.0)),
    )


def _time_to_collision(kind: model.TimeToCollisionCondition, actor: Actor, other: Actor) -> Holding:
    """Distance over the speed at which it shrinks; where that is not positive the condition does not hold."""
    how, freespace, value = kind.kind, kind.freespace, kind.value
    one, two = actor.name, other.name
    reach = _distance_reach(actor, other, how, freespace)
    equal = kind.rule in ("equalTo", "notEqualTo")
    rule, upwards = COMPARE[kind.rule], kind.rule not in ("lessThan", "lessOrEqual")

    def closing(instant: Instant) -> tuple[float, float]:
        """The distance, and the speed at which it shrinks."""
        a, b = instant.state(one), instant.state(two)

        def apart_m(time_s: float) -> float:
            return distance_m(actor, other, _moved(a, time_s), _moved(b, time_s), how, freespace)

        return apart_m(0.0), (apart_m(-_BRIEFLY_S) - apart_m(_BRIEFLY_S)) / (2.0 * _BRIEFLY_S)

    def side(instant: Instant) -> int:
        """2 and more: it shrinks; then whether the time is below, at or above the value."""
        apart, speed = closing(instant)
        if speed <= STANDING_MPS:
            return 0
        differs = apart / speed - value
        return 3 if abs(differs) <= EQUAL else 4 if differs > 0.0 else 2

    def holds(instant: Instant) -> bool:
        if equal:
            found = side(instant)
            return found > 0 and (found == 3) == (kind.rule == "equalTo")
        apart, speed = closing(instant)
        return speed > STANDING_MPS and rule(apart / speed, value)

    def flips(a: Instant, b: Instant) -> bool:
        (apart, speed), (apart_later, speed_later) = closing(a), closing(b)
        most, seconds = reach(a, b), b.time_s - a.time_s
        _, turn, other_turn = _passed(actor, other, a, b)
        changes = _change(a.state(one), b.state(one), turn) + _change(a.state(two), b.state(two), other_turn)
        near = min(apart, apart_later) - most
        if near <= 0.0:
            # where they meet, the direction in which they approach can be any: look every millisecond
            return seconds > _MOMENT_S
        rate = most / seconds
        bend = changes + rate * (turn + other_turn)
        bend += rate * most / near if how == "euclidianDistance" else 0.0
        over = abs(apart - value * speed) + abs(apart_later - value * speed_later)
        if over + SLACK < most + abs(value) * bend:
            return True
        return upwards and seconds > _MOMENT_S and abs(speed) + abs(speed_later) + SLACK < bend

    def settled_s(now: Instant) -> float:
        if upwards:  # it also begins to hold where they begin to approach each other, however far apart
            return now.time_s
        return _nearer_s(now, actor, other, how, freespace, 0.0, max(value, 0.0))

    return Holding(
        holds,
        side if equal else holds,
        flips,
        settled_s,
    )


def _headway_s(distance_m: float, speed_mps: float) -> float:
    return distance_m / speed_mps if speed_mps > STANDING_MPS else math.inf


_MOMENT_S, _BRIEFLY_S = 1e-3, 1e-5
"""Over which rates of change are taken: of velocities, and of distances."""


def _moved(state: State, time_s: float) -> State:
    """Where an entity would be that goes straight on at its speed."""
    way_m = state.speed_mps * time_s
    x_m, y_m = state.x_m + way_m * math.cos(state.yaw_rad), state.y_m + way_m * math.sin(state.yaw_rad)
    return state._replace(x_m=x_m, y_m=y_m)


def relative_speed_mps(a: State, b: State, direction: model.Direction | None) -> float:
    """Velocity of a minus that of b in a direction of a; without direction the difference of their speeds."""
    if direction is None:
        return abs(a.speed_mps) - abs(b.speed_mps)
    turn = b.yaw_rad - a.yaw_rad
    if direction == "longitudinal":
        return a.speed_mps - b.speed_mps * math.cos(turn)
    return -b.speed_mps * math.sin(turn) if direction == "lateral" else 0.0


def acceleration_mps2(actor: Actor, instant: Instant, direction: model.Direction | None) -> float:
    """Acceleration of an entity in a direction of it, or its amount, from its velocities within a moment."""
    now, soon = instant.state(actor.name), actor.state(instant.time_s + _MOMENT_S)
    turn = soon.yaw_rad - now.yaw_rad
    along = (soon.speed_mps * math.cos(turn) - now.speed_mps) / _MOMENT_S
    left = soon.speed_mps * math.sin(turn) / _MOMENT_S
    if direction is None:
        return math.hypot(along, left)
    return {"longitudinal": along, "lateral": left, "vertical": 0.0}[direction]


def distance_m(
    actor: Actor, other: Actor, a: State, b: State, kind: model.Distance, freespace: bool
) -> float:
    """Distance of two entities in the states a and b, never negative, in the frame of the first.

    Between reference points, or, if `freespace`, between outlines: for `longitudinal` and `lateral` between
    their extents along that axis (0 where these overlap).
    """
    return max(signed_distance_m(actor, other, a, b, kind, freespace), 0.0)


def signed_distance_m(
    actor: Actor, other: Actor, a: State, b: State, kind: model.Distance, freespace: bool
) -> float:
    """The same, negative where outlines (or their extents) overlap: by how far."""
    if kind == "euclidianDistance":
        if freespace:
            return signed_gap_scalar(actor.box(a), other.box(b))
        return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m)
    c, s = math.cos(a.yaw_rad), math.sin(a.yaw_rad)
    if kind == "lateral":
        c, s = -s, c
    if not freespace:
        return abs((b.x_m - a.x_m) * c + (b.y_m - a.y_m) * s)
    (low_a, high_a), (low_b, high_b) = (
        _extent(actor.box(a), c, s), _extent(other.box(b), c, s)
    )  # fmt: skip
    return max(low_b - high_a, low_a - high_b)


def _extent(box: tuple[float, float, float, float, float], c: float, s: float) -> tuple[float, float]:
    """Least and greatest coordinate of a rectangle along an axis."""
    x, y, length, width, yaw = box
    along = math.cos(yaw) * c + math.sin(yaw) * s
    half = 0.5 * (length * abs(along) + width * math.sqrt(max(1.0 - along * along, 0.0)))
    middle = x * c + y * s
    return middle - half, middle + half
