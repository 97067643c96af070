"""The ego vehicle: highway-env's kinematic bicycle, lane keeping and IDM, with our brakes."""

from __future__ import annotations

from typing import Any

import numpy as np
from highway_env.road.lane import AbstractLane
from highway_env.road.road import Road, RoadNetwork
from highway_env.vehicle.behavior import IDMVehicle
from highway_env.vehicle.kinematics import Vehicle

from scenarios.brakes import BrakeConfig
from smartmot.pipeline import LeadObject
from smartmot.route import Route
from smartmot.types import EgoState

LANE_INDEX = ("start", "end", 0)


class RouteLane(AbstractLane):  # type: ignore[misc]
    """A route as a highway-env lane, so that highway-env's controllers can follow it."""

    def __init__(self, route: Route, width_m: float = 3.5) -> None:
        self.route = route
        self.length = route.length_m
        self.width = width_m
        self.forbidden = False
        self.priority = 0
        self.speed_limit = None
        delta = np.diff(route.center_m, axis=0)
        self._heading = np.unwrap(np.arctan2(delta[:, 1], delta[:, 0]))
        self._middle = (route.station_m[:-1] + route.station_m[1:]) / 2

    def position(self, longitudinal: float, lateral: float) -> Any:
        """(2,) point at a station and an offset to the left, metres."""
        return np.array(self.route.pose(longitudinal, lateral)[:2])

    def heading_at(self, longitudinal: float) -> float:
        """Heading of the route at a station, radians; interpolated between its samples."""
        return float(np.interp(longitudinal, self._middle, self._heading))

    def width_at(self, longitudinal: float) -> float:
        """Width, metres."""
        return self.width

    def local_coordinates(self, position: Any) -> tuple[float, float]:
        """Station and offset to the left of a point, metres."""
        return self.route.project(float(position[0]), float(position[1]))

    @classmethod
    def from_config(cls, config: dict[str, Any]) -> RouteLane:
        """Not available: a route comes from a map.

        Raises:
            TypeError: always.
        """
        raise TypeError("a RouteLane is made from a Route, not from a configuration")

    def to_config(self) -> dict[str, Any]:
        """Length and width, for display."""
        return {"length": self.length, "width": self.width}


class EgoVehicle(IDMVehicle):  # type: ignore[misc]
    """highway-env vehicle whose longitudinal motion is integrated exactly.

    Args:
        route: what it drives along.
        station_m: where its centre starts.
        speed_mps: initial and desired speed.
        length_m, width_m: outline.
        brakes: emergency brake.
    """

    position: Any  # (2,) array, metres, map frame; highway-env declares no types
    heading: float
    speed: float

    COMFORT_DECEL_MPS2 = 4.0
    """Limit of the speed adaptation (ACC): ISO 15622 allows 3.5 to 5 m/s2 depending on speed."""
    STANDSTILL_GAP_M = 2.0

    def __init__(
        self,
        route: Route,
        station_m: float,
        speed_mps: float,
        length_m: float,
        width_m: float,
        brakes: BrakeConfig,
    ) -> None:
        lane = RouteLane(route)
        network = RoadNetwork()
        network.add_lane("start", "end", lane)
        x, y, yaw = route.pose(station_m)
        # the constructor looks the lane up once; later steps stay on it
        super().__init__(
            Road(network),
            [x, y],
            heading=yaw,
            speed=speed_mps,
            target_lane_index=LANE_INDEX,
            target_speed=speed_mps,
            enable_lane_change=False,
        )
        self.LENGTH, self.WIDTH = length_m, width_m
        self.DISTANCE_WANTED = length_m + self.STANDSTILL_GAP_M
        self.DELTA = 4.0  # exponent of the free-road term, Treiber et al. 2000
        self.brakes = brakes
        self.braking_since_s: float | None = None
        self.accel_mps2 = 0.0
        self.yaw_rate_radps = 0.0
        self._comfort_mps2 = 0.0

    def on_state_update(self) -> None:
        """Nothing to look up: the vehicle stays on its route."""

    def control(self, time_s: float, emergency: bool, lead: LeadObject | None) -> None:
        """Take over one decision: emergency brake on or off, steering, adapted speed.

        Args:
            time_s: now.
            emergency: whether to brake fully.
            lead: object whose speed is adapted to, if any.
        """
        if emergency and self.braking_since_s is None:
            self.braking_since_s = time_s
        elif not emergency:
            self.braking_since_s = None
        front = None
        if lead is not None:
            front = Vehicle(None, self.position + self.direction * (lead.gap_m + self.LENGTH), self.heading)
            front.speed = lead.speed_mps
        idm = float(self.acceleration(self, front))
        self._comfort_mps2 = float(np.clip(idm, -self.COMFORT_DECEL_MPS2, self.COMFORT_ACC_MAX))
        self.action = {"steering": self.steering_control(LANE_INDEX), "acceleration": 0.0}

    def travel(self, time_s: float, duration_s: float) -> tuple[float, float]:
        """Distance driven and speed left after a time under the present control; changes nothing."""
        if self.braking_since_s is not None:
            return self.brakes.travel(self.speed, time_s - self.braking_since_s, duration_s)
        a = self._comfort_mps2
        moving = duration_s if a >= 0 else min(duration_s, self.speed / -a)
        return self.speed * moving + a * moving**2 / 2, max(self.speed + a * moving, 0.0)

    def pose_after(self, time_s: float, duration_s: float) -> tuple[float, float, float, float]:
        """(x_m, y_m, yaw_rad, speed_mps) after a time under the present control; changes nothing.

        The bicycle model of highway-env's `Vehicle.step`, with the exact distance in place of speed x time.
        """
        distance, speed = self.travel(time_s, duration_s)
        slip = np.arctan(0.5 * np.tan(self.action["steering"]))
        turn = distance * np.sin(slip) / (self.LENGTH / 2)
        course = self.heading + slip + turn / 2
        x, y = self.position
        return (
            float(x + distance * np.cos(course)),
            float(y + distance * np.sin(course)),
            float(self.heading + turn),
            speed,
        )

    def advance(self, time_s: float, duration_s: float) -> None:
        """Move on by a time step that starts at `time_s`."""
        x, y, yaw, speed = self.pose_after(time_s, duration_s)
        self.accel_mps2 = (speed - self.speed) / duration_s
        self.yaw_rate_radps = (yaw - self.heading) / duration_s
        self.position = np.array([x, y])
        self.heading, self.speed = yaw, speed

    def state(self, stamp_s: float) -> EgoState:
        """Odometry, map frame."""
        return EgoState(
            stamp_s=stamp_s,
            x_m=float(self.position[0]),
            y_m=float(self.position[1]),
            yaw_rad=float(self.heading),
            speed_mps=float(self.speed),
            accel_mps2=self.accel_mps2,
            yaw_rate_radps=self.yaw_rate_radps,
            length_m=self.LENGTH,
            width_m=self.WIDTH,
        )
