"""Pass criteria of scenario files in the results of a command."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

from evaluation.results.criteria import CRITERIA_CSV, criteria_table
from evaluation.results.files import TABLE_MD
from scenarios.openscenario.running.driving.criteria import Criterion
from tests.evaluation.results.conftest import STOPPED
from tests.evaluation.views.conftest import call
from tests.scenarios.openscenario.conftest import at_time, condition, criterion, write_scenario


def test_a_run_has_its_criteria_in_its_results(tmp_path: Path) -> None:
    """At 10 m/s into a car 46 m ahead; with the brake there is no contact, and no 99 m are driven."""
    asked = (("CollisionTest", ""), ("DrivenDistanceTest", "99"), ("RunningStopTest", ""))
    criteria = "".join(criterion(name, value) for name, value in asked)
    stop = f"<StopTrigger><ConditionGroup>{criteria}{condition(at_time(10))}</ConditionGroup></StopTrigger>"
    scenario = write_scenario(tmp_path, stop=stop)
    out = tmp_path / "out"
    arguments = ("run", scenario, "--out", out, "--no-pictures", "--strategy", "rectangular", "--hold-speed")
    assert call(*arguments, "--quiet") == 0
    with (out / CRITERIA_CSV).open(newline="") as file:
        rows = {row["criterion"]: row for row in csv.DictReader(file)}
    assert {name: row["met"] for name, row in rows.items()} == {
        "CollisionTest": "true",
        "DrivenDistanceTest": "false",
        "RunningStopTest": "",
    }
    assert {row["strategy"] for row in rows.values()} == {"rectangular"}
    assert rows["DrivenDistanceTest"]["detail"].endswith(" m of 99 m")
    table = (out / TABLE_MD).read_text()
    assert "| CollisionTest | 1 of 1 |" in table
    assert "| DrivenDistanceTest | 0 of 1 |" in table
    assert "| RunningStopTest | not evaluated |" in table


def test_without_criteria_there_is_no_table(tmp_path: Path) -> None:
    scenario, out = write_scenario(tmp_path), tmp_path / "out"
    assert call("run", scenario, "--out", out, "--no-pictures", "--no-aeb", "--quiet") == 0
    assert not (out / CRITERIA_CSV).exists()


def test_a_criterion_that_a_strategy_has_not() -> None:
    """Of two runs of `map` one meets it; `rectangular` runs a file without it."""
    runs = [
        (STOPPED, [Criterion("CollisionTest", True)]),
        (STOPPED, [Criterion("CollisionTest", False)]),
        (replace(STOPPED, strategy="rectangular"), []),
    ]
    table = criteria_table(runs)
    assert table is not None
    assert table.rows == (("CollisionTest", "1 of 2", "–"),)
