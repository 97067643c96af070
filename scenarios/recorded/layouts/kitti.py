"""Recordings with clouds in the layout of KITTI's object data, as OpenPCDet and `scenarios.recorded` read it.

`training` has the frames of train and val, `testing` those of test, with labels too; `ImageSets` names the
frames of each split, and in `scenes.txt` the scene of each. There are no images: the camera of the
calibration is one that KITTI's vehicle has, without its small turn against the LiDAR. Labels are all around;
those outside its image have a 2-D box without extent.

Source: readme.txt of KITTI's object development kit; OpenPCDet, docs/GETTING_STARTED.md.
"""

from __future__ import annotations

from collections.abc import Iterator
from collections.abc import Sequence as Many

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.camera import EGO_R_CAMERA, truncation
from scenarios.recorded.clouds.arrays import bin_bytes
from scenarios.recorded.dataset import Objects, Sequence, Sweeps
from scenarios.recorded.kitti import TYPE_OF_CATEGORY
from scenarios.recorded.kitti_objects.calibration import Calibration, calibration_text
from scenarios.recorded.kitti_objects.labels import object_text
from scenarios.recorded.layouts.scenes import SPLITS, ScenePlace, scene_places, truth_of
from scenarios.recorded.layouts.sweeps import SweepFiles, boxes_of
from scenarios.recorded.poses import heading
from smartmot.geometry import wrap_angle
from smartmot.pointcloud import Boxes3D
from smartmot.types import FloatArray

_CAMERA = np.array([(721.5377, 0.0, 609.5593, 0.0), (0.0, 721.5377, 172.854, 0.0), (0.0, 0.0, 1.0, 0.0)])
"""Focal length and middle of the image, pixels: P0 of KITTI's object data."""

_CAMERA_M = (0.27, 0.0, -0.08)
"""Camera 0 from the LiDAR: ahead, left, up. A. Geiger et al., IJRR 32 (2013) 1231, figure 3."""

LEAST_SEEN = (0.8, 0.4)
"""Shares of a label's points that are seen, from which on it is fully visible, and partly occluded. Assumed:
KITTI's annotators judged by eye."""

SCENES_TXT = "ImageSets/scenes.txt"
"""The scene of each frame, in words of its own: KITTI's layout has none."""

UNKNOWN_OCCLUSION = 3.0
"""KITTI's level for it."""


def calibration() -> Calibration:
    """The one of all frames."""
    turn = EGO_R_CAMERA.T
    shift = -turn @ np.array(_CAMERA_M)
    return Calibration(np.tile(_CAMERA, (4, 1, 1)), np.eye(3), np.column_stack((turn, shift)))


def kitti_files(sequences: Many[Sequence], seed: int = 0) -> Iterator[tuple[str, bytes]]:
    """Files of the layout but the clouds, by path below the data set's folder.

    Args:
        sequences: Recordings with labels, poses and clouds; each is a scene.
        seed: Of the splits.

    Raises:
        DatasetError: A recording has no labels, no poses or no clouds.
    """
    calib = calibration()
    text = calibration_text(calib).encode()
    frames: dict[str, list[str]] = {split: [] for split in SPLITS}
    scenes: list[str] = []
    for place, sequence in zip(scene_places(map(len, sequences), seed), sequences, strict=True):
        labels, pose = truth_of(sequence)
        if sequence.sweeps is None:
            raise DatasetError(f"sequence {sequence.name} has no clouds, which the layout consists of")
        for k, rows in enumerate(labels.frame_rows(len(sequence))):
            name = _name(place, k)
            frames[place.split].append(name)
            scenes.append(f"{name} {sequence.name}\n")
            yield f"{_folder(place)}/calib/{name}.txt", text
            lines = _lines(labels[rows], sequence.sweeps[rows], pose[k], calib)
            yield f"{_folder(place)}/label_2/{name}.txt", lines.encode()
    yield SCENES_TXT, "".join(scenes).encode()
    for split, names in frames.items():
        yield f"ImageSets/{split}.txt", "".join(f"{name}\n" for name in names).encode()


def boxes_in_lidar(labels: Objects, world_SE3_lidar: FloatArray) -> Boxes3D:
    """The boxes of a frame's labels in the sensor's frame; they stand upright in both."""
    boxes = boxes_of(labels)
    center = (boxes.center_m - world_SE3_lidar[:3, 3]) @ world_SE3_lidar[:3, :3]
    yaw = wrap_angle(boxes.yaw_rad - heading(world_SE3_lidar[None])[0])
    return Boxes3D(center, boxes.size_m, yaw)


def _lines(labels: Objects, sweeps: Sweeps, pose: FloatArray, calib: Calibration) -> str:
    boxes = boxes_in_lidar(labels, pose @ sweeps.ego_SE3_lidar)
    types = [TYPE_OF_CATEGORY[name] for name in labels.category.tolist()]
    outside = truncation(calib.boxes_to_camera(boxes), calib.projection[2])
    if sweeps.seen_share is None:
        level = np.full(len(labels), UNKNOWN_OCCLUSION)
    else:
        level = (sweeps.seen_share[:, None] < LEAST_SEEN).sum(axis=1).astype(np.float64)
    return object_text(boxes, types, calib, truncated=outside.round(2), occluded=level)


def _folder(place: ScenePlace) -> str:
    return "testing" if place.split == "test" else "training"


def _name(place: ScenePlace, k: int) -> str:
    return f"{place.first_frame + k:06d}"


KITTI_SWEEPS = SweepFiles(lambda place, _, k: f"{_folder(place)}/velodyne/{_name(place, k)}.bin", bin_bytes)
