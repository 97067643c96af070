"""The ground under a cloud: a plane near the sensor, and heights over it by sector and distance.

Sectors grow outwards ring by ring as in Himmelsbach, von Hundelshausen, Wuensche, "Fast segmentation of 3D
point clouds for ground vehicles", IEEE Intelligent Vehicles Symposium 2010: a sector's lowest point is ground
if the slope to the last ground inwards is that of a road.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.arrays import BoolArray, FloatArray, IntArray

SECTORS = 90
"""4 degrees wide: 2.8 m at 40 m, narrower than a car is long."""

RING_M = 1.5
"""Width of a ring. A lower point of the same cell hides a step of the ground less than this far away."""

MOST_TILT = math.tan(math.radians(12.0))
"""Steepest plane: mount and road together. Paved streets rise by up to 12 % (7 degrees; FGSV, RASt 06); the
other 5 degrees are those of the mount."""

STEP_M = 0.10
"""How far over the ground inwards the lowest point of a cell may lie, besides the slope: two standard
deviations of a range and half a kerb."""

BEND = 0.08
"""Change of slope against the plane: twice 4 %, the change over a crest at 50 km/h within 60 m (RASt 06)."""

MOST_STEP_M = 0.4
"""However long ago ground was seen: lower than the underside of what stands on wheels and its bumper."""

PLANES = 150
"""Planes through three cells that are tried. With half of the cells on the ground one in eight is right."""

NEAR_M = 25.0
"""Cells within this distance make the plane."""

INLIER_M = 0.12
"""A cell as near to a plane supports it: three standard deviations of 3 cm, and crown of the road."""

ASSUMED_HEIGHT_M = 1.73
"""Height of a sensor of which neither cloud nor mount says one: that of KITTI's (Geiger et al., 2013)."""

_SEED = 1


@dataclass(frozen=True, slots=True, eq=False)
class Ground:
    """The ground under a cloud.

    Args:
        slope: of the plane along x and along y.
        sensor_height_m: of the sensor over the plane, upwards.
        offset_m: (SECTORS, R) how far over the plane the ground of each cell is.
        is_seen: whether the cloud has shown the plane; if not, it is that of the mount.
    """

    slope: FloatArray
    sensor_height_m: float
    offset_m: FloatArray
    is_seen: bool

    def level_m(self, xy_m: FloatArray) -> FloatArray:
        """(N,) z of the ground at (N, 2) points."""
        x, y = xy_m.T
        cell = _cells(np.arctan2(y, x), np.hypot(x, y), self.offset_m.shape[1])
        plane = xy_m @ self.slope - self.sensor_height_m
        level: FloatArray = plane + self.offset_m.ravel()[cell]
        return level


def _cells(azimuth_rad: FloatArray, distance_m: FloatArray, rings: int) -> IntArray:
    """(N,) number of the cell of each point."""
    sector = ((azimuth_rad + math.pi) * (SECTORS / (2.0 * math.pi))).astype(np.int64)
    ring = (distance_m * (1.0 / RING_M)).astype(np.int64)
    cell: IntArray = np.minimum(sector, SECTORS - 1) * rings + np.minimum(ring, rings - 1)
    return cell


def ground_under(
    xyz_m: FloatArray,
    azimuth_rad: FloatArray,
    distance_m: FloatArray,
    reach_m: float,
    prior_m: float | None = None,
) -> tuple[Ground, FloatArray]:
    """The ground, and (P,) how far over it each point is.

    Args:
        xyz_m: (P, 3) points within reach.
        azimuth_rad: (P,) of each.
        distance_m: (P,) horizontal, of each.
        reach_m: greatest horizontal distance of a point.
        prior_m: height of the sensor as its mount says it.
    """
    rings = int(reach_m / RING_M) + 1
    z = xyz_m[:, 2]
    cell = _cells(azimuth_rad, distance_m, rings)
    lowest = np.full(SECTORS * rings, np.inf)
    np.minimum.at(lowest, cell, z)
    # where the lowest points are, not the middles of their cells: on a slope that makes decimetres
    row = np.flatnonzero((z == lowest[cell]) & (distance_m <= NEAR_M))
    plane = _plane(xyz_m[row, :2], z[row], prior_m)
    is_seen = plane is not None
    slope, height = plane if plane is not None else (np.zeros(2), prior_m or ASSUMED_HEIGHT_M)
    over = z + height
    over -= xyz_m[:, 0] * slope[0]
    over -= xyz_m[:, 1] * slope[1]
    lowest.fill(np.inf)
    np.minimum.at(lowest, cell, over)
    offset = _grown(lowest.reshape(SECTORS, rings))
    over -= offset.ravel()[cell]
    return Ground(slope, height, offset, is_seen), over


def _plane(xy_m: FloatArray, z_m: FloatArray, prior_m: float | None) -> tuple[FloatArray, float] | None:
    """Slope, and height of the sensor over the plane, that has most cells near to it and few under it."""
    if len(xy_m) < 6:
        return None
    rng = np.random.default_rng(_SEED)
    corner = rng.integers(0, len(xy_m), (PLANES, 3))
    at, rise = xy_m[corner], z_m[corner]
    a, b = at[:, 1] - at[:, 0], at[:, 2] - at[:, 0]
    u, v = rise[:, 1] - rise[:, 0], rise[:, 2] - rise[:, 0]
    area = a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]
    valid = np.abs(area) > 1.0  # m2: slopes of smaller triangles are noise
    area = np.where(valid, area, 1.0)
    slope = np.column_stack((u * b[:, 1] - v * a[:, 1], v * a[:, 0] - u * b[:, 0])) / area[:, None]
    level = rise[:, 0] - (at[:, 0] * slope).sum(axis=1)
    valid &= (np.hypot(*slope.T) <= MOST_TILT) & (level < 0.0)
    if not valid.any():
        return None
    slope, level = slope[valid], level[valid]
    over = z_m[:, None] - (xy_m @ slope.T + level)
    near = np.abs(over) <= INLIER_M
    # what lies lower is ground as well, but for stray echoes: a plane of roofs has much under it
    support = near.sum(axis=0) - (over < -2.0 * INLIER_M).sum(axis=0).astype(np.float64)
    if prior_m is not None:
        # half a cell per decimetre: the mount decides only between planes that are as good
        support -= 5.0 * np.abs(-level - prior_m)
    best = int(support.argmax())
    chosen = near[:, best]
    if chosen.sum() < 6:
        return None
    for _ in range(2):
        design = np.column_stack((xy_m[chosen], np.ones(int(chosen.sum()))))
        fit = np.linalg.lstsq(design, z_m[chosen], rcond=None)[0]
        chosen = np.abs(z_m - xy_m @ fit[:2] - fit[2]) <= INLIER_M
        if chosen.sum() < 6:
            return None
    if np.hypot(fit[0], fit[1]) > MOST_TILT or fit[2] >= 0.0:
        return None
    return fit[:2], float(-fit[2])


def _grown(over_m: FloatArray) -> FloatArray:
    """(S, R) how far the ground is over the plane, from the lowest points, infinite where there is none."""
    sectors, rings = over_m.shape
    offset, steps = np.empty((rings, sectors)), np.ascontiguousarray(over_m.T)
    level, since = np.zeros(sectors), np.zeros(sectors)
    for ring in range(rings):
        since += RING_M
        bound = np.minimum(STEP_M + BEND * since, MOST_STEP_M)
        is_ground: BoolArray = np.abs(steps[ring] - level) <= bound
        np.copyto(level, steps[ring], where=is_ground)
        since[is_ground] = 0.0
        offset[ring] = level
    return np.ascontiguousarray(offset.T)
