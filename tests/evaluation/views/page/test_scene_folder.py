"""A page of scenes in which nothing should happen: what brakes in a bend, and why."""

from pathlib import Path

import pandas as pd
import pytest

from evaluation.results.by_speed import impact_table
from evaluation.results.files import ResultsError
from evaluation.results.rows import read_runs
from evaluation.runs.folder import read_folder
from evaluation.studies.compare.command import logged_groups
from evaluation.studies.compare.study import SceneStudy
from evaluation.studies.logged import LOGGED, log_runs
from evaluation.views.page import charts, page
from evaluation.views.page.summary import score_matrix, verdicts
from scenarios.scenes.scenes import all_scenes

BEND = "people at the kerb, 60 m bend left, near side, 0.4 m, 50 km/h"
CROSSES = "crosses in a bend, 60 m bend left, near side, 40 km/h"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of two scenes, as `compare --logs` keeps them."""
    out = tmp_path_factory.mktemp("scenes")
    study = SceneStudy(("rectangular", "map"), "physical", full=True)
    scenes = [run for run in all_scenes() if run.name in (BEND, CROSSES)]
    log_runs(logged_groups(study, scenes), out)
    return out / LOGGED


def test_unnecessary_braking_is_found_and_explained(folder: Path) -> None:
    content = page.page_content(read_folder(folder))
    accounts = {(view.strategy, view.log.split("_")[0]): view.account for view in content.runs}
    bend = BEND.replace(", ", "-").replace(" ", "-").replace("/", "-")
    rectangle, lanes = accounts["rectangular", bend], accounts["map", bend]
    # the rectangle lies over the sidewalk: the ego follows somebody who stands there, until it stands
    assert (rectangle.kind, rectangle.outcome) == (
        "unnecessary", "unnecessary braking to a standstill"
    )  # fmt: skip
    assert "slows from 50 km/h to a standstill at up to " in rectangle.finding
    assert "who stayed on the sidewalk, without an emergency." in rectangle.finding
    assert rectangle.story[-1].startswith("Stands without an emergency behind ")
    # the map's area holds them in its margin; what makes them a threat is the forecast of the ego
    assert (lanes.kind, lanes.outcome) == ("false", "false activation")
    assert "in the margin of 1.8 m" in lanes.why
    assert "does not know the road: there it is " in lanes.why
    assert "m to the right of where the ego will drive." in lanes.why
    assert "emergency braking from 50 km/h to a standstill" in lanes.finding
    for verdict in content.verdicts:
        assert "unnecessary braking in 1 of 1 run in nothing scenes" in verdict.headline


def test_scenes_are_lines_and_strategies_columns(folder: Path) -> None:
    content = page.page_content(read_folder(folder))
    accounts = {view.log: view.account for view in content.runs}
    matrix = score_matrix(read_runs(folder), accounts)
    assert matrix.columns == ["rectangular", "map"]
    assert [name for name, _ in matrix.lines] == [BEND, CROSSES]
    marks = [[cell.mark if cell else "" for cell in cells] for _, cells in matrix.lines]
    assert marks[0] == ["▼", "!"]
    assert marks[1] == ["✓", "✓"]
    assert content.title == f"{BEND}, {CROSSES}"


def test_the_page_opens_with_the_false_activation_at_its_request(folder: Path) -> None:
    content = page.page_content(read_folder(folder))
    first = content.runs[content.first]
    assert (first.strategy, first.account.outcome) == ("map", "false activation")
    assert first.account.story[first.account.frame].startswith("Emergency brake since")
    assert first.account.story[first.account.frame - 1] == "Follows its lane."
    # the run without an emergency opens where the ego has come to a standstill, and says what is to blame
    waits = next(view.account for view in content.runs if view.account.kind == "unnecessary")
    assert waits.story[waits.frame].startswith("Stands without an emergency")
    assert not waits.story[waits.frame - 5].startswith("Stands")
    assert "inside the rectangle, up to 2.6 m to each side, which knows no lanes" in waits.why
    rectangle = next(verdict for verdict in content.verdicts if verdict.strategy == "rectangular")
    assert "no false activation in 1 run in nothing scenes" in rectangle.headline
    assert rectangle.headline.endswith(", by speed adaptation alone.")


def test_many_scenarios_share_the_diagram_of_their_strategy(folder: Path) -> None:
    results = read_folder(folder)
    logs = {str(name): results.log(str(name)) for name in results.runs["log"]}
    panels = charts.speed_specs(results.runs, logs, many=True)
    assert [title for title, _ in panels] == ["rectangular", "map"]
    for title, spec in panels:
        own = results.runs[(results.runs["strategy"] == title) & results.runs["t0_s"].notna()]
        curves = [trace for trace in spec["data"] if trace["mode"] == "lines"]
        assert {curve["meta"] for curve in curves} == set(own["log"])
        for curve in curves:
            scenario = own.loc[own["log"] == curve["meta"], "scenario"].iloc[0]
            assert curve["hovertemplate"].startswith(f"{scenario}: ")
    # the rectangle's ego waits on the bend: neither an emergency stop nor a contact
    (note,) = panels[0][1]["layout"]["annotations"]
    assert note["text"] == "1 of 2 runs end in neither emergency stop nor contact"


def test_scenarios_as_lines_have_impact_speeds_once(folder: Path) -> None:
    table = page.page_content(read_folder(folder)).table
    assert table == impact_table(read_runs(folder))
    assert len(table.rows) == 2


def test_runs_that_end_alike_are_named(folder: Path) -> None:
    runs = read_runs(folder)
    rows = runs[runs["strategy"] == "map"]
    [bend] = rows.loc[rows["scenario"] == BEND, "log"]
    content = page.page_content(read_folder(folder))
    account = next(view.account for view in content.runs if view.log == bend)
    many = pd.concat(
        [rows[rows["log"] == bend].assign(log=f"log{k}", scenario=f"bend {k}") for k in range(15)]
    )
    titles = {name: f"map, {scenario}" for name, scenario in zip(many["log"], many["scenario"], strict=True)}
    [verdict] = verdicts(many, dict.fromkeys(many["log"], account), titles)
    [reason] = verdict.reasons
    assert reason.log == "log0"
    assert reason.also[:2] == (("log1", "bend 1"), ("log2", "bend 2"))
    assert len(reason.also) + reason.more == 14


def test_the_folder_of_a_comparison_is_refused_by_name(tmp_path: Path) -> None:
    (tmp_path / "compare.json").write_text("{}")
    (tmp_path / "runs.csv").write_text("scene,variant\n")
    with pytest.raises(ResultsError, match="a comparison over scenes without logs; make them with compare"):
        read_folder(tmp_path)
    (tmp_path / "runs").mkdir()
    (tmp_path / "runs" / "runs.csv").write_text("")
    with pytest.raises(ResultsError, match=r"its logged runs are in .*runs"):
        read_folder(tmp_path)


def test_criticality_of_each_run_lies_beside(folder: Path) -> None:
    for log in read_runs(folder)["log"]:
        lines = (folder / "criticality" / f"{log}.csv").read_text().splitlines()
        times = [float(line.split(",")[0]) for line in lines[1:]]
        assert lines[0].startswith("time_s,time_to_collision_s,")
        assert times == sorted(set(times))
        assert len(times) > 50
