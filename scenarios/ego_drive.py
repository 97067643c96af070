"""The ego's drive: speed kept, adapted to what is ahead (highway-env's IDM), or braked in an emergency."""

from __future__ import annotations

from typing import Any

import numpy as np
from highway_env.road.lane import StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from scenarios.brakes import BrakeConfig
from scenarios.openscenario.control import Motion
from scenarios.openscenario.paths import Path
from smartmot.pipeline import LeadObject


class Follower(IDMVehicle):  # type: ignore[misc]
    """highway-env's Intelligent Driver Model for a vehicle of a given length, on a road of its own.

    Only the distance and the speed of a leader matter to the model, so that its road is straight.

    Args:
        speed_mps: initial and desired speed.
        length_m: of the vehicle.
    """

    COMFORT_DECEL_MPS2 = 4.0
    """Limit of the speed adaptation (ACC): ISO 15622 allows 3.5 to 5 m/s2 depending on speed."""
    STANDSTILL_GAP_M = 2.0

    def __init__(self, speed_mps: float, length_m: float) -> None:
        lane = StraightLane([0.0, 0.0], [1.0, 0.0], speed_limit=None)
        network = RoadNetwork()
        network.add_lane("start", "end", lane)
        super().__init__(
            Road(network),
            [0.0, 0.0],
            speed=speed_mps,
            target_lane_index=("start", "end", 0),
            target_speed=speed_mps,
            enable_lane_change=False,
        )
        self.LENGTH = length_m
        self.DISTANCE_WANTED = length_m + self.STANDSTILL_GAP_M
        self.DELTA = 4.0  # exponent of the free-road term, Treiber et al. 2000

    def on_state_update(self) -> None:
        """Nothing to look up: there is one lane."""

    def accel_mps2(self, speed_mps: float, lead: LeadObject | None) -> float:
        """Acceleration at a speed behind a leader (None: on a free road), within the limits of comfort."""
        self.speed = speed_mps
        front: Any = None
        if lead is not None:
            front = Vehicle(None, np.array([lead.gap_m + self.LENGTH, 0.0]), 0.0)
            front.speed = lead.speed_mps
        wanted = float(self.acceleration(self, front))
        if self.target_speed <= 0.0:  # highway-env's formula divides by it
            wanted = min(wanted, 0.0)
        return min(max(wanted, -self.COMFORT_DECEL_MPS2), float(self.COMFORT_ACC_MAX))


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
        self.speed_mps = 0.0
        self.accel_mps2 = 0.0
        self.braking_since_s: float | None = None
        self._comfort_mps2 = 0.0
        self._follower = Follower(0.0, length_m)

    def take_over(self, time_s: float, path: Path, station_m: float, speed_mps: float) -> None:
        """Keep the initial speed until told otherwise."""
        self.speed_mps = speed_mps
        self._follower = Follower(speed_mps, self._length_m)

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
        if self.speed_mps >= 0.0:  # in reverse it is driven by the test's own robot
            self._comfort_mps2 = self._follower.accel_mps2(self.speed_mps, lead if self._adapts else None)

    def motion(self, time_s: float, duration_s: float) -> Motion:
        """Distance driven and speed left after a duration under the present control."""
        if self.speed_mps < 0.0:
            return Motion(self.speed_mps * duration_s, self.speed_mps)
        if self.braking_since_s is not None:
            return Motion(*self.brakes.travel(self.speed_mps, time_s - self.braking_since_s, duration_s))
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
