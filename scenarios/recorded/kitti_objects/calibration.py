"""Calibration files of KITTI, and boxes between the rectified camera's frame and the LiDAR's.

Source: Geiger, Lenz, Stiller, Urtasun, "Vision meets robotics: The KITTI dataset", 2013; readme.txt of the
object and tracking development kits. y = P2 R0_rect Tr_velo_to_cam x.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from scenarios.errors import DatasetError
from scenarios.recorded.kitti_poses import MAX_ROTATION_ERROR, read_matrix
from scenarios.recorded.textfile import read_text
from smartmot.geometry import wrap_angle
from smartmot.pointcloud import Boxes3D
from smartmot.types import FloatArray, frozen

_PROJECTIONS = ("P0", "P1", "P2", "P3")


@dataclass(frozen=True, slots=True, eq=False)
class Calibration:
    """Projections of the four cameras, and where the LiDAR is.

    Args:
        projection: (4, 3, 4) P0 to P3, rectified camera frame to pixels.
        rectification: (3, 3) R0_rect.
        camera_from_lidar: (3, 4) Tr_velo_to_cam.
        lidar_from_imu: (3, 4) Tr_imu_to_velo; None: the file has none.

    Raises:
        ShapeError: a matrix has another shape.
        DatasetError: the camera looks along the LiDAR's z, so that headings have no counterpart, or the
            transform cannot be inverted.
    """

    projection: FloatArray
    rectification: FloatArray
    camera_from_lidar: FloatArray
    lidar_from_imu: FloatArray | None = None

    def __post_init__(self) -> None:
        shapes = {
            "projection": (4, 3, 4),
            "rectification": (3, 3),
            "camera_from_lidar": (3, 4),
            "lidar_from_imu": (3, 4),
        }
        for name, shape in shapes.items():
            if name == "lidar_from_imu" and self.lidar_from_imu is None:
                continue
            object.__setattr__(self, name, frozen(getattr(self, name), np.float64, shape, name))
        if abs(np.linalg.det(self.rect_from_lidar)) < 0.5 or abs(np.linalg.det(self._turn)) < 0.1:
            raise DatasetError("calibration: R0_rect and Tr_velo_to_cam make no camera that looks ahead")

    @property
    def rect_from_lidar(self) -> FloatArray:
        """(3, 3) rotation from the LiDAR's axes to the rectified camera's."""
        return self.rectification @ self.camera_from_lidar[:, :3]

    @property
    def _turn(self) -> FloatArray:
        """(2, 2) from directions x, z of the camera to directions x, y of the LiDAR, heights left out."""
        return np.asarray(np.linalg.inv(self.rect_from_lidar)[:2][:, (0, 2)], dtype=np.float64)

    def to_camera(self, points_m: FloatArray) -> FloatArray:
        """(..., 3) points of the LiDAR's frame in the rectified camera's."""
        return points_m @ self.rect_from_lidar.T + self.rectification @ self.camera_from_lidar[:, 3]

    def to_lidar(self, points_m: FloatArray) -> FloatArray:
        """(..., 3) points of the rectified camera's frame in the LiDAR's: the inverse of `to_camera`."""
        shifted = points_m - self.rectification @ self.camera_from_lidar[:, 3]
        return shifted @ np.linalg.inv(self.rect_from_lidar).T

    def boxes_to_lidar(self, camera_boxes: FloatArray) -> Boxes3D:
        """Boxes of label files in the LiDAR's frame.

        The middle of a box is the same point in both frames. A box stands upright in each; its heading is
        taken over from above, so that the way back is exact although the frames are tilted by 0.5 degrees.

        Args:
            camera_boxes: (K, 7) h w l x y z ry; x y z is the middle of the underside, y down, ry about y.

        Raises:
            ShapeError: a value is not finite or a size is not positive.
        """
        h, w, l, x, y, z, ry = camera_boxes.T  # noqa: E741 - KITTI's names
        center = self.to_lidar(np.column_stack((x, y - 0.5 * h, z)))
        # ry = 0 looks along x, ry = -90 deg along z
        along = np.column_stack((np.cos(ry), -np.sin(ry))) @ self._turn.T
        return Boxes3D(center, np.column_stack((l, w, h)), np.arctan2(along[:, 1], along[:, 0]))

    def boxes_to_camera(self, boxes: Boxes3D) -> FloatArray:
        """(K, 7) h w l x y z ry of boxes of the LiDAR's frame: the inverse of `boxes_to_lidar`."""
        center = self.to_camera(boxes.center_m)
        length, width, height = boxes.size_m.T
        heading = np.column_stack((np.cos(boxes.yaw_rad), np.sin(boxes.yaw_rad)))
        along = heading @ np.linalg.inv(self._turn).T
        ry = wrap_angle(np.arctan2(-along[:, 1], along[:, 0]))
        bottom = center[:, 1] + 0.5 * height
        return np.column_stack((height, width, length, center[:, 0], bottom, center[:, 2], ry))


def read_calibration(path: Path) -> Calibration:
    """Read a calibration file of KITTI's object or tracking data.

    Raises:
        DatasetError: a matrix is missing or wrong; the message names file and field.
    """
    left_color = read_matrix(path, ("P2",), (3, 4))
    others = {name: _matrix(path, (name,), (3, 4)) for name in _PROJECTIONS}
    # files with the left colour camera alone have P2 only
    projection = np.stack([left_color if matrix is None else matrix for matrix in others.values()])
    rotation = read_matrix(path, ("R0_rect", "R_rect"), (3, 3))
    transform = read_matrix(path, ("Tr_velo_to_cam", "Tr_velo_cam"), (3, 4))
    for name, matrix in (("R0_rect", rotation), ("Tr_velo_to_cam", transform[:, :3])):
        if np.abs(matrix @ matrix.T - np.eye(3)).max() > MAX_ROTATION_ERROR or np.linalg.det(matrix) < 0.0:
            raise DatasetError(f"{path}: field {name!r} is no rotation")
    imu = _matrix(path, ("Tr_imu_to_velo", "Tr_imu_velo"), (3, 4))
    try:
        return Calibration(projection, rotation, transform, imu)
    except DatasetError as error:
        raise DatasetError(f"{path}: {error}") from None


def _matrix(path: Path, names: tuple[str, ...], shape: tuple[int, int]) -> FloatArray | None:
    """A matrix that files may leave out."""
    lines = (line.replace(":", " ", 1).split() for line in read_text(path).splitlines())
    there = any(words and words[0] in names for words in lines)
    return read_matrix(path, names, shape) if there else None


def calibration_text(calibration: Calibration) -> str:
    """The file of a calibration, with all digits."""
    rows = dict(zip(_PROJECTIONS, calibration.projection, strict=True))
    rows |= {
        "R0_rect": calibration.rectification,
        "Tr_velo_to_cam": calibration.camera_from_lidar,
    }
    if calibration.lidar_from_imu is not None:
        rows["Tr_imu_to_velo"] = calibration.lidar_from_imu
    lines = (f"{name}: {' '.join(f'{v:.17g}' for v in matrix.ravel())}\n" for name, matrix in rows.items())
    return "".join(lines)
