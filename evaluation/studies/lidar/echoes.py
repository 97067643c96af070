"""Echoes of drawn clouds as real beams have them.

They are smeared at edges, lost in bicycles, on dark cars and where too little light comes back, and off by
what the laser of their line is off; and the ground under them is not as flat as a map's.
"""

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
    order = _along_lines(azimuth, cloud.ring) if cloud.ring.max() else np.arange(len(xyz))
    ordered, ring = distance[order], cloud.ring[order]
    behind = (np.diff(ordered) > SMEAR_M) & (np.diff(ring) == 0)
    before = (np.diff(ordered) < -SMEAR_M) & (np.diff(ring) == 0)
    edge = np.zeros(len(xyz), dtype=np.bool_)
    edge[:-1] |= behind
    edge[1:] |= before
    moved = order[edge & (rng.random(len(xyz)) < SMEARED)]
    xyz[moved] *= (1.0 + SMEAR_M * rng.random(len(moved)) ** 2 / distance[moved])[:, None]
    return replace(cloud, xyz_m=xyz.astype(np.float32))


def _along_lines(azimuth: FloatArray, ring: IntArray) -> IntArray:
    """(P,) points by line, each line by azimuth.

    Each line is sorted by itself: nearly in order already, it takes a tenth of the time of all together.
    """
    order = np.argsort(ring.astype(np.uint16), kind="stable")
    ends = np.cumsum(np.bincount(ring))
    return np.concatenate(
        [line[np.argsort(azimuth[line], kind="stable")] for line in np.split(order, ends[:-1])]
    )


WEAKEST = (5e-7, 1e-5)
"""Least and greatest of the weakest echoes, reflectivity times cosine over distance squared. An HDL-64E has
echoes of pavement, reflectivity 0.1, up to 50 m (its User's Manual): 1.4e-6 at 1.73 m over it. Others see as
far as the first or no farther than a third of that."""

FADING = 0.7
"""Standard deviation of the logarithm of an echo's strength: speckle and paint, assumed."""


def too_weak(cloud: PointCloud, rng: np.random.Generator) -> BoolArray:
    """(P,) echoes of which too little light comes back, for a sensor that is drawn."""
    distance2 = np.square(cloud.xyz_m.astype(np.float64)).sum(axis=1)
    weakest = math.exp(rng.uniform(*np.log(WEAKEST)))
    faded = cloud.intensity * np.exp(FADING * rng.standard_normal(len(cloud)))
    lost: BoolArray = faded < weakest * distance2
    return lost


LINE_SIGMA_M = 0.02
"""Greatest standard deviation over lines of the error of a line's ranges: planes in clouds of an HDL-64E are
off by 3 cm before a calibration and 1.3 cm after (Glennie, Lichti, "Static calibration and analysis of the
Velodyne HDL-64E S2 for high accuracy mobile scanning", Remote Sensing 2, 2010)."""

LINE_SIGMA_RAD = math.radians(0.03)
"""The same of its elevation, assumed: a third of the finest spacing."""


def miscalibrated(cloud: PointCloud, rng: np.random.Generator) -> PointCloud:
    """The cloud of a sensor each line of which has an error of its own."""
    if cloud.ring is None or not len(cloud):
        return cloud
    lines = int(cloud.ring.max()) + 1
    share = rng.random()
    xyz = cloud.xyz_m.astype(np.float64)
    level, distance = np.hypot(xyz[:, 0], xyz[:, 1]), np.linalg.norm(xyz, axis=1)
    off = share * LINE_SIGMA_M * rng.standard_normal(lines)[cloud.ring]
    up = share * LINE_SIGMA_RAD * rng.standard_normal(lines)[cloud.ring]
    grown = 1.0 + off / np.maximum(distance, 0.1)
    # turned upwards by a small angle: the level part loses z, the height gains the level distance
    shrunk = grown * (1.0 - up * xyz[:, 2] / np.maximum(level, 0.1))
    made = np.column_stack((xyz[:, :2] * shrunk[:, None], xyz[:, 2] * grown + up * level))
    return replace(cloud, xyz_m=made.astype(np.float32))


WAVES = 6
WAVE_M, WAVE_SLOPE = (6.0, 50.0), 0.02
"""Lengths of the waves of the ground, and the standard deviation of the slope of each (assumed): together
5 %, as off the road or where drives and crossings meet it."""


def on_waves(cloud: PointCloud, boxes: Boxes3D, rng: np.random.Generator) -> tuple[PointCloud, Boxes3D]:
    """The cloud and its labels on ground that is not flat; what stands on it is moved up and down with it."""
    shortest, longest = np.log(WAVE_M)
    length = np.exp(rng.uniform(shortest, longest, WAVES))
    turn, phase = rng.uniform(-math.pi, math.pi, (2, WAVES))
    height = rng.random() * WAVE_SLOPE * rng.standard_normal(WAVES) * length / (2.0 * math.pi)

    def raised(xy_m: FloatArray) -> FloatArray:
        """(N,) height of the ground; 0 under the sensor."""
        along = xy_m[:, :1] * np.cos(turn) + xy_m[:, 1:] * np.sin(turn)
        waves: FloatArray = (np.sin(2.0 * math.pi * along / length + phase) - np.sin(phase)) @ height
        return waves

    xyz, center = cloud.xyz_m.copy(), boxes.center_m.copy()
    xyz[:, 2] += raised(xyz[:, :2].astype(np.float64)).astype(np.float32)
    center[:, 2] += raised(center[:, :2])
    return replace(cloud, xyz_m=xyz), replace(boxes, center_m=center)
