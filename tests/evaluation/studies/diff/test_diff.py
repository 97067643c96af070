"""Tests for two folders of results side by side: each planted change is named, and nothing else."""

from __future__ import annotations

import csv
import json
import shutil
import sys
from dataclasses import replace
from pathlib import Path

import pytest

from evaluation.results.files import ResultsError
from evaluation.runs.cpna import CpnaSuite
from evaluation.runs.specs import Conditions
from evaluation.studies.diff.difference import Difference, difference, sides_of_difference
from evaluation.studies.diff.report import summary, tables, write_report
from evaluation.studies.diff.results import SEVERITY, Results, read_results
from evaluation.studies.suite import compare_cpna, compare_files
from scenarios.catalogue.library import scenario_path
from scenarios.catalogue.maps import shipped_map
from scenarios.spec import RunSpec
from tests.evaluation.cli.test_command import Command, command  # noqa: F401

REPORTS = Path(__file__).parents[4] / "reports"
SPEEDS = (50.0, 60.0)


def cpna(out: Path, **conditions: object) -> Path:
    """A folder of the paper's test at two speeds."""
    compare_cpna(CpnaSuite(SPEEDS, Conditions(("map",), **conditions)), out, None, quiet=True)  # type: ignore[arg-type]
    return out


@pytest.fixture(scope="module")
def base(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return cpna(tmp_path_factory.mktemp("base") / "results", preset="paper")


def compared(first: Path, second: Path) -> Difference:
    return difference(read_results(first), read_results(second))


def changes(found: Difference) -> set[tuple[str, str]]:
    return {(change.kind, change.name) for change in found.changes}


def test_equal_folders_differ_in_nothing(base: Path, tmp_path: Path) -> None:
    moved = tmp_path / "elsewhere" / "deep" / "copy"
    shutil.copytree(base, moved)
    found = compared(base, moved)
    assert len(found.pairs) == len(SPEEDS)
    assert (found.changes, found.only_first, found.only_second, found.differing) == ((), (), (), [])
    assert [title for title, _ in tables(found)] == ["Outcomes, runs in both folders"]


def test_a_changed_condition_is_named_with_what_it_changes(base: Path, tmp_path: Path) -> None:
    found = compared(base, cpna(tmp_path / "new", preset="paper", weather=("rain",)))
    kinds = {kind for kind, _ in changes(found)}
    assert ("run", "weather") in changes(found)
    assert ("preset", "brakes.max_decel_mps2") in changes(found)
    assert kinds <= {"run", "preset", "weather"}
    assert all(change.runs == len(SPEEDS) for change in found.changes)
    assert len(found.differing) == len(SPEEDS)


def test_a_changed_setting_is_named(base: Path, tmp_path: Path) -> None:
    found = compared(base, cpna(tmp_path / "new", preset="paper", settings=(("margin_m", 0.0),)))
    assert ("setting", "margin_m") in changes(found)
    assert ("preset", "map_area.vru_margin_m") in changes(found)


def test_another_strategy_is_a_change_and_no_other_run(tmp_path: Path, base: Path) -> None:
    suite = CpnaSuite(SPEEDS, Conditions(("rectangular",), "paper"))
    compare_cpna(suite, tmp_path / "new", None, quiet=True)
    found = compared(base, tmp_path / "new")
    assert changes(found) == {("run", "strategy")}
    # table I of the paper: the rectangle sees the pedestrian too late at 50 and 60 km/h, the map does not
    flips = [(pair.name, pair.first.outcome, pair.second.outcome, pair.is_worse) for pair in found.flips]
    assert flips == [("50 km/h", "avoided", "contact", True), ("60 km/h", "avoided", "contact", True)]
    (side,) = sides_of_difference(found)
    assert side.name == "map → rectangular"
    assert (side.values["flips"], side.values["worse"], side.values["better"]) == (2.0, 2.0, 0.0)
    (back,) = sides_of_difference(compared(tmp_path / "new", base))
    assert (back.values["worse"], back.values["better"]) == (0.0, 2.0)


def test_runs_of_one_folder_alone_are_listed(base: Path, tmp_path: Path) -> None:
    suite = CpnaSuite((40.0, 60.0), Conditions(("map",), "paper"))
    compare_cpna(suite, tmp_path / "new", None, quiet=True)
    found = compared(base, tmp_path / "new")
    assert [pair.name for pair in found.pairs] == ["60 km/h"]
    assert (found.only_first, found.only_second) == (("50 km/h",), ("40 km/h",))
    assert found.differing == []


def own_run(folder: Path) -> RunSpec:
    """The paper's test from a file of one's own, on a map of one's own."""
    shipped = scenario_path("cpna_paper")
    (folder / "maps").mkdir(parents=True)
    shutil.copy(shipped_map("urban_street"), folder / "maps" / "street.xodr")
    text = shipped.read_text().replace('"catalogs/', f'"{shipped.parent}/catalogs/')
    file = folder / "own.xosc"
    file.write_text(text.replace("../maps/urban_street.xodr", "maps/street.xodr"))
    return RunSpec("own", str(file), (("Ego_speed_kmh", 50.0),), "map", "paper", "dry", 50.0)


def test_a_changed_scenario_and_a_changed_map_are_named(tmp_path: Path) -> None:
    run = own_run(tmp_path / "inputs")
    compare_files([run], tmp_path / "first", None, quiet=True)
    road = tmp_path / "inputs" / "maps" / "street.xodr"
    road.write_text(road.read_text() + "<!-- another -->\n")
    compare_files([run], tmp_path / "second", None, quiet=True)
    found = compared(tmp_path / "first", tmp_path / "second")
    assert changes(found) == {("map", "street.xodr")}
    assert found.differing == []
    file = Path(run.file)
    file.write_text(file.read_text() + "<!-- another -->\n")
    compare_files([run], tmp_path / "third", None, quiet=True)
    assert changes(compared(tmp_path / "second", tmp_path / "third")) == {("scenario", "own.xosc")}


def test_the_same_files_in_another_place_are_no_change(tmp_path: Path) -> None:
    for name in ("first", "second"):
        compare_files([own_run(tmp_path / name / "inputs")], tmp_path / name / "results", None, quiet=True)
    assert compared(tmp_path / "first" / "results", tmp_path / "second" / "results").changes == ()


def test_a_changed_plug_in_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "path", [str(tmp_path), *sys.path])
    own = tmp_path / "diff_own_area.py"
    code = (
        "from smartmot.area import EverythingArea\n\ndef area(view, preset):\n    return EverythingArea()\n"
    )
    own.write_text(code)
    run = replace(own_run(tmp_path / "inputs"), strategy="diff_own_area:area")
    folders = []
    for k in range(2):
        own.write_text(f"{code}# {k}\n")
        monkeypatch.delitem(sys.modules, "diff_own_area", raising=False)
        _forget_plugins()
        folders.append(tmp_path / f"results_{k}")
        compare_files([run], folders[-1], None, quiet=True)
    assert changes(compared(*folders)) == {("plug-in", "diff_own_area:area")}


def _forget_plugins() -> None:
    from smartmot import plugins

    for value in vars(plugins).values():
        if hasattr(value, "cache_clear"):
            value.cache_clear()


def test_comparisons_are_matched_scene_by_scene() -> None:
    found = compared(REPORTS / "frontier_physical", REPORTS / "frontier_paper")
    runs = read_results(REPORTS / "frontier_paper").runs
    assert len(found.pairs) == len(runs)
    assert (found.only_first, found.only_second) == ((), ())
    with (REPORTS / "frontier_paper" / "runs.csv").open() as file:
        rows = list(csv.DictReader(file))
    hits = sum(row["collided"] == "true" for row in rows)
    assert sum(run.outcome == "contact" for run in runs) == hits > 0
    assert ("preset", "brakes.max_decel_mps2") in changes(found)


def test_every_outcome_has_a_severity() -> None:
    for name in ("frontier_physical", "ablation", "paper"):
        assert {run.outcome for run in read_results(REPORTS / name).runs} <= set(SEVERITY)


def test_page_and_tables_say_the_same(base: Path, tmp_path: Path) -> None:
    found = compared(base, cpna(tmp_path / "new", preset="physical"))
    files = {path.name: path for path in write_report(found, tmp_path / "diff")}
    assert set(files) == {"diff.html", "changes.csv", "outcomes.csv"}
    with files["changes.csv"].open() as file:
        listed = {(row["kind"], row["name"]) for row in csv.DictReader(file)}
    assert listed == changes(found)
    with files["outcomes.csv"].open() as file:
        rows = list(csv.DictReader(file))
    assert [row["run"] for row in rows] == [pair.name for pair in found.pairs]
    page = files["diff.html"].read_text()
    assert "http" not in page
    for title, table in tables(found, None):
        assert title in page
        assert all(cell.replace("&", "&amp;") in page for row in table.rows for cell in row)
    assert summary(found) in page


@pytest.mark.parametrize(
    "content", ["{", "[]", '{"schema": 2}', '{"schema": 2, "configuration": {"specs": 3}}']
)
def test_a_damaged_folder_is_refused(base: Path, tmp_path: Path, content: str) -> None:
    shutil.copytree(base, tmp_path / "bad")
    (tmp_path / "bad" / "runs.json").write_text(content)
    with pytest.raises(ResultsError, match=r"runs\.json"):
        read_results(tmp_path / "bad")


def test_a_folder_that_lost_a_run_is_refused(base: Path, tmp_path: Path) -> None:
    shutil.copytree(base, tmp_path / "bad")
    file = tmp_path / "bad" / "runs.json"
    content = json.loads(file.read_text())
    content["configuration"]["specs"].pop()
    file.write_text(json.dumps(content))
    with pytest.raises(ResultsError, match=r"1 runs, and 2 in runs\.csv"):
        read_results(tmp_path / "bad")


def test_folders_of_two_kinds_are_refused(base: Path) -> None:
    with pytest.raises(ResultsError, match="give two of the same command"):
        compared(base, REPORTS / "frontier_paper")


def test_a_folder_without_results_is_refused(tmp_path: Path) -> None:
    for folder in (tmp_path, tmp_path / "missing"):
        with pytest.raises(ResultsError, match=str(folder)):
            read_results(folder)


def test_no_partner_is_an_error(base: Path) -> None:
    ours = read_results(base)
    others = tuple(
        replace(run, identity={**run.identity, "v_test_kmh": 10.0 + k}) for k, run in enumerate(ours.runs)
    )
    with pytest.raises(ResultsError, match="has a partner"):
        difference(ours, Results(base, ours.kind, ours.facts, others))


def test_the_command_fails_on_worse_runs(base: Path, command: Command, tmp_path: Path) -> None:  # noqa: F811
    suite = CpnaSuite(SPEEDS, Conditions(("rectangular",), "paper"))
    compare_cpna(suite, tmp_path / "new", None, quiet=True)
    answer = command("diff", base, tmp_path / "new", "--fail-on", "worse>0", "--junit", "j.xml", "-q")
    assert answer.status == 3
    assert answer.err.startswith("smartmot-eval: failed: map → rectangular: worse 2, fails if > 0: 50 km/h")
    assert Path("j.xml").is_file()
    assert command("diff", tmp_path / "new", base, "--fail-on", "worse>0", "-q").status == 0
    answer = command("diff", base, tmp_path / "missing")
    assert (answer.status, len(answer.err.splitlines())) == (2, 1)
