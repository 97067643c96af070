"""Sides on the same drives: pairs, occasions and exact tests by hand; the command end to end."""

from __future__ import annotations

import dataclasses
import io
import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from evaluation.metrics.intervals import poisson_mean
from evaluation.studies.comparison_page.page import comparison_content
from evaluation.studies.drive.drive import DriveSpec
from evaluation.studies.drive.measures import DriveEvent, DriveRow, total_of
from evaluation.studies.drive.recordings import Source, data_sets_of
from evaluation.studies.drive.side_by_side.comparison import DriveComparison, items_of, side_by_side
from evaluation.studies.drive.side_by_side.pairs import (
    Side,
    differences_of,
    least_drives,
    occasion_table,
    occasions_of,
    pairs_of,
    told_power,
)
from evaluation.studies.drive.side_by_side.totals import told_exposure, totals_table
from evaluation.studies.drive.study import Options, prepare
from evaluation.studies.drive.verdicts import FALSE, STANDING, UNDECIDED
from scenarios.settings import Settings
from tests.scenarios.recorded import argoverse_log

PATH, RECTANGLE = ("path", "", "paper"), ("rectangular", "", "paper")


def row(side: Side, sequence: str, requests: int, false: int = 0, km: float = 1.0) -> DriveRow:
    strategy, settings, rule = side
    return DriveRow(
        sequence, strategy, rule, settings, "real", "labels", 0, 100, km, 0.1, 2, requests, false,
        requests - false, 0, None if requests else 3.0 / max(km, 1.0), 0, 0, 0, 0.0,
    )  # fmt: skip


def event(
    side: Side, sequence: str, time_s: float, verdict: str = UNDECIDED, kind: str = "emergency"
) -> DriveEvent:
    strategy, settings, rule = side
    return DriveEvent(
        sequence, strategy, rule, settings, kind, time_s, 36.0, 1, "car", 1.0, 10.0, None, 3.0, verdict, "",
        None, "", 0.0, 5.0, 6.0, None, 2.0, True,
    )  # fmt: skip


def spec(strategy: str, rule: str = "paper", **settings: float | str) -> DriveSpec:
    all_settings: Settings = tuple(settings.items())
    return DriveSpec(
        strategy, rule, settings=all_settings if rule == "paper" else (*all_settings, ("rule", rule))
    )


# --- pairs --------------------------------------------------------------------------------------------------


def test_sides_are_paired_that_differ_in_one_thing() -> None:
    specs = [
        spec(strategy, rule, **own)
        for strategy, settings in (
            ("path", [{}]),
            ("map", [{"margin_m": 0.0}, {"margin_m": 1.0}, {"margin_m": 2.0}]),
        )
        for own in settings
        for rule in ("paper", "rss", "r157")
    ]
    pairs = {tuple("/".join(side) for side in pair) for pair in pairs_of(specs)}
    margins = ("margin_m=0", "margin_m=1", "margin_m=2")
    areas = {(f"map/{m}/{r}", f"path//{r}") for m in margins for r in ("paper", "rss", "r157")}
    rules = {
        (f"{s}/{r}", f"{s}/paper") for s in ("path/", *(f"map/{m}" for m in margins)) for r in ("rss", "r157")
    }
    widths = {(f"map/{m}/{r}", f"map/margin_m=0/{r}") for m in margins[1:] for r in ("paper", "rss", "r157")}
    assert pairs == areas | rules | widths


def test_strategies_are_paired_where_what_both_have_is_the_same() -> None:
    specs = [spec(strategy, horizon_s=h) for strategy in ("path", "all") for h in (2.0, 3.0)]
    assert pairs_of(specs) == [
        (("path", "horizon_s=3", "paper"), ("path", "horizon_s=2", "paper")),
        (("all", "horizon_s=2", "paper"), ("path", "horizon_s=2", "paper")),
        (("all", "horizon_s=3", "paper"), ("path", "horizon_s=3", "paper")),
        (("all", "horizon_s=3", "paper"), ("all", "horizon_s=2", "paper")),
    ]


# --- occasions and tests ------------------------------------------------------------------------------------


def test_requests_within_a_horizon_are_one_occasion() -> None:
    events = [
        event(PATH, "a", 1.0), event(PATH, "a", 7.1, FALSE), event(PATH, "b", 1.5),
        event(RECTANGLE, "a", 4.0, FALSE), event(RECTANGLE, "a", 4.1), event(RECTANGLE, "a", 9.0, STANDING),
        event(RECTANGLE, "b", 1.0, kind="warning"),
    ]  # fmt: skip
    occasions = occasions_of(events)
    # 4.0 s is a horizon after 1.0 s and still the same; 4.1 s begins another, which reaches to 7.1 s
    assert [[e.time_s for e in o.events] for o in occasions] == [[1.0, 4.0], [4.1, 7.1], [1.5]]
    assert [o.sides("requests") for o in occasions] == [{PATH, RECTANGLE}, {PATH, RECTANGLE}, {PATH}]
    assert [o.sides("false_activations") for o in occasions] == [{RECTANGLE}, {PATH}, set()]
    table = occasion_table(occasions, [PATH, RECTANGLE], {"": ""})
    assert [line[-2:] for line in table.rows] == [("2 of 2", "all"), ("2 of 2", "all"), ("1 of 2", "path")]


def test_drives_are_the_sample_of_the_exact_test() -> None:
    drives = [f"drive {k}" for k in range(7)]
    counts = {PATH: (5, 1, 1, 1, 1, 1, 0), RECTANGLE: (0, 0, 0, 0, 0, 0, 0)}
    rows = [row(side, name, n, n) for side, c in counts.items() for name, n in zip(drives, c, strict=True)]
    events = [
        event(PATH, name, 10.0 * k, FALSE)
        for name, n in zip(drives, counts[PATH], strict=True)
        for k in range(n)
    ]
    asked, false = differences_of(rows, occasions_of(events), [(PATH, RECTANGLE)])
    for d in (asked, false):
        assert (d.count, d.count_against, d.more, d.fewer, d.equal) == (10, 0, 6, 0, 1)
        assert (d.both, d.only, d.only_against) == (0, 10, 0)
        # six coins that all fall the same way
        assert d.p_value == pytest.approx(2 / 2**6)
        assert d.p_corrected == pytest.approx(2 * 2 / 2**6)  # two questions


@given(st.integers(1, 5000))
def test_so_many_drives_have_to_differ(questions: int) -> None:
    drives = least_drives(questions)
    assert 2 / 2**drives <= 0.05 / questions < 2 / 2 ** (drives - 1)


def test_what_few_drives_decide_is_said() -> None:
    assert least_drives(1) == 6
    assert "None can be decided here" in told_power(2, 40)
    assert told_power(1, 1).startswith("1 drive is the sample: the exact sign test needs 6")
    assert "it would take 11: none of them can be decided" in told_power(7, 40)
    assert told_power(20, 40).endswith("if at least 11 drives differ, all of them the same way.")


# --- rates --------------------------------------------------------------------------------------------------


def test_intervals_of_counts_are_garwoods() -> None:
    # F. Garwood, Biometrika 28 (1936), table: limits of the mean for counts of 0, 1 and 10
    for count, low, high in ((0, 0.0, 3.689), (1, 0.0253, 5.572), (10, 4.795, 18.39)):
        estimate = poisson_mean(count)
        assert (estimate.low, estimate.high) == pytest.approx((low, high), rel=1e-3)
    with pytest.raises(ValueError, match="expected a count, got -1"):
        poisson_mean(-1)


def test_rates_are_counts_over_the_way() -> None:
    of_path = total_of([row(PATH, "a", 1, 1, km=2.0), row(PATH, "b", 0, km=3.0)])
    of_rectangle = total_of([row(RECTANGLE, "a", 0, km=2.0), row(RECTANGLE, "b", 0, km=3.0)])
    table = totals_table([of_path, of_rectangle])
    assert [line[-1] for line in table.rows] == ["0.2 [0.0051, 1.1]", "0 [0, 0.74]"]
    assert "All on the same way: 5.00 km, 12.0 minutes, 4 pedestrians met." in table.caption
    quiet, false = told_exposure([of_path, of_rectangle])
    assert quiet == (
        "No request in 5.00 km (rectangular, paper): with 95 % confidence fewer than 0.6 per km (3 / D)."
    )
    assert false.startswith(
        "1 of 2 sides have false activations, most of them path, paper: 1, which is 0.0051 to 1.1"
    )
    assert told_exposure([total_of([row(PATH, "a", 0, km=0.0)])])[0].startswith("The ego stood all the time")


# --- the study ----------------------------------------------------------------------------------------------


@pytest.fixture
def compared(write: Callable[..., Path], tmp_path: Path) -> DriveComparison:
    (tmp_path / "logs").mkdir()
    for name, left_m in (("a", 0.0), ("b", 1.3)):
        write([(60.0, left_m)], seconds=7.0, name=f"logs/{name}")
    options = Options(Source(tmp_path / "logs"), ("path", "rectangular"), ("paper",), "physical")
    return DriveComparison(options)


def files_of(folder: Path) -> dict[str, bytes]:
    return {
        path.name: path.read_bytes() for path in folder.iterdir() if path.suffix in (".csv", ".md", ".json")
    }


def test_any_number_of_workers_and_any_interruption_write_the_same(
    compared: DriveComparison, tmp_path: Path
) -> None:
    items = compared.items(tmp_path)
    for name, workers in (("one", 1), ("two", 2)):
        (tmp_path / name).mkdir()
        finished, before = compared.carry_out(items, tmp_path / name, compared.journal, workers)
        assert before == 0
        compared.write(tmp_path / name, items, finished)
    first = files_of(tmp_path / "one")
    assert first == files_of(tmp_path / "two")
    journal = tmp_path / "one" / "drives_runs.jsonl"
    journal.write_bytes(b"".join(journal.read_bytes().splitlines(keepends=True)[:3]) + b'{"torn')
    finished, before = compared.carry_out(items, tmp_path / "one", compared.journal, 1)
    assert before == 3
    compared.write(tmp_path / "one", items, finished)
    assert files_of(tmp_path / "one") == first


def test_a_key_holds_recording_settings_and_vehicle(compared: DriveComparison, tmp_path: Path) -> None:
    keys = [item.key for item in compared.items(tmp_path)]
    assert len(set(keys)) == 4
    assert keys == [item.key for item in compared.items(tmp_path)]
    wide = Options(Source(tmp_path / "logs"), ("path",), preset="physical", vary={"corridor_m": (2.0,)})
    assert not {item.key for item in items_of(prepare(wide))} & set(keys)
    ego = tmp_path / "logs" / "a" / "ego.csv"
    ego.write_text(ego.read_text().replace("110.000", "110.001"))
    changed = [item.key for item in compared.items(tmp_path)]
    assert [a == b for a, b in zip(keys, changed, strict=True)] == [False, True, False, True]


def test_pandas_opens_every_table(compared: DriveComparison, tmp_path: Path) -> None:
    items = compared.items(tmp_path)
    finished, _ = compared.carry_out(items, tmp_path, compared.journal, 1)
    tables = {path.name: path for path in compared.write(tmp_path, items, finished)}
    runs, table, events, differences, occasions = (
        pd.read_csv(io.BytesIO(tables[name].read_bytes()))
        for name in ("runs.csv", "table.csv", "events.csv", "differences.csv", "occasions.csv")
    )
    assert len(runs) == 4
    assert runs.groupby("strategy").requests.sum().to_dict() == table.set_index("strategy").requests.to_dict()
    emergencies = events[events.kind == "emergency"]
    assert len(emergencies) == runs.requests.sum() == len(occasions)
    assert set(differences.measure) == {"requests", "false_activations"}
    assert json.loads(tables["compare.json"].read_text())["configuration"]["drives"] == ["a/0", "b/0"]


def test_what_is_left_out_stands_in_the_results(compared: DriveComparison, tmp_path: Path) -> None:
    study = compared.prepared()
    items = items_of(study)
    finished, _ = compared.carry_out(items, tmp_path, compared.journal, 1)
    kept, spent = finished[items[1].key]
    finished[items[1].key] = (dataclasses.replace(kept, off_map=1, stretches=3), spent)
    result = side_by_side(study.specs, items, finished, ("2 sequences without ego poses are left out",))
    result.write(tmp_path, study.specs)
    notes = [
        "2 sequences without ego poses are left out",
        "path, sequence b/0: 1 of 3 stretches of the way run on no driving lane of the map; the rectangle "
        "stands in there",
    ]
    assert json.loads((tmp_path / "compare.json").read_text())["configuration"]["notes"] == notes
    assert "## Notes\n\n" + "".join(f"- {note}\n" for note in notes) in (tmp_path / "table.md").read_text()


def test_what_is_not_compared_is_said(run: Callable[..., Any], tmp_path: Path) -> None:
    folder, out = tmp_path / "logs", tmp_path / "out"
    _, without = (argoverse_log.log(folder / name) for name in ("a", "b"))
    for archive in (without / "map").iterdir():
        archive.unlink()
    (folder / "empty").mkdir()
    done = run("compare", "--drives", folder, "--out", out, "--workers", 1)
    assert done.status == 0, done.err
    for line in (
        "note: no recordings in empty",
        "note: strategy map is left out: sequence b has no map",
    ):
        assert line in done.out
        assert line.removeprefix("note: ") in (out / "table.md").read_text()


def test_data_sets_inside_a_data_set_are_left_out_aloud(write: Callable[..., Path], tmp_path: Path) -> None:
    folder = write([(60.0, 0.0)], seconds=2.0)
    assert data_sets_of(folder, None, None) == ([folder], [])
    argoverse_log.log(folder / "log")
    assert data_sets_of(folder, None, None) == (
        [folder],
        ["recordings in folders inside are left out: log"],
    )


def test_command_compares_on_drives(
    run: Callable[..., Any], write: Callable[..., Path], tmp_path: Path
) -> None:
    data, out = write([(60.0, 0.0)], seconds=7.0), tmp_path / "out"
    asked = (
        "--vary",
        "rule=paper,cascade",
        "--vary",
        "half_width_m=0.5,2.6",
        "--preset",
        "physical",
        "--workers",
        1,
    )
    done = run("compare", "--drives", data, "--strategies", "path,rectangular", "--out", out, *asked)
    assert done.status == 0, done.err
    assert "1 drive is the sample" in " ".join(done.out.split())
    assert len(pd.read_csv(out / "runs.csv")) == 6
    again = run("compare", "--drives", data, "--strategies", "path,rectangular", "--out", out, *asked)
    assert "6 drives, 6 of them from before" in again.out
    shown = run("report", out)
    assert shown.status == 0
    assert "Without logs there are no replays behind the points; compare --drives --logs" in shown.err
    assert (out / "report.html").is_file()
    logged = run(
        "compare", "--drives", data, "--strategies", "path,rectangular", "--out", out, *asked, "--logs"
    )
    assert "logs of 1 of 1 drives by all sides, 300 logs at most" in " ".join(logged.out.split())
    content = comparison_content(out)
    assert content.comparison is not None
    points, views = content.comparison.points, {view.log: view for view in content.runs}
    assert len(points) == len(views) == 6
    assert {line.log for point in points for line in point.lines} == set(views)
    for point in points:  # a point opens the drive of its own rule and area
        (line,) = point.lines
        strategy, rule, *_ = point.name.split(", ")
        assert views[line.log].title.startswith(strategy)
        assert rule in views[line.log].title


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--scenes", "people at the kerb"], "--scenes: has no effect with --drives"),
        (["--weather", "rain"], "--weather: has no effect with --drives"),
        (["--full"], "--full: has no effect with --drives"),
        (["--growth"], "--growth: has no effect with --drives"),
        (["--seeds", "3"], "--seeds: has no effect with --drives"),
        (["--vary", "rate_hz=5"], "--vary rate_hz: means nothing on recorded drives"),
        (["--strategies", "map"], "strategy map: the data have no map"),
    ],
)
def test_command_refuses_in_one_line(
    run: Callable[..., Any], write: Callable[..., Path], tmp_path: Path, arguments: list[str], message: str
) -> None:
    done = run(
        "compare", "--drives", write([(60.0, 0.0)], seconds=2.0), "--out", tmp_path / "out", *arguments
    )
    assert done.status == 2
    assert done.err.startswith(f"smartmot-eval: {message}")
    assert done.err.count("\n") == 1


def test_options_of_drives_need_drives(run: Callable[..., Any], tmp_path: Path) -> None:
    done = run("compare", "--detections", "labels", "--out", tmp_path)
    assert (done.status, done.err) == (
        2,
        "smartmot-eval: --detections: has no effect without --drives; add it\n",
    )
