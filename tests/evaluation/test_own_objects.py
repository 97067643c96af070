"""A tracker, a detector, a monitored area and a brake rule of the user's own, through the commands."""

import csv
import json
import re
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from evaluation.cli import main

SOURCE = '''
import dataclasses

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


class Fourfold(Sensor):
    """Every detection four times: as it is, with a low score, an unknown name, no width."""

    def observe(self, frame, ego, boxes, category, there=None):
        seen = super().observe(frame, ego, boxes, category, there)
        n = len(seen)
        center = np.repeat(seen.boxes.center_m, 4, axis=0)
        size, yaw = np.repeat(seen.boxes.size_m, 4, axis=0), np.repeat(seen.boxes.yaw_rad, 4)
        score, names = np.ones(4 * n), np.repeat(seen.category, 4).astype("U20")
        score[1::4], names[2::4], size[3::4, 1] = 0.1, "unicorn", 0.0
        found, _ = smartmot.detections_from_arrays(ego.stamp_s, center, size, yaw, score, names)
        return found


class Choosy:
    """A tracker that tells its threshold."""

    score_threshold = 0.5

    def __init__(self):
        self.tracker = smartmot.Tracker()

    def update(self, detections):
        return self.tracker.update(detections)


class Unclear(Choosy):
    score_threshold = "high"


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


class Paper(smartmot.PaperRule):
    """As shipped."""


class Never:
    """Brakes for nothing, and follows nobody."""

    def decide(self, state, now):
        return None, smartmot.Command(False), ()


class Wordless:
    def decide(self, state, now):
        return True


class Breaks:
    def decide(self, state, now):
        return now.track_ids
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
    for option in (("--tracker", "mine:Nobody"), ("--detector", "mine:Blind"), ("--rule", "mine:Never")):
        assert impacts(folder, "--strategy", "map", *option) == pytest.approx([40.0, 80.0])
        stored = json.loads((folder / "out" / "runs.json").read_text())["configuration"]
        assert stored["specs"][0]["settings"] == {option[0].removeprefix("--"): option[1]}


def test_shipped_objects_under_other_names_change_nothing(folder: Path) -> None:
    """At 80 km/h there is a contact, whose speed depends on every frame before it."""
    usual = impacts(folder, "--strategy", "map")
    assert usual[0] == 0.0 < usual[1]
    assert impacts(folder, "--strategy", "mine:corridor") == usual
    assert impacts(folder, "--strategy", "map", "--detector", "mine:Same") == usual
    assert impacts(folder, "--strategy", "map", "--rule", "mine:Paper") == usual
    stored = json.loads((folder / "out" / "runs.json").read_text())["configuration"]
    assert set(stored["plugins"]) == {"mine:Paper"}
    assert impacts(folder, "--strategy", "map", "--rule", "paper") == usual
    stored = json.loads((folder / "out" / "runs.json").read_text())["configuration"]
    assert stored["specs"][0]["settings"] == {}
    aeb = next(iter(stored["presets"].values()))["pipeline"]["aeb"]
    assert list(aeb) == ["braking_factor", "clear_s", "near_m"]


LOW_SCORES = (Path(__file__).parents[1] / "data" / "field" / "runs" / "low_scores.py").read_text()


@pytest.mark.parametrize("tracker", ["preset", "mine:ours", "mine:Choosy"])
def test_with_scores_under_the_threshold_nobody_is_hit_unseen(
    folder: Path, capfd: pytest.CaptureFixture[str], tracker: str
) -> None:
    """Whoever makes the tracker: no result instead of one that looks like a bad brake."""
    (folder / "low_scores.py").write_text(LOW_SCORES)
    command = ("run", "crossing", "--param", "Ego_speed_kmh=40", "--strategy", "map", "--no-pictures", "-q")
    options = ("--detector", "low_scores:LowScores", "--tracker", tracker, "--out", "out")
    assert call(*command, *options) == 2
    [line] = capfd.readouterr().err.splitlines()
    assert "low_scores:LowScores: none of " in line
    assert "highest: 0.25), so that no object would be seen; scale the detector's scores, or give" in line
    assert not (folder / "out" / "runs.csv").exists()
    sys.modules.pop("low_scores", None)


def test_thresholds_relative_to_the_detector_take_any_scale(folder: Path) -> None:
    """The same detector with `default`: the drive is that of a sure one."""
    (folder / "low_scores.py").write_text(LOW_SCORES)
    options = ("--strategy", "map", "--tracker", "default")
    sure = impacts(folder, *options)
    assert impacts(folder, *options, "--detector", "low_scores:LowScores") == sure
    sys.modules.pop("low_scores", None)


PERCENT = """
import numpy as np

from scenarios.sensors import Sensor
from smartmot import detections_from_arrays


class Percent(Sensor):
    def observe(self, frame, ego, boxes, category, there=None):
        seen = super().observe(frame, ego, boxes, category, there)
        score = np.full(len(seen), 87.0)
        boxes = seen.boxes
        return detections_from_arrays(
            seen.stamp_s, boxes.center_m, boxes.size_m, boxes.yaw_rad, score, seen.category
        )[0]
"""


def test_scores_in_percent_are_told_as_what_they_are(folder: Path, capfd: pytest.CaptureFixture[str]) -> None:
    """All are dropped before the tracker: it is said that they are no scores, not that the highest is 0."""
    (folder / "percent.py").write_text(PERCENT)
    command = ("run", "crossing", "--strategy", "map", "--no-pictures", "-q", "--out", "out")
    assert call(*command, "--detector", "percent:Percent") == 2
    [line] = capfd.readouterr().err.splitlines()
    told = re.search(r"none of (\d+) detections .* \((\d+) outside \[0, 1\]\)", line)
    assert told is not None
    assert told[1] == told[2]
    sys.modules.pop("percent", None)


def test_what_perception_drops_is_counted_by_reason_and_said(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Of the four copies of a detection one is left: speeds are those of the shipped detector."""
    usual = impacts(folder, "--strategy", "map")
    options = ("--strategy", "map", "--detector", "mine:Fourfold", "--tracker")
    for tracker in ("preset", "mine:ours"):
        assert impacts(folder, *options, tracker) == usual
        with (folder / "out" / "runs.csv").open() as file:
            for row in csv.DictReader(file):
                count = int(row["detections"])
                assert count > 40
                reasons = [int(row[f"dropped_{reason}"]) for reason in ("score", "category", "box")]
                assert reasons == [count // 4] * 3
    capfd.readouterr()
    command = ("cpna", "--speeds", "40", "--no-pictures", "--out", "out")
    assert call(*command, *options, "preset") == 0
    told = " ".join(capfd.readouterr().out.split())
    assert "in 1 of 1 runs more than a tenth of the detections were dropped" in told
    assert call(*command, "--strategy", "map") == 0
    assert "dropped" not in capfd.readouterr().out


def test_recorded_detections_under_the_threshold_are_counted_and_said(
    folder: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """Ten detections of 0.25 and ten of 0.9; then the ten of 0.25 alone."""
    row = "{t},car,{x},{y},4.5,1.8,0.0,{score}\n"
    header = "stamp_s,category,x_m,y_m,length_m,width_m,yaw_rad,score\n"
    low = [row.format(t=k / 10, x=float(k), y=2.0, score=0.25) for k in range(10)]
    high = [row.format(t=k / 10, x=float(k), y=20.0, score=0.9) for k in range(10)]
    for tracker in ("smartmot", "mine:ours"):
        (folder / "detections.csv").write_text(header + "".join(map("".join, zip(low, high, strict=True))))
        assert call("mot", ".", "--config", tracker, "--out", "out") == 0
        told = " ".join(capfd.readouterr().out.split())
        assert "10 of 20 detections dropped: their scores are under the tracker's threshold" in told
        (folder / "detections.csv").write_text(header + "".join(low))
        assert call("mot", ".", "--config", tracker, "--out", "out") == 0
        told = " ".join(capfd.readouterr().out.split())
        assert "no tracks: none of 10 detections has the score of 0.3 that the tracker needs" in told


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
        rows = {row["settings"].split(", ")[0]: row for row in csv.DictReader(file)}
    assert list(rows) == ["tracker=preset", "tracker=centerpoint", "tracker=mine:Nobody"]
    share = {name: float(row["avoided"]) for name, row in rows.items()}
    assert share["tracker=preset"] == 1.0
    assert share["tracker=mine:Nobody"] == 0.0


def test_recorded_detections_are_tracked_and_scored_with_it(folder: Path) -> None:
    """A car at 10 m/s, which the tracker that never has a track misses in all ten frames."""
    pytest.importorskip("trackeval", reason="trackeval is not installed (extra mot)")
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
    from evaluation.runs import fingerprint as fingerprint_module
    from evaluation.runs.fingerprint import fingerprint
    from scenarios.spec import RunSpec
    from smartmot import plugins

    def key(module: str, strategy: str, settings: tuple[tuple[str, str], ...]) -> str:
        put = tuple((name, value.format(module)) for name, value in settings)
        named = strategy.format(module)
        return fingerprint(RunSpec("CPNA", "crossing", (), named, "physical", "dry", 50.0, settings=put))

    for strategy, settings in (
        ("map", (("tracker", "{}:Nobody"),)),
        ("map", (("rule", "{}:Never"),)),
        ("{}:corridor", ()),
    ):
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
        (("--tracker", "mine:Unclear"), "Unclear: score_threshold must be a number in [0, 1], got 'high'"),
        (("--rule", "mild"), "--rule: unknown 'mild'; use one of: paper, cascade, cascade_gentle, req"),
        (("--rule", "mine:Nobody"), "mine:Nobody: made Nobody, which has no decide(); see docs/plugins.md"),
        (("--rule", "mine:Pair"), "mine:Pair: is called with (), but: missing a required argument"),
        (("--rule", "mine:Wordless"), "frame at 0 s: decide() returned bool; return its state, a smartmot"),
        (("--rule", "mine:Breaks"), "frame at 0 s: AttributeError: 'Assessment' object has no attribute"),
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
