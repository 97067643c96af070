"""A tracker, a detector and a monitored area of the user's own, through the commands."""

import csv
import json
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from evaluation.cli import main

SOURCE = '''
import numpy as np
import smartmot
from scenarios.sensors import Sensor


class Nobody:
    """Never has a track."""

    def update(self, detections):
        return smartmot.tracks_from_arrays(detections.stamp_s, [], [], [], [], [], [])


def ours():
    return smartmot.Tracker()


def ours_for_recordings():
    return smartmot.Tracker(smartmot.tracker_config("default"))


class Blind(Sensor):
    """Sees nobody."""

    def observe(self, frame, ego, boxes, category, there=None):
        return smartmot.Detections.empty(ego.stamp_s)


class Same(Sensor):
    """As shipped."""


def corridor(scene, preset):
    """The shipped map strategy under another name."""
    return smartmot.MapArea(scene.network, scene.route, preset.map_area)


class Nothing:
    name = "nothing"

    def at(self, ego):
        raise RuntimeError("not today")


def nothing(scene, preset):
    return Nothing()


class Pair:
    def __init__(self, one, other):
        pass


class Late:
    def __init__(self, config, seed):
        pass

    def observe(self, *told):
        return smartmot.Detections.empty(-1.0)
'''


@pytest.fixture
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    (tmp_path / "mine.py").write_text(SOURCE)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", list(sys.path))
    yield tmp_path
    sys.modules.pop("mine", None)


def call(*arguments: str) -> int:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(sys, "argv", ["smartmot-eval", *arguments])
        try:
            main()
        except SystemExit as stop:
            return int(stop.code or 0)
    return 0


def impacts(
    folder: Path, *options: str, command: tuple[str, ...] = ("cpna", "--speeds", "40,80")
) -> list[float]:
    assert call(*command, *options, "--no-pictures", "-q", "--out", "out") == 0
    with (folder / "out" / "runs.csv").open() as file:
        return [float(row["v_impact_kmh"]) for row in csv.DictReader(file)]


def test_without_tracks_or_detections_nobody_brakes(folder: Path) -> None:
    for option in (("--tracker", "mine:Nobody"), ("--detector", "mine:Blind")):
        assert impacts(folder, "--strategy", "map", *option) == pytest.approx([40.0, 80.0])
        stored = json.loads((folder / "out" / "runs.json").read_text())["configuration"]
        assert stored["suite"]["settings"] == {option[0].removeprefix("--"): option[1]}


def test_shipped_objects_under_other_names_change_nothing(folder: Path) -> None:
    """At 80 km/h there is a contact, whose speed depends on every frame before it."""
    usual = impacts(folder, "--strategy", "map")
    assert usual[0] == 0.0 < usual[1]
    assert impacts(folder, "--strategy", "mine:corridor") == usual
    assert impacts(folder, "--strategy", "map", "--detector", "mine:Same") == usual


def test_processes_know_the_objects_as_well(folder: Path) -> None:
    options = ("--strategy", "map", "--tracker", "mine:ours", "--workers")
    alone = impacts(folder, *options, "1")
    assert alone[0] == 0.0 < alone[1]
    assert impacts(folder, *options, "2") == alone


def test_scenario_files_are_run_with_them(folder: Path) -> None:
    command = ("run", "crossing", "--param", "Ego_speed_kmh=40", "--strategy", "map")
    assert impacts(folder, "--tracker", "mine:ours", command=command) == [0.0]
    assert impacts(folder, "--tracker", "mine:Nobody", command=command) == pytest.approx([40.0])


def test_pages_and_pictures_know_the_area(folder: Path) -> None:
    assert call("cpna", "--speeds", "50", "--strategy", "mine:corridor,map", "-q", "--out", "out") == 0
    assert call("report", "out", "-q") == 0
    page = (folder / "out" / "report.html").read_text()
    assert "mine:corridor" in page
    drawn = (folder / "out" / "birdseye.png").stat().st_size
    assert drawn > 10_000


def test_trackers_are_compared_on_the_same_scenes(folder: Path) -> None:
    varied = "tracker=preset,centerpoint,mine:Nobody"
    options = ("--strategies", "map", "--scenes", "two at once", "--seeds", "1", "--vary", varied)
    options += ("--workers", "1")
    assert call("compare", *options, "-q", "--out", "out") == 0
    with (folder / "out" / "table.csv").open() as file:
        rows = {row["settings"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["tracker=preset", "tracker=centerpoint", "tracker=mine:Nobody"]
    share = {name: float(row["avoided"]) for name, row in rows.items()}
    assert share["tracker=preset"] == 1.0
    assert share["tracker=mine:Nobody"] == 0.0


def test_recorded_detections_are_tracked_and_scored_with_it(folder: Path) -> None:
    """A car at 10 m/s, which the tracker that never has a track misses in all ten frames."""
    row = "{t},{id}car,{x},2.0,4.5,1.8,0.0,{score}\n"
    for name, header, own, score in (("detections", "", "", "0.9"), ("labels", "track_id,", "7,", "1.0")):
        lines = [row.format(t=k / 10, x=float(k), id=own, score=score) for k in range(10)]
        text = f"stamp_s,{header}category,x_m,y_m,length_m,width_m,yaw_rad,score\n" + "".join(lines)
        (folder / f"{name}.csv").write_text(text)
    found = {}
    for tracker in ("default", "mine:ours_for_recordings", "mine:Nobody"):
        assert call("mot", ".", "--config", tracker, "-q", "--out", "out") == 0
        tracks = (folder / "out" / "tracks.csv").read_text()
        with (folder / "out" / "metrics.csv").open() as file:
            found[tracker] = tracks, [float(line["mota"]) for line in csv.DictReader(file)]
    assert found["mine:ours_for_recordings"] == found["default"]
    assert set(found["default"][1]) == {100.0}
    assert set(found["mine:Nobody"][1]) == {0.0}


def test_a_changed_source_makes_another_run(folder: Path) -> None:
    """A comparison that goes on where it was must not take the results of a tracker that was rewritten."""
    from evaluation import fingerprint as fingerprint_module
    from evaluation.fingerprint import fingerprint
    from evaluation.runs import RunSpec
    from smartmot import plugins

    def key(module: str, strategy: str, settings: tuple[tuple[str, str], ...]) -> str:
        put = tuple((name, value.format(module)) for name, value in settings)
        named = strategy.format(module)
        return fingerprint(RunSpec("CPNA", "cpna", (), named, "physical", "dry", 50.0, settings=put))

    for strategy, settings in (("map", (("tracker", "{}:Nobody"),)), ("{}:corridor", ())):
        sys.modules.pop("mine", None)
        before = key("mine", strategy, settings)
        assert key("mine", strategy, settings) == before
        source = folder / "mine.py"
        source.write_text(source.read_text() + "\n# rewritten\n")
        fingerprint_module._preset_text.cache_clear()  # as in the next process
        plugins._digest.cache_clear()
        assert key("mine", strategy, settings) != before


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (("--tracker", "best"), "--tracker: unknown 'best'; use one of: preset, ab3dmot, centerpoint"),
        (("--tracker", "mine:Missing"), "mine has no 'Missing'"),
        (("--tracker", "mine:Blind"), "mine:Blind: is called with (), but: missing a required argument"),
        (("--tracker", "builtins:list"), "builtins:list: made list, which has no update()"),
        (("--detector", "sensor"), "--detector: unknown 'sensor'; use one of: preset or package.module:name"),
        (("--detector", "mine:Nobody"), "mine:Nobody: is called with (SensorConfig, int), but: too many"),
        (("--detector", "mine:corridor"), "mine:corridor: AttributeError: 'SensorConfig' object has no"),
        (("--detector", "mine:Pair"), "mine:Pair: made Pair, which has no observe(); see docs/plugins.md"),
        (("--detector", "mine:Late"), "mine:Late: detections of -1 s at 0 s; give them the ego's time"),
        (("--strategy", "map,corridor"), "--strategy: unknown 'corridor'"),
        (("--strategy", "absent:corridor"), "no module 'absent'"),
        (("--strategy", "mine:nothing"), "mine:nothing: RuntimeError: not today ("),
        (("--strategy", "mine:Pair"), "mine:Pair: made Pair, which has no at(); see docs/plugins.md"),
    ],
)
def test_mistakes_are_one_line(
    folder: Path, capfd: pytest.CaptureFixture[str], options: tuple[str, str], told: str
) -> None:
    assert call("cpna", "--speeds", "50", "--no-pictures", "-q", "--out", "out", *options) == 2
    [line] = capfd.readouterr().err.splitlines()
    assert told in line
    assert line.startswith("smartmot-eval: ")
