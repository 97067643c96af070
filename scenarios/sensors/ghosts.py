"""False positives of a sensor: where they appear, and how long they stay."""

from __future__ import annotations

import math

import numpy as np

from scenarios.sensors.boxes import SensorConfig
from scenarios.sensors.errors import GHOST_AHEAD_M, SensorErrors
from smartmot.filters.motion_models import table
from smartmot.types import CATEGORIES, EgoState, FloatArray, IntArray

_STREAM = 2
"""Stream of random numbers beside those of plain noise and of the objects."""

_SIZES_M = np.array([(3.9, 1.6), (0.8, 0.6), (1.76, 0.6), (10.1, 2.6), (1.76, 0.6), (3.9, 1.6)])
"""Lengths and widths by category: the anchors of PointPillars for KITTI's car, pedestrian and cyclist (Lang
et al. 2019), and the mean truck of Frustum PointNets (Qi et al. 2018); others assumed."""

_NEAREST_M = np.array([4.2, 5.0, 3.2, 4.2, 3.2, 4.2])
"""No ghost is nearer, by category: the nearest of those on KITTI (`scenarios.sensors.measured_errors`);
motorcycles as cyclists, others as cars. Nearer is the ego itself, which no detector reports."""

_NOTHING = np.zeros((0, 6))


class Ghosts:
    """Ghosts along a run: Poisson births, exponential lives, uniform over a ring about the ego.

    How many there are follows from the seed and the number of the measurement alone; a ghost stands where the
    ego's pose at its birth puts it.

    Args:
        config: the sensor.
        errors: its errors.
        seed: of the errors.
    """

    def __init__(self, config: SensorConfig, errors: SensorErrors, seed: int) -> None:
        self._seed = seed
        self._rate = table(errors.ghosts_per_frame)
        self._survival = math.exp(-1.0 / config.rate_hz / errors.ghost_life_s)
        self._range_m = np.full(len(CATEGORIES), config.range_m)
        if errors.ghost_range_m is not None:
            self._range_m = np.minimum(self._range_m, table(errors.ghost_range_m))
        self._nearest_m = np.minimum(_NEAREST_M, self._range_m)
        self._view_rad = config.fov_rad if errors.ghost_view_rad is None else errors.ghost_view_rad
        self._ahead = None if errors.ghost_ahead is None else table(errors.ghost_ahead)
        self._rows = _NOTHING

    def __len__(self) -> int:
        return len(self._rows)

    @property
    def code(self) -> IntArray:
        """(G,) positions of their categories in CATEGORIES."""
        return self._rows[:, 0].astype(np.int64)

    @property
    def center_m(self) -> FloatArray:
        """(G, 2) where they stand, map frame."""
        return self._rows[:, 1:3]

    @property
    def yaw_rad(self) -> FloatArray:
        """(G,) headings."""
        return self._rows[:, 3]

    @property
    def normal(self) -> FloatArray:
        """(G, 2) normal deviates of this measurement, for white noise."""
        return self._rows[:, 4:]

    @property
    def size_m(self) -> FloatArray:
        """(G, 2) lengths and widths."""
        return _SIZES_M.take(self.code, axis=0)

    def begin(self, number: int, ego: EgoState) -> None:
        """As many as there are on average, at a first measurement."""
        rng = self._random(number)
        self._rows = self._born(rng, self._rate, ego)
        self._jitter(rng)

    def go_on(self, number: int, ego: EgoState) -> None:
        """One measurement further."""
        rng, rows = self._random(number), self._rows
        if len(rows):
            rows = rows[rng.random(len(rows)) < self._survival]
        born = self._born(rng, self._rate * (1.0 - self._survival), ego)
        self._rows = np.concatenate((rows, born)) if len(born) else rows
        self._jitter(rng)

    def _random(self, number: int) -> np.random.Generator:
        return np.random.default_rng((self._seed, number, _STREAM))

    def _jitter(self, rng: np.random.Generator) -> None:
        if len(self._rows):
            self._rows[:, 4:] = rng.standard_normal((len(self._rows), 2))

    def _born(self, rng: np.random.Generator, rate: FloatArray, ego: EgoState) -> FloatArray:
        """(G, 6) new ghosts: position of the category, x, y, heading and two deviates."""
        count = rng.poisson(rate)
        if not count.any():
            return _NOTHING
        code = np.repeat(np.arange(len(CATEGORIES)), count)
        share = rng.random((len(code), 3))
        inner, outer = self._nearest_m.take(code) ** 2, self._range_m.take(code) ** 2
        distance = np.sqrt(inner + (outer - inner) * share[:, 1])
        bearing = ego.yaw_rad + self._bearing(code, distance, share[:, 0])
        x, y = ego.x_m + distance * np.cos(bearing), ego.y_m + distance * np.sin(bearing)
        yaw = np.pi * (2.0 * share[:, 2] - 1.0)
        return np.column_stack((code, x, y, yaw, np.zeros((len(code), 2))))

    def _bearing(self, code: IntArray, distance_m: FloatArray, share: FloatArray) -> FloatArray:
        """(G,) angles to the left of the heading, from numbers uniform in [0, 1)."""
        half = 0.5 * self._view_rad
        signed = 2.0 * share - 1.0
        if self._ahead is None:
            return half * signed
        # of the angles at its distance, those at which it is ahead take their share, the others the rest
        edge = np.minimum(np.arcsin(np.minimum(GHOST_AHEAD_M / np.maximum(distance_m, 1e-9), 1.0)), half)
        ahead, size = self._ahead.take(code), np.abs(signed)
        outside = edge + (half - edge) * (size - ahead) / np.maximum(1.0 - ahead, 1e-9)
        return np.copysign(np.where(size < ahead, edge * size / np.maximum(ahead, 1e-9), outside), signed)
