"""Sensors and detectors: from the world to what perception is told of it."""

from scenarios.sensors.boxes import BoxMeasurement, BoxSensor, SensorConfig, visible_share
from scenarios.sensors.detector import BoxDetector
from scenarios.sensors.errors import BoxErrors, SensorErrors, Tail
from scenarios.sensors.interfaces import Detector, Measurement, SensorChain, SensorModel, Timing
from scenarios.sensors.sensor import ObjectDetector, Sensor
from scenarios.sensors.world import FlatGround, MapSurface, RoadSurface, World

__all__ = [
    "BoxDetector",
    "BoxErrors",
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
    "SensorErrors",
    "SensorModel",
    "Tail",
    "Timing",
    "World",
    "visible_share",
]
