"""SimBEV's files: a reduced copy of the reference data, and its faults."""

import json
import math
import pickle
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from scenarios.errors import DatasetError
from scenarios.recorded.dataset import Dataset, labels_as_detections
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.simbev.hd_map import compare_lanes
from scenarios.recorded.simbev.reader import read_simbev

DATA = Path(__file__).parents[3] / "data" / "simbev"
REFERENCE = Path(__file__).parents[4].parent / "shared" / "simbev"
TRUTH = ("time_s", "x_m", "y_m", "yaw_rad", "length_m", "width_m", "height_m", "speed_mps")


def require_truth(data: Dataset, truth: list[dict[str, Any]]) -> None:
    """All labels are those of the table of truth, within 1e-6."""
    assert sum(len(s.labels or ()) for s in data.sequences) == len(truth)
    for scene, sequence in enumerate(data.sequences):
        labels = sequence.labels
        assert labels is not None
        rows = sorted((r for r in truth if r["scene"] == scene), key=lambda r: (r["frame"], r["id"]))
        assert labels.object_id.tolist() == [row["id"] for row in rows]
        assert labels.category.tolist() == [row["category"] for row in rows]
        assert sequence.frame_numbers()[labels.frame].tolist() == [row["frame"] for row in rows]
        read = np.column_stack(
            (
                *(sequence.stamp_s[labels.frame], labels.center_m, labels.yaw_rad, labels.size_m),
                *(labels.height_m, np.hypot(*labels.velocity_mps.T)),
            )
        )
        assert read == pytest.approx(np.array([[row[n] for n in TRUTH] for row in rows]), abs=1e-6)


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A copy that can be changed."""
    return Path(shutil.copytree(DATA, tmp_path / "data"))


Change = Callable[[Any], object]


def change(path: Path, change_content: Change) -> None:
    content = json.loads(path.read_text())
    change_content(content)
    path.write_text(json.dumps(content))


def infos(folder: Path) -> Path:
    return folder / "simbev" / "infos" / "simbev_infos_val.json"


def label_file(folder: Path, frame: int = 0) -> Path:
    return folder / "simbev/ground-truth/det" / f"SimBEV-scene-0001-frame-{frame:04d}-GT_DET.json"


def frame_of(content: Any, frame: int = 0) -> Any:
    return content["data"]["scene_0001"]["scene_data"][frame]


def test_labels_of_both_forms_are_the_truth() -> None:
    data = read_dataset(DATA)
    assert data.kind == "simbev"
    require_truth(data, json.loads((DATA / "truth.json").read_text()))
    processed, raw = data.sequences
    assert processed.name == "scene_0000"
    # the ego drives north at 8 m/s, frames are 0.05 s apart
    assert processed.ego_xy_yaw()[:2] == pytest.approx(
        np.array([(50.0, 20.0, math.pi / 2), (50.0, 20.4, math.pi / 2)])
    )
    # velocities in the world's axes: the first car drives south
    assert processed.labels is not None
    assert processed.labels.velocity_mps[0] == pytest.approx((0.0, -10.0))
    # the parked car is hit by no point; without post-processing that is not known
    assert [s.labels.ignored.sum() for s in (processed, raw) if s.labels] == [4, 0]
    assert [note.split(",")[0] for note in data.notes] == ["scene_0001: labels without post-processing"]
    assert [len(s.detections) for s in labels_as_detections(data).sequences] == [8, 12]


def test_all_labels_of_the_reference_data() -> None:
    if not REFERENCE.is_dir():
        pytest.skip("SimBEV data are not in ../shared/simbev")
    truth = json.loads((REFERENCE / "truth.json").read_text())
    assert len(truth) == 180
    require_truth(read_dataset(REFERENCE), truth)


@pytest.mark.parametrize("inside", ["simbev", "simbev/infos", "simbev/infos/simbev_infos_val.json"])
def test_the_folder_the_one_in_it_and_a_file_are_recognised(inside: str) -> None:
    data = read_dataset(DATA / inside)
    assert data.kind == "simbev"
    assert [len(s) for s in data.sequences] == [4, 4]


def test_the_time_is_the_frame_s_number_times_the_time_step(folder: Path) -> None:
    configuration = folder / "simbev" / "configs" / "SimBEV-scene-0001.yaml"
    configuration.write_text("warmup: 4\nextra_timestep: 3\ntimestep: 0.1 # seconds\n")
    change(infos(folder), lambda c: frame_of(c, 3).update(frame=7))
    change(infos(folder), lambda c: c["data"]["scene_0001"]["scene_data"].reverse())
    sequence = read_simbev(folder).sequences[1]
    assert sequence.stamp_s == pytest.approx([0.0, 0.1, 0.2, 0.7])
    assert sequence.frame_name == ("0", "1", "2", "7")
    configuration.unlink()
    data = read_simbev(folder)
    assert data.sequences[1].stamp_s == pytest.approx([0.0, 0.05, 0.1, 0.35])
    assert "scene_0001: no timestep in configs: taken as 0.05 s" in data.notes


def test_paths_of_windows_and_the_other_form_are_found(folder: Path) -> None:
    name = label_file(folder).name.replace(".json", ".bin")
    change(infos(folder), lambda c: frame_of(c).update(GT_DET=f"D:\\sets\\simbev\\ground-truth\\det\\{name}"))
    require_truth(read_simbev(folder), json.loads((DATA / "truth.json").read_text()))


@pytest.mark.parametrize(
    ("label", "kind", "category"),
    [
        ({"semantic_tags": [13, 18]}, "motorcycle", "motorcycle"),
        ({"semantic_tags": [18, 13], "class": "rider"}, "motorcycle", "motorcycle"),
        ({"semantic_tags": [13]}, "rider", "cyclist"),
        ({"semantic_tags": [19]}, "bicycle", "cyclist"),
        ({"semantic_tags": [16]}, "bus", "truck"),
        ({"semantic_tags": [15], "class": "car"}, "car", "car"),
        ({"semantic_tags": [14], "class": None}, "car", "car"),
    ],
)
def test_classes_by_post_processing_or_tag(
    folder: Path, label: dict[str, Any], kind: str, category: str
) -> None:
    change(label_file(folder), lambda labels: labels[0].update(label))
    labels = read_simbev(folder).sequences[1].labels
    assert labels is not None
    assert (labels.kind[0], labels.category[0]) == (kind, category)


def test_what_is_no_road_user_and_the_ego_itself_are_left_out(folder: Path) -> None:
    def furnish(labels: list[dict[str, Any]]) -> None:
        light = labels[0] | {"semantic_tags": [7], "id": 1}
        nothing = labels[0] | {"semantic_tags": [], "id": 2}
        tram = labels[0] | {"class": "tram", "id": 3}
        # the ego is at (50, 20)
        own = labels[0] | {
            "id": 4,
            "bounding_box": [[x, y, z] for x in (48, 52) for y in (19, 21) for z in (0, 1)],
        }
        labels += [light, nothing, tram, own]

    change(label_file(folder), furnish)
    data = read_simbev(folder)
    labels = data.sequences[1].labels
    assert labels is not None
    assert labels.object_id[labels.frame == 0].tolist() == [100, 101, 102]
    assert "labels left out: 1 of class 'tram'; give the class a category in classes.csv" in data.notes
    assert "labels left out, for they are no road users: 1 traffic_light, 1 without a class" in data.notes
    assert "1 boxes of the ego itself left out" in data.notes
    (folder / "classes.csv").write_text("class,category\ntram,truck\n")
    assert "truck" in set(read_simbev(folder).sequences[1].labels.category)  # type: ignore[union-attr]


def test_identities_of_64_bits_without_a_sign_stay_apart(folder: Path) -> None:
    path = folder / "simbev/ground-truth/det/SimBEV-scene-0001-frame-0000-GT_DET.bin"
    labels = json.loads(label_file(folder).read_text())
    labels = [label | {"id": 2**64 - 1 - k} for k, label in enumerate(labels)]
    path.write_bytes(pickle.dumps(labels))
    label_file(folder).unlink()
    read = read_simbev(folder).sequences[1].labels
    assert read is not None
    assert read.object_id[:3].tolist() == [2**63 - 1 - k for k in range(3)]


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda c: c.pop("data"), "no object 'data' with scenes by name"),
        (lambda c: c["data"].update(other={}), "scene 'other': expected scene_0000"),
        (lambda c: c["data"].update(scene_0001=[]), "scene 'scene_0001': expected scene_0000 with a list"),
        (lambda c: frame_of(c).pop("frame"), r"scene scene_0001\[0\]: field 'frame' must be a whole number"),
        (lambda c: frame_of(c).update(frame=-1), "field 'frame' must be a whole number from 0"),
        (lambda c: frame_of(c).update(frame=10**9), "field 'frame' must be a whole number from 0"),
        (lambda c: frame_of(c).update(frame=1), "scene scene_0001: frame 1 is there twice"),
        (lambda c: frame_of(c).pop("GT_DET"), "frame 0: field 'GT_DET' must be a path, got None"),
        (lambda c: frame_of(c).update(GT_DET="x/.."), "field 'GT_DET' must be a path"),
        (lambda c: frame_of(c).update(GT_DET="a\0.bin"), "field 'GT_DET' must be a path"),
        (lambda c: frame_of(c).update(GT_DET=300 * "a"), "field 'GT_DET' must be a path"),
        (lambda c: frame_of(c).update(GT_DET="gone.json"), "gone.json: No such file"),
        (lambda c: frame_of(c).update(ego2global_translation=[1, 2]), "must be 3 numbers, got"),
        (lambda c: frame_of(c).update(ego2global_translation=[1, 2, 10**400]), "number out of range"),
        (lambda c: frame_of(c).update(ego2global_rotation=[0, 0, 0, 0]), "must not be 0"),
        (lambda c: frame_of(c).update(ego2global_rotation=["1", 0, 0, 0]), "must be 4 numbers"),
    ],
)
def test_faults_of_scenes_are_one_line(folder: Path, spoil: Change, complaint: str) -> None:
    change(infos(folder), spoil)
    with pytest.raises(DatasetError, match=complaint) as fault:
        read_simbev(folder)
    assert "\n" not in str(fault.value)


@pytest.mark.parametrize(
    ("spoil", "complaint"),
    [
        (lambda labels: labels.insert(0, 7), "label 0: expected an object, got 7"),
        (lambda labels: labels[1].pop("bounding_box"), "label 1: field 'bounding_box' must be 8 x 3 numbers"),
        (lambda labels: labels[0]["bounding_box"].pop(), "field 'bounding_box' must be 8 x 3 numbers"),
        (lambda labels: labels[0].update(linear_velocity=["a", 0, 0]), "'linear_velocity' must be 3 numbers"),
        (lambda labels: labels[0].update(id="x"), "field 'id' must be a whole number"),
        (lambda labels: labels[0].update(id=1.5), "field 'id' must be a whole number"),
        (lambda labels: labels[0].update(id=1e300), "field 'id' must be a whole number"),
        (lambda labels: labels[0].update(semantic_tags=14), "field 'semantic_tags' must be a list"),
        (lambda labels: labels[0].update(semantic_tags=300 * [14]), "field 'semantic_tags' must be a list"),
        (lambda labels: labels[0].update(valid_flag="no"), "field 'valid_flag' must be true or false"),
        (lambda labels: labels.extend(10_000 * labels[:1]), "labels in one frame, 10000 at most expected"),
    ],
)
def test_faults_of_labels_are_one_line(folder: Path, spoil: Change, complaint: str) -> None:
    change(label_file(folder), spoil)
    with pytest.raises(DatasetError, match=complaint) as fault:
        read_simbev(folder)
    assert str(label_file(folder)) in str(fault.value)
    assert "\n" not in str(fault.value)


def test_impossible_boxes_and_missing_velocities_are_no_faults(folder: Path) -> None:
    def spoil(labels: list[dict[str, Any]]) -> None:
        labels[0]["bounding_box"] = 8 * [[1.0, 2.0, 3.0]]
        del labels[1]["linear_velocity"]

    change(label_file(folder), spoil)
    labels = read_simbev(folder).sequences[1].labels
    assert labels is not None
    assert labels.object_id[labels.frame == 0].tolist() == [101, 102]
    assert np.isnan(labels.velocity_mps[0]).all()


@pytest.mark.parametrize("timestep", ["0", "-1", "nan", "fast", "50"])
def test_time_steps_that_are_none(folder: Path, timestep: str) -> None:
    (folder / "simbev/configs/SimBEV-scene-0000.yaml").write_text(f"timestep: {timestep}\n")
    with pytest.raises(DatasetError, match=r"scene-0000.yaml: timestep must be between 0 and 10 s"):
        read_simbev(folder)


class Hostile:
    def __init__(self, path: Path) -> None:
        self.path = path

    def __reduce__(self) -> Any:
        return Path.touch, (self.path,)


def test_a_hostile_label_file_is_one_line_and_nothing_is_run(folder: Path, tmp_path: Path) -> None:
    path = folder / "simbev/ground-truth/det/SimBEV-scene-0000-frame-0002-GT_DET.bin"
    path.write_bytes(pickle.dumps([{"id": Hostile(tmp_path / "made")}]))
    with pytest.raises(DatasetError, match=r"frame-0002-GT_DET.bin: pickle refused: it names pathlib"):
        read_simbev(folder)
    assert not (tmp_path / "made").exists()
    path.write_bytes(b"\x80\x04")
    with pytest.raises(DatasetError, match="pickle refused: cut off"):
        read_simbev(folder)


@pytest.mark.parametrize(
    "changes",
    [
        {"id": [2**20_000]},  # more digits than Python writes
        {"id": np.float64(np.inf)},
        {"id": np.array([1, 2])},
        {"valid_flag": np.array([True, False])},
        {"semantic_tags": np.full(10**5, 14)},
    ],
)
def test_values_that_only_pickles_have_are_one_line(folder: Path, changes: dict[str, Any]) -> None:
    path = folder / "simbev/ground-truth/det/SimBEV-scene-0000-frame-0002-GT_DET.bin"
    label = json.loads(label_file(folder).read_text())[0]
    path.write_bytes(pickle.dumps([label | changes]))
    with pytest.raises(DatasetError, match=rf"label 0: field '{next(iter(changes))}' must be") as fault:
        read_simbev(folder)
    assert len(str(fault.value)) < 400
    assert "\n" not in str(fault.value)


def test_a_scene_in_two_files_and_a_folder_of_nothing(folder: Path, tmp_path: Path) -> None:
    shutil.copy(infos(folder), infos(folder).with_name("simbev_infos_test.json"))
    with pytest.raises(DatasetError, match=r"scene 'scene_0000' is in simbev_infos_test.json as well"):
        read_simbev(folder)
    (tmp_path / "empty").mkdir()
    with pytest.raises(DatasetError, match="no simbev/infos"):
        read_simbev(tmp_path / "empty")


# ---- HD_MAP ------------------------------------------------------------------------------------------------

RADIUS_M, ARC_START_M = 60.0, 230.0
"""The arc of the shipped bend; its start is at (229.813, 2.489), where the heading is 0.25 rad."""
ARC_CENTER_M = np.array([229.8130417529, 2.4888614561]) + RADIUS_M * np.array(
    [-math.sin(0.25), math.cos(0.25)]
)


def on_arc(s_m: float, t_m: float) -> tuple[float, float, float]:
    """x, y and heading of the road at a station on the arc, in closed form."""
    heading = 0.25 + (s_m - ARC_START_M) / RADIUS_M
    x_m, y_m = ARC_CENTER_M + (RADIUS_M - t_m) * np.array([math.sin(heading), -math.cos(heading)])
    return float(x_m), float(y_m), heading


def waypoint(place: tuple[float, float, float], lane: int, s_m: float, **changes: Any) -> dict[str, Any]:
    """A line as CARLA's waypoint gives it: its y and yaw are left-handed, SimBEV negates them."""
    x_m, y_m, heading = place
    carla = {"x": x_m, "y": -y_m, "yaw": -math.degrees(heading)}
    transform = {"x": carla["x"], "y": -carla["y"], "z": 0.0, "yaw": -carla["yaw"]}
    return {"road_id": 1, "section_id": 0, "lane_id": lane, "s": s_m, "transform": transform} | changes


def write_waypoints(folder: Path, lines: list[dict[str, Any]]) -> None:
    target = folder / "simbev/ground-truth/hd_map"
    target.mkdir(exist_ok=True)
    for k, line in enumerate(lines):
        (target / f"SimBEV-scene-0001-frame-{k:04d}-HD_MAP.json").write_text(json.dumps(line))


def test_nearest_lane_is_carla_s_waypoint(folder: Path) -> None:
    network = load_map(shipped_map("urban_bend"))
    lines = [
        waypoint((120.0, -1.75, 0.0), -1, 120.0),
        waypoint((50.0, 1.75, math.pi), 1, 50.0),
        waypoint(on_arc(260.0, -1.75), -1, 260.0),
        waypoint(on_arc(280.0, 1.75), 1, 280.05),
    ]
    write_waypoints(folder, lines)
    assert compare_lanes(folder, network) == compare_lanes(folder / "simbev", network)
    comparison = compare_lanes(folder, network)
    assert (comparison.compared, comparison.differing) == (4, ())


def test_what_the_map_places_elsewhere_is_listed(folder: Path) -> None:
    network = load_map(shipped_map("urban_bend"))
    assert compare_lanes(folder, network).compared == 0  # the lines are not there
    place = (120.0, -1.75, 0.0)
    write_waypoints(
        folder,
        [waypoint(place, 1, 120.0), waypoint(place, -1, 120.2), waypoint(place, -1, 120.0, road_id="1")],
    )
    comparison = compare_lanes(folder, network)
    assert comparison.compared == 3
    assert [text.split(": ", 1)[1] for text in comparison.differing] == [
        "road 1, lane 1, s 120.000 m; the map has road 1, lane -1, s 120.000 m",
        "road 1, lane -1, s 120.200 m; the map has road 1, lane -1, s 120.000 m",
    ]


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"transform": 1}, "expected an object with an object 'transform'"),
        ({"transform": {"x": 1.0, "y": "a"}}, "field 'y' must be a number, got 'a'"),
        ({"road_id": None}, "field 'road_id' must be a number or text"),
        ({"lane_id": 1.5}, "field 'lane_id' must be a whole number, got 1.5"),
        ({"s": None}, "field 's' must be a number, got None"),
    ],
)
def test_faults_of_waypoints(folder: Path, changes: dict[str, Any], complaint: str) -> None:
    write_waypoints(folder, [waypoint((0.0, 0.0, 0.0), -1, 0.0, **changes)])
    with pytest.raises(DatasetError, match=f"frame-0000-HD_MAP.json: {complaint}"):
        compare_lanes(folder, load_map(shipped_map("urban_bend")))
