"""Sensors and detectors."""

from scenarios.sensors.sensor import ObjectDetector, Sensor, SensorConfig, visible_share

__all__ = ["ObjectDetector", "Sensor", "SensorConfig", "visible_share"]
