"""Every Python block of README and docs runs as printed."""

from __future__ import annotations

import csv
import io
import shutil
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest

from opendrive import load_map
from scenarios.catalogue.maps import shipped_map
from scenarios.sensors import SensorConfig
from scenarios.sensors.lidar import MID70
from smartmot import Boxes, Detections, EgoState
from tests.documents.blocks import PAGES, ROOT, python_of
from tests.documents.inputs import run_command

WITH_PYTHON = {page for page in PAGES if python_of(page)}
ELSEWHERE = {
    "docs/gym.md": "tests/evaluation/gym/test_gym.py",
    "docs/python.md": "tests/test_examples.py",
    "docs/queries.md": "tests/evaluation/studies/test_rows.py",
    "docs/rules.md": "tests/smartmot/decision/test_shipped.py",
}
"""Pages whose blocks the tests of their subject run."""


def run_page(page: str, names: dict[str, Any]) -> dict[str, Any]:
    """Run the blocks of a page one after the other; what they define."""
    for number, code in enumerate(python_of(page), 1):
        exec(compile(code, f"{page}, block {number}", "exec"), names)
    return names


@pytest.fixture
def folder(inputs: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Current folder with small inputs under the names of the examples."""
    shutil.copytree(inputs, tmp_path, symlinks=True, dirs_exist_ok=True)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def _detections() -> dict[str, Any]:
    """A frame of one car, as arrays."""
    return {
        "stamp_s": 0.0,
        "center_m": [[10.0, 2.0]],
        "size_m": [[4.5, 1.8]],
        "yaw_rad": [0.0],
        "score": [0.9],
        "category": ["car"],
    }


def _lidar() -> dict[str, Any]:
    """The truth of a crossing, and the cloud of a sensor in it."""
    from scenarios.sensors.lidar import LidarSensor
    from scenarios.spec import RunSpec, simulation_of

    network = load_map(shipped_map("urban_street"))
    spec = RunSpec("crossing", "crossing", (("Ego_speed_kmh", 40.0),), "map", "physical", "dry", 40.0)
    simulation = simulation_of(spec)
    step = simulation.start()
    assert step.frame is not None
    cloud = LidarSensor(MID70, seed=1).measure(simulation.world(), step.frame.ego).cloud
    return {
        "network": network,
        "world": simulation.world(),
        "ego": step.frame.ego,
        "cloud": cloud,
        "mask": np.ones(len(cloud.xyz_m), dtype=bool),
        "load_model": lambda: None,
    }


def _scores() -> dict[str, Any]:
    run = {"scenario": "CPNA", "v_test_kmh": 60.0, "impact_location_percent": 25.0, "v_impact_kmh": 12.5}
    return {"frame": pd.DataFrame([run])}


def _plugins() -> dict[str, Any]:
    boxes = Boxes(np.array([[8.0, 0.0]]), np.ones((1, 2)), np.zeros(1))
    return {
        "detections": Detections(0.0, boxes, [1], ["car"]),
        "ego": EgoState(0.0, 0.0, 0.0, 0.0, 10.0),
    }


def _my_detections() -> Iterator[tuple[Any, ...]]:
    """A car at 5 m/s, in frames of uneven times, and a box that no detector should have made."""
    for stamp_s in (0.0, 0.1, 0.23, 0.3):
        place = [[10.0 + 5.0 * stamp_s, 2.0], [np.nan, 0.0]]
        yield stamp_s, place, [[4.5, 1.8], [1.0, 1.0]], [0.0, 0.0], [0.9, 0.9], ["car", "car"]


def _my_frames() -> Iterator[tuple[Any, ...]]:
    """A pedestrian walks towards the lane and is 11 m ahead of an ego at 8 m/s when the frames end."""
    for k in range(40):
        t = 0.05 * k
        place = np.array([[10.0 + 8.0 * 2.0 + 11.0, -5.5 + 1.4 * t]])
        pose = (10.0 + 8.0 * t, -1.75, 0.0, 8.0)
        size, yaw = np.array([[0.5, 0.6]]), np.array([np.pi / 2])
        yield t, place, size, yaw, np.array([0.9]), np.array(["pedestrian"]), pose


def _tracker_runs(names: dict[str, Any]) -> None:
    assert names["tracks"].track_id.tolist() == [1]
    np.testing.assert_allclose(names["tracks"].velocity_mps, [[5.0, 0.0]], atol=0.1)
    assert names["tracker"].rejected == 4
    # two who pass each other keep their numbers
    nearest, ids = names["Nearest"](), []
    for k in range(20):
        center = np.array([[0.5 * k, 0.0], [9.5 - 0.5 * k, 1.5]])
        boxes = Boxes(center, np.ones((2, 2)), np.zeros(2))
        tracks = nearest.update(Detections(0.1 * k, boxes, np.ones(2), np.full(2, "car")))
        ids.append(tracks.track_id.tolist())
    assert ids == [[1, 2]] * 20


def _chain_brakes(names: dict[str, Any]) -> None:
    assert names["frame"].tracks.track_id.tolist() == [1]
    assert names["frame"].command.emergency
    assert names["outcome"].contact is None
    assert names["outcome"].stop_gap_m > 0


def _stepping_is_running(names: dict[str, Any]) -> None:
    # the last outcome is that of the shipped perception
    assert names["unbraked"].outcome().impact_speed_mps == pytest.approx(40 / 3.6)
    run = names["simulation_of"](names["spec"]).run()
    assert names["outcome"].flag_time_s == run.flag_time_s
    assert names["outcome"].log.table()["x_m"].tobytes() == run.log.table()["x_m"].tobytes()


def _plugin_decides(names: dict[str, Any]) -> None:
    assert not names["frame"].command.emergency  # one detection shows no velocity yet


def _lanes_are_found(names: dict[str, Any]) -> None:
    network, hits = names["network"], names["hits"]
    assert {network.lanes.key[lane][0] for lane in hits.lane} == {"12"}
    assert {network.lanes.lane_type[lane] for lane in hits.lane} == {"driving"}


def _route_leads_to_the_goal(names: dict[str, Any]) -> None:
    keys = [names["network"].lanes.key[lane] for lane in names["route"].lane]
    assert (keys[0][0], keys[-1]) == ("1", ("2", 0, -1))
    assert len(names["frame"]) == len(names["network"].lanes.key)
    assert Path("lanes.glb").stat().st_size > 1000


def _run_ends_braked(names: dict[str, Any]) -> None:
    assert names["run"].contact_time_s is not None  # without brakes
    ego = names["now"].name.tolist().index("Ego")
    assert names["now"].speed_mps[ego] == 0.0


def _scored(names: dict[str, Any]) -> None:
    assert len(names["runs"]) == 2  # by day and by night


def _labels_are_tracked(names: dict[str, Any]) -> None:
    scores = {score.category: score for score in names["scores"]}
    assert set(scores) == {"car", "pedestrian"}
    assert scores["car"].hota > 0.9
    assert names["result"].command is not None


def _noise_is_known(names: dict[str, Any]) -> None:
    assert names["informed"](SensorConfig(position_sigma_m=0.3)).config.filter.position_sigma_m == 0.3


def _clouds_are_seen(names: dict[str, Any]) -> None:
    assert len(names["detections"].score) == len(names["detections"].category)
    assert len(names["row"]) == len(names["measurement"].cloud.xyz_m) > 100


def _results_are_there(names: dict[str, Any]) -> None:
    assert set(names["runs"]["strategy"]) == {"rectangular", "map"}
    assert "ego" in set(names["log"]["kind"])


CHECKS: dict[str, tuple[Callable[[], dict[str, Any]], Callable[[dict[str, Any]], None] | None]] = {
    "docs/errors.md": (dict, _noise_is_known),
    "docs/formats.md": (dict, None),
    "docs/howto/aeb.md": (lambda: {"my_frames": _my_frames}, _chain_brakes),
    "docs/howto/maps.md": (dict, _lanes_are_found),
    "docs/howto/tracking.md": (lambda: {"my_detections": _my_detections}, _tracker_runs),
    "docs/learned.md": (dict, None),
    "docs/lidar.md": (_lidar, _clouds_are_seen),
    "docs/mcap.md": (dict, None),
    "docs/mot.md": (dict, _labels_are_tracked),
    "docs/maps.md": (dict, _route_leads_to_the_goal),
    "docs/openscenario.md": (dict, _run_ends_braked),
    "docs/osi.md": (dict, None),
    "docs/plugins.md": (_plugins, _plugin_decides),
    "docs/scoring.md": (_scores, _scored),
    "docs/simulation.md": (dict, _stepping_is_running),
    "docs/start.md": (dict, _results_are_there),
    "docs/tracking.md": (_detections, None),
}
"""What a page's blocks are given, and what must have come out; None: that they run."""


def test_every_page_with_python_has_a_test() -> None:
    assert CHECKS.keys() | ELSEWHERE.keys() == WITH_PYTHON
    for page, test in ELSEWHERE.items():
        text = (ROOT / test).read_text(encoding="utf-8")
        assert "exec(" in text
        assert Path(page).name in text


@pytest.mark.parametrize("page", sorted(CHECKS))
def test_blocks_run_as_printed(page: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    given, check = CHECKS[page]
    if page in ("docs/start.md", "docs/mcap.md", "docs/osi.md"):
        for words in (
            ["cpna", "--speeds", "40", "--quiet", "--no-pictures"],
            ["replay", "results/cpna/CPNA_map_dry_none_40kmh_seed0", "--mcap", "run.mcap"],
            ["replay", "results/cpna/CPNA_map_dry_none_40kmh_seed0", "--osi", "run.osi"],
        ):
            assert run_command(monkeypatch, words) == 0
    names = run_page(page, given())
    if check is not None:
        check(names)


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
        words = ["cpna", "--speeds", "40", "--no-pictures", "-q", "--out", "out", *options]
        monkeypatch.setattr(sys, "argv", ["smartmot-eval", *words])
        with pytest.raises(SystemExit) as stop:
            main()
        assert not stop.value.code
        [row] = csv.DictReader(io.StringIO((tmp_path / "out" / "runs.csv").read_text()))
        return row, pd.read_parquet(tmp_path / "out" / "logs" / f"{row['log']}.parquet")

    return run


def test_the_objects_of_the_documentation_run_as_printed(cpna: Callable[..., Run]) -> None:
    misses, sensors, corridor, rule, _ = python_of("docs/plugins.md")
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


def test_the_tracker_of_the_documentation_brakes_as_printed(cpna: Callable[..., Run]) -> None:
    row, _ = cpna(
        "my_tracker",
        python_of("docs/howto/tracking.md")[1],
        "--strategy",
        "map",
        "--tracker",
        "my_tracker:Nearest",
    )
    assert float(row["v_impact_kmh"]) == 0.0
    assert float(row["stop_gap_m"]) > 0.0
