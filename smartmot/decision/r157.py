"""The reference driver of UN R157, and the emergency brake that is looked at beside it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import numpy as np

from smartmot.decision.aeb import Event
from smartmot.decision.along_path import (
    Braking,
    closing_times,
    in_front,
    next_braking,
    targets,
    until_standstill,
)
from smartmot.decision.rules import Assessment, Command
from smartmot.errors import ConfigError
from smartmot.types import BoolArray, FloatArray

_G_MPS2 = 9.81
_NEXT_LANE_M = 1.5 * 3.5
"""Centres farther beside the path are beyond the next lane (lanes of 3.5 m: assumed)."""

_NEARING_MPS = 0.1
"""Slower towards the path is no approach (assumed; the source's 1e-6 m/s is for speeds without noise)."""


@dataclass(frozen=True, slots=True)
class Approach:
    """An object that has begun to come nearer to the ego's path.

    Args:
        track_id: of its track.
        aside_m: how far it was from the swept width when it began.
        risk_s: since when the driver evaluates its risk, or has found one; None: not yet.
    """

    track_id: int
    aside_m: float
    risk_s: float | None


@dataclass(frozen=True, slots=True)
class R157State:
    """Memory of the rule.

    Args:
        braking: see there.
        approaches: of the objects that come nearer, or have done so and are in the swept width.
    """

    braking: Braking = field(default_factory=Braking)
    approaches: tuple[Approach, ...] = ()


@dataclass(frozen=True, slots=True)
class R157:
    """A competent driver brakes for what comes into the lane; for what is in it, the emergency brake.

    Source: UN R157, annex 3 (guidance, performance models), as read in esmini@77028d8,
    ControllerALKS_R157SM (ReferenceDriver). The driver evaluates for 0.4 s a vehicle (a cyclist too) of the
    own or the next lane that has wandered 0.375 m towards the path, and any pedestrian who comes towards it.
    If the time to collision is then below 2 s, and stays so, the driver brakes with 0.774 g after another
    0.75 s; if not, the evaluation begins again. The emergency brake takes 0.85 g below 1.5 s for what
    overlaps the width that the ego sweeps.

    Not carried over: easing off the accelerator, the driver behind a braking or an overtaken vehicle, and the
    driver's build-up (0.6 s), in whose place is that of the vehicle. The emergency brake of esmini waits
    until the object is wholly in front of the ego. It brakes until standstill (esmini's FullStop). For a
    pedestrian who crosses the emergency brake comes on entering the swept width.

    Args:
        r157_ttc_s: time to collision of the emergency brake (1.5 s); more brakes earlier.
        brake_mps2: its deceleration (0.85 g).
        driver_ttc_s, driver_mps2: of the driver (2 s, 0.774 g).
        wander_m: lateral distance in which a vehicle's coming is seen (0.375 m).
        perception_s, driver_delay_s: evaluation of the risk, and delay until the driver brakes (0.4, 0.75 s).
        name: of the set of parameters.

    Raises:
        ConfigError: a value is out of range.
    """

    r157_ttc_s: float = 1.5
    brake_mps2: float = 0.85 * _G_MPS2
    driver_ttc_s: float = 2.0
    driver_mps2: float = 0.774 * _G_MPS2
    wander_m: float = 0.375
    perception_s: float = 0.4
    driver_delay_s: float = 0.75
    name: str = "r157"

    def __post_init__(self) -> None:
        others = (
            self.r157_ttc_s, self.driver_ttc_s, self.wander_m, self.perception_s, self.driver_delay_s
        )  # fmt: skip
        if not all(0 <= value < math.inf for value in others):
            raise ConfigError(f"{self.name}: times and distances must not be negative")
        if not 0 < self.driver_mps2 <= self.brake_mps2 < math.inf:
            raise ConfigError(f"{self.name}: decelerations must be positive, the driver's the smaller one")

    def decide(
        self, state: R157State | None, now: Assessment
    ) -> tuple[R157State, Command, tuple[Event, ...]]:
        """One decision; see `smartmot.decision.rules.BrakeRule`."""
        state = state or R157State()
        stage = 0
        approaches: tuple[Approach, ...] = ()
        if np.count_nonzero(now.counts):
            in_path, ttc = targets(now), closing_times(now)
            approaches = self._approaches(state.approaches, now, in_path, ttc)
            if (ttc[in_path] < self.r157_ttc_s).any():
                stage = 2
            else:
                acts_after_s = self.perception_s + self.driver_delay_s
                stage = int(any(_since(a, now) >= acts_after_s - 1e-9 for a in approaches))
        braking, events = next_braking(state.braking, now, stage, until_standstill(now))
        decel = (None, self.driver_mps2, self.brake_mps2)[braking.stage]
        command = Command(braking.stage > 0, now.lead, decel_mps2=decel)
        return R157State(braking, approaches), command, events

    def _approaches(
        self, before: tuple[Approach, ...], now: Assessment, in_path: BoolArray, ttc_s: FloatArray
    ) -> tuple[Approach, ...]:
        """Who comes nearer to the path now, or has done so before and is in it."""
        known = {approach.track_id: approach for approach in before}
        pedestrian = now.tracks.category == "pedestrian"
        seen = pedestrian | (np.abs(now.path_offset_m) <= _NEXT_LANE_M)
        moves = now.tracks.dynamic & (now.path_aside_mps < -_NEARING_MPS)
        nearing = now.counts & in_front(now) & seen & moves
        kept: list[Approach] = []
        for k in (nearing | in_path).nonzero()[0].tolist():
            track_id, aside = int(now.tracks.track_id[k]), float(now.path_aside_m[k])
            approach = known.get(track_id)
            if approach is None:
                if not nearing[k]:
                    continue
                approach = Approach(track_id, aside, None)
            starts = approach.risk_s is None and (
                bool(pedestrian[k]) or approach.aside_m - aside > self.wander_m
            )
            # evaluated, and no risk (any more): esmini begins again
            harmless = _since(approach, now) >= self.perception_s - 1e-9 and ttc_s[k] >= self.driver_ttc_s
            if starts or harmless:
                approach = Approach(track_id, approach.aside_m, now.ego.stamp_s)
            kept.append(approach)
        return tuple(kept)


def _since(approach: Approach, now: Assessment) -> float:
    """For how long the risk of an approach has been evaluated; less than 0: it has not."""
    return -1.0 if approach.risk_s is None else now.ego.stamp_s - approach.risk_s
