"""Labelled clouds that detectors are compared on: drawn, composed, and recorded by others."""

from __future__ import annotations

import hashlib
from collections.abc import Hashable, Iterator
from dataclasses import dataclass, field, replace
from functools import lru_cache
from pathlib import Path
from types import ModuleType
from typing import Protocol

import numpy as np

from evaluation.errors import ArgumentError
from evaluation.studies.datasets import compose, crops, frames
from evaluation.studies.datasets.compose import Composer
from evaluation.studies.datasets.reading import Unlabelled, read_frames
from evaluation.studies.lidar import cars, clutter, drawn, echoes
from evaluation.studies.lidar.drawn import drawn_frames
from scenarios.drawn.map_set import MAPS
from scenarios.drawn.values import data
from scenarios.recorded.clouds.files import cloud_files, read_cloud
from scenarios.recorded.kitti import CATEGORY_OF_TYPE, NEIGHBOURS, TRACKING_COLUMNS
from scenarios.recorded.kitti_objects.calibration import read_calibration
from scenarios.recorded.kitti_objects.labels import DONT_CARE
from scenarios.recorded.layouts.scenes import ScenePlace
from scenarios.recorded.textfile import read_table
from scenarios.sensors.lidar import Mount, lidar_config
from smartmot.arrays import BoolArray, StrArray
from smartmot.lidar.learned import SHIPPED, shipped_card
from smartmot.pointcloud import Boxes3D, PointCloud

AROUND_M = 0.05
"""So far outside its box a point is counted as its own: two standard deviations of range noise."""


@dataclass(frozen=True, slots=True, eq=False)
class LabelledCloud:
    """A cloud and its labels, in its frame.

    Args:
        cloud: P points.
        boxes: K labels.
        category: (K,) names out of `smartmot.types.CATEGORIES`.
        is_neighbour: (K,) of a type so near to a scored one that a box on it is no mistake.
        unlabelled: where road users are not labelled; None: nowhere.
    """

    cloud: PointCloud
    boxes: Boxes3D
    category: StrArray
    is_neighbour: BoolArray
    unlabelled: Unlabelled | None = None


class CloudSet(Hashable, Protocol):
    """Clouds with labels; the same for the same values."""

    @property
    def name(self) -> str:
        """In tables."""

    @property
    def title(self) -> str:
        """What they are, in words."""

    @property
    def is_real(self) -> bool:
        """Whether a sensor recorded them."""

    def clouds(self) -> Iterator[LabelledCloud]:
        """One after another."""

    @property
    def digest(self) -> str:
        """Of what is not in the values."""


@dataclass(frozen=True, slots=True)
class _Simulated:
    """Clouds of a simulated LiDAR.

    Args:
        sensor: name of the LiDAR.
        height_m: of it over the ground.
        count: clouds.
        seed: of all that is drawn.
    """

    sensor: str
    height_m: float
    count: int
    seed: int
    is_real: bool = field(default=False, init=False)


@dataclass(frozen=True, slots=True)
class DrawnClouds(_Simulated):
    """Streets drawn on maps of the test split, but those that the cards of shipped networks name."""

    @property
    def name(self) -> str:
        """In tables."""
        return f"streets, {self.sensor}"

    @property
    def title(self) -> str:
        """What they are."""
        return f"streets on maps of the test split, {self.sensor} at {self.height_m:g} m"

    @property
    def digest(self) -> str:
        """Of the modules that draw them."""
        return _of_modules(cars, clutter, drawn, echoes)

    def clouds(self) -> Iterator[LabelledCloud]:
        """One after another."""
        files = [f"{name}.xodr" for name in data()["maps"]["test"]]
        maps = [
            MAPS / file for file in files if not any(file in shipped_card(name)["maps"] for name in SHIPPED)
        ]
        config, mount = lidar_config(self.sensor), Mount(self.height_m)
        for frame in drawn_frames(maps, config, self.count, self.seed, mount=mount, in_turn=True):
            yield _of_scored_kinds(frame.cloud, frame.boxes, frame.category)


@dataclass(frozen=True, slots=True)
class ComposedClouds(_Simulated):
    """Cut-out road users on an empty floor, those of the test split."""

    @property
    def name(self) -> str:
        """In tables."""
        return f"composed, {self.sensor}"

    @property
    def title(self) -> str:
        """What they are."""
        return f"cut-out road users on an empty floor, {self.sensor} at {self.height_m:g} m"

    @property
    def digest(self) -> str:
        """Of the modules that compose them."""
        return _of_modules(compose, crops, frames)

    def clouds(self) -> Iterator[LabelledCloud]:
        """One after another."""
        config = replace(lidar_config(self.sensor), mount=Mount(self.height_m))
        composer = Composer(config, self.seed)
        for frame in composer.frames(ScenePlace(0, 0, "test"), self.count):
            yield _of_scored_kinds(frame.cloud, frame.boxes, frame.category)


@dataclass(frozen=True, slots=True)
class KittiObjects:
    """Frames of KITTI's object data with labels.

    Args:
        folder: with ImageSets and training.
    """

    folder: Path
    name: str = field(default="KITTI, frames", init=False)
    title: str = field(default="single frames of KITTI's object data", init=False)
    is_real: bool = field(default=True, init=False)

    @property
    def digest(self) -> str:
        """Of clouds, labels and calibrations."""
        return _digest(self.folder)

    def clouds(self) -> Iterator[LabelledCloud]:
        """One after another."""
        for frame in read_frames(self.folder):
            near = np.isin(frame.labels.kind, NEIGHBOURS)
            yield LabelledCloud(frame.cloud, frame.boxes, frame.labels.category, near, frame.unlabelled)


@dataclass(frozen=True, slots=True)
class KittiDrive:
    """Consecutive frames of KITTI's tracking data.

    Args:
        folder: with clouds in velodyne, one label file and one calibration.
    """

    folder: Path
    name: str = field(default="KITTI, drive", init=False)
    title: str = field(default="consecutive frames of a drive of KITTI's tracking data", init=False)
    is_real: bool = field(default=True, init=False)

    @property
    def digest(self) -> str:
        """Of clouds, labels and calibration."""
        return _digest(self.folder)

    def clouds(self) -> Iterator[LabelledCloud]:
        """One after another."""
        labels, calibration = (_only(self.folder, pattern) for pattern in ("label_*.txt", "calib_*.txt"))
        table = read_table(labels, TRACKING_COLUMNS, ("type",), optional=1)
        known = np.array([kind in CATEGORY_OF_TYPE for kind in table["type"].tolist()])
        regions = table["type"] == DONT_CARE
        calib = read_calibration(calibration)
        for path in cloud_files(self.folder / "velodyne"):
            now = table.whole("frame") == int(path.stem)
            rows = table.rows(known & now)
            unlabelled = Unlabelled(table.rows(regions & now).stacked("x1", "y1", "x2", "y2"), calib)
            boxes = calib.boxes_to_lidar(rows.stacked("h", "w", "l", "x", "y", "z", "ry"))
            kinds = rows["type"]
            category = np.array([CATEGORY_OF_TYPE[kind] for kind in kinds.tolist()], dtype=np.str_)
            near = np.isin(kinds, NEIGHBOURS)
            yield LabelledCloud(read_cloud(path).cloud, boxes, category, near, unlabelled)


@lru_cache(maxsize=1)
def all_clouds(clouds: CloudSet) -> tuple[LabelledCloud, ...]:
    """Those of a set, kept until another is asked for: every detector sees the same."""
    return tuple(clouds.clouds())


def _of_scored_kinds(cloud: PointCloud, boxes: Boxes3D, category: StrArray) -> LabelledCloud:
    return LabelledCloud(cloud, boxes, category, np.zeros(len(boxes), dtype=np.bool_))


def _of_modules(*modules: ModuleType) -> str:
    digest = hashlib.sha256()
    for module in modules:
        digest.update(Path(str(module.__file__)).read_bytes())
    return digest.hexdigest()


def _only(folder: Path, pattern: str) -> Path:
    paths = sorted(folder.glob(pattern))
    if len(paths) != 1:
        raise ArgumentError(f"{folder}: expected one file {pattern}, there are {len(paths)}")
    return paths[0]


def _digest(folder: Path) -> str:
    digest = hashlib.sha256()
    for path in sorted(path for path in folder.rglob("*") if path.suffix in (".bin", ".txt")):
        digest.update(path.relative_to(folder).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
