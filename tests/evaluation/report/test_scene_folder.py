"""A page of scenes in which nothing should happen: who stops for nobody in a bend, and why."""

from pathlib import Path

import pytest

from evaluation.report import page
from evaluation.report.folder import read_folder
from evaluation.report.summary import score_matrix
from evaluation.results import read_runs
from evaluation.study.command import CompareOptions, log_runs
from scenarios.scenes.scenes import all_scenes

BEND = "people at the kerb, 60 m bend left, near side, 0.4 m, 50 km/h"
CROSSES = "crosses in a bend, 60 m bend left, near side, 40 km/h"


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Logs of two scenes, as `compare --logs` keeps them."""
    out = tmp_path_factory.mktemp("scenes")
    options = CompareOptions(
        strategies=("rectangular", "map"), vary={}, preset="physical", weather=("dry",), scenes=(), full=True,
        seeds=1, workers=1, out=out, ablation=False, quiet=True, logs=True,
    )  # fmt: skip
    return log_runs(options, [run for run in all_scenes() if run.name in (BEND, CROSSES)])


def test_stops_for_nobody_are_found_and_explained(folder: Path) -> None:
    content = page.page_content(read_folder(folder))
    accounts = {(view.strategy, view.log.split("_")[0]): view.account for view in content.runs}
    bend = BEND.replace(", ", "-").replace(" ", "-").replace("/", "-")
    rectangle, lanes = accounts["rectangular", bend], accounts["map", bend]
    # the rectangle lies over the sidewalk: the ego follows somebody who stands there, until it stands
    assert (rectangle.kind, rectangle.outcome) == ("false", "waits for nobody")
    assert "without an emergency" in rectangle.finding
    assert "(on the sidewalk)" in rectangle.why
    assert rectangle.story[-1] == "Stands behind who is taken to be in its way, without an emergency."
    # the map's area holds them in its margin; what makes them a threat is the forecast of the ego
    assert (lanes.kind, lanes.outcome) == ("false", "false stop")
    assert "in the margin of 1.8 m" in lanes.why
    assert "does not know the road: there it is " in lanes.why
    assert "m to the right of where the ego will drive." in lanes.why
    for verdict in content.verdicts:
        assert "top for nobody in 1 of 2 runs" in verdict.headline


def test_scenes_are_lines_and_strategies_columns(folder: Path) -> None:
    content = page.page_content(read_folder(folder))
    accounts = {view.log: view.account for view in content.runs}
    matrix = score_matrix(read_runs(folder), accounts)
    assert matrix.columns == ["rectangular", "map"]
    assert [name for name, _ in matrix.lines] == [BEND, CROSSES]
    marks = [[cell.mark if cell else "" for cell in cells] for _, cells in matrix.lines]
    assert marks[0] == ["!", "!"]
    assert "!" not in marks[1]
    assert content.title == f"{BEND}, {CROSSES}"


def test_criticality_of_each_run_lies_beside(folder: Path) -> None:
    for log in read_runs(folder)["log"]:
        lines = (folder / "criticality" / f"{log}.csv").read_text().splitlines()
        times = [float(line.split(",")[0]) for line in lines[1:]]
        assert lines[0].startswith("time_s,time_to_collision_s,")
        assert times == sorted(set(times))
        assert len(times) > 50
