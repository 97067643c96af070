"""Perceptions that know who is under each point: bounds of what a detector can reach on these clouds."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from scenarios.sensors.lidar.measurement import LidarMeasurement
from scenarios.sensors.world import World
from smartmot.arrays import FloatArray, IntArray
from smartmot.lidar.plain import least_rectangle
from smartmot.pointcloud import Boxes3D
from smartmot.types import Detections


@dataclass(frozen=True, slots=True, eq=False)
class LabelledCloud:
    """A cloud, and who is under each point.

    Args:
        lidar: the cloud of N points.
        row: (N,) row in the world of the road user on which each point is, or -1.
        world: ground truth at the stamp.
    """

    lidar: LidarMeasurement
    row: IntArray
    world: World

    @property
    def stamp_s(self) -> float:
        """Time of the last ray, seconds."""
        return self.lidar.stamp_s

    @property
    def is_truth(self) -> bool:
        """True: only the detector gets it."""
        return True


class LabelDetector:
    """Reports the true box of every road user on which a point is: what range, rate and hiding leave."""

    latency_s = 0.0
    rate_hz: float | None = None

    def detect(self, measurement: LabelledCloud) -> Detections:
        """True boxes, all with score 1."""
        rows = np.unique(measurement.row[measurement.row >= 0])
        world = measurement.world
        return Detections(measurement.stamp_s, world.boxes[rows], np.ones(len(rows)), world.category[rows])


class CutoutDetector:
    """Fits a box to the points of every road user, whose category it knows but not its box.

    What it adds to the errors of `LabelDetector` are those of the fit.
    """

    latency_s = 0.0
    rate_hz: float | None = None

    def detect(self, measurement: LabelledCloud) -> Detections:
        """Fitted boxes, all with score 1."""
        order = np.argsort(measurement.row, kind="stable")
        row = measurement.row[order]
        rows, first = np.unique(row, return_index=True)
        ends = [*first[1:].tolist(), len(row)]
        xyz = measurement.lidar.cloud.xyz_m[order].astype(np.float64)
        category = measurement.world.category
        fits = [
            fit_box(xyz[low:high], str(category[number]))
            for number, low, high in zip(rows.tolist(), first.tolist(), ends, strict=True)
            if number >= 0
        ]
        rows = rows[rows >= 0]
        boxes = Boxes3D(
            np.array([fit[0] for fit in fits]).reshape(-1, 3),
            np.array([fit[1] for fit in fits]).reshape(-1, 3),
            np.array([fit[2] for fit in fits]),
        )
        return measurement.lidar.detections(boxes, np.ones(len(rows)), category[rows])


CLASS_SIZE_M = {
    "car": (3.9, 1.6, 1.56),
    "pedestrian": (0.8, 0.6, 1.73),
    "cyclist": (1.76, 0.6, 1.73),
    "truck": (6.93, 2.51, 2.84),
    "motorcycle": (2.11, 0.77, 1.47),
}
"""Length, width and height that boxes are grown to at least. The first three: anchors of SECOND (Yan, Mao, Li
2018) on KITTI; the others: anchors of its nuScenes configuration in OpenPCDet."""


def fit_box(xyz_m: FloatArray, category: str) -> tuple[FloatArray, FloatArray, float]:
    """The least rectangle around points, grown away from the sensor to the size of a class.

    Args:
        xyz_m: (K, 3) points of one road user, sensor's frame; K at least 1.
        category: its class; others than those of `CLASS_SIZE_M` are not grown.

    Returns:
        Middle (3,), length, width and height (3,), heading.
    """
    middle, extent, yaw = least_rectangle(xyz_m[:, :2])
    bottom, top = float(xyz_m[:, 2].min()), float(xyz_m[:, 2].max())
    size = np.maximum([*extent, top - bottom], CLASS_SIZE_M.get(category, (LEAST_M,) * 3))
    axes = np.array([[math.cos(yaw), math.sin(yaw)], [-math.sin(yaw), math.cos(yaw)]])
    away = np.where(axes @ middle < 0.0, -1.0, 1.0)
    middle = middle + (0.5 * away * (size[:2] - extent)) @ axes
    return np.array([*middle, top - 0.5 * size[2]]), size, yaw


LEAST_M = 0.1
"""Size of what is a single point."""
