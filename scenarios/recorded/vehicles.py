"""The vehicles that recorded the known data sets: outlines, and where in them the recorded pose is."""

from __future__ import annotations

import math
from dataclasses import dataclass

from scenarios.errors import DatasetError


@dataclass(frozen=True, slots=True)
class Vehicle:
    """A recording vehicle.

    Args:
        length_m: outline along the heading.
        width_m: outline across it.
        center_ahead_m: how far the middle of the outline is ahead of the point whose poses are recorded.

    Raises:
        DatasetError: a number is not finite, or the outline is not that of a road vehicle.
    """

    length_m: float = 4.4
    width_m: float = 1.8
    center_ahead_m: float = 0.0

    def __post_init__(self) -> None:
        if not (0.5 <= self.length_m <= 30.0 and 0.3 <= self.width_m <= 5.0):
            raise DatasetError(
                "vehicle: length must lie in 0.5..30 m and width in 0.3..5 m, "
                f"got {self.length_m:g} and {self.width_m:g}"
            )
        if not math.isfinite(self.center_ahead_m) or abs(self.center_ahead_m) > self.length_m:
            raise DatasetError(
                f"vehicle: the recorded point must be within {self.length_m:g} m of the middle, "
                f"got {self.center_ahead_m:g}"
            )


VEHICLES = {
    # VW Passat B6 Variant: 4.77 m x 1.82 m, wheelbase 2.71 m (Volkswagen, 2005: auto55.be/nieuws/7497).
    # Poses are those of camera 0: 0.27 m ahead of the lidar, which is 0.81 m ahead of the IMU, which is
    # 0.05 m behind the rear axle (A. Geiger et al., IJRR 32 (2013) 1231, figure 3; the axle as py123d has it
    # for KITTI-360): 1.03 m. The rear overhang of 1.12 m is assumed; py123d has 1.05 m for the same car.
    "kitti": Vehicle(4.77, 1.82, 0.24),
    # Renault Zoe: 4.084 m x 1.73 m, wheelbase 2.588 m (Wikipedia; py123d has the same for nuScenes, and the
    # middle 1.385 m ahead). Poses are those of the midpoint of the rear axle (H. Caesar et al., nuScenes,
    # CVPR 2020, supplement). The rear overhang of 0.66 m is assumed.
    "nuscenes": Vehicle(4.084, 1.73, 1.38),
    # Ford Fusion: the box EGO_VEHICLE of the data set's logs. Poses are those of the middle of the rear axle
    # (assumed; sideways and turning speed of two logs agree within 0.1 m), taken for half the wheelbase of
    # 2.85 m (autocade.net, Ford Fusion CD391) behind the middle (assumed).
    "argoverse": Vehicle(4.877, 2.0, 1.42),
}
"""By format; others are taken for a car whose middle is recorded."""


def vehicle_of(form: str) -> Vehicle:
    """The vehicle that recorded data of a format."""
    return VEHICLES.get(form, Vehicle())
