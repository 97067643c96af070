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
