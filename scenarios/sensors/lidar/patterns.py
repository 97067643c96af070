"""Where a LiDAR's rays point, and when: spinning scanners and the rosette of two rotating prisms.

Sensor's frame: x ahead, y left, z up. The stamp of a cloud is the time of its last ray, so that no ray lies
in the future.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Protocol

import numpy as np

from scenarios.errors import ScenarioError
from smartmot.arrays import FloatArray, IntArray

HDL32_ELEVATION_DEG = tuple(-92.0 / 3.0 + 4.0 / 3.0 * row for row in range(32))
"""-30.67 to +10.67 deg, 4/3 deg apart. Velodyne, HDL-32E User's Manual, vertical angles."""

HDL64_ELEVATION_DEG = (
    *(-24.0 - 1.0 / 3.0 + 0.5 * row for row in range(32)),
    *(-8.0 - 1.0 / 3.0 + row / 3.0 for row in range(32)),
)
"""Lower block -24.33 to -8.83 deg, 1/2 deg apart, upper block -8.33 to +2 deg, 1/3 deg apart. Velodyne,
HDL-64E S2 User's Manual. Nominal: a unit's own table differs by some tenths of a degree."""

HDL32_CYCLE_S = 46.08e-6
"""Time from one firing of all 32 lasers to the next. Velodyne, HDL-32E User's Manual."""

HDL64_CYCLE_S = 48.0e-6
"""64 lasers at 1.333 million points a second. Velodyne, HDL-64E S2 User's Manual."""


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """N rays of a cloud, sensor's frame.

    Args:
        direction: (N, 3) unit vectors.
        time_offset_s: (N,) when each is shot, after the stamp of the cloud: 0 or negative.
        ring: (N,) number of the laser, the lowest first; zeros where there is one.
    """

    direction: FloatArray
    time_offset_s: FloatArray
    ring: IntArray

    def __post_init__(self) -> None:
        for column in (self.direction, self.time_offset_s, self.ring):
            column.flags.writeable = False

    def __len__(self) -> int:
        return len(self.direction)


class Pattern(Protocol):
    """The rays of a LiDAR."""

    @property
    def rate_hz(self) -> float:
        """Clouds per second."""

    @property
    def duration_s(self) -> float:
        """Longest time between the first and the last ray of a cloud."""

    def rays(self, number: int) -> Rays:
        """The rays of a cloud; equal arguments give the same object.

        Args:
            number: of the cloud, counted from 0.
        """
        ...


@dataclass(frozen=True, slots=True)
class Spinning:
    """A column of lasers that turns clockwise, seen from above.

    The lasers of a column fire at one time: within a cycle of 50 us a car at 30 m/s moves by 1.5 mm.

    Args:
        elevation_deg: of the lasers, ascending.
        rate_hz: turns per second.
        cycle_s: time from one column to the next.
        field_rad: horizontal field of view, symmetric about x; 2 pi: all round, cut behind.

    Raises:
        ScenarioError: rate, cycle or field are out of range, or elevations do not ascend.
    """

    elevation_deg: tuple[float, ...]
    rate_hz: float = 10.0
    cycle_s: float = HDL64_CYCLE_S
    field_rad: float = 2.0 * math.pi

    def __post_init__(self) -> None:
        if not (0.0 < self.rate_hz < math.inf and 0.0 < self.cycle_s * self.rate_hz <= 0.5):
            raise ScenarioError(
                "lidar: rate and cycle must be positive and leave two columns a turn; got "
                f"{self.rate_hz:g} Hz, {self.cycle_s:g} s"
            )
        if not 0.0 < self.field_rad <= 2.0 * math.pi:
            raise ScenarioError(f"lidar: field_rad must lie in (0, 2 pi], got {self.field_rad:g}")
        angles = (-90.0, *self.elevation_deg, 90.0)
        if len(angles) < 3 or not all(low < high for low, high in pairwise(angles)):
            raise ScenarioError("lidar: elevation_deg must ascend between -90 and 90 deg")

    @property
    def columns_per_turn(self) -> int:
        """Columns of a whole turn."""
        return round(1.0 / (self.rate_hz * self.cycle_s))

    @property
    def duration_s(self) -> float:
        """Time from the first column to the last."""
        return (self._columns - 1) / (self.columns_per_turn * self.rate_hz)

    @property
    def _columns(self) -> int:
        return max(round(self.columns_per_turn * self.field_rad / (2.0 * math.pi)), 1)

    def rays(self, number: int) -> Rays:
        """The rays of a turn, column after column; every turn has the same."""
        return _turn(self)


@lru_cache(maxsize=8)
def _turn(pattern: Spinning) -> Rays:
    columns, step = pattern._columns, 2.0 * math.pi / pattern.columns_per_turn
    after_first = np.arange(columns)
    azimuth = step * (0.5 * (columns - 1) - after_first)
    time = (after_first - (columns - 1)) / (pattern.columns_per_turn * pattern.rate_hz)
    elevation = np.radians(pattern.elevation_deg)
    rows = len(elevation)
    direction = np.empty((columns, rows, 3))
    direction[..., 0] = np.cos(azimuth)[:, None] * np.cos(elevation)
    direction[..., 1] = np.sin(azimuth)[:, None] * np.cos(elevation)
    direction[..., 2] = np.sin(elevation)
    ring = np.tile(np.arange(rows, dtype=np.int64), columns)
    return Rays(direction.reshape(-1, 3), np.repeat(time, rows), ring)


@dataclass(frozen=True, slots=True)
class Rosette:
    """One laser behind two prisms that turn at different speeds: the pattern of a Livox Mid-70.

    Both prisms are wedges; the first turns its slope to the laser, the second away from it. Between them the
    faces are parallel, so that they cancel and two refractions are left. The defaults reproduce the table of
    directions that Livox publishes to 4.4e-6 deg RMS up to a phase.

    Args:
        rate_hz: clouds per second.
        integration_s: time for which shots are gathered. Clouds overlap where it is longer than 1 / rate.
        shot_s: time from one shot to the next.
        wedge_rad: angle of the prisms.
        index: of refraction.
        first_rpm, second_rpm: turns per minute.

    Raises:
        ScenarioError: a value is out of range.
    """

    rate_hz: float = 10.0
    integration_s: float = 0.1
    shot_s: float = 1e-5
    wedge_rad: float = math.radians(18.0)
    index: float = 1.8144
    first_rpm: float = 7294.0
    second_rpm: float = -4664.0

    def __post_init__(self) -> None:
        if not (0.0 < self.rate_hz < math.inf and 0.0 < self.shot_s <= self.integration_s < math.inf):
            raise ScenarioError(
                "lidar: rate and time between shots must be positive, the integration time at least one "
                f"shot; got {self.rate_hz:g} Hz, {self.shot_s:g} s and {self.integration_s:g} s"
            )
        if not (
            0.0 < self.wedge_rad < math.pi / 2.0 and self.index >= 1.0 and self.widest_rad < math.pi / 2.0
        ):
            raise ScenarioError("lidar: wedge and index of refraction must let all light through the prisms")

    @property
    def widest_rad(self) -> float:
        """Angle from the axis where both prisms bend the ray to the same side."""
        inside = self.wedge_rad - math.asin(math.sin(self.wedge_rad) / self.index)
        sine = self.index * math.sin(self.wedge_rad + inside)
        return math.asin(sine) - self.wedge_rad if sine < 1.0 else math.inf

    @property
    def duration_s(self) -> float:
        """Time from the first shot to the last."""
        return (self._shots - 1) * self.shot_s

    @property
    def _shots(self) -> int:
        return round(self.integration_s / self.shot_s)

    def rays(self, number: int) -> Rays:
        """The shots that end with the stamp of the cloud; the pattern goes on from cloud to cloud."""
        return _shots(self, round(number / (self.rate_hz * self.shot_s)))


@lru_cache(maxsize=64)  # runs that share a sensor repeat the same clouds; 0.4 MB for 10,000 shots
def _shots(pattern: Rosette, last: int) -> Rays:
    count = pattern._shots
    after_last = np.arange(1 - count, 1, dtype=np.float64)
    direction = rosette_direction(pattern, (after_last + last) * pattern.shot_s)
    return Rays(direction, after_last * pattern.shot_s, np.zeros(count, dtype=np.int64))


def rosette_direction(pattern: Rosette, time_s: FloatArray) -> FloatArray:
    """(N, 3) unit vectors of a rosette's rays at (N,) times, sensor's frame."""
    ray = np.zeros((len(time_s), 3))
    ray[:, 0] = 1.0
    inside = _refracted(ray, _slope(pattern.wedge_rad, pattern.first_rpm, time_s), 1.0 / pattern.index)
    return _refracted(inside, _slope(-pattern.wedge_rad, pattern.second_rpm, time_s), pattern.index)


def _slope(wedge_rad: float, rpm: float, time_s: FloatArray) -> FloatArray:
    """(N, 3) normals, along the light, of the slope of a turning prism."""
    turned = 2.0 * math.pi / 60.0 * rpm * time_s
    sine = math.sin(wedge_rad)
    return np.column_stack(
        (np.full(len(turned), math.cos(wedge_rad)), sine * np.cos(turned), sine * np.sin(turned))
    )


def _refracted(ray: FloatArray, normal: FloatArray, ratio: float) -> FloatArray:
    """(N, 3) rays behind a face, by Snell's law; ratio: index before it over index behind it."""
    cosine = (ray * normal).sum(axis=1)
    behind = np.sqrt(1.0 - ratio**2 * (1.0 - cosine**2))
    refracted: FloatArray = ratio * ray + (behind - ratio * cosine)[:, None] * normal
    return refracted
