"""Conditions of a run under observation: edges, delays, and until when they cannot change."""

from __future__ import annotations

import math

from scenarios.openscenario import model
from scenarios.openscenario.elements import referred
from scenarios.openscenario.running import holding, on_road, own, relative
from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.holding import Holding, Mark
from scenarios.openscenario.running.world import TIME_EPSILON_S, Instant, World


def bare(kind: model.ValueConditionKind | model.EntityCondition, world: World) -> Holding:
    """A condition as read, without edge and delay."""
    match kind:
        case model.EntityCondition():
            return _on_entities(kind, world)
        case model.SimulationTimeCondition():
            return holding.TimeIs(kind)
        case model.TimeOfDayCondition():
            return holding.TimeOfDayIs(kind, world)
        case model.ParameterCondition():
            return holding.ParameterIs(kind, world)
        case model.VariableCondition():
            return holding.VariableIs(kind, world)
        case model.StoryboardElementStateCondition():
            return holding.ElementStateIs(kind, world)
        case model.TrafficSignalCondition() | model.TrafficSignalControllerCondition():
            return holding.SignalIs(kind, world)


def _on_entities(condition: model.EntityCondition, world: World) -> Holding:
    actors = [world.actors[name] for name in condition.entities]
    parts = [(actor, _on_entity(condition.kind, actor, world)) for actor in actors]
    subjects = [world.actors[name] for name in referred(condition.kind)]
    if len(parts) == 1:
        return holding.OnEntity(*parts[0], subjects)
    return holding.OnEntities(parts, condition.every, subjects)


def _on_entity(kind: model.EntityConditionKind, actor: Actor, world: World) -> Holding:
    """The bare condition on one entity that exists, as all that it refers to."""
    match kind:
        case model.SpeedCondition():
            return own.Speed(kind, actor)
        case model.AccelerationCondition():
            return own.Acceleration(kind, actor)
        case model.StandStillCondition():
            return own.StandStill(kind, actor)
        case model.TraveledDistanceCondition():
            return own.TraveledDistance(kind, actor)
        case model.AngleCondition():
            return own.Angle(kind, actor, world)
        case model.ReachPositionCondition():
            return own.ReachPosition(kind, actor, world)
        case model.EndOfRoadCondition():
            return on_road.EndOfRoad(kind.duration_s, actor, world)
        case model.OffroadCondition():
            return on_road.OffRoad(kind.duration_s, actor, world)
        case model.RelativeClearanceCondition():
            return on_road.Clearance(kind, actor, world)
        case model.DistanceCondition():
            place = on_road.PlaceActor(kind.position, world, bool(referred(kind.position)))
            return relative.RelativeDistance(kind, actor, place, world)
        case model.TimeToCollisionCondition(position=position) if position is not None:
            place = on_road.PlaceActor(position, world, bool(referred(position)))
            return relative.TimeToCollision(kind, actor, place, world)
        case model.CollisionCondition(object_type=object_type) if object_type is not None:
            others = [other for other in world.actors.values() if other is not actor]
            alike = [other for other in others if other.definition.object_type == object_type]
            alike = [other for other in alike if not relative.is_driven_over(actor, other)]
            return relative.TouchingAny([(other, relative.Touching(actor, other)) for other in alike])
    assert kind.entity is not None
    other = world.actors[kind.entity]
    match kind:
        case model.CollisionCondition():
            never = other is actor or relative.is_driven_over(actor, other)
            return holding.Fixed(False) if never else relative.Touching(actor, other)
        case model.RelativeAngleCondition():
            return own.Angle(kind, actor, world, other)
        case model.RelativeSpeedCondition():
            return relative.RelativeSpeed(kind, actor, other)
        case model.RelativeDistanceCondition():
            return relative.RelativeDistance(kind, actor, other, world)
        case model.TimeToCollisionCondition():
            return relative.TimeToCollision(kind, actor, other, world)
        case model.TimeHeadwayCondition():
            return relative.TimeHeadway(kind, actor, other, world)


WORTH_S, RETRY_S = 0.02, 0.1
"""Where a condition is settled for less than the first, that is worked out again only after the second."""


class Observed:
    """A bare condition, compared with what it was when the storyboard last did something.

    Args:
        holding: the condition.
    """

    __slots__ = ("_before", "_retry_s", "holding", "settled_s")

    def __init__(self, holding: Holding) -> None:
        self.holding = holding
        self._before: Mark = False
        self._retry_s = -math.inf
        self.settled_s = -math.inf
        """Until when it cannot change."""

    def begin(self, now: Instant) -> None:
        """Take note of its value, with which later ones are compared."""
        self._before = self.holding.mark(now)
        self.unsettle()

    def unsettle(self) -> None:
        """Forget until when it cannot change."""
        self.settled_s = self._retry_s = -math.inf

    def changed(self, instant: Instant) -> bool:
        """Whether it differs from its value at the beginning."""
        return self.holding.mark(instant) != self._before

    def next_s(self, after_s: float) -> float:
        """When it may change by the clock next."""
        time_s = self.holding.next_s()
        return time_s if time_s > after_s else math.inf

    def settle(self, now: Instant) -> None:
        """Find until when it cannot change, unless that was in vain a moment ago."""
        if now.time_s >= self._retry_s:
            self.settled_s = self.holding.settled_s(now)
            if self.settled_s <= now.time_s + WORTH_S:
                self._retry_s = now.time_s + RETRY_S


MOVING = (
    model.EntityCondition
    | model.SimulationTimeCondition
    | model.TimeOfDayCondition
    | model.TrafficSignalCondition
    | model.TrafficSignalControllerCondition
)
"""Conditions that can change while the storyboard does not."""


class Watch(Observed):
    """A condition of a trigger.

    `look` gives what the trigger sees: the edge of the bare condition, later by the delay. A first look at a
    condition is no edge, and neither is a deletion of somebody whom it is about.

    Args:
        condition: as read.
        world: what it refers to.
    """

    __slots__ = (
        "_about", "_delay_s", "_due", "_edge", "_history", "_last", "_met", "_moves", "_parts", "_pulses",
        "_stays", "_there", "varies",
    )  # fmt: skip

    def __init__(self, condition: model.Condition, world: World) -> None:
        super().__init__(bare(condition.kind, world))
        self._edge, self._delay_s = condition.edge, condition.delay_s
        self._stays, self._met = condition.stays, False
        self._last: bool | None = None
        self._history: list[tuple[float, bool]] = []
        self._pulses: list[float] = []
        self._due = False
        self._moves = isinstance(condition.kind, MOVING)
        self._about: list[Actor] = []
        self._parts: list[tuple[str, Holding]] = []
        if isinstance(condition.kind, model.EntityCondition):
            names = (*condition.kind.entities, *sorted(referred(condition.kind.kind)))
            self._about = [world.actors[name] for name in names]
            self._parts = [
                (name, _on_entity(condition.kind.kind, world.actors[name], world))
                for name in condition.kind.entities
            ]
        self._there = [True] * len(self._about)
        self.varies = self._moves or self._delay_s > 0.0
        """Whether it can change while the storyboard does not."""

    # What the trigger sees

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
        """Value at an instant, which becomes part of the history; true for good for one that stays met."""
        if not self._met:
            value = self._seen(instant)
            self._met = self._stays and value
            return value
        return True

    def _seen(self, instant: Instant) -> bool:
        raw = self.holding.holds(instant)
        there = [actor.exists for actor in self._about]
        if there != self._there:
            self._there, self._last = there, None
        before, self._last = self._last, raw
        if self._edge == "none":
            if self._delay_s == 0.0:
                return raw
            if not self._history or raw != self._history[-1][1]:
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

    def triggering(self, instant: Instant) -> list[str]:
        """Triggering entities on which the bare condition holds."""
        return [name for name, part in self._parts if part.holds(instant)]

    def forget(self) -> None:
        """Begin to look again after a time in which nobody did: what changed meanwhile is no edge now."""
        self._last, self._met = None, False

    # Changes between two looks

    def begin(self, now: Instant) -> None:
        """Take note of its value, and of what is due."""
        self.unsettle()
        if self._moves:
            super().begin(now)
        if self._delay_s > 0.0:
            self._due = self.due(now)

    def changed(self, instant: Instant) -> bool:
        """Whether it differs from its value at the beginning, or something is due that was not."""
        if self._moves and self.holding.mark(instant) != self._before:
            return True
        return self._delay_s > 0.0 and self.due(instant) != self._due

    def next_s(self, after_s: float) -> float:
        """When it may change by the clock next, or something that was delayed is due."""
        if self._delay_s == 0.0:
            return super().next_s(after_s)
        times = [time_s + self._delay_s for time_s, _ in self._history]
        times += [time_s + self._delay_s for time_s in self._pulses]
        times.append(super().next_s(after_s))
        return min(time_s for time_s in times if time_s > after_s)

    def settle(self, now: Instant) -> None:
        """Find until when it cannot change."""
        if not self._moves:
            self.settled_s = self.next_s(now.time_s) - TIME_EPSILON_S
        elif self._delay_s == 0.0:
            super().settle(now)
