"""Poses of KITTI's vehicle: from files of camera poses, or from the data set's GPS and IMU records.

Source of the records' meaning and of the Mercator projection: KITTI raw development kit, `dataformat.txt` and
`convertOxtsToPose.m`.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.camera import EGO_R_CAMERA
from scenarios.recorded.poses import homogeneous, rigid, turned_about
from scenarios.recorded.textfile import is_given_folder, read_table, read_text
from smartmot.types import FloatArray

MAX_ROTATION_ERROR = 1e-3
"""Entries of a pose's matrix may be rounded by this much."""
_GREATEST = 1e9
"""No entry of a calibration's matrix, in pixels or metres, is greater."""

EARTH_RADIUS_M = 6_378_137.0
"""Of the Mercator projection (WGS 84)."""

_POSE_COLUMNS = [f"{row}{column}" for row in "xyz" for column in ("x", "y", "z", "t")]
_OXTS_USED = ("lat_deg", "lon_deg", "alt_m", "roll_rad", "pitch_rad", "yaw_rad")
_OXTS_COLUMNS = [*_OXTS_USED, *(f"value_{k}" for k in range(7, 31))]


def read_poses(folder: Path, name: str) -> FloatArray | None:
    """Poses of a sequence in the frame of its first camera, turned to x ahead, y left, z up.

    Args:
        folder: The data set.
        name: The sequence.

    Returns:
        (F, 4, 4) world_SE3_ego, or None where there is neither a folder `ego_pose` nor `oxts`.

    Raises:
        DatasetError: A file is missing or wrong.
    """
    if is_given_folder(folder / "ego_pose"):
        camera = _camera_poses(folder / "ego_pose" / f"{name}.txt")
    elif is_given_folder(folder / "oxts"):
        camera = _recorded_poses(folder / "oxts" / f"{name}.txt", folder / "calib" / f"{name}.txt")
    else:
        return None
    pose = camera.copy()
    pose[:, :3, :3] = EGO_R_CAMERA @ camera[:, :3, :3] @ EGO_R_CAMERA.T
    pose[:, :3, 3] = camera[:, :3, 3] @ EGO_R_CAMERA.T
    return pose


def read_matrix(path: Path, names: tuple[str, ...], shape: tuple[int, int]) -> FloatArray:
    """A matrix of a calibration file, under one of the names that versions of the data set use.

    Raises:
        DatasetError: The file or the matrix is missing, or it is not of that shape.
    """
    for number, line in enumerate(read_text(path).splitlines(), 1):
        name, *fields = line.replace(":", " ", 1).split() or [""]
        if name not in names:
            continue
        try:
            values = np.array([float(field) for field in fields])
        except ValueError:
            values = np.zeros(0)
        if values.size != shape[0] * shape[1] or not (np.abs(values) <= _GREATEST).all():
            raise DatasetError(f"{path}:{number}: field {name!r} must be {shape[0] * shape[1]} numbers")
        return values.reshape(shape)
    raise DatasetError(f"{path}: no line {names[0]!r}, which is needed")


def _camera_poses(path: Path) -> FloatArray:
    """(F, 4, 4) poses of the camera from rows of 3 x 4 matrices."""
    table = read_table(path, _POSE_COLUMNS)
    table.require_finite(*_POSE_COLUMNS)
    values = table.stacked(*_POSE_COLUMNS).reshape(-1, 3, 4)
    # rounded matrices are no exact rotations; the nearest ones are, and their inverses are their transposes
    left, _, right = np.linalg.svd(values[:, :, :3])
    rotation = left @ right
    off = np.abs(rotation - values[:, :, :3]).max(axis=(1, 2), initial=0.0)
    good = (off < MAX_ROTATION_ERROR) & (np.linalg.det(rotation) > 0.0)
    table.require(good, "xx", "is no part of a rotation")
    return rigid(rotation, values[:, :, 3])


def _recorded_poses(path: Path, calibration: Path) -> FloatArray:
    """(F, 4, 4) poses of the camera in the first one's frame, from GPS and IMU."""
    table = read_table(path, _OXTS_COLUMNS)
    table.require_finite(*_OXTS_USED)
    latitude, longitude, altitude, roll, pitch, yaw = (table[name] for name in _OXTS_USED)
    if not len(table):
        return np.zeros((0, 4, 4))
    scale = EARTH_RADIUS_M * np.cos(np.radians(latitude[0]))
    north = scale * np.log(np.tan(np.pi / 4 + np.radians(latitude) / 2))
    place = np.column_stack((scale * np.radians(longitude), north, altitude))
    place -= place[0]  # small numbers keep their digits
    rotation = turned_about(2, yaw) @ turned_about(1, pitch) @ turned_about(0, roll)
    world_from_imu = rigid(rotation, place)
    velo_from_imu = homogeneous(read_matrix(calibration, ("Tr_imu_velo", "Tr_imu_to_velo"), (3, 4)))
    camera_from_velo = homogeneous(read_matrix(calibration, ("Tr_velo_cam", "Tr_velo_to_cam"), (3, 4)))
    rectified = np.eye(4)
    rectified[:3, :3] = read_matrix(calibration, ("R_rect", "R0_rect"), (3, 3))
    pose = world_from_imu @ np.linalg.inv(rectified @ camera_from_velo @ velo_from_imu)
    return np.asarray(np.linalg.inv(pose[0]) @ pose)
