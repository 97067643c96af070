"""Protocols of files, run: the shipped one's tests are valid, and a user's own is run and scored."""

import io
import math
from dataclasses import replace
from pathlib import Path

import pandas as pd
import pytest
from rich.console import Console

from evaluation.protocols.errors import ProtocolError
from evaluation.protocols.from_file import FMVSS_127, TableProtocol, named_table
from evaluation.protocols.registry import named_protocol
from evaluation.runs.conflict import conflicts, unbraked
from evaluation.runs.specs import Conditions
from evaluation.studies.ncap.grid import grid_of_table
from evaluation.studies.ncap.run import run_grid
from evaluation.studies.ncap.validity import why_invalid_by_table

EXAMPLE = Path(__file__).parents[4] / "docs" / "examples" / "yard.toml"
KMH = 1 / 3.6


@pytest.fixture(scope="module")
def fmvss() -> TableProtocol:
    return named_table(FMVSS_127)


def test_every_test_of_fmvss_127_is_valid_and_met_when_it_should_be(fmvss: TableProtocol) -> None:
    """Unbraked, the target is met after the time of the start, or after half the other's braking."""
    grid = grid_of_table(fmvss)
    assert len(grid.runs) == len(fmvss.cells()) == 98
    one_speed = {}
    for run, cell in zip(grid.runs, fmvss.cells(), strict=True):
        one_speed[cell.scenario, cell.condition] = run, cell  # the fastest of each column
    known = conflicts([run.spec for run, _ in one_speed.values()])
    for run, cell in one_speed.values():
        test, column = fmvss.asked(cell)
        conflict = known[unbraked(run.spec)]
        assert why_invalid_by_table(test, column, conflict) == ""
        if not test.meets:
            continue
        touch = conflict.touch
        assert touch is not None
        assert column.place_percent is not None
        assert touch.place_percent() == pytest.approx(column.place_percent, abs=0.1)
        if test.scenario == "approach":
            assert touch.time_s == pytest.approx(test.parameters["Start_s"], abs=1e-3)
        elif test.scenario == "lead_braking":
            headway = float(column.parameters["Headway"])
            decel = float(column.parameters["Target_deceleration"])
            stop_s = cell.speed_kmh * KMH / decel  # then it stands, and the gap closes at the ego's speed
            closed = decel * stop_s**2 / 2
            late_s = math.sqrt(2 * headway / decel)
            if headway > closed:
                late_s = stop_s + (headway - closed) / (cell.speed_kmh * KMH)
            assert touch.time_s == pytest.approx(3.0 + late_s, abs=1e-3)


def test_the_obstructing_devices_stand_as_the_text_wants(fmvss: TableProtocol) -> None:
    """1.0 m right of the ego's side, 1.0 m before the child's near face and before each other."""
    from evaluation.studies.ncap.grid import load
    from scenarios.catalogue.library import scenario_path
    from scenarios.openscenario.running.engine import Engine

    test = next(test for test in fmvss.table.tests if test.scenario == "crossing_obstructed")
    entities = Engine(load(scenario_path(test.scenario), dict(test.parameters))).entities
    at = {name: k for k, name in enumerate(entities.name.tolist())}
    low = entities.boxes.center_m - entities.boxes.size_m / 2
    high = entities.boxes.center_m + entities.boxes.size_m / 2
    for name in ("Small car", "Large car"):
        assert entities.boxes.size_m[at[name]] == pytest.approx([4.023, 1.712])
        assert low[at["Ego"], 1] - high[at[name], 1] == pytest.approx(1.0)
    near_face_m = 450.0 - 0.298 / 2
    assert near_face_m - high[at["Small car"], 0] == pytest.approx(1.0)
    assert low[at["Small car"], 0] - high[at["Large car"], 0] == pytest.approx(1.0)


def shown(name: str, out: Path, conditions: Conditions) -> str:
    console = Console(file=io.StringIO(), width=200)
    run_grid([], name, conditions, out, 1, console)
    return console.file.getvalue()  # type: ignore[attr-defined,no-any-return]


def test_the_example_of_the_docs_is_run_and_scored(tmp_path: Path) -> None:
    warned = Conditions(("map",), adapts=False, settings=(("rule", "cascade"),))
    text = shown(str(EXAMPLE), tmp_path / "out", warned)
    assert named_protocol(str(EXAMPLE)).title in text
    assert "Worst cell, map: " in text
    assert "Source: made up" in text
    table = pd.read_csv(tmp_path / "out" / "cells.csv")
    assert set(table["state"]) == {"scored"}
    assert (tmp_path / "out" / "matrix_yard.png").read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "out" / "matrix_yard.html").is_file()


def test_the_example_of_the_docs_is_printed_there() -> None:
    printed = (EXAMPLE.parents[1] / "protocols.md").read_text().split("```toml\n")[1].split("```")[0]
    assert EXAMPLE.read_text().partition("\n")[2] == printed


SHORT = """
title = "short"
source = "made up"
[[tests]]
name = "standing car"
source = "made up"
scenario = "approach"
parameters = { Start_s = 2.0 }
speeds_kmh = [20]
pass = { impact_at_most_kmh = 0, warning = "given" }
"""


def test_a_rule_that_does_not_warn_is_told(tmp_path: Path) -> None:
    file = tmp_path / "short.toml"
    file.write_text(SHORT)
    text = shown(str(file), tmp_path / "out", Conditions(("map",), adapts=False))
    assert "standing car 0 of 1 tests passed" in " ".join(text.split())
    assert "0 W" in text
    assert "No run has a warning: the brake rule may give none." in text


TWIN = SHORT[SHORT.index("[[tests]]") :].replace("standing car", "standing-car")


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("Start_s = 2.0", "Start = 2.0", "tests[1], standing car, 20 km/h: "),
        ("Start_s = 2.0", "Start_s = -1", "tests[1], standing car, 20 km/h: "),
        ("[20]", "[200]", "tests[1], standing car, 200 km/h: "),
        (
            '"approach"',
            '"approach"\nspeed_parameter = "Start_s"',
            "speed_parameter: with Start_s the ego drives",
        ),
        ("Start_s = 2.0", "Illuminance = 1", "lighting: the scenario is by night"),
        ('"approach"', '"other.xosc"', "tests[1], standing car, 20 km/h: "),
        ('"approach"', '"cpna"', "tests[1], standing car, 20 km/h: "),
        (
            "[[tests]]",
            f"{TWIN}[[tests]]",
            "tests[2], standing car, 20 km/h: name: the log would be called as that of",
        ),
    ],
)
def test_what_a_scenario_is_not_is_one_line(tmp_path: Path, old: str, new: str, message: str) -> None:
    (tmp_path / "other.xosc").write_text("<OpenSCENARIO")
    file = tmp_path / "short.toml"
    text = SHORT.replace(old, new, 1)
    file.write_text(text.replace("Start_s = 2.0", "") if "speed_parameter" in new else text)
    with pytest.raises(ProtocolError) as caught:
        grid_of_table(named_table(file))
    assert str(caught.value).startswith(f"{file}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_target_beside_its_place_is_no_test(tmp_path: Path) -> None:
    file = tmp_path / "short.toml"
    beside = "place_percent = 30\nplace_tolerance_m = 0.3\nspeeds"
    for text, valid in ((beside, False), (beside.replace("30", "40"), True)):
        file.write_text(SHORT.replace("speeds", text, 1))
        protocol = named_table(file)
        (run,) = grid_of_table(protocol).runs
        (cell,) = protocol.cells()
        test, column = protocol.asked(cell)
        reason = why_invalid_by_table(test, column, conflicts([run.spec])[unbraked(run.spec)])
        # 20 % of 1.8 m are 0.36 m, 10 % are 0.18 m
        assert (reason == "") is valid
        assert valid or "0.36 m off" in reason
        touched = why_invalid_by_table(
            replace(test, meets=False), column, conflicts([run.spec])[unbraked(run.spec)]
        )
        assert touched.startswith("without braking the ego touches Target")
