"""CSV in and out."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.studies.mot.run import track_dataset
from evaluation.studies.mot.tables import write_tracks
from scenarios.errors import DatasetError
from scenarios.recorded.csv_files import read_csv
from scenarios.recorded.formats import read_dataset
from smartmot.tracking.configs import tracker_config
from smartmot.tracking.tracker import TrackerConfig

HEADER = "sequence,stamp_s,x_m,y_m,length_m,width_m,yaw_rad,score,category\n"


def row(sequence: str, stamp_s: object, x_m: object, category: str = "car", score: object = 0.9) -> str:
    return f"{sequence},{stamp_s},{x_m},0.0,4.0,2.0,0.1,{score},{category}\n"


def write(folder: Path, detections: str, **others: str) -> Path:
    (folder / "detections.csv").write_text(detections)
    for name, text in others.items():
        (folder / f"{name}.csv").write_text(text)
    return folder


def test_sequences_frames_and_times(tmp_path: Path) -> None:
    text = (
        HEADER
        + row("b", 5.0, 1.0)
        + row("b", 5.0, 9.0)
        + row("b", 5.07, 2.0)
        + row("a", 1.0, 3.0, "pedestrian")
    )
    data = read_csv(write(tmp_path, text))
    first, second = data.sequences
    assert (first.name, second.name) == ("b", "a")
    assert first.stamp_s.tolist() == [5.0, 5.07]
    assert [len(frame) for frame in first.frames()] == [2, 1]
    assert second.detections.category.tolist() == ["pedestrian"]
    assert not data.log_odds


def test_columns_in_any_order_with_velocity(tmp_path: Path) -> None:
    text = "yaw_rad,width_m,length_m,y_m,x_m,frame,vy_mps,vx_mps,note,height_m,z_m\n"
    text += "0.5,2,4,7,6,3,0.5,1.5,seen twice,1.6,0.8\n"
    data = read_csv(write(tmp_path, text))
    [sequence] = data.sequences
    assert sequence.stamp_s == pytest.approx([0.3])
    [frame] = sequence.frames()
    assert frame.boxes.center_m.tolist() == [[6.0, 7.0]]
    assert frame.velocity_mps is not None
    assert frame.velocity_mps.tolist() == [[1.5, 0.5]]
    assert frame.category.tolist() == ["unknown"]
    assert sequence.detections.bottom_m.tolist() == [0.0]
    assert any("0.1 s apart" in note for note in data.notes)


def test_labels_add_frames_without_detections(tmp_path: Path) -> None:
    labels = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad,track_id,category,ignored\n"
    labels += "".join(f"{t},1,0,4,2,0,8,car,{int(t > 0.15)}\n" for t in (0.0, 0.1, 0.2))
    text = "stamp_s,x_m,y_m,length_m,width_m,yaw_rad\n0.0,1,0,4,2,0\n0.2,1,0,4,2,0\n"
    [sequence] = read_csv(write(tmp_path, text, labels=labels)).sequences
    assert sequence.stamp_s.tolist() == [0.0, 0.1, 0.2]
    assert [len(frame) for frame in sequence.frames()] == [1, 0, 1]
    assert sequence.labels is not None
    assert sequence.labels.object_id.tolist() == [8, 8, 8]
    assert sequence.labels.ignored.tolist() == [False, False, True]


def test_ego_poses_between_given_times(tmp_path: Path) -> None:
    ego = "sequence,stamp_s,x_m,y_m,yaw_rad\ns,0.0,0,0,3.1\ns,1.0,10,2,-3.1\n"
    text = HEADER + row("s", 0.0, 1.0) + row("s", 0.5, 1.0)
    [sequence] = read_csv(write(tmp_path, text, ego=ego)).sequences
    x, y, yaw = sequence.ego_xy_yaw()[1]
    assert (x, y) == pytest.approx((5.0, 1.0))
    assert np.cos(yaw) == pytest.approx(-1.0)  # the short way from 3.1 to -3.1


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"detections.csv:1: empty; the first line must name the columns"),
        ("stamp_s,x_m\n0,1\n", r"detections.csv:1: columns missing: length_m, width_m, yaw_rad"),
        ("x_m,y_m,length_m,width_m,yaw_rad\n1,1,1,1,1\n", r":1: a column 'stamp_s' or 'frame' is needed"),
        (HEADER + row("s", 0.0, "one"), r":2: field 'x_m' is no number: 'one'"),
        (HEADER + row("s", 0.0, 1.0) + "s,1\n", r":3: 2 fields, 9 expected"),
        (HEADER + row("s", 0.0, 1.0, "dragon"), r":2: field 'category' must be one of car.*got 'dragon'"),
        (HEADER + row("s", "nan", 1.0), r":2: field 'stamp_s' must be finite, got nan"),
        (HEADER, r"detections.csv: no rows"),
        (HEADER.replace("score", "y_m"), r":1: column 'y_m' is named twice"),
    ],
)
def test_mistakes_name_file_line_and_field(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message) as caught:
        read_csv(write(tmp_path, text))
    assert "\n" not in str(caught.value)


def test_a_users_classes(tmp_path: Path) -> None:
    classes = "class,category\nvan,car\nrider,cyclist\nsign,\ntruck,car\n"
    names = ("van", "sign", "rider", "truck", "pedestrian")
    text = HEADER + "".join(row("s", 0.0, 9.0 * k, name) for k, name in enumerate(names))
    [sequence] = read_csv(write(tmp_path, text, classes=classes)).sequences
    found = sequence.detections
    assert found.category.tolist() == ["car", "cyclist", "car", "pedestrian"]
    assert found.kind.tolist() == ["van", "rider", "truck", "pedestrian"]
    assert found.center_m[:, 0].tolist() == [0.0, 18.0, 27.0, 36.0]


@pytest.mark.parametrize(
    ("classes", "message"),
    [
        (
            "class,category\nvan,lorry\n",
            r"classes.csv:2: field 'category' must be empty or one of car, .*'lorry'",
        ),
        ("class\nvan\n", r"classes.csv:1: columns missing: category"),
    ],
)
def test_mistakes_in_a_users_classes(tmp_path: Path, classes: str, message: str) -> None:
    with pytest.raises(DatasetError, match=message):
        read_csv(write(tmp_path, HEADER + row("s", 0.0, 1.0), classes=classes))


@pytest.mark.parametrize(
    ("column", "pose"), [("x_m", "inf,2,0"), ("y_m", "10,nan,0"), ("yaw_rad", "10,2,-inf")]
)
def test_a_pose_that_is_not_finite_is_refused(tmp_path: Path, column: str, pose: str) -> None:
    ego = f"sequence,stamp_s,x_m,y_m,yaw_rad\ns,0.0,0,0,0\ns,1.0,{pose}\n"
    with pytest.raises(DatasetError, match=f"ego.csv:3: field '{column}' must be finite"):
        read_csv(write(tmp_path, HEADER + row("s", 0.0, 1.0), ego=ego))


def test_poses_that_do_not_cover_the_data(tmp_path: Path) -> None:
    ego = "sequence,stamp_s,x_m,y_m,yaw_rad\ns,0.0,0,0,0\ns,1.0,10,2,0\n"
    with pytest.raises(DatasetError, match=r"ego.csv: poses from 0 to 1 s do not cover"):
        read_csv(write(tmp_path, HEADER + row("s", 2.0, 1.0), ego=ego))


def test_rejected_rows_are_counted(tmp_path: Path) -> None:
    text = HEADER + row("s", 0.0, "nan") + row("s", 0.0, 1.0) + row("s", 0.0, 1.0, score="nan")
    data = read_csv(write(tmp_path, text))
    assert (data.rejected, len(data.sequences[0].detections)) == (2, 1)


@pytest.mark.parametrize("second", [0.0, 0.5])
def test_the_tracker_refuses_times_that_do_not_rise(tmp_path: Path, second: float) -> None:
    """A frame that comes back after another one: a duplicate or an old one."""
    text = HEADER + row("s", second, 1.0) + row("s", 1.0, 1.0) + row("s", second, 1.0)
    data = read_csv(write(tmp_path, text))
    with pytest.raises(DatasetError, match=r"sequence s, frame .*not newer"):
        track_dataset(data, TrackerConfig())


def test_tracks_open_in_pandas_and_as_labels(tmp_path: Path) -> None:
    text = HEADER + "".join(row("007", 0.1 * k, 2.0 * k) for k in range(12))
    data = read_csv(write(tmp_path, text))
    tracked = track_dataset(data, TrackerConfig())
    [path] = write_tracks(tmp_path, data, tracked, ("csv",))
    table = pd.read_csv(path, dtype={"sequence": str})
    assert set(table["sequence"]) == {"007"}
    assert set(table["track_id"]) == {1}
    assert table["vx_mps"].iloc[-1] == pytest.approx(20.0, abs=1.0)
    (tmp_path / "labels.csv").write_text(path.read_text())
    [sequence] = read_dataset(tmp_path).sequences
    assert sequence.labels is not None
    assert len(sequence.labels) == len(tracked[0].tracks)


def test_names_of_sequences_lead_nowhere_else(tmp_path: Path) -> None:
    data = read_csv(write(tmp_path, HEADER + row("../up", 0.0, 1.0) + row("../up", 0.1, 1.0)))
    out = tmp_path / "out"
    [path] = write_tracks(out, data, track_dataset(data, TrackerConfig()), ("kitti",))
    assert path.parent == out
    assert path.is_file()


def test_no_two_sequences_share_a_file(tmp_path: Path) -> None:
    data = read_csv(write(tmp_path, HEADER + row("a/b", 0.0, 1.0) + row("a_b", 0.0, 1.0)))
    with pytest.raises(DatasetError, match="'a/b' and 'a_b' have the same file name"):
        write_tracks(tmp_path, data, track_dataset(data, TrackerConfig()), ("kitti",))


def by_number(frames: list[int]) -> str:
    return HEADER.replace("stamp_s", "frame") + "".join(row("a", k, 0.1 * k) for k in frames)


def test_frame_numbers_left_out_are_frames_without_detections(tmp_path: Path) -> None:
    """The tracks written carry the numbers of the file, also in frames in which they coast."""
    data = read_csv(write(tmp_path, by_number([7, 8, 9, 11])))
    [sequence] = data.sequences
    assert sequence.frame_name == ("7", "8", "9", "10", "11")
    assert [len(frame) for frame in sequence.frames()] == [1, 1, 1, 0, 1]
    write_tracks(tmp_path, data, track_dataset(data, tracker_config("default")), ["csv", "kitti"])
    tracks = pd.read_csv(tmp_path / "tracks.csv")
    assert tracks["frame"].tolist() == [7, 8, 9, 10, 11]
    assert tracks["stamp_s"].tolist() == pytest.approx([0.7, 0.8, 0.9, 1.0, 1.1])
    kitti = (tmp_path / "a.txt").read_text().splitlines()
    assert [int(line.split()[0]) for line in kitti] == [7, 8, 9, 10, 11]


def test_a_frame_number_that_would_fill_the_memory(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match=r"detections.csv:3: field 'frame' must be under 10000000"):
        read_csv(write(tmp_path, by_number([7, 10**12])))


def test_labels_with_rounded_stamps_stay_in_their_frames(tmp_path: Path) -> None:
    detections = HEADER + "".join(row("a", 1.0 + k / 30, 1.0) for k in range(6))
    labels = HEADER.replace("score", "track_id") + "".join(
        row("a", round(1.0 + k / 30, 3), 1.0, score=1) for k in range(7)
    )
    [sequence] = read_csv(write(tmp_path, detections, labels=labels)).sequences
    assert sequence.labels is not None
    assert sequence.stamp_s == pytest.approx([1.0 + k / 30 for k in range(7)], abs=1e-3)
    assert sequence.stamp_s[:6].tolist() == [1.0 + k / 30 for k in range(6)]
    assert sequence.labels.frame.tolist() == [0, 1, 2, 3, 4, 5, 6]


def test_impossible_values_reach_no_track(tmp_path: Path) -> None:
    """Damaged rows are counted, a velocity that cannot be is not measured."""
    header = HEADER.replace("category", "category,vx_mps,vy_mps")
    good = "".join(f"a,{0.1 * k},1.0,0.0,4.0,2.0,0.1,0.9,car,0.0,0.0\n" for k in range(5))
    bad = "".join(
        f"a,0.4,{x},0.0,{length},{width},{yaw},0.9,car,{speed},0.0\n"
        for x, length, width, yaw, speed in [
            ("1e300", 4, 2, 0, 0),
            (1, "1e-320", 2, 0, 0),
            (1, 4, "1e-320", 0, 0),
            (1, 4, 2, "inf", 0),
            (1, 4, 2, "1e300", 0),
            (90, 4, 2, 0, "1e200"),
        ]
    )
    data = read_csv(write(tmp_path, header + good + bad))
    assert data.rejected == 5
    [tracked] = track_dataset(data, TrackerConfig())
    numbers = np.column_stack((tracked.tracks.center_m, tracked.tracks.size_m, tracked.tracks.velocity_mps))
    assert len(numbers) == 6
    assert np.abs(numbers).max() == pytest.approx(90.0)


def test_scores_a_little_over_one_are_probabilities(tmp_path: Path) -> None:
    data = read_csv(write(tmp_path, HEADER + row("a", 0.0, 1.0, score=1.0000001)))
    assert not data.log_odds
    assert data.sequences[0].detections.score.tolist() == [1.0]
    data = read_csv(write(tmp_path, HEADER + row("a", 0.0, 1.0, score=7.5)))
    assert data.log_odds
    assert any("log odds" in note for note in data.notes)


def test_stamps_in_nanoseconds_are_noticed(tmp_path: Path) -> None:
    text = HEADER + "".join(row("a", 100_000_000 * k, 1.0) for k in range(4))
    assert any("are the times in seconds?" in note for note in read_csv(write(tmp_path, text)).notes)


VEHICLE = "stamp_s,ahead_m,left_m,length_m,width_m,yaw_rad"


def test_boxes_in_the_vehicles_frame_are_moved_by_its_poses(tmp_path: Path) -> None:
    """The vehicle stands at (100, 50) and looks along y: 10 m ahead and 2 m to the left is (98, 60)."""
    ego = "stamp_s,x_m,y_m,yaw_rad\n0,100,50,1.5707963267948966\n1,100,50,1.5707963267948966\n"
    text = f"{VEHICLE},vx_mps,vy_mps\n0.5,10,2,4,2,0.1,3,0\n"
    [sequence] = read_csv(write(tmp_path, text, ego=ego)).sequences
    found = sequence.detections
    assert found.center_m[0] == pytest.approx((98.0, 60.0))
    assert found.yaw_rad[0] == pytest.approx(np.pi / 2 + 0.1)
    assert found.velocity_mps[0] == pytest.approx((0.0, 3.0))


def test_without_poses_the_vehicles_frame_is_the_world(tmp_path: Path) -> None:
    [sequence] = read_csv(write(tmp_path, f"{VEHICLE}\n0.5,10,2,4,2,0.1\n")).sequences
    assert sequence.detections.center_m.tolist() == [[10.0, 2.0]]


def test_what_stands_still_does_so_seen_from_a_turning_vehicle(tmp_path: Path) -> None:
    stamps = np.arange(30) * 0.1
    rows = list(zip(stamps.tolist(), (0.5 * stamps).tolist(), strict=True))
    ego = "stamp_s,x_m,y_m,yaw_rad\n" + "".join(f"{t},0,0,{a}\n" for t, a in rows)
    text = f"{VEHICLE}\n" + "".join(f"{t},{20 * np.cos(a)},{-20 * np.sin(a)},4,2,{-a}\n" for t, a in rows)
    [tracked] = track_dataset(read_csv(write(tmp_path, text, ego=ego)), TrackerConfig())
    assert np.unique(tracked.tracks.object_id).tolist() == [1]
    assert tracked.tracks.center_m == pytest.approx(np.tile((20.0, 0.0), (30, 1)), abs=1e-6)
    assert np.abs(tracked.tracks.velocity_mps).max() < 1e-6


@pytest.mark.parametrize(
    ("header", "labels", "message"),
    [
        (
            VEHICLE.replace("ahead_m", "x_m"),
            False,
            "csv:1: columns missing: x_m and y_m, or ahead_m and left_m",
        ),
        (VEHICLE, True, "detections and labels are in different frames; ego.csv is needed"),
    ],
)
def test_positions_in_no_frame_or_in_two(tmp_path: Path, header: str, labels: bool, message: str) -> None:
    others = {"labels": "stamp_s,x_m,y_m,length_m,width_m,yaw_rad,track_id\n"} if labels else {}
    with pytest.raises(DatasetError, match=message):
        read_csv(write(tmp_path, f"{header}\n0,1,1,4,2,0\n", **others))


NOISE = "stamp_s,{}length_m,width_m,yaw_rad,x_var_m2,y_var_m2,xy_cov_m2,yaw_var_rad2\n"


def test_noise_that_a_detector_states_reaches_the_tracker(tmp_path: Path) -> None:
    """Of three boxes one states nothing, one its position alone, one all."""
    text = NOISE.format("x_m,y_m,") + "0.0,1,0,4,2,0,0.5,0.25,0.1,0.04\n0.0,9,0,4,2,0,0.5,0.25,0,0\n"
    text += "0.0,20,0,4,2,0,0,0,0,0\n"
    [sequence] = read_csv(write(tmp_path, text)).sequences
    [frame] = sequence.frames()
    assert frame.pose_covariance is not None
    np.testing.assert_array_equal(
        frame.pose_covariance[0], [[0.5, 0.1, 0.0], [0.1, 0.25, 0.0], [0.0, 0.0, 0.04]]
    )
    assert np.isnan(frame.pose_covariance[1:, [0, 2], [0, 2]]).tolist() == [[False, True], [True, True]]


def test_noise_in_the_vehicles_axes_turns_with_it(tmp_path: Path) -> None:
    """4 m2 ahead and 0.25 m2 to the left of a vehicle that looks along y."""
    text = NOISE.format("ahead_m,left_m,") + "0.0,10,0,4,2,0,4.0,0.25,0.0,0.01\n"
    ego = "stamp_s,x_m,y_m,yaw_rad\n0.0,5,5,1.5707963267948966\n"
    [sequence] = read_csv(write(tmp_path, text, ego=ego)).sequences
    [frame] = sequence.frames()
    assert frame.pose_covariance is not None
    np.testing.assert_allclose(frame.boxes.center_m, [[5.0, 15.0]], atol=1e-12)
    np.testing.assert_allclose(frame.pose_covariance[0], np.diag([0.25, 4.0, 0.01]), atol=1e-12)


def test_a_table_without_noise_has_none(tmp_path: Path) -> None:
    [sequence] = read_csv(write(tmp_path, HEADER + row("a", 0.0, 1.0))).sequences
    assert [frame.pose_covariance for frame in sequence.frames()] == [None]


@pytest.mark.parametrize("column", ["x_var_m2", "y_var_m2", "xy_cov_m2"])
def test_noise_of_which_a_part_is_missing_is_refused(tmp_path: Path, column: str) -> None:
    header = f"stamp_s,x_m,y_m,length_m,width_m,yaw_rad,score,category,{column}"
    (tmp_path / "detections.csv").write_text(f"{header}\n0.0,0,0,4,2,0,0.9,car,0.1\n")
    with pytest.raises(DatasetError, match=f"detections.csv:1: {column} without both of x_var_m2, y_var_m2"):
        read_csv(tmp_path)
