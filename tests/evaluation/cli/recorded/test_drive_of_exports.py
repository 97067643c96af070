"""A simulated run as a recorded drive: in nuScenes' layout it is the drive that it is in any other."""

from __future__ import annotations

import csv
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.cli.entry import main
from evaluation.results.logs import read_log
from scenarios.recorded.formats import read_dataset
from scenarios.recorded.layouts.nuscenes import REAR_AXLE_M

SCENARIO = Path(__file__).parents[3] / "data" / "field" / "runs" / "good" / "cpna_paper.xosc"


def command(*words: object) -> None:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *map(str, words), "--quiet"])
        with pytest.raises(SystemExit) as stop:
            main()
    assert not stop.value.code, words


def log_of(root: Path) -> pd.DataFrame:
    """The log of the run; it ends with the contact, between two frames."""
    [path] = (root / "runs" / "logs").glob("*.parquet")
    return read_log(path)


@pytest.fixture(scope="module")
def root(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run without brakes, in both layouts, and a drive of each with the outline of the run."""
    root = tmp_path_factory.mktemp("exports")
    command("run", SCENARIO, "--no-aeb", "--no-pictures", "--out", root / "runs")
    ego = log_of(root).query("kind == 'ego'").iloc[0]
    outline = f"{ego['length_m']},{ego['width_m']}"
    # nuScenes has poses of the rear axle
    for form, vehicle in (("nuscenes", f"{outline},{REAR_AXLE_M}"), ("simbev", outline)):
        command("export", root / "runs", "--format", form, "--sensor", "none", "--out", root / form)
        command(
            *("drive", root / form, "--out", root / f"drive_{form}", "--detections", "labels", "--no-page"),
            *("--strategy", "path,all", "--rule", "paper,cascade", "--ego", vehicle),
        )
    return root


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def test_poses_and_labels_are_the_same_in_both_layouts(root: Path) -> None:
    [nuscenes], [simbev] = (read_dataset(root / form).sequences for form in ("nuscenes", "simbev"))
    assert nuscenes.labels is not None
    assert simbev.labels is not None
    count = len(simbev)
    assert len(nuscenes) == count + 1  # SimBEV's frames have one rate: the instant of the contact is left out
    assert nuscenes.stamp_s[:count] == pytest.approx(simbev.stamp_s, abs=1e-6)
    pose = nuscenes.ego_xy_yaw()
    pose[:, :2] += REAR_AXLE_M * np.column_stack((np.cos(pose[:, 2]), np.sin(pose[:, 2])))
    assert pose[:count] == pytest.approx(simbev.ego_xy_yaw(), abs=1e-6)
    labels = nuscenes.labels[nuscenes.labels.frame < count]
    for name in ("frame", "center_m", "size_m", "yaw_rad", "bottom_m", "height_m"):
        assert getattr(labels, name) == pytest.approx(getattr(simbev.labels, name), abs=1e-6), name
    assert labels.category.tolist() == simbev.labels.category.tolist()


def test_requests_are_the_same_in_both_layouts(root: Path) -> None:
    nuscenes, simbev = (rows(root / f"drive_{form}" / "events.csv") for form in ("nuscenes", "simbev"))
    assert len(nuscenes) == len(simbev) >= 4
    for a, b in zip(nuscenes, simbev, strict=True):
        for name in ("strategy", "rule", "kind", "track", "category", "verdict", "covers_stop"):
            assert a[name] == b[name], name
        for name in ("time_s", "speed_kmh", "ttc_s", "gap_m", "stop_s"):
            assert float(a[name]) == pytest.approx(float(b[name]), abs=1e-6), name


def test_requests_agree_with_the_run(root: Path) -> None:
    """It ends with a pedestrian hit: all ask before, and the recording ends too early."""
    ego = log_of(root).query("kind == 'ego'")
    contact_s, speed_kmh = float(ego["time_s"].max()), 3.6 * float(ego["speed_mps"].iloc[0])
    requests = [row for row in rows(root / "drive_nuscenes" / "events.csv") if row["kind"] == "emergency"]
    assert [(row["strategy"], row["rule"]) for row in requests] == [
        ("path", "paper"), ("path", "cascade"), ("all", "paper"), ("all", "cascade"),
    ]  # fmt: skip
    for row in requests:
        ahead_s = contact_s - float(row["time_s"])
        assert 0.5 < ahead_s < 3.0
        assert row["category"] == "pedestrian"
        assert float(row["speed_kmh"]) == pytest.approx(speed_kmh, rel=1e-3)
        # who is hit is met: forecasts are 0.1 s apart, and the sensor errs
        assert float(row["ttc_s"]) == pytest.approx(ahead_s, abs=0.3)
        assert (row["verdict"], row["covers_stop"]) == ("undecided", "false")
        assert float(row["gap_recorded_m"]) == pytest.approx(0.0, abs=1e-3)
    exposure = rows(root / "drive_nuscenes" / "drives.csv")[0]
    assert float(exposure["km"]) == pytest.approx(float(np.ptp(ego["x_m"])) / 1000.0, abs=1e-4)
    assert float(exposure["hours"]) == pytest.approx(float(np.ptp(ego["time_s"])) / 3600.0, abs=1e-6)
    assert exposure["pedestrians"] == "1"
