"""Clouds of points and boxes in space, in the frame of the sensor that measured them."""

from smartmot.pointcloud.boxes import Boxes3D
from smartmot.pointcloud.cloud import PointCloud

__all__ = ["Boxes3D", "PointCloud"]
