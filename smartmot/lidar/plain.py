"""The chain of the master's thesis: voxel grid, plane of the ground, Euclidean clusters, rules of size.

Source: "Detección de objetos 3D mediante LiDAR en sistemas embebidos", master's thesis, Bilbao 2022, sections
4.1 and 6.1, which prints no parameters. It is here as the peer that `smartmot.lidar.classical` is measured
against.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from smartmot.arrays import BoolArray, FloatArray, IntArray, StrArray
from smartmot.errors import ConfigError
from smartmot.lidar.detections import GROUND, LOOSE, OFF_AREA, OUT_OF_REACH, BoxDetections, StageClock
from smartmot.lidar.monitored import Monitored
from smartmot.pointcloud import Boxes3D, PointCloud

HEADINGS = 45
"""Headings tried for a box, 2 degrees apart in a quarter turn."""


@dataclass(frozen=True, slots=True)
class SizeRule:
    """Clusters that pass as a class, and the box they are grown to.

    Args:
        category: the class.
        length_m: least and greatest extent along the longer side.
        width_m: greatest extent along the shorter side.
        height_m: least and greatest extent upwards.
        size_m: length, width and height of the class.
    """

    category: str
    length_m: tuple[float, float]
    width_m: float
    height_m: tuple[float, float]
    size_m: tuple[float, float, float]


SIZE_RULES = (
    SizeRule("pedestrian", (0.1, 1.0), 0.9, (0.8, 2.1), (0.8, 0.6, 1.73)),
    SizeRule("cyclist", (1.0, 2.2), 1.0, (1.0, 2.1), (1.76, 0.6, 1.73)),
    SizeRule("car", (1.4, 6.0), 2.5, (0.8, 2.2), (3.9, 1.6, 1.56)),
)
"""The first that a cluster passes counts. Sizes of the classes: the anchors of SECOND (Yan, Mao, Li, 2018);
limits are assumed around them, since a cluster is the seen side of a body only."""


@dataclass(frozen=True, slots=True)
class PlainConfig:
    """Parameters of the chain.

    Args:
        voxel_m: edge of a voxel; its points become their mean.
        reach_m: horizontal distance up to which points count.
        plane_trials: planes through three points that are tried.
        plane_inlier_m: a point as near to a plane supports it.
        ground_m: points up to this height over the plane are of the ground.
        cluster_gap_m: greatest distance between neighbours of a cluster.
        least_voxels: smaller clusters are left out.
        seed: of the planes that are tried.

    Raises:
        ConfigError: a value is out of range.
    """

    voxel_m: float = 0.1
    reach_m: float = 40.0
    plane_trials: int = 100
    plane_inlier_m: float = 0.15
    ground_m: float = 0.25
    cluster_gap_m: float = 0.5
    least_voxels: int = 5
    seed: int = 0

    def __post_init__(self) -> None:
        lengths = (self.voxel_m, self.reach_m, self.plane_inlier_m, self.ground_m, self.cluster_gap_m)
        if not all(0.0 < value < math.inf for value in lengths):
            raise ConfigError(f"plain detector: lengths must be positive and finite, got {self}")
        if self.plane_trials < 1 or self.least_voxels < 1:
            raise ConfigError("plain detector: plane_trials and least_voxels must be at least 1")


def detect_plain(
    cloud: PointCloud,
    config: PlainConfig,
    *,
    monitored: Monitored | None = None,
    sensor_height_m: float | None = None,
) -> BoxDetections:
    """Boxes of a cloud by the plain chain; all have score 1.

    Args:
        cloud: P points.
        config: parameters.
        monitored: points that may be of a road user; None: all.
        sensor_height_m: not used: the plane says it.
    """
    clock = StageClock()
    cluster_of_point = np.full(len(cloud), OUT_OF_REACH, dtype=np.int64)
    # a stray echo at a thousand kilometres would have no number of a voxel
    measured = np.flatnonzero((np.abs(cloud.xyz_m) <= 2.0 * config.reach_m).all(axis=1))
    xyz = cloud.xyz_m[measured].astype(np.float64)
    voxel_of_point, voxel = voxels(xyz, config.voxel_m)
    clock.note("voxel grid", len(voxel), "voxels")
    near = np.flatnonzero(np.hypot(voxel[:, 0], voxel[:, 1]) <= config.reach_m)
    clock.note("region of interest", len(near), "voxels")
    cluster_of_voxel = np.full(len(voxel), OUT_OF_REACH, dtype=np.int64)
    cluster_of_voxel[near] = GROUND
    above = near[_above_plane(voxel[near], config)]
    clock.note("ground plane", len(above), "voxels")
    if monitored is not None:
        cluster_of_voxel[above] = OFF_AREA
        if callable(monitored):
            above = above[monitored(voxel[above])]
        else:
            kept = np.zeros(len(voxel), dtype=np.bool_)
            kept[voxel_of_point[monitored[measured]]] = True
            above = above[kept[above]]
        clock.note("monitored area", len(above), "voxels")
    label, sizes = _clusters(voxel[above], config.cluster_gap_m)
    large = sizes >= config.least_voxels
    number = np.where(large, np.cumsum(large) - 1, LOOSE)
    cluster_of_voxel[above] = number[label]
    clock.note("clusters", int(large.sum()), "clusters")
    boxes, category, box_cluster = _boxes(voxel[above], number[label])
    clock.note("rules of size", len(boxes), "boxes")
    cluster_of_point[measured] = cluster_of_voxel[voxel_of_point]
    return BoxDetections(boxes, np.ones(len(boxes)), category, clock.stages, cluster_of_point, box_cluster)


def voxels(xyz_m: FloatArray, edge_m: float) -> tuple[IntArray, FloatArray]:
    """(P,) the voxel of each point, and (V, 3) means of the points of each."""
    if not len(xyz_m):
        return np.zeros(0, dtype=np.int64), np.zeros((0, 3))
    cell = np.floor(xyz_m / edge_m).astype(np.int64)
    cell -= cell.min(axis=0)
    shape = cell.max(axis=0) + 1
    key = (cell[:, 0] * shape[1] + cell[:, 1]) * shape[2] + cell[:, 2]
    _, which, count = np.unique(key, return_inverse=True, return_counts=True)
    mean = np.column_stack([np.bincount(which, xyz_m[:, axis]) / count for axis in range(3)])
    return which.astype(np.int64), mean


def _above_plane(xyz_m: FloatArray, config: PlainConfig) -> BoolArray:
    """(V,) which points are above the plane through three of them that most others are near to."""
    if len(xyz_m) < 3:
        return np.ones(len(xyz_m), dtype=np.bool_)
    rng = np.random.default_rng(config.seed)
    corner = xyz_m[rng.integers(0, len(xyz_m), (config.plane_trials, 3))]
    normal = np.cross(corner[:, 1] - corner[:, 0], corner[:, 2] - corner[:, 0])
    length = np.linalg.norm(normal, axis=1)
    normal, start = normal[length > 0.0] / length[length > 0.0, None], corner[length > 0.0, 0]
    if not len(normal):
        return np.ones(len(xyz_m), dtype=np.bool_)
    normal *= np.where(normal[:, 2] < 0.0, -1.0, 1.0)[:, None]
    height = xyz_m @ normal.T - np.einsum("nk,nk->n", normal, start)
    best = int(np.count_nonzero(np.abs(height) <= config.plane_inlier_m, axis=0).argmax())
    above: BoolArray = height[:, best] > config.ground_m
    return above


def _clusters(xyz_m: FloatArray, gap_m: float) -> tuple[IntArray, IntArray]:
    """(V,) cluster of each point and (C,) their sizes; neighbours are at most `gap_m` apart."""
    from scipy.sparse import coo_matrix  # these take longer to import than a run
    from scipy.sparse.csgraph import connected_components
    from scipy.spatial import cKDTree

    if not len(xyz_m):
        return np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.int64)
    pairs = cKDTree(xyz_m).query_pairs(gap_m, output_type="ndarray")
    links = coo_matrix((np.ones(len(pairs), dtype=np.bool_), pairs.T), shape=(len(xyz_m),) * 2)
    label = connected_components(links, directed=False)[1].astype(np.int64)
    return label, np.bincount(label)


def _boxes(xyz_m: FloatArray, number: IntArray) -> tuple[Boxes3D, StrArray, IntArray]:
    """Boxes of the clusters that pass a rule, their classes and their clusters' numbers."""
    centers, sizes, yaws, category, box_cluster = [], [], [], [], []
    order = np.argsort(number, kind="stable")
    first = np.searchsorted(number[order], np.arange(number.max(initial=-1) + 2))
    for cluster, (low, high) in enumerate(zip(first[:-1].tolist(), first[1:].tolist(), strict=True)):
        points = xyz_m[order[low:high]]
        middle, extent, yaw = least_rectangle(points[:, :2])
        bottom, top = float(points[:, 2].min()), float(points[:, 2].max())
        rule = _rule(extent, top - bottom)
        if rule is None:
            continue
        size = np.maximum(np.array([*extent, top - bottom]), rule.size_m)
        centers.append([*_grown(middle, extent, size[:2], yaw), top - 0.5 * size[2]])
        sizes.append(size)
        yaws.append(yaw)
        category.append(rule.category)
        box_cluster.append(cluster)
    boxes = Boxes3D(np.array(centers).reshape(-1, 3), np.array(sizes).reshape(-1, 3), np.array(yaws))
    return boxes, np.array(category, dtype=np.str_), np.array(box_cluster, dtype=np.int64)


def _rule(extent: FloatArray, height_m: float) -> SizeRule | None:
    for rule in SIZE_RULES:
        upright = rule.height_m[0] <= height_m <= rule.height_m[1]
        if upright and rule.length_m[0] <= extent[0] <= rule.length_m[1] and extent[1] <= rule.width_m:
            return rule
    return None


def least_rectangle(xy_m: FloatArray) -> tuple[FloatArray, FloatArray, float]:
    """The rectangle of least area around points: middle, length and width, heading of the length.

    Args:
        xy_m: (K, 2) points, K at least 1.
    """
    angle = np.linspace(0.0, 0.5 * np.pi, HEADINGS, endpoint=False)
    c, s = np.cos(angle), np.sin(angle)
    along = xy_m[:, :1] * c + xy_m[:, 1:] * s
    across = xy_m[:, 1:] * c - xy_m[:, :1] * s
    low = np.stack((along.min(axis=0), across.min(axis=0)))
    high = np.stack((along.max(axis=0), across.max(axis=0)))
    size = high - low
    best = int(((size[0] + 1e-3) * (size[1] + 1e-3)).argmin())
    u, v = 0.5 * (low + high)[:, best]
    middle = np.array([c[best] * u - s[best] * v, s[best] * u + c[best] * v])
    length, width = size[:, best].tolist()
    if width > length:
        return middle, np.array([width, length]), float(angle[best] + 0.5 * np.pi)
    return middle, np.array([length, width]), float(angle[best])


def _grown(middle: FloatArray, extent: FloatArray, size: FloatArray, yaw_rad: float) -> FloatArray:
    """Middle of a rectangle that has grown from `extent` to `size`, away from the sensor."""
    axes = np.array([[math.cos(yaw_rad), math.sin(yaw_rad)], [-math.sin(yaw_rad), math.cos(yaw_rad)]])
    away = np.where(axes @ middle < 0.0, -1.0, 1.0)
    grown: FloatArray = middle + (0.5 * away * (size - extent)) @ axes
    return grown
