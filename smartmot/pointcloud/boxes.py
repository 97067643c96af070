"""Oriented boxes in space that stand upright, and their common volume."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from smartmot.arrays import FloatArray, IntArray, box_arrays, part, positions, shared_by_copies, unchecked
from smartmot.geometry import circles_touch, corners, near_pairs
from smartmot.overlap import intersection_area
from smartmot.pointcloud.cloud import RealArray
from smartmot.types import Boxes

SORTED_FROM = 4
"""Boxes from which on sorting the points once is faster than comparing all of them with each."""


@shared_by_copies
@dataclass(frozen=True, slots=True, eq=False)
class Boxes3D:
    """Upright boxes, frame of the cloud: x ahead, y left, z up.

    Args:
        center_m: (N, 3) middles, metres.
        size_m: (N, 3) length along the heading, width across it, height; metres, positive.
        yaw_rad: (N,) heading, counter-clockwise from x.

    Raises:
        ShapeError: shapes disagree, a value is not finite or a size is not positive.
    """

    center_m: FloatArray
    size_m: FloatArray
    yaw_rad: FloatArray

    def __post_init__(self) -> None:
        center, size, yaw = box_arrays(self.center_m, self.size_m, self.yaw_rad, 3)
        object.__setattr__(self, "center_m", center)
        object.__setattr__(self, "size_m", size)
        object.__setattr__(self, "yaw_rad", yaw)

    def __len__(self) -> int:
        return len(self.yaw_rad)

    def __getitem__(self, index: Any) -> Boxes3D:
        """Subset by a mask, a slice or an index array."""
        index = positions(index)
        columns = (part(column, index) for column in (self.center_m, self.size_m, self.yaw_rad))
        return unchecked(Boxes3D, *columns)

    @classmethod
    def empty(cls) -> Boxes3D:
        """No boxes."""
        return unchecked(cls, np.zeros((0, 3)), np.zeros((0, 3)), np.zeros(0))

    @property
    def on_ground(self) -> Boxes:
        """The N outlines from above."""
        return unchecked(Boxes, self.center_m[:, :2].copy(), self.size_m[:, :2].copy(), self.yaw_rad)

    @property
    def bottom_m(self) -> FloatArray:
        """(N,) heights of the undersides."""
        return self.center_m[:, 2] - 0.5 * self.size_m[:, 2]

    @property
    def volume_m3(self) -> FloatArray:
        """(N,) volumes."""
        volume: FloatArray = self.size_m.prod(axis=1)
        return volume

    def corners(self) -> FloatArray:
        """(N, 8, 3) corner points: the underside from front left counter-clockwise, then the top."""
        outline = corners(self.center_m[:, :2], self.size_m[:, :2], self.yaw_rad)
        points = np.empty((len(self), 8, 3))
        points[:, :4, :2] = points[:, 4:, :2] = outline
        points[:, :4, 2] = self.bottom_m[:, None]
        points[:, 4:, 2] = (self.bottom_m + self.size_m[:, 2])[:, None]
        return points

    def point_counts(self, xyz_m: RealArray, margin_m: float = 0.0) -> IntArray:
        """(N,) points in each box, those on its faces included.

        Args:
            xyz_m: (P, 3) points, frame of the boxes; float32 or float64.
            margin_m: How much farther out than its faces each box reaches.
        """
        counts = np.zeros(len(self), dtype=np.int64)
        half = 0.5 * self.size_m + margin_m
        near = [xyz_m] * len(self)
        if len(self) >= SORTED_FROM:
            # sorted once, each box is compared with the points in its strip across x, and beside it, alone
            order = np.argsort(xyz_m[:, 0])
            x, y = (xyz_m[:, axis].take(order) for axis in (0, 1))
            reach = np.hypot(half[:, 0], half[:, 1]) + 1e-6 * (1.0 + np.abs(self.center_m[:, :2]).max(axis=1))
            first, last = np.searchsorted(x.astype(np.float64), self.center_m[:, 0] + (-reach, reach))
            near = [
                xyz_m.take(order[a:b].compress(np.abs(y[a:b] - center) <= beside), axis=0)
                for a, b, center, beside in zip(
                    first.tolist(), last.tolist(), self.center_m[:, 1], reach, strict=True
                )
            ]
        for number, (center, yaw) in enumerate(zip(self.center_m, self.yaw_rad, strict=True)):
            rel = near[number] - center
            c, s = math.cos(yaw), math.sin(yaw)
            along, across = c * rel[:, 0] + s * rel[:, 1], c * rel[:, 1] - s * rel[:, 0]
            inside = (np.abs(along) <= half[number, 0]) & (np.abs(across) <= half[number, 1])
            counts[number] = np.count_nonzero(inside & (np.abs(rel[:, 2]) <= half[number, 2]))
        return counts


def iou_3d(a: Boxes3D, b: Boxes3D) -> FloatArray:
    """Common volume over the volume of both, of every box of a with every box of b.

    Returns:
        (N, M) values in [0, 1].
    """
    return overlaps(a, b)[1]


def overlaps(a: Boxes3D, b: Boxes3D) -> tuple[FloatArray, FloatArray]:
    """Intersection over union of every box of a with every box of b, from above and in space.

    Returns:
        (N, M) and (N, M) values in [0, 1].
    """
    bev, space = np.zeros((len(a), len(b))), np.zeros((len(a), len(b)))
    if not len(a) or not len(b):
        return bev, space
    radius_a, radius_b = (0.5 * np.hypot(boxes.size_m[:, 0], boxes.size_m[:, 1]) for boxes in (a, b))
    i, j = near_pairs(a.center_m[:, :2], b.center_m[:, :2], radius_a, radius_b)
    if not len(i):
        return bev, space
    bev[i, j], space[i, j] = pair_overlaps(a[i], b[j])
    return bev, space


def pair_overlaps(a: Boxes3D, b: Boxes3D) -> tuple[FloatArray, FloatArray]:
    """Intersection over union of aligned pairs, from above and in space.

    Args:
        a: P boxes.
        b: P boxes.

    Returns:
        (P,) and (P,) values in [0, 1].
    """
    bev, space = np.zeros(len(a)), np.zeros(len(a))
    near = circles_touch(a.center_m[:, :2], a.size_m[:, :2], b.center_m[:, :2], b.size_m[:, :2])
    near_a, near_b = a[near], b[near]
    area = intersection_area(
        near_a.center_m[:, :2], near_a.size_m[:, :2], near_a.yaw_rad,
        near_b.center_m[:, :2], near_b.size_m[:, :2], near_b.yaw_rad,
    )  # fmt: skip
    area_a, area_b = near_a.size_m[:, :2].prod(axis=1), near_b.size_m[:, :2].prod(axis=1)
    top = np.minimum(near_a.bottom_m + near_a.size_m[:, 2], near_b.bottom_m + near_b.size_m[:, 2])
    common = area * np.maximum(top - np.maximum(near_a.bottom_m, near_b.bottom_m), 0.0)
    bev[near] = np.minimum(area / (area_a + area_b - area), 1.0)
    space[near] = np.minimum(common / (near_a.volume_m3 + near_b.volume_m3 - common), 1.0)
    return bev, space
