"""Echoes of drawn clouds as real beams have them: smeared at edges, lost in bicycles and on dark cars."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from evaluation.studies.lidar.cars import lost_share
from smartmot.arrays import BoolArray, FloatArray, IntArray, StrArray
from smartmot.pointcloud import Boxes3D, PointCloud

SADDLE, THIN_M = 0.5, 0.06
"""A bicycle is what is lower than this share of its rider's box, and so near to its middle plane: the rider's
legs are beside it."""

OPEN_BICYCLE = (0.3, 1.0)
"""Share of the rays that pass through a bicycle: tyre and rim are a quarter of a wheel's disc, spokes and
tubes little; assumed, because beams that are wider than a spoke have an echo of it now and then."""


class Echoes:
    """Points of a cloud by the boxes that they are on.

    Args:
        cloud: P points.
        boxes: T boxes, frame of the cloud.
    """

    def __init__(self, cloud: PointCloud, boxes: Boxes3D) -> None:
        self.xyz_m, self.boxes = cloud.xyz_m, boxes
        self._order = np.argsort(self.xyz_m[:, 0])
        self._ahead = self.xyz_m[self._order, 0].astype(np.float64)

    def on(self, row: int) -> tuple[IntArray, FloatArray]:
        """(K,) points that may be on a box, ascending, and (K, 3) where, in axes of the box."""
        center, yaw = self.boxes.center_m[row], float(self.boxes.yaw_rad[row])
        reach = float(np.hypot(*self.boxes.size_m[row, :2]))
        strip = slice(*np.searchsorted(self._ahead, (center[0] - reach, center[0] + reach)))
        point = self._order[strip]
        point = np.sort(point[np.abs(self.xyz_m[point, 1] - center[1]) <= reach])
        rel = self.xyz_m[point] - center
        c, s = math.cos(yaw), math.sin(yaw)
        along, across = c * rel[:, 0] + s * rel[:, 1], c * rel[:, 1] - s * rel[:, 0]
        return point, np.column_stack((along, across, rel[:, 2]))

    def through_bicycles(self, category: StrArray, rng: np.random.Generator) -> BoolArray:
        """(P,) most echoes of bicycles, which the sensor takes for discs and blocks."""
        lost = np.zeros(len(self.xyz_m), dtype=np.bool_)
        for row in np.flatnonzero(category == "cyclist").tolist():
            size = self.boxes.size_m[row]
            point, rel = self.on(row)
            low = rel[:, 2] < (SADDLE - 0.5) * size[2]
            thin = point[low & (np.abs(rel[:, 1]) < THIN_M) & (np.abs(rel[:, 0]) < 0.55 * size[0])]
            lost[thin[rng.random(len(thin)) < rng.uniform(*OPEN_BICYCLE)]] = True
        return lost

    def of_dark_cars(self, category: StrArray, rng: np.random.Generator) -> BoolArray:
        """(P,) some echoes of cars, of each another share; see `cars.lost_share`."""
        lost = np.zeros(len(self.xyz_m), dtype=np.bool_)
        for row in np.flatnonzero(category == "car").tolist():
            share = lost_share(rng)
            if share:
                half = 0.5 * self.boxes.size_m[row] + 0.05
                point, rel = self.on(row)
                # the ground under a car stays
                own = point[(np.abs(rel) < half).all(axis=1) & (rel[:, 2] > 0.1 - half[2])]
                lost[own[rng.random(len(own)) < share]] = True
        return lost


SMEAR_M = 0.5
"""How far behind an edge an echo may lie that comes from both sides of it: the length of a pulse of 5 ns is
0.75 m there and back, and two echoes are apart when they are as far from each other."""

SMEARED = 0.5
"""Share of the echoes at an edge that come from both sides: a beam of 3 mrad (HDL-64E manual) is as wide as
the step between two shots, so that an edge is in every other one."""


def smeared(cloud: PointCloud, rng: np.random.Generator) -> PointCloud:
    """The cloud as beams with a width would measure it: echoes at edges are drawn out to behind."""
    xyz = cloud.xyz_m.astype(np.float64)
    distance = np.linalg.norm(xyz, axis=1)
    azimuth = np.arctan2(xyz[:, 1], xyz[:, 0])
    if cloud.ring is None or not len(xyz):
        return cloud
    # a rosette has one ring, and its shots follow one another along it
    order = np.lexsort((azimuth, cloud.ring)) if cloud.ring.max() else np.arange(len(xyz))
    ordered, ring = distance[order], cloud.ring[order]
    behind = (np.diff(ordered) > SMEAR_M) & (np.diff(ring) == 0)
    before = (np.diff(ordered) < -SMEAR_M) & (np.diff(ring) == 0)
    edge = np.zeros(len(xyz), dtype=np.bool_)
    edge[:-1] |= behind
    edge[1:] |= before
    moved = order[edge & (rng.random(len(xyz)) < SMEARED)]
    xyz[moved] *= (1.0 + SMEAR_M * rng.random(len(moved)) ** 2 / distance[moved])[:, None]
    return replace(cloud, xyz_m=xyz.astype(np.float32))
