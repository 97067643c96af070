"""The page of a folder that `run` made: every run has its own scenario, map and route."""

from pathlib import Path

import pytest
from typer.testing import CliRunner

from evaluation.cli import app
from evaluation.runs.folder import read_folder
from evaluation.views.frames import frames_of
from smartmot.types import Boxes, EgoState


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    out = tmp_path_factory.mktemp("run")
    options = ["--param", "Ego_speed_kmh=30", "--no-pictures", "--quiet", "--workers", "1"]
    result = CliRunner().invoke(app, ["run", "cpna_paper", *options, "--out", str(out)])
    assert result.exit_code == 0, result.output
    return out


def test_maps_and_areas_are_found_again(folder: Path) -> None:
    read = read_folder(folder)
    assert read.notes == ()
    assert not read.published
    assert {s.strategy.name for s in read.setups.values() if s.strategy} == {"rectangular", "map"}
    assert {s.network.name for s in read.setups.values()} == {"urban_street"}


def test_redrawn_areas_keep_what_the_log_says_was_kept(folder: Path) -> None:
    read = read_folder(folder)
    checked = 0
    for name, setup in read.setups.items():
        assert setup.strategy is not None
        log = read.log(name)
        frames = frames_of(log, setup.strategy)
        assert len(frames.time_s) > 10
        seen = log[log["kind"] == "detection"]
        ego = log[log["kind"] == "ego"].drop_duplicates("time_s").set_index("time_s")
        for time_s, rows in seen.groupby("time_s"):
            here = ego.loc[time_s]
            state = EgoState(float(time_s), here["x_m"], here["y_m"], here["yaw_rad"], here["speed_mps"])
            boxes = Boxes(
                rows[["x_m", "y_m"]].to_numpy(),
                rows[["length_m", "width_m"]].to_numpy(),
                rows["yaw_rad"].to_numpy(),
            )
            kept = setup.strategy.at(state).kept(boxes, rows["category"].to_numpy().astype(str))
            assert kept.tolist() == (rows["label"] == "kept").tolist()
            checked += len(rows)
    assert checked > 50
