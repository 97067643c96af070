"""A cloud as pillars: cells from above, each with some of its points and their features.

Lang, Vora, Caesar, Zhou, Yang, Beijbom, "PointPillars: Fast encoders for object detection from point clouds",
CVPR 2019. Other than there, heights are over the ground that the cloud itself shows, so that a sensor may be
mounted at any height, and strengths of echoes are left out: they have another unit in every sensor.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from smartmot.arrays import BoolArray, IntArray
from smartmot.errors import ConfigError
from smartmot.pointcloud.cloud import RealArray

FEATURES = (
    "ahead_of_cell",
    "left_of_cell",
    "height",
    "ahead_of_mean",
    "left_of_mean",
    "over_mean",
    "distance",
    "count",
)
"""Of each point: place in its cell in cells, height over the ground in metres, offset from the mean of the
pillar's points in metres, distance in 40 m, and log(1 + points of the pillar) / 4."""

FAR_M = 40.0
"""Unit of the feature "distance"."""


@dataclass(frozen=True, slots=True)
class PillarGrid:
    """Cells from above, frame of the sensor: x ahead, y left.

    Args:
        ahead_m: from and to.
        left_m: from and to.
        cell_m: edge of a cell; both spans are whole numbers of 8 cells, by which the network halves them.
        most_points: of a pillar; the others are left out evenly in the order of the cloud.
        heights_m: over the ground; points outside are left out.

    Raises:
        ConfigError: a value is out of range.
    """

    ahead_m: tuple[float, float] = (0.0, 44.8)
    left_m: tuple[float, float] = (-28.8, 28.8)
    cell_m: float = 0.2
    most_points: int = 16
    heights_m: tuple[float, float] = (-0.5, 3.0)

    def __post_init__(self) -> None:
        spans = (self.ahead_m, self.left_m, self.heights_m)
        if not all(math.isfinite(v) for span in spans for v in span) or not 0.0 < self.cell_m < math.inf:
            raise ConfigError(f"pillars: lengths must be finite and the cell positive, got {self}")
        if any(high <= low for low, high in spans) or self.most_points < 1:
            raise ConfigError(f"pillars: spans and most_points must be positive, got {self}")
        for low, high in spans[:2]:
            cells = (high - low) / self.cell_m
            if abs(cells - round(cells)) > 1e-6 or round(cells) % 8:
                raise ConfigError(
                    f"pillars: {high - low:g} m is no whole number of 8 cells of {self.cell_m:g} m"
                )

    @property
    def shape(self) -> tuple[int, int]:
        """Cells ahead and to the left."""
        ahead, left = self.ahead_m, self.left_m
        return round((ahead[1] - ahead[0]) / self.cell_m), round((left[1] - left[0]) / self.cell_m)

    @property
    def place(self) -> str:
        """Where the cells are, in words."""
        (near, far), (right, left) = self.ahead_m, self.left_m
        return f"from {near:g} to {far:g} m ahead, {left:g} m to the left and {-right:g} m to the right"

    def covers(self, xy_m: RealArray) -> BoolArray:
        """(P,) whether points, (P, 2) or with more columns, are over a cell."""
        x, y = xy_m[:, 0], xy_m[:, 1]
        (near, far), (right, left) = self.ahead_m, self.left_m
        inside: BoolArray = (x >= near) & (x < far) & (y >= right) & (y < left)
        return inside


@dataclass(frozen=True, slots=True, eq=False)
class Pillars:
    """What a network sees of a cloud.

    Args:
        features: (N, M, F) of the points of each pillar, see `FEATURES`; where a pillar has fewer than M
            points its first one is repeated, which changes no maximum.
        cell: (N,) number of each pillar's cell: row ahead times columns plus column to the left.
        point: (K,) points of the cloud that are in a pillar.
    """

    features: NDArray[np.float32]
    cell: IntArray
    point: IntArray

    def __len__(self) -> int:
        return len(self.cell)


def pillars_of(xy_m: RealArray, height_m: RealArray, grid: PillarGrid) -> Pillars:
    """The pillars of a cloud.

    Args:
        xy_m: (P, 2) points, or more columns, which are not used.
        height_m: (P,) of each point over the ground.
        grid: the cells.
    """
    rows, columns = grid.shape
    ahead = (xy_m[:, 0] - grid.ahead_m[0]) * (1.0 / grid.cell_m)
    left = (xy_m[:, 1] - grid.left_m[0]) * (1.0 / grid.cell_m)
    inside = (ahead >= 0.0) & (ahead < rows) & (left >= 0.0) & (left < columns)
    inside &= (height_m >= grid.heights_m[0]) & (height_m <= grid.heights_m[1])
    point = np.flatnonzero(inside)
    most = grid.most_points
    if not len(point):
        empty = np.zeros((0, most, len(FEATURES)), dtype=np.float32)
        return Pillars(empty, np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64))
    row, column = ahead[point].astype(np.int32), left[point].astype(np.int32)
    # by cell, then in the order of the cloud: one sort of both as one number
    key = np.sort(((row * np.int32(columns) + column).astype(np.int64) << 32) | np.arange(len(point)))
    order, cell = key & 0xFFFFFFFF, key >> 32
    point = point[order]
    is_first = np.ones(len(point), dtype=np.bool_)
    np.not_equal(cell[1:], cell[:-1], out=is_first[1:])
    first = np.flatnonzero(is_first)
    count = np.diff(first, append=len(point))
    pillar = np.repeat(np.arange(len(first)), count)
    x, y, z = (value[point].astype(np.float32) for value in (ahead, left, height_m))
    own_count = count.astype(np.float32)
    # a row of memory for each of `FEATURES`, turned at the end: numpy is quick along rows
    by_feature = np.empty((len(FEATURES), len(point)), dtype=np.float32)
    np.subtract(x, row[order] + np.float32(0.5), out=by_feature[0], casting="same_kind")
    np.subtract(y, column[order] + np.float32(0.5), out=by_feature[1], casting="same_kind")
    by_feature[2] = z
    for axis, (value, unit) in enumerate(((x, grid.cell_m), (y, grid.cell_m), (z, 1.0))):
        mean = np.add.reduceat(value, first) / own_count
        np.subtract(value, mean[pillar], out=by_feature[3 + axis])
        by_feature[3 + axis] *= unit
    np.hypot(x * grid.cell_m + grid.ahead_m[0], y * grid.cell_m + grid.left_m[0], out=by_feature[6])
    by_feature[6] /= FAR_M
    by_feature[7] = (np.log1p(own_count) / 4.0)[pillar]
    feature = np.ascontiguousarray(by_feature.T)
    # the point in each place of a pillar: its first one, then the others
    taken = np.repeat(first, most)
    rank = np.arange(len(point)) - first[pillar]
    few = (count <= most)[pillar]
    taken[(pillar * most + rank)[few]] = np.flatnonzero(few)
    # pillar k takes points floor(slot * count / most) where it has more than `most`
    many = np.flatnonzero(count > most)
    taken.reshape(-1, most)[many] = first[many, None] + (np.arange(most) * count[many, None]) // most
    features = np.take(feature, taken, axis=0, mode="clip").reshape(len(first), most, len(FEATURES))
    return Pillars(features, cell[first], point)
