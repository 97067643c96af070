"""Sensors and detectors: from the world to what perception is told of it."""

from scenarios.sensors.boxes import BoxDetector, BoxMeasurement, BoxSensor, SensorConfig, visible_share
from scenarios.sensors.interfaces import Detector, Measurement, SensorChain, SensorModel, Timing
from scenarios.sensors.sensor import ObjectDetector, Sensor
from scenarios.sensors.world import FlatGround, MapSurface, RoadSurface, World

__all__ = [
    "BoxDetector",
    "BoxMeasurement",
    "BoxSensor",
    "Detector",
    "FlatGround",
    "MapSurface",
    "Measurement",
    "ObjectDetector",
    "RoadSurface",
    "Sensor",
    "SensorChain",
    "SensorConfig",
    "SensorModel",
    "Timing",
    "World",
    "visible_share",
]
