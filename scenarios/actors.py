"""Scripted road users: they stand, or walk a straight path once triggered."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from smartmot.types import Boxes, FloatArray, StrArray

KMH = 1 / 3.6


@dataclass(frozen=True, slots=True)
class Actor:
    """One road user.

    Args:
        category: one of the detection categories.
        label: target (the one the test is about) or adversary.
        x_m, y_m, yaw_rad: pose of the box centre at the start, map frame.
        length_m, width_m: box along and across its yaw.
        speed_mps: speed along its yaw once it moves; 0 for one that stands.
        accel_distance_m: distance over which it reaches that speed from standstill, at constant
            acceleration; 0: at once.
        path_m: distance after which it stands still.
    """

    category: str
    label: str
    x_m: float
    y_m: float
    yaw_rad: float
    length_m: float
    width_m: float
    speed_mps: float = 0.0
    accel_distance_m: float = 0.0
    path_m: float = 0.0

    def time_to(self, distance_m: float) -> float:
        """Seconds from the trigger until it has gone a distance (no more than `path_m`)."""
        if self.speed_mps <= 0 or distance_m > self.path_m:
            return float("inf")
        if distance_m < self.accel_distance_m:
            return float(2 * np.sqrt(distance_m * self.accel_distance_m)) / self.speed_mps
        return (distance_m + self.accel_distance_m) / self.speed_mps


class Actors:
    """All actors of a world as arrays; their poses are closed forms of time."""

    def __init__(self, actors: Sequence[Actor]) -> None:
        self.actors = tuple(actors)
        self.category: StrArray = np.array([a.category for a in actors], dtype=np.str_)
        column = {
            name: np.array([getattr(a, name) for a in actors], dtype=np.float64)
            for name in (
                "x_m",
                "y_m",
                "yaw_rad",
                "length_m",
                "width_m",
                "speed_mps",
                "accel_distance_m",
                "path_m",
            )
        }
        self.size_m = np.column_stack((column["length_m"], column["width_m"]))
        self.yaw_rad = column["yaw_rad"]
        self._start = np.column_stack((column["x_m"], column["y_m"]))
        self._direction = np.column_stack((np.cos(self.yaw_rad), np.sin(self.yaw_rad)))
        self._speed, self._path = column["speed_mps"], column["path_m"]
        self._run_up = column["accel_distance_m"]
        with np.errstate(divide="ignore", invalid="ignore"):
            self._run_up_time = np.where(self._speed > 0, 2 * self._run_up / self._speed, 0.0)

    def __len__(self) -> int:
        return len(self.actors)

    def motion(self, since_s: float | None) -> tuple[FloatArray, FloatArray]:
        """(N,) distance gone and (N,) speed, a time after the trigger (None: not triggered)."""
        if since_s is None or since_s <= 0:
            return np.zeros(len(self)), np.zeros(len(self))
        late = since_s >= self._run_up_time
        fraction = np.divide(since_s, self._run_up_time, out=np.ones(len(self)), where=self._run_up_time > 0)
        distance = np.where(
            late, self._run_up + self._speed * (since_s - self._run_up_time), self._run_up * fraction**2
        )
        speed = np.where(late, self._speed, self._speed * fraction)
        done = distance >= self._path
        return np.minimum(distance, self._path), np.where(done, 0.0, speed)

    def centers(self, since_s: float | None) -> FloatArray:
        """(N, 2) box centres, map frame."""
        return self._start + self._direction * self.motion(since_s)[0][:, None]

    def boxes(self, since_s: float | None) -> Boxes:
        """N boxes, map frame."""
        return self.state(since_s)[0]

    def state(self, since_s: float | None) -> tuple[Boxes, FloatArray]:
        """N boxes, map frame, and (N,) speeds."""
        distance, speed = self.motion(since_s)
        return Boxes(self._start + self._direction * distance[:, None], self.size_m, self.yaw_rad), speed
