"""The README's Python runs as printed."""

import csv
import io
import re
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from scenarios.catalogue.maps import shipped_map
from smartmot import Boxes, Detections, EgoState

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"


def _blocks(page: Path = README) -> list[str]:
    return re.findall(r"```python\n(.*?)```", page.read_text(encoding="utf-8"), flags=re.DOTALL)


def test_own_conditions_run_as_printed() -> None:
    names: dict[str, Any] = {}
    exec(_blocks()[3], names)
    assert names["outcome"].contact is None
    assert names["outcome"].stop_gap_m > 0


def test_the_tracker_alone_runs_as_printed() -> None:
    """A car at 5 m/s, in frames of uneven times, and a box that no detector should have made."""

    def my_detections() -> Iterator[tuple[Any, ...]]:
        for stamp_s in (0.0, 0.1, 0.23, 0.3):
            place = [[10.0 + 5.0 * stamp_s, 2.0], [np.nan, 0.0]]
            yield stamp_s, place, [[4.5, 1.8], [1.0, 1.0]], [0.0, 0.0], [0.9, 0.9], ["car", "car"]

    names: dict[str, Any] = {"my_detections": my_detections}
    exec(_blocks()[0], names)
    assert names["tracks"].track_id.tolist() == [1]
    np.testing.assert_allclose(names["tracks"].velocity_mps, [[5.0, 0.0]], atol=0.1)
    assert names["tracker"].rejected == 4


def test_own_detections_run_as_printed() -> None:
    """A pedestrian walks towards the lane and is 11 m ahead of an ego at 8 m/s when the frames end."""

    def my_frames() -> Iterator[tuple[Any, ...]]:
        for k in range(40):
            t = 0.05 * k
            place = np.array([[10.0 + 8.0 * 2.0 + 11.0, -5.5 + 1.4 * t]])
            pose = (10.0 + 8.0 * t, -1.75, 0.0, 8.0)
            size, yaw = np.array([[0.5, 0.6]]), np.array([np.pi / 2])
            yield t, place, size, yaw, np.array([0.9]), np.array(["pedestrian"]), pose

    code = _blocks()[1].replace('"town.xodr"', repr(str(shipped_map("urban_street"))))
    names: dict[str, Any] = {"my_frames": my_frames}
    exec(code, names)
    assert names["frame"].tracks.track_id.tolist() == [1]
    assert names["frame"].command.emergency


Run = tuple[dict[str, str], pd.DataFrame]
"""Row of `runs.csv` and log."""


@pytest.fixture
def cpna(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Callable[..., Run]:
    """A pedestrian at 40 km/h, with a module of the user's in the current folder."""
    from evaluation.cli import main

    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))

    def run(module: str, source: str, *options: str) -> Run:
        (tmp_path / f"{module}.py").write_text(source)
        told = ["cpna", "--speeds", "40", "--no-pictures", "-q", "--out", "out", *options]
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", *told])
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code
        [row] = csv.DictReader(io.StringIO((tmp_path / "out" / "runs.csv").read_text()))
        return row, pd.read_parquet(tmp_path / "out" / "logs" / f"{row['log']}.parquet")

    return run


def test_the_objects_of_the_documentation_run_as_printed(cpna: Callable[..., Run]) -> None:
    misses, sensors, corridor, rule, in_python = _blocks(ROOT / "docs" / "plugins.md")
    _, usual = cpna("my_area", corridor, "--strategy", "my_area:corridor")
    row, log = cpna("my_sensor", misses, "--strategy", "map", "--detector", "my_sensor:Misses")
    seen, all_seen = (int((one["kind"] == "detection").sum()) for one in (log, usual))
    assert float(row["v_impact_kmh"]) == 0.0
    assert 0.4 < seen / all_seen < 0.8
    two, log = cpna("my_sensors", sensors, "--strategy", "map", "--detector", "my_sensors:front_and_round")
    assert float(two["v_impact_kmh"]) == 0.0
    # the front's of 0.0 and 0.1 s come at 0.04 and 0.14 s, with the other's of 0.02 and 0.12 s, which waits
    arrivals = np.unique(log.loc[log["kind"] == "detection", "time_s"])
    assert {0.03, 0.07} <= set(np.round(np.diff(arrivals), 9))
    braked, log = cpna("my_rule", rule, "--strategy", "map", "--rule", "my_rule:TimeToCollision")
    assert float(braked["v_impact_kmh"]) == 0.0
    assert float(braked["flag_time_s"]) != float(row["flag_time_s"])
    assert log.loc[log["kind"] == "event", "label"].tolist() == ["collision"]
    names = {
        "detections": Detections(
            0.0, Boxes(np.array([[8.0, 0.0]]), np.ones((1, 2)), np.zeros(1)), [1], ["car"]
        ),
        "ego": EgoState(0.0, 0.0, 0.0, 0.0, 10.0),
    }
    exec(rule, names)
    exec(in_python, names)
    assert not names["frame"].command.emergency  # one detection shows no velocity yet


def test_stepping_runs_as_printed() -> None:
    by_hand, perceived = _blocks(ROOT / "docs" / "simulation.md")
    names: dict[str, Any] = {}
    exec(by_hand, names)
    assert names["outcome"].contact is None
    assert names["unbraked"].outcome().impact_speed_mps == pytest.approx(40 / 3.6)
    exec(perceived, names)
    run = names["simulation_of"](names["spec"]).run()
    assert names["outcome"].flag_time_s == run.flag_time_s
    assert names["outcome"].log.table()["x_m"].tobytes() == run.log.table()["x_m"].tobytes()


def test_the_tracker_of_the_readme_brakes_as_printed(cpna: Callable[..., Run]) -> None:
    """In closed loop; and two who pass each other keep their numbers."""
    row, _ = cpna("my_tracker", _blocks()[2], "--strategy", "map", "--tracker", "my_tracker:Nearest")
    assert float(row["v_impact_kmh"]) == 0.0
    assert float(row["stop_gap_m"]) > 0.0
    names: dict[str, Any] = {}
    exec(_blocks()[2], names)
    nearest, ids = names["Nearest"](), []
    for k in range(20):
        center = np.array([[0.5 * k, 0.0], [9.5 - 0.5 * k, 1.5]])
        boxes = Boxes(center, np.ones((2, 2)), np.zeros(2))
        ids.append(
            nearest.update(Detections(0.1 * k, boxes, np.ones(2), np.full(2, "car"))).track_id.tolist()
        )
    assert ids == [[1, 2]] * 20


def test_every_command_of_the_readme_is_understood() -> None:
    from typer.testing import CliRunner

    from evaluation.cli import app

    text = README.read_text(encoding="utf-8")
    lines = [line.split()[1:] for line in text.splitlines() if line.startswith("smartmot-eval ")]
    assert len(lines) >= 4
    for command, *rest in lines:
        shown = CliRunner().invoke(app, [command, "--help"], terminal_width=200)
        assert shown.exit_code == 0
        for option in (word for word in rest if word.startswith("--")):
            assert option in shown.output
