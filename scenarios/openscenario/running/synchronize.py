"""SynchronizeAction: speed profiles that bring an entity to a place at a time with a speed.

The approach has two parts: first the speed changes to the final one, then (the steady state) it is kept for
the rest of the way. In the first part the entity changes its speed with accelerations of one size: to an
extreme and back, or, where that would mean driving backwards, to a standstill, a wait, and on. Where the
extreme would lie beyond the final speed, it reaches this one earlier and keeps it, if that covers the way
with an acceleration that is possible.
"""

from __future__ import annotations

import math

from scenarios.openscenario import model
from scenarios.openscenario.motion.paths import Path
from scenarios.openscenario.motion.profiles import Piece, SpeedProfile
from scenarios.openscenario.running.actions import LONGITUDINAL, RunningAction, target_speed_mps
from scenarios.openscenario.running.actors import STANDING_MPS, Actor
from scenarios.openscenario.running.world import Instant, World

_SMALL = 1e-9

MOST_MPS2 = 9.81
"""Who would have to change its speed harder to reach the final one without going beyond it goes beyond it.

What feet and tyres hold at a friction of 1; going beyond is the plan with the least acceleration.
"""


def approach(
    speed_mps: float, final_mps: float, distance_m: float, time_s: float
) -> tuple[Piece, ...] | None:
    """Pieces of the first part.

    Args:
        speed_mps: speed now, not negative.
        final_mps: speed at its end, not negative.
        distance_m: way until its end.
        time_s: time until its end.

    Returns:
        Pieces that cover the way in the time and end with the final speed; None if there is no way or no time
        left, or the place cannot be reached by a finite speed.
    """
    if distance_m <= _SMALL or time_s <= _SMALL:
        return None
    v0, v1, d, t = speed_mps, final_mps, distance_m, time_s
    if abs(0.5 * (v0 + v1) * t - d) <= _SMALL * max(1.0, d):
        return (Piece(t, v0, v1),)
    # Two pieces with accelerations of one size: speed v0 -> vx in x, vx -> v1 in t - x, where
    # (vx - v0) / x = (vx - v1) / (t - x) and the mean speeds cover the distance. Without x that is
    # 2 t vx^2 - 4 d vx + 2 (v0 + v1) d - (v0^2 + v1^2) t = 0: the greater root is that by a faster
    # extreme, the other that by a slower.
    root = math.sqrt(max(2.0 * (2.0 * d * d - 2.0 * (v0 + v1) * t * d + (v0 * v0 + v1 * v1) * t * t), 0.0))
    faster = 0.5 * (v0 + v1) * t < d
    extreme = (2.0 * d + root if faster else 2.0 * d - root) / (2.0 * t)
    if (extreme - v1) * (v1 - v0) > 0.0:
        # It would go beyond the final speed and return. v0 -> v1 in x, then v1 for t - x cover
        # v1 t - (v1 - v0) x / 2; there is no such x if even v1 from now on does not cover the way.
        change = 2.0 * (v1 * t - d) / (v1 - v0)
        if change > _SMALL and abs(v1 - v0) <= MOST_MPS2 * change:
            return (Piece(change, v0, v1), Piece(t - change, v1, v1))
    if extreme >= 0.0:
        away, back = abs(extreme - v0), abs(extreme - v1)
        first = t * away / (away + back)
        return (Piece(first, v0, extreme), Piece(t - first, extreme, v1))
    # To a standstill, a wait, and on, again with accelerations of one size: both ramps cover the distance.
    size = (v0 * v0 + v1 * v1) / (2.0 * d)
    stop, start = v0 / size, v1 / size
    return (Piece(stop, v0, 0.0), Piece(t - stop - start, 0.0, 0.0), Piece(start, 0.0, v1))


def final_speed_without_wish(speed_mps: float, distance_m: float, time_s: float) -> float:
    """Speed at the place if no final speed is asked for: constant acceleration, never backwards."""
    return max(2.0 * distance_m / time_s - speed_mps, 0.0) if time_s > _SMALL else speed_mps


PLAN_EPSILON_S = 1e-9
"""A plan is made again if the master's expected arrival changes by more."""

NO_ARRIVAL_S = 1e5
"""Time that is planned with as long as a master stands: who is synchronised with it comes to a standstill."""


class Synchronize(RunningAction[model.SynchronizeAction]):
    """SynchronizeAction.

    While the entity waits, its plan follows the master's expected arrival. From the moment that it sets off
    (or, if it was already moving, from the beginning of its steady state) the plan is kept, whatever the
    master does.
    """

    domains = frozenset({LONGITUDINAL})

    def __init__(self, world: World, actor: Actor, action: model.SynchronizeAction) -> None:
        super().__init__(world, actor, action)
        self._arrival_s = math.inf
        self._frozen = False
        self._own_path: Path | None = None
        self._master_path: Path | None = None

    def start(self, time_s: float) -> None:
        """Find both places, and make the first plan."""
        action, actor = self.action, self.who
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
        action, actor, arrival = self.action, self.who, self._arrival_s
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
        # the steady state is the last part of the way; what comes before it is left for the approach
        steady_m, steady_s = self._steady(final)
        pieces = approach(max(speed, 0.0), final, left_m - steady_m, left_s - steady_s)
        # no way or no time left: on at the final speed
        profile = self.drive(time_s, SpeedProfile(time_s, final, pieces or ()))
        self._steady_from_s = profile.end_s

    def _steady(self, final_mps: float) -> tuple[float, float]:
        """Way and duration of the steady state."""
        steady = self.action.steady
        if steady is None or final_mps <= 0.0:
            return 0.0, 0.0
        if steady.distance_m is not None:
            return steady.distance_m, steady.distance_m / final_mps
        duration = steady.time_s or 0.0
        return duration * final_mps, duration

    def ended(self, instant: Instant) -> bool:
        """The entity is at its place."""
        place_m = self._station - self.action.tolerance_m - 1e-9
        return instant.state(self.who.name).station_m >= place_m

    def needs(self) -> frozenset[str]:
        """The master, as long as the plan follows it."""
        return frozenset() if self._frozen else frozenset({self.action.master})
