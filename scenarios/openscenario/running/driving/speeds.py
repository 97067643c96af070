"""Speeds that follow another entity's, and profiles of several speeds."""

from __future__ import annotations

import math

from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.profiles import Piece, SpeedProfile, transition
from scenarios.openscenario.running.actions import LONGITUDINAL, RunningAction, target_speed_mps
from scenarios.openscenario.running.actors import STANDING_MPS, Actor
from scenarios.openscenario.running.world import Instant

CONTROL_S = 0.01
"""How often a speed is chosen that depends on who is driven by a controller."""
NO_CHANGE_MPS = 1e-9
"""Speeds nearer than this are the same: the sum of many pieces is not more exact."""


class ContinuousSpeed(RunningAction[model.SpeedAction]):
    """SpeedAction with a relative target that is continuous: it goes on until something stops it.

    First the speed changes to the target with the dynamics of the file, then it is that of the other entity,
    changed, at every instant. Where the target moves meanwhile, what is left of the change leads to it.
    """

    domains = frozenset({LONGITUDINAL})

    def start(self, time_s: float) -> None:
        """Begin the change."""
        target = self.action.target
        assert isinstance(target, model.RelativeSpeed)
        self._target = target
        self._other = self.world.actors[target.entity]
        if self._other is self.who:
            raise RunError(f"'{self.who.name}' is to keep a speed relative to its own")
        pacer: Actor | None = self._other
        while pacer is not None and pacer is not self.who:
            pacer = pacer.paced_by
        if pacer is not None:
            raise RunError(
                f"'{self.who.name}' is to keep a speed relative to that of '{self._other.name}', which "
                f"follows that of '{self.who.name}'"
            )
        self.who.paced_by = self._other
        self._begin_s, self._goal_mps = time_s, math.nan
        self._changing = self.action.shape != "step"
        self._seen: SpeedProfile | None = None
        self._next_s = time_s
        self._gone_m = self.who.state(time_s).travelled_m
        if self._changing:
            self._change(time_s)
        else:
            self._keep(time_s)

    def ended(self, instant: Instant) -> bool:
        """Never by itself."""
        return False

    def leave(self, time_s: float) -> None:
        """Go on with the present speed."""
        self.who.paced_by = None
        super().leave(time_s)

    def needs(self) -> frozenset[str]:
        """Whose speed it follows."""
        return frozenset({self._target.entity})

    def update(self, instant: Instant) -> bool:
        """Adapt to what the other one does."""
        time_s = instant.time_s
        if self._changing:
            if time_s >= self._profile.end_s - 1e-9:
                self._changing = False
                self._keep(time_s)
                return True
            if abs(target_speed_mps(self._target, self.world, time_s) - self._goal_mps) > STANDING_MPS:
                self._change(time_s)
                return True
            return False
        other = self._other
        if other.tow is None and not other.commanded:
            if other.profile is self._seen:
                return False
        elif time_s < self._next_s - 1e-9:
            return False
        self._keep(time_s)
        return True

    def _change(self, time_s: float) -> None:
        """What is left of the change to the target as it is now."""
        action = self.action
        goal = self._goal_mps = target_speed_mps(self._target, self.world, time_s)
        value = action.value
        if action.dimension == "time":
            value = max(value - (time_s - self._begin_s), 0.0)
        elif action.dimension == "distance":
            value = max(value - (self.who.state(time_s).travelled_m - self._gone_m), 0.0)
        now = self.who.state(time_s).speed_mps
        pieces = transition(action.shape, action.dimension, value, now, goal)
        self._profile = self.drive(time_s, SpeedProfile(time_s, goal, pieces))

    def _keep(self, time_s: float) -> None:
        """The other one's plan, changed; from an instant to the next where it has none."""
        other, target = self._other, self._target
        factor, plus = (target.value, 0.0) if target.is_factor else (1.0, target.value)
        if other.tow is None and not other.commanded:
            self._seen = other.profile
            self.drive(time_s, other.profile.scaled(factor, plus))
            return
        self._seen, self._next_s = None, time_s + CONTROL_S
        now, soon = (other.state(t).speed_mps for t in (time_s, self._next_s))
        piece = Piece(CONTROL_S, factor * now + plus, factor * soon + plus)
        self.drive(time_s, SpeedProfile(time_s, piece.end_mps, (piece,)))


class FollowSpeedProfile(RunningAction[model.SpeedProfileAction]):
    """SpeedProfileAction."""

    domains = frozenset({LONGITUDINAL})

    def start(self, time_s: float) -> None:
        """Set the profile through all speeds."""
        action = self.action
        plus = 0.0 if action.entity is None else self.world.actors[action.entity].state(time_s).speed_mps
        speed = self.who.state(time_s).speed_mps
        pieces: list[Piece] = []
        for number, entry in enumerate(action.entries):
            goal = entry.speed_mps + plus
            if number == 0 and entry.time_s == 0.0 and not action.smooth:
                speed = goal  # a speed that holds from the beginning
                continue
            pieces += changed(speed, goal, entry.time_s, action.constraints, action.smooth)
            speed = pieces[-1].end_mps if pieces else goal
        self._profile = self.drive(time_s, SpeedProfile(time_s, speed, pieces))

    def ended(self, instant: Instant) -> bool:
        """At the last speed."""
        return instant.time_s >= self._profile.end_s - 1e-9


def changed(
    start_mps: float,
    end_mps: float,
    time_s: float | None,
    limits: model.DynamicConstraints,
    smooth: bool,
) -> list[Piece]:
    """Pieces of a change of speed within limits.

    Args:
        start_mps: speed before.
        end_mps: speed after; cut to the greatest one.
        time_s: how long it takes; None: as short as limits allow.
        limits: of speed, acceleration and deceleration, and of how quickly these change.
        smooth: whether the limits hold, and the acceleration is zero at both ends; then a change may take
            longer. Else the speed changes by a straight line, and the limits count where no time is given.
    """
    fastest = math.inf if limits.max_speed_mps is None else limits.max_speed_mps
    end = min(max(end_mps, -fastest), fastest) if smooth else end_mps
    change = end - start_mps
    up, down = limits.max_acceleration_mps2, limits.max_deceleration_mps2
    jerk_up, jerk_down = limits.max_acceleration_rate_mps3, limits.max_deceleration_rate_mps3
    greatest = up if change > 0.0 else down
    if abs(change) < NO_CHANGE_MPS:
        return [Piece(time_s, start_mps, end)] if time_s else []
    if smooth and jerk_up and jerk_down:
        return _within_jerk(
            start_mps, end, time_s, math.inf if greatest is None else greatest, jerk_up, jerk_down
        )
    shortest = abs(change) / greatest if greatest else 0.0
    duration = shortest if time_s is None else max(time_s, shortest) if smooth else time_s
    return [Piece(duration, start_mps, end)] if duration > 0.0 else []


def _within_jerk(
    start_mps: float, end_mps: float, time_s: float | None, greatest: float, jerk_up: float, jerk_down: float
) -> list[Piece]:
    """A change whose acceleration grows from zero, stays, and falls to zero again.

    Its peak a over a time T: |change| = a T - c a^2, where c = (1 / first jerk + 1 / second jerk) / 2.
    """
    size = abs(end_mps - start_mps)
    rising, falling = (jerk_up, jerk_down) if end_mps > start_mps else (jerk_down, jerk_up)
    c = 0.5 * (1.0 / rising + 1.0 / falling)
    shortest = 2.0 * math.sqrt(c * size)
    duration = shortest if time_s is None else max(time_s, shortest)
    # The smaller root, in the form that loses no digits when the change is small.
    peak = min(2.0 * size / (duration + math.sqrt(max(duration**2 - 4.0 * c * size, 0.0))), greatest)
    duration = size / peak + c * peak
    sign = math.copysign(1.0, end_mps - start_mps)
    first, last = peak / rising, peak / falling
    a = start_mps + sign * 0.5 * peak * first
    b = end_mps - sign * 0.5 * peak * last
    return [
        Piece(first, start_mps, a, "rising"),
        Piece(max(duration - first - last, 0.0), a, b),
        Piece(last, b, end_mps, "falling"),
    ]
