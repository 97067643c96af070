"""The shipped detector: visible boxes of the ground truth in, detections with seeded errors out."""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from scenarios.sensors.boxes import BoxMeasurement, SensorConfig
from scenarios.sensors.process import ErrorProcess
from smartmot.geometry import wrap_angle
from smartmot.types import NOTHING_DROPPED, Boxes, Detections, FloatArray, unchecked


class BoxDetector:
    """Reports visible boxes with seeded errors.

    The errors of object i in measurement k are the same whatever else is in the scene or is decided.

    Args:
        config: noise and probability of detection.
        seed: of the errors.
    """

    latency_s = 0.0
    rate_hz: float | None = None

    def __init__(self, config: SensorConfig, seed: int) -> None:
        self.config, self.seed = config, seed
        self._process = error_process(config, seed)

    def detect(self, measurement: BoxMeasurement) -> Detections:
        """Detections of one measurement, stamped with its time."""
        return detected(self.config, self.seed, measurement, self._process)


def error_process(config: SensorConfig, seed: int) -> ErrorProcess | None:
    """Errors of a sensor along a run; None: it has white noise alone."""
    return None if config.errors is None else ErrorProcess(config, seed)


def _entropy(seed: int, number: int) -> NDArray[np.uint32] | tuple[int, int]:
    """What seeds the errors of a measurement: both numbers; as words of 32 bits numpy need not split them."""
    if 0 <= seed < 2**32 and 0 <= number < 2**32:
        return np.array((seed, number), dtype=np.uint32)
    return seed, number


@lru_cache(maxsize=4096)
def _drawn(seed: int, number: int, count: int) -> tuple[FloatArray, FloatArray]:
    """(count, 3) standard normal errors and (count,) chances of a measurement, read-only.

    To seed a generator takes longer than to draw, and all runs of a sweep with one seed have the same errors.
    """
    rng = np.random.default_rng(_entropy(seed, number))
    noise, chance = rng.standard_normal((count, 3)), rng.random(count)
    noise.flags.writeable = chance.flags.writeable = False
    return noise, chance


def detected(
    config: SensorConfig, seed: int, measurement: BoxMeasurement, process: ErrorProcess | None = None
) -> Detections:
    """What is reported of the visible boxes, with the errors of a process if there is one."""
    if process is not None:
        return process.report(measurement)
    boxes, visible = measurement.boxes, measurement.visible
    if not np.count_nonzero(visible):
        return Detections.empty(measurement.stamp_s)
    n = len(boxes)
    # drawn for all objects, so that who else is visible does not change an object's error
    noise, chance = _drawn(seed, measurement.number, n)
    if config.detection_probability < 1.0:
        visible = visible & (chance < config.detection_probability)
    reported = visible.nonzero()[0]
    noise, boxes = noise.take(reported, axis=0), boxes[reported]
    # true boxes of known categories, with a finite error, need no second check
    noisy = unchecked(
        Boxes,
        boxes.center_m + config.position_sigma_m * noise[:, :2],
        boxes.size_m,
        wrap_angle(boxes.yaw_rad + config.yaw_sigma_rad * noise[:, 2]),
    )
    scores, names = np.ones(len(reported)), measurement.category.take(reported)
    return unchecked(Detections, measurement.stamp_s, noisy, scores, names, None, NOTHING_DROPPED, None, "")
