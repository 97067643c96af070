"""Adaptive speed behind a leader: highway-env's Intelligent Driver Model.

A module of its own, imported by runs that adapt their speed: highway-env takes a second to import.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from highway_env.road.lane import StraightLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from smartmot.decision.rules import LeadObject


class Follower(IDMVehicle):  # type: ignore[misc]
    """highway-env's Intelligent Driver Model for a vehicle of a given length, on a road of its own.

    Only the distance and the speed of a leader matter to the model, so that its road is straight.

    Args:
        length_m: of the vehicle.
    """

    COMFORT_DECEL_MPS2 = 4.0
    """Limit of the speed adaptation (ACC): ISO 15622 allows 3.5 to 5 m/s2 depending on speed."""
    STANDSTILL_GAP_M = 2.0

    def __init__(self, length_m: float) -> None:
        lane = StraightLane([0.0, 0.0], [1.0, 0.0], speed_limit=None)
        network = RoadNetwork()
        network.add_lane("start", "end", lane)
        super().__init__(
            Road(network),
            [0.0, 0.0],
            target_lane_index=("start", "end", 0),
            target_speed=0.0,
            enable_lane_change=False,
        )
        self.LENGTH = length_m
        self.DISTANCE_WANTED = length_m + self.STANDSTILL_GAP_M
        self.DELTA = 4.0  # exponent of the free-road term, Treiber et al. 2000

    def on_state_update(self) -> None:
        """Nothing to look up: there is one lane."""

    def accel_mps2(
        self, speed_mps: float, lead: LeadObject | None, desired_mps: float, desired_mps2: float = 0.0
    ) -> float:
        """Acceleration at a speed behind a leader (None: on a free road), within the limits of comfort.

        A desired speed that changes is kept up with: its own change stands beside the model's free-road term.

        Args:
            speed_mps: of the vehicle.
            lead: whom it follows.
            desired_mps: speed on a free road.
            desired_mps2: how that changes; a harder deceleration than comfort allows is carried out.
        """
        self.speed, self.target_speed = speed_mps, desired_mps
        front: Any = None
        if lead is not None:
            front = Vehicle(None, np.array([lead.gap_m + self.LENGTH, 0.0]), 0.0)
            front.speed = lead.speed_mps
        wanted = float(self.acceleration(self, front))
        if desired_mps2:
            free = float(self.acceleration(self, None))
            wanted += min(free + desired_mps2, max(free, float(self.COMFORT_ACC_MAX))) - free
        if desired_mps <= 0.0:  # highway-env's formula divides by it
            wanted = min(wanted, 0.0)
        hardest = min(-self.COMFORT_DECEL_MPS2, desired_mps2)
        return min(max(wanted, hardest), float(self.COMFORT_ACC_MAX))
