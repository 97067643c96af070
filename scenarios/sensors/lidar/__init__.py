"""LiDAR: the world as a cloud of points."""

from scenarios.sensors.lidar.config import HDL32, HDL64, MID70, SENSORS, LidarConfig, Mount, lidar_config
from scenarios.sensors.lidar.patterns import Rays, Rosette, Spinning

__all__ = [
    "HDL32",
    "HDL64",
    "MID70",
    "SENSORS",
    "LidarConfig",
    "Mount",
    "Rays",
    "Rosette",
    "Spinning",
    "lidar_config",
]
