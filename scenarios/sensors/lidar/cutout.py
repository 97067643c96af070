"""Perceptions that know who is under each point: bounds of what a detector can reach on these clouds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from scenarios.sensors.lidar.measurement import LidarMeasurement
from scenarios.sensors.world import World
from smartmot.arrays import FloatArray, IntArray, StrArray
from smartmot.lidar.features import FEATURES, Clusters
from smartmot.lidar.fit import car_outlines, cyclist_outlines, pedestrian_outlines
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

    What it adds to the errors of `LabelDetector` are those of the fit, which is that of the shipped detector.
    """

    latency_s = 0.0
    rate_hz: float | None = None

    def detect(self, measurement: LabelledCloud) -> Detections:
        """Fitted boxes, all with score 1."""
        order = np.argsort(measurement.row, kind="stable")
        order = order[np.searchsorted(measurement.row[order], 0) :]  # without points of no road user
        rows, first, count = np.unique(measurement.row[order], return_index=True, return_counts=True)
        category = measurement.world.category[rows]
        xyz = measurement.lidar.cloud.xyz_m.take(order, axis=0).astype(np.float64)
        boxes = fit_boxes(xyz, first, count, category)
        return measurement.lidar.detections(boxes, np.ones(len(rows)), category)


LEAST_M = 0.1
"""Least height of a box: that of a single point."""

FITS = {"pedestrian": pedestrian_outlines, "cyclist": cyclist_outlines, "motorcycle": cyclist_outlines}
"""How the shipped detector fits boxes of a category; all others as cars."""


def fit_boxes(xyz_m: FloatArray, first: IntArray, count: IntArray, category: StrArray) -> Boxes3D:
    """Boxes around the points of road users of known category.

    Args:
        xyz_m: (K, 3) points, sensor's frame, one road user after the other.
        first: (N,) where each begins.
        count: (N,) its points, 1 or more.
        category: (N,) names out of `smartmot.types.CATEGORIES`.
    """
    if not len(first):
        return Boxes3D.empty()
    xy = np.ascontiguousarray(xyz_m[:, :2])
    middle = np.add.reduceat(xy, first) / count[:, None]
    rel = xy - np.repeat(middle, count, axis=0)
    moments = np.column_stack((rel[:, 0] ** 2 - rel[:, 1] ** 2, 2.0 * rel[:, 0] * rel[:, 1]))
    spread = np.add.reduceat(moments, first)
    axis = 0.5 * np.arctan2(spread[:, 1], spread[:, 0])
    nothing = np.zeros((len(first), len(FEATURES)))
    clusters = Clusters(np.arange(len(xy)), first, count, middle, nothing, axis)
    low, high = (extreme.reduceat(xyz_m[:, 2], first) for extreme in (np.minimum, np.maximum))
    center, size, yaw = np.empty((len(first), 3)), np.empty((len(first), 3)), np.empty(len(first))
    center[:, 2], size[:, 2] = 0.5 * (low + high), np.maximum(high - low, LEAST_M)
    for name in np.unique(category).tolist():
        chosen = np.flatnonzero(category == name)
        outlines = FITS.get(name, car_outlines)(xy, clusters, chosen)
        center[chosen, :2], size[chosen, :2] = outlines.center_m, outlines.size_m
        yaw[chosen] = outlines.yaw_rad
    return Boxes3D(center, size, yaw)
