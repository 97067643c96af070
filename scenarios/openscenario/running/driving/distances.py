"""Distances to another entity that are reached and kept within limits."""

from __future__ import annotations

import math

from scenarios.openscenario import model
from scenarios.openscenario.motion.profiles import Piece, SpeedProfile
from scenarios.openscenario.running.actions import LONGITUDINAL, RunningAction, overhangs_m
from scenarios.openscenario.running.world import Instant

CONTROL_S = 0.01
"""How often the acceleration is chosen."""

NEAR_PER_S, SPEED_PER_S = 0.5, 2.0
"""Speed for a distance left, acceleration for a difference of speeds: critically damped, no overshoot."""

BRAKING = 0.8
"""Share of the smaller limit that slowing down at the end is planned with; the rest is in reserve."""

REACHED_M, REACHED_MPS = 0.1, 0.1
"""A distance that is not kept is reached within this; that of the distance is esmini's."""


def limited(constraints: model.DynamicConstraints | None) -> bool:
    """Whether constraints limit an acceleration; else a distance is there at once."""
    return constraints is not None and not (
        constraints.max_acceleration_mps2 is None and constraints.max_deceleration_mps2 is None
    )


class Approach(RunningAction[model.LongitudinalDistanceAction]):
    """LongitudinalDistanceAction with limits of acceleration: the distance is approached and kept."""

    domains = frozenset({LONGITUDINAL})

    def start(self, time_s: float) -> None:
        """Find the side, and choose the first acceleration."""
        action, actor = self.action, self.who
        self._other = self.world.actors[action.entity]
        limits = action.constraints
        assert limits is not None
        self._up = math.inf if limits.max_acceleration_mps2 is None else limits.max_acceleration_mps2
        self._down = math.inf if limits.max_deceleration_mps2 is None else limits.max_deceleration_mps2
        self._fastest = math.inf if limits.max_speed_mps is None else limits.max_speed_mps
        self._rates = limits.max_acceleration_rate_mps3, limits.max_deceleration_rate_mps3
        self._accel = 0.0
        ahead = action.ahead
        if ahead is None:
            seen = self._other.state(time_s)
            ahead = actor.path.project(seen.x_m, seen.y_m)[0] <= actor.state(time_s).station_m
        self._ahead = ahead
        self._hint = actor.path.project(*self._other.state(time_s)[:2])[0]
        self._path = actor.path
        self._choose(time_s)

    def _left_m(self, time_s: float) -> tuple[float, float]:
        """How far the place to be is ahead, and the speed along the way at which it moves."""
        actor, action = self.who, self.action
        own, seen = actor.state(time_s), self._other.state(time_s)
        if actor.path is not self._path:
            self._path, self._hint = actor.path, actor.path.project(seen.x_m, seen.y_m)[0]
        station = self._hint = actor.path.project_from(seen.x_m, seen.y_m, self._hint)[0]
        along = seen.speed_mps * math.cos(actor.path.pose(station)[2] - seen.yaw_rad)
        distance = action.distance_m
        if distance is None:
            # a gap in time is driven by who is behind
            distance = (action.time_gap_s or 0.0) * abs(along if self._ahead else own.speed_mps)
        if action.freespace:
            distance += overhangs_m(actor, self._other, own, seen, self._ahead)
        return station + (distance if self._ahead else -distance) - own.station_m, along

    def _choose(self, time_s: float) -> None:
        """Choose the acceleration until the next look."""
        actor = self.who
        left, along = self._left_m(time_s)
        speed = actor.state(time_s).speed_mps
        brake = BRAKING * min(self._up, self._down)
        jerk = min((rate for rate in self._rates if rate), default=math.inf)
        brake = min(brake, jerk / NEAR_PER_S)
        closing = speed - along
        if math.isfinite(jerk) and closing * left > 0.0:
            # where and how fast it will be once its acceleration can have come to the one that slows it down
            side = math.copysign(1.0, left)
            towards = side * self._accel
            lag_s = max(towards + min(brake, NEAR_PER_S * abs(closing)), 0.0) / jerk
            left -= side * (side * closing * lag_s + 0.5 * towards * lag_s**2 - jerk * lag_s**3 / 6.0)
            closing += side * (towards * lag_s - 0.5 * jerk * lag_s**2)
        # far away: so fast that the limits allow to slow down again; near by: in proportion to what is left
        near, size = brake / NEAR_PER_S**2, abs(left)
        most = NEAR_PER_S * size if size < near else math.sqrt(2.0 * brake * size - brake * near)
        slope = NEAR_PER_S if size < near else brake / most
        wanted = min(max(along + math.copysign(most, left), 0.0), self._fastest) - along
        accel = SPEED_PER_S * (wanted - closing)
        if abs(wanted) == most:
            accel -= slope * closing  # what is left shrinks as it closes in
        accel = min(max(accel, -self._down), self._up)
        rate_up, rate_down = self._rates
        if rate_up is not None:
            accel = min(accel, self._accel + rate_up * CONTROL_S)
        if rate_down is not None:
            accel = max(accel, self._accel - rate_down * CONTROL_S)
        after = speed + accel * CONTROL_S
        after = min(max(after, 0.0), max(self._fastest, speed))
        self._accel = (after - speed) / CONTROL_S
        self._next_s = time_s + CONTROL_S
        self.drive(time_s, SpeedProfile(time_s, after, (Piece(CONTROL_S, speed, after),)))

    def update(self, instant: Instant) -> bool:
        """Choose again."""
        if instant.time_s < self._next_s - 1e-9:
            return False
        self._choose(instant.time_s)
        return True

    def ended(self, instant: Instant) -> bool:
        """At the distance, unless it is to be kept."""
        if self.action.continuous:
            return False
        left, along = self._left_m(instant.time_s)
        return abs(left) <= REACHED_M and abs(instant.state(self.who.name).speed_mps - along) <= REACHED_MPS

    def finish(self, time_s: float) -> None:
        """Go on with the present speed."""
        self.who.keep_speed(time_s)
        super().finish(time_s)

    def needs(self) -> frozenset[str]:
        """Whom it keeps the distance from."""
        return frozenset({self.action.entity})
