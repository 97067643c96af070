"""Lateral distances to an entity: across the actor's own axis, its lane or its trajectory."""

from __future__ import annotations

import math

from scenarios.openscenario import model
from scenarios.openscenario.errors import RunError
from scenarios.openscenario.motion.lateral import BENDS
from scenarios.openscenario.motion.paths import Path, straight
from scenarios.openscenario.motion.profiles import SLOPES
from scenarios.openscenario.running.actors import STANDING_MPS, Actor
from scenarios.openscenario.running.driving.lateral import NO_OFFSET_M, Kept
from scenarios.openscenario.running.world import Instant, World


class LateralDistance(Kept[model.LateralDistanceAction]):
    """LateralDistanceAction; a change within limits has the shape of a cubic.

    In coordinates of the entity, the standard's default, the distance counts along the y axis that the actor
    has when it heads along its lane, or straight on beside all lanes. After the cubic it follows the other
    within the limits, with that heading.
    """

    shape = "cubic"

    def __init__(self, world: World, actor: Actor, action: model.LateralDistanceAction) -> None:
        super().__init__(world, actor, action)
        # what it follows ends when this begins
        self._trajectory = actor.path if actor.on_trajectory else None

    def start(self, time_s: float) -> None:
        """Find the side, and begin the change to the distance."""
        self._side: float | None = None
        self._kept = False
        self._seen: tuple[float, float] | None = None
        self._across_mps = 0.0
        super().start(time_s)
        if self._duration_s <= 0.0:
            self._kept, self._seen = True, (time_s, self._along * self._target)

    def _beside_what(self, time_s: float) -> Path:
        """The entity's trajectory, or the middle of its lane; beside all lanes straight ahead of it.

        Raises:
            RunError: it follows no trajectory, or is in no lane, where one is needed.
        """
        who, system = self.who, self.action.system
        if system == "trajectory":
            if self._trajectory is None:
                raise RunError(
                    f"'{who.name}' is to keep a distance across its trajectory, and follows none at "
                    f"{time_s:.3f} s"
                )
            return self._trajectory
        pose = who.pose(time_s)
        if system == "entity" and self.world.locator.roads.place(pose) is None:
            return straight(pose)
        return super()._beside_what(time_s)

    def _target_m(self, time_s: float) -> float:
        action = self.action
        own, right, left, facing = self._edges(time_s)
        if self._side is None:
            on_left = 2.0 * own >= right + left if action.left is None else action.left == (facing > 0.0)
            self._side = 1.0 if on_left else -1.0
        distance = action.distance_m
        return left + distance if self._side > 0.0 else right - distance

    def _edges(self, time_s: float) -> tuple[float, float, float, float]:
        """Offset of the actor, offsets at a distance of 0 to the right and left of the other, its direction.

        The direction is +1 if the other heads along the curve, -1 if against it.
        """
        action, who = self.action, self.who
        other = self.world.actors[action.entity]
        pose = who.pose(time_s)
        station, own = self._middle.project(pose.x_m, pose.y_m)
        if action.system != "entity":
            left, facing = self._beside(action.entity, time_s)
            apart = 0.5 * (who.definition.width_m + other.definition.width_m) if action.freespace else 0.0
            return own, left - apart, left + apart, facing
        x, y, yaw = self._middle.pose(station)
        state = other.state(time_s)
        sine, cosine = math.sin(yaw), math.cos(yaw)
        place = (state.y_m - y) * cosine - (state.x_m - x) * sine
        turn = state.yaw_rad - yaw
        facing = math.copysign(1.0, math.cos(turn))
        if not action.freespace:
            return own, place, place, facing
        box, actor = other.definition, who.definition
        middle = place + box.center_x_m * math.sin(turn) + box.center_y_m * math.cos(turn) - actor.center_y_m
        half = 0.5 * (abs(math.sin(turn)) * box.length_m + abs(math.cos(turn)) * box.width_m + actor.width_m)
        return own, middle - half, middle + half, facing

    def _limits(self) -> tuple[float, float]:
        """Greatest acceleration and speed across; infinite without a limit."""
        limits = self.action.constraints
        if limits is None:
            return math.inf, math.inf
        accelerations = [limits.max_acceleration_mps2, limits.max_deceleration_mps2]
        return min((limit for limit in accelerations if limit), default=math.inf), (
            limits.max_speed_mps or math.inf
        )

    def _duration(self, change_m: float) -> float:
        acceleration, speed = self._limits()
        return max(math.sqrt(BENDS["cubic"] * change_m / acceleration), SLOPES["cubic"] * change_m / speed)

    def update(self, instant: Instant) -> bool:
        """Follow the other entity, and a route that is new."""
        time_s = instant.time_s
        turns_back = self._along * self.who.asked_mps(time_s) < -STANDING_MPS
        new_route = self.who.route is not self._route
        if not self._reached(instant) or turns_back or new_route:
            self._seen, self._across_mps = None, 0.0
            return super().update(instant)
        if time_s <= self._begin_s:
            return False
        offset = self._target_m(time_s)
        pose = self.who.pose(time_s)
        own = self._middle.project(pose.x_m, pose.y_m)[1]
        before = time_s if self._seen is None else self._seen[0]
        if time_s > before:
            own = self._followed(own, offset, time_s - before)
        self._kept = abs(offset - own) <= NO_OFFSET_M
        self._seen = time_s, offset
        if abs(own - self._along * self._target) <= NO_OFFSET_M:
            return False
        self._begin(time_s, self._middle, own, 0.0)
        return True

    def _followed(self, own_m: float, offset_m: float, after_s: float) -> float:
        """Offset after a time: that asked for, or as near as the limits let it come without overshoot."""
        acceleration, speed = self._limits()
        assert self._seen is not None
        moves_mps = (offset_m - self._seen[1]) / after_s
        left_m = offset_m - moves_mps * after_s - own_m
        # so fast that it can still stop at the place, in steps: v with v^2 / 2a + v dt / 2 = what is left
        change = acceleration * after_s
        if math.isfinite(acceleration):
            closing = 0.5 * change * (math.sqrt(1.0 + 8.0 * abs(left_m) / (change * after_s)) - 1.0)
            closing = math.copysign(min(closing, abs(left_m) / after_s), left_m)
        else:
            closing = left_m / after_s
        wanted = min(max(moves_mps + closing, -speed), speed)
        self._across_mps = min(max(wanted, self._across_mps - change), self._across_mps + change)
        return own_m + self._across_mps * after_s

    def ended(self, instant: Instant) -> bool:
        """At the distance, unless it is to be kept."""
        return self._kept and super().ended(instant)

    def _follows(self) -> bool:
        return self.action.continuous

    def needs(self) -> frozenset[str]:
        """Whom it stays beside."""
        return frozenset({self.action.entity})
