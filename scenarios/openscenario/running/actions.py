"""Actions of a run: what starts them, and until when they go on."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from typing import Generic, TypeVar

from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.expressions import Value
from scenarios.openscenario.motion.profiles import SpeedProfile, transition
from scenarios.openscenario.reading.document import as_number
from scenarios.openscenario.running.actors import Actor, State
from scenarios.openscenario.running.world import TIME_EPSILON_S, Clock, Instant, World

LONGITUDINAL, LATERAL = "longitudinal", "lateral"

ASKED = ("a speed of", "an acceleration of", "a deceleration of")
UNITS = ("m/s", "m/s2", "m/s2")
PERFORMANCE_ROUNDED = 1e-6
"""Share by which rounding may exceed a limit without a note."""

ActionT_co = TypeVar("ActionT_co", bound=model.Action, covariant=True)


class RunningAction(ABC, Generic[ActionT_co]):
    """An action of one entity (or of none). Those that end at once are over when `start` returns.

    Args:
        world: what it acts on.
        actor: who carries it out; None: a global action.
        action: as read.
    """

    domains: frozenset[str] = frozenset()
    """Actions that share an entity and a domain replace each other."""

    outlasts_routes = False
    """Whether a route that is assigned meanwhile waits until it is over."""

    goes_on = False
    """Whether `update` leaves place and speed at its instant as they are, and changes only later ones."""

    def __init__(self, world: World, actor: Actor | None, action: ActionT_co) -> None:
        self.world, self.actor, self.action = world, actor, action
        self.over = self.stopped = False

    @abstractmethod
    def start(self, time_s: float) -> None:
        """Begin."""

    def ended(self, instant: Instant) -> bool:
        """Whether it has come to its end by itself at an instant."""
        return True

    def update(self, instant: Instant) -> bool:
        """Adapt at the beginning of a step; whether something is new. Most actions have nothing to adapt."""
        return False

    @property
    def adapts(self) -> bool:
        """Whether `update` has anything to do."""
        return type(self).update is not RunningAction.update

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
        """Let go of the entity before the end: a speed that the action sets stays as it is now."""
        if LONGITUDINAL in self.domains:
            self.who.keep_speed(time_s)

    def drive(self, time_s: float, profile: SpeedProfile, state: State | None = None) -> SpeedProfile:
        """Give the entity a speed profile, within its Performance if that is to be applied; the one it has.

        A profile that asks for more is noted. `state` is that of the entity now, if it is known.
        """
        who, limits = self.who, self.who.definition.performance
        if limits is not None:
            allowed = (limits.max_speed_mps, limits.max_acceleration_mps2, limits.max_deceleration_mps2)
            for asked, most, unit, what in zip(profile.demands(), allowed, UNITS, ASKED, strict=True):
                if asked > most * (1.0 + PERFORMANCE_ROUNDED):
                    self.world.note(
                        f"the file asks for {asked:.3g} {unit} of '{who.name}' ({who.definition.model}), "
                        f"whose Performance allows {what} {most:.3g}"
                        + (": limited to that" if self.world.apply_performance else ""),
                        (who.name, what),
                        asked,
                    )
            if self.world.apply_performance:
                profile = profile.limited(limits)
        who.drive(time_s, profile, state)
        return profile

    @property
    def who(self) -> Actor:
        """The entity that carries it out."""
        assert self.actor is not None
        return self.actor


class Speed(RunningAction[model.SpeedAction]):
    """SpeedAction."""

    domains = frozenset({LONGITUDINAL})

    def start(self, time_s: float) -> None:
        """Set the profile that leads to the target speed."""
        action, now = self.action, self.who.state(time_s).speed_mps
        target = target_speed_mps(action.target, self.world, time_s)
        self._for_ever = action.shape != "step" and action.dimension == "rate" and action.value == 0.0
        if self._for_ever and target != now:  # at a rate of 0 the speed never comes to its target
            self._profile = self.drive(time_s, SpeedProfile(time_s, now))
            self.world.note(
                f"'{self.who.name}' is to change its speed at a rate of 0: it keeps {now:.4g} m/s"
            )
            return
        self._for_ever = False
        self._start_s, self._start_m = time_s, self.who.state(time_s).travelled_m
        pieces = transition(action.shape, action.dimension, action.value, now, target)
        self._profile = self.drive(time_s, SpeedProfile(time_s, target, pieces))

    def ended(self, instant: Instant) -> bool:
        """At the target speed, and after the time or the way of a step that lasts."""
        action = self.action
        if action.lasts and action.dimension == "distance":
            return instant.state(self.who.name).travelled_m - self._start_m >= action.value - 1e-9
        if action.lasts:
            return instant.time_s >= self._start_s + action.value - 1e-9
        return not self._for_ever and instant.time_s >= self._profile.end_s - 1e-9


class Animation(RunningAction[model.AnimationAction]):
    """AnimationAction: nothing moves, and it is over after its duration, if it is not repeated."""

    def start(self, time_s: float) -> None:
        """Take note of the time."""
        self._end_s = math.inf if self.action.loop else time_s + self.action.duration_s

    def ended(self, instant: Instant) -> bool:
        """After its duration."""
        return instant.time_s >= self._end_s - TIME_EPSILON_S


class Switch(RunningAction[model.Action]):
    """Actions that change a value and are over: visibility, light, environment, variables, deletion."""

    def start(self, time_s: float) -> None:
        """Change it."""
        world, action = self.world, self.action
        match action:
            case model.VisibilityAction():
                self.who.seen = action.sensors
            case model.LightStateAction():
                self.who.lights = {**self.who.lights, action.light: action.mode}
            case model.EnvironmentAction():
                world.environment = action.environment
                if action.environment.time_of_day_s is not None:
                    world.clock = Clock(
                        time_s, action.environment.time_of_day_s, action.environment.time_goes_on
                    )
            case model.DeleteEntityAction():
                for actor in world.actors[action.entity].towed():
                    actor.exists = False
                world.actors[action.entity].uncouple(time_s)
                world.actors[action.entity].leave_scene(time_s)
            case model.SetParameterAction():
                world.parameters[action.parameter] = action.value
            case model.ModifyParameterAction():
                value = modified(
                    world.parameters[action.parameter], action, f"parameter '{action.parameter}'"
                )
                world.parameters[action.parameter] = value
            case model.SignalStateAction():
                world.signals.set_state(action.signal, action.state, time_s)
            case model.SignalPhaseAction():
                world.signals.set_phase(action.controller, action.phase, time_s)
            case model.SetMonitorAction():
                pass  # nothing in the scenario reads it
            case model.SetVariableAction():
                world.variables[action.variable] = action.value
            case model.ModifyVariableAction():
                value = modified(world.variables[action.variable], action, f"variable '{action.variable}'")
                world.variables[action.variable] = value
            case _:
                raise RunError(f"{type(action).__name__} is not carried out")


def modified(
    value: Value, action: model.ModifyVariableAction | model.ModifyParameterAction, name: str
) -> float:
    """A value after an action.

    Raises:
        RunError: it is not a number.
    """
    before = as_number(value)
    if before is None:
        raise RunError(f"{name} is not a number and cannot be modified")
    return before + action.value if action.operator == "add" else before * action.value


def target_speed_mps(target: float | model.RelativeSpeed, world: World, time_s: float) -> float:
    """Speed that an action asks for, at a time."""
    if isinstance(target, model.RelativeSpeed):
        other = world.actors[target.entity].state(time_s).speed_mps
        return other * target.value if target.is_factor else other + target.value
    return target
