"""The comparison end to end: measures, resuming after a kill, tables, figures, answers."""

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from evaluation.cli.options import PICTURE_FORMATS
from evaluation.errors import ArgumentError
from evaluation.results.files import ResultsError
from evaluation.runs.execution import FrameTime
from evaluation.runs.journal import RUNS, Journal
from evaluation.studies.compare.answer import answer, best, curves
from evaluation.studies.compare.command import compare
from evaluation.studies.compare.figures import frontier, save
from evaluation.studies.compare.grid import Point, SceneItem, study_runs
from evaluation.studies.compare.measures import RunMeasures, measure
from evaluation.studies.compare.study import SceneStudy, usual_points
from evaluation.studies.compare.table import Summary, summaries, summarise
from scenarios.scenes.scenes import SceneRun, all_scenes

SCENES = ("lane change at road works", "from behind parked cars")


def scene(name: str) -> SceneRun:
    return next(run for run in all_scenes() if run.name.startswith(name))


def one(name: str, point: Point) -> RunMeasures:
    (run,) = study_runs([point], [scene(name)], "physical", ["dry"], 1)
    return measure(run)[0]


STUDY = SceneStudy(("map", "all"), "physical", {"margin_m": (0.0, 1.8)}, scenes=SCENES)


def make(out: Path, **changes: object) -> list[Summary]:
    return compare(dataclasses.replace(STUDY, **changes), out, quiet=True)  # type: ignore[arg-type]


def test_the_forecast_along_the_route_cures_the_false_stop_in_the_60_m_bend() -> None:
    name = "people at the kerb, 60 m bend left, near side, 0.4 m, 50 km/h"
    turn, route = one(name, Point("map")), one(name, Point("map", (("ego_forecast", "path"),)))
    assert turn.false_activation
    assert turn.needless_stop
    assert turn.speed_loss_kmh == pytest.approx(50.0)
    assert not route.false_activation
    assert (route.speed_loss_kmh, route.delay_s) == pytest.approx((0.0, 0.0), abs=1e-4)  # chords of the way


def test_without_braking_there_is_neither_delay_nor_loss() -> None:
    # nobody is in the area of the map on the far side: the ego drives as if nobody was there
    free = one("people at the kerb, straight, far side, 0.4 m, 50 km/h", Point("map"))
    assert (free.speed_loss_kmh, free.delay_s) == pytest.approx((0.0, 0.0), abs=1e-9)
    assert free.distance_m == pytest.approx(free.duration_s * 50 / 3.6, rel=1e-9)
    assert free.tracks_mean == 0.0
    assert free.detections_mean > 1.0


def test_resuming_gives_the_same_and_repeats_nothing(tmp_path: Path) -> None:
    whole, parts = tmp_path / "whole", tmp_path / "parts"
    for folder in (whole, parts):
        folder.mkdir()
    make(whole)
    lines = (whole / RUNS).read_bytes().splitlines(keepends=True)
    # as a kill leaves it: some lines, the last one torn
    (parts / RUNS).write_bytes(b"".join(lines[:4]) + lines[4][:25])
    make(parts)
    names = (
        "runs.csv", "table.csv", "differences.csv", "table.md", "compare.json", "frontier.png",
        "frontier.svg",
    )  # fmt: skip
    for name in names:
        assert (parts / name).read_bytes() == (whole / name).read_bytes(), name
    assert sorted((parts / RUNS).read_bytes().splitlines(keepends=True)) == sorted(lines)


def test_a_killed_comparison_goes_on(tmp_path: Path) -> None:
    arguments = ["--strategies", "all", "--scenes", ",".join(SCENES), "--seeds", "1", "--workers", "2", "-q"]
    out, again = tmp_path / "out", tmp_path / "again"
    start = [sys.executable, "-c", "from evaluation.cli import main; main()", "compare", *arguments]
    with subprocess.Popen([*start, "--out", str(out)]) as first:
        deadline = time.monotonic() + 120.0
        while not (out / RUNS).exists() or not (out / RUNS).read_bytes().count(b"\n"):
            assert time.monotonic() < deadline
            assert first.poll() is None
            time.sleep(0.02)
        os.kill(first.pid, signal.SIGKILL)
    before = (out / RUNS).read_bytes().count(b"\n")
    again.mkdir()
    for folder in (out, again):
        make(folder, strategies=("all",), vary={})
    keys = [json.loads(line)["key"] for line in (out / RUNS).read_text().splitlines()]
    assert before < len(keys) == len(set(keys)) == 3 * 2  # scenes and points
    assert (out / "table.md").read_bytes() == (again / "table.md").read_bytes()
    assert (out / "runs.csv").read_bytes() == (again / "runs.csv").read_bytes()


def test_finished_runs_are_not_carried_out_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    runs = study_runs([Point("all")], [scene("lane change")], "physical", ["dry"], 1)
    first, before = STUDY.carry_out(runs, tmp_path, "", 1)
    assert before == 0

    def never(run: SceneItem) -> tuple[RunMeasures, FrameTime]:
        raise AssertionError(run)

    monkeypatch.setattr("evaluation.studies.compare.study.measure", never)
    second, before = STUDY.carry_out(runs, tmp_path, "", 1)
    assert before == 1
    assert second == first


@pytest.mark.parametrize("text", ["nonsense\n", '{"no": "key"}\n', "[]\n"])
def test_a_file_that_is_no_journal_is_refused(tmp_path: Path, text: str) -> None:
    (tmp_path / RUNS).write_text(text)
    with pytest.raises(ResultsError, match="not a journal"):
        Journal(tmp_path, RunMeasures)


def measured(
    strategy: str, settings: str, must: str, seed: int, bad: bool, standstill: bool = False
) -> RunMeasures:
    nothing = must == "nothing"
    return RunMeasures(
        scene="s", variant="v", must=must, strategy=strategy, settings=settings, preset="physical",
        weather="dry", seed=seed, v_test_kmh=50.0, collided=bad and not nothing,
        v_impact_kmh=20.0 if bad and not nothing else 0.0, score=None if nothing else 2.0,
        band=None if nothing else "orange" if bad else "green", flag_time_s=1.0,
        flag_distance_m=10.0, flag_ttc_s=1.0, end_reason="passed", false_activation=bad and nothing,
        needless_stop=nothing and (bad or standstill), speed_loss_kmh=5.0, delay_s=1.0, distance_m=250.0,
        duration_s=10.0, detections_mean=2.0, tracks_mean=1.0, dropped_share=0.0, min_ttc_s=1.0, max_btn=0.5,
    )  # fmt: skip


def test_summary_counts() -> None:
    runs = [measured("map", "", "brake", seed, seed == 0) for seed in range(4)]
    runs += [measured("map", "", "nothing", seed, seed < 2, standstill=seed == 2) for seed in range(4)]
    row = summarise(runs)
    assert (row.avoided.value, row.avoided.count) == (0.75, 4)
    assert row.v_impact_kmh.value == 5.0
    assert (row.false_activations.value, row.needless_stops.value) == (0.5, 0.75)
    assert row.false_activations_per_km == pytest.approx(2.0)  # 2 stops in 4 x 250 m
    assert row.score_share == 1.0
    assert row.band_share.value == pytest.approx((0.5 + 3) / 4)


def test_the_answer_takes_most_avoided_then_fewest_stops_then_the_least() -> None:
    avoided = {"margin_m=0": 1, "margin_m=1": 2, "margin_m=2": 2, "margin_m=3": 2}
    false = {"margin_m=0": 0, "margin_m=1": 1, "margin_m=2": 1, "margin_m=3": 2}
    runs = [measured("map", s, "brake", k, k >= n) for s, n in avoided.items() for k in range(2)]
    runs += [measured("map", s, "nothing", k, k < n) for s, n in false.items() for k in range(2)]
    points = [Point("map", (("margin_m", float(k)),)) for k in range(4)]
    (curve,) = curves(summaries(runs), points)
    assert curve.values[best(curve)] == 1.0
    (line,) = answer(summaries(runs), points)
    assert (
        "1 m avoids most at the fewest false activations: 2 of 2 collisions avoided, 1 of 2 false activations"
        in line
    )
    assert "0 m: 1 of 2 collisions avoided, 0 of 2 false activations" in line


def test_what_is_not_varied_is_fair() -> None:
    study = dataclasses.replace(STUDY, vary={"margin_m": (1.8,), "way": ("area", "path")})
    settings = [(p.strategy, dict(p.settings)) for p in study.points]
    alike = {"ego_forecast": "path", "standing": "path"}
    assert settings == [
        *(("map", {"margin_m": 1.8, "way": way, **alike}) for way in ("area", "path")),
        *(("all", {"way": way, **alike}) for way in ("area", "path")),
    ]


def test_a_point_without_width_is_a_curve_of_its_own() -> None:
    texts = ("", "margin_m=1", "margin_m=2")
    runs = [measured("map", text, must, 0, False) for text in texts for must in ("brake", "nothing")]
    points = [Point("map"), Point("map", (("margin_m", 1.0),)), Point("map", (("margin_m", 2.0),))]
    assert [curve.values for curve in curves(summaries(runs), points)] == [(), (1.0, 2.0)]
    preset, along = answer(summaries(runs), points)
    assert preset.startswith("map, as the preset has it: ")
    assert along.startswith("map: of 2 values")


def test_usual_points_are_those_of_the_preset() -> None:
    points = [Point("map", (("margin_m", m),)) for m in (0.0, 1.8)] + [
        Point("rectangular", (("half_width_m", 4.0),))
    ]
    assert usual_points(points, "physical") == points[1:]


@pytest.mark.parametrize(("name", "value"), [("margin_m", -1.0), ("range_m", 0.0), ("iou_threshold", 2.0)])
def test_a_value_out_of_range_is_named_with_its_option(tmp_path: Path, name: str, value: float) -> None:
    with pytest.raises(ArgumentError, match=rf"--vary {name}={value:g}: "):
        make(tmp_path, vary={name: (0.5, value)})
    assert list(tmp_path.iterdir()) == []


def test_the_table_tells_differences_and_what_intervals_mean(tmp_path: Path) -> None:
    both = ("rectangular", "map")
    paper = {"margin_m": (1.8,), "ego_forecast": ("ctrv",), "way": ("area",), "standing": ("area",)}
    make(tmp_path, strategies=both, vary=paper, scenes=SCENES[:1], seeds=2)
    text = (tmp_path / "table.md").read_text()
    assert text.count("over the 2 seeds") == 1
    assert text.count("## Over the seeds") == text.count("## Differences") == 1
    named = "ego_forecast=ctrv, way=area, standing=area"
    assert f"| map margin_m=1.8, {named} | rectangular {named} |" in text
    alone = tmp_path / "alone"
    alone.mkdir()
    make(alone, strategies=("all",), vary={"motion": ("ctrv",)}, scenes=SCENES[:1])
    text = (alone / "table.md").read_text()
    assert text.count("With one seed there are none over the seeds.") == 1
    assert "## Over the seeds" not in text
    assert "## Differences" not in text
    assert (alone / "differences.csv").read_text().startswith("weather,strategy,settings,against,")
    # with two strategies between which nothing differs there is no empty table either
    same = tmp_path / "same"
    same.mkdir()
    make(same, strategies=("map", "all"), vary={}, scenes=("car stands in a bend",))
    text = (same / "table.md").read_text()
    assert "the strategies do not differ" in text
    assert "## Differences" not in text


def test_figures_come_in_every_format_and_twice_the_same(tmp_path: Path) -> None:
    rows = summaries([measured("all", "", must, 0, False) for must in ("brake", "nothing")])
    first, second = (
        save(frontier(rows, [Point("all")], "title"), tmp_path / name, PICTURE_FORMATS) for name in "ab"
    )
    assert [path.suffix for path in first] == [".png", ".svg", ".pdf"]
    starts = {".png": b"\x89PNG", ".svg": b"<?xml", ".pdf": b"%PDF"}
    for one, other in zip(first, second, strict=True):
        assert one.read_bytes() == other.read_bytes()
        assert one.read_bytes().startswith(starts[one.suffix])
