"""Conditions of a run: their value at an instant, edges and delays."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

from scenarios.openscenario import model
from scenarios.openscenario.actors import STANDING_MPS, Actor, State
from scenarios.openscenario.parameters import COMPARE, compare
from scenarios.openscenario.paths import Pose
from scenarios.openscenario.positions import references
from scenarios.openscenario.world import Instant, World
from smartmot.geometry import signed_gap_scalar

TIME_EPSILON_S = 1e-9
"""Times closer than this are the same."""


class Watch:
    """One condition under observation.

    `raw` is the bare condition; `look` gives what the trigger sees: its edge, later by the delay. A first
    look at a condition is no edge.

    Args:
        condition: as read.
        world: what it refers to.
    """

    __slots__ = ("_delay_s", "_edge", "_history", "_last", "_pulses", "raw", "varies")

    def __init__(self, condition: model.Condition, world: World) -> None:
        self.raw = evaluator(condition.kind, world)
        self._edge, self._delay_s = condition.edge, condition.delay_s
        self._last: bool | None = None
        self._history: list[tuple[float, bool]] = []
        self._pulses: list[float] = []
        moves = isinstance(condition.kind, model.EntityCondition | model.SimulationTimeCondition)
        self.varies = moves or self._delay_s > 0.0
        """Whether it can change while the storyboard does not."""

    def due(self, instant: Instant) -> bool:
        """Whether something that was delayed is due at a time."""
        latest = instant.time_s - self._delay_s + TIME_EPSILON_S
        if self._edge != "none":
            return any(pulse <= latest for pulse in self._pulses)
        value = False
        for time_s, state in self._history:
            if time_s > latest:
                break
            value = state
        return value

    def look(self, instant: Instant) -> bool:
        """Value at an instant, which becomes part of the history."""
        raw = self.raw(instant)
        before, self._last = self._last, raw
        if self._edge == "none":
            if self._delay_s == 0.0:
                return raw
            if raw != before:
                self._history.append((instant.time_s, raw))
            return self.due(instant)
        rose, fell = before is False and raw, before is True and not raw
        fired = {"rising": rose, "falling": fell, "risingOrFalling": rose or fell}[self._edge]
        if self._delay_s == 0.0:
            return fired
        if fired:
            self._pulses.append(instant.time_s)
        due = self.due(instant)
        latest = instant.time_s - self._delay_s + TIME_EPSILON_S
        self._pulses = [pulse for pulse in self._pulses if pulse > latest]
        return due

    def signature(self, instant: Instant) -> int:
        """What may change between two looks, as a number: the bare condition, and what is due."""
        return self.raw(instant) + (2 * self.due(instant) if self._delay_s > 0.0 else 0)


Evaluator: TypeAlias = Callable[[Instant], bool]


def evaluator(kind: model.ValueConditionKind | model.EntityCondition, world: World) -> Evaluator:
    """The bare condition as a function of an instant."""
    match kind:
        case model.EntityCondition():
            parts = [
                (world.actors[name], entity_evaluator(kind.kind, world.actors[name], world))
                for name in kind.entities
            ]
            others = [world.actors[name] for name in referred(kind.kind)]
            every = all if kind.every else any
            if len(parts) == 1 and not others:
                actor, holds = parts[0]
                return lambda instant: actor.exists and holds(instant)
            return lambda instant: (
                all(other.exists for other in others)
                and every(actor.exists and holds(instant) for actor, holds in parts)
            )
        case model.SimulationTimeCondition():
            rule, value = COMPARE[kind.rule], kind.value
            return lambda instant: rule(instant.time_s, value)
        case model.ParameterCondition():
            fixed = compare(kind.rule, kind.actual, kind.value)
            return lambda instant: fixed
        case model.VariableCondition():
            name, wanted, how = kind.variable, kind.value, kind.rule
            return lambda instant: compare(how, world.variables[name], wanted)
        case model.StoryboardElementStateCondition():
            element = (kind.kind, kind.path, kind.state)
            return lambda instant: world.element_state(*element)


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


def entity_evaluator(kind: model.EntityConditionKind, actor: Actor, world: World) -> Evaluator:
    """The bare condition on one entity as a function of an instant."""
    name = actor.name
    match kind:
        case model.CollisionCondition():
            other = world.actors[kind.entity]
            return lambda instant: (
                other is not actor
                and instant.circle_gap_m(name, other.name) <= 0.0
                and instant.gap_m(name, other.name) <= 0.0
            )
        case model.StandStillCondition():
            duration = kind.duration_s - TIME_EPSILON_S
            return lambda instant: (
                abs(instant.state(name).speed_mps) <= STANDING_MPS
                and actor.standing_since_s is not None
                and instant.time_s - actor.standing_since_s >= duration
            )
        case model.TraveledDistanceCondition():
            distance = kind.value
            return lambda instant: instant.state(name).travelled_m >= distance
        case model.AngleCondition():
            angle, tolerance = kind.angle_rad, kind.tolerance_rad
            return lambda instant: (
                abs(math.remainder(instant.state(name).yaw_rad - angle, 2 * math.pi)) <= tolerance
            )
        case model.ReachPositionCondition():
            position, reach = kind.position, kind.tolerance_m
            return lambda instant: _away_m(instant.state(name), world.locator.pose(position)) <= reach
        case model.TimeToCollisionCondition():
            return _time_to_collision(kind, actor, world)
    quantity = _quantity(kind, actor, world)
    rule, value = COMPARE[kind.rule], kind.value
    return lambda instant: rule(quantity(instant), value)


def _away_m(state: State, pose: Pose) -> float:
    return math.hypot(pose.x_m - state.x_m, pose.y_m - state.y_m)


def _quantity(
    kind: model.SpeedCondition
    | model.RelativeSpeedCondition
    | model.AccelerationCondition
    | model.RelativeDistanceCondition
    | model.TimeHeadwayCondition,
    actor: Actor,
    world: World,
) -> Callable[[Instant], float]:
    """What a condition compares with its value."""
    name = actor.name
    match kind:
        case model.SpeedCondition(direction="longitudinal"):
            return lambda instant: instant.state(name).speed_mps
        case model.SpeedCondition(direction=None):
            return lambda instant: abs(instant.state(name).speed_mps)
        case model.SpeedCondition():
            # entities move along their own x axis: nothing is left for the other directions
            return lambda instant: 0.0
        case model.AccelerationCondition():
            way = kind.direction
            return lambda instant: acceleration_mps2(actor, instant, way)
    other = world.actors[kind.entity]
    match kind:
        case model.RelativeSpeedCondition():
            along = kind.direction
            return lambda instant: relative_speed_mps(instant.state(name), instant.state(other.name), along)
        case model.RelativeDistanceCondition():
            how, freespace = kind.kind, kind.freespace
            return lambda instant: distance_m(
                actor, other, instant.state(name), instant.state(other.name), how, freespace
            )
        case model.TimeHeadwayCondition():
            line, clear = kind.kind, kind.freespace
            return lambda instant: _headway_s(
                distance_m(actor, other, instant.state(name), instant.state(other.name), line, clear),
                abs(instant.state(name).speed_mps),
            )


def _headway_s(distance_m: float, speed_mps: float) -> float:
    return distance_m / speed_mps if speed_mps > STANDING_MPS else math.inf


def _time_to_collision(kind: model.TimeToCollisionCondition, actor: Actor, world: World) -> Evaluator:
    """Distance over the speed at which it shrinks; where that is not positive the condition does not hold."""
    other = world.actors[kind.entity]
    rule, value, how, freespace = COMPARE[kind.rule], kind.value, kind.kind, kind.freespace

    def holds(instant: Instant) -> bool:
        a, b = instant.state(actor.name), instant.state(other.name)

        def apart_m(time_s: float) -> float:
            return distance_m(actor, other, _moved(a, time_s), _moved(b, time_s), how, freespace)

        closing_mps = (apart_m(-_MOMENT_S) - apart_m(_MOMENT_S)) / (2.0 * _MOMENT_S)
        return closing_mps > STANDING_MPS and rule(apart_m(0.0) / closing_mps, value)

    return holds


_MOMENT_S = 1e-3
"""Over which rates of change are taken."""


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
    if kind == "euclidianDistance":
        if freespace:
            return max(signed_gap_scalar(actor.box(a), other.box(b)), 0.0)
        return math.hypot(a.x_m - b.x_m, a.y_m - b.y_m)
    c, s = math.cos(a.yaw_rad), math.sin(a.yaw_rad)
    if kind == "lateral":
        c, s = -s, c
    if not freespace:
        return abs((b.x_m - a.x_m) * c + (b.y_m - a.y_m) * s)
    (low_a, high_a), (low_b, high_b) = (
        _extent(actor.box(a), c, s), _extent(other.box(b), c, s)
    )  # fmt: skip
    return max(low_b - high_a, low_a - high_b, 0.0)


def _extent(box: tuple[float, float, float, float, float], c: float, s: float) -> tuple[float, float]:
    """Least and greatest coordinate of a rectangle along an axis."""
    x, y, length, width, yaw = box
    along = math.cos(yaw) * c + math.sin(yaw) * s
    half = 0.5 * (length * abs(along) + width * math.sqrt(max(1.0 - along * along, 0.0)))
    middle = x * c + y * s
    return middle - half, middle + half
