"""The detectors behind one function."""

from __future__ import annotations

import math

import numpy as np

from smartmot.arrays import frozen
from smartmot.errors import ConfigError
from smartmot.lidar.classical import ClassicalConfig, detect_classical
from smartmot.lidar.detections import BoxDetections
from smartmot.lidar.learned import LearnedConfig, detect_learned
from smartmot.lidar.monitored import Monitored
from smartmot.lidar.plain import PlainConfig, detect_plain
from smartmot.pointcloud import PointCloud

METHODS: dict[str, type[ClassicalConfig] | type[PlainConfig]] = {
    "classical": ClassicalConfig,
    "plain": PlainConfig,
}
"""Detectors by name, and the parameters of each; a network is named by its file."""

DetectorConfig = ClassicalConfig | PlainConfig | LearnedConfig


def detect(
    cloud: PointCloud,
    config: DetectorConfig,
    *,
    monitored: Monitored | None = None,
    sensor_height_m: float | None = None,
) -> BoxDetections:
    """Boxes of road users in a cloud, in its frame.

    Args:
        cloud: P points, x ahead, y left, z up.
        config: parameters; their class says which detector it is.
        monitored: (P,) points that may be of a road user, or what says it of (Q, 3) points, such as
            `smartmot.lidar.monitored.points_on` with an area; the others are only looked at for the ground.
            None: all.
        sensor_height_m: of the sensor over the ground, as the mount says; None: not known. The cloud has the
            last word.

    Raises:
        ConfigError: the height is not positive, or a network cannot be loaded.
        ShapeError: `monitored` has another length than the cloud.
    """
    if sensor_height_m is not None and not 0.0 < sensor_height_m < math.inf:
        raise ConfigError(f"sensor_height_m: must be positive, got {sensor_height_m:g} m")
    if monitored is not None and not callable(monitored):
        monitored = frozen(monitored, np.bool_, (len(cloud),), "monitored")
    if isinstance(config, LearnedConfig):
        return detect_learned(cloud, config, monitored=monitored, sensor_height_m=sensor_height_m)
    if isinstance(config, ClassicalConfig):
        return detect_classical(cloud, config, monitored=monitored, sensor_height_m=sensor_height_m)
    return detect_plain(cloud, config, monitored=monitored, sensor_height_m=sensor_height_m)
