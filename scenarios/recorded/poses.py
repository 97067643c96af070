"""Rigid transforms of vehicles: poses from angles, quaternions and places, and points moved by them."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from smartmot.types import FloatArray


def rigid(rotation: FloatArray, place_m: FloatArray) -> FloatArray:
    """(F, 4, 4) transforms from (F, 3, 3) rotations and (F, 3) places."""
    pose = np.tile(np.eye(4), (len(rotation), 1, 1))
    pose[:, :3, :3], pose[:, :3, 3] = rotation, place_m
    return pose


def homogeneous(matrix: FloatArray) -> FloatArray:
    """(4, 4) from (3, 4)."""
    return np.vstack((matrix, (0.0, 0.0, 0.0, 1.0)))


def turned_about(axis: int, angle_rad: FloatArray) -> FloatArray:
    """(F, 3, 3) rotations about x, y or z."""
    rotation = np.tile(np.eye(3), (len(angle_rad), 1, 1))
    i, j = (axis + 1) % 3, (axis + 2) % 3
    rotation[:, i, i] = rotation[:, j, j] = np.cos(angle_rad)
    rotation[:, j, i] = np.sin(angle_rad)
    rotation[:, i, j] = -np.sin(angle_rad)
    return rotation


def unit_quaternion(quaternion: FloatArray) -> FloatArray:
    """(..., 4) quaternions of length 1; NaN for those of length 0."""
    # the squares of great and of small numbers are no floats
    scaled = quaternion / np.abs(quaternion).max(axis=-1, keepdims=True)
    unit: FloatArray = scaled / np.linalg.norm(scaled, axis=-1, keepdims=True)
    return unit


def quaternion_yaw(quaternion: FloatArray) -> FloatArray:
    """(K,) headings of (K, 4) quaternions w, x, y, z; NaN for those of length 0."""
    with np.errstate(invalid="ignore", divide="ignore"):
        w, x, y, z = unit_quaternion(quaternion).T
    yaw: FloatArray = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    return yaw


def rotation_matrix(quaternion: FloatArray) -> FloatArray:
    """(3, 3) matrix of a quaternion w, x, y, z of any length but 0."""
    w, x, y, z = unit_quaternion(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def heading(pose: FloatArray) -> FloatArray:
    """(K,) yaw of (K, 4, 4) poses."""
    return np.arctan2(pose[:, 1, 0], pose[:, 0, 0])


def turned(pose: FloatArray, vector: FloatArray) -> FloatArray:
    """(K, D) vectors of the vehicle's frame along the world's axes; D = 2 leaves the height out."""
    size = vector.shape[1]
    along: FloatArray = np.einsum("kij,kj->ki", pose[:, :size, :size], vector)
    return along


def moved(pose: FloatArray, point_m: FloatArray) -> FloatArray:
    """(K, D) points of the vehicle's frame in the world; D = 2 leaves the height out."""
    return turned(pose, point_m) + pose[:, : point_m.shape[1], 3]


def interpolated(time_s: FloatArray, rotation: Rotation, place_m: FloatArray, at_s: FloatArray) -> FloatArray:
    """(F, 4, 4) poses between given ones: rotations turn at constant rate about one axis, places move evenly.

    Args:
        time_s: (P,) times of the poses, ascending.
        rotation: P rotations.
        place_m: (P, 3) places.
        at_s: (F,) times, none before the first pose or after the last.
    """
    if len(time_s) == 1:  # Slerp wants two
        return rigid(np.tile(rotation.as_matrix(), (len(at_s), 1, 1)), np.tile(place_m, (len(at_s), 1)))
    place = np.column_stack([np.interp(at_s, time_s, column) for column in place_m.T])
    return rigid(Slerp(time_s, rotation)(at_s).as_matrix(), place)
