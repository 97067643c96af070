"""Who takes part in a drawn scene: outline, way, and speed as a closed form of time."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from scenarios.openscenario.motion.paths import Pose
from smartmot.path import PlannedPath
from smartmot.types import FloatArray


@dataclass(frozen=True, slots=True)
class Outline:
    """A road user's box; its reference point is the middle.

    Args:
        category: pedestrian, bicycle or car.
        length_m, width_m, height_m: of the box.
    """

    category: str
    length_m: float
    width_m: float
    height_m: float


OUTLINES = {
    # ISO 19206-2 (Euro NCAP EPTa, EPTc)
    "adult": Outline("pedestrian", 0.6, 0.5, 1.8),
    "child": Outline("pedestrian", 0.711, 0.298, 1.154),
    # ISO 19206-4 (Euro NCAP EBT)
    "bicyclist": Outline("bicycle", 1.89, 0.5, 1.2),
    # within the ranges of Euro NCAP's small and large obstruction vehicles
    "small car": Outline("car", 4.316, 1.79, 1.48),
    "large car": Outline("car", 4.418, 1.82, 1.533),
}
EGO = Outline("car", 4.4, 1.8, 1.5)
"""As the ego of the shipped scenarios."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Speed along the way: standing at first or not, then steady, at last stopping or not.

    Args:
        speed_mps: steady speed; 0: stands all the time.
        sets_off_s: when it sets off with constant acceleration; None: it moves steadily from the start.
        accelerates_m: over which distance.
        brakes_after_m: way from its start after which it brakes with constant deceleration; None: never.
        brakes_m: over which distance it stops.
    """

    speed_mps: float = 0.0
    sets_off_s: float | None = None
    accelerates_m: float = 0.5
    brakes_after_m: float | None = None
    brakes_m: float = 0.4

    def way_m(self, time_s: FloatArray) -> FloatArray:
        """(T,) way covered."""
        speed = self.speed_mps
        if speed == 0.0:
            return np.zeros_like(time_s)
        if self.sets_off_s is None:
            way = speed * time_s
        else:
            since = np.maximum(time_s - self.sets_off_s, 0.0)
            fast_after = 2.0 * self.accelerates_m / speed
            way = np.where(
                since < fast_after,
                speed * since**2 / (2.0 * fast_after),
                self.accelerates_m + speed * (since - fast_after),
            )
        if self.brakes_after_m is None:
            return way
        # from there on the steady way s would go on; braking over b covers s - s^2 / (4 b) up to s = 2 b
        beyond = np.clip(way - self.brakes_after_m, 0.0, 2.0 * self.brakes_m)
        return np.minimum(way, self.brakes_after_m) + beyond - beyond**2 / (4.0 * self.brakes_m)

    def time_to_s(self, way_m: float) -> float:
        """From setting off (or the start) until a way is covered that lies before the braking."""
        if self.sets_off_s is None:
            return way_m / self.speed_mps
        if way_m < self.accelerates_m:
            return 2.0 * math.sqrt(way_m * self.accelerates_m) / self.speed_mps
        return (way_m + self.accelerates_m) / self.speed_mps


STANDS = Motion()

Stays = Literal["", "on", "off"]
"""Where a road user keeps to."""


@dataclass(frozen=True, slots=True, eq=False)
class Actor:
    """A road user other than the ego.

    Args:
        name: in the scene.
        outline: key of `OUTLINES`.
        way_m: (P, 2) points that its middle goes through, map frame; it heads along them.
        motion: along the way.
        smooth: whether the way bends, so that the file has a smooth curve near its points.
        stays: over driving or cycle lanes (on), off driving lanes (off), or wherever it goes.
    """

    name: str
    outline: str
    way_m: FloatArray
    motion: Motion = STANDS
    smooth: bool = False
    stays: Stays = ""

    @property
    def box(self) -> Outline:
        """Its outline."""
        return OUTLINES[self.outline]

    @property
    def start(self) -> Pose:
        """Where it is at first."""
        x, y = self.way_m[0].tolist()
        dx, dy = (self.way_m[1] - self.way_m[0]).tolist()
        return Pose(x, y, math.atan2(dy, dx))

    def poses(self, time_s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """(T, 2) middles of its box, map frame, and (T,) headings."""
        return PlannedPath.through(self.way_m).poses(self.motion.way_m(time_s))


def standing(name: str, outline: str, pose: Pose, stays: Stays = "") -> Actor:
    """An actor that does not move."""
    ahead = pose.moved(1.0, 0.0)
    points = np.array([[pose.x_m, pose.y_m], [ahead.x_m, ahead.y_m]])
    return Actor(name, outline, points, stays=stays)


def straight(name: str, outline: str, pose: Pose, motion: Motion, length_m: float = 60.0) -> Actor:
    """An actor that goes straight ahead."""
    ahead = pose.moved(length_m, 0.0)
    return Actor(name, outline, np.array([[pose.x_m, pose.y_m], [ahead.x_m, ahead.y_m]]), motion)
