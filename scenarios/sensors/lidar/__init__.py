"""LiDAR: the world as a cloud of points."""

from scenarios.sensors.lidar.config import HDL32, HDL64, MID70, SENSORS, LidarConfig, Mount, lidar_config
from scenarios.sensors.lidar.measurement import LidarMeasurement
from scenarios.sensors.lidar.patterns import Rays, Rosette, Spinning
from scenarios.sensors.lidar.sensor import LidarSensor
from scenarios.sensors.lidar.street import BARE, Street, furnished_street

__all__ = [
    "BARE",
    "HDL32",
    "HDL64",
    "MID70",
    "SENSORS",
    "LidarConfig",
    "LidarMeasurement",
    "LidarSensor",
    "Mount",
    "Rays",
    "Rosette",
    "Spinning",
    "Street",
    "furnished_street",
    "lidar_config",
]
