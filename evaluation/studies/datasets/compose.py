"""Frames composed of cut-out road users: the scene composer of the thesis, with shadows.

Road users are placed on a floor at random, tested for overlap, turned, and thinned out by distance. What is
behind one of them has no echo: along its azimuth, from the ground to its highest point, it hides all that is
farther away, the floor too.

Source: "Detección de objetos 3D mediante LiDAR en sistemas embebidos" (Bilbao, 2022), data augmentation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from evaluation.studies.datasets.crops import Crop, crops_of, mirrored, scaled, simulated_crops
from evaluation.studies.datasets.frames import LabelledFrame
from evaluation.studies.datasets.reading import DatasetFrame, read_frames
from scenarios.errors import DatasetError
from scenarios.recorded.layouts.scenes import ScenePlace
from scenarios.sensors.lidar import LidarConfig, LidarSensor, Rosette
from scenarios.sensors.world import World
from smartmot.geometry import corners, wrap_angle
from smartmot.overlap import intersection_area
from smartmot.pointcloud import Boxes3D, PointCloud
from smartmot.types import BoolArray, Boxes, EgoState, FloatArray

FRAMES_PER_SCENE = 4
"""As of streets; frames of crops have nothing in common but the split of their crops."""

FARTHEST_M = 45.0
"""Of placed road users: a 32-line scanner has a point or two of an adult there."""

MOST_USERS = 12
"""Road users that are tried in a frame, one at least."""

TRIES_ACROSS, TRIES_ALONG = 8, 3
"""Places that are tried: with another y, and then with another x, as in the thesis."""

CLEARANCE_M = 0.2
"""Free width around a placed box; assumed."""

COLUMN_RAD = math.radians(0.2)
"""Width of the columns in which a silhouette is measured: finer than the step of any sensor here."""

BODY_SHARE = 0.9
"""Of the width of its box from where it is seen, a body fills so much; assumed, for its rounded corners."""

BEHIND_M = 0.05
"""So much farther away than a silhouette a point is behind it: more than the noise of ranges."""


@dataclass(frozen=True, slots=True)
class Composer:
    """Cut-out road users on a floor or in the frames of a data set.

    Args:
        config: the LiDAR on its mount.
        seed: of all that is drawn.
        crops: data set out of which road users are cut; None: simulated ones, each recorded alone.
        background: data set into whose frames they are pasted; None: a floor.
        flip: whether half of them are mirrored.
        scale: greatest change of their size, as a share.
        noise_m: standard deviation of a change of each point, along its ray.
        turn_rad: greatest turn against the line of sight, to either side.
    """

    config: LidarConfig
    seed: int
    crops: Path | None = None
    background: Path | None = None
    flip: bool = False
    scale: float = 0.0
    noise_m: float = 0.0
    turn_rad: float = math.radians(30.0)

    @property
    def frames_per_scene(self) -> int:
        """See `FRAMES_PER_SCENE`."""
        return FRAMES_PER_SCENE

    def require(self, split: str) -> None:
        """See that the split has crops, and frames to paste them into.

        Raises:
            DatasetError: it has not.
        """
        if self.crops is not None:
            crops_of(self.crops, split)
        if self.background is not None:
            _backgrounds(self.background, split)

    def frames(self, place: ScenePlace, count: int) -> Iterator[LabelledFrame]:
        """The frames of a scene; its crops are those of its split, and no other split has them."""
        if self.crops is None:
            library = simulated_crops(self.config, place.split, self.seed)
        else:
            library = crops_of(self.crops, place.split)
        for number in range(place.first_frame, place.first_frame + count):
            rng = np.random.default_rng((self.seed, 0, number))
            yield self._composed(library, self._ground(place, number, rng), rng)

    def _ground(self, place: ScenePlace, number: int, rng: np.random.Generator) -> LabelledFrame:
        """What road users are placed on: an empty floor, or a frame of the background's split."""
        if self.background is not None:
            frames = _backgrounds(self.background, place.split)
            frame = frames[int(rng.integers(len(frames)))]
            cloud = replace(frame.cloud, intensity=frame.intensity)
            return LabelledFrame(cloud, frame.boxes, frame.labels.category, (0.0, 0.0, 0.0, 0.0))
        time_s = number / self.config.pattern.rate_hz
        nobody = np.zeros(0, dtype=np.bool_)
        world = World(
            time_s, Boxes(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros(0)), np.zeros(0), np.zeros(0),
            np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.str_), nobody, nobody,
        )  # fmt: skip
        sensor = LidarSensor(self.config, self.seed)
        cloud = sensor.measure(world, EgoState(time_s, 0.0, 0.0, 0.0, 0.0)).cloud
        return LabelledFrame(cloud, Boxes3D.empty(), np.zeros(0, dtype=np.str_), (0.0, 0.0, 0.0, 0.0), number)

    def _composed(
        self, library: tuple[Crop, ...], ground: LabelledFrame, rng: np.random.Generator
    ) -> LabelledFrame:
        placed: list[tuple[Crop, FloatArray, float]] = []
        taken = ground.boxes
        for _ in range(int(rng.integers(1, MOST_USERS + 1))):
            crop = self._varied(library[int(rng.integers(len(library)))], rng)
            spot = self._free_place(crop, taken, rng)
            if spot is None:
                continue
            center, yaw = spot
            placed.append((crop, center, yaw))
            taken = _with_box(taken, crop, center, yaw, self.config.mount.height_m)
        return self._clouded(ground, placed, taken, rng)

    def _varied(self, crop: Crop, rng: np.random.Generator) -> Crop:
        if self.flip and rng.random() < 0.5:
            crop = mirrored(crop)
        return scaled(crop, 1.0 + self.scale * rng.uniform(-1.0, 1.0)) if self.scale else crop

    def _free_place(
        self, crop: Crop, taken: Boxes3D, rng: np.random.Generator
    ) -> tuple[FloatArray, float] | None:
        """A place no nearer than the crop was recorded, with its heading; None: none is free.

        A crop shows the side that its sensor saw: this side faces the sensor again, but for the turn.
        """
        half_rad = _half_field(self.config)
        for _ in range(TRIES_ALONG):
            ahead_m = rng.uniform(-1.0 if half_rad >= math.pi else 0.0, 1.0) * FARTHEST_M
            for _ in range(TRIES_ACROSS):
                center = np.array([ahead_m, rng.uniform(-FARTHEST_M, FARTHEST_M)])
                distance, azimuth = math.hypot(*center), math.atan2(center[1], center[0])
                turn = rng.uniform(-self.turn_rad, self.turn_rad)
                if not crop.distance_m <= distance <= FARTHEST_M or abs(azimuth) > half_rad:
                    continue
                yaw = math.remainder(azimuth + math.pi - crop.bearing_rad + turn, 2.0 * math.pi)
                if _is_free(crop, center, yaw, taken):
                    return center, yaw
        return None

    def _clouded(
        self,
        ground: LabelledFrame,
        placed: list[tuple[Crop, FloatArray, float]],
        boxes: Boxes3D,
        rng: np.random.Generator,
    ) -> LabelledFrame:
        """The cloud: floor and road users, thinned and without what others hide."""
        height_m = self.config.mount.height_m
        cloud = ground.cloud
        intensity = np.zeros(len(cloud)) if cloud.intensity is None else cloud.intensity
        parts, echoes, shapes = [cloud.xyz_m.astype(np.float64)], [intensity.astype(np.float64)], []
        for crop, center, yaw in placed:
            xyz = _placed(crop, center, yaw) - (0.0, 0.0, height_m)
            outline = corners(center[None], crop.size_m[None, :2], np.array([yaw]))[0]
            shapes.append(_silhouette(xyz, outline, height_m))
            kept = rng.random(len(xyz)) < (crop.distance_m / math.hypot(*center)) ** 2
            xyz = xyz[kept]
            if self.noise_m:
                distance = np.linalg.norm(xyz, axis=1)
                xyz = xyz * (1.0 + self.noise_m * rng.standard_normal(len(xyz)) / distance)[:, None]
            parts.append(xyz)
            echoes.append(crop.intensity[kept])
        visible = [
            ~_hidden(xyz, shapes[: k - 1] + shapes[k:] if k else shapes) for k, xyz in enumerate(parts)
        ]
        for crop, center, yaw in placed:
            visible[0] &= ~_inside(parts[0], crop, center, yaw, height_m)
        xyz = np.concatenate([part[seen] for part, seen in zip(parts, visible, strict=True)])
        strength = np.concatenate([echo[seen] for echo, seen in zip(echoes, visible, strict=True)])
        made = PointCloud(xyz.astype(np.float32), strength.astype(np.float32), frame="lidar")
        names = np.array([*ground.category.tolist(), *(crop.category for crop, *_ in placed)], dtype=np.str_)
        return replace(ground, cloud=made, boxes=boxes, category=names)


_MOST_BACKGROUNDS = 100
"""Kept in memory: some 100 MB."""


@lru_cache(maxsize=4)
def _backgrounds(folder: Path, split: str) -> tuple[DatasetFrame, ...]:
    """Frames of a data set's split, at most `_MOST_BACKGROUNDS`.

    Raises:
        DatasetError: it cannot be read, or the split has none.
    """
    frames = []
    for frame in read_frames(folder):
        if frame.split == split:
            frames.append(frame)
        if len(frames) == _MOST_BACKGROUNDS:
            break
    if not frames:
        raise DatasetError(f"{folder}: no frame of split {split} to paste into")
    return tuple(frames)


def _half_field(config: LidarConfig) -> float:
    """Half the horizontal field of view."""
    pattern = config.pattern
    if isinstance(pattern, Rosette):
        return math.radians(34.0)  # of 70.4 degrees, so that bodies are inside
    return math.pi


def _with_box(taken: Boxes3D, crop: Crop, center: FloatArray, yaw: float, height_m: float) -> Boxes3D:
    middle = np.array([[*center, 0.5 * crop.size_m[2] - height_m]])
    return Boxes3D(
        np.concatenate((taken.center_m, middle)),
        np.concatenate((taken.size_m, crop.size_m[None])),
        np.append(taken.yaw_rad, yaw),
    )


def _is_free(crop: Crop, center: FloatArray, yaw: float, taken: Boxes3D) -> bool:
    """Whether a box overlaps no other, with some clearance."""
    count = len(taken)
    if not count:
        return True
    size = np.tile(crop.size_m[:2] + 2.0 * CLEARANCE_M, (count, 1))
    area = intersection_area(
        np.tile(center, (count, 1)), size, np.full(count, yaw),
        taken.center_m[:, :2], taken.size_m[:, :2], taken.yaw_rad,
    )  # fmt: skip
    return not bool((area > 0.0).any())


def _placed(crop: Crop, center: FloatArray, yaw: float) -> FloatArray:
    """(P, 3) points of a crop at its place, heights over the ground."""
    c, s = math.cos(yaw), math.sin(yaw)
    x, y, z = crop.xyz_m.T
    return np.column_stack((center[0] + c * x - s * y, center[1] + s * x + c * y, z))


def _inside(xyz: FloatArray, crop: Crop, center: FloatArray, yaw: float, height_m: float) -> BoolArray:
    """(N,) points of the ground, or on it, where a road user stands."""
    c, s = math.cos(yaw), math.sin(yaw)
    rel = xyz[:, :2] - center
    along, across = np.abs(c * rel[:, 0] + s * rel[:, 1]), np.abs(c * rel[:, 1] - s * rel[:, 0])
    inside: BoolArray = (along <= 0.5 * crop.size_m[0]) & (across <= 0.5 * crop.size_m[1])
    inside &= xyz[:, 2] <= crop.size_m[2] - height_m
    return inside


@dataclass(frozen=True, slots=True, eq=False)
class _Silhouette:
    """What a road user hides: in columns of azimuth, from `middle` on, slopes and distances.

    It reaches from `right` to `left`: what its points do not cover is as the nearest of their columns.
    """

    middle_rad: float
    right_rad: float
    left_rad: float
    azimuth_rad: FloatArray
    low: FloatArray
    high: FloatArray
    distance_m: FloatArray


def _silhouette(xyz: FloatArray, outline: FloatArray, height_m: float) -> _Silhouette:
    """The columns of a crop's points, seen from a height over the ground, on which it stands.

    A crop that is turned shows the side that was seen; it hides what a whole body hides.
    """
    x, y, z = xyz.T
    distance = np.hypot(x, y)
    middle = math.atan2(outline[:, 1].mean(), outline[:, 0].mean())
    span = BODY_SHARE * wrap_angle(np.arctan2(outline[:, 1], outline[:, 0]) - middle)
    azimuth = wrap_angle(np.arctan2(y, x) - middle)
    column = np.floor(azimuth / COLUMN_RAD).astype(np.int64)
    order = np.argsort(column, kind="stable")
    columns, first = np.unique(column[order], return_index=True)
    high = np.maximum.reduceat((z / distance)[order], first)
    front = np.minimum.reduceat(distance[order], first)
    azimuth_rad = (columns + 0.5).astype(np.float64) * COLUMN_RAD
    right = min(float(span.min()), float(azimuth_rad[0]) - 0.5 * COLUMN_RAD)
    left = max(float(span.max()), float(azimuth_rad[-1]) + 0.5 * COLUMN_RAD)
    return _Silhouette(middle, right, left, azimuth_rad, -height_m / front, high, front)


def _hidden(xyz: FloatArray, shapes: list[_Silhouette]) -> BoolArray:
    """(N,) points behind one of the silhouettes."""
    hidden = np.zeros(len(xyz), dtype=np.bool_)
    if not len(xyz):
        return hidden
    distance = np.hypot(xyz[:, 0], xyz[:, 1])
    bearing, slope = np.arctan2(xyz[:, 1], xyz[:, 0]), xyz[:, 2] / np.maximum(distance, 1e-9)
    for shape in shapes:
        azimuth = wrap_angle(bearing - shape.middle_rad)
        near = np.flatnonzero(
            (azimuth >= shape.right_rad)
            & (azimuth <= shape.left_rad)
            & (distance > shape.distance_m.min() + BEHIND_M)
        )
        low, high, front = (
            np.interp(azimuth[near], shape.azimuth_rad, column)
            for column in (shape.low, shape.high, shape.distance_m)
        )
        behind = (slope[near] >= low) & (slope[near] <= high) & (distance[near] > front + BEHIND_M)
        hidden[near[behind]] = True
    return hidden
