"""The ego's drive: speed kept, adapted to what is ahead (highway-env's IDM), or braked in an emergency."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from scenarios.brakes import BrakeConfig
from scenarios.openscenario.control import Motion
from scenarios.openscenario.paths import Path
from smartmot.pipeline import LeadObject

if TYPE_CHECKING:
    from scenarios.follower import Follower


class EgoDrive:
    """Drives the ego along its way like a driving robot: exactly on it, its speed decided here.

    Args:
        brakes: emergency brake.
        length_m: of the ego, for the distance that it keeps.
        adapts: whether it adapts its speed to who is ahead; else it holds its speed until it brakes, as the
            robot does in the tests of Euro NCAP.
    """

    def __init__(self, brakes: BrakeConfig, length_m: float, adapts: bool = True) -> None:
        self.brakes, self._length_m, self._adapts = brakes, length_m, adapts
        self.commands_from_s = -math.inf
        self.speed_mps = 0.0
        self.accel_mps2 = 0.0
        self.braking_since_s: float | None = None
        self._comfort_mps2 = 0.0
        self._desired_mps = 0.0
        self._follower: Follower | None = None

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Keep the initial speed until told otherwise."""
        self.speed_mps = speed_mps
        self._desired_mps, self._follower = speed_mps, None

    def control(self, time_s: float, emergency: bool, lead: LeadObject | None) -> None:
        """Take over one decision.

        Args:
            time_s: now.
            emergency: whether to brake fully.
            lead: object whose speed is adapted to, if any.
        """
        if not emergency:
            self.braking_since_s = None
        elif self.braking_since_s is None:
            self.braking_since_s = time_s
        self._comfort_mps2 = 0.0
        if emergency or self.speed_mps < 0.0:  # in reverse it is driven by the test's own robot
            return
        if self._adapts or self.speed_mps != self._desired_mps:
            self._comfort_mps2 = self._idm().accel_mps2(self.speed_mps, lead if self._adapts else None)

    def _idm(self) -> Follower:
        """The model that adapts the speed, made when first needed: many tests hold theirs."""
        if self._follower is None:
            from scenarios.follower import Follower

            self._follower = Follower(self._desired_mps, self._length_m)
        return self._follower

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """Distance driven and speed left after a duration under the present control."""
        if self.braking_since_s is not None:
            since = time_s - self.braking_since_s
            distance, left = self.brakes.travel(abs(self.speed_mps), since, duration_s)
            return Motion(-distance, -left) if self.speed_mps < 0.0 else Motion(distance, left)
        if self.speed_mps < 0.0:
            return Motion(self.speed_mps * duration_s, self.speed_mps)
        a = self._comfort_mps2
        moving = duration_s if a >= 0.0 else min(duration_s, self.speed_mps / -a)
        distance = self.speed_mps * moving + a * moving**2 / 2
        return Motion(distance, max(self.speed_mps + a * moving, 0.0))

    def advance(self, time_s: float, duration_s: float) -> None:
        """Move on by a duration."""
        if duration_s <= 0.0:
            return
        speed = self.motion(time_s, duration_s).speed_mps
        self.accel_mps2 = (speed - self.speed_mps) / duration_s
        self.speed_mps = speed
