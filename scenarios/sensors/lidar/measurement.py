"""What a LiDAR hands to its detector, and how boxes that are found in it become detections."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.sensors.lidar.config import Mount
from smartmot.arrays import FloatArray
from smartmot.geometry import wrap_angle
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import Boxes, Detections, EgoState, StrArray


@dataclass(frozen=True, slots=True, eq=False)
class LidarMeasurement:
    """A cloud and where it was measured from.

    Args:
        stamp_s: time of the last ray, seconds.
        number: of the cloud.
        cloud: its points, sensor's frame. Intensities from 0 to 1: reflectivity times the cosine of the angle
            of incidence.
        ego: pose and motion at the stamp.
        mount: where the sensor is on the ego.
    """

    stamp_s: float
    number: int
    cloud: PointCloud
    ego: EgoState
    mount: Mount

    @property
    def is_truth(self) -> bool:
        """False: it is what a LiDAR gives."""
        return False

    def places(self, xyz_m: FloatArray, ego: EgoState) -> FloatArray:
        """(N, 2) where points, (N, 3) in the sensor's frame, are in the frame of a pose of the ego."""
        level = pitched(xyz_m, self.mount.pitch_rad)
        ahead, left = level[:, 0] + self.mount.forward_m, level[:, 1]
        c, s = np.cos(ego.yaw_rad), np.sin(ego.yaw_rad)
        return np.column_stack((ego.x_m + c * ahead - s * left, ego.y_m + s * ahead + c * left))

    def detections(self, boxes: Boxes3D, score: FloatArray, category: StrArray) -> Detections:
        """Boxes in the sensor's frame as detections on the map, stamped with the time of the cloud.

        Args:
            boxes: N boxes.
            score: (N,) confidences in [0, 1].
            category: (N,) names out of `smartmot.types.CATEGORIES`.

        Raises:
            smartmot.errors.ShapeError: shapes disagree, or a value is out of range.
        """
        center = self.places(boxes.center_m, self.ego)
        outlines = Boxes(center, boxes.size_m[:, :2], wrap_angle(boxes.yaw_rad + self.ego.yaw_rad))
        return Detections(self.stamp_s, outlines, score, category)


def pitched(points: FloatArray, pitch_rad: float) -> FloatArray:
    """(N, 3) points of a frame that is pitched nose down, in the level frame."""
    if pitch_rad == 0.0:
        return points
    c, s = np.cos(pitch_rad), np.sin(pitch_rad)
    return np.column_stack(
        (c * points[:, 0] + s * points[:, 2], points[:, 1], c * points[:, 2] - s * points[:, 0])
    )
