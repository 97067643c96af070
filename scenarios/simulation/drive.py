"""The ego's drive: speed as the scenario asks, adapted to what is ahead, or braked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from itertools import pairwise

from scenarios.brakes import BrakeConfig, BrakeStage, travelled
from scenarios.openscenario.control import Motion
from scenarios.openscenario.motion.paths import Path
from scenarios.simulation.driver import DriverBrake
from scenarios.simulation.follower import Follower
from smartmot.decision.rules import LeadObject

SAME_MPS = 1e-6
"""The ego is given back to the scenario when its speed is this near to the one that the scenario asks for."""

ONSET_MPS2 = 0.15 * 9.81
"""Automatic braking has begun when it gives this (FMVSS No. 127, S4: 0.15 g)."""


@dataclass(frozen=True, slots=True)
class Asked:
    """What the scenario asks of the ego's speed.

    Args:
        speed_mps: now, negative in reverse.
        accel_mps2: how it changes until the next decision.
    """

    speed_mps: float
    accel_mps2: float = 0.0


class EgoDrive:
    """Brakes the ego, or adapts its speed to who is ahead; until then the scenario drives it.

    The speed that the scenario asks for is the desired one: speed adaptation goes below it, and after it, or
    after braking, the ego returns to it. Along its way it drives like a driving robot, exactly on it.

    Args:
        brakes: emergency brake.
        length_m: of the ego, for the distance that it keeps.
        adapts: whether it adapts its speed to who is ahead; else it drives as the scenario asks until it
            brakes, as the robot does in the tests of Euro NCAP.
        driver: a driver who brakes as well; the greater of both decelerations holds.

    Attributes:
        peak_decel_mps2: greatest deceleration while an emergency brake was requested.
        added_decel_mps2: greatest deceleration of the emergency brake beyond that of the driver then.
        braking_time_s: when the emergency brake first gave `ONSET_MPS2`, to a step; None: never.
    """

    def __init__(
        self, brakes: BrakeConfig, length_m: float, adapts: bool = True, driver: DriverBrake | None = None
    ) -> None:
        self.brakes, self._adapts, self._follower = brakes, adapts, Follower(length_m)
        self.driver = driver
        self._pedal = None if driver is None else driver.stage(brakes.max_decel_mps2)
        self._pedal_from_s = math.inf
        self.commands_from_s = math.inf
        self.speed_mps = 0.0
        self.accel_mps2 = 0.0
        self.braking_since_s: float | None = None
        self.peak_decel_mps2 = self.added_decel_mps2 = 0.0
        self.braking_time_s: float | None = None
        self._asked_decel_mps2: float | None = None
        self._stage: BrakeStage | None = None
        self._comfort_mps2 = 0.0

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Go on from the speed that the scenario has given it."""
        self.speed_mps = speed_mps

    def heed(self, time_s: float, warning_time_s: float | None, ttc_s: float | None) -> None:
        """Let the driver, if there is one, see to the pedal; see `DriverBrake.onset_s`."""
        if self.driver is not None and math.isinf(self._pedal_from_s):
            onset_s = self.driver.onset_s(time_s, warning_time_s, ttc_s)
            self._pedal_from_s = math.inf if onset_s is None else onset_s

    def control(
        self,
        time_s: float,
        emergency: bool,
        lead: LeadObject | None,
        speed_mps: float,
        asked: Asked,
        decel_mps2: float | None = None,
    ) -> None:
        """Take over one decision.

        Args:
            time_s: now.
            emergency: whether to brake.
            lead: object whose speed is adapted to, if any.
            speed_mps: of the ego now, negative in reverse.
            asked: by the scenario.
            decel_mps2: of a partial brake; None: full.
        """
        if not emergency:
            self.braking_since_s = self._stage = None
        elif self.braking_since_s is None or self._stage is None:
            self.braking_since_s, self._stage = time_s, self.brakes.requested(decel_mps2)
        elif decel_mps2 != self._asked_decel_mps2:
            since_s = time_s - self.braking_since_s
            self._stage = self.brakes.changed(self._stage, since_s, decel_mps2)
        self._asked_decel_mps2 = decel_mps2
        self._comfort_mps2 = 0.0
        if emergency:
            self._command(time_s)
            return
        if speed_mps < 0.0 or asked.speed_mps < 0.0:  # in reverse it is driven by the test's own robot
            return
        if self._pedal_from_s < math.inf:
            self._command(self._pedal_from_s)
            return
        lead = lead if self._adapts else None
        waits = math.isinf(self.commands_from_s)
        if lead is None and (waits or abs(speed_mps - asked.speed_mps) <= SAME_MPS):
            self.commands_from_s = math.inf
            return
        self._comfort_mps2 = self._follower.accel_mps2(speed_mps, lead, asked.speed_mps, asked.accel_mps2)
        self._command(time_s)

    def _command(self, time_s: float) -> None:
        self.commands_from_s = min(self.commands_from_s, time_s)

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """Distance driven and speed left after a duration under the present control."""
        if self._pedal_from_s < math.inf and self.speed_mps >= 0.0:
            return Motion(*self._both(time_s, duration_s))
        if self.braking_since_s is not None:
            since = time_s - self.braking_since_s
            distance, left = self.brakes.travel(abs(self.speed_mps), since, duration_s, self._stage)
            return Motion(-distance, -left) if self.speed_mps < 0.0 else Motion(distance, left)
        if self.speed_mps < 0.0:
            return Motion(self.speed_mps * duration_s, self.speed_mps)
        a = self._comfort_mps2
        moving = duration_s if a >= 0.0 else min(duration_s, self.speed_mps / -a)
        distance = self.speed_mps * moving + a * moving**2 / 2
        return Motion(distance, max(self.speed_mps + a * moving, 0.0))

    def _both(self, time_s: float, duration_s: float) -> tuple[float, float]:
        """Distance and speed with the greater deceleration of emergency brake and driver."""
        assert self._pedal is not None  # else it is never pressed
        kinks = [self._pedal_from_s, self._pedal_from_s + self._pedal.ramp_s]
        if self.braking_since_s is not None and self._stage is not None:
            start_s = self.braking_since_s + self._stage.start_s
            kinks += [start_s, start_s + self._stage.ramp_s]
        # between these both are linear, so that one overtakes the other once at most
        ends = sorted({time_s, time_s + duration_s, *kinks})
        for low_s, high_s in pairwise(ends):
            before = self._emergency_mps2(low_s + 1e-13) - self._pedal_mps2(low_s + 1e-13)
            after = self._emergency_mps2(high_s - 1e-13) - self._pedal_mps2(high_s - 1e-13)
            if before * after < 0.0:
                kinks.append(low_s + (high_s - low_s) * before / (before - after))

        def greater_mps2(at_s: float) -> float:
            return max(self._emergency_mps2(at_s), self._pedal_mps2(at_s))

        return travelled(self.speed_mps, time_s, duration_s, kinks, greater_mps2)

    def _emergency_mps2(self, time_s: float) -> float:
        """Deceleration that the emergency brake alone gives."""
        if self.braking_since_s is None or self._stage is None:
            return 0.0
        return self._stage.decel_mps2(time_s - self.braking_since_s)

    def _pedal_mps2(self, time_s: float) -> float:
        """Deceleration that the driver alone gives."""
        if self._pedal is None or math.isinf(self._pedal_from_s):
            return 0.0
        return self._pedal.decel_mps2(time_s - self._pedal_from_s)

    def _note_braking(self, time_s: float, duration_s: float) -> None:
        """Take note of what the emergency brake gives in a step in which the ego moves."""
        end_s = time_s + duration_s
        if self.braking_time_s is None and self._emergency_mps2(end_s) >= ONSET_MPS2:
            self.braking_time_s = end_s
        # a brake without build-up steps at the beginning
        ends_s = (time_s + 1e-9, end_s)
        added = (self._emergency_mps2(at_s) - self._pedal_mps2(at_s) for at_s in ends_s)
        self.added_decel_mps2 = max(self.added_decel_mps2, *added)

    def advance(self, time_s: float, duration_s: float) -> None:
        """Move on by a duration."""
        if duration_s <= 0.0:
            return
        if self.braking_since_s is not None and self.speed_mps != 0.0:
            self._note_braking(time_s, duration_s)
        speed = self.motion(time_s, duration_s).speed_mps
        self.accel_mps2 = (speed - self.speed_mps) / duration_s
        if self.braking_since_s is not None:
            self.peak_decel_mps2 = max(self.peak_decel_mps2, abs(self.accel_mps2))
        self.speed_mps = speed
