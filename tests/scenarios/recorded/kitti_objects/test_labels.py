from pathlib import Path

import numpy as np
import pytest

from scenarios.errors import DatasetError
from scenarios.recorded.kitti_objects.calibration import Calibration
from scenarios.recorded.kitti_objects.labels import object_text, read_objects
from smartmot.pointcloud import Boxes3D

AHEAD = np.array([[0.0, -1.0, 0.0, 0.0], [0.0, 0.0, -1.0, 0.0], [1.0, 0.0, 0.0, 0.0]])
P2 = np.array([[700.0, 0.0, 600.0, 0.0], [0.0, 700.0, 180.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
FRAMES = Calibration(np.stack([P2] * 4), np.eye(3), AHEAD)

LABEL = "Car 0.10 1 -1.50 500 150 600 250 1.5 1.6 3.9 1.0 1.7 10.0 -1.40"


def write(folder: Path, *lines: str, name: str = "000007.txt") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text("".join(f"{line}\n" for line in lines))
    return path


def test_labels_and_results_are_read(tmp_path: Path) -> None:
    write(tmp_path, LABEL, "DontCare -1 -1 -10 0 0 10 10 -1 -1 -1 -1000 -1000 -1000 -10")
    write(tmp_path, name="000008.txt")
    lines = read_objects(tmp_path)
    assert lines.frames == ("000007", "000008")
    assert lines.frame.tolist() == ["000007", "000007"]
    assert lines.camera_box[0].tolist() == [1.5, 1.6, 3.9, 1.0, 1.7, 10.0, -1.4]
    assert (lines.truncated[0], lines.occluded[0], lines.score[0]) == (0.1, 1.0, 1.0)
    (result,) = read_objects(write(tmp_path / "r", f"{LABEL} -2.5")).score
    assert result == -2.5


def test_frames_of_sequences_and_of_ab3dmot_have_the_same_names(tmp_path: Path) -> None:
    tracking = read_objects(write(tmp_path / "label_02", f"12 3 {LABEL}", name="0004.txt"))
    detection = "12,2,500,150,600,250,7.5,1.5,1.6,3.9,1.0,1.7,10.0,-1.4,-1.5"
    write(tmp_path / "detections" / "Car", detection, name="0004.txt")
    write(tmp_path / "detections" / "Cyclist", detection.replace(",2,", ",3,", 1), name="0004.txt")
    detections = read_objects(tmp_path / "detections")
    assert set(tracking.frames) == set(detections.frames) == {"0004/000012"}
    assert detections.type_name.tolist() == ["Car", "Cyclist"]
    np.testing.assert_array_equal(detections.camera_box[0], tracking.camera_box[0])
    assert read_objects(write(tmp_path / "by_class", detection, name="Car.txt")).frames == ("/000012",)


def test_an_empty_file_beside_sequences_is_no_frame(tmp_path: Path) -> None:
    write(tmp_path, "12,2,500,150,600,250,7.5,1.5,1.6,3.9,1.0,1.7,10.0,-1.4,-1.5", name="Car.txt")
    write(tmp_path, name="Pedestrian.txt")
    assert read_objects(tmp_path).frames == ("/000012",)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("Car 0 0", r"000007.txt:1: 3 fields, 16 expected"),
        (LABEL.replace("1.5 1.6", "0 1.6"), r"000007.txt:1: field 'h' must be positive"),
        (LABEL.replace("10.0", "nan"), r"field 'z' must be finite"),
        (LABEL.replace("10.0", "far"), r"field 'z' is no number: 'far'"),
        ("0,9,1,1,2,2,1,1,1,1,1,1,1,1,1", r"field 'type' must be 1, 2, 3"),
        (f"-1 0 {LABEL}", r"field 'frame' must not be negative"),
    ],
)
def test_damaged_lines_are_named(tmp_path: Path, line: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        read_objects(write(tmp_path, line))


def test_an_empty_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="no file"):
        read_objects(tmp_path)


def test_written_lines_come_back_with_alpha_and_image_box(tmp_path: Path) -> None:
    # 9 to 11 m ahead, 1 m to either side, 0.5 to 1.5 m below the camera
    centers, sizes = [[10.0, 0.0, -1.0], [8.0, 6.0, -1.0]], [[2.0, 2.0, 1.0], [4.0, 1.6, 1.5]]
    boxes = Boxes3D(centers, sizes, [0.0, 0.3])  # type: ignore[arg-type]
    text = object_text(boxes, ["Car", "Cyclist"], FRAMES, np.array([0.25, 0.5]))
    lines = read_objects(write(tmp_path, *text.splitlines()))
    near = [600 - 700 / 9, 180 + 700 * 0.5 / 11, 600 + 700 / 9, 180 + 700 * 1.5 / 9]
    np.testing.assert_allclose(lines.image_box_px[0], near, atol=1e-9)
    # straight ahead alpha is ry; 6 m left at 8 m the camera looks atan(6/8) to the left
    assert lines.alpha_rad[0] == pytest.approx(-np.pi / 2)
    assert lines.alpha_rad[1] == pytest.approx(-np.pi / 2 - 0.3 + np.arctan2(6, 8))
    back = FRAMES.boxes_to_lidar(lines.camera_box)
    np.testing.assert_allclose(back.center_m, boxes.center_m, atol=1e-12)
    np.testing.assert_allclose(back.yaw_rad, boxes.yaw_rad, atol=1e-12)
    assert lines.score.tolist() == [0.25, 0.5]


def test_image_boxes_end_at_the_border() -> None:
    beside = Boxes3D([[3.0, 2.0, -1.0]], [[4.0, 1.8, 1.5]], [0.0])  # type: ignore[arg-type]
    text = object_text(beside, ["Car"], FRAMES, truncated=np.array([0.4]), occluded=np.array([1.0]))
    fields = text.split()
    assert fields[:3] == ["Car", "0.4", "1"]
    assert len(fields) == 15
    left, top, right, bottom = map(float, fields[4:8])
    assert (left, bottom) == (0.0, 375.0)
    assert 0 < top < bottom
    assert left < right < 600


def test_without_boxes_there_are_no_lines() -> None:
    assert object_text(Boxes3D.empty(), [], FRAMES) == ""
