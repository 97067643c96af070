"""LiDARs by name: pattern, mount, reach and noise."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from scenarios.errors import ScenarioError
from scenarios.sensors.lidar.patterns import (
    HDL32_CYCLE_S,
    HDL32_ELEVATION_DEG,
    HDL64_CYCLE_S,
    HDL64_ELEVATION_DEG,
    Pattern,
    Rosette,
    Spinning,
)


@dataclass(frozen=True, slots=True)
class Mount:
    """Where a sensor is on its vehicle.

    Args:
        height_m: over the ground.
        forward_m: ahead of the centre of the vehicle's box.
        pitch_rad: nose down.

    Raises:
        ScenarioError: the height is not positive, or a value is not finite or no pitch.
    """

    height_m: float = 1.73
    forward_m: float = 0.0
    pitch_rad: float = 0.0

    def __post_init__(self) -> None:
        if not (
            0.0 < self.height_m < math.inf and math.isfinite(self.forward_m) and abs(self.pitch_rad) < 1.5
        ):
            raise ScenarioError(
                f"lidar: the mount needs a positive height and a pitch under 1.5 rad, got {self}"
            )


@dataclass(frozen=True, slots=True)
class LidarConfig:
    """A LiDAR.

    Args:
        pattern: its rays and its rate.
        mount: where it is; the default height is that of KITTI's.
        range_m: farthest echo.
        blind_m: nearest echo.
        range_sigma_m: standard deviation of a range.
        dropout: probability that an echo is lost.
        latency_s: age of a cloud when it reaches the detector, counted from its last ray.
        phase_s: time of the first cloud.
        motion_compensated: points are where they were relative to the sensor at the stamp, by the ego's
            motion; if not, relative to the sensor when they were shot.

    Raises:
        ScenarioError: a value is out of range.
    """

    pattern: Pattern
    mount: Mount = field(default_factory=Mount)
    range_m: float = 100.0
    blind_m: float = 0.05
    range_sigma_m: float = 0.02
    dropout: float = 0.0
    latency_s: float = 0.0
    phase_s: float = 0.0
    motion_compensated: bool = True

    def __post_init__(self) -> None:
        if not 0.0 <= self.blind_m < self.range_m < math.inf:
            raise ScenarioError(f"lidar: echoes from {self.blind_m:g} m to {self.range_m:g} m are none")
        if not all(0.0 <= value < math.inf for value in (self.range_sigma_m, self.latency_s, self.phase_s)):
            raise ScenarioError("lidar: noise, latency and phase must be finite and not negative")
        if not 0.0 <= self.dropout <= 1.0:
            raise ScenarioError(f"lidar: dropout must lie in [0, 1], got {self.dropout:g}")


HDL32 = LidarConfig(Spinning(HDL32_ELEVATION_DEG, 20.0, HDL32_CYCLE_S), range_m=100.0)
"""Velodyne HDL-32E at 20 Hz: 1,085 columns of 32. Echoes up to 100 m, 2 cm: its User's Manual."""

HDL64 = LidarConfig(Spinning(HDL64_ELEVATION_DEG, 10.0, HDL64_CYCLE_S), range_m=120.0)
"""Velodyne HDL-64E at 10 Hz: 2,083 columns of 64. Echoes up to 120 m, 2 cm: its User's Manual."""

MID70 = LidarConfig(Rosette(), range_m=260.0, range_sigma_m=0.03)
"""Livox Mid-70: 100,000 shots a second, 260 m at 80 % reflectivity, 3 cm up to 1 m, blind up to 5 cm: its
User Manual. Its range noise farther out is assumed to be the same."""

SENSORS = {"hdl32": HDL32, "hdl64": HDL64, "mid70": MID70}
"""LiDARs by name."""


def lidar_config(name: str) -> LidarConfig:
    """The LiDAR of a name.

    Raises:
        ScenarioError: there is none.
    """
    if name not in SENSORS:
        raise ScenarioError(f"lidar: no sensor {name!r}; choose {', '.join(SENSORS)}")
    return SENSORS[name]
