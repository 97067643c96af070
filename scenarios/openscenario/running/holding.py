"""Bare conditions: whether they hold at an instant, and how soon that can change.

A condition compares quantities with values. Between two instants a quantity changes by no more than its
*reach*: what the motion meanwhile allows. A condition that is the same at both ends of a step can have
changed and changed back only if some quantity is near enough to its value for its reach; then the step is
looked into.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import TypeAlias

from scenarios.openscenario import model
from scenarios.openscenario.reading.parameters import COMPARE, compare
from scenarios.openscenario.running.actors import Actor
from scenarios.openscenario.running.world import Instant, World

HORIZON_S = 1.0
"""How far ahead a condition is settled at most, where a controller may change speeds meanwhile."""

EQUAL, EQUAL_S = 1e-6, 2e-9
"""Quantities (times) that differ by less are equal: a quantity that passes a value is equal to it."""

SLACK = 1e-9
"""Reaches below it are rounding."""

EQUALITIES = ("equalTo", "notEqualTo")

Mark: TypeAlias = int | tuple["Mark", ...]
"""What a condition comes to; where it changes, the step is split."""


class Holding(ABC):
    """A bare condition; without methods of its own one of which nothing is known beforehand."""

    @abstractmethod
    def holds(self, instant: Instant) -> bool:
        """Whether it holds."""

    def mark(self, instant: Instant) -> Mark:
        """The same, finer where it also matters which part holds."""
        return self.holds(instant)

    def flips(self, a: Instant, b: Instant) -> bool:
        """Whether it may change and change back between two instants with the same mark."""
        return False

    def settled_s(self, now: Instant) -> float:
        """Until when it cannot change; the instant itself if that is not known."""
        return now.time_s

    def next_s(self) -> float:
        """When it may change by the clock; infinite if it cannot."""
        return math.inf


# Conditions on values


class Fixed(Holding):
    """What never changes: parameters do not, and nobody collides with itself."""

    def __init__(self, value: bool) -> None:
        self._value = value

    def holds(self, instant: Instant) -> bool:
        """As always."""
        return self._value


class ParameterIs(Holding):
    """ParameterCondition."""

    def __init__(self, condition: model.ParameterCondition, world: World) -> None:
        self._condition, self._world = condition, world

    def holds(self, instant: Instant) -> bool:
        """Whether the rule holds for the present value."""
        condition = self._condition
        actual = self._world.parameters.get(condition.parameter, condition.actual)
        return compare(condition.rule, actual, condition.value)


class SignalIs(Holding):
    """TrafficSignalCondition and TrafficSignalControllerCondition."""

    def __init__(
        self, condition: model.TrafficSignalCondition | model.TrafficSignalControllerCondition, world: World
    ) -> None:
        self._condition, self._signals = condition, world.signals
        self._seen_s = 0.0

    def holds(self, instant: Instant) -> bool:
        """Whether the signal shows the state, or the controller is in the phase."""
        condition, self._seen_s = self._condition, instant.time_s
        if isinstance(condition, model.TrafficSignalCondition):
            return self._signals.state(condition.signal, instant.time_s) == condition.state
        return self._signals.phase(condition.controller, instant.time_s) == condition.phase

    def next_s(self) -> float:
        """The end of the next phase."""
        return self._signals.next_change_s(self._seen_s)


class VariableIs(Holding):
    """VariableCondition."""

    def __init__(self, condition: model.VariableCondition, world: World) -> None:
        self._condition, self._world = condition, world

    def holds(self, instant: Instant) -> bool:
        """Whether the rule holds for the present value."""
        condition = self._condition
        return compare(condition.rule, self._world.variables[condition.variable], condition.value)


class ElementStateIs(Holding):
    """StoryboardElementStateCondition."""

    def __init__(self, condition: model.StoryboardElementStateCondition, world: World) -> None:
        self._condition, self._world = condition, world

    def holds(self, instant: Instant) -> bool:
        """Whether the element is in the state, or has just made the transition."""
        condition = self._condition
        return self._world.element_state(condition.kind, condition.path, condition.state)


class TimeIs(Holding):
    """SimulationTimeCondition."""

    def __init__(self, condition: model.SimulationTimeCondition) -> None:
        self._value, self._equality = condition.value, condition.rule in EQUALITIES
        self._compare = COMPARE[condition.rule]

    def holds(self, instant: Instant) -> bool:
        """Whether the rule holds for the time."""
        time_s, value = instant.time_s, self._value
        return self._compare(value if self._equality and abs(time_s - value) <= EQUAL_S else time_s, value)

    def mark(self, instant: Instant) -> Mark:
        """For an equality also whether the time has passed."""
        holds = self.holds(instant)
        return holds + 2 * (instant.time_s > self._value + EQUAL_S) if self._equality else holds

    def settled_s(self, now: Instant) -> float:
        """Until the time comes; for ever when it has passed."""
        if now.time_s > self._value + EQUAL_S:
            return math.inf
        return max(self._value - 2 * EQUAL_S, now.time_s)


class TimeOfDayIs(TimeIs):
    """TimeOfDayCondition; without a time of day it does not hold."""

    def __init__(self, condition: model.TimeOfDayCondition, world: World) -> None:
        super().__init__(model.SimulationTimeCondition(condition.rule, math.inf))
        self._asked_s, self._world = condition.value_s, world

    def holds(self, instant: Instant) -> bool:
        """Whether the rule holds for the time of day."""
        clock = self._world.clock
        if clock is None:
            return False
        if not clock.goes_on:
            return self._compare(clock.day_s, self._asked_s)
        self._value = clock.since_s + self._asked_s - clock.day_s
        return super().holds(instant)

    def settled_s(self, now: Instant) -> float:
        """Until the time comes; for ever where there is no time of day that goes on."""
        clock = self._world.clock
        return super().settled_s(now) if clock is not None and clock.goes_on else math.inf


# Conditions on entities


class Compared(Holding):
    """A quantity compared with a value. Equality is met where the quantity passes the value."""

    def __init__(self, rule: str, value: float) -> None:
        self._rule, self._value = rule, value
        self._compare, self._equality = COMPARE[rule], rule in EQUALITIES

    @abstractmethod
    def quantity(self, instant: Instant) -> float:
        """What is compared."""

    def reach(self, a: Instant, b: Instant) -> float:
        """How much the quantity can have changed between two instants beyond what it shows at both."""
        return 0.0

    def _side(self, instant: Instant) -> int:
        differs = self.quantity(instant) - self._value
        return 0 if abs(differs) <= EQUAL else 1 if differs > 0.0 else -1

    def holds(self, instant: Instant) -> bool:
        """Whether the rule holds."""
        if self._equality:
            return (self._side(instant) == 0) == (self._rule == "equalTo")
        return self._compare(self.quantity(instant), self._value)

    def mark(self, instant: Instant) -> Mark:
        """For an equality also on which side of the value the quantity is."""
        if self._equality:
            return self._side(instant)
        return self._compare(self.quantity(instant), self._value)

    def flips(self, a: Instant, b: Instant) -> bool:
        """Whether the quantity can have come to its value and gone back: the reach covers both ways."""
        value = self._value
        both_ways = abs(self.quantity(a) - value) + abs(self.quantity(b) - value)
        return both_ways + SLACK < self.reach(a, b)


def settled_for_s(now: Instant, left: float, rate: float) -> float:
    """Until when something cannot have shrunk to zero that shrinks at a rate at most."""
    if left <= 0.0:
        return now.time_s
    return now.time_s + (min(left / rate, HORIZON_S) if rate > 0.0 else HORIZON_S)


def _exist(actors: Sequence[Actor]) -> bool:
    for actor in actors:  # noqa: SIM110 - asked at each step, where a generator costs twice
        if not actor.exists:
            return False
    return True


class OnEntity(Holding):
    """A condition on one triggering entity; nothing holds on an entity that is deleted.

    Args:
        actor: the triggering entity.
        condition: the condition on it.
        referred: the entities that the condition refers to beside it.
    """

    def __init__(self, actor: Actor, condition: Holding, referred: Sequence[Actor]) -> None:
        self._about, self._condition, self._refers = (actor, *referred), condition, bool(referred)

    def holds(self, instant: Instant) -> bool:
        """Whether it holds on the entity."""
        return _exist(self._about) and self._condition.holds(instant)

    def mark(self, instant: Instant) -> Mark:
        """That of the condition."""
        for actor in self._about:  # as `_exist`, which would be called at each step
            if not actor.exists:
                return False
        return self._condition.mark(instant)

    def flips(self, a: Instant, b: Instant) -> bool:
        """That of the condition."""
        return self._condition.flips(a, b)

    def next_s(self) -> float:
        """That of the condition."""
        return self._condition.next_s()

    def settled_s(self, now: Instant) -> float:
        """That of the condition; for ever where an entity is missing that it refers to."""
        if self._refers and not _exist(self._about):
            return math.inf
        return self._condition.settled_s(now)


class OnEntities(Holding):
    """A condition on several triggering entities: any or all of them.

    Args:
        parts: each triggering entity with the condition on it.
        every: whether all have to meet it.
        referred: the entities that the condition refers to beside them.
    """

    def __init__(
        self, parts: Sequence[tuple[Actor, Holding]], every: bool, referred: Sequence[Actor]
    ) -> None:
        self._parts, self._every, self._referred = parts, every, referred

    def holds(self, instant: Instant) -> bool:
        """Whether it holds on enough of them."""
        # all are asked, so that those that have to last know when they began
        each = [actor.exists and condition.holds(instant) for actor, condition in self._parts]
        return _exist(self._referred) and (all(each) if self._every else any(each))

    def mark(self, instant: Instant) -> Mark:
        """On which it holds."""
        return _exist(self._referred) and tuple(
            actor.exists and condition.mark(instant) for actor, condition in self._parts
        )

    def flips(self, a: Instant, b: Instant) -> bool:
        """Whether it may on one of them."""
        return any(condition.flips(a, b) for _, condition in self._parts)

    def settled_s(self, now: Instant) -> float:
        """As long as on all of them."""
        return min(condition.settled_s(now) for _, condition in self._parts)

    def next_s(self) -> float:
        """The first of them."""
        return min(condition.next_s() for _, condition in self._parts)
