"""The time-to-collision cascade of the MathWorks examples of autonomous emergency braking.

Each stage has a stopping time, the ego's speed over the stage's deceleration. A stage begins when the time to
collision with the nearest object in the ego's lane falls below it: warning, two partial brakes, full brake.
Until the ego stands no stage is left for a lower one.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass

import numpy as np

from smartmot.decision.aeb import Event
from smartmot.decision.along_path import Braking, closing_times, in_front, next_braking, until_standstill
from smartmot.decision.rules import Assessment, Command
from smartmot.errors import ConfigError


@dataclass(frozen=True, slots=True)
class Cascade:
    """Warning, first and second partial brake, full brake.

    Source: parameters of the public set-up scripts of the examples ("Autonomous Emergency Braking with Sensor
    Fusion"), which many repositories hold alike. Their 3.7 m of headway offset are the distance from the
    ego's origin to its bumper; the gap is measured from the bumper, so that none is left.

    A target is whose centre is in the ego's lane, of which the examples assume 3.6 m where they see no lines
    (helperFindMIOTrack): along the path here. The nearest decides. A pedestrian who crosses sets it off on
    entering that lane, not before. Their tracks are points, such as of a radar; of a long vehicle that
    crosses, it is enough that a part is in the width that the ego sweeps.

    Args:
        partial1_mps2, partial2_mps2, full_mps2: decelerations of the stages (3.8, 5.3, 9.8).
        driver_mps2, reaction_s: deceleration and reaction time of the warned driver (4.0, 1.2 s).
        cascade_margin_s: added to the stopping times of the brakes (timeMargin, 0); more brakes earlier.
        lane_width_m: width of the ego's lane (laneWidth, 3.6 m).
        name: of the set of parameters.

    Raises:
        ConfigError: a value is out of range.
    """

    partial1_mps2: float = 3.8
    partial2_mps2: float = 5.3
    full_mps2: float = 9.8
    driver_mps2: float = 4.0
    reaction_s: float = 1.2
    cascade_margin_s: float = 0.0
    lane_width_m: float = 3.6
    name: str = "cascade"

    def __post_init__(self) -> None:
        rising = (0.0, self.partial1_mps2, self.partial2_mps2, self.full_mps2, math.inf)
        if not all(low < high for low, high in itertools.pairwise(rising)):
            raise ConfigError(f"{self.name}: decelerations must be positive and rise from stage to stage")
        if not (self.driver_mps2 > 0 and self.reaction_s >= 0 and self.cascade_margin_s >= 0):
            raise ConfigError(f"{self.name}: driver_mps2 must be positive, and no time negative")
        if not 0 < self.lane_width_m < math.inf:
            raise ConfigError(f"{self.name}: lane_width_m must be positive and finite")

    def decide(self, state: Braking | None, now: Assessment) -> tuple[Braking, Command, tuple[Event, ...]]:
        """One decision; see `smartmot.decision.rules.BrakeRule`."""
        chosen = now.counts
        if np.count_nonzero(chosen):
            in_lane = np.abs(now.path_offset_m) <= self.lane_width_m / 2
            chosen = chosen & in_front(now) & (in_lane | (now.path_aside_m <= 0.0))
        stage, warned = 0, False
        if np.count_nonzero(chosen):
            nearest = int(np.argmin(np.where(chosen, now.path_gap_m, np.inf)))
            ttc, speed = float(closing_times(now)[nearest]), max(now.ego.speed_mps, 0.0)
            stage = sum(ttc < speed / decel + self.cascade_margin_s for decel in self._decels)
            warned = ttc < speed / self.driver_mps2 + self.reaction_s
        braking, events = next_braking(
            state or Braking(), now, stage, until_standstill(now), warned or stage > 0
        )
        decel = self._decels[braking.stage - 1] if braking.stage else None
        return braking, Command(braking.stage > 0, now.lead, braking.warned, decel), events

    @property
    def _decels(self) -> tuple[float, float, float]:
        return self.partial1_mps2, self.partial2_mps2, self.full_mps2


CASCADE_GENTLE = Cascade(
    partial1_mps2=2.0, partial2_mps2=4.0, cascade_margin_s=0.25, reaction_s=1.25, name="cascade_gentle"
)
"""The variant of other public set-up scripts: a braking controller as watchdog at a junction.

Not carried over: within 60 m of a junction those also take crossing traffic for a target, if its path meets
the ego's within 5 s of it (helperFindMIO); that needs the distance to the junction.
"""
