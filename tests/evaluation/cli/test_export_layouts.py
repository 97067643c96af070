"""Runs and drives written as data sets: what is read again is what the log has."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.cli import main
from evaluation.results.logs import read_log, write_log
from scenarios.recorded.clouds.files import read_cloud
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.layouts.nuscenes import REAR_AXLE_M
from scenarios.recorded.poses import rotation_matrix

FIELD = Path(__file__).parents[2] / "data" / "field" / "runs"
SIMBEV = Path(__file__).parents[2] / "data" / "simbev"
RUN = "cpna_paper_map_dry_none_50kmh_seed0"


def call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Run the command as the console script does."""
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def require_log(folder: Path, log: pd.DataFrame, ahead_m: float = 0.0) -> None:
    """Labels, times and poses of the one scene are those of a log's rows, within 1e-6."""
    [sequence] = read_dataset(folder).sequences
    labels, pose = sequence.labels, sequence.ego_xy_yaw()
    assert labels is not None
    ego = log[(log["kind"] == "ego") & log["time_s"].isin(sequence.stamp_s.round(9))]
    actors = log[(log["kind"] == "actor") & log["time_s"].isin(ego["time_s"])]
    assert len(ego) == len(sequence)
    pose[:, :2] += ahead_m * np.column_stack((np.cos(pose[:, 2]), np.sin(pose[:, 2])))
    assert pose == pytest.approx(ego[["x_m", "y_m", "yaw_rad"]].to_numpy(), abs=1e-6)
    read = np.column_stack((sequence.stamp_s[labels.frame], labels.center_m, labels.size_m, labels.yaw_rad))
    names = ["time_s", "x_m", "y_m", "length_m", "width_m", "yaw_rad"]
    assert read == pytest.approx(actors[names].to_numpy(), abs=1e-6)
    assert labels.category.tolist() == actors["category"].tolist()


@pytest.mark.parametrize(("form", "ahead_m"), [("simbev", 0.0), ("nuscenes", REAR_AXLE_M)])
@pytest.mark.parametrize("source", ["", RUN, f"logs/{RUN}.parquet"])
def test_a_run_is_read_again(
    form: str,
    ahead_m: float,
    source: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    words = ("export", FIELD / "good" / source, "--format", form, "--sensor", "none", "--out", tmp_path)
    assert call(monkeypatch, *words) == 0
    out, error = capsys.readouterr()
    assert out == f"{tmp_path / {'simbev': 'simbev', 'nuscenes': 'v1.0-mini'}[form]}\n"
    assert "no LiDAR: num_lidar_pts is unknown" in error
    log = read_log(FIELD / "good" / "logs" / f"{RUN}.parquet").round({"time_s": 9})
    require_log(tmp_path, log, ahead_m)


def test_the_instant_of_a_contact_is_left_out_and_said(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = tmp_path / "runs"
    words = ("run", FIELD / "good" / "cpna_paper.xosc", "--no-aeb", "--no-pictures", "-q", "--out", runs)
    assert call(monkeypatch, *words) == 0
    words = ("export", runs, "--format", "simbev", "--sensor", "none", "--out", tmp_path)
    assert call(monkeypatch, *words) == 0
    assert "1 instants of contact between two frames are left out" in capsys.readouterr().err
    [log] = (runs / "logs").iterdir()
    require_log(tmp_path, read_log(log).round({"time_s": 9}))


def test_every_run_of_a_folder_is_a_scene_of_one_split(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = tmp_path / "runs"
    shutil.copytree(FIELD / "good", runs)
    table = pd.read_csv(runs / "runs.csv")
    for k in range(3):
        shutil.copy(runs / "logs" / f"{RUN}.parquet", runs / "logs" / f"copy{k}.parquet")
    pd.concat([table.iloc[:1].assign(log=name) for name in (RUN, "copy0", "copy1", "copy2")]).to_csv(
        runs / "runs.csv", index=False
    )
    words = ("export", runs, "--format", "nuscenes", "--sensor", "none", "--seed", 4, "-q", "--out", tmp_path)
    assert call(monkeypatch, *words) == 0
    splits = json.loads((tmp_path / "v1.0-mini" / "splits.json").read_text())
    assert {name: len(scenes) for name, scenes in splits.items()} == {
        "smartmot_train": 2,
        "smartmot_val": 1,
        "smartmot_test": 1,
    }
    assert sorted(scene for scenes in splits.values() for scene in scenes) == [
        f"scene-{k:04d}" for k in range(4)
    ]


def test_a_drive_of_one_layout_in_the_other(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    first, second = tmp_path / "first", tmp_path / "second"
    words = ("export", SIMBEV, "--sequence", "scene_0001", "--format", "nuscenes", "--out", first)
    assert call(monkeypatch, *words, "-q") == 0
    assert call(monkeypatch, "export", first, "--format", "simbev", "--out", second, "-q") == 0
    [read], written = read_dataset(second).sequences, read_dataset(SIMBEV).sequences[1]
    assert read.labels is not None
    assert written.labels is not None
    assert read.labels.center_m == pytest.approx(written.labels.center_m, abs=1e-6)
    assert read.labels.yaw_rad == pytest.approx(written.labels.yaw_rad, abs=1e-6)
    # there and back: the poses are those of the middle again
    assert read.ego_xy_yaw() == pytest.approx(written.ego_xy_yaw(), abs=1e-6)


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("nowhere", "--format", "simbev"), "nowhere: no such folder or file"),
        ((FIELD / "good", "--format", "xml"), "--format: unknown 'xml'; use one of: "),
        ((FIELD / "good" / "nothing", "--format", "simbev"), "nothing: no such folder or file"),
        ((SIMBEV, "--format", "nuscenes", "--sequence", "x"), "--sequence: no 'x'; there are: scene_0000"),
        ((SIMBEV, "--format", "nuscenes", "--sensor", "hdl32"), "--sensor: for runs; no LiDAR is cast along"),
        ((FIELD / "good", "--format", "simbev", "--sensor", "truth"), "--sensor: unknown 'truth'; use"),
        (
            (FIELD / "good", "--format", "simbev", "--sensor", "none", "--min-points", 1),
            "--sensor none: no LiDAR, so neither street nor points",
        ),
        ((FIELD / "good", "--format", "simbev", "--street-seed", 1), "--street-seed: add --street furnished"),
        (
            (FIELD / "good", "--format", "openscenario", "--min-points", 1),
            "--min-points: has no effect with --format",
        ),
    ],
)
def test_mistakes_are_one_line(
    words: tuple[object, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert call(monkeypatch, "export", *words, "--out", tmp_path) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1


def short_runs(folder: Path, seconds: float = 0.5) -> Path:
    """The run of the field folder, of which the log has the last half second."""
    shutil.copytree(FIELD / "good", folder)
    path = folder / "logs" / f"{RUN}.parquet"
    log = read_log(path)
    log = log[log["time_s"] > log["time_s"].max() - seconds - 1e-9]
    write_log(path, {name: log[name].to_numpy() for name in log.columns})
    return folder


def counted_again(folder: Path) -> list[tuple[int, dict[str, object]]]:
    """Points in the box of each label, as SimBEV counts them, and the label."""
    counts = []
    for info in sorted(folder.glob("simbev/infos/*.json")):
        content = json.loads(info.read_text())
        lidar = content["metadata"]["LIDAR"]
        for scene in content["data"].values():
            for frame in scene["scene_data"]:
                xyz = read_cloud(folder / frame["LIDAR"]).cloud.xyz_m.astype(np.float64)
                for at, turn in (
                    (lidar["sensor2ego_translation"], lidar["sensor2ego_rotation"]),
                    (frame["ego2global_translation"], frame["ego2global_rotation"]),
                ):
                    xyz = xyz @ rotation_matrix(np.array(turn)).T + at
                for label in np.load(folder / frame["GT_DET"], allow_pickle=True):
                    corner = label["bounding_box"]
                    edges = corner[[2, 4, 1]] - corner[0]
                    length = np.linalg.norm(edges, axis=1)
                    share = (xyz - corner[0]) @ (edges / length[:, None] ** 2).T
                    counts.append((int(((share >= 0.0) & (share <= 1.0)).all(axis=1).sum()), label))
    return counts


@pytest.mark.parametrize("sensor", ["hdl32", "mid70"])
def test_points_in_simbev_s_boxes_are_those_that_are_written(
    sensor: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    runs = short_runs(tmp_path / "runs")
    words = ("export", runs, "--format", "simbev", "--sensor", sensor, "--street", "furnished", "-q")
    assert call(monkeypatch, *words, "--out", tmp_path) == 0
    labels = counted_again(tmp_path)
    assert len(labels) == {"hdl32": 11, "mid70": 6}[sensor]  # 20 and 10 Hz
    for count, label in labels:
        assert label["num_lidar_pts"] == count > 0
        assert label["valid_flag"] is True
        assert label["num_radar_pts"] == 0
        assert label["class"] == "pedestrian"
        # nearer than 20 m with 40 points or more: SimBEV's own limits
        assert (label["difficulty"] == "easy") == (label["distance_to_ego"] < 20.0 and count >= 40)
    [sequence] = read_dataset(tmp_path).sequences
    assert sequence.labels is not None
    assert len(sequence.labels) == len(labels)


def test_labels_with_few_points_are_left_out_and_counted(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    runs = short_runs(tmp_path / "runs")
    all_of_them, most = tmp_path / "all", tmp_path / "most"
    words = ("export", runs, "--format", "simbev", "--out")
    assert call(monkeypatch, *words, all_of_them, "--min-points", 0) == 0
    assert capsys.readouterr().err == ""
    counts = sorted(count for count, _ in counted_again(all_of_them))
    least = counts[3] + 1
    few = sum(count < least for count in counts)
    assert 0 < few < len(counts)
    assert call(monkeypatch, *words, most, "--min-points", least) == 0
    note = f"{few} of {len(counts)} labels have fewer than {least} points in their box and are left out"
    assert note in capsys.readouterr().err
    assert sorted(count for count, _ in counted_again(most)) == counts[few:]


def test_a_data_set_is_not_mixed_with_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("export", FIELD / "good", "--format", "simbev", "--sensor", "none", "-q", "--out", tmp_path)
    assert call(monkeypatch, *words) == 0
    assert call(monkeypatch, *words) == 2
    assert "is there already; name another folder or remove it" in capsys.readouterr().err
