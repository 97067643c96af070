"""Runs, their records, and what is made of them later."""

import json

import numpy as np
import pytest

from evaluation.report.folder import read_folder
from evaluation.report.scene import read_scene
from evaluation.results import read_log, read_runs


@pytest.fixture(scope="module")
def command():
    import sys

    from evaluation.cli import main

    def call(*words):
        before, sys.argv = sys.argv, ["smartmot-eval", *map(str, words)]
        try:
            with pytest.raises(SystemExit) as stop:
                main()
        finally:
            sys.argv = before
        return stop.value.code

    return call


@pytest.mark.filterwarnings("default")
def test_a_run_cut_off_by_the_time_limit_does_not_count_as_avoided(command, tmp_path):
    """Unbraked at 30 km/h the pedestrian is hit 2.85 s after the lead. With a lead of 70 s the run is cut off at 60 s
    and is written as no contact; nothing in runs.csv, the table or the terminal tells it from an avoided one."""
    command(
        "run",
        "cpna_paper",
        "--param",
        "Ego_speed_kmh=30",
        "--param",
        "Lead_s=70",
        "--no-aeb",
        "--no-pictures",
        "--out",
        tmp_path,
        "-q",
    )
    row = read_runs(tmp_path).iloc[0]
    ended_by_limit = {
        name: row[name] for name in row.index if "end" in name or "limit" in name or "cut" in name
    }
    assert bool(row["collided"]) or ended_by_limit, "no contact, and no column says that the run was cut off"


@pytest.mark.filterwarnings("default")
def test_a_report_explains_with_the_preset_that_made_the_runs(command, tmp_path):
    """`cpna` keys the presets in runs.json by weather, `run` and `ncap` by "preset weather settings"; the report looks
    up the weather alone, so that for the latter it silently takes today's preset of that name."""
    command("run", "crossing", "--strategy", "map", "--no-pictures", "--out", tmp_path, "-q")
    file = tmp_path / "runs.json"
    stored = json.loads(file.read_text())
    for preset in stored["configuration"]["presets"].values():
        preset["brakes"]["max_decel_mps2"] = 3.21
    file.write_text(json.dumps(stored))
    (setting,) = read_folder(tmp_path).settings.values()
    assert setting.preset.brakes.max_decel_mps2 == 3.21


@pytest.mark.filterwarnings("default")
def test_a_log_is_read_by_frames(command, tmp_path):
    """Fails with pandas 3 (allowed by pyproject.toml, installed by the README's second way): Series.to_numpy() is
    read-only there. `smartmot-eval report` and `replay` end in a traceback; with a copy they work."""
    command("cpna", "--speeds", "40", "--strategy", "map", "--no-pictures", "--out", tmp_path, "-q")
    (log,) = (tmp_path / "logs").glob("*.parquet")
    assert len(read_scene(read_log(log), None)) > 10


def test_reading_runs_warns_of_nothing(command, tmp_path):
    """Fails with pandas 3: `float_precision` of read_csv is deprecated (Pandas4Warning)."""
    command("cpna", "--speeds", "10", "--strategy", "map", "--no-pictures", "--out", tmp_path, "-q")
    read_runs(tmp_path)


def test_a_kept_run_is_another_once_its_map_has_changed(monkeypatch, tmp_path):
    """The fingerprint takes up the map only if it is given as parameter `Map`; a map that the scenario names itself
    (crossing, the moving traffic) and catalogs are left out, so that kept runs are taken for those of the new map."""
    import shutil

    from evaluation import fingerprint as f
    from evaluation.runs import RunSpec
    from scenarios.library import DEFINITIONS

    folder = tmp_path / "scenarios"
    shutil.copytree(DEFINITIONS.parent / "maps", folder / "maps")
    shutil.copytree(DEFINITIONS, folder / "definitions")
    file = str(folder / "definitions" / "crossing.xosc")
    spec = RunSpec("x", file, (("Ego_speed_kmh", 50.0),), "map", "physical", "dry", 50.0)
    before = f.fingerprint(spec)
    street = folder / "maps" / "urban_street.xodr"
    street.write_text(street.read_text().replace('a="3.5"', 'a="3.0"'))
    f._digest.cache_clear()
    assert f.fingerprint(spec) != before


def test_two_comparisons_in_one_folder_do_not_spoil_the_journal(tmp_path):
    """A second process that starts while the first has half a line on disk cuts that half off; the rest of the line
    is then appended, and every later start says: remove the file."""
    from evaluation.runs import FrameTime
    from evaluation.study.growth import GrowthRun
    from evaluation.study.journal import Journal

    first = Journal(tmp_path, GrowthRun)
    first.add("k1", GrowthRun("map", 0, 0, 1.0, None, False, 0.0), FrameTime(1, 1.0, 1.0))
    file = first._files[0]
    file.write('{"key": "k2", "strategy": "ma')
    file.flush()
    try:
        Journal(tmp_path, GrowthRun)  # or: is refused, because the folder is in use
    except Exception:
        pass
    file.write('p", "others": 0}\n')
    file.flush()
    assert "k1" in Journal(tmp_path, GrowthRun)._lines


def test_values_of_a_frame_are_checked():
    """Tracks says that it raises ShapeError where shapes disagree; EgoState where a value is not finite."""
    from smartmot import Boxes, EgoState, ShapeError, Tracks

    boxes, z = Boxes(np.zeros((2, 2)), np.ones((2, 2)), np.zeros(2)), np.zeros(2)
    with pytest.raises(ShapeError):
        Tracks(
            0.0,
            np.array([1, 2]),
            boxes,
            np.array(["car"] * 5 + ["elephant"]),
            z,
            np.zeros((2, 0)),
            np.zeros((2, 0, 0)),
            np.zeros((2, 2)),
            z,
            z,
            z,
            np.ones(2, bool),
            np.ones(2, bool),
        )


def test_an_ego_is_finite():
    from smartmot import EgoState, ShapeError

    with pytest.raises(ShapeError):
        EgoState(0.0, 0.0, 0.0, 0.0, 0.0, length_m=np.inf)


def test_both_ways_to_ask_a_route_for_a_pose_agree():
    """At a joint of the path `pose` has the heading before it and `poses` the one after it: 0.4 degrees here."""
    from opendrive import load_map
    from scenarios.scenes.scenes import SCENES
    from smartmot import route_ahead

    network = load_map(SCENES / "maps" / "bend_30.xodr")
    route = route_ahead(network, network.lane_index_of(("1", 0, -1)), 10.0, ahead_m=500.0)
    many = route.poses(route.station_m[1:-1])[1]
    one = np.array([route.pose(float(s))[2] for s in route.station_m[1:-1]])
    np.testing.assert_allclose(many, one, atol=1e-9)
