"""Responsibility-Sensitive Safety as a brake rule: braking while both safe distances are violated."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.decision.aeb import Event
from smartmot.decision.along_path import Braking, in_front, is_held, next_braking
from smartmot.decision.rules import Assessment, Command
from smartmot.errors import ConfigError
from smartmot.types import BoolArray, FloatArray

_AGAINST_MPS = 1.0
"""A vehicle faster than this against the ego's direction is oncoming traffic (assumed; above the noise of a
track that stands)."""


@dataclass(frozen=True, slots=True)
class Rss:
    """Brakes while an object is nearer than the safe distance both along the path and beside it.

    Source: Shalev-Shwartz et al., arXiv 1708.06374, definitions 1, 2 and 6; parameters of the appendix of
    intel/ad-rss-lib@847b9c2. Along the path both accelerate during their response times; then the ego brakes
    with at least `brake_min_mps2`, the one ahead with `brake_max_mps2`.

    Not carried over: the ego only brakes, so that the response is the longitudinal one even where the lateral
    distance was violated last, as by a pedestrian who steps in front of the ego; vulnerable road users are
    never oncoming traffic. A pedestrian who crosses sets it off at the lateral safe distance, which grows
    with the walking speed, to 5 m at 1.4 m/s. It brakes as hard as the response may be, and lets go once the
    distances are safe.

    Args:
        rss_response_s: response time of the ego (1 s); more brakes earlier.
        other_response_s: of the others (2 s).
        accel_mps2: along the path, while responding (3.5).
        brake_min_mps2, brake_max_mps2: least and greatest deceleration of the response (4, 8).
        brake_correct_mps2: least deceleration of a vehicle in its own lane that meets an oncoming one (3).
        side_accel_mps2, side_brake_mps2: the same across the path (0.2, 0.8).
        side_margin_m: for lateral wander (0.10 m).
        name: of the set of parameters.

    Raises:
        ConfigError: a value is out of range.
    """

    rss_response_s: float = 1.0
    other_response_s: float = 2.0
    accel_mps2: float = 3.5
    brake_min_mps2: float = 4.0
    brake_max_mps2: float = 8.0
    brake_correct_mps2: float = 3.0
    side_accel_mps2: float = 0.2
    side_brake_mps2: float = 0.8
    side_margin_m: float = 0.10
    name: str = "rss"

    def __post_init__(self) -> None:
        brakes = (self.brake_min_mps2, self.brake_max_mps2, self.brake_correct_mps2, self.side_brake_mps2)
        others = (
            self.rss_response_s, self.other_response_s, self.accel_mps2, self.side_accel_mps2,
            self.side_margin_m,
        )  # fmt: skip
        if not (all(0 < value < math.inf for value in brakes) and all(0 <= v < math.inf for v in others)):
            raise ConfigError(f"{self.name}: decelerations must be positive, and nothing negative")

    def along_m(self, ego_mps: float, object_mps: FloatArray, against: BoolArray) -> FloatArray:
        """(M,) safe distances along the path.

        Args:
            ego_mps: speed of the ego.
            object_mps: (M,) speeds of the others along its path.
            against: (M,) which of them are oncoming traffic.
        """
        speed = max(ego_mps, 0.0)
        response, accel = self.rss_response_s, self.accel_mps2
        behind = _stated(speed, response, accel, self.brake_min_mps2)
        ahead = np.maximum(object_mps, 0.0) ** 2 / (2 * self.brake_max_mps2)
        own = _stated(speed, response, accel, self.brake_correct_mps2)
        coming = _stated(np.abs(object_mps), self.other_response_s, accel, self.brake_min_mps2)
        return np.where(against, own + coming, np.maximum(behind - ahead, 0.0))

    def aside_m(self, nearing_mps: FloatArray) -> FloatArray:
        """(M,) safe distances beside the path, of objects that come nearer to it at these speeds."""
        accel, brake = self.side_accel_mps2, self.side_brake_mps2
        ego = _stated(0.0, self.rss_response_s, accel, brake)
        return np.maximum(ego + _stated(nearing_mps, self.other_response_s, accel, brake), 0.0) + (
            self.side_margin_m
        )

    def decide(self, state: Braking | None, now: Assessment) -> tuple[Braking, Command, tuple[Event, ...]]:
        """One decision; see `smartmot.decision.rules.BrakeRule`."""
        unsafe = False
        if np.count_nonzero(now.counts):
            speed = now.path_speed_mps
            along = self.along_m(now.ego.speed_mps, speed, (speed < -_AGAINST_MPS) & ~now.vulnerable)
            near = (now.path_gap_m <= along) & (now.path_aside_m <= self.aside_m(-now.path_aside_mps))
            unsafe = bool(np.count_nonzero(near & in_front(now) & now.counts))
        braking, events = next_braking(state or Braking(), now, int(unsafe), is_held(now))
        decel = self.brake_max_mps2 if braking.stage else None
        return braking, Command(braking.stage > 0, now.lead, decel_mps2=decel), events


def _stated(
    speed_mps: float | FloatArray, response_s: float, accel_mps2: float, brake_mps2: float
) -> FloatArray:
    """Distance driven in the response time at full acceleration, and then braking; across it may be away."""
    after = np.maximum(speed_mps + accel_mps2 * response_s, 0.0)
    distance: FloatArray = (
        speed_mps * response_s + accel_mps2 * response_s**2 / 2 + after**2 / (2 * brake_mps2)
    )
    return distance
