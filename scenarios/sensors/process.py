"""Makes detections with the errors of `SensorErrors`, frame by frame."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.sensors.boxes import BoxMeasurement, SensorConfig
from scenarios.sensors.errors import (
    CONFUSED_WITH,
    OCCLUSION_SHARES,
    PERSISTENCE_INTERVAL_S,
    BoxErrors,
    SensorErrors,
)
from scenarios.sensors.ghosts import Ghosts
from smartmot.geometry import wrap_angle
from smartmot.types import (
    CATEGORIES,
    NOTHING_DROPPED,
    Boxes,
    Detections,
    EgoState,
    FloatArray,
    IntArray,
    unchecked,
)

_CODES = {name: code for code, name in enumerate(CATEGORIES)}
_NAMES = np.array(CATEGORIES)
_CONFUSED = np.array([_CODES[CONFUSED_WITH[name]] for name in CATEGORIES])

_RADIAL, _TANGENTIAL, _YAW, _LENGTH, _WIDTH, _FLIP, _CLASS, _VELOCITY_X, _VELOCITY_Y, _CHAINS = range(10)
"""Columns of the standard normal processes that every object has. Velocities are white, and so are the last
three, from `_CHAINS` on: they drive the chains."""

_GROSS_POSITION, _GROSS_YAW, _MISSED = range(3)
"""Markov chains of two states that every object has: whether position and heading have the wider part of
their mixture, and whether the object is missed."""
_COLUMNS = _CHAINS + 3

_STREAM = 1
"""Stream of random numbers beside that of the plain noise."""

_LEAST_SIZE = 0.2
"""Share of the true size that a reported one keeps at least: a length stays positive. Assumed."""

_NORMAL = NormalDist()


def deviate(probability: float) -> float:
    """Normal deviate that as many lie below."""
    if 0.0 < probability < 1.0:
        return _NORMAL.inv_cdf(probability)
    return -math.inf if probability <= 0.0 else math.inf


class ErrorProcess:
    """Errors of one sensor along a run.

    Each object has standard normal processes, one for each kind of error. They follow from the seed, the
    number of the object and the number of the measurement, counted from the first, and from nothing else: not
    from who else is there, nor from what is decided. What is decided moves the ego, and the range at which an
    error happens scales it. Misses and gross errors are Markov chains: with the same random number, a frame
    is missed or not whatever the frame before was, unless the number lies between P(miss | hit) and
    P(miss | miss). So two runs that see an object at the same range miss the same frames after a few.

    The state is the processes' last values: a copy goes on as the original would. Measurements that are left
    out are passed through, as if the object had been where it is now. For one before the last all begins
    anew.

    Args:
        config: the sensor, with errors.
        seed: of the errors.
    """

    def __init__(self, config: SensorConfig, seed: int) -> None:
        errors = config.errors or SensorErrors()
        self._config, self._errors, self._seed = config, errors, seed
        self._interval_s = 1.0 / config.rate_hz
        self._tables()
        position, heading = errors.position_correlation_s, errors.heading_correlation_s
        size = errors.size_correlation_s
        times = (position, position, heading, size, size, heading, size, *(0.0 for _ in range(5)))
        self._kept = np.array([math.exp(-self._interval_s / time) if time else 0.0 for time in times])
        self._new = np.sqrt(1.0 - self._kept**2)
        self._ghosts = Ghosts(config, errors, seed) if errors.has_ghosts else None
        self._first, self._last = -1, -1
        self._normal = np.zeros((0, _COLUMNS))
        self._states = np.zeros((0, 3), dtype=np.bool_)  # of the chains

    def _tables(self) -> None:
        """Rows of errors as arrays over cells: the B bands of range, and for each the C categories."""
        errors = self._errors
        limits = sorted({row.up_to_m for row in errors.rows if row.up_to_m < math.inf})
        cells = [
            errors.row_at(name, upper) for upper in [*limits, math.inf] for name in CATEGORIES
        ]  # None beyond the last row
        rows = [row or BoxErrors(miss=(1.0, 1.0, 1.0)) for row in cells]
        tails = [(row.position_tail, row.yaw_tail) for row in rows]
        self._limits = np.array(limits)
        self._core = np.array([[tail.core_sigma for tail in pair] for pair in tails])
        self._wide = np.array([[tail.core_sigma * tail.ratio for tail in pair] for pair in tails])
        self._gross = np.array(
            [[self._chain(tail.share, tail.persistence) for tail in pair] for pair in tails]
        )
        self._values = np.array([self._row_values(row) for row in rows])
        self._flip = np.array([deviate(row.flip) for row in rows])
        self._confusion = np.array([deviate(row.confusion) for row in rows])
        self._miss = np.array([self._miss_deviates(row) for row in rows])

    def _row_values(self, row: BoxErrors) -> tuple[float, ...]:
        sigma, yaw = self._config.position_sigma_m, self._config.yaw_sigma_rad
        return (
            row.radial_bias_m,
            sigma if row.radial_sigma_m is None else row.radial_sigma_m,
            sigma if row.tangential_sigma_m is None else row.tangential_sigma_m,
            yaw if row.yaw_sigma_rad is None else row.yaw_sigma_rad,
            1.0 + row.length_bias,
            1.0 + row.width_bias,
            row.length_sigma,
            row.width_sigma,
        )

    def _miss_deviates(self, row: BoxErrors) -> list[list[float]]:
        """(3, 3) deviates of P(miss), P(miss | hit) and P(miss | miss) at each level of occlusion."""
        rates = row.miss or (1.0 - self._config.detection_probability,) * 3
        return [self._chain(*level) for level in zip(rates, row.miss_persistence, strict=True)]

    def _chain(self, rate: float, persistence: float) -> list[float]:
        """(3,) deviates of the share of a state, and of its chances after the other one and after itself."""
        # of a chain of two states the correlation falls by the same factor in equal times
        kept = persistence ** (self._interval_s / PERSISTENCE_INTERVAL_S)
        return [deviate(chance) for chance in (rate, rate * (1.0 - kept), rate + (1.0 - rate) * kept)]

    def report(self, measurement: BoxMeasurement) -> Detections:
        """Detections of one measurement, stamped with its time.

        Raises:
            ScenarioError: the measurement does not say from where and how far boxes are visible.
        """
        ego, boxes, share = measurement.ego, measurement.boxes, measurement.visible_share
        if ego is None or share is None:
            raise ScenarioError("sensor errors: the measurement has no pose of the ego or no visible shares")
        delta = boxes.center_m - np.array([ego.x_m, ego.y_m])
        range_m = np.hypot(delta[:, 0], delta[:, 1])
        code = np.array([_CODES[name] for name in measurement.category.tolist()], dtype=np.int64)
        cell = self._limits.searchsorted(range_m) * len(CATEGORIES) + code
        clear, partly = OCCLUSION_SHARES
        level = (share < clear) + (share < partly).astype(np.int64)
        chances = np.concatenate((self._gross[cell], self._miss[cell, level][:, None]), axis=1)
        self._go_to(measurement.number, chances, ego)
        seen = (measurement.visible & ~self._states[:, _MISSED]).nonzero()[0]
        code, cell, normal = code.take(seen), cell.take(seen), self._normal.take(seen, axis=0)
        sight = delta.take(seen, axis=0) / np.maximum(range_m.take(seen), 1e-9)[:, None]
        gross = self._states[seen, :_MISSED]
        scale = np.where(gross, self._wide.take(cell, axis=0), self._core.take(cell, axis=0))
        detected = self._noisy(boxes[seen], sight, cell, normal, scale)
        code = np.where(normal[:, _CLASS] < self._confusion.take(cell), _CONFUSED.take(code), code)
        velocity = self._velocity(measurement, seen, normal)
        ghosts = self._ghosts
        if ghosts is not None and len(ghosts):
            detected = unchecked(
                Boxes,
                np.concatenate((detected.center_m, self._ghost_centers(ghosts, ego))),
                np.concatenate((detected.size_m, ghosts.size_m)),
                np.concatenate((detected.yaw_rad, ghosts.yaw_rad)),
            )
            code = np.concatenate((code, ghosts.code))
            if velocity is not None:
                velocity = np.concatenate((velocity, np.zeros((len(ghosts), 2))))
        scores = np.ones(len(code))
        return unchecked(
            Detections,
            measurement.stamp_s,
            detected,
            scores,
            _NAMES.take(code),
            velocity,
            NOTHING_DROPPED,
            None,
            "",
        )

    def _noisy(
        self, boxes: Boxes, sight: FloatArray, cell: IntArray, normal: FloatArray, scale: FloatArray
    ) -> Boxes:
        """Boxes with errors of position, heading and size.

        Args:
            boxes: N true ones.
            sight: (N, 2) directions of sight.
            cell: (N,) rows of the errors.
            normal: (N, 12) values of the processes.
            scale: (N, 2) how wide the mixtures of position and heading are now, of standard deviation 1.
        """
        bias, radial, tangential, yaw, length, width, length_sigma, width_sigma = self._values.take(
            cell, axis=0
        ).T
        along = bias + radial * scale[:, _GROSS_POSITION] * normal[:, _RADIAL]
        across = tangential * scale[:, _GROSS_POSITION] * normal[:, _TANGENTIAL]
        error = np.empty((len(cell), 2))
        error[:, 0] = along * sight[:, 0] - across * sight[:, 1]
        error[:, 1] = along * sight[:, 1] + across * sight[:, 0]
        factor = np.empty((len(cell), 2))
        factor[:, 0] = length + length_sigma * normal[:, _LENGTH]
        factor[:, 1] = width + width_sigma * normal[:, _WIDTH]
        turned = yaw * scale[:, _GROSS_YAW] * normal[:, _YAW] + np.pi * (
            normal[:, _FLIP] < self._flip.take(cell)
        )
        return unchecked(
            Boxes,
            boxes.center_m + error,
            boxes.size_m * np.maximum(factor, _LEAST_SIZE),
            wrap_angle(boxes.yaw_rad + turned),
        )

    def _velocity(self, measurement: BoxMeasurement, seen: IntArray, normal: FloatArray) -> FloatArray | None:
        sigma_mps, velocity_mps = self._errors.velocity_sigma_mps, measurement.velocity_mps
        if sigma_mps is None or velocity_mps is None:
            return None
        noise: FloatArray = sigma_mps * normal[:, _VELOCITY_X : _VELOCITY_Y + 1]
        return velocity_mps.take(seen, axis=0) + noise

    def _go_to(self, number: int, chances: FloatArray, ego: EgoState) -> None:
        """Bring the processes to a measurement, whose (N, 3, 3) deviates of the chains are known."""
        count = len(chances)
        if self._last < 0 or number <= self._last or count > len(self._normal):
            self._first = number if self._last < 0 else min(self._first, number)
            self._last = self._first
            self._begin(self._last, chances, ego)
        self._normal, self._states = self._normal[:count], self._states[:count]
        while self._last < number:
            self._last += 1
            self._go_on(self._last, chances, ego)

    def _draw(self, number: int, count: int) -> FloatArray:
        """Row by row, so that those behind an object do not change its numbers."""
        return np.random.default_rng((self._seed, number, _STREAM)).standard_normal((count, _COLUMNS))

    def _begin(self, number: int, chances: FloatArray, ego: EgoState) -> None:
        """Stationary from the first measurement on."""
        self._normal = self._draw(number, len(chances))
        self._states = self._normal[:, _CHAINS:] < chances[:, :, 0]
        if self._ghosts is not None:
            self._ghosts.begin(number, ego)

    def _go_on(self, number: int, chances: FloatArray, ego: EgoState) -> None:
        """One measurement further."""
        new = self._draw(number, len(self._normal))
        new *= self._new
        self._normal = self._kept * self._normal + new
        chance = np.where(self._states, chances[:, :, 2], chances[:, :, 1])
        self._states = self._normal[:, _CHAINS:] < chance
        if self._ghosts is not None:
            self._ghosts.go_on(number, ego)

    def _ghost_centers(self, ghosts: Ghosts, ego: EgoState) -> FloatArray:
        """(G, 2) centres with white noise as the core of their categories' errors at their ranges.

        Measured from frame to frame: 0.04 m of pedestrians and 0.10 m of cars along each axis.
        """
        range_m = np.hypot(ghosts.center_m[:, 0] - ego.x_m, ghosts.center_m[:, 1] - ego.y_m)
        cell = self._limits.searchsorted(range_m) * len(CATEGORIES) + ghosts.code
        radial, tangential = self._values[cell, 1], self._values[cell, 2]
        sigma = self._core[cell, _GROSS_POSITION] * np.sqrt((radial**2 + tangential**2) / 2.0)
        center: FloatArray = ghosts.center_m + sigma[:, None] * ghosts.normal
        return center
