"""Road users in point clouds: boxes in the sensor's frame."""

from smartmot.lidar.classical import ClassicalConfig
from smartmot.lidar.detections import BoxDetections, Stage
from smartmot.lidar.detector import METHODS, DetectorConfig, detect
from smartmot.lidar.learned import LearnedConfig
from smartmot.lidar.plain import PlainConfig

__all__ = [
    "METHODS", "BoxDetections", "ClassicalConfig", "DetectorConfig", "LearnedConfig", "PlainConfig", "Stage",
    "detect",
]  # fmt: skip
