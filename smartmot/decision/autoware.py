"""The collision check of Autoware's `autonomous_emergency_braking`."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from statistics import median

import numpy as np

from smartmot.decision.aeb import Event
from smartmot.decision.along_path import Braking, is_held, next_braking, stands, targets
from smartmot.decision.rules import Assessment, Command
from smartmot.errors import ConfigError


@dataclass(frozen=True, slots=True)
class AutowareState:
    """Memory of the rule.

    Args:
        braking: see there.
        speeds: times and speeds along the path of the nearest target so far, as far back as they are used.
        collision_s: when the last collision was predicted; None: not yet.
    """

    braking: Braking = field(default_factory=Braking)
    speeds: tuple[tuple[float, float], ...] = ()
    collision_s: float | None = None


@dataclass(frozen=True, slots=True)
class Autoware:
    """Brakes if the nearest target on the path is nearer than the ego's stopping distance.

    That is v t + v^2 / (2 a_ego) - v_o |v_o| / (2 a_object) + offset, v_o the median speed of the nearest
    target along the path. Source: autowarefoundation/autoware.universe@b8ce82e, node.cpp, and the param.yaml
    beside it, which autoware_launch has too.

    Here the targets are tracks, not clusters of points; the path is that of the ego's forecast, as far as
    the longer of its two paths reaches; every frame is checked, not only ten a second. The module asks for
    an emergency stop and leaves the braking to others (2.5 m/s2 at a jerk of 1.5 m/s3 in autoware_launch):
    here the brakes are applied fully. A pedestrian who crosses sets it off on entering the width that the ego
    sweeps, not before.

    Args:
        autoware_response_s: t_response; more brakes earlier.
        ego_brake_mps2, object_brake_mps2: a_ego_min and a_obj_min without their sign.
        offset_m: longitudinal_offset_margin.
        expand_width_m: by which the width grows on either side; the published one is negative.
        horizon_s: mpc_prediction_time_horizon.
        turn_horizon_s, turn_least_m, turn_most_m: imu_prediction_time_horizon of the path at constant turn
            rate, and its least and greatest length.
        keep_s: collision_keeping_sec: for so long it brakes after the last prediction.
        speed_s: previous_obstacle_keep_time: for so long speeds count for the median.
        name: of the set of parameters.

    Raises:
        ConfigError: a value is out of range.
    """

    autoware_response_s: float = 1.0
    ego_brake_mps2: float = 3.0
    object_brake_mps2: float = 1.0
    offset_m: float = 1.0
    expand_width_m: float = -0.2
    horizon_s: float = 4.5
    turn_horizon_s: float = 1.5
    turn_least_m: float = 0.5
    turn_most_m: float = 10.0
    keep_s: float = 3.0
    speed_s: float = 1.0
    name: str = "autoware"

    def __post_init__(self) -> None:
        times = (self.autoware_response_s, self.horizon_s, self.turn_horizon_s, self.keep_s, self.speed_s)
        lengths = (self.offset_m, self.turn_least_m, self.turn_most_m)
        if not all(0 <= value < math.inf for value in (*times, *lengths)):
            raise ConfigError(f"{self.name}: times and lengths must not be negative")
        if not (self.ego_brake_mps2 > 0 and self.object_brake_mps2 > 0):
            raise ConfigError(f"{self.name}: decelerations must be positive")

    def distance_m(self, ego_mps: float, object_mps: float) -> float:
        """Distance to a target within which it brakes."""
        stopping = abs(ego_mps) * self.autoware_response_s + ego_mps**2 / (2 * self.ego_brake_mps2)
        return stopping - object_mps * abs(object_mps) / (2 * self.object_brake_mps2) + self.offset_m

    def reach_m(self, ego_mps: float) -> float:
        """How far ahead of the ego's front its path is looked along."""
        turn = max(ego_mps * self.turn_horizon_s, self.turn_least_m)
        return max(ego_mps * self.horizon_s, min(turn, self.turn_most_m))

    def decide(
        self, state: AutowareState | None, now: Assessment
    ) -> tuple[AutowareState, Command, tuple[Event, ...]]:
        """One decision; see `smartmot.decision.rules.BrakeRule`."""
        state = state or AutowareState()
        stamp, speed = now.ego.stamp_s, now.ego.speed_mps
        speeds = tuple(entry for entry in state.speeds if stamp - entry[0] <= self.speed_s)
        collision = False
        if not stands(now):  # its MIN_MOVING_VELOCITY_THRESHOLD is the same 0.1 m/s
            rows = targets(now, self.expand_width_m).nonzero()[0]
            if len(rows):
                k = int(rows[np.argmin(now.path_gap_m[rows])])
                gap = max(float(now.path_gap_m[k]), 0.0)
                if gap <= self.reach_m(speed):
                    speeds = (*speeds, (stamp, float(now.path_speed_mps[k])))
                    collision = gap <= self.distance_m(speed, median(v for _, v in speeds))
        last = stamp if collision else state.collision_s
        keeps = last is not None and stamp - last <= self.keep_s
        braking, events = next_braking(state.braking, now, int(collision), keeps or is_held(now))
        return AutowareState(braking, speeds, last), Command(braking.stage > 0, now.lead), events


AUTOWARE_README = Autoware(
    object_brake_mps2=3.0, offset_m=2.0, expand_width_m=0.1, horizon_s=1.5, name="autoware_readme"
)
"""The table of the module's README at the same commit."""
