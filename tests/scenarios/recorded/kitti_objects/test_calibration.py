from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from scenarios.errors import DatasetError
from scenarios.recorded.clouds.files import read_cloud
from scenarios.recorded.kitti_objects.calibration import Calibration, calibration_text, read_calibration
from scenarios.recorded.kitti_objects.labels import read_objects
from smartmot.pointcloud import Boxes3D

CAMERA_FROM_LIDAR = np.array([[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]])
P2 = np.array([[721.5, 0.0, 609.6, 44.9], [0.0, 721.5, 172.9, 0.2], [0.0, 0.0, 1.0, 0.003]])
SHARED = Path(__file__).parents[4].parent / "shared" / "lidar" / "kitti_object" / "training"


def calibration(
    tilt_deg: tuple[float, float, float] = (0, 0, 0), shift: tuple[float, ...] = (0, 0, 0)
) -> Calibration:
    turn = Rotation.from_euler("xyz", tilt_deg, degrees=True).as_matrix() @ CAMERA_FROM_LIDAR
    rectify = (
        Rotation.from_euler("xyz", (0.5, -0.4, 0.3), degrees=True).as_matrix() if any(tilt_deg) else np.eye(3)
    )
    return Calibration(np.stack([P2] * 4), rectify, np.column_stack((turn, shift)))


def test_axes_bottom_and_heading_by_hand() -> None:
    # 4 m ahead of the LiDAR, 1 m to the left, heading left: in the camera x = -1, z = 4, ry = pi
    boxes = Boxes3D([[4.0, 1.0, -0.9]], [[3.9, 1.6, 1.5]], [np.pi / 2])  # type: ignore[arg-type]
    (row,) = calibration().boxes_to_camera(boxes)
    np.testing.assert_allclose(row[:6], [1.5, 1.6, 3.9, -1.0, 0.9 + 0.75, 4.0], atol=1e-12)
    assert np.cos(row[6]) == pytest.approx(-1.0)
    ahead = Boxes3D([[4.0, 0.0, 0.0]], [[3.9, 1.6, 1.5]], [0.0])  # type: ignore[arg-type]
    assert calibration().boxes_to_camera(ahead)[0, 6] == pytest.approx(-np.pi / 2)


@settings(max_examples=50, deadline=None)
@given(st.tuples(*[st.floats(-30, 30)] * 3), st.tuples(*[st.floats(-2, 2)] * 3), st.integers(0, 10_000))
def test_the_way_to_the_camera_and_back_is_exact(
    tilt_deg: tuple[float, float, float], shift: tuple[float, ...], seed: int
) -> None:
    rng = np.random.default_rng(seed)
    boxes = Boxes3D(rng.uniform(-80, 80, (9, 3)), rng.uniform(0.2, 12, (9, 3)), rng.uniform(-3.1, 3.1, 9))
    frames = calibration(tilt_deg, shift)
    back = frames.boxes_to_lidar(frames.boxes_to_camera(boxes))
    for name in ("center_m", "size_m", "yaw_rad"):
        np.testing.assert_allclose(getattr(back, name), getattr(boxes, name), atol=1e-9)


def test_a_lidar_that_is_turned_in_its_mount_turns_the_headings() -> None:
    turned = Rotation.from_euler("z", 90, degrees=True).as_matrix()  # its x is the car's left
    frames = Calibration(
        np.stack([P2] * 4), np.eye(3), np.column_stack((CAMERA_FROM_LIDAR @ turned, np.zeros(3)))
    )
    camera_box = np.array([[1.5, 1.6, 3.9, 0.0, 1.0, 10.0, -np.pi / 2]])  # ahead, driving away
    boxes = frames.boxes_to_lidar(camera_box)
    np.testing.assert_allclose(boxes.center_m[0, :2], [0.0, -10.0], atol=1e-12)
    assert boxes.yaw_rad[0] == pytest.approx(-np.pi / 2)


def test_written_files_are_read_as_they_were(tmp_path: Path) -> None:
    path = tmp_path / "000000.txt"
    frames = calibration((1.0, 2.0, 3.0), (0.1, 0.2, 0.3))
    path.write_text(calibration_text(frames))
    back = read_calibration(path)
    for name in ("projection", "rectification", "camera_from_lidar"):
        np.testing.assert_array_equal(getattr(back, name), getattr(frames, name))
    assert back.lidar_from_imu is None


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("P2:", "P9:", "no line 'P2'"),
        ("R0_rect: 1", "R0_rect: 2", "'R0_rect' is no rotation"),
        ("Tr_velo_to_cam: 0", "Tr_velo_to_cam: nan", "'Tr_velo_to_cam' must be 12 numbers"),
        ("R0_rect: 1 0", "R0_rect: 1", "'R0_rect' must be 9 numbers"),
    ],
)
def test_damaged_files_are_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    path = tmp_path / "000000.txt"
    text = calibration_text(calibration()).replace("-0 ", "0 ")
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises(DatasetError, match=message):
        read_calibration(path)


def test_a_camera_that_looks_up_is_refused() -> None:
    up = Rotation.from_euler("x", 90, degrees=True).as_matrix() @ CAMERA_FROM_LIDAR
    with pytest.raises(DatasetError, match="ahead"):
        Calibration(np.stack([P2] * 4), np.eye(3), np.column_stack((up, np.zeros(3))))


def test_boxes_of_real_labels_hold_the_points_of_their_objects() -> None:
    if not SHARED.is_dir():
        pytest.skip("KITTI clouds are not in ../shared/lidar")
    for frame in ("000003", "000134"):
        frames = read_calibration(SHARED / "calib" / f"{frame}.txt")
        labels = read_objects(SHARED / "label_2" / f"{frame}.txt")
        near = labels.chosen((labels.type_name != "DontCare") & (labels.camera_box[:, 5] < 30))
        boxes = frames.boxes_to_lidar(near.camera_box)
        assert len(boxes)
        counts = boxes.point_counts(read_cloud(SHARED / "velodyne" / f"{frame}.bin").cloud.xyz_m)
        assert counts.min() >= 1
        assert np.median(counts) >= 40
        # the mounts of KITTI's car are parallel but for a degree: peers write -ry - 90 degrees
        difference = np.angle(np.exp(1j * (boxes.yaw_rad + near.camera_box[:, 6] + np.pi / 2)))
        assert np.abs(difference).max() < 2e-3
