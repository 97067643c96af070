"""Distances to another entity that are reached and kept within limits."""

from __future__ import annotations

import math
from dataclasses import replace

from scenarios.openscenario import model
from scenarios.openscenario.motion.profiles import Piece, SpeedProfile
from scenarios.openscenario.running.actions import LONGITUDINAL, RunningAction
from scenarios.openscenario.running.actors import State
from scenarios.openscenario.running.driving.separation import Separation, Station, overhang_m
from scenarios.openscenario.running.world import Instant

CONTROL_S = 0.01
"""How often the acceleration is chosen."""

NEAR_PER_S, SPEED_PER_S = 0.5, 2.0
"""Speed for a distance left, acceleration for a difference of speeds: critically damped, no overshoot."""

BRAKING = 0.8
"""Share of the smaller limit that slowing down at the end is planned with; the rest is in reserve."""

JERK = 0.5
"""Share of the smaller limit of the jerk that changes are planned with; the rest follows the plan."""

ACROSS = math.cos(math.pi / 4)
"""Of lines that are further apart than 45 degrees one is across the other, whichever way they are driven."""

REACHED_M, REACHED_MPS = 0.1, 0.1
"""A distance that is not kept is reached within this; that of the distance is esmini's."""


def limited(constraints: model.DynamicConstraints | None) -> bool:
    """Whether constraints limit an acceleration; else a distance is there at once."""
    return constraints is not None and not (
        constraints.max_acceleration_mps2 is None and constraints.max_deceleration_mps2 is None
    )


def _approach(left_m: float, brake_mps2: float, jerk_mps3: float) -> tuple[float, float]:
    """How fast to close in from a place, and how much faster a metre further away.

    Near by in proportion to the way that is left; far away so fast that the limits allow to come to rest:
    within sqrt(c^3 / j) from a speed c up to b^2 / j, beyond within c^2 / 2b + bc / 2j.

    Args:
        left_m: how far away, not negative.
        brake_mps2: greatest deceleration b.
        jerk_mps3: greatest change j of the deceleration in time; may be infinite.
    """
    if not math.isfinite(jerk_mps3):
        near = brake_mps2 / NEAR_PER_S**2
        if left_m < near:
            return NEAR_PER_S * left_m, NEAR_PER_S
        speed = math.sqrt(2.0 * brake_mps2 * left_m - brake_mps2 * near)
        return speed, brake_mps2 / speed
    speed = (left_m**2 * jerk_mps3) ** (1 / 3)
    slope = 2.0 * speed / (3.0 * left_m) if left_m > 0.0 else math.inf
    if speed > brake_mps2**2 / jerk_mps3:
        lag = brake_mps2**2 / (2.0 * jerk_mps3)
        speed = math.sqrt(lag**2 + 2.0 * brake_mps2 * left_m) - lag
        slope = brake_mps2 / (speed + lag)
    if speed > NEAR_PER_S * left_m:
        return NEAR_PER_S * left_m, NEAR_PER_S
    return speed, slope


def _towards(change_mps: float, jerk_mps3: float) -> float:
    """Acceleration for a change of speed that is left, from which the jerk still leads back to 0 in time."""
    near, size = jerk_mps3 / SPEED_PER_S**2, abs(change_mps)
    if size < near:
        return SPEED_PER_S * change_mps
    return math.copysign(math.sqrt(2.0 * jerk_mps3 * size - jerk_mps3 * near), change_mps)


class _Kept(RunningAction[model.LongitudinalDistanceAction]):
    """What both ways to a distance share."""

    domains = frozenset({LONGITUDINAL})

    def _find(self, time_s: float) -> None:
        """Find the side, and the place that moves with the other."""
        action, actor = self.action, self.who
        self._other = self.world.actors[action.entity]
        seen = self._other.state(time_s)
        if action.system in ("road", "lane"):
            self._face_the_road(time_s, seen)
        own = actor.state(time_s)
        separation = Separation(self.world, actor, self._other, action.system)
        leads = action.ahead
        if leads is None:
            leads = not separation.axes(own, seen, False, False)[0] > 0.0
        self._place = Station(separation, self._distance_m(own, seen, leads), leads, action.freespace)
        self._tell(own, seen)

    def _face_the_road(self, time_s: float, seen: State) -> None:
        """Let who stands across its lane go along it, the way of the other, with the heading that it has."""
        actor, roads = self.who, self.world.locator.roads
        if actor.path.on_road or actor.on_trajectory or actor.commanded or actor.coupling is not None:
            return
        pose = actor.pose(time_s)
        place = roads.place(pose)
        if place is None:
            return
        along = roads.point(place.road_id, place.s_m, place.t_m).yaw_rad
        against = math.cos(along - seen.yaw_rad) < 0.0
        path = roads.way(replace(pose, yaw_rad=along + math.pi if against else along))
        if path.on_road:
            actor.teleport(time_s, path, path.project(pose.x_m, pose.y_m)[0], pose.yaw_rad, pose.z_m)

    def _distance_m(self, own: State, seen: State, leads: bool) -> float:
        """The distance asked for; a gap in time is driven by who is behind."""
        if self.action.distance_m is not None:
            return self.action.distance_m
        return (self.action.time_gap_s or 0.0) * abs(seen.speed_mps if leads else own.speed_mps)

    def _tell(self, own: State, seen: State) -> None:
        """Note where a distance along an entity's own axis is hardly one along its way."""
        if self.action.system == "entity" and abs(math.cos(own.yaw_rad - seen.yaw_rad)) < ACROSS:
            self.world.note(
                f"the distance of '{self.who.name}' from '{self.action.entity}' is measured along its own x "
                "axis also where the other one heads across it; coordinateSystem='lane' or 'road' follows "
                "the way"
            )

    def _nowhere(self) -> None:
        """Note that there is no place to be at."""
        self.world.note(
            f"no way leads from '{self.who.name}' to '{self.action.entity}', from which it is to keep a "
            "distance: it goes on as it is there"
        )

    def needs(self) -> frozenset[str]:
        """Whom it keeps the distance from."""
        return frozenset({self.action.entity})


class LongitudinalDistance(_Kept):
    """LongitudinalDistanceAction without limits of dynamics: the distance is there at once."""

    def start(self, time_s: float) -> None:
        """Take up the distance; keep it, or go on with the other's speed."""
        self._find(time_s)
        place, actor = self._place, self.who
        if math.isnan(place.left_m(actor.state(time_s), self._other.state(time_s))):
            self._nowhere()
        if self.action.time_gap_s is not None:  # once there it is as fast as the other, whoever is behind
            place.distance_m = self.action.time_gap_s * abs(self._other.state(time_s).speed_mps)
            place.gap_s = self.action.time_gap_s if self.action.continuous else None
        way_m = place.distance_m
        if self.action.freespace:
            own, seen = overhang_m(actor, 0.0, False), overhang_m(self._other, 0.0, False)
            way_m += own[0] + seen[1] if place.leads else own[1] + seen[0]
        actor.attach(time_s, self._other, place, way_m if place.leads else -way_m)
        if not self.action.continuous:
            actor.detach(time_s)

    def update(self, instant: Instant) -> bool:
        """Note where there is no such place."""
        if self.action.system != "entity":
            own, seen = instant.state(self.who.name), instant.state(self._other.name)
            if math.isnan(self._place.left_m(own, seen)):
                self._nowhere()
        return False

    def ended(self, instant: Instant) -> bool:
        """At once, unless it is continuous."""
        return not self.action.continuous

    def leave(self, time_s: float) -> None:
        """Go on with the present speed."""
        self.who.detach(time_s)


class Approach(_Kept):
    """LongitudinalDistanceAction with limits of acceleration: the distance is approached and kept."""

    goes_on = True

    def start(self, time_s: float) -> None:
        """Find the side, and choose the first acceleration."""
        limits = self.action.constraints
        assert limits is not None
        self._up = math.inf if limits.max_acceleration_mps2 is None else limits.max_acceleration_mps2
        self._down = math.inf if limits.max_deceleration_mps2 is None else limits.max_deceleration_mps2
        self._fastest = math.inf if limits.max_speed_mps is None else limits.max_speed_mps
        self._rates = limits.max_acceleration_rate_mps3, limits.max_deceleration_rate_mps3
        self._accel = 0.0
        self._find(time_s)
        self._choose(Instant(time_s, self.world.actors))

    def _left_m(self, own: State, seen: State) -> tuple[float, float]:
        """How far the place to be is ahead, NaN if no way leads there, and the speed at which it moves."""
        place = self._place
        place.distance_m = self._distance_m(own, seen, place.leads)
        self._tell(own, seen)
        left = place.left_m(own, seen)
        if math.isnan(left):
            return left, own.speed_mps
        shrinks, along = place.rates(self.who.path, own, seen, left)
        return left / shrinks, own.speed_mps if math.isnan(along) else along

    def _choose(self, instant: Instant) -> None:
        """Choose the acceleration until the next look."""
        time_s, own = instant.time_s, instant.state(self.who.name)
        left, along = self._left_m(own, instant.state(self._other.name))
        if math.isnan(left):  # on as it is
            self._nowhere()
            left = 0.0
        speed = own.speed_mps
        brake = BRAKING * min(self._up, self._down)
        jerk = JERK * min((rate for rate in self._rates if rate), default=math.inf)
        closing = speed - along
        if math.isfinite(jerk) and not self._place.leads:
            # a gap in time ends at the speed of the other: the way to that place does not depend on its own
            left += (self.action.time_gap_s or 0.0) * closing
        most, slope = _approach(abs(left), brake, jerk)
        aimed = along + math.copysign(most, left)
        wanted = min(max(aimed, 0.0), self._fastest) - along
        accel = _towards(wanted - closing, jerk)
        if 0.0 <= aimed <= self._fastest:
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
        self.drive(time_s, SpeedProfile(time_s, after, (Piece(CONTROL_S, speed, after),)), own)

    def update(self, instant: Instant) -> bool:
        """Choose again."""
        if instant.time_s < self._next_s - 1e-9:
            return False
        self._choose(instant)
        return True

    def ended(self, instant: Instant) -> bool:
        """At the distance, unless it is to be kept."""
        if self.action.continuous:
            return False
        own = instant.state(self.who.name)
        left, along = self._left_m(own, instant.state(self._other.name))
        return abs(left) <= REACHED_M and abs(own.speed_mps - along) <= REACHED_MPS

    def finish(self, time_s: float) -> None:
        """Go on with the present speed."""
        self.who.keep_speed(time_s)
        super().finish(time_s)
