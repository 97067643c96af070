"""Staged braking by what is still needed: warning, partial brake, full brake, and release."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from smartmot.decision.aeb import Event
from smartmot.decision.along_path import Braking, in_front, is_held, next_braking, stands
from smartmot.decision.collision import collision_times
from smartmot.decision.rules import Assessment, Command
from smartmot.errors import ConfigError
from smartmot.types import BoolArray, FloatArray

PARTIAL, FULL = 1, 2
"""Stages of the brake."""


@dataclass(frozen=True, slots=True)
class Staged:
    """As hard as is still needed, for what the paper's rule brakes for, and no longer than it is needed.

    A threat is who counts and whose forecast meets the ego's, so that a pedestrian who crosses is known
    before entering the way. Each stage begins where its deceleration is only just enough, after the dead time
    of the brakes and with the object going on as it does. The stage rises as long as a threat is near. It is
    let go, also before standstill, when for a while none has been near, nor who would be one if the ego came
    a little earlier or later: an ego that is let go drives faster again. At standstill it is held as by the
    paper's rule.

    Sources: partial brake and driver of the MathWorks cascade (`smartmot.decision.cascade`). The full brake:
    Stellet et al. 2016 (`smartmot.decision.required_deceleration`); UN R152 asks for 5 m/s2 at least, and for
    a warning 0.8 s before that, which comes 1.3 s before or more here. Distance to stop at: longitudinal
    offset of Autoware (`smartmot.decision.autoware`). Release: the emergency brake of Eclipse openPASS ends
    at 1.5 times the time at which it begins; 1 s is the least threshold of the post-encroachment time in
    lu-w/criticality-metrics@ac5bd9a (1 to 1.5 s); a time without reason of 0.4 s is what the driver of UN
    R157 evaluates a risk for (`smartmot.decision.r157`).

    Args:
        partial_mps2: deceleration of the partial brake (3.8), which begins where so much is needed.
        full_from_mps2: deceleration that is needed when the full brake begins (6.0).
        driver_mps2, reaction_s: deceleration and reaction time of the warned driver (4.0, 1.2 s).
        stop_m: from the object, where driver and partial brake are to stop (1.0 m).
        staged_margin_s: added to the time that every stage needs (0); more brakes earlier.
        release_factor: how many times as far away as where the partial brake begins a threat is not near
            any more (1.5).
        encroachment_s: by which the ego may come earlier or later without meeting who is no threat (1.0 s).
        clear_s: for which no threat is near before the brake is let go (0.4 s).
        delay_s, build_up_s, full_mps2: of the brakes that are reckoned with.
        name: of the set of parameters.

    Raises:
        ConfigError: a value is out of range.
    """

    partial_mps2: float = 3.8
    full_from_mps2: float = 6.0
    driver_mps2: float = 4.0
    reaction_s: float = 1.2
    stop_m: float = 1.0
    staged_margin_s: float = 0.0
    release_factor: float = 1.5
    encroachment_s: float = 1.0
    clear_s: float = 0.4
    delay_s: float = 0.2
    build_up_s: float = 0.4
    full_mps2: float = 8.8
    name: str = "staged"

    def __post_init__(self) -> None:
        if not 0.0 < self.partial_mps2 < self.full_from_mps2 < math.inf:
            raise ConfigError(f"{self.name}: decelerations must be positive and rise from stage to stage")
        if not (0.0 < self.driver_mps2 < math.inf and 0.0 < self.full_mps2 < math.inf):
            raise ConfigError(f"{self.name}: driver_mps2 and full_mps2 must be positive")
        others = (
            self.reaction_s, self.stop_m, self.staged_margin_s, self.encroachment_s, self.clear_s,
            self.delay_s, self.build_up_s,
        )  # fmt: skip
        if not all(0.0 <= value < math.inf for value in others) or not 1.0 <= self.release_factor < math.inf:
            raise ConfigError(f"{self.name}: nothing may be negative, and release_factor not below 1")

    def dead_s(self, decel_mps2: float, since_s: float = 0.0) -> float:
        """Time in which brakes do nothing that would do as much in all, and then decelerate at once.

        Of the delay and half of the build-up to a deceleration what is left after `since_s` of braking.
        """
        share = min(decel_mps2 / self.full_mps2, 1.0)
        return max(self.delay_s + self.build_up_s * share / 2 - since_s, 0.0)

    def needed_m(
        self, ego_mps: float, object_mps: FloatArray, decel_mps2: float, dead_s: float
    ) -> FloatArray:
        """(M,) gaps that the ego closes until it is as slow as the objects, or stands before oncoming ones.

        Args:
            ego_mps: speed of the ego.
            object_mps: (M,) speeds of the objects along its path, which they keep.
            decel_mps2: of the ego, after a dead time.
            dead_s: that time, to which the margin is added.
        """
        closing, coming = np.maximum(ego_mps - object_mps, 0.0), np.minimum(object_mps, 0.0)
        braked: FloatArray = (closing**2 - coming**2) / (2 * decel_mps2)
        return closing * (dead_s + self.staged_margin_s) + braked

    def decide(self, state: Braking | None, now: Assessment) -> tuple[Braking, Command, tuple[Event, ...]]:
        """One decision; see `smartmot.decision.rules.BrakeRule`."""
        before = state or Braking()
        since_s = 0.0 if before.begun_s is None else now.ego.stamp_s - before.begun_s
        partial, full = self.partial_mps2, self.full_from_mps2
        stage, warned = 0, False
        if np.count_nonzero(now.threatening):
            if self._is_due(now, now.threatening, full, self.dead_s(full, since_s), 0.0):
                stage = FULL
            elif self._is_due(now, now.threatening, partial, self.dead_s(partial, since_s), self.stop_m):
                stage = PARTIAL
            warned = stage > 0 or self._is_due(
                now, now.threatening, self.driver_mps2, self.reaction_s, self.stop_m
            )
        goes_on = before.stage > 0 and not stage and (self._is_near(now) or self._is_held(now))
        braking, events = next_braking(before, now, stage, goes_on, warned, self.clear_s)
        decel = partial if braking.stage == PARTIAL else None
        return braking, Command(braking.stage > 0, now.lead, braking.warned, decel), events

    def _is_due(
        self,
        now: Assessment,
        objects: BoolArray,
        decel_mps2: float,
        dead_s: float,
        left_m: float,
        factor: float = 1.0,
    ) -> bool:
        """Whether the gap to one of some objects is what a deceleration needs, or less.

        Args:
            now: the frame.
            objects: (M,) which; of these who are in front of the ego's centre and whom it comes nearer to.
            decel_mps2: see `needed_m`.
            dead_s: see `needed_m`.
            left_m: of the gap at the end.
            factor: by which the gap that is needed is multiplied.
        """
        speed = max(now.ego.speed_mps, 0.0)
        chosen = objects & in_front(now) & (speed > now.path_speed_mps)
        needed = self.needed_m(speed, now.path_speed_mps[chosen], decel_mps2, dead_s) + left_m
        return bool(np.count_nonzero(now.path_gap_m[chosen] <= factor * needed))

    def _is_near(self, now: Assessment) -> bool:
        """Whether a threat is not far enough away yet, or who would be one a little earlier or later."""
        if not np.count_nonzero(now.counts):
            return False
        ego = now.ego_forecast
        more_m = 2 * self.encroachment_s * max(now.ego.speed_mps, 0.0)
        longer = replace(ego, size_m=ego.size_m + np.array([more_m, 0.0]))
        meets = now.counts & np.isfinite(collision_times(longer, now.forecast, 0.0))
        partial = self.partial_mps2
        return self._is_due(
            now, meets | now.threatening, partial, self.dead_s(partial), self.stop_m, self.release_factor
        )

    def _is_held(self, now: Assessment) -> bool:
        """Whether the ego stands before a way that is not free."""
        return stands(now) and (is_held(now) or bool(np.count_nonzero(now.entering)))
