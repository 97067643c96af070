"""nuScenes' JSON in and out."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from evaluation.studies.mot.run import track_dataset
from scenarios.errors import DatasetError
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.nuscenes import MAX_BOXES_PER_SAMPLE, read_nuscenes, submission_text
from scenarios.recorded.poses import rotation_matrix
from smartmot.tracking.tracker import TrackerConfig

TOKENS = [f"{k:032x}" for k in range(6)]


def box(x: float = 10.0, name: str = "car", score: float = 0.8, **changes: Any) -> dict[str, Any]:
    """Heading along y: a quarter turn."""
    return {
        "translation": [x, 5.0, 1.0],
        "size": [2.0, 4.5, 1.6],
        "rotation": [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)],
        "velocity": [1.0, 2.0],
        "detection_name": name,
        "detection_score": score,
        "attribute_name": "",
    } | changes


def write(folder: Path, results: dict[str, Any], times: bool = True, **tables: Any) -> Path:
    (folder / "detections.json").write_text(json.dumps({"meta": {"use_lidar": True}, "results": results}))
    if times:
        lines = [f"{token},scene-{k // 4},{10.0 + 0.5 * k}" for k, token in enumerate(TOKENS)]
        (folder / "frames.csv").write_text("sample_token,scene,stamp_s\n" + "\n".join(lines) + "\n")
    for name, rows in tables.items():
        (folder / f"{name}.json").write_text(json.dumps(rows))
    return folder


def test_boxes_scenes_and_times(tmp_path: Path) -> None:
    data = read_nuscenes(write(tmp_path, {t: [box()] for t in TOKENS}))
    assert [s.name for s in data.sequences] == ["scene-0", "scene-1"]
    first = data.sequences[0]
    assert first.stamp_s.tolist() == [10.0, 10.5, 11.0, 11.5]
    assert first.frame_name == tuple(TOKENS[:4])
    found = first.detections
    assert found.center_m[0].tolist() == [10.0, 5.0]
    assert found.size_m[0].tolist() == [4.5, 2.0]
    assert found.yaw_rad[0] == pytest.approx(np.pi / 2)
    assert found.bottom_m[0] == pytest.approx(0.2)
    [frame, *_] = first.frames()
    assert frame.velocity_mps is not None
    assert frame.velocity_mps.tolist() == [[1.0, 2.0]]
    assert not data.log_odds


def test_road_users_only(tmp_path: Path) -> None:
    names = ["car", "bus", "barrier", "bicycle", "traffic_cone", "pedestrian", "motorcycle", "trailer"]
    data = read_nuscenes(write(tmp_path, {TOKENS[0]: [box(name=name) for name in names]}))
    assert data.sequences[0].detections.category.tolist() == [
        *("car", "truck", "cyclist", "pedestrian", "motorcycle", "truck")
    ]


def test_tables_give_scenes_labels_and_poses(tmp_path: Path) -> None:
    half = np.sqrt(0.5)
    annotation = {"translation": [1.0, 2.0, 1.0], "size": [2.0, 4.0, 1.5], "rotation": [1.0, 0.0, 0.0, 0.0]}
    annotation |= {"num_lidar_pts": 5, "num_radar_pts": 0}
    tables = {
        "scene": [{"token": "s", "name": "scene-0103"}],
        "sample": [
            {"token": TOKENS[1], "timestamp": 2_500_000, "scene_token": "s"},
            {"token": TOKENS[0], "timestamp": 2_000_000, "scene_token": "s"},
        ],
        "category": [{"token": "c", "name": "vehicle.bus.rigid"}, {"token": "d", "name": "animal"}],
        "instance": [{"token": "i", "category_token": "c"}, {"token": "j", "category_token": "d"}],
        "sample_annotation": [
            {"sample_token": TOKENS[0], "instance_token": "i", **annotation},
            {"sample_token": TOKENS[0], "instance_token": "j", **annotation},
            {"sample_token": TOKENS[1], "instance_token": "i", **annotation, "num_lidar_pts": 0},
        ],
        "sensor": [{"token": "l", "channel": "LIDAR_TOP"}, {"token": "m", "channel": "CAM_FRONT"}],
        "calibrated_sensor": [{"token": "x", "sensor_token": "l"}, {"token": "y", "sensor_token": "m"}],
        "sample_data": [
            {
                "sample_token": t,
                "ego_pose_token": f"{c}{t}",
                "calibrated_sensor_token": c,
                "is_key_frame": True,
            }
            for t in TOKENS[:2]
            for c in "xy"
        ],
        "ego_pose": [
            {"token": f"{c}{t}", "translation": [7.0, 8.0, 0.0], "rotation": [half, 0.0, 0.0, half]}
            for t in TOKENS[:2]
            for c in "xy"
        ],
    }
    data = read_dataset(write(tmp_path, {t: [box()] for t in TOKENS[:2]}, times=False, **tables))
    [sequence] = data.sequences
    assert (data.kind, sequence.name) == ("nuscenes", "scene-0103")
    assert sequence.frame_name == tuple(TOKENS[:2])
    assert sequence.stamp_s == pytest.approx([2.0, 2.5])
    assert sequence.labels is not None
    assert sequence.labels.kind.tolist() == ["bus", "bus"]
    assert sequence.labels.ignored.tolist() == [False, True]
    assert sequence.ego_xy_yaw() == pytest.approx(np.array([[7.0, 8.0, np.pi / 2]] * 2))


def test_other_classes_have_the_category_that_the_user_gives(tmp_path: Path) -> None:
    names = ["rider", "car", "trailer", "barrier"]
    folder = write(tmp_path, {TOKENS[0]: [box(name=name) for name in names]})
    (folder / "classes.csv").write_text("class,category\nrider,cyclist\ntrailer,\n")
    found = read_nuscenes(folder).sequences[0].detections
    assert list(zip(found.kind.tolist(), found.category.tolist(), strict=True)) == [
        ("rider", "cyclist"),
        ("car", "car"),
    ]


@pytest.mark.parametrize(
    ("results", "message"),
    [
        ({TOKENS[0]: [box(size=[1.0])]}, f"sample '{TOKENS[0]}': field 'size' must be 3 numbers"),
        ({TOKENS[0]: [box(translation="here")]}, "field 'translation' must be 3 numbers"),
        (
            {TOKENS[0]: [box(name="ufo")]},
            "field 'detection_name' is unknown: 'ufo'; give it a category in classes.csv",
        ),
        ({TOKENS[0]: [box(detection_score="high")]}, "field 'detection_score' must be a number"),
        ({TOKENS[0]: [3]}, "field 'translation' must be 3 numbers"),
        ({TOKENS[0]: {}}, "expected a list of boxes"),
        ({"nowhere": []}, "sample 'nowhere' is not in .*frames.csv"),
    ],
)
def test_mistakes_name_file_sample_and_field(tmp_path: Path, results: dict[str, Any], message: str) -> None:
    with pytest.raises(DatasetError, match=message) as caught:
        read_nuscenes(write(tmp_path, results))
    assert "detections.json" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"timestamp": None}, "sample.json: record 0: field 'timestamp' must be a number"),
        ({"token": 3}, "sample.json: record 0: field 'token' must be a text"),
        ({"scene_token": "x"}, "sample.json: scene 'x' is not in scene.json"),
    ],
)
def test_mistakes_in_tables_name_file_record_and_field(
    tmp_path: Path, changes: dict[str, Any], message: str
) -> None:
    sample = {"token": TOKENS[0], "timestamp": 1, "scene_token": "s"} | changes
    tables = {"scene": [{"token": "s", "name": "scene"}], "sample": [sample]}
    with pytest.raises(DatasetError, match=message):
        read_nuscenes(write(tmp_path, {}, times=False, **tables))


def test_broken_json_names_the_line(tmp_path: Path) -> None:
    (tmp_path / "detections.json").write_text('{"results":\n {"a": [}\n')
    with pytest.raises(DatasetError, match=r"detections\.json: line 2: not JSON"):
        read_nuscenes(tmp_path)


def test_a_sample_that_is_there_twice_is_refused(tmp_path: Path) -> None:
    write(tmp_path, {t: [box()] for t in TOKENS})
    times = tmp_path / "frames.csv"
    times.write_text(times.read_text() + f"{TOKENS[0]},scene-1,13.0\n")
    with pytest.raises(DatasetError, match=rf"frames\.csv: sample '{TOKENS[0]}' is there twice"):
        read_nuscenes(tmp_path)


def test_a_score_that_is_not_there_is_refused_and_one_that_is_null_left_out(tmp_path: Path) -> None:
    boxes = [box(), box(20.0, detection_score=None)]
    assert len(read_nuscenes(write(tmp_path, {TOKENS[0]: boxes})).sequences[0].detections) == 1
    del boxes[1]["detection_score"]
    with pytest.raises(DatasetError, match="field 'detection_score' must be a number"):
        read_nuscenes(write(tmp_path, {TOKENS[0]: boxes}))


def test_without_times_the_samples_are_one_recording(tmp_path: Path) -> None:
    data = read_nuscenes(write(tmp_path, {t: [box()] for t in TOKENS[::-1]}, times=False))
    [sequence] = data.sequences
    assert sequence.frame_name == tuple(TOKENS[::-1])
    assert sequence.stamp_s.tolist() == [0.0, 0.5, 1.0, 1.5, 2.0, 2.5]
    assert any("no times of the samples" in note and "frames.csv" in note for note in data.notes)


def test_impossible_boxes_are_counted(tmp_path: Path) -> None:
    bad = [box(x=float("nan")), box(size=[0.0, 4.0, 1.0]), box(rotation=[0.0] * 4), box(x=1e300), box()]
    data = read_nuscenes(write(tmp_path, {TOKENS[0]: bad}))
    assert (data.rejected, len(data.sequences[0].detections)) == (4, 1)


def test_submission(tmp_path: Path) -> None:
    """Every sample once, the fields and names of the challenge, one name per track, numbers only."""
    results = {t: [box(10.0 + 0.5 * k), box(60.0, "bus")] for k, t in enumerate(TOKENS)}
    data = read_nuscenes(write(tmp_path, results))
    tracked = track_dataset(data, TrackerConfig())
    text = submission_text((one.sequence, one.tracks) for one in tracked)
    content = json.loads(text)
    assert set(content) == {"meta", "results"}
    assert all(isinstance(value, bool) for value in content["meta"].values())
    assert set(content["meta"]) == {"use_camera", "use_lidar", "use_radar", "use_map", "use_external"}
    assert set(content["results"]) == set(TOKENS)
    names: dict[str, set[str]] = {}
    for token, boxes in content["results"].items():
        for one in boxes:
            assert set(one) == {
                *("sample_token", "translation", "size", "rotation", "velocity"),
                *("tracking_id", "tracking_name", "tracking_score"),
            }
            assert one["sample_token"] == token
            assert [len(one[f]) for f in ("translation", "size", "rotation", "velocity")] == [3, 3, 4, 2]
            assert isinstance(one["tracking_id"], str)
            names.setdefault(one["tracking_id"], set()).add(one["tracking_name"])
    assert sorted(map(sorted, names.values())) == [["bus"], ["bus"], ["car"], ["car"]]  # two scenes
    last = content["results"][TOKENS[3]]
    [car] = [one for one in last if one["tracking_name"] == "car"]
    assert car["size"] == pytest.approx([2.0, 4.5, 1.6], abs=0.05)
    assert car["translation"][2] == pytest.approx(1.0)
    assert rotation_matrix(np.array(car["rotation"]))[:2, 0] == pytest.approx([0.0, 1.0], abs=0.05)


def test_classes_that_the_challenge_does_not_track_are_not_submitted(tmp_path: Path) -> None:
    names = ["construction_vehicle", "truck", "trailer", "bicycle"]
    boxes = [box(30.0 * k, name) for k, name in enumerate(names)]
    tracked = track_dataset(read_nuscenes(write(tmp_path, {TOKENS[0]: boxes})), TrackerConfig())
    content = json.loads(submission_text((one.sequence, one.tracks) for one in tracked))
    found = [one["tracking_name"] for one in content["results"][TOKENS[0]]]
    assert found == ["truck", "trailer", "bicycle"]


def test_no_more_boxes_than_allowed(objects: Any, sequence: Any) -> None:
    count = MAX_BOXES_PER_SAMPLE + 7
    score = np.linspace(0.0, 1.0, count)
    tracks = objects([(0, i, 5.0 * i, 0.0) for i in range(count)], score=score)
    content = json.loads(submission_text([(sequence(1, None), tracks)], frames_are_samples=False))
    [boxes] = content["results"].values()
    assert len(boxes) == MAX_BOXES_PER_SAMPLE
    assert min(one["tracking_score"] for one in boxes) == pytest.approx(score[7], abs=1e-6)
