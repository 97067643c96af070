"""Runs and drives written as data sets: what is read again is what the log has."""

import json
import shutil
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.cli import main
from evaluation.results.logs import read_log
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.layouts.nuscenes import REAR_AXLE_M

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
    assert call(monkeypatch, "export", FIELD / "good" / source, "--format", form, "--out", tmp_path) == 0
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
    assert call(monkeypatch, "export", runs, "--format", "simbev", "--out", tmp_path) == 0
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
    words = ("export", runs, "--format", "nuscenes", "--seed", 4, "-q", "--out", tmp_path)
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


def test_a_data_set_is_not_mixed_with_another(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    words = ("export", FIELD / "good", "--format", "simbev", "-q", "--out", tmp_path)
    assert call(monkeypatch, *words) == 0
    assert call(monkeypatch, *words) == 2
    assert "is there already; name another folder or remove it" in capsys.readouterr().err
