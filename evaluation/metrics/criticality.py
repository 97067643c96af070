"""Criticality over time, from ground truth: time to collision, required deceleration, brake threat number.

Definitions: time to collision and required longitudinal acceleration as in L. Westhofen et al., "Criticality
metrics for automated driving" (Arch. Comput. Methods Eng. 2022; github.com/lu-w/criticality-metrics), both
with constant velocities as the prediction; brake threat number as in J. Jansson, "Collision avoidance theory"
(Linkoeping 2005): required over available deceleration; from 1 on braking alone no longer avoids a contact.
With constant velocities a straight line is foreseen: in a bend people outside it are on a collision course
for these measures although the ego will turn away from them.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from evaluation.results.tables import csv_bytes
from smartmot.types import FloatArray, IntArray


@dataclass(frozen=True, slots=True, eq=False)
class Moving:
    """Boxes that move at constant velocity; the leading shapes broadcast.

    Args:
        center_m: (..., 2) map frame.
        size_m: (..., 2) length and width.
        yaw_rad: (...) heading.
        speed_mps: (...) along the heading.
    """

    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray
    speed_mps: FloatArray

    @property
    def heading(self) -> FloatArray:
        """(..., 2) unit vectors."""
        return np.stack((np.cos(self.yaw_rad), np.sin(self.yaw_rad)), axis=-1)

    @property
    def velocity_mps(self) -> FloatArray:
        """(..., 2) map frame."""
        velocity: FloatArray = self.heading * self.speed_mps[..., None]
        return velocity


@dataclass(frozen=True, slots=True, eq=False)
class Criticality:
    """How critical a run is at T times; of several objects, the worst.

    Args:
        time_s: (T,) times of the log.
        time_to_collision_s: (T,) infinite without a collision course.
        required_decel_mps2: (T,) 0 without one, infinite in contact.
        brake_threat_number: (T,) the same over what the brakes give.
    """

    time_s: FloatArray
    time_to_collision_s: FloatArray
    required_decel_mps2: FloatArray
    brake_threat_number: FloatArray


def time_to_collision_s(ego: Moving, other: Moving) -> FloatArray:
    """(...) time until the outlines touch at constant velocity; infinite if they never do.

    Two rectangles are apart as long as they are along one of their four edge directions. Along each, the time
    in which they overlap is an interval; they touch when the last of the four begins.
    """
    relative = other.center_m - ego.center_m
    velocity = other.velocity_mps - ego.velocity_mps
    enter, leave = np.zeros(relative.shape[:-1]), np.full(relative.shape[:-1], np.inf)
    for owner in (ego, other):
        ahead = owner.heading
        for axis in (ahead, np.stack((-ahead[..., 1], ahead[..., 0]), axis=-1)):
            reach = _reach(ego, axis) + _reach(other, axis)
            position, rate = (relative * axis).sum(axis=-1), (velocity * axis).sum(axis=-1)
            with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
                first, second = (-reach - position) / rate, (reach - position) / rate
            still = rate == 0.0
            always = np.abs(position) <= reach
            low = np.where(still, np.where(always, -np.inf, np.inf), np.minimum(first, second))
            high = np.where(still, np.where(always, np.inf, -np.inf), np.maximum(first, second))
            enter, leave = np.maximum(enter, low), np.minimum(leave, high)
    return np.where(enter <= leave, enter, np.inf)


def required_decel_mps2(ego: Moving, other: Moving, time_to_collision_s: FloatArray) -> FloatArray:
    """(...) constant deceleration that takes off the closing speed within the gap along the ego's heading.

    0 where there is no collision course, infinite where the gap is used up.
    """
    ahead = ego.heading
    gap = ((other.center_m - ego.center_m) * ahead).sum(axis=-1) - _reach(other, ahead) - _reach(ego, ahead)
    closing = ((ego.velocity_mps - other.velocity_mps) * ahead).sum(axis=-1)
    counts = np.isfinite(time_to_collision_s) & (closing > 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        needed = np.where(gap > 0.0, closing**2 / (2 * gap), np.inf)
    return np.where(counts, needed, 0.0)


def criticality(log: Mapping[str, NDArray[Any]], available_decel_mps2: float) -> Criticality:
    """Criticality of a run over the times at which its log has an ego.

    Args:
        log: columns as from `RunLog.table`; actors at other times are left out.
        available_decel_mps2: what the brakes give on the road at hand.
    """
    of_ego = log["kind"] == "ego"
    time_s, first = np.unique(log["time_s"][of_ego], return_index=True)
    actors = np.flatnonzero((log["kind"] == "actor") & np.isin(log["time_s"], time_s))
    return worst_criticality(
        time_s,
        _moving(log, np.flatnonzero(of_ego)[first]),
        _moving(log, actors),
        np.searchsorted(time_s, log["time_s"][actors]),
        available_decel_mps2,
    )


def worst_criticality(
    time_s: FloatArray, ego: Moving, actors: Moving, at: IntArray, available_decel_mps2: float
) -> Criticality:
    """Criticality over time, of all actors the worst.

    Args:
        time_s: (T,) times.
        ego: (T,) the ego at them.
        actors: (K,) all actors at all times.
        at: (K,) which of the times each is from.
        available_decel_mps2: what the brakes give on the road at hand.
    """
    then = Moving(ego.center_m[at], ego.size_m[at], ego.yaw_rad[at], ego.speed_mps[at])
    ttc = time_to_collision_s(then, actors)
    least_s, needed = np.full(len(time_s), np.inf), np.zeros(len(time_s))
    np.minimum.at(least_s, at, ttc)
    np.maximum.at(needed, at, required_decel_mps2(then, actors, ttc))
    return Criticality(time_s, least_s, needed, needed / available_decel_mps2)


def criticality_csv(over_time: Criticality) -> bytes:
    """One line per time; a time to collision is empty without a collision course."""
    header = ("time_s", "time_to_collision_s", "required_decel_mps2", "brake_threat_number")
    columns = (
        over_time.time_s,
        np.where(np.isinf(over_time.time_to_collision_s), np.nan, over_time.time_to_collision_s),
        over_time.required_decel_mps2,
        over_time.brake_threat_number,
    )
    rows = zip(*(column.tolist() for column in columns), strict=True)
    return csv_bytes(header, ([round(value, 6) for value in row] for row in rows))


def _reach(box: Moving, axis: FloatArray) -> FloatArray:
    """(...) half the extent of a box along an axis."""
    ahead = box.heading
    along = np.abs((ahead * axis).sum(axis=-1))
    across = np.abs(ahead[..., 0] * axis[..., 1] - ahead[..., 1] * axis[..., 0])
    reach: FloatArray = 0.5 * (box.size_m[..., 0] * along + box.size_m[..., 1] * across)
    return reach


def _moving(log: Mapping[str, NDArray[Any]], rows: NDArray[np.int64]) -> Moving:
    return Moving(
        np.column_stack((log["x_m"][rows], log["y_m"][rows])),
        np.column_stack((log["length_m"][rows], log["width_m"][rows])),
        log["yaw_rad"][rows],
        log["speed_mps"][rows],
    )
