"""KITTI's camera frame, the world frame, and the image.

The camera's frame is x right, y down, z ahead; a box is h w l x y z ry with its origin in the middle of its
underside, and ry turns about y. The vehicle's frame is the camera's with other axes: x ahead, y left, z up.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

import _smartmot
from scenarios.recorded.dataset import Objects
from scenarios.recorded.poses import heading, moved
from smartmot.geometry import wrap_angle
from smartmot.types import FloatArray, IntArray

IMAGE_PX = (1242.0, 375.0)
"""Width and height of KITTI's images; the evaluation takes one size for all sequences."""

EGO_R_CAMERA = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
"""Rotation from the camera's axes to the vehicle's."""

_MIN_DEPTH_M = 0.1
"""Nearer corners have no place in the image: they are taken to be this far ahead of the camera."""


def from_camera(
    frame: IntArray,
    boxes: FloatArray,
    world_SE3_ego: FloatArray | None,
    **columns: NDArray[Any],
) -> Objects:
    """Boxes of the camera's frame in the world frame.

    Roll and pitch move the centre but do not tilt the box: boxes stand upright in both frames.

    Args:
        frame: (K,) frames.
        boxes: (K, 7) h w l x y z ry, camera frame.
        world_SE3_ego: (F, 4, 4) poses, or None: the vehicle's own frame is the world.
        columns: Further fields of `Objects`.
    """
    h, w, l, _, _, _, ry = boxes.T  # noqa: E741 - KITTI's names
    with np.errstate(invalid="ignore", over="ignore"):  # boxes that are not finite are rejected later
        point = boxes[:, 3:6] @ EGO_R_CAMERA.T
        # ry turns from the camera's x, to the right, about y, down: ry = -90 deg looks ahead
        yaw = wrap_angle(-ry - 0.5 * np.pi)
        if world_SE3_ego is not None:
            pose = world_SE3_ego[frame]
            point = moved(pose, point)
            yaw = wrap_angle(yaw + heading(pose))
    return Objects.of(
        frame,
        point[:, :2],
        size_m=np.column_stack((l, w)),
        yaw_rad=yaw,
        bottom_m=point[:, 2],
        height_m=h,
        **columns,
    )


def to_camera(objects: Objects, world_SE3_ego: FloatArray | None) -> FloatArray:
    """(K, 7) boxes h w l x y z ry in the camera's frame: the inverse of `from_camera`."""
    point = np.column_stack((objects.center_m, objects.bottom_m))
    yaw = objects.yaw_rad
    if world_SE3_ego is not None:
        pose = world_SE3_ego[objects.frame]
        point = np.einsum("kji,kj->ki", pose[:, :3, :3], point - pose[:, :3, 3])
        yaw = yaw - heading(pose)
    ry = wrap_angle(-yaw - 0.5 * np.pi)
    length, width = objects.size_m.T
    return np.column_stack((objects.height_m, width, length, point @ EGO_R_CAMERA, ry))


def camera_corners(boxes: FloatArray) -> FloatArray:
    """(K, 4, 2) corners of (K, 7) camera boxes on the ground plane (x right, z ahead)."""
    along, across = (
        boxes[:, None, 2] * np.array([1, 1, -1, -1]) / 2,
        boxes[:, None, 1] * np.array([1, -1, -1, 1]) / 2,
    )
    c, s = np.cos(boxes[:, 6])[:, None], np.sin(boxes[:, 6])[:, None]
    return np.stack(
        (boxes[:, 3, None] + c * along + s * across, boxes[:, 5, None] - s * along + c * across), axis=-1
    )


def image_boxes(boxes: FloatArray, projection: FloatArray) -> FloatArray:
    """Bounding boxes in the image, cut off at its border.

    Args:
        boxes: (K, 7) h w l x y z ry, camera frame.
        projection: (3, 4) matrix P2.

    Returns:
        (K, 4) left, top, right, bottom in pixels; without extent for a box outside the image.
    """
    low, high = _image_bounds(boxes, projection)
    border = np.array(IMAGE_PX)
    return np.column_stack((np.clip(low, 0.0, border), np.clip(high, 0.0, border)))


def truncation(boxes: FloatArray, projection: FloatArray) -> FloatArray:
    """(K,) shares of boxes outside the image, by area; 1 for those whose middle is behind the camera.

    Args:
        boxes: (K, 7) h w l x y z ry, camera frame.
        projection: (3, 4) matrix P2.
    """
    low, high = _image_bounds(boxes, projection)
    inside = np.clip(high, 0.0, IMAGE_PX) - np.clip(low, 0.0, IMAGE_PX)
    share = 1.0 - inside.prod(axis=1) / np.maximum((high - low).prod(axis=1), 1e-9)
    return np.where(boxes[:, 5] > _MIN_DEPTH_M, share.clip(0.0, 1.0), 1.0)


def _image_bounds(boxes: FloatArray, projection: FloatArray) -> tuple[FloatArray, FloatArray]:
    """(K, 2) left, top and (K, 2) right, bottom of boxes, wherever the image ends."""
    ground = camera_corners(boxes)
    bottom, height = boxes[:, 4], boxes[:, 0]
    levels = np.stack((bottom, bottom - height), axis=1)
    points = np.empty((len(boxes), 2, 4, 3))
    points[..., 0] = ground[:, None, :, 0]
    points[..., 1] = levels[:, :, None]
    # what is behind the camera is moved just in front of it, to a far border of the image
    points[..., 2] = np.maximum(ground[:, None, :, 1], _MIN_DEPTH_M)
    pixel = points.reshape(len(boxes), 8, 3) @ projection[:, :3].T + projection[:, 3]
    uv = pixel[..., :2] / pixel[..., 2:]
    return uv.min(axis=1, initial=np.inf), uv.max(axis=1, initial=-np.inf)


__getattr__ = _smartmot.renamed(__name__, {"wrapped": "smartmot.geometry.wrap_angle"})
