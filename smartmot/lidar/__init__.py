"""Road users in point clouds, without training data: boxes in the sensor's frame."""

from smartmot.lidar.classical import ClassicalConfig
from smartmot.lidar.detections import BoxDetections, Stage
from smartmot.lidar.detector import METHODS, detect
from smartmot.lidar.plain import PlainConfig

__all__ = ["METHODS", "BoxDetections", "ClassicalConfig", "PlainConfig", "Stage", "detect"]
