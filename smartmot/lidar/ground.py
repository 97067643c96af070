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
    sector = ((azimuth_rad + math.pi) * (SECTORS / (2.0 * math.pi))).astype(np.intp)
    np.minimum(sector, SECTORS - 1, out=sector)
    cell: IntArray = (distance_m * (1.0 / RING_M)).astype(np.intp)
    np.minimum(cell, rings - 1, out=cell)
    sector *= rings
    cell += sector
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
    # single precision is exact to a micrometre within `NEAR_M`
    single = np.float32
    planes, cells = np.column_stack((slope, level)), np.vstack((xy_m.T, np.ones(len(xy_m))))
    over = planes.astype(single) @ cells.astype(single)
    np.subtract(z_m.astype(single), over, out=over)
    # what lies lower is ground as well, but for stray echoes: a plane of roofs has much under it
    votes = -(over < single(-2.0 * INLIER_M)).view(np.int8)
    votes += np.abs(over, out=over) <= single(INLIER_M)
    support = votes.sum(axis=1, dtype=np.int32).astype(np.float64)
    if prior_m is not None:
        # half a cell per decimetre: the mount decides only between planes that are as good
        support -= 5.0 * np.abs(-level - prior_m)
    best = int(support.argmax())
    fit: FloatArray | None = planes[best]
    for _ in range(2):
        if fit is None or len(chosen := _supporting(fit, xy_m, z_m)) < 6:
            return None
        fit = _least_squares(xy_m[chosen], z_m[chosen])
    if fit is None or len(_supporting(fit, xy_m, z_m)) < 6:
        return None
    if math.hypot(fit[0], fit[1]) > MOST_TILT or fit[2] >= 0.0:
        return None
    return fit[:2], float(-fit[2])


def _supporting(plane: FloatArray, xy_m: FloatArray, z_m: FloatArray) -> IntArray:
    """Which points lie near to a plane."""
    return np.flatnonzero(np.abs(z_m - xy_m @ plane[:2] - plane[2]) <= INLIER_M)


def _least_squares(xy_m: FloatArray, z_m: FloatArray) -> FloatArray | None:
    """(3,) slope along x and y, and level, of the plane through points; None: they lie along a line."""
    mean, level = xy_m.mean(axis=0), float(z_m.mean())
    x, y = (xy_m - mean).T
    z = z_m - level
    xx, xy, yy, xz, yz = (float(a @ b) for a, b in ((x, x), (x, y), (y, y), (x, z), (y, z)))
    determinant = xx * yy - xy * xy
    if determinant <= 1e-9 * xx * yy:
        return None
    slope = np.array([yy * xz - xy * yz, xx * yz - xy * xz]) / determinant
    return np.append(slope, level - slope @ mean)


def _grown(over_m: FloatArray) -> FloatArray:
    """(S, R) how far the ground is over the plane, from the lowest points, infinite where there is none."""
    sectors, rings = over_m.shape
    offset, steps = np.empty((rings, sectors)), np.ascontiguousarray(over_m.T)
    level, bound = np.zeros(sectors), np.full(sectors, STEP_M)
    for step, ground in zip(steps, offset, strict=True):
        bound += BEND * RING_M
        is_ground: BoolArray = np.abs(step - level) <= np.minimum(bound, MOST_STEP_M)
        np.copyto(level, step, where=is_ground)
        np.copyto(bound, STEP_M, where=is_ground)
        ground[:] = level
    return np.ascontiguousarray(offset.T)
