"""Brakes with delay, build-up and friction, integrated without time-step error."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from dataclasses import dataclass

from scenarios.errors import ScenarioError


@dataclass(frozen=True, slots=True)
class BrakeStage:
    """Deceleration over the time since a brake request: constant, then linear to another, which it keeps.

    Args:
        start_s: when it begins to change.
        ramp_s: for how long it changes.
        from_mps2: deceleration before.
        to_mps2: deceleration after.
    """

    start_s: float
    ramp_s: float
    from_mps2: float
    to_mps2: float

    def decel_mps2(self, since_s: float) -> float:
        """Deceleration a time after the request."""
        if since_s <= self.start_s:
            return self.from_mps2
        if since_s >= self.start_s + self.ramp_s:
            return self.to_mps2
        return self.from_mps2 + (self.to_mps2 - self.from_mps2) * (since_s - self.start_s) / self.ramp_s


@dataclass(frozen=True, slots=True)
class BrakeConfig:
    """Brakes of a vehicle, as an emergency brake uses them.

    Args:
        delay_s: from the request to the first deceleration.
        build_up_s: linear rise from none to the full deceleration.
        max_decel_mps2: full deceleration on dry road.
    """

    delay_s: float
    build_up_s: float
    max_decel_mps2: float

    def __post_init__(self) -> None:
        if not (self.delay_s >= 0 and self.build_up_s >= 0 and self.max_decel_mps2 > 0):
            raise ScenarioError(
                "brakes: delay and build-up must not be negative and the deceleration must be positive; got "
                f"{self.delay_s} s, {self.build_up_s} s, {self.max_decel_mps2} m/s2"
            )

    def requested(self, asked_mps2: float | None = None) -> BrakeStage:
        """The first stage of a braking: the delay, then the build-up to what is asked.

        Args:
            asked_mps2: deceleration of a partial brake, at most the full one; None: the full one.
        """
        return BrakeStage(self.delay_s, *self._ramp(0.0, asked_mps2))

    def changed(self, stage: BrakeStage, since_s: float, asked_mps2: float | None) -> BrakeStage:
        """The stage after another deceleration is asked for in the middle of a braking.

        The brakes are applied: it changes from the present deceleration at the rate of the build-up, without
        another delay. Within the delay of the first request only the deceleration to come is another.

        Args:
            stage: the present one.
            since_s: time since the request.
            asked_mps2: see `requested`.
        """
        start_s = max(since_s, self.delay_s)
        return BrakeStage(start_s, *self._ramp(stage.decel_mps2(start_s), asked_mps2))

    def _ramp(self, from_mps2: float, asked_mps2: float | None) -> tuple[float, float, float]:
        """Duration, beginning and end of a change of deceleration at the rate of the build-up."""
        to_mps2 = self.max_decel_mps2 if asked_mps2 is None else min(asked_mps2, self.max_decel_mps2)
        return self.build_up_s * (abs(to_mps2 - from_mps2) / self.max_decel_mps2), from_mps2, to_mps2

    def decel_mps2(self, since_s: float) -> float:
        """Deceleration a time after the request of a full braking."""
        return self.requested().decel_mps2(since_s)

    def travel(
        self, speed_mps: float, since_s: float, duration_s: float, stage: BrakeStage | None = None
    ) -> tuple[float, float]:
        """Distance driven and speed left after braking for `duration_s`.

        The deceleration is linear between its kinks, so every piece is integrated in closed form; the
        vehicle stops at zero.

        Args:
            speed_mps: speed at the beginning.
            since_s: time since the request at the beginning.
            duration_s: how long.
            stage: of the braking; None: a full one from the request on.
        """
        stage = stage or self.requested()
        kinks = (stage.start_s, stage.start_s + stage.ramp_s)
        return travelled(speed_mps, since_s, duration_s, kinks, stage.decel_mps2)


def travelled(
    speed_mps: float,
    time_s: float,
    duration_s: float,
    kinks_s: Iterable[float],
    decel_mps2: Callable[[float], float],
) -> tuple[float, float]:
    """Distance driven and speed left under a deceleration that is linear between kinks, in closed form.

    The vehicle stops at zero.

    Args:
        speed_mps: at the beginning.
        time_s: of the beginning.
        duration_s: how long.
        kinks_s: times at which the deceleration stops to be linear, or steps.
        decel_mps2: at a time.
    """
    distance, left, now = 0.0, duration_s, time_s
    kinks = (*sorted(kinks_s), math.inf)
    while left > 0.0 and speed_mps > 0.0:
        # a piece too short to move the clock would never end
        kink = next(k for k in kinks if k > now + 1e-12)
        piece = min(left, kink - now)
        a0 = -decel_mps2(now + 1e-13)
        a1 = -decel_mps2(now + piece - 1e-13) if piece > 1e-12 else a0
        jerk = (a1 - a0) / piece
        piece = min(piece, _stop_time(speed_mps, a0, jerk))
        distance += speed_mps * piece + a0 * piece**2 / 2 + jerk * piece**3 / 6
        after = speed_mps + a0 * piece + jerk * piece**2 / 2
        speed_mps = after if after > 1e-9 else 0.0
        now += piece
        left -= piece
    return distance, speed_mps


def _stop_time(speed: float, acceleration: float, jerk: float) -> float:
    """First time at which speed + acceleration t + jerk t^2 / 2 reaches zero; infinite if it never does."""
    if abs(jerk) < 1e-9:
        return -speed / acceleration if acceleration < 0 else math.inf
    root = acceleration**2 - 2 * jerk * speed
    if root < 0:
        return math.inf
    times = ((-acceleration - math.sqrt(root)) / jerk, (-acceleration + math.sqrt(root)) / jerk)
    return min((t for t in times if t >= 0), default=math.inf)


def stop_time_s(brakes: BrakeConfig, speed_mps: float, decel_mps2: float | None = None) -> float:
    """Time from a request to standstill.

    Args:
        brakes: delay, build-up and full deceleration.
        speed_mps: at the request.
        decel_mps2: of a partial brake; None: full.
    """
    stage = brakes.requested(decel_mps2)
    # over the build-up the speed falls by half of what the full deceleration would take
    lost_mps = 0.5 * stage.to_mps2 * stage.ramp_s
    if speed_mps <= lost_mps:
        return stage.start_s + math.sqrt(2.0 * speed_mps * stage.ramp_s / stage.to_mps2)
    return stage.start_s + stage.ramp_s + (speed_mps - lost_mps) / stage.to_mps2
