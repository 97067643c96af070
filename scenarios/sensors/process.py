"""Makes detections with the errors of `SensorErrors`, frame by frame."""

from __future__ import annotations

import math
from statistics import NormalDist

import numpy as np

from scenarios.errors import ScenarioError
from scenarios.sensors.boxes import BoxMeasurement, SensorConfig
from scenarios.sensors.errors import (
    CONFUSED_WITH,
    GAUSSIAN,
    MISS_INTERVAL_S,
    NORMALS,
    OCCLUSION_SHARES,
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

_RADIAL, _TANGENTIAL, _YAW, _LENGTH, _WIDTH, _FLIP, _CLASS, _VELOCITY_X, _VELOCITY_Y, _MISS = range(10)
"""Columns of the standard normal processes that every object has; the last two kinds are white."""

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
    error happens scales it. Misses are a Markov chain: with the same random number, a frame is missed or not
    whatever the frame before was, unless the number lies between P(miss | hit) and P(miss | miss). So two
    runs that see an object at the same range miss the same frames after a few.

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
        times = (position, position, heading, size, size, heading, size, 0.0, 0.0, 0.0)
        self._kept = np.array([math.exp(-self._interval_s / time) if time else 0.0 for time in times])
        self._new = np.sqrt(1.0 - self._kept**2)
        self._ghosts = Ghosts(config, errors, seed) if errors.has_ghosts else None
        self._first, self._last = -1, -1
        self._normal = np.zeros((0, _MISS + 1))
        self._missed = np.zeros(0, dtype=np.bool_)

    def _tables(self) -> None:
        """Rows of errors as arrays over cells: the B bands of range, and for each the C categories."""
        errors = self._errors
        limits = sorted({row.up_to_m for row in errors.rows if row.up_to_m < math.inf})
        cells = [
            errors.row_at(name, upper) for upper in [*limits, math.inf] for name in CATEGORIES
        ]  # None beyond the last row
        rows = [row or BoxErrors(miss=(1.0, 1.0, 1.0)) for row in cells]
        tails = list(dict.fromkeys(tail for row in rows for tail in (row.position_tail, row.yaw_tail)))
        self._limits = np.array(limits)
        self._quantiles = np.stack([tail.quantiles() for tail in tails])
        self._tail = np.array([[tails.index(row.position_tail), tails.index(row.yaw_tail)] for row in rows])
        self._gaussian = tails == [GAUSSIAN]
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
        deviates = []
        for rate, persistence in zip(rates, row.miss_persistence, strict=True):
            # of a chain of two states the correlation falls by the same factor in equal times
            kept = persistence ** (self._interval_s / MISS_INTERVAL_S)
            chances = (rate, rate * (1.0 - kept), rate + (1.0 - rate) * kept)
            deviates.append([deviate(chance) for chance in chances])
        return deviates

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
        self._go_to(measurement.number, self._miss[cell, level], ego)
        seen = (measurement.visible & ~self._missed).nonzero()[0]
        code, cell, normal = code.take(seen), cell.take(seen), self._normal.take(seen, axis=0)
        sight = delta.take(seen, axis=0) / np.maximum(range_m.take(seen), 1e-9)[:, None]
        detected = self._noisy(boxes[seen], sight, cell, normal)
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
            Detections, measurement.stamp_s, detected, scores, _NAMES.take(code), velocity, NOTHING_DROPPED
        )

    def _noisy(self, boxes: Boxes, sight: FloatArray, cell: IntArray, normal: FloatArray) -> Boxes:
        """Boxes with errors of position, heading and size, for (N, 2) directions of sight."""
        bias, radial, tangential, yaw, length, width, length_sigma, width_sigma = self._values.take(
            cell, axis=0
        ).T
        shaped = normal[:, : _YAW + 1]
        if not self._gaussian:
            tail = self._tail.take(cell, axis=0)[:, (0, 0, 1)]
            shaped = self._shaped(shaped, tail)
        along = bias + radial * shaped[:, _RADIAL]
        across = tangential * shaped[:, _TANGENTIAL]
        error = np.empty((len(cell), 2))
        error[:, 0] = along * sight[:, 0] - across * sight[:, 1]
        error[:, 1] = along * sight[:, 1] + across * sight[:, 0]
        factor = np.empty((len(cell), 2))
        factor[:, 0] = length + length_sigma * normal[:, _LENGTH]
        factor[:, 1] = width + width_sigma * normal[:, _WIDTH]
        turned = yaw * shaped[:, _YAW] + np.pi * (normal[:, _FLIP] < self._flip.take(cell))
        return unchecked(
            Boxes,
            boxes.center_m + error,
            boxes.size_m * np.maximum(factor, _LEAST_SIZE),
            wrap_angle(boxes.yaw_rad + turned),
        )

    def _shaped(self, normal: FloatArray, tail: IntArray) -> FloatArray:
        """Values of the mixtures at deviates, by linear interpolation."""
        place = (normal - NORMALS[0]) / (NORMALS[1] - NORMALS[0])
        left = np.clip(place.astype(np.int64), 0, len(NORMALS) - 2)
        low = self._quantiles[tail, left]
        shaped: FloatArray = low + (place - left) * (self._quantiles[tail, left + 1] - low)
        return shaped

    def _velocity(self, measurement: BoxMeasurement, seen: IntArray, normal: FloatArray) -> FloatArray | None:
        sigma_mps, velocity_mps = self._errors.velocity_sigma_mps, measurement.velocity_mps
        if sigma_mps is None or velocity_mps is None:
            return None
        noise: FloatArray = sigma_mps * normal[:, _VELOCITY_X : _VELOCITY_Y + 1]
        return velocity_mps.take(seen, axis=0) + noise

    def _go_to(self, number: int, miss: FloatArray, ego: EgoState) -> None:
        """Bring the processes to a measurement, whose (N, 3) deviates of misses are known."""
        count = len(miss)
        if self._last < 0 or number <= self._last or count > len(self._normal):
            self._first = number if self._last < 0 else min(self._first, number)
            self._last = self._first
            self._begin(self._last, count, miss, ego)
        self._normal, self._missed = self._normal[:count], self._missed[:count]
        while self._last < number:
            self._last += 1
            self._go_on(self._last, miss, ego)

    def _draw(self, number: int, count: int) -> FloatArray:
        """Row by row, so that those behind an object do not change its numbers."""
        return np.random.default_rng((self._seed, number, _STREAM)).standard_normal((count, _MISS + 1))

    def _begin(self, number: int, count: int, miss: FloatArray, ego: EgoState) -> None:
        """Stationary from the first measurement on."""
        self._normal = self._draw(number, count)
        self._missed = self._normal[:, _MISS] < miss[:, 0]
        if self._ghosts is not None:
            self._ghosts.begin(number, ego)

    def _go_on(self, number: int, miss: FloatArray, ego: EgoState) -> None:
        """One measurement further."""
        new = self._draw(number, len(self._normal))
        new *= self._new
        self._normal = self._kept * self._normal + new
        chance = np.where(self._missed, miss[:, 2], miss[:, 1])
        self._missed = self._normal[:, _MISS] < chance
        if self._ghosts is not None:
            self._ghosts.go_on(number, ego)

    def _ghost_centers(self, ghosts: Ghosts, ego: EgoState) -> FloatArray:
        """(G, 2) centres with the white noise of their categories and ranges."""
        range_m = np.hypot(ghosts.center_m[:, 0] - ego.x_m, ghosts.center_m[:, 1] - ego.y_m)
        cell = self._limits.searchsorted(range_m) * len(CATEGORIES) + ghosts.code
        radial, tangential = self._values[cell, 1], self._values[cell, 2]
        sigma = np.sqrt((radial**2 + tangential**2) / 2.0)
        center: FloatArray = ghosts.center_m + sigma[:, None] * ghosts.normal
        return center
