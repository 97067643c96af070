"""Recordings damaged on purpose, of every format: refused in one line with the file's name, or counted."""

from __future__ import annotations

import json
import random
import shutil
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pytest
from pyarrow import feather

from benchmarks.fuzz_inputs import BASES, damage_bytes, damage_structure
from scenarios.errors import DatasetError
from scenarios.recorded import textfile
from scenarios.recorded.dataset import Dataset, labels_as_detections
from scenarios.recorded.formats import read_dataset

FORMATS = {
    "CSV": "csv",
    "Parquet": "csv",
    "KITTI": "kitti",
    "nuScenes tables": "nuscenes",
    "Argoverse 2": "argoverse",
    "SimBEV": "simbev",
}
LABEL_FILE = "simbev/ground-truth/det/SimBEV-scene-0001-frame-0000-GT_DET.json"
INFOS = "simbev/infos/simbev_infos_val.json"

Damage = Callable[[Path], object]


@pytest.fixture(scope="session")
def sound(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A sound recording of every format."""
    root = tmp_path_factory.mktemp("sound")
    for base in BASES:
        if base.name in FORMATS:
            (root / base.name).mkdir()
            base.make(root / base.name)
    return root


@pytest.fixture
def copy(sound: Path, tmp_path: Path) -> Callable[[str], Path]:
    """A copy of one of them that can be damaged."""
    return lambda name: Path(shutil.copytree(sound / name, tmp_path / "data"))


def read(folder: Path, name: str) -> Dataset:
    return read_dataset(folder, FORMATS[name])


# --- damage -------------------------------------------------------------------------------------------------


def cut(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2 - 1])


def emptied(path: Path) -> None:
    path.write_bytes(b"")


def folder_instead(path: Path) -> None:
    path.unlink()
    path.mkdir()


def link_to_itself(path: Path) -> None:
    path.unlink()
    path.symlink_to(path.name)


def link_to_nothing(path: Path) -> None:
    path.unlink()
    path.symlink_to("nowhere")


def other_bytes(path: Path) -> None:
    path.write_bytes(b"\xff\xfe\x80" + path.read_bytes())


def nested(path: Path) -> None:
    path.write_text("[" * 100_000 + "]" * 100_000)


def null(path: Path) -> None:
    path.write_text("null")


def field(line: int, column: str, value: str) -> Damage:
    """Another value in a line of a CSV file, the header being line 1."""

    def change(path: Path) -> None:
        rows = [row.split(",") for row in path.read_text().splitlines()]
        rows[line - 1][rows[0].index(column)] = value
        path.write_text("\n".join(map(",".join, rows)) + "\n")

    return change


def text(old: str, new: str) -> Damage:
    def change(path: Path) -> None:
        content = path.read_text()
        assert old in content
        path.write_text(content.replace(old, new))

    return change


def content(change_content: Callable[[Any], object]) -> Damage:
    """Another content of a JSON file."""

    def change(path: Path) -> None:
        values = json.loads(path.read_text())
        change_content(values)
        path.write_text(json.dumps(values))

    return change


def table(change_table: Callable[[pd.DataFrame], pd.DataFrame]) -> Damage:
    """Another table in a Feather file."""
    return lambda path: change_table(pd.read_feather(path)).reset_index(drop=True).to_feather(path)


def scene_frame(values: Any, number: int = 1) -> Any:
    return values["data"]["scene_0001"]["scene_data"][number]


def claims_rows(path: Path) -> None:
    """Every length of 12 rows becomes 1e12."""
    path.write_bytes(path.read_bytes().replace(struct.pack("<q", 12), struct.pack("<q", 10**12)))


# --- whole files --------------------------------------------------------------------------------------------

FILES = {
    "CSV": ("detections.csv", "labels.csv", "ego.csv"),
    "Parquet": ("detections.parquet", "labels.parquet", "ego.parquet"),
    "KITTI": ("detections/Car/0000.txt", "label_02/0000.txt", "ego_pose/0000.txt", "calib/0000.txt",
              "times/0000.txt", "seqmap.txt"),
    "nuScenes tables": ("detections.json", "sample.json", "scene.json", "ego_pose.json", "sensor.json",
                        "sample_data.json", "sample_annotation.json", "instance.json", "category.json"),
    "Argoverse 2": ("annotations.feather", "detections.feather", "city_SE3_egovehicle.feather"),
    "SimBEV": (INFOS, LABEL_FILE, LABEL_FILE.replace("1-frame", "0-frame").replace(".json", ".bin"),
               "simbev/configs/SimBEV-scene-0000.yaml"),
}  # fmt: skip
WHOLE = [(name, file) for name, files in FILES.items() for file in files]
NO_FILES = (folder_instead, link_to_itself, link_to_nothing)


@pytest.mark.parametrize(("name", "file"), WHOLE)
def test_what_is_no_file_is_refused_by_name(name: str, file: str, copy: Callable[[str], Path]) -> None:
    """Also where the file is optional: labels that cannot be read are not labels that are not there."""
    folder = copy(name)
    for k, damage in enumerate((*NO_FILES, other_bytes)):
        damaged = Path(shutil.copytree(folder, folder.with_name(f"damaged{k}")))
        damage(damaged / file)
        with pytest.raises(DatasetError) as error:
            read(damaged, name)
        assert str(damaged) in str(error.value)
        assert Path(file).stem in str(error.value)
        assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("name", "file", "damage"),
    [
        (name, file, damage)
        for name, file in WHOLE
        for damage in (cut, emptied, *((nested, null) if file.endswith(".json") else ()))
        # nothing is detected or labelled; no time step; rows of text can be cut between two
        if not (damage is emptied and file.endswith((".txt", ".yaml")))
        and not (damage is cut and file in ("labels.csv", "seqmap.txt"))
        and not (damage is cut and file.startswith(("detections/", "label_02/", "times/", "ego_pose/")))
        and not (damage is cut and file.startswith("simbev/configs"))
    ],
)
def test_files_that_are_cut_or_empty(
    name: str, file: str, damage: Damage, copy: Callable[[str], Path]
) -> None:
    folder = copy(name)
    damage(folder / file)
    with pytest.raises(DatasetError) as error:
        read(folder, name)
    assert Path(file).name in str(error.value)
    assert "\n" not in str(error.value)


# --- what they say ------------------------------------------------------------------------------------------

REFUSED: list[tuple[str, str, Damage, str]] = [
    ("CSV", "detections.csv", field(3, "stamp_s", "nan"), r"\.csv:3: field 'stamp_s' must be finite"),
    ("CSV", "detections.csv", field(3, "stamp_s", "1e308"), "looks like nanoseconds; give seconds"),
    ("CSV", "detections.csv", field(3, "category", "ufo"), r"\.csv:3: field 'category' must be one"),
    ("CSV", "detections.csv", field(1, "x_m", "y"), "columns missing: x_m"),
    ("CSV", "ego.csv", field(3, "stamp_s", "0.0"), r"ego\.csv:3: times must rise within a sequence"),
    ("CSV", "ego.csv", field(4, "stamp_s", "-1"), r"ego\.csv:4: times must rise within a sequence"),
    ("CSV", "ego.csv", field(3, "x_m", "inf"), r"ego\.csv:3: field 'x_m' must be finite"),
    ("CSV", "ego.csv", text("s,0.3", "s,0.2"), "times must rise"),
    ("CSV", "ego.csv", text("s,0", "t,0"), r"ego\.csv: no poses of sequence 's'"),
    ("CSV", "labels.csv", field(3, "stamp_s", "7.0"), r"ego\.csv: poses from 0 to 0\.3 s do not cover"),
    ("CSV", "labels.csv", field(3, "track_id", "1.5"), r"\.csv:3: field 'track_id' must be a whole number"),
    ("CSV", "labels.csv", field(3, "track_id", "1e300"), r"\.csv:3: field 'track_id' must be below 9e15"),
    ("KITTI", "seqmap.txt", text("000004", "\u00b2"), r"seqmap\.txt:1: expected 'name empty first_frame"),
    ("KITTI", "seqmap.txt", text("000004", "9" * 17), r"seqmap\.txt:1: 9{17} frames, 10000000 at most"),
    ("KITTI", "seqmap.txt", text("000004", "9" * 5000), "expected 'name empty first_frame frames'"),
    ("KITTI", "seqmap.txt", text("0000 e", "../../0000 e"), r"'\.\./\.\./0000' is no name of a sequence"),
    ("KITTI", "seqmap.txt", lambda p: p.write_text(2 * p.read_text()), r":2: sequence '0000' is there twice"),
    ("KITTI", "label_02/0000.txt", text("3 3 Car", "9 3 Car"), r":4: field 'frame' must lie in 0\.\.3"),
    ("KITTI", "ego_pose/0000.txt", text("1 0 0 0 0 1 0 0", "0 0 0 0 0 0 0 0"), "is no part of a rotation"),
    ("nuScenes tables", "ego_pose.json", content(lambda c: c[1].update(rotation=[0, 0, 0, 0])),
     r"ego_pose\.json: 'p1': rotation must not be 0"),
    ("nuScenes tables", "ego_pose.json", content(lambda c: c.pop(1)),
     r"sample_data\.json: scene scene-1: 1 of 4 samples have no key frame .* the first of them 't1'"),
    ("nuScenes tables", "ego_pose.json", content(lambda c: c.append(c[0])), "token 'p0' is there twice"),
    ("nuScenes tables", "scene.json", content(lambda c: c.append({"token": "z", "name": "scene-1"})),
     "scene 'scene-1' is there twice"),
    ("nuScenes tables", "sample.json", content(lambda c: c[3].update(timestamp=1e300)), "give seconds"),
    ("nuScenes tables", "sample_annotation.json", content(lambda c: c[0].update(instance_token="z")),
     r"sample_annotation\.json: instance 'z' is not in instance\.json"),
    ("nuScenes tables", "instance.json", content(lambda c: c[0].update(category_token="z")),
     r"instance\.json: category 'z' is not in category\.json"),
    ("Argoverse 2", "annotations.feather", claims_rows, "more than 50000000 rows"),
    ("Argoverse 2", "annotations.feather", table(lambda t: t.assign(qw=0.0)), r":1: field '\|q\|' must be 1"),
    ("Argoverse 2", "annotations.feather", table(lambda t: t.assign(category="UFO")), "stand in classes.csv"),
    ("Argoverse 2", "annotations.feather", table(lambda t: t.drop(columns="qw")), "columns missing: qw"),
    ("Argoverse 2", "annotations.feather", table(lambda t: t.assign(length_m="long")), "'length_m' must"),
    ("Argoverse 2", "annotations.feather", table(lambda t: t.assign(category="x" * 300)), "200 characters"),
    ("Argoverse 2", "city_SE3_egovehicle.feather", table(lambda t: t.iloc[::-1]), "must rise from row"),
    ("Argoverse 2", "city_SE3_egovehicle.feather", table(lambda t: t.iloc[:2]), "do not cover the boxes"),
    ("Argoverse 2", "city_SE3_egovehicle.feather", table(lambda t: t.assign(tx_m=np.inf)), "must be finite"),
    ("SimBEV", INFOS, content(lambda c: scene_frame(c).update(GT_DET="../../../etc/passwd")),
     r"simbev/ground-truth/det/passwd: No such file"),
    ("SimBEV", INFOS, content(lambda c: scene_frame(c).update(GT_DET="/etc/passwd")),
     r"simbev/ground-truth/det/passwd: No such file"),
    ("SimBEV", INFOS, content(lambda c: scene_frame(c).update(ego2global_rotation=[0] * 4)), "must not be 0"),
    ("SimBEV", INFOS, content(lambda c: scene_frame(c).pop("ego2global_translation")),
     "frame 1: field 'ego2global_translation' must be 3 numbers, got None"),
    ("SimBEV", INFOS, content(lambda c: scene_frame(c).update(frame=0)), "frame 0 is there twice"),
    ("SimBEV", LABEL_FILE, content(lambda c: c[0].update(id=float("inf"))), "'id' must be a whole number"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "file", "damage", "message"), REFUSED)
def test_what_cannot_be_meant_is_refused(
    name: str, file: str, damage: Damage, message: str, copy: Callable[[str], Path]
) -> None:
    folder = copy(name)
    damage(folder / file)
    with pytest.raises(DatasetError, match=message) as error:
        read(folder, name)
    assert "\n" not in str(error.value)
    assert len(str(error.value)) < 400


COUNTED: list[tuple[str, str, Damage, str]] = [
    ("CSV", "labels.csv", field(3, "length_m", "0"), "1 impossible labels left out"),
    ("CSV", "labels.csv", field(3, "width_m", "-2"), "1 impossible labels left out"),
    ("CSV", "labels.csv", field(3, "x_m", "nan"), "1 impossible labels left out"),
    ("CSV", "labels.csv", field(3, "stamp_s", "0.0"),
     "1 labels are of an object that has another label in the same frame"),
    ("KITTI", "label_02/0000.txt", text("1.5 1.8 4.2", "0 0 0"), "4 impossible labels left out"),
    ("nuScenes tables", "sample_annotation.json", content(lambda c: c[0].update(rotation=[0, 0, 0, 0])),
     "1 impossible labels left out"),
    ("nuScenes tables", "sample_annotation.json", content(lambda c: c[0].update(sample_token="z")),
     "1 annotations of samples that are not in sample.json are left out"),
    ("nuScenes tables", "category.json", content(lambda c: c[0].update(name="ufo")),
     "annotations left out, for their category is none of the detection challenge: 4 ufo; give it one in "
     "classes.csv"),
    ("nuScenes tables", "category.json", Path.unlink, "no labels are read: they need category.json as well"),
    ("nuScenes tables", "sensor.json", Path.unlink, "no ego poses are read: they need sensor.json as well"),
    ("nuScenes tables", "sensor.json", content(lambda c: c[0].update(channel="RADAR")),
     "no ego poses: sample_data.json has no key frames of LIDAR_TOP with one"),
    ("Argoverse 2", "annotations.feather", table(lambda t: t.assign(height_m=-1.0)),
     "8 impossible labels left out"),
    ("Argoverse 2", "annotations.feather", table(lambda t: t.assign(category="BOLLARD")),
     "labels left out, for they are no road users: 12 BOLLARD"),
    ("Argoverse 2", "annotations.feather", table(lambda t: t.assign(tz_m=np.inf, height_m=np.inf)),
     "8 impossible labels left out"),
    ("SimBEV", LABEL_FILE, content(lambda c: c[0].update(bounding_box=[[-1e308] * 3, [1e308] * 3] * 4)),
     "1 impossible labels left out"),
    ("SimBEV", LABEL_FILE, content(lambda c: c[0].update(bounding_box=[[0, 0, 0]] * 8)),
     "1 impossible labels left out"),
    ("SimBEV", LABEL_FILE, content(lambda c: [label.update({"class": "ufo"}) for label in c]),
     "labels left out: 3 of class 'ufo'; give the class a category in classes.csv"),
]  # fmt: skip


@pytest.mark.parametrize(("name", "file", "damage", "note"), COUNTED)
def test_what_is_left_out_is_counted(
    name: str, file: str, damage: Damage, note: str, copy: Callable[[str], Path]
) -> None:
    folder = copy(name)
    assert note not in read(folder, name).notes
    damage(folder / file)
    assert note in read(folder, name).notes


def test_velocities_that_cannot_be_are_none(copy: Callable[[str], Path]) -> None:
    folder = copy("SimBEV")
    content(lambda labels: labels[0].update(linear_velocity=[float("inf")] * 3))(folder / LABEL_FILE)
    labels = read(folder, "SimBEV").sequences[1].labels
    assert labels is not None
    assert np.isnan(labels.velocity_mps[0]).all()
    assert np.isfinite(labels.velocity_mps[1:]).all()


def test_labels_in_any_order_are_the_same(copy: Callable[[str], Path]) -> None:
    folder = copy("Argoverse 2")
    before = read(folder, "Argoverse 2").sequences[0].labels
    table(lambda t: t.iloc[::-1])(folder / "annotations.feather")
    after = read(folder, "Argoverse 2").sequences[0].labels
    assert before is not None
    assert after is not None
    order_before, order_after = (np.lexsort((each.object_id, each.frame)) for each in (before, after))
    assert np.array_equal(before.center_m[order_before], after.center_m[order_after])


@pytest.mark.parametrize(
    ("name", "detections"),
    [("CSV", "detections.csv"), ("Parquet", "detections.parquet"), ("KITTI", "detections")],
)
def test_without_a_detector_s_output_there_are_labels_alone(
    name: str, detections: str, copy: Callable[[str], Path]
) -> None:
    folder = copy(name)
    before = read(folder, name).sequences[0]
    gone = folder / detections
    shutil.rmtree(gone) if gone.is_dir() else gone.unlink()
    data = read_dataset(folder)
    assert data.kind == FORMATS[name]
    [sequence] = data.sequences
    assert len(sequence.detections) == 0
    assert sequence.labels is not None
    assert before.labels is not None
    assert before.world_SE3_ego is not None
    assert np.array_equal(sequence.labels.center_m, before.labels.center_m)
    assert np.array_equal(sequence.stamp_s, before.stamp_s)
    assert np.array_equal(sequence.world_SE3_ego, before.world_SE3_ego)
    assert len(labels_as_detections(data).sequences[0].detections) == len(before.labels)


# --- sizes --------------------------------------------------------------------------------------------------


def test_a_file_of_some_bytes_that_holds_a_billion_rows(
    copy: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copy("Argoverse 2")
    path = folder / "annotations.feather"
    names = feather.read_table(path).column_names
    # one bit each in memory while it is written, none in the file
    feather.write_feather(pa.table({name: pa.nulls(10**8) for name in names}), path, compression="lz4")
    assert path.stat().st_size < 10**7
    with pytest.raises(DatasetError, match=r"annotations\.feather: more than 50000000 rows"):
        read(folder, "Argoverse 2")
    monkeypatch.setattr("scenarios.recorded.tables.parquet.MAX_ROWS", 3)
    shutil.rmtree(folder)
    with pytest.raises(DatasetError, match=r"detections\.parquet: 4 rows, 3 at most expected"):
        read(copy("Parquet"), "Parquet")


@pytest.mark.parametrize("name", ["CSV", "Parquet"])
def test_a_text_that_would_fill_the_memory(
    name: str, copy: Callable[[str], Path], monkeypatch: pytest.MonkeyPatch
) -> None:
    folder = copy(name)
    path = folder / FILES[name][0]
    if name == "CSV":
        field(3, "category", "x" * 10_000)(path)
    else:
        frame = pd.read_parquet(path)
        frame.loc[1, "category"] = "x" * 10_000
        frame.to_parquet(path)
    monkeypatch.setattr(textfile, "MAX_TEXT_BYTES", 100_000)
    with pytest.raises(DatasetError, match="column 'category' has a text of 10000 characters") as error:
        read(folder, name)
    assert str(path) in str(error.value)


# --- at random ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", list(FORMATS))
def test_random_damage_ends_in_named_errors(name: str, sound: Path, tmp_path: Path) -> None:
    complaints = []
    for case in range(40):
        rng = random.Random(f"{name} {case}")
        folder = Path(shutil.copytree(sound / name, tmp_path / str(case)))
        files = sorted(path for path in folder.rglob("*") if path.is_file())
        damage = damage_structure if case % 2 else damage_bytes
        if damage is damage_structure:
            files = [path for path in files if path.suffix != ".bin"]
        damage(rng.choice(files), rng)
        try:
            read(folder, name)
        except DatasetError as error:
            complaints.append(str(error))
        shutil.rmtree(folder)
    assert len(complaints) > 5
    assert not any("\n" in complaint for complaint in complaints)
