"""KITTI: coordinates against poses made by hand, files against KITTI's own, mistakes with file and line."""

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scenarios.errors import DatasetError
from scenarios.recorded.camera import from_camera, image_boxes, to_camera
from scenarios.recorded.dataset import Dataset, log_odds, probability
from scenarios.recorded.kitti import DETECTION_COLUMNS, read_kitti, read_tracks, tracking_text

POSE = "1 0 0 0 0 1 0 0 0 0 1 0\n"
REST = "0 0 0 0 0 1 1 1 1 1 1 1 1 1\n"
BOX = "{frame},{type},0,0,10,10,{score},1.5,1.6,4.0,{x},1.7,{z},{ry},0\n"


def detection(
    frame: int = 0, kind: int = 2, score: float = 5.0, x: float = 2.0, z: float = 10.0, ry: float = 0.0
) -> str:
    return BOX.format(frame=frame, type=kind, score=score, x=x, z=z, ry=ry)


def write(folder: Path, **files: str) -> Path:
    """Files by path, with `__` for a slash; all of sequence 0000."""
    for name, text in files.items():
        path = folder.joinpath(*name.split("__")) / "0000.txt"
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    return folder


def test_a_box_ahead_of_the_camera() -> None:
    """Camera x is to the right and z ahead; ry = -90 deg looks ahead, ry = 0 to the right."""
    boxes = np.array([[1.5, 1.6, 4.0, 2.0, 1.7, 10.0, -np.pi / 2], [1.5, 1.6, 4.0, -3.0, 1.7, 20.0, 0.0]])
    found = from_camera(np.zeros(2, dtype=np.int64), boxes, None)
    assert found.center_m == pytest.approx(np.array([[10.0, -2.0], [20.0, 3.0]]))
    assert found.yaw_rad == pytest.approx(np.array([0.0, -np.pi / 2]))
    assert found.size_m == pytest.approx(np.array([[4.0, 1.6]] * 2))
    assert found.bottom_m == pytest.approx(np.array([-1.7, -1.7]))


def test_a_pose_moves_and_turns_a_box() -> None:
    """The vehicle stands at (100, 50) and looks along y: 10 m ahead and 2 m to the right is (102, 60)."""
    pose = np.eye(4)[None].copy()
    pose[0, :2, :2] = [[0.0, -1.0], [1.0, 0.0]]
    pose[0, :3, 3] = (100.0, 50.0, 1.0)
    box = np.array([[1.5, 1.6, 4.0, 2.0, 1.7, 10.0, -np.pi / 2]])
    found = from_camera(np.zeros(1, dtype=np.int64), box, pose)
    assert found.center_m[0] == pytest.approx((102.0, 60.0))
    assert found.yaw_rad[0] == pytest.approx(np.pi / 2)
    assert found.bottom_m[0] == pytest.approx(-0.7)


def rotation(axis: tuple[float, float, float], angle: float) -> np.ndarray:
    unit = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0, -unit[2], unit[1]], [unit[2], 0, -unit[0]], [-unit[1], unit[0], 0]])
    turned: np.ndarray = np.eye(3) + np.sin(angle) * cross + (1 - np.cos(angle)) * cross @ cross
    return turned


@given(
    st.tuples(*[st.floats(-80, 80)] * 3),
    st.floats(-3.1, 3.1),
    st.floats(-3.1, 3.1),
    st.tuples(st.floats(-0.2, 0.2), st.floats(-0.2, 0.2), st.just(1.0)),
)
def test_camera_and_world_are_inverse(
    place: tuple[float, ...], ry: float, angle: float, axis: tuple[float, float, float]
) -> None:
    pose = np.eye(4)[None].copy()
    pose[0, :3, :3] = rotation(axis, angle)
    pose[0, :3, 3] = (300.0, -20.0, 4.0)
    box = np.array([[1.5, 1.6, 4.0, *place, ry]])
    again = to_camera(from_camera(np.zeros(1, dtype=np.int64), box, pose), pose)
    assert again == pytest.approx(box, abs=1e-9)


def test_projection_of_a_cube() -> None:
    """A cube of 2 m, its front 9 m ahead, its underside 1 m below the camera, f = 900 px."""
    matrix = np.array([[900.0, 0.0, 600.0, 0.0], [0.0, 900.0, 180.0, 0.0], [0.0, 0.0, 1.0, 0.0]])
    box = np.array([[2.0, 2.0, 2.0, 0.0, 1.0, 10.0, 0.0]])
    assert image_boxes(box, matrix)[0] == pytest.approx((500.0, 80.0, 700.0, 280.0))
    beside = np.array([[2.0, 2.0, 2.0, 50.0, 1.0, 10.0, 0.0]])
    left, _, right, _ = image_boxes(beside, matrix)[0]
    assert right <= left


def test_projection_equals_the_detector_s(kitti: Path) -> None:
    """AB3DMOT's files hold the image boxes of PointRCNN's detections, cut off at 1241 x 374 px."""
    rows = np.loadtxt(kitti / "detections" / "Car" / "0001.txt", delimiter=",")
    column = {name: k for k, name in enumerate(DETECTION_COLUMNS)}
    boxes = rows[:, [column[name] for name in ("h", "w", "l", "x", "y", "z", "ry")]]
    matrix = read_kitti(kitti).sequences[0].camera
    assert matrix is not None
    ours = image_boxes(boxes, matrix.projection)
    theirs = rows[:, [column[name] for name in ("x1", "y1", "x2", "y2")]]
    far = rows[:, column["z"]] > 5.0  # corners near the camera are cut differently
    assert np.percentile(np.abs(ours - theirs)[far], 99) < 1.1


def test_labelled_parked_cars_stand_still(kitti: Path) -> None:
    """Poses and axes fit: parked cars that the vehicle passes hardly move in the world within a second."""
    [sequence] = [s for s in read_kitti(kitti).sequences if s.name == "0001"]
    assert sequence.labels is not None
    cars = sequence.labels[sequence.labels.category == "car"]
    seen = from_camera(cars.frame, to_camera(cars, sequence.world_SE3_ego), None)

    def moved(center_m: np.ndarray) -> float:
        one = [center_m[cars.object_id == identity] for identity in np.unique(cars.object_id)]
        return float(np.median(np.concatenate([np.linalg.norm(c[10:] - c[:-10], axis=1) for c in one])))

    assert moved(cars.center_m) < 0.1 * moved(seen.center_m)
    assert moved(cars.center_m) < 0.6


def test_numbers_of_the_data_set(kitti: Path) -> None:
    data = read_kitti(kitti)
    assert data.frame_count == 2463
    assert [s.name for s in data.sequences] == ["0001", "0006", "0010", "0012", "0014", "0016", "0019"]
    assert sum(len(s.detections) for s in data.sequences) == 27296
    assert data.rejected == 0
    assert data.log_odds


def oxts(north_m: float, yaw: float, roll: float = 0.0) -> str:
    """A record at 49 degrees north, some metres farther to the north."""
    latitude = 49.0 + np.degrees(north_m / 6_378_137.0)
    return f"{latitude:.12f} 8.4 110.0 {roll} 0.0 {yaw} " + " ".join(["0"] * 24) + "\n"


CALIB = "P2: " + " ".join(["1"] * 12) + "\nR_rect 1 0 0 0 1 0 0 0 1\n"
CALIB += "Tr_velo_cam 0 -1 0 0 0 0 -1 0 1 0 0 -0.3\nTr_imu_velo 1 0 0 -0.8 0 1 0 0 0 0 1 0\n"


def test_poses_from_gps_and_imu(tmp_path: Path) -> None:
    """The vehicle drives 10 m to the north, then stands there and looks west.

    The lidar is 0.8 m ahead of the IMU and the camera 0.3 m ahead of the lidar: the turn about the IMU moves
    it by -1.1 m along its first direction and by 1.1 m to the left.
    """
    text = oxts(0.0, np.pi / 2) + oxts(10.0, np.pi / 2) + oxts(10.0, np.pi)
    data = read_kitti(write(tmp_path, detections__Car=detection(frame=2), oxts=text, calib=CALIB))
    [sequence] = data.sequences
    ego = sequence.ego_xy_yaw()
    assert ego[0] == pytest.approx((0.0, 0.0, 0.0), abs=1e-6)
    assert ego[1] == pytest.approx((10.0, 0.0, 0.0), abs=1e-3)
    assert ego[2] == pytest.approx((10.0 - 1.1, 1.1, np.pi / 2), abs=1e-3)


def test_text_round_trip(kitti: Path, tmp_path: Path) -> None:
    [sequence] = [s for s in read_kitti(kitti).sequences if s.name == "0014"]
    labels = sequence.labels
    assert labels is not None
    labels = labels[np.isin(labels.kind, ("Car", "Pedestrian", "Cyclist"))]
    (tmp_path / "0014.txt").write_text(tracking_text(sequence, labels))
    again = read_tracks(tmp_path / "0014.txt", len(sequence), sequence.world_SE3_ego)
    assert np.abs(again.center_m - labels.center_m).max() < 2e-6
    assert np.abs(again.yaw_rad - labels.yaw_rad).max() < 2e-6
    assert again.object_id.tolist() == labels.object_id.tolist()
    assert again.category.tolist() == labels.category.tolist()
    lines = (tmp_path / "0014.txt").read_text().splitlines()
    assert {len(line.split()) for line in lines} == {18}
    tall = np.array([float(line.split()[9]) - float(line.split()[7]) for line in lines])
    assert (tall > 0).all()  # real image boxes


def test_without_calibration_image_boxes_are_unknown(tmp_path: Path) -> None:
    [sequence] = read_kitti(write(tmp_path, detections__Car=detection())).sequences
    assert tracking_text(sequence, sequence.detections).split()[6:10] == ["-1.000000"] * 4


def test_without_poses_the_vehicle_s_frame_is_the_world(tmp_path: Path) -> None:
    data = read_kitti(write(tmp_path, detections__Car=detection(ry=-np.pi / 2) + detection(frame=3)))
    [sequence] = data.sequences
    assert sequence.world_SE3_ego is None
    assert any("no ego poses" in note for note in data.notes)
    assert len(sequence) == 4
    assert sequence.stamp_s == pytest.approx([0.0, 0.1, 0.2, 0.3])
    assert sequence.detections.center_m[0] == pytest.approx((10.0, -2.0))
    assert [len(frame) for frame in sequence.frames()] == [1, 0, 0, 1]


def test_own_frame_times(tmp_path: Path) -> None:
    write(tmp_path, detections__Car=detection() + detection(frame=2), times="0.0\n0.13\n0.2\n")
    [sequence] = read_kitti(tmp_path).sequences
    assert [frame.stamp_s for frame in sequence.frames()] == pytest.approx([0.0, 0.13, 0.2])


def test_kitti_text_as_detections(tmp_path: Path) -> None:
    line = "0 -1 Pedestrian 0 0 0 0 0 1 1 1.7 0.6 0.8 2.0 1.7 10.0 0.0 0.75\n"
    (tmp_path / "detections").mkdir()
    (tmp_path / "detections" / "0000.txt").write_text(line)
    data = read_kitti(tmp_path)
    assert not data.log_odds
    assert data.sequences[0].detections.category.tolist() == ["pedestrian"]
    assert data.sequences[0].detections.score.tolist() == [0.75]


@pytest.mark.parametrize(
    "bad",
    [{"x": np.nan}, {"z": np.inf}, {"score": np.nan}, {"ry": np.nan}],
)
def test_impossible_boxes_are_counted_and_left_out(tmp_path: Path, bad: dict[str, float]) -> None:
    data = read_kitti(write(tmp_path, detections__Car=detection() + detection(**bad) + detection(frame=1)))
    assert data.rejected == 1
    assert [len(frame) for frame in data.sequences[0].frames()] == [1, 1]


@pytest.mark.parametrize("size", ["0", "-1.5", "nan", "1e9"])
def test_impossible_sizes_are_left_out(tmp_path: Path, size: str) -> None:
    data = read_kitti(write(tmp_path, detections__Car=detection() + detection().replace("4.0", size)))
    assert (data.rejected, len(data.sequences[0].detections)) == (1, 1)


def test_columns_are_known_by_their_number(tmp_path: Path) -> None:
    """AB3DMOT's fields apart by spaces; KITTI's tracking text without its score."""
    [sequence] = read_kitti(write(tmp_path / "a", detections__Car=detection().replace(",", " "))).sequences
    assert (sequence.detections.kind.tolist(), len(sequence.detections)) == (["Car"], 1)
    labels = f"0 1 Car {REST}\n"
    [sequence] = read_kitti(write(tmp_path / "b", detections=labels)).sequences
    assert (sequence.detections.kind.tolist(), sequence.detections.score.tolist()) == (["Car"], [1.0])


def test_a_frame_number_that_would_fill_the_memory(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"Car/0000.txt:1: field 'frame' must be under 10000000"):
        read_kitti(write(tmp_path, detections__Car=detection(frame=10**12)))


CAR = "detections__Car"


@pytest.mark.parametrize(
    ("files", "message"),
    [
        ({CAR: detection() + "0,2,1\n"}, "Car/0000.txt:2: 3 fields, 15 expected"),
        ({CAR: detection() + detection().replace("4.0", "four")}, ":2: field 'l' is no number: 'four'"),
        ({CAR: detection(kind=9)}, r":1: field 'type' must be 1 \(Pedestrian\).*got 9"),
        ({CAR: detection(frame=-1)}, r":1: field 'frame' must lie in 0\.\."),
        ({CAR: "\n0.5" + detection()[1:]}, ":2: field 'frame' must be a whole number, got 0.5"),
        ({CAR: detection(frame=4), "ego_pose": POSE}, "sequence 0000 has 1 ego poses for 5 frames"),
        ({CAR: detection(), "ego_pose": "1 0 0\n"}, "ego_pose/0000.txt:1: 3 fields, 12 expected"),
        ({CAR: detection(), "oxts": "1 2\n"}, "oxts/0000.txt:1: 2 fields, 30 expected"),
        ({CAR: detection(), "ego_pose": POSE.replace("1", "2")}, ":1: field 'xx' is no part of a rotation"),
        ({CAR: detection(), "calib": "P0: 1 2\n"}, "calib/0000.txt: no line 'P2'"),
        ({CAR: detection(), "calib": "P2: 1 2\n"}, "calib/0000.txt:1: field 'P2' must be 12 numbers"),
        (
            {CAR: detection(), "label_02": f"0 1 Ship {REST}"},
            "field 'type' is no type of KITTI and not in classes.csv, got 'Ship'",
        ),
    ],
)
def test_mistakes_name_file_line_and_field(tmp_path: Path, files: dict[str, str], message: str) -> None:
    with pytest.raises(DatasetError, match=message) as caught:
        read_kitti(write(tmp_path, **files))
    assert "\n" not in str(caught.value)


def test_a_map_of_sequences_that_is_none(tmp_path: Path) -> None:
    (write(tmp_path, detections__Car=detection()) / "seqmap.txt").write_text("0000 empty x 3\n")
    with pytest.raises(DatasetError, match=r"seqmap.txt:1: expected 'name empty first_frame frames'"):
        read_kitti(tmp_path)


def test_labels_that_are_ignored(tmp_path: Path) -> None:
    """Vans, sitting people, cut off and largely hidden objects; regions without labels go to the camera."""
    row = "0 {id} {type} {cut} {hidden} 0 1 2 3 4 1.5 1.6 4.0 2.0 1.7 10.0 0.0\n"
    rows = [
        ("Car", 0, 0),
        ("Car", 0, 2),
        ("Van", 0, 0),
        ("Car", 1, 0),
        ("Car", 0, 3),
        ("Person_sitting", 0, 0),
    ]
    text = "".join(row.format(id=k, type=t, cut=c, hidden=h) for k, (t, c, h) in enumerate(rows))
    text += "0 -1 DontCare -1 -1 -10 1 2 3 4 -1000 -1000 -1000 -10 -1 -1 -1\n"
    calib = "P2: " + " ".join(["1"] * 12) + "\n"
    [sequence] = read_kitti(
        write(tmp_path, detections__Car=detection(), label_02=text, calib=calib)
    ).sequences
    assert sequence.labels is not None
    assert sequence.camera is not None
    assert sequence.labels.ignored.tolist() == [False, False, True, True, True, True]
    assert sequence.labels.category.tolist() == ["car"] * 5 + ["pedestrian"]
    assert sequence.camera.dont_care_px.tolist() == [[1.0, 2.0, 3.0, 4.0]]


def test_a_users_types_hold_for_detections_and_labels(tmp_path: Path) -> None:
    line = "0 {id} {kind} 0 0 0 0 0 40 40 1.5 1.6 4.0 {x} 1.7 20 0 {score}\n"
    kinds = ("Tram", "Wagon", "Misc")
    rows = [line.format(id=k, kind=kind, x=9 * k, score=0.5) for k, kind in enumerate(kinds)]
    folder = write(tmp_path, detections="".join(rows), label_02="".join(rows))
    (folder / "classes.csv").write_text("class,category\nTram,truck\nWagon,car\nMisc,\n")
    [sequence] = read_kitti(folder).sequences
    assert sequence.labels is not None
    for found in (sequence.detections, sequence.labels):
        assert found.category.tolist() == ["truck", "car"]
        assert found.kind.tolist() == ["Tram", "Wagon"]


@given(st.floats(-20, 20))
def test_log_odds_and_probability_are_inverse(value: float) -> None:
    assert log_odds(probability(np.array([value]))) == pytest.approx([value], abs=1e-5)


def test_scores_become_probabilities_for_the_whole_data_set(tmp_path: Path) -> None:
    data = read_kitti(write(tmp_path, detections__Car=detection(score=0.0) + detection(score=-3.0)))
    assert data.log_odds
    assert data.sequences[0].detections.score == pytest.approx([0.5, 1.0 / (1.0 + np.exp(3.0))])


def test_reading_keeps_what_it_was_given(kitti: Path) -> None:
    data: Dataset = read_kitti(kitti)
    sequence: Any = data.sequences[3]
    frames = list(sequence.frames())
    assert sum(map(len, frames)) == len(sequence.detections)
    assert replace(sequence, name="x").name == "x"
