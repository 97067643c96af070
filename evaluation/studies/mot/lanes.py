"""Forecasts along the lanes of a map."""

from __future__ import annotations

import numpy as np

from evaluation.studies.mot.forecasts import Carry
from evaluation.studies.mot.tracking import TrackedSequence
from scenarios.errors import DatasetError
from scenarios.recorded.maps.drive_map import DriveMap
from smartmot.geometry import wrap_angle
from smartmot.maps.route import Route, route_ahead
from smartmot.maps.walks import lane_ends, lane_headings, lane_length_m
from smartmot.types import FloatArray, IntArray

FOLLOWERS = ("car", "truck", "motorcycle", "cyclist", "unknown")
"""Categories that keep to lanes."""

LEAST_SPEED_MPS = 0.5
"""Slower objects have no direction to compare with the lane's."""

MAX_TURN_RAD = np.pi / 4
"""An object that moves at a greater angle to a lane crosses it and does not follow it."""

AHEAD_M = 200.0
"""Length of the lanes ahead that are looked at: over 3 s at 200 km/h."""


class LaneForecast:
    """Moves what drives in a lane along it, with its present offset from the centre.

    Speed and, where the filter estimates it, acceleration along the course stay constant; what brakes stops.
    At forks the lane that turns least is taken. Pedestrians, what stands, crosses lanes or is beside them,
    and what reaches the end of the map move as without it.

    Args:
        network: The map, in the frame of the data.
    """

    def __init__(self, network: DriveMap) -> None:
        self._network = network
        self._routes: dict[int, Route] = {}

    def along_lanes(self, free: Carry) -> Carry:
        """The forecast that follows lanes where it can, and `free` elsewhere."""
        placed: dict[int, tuple[TrackedSequence, IntArray, FloatArray]] = {}

        def carry(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
            positions = free(tracked, rows, time_s)
            if id(tracked) not in placed:  # the entry keeps the sequence, so its id stays its own
                placed[id(tracked)] = (tracked, *self._places(tracked))
            _, lane, station_offset = placed[id(tracked)]
            distance = _driven(tracked, rows, time_s)
            for index in np.unique(lane[rows]):
                if index < 0:
                    continue
                chosen = np.flatnonzero(lane[rows] == index)
                route = self._routes[int(index)]
                station = station_offset[rows[chosen], 0] + distance[chosen]
                inside = station <= route.length_m
                chosen, station = chosen[inside], station[inside]
                positions[chosen] = route.poses(station, station_offset[rows[chosen], 1])[0]
            return positions

        return carry

    def _places(self, tracked: TrackedSequence) -> tuple[IntArray, FloatArray]:
        """Lane of each track row, -1 without one, and (K, 2) station and offset on the route along it."""
        tracks = tracked.tracks
        lane = np.full(len(tracks), -1, dtype=np.int64)
        place = np.zeros((len(tracks), 2))
        speed = np.hypot(tracks.velocity_mps[:, 0], tracks.velocity_mps[:, 1])
        rows = np.flatnonzero(np.isin(tracks.category, FOLLOWERS) & (speed > LEAST_SPEED_MPS))
        if not len(rows):
            return lane, place
        nearest = self._network.nearest_lane(tracks.center_m[rows])
        inside = nearest.found & (nearest.distance_m <= 0.0)
        rows, lanes, s_m = rows[inside], nearest.lane[inside], nearest.s_m[inside]
        course = np.arctan2(tracks.velocity_mps[rows, 1], tracks.velocity_mps[rows, 0])
        turn = wrap_angle(course - lane_headings(self._network, lanes, s_m))
        along = np.abs(turn) <= MAX_TURN_RAD
        lane[rows[along]] = lanes[along]
        for index in np.unique(lanes[along]).tolist():
            on_it = rows[along][lanes[along] == index]
            place[on_it] = np.column_stack(self._route(index).place(tracks.center_m[on_it]))
        return lane, place

    def _route(self, lane: int) -> Route:
        """The way ahead from the entry of a lane."""
        if lane not in self._routes:
            entry_s_m, _ = lane_ends(self._network, lane)
            ahead = lane_length_m(self._network, lane) + AHEAD_M
            self._routes[lane] = route_ahead(self._network, lane, entry_s_m, ahead)
        return self._routes[lane]


def _driven(tracked: TrackedSequence, rows: IntArray, time_s: FloatArray) -> FloatArray:
    """(R,) distances driven at constant acceleration along the course; what brakes stops."""
    velocity = tracked.tracks.velocity_mps[rows]
    speed = np.hypot(velocity[:, 0], velocity[:, 1])
    along = (tracked.acceleration_mps2[rows] * velocity).sum(axis=1) / np.maximum(speed, 1e-9)
    until_stop_s = np.where(along < 0.0, speed / np.maximum(-along, 1e-9), np.inf)
    moving_s = np.minimum(time_s, until_stop_s)
    return np.asarray(speed * moving_s + 0.5 * along * moving_s**2)


def require_cover(network: DriveMap, points_m: FloatArray, what: str) -> None:
    """See that a map and data lie in the same place.

    Args:
        network: The map.
        points_m: (K, 2) positions in the data.
        what: What the positions are, for the message.

    Raises:
        DatasetError: No position lies within the map's bounds.
    """
    low_x, low_y, high_x, high_y = network.bounds
    inside = (points_m >= (low_x, low_y)) & (points_m <= (high_x, high_y))
    if len(points_m) and not inside.all(axis=1).any():
        (x0, y0), (x1, y1) = points_m.min(axis=0), points_m.max(axis=0)
        raise DatasetError(
            f"--map: does not cover the data: map x {low_x:.0f}..{high_x:.0f} m, "
            f"y {low_y:.0f}..{high_y:.0f} m; {what} x {x0:.0f}..{x1:.0f} m, y {y0:.0f}..{y1:.0f} m"
        )
