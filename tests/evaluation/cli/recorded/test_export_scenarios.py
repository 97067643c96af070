"""Runs and drives as scenarios: replayed closed loop, all are where the log has them."""

import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from evaluation.cli import main
from evaluation.results.logs import read_log
from scenarios.catalogue.library import shipped_scenario
from scenarios.drawn.draw import drawn_scenes
from scenarios.openscenario import load
from scenarios.simulation.ends import THROUGH
from scenarios.spec import NO_AEB, RunSpec, simulation_of

ROOT = Path(__file__).parents[4]


def call(monkeypatch: pytest.MonkeyPatch, *arguments: object) -> int:
    """Run the command as the console script does."""
    monkeypatch.setattr(sys, "argv", ["smartmot-eval", *map(str, arguments)])
    with pytest.raises(SystemExit) as stop:
        main()
    return int(stop.value.code or 0)


def rows(log: pd.DataFrame, names: list[str]) -> pd.DataFrame:
    """Ego and others by name and time."""
    log = log[log["kind"].isin(["ego", "actor"])]
    name = ["Ego" if kind == "ego" else names[int(i)] for kind, i in zip(log["kind"], log["id"], strict=True)]
    return log.assign(name=name, time_s=log["time_s"].round(6)).drop_duplicates(["time_s", "name"])


def names_of(path: Path) -> list[str]:
    return [entity.name for entity in load(path).entities if entity.name != "Ego"]


def replayed(path: Path, strategy: str) -> pd.DataFrame:
    """Rows of a run of an exported file."""
    outcome = simulation_of(RunSpec("s", str(path), (), strategy, "physical", "dry", 0.0), THROUGH).run()
    return rows(pd.DataFrame(outcome.log.table()), names_of(path))


def apart_m(logged: pd.DataFrame, again: pd.DataFrame, ego: bool) -> pd.Series:
    """How far the ego, or all others, are from where they were in the log, by name and time."""
    both = logged.merge(again, on=["time_s", "name"], suffixes=("", "_again"))
    both = both[(both["name"] == "Ego") == ego]
    return np.hypot(both["x_m"] - both["x_m_again"], both["y_m"] - both["y_m_again"])


def exported(
    scenario: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, *options: str
) -> tuple[pd.DataFrame, Path]:
    """A run of a scenario, and the file that is made of it."""
    folder, out = tmp_path / "run", tmp_path / "again.xosc"
    assert call(monkeypatch, "run", scenario, "--out", folder, "--no-pictures", "-q", *options) == 0
    assert call(monkeypatch, "export", folder, "--format", "openscenario", "--out", out, "-q") == 0
    [log] = (folder / "logs").iterdir()
    return rows(read_log(log), names_of(scenario)), out


@pytest.mark.parametrize("name", ["crossing", "scenes/hesitating", "scenes/traffic_bend_1", "drawn"])
def test_an_unbraked_run_comes_again(name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    if name == "drawn":
        scenario = Path(drawn_scenes("test", 1, 3, tmp_path / "drawn")[0].file)
    elif "/" in name:
        scenario = ROOT / "scenarios" / f"{name}.xosc"
    else:
        scenario = shipped_scenario(name)
    logged, out = exported(scenario, tmp_path, monkeypatch, "--no-aeb")
    again = replayed(out, NO_AEB)
    count = logged["time_s"].nunique()
    assert apart_m(logged, again, ego=False).max() < 0.01
    assert apart_m(logged, again, ego=True).max() < 0.05
    assert again["time_s"].nunique() >= count - 1  # the log may end at the instant of the contact
    again_map, own_map = load(out).map_path, load(scenario).map_path
    assert again_map is not None
    assert own_map is not None
    assert again_map.samefile(own_map)
    braked = replayed(out, "rectangular")
    assert apart_m(logged, braked, ego=False).max() < 0.01


def test_a_braked_run_comes_again_and_differs_by_the_ego_alone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    logged, out = exported(shipped_scenario("crossing"), tmp_path, monkeypatch, "--strategy", "rectangular")
    again = replayed(out, NO_AEB)
    assert apart_m(logged, again, ego=False).max() < 0.01
    assert apart_m(logged, again, ego=True).max() < 0.05
    assert again["speed_mps"][again["name"] == "Ego"].min() == 0.0


def test_without_its_folder_a_log_is_on_a_plane(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    scenario = shipped_scenario("crossing")
    logged, _ = exported(scenario, tmp_path, monkeypatch, "--no-aeb")
    [log] = (tmp_path / "run" / "logs").iterdir()
    alone, out = tmp_path / "alone.parquet", tmp_path / "alone.xosc"
    alone.write_bytes(log.read_bytes())
    capsys.readouterr()
    assert call(monkeypatch, "export", alone, "--format", "openscenario", "--out", out) == 0
    assert "Only the log is known" in capsys.readouterr().err
    assert load(out).map_path is None
    renamed = logged.assign(name=logged["name"].replace("Target", names_of(out)[0]))
    assert apart_m(renamed, replayed(out, NO_AEB), ego=False).max() < 0.01


def test_a_drive_without_labels_has_tracks(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """A car at 10 m/s; the ego follows 20 m behind it."""
    boxes = "".join(f"{0.1 * k:.1f},{20 + k},0,4.5,1.8,0\n" for k in range(50))
    (tmp_path / "detections.csv").write_text("stamp_s,x_m,y_m,length_m,width_m,yaw_rad\n" + boxes)
    ego = "".join(f"{0.1 * k:.1f},{k},0,0\n" for k in range(50))
    (tmp_path / "ego.csv").write_text("stamp_s,x_m,y_m,yaw_rad\n" + ego)
    out = tmp_path / "drive.xosc"
    assert call(monkeypatch, "export", tmp_path, "--format", "openscenario", "--out", out) == 0
    notes = capsys.readouterr().err
    assert "the others are the tracks of the default tracker" in notes
    assert "a plane without roads" in notes
    assert len(names_of(out)) == 1
    again = replayed(out, NO_AEB)
    ends = again.groupby("name")["x_m"].last()
    assert ends.to_numpy() == pytest.approx([49.0, 69.0], abs=0.1)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("nowhere", "--out", "a.xosc"), "nowhere: no such folder or file"),
        (("nowhere", "--out", "a.xml"), "--out: expected a file FILE.xosc"),
        (("nowhere", "--out", "a.xosc", "--map", "gone.xodr"), "gone.xodr"),
        (("nowhere", "--out", "a.xosc", "--format", "opendrive"), "--format"),
        (("two", "--out", "a.xosc"), "--sequence: two has 2 recordings; name one of: a, b"),
        (("two", "--out", "a.xosc", "--sequence", "a"), "sequence a has no ego poses"),
    ],
)
def test_mistakes_are_one_line(
    arguments: tuple[str, ...],
    message: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("two").mkdir()
    header = "sequence,stamp_s,x_m,y_m,length_m,width_m,yaw_rad\n"
    Path("two/detections.csv").write_text(header + "a,0,1,1,4,2,0\nb,0,1,1,4,2,0\n")
    assert call(monkeypatch, "export", "--format", "openscenario", *arguments) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
