"""Logs of Argoverse 2: boxes, poses between poses, categories, damaged files."""

import json
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from scenarios.errors import DatasetError
from scenarios.recorded.argoverse.reader import CATEGORY_OF_CLASS, read_argoverse, read_cuboids
from scenarios.recorded.dataset import LEFT_OUT, labels_as_detections
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.maps.drive_map import load_drive_map
from smartmot.types import CATEGORIES
from tests.scenarios.recorded import argoverse_log as made

SHARED = Path(__file__).parents[4].parent / "shared" / "argoverse2" / "logs"
TRUTH = json.loads((Path(__file__).parents[3] / "data" / "argoverse" / "corners.json").read_text())["logs"]

# av2 0.3.6, datasets/sensor/constants.py
AV2_CATEGORIES = [
    "ANIMAL",
    "ARTICULATED_BUS",
    "BICYCLE",
    "BICYCLIST",
    "BOLLARD",
    "BOX_TRUCK",
    "BUS",
    "CONSTRUCTION_BARREL",
    "CONSTRUCTION_CONE",
    "DOG",
    "LARGE_VEHICLE",
    "MESSAGE_BOARD_TRAILER",
    "MOBILE_PEDESTRIAN_CROSSING_SIGN",
    "MOTORCYCLE",
    "MOTORCYCLIST",
    "OFFICIAL_SIGNALER",
    "PEDESTRIAN",
    "RAILED_VEHICLE",
    "REGULAR_VEHICLE",
    "SCHOOL_BUS",
    "SIGN",
    "STOP_SIGN",
    "STROLLER",
    "TRAFFIC_LIGHT_TRAILER",
    "TRUCK",
    "TRUCK_CAB",
    "VEHICULAR_TRAILER",
    "WHEELCHAIR",
    "WHEELED_DEVICE",
    "WHEELED_RIDER",
]


@pytest.fixture
def shared_log(request: pytest.FixtureRequest) -> Path:
    folder = SHARED / request.param
    if not folder.is_dir():
        pytest.skip("logs of Argoverse 2 are not in ../shared/argoverse2")
    return folder


# --- truth from outside -------------------------------------------------------------------------------


@pytest.mark.parametrize("shared_log", TRUTH, indirect=True)
def test_corners_are_those_of_av2(shared_log: Path) -> None:
    cuboids = read_cuboids(shared_log)
    corners = cuboids.corners_m()
    labels = read_argoverse(shared_log).sequences[0].labels
    assert labels is not None
    for box in TRUTH[shared_log.name]:
        expected = np.array(box["corners_m"])
        rows = (cuboids.stamp_ns == box["timestamp_ns"]) & (cuboids.category == box["category"])
        assert np.abs(corners[rows] - expected).max(axis=(1, 2)).min() < 1e-6
        if CATEGORY_OF_CLASS[box["category"]] == LEFT_OUT:
            continue
        # seen from above, a box's middle is that of its corners, and its heading that of its long edges
        middle, front = expected.mean(axis=0), expected[:4].mean(axis=0)
        near = np.argmin(
            np.hypot(*(labels.center_m - middle[:2]).T) + 10.0 * (labels.kind != box["category"])
        )
        assert labels.center_m[near] == pytest.approx(middle[:2], abs=1e-6)
        assert labels.bottom_m[near] + 0.5 * labels.height_m[near] == pytest.approx(middle[2], abs=1e-6)
        along = np.arctan2(*(front - middle)[1::-1])
        assert np.sin(labels.yaw_rad[near] - along) == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("shared_log", TRUTH, indirect=True)
def test_all_labels_of_the_logs_are_read(shared_log: Path) -> None:
    data = read_dataset(shared_log)
    sequence = data.sequences[0]
    # rows of the files without cones, bollards and the ego's own boxes
    frames, labels = {"3b3570b4": (157, 13820 - 432 - 155 - 157), "7fab2350": (156, 11364 - 676 - 118)}[
        sequence.name[:8]
    ]
    assert data.kind == "argoverse"
    assert (len(sequence), len(sequence.labels)) == (frames, labels)  # type: ignore[arg-type]
    assert sequence.map_path is not None
    network = load_drive_map(sequence.map_path)
    nearest = network.nearest_lane(sequence.ego_xy_yaw()[:, :2])
    assert nearest.distance_m.max() == 0.0


# --- closed forms -------------------------------------------------------------------------------------


def test_boxes_are_moved_into_the_city(tmp_path: Path) -> None:
    folder = made.log(tmp_path)
    turned = made.poses()
    half = np.sqrt(0.5)  # the vehicle looks along y
    turned |= {"qw": [half] * len(turned["qw"]), "qz": [half] * len(turned["qw"])}
    turned["tz_m"] = [50.0] * len(turned["qw"])
    made.write(folder / "city_SE3_egovehicle.feather", turned)
    sequence = read_argoverse(folder).sequences[0]
    labels = sequence.labels
    assert labels is not None
    # at 0.5 s the vehicle is at x = 25 m; the car is 20 m ahead, the person 5 m ahead and 4 m to the right
    car, person = (labels[(labels.frame == 5) & (labels.category == name)] for name in ("car", "pedestrian"))
    assert car.center_m == pytest.approx(np.array([[25.0, 18.25]]))
    assert person.center_m == pytest.approx(np.array([[29.0, 3.25]]))
    assert car.yaw_rad == pytest.approx([np.pi / 2])
    assert (car.bottom_m, car.height_m) == (pytest.approx([50.0]), pytest.approx([1.6]))
    assert sequence.stamp_s - sequence.stamp_s[0] == pytest.approx(0.1 * np.arange(10), abs=1e-7)


@pytest.mark.parametrize("axis", ["qx", "qy", "qz"])
def test_poses_between_poses(tmp_path: Path, axis: str) -> None:
    """A turn at constant rate about one axis, and a straight way: SE(3) between the poses is known."""
    rate_radps, at_s = 0.8, np.array([0.0, 0.013, 0.05, 0.21, 0.4])
    known_s = np.array([0.0, 0.02, 0.021, 0.17, 0.4])
    table = {
        "timestamp_ns": [made.START_NS + round(1e9 * t) for t in known_s],
        **{name: [0.0] * 5 for name in ("qx", "qy", "qz")},
        "tx_m": 10.0 * known_s, "ty_m": -4.0 * known_s, "tz_m": 2.0 * known_s,
    }  # fmt: skip
    table |= {"qw": np.cos(0.5 * rate_radps * known_s), axis: np.sin(0.5 * rate_radps * known_s)}
    table["qw"][2], table[axis][2] = -table["qw"][2], -table[axis][2]  # the same rotation
    rows = [made.box(0, "a", 1.0, 0.0, "BUS", timestamp_ns=made.START_NS + round(1e9 * t)) for t in at_s]
    folder = made.log(tmp_path, rows)
    made.write(folder / "city_SE3_egovehicle.feather", table)
    pose = read_argoverse(folder).sequences[0].world_SE3_ego
    assert pose is not None
    angle = rate_radps * at_s
    i, j = {"qx": (1, 2), "qy": (2, 0), "qz": (0, 1)}[axis]
    assert pose[:, i, i] == pytest.approx(np.cos(angle), abs=1e-9)
    assert pose[:, j, i] == pytest.approx(np.sin(angle), abs=1e-9)
    assert pose[:, :3, 3] == pytest.approx(np.outer(at_s, (10.0, -4.0, 2.0)), abs=1e-9)


# --- what is read -------------------------------------------------------------------------------------


def test_every_category_is_one_of_ours_or_left_out() -> None:
    assert sorted(CATEGORY_OF_CLASS) == AV2_CATEGORIES
    assert set(CATEGORY_OF_CLASS.values()) <= {*CATEGORIES, LEFT_OUT}


def test_categories_without_ours_are_counted(tmp_path: Path) -> None:
    rows = [made.box(0, name, 5.0 * k, 0.0, name) for k, name in enumerate(AV2_CATEGORIES)]
    data = read_argoverse(made.log(tmp_path, [*rows, made.box(0, "more", 3.0, 1.0, "SIGN")]))
    labels = data.sequences[0].labels
    assert labels is not None
    assert len(labels) == 24
    assert data.notes == (
        "labels left out, for they are no road users: 1 BOLLARD, 1 CONSTRUCTION_BARREL, 1 CONSTRUCTION_CONE, "
        "1 MOBILE_PEDESTRIAN_CROSSING_SIGN, 2 SIGN, 1 STOP_SIGN",
    )


@pytest.mark.parametrize("classes", [None, "class,category\nEGO_VEHICLE,car\nREGULAR_VEHICLE,\n"])
def test_the_ego_never_meets_itself(tmp_path: Path, classes: str | None) -> None:
    rows = [*made.boxes(), *(made.box(k, "ego", 0.0, 0.0, "EGO_VEHICLE") for k in range(11))]
    folder = made.log(tmp_path, rows, "annotations_with_ego")
    if classes is not None:
        (folder / "classes.csv").write_text(classes)
    sequence = read_argoverse(folder).sequences[0]
    labels = sequence.labels
    assert labels is not None
    assert set(labels.kind.tolist()) == {"REGULAR_VEHICLE", "PEDESTRIAN"} - {
        "REGULAR_VEHICLE" if classes else ""
    }
    assert len(sequence) == 11  # that nothing else is there is a frame, too
    assert "EGO_VEHICLE" not in read_cuboids(folder).category


def test_a_log_that_shows_nothing_but_the_ego(tmp_path: Path) -> None:
    rows = [made.box(k, "ego", 0.0, 0.0, "EGO_VEHICLE") for k in range(3)]
    sequence = read_argoverse(made.log(tmp_path, rows, "annotations_with_ego")).sequences[0]
    assert (len(sequence), len(sequence.labels)) == (3, 0)  # type: ignore[arg-type]


def test_labels_that_no_lidar_point_hits_are_ignored(tmp_path: Path) -> None:
    rows = [made.box(0, name, 5.0, 0.0, "BUS", num_interior_pts=k) for k, name in enumerate("ab")]
    labels = read_argoverse(made.log(tmp_path, rows)).sequences[0].labels
    assert labels is not None
    assert labels.ignored.tolist() == [True, False]


def test_impossible_labels_are_left_out_and_counted(tmp_path: Path) -> None:
    wrong = ({"tx_m": np.nan}, {"qz": np.nan}, {"tx_m": np.inf}, {"length_m": 0.0}, {"height_m": 1e308})
    rows = [made.box(0, str(k), 5.0, 0.0, "BUS", **columns) for k, columns in enumerate(({}, *wrong))]
    data = read_argoverse(made.log(tmp_path, rows))
    assert len(data.sequences[0].labels) == 1  # type: ignore[arg-type]
    assert data.notes == ("5 impossible labels left out",)


def test_detections_beside_labels(tmp_path: Path) -> None:
    folder = made.log(tmp_path)
    found = [made.box(k, "", 20.0, 0.5, "BUS", score=0.25) for k in (0, 2, 10)]
    table = {name: values for name, values in made.columns_of(found).items() if name != "track_uuid"}
    made.write(folder / "detections.feather", table)
    data = read_argoverse(folder)
    sequence = data.sequences[0]
    assert len(sequence) == 11
    assert sequence.detections.frame.tolist() == [0, 2, 10]
    assert sequence.detections.score.tolist() == [0.25] * 3
    assert sequence.detections.center_m == pytest.approx(np.array([(40, -1.25), (42, -1.25), (50, -1.25)]))
    assert labels_as_detections(data) is data
    (folder / "annotations.feather").unlink()
    assert read_argoverse(folder).sequences[0].labels is None


def test_labels_stand_in_for_detections(tmp_path: Path) -> None:
    rows = [*made.boxes(), made.box(3, "hidden", 30.0, 0.0, "BUS", num_interior_pts=0)]
    data = labels_as_detections(read_argoverse(made.log(tmp_path, rows)))
    detections = data.sequences[0].detections
    assert len(detections) == 20
    assert set(detections.score.tolist()) == {1.0}
    assert "labels stand in" in data.notes[-1]


def test_the_files_show_a_log(tmp_path: Path) -> None:
    folder = made.log(tmp_path / "log")
    assert read_dataset(folder).kind == "argoverse"
    assert read_dataset(folder / "annotations.feather").kind == "argoverse"
    (folder / "detections.csv").write_text("stamp_s,x_m,y_m,length_m,width_m,yaw_rad\n0,1,0,4,2,0\n")
    assert read_dataset(folder).kind == "argoverse"


# --- damaged files ------------------------------------------------------------------------------------


def _poses(**columns: object) -> Callable[[Path], None]:
    """Values in the fourth row of the poses."""

    def damage(folder: Path) -> None:
        table = made.poses()
        for name, value in columns.items():
            table[name][3] = value
        made.write(folder / "city_SE3_egovehicle.feather", table)

    return damage


def _boxes(**columns: object) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        rows = made.boxes()
        rows[3] |= columns
        made.write(folder / "annotations.feather", made.columns_of(rows))

    return damage


def _without(name: str, column: str) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        table = made.poses() if name.startswith("city") else made.columns_of(made.boxes())
        del table[column]
        made.write(folder / name, table)

    return damage


def _truncated(name: str, share: float) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        content = (folder / name).read_bytes()
        (folder / name).write_bytes(content[: int(share * len(content))])

    return damage


def _stretch(first: int, last: int) -> Callable[[Path], None]:
    """Poses without those of a stretch."""

    def damage(folder: Path) -> None:
        table = {name: values[:first] + values[last:] for name, values in made.poses().items()}
        made.write(folder / "city_SE3_egovehicle.feather", table)

    return damage


def _no_rows(name: str) -> Callable[[Path], None]:
    def damage(folder: Path) -> None:
        table = made.poses() if name.startswith("city") else made.columns_of(made.boxes())
        made.write(folder / name, {column: pa.array(values)[:0] for column, values in table.items()})

    return damage


POSES, BOXES = "city_SE3_egovehicle.feather", "annotations.feather"
DAMAGES: dict[str, tuple[Callable[[Path], object], str]] = {
    "poses truncated": (_truncated(POSES, 0.6), r"city_SE3_egovehicle.feather: not a readable Feather file"),
    "boxes truncated": (_truncated(BOXES, 0.5), r"annotations.feather: not a readable Feather file"),
    "poses empty": (_truncated(POSES, 0.0), r"city_SE3_egovehicle.feather: not a readable Feather file"),
    "poses no longer there": (lambda f: (f / POSES).unlink(), r"city_SE3_egovehicle.feather: no such file"),
    "no boxes": (lambda f: (f / BOXES).unlink(), r"no annotations.feather or .* in it"),
    "poses without rows": (_no_rows(POSES), r"city_SE3_egovehicle.feather: no rows; poses are needed"),
    "boxes without rows": (_no_rows(BOXES), r"annotations.feather: no rows; there is nothing to track"),
    "poses without qw": (_without(POSES, "qw"), r"city_SE3_.*: columns missing: qw"),
    "boxes without time": (
        _without(BOXES, "timestamp_ns"),
        r"annotations.feather: columns missing: timestamp",
    ),
    "boxes without category": (
        _without(BOXES, "category"),
        r"annotations.feather: columns missing: category",
    ),
    "pose not finite": (_poses(tx_m=np.nan), r"egovehicle.feather:4: field 'tx_m' must be finite, got nan"),
    "pose missing": (_poses(qw=None), r"egovehicle.feather:4: field 'qw' must be finite, got nan"),
    "pose not unit": (_poses(qw=0.5), r"egovehicle.feather:4: field '\|q\|' must be 1, got 0.5"),
    "pose without turn": (_poses(qw=0.0), r"egovehicle.feather:4: field '\|q\|' must be 1, got 0"),
    "time goes back": (
        _poses(timestamp_ns=made.START_NS),
        r"egovehicle.feather:4: field 'timestamp_ns' must rise from row to row",
    ),
    "time before all": (_poses(timestamp_ns=-(2**63)), r":4: field 'timestamp_ns' must be nanoseconds, 0 or"),
    "text for a number": (
        lambda f: made.write(f / POSES, made.poses() | {"tx_m": ["far"] * len(made.poses()["tx_m"])}),
        r"egovehicle.feather: column 'tx_m' must hold double",
    ),
    "time in parts": (
        lambda f: made.write(f / BOXES, made.columns_of(made.boxes()) | {"timestamp_ns": [0.5] * 20}),
        r"annotations.feather: column 'timestamp_ns' must hold int64",
    ),
    "poses begin late": (
        _stretch(0, 20),
        r"do not cover the boxes: none within 0.5 s about 315966253660357000",
    ),
    "poses end early": (
        _stretch(100, 999),
        r"do not cover the boxes: none within 0.5 s about 315966254260357000",
    ),
    "poses have a hole": (
        _stretch(20, 120),
        r"do not cover the boxes: none within 0.5 s about 3159662538603",
    ),
    "box not unit": (_boxes(qw=2.0), r"annotations.feather:4: field '\|q\|' must be 1, got 2"),
    "box of no time": (_boxes(timestamp_ns=None), r"annotations.feather:4: field 'timestamp_ns' is missing"),
    "a long name": (_boxes(track_uuid="a" * 201), r"annotations.feather:4: field 'track_uuid' must have 200"),
    "box of no class": (_boxes(category=None), r"annotations.feather:4: field 'category' is missing"),
    "box of another class": (
        _boxes(category="HOVERCRAFT"),
        r"annotations.feather:4: field 'category' must be one of Argoverse 2, or stand in classes.csv",
    ),
}


@pytest.mark.parametrize("damage", DAMAGES)
def test_damaged_logs_are_one_line(tmp_path: Path, damage: str) -> None:
    folder = made.log(tmp_path)
    spoil, message = DAMAGES[damage]
    spoil(folder)
    with pytest.raises(DatasetError, match=message) as error:
        read_argoverse(folder)
    assert "\n" not in str(error.value)
