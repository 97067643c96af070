"""Road users cut out of clouds, to be composed anew."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from evaluation.studies.datasets.reading import read_frames
from evaluation.studies.lidar.drawn import CLASSES, drawn_size
from scenarios.errors import DatasetError
from scenarios.recorded.layouts.scenes import SPLITS
from scenarios.sensors.lidar import LidarConfig, LidarSensor
from scenarios.sensors.world import World
from smartmot.pointcloud import Boxes3D
from smartmot.types import Boxes, EgoState, FloatArray

LEAST_CROP_POINTS = 30
"""Fewer tell nothing of a shape; of an adult a 32-line scanner has as many up to 10 m."""

RECORDED_M = (5.0, 9.0)
"""Distances at which simulated road users are recorded alone: near, so that farther ones are thinned out."""

SIMULATED_CROPS = 24
"""Of each class in each split."""

MOST_CROPS = 2000
"""That are kept of a data set, spread over it: some 50 MB."""


@dataclass(frozen=True, slots=True, eq=False)
class Crop:
    """A road user's points.

    Args:
        xyz_m: (P, 3) points, axes of its box: x along its heading, origin in the middle of the underside.
        intensity: (P,) echoes, 0 to 1.
        category: name out of `smartmot.types.CATEGORIES`.
        size_m: (3,) length, width and height.
        distance_m: from the sensor that recorded it.
        bearing_rad: of that sensor, seen from the road user, from its heading on.
    """

    xyz_m: FloatArray
    intensity: FloatArray
    category: str
    size_m: FloatArray
    distance_m: float
    bearing_rad: float


@lru_cache(maxsize=8)
def simulated_crops(config: LidarConfig, split: str, seed: int) -> tuple[Crop, ...]:
    """Road users that a LiDAR has recorded alone, on no ground; those of a split are in no other.

    Args:
        config: the LiDAR on its mount.
        split: out of `SPLITS`.
        seed: of sizes, places and noise.
    """
    rng = np.random.default_rng((seed, 1 + SPLITS.index(split)))
    crops = []
    for number in range(SIMULATED_CROPS):
        for category in CLASSES:
            size = drawn_size(category, rng)
            distance, yaw = rng.uniform(*RECORDED_M), rng.uniform(-math.pi, math.pi)
            box = Boxes3D(np.array([[distance, 0.0, 0.5 * size[2]]]), size[None], np.array([yaw]))
            sensor = LidarSensor(config, int(rng.integers(2**31)))
            everyone = np.ones(1, dtype=np.bool_)
            world = World(
                number / config.pattern.rate_hz,
                Boxes(box.center_m[:, :2], box.size_m[:, :2], box.yaw_rad),
                np.zeros(1),
                size[2:],
                np.zeros(1, dtype=np.int64),
                np.array([category]),
                everyone,
                everyone,
            )
            made, row = sensor.label(world, EgoState(world.time_s, 0.0, 0.0, 0.0, 0.0))
            own = made.cloud[row == 0]
            place = np.array([config.mount.forward_m, 0.0, config.mount.height_m])
            xyz = own.xyz_m.astype(np.float64) + place
            intensity = np.zeros(len(own)) if own.intensity is None else own.intensity.astype(np.float64)
            crops.append(_crop(xyz, intensity, category, box, 0.0))
    return tuple(crop for crop in crops if len(crop.xyz_m) >= LEAST_CROP_POINTS)


@lru_cache(maxsize=4)
def crops_of(folder: Path, split: str) -> tuple[Crop, ...]:
    """Road users cut out of the frames of a data set's split, those with enough points.

    Points up to 5 cm over the underside are left out: they are the ground's.

    Raises:
        DatasetError: the data set cannot be read, or the split has none.
    """
    crops = []
    for frame in read_frames(folder):
        if frame.split != split:
            continue
        boxes, cloud, intensity = frame.boxes, frame.cloud, frame.intensity
        for row, count in enumerate(boxes.point_counts(cloud.xyz_m).tolist()):
            category = str(frame.labels.category[row])
            if count < LEAST_CROP_POINTS or category not in CLASSES:
                continue
            bottom = float(boxes.bottom_m[row])
            crop = _crop(cloud.xyz_m.astype(np.float64), intensity, category, boxes[[row]], bottom)
            if len(crop.xyz_m) >= LEAST_CROP_POINTS:
                crops.append(crop)
    if not crops:
        raise DatasetError(
            f"{folder}: split {split} has no pedestrian, cyclist or car with {LEAST_CROP_POINTS} points"
        )
    step = math.ceil(len(crops) / MOST_CROPS)
    return tuple(crops[::step])


GROUND_M = 0.05
"""Over the underside of a box: range noise of the ground."""


def _crop(xyz: FloatArray, intensity: FloatArray, category: str, box: Boxes3D, bottom_m: float) -> Crop:
    """The points in a box, which stands at a height."""
    yaw, size = float(box.yaw_rad[0]), box.size_m[0]
    c, s = math.cos(yaw), math.sin(yaw)
    rel = xyz - (*box.center_m[0, :2], bottom_m)
    own = np.column_stack((c * rel[:, 0] + s * rel[:, 1], c * rel[:, 1] - s * rel[:, 0], rel[:, 2]))
    inside = (np.abs(own[:, :2]) <= 0.5 * size[:2]).all(axis=1) & (own[:, 2] <= size[2])
    inside &= own[:, 2] >= GROUND_M
    x, y = box.center_m[0, :2]
    bearing = math.atan2(-y, -x) - yaw
    return Crop(own[inside], intensity[inside], category, size, math.hypot(x, y), bearing)


def mirrored(crop: Crop) -> Crop:
    """The crop with left and right exchanged."""
    return replace(crop, xyz_m=crop.xyz_m * (1.0, -1.0, 1.0), bearing_rad=-crop.bearing_rad)


def scaled(crop: Crop, factor: float) -> Crop:
    """The crop, larger or smaller in all directions."""
    return replace(crop, xyz_m=factor * crop.xyz_m, size_m=factor * crop.size_m)
